"""Make a body by its name, and know which is the best that is installed.

A body of the user's is a `RobotScene` that is made as (world, models): an entry point of the group `p2os.bodies`,
`./mine.py:Class`, or another program at an address, whose scheme is an entry point of `p2os.body_addresses`. An entry
point of `p2os.bodies` whose value ends in `:ENGINE` is an engine (`engine`): those stand in line for `best`.

Invariant: an engine is imported only when it is asked for; whether one is installed is looked up, not tried.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import cast

from p2os.pioneer.body.contract import RobotBody, RobotScene
from p2os.pioneer.body.engine import ATTRIBUTE, Engine
from p2os.pioneer.world.model import Pose, World
from p2os.robots.parameters import RobotParameters
from simbase.entry_points import installed_points
from simbase.errors import UsageError, shown
from simbase.installation import way_to_plug_in
from simbase.trust import own_code
from simbase.trust.code import is_in_file
from simbase.user_classes import find_class, loaded, make, refuse_lacking

#: The exact body, which needs nothing.
KINEMATIC = Engine(name="kinematic", module="p2os.pioneer.body.kinematic", scene="KinematicScene")
#: The body of who names none: of the engines that are installed that with the highest rank.
BEST = "best"
#: The names that are there without any entry point.
BODY_CHOICES = (BEST, KINEMATIC.name)
#: Entry points of engines and of users' bodies by name, and of bodies in other programs by the scheme of an address.
GROUP = "p2os.bodies"
ADDRESSES = "p2os.body_addresses"


@cache
def engines() -> Mapping[str, Engine]:
    """Return the engines by their names, the exact body first, then the best first; looked up once a process."""
    points = installed_points(GROUP).values()
    found = [cast("Engine", loaded(point)) for point in points if point.attr == ATTRIBUTE]
    return {one.name: one for one in (KINEMATIC, *sorted(found, key=lambda one: -one.rank))}


def make_body(
    name: str, world: World, parameters: RobotParameters, *, start: Pose | None = None, seed: int = 0,
    trust: bool = True,
) -> RobotBody:  # fmt: skip
    """Return a body alone in a scene of its own.

    Args:
        name: `kinematic` (exact, no dependency), `bullet` (PyBullet), `mujoco` (MuJoCo), `best`, or one of the
            user's.
        world: Where it is.
        parameters: What it is.
        start: Where it stands; None is at the world's start.
        seed: Of what is random in a body of the user's.
        trust: Whether the name is the caller's own, so that FILE.py:CLASS is loaded; False where it may be out of a
            file, of which only an admitted `simbase.trust.Code` is.

    Raises:
        UsageError: There is no body of that name, or it is none.
        MissingDependencyError: The engine or NumPy is not installed.
        WorldError: The world has something that this body cannot take.
    """
    return make_scene(name, world, [parameters], None if start is None else [start], seed, trust=trust).bodies[0]


def make_scene(
    name: str, world: World, models: Sequence[RobotParameters], starts: Sequence[Pose] | None = None, seed: int = 0,
    *, trust: bool = True,
) -> RobotScene:  # fmt: skip
    """Return a scene with a robot of each of these models.

    Args:
        name: As for `make_body`.
        world: Where they are.
        models: One a robot, the first first.
        starts: Where they stand; None: `reset` puts them where they begin, before they are asked for anything.
        seed: Of what is random in a body of the user's.
        trust: Whether the name is the caller's own, so that FILE.py:CLASS is loaded; False where it may be out of a
            file, of which only an admitted `simbase.trust.Code` is.

    Raises:
        UsageError: There is no body of that name, or it is none.
        MissingDependencyError: The engine or NumPy is not installed.
        WorldError: The world has something that this body cannot take.
    """
    name = resolve_body(own_code(name) if trust and isinstance(name, str) else name)
    if name in engines():
        return engines()[name](world, models, starts)
    scene = _scene_of_users(name, world, models)
    if starts is not None:
        scene.reset(starts, seed)
    return scene


def load_engine(name: str) -> None:
    """Import what a body is made of, so that making one takes no longer than that; of a user's body nothing.

    Raises:
        UsageError: There is no body of that name.
        MissingDependencyError: The engine or NumPy is not installed.
    """
    engine = engines().get(resolve_body(name))
    if engine is not None:
        engine.load()


def resolve_body(name: str) -> str:
    """Return the name of the body that `make_body` makes: `best` is the best that is installed.

    Raises:
        UsageError: There is no body of that name, or its class lacks a method.
    """
    if not is_shipped(name):
        body_class(name)
    return max((engines()[one] for one in installed_bodies()), key=lambda one: one.rank).name if name == BEST else name


def is_shipped(name: str) -> bool:
    """Tell whether a name is that of an engine, or `best`."""
    return name == BEST or name in engines()


def may_ship(name: str) -> bool:
    """Tell whether a name is that of an engine, or may be that of one whose plug-in is not installed.

    Such a name is refused where the body is made, as an engine without its packages: a scenario that names it runs
    with another body (`--body kinematic`).
    """
    return is_shipped(name) or (":" not in name and name not in installed_points(GROUP) and bool(way_to_plug_in(GROUP)))


def body_names() -> tuple[str, ...]:
    """Return the names of the engines and `best`, in the order in which they are told."""
    return BEST, *engines()


def body_class(name: str) -> Callable[[World, Sequence[RobotParameters]], RobotScene]:
    """Return the class of a body of the user's.

    Args:
        name: That of an entry point, or FILE.py:CLASS, or where another program answers.

    Raises:
        UsageError: There is none, or it lacks a method of `RobotScene`.
    """
    if not isinstance(name, str):
        raise UsageError(f"{shown(name)} is no body's name", hint=f"one of {', '.join(body_names())}")
    scheme, colon, _ = name.partition(":")
    if colon and not is_in_file(name) and (point := installed_points(ADDRESSES).get(scheme)) is not None:
        return cast("Callable[[str], Callable[..., RobotScene]]", loaded(point))(name)
    found = find_class(name, what="body", group=GROUP, known=body_names(), absent=way_to_plug_in(GROUP))
    refuse_lacking(found, RobotScene, name, "body")
    return found


def _scene_of_users(name: str, world: World, models: Sequence[RobotParameters]) -> RobotScene:
    scene = cast("RobotScene", make(body_class(name), name, "body", world, models))
    refuse_lacking(scene, RobotScene, name, "body")
    if len(scene.bodies) != len(models):
        raise UsageError(f"the body {name} has {len(scene.bodies)} robots in `bodies`, expected {len(models)}")
    for body in scene.bodies:
        refuse_lacking(body, RobotBody, f"{name}: {type(body).__name__}", "body")
    return scene


def body_note(name: str) -> str | None:
    """Return the line that says which body the best one is, and what better ones lack; None where one was named."""
    if name != BEST:
        return None
    best = engines()[resolve_body(name)]
    better = sorted((one for one in engines().values() if one.rank > best.rank), key=lambda one: -one.rank)
    lacking = ", ".join(f"{one.name} needs {' and '.join(one.missing())}" for one in better)
    return f"body {best.name}: the best that is installed{f' ({lacking})' if lacking else ''}"


def installed_bodies() -> tuple[str, ...]:
    """Return the engines that can be made here, the simplest first."""
    return tuple(name for name, one in engines().items() if not one.missing())
