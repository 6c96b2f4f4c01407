"""Pads and drawings of a footprint, as plain values in millimetres.

Origin and axes are KiCad's: x to the right, y down, the part seen from above.
"""

from dataclasses import dataclass
from enum import StrEnum

#: Narrowest stroke that makers print.
SILK_MM = 0.15


class PadKind(StrEnum):
    """How a pad is made."""

    SMD = "smd"
    THROUGH = "thru_hole"
    #: A hole without copper.
    HOLE = "np_thru_hole"


class PadShape(StrEnum):
    """Outline of a pad."""

    RECT = "rect"
    ROUND_RECT = "roundrect"
    OVAL = "oval"
    CIRCLE = "circle"


@dataclass(frozen=True, slots=True, kw_only=True)
class Pad:
    """One pad; `size_mm` is width and height before any rotation."""

    number: str
    kind: PadKind
    shape: PadShape
    at_mm: tuple[float, float]
    size_mm: tuple[float, float]
    drill_mm: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StraightStroke:
    """A straight stroke on a layer."""

    layer: str
    start_mm: tuple[float, float]
    end_mm: tuple[float, float]
    width_mm: float = SILK_MM


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle:
    """A circle on a layer, filled or not."""

    layer: str
    center_mm: tuple[float, float]
    radius_mm: float
    is_filled: bool = False
    width_mm: float = SILK_MM


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """A text on a layer."""

    layer: str
    text: str
    at_mm: tuple[float, float]
    size_mm: float = 0.8
    #: "left", "right" or "center": which end stands at the position.
    justify: str = "center"
    angle_deg: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PartBox:
    """A body of the 3D picture: centre and size seen from above, and its height range."""

    center_mm: tuple[float, float]
    size_mm: tuple[float, float]
    z_mm: tuple[float, float]
    #: Red, green and blue from 0 to 1.
    colour: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class PartFootprint:
    """What a part needs on the board."""

    name: str
    description: str
    pads: tuple[Pad, ...]
    drawings: tuple[StraightStroke | Circle | Label, ...]
    #: Where the reference stands, before rotation.
    ref_at_mm: tuple[float, float]
    boxes: tuple[PartBox, ...] = ()

    @property
    def is_smd(self) -> bool:
        """Tell whether every pad is a surface pad."""
        return all(pad.kind is PadKind.SMD for pad in self.pads)


def rectangle(
    layer: str, left: float, top: float, right: float, bottom: float, width: float = SILK_MM
) -> list[StraightStroke]:
    """Return the four sides of a rectangle."""
    corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
    return [
        StraightStroke(layer=layer, start_mm=corners[index], end_mm=corners[(index + 1) % 4], width_mm=width)
        for index in range(4)
    ]  # fmt: skip


def courtyard(left: float, top: float, right: float, bottom: float) -> list[StraightStroke]:
    """Return the keep-away rectangle of a part."""
    return rectangle("F.CrtYd", left, top, right, bottom, 0.05)
