"""The events of a run: what each kind tells, in the integers of the trace.

Times (`t`) are nanoseconds of virtual time. An event is a value: it can be compared, saved and
sent to another process. How each is written in a trace stands in `codec`.

Invariant: an event holds integers, levels, bytes and words, or lengths that come back from the
trace as they were.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeAlias, get_args

from simbase.timing import NS_PER_S, Nanos

#: Integers of a pose in a metre, a radian, a metre a second.
MICRO = 1_000_000
#: The parts of a hull, counter-clockwise from ahead, an eighth of a turn each.
HULL_PARTS = ("front", "front left", "left", "rear left", "rear", "rear right", "right", "front right")


def hull_part(bearing_rad: float) -> str:
    """Return which part of the hull lies in a direction, counter-clockwise from ahead."""
    return HULL_PARTS[round(bearing_rad / math.tau * len(HULL_PARTS)) % len(HULL_PARTS)]


@dataclass(frozen=True, slots=True, kw_only=True)
class PinEdge:
    """A wire has come to a level; the first of each wire, at 0, says what it begins with."""

    t: Nanos
    wire: str
    level: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Wave:
    """A wire carries a wave from now on: up every `period` ticks, down `high` ticks later.

    `at` is how many ticks before `t` it last went up. A period of 0 ends a wave: the wire has a level again, which
    its edges say; while it has a wave they say low.
    """

    t: Nanos
    wire: str
    at: int
    period: int
    high: int
    ticks_hz: int

    @property
    def frequency_hz(self) -> float:
        """Rises a second; 0 where it ends."""
        return self.ticks_hz / self.period if self.period else 0.0

    @property
    def duty(self) -> float:
        """The share of the time at level 1; 0 where it ends."""
        return self.high / self.period if self.period else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Text:
    """A line that the firmware has printed, with its end, or a piece of a long one; `t` is its last stop bit."""

    t: Nanos
    data: bytes
    port: str = "usart1"


@dataclass(frozen=True, slots=True, kw_only=True)
class SpiTransfer:
    """Words that went over an SPI without a pause between: 4096 bytes, or a piece of more.

    `t` is when that was known: a pause of 50 us and a word behind the last bit, or at it where 4096 bytes are full;
    `begun` and `ended` are the first and the last bit. Words of 16 bits (`bits`) are two bytes, the upper first.
    Which of them a part heard depends on its select pin.
    """

    t: Nanos
    bus: str
    begun: Nanos
    ended: Nanos
    from_master: bytes
    from_slave: bytes
    bits: int = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class I2cTransfer:
    """What went over an I2C from a START to what ended it, or a piece of more than 4096 bytes; `t` is the end.

    `address` has 10 bits above 0x7F. `answered` says whether somebody acknowledged it, `acknowledged` how many of the
    bytes were; of what is read the last one is not. `end` is `stop`, `restart` (another START follows), `lost` (to
    another master), `cut` (reset, or SCL low for too long), or `more` (a piece, or the end of the run).
    """

    t: Nanos
    bus: str
    begun: Nanos
    address: int
    is_read: bool
    data: bytes
    answered: bool
    acknowledged: int
    end: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CanTransfer:
    """A frame that the chip has sent (`is_own`) or heard; `t` is its end.

    A remote frame asks for `dlc` bytes and has none. `error` is empty, `acknowledge` (nobody did) or `damaged`; such a
    frame is sent again.
    """

    t: Nanos
    bus: str
    begun: Nanos
    identifier: int
    is_extended: bool
    is_remote: bool
    dlc: int
    data: bytes
    is_own: bool
    error: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Packet:
    """Bytes of the P2OS line that have arrived: `c2r` from client to robot, `r2c` back."""

    t: Nanos
    direction: str
    data: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Where the robot is and how it moves, each 50 ms: micrometres, microradians and micrometres a second.

    Wheel angles are counted from the start; `collisions` are those so far, and so is the work at the rims, |torque ·
    rate|, in microjoules: None in old traces.
    """

    t: Nanos
    x: int
    y: int
    z: int
    heading: int
    pitch: int
    left: int
    right: int
    left_angle: int
    right_angle: int
    collisions: int
    work: int | None = None

    @property
    def x_m(self) -> float:
        """Metres."""
        return self.x / MICRO

    @property
    def y_m(self) -> float:
        """Metres."""
        return self.y / MICRO

    @property
    def heading_rad(self) -> float:
        """Radians, counter-clockwise."""
        return self.heading / MICRO

    @property
    def speed_mps(self) -> float:
        """Of the middle between the wheels, m/s, positive forward."""
        return (self.left + self.right) / 2 / MICRO


@dataclass(frozen=True, slots=True, kw_only=True)
class Clearance:
    """The hull was nearer to something than ever before: micrometres in the plan view."""

    t: Nanos
    um: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranges:
    """The ranges of all sonar, millimetres, where one is new."""

    t: Nanos
    mm: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """The hull has come to touch something: what, where in the plan, and with which part of it.

    `what` is a thing's name in quotes, or `something`; `part` is one of `HULL_PARTS`, empty in old traces.
    """

    t: Nanos
    what: str
    x_m: float
    y_m: float
    part: str = ""

    @property
    def place(self) -> str:
        """What and where, in words."""
        with_what = f" ({self.part})" if self.part else ""
        return f"{self.what} at x {self.x_m:.3f} m, y {self.y_m:.3f} m{with_what}"

    def __str__(self) -> str:
        with_what = f", by the robot's {self.part}" if self.part else ""
        return f"{self.what} at {self.t / NS_PER_S:.3f} s, x {self.x_m:.2f} m, y {self.y_m:.2f} m{with_what}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """A line of a part's state log: who noted what, with what detail."""

    t: Nanos
    who: str
    what: str
    detail: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldChange:
    """A thing was placed, moved or removed; `fields` are its lengths in metres, rounded to a micrometre."""

    t: Nanos
    op: str
    name: str
    fields: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Something was made to go wrong (`inject`), was set right again (`clear`), or the firmware died (`died`)."""

    t: Nanos
    op: str
    words: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A goal is decided: whether it was met, and what a person reads of it.

    `robustness` is by how much, in `unit`, negative where it was missed; None where the goal has no measure.
    """

    t: Nanos
    goal: str
    met: bool
    says: str
    robustness: float | None = None
    unit: str = ""


#: Whatever happens in a run.
Event: TypeAlias = (
    PinEdge
    | Wave
    | Text
    | SpiTransfer
    | I2cTransfer
    | CanTransfer
    | WorldChange
    | Fault
    | Packet
    | Note
    | Ranges
    | Pose
    | Clearance
    | Contact
    | Verdict
)
KINDS: tuple[type, ...] = get_args(Event)
