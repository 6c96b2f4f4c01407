"""What moves the robot and what takes that away: speeds, goals, motors, deadman; in virtual time."""

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.client.goals import GRACE_NS, DriveAxis, MotionGoal, TurnAxis
from p2os.client.mover import (
    MOTION_NUMBERS,
    SPEED_NUMBERS,
    WAYS,
    MotorState,
    PlausibilityCheck,
    SentMotion,
    Speeds,
)
from p2os.client.notices import (
    DeadmanStopped,
    Disobeyed,
    LinkLost,
    LinkLostError,
    MotionEnded,
    MotorsDisabled,
    MotorsDisabledError,
)
from p2os.client.outbox import SetBaud
from p2os.client.robot_state import Limits, RobotPose, RobotState
from p2os.client.settings import ClientSettings
from p2os.pioneer.controller import motion
from p2os.protocol.commands import Command, CommandNumber, enable, rvel, stop, vel
from p2os.protocol.profiles import Profile
from simbase.errors import UsageError
from simbase.timing import NS_PER_S
from tests.p2os.client.client_rig import MS, Link, Rig, S, free_pioneer, new_pioneer

MOVE, HEAD, SETV = CommandNumber.MOVE, CommandNumber.HEAD, CommandNumber.SETV


def of(rig: Rig, *numbers: int) -> list[tuple[int, Command]]:
    return [(at, command) for at, command in rig.sent if command.number in numbers]


def test_a_speed_goes_out_at_once_on_change_and_every_200_ms() -> None:
    rig = Rig().connect()
    begun = rig.now
    rig.core.set_velocity(0.2, 0.0, rig.now)
    rig.living(1)
    rig.core.set_velocity(0.3, math.radians(10), rig.now)
    rig.living(0.5)
    times = [(at - begun) // MS for at, command in of(rig, CommandNumber.VEL) if at >= begun]
    assert times[0] <= 15, "ENABLE is before it, 5 ms a frame"
    assert max(b - a for a, b in pairwise(times)) <= 200
    assert any(1000 <= at <= 1050 for at in times)
    assert rvel(10) in rig.commands()
    assert rig.wheels == pytest.approx((0.2688, 0.3312), abs=0.02)


def test_a_flood_of_changes_is_thinned_to_the_newest() -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.1, 0.0, rig.now)
    rig.living(0.5)
    before = len(rig.sent)
    for step in range(200):
        rig.core.set_velocity(0.1 + step / 1000, 0.0, rig.now)
        rig.run(0.001)
    rig.run(0.1)
    sent = [command.argument for command in rig.commands()[before:] if command.number == CommandNumber.VEL]
    assert len(sent) <= 8
    assert sent[-1] == 299


def test_speeds_are_cut_to_the_limits_of_the_configuration() -> None:
    rig = Rig().connect()
    limits = rig.core.limits
    assert limits.forward_mps == 0.75
    rig.core.set_velocity(9.0, -9.0, rig.now)
    assert rig.core.commanded == Speeds(750, -100)
    rig.core.send(Command(SETV, 300), rig.now)
    rig.core.send(Command(CommandNumber.SETRA, -50), rig.now)
    assert rig.core.limits.forward_mps == 0.3
    assert rig.core.limits.turn_decel_radps2 == pytest.approx(math.radians(50))
    rig.core.set_velocity(9.0, 0.0, rig.now)
    assert rig.core.commanded == Speeds(300, 0)


@pytest.mark.parametrize("speeds", [(math.nan, 0.0), (0.0, math.inf)])
def test_a_speed_that_is_no_number_is_refused(speeds: tuple[float, float]) -> None:
    rig = Rig().connect()
    with pytest.raises(UsageError, match="is no speed"):
        rig.core.set_velocity(*speeds, rig.now)


def test_motors_are_switched_on_by_the_first_motion_and_not_by_a_stop() -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.0, 0.0, rig.now)
    rig.core.stop(rig.now)
    rig.run(1)
    assert enable(True) not in rig.commands()
    rig.core.set_velocity(0.1, 0.0, rig.now)
    rig.living(1)
    assert rig.commands().count(enable(True)) == 3, "a P2OS robot does not say that they are on: it is told again"
    rig.core.set_velocity(0.2, 0.0, rig.now)
    rig.living(1)
    assert rig.commands().count(enable(True)) == 3


