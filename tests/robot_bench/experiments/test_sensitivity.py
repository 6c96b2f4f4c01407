"""Which parameters an outcome depends on: effects of known functions, and the same whatever the number of workers."""

import json
import math
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from robot_bench.experiments.sensitivity import Range, SampleDesign, outcome_names, read_range
from simbase.errors import UsageError

pytestmark = pytest.mark.skipif(find_spec("SALib") is None, reason="the extra experiments is not installed")


def design(*ranges: Range, steps: int = 5, trajectories: int = 20) -> SampleDesign:
    return SampleDesign(ranges=ranges, steps=steps, trajectories=trajectories, seed=1)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("a.b=0.5..2", Range("a.b", 0.5, 2.0, False)),
        ("n=1..9", Range("n", 1.0, 9.0, True)),
        ("n = -3..+3", Range("n", -3.0, 3.0, True)),
        ("x=1e-3..1.5", Range("x", 0.001, 1.5, False)),
    ],
)
def test_a_range_is_read(text: str, found: Range) -> None:
    assert read_range(text) == found


@pytest.mark.parametrize(
    "text", ["", "a", "a=1", "a=1..", "a=..2", "a=2..1", "a=1..1", "a=nan..2", "a=1..inf", "a=x..y"]
)
def test_what_is_no_range_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match=r"KEY=LOW\.\.HIGH"):
        read_range(text)


def test_the_effects_of_a_line_are_its_slopes_over_the_ranges_and_do_not_spread() -> None:
    box = design(Range("a", 0.0, 2.0, False), Range("b", -1.0, 1.0, False), Range("c", 0.0, 9.0, False))
    a, b, c = box.effects(lambda point: 3 * point[0] - 5 * point[1])
    assert (a.mu, b.mu, c.mu) == (pytest.approx(6), pytest.approx(-10), pytest.approx(0))
    assert (a.mu_star, b.mu_star, c.mu_star) == (pytest.approx(6), pytest.approx(10), pytest.approx(0))
    assert max(a.sigma, b.sigma, c.sigma) < 1e-9
    assert (a.spread, b.spread, c.spread) == (pytest.approx(6), pytest.approx(10), pytest.approx(0))


def test_what_only_two_parameters_do_together_is_seen_by_the_trajectories_alone() -> None:
    box = design(Range("a", -1.0, 1.0, False), Range("b", -1.0, 1.0, False))
    a, b = box.effects(lambda point: point[0] * point[1])
    assert (a.spread, b.spread) == (pytest.approx(0), pytest.approx(0))
    assert a.mu_star > 0.3
    assert a.sigma > 0.3


def test_points_are_within_the_ranges_each_once_and_whole_where_the_ends_are() -> None:
    box = design(Range("a", 1.0, 4.0, True), Range("b", 0.5, 2.0, False))
    points = box.points()
    assert len(points) == len(set(points))
    assert all(1 <= a <= 4 and a == round(a) and 0.5 <= b <= 2.0 for a, b in points)
    assert {type(value) for _, value in box.settings(points[0])} == {int, float}
    assert points == design(*box.ranges).points()
    assert points != SampleDesign(ranges=box.ranges, steps=5, trajectories=20, seed=2).points()


def test_the_ishigami_functions_third_parameter_acts_only_with_the_first() -> None:
    box = design(*(Range(name, -math.pi, math.pi, False) for name in "abc"), trajectories=100)
    found = {
        one.key: one
        for one in box.effects(lambda p: math.sin(p[0]) + 7 * math.sin(p[1]) ** 2 + 0.1 * p[2] ** 4 * math.sin(p[0]))
    }
    assert found["c"].spread == pytest.approx(0, abs=1e-9)
    assert found["c"].mu_star > 1
    assert found["c"].sigma > abs(found["c"].mu)


def test_the_ishigami_functions_indices_are_those_of_its_formula() -> None:
    box = SampleDesign(
        ranges=tuple(Range(name, -math.pi, math.pi, False) for name in "abc"), steps=0, trajectories=0, seed=3,
        samples=1024,
    )  # fmt: skip
    found = box.effects(lambda p: math.sin(p[0]) + 7 * math.sin(p[1]) ** 2 + 0.1 * p[2] ** 4 * math.sin(p[0]))
    # V = a²/8 + b π⁴/5 + b² π⁸/18 + 1/2 with a = 7, b = 0.1; S1 and ST by its terms.
    first, second, both = (0.5 * (1 + 0.1 * math.pi**4 / 5) ** 2, 49 / 8, 0.01 * math.pi**8 * (1 / 18 - 1 / 50))
    whole = first + second + both
    wanted = [(first, first + both), (second, second), (0.0, both)]
    for one, (alone, together) in zip(found, wanted, strict=True):
        assert pytest.approx(alone / whole, abs=0.04) == one.S1
        assert pytest.approx(together / whole, abs=0.04) == one.ST
        assert one.mu_star is None
    assert len(box.points()) == 1024 * 5


