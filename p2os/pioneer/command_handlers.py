"""What each client command does to the robot: one small function a command, and the table of them.

Commands that are not in the table are unknown to this robot: they are counted
and ignored, as a real one ignores them. A command that needs a number and comes
without one is malformed and has no effect either.

Source: the command tables of the Pioneer 2 and Pioneer 2/3 H8 manuals; `docs`
says what each firmware does.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from p2os.commands import Command, CommandNumber
from p2os.pioneer.motion import NM_PER_MM, UDEG_PER_DEG, Motion, MotionLimits
from p2os.pioneer.odometry_counts import DeadReckoning
from p2os.pioneer.sonar_schedule import SonarSchedule
from p2os.timing import Nanos


@dataclass(slots=True, kw_only=True)
class Works:
    """The parts of a robot that commands act on."""

    motion: Motion
    reckoning: DeadReckoning
    sonar: SonarSchedule
    vel2_divisor: int
    #: Someone has asked for the configuration, and the answer has not been sent.
    config_wanted: bool = False

    @property
    def heading_udeg(self) -> int:
        """Return how far the robot has turned since the start, in micro-degrees."""
        return round(math.degrees(self.reckoning.turned_rad) * UDEG_PER_DEG)

    @property
    def travel_nm(self) -> int:
        """Return how far the robot has driven along its path since the start, in nanometres."""
        return round(self.reckoning.travel_mm * NM_PER_MM)

    @property
    def motors_enabled(self) -> bool:
        """Tell whether the wheels have power."""
        return self.motion.is_powered


#: Acts on the works and returns whether it could: False when an argument is missing.
Handler = Callable[[Works, Command, Nanos], bool]


class Effect(Enum):
    """What has become of a command."""

    #: It acts.
    DONE = "done"
    #: This robot does not know it; ignored.
    UNKNOWN = "unknown"
    #: Its number or text is missing; ignored.
    MALFORMED = "malformed"
    #: It is taken, and acts when the motors are on.
    WAITS = "motors are off (ENABLE 1 turns them on)"


def apply(works: Works, command: Command, now: Nanos) -> Effect:
    """Let a command act."""
    handler = HANDLERS.get(command.number)
    if handler is None:
        return Effect.UNKNOWN
    if not handler(works, command, now):
        return Effect.MALFORMED
    is_to_move = command.number in MOTION_COMMANDS and command.argument != 0
    return Effect.WAITS if is_to_move and not works.motors_enabled else Effect.DONE


def signed16(command: Command) -> int | None:
    """Return a command's number as the robot reads it, or None when it has none.

    A positive argument from 32768 up is a negative number that a client has
    packed itself: no robot is told to drive at 32 m/s.
    """
    value = command.argument
    if not isinstance(value, int):
        return None
    return value - 0x10000 if 0x8000 <= value <= 0xFFFF else value


def _number(act: Callable[[Works, int], None]) -> Handler:
    """Return a handler of a command whose argument is one number."""

    def handler(works: Works, command: Command, _now: Nanos) -> bool:
        value = signed16(command)
        if value is None:
            return False
        act(works, value)
        return True

    return handler


def _plain(act: Callable[[Works], None]) -> Handler:
    """Return a handler of a command whose argument, if any, does not matter."""

    def handler(works: Works, _command: Command, _now: Nanos) -> bool:
        act(works)
        return True

    return handler


def _nothing(_works: Works) -> None:
    """Feed the watchdog, which any packet does."""


def _vel2(works: Works, command: Command, _now: Nanos) -> bool:
    """Set both wheels: the first byte on the wire is the right one (H8 manual, command 32)."""
    if not isinstance(command.argument, int):
        return False
    right, left = command.signed_bytes
    works.motion.set_wheels(left * works.vel2_divisor, right * works.vel2_divisor)
    return True


def _head(works: Works, degrees: int) -> None:
    zero = round(math.degrees(works.reckoning.zero_rad) * UDEG_PER_DEG)
    works.motion.turn_to(zero + degrees * UDEG_PER_DEG)


def _dhead(works: Works, degrees: int) -> None:
    works.motion.turn_to(works.heading_udeg + degrees * UDEG_PER_DEG)


def _dchead(works: Works, degrees: int) -> None:
    goal = works.motion.heading_goal_udeg
    works.motion.turn_to((works.heading_udeg if goal is None else goal) + degrees * UDEG_PER_DEG)


def _move(works: Works, mm: int) -> None:
    works.motion.move_to(works.travel_nm + mm * NM_PER_MM)


def _limit(change: Callable[[MotionLimits, int], MotionLimits]) -> Handler:
    """Return a handler that changes the limits of the motion."""

    def act(works: Works, value: int) -> None:
        works.motion.limits = change(works.motion.limits, value)

    return _number(act)


def _sonar(works: Works, command: Command, now: Nanos) -> bool:
    value = signed16(command)
    if value is None:
        return False
    works.sonar.switch(on=value != 0, now=now)
    return True


def _polling(works: Works, command: Command, now: Nanos) -> bool:
    """Set the firing order; on the wire sonar are numbered from 1."""
    if not isinstance(command.argument, bytes):
        return False
    works.sonar.poll([number - 1 for number in command.argument], now)
    return True


def _config(works: Works) -> None:
    works.config_wanted = True


HANDLERS: Mapping[int, Handler] = {
    CommandNumber.PULSE: _plain(_nothing),
    CommandNumber.OPEN: _plain(_nothing),  # of a session that is open already
    CommandNumber.POLLING: _polling,
    CommandNumber.ENABLE: _number(lambda works, value: works.motion.power(on=value != 0)),
    CommandNumber.SETA: _limit(MotionLimits.with_acceleration),
    CommandNumber.SETV: _limit(MotionLimits.with_max_velocity),
    CommandNumber.SETO: _plain(lambda works: works.reckoning.set_origin()),
    CommandNumber.MOVE: _number(_move),
    CommandNumber.ROTATE: _number(lambda works, value: works.motion.set_rotation(value)),
    CommandNumber.SETRV: _limit(MotionLimits.with_max_rotation),
    CommandNumber.VEL: _number(lambda works, value: works.motion.set_velocity(value)),
    CommandNumber.HEAD: _number(_head),
    CommandNumber.DHEAD: _number(_dhead),
    CommandNumber.CONFIG: _plain(_config),
    CommandNumber.RVEL: _number(lambda works, value: works.motion.set_rotation(value)),
    CommandNumber.DCHEAD: _number(_dchead),
    CommandNumber.SETRA: _limit(MotionLimits.with_rotational_acceleration),
    CommandNumber.SONAR: _sonar,
    CommandNumber.STOP: _plain(lambda works: works.motion.stop()),
    CommandNumber.VEL2: _vel2,
    CommandNumber.E_STOP: _plain(lambda works: works.motion.stop_now()),
    CommandNumber.QSTOP: _plain(lambda works: works.motion.stop_now()),
}

#: What moves the robot, once its motors are on.
MOTION_COMMANDS = frozenset(
    {
        CommandNumber.MOVE, CommandNumber.ROTATE, CommandNumber.VEL, CommandNumber.HEAD, CommandNumber.DHEAD,
        CommandNumber.RVEL, CommandNumber.DCHEAD, CommandNumber.VEL2,
    }
)  # fmt: skip
