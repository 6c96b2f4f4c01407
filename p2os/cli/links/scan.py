"""`p2os scan`: look for a robot on every port and at every speed, and identify it."""

import json
import sys
from dataclasses import asdict, dataclass, replace
from typing import Annotated

import typer

from p2os.cli.groups import LINKS
from p2os.cli.held_robot import ASKED, held, hold_robot
from p2os.cli.names import urls
from p2os.cli.quantities import option
from p2os.client import Connected, ConnectError, Robot
from p2os.client.settings import SEARCHED_BAUDS
from p2os.errors import TransportError
from p2os.robots.parameters import ParametersError, load_parameters
from p2os.transport.serial_port import list_serial_ports
from p2os.transport.url import DEFAULT_URL
from simbase.errors import P2osError, UsageError
from simbase.timing import NS_PER_MS, NS_PER_S
from simbase.units import BAUD

HELP = f"""Search for robots and identify them.

Without a URL it tries every serial port of this machine and {DEFAULT_URL}.
Each serial port is tried at its own speed and at {", ".join(map(str, SEARCHED_BAUDS))} bit/s, which
takes up to ten seconds a port. A robot that still streams to an earlier
program is stopped; motors stay off. Other devices receive a few bytes that mean
nothing to them.

\b
Examples:
  p2os scan                          every port
  p2os scan serial:/dev/ttyUSB0      one port, every speed
  p2os scan tcp:10.0.0.5:8101 --json
  p2os scan --baud 9600              one speed only

Ends with exit code 1 when nobody answers.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundRobot:
    """A robot and where it is."""

    url: str
    name: str
    robot_class: str
    subclass: str
    #: What the subclass stands for; empty if it is not known.
    title: str
    firmware: str
    baud: int | None
    #: From the first SYNC0 of the try that succeeded to the first packet.
    connect_ms: int


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("scan", help=HELP, rich_help_panel=LINKS)(scan)


def scan(
    urls: Annotated[list[str] | None, typer.Argument(help="Where to look.", metavar="URL", autocompletion=urls)] = None,
    baud: Annotated[
        list[int] | None,
        option(BAUD, "--baud", purpose="Try this speed only; may be repeated.", least="300", most="4000000"),
    ] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print a JSON list.")] = False,
) -> None:
    """Look for robots."""
    places = urls or [*(port["url"] for port in list_serial_ports()), DEFAULT_URL]
    hold_robot()
    found = []
    for place in places:
        sys.stderr.write(f"{place}: ")
        try:
            robot = identify(place, tuple(baud) if baud else SEARCHED_BAUDS)
        except (ConnectError, TransportError) as error:
            sys.stderr.write(f"no ({error})\n")
            continue
        except UsageError:
            sys.stderr.write("\n")
            raise
        sys.stderr.write("a robot\n")
        found.append(robot)
    if json_output:
        typer.echo(json.dumps([asdict(robot) for robot in found], indent=2))
    else:
        for robot in found:
            typer.echo(line_of(robot))
    if not found:
        raise P2osError(
            f"no robot on {len(places)} port{'' if len(places) == 1 else 's'}",
            hint="is it on, and the cable a null-modem one? p2os ports; docs/troubleshooting.md",
        )


def identify(url: str, bauds: tuple[int, ...] = SEARCHED_BAUDS) -> FoundRobot:
    """Return the identity of the robot on a line.

    Args:
        url: The line.
        bauds: Speeds to try on a serial line.

    Raises:
        UsageError: The URL is none.
        ConnectError, TransportError: Nobody answers, or there is no such port.
    """
    took_ns = 0

    def note(notice: object) -> None:
        nonlocal took_ns
        if isinstance(notice, Connected):
            took_ns = notice.took_ns

    robot = Robot(_at_first(url, bauds), settings=replace(ASKED, bauds=bauds))
    robot.on_event(note)
    with held(robot):
        identity, config = robot.identity, robot.config
        firmware = robot.profile.value
        if config is not None and config.firmware_version:
            firmware += f" {config.firmware_version}"
        rate = robot.baud
    where = url.split("?", maxsplit=1)[0] + (f"?baud={rate}" if rate else "")
    return FoundRobot(
        url=where, name=identity.name, robot_class=identity.robot_class, subclass=identity.subclass,
        title=_title(identity.subclass), firmware=firmware, baud=rate, connect_ms=took_ns // NS_PER_MS,
    )  # fmt: skip


def line_of(robot: FoundRobot) -> str:
    """Return a robot as one line."""
    title = f" ({robot.title})" if robot.title else " (unknown model)"
    return (
        f"{robot.url}  {robot.name or '(no name)'}: {robot.robot_class} {robot.subclass}{title}, {robot.firmware}, "
        f"answered in {robot.connect_ms * NS_PER_MS / NS_PER_S:.2f} s"
    )


def _at_first(url: str, bauds: tuple[int, ...]) -> str:
    """Return a serial URL with the first of the speeds to try, unless it names one itself."""
    return f"{url}?baud={bauds[0]}" if url.startswith("serial:") and "?" not in url else url


def _title(subclass: str) -> str:
    try:
        return load_parameters(subclass.lower()).title
    except ParametersError:
        return ""
