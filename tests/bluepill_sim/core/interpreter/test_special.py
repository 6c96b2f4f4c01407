"""MSR, MRS and CPS, by every number, mask, mode and privilege, against what the manual's pseudocode says (ARM B5.2)."""

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass, replace

import pytest

from bluepill_sim.core.unicorn_core import GENERAL, Reg
from bluepill_sim.extension.layout import VIEWS_BASE
from bluepill_sim.extension.library import library
from bluepill_sim.native.interpreter_core import InterpreterCore

FLASH, BYTES = 0x0800_0000, 0x400
MAIN, PROCESS, PRIMASK, BASEPRI, BASEPRI_MAX, FAULTMASK, CONTROL = 8, 9, 16, 17, 18, 19, 20
_BKPT = 0xBE00


@dataclass(frozen=True)
class State:
    """The special registers."""

    flags: int = 0
    ipsr: int = 0
    main: int = 0x2000_1000
    process: int = 0x2000_2000
    primask: int = 0
    basepri: int = 0
    faultmask: int = 0
    control: int = 0

    @property
    def is_privileged(self) -> bool:
        """Whether it is (B1.3.1)."""
        return self.ipsr != 0 or not self.control & 1


STATES = tuple(
    State(flags=0xA << 28, ipsr=ipsr, control=control, primask=1, basepri=0x50, faultmask=1)
    for ipsr in (0, 11, 0x1FF)
    for control in range(4)
)


def read(state: State, number: int) -> int:
    """MRS (B5.2.2): EPSR reads as 0; what needs privilege reads 0 without."""
    if number < 8:
        return (state.ipsr if number & 1 else 0) | (0 if number & 4 else state.flags)
    if number == CONTROL:
        return state.control
    if not state.is_privileged:
        return 0
    return {
        MAIN: state.main, PROCESS: state.process, PRIMASK: state.primask, BASEPRI: state.basepri,
        BASEPRI_MAX: state.basepri, FAULTMASK: state.faultmask,
    }.get(number, 0)  # fmt: skip


def written(state: State, number: int, mask: int, value: int) -> State:
    """MSR (B5.2.3); PM0056: BASEPRI has its upper four bits."""
    if number < 8:
        return replace(state, flags=value & 0xF800_0000) if mask & 2 and not number & 4 else state
    if not state.is_privileged:
        return state
    level = value & 0xF0
    raises = level and (level < state.basepri or not state.basepri)
    changed = {
        MAIN: {"main": value & ~3},
        PROCESS: {"process": value & ~3},
        PRIMASK: {"primask": value & 1},
        BASEPRI: {"basepri": level},
        BASEPRI_MAX: {"basepri": level} if raises else {},
        FAULTMASK: {"faultmask": value & 1},
        CONTROL: {"control": value & 3 if not state.ipsr else value & 1 | state.control & 2},
    }
    return replace(state, **changed.get(number, {}))


class Bench:
    """A bare core that runs one instruction."""

    def __init__(self) -> None:
        self.core = core = InterpreterCore(_raise)
        self._code = ctypes.create_string_buffer(BYTES)
        core.map_memory(FLASH, self._code, "rx")
        core.on_interrupt(lambda _number: core.stop())

    def run(self, state: State, halfwords: tuple[int, ...], value: int) -> tuple[State, int]:
        """Run an instruction with R1 = value; return the state behind it, and R2."""
        code = b"".join(half.to_bytes(2, "little") for half in (*halfwords, _BKPT))
        ctypes.memmove(self._code, code, len(code))
        core, registers = self.core, self.core.registers
        core.drop_all_code()
        registers[Reg.IPSR], registers[Reg.CONTROL] = 0, state.control
        registers[Reg.CPSR] = state.flags | 0x20
        registers[Reg.IPSR] = state.ipsr
        names = ("main", "process", "primask", "basepri", "faultmask")
        for name in names:
            registers[_REGISTERS[name]] = getattr(state, name)
        registers[Reg.R1], registers[Reg.R2] = value, 0x7777_7777
        assert core.start(FLASH | 1) == 0
        left = {name: registers[_REGISTERS[name]] for name in names}
        flags = registers[Reg.XPSR] & 0xF800_0000
        sp = left["process"] if registers[Reg.CONTROL] & 2 and not registers[Reg.IPSR] else left["main"]
        assert registers[Reg.SP] == sp, "R13 is the one that CONTROL and the mode choose"
        behind = State(flags=flags, ipsr=registers[Reg.IPSR], control=registers[Reg.CONTROL], **left)
        return behind, registers[Reg.R2]


