"""A capture beside a run: what is explained, and each planted skew named."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.analysis.waveforms.comparison import PinComparison, Unexplained, compare_pins, wires_of
from bluepill_sim.analysis.waveforms.levels import CaptureError, LevelEdge, Signal, Waveforms, signal_of
from tests.bluepill_sim.analysis.waveforms.captures import PINS, SAMPLE_NS, Analyser, random_run, seen, with_edges

RUN = random_run(1)
EXACT = Analyser(sample_ns=1.0, offset_ns=2_000_000.0, ppm=25.0)
TICK_NS = 1000 / 72


def compared(capture: Waveforms, run: Waveforms = RUN, **how: float) -> PinComparison:
    return compare_pins(run, capture, {pin: pin for pin in run.signals}, **how)


def first_of(found: PinComparison) -> Unexplained:
    assert found.first is not None
    return found.first


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10_000), edges=st.sampled_from((1, 2, 5, 20, 100)), pins=st.integers(1, 4),
    offset=st.floats(-0.5, 0.5), ppm=st.floats(-100, 100), begin=st.floats(0, 0.3), end=st.floats(0.7, 1.0),
    jitter=st.integers(0, 1),
)  # fmt: skip
def test_whatever_an_analyser_sees_of_a_run_is_explained(
    seed: int, edges: int, pins: int, offset: float, ppm: float, begin: float, end: float, jitter: int
) -> None:
    run = random_run(seed, edges=edges, pins=pins)
    how = Analyser(
        offset_ns=offset * run.end_ns, ppm=ppm, jitter=jitter, between=(begin, end), seed=seed
    )  # fmt: skip
    capture = seen(run, how)
    if not any(signal.edges for signal in capture.signals.values()):
        with pytest.raises(CaptureError):
            compared(capture, run)
        return
    found = compared(capture, run)
    assert found.first is None
    assert not found.miswired
    assert found.explained > 0
    clock = found.alignment.clock
    if sum(len(signal.edges) for signal in capture.signals.values()) > 40:
        assert abs(clock.error * 1e6 - ppm) < 1 + 2e6 * clock.error_within
        middle = (capture.start_ns + capture.end_ns) / 2
        assert abs(clock.in_run(middle) - (how.offset_ns + middle * (1 + ppm * 1e-6))) < 2 * SAMPLE_NS


@pytest.mark.parametrize("ms", [-1.0, 1.0])
def test_an_offset_of_a_millisecond_is_named(ms: float) -> None:
    found = compared(seen(RUN, Analyser(offset_ns=ms * 1e6)))
    assert found.first is None
    assert found.alignment.clock.offset_ns == pytest.approx(ms * 1e6, abs=SAMPLE_NS / 4)


@pytest.mark.parametrize("ppm", [-40.0, 0.0, 40.0])
def test_a_clock_error_of_40_ppm_is_named(ppm: float) -> None:
    found = compared(seen(RUN, Analyser(ppm=ppm, jitter=1)))
    assert found.first is None
    assert found.alignment.clock.error * 1e6 == pytest.approx(ppm, abs=3)
    assert abs(found.alignment.clock.error * 1e6 - ppm) < 2e6 * found.alignment.clock.error_within


def moved(capture: Waveforms, pin: str, number: int, by_ns: float) -> Waveforms:
    edges: list[LevelEdge] = list(capture.signals[pin].edges)
    edges[number] = (edges[number][0] + by_ns, edges[number][1])
    return with_edges(capture, {pin: edges})


@pytest.mark.parametrize("number", [0, 7, 100, 199])
def test_an_edge_that_is_one_tick_late_is_named(number: int) -> None:
    found = compared(moved(seen(RUN, EXACT), "PA2", number, TICK_NS))
    first = first_of(found)
    assert (first.channel, first.pin, found.unexplained) == ("PA2", "PA2", 2)
    assert first.run_ns == pytest.approx(RUN.signals["PA2"].edges[number][0], abs=16)
    assert first.late_ns == pytest.approx(TICK_NS, abs=2)
    assert first.jump is None
    assert first.capture_ns == pytest.approx((first.run_ns - EXACT.offset_ns) / (1 + 25e-6), abs=2)


def test_within_the_allowance_an_edge_is_explained_and_a_sample_above_it_is_not() -> None:
    capture = seen(RUN, Analyser(offset_ns=0.0))
    # It is seen up to a sample late, and one sample of jitter is allowed: two are explained in any case, three are not.
    assert compared(moved(capture, "PA1", 50, SAMPLE_NS)).first is None
    assert first_of(compared(moved(capture, "PA1", 50, 3 * SAMPLE_NS))).pin == "PA1"
    assert first_of(compared(moved(capture, "PA1", 50, 2 * SAMPLE_NS), jitter_samples=0.0)).pin == "PA1"
    assert compared(moved(capture, "PA1", 50, 3 * SAMPLE_NS), jitter_samples=3.0).first is None


@pytest.mark.parametrize("begin", [20, 100, 180])
def test_time_that_jumps_by_a_millisecond_is_named_where_it_jumps(begin: int) -> None:
    capture = seen(RUN, EXACT)
    from_ns = capture.signals["PA0"].edges[begin][0]
    later = {
        pin: [(at + 1e6 if at >= from_ns else at, level) for at, level in signal.edges]
        for pin, signal in capture.signals.items()
    }
    first = first_of(compared(with_edges(capture, later)))
    assert first.jump is not None
    assert first.jump.late_ns == pytest.approx(1e6 * (1 + 25e-6), abs=5)
    assert first.jump.explained >= 0.9 * first.jump.of
    assert first.run_ns == pytest.approx(RUN.signals["PA0"].edges[begin][0], abs=5)


def test_swapped_wires_are_named() -> None:
    capture = seen(RUN, Analyser(ppm=-30, offset_ns=5e5, jitter=1))
    swapped = with_edges(capture, {"PA1": capture.signals["PA3"].edges, "PA3": capture.signals["PA1"].edges})
    found = compared(swapped)
    assert {(wire.channel, wire.shows, wire.is_inverted) for wire in found.miswired} == {
        ("PA1", "PA3", False), ("PA3", "PA1", False),
    }  # fmt: skip
    assert first_of(found).channel in {"PA1", "PA3"}


def test_of_two_wires_that_are_swapped_both_are_named() -> None:
    run = random_run(3, pins=2)
    capture = seen(run, Analyser(ppm=50, offset_ns=-5e5, jitter=1))
    found = compared(
        with_edges(capture, {"PA0": capture.signals["PA1"].edges, "PA1": capture.signals["PA0"].edges}), run
    )
    assert {(wire.channel, wire.shows) for wire in found.miswired} == {("PA0", "PA1"), ("PA1", "PA0")}


def test_a_wire_at_a_pin_that_nobody_declared_is_named() -> None:
    capture = seen(RUN, Analyser(ppm=50))
    found = compare_pins(RUN, capture, {"PA0": "PA0", "PA1": "PA1", "PA2": "PA3"})
    assert [(wire.channel, wire.pin, wire.shows) for wire in found.miswired] == [("PA2", "PA3", "PA2")]


def test_an_inverted_pin_is_named() -> None:
    capture = seen(RUN, Analyser(ppm=50, jitter=1))
    signal = capture.signals["PA2"]
    found = compared(with_edges(capture, {"PA2": [(at, level ^ 1) for at, level in signal.edges]}))
    assert [(wire.channel, wire.shows, wire.is_inverted) for wire in found.miswired] == [("PA2", "PA2", True)]
    assert first_of(found).channel == "PA2"


@pytest.mark.parametrize("number", [4, 120])
def test_a_lost_edge_is_named(number: int) -> None:
    capture = seen(RUN, EXACT)
    edges = [edge for n, edge in enumerate(capture.signals["PA3"].edges) if n != number]
    found = compared(with_edges(capture, {"PA3": edges}))
    first = first_of(found)
    assert (first.pin, first.is_added, found.unexplained) == ("PA3", False, 1)
    at, level = RUN.signals["PA3"].edges[number]
    assert (first.level, first.other_level) == (level, level ^ 1)
    assert first.run_ns == pytest.approx(at, abs=2)


def test_a_lost_pulse_is_named_and_one_shorter_than_a_sample_is_not_judged() -> None:
    capture = seen(RUN, Analyser(offset_ns=0.0))
    edges = RUN.signals["PA0"].edges
    number = max(range(len(edges) - 1), key=lambda n: edges[n + 1][0] - edges[n][0])
    lost = [edge for n, edge in enumerate(capture.signals["PA0"].edges) if n not in {number, number + 1}]
    first = first_of(compared(with_edges(capture, {"PA0": lost})))
    assert first.pulse_ns == pytest.approx(edges[number + 1][0] - edges[number][0], abs=2)
    at = edges[number][0] + 3_000
    for length, is_judged in ((SAMPLE_NS - 1, False), (SAMPLE_NS + 1, True)):
        short = sorted([*edges, (at, edges[number + 1][1]), (at + length, edges[number][1])])
        found = compared(capture, with_edges(RUN, {"PA0": short}))
        assert (found.unexplained, found.unjudged) == ((2, 0) if is_judged else (0, 2))


def test_an_added_glitch_is_named() -> None:
    capture = seen(RUN, EXACT)
    edges = list(capture.signals["PA1"].edges)
    number = max(range(len(edges) - 1), key=lambda n: edges[n + 1][0] - edges[n][0])
    at, level = edges[number][0] + 5_000, edges[number][1]
    edges[number + 1 : number + 1] = [(at, level ^ 1), (at + 83.0, level)]
    found = compared(with_edges(capture, {"PA1": edges}))
    first = first_of(found)
    assert (first.pin, first.is_added, first.level, first.other_level, found.unexplained) == (
        "PA1", True, level ^ 1, level, 2,
    )  # fmt: skip
    assert first.pulse_ns == pytest.approx(83.0, abs=0.1)
    assert first.capture_ns == pytest.approx(at, abs=1)


def test_signals_that_repeat_are_explained_and_it_is_said() -> None:
    edges = [(1e5 * (n + 1), (n + 1) & 1) for n in range(400)]
    run = Waveforms(name="run", signals={"PA0": Signal(first=0, edges=edges)}, start_ns=0, end_ns=4.1e7, sample_ns=1)
    capture = seen(run, Analyser(between=(0.0, 0.5)))
    found = compared(capture, run)
    assert found.first is None
    assert abs(found.alignment.clock.offset_ns) < 2 * SAMPLE_NS
    assert found.alignment.as_good_ns == pytest.approx(2e5, abs=200)
    assert compared(seen(RUN, Analyser())).alignment.as_good_ns is None


def test_what_the_run_does_not_know_is_not_judged() -> None:
    floating = signal_of([(0.0, 0), (1e6, 2), (2e6, 1), (3e6, 0)], 4e6)
    assert (floating.edges, floating.unknown) == ([(3e6, 0)], [(1e6, 2e6)])
    run = Waveforms(name="run", signals={"PB0": floating, **RUN.signals}, start_ns=0, end_ns=RUN.end_ns, sample_ns=1)
    board = [(1.5e6, 1), (1.6e6, 0), (1.7e6, 1), (3e6, 0)]
    capture = seen(with_edges(run, {"PB0": board}), Analyser())
    found = compared(capture, run)
    assert (found.first, found.unjudged) == (None, 3)
    late = seen(with_edges(run, {"PB0": [(2.5e6, 0), (2.6e6, 1), (3e6, 0)]}), Analyser())
    assert first_of(compared(late, run)).pin == "PB0"


@pytest.mark.parametrize(("behind", "is_judged"), [(SAMPLE_NS, False), (-4 * SAMPLE_NS, True)])
def test_where_the_run_ends_nothing_of_the_capture_is_judged(behind: float, is_judged: bool) -> None:
    capture = seen(RUN, Analyser(offset_ns=0.0, sample_ns=SAMPLE_NS))
    level = capture.signals["PA0"].edges[-1][1]
    on = with_edges(capture, {"PA0": [*capture.signals["PA0"].edges, (RUN.end_ns + behind, level ^ 1)]})
    found = compared(replace(on, end_ns=on.end_ns + 1e6))
    assert found.unexplained == int(is_judged)


def test_a_capture_that_is_too_short_for_it_says_nothing_of_the_clock() -> None:
    capture = seen(RUN, Analyser(ppm=90.0, offset_ns=1e5, between=(0.0, 0.001)))
    assert sum(len(signal.edges) for signal in capture.signals.values()) > 3
    found = compared(capture)
    assert found.first is None
    assert (found.alignment.clock.error, found.alignment.clock.error_within) == (0.0, math.inf)


def test_names_of_channels_and_pins() -> None:
    capture = seen(RUN, Analyser())
    assert wires_of(capture, RUN, {}) == {pin: pin for pin in PINS[:4]}
    assert wires_of(capture, RUN, {"pa0": "pa3"}) == {"PA0": "PA3"}
    for declared in ({"D9": "PA0"}, {"PA0": "PZ1"}):
        with pytest.raises(CaptureError, match=r"has no (channel D9|pin PZ1)"):
            wires_of(capture, RUN, declared)
    other = Waveforms(name="x", signals={"D0": RUN.signals["PA0"]}, start_ns=0, end_ns=1, sample_ns=1)
    with pytest.raises(CaptureError, match="no channel of x"):
        wires_of(other, RUN, {})


def test_another_program_is_refused() -> None:
    other = seen(random_run(77, edges=120), Analyser())
    found = compared(other)
    assert found.unexplained > found.explained
    still = Waveforms(name="x", signals={"PA0": Signal(first=0, edges=[])}, start_ns=0, end_ns=1e6, sample_ns=1)
    with pytest.raises(CaptureError, match="no edge on PA0"):
        compare_pins(RUN, still, {"PA0": "PA0"})
