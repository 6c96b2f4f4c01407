"""Drives read, aligned, compared, and what is fitted to them: each step on the way to the last figure, at random."""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np

from p2os.pioneer.world import load_world
from p2os.robots.parameters import load_parameters
from robot_bench.drives.drive import Drive, Floats, Steps, Trajectory, heading_of, number_of, steps_of, wrapped
from robot_bench.drives.metrics import metrics
from robot_bench.drives.onsets import answers, changes, onset_after
from robot_bench.events.kinds import Pose, Text
from robot_bench.experiments import alignment, drive_files, parting, trajectory_errors
from robot_bench.experiments.aria_logs import is_aria_log, read_aria_log
from robot_bench.experiments.comparison import How, compare
from robot_bench.experiments.drive_files import is_recording, read_drive, write_tum
from robot_bench.experiments.fitting import clocks, ramps, sonar, umbmark, wheels
from robot_bench.experiments.fitting.echoes import Bearings
from robot_bench.experiments.fitting.least_squares import Estimate, Fit, Parameter, Rounding, fit
from robot_bench.experiments.fitting.resampling import best_of_resamples, estimate_of
from robot_bench.experiments.fitting.rounding import grain_of, noise_before
from robot_bench.experiments.sensitivity import ParameterEffect, SampleDesign, outcome_names, read_range
from tests.robot_bench.declared import declared_of
from tests.robot_bench.experiments.synthetic_robots import MAKES, WALLS, Planted
from tests.robot_bench.experiments.synthetic_robots import drive as driven
from tests.robot_bench.experiments.test_fits_whole import square_of
from tests.tools.suite.approved import Trace, judge_of, said, tried

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
    yield f"{drive.name} {drive.parameters.track_mm} {drive.has_true_wheels} {drive.open_goals} {drive.meta}"
    yield f"odometry {of_way(drive.odometry)} truth {of_way(drive.truth)}"
    for side in (drive.left_mps, drive.right_mps, drive.reported_left_mps, drive.reported_right_mps):
        yield of_steps(side)
    for steps in (drive.commands, drive.sonar_m, drive.motors, drive.sensors):
        yield said([(key, of_steps(one)) for key, one in steps.items()])


@cache
def synthetic(seed: int, seconds: float, make: str = "rounded") -> Drive:
    source = Random(seed)
    return driven(P2DX, Planted.drawn(source), source, seconds, make=MAKES[make])


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


