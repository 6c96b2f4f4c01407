"""ARIA's logs as drives: its tables in three forms, its scan files, and what is none. Lines as AriaCoda writes them."""

import contextlib
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.robots.parameters import load_parameters
from robot_bench.experiments.aria_logs import read_aria_log
from robot_bench.experiments.drive_files import read_drive
from simbase.errors import FileError

NAMES = ("Time", "X", "Y", "Th", "encX", "encY", "encTh", "LeftV", "RightV", "CmdVel", "CmdRotVel")
ROWS = (
    ("10.0000", "5", "6", "7", "0", "0", "0", "0", "0", "200", "na"),
    ("10.1000", "5", "6", "7", "20", "-3", "-90", "190", "210", "na", "-10"),
)


def table(separator: str, *, is_fixed: bool = False) -> str:
    def line(fields: tuple[str, ...]) -> str:
        return separator.join(f"{one:<10}" if is_fixed else one for one in fields) + "\n"

    return ("; " if is_fixed else ";") + line(NAMES) + "; 1700000000 a comment\n" + "".join(map(line, ROWS))


@pytest.mark.parametrize("text", [table(","), table("\t"), table("\t", is_fixed=True), table(",") + table(",")])
def test_a_table_is_read_in_each_of_its_forms_with_the_robot_s_own_pose(text: str, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    drive = read_drive(tmp_path / "log.csv", robot="p3dx")
    assert drive.odometry is not None
    assert drive.left_mps is not None
    assert drive.odometry.t_s.tolist() == [10.0, 10.1]
    assert drive.odometry.x_m.tolist() == [0.0, 0.02]
    assert drive.odometry.heading_rad[1] == pytest.approx(-math.pi / 2)
    assert drive.left_mps.values.tolist() == [0.0, 0.19]
    assert {name: steps.values.tolist() for name, steps in drive.commands.items()} == {"VEL": [200.0], "RVEL": [-10.0]}
    assert drive.truth is None


def test_a_colon_that_its_writer_leaves_behind_a_field_before_the_encoders_is_no_fault() -> None:
    text = ";Time,X,Y,Th,encL,encR\n1.0000,1,2,3:,4,5\n2.0000,2,2,3:,4,5\n"
    drive = read_aria_log("log", text.splitlines(keepends=True), load_parameters("p2dx"))
    assert drive.odometry is not None
    assert drive.odometry.heading_rad[0] == pytest.approx(math.radians(3))


SCANS = """LaserOdometryLog
#Created by ArLaserLogger
version: 4
sick1pose: 17 8 0.00
locationTypes: robot robotGlobal
logTime: 0.500
velocities: 200.00 10.00 0.00
scanId: 1
robot: 0 0 0.00
robotGlobal: 900 900 90.00
sick1: 100 200
logTime: 1.000
velocities: 200.00 0.00 0.00
scanId: 2
robot: 100 0 2.50
# End of log
"""


def test_a_scan_file_gives_the_odometry_and_the_rims_by_their_speeds(tmp_path: Path) -> None:
    (tmp_path / "1scans.2d").write_text(SCANS, encoding="utf-8")
    drive = read_drive(tmp_path / "1scans.2d")
    assert drive.odometry is not None
    assert drive.right_mps is not None
    assert (drive.odometry.t_s.tolist(), drive.odometry.x_m.tolist()) == ([0.5, 1.0], [0.0, 0.1])
    rim = 0.2 + math.radians(10) * load_parameters("p2dx").track_mm / 2000
    assert drive.right_mps.values.tolist() == pytest.approx([rim, 0.2])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (";Time,X,Y,Th\n1.0,2,3\n", "log:2: 3 fields, expected 4"),
        (";Time,X,Y,Th\n1.0,2,x,4\n", "log:2: 'x' is no number"),
        (";Time,X,Y,Th\n1.0,2,nan,4\n", "log:2: 'nan' is no number"),
        (";Time,LeftV,RightV\n1.0,2,3\n2.0,2,3\n", "LogPose"),
        ("LaserOdometryLog\ntime: 1.0\nrobot: 1 2\n", "log:3: robot with 2 numbers, expected 3"),
        ("LaserOdometryLog\nlogTime:\n", "log:2: logTime with 0 numbers, expected 1"),
    ],
)
def test_what_is_broken_is_reported_with_its_line(text: str, says: str) -> None:
    with pytest.raises(FileError) as failure:
        read_aria_log("log", text.splitlines(keepends=True), load_parameters("p2dx"))
    assert says in f"{failure.value} {failure.value.hint}"


@given(st.text(alphabet=";Time,XYhroblg: \n\t.-0123456789na", max_size=200))
def test_any_text_is_a_drive_or_a_line_that_says_why_not(text: str) -> None:
    for begin in (";Time,X,Y,Th\n", "LaserOdometryLog\n"):
        with contextlib.suppress(FileError):
            assert read_aria_log("log", (begin + text).splitlines(keepends=True), load_parameters("p2dx")).odometry
