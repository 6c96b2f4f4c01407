"""Encoder counts out of the odometry of SIPs: exact trigonometry, no drift."""

import math
import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapter_sim import encoders as encoders_module
from adapter_sim.encoders import HALF_COUNTS, ONE_BITS, CodeWalk, EncoderGeometry, Encoders, forward_step, sine
from p2os.robots.parameters import load_parameters

GEOMETRY = EncoderGeometry.of(load_parameters("p2dx"), 350_000_000)
STEP_MM = math.pi * 165 / 8


def fresh() -> Encoders:
    encoders = Encoders(GEOMETRY, 3)
    encoders.begin()
    encoders.take(0, 0, 0)
    return encoders


class Walker:
    """A robot of exact arithmetic that reports 15-bit odometry as the wire has it."""

    def __init__(self) -> None:
        self.left = self.right = self.x = self.y = self.heading = 0.0

    def roll(self, left_mm: float, right_mm: float) -> None:
        turn, forward = (right_mm - left_mm) / 357, (left_mm + right_mm) / 2
        chord = forward if turn == 0 else forward * math.sin(turn / 2) / (turn / 2)
        self.x += chord * math.cos(self.heading + turn / 2)
        self.y += chord * math.sin(self.heading + turn / 2)
        self.heading += turn
        self.left += left_mm
        self.right += right_mm

    def raw(self) -> tuple[int, int, int]:
        counts = round(self.heading * 4096 / (2 * math.pi))
        return math.floor(self.x / 0.84) & 0x7FFF, math.floor(self.y / 0.84) & 0x7FFF, (counts + 2048) % 4096 - 2048


def worst_error_mm(encoders: Encoders, walker: Walker) -> float:
    left, right = encoders.travel_nm
    return max(abs(left / 1e6 - walker.left), abs(right / 1e6 - walker.right))


def test_the_circumference_is_pi_times_the_diameter() -> None:
    assert GEOMETRY.circumference_nm == 518_362_788  # π × 165 mm


@given(st.integers(-(10**6), 10**6))
def test_the_sine_table_is_right_to_half_a_unit_and_far_from_ties(half_counts: int) -> None:
    exact = math.sin(2 * math.pi * half_counts / HALF_COUNTS) * (1 << ONE_BITS)
    assert abs(sine(half_counts) - exact) < 0.5 + 1e-4


