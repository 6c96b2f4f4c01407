"""Records of capture files many at a time: what `Conversations.parts` says of them, without a loop.

Theory of operation. Records of ours all have one form. Of TCP, a segment is plain that stands in an IPv4 packet without
options, was captured whole and is no SYN; a run of such is read at once as far as each goes on where the one before it
in its direction ended. All else is left to `parts`: what is not plain, a conversation's first segment, and, from a
segment on that is repeated or out of order, so many as may wait for one another.

Invariant: the chunks and the state of the conversations are those that `parts` leaves.
"""

from array import array
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from p2os.capture.chunks import LETTERS, ChunkBlock, Direction, blocks_of
from p2os.capture.columns.gathering import gather, joined
from p2os.capture.formats.conversations import IN_DIRECTION, LEAST_RECORDS, LINKTYPE_USER0, LONGEST_NS, Conversations
from p2os.capture.formats.pcap_records import Records
from p2os.capture.formats.tcp_streams import IPV4, IPV6, LINKS, MOST_WAITING, SYN, TCP, End, Half
from simbase.timing import NS_PER_S

_Bytes: TypeAlias = npt.NDArray[np.uint8]
_Numbers: TypeAlias = npt.NDArray[np.int64]
#: Bytes of the headers of IPv4 and TCP that are looked at.
_HEADERS = 40
#: Where in them the two addresses and ports stand.
_ENDS = slice(12, 24)
#: chosen: of more conversations in one run each packet is taken by itself.
_MOST_ENDS = 8
_CODES = np.frombuffer(b"".join(LETTERS[direction] for direction in IN_DIRECTION.values()), np.uint8)


def in_bulk(records: Records, said: Conversations) -> Iterator[ChunkBlock]:
    """Yield what records hold; `said` knows what came before, and learns of them."""
    bulk = _times(records, said)
    if bulk is None:
        yield from blocks_of(said.parts(records))
    elif records.link == LINKTYPE_USER0:
        yield from _ours(records, said, *bulk)
    elif records.link in LINKS:
        yield from _Segments(records, said, *bulk).blocks()
    else:
        yield from blocks_of(said.parts(records))


def _times(records: Records, said: Conversations) -> tuple[_Numbers, _Numbers, _Numbers] | None:
    """Return when packets were captured, where each begins and ends; None where `parts` must look."""
    layout = records.layout
    if not layout.ticks_per_s or NS_PER_S % layout.ticks_per_s:
        return None
    starts = np.array(records.starts, np.int64)
    data = np.frombuffer(records.data, np.uint8)

    def number(at: int) -> _Numbers:
        numbers: _Numbers = gather(data, starts + at, np.dtype([("number", layout.order + "u4")]), None)["number"]
        return numbers.astype(np.int64)

    high, unit_ns = number(layout.high_at), NS_PER_S // layout.ticks_per_s
    if (int(high.max()) + 1) * layout.radix * unit_ns >= 1 << 62:
        return None
    captured_ns = (high * layout.radix + number(layout.low_at)) * unit_ns
    lengths = number(layout.length_at)
    if layout.size_at is not None and (lengths + (layout.data_at + 4) > number(layout.size_at)).any():
        return None
    if said.start_ns is None:
        said.start_ns = int(captured_ns[0])
    at_ns = np.maximum(captured_ns - said.start_ns, 0)
    if at_ns.max() > LONGEST_NS:
        return None
    return at_ns, starts + layout.data_at, starts + (layout.data_at + lengths)


def _block(data: bytes, at_ns: _Numbers, senders: _Bytes, begins: _Numbers, ends: _Numbers) -> Iterator[ChunkBlock]:
    """Yield what stands between some places, if any does."""
    sizes = ends - begins
    if not sizes.all():
        has = sizes > 0
        at_ns, senders, begins, ends, sizes = at_ns[has], senders[has], begins[has], ends[has], sizes[has]
    if len(sizes):
        yield ChunkBlock(
            at_ns=array("q", at_ns.tobytes()), senders=senders.tobytes(), ends=array("q", np.cumsum(sizes).tobytes()),
            data=joined(data, begins, sizes), is_in_order=bool((at_ns[1:] >= at_ns[:-1]).all()),
        )  # fmt: skip


def _ours(
    records: Records, said: Conversations, at_ns: _Numbers, begins: _Numbers, ends: _Numbers
) -> Iterator[ChunkBlock]:
    codes = np.frombuffer(records.data + b"\xff", np.uint8)[begins]
    if (codes > 1).any() or (begins == ends).any():
        yield from blocks_of(said.parts(records))
        return
    said.is_empty = False
    yield from _block(records.data, at_ns, _CODES[codes], begins + 1, ends)


