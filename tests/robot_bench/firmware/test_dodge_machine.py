"""The decisions of `dodge`: which state each picture of the sensors leads to, and for how long."""

import ctypes

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.robot_bench.firmware.dodge_machine import STATES, Dodge, compile_machine

CLEAR = "00000000"
#: A dead end: something ahead, and both sides shut.
SHUT = "01111110"
RELEASE_TICKS = 25
STATE_MOST_TICKS = 1200
MIRRORED = {
    "CRUISE": "CRUISE", "BACK_OUT": "BACK_OUT", "VEER_LEFT": "VEER_RIGHT", "VEER_RIGHT": "VEER_LEFT",
    "TURN_LEFT": "TURN_RIGHT", "TURN_RIGHT": "TURN_LEFT",
}  # fmt: skip


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    compiled = compile_machine(tmp_path_factory.mktemp("machine"))
    if compiled is None:
        pytest.skip("no C compiler for this computer")
    return compiled


@pytest.mark.parametrize(
    ("sensors", "state", "command"),
    [
        ("00000000", "CRUISE", (3, 3)),
        ("10000000", "CRUISE", (2, 2)),
        ("00000001", "CRUISE", (2, 2)),
        ("01000000", "VEER_RIGHT", (3, 2)),
        ("00000010", "VEER_LEFT", (2, 3)),
        ("00100000", "VEER_RIGHT", (3, 1)),
        ("00000100", "VEER_LEFT", (1, 3)),
        ("00010000", "TURN_RIGHT", (2, -2)),
        ("00001000", "TURN_LEFT", (-2, 2)),
        ("01000010", "CRUISE", (2, 2)),
        ("00100100", "CRUISE", (2, 2)),
        ("01100010", "VEER_RIGHT", (3, 1)),
        ("11110000", "TURN_RIGHT", (2, -2)),
        ("00011110", "TURN_LEFT", (-2, 2)),
        ("11111111", "TURN_LEFT", (-2, 2)),
    ],
)
def test_what_is_seen_first_decides(library: ctypes.CDLL, sensors: str, state: str, command: tuple[int, int]) -> None:
    dodge = Dodge(library)
    assert dodge.tick(sensors) == command
    assert dodge.state == state


def test_a_turn_keeps_its_side_whatever_comes_up_there(library: ctypes.CDLL) -> None:
    dodge = Dodge(library)
    dodge.ticks(CLEAR, 200)
    dodge.tick("00010000")
    assert dodge.state == "TURN_RIGHT"
    dodge.ticks("00001100", 40)
    assert dodge.state == "TURN_RIGHT"


def test_a_sensor_counts_at_once_and_until_it_has_been_clear_for_a_while(library: ctypes.CDLL) -> None:
    dodge = Dodge(library)
    dodge.tick("01000000")
    assert dodge.state == "VEER_RIGHT"
    dodge.ticks(CLEAR, RELEASE_TICKS - 1)
    assert dodge.state == "VEER_RIGHT"
    dodge.tick(CLEAR)
    assert dodge.state == "CRUISE"


def test_it_backs_out_of_a_dead_end_and_turns_far(library: ctypes.CDLL) -> None:
    dodge = Dodge(library)
    dodge.ticks(CLEAR, 300)
    furthest = dodge.left
    assert dodge.tick(SHUT) == (-2, -2)
    assert dodge.state == "BACK_OUT"
    while dodge.state == "BACK_OUT":
        dodge.tick(SHUT)
    assert 3.0 < furthest - dodge.left < 7.0
    assert dodge.state == "TURN_LEFT"
    twist = dodge.right - dodge.left
    while dodge.state == "TURN_LEFT":
        dodge.tick(CLEAR)
    assert dodge.right - dodge.left - twist == pytest.approx(14, abs=2.5)


def test_without_ground_behind_it_turns_on_the_spot(library: ctypes.CDLL) -> None:
    dodge = Dodge(library)
    dodge.ticks(CLEAR, 60)
    dodge.tick(SHUT)
    assert dodge.state == "TURN_LEFT"


def test_encoders_that_stand_still_hold_no_state_for_ever(library: ctypes.CDLL) -> None:
    dodge = Dodge(library)
    dodge.ticks(CLEAR, 300)
    dodge.tick(SHUT)
    left, right = dodge.left, dodge.right
    for _ in range(STATE_MOST_TICKS):
        assert dodge.state == "BACK_OUT"
        dodge.tick(SHUT)
        dodge.left, dodge.right = left, right
    dodge.tick(SHUT)
    assert dodge.state == "TURN_LEFT"
    for _ in range(STATE_MOST_TICKS):
        assert dodge.state == "TURN_LEFT"
        dodge.tick(CLEAR)
        dodge.left, dodge.right = left, right
    dodge.tick(CLEAR)
    assert dodge.state == "CRUISE"


def test_the_third_turn_without_way_between_is_a_long_one(library: ctypes.CDLL) -> None:
    dodge = Dodge(library)
    dodge.ticks(CLEAR, 300)
    turned = []
    for _ in range(4):
        dodge.tick("00010000")
        twist = dodge.left - dodge.right
        while dodge.state == "TURN_RIGHT":
            dodge.tick(CLEAR)
        turned.append(dodge.left - dodge.right - twist)
    assert turned[:3] == pytest.approx([turned[0]] * 3, abs=0.1)
    assert turned[3] > 12


def test_a_passage_that_stays_narrow_is_left(library: ctypes.CDLL) -> None:
    dodge = Dodge(library)
    dodge.ticks(CLEAR, 30)
    dodge.tick("01100110")
    start = dodge.left
    assert dodge.state == "CRUISE"
    while dodge.state == "CRUISE":
        dodge.tick("01100110")
    assert dodge.left - start < 3.5
    assert dodge.state == "TURN_LEFT"
    dodge.ticks("01100110", 100)
    assert dodge.state == "TURN_LEFT"


@settings(max_examples=60)
@given(st.lists(st.tuples(st.integers(0, 255), st.integers(1, 120)), min_size=1, max_size=25))
def test_it_never_backs_beyond_the_straight_ground_it_has_driven(
    library: ctypes.CDLL, pictures: list[tuple[int, int]]
) -> None:
    dodge, ground = Dodge(library), 0.0
    for picture, ticks in pictures:
        sensors = f"{picture:08b}"
        for _ in range(ticks):
            before = dodge.left + dodge.right
            left, right = dodge.tick(sensors)
            assert -4 <= left <= 3
            assert -4 <= right <= 3
            ground = ground + dodge.left + dodge.right - before if left == right else 0.0
            assert ground >= 0.0
            assert (left < 0 and right < 0) == (dodge.state == "BACK_OUT")


@settings(max_examples=40)
@given(st.lists(st.integers(0, 255), min_size=1, max_size=40))
def test_left_and_right_are_treated_alike(library: ctypes.CDLL, pictures: list[int]) -> None:
    one, other = Dodge(library), Dodge(library)
    # Ties go to the side of the last turn: give each machine one of its own first.
    assert one.tick("00001000") == (-2, 2)
    assert other.tick("00010000") == (2, -2)
    for picture in pictures:
        sensors = f"{picture:08b}"
        left, right = one.ticks(sensors, 30)
        assert other.ticks(sensors[::-1], 30) == (right, left)
        assert other.state == MIRRORED[one.state]
    assert set(MIRRORED) == set(STATES)
