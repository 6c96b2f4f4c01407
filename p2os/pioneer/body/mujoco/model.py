"""A robot, its floor and the things around it as a MuJoCo model.

A model is a function of the things that stand in the world, not of where they stand:
whatever can move has its place in the state. So a state goes back into a model that was
made anew.

The motors are frictions: MuJoCo's dry friction between a wheel and a rotor that is turned
at the set-point pulls the wheel along with no more than the motor's torque.

MuJoCo takes every mesh for its convex hull. So a static mesh is two things here: its own
triangles, which the rays meet and nothing touches; and upright pieces over the plan of
all that stands between the hull's underside and its top, which the hull touches and no
ray meets. A mesh with faces that the wheels would climb is refused.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import mujoco

from p2os.errors import WorldError
from p2os.pioneer.body.mujoco.engine import MOTOR_SOLREF, RIGID_SOLIMP, new_spec
from p2os.pioneer.body.physical import (
    CASTER_MASS_KG,
    FLOOR_GROUP,
    HULL_FRICTION,
    HULL_GROUP,
    HULL_MEETS,
    LOW_GROUP,
    OBSTACLE_GROUP,
    ON_FLOOR_M,
    PUSHED_GROUP,
    PUSHED_MEETS,
    WHEEL_FRICTION,
    WHEEL_MEETS,
    Chassis,
    floor_box,
    group_for,
    half_sizes,
    is_level,
    middle_and_slope,
)
from p2os.pioneer.world.model import Mesh, Obstacle, Polygon, World, shadow
from p2os.pioneer.world.plan import Bands
from p2os.robots.parameters import RobotParameters

#: As MuJoCo writes it: w, x, y, z.
Quaternion = tuple[float, float, float, float]
#: Groups of geometry as MuJoCo's rays choose them: what they meet, and what they pass through.
ECHOING, SILENT = 0, 1
#: An obstacle's body and joint; with the prefix no name of a world file is one of the robot's.
THING = "thing: "
#: A rotor is not held back by what it pulls, kg m².
ROTOR_INERTIA = 1e6
#: Where the rotors turn, far from all that could be met, m.
ROTORS_AT_M = -50.0
#: A hull rests so far from what it leans on, m: at a distance of zero the engine now and then finds a contact with a
#: wrong normal, and the hull hops. As `bullet`, which calls so near touching.
KEPT_APART_M = 1e-4
#: How thick an upright face is to the hull, m; chosen: more than the fastest robot drives in a step.
WALL_THICK_M = 4e-3
#: chosen: of so many pieces the model is made within a second or two.
MOST_PIECES = 5000
#: MuJoCo's meshes have four corners at least.
LEAST_CORNERS = 4

_BOX, _CYLINDER, _MESH = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_MESH
_SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE
_HINGE = mujoco.mjtJoint.mjJNT_HINGE


@dataclass(frozen=True, slots=True)
class RobotNames:
    """What the parts of one robot are called: bodies, joints and geometry."""

    robot: str
    hull: str
    caster: str
    wheels: tuple[str, str]
    rotors: tuple[str, str]

    @classmethod
    def of(cls, number: int) -> "RobotNames":
        """Return the names of a robot, counted from 0."""
        own = f"robot {number}: "
        return cls(
            f"{own}base", f"{own}hull", f"{own}caster", (f"{own}left wheel", f"{own}right wheel"),
            (f"{own}left rotor", f"{own}right rotor"),
        )  # fmt: skip

    @property
    def joints(self) -> tuple[str, ...]:
        """Its place in the world, its wheels, and what drives them."""
        return (self.robot, *self.wheels, *self.rotors)


def make_model(world: World, models: Sequence[RobotParameters], things: Iterable[Obstacle]) -> mujoco.MjModel:
    """Return a model of a world's building, its robots, and what stands around them.

    Args:
        world: Its fixed obstacles and meshes are the building.
        models: Of the robots, the first first.
        things: All that is not fixed; their places go into the state (`body`).

    Raises:
        WorldError: A mesh cannot be met as this body meets meshes.
    """
    spec, every = new_spec(), [Bands(parameters) for parameters in models]
    root = spec.worldbody
    half, place = floor_box(world)
    root.add_geom(name="floor", type=_BOX, size=half, pos=place, **_collision(FLOOR_GROUP, 0, 0.0))
    for item in world.obstacles:
        if item.fixed:
            place, slope = middle_and_slope(item)
            turn = quaternion(item.heading_rad, slope)
            root.add_geom(pos=place, quat=turn, **_shape(item), **_collision(group_for(item, every), 0, 0.0))
    for number, mesh in enumerate(world.meshes):
        _add_mesh(spec, mesh, f"mesh {number}", every, world.source)
    for number, parameters in enumerate(models):
        _add_robot(spec, parameters, RobotNames.of(number))
    for item in things:
        _add_thing(root, item, group_for(item, every))
    try:
        return spec.compile()
    except ValueError as error:  # the engine's own checks
        reason = " ".join(str(error).split())
        raise WorldError(
            f"{world.source}: the mujoco body cannot take this world: {reason}",
            hint="--body bullet or --body kinematic",
        ) from error


def floor_geometries(model: mujoco.MjModel) -> frozenset[int]:
    """Return the numbers of all geometry that the robot drives on."""
    return _of_group(model, FLOOR_GROUP)


def low_geometries(model: mujoco.MjModel) -> frozenset[int]:
    """Return the numbers of all geometry that passes under the hull and stops wheels."""
    return _of_group(model, LOW_GROUP)


def _of_group(model: mujoco.MjModel, group: int) -> frozenset[int]:
    return frozenset(
        number
        for number, own in enumerate(model.geom_contype)
        if own & group and not own & (OBSTACLE_GROUP | PUSHED_GROUP)
    )


def _collision(group: int, meets: int, friction: float) -> dict[str, object]:
    """Return what a piece of geometry meets; of two that meet, the greater friction counts."""
    return {"contype": group, "conaffinity": meets, "friction": [friction, 0.0, 0.0], "condim": 3, "group": ECHOING}


def _shape(item: Obstacle) -> dict[str, object]:
    if item.is_cylinder:
        return {"type": _CYLINDER, "size": (item.radius_m, item.height_m / 2, 0.0)}
    return {"type": _BOX, "size": half_sizes(item)}


def _add_thing(root: mujoco.MjsBody, item: Obstacle, group: int) -> None:
    """Add a thing at the world's middle; where it stands is a matter of the state."""
    if group & PUSHED_GROUP:
        body = root.add_body(name=THING + item.name)
        body.add_freejoint(name=THING + item.name)
        body.add_geom(mass=item.mass_kg, **_shape(item), **_collision(PUSHED_GROUP, PUSHED_MEETS, item.friction))
    else:
        body = root.add_body(name=THING + item.name, mocap=True)
        body.add_geom(**_shape(item), **_collision(group, 0, 0.0))


