"""Each mode of a bench with each body as parameters of a test; what no run needs each time is among the slow ones."""

from itertools import product

import pytest
from _pytest.mark.structures import ParameterSet

from p2os.pioneer.body.factory import engines
from tests.p2os.pioneer.body.bodies import marks_of

MODES = ("direct", "adapter")
#: Each mode and each body is in one of these; how the one works does not depend on which the other is.
EACH_RUN = {("direct", "kinematic"), ("adapter", "kinematic"), ("adapter", "bullet"), ("direct", "mujoco")}


def modes_and_bodies() -> list[ParameterSet]:
    """Return (mode, body) of all, all but a few with the mark `slow`."""
    return [
        pytest.param(mode, body, marks=[*marks_of(body), *([] if (mode, body) in EACH_RUN else [pytest.mark.slow])])
        for mode, body in product(MODES, engines())
    ]
