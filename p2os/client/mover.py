"""What moves the robot: nothing, held speeds, or one goal; and what takes that away again.

Which speeds a goal needs is decided in `p2os.client.goals`.

Theory of operation. A new motion takes the old one's place. Whatever else ends one
sends STOP in the same step and then holds zero speeds: a goal's end, the deadman,
motors that go off, a stop. A lost link alone does not, for nothing can be sent: the
link's own closing frames and the robot's watchdog stop it. Only a call of the program
leads away from there.

What is wanted and what was sent are two states. `SentMotion` follows the frames that
have left, and the deadman is armed by these: until a STOP or zero speeds have left
after the last frame that moves the robot, whatever is held or forgotten meanwhile.

Flags that say that the motors are off while the wheels turn are answered with STOP.

`SpeedKeeper`: P2OS acknowledges nothing, so the present speed is sent on change and
again at least every `refresh_ns`. Changes that come faster than `speed_spacing_ns`
wait, and what they overtake is never sent.

`MotorState`: they are off after every OPEN. ENABLE has no answer; AROS and ARCOS robots
report in their flags whether the motors are on, P2OS robots do not. ENABLE is sent a
few times in a row, for a frame can be lost; a program that asks for the same again
and again has it sent no more often. Once they were on, motors that go off were
switched off by somebody at the robot: they stay off until the program asks for them.

`PlausibilityCheck`: the wheel speeds of the packets are the only evidence that the
robot follows its commands. One that follows is near its command, or comes nearer, or
reports a stall; each packet that shows one of the three passes the check. "Nearer"
means that the larger error of the two wheels fell below the least seen under this
command by more than jitter, so that noise alone does not pass for long.

Invariant: a robot that may move by what was sent to it has a movement under way that
ends, or an armed deadman.
"""

import math
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, replace
from typing import Protocol

from p2os.client.goals import MotionAxis, MotionGoal, as_number
from p2os.client.notices import (
    DeadmanStopped,
    Disobeyed,
    GapStopped,
    MotionEnded,
    MotorsDisabled,
    MotorsDisabledError,
    Notice,
)
from p2os.client.observer import Observer
from p2os.client.robot_state import Limits, RobotState
from p2os.client.settings import ClientSettings
from p2os.errors import LocalProtocolError
from p2os.protocol.commands import Command, CommandNumber, enable, rvel, stop, vel
from p2os.protocol.frames import PREFIX_BYTES, Frame
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: Ways to move, as bits: along the heading, about the centre, to the side.
AHEAD, ROUND, ASIDE = 1, 2, 4
#: What moves a robot → which ways: sent raw, it takes the place of held speeds.
WAYS: Mapping[int, int] = {
    CommandNumber.MOVE: AHEAD, CommandNumber.VEL: AHEAD, CommandNumber.VEL2: AHEAD | ROUND,
    CommandNumber.ROTATE: ROUND, CommandNumber.RVEL: ROUND, CommandNumber.HEAD: ROUND, CommandNumber.DHEAD: ROUND,
    CommandNumber.DCHEAD: ROUND, CommandNumber.LATVEL: ASIDE,
}  # fmt: skip
#: Of these 0 is a stand; 0 of the others is a place.
SPEED_NUMBERS = frozenset(
    {CommandNumber.VEL, CommandNumber.VEL2, CommandNumber.RVEL, CommandNumber.ROTATE, CommandNumber.LATVEL}
)
#: What stops it; STOP alone is known to every firmware.
STOP_NUMBERS = frozenset({CommandNumber.STOP, CommandNumber.E_STOP, CommandNumber.QSTOP})
MOTION_NUMBERS = WAYS.keys() | STOP_NUMBERS

