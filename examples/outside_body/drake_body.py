"""A body for p2os in another program: Drake's multibody dynamics (https://drake.mit.edu), nothing of p2os.

    pip install drake                             a wheel for Linux and macOS
    python drake_body.py unix:/tmp/body           then: p2os run dodge --body unix:/tmp/body

`lock_step.py` beside it speaks the protocol of docs/outside-body.md. It saves: a discrete plant's future is in its
positions and velocities. Drake's world is fixed once it is made, so a thing that is placed, moved or removed makes it
anew. Its rays are cast here, in the plan. Not modelled: ramps and meshes; wheels without power are braked.
"""

import math
import struct

import lock_step as wire
import numpy as np
from lock_step import Sizes, main, stepped, text, welcome
from pydrake.geometry import Box, Cylinder, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, MultibodyPlantConfig
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PdControllerGains,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
    default_model_instance,
)
from pydrake.systems.framework import DiagramBuilder

CASTER_M, SETTLE_STEPS, FLOOR_M = 0.03, 300, 200.0
#: Newton metres a radian a second between a rim's set-point and its rate, within the motor's torque.
GAIN = 50.0
#: The middle of the hull's mass, metres behind the axle: what the caster carries.
BEHIND_M = 0.02


class Thing:
    """A box or a cylinder, and where it stands."""

    def __init__(self, fields):
        self.kind, self.x, self.y, self.heading, self.length, self.width, self.radius, *rest = fields.take("B10d")
        self.base, self.height, self.mass, self.friction = rest
        self.shape = Cylinder(self.radius, self.height) if self.kind == 1 else Box(self.length, self.width, self.height)

    @property
    def inertia(self):
        if self.kind == 1:
            return SpatialInertia.SolidCylinderWithMass(self.mass, self.radius, self.height, [0, 0, 1])
        return SpatialInertia.SolidBoxWithMass(self.mass, self.length, self.width, self.height)

    @property
    def pose(self):
        turned = RollPitchYaw(0, 0, self.heading)
        return RigidTransform(turned, [self.x, self.y, self.base + self.height / 2])

    def hit(self, x, y, dx, dy):
        """Return how far along a ray the thing is, and the cosine at which it is met; infinite where it is not."""
        c, s = math.cos(self.heading), math.sin(self.heading)
        x, y = x - self.x, y - self.y
        x, y, dx, dy = x * c + y * s, y * c - x * s, dx * c + dy * s, dy * c - dx * s
        if self.kind == 1:
            along, aside = -(x * dx + y * dy), x * dy - y * dx
            deep = self.radius**2 - aside**2
            far = along - math.sqrt(deep) if deep > 0 else -1.0
            return (far, math.sqrt(deep) / self.radius) if far >= 0 else (math.inf, 0.0)
        near, far, cosine = 0.0, math.inf, 0.0
        for place, way, half in ((x, dx, self.length / 2), (y, dy, self.width / 2)):
            if abs(way) < 1e-12:
                if abs(place) > half:
                    return math.inf, 0.0
                continue
            enters, leaves = sorted(((-half - place) / way, (half - place) / way))
            if enters > near:
                near, cosine = enters, abs(way)
            far = min(far, leaves)
        return (near, cosine) if 0 < near <= far else (math.inf, 0.0)


