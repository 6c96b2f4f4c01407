"""The example program that measures: what it prints of volts on its pins."""

from importlib.resources import files

import pytest

from bluepill_sim import BluePill
from bluepill_sim.fabric.signals import Oscillation, Waveform

ANALOG = str(files("robot_bench.firmware") / "analog.elf")


def test_it_prints_the_volts_of_its_pins_the_supply_and_the_temperature() -> None:
    board = BluePill(ANALOG)
    board.vdda_v, board.temperature_c = 3.0, 40.0
    board.pin("PA0").set_volts(1.5)
    board.pin("PA4").set_volts(Oscillation(shape=Waveform.SQUARE, low_v=1.0, high_v=2.0, period_ns=200_000_000))
    board.pin("PA7").drive(True)
    board.run_for("230 ms")
    assert bytes(board.usart1.unread).decode().splitlines() == [
        "analog: supply 3001 mV, chip 40 degC, PA0 1500 mV, PA4 1000 mV, PA5 0 mV, PA6 0 mV, PA7 3000 mV",
        "analog: supply 3001 mV, chip 40 degC, PA0 1500 mV, PA4 2001 mV, PA5 0 mV, PA6 0 mV, PA7 3000 mV",
    ]
    assert not [warning for warning in board.warnings if "floating" not in warning]


@pytest.mark.parametrize("volts", [0.0, -3.3, 4.1, float("nan")])
def test_a_supply_that_no_chip_bears_is_refused(volts: float) -> None:
    with pytest.raises(ValueError, match="VDDA"):
        BluePill(ANALOG).vdda_v = volts


def test_temperatures_that_no_chip_has_are_refused() -> None:
    with pytest.raises(ValueError, match="degrees"):
        BluePill(ANALOG).temperature_c = float("nan")
