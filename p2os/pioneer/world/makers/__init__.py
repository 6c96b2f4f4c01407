"""Worlds made from a seed: `p2os world new`."""

from p2os.pioneer.world.makers.kinds import KINDS, make_world

__all__ = ["KINDS", "make_world"]
