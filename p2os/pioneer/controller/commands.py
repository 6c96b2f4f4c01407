"""What each client command does to the robot: one small function a command, and the table of them.

`apply` is the way in. Commands that are not in `HANDLERS` are unknown to this robot:
they are counted and ignored, as a real one ignores them. A command that needs a
number and comes without one is malformed and has no effect either. What a command
leaves to be sent or restarted it only notes in the context; the controller does it.

Devices that a robot does not have answer as the firmware does without them: a
GRIPPERpac of type 0, an empty playlist, an arm that is not connected.

Source: the command tables of the Pioneer 2 and Pioneer 2/3 H8 manuals
(`p2os.protocol.command_table` has which firmware knows what).

Invariant: a handler acts at once and within the context; none reads a clock or sends.
"""

import math
import struct
from collections.abc import Callable, Mapping
from enum import Enum

from p2os.pioneer.controller.context import Context
from p2os.pioneer.controller.motion import NM_PER_MM, UDEG_PER_DEG, MotionLimits
from p2os.pioneer.controller.packet_requests import Extra
from p2os.pioneer.devices.heading_sensors import CompassMode
from p2os.pioneer.devices.laser import EXTENDED
from p2os.protocol.bauds import BAUDS
from p2os.protocol.command_table import BY_NUMBER, MOTION_COMMANDS
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.profiles import Profile
from simbase.timing import NS_PER_MS, Nanos

Handler = Callable[[Context, Command, Nanos], bool]

_C = CommandNumber

#: A duration of SAY (M2: 20 ms).
SAY_UNIT_MS = 20
#: Least and most of SONARCYCLE, ms (H8 manual).
SONAR_CYCLE_MS = (2, 120)
#: Working gains and calibrations: reported by CONFIG, without effect here.
KEPT = {
    _C.ROTKP: "rotkp", _C.ROTKV: "rotkv", _C.ROTKI: "rotki", _C.TRANSKP: "transkp", _C.TRANSKV: "transkv",
    _C.TRANSKI: "transki", _C.REVCOUNT: "revcount", _C.DRIFTFACTOR: "driftfactor", _C.TICKSMM: "ticksmm",
    _C.GYROCALCCW: "gyroccw",
}  # fmt: skip
#: Of things that this robot does not have; taken in silence, as the firmware does.
NOT_FITTED = (
    _C.DOCK, _C.MOVINGBLINK, _C.CALCOMP, _C.ARM_POWER, _C.ARM_AUTOPARK, _C.ARM_GRIPPARK, _C.POWER_PC, _C.POWER_LRF,
    _C.POWER_5V, _C.POWER_12V, _C.POWER_AUX_PC, _C.POWER_TOUCHSCREEN, _C.POWER_PTZ, _C.POWER_AUDIO, _C.POWER_LRF2,
    _C.SETPBV, _C.ARM_INIT, _C.ARM_CHECK, _C.ARM_HOME, _C.ARM_PARK, _C.ARM_POS, _C.ARM_SPEED, _C.ARM_STOP, _C.LCD,
)  # fmt: skip
#: What sets up a simulated laser: the simulators' own numbers, and the older ones that ARIA sends.
LASER_COMMANDS = frozenset({
    _C.SIM_LRF_ENABLE, _C.SIM_LRF_SET_FOV_START, _C.SIM_LRF_SET_FOV_END, _C.SIM_LRF_SET_RES,
    _C.ADSEL, _C.GRIPPERVAL, _C.GRIPREQUEST, _C.GYROCALCW,
})  # fmt: skip
#: SIM_SET_POSE: x and y in mm, heading in degrees.
POSE = struct.Struct("<iii")
#: Orders of SIM_CTRL: ask for SIMINFO, and load a map by its name (AMRISim has two such).
SIM_CTRL_INFO, SIM_CTRL_LOAD_MAP = 6, frozenset({1, 2})


class CommandEffect(Enum):
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
IGNORED = frozenset({CommandEffect.UNKNOWN, CommandEffect.MALFORMED})


def apply(context: Context, command: Command, now: Nanos) -> CommandEffect:
    """Execute a command on the robot's parts, and return what has become of it."""
    handler = HANDLERS.get(command.number)
    if handler is None or not is_known(command.number, context):
        return CommandEffect.UNKNOWN
    if not handler(context, command, now):
        return CommandEffect.MALFORMED
    is_to_move = command.number in MOTION_COMMANDS and command.argument != 0
    return CommandEffect.WAITS if is_to_move and not context.motors_enabled else CommandEffect.DONE