_REGISTERS = {
    "main": Reg.MSP, "process": Reg.PSP, "primask": Reg.PRIMASK, "basepri": Reg.BASEPRI, "faultmask": Reg.FAULTMASK,
}  # fmt: skip


def _raise(error: BaseException) -> None:
    raise error


@pytest.fixture(scope="module")
def bench() -> Bench:
    """A core."""
    return Bench()


def numbers() -> Iterator[int]:
    """Yield the numbers of special registers and those about them, where there are none."""
    yield from range(24)
    yield from (32, 40, 127, 255)


@pytest.mark.parametrize("state", STATES)
def test_mrs_reads_what_the_mode_and_privilege_let_it(bench: Bench, state: State) -> None:
    for number in numbers():
        behind, value = bench.run(state, (0xF3EF, 0x8200 | number), 0)
        assert (behind, value) == (state, read(state, number)), number


@pytest.mark.parametrize("state", STATES)
def test_msr_writes_what_the_mode_and_privilege_let_it(bench: Bench, state: State) -> None:
    for number in numbers():
        for mask in (2, 3):
            for value in (0, 0xFFFF_FFFF, 0x5000_0043):
                behind, _ = bench.run(state, (0xF381, 0x8000 | mask << 10 | number), value)
                assert behind == written(state, number, mask, value), (number, mask, hex(value))


def test_basepri_max_only_raises(bench: Bench) -> None:
    for now in (0, 0x10, 0x50, 0xF0):
        for value in (0, 0x0F, 0x10, 0x40, 0x50, 0x60, 0xF0, 0x150):
            state = State(basepri=now)
            behind, _ = bench.run(state, (0xF381, 0x8800 | BASEPRI_MAX), value)
            assert behind == written(state, BASEPRI_MAX, 2, value), (now, value)


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("mask", range(4))
def test_cps_sets_and_clears_the_masks_that_it_names_with_privilege(bench: Bench, state: State, mask: int) -> None:
    """CPSIE clears, CPSID sets; bit 1 is PRIMASK, bit 0 FAULTMASK (B5.2.1)."""
    for before in (0, 1):
        for disables in (0, 1):
            start = replace(state, primask=before, faultmask=before)
            behind, _ = bench.run(start, (0xB660 | disables << 4 | mask,), 0)
            changed = start.is_privileged
            assert behind.primask == (disables if changed and mask & 2 else before)
            assert behind.faultmask == (disables if changed and mask & 1 else before)
            assert replace(behind, primask=before, faultmask=before) == start


def test_a_context_keeps_each_register_and_not_what_an_instruction_keeps_for_itself(bench: Bench) -> None:
    """LDRD R0, R1, [R1], #8, which uses a scratch register; then all registers are put back on another core."""
    core, registers = bench.core, bench.core.registers
    before = core.context
    state = State(flags=0xC << 28, ipsr=0, control=2, primask=1, basepri=0x30, faultmask=1)
    bench.run(state, (0xBF00,), 3)
    kept = core.context
    bench.run(state, (0x0011, 0xB2D2), 3)  # MOVS R1, R2; UXTB R2, R2
    assert core.context != kept
    other = InterpreterCore(_raise)
    other.context = kept
    assert other.context == kept != before
    for name in (Reg.MSP, Reg.PSP, Reg.SP, Reg.PRIMASK, Reg.BASEPRI, Reg.FAULTMASK, Reg.CONTROL, Reg.XPSR, Reg.PC):
        core.context = kept
        assert other.registers[name] == registers[name], name
    with pytest.raises(ValueError, match="another core"):
        other.context = kept[:-1]


