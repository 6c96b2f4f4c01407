"""The interpreter as its owner sees it: registers that are written, traps, and where a run goes on."""

import ctypes
from collections.abc import Callable

import pytest

from bluepill_sim.core.unicorn_core import Reg
from bluepill_sim.native.interpreter_core import InterpreterCore
from tests.bluepill_sim.core.interpreter.lockstep import Case, Lockstep, places
from tests.bluepill_sim.machine import COUNTER_ON, FLASH, Machine

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
movs r5, #7
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
    registers[Reg.PSP] = 0x2000_2000
    registers[Reg.MSP] = 0x2000_1000
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
    assert machine.board.register("R5") == (7 if cfsr is None else 0), "nothing behind it has run"


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


#: What writes R13: loads from where R5 points, data processing, MSR.
INTO_SP = (
    ".half 0xF8D5, 0xD000",  # ldr.w sp, [r5]
    ".half 0xF855, 0xDB04",  # ldr.w sp, [r5], #4
    ".half 0xF855, 0xD006",  # ldr.w sp, [r5, r6]
    ".half 0xE9D5, 0xD200",  # ldrd sp, r2, [r5]
    ".half 0xE895, 0x2001",  # ldmia.w r5, {r0, sp}
    "mov sp, r0",
    ".half 0x4485",  # add sp, r0, behind sp = 0
    ".half 0xF100, 0x0D00",  # add.w sp, r0, #0
    ".half 0xEB00, 0x0D06",  # add.w sp, r0, r6
    "msr msp, r0",
)


@pytest.mark.parametrize("code", INTO_SP)
@pytest.mark.parametrize("bits", range(8))
def test_whoever_writes_a_stack_pointer_its_two_lowest_bits_stay_0(
    boot: Boot, monkeypatch: pytest.MonkeyPatch, code: str, bits: int
) -> None:
    monkeypatch.setenv("P2OS_CORE", "own")
    before = "movs r1, #0\nmov sp, r1\n" if code == ".half 0x4485" else ""
    machine = boot(
        f"mov32 r5, #0x20000800\nmov32 r0, #{0x2000_0800 + bits}\nstr r0, [r5, #0]\nstr r0, [r5, #4]\nmovs r6, #0\n"
        f"{before}{code}\nmov r0, sp\nlog r0\n"
    ).run(20)  # fmt: skip
    assert machine.log == [0x2000_0800 + (bits & 4)]


def test_msr_writes_the_process_stack_pointer_too(boot: Boot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "own")
    for bits in range(8):
        machine = boot(f"mov32 r0, #{0x2000_0800 + bits}\nmsr psp, r0\nmrs r0, psp\nlog r0\n").run(20)
        assert machine.log == [0x2000_0800 + (bits & 4)]


@pytest.mark.parametrize("now", [0, 0x20, 0x80])
@pytest.mark.parametrize("value", [0, 0x0F, 0x10, 0x20, 0x30, 0x80, 0x90, 0xF0])
def test_basepri_max_raises_the_mask_and_never_lowers_it(
    boot: Boot, monkeypatch: pytest.MonkeyPatch, now: int, value: int
) -> None:
    """ARM B5.2.3: written where the value is not 0, and lower than BASEPRI or BASEPRI is 0. 0xF381, 0x8812: by R1."""
    monkeypatch.setenv("P2OS_CORE", "own")
    machine = boot(
        f"movs r0, #{now}\nmsr basepri, r0\nmovs r1, #{value}\n.half 0xF381, 0x8812\nmrs r0, basepri\nlog r0\n"
    ).run(20)
    kept = value & 0xF0
    assert machine.log == [kept if kept and (kept < now or not now) else now]


@pytest.mark.parametrize("base", [FLASH, 0])
def test_code_that_was_cut_and_has_changed_since_is_decoded_anew(
    boot: Boot, monkeypatch: pytest.MonkeyPatch, base: int
) -> None:
    """A run ends inside a block, of which a part is kept; then the flash is another, at both of its addresses."""
    monkeypatch.setenv("P2OS_CORE", "exact")
    machine = boot("movs r3, #0\n" + "adds r3, #1\n" * 8)
    board, flash = machine.board, machine.board.chip.memory.flash
    before = b"\x01\x33"  # adds r3, #1
    for code in (before, b"\x02\x33", b"\x05\x33"):
        board.chip.memory.reprogrammed, before = flash.raw.replace(before * 8, code * 8), code
        board.reset()
        board.chip.engine.jump(machine.label("start") - FLASH + base | 1)
        began_ns = board.now_ns
        for done in range(1, 6):
            board.advance_to(began_ns + (3 + done) * CYCLE_NS)
            assert board.register("R3") == done * code[0], (code, done)


