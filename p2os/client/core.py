"""The client without a line and without a clock: what both skins of `Robot` drive.

A skin carries out `take_action`, feeds `line_opened`, `line_failed`,
`line_lost` and `receive`, calls `advance_to` at `next_deadline`, and hands on
`take_news`. Everything else is decided here, in the time that is passed in.

Theory of operation. Below, the `Session` keeps the link. Here one of three
things moves the robot: nothing, held speeds (`SpeedKeeper`), or a goal. A new
one takes the old one's place. A loss, the deadman, motors that go off, a stop
and a goal's end all lead to nothing or to held zero, and only a call of the
program leads away from there. After a loss the first motion call raises
`LinkLostError`, even if the link is back by then: the program has to know.

Invariant: after a loss no command but zero speeds goes out until a motion call
has returned without raising.
"""

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace

from p2os.client.goals import Axis, Goal
from p2os.client.motors import Motors
from p2os.client.notices import (
    ConfigurationKnown,
    Connected,
    DeadmanStopped,
    Disobeyed,
    GaveUp,
    LinkLost,
    MotionEnded,
    MotorsDisabled,
    Notice,
    RobotUnknown,
)
from p2os.client.obedience import Obedience
from p2os.client.observer import Observer, bumpers_of, limits_of
from p2os.client.outbox import Action
from p2os.client.problems import LinkLostError, MotorsDisabledError
from p2os.client.session import Session
from p2os.client.settings import ClientSettings
from p2os.client.snapshots import Limits, Link, Pose, RobotState
from p2os.client.speeds import STILL, SpeedKeeper, Speeds
from p2os.commands import Command, CommandNumber, enable, stop
from p2os.config_packet import ConfigPacket
from p2os.connection import ConnectionStats
from p2os.errors import LocalProtocolError, UsageError
from p2os.packets import Identity
from p2os.parameters import ParametersError, RobotParameters, load_parameters
from p2os.profiles import Profile
from p2os.sip import StandardSip
from p2os.timing import Nanos, Reached

#: Whose parameters stand in for a model that nobody knows.
STAND_IN = "p2dx"
#: What moves a robot, beside VEL and RVEL: sent raw, it takes the place of held speeds.
MOTION_NUMBERS = frozenset(
    {CommandNumber.MOVE, CommandNumber.ROTATE, CommandNumber.VEL, CommandNumber.HEAD, CommandNumber.DHEAD,
     CommandNumber.RVEL, CommandNumber.DCHEAD, CommandNumber.VEL2, CommandNumber.LATVEL, CommandNumber.STOP,
     CommandNumber.E_STOP, CommandNumber.QSTOP}
)  # fmt: skip

#: (command, is its argument positive) → the limit that it sets.
LIMIT_NAMES: Mapping[tuple[int, bool], str] = {
    (CommandNumber.SETV, True): "forward_mps",
    (CommandNumber.SETRV, True): "turn_radps",
    (CommandNumber.SETA, True): "accel_mps2",
    (CommandNumber.SETA, False): "decel_mps2",
    (CommandNumber.SETRA, True): "turn_accel_radps2",
    (CommandNumber.SETRA, False): "turn_decel_radps2",
}


