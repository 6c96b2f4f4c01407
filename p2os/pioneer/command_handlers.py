"""What each client command does to the robot: one small function a command, and the table of them.

Commands that are not in the table are unknown to this robot: they are counted
and ignored, as a real one ignores them. A command that needs a number and comes
without one is malformed and has no effect either.

Source: the command tables of the Pioneer 2 and Pioneer 2/3 H8 manuals; `docs`
says what each firmware does.
"""

import math
from collections.abc import Callable, Mapping
from enum import Enum

from p2os.command_table import BY_NUMBER
from p2os.commands import Command, CommandNumber
from p2os.pioneer.device_handlers import DEVICE_HANDLERS, Handler, number, plain, signed16
from p2os.pioneer.motion import NM_PER_MM, UDEG_PER_DEG, MotionLimits
from p2os.pioneer.works import Works
from p2os.profiles import Profile
from p2os.timing import Nanos


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


#: What has no effect.
IGNORED = frozenset({Effect.UNKNOWN, Effect.MALFORMED})


def apply(works: Works, command: Command, now: Nanos) -> Effect:
    """Let a command act."""
    handler = HANDLERS.get(command.number)
    if handler is None or not is_known(command.number, works):
        return Effect.UNKNOWN
    if not handler(works, command, now):
        return Effect.MALFORMED
    is_to_move = command.number in MOTION_COMMANDS and command.argument != 0
    return Effect.WAITS if is_to_move and not works.motors_enabled else Effect.DONE


def is_known(which: int, works: Works) -> bool:
    """Tell whether this firmware has a command; where no manual settles it, it has."""
    row = BY_NUMBER.get(which)
    return works.lenient or row is None or row.is_known_to(works.profile) is not False


def _nothing(_works: Works) -> None:
    """Feed the watchdog, which any packet does."""


def _enable(works: Works, value: int) -> None:
    """Switch the motors, which stay off while the red button is pressed."""
    if value and works.rack.switches.stop_button:
        works.notes.append(("motors stay off", "the stop button is pressed"))
        return
    works.motion.power(on=value != 0)


def _vel2(works: Works, command: Command, _now: Nanos) -> bool:
    """Set both wheels: the first byte on the wire is the right one (H8 manual, command 32).

    ARCOS makes a translation and a rotation of them, each within its limit.
    """
    if not isinstance(command.argument, int):
        return False
    right, left = command.signed_bytes
    drive = works.motion.set_wheels if works.profile is not Profile.ARCOS else works.motion.set_wheels_as_turn
    drive(left * works.vel2_divisor, right * works.vel2_divisor)
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

    return number(act)


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
    CommandNumber.PULSE: plain(_nothing),
    CommandNumber.OPEN: plain(_nothing),  # of a session that is open already
    CommandNumber.POLLING: _polling,
    CommandNumber.ENABLE: number(_enable),
    CommandNumber.SETA: _limit(MotionLimits.with_acceleration),
    CommandNumber.SETV: _limit(MotionLimits.with_max_velocity),
    CommandNumber.SETO: plain(lambda works: works.reckoning.set_origin()),
    CommandNumber.MOVE: number(_move),
    CommandNumber.ROTATE: number(lambda works, value: works.motion.set_rotation(value)),
    CommandNumber.SETRV: _limit(MotionLimits.with_max_rotation),
    CommandNumber.VEL: number(lambda works, value: works.motion.set_velocity(value)),
    CommandNumber.HEAD: number(_head),
    CommandNumber.DHEAD: number(_dhead),
    CommandNumber.CONFIG: plain(_config),
    CommandNumber.RVEL: number(lambda works, value: works.motion.set_rotation(value)),
    CommandNumber.DCHEAD: number(_dchead),
    CommandNumber.SETRA: _limit(MotionLimits.with_rotational_acceleration),
    CommandNumber.SONAR: _sonar,
    CommandNumber.STOP: plain(lambda works: works.motion.stop()),
    CommandNumber.VEL2: _vel2,
    CommandNumber.E_STOP: plain(lambda works: works.motion.stop_now()),
    CommandNumber.QSTOP: plain(lambda works: works.motion.stop_now()),
    **DEVICE_HANDLERS,
}

#: What moves the robot, once its motors are on.
MOTION_COMMANDS = frozenset(
    {
        CommandNumber.MOVE, CommandNumber.ROTATE, CommandNumber.VEL, CommandNumber.HEAD, CommandNumber.DHEAD,
        CommandNumber.RVEL, CommandNumber.DCHEAD, CommandNumber.VEL2,
    }
)  # fmt: skip