#: (command, is its argument positive) → the limit that it sets.
LIMIT_NAMES: Mapping[tuple[int, bool], str] = {
    (CommandNumber.SETV, True): "forward_mps",
    (CommandNumber.SETRV, True): "turn_radps",
    (CommandNumber.SETA, True): "accel_mps2",
    (CommandNumber.SETA, False): "decel_mps2",
    (CommandNumber.SETRA, True): "turn_accel_radps2",
    (CommandNumber.SETRA, False): "turn_decel_radps2",
}

#: ENABLE goes out so often, so far apart.
ENABLE_TIMES, ENABLE_EVERY_NS = 3, 200 * NS_PER_MS
#: chosen: flags that report off are ignored for so long after ENABLE: three packets.
GRACE_NS: Nanos = 800 * NS_PER_MS
#: Why motors went off, by the flags.
BUTTON_IS_PRESSED, BUTTON_WAS_PRESSED = "the STOP button is pressed", "the STOP button was pressed"
#: chosen: 1 deg/s is 3 mm/s at the rim of a 2-DX, speeds are whole mm/s, and motors hunt.
TOLERANCE_MPS = 0.04
#: chosen: beside it, for large robots at speed.
TOLERANCE_SHARE = 0.15
#: chosen: less than a tenth of what the gentlest acceleration makes between two packets.
PROGRESS_MPS = 0.002


@dataclass(frozen=True, slots=True)
class Speeds:
    """What VEL and RVEL carry: whole mm/s forward and deg/s counter-clockwise."""

    forward_mm_s: int = 0
    turn_deg_s: int = 0

    @classmethod
    def of(cls, forward_mps: float, turn_radps: float) -> "Speeds":
        """Round SI units to what the wire can carry."""
        return cls(round(forward_mps * 1000), round(math.degrees(turn_radps)))

    @property
    def forward_mps(self) -> float:
        """Metres a second."""
        return self.forward_mm_s / 1000

    @property
    def turn_radps(self) -> float:
        """Radians a second."""
        return math.radians(self.turn_deg_s)

    @property
    def are_zero(self) -> bool:
        """Whether the robot is to stand."""
        return self == STILL


STILL = Speeds()