def is_known(which: int, context: Context) -> bool:
    """Tell whether this firmware has a command; where no manual settles it, it has."""
    row = BY_NUMBER.get(which)
    if which in LASER_COMMANDS and context.devices.laser.is_fitted:
        return True
    return context.lenient or row is None or row.is_known_to(context.profile) is not False


# Motion and sonar ----------------------------------------------------------------------


def _nothing(_context: Context) -> None:
    """Feed the watchdog, which any packet does."""


def _enable(context: Context, value: int) -> None:
    """Switch the motors, which stay off while the red button is pressed."""
    if value and context.devices.switches.stop_button:
        context.notes.append(("motors stay off", "the stop button is pressed"))
        return
    context.motion.power(on=value != 0)


def _vel2(context: Context, command: Command, _now: Nanos) -> bool:
    """Set both wheels: the first byte on the wire is the right one (H8 manual, command 32).

    ARCOS makes a translation and a rotation of them, each within its limit.
    """
    if not isinstance(command.argument, int):
        return False
    right, left = command.signed_bytes
    drive = context.motion.set_wheels if context.profile is not Profile.ARCOS else context.motion.set_wheels_as_turn
    drive(left * context.vel2_divisor, right * context.vel2_divisor)
    return True


def _head(context: Context, degrees: int) -> None:
    zero = round(math.degrees(context.reckoning.zero_rad) * UDEG_PER_DEG)
    context.motion.turn_to(zero + degrees * UDEG_PER_DEG)


def _dhead(context: Context, degrees: int) -> None:
    context.motion.turn_to(context.heading_udeg + degrees * UDEG_PER_DEG)


def _dchead(context: Context, degrees: int) -> None:
    goal = context.motion.heading_goal_udeg
    context.motion.turn_to((context.heading_udeg if goal is None else goal) + degrees * UDEG_PER_DEG)


def _move(context: Context, mm: int) -> None:
    context.motion.move_to(context.travel_nm + mm * NM_PER_MM)


def _limit(change: Callable[[MotionLimits, int], MotionLimits]) -> Handler:
    """Return a handler that changes the limits of the motion."""

    def act(context: Context, value: int) -> None:
        context.motion.limits = change(context.motion.limits, value)

    return _number(act)


def _sonar(context: Context, value: int, now: Nanos) -> None:
    """Switch all sonar, or one array.

    AROS and ARCOS: "otherwise, use bits 1-3 to specify an individual array number 1-4", which leaves bit 0 for on and
    off, as with 1 and 0 for all. ARIA sends no other value than these two. P2OS's manual knows no arrays.
    """
    array, is_on = (value & 0xFFFF) >> 1, value & 1
    if array == 0 or context.profile is Profile.P2OS:
        context.sonar.switch(on=value != 0, now=now)
    elif array in context.sonar.fitted_arrays:
        context.sonar.switch(on=is_on != 0, now=now, array=array)
    else:
        context.notes.append(("no such sonar", f"array {array}"))


def _polling(context: Context, command: Command, now: Nanos) -> bool:
    """Set the firing order; on the wire sonar are numbered from 1."""
    if not isinstance(command.argument, bytes):
        return False
    context.sonar.poll([sonar - 1 for sonar in command.argument], now)
    return True


def _config(context: Context) -> None:
    context.config_wanted = True


# Devices and packets -------------------------------------------------------------------


def _digout(context: Context, low: int, high: int) -> None:
    """Set outputs: the high byte is the mask, as all tables have it; one worked example (M4 p. 49) differs."""
    context.devices.pins.drive(high, low)


def _tcm2(context: Context, value: int) -> None:
    if value == CompassMode.ONE_PACKET:
        context.requests.set(Extra.COMPASS, 1)
        return
    context.devices.compass.command(value)
    context.requests.set(Extra.COMPASS, 2 if value == CompassMode.CONTINUOUS else 0)


def _gyro(context: Context, value: int, now: Nanos) -> None:
    context.devices.gyro.switch(on=value != 0, now=now)
    context.requests.set(Extra.GYRO, 2 if context.devices.gyro.is_on else 0)


