"""`p2os monitor`: a robot's state, drawn as it comes."""

import json
import sys
from collections import deque
from typing import Annotated

import typer

from p2os.capture.describe import plain
from p2os.cli.captures.shown_page import NoBrowser, Viewed
from p2os.cli.groups import ROBOTS
from p2os.cli.held_robot import held
from p2os.cli.links.link_quality import LinkQuality
from p2os.cli.names import ReportedModel, RobotUrl
from p2os.cli.quantities import option
from p2os.cli.robots.dashboard import Dashboard, draw, line_of
from p2os.cli.robots.robot_page import opened_for
from p2os.client import Connected, GaveUp, LinkLost, Notice, PacketArrived, Robot, RobotState
from p2os.client.notices import words_of
from p2os.transport.wall_clock import wall_clock
from simbase.errors import MissingDependencyError
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from simbase.units import TIME

HELP = """Show a robot's state live, without moving it.

It shows pose, speeds, sonar ring, battery, bumpers, flags and link quality.
Ctrl-C ends it. After a lost link it reconnects. Without a terminal it prints
one line per packet.

\b
Examples:
  p2os monitor tcp:127.0.0.1:8101           the dashboard
  p2os monitor serial:/dev/ttyUSB0 --for 1min
  p2os monitor URL --json | jq .battery_v   one JSON object a packet
"""
#: How often the picture is renewed; packets come ten times a second.
PICTURES_PER_S = 10
NEWS_LINES = 4
#: What is reported on stderr where no dashboard shows it: what explains a gap in the lines.
LINK_NOTICES = (LinkLost, Connected, GaveUp)


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("monitor", help=HELP, rich_help_panel=ROBOTS)(monitor)


def monitor(
    url: RobotUrl,
    lasts_ns: Annotated[Nanos | None, option(TIME, "--for", purpose="End after so long.", above_zero=True)] = None,
    robot: ReportedModel = "",
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object a packet.")] = False,
    view: Viewed = False,
    no_browser: NoBrowser = False,
) -> None:
    """Show a robot."""
    with (
        opened_for(url, robot, is_viewed=view, is_opened=not no_browser) as opener,
        held(Robot(url, model=robot or None, auto_enable=False, opener=opener)) as client,
    ):
        if json_output or not sys.stdout.isatty():
            _print_states(client, lasts_ns, as_json=json_output)
        else:
            _show(client, url, lasts_ns)


def state_as_plain(state: RobotState, start_ns: Nanos = 0) -> dict[str, object]:
    """Return a state for JSON: SI units, time from `start_ns` on, sonar by number, None where there is no echo."""
    names = ("forward_mps", "turn_radps", "left_mps", "right_mps", "is_moving", "motors_enabled", "battery_v",
             "stall_left", "stall_right", "front_bumpers", "rear_bumpers", "compass_rad", "analog_v", "digital_in",
             "digital_out", "stop_button", "state_of_charge", "temperature_c")  # fmt: skip
    pose = {"x_m": state.pose.x_m, "y_m": state.pose.y_m, "heading_rad": state.pose.heading_rad}
    sonar = {str(echo.number): echo.range_m if echo.is_echo else None for echo in state.sonar}
    fields = {
        "t": (state.at_ns - start_ns) / NS_PER_S,
        **pose,
        **{name: getattr(state, name) for name in names},
        "sonar_m": sonar,
    }
    return {name: plain(value) for name, value in fields.items()}


def _print_states(client: Robot, lasts_ns: Nanos | None, *, as_json: bool) -> None:
    count, start_ns = 0, None
    client.on_event(lambda notice: _tell(notice) if isinstance(notice, LINK_NOTICES) else None)
    for state in client.states(None if lasts_ns is None else lasts_ns / NS_PER_S):
        start_ns = state.at_ns if start_ns is None else start_ns
        typer.echo(json.dumps(state_as_plain(state, start_ns)) if as_json else line_of(state))
        count += 1
    if not as_json:
        sys.stderr.write(f"{count} packets\n")
    client.wait_open(0.0)  # whoever asked for so long a time hears when the robot is gone at its end


def _tell(notice: Notice) -> None:
    sys.stderr.write(f"{words_of(notice)}\n")


def _show(client: Robot, url: str, lasts_ns: Nanos | None) -> None:
    try:
        from rich.live import Live

        from p2os.cli.console import ReadableConsole
    except ImportError as error:  # pragma: no cover - rich comes with every installation
        raise MissingDependencyError("the dashboard needs rich", extra="", hint="--json") from error
    news: deque[str] = deque(maxlen=NEWS_LINES)
    config = client.config
    quality = LinkQuality(config.sipcycle * NS_PER_MS if config is not None and config.sipcycle else None)
    client.on_event(lambda notice: None if isinstance(notice, PacketArrived) else news.append(words_of(notice)))
    client.on_state(lambda state: quality.packet(state.at_ns))
    identity = client.identity
    title = f"{identity.name or 'robot'} ({client.parameters.title}, {client.profile.value}) on {url}"
    ends = None if lasts_ns is None else wall_clock() + lasts_ns
    console = ReadableConsole()
    with Live(console=console, auto_refresh=False, screen=True) as live:
        while ends is None or wall_clock() < ends:
            dashboard = Dashboard(
                title=title, link=client.link, state=client.state, limits=client.limits, parameters=client.parameters,
                stats=client.stats, quality=quality, news=tuple(news),
            )  # fmt: skip
            live.update(draw(dashboard, console.width, console.height), refresh=True)
            client.sleep(1 / PICTURES_PER_S)
