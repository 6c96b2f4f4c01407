"""The board as a case sees it: its holes, and the bodies of its parts where they stand.

Source: hardware/pcb/layout (places, footprints with their bodies), for a variant of the board.
"""

from dataclasses import dataclass
from functools import cache

from hardware.pcb.circuit.design import build
from hardware.pcb.layout.footprints import FOOTPRINTS
from hardware.pcb.layout.placement import place
from hardware.pcb.layout.routing import placed_pads, turn
from hardware.pcb.layout.shapes import PadKind

VARIANT = "rev-b"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedBox:
    """A body of a part, in board axes; z is 0 at the board's upper side."""

    part: str
    x: tuple[float, float]
    y: tuple[float, float]
    z: tuple[float, float]


@cache
def bodies(variant: str = VARIANT) -> tuple[PlacedBox, ...]:
    """Return the bodies of all parts, part by part in the order of their footprints."""
    design = build(variant)
    places = place(design)
    found = []
    for component in design.components:
        at = places[component.ref]
        for box in FOOTPRINTS[component.part.footprint].boxes:
            (x, y), (width, height) = turn(box.center_mm, at), box.size_mm
            if round(at.angle_deg / 90) % 2:
                width, height = height, width
            found.append(PlacedBox(part=component.ref, x=(x - width / 2, x + width / 2),
                                   y=(y - height / 2, y + height / 2), z=box.z_mm))  # fmt: skip
    return tuple(found)


def body_of(part: str, *, index: int = 0, variant: str = VARIANT) -> PlacedBox:
    """Return one body of a part, counted as its footprint lists them."""
    return [box for box in bodies(variant) if box.part == part][index]


def part_place(part: str, variant: str = VARIANT) -> tuple[float, float]:
    """Return where a part stands."""
    at = place(build(variant))[part]
    return at.x_mm, at.y_mm


@cache
def mounting_holes(variant: str = VARIANT) -> tuple[tuple[float, float], ...]:
    """Return the places of the holes that no pad is in."""
    return tuple(
        placed.center_mm
        for placed in placed_pads(build(variant))
        if placed.pad.kind is PadKind.HOLE and not placed.pad.number
    )


def through_pads(variant: str = VARIANT) -> list[tuple[float, float, float]]:
    """Return the pads that come out below the board: x, y and the radius that their solder takes."""
    return [
        (*placed.center_mm, max(placed.pad.size_mm) / 2)
        for placed in placed_pads(build(variant))
        if placed.pad.kind is PadKind.THROUGH
    ]