class Body:
    """The robot and what stands around it."""

    def hello(self, fields):
        self.sizes = Sizes(fields)
        return welcome(wire.SAVES | wire.CASTS_RAYS, "Drake", "ramps and meshes are refused")

    def make_world(self, _):
        self.things, self.plant, self.stood = {}, None, None
        self.zero, self.touching = np.zeros(2), False
        return b""

    def place(self, fields):
        name = fields.text()
        thing = Thing(fields)
        if thing.kind == 3:
            raise ValueError("drake_body takes no ramps")
        self.make_anew()
        self.things[name] = thing
        return b""

    def move(self, fields):
        thing = self.things[fields.text()]
        self.make_anew()
        thing.x, thing.y, thing.heading = fields.take("ddd")
        return b""

    def remove(self, fields):
        self.make_anew()
        del self.things[fields.text()]
        return b""

    def make_anew(self):
        """Have the plant made again when it is needed, with the robot as it is now."""
        if self.plant is not None:
            plant = self.plant
            self.stood = [one(self.context, self.robot) for one in (plant.GetPositions, plant.GetVelocities)]
            self.take_places()
            self.plant = None

    def take_places(self):
        """Take over where what can be pushed stands; return what was pushed."""
        found = []
        for name, thing in self.things.items():
            if thing.mass:
                pose = self.plant.GetFreeBodyPose(self.context, self.plant.GetBodyByName(f"thing {name}"))
                (x, y, _), heading = pose.translation(), RollPitchYaw(pose.rotation()).yaw_angle()
                if math.dist((x, y), (thing.x, thing.y)) > 1e-4:
                    thing.x, thing.y, thing.heading = x, y, heading
                    found.append(text(name) + struct.pack("<3d", x, y, heading))
        return found

    def made(self):
        """Return the plant, made of the robot and the things where it is not yet."""
        if self.plant is not None:
            return self.plant
        m, builder = self.sizes, DiagramBuilder()
        settings = MultibodyPlantConfig(time_step=m.step_s, contact_model="point", use_sampled_output_ports=False)
        plant, scene = AddMultibodyPlant(settings, builder)
        world = plant.world_body()
        floor = plant.RegisterCollisionGeometry(
            world, RigidTransform([0, 0, -0.5]), Box(FLOOR_M, FLOOR_M, 1), "floor", CoulombFriction(1, 1)
        )
        self.robot = plant.AddModelInstance("robot")
        size = (m.front - m.rear, m.width, m.height - m.clearance)
        middle = RigidTransform([(m.front + m.rear) / 2, 0, m.clearance + size[2] / 2])
        mass_at = [-BEHIND_M, 0, m.radius]
        inertia = UnitInertia.SolidBox(*size).ShiftFromCenterOfMass(mass_at)
        hull = plant.AddRigidBody("hull", self.robot, SpatialInertia(m.mass - 2 * m.wheel_mass, mass_at, inertia))
        plant.RegisterCollisionGeometry(hull, middle, Box(*size), "hull", CoulombFriction(0.3, 0.3))
        caster = RigidTransform([m.rear * 0.7, 0, CASTER_M])
        plant.RegisterCollisionGeometry(hull, caster, Sphere(CASTER_M), "caster", CoulombFriction(0, 0))
        for name, side in (("left", m.track / 2), ("right", -m.track / 2)):
            wheel = plant.AddRigidBody(name, self.robot, SpatialInertia.SolidSphereWithMass(m.wheel_mass, m.radius))
            plant.RegisterCollisionGeometry(wheel, RigidTransform(), Sphere(m.radius), name, CoulombFriction(0.8, 0.8))
            hub = plant.AddFrame(FixedOffsetFrame(f"{name} hub", hull, RigidTransform([0, side, m.radius])))
            joint = plant.AddJoint(RevoluteJoint(name, hub, wheel.body_frame(), [0, 1, 0]))
            plant.AddJointActuator(name, joint, m.torque).set_controller_gains(PdControllerGains(p=0, d=GAIN))
        for name, thing in sorted(self.things.items()):
            friction, body, pose = CoulombFriction(thing.friction, thing.friction), world, thing.pose
            if thing.mass:
                body = plant.AddRigidBody(f"thing {name}", default_model_instance(), thing.inertia)
                plant.SetDefaultFloatingBaseBodyPose(body, pose)
                pose = RigidTransform()
            plant.RegisterCollisionGeometry(body, pose, thing.shape, f"thing {name}", friction)
        plant.Finalize()
        diagram = builder.Build()
        self.whole = diagram.CreateDefaultContext()
        self.plant, self.context = plant, plant.GetMyMutableContextFromRoot(self.whole)
        self.scene, self.seen = scene, scene.GetMyContextFromRoot(self.whole)
        self.hull_shape = plant.GetCollisionGeometriesForBody(hull)[0]
        self.names = {
            shape: scene.model_inspector().GetName(shape).removeprefix("thing ")
            for shape in scene.model_inspector().GetAllGeometryIds() if shape != floor
        }  # fmt: skip
        if self.stood is not None:
            plant.SetPositions(self.context, self.robot, self.stood[0])
            plant.SetVelocities(self.context, self.robot, self.stood[1])
        self.asked = None
        self.ask(0.0, 0.0)
        return plant

    def ask(self, left, right):
        """Have the motors turn the rims so, m/s."""
        if self.asked != (left, right):
            self.asked = (left, right)
            rates = [0.0, 0.0, left / self.sizes.radius, right / self.sizes.radius]
            self.plant.get_desired_state_input_port(self.robot).FixValue(self.context, rates)

    def go(self):
        """Make one step."""
        self.context.SetDiscreteState(self.plant.EvalUniquePeriodicDiscreteUpdate(self.context))

    def put(self, x, y, heading, z):
        """Stand still with the middle of the axle at a place."""
        plant = self.made()
        plant.SetFreeBodyPose(
            self.context, plant.GetBodyByName("hull"), RigidTransform(RollPitchYaw(0, 0, heading), [x, y, z])
        )
        plant.SetVelocities(self.context, self.robot, np.zeros(8))

    def reset(self, fields):
        self.stood, self.plant, self.touching = None, None, False
        self.put(*fields.take("dddd"))
        for _ in range(SETTLE_STEPS):
            self.go()
        self.zero = self.wheels()[0]
        return self.report()

    def stand_at(self, fields):
        self.put(*fields.take("dddd"))
        return self.report()

    def wheels(self):
        """Return the angles and the rates of both wheels, left first."""
        plant, context = self.made(), self.context
        return plant.GetPositions(context, self.robot)[-2:], plant.GetVelocities(context, self.robot)[-2:]

    def report(self):
        plant = self.made()
        pose = plant.GetFreeBodyPose(self.context, plant.GetBodyByName("hull"))
        m, (x, y, z) = pose.rotation().matrix(), pose.translation()
        heading, pitch = math.atan2(m[1, 0], m[0, 0]), math.asin(max(-1.0, min(1.0, m[2, 0])))
        _, _, turn, vx, vy, _, *_ = plant.GetVelocities(self.context, self.robot)
        angles, rates = self.wheels()
        rims, forward = rates * self.sizes.radius, vx * math.cos(heading) + vy * math.sin(heading)
        return struct.pack("<13d", x, y, z, heading, pitch, *(angles - self.zero), *rims, forward, turn, -1.0, 0.0)

    def step(self, fields):
        plant, (steps,) = self.made(), fields.take("I")
        rows, touched = [], []
        for number in range(steps):
            left, right, powered = fields.take("ddB")
            self.ask(*((left, right) if powered else (0.0, 0.0)))
            efforts = plant.get_net_actuation_output_port(self.robot).Eval(self.context)
            self.go()
            bits, (angles, rates) = 0, self.wheels()
            for asked, effort, rate, bit in zip(
                self.asked, efforts, rates, (wire.STALLED_LEFT, wire.STALLED_RIGHT), strict=True
            ):  # fmt: skip
                if asked and abs(effort) > 0.95 * self.sizes.torque and abs(rate) * self.sizes.radius < 0.05:
                    bits |= bit
            touch = self.touch()
            if touch is not None:
                bits |= wire.TOUCHES
                if not self.touching:
                    touched.append(struct.pack("<Idd", number, *touch[1]) + text(touch[0]))
            self.touching = touch is not None
            rows.append((*(angles - self.zero), bits))
        return stepped(rows, self.report(), touched, self.take_places())

    def touch(self):
        """Return the name of what the hull touches, and where; None where it touches nothing."""
        query = self.scene.get_query_output_port().Eval(self.seen)
        for pair in query.ComputePointPairPenetration():
            for ours, other in ((pair.id_A, pair.id_B), (pair.id_B, pair.id_A)):
                if ours == self.hull_shape and other in self.names:
                    return self.names[other], pair.p_WCa[:2]
        return None

    def cast(self, asked, longest):
        """Return what rays meet, each from (x, y) along a heading in the robot's frame: distance and cosine."""
        plant = self.made()
        self.take_places()
        pose = plant.GetFreeBodyPose(self.context, plant.GetBodyByName("hull"))
        (x, y, _), heading = pose.translation(), RollPitchYaw(pose.rotation()).yaw_angle()
        c, s = math.cos(heading), math.sin(heading)
        seen = [one for one in self.things.values() if one.base <= self.sizes.ring <= one.base + one.height]
        found = []
        for rx, ry, way in asked:
            ray = (x + rx * c - ry * s, y + rx * s + ry * c, math.cos(heading + way), math.sin(heading + way))
            hit = min((one.hit(*ray) for one in seen), default=(math.inf, 0.0))
            found.append(hit if hit[0] <= longest else (math.inf, 0.0))
        return found

    def save(self, _):
        plant = self.made()
        values = (plant.GetPositions(self.context), plant.GetVelocities(self.context), self.zero, [self.touching])
        data = np.concatenate(values).astype("<f8").tobytes()
        return struct.pack("<I", len(data)) + data

    def restore(self, fields):
        plant, (size,) = self.made(), fields.take("I")
        count = plant.num_positions()
        values = np.array(fields.take(f"{size // 8}d"))
        if len(values) != count + plant.num_velocities() + 3:
            raise ValueError("this was saved with other things")
        plant.SetPositions(self.context, values[:count])
        plant.SetVelocities(self.context, values[count:-3])
        self.zero, self.touching = values[-3:-1], bool(values[-1])
        return self.report()


if __name__ == "__main__":
    main(Body, RuntimeError)
