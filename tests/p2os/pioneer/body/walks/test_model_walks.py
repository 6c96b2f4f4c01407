"""What engines are handed of worlds and robots, how motors are watched, and what another program is asked, as approved."""

# ruff: noqa: E501  # rows of tables stand as they are

import math
import random
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from importlib.util import find_spec
from types import ModuleType
from unittest.mock import patch

from p2os.errors import WorldError
from p2os.pioneer.body import contacts, physical
from p2os.pioneer.body.contacts import APART_STEPS, ContactCounter
from p2os.pioneer.body.contract import Hit, RobotBody, RobotScene
from p2os.pioneer.body.engine_body import EngineBody
from p2os.pioneer.body.factory import body_note, make_body, make_scene
from p2os.pioneer.body.outside import messages
from p2os.pioneer.body.outside.address import Address, is_address
from p2os.pioneer.body.outside.messages import FIELDS, REQUESTS, Message, Request, decode, encode, encode_request
from p2os.pioneer.body.physical import Chassis
from p2os.pioneer.body.rim_work import RimLoad, mean_magnitude
from p2os.pioneer.sonar.ring import Cone
from p2os.pioneer.world.model import Mesh, Obstacle, ObstacleKind, Pose, Walk, World
from p2os.pioneer.world.plan import Bands
from p2os.robots.parameters import load_parameters
from simbase.errors import P2osError
from tests.p2os.pioneer.body.outside.served import Served, served
from tests.p2os.pioneer.body.walks.test_engine_walks import FAN, MESH, RAMP, THINGS
from tests.p2os.pioneer.world.walks.things import drawn_thing
from tests.tools.suite.approved import Trace, judge_of, refusal, said, tried
from tests.tools.suite.declared import declared_of

MODELS = tuple(map(load_parameters, ("p2dx", "p3at", "amigo-sh", "patrolbot-sh", "seekur")))
#: What of a model of MuJoCo says what a world was made of; of meshes places and turns are the engine's own.
ARRAYS = (
    "geom_type", "geom_size", "geom_contype", "geom_conaffinity", "geom_friction", "geom_condim", "geom_group", "geom_priority", "geom_margin", "body_pos",
    "body_mass", "body_mocapid", "jnt_type", "jnt_axis", "dof_armature", "tendon_frictionloss", "tendon_solref_fri", "tendon_solimp_fri", "wrap_prm", "mesh_vertnum", "mesh_facenum",
)  # fmt: skip


def worlds(draw: random.Random) -> Iterator[World]:
    """Yield worlds with things of each sort, meshes that stand, and slopes."""
    crowd = tuple(drawn_thing(draw, f"drawn {number}") for number in range(9))
    fixed = tuple(
        Obstacle(name=f"wall {n}", x_m=n, y_m=1.0, heading_rad=0.3 * n, length_m=1.0, width_m=0.1, fixed=True)
        for n in range(14)
    )
    slope = Mesh(
        name="slope", vertices=((0, 0, 0), (2, 0, 0.2), (0, 2, 0.1), (3, 3, 1.0)), triangles=((0, 1, 2), (1, 2, 3))
    )
    high = Mesh(name="table", vertices=((0, 0, 0.9), (2, 0, 0.9), (0, 2, 0.9)), triangles=((0, 1, 2),))
    floor = Mesh(name="ground", vertices=((0, 0, 0), (2, 0, 0), (0, 2, 0.001)), triangles=((0, 1, 2),))
    box = Mesh(
        name="box",
        vertices=((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1)),
        triangles=((0, 1, 4), (1, 5, 4), (1, 2, 6), (1, 6, 5), (4, 5, 6)),
    )
    for things, meshes in (
        *(((*one,), ()) for one in THINGS.values()), (crowd, ()), (fixed[:12], ()), (fixed, ()), ((), (MESH,)), ((), (slope,)), ((), (high, floor)),
        ((THINGS["post"]), (box,)), ((Obstacle(name="up", x_m=1, y_m=1, heading_rad=2.0, **RAMP, height_m=0.3, base_m=0.1, fixed=False),), (box, MESH)),  # type: ignore[arg-type]
        ((Obstacle(name="low", x_m=1, y_m=1, radius_m=0.2, height_m=0.05), Obstacle(name="sill", x_m=2, y_m=1, radius_m=0.2, height_m=0.01)), ()),
    ):  # fmt: skip
        yield World(
            name="w",
            source="w.toml",
            description="",
            start=Pose(-1.5, -2.0, 0.7, 0.0),
            extent=(-4.0, -5.0, 6.0, 7.0),
            obstacles=things,
            meshes=meshes,
        )


