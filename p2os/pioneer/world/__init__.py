"""The places a robot can be in: what a world is, its files, makers, plan and drawings."""

from p2os.pioneer.world.file import parse_world
from p2os.pioneer.world.loader import known_worlds, load_world, world_suffixes
from p2os.pioneer.world.model import Mark, Mesh, Obstacle, ObstacleKind, Pose, World

__all__ = [
    "Mark",
    "Mesh",
    "Obstacle",
    "ObstacleKind",
    "Pose",
    "World",
    "known_worlds",
    "load_world",
    "parse_world",
    "world_suffixes",
]  # fmt: skip
