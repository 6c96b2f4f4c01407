"""TCP conversations in captured packets: segments put in order, repeated ones left out, and which side is the robot.

Fragments of IP are not put together; P2OS frames are far too short to be fragmented. The robot's side of a conversation
is the one that was connected to: the receiver of the SYN, else port 8101, else the lower port.

Source: link types of tcpdump.org.
"""

import struct
from dataclasses import dataclass, field

from p2os.capture.chunks import Direction

#: The port on which simulated Pioneers listen.
ROBOT_PORT = 8101
TCP = 6
SYN, _ACK = 0x02, 0x10
IPV4, IPV6 = 0x0800, 0x86DD
#: Link type → (bytes before the IP packet, offset of the Ethernet type or None where IP follows at once).
LINKS: dict[int, tuple[int, int | None]] = {
    0: (4, None),  # NULL: BSD loopback
    1: (14, 12),  # EN10MB
    101: (0, None),  # RAW
    113: (16, 14),  # LINUX_SLL
    276: (20, 0),  # LINUX_SLL2
}
#: chosen: more segments than this out of order, and the missing one was never captured.
MOST_WAITING = 64

#: Bytes of an IPv4 header without options, and its first byte.
IPV4_BYTES, _NO_OPTIONS = 20, b"\x45"
#: Of such a packet at the least, up to the TCP header's flags.
_LEAST_BYTES = 34
#: A TCP header's data offset, five words at the least, beside four bits of no use here.
_LEAST_OFFSET = 5 << 4
#: Its size, protocol and addresses, and of the TCP header behind it the ports, the sequence, the size and the flags.
_PLAIN = struct.Struct(">2xH5xB2x4s4sHHI4xBB").unpack_from

#: Address and port.
End = tuple[bytes, int]


@dataclass(slots=True)
class Half:
    """One direction of one conversation."""

    next_sequence: int | None = None
    waiting: dict[int, bytes] = field(default_factory=dict)

    def take(self, sequence: int, data: bytes, *, is_syn: bool) -> bytes:
        """Return the bytes that are now in order."""
        if is_syn or self.next_sequence is None:
            self.next_sequence = (sequence + is_syn) & 0xFFFFFFFF
            sequence = self.next_sequence
        if not self.waiting and sequence == self.next_sequence:
            # Nearly always: nothing is late, and nothing was sent again.
            self.next_sequence = (sequence + len(data)) & 0xFFFFFFFF
            return data
        if data:
            self.waiting[sequence] = data
        if len(self.waiting) > MOST_WAITING:
            self.next_sequence = min(self.waiting, key=self._ahead)
        ready = b""
        for start in sorted(self.waiting, key=self._ahead):
            ahead = self._ahead(start)
            if ahead > 0:
                break
            segment = self.waiting.pop(start)[-ahead:]  # what was sent again is left out
            ready += segment
            self.next_sequence = (self.next_sequence + len(segment)) & 0xFFFFFFFF
        return ready

    def _ahead(self, sequence: int) -> int:
        """Return how far a sequence number lies after the next one; negative before it."""
        distance = (sequence - (self.next_sequence or 0)) & 0xFFFFFFFF
        return distance - (1 << 32) if distance >= 1 << 31 else distance


class TcpStreams:
    """Follows every TCP conversation of a capture file."""

    def __init__(self) -> None:
        self._halves: dict[tuple[End, End], Half] = {}
        self._robots: dict[frozenset[End], End] = {}
        #: What follows from those, of the conversations that were asked for.
        self._directions: dict[tuple[End, End], Direction] = {}
        #: Link types that are not read here.
        self.unread_links: set[int] = set()

    def take(self, link: int, packet: bytes) -> tuple[Direction, bytes] | None:
        """Take a captured packet; return what it adds to a conversation, if anything."""
        if link not in LINKS:
            self.unread_links.add(link)
            return None
        found = _segment(link, packet)
        if found is None:
            return None
        source, target, sequence, flags, data = found
        half = self._halves.get((source, target))
        if half is None or flags & SYN:
            half = self._begin(source, target, flags)
        ready = half.take(sequence, data, is_syn=bool(flags & SYN))
        return (self.direction(source, target), ready) if ready else None

    def _begin(self, source: End, target: End, flags: int) -> Half:
        """Note whose side is the robot's, and return a direction of the conversation."""
        ends = frozenset((source, target))
        if flags & SYN:
            self._robots[ends] = source if flags & _ACK else target
        elif ends not in self._robots:
            self._robots[ends] = min((source, target), key=lambda end: (end[1] != ROBOT_PORT, end[1]))
        # Its other direction too may have another robot now.
        self._directions.clear()
        return self._halves.setdefault((source, target), Half())

    def half(self, source: End, target: End) -> Half | None:
        """Return one direction of a conversation, if any of it was taken."""
        return self._halves.get((source, target))

    def direction(self, source: End, target: End) -> Direction:
        """Tell which direction of its conversation that is; some of it was taken."""
        found = self._directions.get((source, target))
        if found is None:
            is_robot = self._robots[frozenset((source, target))] == source
            found = self._directions[source, target] = Direction.FROM_ROBOT if is_robot else Direction.TO_ROBOT
        return found


def _segment(link: int, packet: bytes) -> tuple[End, End, int, int, bytes] | None:
    """Return (source, target, sequence, flags, data) of a TCP segment, or None for anything else."""
    skip, type_at = LINKS[link]
    if type_at is not None:
        kind = int.from_bytes(packet[type_at : type_at + 2], "big")
        if kind not in {IPV4, IPV6}:
            return None
    try:
        if packet[skip : skip + 1] == _NO_OPTIONS:
            size, protocol, source, target, source_port, target_port, sequence, offset, flags = _PLAIN(packet, skip)
            data = packet[skip + IPV4_BYTES + (offset >> 4) * 4 : skip + size if size else None]
            found = (source, source_port), (target, target_port), sequence, flags, data
            is_tcp = protocol == TCP and offset >= _LEAST_OFFSET
            return found if is_tcp and not 0 < size < _LEAST_BYTES else None
        ip = packet[skip:]
        if ip[:1] and ip[0] >> 4 == 4:
            header, size, protocol = (ip[0] & 15) * 4, int.from_bytes(ip[2:4], "big"), ip[9]
            source, target, tcp = ip[12:16], ip[16:20], ip[header : size or None]
        elif ip[:1] and ip[0] >> 4 == 6:
            protocol, size = ip[6], int.from_bytes(ip[4:6], "big")
            source, target, tcp = ip[8:24], ip[24:40], ip[40 : 40 + size]
        else:
            return None
        source_port, target_port, sequence, _, offset, flags = struct.unpack_from(">HHIIBB", tcp)
    except (IndexError, struct.error):
        return None
    if protocol != TCP or offset < _LEAST_OFFSET:
        return None
    return (source, source_port), (target, target_port), sequence, flags, tcp[(offset >> 4) * 4 :]
