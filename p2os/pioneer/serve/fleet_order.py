"""What a fleet is to be, as plain values, and the robots made of it.

An order comes from the options of `p2os serve`, from a file (`fleet_file`), or from a program.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.body.factory import BEST, body_note, make_scene, resolve_body
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.controller.settings import ControllerSettings
from p2os.pioneer.serve.multi_robot_world import MultiRobotWorld
from p2os.pioneer.serve.world_loader import WorldLoader
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Pose, World
from p2os.pioneer.world.start_places import start_places
from p2os.protocol.bauds import BAUDS
from p2os.robots.parameters import RobotParameters, load_parameters
from p2os.toml_file import is_folder
from p2os.transport import PtyUrl, SerialUrl, TcpUrl, parse_url
from p2os.transport.url import DEFAULT_URL
from simbase.errors import UsageError, shown_name
from simbase.timing import Nanos

#: The AUX ports (H8 manual: AUX1 to AUX3).
AUX_PORTS = (1, 2, 3)
#: chosen: more than two cores carry; a larger number is a typing error.
MOST_ROBOTS = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotOrder:
    """One robot.

    Args:
        port: Where its clients find it.
        model: Name or file.
        at: Where it begins; None: beside the others. Its height is the floor's.
        settings: How its firmware behaves; a line without a speed takes that of a real serial port.
        faults: What is injected from the start, in the words of `faults`.
        aux: (AUX port, URL) of what hangs there.
        sync_limit_ns: A client without an open session for so many nanoseconds is let go; None: never.

    Raises:
        UsageError: An AUX port is none, or named twice; the limit is not positive.
    """

    port: str = DEFAULT_URL
    model: str = "p2dx"
    at: Pose | None = None
    settings: ControllerSettings = field(default_factory=ControllerSettings)
    faults: tuple[str, ...] = ()
    aux: tuple[tuple[int, str], ...] = ()
    sync_limit_ns: Nanos | None = None

    def __post_init__(self) -> None:
        if self.sync_limit_ns is not None and self.sync_limit_ns <= 0:
            raise UsageError(f"a limit of {self.sync_limit_ns} ns for synchronising must be more than 0")
        ports = [number for number, _ in self.aux]
        if len(set(ports)) < len(ports) or not set(ports) <= set(AUX_PORTS):
            raise UsageError(f"AUX ports {ports}: each of 1, 2 and 3 once at most", hint="1=pty:/tmp/aux1")


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetOrder:
    """All robots, and where they are.

    Args:
        robots: At least one, the first first: the order in which they move.
        world: Name or file.
        body: `kinematic`, `bullet`, `mujoco`, or `best`: the best that is installed.
        seed: Of a scattered world; robot N errs by this and N - 1 more.
        apart: Each has a copy of the world, without the others.
        cross_talk: Whether sonar hear the pings of the other robots of the world.
        worlds: Folder whose files clients may load as worlds (LOADWORLD); None: only what ships.
        source: What it was read from, for messages; empty: nothing.

    Raises:
        UsageError: There is no robot, or there are too many; two share a port, or a port is no URL; `worlds` is no
            folder.
    """

    robots: tuple[RobotOrder, ...]
    world: str = "room"
    body: str = BEST
    seed: int = 0
    apart: bool = False
    cross_talk: bool = True
    worlds: Path | None = None
    source: str = ""

    def __post_init__(self) -> None:
        if self.worlds is not None and not is_folder(self.worlds):
            raise UsageError(f"no folder {shown_name(self.worlds)}", hint="--worlds is for the folder with world files")
        if not 1 <= len(self.robots) <= MOST_ROBOTS:
            raise UsageError(f"{len(self.robots)} robots are not between 1 and {MOST_ROBOTS}")
        taken: set[str] = set()
        for port in (str(parse_url(robot.port)) for robot in self.robots):
            if port in taken and not port.endswith(":0") and port != "pty:":
                raise UsageError(f"two robots on {port}", hint="each has its own port")
            taken.add(port)


@dataclass(frozen=True, slots=True)
class MadeFleet:
    """The robots of an order."""

    robots: tuple[Pioneer, ...]
    starts: tuple[Pose, ...]
    #: Which body all of them have, by name.
    body: str
    #: What a reader of a result has to know of it.
    notes: tuple[str, ...]
    #: Brings robots that share a world through time; None where each is alone in its own.
    multi_robot_world: MultiRobotWorld | None


def make_fleet(order: FleetOrder) -> MadeFleet:
    """Return robots that stand at their places at time 0.

    Raises:
        UsageError: There is no such body, a place is taken, or there is no room.
        ParametersError: There is no such robot.
        WorldError: The world cannot be read.
        MissingDependencyError: The body needs a package that is not installed.
    """
    known: dict[str, RobotParameters] = {}
    for robot in order.robots:
        if robot.model not in known:
            known[robot.model] = load_parameters(robot.model)
    world = load_world(order.world, seed=order.seed)
    models = [
        known[robot.model].with_every_sonar() if robot.settings.rear_sonar else known[robot.model]
        for robot in order.robots
    ]
    starts = _starts(order, world, models)
    name = resolve_body(order.body)
    if order.apart:
        each = zip(models, starts, strict=True)
        scenes = [make_scene(name, world, [model], [start], order.seed, trust=False) for model, start in each]
    else:
        scenes = [make_scene(name, world, models, starts, order.seed, trust=False)]
    bodies = [body for scene in scenes for body in scene.bodies]
    made: list[tuple[Pioneer, RobotBody]] = []
    for number, (robot, model, body) in enumerate(zip(order.robots, models, bodies, strict=True)):
        settings = replace(robot.settings, seed=order.seed + number)
        if settings.baud is None:
            settings = replace(settings, baud=serial_baud(robot.port))
        made.append((Pioneer(parameters=model, body=body, settings=settings, faults=robot.faults), body))
    robots = tuple(pioneer for pioneer, _ in made)
    is_shared = len(made) > 1 and not order.apart
    multi_robot_world = MultiRobotWorld(robots, scenes[0], cross_talk=order.cross_talk) if is_shared else None
    for together in (robots,) if is_shared else tuple((robot,) for robot in robots):
        loader = WorldLoader(
            robots=together, multi_robot_world=multi_robot_world, first=order.world, folder=order.worlds, body=name,
            seed=order.seed,
        )  # fmt: skip
        for pioneer in together:
            pioneer.loads_world = loader.load
    notes = tuple(note for note in (body_note(order.body), made[0][1].note) if note)
    return MadeFleet(robots, starts, name, notes, multi_robot_world)


def following_ports(given: Sequence[str], robots: int) -> list[str]:
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


def serial_baud(url: str) -> int | None:
    """Return the speed of a real serial port, where the robot knows such a one."""
    parsed = parse_url(url)
    return parsed.baud if isinstance(parsed, SerialUrl) and parsed.baud in BAUDS else None


def read_aux(text: str) -> tuple[int, str]:
    """Return the AUX port and the URL of a text as `1=pty:/tmp/aux1`.

    Raises:
        UsageError: It is no such text.
    """
    number, equals, url = text.partition("=")
    if not equals or number not in {str(port) for port in AUX_PORTS}:
        raise UsageError(f"{text!r} names no AUX port", hint="1=pty:/tmp/aux1; ports are 1, 2 and 3")
    parse_url(url)
    return int(number), url


def _starts(order: FleetOrder, world: World, models: Sequence[RobotParameters]) -> tuple[Pose, ...]:
    try:
        return _places(order, world, models)
    except UsageError as error:
        if not order.source:
            raise
        raise UsageError(f"{order.source}: {error}", hint=error.hint) from error


def _places(order: FleetOrder, world: World, models: Sequence[RobotParameters]) -> tuple[Pose, ...]:
    given = [robot.at for robot in order.robots]
    if order.apart or len(models) == 1:
        return tuple(
            start for model, pose in zip(models, given, strict=True) for start in start_places(world, [model], [pose])
        )
    return start_places(world, models, given)
