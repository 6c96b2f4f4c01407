"""Pictures for docs/: the board from above and below, schematic pages, assembly drawings, plots.

They need KiCad, pdftoppm (poppler-utils) and matplotlib, and are small on purpose.
A picture is for looking at: no check compares it.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

from hardware.pcb.outputs import generated_files, kicad_cli
from hardware.pcb.outputs.schematic import PAGES
from hardware.pcb.spice.run import Result

_PAGE_DPI = 110
_SIDES = {
    "top": ("--side", "top"),
    "bottom": ("--side", "bottom"),
    # Without perspective, for with it KiCad draws another picture each time.
    "view": ("--rotate", "-48,0,-25", "--zoom", "0.62"),
}
#: What of the picture at an angle is not sky: left, top, right, bottom.
_CROP = (60, 190, 920, 790)


def board_pictures(variant: str, board: Path) -> list[Path]:
    """Render a filled board from both sides and at an angle; of the other variants the top alone."""
    files = []
    generated_files.PICTURES.mkdir(parents=True, exist_ok=True)
    for side, arguments in _SIDES.items():
        if variant != "rev-b" and side != "top":
            continue
        file = generated_files.PICTURES / f"{variant}-{side}.png"
        kicad_cli.picture(board, file, *arguments, "--width", "1000", "--height", "1000", "--background", "opaque")
        _shrink(file, _CROP if side == "view" else None)
        files.append(file)
    if variant == "rev-b":
        files.append(_bare_picture(board))
    return files


def schematic_pictures(variant: str) -> list[Path]:
    """Draw the pages of a schematic; of the variants only the page that differs."""
    if shutil.which("pdftoppm") is None:
        return []
    wanted = {"rev-b": PAGES, "lm317": ("supply",), "rev-c": ("serial", "modules")}[variant]
    files = []
    with tempfile.TemporaryDirectory() as folder:
        pdf = Path(folder) / "pages.pdf"
        kicad_cli.schematic_pdf(generated_files.GENERATED / variant / f"{variant}.kicad_sch", pdf)
        for page in wanted:
            number = str(PAGES.index(page) + 2)
            target = generated_files.PICTURES / f"{variant}-{page}"
            subprocess.run(["pdftoppm", "-r", str(_PAGE_DPI), "-f", number, "-l", number, "-singlefile", "-png",
                            str(pdf),
                            str(target)], check=True)  # fmt: skip
            file = target.with_suffix(".png")
            _shrink(file)
            files.append(file)
    return files


def _bare_picture(board: Path) -> Path:
    """Render the board without its parts, for the names that the modules hide."""
    bare = board.with_name("bare.kicad_pcb")
    bare.write_text(board.read_text(encoding="utf-8").replace("/library/models/", "/no-models/"), encoding="utf-8")
    file = generated_files.PICTURES / "rev-b-bare.png"
    kicad_cli.picture(bare, file, "--side", "top", "--width", "1000", "--height", "1000", "--background", "opaque")
    _shrink(file)
    return file


def plot(result: Result) -> Path:
    """Renew the plot of a deck that has run; return its file."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    deck = result.deck
    generated_files.PICTURES.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(figsize=(5.6, 3.0), dpi=90, layout="constrained")
    x = [value * deck.x_scale for value in result.columns[0]]
    for column, (_, legend) in zip(result.columns[1:], deck.traces, strict=True):
        axes.plot(x, column, label=legend, linewidth=1.4)
    axes.set_title(deck.title, fontsize=9)
    axes.set_xlabel(deck.x_label, fontsize=8)
    axes.set_ylabel(deck.y_label, fontsize=8)
    axes.tick_params(labelsize=8)
    axes.grid(visible=True, alpha=0.3)
    axes.legend(fontsize=7)
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
