"""`p2os serve`: be a Pioneer on a line, for any P2OS program to drive.

Options and a fleet's file become a `FleetOrder`; `p2os.pioneer.serve` makes the robots and
serves them. What the robots do is printed on standard error, a line an event.

Invariant: no more than `MOST_LINES` event lines a second of a robot's own time, so that a
client that floods the line with syncs does not fill a disk; how many were left out is in
the next line.
"""

import contextlib
import json
import math
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.captures.shown_page import NoBrowser, Viewed
from p2os.cli.groups import ROBOTS
from p2os.cli.names import bodies, body_help, worlds
from p2os.cli.names import robots as robot_names
from p2os.cli.printing import queue_output
from p2os.cli.quantities import option
from p2os.cli.trust import Trusted, said
from p2os.cli.virtual.viewed_fleet import viewing
from p2os.pioneer.body.factory import BEST
from p2os.pioneer.controller import ControllerSettings
from p2os.pioneer.controller.flash import load_flash
from p2os.pioneer.devices.laser import read_laser
from p2os.pioneer.sensor_errors import load_sensor_errors
from p2os.pioneer.serve.control_line import ControlLine, write_stderr
from p2os.pioneer.serve.fleet import Fleet, open_hosts
from p2os.pioneer.serve.fleet_file import load_fleet
from p2os.pioneer.serve.fleet_order import (
    MOST_ROBOTS,
    FleetOrder,
    MadeFleet,
    RobotOrder,
    following_ports,
    make_fleet,
    read_aux,
)
from p2os.pioneer.serve.host import Host
from p2os.pioneer.serve.orders import status_line
from p2os.pioneer.world.model import Pose
from p2os.protocol.profiles import Profile
from p2os.transport import listen_url
from p2os.transport.url import DEFAULT_URL
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, Nanos
from simbase.trust import own_code
from simbase.units import ANGLE, BAUD, COUNT, FACTOR, LENGTH, SEED, TIME

#: chosen: several times what an eager client causes, and still readable.
MOST_LINES = 50
#: `--control` with this, and no option on a terminal, takes orders from standard input.
STANDARD_INPUT = "-"
#: chosen: a tenth of real time is still a debugger's pace; past a hundred no body keeps up.
SLOWEST, FASTEST = 0.01, 100.0
#: Options that a fleet's file takes the place of.
IN_FLEET_FILE = (
    "port", "robot", "world", "body", "seed", "for_client", "firmware", "lenient", "laser", "all_sonar", "rear_sonar",
    "flash", "errors", "baud", "robots",
    "at", "apart", "worlds_folder", "aux", "fault", "sync_limit_ns",
)  # fmt: skip

