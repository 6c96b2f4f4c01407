"""The sonar's cone and noise, from readings beside poses in a known world.

A reading is the nearest echo within the cone, in the plane of the ring, of what stands in the world as it was at the
start; `sonar_delay_s` before its packet came the robot was where it was taken. A virtual sonar is a fan of rays, a real
one hears a whole sector: that of both is taken with which the readings are off less.

Where a thing comes into the cone or leaves it, a reading jumps. So cone and delay are tried on a grid, and intervals
are those of resamples (`resampling`). Readings at either end of the range are left out, and those far from what the
model says (lost echoes, another sonar's, things that moved) count as off by no more than others may be.

What is not modelled: surfaces that send no echo back by their angle, and reflections.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from p2os.pioneer.world.model import World
from p2os.pioneer.world.plan import Plan
from p2os.robots.parameters import RobotParameters
from robot_bench.drives.drive import Drive, Floats, Trajectory
from robot_bench.experiments.fitting.echoes import SHAPES, Bearings
from robot_bench.experiments.fitting.least_squares import Fit, Parameter, fit
from robot_bench.experiments.fitting.resampling import best_of_resamples, estimate_of
from simbase.errors import FileError

#: chosen: sides of a polygon in the place of a cylinder; it is flatter than the circle by 0.1 % of the radius.
SIDES = 64
#: chosen: of more readings of a drive every second, third and so on is taken; fewer in all are too few.
MOST_READINGS, LEAST_READINGS = 1500, 20
#: chosen: readings that depend on each other lie within so many seconds, a manoeuvre; fewer blocks are too few.
BLOCK_S, LEAST_BLOCKS = 2.0, 4
#: chosen: where the search for the delay begins, seconds.
START_S = 0.05
#: Cones that are thought of, degrees: a ping goes ahead.
LEAST_DEG, MOST_DEG = 0.2, 180.0
#: chosen: what is tried in turn, cones first, each about the best of before: degrees (at first from 0), seconds.
STEPS: tuple[tuple[Floats, Floats], ...] = (
    (np.arange(2.0, 92.0, 2.0), np.arange(-0.25, 1.0, 0.05)),
    (np.arange(-2.0, 2.05, 0.2), np.arange(-0.05, 0.051, 0.01)),
    (np.arange(-0.4, 0.41, 0.1), np.arange(-0.01, 0.011, 0.002)),
)
#: chosen: cones and delays of the grid, and how far it reaches to either side at first, degrees and seconds.
GRID, NEAR_DEG, NEAR_S = (25, 13), 2.0, 0.03
#: chosen: it is to reach four deviations of what resamples come to; so much more or less is well, so often it is moved.
SPREADS, LEAST_FILLED, MOST_FILLED, MOST_ROUNDS = 4.0, 0.4, 1.3, 6
#: chosen: more than four deviations of the readings as far, and 1 cm, is another echo.
OUTLIER_DEVIATIONS, OUTLIER_M, BINS = 4.0, 0.01, 5
#: chosen: in the search for a start no reading counts for more than this, metres: what meets another thing is far off.
MOST_OFF_M = 0.1
#: A reading's grain, evenly spread: about 1 mm.
GRAIN_M = 1e-3 / 12**0.5
#: chosen: how much each could plausibly be off.
SCALES = {"cone_deg": 10.0, "sonar_delay_s": 0.1, "sonar_offset_m": 0.02}
WHY = "it takes walls seen at an angle from many poses"
#: A normal variable's deviation over the mean of its size, and over the median of it.
_PER_MEAN, _PER_MEDIAN = (np.pi / 2) ** 0.5, 1.4826


def walls_of(world: World, parameters: RobotParameters) -> Floats:
    """Return what echoes in a world: shape (n, 4), metres, each from x, y to x, y."""
    rows: list[tuple[float, float, float, float]] = []
    for thing in Plan.of_world(world, parameters).echoing_within(-1e6, -1e6, 1e6, 1e6):
        if thing.radius:
            angles = np.linspace(0, 2 * np.pi, SIDES + 1)
            x, y = thing.x + thing.radius * np.cos(angles), thing.y + thing.radius * np.sin(angles)
            rows += [*zip(x[:-1].tolist(), y[:-1].tolist(), x[1:].tolist(), y[1:].tolist(), strict=True)]
        rows += [(ax, ay, ax + dx, ay + dy) for ax, ay, dx, dy in thing.edges]
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


class _Readings:
    """Every usable reading of some drives: when, of which sonar, what."""

    def __init__(self, drives: Sequence[Drive], walls: Floats) -> None:
        parameters = drives[0].parameters
        self._walls, self._longest_m = walls, parameters.sonar_range_m
        self._drives: list[tuple[Trajectory, Floats, Floats]] = []
        ranges, blocks = [], list[npt.NDArray[np.int64]]()
        for drive in drives:
            rows = [
                (t, number, metres)
                for number, readings in drive.sonar_m.items() if number < len(parameters.sonar)
                for t, metres in zip(readings.t_s, readings.values, strict=True)
                if parameters.sonar_min_range_m < metres < parameters.sonar_range_m - 0.01
                and drive.body.t_s[0] + 1 < t < drive.body.t_s[-1]
            ]  # fmt: skip
            rows = sorted(rows)[:: 1 + len(rows) // MOST_READINGS]
            t, number, metres = np.array(rows, dtype=np.float64).reshape(-1, 3).T
            places = [parameters.sonar[int(n)] for n in number]
            sonar = np.array([(at.x_mm / 1000, at.y_mm / 1000, np.radians(at.heading_deg)) for at in places]).reshape(
                -1, 3
            )
            self._drives.append((drive.body, t, sonar))
            ranges.append(metres)
            blocks.append((t // BLOCK_S).astype(np.int64) + (blocks[-1].max(initial=0) + 1 if blocks else 0))
        self.metres = np.concatenate(ranges)
        #: Of each reading the number of its block, from 0, rising; and how many there are.
        self.blocks = np.unique(np.concatenate(blocks), return_inverse=True)[1]
        self.count = int(self.blocks.max(initial=-1)) + 1

    def off(self, shape: str, cones_deg: Floats, delays_s: Floats) -> Floats:
        """Return how much farther than the model says each reading is: shape (delays, cones, n), metres."""
        halves = np.radians(cones_deg) / 2
        found = [SHAPES[shape](self._bearings(delay, float(halves.max())), halves) for delay in delays_s.tolist()]
        return self.metres - np.asarray(found, dtype=np.float64)

    def off_at(self, found: "_Found") -> Floats:
        """Return the same at one place: shape (n,)."""
        return np.asarray(self.off(found.shape, np.array([found.cone_deg]), np.array([found.delay_s]))[0, 0])

    def _bearings(self, delay_s: float, widest_rad: float) -> Bearings:
        found = []
        for body, t, sonar in self._drives:
            x, y, heading = (np.interp(t - delay_s, body.t_s, column)
                             for column in (body.x_m, body.y_m, body.heading_rad))  # fmt: skip
            px, py, turn = sonar.T
            c, s = np.cos(heading), np.sin(heading)
            found.append(np.array([x + c * px - s * py, y + s * px + c * py, heading + turn]))
        return Bearings.of(self._walls, np.concatenate(found, axis=1), widest_rad, self._longest_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Found:
    """Where a search has come to: the shape of a ping, a cone and a delay."""

    shape: str
    cone_deg: float
    delay_s: float


def fit_sonar(drives: Sequence[Drive], walls: Floats) -> Fit:
    """Estimate `cone_deg`, `sonar_offset_m`, `sonar_delay_s`, and of the noise `noise_m` and `noise_part`.

    Args:
        drives: With readings, in the world's frame.
        walls: What echoes, as `walls_of` returns it.

    Raises:
        FileError: There are hardly any readings.
    """
    readings = _Readings(drives, walls)
    if len(readings.metres) < LEAST_READINGS or readings.count < LEAST_BLOCKS:
        raise FileError(
            f"{len(readings.metres)} sonar readings within range in {BLOCK_S * readings.count:.0f} s are too few",
            hint="nearer to walls, or longer",
        )
    best = _shaped(readings, [_searched(readings, shape) for shape in SHAPES])
    hidden = _hidden(readings, best)
    while True:
        found = _resampled(readings, best, hidden)
        wide = [name for name, values in found.values.items() if name not in hidden and values.std() > SCALES[name]]
        if not wide:
            break
        hidden += wide
    estimates = {
        name: estimate_of(name, values, readings.count) for name, values in found.values.items() if name not in hidden
    }
    off, kept = found.off, found.kept
    noise = fit(
        lambda values: values[0] + values[1] * readings.metres[kept] - np.abs(off[kept]) * _PER_MEAN,
        [
            Parameter(name="noise_m", start=0.01, scale=0.02, least=0.0, most=1.0),
            Parameter(name="noise_part", start=0.001, scale=0.02, least=0.0, most=1.0),
        ],
        readings.blocks[kept], floor=GRAIN_M, why="it takes readings near and far",
    )  # fmt: skip
    return Fit(
        estimates=estimates | noise.estimates, unseen=dict.fromkeys(hidden, WHY) | noise.unseen,
        residual=float(np.sqrt(np.mean(off[kept] ** 2))), count=int(kept.sum()),
    )  # fmt: skip


def _searched(readings: _Readings, shape: str) -> _Found:
    """Return the cone and the delay with which readings are off least: one after the other, ever finer."""
    cone, delay = 0.0, START_S
    for cones, delays in STEPS:
        tried = (cone + cones)[(cone + cones >= LEAST_DEG) & (cone + cones <= MOST_DEG)]
        cone = float(tried[_squares(readings.off(shape, tried, np.array([delay]))[0], MOST_OFF_M).argmin()])
        tried = delay + delays
        delay = float(tried[_squares(readings.off(shape, np.array([cone]), tried)[:, 0], MOST_OFF_M).argmin()])
    return _Found(shape=shape, cone_deg=cone, delay_s=delay)


def _squares(off: Floats, most: Floats | float) -> Floats:
    """Return the sums of squares, of which none is of more than its most."""
    return np.asarray(np.sum(np.minimum(np.abs(off), most) ** 2, axis=-1), dtype=np.float64)


def _shaped(readings: _Readings, found: Sequence[_Found]) -> _Found:
    """Return that with which readings are off least, each by no more than it may with the better one."""
    offs = [off - np.median(off) for off in map(readings.off_at, found)]
    most = np.min([_most(readings.metres, off) for off in offs], axis=0)
    return found[int(np.argmin([float(_squares(off, most)) for off in offs]))]


def _most(metres: Floats, off: Floats) -> Floats:
    """Return how far each reading may be off, by the median of those about as far."""
    place, sizes = np.argsort(np.argsort(metres)) * BINS // len(metres), np.abs(off)
    deviations = np.array([_PER_MEDIAN * float(np.median(sizes[place == number])) for number in range(BINS)])
    return np.asarray(np.maximum(OUTLIER_DEVIATIONS * deviations[place], OUTLIER_M))


def _hidden(readings: _Readings, best: _Found) -> list[str]:
    """Return which of cone and delay could be as much off as is plausible, and the readings say less of it."""
    steps = np.array([0.0, -1.0, 1.0])
    cones = np.clip(best.cone_deg + steps * SCALES["cone_deg"], LEAST_DEG, MOST_DEG)
    delays = best.delay_s + steps * SCALES["sonar_delay_s"]
    rows = readings.off(best.shape, cones, delays[:1])[0], readings.off(best.shape, cones[:1], delays)[:, 0]
    hidden = []
    for name, off in zip(("cone_deg", "sonar_delay_s"), rows, strict=True):
        left = off - np.median(off, axis=1)[:, None]
        least, *others = _squares(left, _most(readings.metres, left[0]))
        if min(others) - least < max(_PER_MEDIAN * float(np.median(np.abs(left[0]))), GRAIN_M) ** 2:
            hidden.append(name)
    return hidden


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Resampled:
    """What resampled readings come to."""

    #: Parameter → its value in each resample.
    values: dict[str, Floats]
    #: By how much each reading is off with their means, and whether that counts as noise.
    off: Floats
    kept: npt.NDArray[np.bool_]


def _resampled(readings: _Readings, best: _Found, hidden: Collection[str]) -> _Resampled:
    """Return with which cone, delay and offset each resample is off least; the grid follows what comes of them."""
    names = ("cone_deg", "sonar_delay_s")
    at = {"cone_deg": best.cone_deg, "sonar_delay_s": best.delay_s}
    reach = {name: 0.0 if name in hidden else near for name, near in zip(names, (NEAR_DEG, NEAR_S), strict=True)}
    off = readings.off_at(best)
    most = _most(readings.metres, off - np.median(off))
    for _ in range(MOST_ROUNDS):
        cones, delays = (
            np.unique(at[name] + reach[name] * np.linspace(-1, 1, count))
            for name, count in zip(names, GRID, strict=True)
        )
        cones = cones[(cones >= LEAST_DEG) & (cones <= MOST_DEG)]
        grid = readings.off(best.shape, cones, delays).reshape(-1, len(readings.metres))
        found = best_of_resamples(grid, most, readings.blocks, has_offset="sonar_offset_m" not in hidden)
        values = {
            "cone_deg": cones[found.cells % len(cones)], "sonar_delay_s": delays[found.cells // len(cones)],
            "sonar_offset_m": found.offsets,
        }  # fmt: skip
        is_well = True
        for name in names:
            filled = SPREADS * float(values[name].std()) / reach[name] if reach[name] else 1.0
            moved, at[name] = abs(float(values[name].mean()) - at[name]), float(values[name].mean())
            is_well &= LEAST_FILLED < filled < MOST_FILLED and moved <= reach[name] / SPREADS
            reach[name] *= float(np.clip(filled, 1 / SPREADS, 2.0))
        place = _Found(shape=best.shape, cone_deg=at["cone_deg"], delay_s=at["sonar_delay_s"])
        off = readings.off_at(place) - float(found.offsets.mean())
        most = _most(readings.metres, off)
        if is_well:
            break
    return _Resampled(values=values, off=off, kept=np.abs(off) < most)