def trajectories(draw: Random) -> Iterator[str]:
    """Cut, turn and look up ways, and lay one over another."""
    for round_ in range(6):
        one = way_of(draw)
        shift, pose = draw.uniform(-0.6, 0.6), (draw.uniform(-1, 1), draw.uniform(-1, 1), draw.uniform(-3, 3))
        other = one.moved(pose).later(shift)
        other = replace(other, x_m=other.x_m + np.linspace(0, 0.03, len(other)))
        yield f"{round_} {of_way(one)} {said(one.path_m)} {' '.join(map(shown, one.speeds()))}"
        yield of_way(other)
        yield of_way(one.at(np.array([-1.0, 0.51, 0.52, 9.0])))
        first, last = float(one.t_s[3]), float(one.t_s[-4])
        yield f"{len(one.between(first, last))} {len(one.between(first + 1e-9, last - 1e-9))}"
        yield tried(alignment.shift_by_speeds, one, other)
        yield said([tried(alignment.first_motion_s, each) for each in (one, other)])
        back = other.later(-shift)
        for place in (alignment.first_pose, alignment.least_squares_pose):
            found = place(one, back)
            yield f"{said(found)} {of_way(back.moved(found))}"
        yield said([float(alignment._difference(one, other, by)) for by in (0.0, -shift, -shift + 0.1, 50.0, -50.0)])
        for step in (0, 1, 7, len(one) - 1, len(one), len(one) + 1):
            yield tried(lambda o=one, b=back, s=step: shown(trajectory_errors.relative_errors(o, b, s).rotation_rad))
        errors = trajectory_errors.absolute_errors(one, back), trajectory_errors.relative_errors(one, back, 5)
        for each in errors:
            yield " ".join(map(shown, (each.t_s, each.translation_m, each.rotation_rad)))
            yield said(trajectory_errors.Statistics.of(each.translation_m).as_plain())
    still = Trajectory.of_rows([(0.1 * n, 1.0, 2.0, 0.0) for n in range(8)])
    for speed in (0.0049, 0.0051):
        slow = Trajectory.of_rows([(0.1 * n, speed * 0.1 * n, 0.0, 0.0) for n in range(8)])
        turning = Trajectory.of_rows([(0.1 * n, 0.0, 0.0, speed * 0.1 * n) for n in range(8)])
        yield said([tried(alignment.first_motion_s, slow), tried(alignment.first_motion_s, turning)])
        for doubled in (slow, replace(turning, heading_rad=2 * turning.heading_rad)):
            yield tried(alignment.shift_by_speeds, way_of(draw), doubled)[:40]
    yield tried(alignment.least_squares_pose, still, still)
    yield tried(alignment.first_motion_s, still)
    for later in (-0.9, 0.0, 0.35, 1.0, 9.0):
        long = Trajectory.of_rows([(0.1 * n, 0.1 * n, 0.0, 0.0) for n in range(16)])
        yield tried(lambda by=later, one=long: [of_way(each) for each in alignment.on_common_times(one, one.later(by))])
    for rows in ([], [(0.0, 1.0, 2.0, 3.0)], [(0.0, 1.0, 2.0, 3.0)] * 2, [(1.0, 0.0, 0.0, 3.1), (0.5, 0.0, 0.0, -3.1)]):
        yield tried(lambda r=rows: of_way(Trajectory.of_rows(r)))
    yield tried(Trajectory, np.array([1.0, 1.0]), np.zeros(2), np.zeros(2), np.zeros(2))
    yield shown(wrapped(np.array([0.0, 3.1, 3.2, -3.1, -3.2, 7.0, -7.0])))
    yield said([heading_of(*(draw.uniform(-1, 1) for _ in range(4))) for _ in range(4)])
    yield said([tried(number_of, text, "mine.csv", 7) for text in ("1", " -2.5e3 ", "", "nan", "inf", "x" * 90)])


def onsets(draw: Random) -> Iterator[str]:
    """Answer commands by speeds that change soon, late, in ramps, before they are steady, or not at all."""
    for _ in range(14):
        sides = []
        for _ in range(2):
            speed, target, rows = 0.0, 0.0, list[tuple[float, float]]()
            for step in range(90):
                if draw.random() < 0.08:
                    target = draw.choice((0.0, 0.3, -0.2, 0.0051, 0.0049))
                speed += float(np.clip(target - speed, *draw.choice(((-0.03, 0.03), (-0.03, 0.03), (-1.0, 1.0)))))
                rows.append((0.05 * step, round(speed, 6)))
            sides.append(steps_of(rows))
        commands = {name: steps_drawn(draw, (0.0, 100.0, 200.0)) for name in draw.sample(("VEL", "RVEL", "VEL2"), 2)}
        drive = Drive(name="d", parameters=P2DX, odometry=way_of(draw), left_mps=sides[0], right_mps=sides[1],
                      reported_left_mps=sides[1], reported_right_mps=sides[0], commands=commands)  # fmt: skip
        yield said([(name, changes(one)) for name, one in commands.items()])
        yield said([(one.command_s, one.onset_s, one.latency_s) for one in answers(drive)])
        yield said([(one.command_s, one.onset_s) for one in answers(drive, reported=True)])
        yield said([onset_after(sides[0], at, at + 1.0) for at in (-1.0, 0.0, 0.05, 0.1, 1.0, 2.0, 2.7, 4.4, 9.0)])
        yield said({key: value for key, value in metrics(drive).as_plain().items() if value is not None})
        yield shown(sides[0].at(np.array([-1.0, 0.0, 0.049, 0.05, 99.0])))
        yield of_steps(sides[0].later(0.25))
    bare = Drive(name="d", parameters=P2DX)
    yield said([answers(bare), tried(lambda: bare.body), *(tried(bare.poses, w) for w in ("auto", "truth", "other"))])
    yield said([tried(lambda w=w: of_way(replace(bare, odometry=way_of(draw)).poses(w))) for w in ("auto", "truth")])


