"""Registers as declarations, and the base of every peripheral: a table of them, executed.

This is not a bus: whether a peripheral's clock is on, bit-band, and addresses
outside the peripherals are the business of `chip.py`.

Theory of operation. A `Register` says which bits store, which clear, which
method a read or write calls, and where its fields are. That is written here once:
Python (`masks`, `indices`), C and docs (`tools/generators/chip.py`) and the views take
it from there. A `Peripheral` declares `REGISTERS`, names in `STATE` its plain
attributes beyond the registers, and writes methods for what a
read or write *causes*. A hot one is a kind of device in C (`KIND`): what a register
that says `NATIVE` causes is written there, once, and what it holds beside the
registers is the struct `HOLDS`. The table itself is executed by the native core
too (`native/registers.py` hands it over). A peripheral that acts by itself keeps
the time of its next action in `due_ns`, a slot of the chip's queue; accesses catch
up to that time first, so that a register never reads older than the instruction
that asks.

Source: RM0008 section 2.1 (abbreviations for registers); 3.1: an APB bridge
turns a byte or halfword write into a word by duplicating the data, AHB
peripherals have byte lanes.
Invariant: a stored word never holds a bit outside `readable`, so that
`words[offset // 4]` of a register without `on_read` is what a read returns.
"""

import ctypes
import re
from array import array
from collections import Counter
from collections.abc import Iterable
from dataclasses import InitVar, dataclass
from enum import IntEnum
from functools import cache
from itertools import pairwise
from typing import Any, ClassVar

from bluepill_sim.extension.layout import Struct, structure
from bluepill_sim.fabric.fabric import OWN_COMMANDS, RESUMED, SETTLE, STOPPED
from bluepill_sim.fabric.ports import ChipPorts
from simbase.state import Stateful

