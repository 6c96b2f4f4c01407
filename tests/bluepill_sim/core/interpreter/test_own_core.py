"""The interpreter as its owner sees it: registers that are written, traps, and where a run goes on."""

from collections.abc import Callable

import pytest

from bluepill_sim.core.unicorn_core import Reg
from bluepill_sim.native.interpreter_core import InterpreterCore
from tests.bluepill_sim.machine import Machine

Boot = Callable[..., Machine]
USAGE_FAULT, CYCLE_NS = 6, 125
#: CCR: DIV_0_TRP, UNALIGN_TRP; SHCSR: USGFAULTENA.
TRAPS_ON = """
mov32 r1, #0xE000ED14
mov32 r2, #{ccr}
str r2, [r1, #0]
mov32 r2, #0x00040000
str r2, [r1, #16]
isb
"""
TRAP = """
movs r3, #0
mov32 r4, #0x20000802
here: {code}
b stop
trap: ldr r0, [sp, #24]
log r0
mov32 r1, #0xE000ED28
ldr r0, [r1, #0]
log r0
b stop
"""


@pytest.fixture
def bare() -> InterpreterCore:
    """A core without memory."""
    return InterpreterCore(_raise)


def _raise(error: BaseException) -> None:
    raise error


@pytest.mark.parametrize("name", ["SP", "MSP", "PSP"])
def test_the_two_lowest_bits_of_a_stack_pointer_do_not_exist(bare: InterpreterCore, name: str) -> None:
    registers = bare.registers
    for bits in range(8):
        registers[Reg[name]] = 0x2000_0800 + bits
        assert registers[Reg[name]] == 0x2000_0800 + (bits & 4)


def test_masks_and_control_have_the_bits_of_a_cortex_m3(bare: InterpreterCore) -> None:
    registers = bare.registers
    for name, kept in ((Reg.PRIMASK, 1), (Reg.BASEPRI, 0xF0), (Reg.FAULTMASK, 1), (Reg.CONTROL, 3)):
        for value in (0, 1, 2, 3, 4, 0xF, 0x10, 0xFF, 0x100):
            registers[name] = value
            assert registers[name] == value & kept, name


def test_each_mode_has_its_stack_pointer(bare: InterpreterCore) -> None:
    registers = bare.registers
    registers[Reg.MSP], registers[Reg.PSP] = 0x2000_1000, 0x2000_2000
    assert registers[Reg.SP] == 0x2000_1000
    registers[Reg.CONTROL] = 2
    assert [registers[name] for name in (Reg.SP, Reg.MSP, Reg.PSP)] == [0x2000_2000, 0x2000_1000, 0x2000_2000]
    registers[Reg.SP] = 0x2000_3000
    assert [registers[name] for name in (Reg.MSP, Reg.PSP)] == [0x2000_1000, 0x2000_3000]
    registers[Reg.IPSR] = 11
    assert registers[Reg.SP] == 0x2000_1000
    registers[Reg.CONTROL] = 1  # SPSEL stays: it is taken in thread mode alone
    assert registers[Reg.CONTROL] == 3
    registers[Reg.IPSR] = 0
    assert registers[Reg.SP] == 0x2000_3000


def test_flags_are_kept_by_each_of_their_bits(bare: InterpreterCore) -> None:
    registers = bare.registers
    for flags in range(32):
        registers[Reg.XPSR] = flags << 27
        assert registers[Reg.XPSR] >> 27 == flags
        registers[Reg.CPSR] = flags << 27 | 0x20
        assert registers[Reg.CPSR] >> 27 == flags
    for it_state in range(256):
        registers[Reg.CPSR] = (it_state & 3) << 25 | it_state >> 2 << 10 | 0x20
        assert registers[Reg.XPSR] & 0x0600_FC00 == (it_state & 3) << 25 | it_state >> 2 << 10


@pytest.mark.parametrize("core", ["own", "exact", "native"])
@pytest.mark.parametrize(
    ("ccr", "code", "cfsr"),
    [
        (0x210, "udiv r0, r3, r3", 1 << 25), (0x210, "sdiv r0, r3, r3", 1 << 25), (0x200, "udiv r0, r3, r3", None),
        (0x200, "ldmia r4, {r0, r1}", 1 << 24), (0x200, "stmia r4!, {r0, r1}", 1 << 24),
        (0x200, "ldrd r0, r1, [r4, #0]", 1 << 24), (0x200, "ldr r0, [r4, #0]", None),
        (0x208, "ldr r0, [r4, #0]", 1 << 24), (0x200, "ldrex r0, [r4]", 1 << 24),
    ],
)  # fmt: skip
def test_a_trap_is_taken_at_its_instruction(
    boot: Boot, monkeypatch: pytest.MonkeyPatch, core: str, ccr: int, code: str, cfsr: int | None
) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot(TRAPS_ON.format(ccr=ccr) + TRAP.format(code=code), {USAGE_FAULT: "trap"}).run(20)
    assert machine.is_done
    assert machine.log == ([] if cfsr is None else [machine.label("here"), cfsr])


def test_a_debugger_may_have_a_run_go_on_elsewhere_in_the_block_inside_which_it_stands(
    boot: Boot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it jumps to begins a block, whose row is kept; the rest of the block would be none."""
    monkeypatch.setenv("P2OS_CORE", "exact")
    machine = boot("movs r3, #0\n" + "".join(f"k{n}: adds r3, #1\n" for n in range(8)))
    board = machine.board
    board.advance_to(5 * CYCLE_NS)  # mov32 r7, movs: three cycles, and two of these
    assert (board.pc, board.register("R3")) == (machine.label("k2"), 2)
    board.chip.engine.jump(machine.label("k6") | 1)
    machine.run(5)
    assert machine.is_done
    assert board.register("R3") == 4
    assert machine.label("k6") in [address for _, address, _ in board.last_rows]