def _add_robot(spec: mujoco.MjSpec, parameters: RobotParameters, names: RobotNames) -> None:
    """Add a robot: its body's frame is the robot frame of `body`, the middle of the axle on the floor."""
    own, chassis = parameters.body, Chassis.of(parameters)
    length, width, height, mass = chassis.length_m, chassis.width_m, chassis.height_m, chassis.mass_kg
    radius = own.wheel_diameter_m / 2
    robot = spec.worldbody.add_body(name=names.robot)
    robot.add_freejoint(name=names.robot)
    hull = _collision(HULL_GROUP, HULL_MEETS, HULL_FRICTION) | {"group": SILENT, "priority": 1, "margin": KEPT_APART_M}
    wheel = _collision(0, WHEEL_MEETS, WHEEL_FRICTION) | {"group": SILENT}
    caster = _collision(0, WHEEL_MEETS, 0.0) | {"group": SILENT, "priority": 1, "condim": 1}
    # The hull's mass is a box about the chassis' own centre, lower than the geometry's middle on a tall robot.
    inertia = [mass / 12 * (a * a + b * b) for a, b in ((width, height), (length, height), (length, width))]
    solid = robot.add_body(name=names.hull, pos=chassis.centre, mass=mass, inertia=inertia, explicitinertial=True)
    above = (0.0, 0.0, chassis.middle_m - chassis.centre[2])
    solid.add_geom(name=names.hull, type=_BOX, size=(length / 2, width / 2, height / 2), pos=above, mass=0.0, **hull)
    robot.add_geom(
        name=names.caster, type=_SPHERE, size=(own.caster_radius_m, 0.0, 0.0),
        pos=(own.caster_x_m, 0.0, own.caster_radius_m), mass=CASTER_MASS_KG, **caster,
    )  # fmt: skip
    for name, rotor_name, side in zip(names.wheels, names.rotors, (1, -1), strict=True):
        body = robot.add_body(name=name, pos=(0.0, side * parameters.track_mm / 2000, radius))
        body.add_joint(name=name, type=_HINGE, axis=(0.0, 1.0, 0.0), armature=parameters.rotor_inertia_kg_m2)
        body.add_geom(name=name, type=_SPHERE, size=(radius, 0.0, 0.0), mass=own.wheel_mass_kg, **wheel)
        rotor = spec.worldbody.add_body(name=rotor_name, pos=(0.0, 0.0, ROTORS_AT_M))
        rotor.add_joint(name=rotor_name, type=_HINGE, axis=(0.0, 1.0, 0.0), armature=ROTOR_INERTIA)
        rotor.add_geom(type=_SPHERE, size=(0.01, 0.0, 0.0), contype=0, conaffinity=0, group=SILENT)
        motor = spec.add_tendon(
            name=name, frictionloss=own.motor_torque_nm, solref_friction=list(MOTOR_SOLREF),
            solimp_friction=list(RIGID_SOLIMP),
        )  # fmt: skip
        motor.wrap_joint(name, 1.0)
        motor.wrap_joint(rotor_name, -1.0)


