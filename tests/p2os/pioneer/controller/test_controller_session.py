"""The session of a virtual robot: handshake, packets, watchdog, leaving, saving."""

import pickle
from collections.abc import Callable
from typing import Any

import pytest

from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.frames import Frame
from p2os.protocol.packets import Identity
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import STANDING
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, NS_PER_S, NS_PER_US

MakeRobot = Callable[..., Any]


def test_a_robot_answers_the_three_syncs_and_identifies_itself(robot: Any) -> None:
    for number in (0, 1):
        robot.say(number)
        assert [frame.payload for frame in robot.frames()] == [bytes([number])]
    robot.say(2)
    (frame,) = robot.frames()
    assert Identity.from_frame(frame) == Identity("Virtual", "Pioneer", "p2dx")
    assert not robot.pioneer.state.open


def test_nothing_is_due_before_the_session_is_open(robot: Any) -> None:
    assert robot.pioneer.next_deadline() is None
    robot.run(1000)
    assert robot.frames() == []
    assert robot.body.steps == 1000


@pytest.mark.parametrize("argument", [None, 1])
def test_packets_flow_every_cycle_from_open(robot: Any, argument: int | None) -> None:
    robot.run(12.5)
    for number in (0, 1, 2):
        robot.say(number)
    robot.say(C.OPEN, argument)
    robot.frames()
    # The first packet comes one cycle after OPEN, at 12.5 + 100 ms, and not before.
    assert robot.pioneer.next_deadline() == round(112.5 * NS_PER_MS)
    robot.run(100 - 0.000001)
    assert robot.sips() == []
    robot.run(0.000001)
    assert len(robot.sips()) == 1
    robot.run(900)
    assert len(robot.sips()) == 9
    assert robot.reported() == ["synchronised", "opened"]


def test_motors_are_off_on_a_new_connection_and_who_drives_is_notified(robot: Any) -> None:
    robot.open(motors=False)
    for _ in range(3):
        robot.say(C.VEL, 200)
    for number in (C.RVEL, C.VEL2):
        robot.say(number, 0)
    robot.run(1000)
    assert not robot.pioneer.state.motors_enabled
    assert robot.body.state.left_speed_mps == 0
    assert robot.pioneer.state.ignored_commands == 0
    waits = [detail for _, what, detail in robot.events if what == "command waits"]
    assert waits == ["VEL: motors are off (ENABLE 1 turns them on)"], "once, and not for being told to stand"


def test_a_speed_set_before_the_motors_are_on_holds_from_then(robot: Any) -> None:
    robot.open(motors=False)
    robot.say(C.VEL, 200)  # in the order in which p2os-arduino says it
    robot.say(C.ENABLE, 1)
    robot.run(1000)
    assert robot.body.state.left_speed_mps == 0.2


def test_switching_the_motors_off_stops_at_once_and_forgets(robot: Any) -> None:
    robot.open()
    robot.say(C.VEL, 200)
    robot.run(1000)
    assert robot.body.state.left_speed_mps == 0.2
    robot.say(C.ENABLE, 0)
    robot.run(1)
    assert robot.body.state.left_speed_mps == 0
    robot.say(C.ENABLE, 1)
    robot.run(500)
    assert robot.body.state.left_speed_mps == 0


def test_closing_stops_the_robot_and_its_packets(robot: Any) -> None:
    robot.open()
    robot.say(C.SETA, 1000)
    robot.say(C.POLLING, bytes([3]))
    robot.say(C.VEL, 200)
    robot.run(1000)
    robot.say(C.CLOSE, 1)
    robot.frames()
    robot.run(1)
    assert robot.body.state.left_speed_mps == 0
    assert not robot.pioneer.state.open
    assert not robot.pioneer.state.motors_enabled
    assert robot.pioneer.next_deadline() is None
    robot.run(1000)
    assert robot.frames() == []
    assert robot.reported()[-1] == "closed"


def test_what_a_client_has_set_is_lost_when_it_closes(robot: Any) -> None:
    robot.open()
    robot.say(C.SETA, 1000)
    robot.say(C.SONAR, 0)
    robot.say(C.CLOSE)
    robot.open()
    robot.say(C.VEL, 300)
    robot.run(500)
    assert robot.body.state.left_speed_mps == 0.15, "300 mm/s² again"
    assert robot.pioneer.state.sonar_on


def test_odometry_starts_at_the_origin_of_each_session(robot: Any) -> None:
    robot.open()
    robot.say(C.VEL, 300)
    robot.run(1900)
    assert robot.sip().raw_x > 0
    robot.say(C.CLOSE)
    robot.open()
    assert robot.sip().raw_x == 0


def test_opening_twice_changes_nothing(robot: Any) -> None:
    robot.open()
    robot.run(50)
    robot.say(C.OPEN, 1)
    assert robot.pioneer.next_deadline() == 100 * NS_PER_MS
    assert robot.pioneer.state.motors_enabled
    assert robot.reported().count("opened") == 1
    assert robot.pioneer.state.ignored_commands == 0


