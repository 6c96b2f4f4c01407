"""ARIA's own files and robots that nobody knows."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.robots.aria_file import counts_per_turn
from p2os.robots.parameters import (
    FALLBACK,
    ParametersError,
    known_robots,
    load_parameters,
    nearest_model,
)

#: As a user of ARIA keeps it: sections, comments behind semicolons, more keys than anyone needs.
MINE = """\
ConfigVersion 2.0
;SectionFlags for :
Section General settings
Class Pioneer            ; general type of robot
Subclass p3dx-sh         ; specific type of robot
RobotRadius 260.00000    ; radius in mm
RobotLength 513.00000
RobotLengthFront 0.00000 ; 0: half of RobotLength
RobotLengthRear 0.00000
MaxVelocity 1400         ; absolute maximum mm / sec
HasMoveCommand false
RequestIOPackets true
SwitchToBaudRate 0
Section Conversion factors
AngleConvFactor 0.00153  ; radians per angular unit (2PI/4096)
DistConvFactor 1.01300   ; measured
DiffConvFactor 0.00560
VelConvFactor 0.61540
Section Accessories the robot has
FrontBumpers true
NumFrontBumpers 7
RearBumpers false
NumRearBumpers 5
Section Movement control parameters
TransVelMax 900
TransAccel 0             ; 0: the robot's own
Section Sonar parameters
SonarNum 2
SonarUnit 0 69 136 90
SonarUnit 1 114 119 50 1 2 0 600 400 1
Section Laser parameters
LaserAutoConnect true
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "my.p"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_of_arias_goes_over_the_shipped_model(tmp_path: Path) -> None:
    robot, shipped = load_parameters(written(tmp_path, MINE)), load_parameters("p3dx-sh")
    assert (robot.subclass, robot.title) == ("p3dx-sh", shipped.title)
    assert (robot.distance_nm_per_count, robot.velocity_nm_s_per_count) == (1_013_000, 615_400)
    assert (robot.angle_counts_per_turn, robot.track_mm) == (4096, 357)
    assert (robot.radius_mm, robot.front_mm, robot.rear_mm) == (260, 257, 256)
    assert (robot.max_velocity_mm_s, robot.max_rotation_deg_s) == (1400, shipped.max_rotation_deg_s)
    assert (robot.motion.max_velocity_mm_s, robot.motion.accel_mm_s2) == (900, shipped.motion.accel_mm_s2)
    assert (robot.equipment.front_bumpers, robot.equipment.rear_bumpers) == (7, 0)
    assert (robot.equipment.has_move, robot.equipment.sends_io_packets) == (False, True)
    assert [(pose.x_mm, pose.heading_deg) for pose in robot.sonar] == [(69, 90), (114, 50)]
    assert robot.sonar_fitted == 2
    assert robot.body == shipped.body


def test_a_robot_of_ones_own_takes_the_rest_from_its_family(tmp_path: Path) -> None:
    robot = load_parameters(written(tmp_path, "Subclass p3at-mine\nFrontBumpers true\nSonarNum 16\n"))
    assert (robot.subclass, robot.title) == ("p3at-mine", "p3at-mine")
    assert robot.equipment.front_bumpers == 5
    assert robot.body == load_parameters("p3at").body
    assert robot.sonar == ()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Class Pioneer\n", "no Subclass"),
        ("Subclass p3dx\nDistConvFactor x\n", "DistConvFactor = 'x' is no number"),
        ("Subclass p3dx\nDistConvFactor nan\n", "is no number"),
        ("Subclass p3dx\nDistConvFactor 0\n", "must be positive"),
        ("Subclass p3dx\nRobotRadius -1\n", "must be positive"),
        ("Subclass p3dx\nSonarUnit 0 1 2\n", "SonarUnit needs"),
        ("Subclass p3dx\nDistConvFactor 0.0000001\n", "DistConvFactor = '0.0000001' is out of range"),
        ("Subclass p3dx\nVelConvFactor 1e306\n", "out of range"),
        ("Subclass p3dx\nAngleConvFactor 99\n", "angle_counts_per_turn = 0"),
        ("Subclass p3dx\nRobotRadius inf\n", "out of range"),
    ],
)
def test_what_is_wrong_in_a_file_of_arias_is_named(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ParametersError, match=said):
        load_parameters(written(tmp_path, text))


@pytest.mark.parametrize("name", ["none.p", "none.toml"])
def test_a_file_that_is_not_there_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(ParametersError, match="no robot file"):
        load_parameters(tmp_path / name)


def test_an_angle_factor_near_a_power_of_two_is_that_power() -> None:
    assert [counts_per_turn(factor) for factor in (0.00153, 0.001534, 0.00614, 0.0174532925)] == [4096, 4096, 1024, 360]


@pytest.mark.parametrize(
    ("subclass", "model"),
    [
        ("p3dx-sh-lms1xx", "p3dx-sh"), ("P2D8+X", "p2d8+"), ("p3dx9", "p3dx"), ("p3xx", "p3dx-sh"), ("p2zz", "p2dx"),
        ("amigo-sh-tim3xx", "amigo-sh"), ("researchPB", "patrolbot-sh"), ("psos43m", "pion1m"), ("pion1x", "pion1m"),
        ("box", FALLBACK), ("", FALLBACK),
    ],
)  # fmt: skip
def test_an_unknown_robot_is_taken_for_the_nearest(subclass: str, model: str) -> None:
    assert nearest_model(subclass) == model


@given(st.text(max_size=12))
def test_any_name_leads_to_a_shipped_model(name: str) -> None:
    assert nearest_model(name) in known_robots()


def test_an_equipment_that_is_no_section_is_named(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('based_on = "p2dx"\nequipment = 3\n', encoding="utf-8")
    with pytest.raises(ParametersError, match="equipment = 3 is not a table"):
        load_parameters(path)