def _joydrive(context: Context, value: int) -> None:
    context.devices.joystick.may_drive = value != 0
    context.follow_joystick()


def _say(context: Context, data: bytes) -> None:
    milliseconds = sum(data[0:40:2]) * SAY_UNIT_MS
    context.notes.append(("says", f"{min(len(data) // 2, 20)} tones, {milliseconds / 1000:g} s"))


def _sound(context: Context, value: int) -> None:
    context.notes.append(("plays sound", str(value)))


def _bump_stall(context: Context, value: int) -> None:
    context.devices.switches.bump_stall = value & 3


def _e_stall(context: Context, value: int) -> None:
    context.devices.switches.e_stall = value != 0


def _hostbaud(context: Context, value: int) -> None:
    if 0 <= value < len(BAUDS):
        context.baud_wanted = BAUDS[value]


def _aux_baud(port: int) -> Handler:
    def act(context: Context, value: int) -> None:
        if 0 <= value < len(BAUDS):
            context.devices.aux[port - 1].baud = BAUDS[value]

    return _number(act)


def _aux_send(port: int) -> Handler:
    return _text(lambda context, data: context.devices.aux[port - 1].send(data))


def _aux_ask(port: int) -> Handler:
    return _number(lambda context, value: context.devices.aux[port - 1].request(value))


def _sonar_cycle(context: Context, value: int, now: Nanos) -> None:
    least, most = SONAR_CYCLE_MS
    context.sonar.set_interval(min(max(value, least), most) * NS_PER_MS, now)


def _battest(context: Context, value: int) -> None:
    """Pretend a voltage (ARCOS, 0.1 V; 0 the true one), or a low one (AROS SHUTDOWN 1)."""
    battery = context.devices.battery
    if context.profile is Profile.AROS:
        battery.pretended_decivolts = context.low_battery_decivolts - 1 if value == 1 else None
        if value == 2:
            context.notes.append(("shuts the computer down", "SHUTDOWN 2"))
    else:
        battery.pretended_decivolts = value if value > 0 else None
    battery.is_test = True


def _restart(context: Context, what: str) -> None:
    context.restart_wanted = what


def _charge(context: Context, value: int) -> None:
    context.notes.append(("charger", "deployed" if value else "retracted"))


# Of simulators --------------------------------------------------------------------------


def _sim_set_pose(context: Context, command: Command, _now: Nanos) -> bool:
    """Move the robot in its world; the odometry goes on as if nothing had happened."""
    if not isinstance(command.argument, bytes) or len(command.argument) < POSE.size:
        return False
    context.pose_wanted = POSE.unpack_from(command.argument)
    return True


def _sim_reset(context: Context) -> None:
    context.sim_reset_wanted = True


def _sim_stat(context: Context, command: Command, _now: Nanos) -> bool:
    """Ask for SIMSTAT; without an argument for one."""
    context.requests.set(Extra.SIMSTAT, command.argument if isinstance(command.argument, int) else 1)
    return True


def _sim_message(context: Context, data: bytes) -> None:
    context.notes.append(("message", _shown_text(data)))


def _sim_exit(context: Context, value: int) -> None:
    context.exit_code = value & 0xFF
    context.notes.append(("exit wanted", f"code {value}"))


def _load_world(context: Context, data: bytes) -> None:
    context.world_wanted = data.split(b"\0")[0]


def _sim_ctrl(context: Context, command: Command, _now: Nanos) -> bool:
    """Take an order to the simulator itself: a number of two bytes, then what belongs to it."""
    argument = command.argument
    if argument is None or (isinstance(argument, bytes) and len(argument) < 2):
        return False
    data = argument if isinstance(argument, bytes) else (argument & 0xFFFF).to_bytes(2, "little")
    which = int.from_bytes(data[:2], "little")
    if which == SIM_CTRL_INFO:
        context.requests.set(Extra.SIMINFO, 1)
    elif which in SIM_CTRL_LOAD_MAP:
        _load_world(context, data[4 : 4 + int.from_bytes(data[2:4], "little")])
    else:
        context.notes.append(("SIM_CTRL ignored", f"order {which}"))
    return True


