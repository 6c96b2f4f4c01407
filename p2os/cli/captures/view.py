"""`p2os view`: a run, a capture or whatever else can be shown, on a page in the browser."""

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

import typer

from p2os.cli.captures.shown_page import HOST, NoBrowser, shown
from p2os.cli.groups import BENCH
from p2os.cli.quantities import option
from p2os.view.run_control import MOST_DPS as FASTEST_DPS
from p2os.view.run_control import MOST_MPS as FASTEST_MPS
from p2os.view.targets import target_of
from simbase.command_line.gdb_option import GDB_PORT, usual_port
from simbase.command_line.help_pages import Usual, VerbPage
from simbase.errors import UsageError
from simbase.units import PORT, SPEED, TURN_RATE

#: Speeds of a key that is held, as of `p2os teleop`: m/s and deg/s.
MOST_MPS, MOST_DPS = 0.3, 45.0

HELP = """View a run, capture, scenario or robot in the browser.

TARGET is a folder of a run or a campaign, a capture (pcap, recording, hex), a
scenario, which runs in real time, or a robot's URL. A robot is not moved unless
--drive is given: then keys, the stick or a pad drive it while held. It stops on
release, on leaving the page, or when the page falls silent. The page is served
to this machine only and its link holds a token. Ctrl-C ends it.

\b
Examples:
  p2os view runs/dodge-001          a run: robot, pins, packets on one time axis
  p2os view lab.pcap                a conversation with a robot, byte by byte
  p2os view dodge                   the scenario, as it runs
  p2os view tcp:127.0.0.1:8101      a robot, motors off
  p2os view serial:/dev/ttyUSB0 --drive --vel 150mm/s   driven from the page
  p2os view dodge --no-browser      prints the link alone
  p2os view dodge --gdb 3333        GDB at it, too: both see the same halt
"""


class ViewPage(VerbPage):
    """Lets `--gdb` stand without a port."""

    usual: ClassVar[Mapping[str, Usual]] = {"--gdb": usual_port}


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("view", help=HELP, rich_help_panel=BENCH, cls=ViewPage)(view)


def view(
    target: Annotated[str, typer.Argument(help="Run folder, capture, scenario, or a robot's URL.", metavar="TARGET")],
    drive: Annotated[bool, typer.Option("--drive", help="Of a robot at a port: let the page drive it.")] = False,
    vel: Annotated[
        float | None,
        option(SPEED, "--vel", purpose="With --drive: greatest speed.", above_zero=True, shown=f"{MOST_MPS:g}m/s"),
    ] = None,
    turn_rate: Annotated[
        float | None,
        option(
            TURN_RATE,
            "--turn-rate",
            purpose="With --drive: greatest turning speed.",
            above_zero=True,
            shown=f"{MOST_DPS:g}deg/s",
        ),
    ] = None,
    gdb: Annotated[
        int | None,
        option(
            PORT,
            "--gdb",
            purpose=f"Of a scenario: GDB may come at this TCP port, {GDB_PORT} if none is named; 0 takes a free one.",
            metavar="[PORT]",
            least="0",
            most="65535",
        ),
    ] = None,
    no_browser: NoBrowser = False,
    port: Annotated[
        int, option(PORT, "--port", purpose="Where it is served; 0 takes a free one.", least="0", most="65535")
    ] = 0,
    host: Annotated[
        str, typer.Option(help="Where it is served; another one than this is seen from outside.", metavar="HOST")
    ] = HOST,
) -> None:
    """Show something until Ctrl-C."""
    if not drive and (vel is not None or turn_rate is not None):
        raise UsageError(f"{'--vel' if vel is not None else '--turn-rate'} goes with --drive only", hint="add --drive")
    found = target_of(target)
    if drive and found.driven is None:
        raise UsageError(f"--drive is for a robot at a port, and {target!r} is none", hint="tcp:, serial: or pty:")
    if drive and found.driven is not None:
        most_dps = MOST_DPS if turn_rate is None else math.degrees(turn_rate)
        found = found.driven(min(vel or MOST_MPS, FASTEST_MPS), min(most_dps, FASTEST_DPS))
    if gdb is not None and found.debugged is None:
        raise UsageError(f"--gdb is for a scenario that runs, and {target!r} is none", hint="p2os view dodge --gdb")
    if gdb is not None and found.debugged is not None:
        found = found.debugged(gdb)
    with shown(found.source, is_opened=not no_browser, host=host, port=port) as page:
        if found.run is not None:
            found.run()
        page.wait()