@pytest.mark.parametrize("values", [(True,), (False,), (True, False)])
def test_a_flood_of_enables_holds_no_stop_off(values: tuple[bool, ...]) -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.2, 0.0, rig.now)
    rig.living(0.5)
    before = len(rig.sent)
    for place in range(500):
        rig.core.enable(values[place % len(values)], rig.now)
        rig.run(0.001)
    sent = [command for command in rig.commands(before) if command.number == CommandNumber.ENABLE]
    assert sent[-1] == enable(values[499 % len(values)])
    if len(values) == 1:
        assert len(sent) <= 8, "each 200 ms one that was asked for, and one for what may be lost"
    rig.core.stop(rig.now)
    stopped = rig.now
    rig.run(0.1)
    assert rig.sent[-1][0] > stopped
    assert next(at for at, command in rig.sent if command == stop() and at >= stopped) - stopped <= 20 * MS


def test_what_was_asked_of_the_motors_in_another_session_counts_for_nothing() -> None:
    motors = MotorState()
    assert [motors.ask(on=False, now=0), motors.ask(on=False, now=1)] == [True, False]
    motors.new_session()
    assert motors.ask(on=False, now=2)


def test_the_same_enable_is_sent_again_after_200_ms_and_another_at_once() -> None:
    rig = Rig().connect()
    begun = rig.now
    for at_ms, on in ((0, False), (199, False), (200, False), (210, True), (220, False)):
        rig.run((begun + at_ms * MS - rig.now) / S)
        rig.core.enable(on, rig.now)
    rig.run(0.05)
    sent = [(at - begun, command) for at, command in of(rig, CommandNumber.ENABLE) if at >= begun]
    assert [command for _, command in sent] == [enable(False), enable(False), enable(True), enable(False)]
    for (at, _), asked_ms in zip(sent, (0, 200, 210, 220), strict=True):
        assert asked_ms * MS <= at <= (asked_ms + 5) * MS, "5 ms after the frame before it"


def test_without_leave_the_motors_stay_off_and_it_is_said_why() -> None:
    rig = Rig(settings=ClientSettings(auto_enable=False)).connect()
    with pytest.raises(MotorsDisabledError, match="motors are disabled: they are after every OPEN"):
        rig.core.set_velocity(0.1, 0.0, rig.now)
    rig.core.enable(True, rig.now)
    rig.core.set_velocity(0.1, 0.0, rig.now)
    rig.living(1)
    assert rig.pioneer.state.motors_enabled


def test_motors_that_somebody_switches_off_stay_off_until_asked() -> None:
    rig = Rig(pioneer=new_pioneer("p3dx", profile=Profile.AROS)).connect()
    assert rig.core.profile is Profile.AROS
    rig.core.set_velocity(0.2, 0.0, rig.now)
    rig.living(1.5)
    assert rig.commands().count(enable(True)) == 1, "the flags say that they are on"
    assert rig.core.state is not None
    assert rig.core.state.motors_enabled
    rig.pioneer._context.motion.power(on=False)
    rig.living(0.3)
    assert rig.notices(MotorsDisabled) == [MotorsDisabled("motors are disabled: they were switched off at the robot")]
    before = len(rig.sent)
    rig.living(1)
    assert vel(200) not in rig.commands()[before:]
    with pytest.raises(MotorsDisabledError, match="switched off at the robot"):
        rig.core.set_velocity(0.2, 0.0, rig.now)
    rig.core.enable(True, rig.now)
    rig.core.set_velocity(0.2, 0.0, rig.now)
    rig.living(1.5)
    assert rig.wheels == (0.2, 0.2)
    rig.core.enable(False, rig.now)
    rig.living(1.5)
    assert rig.notices(MotorsDisabled)[1:] == [], "switched off by the program: no news"