@pytest.mark.parametrize("core", ["own", "exact"])
def test_a_block_that_was_dropped_is_not_gone_to_any_more(
    boot: Boot, monkeypatch: pytest.MonkeyPatch, core: str
) -> None:
    """Two blocks that lead to each other, of which the second becomes another and the first stays."""
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot("movs r3, #0\nmovs r4, #0\nloop: adds r3, #1\nb far\nnop\nfar: adds r4, #1\nb loop\n")
    board, far = machine.board, machine.label("far")
    for change in (1, 2, 5, 1):  # ADDS R4, #change
        ctypes.memmove(ctypes.addressof(board.chip.memory.flash) + far - FLASH, bytes([change, 0x34]), 2)
        board.chip.engine.drop_code(far, 2)
        before = [board.register(name) for name in ("R3", "R4")]
        board.advance_to(board.now_ns + 300 * CYCLE_NS)
        rounds, added = (board.register(name) - was for name, was in zip(("R3", "R4"), before, strict=True))
        assert rounds > 30
        assert abs(added - change * rounds) <= change, change


def test_msr_of_a_stack_pointer_keeps_its_two_lowest_bits_0_by_itself(lockstep: Lockstep) -> None:
    """MSR MSP, R0 and MSR PSP, R0, and back into R1: on the bare core, which no owner helps."""
    for number in (8, 9):
        for bits in range(8):
            case = Case(
                (0xF380_8800 | number, 0xF3EF_8100 | number), (0x2000_0800 + bits, *(0,) * 12, 0x2000_0400, 0), 0
            )
            lockstep.own.put([case])
            assert lockstep.own.run(case, next(places()))[1] == 0x2000_0800 + (bits & 4), (number, bits)


def test_memory_and_io_are_told_apart_while_regions_come_and_go(bare: InterpreterCore) -> None:
    low = ctypes.create_string_buffer(b"\x11" * 0x400, 0x400)
    code = ctypes.create_string_buffer(bytes.fromhex("086800be") + bytes(0x3FC), 0x400)  # ldr r0, [r1]; bkpt
    bare.map_memory(0x0800_0000, code, "rx")
    bare.map_memory(0x2000_0000, low, "rwx")
    reads: list[int] = []
    answers: dict[int, int] = {}

    def read(_uc: int, offset: int, size: int, _user: int) -> int:
        reads.append(offset)
        word = answers.get(offset & ~3, 0x33)
        return word >> 8 * (offset & 3) & (1 << 8 * size) - 1

    bare.map_io(0x4000_0000, 0x400, read, lambda *_: None)
    bare.on_interrupt(lambda _number: bare.stop())

    def loaded(address: int) -> int:
        bare.registers[Reg.R1] = address
        bare.start(0x0800_0001)
        return bare.registers[Reg.R0]

    assert loaded(0x2000_0010) == 0x1111_1111
    assert loaded(0x4000_0010) == 0x33
    # Unaligned: both words are read, and what is wanted is made of them.
    code.raw = bytes.fromhex("086800be").ljust(0x400, b"\0")
    words = {0x20: 0x4433_2211, 0x24: 0x8877_6655}
    answers.update(words)
    for first, instruction in ((0x21, "0868"), (0x22, "0868"), (0x23, "0868"), (0x21, "0888"), (0x23, "0888")):
        code.raw = bytes.fromhex(instruction + "00be").ljust(0x400, b"\0")  # ldr, ldrh r0, [r1]
        bare.drop_all_code()
        size = 4 if instruction == "0868" else 2
        together = words[0x24] << 32 | words[0x20]
        assert loaded(0x4000_0000 + first) == together >> 8 * (first - 0x20) & (1 << 8 * size) - 1, (first, size)
    code.raw = bytes.fromhex("086800be").ljust(0x400, b"\0")
    bare.drop_all_code()
    reads[1:] = []
    bare._unmap(0x4000_0000, 0x400)
    assert loaded(0x2000_0010) == 0x1111_1111
    assert loaded(0x4000_0020) == 0x1111_1111, "nothing is there: the load has not been made"
    heard: list[int] = []

    def hear(_kind: int, address: int, _size: int, _value: int) -> bool:
        heard.append(address)
        return False

    hook = bare.on_bad_access(hear)
    loaded(0x4000_0020)
    bare.remove_hook(hook)
    loaded(0x4000_0020)
    assert heard == [0x4000_0020], "it is asked while it is there"
    assert reads == [0x10]


