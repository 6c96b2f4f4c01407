"""The bodies as STEP and STL, by build123d (extra `case`; a modeller of 1 GB, so it is in no other extra).

STEP and STL have y up where the board's axes have it down: each y changes its sign here, and nothing else.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from hardware.case.solids import Block, PrintedPart, Solid
from simbase.errors import MissingDependencyError

if TYPE_CHECKING:
    from types import ModuleType

#: Of the STL's triangles: how far they may be from the true surface.
TOLERANCE_MM = 0.05


def export(body: PrintedPart, folder: Path) -> list[Path]:
    """Write a body as STEP and STL; return the files.

    Raises:
        MissingDependencyError: build123d is not installed.
    """
    modeller = _modeller()
    part = model(body)
    step, stl = folder / f"{body.name}.step", folder / f"{body.name}.stl"
    modeller.export_step(part, str(step), timestamp="2026-01-01T00:00:00")
    modeller.export_stl(part, str(stl), tolerance=TOLERANCE_MM)
    return [step, stl]


def model(body: PrintedPart) -> Any:
    """Return a body as build123d's solid, y up.

    Raises:
        MissingDependencyError: build123d is not installed.
    """
    modeller = _modeller()
    part = None
    for solid in body.solids:
        shape = _shape(modeller, solid)
        part = shape if part is None else part - shape if solid.is_cut else part + shape
    return part


def _shape(modeller: "ModuleType", solid: Solid) -> Any:
    left, right, top, bottom, low, high = solid.extent
    middle = modeller.Pos((left + right) / 2, -(top + bottom) / 2, (low + high) / 2)
    if isinstance(solid, Block):
        shape = modeller.Box(right - left, bottom - top, high - low)
        if solid.corner_mm:
            shape = modeller.fillet(shape.edges().filter_by(modeller.Axis.Z), solid.corner_mm)
        return middle * shape
    return middle * modeller.Cylinder(solid.radius_mm, high - low)


def _modeller() -> "ModuleType":
    try:
        import build123d
    except ImportError as error:
        raise MissingDependencyError(
            "build123d is not installed", hint="python -m pip install build123d (1 GB with its modeller)"
        ) from error
    return cast("ModuleType", build123d)
