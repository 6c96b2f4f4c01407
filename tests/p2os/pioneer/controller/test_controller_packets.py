"""What the robot's standard packet says: shape, flags, speeds, positions, sonar."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from p2os.pioneer.body.contract import BodyState
from p2os.pioneer.controller import SonarPerSip
from p2os.pioneer.controller.reporter import _arcos_tail, _signed32, _simstat_packet
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import MOVING, STANDING

MakeRobot = Callable[..., Any]


@pytest.mark.parametrize(
    ("value", "held"),
    [(0, 0), (1, 1), (-1, -1), (2**31 - 1, 2**31 - 1), (2**31, -(2**31)), (-(2**31), -(2**31)),
     (-(2**31) - 1, 2**31 - 1), (2**32, 0), (3 * 2**31, -(2**31))],
)  # fmt: skip
def test_a_count_of_an_encoder_wraps_as_a_signed_word_of_32_bits(value: int, held: int) -> None:
    assert _signed32(value) == held


@pytest.mark.parametrize("which", ["x", "y", "z"])
def test_a_simulators_pose_is_in_millimetres(which: str) -> None:
    state = BodyState(**{**{f"{each}_m": 0.0 for each in "xyz"}, f"{which}_m": -1.2344, "heading_rad": 0.0})
    packet = _simstat_packet(SimpleNamespace(state=state, dt_ns=5_000_000))
    assert {each: getattr(packet, f"{each}_mm") for each in "xyz"} == {**dict.fromkeys("xyz", 0), which: -1234}
    assert packet.wanted_interval_ms == 5


def test_what_arcos_does_not_know_of_its_battery_and_temperature_is_said_so(make_robot: MakeRobot) -> None:
    robot = make_robot(profile=Profile.ARCOS).open()
    _, charge, _, _, _, temperature, _ = _arcos_tail(robot.pioneer._context, robot.body.state, robot.pioneer.parameters)
    assert (charge, temperature) == (-1, -127)


def test_tones_are_pairs_of_a_length_and_a_note(robot: Any) -> None:
    robot.open()
    robot.say(C.SAY, bytes((25, 60, 255, 0)))
    robot.run(100)
    assert ("says", "2 tones, 5.6 s") in [event[1:] for event in robot.events]


def test_a_standing_robots_packet_has_the_shape_of_the_captured_one(robot: Any) -> None:
    robot.open(motors=False)
    robot.run(100)
    (frame,) = robot.frames()
    assert len(frame.payload) == 31, "as sip_p2dx_capture: two sonar readings, ends at DIGOUT"
    captured = bytes.fromhex("32 0000 0000 0000 0000 0000 90 fefe 0000 0000 00 02 04007d 07007d 0500 5930f0")
    different = {index for index, pair in enumerate(zip(frame.payload, captured, strict=True)) if pair[0] != pair[1]}
    # Battery; which two sonar; analog value and digital pins, which nothing drives here.
    assert different <= {11, 20, 23, 28, 29, 30}


def test_a_moving_robot_reports_it(robot: Any) -> None:
    robot.open()
    assert robot.sip().kind == STANDING
    robot.say(C.RVEL, 10)
    assert robot.sip().kind == MOVING
    robot.say(C.STOP)
    robot.run(1000)
    assert robot.sip().kind == STANDING


def test_wheel_speeds_stalls_and_heading_are_in_the_packet(robot: Any) -> None:
    robot.open()
    robot.say(C.VEL, 100)
    robot.say(C.RVEL, -20)
    robot.run(800)
    robot.body.stall(left=True, right=False)
    packet = robot.sip()
    # 20 deg/s turn the rims at 62.3 mm/s on a track of 357 mm.
    assert (packet.raw_left_velocity, packet.raw_right_velocity) == (162, 38)
    assert (packet.stall_left, packet.stall_right) == (True, False)
    assert (packet.rear_bumpers, packet.front_bumpers) == (0x7F, 0x7F)
    assert packet.raw_heading == packet.raw_control == round(packet.raw_heading)
    assert packet.raw_heading < 0


def test_the_heading_setpoint_is_in_the_packet_while_turning_to_it(robot: Any) -> None:
    robot.open()
    robot.say(C.HEAD, 90)
    assert robot.sip().raw_control == 1024
    robot.run(5000)
    robot.say(C.HEAD, -90)
    assert robot.sip().raw_control == -1024


def test_flags_and_tail_are_those_of_the_firmware(make_robot: MakeRobot, profile: Profile) -> None:
    robot = make_robot(profile=profile).open()
    packet = robot.sip()
    assert packet.raw_flags == (0 if profile is Profile.P2OS else 0b11)
    assert packet.front_bumpers == (0x7F if profile is Profile.P2OS else 0)
    robot.say(C.SONAR, 0)
    robot.say(C.ENABLE, 0)
    packet = robot.sip()
    assert packet.raw_flags == 0
    assert packet.tail_field("raw_battery_x10") == (126 if profile is Profile.ARCOS else None)
    robot.say(C.ENABLE, 1)
    robot.say(C.RVEL, 15)
    robot.run(500)
    assert robot.sip().tail_field("raw_rotation_velocity") == (150 if profile is Profile.ARCOS else None)


def test_positions_are_counts_of_the_distance_factor(robot: Any) -> None:
    robot.open()
    robot.say(C.VEL, 300)
    for _ in range(6):
        robot.say(C.PULSE)
        robot.run(1000)
    packet = robot.sips()[-1]
    # A second to 300 mm/s (150 mm), then 5 s of it: 1650 mm = 1964.3 counts of 0.84 mm.
    assert packet.raw_x == 1964
    assert packet.raw_y == 0


def test_two_sonar_a_packet_go_round_the_ring(robot: Any) -> None:
    robot.body.range_m = {number: 1 + number / 10 for number in range(8)}
    robot.open()
    numbers = []
    for _ in range(5):
        for reading in robot.sip().sonar:
            numbers.append(reading.number)
            assert reading.raw_range == round((1 + reading.number / 10) * 1e6 / 268)
    assert numbers == [0, 1, 2, 3, 4, 5, 6, 7, 0, 1]
    assert robot.body.asked == [(number,) for number in numbers]


def test_all_sonar_a_packet_when_configured(make_robot: MakeRobot) -> None:
    robot = make_robot(sonar_per_sip=SonarPerSip.ALL).open()
    assert [reading.number for reading in robot.sip().sonar] == list(range(8))
    assert all(reading.raw_range == 32000 for reading in robot.sip().sonar)


def test_sonar_can_be_switched_off_and_on(robot: Any) -> None:
    robot.open()
    robot.say(C.SONAR, 0)
    assert robot.sip().sonar == ()
    assert robot.body.asked == []
    robot.run(50)
    robot.say(C.SONAR, 1)
    assert len(robot.sip().sonar) == 1, "the first ping of this cycle has passed"
    assert len(robot.sip().sonar) == 2


def test_the_sonar_polling_order_can_be_set_from_one(robot: Any) -> None:
    robot.open()
    robot.say(C.POLLING, bytes([8, 1]))
    assert [reading.number for reading in robot.sip().sonar] == [7, 0]
    robot.say(C.POLLING, b"")
    assert robot.sip().sonar == ()


def test_the_packet_says_moving_only_while_a_wheel_turns(robot: Any) -> None:
    robot.open()
    assert robot.sip().kind == STANDING
    robot.say(C.VEL, 200)
    robot.run(1000)
    assert robot.sip().kind == MOVING
    robot.body.blocked = True
    robot.run(100)
    assert robot.sip().kind == STANDING, "the motors pull, and the wheels stand"


def test_stall_bits_clear_when_the_motors_are_switched_off(make_robot: MakeRobot, profile: Profile) -> None:
    robot = make_robot(profile=profile).open()
    robot.say(C.VEL, 200)
    robot.body.stall(left=True, right=True)
    sip = robot.sip()
    assert (sip.stall_left, sip.stall_right) == (True, True)
    robot.say(C.ENABLE, 0)
    sip = robot.sip()
    assert (sip.stall_left, sip.stall_right) == (False, False), "a motor without power pulls at nothing"