def test_a_program_that_makes_no_call_loses_its_speed_at_the_deadman() -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.3, 0.0, rig.now)
    begun = rig.now
    rig.run(2.5)
    (news,) = rig.notices(DeadmanStopped)
    assert news.silent_ns == 2 * S
    assert stop() in rig.commands(begun + 2 * S)
    rig.run(2)
    assert rig.wheels == (0.0, 0.0)
    rig.core.set_velocity(0.3, 0.0, rig.now)
    rig.living(5)
    assert rig.wheels == (0.3, 0.3)


@pytest.mark.parametrize("after_ns", [0, 1, MS, 2 * MS])
def test_the_deadman_comes_to_the_nanosecond_whatever_else_is_due_just_before(after_ns: int) -> None:
    def moving(deadman_ns: int) -> tuple[Rig, int]:
        rig = Rig(settings=ClientSettings(deadman_ns=deadman_ns)).connect()
        rig.core.set_velocity(0.3, 0.0, rig.now)
        begun = rig.now
        rig.run(1.85)
        return rig, begun

    rig, begun = moving(9 * S)
    other = rig.core.next_deadline()
    assert other is not None
    rig, again = moving(other - begun + after_ns)
    assert again == begun
    rig.core.advance_to(other - 1)
    assert not rig.core.commanded.are_zero
    rig.core.advance_to(other)
    assert rig.core.commanded.are_zero is (after_ns == 0)
    rig.core.advance_to(other + after_ns)
    assert rig.core.commanded.are_zero


def test_the_deadman_can_be_switched_off() -> None:
    rig = Rig(settings=ClientSettings(deadman_ns=None)).connect()
    rig.core.set_velocity(0.3, 0.0, rig.now)
    rig.run(3)
    assert rig.wheels == (0.3, 0.3)


def test_stop_is_said_and_then_held() -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.3, 0.1, rig.now)
    rig.living(2)
    before = len(rig.sent)
    rig.core.stop(rig.now)
    rig.living(2)
    sent = rig.commands()[before:]
    assert sent[:1] == [stop()]
    assert sent.count(vel(0)) >= 9
    assert rig.wheels == (0.0, 0.0)
    rig.core.set_velocity(0.3, 0.0, rig.now)
    rig.living(1.5)
    before = len(rig.sent)
    rig.core.stop(rig.now, at_once=True)
    rig.run(0.1)
    assert [command.number for command in rig.commands()[before:]][:2] == [CommandNumber.E_STOP, CommandNumber.STOP]
    assert rig.wheels == (0.0, 0.0)


def test_a_deaf_robot_is_reported_after_a_second_and_once() -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.3, 0.0, rig.now)
    rig.living(2)
    rig.pioneer.receive = lambda _, now: rig.pioneer.advance_to(now)  # type: ignore[method-assign]
    rig.pioneer._context.motion.set_velocity(0)
    begun = rig.now
    rig.living(3)
    (doubt,) = rig.notices(Disobeyed)
    assert "commanded 0.30 and 0.30, and no stall flag; are the motors disabled" in doubt.text
    reported = next(state.at_ns for state in rig.states if state.at_ns >= begun + S)
    assert reported - begun <= 2.3 * S


def test_a_ramp_is_no_disobedience() -> None:
    rig = Rig().connect()
    for forward, turn in ((0.7, 0.0), (-0.7, 0.0), (0.0, 1.5), (0.3, -1.5), (0.0, 0.0)):
        rig.core.set_velocity(forward, turn, rig.now)
        rig.living(5)
    assert rig.notices(Disobeyed) == []


def test_a_robot_against_a_wall_says_that_it_stalls_and_is_believed() -> None:
    rig = Rig(pioneer=new_pioneer()).connect()
    rig.core.set_velocity(0.5, 0.0, rig.now)
    rig.living(15)
    assert rig.core.state is not None
    assert rig.core.state.is_stalled
    assert rig.notices(Disobeyed) == []


