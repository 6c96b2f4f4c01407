"""A program's variables of static duration by name: where each stands, and what number its bytes are.

A name is written as GDB writes it: `speed`, `state.count`, `motors[1].duty`, `matrix[0][2]`; of a static in a function
`tick::count`, of a static that several files have `dodge.c::count`. Types come from the DWARF of an ELF, versions 2 to
5; of a program without it the symbols of 1, 2 and 4 bytes are unsigned numbers. Not read: variables in registers and on
the stack, and what a pointer points to (the pointer is a number).

Source: DWARF Debugging Information Format 5, sections 4.1 and 5.
Invariant: a `Variable` is one number inside of what the file says of it.
"""

import io
import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import lru_cache
from itertools import islice
from typing import Any, TypeAlias

from bluepill_sim.errors import ImageError
from bluepill_sim.program.elf_file import file_bytes
from bluepill_sim.program.image import ELF_MAGIC, Image, SymbolTable
from bluepill_sim.stm32f103 import SRAM_BYTES, is_in_sram
from simbase.errors import MissingDependencyError, UsageError, nearest, shown

_OP_ADDR, _OP_PLUS_UCONST = 0x03, 0x23
#: chosen: names that are offered at once; more than a list on a screen has.
MOST_OFFERED = 60
#: chosen: values of an enumeration that are named with its type.
MOST_VALUES = 12
_NO_SYMBOLS = "the program has no symbols: give its ELF, built with -g"
_STEP = re.compile(r"\.([A-Za-z_]\w*)|\[(\d{1,9})\]")
#: A struct holds others at most so deep; a damaged file may hold itself.
_DEEPEST = 16


class NumberForm(Enum):
    """What kind of number bytes are."""

    SIGNED = "signed"
    UNSIGNED = "unsigned"
    FLOAT = "float"


#: DW_ATE_… → what it is to a plot; others are unsigned.
_ENCODINGS = {4: NumberForm.FLOAT, 5: NumberForm.SIGNED, 6: NumberForm.SIGNED, 13: NumberForm.SIGNED}
_RECORDS = {"DW_TAG_structure_type": "struct", "DW_TAG_class_type": "struct", "DW_TAG_union_type": "union"}
_FLOATS = {4: "<f", 8: "<d"}


@dataclass(frozen=True, slots=True)
class _Number:
    """A type that is one number."""

    name: str
    size: int
    encoding: NumberForm
    #: Of a bit field: its lowest bit, counted from the first byte's, and how many it has; 0: it is none.
    first_bit: int = 0
    bits: int = 0
    #: Of an enumeration: what its values are called.
    values: str = ""


@dataclass(frozen=True, slots=True)
class _Record:
    """A struct or union: what it holds at which offset."""

    name: str
    size: int
    members: "Mapping[str, tuple[int, _Type]]"


@dataclass(frozen=True, slots=True)
class _Array:
    """So many of one type."""

    element: "_Type"
    count: int

    @property
    def name(self) -> str:
        """As C writes it, but for the order of several dimensions."""
        return f"{self.element.name}[{self.count}]"

    @property
    def size(self) -> int:
        """Bytes."""
        return self.element.size * self.count


_Type: TypeAlias = _Number | _Record | _Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """One number in the memory of a program."""

    #: As it was asked for.
    name: str
    #: As the program has it: `int16_t`, `enum mode`, `4 bytes`.
    type_name: str
    address: int
    size: int
    encoding: NumberForm
    first_bit: int = 0
    bits: int = 0

    def number(self, data: bytes) -> float:
        """Return what `size` bytes at its address are."""
        if self.encoding is NumberForm.FLOAT:
            return float(struct.unpack(_FLOATS[self.size], data)[0])
        value = int.from_bytes(data, "little")
        bits = self.bits or 8 * self.size
        value = value >> self.first_bit & (1 << bits) - 1
        is_negative = self.encoding is NumberForm.SIGNED and value >> bits - 1
        return float(value - (1 << bits) if is_negative else value)