class _Segments:
    """Packets of a link that carries TCP.

    Args:
        records: They.
        said: What came before.
        at_ns: When each was captured.
        begins: Where each begins.
        ends: Where each ends.
    """

    def __init__(
        self, records: Records, said: Conversations, at_ns: _Numbers, begins: _Numbers, ends: _Numbers
    ) -> None:
        self._records, self._said, self._at_ns = records, said, at_ns
        skip, type_at = LINKS[records.link]
        data = np.frombuffer(records.data + bytes(skip + _HEADERS), np.uint8)
        looked_at = gather(data, begins, np.dtype([("bytes", "u1", (skip + _HEADERS,))]), None)["bytes"]
        ip = looked_at[:, skip:]
        held = ends - begins - skip
        is_ip = np.ones(len(begins), np.bool_)
        is_known = is_ip
        if type_at is not None:
            kinds = looked_at[:, type_at].astype(np.int64) << 8 | looked_at[:, type_at + 1]
            is_ip, is_known = kinds == IPV4, (kinds == IPV4) | (kinds == IPV6)
        whole = ip[:, 2].astype(np.int64) << 8 | ip[:, 3]
        header = (ip[:, 32] >> 4).astype(np.int64) * 4
        self._plain = (
            is_ip & (held >= _HEADERS) & (ip[:, 0] == 0x45) & (ip[:, 9] == TCP) & (ip[:, 33] & SYN == 0)
            & (header >= 20) & (whole >= 20 + header) & (whole <= held)
        )  # fmt: skip
        #: What holds no TCP.
        self._empty = ~is_known & (held >= 0) | is_ip & (held >= _HEADERS) & (ip[:, 0] >> 4 == 4) & (ip[:, 9] != TCP)
        self._ends_of = np.ascontiguousarray(ip[:, _ENDS])
        self._sequences = np.ascontiguousarray(ip[:, 24:28]).view(">u4")[:, 0].astype(np.int64)
        self._halves: list[tuple[_Numbers, Direction, Half]] = []
        self._begins = begins + skip + 20 + header
        self._sizes = whole - 20 - header

    def blocks(self) -> Iterator[ChunkBlock]:
        """Yield what they hold."""
        place = 0
        odd = np.flatnonzero(~self._plain & ~self._empty).tolist()
        for last in [*odd, len(self._plain)]:
            while last - place >= LEAST_RECORDS:
                taken = self._in_order(place, last)
                yield from self._run(place, taken)
                place = min(taken + MOST_WAITING, last)
                yield from self._one_by_one(taken, place)
            yield from self._one_by_one(place, last + 1)
            place = last + 1

    def _one_by_one(self, first: int, last: int) -> Iterator[ChunkBlock]:
        if first < last:
            yield from blocks_of(self._said.parts(self._records, first, last))

    def _in_order(self, first: int, last: int) -> int:
        """Return up to where the packets of a run go on from those before, by direction; note how far they go."""
        place = last
        self._halves = []
        rest = np.flatnonzero(self._plain[first:last]) + first
        while len(rest):
            raw = self._ends_of[rest[0]].tobytes()
            same = (self._ends_of[rest] == self._ends_of[rest[0]]).all(axis=1)
            mine, rest = rest[same], rest[~same]
            source: End = raw[:4], int.from_bytes(raw[8:10], "big")
            target: End = raw[4:8], int.from_bytes(raw[10:12], "big")
            half = self._said.streams.half(source, target)
            if half is None or half.next_sequence is None or half.waiting or len(self._halves) == _MOST_ENDS:
                place = min(place, int(mine[0]))
                continue
            sizes = self._sizes[mine]
            wanted = half.next_sequence + np.cumsum(sizes) - sizes & 0xFFFFFFFF
            wrong = np.flatnonzero(wanted != self._sequences[mine])
            if len(wrong):
                place = min(place, int(mine[wrong[0]]))
            self._halves.append((mine, self._said.streams.direction(source, target), half))
        return place

    def _run(self, first: int, last: int) -> Iterator[ChunkBlock]:
        """Yield what packets in order hold."""
        senders = np.zeros(last - first, np.uint8)
        for mine, direction, half in self._halves:
            taken = mine[: np.searchsorted(mine, last)]
            senders[taken - first] = _CODES[int(direction is Direction.FROM_ROBOT)]
            if half.next_sequence is not None:
                half.next_sequence = half.next_sequence + int(self._sizes[taken].sum()) & 0xFFFFFFFF
        run = np.flatnonzero(senders) + first
        begins = self._begins[run]
        if self._sizes[run].any():
            self._said.is_empty = False
        yield from _block(
            self._records.data, self._at_ns[run], senders[run - first], begins, begins + self._sizes[run]
        )  # fmt: skip
