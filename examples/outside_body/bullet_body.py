"""A body for p2os in another program: PyBullet's physics, written without anything of p2os.

    python bullet_body.py unix:/tmp/body          then: p2os run dodge --body unix:/tmp/body

It speaks the protocol of docs/outside-body.md. Each connection is a process of its own. It cannot save: PyBullet's
`saveState` keeps no state that another process could take up, so that a bench with it has no fork and no rewind.
Not modelled: ramps and meshes.
"""

import contextlib
import math
import os
import signal
import socket
import struct
import sys

import pybullet

HELLO, MAKE_WORLD, PLACE, MOVE, REMOVE, RESET, STAND_AT, STEP, RANGES, RAYS, BYE = 1, 2, 3, 5, 6, 7, 8, 9, 10, 11, 14
ANSWER, FAILED = 0x80, 0xFF
CASTS_RAYS = 2
STALLED_LEFT, STALLED_RIGHT, TOUCHES = 1, 2, 4
RAYS_PER_SONAR, CASTER_M, SETTLE_STEPS = 9, 0.03, 300


class Fields:
    """The fields of a message, taken one after the other."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, layout):
        values = struct.unpack_from("<" + layout, self.data, self.at)
        self.at += struct.calcsize("<" + layout)
        return values

    def text(self):
        (size,) = self.take("H")
        (data,) = self.take(f"{size}s")
        return data.decode()


def text(words):
    return struct.pack("<H", len(words.encode())) + words.encode()


def turned(heading):
    return pybullet.getQuaternionFromEuler((0, 0, heading))


class Body:
    """The robot and what stands around it."""

    def __init__(self):
        pybullet.connect(pybullet.DIRECT)
        self.answers = {
            HELLO: self.hello, MAKE_WORLD: self.make_world, PLACE: self.place, MOVE: self.move, REMOVE: self.remove,
            RESET: self.reset, STAND_AT: self.stand_at, STEP: self.step, RANGES: self.ranges, RAYS: self.rays,
            BYE: lambda _: b"",
        }  # fmt: skip

    def hello(self, fields):
        version, step_ns = fields.take("HI")
        if version != 1:
            raise ValueError("bullet_body speaks version 1")
        self.step_s = step_ns / 1e9
        fields.text()
        self.track, wheel, self.clearance, self.height, self.mass, self.wheel_mass, self.torque = fields.take("7d")
        self.ring, self.longest, _, self.cone = fields.take("4d")
        self.radius = wheel / 2
        (corners,) = fields.take("H")
        hull = [fields.take("dd") for _ in range(corners)]
        self.front, self.rear = max(x for x, _ in hull), min(x for x, _ in hull)
        self.width = 2 * max(y for _, y in hull)
        (sonar,) = fields.take("H")
        self.sonar = [fields.take("ddd") for _ in range(sonar)]
        return struct.pack("<HH", 1, CASTS_RAYS) + text("PyBullet") + text("ramps and meshes are refused")

    def make_world(self, _):
        pybullet.resetSimulation()
        pybullet.setGravity(0, 0, -9.81)
        pybullet.setTimeStep(self.step_s)
        floor = pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE))
        pybullet.changeDynamics(floor, -1, lateralFriction=1.0)
        self.floor, self.things, self.pushed = floor, {}, {}
        middle = (self.front + self.rear) / 2
        high = (self.height - self.clearance) / 2
        box = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=((self.front - self.rear) / 2, self.width / 2, high)
        )
        wheel = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=self.radius)
        caster = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=CASTER_M)
        #: From the middle of the axle on the floor to the middle of the hull.
        self.up = (middle, 0.0, self.clearance + high)
        side, down = self.track / 2, self.radius - self.up[2]
        back = self.rear * 0.7 - middle
        self.robot = pybullet.createMultiBody(
            self.mass - 2 * self.wheel_mass, box, basePosition=self.up,
            baseInertialFramePosition=(-middle, 0, self.radius - self.up[2]),
            linkMasses=[self.wheel_mass, self.wheel_mass, 0.2], linkCollisionShapeIndices=[wheel, wheel, caster],
            linkVisualShapeIndices=[-1] * 3,
            linkPositions=[(-middle, side, down), (-middle, -side, down), (back, 0, CASTER_M - self.up[2])],
            linkOrientations=[(0, 0, 0, 1)] * 3, linkInertialFramePositions=[(0, 0, 0)] * 3,
            linkInertialFrameOrientations=[(0, 0, 0, 1)] * 3, linkParentIndices=[0] * 3,
            linkJointTypes=[pybullet.JOINT_REVOLUTE, pybullet.JOINT_REVOLUTE, pybullet.JOINT_FIXED],
            linkJointAxis=[(0, 1, 0)] * 3,
        )  # fmt: skip
        self.inertial = (-middle, 0.0, self.radius - self.up[2])
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
            pybullet.setJointMotorControl2(self.robot, joint, pybullet.VELOCITY_CONTROL, 0.0, force=self.torque)
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
        rims, forward = [rate * self.radius for _, rate in wheels], vx * math.cos(heading) + vy * math.sin(heading)
        return struct.pack("<13d", x, y, z, heading, pitch, *angles, *rims, forward, turn, -1.0, 0.0)

    def step(self, fields):
        (steps,) = fields.take("I")
        rows, touched = bytearray(), []
        for number in range(steps):
            left, right, powered = fields.take("ddB")
            force = self.torque if powered else 0.4 * self.torque
            for joint, asked in enumerate((left, right)):
                pybullet.setJointMotorControl2(
                    self.robot, joint, pybullet.VELOCITY_CONTROL, targetVelocity=asked / self.radius, force=force
                )
            pybullet.stepSimulation()
            bits = 0
            for joint, (asked, bit) in enumerate(((left, STALLED_LEFT), (right, STALLED_RIGHT))):
                _, rate, _, effort = pybullet.getJointState(self.robot, joint)
                if asked and abs(effort) > 0.95 * self.torque and abs(rate) * self.radius < 0.05:
                    bits |= bit
            contacts = pybullet.getContactPoints(self.robot, linkIndexA=-1)
            touch = next((one for one in contacts if one[2] != self.floor), None)
            if touch is not None:
                bits |= TOUCHES
                if not self.touching:
                    name = next((name for name, thing in self.things.items() if thing == touch[2]), "")
                    touched.append(struct.pack("<Idd", number, *touch[6][:2]) + text(name))
            self.touching = touch is not None
            angles = (pybullet.getJointState(self.robot, joint)[0] - self.zero[joint] for joint in (0, 1))
            rows += struct.pack("<ddB", *angles, bits)
        moved = self.moved()
        lists = (struct.pack("<H", len(one)) + b"".join(one) for one in (touched, moved))
        return struct.pack("<I", steps) + rows + self.report() + b"".join(lists)

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
        begins = [(x + rx * c - ry * s, y + rx * s + ry * c, self.ring) for rx, ry, _ in rays]
        ways = [(math.cos(heading + way), math.sin(heading + way)) for _, _, way in rays]
        ends = [(bx + longest * dx, by + longest * dy, bz) for (bx, by, bz), (dx, dy) in zip(begins, ways, strict=True)]
        found = []
        for (thing, _, share, _, normal), (dx, dy) in zip(pybullet.rayTestBatch(begins, ends), ways, strict=True):
            if thing < 0 or thing == self.robot:
                found.append((math.inf, 0.0))
            else:
                found.append((share * longest, min(1.0, abs(normal[0] * dx + normal[1] * dy))))
        return found

    def ranges(self, fields):
        (count,) = fields.take("H")
        aside = [self.cone / 2 * (2 * ray / (RAYS_PER_SONAR - 1) - 1) for ray in range(RAYS_PER_SONAR)]
        found = []
        for number in fields.take(f"{count}H"):
            x, y, heading = self.sonar[number]
            found.append(min(self.cast([(x, y, heading + each) for each in aside], self.longest))[0])
        return struct.pack(f"<H{count}d", count, *found)

    def rays(self, fields):
        longest, count = fields.take("dI")
        hits = self.cast([fields.take("ddd") for _ in range(count)], longest)
        return struct.pack("<I", count) + b"".join(struct.pack("<dd", *hit) for hit in hits)


def serve(line):
    """Answer each request of a connection."""
    stream, body = line.makefile("rwb"), Body()
    while len(head := stream.read(5)) == 5:
        size, kind = struct.unpack("<IB", head)
        fields = Fields(stream.read(size - 1))
        try:
            payload, kind = body.answers[kind](fields), kind | ANSWER
        except (ValueError, KeyError, struct.error, pybullet.error) as error:  # KeyError: meshes, saving, a name
            payload, kind = text(str(error)), FAILED
        stream.write(struct.pack("<IB", len(payload) + 1, kind) + payload)
        stream.flush()


def listen(address):
    """Listen on unix:PATH or tcp:127.0.0.1:PORT, and say where."""
    scheme, _, place = address.partition(":")
    if scheme == "unix":
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(place)
    else:
        listener = socket.create_server(("127.0.0.1", int(place.removeprefix("127.0.0.1:"))))
        address = f"tcp:127.0.0.1:{listener.getsockname()[1]}"
    listener.listen()
    print(f"listening on {address}", flush=True)
    return listener


def main():
    if len(sys.argv) != 2 or not sys.argv[1].startswith(("unix:", "tcp:127.0.0.1:")):
        sys.exit("usage: bullet_body.py unix:PATH|tcp:127.0.0.1:PORT")
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    listener = listen(sys.argv[1])
    while True:
        line, _ = listener.accept()
        if os.fork() == 0:
            listener.close()
            with contextlib.suppress(OSError):
                serve(line)
            os._exit(0)
        line.close()


if __name__ == "__main__":
    main()
