"""Events as lines of a trace, and lines as events: one row of `ROWS` a kind.

A line is one JSON object with its kind `k` and its time `t`; docs/bench.md lists the kinds. Edges are
written in blocks, whose numbers `robot_bench.wires.edges` describes. Kinds that a later version adds
are passed over.

Invariant: `event_of` gives back the event that `line_of` has written.
"""

import json
import math
import re
from binascii import a2b_base64
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from json.encoder import encode_basestring_ascii as _quoted
from typing import Any, TypeAlias, cast, get_type_hints

from robot_bench.events.kinds import (
    CanTransfer,
    Clearance,
    Contact,
    Event,
    Fault,
    I2cTransfer,
    Note,
    Packet,
    PinEdge,
    Pose,
    Ranges,
    SpiTransfer,
    Text,
    Verdict,
    Wave,
    WorldChange,
)
from robot_bench.wires.edges import Edges, unpack
from simbase.errors import FileError
from simbase.files import VersionedFormat
from simbase.timing import Nanos

#: A parsed JSON object.
Json: TypeAlias = dict[str, object]

#: The whole file, its version in its first line; the first is of before events had kinds of their own.
TRACE = VersionedFormat("a trace", newest=2)
#: Of the blocks of edges.
BLOCKS_VERSION = 1
#: What any number of a trace stays within: 64 bits, as the parts that write it count.
_MOST = 2**63 - 1
#: chosen: three years; no run is longer, and ROS's seconds and every picture's axis still hold it.
LAST_NS: Nanos = 10**17
#: Who sent a packet.
_DIRECTIONS = frozenset({"c2r", "r2c"})
#: What a body noted of a collision before contacts were events: what, and where.
_OLD_CONTACT = re.compile(r"(.*) at x (-?[\d.]+) m, y (-?[\d.]+) m$")

_encode = json.JSONEncoder(sort_keys=True, separators=(",", ":"), ensure_ascii=True).encode


