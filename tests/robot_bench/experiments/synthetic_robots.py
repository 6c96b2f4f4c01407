"""Robots with planted errors, driven by an integrator of their own: nothing here is shared with what is fitted to them.

Steps of 1 ms; wheels that turn as the firmware counts and roll as large as they are; slip that turns the way at random;
packets each 100 ms that come late, with counts of the wire; measured poses with noise; a room whose walls are lines.
"""

import math
import random
from dataclasses import dataclass

import numpy as np

from p2os.robots.parameters import RobotParameters
from robot_bench.drives.drive import Drive, Trajectory, steps_of

STEP_S = 0.001
STEPS_A_SECOND = 1000
#: Walls of the room: normal's direction (radians) and distance from the origin, metres.
ROOM = ((0.0, 3.0), (math.pi / 2, 2.5), (math.pi, 3.0), (-math.pi / 2, 2.5))
WALLS = np.array([[3, -2.5, 3, 2.5], [3, 2.5, -3, 2.5], [-3, 2.5, -3, -2.5], [-3, -2.5, 3, -2.5]], dtype=np.float64)


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
    cone_deg: float
    noise_m: float
    noise_part: float

    @classmethod
    def drawn(cls, source: random.Random) -> "Planted":
        return cls(
            left_wheel=source.gauss(1, 0.01), right_wheel=source.gauss(1, 0.01), track_mm=source.uniform(345, 370),
            packet_delay_s=source.randint(20, 80) / 1000, command_delay_s=source.randint(90, 150) / 1000,
            accel_mm_s2=source.uniform(200, 500), decel_mm_s2=source.uniform(200, 500),
            rot_accel_deg_s2=source.uniform(60, 150), rot_decel_deg_s2=source.uniform(60, 150),
            speed_gain=source.uniform(0.98, 1.02), turn_gain=source.uniform(0.98, 1.02),
            cone_deg=source.uniform(16, 34), noise_m=source.uniform(0.005, 0.02), noise_part=source.uniform(0, 0.01),
        )  # fmt: skip


def script(seconds: float, source: random.Random) -> list[tuple[float, float, float]]:
    """Return (time, VEL mm/s, RVEL deg/s) rows that keep the robot within 1.7 m of where it begins, whole ms."""
    rows: list[tuple[float, float, float]] = []
    at, x, y, h = 1.0, 0.0, 0.0, 0.0
    while at < seconds - 4:
        found = []
        for _ in range(60):
            lasts = source.randint(1500, 3000) / 1000
            vel, rvel = float(source.choice((0, 100, 200, 300, -150))), float(source.choice((0, 0, 30, -30, 50, -50)))
            nx, ny, nh = x, y, h
            for _ in range(20):
                nh += math.radians(rvel) * lasts / 20
                nx, ny = nx + vel / 1000 * lasts / 20 * math.cos(nh), ny + vel / 1000 * lasts / 20 * math.sin(nh)
            found.append((math.hypot(nx, ny), lasts, vel, rvel, nx, ny, nh))
            if found[-1][0] < 1.7:
                break
        _, lasts, vel, rvel, x, y, h = min(found) if found[-1][0] >= 1.7 else found[-1]
        rows.append((round(at, 3), vel, rvel))
        at += lasts
    return [*rows, (round(at, 3), 0.0, 0.0)]


def _toward(speed: float, target: float, faster: float, slower: float) -> float:
    """Return a ramped speed one step later, also where it stands in the midst of the step and goes on."""
    left_s = STEP_S
    if speed * target < 0:
        to_stand_s = abs(speed) / slower
        if to_stand_s >= left_s:
            return speed - math.copysign(slower * left_s, speed)
        speed, left_s = 0.0, left_s - to_stand_s
    step = (faster if abs(target) > abs(speed) else slower) * left_s
    return min(speed + step, target) if target > speed else max(speed - step, target)


def ramp(targets: list[float], due: list[int], count: int, faster: float, slower: float) -> np.ndarray:
    """Return the speed before each step, and behind the last: ramped towards the target whose step has come."""
    speed, speeds = 0.0, np.zeros(count + 1)
    for first, last, target in zip(due, [*due[1:], count], targets, strict=True):
        step, end = min(first, count), min(last, count)
        while step < end and speed != target:
            goal = 0.0 if speed * target < 0 else target
            rate = faster if abs(goal) > abs(speed) else slower
            alike = min(end - step, int(abs(goal - speed) / (rate * STEP_S)) - 1)
            if alike > 0:  # steps that neither reach it nor stand
                change = math.copysign(rate * STEP_S, goal - speed)
                speeds[step : step + alike + 1] = np.cumsum([speed, *[change] * alike])
                step += alike
                speed = float(speeds[step])
            else:
                speed, step = _toward(speed, target, faster, slower), step + 1
                speeds[step] = speed
        speeds[step + 1 : end + 1] = speed
    return speeds


