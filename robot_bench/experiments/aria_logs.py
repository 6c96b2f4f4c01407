"""Drives out of ARIA's logs: tables of ArDataLogger (tabs, commas or fixed columns) and scans of ArLaserLogger (`.2d`).

A table begins with `;Time`; after it, as its settings ask, stand the pose as ARIA has it (X Y Th), the robot's own
(encX encY encTh), the rims' speeds (LeftV RightV) and the commands that were sent since the row before (CmdVel,
CmdRotVel, ...; `na`: none); lengths are whole mm, angles whole degrees. Other lines with `;` are comments. Where it
logs encoders, a colon stands at the end of the field before. A scan file has lines `robot: X Y TH` and `velocities: V
ROTV ...` (mm, deg) after one of `logTime: S` or, of older versions, `time: S`. Not read: scans, batteries, inputs.

Source: AriaCoda, src/ArDataLogger.cpp and src/ArLaserLogger.cpp, what they write.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from p2os.robots.parameters import RobotParameters
from robot_bench.drives.drive import Drive, DriveRows, Trajectory, number_of, steps_of
from simbase.errors import FileError, shown_name

TABLE, SCANS = ";time", "laserodometrylog"
#: Column of a command → its name in the manual.
COMMANDS: Mapping[str, str] = {
    "cmdvel": "VEL", "cmdrotvel": "RVEL", "cmdvel2": "VEL2", "cmdhead": "HEAD", "cmddhead": "DHEAD", "cmdmove": "MOVE",
    "cmdsetacc": "SETA", "cmdsetrotacc": "SETRA",
}  # fmt: skip
#: The robot's own pose, and the one that ARIA makes of it where it has another.
POSES = (("encx", "ency", "encth"), ("x", "y", "th"))
#: chosen: no number of these files is longer.
_LONGEST = 32


@dataclass(slots=True, kw_only=True)
class _Rows(DriveRows):
    """What the lines tell so far."""

    name: str

    def number(self, line: int, text: str) -> float:
        """Return a field's number.

        Raises:
            FileError: It is none.
        """
        return number_of(text.strip().removesuffix(":")[:_LONGEST], self.name, line)

    def pose(self, t: float, x_mm: float, y_mm: float, degrees: float) -> None:
        """Take a pose."""
        self.poses.append((t, x_mm / 1000, y_mm / 1000, math.radians(degrees)))

    def rims(self, t: float, left_mm_s: float, right_mm_s: float) -> None:
        """Take both rims' speeds."""
        self.left.append((t, left_mm_s / 1000))
        self.right.append((t, right_mm_s / 1000))


def is_aria_log(first_line: str) -> bool:
    """Tell whether a file whose first line is this is one of ARIA's logs."""
    line = first_line.replace(" ", "").lower()
    return line.startswith((TABLE, SCANS))


def read_aria_log(name: str, lines: Iterable[str], parameters: RobotParameters) -> Drive:
    """Return what one of ARIA's logs tells of a drive.

    Raises:
        FileError: It has no two poses, or a number is none.
    """
    numbered = enumerate(lines, 1)
    first = next(numbered, (1, ""))
    rows = _Rows(name=name)
    if first[1].replace(" ", "").lower().startswith(TABLE):
        _read_table(rows, first, numbered)
    else:
        _read_scans(rows, numbered, parameters)
    try:
        odometry = Trajectory.of_rows(rows.poses)
    except FileError as error:
        raise FileError(f"{shown_name(name)}: {error}", hint="ARIA logs poses where LogPose is on") from error
    told = steps_of(rows.left), steps_of(rows.right)
    return Drive(
        name=name, parameters=parameters, odometry=odometry, told_left_mps=told[0] if rows.left else None,
        told_right_mps=told[1] if rows.right else None, left_mps=told[0] if rows.left else None,
        right_mps=told[1] if rows.right else None,
        commands={name: steps_of(pairs) for name, pairs in rows.commands.items()},
    )  # fmt: skip


def _read_table(rows: _Rows, first: tuple[int, str], lines: Iterator[tuple[int, str]]) -> None:
    names, separator = _columns(first[1])
    for number, line in lines:
        if line.replace(" ", "").lower().startswith(TABLE):  # it began anew
            names, separator = _columns(line)
            continue
        if line.startswith(";") or not line.strip():
            continue
        fields = [one.strip() for one in line.rstrip("\n").split(separator)]
        if len(fields) != len(names):
            counts = f"{len(fields)} fields, expected {len(names)} as its line of names has"
            raise FileError(f"{shown_name(rows.name)}:{number}: {counts}")
        row = dict(zip(names, fields, strict=True))
        t = rows.number(number, row["time"])
        pose = next((columns for columns in POSES if all(one in row for one in columns)), None)
        if pose is not None:
            x, y, degrees = (rows.number(number, row[one]) for one in pose)
            rows.pose(t, x, y, degrees)
        if "leftv" in row and "rightv" in row:
            rows.rims(t, rows.number(number, row["leftv"]), rows.number(number, row["rightv"]))
        for column, name in COMMANDS.items():
            if row.get(column, "na") != "na":
                rows.commands.setdefault(name, []).append((t, rows.number(number, row[column])))


def _columns(line: str) -> tuple[list[str], str]:
    """Return the names of a table's columns, small, and what stands between them."""
    separator = "\t" if "\t" in line else ","
    return [one.strip().lower() for one in line.strip().removeprefix(";").split(separator)], separator


def _read_scans(rows: _Rows, lines: Iterator[tuple[int, str]], parameters: RobotParameters) -> None:
    t: float | None = None
    half_track = parameters.track_mm / 2
    for number, line in lines:
        found = re.match(r"(time|logTime|robot|velocities): *(.*)", line)
        if found is None:
            continue
        values = [rows.number(number, one) for one in found[2].split()]
        kind, least = found[1], {"robot": 3, "velocities": 2}.get(found[1], 1)
        if len(values) < least:
            raise FileError(f"{shown_name(rows.name)}:{number}: {kind} with {len(values)} numbers, expected {least}")
        if kind in {"time", "logTime"}:
            t = values[0]
        elif kind == "robot" and t is not None:
            rows.pose(t, *values[:3])
        elif kind == "velocities" and t is not None:
            turn = math.radians(values[1]) * half_track
            rows.rims(t, values[0] - turn, values[0] + turn)
