"""RCC: start-up times, the clock tree, what may not be changed, gates, resets."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.clocks import Clocks, illegal_settings
from bluepill_sim.fabric.registers import PeripheralMapping
from bluepill_sim.peripherals.rcc import ILLEGAL_NS, Rcc, RccTime, ResetCause
from bluepill_sim.stm32f103 import BASES, CLOCK_GATES

QUICK = settings(max_examples=40)

HSEON, HSERDY, HSEBYP, PLLON, PLLRDY = 1 << 16, 1 << 17, 1 << 18, 1 << 24, 1 << 25
HSE_NS, PLL_NS = 2_000_000, 200_000


def set_bits(chip: Any, register: str, mask: int) -> None:
    chip.write(register, chip.read(register) | mask)


def clear_bits(chip: Any, register: str, mask: int) -> None:
    chip.write(register, chip.read(register) & ~mask)


@pytest.mark.parametrize(
    ("register", "on", "ready", "start_ns"),
    [
        ("RCC.CR", HSEON, HSERDY, 2_000_000),
        ("RCC.CR", PLLON, PLLRDY, 200_000),
        ("RCC.BDCR", 1, 2, 1_500_000_000),
        ("RCC.CSR", 1, 2, 85_000),
    ],
)
def test_an_oscillator_is_ready_after_its_start_up_time(
    fake_chip: Any, register: str, on: int, ready: int, start_ns: int
) -> None:
    fake_chip.power.is_backup_open = True
    fake_chip.advance(1000)
    set_bits(fake_chip, register, on)
    fake_chip.advance(1000 + start_ns - 1)
    assert not fake_chip.read(register) & ready
    fake_chip.advance(1000 + start_ns)
    assert fake_chip.read(register) & ready
    clear_bits(fake_chip, register, on)
    assert not fake_chip.read(register) & ready


def test_a_read_catches_up_with_the_time_of_its_instruction(fake_chip: Any) -> None:
    set_bits(fake_chip, "RCC.CR", HSEON)
    fake_chip.now_ns = HSE_NS
    assert fake_chip.read("RCC.CR") & HSERDY


def test_the_pll_waits_for_its_source(fake_chip: Any) -> None:
    fake_chip.write("RCC.CFGR", 1 << 16)
    fake_chip.write("RCC.CR", fake_chip.read("RCC.CR") | HSEON | PLLON)
    fake_chip.advance(HSE_NS + PLL_NS - 1)
    assert not fake_chip.read("RCC.CR") & PLLRDY
    fake_chip.advance(HSE_NS + PLL_NS)
    assert fake_chip.read("RCC.CR") & PLLRDY


def test_a_board_without_a_crystal_never_gets_ready(fake_chip: Any) -> None:
    rcc = Rcc(fake_chip, PeripheralMapping(name="RCC", base=BASES["RCC"]), gates={}, hse_hz=None)
    rcc.write(0, 4, 0x83 | HSEON)
    assert rcc.due_ns is None
    assert rcc.is_clocked("GPIOA")


FACTORS = [*range(2, 17), 16]


@pytest.mark.parametrize("number", range(16))
@pytest.mark.parametrize(("source", "input_hz"), [(0, 4_000_000), (1 << 16, 8_000_000), (3 << 16, 4_000_000)])
def test_every_pll_factor_and_source_gives_its_frequency(
    fake_chip: Any, number: int, source: int, input_hz: int
) -> None:
    fake_chip.write("FLASH.ACR", 0x12)
    fake_chip.write("RCC.CFGR", source | number << 18)
    set_bits(fake_chip, "RCC.CR", HSEON | PLLON)
    set_bits(fake_chip, "RCC.CFGR", 2)
    fake_chip.advance(HSE_NS + PLL_NS)
    expected_hz = input_hz * FACTORS[number]
    fake_chip.advance(HSE_NS + PLL_NS + ILLEGAL_NS)
    assert fake_chip.clocks.sysclk_hz == expected_hz
    assert ("clock:sysclk" in fake_chip.warnings) is (expected_hz > 72_000_000)
    assert ("clock:pclk1" in fake_chip.warnings) is (expected_hz > 36_000_000)


@QUICK
@given(hpre=st.integers(0, 15), ppre1=st.integers(0, 7), ppre2=st.integers(0, 7))
def test_the_dividers_make_the_buses(make_fake_chip: Callable[[], Any], hpre: int, ppre1: int, ppre2: int) -> None:
    chip = make_fake_chip()
    chip.write("RCC.CFGR", hpre << 4 | ppre1 << 8 | ppre2 << 11)
    ahb = 1 if hpre < 8 else [2, 4, 8, 16, 64, 128, 256, 512][hpre - 8]
    apb1, apb2 = (1 if p < 4 else 2 ** (p - 3) for p in (ppre1, ppre2))
    clocks = chip.clocks
    assert clocks.hclk_hz == 8_000_000 // ahb
    assert (clocks.pclk1_hz, clocks.pclk2_hz) == (clocks.hclk_hz // apb1, clocks.hclk_hz // apb2)
    assert clocks.timer1_hz == clocks.pclk1_hz * min(apb1, 2)
    assert clocks.timer2_hz == clocks.pclk2_hz * min(apb2, 2)


def test_a_switch_waits_until_its_source_is_ready(fake_chip: Any) -> None:
    fake_chip.write("RCC.CFGR", 1)
    assert fake_chip.read("RCC.CFGR") == 1
    set_bits(fake_chip, "RCC.CR", HSEON)
    fake_chip.advance(HSE_NS - 1)
    assert fake_chip.read("RCC.CFGR") & 0xC == 0
    fake_chip.advance(HSE_NS)
    assert fake_chip.read("RCC.CFGR") & 0xC == 4


def test_the_usual_start_reaches_72_mhz_without_a_warning(fake_chip: Any) -> None:
    fake_chip.run_at_72_mhz()
    clocks = fake_chip.clocks
    assert (clocks.hclk_hz, clocks.pclk1_hz, clocks.pclk2_hz) == (72_000_000, 36_000_000, 72_000_000)
    assert (clocks.timer1_hz, clocks.timer2_hz) == (72_000_000, 72_000_000)
    assert fake_chip.warnings == {}
    assert fake_chip.clock_changes > 0


def test_what_clocks_sysclk_cannot_be_stopped(fake_chip: Any) -> None:
    clear_bits(fake_chip, "RCC.CR", 1)
    assert fake_chip.read("RCC.CR") & 3 == 3
    fake_chip.run_at_72_mhz()
    clear_bits(fake_chip, "RCC.CR", PLLON | HSEON | 1)
    assert fake_chip.read("RCC.CR") & (PLLON | PLLRDY | HSEON | HSERDY | 3) == PLLON | PLLRDY | HSEON | HSERDY
    assert list(fake_chip.warnings) == ["RCC:in-use"]
    fake_chip.write("RCC.CFGR", fake_chip.read("RCC.CFGR") & ~3 | 1)
    clear_bits(fake_chip, "RCC.CR", HSEON)
    assert fake_chip.read("RCC.CR") & HSEON
    clear_bits(fake_chip, "RCC.CR", PLLON)
    assert not fake_chip.read("RCC.CR") & PLLRDY


def test_pll_settings_are_fixed_while_it_is_on(fake_chip: Any) -> None:
    fake_chip.run_at_72_mhz()
    before = fake_chip.read("RCC.CFGR")
    fake_chip.write("RCC.CFGR", before ^ 3 << 18)
    assert fake_chip.read("RCC.CFGR") == before
    assert list(fake_chip.warnings) == ["RCC:pll-on"]


def test_a_bypass_is_chosen_before_the_crystal_runs(fake_chip: Any) -> None:
    set_bits(fake_chip, "RCC.CR", HSEBYP)
    assert fake_chip.read("RCC.CR") & HSEBYP
    set_bits(fake_chip, "RCC.CR", HSEON)
    clear_bits(fake_chip, "RCC.CR", HSEBYP)
    assert fake_chip.read("RCC.CR") & HSEBYP


def test_the_fourth_clock_source_does_not_exist(fake_chip: Any) -> None:
    fake_chip.write("RCC.CFGR", 3)
    assert fake_chip.read("RCC.CFGR") == 0
    assert list(fake_chip.warnings) == ["RCC:sw"]


def test_too_few_wait_states_are_warned_of(fake_chip: Any) -> None:
    fake_chip.run_at_72_mhz()
    fake_chip.write("FLASH.ACR", 0x11)
    fake_chip.advance(fake_chip.now_ns + ILLEGAL_NS - 1)
    assert fake_chip.warnings == {}
    fake_chip.advance(fake_chip.now_ns + 1)
    assert fake_chip.warnings == {
        "clock:latency": "FLASH_ACR LATENCY is 1 at a SYSCLK of 72000000 Hz: good up to 48000000 Hz"
    }


PA8_ALTERNATE = 0x4444_444B


def wave_hz(chip: Any) -> float | None:
    """What PA8 shows: a frequency, or None for a constant level."""
    wave = chip.pins["PA8"].wave
    return None if wave is None else float(wave.frequency_hz)


@pytest.mark.parametrize(("mco", "hz"), [(3, None), (4, 72_000_000), (5, 8_000_000), (6, 8_000_000), (7, 36_000_000)])
def test_mco_puts_a_clock_on_pa8_where_it_is_an_alternate_function(fake_chip: Any, mco: int, hz: int | None) -> None:
    fake_chip.run_at_72_mhz()
    fake_chip.write("RCC.CFGR", fake_chip.read("RCC.CFGR") & 0xFF_FFFF | mco << 24)
    assert wave_hz(fake_chip) is None
    fake_chip.write("GPIOA.CRH", PA8_ALTERNATE)
    assert wave_hz(fake_chip) == hz
    assert fake_chip.pins["PA8"].function == ("MCO" if hz else None)
    fake_chip.parts.reset(ResetCause.PIN)
    fake_chip.write("GPIOA.CRH", PA8_ALTERNATE)
    assert fake_chip.pins["PA8"].function is None


def test_mco_follows_its_clock_and_is_low_without_it(fake_chip: Any) -> None:
    fake_chip.write("GPIOA.CRH", PA8_ALTERNATE)
    fake_chip.write("RCC.CFGR", 6 << 24)
    assert (fake_chip.pins["PA8"].function, wave_hz(fake_chip)) == ("MCO", None)
    set_bits(fake_chip, "RCC.CR", HSEON)
    fake_chip.advance(2_000_000)
    assert wave_hz(fake_chip) == 8_000_000
    fake_chip.write("RCC.CFGR", 4 << 24)
    fake_chip.write("RCC.CR", 0x81 & ~0xF8 | 15 << 3)
    assert wave_hz(fake_chip) == 7_960_000


@pytest.mark.parametrize("trim", [0, 15, 16, 17, 31])
def test_trimming_moves_hsi_and_all_that_comes_from_it(fake_chip: Any, trim: int) -> None:
    """DS5319: 40 kHz a step, 8 MHz in the middle."""
    hsi_hz = 8_000_000 + (trim - 16) * 40_000
    fake_chip.write("RCC.CR", 1 | trim << 3)
    assert fake_chip.clocks.hclk_hz == hsi_hz
    fake_chip.write("RCC.CR", 1 | trim << 3 | PLLON)
    fake_chip.advance(200_000)
    fake_chip.write("RCC.CFGR", 2)
    assert fake_chip.clocks.hclk_hz == hsi_hz // 2 * 2


CSSON, CSSF, CSSC = 1 << 19, 1 << 7, 1 << 23


@pytest.mark.parametrize("source", ["HSI", "HSE", "PLL"])
def test_the_clock_security_system_takes_hsi_and_raises_nmi_until_it_is_cleared(fake_chip: Any, source: str) -> None:
    if source == "PLL":
        fake_chip.run_at_72_mhz()
        set_bits(fake_chip, "RCC.CR", CSSON)
    else:
        set_bits(fake_chip, "RCC.CR", HSEON | CSSON)
        fake_chip.advance(2_000_000)
        fake_chip.write("RCC.CFGR", 1 if source == "HSE" else 0)
    now_ns = fake_chip.now_ns
    fake_chip.parts.rcc.fail_crystal()
    assert fake_chip.signals == ["nmi"]
    assert fake_chip.clocks.sysclk_hz == 8_000_000
    assert fake_chip.read("RCC.CR") & (HSEON | HSERDY | PLLON | PLLRDY | 3) == 3
    assert fake_chip.read("RCC.CFGR") & 0xF == 0
    assert fake_chip.read("RCC.CIR") & CSSF
    fake_chip.advance(now_ns + 999)
    assert fake_chip.signals == ["nmi"]
    fake_chip.advance(now_ns + 2000)
    assert fake_chip.signals == ["nmi"] * 3
    fake_chip.write("RCC.CIR", CSSC)
    assert not fake_chip.read("RCC.CIR") & CSSF
    fake_chip.advance(now_ns + 10**9)
    assert fake_chip.signals == ["nmi"] * 3


def test_an_oscillator_may_be_ready_in_the_nanosecond_of_an_nmi(fake_chip: Any) -> None:
    set_bits(fake_chip, "RCC.CR", HSEON | CSSON)
    fake_chip.advance(2_000_000)
    fake_chip.parts.rcc.fail_crystal()  # an NMI each microsecond from now on
    fake_chip.parts.rcc.repair_crystal()
    set_bits(fake_chip, "RCC.CR", HSEON)
    fake_chip.advance(4_000_000)
    assert fake_chip.read("RCC.CR") & HSERDY
    assert fake_chip.signals == ["nmi"] * 2001


def test_without_css_a_crystal_in_use_takes_the_core_with_it(fake_chip: Any) -> None:
    set_bits(fake_chip, "RCC.CR", HSEON)
    fake_chip.advance(2_000_000)
    fake_chip.parts.rcc.fail_crystal()
    assert fake_chip.signals == []  # nobody used it
    fake_chip.parts.rcc.repair_crystal()
    fake_chip.advance(3_999_999)
    assert not fake_chip.read("RCC.CR") & HSERDY
    fake_chip.advance(4_000_000)
    fake_chip.write("RCC.CFGR", 1)
    fake_chip.parts.rcc.fail_crystal()
    assert fake_chip.signals == ["no clock"]
    assert "RCC:hse" in fake_chip.warnings


def test_a_crystal_that_does_not_work_never_gets_ready(fake_chip: Any) -> None:
    fake_chip.parts.rcc.fail_crystal()
    set_bits(fake_chip, "RCC.CR", HSEON | CSSON)
    fake_chip.advance(10**9)
    assert not fake_chip.read("RCC.CR") & HSERDY
    assert fake_chip.signals == []


def test_a_forbidden_setting_that_passes_at_once_is_none(fake_chip: Any) -> None:
    fake_chip.run_at_72_mhz()
    for _ in range(3):
        fake_chip.write("RCC.CFGR", fake_chip.read("RCC.CFGR") & ~(7 << 8))  # PCLK1 at 72 MHz, as HAL_RCC_ClockConfig
        fake_chip.advance(fake_chip.now_ns + ILLEGAL_NS - 1)
        fake_chip.write("RCC.CFGR", fake_chip.read("RCC.CFGR") | 4 << 8)
        fake_chip.advance(fake_chip.now_ns + ILLEGAL_NS)
    assert fake_chip.warnings == {}
    assert fake_chip.parts.rcc.due_ns is None


@pytest.mark.parametrize(("hz", "states", "is_good"), [
    (24_024_000, 0, True), (24_024_001, 0, False), (48_048_000, 1, True), (48_048_001, 1, False), (72_072_000, 2, True),
    (72_072_001, 2, False),
])  # fmt: skip
def test_wait_states_have_their_limits_to_the_hertz_and_a_crystal_its_tolerance(
    hz: int, states: int, is_good: bool
) -> None:
    clocks = Clocks(sysclk_hz=hz, hclk_hz=hz, flash_wait_states=states)
    assert (illegal_settings(clocks) == []) is is_good


@pytest.mark.parametrize(("prefetch", "hclk_hz", "is_good"), [
    (True, 8_000_000, True), (True, 4_000_000, True), (False, 8_000_000, True), (False, 4_000_000, False),
])  # fmt: skip
def test_prefetch_may_be_off_without_an_ahb_prescaler(prefetch: bool, hclk_hz: int, is_good: bool) -> None:
    clocks = Clocks(sysclk_hz=8_000_000, hclk_hz=hclk_hz, flash_prefetch=prefetch)
    assert (illegal_settings(clocks) == []) is is_good


def test_prefetch_must_stay_on_with_an_ahb_prescaler(fake_chip: Any) -> None:
    fake_chip.write("FLASH.ACR", 0)
    assert fake_chip.warnings == {}
    fake_chip.write("RCC.CFGR", 8 << 4)
    fake_chip.advance(ILLEGAL_NS)
    assert list(fake_chip.warnings) == ["clock:prefetch"]


@pytest.mark.parametrize("name", CLOCK_GATES)
def test_each_gate_clocks_its_peripheral(fake_chip: Any, name: str) -> None:
    gate = CLOCK_GATES[name]
    rcc = fake_chip.parts.rcc
    assert not rcc.is_clocked(name)
    fake_chip.write(f"RCC.{gate.register}", 1 << gate.bit)
    assert rcc.is_clocked(name)
    assert fake_chip.read(f"RCC.{gate.register}") == 1 << gate.bit
    fake_chip.write(f"RCC.{gate.register}", 0)
    assert not rcc.is_clocked(name)
    assert rcc.is_clocked("RCC")


def test_a_reset_bit_resets_its_peripheral_once(fake_chip: Any) -> None:
    fake_chip.write("GPIOA.ODR", 7)
    fake_chip.write("RCC.APB2RSTR", 1 << 2 | 1 << 12)
    assert fake_chip.read("GPIOA.ODR") == 0
    fake_chip.write("RCC.APB2RSTR", 1 << 2)
    fake_chip.write("RCC.APB1RSTR", 1 << 17)
    assert fake_chip.resets == ["GPIOA", "SPI1", "USART2"]


def test_every_enable_of_a_ready_interrupt_is_read_back(fake_chip: Any) -> None:
    for bit in range(8, 13):
        fake_chip.write("RCC.CIR", 1 << bit)
        assert fake_chip.read("RCC.CIR") == 1 << bit


def test_a_ready_interrupt_is_raised_and_cleared(fake_chip: Any) -> None:
    fake_chip.write("RCC.CIR", 1 << 11)
    set_bits(fake_chip, "RCC.CR", HSEON)
    fake_chip.advance(HSE_NS)
    assert fake_chip.irqs[5]
    assert fake_chip.read("RCC.CIR") == 1 << 11 | 1 << 3
    fake_chip.write("RCC.CIR", 1 << 19, 1, 2)  # as libraries do: one byte
    assert fake_chip.irqs[5]
    fake_chip.parts.rcc.write(0x0A, 1, 1 << 3)
    assert not fake_chip.irqs[5]
    assert fake_chip.read("RCC.CIR") == 1 << 11


def test_flags_without_enable_raise_nothing(fake_chip: Any) -> None:
    set_bits(fake_chip, "RCC.CR", HSEON)
    fake_chip.advance(HSE_NS)
    assert fake_chip.read("RCC.CIR") == 1 << 3
    assert not fake_chip.irqs[5]


@pytest.mark.parametrize("cause", list(ResetCause))
def test_the_cause_of_a_reset_is_kept_until_removed(fake_chip: Any, cause: ResetCause) -> None:
    fake_chip.write("RCC.CSR", 1 << 24)
    assert fake_chip.read("RCC.CSR") == 0
    fake_chip.parts.reset(cause)
    assert fake_chip.read("RCC.CSR") == cause.value
    fake_chip.parts.reset(ResetCause.PIN)
    assert fake_chip.read("RCC.CSR") == cause.value | ResetCause.PIN.value


def test_a_reset_goes_back_to_hsi(fake_chip: Any) -> None:
    fake_chip.run_at_72_mhz()
    fake_chip.parts.reset(ResetCause.SOFTWARE)
    assert fake_chip.clocks == Clocks()
    assert fake_chip.read("RCC.CR") == 0x83
    assert fake_chip.parts.next_deadline() is None


def test_the_backup_domain_outlives_all_but_a_power_cut(fake_chip: Any) -> None:
    fake_chip.power.is_backup_open = True
    fake_chip.write("RCC.BDCR", 1 << 8 | 1)
    fake_chip.advance(1_000_000_000)
    fake_chip.parts.reset(ResetCause.PIN)
    assert fake_chip.parts.next_deadline() == RccTime.LSE_START_NS
    fake_chip.advance(RccTime.LSE_START_NS)
    assert fake_chip.read("RCC.BDCR") == 1 << 8 | 3
    fake_chip.write("RCC.BDCR", 1 << 16)
    assert fake_chip.read("RCC.BDCR") == 1 << 8 | 3  # the reset has locked it
    fake_chip.power.is_backup_open = True
    fake_chip.write("RCC.BDCR", 1 << 16)
    assert fake_chip.read("RCC.BDCR") == 1 << 16
    fake_chip.write("RCC.BDCR", 1)
    fake_chip.parts.reset(ResetCause.POWER)
    assert fake_chip.read("RCC.BDCR") == 0


def test_the_slow_crystal_takes_its_pins(fake_chip: Any) -> None:
    fake_chip.power.is_backup_open = True
    fake_chip.write("RCC.BDCR", 1)
    assert [fake_chip.pins[name].holder for name in ("PC13", "PC14", "PC15")] == [None, "OSC32_IN", "OSC32_OUT"]
    fake_chip.write("RCC.BDCR", 0)
    assert fake_chip.pins["PC14"].holder is None