@pytest.mark.parametrize("wire", ["perfect", "byte by byte", "late", "lossy", "garbling"])
@pytest.mark.parametrize("distance_m", [0.5, -0.4, 0.02, 0.0])
def test_drive_arrives_over_any_wire(wire: str, distance_m: float) -> None:
    rig = Rig(wire=wire, seed=3).connect()
    goal = rig.core.begin_goal(DriveAxis(distance_m), None, None, rig.now)
    rig.until(lambda: goal.ended is not None)
    assert goal.ended is not None
    assert goal.ended.problem is None
    assert rig.pioneer.state.x_mm / 1000 == pytest.approx(distance_m, abs=0.016)
    rig.run(1)
    assert rig.wheels == (0.0, 0.0)


@pytest.mark.parametrize("wire", ["perfect", "late", "lossy", "garbling"])
@pytest.mark.parametrize("degrees", [90, -90, 200, -720, 3])
def test_turn_arrives_over_any_wire_however_far(wire: str, degrees: float) -> None:
    rig = Rig(wire=wire, seed=5).connect()
    goal = rig.core.begin_goal(TurnAxis(math.radians(degrees)), None, None, rig.now)
    rig.until(lambda: goal.ended is not None)
    assert goal.ended is not None
    assert goal.ended.problem is None
    assert math.degrees(rig.pioneer.state.heading_rad) == pytest.approx(degrees, abs=2.1)


def test_a_long_way_goes_in_legs_without_braking_between() -> None:
    rig = Rig().connect()
    rig.core.begin_goal(DriveAxis(100.0), 10 * S, None, rig.now)
    rig.living(4)
    assert [command.argument for _, command in of(rig, MOVE)] == [5000]
    rig.living(4)
    assert [command.argument for _, command in of(rig, MOVE)] == [5000, 5000]
    axis = DriveAxis(12.0)
    assert axis.command(12.0, standing=True) == Command(MOVE, 5000)
    assert axis.command(9.0, standing=False) is None
    assert axis.command(8.4, standing=False) == Command(MOVE, 5000)
    assert axis.command(5.0, standing=False) is None
    assert axis.command(4.8, standing=False) == Command(MOVE, 4800)
    assert axis.command(1.0, standing=False) is None
    assert axis.command(1.0, standing=True) == Command(MOVE, 1000)


def test_a_goal_of_its_own_speed_puts_the_usual_one_back() -> None:
    rig = Rig().connect()
    goal = rig.core.begin_goal(DriveAxis(0.3), None, 0.1, rig.now)
    rig.until(lambda: goal.ended is not None)
    rig.run(0.2)
    assert max(state.forward_mps for state in rig.states) <= 0.101
    assert [command.argument for _, command in of(rig, SETV)] == [100, 750]
    goal = rig.core.begin_goal(TurnAxis(0.5), None, 0.2, rig.now)
    rig.until(lambda: goal.ended is not None)
    rig.run(0.2)
    assert [command.argument for _, command in of(rig, CommandNumber.SETRV)] == [11, 100]


def test_a_wall_in_the_way_ends_the_goal_with_its_reason_and_a_stop() -> None:
    rig = Rig(pioneer=new_pioneer()).connect()
    goal = rig.core.begin_goal(DriveAxis(5.0), None, None, rig.now)
    rig.until(lambda: goal.ended is not None, within_s=30)
    assert goal.ended is not None
    assert goal.ended.problem == "stalled"
    before = rig.now - 100 * MS
    rig.run(3)
    assert stop() in rig.commands(before)
    assert rig.wheels == (0.0, 0.0)


def test_a_goal_that_takes_too_long_is_given_up() -> None:
    rig = Rig().connect()
    goal = rig.core.begin_goal(DriveAxis(3.0), 2 * S, None, rig.now)
    rig.until(lambda: goal.ended is not None)
    assert goal.ended is not None
    assert goal.ended.problem == "not there after 2.0 s"
    rig.run(2)
    assert rig.wheels == (0.0, 0.0)


def approach_slowly(patch: pytest.MonkeyPatch, seconds: int) -> None:
    """Let MOVE go as slowly as what is left in so many seconds, as AMRISim does in some five."""
    aim = motion._aim

    def aim_slowly(axis: motion._Axis, left: int, *others: int, **limits: int) -> None:
        aim(axis, left, *others, **limits)
        most = abs(left) // seconds
        axis.set_speed = max(-most, min(most, axis.set_speed))

    patch.setattr(motion, "_aim", aim_slowly)


