"""What is said in captured packets: records of ours, and TCP of any conversation, one packet after the other."""

from collections.abc import Iterator

from p2os.capture.chunks import Direction, Part
from p2os.capture.formats.pcap_records import Records
from p2os.capture.formats.tcp_streams import TcpStreams
from simbase.errors import FileError
from simbase.timing import NS_PER_S, Nanos

#: Our own records: one byte of direction, then what was sent.
LINKTYPE_USER0 = 147
IN_DIRECTION = {0: Direction.TO_ROBOT, 1: Direction.FROM_ROBOT}
#: chosen: a year; a longer time is a damaged one.
LONGEST_NS: Nanos = 366 * 86_400 * NS_PER_S
#: chosen: of fewer records, a loop takes less time than NumPy's calls.
LEAST_RECORDS = 64


class Conversations:
    """What is said in captured packets."""

    def __init__(self) -> None:
        self.streams = TcpStreams()
        self.is_empty = True
        #: When the first record was captured, in nanoseconds since 1970.
        self.start_ns: Nanos | None = None

    def parts(self, records: Records, first: int = 0, last: int | None = None) -> Iterator[Part]:
        """Yield what some records hold, one by one."""
        link, taken = records.link, self.streams.take
        for captured_ns, data in records.packets(first, len(records.starts) if last is None else last):
            self.start_ns = captured_ns if self.start_ns is None else self.start_ns
            at_ns = max(0, captured_ns - self.start_ns)
            if at_ns > LONGEST_NS:
                raise FileError(f"a record {at_ns / NS_PER_S:.3g} s after the first: its time is damaged")
            if link == LINKTYPE_USER0:
                if data[:1] not in (b"\0", b"\1"):
                    raise FileError("a record of link type USER0 that is not ours: its first byte gives no direction")
                self.is_empty = False
                yield at_ns, IN_DIRECTION[data[0]], data[1:]
            else:
                found = taken(link, data)
                if found is not None:
                    self.is_empty = False
                    yield at_ns, *found