def _laser(act: Callable[[Context, int], None], otherwise: Handler | None = None) -> Handler:
    """Return a handler of the laser's setup; without a laser the number has its other meaning, if it has one."""

    def without(context: Context, _command: Command, _now: Nanos) -> bool:
        context.notes.append(("no laser", "a robot has one with --laser"))
        return True

    with_laser, without_laser = _number(act), otherwise or without
    return lambda context, command, now: (
        with_laser(context, command, now) if context.devices.laser.is_fitted else without_laser(context, command, now)
    )


def _laser_enable(context: Context, value: int) -> None:
    context.devices.laser.mode = min(max(value, 0), EXTENDED)
    context.requests.set(Extra.LASER, 2 if value > 0 else 0)


def _laser_start(context: Context, value: int) -> None:
    context.devices.laser.set_start(value)


def _laser_end(context: Context, value: int) -> None:
    context.devices.laser.set_end(value)


def _laser_step(context: Context, value: int) -> None:
    context.devices.laser.set_step(value)


def _shown_text(data: bytes) -> str:
    """Return a client's text as one line that is safe to print."""
    text = data.split(b"\0")[0].decode("latin-1")
    return "".join(sign if sign.isprintable() else "?" for sign in text)


# Handlers by what their command's argument is ------------------------------------------


def _signed16(command: Command) -> int | None:
    """Return a command's number as the robot reads it, or None when it has none.

    A positive argument from 32768 up is a negative number that a client has
    packed itself: no robot is commanded to drive at 32 m/s.
    """
    value = command.argument
    if not isinstance(value, int):
        return None
    return value - 0x10000 if 0x8000 <= value <= 0xFFFF else value


def _number(act: Callable[[Context, int], None]) -> Handler:
    """Return a handler of a command whose argument is one number."""
    return _timed(lambda context, value, _now: act(context, value))


def _plain(act: Callable[[Context], None]) -> Handler:
    """Return a handler of a command whose argument, if any, does not matter."""

    def handler(context: Context, _command: Command, _now: Nanos) -> bool:
        act(context)
        return True

    return handler


def _timed(act: Callable[[Context, int, Nanos], None]) -> Handler:
    """Return a handler of a number that acts from this moment on."""

    def handler(context: Context, command: Command, now: Nanos) -> bool:
        value = _signed16(command)
        if value is None:
            return False
        act(context, value, now)
        return True

    return handler


def _two_bytes(act: Callable[[Context, int, int], None]) -> Handler:
    """Return a handler of two bytes, the first on the wire first, the sign undone before they part."""

    def handler(context: Context, command: Command, _now: Nanos) -> bool:
        if not isinstance(command.argument, int):
            return False
        act(context, *command.two_bytes)
        return True

    return handler


def _text(act: Callable[[Context, bytes], None]) -> Handler:
    def handler(context: Context, command: Command, _now: Nanos) -> bool:
        if not isinstance(command.argument, bytes):
            return False
        act(context, command.argument)
        return True

    return handler


def _request(extra: Extra) -> Handler:
    return _number(lambda context, value: context.requests.set(extra, value))


def _laser_end_or_gripper() -> Handler:
    """Return a handler of the number that ARIA's laser shares with its gripper.

    Behind the beginning of the laser's field it is the field's end. Else 0, 1 or 2 ask for GRIPPERpac, as without one.
    """
    end, request = _laser(_laser_end, _request(Extra.GRIPPER)), _request(Extra.GRIPPER)

    def take(context: Context, command: Command, now: Nanos) -> bool:
        is_request = not context.devices.laser.is_end_due and _signed16(command) in {0, 1, 2}
        return (request if is_request else end)(context, command, now)

    return take


def _once(extra: Extra) -> Handler:
    return _plain(lambda context: context.requests.set(extra, 1))


def _kept(name: str) -> Handler:
    """Take a number that changes nothing here: gains, calibrations, lamps, power of things that are not fitted."""
    return _number(lambda context, value: context.kept.__setitem__(name, value))


