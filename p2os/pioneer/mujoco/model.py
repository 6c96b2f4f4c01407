"""A robot, its floor and the things around it as a MuJoCo model.

A model is a function of the things that stand in the world, not of where they
stand: whatever can move has its place in the state. So a state goes back into a
model that was made anew.

The motors are frictions: MuJoCo's dry friction between a wheel and a rotor that is
turned at the set-point pulls the wheel along with no more than the motor's torque.
"""

from collections.abc import Iterable

import mujoco

from p2os.parameters import RobotParameters
from p2os.pioneer.mujoco.engine import MOTOR_SOLREF, RIGID_SOLIMP, new_spec
from p2os.pioneer.mujoco.meshes import add_mesh
from p2os.pioneer.mujoco.turns import quaternion
from p2os.pioneer.physical import (
    CASTER_MASS_KG,
    FLOOR_GROUP,
    HULL_FRICTION,
    HULL_GROUP,
    HULL_MEETS,
    LOW_GROUP,
    PUSHED_GROUP,
    PUSHED_MEETS,
    WHEEL_FRICTION,
    WHEEL_MEETS,
    Chassis,
    floor_box,
    group_of,
    half_sizes,
    middle_and_slope,
)
from p2os.pioneer.scenery import Obstacle, World
from p2os.pioneer.static_plan import Bands

#: Groups of geometry as MuJoCo's rays choose them: what they meet, and what they pass through.
HEARD, UNHEARD = 0, 1
WHEELS = ("left wheel", "right wheel")
ROTORS = ("left rotor", "right rotor")
ROBOT, HULL = "robot", "hull"
#: An obstacle's body and joint; with the prefix no name of a world file is one of the robot's.
THING = "thing: "
#: A rotor is not held back by what it pulls, kg m².
ROTOR_INERTIA = 1e6
#: Where the rotors turn, far from all that could be met, m.
ROTORS_AT_M = -50.0

_BOX, _CYLINDER, _SPHERE = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_SPHERE
_HINGE = mujoco.mjtJoint.mjJNT_HINGE


def make_model(world: World, parameters: RobotParameters, things: Iterable[Obstacle]) -> mujoco.MjModel:
    """Return a model of a world's building, a robot, and what stands around it.

    Args:
        world: Its fixed obstacles and meshes are the building.
        parameters: Of the robot.
        things: All that is not fixed; their places go into the state (`body`).

    Raises:
        WorldError: A mesh cannot be met as this body meets meshes.
    """
    spec, bands = new_spec(), Bands(parameters)
    root = spec.worldbody
    half, place = floor_box(world)
    root.add_geom(name="floor", type=_BOX, size=half, pos=place, **_meeting(FLOOR_GROUP, 0, 0.0))
    for item in world.obstacles:
        if item.fixed:
            place, slope = middle_and_slope(item)
            turn = quaternion(item.heading_rad, slope)
            root.add_geom(pos=place, quat=turn, **_shape(item), **_meeting(group_of(item, bands), 0, 0.0))
    for number, mesh in enumerate(world.meshes):
        add_mesh(spec, mesh, f"mesh {number}", bands)
    _add_robot(spec, parameters)
    for item in things:
        _add_thing(root, item, group_of(item, bands))
    return spec.compile()


def floor_geometries(model: mujoco.MjModel) -> frozenset[int]:
    """Return the numbers of all geometry that the robot drives on."""
    return _of_group(model, FLOOR_GROUP)


def low_geometries(model: mujoco.MjModel) -> frozenset[int]:
    """Return the numbers of all geometry that passes under the hull and stops wheels."""
    return _of_group(model, LOW_GROUP)


def _of_group(model: mujoco.MjModel, group: int) -> frozenset[int]:
    return frozenset(number for number, own in enumerate(model.geom_contype) if own == group)


def _meeting(group: int, meets: int, friction: float) -> dict[str, object]:
    """Return what a piece of geometry meets; of two that meet, the greater friction counts."""
    return {"contype": group, "conaffinity": meets, "friction": [friction, 0.0, 0.0], "condim": 3, "group": HEARD}