class Mover:
    """Keeps one robot moving as it was last asked.

    Args:
        settings: The client's.
        observer: What is known of the robot.
        send: Sends a command of the open session.
        send_first: Sends one before all that waits; `is_still`: at once.
        drop: Drops those commands, by number, that have not left yet.
        notify: Takes what the program is to know.
    """

    def __init__(
        self,
        settings: ClientSettings,
        observer: Observer,
        *,
        send: Callable[[Command, Nanos], None],
        send_first: "SendFirst",
        drop: Callable[[Container[int]], None],
        notify: Callable[[Notice], None],
    ) -> None:
        self._settings = settings
        self._observer = observer
        self._send = send
        self._send_first = send_first
        self._drop = drop
        self._notify = notify
        self._speeds = SpeedKeeper(spacing_ns=settings.speed_spacing_ns, refresh_ns=settings.refresh_ns)
        self._sent = SentMotion()
        self._motors = MotorState()
        self._plausibility = PlausibilityCheck(settings.plausibility_ns)
        self._goal: MotionGoal | None = None
        #: Puts the robot's largest speed back after a goal with its own.
        self._speed_back: Command | None = None
        self._set_limits: dict[str, float] = {}
        self._called_at: Nanos = 0
        #: When the deadman last stopped the robot: where no STOP has left since, it does so again.
        self._tripped_at: Nanos = 0

    @property
    def commanded(self) -> Speeds:
        """The speeds that are held; zero while nothing or a goal moves the robot."""
        return self._speeds.wanted

    @property
    def has_goal(self) -> bool:
        """Whether a `drive` or a `turn` is under way."""
        return self._goal is not None

    def limits(self, own: Limits) -> Limits:
        """Return the robot's limits, with those that were set in this session in their place."""
        return replace(own, **self._set_limits)

    def touch(self, now: Nanos) -> None:
        """Note a call of the program, for the deadman."""
        self._called_at = now

    # What the program asks ----------------------------------------------------------------

    def require_motors(self, now: Nanos) -> None:
        """Switch the motors on, where the client may.

        Raises:
            MotorsDisabledError: It may not: somebody switched them off, or the settings forbid it.
        """
        if self._motors.are_on:
            return
        if self._motors.taken_off is not None:
            raise MotorsDisabledError(f"motors are disabled: {self._motors.taken_off}", hint="robot.enable()")
        if not self._settings.auto_enable:
            raise MotorsDisabledError("motors are disabled: they are after every OPEN", hint="robot.enable()")
        self.enable(True, now)

    def enable(self, on: bool, now: Nanos) -> None:
        """Switch the motors."""
        if not on and (self._goal is not None or self._may_move):  # a STOP for each of a flood would hold ENABLE off
            self._switched_off("motors off", now)
        if self._motors.ask(on=on, now=now):
            self._observer.firmware.take_motors_asked(on)
            self._drop({CommandNumber.ENABLE})  # what the newest overtakes is never sent
            self._send(enable(on), now)

    def set_velocity(self, speeds: Speeds, now: Nanos) -> None:
        """Hold these speeds."""
        self._end_goal("another speed was set", now)
        self._hold(speeds, now)

    def stop(self, why: str, now: Nanos, *, at_once: bool = False) -> None:
        """Stop, and hold zero speeds."""
        self._end(why, now, at_once=at_once)

    def take_gap(self, gap_ns: Nanos, now: Nanos) -> None:
        """Stop at once, and hold zero speeds where something moved the robot: what was asked is out of date."""
        was_moving = self._goal is not None or self._may_move
        self._end_goal(f"the program or its machine paused for {gap_ns / NS_PER_S:.1f} s", now)
        self._drop(MOTION_NUMBERS)
        self._send_first(stop(), now, is_still=True)
        if was_moving:
            self._hold(STILL, now)
            self._notify(GapStopped(gap_ns))

    def begin_goal(
        self, axis: MotionAxis, limit_ns: Nanos | None, speed: float | None, limits: Limits, now: Nanos
    ) -> MotionGoal:
        """Begin a goal; its end is a `MotionEnded`.

        Raises:
            UsageError: The way, angle or speed is no number, or the speed is not positive.
            LocalProtocolError: No packet has shown where the robot is.
        """
        if speed is not None:
            speed = as_number(speed, "a motion's speed", "m/s or rad/s")
        if not math.isfinite(axis.asked) or (speed is not None and not (math.isfinite(speed) and speed > 0)):
            raise UsageError(f"{axis.what} at {speed} is no motion")
        state = self._observer.state
        if state is None:
            raise LocalProtocolError("the robot has not sent its position yet", hint="wait for a state")
        self._drop(WAYS)
        if self._may_move:  # MOVE leaves a rotation as it is, and HEAD a translation
            self._send_first(stop(), now)
        self.release("another goal", now)
        if speed is not None:
            usual = axis.speed_of(limits)
            limits = axis.with_speed(limits, min(speed, usual))
            self._send(axis.speed_command(min(speed, usual)), now)
            self._speed_back = axis.speed_command(usual)
        goal = self._goal = MotionGoal(axis, limit_ns)
        command = goal.begin(state, limits, now)
        if command is not None:
            self._send(command, now)
        return goal

    def cancel_goal(self, goal: MotionGoal, now: Nanos) -> None:
        """Stop, if this goal is still under way."""
        if self._goal is goal:
            self.stop("cancelled", now)

    def note(self, command: Command, now: Nanos) -> None:
        """Take note of a command that the program sends by itself."""
        if command.number in MOTION_NUMBERS:
            self._drop(WAYS)
            self.release("another command", now)
        elif command.number == CommandNumber.ENABLE and command.integer == 0:
            self._switched_off("motors off", now)
        elif command.number == CommandNumber.PTUPOS:
            self._observer.firmware.take_servo_set()
        value = command.integer
        name = LIMIT_NAMES.get((command.number, value is not None and value > 0))
        if name is not None and value:
            is_turn = command.number in {CommandNumber.SETRV, CommandNumber.SETRA}
            self._set_limits[name] = math.radians(abs(value)) if is_turn else abs(value) / 1000

    # What happens -------------------------------------------------------------------------

    def new_session(self) -> None:
        """Know that the motors are off, and the limits the robot's own."""
        self._motors.new_session()
        self._sent = SentMotion()  # STOP, VEL 0 and RVEL 0 went before the session, or nobody has opened it before
        self._set_limits.clear()  # CLOSE takes the robot back to its own

    def release(self, why: str, now: Nanos) -> None:
        """Forget what was asked, and send nothing: another movement takes its place, or the link is lost."""
        self._end_goal(why, now)
        self._speeds.release()
        self._plausibility.expect(None, self._observer.wheels_mps, now)

    def lose(self, now: Nanos) -> None:
        """Take the loss of the link: nothing more can be sent."""
        self._speed_back = None
        self.release("the link was lost", now)
        self.new_session()

    def take(self, state: RobotState, now: Nanos) -> None:
        """Hold a state against what was asked."""
        wheels = (state.left_mps, state.right_mps)
        if (reason := self._motors.take(state, now)) is not None:
            self._switched_off("the motors went off", now)
            self._notify(MotorsDisabled(f"motors are disabled: {reason}"))
        elif self._motors.are_reported_off(state, now) and wheels != (0.0, 0.0):
            self._send_first(stop(), now)
        doubt = self._plausibility.take(wheels, stalled=state.is_stalled, now=now)
        if doubt is not None:
            stands = max(map(abs, wheels)) == 0
            advice = "; are the motors disabled (MOTORS button, STOP button)?" if stands else ""
            self._notify(Disobeyed(doubt + advice))
        self._follow_goal(state, now)

    def deadlines(self) -> list[Nanos | None]:
        """Return when speeds, ENABLE, a goal's end and the deadman are due."""
        goal = None if self._goal is None else self._goal.next_deadline()
        return [self._speeds.next_deadline(), self._motors.next_deadline(), goal, self._deadman_due()]

    def act(self, now: Nanos) -> None:
        """Do what is due at `now` in an open session."""
        if (deadman := self._deadman_due()) is not None and now >= deadman:
            self._notify(DeadmanStopped(now - self._called_at))
            self.stop("deadman", now)
            self._tripped_at = now
        if self._goal is not None and (late := self._goal.time_is_up(now)) is not None:
            self.stop(late, now)
        if self._motors.take_repeat(now):
            self._send(enable(True), now)
        due = self._speeds.next_deadline()
        if due is not None and now >= due:
            for command in self._speeds.take(now):
                self._send(command, now)

    def take_sent(self, frame: bytes) -> None:
        """Take note of a frame that leaves now."""
        if frame[PREFIX_BYTES] in MOTION_NUMBERS:
            self._sent.take(Command.from_frame(Frame.from_bytes(frame)))

    @property
    def _may_move(self) -> bool:
        """Whether the robot may move by what was sent, or is about to be."""
        return self._sent.may_move or not self._speeds.wanted.are_zero

    def _deadman_due(self) -> Nanos | None:
        timeout_ns = self._settings.deadman_ns
        if timeout_ns is None or not self._may_move:
            return None
        return max(self._called_at, self._tripped_at) + timeout_ns

    def _follow_goal(self, state: RobotState, now: Nanos) -> None:
        if self._goal is None:
            return
        command, arrived, problem = self._goal.take(state, now)
        if command is not None:
            self._send(command, now)
        if arrived or problem is not None:
            self._end(problem, now)

    def _end(self, why: str | None, now: Nanos, *, at_once: bool = False) -> None:
        """End what moves the robot: STOP before all that waits, and zero speeds held."""
        self._end_goal(why, now)
        self._drop(MOTION_NUMBERS)
        self._send_first(stop(), now)
        if at_once:
            self._send_first(Command(CommandNumber.E_STOP), now)
        self._hold(STILL, now)

    def _switched_off(self, why: str, now: Nanos) -> None:
        """Stop a robot whose motors go off: it can be pushed by hand from now on."""
        self._end(why, now)
        self._plausibility.expect(None, self._observer.wheels_mps, now)

    def _hold(self, speeds: Speeds, now: Nanos) -> None:
        self._speeds.hold(speeds)
        rim = speeds.turn_radps * self._observer.parameters.track_mm / 2000
        wheels = (speeds.forward_mps - rim, speeds.forward_mps + rim)
        self._plausibility.expect(wheels, self._observer.wheels_mps, now)

    def _end_goal(self, problem: str | None, now: Nanos) -> None:
        goal, self._goal = self._goal, None
        if goal is None:
            return
        result = goal.result(now)
        goal.ended = MotionEnded(goal.axis.what, result.asked, result.reached, result.took_ns, problem)
        self._notify(goal.ended)
        if self._speed_back is not None:
            self._send(self._speed_back, now)
            self._speed_back = None


