"""P2OS as a client and a bystander need it, by hand: nothing here is imported from what is judged.

Source: Pioneer 2 operations manual, chapter 6 (packets, synchronisation, server information packet).
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

HEADER = b"\xfa\xfb"
SYNC = (0, 1, 2)
PULSE, OPEN, CLOSE, ENABLE, VEL, RVEL, STOP = 0, 1, 2, 4, 11, 21, 29
#: Commands that turn the wheels when their argument is not zero.
MOVING = {6, 8, 9, 11, 12, 13, 21, 23, 32, 34}
#: Kinds of a server information packet: standing, moving.
INFORMATION = (0x32, 0x33)


def checksum(payload: bytes) -> int:
    """Return the sum of big-endian words, with an odd last byte in it by exclusive or."""
    total = sum(struct.unpack_from(f">{len(payload) // 2}H", payload)) & 0xFFFF
    return total ^ payload[-1] if len(payload) % 2 else total


def packet(payload: bytes) -> bytes:
    """Return a whole packet."""
    return HEADER + bytes((len(payload) + 2,)) + payload + struct.pack(">H", checksum(payload))


def command(number: int, argument: int | None = None) -> bytes:
    """Return a command's packet, with a signed argument or none."""
    if argument is None:
        return packet(bytes((number,)))
    return packet(bytes((number, 0x3B if argument >= 0 else 0x1B)) + struct.pack("<H", abs(argument)))


#: What opens a session and makes a robot drive.
HELLO = b"".join(command(each) for each in SYNC)
SESSION = HELLO + command(OPEN) + command(ENABLE, 1)
DRIVING = SESSION + command(VEL, 300)


class OutsidersReader:
    """Finds packets in a stream; a byte that begins none is passed over."""

    def __init__(self) -> None:
        self._kept = b""

    def take(self, data: bytes) -> Iterator[bytes]:
        """Yield the payloads that are whole now."""
        self._kept += data
        while (at := self._kept.find(HEADER)) >= 0 and len(self._kept) > at + 2:
            count = self._kept[at + 2]
            if len(self._kept) < at + 3 + count:
                break
            payload, found = self._kept[at + 3 : at + 1 + count], self._kept[at + 1 + count : at + 3 + count]
            if count < 3 or found != struct.pack(">H", checksum(payload)):
                self._kept = self._kept[at + 1 :]
                continue
            self._kept = self._kept[at + 3 + count :]
            yield payload
        if at < 0:
            self._kept = self._kept[-1:]


@dataclass(frozen=True)
class WheelReport:
    """What a server information packet says of the wheels: odometry in the robot's units, speeds in mm/s."""

    x: int
    y: int
    heading: int
    left_mmps: int
    right_mmps: int

    @property
    def turns(self) -> bool:
        """Whether a wheel turns."""
        return (self.left_mmps, self.right_mmps) != (0, 0)


def motion_of(payload: bytes) -> WheelReport | None:
    """Return what a packet says of the wheels, or nothing where it is of another kind."""
    if payload[0] not in INFORMATION or len(payload) < 11:
        return None
    return WheelReport(*struct.unpack_from("<5h", payload, 1))


def moves(payload: bytes) -> bool:
    """Tell whether a command's payload asks for motion."""
    return payload[0] in MOVING and any(payload[2:])