@dataclass(frozen=True)
class VariableTable:
    """All variables of a program."""

    #: Name → address and type.
    roots: Mapping[str, tuple[int, _Type]] = field(default_factory=dict)
    #: Names that several files have → how each of them is written.
    ambiguous: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def variable(self, name: str) -> Variable:
        """Return the number that a name means.

        Raises:
            UsageError: There is none of that name, or it is a struct or an array; the hint says what there is.
        """
        address, found, steps = self.place(name)
        if not isinstance(found, _Number):
            parts = ", ".join(islice((leaf.name for leaf in _leaves(name.strip(), address, found)), 4))
            raise UsageError(f"{shown(name)} is a {shown(found.name)}, no number", hint=f"such as {parts}")
        if found.encoding is NumberForm.FLOAT and found.size not in _FLOATS:
            raise UsageError(f"{shown(name)} is a {found.name} of {found.size} bytes", hint="float or double is read")
        return _variable(steps, address, found)

    def place(self, name: str) -> "tuple[int, _Type, str]":
        """Return where a name's bytes are, their type, and the name without spaces around it.

        Raises:
            UsageError: There is none of that name.
        """
        name = name.strip()
        root = re.match(r"[^.\[]+(?:\.[A-Za-z]+(?=::)[^.\[]*)?", name)
        begun = "" if root is None else root[0]
        begun, name = self._with_scope(begun, name)
        if begun in self.ambiguous:
            raise UsageError(f"several files have a variable {shown(begun)}", hint=" or ".join(self.ambiguous[begun]))
        if begun not in self.roots:
            hint = nearest(begun, self.roots) if self.roots else _NO_SYMBOLS
            raise UsageError(f"there is no variable {shown(begun or name)}", hint=hint)
        address, found = self.roots[begun]
        at = len(begun)
        while at < len(name):
            step = _STEP.match(name, at)
            if step is None:
                raise UsageError(f"{shown(name)} is no name of a variable", hint="such as state.count or values[2]")
            address, found = _entered(name[:at], address, found, step)
            at = step.end()
        return address, found, name

    def _with_scope(self, begun: str, name: str) -> tuple[str, str]:
        """Return a name with what stands before it, where one function, file or namespace alone has it."""
        if begun not in self.roots and begun not in self.ambiguous:
            inner = [root for root in self.roots if root.endswith(f"::{begun}")]
            match inner:
                case [whole]:
                    return whole, whole + name.removeprefix(begun)
        return begun, name

    def offered(self, begun: str, most: int = MOST_OFFERED) -> list[str]:
        """Return names of numbers in SRAM that begin so, or else that have it in them, in the order of names."""
        begun = begun.strip()
        names = [leaf for root, (address, found) in sorted(self.roots.items())
                 if is_in_sram(address)
                 for leaf in islice((one.name for one in _leaves(root, address, found)), SRAM_BYTES)
                 if leaf.startswith(begun)]  # fmt: skip
        if not names:
            names = [leaf.name for root, (address, found) in sorted(self.roots.items())
                     if is_in_sram(address)
                     for leaf in islice(_leaves(root, address, found), SRAM_BYTES)
                     if begun.lower() in leaf.name.lower()]  # fmt: skip
        return names[:most]


def _variable(name: str, address: int, found: _Number) -> Variable:
    type_name = f"{found.name}: {found.values}" if found.values else found.name
    return Variable(
        name=name, type_name=type_name, address=address, size=found.size, encoding=found.encoding,
        first_bit=found.first_bit, bits=found.bits,
    )  # fmt: skip


