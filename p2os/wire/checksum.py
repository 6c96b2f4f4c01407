"""The P2OS checksum (Pioneer manuals, "Packet checksum").

A 16-bit sum of big-endian pairs over the bytes from the command or type byte
to the last argument; an odd last byte is XORed into the low byte. Header,
count and the checksum itself are left out.
"""


def checksum(data: bytes) -> int:
    """Return the checksum of a frame's payload, 0 to 0xFFFF."""
    even = len(data) & ~1
    total = 256 * sum(data[0:even:2]) + sum(data[1:even:2])
    if len(data) != even:
        return (total & 0xFFFF) ^ data[-1]
    return total & 0xFFFF