@pytest.mark.parametrize("speed_mps", [0.05, 0.1, 0.2, 0.3, 0.75])
@pytest.mark.parametrize("distance_m", [0.5, -0.5])
def test_a_robot_that_approaches_ever_more_slowly_arrives_at_any_speed(
    speed_mps: float, distance_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    approach_slowly(monkeypatch, 6)
    rig = Rig().connect()
    goal = rig.core.begin_goal(DriveAxis(distance_m), None, speed_mps, rig.now)
    rig.until(lambda: goal.ended is not None, within_s=120)
    assert goal.ended is not None
    assert goal.ended.problem is None
    assert rig.pioneer.state.x_mm / 1000 == pytest.approx(distance_m, abs=0.016)


def test_a_limit_that_was_given_is_kept_also_while_the_robot_comes_nearer(monkeypatch: pytest.MonkeyPatch) -> None:
    approach_slowly(monkeypatch, 6)
    rig = Rig().connect()
    goal = rig.core.begin_goal(DriveAxis(0.5), 5 * S, None, rig.now)
    rig.until(lambda: goal.ended is not None)
    assert goal.ended is not None
    assert goal.ended.problem == "not there after 5.0 s"


def at(x_m: float) -> RobotState:
    return replace(Rig().connect().states[-1], odometry=RobotPose(x_m=x_m), left_mps=0.02, right_mps=0.02)


@pytest.mark.parametrize(("left_m", "is_patient"), [(0.0899, True), (0.0901, False)])
def test_patience_lasts_as_long_again_where_a_tenth_of_what_was_left_is_done(left_m: float, is_patient: bool) -> None:
    goal = MotionGoal(DriveAxis(1.0), None)
    goal.begin(at(0.0), Limits(0.75, 1.7, 0.3, 0.3, 1.7, 1.7), 0)
    goal.take(at(0.9), 1 * S)  # a tenth of a metre is left
    ends = goal.next_deadline()
    goal.take(at(1.0 - left_m), ends - 1)
    assert goal.next_deadline() == (ends - 1 + GRACE_NS if is_patient else ends)
    assert goal.time_is_up(ends - 1) is None
    assert (goal.time_is_up(ends) is None) is is_patient


def test_a_robot_whose_motors_do_not_come_on_ends_the_goal() -> None:
    rig = Rig().connect()
    rig.pioneer._context.motion.power = lambda **_: None  # type: ignore[method-assign]
    goal = rig.core.begin_goal(DriveAxis(1.0), None, None, rig.now)
    rig.until(lambda: goal.ended is not None)
    assert goal.ended is not None
    assert goal.ended.problem == "the robot stands: are its motors off, or is the way blocked?"


@pytest.mark.parametrize("how", ["speed", "stop", "goal", "raw", "loss", "close", "off", "cancel"])
def test_a_goal_ends_when_something_else_takes_its_place(how: str) -> None:
    rig = Rig().connect()
    goal = rig.core.begin_goal(DriveAxis(1.0), None, 0.2, rig.now)
    rig.run(1)
    ways = {
        "speed": lambda: rig.core.set_velocity(0.1, 0.0, rig.now),
        "stop": lambda: rig.core.stop(rig.now),
        "goal": lambda: rig.core.begin_goal(TurnAxis(1.0), None, None, rig.now),
        "raw": lambda: rig.core.send(vel(0), rig.now),
        "loss": rig.pull,
        "close": lambda: rig.core.close(rig.now),
        "off": lambda: rig.core.enable(False, rig.now),
        "cancel": lambda: rig.core.cancel_goal(goal, rig.now),
    }
    ways[how]()
    assert goal.ended is not None
    assert goal.ended.problem
    assert rig.core._mover.has_goal is (how == "goal")
    rig.run(1)
    assert any(isinstance(notice, MotionEnded) for notice in rig.notices())
    rig.core.cancel_goal(goal, rig.now)


def test_a_goal_is_refused_where_nothing_is_known_or_nothing_is_asked() -> None:
    rig = Rig()
    with pytest.raises(LinkLostError, match="no robot is connected"):
        rig.core.begin_goal(DriveAxis(1.0), None, None, rig.now)
    rig.connect()
    for axis, speed in ((DriveAxis(math.nan), None), (DriveAxis(1.0), -0.1), (TurnAxis(1.0), math.inf)):
        with pytest.raises(UsageError, match="is no motion"):
            rig.core.begin_goal(axis, None, speed, rig.now)


def test_a_raw_motion_takes_the_place_of_a_held_speed() -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.2, 0.0, rig.now)
    rig.living(1)
    rig.core.send(Command(CommandNumber.VEL2, 10 << 8 | 10), rig.now)
    before = len(rig.sent)
    rig.living(1)
    assert vel(200) not in rig.commands()[before:]
    assert rig.wheels == pytest.approx((0.2, 0.2), abs=1e-6)


