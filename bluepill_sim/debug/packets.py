"""Frames of GDB's remote serial protocol: `$payload#checksum`, acknowledgements, Ctrl-C.

Bytes go in as they come; events come out. Nothing here knows what a payload means.

Source: Debugging with GDB, appendix E.1 "Overview" of the remote protocol.
Invariant: any bytes at all give events, never an exception, and never hold more than `MAX_BYTES`.
"""

import re
from dataclasses import dataclass
from enum import Enum

#: Longest payload taken, and reported to GDB as PacketSize (it counts the frame too).
MAX_BYTES = 0x4000
_START, _END, _ESCAPE = b"$#}"
_INTERRUPT = 0x03
_ESCAPED, _ESCAPE_AND_BYTE = re.compile(rb"[#$}*]"), re.compile(rb"\}(.?)", re.DOTALL)
_ESCAPE_BIT = 0x20
_HEX = b"0123456789abcdefABCDEF"


class PacketMark(Enum):
    """What comes between packets."""

    ACK = "+"
    NAK = "-"
    #: Ctrl-C.
    INTERRUPT = "interrupt"
    #: A packet with a wrong checksum, or one that is too long: to be asked for again.
    DAMAGED = "damaged"


@dataclass(frozen=True, slots=True)
class GdbPacket:
    """A whole packet, its escapes undone."""

    payload: bytes


Event = GdbPacket | PacketMark


class PacketReader:
    """Takes bytes of any cut and finds the packets in them."""

    def __init__(self) -> None:
        self._payload: bytearray | None = None
        #: The checksum's digits so far; None outside of them.
        self._digits: bytearray | None = None
        self._is_too_long = False

    def receive(self, data: bytes) -> list[Event]:
        """Return what the bytes complete."""
        events: list[Event] = []
        for byte in data:
            event = self._take(byte)
            if event is not None:
                events.append(event)
        return events

    def _take(self, byte: int) -> Event | None:
        if self._digits is not None:
            self._digits.append(byte)
            return self._finish() if len(self._digits) == 2 else None
        if self._payload is None:
            if byte == _START:
                self._payload, self._is_too_long = bytearray(), False
            return _MARKS.get(byte)
        if byte == _START:  # the packet before was cut off
            self._payload, self._is_too_long = bytearray(), False
        elif byte == _END:
            self._digits = bytearray()
        elif len(self._payload) >= MAX_BYTES:
            self._is_too_long = True
        else:
            self._payload.append(byte)
        return None

    def _finish(self) -> Event:
        payload, digits = bytes(self._payload or b""), bytes(self._digits or b"")
        self._payload = self._digits = None
        if self._is_too_long or any(digit not in _HEX for digit in digits) or int(digits, 16) != checksum(payload):
            return PacketMark.DAMAGED
        return GdbPacket(unescape(payload))


_MARKS = {ord("+"): PacketMark.ACK, ord("-"): PacketMark.NAK, _INTERRUPT: PacketMark.INTERRUPT}


def checksum(payload: bytes) -> int:
    """Return the sum of the bytes as they are sent, modulo 256."""
    return sum(payload) & 0xFF


def frame(payload: bytes) -> bytes:
    """Return a packet ready to be sent."""
    escaped = _ESCAPED.sub(lambda found: bytes((_ESCAPE, found[0][0] ^ _ESCAPE_BIT)), payload)
    return b"$%b#%02x" % (escaped, checksum(escaped))


def unescape(payload: bytes) -> bytes:
    """Undo the escapes of a payload; one that ends inside an escape loses it."""
    return _ESCAPE_AND_BYTE.sub(lambda found: bytes(byte ^ _ESCAPE_BIT for byte in found[1]), payload)
