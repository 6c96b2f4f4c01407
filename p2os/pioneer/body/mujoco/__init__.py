"""The second physical body, on MuJoCo: a cross-check of `bullet`; the only importer of mujoco."""

from p2os.pioneer.body.mujoco.body import MujocoBody, MujocoScene

__all__ = ["MujocoBody", "MujocoScene"]
