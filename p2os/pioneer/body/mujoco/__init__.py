"""The second physical body, on MuJoCo: a cross-check of `bullet`; the only importer of mujoco."""

from p2os.pioneer.body.engine import Engine

ENGINE = Engine(
    name="mujoco", module=f"{__name__}.body", scene="MujocoScene", packages=("mujoco", "numpy"), extra="mujoco", rank=1
)

__all__ = ["ENGINE"]
