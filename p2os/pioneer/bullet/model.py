"""Robot, floors and obstacles as PyBullet bodies, made from parameters and plans.

Shapes are made by calls, not from a URDF file: nothing is written to disk and
nothing is cached. Collision groups keep wheels off walls (see `bullet`).
"""

import math

from p2os.parameters import RobotParameters
from p2os.pioneer.bullet.engine import pybullet
from p2os.pioneer.scenery import Kind, Obstacle, Pose, World
from p2os.pioneer.static_plan import Bands

#: Links of the robot.
LEFT, RIGHT, CASTER = 0, 1, 2
OBSTACLE_GROUP, FLOOR_GROUP, WHEEL_GROUP, HULL_GROUP = 16, 2, 4, 8
#: Things that can be pushed, and things that pass under the hull and stop wheels.
PUSHED_GROUP, LOW_GROUP = 32, 64
#: What a ray may meet.
HEARD = OBSTACLE_GROUP | FLOOR_GROUP | PUSHED_GROUP | LOW_GROUP
#: The group that Bullet gives its rays.
RAY_GROUP = 1
FLOOR_THICKNESS_M = 0.5
#: The floor reaches farther than the world's extent by this.
FLOOR_MARGIN_M = 1.0
#: Coulomb friction of rubber on a hard floor (chosen); Bullet multiplies both sides.
WHEEL_FRICTION, FLOOR_FRICTION = 0.8, 1.0
#: Of the hull against a wall (chosen).
HULL_FRICTION, OBSTACLE_FRICTION = 0.3, 1.0
CASTER_MASS_KG = 0.2
#: Height at which things that were taken out are kept.
PARKED_M = -100.0

Vector = tuple[float, float, float]
LEVEL = (0.0, 0.0, 0.0, 1.0)


def add_floor(world: World, client: int) -> int:
    """Make the level floor under a world, its top at height 0; return its number."""
    x0, y0, x1, y1 = world.extent
    half = ((x1 - x0) / 2 + FLOOR_MARGIN_M, (y1 - y0) / 2 + FLOOR_MARGIN_M, FLOOR_THICKNESS_M / 2)
    place = ((x0 + x1) / 2, (y0 + y1) / 2, -FLOOR_THICKNESS_M / 2)
    return _static_box(half, place, LEVEL, FLOOR_GROUP, client)


def add_obstacle(item: Obstacle, bands: Bands, client: int) -> int:
    """Make an obstacle, a raised floor or a ramp; return its number."""
    group = group_of(item, bands)
    place, turn = _pose(item)
    if group == PUSHED_GROUP:
        return _pushed(item, place, turn, client)
    if item.kind is Kind.RAMP:
        length = math.hypot(item.length_m, item.height_m)
        return _static_box((length / 2, item.width_m / 2, FLOOR_THICKNESS_M / 2), place, turn, group, client)
    if not item.is_cylinder:
        return _static_box((item.length_m / 2, item.width_m / 2, item.height_m / 2), place, turn, group, client)
    return make_static(_shape(item, client), place, turn, group, client)


def group_of(item: Obstacle, bands: Bands) -> int:
    """Return what an obstacle meets: sills and floors the wheels alone, low things too, and all else the hull."""
    if item.kind.is_driven_on or bands.is_sill(item):
        return FLOOR_GROUP
    if item.mass_kg > 0:
        return PUSHED_GROUP
    return LOW_GROUP if bands.stops_wheels(item) else OBSTACLE_GROUP


