"""The physical body on PyBullet; the only importer of pybullet and NumPy."""

from p2os.pioneer.body.bullet.body import BulletBody

__all__ = ["BulletBody"]
