"""Every body as a parameter of a test, skipped plainly where its engine is not installed."""

from collections.abc import Callable
from importlib.util import find_spec

import pytest
from _pytest.mark.structures import ParameterSet

from p2os.pioneer.body.contract import BodyState, RobotBody
from p2os.pioneer.body.factory import engines

#: The package that a body needs, which is also the name of its test mark where it has one.
ENGINES = {"bullet": "pybullet", "mujoco": "mujoco"}
#: Tried like the first by `make test`, and left out of a run of folders.
SECOND = "mujoco"
STEPS_PER_S = 1000

Maker = Callable[..., RobotBody]


def marks_of(body: str) -> list[pytest.MarkDecorator]:
    """Return the marks of a test that needs some body."""
    if body not in ENGINES:
        return []
    is_there = find_spec(ENGINES[body]) is not None
    skip = pytest.mark.skipif(not is_there, reason=f"{ENGINES[body]} is not installed")
    return [getattr(pytest.mark, body), skip, *([pytest.mark.slow] if body == SECOND else [])]


def each_body(*left_out: str) -> list[ParameterSet]:
    """Return the name of each body as a parameter."""
    return [pytest.param(name, id=name, marks=marks_of(name)) for name in engines() if name not in left_out]


def drive(body: RobotBody, left_mps: float, right_mps: float, seconds: float) -> BodyState:
    """Drive with these rim speeds; return the state at the end.

    As a robot's firmware does: many steps at once, which `test_held_speed.py` compares with single ones.
    """
    body.hold(left_mps, right_mps, round(seconds * STEPS_PER_S))
    return body.state


def ramped(body: RobotBody, left_mps: float, right_mps: float, seconds: float) -> BodyState:
    """Drive with a trapezoid, 0.5 s up and 0.5 s down, and come to rest."""
    steps = round(seconds * STEPS_PER_S)
    shares = [min(1.0, (step + 0.5) / 500, (steps - step - 0.5) / 500) for step in range(steps)]
    body.ramp([(left_mps * share, right_mps * share) for share in shares])
    return drive(body, 0, 0, 0.15)
