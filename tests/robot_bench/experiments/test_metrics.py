"""Figures of one drive, and the steps of the loop's latency, against values derived by hand."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.protocol.frames import Frame
from p2os.protocol.line_time import LineTime
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.parameters import load_parameters
from robot_bench.drives.drive import Drive, Steps, Trajectory, steps_of
from robot_bench.drives.latency_budget import STEPS, WHOLE, latency_budget
from robot_bench.drives.metrics import metrics
from robot_bench.drives.of_packets import spread_s
from robot_bench.drives.of_run import drive_of_record, steps_of_edges, trajectory_of
from robot_bench.events.kinds import Clearance, Contact, Packet, Pose, Verdict
from robot_bench.experiments.drive_files import read_drive
from robot_bench.recording.run_record import RunRecord, read_run
from robot_bench.report.measures import BARS
from robot_bench.report.run_page import render_run
from robot_bench.wires.edges import Edges
from tests.p2os.view.pages import ReadPage

P2DX = load_parameters("p2dx")


def drive(way: Trajectory, **words: object) -> Drive:
    return Drive(name="a drive", parameters=P2DX, truth=way, **words)  # type: ignore[arg-type]


def line(speed, seconds: float = 4.0) -> Trajectory:
    """Return a way along x whose speed at t is `speed(t)`, sampled each 50 ms exactly."""
    t = np.arange(0.0, seconds + 1e-9, 0.05)
    fine = np.arange(0.0, seconds + 1e-9, 0.0005)
    x = np.concatenate(([0.0], np.cumsum([speed(at) for at in (fine[1:] + fine[:-1]) / 2]) * 0.0005))
    return Trajectory(t, np.interp(t, fine, x), np.zeros_like(t), np.zeros_like(t))


def test_the_mean_square_jerk_of_a_sine_is_half_the_square_of_its_second_derivative() -> None:
    rate = math.pi
    found = metrics(drive(line(lambda at: 0.2 + 0.1 * math.sin(rate * at), 8.0)))
    assert found.mean_square_jerk_m2_s6 == pytest.approx((0.1 * rate**2) ** 2 / 2, rel=0.03)


def test_the_dimensionless_jerk_depends_neither_on_speed_nor_on_span() -> None:
    once = metrics(drive(line(lambda at: 0.2 * math.sin(math.pi * at / 4) ** 2, 4.0)))
    faster = metrics(drive(line(lambda at: 0.6 * math.sin(math.pi * at / 4) ** 2, 4.0)))
    longer = metrics(drive(line(lambda at: 0.2 * math.sin(math.pi * at / 8) ** 2, 8.0)))
    assert once.log_dimensionless_jerk == pytest.approx(faster.log_dimensionless_jerk, abs=1e-6)
    assert once.log_dimensionless_jerk == pytest.approx(longer.log_dimensionless_jerk, abs=0.05)


def test_three_speeds_have_a_jerk_and_two_have_none() -> None:
    for count in (3, 4):  # places, one more than speeds
        x = np.array([0.0, 1.0, 3.0, 7.0])[:count]
        found = metrics(drive(Trajectory(0.1 * np.arange(count), x, np.zeros(count), np.zeros(count))))
        assert (found.mean_square_jerk_m2_s6 is None) == (count < 4)


def test_a_robot_that_stands_half_of_the_time_is_said_to() -> None:
    found = metrics(drive(line(lambda at: 0.3 if at < 2 else 0.0)))
    assert found.standing_share == pytest.approx(0.5, abs=0.02)
    assert found.path_m == pytest.approx(0.6, abs=1e-3)
    assert found.mean_mps == pytest.approx(0.15, abs=1e-3)
    assert found.max_mps == pytest.approx(0.3)


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 255)), max_size=12))
def test_the_steps_of_a_wire_are_its_levels_the_last_of_each_time(rows: list[tuple[int, int]]) -> None:
    edges = sorted(rows, key=lambda row: row[0])
    expected = steps_of([(at / 1e9, float(level)) for at, level in edges])
    found = steps_of_edges(Edges(edges))
    assert (found.t_s.tolist(), found.values.tolist()) == (expected.t_s.tolist(), expected.values.tolist())


def pose(t_ms: int, x_mm: int, work: int | None) -> Pose:
    return Pose(t=t_ms * 1_000_000, x=x_mm * 1000, y=0, z=0, heading=0, pitch=0, left=0, right=0, left_angle=0,
                right_angle=0, collisions=0, work=work)  # fmt: skip


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("last_ms", "most"), [(500, 0.4), (1000, 0.6)])
def test_two_poses_at_the_last_time_of_a_run_are_one_sample_of_its_rims(last_ms: int, most: float) -> None:
    rows = ((0, 0), (500, 200_000), (last_ms, 500_000 if last_ms > 500 else 200_000))
    record = RunRecord(poses=[replace(pose(at, 0, None), left=left) for at, left in rows])
    assert metrics(drive_of_record("a run", record)).max_rim_mps2 == pytest.approx(most)


def test_ranges_of_a_run_without_packets_are_in_seconds_and_metres() -> None:
    record = RunRecord(
        poses=[pose(0, 0, None), pose(3000, 0, None)],
        sonar=[(1_000_000_000, [500, 5000]), (2_500_000_000, [250, 4000])],
    )
    sonar = drive_of_record("a run", record).sonar_m
    assert {n: (steps.t_s.tolist(), steps.values.tolist()) for n, steps in sonar.items()} == {
        0: ([1.0, 2.5], [0.5, 0.25]), 1: ([1.0, 2.5], [5.0, 4.0]),
    }  # fmt: skip


@pytest.mark.parametrize(("work", "energy"), [(None, None), (3_000_000, 3.0)])
def test_what_events_tell_is_taken_and_what_they_do_not_tell_is_none(work: int | None, energy: float | None) -> None:
    poses = [pose(0, 0, 0), pose(1000, 500, work)]
    events = [
        *poses, Clearance(t=1, um=400_000), Clearance(t=2, um=250_000), Contact(t=3, what="a", x_m=0, y_m=0),
        Verdict(t=500_000_000, goal="reach", met=True, says=""),
    ]  # fmt: skip
    found = metrics(drive(trajectory_of(poses), events=events))
    assert (found.clearance_m, found.contacts, found.energy_j) == (0.25, 1, energy)
    assert found.energy_j_per_m == (None if energy is None else 6.0)
    assert found.time_to_goal_s == 0.5
    missed = metrics(drive(trajectory_of(poses), events=[*events, Verdict(t=9, goal="b", met=False, says="")]))
    assert missed.time_to_goal_s is None
    cut = metrics(replace(drive(trajectory_of(poses), events=events), open_goals=["touches nothing: not judged"]))
    assert (cut.time_to_goal_s, cut.goals[-1]) == (None, ("touches nothing: not judged", None, None))
    bare = metrics(drive(trajectory_of(poses)))
    assert (bare.clearance_m, bare.contacts, bare.energy_j, bare.time_to_goal_s) == (None, None, None, None)


@pytest.mark.parametrize(
    ("readings", "since_s", "spread"),
    [(2, 0.1, 0.05), (1, 0.1, 0.0), (8, 0.1, 0.0), (2, 30.0, 0.1275), (4, 0.1, 0.025)],
)
def test_readings_of_a_packet_fire_in_turn_unless_it_has_all(readings: int, since_s: float, spread: float) -> None:
    assert spread_s(readings, 8, since_s) == pytest.approx(spread)


def packet(at_s: float, *numbers: int) -> Packet:
    sip = StandardSip(sonar=tuple(SonarReading(number, 1000) for number in numbers))
    return Packet(t=round(at_s * 1e9), direction="r2c", data=sip.to_frame(Profile.P2OS).to_bytes())


def loop(sensor_s: float = 1.3, motor_s: float = 1.45, command_s: float = 1.47, rate: float = 0.3) -> Drive:
    """Return a drive with one chain through the loop: packets at 1.2 s and 1.3 s, the rest as given."""
    times = np.arange(0.0, 3.0, 0.05)
    speed = np.clip(rate * (times - command_s - 0.002), 0, 0.2)
    return drive(
        line(lambda _at: 0.1, 3.0), events=[packet(1.2, 2, 3), packet(1.3, 4, 5)],
        sensors={5: Steps(np.array([0.0, sensor_s]), np.array([0.0, 1.0]))},
        motors={1: steps_of([(0.0, 0.0), (motor_s, 1.0), (motor_s + 1e-6, 3.0)])},
        commands={"VEL": steps_of([(0.5, 0.0), (command_s, 200.0)])},
        left_mps=Steps(times, speed), right_mps=Steps(times, speed),
    )  # fmt: skip


def test_the_steps_of_a_chain_are_those_planted_and_add_up_to_the_whole() -> None:
    budget = latency_budget(loop())
    # Sonar 4 is the first of two readings: half a cycle before the packet was made, and its bytes on the line.
    line_s = LineTime(9600).time_of(len(packet(1.3, 4, 5).data)) / 1e9
    expected = [0.05 + line_s, 0.0, 0.15, 0.02, 0.002]
    for name, seconds in zip(STEPS, expected, strict=True):
        assert budget.steps[name] == [pytest.approx(seconds, abs=1e-6)], name
    assert budget.steps[WHOLE] == [pytest.approx(sum(expected), abs=1e-6)]


@pytest.mark.parametrize(
    ("words", "step", "is_there"),
    [
        ({"motor_s": 1.3 + 0.5}, "pin to motor", True),
        ({"motor_s": 1.3 + 0.501}, "pin to motor", False),
        ({"motor_s": 1.29}, "pin to motor", False),
        ({"sensor_s": 1.3 + 0.5, "motor_s": 1.9}, "packet to pin", True),
        ({"sensor_s": 1.3 + 0.501, "motor_s": 1.9}, "packet to pin", False),
        ({"command_s": 1.45 + 0.499}, "motor to command", True),
        ({"command_s": 1.45 + 0.5}, "motor to command", False),
        ({"command_s": 1.449}, "motor to command", False),
    ],
)
def test_what_comes_too_late_or_before_answers_something_else(words, step: str, is_there: bool) -> None:
    assert bool(latency_budget(loop(**words)).steps[step]) is is_there


def test_a_damaged_packet_brings_no_reading() -> None:
    broken = loop()
    assert broken.events
    data = bytearray(broken.events[1].data)  # type: ignore[union-attr]
    for place in range(len(data)):
        data[place] ^= 0x55
        broken.events[1] = Packet(t=1_300_000_000, direction="r2c", data=bytes(data))
        assert latency_budget(broken).steps["ping to packet"] == []
        data[place] ^= 0x55
    broken.events[1] = Packet(t=1_300_000_000, direction="r2c", data=Frame(b"\x20abc").to_bytes())
    assert latency_budget(broken).steps["ping to packet"] == []


def test_a_run_has_every_step_and_none_is_negative(runs: Path, p2os, capsys) -> None:
    budget = latency_budget(read_drive(runs / "near"))
    assert all(budget.steps[name] and min(budget.steps[name]) >= 0 for name in STEPS)
    assert p2os("metrics", runs / "near", "--picture", "l.png") == 0
    out = capsys.readouterr().out
    assert all(len(text) <= 80 for text in out.splitlines())
    assert "least clearance" in out
    assert Path("l.png").read_bytes()[:4] == b"\x89PNG"
    assert p2os("metrics", runs / "near", runs / "near" / "wire.jsonl", "--json") == 0
    run, capture = (json.loads(text) for text in capsys.readouterr().out.splitlines())
    assert run["clearance_m"] > 0
    assert (capture["clearance_m"], capture["energy_j"], capture["contacts"]) == (None, None, None)
    assert capture["path_m"] == pytest.approx(run["path_m"], rel=0.01)


@pytest.mark.parametrize(
    ("words", "says"),
    [(["missing"], "there is no missing"), (["a.csv", "--picture", "x.png"], "shows no latencies"),
     (["a.csv", "a.csv", "--picture", "x.png"], "of one run")],
)  # fmt: skip
def test_what_cannot_be_measured_is_reported_in_one_line(words: list[str], says: str, p2os, capsys) -> None:
    Path("a.csv").write_text("t_s,x_m,y_m,heading_deg\n0,0,0,0\n1,0.1,0,0\n2,0.2,0,0\n", encoding="utf-8")
    assert p2os("metrics", *words) == 2
    errors = capsys.readouterr().err
    assert says in errors
    assert "Traceback" not in errors


def test_the_page_of_a_run_has_the_figures_and_the_distributions_of_its_latencies(runs: Path) -> None:
    found = metrics(read_drive(runs / "near"))
    page = ReadPage(render_run(read_run(runs / "near")))
    drive = dict(page.table("Drive"))
    assert (drive["way"], drive["work at the rims"]) == (f"{found.path_m:.2f} m", f"{found.energy_j:.1f} J")
    table, *plots = page.section("Latency of the loop by part")["blocks"]
    assert [row[0]["text"] for row in table["rows"]] == [plot["title"] for plot in plots] == [*STEPS, WHOLE]
    for name, row, plot in zip((*STEPS, WHOLE), table["rows"], plots, strict=True):
        times = 1000 * found.latency.of(name)
        assert [cell["text"] for cell in row[1:3]] == [str(len(times)), f"{np.median(times):.2f}"]
        (bars,) = plot["curves"]
        assert (bars["style"], plot["x_unit"], plot["marks"]) == ("bars", "ms", pytest.approx([np.median(times)]))
        scale_ms = bars["x"][0] * 2 * BARS
        assert scale_ms % 50 == pytest.approx(0.0)
        assert bars["y"] == np.histogram(np.minimum(times, scale_ms - 0.001), BARS, (0, scale_ms))[0].tolist()


def test_a_run_that_was_cut_before_it_had_two_poses_has_a_page_without_figures(runs: Path) -> None:
    record = read_run(runs / "near")
    record.poses = record.poses[:1]
    record.wire = []
    page = ReadPage(render_run(record))
    assert "Latency of the loop by part" not in {section["title"] for section in page.header["sections"]}
    assert page.rows("events")
