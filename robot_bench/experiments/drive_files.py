"""Drives out of files: runs, recordings, pcap, bags, CSV, TUM, ARIA's logs; and trajectories into TUM files.

A CSV file has a line of names: `t_s`, `x_m`, `y_m`, `heading_rad` or `heading_deg`, and where it has them `left_mps`,
`right_mps`, `sonar_m_0` and so on: what `p2os export` writes is such a file. A TUM file has lines of
`t x y z qx qy qz qw`; its poses count as measured from outside.

Invariant: a file that is none of these is refused in one line that names it and, where it has lines, the line.
"""

import csv
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias, cast

import numpy as np

from p2os.capture import Chunk, Direction, Reading, open_file, rows_of
from p2os.capture.chunks import Block, chunks_of
from p2os.protocol.frames import CHECKSUM_BYTES, PREFIX_BYTES, Frame
from p2os.protocol.odometry import Odometry
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import StandardSip
from p2os.robots.parameters import ParametersError, RobotParameters, load_parameters
from p2os.ros.bags import is_bag
from robot_bench.events.kinds import Pose
from robot_bench.experiments.aria_logs import is_aria_log, read_aria_log
from robot_bench.experiments.bag_drives import drive_of_bag
from robot_bench.experiments.drives import Drive, Floats, Rows, Steps, Trajectory, heading_of, number_of, steps_of
from robot_bench.recording.run_record import TRACE_NAME, RunRecord, read_events, read_run
from robot_bench.recording.signals import motor_steps
from simbase.errors import FileError, shown_name
from simbase.timing import NS_PER_S

#: Commands whose argument is looked at.
MOTION_COMMANDS = ("VEL", "RVEL", "VEL2", "MOVE", "HEAD", "DHEAD", "ENABLE", "STOP", "E_STOP", "SETA", "SETRA")
#: Sensors of the pin-out.
SENSORS = 8
#: What a run at a real robot's port says of its body.
REMOTE = "remote"
DEFAULT_ROBOT = "p2dx"
#: One that comes later than this after the last follows one that was lost, seconds: the CONFIGpac has a byte for it.
LONGEST_CYCLE_S = 0.255
_TUM_COLUMNS = 8
#: Longer is no number.
_LONGEST_FIELD = 64


@dataclass(slots=True, kw_only=True)
class _Told(Rows):
    """What the packets of a line tell, row by row."""

    parameters: RobotParameters
    sonar: dict[int, list[tuple[float, float]]] = field(default_factory=dict)

    def take(self, chunks: Iterable[Chunk], profile: Profile) -> None:
        """Take all packets; a packet that is no sound SIP inside is passed over."""
        parameters = self.parameters
        odometry, metres_per_count = Odometry(parameters), parameters.range_nm_per_count / 1e9
        first: tuple[int, int, int] | None = None
        before = 0.0
        for row in rows_of(chunks, Reading(profile=profile, parameters=parameters)):
            at = row.at_ns / NS_PER_S
            if row.direction is Direction.TO_ROBOT:
                argument = row.fields.get("argument") if row.name in MOTION_COMMANDS else None
                if isinstance(argument, int):
                    self.commands.setdefault(row.name, []).append((at, float(argument)))
                continue
            if not row.is_sip:
                continue
            sip = StandardSip.from_frame(Frame(row.data[PREFIX_BYTES:-CHECKSUM_BYTES]), profile)
            odometry.update(sip, row.at_ns)
            first = first or (sip.raw_x, sip.raw_y, sip.raw_heading)
            self.poses.append((at, odometry.x_m, odometry.y_m, odometry.heading_rad))
            conv = parameters.velocity_conv / 1000
            self.left.append((at, sip.raw_left_velocity * conv))
            self.right.append((at, sip.raw_right_velocity * conv))
            each_s = spread_s(len(sip.sonar), parameters.sonar_fitted, at - before)
            before = at
            for place, reading in enumerate(sip.sonar, 1 - len(sip.sonar)):
                metres = min(reading.raw_range * metres_per_count, parameters.sonar_range_m)
                self.sonar.setdefault(reading.number, []).append((at + place * each_s, metres))
        if first is not None:
            self._begin_at(first)

    def _begin_at(self, first: tuple[int, int, int]) -> None:
        """Have the odometry begin where the first packet says; its counters there are 15 bits with a sign."""
        parameters, half = self.parameters, 1 << 14
        x, y = (((raw + half) % (2 * half) - half) * parameters.distance_nm_per_count / 1e9 for raw in first[:2])
        turn = first[2] * parameters.angle_conv_rad
        self.poses = [(t, x + a, y + b, turn + h) for t, a, b, h in self.poses]

    def into(self, drive: Drive) -> Drive:
        """Put it into a drive."""
        drive.odometry = Trajectory.of_rows(self.poses) if len({row[0] for row in self.poses}) > 1 else None
        drive.told_left_mps, drive.told_right_mps = steps_of(self.left), steps_of(self.right)
        drive.commands = {name: steps_of(pairs) for name, pairs in self.commands.items()}
        drive.sonar_m = {number: steps_of(pairs) for number, pairs in self.sonar.items()}
        return drive