class SendFirst(Protocol):
    """Sends a command before all that waits."""

    def __call__(self, command: Command, now: Nanos, *, is_still: bool = False) -> None:
        """Send it; `is_still`: at once, nothing was sent for long."""


class SentMotion:
    """Which ways the robot may move by the frames that have left, in a session."""

    def __init__(self) -> None:
        self._ways = 0

    @property
    def may_move(self) -> bool:
        """Whether a frame that moves the robot left, and since then neither STOP nor zero speeds."""
        return self._ways != 0

    def take(self, command: Command) -> None:
        """Take note of a command that leaves now; one without an argument sets nothing, as robots take it."""
        if command.number == CommandNumber.STOP:
            self._ways = 0
        elif command.number in WAYS and command.argument is not None:
            ways = WAYS[command.number]
            is_stand = command.number in SPEED_NUMBERS and command.argument == 0
            self._ways = self._ways & ~ways if is_stand else self._ways | ways


class SpeedKeeper:
    """The newest speeds, and when to send them."""

    def __init__(self, *, spacing_ns: Nanos, refresh_ns: Nanos) -> None:
        self._spacing_ns = spacing_ns
        self._refresh_ns = refresh_ns
        self.wanted = STILL
        self.is_held = False
        self._sent: Speeds | None = None
        self._sent_at: Nanos = 0

    def hold(self, speeds: Speeds) -> None:
        """Keep the robot at these speeds from now on."""
        self.wanted = speeds
        self.is_held = True

    def release(self) -> None:
        """Send nothing more: something else moves the robot, or nothing does."""
        self.wanted = STILL
        self.is_held = False
        self._sent = None

    def next_deadline(self) -> Nanos | None:
        """Return when the speeds are to be sent, or None while none are held; 0 for at once."""
        if not self.is_held:
            return None
        if self._sent is None:
            return self._sent_at + self._spacing_ns if self._sent_at else 0
        return self._sent_at + (self._spacing_ns if self.wanted != self._sent else self._refresh_ns)

    def take(self, now: Nanos) -> tuple[Command, Command]:
        """Return the two commands to send at `now`."""
        self._sent, self._sent_at = self.wanted, now
        return vel(self.wanted.forward_mm_s), rvel(self.wanted.turn_deg_s)


