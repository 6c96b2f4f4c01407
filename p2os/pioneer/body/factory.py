"""Make a body by its name, and know which is the best that is installed.

A body of the user's is a `RobotScene` that is made as (world, models): an entry point of the group `p2os.bodies`,
`./mine.py:Class`, or another program at `tcp:HOST:PORT` or `unix:PATH`.

Invariant: an engine is imported only when it is asked for; whether one is installed is looked up, not tried.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import cast

from p2os.pioneer.body.contract import RobotBody, RobotScene
from p2os.pioneer.body.outside.address import Address, is_address
from p2os.pioneer.world.model import Pose, World
from p2os.robots.parameters import RobotParameters
from simbase.errors import MissingDependencyError, UsageError, shown
from simbase.trust import own_code
from simbase.user_classes import find_class, make, refuse_lacking

BODY_NAMES = ("kinematic", "bullet", "mujoco")
#: The body of who names none: the first of `NEEDS` that is installed.
BEST = "best"
BODY_CHOICES = (BEST, *BODY_NAMES)
#: The entry points of others.
GROUP = "p2os.bodies"
#: Body → the packages that it needs, the best body first; the last needs none.
NEEDS: Mapping[str, tuple[str, ...]] = {
    "bullet": ("pybullet", "numpy"), "mujoco": ("mujoco", "numpy"), "kinematic": (),
}  # fmt: skip


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
    if name not in BODY_NAMES:
        scene = _scene_of_users(name, world, models)
        if starts is not None:
            scene.reset(starts, seed)
        return scene
    load_engine(name)
    if name == "kinematic":
        from p2os.pioneer.body.kinematic import KinematicScene

        return KinematicScene(world, models, starts)
    if name == "bullet":
        from p2os.pioneer.body.bullet import BulletScene

        return BulletScene(world, models, starts)
    from p2os.pioneer.body.mujoco import MujocoScene

    return MujocoScene(world, models, starts)


def load_engine(name: str) -> None:
    """Import what a body is made of, so that making one takes no longer than that; of a user's body nothing.

    Raises:
        UsageError: There is no body of that name.
        MissingDependencyError: The engine or NumPy is not installed.
    """
    name = resolve_body(name)
    try:
        if name in BODY_NAMES:
            import_module(f"{__package__}.{name}")
    except ModuleNotFoundError as error:
        raise MissingDependencyError(f"the {name} body needs {error.name}", extra=name, hint="--body best") from error


def resolve_body(name: str) -> str:
    """Return the name of the body that `make_body` makes: `best` is the best that is installed.

    Raises:
        UsageError: There is no body of that name, or its class lacks a method.
    """
    if name not in BODY_CHOICES:
        body_class(name)
    return next(body for body in NEEDS if not _missing(body)) if name == BEST else name


def body_class(name: str) -> Callable[[World, Sequence[RobotParameters]], RobotScene]:
    """Return the class of a body of the user's.

    Args:
        name: That of an entry point, or FILE.py:CLASS, or where another program answers.

    Raises:
        UsageError: There is none, or it lacks a method of `RobotScene`.
    """
    if not isinstance(name, str):
        raise UsageError(f"{shown(name)} is no body's name", hint=f"one of {', '.join(BODY_CHOICES)}")
    if is_address(name):
        return _BodyAt(Address.of(name))
    found = find_class(name, what="body", group=GROUP, known=BODY_CHOICES)
    refuse_lacking(found, RobotScene, name, "body")
    return found


@dataclass(frozen=True, slots=True)
class _BodyAt:
    """What makes the body of another program."""

    address: Address

    def __call__(self, world: World, models: Sequence[RobotParameters]) -> RobotScene:
        from p2os.pioneer.body.outside.body import OutsideScene

        return OutsideScene(self.address, world, models)


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
    best = resolve_body(name)
    better = list(NEEDS)[: list(NEEDS).index(best)]
    lacking = ", ".join(f"{body} needs {' and '.join(_missing(body))}" for body in better)
    return f"body {best}: the best that is installed{f' ({lacking})' if lacking else ''}"


def installed_bodies() -> tuple[str, ...]:
    """Return the bodies that ship and can be made here, the simplest first."""
    return tuple(body for body in BODY_NAMES if not _missing(body))


def _missing(body: str) -> list[str]:
    return [package for package in NEEDS[body] if not _is_installed(package)]


def _is_installed(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except (ImportError, ValueError):  # someone forbids its import, or has half of it loaded
        return False
