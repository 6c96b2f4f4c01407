"""What each command does to the robot's devices: the table beside that of motion and sonar.

Source: the command tables of the manuals (`p2os.command_table`). Devices that a
robot does not have answer as the firmware does without them: a GRIPPERpac of
type 0, an empty playlist, an arm that is not connected.
"""

from collections.abc import Callable, Mapping

from p2os.commands import Command, CommandNumber
from p2os.pioneer.devices.heading_sensors import CompassMode
from p2os.pioneer.flash import BAUD_RATES
from p2os.pioneer.requests import Extra
from p2os.pioneer.works import Works
from p2os.profiles import Profile
from p2os.timing import NS_PER_MS, Nanos

Handler = Callable[[Works, Command, Nanos], bool]

#: A duration of SAY (M2: 20 ms).
SAY_UNIT_MS = 20
#: Least and most of SONARCYCLE, ms (H8 manual).
SONAR_CYCLE_MS = (2, 120)


def signed16(command: Command) -> int | None:
    """Return a command's number as the robot reads it, or None when it has none.

    A positive argument from 32768 up is a negative number that a client has
    packed itself: no robot is told to drive at 32 m/s.
    """
    value = command.argument
    if not isinstance(value, int):
        return None
    return value - 0x10000 if 0x8000 <= value <= 0xFFFF else value


def number(act: Callable[[Works, int], None]) -> Handler:
    """Return a handler of a command whose argument is one number."""

    def handler(works: Works, command: Command, _now: Nanos) -> bool:
        value = signed16(command)
        if value is None:
            return False
        act(works, value)
        return True

    return handler


def plain(act: Callable[[Works], None]) -> Handler:
    """Return a handler of a command whose argument, if any, does not matter."""

    def handler(works: Works, _command: Command, _now: Nanos) -> bool:
        act(works)
        return True

    return handler


def _timed(act: Callable[[Works, int, Nanos], None]) -> Handler:
    def handler(works: Works, command: Command, now: Nanos) -> bool:
        value = signed16(command)
        if value is None:
            return False
        act(works, value, now)
        return True

    return handler


def _two_bytes(act: Callable[[Works, int, int], None]) -> Handler:
    """Return a handler of two bytes, the first on the wire first, the sign undone before they part."""

    def handler(works: Works, command: Command, _now: Nanos) -> bool:
        if not isinstance(command.argument, int):
            return False
        act(works, *command.two_bytes)
        return True

    return handler


def _text(act: Callable[[Works, bytes], None]) -> Handler:
    def handler(works: Works, command: Command, _now: Nanos) -> bool:
        if not isinstance(command.argument, bytes):
            return False
        act(works, command.argument)
        return True

    return handler


def _request(extra: Extra) -> Handler:
    return number(lambda works, value: works.requests.set(extra, value))


def _once(extra: Extra) -> Handler:
    return plain(lambda works: works.requests.set(extra, 1))


def _digout(works: Works, low: int, high: int) -> None:
    """Set outputs: the high byte is the mask, as all tables have it; one worked example (M4 p. 49) differs."""
    works.rack.pins.drive(high, low)


def _tcm2(works: Works, value: int) -> None:
    if value == CompassMode.ONE_PACKET:
        works.requests.set(Extra.COMPASS, 1)
        return
    works.rack.compass.command(value)
    works.requests.set(Extra.COMPASS, 2 if value == CompassMode.CONTINUOUS else 0)


def _gyro(works: Works, value: int, now: Nanos) -> None:
    works.rack.gyro.switch(on=value != 0, now=now)
    works.requests.set(Extra.GYRO, 2 if works.rack.gyro.is_on else 0)


def _joydrive(works: Works, value: int) -> None:
    works.rack.joystick.may_drive = value != 0
    works.let_the_stick_drive()


def _say(works: Works, data: bytes) -> None:
    milliseconds = sum(data[0:40:2]) * SAY_UNIT_MS
    works.notes.append(("says", f"{min(len(data) // 2, 20)} tones, {milliseconds / 1000:g} s"))


def _sound(works: Works, value: int) -> None:
    works.notes.append(("plays sound", str(value)))


def _buzzer(works: Works, value: int) -> None:
    works.rack.switches.buzzer = value != 0


def _bump_stall(works: Works, value: int) -> None:
    works.rack.switches.bump_stall = value & 3


def _e_stall(works: Works, value: int) -> None:
    works.rack.switches.e_stall = value != 0


def _hostbaud(works: Works, value: int) -> None:
    if 0 <= value < len(BAUD_RATES):
        works.baud_wanted = BAUD_RATES[value]


def _aux_baud(port: int) -> Handler:
    def act(works: Works, value: int) -> None:
        if 0 <= value < len(BAUD_RATES):
            works.rack.aux[port - 1].baud = BAUD_RATES[value]

    return number(act)


def _aux_send(port: int) -> Handler:
    return _text(lambda works, data: works.rack.aux[port - 1].send(data))


def _aux_ask(port: int) -> Handler:
    return number(lambda works, value: works.rack.aux[port - 1].request(value))


