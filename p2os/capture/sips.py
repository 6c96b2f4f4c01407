"""The SIPs of a robot in a capture, one by one, without a row for anything else.

Theory of operation. Sound frames are looked at here while none waits for its rest. All else goes to a `Lister`, up to
the next header, before which it tells of noise anyway. What a client sends changes no SIP: it only tells the time, at
which a frame whose rest never came is given up.

Invariant: the SIPs, and when each had come, are those of a listing's rows.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from p2os.capture.chunks import LETTERS, Block, Chunk, Direction
from p2os.capture.listing import Lister, ListingRow, Reading, next_header
from p2os.protocol.frames import CHECKSUM_BYTES, PREFIX_BYTES, sound_frames
from p2os.protocol.sip import SIP_KINDS, unpack_head
from simbase.timing import Nanos

_CLIENT = LETTERS[Direction.TO_ROBOT][0]
_FRAMING_BYTES = PREFIX_BYTES + CHECKSUM_BYTES


class Sip(NamedTuple):
    """A standard SIP.

    Args:
        at_ns: When its last byte had come, in nanoseconds since the start.
        payload: Its type and what follows.
        head: Its numbers, as `p2os.protocol.sip.unpack_head` gives them.
    """

    at_ns: Nanos
    payload: bytes
    head: tuple[int, ...]


def sips_of(blocks: Iterable[Block], reading: Reading) -> Iterator[Sip]:
    """Yield the SIPs of a capture's robot, in the order in which they had come."""
    lister, is_waiting, now = Lister(reading), False, 0
    for block in blocks:
        start = 0
        for number, (at_ns, sender, end) in enumerate(zip(block.at_ns, block.senders, block.ends, strict=True)):
            data, place, start = block.data[start:end], 0, end
            if sender == _CLIENT:
                if is_waiting:
                    yield from from_rows(lister.advance_to(at_ns))
                    is_waiting = lister.is_waiting
                continue
            while True:
                if not is_waiting:
                    for payload in sound_frames(data, place):
                        place += len(payload) + _FRAMING_BYTES
                        if payload[0] in SIP_KINDS and (head := unpack_head(payload)) is not None:
                            yield Sip(at_ns, payload, head)
                if place == len(data):
                    break
                # Up to the next header, before which noise ends anyway.
                cut = next_header(data, place + 1)
                chunk = Chunk(at_ns=at_ns, direction=block.direction(number), data=data[place:cut])
                yield from from_rows(lister.take(chunk))
                is_waiting, place = lister.is_waiting, cut
        now = block.at_ns[-1]
    yield from from_rows(lister.finish(now))


def from_rows(rows: Iterable[ListingRow]) -> Iterator[Sip]:
    """Yield the SIPs of a robot among rows."""
    for row in rows:
        if row.direction is not Direction.TO_ROBOT and row.kind in SIP_KINDS:
            payload = row.data[PREFIX_BYTES:-CHECKSUM_BYTES]
            head = unpack_head(payload)
            if head is not None:
                yield Sip(row.at_ns, payload, head)
