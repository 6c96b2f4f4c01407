"""A body for p2os in another program: PyBullet's physics, written without anything of p2os.

    python bullet_body.py unix:/tmp/body          then: p2os run dodge --body unix:/tmp/body

`lock_step.py` beside it speaks the protocol of docs/outside-body.md. It cannot save: PyBullet's `saveState` keeps no
state that another process could take up, so that a bench with it has no fork and no rewind. Not modelled: ramps and
meshes.
"""

import math
import struct

import lock_step as wire
import pybullet
from lock_step import Sizes, main, stepped, text, welcome

CASTER_M, SETTLE_STEPS = 0.03, 300


def turned(heading):
    return pybullet.getQuaternionFromEuler((0, 0, heading))


class Body:
    """The robot and what stands around it."""

    def __init__(self):
        pybullet.connect(pybullet.DIRECT)

    def hello(self, fields):
        self.sizes = Sizes(fields)
        return welcome(wire.CASTS_RAYS, "PyBullet", "ramps and meshes are refused")

    def make_world(self, _):
        pybullet.resetSimulation()
        pybullet.setGravity(0, 0, -9.81)
        pybullet.setTimeStep(self.sizes.step_s)
        floor = pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE))
        pybullet.changeDynamics(floor, -1, lateralFriction=1.0)
        self.floor, self.things, self.pushed = floor, {}, {}
        middle = (self.sizes.front + self.sizes.rear) / 2
        high = (self.sizes.height - self.sizes.clearance) / 2
        box = pybullet.createCollisionShape(
            pybullet.GEOM_BOX,
            halfExtents=((self.sizes.front - self.sizes.rear) / 2, self.sizes.width / 2, high),
        )
        wheel = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=self.sizes.radius)
        caster = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=CASTER_M)
        #: From the middle of the axle on the floor to the middle of the hull.
        self.up = (middle, 0.0, self.sizes.clearance + high)
        side, down = self.sizes.track / 2, self.sizes.radius - self.up[2]
        back = self.sizes.rear * 0.7 - middle
        self.robot = pybullet.createMultiBody(
            self.sizes.mass - 2 * self.sizes.wheel_mass, box, basePosition=self.up,
            baseInertialFramePosition=(-middle, 0, self.sizes.radius - self.up[2]),
            linkMasses=[self.sizes.wheel_mass] * 2 + [0.2], linkCollisionShapeIndices=[wheel, wheel, caster],
            linkVisualShapeIndices=[-1] * 3,
            linkPositions=[(-middle, side, down), (-middle, -side, down), (back, 0, CASTER_M - self.up[2])],
            linkOrientations=[(0, 0, 0, 1)] * 3, linkInertialFramePositions=[(0, 0, 0)] * 3,
            linkInertialFrameOrientations=[(0, 0, 0, 1)] * 3, linkParentIndices=[0] * 3,
            linkJointTypes=[pybullet.JOINT_REVOLUTE, pybullet.JOINT_REVOLUTE, pybullet.JOINT_FIXED],
            linkJointAxis=[(0, 1, 0)] * 3,
        )  # fmt: skip
        self.inertial = (-middle, 0.0, self.sizes.radius - self.up[2])
        for link, friction in ((-1, 0.3), (0, 0.8), (1, 0.8), (2, 0.0)):
            pybullet.changeDynamics(self.robot, link, lateralFriction=friction, linearDamping=0, angularDamping=0)
        pybullet.changeDynamics(self.robot, -1, activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING)
        return b""

    def place(self, fields):
        name = fields.text()
        kind, x, y, heading, length, width, radius, base, height, mass, friction = fields.take("B10d")
        if kind == 3:
            raise ValueError("bullet_body takes no ramps")
        shape = (
            pybullet.createCollisionShape(pybullet.GEOM_CYLINDER, radius=radius, height=height) if kind == 1
            else pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=(length / 2, width / 2, height / 2))
        )  # fmt: skip
        thing = pybullet.createMultiBody(mass, shape, -1, (x, y, base + height / 2), turned(heading))
        pybullet.changeDynamics(thing, -1, lateralFriction=friction if mass else 1.0)
        self.things[name] = thing
        if mass:
            self.pushed[name] = (x, y)
        return b""

    def move(self, fields):
        thing = self.things[name := fields.text()]
        x, y, heading = fields.take("ddd")
        (_, _, z), _ = pybullet.getBasePositionAndOrientation(thing)
        pybullet.resetBasePositionAndOrientation(thing, (x, y, z), turned(heading))
        if name in self.pushed:
            self.pushed[name] = (x, y)
        return b""

    def remove(self, fields):
        name = fields.text()
        self.pushed.pop(name, None)
        pybullet.removeBody(self.things.pop(name))
        return b""

    def reset(self, fields):
        self.put(*fields.take("dddd"))
        for joint in (0, 1):
            pybullet.resetJointState(self.robot, joint, 0.0, 0.0)
            pybullet.setJointMotorControl2(self.robot, joint, pybullet.VELOCITY_CONTROL, 0.0, force=self.sizes.torque)
        for _ in range(SETTLE_STEPS):
            pybullet.stepSimulation()
        self.zero = [pybullet.getJointState(self.robot, joint)[0] for joint in (0, 1)]
        self.touching = False
        return self.report()

    def stand_at(self, fields):
        self.put(*fields.take("dddd"))
        return self.report()

    def put(self, x, y, heading, z):
        """Stand still with the middle of the axle at a place."""
        ahead, _, up = (a + b for a, b in zip(self.up, self.inertial, strict=True))
        place = (x + ahead * math.cos(heading), y + ahead * math.sin(heading), z + up)
        pybullet.resetBasePositionAndOrientation(self.robot, place, turned(heading))
        pybullet.resetBaseVelocity(self.robot, (0, 0, 0), (0, 0, 0))

    def pose(self):
        """Return the middle of the axle, on the floor, and the nine numbers of the turn."""
        place, turn = pybullet.getBasePositionAndOrientation(self.robot)
        m = pybullet.getMatrixFromQuaternion(turn)
        ahead, _, up = (a + b for a, b in zip(self.up, self.inertial, strict=True))
        return [place[row] - m[3 * row] * ahead - m[3 * row + 2] * up for row in range(3)], m

    def report(self):
        (x, y, z), m = self.pose()
        heading, pitch = math.atan2(m[3], m[0]), math.asin(max(-1.0, min(1.0, m[6])))
        (vx, vy, _), (_, _, turn) = pybullet.getBaseVelocity(self.robot)
        wheels = [pybullet.getJointState(self.robot, joint)[:2] for joint in (0, 1)]
        angles = [angle - zero for (angle, _), zero in zip(wheels, self.zero, strict=True)]
        rims, forward = (
            [rate * self.sizes.radius for _, rate in wheels],
            vx * math.cos(heading) + vy * math.sin(heading),
        )
        return struct.pack("<13d", x, y, z, heading, pitch, *angles, *rims, forward, turn, -1.0, 0.0)

    def step(self, fields):
        (steps,) = fields.take("I")
        rows, touched = [], []
        for number in range(steps):
            left, right, powered = fields.take("ddB")
            force = self.sizes.torque if powered else 0.4 * self.sizes.torque
            for joint, asked in enumerate((left, right)):
                pybullet.setJointMotorControl2(
                    self.robot,
                    joint,
                    pybullet.VELOCITY_CONTROL,
                    targetVelocity=asked / self.sizes.radius,
                    force=force,
                )
            pybullet.stepSimulation()
            bits = 0
            for joint, (asked, bit) in enumerate(((left, wire.STALLED_LEFT), (right, wire.STALLED_RIGHT))):
                _, rate, _, effort = pybullet.getJointState(self.robot, joint)
                if asked and abs(effort) > 0.95 * self.sizes.torque and abs(rate) * self.sizes.radius < 0.05:
                    bits |= bit
            contacts = pybullet.getContactPoints(self.robot, linkIndexA=-1)
            touch = next((one for one in contacts if one[2] != self.floor), None)
            if touch is not None:
                bits |= wire.TOUCHES
                if not self.touching:
                    name = next((name for name, thing in self.things.items() if thing == touch[2]), "")
                    touched.append(struct.pack("<Idd", number, *touch[6][:2]) + text(name))
            self.touching = touch is not None
            angles = (pybullet.getJointState(self.robot, joint)[0] - self.zero[joint] for joint in (0, 1))
            rows.append((*angles, bits))
        return stepped(rows, self.report(), touched, self.moved())

    def moved(self):
        """Return what was pushed since this was asked last."""
        found = []
        for name, before in self.pushed.items():
            (x, y, _), turn = pybullet.getBasePositionAndOrientation(self.things[name])
            if math.dist(before, (x, y)) > 1e-4:
                self.pushed[name] = (x, y)
                found.append(text(name) + struct.pack("<3d", x, y, pybullet.getEulerFromQuaternion(turn)[2]))
        return found

    def cast(self, rays, longest):
        """Return what rays meet, each from (x, y) along a heading in the robot's frame: distance and cosine."""
        (x, y, _), m = self.pose()
        heading = math.atan2(m[3], m[0])
        c, s = math.cos(heading), math.sin(heading)
        begins = [(x + rx * c - ry * s, y + rx * s + ry * c, self.sizes.ring) for rx, ry, _ in rays]
        ways = [(math.cos(heading + way), math.sin(heading + way)) for _, _, way in rays]
        ends = [(bx + longest * dx, by + longest * dy, bz) for (bx, by, bz), (dx, dy) in zip(begins, ways, strict=True)]
        found = []
        for (thing, _, share, _, normal), (dx, dy) in zip(pybullet.rayTestBatch(begins, ends), ways, strict=True):
            if thing < 0 or thing == self.robot:
                found.append((math.inf, 0.0))
            else:
                found.append((share * longest, min(1.0, abs(normal[0] * dx + normal[1] * dy))))
        return found


if __name__ == "__main__":
    main(Body, pybullet.error)
