"""Command delay and ramps, from commands beside the speeds that the packets tell.

Each axis (translation by VEL, rotation by RVEL) goes towards its set speed at its acceleration, away from 0, or
deceleration, towards 0, and through 0 only by standing at it. A command acts `command_delay_s` after it was on the
line, as the packets' times show it: the packets' own way on the line is part of it. `speed_gain` and `turn_gain` are
the speeds told over those commanded. What is not looked at: wheels commanded one by one (VEL2), goals (MOVE, HEAD).
"""

from collections.abc import Sequence

import numpy as np

from robot_bench.drives.drive import Drive, Floats, Steps
from robot_bench.drives.onsets import changes
from robot_bench.experiments.fitting.least_squares import Fit, Parameter, fit
from simbase.errors import FileError

#: The grain of a speed on the wire: 1 mm/s, evenly spread.
GRAIN_MPS = 1e-3 / 12**0.5
WHY = "it takes commands (VEL, RVEL) that speed up, slow down and turn, steps of several packets each"


def ramped(commands: Steps, times: Floats, faster: float, slower: float) -> Floats:
    """Return a ramped axis' speed at some times.

    Args:
        commands: Set speeds, in any unit, from 0.
        times: Seconds, rising.
        faster: Acceleration away from 0, in that unit a second.
        slower: Deceleration towards 0.
    """
    at, speed, target = -np.inf, 0.0, 0.0
    knots: list[tuple[float, float]] = [(min([*times[:1].tolist(), *commands.t_s[:1].tolist()]) - 1.0, 0.0)]
    for start, value in [*zip(commands.t_s.tolist(), commands.values.tolist(), strict=True), (np.inf, 0.0)]:
        while speed != target:
            stop = 0.0 if speed * target < 0 else target  # where the sign changes it stands first
            rate = faster if abs(stop) > abs(speed) else slower
            needed = abs(stop - speed) / rate
            if at + needed > start:
                speed += np.sign(stop - speed) * rate * (start - at)
                break
            at, speed = at + needed, stop
            knots.append((at, speed))
        if np.isfinite(start):
            at = start
            knots.append((at, speed))
            target = value
    t, v = np.array(knots).T
    return np.asarray(np.interp(times, t, v), dtype=np.float64)


def fit_ramps(drives: Sequence[Drive]) -> Fit:
    """Estimate `command_delay_s`, four accelerations, `speed_gain` and `turn_gain`.

    Raises:
        FileError: A drive has no packets, or no speed is commanded in it.
    """
    motion = drives[0].parameters.motion
    rows = [_told(drive) for drive in drives]
    parameters = [
        Parameter(name="command_delay_s", start=0.05, scale=0.1, least=-0.1, most=1.0),
        Parameter(name="accel_mm_s2", start=float(motion.accel_mm_s2), scale=100.0, least=10.0, most=10_000.0),
        Parameter(name="decel_mm_s2", start=float(motion.decel_mm_s2), scale=100.0, least=10.0, most=10_000.0),
        Parameter(name="rot_accel_deg_s2", start=float(motion.rot_accel_deg_s2), scale=40.0, least=3.0, most=5_000.0),
        Parameter(name="rot_decel_deg_s2", start=float(motion.rot_decel_deg_s2), scale=40.0, least=3.0, most=5_000.0),
        Parameter(name="speed_gain", start=1.0, scale=0.05, least=0.5, most=2.0),
        Parameter(name="turn_gain", start=1.0, scale=0.05, least=0.5, most=2.0),
    ]

    def residuals(values: Floats) -> Floats:
        delay, faster, slower, turn_faster, turn_slower, gain, turn_gain = values
        parts = []
        for times, left, right, vel, rvel, lever in rows:
            ahead = gain * ramped(vel, times - delay, faster, slower) / 1000
            around = turn_gain * lever * np.radians(ramped(rvel, times - delay, turn_faster, turn_slower))
            parts.append(np.stack((ahead - around - left, ahead + around - right), axis=1).ravel())
        return np.concatenate(parts)

    counts = [len(row[0]) for row in rows]
    numbers = np.concatenate([np.repeat(np.arange(count), 2) + sum(counts[:n]) for n, count in enumerate(counts)])
    return fit(residuals, parameters, numbers, floor=GRAIN_MPS, why=WHY)


def _told(drive: Drive) -> tuple[Floats, Floats, Floats, Steps, Steps, float]:
    """Return times, rims' speeds, both set speeds over time, and half of the track, of a drive."""
    left, right = drive.told_left_mps, drive.told_right_mps
    if left is None or right is None or not len(left.t_s):
        raise FileError(f"{drive.name} has no packets with speeds")
    axes = [drive.commands.get(name, Steps(np.zeros(0), np.zeros(0))) for name in ("VEL", "RVEL")]
    if not any(changes(axis) for axis in axes):
        raise FileError(f"no speed is commanded in {drive.name}", hint="ramps need VEL or RVEL on the line")
    motion = drive.parameters.motion
    limits = float(motion.max_velocity_mm_s), float(motion.max_rotation_deg_s)
    stops = drive.commands.get("STOP")
    set_speeds = [_limited(axis, limit, stops) for axis, limit in zip(axes, limits, strict=True)]
    return left.t_s, left.values, right.values, set_speeds[0], set_speeds[1], drive.parameters.track_mm / 2000


def _limited(axis: Steps, limit: float, stops: Steps | None) -> Steps:
    """Return set speeds within a limit, those that repeat left out, and 0 at each STOP."""
    pairs = [*zip(axis.t_s.tolist(), np.clip(axis.values, -limit, limit).tolist(), strict=True)]
    pairs += [(at, 0.0) for at in ([] if stops is None else stops.t_s.tolist())]
    kept: list[tuple[float, float]] = []
    for at, value in sorted(pairs):
        if (kept[-1][1] if kept else 0.0) != value:
            kept.append((at, value))
    return Steps(np.array([at for at, _ in kept]), np.array([value for _, value in kept]))
