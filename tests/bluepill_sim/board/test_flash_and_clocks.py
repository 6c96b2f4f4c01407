"""What the flash at work, the option bytes and a crystal that fails do to a program; on both cores."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from bluepill_sim.fabric.low_power import PowerMode
from bluepill_sim.peripherals.flash import DELIVERED, MASS_ERASE_NS, PAGE_ERASE_NS, PROGRAM_NS
from bluepill_sim.peripherals.rcc import ResetCause

FLASH, RCC, EXTI = 0x4002_2000, 0x4002_1000, 0x4001_0400
KEYR, OPTKEYR, SR, CR, AR = (FLASH + offset for offset in (4, 8, 0xC, 0x10, 0x14))
KEYS = (0x4567_0123, 0xCDEF_89AB)
PG, PER, OPTPG, OPTER, STRT, OPTWRE = 1, 2, 1 << 4, 1 << 5, 1 << 6, 1 << 9
SCR, ISER0, OPTIONS = 0xE000_ED10, 0xE000_E100, 0x1FFF_F800
CYCLE_NS, SRAM_CODE = 125, 0x2000_1000


def store(address: int, value: int, size: str = "") -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr{size} r2, [r1, #0]\n"


UNLOCK = "".join(store(KEYR, key) for key in KEYS)
UNLOCK_OPTIONS = UNLOCK + "".join(store(OPTKEYR, key) for key in KEYS)
COUNTER = store(0xE000_EDFC, 1 << 24) + store(0xE000_1000, 1) + "mov32 r3, #0xE0001000\n"
#: Line 4 from PA4, with its interrupt.
LINE_4 = store(RCC + 0x18, 0x5) + store(EXTI + 8, 1 << 4) + store(EXTI, 1 << 4) + store(ISER0, 1 << 10)
HANDLER = "irq: mov32 r1, #0x40010414\nmovs r2, #16\nstr r2, [r1, #0]\nldr r0, [r3, #4]\nlog r0\nbx lr"
VECTORS: dict[int, str | int] = {16 + 10: "irq"}


@pytest.fixture(params=["native", "python"])
def make(request: pytest.FixtureRequest, boot: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("P2OS_CORE", request.param)
    return boot


def since_start(machine: Any) -> int:
    """The cycle at which CYCCNT was 0."""
    cycle: int = machine.board.cycle - machine.board.chip.system.read(0x1004, 4)
    return cycle


def test_code_in_flash_waits_until_the_flash_is_done(make: Any) -> None:
    """The load of CYCCNT is in the block that programs, and comes after the end."""
    machine = make(
        COUNTER + UNLOCK + store(CR, PG)
        + "mov32 r1, #0x08010000\nmovs r2, #5\nldr r4, [r3, #4]\nstrh r2, [r1, #0]\nldr r5, [r3, #4]\n"
        "subs r0, r5, r4\nlog r0\nldrh r0, [r1, #0]\nlog r0\nb stop"
    ).run(200)  # fmt: skip
    cycles, word = machine.log
    assert word == 5
    assert PROGRAM_NS // CYCLE_NS <= cycles <= PROGRAM_NS // CYCLE_NS + 10
    assert machine.board.warnings == []


@pytest.mark.parametrize(("offset", "seen"), [(-2, [1, 2, 3]), (0, [0, 2, 3]), (4, [1, 2, 0]), (6, [1, 2, 3])])
def test_code_that_was_programmed_runs_as_it_is_now(make: Any, offset: int, seen: list[int]) -> None:
    """0 may be programmed over anything, and moves R0 to itself; before and behind the block stand such words too."""
    machine = make(
        UNLOCK + store(CR, PG)
        + "bl first\nmovs r4, #0\nmovs r5, #0\nmovs r6, #0\n"
        + f"mov32 r1, #first\n{'adds' if offset >= 0 else 'subs'} r1, #{abs(offset)}\nmovs r2, #0\nstrh r2, [r1, #0]\n"
        "bl first\nmov r0, r4\nlog r0\nmov r0, r5\nlog r0\nmov r0, r6\nlog r0\nb stop\n.half 0xBF00\n"
        "first: movs r4, #1\nmovs r5, #2\nmovs r6, #3\nb behind\nbehind: bx lr\n.half 0xBF00"
    ).run(300)  # fmt: skip
    assert machine.log == seen


@pytest.mark.parametrize(("offset", "saved"), [(-2, 0), (0, 1), (2, 0), (4, 1)])
def test_code_that_was_programmed_costs_what_it_costs_now(make: Any, offset: int, saved: int) -> None:
    """A load of two cycles, at the start or at the end of its block, becomes an instruction of one."""
    call = "ldr r4, [r3, #4]\nbl first\nldr r5, [r3, #4]\nsubs r0, r5, r4\nlog r0\n"
    program = (
        f"mov32 r1, #first\n{'adds' if offset >= 0 else 'subs'} r1, #{abs(offset)}\nmovs r2, #0\nstrh r2, [r1, #0]\n"
    )
    before, after = make(
        COUNTER + UNLOCK + store(CR, PG) + call + program + call + "b stop\n.half 0xBF00\n"
        "first: ldr r6, [r3, #4]\nnop\nldr r6, [r3, #4]\nb behind\nbehind: bx lr\n"
    ).run(300).log  # fmt: skip
    assert before - after == saved


def test_a_wait_inside_a_block_outlasts_systick_and_the_ends_of_slices(make: Any) -> None:
    text = store(0xE000_E014, 99) + store(0xE000_E010, 7) + UNLOCK + store(CR, 1)
    text += "mov32 r1, #0x0800F000\nmovs r2, #0\n" + "strh r2, [r1, #0]\nadds r1, #2\n" * 4
    machine = make(text + "log #1\nend: b end\n" + "tick: bx lr", {15: "tick"})
    for _ in range(50):
        machine.board.run_for("10 us")
    assert machine.log == [1]


def test_an_interrupt_waits_for_the_end_of_an_erase(make: Any) -> None:
    machine = make(
        COUNTER + LINE_4 + UNLOCK + store(CR, PER) + store(AR, 0x0801_0000) + store(CR, PER | STRT)
        + f"loop: b loop\n{HANDLER}", VECTORS,
    ).run(100)  # fmt: skip
    board = machine.board
    due_ns = board.chip.parts.flash.due_ns
    assert due_ns is not None
    board.pin("PA4").drive(True)
    board.advance_to(due_ns - 2 * CYCLE_NS)
    assert machine.log == []
    assert board.chip.parts.flash.is_busy
    board.advance_to(due_ns + 100 * CYCLE_NS)
    [cycle] = machine.log
    assert 12 <= cycle + since_start(machine) - due_ns // CYCLE_NS <= 40
    assert due_ns >= PAGE_ERASE_NS


SRAM_PROGRAM = """
mov32 r1, #0x08010000
movs r2, #5
strh r2, [r1, #0]
mov32 r1, #0x4002200C
movs r4, #0
wait: adds r4, #1
ldr r2, [r1, #0]
movs r5, #1
subs r5, r2, r5
beq wait
bx lr
"""


def with_sram(make: Any, assemble: Any, more: str = "", vectors: dict[int, str | int] | None = None) -> Any:
    """A machine whose program programs a halfword from code in SRAM, and logs how often that has polled."""
    machine = make(
        COUNTER + LINE_4 + UNLOCK + store(CR, PG) + f"mov32 r6, #{SRAM_CODE + 1}\nblx r6\nmov r0, r4\nlog r0\nb stop\n"
        + more, vectors or {},
    )  # fmt: skip
    machine.board.chip.memory.write(SRAM_CODE, assemble(SRAM_PROGRAM, SRAM_CODE).code)
    return machine


def test_code_in_sram_goes_on_while_the_flash_works(make: Any, assemble: Any) -> None:
    machine = with_sram(make, assemble).run(200)
    [polls] = machine.log
    assert 30 < polls < PROGRAM_NS // CYCLE_NS // 5  # 8 cycles or so a round


def test_a_handler_in_flash_waits_while_code_in_sram_polls(make: Any, assemble: Any) -> None:
    machine = with_sram(make, assemble, HANDLER, VECTORS)
    board = machine.board
    while not board.chip.parts.flash.is_busy:
        machine.run(1)
    due_ns = board.chip.parts.flash.due_ns
    machine.run(10)
    assert board.pc >= SRAM_CODE
    board.pin("PA4").drive(True)
    board.advance_to(due_ns - 2 * CYCLE_NS)
    assert machine.log == []
    machine.run(50)
    cycle, polls = machine.log
    assert 0 < cycle + since_start(machine) - due_ns // CYCLE_NS <= 40
    assert polls < 30


@pytest.mark.parametrize("slice_us", [None, 0.9])
def test_slices_and_a_snapshot_change_nothing_of_it(make: Any, assemble: Any, slice_us: float | None) -> None:
    machine = with_sram(make, assemble, HANDLER, VECTORS)
    machine.run(40, slice_us)
    saved = machine.board.snapshot()
    board = machine.board

    def future() -> tuple[Any, ...]:
        board.pin("PA4").drive(True)
        machine.run(100, slice_us)
        return machine.log, machine.is_done, board.read_memory(0x0801_0000, 2)

    first = future()
    board.pin("PA4").drive(False)
    board.restore(saved)
    assert future() == first
    assert first[1:] == (True, b"\x05\0")
    assert first[0] == with_sram_log(make, assemble)


def with_sram_log(make: Any, assemble: Any) -> list[int]:
    """What the same program logs in one piece."""
    machine = with_sram(make, assemble, HANDLER, VECTORS).run(40)
    machine.board.pin("PA4").drive(True)
    return list(machine.run(100).log)


def write_options(*values: tuple[int, int]) -> str:
    """Erase the option bytes, and program some, by offset."""
    text = UNLOCK_OPTIONS + store(CR, OPTER | OPTWRE) + store(CR, OPTER | OPTWRE | STRT) + store(CR, OPTPG | OPTWRE)
    return text + "".join(store(OPTIONS + offset, value, "h") for offset, value in values)


def test_a_program_writes_its_option_bytes_and_a_reset_loads_them(make: Any) -> None:
    """RDP, USER with IWDG by hardware, a byte of data; the erase takes one page's time."""
    machine = make(write_options((0, 0xA5), (2, 0xFE), (4, 0x42)) + "b stop")
    board = machine.board
    saved = board.snapshot()
    assert board.read_memory(OPTIONS, 16) == DELIVERED
    machine.run(PAGE_ERASE_NS / 1000 + 60_000)
    assert machine.is_done
    assert board.read_memory(OPTIONS, 8) == b"\xa5\x5a\xfe\x01\x42\xbd\xff\xff"
    assert not board.chip.parts.has_running_watchdog
    board.reset()
    obr = board.chip.parts.flash.read(0x1C, 4)
    assert (obr & 3, obr >> 2 & 0xFF, obr >> 10 & 0xFF) == (0, 0xFE, 0x42)
    assert board.chip.parts.has_running_watchdog
    board.restore(saved)
    assert board.read_memory(OPTIONS, 16) == DELIVERED


def test_unprotecting_takes_the_program_with_it(make: Any) -> None:
    machine = make(write_options() + "b stop").run(PAGE_ERASE_NS / 1000 + 100)
    board = machine.board
    board.reset()
    assert board.chip.parts.flash.read(0x1C, 4) & 2
    machine.run(PAGE_ERASE_NS / 1000 + 100)  # the erased bytes are erased again
    for key in KEYS:
        board.chip.parts.flash.write(4, 4, key)
    for key in KEYS:
        board.chip.parts.flash.write(8, 4, key)
    board.chip.parts.flash.write(0x10, 4, OPTPG | OPTWRE)
    board.chip.parts.flash.program_option(0, 2, 0xA5)
    assert board.read_memory(0x0800_0000, 64) == b"\xff" * 64
    machine.run((PROGRAM_NS + MASS_ERASE_NS) / 1000 + 10)
    assert board.fault is not None  # what runs next is erased flash


@pytest.mark.parametrize(("bit", "control"), [(2, 0), (4, 2)])
def test_the_option_bytes_make_a_reset_of_stop_or_standby(make: Any, bit: int, control: int) -> None:
    machine = make(
        store(RCC + 0x1C, 0x1000_0000) + store(0x4000_7000, control) + store(SCR, 4) + "nop\n" * 100 + "wfi\nb stop"
    )
    board = machine.board
    user = 0xFF & ~bit
    board.chip.memory.options = DELIVERED[:2] + bytes((user, user ^ 0xFF)) + DELIVERED[4:]
    board.reset()
    board.resets.clear()
    machine.run(20)
    assert dict(board.resets) == {ResetCause.LOW_POWER: 1}
    assert board.chip.parts.rcc.read(0x24, 4) >> 31 == 1
    assert board.chip.low_power.mode in {PowerMode.RUN, PowerMode.ENTERING}  # the next round


NMI_PROGRAM = (
    store(RCC, 1 << 19 | 1 << 16 | 0x81) + "mov32 r5, #0xB0083\nwait: ldr r2, [r1, #0]\nsubs r2, r2, r5\nbne wait\n"
    + store(RCC + 4, 1) + "idle: b idle\n"
)  # fmt: skip
CLEAR = "mov32 r1, #0x40021008\nmov32 r2, #0x800000\nstr r2, [r1, #0]\n"


def test_a_crystal_that_fails_is_an_nmi_and_the_program_goes_on_at_hsi(make: Any) -> None:
    machine = make(NMI_PROGRAM + "nmi: log #1\n" + CLEAR + "bx lr", {2: "nmi"}).run(3000)
    board = machine.board
    assert board.chip.parts.rcc.read(4, 4) & 0xC == 4
    board.crystal_works = False
    machine.run(100)
    assert machine.log == [1]
    assert board.chip.parts.rcc.read(4, 4) & 0xC == 0
    assert board.hclk_hz == 8_000_000


def test_nmi_comes_again_until_cssc_is_written(make: Any) -> None:
    machine = make(
        NMI_PROGRAM + "nmi: log #1\nadds r6, #1\ncmp r6, #3\nbne out\n" + CLEAR + "out: bx lr", {2: "nmi"}
    ).run(3000)
    machine.board.crystal_works = False
    assert machine.run(1000).log == [1, 1, 1]


def test_without_css_the_core_stands_until_a_reset_and_iwdg_brings_one(make: Any) -> None:
    machine = make(
        store(0x4000_3000, 0xCCCC) + store(RCC, 1 << 16 | 0x81) + "mov32 r5, #0x30083\nwait: ldr r2, [r1, #0]\n"
        "subs r2, r2, r5\nbne wait\n" + store(RCC + 4, 1) + "idle: log #1\nb idle"
    ).run(2100)  # fmt: skip
    board = machine.board
    logged = len(machine.log)
    assert logged
    board.crystal_works = False
    machine.run(1000)
    assert len(machine.log) == logged
    assert board.chip.low_power.mode is PowerMode.UNCLOCKED
    board.crystal_works = True
    board.advance_to(420_000_000)
    assert dict(board.resets) == {ResetCause.IWDG: 1}
    assert board.chip.low_power.mode is PowerMode.RUN


def test_a_net_sees_the_edges_of_mco(make: Any) -> None:
    machine = make(store(RCC + 0x18, 4) + store(0x4001_0804, 0x4444_444B) + store(RCC + 4, 4 << 24) + "b stop").run(50)
    wave = machine.board.pin("PA8").wave
    assert (wave.frequency_hz, wave.duty) == (8_000_000, 0.5)
    edges = [ns for name, _, ns in machine.edges if name == "PA8"][2:]
    assert len(edges) > 100
    assert {later - ns for ns, later in pairwise(edges)} <= {62, 63}
