"""Pictures for docs/: the board from above and below, schematic pages, assembly drawings, plots.

They need KiCad, pdftoppm (poppler-utils) and matplotlib, and are small on purpose.
A picture is for looking at: no check compares its pixels. `make pictures` makes those that are older than what they
show.
"""

import itertools
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hardware.pcb.circuit.design import build
from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.layout.footprints import FOOTPRINTS
from hardware.pcb.layout.placement import place
from hardware.pcb.layout.routing import placed_pads, turn
from hardware.pcb.layout.shapes import Label
from hardware.pcb.outputs import generated_files, kicad_cli
from hardware.pcb.outputs.schematic import PAGES
from hardware.pcb.spice.run import DeckResult

_PAGE_DPI = 110
_SIDES = {
    "top": ("--side", "top"),
    "bottom": ("--side", "bottom"),
    # Without perspective, for with it KiCad draws another picture each time.
    "view": ("--rotate", "-48,0,-25", "--zoom", "0.62"),
}
#: Variants that are shown from every side.
SHOWN_WHOLE = ("rev-b", "rev-c")
#: What of the picture at an angle is not sky: left, top, right, bottom.
_CROP = (60, 190, 920, 790)
#: Where KiCad draws the board of 100 mm in its picture from above: a millimetre, and the upper left corner; measured
#: at the mounting holes.
_PX_PER_MM, _CORNER_PX = 9.647, 9.4
#: Parts whose bodies hide the names of their own pins, and the screw terminals.
_MODULES, _TERMINALS = ("U1", "U2"), ("J1", "J2")
#: A plot's curves in order: what lies on another is dashed, and both are seen.
_STROKES: tuple[dict[str, Any], ...] = (
    {"linewidth": 2.6}, {"linewidth": 1.6, "linestyle": (0, (4, 2))}, {"linewidth": 1.4},
    {"linewidth": 1.4, "linestyle": (0, (6, 1, 1, 1))}, {"linewidth": 1.4, "linestyle": (0, (1, 1))},
)  # fmt: skip


def board_pictures(variant: str, board: Path) -> list[Path]:
    """Render a filled board from both sides, at an angle and without its parts; of `lm317` the top alone."""
    files = []
    generated_files.PICTURES.mkdir(parents=True, exist_ok=True)
    for side, arguments in _SIDES.items():
        if variant not in SHOWN_WHOLE and side != "top":
            continue
        file = generated_files.PICTURES / f"{variant}-{side}.png"
        kicad_cli.picture(board, file, *arguments, "--width", "1000", "--height", "1000", "--background", "opaque")
        if side == "top":
            _write_names(file, build(variant))
        _shrink(file, _CROP if side == "view" else None)
        files.append(file)
    if variant in SHOWN_WHOLE:
        files.append(_bare_picture(variant, board))
    return files


def _write_names(file: Path, design: BoardDesign) -> None:
    """Write on a board from above what its parts hide: modules and their pins, connectors, + and - of the terminals."""
    from PIL import Image, ImageDraw, ImageFont

    with Image.open(file) as image:
        named = image.convert("RGB")
    draw = ImageDraw.Draw(named)

    def write(text: str, at_mm: tuple[float, float], size_mm: float, anchor: str = "mm") -> None:
        at = (_CORNER_PX + at_mm[0] * _PX_PER_MM, _CORNER_PX + at_mm[1] * _PX_PER_MM)
        font = ImageFont.load_default(size=size_mm * _PX_PER_MM * 1.4)
        x0, y0, x1, y1 = draw.textbbox(at, text, font=font, anchor=anchor)
        draw.rectangle((x0 - 2, y0 - 1, x1 + 2, y1 + 1), fill=(29, 35, 39))
        draw.text(at, text, font=font, fill="white", anchor=anchor)

    places = place(design)
    for ref in _MODULES:
        component, at = design.component(ref), places[ref]
        for shape in FOOTPRINTS[component.part.footprint].drawings:
            if isinstance(shape, Label) and shape.layer == "F.SilkS":
                write(shape.text, turn(shape.at_mm, at), shape.size_mm,
                      {"left": "lm", "right": "rm", "center": "mm"}[shape.justify])  # fmt: skip
    for pad in placed_pads(design):
        if pad.ref in _TERMINALS:
            write("-" if pad.net == "GND" else "+", (pad.center_mm[0], pad.center_mm[1] - 1), 3)
    for ref in (*_TERMINALS, "J3"):
        xs = [pad.center_mm[0] for pad in placed_pads(design) if pad.ref == ref]
        write(design.component(ref).label, ((min(xs) + max(xs)) / 2, 97.2), 1.3)
    named.save(file)


def pages_shown(variant: str) -> tuple[str, ...]:
    """Return the pages of a schematic that are drawn."""
    return {"rev-b": tuple(PAGES), "lm317": ("supply",), "rev-c": ("serial", "modules", "supply")}[variant]


def schematic_pictures(variant: str) -> list[Path]:
    """Draw the pages of a schematic; of the variants only the page that differs."""
    if shutil.which("pdftoppm") is None:
        return []
    files = []
    with tempfile.TemporaryDirectory() as folder:
        pdf = Path(folder) / "pages.pdf"
        kicad_cli.schematic_pdf(generated_files.GENERATED / variant / f"{variant}.kicad_sch", pdf)
        for page in pages_shown(variant):
            number = str(PAGES.index(page) + 2)
            target = generated_files.PICTURES / f"{variant}-{page}"
            subprocess.run(["pdftoppm", "-r", str(_PAGE_DPI), "-f", number, "-l", number, "-singlefile", "-png",
                            str(pdf),
                            str(target)], check=True)  # fmt: skip
            file = target.with_suffix(".png")
            _shrink(file)
            files.append(file)
    return files


def _bare_picture(variant: str, board: Path) -> Path:
    """Render the board without its parts, for the names that the modules hide."""
    bare = board.with_name("bare.kicad_pcb")
    bare.write_text(board.read_text(encoding="utf-8").replace("/library/models/", "/no-models/"), encoding="utf-8")
    file = generated_files.PICTURES / f"{variant}-bare.png"
    kicad_cli.picture(bare, file, "--side", "top", "--width", "1000", "--height", "1000", "--background", "opaque")
    _shrink(file)
    return file


def plot(result: DeckResult) -> Path:
    """Renew the plot of a deck that has run; return its file."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    deck = result.deck
    generated_files.PICTURES.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(5.6, 3.5), dpi=90, layout="constrained")
    x = [value * deck.x_scale for value in result.columns[0]]
    for column, (_, legend), stroke in zip(result.columns[1:], deck.traces, itertools.cycle(_STROKES)):
        axes.plot(x, column, label=legend, **stroke)
    axes.set_title(deck.title, fontsize=9)
    axes.set_xlabel(deck.x_label, fontsize=8)
    axes.set_ylabel(deck.y_label, fontsize=8)
    axes.tick_params(labelsize=8)
    axes.grid(visible=True, alpha=0.3)
    # Below the axes: within them it would lie on the curves.
    figure.legend(fontsize=7, loc="outside lower center", ncols=3, frameon=False)
    file = generated_files.PICTURES / f"sim-{deck.name}.png"
    figure.savefig(file, metadata={"Software": None})
    plt.close(figure)
    _shrink(file)
    return file


def _shrink(file: Path, crop: tuple[int, int, int, int] | None = None) -> None:
    """Store a picture with 128 colours: a fifth of the size, and no difference to the eye; crop it where asked."""
    from PIL import Image

    with Image.open(file) as image:
        small = image.crop(crop or (0, 0, *image.size)).convert("RGB").quantize(128, dither=Image.Dither.NONE)
    small.save(file, optimize=True)
