"""Motor values to speeds, and which settings are refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adapter_sim import AdapterSettings, MotorMeaning
from adapter_sim.distances import threshold_um
from adapter_sim.mixing import CommandedSpeeds, Mixer
from p2os.robots.parameters import load_parameters
from simbase.errors import UsageError

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


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"bit_order": "lsb"}, "bit_order is 'lsb'"),
        ({"motor_meaning": "x"}, "motor_meaning is 'x'"),
        ({"encoder_at_open": "x"}, "encoder_at_open is 'x'"),
        ({"sample_count": 4}, "sample_count must be odd"),
        ({"sample_period_ns": 0}, "sample_period_ns must be 1 or more"),
        ({"threshold_um": -1}, "threshold_um must be 0 or more"),
        ({"threshold_um": 0.6}, "threshold_um must be an integer, got 0.6"),
        ({"stop_unknown_robot": 1}, "stop_unknown_robot must be true or false, got 1"),
        ({"refresh_ns": True}, "refresh_ns must be an integer"),
        ({"refresh_ns": 20_000_000}, "below pair_spacing_ns"),
    ],
)
def test_bad_settings_are_refused_by_name(settings: dict[str, object], message: str) -> None:
    with pytest.raises(UsageError) as refusal:
        AdapterSettings(**settings)
    assert message in str(refusal.value)


def test_settings_take_the_words_of_a_scenario_file() -> None:
    settings = AdapterSettings(bit_order="comm1_msb", motor_meaning="linear_angular")
    assert settings.motor_meaning is MotorMeaning.LINEAR_ANGULAR


def test_the_threshold_is_half_of_the_sonar_range_unless_given() -> None:
    robot = load_parameters("p2dx")
    assert threshold_um(None, robot) == round(robot.sonar_range_m * 1e6) // 2
    assert threshold_um(600_000, robot) == 600_000
