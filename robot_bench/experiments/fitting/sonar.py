"""The sonar's cone and noise, from readings beside poses in a known world.

A reading is the nearest echo of as many rays over the cone as a virtual sonar has, in the plane of the ring, of what
stands in the world as it was at the start; `sonar_delay_s` before its packet came the robot was where it was taken.
Readings at either end of the range, and those far from what the model says (lost echoes, another sonar's, things that
moved), are left out.

What is not modelled: surfaces that send no echo back by their angle, and reflections.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from p2os.pioneer.sonar.ring import RAYS_PER_CONE
from p2os.pioneer.world.model import World
from p2os.pioneer.world.plan import Plan
from p2os.robots.parameters import RobotParameters
from robot_bench.drives.drive import Drive, Floats, Trajectory
from robot_bench.experiments.fitting.least_squares import Fit, Parameter, fit
from simbase.errors import FileError

#: chosen: sides of a polygon in the place of a cylinder; it is flatter than the circle by 0.1 % of the radius.
SIDES = 64
#: chosen: of more readings every second, third and so on is taken; in the search for a start, too.
MOST_READINGS, START_READINGS = 1500, 150
#: chosen: so many rays and walls are crossed in one step, of some 100 kB an array.
MOST_AT_ONCE = 16_384
#: As many answers of the model are kept as one look at all slopes asks for.
MOST_KNOWN = 4
#: chosen: where the search for the delay begins, seconds; and how often outliers are looked for.
START_S, MOST_ROUNDS = 0.05, 4
#: chosen: what differs by more than four deviations of the readings as far, and by 1 cm, is another echo.
OUTLIER_DEVIATIONS, OUTLIER_M, BINS = 4.0, 0.01, 5
#: chosen: in the search for a start no reading counts for more than this, metres: what meets another thing is far off.
MOST_OFF_M = 0.1
#: A reading's grain, evenly spread: about 1 mm.
GRAIN_M = 1e-3 / 12**0.5
#: Degrees that are tried before the search, and then around the best of them: a thing that comes into the cone or
#: leaves it makes a jump, over which no search by slopes leads.
CONES_DEG, NEAR_DEG = np.arange(2.0, 92.0, 2.0), np.arange(-2.0, 2.05, 0.1)
WHY = "it takes walls seen at an angle from many poses"
#: The deviation of a normal variable over the mean of its size.
_DEVIATION_PER_SIZE = (np.pi / 2) ** 0.5


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


def nearest(walls: Floats, x: Floats, y: Floats, headings: Floats, longest_m: float) -> Floats:
    """Return the nearest echo of fans of rays.

    Args:
        walls: Shape (m, 4).
        x: Where each fan begins, shape (n,), metres.
        y: Likewise.
        headings: Shape (n, k), radians.
        longest_m: What a fan returns that meets nothing.
    """
    found = np.full(headings.shape, longest_m)
    c, s = np.cos(headings), np.sin(headings)
    at_once = max(1, MOST_AT_ONCE // max(1, headings.size))
    for first in range(0, len(walls), at_once):
        ax, ay, bx, by = walls[first : first + at_once].T[:, :, None]
        ex, ey, fx, fy = bx - ax, by - ay, ax - x, ay - y
        with np.errstate(divide="ignore", invalid="ignore"):  # a ray along a wall meets it nowhere
            part = 1 / (c * ey[:, None] - s * ex[:, None])
            along = (fx * ey - fy * ex)[:, :, None] * part
            place = (fx[:, :, None] * s - fy[:, :, None] * c) * part
            hit = (along > 0) & (place >= 0) & (place <= 1)
        np.minimum(found, np.where(hit, along, longest_m).min(axis=0), out=found)
    return np.asarray(found.min(axis=1), dtype=np.float64)


class _Readings:
    """Every usable reading of some drives: when, of which sonar, what."""

    def __init__(self, drives: Sequence[Drive], walls: Floats) -> None:
        parameters = drives[0].parameters
        self._walls, self._longest_m = walls, parameters.sonar_range_m
        self._drives: list[tuple[Trajectory, Floats, Floats, Floats]] = []
        ranges = []
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
            self._drives.append((drive.body, t, sonar, metres))
            ranges.append(metres)
        self.metres = np.concatenate(ranges)
        self.kept = np.ones(len(self.metres), dtype=np.bool_)
        #: Of which readings and delay `_sonars` was asked last, and what it found.
        self._placed: tuple[tuple[bytes, float], Floats] = (b"", 0.0), np.empty((3, 0))
        #: What the model said last, by readings, cone and delay: slopes are asked of one after the other.
        self._known: dict[tuple[bytes, float, float], Floats] = {}
        self._some = np.arange(len(self.metres)) % (1 + len(self.metres) // START_READINGS) == 0

    def expected(self, cone_deg: float, delay_s: float) -> Floats:
        """Return what the model says of each kept reading."""
        return self._expected(self.kept, cone_deg, delay_s)

    def _expected(self, which: npt.NDArray[np.bool_], cone_deg: float, delay_s: float) -> Floats:
        asked = which.tobytes(), delay_s, cone_deg
        if (known := self._known.get(asked)) is not None:
            return known
        x, y, heading = self._sonars(which, delay_s)
        spread = np.radians(cone_deg) / 2 * np.linspace(-1, 1, RAYS_PER_CONE)
        found = nearest(self._walls, x, y, heading[:, None] + spread, self._longest_m)
        self._known = dict([*self._known.items(), (asked, found)][-MOST_KNOWN:])
        return found

    def _sonars(self, which: npt.NDArray[np.bool_], delay_s: float) -> Floats:
        """Return where some readings were taken: shape (3, n), metres and radians; what was asked last is known."""
        asked = which.tobytes(), delay_s
        if asked != self._placed[0]:
            self._placed = asked, self._place(which, delay_s)
        return self._placed[1]

    def _place(self, which: npt.NDArray[np.bool_], delay_s: float) -> Floats:
        found, begin = [], 0
        for body, t, sonar, _ in self._drives:
            these = which[begin : begin + len(t)]
            begin += len(t)
            x, y, heading = (np.interp(t[these] - delay_s, body.t_s, column)
                             for column in (body.x_m, body.y_m, body.heading_rad))  # fmt: skip
            px, py, turn = sonar[these].T
            c, s = np.cos(heading), np.sin(heading)
            found.append(np.array([x + c * px - s * py, y + s * px + c * py, heading + turn]))
        return np.concatenate(found, axis=1)

    def best_of(self, cones_deg: Floats) -> float:
        """Return the cone with which some readings are off least, in the mean."""
        x, y, heading = np.tile(self._sonars(self._some, START_S), len(cones_deg))
        spreads = np.radians(cones_deg)[:, None] / 2 * np.linspace(-1, 1, RAYS_PER_CONE)
        fans = heading[:, None] + np.repeat(spreads, len(heading) // len(cones_deg), axis=0)
        found = nearest(self._walls, x, y, fans, self._longest_m).reshape(len(cones_deg), -1)
        off = np.minimum(np.abs(found - self.metres[self._some]), MOST_OFF_M).mean(axis=1)
        return float(cones_deg[np.argmin(off)])


def fit_sonar(drives: Sequence[Drive], walls: Floats) -> Fit:
    """Estimate `cone_deg`, `sonar_offset_m`, `sonar_delay_s`, and of the noise `noise_m` and `noise_part`.

    Args:
        drives: With readings, in the world's frame.
        walls: What echoes, as `walls_of` returns it.

    Raises:
        FileError: There are hardly any readings.
    """
    readings = _Readings(drives, walls)
    if len(readings.metres) < 20:
        raise FileError(f"{len(readings.metres)} sonar readings within range are too few", hint="nearer to walls")
    start = readings.best_of(readings.best_of(CONES_DEG) + NEAR_DEG)
    for _ in range(MOST_ROUNDS):
        found, noise, off = _fit_kept(readings, start)
        far = off > _most(readings.metres[readings.kept], off)
        if not far.any():
            break
        readings.kept[np.flatnonzero(readings.kept)[far]] = False
    return Fit(
        estimates=found.estimates | noise.estimates, unseen=found.unseen | noise.unseen, residual=found.residual,
        count=found.count,
    )  # fmt: skip


def _most(metres: Floats, off: Floats) -> Floats:
    """Return how far each reading may be off, by the median of those about as far."""
    place = np.argsort(np.argsort(metres)) * BINS // len(metres)
    deviations = np.array([1.4826 * float(np.median(off[place == number])) for number in range(BINS)])
    return np.asarray(np.maximum(OUTLIER_DEVIATIONS * deviations[place], OUTLIER_M))


def _fit_kept(readings: _Readings, start: float) -> tuple[Fit, Fit, Floats]:
    """Return what the kept readings say of the geometry and of the noise, and by how much each is off, metres."""
    measured = readings.metres[readings.kept]

    def residuals(values: Floats) -> Floats:
        cone, offset, delay = values
        off: Floats = readings.expected(float(cone), float(delay)) + offset - measured
        return off

    parameters = [
        Parameter(name="cone_deg", start=start, scale=10.0, least=0.2, most=180.0),
        Parameter(name="sonar_offset_m", start=0.0, scale=0.02, least=-0.5, most=0.5),
        Parameter(name="sonar_delay_s", start=START_S, scale=0.1, least=-0.2, most=1.0),
    ]
    numbers = np.arange(len(measured))
    found = fit(residuals, parameters, numbers, floor=GRAIN_M, why=WHY)
    best = [found.estimates[one.name].value if one.name in found.estimates else one.start for one in parameters]
    off = np.abs(residuals(np.array(best)))
    noise = fit(
        lambda values: values[0] + values[1] * measured - off * _DEVIATION_PER_SIZE,
        [
            Parameter(name="noise_m", start=0.01, scale=0.02, least=0.0, most=1.0),
            Parameter(name="noise_part", start=0.001, scale=0.02, least=0.0, most=1.0),
        ],
        numbers, floor=GRAIN_M, why="it takes readings near and far",
    )  # fmt: skip
    return found, noise, off
