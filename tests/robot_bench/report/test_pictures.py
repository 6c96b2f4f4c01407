"""Every picture that the bench draws, whole: each curve, mark, name and colour as it is kept."""

import math

import numpy as np
import pytest

from bluepill_sim.analysis.waveforms.alignment import Alignment, ChannelPair, Clock, Met, Tolerance
from bluepill_sim.analysis.waveforms.comparison import PinComparison, Unexplained
from p2os.robots.parameters import load_parameters
from robot_bench.drives.drive import Drive, Steps, Trajectory
from robot_bench.events.codec import Json
from robot_bench.experiments.comparison import How, compare
from robot_bench.experiments.sensitivity import ParameterEffect
from robot_bench.report.plan import plan

pytest.importorskip("matplotlib")
from robot_bench.experiments.pictures import comparison_figure, effects_figure, latency_figure
from robot_bench.report import edge_picture, plots
from tests.robot_bench.recording.kept_lines import is_as_kept
from tests.robot_bench.report.drawn_figures import lines_of

P2DX = load_parameters("p2dx")


def run_of_all(**changes: object) -> Json:
    """What is drawn of a run with walls, a ramp, a post that goes and a box that is pushed, and two collisions."""
    room: list[Json] = [
        {"name": "north", "x": 0.0, "y": 2.0, "length": 6.0, "width": 0.1, "wall": True, "floor": False},
        {"name": "ramp", "x": -2.0, "y": -1.0, "length": 1.0, "width": 0.6, "heading": 0.5, "wall": False,
         "floor": True},
        {"name": "crate", "x": 1.0, "y": 1.0, "length": 0.8, "width": 0.4, "heading": 0.3, "wall": False,
         "floor": False},
        {"name": "post", "shape": "cylinder", "x": 2.0, "y": 0.5, "radius": 0.2, "wall": False, "floor": False},
    ]  # fmt: skip
    moved: list[Json] = [
        {"op": "move", "name": "crate", "x": 1.2, "y": 1.1, "t": 5.0},
        {"op": "remove", "name": "post", "t": 6.0},
        {"op": "place", "name": "bin", "shape": "cylinder", "x": -1.0, "y": 1.2, "radius": 0.15, "wall": False,
         "floor": False, "t": 7.0},
    ]  # fmt: skip
    poses = [[t / 2, min(2.6, t / 8), 0.01 * t, 0.1 * t % 3 - 1, 0.25 - 0.01 * t, 0.2 + 0.01 * t] for t in range(25)]
    hits = [(8.717, 2.1, 0.17, "'crate'"), (11.0, 2.6, 0.22, "north")]
    bounds = (-3.0, -2.0, 3.0, 2.0)
    drawn: Json = {
        "title": "mine in room: failed", "duration": 12.0, "obstacles": room, "changes": moved, "poses": poses,
        "plan": plan(extent=bounds, poses=poses, obstacles=room, changes=moved, hits=hits, duration_s=12.0),
        "robot": {"front": 0.18, "rear": 0.26, "width": 0.38}, "hits": hits,
        "motors": [[[0.0, 0.0], [1.0, 0.25], [9.0, -0.0625]], [[0.0, 0.1875]]],
        "pins": [["motor 1 (left)", [["PB7 comm1", [[0.0, 0], [1.0, 1], [9.0, 0.25]]], ["PB6 comm2", []]]],
                 ["motor 2 (right)", [["PB5 comm1", [[2.0, 1]]]]]],
    }  # fmt: skip
    return drawn | changes


@pytest.mark.parametrize("name", ["path", "speeds", "pins"])
def test_a_run(name: str) -> None:
    assert is_as_kept(lines_of(getattr(plots, f"_{name}_figure")(run_of_all())), f"picture_run_{name}")


def test_a_run_that_never_began() -> None:
    empty = plan(extent=(-3.0, -3.0, 3.0, 3.0), poses=[], obstacles=[], changes=[], hits=[], duration_s=1e-6)
    bare = run_of_all(plan=empty, poses=[], obstacles=[], changes=[], hits=[], motors=[[], []], pins=[])
    for name in ("path", "speeds", "pins"):
        assert is_as_kept(lines_of(getattr(plots, f"_{name}_figure")(bare)), f"picture_empty_{name}")


def compared(jump_s: float, **sensors: Steps) -> Drive:
    """A drive of 6 s that goes aside after a time."""
    t = np.arange(0.0, 6.25, 0.25)
    way = Trajectory(t, 0.3 * t, 0.2 * np.clip(t - jump_s, 0, None) ** 2, 0.5 * np.clip(t - jump_s, 0, None))
    return Drive(name=f"aside{jump_s:g}", parameters=P2DX, truth=way, meta={"k": "meta"}, **sensors)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("other", "sensor"), [(4.0, None), (3.0, None), (3.0, 0.5)], ids=["apart", "together", "sensor_alone"]
)
def test_a_comparison(other: float, sensor: float | None, request: pytest.FixtureRequest) -> None:
    one, two = compared(3.0), compared(other)
    if sensor is not None:
        one.sensors = {1: Steps(np.array([0.0]), np.array([0.0]))}
        two.sensors = {1: Steps(np.array([0.0, 1.0]), np.array([0.0, 1.0]))}
    found = compare(one, two, How(align="none"))
    assert is_as_kept(lines_of(comparison_figure(found)), f"picture_comparison_{request.node.callspec.id}")


