"""What the checks of the board say where KiCad, ngspice and a reader of gerbers answer this or that, as approved."""

import random
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from hardware.case import board, fit
from hardware.pcb.checks import copper, gerbers, kicad_checks, suite
from hardware.pcb.circuit.design import build
from hardware.pcb.layout import rules
from hardware.pcb.layout.routing import Track, Via, placed_pads
from hardware.pcb.outputs import difference, generated_files, kicad_cli, pours, sexp
from hardware.pcb.spice import decks, run
from tests.tools.suite.approved import Trace, judge_of, said, tried

MM_PER_INCH = 25.4
VARIANT = "lm317"


class Unit:
    """A unit of length of a gerber."""

    def __init__(self, mm: float) -> None:
        self._mm = mm

    def convert_to(self, unit: str, value: float) -> float:
        return value * self._mm if unit == "mm" else value


def layer(draw: random.Random, count: int, unit: Unit) -> SimpleNamespace:
    """Return a drill file with so many holes."""
    return SimpleNamespace(objects=[
        SimpleNamespace(x=draw.uniform(0, 3), y=draw.uniform(-3, 0), unit=unit,
                        aperture=SimpleNamespace(diameter=draw.choice((0.0123, 0.31459, 0.9))))
        for _ in range(count)
    ])  # fmt: skip


def reread(draw: random.Random) -> Iterator[str]:
    """Read gerbers whose outline, holes and layers are drawn, and hold them against the design."""
    for plated, unplated in ((3, 2), (0, 2), (4, 0), (None, 1), (2, None), (None, None)):
        drilled = [None if count is None else layer(draw, count, Unit(draw.choice((1.0, MM_PER_INCH))))
                   for count in (plated, unplated)]  # fmt: skip
        edges = (draw.uniform(-9, 9), draw.uniform(-9, 9)), (draw.uniform(80, 99), draw.uniform(50, 99))
        stack = SimpleNamespace(
            outline=SimpleNamespace(bounding_box=lambda unit, edges=edges: edges if unit == "mm" else None),
            drill_pth=drilled[0], drill_npth=drilled[1], copper_layers=[1] * draw.randint(1, 3),
            graphic_layers={("top", "copper"): 1, ("bottom", "mask"): None, ("top", "silk"): 1},
        )  # fmt: skip
        seen: list[str] = []

        def opened(folder: Path, seen: list[str] = seen, stack: object = stack) -> object:
            seen.extend(f"{path.name}: {path.read_text()}" for path in sorted(folder.iterdir()))
            return stack

        library = SimpleNamespace(LayerStack=SimpleNamespace(open=opened))
        with patch.dict(sys.modules, gerbonara=library):
            reading = gerbers.read({"a.gbr": "G01", "b.drl": "M48"})
        yield said([reading, seen]).replace(str(reading.holes), said(sorted(reading.holes)))
    yield from _held(draw)


def _held(draw: random.Random) -> Iterator[str]:
    """Hold what was read against the design: as it is, and each figure, hole and layer otherwise."""
    design = build(VARIANT)
    _, vias = generated_files.copper_of(design)
    pads = placed_pads(design)
    holes = {(*via.at_mm, via.drill_mm) for via in vias}
    holes |= {(*pad.center_mm, pad.pad.drill_mm) for pad in pads if pad.pad.drill_mm}
    right = gerbers.GerberReading(
        width_mm=rules.BOARD_WIDTH_MM, height_mm=rules.BOARD_HEIGHT_MM, layers=tuple(sorted(gerbers._LAYERS)),
        copper_layers=2, plated=len(vias) + sum(pad.pad.kind.name == "THROUGH" for pad in pads),
        unplated=sum(pad.pad.kind.name == "HOLE" for pad in pads), smallest_drill_mm=min(via.drill_mm for via in vias),
        holes=frozenset((round(x, 2), round(y, 2), round(size, 2)) for x, y, size in holes),
    )  # fmt: skip
    one = min(right.holes)
    changes: tuple[dict[str, Any], ...] = (
        {}, {"width_mm": 1.0}, {"height_mm": 1.5}, {"copper_layers": 1}, {"plated": right.plated + 1},
        {"unplated": right.unplated - 1}, {"smallest_drill_mm": right.smallest_drill_mm + 0.0004},
        {"smallest_drill_mm": right.smallest_drill_mm + 0.0006}, {"holes": right.holes - {one}}, {"holes": frozenset()},
        {"holes": right.holes | {(1.25, 2.5, 0.75)}}, *({"layers": right.layers[place:]} for place in (1, 5, 7)),
    )  # fmt: skip
    for change in changes:
        reading = replace(right, **change)
        yield said([[*change], gerbers.faults(design, vias, reading)])
        for files, is_there in (({"a": "b"}, True), ({}, True), ({"a": "b"}, False), ({}, False)):
            with (
                patch.object(generated_files, "fabrication_archive", lambda _, files=files: files),
                patch.object(generated_files, "checksum_faults", lambda _: ["a sum"] if draw.random() < 0.3 else []),
                patch.object(gerbers, "is_installed", lambda is_there=is_there: is_there),
                patch.object(gerbers, "read", lambda _, reading=reading: reading),
            ):
                yield said(suite.gerbers_reread(VARIANT))


