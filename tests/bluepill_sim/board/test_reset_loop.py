"""A program that resets for ever is named and ended; one that does something between its resets is not."""

from pathlib import Path

import pytest

from bluepill_sim.__main__ import run
from bluepill_sim.board import BluePill
from bluepill_sim.program.reset_loop import LEAST_NS, MOST_RESETS, ResetRow
from simbase.timing import NS_PER_MS, Reason
from tests.bluepill_sim.machine import Machine

RESET = "mov32 r1, #0xE000ED0C\nmov32 r2, #0x05FA0004\nstr r2, [r1, #0]\nend: b end\n"
WAIT = "mov32 r3, #{}\nw: subs r3, #1\nbne w\n"
#: PC13 an output, and low.
TOGGLE = (
    "mov32 r1, #0x40021018\nmov32 r2, #0x10\nstr r2, [r1, #0]\n"
    "mov32 r1, #0x40011004\nmov32 r2, #0x44244444\nstr r2, [r1, #0]\n"
)
#: USART1 on PA9 sends a character; the wait is longer than it takes.
SEND = (
    "mov32 r1, #0x40021018\nmov32 r2, #0x4004\nstr r2, [r1, #0]\n"
    "mov32 r1, #0x40010804\nmov32 r2, #0x444444B4\nstr r2, [r1, #0]\n"
    "mov32 r1, #0x40013800\nmov32 r2, #0x45\nstr r2, [r1, #8]\nmov32 r2, #0x2008\nstr r2, [r1, #12]\n"
    "mov32 r2, #65\nstr r2, [r1, #4]\n" + WAIT.format(400)
)


def program(source: str, folder: Path) -> Path:
    ((_, code),) = Machine(source, {}).image.segments
    (folder / "a.bin").write_bytes(code)
    return folder / "a.bin"


def test_a_row_is_as_long_as_its_last_reset_is_soon() -> None:
    for step, is_endless in ((LEAST_NS - 1, True), (LEAST_NS, False), (LEAST_NS + 1, False)):
        row = ResetRow()
        found = [row.add((number + 1) * step) for number in range(MOST_RESETS)]
        assert found == [False] * (MOST_RESETS - 1) + [is_endless]


def test_a_program_that_does_nothing_but_reset_is_held_after_100(tmp_path: Path) -> None:
    board = BluePill(program(RESET, tmp_path))
    reached = board.advance_to(10_000 * NS_PER_MS)
    assert reached.reason is Reason.HALT
    assert board.resets.total() == MOST_RESETS
    assert board.has_died
    assert board.died_ns is not None
    assert board.died_ns < NS_PER_MS
    assert board.verdict.startswith("firmware fault: it resets for ever: 100 times in ")
    state = board.snapshot()
    board.reset()
    assert not board.has_died
    board.restore(state)
    assert board.has_died
    board.advance_to(20_000 * NS_PER_MS)
    assert board.resets.total() == MOST_RESETS


@pytest.mark.parametrize("work", [TOGGLE, SEND, WAIT.format(8000)], ids=["a pin", "a character", "time"])
def test_a_program_that_works_between_its_resets_is_not_ended(work: str, tmp_path: Path) -> None:
    board = BluePill(program(work + RESET, tmp_path))
    while board.resets.total() < 2 * MOST_RESETS:
        board.advance_to(board.now_ns + NS_PER_MS)
    assert not board.has_died
    assert board.died_ns is None


def test_a_button_pressed_often_is_no_such_program(tmp_path: Path) -> None:
    board = BluePill(program("end: b end\n", tmp_path))
    for _ in range(2 * MOST_RESETS):
        board.reset()
        board.advance_to(board.now_ns + 1000)
    assert not board.has_died


def test_mcu_run_names_it_and_ends(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["run", str(program(RESET, tmp_path)), "--for", "10s"]) == 1
    error = capfd.readouterr().err
    assert "fault: it resets for ever: 100 times in " in error
    assert "100 resets (SOFTWARE 100)" in error
