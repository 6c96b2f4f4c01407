"""The plan of all that never moves: fixed obstacles and meshes, cut once and kept by place."""

import math
from collections.abc import Iterable

from p2os.parameters import RobotParameters
from p2os.pioneer.footprint_grid import FootprintGrid
from p2os.pioneer.geometry import Footprint
from p2os.pioneer.mesh_plan import cut, shadow
from p2os.pioneer.scenery import Mesh, Obstacle, World

#: chosen: wheels of 165 mm roll over what is lower, and a robot's maker calls it a sill.
SILL_M = 0.02


class Bands:
    """The heights at which a robot meets things.

    `touch`: what the hull meets; `ring`: where its sonar look; `low`: what passes under the
    hull and stops its wheels.
    """

    __slots__ = ("low", "ring", "touch")

    def __init__(self, parameters: RobotParameters) -> None:
        body = parameters.body
        self.touch = (body.ground_clearance_m, body.hull_height_m)
        self.ring = parameters.sonar_height_m
        self.low = (min(SILL_M, body.ground_clearance_m), body.ground_clearance_m)

    def is_touched(self, item: Obstacle) -> bool:
        """Tell whether the hull can meet it."""
        return item.stands_in(*self.touch)

    def echoes(self, item: Obstacle) -> bool:
        """Tell whether the sonar hear it."""
        return item.stands_in(self.ring, self.ring)

    def stops_wheels(self, item: Obstacle) -> bool:
        """Tell whether it passes under the hull and is too high to be driven over."""
        return item.stands_in(*self.low) and not self.is_touched(item)

    def is_sill(self, item: Obstacle) -> bool:
        """Tell whether wheels drive over it."""
        stands_on_floor = item.base_m - item.floor_m <= self.low[0]
        return not item.kind.is_driven_on and stands_on_floor and not item.stands_in(self.low[0], math.inf)


class StaticPlan:
    """What is fixed in a world, for one model of robot."""

    def __init__(self, world: World, parameters: RobotParameters) -> None:
        bands = Bands(parameters)
        self.obstacles = tuple(item for item in world.obstacles if item.fixed)
        self.names = frozenset(item.name for item in self.obstacles) | {mesh.name for mesh in world.meshes}
        footprints = [(item, Footprint(item)) for item in self.obstacles]
        touched = [shape for item, shape in footprints if bands.is_touched(item)]
        heard = [shape for item, shape in footprints if bands.echoes(item)]
        low = [shape for item, shape in footprints if bands.stops_wheels(item)]
        self.touched = FootprintGrid([*touched, *_shadows(world.meshes, *bands.touch)])
        self.heard = FootprintGrid([*heard, *_cuts(world.meshes, bands.ring)])
        self.low = FootprintGrid(low)


def _shadows(meshes: Iterable[Mesh], low_m: float, high_m: float) -> list[Footprint]:
    return [Footprint.of_polygon(mesh.name, polygon) for mesh in meshes for polygon in shadow(mesh, low_m, high_m)]


def _cuts(meshes: Iterable[Mesh], height_m: float) -> list[Footprint]:
    return [Footprint.of_polygon(mesh.name, segment) for mesh in meshes for segment in cut(mesh, height_m)]
