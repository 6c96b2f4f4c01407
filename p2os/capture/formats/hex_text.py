"""Bytes written as text: `fafb03000000`, `FA FB 03`, `0xFA, 0xFB`, and what xxd and hexdump -C print.

A line may begin with `>` (to the robot) or `<` (from it); `#` begins a comment.
Lines without either belong to one stream whose direction is not given.
"""

import re
from collections.abc import Iterable, Iterator

from p2os.capture.chunks import Capture, Direction, Part
from simbase.errors import FileError

#: `00000010: fafb 0300 0000 …  text` (xxd) and `00000010  fa fb 03 |text|` (hexdump -C).
_XXD = re.compile(r"^[0-9a-fA-F]{4,16}:\s(?P<bytes>(?:[0-9a-fA-F]{2,4} ?)+)(?:\s.*)?$")
_HEXDUMP = re.compile(r"^[0-9a-fA-F]{8,16}\s{2}(?P<bytes>(?:[0-9a-fA-F]{2}\s+)*[0-9a-fA-F]{2})\s*(?:\|.*\|)?$")
#: The last line of hexdump -C: the length alone.
_LENGTH = re.compile(r"^[0-9a-fA-F]{8}$")
_SEPARATORS = re.compile(r"0[xX]|\\x|[\s,;:\[\]()]+")
_ARROWS = {">": Direction.TO_ROBOT, "<": Direction.FROM_ROBOT}


def looks_like_hex(text: str) -> bool:
    """Tell whether a text may be meant as hex: nothing but digits and separators."""
    bare = _SEPARATORS.sub("", text)
    return bool(bare) and re.fullmatch(r"[0-9a-fA-F]+", bare) is not None


def is_hexdump(text: str) -> bool:
    """Tell whether a line is one of hexdump -C, so that a last line is a length and no bytes."""
    return any(_HEXDUMP.match(line) for line in text.splitlines())


def hex_parts(lines: Iterable[str], *, is_dump: bool) -> Iterator[Part]:
    """Yield the bytes of each line, one line read at a time.

    Raises:
        FileError: A line holds something else, or half a byte.
    """
    for number, raw_line in enumerate(lines, 1):
        line = raw_line.split("#", maxsplit=1)[0].strip()
        direction = _ARROWS.get(line[:1])
        line = line.lstrip("<> ")
        if is_dump and _LENGTH.match(line):
            continue
        found = _XXD.match(line) or _HEXDUMP.match(line)
        yield 0, direction, _bytes(found["bytes"] if found else line, number)


def write_hex(capture: Capture) -> str:
    """Return a capture as lines of hex with their direction."""
    lines = []
    for chunk in capture.chunks:
        arrow = "" if chunk.direction is None else f"{chunk.direction.arrow} "
        lines.append(f"{arrow}{chunk.data.hex(' ')}\n")
    return "".join(lines)


def _bytes(text: str, number: int) -> bytes:
    bare = _SEPARATORS.sub("", text)
    try:
        return bytes.fromhex(bare)
    except ValueError as error:
        wrong = re.search(r"[^0-9a-fA-F]", bare)
        why = f"{wrong[0]!r} is no hex digit" if wrong else "an odd number of hex digits"
        raise FileError(f"line {number}: {why}", hint="p2os decode 'fa fb 03 00 00 00'") from error
