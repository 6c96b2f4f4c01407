"""A picture of what a part shows: rows of colours, as a PNG or as characters for a terminal.

Source of the format: PNG (ISO/IEC 15948), sections 5 and 11; of the characters: Unicode's block of braille patterns.
Invariant: the same picture gives the same bytes.
"""

import struct
import zlib
from dataclasses import dataclass

#: Red, green, blue, 0 to 255.
Colour = tuple[int, int, int]
#: The dots of a braille character by row and column, as bits.
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_BRAILLE = 0x2800
#: chosen: what a page shows well.
_WIDTH = 512


@dataclass(frozen=True, slots=True)
class Picture:
    """Rows of colours, the topmost first; all are of the same length."""

    rows: tuple[tuple[Colour, ...], ...]

    @property
    def width(self) -> int:
        """How many dots a row has."""
        return len(self.rows[0])

    def scale(self) -> int:
        """Return how much it is enlarged for a person: to about 512 dots."""
        return max(1, _WIDTH // self.width)

    def png(self, scale: int = 1) -> bytes:
        """Return it as a PNG file; each dot is a square of `scale` by `scale`."""
        lines = []
        for row in self.rows:
            line = b"\0" + b"".join(bytes(colour) * scale for colour in row)
            lines += [line] * scale
        head = struct.pack(">IIBBBBB", self.width * scale, len(self.rows) * scale, 8, 2, 0, 0, 0)
        chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(b"".join(lines), 9)), (b"IEND", b"")]
        return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)

    def text(self) -> str:
        """Return it in braille characters, two dots wide and four high each; a dot is set where it is bright."""
        lines = []
        for top in range(0, len(self.rows), 4):
            cells = []
            for left in range(0, self.width, 2):
                code = 0
                for row, bits in zip(self.rows[top : top + 4], _DOTS, strict=False):
                    code |= sum(
                        bit for colour, bit in zip(row[left : left + 2], bits, strict=False) if max(colour) > 127
                    )
                cells.append(chr(_BRAILLE + code))
            lines.append("".join(cells))
        return "\n".join(lines)


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
