"""A drive out of a run's record: the truth, the packets, the pins."""

from collections.abc import Iterable, Iterator
from typing import cast

import numpy as np

from p2os.capture import Chunk, Direction
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import ParametersError, load_parameters
from robot_bench.drives.drive import Drive, Steps, Trajectory, steps_of
from robot_bench.drives.of_packets import Reported
from robot_bench.events.kinds import Pose
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.signals import motor_steps
from robot_bench.wires.edges import Edges
from simbase.timing import NS_PER_S

#: Sensors of the pin-out.
SENSORS = 8
#: What a run at a real robot's port says of its body.
REMOTE = "remote"
DEFAULT_ROBOT = "p2dx"


def drive_of_record(called: str, record: RunRecord, robot: str = "") -> Drive:
    """Return what a run's record tells of its drive; `events` are those that figures are made of.

    Args:
        called: What it is called.
        record: The run.
        robot: Model or file for units; empty: the run's own.

    Raises:
        FileError: It has no poses.
    """
    name = str(cast("dict[str, object]", record.meta.get("robot") or {}).get("name") or "")
    try:
        parameters = load_parameters(robot or name or DEFAULT_ROBOT)
    except ParametersError:
        if robot:
            raise
        parameters = load_parameters(DEFAULT_ROBOT)  # a robot on own pins sends no packets
    reported = Reported(parameters=parameters)
    reported.take(_chunks_of(record), Profile.P2OS)
    drive = reported.into(Drive(name=called, parameters=parameters, meta=record.meta))
    drive.events = [*record.wire, *record.poses, *record.clearances, *record.contacts, *record.verdicts]
    drive.open_goals = (
        ["what was not decided when the run was cut"] if record.is_cut
        else cast("list[str]", record.end.get("goals_not_judged") or [])
    )  # fmt: skip
    drive.left_mps, drive.right_mps = drive.reported_left_mps, drive.reported_right_mps
    if record.meta.get("body") != REMOTE and len(record.poses) > 1:
        drive.truth = trajectory_of(record.poses)
        drive.left_mps = steps_of([(pose.t / NS_PER_S, pose.left / 1e6) for pose in record.poses])
        drive.right_mps = steps_of([(pose.t / NS_PER_S, pose.right / 1e6) for pose in record.poses])
    if not drive.sonar_m:
        drive.sonar_m = _sonar_of(record)
    drive.motors = {
        motor: steps_of([(t / NS_PER_S, float(value)) for t, value in motor_steps(record.pins, motor)])
        for motor in (1, 2) if f"motor{motor}_comm1" in record.pins
    }  # fmt: skip
    drive.sensors = {
        number: steps_of_edges(record.pins[f"DD{number}"])
        for number in range(1, SENSORS + 1) if f"DD{number}" in record.pins
    }  # fmt: skip
    _ = drive.body
    return drive


def trajectory_of(poses: Iterable[Pose]) -> Trajectory:
    """Return the poses of a trace as a trajectory."""
    return Trajectory.of_rows([(pose.t / NS_PER_S, pose.x_m, pose.y_m, pose.heading_rad) for pose in poses])


def steps_of_edges(edges: Edges) -> Steps:
    """Return the levels of a wire as steps; of several at one time the last counts."""
    times = np.array(edges.times, dtype=np.int64)
    is_last = np.append(times[1:] != times[:-1], np.ones(len(times[:1]), dtype=np.bool_))
    levels = np.frombuffer(bytes(edges.levels), dtype=np.uint8)
    return Steps(times[is_last] / NS_PER_S, levels[is_last].astype(np.float64))


def _chunks_of(record: RunRecord) -> Iterator[Chunk]:
    for packet in record.wire:
        yield Chunk(at_ns=packet.t, direction=Direction(packet.direction), data=packet.data)


def _sonar_of(record: RunRecord) -> dict[int, Steps]:
    """Return the ranges of a run without packets, from its events."""
    count = len(record.sonar[0][1]) if record.sonar else 0
    return {n: steps_of([(t / NS_PER_S, mm[n] / 1000) for t, mm in record.sonar]) for n in range(count)}
