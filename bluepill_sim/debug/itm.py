"""What firmware writes to the ITM's stimulus ports, to a file: as text with times, or as the packets of the trace.

A text file has a line for each line that port 0 prints, and one for each word of the other ports; the time is that of
its first character. A packet file is what a probe receives on SWO with the formatter off: decoders of others read it.

Not modelled: the speed of the pin (there is always room for the next word), synchronisation packets, and packets of
the DWT.

Source: ARMv7-M Architecture Reference Manual appendix E (packets of ITM and DWT); C1.7.
Invariant: nothing is lost: what is still on its way is written by `close`.
"""

from typing import BinaryIO, Protocol, TextIO

from simbase.timing import NS_PER_S, Nanos

#: A time stamp has at most four groups of seven bits; longer spans take several.
_GROUPS, _GROUP_BITS = 4, 7
_MOST_CYCLES = (1 << _GROUPS * _GROUP_BITS) - 1
#: Header of a time stamp that goes with the packet before; up to six cycles fit into a header of its own.
_TIME_STAMP, _SHORT_CYCLES, _CONTINUES = 0xC0, 6, 0x80
_SIZE_CODES = {1: 1, 2: 2, 4: 3}


class StimulusWriter(Protocol):
    """Takes what goes to the stimulus ports."""

    def write(self, at_ns: Nanos, cycle: int, port: int, data: bytes) -> None:
        """Take one word, at a time and a cycle of the core."""

    def close(self) -> None:
        """Write what is still on its way; the file is closed."""


class TextWriter:
    """Lines of text: seconds, port, and what was written."""

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._line = bytearray()
        self._line_ns: Nanos = 0

    def write(self, at_ns: Nanos, _cycle: int, port: int, data: bytes) -> None:
        """As of `StimulusWriter`."""
        if port:
            self._put(at_ns, port, f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}x}")
            return
        for byte in data:
            if not self._line:
                self._line_ns = at_ns
            if byte == ord("\n"):
                self._end_line()
            else:
                self._line.append(byte)

    def close(self) -> None:
        """As of `StimulusWriter`."""
        if self._line:
            self._end_line()
        self._file.close()

    def _end_line(self) -> None:
        text = self._line.rstrip(b"\r").decode("utf-8", "backslashreplace")
        self._line.clear()
        self._put(self._line_ns, 0, "".join(one if one.isprintable() else f"\\x{ord(one):02x}" for one in text))

    def _put(self, at_ns: Nanos, port: int, text: str) -> None:
        self._file.write(f"{at_ns / NS_PER_S:14.9f}  {port:2d}  {text}".rstrip() + "\n")


class PacketWriter:
    """Packets: each word with its port, and behind it the cycles since the one before, or since the start."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._last_cycle = 0

    def write(self, _at_ns: Nanos, cycle: int, port: int, data: bytes) -> None:
        """As of `StimulusWriter`."""
        self._file.write(source_packet(port, data) + time_stamps(cycle - self._last_cycle))
        self._last_cycle = cycle

    def close(self) -> None:
        """As of `StimulusWriter`."""
        self._file.close()


def source_packet(port: int, data: bytes) -> bytes:
    """Return the packet of a word of 1, 2 or 4 bytes that a port has taken."""
    return bytes([port << 3 | _SIZE_CODES[len(data)]]) + data


def time_stamps(cycles: int) -> bytes:
    """Return the packets that say how many cycles have passed since the last time stamp."""
    found = b""
    while cycles > _MOST_CYCLES:
        found += _time_stamp(_MOST_CYCLES)
        cycles -= _MOST_CYCLES
    return found + _time_stamp(cycles)


def _time_stamp(cycles: int) -> bytes:
    if 0 < cycles <= _SHORT_CYCLES:
        return bytes([cycles << 4])
    groups = [cycles & 0x7F]
    while cycles := cycles >> _GROUP_BITS:
        groups.append(cycles & 0x7F)
    return bytes([_TIME_STAMP, *(group | _CONTINUES for group in groups[:-1]), groups[-1]])