def _entered(name: str, address: int, found: _Type, step: re.Match[str]) -> tuple[int, _Type]:
    """Return a member of a struct, or an element of an array."""
    if step[1] is not None:
        if not isinstance(found, _Record):
            raise UsageError(f"{shown(name)} is a {shown(found.name)}, no struct", hint=f"without {step[0]}")
        if step[1] not in found.members:
            raise UsageError(f"{shown(name)} has no {step[1]}", hint=nearest(step[1], found.members))
        offset, member = found.members[step[1]]
        return address + offset, member
    if not isinstance(found, _Array):
        raise UsageError(f"{shown(name)} is a {shown(found.name)}, no array", hint=f"without {step[0]}")
    index = int(step[2])
    if index >= found.count:
        raise UsageError(f"{shown(name)} has {found.count} elements", hint=f"[0] to [{found.count - 1}]")
    return address + index * found.element.size, found.element


def _leaves(name: str, address: int, found: _Type) -> Iterator[Variable]:
    if isinstance(found, _Number):
        if found.encoding is not NumberForm.FLOAT or found.size in _FLOATS:
            yield _variable(name, address, found)
    elif isinstance(found, _Record):
        for member, (offset, of) in found.members.items():
            yield from _leaves(f"{name}.{member}", address + offset, of)
    else:
        for index in range(found.count):
            yield from _leaves(f"{name}[{index}]", address + index * found.element.size, found.element)


def read_variables(image: Image) -> VariableTable:
    """Return the variables of a program; none of HEX and BIN.

    Raises:
        ImageError: the file is gone, or its debug information is damaged.
        MissingDependencyError: pyelftools is not installed.
    """
    data = file_bytes(image)
    if not data.startswith(ELF_MAGIC):
        return VariableTable()
    try:
        from elftools.common.exceptions import DWARFError, ELFError
        from elftools.construct.core import ConstructError
    except ImportError as error:
        raise MissingDependencyError(f"variables need pyelftools: {error}", extra="sim") from error
    try:
        return _table_of(data, image.symbols)
    except (
        ELFError, DWARFError, ConstructError, KeyError, ValueError, IndexError, AttributeError, TypeError,
        RecursionError,
    ) as error:  # fmt: skip
        # pyelftools has no one error for a damaged file.
        raise ImageError(f"{image.name}: the debug information is damaged: {error}", hint="build it again") from error


@lru_cache(maxsize=4)  # of one program it is asked for by each run, page and halt: some 100 ms each
def _table_of(elf_bytes: bytes, symbols: SymbolTable) -> VariableTable:
    from elftools.elf.elffile import ELFFile

    found: dict[str, dict[str, tuple[int, _Type]]] = {}
    elf = ELFFile(io.BytesIO(elf_bytes))
    if elf.has_dwarf_info():
        for unit in elf.get_dwarf_info().iter_CUs():
            top = unit.get_top_DIE()
            _Unit(_name_of(top).replace("\\", "/").rsplit("/", 1)[-1], found).read(top, "")
    return _named(found, symbols)


def _named(found: dict[str, dict[str, tuple[int, _Type]]], symbols: SymbolTable) -> VariableTable:
    """Return the table of variables by name and file; what the symbols have beyond them is numbers without a type."""
    roots: dict[str, tuple[int, _Type]] = {}
    ambiguous: dict[str, tuple[str, ...]] = {}
    for name, files in found.items():
        addresses = {address for address, _ in files.values()}
        if len(addresses) == 1:
            roots[name] = next(iter(files.values()))
            continue
        ambiguous[name] = tuple(f"{file}::{name}" for file in sorted(files))
        roots |= {f"{file}::{name}": place for file, place in files.items()}
    known = {address for address, _ in roots.values()}
    for symbol in symbols.symbols:
        if symbol.size in {1, 2, 4} and not symbol.is_function and symbol.address not in known:
            plural = "" if symbol.size == 1 else "s"
            number = _Number(f"{symbol.size} byte{plural}", symbol.size, NumberForm.UNSIGNED)
            roots.setdefault(symbol.name, (symbol.address, number))
    return VariableTable(roots, ambiguous)


