"""What names a robot, a world or a body on the command line: one way to write each, and what a shell offers for it.

The functions return what begins as was typed; a shell shows it at TAB.
"""

from importlib.resources import files
from typing import Annotated

import typer

#: What a URL begins with: where a robot is, or where one is waited for.
SCHEMES = ("serial:", "tcp:", "pty:")


def robots(incomplete: str) -> list[str]:
    """Return the robot models that ship."""
    return _shipped("p2os.robots", incomplete)


def worlds(incomplete: str) -> list[str]:
    """Return the worlds that ship."""
    from p2os.pioneer.world import known_worlds

    return [name for name in known_worlds() if name.startswith(incomplete)]


def body_help() -> str:
    """Return the help of `--body`: the engines that are installed, and what else may stand there."""
    from p2os.pioneer.body.factory import BEST, KINEMATIC, engines

    others = [name for name in engines() if name != KINEMATIC.name]
    return f"{', '.join([*others, f'{KINEMATIC.name} (plan view)'])}, or {BEST} installed."


def bodies(incomplete: str) -> list[str]:
    """Return the bodies."""
    from p2os.pioneer.body.factory import body_names

    return [name for name in body_names() if name.startswith(incomplete)]


def urls(incomplete: str) -> list[str]:
    """Return the serial ports that are there, and what other URLs begin with."""
    from p2os.transport.serial_port import list_serial_ports
    from p2os.transport.url import DEFAULT_URL

    found = [*(port["url"] for port in list_serial_ports()), DEFAULT_URL, *SCHEMES]
    return [url for url in found if url.startswith(incomplete)]


def _shipped(package: str, incomplete: str) -> list[str]:
    names = (entry.name for entry in files(package).iterdir())
    return sorted(
        name.removesuffix(".toml") for name in names if name.endswith(".toml") and name.startswith(incomplete)
    )


#: Where the robot is that a verb talks to.
RobotUrl = Annotated[str, typer.Argument(help="Where the robot is.", metavar="URL", autocompletion=urls)]
#: For a robot that reports its model itself.
ReportedModel = Annotated[
    str,
    typer.Option(
        "--robot", help="Robot model or TOML file, if it is not what the robot reports.", metavar="MODEL|FILE",
        autocompletion=robots, show_default=False,
    ),
]  # fmt: skip
