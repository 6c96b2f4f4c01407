"""A declared layout read out of many packets at once: the same constructs that read one packet, column by column.

Runs of fixed fields are gathered as one block of bytes a packet; counted arrays
become a table of their own with the row they belong to; NUL-terminated texts
become places in the data. A packet that ends inside the layout is marked as not
sound, as `p2os.protocol.packets.layout.parse` refuses it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from construct import Array, Construct, FormatField, NullTerminated, Renamed, Struct

from p2os.capture.columns.framing import Indexes
from p2os.capture.columns.gathering import gather, gather_items, indexes_of, offsets_of

Column: TypeAlias = npt.NDArray[Any]

#: construct's letters → NumPy's.
_TYPES: Mapping[str, str] = {"B": "u1", "b": "i1", "H": "<u2", "h": "<i2", "L": "<u4", "l": "<i4"}


@dataclass(slots=True)
class Spans:
    """A text or some bytes of each packet, as places in the data."""

    starts: Indexes
    ends: Indexes


@dataclass(slots=True)
class Ragged:
    """The items of a counted array of all packets together.

    Args:
        offsets: Where the items of each row of the table begin, and one past the last.
        columns: The item's numbers; an array of plain numbers has one column, `value`.
        texts: The item's texts and bytes.
    """

    offsets: Indexes
    columns: dict[str, Column]
    texts: dict[str, Spans] = field(default_factory=dict)

    @property
    def rows(self) -> Indexes:
        """Which row of the table each item belongs to."""
        return np.repeat(np.arange(len(self.offsets) - 1), np.diff(self.offsets))


@dataclass(slots=True)
class PacketWalk:
    """What was read so far of the packets of one kind, and which of them are sound."""

    data: npt.NDArray[np.uint8]
    #: Where each packet's next byte stands, and one past its last.
    places: Indexes
    ends: Indexes
    columns: dict[str, Column] = field(default_factory=dict)
    texts: dict[str, Spans] = field(default_factory=dict)
    ragged: dict[str, Ragged] = field(default_factory=dict)
    sound: npt.NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    _nuls: Indexes | None = None

    def __post_init__(self) -> None:
        self.sound = np.ones(len(self.places), np.bool_)

    def read(self, layout: Construct) -> None:
        """Read a layout, from where the last one ended."""
        for names, dtype, sub in _runs(layout):
            if dtype is not None:
                self._take_run(names, dtype)
            elif isinstance(sub, NullTerminated):
                self.texts[names[0]] = self.take_text()
            elif isinstance(sub, Array):
                self._take_array(names[0], sub)
            else:
                size = int(sub.sizeof())
                self.texts[names[0]] = Spans(self.places.copy(), self.places + size)
                self.advance(size)

    def advance(self, sizes: int | Indexes) -> None:
        """Go on by some bytes; packets that do not have them are not sound and stay where they are."""
        after = self.places + sizes
        self.sound &= after <= self.ends
        self.places = after if self.sound.all() else np.where(self.sound, after, self.places)

    def take_number(self, name: str, kind: Construct) -> None:
        """Read one number."""
        self._take_run([name], np.dtype([(name, _TYPES[kind.fmtstr[1:]])]))

    def _take_run(self, names: Sequence[str], dtype: np.dtype[np.void]) -> None:
        starts = self.places
        self.advance(dtype.itemsize)
        rows = gather(self.data, starts, dtype, self.sound)
        for name in names:
            self.columns[name] = rows[name]

    def take_text(self) -> Spans:
        """Read up to a NUL, which is not part of the text."""
        if self._nuls is None:
            inside = indexes_of(self.places, np.maximum(self.ends - self.places, 0))
            self._nuls = inside[self.data[inside] == 0]
        found = np.searchsorted(self._nuls, self.places)
        limit = len(self.data)
        nul = self._nuls[np.minimum(found, len(self._nuls) - 1)] if len(self._nuls) else np.full(len(found), limit)
        nul = np.where(found < len(self._nuls), nul, limit)
        spans = Spans(self.places.copy(), nul)
        self.advance(nul + 1 - self.places)
        spans.ends = np.where(self.sound, spans.ends, spans.starts)
        return spans

    def _take_array(self, name: str, array: Array) -> None:
        count = array.count(self.columns) if callable(array.count) else array.count
        counts = np.broadcast_to(np.asarray(count, np.int64), len(self.places))
        item = _bare(array.subcon)
        if isinstance(item, Array):
            # Rows of as many numbers as a field before says: one item a number, in their order.
            width = item.count(self.columns) if callable(item.count) else item.count
            counts, item = counts * np.asarray(width, np.int64), _bare(item.subcon)
        names, dtype = _fields(item)
        starts = self.places
        self.advance(counts * dtype.itemsize)
        counts = np.where(self.sound, counts, 0)
        items, offsets = gather_items(self.data, starts, counts, dtype)
        self.ragged[name] = Ragged(offsets, {key: items[key] for key in names})

    def take_items(self, item: Construct, counts: Column) -> Ragged:
        """Read so many items of any length of each packet, one item of every packet at a time."""
        rows: list[Indexes] = []
        walks: list[PacketWalk] = []
        active, taken = np.flatnonzero(self.sound & (counts > 0)), 0
        while len(active):
            walk = PacketWalk(self.data, self.places[active], self.ends[active])
            walk.read(item)
            self.places[active], self.sound[active] = walk.places, walk.sound
            rows.append(active)
            walks.append(walk)
            taken += 1
            active = active[walk.sound & (counts[active] > taken)]
        if not rows:
            return Ragged(np.zeros(len(self.places) + 1, np.int64), {})
        order = np.argsort(np.concatenate(rows), kind="stable")
        columns = {name: np.concatenate([walk.columns[name] for walk in walks])[order] for name in walks[0].columns}
        texts = {}
        for name in walks[0].texts:
            starts = np.concatenate([walk.texts[name].starts for walk in walks])[order]
            texts[name] = Spans(starts, np.concatenate([walk.texts[name].ends for walk in walks])[order])
        taken_of = np.bincount(np.concatenate(rows), minlength=len(self.places))
        return Ragged(offsets_of(taken_of), columns, texts)


def _bare(construct: Construct) -> Construct:
    while isinstance(construct, Renamed):
        construct = construct.subcon
    return construct


def _fields(item: Construct) -> tuple[list[str], np.dtype[np.void]]:
    """Return the names and the record of an array's item of fixed size."""
    if isinstance(item, Struct):
        names = [str(sub.name) for sub in item.subcons]
        return names, np.dtype([(str(sub.name), _TYPES[_bare(sub).fmtstr[1:]]) for sub in item.subcons])
    return ["value"], np.dtype([("value", _TYPES[item.fmtstr[1:]])])


def _runs(layout: Struct) -> list[tuple[list[str], np.dtype[np.void] | None, Construct]]:
    """Return a layout's fields, neighbouring numbers together as one record."""
    found: list[tuple[list[str], np.dtype[np.void] | None, Construct]] = []
    run: list[tuple[str, str]] = []
    for sub in layout.subcons:
        bare = _bare(sub)
        if isinstance(bare, FormatField):
            run.append((str(sub.name), _TYPES[bare.fmtstr[1:]]))
            continue
        if run:
            found.append(([name for name, _ in run], np.dtype(run), bare))
            run = []
        found.append(([str(sub.name)], None, bare))
    if run:
        found.append(([name for name, _ in run], np.dtype(run), layout))
    return found
