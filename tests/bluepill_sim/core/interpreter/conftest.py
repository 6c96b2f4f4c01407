"""No test of the interpreter may hang the host."""

import pytest

from tests.bluepill_sim.core.interpreter.lockstep import Lockstep


@pytest.fixture(autouse=True)
def _limit(watchdog: None) -> None:
    """Use the watchdog in every test."""


@pytest.fixture(scope="module")
def lockstep() -> Lockstep:
    """The two machines."""
    return Lockstep()
