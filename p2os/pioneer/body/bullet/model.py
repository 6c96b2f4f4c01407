"""Robot, floors, obstacles and the building as PyBullet bodies, made from parameters and plans.

Shapes are made by calls, not from a URDF file: nothing is written to disk and nothing is
cached. Collision groups keep wheels off walls (see `body`). Nothing here is stepped.

What never moves in a world is as few bodies as possible: fixed boxes and meshes are
merged into one. Each static body costs the engine a third of a microsecond in every step,
so that a map of a thousand walls as bodies of their own would halve the speed tenfold.
Faces that are nearly level can be driven on and belong to the floor; all others are what
the hull meets. Level faces on the ground are left out: the floor is there, and the seams
of triangles would shake the wheels.
"""

import math
from collections.abc import Iterable, Sequence

from p2os.pioneer.body.bullet.engine import pybullet
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
    STANDING_FRICTION,
    WHEEL_FRICTION,
    WHEEL_GROUP,
    WHEEL_MEETS,
    Chassis,
    Vector,
    floor_box,
    half_sizes,
    is_level,
    middle_and_slope,
)
from p2os.pioneer.world.geometry import Footprint
from p2os.pioneer.world.model import Obstacle, Pose, Triangle, Vertex, World
from p2os.robots.parameters import RobotParameters

#: Links of the robot.
LEFT, RIGHT, CASTER = 0, 1, 2
#: What a sonar's ray may meet.
ECHOING = OBSTACLE_GROUP | FLOOR_GROUP | PUSHED_GROUP | LOW_GROUP
#: The group that Bullet gives its rays.
RAY_GROUP = 1
#: Who moves → what it meets.
MEETS = {WHEEL_GROUP: WHEEL_MEETS, HULL_GROUP: HULL_MEETS, PUSHED_GROUP: PUSHED_MEETS}
#: Height at which things that were taken out are kept.
PARKED_M = -100.0

LEVEL = (0.0, 0.0, 0.0, 1.0)
#: chosen: so few fixed boxes stay bodies of their own, which meet a hull more exactly than triangles.
FEW_BOXES = 12
#: The engine takes no more corners in one shape.
MOST_TRIANGLES = 30_000
#: Corners of a box as made below: bottom ring, top ring; counter-clockwise.
BOX_FACES: tuple[Triangle, ...] = (
    (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
    (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
)  # fmt: skip

Corners = tuple[Vertex, Vertex, Vertex]


def add_floor(world: World, client: int) -> int:
    """Make the level floor under a world, its top at height 0; return its number."""
    half, place = floor_box(world)
    return _static_box(half, place, LEVEL, FLOOR_GROUP, client)


def add_obstacle(item: Obstacle, group: int, client: int) -> int:
    """Make an obstacle, a raised floor or a ramp, of these groups; return its number."""
    place, turn = _pose(item)
    if group & PUSHED_GROUP:
        return _pushed(item, place, turn, client)
    if not item.is_cylinder:
        return _static_box(half_sizes(item), place, turn, group, client)
    return make_static(_shape(item, client), place, turn, group, client)


def _shape(item: Obstacle, client: int) -> int:
    if item.is_cylinder:
        return int(
            pybullet.createCollisionShape(
                pybullet.GEOM_CYLINDER, radius=item.radius_m, height=item.height_m, physicsClientId=client
            )
        )
    return int(pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half_sizes(item), physicsClientId=client))


def _pushed(item: Obstacle, place: Vector, turn: tuple[float, ...], client: int) -> int:
    """Make a thing that can be pushed; its inertia is that of its shape."""
    number = int(
        pybullet.createMultiBody(
            baseMass=item.mass_kg,
            baseCollisionShapeIndex=_shape(item, client),
            basePosition=place,
            baseOrientation=turn,
            physicsClientId=client,
        )
    )
    pybullet.changeDynamics(
        number, -1, lateralFriction=item.friction, linearDamping=0.0, angularDamping=0.0,
        activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING, physicsClientId=client,
    )  # fmt: skip
    pybullet.setCollisionFilterGroupMask(number, -1, PUSHED_GROUP, RAY_GROUP | PUSHED_MEETS, physicsClientId=client)
    return number


def move_obstacle(number: int, item: Obstacle, client: int) -> None:
    """Put an obstacle where it stands now."""
    place, turn = _pose(item)
    pybullet.resetBasePositionAndOrientation(number, place, turn, physicsClientId=client)
    if item.mass_kg > 0:
        pybullet.resetBaseVelocity(number, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), physicsClientId=client)


