"""Motion commands as bytes: what each makes the wheels do, and the traps of VEL2."""

import math
from collections.abc import Callable
from typing import Any

import pytest

from p2os.pioneer.controller.commands import _signed16
from p2os.protocol.commands import Command, vel2
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.profiles import Profile

MakeRobot = Callable[..., Any]


def settle(robot: Any, milliseconds: int = 4000) -> tuple[float, float]:
    """Wait, feeding the watchdog; returns the wheel speeds in mm/s."""
    for _ in range(milliseconds // 1000):
        robot.say(C.PULSE)
        robot.run(1000)
    state = robot.body.state
    return round(state.left_speed_mps * 1000, 6), round(state.right_speed_mps * 1000, 6)


def heading_deg(robot: Any) -> float:
    return math.degrees(robot.pioneer.state.heading_rad)


@pytest.mark.parametrize(
    ("data", "left", "right"),
    [
        ("fafb06203b0a050f3d", None, None),  # a bad checksum moves nothing
        (vel2(10, 5).to_frame().to_bytes().hex(), 200, 100),
        (vel2(-10, 5).to_frame().to_bytes().hex(), -200, 100),  # 1B: the word is negated before it is split
        (vel2(10, -5).to_frame().to_bytes().hex(), 200, -100),
        (vel2(-10, -5).to_frame().to_bytes().hex(), -200, -100),
    ],
)
def test_wheel_speeds_arrive_at_their_wheels(robot: Any, data: str, left: int | None, right: int | None) -> None:
    robot.open()
    robot.send(bytes.fromhex(data))
    assert settle(robot) == ((left, right) if left is not None else (0, 0))


def test_a_negative_wheel_means_the_same_from_aria_and_from_player(make_robot: MakeRobot) -> None:
    word = (-10 & 0xFF) << 8 | 5
    aria, player = make_robot().open(), make_robot().open()
    aria.say(C.VEL2, word - 0x10000)  # type 1B, magnitude
    player.say(C.VEL2, word)  # type 3B, the raw word
    assert settle(aria) == settle(player) == (-200, 100)


def test_wheel_speeds_and_translation_cancel_each_other(robot: Any) -> None:
    robot.open()
    robot.say(C.VEL, 200)
    robot.say(C.RVEL, 20)
    settle(robot)
    robot.say(C.VEL2, 0x0505)
    assert settle(robot) == (100, 100), "neither VEL nor RVEL is left"
    robot.say(C.RVEL, 20)
    left, right = settle(robot)
    assert left == -right < 0, "the speed of VEL2 is not left"


def test_rotate_is_rotation(make_robot: MakeRobot) -> None:
    robot = make_robot(profile=Profile.AROS).open()
    robot.say(C.ROTATE, -20)
    left, right = settle(robot)
    assert left == -right > 0


def test_an_unsigned_word_is_read_as_signed_and_never_as_full_speed(robot: Any) -> None:
    robot.open()
    robot.say(C.VEL, 0xFF38)  # -200 as a client packs it that knows no type byte
    assert settle(robot) == (-200, -200)


@pytest.mark.parametrize(
    ("word", "read"),
    [(0x7FFF, 32767), (0x8000, -32768), (0x8001, -32767), (0xFFFF, -1), (-1, -1), (-32768, -32768)],
)
def test_a_word_from_32768_up_is_a_negative_number(word: int, read: int) -> None:
    assert _signed16(Command(C.VEL, word)) == read


def test_stop_slows_down_and_emergency_stop_does_not(make_robot: MakeRobot) -> None:
    robot = make_robot(profile=Profile.ARCOS).open()
    for number, after_one_step in ((C.STOP, 199.7), (C.E_STOP, 0), (C.QSTOP, 0)):
        robot.say(C.VEL, 200)
        settle(robot)
        robot.say(number)
        robot.run(1)
        assert robot.body.state.left_speed_mps * 1000 == pytest.approx(after_one_step)
        assert settle(robot) == (0, 0)
        assert robot.pioneer.state.motors_enabled


def test_a_robot_that_a_wall_has_stopped_backs_off_at_once(robot: Any) -> None:
    """ARIA gives a way out of a stall a second; the ramp down from a speed that nothing moves with took longer."""
    robot.open()
    robot.say(C.VEL, 400)
    settle(robot)
    robot.body.stall(left=True, right=False)
    robot.say(C.VEL, -200)
    robot.run(1)
    assert robot.body.state.left_speed_mps > 0.3, "one wheel alone: the other still turns"
    robot.body.stall(left=True, right=True)
    robot.say(C.VEL, -200)
    robot.run(1)
    assert robot.body.state.left_speed_mps > 0.3, "what was set already is no news"
    robot.say(C.VEL, 400)
    robot.say(C.VEL, -200)
    robot.run(100)
    assert robot.body.state.left_speed_mps == pytest.approx(-0.03), "100 ms at 300 mm/s²"


def test_accelerations_are_set_by_sign(robot: Any) -> None:
    robot.open()
    robot.say(C.SETA, 1000)
    robot.say(C.SETA, -500)
    robot.say(C.VEL, 200)
    robot.run(200)
    assert robot.body.state.left_speed_mps == 0.2
    robot.say(C.STOP)
    robot.run(399)
    assert robot.body.state.left_speed_mps > 0
    robot.run(1)
    assert robot.body.state.left_speed_mps == 0
    robot.say(C.SETRA, 50)
    robot.say(C.RVEL, 10)
    robot.run(199)
    assert robot.body.state.right_speed_mps < math.radians(10) * 0.1785
    robot.run(1)
    assert robot.body.state.right_speed_mps == pytest.approx(math.radians(10) * 0.1785)


def test_limits_cut_what_is_asked(robot: Any) -> None:
    robot.open()
    robot.say(C.SETV, 150)
    robot.say(C.VEL, 900)
    assert settle(robot) == (150, 150)
    robot.say(C.VEL, 0)
    robot.say(C.SETRV, 10)
    robot.say(C.RVEL, 90)
    _, right = settle(robot)
    assert right == pytest.approx(math.radians(10) * 178.5, abs=1e-3)


def test_headings_are_absolute_relative_and_relative_to_the_set_point(robot: Any) -> None:
    robot.open()
    robot.say(C.DHEAD, 30)
    settle(robot)
    assert heading_deg(robot) == pytest.approx(30, abs=1)
    robot.say(C.SETO)
    robot.say(C.HEAD, 60)
    settle(robot)
    assert heading_deg(robot) == pytest.approx(60, abs=1)
    robot.say(C.HEAD, 90)
    robot.say(C.DCHEAD, -30)  # from 90, not from 60
    settle(robot)
    assert heading_deg(robot) == pytest.approx(60, abs=1)
    robot.say(C.DCHEAD, -60)  # nothing is being turned to: from where it is
    settle(robot)
    assert heading_deg(robot) == pytest.approx(0, abs=1)
    robot.say(C.HEAD, 270)
    settle(robot)
    assert heading_deg(robot) == pytest.approx(-90, abs=1), "the shorter way"


def test_a_move_goes_its_way_from_where_the_robot_is(robot: Any) -> None:
    robot.open()
    for _ in range(2):
        robot.say(C.MOVE, -300)
        settle(robot)
    assert robot.pioneer.state.x_mm == pytest.approx(-600, abs=6)
