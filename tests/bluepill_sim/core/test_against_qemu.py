"""Random programs give the same registers, flags and memory here and on QEMU's Cortex-M3, and on both of our cores.

Unicorn descends from QEMU, so that agreement proves less than it seems to:
what both have wrong shows only in `test_flag_vectors.py`. It does prove that
our own hooks, block boundaries and stops change nothing.
"""

import random
import shutil
import subprocess
from pathlib import Path

import pytest

from bluepill_sim.board import BluePill
from bluepill_sim.core import BLOCK, BlockRecorder
from bluepill_sim.core.recorder import LAST_ROWS
from bluepill_sim.program.image import Image, SymbolTable
from tests.bluepill_sim.core.thumb_streams import SRAM, SRAM_BYTES, Program, program

QEMU = shutil.which("qemu-system-arm")
needs_qemu = pytest.mark.skipif(QEMU is None, reason="no qemu-system-arm here (Debian: qemu-system-arm)")
#: Bytes of a case's registers and flags.
CASE_BYTES = 14 * 4


def run_on_qemu(made: Program, folder: Path) -> bytes:
    """Return what the SRAM holds in the end."""
    image = folder / "program.bin"
    image.write_bytes(made.image)
    done = subprocess.run(
        [
            str(QEMU), "-M", "lm3s6965evb", "-display", "none", "-serial", "none", "-monitor", "none", "-nodefaults",
            "-semihosting-config", "enable=on,target=native", "-kernel", str(image),
        ],
        capture_output=True, timeout=60, check=False,
    )  # fmt: skip
    assert len(done.stdout) == SRAM_BYTES, done.stderr.decode(errors="replace")
    return done.stdout


def run_here(made: Program, slice_ns: int | None = None) -> tuple[bytes, int, int]:
    """Return what the SRAM holds in the end, how many blocks ran, and the cycles that they took."""
    board = BluePill(Image("random", ((0x0800_0000, made.image),), SymbolTable(())))
    board.chip.engine.breakpoints.add(made.end)
    recorder = board.chip.record_blocks(1_000_000)
    while board.pc != made.end:
        assert board.now_ns < 1_000_000_000, board.fault
        board.advance_to(board.now_ns + (slice_ns or 100_000_000))
    assert board.fault is None
    memory = board.read_memory(SRAM, SRAM_BYTES)
    assert memory is not None
    return memory, sum(row[2] == BLOCK for row in recorder.drain()), board.cycle


def compare(seed: int, cases: int, folder: Path) -> int:
    """Run a program on both; return the number of blocks."""
    made = program(seed, cases)
    here, blocks, _ = run_here(made)
    there = run_on_qemu(made, folder)
    for number in range(cases):
        at = SRAM_BYTES - CASE_BYTES * (number + 1)
        ours, theirs = here[at : at + CASE_BYTES], there[at : at + CASE_BYTES]
        assert ours == theirs, (
            f"seed {seed}, case {number} (APSR, R0 to R12): {ours.hex(' ', 4)} != {theirs.hex(' ', 4)}"
        )
    assert here == there, f"seed {seed}: memory"
    return blocks


@needs_qemu
@pytest.mark.parametrize("seed", [1, 2])
def test_random_programs_agree_with_qemu(seed: int, tmp_path: Path) -> None:
    assert compare(seed, 100, tmp_path) > 400


@needs_qemu
@pytest.mark.slow
def test_thousands_of_random_blocks_agree_with_qemu(tmp_path: Path) -> None:
    assert sum(compare(seed, 250, tmp_path) for seed in range(10, 12)) > 2_000


@needs_qemu
@pytest.mark.soak
@pytest.mark.parametrize("seed", range(100, 140))
def test_tens_of_thousands_of_random_blocks_agree_with_qemu(seed: int, tmp_path: Path) -> None:
    compare(seed, 250, tmp_path)


def test_random_programs_do_not_depend_on_slices() -> None:
    made = program(3, 60)
    whole = run_here(made)
    assert run_here(made, 7_000) == whole


def test_random_programs_do_not_depend_on_breakpoints_and_steps() -> None:
    made = program(4, 12)
    memory, _, cycles = run_here(made)
    board = BluePill(Image("random", ((0x0800_0000, made.image),), SymbolTable(())))
    while board.pc != made.end:
        assert board.chip.step(1_000_000_000).halt is not None
    assert board.read_memory(SRAM, SRAM_BYTES) == memory
    assert board.cycle == cycles


@pytest.mark.parametrize("seed", range(20, 24))
def test_random_programs_are_the_same_on_both_cores(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupted by a tick at any block: every block and exception at its cycle, and all that decides the future."""

    def story(core: str) -> tuple[object, ...]:
        monkeypatch.setenv("P2OS_CORE", core)
        made = program(seed, 60, tick=61 + 10 * seed)
        board = BluePill(Image("random", ((0x0800_0000, made.image),), SymbolTable(())))
        rows: list[tuple[int, int, int]] = []

        def drain(recorder: BlockRecorder) -> None:
            rows.extend(recorder.drain())

        recorder = board.chip.record_blocks(1000, drain)
        slices = random.Random(seed)
        while board.now_ns < 1_000_000:
            board.advance_to(min(1_000_000, board.now_ns + slices.choice((1000, 70_000, 500_000))))
        drain(recorder)
        assert board.chip.engine.log.rows() == tuple(rows[-LAST_ROWS:])
        assert sum(row[2] == 15 for row in rows) > 20
        return rows, board.cycle, board.pc, board.fault, board.snapshot()["chip"]

    assert story("native") == story("python")
