"""The H-bridge: parts of a span, exact for levels and waves, against walking every nanosecond's edges."""

from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.subscriptions import Wave
from robot_bench.direct.differential.bridge import TRUTH, HBridge
from robot_bench.direct.differential.description import BridgeDescription, BridgeKind, Off
from robot_bench.wires.nets import Net, Strength, WaveDrive
from robot_bench.wires.waves import edge_times
from simbase.timing import NS_PER_S

QUICK = settings(max_examples=80)
PP = Strength.PUSH_PULL
MS = 1_000_000


def wave(high: int, *, period: int = 3600, hz: int = 72_000_000, at: int = 0, ns: int = 0) -> Wave:
    return Wave(ns=ns, at=at, period=period, high=high, ticks_hz=hz)


def bridge(kind: BridgeKind, off: Off = Off.BRAKE, dead_time_ns: int = 0) -> tuple[HBridge, list[Net]]:
    nets = [Net(name) for name in kind.pins]
    return HBridge(nets, BridgeDescription(kind=kind, off=off, dead_time_us=dead_time_ns / 1000)), nets


@pytest.mark.parametrize("off", list(Off))
@pytest.mark.parametrize("kind", list(BridgeKind))
def test_each_combination_of_levels_does_what_its_row_says(kind: BridgeKind, off: Off) -> None:
    for code in range(1 << len(kind.pins)):
        made, nets = bridge(kind, off)
        levels = tuple(bool(code >> place & 1) for place in range(len(nets)))
        for net, level in zip(nets, levels, strict=True):
            net.drive("chip", level, PP, 0)
        does = TRUTH[kind].get(levels, 3)
        wanted = {0: (1, 0, 0), 1: (0, 1, 0), 2: (0, 0, 1), 3: (0, 0, 1) if off is Off.BRAKE else (0, 0, 0)}
        assert made.shares(0, MS) == wanted[does], levels


def test_a_duty_of_a_quarter_drives_for_a_quarter_and_brakes_for_the_rest() -> None:
    made, (in1, _, pwm) = bridge(BridgeKind.IN1_IN2_PWM)
    in1.drive("chip", True, PP, 0)
    pwm.wave_from("chip", WaveDrive(wave(900), PP.codes), 0)
    for step in range(3):
        assert made.shares(step * MS, (step + 1) * MS) == (0.25, 0, 0.75)


def test_a_wave_that_begins_within_the_step_counts_from_there_on() -> None:
    made, (pwm, direction) = bridge(BridgeKind.PWM_DIR, Off.COAST)
    pwm.drive("chip", True, PP, 0)
    pwm.wave_from("chip", WaveDrive(wave(1800, ns=600_000), PP.codes), 600_000)
    direction.drive("chip", True, PP, 800_000)
    # Reverse: 0.6 ms whole, 0.2 ms by half; forward: 0.2 ms by half.
    assert made.shares(0, MS) == pytest.approx((0.1, 0.7, 0))
    assert made.shares(MS, 2 * MS) == (0.5, 0, 0)


def test_both_inputs_by_pwm_against_each_other_are_reverse_where_forward_is_not() -> None:
    made, (in1, in2) = bridge(BridgeKind.TWO_PWM, Off.COAST)
    in1.wave_from("chip", WaveDrive(wave(2700), PP.codes), 0)
    # The same wave the other way round: it rises where the first one falls.
    in2.wave_from("chip", WaveDrive(wave(900, at=900), PP.codes), 0)
    assert made.shares(0, MS) == pytest.approx((0.75, 0.25, 0))
    assert made.shares(MS, 2 * MS) == pytest.approx((0.75, 0.25, 0))


@pytest.mark.parametrize(("dead_ns", "part"), [(0, 0.25), (500, 0.24), (12_499, 0.00002), (12_500, 0), (20_000, 0)])
def test_a_dead_time_is_taken_off_each_pulse(dead_ns: int, part: float) -> None:
    made, (pwm, direction) = bridge(BridgeKind.PWM_DIR, dead_time_ns=dead_ns)
    direction.drive("chip", True, PP, 0)
    pwm.wave_from("chip", WaveDrive(wave(900), PP.codes), 0)
    made.shares(0, MS)
    assert made.shares(MS, 2 * MS).forward == pytest.approx(part)


def test_a_dead_time_is_taken_off_pulses_that_a_program_makes_across_steps_too() -> None:
    made, (pwm, direction) = bridge(BridgeKind.PWM_DIR, dead_time_ns=10_000)
    direction.drive("chip", True, PP, 0)
    for at, level in ((100_000, True), (105_000, False), (200_000, True), (300_000, False), (995_000, True)):
        pwm.drive("chip", level, PP, at)
    assert made.shares(0, MS).forward == pytest.approx(0.09)
    pwm.drive("chip", False, PP, 1_105_000)
    assert made.shares(MS, 2 * MS).forward == pytest.approx(0.1), "from 1.005 ms on"


