"""Stop and Standby by programs: what stands still, who ends it, and when; on both cores."""

from collections.abc import Callable
from typing import Any

import pytest

from bluepill_sim import BluePill
from bluepill_sim.fabric.low_power import PowerMode
from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.peripherals.rcc import ResetCause
from tests.bluepill_sim.machine import Machine

S, US = 1_000_000_000, 1000
#: HSI: one cycle in ns, and the entry of a handler.
CYCLE_NS, ENTRY_NS = 125, 12 * 125
SCR, ISER0, SYSTICK = 0xE000_ED10, 0xE000_E100, 0xE000_E010
RCC, PWR, EXTI, BKP, IWDG = 0x4002_1000, 0x4000_7000, 0x4001_0400, 0x4000_6C00, 0x4000_3000
SLEEPONEXIT, SLEEPDEEP = 2, 4
LPDS, PDDS, CWUF, CSBF, DBP, EWUP, WUF, SBF = 1, 2, 4, 8, 1 << 8, 1 << 8, 1, 2


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


#: PWR, BKP and AFIO have clocks; line 4 from PA4, with its interrupt.
CLOCKS = store(RCC + 0x1C, 0x1800_0000) + store(RCC + 0x18, 0x5)
LINE_4 = store(EXTI + 8, 1 << 4) + store(EXTI, 1 << 4) + store(ISER0, 1 << 10)
DEEP = store(SCR, SLEEPDEEP)
HANDLER = "irq: mov32 r1, #0x40010414\nmovs r2, #16\nstr r2, [r1, #0]\nlog #1\nbx lr"
VECTORS: dict[int, str | int] = {16 + 10: "irq"}


