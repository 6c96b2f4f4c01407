"""A recorded run, read back from its `trace.jsonl`.

The trace is the single source: every picture and table of a report is made
from it, so a run that was cut short (Ctrl-C, kill -9, a full disk) still has a
report up to its last complete line.

Invariant: reading never fails on a trace that ends early; it fails with
`TraceError` on a folder that holds no trace at all.
"""

import json
import re
from binascii import a2b_base64
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

from bluepill_sim.fabric.subscriptions import Wave
from robot_bench.wires.edges import Edges, unpack
from simbase.errors import FileError
from simbase.timing import NS_PER_S

#: A parsed JSON object.
Json = dict[str, object]

TRACE_NAME = "trace.jsonl"
#: Of the blocks of edges.
BLOCKS_VERSION = 1
#: What the body notes when it comes to touch something.
COLLISION = "collision"
_PLACE = re.compile(r" at x (-?[\d.]+) m, y (-?[\d.]+) m$")


class TraceError(FileError):
    """The folder holds no readable trace."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseSample:
    """Where the robot was and how it moved.

    Integers as in the trace: nanoseconds, micrometres, microradians and
    micrometres a second; wheel angles are counted from the start.
    """

    t: int
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A line of the state log: who noted what, with what detail."""

    t: int
    who: str
    what: str
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Collision:
    """What the body came to touch, when (ns) and where in the plan (metres)."""

    t: int
    what: str
    x: float
    y: float

    def __str__(self) -> str:
        return f"{self.what} at {self.t / NS_PER_S:.3f} s, x {self.x:.2f} m, y {self.y:.2f} m"


@dataclass(frozen=True, slots=True, kw_only=True)
class WireChunk:
    """Bytes that finished arriving at `t`: `c2r` from client to robot, `r2c` back."""

    t: int
    direction: str
    data: bytes


@dataclass(slots=True, kw_only=True)
class RunRecord:
    """All that a trace holds, sorted by kind, each list in order of time."""

    meta: Json = field(default_factory=dict)
    end: Json = field(default_factory=dict)
    poses: list[PoseSample] = field(default_factory=list)
    #: Net name → edges as (ns, level), the first of each at 0.
    pins: dict[str, Edges] = field(default_factory=dict)
    #: Net name → waves as (ns, wave from then on, None for a level again); the level in `pins` is 0 during a wave.
    waves: dict[str, list[tuple[int, Wave | None]]] = field(default_factory=dict)
    #: The nets in the order of the trace's blocks.
    nets: tuple[str, ...] = ()
    sonar: list[tuple[int, list[int]]] = field(default_factory=list)
    usart: list[tuple[int, bytes]] = field(default_factory=list)
    wire: list[WireChunk] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    obstacles: list[Json] = field(default_factory=list)
    last_ns: int = 0
    #: True where the trace has no end line, or its last line was cut.
    is_cut: bool = True

    @property
    def usart_text(self) -> str:
        """All that the firmware printed, undecodable bytes replaced."""
        return b"".join(data for _, data in self.usart).decode("utf-8", "replace")

    def collisions(self) -> list[Collision]:
        """Return what the body came to touch, in order; empty for a robot at a port, which cannot tell."""
        found = []
        for event in self.events:
            if event.who == "body" and event.what == COLLISION and (place := _PLACE.search(event.detail)):
                what = event.detail[: place.start()]
                found.append(Collision(t=event.t, what=what, x=float(place[1]), y=float(place[2])))
        return found

    def usart_lines(self) -> list[tuple[int, str]]:
        """Return (ns of its last character, text) for each printed line."""
        lines, pending = [], b""
        for t, data in self.usart:
            pending += data
            *whole, pending = pending.split(b"\n")
            lines += [(t, line.decode("utf-8", "replace").rstrip("\r")) for line in whole]
        if pending:
            lines.append((self.usart[-1][0], pending.decode("utf-8", "replace")))
        return lines


def read_run(folder: Path) -> RunRecord:
    """Read a run folder's trace.

    Raises:
        TraceError: The folder or its trace is missing, or its first line is no trace.
    """
    path = folder / TRACE_NAME
    if not path.is_file():
        raise TraceError(f"{folder} holds no {TRACE_NAME}", hint="give the folder that `p2os run --out DIR` wrote")
    with path.open(encoding="utf-8", errors="replace") as lines:
        record = record_of(lines, str(path))
    if not record.meta:
        raise TraceError(f"{path} does not start with a trace's meta line", hint="was it made by `p2os run`?")
    return record


def record_of(lines: Iterable[str], where: str = "the trace") -> RunRecord:
    """Return what the lines of a trace hold.

    Raises:
        TraceError: A line is damaged, or of a later version.
    """
    record = RunRecord()
    for number, entry in enumerate(_entries(lines), start=1):
        try:
            _file(record, entry)
        except TraceError as error:
            raise TraceError(f"{where}:{number}: {error}", hint=error.hint) from error
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise TraceError(
                f"{where}:{number}: a damaged line", hint="cut the file before it: what stands above it is reported"
            ) from error
    return record


#: What any number of a trace stays within: 64 bits, as the parts that write it count.
_MOST = 2**63 - 1


def _entries(lines: Iterable[str]) -> Iterator[Json]:
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


def _file(record: RunRecord, entry: Json) -> None:
    """Put one entry where it belongs; kinds that a later version adds are passed over."""
    kind = entry.get("k")
    if kind == "meta":
        record.meta = _meta(entry)
        return
    if kind == "end":
        record.end = entry
        record.is_cut = False
        return
    t = _integer(entry, "t")
    record.last_ns = max(record.last_ns, t)
    file = _KINDS.get(kind)
    if file is not None:
        file(record, t, entry)


