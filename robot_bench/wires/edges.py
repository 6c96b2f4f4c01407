"""Edges of wires in bulk: as arrays, in the trace's blocks, and as the chip gives them.

What is long goes through functions in C (edges.c), which are built with the package.

A block holds the edges of several wires in order of time, those of one instant in the order of the
wires. Each is one number, (ns since the edge before, 0 for the first) times the number of wires plus
the wire's place, seven bits a byte, the lowest first, the eighth set where more follow. The level is
not there: each edge of a wire toggles it.
"""

import ctypes
from array import array
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import pairwise
from typing import Any, overload

from bluepill_sim.fabric.subscriptions import EDGE
from simbase.c_library import built, loaded
from simbase.timing import Nanos

#: Of a row of the chip: a pin that is on no wire.
NO_WIRE = 255
#: Bytes of a piece of what is written to a file.
_PIECE = 1 << 20
#: More bytes than a number of a block has.
_LONGEST = 9
#: Result and arguments, as `simbase.c_library` spells them.
#: The library, as a module.
PART = "robot_bench._edges"
_FUNCTIONS = {
    "edges_split": "vpzppzppp",
    "edges_changes": "zppzc",
    "edges_pack": "zzpppzppp",
    "edges_unpack": "ipzzlpp",
    "edges_codes": "zzpppppp",
    "edges_vcd": "zzpppppppz",
    "edges_samples": "vzppppplzlzp",
}


class Edges(Sequence[tuple[Nanos, int]]):
    """Levels of one wire, (ns, level), oldest first."""

    __slots__ = ("levels", "times")

    def __init__(self, edges: Iterable[tuple[Nanos, int]] = ()) -> None:
        self.times = array("q")
        self.levels = bytearray()
        for at, level in edges:
            self.append(at, level)

    def append(self, at: Nanos, level: int) -> None:
        """Add one.

        Raises:
            ValueError: `level` is no byte.
            OverflowError: `at` has more than 64 bits.
        """
        self.levels.append(level)
        try:
            self.times.append(at)
        except OverflowError:
            self.levels.pop()
            raise

    def extend(self, times: "array[int]", levels: bytes | bytearray) -> None:
        """Add as many times as levels."""
        self.times += times
        self.levels += levels

    def __len__(self) -> int:
        return len(self.levels)

    @overload
    def __getitem__(self, place: int) -> tuple[Nanos, int]: ...
    @overload
    def __getitem__(self, place: slice) -> "Edges": ...
    def __getitem__(self, place: int | slice) -> "tuple[Nanos, int] | Edges":
        if isinstance(place, int):
            return self.times[place], self.levels[place]
        part = Edges()
        part.extend(self.times[place], self.levels[place])
        return part

    def __iter__(self) -> Iterator[tuple[Nanos, int]]:
        return zip(self.times, self.levels, strict=True)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, Edges):
            return self.times == other.times and self.levels == other.levels
        return list(self) == other if isinstance(other, list) else NotImplemented

    __hash__ = None  # type: ignore[assignment]  # it can be changed

    def __repr__(self) -> str:
        return f"Edges({list(self)!r})"


#: A wire's place, its times, and a byte for each.
Track = tuple[int, "array[int]", bytes]


def split(rows: bytes, wire_of_pin: bytes, code_of_drive: bytes, wires: int) -> list[Track]:
    """Sort rows of the chip by wire.

    Args:
        rows: As a sink gets them: rows of `EDGE`.
        wire_of_pin: The place of each pin's wire, `NO_WIRE` for none; 256 bytes.
        code_of_drive: What each drive of the chip becomes; 256 bytes.
        wires: How many there are, below `NO_WIRE`.
    """
    count = len(rows) // EDGE.size
    times, codes = array("q", bytes(8 * count)), bytearray(count)
    starts = (ctypes.c_size_t * (wires + 1))()
    _library().edges_split(rows, count, wire_of_pin, code_of_drive, wires, _at(times), _in(codes), starts)
    return [
        (wire, times[first:last], bytes(codes[first:last]))
        for wire, (first, last) in enumerate(pairwise(starts))
        if first < last
    ]


def changes(levels: Edges, before: int) -> Edges:
    """Return, in place, the last level of each instant where it differs from the one before, at first `before`."""
    kept = _library().edges_changes(_at(levels.times), _in(levels.levels), len(levels), before)
    del levels.times[kept:], levels.levels[kept:]
    return levels