# Meshes ---------------------------------------------------------------------------------


def _add_mesh(spec: mujoco.MjSpec, mesh: Mesh, name: str, every: Sequence[Bands], source: str) -> None:
    """Add a mesh to a model under a name of its own.

    Raises:
        WorldError: It has faces that wheels would climb, or too many for this engine.
    """
    for bands in every:
        _refuse_slopes(mesh, bands, source)
    low, high = min(bands.touch[0] for bands in every), max(bands.touch[1] for bands in every)
    pieces = shadow(mesh, low, high)
    if len(pieces) > MOST_PIECES:
        raise WorldError(
            f"{source}: mesh {mesh.name!r}: {len(pieces)} pieces between {low:g} and {high:g} m of height;"
            f" the mujoco body takes {MOST_PIECES}",
            hint="--body bullet or --body kinematic",
        )
    _asset(spec, name, [value for vertex in mesh.vertices for value in vertex], mesh.triangles)
    spec.worldbody.add_geom(type=_MESH, meshname=name, contype=0, conaffinity=0, group=ECHOING)
    met = {"contype": OBSTACLE_GROUP, "conaffinity": 0, "friction": [0.0, 0.0, 0.0], "group": SILENT}
    for number, outline in enumerate(pieces):
        if len(outline) == 2:
            (ax, ay), (bx, by) = outline
            spec.worldbody.add_geom(
                type=_BOX, pos=((ax + bx) / 2, (ay + by) / 2, (low + high) / 2),
                quat=quaternion(math.atan2(by - ay, bx - ax)),
                size=(math.dist(outline[0], outline[1]) / 2, WALL_THICK_M / 2, (high - low) / 2), **met,
            )  # fmt: skip
        else:
            piece = f"{name}, piece {number}"
            _prism(spec, piece, outline, low, high)
            spec.worldbody.add_geom(type=_MESH, meshname=piece, **met)


def _refuse_slopes(mesh: Mesh, bands: Bands, source: str) -> None:
    """Refuse faces that are level enough to be climbed, lower than the hull at their lowest, and not the floor."""
    for first, second, third in mesh.triangles:
        corners = (mesh.vertices[first], mesh.vertices[second], mesh.vertices[third])
        heights = sorted(z for _, _, z in corners)
        climbed = -bands.touch[0] < heights[0] < bands.touch[0] and max(map(abs, heights)) > ON_FLOOR_M
        if climbed and is_level(corners):
            raise WorldError(
                f"{source}: mesh {mesh.name!r}: it has a floor that wheels would climb (a face from {heights[0]:.3f} to"
                f" {heights[-1]:.3f} m); the mujoco body drives on boxes and ramps alone",
                hint="--body bullet",
            )


def _prism(spec: mujoco.MjSpec, name: str, outline: Polygon, low: float, high: float) -> None:
    """Add a convex outline (counter-clockwise) as an upright piece."""
    count = len(outline)
    corners = [value for z in (low, high) for x, y in outline for value in (x, y, z)]
    faces = [(0, n + 1, n) for n in range(1, count - 1)]
    faces += [(count, count + n, count + n + 1) for n in range(1, count - 1)]
    for n in range(count):
        after = (n + 1) % count
        faces += [(n, after, count + after), (n, count + after, count + n)]
    _asset(spec, name, corners, faces)


def _asset(
    spec: mujoco.MjSpec,
    name: str,
    numbers: list[float],
    triangles: Iterable[tuple[int, int, int]],
) -> None:
    missing = LEAST_CORNERS - len(numbers) // 3
    mesh = spec.add_mesh(name=name)
    mesh.uservert = numbers + numbers[:3] * max(0, missing)
    mesh.userface = [index for triangle in triangles for index in triangle]
    # An open mesh has no volume, and what stands fast needs none.
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL


# Turns ----------------------------------------------------------------------------------


def quaternion(heading_rad: float, slope_rad: float = 0.0) -> Quaternion:
    """Return the turn of a thing whose length rises by a slope and then looks along a heading."""
    ch, sh = math.cos(heading_rad / 2), math.sin(heading_rad / 2)
    cs, ss = math.cos(slope_rad / 2), math.sin(slope_rad / 2)
    return ch * cs, sh * ss, -ch * ss, sh * cs


def matrix(turn: Sequence[float]) -> tuple[float, ...]:
    """Return the same turn as nine numbers, row by row."""
    w, x, y, z = turn
    return (
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    )  # fmt: skip
