"""`p2os serve`: be a Pioneer on a line, for any P2OS program to drive."""

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.signals import end_on_signals
from p2os.errors import UsageError
from p2os.parameters import load_parameters
from p2os.pioneer.aux_seat import AuxSeat
from p2os.pioneer.body import make_body
from p2os.pioneer.control_line import ControlLine
from p2os.pioneer.controller import ControllerSettings, Pioneer, SonarPerSip
from p2os.pioneer.flash import BAUD_RATES, load_flash
from p2os.pioneer.fleet import Fleet
from p2os.pioneer.host import Host
from p2os.pioneer.orders import status_line
from p2os.pioneer.sensor_errors import load_sensor_errors
from p2os.pioneer.world import load_world
from p2os.profiles import Profile
from p2os.timing import NS_PER_S, Nanos
from p2os.transport import Listener, PtyUrl, SerialUrl, TcpUrl, listen_url, parse_url

DEFAULT_PORT = "tcp:127.0.0.1:8101"
#: `--control` with this, and no option on a terminal, takes orders from standard input.
STANDARD_INPUT = "-"
#: chosen: a tenth of real time is still a debugger's pace; past a hundred no body keeps up.
SLOWEST, FASTEST = 0.01, 100.0
#: The AUX ports (H8 manual: AUX1 to AUX3).
AUX_PORTS = ("1", "2", "3")