def spread_s(readings: int, fitted: int, since_s: float) -> float:
    """Return how far apart the readings of a packet were taken, seconds: they fire in turn between two packets.

    Args:
        readings: How many the packet has; all at once where it has one of every sonar.
        fitted: How many sonar there are.
        since_s: Since the packet before.
    """
    return min(since_s, LONGEST_CYCLE_S) / readings if 1 < readings < fitted else 0.0


#: Says how to read a capture, whose chunks it looks into.
HowToRead: TypeAlias = Callable[[Iterable[Block]], tuple[Reading, Iterator[Block]]]


def read_drive(path: Path, *, robot: str = "", how: HowToRead | None = None) -> Drive:
    """Read a drive of whatever kind a file or folder is.

    Args:
        path: A run folder, a trace, a recording, a pcap, a bag, `.csv`, `.tum`, or a log of ARIA's.
        robot: Model or file for units; empty: by the run, else p2dx.
        how: How to read a capture; None: as one of a P2OS robot.

    Raises:
        FileError: It is missing, broken, or tells of no poses.
    """
    if not path.exists():
        raise FileError(f"there is no {shown_name(path)}", hint="a run folder, a recording, pcap, bag, .csv or .tum")
    if is_bag(path):
        return drive_of_bag(path, _parameters(robot))
    if path.is_dir() or path.name == TRACE_NAME:
        return _of_run(path if path.is_dir() else path.parent, robot)
    try:
        if _is_aria_log(path):
            with path.open(encoding="utf-8", errors="replace") as lines:
                return read_aria_log(path.name, lines, _parameters(robot))
        if path.suffix.lower() == ".csv":
            return _of_csv(path, robot)
        if path.suffix.lower() == ".tum":
            return Drive(name=path.name, parameters=_parameters(robot), truth=read_tum(path))
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"cannot read {shown_name(path)}: {getattr(error, 'strerror', None) or 'no text'}") from error
    blocks = open_file(path).blocks
    reading, blocks = how(blocks) if how else (Reading(profile=Profile.P2OS, parameters=_parameters(robot)), blocks)
    return drive_of_capture(path.name, chunks_of(blocks), reading.parameters, reading.profile)


def _is_aria_log(path: Path) -> bool:
    with path.open("rb") as file:
        return is_aria_log(file.readline(_LONGEST_FIELD).decode("utf-8", "replace"))


def drive_of_capture(
    name: str, chunks: Iterable[Chunk], parameters: RobotParameters, profile: Profile = Profile.P2OS
) -> Drive:
    """Return what a recorded conversation tells of a drive.

    Args:
        name: What it is called.
        chunks: What was said.
        parameters: The robot's units.
        profile: Its firmware family.

    Raises:
        FileError: It has no two standard packets.
    """
    told = _Told(parameters=parameters)
    told.take(chunks, profile)
    drive = told.into(Drive(name=name, parameters=parameters))
    if drive.odometry is None:
        raise FileError(f"{shown_name(name)} holds no two standard packets of a robot", hint="p2os decode FILE")
    drive.left_mps, drive.right_mps = drive.told_left_mps, drive.told_right_mps
    return drive


def _parameters(robot: str) -> RobotParameters:
    return load_parameters(robot or DEFAULT_ROBOT)


def _of_run(folder: Path, robot: str) -> Drive:
    record = read_run(folder)
    name = str(cast("dict[str, object]", record.meta.get("robot") or {}).get("name") or "")
    try:
        parameters = load_parameters(robot or name or DEFAULT_ROBOT)
    except ParametersError:
        if robot:
            raise
        parameters = load_parameters(DEFAULT_ROBOT)  # a robot on own pins sends no packets
    told = _Told(parameters=parameters)
    told.take(_chunks_of(record), Profile.P2OS)
    drive = told.into(Drive(name=folder.name, parameters=parameters, meta=record.meta))
    drive.events = list(read_events(folder))
    drive.left_mps, drive.right_mps = drive.told_left_mps, drive.told_right_mps
    if record.meta.get("body") != REMOTE and len(record.poses) > 1:
        drive.truth = trajectory_of(record.poses)
        times = np.array([pose.t / NS_PER_S for pose in record.poses])
        drive.left_mps = Steps(times, np.array([pose.left / 1e6 for pose in record.poses]))
        drive.right_mps = Steps(times, np.array([pose.right / 1e6 for pose in record.poses]))
        drive.has_true_wheels = True
    if not drive.sonar_m:
        drive.sonar_m = _sonar_of(record)
    drive.motors = {
        motor: steps_of([(t / NS_PER_S, float(value)) for t, value in motor_steps(record.pins, motor)])
        for motor in (1, 2) if f"motor{motor}_comm1" in record.pins
    }  # fmt: skip
    drive.sensors = {
        number: steps_of([(t / NS_PER_S, float(level)) for t, level in record.pins[f"DD{number}"]])
        for number in range(1, SENSORS + 1) if f"DD{number}" in record.pins
    }  # fmt: skip
    _ = drive.body
    return drive


