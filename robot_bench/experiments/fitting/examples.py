"""Drives of a virtual robot with planted errors, recorded as a lab would record its own: packets, and measured poses.

The planted robot is a model with other ramps, another track and another sonar cone, whose firmware assumes the model's
own; its odometry errs by wheels and track, its sonar by noise. It is driven by commands on the line, in virtual time.

Written are recordings (`NAME.jsonl`), the poses that a camera above would have seen (`NAME.truth.csv`), and what was
planted (`planted.toml`, `planted-errors.toml`).

Invariant: the same seed writes the same bytes.
"""

import math
import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeAlias

from p2os.capture import Capture, Chunk, Direction, write_recording
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import ControllerSettings, Pioneer
from p2os.pioneer.sensor_errors import OdometryErrors, SensorErrors, SonarErrors
from p2os.pioneer.world.model import Pose, World
from p2os.protocol.bauds import DEFAULT_BAUD
from p2os.protocol.commands import Command, CommandNumber, command, enable, pulse, rvel, vel
from p2os.protocol.commands import sonar as sonar_on
from p2os.protocol.frames import Frame
from p2os.protocol.line_time import LineTime
from p2os.robots.parameters import RobotParameters, load_parameters
from robot_bench.experiments.fitting.umbmark import RUNS
from simbase.files import writing
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: Commands, and for how many seconds they hold; None: until the robot stands.
Stage: TypeAlias = tuple[Sequence[Command], float | None]

#: chosen: how often bytes are moved and poses measured.
LOOK_NS: Nanos = 5 * NS_PER_MS
MEASURED_NS: Nanos = 50 * NS_PER_MS
#: chosen: well within the watchdog's two seconds.
ALIVE_NS: Nanos = 500 * NS_PER_MS
#: chosen: a robot stands that has not moved for so long; and gives up to come to a stand.
STANDS_NS: Nanos = 500 * NS_PER_MS
LONGEST_NS: Nanos = 60 * NS_PER_S
#: chosen: what a camera above sees, metres and radians of deviation.
CAMERA_M, CAMERA_RAD = 0.001, 0.002
BASE = "p2dx"
WORLD_NAME = "room"
#: chosen: what is commanded, mm/s and deg/s, and how far from its beginning a drive may lead, m: the room has 1.4 m.
SPEEDS, RATES, NEAR_M, MOST_TRIES = (0, 100, 200, 300, -150), (0, 0, 30, -30, 50, -50), 0.7, 60
#: chosen: a square's side, mm; MOVE takes at most five metres.
SIDE_MM = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class Planted:
    """A robot that is not what its firmware assumes."""

    parameters: RobotParameters
    errors: SensorErrors
    texts: dict[str, str] = field(default_factory=dict)


def planted(seed: int, *, noise: bool = True) -> Planted:
    """Draw a robot.

    Args:
        seed: Decides every number.
        noise: Whether its sonar and its heading err at random too.
    """
    source, base = random.Random(seed), load_parameters(BASE)
    track_mm = source.randint(345, 370)
    motion = replace(
        base.motion, accel_mm_s2=source.randint(220, 450), decel_mm_s2=source.randint(220, 450),
        rot_accel_deg_s2=source.randint(60, 150), rot_decel_deg_s2=source.randint(60, 150),
    )  # fmt: skip
    parameters = replace(base, track_mm=track_mm, motion=motion, sonar_cone_deg=float(source.randint(18, 34)))
    left, right = round(source.gauss(1, 0.008), 4), round(source.gauss(1, 0.008), 4)
    errors = SensorErrors(
        odometry=OdometryErrors(
            left_wheel=left, right_wheel=right, track=track_mm / base.track_mm, drift_deg=0.2 if noise else 0.0
        ),
        sonar=SonarErrors(noise_m=0.008, noise_part=0.004) if noise else SonarErrors(),
    )
    robot = [
        f'based_on = "{BASE}"', "[conversion]", f"track_mm = {track_mm}", "[motion]",
        *(f"{key} = {getattr(motion, key)}" for key in ("accel_mm_s2", "decel_mm_s2", "rot_accel_deg_s2",
                                                        "rot_decel_deg_s2")),
        "[sonar]", f"cone_deg = {parameters.sonar_cone_deg}", "",
    ]  # fmt: skip
    wrong = [
        "[odometry]", f"left_wheel = {left}", f"right_wheel = {right}", f"track = {errors.odometry.track!r}",
        f"drift_deg = {errors.odometry.drift_deg}", "[sonar]", f"noise_m = {errors.sonar.noise_m}",
        f"noise_part = {errors.sonar.noise_part}", "",
    ]  # fmt: skip
    texts = {"planted.toml": "\n".join(robot), "planted-errors.toml": "\n".join(wrong)}
    return Planted(parameters=parameters, errors=errors, texts=texts)


