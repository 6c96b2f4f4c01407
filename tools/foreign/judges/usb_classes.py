"""What hosts of three USB classes say: mass storage, firmware upgrade, and CMSIS-DAP; by our host, in virtual time.

Sources: USB Mass Storage Class, Bulk-Only Transport 1.0, section 5; SCSI Block Commands 2; USB Device Firmware Upgrade
1.1, section 6; AN3156 (DfuSe: commands in block 0); CMSIS-DAP 2, commands DAP_Info and DAP_Connect.
"""

import struct

from bluepill_sim import BluePill
from bluepill_sim.spans import Span
from tools.foreign.row import RowError

_CBW, _CSW = 0x43425355, 0x53425355
_TO_INTERFACE, _FROM_INTERFACE = 0x21, 0xA1
_DNLOAD, _UPLOAD, _GETSTATUS, _CLRSTATUS = 1, 2, 3, 4
#: States of DFU 1.1, A.1.2.
#: The last waits for a reset of the bus.
_BUSY, WAIT_RESET = frozenset({3, 4, 6}), 8
#: chosen: a device that asks for more polls than that never ends.
_MOST_POLLS = 200
PAGE_BYTES = 1024


class MassStorage:
    """A disk at its bulk endpoints."""

    def __init__(self, board: BluePill, out: int, into: int) -> None:
        self._board, self._out, self._into, self._tag = board, out, into, 0

    def command(self, command: bytes, length: int = 0, data: bytes = b"") -> bytes:
        """Do a SCSI command; return what came, or raise `RowError` where its status is not good."""
        host = self._board.usb
        self._tag += 1
        size, flags = (len(data), 0) if data else (length, 0x80)
        host.write(self._out, struct.pack("<IIIBBB16s", _CBW, self._tag, size, flags, 0, len(command), command))
        if data:
            host.write(self._out, data)
        came = b""
        while len(came) < length:
            packet = host.wait_packet(self._into).data
            came += packet
            if len(packet) < 64:
                break
        # A device that has less to send may have ended with its status in this packet's place.
        status = came[-13:] if len(came) < length and came[-13:-9] == struct.pack("<I", _CSW) else b""
        status = status or host.wait_packet(self._into).data
        signature, tag, _, result = struct.unpack("<IIIB", status)
        if (signature, tag, result) != (_CSW, self._tag, 0):
            raise RowError(f"SCSI {command.hex()}: status {status.hex()}")
        return came


class Dfu:
    """A device in its DFU mode, by control transfers."""

    def __init__(self, board: BluePill, interface: int = 0, alternate: int = 0) -> None:
        self._usb, self._interface = board.usb, interface
        self._board = board
        if alternate:
            self._usb.transfer(0x01, 11, alternate, interface)

    def status(self) -> tuple[int, int, int]:
        """Return (status, milliseconds to wait, state)."""
        status, *poll, state, _ = self._usb.transfer(_FROM_INTERFACE, _GETSTATUS, 0, self._interface, length=6)
        return status, int.from_bytes(bytes(poll), "little"), state

    def settle(self) -> int:
        """Poll until a block has been taken; return the state."""
        for _ in range(_MOST_POLLS):
            status, poll_ms, state = self.status()
            if status:
                raise RowError(f"DFU status {status} in state {state}")
            self._board.run_for(max(poll_ms, 1) * 1_000_000)
            if state not in _BUSY:
                return state
        raise RowError(f"DFU: still state {state} after {_MOST_POLLS} polls")

    def download(self, number: int, data: bytes, *, within: Span = "2 s") -> int:
        """Send a block; return the state after it."""
        self._usb.transfer(_TO_INTERFACE, _DNLOAD, number, self._interface, data, within=within)
        return self.settle()

    def end(self) -> None:
        """Say that there is no more; a device may begin its program before it says so."""
        self._usb.transfer(_TO_INTERFACE, _DNLOAD, 0, self._interface, b"")

    def upload(self, number: int, length: int) -> bytes:
        """Return a block that the device sends."""
        return self._usb.transfer(_FROM_INTERFACE, _UPLOAD, number, self._interface, length=length)


def lamp_program(base: int) -> bytes:
    """Return a program for an address in flash that lights the LED at PC13: vectors, and 14 instructions of Thumb."""
    code = struct.pack(
        "<14H",
        0x4806, 0x2110, 0x6181,  # ldr r0, =RCC; movs r1, #IOPCEN; str r1, [r0, #APB2ENR]
        0x4806, 0x4906, 0x6041,  # ldr r0, =GPIOC; ldr r1, =CRH; str r1, [r0, #CRH]
        0x4906, 0x6101,  # ldr r1, =BR13; str r1, [r0, #BSRR]
        0xE7FE, *(5 * [0xBF00]),  # b .; nop
    )  # fmt: skip
    words = struct.pack("<4I", 0x4002_1000, 0x4001_1000, 0x4424_4444, 1 << 29)
    return struct.pack("<4I", 0x2000_4000, base + 17, base + 17, base + 17) + code + words
