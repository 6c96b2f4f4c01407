"""Every generated file of the board, by path: what `make board` writes and what the checks compare.

The committed board has its pours as outlines; `filled_project` makes a copy with KiCad's
filling, from which gerbers, rule checks and pictures come.
Invariant: `sources` is a pure function of design, routes and stitches; it needs no KiCad.
"""

import hashlib
import io
import shutil
import zipfile
from pathlib import Path

from hardware.pcb.circuit.design import VARIANTS, build
from hardware.pcb.circuit.netlist import BoardDesign
from hardware.pcb.circuit.parts import PARTS
from hardware.pcb.layout.footprints import FOOTPRINTS
from hardware.pcb.layout.routing import HERE, Track, Via, load_routes
from hardware.pcb.outputs import bom, kicad_cli, project, steps
from hardware.pcb.outputs.assembly import assembly_svg
from hardware.pcb.outputs.board import board_text, footprint_file
from hardware.pcb.outputs.pours import fill, load_stitches
from hardware.pcb.outputs.project import model_text
from hardware.pcb.outputs.schematic import PAGES, library_text, page_text, root_text

GENERATED = HERE / "generated"
SIMULATION_PAGE = HERE.parent.parent / "docs" / "board-simulation.md"
PICTURES = HERE.parent.parent / "docs" / "pictures" / "board"
#: Name of the sums that an archive carries.
SUMS = "SHA256SUMS"
#: The date inside the archive: the oldest that the format knows, so that it never changes.
_ZIP_DATE = (1980, 1, 1, 0, 0, 0)


def sources() -> dict[str, str]:
    """Return the text of every file that needs no KiCad, by its path below generated/.

    Raises:
        RoutingError: Routes or pours are missing or were made for another placement.
    """
    files = {"library/adapter.kicad_sym": library_text()}
    bought = {part.footprint: part.bought for part in PARTS.values()}
    for footprint in FOOTPRINTS.values():
        files[f"library/adapter.pretty/{footprint.name}.kicad_mod"] = footprint_file(
            footprint, is_bought=bought.get(footprint.name, True)
        )
        files[f"library/models/{footprint.name}.wrl"] = model_text(footprint)
    for variant in VARIANTS:
        for name, text in variant_sources(build(variant)).items():
            files[f"{variant}/{name}"] = text
    return files


def variant_sources(design: BoardDesign) -> dict[str, str]:
    """Return the files of one variant by name."""
    variant = design.variant
    files = {f"{variant}.kicad_sch": root_text(design), f"{variant}.kicad_pro": project.project_text(design)}
    files |= {f"{variant}-{page}.kicad_sch": page_text(design, page) for page in PAGES}
    files |= project.library_tables()
    files[f"{variant}-bom.csv"] = bom.csv_text(design)
    files[f"{variant}.kicad_pcb"] = board_text(design, *copper_of(design), {})
    files[f"{variant}-placement.csv"] = bom.placement_csv(design)
    files[f"{variant}-bom.html"] = bom.html_text(design)
    files[f"{variant}-assembly.svg"] = assembly_svg(design)
    return files | steps.pictures(design)


def copper_of(design: BoardDesign) -> tuple[list[Track], list[Via]]:
    """Return tracks and vias of a board: the router's, and the stitching vias that meet ground on both sides."""
    tracks, vias = load_routes(design)
    return tracks, [*(via for via in vias if not via.is_stitch), *load_stitches(design.variant)]


def filled_project(variant: str, folder: Path) -> Path:
    """Write a variant's project with filled pours below a folder; return its board.

    Raises:
        MissingDependencyError: KiCad is not installed.
    """
    target = folder / variant
    shutil.copytree(GENERATED / variant, target, dirs_exist_ok=True)
    shutil.copytree(GENERATED / "library", folder / "library", dirs_exist_ok=True)
    design = build(variant)
    copper = copper_of(design)
    pours = fill(board_text(design, *copper, {}))
    board = target / f"{variant}.kicad_pcb"
    board.write_text(board_text(design, *copper, pours), encoding="utf-8", newline="\n")
    return board


def write_sources(folder: Path = GENERATED) -> list[str]:
    """Write what changed; return the paths written."""
    written = []
    for name, text in sources().items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8", newline="\n")
            written.append(name)
    return written


def stale_files(files: dict[str, str], folder: Path = GENERATED) -> list[str]:
    """Return which of these files (`sources`) are missing in a folder or differ there."""
    return [
        name
        for name, text in files.items()
        if not (folder / name).exists() or (folder / name).read_text(encoding="utf-8") != text
    ]


def fabrication_files(board: Path, work: Path) -> dict[str, str]:
    """Return gerbers and drill files of a filled board by name, without their date lines; needs KiCad.

    Args:
        board: What `filled_project` returned.
        work: A folder to write into.
    """
    work.mkdir(parents=True, exist_ok=True)
    kicad_cli.fabrication(board, work)
    return {path.name: path.read_text(encoding="utf-8") for path in sorted(work.iterdir())}


def fabrication_archive(variant: str, folder: Path = GENERATED) -> dict[str, str]:
    """Return the committed fabrication files of a variant by name, sums aside; none where there is no archive."""
    return {name: text for name, text in _archived(variant, folder).items() if name != SUMS}


def checksum_faults(variant: str, folder: Path = GENERATED) -> list[str]:
    """Return the files of a committed archive that its own sums do not hold, as `sha256sum -c` would."""
    files = _archived(variant, folder)
    wanted = sums(files)
    return [] if not files or files.get(SUMS) == wanted else [f"{variant}-gerbers.zip: {SUMS} is not that of its files"]


def sums(files: dict[str, str]) -> str:
    """Return the sums of files, as sha256sum writes them."""
    return "".join(
        f"{hashlib.sha256(files[name].encode()).hexdigest()}  {name}\n" for name in sorted(files) if name != SUMS
    )


def archive(files: dict[str, str]) -> bytes:
    """Return a zip archive that is the same for the same files; it carries their sums."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as target:
        for name, text in sorted({**files, SUMS: sums(files)}.items()):
            target.writestr(zipfile.ZipInfo(name, _ZIP_DATE), text, zipfile.ZIP_DEFLATED, 9)
    return out.getvalue()


def _archived(variant: str, folder: Path) -> dict[str, str]:
    file = folder / variant / f"{variant}-gerbers.zip"
    if not file.exists():
        return {}
    with zipfile.ZipFile(file) as source:
        return {name: source.read(name).decode() for name in source.namelist()}
