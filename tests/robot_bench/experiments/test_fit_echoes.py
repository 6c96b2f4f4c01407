"""Walls about a sonar: what rays and sectors meet, and the value that resampled readings are off least with."""

import math

import numpy as np
import pytest

from robot_bench.experiments.fitting import echoes
from robot_bench.experiments.fitting.echoes import SHAPES, Bearings
from robot_bench.experiments.fitting.resampling import RESAMPLES, best_of_resamples, estimate_of
from tests.robot_bench.experiments.synthetic_robots import WALLS, seen

WIDEST = math.pi / 2


def sonar_of(count: int) -> np.ndarray:
    uniform = np.random.default_rng(4).uniform
    return np.stack((uniform(-1.2, 1.2, count), uniform(-1.2, 1.2, count), uniform(-9, 9, count)))


@pytest.mark.parametrize("half_deg", [0.1, 5.0, 15.0, 45.0, 89.0])
def test_a_sector_hears_the_nearest_point_of_the_walls_in_it(half_deg: float) -> None:
    sonar, half = sonar_of(300), np.radians([half_deg])
    found = Bearings.of(WALLS, sonar, float(half[0]), 5.0).sectors(half)[0]
    assert found == pytest.approx(seen(*sonar, float(half[0])), abs=1e-9)


@pytest.mark.parametrize("half_deg", [0.1, 5.0, 15.0, 45.0])
def test_a_fan_hears_what_its_nine_rays_meet(half_deg: float) -> None:
    sonar, half = sonar_of(300), math.radians(half_deg)
    found = Bearings.of(WALLS, sonar, WIDEST, 5.0).fans(np.array([half]))[0]
    rays = [seen(sonar[0], sonar[1], sonar[2] + half * part, 1e-9) for part in np.linspace(-1, 1, 9)]
    assert found == pytest.approx(np.min(rays, axis=0), abs=1e-6)
    assert np.all(found >= Bearings.of(WALLS, sonar, WIDEST, 5.0).sectors(np.array([half]))[0] - 1e-9)


@pytest.mark.parametrize("turn", [0.0, 3.0, -7.0])
@pytest.mark.parametrize(
    ("heading_deg", "is_met"),
    [(0.0, True), (44.9, True), (45.1, False), (-44.9, True), (-45.1, False), (90.0, False), (180.0, False)],
)
def test_a_ray_meets_a_wall_between_its_ends_and_ahead(heading_deg: float, is_met: bool, turn: float) -> None:
    heading, c, s = math.radians(heading_deg), math.cos(turn), math.sin(turn)
    for ends in ((-1.0, 1.0), (1.0, -1.0)):
        wall = [part for y in ends for part in (c * 1.0 - s * y, s * 1.0 + c * y)]
        found = Bearings.of(np.array([wall]), np.array([[0.0], [0.0], [turn]]), WIDEST, 5.0).rays(np.array([heading]))
        assert found[0, 0] == pytest.approx(1 / math.cos(heading) if is_met else 5.0)


@pytest.mark.parametrize("at_once", [1, 500, 10**6])
def test_what_is_met_does_not_depend_on_how_much_is_looked_at_at_once(
    at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    bearings, halves = Bearings.of(WALLS, sonar_of(40), WIDEST, 5.0), np.radians(np.arange(1.0, 80.0, 3.0))
    before = [shape(bearings, halves) for shape in SHAPES.values()]
    monkeypatch.setattr(echoes, "MOST_AT_ONCE", at_once)
    for shape, expected in zip(SHAPES.values(), before, strict=True):
        assert np.array_equal(shape(bearings, halves), expected)


def test_where_nothing_stands_a_sonar_hears_as_far_as_it_can() -> None:
    nothing = Bearings.of(np.zeros((0, 4)), sonar_of(3), WIDEST, 5.0)
    for shape in SHAPES.values():
        assert shape(nothing, np.array([0.3])).tolist() == [[5.0, 5.0, 5.0]]


@pytest.mark.parametrize(("count", "least", "most"), [(20, 16, 20), pytest.param(100, 90, 99, marks=pytest.mark.soak)])
def test_resamples_lie_about_the_best_value_as_it_lies_about_the_truth(count: int, least: int, most: int) -> None:
    held = 0
    grid = np.linspace(-0.4, 0.4, 81)
    for seed in range(count):
        normal = np.random.default_rng(seed).standard_normal
        x, readings = normal(200), normal(200) * 0.5 + 1.0
        off = readings + grid[:, None] * x  # the truth is 0, and 1 in common
        best = best_of_resamples(off, np.full(200, 3.0), np.arange(200) // 5)
        assert best.cells.shape == (RESAMPLES,)
        assert best.offsets.mean() == pytest.approx(1.0, abs=0.15)
        one = estimate_of("slope", grid[best.cells], 40)
        assert one.half_width == pytest.approx(2.02 * 0.5 / 200**0.5, rel=0.5)
        held += one.low <= 0 <= one.high
    assert least <= held <= most


def test_a_reading_that_is_far_off_counts_for_no_more_than_its_most() -> None:
    off = np.array([[0.1] * 19 + [900.0], [0.2] * 19 + [0.0]])
    best = best_of_resamples(off, np.full(20, 0.5), np.arange(20), has_offset=False)
    few = np.random.default_rng(0).multinomial(20, [1 / 20] * 20, size=RESAMPLES)[:, -1]
    # 19 of 0.1² and some of 0.5² are less than 19 of 0.2² where these are two at most.
    assert np.array_equal(best.cells == 0, (20 - few) * 0.01 + few * 0.25 <= (20 - few) * 0.04)
    assert set(best.offsets) == {0.0}