class TraceError(FileError):
    """There is no readable trace, or a line of it is damaged."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """At 0: the wires in the order of the blocks, and the level of each."""

    t: Nanos
    nets: tuple[str, ...]
    levels: str


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeBlock:
    """So many edges, the first at `t`: base64 of what `robot_bench.wires.edges` packs."""

    t: Nanos
    count: int
    data: str


#: What a trace is written of: events, their edges in bulk.
Recorded: TypeAlias = Event | Levels | EdgeBlock


def _um(metres: float) -> int:
    return round(metres * 1e6)


@dataclass(frozen=True, slots=True)
class _Row:
    kind: str
    #: Spells an event of this kind: sorted keys, no spaces, as `_encode` does; what comes often without an encoder.
    line: Callable[[str, Any], str]
    from_entry: Callable[[Nanos, Json], Recorded | None]


def _encoded(to_entry: Callable[[Any], Mapping[str, object]]) -> Callable[[str, Any], str]:
    """Return how a kind is spelled by the encoder, from what it has beside its kind and its time."""
    return lambda kind, event: _encode({"k": kind, "t": event.t, **to_entry(event)})


def _integer(entry: Json, key: str) -> int:
    value = entry.get(key, 0)
    if type(value) is int and -_MOST <= value <= _MOST:
        return value
    if not isinstance(value, (int, float)):
        raise ValueError("no number")  # noqa: TRY004 - a damaged line, as any other
    return _whole(value)


def _whole(value: float) -> int:
    if abs(value) > _MOST:
        raise ValueError("a number beyond 64 bits")
    return int(value)


def _finite(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) or abs(value) > _MOST:
        raise ValueError("no number")
    return float(value)


def _packet(t: Nanos, entry: Json) -> Recorded:
    direction = str(entry["dir"])
    if direction not in _DIRECTIONS:
        raise ValueError("a packet that nobody sent")
    return Packet(t=t, direction=direction, data=bytes.fromhex(str(entry["hex"])))


def _pins_line(kind: str, pins: Levels | EdgeBlock) -> str:
    if isinstance(pins, EdgeBlock):
        return f'{{"d":"{pins.data}","k":"{kind}","n":{pins.count},"t":{pins.t}}}'
    return _encode({"k": kind, "t": pins.t, "v": BLOCKS_VERSION, "nets": pins.nets, "levels": pins.levels})


def _pins(t: Nanos, entry: Json) -> Recorded:
    if "nets" not in entry:
        return EdgeBlock(t=t, count=_integer(entry, "n"), data=str(entry["d"]))
    if _integer(entry, "v") != BLOCKS_VERSION:
        raise TraceError("edges as a later version writes them", hint="install a newer p2os")
    nets, levels = tuple(map(str, cast("list[object]", entry["nets"]))), str(entry["levels"])
    if len(nets) != len(levels) or set(levels) - {"0", "1"}:
        raise ValueError("not a level for each wire")
    return Levels(t=t, nets=nets, levels=levels)


def _text_line(kind: str, text: Text) -> str:
    port = "" if text.port == "usart1" else f'"port":{_quoted(text.port)},'
    return f'{{"hex":"{text.data.hex()}","k":"{kind}",{port}"t":{text.t}}}'


def _note_line(kind: str, note: Note) -> str:
    said = f'"t":{note.t},"what":{_quoted(note.what)},"who":{_quoted(note.who)}'
    return f'{{"detail":{_quoted(note.detail)},"k":"{kind}",{said}}}'


def _note(t: Nanos, entry: Json) -> Recorded:
    who, what, detail = str(entry["who"]), str(entry["what"]), str(entry.get("detail", ""))
    if who == "body" and what == "collision" and (old := _OLD_CONTACT.match(detail)):
        return Contact(t=t, what=old[1], x_m=float(old[2]), y_m=float(old[3]))
    return Note(t=t, who=who, what=what, detail=detail)


#: What a change of the world has to say in numbers.
_NUMBERS: Mapping[object, tuple[str, ...]] = {"place": ("x", "y"), "move": ("x", "y"), "remove": ()}


def _world_change(t: Nanos, entry: Json) -> Recorded | None:
    """Return a change of the world whose numbers are numbers; None for what a later version does to it."""
    op = str(entry.get("op"))
    if op not in _NUMBERS:
        return None
    sizes = ("length", "width") if entry.get("shape", "box") == "box" else ("radius",)
    needed = (*_NUMBERS[op], *(sizes if op == "place" else ()), *(["heading"] if "heading" in entry else []))
    numbers = {key: _finite(entry[key]) for key in needed}
    rest = {key: value for key, value in entry.items() if key not in {"k", "t", "op", "name"}}
    for key in ("height", "radius", "length", "width"):
        if key in rest:
            _finite(rest[key])
    for key in ("shape", "kind"):
        if not isinstance(rest.get(key, ""), str):
            raise ValueError("no word")  # noqa: TRY004 - a damaged line, as any other
    return WorldChange(t=t, op=op, name=str(entry["name"]), fields=rest | numbers)


_POSE = {
    "x": "x", "y": "y", "z": "z", "h": "heading", "p": "pitch", "l": "left", "r": "right", "la": "left_angle",
    "ra": "right_angle", "c": "collisions",
}  # fmt: skip


def _pose_line(kind: str, pose: Pose) -> str:
    """Return the line of a pose; its keys are those of `_POSE`, and `w`."""
    work = "" if pose.work is None else f'"w":{pose.work},'
    return (
        f'{{"c":{pose.collisions},"h":{pose.heading},"k":"{kind}","l":{pose.left},"la":{pose.left_angle},'
        f'"p":{pose.pitch},"r":{pose.right},"ra":{pose.right_angle},"t":{pose.t},{work}'
        f'"x":{pose.x},"y":{pose.y},"z":{pose.z}}}'
    )


def _pose(t: Nanos, entry: Json) -> Recorded:
    work = _integer(entry, "w") if "w" in entry else None
    return Pose(t=t, **{name: _integer(entry, key) for key, name in _POSE.items()}, work=work)


def _verdict(t: Nanos, entry: Json) -> Recorded:
    by = entry.get("robustness")
    return Verdict(
        t=t, goal=str(entry["goal"]), met=bool(entry["met"]), says=str(entry["says"]),
        robustness=None if by is None else _finite(by), unit=str(entry.get("unit", "")),
    )  # fmt: skip


def _wave(t: Nanos, entry: Json) -> Recorded:
    at, period, high, hz = (_integer(entry, key) for key in ("at", "period", "high", "hz"))
    if period and not (hz > 0 and 0 < high < period and 0 <= at < period):
        raise ValueError("no such wave")
    return Wave(t=t, wire=str(entry["net"]), at=at, period=period, high=high, ticks_hz=hz)


def _wave_line(kind: str, wave: Wave) -> str:
    turns = f'"net":{_quoted(wave.wire)},"period":{wave.period}'
    return f'{{"at":{wave.at},"high":{wave.high},"hz":{wave.ticks_hz},"k":"{kind}",{turns},"t":{wave.t}}}'


def _level(value: int) -> bool:
    if value not in {0, 1}:
        raise ValueError("no level")
    return bool(value)


#: How values of each type are spelled, and how they are read.
_SPELLED: Mapping[type, Callable[[Any], object]] = {bool: int, bytes: bytes.hex, int: int, str: str}
_READ: Mapping[object, Callable[[Json, str], object]] = {
    int: _integer,
    bool: lambda entry, key: _level(_integer(entry, key)),
    bytes: lambda entry, key: bytes.fromhex(str(entry[key])),
    str: lambda entry, key: str(entry[key]),
}


def _plain(kind: str, made: type[Any], words: str) -> _Row:
    """Return the row of a kind of which each attribute is a key, read by its type: "key:attribute", or one for both."""
    keys = {key: name or key for key, _, name in (word.partition(":") for word in words.split())}
    types = get_type_hints(made)
    readers = [(name, key, _READ[types[name]]) for key, name in keys.items()]

    def to_entry(event: Event) -> Json:
        return {key: _SPELLED[type(value := getattr(event, name))](value) for key, name in keys.items()}

    def from_entry(t: Nanos, entry: Json) -> Event:
        event: Event = made(t=t, **{name: read(entry, key) for name, key, read in readers})
        return event

    return _Row(kind, _encoded(to_entry), from_entry)


#: In the order of one instant.
ROWS: Mapping[type, _Row] = {
    Levels: _Row("pins", _pins_line, _pins),
    EdgeBlock: _Row("pins", _pins_line, _pins),
    PinEdge: _plain("pin", PinEdge, "net:wire v:level"),
    Wave: _Row("wave", _wave_line, _wave),
    Text: _Row(
        "usart",
        _text_line,
        lambda t, entry: Text(t=t, data=bytes.fromhex(str(entry["hex"])), port=str(entry.get("port", "usart1"))),
    ),
    SpiTransfer: _plain("spi", SpiTransfer, "bits bus from:begun miso:from_slave mosi:from_master to:ended"),
    I2cTransfer: _plain(
        "i2c",
        I2cTransfer,
        "acks:acknowledged address answered bus end from:begun hex:data read:is_read",
    ),
    CanTransfer: _plain(
        "can",
        CanTransfer,
        "bus dlc error ext:is_extended from:begun hex:data id:identifier own:is_own rtr:is_remote",
    ),
    WorldChange: _Row(
        "obstacle", _encoded(lambda item: {"op": item.op, "name": item.name, **item.fields}), _world_change
    ),
    Fault: _plain("fault", Fault, "op words"),
    Packet: _Row(
        "wire",
        lambda kind, packet: f'{{"dir":"{packet.direction}","hex":"{packet.data.hex()}","k":"{kind}","t":{packet.t}}}',
        _packet,
    ),
    Note: _Row("event", _note_line, _note),
    Ranges: _Row(
        "sonar",
        lambda kind, ranges: f'{{"k":"{kind}","mm":[{",".join(map(str, ranges.mm))}],"t":{ranges.t}}}',
        lambda t, entry: Ranges(t=t, mm=tuple(_whole(value) for value in cast("list[float]", entry["mm"]))),
    ),
    Pose: _Row("pose", _pose_line, _pose),
    Clearance: _Row(
        "clearance",
        lambda kind, clearance: f'{{"k":"{kind}","t":{clearance.t},"um":{clearance.um}}}',
        lambda t, entry: Clearance(t=t, um=_integer(entry, "um")),
    ),
    Contact: _Row(
        "contact",
        _encoded(lambda hit: {"what": hit.what, "x": _um(hit.x_m), "y": _um(hit.y_m), "part": hit.part}),
        lambda t, entry: Contact(
            t=t,
            what=str(entry["what"]),
            x_m=_integer(entry, "x") / 1e6,
            y_m=_integer(entry, "y") / 1e6,
            part=str(entry.get("part", "")),
        ),
    ),
    Verdict: _Row(
        "verdict",
        _encoded(
            lambda verdict: {
                "goal": verdict.goal,
                "met": verdict.met,
                "says": verdict.says,
                "robustness": verdict.robustness,
                "unit": verdict.unit,
            }
        ),
        _verdict,
    ),
}
#: Order of kinds within one instant.
RANKS: Mapping[type, int] = {kind: rank for rank, kind in enumerate(ROWS)} | {EdgeBlock: 0}
_BY_KIND: Mapping[object, Callable[[Nanos, Json], Recorded | None]] = {
    row.kind: row.from_entry for row in ROWS.values()
}


def line_of(event: Recorded) -> str:
    """Return the one spelling of an event, without its line end: sorted keys, no spaces."""
    row = ROWS[type(event)]
    return row.line(row.kind, event)


def event_of(entry: Json) -> Recorded | None:
    """Return what a line tells; None for the first and the last one, and for kinds of a later version.

    Raises:
        TraceError: It is written as a later version does.
        KeyError, TypeError, ValueError: It is damaged.
    """
    kind = entry.get("k")
    from_entry = _BY_KIND.get(kind) if isinstance(kind, str) else None
    if from_entry is None:
        return None
    at = _integer(entry, "t")
    if not 0 <= at <= LAST_NS:
        raise ValueError("at no time of a run")
    return from_entry(at, entry)


def entries_of(lines: Iterable[str]) -> Iterator[Json]:
    """Yield each complete line; stop quietly at the first that is cut or no object."""
    for line in lines:
        if not line.endswith("\n"):
            return
        try:
            entry = json.loads(line)
        except (ValueError, RecursionError):
            return
        if not isinstance(entry, dict):
            return
        yield entry


@dataclass(slots=True)
class Blocks:
    """Reads blocks of edges one after the other."""

    nets: tuple[str, ...] = ()
    levels: bytearray = field(default_factory=bytearray)

    def begin(self, head: Levels) -> None:
        """Take what the wires begin with."""
        self.nets, self.levels = head.nets, bytearray(map(int, head.levels))

    def take(self, block: EdgeBlock) -> Iterator[tuple[str, Edges]]:
        """Yield each wire's edges of the next block.

        Raises:
            ValueError: The block is damaged.
        """
        found = unpack(a2b_base64(block.data), len(self.nets), block.t)
        if sum(len(times) for _, times in found) != block.count:
            raise ValueError("a block has not as many edges as it says")
        for place, times in found:
            edges, count, level = Edges(), len(times), self.levels[place]
            edges.extend(times, (_TOGGLED[level] * (count // 2 + 1))[:count])
            self.levels[place] = level ^ count & 1
            yield self.nets[place], edges


#: What follows a level of 0 and of 1.
_TOGGLED = (b"\1\0", b"\0\1")


def events_of(lines: Iterable[str], where: str = "the trace", begun: Blocks | None = None) -> Iterator[Event]:
    """Play back a trace: yield the events of a run in the order in which its subscribers got them.

    It ends with the last whole line, whether the run came to its end or was killed.

    Args:
        lines: Of the trace.
        where: What a message calls it.
        begun: The wires and their levels before the first of these lines, where they do not begin with the trace.

    Raises:
        TraceError: A line is damaged, or of a later version.
    """
    blocks, edges = begun or Blocks(), deque[PinEdge]()
    places = {net: place for place, net in enumerate(blocks.nets)}
    for number, entry in enumerate(entries_of(lines), start=1):
        try:
            event = event_of(entry)
            if isinstance(event, Levels):
                blocks.begin(event)
                places = {net: place for place, net in enumerate(event.nets)}
                edges.extend(
                    PinEdge(t=event.t, wire=net, level=level == "1")
                    for net, level in zip(event.nets, event.levels, strict=True)
                )
                continue
            if isinstance(event, EdgeBlock):
                rows = [(t, places[net], net, level) for net, track in blocks.take(event) for t, level in track]
                edges.extend(PinEdge(t=t, wire=net, level=bool(level)) for t, _, net, level in sorted(rows))
                continue
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise damaged(where, number) from error
        except TraceError as error:
            raise TraceError(f"{where}:{number}: {error}", hint=error.hint) from error
        if event is None:
            continue
        while edges and edges[0].t <= event.t:
            yield edges.popleft()
        yield event
    yield from edges


def damaged(where: str, number: int) -> TraceError:
    """Return the refusal of a line."""
    return TraceError(
        f"{where}:{number}: a damaged line", hint="cut the file before it: what stands above it is reported"
    )