def noises(count: int, source: random.Random) -> tuple[dict[int, list[float]], dict[int, list[float]], np.ndarray]:
    """Return normal noise: three for each measured pose, three for each packet, by its step; one for each step."""
    normal = np.random.default_rng(source.getrandbits(64)).standard_normal
    poses, packets = (
        dict(zip(steps, normal((len(steps), 3)).tolist(), strict=True))
        for steps in (range(0, count, 50), range(0, count, 100))
    )
    return poses, packets, normal(count)


def course(dl: np.ndarray, dr: np.ndarray, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, y and heading before each step, and behind the last."""
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
) -> Drive:
    rows = script(seconds, source)
    if not turns:
        rows = [(at, vel, 0.0) for at, vel, _ in rows]
    half_mm, count = parameters.track_mm / 2, round(seconds * STEPS_A_SECOND)
    due = [round((at + planted.command_delay_s - planted.packet_delay_s) * STEPS_A_SECOND) for at, _, _ in rows]
    v = ramp([vel for _, vel, _ in rows], due, count, planted.accel_mm_s2, planted.decel_mm_s2)
    w = ramp([rvel for _, _, rvel in rows], due, count, planted.rot_accel_deg_s2, planted.rot_decel_deg_s2)
    pose_noise, packet_noise, slips = noises(count, source)
    around = np.radians(w[1:]) * half_mm
    dl, dr = (v[1:] - around) * STEP_S, (v[1:] + around) * STEP_S
    ox, oy, oh = course(dl, dr, (dr - dl) / parameters.track_mm)  # mm, as counted
    dl, dr = dl * planted.left_wheel, dr * planted.right_wheel
    slips *= math.radians(slip_deg) * np.sqrt(np.abs(dl + dr) / 2000)
    x, y, h = course(dl, dr, (dr - dl) / planted.track_mm + slips)  # mm, true
    truth = [
        (step / STEPS_A_SECOND, (x[step] + nx) / 1000, (y[step] + ny) / 1000, h[step] + nh * math.radians(0.1))
        for step, (nx, ny, nh) in pose_noise.items()
    ]
    packets, speeds, sonar = [], ([], []), {}
    unit = parameters.distance_conv_mm
    for fired, (step, (*side_noise, range_noise)) in enumerate(packet_noise.items()):
        at = step / STEPS_A_SECOND + planted.packet_delay_s
        packets.append(
            (
                at,
                round(ox[step] / unit) * unit / 1000,
                round(oy[step] / unit) * unit / 1000,
                round(oh[step] * 4096 / math.tau) * math.tau / 4096,
            )
        )
        turning = math.radians(w[step]) * half_mm * planted.turn_gain
        for side, sign in ((0, -1), (1, 1)):
            told = planted.speed_gain * v[step] + sign * turning + side_noise[side]
            speeds[side].append((at, round(told) / 1000))
        number = fired % parameters.sonar_fitted
        pose, sin, cos = parameters.sonar[number], math.sin(h[step]), math.cos(h[step])
        sx, sy = x[step] + cos * pose.x_mm - sin * pose.y_mm, y[step] + sin * pose.x_mm + cos * pose.y_mm
        heading = h[step] + math.radians(pose.heading_deg)
        metres = seen(sx / 1000, sy / 1000, heading, math.radians(planted.cone_deg) / 2)
        metres += range_noise * (planted.noise_m + planted.noise_part * metres)
        sonar.setdefault(number, []).append((at, round(metres * 1000) / 1000))
    return Drive(
        name="synthetic", parameters=parameters, truth=Trajectory.of_rows(truth), odometry=Trajectory.of_rows(packets),
        told_left_mps=steps_of(speeds[0]), told_right_mps=steps_of(speeds[1]),
        commands={"VEL": steps_of([(at, value) for at, value, _ in rows]),
                  "RVEL": steps_of([(at, value) for at, _, value in rows])},
        sonar_m={number: steps_of(readings) for number, readings in sonar.items()},
    )  # fmt: skip


def seen(x: float, y: float, heading: float, half: float) -> float:
    """Return the nearest wall within a cone, metres: a wall's foot where it lies in the cone, else its edge ray."""
    nearest = 5.0
    for normal, distance in ROOM:
        ahead = distance - x * math.cos(normal) - y * math.sin(normal)
        aside = abs((normal - heading + math.pi) % math.tau - math.pi) - half
        if ahead > 0 and aside < math.pi / 2 - 0.02:
            nearest = min(nearest, ahead / math.cos(max(aside, 0.0)))
    return nearest
