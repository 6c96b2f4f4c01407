"""Wrong circuits, drawn by rule and seed: what the checks of the board must notice.

A mutant changes the circuit (`BoardDesign`), never a file. The committed list
`mutants.txt` was drawn from the circuit as it stood before the checks of this package were written;
it is kept, so that a check cannot choose its own faults. A line of it is a name and
the edits that make the fault.

Invariant: `apply` changes nothing but what the edits name.
"""

import dataclasses
import random
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from hardware.pcb.circuit.netlist import BoardDesign, Component, DesignError
from hardware.pcb.circuit.parts import PARTS
from hardware.pcb.proof.expected import ALIKE

#: The committed list.
LIST = Path(__file__).parent / "mutants.txt"
#: Net of an edit that leaves a pin open.
OPEN = "-"


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardMutant:
    """One wrong circuit: rule, name, edits.

    An edit is a word and what it acts on: `net U5.13 TXD` moves a pin (`-`: open), `swap U5.13 U5.12` exchanges
    the nets of two pins, `join TXD RXD` makes one net of two, `value C3 C 100n` fits another part of the catalogue,
    `drop R62` leaves a part out.
    """

    rule: str
    name: str
    edits: tuple[str, ...]

    def __str__(self) -> str:
        """Return its line of the list."""
        return f"{self.rule}\t{self.name}\t{'; '.join(self.edits)}"

    def touches(self) -> frozenset[str]:
        """Return the references, pins and nets that its edits name: a check that notices it must name one of them."""
        words = {word for edit in self.edits for word in edit.split()[1:]} - {OPEN, *PARTS}
        return frozenset(words | {word.split(".")[0] for word in words})