@pytest.mark.parametrize("how", ["cut", "pulled", "rebooted"])
def test_after_a_loss_the_robot_began_to_stop_at_its_watchdog_or_earlier_and_stays(how: str) -> None:
    rig = Rig(baud=9600).connect()
    rig.core.set_velocity(0.3, 0.2, rig.now)
    rig.living(2)
    assert max(map(abs, rig.wheels)) > 0.2
    at = rig.now
    {"cut": lambda: setattr(rig, "is_cut", True), "pulled": rig.pull, "rebooted": rig.reboot}[how]()
    rig.living(2.05)
    assert rig.pioneer.state.watchdog_expired or max(map(abs, rig.wheels)) < 0.3
    rig.living(1.5)
    assert rig.wheels == (0.0, 0.0)
    rig.is_cut = False
    rig.plug()
    rig.until(lambda: rig.core.link is Link.OPEN)
    assert rig.notices(LinkLost)
    rig.living(5)
    speeds = [command.argument for sent_at, command in rig.sent
              if sent_at > at + 1100 * MS and command.number in {CommandNumber.VEL, CommandNumber.RVEL}]  # fmt: skip
    assert set(speeds) <= {0}
    assert rig.wheels == (0.0, 0.0)


def ended_by(rig: Rig, how: str) -> int:
    """End the movement of a rig that moves; return when."""
    core, context = rig.core, rig.pioneer._context
    match how:
        case "stop":
            core.stop(rig.now)
        case "disabled" | "disabled raw":
            core.enable(False, rig.now) if how == "disabled" else core.send(enable(False), rig.now)
        case "cancelled":
            (goal,) = [core._mover._goal]
            assert goal is not None
            core.cancel_goal(goal, rig.now)
        case "motors off" | "stop button":
            if how == "stop button":
                context.devices.switches.stop_button = True
            context.motion.power(on=False)
            rig.until(lambda: bool(rig.notices(MotorsDisabled)))
        case "deadman":
            rig.run(3)
            return core._mover._called_at + 2 * S
        case "stalled" | "too late" | "arrived":
            rig.until(lambda: bool(rig.notices(MotionEnded)))
    rig.run(0)
    return rig.now


GOALS = ("cancelled", "stalled", "too late", "arrived")
ENDS = ("stop", "disabled", "disabled raw", "motors off", "stop button", "deadman", *GOALS)


