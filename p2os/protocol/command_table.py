"""Every client command: what it takes, in which unit and range, which firmware knows it, what it does.

How a command becomes bytes stands in `p2os.protocol.commands`.

Source: command tables of the Pioneer 2 (P2OS), Pioneer 2/3 H8 (AROS) and
Pioneer 3 (ARCOS) manuals; ARIA's list for what only ARIA and simulators name.
A version is the first one that the manual prints; "-" is not in that manual,
"?" has not been seen. Where sources contradict each other, the row says so.

A new command is one member of `CommandNumber`: rows, page, dissector and command line follow from it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum, unique
from typing import Self

from p2os.errors import LocalProtocolError
from p2os.protocol.bauds import BAUDS
from p2os.protocol.profiles import Profile
from simbase.errors import nearest


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

    number: "CommandNumber"
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
        """Return the range of one kind of argument that there is, as `range` says it."""
        return WIRE_LIMITS[kind] if self.range is None else self.range

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


_A = Argument


@unique
class CommandNumber(IntEnum):
    """All that is known of each client command, by the manuals' word; where one number has two meanings, both.

    Each says number, kinds, unit, range, first P2OS, AROS and ARCOS, meaning, names of two bytes.
    """

    row: CommandRow

    def __new__(
        cls,
        number: int,
        kinds: tuple[Argument, ...] = (),
        unit: str = "",
        limits: tuple[int, int] | None = None,
        versions: str = "",
        meaning: str = "",
        two_bytes: TwoBytes | None = None,
    ) -> Self:
        """Make the number, and its row. `CommandNumber(11)` finds one that is there, hence the defaults."""
        member = int.__new__(cls, number)
        member._value_ = number
        member.row = CommandRow(
            number=member, kinds=kinds, unit=unit, range=limits, versions=tuple(versions.split()), meaning=meaning,
            two_bytes=two_bytes,
        )  # fmt: skip
        return member

    # fmt: off
    PULSE = 0, (_A.NONE,), "", None, "1.0 1.0 1.0", "Reset the watchdog; the same bytes as SYNC0."
    OPEN = (1, (_A.NONE, _A.INTEGER), "", None, "1.0 1.0 1.0",
        "Start the servers and the SIPs; the same bytes as SYNC1. ARIA sends it with the integer 1.")
    CLOSE = (2, (_A.NONE, _A.INTEGER), "", None, "1.0 1.0 1.0",
        "End the session; the same bytes as SYNC2. ARIA sends it with the integer 1.")
    POLLING = (3, (_A.STRING,), "", (0, 64), "1.0 1.0 1.0",
        "Sonar firing order: a byte a sonar, counted from 1, repeats allowed; empty switches the sonar off.")
    ENABLE = 4, (_A.INTEGER,), "", (0, 1), "1.0 1.0 1.0", "1 switches the motors on, 0 off."
    SETA = (5, (_A.INTEGER,), "mm/s2", None, "1.0 1.0 1.0",
        "Translational acceleration, or deceleration where negative.")
    SETV = 6, (_A.INTEGER,), "mm/s", None, "1.0 1.0 1.0", "Largest translational speed; MOVE drives at it."
    SETO = 7, (_A.NONE,), "", None, "1.0 1.0 1.0", "Set the odometry to 0, 0, 0."
    MOVE = 8, (_A.INTEGER,), "mm", None, "yes 1.0 1.0", "Drive a distance, + forward; best within 5000 mm."
    ROTATE = 9, (_A.INTEGER,), "deg/s", None, "- 1.0 1.0", "As RVEL."
    SETRV = 10, (_A.INTEGER,), "deg/s", None, "1.0 1.0 1.0", "Largest rotational speed; HEAD and DHEAD turn at it."
    VEL = 11, (_A.INTEGER,), "mm/s", None, "1.0 1.0 1.0", "Translational speed, + forward."
    HEAD = 12, (_A.INTEGER,), "deg", None, "1.0 1.0 1.0", "Turn to an absolute heading, + counter-clockwise."
    DHEAD = (13, (_A.INTEGER,), "deg", None, "1.0 1.0 1.0",
        "Turn relative to the present heading, + counter-clockwise.")
    SETPBV = (14, (_A.INTEGER,), "", None, "? - -",
        "No manual that could be found says what it does; ARIA calls number 14 one that does not really exist.")
    SAY = (15, (_A.STRING,), "", (0, 40), "1.0 1.0 1.0",
        "Up to 20 pairs of duration (20 ms) and tone: 0 rest, 1 to 127 MIDI note, above (tone - 127) * 32 Hz.")
    JOYREQUEST = 17, (_A.INTEGER,), "", (0, 2), "? yes 1.0", "JOYSTICKpac: 0 none, 1 one, 2 continuous."
    CONFIG = (18, (_A.NONE, _A.INTEGER), "", None, "1.4 1.0 1.0",
        "Ask for a CONFIGpac. ARIA sends it with the integer 1.")
    ENCODER = (19, (_A.INTEGER,), "", (0, 2), "1.4 1.0 1.0",
        "ENCODERpac: 0 none, 1 one, 2 continuous (first P2OS: 1 is continuous).")
    SETRVDIR = 20, (_A.INTEGER,), "", None, "- - -", "Named by ARIA only; no firmware is known to have it."
    RVEL = 21, (_A.INTEGER,), "deg/s", None, "1.0 1.0 1.0", "Rotational speed, + counter-clockwise."
    DCHEAD = (22, (_A.INTEGER,), "deg", None, "yes yes 1.0",
        "Turn relative to the last heading set-point, + counter-clockwise.")
    SETRA = (23, (_A.INTEGER,), "deg/s2", None, "1.0 1.0 1.0",
        "Rotational acceleration, or deceleration where negative.")
    IMUREQUEST = 26, (_A.INTEGER,), "", (0, 2), "- - -", "Seekur: IMU packets, 0 none, 1 one, 2 continuous."
    SONAR = (28, (_A.INTEGER,), "", (0, 9), "1.0 1.0 1.0",
        ("1 switches all sonar on, 0 off. AROS and ARCOS also one array of eight: its number, 1 to 4, in bits 1 to 3,"
         " on or off in bit 0 (4: array 2 off, 5: on)."))
    STOP = 29, (_A.NONE,), "", None, "1.0 1.0 1.0", "Stop; the motors stay enabled."
    DIGOUT = (30, (_A.TWO_BYTES,), "", None, "1.2 1.0 1.0",
        ("Digital outputs: one byte is the mask, one the states; the manuals contradict each other on which "
         "(`low_byte` travels first)."),
        TwoBytes(low="low_byte", high="high_byte", is_signed=False))
    TIMER = 31, (_A.INTEGER,), "", None, "- - -", "PSOS; ARIA does not know what it does."
    VEL2 = (32, (_A.TWO_BYTES,), "20 mm/s", None, "yes yes 1.1",
        "Wheel speeds in Vel2Divisor; P2OS and AROS drive the wheels directly.",
        TwoBytes(low="right", high="left", is_signed=True))
    GRIPPER = (33, (_A.INTEGER,), "", (1, 17), "yes yes 1.0",
        ("1 open, 2 close, 3 stop, 4 lift up, 5 lift down, 6 lift stop, 7 store, 8 deploy, 15 halt, 16 pressure, "
         "17 lift carry."))
    KICK = 34, (_A.INTEGER,), "ms", None, "? ? yes", "Hold the first digital output for so long, once."
    ADSEL = 35, (_A.INTEGER,), "", (0, 255), "? yes 1.0", "Select the analog port that the SIP shows."
    GRIPPERVAL = 36, (_A.INTEGER,), "", None, "yes yes 1.0", "Value for GRIPPER 16 and 17."
    GRIPREQUEST = 37, (_A.INTEGER,), "", (0, 2), "1.E yes 1.0", "GRIPPERpac: 0 none, 1 one, 2 continuous."
    GYROCALCW = (38, (_A.UNSIGNED,), "", None, "- - 2.0",
        ("Gyro calibration, clockwise. A simulator with a laser takes 35 to 38 for SIM_LRF_ENABLE and what follows it: "
         "ARIA sends those."))
    GYROCALCCW = 39, (_A.UNSIGNED,), "", None, "- - 2.0", "Gyro calibration, counter-clockwise."
    IOREQUEST = 40, (_A.INTEGER,), "", (0, 2), "1.E yes 1.0", "IOpac: 0 none, 1 one, 2 continuous."
    PTUPOS = (41, (_A.TWO_BYTES,), "", None, "1.2 yes ?", "Servo: port 1 to 4 and the width of its pulse in 10 us.",
        TwoBytes(low="pulse_width", high="servo", is_signed=False))
    TTY2 = 42, (_A.STRING,), "", (0, 199), "1.0 yes 1.0", "Send bytes to the AUX1 serial port."
    GETAUX = (43, (_A.UNSIGNED,), "bytes", (0, 200), "1.4 yes 1.0",
        "Wait for so many bytes from AUX1 and send a SERAUXpac; 0 empties the buffer.")
    BUMPSTALL = (44, (_A.INTEGER,), "", (0, 3), "1.5 yes 1.0",
        "Bumpers that cause a stall: 0 none, 1 front, 2 rear, 3 both.")
    TCM2 = (45, (_A.INTEGER,), "", (0, 7), "1.6 yes 1.0",
        ("Compass: 0 off, 1 in the SIP, 2 one packet, 3 continuous, 4 user and 5 automatic calibration, 6 stop it,"
         " 7 reset."))
    DOCK = (46, (_A.INTEGER,), "", (0, 2), "1.C ? -",
        "0 off, 1 docking signals on, 2 also stop when power is sensed.")
    JOYDRIVE = (47, (_A.INTEGER,), "", (0, 1), "1.G yes 1.0",
        "1 lets the robot's own joystick drive while a client is connected.")
    SONARCYCLE = 48, (_A.UNSIGNED,), "ms", (2, 120), "- 1.8 1.0", "Time of a ping, 40 ms by default."
    MOVINGBLINK = 49, (_A.INTEGER,), "", (0, 1), "- - ?", "PatrolBot: blink before moving."
    HOSTBAUD = (50, (_A.INTEGER,), "", (0, 4), "- 1.8 1.0",
        f"Baud of the host port: {', '.join(f'{code} {baud}' for code, baud in enumerate(BAUDS))}.")
    AUX1BAUD = 51, (_A.INTEGER,), "", (0, 4), "- 1.8 1.0", "Baud of AUX1, as HOSTBAUD."
    AUX2BAUD = 52, (_A.INTEGER,), "", (0, 4), "- 1.8 1.0", "Baud of AUX2, as HOSTBAUD."
    AUX3BAUD = 53, (_A.INTEGER,), "", (0, 4), "- 1.8 1.0", "Baud of AUX3, as HOSTBAUD."
    E_STOP = 55, (_A.NONE, _A.INTEGER), "", None, "1.8 yes 1.0", "Stop at once, overriding the deceleration."
    E_STALL = (56, (_A.INTEGER,), "", (0, 1), "1.E yes 1.0",
        "1 lets the stop button cause a stall; off by default on P2OS, on by default after it.")
    QSTOP = 57, (_A.NONE, _A.INTEGER), "", None, "- - ?", "Quick stop; AMRISim takes it for E_STOP."
    GYRO = (58, (_A.INTEGER,), "", (0, 2), "- 1.8 1.0",
        "GYROpac: 0 off, 1 on; ARIA's 2: heading from the gyro alone.")
    LCD = 59, (_A.STRING,), "", (0, 199), "- - yes", "Three control bytes and up to 20 characters, NUL-terminated."
    TTY4 = 60, (_A.STRING,), "", (0, 199), "- - 1.0", "Send bytes to AUX3."
    GETAUX3 = 61, (_A.UNSIGNED,), "bytes", (0, 200), "- - 1.0", "As GETAUX, from AUX3."
    BATTERYINFO = (62, (_A.INTEGER,), "", (0, 2), "- - ?",
        "Battery packets: 0 none, 1 one, 2 continuous. An old simulator exits.")
    LOADWORLD = (63, (_A.STRING,), "", (0, 199), "- - -",
        "Old simulators: load another world by its name; MobileSim has SIM_CTRL 1 for it.")
    STEP = 64, (_A.NONE,), "", None, "1.0 - -", "One step of a simulator."
    CALCOMP = 65, (_A.INTEGER,), "", None, "- - ?", "Compass calibration."
    TTY3 = 66, (_A.STRING,), "", (0, 199), "- 1.1 1.0", "Send bytes to AUX2."
    GETAUX2 = 67, (_A.UNSIGNED,), "bytes", (0, 200), "- 1.1 1.0", "As GETAUX, from AUX2."
    CHARGE = 68, (_A.INTEGER,), "", (0, 1), "- 1.7 1.0", "1 deploys the charger, 0 retracts it."
    RESETSIMTOORIGIN = 69, (_A.NONE,), "", None, "- - -", "Old simulators: as SIM_RESET."
    ARM_INFO = 70, (_A.NONE,), "", None, "1.H 1.3 1.1", "Ask for an ARMINFOpac."
    ARM_STATUS = 71, (_A.INTEGER,), "", (0, 2), "1.H 1.3 1.1", "ARMpac: 0 none, 1 one, 2 continuous."
    ARM_INIT = 72, (_A.NONE,), "", None, "1.H 1.3 1.1", "Initialise the arm."
    ARM_CHECK = 73, (_A.NONE,), "", None, "1.H 1.3 1.1", "Look whether the arm answers."
    ARM_POWER = 74, (_A.INTEGER,), "", (0, 1), "1.H 1.3 1.1", "1 powers the arm's servos, 0 cuts them."
    ARM_HOME = 75, (_A.NONE, _A.INTEGER), "", None, "1.H 1.3 1.1", "Send the arm, or one joint, home."
    ARM_PARK = 76, (_A.NONE,), "", None, "1.H 1.3 1.1", "Park the arm."
    ARM_POS = (77, (_A.TWO_BYTES,), "", None, "1.H 1.3 1.1", "Send a joint (1 to 6) to a position.",
        TwoBytes(low="position", high="joint", is_signed=False))
    ARM_SPEED = (78, (_A.TWO_BYTES,), "", None, "1.H 1.3 1.1", "Set the speed of a joint.",
        TwoBytes(low="speed", high="joint", is_signed=False))
    ARM_STOP = 79, (_A.NONE, _A.INTEGER), "", None, "1.H 1.3 1.1", "Stop the arm, or one joint."
    ARM_AUTOPARK = 80, (_A.INTEGER,), "", None, "1.H 1.3 1.1", "Park by itself when no client is connected."
    ARM_GRIPPARK = 81, (_A.INTEGER,), "", None, "1.H 1.3 1.1", "What the arm's gripper does when it parks."
    ROTKP = 82, (_A.INTEGER,), "", None, "1.J 1.1 1.0", "Rotational proportional gain in force."
    ROTKV = 83, (_A.INTEGER,), "", None, "1.J 1.1 1.0", "Rotational differential gain in force."
    ROTKI = 84, (_A.INTEGER,), "", None, "1.J 1.1 1.0", "Rotational integral gain in force."
    TRANSKP = 85, (_A.INTEGER,), "", None, "1.J 1.1 1.0", "Translational proportional gain in force."
    TRANSKV = 86, (_A.INTEGER,), "", None, "1.J 1.1 1.0", "Translational differential gain in force."
    TRANSKI = 87, (_A.INTEGER,), "", None, "1.J 1.1 1.0", "Translational integral gain in force."
    REVCOUNT = 88, (_A.INTEGER,), "", None, "1.M 1.1 1.1", "Differential encoder counts of one turn of the robot."
    DRIFTFACTOR = 89, (_A.INTEGER,), "", None, "- ? 1.0", "Correction of the odometry's drift."
    SOUND = (90, (_A.INTEGER,), "", None, "? ? ?",
        "AmigoBot: play a sound by its number. A P2OS manual lists PLAYLIST here.")
    PLAYLIST = 91, (_A.INTEGER, _A.NONE), "", None, "1.E 1.0 -", "Ask for a PLAYLISTpac."
    SOUNDTOG = 92, (_A.INTEGER,), "", (0, 1), "- 1.0 1.0", "1 buzzer on, 0 off."
    TICKSMM = 93, (_A.INTEGER,), "", None, "- - 1.1", "Encoder counts a millimetre of travel."
    POWER_PC = 95, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the onboard computer."
    POWER_LRF = 96, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the laser."
    POWER_5V = 97, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the 5 V accessories."
    POWER_12V = (98, (_A.INTEGER,), "", (0, 1), "- - yes",
        "Power of the 12 V accessories, and of the 24 V ones: ARIA gives both the same number.")
    LATVEL = 110, (_A.INTEGER,), "mm/s", None, "- - ?", "Seekur: lateral speed, + left."
    LATACCEL = (113, (_A.INTEGER,), "mm/s2", None, "- - ?",
        "Seekur: lateral acceleration, or deceleration where negative.")
    RECENTERWHEELS = 120, (_A.NONE,), "", None, "- - ?", "Seekur: bring the steering wheels to their centre."
    ACCELINFO = 123, (_A.INTEGER,), "", (0, 2), "- - ?", "Accelerometer packets: 0 none, 1 one, 2 continuous."
    TORQUEINFO = 124, (_A.INTEGER,), "", (0, 2), "- - ?", "Torque packets: 0 none, 1 one, 2 continuous."
    POWER_AUX_PC = 125, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the second computer."
    POWER_TOUCHSCREEN = 126, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the touch screen."
    POWER_PTZ = 127, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the camera's mount."
    POWER_AUDIO = 128, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the amplifier."
    POWER_LRF2 = 129, (_A.INTEGER,), "", (0, 1), "- - yes", "Power of the second laser."
    HEADINGINFO = 149, (_A.INTEGER,), "", (0, 2), "- - ?", "Heading packets: 0 none, 1 one, 2 continuous."
    ROTVEL_CLOSEDLOOP = 150, (_A.INTEGER,), "", (0, 1), "- - ?", "1 closes the loop of the rotational speed."
    SRECORD = 210, (_A.STRING,), "", (0, 199), "- - -", "Pioneer LX: firmware download."
    MARCDEBUG = 211, (_A.INTEGER,), "", None, "- - -", "Pioneer LX: debug messages."
    WHEEL_LIGHT = 212, (_A.INTEGER,), "", None, "- - -", "Pioneer LX: lights at the wheels."
    ABSOLUTE_MAXES = 213, (_A.INTEGER,), "", None, "- - -", "Pioneer LX: the absolute limits."
    SAFETY_STATE_INFO = (214, (_A.INTEGER,), "", (0, 2), "- - -",
        "Pioneer LX: packets of the safety's state, 0 none, 1 one, 2 continuous.")
    SAFETY_SET_STATE = (215, (_A.TWO_BYTES,), "", None, "- - -", "Pioneer LX: set the state of a safety system.",
        TwoBytes(low="system", high="value", is_signed=False))
    SAFETY_DISABLE_POWER_OFF_TIMER = (216, (_A.INTEGER,), "", (0, 1), "- - -",
        "Pioneer LX: switch the power-off timer.")
    SAFETY_ZONE_ACTIVE = (217, (_A.INTEGER,), "", None, "- - -",
        "Pioneer LX: the safety zone that the laser reports.")
    WHEELINFO_REQUEST = 218, (_A.INTEGER,), "", (0, 2), "- - -", "Pioneer LX: motion debugging."
    MARC_CONFIG_SET = 219, (_A.STRING,), "", (0, 199), "- - -", "Pioneer LX: set the configuration."
    MARC_CONFIG_GET = 220, (_A.STRING,), "", (0, 199), "- - -", "Pioneer LX: ask for the configuration."
    SIM_SET_POSE = (224, (_A.DATA,), "", (12, 12), "- - -",
        ("Simulators: move the robot; x and y in mm and the heading in degrees as three integers of 32 bits. The "
         "odometry stays."))
    SIM_RESET = (225, (_A.NONE,), "", None, "- - -",
        "Simulators: back to where the robot began, odometry at 0; the session goes on.")
    SIM_MODEL_CONFIG = 226, (_A.DATA,), "", (0, 200), "- - -", "Simulators: a robot sends its dimensions."
    SIM_LRF_ENABLE = 230, (_A.INTEGER,), "", (0, 2), "- - -", "Simulators: laser packets 0 off, 1 on, 2 extended."
    SIM_LRF_SET_FOV_START = 231, (_A.INTEGER,), "deg", None, "- - -", "Simulators: where the laser's field begins."
    SIM_LRF_SET_FOV_END = 232, (_A.INTEGER,), "deg", None, "- - -", "Simulators: where the laser's field ends."
    SIM_LRF_SET_RES = 233, (_A.INTEGER,), "0.01 deg", None, "- - -", "Simulators: the angle between readings."
    SIM_CTRL = (236, (_A.INTEGER, _A.DATA), "", None, "- - -",
        ("Simulators: an order to the simulator itself, as an integer of two bytes: 1 and 2 load the map whose name "
         "follows, its length in two bytes before it; 6 asks for SIMINFO."))
    SIM_STAT = 237, (_A.INTEGER, _A.NONE), "", (0, 2), "- - -", "Simulators: SIMSTAT 0 none, 1 one, 2 continuous."
    SIM_MESSAGE = 238, (_A.STRING,), "", (0, 199), "- - -", "Simulators: show a line of text."
    SIM_EXIT = 239, (_A.INTEGER,), "", None, "- - -", "Simulators: end the simulator with this exit code."
    BATTEST = (250, (_A.INTEGER,), "0.1 V", None, "- 1.6 1.0",
        ("ARCOS: pretend a battery voltage, 0 the real one. AROS: SHUTDOWN, 0 cancel, 1 pretend low power, 2 shut "
         "the computer down."))
    DIGTEMPTEST = 251, (_A.INTEGER,), "", None, "- - -", "AMRISim: pretend a temperature."
    SPOOFANALOGTEMP = 252, (_A.INTEGER,), "", None, "- - -", "AMRISim: pretend an analog temperature."
    RESET = 253, (_A.NONE,), "", None, "- - 1.0", "Restart the controller as after power-on. It ends a simulator."
    MAINTENANCE = 255, (_A.NONE,), "", None, "- - 1.0", "Enter the controller's boot program. It ends a simulator."
    # fmt: on


#: What only simulators before MobileSim had.
OLD_SIMULATORS = frozenset({CommandNumber.LOADWORLD, CommandNumber.STEP, CommandNumber.RESETSIMTOORIGIN})
#: What moves a robot whose motors are on.
MOTION_COMMANDS = frozenset({
    CommandNumber.MOVE, CommandNumber.ROTATE, CommandNumber.VEL, CommandNumber.HEAD, CommandNumber.DHEAD,
    CommandNumber.RVEL, CommandNumber.DCHEAD, CommandNumber.VEL2, CommandNumber.LATVEL,
})  # fmt: skip
ROWS = tuple(number.row for number in CommandNumber)
#: What the first three numbers are called until a session is open.
SYNC_NAMES = ("SYNC0", "SYNC1", "SYNC2")
BY_NUMBER: Mapping[int, CommandRow] = {int(row.number): row for row in ROWS}
BY_NAME: Mapping[str, CommandRow] = {row.name: row for row in ROWS}
#: Other words for the same command, as ARIA or a manual has them.
ALIASES: Mapping[str, str] = {
    **{name: CommandNumber(number).name for number, name in enumerate(SYNC_NAMES)},
    "ESTOP": "E_STOP", "ESTALL": "E_STALL",
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