def pack(tracks: Sequence[Edges], most: int) -> Iterator[tuple[Nanos, int, bytes]]:
    """Yield blocks of the edges of several wires: (ns of the first edge, how many, the block).

    Args:
        tracks: The changes of each wire.
        most: How many edges a block holds at most.
    """
    wires, left = len(tracks), sum(map(len, tracks))
    times = (ctypes.c_void_p * wires)(*(_at(track.times) for track in tracks))
    counts = (ctypes.c_size_t * wires)(*map(len, tracks))
    places = (ctypes.c_size_t * wires)()
    room = ctypes.create_string_buffer((_LONGEST + 1) * min(most, left))
    edges, first = ctypes.c_size_t(), ctypes.c_int64()
    while left:
        size = _library().edges_pack(
            wires, times, counts, places, most, room, ctypes.byref(edges), ctypes.byref(first)
        )  # fmt: skip
        left -= edges.value
        yield first.value, edges.value, ctypes.string_at(room, size)


def unpack(block: bytes, wires: int, first: Nanos) -> "list[tuple[int, array[int]]]":
    """Return (a wire's place, the times of its edges) for each wire of a block.

    Raises:
        ValueError: The block is damaged.
    """
    if not 0 < wires < NO_WIRE or first < 0:
        raise ValueError("no such block of edges")
    times, starts = array("q", bytes(8 * len(block))), (ctypes.c_size_t * (wires + 1))()
    if not _library().edges_unpack(block, len(block), wires, first, _at(times), starts):
        raise ValueError("a damaged block of edges")
    return [(wire, times[begin:end]) for wire, (begin, end) in enumerate(pairwise(starts)) if begin < end]


def codes(tracks: Sequence[Edges]) -> Edges:
    """Take wires as the bits of a code, the first as bit 0; edges at one instant are one change.

    Args:
        tracks: At most eight wires.
    """
    merged, count = _Merged(tracks), sum(map(len, tracks))
    found = Edges()
    found.extend(array("q", bytes(8 * count)), bytes(count))
    kept = _library().edges_codes(*merged.arguments, _at(found.times), _in(found.levels))
    del found.times[kept:], found.levels[kept:]
    return found


def dumped(tracks: Sequence[Edges], identifiers: Sequence[str]) -> Iterator[str]:
    """Yield the changes as a value change dump has them, in pieces of whole lines, from before time 0 on."""
    merged, now = _Merged(tracks), ctypes.c_int64(-1)
    names = (ctypes.c_char_p * len(tracks))(*(name.encode() for name in identifiers))
    room = ctypes.create_string_buffer(_PIECE)
    while size := _library().edges_vcd(*merged.arguments, names, ctypes.byref(now), room, _PIECE):
        yield ctypes.string_at(room, size).decode("ascii")


def sampled(tracks: Sequence[Edges], rate_hz: int, count: int) -> Iterator[bytes]:
    """Yield so many samples of all wires from time 0 on, the first wire as bit 0 of whole bytes, in pieces.

    Args:
        tracks: At most 64 wires.
        rate_hz: Samples a second, a divisor of 10**9.
        count: How many samples there are.
    """
    unit = max(1, (len(tracks) + 7) // 8)
    merged, bits = _Merged(tracks), ctypes.c_uint64()
    for first in range(0, count, _PIECE // unit):
        part = min(_PIECE // unit, count - first)
        room = ctypes.create_string_buffer(part * unit)
        _library().edges_samples(*merged.arguments, ctypes.byref(bits), first, part, rate_hz, unit, room)
        yield room.raw


class _Merged:
    """Several wires' edges as C takes them, with the place of the next one of each."""

    def __init__(self, tracks: Sequence[Edges]) -> None:
        wires = len(tracks)
        self._kept = [_in(track.levels) for track in tracks]
        levels = [ctypes.addressof(kept) for kept in self._kept]
        self.arguments = (
            wires,
            (ctypes.c_void_p * wires)(*(_at(track.times) for track in tracks)),
            (ctypes.c_void_p * wires)(*levels),
            (ctypes.c_size_t * wires)(*map(len, tracks)),
            (ctypes.c_size_t * wires)(),
        )


@cache
def _library() -> Any:
    """Return the functions in C.

    Raises:
        MissingDependencyError: They were not built.
    """
    return loaded(built(PART), _FUNCTIONS, "the library for edges of wires", PART)


def _at(times: "array[int]") -> int:
    return times.buffer_info()[0]


def _in(data: bytearray) -> Any:
    """Return where a byte array's bytes are; they stay there as long as this is held."""
    return (ctypes.c_char * len(data)).from_buffer(data)
