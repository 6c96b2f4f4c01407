"""Emulated boards with faults, put to the test."""

from collections.abc import Callable
from pathlib import Path

import pytest

from robot_bench.wires.board_test.circuit import BoardFault
from robot_bench.wires.board_test.emulated import REVISION, EmulatedBoard
from robot_bench.wires.board_test.esp32 import library_path
from robot_bench.wires.board_test.verdicts import VerdictRow, judge
from robot_bench.wires.board_test.walk import BoardWalk
from simbase.errors import MissingDependencyError

Tested = Callable[..., list[VerdictRow]]


@pytest.fixture(scope="session", autouse=True)
def program() -> Path:
    """Return the ESP32's program as it was built with the package, with a game pad; skip where it was not."""
    try:
        return library_path()
    except MissingDependencyError as error:
        pytest.skip(str(error))


@pytest.fixture
def tested() -> Tested:
    """Return what tests a board with faults."""

    def test(
        *faults: BoardFault, between: bool = False, has_loop_plug: bool = True, revision: str = REVISION
    ) -> list[VerdictRow]:
        board = EmulatedBoard(faults, between=between, has_loop_plug=has_loop_plug, revision=revision)
        return judge(BoardWalk(board.bluepill_end, board.adapter_end, board.pinout).measure(), board.pinout, revision)

    return test
