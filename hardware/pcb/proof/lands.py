"""Lands, modules and wires of a board's file, held against drawings that were not made from it (footprints.toml).

A land is a pad as its footprint has it: number, place, size, hole. The two modules' pads are held against public
pin-outs, and each wire is followed on the board from the pin that one drawing counts to the pin that the other counts:
through one resistor, or for the reset line through a transistor's base.

Invariant: a fault names the part and pad, or the wire.
"""

import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.outputs.read_places import Point
from hardware.pcb.outputs.sexp import children, parse, word
from hardware.pcb.proof.board_file import PlacedLand, PrintedBoard, SilkPart

TABLE = Path(__file__).parent / "footprints.toml"
#: A land's place and size may differ by this much.
NEAR_MM = 0.011
PITCH_MM = 2.54
#: Number, x, y, width, height, hole; millimetres.
Row = tuple[str, float, float, float, float, float]


@cache
def table() -> dict[str, Any]:  # what TOML holds
    """Return the table of drawings."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def faults(board: PrintedBoard, design: BoardDesign) -> list[str]:
    """Return where the board's lands, their nets and its wires differ from drawings and circuit, one line each."""
    found = []
    for component in design.components:
        part = board.parts.get(component.ref)
        if part is None:
            found.append(f"{component.ref} is not on the board")
            continue
        if part.footprint != component.part.footprint:
            found.append(f"{component.ref} has the footprint {part.footprint}, {component.part.footprint} is ordered")
        found += [*_lands(part), *_nets(part, dict(component.pins)), *_edge(part, board)]
    return [*found, *wire_faults(board, design)]


def _lands(part: SilkPart) -> Iterator[str]:
    wanted = wanted_lands(part.footprint)
    if wanted is None:
        yield f"{part.ref}: no drawing of {part.footprint}"
        return
    left = list(wanted)
    for land in part.lands:
        row = (land.number, *land.own_mm, *land.size_mm, land.drill_mm)
        match = next((one for one in left if _same(one, row)), None)
        if match is not None:
            left.remove(match)
            continue
        near = next((one for one in left if one[0] == land.number), None)
        yield f"{part.ref}.{land.number}: {_shown(row)}, the drawing has {_shown(near) if near else 'no such pad'}"
    for row in left:
        if not any(land.number == row[0] for land in part.lands):
            yield f"{part.ref} lacks pad {row[0]}"


def wanted_lands(footprint: str) -> list[Row] | None:
    """Return the lands that a footprint's drawing has, with this board's known differences; None without a drawing."""
    if row := table()["lands"].get(footprint):
        more = row.get("differs", {}).get("drill_mm", 0.0)
        return [(number, x, y, width, height, round(drill + more, 3) if drill and number != "0" else drill)
                for number, x, y, width, height, drill in row["pads"]]  # fmt: skip
    module = table()["modules"].get(footprint)
    if module is None:
        return None
    # Our numbers run column by column; a drawing's own numbers serve for names and wires.
    return [("", x, y, 1.7, 1.7, module["drill_mm"]) for x, y in module_places(footprint).values()]


@cache
def module_places(footprint: str) -> Mapping[int, Point]:
    """Return where a module's pins stand, by the numbers of its public drawing; from its upper left pad."""
    places = {}
    for column in table()["modules"][footprint]["columns"]:
        end = column["to"] + (1 if column["step"] > 0 else -1)
        for row, number in enumerate(range(column["from"], end, column["step"])):
            places[number] = (column["x"], round(row * PITCH_MM, 2))
    return places


def _same(wanted: Row, row: Row) -> bool:
    return wanted[0] in {"", row[0]} and all(
        abs(one - two) <= NEAR_MM for one, two in zip(wanted[1:], row[1:], strict=True)
    )


def _shown(row: Row) -> str:
    _, x, y, width, height, drill = row
    return f"{width:g} x {height:g} mm at {x:g}, {y:g}" + (f", hole {drill:g}" if drill else "")


def _nets(part: SilkPart, pins: Mapping[str, str | None]) -> Iterator[str]:
    for land in part.lands:
        wanted = pins.get(land.number)
        there = "" if land.net.startswith("unconnected-") else land.net
        if there != (wanted or ""):
            yield f"{part.ref}.{land.number} is on {there or 'nothing'}, the circuit has {wanted or 'nothing'}"