def _sonar_cycle(works: Works, value: int, now: Nanos) -> None:
    least, most = SONAR_CYCLE_MS
    works.sonar.set_interval(min(max(value, least), most) * NS_PER_MS, now)


def _battest(works: Works, value: int) -> None:
    """Pretend a voltage (ARCOS, 0.1 V; 0 the true one), or a low one (AROS SHUTDOWN 1)."""
    battery = works.rack.battery
    if works.profile is Profile.AROS:
        battery.pretended_decivolts = works.low_battery_decivolts - 1 if value == 1 else None
        if value == 2:
            works.notes.append(("shuts the computer down", "SHUTDOWN 2"))
    else:
        battery.pretended_decivolts = value if value > 0 else None
    battery.is_test = True


def _restart(works: Works, what: str) -> None:
    works.restart_wanted = what


def _charge(works: Works, value: int) -> None:
    works.notes.append(("charger", "deployed" if value else "retracted"))


def _kept(name: str) -> Handler:
    """Take a number that changes nothing here: gains, calibrations, lamps, power of things that are not fitted."""
    return number(lambda works, value: works.kept.__setitem__(name, value))


_C = CommandNumber
#: Working gains and calibrations: told back by CONFIG, felt by nothing here.
KEPT = {
    _C.ROTKP: "rotkp", _C.ROTKV: "rotkv", _C.ROTKI: "rotki", _C.TRANSKP: "transkp", _C.TRANSKV: "transkv",
    _C.TRANSKI: "transki", _C.REVCOUNT: "revcount", _C.DRIFTFACTOR: "driftfactor", _C.TICKSMM: "ticksmm",
    _C.GYROCALCW: "gyrocw", _C.GYROCALCCW: "gyroccw",
}  # fmt: skip
#: Of things that this robot does not have; taken in silence, as the firmware does.
NOT_FITTED = (
    _C.DOCK, _C.MOVINGBLINK, _C.CALCOMP, _C.ARM_POWER, _C.ARM_AUTOPARK, _C.ARM_GRIPPARK, _C.POWER_PC, _C.POWER_LRF,
    _C.POWER_5V, _C.POWER_12V, _C.POWER_AUX_PC, _C.POWER_TOUCHSCREEN, _C.POWER_PTZ, _C.POWER_AUDIO, _C.POWER_LRF2,
    _C.ARM_INIT, _C.ARM_CHECK, _C.ARM_HOME, _C.ARM_PARK, _C.ARM_POS, _C.ARM_SPEED, _C.ARM_STOP, _C.LCD,
)  # fmt: skip

DEVICE_HANDLERS: Mapping[int, Handler] = {
    _C.SAY: _text(_say),
    _C.JOYREQUEST: _request(Extra.JOYSTICK),
    _C.ENCODER: _request(Extra.ENCODER),
    _C.DIGOUT: _two_bytes(_digout),
    _C.GRIPPER: _timed(lambda works, value, now: works.rack.gripper.command(value, now)),
    _C.ADSEL: number(lambda works, value: works.rack.pins.select(value)),
    _C.GRIPPERVAL: number(lambda works, value: setattr(works.rack.gripper, "value", value)),
    _C.GRIPREQUEST: _request(Extra.GRIPPER),
    _C.IOREQUEST: _request(Extra.IO),
    _C.PTUPOS: _two_bytes(lambda works, width, port: works.rack.pins.set_servo(port, width)),
    _C.TTY2: _aux_send(1),
    _C.GETAUX: _aux_ask(1),
    _C.TTY3: _aux_send(2),
    _C.GETAUX2: _aux_ask(2),
    _C.TTY4: _aux_send(3),
    _C.GETAUX3: _aux_ask(3),
    _C.BUMPSTALL: number(_bump_stall),
    _C.TCM2: number(_tcm2),
    _C.JOYDRIVE: number(_joydrive),
    _C.SONARCYCLE: _timed(_sonar_cycle),
    _C.HOSTBAUD: number(_hostbaud),
    _C.AUX1BAUD: _aux_baud(1),
    _C.AUX2BAUD: _aux_baud(2),
    _C.AUX3BAUD: _aux_baud(3),
    _C.E_STALL: number(_e_stall),
    _C.GYRO: _timed(_gyro),
    _C.BATTERYINFO: _request(Extra.BATTERY),
    _C.CHARGE: number(_charge),
    _C.ARM_INFO: _once(Extra.ARM_INFO),
    _C.ARM_STATUS: _request(Extra.ARM),
    _C.SOUND: number(_sound),
    _C.PLAYLIST: _once(Extra.PLAYLIST),
    _C.SOUNDTOG: number(_buzzer),
    _C.BATTEST: number(_battest),
    _C.RESET: plain(lambda works: _restart(works, "RESET")),
    _C.MAINTENANCE: plain(lambda works: _restart(works, "MAINTENANCE")),
    **{number_: _kept(name) for number_, name in KEPT.items()},
    **dict.fromkeys(NOT_FITTED, plain(lambda _works: None)),
}
