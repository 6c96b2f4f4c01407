"""Boards with the echo program, which answers in capitals."""

from collections.abc import Callable
from importlib.resources import files

import pytest

from bluepill_sim import BluePill

ECHO = str(files("robot_bench.firmware") / "usb_echo.elf")


@pytest.fixture
def boards(watchdog: None) -> Callable[[], BluePill]:
    """Make boards with the program."""
    return lambda: BluePill(ECHO)


@pytest.fixture(params=["native", "python"])
def board(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, boards: Callable[[], BluePill]) -> BluePill:
    """Make a board on each of the cores."""
    monkeypatch.setenv("P2OS_CORE", request.param)
    return boards()
