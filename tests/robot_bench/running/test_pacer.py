"""The pacer waits for the clock, never the other way round."""

import pytest

from p2os.errors import LocalProtocolError
from robot_bench.running.pacer import GRAIN_NS, LONGEST_SLICE_NS, SHORTEST_SLICE_NS, RealTimePacer, SliceLength


class Clock:
    """A clock that only sleeping moves."""

    def __init__(self) -> None:
        self.now = 5_000
        self.slept: list[float] = []

    def __call__(self) -> int:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += round(seconds * 10**9)


def test_virtual_time_ahead_of_the_clock_waits() -> None:
    clock = Clock()
    pacer = RealTimePacer(clock=clock, sleep=clock.sleep)
    pacer.start(0)
    pacer.keep_pace(2_000_000)
    assert clock.slept == [0.002]
    assert pacer.lag_ns == 0


def test_double_speed_waits_half_as_long() -> None:
    clock = Clock()
    pacer = RealTimePacer(speed=2.0, clock=clock, sleep=clock.sleep)
    pacer.start(10**9)
    pacer.keep_pace(10**9 + 2_000_000)
    assert clock.slept == [0.001]


def test_lag_is_reported_and_the_worst_is_kept() -> None:
    clock = Clock()
    pacer = RealTimePacer(clock=clock, sleep=clock.sleep)
    pacer.start(0)
    clock.now += 7_000_000
    pacer.keep_pace(4_000_000)
    assert (pacer.lag_ns, pacer.worst_lag_ns) == (3_000_000, 3_000_000)
    pacer.keep_pace(8_000_000)
    assert (pacer.lag_ns, pacer.worst_lag_ns) == (0, 3_000_000)


def test_a_pacer_that_is_started_anew_is_as_a_new_one() -> None:
    clock = Clock()
    used = RealTimePacer(speed=2.0, clock=clock, sleep=clock.sleep)
    used.start(3)
    clock.now += 7_000_000
    used.keep_pace(4_000_000)
    assert used.worst_lag_ns
    fresh = RealTimePacer(speed=2.0, clock=clock, sleep=clock.sleep)
    for pacer in (used, fresh):
        pacer.start(4_000_000)
    assert vars(used) == vars(fresh)


def test_a_sleep_that_lasts_longer_is_lag_at_once() -> None:
    clock = Clock()
    pacer = RealTimePacer(clock=clock, sleep=lambda _: setattr(clock, "now", clock.now + 3 * 10**9))
    pacer.start(0)
    pacer.keep_pace(2_000_000)
    assert pacer.lag_ns == 3 * 10**9 - 2_000_000


def test_no_speed_is_no_pace() -> None:
    with pytest.raises(LocalProtocolError):
        RealTimePacer(speed=0.0)


@pytest.mark.parametrize("speed", [0.001, 0.03, 1.0, 40.0])
def test_control_comes_back_within_the_grain_however_fast_the_firmware_runs(speed: float) -> None:
    clock = Clock()
    slices = SliceLength(clock)
    took = []
    for _ in range(30):
        took.append(round(slices.slice_ns / speed))
        clock.now += took[-1]
        slices.after_slice()
    assert GRAIN_NS // 8 < max(took[15:]) <= GRAIN_NS


def test_a_slice_is_neither_endless_nor_nothing() -> None:
    clock = Clock()
    slices = SliceLength(clock)
    assert [slices.after_slice() for _ in range(20)][-1] == LONGEST_SLICE_NS
    for _ in range(40):
        clock.now += 10**9
        slices.after_slice()
    assert slices.slice_ns == SHORTEST_SLICE_NS
