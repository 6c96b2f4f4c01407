"""What a run's record tells of its drive, and the figures of it: answers, latencies, smoothness, as they are kept."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from robot_bench.drives.drive import Drive, Steps, Trajectory
from robot_bench.drives.latency_budget import latency_budget
from robot_bench.drives.metrics import metrics
from robot_bench.drives.of_packets import spread_s
from robot_bench.drives.of_run import drive_of_record
from robot_bench.drives.onsets import answers
from robot_bench.events.kinds import Clearance, Contact, Verdict
from tests.robot_bench.experiments.validation.test_validation_findings import WANTED, MadeRun, nominal_of
from tests.robot_bench.recording.kept_lines import is_as_kept
from tests.robot_bench.recording.records import S

SEEN = [("DD1", 1.9, 2.2), ("DD3", 2.85, 2.95), ("DD4", 5.1, 5.9), ("DD4", 7.6, 7.7)]
READINGS = [(1.75, 0, 400), (1.75, 1, 900), (2.75, 2, 300), (5.0, 3, 350), (5.0, 4, 351), (7.2, 3, 300), (7.55, 3, 1)]


def numbers(values: object) -> str:
    if isinstance(values, float):
        return f"{round(values, 9) + 0.0:.6g}"
    if isinstance(values, dict):
        return ", ".join(f"{key} {numbers(value)}" for key, value in values.items())
    if isinstance(values, list | tuple):
        return f"[{' '.join(map(numbers, values))}]"
    return str(values)


def lines_of(drive: Drive) -> Iterator[str]:
    yield from (f"{name}: {numbers(value)}" for name, value in metrics(drive).as_plain().items())
    yield from (f"  {name} {numbers(found.tolist())}" for name in latency_budget(drive).steps
                if len(found := latency_budget(drive).of(name)))  # fmt: skip
    for reported in (False, True):
        rows = [(one.command_s, one.onset_s, one.latency_s) for one in answers(drive, reported=reported)]
        yield f"  answers {numbers(rows)}"
    for name, steps in (("motors", drive.motors), ("sensors", drive.sensors), ("sonar", drive.sonar_m)):
        rows = {key: [one.t_s.tolist()[:4], one.values.tolist()[:4]] for key, one in steps.items() if len(one.t_s) > 1}
        yield f"  {name} {numbers(rows)}"
    for way in (drive.truth, drive.odometry):
        yield (
            "  no way"
            if way is None
            else f"  {len(way)} {numbers([way.path_m, *way.at(np.array([4.0, 8.0])).x_m.tolist()])}"
        )


def test_what_a_run_tells_of_its_drive() -> None:
    nominal, _ = nominal_of("adapter")
    record = MadeRun(nominal=nominal, legs=WANTED, seen=SEEN, readings=READINGS).record()
    record.clearances = [Clearance(t=S, um=900_000), Clearance(t=2 * S, um=250_000)]
    record.contacts = [Contact(t=3 * S, what="'box'", x_m=1.0, y_m=0.0)]
    record.verdicts = [Verdict(t=4 * S, goal="a", met=True, says=""), Verdict(t=5 * S, goal="b", met=True, says="")]
    record.poses = [replace(pose, work=pose.t // 1000) for pose in record.poses]
    remote = replace(record, meta={"body": "remote", "robot": {"name": "p2dx"}}, is_cut=True, contacts=[])
    bare = replace(record, wire=[], sonar=[(S, [500, 600]), (2 * S, [400, 700])], end={"goals_not_judged": ["c"]},
                   verdicts=[], clearances=[])  # fmt: skip
    lines = []
    for name, one in (("a run", record), ("at a port", remote), ("without packets", bare)):
        lines += [name, *lines_of(drive_of_record(name, one))]
    assert is_as_kept(lines, "drives_of_runs")


def test_a_short_drive_and_how_pings_lie_before_their_packet() -> None:
    way = Trajectory(np.array([0.0, 1.0]), np.array([0.0, 1.0]), np.zeros(2), np.zeros(2))
    drive = Drive(name="short", parameters=nominal_of("adapter")[0]._robot, odometry=way,
                  left_mps=Steps(np.array([0.0, 0.5, 0.6]), np.array([0.0, 1.0, 0.9])))  # fmt: skip
    found = metrics(drive)
    assert (found.mean_square_jerk_m2_s6, found.log_dimensionless_jerk, found.max_rim_mps2) == (None, None, 2.0)
    assert (found.contacts, found.energy_j, found.clearance_m, found.time_to_goal_s) == (None, None, None, None)
    rows = [(readings, fitted, since) for readings in (0, 1, 2, 8) for fitted in (8, 16) for since in (0.05, 0.1, 9.0)]
    assert is_as_kept([f"{row} {spread_s(*row):.6g}" for row in rows], "drives_pings")
