"""The commands that only simulators have: true pose, a laser on the robot's own line, messages, the end."""

import struct
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.pioneer.controller import ControllerSettings
from p2os.pioneer.devices.laser import LASERS, MOST_READINGS, Laser, LaserModel, read_laser
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.frames import Frame
from p2os.protocol.packets import MapChangedPacket, SiminfoPacket, SimLaserPacket, SimstatPacket
from p2os.protocol.profiles import Profile
from simbase.errors import UsageError

MakeRobot = Callable[..., Any]
LMS = LASERS["lms2xx"]


def lasers(robot: Any) -> list[SimLaserPacket]:
    return [SimLaserPacket.from_frame(frame) for frame in robot.frames() if frame.kind in SimLaserPacket.KINDS]


def of(robot: Any, kind: Any) -> list[Any]:
    return [kind.from_frame(frame) for frame in robot.frames() if frame.kind == kind.KIND]


def test_a_robot_that_is_no_simulator_ignores_them_all(robot: Any) -> None:
    robot.open()
    for number in (C.SIM_RESET, C.SIM_STAT, C.SIM_EXIT, C.SIM_LRF_ENABLE, C.LOADWORLD, C.RESETSIMTOORIGIN):
        robot.say(number, 1)
    robot.say(C.SIM_SET_POSE, struct.pack("<iii", 1000, 0, 0))
    robot.run(300)
    assert robot.body.state.x_m == 0
    assert robot.pioneer.exit_code is None
    assert {frame.kind for frame in robot.frames()} == {0x32}


@pytest.mark.parametrize("type_byte", [0x00, 0x2B, 0x3B])
def test_a_robot_is_carried_elsewhere_and_its_odometry_does_not_notice(make_robot: MakeRobot, type_byte: int) -> None:
    robot = make_robot(lenient=True).open()
    robot.say(C.VEL, 200)
    robot.run(1000)
    before = robot.sip().raw_x
    robot.say(C.VEL, 0)
    robot.run(1000)
    # ARIA writes a zero where others write a type of argument.
    robot.send(Frame(bytes((C.SIM_SET_POSE, type_byte)) + struct.pack("<iii", -1500, 70_000, 90)).to_bytes())
    robot.say(C.SIM_STAT, 1)
    robot.run(200)
    (stat,) = of(robot, SimstatPacket)
    assert (stat.x_mm, stat.y_mm, stat.heading_deg) == (-1500, 70_000, 90)
    assert robot.sip().raw_x >= before > 0


def test_a_reset_brings_it_back_with_odometry_at_zero_and_the_session_goes_on(make_robot: MakeRobot) -> None:
    for number in (C.SIM_RESET, C.RESETSIMTOORIGIN):
        robot = make_robot(lenient=True).open()
        robot.say(C.VEL, 200)
        robot.run(1000)
        robot.say(C.STOP)
        robot.run(1000)
        robot.say(number)
        assert robot.body.state.left_angle_rad == 0
        sip = robot.sip()
        assert (sip.raw_x, sip.raw_y, sip.raw_heading) == (0, 0, 0)
        assert robot.pioneer.state.open
        assert robot.pioneer.state.motors_enabled


def test_simstat_comes_once_or_each_cycle_or_no_more(make_robot: MakeRobot) -> None:
    robot = make_robot(lenient=True).open()
    robot.say(C.SIM_STAT)
    robot.run(500)
    assert len(of(robot, SimstatPacket)) == 1
    robot.say(C.SIM_STAT, 2)
    robot.run(500)
    assert len(of(robot, SimstatPacket)) == 5
    robot.say(C.SIM_STAT, 0)
    robot.run(500)
    assert of(robot, SimstatPacket) == []


@pytest.mark.parametrize(
    "setup",
    [
        [(C.SIM_LRF_SET_FOV_START, -90), (C.SIM_LRF_SET_FOV_END, 90), (C.SIM_LRF_SET_RES, 100), (C.SIM_LRF_ENABLE, 2)],
        [(36, -90), (37, 90), (38, 100), (35, 2)],
    ],
    ids=["simulators' own", "those that ARIA sends"],
)
@pytest.mark.parametrize("profile", list(Profile))
def test_a_sweep_of_181_readings_follows_each_packet(
    make_robot: MakeRobot, profile: Profile, setup: list[tuple[int, int]]
) -> None:
    robot = make_robot(profile=profile, laser=LMS).open()
    for number, value in setup:
        robot.say(number, value)
    robot.run(200)
    found = lasers(robot)
    assert [packet.first for packet in found] == [0, 32, 64, 96, 128, 160] * 2
    assert {packet.total for packet in found} == {181}
    assert all(packet.is_extended for packet in found)
    ranges = [range_mm for packet in found[:6] for range_mm in packet.ranges_mm]
    assert ranges == [1000 + ray for ray in range(181)]
    assert not robot.pioneer.state.ignored_commands


@pytest.mark.parametrize(("value", "packets"), [(-1, 0), (0, 0), (1, 1), (2, 5), (3, 0)])
def test_a_gripper_is_asked_beside_a_laser_but_where_its_field_ends(
    make_robot: MakeRobot, value: int, packets: int
) -> None:
    robot = make_robot(laser=LMS).open()

    def gripper_packets() -> int:
        robot.frames()
        robot.say(C.GRIPREQUEST, value)
        robot.run(500)
        return sum(frame.kind == 0xE0 for frame in robot.frames())

    def field() -> tuple[int, int]:
        laser = robot.pioneer._context.devices.laser
        return laser.start_deg, laser.end_deg

    assert gripper_packets() == packets
    assert field() == (LMS.start_deg, LMS.end_deg if value in {0, 1, 2} else value)
    robot.say(C.GRIPREQUEST, 0)
    robot.say(C.GRIPPERVAL, -45)
    assert gripper_packets() == 0
    assert field() == (-45, value)
    assert gripper_packets() == packets