def _file_event(record: RunRecord, t: int, entry: Json) -> None:
    detail = str(entry.get("detail", ""))
    record.events.append(Event(t=t, who=str(entry["who"]), what=str(entry["what"]), detail=detail))


def _file_wire(record: RunRecord, t: int, entry: Json) -> None:
    record.wire.append(WireChunk(t=t, direction=str(entry["dir"]), data=bytes.fromhex(str(entry["hex"]))))


def _file_sonar(record: RunRecord, t: int, entry: Json) -> None:
    record.sonar.append((t, [_whole(value) for value in cast("list[float]", entry["mm"])]))


def _file_obstacle(record: RunRecord, t: int, entry: Json) -> None:
    if str(entry.get("op")) in _NUMBERS:
        record.obstacles.append(_obstacle(t, entry))


def _file_pin(record: RunRecord, t: int, entry: Json) -> None:
    record.pins.setdefault(str(entry["net"]), Edges()).append(t, _integer(entry, "v"))


def _file_pins(record: RunRecord, t: int, entry: Json) -> None:
    (_file_levels if "nets" in entry else _file_block)(record, t, entry)


def _file_levels(record: RunRecord, t: int, entry: Json) -> None:
    """Begin the blocks of edges."""
    nets, levels = cast("list[object]", entry["nets"]), str(entry["levels"])
    if _integer(entry, "v") != BLOCKS_VERSION:
        raise TraceError("edges as a later version writes them", hint="install a newer p2os")
    record.nets = tuple(str(net) for net in nets)
    for net, level in zip(record.nets, levels, strict=True):
        record.pins[net] = Edges([(t, int(level))])


#: What follows a level of 0 and of 1.
_TOGGLED = (b"\1\0", b"\0\1")


def _file_block(record: RunRecord, t: int, entry: Json) -> None:
    """Put a block of edges where they belong."""
    found = unpack(a2b_base64(str(entry["d"])), len(record.nets), t)
    if sum(len(times) for _, times in found) != _integer(entry, "n"):
        raise ValueError("a block has not as many edges as it says")
    for place, times in found:
        edges, count = record.pins[record.nets[place]], len(times)
        edges.extend(times, (_TOGGLED[bool(edges.levels[-1])] * (count // 2 + 1))[:count])
        record.last_ns = max(record.last_ns, times[-1])


def _file_waves(record: RunRecord, _t: int, entry: Json) -> None:
    """Put a net's changes of waves where they belong."""
    hz, ns, found = _integer(entry, "hz"), _integer(entry, "ns"), record.waves.setdefault(str(entry["net"]), [])
    for row in cast("list[list[float]]", entry["rows"]):
        at, *shape = map(_whole, row)
        wave = None
        if shape:
            position, period, high = shape
            wave = Wave(ns, position, period, high, hz)
            if hz <= 0 or not 0 < high < period or at < ns:
                raise ValueError("no such wave")
        found.append((at, wave))
        record.last_ns = max(record.last_ns, at)


_KINDS: dict[object, Callable[[RunRecord, int, Json], None]] = {
    "pose": lambda record, t, entry: record.poses.append(_pose(t, entry)),
    "pins": _file_pins,
    "pin": _file_pin,
    "waves": _file_waves,
    "sonar": _file_sonar,
    "usart": lambda record, t, entry: record.usart.append((t, bytes.fromhex(str(entry["hex"])))),
    "wire": _file_wire,
    "event": _file_event,
    "obstacle": _file_obstacle,
}


def _meta(entry: Json) -> Json:
    """Return the first line, whose world's things have names and places."""
    things = cast("list[Json]", cast("Json", entry.get("world") or {}).get("obstacles") or [])
    _ = [(str(item["name"]), float(cast("float", item["x"])), float(cast("float", item["y"]))) for item in things]
    return entry


#: What a change of the world has to say in numbers.
_NUMBERS: dict[object, tuple[str, ...]] = {"place": ("x", "y"), "move": ("x", "y"), "remove": ()}


def _obstacle(t: int, entry: Json) -> Json:
    """Return a change of the world whose numbers are numbers."""
    sizes = ("length", "width") if entry.get("shape", "box") == "box" else ("radius",)
    needed = (*_NUMBERS[entry["op"]], *(sizes if entry["op"] == "place" else ()))
    numbers = {key: float(cast("float", entry[key])) for key in (*needed, *(["heading"] if "heading" in entry else []))}
    return {**entry, **numbers, "t": t, "name": str(entry["name"])}


def _integer(entry: Json, key: str) -> int:
    value = entry.get(key, 0)
    return _whole(value) if isinstance(value, (int, float)) else 0


def _whole(value: float) -> int:
    if abs(value) > _MOST:
        raise ValueError("a number beyond 64 bits")
    return int(value)


def _pose(t: int, entry: Json) -> PoseSample:
    return PoseSample(
        t=t,
        x=_integer(entry, "x"),
        y=_integer(entry, "y"),
        z=_integer(entry, "z"),
        heading=_integer(entry, "h"),
        pitch=_integer(entry, "p"),
        left=_integer(entry, "l"),
        right=_integer(entry, "r"),
        left_angle=_integer(entry, "la"),
        right_angle=_integer(entry, "ra"),
        collisions=_integer(entry, "c"),
    )