def test_latencies() -> None:
    rows = [("line", [0.002, 0.001, 0.004]), ("whole", [0.120, 0.030])]
    assert is_as_kept(lines_of(latency_figure("mine", rows)), "picture_latency")


def effect(key: str, alone: tuple[float, ...], *found: float | None) -> ParameterEffect:
    names = ("mu", "mu_star", "mu_star_conf", "sigma", "S1", "S1_conf", "ST", "ST_conf")
    return ParameterEffect(key=key, alone=alone, **dict(zip(names, found, strict=False)))


ALONE = [effect("threshold_m", (0.1, 0.4, 0.2), -0.2, 0.25, 0.05, 0.1), effect("start.x_m", (), *[None] * 4)]
WITH_INDICES = [
    effect("threshold_m", (0.5, 0.5), 1.0, 1.5, 0.5, 0.25, 0.75, 0.125, 1.25, 0.25),
    effect("start.x_m", (0.0, 2.0), 0.5, 0.75, 0.25, 0.0, -0.01, None, 0.5, 0.1),
]


@pytest.mark.parametrize("name", ["alone", "indices"])
def test_effects(name: str) -> None:
    rows = {"alone": {"path_m": ALONE}, "indices": {"path_m": WITH_INDICES, "goal 1": WITH_INDICES[1:]}}[name]
    assert is_as_kept(lines_of(effects_figure("mine", rows)), f"picture_effects_{name}")


def met(pin: str, run: list[tuple[float, int]], capture: list[tuple[float, int]], *, added: tuple[int, ...] = (),
        missing: tuple[int, ...] = ()) -> Met:  # fmt: skip
    """Edges of a pin, those that are alone by their numbers."""
    left = [n for n in range(len(run)) if n not in missing]
    right = [n for n in range(len(capture)) if n not in added]
    return Met(ChannelPair(f"ch {pin}", pin, capture, run), [*zip(right, left, strict=True)], added, missing)


def pins_compared(unit_ns: float, first: str | None) -> PinComparison:
    """Three pins, one of them still, by a clock that is half a unit late."""
    edges = [((n + 1) * unit_ns, n % 2) for n in range(40)]
    early = [(at - unit_ns / 2, level) for at, level in edges]
    rows = [
        met("PA1", edges[:5], early[:6], added=(5,)), met("PA2", [], []),
        met("PA3", edges, early[:20] + early[21:], missing=(20,)),
    ]  # fmt: skip
    limits = Tolerance(unit_ns / 10, 1e-4, (0.0, 50 * unit_ns), (0.0, 50 * unit_ns))
    alone = None if first is None else Unexplained(
        channel=f"ch {first}", pin=first, level=0, is_added=False, run_ns=21 * unit_ns, capture_ns=20.5 * unit_ns,
        nearest=None, late_ns=None, pulse_ns=None, other_level=1,
    )  # fmt: skip
    clock = Alignment(Clock(unit_ns / 2, 0.0), 44, None)
    return PinComparison(
        alignment=clock, limits=limits, met=rows, unjudged=0, miswired=[], unexplained=2 * bool(first), first=alone
    )


@pytest.mark.parametrize(("unit_ns", "first"), [(1e3, "PA3"), (1e3, None), (2.0, "PA3"), (1e6, "PA1"), (1e9, None)])
def test_edges_of_pins(unit_ns: float, first: str | None) -> None:
    figure = edge_picture._figure(pins_compared(unit_ns, first), "mine")
    assert is_as_kept(lines_of(figure), f"picture_edges_1e{math.log10(unit_ns):.0f}_{first}")


def test_edges_of_many_pins_and_of_none() -> None:
    found = pins_compared(1e3, None)
    many = PinComparison(
        alignment=found.alignment, limits=found.limits, unjudged=0, miswired=[], unexplained=0, first=None,
        met=[met(f"PA{n}", [(1e4 * n + 1e4, 1)], [(1e4 * n + 9.5e3, 1)]) for n in range(17)],
    )  # fmt: skip
    none = PinComparison(
        alignment=found.alignment, limits=found.limits, unjudged=0, miswired=[], unexplained=0, first=None,
        met=[met("PA0", [], [])],
    )  # fmt: skip
    assert is_as_kept(lines_of(edge_picture._figure(many, "many")), "picture_edges_many")
    assert is_as_kept(lines_of(edge_picture._figure(none, "none")), "picture_edges_none")