def wandering(seed: int, seconds: float = 60.0) -> list[Stage]:
    """Return speeds that are held for a while each, after which the robot should be no further off than `NEAR_M`."""
    source = random.Random(seed)
    stages: list[Stage] = []
    at = Pose(0.0, 0.0, 0.0)
    left = seconds
    while left > 0:
        tried = []
        for _ in range(MOST_TRIES):
            speed, rate, lasts = source.choice(SPEEDS), source.choice(RATES), source.uniform(1.5, 2.5)
            tried.append((speed, rate, lasts, _after(at, speed / 1000, math.radians(rate), lasts)))
            if math.hypot(tried[-1][3].x_m, tried[-1][3].y_m) < NEAR_M:
                break
        speed, rate, lasts, at = min(tried[-1:] if len(tried) < MOST_TRIES else tried, key=_off)
        stages.append(((vel(speed), rvel(rate)), lasts))
        left -= lasts
    return [*stages, ((vel(0), rvel(0)), 2.0)]


def _off(tried: tuple[int, int, float, Pose]) -> float:
    return math.hypot(tried[3].x_m, tried[3].y_m)


def _after(at: Pose, speed_mps: float, rate_radps: float, seconds: float) -> Pose:
    """Return where an arc leads, roughly: ramps are left out."""
    middle = at.heading_rad + rate_radps * seconds / 2
    way = speed_mps * seconds
    return Pose(
        at.x_m + way * math.cos(middle), at.y_m + way * math.sin(middle),
        math.remainder(at.heading_rad + rate_radps * seconds, math.tau),
    )  # fmt: skip


def square(*, clockwise: bool, side_mm: int = SIDE_MM) -> list[Stage]:
    """Return a square by the robot's own odometry: a line and a turn, four times."""
    return [((command(*step),), None) for _ in range(4) for step in (
        (CommandNumber.MOVE, side_mm), (CommandNumber.DHEAD, -90 if clockwise else 90))]  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class ExampleDrive:
    """A drive: its line, and measured poses as (seconds, x m, y m, heading rad)."""

    capture: Capture
    poses: tuple[tuple[float, float, float, float], ...]


