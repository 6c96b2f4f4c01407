"""Every client command: what it takes, in which unit and range, which firmware knows it, what it does.

How a command becomes bytes stands in `p2os.protocol.commands`.

Source: command tables of the Pioneer 2 (P2OS), Pioneer 2/3 H8 (AROS) and
Pioneer 3 (ARCOS) manuals; ARIA's list for what only ARIA and simulators name.
A version is the first one that the manual prints; "-" is not in that manual,
"?" has not been seen. Where sources contradict each other, the row says so.

Invariant: `ROWS` has one row for each `CommandNumber`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum

from p2os.errors import LocalProtocolError
from p2os.protocol.bauds import BAUDS
from p2os.protocol.profiles import Profile
from simbase.errors import nearest


class CommandNumber(IntEnum):
    """A client command by the manuals' word; where one number has two meanings, the table has both."""

    PULSE = 0
    OPEN = 1
    CLOSE = 2
    POLLING = 3
    ENABLE = 4
    SETA = 5
    SETV = 6
    SETO = 7
    MOVE = 8
    ROTATE = 9
    SETRV = 10
    VEL = 11
    HEAD = 12
    DHEAD = 13
    SETPBV = 14
    SAY = 15
    JOYREQUEST = 17
    CONFIG = 18
    ENCODER = 19
    SETRVDIR = 20
    RVEL = 21
    DCHEAD = 22
    SETRA = 23
    IMUREQUEST = 26
    SONAR = 28
    STOP = 29
    DIGOUT = 30
    TIMER = 31
    VEL2 = 32
    GRIPPER = 33
    KICK = 34
    ADSEL = 35
    GRIPPERVAL = 36
    GRIPREQUEST = 37
    GYROCALCW = 38
    GYROCALCCW = 39
    IOREQUEST = 40
    PTUPOS = 41
    TTY2 = 42
    GETAUX = 43
    BUMPSTALL = 44
    TCM2 = 45
    DOCK = 46
    JOYDRIVE = 47
    SONARCYCLE = 48
    MOVINGBLINK = 49
    HOSTBAUD = 50
    AUX1BAUD = 51
    AUX2BAUD = 52
    AUX3BAUD = 53
    E_STOP = 55
    E_STALL = 56
    QSTOP = 57
    GYRO = 58
    LCD = 59
    TTY4 = 60
    GETAUX3 = 61
    BATTERYINFO = 62
    LOADWORLD = 63
    STEP = 64
    CALCOMP = 65
    TTY3 = 66
    GETAUX2 = 67
    CHARGE = 68
    RESETSIMTOORIGIN = 69
    ARM_INFO = 70
    ARM_STATUS = 71
    ARM_INIT = 72
    ARM_CHECK = 73
    ARM_POWER = 74
    ARM_HOME = 75
    ARM_PARK = 76
    ARM_POS = 77
    ARM_SPEED = 78
    ARM_STOP = 79
    ARM_AUTOPARK = 80
    ARM_GRIPPARK = 81
    ROTKP = 82
    ROTKV = 83
    ROTKI = 84
    TRANSKP = 85
    TRANSKV = 86
    TRANSKI = 87
    REVCOUNT = 88
    DRIFTFACTOR = 89
    SOUND = 90
    PLAYLIST = 91
    SOUNDTOG = 92
    TICKSMM = 93
    POWER_PC = 95
    POWER_LRF = 96
    POWER_5V = 97
    POWER_12V = 98
    LATVEL = 110
    LATACCEL = 113
    RECENTERWHEELS = 120
    ACCELINFO = 123
    TORQUEINFO = 124
    POWER_AUX_PC = 125
    POWER_TOUCHSCREEN = 126
    POWER_PTZ = 127
    POWER_AUDIO = 128
    POWER_LRF2 = 129
    HEADINGINFO = 149
    ROTVEL_CLOSEDLOOP = 150
    SRECORD = 210
    MARCDEBUG = 211
    WHEEL_LIGHT = 212
    ABSOLUTE_MAXES = 213
    SAFETY_STATE_INFO = 214
    SAFETY_SET_STATE = 215
    SAFETY_DISABLE_POWER_OFF_TIMER = 216
    SAFETY_ZONE_ACTIVE = 217
    WHEELINFO_REQUEST = 218
    MARC_CONFIG_SET = 219
    MARC_CONFIG_GET = 220
    SIM_SET_POSE = 224
    SIM_RESET = 225
    SIM_MODEL_CONFIG = 226
    SIM_LRF_ENABLE = 230
    SIM_LRF_SET_FOV_START = 231
    SIM_LRF_SET_FOV_END = 232
    SIM_LRF_SET_RES = 233
    SIM_CTRL = 236
    SIM_STAT = 237
    SIM_MESSAGE = 238
    SIM_EXIT = 239
    BATTEST = 250
    DIGTEMPTEST = 251
    SPOOFANALOGTEMP = 252
    RESET = 253
    MAINTENANCE = 255