def _shape(item: Obstacle) -> dict[str, object]:
    if item.is_cylinder:
        return {"type": _CYLINDER, "size": (item.radius_m, item.height_m / 2, 0.0)}
    return {"type": _BOX, "size": half_sizes(item)}


def _add_thing(root: mujoco.MjsBody, item: Obstacle, group: int) -> None:
    """Add a thing at the world's middle; where it stands is a matter of the state."""
    if group == PUSHED_GROUP:
        body = root.add_body(name=THING + item.name)
        body.add_freejoint(name=THING + item.name)
        body.add_geom(mass=item.mass_kg, **_shape(item), **_meeting(PUSHED_GROUP, PUSHED_MEETS, item.friction))
    else:
        body = root.add_body(name=THING + item.name, mocap=True)
        body.add_geom(**_shape(item), **_meeting(group, 0, 0.0))


def _add_robot(spec: mujoco.MjSpec, parameters: RobotParameters) -> None:
    """Add the robot: its body's frame is the robot frame of `body`, the middle of the axle on the floor."""
    own, chassis = parameters.body, Chassis.of(parameters)
    length, width, height, mass = chassis.length_m, chassis.width_m, chassis.height_m, chassis.mass_kg
    radius = own.wheel_diameter_m / 2
    robot = spec.worldbody.add_body(name=ROBOT)
    robot.add_freejoint(name=ROBOT)
    hull = _meeting(HULL_GROUP, HULL_MEETS, HULL_FRICTION) | {"group": UNHEARD, "priority": 1}
    wheel = _meeting(0, WHEEL_MEETS, WHEEL_FRICTION) | {"group": UNHEARD}
    caster = _meeting(0, WHEEL_MEETS, 0.0) | {"group": UNHEARD, "priority": 1, "condim": 1}
    # The hull's mass is a box about the chassis' own centre, lower than the geometry's middle on a tall robot.
    inertia = [mass / 12 * (a * a + b * b) for a, b in ((width, height), (length, height), (length, width))]
    solid = robot.add_body(name=HULL, pos=chassis.centre, mass=mass, inertia=inertia, explicitinertial=True)
    above = (0.0, 0.0, chassis.middle_m - chassis.centre[2])
    solid.add_geom(name=HULL, type=_BOX, size=(length / 2, width / 2, height / 2), pos=above, mass=0.0, **hull)
    robot.add_geom(
        type=_SPHERE, size=(own.caster_radius_m, 0.0, 0.0), pos=(own.caster_x_m, 0.0, own.caster_radius_m),
        mass=CASTER_MASS_KG, **caster,
    )  # fmt: skip
    for name, rotor_name, side in zip(WHEELS, ROTORS, (1, -1), strict=True):
        body = robot.add_body(name=name, pos=(0.0, side * parameters.track_mm / 2000, radius))
        body.add_joint(name=name, type=_HINGE, axis=(0.0, 1.0, 0.0))
        body.add_geom(type=_SPHERE, size=(radius, 0.0, 0.0), mass=own.wheel_mass_kg, **wheel)
        rotor = spec.worldbody.add_body(name=rotor_name, pos=(0.0, 0.0, ROTORS_AT_M))
        rotor.add_joint(name=rotor_name, type=_HINGE, axis=(0.0, 1.0, 0.0), armature=ROTOR_INERTIA)
        rotor.add_geom(type=_SPHERE, size=(0.01, 0.0, 0.0), contype=0, conaffinity=0, group=UNHEARD)
        motor = spec.add_tendon(
            name=name, frictionloss=own.motor_torque_nm, solref_friction=list(MOTOR_SOLREF),
            solimp_friction=list(RIGID_SOLIMP),
        )  # fmt: skip
        motor.wrap_joint(name, 1.0)
        motor.wrap_joint(rotor_name, -1.0)
