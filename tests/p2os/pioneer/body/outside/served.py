"""One of our bodies behind the protocol of outside bodies, and a socket whose far end answers what a test says."""

import pickle
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from p2os.pioneer.body.contract import RobotScene
from p2os.pioneer.body.factory import make_scene
from p2os.pioneer.body.outside.messages import (
    ANSWER,
    FAILED,
    REQUESTS,
    Answer,
    AskRanges,
    AskRays,
    Bye,
    Done,
    Failed,
    Hello,
    MakeWorld,
    Message,
    Move,
    Place,
    PlaceMesh,
    Ranges,
    Rays,
    Remove,
    Report,
    Request,
    Reset,
    Restore,
    Save,
    Saved,
    StandAt,
    Step,
    Stepped,
    Welcome,
    decode,
    encode,
)
from p2os.pioneer.sonar.ring import Cone
from p2os.pioneer.world.model import Mesh, Obstacle, ObstacleKind, Pose, World
from p2os.robots.parameters import load_parameters
from simbase.errors import P2osError

BY_NUMBER = {number: request for request, (number, _) in REQUESTS.items()}
KINDS = {0: ObstacleKind.OBSTACLE, 1: ObstacleKind.OBSTACLE, 2: ObstacleKind.FLOOR, 3: ObstacleKind.RAMP}
#: What a test's far end does with each request: the bytes that it answers, or None to hang up.
Answering = Callable[[Request], bytes | None]


class Last(bytes):
    """What is answered before the line is closed."""


class Served:
    """The server's side: what each request makes of one of our scenes."""

    def __init__(self, engine: str, abilities: int) -> None:
        self.engine, self.abilities = engine, abilities
        self.scene: RobotScene | None = None
        self.things: list[Obstacle] = []
        self.meshes: list[Mesh] = []
        self.steps_asked: list[int] = []

    def __call__(self, request: Request) -> bytes | None:
        try:
            answer: Answer = self.answer(request)
        except P2osError as error:
            answer = Failed(str(error))
        number, _ = REQUESTS[type(request)]
        return encode(answer, FAILED if isinstance(answer, Failed) else number | ANSWER)

    def answer(self, request: Request) -> Answer:  # noqa: C901, PLR0911, PLR0912  # one case a message
        match request:
            case Hello(robot=robot):
                self.model = load_parameters(robot)
                return Welcome(1, int(self.abilities), f"{self.engine}, served", "")
            case MakeWorld(name, extent):
                self.world_name, self.extent = name, extent
                self.scene, self.things, self.meshes = None, [], []
            case Place(name, kind, sizes):
                x, y, heading, length, width, radius, base, height, mass, friction = sizes
                thing = Obstacle(
                    name=name, x_m=x, y_m=y, heading_rad=heading, length_m=length, width_m=width, radius_m=radius,
                    base_m=base, height_m=height, mass_kg=mass, friction=friction, kind=KINDS[kind],
                )  # fmt: skip
                if self.scene is None:
                    self.things.append(thing)
                else:
                    self.scene.place(thing)
            case PlaceMesh(name, corners, triangles):
                self.meshes.append(Mesh(name=name, vertices=corners, triangles=triangles))
            case Move(name, pose):
                self.scene.move(name, *pose)
            case Remove(name):
                self.scene.remove(name)
            case Reset((x, y, heading, z), seed):
                self.reset(Pose(x, y, heading, z), seed)
                return self.report()
            case StandAt((x, y, heading, _)):
                self.body.stand_at(x, y, heading)
                return self.report()
            case Step(rows):
                return self.step(rows)
            case AskRanges(numbers):
                return Ranges(tuple(self.body.ranges(numbers)))
            case AskRays(longest_m, rays):
                ((x, y),) = {ray[:2] for ray in rays}
                headings = tuple(ray[2] for ray in rays)
                found = self.body.scan(Cone(x, y, headings, tuple(_unit(h) for h in headings)), longest_m)
                return Rays(tuple((far, 1.0) for far in found))
            case Save():
                return Saved(pickle.dumps(self.scene.snapshot()))
            case Restore(state):
                self.reset(Pose(0.0, 0.0, 0.0), 0)
                self.scene.restore(pickle.loads(state))  # noqa: S301 - our own bytes
                return self.report()
        return Done()

    @property
    def body(self):
        return self.scene.bodies[0]

    def reset(self, pose: Pose, seed: int) -> None:
        if self.scene is None:
            world = World(
                name=self.world_name, source="", description="", start=pose, extent=self.extent,
                obstacles=tuple(self.things), meshes=tuple(self.meshes),
            )  # fmt: skip
            self.scene = make_scene(self.engine, world, [self.model])
            self.scene.reset([pose], seed)
        else:
            self.body.start = pose
            self.body.put_back()

    def step(self, rows) -> Stepped:
        self.steps_asked.append(len(rows))
        made, touched = [], []
        for number, (left, right, powered) in enumerate(rows):
            self.body.is_powered = bool(powered)
            wheels, state = self.body.step(left, right), self.body.state
            bits = wheels.stalled_left + 2 * wheels.stalled_right + 4 * state.in_contact
            made.append((wheels.left_angle_rad, wheels.right_angle_rad, bits))
            touched += [(number, (hit.x_m, hit.y_m), hit.name) for hit in self.body.take_hits()]
        moved = tuple((thing.name, (thing.x_m, thing.y_m, thing.heading_rad)) for thing in self.body.take_moved())
        return Stepped(tuple(made), self.report().numbers, tuple(touched), moved)

    def report(self) -> Report:
        s = self.body.state
        return Report((
            s.x_m, s.y_m, s.z_m, s.heading_rad, s.pitch_rad, s.left_angle_rad, s.right_angle_rad, s.left_speed_mps,
            s.right_speed_mps, s.forward_mps, s.turn_radps, -1.0, s.rim_work_j,
        ))  # fmt: skip


