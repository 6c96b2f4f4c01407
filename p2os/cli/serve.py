"""`p2os serve`: be a Pioneer on a line, for any P2OS program to drive."""

import json
import signal
import sys
from types import FrameType
from typing import Annotated

import typer

from p2os.parameters import load_parameters
from p2os.pioneer.body import make_body
from p2os.pioneer.controller import ControllerSettings, Pioneer, SonarPerSip
from p2os.pioneer.host import Host
from p2os.pioneer.world import load_world
from p2os.profiles import Profile
from p2os.timing import NS_PER_S, Nanos
from p2os.transport import listen_url

DEFAULT_PORT = "tcp:127.0.0.1:8101"

HELP = f"""Be a Pioneer robot on a line, in real time, until Ctrl-C.

ARIA, player's p2os driver, ROS nodes and this project's own programs connect to
it as to a real robot. One client at a time; a second one is refused. When a
client vanishes the robot stops at once and waits for the next.

\b
Examples:
  p2os serve                          a 2-DX in a room on {DEFAULT_PORT}
  p2os serve --port tcp:0.0.0.0:8101  the same, for other machines too
  p2os serve --port pty:/tmp/robot    on a terminal that programs open as a serial port
  p2os serve --port serial:/dev/ttyUSB0?baud=9600
  p2os serve --world arena --seed 7   among obstacles scattered from a seed
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("serve", help=HELP)(serve)


def serve(
    port: Annotated[str, typer.Option(help="Where clients find the robot.", metavar="URL")] = DEFAULT_PORT,
    robot: Annotated[str, typer.Option(help="Robot model, or a TOML file.")] = "p2dx",
    world: Annotated[str, typer.Option(help="World, or a TOML file.")] = "room",
    body: Annotated[str, typer.Option(help="Physics: bullet, or kinematic (plan view).")] = "bullet",
    seed: Annotated[int, typer.Option(help="Seed of a world that is scattered.")] = 0,
    firmware: Annotated[
        Profile, typer.Option(help="Whose packets it sends; some clients of newer robots need ARCOS.")
    ] = Profile.P2OS,
    all_sonar: Annotated[
        bool, typer.Option("--all-sonar", help="Send every sonar in every packet, not two as a Pioneer 2 does.")
    ] = False,
    json_output: Annotated[bool, typer.Option("--json", help="Print the start line as JSON.")] = False,
) -> None:
    """Serve a virtual robot until Ctrl-C."""
    sonar = SonarPerSip.ALL if all_sonar else SonarPerSip.TWO
    pioneer = make_pioneer(
        robot=robot,
        world=world,
        body=body,
        seed=seed,
        settings=ControllerSettings(profile=firmware, sonar_per_sip=sonar),
    )
    listener = listen_url(port)
    pioneer.on_event = _tell
    host = Host(pioneer, listener, on_event=_tell)
    if json_output:
        start = {"url": listener.description, "robot": robot, "world": world, "body": body, "seed": seed}
        typer.echo(json.dumps(start))
    else:
        typer.echo(f"{listener.description}  {robot} in {world}, {body} body; Ctrl-C ends")
    sys.stdout.flush()
    note = getattr(pioneer.body, "note", None)
    if note:
        sys.stderr.write(f"note: {note}\n")
    for number in (signal.SIGINT, signal.SIGTERM):  # SIGINT too: a shell starts background programs deaf to it
        signal.signal(number, _end)
    host.run()


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


def _tell(now: Nanos, what: str, detail: str) -> None:
    sys.stderr.write(f"{now / NS_PER_S:10.3f} s  {what}{': ' if detail else ''}{detail}\n")
    sys.stderr.flush()


def _end(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt
