"""Footprints, places, boards laid over each other, pictures and the case, and what is asked of KiCad, as approved."""

# ruff: noqa: E501  # rows of tables stand as they are

import contextlib
import io
import math
import random
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from hardware.case import __main__ as case_command
from hardware.case import board as case_board
from hardware.case import design, fit, picture, solids, step
from hardware.pcb.checks import gerbers
from hardware.pcb.circuit.design import VARIANTS, build
from hardware.pcb.layout import placement, routing, rules
from hardware.pcb.layout.footprints import FOOTPRINTS
from hardware.pcb.layout.shapes import Pad, PadKind, PadShape
from hardware.pcb.outputs import (
    assembly,
    board,
    bom,
    difference,
    generated_files,
    kicad_cli,
    pictures,
    pours,
    project,
    read_places,
    sexp,
    steps,
)
from hardware.pcb.outputs.symbols import SYMBOLS
from hardware.pcb.spice import decks, run
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, said, tried


def footprints(draw: random.Random) -> Iterator[str]:
    """Show what is drawn of each part, each symbol, and where all parts stand."""
    for footprint in FOOTPRINTS.values():
        yield said(footprint)
        yield said((footprint.is_smd, project.model_text(footprint)))
    yield from map(said, SYMBOLS.values())
    for variant in VARIANTS:
        circuit = build(variant)
        places = placement.place(circuit)
        yield said(places)
        yield said([placement.silk_labels(circuit), placement.row_order(), rules.pours(variant)])
        yield said([assembly.body_mm(part, places[part.ref]) for part in circuit.components])
        yield said([*draw.sample(routing.placed_pads(circuit), 30), bom.rows(circuit)[:4]])
    for turned in (0.0, 90.0, 180.0, 270.0, 45.0):
        at = placement.Placement(x_mm=3.0, y_mm=5.0, angle_deg=turned)
        yield said([routing.turn((1.0, 2.0), at), placement.unturn((1.0, 2.0), turned)])
        yield said(read_places.turned((1.0, 2.0), (3.0, 5.0), turned))
    for pad in (Pad(number="1", kind=kind, shape=shape, at_mm=(1, 2), size_mm=(3, 4), drill_mm=drill)
                for kind in PadKind for shape in PadShape for drill in (0.0, 0.6)):  # fmt: skip
        yield said([board.pad_node(pad, 90.0 * (pad.drill_mm > 0), (3, "GND"), ("x",), copper=pad.drill_mm > 0)])
    yield said([board.text_effects(size, side, is_hidden=hidden, is_bold=hidden) for size in (0.8, 1.0, 1.2, 2.0)
                for side in ("left", "center") for hidden in (False, True)])  # fmt: skip


def sources(draw: random.Random) -> Iterator[str]:
    """Show every file that is made of one variant."""
    circuit = build("lm317")
    yield from generated_files.variant_sources(circuit).values()
    yield f"{board._board((1.2345678, 2.3456789))} {generated_files.library_text()}"
    pads = routing.placed_pads(circuit)
    for shift in (0.0, 0.001):
        for one in steps.STEPS:
            noted = [at for pad, _ in one.notes if (at := steps._pad_at(circuit, pad, pads)) is not None]
            if noted:
                with patch.object(rules, "BOARD_WIDTH_MM", 2 * (noted[0][0] + shift)):
                    yield said([*steps._notes(circuit, one, pads)])


def readings(draw: random.Random) -> Iterator[str]:
    """Read nested lists, lay boards over each other, and keep the vias that lie in a pour."""
    for text in ("", "a", "(a", "(a b)", '(a "b c" (d 1.5) (d 2))', '(a "x\\"y\\\\z\\nn")', "(a) b", '(a "b', "())"):
        yield tried(sexp.parse, text)
    long = sexp.node("n", *[sexp.node("m", number / 3, "w" * width) for number, width in enumerate((3, 60, 100, 170))])
    for count in range(1, 5):
        yield sexp.render(long[: count + 1])
    for length in range(186, 200):
        yield str(sexp.render(sexp.node("n", sexp.node("m", "w" * length))).count("\n"))
    tree = sexp.parse("(a b (c d) 1)")
    yield said(
        [tried(sexp.word, tree, place) for place in range(5)] + [tried(sexp.child, tree, "x"), sexp.children(tree, "c")]
    )
    yield said([sexp.number(value) for value in (0.0, -1e-9, 1.0000004, 1.0000006, 12.5, -3.25)])
    yield said([sexp.uid("a", 1), sexp.sheet_path("rev-b", "supply")])
    texts = [_small_board(draw) for _ in range(4)]
    texts += [
        texts[0].replace("R1", "R9"),
        texts[1].replace("(width 0.25)", "(width 0.5)"),
        texts[2].replace("/GND", "/A"),
    ]
    boards = [difference._board(text, "it") for text in texts]
    for one, other in ((0, 0), (0, 1), (1, 2), (2, 3), (0, 4), (1, 5), (2, 6)):
        yield said(difference.words(boards[one], boards[other]))
        yield difference.picture(boards[one], boards[other], ("a<b", "c"))
    for text in ("x", "(other)", "(kicad_pcb)", "(kicad_pcb (gr_line))"):
        yield tried(lambda text=text: difference.words(difference._board(text, "it"), boards[0]))
    yield tried(difference.read_source, "rev-z")
    square = [(float(x), float(y)) for x, y in ((98, 50), (118, 50), (118, 60), (108, 66), (98, 60))]
    points = " ".join(f"(xy {x} {y})" for x, y in square)
    for layers in (("F.Cu", "B.Cu"), ("F.Cu",)):
        filled = {f"GND:{layer}": [sexp.parse(f"(filled_polygon (layer {layer}) (pts {points}))")] for layer in layers}
        vias = [pours.stitch_at(x * 0.7, y * 0.7) for x in range(-1, 31, 2) for y in range(-1, 25, 2)]
        yield said([via.at_mm for via in pours.kept_stitches(vias, filled)])
    yield pours.stitches_text(vias[:5])
    yield said([vias[3], [*zip(pours._rows_of(square), map(said, pours._rows_of(square).values()), strict=True)]])
    with tempfile.TemporaryDirectory() as made:
        file = Path(made, "s.txt")
        for text in ("1000000,2000000\n", "1,2\n3\n", "1,2,3\n", "1,x\n", ""):
            file.write_text(text)
            yield tried(pours.load_stitches, "rev-b", file)
            yield tried(routing.load_routes, build("rev-b"), file)
        head = f"# input {routing.fingerprint(build('rev-b'))}\n"
        for line in ("T A 0 1 2 3 4 0.25", "V A 1 2 0.6 0.3", "S GND 1 2 0.8 0.4", "T A 0 1 2", "V A 1 2 3 x", "S A 1"):
            file.write_text(f"{head}V A 1 2 0.6 0.3\n{line}\n")
            yield tried(routing.load_routes, build("rev-b"), file)
        yield tried(routing.load_routes, build("rev-b"), Path(made, "none"))
        yield tried(pours.load_stitches, "rev-b", Path(made, "none"))
    yield said([routing.antenna_area(), routing.router_input(build("rev-b")).splitlines()[:12]])


def _small_board(draw: random.Random) -> str:
    """Return a board of a few parts, tracks and words."""

    def at(most: int = 40) -> str:
        return f"{draw.randrange(most) / 2} {draw.randrange(most) / 2}"

    def layer() -> str:
        return draw.choice(('"F.Cu"', '"B.Cu"', '"F.SilkS"', '"Edge.Cuts"', '"F.Fab"'))

    pads = [
        f'(pad "{number}" smd {draw.choice(("circle", "rect"))} (at {at(8)}{draw.choice(("", " 90", " 450"))}) (size 1 2) '
        f'(layers {draw.choice(("*.Cu", "F.Cu", "B.Cu B.Mask"))}){draw.choice(("", " (drill 0.5)"))}(net 1 "/GND"))'
        for number in range(4)
    ]
    parts = [
        f'(footprint "adapter:R" (at {at()}{draw.choice(("", " 90", " 30"))}) (property "Reference" "R{number}") '
        f'(property "Value" "1k") (fp_line (start 0 0) (end {at(6)}) (stroke (width 0.15)) (layer "F.SilkS")) '
        f'(fp_text user "w&{number}" (at 1 2) (layer "F.SilkS") (effects (font (size 1 1)))) {pads[number]})'
        for number in range(draw.randrange(2, 4))
    ]
    lines = [f"(gr_line (start {at()}) (end {at()}) (stroke (width 0.1)) (layer {layer()}))" for _ in range(4)]
    tracks = [
        f"(segment (start {at()}) (end {at()}) (width 0.25) (layer {layer()}) (net {draw.randrange(3)}))"
        for _ in range(3)
    ]
    vias = [f"(via (at {at()}) (size 0.6) (drill 0.3))"]
    edge = '(gr_line (start 0 0) (end 20 25) (stroke (width 0.1)) (layer "Edge.Cuts"))'
    text = '(gr_text "say" (at 3 4) (layer "B.SilkS") (effects (font (size 1.5 1.5))))'
    nets = '(net 0 "") (net 1 "/GND")'
    return f"(kicad_pcb {nets} {edge} {text} {' '.join([*parts, *lines, *tracks, *vias])})"


def calls(draw: random.Random) -> Iterator[str]:
    """Show what is asked of KiCad and of the libraries that draw, and what is made of their answers."""
    asked: list[str] = []
    answers: list[tuple[int, str, str]] = []

    def ran(words: list[str], **named: Any) -> subprocess.CompletedProcess[str]:
        asked.append(said([Path(words[0]).name, *words[1:], sorted({*named} - {"env", "capture_output", "text"})]))
        return subprocess.CompletedProcess(words, *answers[-1])

    for answer in (
        (0, "9.0.8", ""),
        (0, "10.1.2", ""),
        (0, "8.9.9", ""),
        (0, "none", ""),
        (3, "9.0.1", "e" * 401),
        (1, "9.0.1x", ""),
    ):
        answers.append(answer)
        kicad_cli.version.cache_clear()
        with patch("subprocess.run", ran), patch("shutil.which", lambda name: name):
            yield said(
                [
                    kicad_cli.version(),
                    tried(kicad_cli.run, "pcb", "drc", "x", "y"),
                    tried(kicad_cli.run, "a", good=(0, 3)),
                    taken(asked),
                ]
            )
    with (
        tempfile.TemporaryDirectory() as made,
        patch.object(
            kicad_cli, "run", lambda *words: asked.append(said([str(word).replace(made, "…") for word in words]))
        ),
    ):
        folder = Path(made)
        (folder / "b.step").write_text("'2026-01-02T03:04:05','x'")
        (folder / "c.gbr").write_text("G01\n; #@! TF.CreationDate,1\nERC report (1\n** Created on 1\nG02")
        actions: tuple[Callable[[], None], ...] = (lambda: kicad_cli.fabrication(folder / "b", folder), lambda: kicad_cli.schematic_pdf(folder / "a", folder / "c"),
                       lambda: kicad_cli.step(folder / "b", folder / "b.step"), lambda: kicad_cli.picture(folder / "b", folder / "c", "--side", "top"))  # fmt: skip
        for action in actions:
            action()
            yield taken(asked)
        yield said([path.read_text() for path in sorted(folder.iterdir())])
    kicad_cli.version.cache_clear()
    entries: tuple[dict[str, object], ...] = ({"type": "t", "severity": "error", "description": "d", "items": [{"description": "i"}, {"description": "j"}]},
                  {"type": "t", "severity": "warning", "description": "d", "items": None})  # fmt: skip
    for entry in entries:
        found = kicad_cli._violation(entry)
        yield said([found, str(found)])
    files = {"b.gbr": "two", "a.gbr": "one"}
    yield said([generated_files.sums(files), generated_files.stale_files({"none": "x"})])
    yield from _pictures(asked)

    reading = gerbers.GerberReading(
        width_mm=99.0,
        height_mm=100.0,
        layers=("top copper",),
        copper_layers=1,
        plated=3,
        unplated=4,
        smallest_drill_mm=0.2,
    )
    yield said(gerbers.faults(build("rev-b"), generated_files.copper_of(build("rev-b"))[1], reading)[:40])


def _pictures(asked: list[str]) -> Iterator[str]:
    """Draw with libraries that only note what they are asked."""
    axes = Acted(asked, "axes")
    figure = Acted(asked, "figure")
    plotted = Acted(asked, "plt", subplots=[(figure, axes)] * 2)
    modules: dict[str, Any] = {
        "matplotlib": SimpleNamespace(use=asked.append, pyplot=plotted),
        "matplotlib.pyplot": plotted,
    }
    with tempfile.TemporaryDirectory() as made, patch.object(generated_files, "PICTURES", Path(made)):
        with (
            patch.dict(sys.modules, modules),
            patch.object(pictures, "_shrink", lambda file, crop=None: asked.append(f"shrink {file.name} {crop}")),
        ):
            for deck in decks.decks()[:2]:
                columns = [[0.0, 1.0, 2.0], *([float(place)] * 3 for place, _ in enumerate(deck.traces))]
                pictures.plot(run.DeckResult(deck=deck, figures={}, columns=columns))
                yield taken(asked).replace(made, "…")
        kept = Path(made, "b.kicad_pcb")
        kept.write_text("a/library/models/b")
        with (
            patch.object(pictures, "_shrink", lambda file, crop=None: asked.append(f"shrink {file.name} {crop}")),
            patch.object(
                pictures, "_write_names", lambda file, design: asked.append(f"names {file.name} {design.variant}")
            ),
            patch.object(
                kicad_cli,
                "picture",
                lambda *words: asked.append(said([str(word).replace(made, "…") for word in words])),
            ),
        ):
            for variant in VARIANTS:
                pictures.board_pictures(variant, kept)
                yield taken(asked) + said(pictures.pages_shown(variant))
        yield Path(made, "bare.kicad_pcb").read_text()
        canvas = Acted(asked, "draw", textbbox=[(1, 2, 3, 4)] * 200)
        opened = SimpleNamespace(convert=lambda _: Acted(asked, "image"))
        drawn = SimpleNamespace(
            Image=SimpleNamespace(open=lambda _: contextlib.nullcontext(opened)), ImageDraw=SimpleNamespace(Draw=lambda _: canvas),
            ImageFont=SimpleNamespace(load_default=lambda size: f"{size:.2f}"),
        )  # fmt: skip
        with patch.dict(sys.modules, {"PIL": drawn}):
            pictures._write_names(Path("b.png"), build("rev-b"))
        yield taken(asked)


def cases(draw: random.Random) -> Iterator[str]:
    """Show the solids of the case, what they hold, what does not fit, its files and its picture."""
    bodies = (design.base(), design.lid())
    for body in bodies:
        yield from map(said, body.solids)
        yield said([body.extent, [solid.extent for solid in body.solids]])
        left, right, top, bottom, low, high = body.extent
        for _ in range(40):
            at = draw.uniform(left, right), draw.uniform(top, bottom), draw.choice((low, high, draw.uniform(low, high)))
            yield said(
                [
                    body.holds(*at),
                    [solid.name for solid in body.near((at[0], at[0] + 5, at[1], at[1] + 5, at[2], at[2])).solids],
                ]
            )
    for variant in VARIANTS:
        yield said(
            [case_board.bodies(variant), case_board.mounting_holes(variant), case_board.through_pads(variant)[:9]]
        )
    yield said([design.usb_way(), design.button_place(), design.stamp()])
    for check in fit.CHECKS.values():
        if check is not fit.parts_touch_nothing:
            yield f"{check.__name__} {said(check())}"
    for place, body in enumerate(bodies):
        name = ("base", "lid")[place]
        for solid in draw.sample(body.solids, 12):
            others = tuple(one for one in body.solids if one is not solid)
            changed = solids.PrintedPart(name=body.name, solids=others)
            with patch.object(design, name, lambda changed=changed: changed):
                found = [check() for check in (fit.bosses_carry_the_board, fit.lights_are_seen, fit.hands_reach_what_they_use,
                                               fit.a_small_printer_takes_it)]  # fmt: skip
            yield f"without {solid.name}: {said([lines[:3] for lines in found])}"
    yield said([fit._steps(*ends) for ends in ((0.0, 0.0), (0.0, 0.5), (0.0, 1.0), (0.0, 1.01), (2.0, 4.5))])
    yield said([fit._overlap((0.0, 1.0), other) for other in ((1.0, 2.0), (0.99, 2.0), (-1.0, 0.0), (-1.0, 0.01))])
    yield said([fit._distance(value, (1.0, 2.0)) for value in (0.5, 1.0, 1.5, 2.0, 2.5)])
    yield from _files(draw)


def _files(draw: random.Random) -> Iterator[str]:
    asked: list[str] = []
    modeller = SimpleNamespace(
        Pos=lambda *at: _Shape(f"Pos{said(at)}"), Box=lambda *sides: _Shape(f"Box{said(sides)}"), Axis=SimpleNamespace(Z="z"),
        Cylinder=lambda *sides: _Shape(f"Cylinder{said(sides)}"), fillet=lambda edges, radius: _Shape(f"fillet({edges}, {said(radius)})"),
        export_step=lambda part, path, **named: asked.append(f"step {part} {Path(path).name} {said(named)}"),
        export_stl=lambda part, path, **named: asked.append(f"stl {part} {Path(path).name} {said(named)}"),
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as made, patch.object(step, "_modeller", lambda: modeller):
        for body in (design.base(), design.lid()):
            yield said([path.name for path in step.export(body, Path(made))])
            yield taken(asked)
        with patch.object(case_command, "CHECKS", {"fits": list, "not": lambda: [f"line {n}" for n in range(7)]}):
            with contextlib.redirect_stdout(io.StringIO()) as out:
                yield said(case_command.main(["check"]))
            yield out.getvalue()
        triangles = [tuple(float(draw.randrange(20)) for _ in range(12)) for _ in range(9)]
        data = b"\0" * 80 + struct.pack("<I", 9) + b"".join(struct.pack("<12fH", *row, 0) for row in triangles)
        for change in (data, data + b"x", data[:-1]):
            Path(made, "base.stl").write_bytes(change)
            yield tried(picture.read_stl, Path(made, "base.stl"))
        Path(made, "base.stl").write_bytes(data)
        Path(made, "lid.stl").write_bytes(data)
        sheet = Acted(asked, "sheet", add_subplot=[Acted(asked, f"axes{place}") for place in range(3)])
        figures = Acted(asked, "figure", Figure=[sheet])
        library = SimpleNamespace(figure=figures)
        with (
            patch.dict(sys.modules, {"matplotlib": library}),
            patch.object(picture, "_seen", lambda faces, *turns: said([turns, *faces])),
        ):
            picture.draw(Path(made), Path("case.png"))
        yield from asked
    slab, tower = picture._box(0, 40, 0, 30, -5, 0), picture._box(10, 20, 5, 15, 0, 12)
    yield said([slab, [picture._light(face) for face in (*slab, *tower)]])
    few = [*((one, (1.0, 0.5, 0.0)) for one in slab), *((one, (0.0, 0.5, 1.0)) for one in tower)]
    flat, away = ((0.0, 0.0, 0.0),) * 3, tuple((x, 900.0, 0.0) for x in (0.0, 5.0, 9.0))
    few += [(flat, (1.0, 1.0, 1.0)), (away, (1.0, 1.0, 1.0))]
    for turn, tilt in ((28.0, 50.0), (205.0, 40.0)):
        image = picture._seen(few, math.radians(turn), math.radians(tilt))
        yield said([float(image[row, column].sum()) for row in range(45, 190, 6) for column in range(140, 350, 9)])


class _Shape:
    """A solid of a modeller that keeps how it was made."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __str__(self) -> str:
        return self._text

    def __add__(self, other: object) -> "_Shape":
        return _Shape(f"{self} + {other}")

    def __sub__(self, other: object) -> "_Shape":
        return _Shape(f"{self} - {other}")

    def __mul__(self, other: object) -> "_Shape":
        return _Shape(f"{self} * {other}")

    def edges(self) -> "_Shape":
        """Return its edges."""
        return self

    def filter_by(self, axis: object) -> str:
        """Return those along an axis."""
        return f"edges along {axis} of {self}"


TRACES: dict[str, Trace] = {each.__name__: each for each in (footprints, sources, readings, calls, cases)}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
