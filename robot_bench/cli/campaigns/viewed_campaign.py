"""A campaign's folder as something to view (an entry point of `p2os.view_sources`): what runs is loaded for one."""

from pathlib import Path

from p2os.view.targets import ViewTarget

#: As of `robot_bench.campaign.journal`, which loads the bench.
JOURNAL = "journal.jsonl"


def campaign_target(named: str) -> ViewTarget | None:
    """Return a campaign's folder; None where it is none.

    Raises:
        FileError: It has no report yet, or a damaged one.
    """
    folder = Path(named)
    if not (folder / JOURNAL).is_file():
        return None
    from robot_bench.cli.campaigns.campaign_page import target_in

    return target_in(folder)
