"""The physical body on PyBullet; `body` and what it stands on are the only importers of pybullet and NumPy."""

from p2os.pioneer.body.engine import Engine

ENGINE = Engine(
    name="bullet", module=f"{__name__}.body", scene="BulletScene", packages=("pybullet", "numpy"), extra="bullet",
    rank=2,
)  # fmt: skip

__all__ = ["ENGINE"]