def test_no_entry_of_the_sine_table_depends_on_the_library() -> None:
    for k in range(HALF_COUNTS // 4 + 1):
        exact = math.sin(2 * math.pi * k / HALF_COUNTS) * (1 << ONE_BITS)
        # A double's sine is good to 2^-52; times 2^30 that is 2.4e-7.
        assert abs(abs(exact - math.floor(exact)) - 0.5) > 1e-6


def test_rolling_straight_counts_both_wheels_alike() -> None:
    encoders = fresh()
    encoders.take(78, 0, 0)  # 65.52 mm, one step is 64.80
    assert encoders.counts == (1, 1)
    encoders.take(-1, 0, 0)
    assert encoders.counts == (-1, -1)


def test_turning_on_the_spot_counts_opposite_ways() -> None:
    encoders = fresh()
    encoders.take(0, 0, 1024)
    # A quarter of a turn rolls each rim by π × 357 / 4 = 280.4 mm, 4.33 steps.
    assert encoders.counts == (-5, 4)


def test_a_full_turn_on_the_spot_is_exact_through_the_wrap() -> None:
    encoders = fresh()
    for heading in range(0, 4097, 128):
        encoders.take(0, 0, (heading + 2048) % 4096 - 2048)
    assert encoders.travel_nm == (-1_121_548_577, 1_121_548_577)  # π × 357 mm


def test_a_circle_home_does_not_return_the_encoders_to_zero() -> None:
    encoders, walker = fresh(), Walker()
    for _ in range(100):
        walker.roll(10.0, 20.0)
        encoders.take(*walker.raw())
    assert worst_error_mm(encoders, walker) < 2
    assert encoders.counts[0] == math.floor(walker.left / STEP_MM)


@pytest.mark.parametrize("side_mm", [500, 2_000, 7_000])
@pytest.mark.parametrize("lost", [0.0, 0.05])
def test_a_square_of_several_metres_ends_on_the_true_count(side_mm: int, lost: float) -> None:
    encoders, walker, random_source = fresh(), Walker(), random.Random(5)
    for _ in range(4):
        for rolls in ([(12.5, 12.5)] * (side_mm // 12), [(-6.25, 6.25)] * 45):
            for left, right in rolls:
                walker.roll(left, right)
                if random_source.random() >= lost:
                    encoders.take(*walker.raw())
    encoders.take(*walker.raw())
    # A count of 0.84 mm × 2π of turning, and 0.27 mm of heading.
    assert worst_error_mm(encoders, walker) < 0.84 * 2 * math.pi + 0.3


@settings(max_examples=15)
@given(st.integers(0, 2**32), st.sampled_from([0.0, 0.05, 0.3]))
def test_minutes_of_driving_do_not_add_up_an_error(seed: int, lost: float) -> None:
    encoders, walker, random_source = fresh(), Walker(), random.Random(seed)
    left = right = 0.0
    for packet in range(3_000):  # five minutes
        if packet % 13 == 0:
            left, right = random_source.uniform(-25, 25), random_source.uniform(-25, 25)
        walker.roll(left, right)
        if random_source.random() >= lost or packet % 3 == 0:
            encoders.take(*walker.raw())
    encoders.take(*walker.raw())
    assert worst_error_mm(encoders, walker) < 20  # a third of a step of 64.8 mm


@given(st.integers(-40, 40), st.integers(-40, 40), st.integers(0, 4095), st.integers(-1000, 1000))
def test_a_step_there_and_back_is_no_way_but_for_one_unit(dx: int, dy: int, heading: int, turn: int) -> None:
    there = forward_step(dx, dy, heading, heading + turn)
    back = forward_step(-dx, -dy, heading + turn, heading)
    # Each floor shift loses less than 2^-10 counts.
    assert abs(there + back) <= 1 << (ONE_BITS - 9)


def test_a_turn_of_more_than_a_quarter_is_not_taken_for_an_arc() -> None:
    for turn in (1025, -1025):
        assert forward_step(10, 0, 0, turn) == 10 * sine(turn + 2048)  # the chord alone
    for turn in (1024, -1024):
        assert forward_step(10, 0, 0, turn) > 10 * sine(turn + 2048)


def test_an_arc_is_longer_than_its_chord_by_the_square_of_its_angle() -> None:
    exact = (2 * math.pi / 4096) ** 2 / 24
    for turn in (1, 500, 1024):
        chord = 1000 * sine(turn + 2048)
        longer = forward_step(1000, 0, 0, turn) - chord
        # The constant is floored to 2^-40, the chord to 2^-10 counts.
        assert 0 <= chord * turn**2 * exact - longer <= chord * turn**2 / 2**40 + (turn**2 * exact + 1) * 2**20
    assert math.floor(exact * 2**40) == encoders_module._ARC_E40


def test_a_jump_of_the_odometry_is_counted_and_left_out() -> None:
    encoders = fresh()
    assert encoders.take(500, 0, 0)
    before = encoders.counts
    assert not encoders.take(5_000, 0, 0)
    assert (encoders.counts, encoders.jumps) == (before, 1)
    assert encoders.take(5_078, 0, 0)
    assert encoders.counts == (before[0] + 1, before[1] + 1)


@pytest.mark.parametrize("side", [0, 1])
def test_half_of_all_positions_is_the_longest_jump_and_one_more_leads_the_other_way(side: int) -> None:
    encoders = Encoders(replace(GEOMETRY, longest_step_um=0x3FFF * 840), 3)
    encoders.begin()
    for number, (there, is_travel) in enumerate(((0, True), (0x3FFF, True), (0x7FFF, False), (0x3FFF, False))):
        assert encoders.take(*(there, 0) if side == 0 else (0, there), 0) is is_travel, number


@given(st.integers(-(10**9), 10**9), st.integers(-(10**9), 10**9))
def test_travel_goes_on_whole_where_another_session_begins(left_nm: int, right_nm: int) -> None:
    encoders = Encoders(GEOMETRY, 3)
    encoders.begin((left_nm, right_nm))
    encoders.take(0, 0, 0)
    encoders.take(100, 0, 0)
    before = encoders.travel_nm
    assert before == (left_nm + 84_000_000, right_nm + 84_000_000)
    encoders.begin(before)
    assert encoders.travel_nm == before


def test_a_snapshot_holds_all_of_it() -> None:
    encoders, other = fresh(), Encoders(GEOMETRY, 3)
    encoders.take(100, 20, 300)
    other.restore(encoders.snapshot())
    for each in (encoders, other):
        each.take(180, 60, 420)
    assert other.travel_nm == encoders.travel_nm
    assert other.snapshot() == encoders.snapshot()


PACKETS = st.lists(st.tuples(st.integers(-200, 200), st.integers(-200, 200), st.integers(-400, 400)), min_size=1)


@given(before=PACKETS, after=PACKETS, asked=st.booleans())
@settings(max_examples=40)
def test_a_snapshot_is_put_back_whatever_has_been_taken_and_asked_since(
    before: list[tuple[int, int, int]], after: list[tuple[int, int, int]], asked: bool
) -> None:
    encoders = fresh()

    def known() -> object:
        return encoders.counts, encoders.travel_nm, encoders.jumps, encoders.snapshot()

    for packet in before:
        encoders.take(*packet)
    saved, then = encoders.snapshot(), known() if asked else None
    for packet in after:
        encoders.take(*packet)
        known()
    encoders.begin((10**9, 2 * 10**9))
    known()
    encoders.restore(saved)
    now = known()
    encoders._restored()  # works out anew whatever was kept
    assert now == known() == (then or now)


def test_codes_walk_one_at_a_time_and_dwell() -> None:
    walk, shown = CodeWalk(20), []
    for now in range(100):
        walk.step(3, now)
        shown.append(walk.shown)
    assert [shown.index(count) for count in (1, 2, 3)] == [0, 20, 40]
    assert walk.due_at(3, 99) is None
    walk.step(2, 99)
    assert walk.shown == 2


def test_a_count_is_renamed_by_its_code() -> None:
    walk = CodeWalk(0)
    for _ in range(13):
        walk.step(13, 0)
    walk.rebase(8)
    assert walk.shown == -3  # 13 and −3 are both code 5
