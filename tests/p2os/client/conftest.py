"""A robot that is served for one test, in real time and in virtual time."""

from collections.abc import Iterator

import pytest

from p2os.transport.virtual_clock import VirtualClock
from tests.p2os.client.served_robot import ServedRobot


@pytest.fixture
def served() -> Iterator[ServedRobot]:
    robot = ServedRobot()
    yield robot
    robot.close()


@pytest.fixture
def fast() -> Iterator[ServedRobot]:
    """A robot whose time, and that of a client with its clock, passes as fast as the work is done."""
    robot = ServedRobot("loop:robot", clock=VirtualClock())
    yield robot
    robot.close()
