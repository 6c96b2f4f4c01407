"""A run that has all that goals and pages are of, made without a bench."""

import math
import random
from collections.abc import Iterator

from p2os.protocol.commands import pulse, vel
from robot_bench.events.kinds import (
    CanTransfer,
    Clearance,
    Contact,
    Event,
    Fault,
    I2cTransfer,
    Note,
    Packet,
    PinEdge,
    Pose,
    Ranges,
    SpiTransfer,
    Text,
    Verdict,
    Wave,
    WorldChange,
)
from tests.robot_bench.recording.records import S

MS = S // 1000
LONG_S = 40
#: Values of the motors, left and right, and what share of the time they are asked for.
MOTIONS = (
    ((3, 3), 0.3),
    ((2, 3), 0.15),
    ((3, 1), 0.1),
    ((-2, 2), 0.15),
    ((1, -1), 0.1),
    ((-2, -2), 0.1),
    ((0, 0), 0.1),
)


def long_run(seed: int) -> Iterator[Event]:  # noqa: C901, PLR0912 - one thing after the other
    """A robot that drives, bends, turns on the spot, backs and stands among things, and tells of it."""
    draw = random.Random(seed)
    left, right, x, y, heading, work, hits = 0, 0, 0.0, 0.0, 0.0, 0.0, 0
    angles, least_m, pins = [0.0, 0.0], 2.0, dict[str, int]()
    change_at = 0.5
    for wire in ("DD4", "DD5", *(f"motor{motor}_comm{bit}" for motor in (1, 2) for bit in (1, 2, 3))):
        pins[wire] = 0
        yield PinEdge(t=0, wire=wire, level=False)
    yield Text(t=10 * MS, data=b"ready\n")
    for step in range(LONG_S * 20):
        t = step * 50 * MS
        if step / 20 >= change_at:
            share, place = draw.random(), 0
            while share > MOTIONS[place][1] and place < len(MOTIONS) - 1:
                share, place = share - MOTIONS[place][1], place + 1
            (left, right), change_at = MOTIONS[place][0], step / 20 + 0.3 + 3 * draw.random()
            for motor, code in ((1, left), (2, right)):
                for bit in range(3):
                    wire, level = f"motor{motor}_comm{bit + 1}", code >> bit & 1
                    if pins[wire] != level:
                        pins[wire] = level
                        yield PinEdge(t=t + bit + 400_000 * (motor - 1), wire=wire, level=bool(level))
            yield Text(t=t + MS, data=f"go left={left} right={right}\n".encode())
            yield Note(t=t + 2 * MS, who="adapter", what="command", detail=f"VEL {left + right}")
        if step % 2 == 0:
            mm = tuple(round(200 + 2000 * draw.random() ** 1.5) for _ in range(8))
            yield Ranges(t=t + 3 * MS, mm=mm)
            for wire, near in (("DD4", mm[3] < 500), ("DD5", mm[4] < 450)):
                if pins[wire] != near:
                    pins[wire] = near
                    yield PinEdge(t=t + 4 * MS, wire=wire, level=bool(near))
        if draw.random() < 0.01:
            yield WorldChange(t=t + 5 * MS, op="move", name="post", fields={"x": x + draw.random(), "y": y})
        if draw.random() < 0.006:
            hits += 1
            yield Contact(t=t + 6 * MS, what="'post'", x_m=x + 0.2, y_m=y)
        if (clear_m := 0.3 + 2 * draw.random()) < least_m:
            least_m = clear_m
            yield Clearance(t=t + 7 * MS, um=round(clear_m * 1e6))
        if draw.random() < 0.02:
            period = 900 + round(200 * draw.random())
            yield Wave(t=t + 8 * MS, wire="p2dx_con", at=0, period=period, high=period // 3, ticks_hz=1_000_000)
        speeds = [side * 0.0625 + 0.004 * (draw.random() - 0.5) for side in (left, right)]
        heading += (speeds[1] - speeds[0]) / 0.33 / 20
        x += sum(speeds) / 40 * math.cos(heading)
        y += sum(speeds) / 40 * math.sin(heading)
        work += sum(map(abs, speeds)) * 0.4
        angles = [angle + speed / 20 / 0.0825 for angle, speed in zip(angles, speeds, strict=True)]
        yield Pose(
            t=t + 9 * MS, x=round(x * 1e6), y=round(y * 1e6), z=0, heading=round(heading * 1e6), pitch=0,
            left=round(speeds[0] * 1e6), right=round(speeds[1] * 1e6), left_angle=round(angles[0] * 1e6),
            right_angle=round(angles[1] * 1e6), collisions=hits, work=round(work * 1e6),
        )  # fmt: skip
        if step % 20 == 19:
            turns = [math.floor(angle / math.tau * 8) for angle in angles]
            yield Text(t=t + 10 * MS, data=f"left={turns[0]} right={turns[1]} x={x:.2f}".encode())
            yield Text(t=t + 11 * MS, data=b" m\n")


#: What the page and other readers need to know of it before.
META: dict[str, object] = {
    "threshold_m": 0.6, "step_mps": 0.0625, "pins": {"led": "PC13", "PA9": "PA9"},
    "robot": {"name": "p2dx", "front_m": 0.2, "rear_m": 0.3, "width_m": 0.4, "sonar": [[0.1, 0.05, 0.3]] * 8,
              "sonar_cone_rad": 0.5, "sonar_range_m": 5.0},
    "world": {"name": "room", "extent": [-3, -3, 3, 3], "obstacles": [
        {"name": "post", "shape": "cylinder", "kind": "obstacle", "x": 1, "y": 1, "radius": 0.2}]},
}  # fmt: skip
#: What it has not: things that come and go, transfers, verdicts.
MORE: list[Event] = [
    WorldChange(t=0, op="place", name="other", fields={"x": 9.0, "y": 9.0, "length": 1.0, "width": 1.0}),
    WorldChange(t=5, op="remove", name="nothing"),
    WorldChange(t=6, op="place", name="box", fields={"x": 1.0, "y": 2.0, "heading": 0.5, "length": 1.0, "width": 0.5}),
    WorldChange(t=7, op="place", name="box", fields={"x": 1.0, "y": 2.0, "length": 2.0, "width": 0.5}),
    WorldChange(t=8, op="move", name="box", fields={"x": 1.5, "y": 2.0}),
    WorldChange(t=9, op="remove", name="post"),
    Fault(t=10, op="inject", words="stop-button"),
    Note(t=11, who="adapter", what="connected", detail="p2dx"), Note(t=12, who="adapter", what="driving"),
    Verdict(t=13, goal="a", met=True, says="by 1 m", robustness=1.0, unit="m"),
    Verdict(t=14, goal="b", met=False, says=""),
    Packet(t=15, direction="c2r", data=vel(100).to_frame().to_bytes()[:4]),
    Packet(t=16, direction="c2r", data=vel(100).to_frame().to_bytes()[4:] + pulse().to_frame().to_bytes()[:3]),
    SpiTransfer(t=18, bus="spi1", begun=17, ended=18, from_master=b"\x01" * 20, from_slave=b"\x02"),
    I2cTransfer(t=19, bus="i2c1", begun=18, address=0x3C, is_read=False, data=b"\x10", answered=True, acknowledged=0,
                end="stop"),
    CanTransfer(t=20, bus="can", begun=19, identifier=1, is_extended=True, is_remote=False, dlc=1, data=b"\x01",
                is_own=True, error="damaged"),
]  # fmt: skip
