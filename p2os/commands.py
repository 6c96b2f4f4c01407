"""Client commands: number, argument, and the bytes that carry them.

Source: command tables of the Pioneer 2 (P2OS), Pioneer 2/3 H8 (AROS) and
Pioneer 3 (ARCOS) manuals; where one number has two meanings, both are named.

The reader is as tolerant as a real robot: OPEN, CLOSE and CONFIG may carry an
integer, SETO may carry a lone type byte, a string may be shorter than its
length byte says or be followed by a NUL.

Invariant: `Command.from_frame(command.to_frame()) == command`.
"""

from dataclasses import dataclass
from enum import IntEnum

from p2os.errors import LocalProtocolError
from p2os.wire import Frame

#: Argument type bytes (sfARGINT, sfARGNINT, sfARGSTR in the manuals).
POSITIVE, NEGATIVE, STRING = 0x3B, 0x1B, 0x2B
#: The longest string that fits a frame: 202 bytes less number, type and length.
MAX_STRING_BYTES = 199
MAX_MAGNITUDE = 0xFFFF


class CommandNumber(IntEnum):
    """Every command number that a manual or a client in use names."""

    #: Reset the watchdog; the same bytes as SYNC0.
    PULSE = 0
    #: Start the servers and SIPs; the same bytes as SYNC1.
    OPEN = 1
    #: End the session; the same bytes as SYNC2.
    CLOSE = 2
    #: String of sonar numbers (from 1) in firing order.
    POLLING = 3
    #: 1 motors on, 0 off.
    ENABLE = 4
    #: + acceleration, - deceleration, mm/s2.
    SETA = 5
    #: Largest translational speed, mm/s.
    SETV = 6
    #: Odometry to 0, 0, 0.
    SETO = 7
    #: Translate, mm.
    MOVE = 8
    #: Rotate, deg/s, + counter-clockwise.
    ROTATE = 9
    #: Largest rotational speed, deg/s.
    SETRV = 10
    #: Translational speed, mm/s, + forward.
    VEL = 11
    #: Turn to an absolute heading, deg.
    HEAD = 12
    #: Turn relative to the present heading, deg.
    DHEAD = 13
    #: Up to 20 pairs of duration (20 ms) and tone.
    SAY = 15
    #: JOYSTICKpac: 0 stop, 1 one, 2 continuous.
    JOYREQUEST = 17
    #: Ask for a CONFIGpac.
    CONFIG = 18
    #: ENCODERpac: 0 stop, 1 one, 2 continuous.
    ENCODER = 19
    #: Named by ARIA only; no firmware is known to have it.
    SETRVDIR = 20
    #: Rotational speed, deg/s, + counter-clockwise.
    RVEL = 21
    #: Turn relative to the last set-point, deg.
    DCHEAD = 22
    #: + rotational acceleration, - deceleration, deg/s2.
    SETRA = 23
    #: Seekur IMU packets.
    IMUREQUEST = 26
    #: 1 all sonar on, 0 off.
    SONAR = 28
    #: Stop; motors stay enabled.
    STOP = 29
    #: Digital outputs: mask and states.
    DIGOUT = 30
    #: PSOS timer.
    TIMER = 31
    #: Wheel speeds: low byte right, high byte left, in Vel2Divisor mm/s.
    VEL2 = 32
    GRIPPER = 33
    #: Select the analog port shown in the SIP.
    ADSEL = 35
    GRIPPERVAL = 36
    GRIPREQUEST = 37
    GYROCALCW = 38
    GYROCALCCW = 39
    #: IOpac: 0 stop, 1 one, 2 continuous.
    IOREQUEST = 40
    #: Servo port and pulse width.
    PTUPOS = 41
    #: Bytes to the AUX1 port.
    TTY2 = 42
    #: Ask for bytes from AUX1.
    GETAUX = 43
    #: 0 off, 1 front, 2 rear, 3 both.
    BUMPSTALL = 44
    #: Compass module.
    TCM2 = 45
    DOCK = 46
    #: 1 lets the robot's joystick drive while connected.
    JOYDRIVE = 47
    #: Milliseconds a ping.
    SONARCYCLE = 48
    MOVINGBLINK = 49
    #: 0 9600, 1 19200, 2 38400, 3 57600, 4 115200 baud.
    HOSTBAUD = 50
    AUX1BAUD = 51
    AUX2BAUD = 52
    AUX3BAUD = 53
    #: Stop at once, overriding the deceleration.
    E_STOP = 55
    #: 1 lets the stop button cause a stall.
    E_STALL = 56
    QSTOP = 57
    #: 1 GYROpacs on, 0 off.
    GYRO = 58
    LCD = 59
    TTY4 = 60
    GETAUX3 = 61
    BATTERYINFO = 62
    STEP = 64
    CALCOMP = 65
    TTY3 = 66
    GETAUX2 = 67
    CHARGE = 68
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
    #: AmigoBot sound; P2OS manuals list PLAYLIST here.
    SOUND = 90
    PLAYLIST = 91
    #: 1 buzzer on, 0 off.
    SOUNDTOG = 92
    TICKSMM = 93
    #: Seekur lateral speed, mm/s.
    LATVEL = 110
    LATACCEL = 113
    SIM_SET_POSE = 224
    SIM_RESET = 225
    SIM_CTRL = 236
    SIM_STAT = 237
    SIM_EXIT = 239
    #: ARCOS: pretend a battery voltage; AROS: SHUTDOWN.
    BATTEST = 250
    RESET = 253
    MAINTENANCE = 255