@pytest.mark.parametrize("how", ENDS)
def test_whatever_ends_a_movement_sends_stop_in_the_same_step_and_then_holds_zero(how: str) -> None:
    pioneer = new_pioneer("p3dx-sh") if how == "stalled" else free_pioneer("p3dx-sh")
    rig = Rig(pioneer=pioneer).connect()
    if how in GOALS:
        far_m = 0.3 if how == "arrived" else 20.0
        rig.core.begin_goal(DriveAxis(far_m), 2 * S if how == "too late" else None, None, rig.now)
    else:
        rig.core.set_velocity(0.3, 0.1, rig.now)
    if how != "arrived":
        rig.living(1)
        assert max(rig.wheels) > 0.2
    before = len(rig.sent)
    at = ended_by(rig, how)
    rig.run(0.02)
    moving = [number for number, (_, one) in enumerate(rig.sent) if one.number in WAYS and one.argument]
    after = [(then, one) for then, one in rig.sent[max(before, moving[-1] + 1) :] if one.number in MOTION_NUMBERS]
    assert after[0][1] == stop()
    assert 0 <= after[0][0] - at <= rig.core.settings.command_spacing_ns
    rig.run(1)
    later = {(one.number, one.argument) for _, one in rig.sent[max(before, moving[-1] + 1) :]}
    assert {(CommandNumber.VEL, 0), (CommandNumber.RVEL, 0)} <= later
    assert not [number for number, argument in later if number in WAYS and argument]


RAW_MOTIONS = (
    vel(200), rvel(20), Command(MOVE, 5000), Command(HEAD, 120), Command(CommandNumber.VEL2, 10 << 8 | 5),
)  # fmt: skip


@pytest.mark.parametrize("command", RAW_MOTIONS, ids=lambda command: command.name)
@pytest.mark.parametrize("after_ns", [-1, 0, 1])
def test_the_deadman_is_armed_by_what_was_sent(command: Command, after_ns: int) -> None:
    rig = Rig().connect()
    rig.core.enable(True, rig.now)
    rig.living(1)
    rig.core.touch(rig.now)
    called_at = rig.now
    rig.core.send(command, rig.now)
    rig.run(1)
    rig.core._mover.release("nothing holds it any more", rig.now)
    rig.run((called_at + 2 * S + after_ns - rig.now) / S)
    assert (stop() in rig.commands(called_at)) is (after_ns >= 0)
    rig.run(5)
    assert [at for at, one in rig.sent if one == stop() and at >= called_at] == [called_at + 2 * S], "and once"
    assert rig.wheels == (0.0, 0.0)


def test_a_deadman_whose_stop_did_not_leave_stops_again() -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.2, 0.0, rig.now)
    rig.run(1.9)
    rig.core._supervisor.outbox.put(SetBaud(9600))
    rig.core._supervisor.outbox._drained_at = rig.now + 3 * S  # the line is taken
    rig.run(4)
    assert len(rig.notices(DeadmanStopped)) == 2
    assert stop() in rig.commands(rig.now - 2 * S)
    rig.run(5)
    assert len(rig.notices(DeadmanStopped)) == 2


def test_flags_that_say_motors_off_while_the_wheels_turn_are_answered_with_stop() -> None:
    rig = Rig(pioneer=free_pioneer("p3dx")).connect()
    rig.core.send(enable(True), rig.now)  # the client has not switched them on
    rig.core.send(vel(200), rig.now)
    rig.living(1)
    assert stop() not in rig.commands()[-20:]
    state = rig.core.state
    assert state is not None
    before = rig.now
    for _ in range(2):  # each time that they say so: a frame can be lost
        rig.core._mover.take(replace(state, motors_enabled=False), rig.now)
        rig.run(0.01)
    assert [command for command in rig.commands(before) if command == stop()] == [stop(), stop()]
    still = replace(state, motors_enabled=False, left_mps=0.0, right_mps=0.0)
    before = len(rig.sent)
    rig.core._mover.take(still, rig.now)
    rig.run(0.01)
    assert stop() not in rig.commands()[before:]


@pytest.mark.parametrize("goal", [DriveAxis(0.5), TurnAxis(1.0), DriveAxis(0.0)], ids=["drive", "turn", "nothing"])
def test_a_goal_leaves_nothing_of_the_speeds_before_it(goal: DriveAxis | TurnAxis) -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.2, 0.5, rig.now)
    rig.living(1)
    begun = rig.core.begin_goal(goal, None, None, rig.now)
    rig.until(lambda: begun.ended is not None)
    assert begun.ended is not None
    assert begun.ended.problem is None
    rig.living(2)
    assert rig.wheels == (0.0, 0.0)


