"""The physical body on PyBullet; the only importer of pybullet and NumPy."""

from p2os.pioneer.body.bullet.body import BulletBody, BulletScene

__all__ = ["BulletBody", "BulletScene"]
