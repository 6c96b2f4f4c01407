"""Motor values to speeds."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adapter_sim import AdapterSettings
from adapter_sim.distances import threshold_um
from adapter_sim.duty import FULL
from adapter_sim.encoders import PI_E9
from adapter_sim.mixing import DEG_PER_RAD_E9, CommandedSpeeds, Mixer
from p2os.robots.parameters import load_parameters
from tests.tools.each_row import each_row

STEPS = st.integers(-8, 7)


def mixer(**settings: object) -> Mixer:
    return Mixer(AdapterSettings(**settings), full_steps=4, track_mm=357, max_velocity_mm_s=750, max_rotation_deg_s=100)


@pytest.mark.parametrize(
    ("left", "right", "speeds"),
    [
        (0, 0, CommandedSpeeds(0, 0)),
        (2, 2, CommandedSpeeds(125, 0)),
        (3, 3, CommandedSpeeds(188, 0)),  # 187.5, away from zero
        (-3, -3, CommandedSpeeds(-188, 0)),
        (-4, -4, CommandedSpeeds(-250, 0)),
        (1, 2, CommandedSpeeds(94, 10)),  # 93.75 mm/s; 62.5 / 357 rad/s = 10.03 deg/s
        (-2, 2, CommandedSpeeds(0, 40)),
        (3, -4, CommandedSpeeds(-31, -70)),  # -31.25 mm/s; 437.5 / 357 rad/s = 70.2 deg/s
    ],
)
def test_wheel_steps_become_a_differential_drive(left: int, right: int, speeds: CommandedSpeeds) -> None:
    assert mixer().mix(left, right) == speeds


@given(STEPS, STEPS, st.integers(1_000, 90_000), st.integers(200, 600))
def test_mixing_is_the_true_drive_to_half_a_unit(left: int, right: int, step: int, track: int) -> None:
    robot = Mixer(
        AdapterSettings(step_um_per_s=step),
        full_steps=4,
        track_mm=track,
        max_velocity_mm_s=10_000,
        max_rotation_deg_s=10_000,
    )
    speeds = robot.mix(left, right)
    assert abs(speeds.forward_mm_s - (left + right) * step / 2_000) <= 0.5 + 1e-9
    assert abs(speeds.turn_deg_s - math.degrees((right - left) * step / 1_000 / track)) <= 0.5 + 1e-6
    wheel_left, wheel_right = robot.wheels_mm_s(speeds)
    # Half a mm/s of VEL, half a degree a second of RVEL at the rim, and the rounding of the rim speed.
    bound = 0.5 + math.radians(0.5) * track / 2 + 0.5
    assert abs(wheel_left - left * step / 1_000) <= bound
    assert abs(wheel_right - right * step / 1_000) <= bound


@given(STEPS, STEPS)
def test_a_mirrored_command_turns_the_other_way(left: int, right: int) -> None:
    speeds, mirrored = mixer().mix(left, right), mixer().mix(right, left)
    assert mirrored == CommandedSpeeds(speeds.forward_mm_s, -speeds.turn_deg_s)


@given(STEPS, STEPS, st.integers(0, 400), st.integers(0, 120))
def test_no_speed_passes_its_limit(left: int, right: int, velocity: int, rotation: int) -> None:
    speeds = mixer(max_velocity_mm_s=velocity, max_rotation_deg_s=rotation).mix(left, right)
    assert abs(speeds.forward_mm_s) <= velocity
    assert abs(speeds.turn_deg_s) <= min(rotation, 100)


def test_a_limit_slows_the_robot_but_keeps_its_path() -> None:
    assert mixer(max_velocity_mm_s=47).mix(1, 2) == CommandedSpeeds(47, 5)  # half of 94 mm/s and 10 deg/s
    assert mixer(max_rotation_deg_s=35).mix(3, -4) == CommandedSpeeds(-15, -35)  # half of -31 and -70


def test_the_linear_and_angular_meaning_takes_motor2_as_the_turn() -> None:
    robot = mixer(motor_meaning="linear_angular")
    assert robot.mix(2, 0) == CommandedSpeeds(125, 0)
    assert robot.mix(-4, 3) == CommandedSpeeds(-250, 73)  # 3 × 0.425 rad/s = 73.05 deg/s
    assert robot.mix(0, -4) == CommandedSpeeds(0, -97)  # 97.4


def test_constants_are_their_numbers_rounded() -> None:
    assert round(math.degrees(1) * 10**9) == DEG_PER_RAD_E9
    assert round(math.pi * 10**9) == PI_E9
    assert FULL == 1_000


@each_row(
    ("forward", "turn", "speeds"),
    [
        (1_023, 0, CommandedSpeeds(400, 0)),
        (-1_023, 0, CommandedSpeeds(-400, 0)),
        (1, 0, CommandedSpeeds(0, 0)),  # 0.39 mm/s
        (2, 0, CommandedSpeeds(1, 0)),
        (0, 511, CommandedSpeeds(0, 97)),  # 97.4 deg/s
        (0, -511, CommandedSpeeds(0, -97)),
        (0, 3, CommandedSpeeds(0, 1)),  # 0.57 deg/s
        (0, 2, CommandedSpeeds(0, 0)),  # 0.38 deg/s
    ],
)
def test_a_pads_deflections_are_parts_of_its_speeds(forward: int, turn: int, speeds: CommandedSpeeds) -> None:
    assert mixer().steer(forward, turn) == speeds


@each_row(
    ("limits", "speeds"),
    [
        ({"max_velocity_mm_s": 188}, CommandedSpeeds(188, 0)),
        ({"max_velocity_mm_s": 187}, CommandedSpeeds(187, 0)),
        ({"max_velocity_mm_s": 0}, CommandedSpeeds(0, 0)),
        ({"max_velocity_mm_s": 751}, CommandedSpeeds(188, 0)),
    ],
)
def test_a_speed_at_its_limit_is_kept(limits: dict[str, int], speeds: CommandedSpeeds) -> None:
    assert mixer(**limits).mix(3, 3) == speeds
    assert mixer(**limits).mix(-3, -3) == CommandedSpeeds(-speeds.forward_mm_s, 0)


@each_row(
    ("left", "right", "limit", "speeds"),
    [
        (-3, 4, 70, CommandedSpeeds(31, 70)),
        (-3, 4, 69, CommandedSpeeds(30, 69)),
        (3, -4, 69, CommandedSpeeds(-30, -69)),
        (-3, 4, 0, CommandedSpeeds(0, 0)),
    ],
)
def test_a_turn_at_its_limit_is_kept(left: int, right: int, limit: int, speeds: CommandedSpeeds) -> None:
    assert mixer(max_rotation_deg_s=limit).mix(left, right) == speeds


def test_the_threshold_is_half_of_the_sonar_range_unless_given() -> None:
    robot = load_parameters("p2dx")
    assert threshold_um(None, robot) == round(robot.sonar_range_m * 1e6) // 2
    assert threshold_um(600_000, robot) == 600_000
