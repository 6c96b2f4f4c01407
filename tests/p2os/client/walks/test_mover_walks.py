"""What moves a robot, in its parts: speeds, motors, goals and the deadman, asked at each bound, as approved."""

# ruff: noqa: E501  # rows of tables stand as they are

import math
import random
from collections.abc import Callable, Container, Iterator
from dataclasses import replace

from p2os.client.goals import DriveAxis, MotionAxis, MotionGoal, TurnAxis, as_number
from p2os.client.mover import MotorState, Mover, PlausibilityCheck, SentMotion, SpeedKeeper, Speeds
from p2os.client.observer import Observer, limits_of
from p2os.client.robot_state import RobotPose, RobotState
from p2os.client.settings import ClientSettings
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import load_parameters
from simbase.timing import NS_PER_MS
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

MS = NS_PER_MS
#: A span of time after which something may be due, one nanosecond before it and one behind it.
SPANS = tuple(
    at + by
    for at in (0, 50 * MS, 200 * MS, 500 * MS, 600 * MS, 800 * MS, 1000 * MS)
    for by in (-1, 0, 1)
    if at + by >= 0
)
STATE = RobotState(
    number=1, at_ns=0, pose=RobotPose(), forward_mps=0.0, turn_radps=0.0, left_mps=0.0, right_mps=0.0, is_moving=False,
    motors_enabled=True, battery_v=12.0, stall_left=False, stall_right=False, front_bumpers=(), rear_bumpers=(), sonar=(),
    compass_rad=None, analog_port=0, analog_v=0.0, digital_in=0, digital_out=0, stop_button=None, state_of_charge=None,
    temperature_c=None, sip=StandardSip(),
)  # fmt: skip


def keeping(draw: random.Random) -> Iterator[str]:
    """Hold speeds, change and release them, and look when they are due."""
    for spacing, refresh in ((50 * MS, 200 * MS), (0, 500 * MS), (200 * MS, 200 * MS)):
        keeper, now = SpeedKeeper(spacing_ns=spacing, refresh_ns=refresh), 0
        for _ in range(40):
            match draw.randrange(5):
                case 0 | 1:
                    keeper.hold(Speeds.of(draw.choice((0.0, 0.2, -0.1)), draw.choice((0.0, 0.5))))
                case 2 if draw.random() < 0.4:
                    keeper.release()
                case 3 | 4 if keeper.is_held:
                    yield said([*keeper.take(now)])
            yield said((now, keeper.next_deadline(), keeper.wanted, keeper.is_held))
            now += draw.choice(SPANS)
    yield said(
        [Speeds.of(forward, turn) for forward in (0.0004, 0.0006, -0.0015, 1.2345) for turn in (0.0, 0.009, -1.0)]
    )
    yield said(
        [
            (each.forward_mps, each.turn_radps, each.are_zero)
            for each in (Speeds(), Speeds(1), Speeds(0, -1), Speeds(250, 90))
        ]
    )
    for number in sorted(C):
        sent = SentMotion()
        shown = []
        for argument in (None, 0, 5, -5):
            sent.take(Command(C.VEL, 100))
            sent.take(Command(C.RVEL, 10))
            sent.take(Command(number, argument))
            shown.append([sent.may_move, sent._ways])
        yield f"{number.name} {said(shown)}"


def switching(draw: random.Random) -> Iterator[str]:
    """Switch motors on and off, by the program, by flags and by the button, at the bounds of each span."""
    motors, now = MotorState(), 5 * MS
    for number in range(400):
        match draw.randrange(9):
            case 0 | 1 | 2:
                yield said(motors.ask(on=draw.random() < 0.8, now=now))
            case 3 | 4:
                yield said(motors.take_repeat(now))
            case 8 if number % 5 == 0:
                motors.new_session()
            case _:
                state = replace(
                    STATE, motors_enabled=draw.choice((None, False, False, True)), stop_button=draw.random() < 0.3
                )
                yield said((motors.are_reported_off(state, now), motors.take(state, now)))
        yield said((now, motors.are_on, motors.taken_off, motors.next_deadline()))
        now += draw.choice(SPANS)


