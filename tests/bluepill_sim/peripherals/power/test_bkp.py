"""BKP: data that outlives resets, the tamper pin, and what it puts on PC13."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.peripherals.bkp import ASOE, ASOS, CCO, CTE, CTI, DATA_REGISTERS, TEF, TIF, TPAL, TPE, TPIE
from bluepill_sim.peripherals.rcc import ResetCause
from bluepill_sim.peripherals.rtc import CNF

TAMPER_IRQ, S = 2, 1_000_000_000


@pytest.fixture
def chip(fake_chip: Any) -> Any:
    fake_chip.power.is_backup_open = True
    return fake_chip


def data(chip: Any) -> list[int]:
    return [chip.read(f"BKP.DR{n}") for n in DATA_REGISTERS]


def fill(chip: Any) -> list[int]:
    values = [0x1000 + n for n in DATA_REGISTERS]
    for n, value in zip(DATA_REGISTERS, values, strict=True):
        chip.write(f"BKP.DR{n}", value)
    return values


@settings(max_examples=25)
@given(values=st.lists(st.integers(0, 0xFFFF_FFFF), min_size=10, max_size=10), is_open=st.booleans())
def test_the_ten_data_registers_keep_halfwords_where_they_may_be_written(
    make_fake_chip: Callable[[], Any], values: list[int], is_open: bool
) -> None:
    chip = make_fake_chip()
    chip.power.is_backup_open = is_open
    for n, value in zip(DATA_REGISTERS, values, strict=True):
        chip.write(f"BKP.DR{n}", value)
    chip.power.is_backup_open = not is_open
    assert data(chip) == [value & 0xFFFF if is_open else 0 for value in values]
    assert ("BKP:dbp" in chip.warnings) is not is_open


def test_there_are_ten_of_them_and_no_more(chip: Any) -> None:
    bkp = chip.parts.by_name["BKP"]
    assert [bkp.has_register(offset) for offset in (0x0, 0x4, 0x28, 0x2C, 0x30, 0x34, 0x38, 0x40)] == [
        False, True, True, True, True, True, False, False,
    ]  # fmt: skip


@pytest.mark.parametrize("cause", list(ResetCause))
def test_only_a_power_cut_takes_the_data(chip: Any, cause: ResetCause) -> None:
    values = fill(chip)
    chip.parts.reset(cause)
    assert data(chip) == ([0] * 10 if cause is ResetCause.POWER else values)


def test_bdrst_takes_them_and_the_reset_of_the_interface_does_not(chip: Any) -> None:
    values = fill(chip)
    chip.write("RCC.APB1RSTR", 1 << 27)
    assert data(chip) == values
    chip.write("RCC.BDCR", 1 << 16)
    assert data(chip) == [0] * 10


@pytest.mark.parametrize("polarity", [0, TPAL])
@pytest.mark.parametrize("is_early", [False, True])
def test_the_active_level_of_the_pin_is_a_tamper_event_before_and_after_tpe(
    chip: Any, polarity: int, is_early: bool
) -> None:
    pin, active = chip.pins["PC13"], not polarity
    pin.drive(active if is_early else not active)
    fill(chip)
    chip.write("BKP.CSR", TPIE)
    chip.write("BKP.CR", polarity)
    assert not chip.read("BKP.CSR") & TEF
    chip.write("BKP.CR", polarity | TPE)
    if not is_early:
        assert chip.read("BKP.CSR") == TPIE
        assert not chip.irqs[TAMPER_IRQ]
        pin.drive(active)
    assert data(chip) == [0] * 10
    assert chip.read("BKP.CSR") == TPIE | TEF | TIF
    assert chip.irqs[TAMPER_IRQ]


def test_the_data_is_held_until_the_event_is_cleared_and_each_event_is_an_edge(chip: Any) -> None:
    pin = chip.pins["PC13"]
    pin.drive(False)
    chip.write("BKP.CR", TPE)
    pin.drive(True)
    fill(chip)
    assert data(chip) == [0] * 10
    chip.write("BKP.CSR", CTE)
    assert chip.read("BKP.CSR") == 0
    values = fill(chip)
    chip.write("BKP.CR", TPE)
    assert data(chip) == values  # the pin is still high, which is no edge
    pin.drive(False)
    assert data(chip) == values
    chip.write("BKP.CR", 0)
    pin.drive(True)
    assert data(chip) == values  # nobody looks
    chip.write("BKP.CR", TPE)
    assert data(chip) == [0] * 10


def test_tef_and_tif_are_cleared_one_by_one_and_a_reset_takes_tif_and_tpie(chip: Any) -> None:
    chip.pins["PC13"].drive(True)
    chip.write("BKP.CSR", TPIE)
    chip.write("BKP.CR", TPE)
    chip.write("BKP.CSR", TPIE | CTE)
    assert chip.read("BKP.CSR") == TPIE | TIF
    assert chip.irqs[TAMPER_IRQ]
    chip.write("BKP.CSR", TPIE | CTI)
    assert chip.read("BKP.CSR") == TPIE
    assert not chip.irqs[TAMPER_IRQ]
    chip.write("BKP.CR", 0)
    chip.write("BKP.CR", TPE)
    chip.parts.reset(ResetCause.PIN)
    assert chip.read("BKP.CSR") == TEF
    assert not chip.irqs[TAMPER_IRQ]


def run_rtc(chip: Any, prescaler: int) -> int:
    """Run the RTC from the crystal; return when it began."""
    chip.write("RCC.BDCR", 1 << 15 | 1 << 8 | 1)
    chip.advance(chip.now_ns + 1_500_000_000)
    start_ns: int = chip.now_ns
    chip.write("RTC.CRL", CNF)
    chip.write("RTC.PRLL", prescaler)
    chip.write("RTC.ALRH", 0)
    chip.write("RTC.ALRL", 2)
    chip.write("RTC.CRL", 0)
    return start_ns


def at(start_ns: int, cycle: int) -> int:
    return start_ns - (-cycle * S // 32_768)


def test_cco_puts_a_64th_of_the_clock_on_the_pin(chip: Any) -> None:
    pin = chip.pins["PC13"]
    start_ns = run_rtc(chip, 0x7FFF)
    chip.write("BKP.RTCCR", CCO)
    assert (pin.holder, pin.output) == ("RTC output", PinDrive.LOW)
    for edge in range(1, 5):
        chip.advance(at(start_ns, 32 * edge) - 1)
        assert pin.level is not bool(edge % 2)
        chip.advance(at(start_ns, 32 * edge))
        assert pin.level is bool(edge % 2)
    chip.write("BKP.RTCCR", 0)
    assert pin.holder is None


@pytest.mark.parametrize(("chosen", "first"), [(ASOS, 0x8000), (0, 0x8001 + 19)])
def test_the_pulse_of_a_second_or_of_the_alarm_lasts_a_cycle(chip: Any, chosen: int, first: int) -> None:
    pin = chip.pins["PC13"]
    start_ns = run_rtc(chip, 9)
    chip.write("BKP.RTCCR", ASOE | chosen)
    chip.advance(at(start_ns, first) - 1)
    assert not pin.level
    chip.advance(at(start_ns, first))
    assert pin.level
    chip.advance(at(start_ns, first + 1) - 1)
    assert pin.level
    chip.advance(at(start_ns, first + 1))
    assert not pin.level
    chip.advance(at(start_ns, first + 10))
    assert pin.level is bool(chosen)


def test_the_tamper_function_takes_the_pin_from_the_output(chip: Any) -> None:
    chip.pins["PC13"].drive(False)
    chip.write("BKP.RTCCR", CCO)
    chip.write("BKP.CR", TPE)
    assert chip.pins["PC13"].holder is None
    chip.pins["PC13"].drive(True)
    assert chip.read("BKP.CSR") == TEF


def test_a_restored_chip_still_hears_its_tamper_pin(boot: Callable[..., Any]) -> None:
    machine = boot("b stop").run(10)
    board = machine.board
    board.chip.power.is_backup_open = True
    bkp = board.chip.parts.by_name["BKP"]
    board.pin("PC13").drive(False)
    bkp.write(0x30, 4, TPE)
    bkp.write(4, 4, 7)
    saved = board.snapshot()
    bkp.write(0x30, 4, 0)
    board.pin("PC13").drive(True)
    assert bkp.read(4, 4) == 7
    board.restore(saved)
    board.pin("PC13").drive(True)
    assert bkp.read(4, 4) == 0


@pytest.mark.parametrize("control", [0, ASOE, ASOS, ASOE | ASOS, ASOE | 0x55, ASOS | 0x55, ASOE | ASOS | CCO | 0x7F])
def test_calibration_and_whether_seconds_show_are_published_when_they_change(chip: Any, control: int) -> None:
    chip.write("BKP.RTCCR", control)
    wanted = control & 0x7F, control & (ASOE | ASOS) == ASOE | ASOS
    assert (chip.clocks.rtc_calibration, chip.clocks.rtc_seconds_shown) == wanted
    changes = chip.clock_changes
    assert changes == (wanted != (0, False))
    chip.write("BKP.RTCCR", control)
    assert chip.clock_changes == changes
    chip.write("RCC.BDCR", 1 << 16)
    assert (chip.clocks.rtc_calibration, chip.clocks.rtc_seconds_shown) == (0, False)


@pytest.mark.parametrize("control", [CCO, ASOE, CCO | ASOE | ASOS])
def test_bdrst_lets_the_pin_go_and_forgets_the_tamper_event(chip: Any, control: int) -> None:
    chip.write("BKP.RTCCR", control)
    assert chip.pins["PC13"].holder == "RTC output"
    chip.write("RCC.BDCR", 1 << 16)
    assert (chip.pins["PC13"].holder, chip.read("BKP.RTCCR")) == (None, 0)
    chip.write("RCC.BDCR", 0)
    chip.pins["PC13"].drive(True)
    for _ in range(2):
        fill(chip)
        chip.write("BKP.CSR", TPIE)
        chip.write("BKP.CR", TPE)
        assert (data(chip), chip.irqs[TAMPER_IRQ]) == ([0] * 10, True)
        chip.write("RCC.BDCR", 1 << 16)
        assert (chip.read("BKP.CR"), chip.read("BKP.CSR"), chip.irqs[TAMPER_IRQ]) == (0, 0, False)
        chip.write("RCC.BDCR", 0)


def test_cco_goes_on_through_a_reset_and_shows_no_pulse(chip: Any) -> None:
    pin = chip.pins["PC13"]
    start_ns = run_rtc(chip, 9)
    chip.write("BKP.RTCCR", CCO | ASOE | ASOS)
    chip.advance(at(start_ns, 32) - 1)
    assert not pin.level
    chip.parts.by_name["BKP"].reset()
    chip.advance(at(start_ns, 64) - 1)
    assert pin.level
    chip.advance(at(start_ns, 64))
    assert not pin.level


@pytest.mark.parametrize("control", [0, ASOS, 1 << 6])
def test_without_an_output_the_pin_is_of_gpio(chip: Any, control: int) -> None:
    chip.write("BKP.RTCCR", control)
    assert chip.pins["PC13"].holder is None
    run_rtc(chip, 9)
    assert chip.pins["PC13"].holder is None


@pytest.mark.parametrize("enable", [0, TPIE])
def test_tif_rises_only_with_tpie_and_interrupts_while_that_stands(chip: Any, enable: int) -> None:
    chip.pins["PC13"].drive(True)
    chip.write("BKP.CSR", enable)
    chip.write("BKP.CR", TPE)
    assert (chip.read("BKP.CSR"), chip.irqs[TAMPER_IRQ]) == (TEF | (enable and TIF | TPIE), bool(enable))
    chip.write("BKP.CSR", 0)
    assert not chip.irqs[TAMPER_IRQ]
    chip.write("BKP.CSR", TPIE)
    assert chip.irqs[TAMPER_IRQ] is bool(enable)
    chip.parts.reset(ResetCause.PIN)
    assert (chip.read("BKP.CSR"), chip.irqs[TAMPER_IRQ]) == (TEF, False)
