"""Programs at random, which all cores run alike, against traces that were approved: registers, exceptions, time."""

import random
import zlib
from collections.abc import Iterator
from functools import cache, partial

from bluepill_sim import BluePill
from bluepill_sim.core import Reg
from bluepill_sim.core.unicorn_core import GENERAL
from bluepill_sim.extension.library import core_chosen
from bluepill_sim.program.image import Image
from tests.bluepill_sim.core.walks.programs import assembled
from tests.bluepill_sim.machine import STACK, listen
from tests.tools.suite.approved import judge_alike, judge_of

PROGRAMS, SLICES = 30, 40
#: Time between two looks, ns.
SPANS_NS = (1, 125, 1_000, 4_000, 20_000, 60_000)
#: The cores that go from block to block, and so show the same.
CORES = ("native", "python", "own")
_SPECIAL = (Reg.XPSR, Reg.CONTROL, Reg.MSP, Reg.PSP, Reg.PRIMASK, Reg.BASEPRI, Reg.FAULTMASK)
_MSP, _PSP, _BASEPRI = 17, 18, 20
_SYSTEM = (
    "exception_number", "sleep", "event_register", "vector_table", "scr", "ccr", "shcsr", "cfsr", "hfsr", "mmfar",
    "bfar", "is_locked_up", "last_sleep_cycle", "bus_error_cycle", "bus_error_pc", "bus_error_address",
)  # fmt: skip
_NVIC = ("pending", "active", "enabled", "levels", "priority_grouping")


@cache
def image() -> tuple[Image, list[tuple[int, int]]]:
    """Return the programs."""
    return assembled(PROGRAMS, "bg")


def _board(core: str) -> BluePill:
    with core_chosen(core):
        return BluePill(image()[0])


def _request(board: BluePill, line: int, *, stays: bool) -> None:
    """Have an interrupt come, at times of a chip of the family that has more of them; its line may stay high."""
    nvic = board.chip.processor.nvic
    nvic.enabled |= 1 << line
    nvic.set_level(line, True)
    board.chip.processor.pending_changed()
    nvic.set_level(line, stays)


def _raise(board: BluePill, lines: list[int]) -> None:
    """Have devices raise interrupts at once, and take them back."""
    board.chip.processor.nvic.enabled |= sum(1 << line for line in lines)
    for level in (True, False):
        for line in lines:
            board.chip.fabric.set_line(line, level)


def _shown(board: BluePill) -> str:
    """Return all that decides what comes next, and what was seen of the last blocks."""
    chip, processor = board.chip, board.chip.processor
    values = [chip.engine.registers[one] for one in (*GENERAL[:15], *_SPECIAL)]
    values[_BASEPRI] &= 0xF0  # Unicorn keeps the rest of it for a while, as that of stacks,
    values[_PSP] &= ~3
    if not processor.is_privileged:  # and shows a thread without privilege neither stacks nor masks
        values[_MSP:] = [0] * len(values[_MSP:])
    registers = " ".join(f"{value:x}" for value in values)
    system = " ".join(str(getattr(processor, name)) for name in _SYSTEM)
    nvic = " ".join(f"{getattr(processor.nvic, name):x}" for name in _NVIC)
    memory = zlib.crc32(board.read_memory(0x2000_0000, 0x5000) or b"")
    pins = chip.pins.fabric
    parts = zlib.crc32(b"".join(bytes(part.words) + part.held for part in chip.parts.by_name.values()))
    parts ^= zlib.crc32(pins.ports + pins.waves)
    tick = f"{processor.systick.next_cycle} {processor.shared.tick_control} {processor.shared.tick_count_flag}"
    rows = zlib.crc32(str(board.last_rows).encode())
    at = f"{board.now_ns} {chip.engine.cycle} {board.pc:x}"
    return f"{at} {registers} {system} {nvic} {tick} {memory:x} {parts:x} {rows:x}"


def _episodes(core: str, _: random.Random) -> Iterator[str]:
    """Yield what each program shows, in its turn on one board."""
    board = _board(core)
    fresh = board.snapshot()
    for number, (base, stop) in enumerate(image()[1]):
        board.restore(fresh)
        yield "\n".join([f"program {number}", *lines_of(board, number, base, stop, is_exact=core == "exact")])


def lines_of(board: BluePill, number: int, base: int, stop: int, *, is_exact: bool) -> Iterator[str]:
    """Yield what a program shows from time to time; some are watched, recorded, saved and restored."""
    dice, chip = random.Random(f"slices {number}"), board.chip
    edges: list[tuple[str, str, int]] = []
    rows: list[tuple[int, ...]] = []
    if number % 3 == 2 and is_exact:
        with core_chosen("exact"):
            chip.latency.vary(seed=number, most=30)
    pins = listen(board, edges) if number % 2 else None
    recorder = chip.record_blocks(1000, lambda full: rows.extend(full.drain())) if number % 5 == 3 else None
    chip.system.write(0xED08, 4, base)
    chip.engine.registers[Reg.SP] = STACK
    for register in GENERAL[:13]:
        chip.engine.registers[register] = dice.getrandbits(32)
    chip.engine.jump(chip.memory.read_word(base + 4) or 0)
    for turn in range(SLICES):
        board.pin("PA0").drive(bool(turn % 2))
        if dice.random() < 0.15:
            _request(board, dice.choice((1, 5, 47, 48, 59)), stays=number > 0 and dice.random() < 0.1)
        if dice.random() < 0.1:
            _raise(board, dice.sample((0, 6, 11, 31, 42), dice.randrange(1, 4)))
        if turn == SLICES // 3:
            saved = board.snapshot()
            board.advance_to(board.now_ns + 2_000)
            board.restore(saved)
        board.advance_to(board.now_ns + dice.choice(SPANS_NS))
        yield _shown(board)
        if board.pc == stop and turn > SLICES // 2:
            break
    if recorder is not None:
        rows += recorder.drain()
        chip.stop_recording()
    if pins is not None:
        pins.close()
    yield f"{rows} {edges} {[str(warning) for warning in board.warnings]} {board.fault!r}"


TRACES = {core: partial(_episodes, core) for core in (*CORES, "exact")}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
test_cores_that_go_from_block_to_block_show_the_same = judge_alike(__file__, CORES)
