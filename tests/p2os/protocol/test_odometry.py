"""Odometry over wraps: exact to the count, nothing dropped, and honest about gaps."""

import math
from functools import cache

import pytest
from hypothesis import given

from p2os.protocol.odometry import PLAYER_POSITION_MODULUS, POSITION_MODULUS, Odometry
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.protocol.drawn_packets import SEEDS, Draw

P2DX = load_parameters("p2dx")
CYCLE_NS = 100 * NS_PER_MS


def sip_at(x: int, y: int, heading: int) -> StandardSip:
    return _sip(x % POSITION_MODULUS, y % POSITION_MODULUS, (heading + 2048) % 4096 - 2048)


@cache
def _sip(raw_x: int, raw_y: int, raw_heading: int) -> StandardSip:
    return StandardSip(raw_x=raw_x, raw_y=raw_y, raw_heading=raw_heading)


def test_ten_thousand_turns_leave_no_drift() -> None:
    odometry, heading = Odometry(P2DX), 0
    # 50 deg a cycle, 500 deg/s: what the model may turn at most. 569 counts.
    for cycle in range(10_000 * 4096 // 569 + 1):
        heading = min(cycle * 569, 10_000 * 4096)
        odometry.update(sip_at(0, 0, heading), cycle * CYCLE_NS)
    assert heading == 10_000 * 4096 - 10_000 * 4096 % 569
    odometry.update(sip_at(0, 0, 10_000 * 4096), cycle * CYCLE_NS)
    assert odometry.counts[2] == 10_000 * 4096
    assert odometry.heading_rad == pytest.approx(10_000 * 2 * math.pi, rel=1e-15)
    assert odometry.ambiguous_steps == 0


@pytest.mark.parametrize("modulus", [POSITION_MODULUS, PLAYER_POSITION_MODULUS])
@given(SEEDS)
def test_every_step_below_half_the_span_is_counted(modulus: int, seed: int) -> None:
    draw, half = Draw(seed), modulus // 2

    def drawn() -> tuple[int, int, int]:
        return draw.integer(-half, half - 1), draw.integer(-half, half - 1), draw.integer(-2048, 2047)

    steps = draw.several(drawn, 20)
    odometry, place = Odometry(P2DX, position_modulus=modulus), [7, -9, 100]
    odometry.update(sip_at(*place), 0)
    for number, step in enumerate(steps):
        place = [a + b for a, b in zip(place, step, strict=True)]
        found = odometry.update(sip_at(*place), number * CYCLE_NS)
        assert (found.dx_counts, found.dy_counts, found.turn_counts) == step
    assert odometry.counts == tuple(sum(column) for column in zip(*steps, strict=True)) or not steps
    assert odometry.x_m == pytest.approx(odometry.counts[0] * 0.00084)
    assert odometry.y_m == pytest.approx(odometry.counts[1] * 0.00084)


def test_twelve_bits_misread_what_fifteen_tell() -> None:
    full, short = Odometry(P2DX), Odometry(P2DX, position_modulus=PLAYER_POSITION_MODULUS)
    for odometry in (full, short):
        odometry.update(sip_at(100, 0, 0), 0)
        odometry.update(sip_at(3000, 0, 0), CYCLE_NS)
    # The reference's own figure: raw 100 -> 3000 is -1196 to player.
    assert (full.counts[0], short.counts[0]) == (2900, -1196)


@pytest.mark.parametrize(
    ("gap_ns", "position", "heading"),
    [
        (CYCLE_NS, False, False),
        # 180 deg at 500 deg/s.
        (360 * NS_PER_MS - 1, False, False),
        (360 * NS_PER_MS, False, True),
        # 16384 counts of 0.84 mm at 2200 mm/s are 6.2557 s.
        (6_255 * NS_PER_MS, False, True),
        (6_256 * NS_PER_MS, True, True),
        (3600 * NS_PER_S, True, True),
    ],
)
def test_a_gap_that_hides_a_wrap_is_said_and_the_distance_kept(gap_ns: int, position: bool, heading: bool) -> None:
    odometry = Odometry(P2DX)
    first = odometry.update(sip_at(0, 0, 0), 5)
    assert (first.gap_ns, first.is_ambiguous) == (0, False)
    step = odometry.update(sip_at(1000, -1000, 90), 5 + gap_ns)
    assert (step.is_position_ambiguous, step.is_heading_ambiguous) == (position, heading)
    assert step.is_ambiguous is (position or heading)
    assert odometry.ambiguous_steps == int(position or heading)
    assert odometry.counts == (1000, -1000, 90)


def test_a_restored_odometry_goes_on_as_the_first() -> None:
    first, second = Odometry(P2DX), Odometry(P2DX)
    first.update(sip_at(30000, 4, 5), 1)
    second.restore(first.snapshot())
    for odometry in (first, second):
        odometry.update(sip_at(40000, 400, -5), 2)
    assert first.counts == second.counts == (10000, 396, -10)
