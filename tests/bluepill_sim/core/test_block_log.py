"""The last rows that each core keeps by itself: on both executors, over halts, snapshots and branches to themselves."""

import random

import pytest

from bluepill_sim.board import BluePill, WaitError
from bluepill_sim.core import BLOCK, EXCEPTION_RETURN, BlockRecorder, BlockRow
from bluepill_sim.core.recorder import LAST_ROWS
from bluepill_sim.extension.library import library_path
from bluepill_sim.program.image import Image, SymbolTable
from bluepill_sim.program.last_blocks import TITLE
from tests.bluepill_sim.core.thumb_streams import Program, program

CORES = [
    "python",
    pytest.param("native", marks=pytest.mark.skipif(library_path() is None, reason="no native core is built")),
]
TICKS = """
mov32 r1, #0xE000E010
mov32 r2, #799
str r2, [r1, #4]
str r2, [r1, #8]
movs r2, #7
str r2, [r1, #0]
spin: b spin
tick: adds r6, #1
bx lr
"""
DEREFERENCES_NOTHING = "movs r5, #3\nloop: subs r5, #1\nbne loop\nmov32 r1, #0x60000000\nnop\nldr r0, [r1, #0]\nb stop"


@pytest.fixture(params=CORES)
def core(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("P2OS_CORE", request.param)
    return str(request.param)


def make_board(made: Program) -> BluePill:
    return BluePill(Image("random", ((0x0800_0000, made.image),), SymbolTable(())))


@pytest.mark.skipif(library_path() is None, reason="no native core is built")
@pytest.mark.parametrize("seed", range(30, 34))
def test_random_programs_leave_the_same_rows_on_both_cores(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """With nobody recording, at any boundary, with exceptions in between, in halves on one core and on the other."""
    made = program(seed, 40, tick=67 + 12 * seed)
    boards = []
    for name in ("native", "python", "native"):
        monkeypatch.setenv("P2OS_CORE", name)
        boards.append(make_board(made))
    dice = random.Random(seed)
    seen: set[int] = set()
    native, python, moved = boards
    for _ in range(60):
        limit = native.now_ns + dice.choice((300, 2000, 9000))
        for board in boards:
            board.advance_to(limit)
        assert native.chip.engine.log.rows() == python.chip.engine.log.rows() == moved.chip.engine.log.rows()
        assert native.snapshot()["chip"] == python.snapshot()["chip"]
        seen |= {row[2] for row in native.chip.engine.log.rows()}
        moved.restore(python.snapshot())
    assert len(native.chip.engine.log.rows()) == LAST_ROWS
    assert seen >= {BLOCK, EXCEPTION_RETURN, 15}


def test_a_branch_to_itself_is_kept_once_and_again_after_an_interrupt(core: str, boot) -> None:
    machine = boot(TICKS, {15: "tick"})
    machine.run(250, slice_us=7)
    spin, tick = machine.label("spin"), machine.label("tick")
    rows = machine.board.last_rows
    assert [row[1:] for row in rows[1:]] == [
        (spin, BLOCK),
        *[(spin, 15), (tick, BLOCK), (spin, EXCEPTION_RETURN), (spin, BLOCK)] * 2,
    ]


def test_a_recorder_attached_within_a_branch_to_itself_gets_its_row(core: str, boot) -> None:
    machine = boot("spin: b spin").run(50)
    before = machine.board.last_rows
    recorder = machine.board.chip.record_blocks(100)
    machine.run(50, slice_us=3)
    assert [row[1:] for row in recorder.drain()] == [(machine.label("spin"), BLOCK)]
    assert machine.board.last_rows == before


def test_single_steps_and_breakpoints_leave_the_rows_of_a_plain_run(core: str, boot) -> None:
    plain, halted = boot(TICKS, {15: "tick"}), boot(TICKS, {15: "tick"})
    halted.board.chip.engine.breakpoints.add(halted.label("tick") + 2)
    for number in range(40):
        if number % 3:
            halted.board.chip.step(halted.board.now_ns + 1_000_000)
        else:
            halted.board.advance_to(halted.board.now_ns + 20_000)
    halted.board.chip.engine.breakpoints.clear()
    halted.run(100)
    plain.board.advance_to(halted.board.now_ns)
    assert halted.board.last_rows == plain.board.last_rows
    assert plain.board.last_rows[-1][0] > 2000


def test_rows_are_kept_from_the_start_and_over_a_reset(core: str, boot) -> None:
    machine = boot("movs r5, #3\nloop: subs r5, #1\nbne loop\nb stop")
    assert machine.board.last_rows == ()
    assert machine.board.last_blocks() == []
    machine.run(10)
    first = machine.board.last_rows
    # The start with the first turn, two turns, `b stop`, and what it goes to.
    assert [row[1] for row in first] == [machine.label(n) for n in ("start", "loop", "loop")] + [
        machine.label("loop") + 4, machine.label("stop"),
    ]  # fmt: skip
    machine.board.reset()
    machine.run(10)
    assert machine.board.last_rows[: len(first)] == first
    assert [row[1:] for row in machine.board.last_rows[len(first) :]] == [row[1:] for row in first]


def test_a_snapshot_has_the_rows_with_it(core: str, boot) -> None:
    machine = boot(TICKS, {15: "tick"}).run(333)
    saved, rows = machine.board.snapshot(), machine.board.last_rows
    machine.run(100)
    later = machine.board.last_rows
    machine.board.restore(saved)
    assert machine.board.last_rows == rows
    assert machine.run(100).board.last_rows == later != rows


def test_a_fault_keeps_what_led_to_it_however_long_its_handler_runs(core: str, boot) -> None:
    handler = "\nhard: adds r4, #1\ncmp r4, #3\nbne hard\nmovs r4, #0\nb hard"
    machine = boot(DEREFERENCES_NOTHING + handler, {3: "hard"}).run(1000)
    report = machine.board.fault
    assert report is not None
    assert [row[1] for row in report.last_rows] == [
        machine.label("start"), machine.label("loop"), machine.label("loop"), machine.label("loop") + 4,
    ]  # fmt: skip
    assert machine.board.last_rows == report.last_rows
    assert machine.label("hard") in {row[1] for row in machine.board.chip.engine.log.rows()}
    assert "loop" in machine.board.last_blocks()[1]


def test_a_wait_that_timed_out_has_the_last_blocks_in_its_notes(core: str, boot) -> None:
    machine = boot(TICKS, {15: "tick"})
    with pytest.raises(WaitError) as caught:
        machine.board.usart1.expect(b"ready", within="1 ms")
    (note,) = caught.value.__notes__
    assert note.splitlines() == [TITLE, *machine.board.last_blocks()]
    assert "-> SysTick, interrupts spin+0x0" in note
    assert "\n" not in str(caught.value)


def test_a_recorder_that_fails_does_not_cost_a_row(core: str, boot) -> None:
    def fail(_recorder: BlockRecorder) -> None:
        raise OSError("disk full")

    def rows_of(machine) -> tuple[BlockRow, ...]:
        machine.run(50)
        return machine.board.last_rows

    machine, whole = boot(TICKS, {15: "tick"}), boot(TICKS, {15: "tick"})
    machine.board.chip.record_blocks(2, fail)
    with pytest.raises(OSError, match="disk full"):
        machine.run(250)
    machine.board.chip.stop_recording()
    whole.board.advance_to(machine.board.now_ns)
    assert rows_of(machine) == rows_of(whole)
