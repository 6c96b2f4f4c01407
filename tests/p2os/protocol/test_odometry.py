"""Odometry over wraps: exact to the count, nothing dropped."""

import math
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.protocol.odometry import POSITION_MODULUS, Odometry, Unwrapper
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import load_parameters

P2DX = load_parameters("p2dx")


def sip_at(x: int, y: int, heading: int) -> StandardSip:
    wrapped = (heading + 2048) % 4096 - 2048
    return StandardSip(raw_x=x % POSITION_MODULUS, raw_y=y % POSITION_MODULUS, raw_heading=wrapped)


def test_ten_thousand_turns_leave_no_drift() -> None:
    odometry = Odometry(P2DX)
    # 50 deg a cycle, 500 deg/s: what the model may turn at most. 569 counts.
    for heading in (*range(0, 10_000 * 4096, 569), 10_000 * 4096):
        odometry.update(sip_at(0, 0, heading))
    assert odometry.heading_rad == pytest.approx(10_000 * 2 * math.pi, rel=1e-15)


@pytest.mark.parametrize("modulus", [POSITION_MODULUS, 4096])
@given(st.data())
def test_every_step_below_half_the_span_is_counted(modulus: int, data: st.DataObject) -> None:
    half = modulus // 2
    steps = data.draw(st.lists(st.integers(-half, half - 1), max_size=20))
    zero, counter = Unwrapper(modulus, 0), Unwrapper(modulus)
    assert counter.update(7) == 0
    for step, place in zip(steps, accumulate(steps), strict=True):
        assert zero.update(place % modulus) == counter.update((7 + place) % modulus) == step
        assert zero.total == counter.total == place
    counter.forget()
    assert counter.update(3) == 0


def test_a_packet_that_wraps_goes_on_in_metres() -> None:
    odometry = Odometry(P2DX)
    for x, y in ((-3, 2), (16000, -16000), (32000, -32000), (33000, -33000)):
        odometry.update(sip_at(x, y, 0))
    assert (odometry.x_m, odometry.y_m) == pytest.approx((33000 * 0.00084, -33000 * 0.00084))


def test_a_restored_odometry_goes_on_as_the_first() -> None:
    first, second = Odometry(P2DX), Odometry(P2DX)
    for x in (16000, 30000):
        first.update(sip_at(x, 4, 5))
    second.restore(first.snapshot())
    for odometry in (first, second):
        odometry.update(sip_at(40000, 400, -5))
    assert first.x_m == second.x_m == pytest.approx(33.6)
    assert first.heading_rad == second.heading_rad