def doubting(draw: random.Random) -> Iterator[str]:
    """Compare commands with wheels that follow, stand, come nearer by little, and leave again."""
    for timeout in (500 * MS, 1000 * MS):
        check, now = PlausibilityCheck(timeout), 0
        for _ in range(150):
            if draw.random() < 0.2:
                wheels = draw.choice((None, (0.3, 0.3), (0.3, 0.3), (-0.2, 0.2), (0.0, 0.0)))
                check.expect(wheels, (0.0, draw.choice((0.0, 0.1))), now)
            measured = draw.choice((0.0, 0.1, 0.214, 0.215, 0.216, 0.098, 0.102, 0.3)), draw.choice((0.0, 0.215, 0.3))
            yield said(
                (now, check.take(measured, stalled=draw.random() < 0.05, now=now), check._least_error, check._was_near)
            )
            now += draw.choice(SPANS)


def aiming(draw: random.Random) -> Iterator[str]:
    """Follow goals with robots that come near, stand short, stall, overshoot and turn away."""
    limits = limits_of(load_parameters("p2dx"), None)
    for limit in (None, 3000 * MS):
        for make, asked in (
            (DriveAxis, (0.0, 0.015, 0.0151, 0.4, -0.6, 5.0, 12.0, -7.0)),
            (TurnAxis, (0.0, 0.034, 0.036, 1.0, -2.0, 3.2, -9.0)),
        ):
            for way in asked:
                axis: MotionAxis = make(way)
                goal, now, at, speed = MotionGoal(axis, limit), 100 * MS, 0.0, draw.choice((0.2, 0.5, 1.4))
                start = RobotPose(x_m=1.0, y_m=2.0, heading_rad=draw.choice((0.0, 0.5)))
                state = replace(STATE, odometry=start, pose=start)
                yield said(
                    (
                        axis.what,
                        goal.begin(state, limits, now),
                        goal.next_deadline(),
                        axis.fastest_ns(limits),
                        axis.speed_of(limits),
                    )
                )
                for _ in range(26):
                    now += draw.choice((100 * MS, 100 * MS, 199_999_999, 200 * MS, 600 * MS, 1000 * MS))
                    kind = draw.randrange(8)
                    step = math.copysign(min(abs(way) * 0.3, speed), way) * (0.0 if kind in {0, 1, 2} else 1.0)
                    at = way if kind == 7 else at + step
                    state = _moved(
                        axis, start, at, 0.0 if kind < 3 else draw.choice((0.009, 0.011, 0.031, 0.3)), stalled=kind == 2
                    )
                    command, arrived, problem = goal.take(state, now)
                    yield said(
                        (
                            now // MS,
                            command,
                            arrived,
                            problem,
                            goal.reached,
                            goal.next_deadline(),
                            goal.time_is_up(now),
                            goal.result(now),
                        )
                    )
                    if arrived or problem is not None:
                        break
                for before in (-1, 0):
                    yield said(goal.time_is_up(goal.next_deadline() + before))
        for remaining in (0.0, 0.0149, 0.015, 0.0151, 0.034, 0.0349, 0.035):
            yield said(
                [(each.is_near(remaining), each.is_near(-remaining)) for each in (DriveAxis(1.0), TurnAxis(1.0))]
            )
    for speed in (0.0001, 0.0004, 0.01, 0.0149, 0.4):
        yield said(
            [(each.speed_command(speed), each.with_speed(limits, speed)) for each in (DriveAxis(1.0), TurnAxis(1.0))]
        )
    for value in (1, True, 0.5, "1m", None, math.nan):
        yield tried(as_number, value, "drive", "metres")


def _moved(axis: MotionAxis, start: RobotPose, at: float, speed: float, *, stalled: bool) -> RobotState:
    if isinstance(axis, TurnAxis):
        pose = replace(start, heading_rad=start.heading_rad + at)
        return replace(STATE, odometry=pose, pose=pose, turn_radps=speed, stall_left=stalled)
    pose = replace(
        start, x_m=start.x_m + at * math.cos(start.heading_rad), y_m=start.y_m + at * math.sin(start.heading_rad)
    )
    return replace(STATE, odometry=pose, pose=pose, left_mps=speed, right_mps=-speed, stall_right=stalled)