def partings(draw: Random) -> Iterator[str]:
    """Lay signals over one another that part for a while, for too short a while, or never, and say where it began."""
    for round_ in range(10):
        one, other = (
            Drive(
                name=name, parameters=P2DX, truth=way_of(draw, steps=90),
                sensors={n: steps_drawn(draw, (0.0, 1.0)) for n in (1, 2)},
                sonar_m={n: steps_drawn(draw, (1.0, 1.14, 1.16)) for n in (0, 3)},
                motors={1: steps_drawn(draw, (0.0, 1.0, -2.0), 3)},
                commands={"VEL": steps_drawn(draw, (0.0, 200.0), 3)},
                left_mps=steps_drawn(draw, (0.0, 0.2)), right_mps=steps_drawn(draw, (0.0, 0.2)), meta={"x": 1},
                events=[Text(t=10**9 * (round_ + 1), data=b"go"),
                        Pose(t=10**9 * (round_ + 2), x=1, y=1, z=0, heading=0, pitch=0, left=0, right=0, left_angle=0,
                             right_angle=0, collisions=0)],
            )
            for name in ("one", "other")
        )  # fmt: skip
        if round_ % 2:
            other = replace(other, truth=one.body.moved((0.3, 0.1, 0.2)).later(0.2), sensors={1: one.sensors[1]})
        if round_ % 3 == 0:
            other = replace(other, motors=one.motors, commands=one.commands, sonar_m={})
        ours, theirs = one.body, other.body.at(one.body.t_s)
        rows = parting.parts(one, other, draw.choice((0.0, 0.1)), ours, theirs)
        for row in rows:
            yield f"{row.bound} {said(row)}"
        yield said([parting.motion_parts_s(rows), parting.origin(rows), parting.origin(rows[:2]), parting.origin([])])
        for how in (How(), How(align="least-squares", at="moves", step_s=0.1), How(align="none", at="clocks"),
                    How(at="speeds"), How(shift_s=0.4, step_s=0.0), How(at="text go", poses=("truth", "auto")),
                    How(poses=("auto", "odometry")), How(at="text never"), How(at="what is this")):  # fmt: skip
            yield tried(lambda h=how, a=one, b=other: compare(a, b, h).as_plain())[:6000]
        found = compare(one, other)
        yield said([found.step_s, found.shift_s, found.pose, found.origin])
    yield tried(compare, replace(one, events=None), other, How(at="text go"))


def made_up(names: Sequence[str]) -> Fit:
    estimates = {name: Estimate(name=name, value=0.9 + 0.1 * n, low=0.8, high=1.3) for n, name in enumerate(names)}
    return Fit(estimates=estimates, unseen={}, residual=0.5, count=9)


class Asked:
    """Takes the place of `fit`: shows what it is asked, and what residuals are at a few places."""

    def __init__(self, draw: Random) -> None:
        self.lines: list[str] = []
        self._draw = draw

    def __call__(self, residuals: Callable[[Floats], Floats], parameters: Sequence[Parameter], clusters: Any,
                 *, floor: float, why: str, lags: int = 0, rounding: Rounding | None = None) -> Fit:  # fmt: skip
        self.lines += [said(one) for one in parameters]
        self.lines.append(f"{shown(clusters)} {said(floor)} {why} {lags}")
        start = np.array([one.start for one in parameters])
        scales = np.array([one.scale for one in parameters])
        for place in range(4):
            off = np.array([self._draw.uniform(-0.5, 0.5) if place else 0.0 for _ in parameters])
            at = np.clip(start + off * scales, [one.least for one in parameters], [one.most for one in parameters])
            self.lines.append(shown(residuals(at)))
            if rounding is not None:
                self.lines.append(shown(rounding.redrawn(at, np.random.default_rng(3))))
        self.lines.append(said(None if rounding is None else rounding.groups))
        return made_up([one.name for one in parameters])