def park_obstacle(number: int, client: int) -> None:
    """Put an obstacle where nothing meets it, and where it does not fall."""
    pybullet.changeDynamics(number, -1, mass=0.0, physicsClientId=client)
    pybullet.resetBasePositionAndOrientation(number, (0.0, 0.0, PARKED_M), LEVEL, physicsClientId=client)


def _pose(item: Obstacle) -> tuple[Vector, tuple[float, ...]]:
    """Return the middle and the turn of an obstacle's box; of a ramp, the box under its upper face."""
    place, slope = middle_and_slope(item)
    return place, pybullet.getQuaternionFromEuler((0.0, -slope, item.heading_rad))


def _static_box(half: Vector, place: Vector, turn: tuple[float, ...], group: int, client: int) -> int:
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client)
    return make_static(shape, place, turn, group, client)


def make_static(shape: int, place: Vector, turn: tuple[float, ...], group: int, client: int) -> int:
    """Make a body that never moves by itself; return its number."""
    # Plain rigid bodies: as articulated ones, each would cost time in every step.
    number = pybullet.createMultiBody(
        baseMass=0,
        baseCollisionShapeIndex=shape,
        basePosition=place,
        baseOrientation=turn,
        useMaximalCoordinates=1,
        physicsClientId=client,
    )
    pybullet.changeDynamics(number, -1, lateralFriction=STANDING_FRICTION, physicsClientId=client)
    pybullet.setCollisionFilterGroupMask(number, -1, group, RAY_GROUP | _met_by(group), physicsClientId=client)
    return int(number)


def _met_by(group: int) -> int:
    """Return what meets a group; both sides must leave a pair out, for Bullet lets two touch that one of them meets."""
    return sum(who for who, meets in MEETS.items() if meets & group)