def asked(draw: random.Random) -> Iterator[str]:
    """Let KiCad find faults or none, other nets, other fabrication files and other fillings."""
    design = build(VARIANT)
    nets = {net: [*members] for net, members in design.nets().items()}
    some = sorted(nets)
    others: tuple[Mapping[str, Any], ...] = (
        nets, {**nets, "unconnected-(U1-X)": [("U1", "99")]}, {**nets, "NEW": [("R1", "1")]},
        {net: members for net, members in nets.items() if net != some[0]}, {**nets, some[1]: nets[some[1]][1:]},
    )  # fmt: skip
    archive = {"a.gbr": "one", "b.gbr": "two"}
    made = (archive, {"a.gbr": "one"}, {**archive, "b.gbr": "other"}, {**archive, "c.gbr": "new"})
    for number, found in enumerate(others):
        with (
            patch.object(kicad_cli, "netlist", lambda _, found=found: found),
            patch.object(kicad_cli, "version", lambda number=number: None if number == 1 else "9.0.2"),
            patch.object(kicad_cli, "erc", lambda _, number=number: ["an error"] * (number % 2)),
            patch.object(kicad_cli, "drc", lambda _, number=number: ["a fault", "another"] * (number // 2 % 2)),
            patch.object(kicad_checks, "VARIANTS", (VARIANT,)),
            patch.object(kicad_checks, "stitches_of", lambda _, number=number: "" if number == 3 else _kept()),
            patch.object(generated_files, "filled_project", lambda variant, folder: folder / f"{variant}.kicad_pcb"),
            patch.object(generated_files, "fabrication_files", lambda *_, number=number: made[number % 4]),
            patch.object(generated_files, "fabrication_archive", lambda _: archive),
        ):
            yield said([kicad_checks.netlist_differences(VARIANT), kicad_checks.with_kicad()])
    without = replace(design, components=design.components[3:])
    with patch.object(kicad_checks, "design_of", lambda _: without), patch.object(kicad_cli, "netlist", lambda _: nets):
        yield said(kicad_checks.netlist_differences(VARIANT))
    with (
        patch.object(kicad_checks, "fill", len),
        patch.object(kicad_checks, "kept_stitches", lambda vias, bare: [*vias[:3], pours.stitch_at(bare % 7, 2.0)]),
    ):
        yield kicad_checks.stitches_of(VARIANT)
    for is_there in (False, True):
        with (
            patch.object(suite, "is_installed", lambda is_there=is_there: is_there),
            patch.object(suite, "simulate", _simulated),
        ):
            yield said(suite.simulations())


def plain(draw: random.Random) -> Iterator[str]:
    """Run the checks that need nothing else, with faults and without."""
    yield said(suite.pin_rules())
    with patch.object(suite, "findings", lambda *_: []):
        yield said(suite.pin_rules())
    yield said(suite.print_and_lands(build(VARIANT)))
    for faults in ([], ["a fault", "another"]):
        check = SimpleNamespace(is_good=not faults)
        with (
            patch.object(suite, "VARIANTS", (VARIANT,)),
            patch.object(suite, "all_checks", lambda _, check=check: [check] * 3),
            patch.object(suite, "print_and_lands", lambda _: []),
            patch.object(suite, "gerbers_reread", lambda variant: f"gerbers of {variant}"),
            patch.object(suite, "pin_rules", lambda: ["pins"]),
            patch.object(generated_files, "sources", lambda: {"a": "b", "c": "d"}),
            patch.object(suite, "bom_faults", lambda _, faults=faults: faults),
            patch.object(suite, "netlist_faults", lambda _, faults=faults: faults),
            patch.object(suite, "differences", lambda _, faults=faults: faults),
            patch.object(copper, "faults", lambda *_, faults=faults: faults),
            patch.object(generated_files, "stale_files", lambda _, faults=faults: faults),
        ):
            yield said(suite.plain())
            with (
                patch.object(kicad_checks, "with_kicad", lambda: ["K"]),
                patch.object(suite, "simulations", lambda: [7]),
            ):
                yield said([str(one)[:30] for one in suite.run_all()])


def _kept() -> str:
    return pours.stitches_text(pours.load_stitches(VARIANT))


def _simulated(deck: Any) -> run.DeckResult:
    values = {limit.measure: limit.low + 0.5 * (limit.high - limit.low) for limit in deck.limits}
    if deck.name == decks.decks()[1].name:
        values[deck.limits[0].measure] = deck.limits[0].high * 2 + 1
    return run.DeckResult(deck=deck, figures=values, columns=[])


def pieces(draw: random.Random) -> Iterator[str]:
    """Count the pieces of copper whose ends meet, lie on a track, or miss it by little; and bounds of shapes."""
    for gap in (0.0, 0.124, 0.125, 0.126, 0.3):
        tracks = [
            Track(net="A", layer=0, start_mm=(0.0, 0.0), end_mm=(4.0, 0.0), width_mm=0.25),
            Track(net="A", layer=0, start_mm=(2.0, gap), end_mm=(2.0, 3.0), width_mm=0.25),
            Track(net="A", layer=1, start_mm=(2.0, 3.0), end_mm=(2.0, 3.0), width_mm=0.25),
        ]
        via = Via(net="A", at_mm=(2.0, 3.0), size_mm=0.6, drill_mm=0.3)
        yield said([copper._pieces([], tracks, [via][:count]) for count in (0, 1)])
        yield said([copper._is_on(tracks[0], x, gap) for x in (-0.2, -0.125, 0.0, 2.0, 4.0, 4.125, 4.2)])
    for pad in draw.sample(placed_pads(build(VARIANT)), 12):
        left, top, right, bottom = pad.box_mm
        ends = [(layer, x, y) for layer in (0, 1) for x in (left - 0.01, left, right, right + 0.01)
                for y in (top - 0.01, top, bottom, bottom + 0.01)]  # fmt: skip
        yield said([pad.layers, *(copper._is_in(pad, end) for end in ends)])
    square = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 2.0), (0.0, 4.0)]
    shape = pours._rows_of(square)
    yield said([pours._is_inside((x / 2, y / 2), shape) for x in range(-1, 10) for y in range(-1, 10)])
    for row in (
        "smd rect (at 1 2) (size 1 2) (layers F.Cu) (drill 0.5)", "smd circle (at 1 2 450) (size 1 2) (layers *.Cu)",
        'thru_hole circle (at 1 2 90) (size 1 2) (layers B.Cu F.Cu) (drill 0.7) (net 1 "A")', "smd rect (at 1 2)",
    ):  # fmt: skip
        yield tried(lambda row=row: difference._pad(sexp.parse(f'(pad "1" {row})'), (3.0, 5.0), 90.0))
    first = next(iter(board.bodies(VARIANT)))
    hole = board.mounting_holes(VARIANT)[0]
    for by in (-0.01, 0.0, 0.01):
        for z in ((-3.0, 0.0), (-3.0, 0.01), (0.0, 4.0)):
            edge = hole[0] + fit.SPACER_RADIUS_MM + by
            box = replace(first, x=(edge, edge + 1.0), y=(hole[1] - 1.0, hole[1] + 1.0), z=z)
            with patch.object(fit, "bodies", lambda _, box=box: (box,)), patch.object(fit, "VARIANTS", (VARIANT,)):
                yield said([by, z, fit.parts_keep_off_the_spacers()])


TRACES: dict[str, Trace] = {each.__name__: each for each in (reread, asked, plain, pieces)}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