# The watchdog ----------------------------------------------------------------------------


def test_the_watchdog_stops_the_robot_after_two_silent_seconds_and_the_next_frame_resumes(robot: Any) -> None:
    robot.open()
    robot.say(C.VEL, 300)
    robot.run(2000 - 0.000001)
    assert "watchdog expired" not in robot.reported()
    assert robot.body.state.left_speed_mps == 0.3
    robot.run(0.000001)
    assert robot.events[-1][:2] == (2 * NS_PER_S, "watchdog expired")
    assert robot.pioneer.state.watchdog_expired
    # 300 mm/s at 300 mm/s² take a second to a stand.
    robot.run(999)
    assert robot.body.state.left_speed_mps > 0
    robot.run(1)
    assert robot.body.state.left_speed_mps == 0
    robot.run(5000)
    assert robot.body.state.left_speed_mps == 0
    assert len(robot.sips()) == 80, "packets go on"
    robot.say(C.PULSE)
    robot.run(1000)
    assert robot.body.state.left_speed_mps == 0.3
    assert robot.reported()[-1] == "watchdog revived"
    assert not robot.pioneer.state.watchdog_expired


@pytest.mark.parametrize("number", [C.STOP, C.E_STOP, C.CLOSE])
def test_a_robot_revived_by_a_stop_does_not_move(robot: Any, number: int) -> None:
    robot.open()
    robot.say(C.VEL, 300)
    robot.run(4000)
    assert robot.body.state.left_speed_mps == 0
    robot.say(number)
    for _ in range(20):
        robot.run(50)
        assert robot.body.state.left_speed_mps == 0


def test_any_frame_feeds_the_watchdog_and_noise_does_not(robot: Any) -> None:
    robot.open()
    robot.say(C.VEL, 100)
    for _ in range(5):
        robot.run(1900)
        robot.say(200)  # a command that nobody knows
    assert "watchdog expired" not in robot.reported()
    robot.run(1000)
    robot.send(b"\xfa\xfb\x06\x0b\x3b\xc8\x00\xd3\x00")  # a bad checksum
    robot.send(b"WMS2\r")
    robot.run(1000)
    assert "watchdog expired" in robot.reported()


# Odd but legal clients -------------------------------------------------------------------


def test_leading_garbage_and_single_bytes_are_understood(robot: Any) -> None:
    robot.send(b"WMS2\r\xfa")
    for byte in Frame(b"\0").to_bytes():
        robot.send(bytes([byte]))
    assert [frame.payload for frame in robot.frames()] == [b"\0"]


def test_noise_is_counted(robot: Any) -> None:
    robot.send(b"\xfa\xfb\x06\x0b\x3b\xc8\x00\xd3\x00")
    assert robot.pioneer.stats.wire.bad_checksums == 1
    robot.send(b"\xfa\xfb\x20")  # the beginning of a frame that never ends
    robot.run(300)
    assert robot.pioneer.next_deadline() is None, "it was given up after 250 ms"


def test_unknown_commands_are_counted_and_ignored(robot: Any) -> None:
    robot.open()
    for number in (C.BATTERYINFO, C.HOSTBAUD, 199):
        robot.say(number, 1)
    robot.say(C.VEL)  # no number to drive at
    robot.say(C.VEL, b"fast")
    robot.say(C.VEL2, b"xy")
    robot.say(C.SONAR)
    robot.say(C.POLLING, 3)
    assert robot.pioneer.state.ignored_commands == 8
    robot.run(200)
    assert len(robot.sips()) == 2


def test_a_position_reset_with_a_lone_type_byte_works(robot: Any) -> None:
    robot.open()
    robot.say(C.VEL, 300)
    robot.run(1000)
    robot.send(bytes.fromhex("fafb04073b073b"))  # player's SETO
    assert robot.pioneer.state.x_mm == 0


@pytest.mark.parametrize("argument", [None, 1])
def test_a_robot_reports_its_configuration(make_robot: MakeRobot, profile: Profile, argument: int | None) -> None:
    robot = make_robot(profile=profile, name="Wilma").open()
    robot.say(C.SETV, 400)
    robot.say(C.CONFIG, argument)
    (frame,) = robot.frames()
    config = ConfigPacket.from_frame(frame)
    assert (config.robot_class, config.subclass, config.name) == ("Pioneer", "p2dx", "Wilma")
    assert (config.rotveltop, config.transveltop, config.transvelmax) == (500, 2200, 400)
    assert (config.transacc, config.transdecel, config.rotacc, config.rotdecel) == (300, 300, 100, 100)
    assert (config.sipcycle, config.watchdog) == (100, 2000)
    assert config.autobaud == (0 if profile is Profile.P2OS else 1), "HOSTBAUD works, and nobody need use it"
    assert config.fields_sent == {Profile.P2OS: 36, Profile.AROS: 42, Profile.ARCOS: 67}[profile]