class MotorState:
    """What is known of the motors of one session after another."""

    def __init__(self) -> None:
        #: Whether ENABLE 1 was sent in this session and nothing has switched the motors off since.
        self.are_on = False
        #: Why they went off without a command, or None.
        self.taken_off: str | None = None
        self._left = 0
        self._due: Nanos | None = None
        self._asked_at: Nanos = 0
        #: What the program's newest ENABLE of this session said, and when it was sent.
        self._sent: tuple[bool, Nanos] | None = None

    def new_session(self) -> None:
        """Know that they are off."""
        self.are_on, self.taken_off = False, None
        self._left, self._due = 0, None
        self._sent = None

    def ask(self, *, on: bool, now: Nanos) -> bool:
        """Note what the program asks for; return whether ENABLE is to be sent now: the same again waits."""
        is_sent = self._sent is not None and self._sent[0] is on and now - self._sent[1] < ENABLE_EVERY_NS
        if is_sent and self.taken_off is None:
            return False
        self.are_on, self.taken_off = on, None
        self._asked_at = now
        self._sent = (on, now)
        self._left = ENABLE_TIMES - 1 if on else 0
        self._due = now + ENABLE_EVERY_NS if self._left else None
        return True

    def next_deadline(self) -> Nanos | None:
        """Return when ENABLE is to be sent again."""
        return self._due

    def take_repeat(self, now: Nanos) -> bool:
        """Return whether ENABLE is to be sent now."""
        if self._due is None or now < self._due:
            return False
        self._left -= 1
        self._due = now + ENABLE_EVERY_NS if self._left else None
        return True

    def are_reported_off(self, state: RobotState, now: Nanos) -> bool:
        """Tell whether the robot says that its motors are off, and ENABLE is not on its way."""
        return state.motors_enabled is False and not (self.are_on and now - self._asked_at < GRACE_NS)

    def take(self, state: RobotState, now: Nanos) -> str | None:
        """Take a state; return why the motors went off, once."""
        if state.motors_enabled:
            self._left, self._due = 0, None
        if self.taken_off == BUTTON_IS_PRESSED and not state.stop_button:
            self.taken_off = BUTTON_WAS_PRESSED
        if not self.are_on or state.motors_enabled is not False or now - self._asked_at < GRACE_NS:
            return None
        self.are_on = False
        self._left, self._due = 0, None
        self.taken_off = BUTTON_IS_PRESSED if state.stop_button else "they were switched off at the robot"
        return self.taken_off


