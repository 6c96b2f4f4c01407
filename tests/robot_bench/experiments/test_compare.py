"""Two drives laid over one another: what is found is what was planted; figures agree with evo to what it prints."""

import json
import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.capture import read_file, write_pcap
from p2os.robots.parameters import load_parameters
from robot_bench.drives.drive import Drive, Steps, Trajectory
from robot_bench.drives.onsets import onset_after
from robot_bench.experiments.alignment import (
    first_pose,
    least_squares_pose,
    on_common_times,
    shift_by_speeds,
)
from robot_bench.experiments.comparison import How, compare
from robot_bench.experiments.drive_files import read_drive, read_tum, write_tum
from robot_bench.experiments.parting import motion_parts_s, origin, parts
from robot_bench.experiments.trajectory_errors import Statistics, absolute_errors, relative_errors
from simbase.errors import FileError, UsageError
from tests.p2os.view.pages import ReadPage

P2DX = load_parameters("p2dx")


def wandering(seconds: float = 20.0, rate_hz: float = 20.0, seed: int = 1) -> Trajectory:
    """Return a smooth way with turns and stops."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1 / rate_hz)
    phases = random.uniform(0, 2 * np.pi, 3)
    speed = 0.2 + 0.15 * np.sin(0.9 * t + phases[0])
    turn = 0.6 * np.sin(0.5 * t + phases[1]) + 0.3 * np.sin(1.7 * t + phases[2])
    heading = np.cumsum(turn) / rate_hz
    return Trajectory(
        t, np.cumsum(speed * np.cos(heading)) / rate_hz, np.cumsum(speed * np.sin(heading)) / rate_hz, heading
    )


def shaken(way: Trajectory, seed: int = 2) -> Trajectory:
    """Return the way with noise on every pose."""
    random = np.random.default_rng(seed)
    n = len(way)
    return Trajectory(way.t_s, way.x_m + random.normal(0, 0.02, n), way.y_m + random.normal(0, 0.02, n),
                      way.heading_rad + random.normal(0, 0.03, n))  # fmt: skip


@pytest.mark.parametrize("shift_s", [-1.2345, -0.0071, 0.0, 0.333, 2.71828])
def test_the_shift_is_found_between_the_samples(shift_s: float) -> None:
    way = wandering(rate_hz=50.0)
    assert shift_by_speeds(way, way.moved((3.0, -1.0, 2.0)).later(-shift_s)) == pytest.approx(shift_s, abs=5e-4)


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (3.0, -2.0, 3.0), (-0.1, 0.2, -1.5)])
def test_the_move_between_two_places_is_found_and_undone(pose: tuple[float, float, float]) -> None:
    way = wandering()
    for find in (first_pose, least_squares_pose):
        back = way.moved(pose).moved(find(way, way.moved(pose)))
        errors = absolute_errors(way, back)
        assert errors.translation_m.max() < 1e-9
        assert errors.rotation_rad.max() < 1e-9


def test_least_squares_leave_no_smaller_error_nearby() -> None:
    way, other = wandering(), shaken(wandering().moved((1.0, 2.0, 0.7)))
    best = least_squares_pose(way, other)
    least = Statistics.of(absolute_errors(way, other.moved(best)).translation_m).sse
    for place in range(3):
        for step in (-1e-3, 1e-3):
            near = [*best]
            near[place] += step
            assert (
                Statistics.of(absolute_errors(way, other.moved((near[0], near[1], near[2]))).translation_m).sse > least
            )


def test_a_relative_step_sees_no_common_move_and_a_planted_drift_in_full() -> None:
    way = wandering()
    assert relative_errors(way, way.moved((5.0, 1.0, 2.0)), 7).translation_m.max() < 1e-9
    drifting = Trajectory(way.t_s, way.x_m, way.y_m, way.heading_rad + 0.01 * way.t_s)
    assert relative_errors(way, drifting, 20).rotation_rad == pytest.approx(0.01)


@pytest.mark.parametrize("step", [1, 7, 20])
def test_errors_agree_with_evo_to_the_last_digit_it_prints(step: int, tmp_path: Path) -> None:
    metrics = pytest.importorskip("evo.core.metrics")
    from evo.core.units import Unit
    from evo.tools import file_interface

    way, other = wandering(), shaken(wandering().moved((1.0, 2.0, 0.7)))
    moved = other.moved(least_squares_pose(way, other))
    write_tum(way, tmp_path / "a.tum")
    write_tum(moved, tmp_path / "b.tum")
    pair = tuple(file_interface.read_tum_trajectory_file(str(tmp_path / name)) for name in ("a.tum", "b.tum"))
    ours = absolute_errors(way, moved), relative_errors(way, moved, step)
    relations = metrics.PoseRelation.translation_part, metrics.PoseRelation.rotation_angle_rad
    for relation, name in zip(relations, ("translation_m", "rotation_rad"), strict=True):
        theirs = metrics.APE(relation), metrics.RPE(relation, delta=step, delta_unit=Unit.frames)
        for found, metric in zip(ours, theirs, strict=True):
            metric.process_data(pair)
            plain = Statistics.of(getattr(found, name)).as_plain()
            for statistic, value in metric.get_all_statistics().items():
                assert f"{plain[statistic]:.6f}" == f"{value:.6f}", (relation, statistic)


def test_least_squares_agree_with_evo() -> None:
    geometry = pytest.importorskip("evo.core.geometry")
    way, other = wandering(), shaken(wandering().moved((1.0, 2.0, 0.7)))
    turn, move, _ = geometry.umeyama_alignment(*(np.array([one.x_m, one.y_m]) for one in (other, way)))
    x, y, angle = least_squares_pose(way, other)
    assert (x, y) == pytest.approx(tuple(move), abs=1e-9)
    assert angle == pytest.approx(math.atan2(turn[1, 0], turn[0, 0]), abs=1e-9)


def test_a_tum_file_gives_back_what_was_written(tmp_path: Path) -> None:
    way = wandering()
    write_tum(way, tmp_path / "a.tum")
    back = read_tum(tmp_path / "a.tum")
    assert back.t_s.tolist() == way.t_s.tolist()
    assert back.x_m.tolist() == way.x_m.tolist()
    assert back.heading_rad == pytest.approx(way.heading_rad, abs=1e-12)


def test_drives_of_less_than_a_second_in_common_are_refused() -> None:
    way = wandering()
    on_common_times(way, way.later(way.t_s[-1] - 1.0))
    with pytest.raises(UsageError, match=r"0\.9 s in common"):
        on_common_times(way, way.later(way.t_s[-1] - 0.94))


@pytest.mark.parametrize(("slope", "onset_s"), [(0.3, 1.0), (0.3, 1.04), (0.3, 1.09), (-0.2, 1.06)])
def test_the_onset_of_a_ramp_is_found_between_the_samples(slope: float, onset_s: float) -> None:
    times = np.arange(0.0, 3.0, 0.1)
    speed = Steps(times, np.clip(slope * (times - onset_s), min(0, slope), max(0, slope)))
    assert onset_after(speed, 0.95, 3.0) == pytest.approx(onset_s, abs=1e-9)


def test_no_onset_is_found_before_its_command_nor_after_it_was_awaited() -> None:
    times = np.arange(0.0, 3.0, 0.1)
    speed = Steps(times, np.where(times > 1.95, 0.3, 0.0))
    assert onset_after(speed, 1.97, 3.0) == pytest.approx((1.97 + 2.0) / 2)
    assert onset_after(speed, 1.0, 1.95) is None


def drive(way: Trajectory, **words: object) -> Drive:
    return Drive(name="a drive", parameters=P2DX, truth=way, **words)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("stage", "signal"),
    [("sensor", "sensor 3"), ("firmware", "motor 1"), ("wire", "command VEL"), ("motion", "position")],
)
def test_where_two_drives_part_is_where_the_first_difference_was_planted(stage: str, signal: str) -> None:
    way = wandering()
    order = ("sensor", "firmware", "wire", "motion")

    def steps(name: str, changed: bool) -> Steps:
        at = 5.0 + 0.02 * order.index(name)
        return Steps(np.array([0.0, at]), np.array([0.0, 1.0 if changed else 0.0]))

    def of(cause: str) -> Drive:
        is_changed = [order.index(name) >= order.index(cause) if cause else False for name in order]
        bent = 0.2 * np.clip(way.t_s - 5.06, 0, None) * is_changed[3]
        return drive(
            Trajectory(way.t_s, way.x_m + bent, way.y_m, way.heading_rad), sensors={3: steps("sensor", is_changed[0])},
            motors={1: steps("firmware", is_changed[1])}, commands={"VEL": steps("wire", is_changed[2])},
        )  # fmt: skip

    one, other = of(""), of(stage)
    assert one.truth is not None
    assert other.truth is not None
    found = origin(parts(one, other, 0.0, one.truth, other.truth))
    assert found is not None
    part, begin = found
    assert part.bound.stage == stage
    if stage != "motion":
        assert (part.signal, begin) == (signal, pytest.approx(5.0 + 0.02 * order.index(stage), abs=0.011))


@pytest.mark.parametrize(("for_s", "parts_there"), [(0.24, False), (0.27, True)])
def test_a_level_that_differs_for_less_than_its_pause_is_no_parting(for_s: float, parts_there: bool) -> None:
    way = wandering()
    short = Steps(np.array([0.0, 5.0, 5.0 + for_s]), np.array([0.0, 1.0, 0.0]))
    one, other = drive(way, motors={1: Steps(np.array([0.0]), np.array([0.0]))}), drive(way, motors={1: short})
    assert (origin(parts(one, other, 0.0, way, way)) is not None) is parts_there


@pytest.mark.parametrize(("until_s", "stage"), [(4.0, "motion"), (5.3, "sensor")])
def test_what_agreed_again_long_before_the_motion_parts_is_not_its_cause(until_s: float, stage: str) -> None:
    way = wandering()
    bent = Trajectory(way.t_s, way.x_m + 0.3 * np.clip(way.t_s - 6.0, 0, None), way.y_m, way.heading_rad)
    early = Steps(np.array([0.0, 1.0, until_s]), np.array([0.0, 1.0, 0.0]))
    one = drive(way, sensors={1: Steps(np.array([0.0]), np.array([0.0]))})
    rows = parts(one, drive(bent, sensors={1: early}), 0.0, way, bent)
    found = origin(rows)
    assert found is not None
    assert found[0].bound.stage == stage
    alike = parts(one, drive(way, sensors={1: early}), 0.0, way, way)
    assert motion_parts_s(alike) is None
    assert origin(alike) == (alike[0], pytest.approx(1.0, abs=0.011))


def test_a_run_compared_with_itself_does_not_part(runs: Path) -> None:
    near = read_drive(runs / "near")
    found = compare(near, near)
    assert (found.shift_s, found.ape_m.max, found.origin) == (0.0, 0.0, None)


def test_odometry_follows_the_truth_as_late_as_a_packet_takes(runs: Path) -> None:
    near = read_drive(runs / "near")
    found = compare(near, near, How(poses=("truth", "odometry")))
    # 40 bytes of a SIP with two readings at 9600 bit/s take 41.7 ms; at 0.25 m/s a count is passed in 3.4 ms, and how
    # counts and turns fall in 16 s moves the estimate by a few of them.
    assert abs(found.shift_s + 0.0417) < 4 * 0.0034
    assert found.ape_m.max < 3 * 0.84e-3  # a count of the packet, at the beginning and now, and one of the shift


def test_two_thresholds_part_at_the_sensor_that_sees_farther(runs: Path, p2os, capsys) -> None:
    assert p2os("compare", runs / "near", runs / "far", "--picture", "c.png", "--html", "c.html", "--tum", "c") == 0
    out = capsys.readouterr().out
    assert all(len(line) <= 80 for line in out.splitlines())
    assert "it came from: sensor 4 (sensor) at 13.9" in out
    assert Path("c.png").read_bytes()[:4] == b"\x89PNG"
    page = ReadPage(Path("c.html").read_text(encoding="utf-8"))
    assert len(page.rows("near pose")) == len(page.rows("far pose")) == len(page.rows("apart")) > 2
    assert [row[3] for row in page.rows("events")] == ["parts"]
    assert "APE, m" in page.section("How far they are apart")["blocks"][0]["text"]
    assert [robot["name"] for robot in page.header["robots"]] == ["near", "far"]
    first, second = read_tum(Path("c-a.tum")), read_tum(Path("c-b.tum"))
    assert p2os("compare", runs / "near", runs / "far", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["came_from"]["stage"] == "sensor"
    again = Statistics.of(absolute_errors(first, second).translation_m).as_plain()
    assert found["ape_translation_m"]["rmse"] == pytest.approx(again["rmse"], abs=1e-12)


def test_a_run_its_recording_and_its_table_tell_of_one_drive(runs: Path, p2os, capsys) -> None:
    assert p2os("export", runs / "near", "near.csv") == 0
    capture = read_file(runs / "near")
    Path("near.pcap").write_bytes(write_pcap(capture))
    for other in (runs / "near" / "wire.jsonl", "near.csv", runs / "near" / "trace.jsonl"):
        capsys.readouterr()
        assert p2os("compare", runs / "near", other, "--poses", "odometry", "--shift", "0s", "--json") == 0
        assert json.loads(capsys.readouterr().out)["ape_translation_m"]["max"] < 1e-6
    assert p2os("compare", runs / "near", "near.pcap", "--poses", "odometry", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    # Times of a pcap count from its first record.
    assert found["shift_s"] == pytest.approx(capture.chunks[0].at_ns / 1e9, abs=1e-3)
    assert found["ape_translation_m"]["max"] < 1e-3


def test_poses_may_be_of_two_kinds(runs: Path, p2os, capsys) -> None:
    def errors(poses: str) -> tuple[float, float]:
        assert p2os("compare", runs / "near", runs / "near", "--poses", poses, "--shift", "0s", "--json") == 0
        found = json.loads(capsys.readouterr().out)
        return found["ape_translation_m"]["max"], found["ape_translation_m"]["rmse"]

    same, mixed, turned = map(errors, ("truth,truth", "truth,odometry", "odometry,truth"))
    assert same == errors("truth") == (0.0, 0.0)
    assert min(mixed) > 0.0, "odometry counts whole ticks"
    assert turned == pytest.approx(mixed, rel=0.2)


@given(st.lists(st.lists(st.sampled_from(["0", "1", "-2.5", "nan", "inf", "x", "", "1e999", "\x00", "é"]), max_size=9)))
def test_any_table_is_a_trajectory_or_told_in_one_line(rows: list[list[str]]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name, head, between in (("a.csv", "t_s,x_m,y_m,heading_rad\n", ","), ("a.tum", "", " ")):
            path = Path(folder) / name
            path.write_text(head + "\n".join(between.join(row) for row in rows), encoding="utf-8")
            try:
                way, says = read_drive(path).body, ""
            except FileError as error:
                way, says = None, str(error)
            assert name in says if way is None else np.isfinite(way.x_m).all()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["missing", "near"], "there is no missing"),
        (["bad.csv", "near"], "bad.csv:1: no column heading_rad"),
        (["worse.csv", "near"], "worse.csv:3: 'x' is no number"),
        (["bad.tum", "near"], "bad.tum:2: 3 numbers"),
        (["empty.tum", "near"], "two poses at least"),
        (["noise.bin", "near"], "no two standard packets"),
        (["near", "near", "--poses", "fact"], "--poses 'fact'"),
        (["near", "near", "--poses", "truth,truth,truth"], "or two of them with a comma"),
        (["near", "near", "--align", "best"], "--align 'best'"),
        (["near", "near", "--at", "pin PB99 high"], "no wire 'PB99'"),
        (["near", "near", "--at", "contact"], "never happens"),
        (["near/wire.jsonl", "near", "--poses", "truth"], "has no truth"),
        (["near", "near", "--delta", "900s"], "no step of"),
        (["near", "near", "--shift", "100s"], "in common"),
    ],
)
def test_what_cannot_be_compared_is_reported_in_one_line(words: list[str], says: str, runs: Path, p2os, capsys) -> None:
    Path("near").symlink_to(runs / "near")
    Path("bad.csv").write_text("t_s,x_m,y_m\n0,0,0\n", encoding="utf-8")
    Path("worse.csv").write_text("t_s,x_m,y_m,heading_rad\n0,0,0,0\n1,x,0,0\n", encoding="utf-8")
    Path("bad.tum").write_text("# t x y\n1 2 3\n", encoding="utf-8")
    Path("empty.tum").write_text("", encoding="utf-8")
    Path("noise.bin").write_bytes(bytes(range(255, 100, -1)))
    assert p2os("compare", *words) == 2
    errors = capsys.readouterr().err
    assert says in errors
    assert "Traceback" not in errors


def test_a_file_is_not_overwritten_without_a_word(runs: Path, p2os) -> None:
    Path("c-b.tum").write_text("mine", encoding="utf-8")
    assert p2os("compare", runs / "near", runs / "near", "--tum", "c") == 2
    assert Path("c-b.tum").read_text(encoding="utf-8") == "mine"
    with pytest.raises(FileError, match="two poses"):
        Trajectory(np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(1))
