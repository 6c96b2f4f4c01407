"""What the library in C takes of the heap it gives back: of code that is written anew, and of boards that are gone.

Only glibc says how much of the heap is in use. What Python keeps moves it by up to some kilobytes, and then no more;
what is lost each time adds up.
"""

import ctypes
import gc
import json
import subprocess
from collections import deque
from collections.abc import Callable
from pathlib import Path

import pytest

from bluepill_sim.analysis.edge_log import EdgeLog
from bluepill_sim.extension.library import core_chosen
from tests.bluepill_sim.machine import COUNTER_ON, PORT_A_OUT, Machine, listen
from tests.tools.forked_python import forked_python
from tests.whole.failing_calls import library

LIBC = ctypes.CDLL(None) if hasattr(ctypes.CDLL(None), "mallinfo2") else None
#: The smallest piece of a heap takes 32 bytes; seven that were given back before may still count as in use.
LEAST_LOST = 8
#: Over so many looks at the heap, and so many looks at most.
LOOKS, MOST_LOOKS = 12, 200
#: Has `movs r0, #n; bx lr` in SRAM, another n each round, and calls it; then it waits for the cycle counter.
REWRITES = f"""
{PORT_A_OUT}{COUNTER_ON}
mov32 r4, #0x20001000
mov32 r6, #0x20001001
mov32 r5, #0x47702000
movs r2, #0
again: movs r1, #1
.half 0x404D
str r5, [r4, #0]
dsb
isb
blx r6
adds r2, #1
mov32 r1, #0xE0001000
ldr r3, [r1, #4]
adds r3, #120
wait: ldr r0, [r1, #4]
.half 0x4298
bcc wait
b again
"""
#: Runs code in SRAM three times, and once more when it has been written over, with one allocation of our C refused: the
#: first, the second, and so on up to one that it never comes to. Prints what happened, and R0, of each run.
REFUSED = """
import ctypes, json, sys
from pathlib import Path
from tests.bluepill_sim.core.interpreter.test_blocks_decode import ADD_ONE, BKPT, NOP, SRAM, Board, InterpreterCore
from tests.whole.failing_calls import Kind, Outcome, page_in
calls = ctypes.CDLL(None)
for number in range(1, int(sys.argv[2]) + 1):
    board = Board(InterpreterCore)
    board.put(SRAM, ADD_ONE, NOP, ADD_ONE, BKPT)
    folder = Path(sys.argv[1], str(number))
    folder.mkdir()
    calls.failing_calls_arm(str(page_in(folder)).encode(), Kind.MALLOC, ctypes.c_long(number), Outcome.FAIL)
    seen = [board.run(SRAM) for _ in range(3)]
    board.put(SRAM, ADD_ONE, ADD_ONE, ADD_ONE, BKPT, drops=False)
    print(json.dumps([*seen, board.run(SRAM)]))
"""

pytestmark = pytest.mark.skipif(LIBC is None, reason="no glibc, which says how much of the heap is in use")


class HeapUse(ctypes.Structure):
    """`struct mallinfo2`."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in ("arena", "ordblks", "smblks", "hblks", "mapped", "usmblks", "fsmblks", "used", "free", "keepcost")
    )


def grows(act: Callable[[], object]) -> bool:
    """Tell whether the heap goes on growing as something is done again and again."""
    assert LIBC is not None
    LIBC.mallinfo2.restype = HeapUse
    gc.freeze()  # what other tests have left: to look through it each time takes longer than what is measured
    try:
        seen = deque[int](maxlen=LOOKS)
        for _ in range(MOST_LOOKS):
            act()
            gc.collect()
            now = LIBC.mallinfo2()
            if len(seen) == LOOKS and now.used + now.mapped - seen[0] < LOOKS * LEAST_LOST:
                return False
            seen.append(now.used + now.mapped)
        return True
    finally:
        gc.unfreeze()


def test_the_smallest_piece_that_is_lost_each_time_is_seen() -> None:
    assert LIBC is not None
    assert grows(lambda: LIBC.malloc(1))
    assert not grows(lambda: None)


@pytest.mark.parametrize("core", ["own", "exact"])
def test_code_that_is_written_anew_takes_no_more_memory(core: str) -> None:
    with core_chosen(core):
        machine = Machine(REWRITES, {}).deafen()
    assert not grows(lambda: machine.run(100))
    assert machine.board.register("R2") > 20


@pytest.mark.parametrize("core", ["own", "exact"])
def test_a_board_that_is_gone_leaves_no_memory_behind(core: str) -> None:
    def live() -> None:
        with core_chosen(core):
            machine = Machine(REWRITES, {})
        board, log = machine.board, EdgeLog([1], [0])
        pins = listen(board, [])
        board.chip.record_blocks(100)
        machine.run(30, slice_us=7)
        board.restore(board.snapshot())
        board.chip.stop_recording()
        machine.run(60, slice_us=13)
        for at_ns in range(100):
            log.put(at_ns, 1, at_ns % 2)
        pins.close()

    assert not grows(live)


@pytest.mark.parametrize("core", ["own", "exact"])
def test_recording_anew_takes_no_more_memory(core: str) -> None:
    with core_chosen(core):
        machine = Machine(REWRITES, {}).deafen()

    def again() -> None:
        machine.board.chip.record_blocks(1000)
        pins = listen(machine.board, [])
        machine.run(20)
        machine.board.chip.stop_recording()
        pins.close()

    assert not grows(again)


def test_without_memory_code_in_sram_runs_as_ever_or_a_fetch_fails(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """What no memory was for is asked for again at the next run; code that could not be copied is decoded anew."""
    allocations = 6
    done = subprocess.run(
        [forked_python(library(tmp_path_factory)), "-c", REFUSED, str(tmp_path), str(allocations + 1)],
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    runs = [json.loads(line) for line in done.stdout.splitlines()]
    failed = [[number for number, (_, ((what, *_), *_)) in enumerate(each) if what == "failed"] for each in runs]
    assert failed == [[0], [0], [], [3], [3], [], []]
    for each, without in zip(runs, failed, strict=True):
        results = [result for result, _ in each]
        assert results == [0 if number in without else expected for number, expected in enumerate((2, 2, 2, 3))]