def of_mujoco(draw: random.Random) -> Iterator[str]:
    """Say of what a model of MuJoCo is made."""
    from p2os.pioneer.body.mujoco import model as made

    for number, world in enumerate(worlds(draw)):
        robots = [MODELS[number % 5]] if number % 3 else [MODELS[0], MODELS[3]]
        assets: list[str] = []

        def noted(
            spec: object,
            name: str,
            numbers: list[float],
            faces: object,
            assets: list[str] = assets,
            real: Callable[..., None] = made._asset,
        ) -> None:
            assets.append(said((name, numbers, faces)))
            real(spec, name, numbers, faces)

        with patch.object(made, "_asset", noted):
            try:
                model = made.make_model(world, robots, [item for item in world.obstacles if not item.fixed])
            except WorldError as error:
                yield refusal(error)
                continue
        yield from assets
        for name in ARRAYS:
            yield said((name, getattr(model, name).tolist()))
        yield said(
            [
                (place, turn)
                for place, turn, mesh in zip(
                    model.geom_pos.tolist(), model.geom_quat.tolist(), model.geom_dataid.tolist(), strict=True
                )
                if mesh < 0
            ]
        )
        yield said(
            (
                model.body_inertia[1:].tolist() if not world.meshes else "",
                sorted(made.floor_geometries(model)),
                sorted(made.low_geometries(model)),
            )
        )
        yield said(
            [
                model.opt.timestep,
                model.opt.gravity.tolist(),
                int(model.opt.integrator),
                int(model.opt.cone),
                int(model.opt.iterations),
                int(model.opt.solver),
                model.opt.impratio,
            ]
        )
        for robot in range(len(robots)):
            yield said([int(model.joint(name).id) for name in made.RobotNames.of(robot).joints])
    with patch.object(made, "MOST_PIECES", 2):
        for world in worlds(draw):
            yield tried(lambda world=world: made.make_model(world, MODELS[:1], []).ngeom)
    for heading in (0.0, 1.0, -2.0):
        for slope in (0.0, 0.3):
            yield said((made.quaternion(heading, slope), made.matrix(made.quaternion(heading, slope))))


#: What an engine has settled to may differ by less than its contacts give way.
_NUMBER = re.compile(r"-?\d+\.\d+(?:e-\d+)?|-?\d+e-\d+")


class Spy(ModuleType):
    """An engine's module that notes what it is called with."""

    def __init__(self, real: ModuleType, calls: list[str]) -> None:
        super().__init__("spy")
        self._real, self._calls = real, calls

    def __getattr__(self, name: str) -> object:
        found = getattr(self._real, name)
        if not callable(found):
            return found

        def called(*given: object, **named: object) -> object:
            named_only = {key: value for key, value in named.items() if key != "physicsClientId"}
            if not name.startswith(("get", "is", "save", "restore", "connect", "disconnect", "stepSimulation", "ray")):
                self._calls.append(said((name, given, named_only)))
            return found(*given, **named)

        return called


