"""What a body is made of: boxes and upright cylinders, added and cut away in turn.

Axes are those of the board: x to the right, y down the picture, z up from the board's
upper side, millimetres. Whether a point lies in a body follows from the list of its
solids alone, so that a fit is checked without a modeller.

Invariant: a body's later solids act on what the earlier ones left.
"""

from dataclasses import dataclass
from typing import TypeAlias

#: Least and most of x, y and z.
Extent: TypeAlias = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A box between two corners; its upright edges may be round."""

    x: tuple[float, float]
    y: tuple[float, float]
    z: tuple[float, float]
    is_cut: bool = False
    #: Radius of the four upright edges.
    corner_mm: float = 0.0
    #: What it is for.
    name: str = ""

    @property
    def extent(self) -> Extent:
        """Return the space that it takes."""
        return (*self.x, *self.y, *self.z)

    def holds(self, x: float, y: float, z: float) -> bool:
        """Tell whether a point is in it."""
        if not (self.x[0] <= x <= self.x[1] and self.y[0] <= y <= self.y[1] and self.z[0] <= z <= self.z[1]):
            return False
        beside = max(self.x[0] + self.corner_mm - x, x - self.x[1] + self.corner_mm, 0.0)
        above = max(self.y[0] + self.corner_mm - y, y - self.y[1] + self.corner_mm, 0.0)
        return beside == 0.0 or above == 0.0 or beside**2 + above**2 <= self.corner_mm**2


@dataclass(frozen=True, slots=True, kw_only=True)
class UprightCylinder:
    """An upright cylinder."""

    at: tuple[float, float]
    radius_mm: float
    z: tuple[float, float]
    is_cut: bool = False
    name: str = ""

    @property
    def extent(self) -> Extent:
        """Return the space that it takes."""
        (x, y), r = self.at, self.radius_mm
        return (x - r, x + r, y - r, y + r, *self.z)

    def holds(self, x: float, y: float, z: float) -> bool:
        """Tell whether a point is in it."""
        return (x - self.at[0]) ** 2 + (y - self.at[1]) ** 2 <= self.radius_mm**2 and self.z[0] <= z <= self.z[1]


Solid: TypeAlias = Block | UprightCylinder


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedPart:
    """A printed part."""

    name: str
    solids: tuple[Solid, ...]

    def holds(self, x: float, y: float, z: float) -> bool:
        """Tell whether there is material at a point."""
        is_there = False
        for solid in self.solids:
            if is_there == solid.is_cut and solid.holds(x, y, z):
                is_there = not solid.is_cut
        return is_there

    def near(self, extent: Extent) -> "PrintedPart":
        """Return the body of those solids only that reach into a space."""
        left, right, top, bottom, low, high = extent
        return PrintedPart(name=self.name, solids=tuple(
            solid for solid in self.solids
            if (of := solid.extent)[0] <= right and of[1] >= left and of[2] <= bottom and of[3] >= top
            and of[4] <= high and of[5] >= low
        ))  # fmt: skip

    @property
    def extent(self) -> Extent:
        """Return the space that it takes."""
        added = [solid.extent for solid in self.solids if not solid.is_cut]
        low, high = (
            [min(column) for column in zip(*added, strict=True)],
            [max(column) for column in zip(*added, strict=True)],
        )
        return (low[0], high[1], low[2], high[3], low[4], high[5])
