"""Every command of the table, to every firmware: known ones act, others are counted, none kills the robot."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.pioneer.controller.commands import HANDLERS
from p2os.pioneer.devices.heading_sensors import COMPASS_NS, CompassMode
from p2os.protocol.command_table import ROWS, Argument, CommandRow
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.frames import Frame
from p2os.protocol.profiles import Profile
from p2os.protocol.times import CYCLE_NS
from tests.p2os.conftest import context_of
from tests.tools.each_row import each_row

MakeRobot = Callable[..., Any]

#: What this robot does not know at all; CLOSE is the connection's own.
PAST_HANDLERS = {row.number for row in ROWS if row.number not in HANDLERS and row.number is not C.CLOSE}


def an_argument(row: CommandRow) -> int | bytes | None:
    kind = row.kind
    if kind is Argument.NONE:
        return None
    if kind in {Argument.STRING, Argument.DATA}:
        return b"\x01\x02"
    least, most = row.limits(kind)
    return min(max(1, least), most)


def reported(robot: Any, what: str) -> list[str]:
    return [detail for _, reported, detail in robot.events if reported == what]


@each_row("row", ROWS, ids=lambda row: row.name)
def test_a_command_is_obeyed_by_the_families_whose_manual_lists_it(
    make_robot: MakeRobot, profile: Profile, row: CommandRow
) -> None:
    robot = make_robot(profile=profile).open()
    robot.say(row.number, an_argument(row))
    robot.run(300)
    is_ignored = f"{row.name}: unknown" in reported(robot, "command ignored")
    if row.is_known_to(profile) is False:
        assert is_ignored
    elif row.number in HANDLERS or row.number is C.CLOSE:
        assert not is_ignored
    else:
        assert is_ignored, "counted: this robot has no such part"


@each_row("row", ROWS, ids=lambda row: row.name)
def test_a_lenient_robot_obeys_whatever_any_family_knows(make_robot: MakeRobot, row: CommandRow) -> None:
    robot = make_robot(lenient=True).open()
    robot.say(row.number, an_argument(row))
    assert (f"{row.name}: unknown" in reported(robot, "command ignored")) is (row.number in PAST_HANDLERS)


def test_what_has_no_handler_is_of_no_family_of_pioneers() -> None:
    """Each is the Seekur's, a PatrolBot's, a simulator's, or never seen in a manual of these."""
    for row in ROWS:
        if row.number in PAST_HANDLERS and not row.is_simulator_only:
            assert {row.is_known_to(profile) for profile in Profile} <= {False, None}, row.name


@given(
    number=st.integers(3, 255),
    argument=st.one_of(st.none(), st.integers(-32767, 65535), st.binary(max_size=199)),
    profile=st.sampled_from(Profile),
)
def test_no_command_kills_the_robot(
    make_robot: MakeRobot, number: int, argument: int | bytes | None, profile: Profile
) -> None:
    robot = make_robot(profile=profile).open()
    robot.say(number, argument)
    robot.run(250)
    if number in {C.RESET, C.MAINTENANCE} and robot.pioneer.state.open is False:
        return
    assert robot.sips(), "packets go on"


@each_row("row", [row for row in ROWS if row.kind is not Argument.NONE and row.number in HANDLERS])
def test_a_command_without_its_argument_has_no_effect(make_robot: MakeRobot, row: CommandRow) -> None:
    robot = make_robot(lenient=True).open()
    before = context_of(robot.pioneer)
    robot.say(row.number)
    if f"{row.name}: {'malformed'}" in reported(robot, "command ignored"):
        assert context_of(robot.pioneer) == before


@each_row("row", [row for row in ROWS if row.number in HANDLERS], ids=lambda row: row.name)
def test_a_handler_takes_each_argument_that_its_description_names(make_robot: MakeRobot, row: CommandRow) -> None:
    for kind in row.kinds:
        least, most = (0, 0) if kind is Argument.NONE else row.limits(kind)
        value: int | bytes | None = min(max(1, least), most)
        if kind is Argument.NONE:
            value = None
        elif kind in {Argument.STRING, Argument.DATA}:
            value = b"\x01" * max(least, min(2, most))
        robot = make_robot(lenient=True).open()
        robot.say(row.number, value)
        assert f"{row.name}: malformed" not in reported(robot, "command ignored"), kind


EXTRAS = [
    (C.ENCODER, 0x90, Profile.AROS), (C.IOREQUEST, 0xF0, Profile.P2OS), (C.GRIPREQUEST, 0xE0, Profile.P2OS),
    (C.JOYREQUEST, 0xF8, Profile.ARCOS),
]  # fmt: skip


