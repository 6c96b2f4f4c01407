"""Robots with planted errors, driven by an integrator of their own: nothing here is shared with what is fitted to them.

Steps of 1 ms; wheels that turn as the firmware counts and roll as large as they are; slip that turns the way at random;
packets each 100 ms that come late, with counts of the wire; measured poses with noise; a room of walls and boxes, of
which a ping hears the nearest point in its sector. Speeds are rounded as they are, with nothing before that would make
them round another way each time: a robot that holds a speed tells the same number for seconds. `MAKES` has robots that
are made otherwise.
"""

import math
import random
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from p2os.robots.parameters import RobotParameters
from robot_bench.drives.drive import Drive, Steps, Trajectory, steps_of

STEP_S = 0.001
STEPS_A_SECOND = 1000
#: Between poses, and between packets.
POSE_STEPS, PACKET_STEPS = 50, 100
LONGEST_M = 5.0
#: A robot stays within this of where it begins, metres: the nearest box is 1.7 m off.
NEAR_M = 0.9


@dataclass(frozen=True, kw_only=True)
class Make:
    """What kind of robots they are, beside what each has planted."""

    #: Noise of speeds before they are rounded, mm/s: of each packet, and one that lasts for a second.
    reported_mm_s: float = 0.0
    lag_mm_s: float = 0.0
    #: A command acts at the next of such ticks; it and packets are late by so much more at most, evenly spread.
    tick_ms: int = 1
    command_ms: float = 0.0
    packet_ms: float = 0.0
    #: Rays of a ping; 0: it hears all of its sector.
    rays: int = 0


MAKES: Mapping[str, Make] = {
    "rounded": Make(),
    "noisy": Make(reported_mm_s=0.6, packet_ms=3.0),
    "lagging": Make(reported_mm_s=0.3, lag_mm_s=1.0, command_ms=4.0),
    "ticking": Make(tick_ms=5),
    "rays": Make(rays=9),
}


def _box(x: float, y: float, length: float, width: float, turn_deg: float) -> list[tuple[float, float, float, float]]:
    c, s = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    corners = [
        (x + (c * a * length - s * b * width) / 2, y + (s * a * length + c * b * width) / 2)
        for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))
    ]
    return [(*corner, *corners[number - 3]) for number, corner in enumerate(corners)]


WALLS = np.array(
    [
        (3, -2.5, 3, 2.5), (3, 2.5, -3, 2.5), (-3, 2.5, -3, -2.5), (-3, -2.5, 3, -2.5),
        *_box(1.9, -1.6, 0.5, 0.4, 0), *_box(-2.0, 1.5, 0.6, 0.4, 30), *_box(1.9, 1.6, 0.4, 0.4, 45),
        *_box(-1.9, -1.6, 0.9, 0.35, -20),
    ],
    dtype=np.float64,
)  # fmt: skip


@dataclass(frozen=True)
class Planted:
    """What is wrong with a robot."""

    left_wheel: float
    right_wheel: float
    track_mm: float
    packet_delay_s: float
    command_delay_s: float
    accel_mm_s2: float
    decel_mm_s2: float
    rot_accel_deg_s2: float
    rot_decel_deg_s2: float
    speed_gain: float
    turn_gain: float
    reversal_s: float
    cone_deg: float
    sonar_offset_m: float
    noise_m: float
    noise_part: float

    @classmethod
    def drawn(cls, source: random.Random) -> "Planted":
        return cls(
            left_wheel=source.gauss(1, 0.01), right_wheel=source.gauss(1, 0.01), track_mm=source.uniform(345, 370),
            packet_delay_s=source.uniform(0.02, 0.08), command_delay_s=source.randint(90, 150) / 1000,
            accel_mm_s2=source.uniform(200, 500), decel_mm_s2=source.uniform(200, 500),
            rot_accel_deg_s2=source.uniform(60, 150), rot_decel_deg_s2=source.uniform(60, 150),
            speed_gain=source.uniform(0.98, 1.02), turn_gain=source.uniform(0.98, 1.02),
            reversal_s=source.uniform(0.002, 0.03), cone_deg=source.uniform(16, 34),
            sonar_offset_m=source.uniform(-0.01, 0.01), noise_m=source.uniform(0.005, 0.02),
            noise_part=source.uniform(0, 0.01),
        )  # fmt: skip

    def truth(self, name: str) -> float:
        """Return what an estimate of that name should be; a reading is taken when its packet is made."""
        return self.packet_delay_s if name == "sonar_delay_s" else float(getattr(self, name))


