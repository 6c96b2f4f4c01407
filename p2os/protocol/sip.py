"""The standard server information packet (SIP), types 0x30 to 0x34.

Source: P2OS manual, SIP table; Pioneer 2/3 H8 (AROS) and Pioneer 3 (ARCOS)
manuals for the tail. Raw values keep `raw_` in their names: `p2os.protocol.units` turns
them into SI.

Invariant: `StandardSip.from_frame(sip.to_frame(profile), profile) == sip`.
"""

import struct
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import accumulate, chain, repeat

from construct import Array, Int8ul, Int16sl, Int16ul, Struct, this

from p2os.errors import LocalProtocolError, RemoteProtocolError
from p2os.protocol.fields import part
from p2os.protocol.frames import Frame
from p2os.protocol.profiles import Profile

#: Types that clients take for a standard SIP; 0x32 standing, 0x33 moving.
SIP_KINDS = (0x30, 0x31, 0x32, 0x33, 0x34)
STANDING, MOVING = 0x32, 0x33
#: Position counts are 15 bits wide; bit 15 is masked.
POSITION_MASK = 0x7FFF

#: One sonar reading.
READING = Struct(part("number", Int8ul, "sonar, from 0"), part("raw_range", Int16ul, "counts of RangeConvFactor"))
#: From the byte after the type to the end of the fields that every robot sends.
HEAD = Struct(
    part("raw_x", Int16ul, f"counts of DistConvFactor, {POSITION_MASK.bit_length()} bits; bit 15 is masked"),
    part("raw_y", Int16ul, "as x"),
    part("raw_heading", Int16sl, "4096 counts a turn, + counter-clockwise"),
    part("raw_left_velocity", Int16sl, "VelConvFactor mm/s"),
    part("raw_right_velocity", Int16sl, "VelConvFactor mm/s"),
    part("raw_battery", Int8ul, "0.1 V"),
    part("left", Int8ul, "bit 0 the left wheel has stalled, bits 1 to 7 the **rear** bumper's segments"),
    part("right", Int8ul, "bit 0 the right wheel has stalled, bits 1 to 7 the **front** bumper's segments"),
    part("raw_control", Int16sl, "heading set-point, as the heading"),
    part(
        "raw_flags",
        Int16ul,
        "P2OS: pulse width of servo 1. AROS, ARCOS: bit 0 motors enabled, 1 to 4 sonar arrays on, 5 stop button, "
        "6 stall by it, 7 far and 8 near ledge, 9 joystick button, 10 charger has power",
    ),
    part("raw_compass", Int8ul, "2° units"),
    part("count", Int8ul, "new sonar readings that follow, n"),
    part("sonar", Array(this.count, READING)),
    part("first", Int8ul, "P2OS: analog port. AROS, ARCOS: gripper"),
    part("second", Int8ul, "P2OS: gripper. AROS, ARCOS: analog port"),
    part("raw_analog", Int8ul, "0 to 255 for 0 to 5 V"),
    part("digital_in", Int8ul, "a bit an input"),
    part("digital_out", Int8ul, "a bit an output. **A P2OS or AROS SIP ends here**"),
)
#: Bytes of the head without sonar, type byte included.
HEAD_BYTES = 25
READING_BYTES = 3
#: Where the readings begin, type byte included.
SONAR_AT = 20
#: Where the number of readings stands: right before them.
COUNT_AT = SONAR_AT - 1
_NAMES = tuple(str(sub.name) for sub in HEAD.subcons)
#: Fields before and behind the sonar readings.
BEFORE_SONAR = _NAMES[: _NAMES.index("sonar")]
BEHIND_SONAR = _NAMES[len(BEFORE_SONAR) + 1 :]
_OF_READING = tuple(str(sub.name) for sub in READING.subcons)
#: How the standard library's `struct` calls each number of the head.
_LETTERS = {
    str(sub.name): str(sub.subcon.fmtstr[1:]) for sub in (*HEAD.subcons, *READING.subcons) if sub.name != "sonar"
}

#: The ARCOS tail: (field, bytes, signed, meaning). Firmware only ever appends.
_TAIL_ROWS = (
    ("raw_battery_x10", 2, False, "0.1 V"),
    ("charge_state", 1, True, "−1 unknown, 0 none, 1 bulk, 2 overcharge, 3 float, 4 balance"),
    ("raw_rotation_velocity", 2, True, "0.1 °/s"),
    ("fault_flags", 2, False, "bits"),
    ("raw_lateral_velocity", 2, True, "mm/s"),
    ("raw_temperature", 1, True, "°C, −127 none"),
    ("state_of_charge", 1, False, "percent"),
    ("controller_time_us", 4, False, "µs (Pioneer LX)"),
    ("raw_flags3", 4, False, "more flags (Pioneer LX)"),
)
TAIL = tuple((name, size, signed) for name, size, signed, _ in _TAIL_ROWS)
TAIL_MEANINGS: Mapping[str, str] = {name: means for name, *_, means in _TAIL_ROWS}