def test_an_outcome_that_never_changes_has_no_variance_to_share() -> None:
    box = SampleDesign(
        ranges=(Range("a", 0, 1, False), Range("b", 0, 1, False)), steps=0, trajectories=0, seed=0, samples=4
    )
    assert [(one.S1, one.ST) for one in box.effects(lambda _point: 2.0)] == [(0.0, 0.0), (0.0, 0.0)]


def test_without_a_name_the_outcomes_are_the_margins_that_all_runs_have() -> None:
    runs = [{"path_m": 1.0, "goal 1 reach": 0.1, "goal 2 clearance": 0.2}, {"path_m": 2.0, "goal 2 clearance": 0.1}]
    assert outcome_names(runs, []) == ["goal 2 clearance"]
    assert outcome_names(runs, ["path_m"]) == ["path_m"]
    with pytest.raises(UsageError, match="goal 1 reach"):
        outcome_names(runs, ["goal 1 reach"])
    with pytest.raises(UsageError, match="no goal"):
        outcome_names([{"path_m": 1.0}], [])


SCENARIO = """
firmware = "motors.elf"
world = "room"
duration_s = 7.5
body = "kinematic"
mode = "direct"
[[goal]]
kind = "min_distance"
distance_m = 0.1
"""


@pytest.mark.soak
def test_the_step_of_the_motors_decides_how_far_they_drive_whatever_the_number_of_workers(p2os, capsys) -> None:
    Path("mine.toml").write_text(SCENARIO, encoding="utf-8")
    words = ["sensitivity", "mine.toml", "--vary", "direct.step_mm_s=40.0..80.0", "--vary", "threshold_m=0.4..0.8",
             "--steps", "2"]  # fmt: skip
    found = []
    for jobs in ("1", "3"):
        assert p2os(*words, "--trajectories", "0", "-j", jobs, "--json") == 0
        found.append(json.loads(capsys.readouterr().out))
    assert found[0] == found[1]
    first, second = found[0]["effects"]["goal 1 min_distance"]
    assert (first["parameter"], second["parameter"]) == ("direct.step_mm_s", "threshold_m")
    assert first["spread"] > 0.05
    assert second["spread"] == 0
    few = ["--steps", "0", "--trajectories", "2", "--samples", "2"]
    assert p2os(*words[:-2], *few, "--picture", "s.png", "--outcome", "path_m") == 0
    assert all(len(line) <= 80 for line in capsys.readouterr().out.splitlines())
    assert Path("s.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["mine.toml"], "which parameters?"),
        (["nowhere", "--vary", "threshold_m=0.4..0.8"], "nowhere"),
        (["mine.toml", "--vary", "threshold_m=0..0.8"], "threshold_m"),
        (["mine.toml", "--vary", "treshold_m=0.4..0.8"], "treshold_m"),
        (["mine.toml", "--vary", "threshold_m=0.8..0.4"], "KEY=LOW..HIGH"),
        (["mine.toml", "--vary", "a=1..2", "--vary", "a=1..3"], "varied twice"),
        (
            ["mine.toml", "--vary", "threshold_m=0.4..0.8", "--steps", "1", "--trajectories", "0"],
            "nothing is to be run",
        ),
        (["mine.toml", "--vary", "threshold_m=0.4..0.8", "--samples", "12"], "no power of two"),
        (["two-dodge", "--vary", "robot.east.threshold_m=0.4..0.8", "--steps", "2", "--trajectories", "0"], "several"),
    ],
)
def test_what_cannot_be_varied_is_reported_in_one_line(words: list[str], says: str, p2os, capsys) -> None:
    Path("mine.toml").write_text(SCENARIO, encoding="utf-8")
    assert p2os("sensitivity", *words) in {1, 2}
    errors = capsys.readouterr().err
    assert says in errors
    assert "Traceback" not in errors


def test_shares_of_the_trajectories_change_one_parameter_a_step() -> None:
    shares = design(Range("a", 0, 1, False), Range("b", 0, 1, False), Range("c", 0, 1, False)).morris_shares()
    changed = np.count_nonzero(np.diff(shares.reshape(-1, 4, 3), axis=1), axis=2)
    assert (changed == 1).all()