def add_robot(parameters: RobotParameters, pose: Pose, client: int) -> tuple[int, Vector]:
    """Make the robot at a pose; return its number and its centre of mass in the robot frame.

    The base's frame is the centre of mass, so that the engine's poses need one
    known offset and no inertial frame.
    """
    body, chassis = parameters.body, Chassis.of(parameters)
    radius, track = body.wheel_diameter_m / 2, parameters.track_mm / 1000
    centre, half = chassis.centre, (chassis.length_m / 2, chassis.width_m / 2, chassis.height_m / 2)
    above: dict[str, object] = {}
    if chassis.middle_m > centre[2]:  # named only where it is needed: with it the shape is a compound
        above["collisionFramePosition"] = (0.0, 0.0, chassis.middle_m - centre[2])
    hull = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client, **above)
    wheel = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=radius, physicsClientId=client)
    caster = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=body.caster_radius_m, physicsClientId=client)
    places = [
        (-centre[0], track / 2, radius - centre[2]),
        (-centre[0], -track / 2, radius - centre[2]),
        (body.caster_x_m - centre[0], 0.0, body.caster_radius_m - centre[2]),
    ]
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    robot = pybullet.createMultiBody(
        baseMass=chassis.mass_kg,
        baseCollisionShapeIndex=hull,
        basePosition=(pose.x_m + centre[0] * c, pose.y_m + centre[0] * s, pose.z_m + centre[2]),
        baseOrientation=pybullet.getQuaternionFromEuler((0.0, 0.0, pose.heading_rad)),
        linkMasses=[body.wheel_mass_kg, body.wheel_mass_kg, CASTER_MASS_KG],
        linkCollisionShapeIndices=[wheel, wheel, caster],
        linkVisualShapeIndices=[-1, -1, -1],
        linkPositions=places,
        linkOrientations=[LEVEL] * 3,
        linkInertialFramePositions=[(0.0, 0.0, 0.0)] * 3,
        linkInertialFrameOrientations=[LEVEL] * 3,
        linkParentIndices=[0, 0, 0],
        linkJointTypes=[pybullet.JOINT_REVOLUTE, pybullet.JOINT_REVOLUTE, pybullet.JOINT_FIXED],
        linkJointAxis=[(0.0, 1.0, 0.0)] * 3,
        physicsClientId=client,
    )
    if parameters.rotor_inertia_kg_m2:  # chosen: it turns as a part of the wheel, since Bullet's joints have none
        own = body.wheel_mass_kg * radius**2 * 2 / 5
        for link in (LEFT, RIGHT):
            pybullet.changeDynamics(
                robot, link, localInertiaDiagonal=(own, own + parameters.rotor_inertia_kg_m2, own),
                physicsClientId=client,
            )  # fmt: skip
    frictions = {-1: HULL_FRICTION, LEFT: WHEEL_FRICTION, RIGHT: WHEEL_FRICTION, CASTER: 0.0}
    for link, friction in frictions.items():
        pybullet.changeDynamics(
            robot, link, lateralFriction=friction, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0,
            physicsClientId=client,
        )  # fmt: skip
        group = HULL_GROUP if link < 0 else WHEEL_GROUP
        mask = HULL_MEETS if link < 0 else WHEEL_MEETS
        pybullet.setCollisionFilterGroupMask(robot, link, group, mask, physicsClientId=client)
    return int(robot), centre


# The building ---------------------------------------------------------------------------


def merged(world: World) -> list[Obstacle]:
    """Return the fixed boxes of a world that go into the building; none where they are few."""
    boxes = [item for item in world.obstacles if item.fixed and not item.is_cylinder]
    return boxes if len(boxes) > FEW_BOXES else []


def add_building(world: World, client: int) -> tuple[list[int], list[int]]:
    """Make the building; return the numbers of the bodies that are met, and of those that are driven on."""
    walls: list[Corners] = [corners for item in merged(world) for corners in _box(item)]
    floors: list[Corners] = []
    for mesh in world.meshes:
        for a, b, c in mesh.triangles:
            corners = (mesh.vertices[a], mesh.vertices[b], mesh.vertices[c])
            if not is_level(corners):
                walls.append(corners)
            elif max(abs(z) for _, _, z in corners) > ON_FLOOR_M:
                floors.append(corners)
    return _add(walls, OBSTACLE_GROUP, client), _add(floors, FLOOR_GROUP, client)


def _add(faces: Sequence[Corners], group: int, client: int) -> list[int]:
    numbers = []
    for begin in range(0, len(faces), MOST_TRIANGLES):
        vertices: dict[Vertex, int] = {}
        indices = [
            vertices.setdefault(corner, len(vertices))
            for corners in faces[begin : begin + MOST_TRIANGLES]
            for corner in corners
        ]
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=[list(vertex) for vertex in vertices],
            indices=indices,
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
            physicsClientId=client,
        )
        numbers.append(make_static(shape, (0.0, 0.0, 0.0), LEVEL, group, client))
    return numbers


def _box(item: Obstacle) -> Iterable[Corners]:
    low, high = item.base_m, item.base_m + item.height_m
    (d, c, b, a) = Footprint(item).polygon[::-1]
    corners = [(x, y, z) for z in (low, high) for x, y in (a, b, c, d)]
    return [(corners[i], corners[j], corners[k]) for i, j, k in BOX_FACES]