@dataclass(frozen=True, slots=True)
class SonarReading:
    """One new sonar reading.

    Args:
        number: From 0.
        raw_range: Counts of RangeConvFactor, 0 to 0xFFFF.
    """

    number: int
    raw_range: int


@dataclass(frozen=True, slots=True, kw_only=True)
class StandardSip:
    """One standard SIP, as on the wire.

    Positions are 15-bit counts, headings 4096 to the turn, speeds mm/s, the
    battery in 0.1 V. Bumpers hold seven bits, segment 1 in bit 0 (bits 1 to 7 of
    the stall bytes). `raw_flags` is servo 1's pulse width on P2OS robots.
    `tail` holds the ARCOS fields that were sent, in the order of `TAIL`.
    """

    kind: int = STANDING
    raw_x: int = 0
    raw_y: int = 0
    raw_heading: int = 0
    raw_left_velocity: int = 0
    raw_right_velocity: int = 0
    raw_battery: int = 0
    stall_left: bool = False
    stall_right: bool = False
    rear_bumpers: int = 0
    front_bumpers: int = 0
    raw_control: int = 0
    raw_flags: int = 0
    raw_compass: int = 0
    sonar: tuple[SonarReading, ...] = ()
    analog_port: int = 0
    gripper_state: int = 0
    raw_analog: int = 0
    digital_in: int = 0
    digital_out: int = 0
    tail: tuple[int, ...] = ()
    #: Bytes after the last field that this project knows.
    rest: bytes = b""

    @property
    def moving(self) -> bool:
        """Whether the robot says that its wheels turn."""
        return self.kind == MOVING

    @property
    def motors_enabled(self) -> bool:
        """Bit 0 of the flags: true only of AROS and ARCOS robots."""
        return bool(self.raw_flags & 1)

    def tail_field(self, name: str) -> int | None:
        """Return a field of the ARCOS tail by its name in `TAIL`, or None where it was not sent."""
        names = [row[0] for row in TAIL]
        place = names.index(name)
        return self.tail[place] if place < len(self.tail) else None

    def to_frame(self, profile: Profile) -> Frame:
        """Return the frame of this packet in a firmware family's layout.

        Raises:
            LocalProtocolError: A value does not fit its field.
        """
        port_and_gripper = (self.analog_port, self.gripper_state)
        first, second = port_and_gripper[::-1] if profile.has_gripper_first else port_and_gripper
        try:
            head = _head_of(len(self.sonar)).pack(
                self.raw_x,
                self.raw_y,
                self.raw_heading,
                self.raw_left_velocity,
                self.raw_right_velocity,
                self.raw_battery,
                self.rear_bumpers << 1 | self.stall_left,
                self.front_bumpers << 1 | self.stall_right,
                self.raw_control,
                self.raw_flags,
                self.raw_compass,
                len(self.sonar),
                *(value for reading in self.sonar for value in (reading.number, reading.raw_range)),
                first,
                second,
                self.raw_analog,
                self.digital_in,
                self.digital_out,
            )
            tail = [
                value.to_bytes(size, "little", signed=signed)
                for value, (_, size, signed) in zip(self.tail, TAIL, strict=False)
            ]
        except (OverflowError, struct.error) as error:
            raise LocalProtocolError(f"a value does not fit the SIP: {error}") from error
        return Frame(bytes((self.kind,)) + head[1:] + b"".join(tail) + self.rest)

    @classmethod
    def from_frame(cls, frame: Frame, profile: Profile) -> "StandardSip":
        """Read a SIP; the fields of the tail are those that its length leaves room for.

        Raises:
            RemoteProtocolError: The packet is shorter than its own sonar count says.
        """
        return cls._read(frame.payload, profile)

    @classmethod
    @lru_cache(maxsize=1)  # in a bench two readers look at each packet, one right after the other
    def _read(cls, data: bytes, profile: Profile) -> "StandardSip":
        head = unpack_head(data)
        if head is None:
            count = data[COUNT_AT] if len(data) > COUNT_AT else 0
            size = HEAD_BYTES + READING_BYTES * count
            raise RemoteProtocolError(f"a SIP of {len(data)} bytes with {count} sonar readings: {size} expected")
        x, y, heading, left_velocity, right_velocity, battery, left, right, control, flags, compass, count = head[:12]
        size, behind = HEAD_BYTES + READING_BYTES * count, 12 + 2 * count
        first, second, analog, digital_in, digital_out = head[behind:]
        tail, place = unpack_tail(data, size)
        return cls(
            kind=data[0],
            raw_x=x,
            raw_y=y,
            raw_heading=heading,
            raw_left_velocity=left_velocity,
            raw_right_velocity=right_velocity,
            raw_battery=battery,
            stall_left=bool(left & 1),
            stall_right=bool(right & 1),
            rear_bumpers=left >> 1,
            front_bumpers=right >> 1,
            raw_control=control,
            raw_flags=flags,
            raw_compass=compass,
            sonar=tuple(map(SonarReading, head[12:behind:2], head[13:behind:2])),
            analog_port=second if profile.has_gripper_first else first,
            gripper_state=first if profile.has_gripper_first else second,
            raw_analog=analog,
            digital_in=digital_in,
            digital_out=digital_out,
            tail=tail,
            rest=data[place:],
        )