HANDLERS: Mapping[int, Handler] = {
    # motion and sonar
    _C.PULSE: _plain(_nothing),
    _C.OPEN: _plain(_nothing),  # of a session that is open already
    _C.POLLING: _polling,
    _C.ENABLE: _number(_enable),
    _C.SETA: _limit(MotionLimits.with_acceleration),
    _C.SETV: _limit(MotionLimits.with_max_velocity),
    _C.SETO: _plain(lambda context: context.reckoning.set_origin()),
    _C.MOVE: _number(_move),
    _C.ROTATE: _number(lambda context, value: context.motion.set_rotation(value)),
    _C.SETRV: _limit(MotionLimits.with_max_rotation),
    _C.VEL: _number(lambda context, value: context.motion.set_velocity(value)),
    _C.HEAD: _number(_head),
    _C.DHEAD: _number(_dhead),
    _C.CONFIG: _plain(_config),
    _C.RVEL: _number(lambda context, value: context.motion.set_rotation(value)),
    _C.DCHEAD: _number(_dchead),
    _C.SETRA: _limit(MotionLimits.with_rotational_acceleration),
    _C.SONAR: _timed(_sonar),
    _C.STOP: _plain(lambda context: context.motion.stop()),
    _C.VEL2: _vel2,
    _C.E_STOP: _plain(lambda context: context.motion.stop_now()),
    _C.QSTOP: _plain(lambda context: context.motion.stop_now()),
    # devices and packets
    _C.SAY: _text(_say),
    _C.JOYREQUEST: _request(Extra.JOYSTICK),
    _C.ENCODER: _request(Extra.ENCODER),
    _C.DIGOUT: _two_bytes(_digout),
    _C.KICK: _timed(lambda context, value, now: context.devices.pins.kick(value, now)),
    _C.GRIPPER: _timed(lambda context, value, now: context.devices.gripper.command(value, now)),
    _C.ADSEL: _laser(_laser_enable, _number(lambda context, value: context.devices.pins.select(value))),
    _C.GRIPPERVAL: _laser(
        _laser_start, _number(lambda context, value: setattr(context.devices.gripper, "value", value))
    ),
    _C.GRIPREQUEST: _laser_end_or_gripper(),
    _C.IOREQUEST: _request(Extra.IO),
    _C.PTUPOS: _two_bytes(lambda context, width, port: context.devices.pins.set_servo(port, width)),
    _C.TTY2: _aux_send(1),
    _C.GETAUX: _aux_ask(1),
    _C.TTY3: _aux_send(2),
    _C.GETAUX2: _aux_ask(2),
    _C.TTY4: _aux_send(3),
    _C.GETAUX3: _aux_ask(3),
    _C.BUMPSTALL: _number(_bump_stall),
    _C.TCM2: _number(_tcm2),
    _C.JOYDRIVE: _number(_joydrive),
    _C.SONARCYCLE: _timed(_sonar_cycle),
    _C.HOSTBAUD: _number(_hostbaud),
    _C.AUX1BAUD: _aux_baud(1),
    _C.AUX2BAUD: _aux_baud(2),
    _C.AUX3BAUD: _aux_baud(3),
    _C.E_STALL: _number(_e_stall),
    _C.GYRO: _timed(_gyro),
    _C.BATTERYINFO: _request(Extra.BATTERY),
    _C.CHARGE: _number(_charge),
    _C.ARM_INFO: _once(Extra.ARM_INFO),
    _C.ARM_STATUS: _request(Extra.ARM),
    _C.SOUND: _number(_sound),
    _C.PLAYLIST: _once(Extra.PLAYLIST),
    _C.SOUNDTOG: _number(lambda _context, _value: None),
    _C.BATTEST: _number(_battest),
    _C.RESET: _plain(lambda context: _restart(context, "RESET")),
    _C.MAINTENANCE: _plain(lambda context: _restart(context, "MAINTENANCE")),
    **{number: _kept(name) for number, name in KEPT.items()},
    **dict.fromkeys(NOT_FITTED, _plain(lambda _context: None)),
    # of simulators
    _C.GYROCALCW: _laser(_laser_step, _kept("gyrocw")),
    _C.LOADWORLD: _text(_load_world),
    _C.RESETSIMTOORIGIN: _plain(_sim_reset),
    _C.SIM_SET_POSE: _sim_set_pose,
    _C.SIM_RESET: _plain(_sim_reset),
    _C.SIM_LRF_ENABLE: _laser(_laser_enable),
    _C.SIM_LRF_SET_FOV_START: _laser(_laser_start),
    _C.SIM_LRF_SET_FOV_END: _laser(_laser_end),
    _C.SIM_LRF_SET_RES: _laser(_laser_step),
    _C.SIM_CTRL: _sim_ctrl,
    _C.SIM_STAT: _sim_stat,
    _C.SIM_MESSAGE: _text(_sim_message),
    _C.SIM_EXIT: _number(_sim_exit),
}
