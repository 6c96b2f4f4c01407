"""Debug information as pyelftools shows it, made of a few words: entries of any kind, without a compiler."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count
from types import SimpleNamespace

_offsets = count(1)


@dataclass(eq=False)
class Die:
    """An entry: its tag without `DW_TAG_`, attributes without `DW_AT_`, and what is below it."""

    short: str
    given: Mapping[str, object] = field(default_factory=dict)
    children: tuple["Die", ...] = ()
    parent: "Die | None" = None
    offset: int = field(default_factory=lambda: next(_offsets))

    def __post_init__(self) -> None:
        for child in self.children:
            child.parent = self

    @property
    def tag(self) -> str:
        return f"DW_TAG_{self.short}"

    @property
    def attributes(self) -> dict[str, SimpleNamespace]:
        return {f"DW_AT_{name}": SimpleNamespace(value=value) for name, value in self.given.items()}

    def iter_children(self) -> Iterator["Die"]:
        return iter(self.children)

    def get_parent(self) -> "Die | None":
        return self.parent

    def get_DIE_from_attribute(self, name: str) -> "Die":  # noqa: N802 - as pyelftools calls it
        found = self.given[name.removeprefix("DW_AT_")]
        assert isinstance(found, Die)
        return found


def die(short: str, *children: Die, **given: object) -> Die:
    """Return an entry; names are bytes in the file."""
    return Die(short, {name: value.encode() if isinstance(value, str) else value for name, value in given.items()},
               children)  # fmt: skip


def place(address: int) -> list[int]:
    """Return DW_OP_addr."""
    return [3, *address.to_bytes(4, "little")]


@dataclass
class FakeElf:
    """What `ELFFile` would be of a file with these compilation units."""

    units: tuple[Die, ...]
    #: The line program of each of them.
    program: object = None

    def has_dwarf_info(self) -> bool:
        return bool(self.units)

    def line_program_for_CU(self, _unit: object) -> object:  # noqa: N802 - as pyelftools calls it
        return self.program

    def get_dwarf_info(self) -> "FakeElf":
        return self

    def iter_CUs(self) -> Iterator[SimpleNamespace]:  # noqa: N802 - as pyelftools calls it
        for unit in self.units:
            yield SimpleNamespace(get_top_DIE=lambda unit=unit: unit)