def fits(draw: Random) -> Iterator[str]:
    """Ask for fits of wheels, ramps and squares, and show what they ask of least squares."""
    one, other = synthetic(4, 14.0), synthetic(5, 12.0, "noisy")
    stopped = replace(other, commands={**other.commands, "STOP": Steps(np.array([4.0, 9.0]), np.zeros(2))})
    fast = replace(one, commands={"VEL": steps_drawn(draw, (0.0, 300.0, 5000.0, -5000.0), 20, 0.3)})
    squares = [square_of(True, 0.05), square_of(True, 0.07), square_of(False, -0.02), square_of(False, -0.03)]
    bare = Drive(name="bare", parameters=P2DX)
    still = replace(one, commands={"VEL": Steps(np.array([1.0, 2.0]), np.zeros(2))})
    short = replace(one, truth=one.body.between(3.0, 6.0))
    cases: tuple[tuple[Any, Callable[..., Any], Sequence[Drive]], ...] = (
        (wheels, wheels.fit_wheels, [one]), (wheels, wheels.fit_wheels, [one, other]),
        (wheels, wheels.fit_wheels, [bare]), (wheels, wheels.fit_wheels, [replace(one, odometry=None)]),
        (wheels, wheels.fit_wheels, [short]), (wheels, wheels.fit_wheels, [replace(one, truth=one.body.between(3, 5))]),
        (ramps, ramps.fit_ramps, [one]), (ramps, ramps.fit_ramps, [stopped, other]), (ramps, ramps.fit_ramps, [fast]),
        (ramps, ramps.fit_ramps, [bare]), (ramps, ramps.fit_ramps, [still]),
        (umbmark, umbmark.umbmark, squares), (umbmark, umbmark.umbmark, squares[1:3]),
        (umbmark, umbmark.umbmark, squares[:2]), (umbmark, umbmark.umbmark, [bare]),
        (umbmark, umbmark.umbmark, [replace(squares[0], truth=None)]),
    )  # fmt: skip
    for module, begin, drives in cases:
        asked = Asked(draw)
        with mock.patch.object(module, "fit", asked):
            yield f"{begin.__name__} {tried(lambda b=begin, d=drives: type(b(d)).__name__)}"
            yield from asked.lines
            with contextlib.suppress(Exception):
                yield said(begin(drives).as_plain())
    for turns in (0.59, 0.61, 1.19, 1.21, -0.7):
        t = np.linspace(0.0, 9.0, 30)
        round_ = Trajectory(t, np.cos(t), np.sin(t), 2 * np.pi * turns * t / 9.0)
        square = tried(umbmark.Square.of, Drive(name="s", parameters=P2DX, odometry=round_, truth=round_))
        yield f"{turns} {square if 'Error' in square else 'a square'}"
    for _ in range(6):
        centres = tuple(np.array([draw.uniform(-0.2, 0.2), draw.uniform(-0.2, 0.2)]) for _ in range(2))
        yield said(umbmark.by_formulas(centres, 2.0, 0.35))  # type: ignore[arg-type]  # two of them
    yield said(umbmark.by_formulas((np.array([0.1, 0.0]), np.array([0.1, 0.0])), 2.0, 0.35))
    way = way_of(draw)
    rims = wheels.Rims.of(way, 0.35)
    yield f"{shown(rims.left_m)} {shown(rims.right_m)} {of_way(rims.driven(1.01, 0.98, 0.36))}"


