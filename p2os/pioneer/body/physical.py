"""What every physical body takes as given: who meets whom, masses and frictions, and when a wheel is stalled.

The engines are handed these numbers; nothing here computes a motion. Wheels and
caster meet floors and what is lower than the hull, the hull meets all else.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from p2os.pioneer.world.model import Obstacle, ObstacleKind, World, normal_of
from p2os.pioneer.world.plan import Bands
from p2os.robots.parameters import RobotParameters

OBSTACLE_GROUP, FLOOR_GROUP, WHEEL_GROUP, HULL_GROUP = 16, 2, 4, 8
#: Things that can be pushed, and things that pass under the hull and stop wheels.
PUSHED_GROUP, LOW_GROUP = 32, 64
#: What the hull meets, what wheels and caster meet, and what a pushed thing meets.
HULL_MEETS = OBSTACLE_GROUP | FLOOR_GROUP | PUSHED_GROUP | HULL_GROUP
WHEEL_MEETS = FLOOR_GROUP | LOW_GROUP
PUSHED_MEETS = HULL_GROUP | OBSTACLE_GROUP | FLOOR_GROUP | PUSHED_GROUP

#: Coulomb friction of rubber on a hard floor, and of the hull against a wall (chosen).
WHEEL_FRICTION, HULL_FRICTION = 0.8, 0.3
#: Of all that stands fast where an engine multiplies the frictions of both sides: what moves over it decides.
STANDING_FRICTION = 1.0
CASTER_MASS_KG = 0.2
GRAVITY_MPS2 = 9.81
FLOOR_THICKNESS_M = 0.5
#: The floor reaches farther than the world's extent by this.
FLOOR_MARGIN_M = 1.0
#: A level face of a mesh as near to height 0 is the floor itself, m.
ON_FLOOR_M = 2e-3
#: Steeper faces of a mesh are walls; chosen: a Pioneer climbs no more than half of it.
LEVEL_RAD = math.radians(20)

#: Steps after a reset in which the robot comes to rest on its wheels.
SETTLE_STEPS = 300
#: A wheel is stalled when its motor gives this share of its torque, its rim is slower than that, for so many steps.
STALL_TORQUE_SHARE = 0.95
STALL_RIM_MPS = 0.05
STALL_STEPS = 200
#: The share of its torque that a motor's gear passes on (chosen: two stages of spur gears); the rest is friction.
GEAR_EFFICIENCY = 0.73
#: So much more than what a motor gives at the wheel must turn the wheel back against it: the friction of the gear then
#: helps the motor. Without it a robot that leans on a thing swings about it for half a minute, as on two springs.
BACK_DRIVE = GEAR_EFFICIENCY**-2
#: The share of a motor's torque with which motor and gear hold a wheel without power that has come to rest (chosen: a
#: robot that is switched off can be pushed by hand, and stays on a slope of 6 degrees).
UNPOWERED_SHARE = 0.4
#: chosen: a rim that is slower is not pushed back, it trembles.
PUSHED_BACK_MPS = 2e-3
#: A thing that was displaced by less stands where it stood, m.
PUSHED_M = 1e-4

Vector = tuple[float, float, float]


def group_for(item: Obstacle, models: Sequence[Bands]) -> int:
    """Return what an obstacle meets where several models are: what it meets of each."""
    group = 0
    for bands in models:
        group |= group_of(item, bands)
    return group


def group_of(item: Obstacle, bands: Bands) -> int:
    """Return what an obstacle meets: sills and floors the wheels alone, low things too, and all else the hull."""
    if item.kind.is_driven_on or bands.is_sill(item):
        return FLOOR_GROUP
    if item.mass_kg > 0:
        return PUSHED_GROUP
    return LOW_GROUP if bands.stops_wheels(item) else OBSTACLE_GROUP


def floor_box(world: World) -> tuple[Vector, Vector]:
    """Return half the sizes and the middle of the level floor under a world, its top at height 0; metres."""
    x0, y0, x1, y1 = world.extent
    half = ((x1 - x0) / 2 + FLOOR_MARGIN_M, (y1 - y0) / 2 + FLOOR_MARGIN_M, FLOOR_THICKNESS_M / 2)
    return half, ((x0 + x1) / 2, (y0 + y1) / 2, -FLOOR_THICKNESS_M / 2)


def half_sizes(item: Obstacle) -> Vector:
    """Return half the length, width and height of a box, metres; of a ramp, of the box under its upper face."""
    if item.kind is ObstacleKind.RAMP:
        return math.hypot(item.length_m, item.height_m) / 2, item.width_m / 2, FLOOR_THICKNESS_M / 2
    return item.length_m / 2, item.width_m / 2, item.height_m / 2


def middle_and_slope(item: Obstacle) -> tuple[Vector, float]:
    """Return the middle of an obstacle's box, metres, and how far its length rises, radians."""
    if item.kind is not ObstacleKind.RAMP:
        return (item.x_m, item.y_m, item.base_m + item.height_m / 2), 0.0
    slope = math.atan2(item.height_m, item.length_m)
    # From the middle of the upper face down along its normal.
    back, down = math.sin(slope) * FLOOR_THICKNESS_M / 2, math.cos(slope) * FLOOR_THICKNESS_M / 2
    place = (
        item.x_m + back * math.cos(item.heading_rad),
        item.y_m + back * math.sin(item.heading_rad),
        item.base_m + item.height_m / 2 - down,
    )
    return place, slope


def is_level(corners: tuple[Vector, Vector, Vector]) -> bool:
    """Tell whether a face is level enough to be driven on."""
    nx, ny, nz = normal_of(*corners)
    return abs(nz) > math.cos(LEVEL_RAD) * math.sqrt(nx * nx + ny * ny + nz * nz)


@dataclass(frozen=True, slots=True, kw_only=True)
class Chassis:
    """The hull of a robot as a box with a mass, in the robot frame: metres and kilograms."""

    length_m: float
    width_m: float
    height_m: float
    #: Height of the box's middle.
    middle_m: float
    #: Centre of mass: the hull's middle, but no higher than the top of the wheels. Batteries and motors lie low,
    #: and a tall robot would else fall over when it brakes.
    centre: Vector
    #: Without wheels and caster.
    mass_kg: float

    @classmethod
    def of(cls, parameters: RobotParameters) -> "Chassis":
        """Return the chassis of a model."""
        body = parameters.body
        height = body.hull_height_m - body.ground_clearance_m
        middle_m = body.ground_clearance_m + height / 2
        return cls(
            length_m=body.hull_front_m + body.hull_rear_m,
            width_m=body.hull_width_m,
            height_m=height,
            middle_m=middle_m,
            centre=((body.hull_front_m - body.hull_rear_m) / 2, 0.0, min(middle_m, body.wheel_diameter_m)),
            mass_kg=body.mass_kg - 2 * body.wheel_mass_kg - CASTER_MASS_KG,
        )
