"""The composition root: chip, wires, robot and loop of a scenario, in virtual time."""

from robot_bench.bench.bench import Bench, run_of
from robot_bench.bench.robot_run import BenchParts, RobotRun

__all__ = ["Bench", "BenchParts", "RobotRun", "run_of"]