#: A few edges a step, so that all of them can be walked.
SLOW_WAVES = st.builds(
    lambda period, high, at: wave(1 + high % (period - 1), period=period, hz=8_000_000, at=at % period),
    st.integers(500, 9000), st.integers(0, 9000), st.integers(0, 9000),
)  # fmt: skip
WAVES = st.builds(
    lambda period, high, hz, at, ns: wave(1 + high % (period - 1), period=period, hz=hz, at=at % period, ns=ns),
    st.integers(2, 5000), st.integers(0, 5000), st.sampled_from([72_000_000, 7_000_000, 8_000_000, NS_PER_S]),
    st.integers(0, 5000), st.integers(0, 10**6),
)  # fmt: skip


@QUICK
@given(WAVES, st.integers(0, 10**10), st.integers(1, 300_000), st.sampled_from([0, 0, 137, 5000]))
@example(wave(900), 49_999, 2, 0)
def test_the_high_time_is_that_between_the_edges_to_a_nanosecond_each(
    one: Wave, after: int, span: int, dead_ns: int
) -> None:
    begin = one.ns + after
    edges = sorted(set(edge_times(one, begin, begin + span)))
    cuts = [begin, *edges, begin + span]
    walked = 0
    for first, last in pairwise(cuts):
        # Of a pulse that a dead time shortens only what is left of it; it may have begun before the span.
        if first < last and one.level(first):
            ticks = one.at + ((first - one.ns + 1) * one.ticks_hz - 1) // NS_PER_S
            risen = one.ns + (ticks // one.period * one.period - one.at) * NS_PER_S // one.ticks_hz
            walked += max(0, last - max(first, risen + dead_ns))
    made, (pwm, direction) = bridge(BridgeKind.PWM_DIR, Off.COAST, dead_ns)
    direction.drive("chip", True, PP, 0)
    pwm.wave_from("chip", WaveDrive(replace(one, ns=one.ns + MS), PP.codes), 0)  # past any dead time of the pins
    found = made.shares(begin + MS, begin + MS + span)
    assert found.forward * span == pytest.approx(walked, abs=2 * len(cuts) + 2)
    assert found.reverse == found.brake == 0


@QUICK
@given(WAVES, st.integers(0, 10**9), st.integers(1, 100_000))
def test_edges_alternate_and_the_level_changes_at_each_and_nowhere_else(one: Wave, after: int, span: int) -> None:
    begin = one.ns + after
    edges = [at for at in sorted(edge_times(one, begin, begin + span)) if at > begin]
    if one.ticks_hz == NS_PER_S and min(one.high, one.period - one.high) < 2:  # edges of one nanosecond
        return
    for first, last in pairwise([begin, *edges, begin + span]):
        if first < last:
            assert one.level(first) is one.level(last - 1)
    for at in edges:
        assert one.level(at) is not one.level(at - 1)


@settings(max_examples=25)
@given(st.lists(st.tuples(st.integers(0, 3 * MS), st.integers(0, 2), st.booleans() | SLOW_WAVES), max_size=8))
def test_the_parts_are_those_between_all_edges_and_add_up(rows: list[tuple[int, int, bool | Wave]]) -> None:
    made, nets = bridge(BridgeKind.IN1_IN2_PWM, Off.COAST)
    for at, place, what in sorted(rows, key=lambda row: row[0]):
        if isinstance(what, bool):
            nets[place].drive("chip", what, PP, at)
        else:
            there = Wave(at, what.at, what.period, what.high, what.ticks_hz)
            nets[place].wave_from("chip", WaveDrive(there, PP.codes), at)
    for step in range(4):
        begin, end = step * MS, (step + 1) * MS
        found = made.shares(begin, end)
        cuts = {begin, end}
        for net in nets:
            for (at, what), (until, _) in pairwise([*net.course(begin, end), (end, False)]):
                cuts |= {at, *(edge_times(what, at, until) if isinstance(what, Wave) else ())}
        walked = [0, 0, 0, 0]
        for first, last in pairwise(sorted(cuts)):
            walked[TRUTH[BridgeKind.IN1_IN2_PWM].get(tuple(net.level(first) for net in nets), 3)] += last - first
        assert [share * MS for share in found] == pytest.approx(walked[:3], abs=len(cuts) + 1)
        assert 0 <= sum(found) <= 1 + 1e-9
        assert min(found) >= 0