class _Unit:
    """Reads the variables of one compilation unit."""

    def __init__(self, file: str, found: dict[str, dict[str, tuple[int, _Type]]]) -> None:
        self._file, self._found = file, found
        self._types: dict[int, _Type] = {}

    def read(self, die: Any, scope: str) -> None:  # pyelftools has no types
        """Take the variables below an entry, whose names begin with its scope."""
        for child in die.iter_children():
            if child.tag == "DW_TAG_variable":
                self._take(child, scope)
            elif child.tag in {"DW_TAG_namespace", "DW_TAG_subprogram"}:
                name = _name_of(_origin(child))
                self.read(child, f"{scope}{name}::" if name else scope)
            elif child.tag == "DW_TAG_lexical_block":
                self.read(child, scope)

    def _take(self, die: Any, scope: str) -> None:
        location = die.attributes.get("DW_AT_location")
        block = None if location is None else location.value
        if not isinstance(block, list) or len(block) != 5 or block[0] != _OP_ADDR:
            return
        about = _origin(die)
        name, typed = _name_of(about), about if "DW_AT_type" in about.attributes else die
        if not name or "DW_AT_type" not in typed.attributes:
            return
        found = self._type(typed.get_DIE_from_attribute("DW_AT_type"))
        if found is None:
            return
        address = int.from_bytes(bytes(block[1:]), "little")
        if about is not die:
            scope = _scope_of(about) or scope
        files = self._found.setdefault(f"{scope}{name}", {})
        files[self._file] = address, found

    def _type(self, die: Any, depth: int = 0) -> _Type | None:
        """Return a type; None of what has no size or is no data."""
        if die.offset not in self._types:
            made = None if depth > _DEEPEST else self._made(die, depth)
            if made is None:
                return None
            self._types[die.offset] = made
        return self._types[die.offset]

    def _made(self, die: Any, depth: int) -> _Type | None:
        tag, size = die.tag, _constant(die, "DW_AT_byte_size")
        if tag in {"DW_TAG_typedef", "DW_TAG_const_type", "DW_TAG_volatile_type", "DW_TAG_atomic_type"}:
            found = self._type(die.get_DIE_from_attribute("DW_AT_type"), depth + 1) if _has_type(die) else None
            return _renamed(found, _name_of(die)) if tag == "DW_TAG_typedef" else found
        if tag == "DW_TAG_array_type":
            return self._array(die, depth) if _has_type(die) else None
        if tag in _RECORDS:
            return _Record(f"{_RECORDS[tag]} {_name_of(die)}".strip(), size, dict(self._members(die, depth)))
        return _number_of(die, size)

    def _array(self, die: Any, depth: int) -> _Type | None:
        found = self._type(die.get_DIE_from_attribute("DW_AT_type"), depth + 1)
        counts = [_count_of(child) for child in die.iter_children() if child.tag == "DW_TAG_subrange_type"]
        for count in reversed(counts):
            found = None if found is None else _Array(found, count)
        return found

    def _members(self, die: Any, depth: int) -> Iterator[tuple[str, tuple[int, _Type]]]:
        for child in die.iter_children():
            is_data = child.tag in {"DW_TAG_member", "DW_TAG_inheritance"} and _has_type(child)
            found = self._type(child.get_DIE_from_attribute("DW_AT_type"), depth + 1) if is_data else None
            if found is None:
                continue
            offset, name = _offset_of(child), _name_of(child)
            bits = _constant(child, "DW_AT_bit_size")
            if bits and isinstance(found, _Number):
                offset, found = _bit_field(child, offset, found, bits)
            if name:
                yield name, (offset, found)
            elif isinstance(found, _Record):  # what a struct without a name, or the base of a class, holds
                yield from ((inner, (offset + at, of)) for inner, (at, of) in found.members.items())