HELP = f"""Be a Pioneer robot on a line, in real time, until Ctrl-C.

ARIA, player's p2os driver, ROS nodes and this project's own programs connect to
it as to a real robot. One client at a time; a second one is refused. When a
client vanishes the robot stops at once and waits for the next. Type "help" while
it runs to see what can be broken, pressed and asked.

\b
Examples:
  p2os serve                          a 2-DX in a room on {DEFAULT_PORT}
  p2os serve --port tcp:0.0.0.0:8101  the same, for other machines too
  p2os serve --port pty:/tmp/robot    on a terminal that programs open as a serial port
  p2os serve --port serial:/dev/ttyUSB0?baud=9600
  p2os serve --world arena --seed 7   among obstacles scattered from a seed
  p2os serve --baud 9600              bytes take the time of a real line
  p2os serve --errors realistic       sonar, odometry and compass err as real ones
  p2os serve --robots 3               three of them, on ports 8101 to 8103
  p2os serve --fault "sonar-stuck 3 1.2"   sonar 3 says 1.2 m whatever comes
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("serve", help=HELP)(serve)


def serve(
    port: Annotated[
        list[str] | None, typer.Option(help="Where clients find the robot; again for one more.", metavar="URL")
    ] = None,
    robot: Annotated[str, typer.Option(help="Robot model, or a TOML file.")] = "p2dx",
    world: Annotated[str, typer.Option(help="World, or a TOML file.")] = "room",
    body: Annotated[str, typer.Option(help="Physics: bullet, mujoco, or kinematic (plan view).")] = "bullet",
    seed: Annotated[int, typer.Option(help="Seed of a scattered world and of every sensor's error.")] = 0,
    firmware: Annotated[
        Profile, typer.Option(help="Whose packets it sends; some clients of newer robots need ARCOS.")
    ] = Profile.P2OS,
    lenient: Annotated[
        bool, typer.Option("--lenient", help="Answer syncs in any order and obey any family's commands, as AMRISim.")
    ] = False,
    all_sonar: Annotated[
        bool, typer.Option("--all-sonar", help="Send every sonar in every packet, not two as a Pioneer 2 does.")
    ] = False,
    flash: Annotated[Path | None, typer.Option(help="TOML file with the robot's FLASH parameters.")] = None,
    errors: Annotated[
        str, typer.Option(help="Sensors' errors: ideal, realistic, or a TOML file.", metavar="NAME")
    ] = "ideal",
    baud: Annotated[
        int | None, typer.Option(help="Speed of the line, bit/s: bytes take that time on pty: and tcp: too.")
    ] = None,
    robots: Annotated[int, typer.Option(help="How many, on the ports that follow.", min=1, max=256)] = 1,
    speed: Annotated[
        float, typer.Option(help="Robot seconds a second.", min=SLOWEST, max=FASTEST, metavar="FACTOR")
    ] = 1.0,
    aux: Annotated[
        list[str] | None, typer.Option(help="A line at an AUX port: 1=pty:/tmp/aux1.", metavar="N=URL")
    ] = None,
    fault: Annotated[
        list[str] | None, typer.Option(help='Broken from the start: "sonar-stuck 3 1.2".', metavar="WORDS")
    ] = None,
    control: Annotated[
        str | None, typer.Option(help="Where orders come: a URL, or - for standard input.", metavar="URL")
    ] = None,
    status: Annotated[
        float | None, typer.Option(help="Print each robot's state so often, seconds.", min=0.1, metavar="S")
    ] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print the start line as JSON.")] = False,
) -> None:
    """Serve virtual robots until Ctrl-C."""
    ports = port_urls(port or [DEFAULT_PORT], robots)
    settings = ControllerSettings(
        profile=firmware, lenient=lenient, sonar_per_sip=SonarPerSip.ALL if all_sonar else SonarPerSip.TWO,
        errors=load_sensor_errors(errors), seed=seed,
    )  # fmt: skip
    if flash is not None:
        settings = settings.with_flash(load_flash(flash))
    seats = aux_urls(aux or [], len(ports))
    hosts: list[Host] = []
    try:
        for number, url in enumerate(ports, start=1):
            speed_of_line = baud if baud is not None else _serial_baud(url)
            pioneer = make_pioneer(
                robot=robot, world=world, body=body, seed=seed,
                settings=replace(settings, baud=speed_of_line, seed=seed + number - 1),
            )  # fmt: skip
            for words in fault or ():
                pioneer.do(f"fault {words}", 0)
            pioneer.on_event = on_event = partial(_tell, f"robot {number}  " if len(ports) > 1 else "")
            hosts.append(
                Host(
                    pioneer, listen_url(url), on_event=on_event, speed=speed,
                    paced=not url.startswith("serial:"), aux=seats if number == 1 else (),
                )
            )  # fmt: skip
    except BaseException:
        for host in hosts:
            host.close()
        raise
    for host in hosts:
        where = host.listener.description
        if json_output:
            start = {"url": where, "robot": robot, "world": world, "body": body, "seed": seed}
            typer.echo(json.dumps(start))
        else:
            typer.echo(f"{where}  {robot} in {world}, {body} body; Ctrl-C ends")
    for seat in seats:
        typer.echo(f"AUX{seat.port} of the first robot: {seat.listener.description}", err=json_output)
    sys.stdout.flush()
    note = getattr(hosts[0].pioneer.body, "note", None)
    if note:
        sys.stderr.write(f"note: {note}\n")
    end_on_signals()
    tick = None if status is None else (status, partial(_show_status, hosts))
    Fleet(hosts, control=_control(control), on_tick=tick).run()


def make_pioneer(
    *, robot: str, world: str, body: str, seed: int = 0, settings: ControllerSettings | None = None
) -> Pioneer:
    """Return a virtual robot standing at the start of a world.

    Raises:
        UsageError: there is no such body.
        ParametersError: there is no such robot.
        WorldError: the world cannot be read.
        MissingDependencyError: the body needs a package that is not installed.
    """
    parameters = load_parameters(robot)
    place = load_world(world, seed=seed)
    physical = make_body(body, place, parameters)
    physical.reset(place.start, seed)
    return Pioneer(parameters=parameters, body=physical, settings=settings)


def port_urls(given: Sequence[str], robots: int) -> list[str]:
    """Return a URL a robot: those given, then those that follow the last one.

    Raises:
        UsageError: A text is no URL, or nothing follows the last one.
    """
    found = list(given)
    for text in found:
        parse_url(text)
    last, base = parse_url(found[-1]), len(found)
    for step in range(1, robots - base + 1):
        if isinstance(last, TcpUrl):
            if last.port + step > 0xFFFF:
                raise UsageError(f"{robots} robots from {last} on: ports end at 65535")
            found.append(str(replace(last, port=last.port and last.port + step)))
        elif isinstance(last, PtyUrl):
            found.append(f"pty:{last.path}{step + 1}" if last.path else "pty:")
        else:
            raise UsageError(f"no port follows {last}", hint="name each robot's own: --port A --port B")
    return found


def aux_urls(given: Sequence[str], robots: int) -> list[AuxSeat]:
    """Return who hangs at the AUX ports.

    Raises:
        UsageError: A text is not N=URL, or a port is named twice.
        TransportError: The place is taken.
    """
    seats: dict[int, Listener] = {}
    if given and robots > 1:
        raise UsageError("--aux is for one robot", hint="serve each robot by itself")
    for text in given:
        number, equals, url = text.partition("=")
        if not equals or number not in AUX_PORTS or int(number) in seats:
            raise UsageError(f"--aux {text!r} names no AUX port", hint="--aux 1=pty:/tmp/aux1; ports are 1, 2 and 3")
        seats[int(number)] = listen_url(url)
    return [AuxSeat(number, listener) for number, listener in seats.items()]


def _serial_baud(url: str) -> int | None:
    """Return the speed of a real serial port, where the robot knows such a one."""
    parsed = parse_url(url)
    return parsed.baud if isinstance(parsed, SerialUrl) and parsed.baud in BAUD_RATES else None


def _control(url: str | None) -> ControlLine | None:
    if url == STANDARD_INPUT or (url is None and os.isatty(0)):
        return ControlLine(None)
    if url is None:
        return None
    listener = listen_url(url)
    sys.stderr.write(f"orders: {listener.description}\n")
    return ControlLine(listener)


def _show_status(hosts: Sequence[Host]) -> None:
    for number, host in enumerate(hosts, start=1):
        typer.echo(status_line(number, host))
    sys.stdout.flush()


def _tell(who: str, now: Nanos, what: str, detail: str) -> None:
    sys.stderr.write(f"{now / NS_PER_S:10.3f} s  {who}{what}{': ' if detail else ''}{detail}\n")
    sys.stderr.flush()
