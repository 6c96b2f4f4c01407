"""The kinds of channels of a recording: which columns each has, and what stands in them.

The one description: frames are packed and read by it (`frames`), and the types of the page in TypeScript are made of
it (`tools/generators/page_types.py`). A row of a channel is a moment: its first column is `t`, int64 nanoseconds, never
running back.

Invariant: numbers and columns of a kind never change; what needs others is a new kind.
"""

from dataclasses import dataclass
from enum import Enum

#: Of the frames, the header and the subprotocol; another is refused.
FORMAT = 1
#: chosen: pixels that a whole run is asked for at first; more than any screen has, so that one may look closer at an
#: eighth of it before rows are missed.
WHOLE_PIXELS = 2400


class CellType(Enum):
    """What a column holds; the value is its name in the TypeScript."""

    #: 64-bit signed integers, two's complement.
    I64 = "i64"
    #: Floats, IEEE 754.
    F64 = "f64"
    F32 = "f32"
    #: Unsigned integers.
    U32 = "u32"
    U8 = "u8"
    #: UTF-8, each distinct text once.
    TEXT = "text"
    #: Bytes, each distinct run once.
    BYTES = "bytes"


@dataclass(frozen=True, slots=True)
class ColumnKind:
    """A column: its name with its unit, what it holds, and what that means."""

    name: str
    cells: CellType
    doc: str
    #: So many cells a row as the channel's header says in `width`; else one.
    is_wide: bool = False


@dataclass(frozen=True, slots=True)
class ChannelKind:
    """A kind of channel."""

    name: str
    number: int
    doc: str
    columns: tuple[ColumnKind, ...]


_T = ColumnKind("t_ns", CellType.I64, "when, ns since the start")


def _kind(name: str, number: int, doc: str, *columns: tuple[str, CellType, str]) -> ChannelKind:
    return ChannelKind(name, number, doc, (_T, *(ColumnKind(*column) for column in columns)))


KINDS: tuple[ChannelKind, ...] = (
    _kind(
        "levels", 1, "a digital wire, or a bus of up to 32: what it has from then on",
        ("level", CellType.U32, "the value"),
        ("edges", CellType.U32, "how many changes the row stands for; more than 1 where changes are left out"),
    ),
    _kind(
        "waves", 2, "a wave on the wire that the header's `of` names, while which its level says nothing",
        ("period_ns", CellType.F64, "ns between rises; 0 ends the wave"),
        ("high_ns", CellType.F64, "ns at level 1 of each period"),
        ("phase_ns", CellType.F64, "ns since its last rise"),
    ),
    _kind(
        "samples", 3, "a number over time: analog, or anything measured",
        ("value", CellType.F64, "in the channel's unit; NaN where there is none"),
    ),
    _kind(
        "pose", 4, "where a robot is: x to the right, y up, heading counter-clockwise from x",
        ("x_m", CellType.F32, "metres"), ("y_m", CellType.F32, "metres"),
        ("z_m", CellType.F32, "metres above the floor"),
        ("heading_rad", CellType.F32, "radians"), ("pitch_rad", CellType.F32, "radians, nose up positive"),
    ),
    ChannelKind(
        "ranges", 5, "what range sensors read; their places are in the header's `sensors`",
        (_T, ColumnKind("range_m", CellType.F32, "metres, a cell a sensor; NaN where there is no echo", is_wide=True)),
    ),
    _kind(
        "packets", 6, "frames of a protocol",
        ("to_robot", CellType.U8, "1 from the client to the robot, 0 back, 2 unknown"),
        ("data", CellType.BYTES, "as on the wire"), ("name", CellType.TEXT, "in the manual's words"),
        ("says", CellType.TEXT, "what it says, in a line"),
        ("fields", CellType.TEXT, "JSON: [[first byte, byte after the last, name, meaning], …]; empty where left out"),
        ("is_bad", CellType.U8, "1 where it is no sound frame"),
    ),
    _kind(
        "text", 7, "lines of a console",
        ("is_sent", CellType.U8, "0 printed by the firmware, 1 typed to it"),
        ("text", CellType.TEXT, "without its line end"),
    ),
    _kind(
        "events", 8, "what happened",
        ("severity", CellType.U8, "0 debug, 1 information, 2 warning, 3 error"),
        ("who", CellType.TEXT, "which part says it"), ("what", CellType.TEXT, "a word"),
        ("detail", CellType.TEXT, "a line"),
        ("x_m", CellType.F32, "where, metres; NaN: nowhere"), ("y_m", CellType.F32, "metres"),
    ),
    _kind(
        "goal", 9, "a goal: how it stands, and by how much",
        ("standing", CellType.U8, "0 open, 1 met, 2 missed, 3 not judged"),
        ("margin", CellType.F64, "in the channel's unit, negative where missed; NaN: unknown"),
        ("says", CellType.TEXT, "why, in a line"),
    ),
    _kind(
        "state", 10, "a state machine: its states and transitions are in the header",
        ("state", CellType.U32, "place in the header's `states`"), ("cause", CellType.TEXT, "of the transition"),
    ),
    _kind(
        "source", 11, "which line of the program runs",
        ("file", CellType.TEXT, "as the debug information has it"), ("line", CellType.U32, "from 1"),
    ),
    _kind(
        "things", 12, "what is placed in the world, moved and removed",
        ("thing", CellType.U32, "place in the world's `things`"), ("is_there", CellType.U8, "0 from now on it is not"),
        ("x_m", CellType.F32, "of its middle, metres"), ("y_m", CellType.F32, "metres"),
        ("heading_rad", CellType.F32, "radians"),
    ),
)  # fmt: skip

BY_NAME = {kind.name: kind for kind in KINDS}
BY_NUMBER = {kind.number: kind for kind in KINDS}
