"""Make a body by its name; each engine is imported only when it is asked for."""

from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.world.model import World
from p2os.robots.parameters import RobotParameters
from simbase.errors import MissingDependencyError, UsageError

BODY_NAMES = ("kinematic", "bullet", "mujoco")


#: What else is there, by the body whose engine is missing; its extra has its name.
_OTHERS = {"bullet": "--body mujoco or kinematic", "mujoco": "--body kinematic"}


def make_body(name: str, world: World, parameters: RobotParameters) -> RobotBody:
    """Return a body that stands at the world's start.

    Args:
        name: `kinematic` (exact, no dependency), `bullet` (PyBullet) or `mujoco` (MuJoCo).
        world: Where it is.
        parameters: What it is.

    Raises:
        UsageError: There is no body of that name.
        MissingDependencyError: The engine or NumPy is not installed.
        WorldError: The world has something that this body cannot take.
    """
    if name == "kinematic":
        from p2os.pioneer.body.kinematic import KinematicBody

        return KinematicBody(world, parameters)
    if name not in BODY_NAMES:
        raise UsageError(f"no body {name!r}", hint=f"bodies: {', '.join(BODY_NAMES)}")
    try:
        if name == "bullet":
            from p2os.pioneer.body.bullet import BulletBody

            return BulletBody(world, parameters)
        from p2os.pioneer.body.mujoco import MujocoBody

        return MujocoBody(world, parameters)
    except ModuleNotFoundError as error:
        raise MissingDependencyError(f"the {name} body needs {error.name}", extra=name, hint=_OTHERS[name]) from error
