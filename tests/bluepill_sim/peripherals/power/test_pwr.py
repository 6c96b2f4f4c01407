"""PWR: thresholds of the supply's detector, the lock of the backup domain, the wake-up pin and its flags."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.peripherals.pwr import CSBF, CWUF, DBP, EWUP, PVDE, PVDO, SBF, WUF
from bluepill_sim.peripherals.rcc import ResetCause

PVD_IRQ = 1


def set_supply(chip: Any, supply_mv: int) -> None:
    chip.power.supply_mv = supply_mv
    chip.parts.pwr.supply_changed()


@pytest.mark.parametrize("level", range(8))
def test_each_threshold_falls_and_rises_where_the_data_sheet_has_it(fake_chip: Any, level: int) -> None:
    """DS5319 table 12, typical: 2.08 V falling and 2.18 V rising, 0.1 V higher with each step."""
    falling, rising = 2080 + 100 * level, 2180 + 100 * level
    fake_chip.write("PWR.CR", PVDE | level << 5)
    for supply_mv, is_low in (
        (rising, False), (falling, False), (falling - 1, True), (falling, True), (rising - 1, True), (rising, False),
        (rising - 1, False),
    ):  # fmt: skip
        set_supply(fake_chip, supply_mv)
        assert bool(fake_chip.read("PWR.CSR") & PVDO) is is_low, supply_mv


def test_the_detector_is_line_16_of_exti_and_does_nothing_without_pvde(fake_chip: Any) -> None:
    for register, value in (("EXTI.RTSR", 1 << 16), ("EXTI.FTSR", 1 << 16), ("EXTI.IMR", 1 << 16)):
        fake_chip.write(register, value)
    set_supply(fake_chip, 2000)
    assert (fake_chip.read("PWR.CSR"), fake_chip.irqs[PVD_IRQ]) == (0, False)
    fake_chip.write("PWR.CR", PVDE)
    assert (fake_chip.read("PWR.CSR"), fake_chip.irqs[PVD_IRQ]) == (PVDO, True)
    fake_chip.write("EXTI.PR", 1 << 16)
    assert not fake_chip.irqs[PVD_IRQ]
    set_supply(fake_chip, 2180)
    assert fake_chip.irqs[PVD_IRQ]
    fake_chip.write("EXTI.PR", 1 << 16)
    set_supply(fake_chip, 2000)
    fake_chip.write("PWR.CR", 0)
    assert fake_chip.read("PWR.CSR") == 0


def test_dbp_opens_the_backup_domain_until_the_next_reset(fake_chip: Any) -> None:
    fake_chip.write("PWR.CR", DBP)
    fake_chip.write("BKP.DR1", 5)
    fake_chip.write("PWR.CR", 0)
    fake_chip.write("BKP.DR1", 6)
    assert fake_chip.read("BKP.DR1") == 5
    fake_chip.write("PWR.CR", DBP)
    fake_chip.parts.reset(ResetCause.SOFTWARE)
    fake_chip.write("BKP.DR1", 6)
    assert fake_chip.read("BKP.DR1") == 5


def test_the_wake_up_pin_has_its_pull_down_and_hears_rising_edges(fake_chip: Any) -> None:
    pin = fake_chip.pins["PA0"]
    pin.drive(True)
    pin.drive(False)
    assert fake_chip.read("PWR.CSR") == 0
    fake_chip.write("PWR.CSR", EWUP)
    assert (pin.output, fake_chip.read("PWR.CSR")) == (PinDrive.PULL_DOWN, EWUP)
    pin.drive(True)
    assert fake_chip.read("PWR.CSR") == EWUP | WUF
    fake_chip.write("PWR.CR", CWUF)
    pin.drive(False)
    assert fake_chip.read("PWR.CSR") == EWUP
    fake_chip.write("PWR.CSR", 0)
    assert pin.output is PinDrive.NONE


def test_a_pin_that_is_high_before_ewup_is_an_event_of_its_own(fake_chip: Any) -> None:
    fake_chip.pins["PA0"].drive(True)
    fake_chip.write("PWR.CSR", EWUP)
    assert fake_chip.read("PWR.CSR") == EWUP | WUF
    assert fake_chip.signals == ["wake"]


@given(control=st.integers(0, 0xFFFF_FFFF), status=st.integers(0, 0xFFFF_FFFF))
def test_the_flags_fall_by_their_bits_alone_and_those_read_0(
    make_fake_chip: Callable[[], Any], control: int, status: int
) -> None:
    chip = make_fake_chip()
    chip.parts.pwr.note_standby()
    chip.pins["PA0"].drive(True)
    chip.write("PWR.CSR", EWUP)
    chip.write("PWR.CSR", status)
    assert chip.read("PWR.CSR") == WUF | SBF | status & EWUP
    chip.write("PWR.CR", control)
    assert chip.read("PWR.CR") == control & 0x1F3
    assert chip.read("PWR.CSR") & 3 == (0 if control & CWUF else WUF) | (0 if control & CSBF else SBF)


@pytest.mark.parametrize("cause", list(ResetCause))
def test_only_the_supply_takes_the_flags(fake_chip: Any, cause: ResetCause) -> None:
    fake_chip.parts.pwr.note_standby()
    fake_chip.pins["PA0"].drive(True)
    fake_chip.write("PWR.CSR", EWUP)
    fake_chip.parts.reset(cause)
    assert fake_chip.read("PWR.CSR") == (0 if cause is ResetCause.POWER else WUF | SBF)
    assert fake_chip.pins["PA0"].holder is None


def test_the_bench_sets_the_supply_within_what_the_chip_works_at(boot: Callable[..., Any]) -> None:
    board = boot("b stop").board
    assert board.supply_v == 3.3
    saved = board.snapshot()
    board.supply_v = 2.0
    board.supply_v = 3.6
    for volts in (1.999, 3.601):
        with pytest.raises(ValueError, match=r"works at 2 to 3\.6 V"):
            board.supply_v = volts
    assert board.supply_v == 3.6
    board.restore(saved)
    assert board.supply_v == 3.3
