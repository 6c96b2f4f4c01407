"""Captures of a network, as a program that listens to one writes them: TCP segments in a pcap file."""

import struct

#: The header of an Ethernet frame with IPv4.
ETHERNET = bytes(12) + b"\x08\x00"


def segment(
    source: int, target: int, sequence: int, data: bytes = b"", flags: int = 0x10, *, v6: bool = False
) -> bytes:
    """Return an IP packet with a TCP segment of (source port, target port)."""
    tcp = struct.pack(">HHIIBBHHH", source, target, sequence & 0xFFFFFFFF, 0, 5 << 4, flags, 0, 0, 0) + data
    if v6:
        return struct.pack(">IHBB", 6 << 28, len(tcp), 6, 64) + bytes(15) + b"\1" + bytes(15) + b"\2" + tcp
    return struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(tcp), 0, 0, 64, 6, 0) + b"\x7f\0\0\1" * 2 + tcp


def network_file(packets: list[bytes], link: int, before: bytes, *, magic: int = 0xA1B2C3D4, order: str = "<") -> bytes:
    """Return a pcap file of packets, each behind the header `before` of its link."""
    records = [
        struct.pack(order + "IIII", 10, 500 * place, len(before + data), len(before + data)) + before + data
        for place, data in enumerate(packets)
    ]
    return struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65535, link) + b"".join(records)


def block(kind: int, body: bytes, order: str) -> bytes:
    """Return a block of a pcapng file."""
    padded = body + bytes(-len(body) % 4)
    size = len(padded) + 12
    return struct.pack(order + "II", kind, size) + padded + struct.pack(order + "I", size)
