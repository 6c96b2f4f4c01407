"""A robot that is served for one test."""

from collections.abc import Iterator

import pytest

from tests.p2os.client.served_robot import ServedRobot


@pytest.fixture
def served() -> Iterator[ServedRobot]:
    robot = ServedRobot()
    yield robot
    robot.close()
