"""Edges of wires in bulk: as arrays, in the trace's blocks, and as the chip gives them.

What is long goes through five functions that are there twice: in C (edges.c), and in Python for
where no compiler was. `p2os doctor` says which are used.

A block holds the edges of several wires in order of time, those of one instant in the order of the
wires. Each is one number, (ns since the edge before, 0 for the first) times the number of wires plus
the wire's place, seven bits a byte, the lowest first, the eighth set where more follow. The level is
not there: each edge of a wire toggles it.

Invariant: both versions give the same results.
"""

import ctypes
from array import array
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from importlib.util import find_spec
from itertools import pairwise
from typing import Any, overload

from bluepill_sim.fabric.subscriptions import EDGE
from simbase.timing import Nanos

#: Of a row of the chip: a pin that is on no wire.
NO_WIRE = 255
#: More bytes than a number of a block has.
_LONGEST = 9
_LAST_NS = 2**63 - 1
#: Result and arguments: v nothing, i 32 bits, l 64 bits, z size, p pointer, c one byte.
_FUNCTIONS = {
    "edges_split": "vpzppzppp",
    "edges_changes": "zppzc",
    "edges_pack": "zzpppzppp",
    "edges_unpack": "ipzzlpp",
}
_TYPES: dict[str, Any] = {
    "v": None, "i": ctypes.c_int, "l": ctypes.c_int64, "z": ctypes.c_size_t, "p": ctypes.c_void_p, "c": ctypes.c_uint8,
}  # fmt: skip


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
    native = _library()
    if native is None:
        return split_in_python(rows, wire_of_pin, code_of_drive)
    count = len(rows) // EDGE.size
    times, codes = array("q", bytes(8 * count)), bytearray(count)
    starts = (ctypes.c_size_t * (wires + 1))()
    native.edges_split(rows, count, wire_of_pin, code_of_drive, wires, _at(times), _in(codes), starts)
    return [
        (wire, times[first:last], bytes(codes[first:last]))
        for wire, (first, last) in enumerate(pairwise(starts))
        if first < last
    ]


def split_in_python(rows: bytes, wire_of_pin: bytes, code_of_drive: bytes) -> list[Track]:
    """Do as `split`."""
    found: dict[int, tuple[array[int], bytearray]] = {}
    for at, pin, drive, _wire, _fill, _zero in EDGE.iter_unpack(rows):
        wire = wire_of_pin[pin]
        if wire != NO_WIRE:
            times, codes = found.setdefault(wire, (array("q"), bytearray()))
            times.append(at)
            codes.append(code_of_drive[drive])
    return [(wire, times, bytes(codes)) for wire, (times, codes) in sorted(found.items())]


def changes(levels: Edges, before: int) -> Edges:
    """Return, in place, the last level of each instant where it differs from the one before, at first `before`."""
    native = _library()
    if native is None:
        return changes_in_python(levels, before)
    kept = native.edges_changes(_at(levels.times), _in(levels.levels), len(levels), before)
    del levels.times[kept:], levels.levels[kept:]
    return levels


def changes_in_python(levels: Edges, before: int) -> Edges:
    """Do as `changes`."""
    found = Edges()
    last = len(levels) - 1
    for place, (at, level) in enumerate(levels):
        if level != before and (place == last or levels.times[place + 1] != at):
            found.append(at, level)
            before = level
    levels.times, levels.levels = found.times, found.levels
    return levels


def pack(tracks: Sequence[Edges], most: int) -> Iterator[tuple[Nanos, int, bytes]]:
    """Yield blocks of the edges of several wires: (ns of the first edge, how many, the block).

    Args:
        tracks: The changes of each wire.
        most: How many edges a block holds at most.
    """
    native = _library()
    if native is None:
        yield from pack_in_python(tracks, most)
        return
    wires, left = len(tracks), sum(map(len, tracks))
    times = (ctypes.c_void_p * wires)(*(_at(track.times) for track in tracks))
    counts = (ctypes.c_size_t * wires)(*map(len, tracks))
    places = (ctypes.c_size_t * wires)()
    room = ctypes.create_string_buffer((_LONGEST + 1) * min(most, left))
    edges, first = ctypes.c_size_t(), ctypes.c_int64()
    while left:
        size = native.edges_pack(
            wires, times, counts, places, most, room, ctypes.byref(edges), ctypes.byref(first)
        )  # fmt: skip
        left -= edges.value
        yield first.value, edges.value, ctypes.string_at(room, size)


def pack_in_python(tracks: Sequence[Edges], most: int) -> Iterator[tuple[Nanos, int, bytes]]:
    """Do as `pack`."""
    merged = sorted((at, wire) for wire, track in enumerate(tracks) for at in track.times)
    for begin in range(0, len(merged), most):
        part = merged[begin : begin + most]
        first = last = part[0][0]
        block = bytearray()
        for at, wire in part:
            value = (at - last) * len(tracks) + wire
            last = at
            while value > 127:
                block.append(value & 127 | 128)
                value >>= 7
            block.append(value)
        yield first, len(part), bytes(block)


def unpack(block: bytes, wires: int, first: Nanos) -> "list[tuple[int, array[int]]]":
    """Return (a wire's place, the times of its edges) for each wire of a block.

    Raises:
        ValueError: The block is damaged.
    """
    if not 0 < wires < NO_WIRE or first < 0:
        raise ValueError("no such block of edges")
    native = _library()
    if native is None:
        return unpack_in_python(block, wires, first)
    times, starts = array("q", bytes(8 * len(block))), (ctypes.c_size_t * (wires + 1))()
    if not native.edges_unpack(block, len(block), wires, first, _at(times), starts):
        raise ValueError("a damaged block of edges")
    return [(wire, times[begin:end]) for wire, (begin, end) in enumerate(pairwise(starts)) if begin < end]


def unpack_in_python(block: bytes, wires: int, first: Nanos) -> "list[tuple[int, array[int]]]":
    """Do as `unpack`."""
    found: dict[int, array[int]] = {}
    value = length = 0
    for byte in block:
        value |= (byte & 127) << 7 * length
        length += 1
        if byte < 128:
            first += value // wires
            if first > _LAST_NS:
                break
            found.setdefault(value % wires, array("q")).append(first)
            value = length = 0
        elif length == _LONGEST:
            break
    if length or first > _LAST_NS:
        raise ValueError("a damaged block of edges")
    return sorted(found.items())


@cache
def _library() -> Any:
    """Return the functions in C, or None where they were not built."""
    spec = find_spec("robot_bench._edges")
    if spec is None or spec.origin is None:
        return None
    library = ctypes.CDLL(spec.origin)
    for name, kinds in _FUNCTIONS.items():
        function = getattr(library, name)
        function.restype = _TYPES[kinds[0]]
        function.argtypes = [_TYPES[kind] for kind in kinds[1:]]
    return library


def _at(times: "array[int]") -> int:
    return times.buffer_info()[0]


def _in(data: bytearray) -> Any:
    """Return where a byte array's bytes are; they stay there as long as this is held."""
    return (ctypes.c_char * len(data)).from_buffer(data)