@pytest.mark.parametrize(("store", "size"), [("0860", 4), ("0880", 2), ("0870", 1)])
@pytest.mark.parametrize("low", range(4))
def test_a_store_to_io_has_its_width_and_an_unaligned_one_is_made_of_bytes(
    bare: InterpreterCore, store: str, size: int, low: int
) -> None:
    code = ctypes.create_string_buffer(bytes.fromhex(store + "00be").ljust(0x400, b"\0"), 0x400)  # [r1] of r0; bkpt
    bare.map_memory(FLASH, code, "rx")
    seen: list[tuple[int, int, int]] = []
    bare.map_io(
        0x4000_0000, 0x400, lambda *_: 0, lambda _uc, offset, width, value, _user: seen.append((offset, width, value))
    )
    bare.on_interrupt(lambda _number: bare.stop())
    bare.registers[Reg.R0], bare.registers[Reg.R1] = 0xF4E3_D2C1, 0x4000_0020 + low
    bare.start(FLASH | 1)
    value = 0xF4E3_D2C1 & (1 << 8 * size) - 1
    if low % size == 0:
        assert seen == [(0x20 + low, size, value)]
    else:
        assert seen == [(0x20 + low + n, 1, value >> 8 * n & 0xFF) for n in range(size)]


#: FLASH_ACR: wait states; a loop whose first block ends in an ISB, its second at the end of a kilobyte of flash.
LOOP = """
mov32 r6, #0x40022000
movs r0, #{waits}
str r0, [r6, #0]
b first
{pad}
first: mov32 r6, #0xE0001000
movs r3, #20
ldr r5, [r6, #4]
b again
again: nop
isb
nop
nop
nop
nop
nop
nop
nop
subs r3, #1
bne again
ldr r0, [r6, #4]
subs r0, r0, r5
log r0
b stop
"""


