"""The ESP32's program for an emulated board, built from its sources."""

from collections.abc import Callable
from pathlib import Path

import pytest

from robot_bench.wires.board_test.circuit import Fault
from robot_bench.wires.board_test.emulated import REVISION, EmulatedBoard
from robot_bench.wires.board_test.verdicts import Finding, judge
from robot_bench.wires.board_test.walk import Walk
from tests.adapter_fw.builds import built

Tested = Callable[..., list[Finding]]


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the program with a game pad, of the board that has been laid out."""
    return built("esp32-rev_b-pad", tmp_path_factory.mktemp("esp32"))[0]


@pytest.fixture
def tested(library: Path) -> Tested:
    """Return what tests a board with faults."""

    def test(*faults: Fault, between: bool = False, has_loop_plug: bool = True) -> list[Finding]:
        board = EmulatedBoard(faults, between=between, has_loop_plug=has_loop_plug, library=library)
        return judge(Walk(board.bluepill_end, board.adapter_end, board.pinout).measure(), board.pinout, REVISION)

    return test
