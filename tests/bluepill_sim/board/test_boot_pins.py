"""Where a reset starts: flash, SRAM, or the boot loader that is not there."""

import struct

import pytest

from bluepill_sim.errors import UnmodelledError

#: Stack, start; start: movs r0, #7; b to itself.
SRAM_PROGRAM = struct.pack("<2I", 0x2000_5000, 0x2000_0009) + bytes.fromhex("0720 fee7")


def test_boot0_low_starts_the_flash_whatever_boot1_is(boot) -> None:
    machine = boot("movs r0, #3")
    machine.board.pin("PB2").drive(True)
    machine.board.reset()
    assert machine.run(20).board.register("R0") == 3


def test_both_boot_pins_high_start_the_sram(boot) -> None:
    machine = boot("movs r0, #3")
    board = machine.board
    board.chip.memory.write(0x2000_0000, SRAM_PROGRAM)
    board.boot0 = True
    board.pin("PB2").drive(True)
    board.reset()
    assert board.pc == 0x2000_0008
    snapshot = board.snapshot()
    machine.run(20)
    assert board.register("R0") == 7
    board.boot0 = False
    board.restore(snapshot)
    assert board.boot0


def test_the_boot_loader_is_refused_by_name(boot) -> None:
    board = boot("b stop").board
    board.boot0 = True
    with pytest.raises(UnmodelledError, match="ST's boot loader"):
        board.reset()
