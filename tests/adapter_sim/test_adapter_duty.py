"""Motor commands as duty: what a meter knows when, and what the adapter makes of it."""

from collections.abc import Sequence
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adapter_sim import AdapterSettings, MotorCommand
from adapter_sim.duty import COURSE_NS, FULL, DutyMeter, DutyWire
from adapter_sim.mixing import CommandedSpeeds, Mixer
from adapter_sim.pins import Median
from bluepill_sim.fabric.subscriptions import Wave
from tests.adapter_sim.conftest import MS, FakeRobot, Rig

TIMEOUT = 25 * MS
US = 1_000


def metered(edges: Sequence[tuple[int, bool]], timeout: int = TIMEOUT) -> DutyMeter:
    meter = DutyMeter(timeout)
    for at, level in edges:
        meter.edge(level, at)
    return meter


def pwm(period: int, high: int, count: int, begin: int = 0) -> list[tuple[int, bool]]:
    """Return the edges of `count` periods, and the rising edge that ends the last."""
    edges = [(begin + turn * period + at, level) for turn in range(count) for at, level in ((0, True), (high, False))]
    return [*edges, (begin + count * period, True)]


@pytest.mark.parametrize(("high_us", "duty"), [(1, 1), (250, 250), (500, 500), (999, 999), (333, 333)], ids=str)
def test_a_period_ends_with_the_next_rising_edge(high_us: int, duty: int) -> None:
    edges = pwm(1_000 * US, high_us * US, 1)
    assert metered(edges[:-1]).duty(1_000 * US - 1) == 0
    assert metered(edges).duty(1_000 * US) == duty


def test_the_duty_is_rounded_to_the_nearest_thousandth_halves_up() -> None:
    assert metered(pwm(10_000, 4_994, 1)).duty(10_000) == 499
    assert metered(pwm(10_000, 4_995, 1)).duty(10_000) == 500


@pytest.mark.parametrize("last_level", [False, True])
def test_a_wire_without_an_edge_for_the_time_out_has_a_level(last_level: bool) -> None:
    edges = pwm(1_000 * US, 300 * US, 3)
    if not last_level:
        edges.append((3_300 * US, False))
    meter, last = metered(edges), edges[-1][0]
    assert meter.duty(last + TIMEOUT - 1) == 300
    assert meter.duty(last + TIMEOUT) == (FULL if last_level else 0)