@pytest.mark.parametrize(("number", "kind", "profile"), EXTRAS)
def test_an_extra_packet_comes_once_always_or_no_more(
    make_robot: MakeRobot, number: int, kind: int, profile: Profile
) -> None:
    robot = make_robot(profile=profile).open()

    def count(milliseconds: int) -> int:
        robot.frames()
        robot.run(milliseconds)
        return sum(frame.kind == kind for frame in robot.frames())

    robot.say(number, 1)
    assert count(500) == 1
    robot.say(number, 2)
    assert count(500) == 5
    robot.say(number, 0)
    assert count(500) == 0


@pytest.mark.parametrize("profile", [Profile.AROS, Profile.ARCOS])
def test_gyro_and_joystick_go_before_the_standard_packet_on_arcos_alone(
    make_robot: MakeRobot, profile: Profile
) -> None:
    robot = make_robot(profile=profile).open()
    for number in (C.GYRO, C.JOYREQUEST, C.IOREQUEST):
        robot.say(number, 2 if number is not C.GYRO else 1)
    robot.run(100)
    robot.frames()
    robot.run(100)
    kinds = [frame.kind for frame in robot.frames()]
    if profile is Profile.ARCOS:
        assert kinds == [0x98, 0xF8, 0x32, 0xF0]
    else:
        assert kinds == [0x32, 0x98, 0xF8, 0xF0]


def test_gyro_readings_come_four_a_packet_and_show_the_turn(make_robot: MakeRobot) -> None:
    robot = make_robot(profile=Profile.ARCOS).open()
    robot.say(C.GYRO, 1)
    robot.run(200)
    robot.frames()
    robot.run(100)
    (gyro,) = [frame for frame in robot.frames() if frame.kind == 0x98]
    assert gyro.data[0] == 4, "one each 25 ms"


def test_digital_outputs_change_where_the_mask_says(robot: Any) -> None:
    robot.open()
    robot.say(C.DIGOUT, 0x0F_05)  # mask 0F, states 05
    assert robot.sip().digital_out == 0xF5
    robot.say(C.DIGOUT, -0xAB)  # as ARIA packs FF, 55: the sign is undone before the bytes part
    assert robot.sip().digital_out == 0x55


def test_an_analog_port_is_selected_and_shown(robot: Any) -> None:
    robot.open()
    robot.pioneer.do("analog 3 1023", robot.now)
    robot.say(C.ADSEL, 3)
    packet = robot.sip()
    assert (packet.analog_port, packet.raw_analog) == (3, 255)
    robot.say(C.ADSEL, 99)
    assert robot.sip().analog_port == 3, "there is no port 99"


def test_bytes_pass_through_an_aux_port_both_ways(robot: Any) -> None:
    robot.open()
    robot.say(C.TTY2, b"RS\r")
    assert robot.pioneer.take_aux_output(1) == b"RS\r"
    robot.say(C.GETAUX, 4)
    robot.pioneer.receive_aux(1, b"OK", robot.now)
    robot.run(200)
    assert all(frame.kind != 0xB0 for frame in robot.frames()), "two bytes are not four"
    robot.pioneer.receive_aux(1, b"12345", robot.now)
    robot.run(100)
    (answer,) = [frame for frame in robot.frames() if frame.kind == 0xB0]
    assert answer.data == b"OK12"


def test_a_gripper_closes_lifts_and_feels_what_it_holds(make_robot: MakeRobot) -> None:
    from p2os.pioneer.controller.flash import FlashParameters

    robot = make_robot(flash=FlashParameters().with_values({"gripper": 1})).open()
    start = robot.sip().gripper_state
    robot.pioneer.do("thing on", robot.now)
    robot.say(C.GRIPPER, 7)  # store: close and lift
    moving = robot.sip().gripper_state
    robot.run(4000)
    held = robot.sip().gripper_state
    assert len({start, moving, held}) == 3
    robot.say(C.GRIPPER, 8)
    robot.pioneer.do("thing off", robot.now)
    robot.run(4000)
    assert robot.sip().gripper_state == start


@pytest.mark.parametrize(("kind", "shown"), [(1, True), (2, False)])
def test_a_gripper_on_the_users_inputs_shows_its_switches_there(make_robot: MakeRobot, kind: int, shown: bool) -> None:
    """ARIA reads paddles and lift of such a gripper from DIGIN, which stood still: it never closed."""
    from p2os.pioneer.controller.flash import FlashParameters

    robot = make_robot(flash=FlashParameters().with_values({"gripper": kind})).open()
    for number in (8, 7):  # deploy, store
        robot.say(C.GRIPPER, number)
        robot.run(4000)
        sip = robot.sip()
        assert (sip.digital_in & 0x3F == sip.gripper_state & 0x3F) is shown
        assert sip.digital_in & 0xC0 == 0
        robot.say(C.IOREQUEST, 1)
        robot.run(200)
        (answer,) = [frame for frame in robot.frames() if frame.kind == 0xF0]
        assert answer.data[1] == sip.digital_in