def _shape(item: Obstacle, client: int) -> int:
    if item.is_cylinder:
        return int(
            pybullet.createCollisionShape(
                pybullet.GEOM_CYLINDER, radius=item.radius_m, height=item.height_m, physicsClientId=client
            )
        )
    half = (item.length_m / 2, item.width_m / 2, item.height_m / 2)
    return int(pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=client))


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
    mask = RAY_GROUP | HULL_GROUP | OBSTACLE_GROUP | FLOOR_GROUP | PUSHED_GROUP
    pybullet.setCollisionFilterGroupMask(number, -1, PUSHED_GROUP, mask, physicsClientId=client)
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
    if item.kind is not Kind.RAMP:
        turn = pybullet.getQuaternionFromEuler((0.0, 0.0, item.heading_rad))
        return (item.x_m, item.y_m, item.base_m + item.height_m / 2), turn
    slope = math.atan2(item.height_m, item.length_m)
    # From the middle of the upper face down along its normal.
    back, down = math.sin(slope) * FLOOR_THICKNESS_M / 2, math.cos(slope) * FLOOR_THICKNESS_M / 2
    place = (
        item.x_m + back * math.cos(item.heading_rad),
        item.y_m + back * math.sin(item.heading_rad),
        item.base_m + item.height_m / 2 - down,
    )
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
    friction = FLOOR_FRICTION if group == FLOOR_GROUP else OBSTACLE_FRICTION
    pybullet.changeDynamics(number, -1, lateralFriction=friction, physicsClientId=client)
    pybullet.setCollisionFilterGroupMask(
        number, -1, group, RAY_GROUP | WHEEL_GROUP | HULL_GROUP | PUSHED_GROUP, physicsClientId=client
    )
    return int(number)


def add_robot(parameters: RobotParameters, pose: Pose, client: int) -> tuple[int, Vector]:
    """Make the robot at a pose; return its number and its centre of mass in the robot frame.

    The base's frame is the centre of mass, so that the engine's poses need one
    known offset and no inertial frame. It is the hull's centre, but no higher
    than the top of the wheels: batteries and motors lie low, and a tall robot
    would else fall over when it brakes.
    """
    body = parameters.body
    radius, track = body.wheel_diameter_m / 2, parameters.track_mm / 1000
    length, width = body.hull_front_m + body.hull_rear_m, body.hull_width_m
    height = body.hull_height_m - body.ground_clearance_m
    middle_m = body.ground_clearance_m + height / 2
    centre = ((body.hull_front_m - body.hull_rear_m) / 2, 0.0, min(middle_m, body.wheel_diameter_m))
    above: dict[str, object] = {}
    if middle_m > centre[2]:  # named only where it is needed: with it the shape is a compound
        above["collisionFramePosition"] = (0.0, 0.0, middle_m - centre[2])
    hull = pybullet.createCollisionShape(
        pybullet.GEOM_BOX, halfExtents=(length / 2, width / 2, height / 2), physicsClientId=client, **above
    )
    wheel = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=radius, physicsClientId=client)
    caster = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=body.caster_radius_m, physicsClientId=client)
    places = [
        (-centre[0], track / 2, radius - centre[2]),
        (-centre[0], -track / 2, radius - centre[2]),
        (body.caster_x_m - centre[0], 0.0, body.caster_radius_m - centre[2]),
    ]
    c, s = math.cos(pose.heading_rad), math.sin(pose.heading_rad)
    robot = pybullet.createMultiBody(
        baseMass=body.mass_kg - 2 * body.wheel_mass_kg - CASTER_MASS_KG,
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
    frictions = {-1: HULL_FRICTION, LEFT: WHEEL_FRICTION, RIGHT: WHEEL_FRICTION, CASTER: 0.0}
    for link, friction in frictions.items():
        pybullet.changeDynamics(
            robot, link, lateralFriction=friction, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0,
            physicsClientId=client,
        )  # fmt: skip
        group = HULL_GROUP if link < 0 else WHEEL_GROUP
        mask = OBSTACLE_GROUP | FLOOR_GROUP | PUSHED_GROUP if link < 0 else FLOOR_GROUP | LOW_GROUP
        pybullet.setCollisionFilterGroupMask(robot, link, group, mask, physicsClientId=client)
    return int(robot), centre
