"""The records of pcap and pcapng files: as many as were read together, by their places, none as an object.

Source: the pcap and pcapng descriptions of the IETF opsawg drafts.

Invariant: no more is held than what was read together and the record that it cuts.
"""

import struct
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass

from simbase.errors import FileError
from simbase.timing import NS_PER_S, Nanos

MAGIC_US, MAGIC_NS = 0xA1B2C3D4, 0xA1B23C4D
PCAPNG_MAGIC = 0x0A0D0D0A
FILE_HEADER = "IHHiIII"
RECORD_HEADER = "IIII"
_BYTE_ORDER_MAGIC = 0x1A2B3C4D
#: pcapng block types.
_INTERFACE, _SIMPLE, _ENHANCED = 1, 3, 6
#: What each of them has at the least.
_LEAST_SIZES = {_INTERFACE: 16, _SIMPLE: 16, _ENHANCED: 32}
#: pcapng option of an interface: the unit of its time stamps.
_IF_TSRESOL = 9
#: chosen: far more than any capture program's snap length; a longer record is a damaged one.
LARGEST_RECORD = 16 << 20
_CUT_IN_RECORD = "the capture file is cut off in the middle of a record"


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordLayout:
    """Where what stands in a record; numbers are of four bytes.

    Args:
        order: `<` or `>`.
        high_at: The time's upper half, seconds or as `radix` says.
        low_at: Its lower half.
        radix: How many of the lower half are one of the upper.
        ticks_per_s: The unit of the lower half; 0 where a record has no time.
        length_at: How many bytes of the packet were captured.
        data_at: The first of them.
        size_at: How long the record is with what follows the packet; None where nothing does.
    """

    order: str
    high_at: int
    low_at: int
    radix: int
    ticks_per_s: int
    length_at: int
    data_at: int
    size_at: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Records:
    """Captured packets of one link that were read together.

    Args:
        data: The bytes of all.
        starts: Where each record begins; all of it stands in `data`.
        layout: What stands where.
        link: The link type.
    """

    data: bytes
    starts: list[int]
    layout: RecordLayout
    link: int

    def packets(self, first: int, last: int) -> Iterator[tuple[Nanos, bytes]]:
        """Yield time, in nanoseconds since 1970, and bytes of some of them."""
        layout, data = self.layout, self.data
        numbers_of = struct.Struct(f"{layout.order}{layout.data_at // 4}I").unpack_from
        high, low, length = layout.high_at // 4, layout.low_at // 4, layout.length_at // 4
        for start in self.starts[first:last]:
            numbers, at_ns = numbers_of(data, start), 0
            if layout.ticks_per_s:
                at_ns = (numbers[high] * layout.radix + numbers[low]) * NS_PER_S // layout.ticks_per_s
            begin = start + layout.data_at
            end = begin + numbers[length]
            if layout.size_at is not None:
                end = min(end, start + numbers[layout.size_at // 4] - 4)
            yield at_ns, data[begin:end]


def read_records(blocks: Iterable[bytes]) -> Iterator[Records]:
    """Yield what a pcap or pcapng file holds.

    Raises:
        FileError: The file is cut or of a kind that is not read here.
    """
    reader: _Pcap | _PcapNg | None = None
    rest, place = b"", 0
    for block in blocks:
        data = rest + block
        if reader is None:
            if len(data) < 24:
                rest = data
                continue
            reader = _PcapNg() if data[:4] == PCAPNG_MAGIC.to_bytes(4, "big") else _Pcap(data)
        used = yield from reader.take(data, place)
        place += used
        rest = data[used:]
    if reader is None:
        raise FileError("the capture file ends in its header")
    if rest:
        raise FileError(reader.cut_off(rest, place))


class _Pcap:
    def __init__(self, data: bytes) -> None:
        order = "<" if int.from_bytes(data[:4], "little") in {MAGIC_US, MAGIC_NS} else ">"
        magic, _, _, _, _, _, link = struct.unpack_from(order + FILE_HEADER, data)
        unit = NS_PER_S if magic == MAGIC_NS else 1_000_000
        self._layout = RecordLayout(
            order=order, high_at=0, low_at=4, radix=unit, ticks_per_s=unit, length_at=8, data_at=16
        )  # fmt: skip
        self._link, self._is_first = link & 0xFFFF, True
        self._size = struct.Struct(order + "8xI").unpack_from

    def take(self, data: bytes, before: int) -> Generator[Records, None, int]:
        """Yield the records that are whole; return how many bytes they take."""
        starts: list[int] = []
        place, end, size_of, add = (24 if self._is_first else 0), len(data), self._size, starts.append
        self._is_first = False
        while place + 16 <= end:
            following = place + 16 + size_of(data, place)[0]
            if following > end:
                if following - place - 16 > LARGEST_RECORD:
                    raise FileError(f"the capture file is cut off at byte {before + place + 16}")
                break
            add(place)
            place = following
        if starts:
            yield Records(data=data, starts=starts, layout=self._layout, link=self._link)
        return place

    @staticmethod
    def cut_off(rest: bytes, place: int) -> str:
        """Return what is wrong with a record of which no more came."""
        return _CUT_IN_RECORD if len(rest) < 16 else f"the capture file is cut off at byte {place + 16}"


class _PcapNg:
    def __init__(self) -> None:
        self._order = "<"
        #: Link type, and ticks a second.
        self._interfaces: list[tuple[int, int]] = []

    def take(self, data: bytes, before: int) -> Generator[Records, None, int]:
        """Yield the records that are whole; return how many bytes they take."""
        starts: list[int] = []
        place, end, number = 0, len(data), -1
        head: Callable[[bytes, int], tuple[int, ...]] = struct.Struct(self._order + "III").unpack_from
        while place + 12 <= end:
            if data[place : place + 4] == PCAPNG_MAGIC.to_bytes(4, "big"):
                yield from self._enhanced(data, starts, number)
                starts = []
                head = self._section(data[place + 8 : place + 12])
            kind, size, third = head(data, place)
            if size < 12 or size > LARGEST_RECORD:
                raise FileError(f"the capture file is cut off at byte {before + place}")
            if place + size > end:
                break
            if size < _LEAST_SIZES.get(kind, 0):
                raise FileError(_CUT_IN_RECORD)
            if kind == _ENHANCED:
                if third != number:
                    yield from self._enhanced(data, starts, number)
                    starts, number = [], third
                starts.append(place)
            elif kind in {_INTERFACE, _SIMPLE}:
                yield from self._enhanced(data, starts, number)
                starts = []
                if kind == _INTERFACE:
                    self._interface(data[place + 8 : place + size - 4])
                else:
                    yield self._records(data, [place], 0, is_simple=True)
            place += size
        yield from self._enhanced(data, starts, number)
        return place

    def _section(self, mark: bytes) -> Callable[[bytes, int], tuple[int, ...]]:
        """Begin a section; return what reads the first numbers of its blocks."""
        self._order = "<" if mark == _BYTE_ORDER_MAGIC.to_bytes(4, "little") else ">"
        self._interfaces.clear()
        return struct.Struct(self._order + "III").unpack_from

    def _interface(self, body: bytes) -> None:
        link = struct.unpack_from(self._order + "H", body)[0]
        self._interfaces.append((link, _ticks_per_s(body, self._order)))

    def _enhanced(self, data: bytes, starts: list[int], interface: int) -> Iterator[Records]:
        if starts:
            yield self._records(data, starts, interface)

    def _records(self, data: bytes, starts: list[int], number: int, *, is_simple: bool = False) -> Records:
        if number >= len(self._interfaces):
            raise FileError(f"the capture file names interface {number}, which it never declared")
        link, ticks = self._interfaces[number]
        layout = RecordLayout(
            order=self._order, high_at=12, low_at=16, radix=1 << 32, ticks_per_s=0 if is_simple else ticks,
            length_at=8 if is_simple else 20, data_at=12 if is_simple else 28, size_at=4,
        )  # fmt: skip
        return Records(data=data, starts=starts, layout=layout, link=link)

    @staticmethod
    def cut_off(rest: bytes, place: int) -> str:
        """Return what is wrong with a block of which no more came."""
        return _CUT_IN_RECORD if len(rest) < 8 else f"the capture file is cut off at byte {place}"


def _ticks_per_s(body: bytes, order: str) -> int:
    """Return the resolution of an interface's time stamps; microseconds unless an option says otherwise."""
    place = 8
    while place + 4 < len(body):
        code, size = struct.unpack_from(order + "HH", body, place)
        if code == _IF_TSRESOL and size == 1:
            value = body[place + 4]
            return int((2 if value & 0x80 else 10) ** (value & 0x7F))
        if code == 0:
            break
        place += 4 + (size + 3) // 4 * 4
    return 1_000_000