def test_a_period_as_long_as_the_time_out_has_no_duty() -> None:
    for period, duty in ((2 * TIMEOUT - 2, 500), (2 * TIMEOUT, FULL)):
        meter = metered(pwm(period, period // 2, 2))
        assert meter.duty(2 * period) == (duty if duty != FULL else 0)


def test_from_a_level_to_a_wave_the_level_stays_until_a_period_has_passed() -> None:
    meter = DutyMeter(TIMEOUT)
    meter.restart(True)
    for at, level, duty in ((100, False, FULL), (500, True, FULL), (600, False, FULL), (1_500, True, 100)):
        meter.edge(level, at)
        assert meter.duty(at) == duty


def test_the_same_level_again_is_no_edge() -> None:
    edges = pwm(1_000, 400, 2)
    doubled = [twice for at, level in edges for twice in ((at, level), (at + 1, level))]
    assert metered(doubled).duty(2_001) == metered(edges).duty(2_001) == 400


@given(st.lists(st.integers(1, 40 * MS), min_size=1, max_size=30), st.integers(0, 60 * MS))
def test_a_meter_shows_the_last_whole_period_or_a_level(gaps: list[int], later: int) -> None:
    at, level, edges = 0, False, []
    for gap in gaps:
        at, level = at + gap, not level
        edges.append((at, level))
    now = at + later
    # Only edges since the last silence count.
    first = 0
    for place, ((before, _), (after, _)) in enumerate(pairwise(edges)):
        if after - before >= TIMEOUT:
            first = place + 1
    recent = edges[first:]
    rises = [when for when, up in recent if up]
    base = FULL if not edges[first][1] else 0
    if now - recent[-1][0] >= TIMEOUT:
        expected = FULL if recent[-1][1] else 0
    elif len(rises) < 2:
        expected = base
    else:
        fall = next(when for when, up in recent if not up and when > rises[-2])
        expected = (2 * (fall - rises[-2]) * FULL + rises[-1] - rises[-2]) // (2 * (rises[-1] - rises[-2]))
    assert metered(edges).duty(now) == expected


WAVES = st.builds(
    lambda period, part, at, ns, hz: Wave(ns, at % period, period, part % (period - 1) + 1, hz),
    st.integers(2, 200_000), st.integers(0, 10**6), st.integers(0, 10**6), st.integers(0, 10**9),
    st.sampled_from([1_000_000, 8_000_000, 72_000_000]),
)  # fmt: skip


def edges_of(wave: Wave, begin: int, end: int) -> list[tuple[int, bool]]:
    """Return the levels of a wave as edges, turn by turn from its definition."""
    found = [(begin, wave.level(begin))]
    turn = 0
    while True:
        for ticks, level in ((turn * wave.period, True), (turn * wave.period + wave.high, False)):
            at = wave.ns + (ticks - wave.at) * 10**9 // wave.ticks_hz
            if at >= end:
                return found
            if at > begin:
                found.append((at, level))
        turn += 1


@given(WAVES, st.lists(st.integers(1, 3 * MS), min_size=1, max_size=8), st.integers(0, 5))
def test_a_wave_and_its_edges_mean_the_same(wave: Wave, steps: list[int], before: int) -> None:
    def read_all(course: list[tuple[int, object]]) -> list[int]:
        def between(begin: int, end: int) -> list[tuple[int, object]]:
            earlier = [shown for at, shown in course if at <= begin]
            return [
                (begin, earlier[-1] if earlier else False),
                *((at, shown) for at, shown in course if begin < at < end),
            ]

        wire = DutyWire(between, timeout_ns=TIMEOUT)
        wire.duty(start)
        return [wire.duty(at) for at in times]

    start = wave.ns
    times = [start + sum(steps[: place + 1]) for place in range(len(steps))]
    begin = wave.ns + before * 100 + 1
    edges = edges_of(wave, begin, times[-1] + 1)
    assert read_all([(begin, wave)]) == read_all([*edges])


def test_a_wire_that_was_not_looked_at_is_measured_anew() -> None:
    edges = pwm(1 * MS, MS // 4, 200)

    def course(begin: int, end: int) -> list[tuple[int, bool]]:
        return [(begin, level_at(begin)), *(edge for edge in edges if begin < edge[0] < end)]

    def level_at(at: int) -> bool:
        return [level for when, level in edges if when <= at][-1]

    wire = DutyWire(course, timeout_ns=TIMEOUT)
    assert [wire.duty(at * MS) for at in (0, 2, 4)] == [FULL, 250, 250]
    assert wire.duty(4 * MS + COURSE_NS) == 250
    assert wire.duty(4 * MS + 2 * COURSE_NS + 1) == FULL


def test_a_median_needs_more_than_half_of_the_samples() -> None:
    median = Median(5, 2)
    changed = [median.take((500, -500)) for _ in range(6)]
    assert changed == [False, False, True, False, False, False]
    assert median.is_settled
    assert median.taken == (500, -500)
    median.take((510, -490))
    assert not median.is_settled
    assert median.taken == (500, -500)
    median.reset()
    assert median.taken == (0, 0)


def test_a_sign_that_comes_two_samples_early_moves_nothing() -> None:
    median = Median(5, 1)
    for value in (400,) * 5 + (-400, -400) + (0,) * 5 + (-300,) * 5:
        median.take((value,))
        assert median.taken[0] in {400, 0, -300}


@pytest.mark.parametrize(
    ("left", "right", "speeds"),
    [
        (FULL, FULL, CommandedSpeeds(250, 0)),
        (-FULL, -FULL, CommandedSpeeds(-250, 0)),
        (500, 500, CommandedSpeeds(125, 0)),
        (10, 10, CommandedSpeeds(3, 0)),  # 2.5 mm/s, away from zero
        (1, 1, CommandedSpeeds(0, 0)),
        (400, 600, CommandedSpeeds(125, 8)),
        (-200, 200, CommandedSpeeds(0, 16)),
    ],
)
def test_a_full_duty_is_as_fast_as_the_lowest_value_of_the_bits(left: int, right: int, speeds: CommandedSpeeds) -> None:
    settings = AdapterSettings(motor_command=MotorCommand.DUTY)
    mixer = Mixer(settings, full_steps=4, track_mm=357, max_velocity_mm_s=750, max_rotation_deg_s=100)
    assert mixer.mix(left, right) == speeds


def drive(rig: Rig, name: str, duty: int, begin: int, end: int, period: int = MS) -> None:
    """Drive the first wire of a value with PWM, from one time until another."""
    wire = f"{name}_comm1"
    for at in range(begin, end, period):
        if duty < FULL:
            rig.pins.set(wire, False, at + period * duty // FULL)
        if duty:
            rig.pins.set(wire, True, at)
            rig.pins.history[wire][-2:] = sorted(rig.pins.history[wire][-2:])


def duty_rig() -> Rig:
    rig = Rig(AdapterSettings(motor_command=MotorCommand.DUTY, threshold_um=600_000), FakeRobot())
    rig.pins.set("p2dx_con", True, 310 * MS)
    return rig


def commands(rig: Rig, name: str) -> list[int]:
    values = [command.integer or 0 for _, command in rig.robot.commands if command.name == name]
    return [value for place, value in enumerate(values) if place == 0 or value != values[place - 1]]


def test_the_robot_drives_as_fast_as_the_duty_says() -> None:
    rig = duty_rig()
    drive(rig, "motor1", 300, 1_000 * MS, 3_000 * MS)
    drive(rig, "motor2", 300, 1_000 * MS, 3_000 * MS)
    rig.run(2_000 * MS)
    assert rig.adapter.status.motors == (300, 300)
    assert commands(rig, "VEL")[-1] == 75
    assert commands(rig, "RVEL")[-1] == 0


def test_the_sign_wire_turns_it_back_and_the_wire_between_says_nothing() -> None:
    rig = duty_rig()
    drive(rig, "motor1", 500, 1_000 * MS, 3_000 * MS)
    drive(rig, "motor2", 500, 1_000 * MS, 3_000 * MS)
    rig.pins.set("motor1_comm3", True, 1_000 * MS)
    rig.pins.set("motor2_comm2", True, 1_000 * MS)
    rig.run(2_000 * MS)
    assert rig.adapter.status.motors == (-500, 500)
    assert commands(rig, "VEL")[-1] == 0
    assert commands(rig, "RVEL")[-1] == 40  # 250 / 357 rad/s


def test_a_wave_that_stops_low_stops_the_robot_after_the_time_out() -> None:
    rig = duty_rig()
    drive(rig, "motor1", 500, 1_000 * MS, 2_000 * MS)
    drive(rig, "motor2", 500, 1_000 * MS, 2_000 * MS)
    rig.run(2_020 * MS)
    assert rig.adapter.status.motors == (500, 500)
    rig.run(2_040 * MS)
    assert rig.adapter.status.motors == (0, 0)


def test_a_saved_adapter_measures_on() -> None:
    ends = []
    for cut in (None, 1_501 * MS + 300 * US):
        rig = duty_rig()
        drive(rig, "motor1", 300, 1_000 * MS, 3_000 * MS)
        drive(rig, "motor2", 700, 1_000 * MS, 3_000 * MS)
        if cut is not None:
            rig.run(cut)
            saved = rig.adapter.snapshot()
            rig.adapter.inputs.reset()
            rig.adapter.restore(saved)
        rig.run(2_500 * MS)
        ends.append((rig.to_robot.log, rig.adapter.status))
    assert ends[0] == ends[1]


def test_inputs_that_measure_are_sampled_without_an_edge() -> None:
    rig = duty_rig()
    rig.adapter.samples.waits_for_edges = True
    rig.run(330 * MS)
    assert rig.adapter.wakes_on == {"rst"}
    signs_and_magnitudes = {f"motor{number}_comm{bit}" for number in (1, 2) for bit in (1, 3)}
    assert rig.adapter.inputs.wires == {"rst", "p2dx_con", *signs_and_magnitudes}