@pytest.fixture(params=["native", "python"])
def make(request: pytest.FixtureRequest, boot: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("P2OS_CORE", request.param)
    return boot


def mode(machine: Any) -> PowerMode:
    found: PowerMode = machine.board.chip.low_power.mode
    return found


@pytest.mark.parametrize(("control", "wake_ns"), [(0, 3_600), (LPDS, 5_400)])
def test_an_edge_on_a_line_of_exti_ends_stop_after_its_time(make: Any, control: int, wake_ns: int) -> None:
    machine = make(CLOCKS + LINE_4 + store(PWR, control) + DEEP + f"wfi\nlog #2\nb stop\n{HANDLER}", VECTORS).run(500)
    board = machine.board
    assert (mode(machine), board.is_asleep) == (PowerMode.STOP, True)
    at = board.now_ns
    board.pin("PA4").drive(True)
    end_ns = at - (-wake_ns // CYCLE_NS) * CYCLE_NS
    board.advance_to(end_ns - 1)
    assert (mode(machine), machine.log) == (PowerMode.WAKING, [])
    board.advance_to(end_ns + 1)
    assert board.now_ns == end_ns + ENTRY_NS
    machine.run(50)
    assert machine.log == [1, 2]
    assert board.warnings == []


def test_after_stop_the_chip_runs_from_hsi(make: Any) -> None:
    to_hse = store(RCC, 1 << 16 | 0x81)
    wait = "mov32 r5, #0x30083\nwait: ldr r2, [r1, #0]\nsubs r2, r2, r5\nbne wait\n"
    machine = make(CLOCKS + LINE_4 + to_hse + wait + store(RCC + 4, 1) + DEEP + f"wfi\nb stop\n{HANDLER}", VECTORS).run(
        5000
    )
    chip = machine.board.chip
    assert mode(machine) is PowerMode.STOP
    machine.board.pin("PA4").drive(True)
    machine.run(100)
    assert machine.is_done
    assert chip.parts.rcc.read(0, 4) & 0x0303_0003 == 3
    assert chip.parts.rcc.read(4, 4) & 0xF == 0


def test_wfe_is_ended_by_an_event_of_exti(make: Any) -> None:
    machine = make(CLOCKS + store(EXTI + 8, 1 << 4) + store(EXTI + 4, 1 << 4) + DEEP + "wfe\nlog #1\nb stop").run(500)
    assert mode(machine) is PowerMode.STOP
    machine.board.pin("PA4").drive(True)
    assert machine.run(3).log == []
    assert machine.run(10).log == [1]


def test_an_event_that_is_there_lets_wfe_go_on_without_stop(make: Any) -> None:
    assert make(DEEP + "sev\nwfe\nlog #1\nb stop").run(50).log == [1]


def test_only_lines_of_exti_end_stop(make: Any) -> None:
    """USART2's interrupt, enabled, waits until line 4 comes, and is served then."""
    machine = make(
        CLOCKS + LINE_4 + store(ISER0 + 4, 1 << 6) + DEEP
        + f"wfi\nb stop\nusart: log #3\nmov32 r1, #0xE000E184\nmovs r2, #64\nstr r2, [r1, #0]\nbx lr\n{HANDLER}",
        {**VECTORS, 16 + 38: "usart"},
    ).run(500)  # fmt: skip
    machine.board.chip.fabric.set_line(38, True)
    machine.run(10_000)
    assert (mode(machine), machine.log) == (PowerMode.STOP, [])
    machine.board.pin("PA4").drive(True)
    assert machine.run(100).log == [1, 3]


def test_primask_holds_back_the_handler_and_not_the_end_of_stop(make: Any) -> None:
    machine = make(
        CLOCKS + LINE_4 + DEEP + f"cpsid i\nwfi\nlog #2\ncpsie i\nisb\nlog #3\nb stop\n{HANDLER}", VECTORS
    ).run(500)
    assert mode(machine) is PowerMode.STOP
    machine.board.pin("PA4").drive(True)
    assert machine.run(100).log == [2, 1, 3]


def test_systick_and_cyccnt_stand_still_in_stop(make: Any) -> None:
    counters = "mov32 r1, #0xE000E010\nldr r4, [r1, #8]\nmov32 r3, #0xE0001000\nldr r5, [r3, #4]\n"
    counter_on = store(0xE000_EDFC, 1 << 24) + store(0xE000_1000, 1)
    machine = make(
        counter_on + CLOCKS + LINE_4 + store(SYSTICK + 4, 999_999) + store(SYSTICK + 8, 0) + store(SYSTICK, 5) + DEEP
        + counters + "wfi\nmov r6, r4\nmov r2, r5\n" + counters + "subs r0, r6, r4\nlog r0\nsubs r0, r5, r2\nlog r0\n"
        + f"b stop\n{HANDLER.replace('log #1', '')}", VECTORS,
    ).run(500)  # fmt: skip
    machine.board.run_for("3 s")
    assert mode(machine) is PowerMode.STOP
    machine.board.pin("PA4").drive(True)
    machine.run(100)
    ticks, cycles = machine.log
    assert ticks == cycles
    assert 30 < cycles < 80  # the handler and what is around it


def test_a_character_on_its_way_waits_for_the_end_of_stop(make: Any) -> None:
    usart = store(0x4001_3808, 69) + store(0x4001_380C, 0x200C) + store(0x4001_3804, 0x41)
    machine = make(
        store(RCC + 0x1C, 0x1800_0000) + store(RCC + 0x18, 0x4005) + store(0x4001_0804, 0x4444_44B4) + LINE_4 + usart
        + DEEP + f"wfi\nb stop\n{HANDLER}", VECTORS,
    ).run(5000)  # fmt: skip
    board = machine.board
    assert mode(machine) is PowerMode.STOP
    board.usart1.receive(b"x")
    machine.run(5000)
    assert bytes(machine.sent) == b""
    assert any("receiver" in text for text in board.warnings)
    board.pin("PA4").drive(True)
    machine.run(300)  # an idle character and the A: 20 bits at 115 942 bit/s are 173 us
    assert bytes(machine.sent) == b"A"


def test_the_window_watchdog_waits_in_stop_and_the_independent_one_does_not(make: Any) -> None:
    window = store(RCC + 0x1C, 0x1800_0800) + store(0x4000_2C00, 0xFF)
    machine = make(window + store(IWDG, 0xCCCC) + DEEP + "wfi\nb stop").run(1000)
    board = machine.board
    cr = board.chip.parts.by_name["WWDG"].words[0]
    assert mode(machine) is PowerMode.STOP
    board.advance_to(409_600_000 - 1000)
    assert (dict(board.resets), cr & 0x80) == ({}, 0x80)
    board.advance_to(409_600_000 + 10_000)
    assert dict(board.resets) == {ResetCause.IWDG: 1}


def test_sleep_on_exit_stops_too(make: Any) -> None:
    machine = make(
        CLOCKS + LINE_4 + store(SCR, SLEEPDEEP | SLEEPONEXIT) + f"wfi\nlog #9\nb stop\n{HANDLER}", VECTORS
    ).run(500)
    for count in (1, 2):
        machine.board.pin("PA4").drive(True)
        machine.run(100)
        assert (mode(machine), machine.log) == (PowerMode.STOP, [1] * count)
        machine.board.pin("PA4").drive(False)


def test_a_pending_line_keeps_the_chip_out_of_stop(make: Any) -> None:
    machine = make(CLOCKS + store(EXTI, 1 << 5) + store(EXTI + 0x10, 1 << 5) + DEEP + "wfi\nlog #1\nb stop").run(50)
    assert machine.log == [1]
    assert any("Stop does not begin: EXTI_PR is 0x20" in text for text in machine.board.warnings)


def rtc_of(machine: Any) -> Any:
    """Have the RTC run from the crystal, as if a program had done so, with a second of 10 cycles."""
    chip = machine.board.chip
    chip.power.is_backup_open = True
    chip.parts.rcc.write(0x20, 4, 1 << 15 | 1 << 8 | 1)
    machine.board.run_for("1501 ms")
    rtc = chip.parts.by_name["RTC"]
    for offset, value in ((4, 16), (0x0C, 9), (0x20, 0), (0x24, 100), (4, 0)):
        rtc.write(offset, 4, value)
    machine.board.run_for("1 ms")
    return rtc


def test_the_rtc_goes_on_in_stop_and_its_alarm_ends_it(make: Any) -> None:
    """From cycle 0x8000 on a second is 10 cycles; the alarm is in the last cycle of second 100."""
    line = store(EXTI + 8, 1 << 17) + store(EXTI, 1 << 17) + store(ISER0 + 4, 1 << 9)
    machine = make(
        CLOCKS + line + DEEP + "go: b go\nwfi\nlog #2\nb stop\nalarm: mov32 r1, #0x40010414\nmov32 r2, #0x20000\n"
        "str r2, [r1, #0]\nlog #1\nbx lr", {16 + 41: "alarm"},
    ).run(100)  # fmt: skip
    rtc = rtc_of(machine)
    board = machine.board
    board.chip.engine.jump(machine.label("go") + 2 | 1)
    machine.run(10)
    assert mode(machine) is PowerMode.STOP
    due_ns = rtc._origin_ns - (-(0x8000 + 1000) * S // 32_768)
    board.advance_to(due_ns - 1)
    assert (mode(machine), machine.log) == (PowerMode.STOP, [])
    board.advance_to(due_ns + 20 * US)
    machine.run(50)
    assert machine.log == [1, 2]


def standing_by(make: Any, more: str = "", control: int = PDDS | CWUF) -> Any:
    """Return a board in Standby, whose program logs PWR_CSR, a word of SRAM and RCC_CSR, and ends when it is woken."""
    program = (
        CLOCKS + "mov32 r3, #0x40007000\nldr r0, [r3, #4]\nlog r0\nmov32 r4, #0x20000800\nldr r0, [r4, #0]\nlog r0\n"
        "movs r2, #77\nstr r2, [r4, #0]\nmov32 r5, #0x40021024\nldr r0, [r5, #0]\nlog r0\n"
        "ldr r0, [r3, #4]\nmovs r5, #2\nsubs r0, r0, r5\nbeq woken\nsubs r0, #1\nbeq woken\n"
        "b first\nwoken: b stop\nfirst: " + more + store(PWR, control) + DEEP + "wfi\nlog #9\nb stop"
    )
    machine = make(program)
    machine.run(500)
    assert mode(machine) is PowerMode.STANDBY
    assert machine.board.is_asleep
    return machine


def logged(machine: Any) -> list[int]:
    words = machine.board.read_memory(0x2000_0100, 12)
    return [int.from_bytes(words[n : n + 4], "little") for n in (0, 4, 8)]


ALL_FLAGS = 0xFC00_0000


def test_standby_loses_sram_and_floats_the_pins(make: Any) -> None:
    output = store(0x4001_0800, 0x4444_4434) + store(0x4001_0810, 2)
    machine = standing_by(make, store(RCC + 0x18, 0x5) + output)
    board = machine.board
    assert board.read_memory(0x2000_0000, 0x5000) == bytes(0x5000)
    assert board.pin("PA1").output is PinDrive.NONE
    assert board.hclk_hz == 8_000_000


def test_the_wake_up_pin_ends_standby_with_a_reset_after_its_time(make: Any) -> None:
    machine = standing_by(make, store(PWR + 4, EWUP))
    board = machine.board
    assert board.pin("PA0").output is PinDrive.PULL_DOWN
    at = board.now_ns
    board.pin("PA0").drive(True)
    board.advance_to(at + 50_000 - 1)  # DS5319 table 20
    assert mode(machine) is PowerMode.WAKING
    board.advance_to(at + 50_000 + 1)
    assert mode(machine) is PowerMode.RUN
    machine.run(100)
    assert machine.is_done
    flags, sram, csr = logged(machine)
    assert (flags, sram, csr & ALL_FLAGS) == (WUF | SBF, 0, 0x0C00_0000)
    assert dict(board.resets) == {ResetCause.STANDBY: 1}


def test_another_board_that_takes_over_standby_hears_the_pin(make: Any) -> None:
    machine = standing_by(make, store(PWR + 4, EWUP))
    saved = machine.board.snapshot()
    other = Machine.__new__(Machine)
    other.board = BluePill(machine.image)
    other.board.restore(saved)
    other.board.pin("PA0").drive(True)
    other.board.run_for("1 us")
    assert mode(other) is PowerMode.WAKING


def test_without_ewup_the_pin_does_nothing(make: Any) -> None:
    machine = standing_by(make)
    machine.board.pin("PA0").drive(True)
    machine.run(10_000)
    assert mode(machine) is PowerMode.STANDBY


@pytest.mark.parametrize("cause", [ResetCause.PIN, ResetCause.IWDG])
def test_nrst_and_iwdg_end_standby_and_say_so(make: Any, cause: ResetCause) -> None:
    watchdog = store(IWDG, 0xCCCC) if cause is ResetCause.IWDG else ""
    machine = standing_by(make, watchdog)
    board = machine.board
    if cause is ResetCause.PIN:
        board.reset()
    else:
        board.advance_to(409_600_000)
        assert mode(machine) is PowerMode.STANDBY
        machine.run(100)
    machine.run(100)
    flags, sram, csr = logged(machine)
    assert (flags, sram) == (SBF, 0)
    assert csr & ALL_FLAGS & ~0x0C00_0000 == cause.value & ~0x0C00_0000
    assert dict(board.resets) == {cause: 1}


def test_the_alarm_ends_standby_and_the_backup_domain_has_outlived_it(make: Any) -> None:
    machine = make("b stop").run(10)
    rtc = rtc_of(machine)
    board = machine.board
    chip = board.chip
    bkp = chip.parts.by_name["BKP"]
    bkp.write(4, 4, 0xBEEF)
    chip.parts.pwr.write(0, 4, PDDS | DBP)
    chip.processor.scr = SLEEPDEEP
    chip.engine.jump(machine.label("start") | 1)
    board.chip.memory.load_flash(machine.label("start") - 0x0800_0000, b"\x30\xbf\xfe\xe7")  # wfi, b .
    chip._drop_flash()
    machine.run(10)
    assert mode(machine) is PowerMode.STANDBY
    due_ns = rtc._origin_ns - (-(0x8000 + 1000) * S // 32_768)
    board.advance_to(due_ns - CYCLE_NS)
    assert mode(machine) is PowerMode.STANDBY
    board.advance_to(due_ns + 1)
    assert mode(machine) is PowerMode.WAKING
    machine.run(100)
    assert chip.parts.pwr.read(4, 4) == WUF | SBF
    assert bkp.read(4, 4) == 0xBEEF
    assert rtc.read(0x1C, 4) == 101


def test_a_wake_up_flag_that_is_set_keeps_the_chip_out_of_standby(make: Any) -> None:
    machine = make(CLOCKS + store(PWR + 4, EWUP) + "nop\n" * 200 + store(PWR, PDDS) + DEEP + "wfi\nlog #9\nb stop")
    machine.board.pin("PA0").drive(True)
    machine.run(500)
    assert machine.log == [9]
    assert any("Standby does not begin: PWR_CSR WUF is set" in text for text in machine.board.warnings)


@pytest.mark.parametrize("control", [0, PDDS])
def test_a_year_of_it_is_a_handful_of_steps(make: Any, control: int) -> None:
    machine = make(CLOCKS + store(PWR, control) + DEEP + "wfi\nb stop").run(500)
    chip, steps = machine.board.chip, 0
    act = chip._act

    def counted() -> None:
        nonlocal steps
        steps += 1
        act()

    chip._act = counted
    machine.board.run_for(365 * 86_400 * S)
    assert steps <= 4
    assert mode(machine) is (PowerMode.STANDBY if control else PowerMode.STOP)


@pytest.mark.parametrize("control", [0, PDDS])
@pytest.mark.parametrize("slice_us", [None, 7.3])
def test_a_snapshot_in_a_mode_and_slices_change_nothing(make: Any, control: int, slice_us: float | None) -> None:
    machine = make(
        CLOCKS + LINE_4 + store(PWR + 4, EWUP) + store(PWR, control) + DEEP + f"wfi\nlog #2\nb stop\n{HANDLER}", VECTORS
    ).run(300, slice_us)
    board = machine.board
    saved = board.snapshot()

    def future() -> object:
        board.pin("PA4").drive(True)
        board.pin("PA0").drive(True)
        start_ns = board.now_ns
        machine.run(3, slice_us)
        middle = mode(machine)
        while board.now_ns < start_ns + 200_000:
            board.advance_to(start_ns + 200_000 if slice_us is None else board.now_ns + 7300)
        return middle, board.cycle % 1, board.pc, board.read_memory(0x2000_0100, 16)

    first = future()
    assert first[0] is PowerMode.WAKING
    board.restore(saved)
    assert future() == first