class Argument(Enum):
    """What a command carries."""

    #: Nothing: the frame's count is 3.
    NONE = "none"
    #: A sign (type byte 3B or 1B) and a magnitude of two bytes.
    INTEGER = "integer"
    #: An integer that is never negative.
    UNSIGNED = "unsigned"
    #: Two bytes in one integer.
    TWO_BYTES = "two bytes"
    #: Type byte 2B, a length byte, bytes.
    STRING = "string"
    #: Type byte 2B and bytes without a length; simulators only.
    DATA = "data"


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoBytes:
    """The names of the two bytes of an integer; `low` travels first."""

    low: str
    high: str
    #: Whether each is read as -128 to 127.
    is_signed: bool

    @property
    def limits(self) -> tuple[int, int]:
        """The range of each byte."""
        return (-128, 127) if self.is_signed else (0, 255)


#: What only simulators before MobileSim had.
OLD_SIMULATORS = frozenset({CommandNumber.LOADWORLD, CommandNumber.STEP, CommandNumber.RESETSIMTOORIGIN})
#: What fits the wire, where a row names no range of its own: integers are read as 16 bits with a sign.
WIRE_LIMITS: Mapping[Argument, tuple[int, int]] = {
    Argument.INTEGER: (-32767, 32767),
    Argument.UNSIGNED: (0, 65535),
    Argument.TWO_BYTES: (-32768, 65535),
    Argument.STRING: (0, 199),
    Argument.DATA: (0, 200),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandRow:
    """One client command."""

    number: CommandNumber
    #: What it may carry, the manual's own way first.
    kinds: tuple[Argument, ...]
    #: Unit of an integer, "" where it has none.
    unit: str
    #: Least and most: of an integer its value, of a string or data its length in bytes; None: what the wire holds.
    range: tuple[int, int] | None
    #: First firmware that has it, as printed: P2OS, AROS, ARCOS.
    versions: tuple[str, ...]
    meaning: str
    two_bytes: TwoBytes | None = None

    @property
    def name(self) -> str:
        """The manual's word."""
        return self.number.name

    @property
    def kind(self) -> Argument:
        """What the manual says it carries."""
        return self.kinds[0]

    @property
    def is_simulator_only(self) -> bool:
        """Whether no robot has it."""
        return self.name.startswith("SIM_") or self.number in OLD_SIMULATORS

    def version(self, profile: Profile) -> str:
        """Return the first firmware of a family that has it, "-" for none, "?" for not established."""
        return dict(zip(Profile, self.versions, strict=True))[profile]

    def is_known_to(self, profile: Profile) -> bool | None:
        """Return whether a family's manual lists it; None where that is not established."""
        return {"-": False, "?": None}.get(self.version(profile), True)

    def limits(self, kind: Argument) -> tuple[int, int]:
        """Return the range of one kind of argument, as `range` says it."""
        return self.range if self.range is not None and kind is not Argument.NONE else WIRE_LIMITS[kind]

    def check(self, argument: int | bytes | None) -> None:
        """Refuse an argument of another kind or out of range.

        Raises:
            LocalProtocolError: With what the command takes.
        """
        if argument is None and Argument.NONE in self.kinds:
            return
        for kind in self.kinds:
            if kind is Argument.NONE:
                continue
            is_bytes = kind in {Argument.STRING, Argument.DATA}
            if isinstance(argument, bytes) is not is_bytes or argument is None:
                continue
            least, most = self.limits(kind)
            size = len(argument) if isinstance(argument, bytes) else argument
            if least <= size <= most:
                return
        shown = f"{len(argument)} bytes" if isinstance(argument, bytes) else argument
        raise LocalProtocolError(f"{self.name}: {shown} is not what it takes: {self.takes}", hint=self.meaning)

    @property
    def takes(self) -> str:
        """What it takes, in words."""
        found = []
        for kind in self.kinds:
            if kind is Argument.NONE:
                found.append("no argument")
            elif self.two_bytes is not None:
                least, most = self.two_bytes.limits
                found.append(f"two bytes, {self.two_bytes.low} and {self.two_bytes.high}, each {least} to {most}")
            else:
                least, most = self.limits(kind)
                is_bytes = kind in {Argument.STRING, Argument.DATA}
                unit = " bytes" if is_bytes else f" {self.unit}" if self.unit else ""
                span = f"{least}" if least == most else f"{least} to {most}"
                found.append(f"{kind.value} of {span}{unit}")
        return " or ".join(found)

    def word(self, low: int, high: int) -> int:
        """Return the integer that carries two bytes.

        Raises:
            LocalProtocolError: The command carries no two bytes, or one is out of range.
        """
        if self.two_bytes is None:
            raise LocalProtocolError(f"{self.name} does not carry two bytes")
        least, most = self.two_bytes.limits
        if not (least <= low <= most and least <= high <= most):
            raise LocalProtocolError(f"{self.name}: {low}, {high} do not fit: {self.takes}")
        word = (high & 0xFF) << 8 | low & 0xFF
        return word if word < 0x8000 else word - 0x10000


def _row(
    number: CommandNumber,
    kinds: tuple[Argument, ...],
    unit: str,
    limits: tuple[int, int] | None,
    versions: str,
    meaning: str,
    two_bytes: TwoBytes | None = None,
) -> CommandRow:
    return CommandRow(
        number=number, kinds=kinds, unit=unit, range=limits, versions=tuple(versions.split()), meaning=meaning,
        two_bytes=two_bytes,
    )  # fmt: skip


_N, _A = CommandNumber, Argument
#: Number, kinds, unit, range, first P2OS, AROS and ARCOS, meaning, names of two bytes.
ROWS = (
    _row(_N.PULSE, (_A.NONE,), "", None, "1.0 1.0 1.0", "Reset the watchdog; the same bytes as SYNC0."),
    _row(_N.OPEN, (_A.NONE, _A.INTEGER), "", None, "1.0 1.0 1.0",
         "Start the servers and the SIPs; the same bytes as SYNC1. ARIA sends it with the integer 1."),
    _row(_N.CLOSE, (_A.NONE, _A.INTEGER), "", None, "1.0 1.0 1.0",
         "End the session; the same bytes as SYNC2. ARIA sends it with the integer 1."),
    _row(_N.POLLING, (_A.STRING,), "", (0, 64), "1.0 1.0 1.0",
         "Sonar firing order: a byte a sonar, counted from 1, repeats allowed; empty switches the sonar off."),
    _row(_N.ENABLE, (_A.INTEGER,), "", (0, 1), "1.0 1.0 1.0", "1 switches the motors on, 0 off."),
    _row(_N.SETA, (_A.INTEGER,), "mm/s2", None, "1.0 1.0 1.0",
         "Translational acceleration, or deceleration where negative."),
    _row(_N.SETV, (_A.INTEGER,), "mm/s", None, "1.0 1.0 1.0", "Largest translational speed; MOVE drives at it."),
    _row(_N.SETO, (_A.NONE,), "", None, "1.0 1.0 1.0", "Set the odometry to 0, 0, 0."),
    _row(_N.MOVE, (_A.INTEGER,), "mm", None, "yes 1.0 1.0", "Drive a distance, + forward; best within 5000 mm."),
    _row(_N.ROTATE, (_A.INTEGER,), "deg/s", None, "- 1.0 1.0", "As RVEL."),
    _row(_N.SETRV, (_A.INTEGER,), "deg/s", None, "1.0 1.0 1.0", "Largest rotational speed; HEAD and DHEAD turn at it."),
    _row(_N.VEL, (_A.INTEGER,), "mm/s", None, "1.0 1.0 1.0", "Translational speed, + forward."),
    _row(_N.HEAD, (_A.INTEGER,), "deg", None, "1.0 1.0 1.0", "Turn to an absolute heading, + counter-clockwise."),
    _row(_N.DHEAD, (_A.INTEGER,), "deg", None, "1.0 1.0 1.0",
         "Turn relative to the present heading, + counter-clockwise."),
    _row(_N.SETPBV, (_A.INTEGER,), "", None, "? - -",
         "No manual that could be found says what it does; ARIA calls number 14 one that does not really exist."),
    _row(_N.SAY, (_A.STRING,), "", (0, 40), "1.0 1.0 1.0",
         "Up to 20 pairs of duration (20 ms) and tone: 0 rest, 1 to 127 MIDI note, above (tone - 127) * 32 Hz."),
    _row(_N.JOYREQUEST, (_A.INTEGER,), "", (0, 2), "? yes 1.0", "JOYSTICKpac: 0 none, 1 one, 2 continuous."),
    _row(_N.CONFIG, (_A.NONE, _A.INTEGER), "", None, "1.4 1.0 1.0",
         "Ask for a CONFIGpac. ARIA sends it with the integer 1."),
    _row(_N.ENCODER, (_A.INTEGER,), "", (0, 2), "1.4 1.0 1.0",
         "ENCODERpac: 0 none, 1 one, 2 continuous (first P2OS: 1 is continuous)."),
    _row(_N.SETRVDIR, (_A.INTEGER,), "", None, "- - -", "Named by ARIA only; no firmware is known to have it."),
    _row(_N.RVEL, (_A.INTEGER,), "deg/s", None, "1.0 1.0 1.0", "Rotational speed, + counter-clockwise."),
    _row(_N.DCHEAD, (_A.INTEGER,), "deg", None, "yes yes 1.0",
         "Turn relative to the last heading set-point, + counter-clockwise."),
    _row(_N.SETRA, (_A.INTEGER,), "deg/s2", None, "1.0 1.0 1.0",
         "Rotational acceleration, or deceleration where negative."),
    _row(_N.IMUREQUEST, (_A.INTEGER,), "", (0, 2), "- - -", "Seekur: IMU packets, 0 none, 1 one, 2 continuous."),
    _row(_N.SONAR, (_A.INTEGER,), "", (0, 9), "1.0 1.0 1.0",
         "1 switches all sonar on, 0 off. AROS and ARCOS also one array of eight: its number, 1 to 4, in bits 1 to 3,"
         " on or off in bit 0 (4: array 2 off, 5: on)."),
    _row(_N.STOP, (_A.NONE,), "", None, "1.0 1.0 1.0", "Stop; the motors stay enabled."),
    _row(_N.DIGOUT, (_A.TWO_BYTES,), "", None, "1.2 1.0 1.0",
         "Digital outputs: one byte is the mask, one the states; the manuals contradict each other on which "
         "(`low_byte` travels first).",
         TwoBytes(low="low_byte", high="high_byte", is_signed=False)),
    _row(_N.TIMER, (_A.INTEGER,), "", None, "- - -", "PSOS; ARIA does not know what it does."),
    _row(_N.VEL2, (_A.TWO_BYTES,), "20 mm/s", None, "yes yes 1.1",
         "Wheel speeds in Vel2Divisor; P2OS and AROS drive the wheels directly.",
         TwoBytes(low="right", high="left", is_signed=True)),
    _row(_N.GRIPPER, (_A.INTEGER,), "", (1, 17), "yes yes 1.0",
         "1 open, 2 close, 3 stop, 4 lift up, 5 lift down, 6 lift stop, 7 store, 8 deploy, 15 halt, 16 pressure, "
         "17 lift carry."),
    _row(_N.KICK, (_A.INTEGER,), "ms", None, "? ? yes", "Hold the first digital output for so long, once."),
    _row(_N.ADSEL, (_A.INTEGER,), "", (0, 255), "? yes 1.0", "Select the analog port that the SIP shows."),
    _row(_N.GRIPPERVAL, (_A.INTEGER,), "", None, "yes yes 1.0", "Value for GRIPPER 16 and 17."),
    _row(_N.GRIPREQUEST, (_A.INTEGER,), "", (0, 2), "1.E yes 1.0", "GRIPPERpac: 0 none, 1 one, 2 continuous."),
    _row(_N.GYROCALCW, (_A.UNSIGNED,), "", None, "- - 2.0",
         "Gyro calibration, clockwise. A simulator with a laser takes 35 to 38 for SIM_LRF_ENABLE and what follows it: "
         "ARIA sends those."),
    _row(_N.GYROCALCCW, (_A.UNSIGNED,), "", None, "- - 2.0", "Gyro calibration, counter-clockwise."),
    _row(_N.IOREQUEST, (_A.INTEGER,), "", (0, 2), "1.E yes 1.0", "IOpac: 0 none, 1 one, 2 continuous."),
    _row(_N.PTUPOS, (_A.TWO_BYTES,), "", None, "1.2 yes ?", "Servo: port 1 to 4 and the width of its pulse in 10 us.",
         TwoBytes(low="pulse_width", high="servo", is_signed=False)),
    _row(_N.TTY2, (_A.STRING,), "", (0, 199), "1.0 yes 1.0", "Send bytes to the AUX1 serial port."),
    _row(_N.GETAUX, (_A.UNSIGNED,), "bytes", (0, 200), "1.4 yes 1.0",
         "Wait for so many bytes from AUX1 and send a SERAUXpac; 0 empties the buffer."),
    _row(_N.BUMPSTALL, (_A.INTEGER,), "", (0, 3), "1.5 yes 1.0",
         "Bumpers that cause a stall: 0 none, 1 front, 2 rear, 3 both."),
    _row(_N.TCM2, (_A.INTEGER,), "", (0, 7), "1.6 yes 1.0",
         "Compass: 0 off, 1 in the SIP, 2 one packet, 3 continuous, 4 user and 5 automatic calibration, 6 stop it,"
         " 7 reset."),
    _row(_N.DOCK, (_A.INTEGER,), "", (0, 2), "1.C ? -",
         "0 off, 1 docking signals on, 2 also stop when power is sensed."),
    _row(_N.JOYDRIVE, (_A.INTEGER,), "", (0, 1), "1.G yes 1.0",
         "1 lets the robot's own joystick drive while a client is connected."),
    _row(_N.SONARCYCLE, (_A.UNSIGNED,), "ms", (2, 120), "- 1.8 1.0", "Time of a ping, 40 ms by default."),
    _row(_N.MOVINGBLINK, (_A.INTEGER,), "", (0, 1), "- - ?", "PatrolBot: blink before moving."),
    _row(_N.HOSTBAUD, (_A.INTEGER,), "", (0, 4), "- 1.8 1.0",
         f"Baud of the host port: {', '.join(f'{code} {baud}' for code, baud in enumerate(BAUDS))}."),
    _row(_N.AUX1BAUD, (_A.INTEGER,), "", (0, 4), "- 1.8 1.0", "Baud of AUX1, as HOSTBAUD."),
    _row(_N.AUX2BAUD, (_A.INTEGER,), "", (0, 4), "- 1.8 1.0", "Baud of AUX2, as HOSTBAUD."),
    _row(_N.AUX3BAUD, (_A.INTEGER,), "", (0, 4), "- 1.8 1.0", "Baud of AUX3, as HOSTBAUD."),
    _row(_N.E_STOP, (_A.NONE, _A.INTEGER), "", None, "1.8 yes 1.0", "Stop at once, overriding the deceleration."),
    _row(_N.E_STALL, (_A.INTEGER,), "", (0, 1), "1.E yes 1.0",
         "1 lets the stop button cause a stall; off by default on P2OS, on by default after it."),
    _row(_N.QSTOP, (_A.NONE, _A.INTEGER), "", None, "- - ?", "Quick stop; AMRISim takes it for E_STOP."),
    _row(_N.GYRO, (_A.INTEGER,), "", (0, 2), "- 1.8 1.0",
         "GYROpac: 0 off, 1 on; ARIA's 2: heading from the gyro alone."),
    _row(_N.LCD, (_A.STRING,), "", (0, 199), "- - yes", "Three control bytes and up to 20 characters, NUL-terminated."),
    _row(_N.TTY4, (_A.STRING,), "", (0, 199), "- - 1.0", "Send bytes to AUX3."),
    _row(_N.GETAUX3, (_A.UNSIGNED,), "bytes", (0, 200), "- - 1.0", "As GETAUX, from AUX3."),
    _row(_N.BATTERYINFO, (_A.INTEGER,), "", (0, 2), "- - ?",
         "Battery packets: 0 none, 1 one, 2 continuous. An old simulator exits."),
    _row(_N.LOADWORLD, (_A.STRING,), "", (0, 199), "- - -",
         "Old simulators: load another world by its name; MobileSim has SIM_CTRL 1 for it."),
    _row(_N.STEP, (_A.NONE,), "", None, "1.0 - -", "One step of a simulator."),
    _row(_N.CALCOMP, (_A.INTEGER,), "", None, "- - ?", "Compass calibration."),
    _row(_N.TTY3, (_A.STRING,), "", (0, 199), "- 1.1 1.0", "Send bytes to AUX2."),
    _row(_N.GETAUX2, (_A.UNSIGNED,), "bytes", (0, 200), "- 1.1 1.0", "As GETAUX, from AUX2."),
    _row(_N.CHARGE, (_A.INTEGER,), "", (0, 1), "- 1.7 1.0", "1 deploys the charger, 0 retracts it."),
    _row(_N.RESETSIMTOORIGIN, (_A.NONE,), "", None, "- - -", "Old simulators: as SIM_RESET."),
    _row(_N.ARM_INFO, (_A.NONE,), "", None, "1.H 1.3 1.1", "Ask for an ARMINFOpac."),
    _row(_N.ARM_STATUS, (_A.INTEGER,), "", (0, 2), "1.H 1.3 1.1", "ARMpac: 0 none, 1 one, 2 continuous."),
    _row(_N.ARM_INIT, (_A.NONE,), "", None, "1.H 1.3 1.1", "Initialise the arm."),
    _row(_N.ARM_CHECK, (_A.NONE,), "", None, "1.H 1.3 1.1", "Look whether the arm answers."),
    _row(_N.ARM_POWER, (_A.INTEGER,), "", (0, 1), "1.H 1.3 1.1", "1 powers the arm's servos, 0 cuts them."),
    _row(_N.ARM_HOME, (_A.NONE, _A.INTEGER), "", None, "1.H 1.3 1.1", "Send the arm, or one joint, home."),
    _row(_N.ARM_PARK, (_A.NONE,), "", None, "1.H 1.3 1.1", "Park the arm."),
    _row(_N.ARM_POS, (_A.TWO_BYTES,), "", None, "1.H 1.3 1.1", "Send a joint (1 to 6) to a position.",
         TwoBytes(low="position", high="joint", is_signed=False)),
    _row(_N.ARM_SPEED, (_A.TWO_BYTES,), "", None, "1.H 1.3 1.1", "Set the speed of a joint.",
         TwoBytes(low="speed", high="joint", is_signed=False)),
    _row(_N.ARM_STOP, (_A.NONE, _A.INTEGER), "", None, "1.H 1.3 1.1", "Stop the arm, or one joint."),
    _row(_N.ARM_AUTOPARK, (_A.INTEGER,), "", None, "1.H 1.3 1.1", "Park by itself when no client is connected."),
    _row(_N.ARM_GRIPPARK, (_A.INTEGER,), "", None, "1.H 1.3 1.1", "What the arm's gripper does when it parks."),
    _row(_N.ROTKP, (_A.INTEGER,), "", None, "1.J 1.1 1.0", "Rotational proportional gain in force."),
    _row(_N.ROTKV, (_A.INTEGER,), "", None, "1.J 1.1 1.0", "Rotational differential gain in force."),
    _row(_N.ROTKI, (_A.INTEGER,), "", None, "1.J 1.1 1.0", "Rotational integral gain in force."),
    _row(_N.TRANSKP, (_A.INTEGER,), "", None, "1.J 1.1 1.0", "Translational proportional gain in force."),
    _row(_N.TRANSKV, (_A.INTEGER,), "", None, "1.J 1.1 1.0", "Translational differential gain in force."),
    _row(_N.TRANSKI, (_A.INTEGER,), "", None, "1.J 1.1 1.0", "Translational integral gain in force."),
    _row(_N.REVCOUNT, (_A.INTEGER,), "", None, "1.M 1.1 1.1", "Differential encoder counts of one turn of the robot."),
    _row(_N.DRIFTFACTOR, (_A.INTEGER,), "", None, "- ? 1.0", "Correction of the odometry's drift."),
    _row(_N.SOUND, (_A.INTEGER,), "", None, "? ? ?",
         "AmigoBot: play a sound by its number. A P2OS manual lists PLAYLIST here."),
    _row(_N.PLAYLIST, (_A.INTEGER, _A.NONE), "", None, "1.E 1.0 -", "Ask for a PLAYLISTpac."),
    _row(_N.SOUNDTOG, (_A.INTEGER,), "", (0, 1), "- 1.0 1.0", "1 buzzer on, 0 off."),
    _row(_N.TICKSMM, (_A.INTEGER,), "", None, "- - 1.1", "Encoder counts a millimetre of travel."),
    _row(_N.POWER_PC, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the onboard computer."),
    _row(_N.POWER_LRF, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the laser."),
    _row(_N.POWER_5V, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the 5 V accessories."),
    _row(_N.POWER_12V, (_A.INTEGER,), "", (0, 1), "- - yes",
         "Power of the 12 V accessories, and of the 24 V ones: ARIA gives both the same number."),
    _row(_N.LATVEL, (_A.INTEGER,), "mm/s", None, "- - ?", "Seekur: lateral speed, + left."),
    _row(_N.LATACCEL, (_A.INTEGER,), "mm/s2", None, "- - ?",
         "Seekur: lateral acceleration, or deceleration where negative."),
    _row(_N.RECENTERWHEELS, (_A.NONE,), "", None, "- - ?", "Seekur: bring the steering wheels to their centre."),
    _row(_N.ACCELINFO, (_A.INTEGER,), "", (0, 2), "- - ?", "Accelerometer packets: 0 none, 1 one, 2 continuous."),
    _row(_N.TORQUEINFO, (_A.INTEGER,), "", (0, 2), "- - ?", "Torque packets: 0 none, 1 one, 2 continuous."),
    _row(_N.POWER_AUX_PC, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the second computer."),
    _row(_N.POWER_TOUCHSCREEN, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the touch screen."),
    _row(_N.POWER_PTZ, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the camera's mount."),
    _row(_N.POWER_AUDIO, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the amplifier."),
    _row(_N.POWER_LRF2, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the second laser."),
    _row(_N.HEADINGINFO, (_A.INTEGER,), "", (0, 2), "- - ?", "Heading packets: 0 none, 1 one, 2 continuous."),
    _row(_N.ROTVEL_CLOSEDLOOP, (_A.INTEGER,), "", (0, 1), "- - ?", "1 closes the loop of the rotational speed."),
    _row(_N.SRECORD, (_A.STRING,), "", (0, 199), "- - -", "Pioneer LX: firmware download."),
    _row(_N.MARCDEBUG, (_A.INTEGER,), "", None, "- - -", "Pioneer LX: debug messages."),
    _row(_N.WHEEL_LIGHT, (_A.INTEGER,), "", None, "- - -", "Pioneer LX: lights at the wheels."),
    _row(_N.ABSOLUTE_MAXES, (_A.INTEGER,), "", None, "- - -", "Pioneer LX: the absolute limits."),
    _row(_N.SAFETY_STATE_INFO, (_A.INTEGER,), "", (0, 2), "- - -",
         "Pioneer LX: packets of the safety's state, 0 none, 1 one, 2 continuous."),
    _row(_N.SAFETY_SET_STATE, (_A.TWO_BYTES,), "", None, "- - -", "Pioneer LX: set the state of a safety system.",
         TwoBytes(low="system", high="value", is_signed=False)),
    _row(_N.SAFETY_DISABLE_POWER_OFF_TIMER, (_A.INTEGER,), "", (0, 1), "- - -",
         "Pioneer LX: switch the power-off timer."),
    _row(_N.SAFETY_ZONE_ACTIVE, (_A.INTEGER,), "", None, "- - -",
         "Pioneer LX: the safety zone that the laser reports."),
    _row(_N.WHEELINFO_REQUEST, (_A.INTEGER,), "", (0, 2), "- - -", "Pioneer LX: motion debugging."),
    _row(_N.MARC_CONFIG_SET, (_A.STRING,), "", (0, 199), "- - -", "Pioneer LX: set the configuration."),
    _row(_N.MARC_CONFIG_GET, (_A.STRING,), "", (0, 199), "- - -", "Pioneer LX: ask for the configuration."),
    _row(_N.SIM_SET_POSE, (_A.DATA,), "", (12, 12), "- - -",
         "Simulators: move the robot; x and y in mm and the heading in degrees as three integers of 32 bits. The "
         "odometry stays."),
    _row(_N.SIM_RESET, (_A.NONE,), "", None, "- - -",
         "Simulators: back to where the robot began, odometry at 0; the session goes on."),
    _row(_N.SIM_MODEL_CONFIG, (_A.DATA,), "", (0, 200), "- - -", "Simulators: a robot sends its dimensions."),
    _row(_N.SIM_LRF_ENABLE, (_A.INTEGER,), "", (0, 2), "- - -", "Simulators: laser packets 0 off, 1 on, 2 extended."),
    _row(_N.SIM_LRF_SET_FOV_START, (_A.INTEGER,), "deg", None, "- - -", "Simulators: where the laser's field begins."),
    _row(_N.SIM_LRF_SET_FOV_END, (_A.INTEGER,), "deg", None, "- - -", "Simulators: where the laser's field ends."),
    _row(_N.SIM_LRF_SET_RES, (_A.INTEGER,), "0.01 deg", None, "- - -", "Simulators: the angle between readings."),
    _row(_N.SIM_CTRL, (_A.INTEGER, _A.DATA), "", None, "- - -",
         "Simulators: an order to the simulator itself, as an integer of two bytes: 1 and 2 load the map whose name "
         "follows, its length in two bytes before it; 6 asks for SIMINFO."),
    _row(_N.SIM_STAT, (_A.INTEGER, _A.NONE), "", (0, 2), "- - -", "Simulators: SIMSTAT 0 none, 1 one, 2 continuous."),
    _row(_N.SIM_MESSAGE, (_A.STRING,), "", (0, 199), "- - -", "Simulators: show a line of text."),
    _row(_N.SIM_EXIT, (_A.INTEGER,), "", None, "- - -", "Simulators: end the simulator with this exit code."),
    _row(_N.BATTEST, (_A.INTEGER,), "0.1 V", None, "- 1.6 1.0",
         "ARCOS: pretend a battery voltage, 0 the real one. AROS: SHUTDOWN, 0 cancel, 1 pretend low power, 2 shut "
         "the computer down."),
    _row(_N.DIGTEMPTEST, (_A.INTEGER,), "", None, "- - -", "AMRISim: pretend a temperature."),
    _row(_N.SPOOFANALOGTEMP, (_A.INTEGER,), "", None, "- - -", "AMRISim: pretend an analog temperature."),
    _row(_N.RESET, (_A.NONE,), "", None, "- - 1.0", "Restart the controller as after power-on. It ends a simulator."),
    _row(_N.MAINTENANCE, (_A.NONE,), "", None, "- - 1.0", "Enter the controller's boot program. It ends a simulator."),
)  # fmt: skip

BY_NUMBER: Mapping[int, CommandRow] = {int(row.number): row for row in ROWS}
BY_NAME: Mapping[str, CommandRow] = {row.name: row for row in ROWS}
#: Other words for the same command, as ARIA or a manual has them.
ALIASES: Mapping[str, str] = {
    "SYNC0": "PULSE", "SYNC1": "OPEN", "SYNC2": "CLOSE", "ESTOP": "E_STOP", "ESTALL": "E_STALL",
    "JOYINFO": "JOYREQUEST", "GRIPPERPACREQUEST": "GRIPREQUEST", "SHUTDOWN": "BATTEST", "POWER_24V": "POWER_12V",
    "TTY": "TTY2", "GETAUX1": "GETAUX", "SEEKURIMU": "IMUREQUEST", "SETORIGIN": "SETO",
}  # fmt: skip


def command_row(which: int | str) -> CommandRow:
    """Return the row of a command by its number or its name, without regard to case.

    Raises:
        LocalProtocolError: There is no such command; the hint names the closest.
    """
    if isinstance(which, int):
        if which in BY_NUMBER:
            return BY_NUMBER[which]
        raise LocalProtocolError(f"no manual names command {which}", hint="a number of 0 to 255 can be sent raw")
    name = which.upper().replace("-", "_")
    name = ALIASES.get(name, name)
    if name in BY_NAME:
        return BY_NAME[name]
    raise LocalProtocolError(f"no command {which!r}", hint=nearest(name, [*BY_NAME, *ALIASES], "PROTOCOL.md has all"))
