"""Fuzz targets for what reads bytes beside the chip: GDB's protocol, an SD card, USB descriptors, CAN datagrams.

As those of `protocol.py`: a target takes any bytes, and raises only when something is wrong.
"""

import contextlib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

from bluepill_sim.board import BluePill
from bluepill_sim.cli.can_socket import from_datagram, to_datagram
from bluepill_sim.debug.execution import Execution
from bluepill_sim.debug.gdb_session import GdbSession
from bluepill_sim.debug.machine import LoneChip
from bluepill_sim.debug.packets import MAX_BYTES, GdbPacket, PacketReader, frame
from bluepill_sim.parts.sd_card import SdCard
from bluepill_sim.parts.usb.descriptors import DescriptorError, parse_configuration, parse_device, parse_string

FIRMWARE = Path(__file__).resolve().parents[2] / "robot_bench" / "firmware" / "motors.elf"
#: What lets time go on or leaves: an input of the debugger's is to take no second.
RUNS = (b"c", b"C", b"bc", b"bs", b"vCont", b"vRun", b"R", b"k", b"vKill", b"D", b"qRcmd")
BYTE_NS = 400


@cache
def _debugger() -> tuple[GdbSession, BluePill, bytes]:
    board = BluePill(FIRMWARE)
    session = GdbSession(Execution(LoneChip(board), lambda _data: None))
    return session, board, board.snapshot()


def fuzz_gdb(data: bytes) -> None:
    """Whatever cut, the packets are the same; every question is answered, and the answer can be framed."""
    whole, reader = PacketReader(), PacketReader()
    events = whole.receive(data)
    assert [event for at in range(len(data)) for event in reader.receive(data[at : at + 1])] == events
    session, board, fresh = _debugger()
    has_asked = False
    for event in events:
        if isinstance(event, GdbPacket) and not event.payload.startswith(RUNS):
            has_asked = True
            answer = session.answer(event.payload)
            assert PacketReader().receive(frame(answer)) == [GdbPacket(answer)] or len(answer) > MAX_BYTES
    if has_asked:
        board.restore(fresh)


def fuzz_sd(data: bytes) -> None:
    """A card answers every byte with one, and gives up what it holds as blocks."""
    card, now = SdCard(size_mb=1), 0
    card.select(now)
    for byte in data:
        now += BYTE_NS
        assert 0 <= card.exchange(byte, now) <= 0xFF
    card.deselect(now)
    card.words()


def fuzz_usb(data: bytes) -> None:
    """Descriptors of a device are read or refused as damaged."""
    for read in (parse_device, parse_configuration, parse_string):
        with contextlib.suppress(DescriptorError):
            read(data)


def fuzz_can(data: bytes) -> None:
    """A datagram is a frame that writes as itself, or none."""
    with contextlib.suppress(ValueError):
        received = from_datagram(data)
        assert from_datagram(to_datagram(received)) == received


TARGETS: Mapping[str, Callable[[bytes], None]] = {
    "gdb": fuzz_gdb,
    "sd": fuzz_sd,
    "usb": fuzz_usb,
    "can": fuzz_can,
}


def seeds(target: str) -> list[bytes]:
    """Return what a target's inputs are mutated from."""
    match target:
        case "gdb":
            asked = (b"qSupported:multiprocess+", b"g", b"p10", b"P2=78563412", b"m8000000,40", b"M20000000,4:01020304")
            asked += (b"Z0,8000100,2", b"z0,8000100,2", b"Z2,20000000,4", b"qXfer:features:read:target.xml:0,100")
            asked += (b"X20000000,3:a}]b", b"vFlashErase:8000000,400", b"vFlashWrite:8000000:abcd", b"vFlashDone", b"?")
            asked += (
                b"qXfer:memory-map:read::0,fff",
                b"G" + b"00" * 80,
                b"H g0".replace(b" ", b""),
                b"QStartNoAckMode",
            )
            return [frame(one) for one in asked]
        case "sd":
            start = bytes.fromhex("400000000095 ff 48000001aa87 ff 770000000065 694000000077 ff 7a00000000fd")
            read, write = bytes.fromhex("510000000055 ff ff"), bytes.fromhex("580000000055 ff fe") + bytes(514)
            return [start, start + read + b"\xff" * 520, start + write]
        case "usb":
            device = bytes.fromhex("12010002020000408304405700020102 0301")
            configuration = bytes.fromhex("09022000010100c0320904000002ff0000000705810240000007050102400000")
            return [device, configuration, bytes.fromhex("0a03410042004300 4400")]
        case _:
            return [
                bytes.fromhex("2301000008000000 0102030405060708"),
                bytes.fromhex("2301000008000080 0102030405060708"),
            ]
