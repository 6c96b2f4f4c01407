"""Groups of verbs, in the order in which help lists them: first what everybody begins with."""

from simbase.command_line.help_pages import VerbList

BENCH, ROBOTS, CAPTURES, LINKS = "Bench", "Robots", "Captures", "Links"


class GroupedVerbs(VerbList):
    """The page of `p2os`; groups that packages above bring come after these."""

    groups = (BENCH, ROBOTS, CAPTURES, LINKS)
