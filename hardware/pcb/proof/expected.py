"""The circuit held against a table of expected connections that was not made from it.

`expected.toml` says which pins must meet, by the pin names of KiCad's official symbols and the print of the
modules, and which value each part has. The modules' pins are found by where their pads stand on the board,
so that a number that is wrong in symbol and footprint alike is seen too.

Invariant: a difference names the pin or part, what is expected, and what is there.
"""

import tomllib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from pathlib import Path
from typing import Any, TypeAlias

from hardware.pcb.circuit.netlist import BoardDesign, Component
from hardware.pcb.layout.footprints import FOOTPRINTS
from hardware.pcb.outputs.sexp import children, parse, word

TABLE = Path(__file__).parent / "expected.toml"
#: Symbols of the parts that the table gives no other one.
_SYMBOLS = {"MAX3232": "MAX3232", "NPN": "BC817", "PNP": "BC807", "DE9": "DE9", "SCHOTTKY": "DIODE",
            "TVS": "DIODE", "LED": "DIODE", "CP": "CP", "HC595": "HC595"}  # fmt: skip
#: Symbols whose two ends are alike.
ALIKE = frozenset({"R", "C", "FUSE", "SWITCH"})
_RAILS = {"GND": "GND", "3V3": "3V3"}


#: The parts, each with name and net of its pins, by the table's names.
_Parts: TypeAlias = list[tuple[Component, list[tuple[str, str | None]]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected:
    """The table for one board: nodes by name (pins, counted), values by reference."""

    nodes: Mapping[str, Counter[str]]
    values: Mapping[str, str]
    #: Why a pin must stay open.
    open_pins: Mapping[str, str]
    #: Which of the table's symbols a reference has, where its own symbol does not say it.
    symbols: Mapping[str, str]
    #: The pins that each pin must meet.
    partners: Mapping[str, frozenset[str]]
    #: The nodes that each pin is at, and how often.
    homes: Mapping[str, Mapping[str, int]]


@lru_cache(maxsize=1)
def _table() -> dict[str, Any]:  # what TOML holds
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


@lru_cache
def expected(variant: str) -> Expected:
    """Return what the table expects of a board; KeyError where it describes none of that name."""
    table = _table()
    own = table["variant"][variant]
    nodes: dict[str, Counter[str]] = {}
    values = {ref: str(row[0]) for ref, row in {**table["values"], **own["values"]}.items()}
    for node in (*table["node"], *own["node"]):
        nodes.setdefault(node["name"], Counter()).update(node["pins"])
    for name, bluepill, esp32, series, ohms, pull, pull_ohms, rail, tap, side in table["wires"]["rows"]:
        near = nodes.setdefault(f"{name} at the BluePill", Counter())
        near.update([f"U1.{bluepill}", series])
        far = nodes.setdefault(f"{name} at the ESP32", Counter())
        far.update([own.get("wires", {}).get(name, f"U2.{esp32}"), series, pull])
        (near if side == "BluePill" else far)[f"J4.{tap}"] += 1
        nodes[_RAILS[rail]][pull] += 1
        values |= {series: ohms, pull: pull_ohms}
    partners: dict[str, frozenset[str]] = {}
    homes: dict[str, dict[str, int]] = {}
    for name, members in nodes.items():
        for pin, count in members.items():
            partners[pin] = partners.get(pin, frozenset()) | (frozenset(members) - {pin})
            homes.setdefault(pin, {})[name] = count
    return Expected(
        nodes=nodes, values=values, partners=partners, homes=homes, open_pins=table["open"], symbols=own["symbols"]
    )


def differences(design: BoardDesign) -> list[str]:
    """Return where a circuit differs from the table: pins, parts and values, one line each.

    Raises:
        KeyError: The table does not describe the design's variant.
    """
    table = expected(design.variant)
    pins = [(part, _named_pins(part, table)) for part in design.components]
    return [*_parts(design, table), *_crossed(pins, table), *_joints(pins, table), *_values(design, table)]


def _parts(design: BoardDesign, table: Expected) -> list[str]:
    """Compare which parts there are."""
    wanted = {pin.split(".")[0] for pins in table.nodes.values() for pin in pins}
    there = {part.ref for part in design.components if part.pins}
    return [*(f"{ref} is missing" for ref in sorted(wanted - there)),
            *(f"{ref} is not expected" for ref in sorted(there - wanted))]  # fmt: skip


def _crossed(parts: _Parts, table: Expected) -> list[str]:
    """Name parts two of whose pins each meet what the other should meet."""
    nets: dict[str | None, set[str]] = {}
    for _, pins in parts:
        for name, net in pins:
            nets.setdefault(net, set()).add(name)
    found = []
    for part, pins in parts:
        if part.part.symbol in ALIKE:
            continue
        # Pins that meet none of those that they should meet.
        lost = [
            (pin, net, table.partners[pin])
            for pin, net in pins
            if net is not None and pin in table.partners and not table.partners[pin] & nets[net]
        ]
        for (one, first, wanted), (two, second, other) in combinations(lost, 2):
            if wanted & nets[second] and other & nets[first]:
                words = f"{part.ref} is the wrong way round" if len(part.pins) == 2 else f"{part.ref} has pins crossed"
                found.append(f"{words}: {one} is on net {first}, {two} on net {second}")
    return found


def _joints(parts: _Parts, table: Expected) -> list[str]:
    """Compare nets with nodes: each net belongs to the node with which it shares most pins, each node once."""
    nets: dict[str, Counter[str]] = {}
    found = []
    for _, named in parts:
        for name, net in named:
            if net is not None:
                nets.setdefault(net, Counter())[name] += 1
            elif name in table.homes:
                found.append(f"{name} is open, expected at {_node_of(table, name)!r}")
    matched = _matched(nets, table)
    for net, pins in sorted(nets.items()):
        node = table.nodes[matched[net]] if net in matched else Counter()
        for pin in _beyond(pins, node):
            why = table.open_pins.get(pin)
            where = f"expected at {_node_of(table, pin)!r}" if why is None else f"must stay open ({why})"
            found.append(f"{pin} is on net {net} ({matched.get(net, 'no node')!r}), {where}")
    there = {name: net for net, name in matched.items()}
    for name, node in table.nodes.items():
        pins = nets[there[name]] if name in there else Counter()
        found += [f"{pin} is not at {name!r}" for pin in _beyond(node, pins)]
    return found


def _beyond(pins: Counter[str], others: Counter[str]) -> list[str]:
    """Return the pins that are not among the others, in order."""
    return [] if dict.__eq__(pins, others) else sorted((pins - others).elements())


def _matched(nets: Mapping[str, Counter[str]], table: Expected) -> dict[str, str]:
    """Return the node of each net that has one: the nets that share most pins choose first."""
    common: Counter[tuple[str, str]] = Counter()
    for net, pins in nets.items():
        for pin, count in pins.items():
            for name, wanted in table.homes.get(pin, {}).items():
                common[net, name] += min(count, wanted)
    shared = sorted((-pins, -table.nodes[name].total(), net, name) for (net, name), pins in common.items())
    matched: dict[str, str] = {}
    taken: set[str] = set()
    for _, _, net, name in shared:
        if net not in matched and name not in taken:
            matched[net] = name
            taken.add(name)
    return matched


def _node_of(table: Expected, pin: str) -> str:
    return " or ".join(name for name, node in table.nodes.items() if pin in node) or "nothing: it must stay open"


def _named_pins(part: Component, table: Expected) -> list[tuple[str, str | None]]:
    """Return (name, net) of each pin, by the table's names."""
    if part.part.symbol in ALIKE:
        return [(part.ref, net) for _, net in part.pins]
    names = _pin_names(part, table)
    return [(f"{part.ref}.{names.get(pin, pin)}", net) for pin, net in part.pins]


def _pin_names(part: Component, table: Expected) -> Mapping[str, str]:
    rows = _table()["modules"].get(part.ref)
    if rows is not None:
        return _by_place(part, list(rows.values()))
    symbol = table.symbols.get(part.ref) or _SYMBOLS.get(part.part.symbol)
    return {} if symbol is None else _table()["symbols"][symbol]["pins"]


def print_names(ref: str, places: list[tuple[float, float]]) -> dict[tuple[float, float], str]:
    """Return what a module's print says at each of its pads; nothing of another part.

    Args:
        ref: The module.
        places: Where its pads stand, millimetres, x to the right and y down, the module not turned.
    """
    rows = _table()["modules"].get(ref)
    if rows is None:
        return {}
    printed = _table()["print"].get(ref, {})
    return {at: printed.get(name, name.removeprefix("IO")) for at, name in _rows(places, list(rows.values())).items()}


def _rows(places: list[tuple[float, float]], rows: list[list[str]]) -> dict[tuple[float, float], str]:
    """Name pads by where they stand: rows from left to right, each from the top; ValueError where there are others."""
    columns = sorted({x for x, _ in places})
    names: dict[tuple[float, float], str] = {}
    for x, row in zip(columns, rows, strict=True):
        column = sorted((at for at in places if at[0] == x), key=lambda at: at[1])
        names |= dict(zip(column, row, strict=True))
    return names


def _by_place(part: Component, rows: list[list[str]]) -> dict[str, str]:
    pads = FOOTPRINTS[part.part.footprint].pads
    names = _rows([pad.at_mm for pad in pads], rows)
    return {pad.number: names[pad.at_mm] for pad in pads}


def _values(design: BoardDesign, table: Expected) -> list[str]:
    found = []
    for part in design.components:
        wanted = table.values.get(part.ref)
        if wanted is None:
            continue
        facts = part.part.facts
        figure = facts.get("ohm", facts.get("farad"))
        good = part.part.value == wanted if figure is None else abs(figure / si(wanted) - 1) < 1e-6
        if not good:
            found.append(f"{part.ref} is {part.part.value}, expected {wanted}")
    return found


def si(text: str) -> float:
    """Return the figure of a value as it is printed on drawings: `4k7`, `680R`, `22u`, `100n`."""
    letter = next(char for char in text if char.isalpha())
    return float(text.replace(letter, ".").rstrip(".")) * {"R": 1.0, "k": 1e3, "n": 1e-9, "u": 1e-6}[letter]


def symbol_differences(library: Path) -> list[str]:
    """Return where the table's pin names differ from KiCad's own symbols.

    Args:
        library: Folder of KiCad's symbol libraries, `/usr/share/kicad/symbols` where they are installed.
    """
    found = []
    for name, row in _table()["symbols"].items():
        file, symbol = row["kicad"].split(":")
        official = _official_pins(library / f"{file}.kicad_sym", symbol)
        if set(official.values()) == {"~"} or name == "DIODE":
            # Pins without names, or counted by KiCad and named here: their order is what can be compared.
            good = len(official) == len(row["pins"]) and (name != "DIODE" or official == {"1": "K", "2": "A"})
        else:
            good = official == row["pins"]
        if not good:
            found.append(f"{name}: {row['pins']}, KiCad's {row['kicad']} has {official}")
    return found


def _official_pins(file: Path, name: str) -> dict[str, str]:
    symbols = {word(symbol): symbol for symbol in children(parse(file.read_text(encoding="utf-8")), "symbol")}
    symbol = symbols[name]
    while children(symbol, "extends"):
        symbol = symbols[word(children(symbol, "extends")[0])]
    units = children(symbol, "symbol")
    return {
        word(children(pin, "number")[0]): word(children(pin, "name")[0])
        for unit in units
        for pin in children(unit, "pin")
    }
