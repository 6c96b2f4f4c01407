"""Client commands: number, argument, and the bytes that carry them.

Source: command tables of the Pioneer 2 (P2OS), Pioneer 2/3 H8 (AROS) and
Pioneer 3 (ARCOS) manuals; where one number has two meanings, both are named.

The reader is as tolerant as a real robot: OPEN, CLOSE and CONFIG may carry an
integer, SETO may carry a lone type byte, a string may be shorter than its
length byte says or be followed by a NUL.

What each command takes and means stands in `ROWS`, one row a command.

Invariant: `Command.from_frame(command.to_frame()) == command`.
"""

from dataclasses import dataclass

from p2os.errors import LocalProtocolError
from p2os.protocol.command_table import BY_NUMBER, ROWS, Argument, CommandNumber, CommandRow, TwoBytes, command_row
from p2os.protocol.frames import Frame

__all__ = [
    "NEGATIVE",
    "POSITIVE",
    "ROWS",
    "STRING",
    "Argument",
    "Command",
    "CommandNumber",
    "CommandRow",
    "TwoBytes",
    "command",
    "command_row",
    "enable",
    "pulse",
    "rvel",
    "set_origin",
    "sonar",
    "stop",
    "vel",
    "vel2",
]

#: Argument type bytes (sfARGINT, sfARGNINT, sfARGSTR in the manuals).
POSITIVE, NEGATIVE, STRING = 0x3B, 0x1B, 0x2B
#: The longest string that fits a frame: 202 bytes less number, type and length; data have no length.
MAX_STRING_BYTES, MAX_DATA_BYTES = 199, 200
MAX_MAGNITUDE = 0xFFFF
#: A type byte and an integer, and the number of a laser after them.
MOST_INTEGER_BYTES = 4
#: Commands whose bytes have no length before them (simulators only); clients write any type byte there.
UNCOUNTED = frozenset(int(row.number) for row in ROWS if Argument.DATA in row.kinds)


@dataclass(frozen=True, slots=True)
class Command:
    """One client command.

    Args:
        number: 0 to 255; `CommandNumber` names those known.
        argument: None for a bare command, an integer of at most 16 bits and a sign, or up to 199 bytes (200 of data
            without a length).

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
        most = MAX_DATA_BYTES if self.number in UNCOUNTED else MAX_STRING_BYTES
        if isinstance(self.argument, bytes) and len(self.argument) > most:
            raise LocalProtocolError(f"{self.name}: {len(self.argument)} bytes, at most {most} fit a frame")

    @property
    def name(self) -> str:
        """The command's name in the manuals, or its number."""
        row = self.row
        return f"command {self.number}" if row is None else row.name

    @property
    def row(self) -> CommandRow | None:
        """What the command takes and means, or None where nobody names it."""
        return BY_NUMBER.get(self.number)

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
            length = b"" if self.number in UNCOUNTED else bytes((len(self.argument),))
            return Frame(head + bytes((STRING,)) + length + self.argument)
        sign = NEGATIVE if self.argument < 0 else POSITIVE
        return Frame(head + bytes((sign,)) + abs(self.argument).to_bytes(2, "little"))

    @classmethod
    def from_frame(cls, frame: Frame) -> "Command":
        """Read a command; an argument of a type that no manual names is kept as its raw bytes."""
        data = frame.data
        if not data:
            return cls(frame.kind)
        if frame.kind in UNCOUNTED and (data[0] == STRING or len(data) > MOST_INTEGER_BYTES):
            return cls(frame.kind, data[1:])
        if data[0] in {POSITIVE, NEGATIVE}:
            if len(data) < 3:
                return cls(frame.kind)
            magnitude = int.from_bytes(data[1:3], "little")
            return cls(frame.kind, -magnitude if data[0] == NEGATIVE else magnitude)
        if data[0] == STRING and len(data) > 1:
            return cls(frame.kind, data[2 : 2 + data[1]])
        return cls(frame.kind, data[:MAX_STRING_BYTES])


def command(which: int | str, *argument: int | bytes) -> Command:
    """Return a command by its number or name, its argument checked against the table.

    Args:
        which: 0 to 255, or a name or alias without regard to case.
        argument: Nothing, one integer, one string of bytes, or two bytes (low, high) for a command that takes two.

    Raises:
        LocalProtocolError: There is no such command, or it does not take this.
    """
    row = command_row(which)
    if len(argument) == 2:
        low, high = argument
        if isinstance(low, bytes) or isinstance(high, bytes):
            raise LocalProtocolError(f"{row.name} takes {row.takes}")
        return Command(row.number, row.word(low, high))
    if len(argument) > 2:
        raise LocalProtocolError(f"{row.name}: {len(argument)} arguments, it takes {row.takes}")
    value = argument[0] if argument else None
    row.check(value)
    return Command(row.number, value)


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