HELP = f"""Run a virtual Pioneer on a line, in real time, until Ctrl-C.

ARIA, player's p2os driver, ROS nodes and this project's programs connect to it
as to a real robot, one client at a time. When a client vanishes, the robot stops
at once and waits for the next. Type "help" while it runs for the faults to
inject, the inputs and the queries.

\b
Examples:
  p2os serve                          a 2-DX in a room on {DEFAULT_URL}
  p2os serve --port tcp:0.0.0.0:8101  the same, for other machines too
  p2os serve --port pty:/tmp/robot    a pseudo-terminal that programs open as a serial port
  p2os serve --port serial:/dev/ttyUSB0?baud=9600
  p2os serve --world arena --seed 7   among obstacles scattered from a seed
  p2os serve --baud 9600              with the timing of a real line
  p2os serve --errors realistic       with realistic errors of sonar, odometry and compass
  p2os serve --for aria --robot p3dx-sh   as MobileSim: laser, true pose, SIM_ commands
  p2os serve --laser 180deg,1deg,8m   with a laser of its own
  p2os serve --robots 3               three of them in one room, on ports 8101 to 8103
  p2os serve --robots 2 --at 0,0 --at 1.5m,0,180deg   face to face
  p2os serve --fleet fleet.toml       robots described in a file
  p2os serve --sync-limit 10s         drop clients without a session after 10 s
  p2os serve --fault "sonar-stuck 3 1.2"   sonar 3 always reads 1.2 m
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("serve", help=HELP, rich_help_panel=ROBOTS)(serve)


def serve(
    context: typer.Context,
    port: Annotated[
        list[str] | None, typer.Option(help="Where clients find the robot; again for one more.", metavar="URL")
    ] = None,
    robot: Annotated[
        str, typer.Option(help="Robot model, or a TOML file.", metavar="MODEL|FILE", autocompletion=robot_names)
    ] = "p2dx",
    world: Annotated[
        str, typer.Option(help="World, or a TOML file.", metavar="WORLD|FILE", autocompletion=worlds)
    ] = "room",
    body: Annotated[
        str,
        typer.Option(help=body_help(), metavar="BODY", autocompletion=bodies),
    ] = BEST,
    seed: Annotated[
        int, option(SEED, "--seed", purpose="Of a scattered world and of every sensor's error.", least="0", shown="0")
    ] = 0,
    for_client: Annotated[
        str | None,
        typer.Option("--for", help="What a client library expects: ARCOS, a laser, a simulator.", metavar="aria"),
    ] = None,
    firmware: Annotated[
        Profile | None,
        typer.Option(
            help="Whose packets it sends; by default those of the model's own firmware.",
            metavar="|".join(profile.value for profile in Profile),
        ),
    ] = None,
    lenient: Annotated[
        bool,
        typer.Option(
            "--lenient", help="Answer syncs in any order; execute any family's and a simulator's commands, as AMRISim."
        ),
    ] = False,
    laser: Annotated[
        str | None,
        typer.Option(help="A simulated laser on ARIA's packets.", metavar="MODEL|FIELD,STEP,RANGE"),
    ] = None,
    all_sonar: Annotated[
        bool, typer.Option("--all-sonar", help="Send every sonar in every packet, not two as a Pioneer 2 does.")
    ] = False,
    rear_sonar: Annotated[
        bool, typer.Option("--rear-sonar", help="Fit the rear ring too, where it is an option of the model.")
    ] = False,
    flash: Annotated[
        Path | None, typer.Option(help="TOML file with the robot's FLASH parameters.", metavar="FILE")
    ] = None,
    errors: Annotated[
        str, typer.Option(help="Sensors' errors: ideal, realistic, or a TOML file.", metavar="ideal|realistic|FILE")
    ] = "ideal",
    baud: Annotated[
        int | None,
        option(
            BAUD, "--baud", purpose="Speed of the line: bytes take that time on pty: and tcp: too.", above_zero=True
        ),
    ] = None,
    robots: Annotated[
        int,
        option(
            COUNT,
            "--robots",
            purpose="How many, on the ports that follow.",
            least="1",
            most=f"{MOST_ROBOTS}",
            shown="1",
        ),
    ] = 1,
    at: Annotated[
        list[str] | None,
        typer.Option(help="Where a robot begins, as 1.5m,0m,90deg; again for the next.", metavar="X,Y[,HEADING]"),
    ] = None,
    apart: Annotated[
        bool, typer.Option("--apart", help="A copy of the world for each robot, without the others.")
    ] = False,
    worlds_folder: Annotated[
        Path | None,
        typer.Option("--worlds", help="Folder whose files clients may load as worlds (LOADWORLD).", metavar="DIR"),
    ] = None,
    fleet: Annotated[
        Path | None, typer.Option(help="TOML file with the world and every robot.", metavar="FILE")
    ] = None,
    speed: Annotated[
        float,
        option(
            FACTOR, "--speed", purpose="Robot seconds a second.", least=f"{SLOWEST:g}", most=f"{FASTEST:g}", shown="1"
        ),
    ] = 1.0,
    aux: Annotated[
        list[str] | None, typer.Option(help="A line at an AUX port: 1=pty:/tmp/aux1.", metavar="N=URL")
    ] = None,
    fault: Annotated[
        list[str] | None, typer.Option(help='Injected from the start: "sonar-stuck 3 1.2".', metavar="WORDS")
    ] = None,
    sync_limit_ns: Annotated[
        Nanos | None,
        option(TIME, "--sync-limit", purpose="Drop a client that has no open session for so long.", above_zero=True),
    ] = None,
    control: Annotated[
        str | None, typer.Option(help="Where orders come from: a URL, or - for standard input.", metavar="URL")
    ] = None,
    status_ns: Annotated[
        Nanos | None, option(TIME, "--status", purpose="Print each robot's state so often.", least="100ms")
    ] = None,
    trust: Trusted = False,
    json_output: Annotated[bool, typer.Option("--json", help="Print the start line as JSON.")] = False,
    view: Viewed = False,
    no_browser: NoBrowser = False,
) -> None:
    """Serve virtual robots until Ctrl-C."""
    if fleet is not None:
        _refuse_beside_fleet(context)
        order = load_fleet(fleet, trust=said(trust))
    else:
        settings = ControllerSettings.of(
            client=for_client, firmware=firmware, lenient=lenient or None,
            laser=None if laser is None else read_laser(laser), all_sonar=all_sonar, rear_sonar=rear_sonar or None,
            flash=None if flash is None else load_flash(flash), errors=load_sensor_errors(errors), baud=baud,
        )  # fmt: skip
        ports = following_ports(port or [DEFAULT_URL], robots)
        if aux and len(ports) > 1:
            raise UsageError("--aux is for one robot", hint="--fleet FILE gives each robot its own")
        places = [_place(text) for text in at or ()]
        if len(places) > len(ports):
            raise UsageError(f"{len(places)} places for {len(ports)} robots", hint=f"--robots {len(places)}")
        first = RobotOrder(
            model=robot, settings=settings, faults=tuple(fault or ()), aux=tuple(read_aux(text) for text in aux or ()),
            sync_limit_ns=sync_limit_ns,
        )  # fmt: skip
        order = FleetOrder(
            robots=tuple(
                replace(first, port=url, at=places[number] if number < len(places) else None)
                for number, url in enumerate(ports)
            ),
            world=world, body=own_code(body), seed=seed, apart=apart, worlds=worlds_folder,
        )  # fmt: skip
    made = make_fleet(order)
    queue_output()
    with contextlib.ExitStack() as opened:
        orders = _control(control)
        if orders is not None:
            opened.callback(orders.close)
        who = "robot {}  " if len(made.robots) > 1 else ""
        events = [EventLines(_write, who.format(number + 1)).write_event for number in range(len(made.robots))]
        hosts: list[Host] = []
        page = opened.enter_context(
            viewing(order, made, events, lambda: hosts, is_viewed=view, is_opened=not no_browser)
        )
        hosts += open_hosts(order, made, events=page.events, speed=speed, listens=page.listens)
        for host in hosts:
            opened.callback(host.close)
        for number, host in enumerate(hosts):
            _print_start(order, made, number, host, as_json=json_output)
        sys.stdout.flush()
        for note in made.notes:
            _write(f"note: {note}\n")
        ticks = [] if status_ns is None else [(status_ns / NS_PER_S, partial(_show_status, hosts))]
        Fleet(hosts, control=orders, ticks=[*ticks, *page.ticks]).run(until=lambda: _exit_code(made) is not None)
    raise typer.Exit(_exit_code(made) or 0)


def _exit_code(made: MadeFleet) -> int | None:
    """Return the code with which a client wants all of this to end, or None."""
    return next((robot.exit_code for robot in made.robots if robot.exit_code is not None), None)


def _place(text: str) -> Pose:
    """Return the place that a text as `1.5m,0m,90deg` names.

    Raises:
        UsageError: It names none.
    """
    hint = "--at 1.5m,0m,90deg or --at 1.5m,0m"
    parts = text.split(",")
    if len(parts) not in {2, 3}:
        raise UsageError(f"--at {text!r} is no place", hint=hint)
    try:
        x_m, y_m, heading_rad = LENGTH.read(parts[0]), LENGTH.read(parts[1]), ANGLE.read((*parts, "0")[2])
    except UsageError as error:
        raise UsageError(f"--at {text!r} is no place: {error}", hint=hint) from error
    return Pose(x_m, y_m, heading_rad)


def _refuse_beside_fleet(context: typer.Context) -> None:
    for name in IN_FLEET_FILE:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            option_name = name.removesuffix("_ns").removesuffix("_client").removesuffix("_folder").replace("_", "-")
            raise UsageError(
                f"--{option_name} beside --fleet",
                hint="the fleet's file sets that",
            )


def _print_start(order: FleetOrder, made: MadeFleet, number: int, host: Host, *, as_json: bool) -> None:
    where, model, start = host.listener.description, order.robots[number].model, made.starts[number]
    place = start.x_m, start.y_m, math.degrees(start.heading_rad)
    if as_json:
        row = {"url": where, "robot": model, "world": order.world, "body": made.body, "seed": order.seed}
        typer.echo(json.dumps(row | {"at": [round(value, 6) for value in place]}))
    else:
        at = " at {:.2f}, {:.2f} m, {:.0f}°".format(*place) if len(order.robots) > 1 else ""
        typer.echo(f"{where}  {model} in {order.world}{at}, {made.body} body; Ctrl-C ends")
    for endpoint in host.aux:
        who = f"robot {number + 1}" if len(order.robots) > 1 else "the robot"
        typer.echo(f"AUX{endpoint.port} of {who}: {endpoint.listener.description}", err=as_json)


def _control(url: str | None) -> ControlLine | None:
    if url == STANDARD_INPUT or (url is None and os.isatty(0)):
        return ControlLine(None, _write)
    if url is None:
        return None
    listener = listen_url(url)
    _write(f"orders: {listener.description}\n")
    return ControlLine(listener)


def _show_status(hosts: Sequence[Host]) -> None:
    for number, host in enumerate(hosts, start=1):
        typer.echo(status_line(number, host))
    sys.stdout.flush()


def _write(text: str) -> None:
    with contextlib.suppress(OSError):  # a terminal that was closed must not keep the robots from stopping
        write_stderr(text)


class EventLines:
    """Prints the events of one robot, a line each.

    Args:
        write: Takes a line's text, with its end.
        who: Begins each line after the time; empty for a robot that is alone.
    """

    def __init__(self, write: Callable[[str], object], who: str = "") -> None:
        self._write = write
        self._who = who
        self._second = -1
        self._written = 0
        self._left_out = 0

    def write_event(self, now: Nanos, what: str, detail: str) -> None:
        """Write that something happened, or count it where its second is full."""
        if now // NS_PER_S != self._second:
            self._second, self._written = now // NS_PER_S, 0
        if self._written >= MOST_LINES:
            self._left_out += 1
            return
        self._written += 1
        if self._left_out:
            left_out, self._left_out = self._left_out, 0
            self._line(now, "left out", f"{left_out} lines like the last")
        self._line(now, what, detail)

    def _line(self, now: Nanos, what: str, detail: str) -> None:
        self._write(f"{now / NS_PER_S:10.3f} s  {self._who}{what}{': ' if detail else ''}{detail}\n")
