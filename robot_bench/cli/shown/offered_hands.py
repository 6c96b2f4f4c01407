"""What hands can do in a run, for the page to offer: made of the tables that scenarios know.

Invariant: whatever is offered is understood by `robot_bench.scenario.hands.words`.
"""

from collections.abc import Sequence
from typing import cast

from p2os.pioneer.controller.faults import FAULTS, MOMENTARY, SIDES, VALUES
from p2os.view.header import FaultOffer, HandsOffer, WordOffer
from robot_bench.bench.board import pins_of
from robot_bench.scenario.fault_script import LINK_DOWN
from robot_bench.scenario.scenario import Scenario

#: Pins of a BluePill that its ADC reads.
ANALOG = (*(f"PA{number}" for number in range(8)), "PB0", "PB1")
#: Faults that are buttons, which are pressed.
_BUTTONS = ("stop-button", "bumper")
#: chosen: a person who leads a robot by hand walks slowly.
MOST_MPS, MOST_DPS = 0.5, 90.0
_USUAL = {"METRES": 0.2, "RATE": 0.001, "VOLTS": 11.0}


def hands_of(scenario: Scenario) -> HandsOffer:
    """Return what can be done in a run of a scenario."""
    wires = pins_of(scenario)
    analog = [pin for pin in ANALOG if pin not in wires.values() or not scenario.has_robot]
    if scenario.own_robot is not None:
        analog += [wire.pin for wire in scenario.own_robot.robot.signals if wire.is_analog]
    return HandsOffer(
        faults=_faults(scenario), buttons=_buttons(scenario), pins=[*wires], analog_pins=sorted(set(analog)),
        ports=["usart1", "usart2", "usart3"],
        most_mps=MOST_MPS if scenario.has_robot else 0.0, most_dps=MOST_DPS if scenario.has_robot else 0.0,
    )  # fmt: skip


def _has_controller(scenario: Scenario) -> bool:
    return scenario.own_robot is None and scenario.mode == "adapter"


def _faults(scenario: Scenario) -> Sequence[FaultOffer]:
    if not _has_controller(scenario):
        return ()
    link = FaultOffer(name=LINK_DOWN, doc="the P2OS line is broken, both ways")
    sonar = scenario.parameters.sonar_fitted
    found = [link]
    for name, (words, doc) in FAULTS.items():
        if name not in _BUTTONS and (sonar or "NUMBER" not in words):
            said = [_word(name, word, sonar) for word in words]
            found.append(FaultOffer(name=name, doc=doc, is_momentary=name in MOMENTARY, words=said))
    return found


def _word(fault: str, word: str, sonar: int) -> WordOffer:
    if word in VALUES:
        least, most = cast("tuple[float, float]", VALUES[word])
        return WordOffer(name=word.lower(), least=least, most=most, usual=str(_USUAL[word]))
    if word == "SIDE":
        return WordOffer(name="side", choices=SIDES[fault], usual=SIDES[fault][0])
    return WordOffer(name="sonar", least=1, most=sonar, step=1, usual="1")


def _buttons(scenario: Scenario) -> Sequence[str]:
    if not _has_controller(scenario):
        return ()
    return ["stop-button", *(f"bumper {side} {number}" for side in SIDES["bumper"] for number in range(1, 6))]