def of_bullet(draw: random.Random) -> Iterator[str]:
    """Say what Bullet is called with as scenes are made, driven where nothing is touched, and changed."""
    from p2os.pioneer.body.bullet import body, engine, model, rays

    for number, world in enumerate(worlds(draw)):
        calls: list[str] = []
        with ExitStack() as stack:
            for module in (body, engine, model, rays):
                if "pybullet" in vars(module):
                    stack.enter_context(patch.object(module, "pybullet", Spy(module.pybullet, calls)))
            robots = [MODELS[number % 5]] if number % 4 else [MODELS[0], MODELS[4]]
            starts = [Pose(-3.0 + 2 * place, -4.0, 0.4) for place in range(len(robots))]
            scenes: list[RobotScene] = []
            yield tried(lambda: scenes.append(make_scene("bullet", world, robots, starts)))  # noqa: B023 - called at once
            yield "\n".join(calls)
            calls.clear()
            for place, body in enumerate(body for scene in scenes for body in scene.bodies):  # changed, and put back
                body.place(Obstacle(name="late", x_m=3.0, y_m=6.0, radius_m=0.1, mass_kg=1.0))
                body.move("late", 3.0, 6.5, 1.0)
                body.remove("late")
                body.stand_at(-3.2 + 2 * place, -4.2, 0.3)
                body.put_back()
                assert isinstance(body, EngineBody)
                body.go_on()
            yield _NUMBER.sub(lambda found: f"{round(float(found[0]), 3) + 0.0:g}", "\n".join(calls))  # to a millimetre


def motors(draw: random.Random) -> Iterator[str]:
    """Watch motors that strain, are turned back, rest and are held; and look around."""
    (body, *_), robot = _engines(), MODELS[0]
    most = robot.body.motor_torque_nm
    slow = physical.STALL_RIM_MPS / (robot.body.wheel_diameter_m / 2)
    trembling = physical.PUSHED_BACK_MPS / (robot.body.wheel_diameter_m / 2)
    for number in range(40):
        body._count_anew()
        body._most_nm = None if number % 4 else (most / 2, 0.0)
        body.is_powered = number % 3 > 0
        for _ in range(12):
            wheel, asked = draw.randrange(2), draw.choice((0.0, 0.0, 0.3, -0.3))
            effort = draw.choice((0.0, 0.9, 0.94, 0.96, 1.0, 1.1, 2.0, -0.96, -1.1)) * most / draw.choice((1, 2))
            rate = draw.choice(
                (0.0, 1.0, -1.0, slow * 0.99, slow * 1.01, trembling * 0.99, -trembling * 1.01, trembling * 1.01)
            )
            body._rim_work_j = 0.0
            for _ in range(draw.choice((1, 1, 199, 200))):
                body._watch_motor(wheel, asked, effort, rate)
            yield said((body._stalled, body._stalling, body._is_held, body._is_at_rest, body._rim_work_j, body._rates))
            yield said((body._is_grip_changed, [body._motor(each, to) for each in (0, 1) for to in (0.0, 0.3, -0.3)]))
            body._is_grip_changed = False
    for turn in (
        (1, 0, 0, 0, 1, 0, 0, 0, 1),
        (0, -1, 0, 1, 0, 0, 0, 0, 1),
        (1, 0, 0, 0, 1, 0, 1.5, 0, 1),
        (0.6, -0.8, 0, 0.8, 0.6, 0, -0.2, 0, 1),
    ):
        body._zero = (1.0, 2.0)
        yield said(body._state_of((1.0, 2.0, 0.1), turn, ((3.0, 4.0), (5.0, 6.0)), (0.3, -0.2), 0.7))


def _engines() -> list[EngineBody]:
    world = World(name="w", source="w", description="", start=Pose(0, 0, 0), extent=(-4, -4, 4, 4), obstacles=())
    found = [
        make_body(name, world, MODELS[0])
        for name in ("bullet", "mujoco")
        if find_spec({"bullet": "pybullet"}.get(name, name))
    ]
    return [body for body in found if isinstance(body, EngineBody)]