# The host's hang-up ----------------------------------------------------------------------


def test_a_hang_up_stops_at_once_and_frees_the_robot(robot: Any) -> None:
    robot.open()
    robot.say(C.VEL, 300)
    robot.run(1000)
    robot.send(b"\xfa\xfb\x06")  # a frame cut in the middle must not spoil the next client's
    robot.pioneer.hang_up(robot.now)
    assert robot.frames() == []
    robot.run(1)
    assert robot.body.state.left_speed_mps == 0
    assert robot.events[-1][1:] == ("closed", "line dropped")
    robot.open()
    assert robot.sip().kind == STANDING
    robot.say(C.CLOSE)
    robot.pioneer.hang_up(robot.now)
    assert robot.reported().count("closed") == 2, "nothing more to close"


# Time and saving -------------------------------------------------------------------------

#: Half a second of watchdog keeps the script short; it bites once, from 1.0 s on.
WATCHDOG_NS = NS_PER_S // 2
SCRIPT = (
    (0, C.PULSE, None), (1_234_567, 1, None), (2_000_001, 2, None), (3_500_000, 1, None),
    (4_000_000, C.ENABLE, 1), (5_000_017, C.VEL, 300), (177_777_777, C.RVEL, 40), (300_000_000, C.VEL2, 2570),
    (400_000_000, C.SONAR, 0), (450_500_000, C.SONAR, 1), (1_150_000_000, C.PULSE, None),
    (1_270_000_000, C.HEAD, 90), (1_457_000_000, C.MOVE, -200), (1_690_000_000, C.STOP, None),
)  # fmt: skip
END = 1_800_000_000


def play(robot: Any, slice_ns: int, *, begin: int = 0, end: int = END) -> list[tuple[int, bytes]]:
    """Play the script in slices; returns every frame with the time at which it came."""
    said, now = [], begin

    def collect() -> None:
        said.extend((now, data) for data in robot.pioneer.take_output())

    for at, number, argument in [row for row in SCRIPT if begin <= row[0] < end] + [(end, None, None)]:
        while now < at:
            due = robot.pioneer.next_deadline()
            now = min(now + slice_ns, at) if due is None else min(now + slice_ns, at, max(due, now))
            robot.pioneer.advance_to(now)
            collect()
        robot.now = now
        if number is not None:
            robot.say(number, argument)
            collect()
    return said


@pytest.mark.parametrize("slice_ns", [NS_PER_MS, 100 * NS_PER_US, 3 * NS_PER_MS + 7, 10 * NS_PER_S])
def test_results_do_not_depend_on_the_slices(make_robot: MakeRobot, slice_ns: int) -> None:
    reference, sliced = (make_robot(watchdog_ns=WATCHDOG_NS) for _ in range(2))
    assert play(sliced, slice_ns) == play(reference, 10 * NS_PER_MS)
    assert sliced.body.state == reference.body.state
    assert sliced.events == reference.events
    assert {"watchdog expired", "watchdog revived"} <= set(sliced.reported())
    assert sliced.pioneer.snapshot() == reference.pioneer.snapshot()


@pytest.mark.parametrize("cut", [1, 2_500_000, 49_000_000, 440_000_000, 1_100_000_000, 1_500_000_000])
def test_a_robot_restored_half_way_goes_on_the_same(make_robot: MakeRobot, cut: int) -> None:
    original, twin = (make_robot(watchdog_ns=WATCHDOG_NS) for _ in range(2))
    play(original, NS_PER_MS, end=cut)
    twin.pioneer.restore(pickle.loads(pickle.dumps(original.pioneer.snapshot())))  # noqa: S301 - our own bytes
    twin.now = original.now
    assert play(twin, NS_PER_MS, begin=cut) == play(original, NS_PER_MS, begin=cut)
    assert twin.body.state == original.body.state
    assert twin.pioneer.state == original.pioneer.state


def test_a_command_acts_from_the_first_step_at_or_after_its_time(robot: Any) -> None:
    robot.open()
    robot.run(10.4)
    robot.say(C.VEL, 300)
    # Received at 10.4 ms: the step from 10 to 11 ms is the old one's.
    assert robot.body.steps == 11
    assert robot.body.state.left_speed_mps == 0
    robot.run(0.7)
    assert robot.body.steps == 12
    assert robot.body.state.left_speed_mps > 0


@pytest.mark.parametrize("wrong", [{"sip_period_ns": 0}, {"sip_period_ns": NS_PER_S}, {"battery_decivolts": 300}])
def test_settings_that_the_packets_cannot_carry_are_refused(make_robot: MakeRobot, wrong: dict[str, int]) -> None:
    with pytest.raises(UsageError):
        make_robot(**wrong)