def trajectory_of(poses: Iterable[Pose]) -> Trajectory:
    """Return the poses of a trace as a trajectory."""
    return Trajectory.of_rows([(pose.t / NS_PER_S, pose.x_m, pose.y_m, pose.heading_rad) for pose in poses])


def _chunks_of(record: RunRecord) -> Iterator[Chunk]:
    for packet in record.wire:
        yield Chunk(at_ns=packet.t, direction=Direction(packet.direction), data=packet.data)


def _sonar_of(record: RunRecord) -> dict[int, Steps]:
    """Return the ranges of a run without packets, from its events."""
    count = len(record.sonar[0][1]) if record.sonar else 0
    return {n: steps_of([(t / NS_PER_S, mm[n] / 1000) for t, mm in record.sonar]) for n in range(count)}


def _of_csv(path: Path, robot: str) -> Drive:
    with path.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        names = next(reader, [])
        heading = next((name for name in ("heading_rad", "heading_deg") if name in names), "")
        for name in ("t_s", "x_m", "y_m", heading):
            if name not in names:
                raise FileError(
                    f"{shown_name(path)}:1: no column {name or 'heading_rad'}",
                    hint="columns: t_s, x_m, y_m, heading_rad or heading_deg",
                )
        columns = {name: names.index(name) for name in names}
        rows = [(reader.line_num, row) for row in reader if row]

    def column(name: str) -> list[tuple[float, float]]:
        return [
            (_number(path, line, row, columns["t_s"]), _number(path, line, row, columns[name]))
            for line, row in rows
            if columns[name] < len(row) and row[columns[name]] != ""
        ]

    scale = math.pi / 180 if heading == "heading_deg" else 1.0
    parts = [dict(column(name)) for name in ("x_m", "y_m", heading)]
    times = sorted(parts[0].keys() & parts[1].keys() & parts[2].keys())
    poses = [(t, parts[0][t], parts[1][t], parts[2][t] * scale) for t in times]
    sonar = {int(name.removeprefix("sonar_m_")): name for name in names if name.removeprefix("sonar_m_").isdecimal()}
    try:
        trajectory = Trajectory.of_rows(poses)
    except FileError as error:
        raise FileError(f"{shown_name(path)}: {error}", hint=error.hint) from error
    # What a robot's own packets were exported to has their names; other poses were measured.
    is_told = "dir" in names and "type" in names
    drive = Drive(
        name=path.name, parameters=_parameters(robot), odometry=trajectory if is_told else None,
        truth=None if is_told else trajectory, has_true_wheels=not is_told,
        sonar_m={number: steps_of(column(name)) for number, name in sonar.items()},
    )  # fmt: skip
    if "left_mps" in names and "right_mps" in names:
        drive.left_mps, drive.right_mps = steps_of(column("left_mps")), steps_of(column("right_mps"))
        if is_told:
            drive.told_left_mps, drive.told_right_mps = drive.left_mps, drive.right_mps
    return drive


def _number(path: Path, line: int, row: list[str], place: int) -> float:
    return number_of(row[place][:_LONGEST_FIELD], path, line)


def read_tum(path: Path) -> Trajectory:
    """Read a TUM file.

    Raises:
        FileError: A line has not eight numbers, or there are fewer than two lines.
    """
    rows = []
    with path.open(encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            words = line.split()
            if not words or words[0].startswith("#"):
                continue
            if len(words) != _TUM_COLUMNS:
                raise FileError(f"{shown_name(path)}:{number}: {len(words)} numbers, expected t x y z qx qy qz qw")
            t, x, y, _, qx, qy, qz, qw = (_number(path, number, words, place) for place in range(_TUM_COLUMNS))
            rows.append((t, x, y, heading_of(qx, qy, qz, qw)))
    try:
        return Trajectory.of_rows(rows)
    except FileError as error:
        raise FileError(f"{shown_name(path)}: {error}") from error


def write_tum(trajectory: Trajectory, path: Path) -> None:
    """Write a trajectory as a TUM file, every digit that a double has.

    Raises:
        FileError: It cannot be written.
    """
    columns: list[Floats] = [trajectory.t_s, trajectory.x_m, trajectory.y_m, trajectory.heading_rad / 2]
    try:
        with path.open("w", encoding="utf-8", newline="\n") as file:
            for t, x, y, half in zip(*(column.tolist() for column in columns), strict=True):
                file.write(f"{t!r} {x!r} {y!r} 0 0 0 {math.sin(half)!r} {math.cos(half)!r}\n")
    except OSError as error:
        raise FileError(f"cannot write {shown_name(path)}: {error.strerror or error}") from error