@pytest.mark.parametrize("waits", [0, 1, 2])
def test_a_block_that_no_branch_ends_costs_what_it_does_on_unicorn(
    boot: Boot, monkeypatch: pytest.MonkeyPatch, waits: int
) -> None:
    logs = {}
    for core in ("own", "exact", "native", "python"):
        monkeypatch.setenv("P2OS_CORE", core)
        pad = "nop\n" * ((0x400 - 0x130 - 0x3A - 20) // 2)
        machine = boot(COUNTER_ON + LOOP.format(waits=waits, pad=pad), {}).run(300)
        assert machine.is_done
        assert machine.label("again") < FLASH + 0x400 < machine.label("stop")
        logs[core] = machine.log
    assert len({tuple(log) for log in logs.values()}) == 1, logs


@pytest.mark.parametrize(
    "target", [0x4000_0000, 0xA000_0000, 0xE000_E000, 0x2000_8000, 0x2000_4FFE, 0x1FFF_F000, 0x0802_0000, 0x6000_0000]
)
def test_a_branch_to_where_nothing_executes_faults_as_on_unicorn(
    boot: Boot, monkeypatch: pytest.MonkeyPatch, target: int
) -> None:
    found = {}
    for core in ("own", "exact", "native"):
        monkeypatch.setenv("P2OS_CORE", core)
        board = boot(f"mov32 r0, #{target | 1}\nbx r0\n").run(20).board
        fault = board.fault
        found[core] = None if fault is None else (fault.kind, fault.pc, fault.address)
    assert found["own"] == found["exact"] == found["native"]
    assert found["own"] is not None


def test_a_state_has_one_context_however_its_flags_came_about(lockstep: Lockstep) -> None:
    """CMP R1, #0 of 5 and of 7, and 0x7FFFFFFF; then R1 is put to the same."""
    seen = set()
    for value in (5, 7, 0x7FFF_FFFF):
        case = Case((0x2900,), (0, value, *(0,) * 11, 0x2000_0400, 0), 0)
        lockstep.own.put([case])
        lockstep.own.run(case, next(places()))
        lockstep.own.core.registers[Reg.R1] = 0
        seen.add(lockstep.own.core.context)
    assert len(seen) == 1


def test_code_in_sram_that_has_run_does_not_run_in_arm_state(boot: Boot, monkeypatch: pytest.MonkeyPatch) -> None:
    """`bx lr` is put there and called twice; the third time bit 0 of its address is 0."""
    monkeypatch.setenv("P2OS_CORE", "own")
    machine = boot(
        "mov32 r5, #0x20000800\nmov32 r0, #0x47704770\nstr r0, [r5, #0]\nmov32 r6, #0x20000801\n"
        "blx r6\nblx r6\nmovs r4, #1\nblx r5\nmovs r4, #2\nb stop\nfault: mov32 r1, #0xE000ED28\n"
        "ldr r0, [r1, #0]\nlog r0\nb stop\n",
        {3: "fault"},
    ).run(30)  # fmt: skip
    assert machine.log == [1 << 17], "INVSTATE"
    assert machine.board.register("R4") == 1


@pytest.mark.parametrize("core", ["own", "exact", "native"])
@pytest.mark.parametrize("before", range(4))
def test_an_it_block_reaches_over_the_end_of_a_kilobyte(
    boot: Boot, monkeypatch: pytest.MonkeyPatch, core: str, before: int
) -> None:
    """ITTTT NE, of which so many stand before the end of a block: none of the four is done, in no round."""
    monkeypatch.setenv("P2OS_CORE", core)
    start = "movs r3, #3\nmovs r4, #0\nb far\n"
    loop = "far: cmp r4, #0\nitttt ne\n" + "adds r4, #1\n" * 4 + "subs r3, #1\nbne far\n"
    pad = (0x400 - 0x130 - 8 - 6 - 4 - 2 * before) // 2
    machine = boot(start + "nop\n" * pad + loop).run(80)
    assert machine.is_done
    assert machine.label("far") + 4 + 2 * before == FLASH + 0x400
    assert machine.board.register("R4") == 0


@pytest.mark.parametrize("core", ["own", "exact", "native"])
@pytest.mark.parametrize("hint", ["yield", "wfe", "wfi"])
def test_an_it_block_goes_on_behind_a_hint(boot: Boot, monkeypatch: pytest.MonkeyPatch, core: str, hint: str) -> None:
    """ITE EQ: the hint is done, and the addition behind it is not; SysTick wakes WFI, and WFE has its event."""
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot(
        "mov32 r1, #0xE000E010\nmovs r2, #90\nstr r2, [r1, #4]\nmovs r2, #7\nstr r2, [r1, #0]\n"
        f"movs r4, #0\nsev\ncmp r4, #0\nite eq\n{hint}\nadds r4, #1\nadds r4, #4\nlast: b stop\n"
        "tick: movs r0, #0\nstr r0, [r1, #0]\nbx lr\n",
        {15: "tick"},
    ).run(60)  # fmt: skip
    assert machine.is_done
    assert machine.board.register("R4") == 4


@pytest.mark.parametrize("core", ["own", "exact", "native"])
def test_mrs_reads_the_parts_of_the_xpsr_in_a_handler(boot: Boot, monkeypatch: pytest.MonkeyPatch, core: str) -> None:
    """APSR, IAPSR, EAPSR, XPSR, IPSR, EPSR, IEPSR (ARM B5.2.2): flags where bit 2 is 0, IPSR where bit 0 is 1."""
    monkeypatch.setenv("P2OS_CORE", core)
    numbers = (0, 1, 2, 3, 5, 6, 7)
    reads = "".join(f".half 0xF3EF, {0x8000 | number:#x}\nstr r0, [r7, #{4 * n}]\n" for n, number in enumerate(numbers))
    machine = boot(f"movs r0, #0\nsvc #0\nb stop\ncall: cmp r0, #0\n{reads}adds r7, #28\nbx lr\n", {11: "call"}).run(20)
    flags, number = 0x6000_0000, 11
    assert machine.log == [flags, flags | number, flags, flags | number, number, 0, number]


@pytest.mark.parametrize("last", [1, 2, 3])
def test_an_access_that_a_hook_ends_the_run_at_is_not_made(bare: InterpreterCore, last: int) -> None:
    """LDREX R0, [R1], and STREX R2, R3, [R1], which reads and writes: the run ends at one of the three accesses."""
    code = ctypes.create_string_buffer(bytes.fromhex("51e8000f41e8003200be").ljust(0x400, b"\0"), 0x400)
    memory = ctypes.create_string_buffer(b"\x11" * 0x400, 0x400)
    bare.map_memory(FLASH, code, "rx")
    bare.map_memory(0x2000_0000, memory, "rwx")
    seen: list[int] = []

    def look(_kind: int, address: int, _size: int, _value: int) -> bool:
        seen.append(address)
        if len(seen) == last:
            bare.stop()
        return True

    bare.on_access(0x2000_0000, 0x2000_03FF, look)
    bare.on_interrupt(lambda _number: bare.stop())
    for name, value in ((Reg.R0, 5), (Reg.R1, 0x2000_0010), (Reg.R2, 7), (Reg.R3, 9)):
        bare.registers[name] = value
    bare.start(FLASH | 1)
    assert len(seen) == last
    assert bare.registers[Reg.PC] == FLASH + (0 if last == 1 else 4)
    assert bare.registers[Reg.R0] == (5 if last == 1 else 0x1111_1111)
    assert bare.registers[Reg.R2] == 7
    assert memory.raw == b"\x11" * 0x400


def test_a_new_core_is_in_thumb_state_without_flags(bare: InterpreterCore) -> None:
    assert bare.registers[Reg.XPSR] == 1 << 24
    assert bare.registers[Reg.CPSR] == 1 << 5
    assert [bare.registers[name] for name in (Reg.R0, Reg.SP, Reg.PC, Reg.CONTROL, Reg.PRIMASK)] == [0] * 5


@pytest.mark.parametrize(("code", "error"), [("00de", 21), ("00df", 21), ("00be", 21), ("0868", 6), ("0860", 7)])
def test_what_nobody_hears_of_ends_the_run(bare: InterpreterCore, code: str, error: int) -> None:
    """UDF, SVC, BKPT, and a load and a store where nothing is, without a hook: Unicorn's errors."""
    flash = ctypes.create_string_buffer(bytes.fromhex(code).ljust(0x400, b"\0"), 0x400)
    bare.map_memory(FLASH, flash, "rx")
    bare.registers[Reg.R1] = 0x2000_0000
    assert bare.start(FLASH | 1) == error
    assert bare.registers[Reg.PC] == FLASH + (2 if code == "00df" else 0)


@pytest.mark.parametrize("core", ["own", "exact", "native"])
@pytest.mark.parametrize("value", range(4))
def test_a_handler_writes_npriv_and_not_spsel(
    boot: Boot, monkeypatch: pytest.MonkeyPatch, core: str, value: int
) -> None:
    """ARM B1.4.4: SPSEL is written in thread mode alone."""
    monkeypatch.setenv("P2OS_CORE", core)
    source = f"svc #0\nmrs r0, control\nlog r0\nb stop\ncall: movs r0, #{value}\nmsr control, r0\nbx lr\n"
    assert boot(source, {11: "call"}).run(20).log == [value & 1]


def test_what_has_run_in_thumb_state_is_undefined_in_arm_state(bare: InterpreterCore) -> None:
    """A BKPT in writable memory: heard each time with the Thumb bit, and undefined without it, on the bare core."""
    memory = ctypes.create_string_buffer(bytes.fromhex("00be").ljust(0x400, b"\0"), 0x400)
    bare.map_memory(0x2000_0000, memory, "rwx")
    heard: list[int] = []

    def hear(number: int) -> None:
        heard.append(number)
        bare.stop()

    bare.on_interrupt(hear)
    assert [bare.start(0x2000_0000 | thumb) for thumb in (1, 1, 0, 1, 0)] == [0, 0, 21, 0, 21]
    assert heard == [7, 7, 7]