def ramped(draw: Random) -> Iterator[str]:
    """Ramp set speeds: with pauses, across 0, and cut off on their way; and what holds steady scatters by."""
    for _ in range(16):
        commands = steps_drawn(draw, (0.0, 100.0, 300.0, -200.0, -50.0), draw.choice((1, 3, 12)))
        times = np.linspace(-0.5, 9.0, 60)
        for reversal_s in (0.0, 0.02, 0.4):
            faster, slower = draw.choice((150.0, 900.0)), draw.choice((200.0, 9e4))
            yield shown(ramps.ramped(commands, times, faster, slower, reversal_s))
        stops = draw.choice((None, steps_of([(0.5, 0.0), (2.0, 0.0)])))
        yield of_steps(ramps._limited(commands, draw.choice((90.0, 250.0)), stops))
        sizes = np.array([draw.choice((0.0, 0.001, -0.001, 0.003, 0.05)) for _ in range(draw.choice((0, 1, 9, 40)))])
        yield said([ramps._scatter(sizes, grain) for grain in (0.0, 0.001, 0.002)])
    yield shown(ramps.ramped(Steps(np.zeros(0), np.zeros(0)), np.array([1.0, 2.0]), 1.0, 1.0))
    for kind in ("rounded", "noisy", "lagging"):
        one = ramps._Reported.of(synthetic(6, 8.0, kind))
        yield " ".join(map(shown, (one.times, one.speeds, one.manoeuvres, one.held_steps(), [one.lever_m])))
    for values in ([], [0.0], [3.0, 6.0, 9.0], [0.001, 0.0025, 1.0], [1.0, 2**0.5], [7.0, 7.0], [1e-9, 1.0]):
        yield said(grain_of(np.array(values)))
    yield said([noise_before(v, g) for v in (0.0, 0.01, 1 / 12, 0.3, 1.0, 1.08, 1.09, 4.0) for g in (0.0, 1.0, 0.1)])


def squares(draw: Random) -> Iterator[str]:
    """Solve small problems: of few clusters, of clusters that depend on each other, rounded, and with what hides."""
    normal = np.random.default_rng(8)
    for count, per, lags, is_rounded in ((5, 8, 0, False), (9, 3, 0, True), (30, 2, 2, False), (3, 6, 0, False),
                                         (2, 6, 0, False), (40, 1, 5, True)):  # fmt: skip
        size = count * per
        x = np.linspace(0.0, 2.0, size)
        y = 1.5 + 0.7 * x + 0.05 * normal.standard_normal(size)
        parameters = [Parameter(name="level", start=1.0, scale=0.5, least=-9.0, most=9.0),
                      Parameter(name="slope", start=0.0, scale=0.5, least=-9.0, most=9.0)]  # fmt: skip

        def redrawn(values: Floats, random: np.random.Generator, x: Floats = x) -> Floats:
            exact = values[0] + values[1] * x
            return np.asarray(exact - np.round((exact + 0.02 * random.standard_normal(len(x))) / 0.2) * 0.2)

        rounding = Rounding(redrawn=redrawn, groups=[["slope"]]) if is_rounded else None
        for hides in (False, True):

            def residuals(values: Floats, x: Floats = x, y: Floats = y, hides: bool = hides) -> Floats:
                return np.asarray(values[0] + values[1] * (np.zeros(len(x)) if hides else x) - y)

            clusters = np.repeat(np.arange(count) * 3 + 1, per)
            for floor in (0.001, 3.0):
                options: dict[str, Any] = {"floor": floor, "why": "it hides", "lags": lags, "rounding": rounding}
                found = tried(fit, residuals, parameters, clusters, **options)
                yield f"{count} {lags} {hides} {floor} {found}"
    alike = fit(lambda v: v[0] + v[1] - np.linspace(0, 1, 12), [
        Parameter(name=name, start=0.1, scale=1.0, least=-5.0, most=5.0) for name in ("a", "b")
    ], np.arange(12), floor=0.01, why="alike")  # fmt: skip
    yield said(alike.as_plain())
    yield said(Estimate(name="a", value=1.0, low=0.5, high=1.75).half_width)


