"""What a chip does with stores near the ends of flash, and what it warns of, as approved."""

import random
import zlib
from collections.abc import Iterator

from tests.bluepill_sim.board.walks.test_board_walks import FLIPS, SOURCES
from tests.bluepill_sim.machine import Machine, listen
from tests.tools.suite.approved import Trace, judge_of, said, tried

#: The ends of flash, of its alias at 0, of the option bytes and of system memory.
PROGRAMMED = (
    0, 0x1_FFFC, 0x1_FFFE, 0x2_0000, 0x07FF_FFFE, 0x0800_0000, 0x0800_0001, 0x0801_FFFC, 0x0801_FFFE, 0x0801_FFFF,
    0x0802_0000, 0x1FFF_F7FE, 0x1FFF_F800, 0x1FFF_F80C, 0x1FFF_F80E, 0x1FFF_F810,
)  # fmt: skip


#: Where code is that programs flash, and the cycle at which something else is due.
CODES, HALFWORD = ((0x0800_0200, 421), (0x0800_0200, 420), (0x1FFF_EFFE, 999), (0x1FFF_F000, 999)), 2


def programmed(_draw: random.Random) -> Iterator[str]:
    """Yield what becomes of stores to flash and option bytes, near the ends of each, one by one and at once."""
    chip = Machine(FLIPS, {}).deafen().board.chip
    for key in (0x4567_0123, 0xCDEF_89AB):
        for offset in (4, 8):
            chip.parts.flash.write(offset, 4, key)
    chip.memory.load_flash(0, b"\xff" * len(chip.memory.flash))
    for control in (0x201, 0x210):
        chip.parts.flash.write(16, 4, control)
        fresh = chip.snapshot()
        for address in PROGRAMMED:
            row = list[object]()
            for size in (1, 2, 4):
                chip.restore(fresh)
                row += [
                    tried(chip._write_flash, address, size, 0x5AA5_A55A & (1 << 8 * size) - 1),
                    list(chip._flash_repairs),
                ]
                chip._repair_flash()
                row += [zlib.crc32(chip.memory.flash.raw), zlib.crc32(chip.memory.options)]
                for pc, stop_at in CODES if size == HALFWORD else CODES[:1]:
                    chip.restore(fresh)
                    row.append(tried(chip._program_at_once, address, size, pc, chip.engine.cycle, stop_at))
            yield f"{control:x} {address:x} {said(row)}"


#: DEMCR has TRCENA and MON_EN, without which nobody looks at what FPB and DWT want.
TRACES_ON = "mov32 r0, #0xE000EDFC\nmov32 r1, #0x01010000\nstr r1, [r0, #0]\n"
#: What is not modelled, or asks too much: words of the private peripheral bus, of peripherals, and of no device.
ODD_STORES = (
    (0xE000_EDFC, 0x0100_0000), (0xE000_1028, 0x104), (0xE000_1028, 0xF), (0xE000_2000, 3), (0xE000_2008, 0xC000_0001),
    (0xE000_EDFC, 0x0100_0001), (0xE000_ED0C, 0x05FA_0001), (0xE000_ED0C, 0x05FA_0002), (0xE000_EFA0, 1),
    (0xE000_ED94, 1), (0xE000_E000, 1), (0x4001_3400, 1), (0x4001_3804, 1), (0x4002_1004, 0x0700_0000),
    (0x4002_2010, 1), (0xE004_2004, 7),
)  # fmt: skip


def warned(_draw: random.Random) -> Iterator[str]:
    """Yield what a store of a program makes a chip warn of, the first time and the second, and what stops it."""
    for address, word in ODD_STORES:
        store = f"mov32 r0, #{address}\nmov32 r1, #{word}\nstr r1, [r0, #0]\nldr r2, [r0, #0]\n"
        board = Machine(TRACES_ON + 2 * store, {}).deafen().board
        board.run_for("20 us")
        yield said([f"{address:x}", board.warnings, str(board.fault), board.register("R2"), board.cycle])


def frozen(_draw: random.Random) -> Iterator[str]:
    """Yield which parts each bit of DBGMCU_CR freezes at a halt, where the clocks go on and in Stop."""
    chip = Machine("nop", {}).deafen().board.chip
    for is_stopped in (False, True):
        chip.power.is_stopped = is_stopped
        for word in (0, *(1 << n for n in range(32)), 0xFFFF_FFFF):
            chip.system._dbgmcu_cr = word
            yield f"{is_stopped} {word:x} {[part.name for part in chip._frozen_parts()]}"


def stepped(_draw: random.Random) -> Iterator[str]:
    """Yield what each step comes to, and what subscribers have heard behind it."""
    for source in (FLIPS, *SOURCES):
        board = Machine(source, {}).deafen().board
        heard: list[tuple[str, str, int]] = []
        listen(board, heard, ends_slice={"PA1"})
        for limit_ns in (*(10_000,) * 24, 0):
            reached = board.step(limit_ns)
            yield said([reached, board.pc, board.cycle, board.register("LR"), board.register("SP"), heard])
            heard.clear()


TRACES: dict[str, Trace] = {"stepped": stepped, "programmed": programmed, "warned": warned, "frozen": frozen}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
