"""A robot's URL as something to view (an entry point of `p2os.view_sources`): what holds a robot is loaded for one."""

from p2os.view.targets import ViewTarget

#: Of a URL of a line.
SCHEMES = ("serial:", "tcp:", "pty:")


def robot_target(named: str) -> ViewTarget | None:
    """Return a robot at a URL, watched without being moved; None where it is no URL of a line."""
    if not named.startswith(SCHEMES):
        return None
    from p2os.cli.robots.robot_page import watched_target

    return watched_target(named)
