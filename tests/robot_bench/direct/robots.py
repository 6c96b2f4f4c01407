"""The shipped rover as tests want it: its description, changed here and there, and its file as text."""

from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any, cast

from robot_bench.direct.differential.description import Differential
from robot_bench.direct.differential.drive_train import DriveTrain
from robot_bench.scenario.wired_robots import load_own_robot

ROVER = Path(str(files("robot_bench.direct").joinpath("robots", "rover.toml")))


def rover(**parts: dict[str, object]) -> Differential:
    """Return the rover with other numbers: `rover(motor={"friction_nm": 0.0})`."""
    robot = cast("Differential", load_own_robot(ROVER, {}, "").robot)
    changed: dict[str, Any] = {name: replace(getattr(robot, name), **values) for name, values in parts.items()}
    return replace(robot, **changed)


def kinetic_j(train: DriveTrain) -> float:
    """Return the energy of all that moves."""
    left, right = train.left_radps, train.right_radps
    return float((train.struct.own * (left**2 + right**2)) / 2 + train.struct.other * left * right)