def test_the_stick_drives_while_its_button_is_held(robot: Any) -> None:
    robot.open()
    robot.say(C.JOYDRIVE, 1)
    robot.pioneer.do("joystick 512 1023 1", robot.now)
    robot.run(1900)
    assert robot.pioneer.state.left_setpoint_mps > 0.3
    robot.pioneer.do("joystick 512 1023 0", robot.now)
    robot.run(1900)
    assert robot.pioneer.state.left_setpoint_mps == 0


def test_a_compass_reads_clockwise_from_the_worlds_x_axis(robot: Any) -> None:
    from dataclasses import replace
    from math import radians

    robot.open()
    robot.body.state = replace(robot.body.state, heading_rad=radians(90))
    assert robot.sip().raw_compass == 0, "it is off"
    robot.say(C.TCM2, 1)
    robot.run(300)
    assert robot.sip().raw_compass == 135, "270 degrees, in steps of 2"
    robot.say(C.TCM2, 2)
    robot.run(100)
    assert [frame.kind for frame in robot.frames()].count(0xC0) == 1


def test_a_compass_is_read_as_often_as_it_has_a_new_reading(robot: Any) -> None:
    robot.open()
    compass = robot.pioneer._context.devices.compass

    def readings(ms: int) -> list[int]:
        seen = [compass.read_ns]
        for _ in range(ms // 10):
            robot.run(10)
            seen.append(compass.read_ns)
        return sorted({*seen[1:]} - {seen[0]})

    assert readings(1_000) == [], "it is off"
    robot.say(C.TCM2, 1)
    for mode in (CompassMode.IN_SIP, CompassMode.CONTINUOUS):
        robot.say(C.TCM2, mode)
        at = readings(2_000)
        # At the first packet after its period, 100 ms apart.
        assert {later - sooner for sooner, later in pairwise(at)} == {-(-COMPASS_NS // CYCLE_NS) * CYCLE_NS}
        assert len(at) >= 2_000 * 1_000_000 // (COMPASS_NS + CYCLE_NS)


@pytest.mark.parametrize(("mm", "nm"), [(1.0000016, 1_000_002), (1.0000014, 1_000_001), (-1.0000016, -1_000_002)])
def test_the_way_is_counted_to_the_nearest_nanometre(robot: Any, mm: float, nm: int) -> None:
    context = robot.pioneer._context
    context.reckoning.travel_mm = mm
    assert context.travel_nm == nm
    context.reckoning.turned_rad = mm
    assert context.heading_udeg == round(mm * 180_000_000 / 3.141592653589793)


def test_after_a_reset_the_robot_receives_nothing_until_its_notice(make_robot: MakeRobot) -> None:
    robot = make_robot(lenient=True).open()
    robot.say(C.VEL, 200)
    robot.run(500)
    robot.say(C.RESET)
    robot.frames()
    assert not robot.pioneer.state.motors_enabled
    robot.say(0)
    assert robot.frames() == []
    robot.run(499)
    assert robot.frames() == []
    robot.run(1)
    assert [frame.kind for frame in robot.frames()] == [0xFF]
    robot.open()
    assert robot.sip() is not None


def test_maintenance_lasts_until_a_reboot(make_robot: MakeRobot) -> None:
    robot = make_robot(lenient=True).open()
    robot.say(C.MAINTENANCE)
    robot.frames()
    robot.run(60_000)
    assert robot.frames() == []
    assert robot.pioneer.next_deadline() is None
    robot.pioneer.do("fault reboot", robot.now)
    robot.run(500)
    assert [frame.kind for frame in robot.frames()] == [0xFF]


def test_a_pressed_bumper_stalls_the_way_it_looks(make_robot: MakeRobot) -> None:
    robot = make_robot().open()
    robot.say(C.BUMPSTALL, 1)
    robot.say(C.VEL, 200)
    robot.run(1000)
    robot.pioneer.do("fault bumper front 3", robot.now)
    robot.run(40)
    assert robot.pioneer.state.left_setpoint_mps == 0
    packet = robot.sip()
    assert packet.stall_left
    assert packet.stall_right
    assert packet.front_bumpers == 1 << 2
    robot.say(C.VEL, -200)
    robot.run(1000)
    assert robot.pioneer.state.left_setpoint_mps < 0, "backwards is free"


def test_a_test_of_the_battery_shows_until_the_client_leaves(make_robot: MakeRobot) -> None:
    robot = make_robot(profile=Profile.ARCOS).open()
    robot.say(C.BATTEST, 99)
    assert robot.sip().raw_battery == 99
    robot.say(C.CLOSE)
    robot.frames()
    robot.open()
    assert robot.sip().raw_battery == 126


def test_frames_with_lying_lengths_do_not_read_past_their_end(robot: Any) -> None:
    robot.open()
    for payload in (bytes([C.TTY2]) + b"\x2b\xc7AB", bytes([C.POLLING]) + b"\x2b", bytes([C.VEL]) + b"\x3b\x01"):
        robot.send(Frame(payload).to_bytes())
    assert robot.sip() is not None
    assert len(robot.pioneer.take_aux_output(1)) <= 2