def _offset_of(die: Any) -> int:
    """Return where in its struct a member stands; DWARF 2 has an expression, DW_OP_plus_uconst and a LEB128."""
    attribute = die.attributes.get("DW_AT_data_member_location")
    if attribute is None or not isinstance(attribute.value, list):
        return _constant(die, "DW_AT_data_member_location")
    operation, *digits = attribute.value
    if operation != _OP_PLUS_UCONST:
        raise ValueError("a member whose place is computed")
    return sum((digit & 0x7F) << 7 * place for place, digit in enumerate(digits))


def _number_of(die: Any, size: int) -> _Number | None:
    if die.tag == "DW_TAG_base_type":
        return _Number(_name_of(die), size, _ENCODINGS.get(_constant(die, "DW_AT_encoding"), NumberForm.UNSIGNED))
    if die.tag == "DW_TAG_enumeration_type":
        return _enumeration(die, size)
    if die.tag in {"DW_TAG_pointer_type", "DW_TAG_reference_type"}:
        return _Number("pointer", size or 4, NumberForm.UNSIGNED)
    return None


def _bit_field(die: Any, offset: int, found: _Number, bits: int) -> tuple[int, _Number]:
    """Return where a bit field's bytes begin, and the field in them."""
    if "DW_AT_data_bit_offset" in die.attributes:
        first = _constant(die, "DW_AT_data_bit_offset")
        offset = first // 8
    elif "DW_AT_bit_offset" in die.attributes:  # DWARF 2 and 3 count from the highest bit of its storage
        unit = _constant(die, "DW_AT_byte_size") or found.size
        first = 8 * unit - _constant(die, "DW_AT_bit_offset") - bits
        offset += first // 8
    else:
        first = 0
    size = (first % 8 + bits + 7) // 8
    return offset, replace(found, name=f"{found.name}:{bits}", size=size, first_bit=first % 8, bits=bits)


def _renamed(found: _Type | None, name: str) -> _Type | None:
    if found is None or isinstance(found, _Array):
        return found
    return replace(found, name=name)


def _enumeration(die: Any, size: int) -> _Number:
    rows = [(_constant(child, "DW_AT_const_value"), _name_of(child))
            for child in die.iter_children() if child.tag == "DW_TAG_enumerator"]  # fmt: skip
    is_signed = any(value < 0 for value, _ in rows)
    values = ", ".join(f"{value} {name}" for value, name in rows[:MOST_VALUES])
    return _Number(
        f"enum {_name_of(die)}".strip(), size, NumberForm.SIGNED if is_signed else NumberForm.UNSIGNED, values=values
    )


def _count_of(die: Any) -> int:
    if "DW_AT_count" in die.attributes:
        return _constant(die, "DW_AT_count")
    return _constant(die, "DW_AT_upper_bound", -1) + 1


def _constant(die: Any, name: str, default: int = 0) -> int:
    """Return an attribute that is a number; those that are computed while the program runs are none."""
    value = die.attributes[name].value if name in die.attributes else default
    return value if isinstance(value, int) else default


def _has_type(die: Any) -> bool:
    return "DW_AT_type" in die.attributes


def _name_of(die: Any) -> str:
    value = die.attributes["DW_AT_name"].value if "DW_AT_name" in die.attributes else b""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _origin(die: Any) -> Any:
    """Return the entry that names what another one defines."""
    for name in ("DW_AT_specification", "DW_AT_abstract_origin"):
        if name in die.attributes:
            return die.get_DIE_from_attribute(name)
    return die


def _scope_of(die: Any) -> str:
    """Return what stands before a name that was declared inside of a namespace or a class."""
    names, parent = list[str](), die.get_parent()
    while parent is not None and parent.tag != "DW_TAG_compile_unit":
        if name := _name_of(parent):
            names.append(name)
        parent = parent.get_parent()
    return "".join(f"{name}::" for name in reversed(names))
