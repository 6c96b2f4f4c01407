"""RTC: counter and divider against a model that counts cycle by cycle; flags, writes and alarms to the nanosecond."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.peripherals.rcc import ResetCause
from bluepill_sim.peripherals.rtc import ALRF, CALIBRATED_CYCLES, CNF, OWF, RSF, RTOFF, SECF

WORD, S = 0xFFFF_FFFF, 1_000_000_000
LSE, LSI, HSE = 1, 2, 3
RTC_IRQ, ALARM_IRQ = 3, 41


def begins(cycle: int, hz: int = 32_768) -> int:
    """The first nanosecond of a cycle of the crystal."""
    return -(-cycle * S // hz)


class Clock:
    """A chip whose RTC runs, and where its cycles are."""

    def __init__(self, chip: Any, source: int = LSE, hz: int = 32_768) -> None:
        self.chip, self.hz = chip, hz
        chip.power.is_backup_open = True
        chip.write("RCC.CSR", 1)
        chip.write("RCC.CR", chip.read("RCC.CR") | 1 << 16)
        chip.write("RCC.BDCR", 1)
        chip.advance(chip.now_ns + 2 * S)
        chip.write("RCC.BDCR", 1 << 15 | source << 8 | 1)
        self.start_ns = chip.now_ns

    def at(self, cycle: int) -> int:
        return self.start_ns + begins(cycle, self.hz)

    def go_to(self, cycle: int, ns: int = 0) -> None:
        self.chip.advance(self.at(cycle) + ns)

    def configure(self, **values: int) -> None:
        self.chip.write("RTC.CRL", self.chip.read("RTC.CRL") | CNF)
        for name, value in values.items():
            self.chip.write(f"RTC.{name}H", value >> 16)
            self.chip.write(f"RTC.{name}L", value & 0xFFFF)
        self.chip.write("RTC.CRL", self.chip.read("RTC.CRL") & ~CNF)

    def word(self, name: str) -> int:
        high: int = self.chip.read(f"RTC.{name}H") << 16
        return high | int(self.chip.read(f"RTC.{name}L"))

    def flags(self) -> int:
        return int(self.chip.read("RTC.CRL"))

    def clear(self, flags: int) -> None:
        self.chip.write("RTC.CRL", ~flags & 0xF)


@given(
    prescaler=st.integers(0, 9), count=st.integers(WORD - 30, WORD + 30), alarm=st.integers(-5, 30),
    steps=st.lists(st.integers(0, 40), max_size=6),
)  # fmt: skip
def test_counter_divider_and_flags_are_those_of_a_count_cycle_by_cycle(
    make_fake_chip: Callable[[], Any], prescaler: int, count: int, alarm: int, steps: list[int]
) -> None:
    count, alarm = count & WORD, count + alarm & WORD
    clock = Clock(make_fake_chip())
    clock.configure(PRL=0)
    clock.go_to(0x8000 + 9)  # the divider of the reset has run out
    clock.clear(SECF | ALRF | OWF)
    clock.configure(PRL=prescaler, CNT=count, ALR=alarm)
    cycle = 0x8000 + 9 + 3
    div, flags = 0, SECF  # PRL was 0
    clock.go_to(cycle)
    if count == alarm:
        flags |= ALRF
    if count == WORD:
        flags |= OWF
    for step in steps:
        for _ in range(step):
            cycle += 1
            div, count = (div - 1, count) if div else (prescaler, count + 1 & WORD)
            if not div:
                flags |= SECF | (ALRF if count == alarm else 0) | (OWF if count == WORD else 0)
        clock.go_to(cycle)
        assert (clock.word("DIV"), clock.word("CNT")) == (div, count)
        assert clock.flags() & (SECF | ALRF | OWF) == flags
        clock.clear(flags)
        flags = 0


def test_the_second_rises_in_the_last_cycle_of_the_divider_and_the_counter_goes_up_after_it(fake_chip: Any) -> None:
    clock = Clock(fake_chip)
    clock.go_to(0x8000, -1)
    assert (clock.word("DIV"), clock.word("CNT"), clock.flags() & SECF) == (1, 0, 0)
    clock.go_to(0x8000)
    assert (clock.word("DIV"), clock.word("CNT"), clock.flags() & SECF) == (0, 0, SECF)
    clock.go_to(0x8001, -1)
    assert clock.word("CNT") == 0
    clock.go_to(0x8001)
    assert (clock.word("DIV"), clock.word("CNT")) == (0x8000, 1)


@pytest.mark.parametrize(("flag", "alarm", "count"), [(SECF, 99, 5), (ALRF, 5, 5), (OWF, 99, WORD)])
def test_each_flag_raises_the_interrupt_that_is_enabled_and_falls_by_a_zero(
    fake_chip: Any, flag: int, alarm: int, count: int
) -> None:
    clock = Clock(fake_chip)
    clock.configure(PRL=7, CNT=count, ALR=alarm)
    clock.go_to(10)
    fake_chip.write("RTC.CRH", flag)
    clock.go_to(0x8000, -1)
    assert not fake_chip.irqs[RTC_IRQ]
    clock.go_to(0x8000)
    assert fake_chip.irqs[RTC_IRQ]
    fake_chip.write("RTC.CRH", 7 & ~flag)
    assert fake_chip.irqs[RTC_IRQ] == bool(clock.flags() & 7 & ~flag)
    fake_chip.write("RTC.CRH", flag)
    clock.clear(7 & ~flag)
    assert fake_chip.irqs[RTC_IRQ]
    clock.clear(flag)
    assert not fake_chip.irqs[RTC_IRQ]
    assert clock.flags() & 7 == 0


@pytest.mark.parametrize(("after_ns", "cycles"), [(0, 3), (1, 4)])
def test_what_is_written_counts_three_cycles_after_the_end_of_configuration(
    fake_chip: Any, after_ns: int, cycles: int
) -> None:
    clock = Clock(fake_chip)
    clock.go_to(10, after_ns)
    clock.configure(CNT=0x1234_5678)
    clock.go_to(10 + cycles, -1)
    assert (clock.flags() & RTOFF, clock.word("CNT")) == (0, 0)
    clock.go_to(10 + cycles)
    assert (clock.flags() & RTOFF, clock.word("CNT")) == (RTOFF, 0x1234_5678)
    assert clock.word("DIV") == 0x8000 - 10 - cycles  # the divider goes on


def test_one_half_written_leaves_the_other_alone(fake_chip: Any) -> None:
    clock = Clock(fake_chip)
    fake_chip.write("RTC.CRL", CNF)
    fake_chip.write("RTC.CNTH", 0xABCD)
    fake_chip.write("RTC.ALRL", 0x1111)
    fake_chip.write("RTC.CRL", 0)
    clock.go_to(10)
    assert (clock.word("CNT"), clock.word("ALR")) == (0xABCD_0000, 0xFFFF_1111)


def test_rsf_rises_with_the_next_cycle(fake_chip: Any) -> None:
    clock = Clock(fake_chip)
    clock.go_to(5)
    assert clock.flags() & RSF
    clock.clear(RSF)
    clock.go_to(6, -1)
    assert not clock.flags() & RSF
    clock.go_to(6)
    assert clock.flags() & RSF


def test_outside_of_configuration_and_during_a_write_nothing_is_taken(fake_chip: Any) -> None:
    clock = Clock(fake_chip)
    fake_chip.write("RTC.CNTL", 7)
    assert "RTC:cnf" in fake_chip.warnings
    clock.configure(CNT=5)
    fake_chip.write("RTC.CRL", CNF)
    assert not clock.flags() & CNF
    assert "RTC:rtoff" in fake_chip.warnings
    clock.go_to(3)
    assert clock.word("CNT") == 5


def test_the_locked_backup_domain_takes_no_write(fake_chip: Any) -> None:
    clock = Clock(fake_chip)
    clock.configure(CNT=5)
    clock.go_to(3)
    fake_chip.power.is_backup_open = False
    clock.configure(CNT=6)
    fake_chip.write("RTC.CRH", 7)
    clock.go_to(20)
    assert (clock.word("CNT"), fake_chip.read("RTC.CRH")) == (5, 0)
    assert "RTC:dbp" in fake_chip.warnings


def test_the_alarm_is_an_edge_on_line_17_whether_or_not_its_interrupt_is_enabled(fake_chip: Any) -> None:
    clock = Clock(fake_chip)
    fake_chip.write("EXTI.RTSR", 1 << 17)
    fake_chip.write("EXTI.IMR", 1 << 17)
    clock.configure(PRL=0, CNT=100, ALR=101)
    clock.go_to(0x8000)  # the end of second 100
    assert not fake_chip.irqs[ALARM_IRQ]
    clock.go_to(0x8001, -1)
    assert not fake_chip.irqs[ALARM_IRQ]
    clock.go_to(0x8001)
    assert (fake_chip.irqs[ALARM_IRQ], fake_chip.irqs[RTC_IRQ]) == (True, False)
    fake_chip.write("EXTI.PR", 1 << 17)
    clock.configure(ALR=200)  # ALRF is still set: the line gives a pulse all the same
    clock.go_to(0x8001 + 98)
    assert not fake_chip.irqs[ALARM_IRQ]
    clock.go_to(0x8001 + 99)
    assert fake_chip.irqs[ALARM_IRQ]


def test_it_runs_through_resets_and_the_bus_sees_it_with_the_next_cycle(fake_chip: Any) -> None:
    clock = Clock(fake_chip)
    clock.configure(PRL=0)
    fake_chip.write("RTC.CRH", 1)
    clock.go_to(0x8000 + 50)
    fake_chip.parts.reset(ResetCause.SOFTWARE)
    assert (fake_chip.irqs[RTC_IRQ], fake_chip.read("RTC.CRH")) == (False, 0)
    assert (clock.word("CNT"), clock.flags()) == (0, RTOFF)
    clock.go_to(0x8000 + 51, -1)
    assert clock.word("CNT") == 0
    clock.go_to(0x8000 + 51)
    assert clock.word("CNT") == 51
    assert clock.flags() & RSF


def test_the_last_cycle_of_a_second_is_that_of_divider_0(fake_chip: Any) -> None:
    """RSF rises in the cycle before it, and SECF does not."""
    clock = Clock(fake_chip)
    clock.go_to(0x7FFE)
    clock.clear(RSF)
    clock.go_to(0x7FFF)
    assert (clock.word("DIV"), clock.flags() & (RSF | SECF)) == (1, RSF)


def test_a_reset_drops_what_is_being_configured_and_lets_a_write_come_to_its_end(fake_chip: Any) -> None:
    clock = Clock(fake_chip)
    fake_chip.write("RTC.CRL", CNF)
    fake_chip.write("RTC.CNTH", 7)
    fake_chip.parts.reset(ResetCause.PIN)
    fake_chip.power.is_backup_open = True
    clock.configure(ALR=5)
    fake_chip.parts.reset(ResetCause.PIN)
    fake_chip.power.is_backup_open = True
    assert not clock.flags() & RTOFF
    clock.go_to(3)
    assert (clock.flags() & RTOFF, clock.word("CNT"), clock.word("ALR")) == (RTOFF, 0, 5)


@pytest.mark.parametrize("how", ["power", "BDRST"])
def test_a_power_cut_and_bdrst_take_the_time(fake_chip: Any, how: str) -> None:
    clock = Clock(fake_chip)
    clock.configure(PRL=0, ALR=3)
    clock.go_to(0x8000 + 50)
    if how == "power":
        fake_chip.parts.reset(ResetCause.POWER)
    else:
        fake_chip.write("RCC.BDCR", 1 << 16)
        fake_chip.write("RCC.BDCR", 0)
    assert (clock.word("CNT"), clock.word("DIV"), clock.word("ALR")) == (0, 0x8000, WORD)
    fake_chip.advance(fake_chip.now_ns + 5 * S)
    assert clock.word("CNT") == 0


def test_bdrst_drops_what_is_being_configured(fake_chip: Any) -> None:
    Clock(fake_chip).configure(PRL=9)
    fake_chip.advance(fake_chip.now_ns + S)
    fake_chip.write("RTC.CRL", CNF)
    for name in ("PRLH", "PRLL", "CNTH", "CNTL", "ALRH", "ALRL"):
        fake_chip.write(f"RTC.{name}", 7)
    fake_chip.write("RCC.BDCR", 1 << 16)
    fake_chip.write("RCC.BDCR", 0)
    clock = Clock(fake_chip)
    fake_chip.write("RTC.CRL", 0)
    clock.go_to(3)
    assert (clock.word("CNT"), clock.word("ALR"), clock.word("DIV")) == (0, WORD, 0x8000 - 3)


@pytest.mark.parametrize(("source", "hz"), [(LSE, 32_768), (LSI, 40_000), (HSE, 62_500)])
def test_each_clock_counts_at_its_own_speed_and_stops_with_its_source(fake_chip: Any, source: int, hz: int) -> None:
    clock = Clock(fake_chip, source, hz)
    clock.configure(PRL=hz - 1)
    clock.go_to(0x8001 + hz, -1)
    assert clock.word("CNT") == 1
    clock.go_to(0x8001 + hz)
    assert clock.word("CNT") == 2
    off = {LSE: ("RCC.BDCR", 1 << 15 | 1 << 8), LSI: ("RCC.CSR", 0), HSE: ("RCC.CR", 1)}[source]
    fake_chip.write(*off)
    fake_chip.advance(fake_chip.now_ns + 10 * S)
    assert clock.word("CNT") == 2


def test_the_source_is_chosen_once(fake_chip: Any) -> None:
    clock = Clock(fake_chip)
    fake_chip.write("RCC.BDCR", 1 << 15 | LSI << 8 | 1)
    assert fake_chip.read("RCC.BDCR") >> 8 & 3 == LSE
    assert fake_chip.warnings.pop("RCC:rtcsel")
    fake_chip.write("RCC.BDCR", 1 << 16)
    assert fake_chip.warnings == {}
    fake_chip.write("RCC.BDCR", 1 << 15 | LSE << 8 | 1)
    assert fake_chip.read("RCC.BDCR") >> 8 & 3 == LSE
    clock.go_to(1)


@pytest.mark.parametrize("calibration", [1, 127])
def test_calibration_takes_so_many_of_two_to_the_twentieth_cycles(fake_chip: Any, calibration: int) -> None:
    clock = Clock(fake_chip)
    fake_chip.write("BKP.RTCCR", calibration)
    clock.configure(PRL=0xF_FFFF)
    before = clock.word("DIV")
    clock.go_to(3 * 0x8000)
    after = 3 * 0x8000 * (CALIBRATED_CYCLES - calibration) // CALIBRATED_CYCLES
    assert clock.word("DIV") == before + 0x10_0000 - after
    assert clock.word("CNT") == 1


def test_nobody_who_looks_means_no_event(fake_chip: Any) -> None:
    """SECF is set once; then only the alarm is to come, 2**32 seconds on."""
    clock = Clock(fake_chip)
    clock.configure(PRL=0x7FFF)
    clock.go_to(0x8001)
    assert fake_chip.parts.next_deadline() > fake_chip.now_ns + 10**9 * S
    clock.clear(SECF)
    assert fake_chip.parts.next_deadline() == clock.at(0x8001 + 0x7FFF)


def test_a_snapshot_goes_on_as_the_chip_did(fake_chip: Any) -> None:
    clock = Clock(fake_chip)
    clock.configure(PRL=4, CNT=WORD, ALR=3)
    clock.go_to(2)
    saved, now_ns = fake_chip.parts.snapshot(), fake_chip.now_ns

    def future() -> list[int]:
        seen = []
        for cycle in (3, 0x8000, 0x8001, 0x8010, 0x8019, 0x8100):
            clock.go_to(cycle)
            seen += [clock.word("CNT"), clock.word("DIV"), clock.flags()]
        return seen

    first = future()
    fake_chip.now_ns = now_ns
    fake_chip.parts.restore(saved)
    assert future() == first


#: LSI, divider 9, an interrupt each second; the loop waits for RTOFF and RSF.
PROGRAM = """
mov32 r1, #0x4002101C
mov32 r2, #0x18000000
str r2, [r1, #0]
mov32 r1, #0x40007000
mov32 r2, #0x100
str r2, [r1, #0]
mov32 r1, #0x40021000
movs r2, #1
str r2, [r1, #36]
lsi: ldr r2, [r1, #36]
movs r3, #2
subs r2, r2, r3
movs r3, #1
subs r2, r2, r3
mov32 r3, #0x0C000000
subs r2, r2, r3
bne lsi
mov32 r2, #0x8200
str r2, [r1, #32]
mov32 r1, #0x40002800
movs r2, #16
str r2, [r1, #4]
movs r2, #0
str r2, [r1, #8]
movs r2, #9
str r2, [r1, #12]
movs r2, #0
str r2, [r1, #4]
off: ldr r2, [r1, #4]
movs r3, #40
subs r3, r2, r3
bne off
movs r2, #1
str r2, [r1, #0]
mov32 r1, #0xE000E100
movs r2, #8
str r2, [r1, #0]
sleep: wfi
b sleep
second: mov32 r1, #0x40002800
ldr r0, [r1, #28]
log r0
movs r2, #14
str r2, [r1, #4]
ldr r2, [r1, #4]
bx lr
"""


@pytest.mark.parametrize("core", ["native", "python"])
def test_a_program_is_woken_each_second(boot: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, core: str) -> None:
    """Seconds of ten cycles of LSI, 250 us; the first one of 0x8001."""
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot(PROGRAM, {16 + 3: "second"})
    machine.run(822_000)
    assert machine.log == list(range(len(machine.log)))
    assert 7 <= len(machine.log) <= 11
    assert machine.board.warnings == []


@pytest.mark.parametrize("core", ["native", "python"])
@pytest.mark.parametrize("offset", [0x00, 0x10, 0x14, 0x28], ids=["CRH", "DIVH", "DIVL", "none"])
def test_each_write_without_dbp_is_warned_of_by_both_cores(
    boot: Any, monkeypatch: pytest.MonkeyPatch, core: str, offset: int
) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    machine = boot(f"mov32 r1, #{0x4000_2800 + offset}\nldr r2, [r1, #0]\nstr r2, [r1, #0]\nb stop").run(50)
    assert "RTC: written while PWR_CR DBP is 0" in " ".join(machine.board.warnings)