class RobotCore:
    """One robot, as a passive state machine.

    Args:
        settings: How it behaves.
        parameters: The robot's, where they are to be other than those of its model.
        load: Gives the parameters of a model.
    """

    def __init__(
        self,
        settings: ClientSettings,
        *,
        parameters: RobotParameters | None = None,
        load: Callable[[str], RobotParameters] = load_parameters,
    ) -> None:
        self.settings = settings
        self.news: deque[RobotState | Notice] = deque()
        #: What became of the last session that could not be opened, or the last loss.
        self.problem: GaveUp | LinkLost | None = None
        self._given = parameters
        self._load = load
        self._session = Session(settings)
        self._observer = Observer(parameters or load(STAND_IN))
        self._speeds = SpeedKeeper(spacing_ns=settings.speed_spacing_ns, refresh_ns=settings.refresh_ns)
        self._motors = Motors()
        self._obedience = Obedience(settings.disbelief_ns)
        self._goal: Goal | None = None
        #: Puts the robot's largest speed back after a goal with its own.
        self._speed_back: Command | None = None
        self._now: Nanos = 0
        self._called_at: Nanos = 0
        self._unseen_loss: str | None = None
        self._set_limits: dict[str, float] = {}

    # What is known ------------------------------------------------------------------------

    @property
    def link(self) -> Link:
        """Where the client stands with its robot."""
        return self._session.link

    @property
    def is_ready(self) -> bool:
        """Whether packets flow and the configuration has come, or will not."""
        return self._session.is_ready

    @property
    def state(self) -> RobotState | None:
        """The last state; None before the first packet."""
        return self._observer.state

    @property
    def identity(self) -> Identity | None:
        """Who the robot said it is."""
        return self._session.identity

    @property
    def config(self) -> ConfigPacket | None:
        """The robot's CONFIGpac, once it has come."""
        return self._session.config

    @property
    def baud(self) -> int | None:
        """The line's speed; None where there is no such thing."""
        return self._session.baud

    @property
    def parameters(self) -> RobotParameters:
        """The conversions, limits and measures in use."""
        return self._observer.parameters

    @property
    def profile(self) -> Profile:
        """The firmware family in use."""
        return self._observer.profile

    @property
    def limits(self) -> Limits:
        """How fast the robot may go: its own limits, and those that were set in this session."""
        return replace(limits_of(self.parameters, self.config), **self._set_limits)

    @property
    def stats(self) -> ConnectionStats:
        """Counters of the present connection."""
        return self._session.stats

    @property
    def commanded(self) -> Speeds:
        """The speeds that are held; zero while nothing or a goal moves the robot."""
        return self._speeds.wanted

    @property
    def goal_is_under_way(self) -> bool:
        """Whether a `drive` or a `turn` is."""
        return self._goal is not None

    @property
    def is_quiet(self) -> bool:
        """Whether nothing waits to go out."""
        return self._session.outbox.is_empty

    # What the program asks ----------------------------------------------------------------

    def connect(self, now: Nanos) -> None:
        """Begin to look for the robot."""
        self.touch(now)
        self.problem, self._unseen_loss = None, None
        self._session.connect()

    def close(self, now: Nanos) -> None:
        """Stop the robot and leave it, whatever is under way."""
        self._forget_motion("closed", now)
        self._motors.new_session()
        self._session.close(now)

    def touch(self, now: Nanos) -> None:
        """Note that the program lives: every call of it does."""
        self._called_at = now

    def send(self, command: Command, now: Nanos) -> None:
        """Send any command of the manual.

        Raises:
            LinkLostError: there is no open session.
        """
        self._require_open()
        if command.number in MOTION_NUMBERS:
            self._forget_motion("another command", now)
        self._session.send(command, now)
        self._note_limit(command)

    def _note_limit(self, command: Command) -> None:
        value = command.integer
        name = LIMIT_NAMES.get((command.number, value is not None and value > 0))
        if name is not None and value:
            is_turn = command.number in {CommandNumber.SETRV, CommandNumber.SETRA}
            self._set_limits[name] = math.radians(abs(value)) if is_turn else abs(value) / 1000

    def set_velocity(self, forward_mps: float, turn_radps: float, now: Nanos) -> None:
        """Hold these speeds, cut to the limits, until something else is asked.

        Raises:
            LinkLostError: there is no open session, or there was a loss since the last motion call.
            MotorsDisabledError: the motors are off and are not switched on by themselves.
            UsageError: a speed is no number.
        """
        if not (math.isfinite(forward_mps) and math.isfinite(turn_radps)):
            raise UsageError(f"a speed of {forward_mps} m/s and {turn_radps} rad/s is no speed")
        limits = self.limits
        speeds = Speeds.of(_cut(forward_mps, limits.forward_mps), _cut(turn_radps, limits.turn_radps))
        self.touch(now)
        self._require_motion(now, moves=not speeds.are_zero)
        self._end_goal("another speed was set", now)
        self._hold(speeds, now)

    def stop(self, now: Nanos) -> None:
        """Stop, and stay: STOP, then zero speeds held."""
        self._require_open()
        self._stop("stop", now)

    def emergency_stop(self, now: Nanos) -> None:
        """Stop at once, without the ramp: E_STOP, then zero speeds held."""
        self._require_open()
        self._session.send(Command(CommandNumber.E_STOP), now)
        self._stop("emergency stop", now)

    def enable(self, on: bool, now: Nanos) -> None:
        """Switch the motors."""
        self._require_open()
        if not on:
            self._forget_motion("motors off", now)
        self._motors.ask(on=on, now=now)
        self._session.send(enable(on), now)

    def begin_goal(self, axis: Axis, limit_ns: Nanos | None, speed: float | None, now: Nanos) -> Goal:
        """Begin a `drive` or a `turn`; its end is a `MotionEnded`.

        Args:
            axis: What is to be done.
            limit_ns: How long it may take; None: twice what the limits allow, and some seconds.
            speed: m/s or rad/s for this goal alone; None: the limit.
            now: Nanoseconds.

        Raises:
            LinkLostError, MotorsDisabledError: as `set_velocity`.
        """
        self._require_motion(now, moves=True)
        if not math.isfinite(axis.asked):
            raise UsageError(f"{axis.what} is no motion")
        state = self._observer.state
        if state is None:
            raise LocalProtocolError("the robot has not said where it is yet", hint="wait for a state")
        self._forget_motion("another goal", now)
        limits = self.limits
        if speed is not None:
            if not (math.isfinite(speed) and speed > 0):
                raise UsageError(f"a speed of {speed} is not positive")
            self._session.send(axis.speed_command(_cut(speed, axis.speed_of(limits))), now)
            self._speed_back = axis.speed_command(axis.speed_of(limits))
            limits = axis.with_speed(limits, _cut(speed, axis.speed_of(limits)))
        goal = self._goal = Goal(axis, limit_ns)
        command = goal.begin(state, self._observer.robot_heading_rad, limits, now)
        if command is not None:
            self._session.send(command, now)
        return goal

    def cancel_goal(self, goal: Goal, now: Nanos) -> None:
        """Stop, if this goal is still under way."""
        if self._goal is goal:
            self._end_goal("cancelled", now)
            if self.link is Link.OPEN:
                self._stop("cancelled", now)

    def set_pose(self, pose: Pose) -> None:
        """Say where the robot is; the robot itself is not told."""
        self._observer.place(pose)

    # What the line tells ------------------------------------------------------------------

    def line_opened(self, now: Nanos, baud: int | None) -> None:
        """Take a line that is open; `baud` is None where it has no speed."""
        self._session.line_opened(now, baud)
        self._collect(now)

    def line_failed(self, reason: str, hint: str | None, now: Nanos) -> None:
        """Take the news that the line cannot be opened."""
        self._session.line_failed(reason, hint, now)
        self._collect(now)

    def line_lost(self, reason: str, now: Nanos) -> None:
        """Take the news that the line has gone."""
        self._session.line_lost(reason, now)
        self._collect(now)

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that arrived at `now`."""
        self.advance_to(now)
        self._session.receive(data, now)
        self._collect(now)

    def take_action(self, now: Nanos) -> Action | None:
        """Return the next thing to do with the line, if any is due."""
        return self._session.take_action(now)

    def next_deadline(self) -> Nanos | None:
        """Return when this wants to act, or an action is due."""
        due = [self._session.next_deadline(), self._session.outbox.next_deadline(), *self._own_deadlines()]
        return min((at for at in due if at is not None), default=None)

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on every deadline of its own up to `limit`; actions wait for `take_action`."""
        while True:
            due = [self._session.next_deadline(), *self._own_deadlines()]
            first = min((at for at in due if at is not None), default=None)
            if first is None or first > limit:
                self._now = max(self._now, limit)
                return Reached(limit)
            self._act(max(first, self._now))

    def _own_deadlines(self) -> list[Nanos | None]:
        if self.link is not Link.OPEN:
            return []
        goal = None if self._goal is None else self._goal.next_deadline()
        return [self._speeds.next_deadline(), self._motors.next_deadline(), goal, self._deadman_due()]

    def _act(self, now: Nanos) -> None:
        """Do all that is due at `now`."""
        self._now = now
        self._session.advance_to(now)
        self._collect(now)
        if self.link is not Link.OPEN:
            return
        if (deadman := self._deadman_due()) is not None and now >= deadman:
            self.news.append(DeadmanStopped(now - self._called_at))
            self._stop("deadman", now)
        if self._goal is not None and (late := self._goal.time_is_up(now)) is not None:
            self._end_goal(late, now)
            self._stop("too late", now)
        if self._motors.take_repeat(now):
            self._session.send(enable(True), now)
        speeds_due = self._speeds.next_deadline()
        if speeds_due is not None and now >= speeds_due:
            for command in self._speeds.take(now):
                self._session.send(command, now)

    def _deadman_due(self) -> Nanos | None:
        patience = self.settings.deadman_ns
        if patience is None or self._speeds.wanted.are_zero:
            return None
        return self._called_at + patience

    # What the session says ----------------------------------------------------------------

    def _collect(self, now: Nanos) -> None:
        session = self._session
        while session.news:
            item = session.news.popleft()
            if isinstance(item, StandardSip):
                self._take_sip(item, now)
                continue
            match item:
                case Connected():
                    self._begin_session(item.identity)
                case ConfigurationKnown():
                    self._observer.bumpers = bumpers_of(item.config)
                case LinkLost():
                    self.problem, self._unseen_loss = item, item.reason
                    self._forget_motion("the link was lost", now)
                    self._motors.new_session()
                case GaveUp():
                    self.problem = item
                case _:
                    pass
            self.news.append(item)

    def _begin_session(self, identity: Identity) -> None:
        parameters = self._given
        if parameters is None:
            try:
                parameters = self._load(identity.subclass.lower())
            except ParametersError:
                parameters = self._load(STAND_IN)
                self.news.append(RobotUnknown(identity.subclass, STAND_IN))
        self._observer.new_session(parameters)
        self._observer.profile = self.settings.profile or guess_profile(identity.subclass)
        self._session.set_profile(self._observer.profile)
        self._motors.new_session()
        self._set_limits.clear()  # CLOSE takes the robot back to its own

    def _take_sip(self, sip: StandardSip, now: Nanos) -> None:
        if self.settings.profile is None and sip.tail and self._observer.profile is not Profile.ARCOS:
            # Only ARCOS sends fields after DIGOUT; simulators do so under any model's name.
            self._observer.profile = Profile.ARCOS
            sip = StandardSip.from_frame(sip.to_frame(self._session.profile), Profile.ARCOS)
            self._session.set_profile(Profile.ARCOS)
        state = self._observer.take(sip, now)
        self.news.append(state)
        if (reason := self._motors.take(state, now)) is not None:
            self._forget_motion("the motors went off", now)
            self.news.append(MotorsDisabled(f"motors are disabled: {reason}"))
        wheels = (state.left_mps, state.right_mps)
        doubt = self._obedience.take(wheels, stalled=state.is_stalled, now=now)
        if doubt is not None:
            self.news.append(Disobeyed(doubt + self._advice(wheels)))
        self._follow_goal(state, now)

    def _advice(self, wheels: tuple[float, float]) -> str:
        stands = max(map(abs, wheels)) == 0
        return "; are the motors disabled (MOTORS button, STOP button)?" if stands else ""

    def _follow_goal(self, state: RobotState, now: Nanos) -> None:
        goal = self._goal
        if goal is None:
            return
        command, arrived, problem = goal.take(state, now)
        if command is not None:
            self._session.send(command, now)
        if arrived:
            self._end_goal(None, now)
            self._hold(STILL, now)
        elif problem is not None:
            self._end_goal(problem, now)
            self._stop("goal failed", now)

    # Motion -------------------------------------------------------------------------------

    def _require_open(self) -> None:
        if self.link is Link.OPEN:
            return
        reason = f": {self.problem.reason}" if self.problem is not None else ""
        raise LinkLostError(f"no robot is connected ({self.link.value}){reason}", hint="wait for it, or connect again")

    def _require_motion(self, now: Nanos, *, moves: bool) -> None:
        """Refuse to move a robot of which the program does not know enough, and switch its motors on."""
        lost = self._unseen_loss
        if moves or self.link is not Link.OPEN:
            self._unseen_loss = None
        self._require_open()
        if lost is not None and moves:
            raise LinkLostError(f"the link was lost and is back: {lost}", hint="the robot stands; call again to go on")
        if self._motors.are_on or not moves:
            return
        if self._motors.taken_off is not None:
            raise MotorsDisabledError(f"motors are disabled: {self._motors.taken_off}", hint="robot.enable()")
        if not self.settings.auto_enable:
            raise MotorsDisabledError("motors are disabled: they are after every OPEN", hint="robot.enable()")
        self.enable(True, now)

    def _hold(self, speeds: Speeds, now: Nanos) -> None:
        self._speeds.hold(speeds)
        half_track = self.parameters.track_mm / 2000
        rim = speeds.turn_radps * half_track
        wheels = (speeds.forward_mps - rim, speeds.forward_mps + rim)
        self._obedience.expect(wheels, self._observer.wheels_mps, now)

    def _stop(self, why: str, now: Nanos) -> None:
        self._end_goal(why, now)
        self._session.send(stop(), now)
        self._hold(STILL, now)

    def _forget_motion(self, why: str, now: Nanos) -> None:
        """Let nothing move the robot any more."""
        self._end_goal(why, now)
        self._speeds.release()
        self._obedience.expect(None, self._observer.wheels_mps, now)

    def _end_goal(self, problem: str | None, now: Nanos) -> None:
        goal, self._goal = self._goal, None
        if goal is not None:
            result = goal.result(now)
            goal.ended = MotionEnded(goal.axis.what, result.asked, result.reached, result.took_ns, problem)
            self.news.append(goal.ended)
            if self._speed_back is not None and self.link is Link.OPEN:
                self._session.send(self._speed_back, now)
            self._speed_back = None


def guess_profile(subclass: str) -> Profile:
    """Return the firmware family that a model's name stands for: -sh is ARCOS, Pioneer 2 is P2OS, the H8's are AROS."""
    model = subclass.lower()
    if model.endswith("-sh") or model.startswith(("seekur", "pioneer-lx")):
        return Profile.ARCOS
    return Profile.P2OS if model.startswith(("p2", "pion", "psos")) and not model.startswith("p2d8") else Profile.AROS


def _cut(value: float, most: float) -> float:
    return max(-most, min(most, value))