def script(seconds: float, source: random.Random) -> list[tuple[float, float, float]]:
    """Return (time, VEL mm/s, RVEL deg/s) rows that keep the robot within `NEAR_M` of where it begins."""
    rows: list[tuple[float, float, float]] = []
    at, x, y, h = 1.0, 0.0, 0.0, 0.0
    while at < seconds - 4:
        found = []
        for _ in range(60):
            lasts = source.uniform(1.5, 3.0)
            vel, rvel = float(source.choice((0, 100, 200, 300, -150))), float(source.choice((0, 0, 30, -30, 50, -50)))
            nx, ny, nh = x, y, h
            for _ in range(20):
                nh += math.radians(rvel) * lasts / 20
                nx, ny = nx + vel / 1000 * lasts / 20 * math.cos(nh), ny + vel / 1000 * lasts / 20 * math.sin(nh)
            found.append((math.hypot(nx, ny), lasts, vel, rvel, nx, ny, nh))
            if found[-1][0] < NEAR_M:
                break
        _, lasts, vel, rvel, x, y, h = min(found) if found[-1][0] >= NEAR_M else found[-1]
        rows.append((at, vel, rvel))
        at += lasts
    return [*rows, (at, 0.0, 0.0)]


def ramp(targets: list[float], due: list[float], count: int, rates: tuple[float, float], stands_s: float) -> np.ndarray:
    """Return the speed at each step, ramped towards the target whose time (seconds) has come.

    An axis goes on in the midst of a step, and stands for a while before it changes its direction.
    """
    speeds, speed, target, standing, following = np.zeros(count), 0.0, 0.0, 0.0, 0
    for step in range(1, count):
        now, end = (step - 1) * STEP_S, step * STEP_S
        while now < end:
            if following < len(due) and due[following] <= now:
                target, following, standing = targets[following], following + 1, 0.0
            until = min(end, max(due[following], now)) if following < len(due) else end
            if standing > 0 and speed == 0:
                lasts = min(standing, until - now)
                standing, now = standing - lasts, now + lasts
                if until <= now and standing > 0:
                    continue
            if speed == target or now >= until:
                now = max(until, now)
                continue
            goal = 0.0 if speed * target < 0 else target
            rate = rates[0] if abs(goal) > abs(speed) else rates[1]
            lasts = min(abs(goal - speed) / rate, until - now)
            reached = lasts == abs(goal - speed) / rate
            speed = goal if reached else speed + math.copysign(rate * lasts, goal - speed)
            now += lasts
            if reached and goal != target:
                standing = stands_s
        speeds[step] = speed
    return speeds


