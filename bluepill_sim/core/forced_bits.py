"""Which bits of a register a program means when it reads, changes and writes it.

    ldr r2, [r0]; bic r2, r2, #0xF00; orr r2, r2, #0x400; str r2, [r0]     bits 8 to 11

A pin is a floating input after reset, so that configuring it as one often
writes the value that is there already. What was meant shows in the code: the
bits that do not depend on what was read. They are found by going back through
the running block from the store to the load, with the registers as they are.

Not found, and then no bits: a register that is written without being read, or
in another block; masks that come from a part of a block that is not understood.

Source: ARMv7-M Architecture Reference Manual A5.2, A5.3.
Invariant: a bit is returned only if the value read cannot show in it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from bluepill_sim.stm32f103 import SRAM_BASE

_WORD = 0xFFFF_FFFF
_PC = 15
_FIRST_WIDE = 0xE800
#: chosen: how many blocks stay decoded; a program has a few stores to CRL and CRH, some of them in loops.
_BLOCKS = 256

#: Returns bytes of memory, or None where there is none.
ReadMemory = Callable[[int, int], bytes | None]


@dataclass(frozen=True, slots=True)
class BitStep:
    """One instruction: `target` becomes `name` of the sources; None: one or more unknown registers."""

    name: str
    target: int | None = None
    #: Register numbers that go into it.
    sources: tuple[int, ...] = ()
    #: The constant that does: the second operand, or the offset of an access.
    constant: int | None = None


def forced_bits(
    code: bytes, registers: Callable[[int], int], address: int, read: ReadMemory
) -> tuple[int, dict[int, int]]:
    """Return the bits that a store sets to what the program wants, whatever was there, and what that hangs on.

    That is, beside the code: values by the number of a register, or by the address of a word of SRAM.

    Args:
        code: the running block, up to and with the store.
        registers: returns R0 to R14, before the store.
        address: what the store writes.
        read: the memory.
    """
    steps = _steps_of(code)
    if not steps or steps[-1].name != "store":
        return 0, {}
    walk = _Walk(steps, registers, read)
    return walk.forced(address), walk.seen


class _Walk:
    """Goes back through a block."""

    def __init__(self, steps: tuple[BitStep, ...], registers: Callable[[int], int], read: ReadMemory) -> None:
        #: What it has looked at.
        self.seen: dict[int, int] = {}
        self._steps = steps
        self._registers = registers
        self._read = read

    def forced(self, written: int) -> int:
        last = len(self._steps) - 1
        stored, base = self._steps[last].sources
        kept = self._kept(stored, last, written) if self._address(base, last) == written else None
        return 0 if kept is None else ~kept & _WORD

    def _kept(self, register: int, before: int, address: int) -> int | None:
        """Return which bits of `register` may be those read from `address`; None: it was not read from there."""
        at = self._writer(register, before)
        if at is None:
            return None
        step = self._steps[at]
        match step.name, step.sources:
            case "load", (base,):
                return _WORD if self._address(base, at) == address else None
            case "move", (source,):
                return self._kept(source, at, address)
            case "insert", _:
                kept, mask = self._kept(register, at, address), step.constant
            case "and" | "clear" | "or", _:
                kept, mask = self._combined(step, at, address)
            case _:
                return None
        if kept is None or mask is None:
            return None
        return kept & (mask if step.name == "and" else ~mask)

    def _combined(self, step: BitStep, at: int, address: int) -> tuple[int | None, int | None]:
        """Return what was kept in one operand, and the other one."""
        first, *second = step.sources
        kept = self._kept(first, at, address)
        mask = self._value(second[0], at) if second else step.constant
        if kept is None and second and step.name != "clear":
            return self._kept(second[0], at, address), self._value(first, at)
        return kept, mask

    def _address(self, base: int, at: int) -> int | None:
        """Return what a load or a store at a step reaches for."""
        value, offset = self._value(base, at), self._steps[at].constant
        return None if value is None or offset is None else (value + offset) & _WORD

    def _writer(self, register: int, before: int) -> int | None:
        """Return the last step before another that writes a register, or may."""
        return next((n for n in range(before - 1, -1, -1) if self._steps[n].target in (register, None)), None)

    def _value(self, register: int, before: int) -> int | None:
        """Return what a register holds before a step; None: not known."""
        if register < _PC and all(s.target not in (register, None) for s in self._steps[before:-1]):
            return self.seen.setdefault(register, self._registers(register))
        at = self._writer(register, before)
        if at is None:
            return None
        step = self._steps[at]
        if step.name == "load":
            address = self._address(step.sources[0], at)
            data = None if address is None else self._read(address, 4)
            return None if data is None or address is None else self._loaded(address, data)
        values = [self._value(source, at) for source in step.sources]
        if step.constant is not None:
            values.append(step.constant)
        known = [value for value in values if value is not None]
        make = _MEANING.get(step.name)
        return None if make is None or len(known) != len(values) else make(known) & _WORD

    def _loaded(self, address: int, data: bytes) -> int:
        value = int.from_bytes(data, "little")
        if address >= SRAM_BASE:  # what a program changes without a word to anyone; below is flash: code
            self.seen[address] = value
        return value


_MEANING: dict[str, Callable[[list[int]], int]] = {
    "move": lambda v: v[0],
    "not": lambda v: ~v[0],
    "and": lambda v: v[0] & v[1],
    "clear": lambda v: v[0] & ~v[1],
    "or": lambda v: v[0] | v[1],
    "add": lambda v: v[0] + v[1],
    "subtract": lambda v: v[0] - v[1],
    "left": lambda v: v[0] << min(v[1] & 0xFF, 32),
    "right": lambda v: v[0] >> min(v[1] & 0xFF, 32),
}

_OTHER = BitStep("other")
_NOTHING = BitStep("nothing", 16)


@lru_cache(maxsize=_BLOCKS)
def _steps_of(code: bytes) -> tuple[BitStep, ...]:
    found, at = [], 0
    while at + 2 <= len(code):
        word = int.from_bytes(code[at : at + 2], "little")
        table, at = _NARROW, at + 2
        if word >= _FIRST_WIDE:
            word = word << 16 | int.from_bytes(code[at : at + 2], "little")
            table, at = _WIDE, at + 2
        make = next((make for mask, value, make in table if word & mask == value), None)
        found.append(_OTHER if make is None else make(word))
    return tuple(found)


def _narrow_pair(word: int) -> BitStep:
    """Data processing on two low registers (A5.2.2)."""
    name = _NARROW_PAIRS.get(word >> 6 & 15, "unknown")
    low, middle = word & 7, word >> 3 & 7
    return _NOTHING if name == "nothing" else BitStep(name, low, (middle,) if name == "not" else (low, middle))


def _narrow_shift(name: str) -> Callable[[int], BitStep]:
    return lambda word: BitStep(name, word & 7, (word >> 3 & 7,), word >> 6 & 31 or 32)


def _narrow_sum(word: int) -> BitStep:
    name, low, middle, third = "subtract" if word & 0x200 else "add", word & 7, word >> 3 & 7, word >> 6 & 7
    return BitStep(name, low, (middle,), third) if word & 0x400 else BitStep(name, low, (middle, third))


def _narrow_constant(name: str) -> Callable[[int], BitStep]:
    return lambda word: BitStep(name, word >> 8 & 7, (word >> 8 & 7,) if name != "move" else (), word & 0xFF)


#: 16-bit data processing by bits 9 to 6; what is missing writes a register.
_NARROW_PAIRS = {0: "and", 2: "left", 3: "right", 8: "nothing", 10: "nothing", 11: "nothing", 12: "or", 14: "clear",
                 15: "not"}  # fmt: skip
#: Mask, value, what it is; the first match wins, and what is not found may do anything (A5.2).
_NARROW: tuple[tuple[int, int, Callable[[int], BitStep]], ...] = (
    (0xFFC0, 0x0000, lambda w: BitStep("move", w & 7, (w >> 3 & 7,))),
    (0xF800, 0x0000, _narrow_shift("left")),
    (0xF800, 0x0800, _narrow_shift("right")),
    (0xF800, 0x1000, lambda w: BitStep("unknown", w & 7)),
    (0xF800, 0x1800, _narrow_sum),
    (0xF800, 0x2000, _narrow_constant("move")),
    (0xF800, 0x2800, lambda _: _NOTHING),
    (0xF800, 0x3000, _narrow_constant("add")),
    (0xF800, 0x3800, _narrow_constant("subtract")),
    (0xFC00, 0x4000, _narrow_pair),
    (0xFF00, 0x4600, lambda w: BitStep("move", w & 7 | w >> 4 & 8, (w >> 3 & 15,))),
    (0xF800, 0x4800, lambda w: BitStep("unknown", w >> 8 & 7)),
    (0xF800, 0x6000, lambda w: BitStep("store", 16, (w & 7, w >> 3 & 7), 4 * (w >> 6 & 31))),
    (0xF800, 0x6800, lambda w: BitStep("load", w & 7, (w >> 3 & 7,), 4 * (w >> 6 & 31))),
    (0xE800, 0x6000, lambda _: _NOTHING),  # STRB
    (0xE800, 0x6800, lambda w: BitStep("unknown", w & 7)),  # LDRB
    (0xF800, 0x8000, lambda _: _NOTHING),  # STRH
    (0xF800, 0x8800, lambda w: BitStep("unknown", w & 7)),  # LDRH
    (0xF800, 0x9000, lambda w: BitStep("store", 16, (w >> 8 & 7, 13), 4 * (w & 0xFF))),
    (0xF800, 0x9800, lambda w: BitStep("load", w >> 8 & 7, (13,), 4 * (w & 0xFF))),
)


def _pair(word: int, second: tuple[int, ...], constant: int | None) -> BitStep:
    """Data processing of a register and a second one or a constant (A5.3.1, A5.3.11)."""
    name, base, target = _WIDE_PAIRS.get(word >> 21 & 15, "unknown"), word >> 16 & 15, word >> 8 & 15
    if target == _PC:
        return _NOTHING
    if base == _PC and name in {"or", "not"}:
        return BitStep("move" if name == "or" else "not", target, second, constant)
    return BitStep("unknown", target) if name == "not" else BitStep(name, target, (base, *second), constant)


def _shifted(word: int) -> BitStep:
    """Data processing whose second register may be shifted."""
    amount, target = word >> 10 & 0x1C | word >> 6 & 3, word >> 8 & 15
    if word & 0x70F0 == 0:
        return _pair(word, (word & 15,), None)
    if word & 0x01EF_0020 == 0x004F_0000:
        return BitStep("right" if word & 0x10 else "left", target, (word & 15,), amount or 32)
    return _NOTHING if target == _PC else BitStep("unknown", target)


def _insert(word: int) -> BitStep:
    """BFI and BFC: bits from `low` to `top` are new."""
    low, top = word >> 10 & 0x1C | word >> 6 & 3, word & 31
    return BitStep("insert", word >> 8 & 15, (), (2 << top) - (1 << low))


def _move_wide(word: int) -> BitStep:
    high = (word >> 16 & 15) << 12 | (word >> 26 & 1) << 11
    return BitStep("move", word >> 8 & 15, (), high | (word >> 12 & 7) << 8 | word & 0xFF)


def _unknown(word: int) -> BitStep:
    return BitStep("unknown", word >> 8 & 15)


#: 32-bit data processing by bits 24 to 21 of the pair; what is missing writes a register.
_WIDE_PAIRS = {0: "and", 1: "clear", 2: "or", 3: "not", 8: "add", 13: "subtract"}
#: As `_NARROW`, of both halfwords (A5.3).
_WIDE: tuple[tuple[int, int, Callable[[int], BitStep]], ...] = (
    (0xFFF0_0000, 0xF8D0_0000, lambda w: BitStep("load", w >> 12 & 15, (w >> 16 & 15,), w & 0xFFF)),
    (0xFFF0_0000, 0xF8C0_0000, lambda w: BitStep("store", 16, (w >> 12 & 15, w >> 16 & 15), w & 0xFFF)),
    (0xFF90_0000, 0xF890_0000, lambda w: BitStep("unknown", w >> 12 & 15)),
    (0xFF90_0FC0, 0xF810_0000, lambda w: BitStep("unknown", w >> 12 & 15)),
    (0xFBF0_8000, 0xF240_0000, _move_wide),
    (0xFBF0_8000, 0xF2C0_0000, _unknown),  # MOVT
    (0xFFF0_8020, 0xF360_0000, _insert),
    (0xFB40_8000, 0xF340_0000, _unknown),  # bit fields
    (0xFFE0_F0F0, 0xFA00_F000, lambda w: BitStep("left", w >> 8 & 15, (w >> 16 & 15, w & 15))),
    (0xFFE0_F0F0, 0xFA20_F000, lambda w: BitStep("right", w >> 8 & 15, (w >> 16 & 15, w & 15))),
    (0xFF00_0000, 0xFA00_0000, _unknown),  # other shifts, extensions, CLZ, RBIT
    (0xFF80_0000, 0xFB00_0000, _unknown),  # MUL, MLA
    (0xFA00_8000, 0xF000_0000, lambda w: _pair(w, (), _expanded(w))),
    (0xFE00_0000, 0xEA00_0000, _shifted),
)


def _expanded(word: int) -> int:
    """Return the constant of a 32-bit instruction (ThumbExpandImm, A5.3.2)."""
    code = (word >> 26 & 1) << 11 | (word >> 12 & 7) << 8 | word & 0xFF
    byte = code & 0xFF
    if code >> 10 == 0:
        return byte * (1, 0x0001_0001, 0x0100_0100, 0x0101_0101)[code >> 8 & 3]
    value, turn = 0x80 | code & 0x7F, code >> 7
    return (value >> turn | value << 32 - turn) & _WORD
