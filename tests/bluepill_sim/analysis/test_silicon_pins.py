"""The program that asks on pins: what the model answers, and a board that answers something else is named."""

from dataclasses import replace
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path

import pytest

from bluepill_sim.analysis.probe import Probe
from bluepill_sim.analysis.waveforms.comparison import compare_pins
from bluepill_sim.analysis.waveforms.levels import LevelEdge, Signal, Waveforms
from bluepill_sim.board import BluePill
from tests.bluepill_sim.analysis.waveforms.captures import Analyser, seen

CYCLE_NS = 125
WIRES = ("PA0", "PA1", "PA2", "PA3", "PA4", "PA5", "PA9", "PB0")
PAGE = Path(__file__).resolve().parents[3] / "docs" / "silicon.md"


@cache
def model() -> Waveforms:
    with as_file(files("bluepill_sim.analysis.silicon").joinpath("pins.elf")) as path:
        board = BluePill(path)
        probe = Probe(board, with_signals=False)
        board.run_for("150 ms")
    probe.finish()
    signals = {}
    for pin in WIRES:
        edges = [(float(at), level) for at, level in probe.edges[pin] if level != 2]
        signals[pin] = Signal(first=0, edges=edges[1:])  # the first is from floating to its level
    return Waveforms(name="model", signals=signals, start_ns=0.0, end_ns=float(board.now_ns), sample_ns=1.0)


def rises(pin: str) -> list[float]:
    return [at for at, level in model().signals[pin].edges if level]


def falls(pin: str) -> list[float]:
    return [at for at, level in model().signals[pin].edges if not level]


def cycles(begins: list[float], ends: list[float]) -> list[int]:
    """Cycles from each begin to the first end behind it."""
    return [round((next(end for end in ends if end > begin) - begin) / CYCLE_NS) for begin in begins]


#: What the page says, by its row.
ANSWERS = {
    "PA0 up to PA1 up": lambda: cycles(rises("PA0"), rises("PA1"))[:1],
    "PA0 up to PA2 up": lambda: cycles(rises("PA0"), rises("PA2"))[:1],
    "PA3 high": lambda: cycles(rises("PA3"), falls("PA3"))[:4],
    "PA4 up to PA9 down": lambda: cycles(rises("PA4"), falls("PA9"))[:1],
    "PA5 high": lambda: cycles(rises("PA5"), falls("PA5"))[:8],
}


@pytest.mark.parametrize("row", ANSWERS)
def test_the_page_has_what_the_model_answers(row: str) -> None:
    line = next(line for line in PAGE.read_text().splitlines() if line.startswith(f"| {row} |"))
    assert line.split("|")[2].strip() == ", ".join(map(str, ANSWERS[row]()))


def test_the_same_answers_come_in_each_round() -> None:
    for begins, ends, each in ((rises("PA0"), rises("PA1"), 1), (rises("PA3"), falls("PA3"), 4)):
        found = cycles(begins, ends)
        assert found == found[:each] * 8
    assert len(rises("PB0")) == 8


def later(capture: Waveforms, pin: str, number: int, by_ns: float) -> Waveforms:
    """Return a capture in which some edges of a pin, each so many, come later."""
    edges: list[LevelEdge] = [
        (at + by_ns if n % (2 * number) >= 2 * number - 2 else at, level)
        for n, (at, level) in enumerate(capture.signals[pin].edges)
    ]
    return replace(capture, signals={**capture.signals, pin: Signal(first=0, edges=edges)})


def test_a_board_whose_handler_comes_a_cycle_later_is_named() -> None:
    capture = seen(model(), Analyser(offset_ns=-2e6, ppm=35.0))
    wires = {pin: pin for pin in WIRES}
    assert compare_pins(model(), capture, wires).first is None
    found = compare_pins(model(), later(capture, "PA1", 1, CYCLE_NS), wires)
    assert found.first is not None
    assert (found.first.pin, found.first.level) == ("PA1", 1)
    assert found.first.late_ns == pytest.approx(CYCLE_NS, abs=84)
    assert {one.track.pin: len(one.pairs) for one in found.met if one.added} == {"PA1": 0}
    assert found.late_ns(found.met[1]) == pytest.approx(CYCLE_NS, abs=42)


def test_a_board_that_does_the_store_behind_before_the_handler_is_named() -> None:
    capture = seen(model(), Analyser(ppm=-20.0))
    early = later(capture, "PA2", 1, 0.0)
    edges = [(at - 14 * CYCLE_NS if level else at, level) for at, level in early.signals["PA2"].edges]
    found = compare_pins(model(), replace(early, signals={**early.signals, "PA2": Signal(first=0, edges=edges)}),
                         {pin: pin for pin in WIRES})  # fmt: skip
    assert found.first is not None
    assert (found.first.pin, found.first.is_added) == ("PA2", True)
    assert found.first.late_ns == pytest.approx(-14 * CYCLE_NS, abs=84)