def moving(draw: random.Random) -> Iterator[str]:
    """Ask anything of what moves a robot, and show what it sends, drops and says."""
    for settings in (
        ClientSettings(),
        ClientSettings(deadman_ns=None, auto_enable=False),
        ClientSettings(plausibility_ns=200 * MS, deadman_ns=600 * MS),
    ):
        calls: list[str] = []
        observer = Observer(load_parameters("p2dx"), None)
        mover = _mover(settings, observer, calls)
        limits, now, goals = limits_of(observer.parameters, None), 0, list[MotionGoal]()
        yield tried(mover.begin_goal, DriveAxis(1.0), None, None, limits, now)
        observer.state = STATE
        for _ in range(220):
            yield from _asked(draw, mover, goals, limits, now)
            yield said(
                (now, mover.commanded, mover.has_goal, mover.deadlines(), mover.limits(limits) == limits, taken(calls))
            )
            now += draw.choice(SPANS)


def _mover(settings: ClientSettings, observer: Observer, calls: list[str]) -> Mover:
    parts = Acted(calls)

    def drop(numbers: Container[int]) -> None:
        calls.append(f"drop {said([number for number in range(256) if number in numbers])}")

    return Mover(settings, observer, send=parts.send, send_first=parts.first, drop=drop, notify=parts.notify)


def _asked(draw: random.Random, mover: Mover, goals: list[MotionGoal], limits: object, now: int) -> Iterator[str]:
    number = draw.choice(
        (C.VEL, C.RVEL, C.STOP, C.MOVE, C.E_STOP, C.SETV, C.SETA, C.SETRV, C.SETRA, C.ENABLE, C.PTUPOS, C.SONAR)
    )
    command = Command(number, None if number in {C.STOP, C.E_STOP} else draw.choice((0, 100, -80)))
    speed = draw.choice((None, 0.1, 9.0, 0.0, math.inf))
    acts: tuple[Callable[[], object], ...] = (
        lambda: mover.set_velocity(Speeds(draw.choice((0, 200)), draw.choice((0, 10))), now), lambda: mover.set_velocity(Speeds(300), now),
        lambda: mover.require_motors(now), lambda: mover.enable(draw.random() < 0.6, now), lambda: mover.stop("why", now, at_once=draw.random() < 0.5),
        lambda: mover.take_gap(draw.choice((250, 1500)) * MS, now), lambda: goals.append(mover.begin_goal(DriveAxis(draw.choice((0.5, math.nan))), None, speed, limits, now)),  # type: ignore[arg-type]
        lambda: goals.append(mover.begin_goal(TurnAxis(-0.5), 500 * MS, speed, limits, now)), lambda: goals and mover.cancel_goal(draw.choice(goals), now),  # type: ignore[arg-type]
        lambda: mover.note(command, now), lambda: mover.take_sent(command.to_frame().to_bytes()), mover.new_session, lambda: mover.release("other", now),
        lambda: mover.lose(now), lambda: mover.touch(now), lambda: mover.act(now), lambda: mover.act(now),
    )  # fmt: skip
    kind = draw.randrange(len(acts) + 4)
    if kind < len(acts):
        yield f"{kind} {tried(acts[kind])}"
        return
    wheels = draw.choice(((0.0, 0.0), (0.2, 0.2), (0.1, -0.1)))
    pose = RobotPose(draw.choice((0.0, 0.5)), 0.0, draw.choice((0.0, -0.5)))
    state = replace(STATE, odometry=pose, left_mps=wheels[0], right_mps=wheels[1], motors_enabled=draw.choice((None, True, True, False)),
                    stall_left=draw.random() < 0.2, stop_button=draw.random() < 0.3)  # fmt: skip
    yield f"{kind} {tried(mover.take, state, now)}"


TRACES: dict[str, Trace] = {each.__name__: each for each in (keeping, switching, doubting, aiming, moving)}
TRACES["declared"] = declared_of("p2os.client")
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
