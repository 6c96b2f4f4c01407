"""The composition root: chip, wires, robot and loop of a scenario, in virtual time."""

from robot_bench.bench.bench import Bench, BenchParts

__all__ = ["Bench", "BenchParts"]