def echoes(draw: Random) -> Iterator[str]:
    """Look from many places at walls: along rays, by fans and by whole sectors."""
    for longest_m in (1.2, 5.0):
        for widest in (0.1, 0.6, 1.5):
            places = np.array([[draw.uniform(-2.8, 2.8), draw.uniform(-2.3, 2.3), draw.uniform(-3.1, 3.1)]
                               for _ in range(7)]).T  # fmt: skip
            seen = Bearings.of(WALLS, places, widest, longest_m)
            halves = np.array([0.0, 0.3 * widest, widest])
            yield " ".join(map(shown, (seen.first, seen.seeing, seen.near, seen.foot_rad, seen.low_rad, seen.high_rad)))
            yield shown(seen.rays(np.array([-widest, 0.0, 0.5 * widest])))
            yield f"{shown(seen.fans(halves))} {shown(seen.sectors(halves))}"
    nothing = Bearings.of(WALLS[:0], np.zeros((3, 2)), 0.3, 5.0)
    yield f"{shown(nothing.rays(np.zeros(1)))} {shown(nothing.sectors(np.zeros(1)))}"
    through = Bearings.of(np.array([(-1.0, 0.0, 1.0, 0.0)]), np.zeros((3, 1)), 0.3, 5.0)
    yield f"{shown(through.near)} {shown(through.sectors(np.array([0.2])))}"
    for name in ("arena", "room", "maze"):
        with contextlib.suppress(ValueError, LookupError, OSError):
            yield f"{name} {tried(lambda n=name: shown(sonar.walls_of(load_world(n), P2DX)))}"


def readings(draw: Random) -> Iterator[str]:
    """Take readings of drives, search for cone and delay, and resample them."""
    one, rays = synthetic(7, 12.0), synthetic(8, 9.0, "rays")
    for drives in ([one], [one, rays], [replace(one, sonar_m={99: one.sonar_m[0], 0: one.sonar_m[0]})]):
        found = sonar._Readings(drives, WALLS)
        yield f"{shown(found.metres)} {shown(found.blocks)} {found.count}"
        for shape in ("sector", "rays"):
            yield shown(found.off(shape, np.array([5.0, 25.0]), np.array([0.0, 0.1])))
    few = tried(sonar.fit_sonar, [replace(one, sonar_m={0: Steps(one.sonar_m[0].t_s[:9], one.sonar_m[0].values[:9])})],
                WALLS)  # fmt: skip
    yield few
    found = sonar._Readings([one], WALLS)
    with mock.patch.object(sonar, "STEPS", ((np.arange(2.0, 42.0, 8.0), np.arange(-0.1, 0.2, 0.1)),) * 2):
        searched = [sonar._searched(found, shape) for shape in ("sector", "rays")]
    yield said(searched)
    best = sonar._shaped(found, searched)
    off = found.off_at(best)
    yield f"{said(best)} {shown(off)} {shown(sonar._most(found.metres, off))} {sonar._hidden(found, best)}"
    yield said(sonar._hidden(found, replace(best, cone_deg=179.0, delay_s=9.0)))
    yield said([float(sonar._squares(off, most)) for most in (0.01, 0.1, 9.0)])
    with mock.patch.object(sonar, "GRID", (5, 3)):
        for hidden in ([], ["cone_deg"], ["sonar_delay_s", "sonar_offset_m"]):
            drawn = sonar._resampled(found, best, hidden)
            rows = [(name, shown(values)) for name, values in drawn.values.items()]
            yield f"{said(rows)} {shown(drawn.off)} {drawn.kept.sum()}"
    for has_offset in (True, False):
        grid = np.array([[draw.gauss(0.02 * cell, 0.03) for _ in range(30)] for cell in range(-2, 3)])
        cells = best_of_resamples(grid, np.full(30, 0.08), np.repeat(np.arange(6), 5), has_offset=has_offset)
        yield f"{shown(cells.cells)} {shown(cells.offsets)}"
    values = np.array([draw.gauss(1.0, 0.1) for _ in range(50)])
    yield said([estimate_of("x", values, blocks) for blocks in (2, 5, 400)])