#: In place of a method's name: the device's file in C does it.
NATIVE = "native"
#: The kind of a device in Python that has `INPUTS`, or listens to pins: `source/devices/listener.c`.
LISTENER = "listener"
#: What it is told first (the other is pins); what a kind tells besides begins at `OWN_ANSWERS`. And its command.
HEARS_LINE, OWN_ANSWERS, _LISTEN = 0, 2, OWN_COMMANDS
#: The registers of RCC with a clock gate a bit, by their numbers in C.
_GATES = ("AHBENR", "APB2ENR", "APB1ENR")
#: Every bit of a 32-bit register.
WORD = 0xFFFF_FFFF
_AS_MASK = _AS_FIELDS = -1
_WORD_BITS = 32
#: An entry of `Register.fields`: its name, its highest and its lowest bit.
_FIELD = re.compile(r"(\w+) (\d+)(?::(\d+))?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Register:
    """One register of a peripheral, as the reference manual tabulates it."""

    #: The manual's name without the peripheral's, such as "CRL".
    name: str
    #: Byte offset from the peripheral's base, a multiple of 4.
    offset: int
    #: Value after reset, as it reads.
    reset: int = 0
    #: Its bits, where the next two do not say otherwise; left out, those of `fields`, or all where it names none.
    mask: InitVar[int] = _AS_FIELDS
    #: Bits that read as stored; all others read 0.
    readable: int = _AS_MASK
    #: Bits that take the value written (r/w). Bits that are writable but not readable are seen by `on_write` only.
    writable: int = _AS_MASK
    #: Bits cleared by writing 1 and left alone by 0 (rc_w1).
    write_one_to_clear: int = 0
    #: Bits cleared by writing 0 and left alone by 1 (rc_w0).
    write_zero_to_clear: int = 0
    #: Bits that read 0, store nothing and make `on_write` act (w), such as those that clear flags elsewhere.
    triggers: int = 0
    #: Name of the peripheral's method `() -> int` that answers a read in place of the stored word; or `NATIVE`.
    on_read: str | None = None
    #: The hidden word, of `Peripheral.HIDDEN`, in which each read leaves what it returned; None for none.
    latched_in: str | None = None
    #: Name of the peripheral's method `(written: int, previous: int) -> None`, called after the store; or `NATIVE`.
    on_write: str | None = None
    #: Its fields as the manual names them, in any order: "CKD 9:8, ARPE 7". Every bit that reads is of one of them.
    fields: str = ""
    #: One line for people.
    doc: str = ""

    def __post_init__(self, mask: int) -> None:
        """Fill in the mask, and refuse a declaration that contradicts itself.

        Raises:
            ValueError: A mask is wider than a word, two kinds of bits overlap, a trigger does more, the reset value
                holds bits that do not read, what it stores is never read, or `fields` is no list of fields that has
                each bit that reads once.
        """
        fields = self._bits_of_fields()
        for name in ("readable", "writable"):
            if getattr(self, name) == _AS_MASK:
                object.__setattr__(self, name, fields if mask == _AS_FIELDS else mask)
        if self.offset % 4:
            raise ValueError(f"{self.name}: offset {self.offset:#x} is not that of a word")
        for word in (
            self.reset,
            self.readable,
            self.writable,
            self.write_one_to_clear,
            self.write_zero_to_clear,
            self.triggers,
        ):
            if word & ~WORD:
                raise ValueError(f"{self.name}: {word:#x} is wider than a word")
        clears = self.write_one_to_clear | self.write_zero_to_clear
        if self.write_one_to_clear & self.write_zero_to_clear or clears & self.writable:
            raise ValueError(f"{self.name}: a bit is either writable, cleared by 1 or cleared by 0")
        if self.triggers & (self.readable | self.writable | clears):
            raise ValueError(f"{self.name}: a trigger stores nothing and reads 0")
        if self.on_read not in {None, NATIVE} and not self.on_write and self.writable | clears:
            raise ValueError(f"{self.name}: a method answers reads, so that what is written would be lost")
        self._check_reading(fields)

    def _check_reading(self, fields: int) -> None:
        if self.reset & ~self.readable:
            raise ValueError(f"{self.name}: the reset value holds bits that do not read")
        if self.readable & ~fields:
            raise ValueError(f"{self.name}: bits {self.readable & ~fields:#x} read, and no field has them")
        if nameless := (self.writable | self.write_one_to_clear | self.write_zero_to_clear | self.triggers) & ~fields:
            raise ValueError(f"{self.name}: bits {nameless:#x} take what is written, and no field has them")

    def _bits_of_fields(self) -> int:
        """Return the bits that a field has; all of them where none is named."""
        try:
            return bits(*((field.high, field.low) for field in fields_of(self.fields))) if self.fields else WORD
        except ValueError as error:
            raise ValueError(f"{self.name}: {error}") from None

    @property
    def setting(self) -> int:
        """The bits whose 1 does something where no flag is up: those that take it, or all where only a method knows."""
        clears = self.write_one_to_clear | self.write_zero_to_clear
        return WORD if self.on_write and not self.writable | clears else self.writable

    @property
    def masks(self) -> tuple[int, int, int, int]:
        """The bits that a write keeps, takes, clears by 1 and clears by 0: what `stored_after` is made of."""
        return (
            self.readable & ~self.writable,
            self.readable & self.writable,
            self.write_one_to_clear,
            self.write_zero_to_clear,
        )

    def access(self, field: "BitField") -> str:
        """Return how a program may access a field, by the manual's words: rw, r, w, rc_w1, rc_w0 (RM0008 2.1).

        Where its bits differ, the words of the highest comes first; a bit that takes nothing and reads 0 is reserved.
        """
        found: dict[str, None] = {}
        for place in range(field.high, field.low - 1, -1):
            bit = 1 << place
            if self.write_one_to_clear & bit:
                found["rc_w1"] = None
            elif self.write_zero_to_clear & bit:
                found["rc_w0"] = None
            elif (self.setting | self.triggers) & bit:
                found["rw" if self.readable & bit else "w"] = None
            elif self.readable & bit or self.on_read:
                found["r"] = None
            else:
                found["reserved"] = None
        return "/".join(found)

    def widen(self, previous: int, value: int, lanes: int) -> int:
        """Return the whole-word write that does what a write of some byte lanes does.

        Args:
            previous: The stored word.
            value: The data, already shifted to its lanes.
            lanes: 0xFF for each byte lane written, 0 for the others.
        """
        untouched = (previous & self.writable) | self.write_zero_to_clear
        return (value & lanes) | (untouched & ~lanes)

    def stored_after(self, previous: int, written: int) -> int:
        """Return the word stored after `written` (a whole word) meets `previous`."""
        kept = previous & ~self.writable & ~(written & self.write_one_to_clear)
        kept &= written | ~self.write_zero_to_clear
        return (kept | (written & self.writable)) & self.readable


@dataclass(frozen=True, slots=True)
class BitField:
    """A named part of a register."""

    name: str
    high: int
    low: int

    def of(self, word: int) -> int:
        """Return its value in a register's word."""
        return word >> self.low & (1 << self.high - self.low + 1) - 1


@dataclass(frozen=True, slots=True)
class RegisterView:
    """A register of a peripheral as a person wants to see it."""

    name: str
    address: int
    #: What a read finds.
    word: int
    #: Name and value of each field, from the left.
    fields: tuple[tuple[str, int], ...]

    def __getitem__(self, field: str) -> int:
        """Return the value of a field.

        Raises:
            KeyError: The register has no such field.
        """
        return dict(self.fields)[field]

    def __str__(self) -> str:
        """Return the word and the fields that are not 0, on one line."""
        return " ".join(
            [f"{self.word:#010x} ", *(f"{name}={value:#x}" for name, value in self.fields if value)]
        ).rstrip()


def numbered(pattern: str, numbers: Iterable[int], width: int = 1, first: int = 0) -> str:
    """Return fields that differ by their numbers, `n`, and stand one behind the other, that of `first` at bit 0.

    >>> numbered("MRn", (1, 0))
    'MR1 1, MR0 0'
    """
    found = []
    for n in numbers:
        high, low = width * (n - first) + width - 1, width * (n - first)
        found.append(f"{pattern.replace('n', str(n))} {high if width == 1 else f'{high}:{low}'}")
    return ", ".join(found)


@cache
def fields_of(text: str) -> tuple[BitField, ...]:
    """Return the fields that `Register.fields` names, the highest first.

    Raises:
        ValueError: An entry is no field of a word, two have one name, or one bit.

    >>> fields_of("ARPE 7, CKD 9:8")[0].of(0x200)
    2
    """
    found = []
    for entry in filter(None, text.split(", ")):
        match = _FIELD.fullmatch(entry)
        if match is None:
            raise ValueError(f'no field: {entry!r} (hint: fields="CKD 9:8, ARPE 7")')
        name, high, low = match.groups()
        found.append(BitField(name, int(high), int(low or high)))
        if not _WORD_BITS > found[-1].high >= found[-1].low:
            raise ValueError(f"{entry}: no bits of a word, the highest first")
    found.sort(key=lambda field: -field.high)
    for higher, lower in pairwise(found):
        if lower.high >= higher.low:
            raise ValueError(f"fields {higher.name} and {lower.name} have bit {lower.high} both")
    twice = [name for name, times in Counter(field.name for field in found).items() if times > 1]
    if twice:
        raise ValueError(f"two fields are called {twice[0]}")
    return tuple(found)


def masks(fields: str, names: str) -> tuple[int, ...]:
    """Return the bits of some of the fields that `Register.fields` names, in the order of the names.

    Raises:
        KeyError: There is no such field.

    >>> masks("CKD 9:8, ARPE 7", "ARPE CKD")
    (128, 768)
    """
    found = {field.name: bits((field.high, field.low)) for field in fields_of(fields)}
    return tuple(found[name] for name in names.split())


def indices(registers: Iterable[Register], names: str) -> tuple[int, ...]:
    """Return where registers stand in `Peripheral.words`, which is offset // 4, in the order of the names.

    Raises:
        KeyError: There is no such register.
    """
    found = {register.name: register.offset // 4 for register in registers}
    return tuple(found[name] for name in names.split())


def bits(*positions: int | tuple[int, int]) -> int:
    """Return a mask of bit positions and of (high, low) fields, as the manual prints them.

    >>> hex(bits(0, (7, 4)))
    '0xf1'
    """
    mask = 0
    for position in positions:
        high, low = position if isinstance(position, tuple) else (position, position)
        mask |= ((1 << (high - low + 1)) - 1) << low
    return mask


@dataclass(frozen=True, slots=True)
class ClockBit:
    """The bit of an RCC enable register that clocks a peripheral; the reset bit has the same place."""

    #: "AHBENR", "APB1ENR" or "APB2ENR".
    register: str
    bit: int


@dataclass(frozen=True, slots=True, kw_only=True)
class PeripheralMapping:
    """Where one peripheral sits in the chip: a row of the chip's page."""

    name: str
    base: int
    #: None: always clocked.
    clock: ClockBit | None = None
    size: int = 0x400


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """What follows from a class of peripherals alone, the same for every chip; by offset // 4."""

    #: After a reset.
    words: bytes
    registers: tuple[Register | None, ...]
    masks: tuple[tuple[int, int, int, int], ...]
    #: Index of the hidden word that keeps what a read returned.
    latches: tuple[int | None, ...]
    #: Names of the methods that answer a read, and that follow a write; or `NATIVE`.
    reads: tuple[str | None, ...]
    writes: tuple[str | None, ...]
    #: Index and word of each after a reset, for C.
    initial: "ctypes.Array[ctypes.c_uint32]"
    #: Makes what a device in C holds beside the words.
    held: type[Any] | None


@cache
def _table_of(kind: type["Peripheral"], size: int) -> _Table:
    """Return the table of a class whose block has `size` bytes."""
    words = array("I", bytes(size))
    found: list[Register | None] = [None] * len(words)
    masks = [(0, 0, 0, 0)] * len(words)
    latches: list[int | None] = [None] * len(words)
    reads: list[str | None] = [None] * len(words)
    writes: list[str | None] = [None] * len(words)
    pairs: list[int] = []
    for register in kind.REGISTERS:
        index = register.offset // 4
        words[index], found[index], masks[index] = register.reset, register, register.masks
        latches[index] = kind.latch_of(register)
        reads[index], writes[index] = register.on_read, register.on_write
        pairs += index, register.reset
    return _Table(
        words=words.tobytes(),
        registers=tuple(found),
        masks=tuple(masks),
        latches=tuple(latches),
        reads=tuple(reads),
        writes=tuple(writes),
        initial=(ctypes.c_uint32 * len(pairs))(*pairs),
        held=None if kind.HOLDS is None else structure(kind.HOLDS),
    )


class Peripheral(Stateful):
    """A block of registers at an address of the chip."""

    STATE: ClassVar[tuple[str, ...]] = ("words", "held", "due_ns")
    DERIVED: ClassVar[tuple[str, ...]] = ("_due_ns", "duplicated")

    REGISTERS: ClassVar[tuple[Register, ...]] = ()
    #: Where the manual tabulates them: "RM0008 27.6".
    SOURCE: ClassVar[str] = ""
    #: Whether narrow writes touch only their bytes (AHB) or are duplicated over the word (APB).
    HAS_BYTE_LANES: ClassVar[bool] = False
    #: Its kind of device in C, and the struct that this holds beside the words; None: it is written in Python.
    KIND: ClassVar[str | None] = None
    HOLDS: ClassVar[Struct | None] = None
    #: Its outputs to lines, and of a device in C its inputs, in the order of their numbers: the chip's page wires them.
    OUTPUTS: ClassVar[tuple[str, ...]] = ()
    INPUTS: ClassVar[tuple[str, ...]] = ()
    #: Of a device in C: the words behind the last register, which no program reads, and the enumerations that it shares
    #: with Python, such as what it asks (`answer`) and its own commands, from `OWN_COMMANDS` on.
    HIDDEN: ClassVar[tuple[str, ...]] = ()
    ENUMS: ClassVar[tuple[type[IntEnum], ...]] = ()

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        self.chip = chip
        self.place = place
        self.name = place.name
        self.base = place.base
        self.fabric = chip.pins.fabric
        kind: Any = type(self)  # a class is hashable, whatever its instances are
        table = _table_of(kind, place.size)
        #: The stored words of the whole block, indexed by offset // 4; the object stays the same for ever.
        self.words = array("I", table.words)
        self._table = table
        self._due_ns: int | None = None
        #: The words, by offset // 4, of which it was warned that narrow writes are duplicated over them.
        self.duplicated: set[int] = set()
        #: What a device in C holds beside the words: the struct `HOLDS`.
        self.native: Any = None if table.held is None else table.held()
        #: Its place in the queue of events.
        self.slot = self._take_slot(table)
        if place.clock is not None:
            self.fabric.set_gate(self.slot, _GATES.index(place.clock.register), place.clock.bit)

    @classmethod
    def hidden(cls) -> dict[str, int]:
        """Return where the words `HIDDEN` stand, behind the last register: name and index."""
        first = 1 + max((register.offset // 4 for register in cls.REGISTERS), default=-1)
        return {name: first + n for n, name in enumerate(cls.HIDDEN)}

    @classmethod
    def latch_of(cls, register: Register) -> int | None:
        """Return the index of the word that keeps what a read of a register returned; None: none does."""
        return None if register.latched_in is None else cls.hidden()[register.latched_in]

    @property
    def due_ns(self) -> int | None:
        """When this peripheral next acts by itself, in ns; None for never."""
        return self._due_ns if self.KIND is None else self.fabric.due(self.slot)

    @due_ns.setter
    def due_ns(self, at_ns: int | None) -> None:
        self._due_ns = at_ns
        self.fabric.schedule(self.slot, at_ns)

    @property
    def held(self) -> bytes:
        """What a device in C holds, as bytes; none of one in Python."""
        return b"" if self.native is None else bytes(self.native)

    @held.setter
    def held(self, held: bytes) -> None:
        if self.native is not None:
            ctypes.memmove(ctypes.addressof(self.native), held, len(held))

    def set_output(self, name: str, level: bool) -> None:
        """Set one of `OUTPUTS`; nothing happens where the chip's page wires it to nothing."""
        self.fabric.set_output(self.slot, self.OUTPUTS.index(name), level)

    def command(self, what: int, one: int = 0, other: int = 0) -> int:
        """Have the device in C do something; return its answer."""
        return self.fabric.command(self.slot, what, one, other)

    def answer(self, what: int, value: int) -> int | None:
        """Answer what the device in C asks; None where it only notifies."""
        if what >= OWN_ANSWERS:
            raise NotImplementedError(f"{self.name} was asked {what}, {value}")
        if what == HEARS_LINE:
            self.line_changed(self.INPUTS[value >> 1], bool(value & 1))
        else:
            self.pins_changed()
        return None

    def listen_to_pins(self, port: str, pins: int) -> None:
        """Have a LISTENER's `pins_changed` called for inputs of these pins of a port, a bit each, from now on."""
        self.command(_LISTEN, self.chip.pins.PORTS.index(port), pins)

    def line_changed(self, name: str, level: bool) -> None:
        """Act on a new level of one of a LISTENER's `INPUTS`."""

    def pins_changed(self) -> None:
        """Act on new levels of the pins that a LISTENER listens to."""

    def deliver(self) -> None:
        """Take over the words that the device in C has sent."""

    def has_register(self, offset: int) -> bool:
        """Tell whether there is a register; else the word reads 0, and is warned of once."""
        return self._table.registers[offset >> 2] is not None

    def changes_reset_value(self, offset: int, value: int) -> bool:
        """Tell whether a write would set a bit that is 0 after a reset: more than a de-initialization does.

        Flags that a 1 clears are down after a reset, and reserved bits take nothing: those change nothing.
        """
        register = self._table.registers[offset >> 2]
        return register is None or bool(value << 8 * (offset & 3) & register.setting & ~register.reset)

    def read(self, offset: int, size: int) -> int:
        """Return what the bus reads.

        Args:
            offset: Byte offset from the base, aligned to `size`.
            size: 1, 2 or 4 bytes.
        """
        self._catch_up()
        index = offset >> 2
        table = self._table
        hook = table.reads[index]
        if hook is None:
            word = self.words[index]
            latch = table.latches[index]
            if latch is not None:
                self.words[latch] = word
            elif table.registers[index] is None:
                self._warn_no_register(offset, "read")
                return 0
        else:
            word = self.fabric.read(self.slot, index) if hook == NATIVE else getattr(self, hook)()
        if size == 4:
            return word
        return (word >> ((offset & 3) * 8)) & ((1 << (size * 8)) - 1)

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what the bus writes; arguments as of `read`."""
        self._catch_up()
        index = offset >> 2
        table = self._table
        register = table.registers[index]
        if register is None:
            self._warn_no_register(offset, "write")
            return
        previous = self.words[index]
        written = value if size == 4 else self._narrow(register, offset, size, value)
        kept, taken, one, zero = table.masks[index]
        self.words[index] = previous & kept & ~(written & one) & (written | ~zero) | written & taken
        hook = table.writes[index]
        if hook == NATIVE:
            self.fabric.write(self.slot, index, written, previous)
        elif hook is not None:
            getattr(self, hook)(written, previous)

    def look(self, offset: int) -> int:
        """Return what a read would find at an offset now, with nothing of what a read causes; 0 without a register."""
        index = offset >> 2
        hook = self._table.reads[index]
        if hook is None:
            return self.words[index]
        if hook == NATIVE:
            return self.fabric.command(self.slot, SETTLE, index)
        state = self.snapshot()
        try:
            word: int = getattr(self, hook)()
            return word
        finally:
            self.restore(state)

    def view(self) -> dict[str, RegisterView]:
        """Return its registers as a read would find them now, by name, in the order of their addresses."""
        found = {}
        for register in sorted(self.REGISTERS, key=lambda one: one.offset):
            word = self.look(register.offset)
            fields = tuple((field.name, field.of(word)) for field in fields_of(self.fields_now(register, word)))
            found[register.name] = RegisterView(register.name, self.base + register.offset, word, fields)
        return found

    def fields_now(self, register: Register, _word: int) -> str:
        """Return the fields of a register whose word is that, where they depend on it."""
        return register.fields

    def reset(self) -> None:
        """Go back to the state after a system reset."""
        if self.KIND is None:
            self.due_ns = None
            for register in self.REGISTERS:
                self.words[register.offset // 4] = register.reset
        else:
            self._due_ns = None
            self.fabric.reset_device(self.slot)
        self.on_reset()

    def on_reset(self) -> None:
        """Put back what is not a register; called by `reset` after the registers."""

    def backup_reset(self) -> None:
        """Go back to the state of a backup domain that had no power, or after BDRST of RCC_BDCR."""

    def advance_to(self, now_ns: int) -> None:
        """Act on everything due up to and including `now_ns`, in order of its time."""

    def clock_name(self) -> str | None:
        """Return the name, in `Clocks`, of the clock that a device in C counts; None: it counts none."""
        return None

    def clock_hz(self) -> int:
        """Return the frequency of that clock; 0: it counts none."""
        name = self.clock_name()
        return 0 if name is None else int(getattr(self.chip.clocks, name))

    def clock_changed(self) -> None:
        """Act on a change of the frequencies in `chip.clocks`, which has just happened; those in C know it already."""

    def clock_stopped(self) -> None:
        """Stand still, where the clock is one of the core's: Stop mode begins."""
        if self.KIND is not None:
            self.command(STOPPED)

    def clock_resumed(self, stopped_ns: int) -> None:
        """Go on after `stopped_ns`, from where `clock_stopped` was called."""
        if self.KIND is not None:
            self.command(RESUMED, stopped_ns & WORD, stopped_ns >> 32)

    def freeze(self) -> None:
        """Stand still while a debugger halts the core (DBGMCU_CR)."""
        self.clock_stopped()

    def thaw(self, frozen_ns: int) -> None:
        """Go on after `frozen_ns`, from where `freeze` was called."""
        self.clock_resumed(frozen_ns)

    def _take_slot(self, table: "_Table") -> int:
        if self.KIND is None:
            return self.fabric.add_slot(self.name, self.advance_to)
        words = ctypes.addressof((ctypes.c_uint32 * len(self.words)).from_buffer(self.words))
        state = 0 if self.native is None else ctypes.addressof(self.native)
        slot = self.fabric.add_device(
            self.name, self.KIND, words, state, act=self.advance_to, answer=self.answer, deliver=self.deliver
        )
        mine = type(self)
        is_whole = mine.reset is Peripheral.reset and mine.on_reset is Peripheral.on_reset
        self.fabric.set_initial(slot, table.initial, is_whole=is_whole)
        if (clock := self.clock_name()) is not None:
            self.fabric.set_clock(slot, clock)
        return slot

    def _catch_up(self) -> None:
        if self.KIND is not None:
            self.fabric.catch_up(self.slot, self.chip.now_ns)
        elif self._due_ns is not None and self.chip.now_ns >= self._due_ns:
            self.advance_to(self.chip.now_ns)

    def _narrow(self, register: Register, offset: int, size: int, value: int) -> int:
        """Return the word that the peripheral sees when the CPU writes 1 or 2 bytes."""
        shift = (offset & 3) * 8
        mask = (1 << (size * 8)) - 1
        previous = self.words[register.offset // 4]
        in_lanes = register.widen(previous, (value & mask) << shift, mask << shift)
        if self.HAS_BYTE_LANES:
            return in_lanes
        duplicated = (value & mask) * (0x0101_0101 if size == 1 else 0x0001_0001) & WORD
        if register.stored_after(previous, duplicated) != register.stored_after(previous, in_lanes):
            self.duplicated.add(register.offset >> 2)
            self.chip.warn(
                f"{self.name}_{register.name}: a {size * 8}-bit write is duplicated over the word by the APB bridge",
                once=f"{self.name}_{register.name}:narrow",
            )
        return duplicated

    def _warn_no_register(self, offset: int, what: str) -> None:
        self.chip.warn(
            f"{self.name}+{offset:#04x}: {what} of an address without a register",
            once=f"{self.name}+{offset & ~3:#04x}",
        )
