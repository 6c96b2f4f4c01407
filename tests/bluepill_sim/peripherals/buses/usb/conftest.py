"""Boards with the echo program, which answers in capitals."""

from collections.abc import Callable

import pytest

from bluepill_sim import BluePill
from tests.tools.examples import EXAMPLES

ECHO = str(EXAMPLES / "usb_echo.elf")


@pytest.fixture
def boards(watchdog: None) -> Callable[[], BluePill]:
    """Make boards with the program."""
    return lambda: BluePill(ECHO)


@pytest.fixture(params=["native", "python"])
def board(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, boards: Callable[[], BluePill]) -> BluePill:
    """Make a board on each of the cores."""
    monkeypatch.setenv("P2OS_CORE", request.param)
    return boards()
