"""`p2os view`: a run, a capture or whatever else can be shown, on a page in the browser."""

from typing import Annotated

import typer

from p2os.cli.captures.shown_page import HOST, NoBrowser, shown
from p2os.cli.groups import BENCH
from p2os.cli.quantities import option
from p2os.view.targets import target_of
from simbase.units import PORT

HELP = """Look at a run, capture, scenario or robot in the browser.

TARGET is a run folder, a capture (pcap, a recording, hex), a scenario, which is
then run at the pace of the clock, or the URL of a robot, which is watched and not
moved. The page is served on this machine alone, and
its link holds a token: nobody else gets in. It is there until Ctrl-C.

\b
Examples:
  p2os view runs/dodge-001          a run: robot, pins, packets on one time axis
  p2os view lab.pcap                a conversation with a robot, byte by byte
  p2os view dodge                   the scenario, as it runs
  p2os view tcp:127.0.0.1:8101      a robot, motors off
  p2os view dodge --no-browser      prints the link alone
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("view", help=HELP, rich_help_panel=BENCH)(view)


def view(
    target: Annotated[str, typer.Argument(help="Run folder, capture, scenario, or a robot's URL.", metavar="TARGET")],
    no_browser: NoBrowser = False,
    port: Annotated[
        int, option(PORT, "--port", purpose="Where it is served; 0 takes a free one.", least="0", most="65535")
    ] = 0,
    host: Annotated[
        str, typer.Option(help="Where it is served; another one than this is seen from outside.", metavar="HOST")
    ] = HOST,
) -> None:
    """Show something until Ctrl-C."""
    found = target_of(target)
    with shown(found.source, is_opened=not no_browser, host=host, port=port) as page:
        if found.run is not None:
            found.run()
        page.wait()