def test_plain_laser_packets_carry_the_odometers_pose(make_robot: MakeRobot) -> None:
    robot = make_robot(laser=LMS).open()
    robot.say(C.VEL, 200)
    robot.run(1000)
    robot.say(C.SIM_LRF_ENABLE, 1)
    robot.run(100)
    found = lasers(robot)
    assert not found[0].is_extended
    assert found[0].raw_pose[0] > 50
    robot.say(C.SIM_LRF_ENABLE, 0)
    robot.run(300)
    assert lasers(robot) == []


def test_an_extended_sweep_says_once_that_the_robot_was_carried(make_robot: MakeRobot) -> None:
    robot = make_robot(lenient=True, laser=LMS).open()
    robot.say(C.SIM_LRF_ENABLE, 2)
    robot.say(C.SIM_SET_POSE, struct.pack("<iii", 100, 0, 0))
    robot.run(200)
    assert [packet.flags for packet in lasers(robot)] == [1] + [0] * 11


def test_without_a_laser_the_old_numbers_keep_their_meaning(make_robot: MakeRobot) -> None:
    robot = make_robot(profile=Profile.AROS, lenient=True).open()
    robot.say(C.ADSEL, 2)
    robot.say(C.SIM_LRF_ENABLE, 1)
    assert robot.sip().analog_port == 2
    assert "no laser" in robot.reported()
    assert lasers(robot) == []


def test_messages_are_shown_on_one_printable_line_and_an_exit_code_is_kept(make_robot: MakeRobot) -> None:
    robot = make_robot(lenient=True).open()
    robot.say(C.SIM_MESSAGE, b"big jump\x1b[2J\n\0hidden")
    robot.say(C.SIM_EXIT, 23)
    assert ("message", "big jump?[2J?") in [(what, detail) for _, what, detail in robot.events]
    assert robot.pioneer.exit_code == 23


def test_the_simulator_says_what_it_is_and_that_the_world_stays(make_robot: MakeRobot) -> None:
    robot = make_robot(lenient=True, laser=LMS).open()
    robot.say(C.SIM_CTRL, 6)
    robot.run(150)
    (info,) = of(robot, SiminfoPacket)
    assert [device.raw_name for device in info.devices] == [b"sonar", b"laser"]
    robot.say(C.LOADWORLD, b"office\0")
    robot.say(C.SIM_CTRL, struct.pack("<HH", 1, 6) + b"office")
    assert of(robot, MapChangedPacket) == [MapChangedPacket(status=2, raw_name=b"office")] * 2


@settings(max_examples=60)
@given(
    st.lists(st.tuples(st.sampled_from([35, 36, 37, 38, 230, 231, 232, 233]), st.integers(-32767, 65535)), max_size=8)
)
def test_whatever_a_client_sets_a_sweep_is_whole_and_bounded(
    make_robot: MakeRobot, commands: list[tuple[int, int]]
) -> None:
    robot = make_robot(laser=LMS).open()
    for number, value in commands:
        robot.say(number, value)
    robot.run(100)
    found = lasers(robot)
    if found:
        assert sum(len(packet.ranges_mm) for packet in found) == found[0].total <= MOST_READINGS


def test_a_client_may_add_the_number_of_a_laser(make_robot: MakeRobot) -> None:
    robot = make_robot(laser=LMS).open()
    robot.send(Frame(bytes((C.SIM_LRF_ENABLE, 0x3B, 2, 0, 0))).to_bytes())
    robot.run(100)
    assert len(lasers(robot)) == 6


def test_lasers_are_read_from_a_name_or_from_field_step_and_range() -> None:
    assert read_laser("LMS2xx") is LMS
    assert LMS.readings == 181
    assert read_laser("180deg,1deg,8m") == LaserModel(start_deg=-90, end_deg=90, step_cdeg=100, range_m=8.0)
    for text in ("lms", "180deg,1deg", "180deg,0.001deg,8m", "180deg,1deg,80m", "400deg,1deg,8m", "270deg,0.1deg,8m"):
        with pytest.raises(UsageError):
            read_laser(text)
    assert not Laser.of(None).is_fitted


def test_settings_for_aria_are_those_of_a_simulator_with_arcos() -> None:
    found = ControllerSettings.for_client("aria")
    assert (found.profile, found.serial, found.laser, found.lenient) == (Profile.ARCOS, "SIM", LMS, True)
    with pytest.raises(UsageError, match="no settings for 'saphira'"):
        ControllerSettings.for_client("saphira")


def test_a_command_with_data_reads_back_whatever_type_byte_it_had() -> None:
    wanted = Command(C.SIM_SET_POSE, bytes(range(12)))
    assert Command.from_frame(wanted.to_frame()) == wanted
    assert Command.from_frame(Frame(bytes((C.SIM_SET_POSE, 0)) + bytes(range(12)))) == wanted
    assert Command.from_frame(Command(C.SIM_CTRL, -6).to_frame()) == Command(C.SIM_CTRL, -6)
