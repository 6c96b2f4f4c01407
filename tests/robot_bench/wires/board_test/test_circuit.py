"""The circuit between the modules: its resistors are the board's, and its voltages those of a calculation by hand."""

import pytest

from adapter_sim.pinout import load_pinout
from hardware.pcb.circuit.design import SERIES, SERIES_SPECIAL, build
from robot_bench.wires.board_test import circuit
from robot_bench.wires.board_test.circuit import EN, BoardFault, Circuit, Node, Side, VoltageSource, WireFault

PINOUT = load_pinout()
OHMS = {"1k2": 1200, "680R": 680, "20k": 20_000, "4k7": 4700, "47k": 47_000}
HIGH, LOW = VoltageSource(3.3, 50), VoltageSource(0.0, 50)


def bluepill(name: str) -> Node:
    return name, Side.BLUEPILL


def esp32(name: str) -> Node:
    return name, Side.ESP32


def test_the_resistors_are_those_of_the_board() -> None:
    assert OHMS[SERIES] == circuit.SERIES_OHM
    assert {name: OHMS[value] for name, value in SERIES_SPECIAL.items()} == circuit.SERIES_SPECIAL_OHM
    parts = {component.ref: component.part.value for component in build("rev-b").components}
    assert OHMS[parts["R31"]] == circuit.PULL_OHM
    assert (OHMS[parts["R66"]], OHMS[parts["R67"]]) == (circuit.BASE_OHM, circuit.BASE_PULL_OHM)


@pytest.mark.parametrize(
    ("drives", "node", "volts"),
    [
        ({}, esp32("DD1"), 0.0),
        ({}, esp32("DD3"), 3.3),
        ({esp32("DD1"): HIGH}, bluepill("DD1"), 3.3 * 20_000 / 20_050),
        # The BluePill's 40k against the board's 20k: between the limits, which is why nothing is told by it.
        ({bluepill("DD1"): VoltageSource(3.3, 40_000)}, bluepill("DD1"), 3.3 * 21_200 / 61_200),
        ({bluepill("DD1"): VoltageSource(3.3, 40_000), esp32("DD1"): LOW}, bluepill("DD1"), 3.3 * 1250 / 41_250),
        ({}, EN, 3.3),
        ({bluepill("rst"): HIGH}, EN, 3.3 * 10 / 10_010),
        ({bluepill("rst"): VoltageSource(3.3, 1e6)}, EN, 3.3),
    ],
)
def test_voltages_are_those_of_a_calculation_by_hand(
    drives: dict[Node, VoltageSource], node: Node, volts: float
) -> None:
    assert Circuit(PINOUT).volts(drives)[node] == pytest.approx(volts, abs=2e-3)


def test_the_led_pulls_pc13_up_and_the_smaller_resistor_holds_a_low() -> None:
    pads = Circuit(PINOUT).volts({esp32("encoder2_s1"): LOW})
    # 1.5 V behind 1k against 730 ohm and the 20k beside the driver.
    assert pads[bluepill("encoder2_s1")] == pytest.approx(1.5 * 730 / 1730, abs=5e-3)
    assert pads[bluepill("encoder2_s1")] < circuit.BLUEPILL_INPUT.low_v


def test_two_drivers_in_a_short_meet_half_way() -> None:
    board = Circuit(PINOUT, (BoardFault(WireFault.SHORT, "DD1", "DD2", Side.ESP32),))
    pads = board.volts({esp32("DD1"): HIGH, esp32("DD2"): LOW})
    assert pads[esp32("DD1")] == pytest.approx(1.65, abs=0.01)


def test_a_pin_that_is_not_soldered_floats_and_follows_its_own_pull() -> None:
    board = Circuit(PINOUT, (BoardFault(WireFault.UNSOLDERED, "DD1"),))
    assert board.volts({esp32("DD1"): HIGH})[bluepill("DD1")] == pytest.approx(1.65)
    assert board.volts({bluepill("DD1"): VoltageSource(0.0, 40_000)})[bluepill("DD1")] == 0.0


def test_without_any_fault_no_wire_hears_another() -> None:
    board = Circuit(PINOUT)
    idle = board.volts({})
    for wire in PINOUT.wires:
        pads = board.volts({bluepill(wire.name): HIGH})
        heard = {name for (name, _), volts in pads.items() if volts != idle[name, _]}
        assert heard <= {wire.name, "EN"}