def _unit(heading: float) -> tuple[float, float]:
    from math import cos, sin

    return cos(heading), sin(heading)


@contextmanager
def serving(make: Callable[[], Answering]) -> Iterator[str]:
    """Serve at a socket of its own, each connection by what `make` returns; yield the address."""
    with TemporaryDirectory(prefix="ob") as folder, socket.socket(socket.AF_UNIX) as listener:
        path = Path(folder, "s")
        listener.bind(str(path))
        listener.listen(4)
        lines: list[socket.socket] = []

        def accept() -> None:
            while True:
                try:
                    line, _ = listener.accept()
                except OSError:
                    return
                line.settimeout(60)
                lines.append(line)
                threading.Thread(target=_serve, args=(line, make()), daemon=True).start()

        threading.Thread(target=accept, daemon=True).start()
        try:
            yield f"unix:{path}"
        finally:
            listener.shutdown(socket.SHUT_RDWR)
            for line in lines:
                line.close()


@contextmanager
def served(engine: str = "kinematic", abilities: int = 7) -> Iterator[tuple[str, list[Served]]]:
    """Serve one of our bodies; yield the address, and what serves each connection."""
    made: list[Served] = []

    def make() -> Served:
        made.append(Served(engine, abilities))
        return made[-1]

    with serving(make) as address:
        yield address, made


def _serve(line: socket.socket, answer: Answering) -> None:
    stream = line.makefile("rwb")
    try:
        while len(head := stream.read(5)) == 5:
            size, number = struct.unpack("<IB", head)
            request: Message = decode(BY_NUMBER[number], stream.read(size - 1))
            out = answer(request)
            if out is None or isinstance(request, Bye):
                return
            stream.write(out)
            stream.flush()
            if isinstance(out, Last):
                return
    except (OSError, ValueError):
        return
    finally:
        line.close()


def frame(kind: int, payload: bytes) -> bytes:
    """Return a frame of any type and content."""
    return struct.pack("<IB", 1 + len(payload), kind) + payload