def load(file: Path = LIST) -> tuple[BoardMutant, ...]:
    """Return the committed list."""
    rows = [line.split("\t") for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return tuple(BoardMutant(rule=rule, name=name, edits=tuple(edits.split("; "))) for rule, name, edits in rows)


def apply(design: BoardDesign, mutant: BoardMutant) -> BoardDesign:
    """Return the wrong circuit.

    Raises:
        DesignError: An edit names a part, pin or net that the circuit does not have.
    """
    for edit in mutant.edits:
        verb, *words = edit.split(maxsplit=2)
        design = _EDITS[verb](design, *words)
    return design


def draw(design: BoardDesign, seed: int) -> tuple[BoardMutant, ...]:
    """Return faults of single pins, values and parts: each pin open, on another net and crossed, each net joined.

    The seed decides which other net, pin, value and part it is.
    """
    chance = random.Random(seed)
    nets, edits = design.nets(), list[str]()
    joined: dict[str | None, set[str]] = {net: {ref for ref, _ in members} for net, members in nets.items()}
    ends: list[tuple[str, str | None]]
    for net, members in nets.items():
        other = chance.choice([name for name in nets if name != net])
        edits.append(f"join {net} {other}")
        # A test point is one pin of its net, and none that a part works by.
        for pin in (_pin(member) for member in members if not member[0].startswith("TP")):
            edits += [f"net {pin} {OPEN}", f"net {pin} {other}"]
    for part in design.components:
        edits += [f"drop {part.ref}"] if part.pins else []
        if part.part.symbol == "R":
            # With another resistor's, where not both lead to one pin: whose they are nobody could tell.
            ends = [
                (f"{ref}.{pin}", net)
                for net, members in nets.items()
                if len(members) > 2
                for ref, pin in members
                if ref[:1] == "R" and ref != part.ref
            ]
        else:
            ends = [(f"{part.ref}.{pin}", net) for pin, net in part.pins if part.part.symbol not in ALIKE]
        for pin, own in part.pins:
            # Two pins that the same parts join are a capacitor's.
            others = [name for name, its in ends if its != own and joined.get(its) != joined.get(own)]
            edits += [f"swap {part.ref}.{pin} {chance.choice(others)}"] if others else []
        keys = [key for key, one in PARTS.items() if one.symbol == part.part.symbol and one is not part.part]
        edits += [f"value {part.ref} {chance.choice(keys)}"] if keys else []
    return tuple(BoardMutant(rule="drawn", name=edit, edits=(edit,)) for edit in edits)


def draw_whole(design: BoardDesign, seed: int) -> tuple[BoardMutant, ...]:
    """Return faults of whole parts: turned, mirrored, a pin further, exchanged with another, a net torn in two.

    Written when all checks stood, so no check was made for them.
    """
    chance = random.Random(seed)
    many = [part for part in design.components if len({net for _, net in part.pins}) > 2]
    found = [
        mutant
        for part in many
        for mutant in (
            _permuted(part, "turned by half", lambda number, count: (number + count // 2) % count),
            _permuted(part, "mirrored", lambda number, count: count - 1 - number),
            _permuted(part, "a pin further", lambda number, count: (number + 1) % count),
            _permuted(part, "with its rows exchanged", lambda number, count: min(number ^ 1, count - 1)),
        )
    ]
    groups: dict[str, list[Component]] = {}
    for part in design.components:
        groups.setdefault(part.part.footprint, []).append(part)
    for group in groups.values():
        unlike = [(one, two) for one in group for two in group if one.ref < two.ref and one.part is not two.part]
        for one, two in chance.sample(unlike, min(2, len(unlike))):
            edits = (f"value {one.ref} {two.part.key}", f"value {two.ref} {one.part.key}")
            found.append(BoardMutant(rule="whole", name=f"{one.ref} and {two.ref} exchanged", edits=edits))
    for net, members in design.nets().items():
        if len(members) > 3:
            torn = chance.sample(members, len(members) // 2)
            moves = tuple(f"net {_pin(member)} TORN" for member in torn)
            found.append(BoardMutant(rule="whole", name=f"{net} torn in two", edits=moves))
    chance.shuffle(found)
    return tuple(found)


def _permuted(part: Component, how: str, place: Callable[[int, int], int]) -> BoardMutant:
    """Give each pin the net of another one, by its place."""
    nets = [net for _, net in part.pins]
    edits = tuple(
        f"net {part.ref}.{pin} {nets[place(number, len(nets))] or OPEN}" for number, (pin, _) in enumerate(part.pins)
    )
    return BoardMutant(rule="whole", name=f"{part.ref} {how}", edits=edits)


def _pin(member: tuple[str, str]) -> str:
    return ".".join(member)


def _changed(design: BoardDesign, parts: Iterable[Component]) -> BoardDesign:
    return dataclasses.replace(design, components=tuple(parts))


def _with_nets(design: BoardDesign, nets: Mapping[str, str | None]) -> BoardDesign:
    """Return the design with other nets at some pins, which are named REF.PIN."""
    concerned = {name.split(".")[0] for name in nets}
    unknown = set(nets)
    parts = []
    for part in design.components:
        if part.ref in concerned:
            names = [(f"{part.ref}.{pin}", pin, net) for pin, net in part.pins]
            unknown -= {name for name, _, _ in names}
            part = dataclasses.replace(part, pins=tuple((pin, nets.get(name, net)) for name, pin, net in names))  # noqa: PLW2901
        parts.append(part)
    if unknown:
        raise DesignError(f"no pin {min(unknown)}")
    return _changed(design, parts)


def _move(design: BoardDesign, pin: str, net: str) -> BoardDesign:
    return _with_nets(design, {pin: None if net == OPEN else net})


def _exchange(design: BoardDesign, first: str, second: str) -> BoardDesign:
    nets = {f"{part.ref}.{pin}": net for part in design.components for pin, net in part.pins}
    if not {first, second} <= set(nets):
        raise DesignError(f"no pin {first} or {second}")
    return _with_nets(design, {first: nets[second], second: nets[first]})


def _join(design: BoardDesign, first: str, second: str) -> BoardDesign:
    nets = design.nets()
    if not {first, second} <= set(nets):
        raise DesignError(f"no net {first} or {second}")
    return _with_nets(design, {_pin(member): first for member in nets[second]})


def _value(design: BoardDesign, ref: str, key: str) -> BoardDesign:
    _known(design, ref)
    return _changed(
        design,
        (dataclasses.replace(part, part=PARTS[key]) if part.ref == ref else part for part in design.components),
    )


def _drop(design: BoardDesign, ref: str) -> BoardDesign:
    _known(design, ref)
    return _changed(design, (part for part in design.components if part.ref != ref))


def _known(design: BoardDesign, ref: str) -> None:
    if ref not in {part.ref for part in design.components}:
        raise DesignError(f"no part {ref}")


_EDITS: Mapping[str, Callable[..., BoardDesign]] = {
    "net": _move, "swap": _exchange, "join": _join, "value": _value, "drop": _drop,
}  # fmt: skip