@dataclass(frozen=True, slots=True)
class Command:
    """One client command.

    Args:
        number: 0 to 255; `CommandNumber` names those known.
        argument: None for a bare command, an integer of at most 16 bits and a sign, or up to 199 bytes.

    Raises:
        LocalProtocolError: The number or the argument does not fit the wire.
    """

    number: int
    argument: int | bytes | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.number <= 0xFF:
            raise LocalProtocolError(f"command {self.number} does not fit a byte (0 to 255)")
        if isinstance(self.argument, int) and abs(self.argument) > MAX_MAGNITUDE:
            raise LocalProtocolError(f"{self.name}: {self.argument} does not fit 16 bits and a sign")
        if isinstance(self.argument, bytes) and len(self.argument) > MAX_STRING_BYTES:
            raise LocalProtocolError(f"{self.name}: {len(self.argument)} bytes, at most {MAX_STRING_BYTES} fit a frame")

    @property
    def name(self) -> str:
        """The manual's word for the command, or its number."""
        try:
            return CommandNumber(self.number).name
        except ValueError:
            return f"command {self.number}"

    @property
    def integer(self) -> int | None:
        """The argument where it is an integer, else None."""
        return self.argument if isinstance(self.argument, int) else None

    @property
    def two_bytes(self) -> tuple[int, int]:
        """The low and high byte of the argument's 16-bit word, the sign applied first.

        Raises:
            LocalProtocolError: The command carries no integer.
        """
        if not isinstance(self.argument, int):
            raise LocalProtocolError(f"{self.name} carries no integer")
        word = self.argument & 0xFFFF
        return word & 0xFF, word >> 8

    @property
    def signed_bytes(self) -> tuple[int, int]:
        """As `two_bytes`, each byte read as -128 to 127."""
        low, high = self.two_bytes
        return (low ^ 0x80) - 0x80, (high ^ 0x80) - 0x80

    def to_frame(self) -> Frame:
        """Return the frame that carries this command."""
        head = bytes((self.number,))
        if self.argument is None:
            return Frame(head)
        if isinstance(self.argument, bytes):
            return Frame(head + bytes((STRING, len(self.argument))) + self.argument)
        sign = NEGATIVE if self.argument < 0 else POSITIVE
        return Frame(head + bytes((sign,)) + abs(self.argument).to_bytes(2, "little"))

    @classmethod
    def from_frame(cls, frame: Frame) -> "Command":
        """Read a command; an argument of a type that no manual names is kept as its raw bytes."""
        data = frame.data
        if not data:
            return cls(frame.kind)
        if data[0] in {POSITIVE, NEGATIVE}:
            if len(data) < 3:
                return cls(frame.kind)
            magnitude = int.from_bytes(data[1:3], "little")
            return cls(frame.kind, -magnitude if data[0] == NEGATIVE else magnitude)
        if data[0] == STRING and len(data) > 1:
            return cls(frame.kind, data[2 : 2 + data[1]])
        return cls(frame.kind, data[:MAX_STRING_BYTES])


def pulse() -> Command:
    """Keep the watchdog fed."""
    return Command(CommandNumber.PULSE)


def enable(on: bool) -> Command:
    """Switch the motors."""
    return Command(CommandNumber.ENABLE, int(on))


def stop() -> Command:
    """Stop; motors stay enabled."""
    return Command(CommandNumber.STOP)


def vel(velocity_mm_s: int) -> Command:
    """Drive at a translational speed, mm/s, + forward."""
    return Command(CommandNumber.VEL, velocity_mm_s)


def rvel(rotation_deg_s: int) -> Command:
    """Turn at a rotational speed, deg/s, + counter-clockwise."""
    return Command(CommandNumber.RVEL, rotation_deg_s)


def vel2(raw_left: int, raw_right: int) -> Command:
    """Set both wheels, each -128 to 127 in Vel2Divisor mm/s (20 on a Pioneer 2).

    Raises:
        LocalProtocolError: A wheel's value does not fit a signed byte.
    """
    if not (-128 <= raw_left <= 127 and -128 <= raw_right <= 127):
        raise LocalProtocolError(f"VEL2: {raw_left}, {raw_right} do not fit signed bytes")
    word = (raw_left & 0xFF) << 8 | raw_right & 0xFF
    return Command(CommandNumber.VEL2, word if word < 0x8000 else word - 0x10000)


def sonar(on: bool) -> Command:
    """Switch all sonar."""
    return Command(CommandNumber.SONAR, int(on))


def set_origin() -> Command:
    """Set the odometry to 0, 0, 0."""
    return Command(CommandNumber.SETO)
