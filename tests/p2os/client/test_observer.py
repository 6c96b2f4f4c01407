"""Packets folded into states, poses that go on, and limits and families that are told or guessed."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.client.core import RobotCore
from p2os.client.goals import DriveAxis, TurnAxis
from p2os.client.mover import MotorState
from p2os.client.notices import OdometryDoubtful, PacketArrived, RobotUnknown
from p2os.client.observer import Firmware, Observer, PoseKeeper, bumpers_of, limits_of
from p2os.client.robot_state import RobotPose
from p2os.client.settings import ClientSettings
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.config_packet import AROS_1_6_FIELDS, AROS_1_8_FIELDS, P2OS_FIELDS, ConfigPacket
from p2os.protocol.packets import RawPacket
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.parameters import ParametersError, RobotParameters
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.client.client_rig import Rig, new_pioneer, parameters

P2DX = parameters()


def test_a_state_is_the_packet_in_si_units() -> None:
    observer = Observer(P2DX)
    state = observer.take(
        StandardSip(
            raw_left_velocity=100, raw_right_velocity=300, raw_battery=126, stall_right=True, kind=0x33,
            front_bumpers=0x7F, raw_compass=45, raw_analog=255, analog_port=5, digital_in=1, digital_out=2,
            sonar=(SonarReading(3, 4000), SonarReading(0, 32000), SonarReading(200, 1)),
        ),
        7,
    )  # fmt: skip
    assert (state.forward_mps, state.left_mps, state.right_mps) == (0.2, 0.1, 0.3)
    assert state.turn_radps == pytest.approx(0.2 / 0.357)
    assert (state.battery_v, state.is_moving, state.is_stalled, state.stall_left) == (12.6, True, True, False)
    assert state.front_bumpers == (), "no bumpers are fitted: floating inputs are no collision"
    assert state.compass_rad == pytest.approx(math.pi / 2)
    assert (state.analog_v, state.analog_port, state.digital_in, state.digital_out) == (5.0, 5, 1, 2)
    assert state.motors_enabled is None
    assert state.stop_button is None
    assert [echo.number for echo in state.sonar] == [0, 3], "a sonar that the model does not have is not placed"
    far, near = state.sonar
    assert not far.is_echo
    assert near.is_echo
    assert near.range_m == pytest.approx(1.072)
    # Sonar 3 sits at (166, 27) mm and looks 10 degrees to the left.
    assert near.x_m == pytest.approx(0.166 + 1.072 * math.cos(math.radians(10)))
    assert near.y_m == pytest.approx(0.027 + 1.072 * math.sin(math.radians(10)))
    assert state.nearest() == near
    assert state.nearest(math.radians(90), math.radians(180)) is None


def test_a_sonar_keeps_its_last_reading_until_the_next() -> None:
    observer = Observer(P2DX)
    observer.take(StandardSip(sonar=(SonarReading(1, 1000),)), 5)
    state = observer.take(StandardSip(sonar=(SonarReading(2, 2000),), raw_compass=181), 9)
    assert [(echo.number, echo.at_ns) for echo in state.sonar] == [(1, 5), (2, 9)]
    assert state.number == 2
    assert state.compass_rad is None
    observer.new_session(P2DX)
    assert observer.take(StandardSip(), 10).sonar == ()


@pytest.mark.parametrize(
    ("axis", "far_mm_s", "is_standing"),
    [(DriveAxis(1.0), 9, True), (DriveAxis(1.0), 10, False), (DriveAxis(1.0), -9, True), (DriveAxis(1.0), -10, False)],
)
def test_a_robot_on_its_way_stands_below_a_centimetre_a_second(
    axis: DriveAxis, far_mm_s: int, is_standing: bool
) -> None:
    """Of the faster wheel, whichever that is."""
    for left, right in ((far_mm_s, 0), (0, far_mm_s), (far_mm_s, far_mm_s), (far_mm_s, -far_mm_s)):
        state = replace(Observer(P2DX).take(StandardSip(), 0), left_mps=left / 1000, right_mps=right / 1000)
        assert axis.is_standing(state) is is_standing


def test_flags_and_the_tail_are_read_where_the_family_has_them() -> None:
    observer = Observer(P2DX, Profile.ARCOS)
    state = observer.take(StandardSip(raw_flags=0b100001, tail=(130, 0, 0, 0, 0, 25, 80)), 0)
    assert state.motors_enabled is True
    assert state.stop_button is True
    assert state.state_of_charge == 0.8
    assert state.temperature_c == 25.0
    for raw, said in ((-128, None), (-127, None), (-126, -126.0), (0, 0.0)):
        cold = observer.take(StandardSip(tail=(130, 0, 0, 0, 0, raw)), 0)
        assert cold.temperature_c == said
        assert cold.motors_enabled is False


@pytest.mark.parametrize(("fitted", "pressed"), [(5, (1, 3)), (0, ()), (2, (1,))])
def test_bumpers_are_those_that_are_fitted(fitted: int, pressed: tuple[int, ...]) -> None:
    observer = Observer(P2DX)
    observer.bumpers = bumpers_of(ConfigPacket(frontbumps=fitted, fields_sent=AROS_1_6_FIELDS))
    assert observer.take(StandardSip(front_bumpers=0b0000101), 0).front_bumpers == pressed
    assert bumpers_of(ConfigPacket(frontbumps=5)).front == 0


def test_limits_are_the_configurations_below_the_models() -> None:
    own = limits_of(P2DX, None)
    assert (own.forward_mps, own.accel_mps2) == (0.75, 0.3)
    reported = limits_of(P2DX, ConfigPacket(transvelmax=400, rotvelmax=60, transacc=250, rotdecel=80))
    assert (reported.forward_mps, reported.accel_mps2, reported.decel_mps2) == (0.4, 0.25, 0.3)
    assert reported.turn_radps == pytest.approx(math.radians(60))
    assert reported.turn_decel_radps2 == pytest.approx(math.radians(80))
    assert limits_of(P2DX, ConfigPacket(transvelmax=9999)).forward_mps == 2.2, "simulators send 9999"


@given(steps=st.lists(st.tuples(st.integers(-16000, 16000), st.integers(-16000, 16000), st.integers(-2000, 2000))))
def test_the_pose_follows_any_step_up_to_half_of_a_counter(steps: list[tuple[int, int, int]]) -> None:
    keeper = PoseKeeper()
    x = y = heading = 0
    pose = keeper.take(StandardSip(), P2DX, 0)
    for dx, dy, turn in steps:
        x, y, heading = x + dx, y + dy, heading + turn
        raw = (heading + 2048) % 4096 - 2048
        pose = keeper.take(StandardSip(raw_x=x & 0x7FFF, raw_y=y & 0x7FFF, raw_heading=raw), P2DX, 0)
    assert pose.x_m == pytest.approx(x * 0.00084)
    assert pose.y_m == pytest.approx(y * 0.00084)
    assert pose.heading_rad == pytest.approx(heading * 2 * math.pi / 4096)


def test_the_heading_does_not_drift_over_ten_thousand_turns() -> None:
    keeper = PoseKeeper()
    quarters = [StandardSip(raw_heading=quarter * 1024 - 2048) for quarter in range(4)]
    for step in range(4 * 10_000 + 1):
        pose = keeper.take(quarters[step % 4], P2DX, 0)
    assert pose.heading_rad == pytest.approx(10_000 * 2 * math.pi, abs=1e-9)


def test_a_pose_goes_on_over_sessions_and_places() -> None:
    keeper = PoseKeeper()
    keeper.take(StandardSip(), P2DX, 0)
    keeper.take(StandardSip(raw_x=1000, raw_heading=1024), P2DX, 0)
    keeper.new_session()
    keeper.take(StandardSip(), P2DX, 0)
    pose = keeper.take(StandardSip(raw_x=500), P2DX, 0)
    # The robot stood at 0.84 m looking left; its new odometry calls that ahead.
    assert (pose.x_m, pose.y_m) == pytest.approx((0.84, 0.42))
    assert pose.heading_rad == pytest.approx(math.pi / 2)
    keeper.place(RobotPose(10.0, 0.0, 0.0))
    pose = keeper.take(StandardSip(raw_x=1000), P2DX, 0)
    assert (pose.x_m, pose.y_m) == pytest.approx((10.42, 0.0))
    assert keeper.odometry.heading_rad == 0.0


def test_a_turn_counts_in_the_robots_own_frame_after_set_pose() -> None:
    rig = Rig().connect()
    rig.core.set_pose(RobotPose(1.0, 2.0, math.radians(45)))
    rig.run(0.2)
    assert rig.core.state is not None
    assert rig.core.state.pose == RobotPose(1.0, 2.0, math.radians(45))
    goal = rig.core.begin_goal(TurnAxis(math.radians(-90)), None, None, rig.now)
    rig.until(lambda: goal.ended is not None)
    assert Command(CommandNumber.HEAD, 270) in rig.commands()
    assert math.degrees(rig.core.state.pose.heading_rad) == pytest.approx(-45, abs=2)


def test_a_model_that_nobody_knows_gets_a_stand_in_and_a_word() -> None:
    rig = Rig()
    rig.pioneer._connection._side._identity = replace(rig.pioneer._connection._side._identity, subclass="Zorg-9")  # type: ignore[union-attr]
    rig.connect()
    assert rig.notices(RobotUnknown) == [RobotUnknown("Zorg-9", "p2dx")]
    assert rig.core.parameters.subclass == "p2dx"


def test_parameters_that_are_given_are_used_and_others_are_loaded_by_name() -> None:
    def nothing(name: str) -> RobotParameters:
        if name != "p2dx":
            raise ParametersError(name)
        return P2DX

    given_core = RobotCore(ClientSettings(), parameters=replace(P2DX, track_mm=400))
    assert given_core.parameters.track_mm == 400
    rig = Rig(pioneer=new_pioneer("p3dx"))
    rig.core = RobotCore(ClientSettings(), load=nothing)
    rig.connect()
    assert rig.notices(RobotUnknown)


def test_a_tail_shows_the_family_whatever_the_model_is_called() -> None:
    rig = Rig(pioneer=new_pioneer(profile=Profile.ARCOS)).connect()
    assert rig.core.profile is Profile.ARCOS
    assert rig.core.state is not None
    assert rig.core.state.motors_enabled is False
    reported = Rig(settings=ClientSettings(profile=Profile.AROS), pioneer=new_pioneer(profile=Profile.ARCOS)).connect()
    assert reported.core.profile is Profile.AROS


def test_packets_of_other_kinds_come_through() -> None:
    rig = Rig().connect()
    rig.pioneer._connection.send(RawPacket(0x99, b"abc"), rig.now)
    rig.run(0.2)
    (notice,) = rig.notices(PacketArrived)
    assert notice.packet == RawPacket(0x99, b"abc")
    assert rig.now - 200 * NS_PER_MS <= notice.at_ns <= rig.now


@pytest.mark.parametrize(
    ("change", "text"),
    [({"refresh_ns": 0}, "refresh_ns = 0 must be positive"), ({"deadman_ns": -1}, "or None"),
     ({"raise_baud": 1200}, "no rate of HOSTBAUD")],
)  # fmt: skip
def test_a_setting_out_of_range_is_refused(change: dict[str, int], text: str) -> None:
    with pytest.raises(UsageError, match=text):
        ClientSettings(**change)  # type: ignore[arg-type]


def test_motors_that_the_stop_button_took_off_say_whether_it_is_still_pressed() -> None:
    observer, motors = Observer(P2DX, Profile.ARCOS), MotorState()

    def flags(bits: int, now: int) -> str | None:
        return motors.take(observer.take(StandardSip(raw_flags=bits), now), now)

    motors.ask(on=True, now=0)
    assert flags(0b000001, NS_PER_S) is None
    assert flags(0b100000, 2 * NS_PER_S) == "the STOP button is pressed"
    assert flags(0b100000, 3 * NS_PER_S) is None, "once"
    assert motors.taken_off == "the STOP button is pressed"
    assert flags(0, 4 * NS_PER_S) is None
    assert motors.taken_off == "the STOP button was pressed"
    motors.ask(on=True, now=5 * NS_PER_S)
    assert flags(0b000001, 6 * NS_PER_S) is None
    assert flags(0, 7 * NS_PER_S) == "they were switched off at the robot"


@pytest.mark.parametrize(("gap_s", "is_doubtful"), [(0.1, False), (1.5, False), (1.9, True), (19.0, True)])
def test_a_gap_in_which_the_robot_could_have_turned_half_round_is_noted(gap_s: float, is_doubtful: bool) -> None:
    rig = Rig(settings=ClientSettings(liveness_ns=30 * NS_PER_S)).connect()
    rig.run(1)
    # 100 deg/s turn half round in 1.8 s.
    observer, now = rig.core._observer, rig.now
    observer.take(StandardSip(), now)
    observer.take(StandardSip(), now + round(gap_s * NS_PER_S))
    assert (observer.doubtful_gap_ns(rig.core.limits) is not None) is is_doubtful
    assert rig.notices(OdometryDoubtful) == []
    rig.is_cut = True
    rig.run(gap_s)
    rig.is_cut = False
    rig.run(0.5)
    assert bool(rig.notices(OdometryDoubtful)) is is_doubtful


# Which firmware's packets these are ---------------------------------------------------------

P2OS_CONFIG, AROS_CONFIG = ConfigPacket(fields_sent=P2OS_FIELDS), ConfigPacket(fields_sent=AROS_1_8_FIELDS)
TAIL = (130, 0, 0, 0, 0, -127)
#: As a packet stands on the wire: the two bytes behind the sonar, P2OS' order and the order of those that followed.
PORT_FIRST, GRIPPER_FIRST = (5, 0), (0, 5)


def judged(hint: Profile, *evidence: object, given: Profile | None = None) -> Firmware:
    """Return what is known after packets, pairs of bytes, words of flags (`int`) and ENABLE (`bool`)."""
    firmware = Firmware(given)
    firmware.new_session(hint)
    first, second = 0, 0
    for item in evidence:
        match item:
            case ConfigPacket() | None:
                firmware.take_config(item)
            case bool():
                firmware.take_motors_asked(item)
            case "servo":
                firmware.take_servo_set()
            case _:
                first, second = item if isinstance(item, tuple) and len(item) == 2 else (first, second)
                gripper, port = (first, second) if firmware.profile.has_gripper_first else (second, first)
                tail = item if isinstance(item, tuple) and len(item) > 2 else ()
                word = item if isinstance(item, int) else 0
                firmware.take(StandardSip(gripper_state=gripper, analog_port=port, raw_flags=word, tail=tail))
    return firmware


@pytest.mark.parametrize("hint", list(Profile))
@pytest.mark.parametrize(
    ("evidence", "profile", "tells_motors"),
    [
        ([TAIL], Profile.ARCOS, True),
        ([AROS_CONFIG], Profile.AROS, True),
        ([ConfigPacket(fields_sent=P2OS_FIELDS + 1)], Profile.AROS, True),
        ([ConfigPacket(fields_sent=AROS_1_8_FIELDS + 1)], Profile.ARCOS, True),
        ([AROS_CONFIG, TAIL], Profile.ARCOS, True),
        ([TAIL, P2OS_CONFIG], Profile.ARCOS, True),
        ([PORT_FIRST, P2OS_CONFIG], Profile.P2OS, False),
        ([PORT_FIRST, 0, True, 1, 0], Profile.P2OS, False),
        ([PORT_FIRST, AROS_CONFIG], Profile.AROS, True),
    ],
)  # fmt: skip
def test_what_arrives_shows_the_family_whatever_the_name_is(
    hint: Profile, evidence: list[object], profile: Profile, tells_motors: bool
) -> None:
    firmware = judged(hint, *evidence)
    assert (firmware.profile, firmware.tells_motors) == (profile, tells_motors)


@pytest.mark.parametrize(
    ("hint", "evidence", "profile", "tells_motors"),
    [
        (Profile.AROS, [], Profile.AROS, False),
        (Profile.AROS, [None, 1], Profile.AROS, False),
        (Profile.ARCOS, [P2OS_CONFIG], Profile.P2OS, False),
        (Profile.P2OS, [GRIPPER_FIRST], Profile.AROS, False),
        (Profile.ARCOS, [GRIPPER_FIRST], Profile.ARCOS, False),
        (Profile.AROS, [(0, 0), (1, 2), (0, 6)], Profile.AROS, False),  # neither order, or both
        (Profile.AROS, [P2OS_CONFIG, 0, True, 1], Profile.AROS, True),  # AROS before 1.6
        (Profile.AROS, [0, True, 0, 1, 0], Profile.AROS, True),
        (Profile.AROS, [1, True, 1, 0], Profile.AROS, False),  # on before it was asked for
        (Profile.AROS, [True, 1], Profile.AROS, False),  # nobody knows what was before
        (Profile.AROS, ["servo", 0, True, 151], Profile.AROS, False),
        (Profile.P2OS, [0, True, 1], Profile.P2OS, False),
    ],
)  # fmt: skip
def test_a_name_is_a_hint_for_the_order_of_bytes_and_never_for_the_motors(
    hint: Profile, evidence: list[object], profile: Profile, tells_motors: bool
) -> None:
    firmware = judged(hint, *evidence)
    assert (firmware.profile, firmware.tells_motors) == (profile, tells_motors)
    firmware.new_session(hint)
    assert (firmware.profile, firmware.tells_motors) == (hint, False), "another session knows nothing"


@pytest.mark.parametrize("port", [1, 5])
def test_the_order_of_gripper_and_analog_port_is_told_once(port: int) -> None:
    firmware = Firmware()
    first = firmware.profile
    none = StandardSip(analog_port=0, gripper_state=0)
    shown, other = StandardSip(analog_port=port, gripper_state=0), StandardSip(analog_port=0, gripper_state=port)
    firmware.take(none)
    firmware.take(StandardSip(analog_port=6, gripper_state=0))  # no port: tells nothing
    assert firmware.profile is first
    firmware.take(other)
    noted = firmware.profile
    assert noted is not first
    firmware.take(shown)
    firmware.take(other)
    assert firmware.profile is noted, "what was told is not judged again"


@pytest.mark.parametrize("deadman_ns", [None, 1])
def test_a_deadman_of_one_nanosecond_or_none_is_a_setting(deadman_ns: int | None) -> None:
    assert ClientSettings(deadman_ns=deadman_ns).deadman_ns == deadman_ns


@pytest.mark.parametrize("deadman_ns", [0, -1])
def test_a_deadman_that_is_over_at_once_is_refused(deadman_ns: int) -> None:
    with pytest.raises(UsageError, match=f"deadman_ns = {deadman_ns} must be positive, or None"):
        ClientSettings(deadman_ns=deadman_ns)


def test_a_family_that_is_given_is_believed() -> None:
    assert judged(Profile.ARCOS, TAIL, AROS_CONFIG, given=Profile.P2OS).profile is Profile.P2OS
    assert judged(Profile.P2OS, PORT_FIRST, P2OS_CONFIG, given=Profile.AROS).tells_motors


@pytest.mark.parametrize("model", ["p2dx", "p3dx", "p3dx-sh"])
@pytest.mark.parametrize("profile", list(Profile))
def test_a_client_finds_the_family_of_a_robot_under_any_name(model: str, profile: Profile) -> None:
    rig = Rig(pioneer=new_pioneer(model, profile=profile)).connect()
    rig.run(0.2)
    assert rig.core.profile is profile
    state = rig.core.state
    assert state is not None
    assert (state.analog_port, state.motors_enabled) == (5, False if profile.has_flags else None)
