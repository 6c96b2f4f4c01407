"""Wrong circuits, drawn by rule and seed: what the checks of the board must notice.

A mutant changes the circuit (`Design`), never a file. `draw` made the committed list
`mutants.txt` from the circuit as it stood before the checks of this package were written;
the list is kept, so that a check cannot choose its own faults. A line of it is a name and
the edits that make the fault.

Invariant: `apply` changes nothing but what the edits name.
"""

import dataclasses
import random
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from adapter_sim.pinout import Pull, load_pinout
from hardware.pcb.circuit.design import PULL_OFFSET, series_wires
from hardware.pcb.circuit.netlist import Component, Design, DesignError
from hardware.pcb.circuit.parts import PARTS

#: The committed list.
LIST = Path(__file__).parent / "mutants.txt"
#: Seed of the committed list.
SEED = 23
#: Net of an edit that leaves a pin open.
OPEN = "-"


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutant:
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


def load(file: Path = LIST) -> tuple[Mutant, ...]:
    """Return the committed list."""
    rows = [line.split("\t") for line in file.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return tuple(Mutant(rule=rule, name=name, edits=tuple(edits.split("; "))) for rule, name, edits in rows)


def apply(design: Design, mutant: Mutant) -> Design:
    """Return the wrong circuit.

    Raises:
        DesignError: An edit names a part, pin or net that the circuit does not have.
    """
    for edit in mutant.edits:
        verb, *words = edit.split(maxsplit=2)
        design = _EDITS[verb](design, *words)
    return design


def draw(design: Design, seed: int = SEED) -> tuple[Mutant, ...]:
    """Return a mutant for each net, polarised part, value and connector, and more of the resistor network and chips."""
    chance = random.Random(seed)
    found: list[Mutant] = []
    for rule in (_named, _nets, _polarised, _values, _connectors, _chips, _network, _left_out):
        found += [mutant for mutant in rule(design, chance) if mutant.edits not in {one.edits for one in found}]
    return tuple(found)


def draw_whole(design: Design, seed: int) -> tuple[Mutant, ...]:
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
            found.append(Mutant(rule="whole", name=f"{one.ref} and {two.ref} exchanged", edits=edits))
    for net, members in design.nets().items():
        if len(members) > 3:
            torn = chance.sample(members, len(members) // 2)
            moves = tuple(f"net {_pin(member)} TORN" for member in torn)
            found.append(Mutant(rule="whole", name=f"{net} torn in two", edits=moves))
    chance.shuffle(found)
    return tuple(found)


def _permuted(part: Component, how: str, place: Callable[[int, int], int]) -> Mutant:
    """Give each pin the net of another one, by its place."""
    nets = [net for _, net in part.pins]
    edits = tuple(
        f"net {part.ref}.{pin} {nets[place(number, len(nets))] or OPEN}" for number, (pin, _) in enumerate(part.pins)
    )
    return Mutant(rule="whole", name=f"{part.ref} {how}", edits=edits)


def _named(design: Design, chance: random.Random) -> list[Mutant]:
    """Return faults that a review found unnoticed."""
    _ = design, chance
    rows = {
        "C3 is 100 nF instead of 22 uF": ("value C3 C 100n",),
        "C4 is 100 nF instead of 22 uF": ("value C4 C 100n",),
        "Q1's emitter at the base's resistor": ("net Q1.2 RST_REQ",),
        "Q1's emitter at +3V3": ("net Q1.2 +3V3",),
        "D1 the wrong way round": ("swap D1.K D1.A",),
        "D5 the wrong way round": ("swap D5.K D5.A",),
        "the suppressor the wrong way round": ("swap D2.K D2.A",),
        "DTR not driven": ("net J3.4 -",),
        "TXD and RXD crossed at the transceiver": ("swap U5.11 U5.12",),
        "DE-9 pins 2 and 3 crossed": ("swap J3.2 J3.3",),
        "DD1 and DD2 crossed at their resistors": ("swap R1.2 R2.2",),
        "DD1 and DD2 crossed at the BluePill": ("swap U1.30 U1.29",),
        "the BluePill's 3V3 fed from 5 V": ("net U1.20 +5V",),
        "12 V on pin 7 of the plug reaches the board": ("net J3.7 +12V",),
    }
    return [Mutant(rule="named", name=name, edits=edits) for name, edits in rows.items()]


def _nets(design: Design, chance: random.Random) -> list[Mutant]:
    found, nets = [], design.nets()
    for net, members in nets.items():
        pin = _pin(chance.choice([member for member in members if not member[0].startswith("TP")]))
        other = chance.choice([name for name in nets if name != net])
        name, edit = chance.choice([
            (f"{pin} open", f"net {pin} {OPEN}"),
            (f"{pin} on {other}", f"net {pin} {other}"),
            (f"{net} joined with {other}", f"join {net} {other}"),
        ])  # fmt: skip
        found.append(Mutant(rule="net", name=name, edits=(edit,)))
    return found


def _polarised(design: Design, chance: random.Random) -> list[Mutant]:
    _ = chance
    return [
        _swap("polarity", f"{part.ref} the wrong way round", f"{part.ref}.{part.pins[0][0]}",
              f"{part.ref}.{part.pins[1][0]}")
        for part in design.components if part.part.symbol in {"SCHOTTKY", "LED", "TVS", "CP"}
    ]  # fmt: skip


def _values(design: Design, chance: random.Random) -> list[Mutant]:
    """Fit another value or type of the same kind to each part outside the network, and to four of the network."""
    kinds = {"R": ("R",), "C": ("C", "CP"), "CP": ("C",), "SCHOTTKY": ("SCHOTTKY", "TVS"), "TVS": ("SCHOTTKY",)}
    parts = [part for part in design.components if part.part.symbol in kinds]
    network = [part for part in parts if _is_network(part)]
    chosen = [part for part in parts if not _is_network(part)] + chance.sample(network, 4)
    found = []
    for part in chosen:
        keys = [key for key, other in PARTS.items() if other.symbol in kinds[part.part.symbol] and other != part.part]
        key = chance.choice(keys)
        found.append(Mutant(rule="value", name=f"{part.ref} is {key}", edits=(f"value {part.ref} {key}",)))
    return found


def _connectors(design: Design, chance: random.Random) -> list[Mutant]:
    found = []
    for part in design.components:
        if part.part.symbol in {"CONN2", "CONN3", "CONN10", "CONN24", "DE9"}:
            found += [_crossed("connector", part, chance) for _ in range(3 if len(part.pins) > 3 else 1)]
    return found


def _chips(design: Design, chance: random.Random) -> list[Mutant]:
    counts = {"BLUEPILL": 6, "ESP32_D1_MINI": 6, "MAX3232": 8, "REGULATOR3": 2, "NPN": 3, "HC595": 4}
    return [
        _crossed("chip", part, chance)
        for part in design.components
        for _ in range(counts.get(part.part.symbol, 0))
    ]  # fmt: skip


def _network(design: Design, chance: random.Random) -> list[Mutant]:
    """Cross neighbours of the series resistors; pull to the wrong rail, at the wrong end, or not at all."""
    _ = design
    wires = list(enumerate(series_wires(load_pinout()), start=1))
    found = []
    for index in chance.sample(range(1, len(wires)), 6):
        end = chance.choice("12")
        found.append(_swap("network", f"R{index} and R{index + 1} crossed at pin {end}", f"R{index}.{end}",
                           f"R{index + 1}.{end}"))  # fmt: skip
    pulls = [(index, f"R{index + PULL_OFFSET}") for index, wire in wires if wire.pull is Pull.DOWN]
    for _, ref in chance.sample(pulls, 3):
        found.append(Mutant(rule="network", name=f"{ref} pulls up", edits=(f"net {ref}.2 +3V3",)))
    for index, ref in chance.sample(pulls, 3):
        near = dict(design.component(f"R{index}").pins)["1"]
        found.append(Mutant(rule="network", name=f"{ref} before the resistor", edits=(f"net {ref}.1 {near}",)))
    for _, ref in chance.sample(pulls, 3):
        found.append(Mutant(rule="network", name=f"{ref} left out", edits=(f"drop {ref}",)))
    return found


def _left_out(design: Design, chance: random.Random) -> list[Mutant]:
    parts = [part for part in design.components if len(part.pins) == 2 and not _is_network(part)]
    return [
        Mutant(rule="left out", name=f"{part.ref} left out", edits=(f"drop {part.ref}",))
        for part in chance.sample(parts, 12)
    ]


def _is_network(part: Component) -> bool:
    return part.ref[:1] == "R" and int(part.ref[1:]) < 60


def _pin(member: tuple[str, str]) -> str:
    return ".".join(member)


def _swap(rule: str, name: str, first: str, second: str) -> Mutant:
    return Mutant(rule=rule, name=name, edits=(f"swap {first} {second}",))


def _crossed(rule: str, part: Component, chance: random.Random) -> Mutant:
    """Cross two pins of a part that are on different nets."""
    while True:
        (first, one), (second, two) = chance.sample(part.pins, 2)
        if one != two:
            return _swap(rule, f"{part.ref}.{first} and {part.ref}.{second} crossed", f"{part.ref}.{first}",
                         f"{part.ref}.{second}")  # fmt: skip


def _changed(design: Design, parts: Iterable[Component]) -> Design:
    return dataclasses.replace(design, components=tuple(parts))


def _with_nets(design: Design, nets: Mapping[str, str | None]) -> Design:
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


def _move(design: Design, pin: str, net: str) -> Design:
    return _with_nets(design, {pin: None if net == OPEN else net})


def _exchange(design: Design, first: str, second: str) -> Design:
    nets = {f"{part.ref}.{pin}": net for part in design.components for pin, net in part.pins}
    if not {first, second} <= set(nets):
        raise DesignError(f"no pin {first} or {second}")
    return _with_nets(design, {first: nets[second], second: nets[first]})


def _join(design: Design, first: str, second: str) -> Design:
    nets = design.nets()
    if not {first, second} <= set(nets):
        raise DesignError(f"no net {first} or {second}")
    return _with_nets(design, {_pin(member): first for member in nets[second]})


def _value(design: Design, ref: str, key: str) -> Design:
    _known(design, ref)
    return _changed(
        design,
        (dataclasses.replace(part, part=PARTS[key]) if part.ref == ref else part for part in design.components),
    )


def _drop(design: Design, ref: str) -> Design:
    _known(design, ref)
    return _changed(design, (part for part in design.components if part.ref != ref))


def _known(design: Design, ref: str) -> None:
    if ref not in {part.ref for part in design.components}:
        raise DesignError(f"no part {ref}")


_EDITS: Mapping[str, Callable[..., Design]] = {
    "net": _move, "swap": _exchange, "join": _join, "value": _value, "drop": _drop,
}  # fmt: skip
