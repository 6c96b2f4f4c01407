"""What is fitted to drives: what least squares are asked, what they answer, and each model, at random."""

import contextlib
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any
from unittest import mock

import numpy as np

from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Pose
from p2os.protocol.commands import rvel, vel
from robot_bench.drives.drive import Drive, Floats, Steps, Trajectory, steps_of
from robot_bench.experiments.fitting import clocks, examples, ramps, rounding, sonar, umbmark, wheels
from robot_bench.experiments.fitting.echoes import Bearings
from robot_bench.experiments.fitting.least_squares import Estimate, Fit, Parameter, Rounding, fit
from robot_bench.experiments.fitting.resampling import best_of_resamples, estimate_of
from robot_bench.experiments.fitting.rounding import grain_of, noise_before
from tests.robot_bench.experiments.synthetic_robots import MAKES, WALLS, Planted
from tests.robot_bench.experiments.synthetic_robots import drive as driven
from tests.robot_bench.experiments.test_fits_whole import square_of
from tests.robot_bench.experiments.walks.drawn_drives import (
    P2DX,
    of_steps,
    of_way,
    shown,
    steps_drawn,
    way_of,
)
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of


def synthetic(seed: int, seconds: float, make: str = "rounded") -> Drive:
    source = Random(seed)
    return driven(P2DX, Planted.drawn(source), source, seconds, make=MAKES[make])


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


def constants(_draw: Random) -> Iterator[str]:
    """Show the tables of numbers that the package's declarations leave out."""
    yield from (f"{shown(cones)} {shown(delays)}" for cones, delays in sonar.STEPS)
    yield shown(rounding._DEVIATIONS)


def example_drives(_draw: Random) -> Iterator[str]:
    """Draw robots and the ways that they are driven, record short drives, and write all that an example has."""
    for seed in range(6):
        for noise in (True, False):
            one = examples.planted(seed, noise=noise)
            yield said([one.texts, one.parameters.track_mm, one.parameters.motion, one.parameters.sonar_cone_deg])
            yield said([one.errors.odometry, one.errors.sonar])
        stages = examples.wandering(seed, (60.0, 9.0, 0.0)[seed % 3])
        yield said([(*[(command.number, command.argument) for command in said_], lasts) for said_, lasts in stages])
    yield said([[examples._after(Pose(0.5, -1.0, at), speed, rate, 2.0) for speed, rate in ((0.3, 0.5), (-0.2, 1.5))]
                for at in (0.0, 3.0)])  # fmt: skip
    for stages in (examples.square(clockwise=True, side_mm=120)[:2], [((vel(200), rvel(30)), 0.7), ((vel(0),), 0.3)]):
        for start, camera in ((None, True), (Pose(1.0, 0.5, 0.3), False)):
            made = examples.record(one, examples.empty_world(), stages, seed=3, start=start, camera=camera)
            yield said([(chunk.at_ns, chunk.direction, zlib.crc32(chunk.data)) for chunk in made.capture.chunks])
            yield said(made.poses)
    calls: list[object] = []

    def recorded(robot: Any, world: Any, stages: Any, *, seed: int) -> Any:
        calls.append(
            [robot.texts == examples.planted(3).texts, world.name, len(stages), stages[1][0][0].argument, seed]
        )
        return replace(made, poses=made.poses[:2])

    with TemporaryDirectory(prefix="p2os-test-") as name, mock.patch.object(examples, "record", recorded):
        written = examples.write_examples(Path(name, "made"), load_world("room"), 3)
        yield said([[path.name for path in written], sorted(path.name for path in Path(name, "made").iterdir()), calls])
        for file in ("planted.toml", "planted-errors.toml", "drive-1.truth.csv"):
            yield Path(name, "made", file).read_text(encoding="utf-8")


TRACES: dict[str, Trace] = {
    "constants": constants, "examples": example_drives,
    "fits": fits, "ramped": ramped, "squares": squares, "echoes": echoes, "readings": readings, "shifted": shifted,
    "declared": declared_of("robot_bench.experiments.fitting"),
}  # fmt: skip
test_what_is_fitted_to_drives_is_what_was_approved = judge_of(__file__, TRACES)