def course(dl: np.ndarray, dr: np.ndarray, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, y and heading at each step."""
    heading = np.concatenate(([0.0], np.cumsum(turns)))
    middle, ahead = heading[:-1] + turns / 2, (dl + dr) / 2
    x, y = (np.concatenate(([0.0], np.cumsum(ahead * along(middle)))) for along in (np.cos, np.sin))
    return x, y, heading


def drive(
    parameters: RobotParameters,
    planted: Planted,
    source: random.Random,
    seconds: float = 60.0,
    slip_deg: float = 0.3,
    turns: bool = True,
    make: Make = MAKES["rounded"],
) -> Drive:
    """Return what a minute tells of a robot."""
    normal = np.random.default_rng(source.getrandbits(64))
    rows = [(at, vel, rvel if turns else 0.0) for at, vel, rvel in script(seconds, source)]
    half_mm, count = parameters.track_mm / 2, round(seconds * STEPS_A_SECOND)
    tick_s = make.tick_ms / 1000
    due = [at + planted.command_delay_s - planted.packet_delay_s for at, _, _ in rows]
    if make.command_ms:
        due = [at + source.uniform(-0.5, 0.5) * make.command_ms / 1000 for at in due]
    if make.tick_ms > 1:  # the next tick, half a tick later in the mean, which is part of the delay that was planted
        due = [math.ceil((at - tick_s / 2) / tick_s) * tick_s for at in due]
    stands_s = planted.reversal_s
    v = ramp([row[1] for row in rows], due, count, (planted.accel_mm_s2, planted.decel_mm_s2), stands_s)
    w = ramp([row[2] for row in rows], due, count, (planted.rot_accel_deg_s2, planted.rot_decel_deg_s2), stands_s)
    ahead, around = (v[1:] + v[:-1]) / 2, np.radians(w[1:] + w[:-1]) / 2 * half_mm
    dl, dr = (ahead - around) * STEP_S, (ahead + around) * STEP_S
    ox, oy, oh = course(dl, dr, (dr - dl) / parameters.track_mm)  # mm, as counted
    dl, dr = dl * planted.left_wheel, dr * planted.right_wheel
    slips = normal.standard_normal(len(dl)) * math.radians(slip_deg) * np.sqrt(np.abs(dl + dr) / 2000)
    x, y, h = course(dl, dr, (dr - dl) / planted.track_mm + slips)  # mm, true

    seen_at = np.arange(0, count, POSE_STEPS)
    off = normal.standard_normal((3, len(seen_at)))
    truth = Trajectory(
        np.asarray(seen_at * STEP_S, dtype=np.float64), (x[seen_at] + off[0]) / 1000, (y[seen_at] + off[1]) / 1000,
        h[seen_at] + off[2] * math.radians(0.1),
    )  # fmt: skip
    made = np.arange(source.randrange(PACKET_STEPS), count, PACKET_STEPS)
    at = made * STEP_S + planted.packet_delay_s + normal.uniform(-0.5, 0.5, len(made)) * make.packet_ms / 1000
    unit = parameters.distance_conv_mm / 1000
    odometry = Trajectory(
        at, np.round(ox[made] / 1000 / unit) * unit, np.round(oy[made] / 1000 / unit) * unit,
        np.round(oh[made] * 4096 / math.tau) * math.tau / 4096,
    )  # fmt: skip
    reported = []
    for side in (-1, 1):
        speed = planted.speed_gain * v[made] + side * np.radians(w[made]) * half_mm * planted.turn_gain
        noise = make.reported_mm_s * normal.standard_normal(len(made)) + make.lag_mm_s * _slow(len(made), normal)
        reported.append(Steps(at, np.round(speed + noise * (speed != 0)) / 1000))
    return Drive(
        name="synthetic", parameters=parameters, truth=truth, odometry=odometry, reported_left_mps=reported[0],
        reported_right_mps=reported[1],
        commands={"VEL": steps_of([(t, value) for t, value, _ in rows]),
                  "RVEL": steps_of([(t, value) for t, _, value in rows])},
        sonar_m=_sonar(parameters, planted, make, np.stack((x[made], y[made], h[made])), at, normal),
    )  # fmt: skip


def _slow(count: int, normal: np.random.Generator) -> np.ndarray:
    """Return noise of unit deviation that lasts for a second, ten packets."""
    keeps, found = math.exp(-PACKET_STEPS / STEPS_A_SECOND), normal.standard_normal(count)
    for place in range(1, count):
        found[place] = keeps * found[place - 1] + math.sqrt(1 - keeps**2) * found[place]
    return found


def _sonar(
    parameters: RobotParameters, planted: Planted, make: Make, poses: np.ndarray, at: np.ndarray,
    normal: np.random.Generator,
) -> dict[int, Steps]:  # fmt: skip
    """Return one reading a packet, sonar in turn, in counts of the wire."""
    numbers = np.arange(len(at)) % parameters.sonar_fitted
    px, py, turn = np.array([(one.x_mm, one.y_mm, math.radians(one.heading_deg)) for one in parameters.sonar])[
        numbers
    ].T
    x, y, h = poses
    sx, sy = (x + np.cos(h) * px - np.sin(h) * py) / 1000, (y + np.sin(h) * px + np.cos(h) * py) / 1000
    half = math.radians(planted.cone_deg) / 2
    if make.rays:
        metres = np.min([seen(sx, sy, h + turn + half * part, 1e-7) for part in np.linspace(-1, 1, make.rays)], axis=0)
    else:
        metres = seen(sx, sy, h + turn, half)
    noise = normal.standard_normal(len(metres)) * (planted.noise_m + planted.noise_part * metres)
    metres = np.where(metres < LONGEST_M, metres + planted.sonar_offset_m + noise, LONGEST_M)
    unit = parameters.range_um_per_count / 1e6
    metres = np.minimum(np.round(metres / unit) * unit, LONGEST_M)
    return {int(one): Steps(at[numbers == one], metres[numbers == one]) for one in np.unique(numbers)}


def seen(x: np.ndarray, y: np.ndarray, heading: np.ndarray, half: float) -> np.ndarray:
    """Return the nearest point of any wall within sectors, metres: its foot, an end, or where an edge meets it."""
    nearest = np.full(np.shape(x), LONGEST_M)
    for ax, ay, bx, by in WALLS:
        dx, dy = bx - ax, by - ay
        foot = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0, 1)
        for part in (foot, 0.0, 1.0):
            tx, ty = ax + part * dx - x, ay + part * dy - y
            is_within = np.abs((np.arctan2(ty, tx) - heading + math.pi) % math.tau - math.pi) <= half
            nearest = np.where(is_within, np.minimum(nearest, np.hypot(tx, ty)), nearest)
        for edge in (-half, half):
            c, s = np.cos(heading + edge), np.sin(heading + edge)
            with np.errstate(divide="ignore", invalid="ignore"):  # along the wall it meets it nowhere
                metres = ((ax - x) * dy - (ay - y) * dx) / (c * dy - s * dx)
                part = ((ax - x) * s - (ay - y) * c) / (c * dy - s * dx)
                meets = (metres > 0) & (part >= 0) & (part <= 1)
            nearest = np.where(meets, np.minimum(nearest, metres), nearest)
    return nearest