def unpack_head(payload: bytes) -> tuple[int, ...] | None:
    """Return the numbers of a SIP's head in the order of the wire: those before the sonar, number and range of each
    reading, those behind it; None where the packet is shorter than its own sonar count says.
    """  # noqa: D205  # one sentence of two lines
    return _head_of(payload[COUNT_AT]).unpack_from(payload) if is_sip(payload) else None


@dataclass(frozen=True, slots=True)
class Heads:
    """The numbers of many SIPs' heads, a column each.

    Args:
        columns: By field: those before and behind the sonar readings, one a SIP.
        rows: To which SIP each sonar reading belongs, from 0, rising.
        numbers: Of each reading.
        ranges: Of each reading, raw.
    """

    columns: Mapping[str, Sequence[int]]
    rows: Sequence[int]
    numbers: Sequence[int]
    ranges: Sequence[int]


def unpack_heads(payloads: Sequence[bytes]) -> Heads:
    """Return what `unpack_head` says of SIPs, all of them sound inside, without a tuple for each."""
    columns = _columns(b"".join([payload[1:SONAR_AT] for payload in payloads]), BEFORE_SONAR)
    ends = [SONAR_AT + READING_BYTES * count for count in columns["count"]]
    size = HEAD_BYTES - SONAR_AT
    behind = b"".join([payload[end : end + size] for payload, end in zip(payloads, ends, strict=True)])
    sonar = b"".join([payload[SONAR_AT:end] for payload, end in zip(payloads, ends, strict=True)])
    rows = list(chain.from_iterable(map(repeat, range(len(payloads)), columns["count"])))
    return Heads({**columns, **_columns(behind, BEHIND_SONAR)}, rows, *_columns(sonar, _OF_READING).values())


def _columns(data: bytes, names: Sequence[str]) -> dict[str, Sequence[int]]:
    """Return the columns of rows of numbers that stand one behind the other."""
    sizes = [struct.calcsize("<" + _LETTERS[name]) for name in names]
    step = sum(sizes)
    rows = len(data) // step
    found: dict[str, Sequence[int]] = {}
    for name, place, size in zip(names, accumulate(sizes, initial=0), sizes, strict=False):
        raw = bytearray(size * rows)
        for byte in range(size):
            raw[byte::size] = data[place + byte :: step]
        # Bytes are numbers already, without an object for each.
        found[name] = bytes(raw) if _LETTERS[name] == "B" else struct.unpack(f"<{rows}{_LETTERS[name]}", raw)
    return found


def is_sip(payload: bytes) -> bool:
    """Tell whether a packet of one of the types is a SIP inside: as long as its own sonar count says, or longer."""
    return len(payload) >= HEAD_BYTES and len(payload) >= HEAD_BYTES + READING_BYTES * payload[COUNT_AT]


def unpack_tail(payload: bytes, place: int) -> tuple[tuple[int, ...], int]:
    """Return as many fields of the tail as a payload has room for from a place on, and one past the last."""
    if place == len(payload):
        return (), place
    layout = _TAILS[bisect_right(_TAIL_ENDS, len(payload) - place)]
    return layout.unpack_from(payload, place), place + layout.size


@cache
def _head_of(count: int) -> struct.Struct:
    """Return the head with so many sonar readings, behind a byte for the type, as declared, in the standard library's
    faster way.
    """  # noqa: D205  # one sentence of two lines
    before, reading, behind = map(_letters, (BEFORE_SONAR, _OF_READING, BEHIND_SONAR))
    return struct.Struct(f"<x{before}{reading * count}{behind}")


def _letters(names: Iterable[str]) -> str:
    return "".join(_LETTERS[name] for name in names)


_TAIL_LETTERS = {(1, False): "B", (1, True): "b", (2, False): "H", (2, True): "h", (4, False): "I"}
#: The tail's first 0, 1, 2, ... fields.
_TAILS = tuple(
    struct.Struct("<" + "".join(_TAIL_LETTERS[width, signed] for _, width, signed in TAIL[:number]))
    for number in range(len(TAIL) + 1)
)
_TAIL_ENDS = tuple(layout.size for layout in _TAILS[1:])