def shifted(draw: Random) -> Iterator[str]:
    """Bring poses of another clock onto the packets' own, by more and by less than packets come late."""
    way = way_of(draw, steps=120)
    for late in (-3.0, -0.15, -0.05, 0.0, 0.45, 0.55, 4.0):
        drive = Drive(name=f"d{late:g}", parameters=P2DX, truth=way, odometry=way.later(late))
        drives, why = clocks.on_one_clock([drive, replace(drive, truth=None), replace(drive, odometry=None)])
        yield f"{why} {[None if one.truth is None else said(float(one.truth.t_s[0])) for one in drives]}"
    both = made_up(["packet_delay_s", "track_mm", "sonar_delay_s"])
    yield said([clocks.without_delays(both, why).as_plain() for why in ("", "of another clock")])


CSV = "t_s,x_m,y_m,heading_deg,left_mps,right_mps,sonar_m_0,sonar_m_3{more}\n"
CSV_ROWS = """0,0,0,0,0,0,1.5,
0.1,0.02,0,10,0.2,0.21,,0.7

0.3,0.06,-0.01,-170,0.2,0.19,1.4,0.6
0.3,0.07,0,190,,,1,
"""
PACKET_ROWS = """0,0,0,0,0,0,1.5,,r2c,SIP
0.1,0.02,0,3.1,0.2,0.21,,0.7,r2c,SIP
0.3,0.06,-0.01,-3.1,0.2,0.19,1.4,0.6,r2c,SIP
"""
ARIA = """;Time,X,Y,Th,encX,encY,encTh,LeftV,RightV,CmdVel,CmdRotVel,CmdHead
1.0,5,6,7,0,0,0,0,0,200,na,na
; more
1.1,5,6,7,20,-3,-90,190,210,na,-10,45
"""
SCANS = """LaserOdometryLog
#
logTime: 0.5
velocities: 200.00 10.00 0.00
robot: 0 0 0.00
time: 1.0
robot: 100 0 2.50 9
"""


def files(draw: Random) -> Iterator[str]:
    """Read drives from tables and logs: whole, with a field otherwise, and with lines too many or too few."""
    texts: dict[str, str] = {
        "a.csv": CSV.format(more="") + CSV_ROWS,
        "packets.csv": CSV.format(more=",dir,type").replace("deg", "rad") + PACKET_ROWS,
        "b.tum": "# t x y z qx qy qz qw\n0 1 2 0 0 0 0 1\n0.5 1.1 2.2 0 0 0 0.5 0.8\n\n0.9 1.3 2 0 0.1 0.2 0.3 0.9\n",
        "aria.log": ARIA,
        "tabs.log": (";Time\tX\tY\tTh\n" + "1.0\t5\t6\t7:\n;Time\tX\tY\tTh\tCmdVel2\n" + "2.0\t50\t60\t70\t3\n"),
        "scans.2d": SCANS,
        "a.mine": "",
    }
    plugged = SimpleNamespace(
        knows=lambda path: path.suffix == ".mine",
        read=lambda path, parameters: Drive(name=path.name, parameters=parameters, odometry=way_of(Random(1))),
    )
    with (
        TemporaryDirectory(prefix="p2os-test-") as name,
        mock.patch.object(drive_files, "installed_points", lambda group: {"mine": group}),
        mock.patch.object(drive_files, "loaded", lambda point: {drive_files.READERS: plugged}[point]),
    ):
        folder = Path(name)
        for file, text in texts.items():
            path = folder / file
            path.write_text(text, encoding="utf-8")
            drive = read_drive(path, robot=draw.choice(("", "p3dx")))
            yield from of_drive(drive)
            write_tum(drive.body, folder / "out.tum")
            written = [float(word) for word in (folder / "out.tum").read_text(encoding="utf-8").split()]
            yield f"{is_recording(path)} {shown(written)}"
            rows = text.splitlines(keepends=True)
            for place, row in enumerate(rows):
                fields = row.split(",") if "," in row else row.split()
                changed = draw.randrange(len(fields) or 1)
                fields = ["x" if number == changed else one for number, one in enumerate(fields)]
                others = ((), (row, row), (row[:-2] + "\n",), (",".join(fields).rstrip("\n") + "\n",))
                for other in others:
                    path.write_text("".join((*rows[:place], *other, *rows[place + 1 :])), encoding="utf-8")
                    found = tried(lambda p=path: said([*of_drive(read_drive(p))]))
                    yield f"{file} {place} {found}".replace(name, "HERE")
        yield said([tried(read_drive, folder / each).replace(name, "HERE") for each in ("gone", ".")])
        yield said([is_recording(folder / each) for each in ("gone", ".")])
    for line in (";Time", "; TIME\tX", "laser odometry log", "LaserOdometryLog 3", "Time", ""):
        yield said([is_aria_log(line), tried(read_aria_log, "mine", [line], P2DX)])