def _edge(part: SilkPart, board: PrintedBoard) -> Iterator[str]:
    row = table()["edge"].get(part.footprint)
    if row is None:
        return
    gap = round(board.bottom_mm - next(land.at[1] for land in part.lands if land.number == row["row"]), 3)
    if not row["least_mm"] <= gap <= row["most_mm"]:
        yield (
            f"{part.ref}: the edge is {gap:.2f} mm from its second row, the flange's back {row['back_mm']:g} mm: "
            f"{row['least_mm']:g} to {row['most_mm']:g} mm would do"
        )


def wire_faults(board: PrintedBoard, design: BoardDesign) -> list[str]:
    """Return the wires that do not run from pin to pin as the modules' public pin-outs count them."""
    rows, found = table()["wires"]["rows"], []
    for name, near, *far in rows:
        other = far[0] if design.revision == "rev-b" else far[1]
        one = _pad(board, "U1", near)
        two = _pad(board, *(other.split(".") if isinstance(other, str) else ("U2", other)))
        if one is None or two is None:
            found.append(f"wire {name}: no pad at pin {near} of the BluePill or {other} of the other end")
            continue
        joins = _joins(board, one.net, two.net)
        wanted = Counter({"Q": 1} if name == "rst" else {"R": 1})
        if joins != wanted:
            found.append(
                f"wire {name}: from {one.net} at the BluePill to {two.net}, joined by {dict(joins) or 'nothing'}"
            )
    return found


def _pad(board: PrintedBoard, ref: str, pin: int | str) -> PlacedLand | None:
    """Return a module's pad by its public number, found by place; another part's by its own."""
    part = board.parts.get(ref)
    if part is None or not part.lands:
        return None
    if isinstance(pin, str):
        return next((land for land in part.lands if land.number == pin), None)
    x0, y0 = min(land.own_mm[0] for land in part.lands), min(land.own_mm[1] for land in part.lands)
    x, y = module_places(part.footprint)[pin]
    near = (land for land in part.lands if abs(land.own_mm[0] - x0 - x) < 1 and abs(land.own_mm[1] - y0 - y) < 1)
    return next(near, None)


def _joins(board: PrintedBoard, one: str, two: str) -> Counter[str]:
    """Return which kinds of part have a pad on both nets; of a transistor, base behind a resistor and collector."""
    kinds: Counter[str] = Counter()
    nets = {ref: {land.net for land in part.lands} for ref, part in board.parts.items()}
    for ref, own in nets.items():
        if ref.startswith("R") and own == {one, two}:
            kinds["R"] += 1
        if ref.startswith("Q") and two in own and "GND" in own:
            bases = {net for net in own if any(r.startswith("R") and n == {one, net} for r, n in nets.items())} - {
                two,
                "GND",
            }
            kinds["Q"] += bool(bases)
    return +kinds


def kicad_differences(library: Path) -> list[str]:
    """Return where the table differs from KiCad's own footprints, one line each.

    Args:
        library: Folder of KiCad's footprint libraries, `/usr/share/kicad/footprints` where they are installed.
    """
    found = []
    for name, row in table()["lands"].items():
        folder, _, file = row["kicad"].partition("/")
        tree = parse((library / f"{folder}.pretty" / f"{file}.kicad_mod").read_text(encoding="utf-8"))
        named = {"1": "K", "2": "A"} if {"K", "A"} == {pad[0] for pad in row["pads"]} else {}
        theirs = []
        for pad in children(tree, "pad"):
            at, size, drill = children(pad, "at")[0], children(pad, "size")[0], children(pad, "drill")
            theirs.append([named.get(word(pad), word(pad)), float(word(at)), float(word(at, 2)), float(word(size)),
                           float(word(size, 2)), float(word(drill[0])) if drill else 0.0])  # fmt: skip
        if not _rows_equal(row["pads"], theirs):
            found.append(f"{name}: {row['pads']}, KiCad's {row['kicad']} has {theirs}")
    return found


def _rows_equal(ours: list[list[Any]], theirs: list[list[Any]]) -> bool:
    def key(row: list[Any]) -> tuple[object, ...]:
        return row[0], *(round(float(value), 3) for value in row[1:])

    return sorted(map(key, ours), key=str) == sorted(map(key, theirs), key=str)
