"""Motor values to speeds, and which settings are refused."""

import math
from dataclasses import fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adapter_sim import AdapterSettings, MotorMeaning
from adapter_sim.distances import threshold_um
from adapter_sim.duty import FULL
from adapter_sim.encoders import PI_E9
from adapter_sim.mixing import DEG_PER_RAD_E9, CommandedSpeeds, Mixer
from p2os.robots.parameters import load_parameters
from simbase.errors import UsageError
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


#: Settings for which 0 is a meaning.
ZERO = {
    "threshold_um", "step_um_per_s", "angular_step_urad_per_s", "max_velocity_mm_s", "max_rotation_deg_s",
    "connect_after_ns", "disconnect_after_ns", "boot_ns", "plausibility_tolerance_mm_s", "encoder_dwell_ns",
    "stop_repeats", "pad_velocity_mm_s", "pad_rotation_mrad_s", "pad_trigger_dead", "pad_stick_dead",
}  # fmt: skip
NO_NUMBERS = {"motor_command", "bit_order", "motor_meaning", "encoder_at_open", "stop_unknown_robot", "bauds"}


@each_row("name", [field.name for field in fields(AdapterSettings) if field.name not in NO_NUMBERS])
def test_each_number_has_its_least(name: str) -> None:
    least = 0 if name in ZERO else 1
    beside = {"refresh_ns": {"pair_spacing_ns": 1}}.get(name, {})
    assert getattr(AdapterSettings(**{name: least}, **beside), name) == least
    with pytest.raises(UsageError, match=f"{name} must be {least} or more, got {least - 1}"):
        AdapterSettings(**{name: least - 1})


@each_row(
    ("settings", "is_sound"),
    [
        ({"refresh_ns": 25_000_000}, True),
        ({"refresh_ns": 24_999_999}, False),
        ({"pad_trigger_dead": 1_022}, True),
        ({"pad_trigger_dead": 1_023}, False),
        ({"pad_stick_dead": 510}, True),
        ({"pad_stick_dead": 511}, False),
        ({"sample_count": 3}, True),
        ({"bauds": [1]}, True),
        ({"bauds": (1,) * 8}, True),
        ({"bauds": (1,) * 9}, False),
        ({"bauds": (0,)}, False),
        ({"bauds": (True,)}, False),
        ({"bauds": (9_600, "9600")}, False),
        ({"bauds": 9_600}, False),
    ],
)
def test_numbers_bound_each_other(settings: dict[str, object], is_sound: bool) -> None:
    try:
        AdapterSettings(**settings)
    except UsageError:
        assert not is_sound
    else:
        assert is_sound


def test_line_speeds_of_a_list_are_kept_as_a_tuple() -> None:
    assert AdapterSettings(bauds=[9_600, 19_200]).bauds == (9_600, 19_200)


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


def test_settings_take_the_words_of_a_scenario_file() -> None:
    settings = AdapterSettings(bit_order="comm1_msb", motor_meaning="linear_angular")
    assert settings.motor_meaning is MotorMeaning.LINEAR_ANGULAR


def test_the_threshold_is_half_of_the_sonar_range_unless_given() -> None:
    robot = load_parameters("p2dx")
    assert threshold_um(None, robot) == round(robot.sonar_range_m * 1e6) // 2
    assert threshold_um(600_000, robot) == 600_000
