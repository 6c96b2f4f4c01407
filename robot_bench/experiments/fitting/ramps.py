"""Command delay and ramps, from commands beside the speeds that the packets tell.

Each axis (translation by VEL, rotation by RVEL) goes towards its set speed at its acceleration, away from 0, or
deceleration, towards 0, and through 0 only by standing at it. A command acts `command_delay_s` after it was on the
line, as the packets' times show it: the packets' own way on the line is part of it. `speed_gain` and `turn_gain` are
the speeds told over those commanded; `reversal_s` is how long an axis stands where it changes its direction, of a
firmware that ramps in steps half a step at least.

A manoeuvre, from one command to the next, is a cluster: what a command comes late by, or motors lag, lasts as long as
it. Speeds come in whole grains: where a speed is held, every packet of every such manoeuvre is off by the same part
of a grain, so that intervals count with robots near by that round alike. What the speeds do within a manoeuvre where
none changes says how much noise there is before they are rounded, which would make them round each time otherwise.

What is not looked at: wheels commanded one by one (VEL2), goals (MOVE, HEAD).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robot_bench.drives.drive import Drive, Floats, Steps
from robot_bench.drives.onsets import changes
from robot_bench.experiments.fitting.least_squares import Fit, Parameter, Rounding, fit
from robot_bench.experiments.fitting.rounding import grain_of, noise_before
from simbase.errors import FileError

#: The grain of a speed on the wire: 1 mm/s, evenly spread.
GRAIN_MPS = 1e-3 / 12**0.5
#: chosen: a step of more deviations than this, of those reported of a speed that is held, lies on a ramp.
OUTLIER_DEVIATIONS = 4.0
#: What either axis has.
AXES = ("accel_mm_s2", "decel_mm_s2", "speed_gain"), ("rot_accel_deg_s2", "rot_decel_deg_s2", "turn_gain")
WHY = "it takes commands (VEL, RVEL) that speed up, slow down and turn, steps of several packets each"


def ramped(commands: Steps, times: Floats, faster: float, slower: float, reversal_s: float = 0.0) -> Floats:
    """Return a ramped axis' speed at some times.

    Args:
        commands: Set speeds, in any unit, from 0.
        times: Seconds, rising.
        faster: Acceleration away from 0, in that unit a second.
        slower: Deceleration towards 0.
        reversal_s: How long it stands at 0 before it goes the other way.
    """
    if not len(commands.t_s):
        return np.zeros(len(times))
    at, speed, target = -np.inf, 0.0, 0.0
    knots: list[tuple[float, float]] = []
    for start, value in [*zip(commands.t_s.tolist(), commands.values.tolist(), strict=True), (np.inf, 0.0)]:
        while speed != target:
            stop = 0.0 if speed * target < 0 else target  # where the sign changes it stands first
            rate = faster if abs(stop) > abs(speed) else slower
            needed = abs(stop - speed) / rate
            if at + needed > start:
                speed += np.sign(stop - speed) * rate * max(start - at, 0.0)
                break
            at, speed = at + needed, stop
            knots.append((at, speed))
            if speed != target:
                at += reversal_s
                knots.append((min(at, start), speed))
        if np.isfinite(start):
            at = start
            knots.append((at, speed))
            target = value
    t, v = np.array(knots).T
    return np.asarray(np.interp(times, t, v), dtype=np.float64)


def fit_ramps(drives: Sequence[Drive]) -> Fit:
    """Estimate `command_delay_s`, four accelerations, `speed_gain`, `turn_gain` and `reversal_s`.

    Raises:
        FileError: A drive has no packets, or no speed is commanded in it, or too few are.
    """
    motion = drives[0].parameters.motion
    reported = [_Reported.of(drive) for drive in drives]
    parameters = [
        Parameter(name="command_delay_s", start=0.05, scale=0.1, least=-0.1, most=1.0),
        Parameter(name="accel_mm_s2", start=float(motion.accel_mm_s2), scale=100.0, least=10.0, most=10_000.0),
        Parameter(name="decel_mm_s2", start=float(motion.decel_mm_s2), scale=100.0, least=10.0, most=10_000.0),
        Parameter(name="rot_accel_deg_s2", start=float(motion.rot_accel_deg_s2), scale=40.0, least=3.0, most=5_000.0),
        Parameter(name="rot_decel_deg_s2", start=float(motion.rot_decel_deg_s2), scale=40.0, least=3.0, most=5_000.0),
        Parameter(name="speed_gain", start=1.0, scale=0.05, least=0.5, most=2.0),
        Parameter(name="turn_gain", start=1.0, scale=0.05, least=0.5, most=2.0),
        Parameter(name="reversal_s", start=0.005, scale=0.02, least=0.0, most=0.5),
    ]
    speeds: Floats = np.concatenate([one.speeds.ravel() for one in reported])
    grain = grain_of(speeds)

    def model(values: Floats) -> Floats:
        return np.asarray(np.concatenate([one.model(values).ravel() for one in reported]), dtype=np.float64)

    def residuals(values: Floats) -> Floats:
        return np.asarray(model(values) - speeds, dtype=np.float64)

    def redrawn(values: Floats, random: np.random.Generator) -> Floats:
        exact = model(values)
        noise = noise_mps * random.standard_normal(len(exact)) * (exact != 0)
        return np.asarray(exact - np.round((exact + noise) / grain) * grain, dtype=np.float64)

    rounding = Rounding(redrawn=redrawn, groups=AXES) if grain else None
    noise_mps = noise_before(_scatter(np.concatenate([one.held_steps() for one in reported]), grain), grain)
    counts = [int(one.manoeuvres[-1]) + 1 for one in reported]
    numbers = np.concatenate([np.repeat(one.manoeuvres, 2) + sum(counts[:n]) for n, one in enumerate(reported)])
    return fit(residuals, parameters, numbers, floor=GRAIN_MPS, why=WHY, rounding=rounding)


@dataclass(frozen=True, slots=True, eq=False)
class _Reported:
    """What the packets of a drive tell, and what was commanded."""

    times: Floats
    #: Of the rims, left and right: shape (n, 2), m/s.
    speeds: Floats
    vel: Steps
    rvel: Steps
    #: Half of the track, metres.
    lever_m: float
    #: Of each packet the number of its manoeuvre.
    manoeuvres: npt.NDArray[np.int64]

    @classmethod
    def of(cls, drive: Drive) -> "_Reported":
        left, right = drive.reported_left_mps, drive.reported_right_mps
        if left is None or right is None or not len(left.t_s):
            raise FileError(f"{drive.name} has no packets with speeds")
        axes = [drive.commands.get(name, Steps(np.zeros(0), np.zeros(0))) for name in ("VEL", "RVEL")]
        if not any(changes(axis) for axis in axes):
            raise FileError(f"no speed is commanded in {drive.name}", hint="ramps need VEL or RVEL on the line")
        motion = drive.parameters.motion
        limits = float(motion.max_velocity_mm_s), float(motion.max_rotation_deg_s)
        stops = drive.commands.get("STOP")
        vel, rvel = (_limited(axis, limit, stops) for axis, limit in zip(axes, limits, strict=True))
        begins = np.unique(np.concatenate((vel.t_s, rvel.t_s)))
        speeds = np.stack((left.values, right.values), axis=1)
        manoeuvres = np.searchsorted(begins, left.t_s)
        return cls(left.t_s, speeds, vel, rvel, drive.parameters.track_mm / 2000, manoeuvres)

    def model(self, values: Floats) -> Floats:
        """Return the speeds of the rims with these parameters: shape (n, 2), m/s."""
        delay, faster, slower, turn_faster, turn_slower, gain, turn_gain, reversal = values.tolist()
        times = self.times - delay
        ahead = gain * ramped(self.vel, times, faster, slower, reversal) / 1000
        turn = np.radians(ramped(self.rvel, times, turn_faster, turn_slower, reversal))
        around = turn_gain * self.lever_m * turn
        return np.asarray(np.stack((ahead - around, ahead + around), axis=1), dtype=np.float64)

    def held_steps(self) -> Floats:
        """Return the differences of neighbours late in a manoeuvre, its second half, where ramps are mostly over."""
        numbers = self.manoeuvres
        first = np.searchsorted(numbers, numbers, side="left")
        last = np.searchsorted(numbers, numbers, side="right") - 1
        late = 2 * np.arange(len(numbers)) > first + last
        kept = late[:-1] & (numbers[1:] == numbers[:-1])
        steps = np.diff(self.speeds, axis=0)[kept]
        return np.asarray(steps[self.speeds[1:][kept] != 0])


def _scatter(steps: Floats, grain: float) -> float:
    """Return the variance of speeds that are held, from differences of neighbours of which a few lie on ramps."""
    sizes = np.abs(steps)
    most = max(OUTLIER_DEVIATIONS * 1.4826 * float(np.median(sizes)), 2.5 * grain) if len(sizes) else 0.0
    held = sizes[sizes <= most]
    return float(np.mean(held**2)) / 2 if len(held) else 0.0


def _limited(axis: Steps, limit: float, stops: Steps | None) -> Steps:
    """Return set speeds within a limit, those that repeat left out, and 0 at each STOP."""
    pairs = [*zip(axis.t_s.tolist(), np.clip(axis.values, -limit, limit).tolist(), strict=True)]
    pairs += [(at, 0.0) for at in ([] if stops is None else stops.t_s.tolist())]
    kept: list[tuple[float, float]] = []
    for at, value in sorted(pairs):
        if (kept[-1][1] if kept else 0.0) != value:
            kept.append((at, value))
    return Steps(np.array([at for at, _ in kept]), np.array([value for _, value in kept]))