#: What each register keeps of a word that is written, and which others change with it: R13 is one of two.
KEPT = {
    **dict.fromkeys(GENERAL[:13], (0xFFFF_FFFF, ())), Reg.LR: (0xFFFF_FFFF, ()), Reg.SP: (0xFFFF_FFFC, (Reg.MSP,)),
    Reg.MSP: (0xFFFF_FFFC, (Reg.SP,)), Reg.PSP: (0xFFFF_FFFC, ()), Reg.PRIMASK: (1, ()), Reg.BASEPRI: (0xF0, ()),
    Reg.FAULTMASK: (1, ()), Reg.IPSR: (0x1FF, (Reg.XPSR,)), Reg.CONTROL: (3, (Reg.SP,)),
    Reg.XPSR: (0xF800_0000, (Reg.CPSR,)),
    Reg.CPSR: (0xFE00_FC20, (Reg.XPSR,)), Reg.PC: (0xFFFF_FFFE, (Reg.CPSR, Reg.XPSR)),
}  # fmt: skip


@pytest.mark.parametrize("name", KEPT, ids=lambda name: name.name)
def test_a_register_that_is_written_keeps_its_bits_and_changes_no_other(name: Reg) -> None:
    core = InterpreterCore(_raise)
    kept, others = KEPT[name]
    for number, each in enumerate(KEPT):
        if each not in {Reg.CONTROL, Reg.IPSR}:
            core.registers[each] = 0x0102_0304 * (number + 1)
    fresh = core.context
    for value in (0xFFFF_FFFF, 0, 0x5A5A_5A5A, 0xA5A5_A5A5 & ~2, 0x0400_0C20):
        core.context = fresh
        before = {each: core.registers[each] for each in KEPT}
        core.registers[name] = value
        after = {each: core.registers[each] for each in KEPT}
        assert after[name] & kept == value & kept, hex(value)
        assert after[name] & ~kept == before[name] & ~kept if name is Reg.XPSR else after[name] & ~kept == 0
        changed = {each for each in KEPT if after[each] != before[each]}
        assert changed <= {name, *others}, hex(value)
        if name in {Reg.PC, Reg.CPSR}:
            is_thumb = value & 1 if name is Reg.PC else value >> 5 & 1
            assert (after[Reg.XPSR] >> 24 & 1, after[Reg.CPSR] >> 5 & 1) == (is_thumb, is_thumb)
        if name is Reg.IPSR:
            assert after[Reg.XPSR] & 0x1FF == value & 0x1FF


def test_a_register_that_there_is_not_reads_0_and_keeps_nothing() -> None:
    """Numbers about those of Unicorn that are known."""
    core = InterpreterCore(_raise)
    fresh = core.context
    for number in {*range(140)} - {each.value for each in KEPT}:
        word = ctypes.c_uint32(0xFFFF_FFFF)
        library().interpreter_reg_write(core.handle, number, ctypes.addressof(word))
        library().interpreter_reg_read(core.handle, number, ctypes.addressof(word))
        assert word.value == 0, number
    assert core.context == fresh


def test_pages_are_asked_for_by_loads_where_views_are_mapped_and_else_by_fetches_alone() -> None:
    core = InterpreterCore(_raise)
    code = ctypes.create_string_buffer(bytes.fromhex("086800be").ljust(BYTES, b"\0"), BYTES)  # LDR R0, [R1]; BKPT
    core.map_memory(FLASH, code, "rx")
    core.map_memory(0x2000_0000, ctypes.create_string_buffer(BYTES), "rwx")
    asked: set[int] = set()
    core.on_page(lambda address, kind: (asked.add(kind), (address, 7))[1])
    core.on_interrupt(lambda _number: core.stop())
    core.registers[Reg.R1] = 0x2000_0000
    core.start(FLASH | 1)
    assert asked == {18}
    core.map_memory(VIEWS_BASE, ctypes.create_string_buffer(BYTES), "rx")
    core.start(FLASH | 1)
    assert asked == {16, 18}
