"""Drives out of files: runs, recordings, pcap, bags, CSV, TUM, ARIA's logs; and trajectories into TUM files.

A CSV file has a line of names: `t_s`, `x_m`, `y_m`, `heading_rad` or `heading_deg`, and where it has them `left_mps`,
`right_mps`, `sonar_m_0` and so on: what `p2os export` writes is such a file. A TUM file has lines of
`t x y z qx qy qz qw`; its poses count as measured from outside.

Invariant: a file that is none of these is refused in one line that names it and, where it has lines, the line.
"""

import csv
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Protocol, TypeAlias, cast

from p2os.capture import Reading, open_file
from p2os.capture.chunks import ChunkBlock, chunks_of
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import RobotParameters, load_parameters
from robot_bench.drives.drive import Drive, Floats, Trajectory, heading_of, number_of, steps_of
from robot_bench.drives.of_packets import drive_of_capture
from robot_bench.drives.of_run import DEFAULT_ROBOT, drive_of_record
from robot_bench.experiments.aria_logs import is_aria_log, read_aria_log
from robot_bench.recording.run_folder import TRACE_NAME
from robot_bench.recording.run_record import read_events, read_run
from simbase.entry_points import installed_points
from simbase.errors import FileError, shown_name
from simbase.files import lines_of, reading, writing
from simbase.installation import way_to_plug_in
from simbase.user_classes import loaded

_TUM_COLUMNS = 8
#: chosen: of a table all rows are held; half a day at 100 Hz.
LARGEST_TABLE_BYTES = 512 << 20
#: Longer is no number.
_LONGEST_FIELD = 64


#: Entry points that read drives of further kinds of recordings.
READERS = "robot_bench.drive_readers"


class DriveReader(Protocol):
    """What an entry point of `READERS` is: a module with these functions."""

    def knows(self, path: Path) -> bool:
        """Tell whether a path looks like what it reads."""
        ...

    def read(self, path: Path, parameters: RobotParameters) -> Drive:
        """Return what a recording tells of a drive.

        Raises:
            MissingDependencyError: What it needs is not installed.
            FileError: It is damaged, or tells of no poses.
        """
        ...


#: Says how to read a capture, whose chunks it looks into.
HowToRead: TypeAlias = Callable[[Iterable[ChunkBlock]], tuple[Reading, Iterator[ChunkBlock]]]


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
    if (reader := _reader_of(path)) is not None:
        return reader.read(path, _parameters(robot))
    if path.is_dir() and not (path / TRACE_NAME).exists() and (way := way_to_plug_in(READERS)):
        raise FileError(f"{shown_name(path)} holds no {TRACE_NAME}", hint=way)
    if path.is_dir() or path.name == TRACE_NAME:
        return _of_run(path if path.is_dir() else path.parent, robot)
    if path.is_file() and _is_aria_log(path):  # of a pipe what was looked into would be gone
        return read_aria_log(path.name, lines_of(path, most=LARGEST_TABLE_BYTES), _parameters(robot))
    if path.suffix.lower() == ".csv":
        return _of_csv(path, robot)
    if path.suffix.lower() == ".tum":
        return Drive(name=path.name, parameters=_parameters(robot), truth=read_tum(path))
    blocks = open_file(path).blocks
    reading, blocks = how(blocks) if how else (Reading(profile=Profile.P2OS, parameters=_parameters(robot)), blocks)
    return drive_of_capture(path.name, chunks_of(blocks), reading.parameters, reading.profile)


def is_recording(path: Path) -> bool:
    """Return whether a path is one recording of a drive, and no run: a file, or a folder that a reader knows."""
    return path.is_file() or _reader_of(path) is not None


def _reader_of(path: Path) -> DriveReader | None:
    readers = (cast("DriveReader", loaded(point)) for point in installed_points(READERS).values())
    return next((one for one in readers if one.knows(path)), None)


def _is_aria_log(path: Path) -> bool:
    with reading(path), path.open("rb") as file:
        return is_aria_log(file.readline(_LONGEST_FIELD).decode("utf-8", "replace"))


def _parameters(robot: str) -> RobotParameters:
    return load_parameters(robot or DEFAULT_ROBOT)


def _of_run(folder: Path, robot: str) -> Drive:
    drive = drive_of_record(folder.name, read_run(folder), robot)
    drive.events = list(read_events(folder))
    return drive


def _of_csv(path: Path, robot: str) -> Drive:
    reader = csv.reader(lines_of(path, errors="strict", newline="", most=LARGEST_TABLE_BYTES))
    try:
        names = next(reader, [])
        rows = [(reader.line_num, row) for row in reader if row]
    except csv.Error as error:
        raise FileError(f"{shown_name(path)}:{reader.line_num}: no CSV: {error}") from error
    heading = next((name for name in ("heading_rad", "heading_deg") if name in names), "")
    for name in ("t_s", "x_m", "y_m", heading):
        if name not in names:
            raise FileError(
                f"{shown_name(path)}:1: no column {name or 'heading_rad'}",
                hint="columns: t_s, x_m, y_m, heading_rad or heading_deg",
            )
    columns = {name: names.index(name) for name in names}

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
    is_reported = "dir" in names and "type" in names
    drive = Drive(
        name=path.name, parameters=_parameters(robot), odometry=trajectory if is_reported else None,
        truth=None if is_reported else trajectory,
        sonar_m={number: steps_of(column(name)) for number, name in sonar.items()},
    )  # fmt: skip
    if "left_mps" in names and "right_mps" in names:
        drive.left_mps, drive.right_mps = steps_of(column("left_mps")), steps_of(column("right_mps"))
        if is_reported:
            drive.reported_left_mps, drive.reported_right_mps = drive.left_mps, drive.right_mps
    return drive


def _number(path: Path, line: int, row: list[str], place: int) -> float:
    return number_of(row[place][:_LONGEST_FIELD], path, line)


def read_tum(path: Path) -> Trajectory:
    """Read a TUM file.

    Raises:
        FileError: A line has not eight numbers, or there are fewer than two lines.
    """
    rows = []
    for number, line in enumerate(lines_of(path, errors="strict", most=LARGEST_TABLE_BYTES), 1):
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
    with writing(path), path.open("w", encoding="utf-8", newline="\n") as file:
        for t, x, y, half in zip(*(column.tolist() for column in columns), strict=True):
            file.write(f"{t!r} {x!r} {y!r} 0 0 0 {math.sin(half)!r} {math.cos(half)!r}\n")