class _Driver:
    """A client in virtual time, who says what was scripted and writes down what is said."""

    def __init__(
        self, robot: Planted, world: World, seed: int, start: Pose | None, camera: random.Random | None
    ) -> None:
        body = make_body("kinematic", world, robot.parameters)
        if start is not None:
            body.stand_at(start.x_m, start.y_m, start.heading_rad)
        settings = ControllerSettings(errors=robot.errors, seed=seed, baud=DEFAULT_BAUD)
        self.now: Nanos = 0
        self.chunks: list[Chunk] = []
        self.poses: list[tuple[float, float, float, float]] = []
        self._pioneer = Pioneer(parameters=robot.parameters, body=body, settings=settings)
        self._body, self._camera, self._line = body, camera, LineTime(DEFAULT_BAUD)
        self._said_at: Nanos = 0
        self._moved_at: Nanos = 0

    def say(self, frame: Frame) -> None:
        """Send a frame; it arrives when its last byte does."""
        data = frame.to_bytes()
        self.wait(self._line.time_of(len(data)))
        self._pioneer.receive(data, self.now)
        self.chunks.append(Chunk(at_ns=self.now, direction=Direction.TO_ROBOT, data=data))
        self._said_at = self.now

    def wait(self, span: Nanos) -> None:
        """Let time pass."""
        end = self.now + span
        while self.now < end:
            self.now = min(end, self.now + LOOK_NS - self.now % LOOK_NS)
            self._pioneer.advance_to(self.now)
            for data in self._pioneer.take_output():
                at = self.now + self._line.time_of(len(data))
                self.chunks.append(Chunk(at_ns=at, direction=Direction.FROM_ROBOT, data=data))
            state = self._body.state
            if state.left_speed_mps or state.right_speed_mps:
                self._moved_at = self.now
            if self.now % MEASURED_NS == 0:
                seen = state.x_m, state.y_m, state.heading_rad
                if self._camera is not None:
                    gauss = self._camera.gauss
                    seen = (seen[0] + gauss(0, CAMERA_M), seen[1] + gauss(0, CAMERA_M), seen[2] + gauss(0, CAMERA_RAD))
                self.poses.append((self.now / NS_PER_S, *seen))

    def hold(self, stage: Stage) -> None:
        """Say commands and hold them for their time, or until the robot stands."""
        commands, seconds = stage
        for one in commands:
            self.say(one.to_frame())
        begun = self._moved_at = self.now
        while (
            self.now - begun < seconds * NS_PER_S
            if seconds is not None
            else self.now - self._moved_at < STANDS_NS and self.now - begun < LONGEST_NS
        ):
            self.wait(LOOK_NS)
            if self.now - self._said_at >= ALIVE_NS:
                self.say(pulse().to_frame())


def record(
    robot: Planted, world: World, stages: Iterable[Stage], *, seed: int, start: Pose | None = None, camera: bool = True
) -> ExampleDrive:
    """Drive a robot and record it.

    Args:
        robot: Which.
        world: Where.
        stages: What is commanded.
        seed: Of the robot's and the camera's randomness.
        start: Where it begins; None: at the world's start.
        camera: Whether measured poses have noise.
    """
    driver = _Driver(robot, world, seed, start, random.Random(f"camera {seed}") if camera else None)
    for number in range(3):
        driver.say(Frame(bytes((number,))))
        driver.wait(100 * NS_PER_MS)
    driver.say(Frame(bytes((1,))))
    for one in (enable(True), sonar_on(True)):
        driver.say(one.to_frame())
    driver.wait(NS_PER_S)
    for stage in stages:
        driver.hold(stage)
    driver.wait(NS_PER_S)
    chunks = tuple(sorted(driver.chunks, key=lambda chunk: chunk.at_ns))
    return ExampleDrive(
        capture=Capture(chunks=chunks, note="a virtual robot with planted errors"), poses=tuple(driver.poses)
    )


def empty_world() -> World:
    """Return a floor without anything on it."""
    far = 50.0
    return World(
        name="empty", source="", description="a floor", start=Pose(0.0, 0.0, 0.0), extent=(-far, -far, far, far),
        obstacles=(),
    )  # fmt: skip


def write_examples(folder: Path, world: World, seed: int) -> list[Path]:
    """Write three drives, five squares each way round, and what was planted; return the recordings.

    Raises:
        FileError: It cannot be written.
    """
    robot = planted(seed)
    written = []
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in robot.texts.items():
            (folder / name).write_text(f"# seed {seed}\n{text}", encoding="utf-8")
        for number in range(3):
            written.append(folder / f"drive-{number + 1}.jsonl")
            write(record(robot, world, wandering(seed + number), seed=seed + number), written[-1])
        for word in ("cw", "ccw"):
            for number in range(RUNS):
                written.append(folder / f"square-{word}-{number + 1}.jsonl")
                stages = square(clockwise=word == "cw")
                write(record(robot, empty_world(), stages, seed=seed + 100 + number), written[-1])
    return written


def write(found: ExampleDrive, path: Path) -> None:
    """Write a recording, and its measured poses beside it."""
    path.write_text(write_recording(found.capture), encoding="utf-8")
    rows = "".join(f"{t:.3f},{x:.5f},{y:.5f},{heading:.5f}\n" for t, x, y, heading in found.poses)
    path.with_suffix(".truth.csv").write_text(f"t_s,x_m,y_m,heading_rad\n{rows}", encoding="utf-8")
