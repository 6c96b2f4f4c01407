"""The pacer waits for the clock, never the other way round."""

import pytest

from p2os.errors import LocalProtocolError
from robot_bench.pacer import RealTimePacer


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


def test_lag_is_told_and_the_worst_is_kept() -> None:
    clock = Clock()
    pacer = RealTimePacer(clock=clock, sleep=clock.sleep)
    pacer.start(0)
    clock.now += 7_000_000
    pacer.keep_pace(4_000_000)
    assert (pacer.lag_ns, pacer.worst_lag_ns) == (3_000_000, 3_000_000)
    pacer.keep_pace(8_000_000)
    assert (pacer.lag_ns, pacer.worst_lag_ns) == (0, 3_000_000)


def test_a_sleep_that_lasts_longer_is_lag_at_once() -> None:
    clock = Clock()
    pacer = RealTimePacer(clock=clock, sleep=lambda _: setattr(clock, "now", clock.now + 3 * 10**9))
    pacer.start(0)
    pacer.keep_pace(2_000_000)
    assert pacer.lag_ns == 3 * 10**9 - 2_000_000


def test_no_speed_is_no_pace() -> None:
    with pytest.raises(LocalProtocolError):
        RealTimePacer(speed=0.0)
