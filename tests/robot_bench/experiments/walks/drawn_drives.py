"""Ways and steps drawn at random, and what a drive holds as text."""

from collections.abc import Iterator, Sequence
from random import Random
from typing import Any

import numpy as np

from p2os.robots.parameters import load_parameters
from robot_bench.drives.drive import Drive, Steps, Trajectory, steps_of
from tests.tools.suite.approved import said

P2DX = load_parameters("p2dx")
#: Longer arrays are shown by their first values and by sums in which each has another weight.
MOST_VALUES = 12


def shown(values: Any) -> str:
    """Return an array's shape and values as text."""
    found = np.asarray(values, dtype=np.float64)
    flat = found.ravel()
    if len(flat) <= MOST_VALUES:
        return f"{found.shape} {said(flat.tolist())}"
    known = np.nan_to_num(flat, nan=-7.0, posinf=99.0, neginf=-99.0)
    weights = 1 + np.arange(len(flat)) % 97 / 97
    return f"{found.shape} {said([*flat[:6].tolist(), float((known * weights).sum()), float(np.abs(known).max())])}"


def of_steps(steps: Steps | None) -> str:
    return "none" if steps is None else f"{shown(steps.t_s)} {shown(steps.values)}"


def of_way(way: Trajectory | None) -> str:
    return "none" if way is None else " ".join(map(shown, (way.t_s, way.x_m, way.y_m, way.heading_rad)))


def of_drive(drive: Drive) -> Iterator[str]:
    yield f"{drive.name} {drive.parameters.track_mm} {drive.open_goals} {drive.meta}"
    yield f"odometry {of_way(drive.odometry)} truth {of_way(drive.truth)}"
    for side in (drive.left_mps, drive.right_mps, drive.reported_left_mps, drive.reported_right_mps):
        yield of_steps(side)
    for steps in (drive.commands, drive.sonar_m, drive.motors, drive.sensors):
        yield said([(key, of_steps(one)) for key, one in steps.items()])


def way_of(draw: Random, *, begins_s: float = 0.0, steps: int = 60, still: int = 8) -> Trajectory:
    """Return a way with a stand at its beginning, with poses 20 to 60 ms apart."""
    t, rows = begins_s, list[tuple[float, float, float, float]]()
    x = y = heading = 0.0
    speed = turn = 0.0
    for step in range(steps):
        if step >= still and step % 9 == 0:
            speed, turn = draw.choice((0.0, 0.2, 0.4, -0.1)), draw.choice((0.0, 0.6, -0.9))
        dt = draw.choice((0.02, 0.05, 0.06))
        heading += turn * dt
        x, y, t = x + speed * dt * float(np.cos(heading)), y + speed * dt * float(np.sin(heading)), t + dt
        rows.append((t, x, y, heading))
    return Trajectory.of_rows(rows)


def steps_drawn(draw: Random, values: Sequence[float], count: int = 12, least_s: float = 0.0) -> Steps:
    t, rows = draw.choice((0.0, 0.3)), list[tuple[float, float]]()
    for _ in range(count):
        rows.append((round(t, 3), draw.choice(values)))
        t += least_s + draw.choice((0.0, 0.02, 0.1, 0.5, 1.3))
    return steps_of(rows)