def ranges(draw: Random) -> Iterator[str]:
    """Read ranges, sample them, and find effects of made-up outcomes."""
    for text in ("a=1..4", " a.b = -2 .. +3 ", "a=0.5..1", "a=2..1", "a=1..1", "a=1..", "=1..2", "a=x..2", "a=1..inf",
                 "a=1..2..3", ""):  # fmt: skip
        yield f"{text} {tried(read_range, text)}"
    three = (read_range("a=1..4"), read_range("b=0.5..2"), read_range("c=-3..3"))
    for steps, trajectories_, samples in ((0, 0, 0), (1, 0, 0), (2, 0, 0), (5, 2, 0), (0, 3, 4), (3, 0, -1), (3, 0, 6)):
        design = tried(SampleDesign, ranges=three, steps=steps, trajectories=trajectories_, seed=4, samples=samples)
        yield design
        if "Error" in design:
            continue
        made = SampleDesign(ranges=three, steps=steps, trajectories=trajectories_, seed=4, samples=samples)
        points = made.points()
        yield said([len(points), points[:9], [made.settings(point) for point in points[-2:]]])
        if not samples:
            yield said([one.as_plain() for one in made.effects(lambda p: p[0] ** 2 - p[1] + p[0] * p[2])])
            yield said([(one.spread, one.size) for one in made.effects(lambda p: p[0] + 2 * p[1])])
    for alone in ((), (1.0, 3.0)):
        for mu_star in (None, 5.0):
            effect = ParameterEffect(key="k", alone=alone, mu=None, mu_star=mu_star, mu_star_conf=None, sigma=None)
            yield said([effect.size, replace(effect, ST=0.0).size, effect.spread])
    found: list[Mapping[str, float]] = [{"goal 1 a": 1.0, "path_m": 2.0, "x": 1.0}, {"goal 1 a": 2.0, "path_m": 3.0}]
    for wanted in ([], ["path_m"], ["x"], ["goal 1 a"]):
        yield said([tried(outcome_names, found, wanted), tried(outcome_names, [{"path_m": 1.0}], wanted)])


TRACES: dict[str, Trace] = {
    "trajectories": trajectories, "onsets": onsets, "partings": partings, "fits": fits, "ramped": ramped,
    "squares": squares, "echoes": echoes, "readings": readings, "shifted": shifted, "files": files, "ranges": ranges,
}  # fmt: skip
for _package in ("experiments", "experiments.fitting", "experiments.validation", "drives"):
    TRACES[f"declared in {_package}"] = declared_of(_package)
test_what_experiments_make_of_drives_is_what_was_approved = judge_of(__file__, TRACES)
