"""The scene of a world, of a robot, and of a robot at a world's start."""

import math
from collections.abc import Iterable
from dataclasses import replace

from p2os.errors import WorldError
from p2os.pioneer.body.physical import (
    CASTER_MASS_KG,
    HULL_FRICTION,
    STANDING_FRICTION,
    WHEEL_FRICTION,
    Chassis,
    floor_box,
    half_sizes,
    middle_and_slope,
)
from p2os.pioneer.export.scene import (
    Box,
    Cylinder,
    ExportScene,
    FixedPose,
    JointKind,
    Property,
    SceneBody,
    SceneMark,
    Shape,
    Sphere,
    TriangleMesh,
    Vector,
)
from p2os.pioneer.world.drawing import Look, look_of
from p2os.pioneer.world.interchange.words import GROUND, ROBOT
from p2os.pioneer.world.model import LONGEST_NAME, Obstacle, ObstacleKind, World
from p2os.robots.parameters import RobotParameters

WORLD = "world"
CASTER = "caster"
#: chosen: colours of the robot.
HULL_COLOUR, WHEEL_COLOUR = (0.75, 0.1, 0.1), (0.12, 0.12, 0.12)


def scene_of(world: World | None, robot: RobotParameters | None) -> ExportScene:
    """Return the scene of a world, of a robot, or of a robot at the start of a world.

    Raises:
        WorldError: There is neither.
    """
    if world is None and robot is None:
        raise WorldError("neither a world nor a robot to export")
    bodies: list[SceneBody] = []
    holds: dict[Property, int] = {}
    names = _Names(robot)
    if world is not None:
        bodies += _world_bodies(world, names)
        holds |= {
            Property.KIND: sum(item.kind is not ObstacleKind.OBSTACLE for item in world.obstacles),
            Property.PUSHED: sum(item.mass_kg > 0 for item in world.obstacles),
            Property.WALK: sum(item.walk is not None for item in world.obstacles),
            Property.MESH: len(world.meshes),
            Property.MARK: len(world.marks),
            Property.START: int(robot is None),
        }
    if robot is not None:
        start = FixedPose() if world is None else _start(world)
        bodies += (body if world is None else replace(body, kind=ROBOT) for body in _robot_bodies(robot, start))
        fitted = robot.sonar[: robot.sonar_fitted]
        wheels = len(robot.wheel_places)
        holds |= {
            Property.WHEEL: wheels, Property.TORQUE: wheels, Property.SONAR: len(fitted), Property.CONE: len(fitted),
        }  # fmt: skip
    holds |= {
        Property.BOX: sum(isinstance(body.shape, Box) for body in bodies),
        Property.ROUND: sum(isinstance(body.shape, Cylinder | Sphere) for body in bodies),
        Property.POSE: len(bodies),
        Property.MASS: sum(body.mass_kg > 0 for body in bodies),
        Property.FRICTION: len(bodies),
        Property.NAME: names.changed,
    }
    name = world.name if world is not None else robot.subclass if robot is not None else ""
    return ExportScene(
        name=name or WORLD,
        bodies=tuple(bodies),
        holds=holds,
        start=None if world is None else (world.start.x_m, world.start.y_m, world.start.z_m, world.start.heading_rad),
        extent=None if world is None else world.extent,
    )


class _Names:
    """Names that every format takes: some text, no `::`, no `__`, none that a format or the robot has taken."""

    def __init__(self, robot: RobotParameters | None) -> None:
        self._taken = {WORLD, GROUND, *(() if robot is None else part_names(robot))}
        self.changed = 0

    def take(self, wanted: str) -> str:
        name = wanted.replace("::", ":").replace("__", "_").strip() or "thing"
        number = 1
        base = name
        while name in self._taken:
            number += 1
            name = f"{base[: LONGEST_NAME - 8]} {number}"
        self._taken.add(name)
        self.changed += name != wanted
        return name


def _start(world: World) -> FixedPose:
    start = world.start
    return FixedPose(start.x_m, start.y_m, start.z_m, yaw_rad=start.heading_rad)


def _world_bodies(world: World, names: _Names) -> Iterable[SceneBody]:
    half, (x, y, z) = floor_box(world)
    yield SceneBody(
        name=GROUND, place=FixedPose(x, y, z), shape=Box((2 * half[0], 2 * half[1], 2 * half[2])),
        friction=STANDING_FRICTION, colour=(0.93, 0.93, 0.91), kind=GROUND, is_fixed=True,
    )  # fmt: skip
    for item in world.obstacles:
        yield _thing(item, names.take(item.name))
    for mesh in world.meshes:
        yield SceneBody(
            name=names.take(mesh.name), place=FixedPose(), shape=TriangleMesh(mesh.vertices, mesh.triangles),
            friction=STANDING_FRICTION, colour=_rgb(Look.THING), kind=ObstacleKind.OBSTACLE.value, is_fixed=True,
        )  # fmt: skip