def givens(draw: random.Random) -> Iterator[str]:  # noqa: C901 - a table of rows
    """Say what every engine is given of robots and things."""
    yield said({name: value for name, value in vars(physical).items() if name.isupper()})
    yield said({name: value for name, value in vars(contacts).items() if name.isupper()})
    for robot in MODELS:
        load = RimLoad(robot)
        yield said((Chassis.of(robot), load.both_kg, load.apart_kg, load.ahead_kg_m))
        for before in ((0.0, 0.0), (0.3, 0.3), (-0.2, 0.3)):
            for after in ((0.0, 0.0), (0.301, 0.302), (0.3, -0.3), (-0.2, 0.31)):
                yield said(load.work_j(before, after, 0.001))
    yield said([mean_magnitude(one, other) for one in (-2.0, 0.0, 1.0) for other in (-1.0, 0.0, 3.0)])
    bands = [Bands(robot) for robot in MODELS]
    for world in worlds(draw):
        yield said(physical.floor_box(world))
        for item in world.obstacles:
            yield said(
                (
                    physical.group_for(item, bands),
                    [physical.group_of(item, each) for each in bands],
                    physical.half_sizes(item),
                    physical.middle_and_slope(item),
                )
            )
        for mesh in world.meshes:
            yield said(
                [
                    physical.is_level((mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]))
                    for a, b, c in mesh.triangles
                ]
            )
    for degrees in (0, 19.9, 20.1, 90, 160.1, 180):
        up, out = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
        yield said(physical.is_level(((0, 0, 0), (out, 0, up), (0, 1, 0))))
    for _ in range(20):
        counter = ContactCounter()
        for _ in range(12):
            new = counter.update(draw.random() < 0.4, draw.choice((1, APART_STEPS - 1, APART_STEPS, APART_STEPS + 1)))
            if new:
                counter.note(Hit(at_ns=5, name="x", x_m=draw.uniform(-1, 1), y_m=0.3))
            yield said((new, counter.collisions, counter.touching, counter.apart, counter.bearing_rad(0.1, 0.2, 0.3)))
        yield said((counter.snapshot(), counter.take_hits(), counter.take_hits()))


def wire(draw: random.Random) -> Iterator[str]:
    """Write each message with the ends of its numbers, and read it again whole, cut and too long."""
    yield said([(made.__name__, kind, answer.__name__) for made, (kind, answer) in REQUESTS.items()])
    yield said([messages.VERSION, messages.LONGEST_FRAME, messages.LARGEST, messages.ANSWER, messages.FAILED])
    for made, parts in FIELDS.items():
        for real in (0.0, -1e9, 1e9, 1.1e9, math.inf, -math.inf, math.nan):
            for count in (0, 2):
                values = [_filled(part, real, count) for part in parts]
                yield tried(lambda made=made, values=values: _there_and_back(made(*values)))  # type: ignore[arg-type]
    with patch.object(messages, "LONGEST_FRAME", 6):
        for size in (0, 1, 2):
            yield tried(encode, messages.Saved(bytes(size)), 5)
    for size in (65535, 65536):
        yield tried(lambda size=size: len(encode(messages.Failed("a" * size), 5)))
    yield tried(encode, messages.AskRanges((70000,)), 5)
    yield said(encode_request(messages.AskRanges((1, 2))).hex())
    for text in (
        "tcp:127.0.0.1:1", "tcp:127.0.0.1:65535", "tcp:127.0.0.1:65536", "tcp:127.0.0.1:0", "tcp:localhost:9", "tcp:[::1]:9", "tcp:10.0.0.1:9", "tcp:10.0.0.1:9?anywhere",
        "tcp:h:9", "tcp::9", "tcp:9", "tcp:h:x", "tcp:127.0.0.1:0000009", "unix:/a", "unix:", "unix:" + "a" * 107, "unix:" + "a" * 108, "unix:a\0", "tcp:127.0.0.1:9?timeout=0",
        "tcp:127.0.0.1:9?timeout=86400", "tcp:127.0.0.1:9?timeout=86401", "tcp:127.0.0.1:9?timeout=x", "tcp:127.0.0.1:9?timeout=2&anywhere", "tcp:127.0.0.1:9?other", "best",
    ):  # fmt: skip
        yield said((is_address(text), tried(Address.of, text)))
    yield said([body_note("kinematic")])


def _filled(part: object, real: float, count: int) -> object:
    kind = type(part).__name__
    if kind == "_Text":
        return "ä" * count
    if kind == "_Blob":
        return bytes(count)
    if kind == "_Table":
        return tuple(_filled(part._row, real, count) for _ in range(count))  # type: ignore[attr-defined]
    if kind == "_List":
        return tuple(tuple(_filled(each, real, count) for each in part._fields) for _ in range(count))  # type: ignore[attr-defined]
    layout = part._struct.format.lstrip("<")  # type: ignore[attr-defined]
    letters = "d" * int(layout[:-1]) if layout[:-1].isdigit() else layout
    numbers = tuple(real if letter == "d" else count for letter in letters)
    return numbers[0] if len(numbers) == 1 else numbers