class PlausibilityCheck:
    """Compares what was commanded with what the wheels do, in m/s of each wheel."""

    def __init__(self, timeout_ns: Nanos) -> None:
        self._timeout_ns = timeout_ns
        self._command: tuple[float, float] | None = None
        self._least_error = 0.0
        self._plausible_at: Nanos = 0
        self._has_reported = False
        self._was_near = False

    def expect(self, wheels: tuple[float, float] | None, measured: tuple[float, float], now: Nanos) -> None:
        """Take what the wheels are to do from now on; None: nothing is expected of them.

        A new command measures progress from where the wheels are, and buys no time.
        """
        if wheels == self._command:
            return
        if wheels is None or self._command is None:
            self._plausible_at, self._has_reported = now, False
        self._command = wheels
        if wheels is not None:
            self._least_error = self._error(measured)

    def take(self, measured: tuple[float, float], *, stalled: bool, now: Nanos) -> str | None:
        """Take the wheel speeds of a packet; return what is implausible, once, or None."""
        if self._command is None:
            return None
        error = self._error(measured)
        near = error <= TOLERANCE_MPS + TOLERANCE_SHARE * max(map(abs, self._command))
        if near or stalled or error <= self._least_error - PROGRESS_MPS:
            self._least_error, self._plausible_at, self._has_reported = error, now, False
            self._was_near = near
            return None
        if self._was_near:
            self._was_near, self._least_error = False, error  # it has left by itself: its way back counts from here
        if self._has_reported or now - self._plausible_at < self._timeout_ns:
            return None
        self._has_reported = True
        return (
            f"for {self._timeout_ns / NS_PER_S:g} s the wheels are at {measured[0]:.2f} and {measured[1]:.2f} m/s, "
            f"commanded {self._command[0]:.2f} and {self._command[1]:.2f}, and no stall flag"
        )

    def _error(self, measured: tuple[float, float]) -> float:
        command = self._command or measured
        return max(abs(command[0] - measured[0]), abs(command[1] - measured[1]))
