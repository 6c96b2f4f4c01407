"""The log of the silicon kit: what it prints over USART1, read strictly.

    p2os-silicon 1
    reg 40021000 00000083          a register before anything was changed: its address and its word
    sram k_nop 00000040            what was counted: a kind, a name and a number in hex
    #                              a character whose time was measured
    end 00000197 1A2B3C4D          how many lines stand before it, and their checksum

Invariant: of a log that was read every line is whole, and none is missing.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from bluepill_sim.errors import BluePillError

HEAD = "p2os-silicon 1"
#: Kinds of numbers, and what they are.
KINDS: Mapping[str, str] = {
    "start": "cycles of 8 MHz to start an oscillator",
    "flash2": "cycles of a kernel in flash at 72 MHz, two wait states",
    "sram": "cycles of a kernel in SRAM at 72 MHz",
    "flash0": "cycles of a kernel in flash at 8 MHz, no wait states",
    "irq": "cycles of an interrupt",
    "tim": "cycles of a peripheral",
    "flag": "a register at a step of a sequence",
}
#: chosen: longer than any log of the kit, by far.
MOST_BYTES = 1_000_000
_REGISTER = re.compile(r"reg ([0-9a-f]{8}) ([0-9a-f]{8})")
_NUMBER = re.compile(r"([a-z]+[0-9]?) ([a-z][a-z0-9_]*) ([0-9a-f]{8})")
_END = re.compile(r"end ([0-9a-f]{8}) ([0-9a-f]{8})")
_HINT = "a log of the kit from its first line to the one that begins with end, as the serial port has it"


_Key = TypeVar("_Key")


class SiliconLogError(BluePillError):
    """A log that is none of the kit's, or not whole."""

    exit_code = 2


@dataclass(frozen=True, slots=True)
class SiliconLog:
    """What a chip has said of itself."""

    #: Word by address.
    registers: Mapping[int, int]
    #: Number by kind and name.
    numbers: Mapping[tuple[str, str], int]


def read_log(data: bytes, name: str) -> SiliconLog:
    """Return what a log holds; what stands before its first line (noise of a port) is passed over.

    Raises:
        SiliconLogError: It is no log of the kit, cut, or damaged; the message names the line.
    """
    if len(data) > MOST_BYTES:
        raise SiliconLogError(f"{name}: {len(data)} bytes are no log of the silicon kit", hint=_HINT)
    text = data.decode("ascii", "replace").replace("\r\n", "\n")
    at = text.rfind(HEAD + "\n")
    if at < 0:
        raise SiliconLogError(f"{name}: no line {HEAD!r}: no log of the silicon kit", hint=_HINT)
    first = text.count("\n", 0, at) + 1
    registers: dict[int, int] = {}
    numbers: dict[tuple[str, str], int] = {}
    checksum = 0
    for number, line in enumerate(text[at:].split("\n")):
        where = f"{name}:{first + number}"
        if (end := _END.fullmatch(line)) is not None:
            _check_end(end, number, checksum, where)
            return SiliconLog(registers, numbers)
        if (register := _REGISTER.fullmatch(line)) is not None:
            _put(registers, int(register[1], 16), int(register[2], 16), where)
        elif (found := _NUMBER.fullmatch(line)) is not None and found[1] in KINDS:
            _put(numbers, (found[1], found[2]), int(found[3], 16), where)
        elif line != "#" and (number or line != HEAD):
            raise SiliconLogError(f"{where}: {line[:40]!r} is no line of the silicon kit", hint=_HINT)
        for character in f"{line}\n":
            checksum = ((checksum << 1 | checksum >> 31) + ord(character)) & 0xFFFF_FFFF
    raise SiliconLogError(f"{name}: the line that begins with end is missing: the log is cut", hint=_HINT)


def _check_end(end: re.Match[str], lines: int, checksum: int, where: str) -> None:
    wanted_lines, wanted = int(end[1], 16), int(end[2], 16)
    if lines != wanted_lines:
        raise SiliconLogError(f"{where}: {lines} lines stand before it, and it says {wanted_lines}", hint=_HINT)
    if checksum != wanted:
        raise SiliconLogError(
            f"{where}: checksum {checksum:08x}, and it says {wanted:08x}: a line is damaged", hint=_HINT
        )


def _put(into: dict[_Key, int], key: _Key, value: int, where: str) -> None:
    if key in into:
        raise SiliconLogError(f"{where}: {key} stands there twice", hint=_HINT)
    into[key] = value