def _there_and_back(message: Message) -> object:
    data = encode(message, 7)
    cuts = [tried(decode, type(message), data[5:end]) for end in {6, len(data) - 1} if 5 <= end < len(data)]
    return (
        data[:24].hex(),
        len(data),
        decode(type(message), data[5:]) == message,
        cuts,
        tried(decode, type(message), data[5:] + b"\0"),
    )


def asked(draw: random.Random) -> Iterator[str]:
    """Drive a robot of another program, and say what that was asked and what came of it."""
    walk = Walk(points_m=((1.0, -1.0), (1.0, 1.0)), speed_mps=1.0)
    things = (Obstacle(name="crate", x_m=0.5, y_m=0.1, length_m=0.2, width_m=0.3, mass_kg=1.0), Obstacle(name="wall", x_m=1.5, y_m=0, length_m=0.1, width_m=2, fixed=True),
              Obstacle(name="floor", x_m=-3, y_m=0, length_m=1, width_m=1, height_m=0.1, kind=ObstacleKind.FLOOR), Obstacle(name="ramp", x_m=-3, y_m=2, **RAMP, height_m=0.1),
              Obstacle(name="post", x_m=0.0, y_m=1.0, radius_m=0.1))  # type: ignore[arg-type]  # fmt: skip
    world = World(
        name="w",
        source="w",
        description="",
        start=Pose(0, 0, 0.1),
        extent=(-4, -4, 4, 4),
        obstacles=things,
        meshes=(MESH,),
    )
    for abilities in (7, 0, 4):
        asked_for, real = list[str](), Served.answer

        def noted(
            self: Served, request: Request, asked_for: list[str] = asked_for, real: Callable[..., object] = real
        ) -> object:
            asked_for.append(said(request) if type(request).__name__ != "Restore" else "Restore")
            return real(self, request)

        with patch.object(Served, "answer", noted), served(abilities=abilities) as (address, _):
            body = make_body(address, world, MODELS[0])
            for act in _acts(body, walk):
                yield _tried_to(act, address)
            yield "\n".join(asked_for)
    with served() as (address, _):
        yield _tried_to(lambda: make_scene(address, world, MODELS[:2]), address)


def _acts(body: RobotBody, walk: Walk) -> tuple[Callable[[], object], ...]:
    """Return what is done to a robot, in order."""
    cat = Obstacle(name="cat", x_m=0, y_m=0, radius_m=0.1, walk=walk)
    return (
        lambda: body.hold(0.3, 0.2, 30)[-1].left_angle_rad, lambda: body.place(cat), lambda: body.hold(0.4, 0.4, 1500)[-1].stalled_left,
        body.take_hits, body.take_moved, lambda: body.ranges(range(3)), lambda: body.echoes((1,)), lambda: body.scan(FAN, 2.0), lambda: body.scan(Cone(0, 0, (), ()), 2.0), lambda: body.move("post", 0.3, 0.3, 1.0),
        lambda: body.remove("cat"), lambda: body.remove("none"), body.clearance, lambda: body.clearance(no_more_than=0.01), lambda: body.steps_within(0.05, 0.3), lambda: body.stand_at(-2, 0, 1.0),
        lambda: body.step(0.1, -0.1).right_angle_rad, lambda: len(body.snapshot()), lambda: body.restore(body.snapshot()), body.put_back, lambda: body.state, lambda: body.note,
    )  # fmt: skip


def _tried_to(act: Callable[[], object], address: str) -> str:
    try:
        return said(act())
    except P2osError as error:
        return refusal(error).replace(address, "ADDRESS")


TRACES: dict[str, Trace] = {
    **({"of_mujoco": of_mujoco} if find_spec("mujoco") else {}),
    **({"of_bullet": of_bullet} if find_spec("pybullet") else {}),
    **({"motors": motors} if find_spec("pybullet") else {}),
    **{each.__name__: each for each in (givens, wire, asked)},
}
TRACES["declared"] = declared_of(
    "p2os.pioneer.body", "p2os.pioneer.body.bullet", "p2os.pioneer.body.mujoco", "p2os.pioneer.body.outside"
)
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