MOVES = st.one_of(
    st.builds(Command, st.sampled_from(sorted(WAYS.keys() - {CommandNumber.LATVEL})), st.integers(-300, 300)),
    st.builds(Command, st.sampled_from(sorted(SPEED_NUMBERS - {CommandNumber.LATVEL})), st.just(0)),
    st.just(stop()), st.builds(Command, st.sampled_from(sorted(WAYS))),
)  # fmt: skip


@given(st.lists(MOVES, max_size=12), st.sampled_from(list(Profile)))
def test_a_robot_that_was_told_to_stand_is_known_to_stand_and_no_other(said: list[Command], profile: Profile) -> None:
    """What has left, against what the virtual robot makes of it: its set-points."""
    pioneer, sent = free_pioneer(profile=profile), SentMotion()
    for frame in (Command(number) for number in (0, 1, 2, CommandNumber.OPEN)):
        pioneer.receive(frame.to_frame().to_bytes(), 0)
    for command in said:
        sent.take(command)
        pioneer.receive(command.to_frame().to_bytes(), 0)
    _, first, first_goal, second, second_goal = pioneer._context.motion.setpoints
    moves = bool(first or second) or first_goal is not None or second_goal is not None
    assert sent.may_move or not moves
    if said and said[-1] == stop():
        assert not sent.may_move


@pytest.mark.parametrize("newer", [vel(100), DriveAxis(1.0)], ids=["raw", "goal"])
def test_a_newer_movement_does_not_drop_a_stop_that_waits(newer: Command | DriveAxis) -> None:
    rig = Rig().connect()
    rig.core.set_velocity(0.2, 0.5, rig.now)
    rig.living(1)
    before = len(rig.sent)
    rig.core.stop(rig.now)
    if isinstance(newer, Command):
        rig.core.send(newer, rig.now)
    else:
        rig.core.begin_goal(newer, None, None, rig.now)
    rig.living(1.5)
    assert rig.commands()[before] == stop()
    left, right = rig.wheels
    assert left == right > 0.05


def plausibility(measured_mps: float) -> PlausibilityCheck:
    """One that expects 0.3 m/s of both wheels from 0 on, and has seen them near it at once."""
    check = PlausibilityCheck(NS_PER_S)
    check.expect((0.3, 0.3), (0.0, 0.0), 0)
    assert check.take((measured_mps, measured_mps), stalled=False, now=0) is None
    return check


def test_wheels_that_left_their_speed_by_themselves_are_measured_on_their_way_back() -> None:
    check = plausibility(0.3)
    assert check.take((0.0, 0.0), stalled=False, now=NS_PER_S - 1) is None
    assert check.take((0.1, 0.1), stalled=False, now=NS_PER_S) is None, "nearer by more than the least progress"
    assert check.take((0.1, 0.1), stalled=False, now=2 * NS_PER_S - 1) is None
    noted = check.take((0.1, 0.1), stalled=False, now=2 * NS_PER_S)
    assert noted is not None
    assert "for 1 s the wheels are at 0.10 and 0.10 m/s, commanded 0.30" in noted
    assert check.take((0.1, 0.1), stalled=False, now=3 * NS_PER_S) is None, "said once"


def test_the_way_back_is_measured_from_where_it_left_however_small_its_steps_are() -> None:
    check, now = plausibility(0.3), 0
    for step in range(30):  # 1 mm/s each: two of them are progress
        now = (step + 1) * NS_PER_S // 4
        assert check.take((step / 1000, step / 1000), stalled=False, now=now) is None


def test_wheels_are_near_within_a_tolerance_and_a_share_of_the_greater_speed() -> None:
    for speed, is_plausible in ((0.2151, True), (0.2149, False), (0.3849, True), (0.3851, False)):  # 0.04 + 15 %
        check = plausibility(0.3)
        check.take((0.0, 0.0), stalled=False, now=1)
        check.take((speed, 0.3), stalled=False, now=2)  # nearer than before, whether near or not
        check.take((speed, 0.3), stalled=False, now=2 + NS_PER_S - 1)
        noted = check.take((speed, 0.3), stalled=False, now=2 + NS_PER_S)
        assert (noted is None) is is_plausible, speed