def _thing(item: Obstacle, name: str) -> SceneBody:
    at = item if item.walk is None else replace(item, x_m=item.walk.points_m[0][0], y_m=item.walk.points_m[0][1])
    (x, y, z), slope = middle_and_slope(at)
    shape: Shape = Cylinder(item.radius_m, item.height_m)
    if not item.is_cylinder:
        length, width, height = half_sizes(item)
        shape = Box((2 * length, 2 * width, 2 * height))
    is_pushed = item.mass_kg > 0
    return SceneBody(
        name=name,
        place=FixedPose(x, y, z, pitch_rad=-slope, yaw_rad=item.heading_rad),
        shape=shape,
        friction=item.friction if is_pushed else STANDING_FRICTION,
        colour=_rgb(look_of(item)),
        motion=JointKind.FREE if is_pushed else JointKind.FIXED,
        mass_kg=item.mass_kg,
        inertia=_inertia(shape, item.mass_kg),
        kind=item.kind.value,
        floor_m=item.floor_m,
        is_fixed=item.fixed,
    )


def part_names(robot: RobotParameters) -> dict[str, str]:
    """Return the body of each part of a robot: its name in a scene, and what it is; the hull is ""."""
    parts = ["", *(wheel.name for wheel in robot.wheel_places), *([CASTER] if robot.has_caster else [])]
    return {f"{robot.subclass} {part}".strip(): part for part in parts}


def _robot_bodies(robot: RobotParameters, start: FixedPose) -> Iterable[SceneBody]:
    """Yield the hull in the robot frame (middle of the axle, on the floor), and what hangs on it."""
    own, chassis, name = robot.body, Chassis.of(robot), robot.subclass
    hull = Box((chassis.length_m, chassis.width_m, chassis.height_m))
    high_m = robot.sonar_height_m
    sonars = (
        SceneMark(
            name=f"{name} sonar {number}",
            place=FixedPose(pose.x_mm / 1000, pose.y_mm / 1000, high_m, yaw_rad=math.radians(pose.heading_deg)),
        )
        for number, pose in enumerate(robot.sonar[: robot.sonar_fitted])
    )  # fmt: skip
    places = robot.wheel_places
    # The engines' chassis rolls on two wheels and a caster, whatever the robot has.
    hull_kg = own.mass_kg - len(places) * own.wheel_mass_kg - (CASTER_MASS_KG if robot.has_caster else 0.0)
    yield SceneBody(
        name=name, place=start, shape=hull, at=FixedPose(chassis.centre[0], 0.0, chassis.middle_m),
        friction=HULL_FRICTION,
        colour=HULL_COLOUR, motion=JointKind.FREE, mass_kg=hull_kg, centre=chassis.centre,
        inertia=_inertia(hull, hull_kg), marks=tuple(sonars),
    )  # fmt: skip
    radius = own.wheel_diameter_m / 2
    tyre = Cylinder(radius, own.wheel_width_m)
    along, about, _ = _inertia(tyre, own.wheel_mass_kg)[2], *_inertia(tyre, own.wheel_mass_kg)[:2]
    for wheel in places:
        yield SceneBody(
            name=f"{name} {wheel.name}", parent=name, motion=JointKind.WHEEL,
            place=FixedPose(wheel.x_m, wheel.y_m, radius),
            shape=tyre, at=FixedPose(roll_rad=math.pi / 2), friction=WHEEL_FRICTION, colour=WHEEL_COLOUR,
            mass_kg=own.wheel_mass_kg, inertia=(about, along, about), torque_nm=own.motor_torque_nm,
        )  # fmt: skip
    if not robot.has_caster:
        return
    ball = Sphere(own.caster_radius_m)
    yield SceneBody(
        name=f"{name} {CASTER}", parent=name, place=FixedPose(own.caster_x_m, 0.0, own.caster_radius_m), shape=ball,
        friction=0.0, colour=WHEEL_COLOUR, mass_kg=CASTER_MASS_KG, inertia=_inertia(ball, CASTER_MASS_KG),
    )  # fmt: skip


def _inertia(shape: Shape, mass_kg: float) -> Vector:
    """Return the moments of a solid of even density about its own axes."""
    if isinstance(shape, Box):
        x, y, z = shape.size_m
        return mass_kg / 12 * (y * y + z * z), mass_kg / 12 * (x * x + z * z), mass_kg / 12 * (x * x + y * y)
    if isinstance(shape, Cylinder):
        across = mass_kg * (shape.radius_m**2 / 4 + shape.length_m**2 / 12)
        return across, across, mass_kg * shape.radius_m**2 / 2
    if isinstance(shape, Sphere):
        about = mass_kg * shape.radius_m**2 * 2 / 5
        return about, about, about
    return 0.0, 0.0, 0.0


def _rgb(look: Look) -> Vector:
    red, green, blue = bytes.fromhex(look.value.removeprefix("#"))
    return red / 255, green / 255, blue / 255
