"""Which settings are refused, and that the firmware's tables have their defaults."""

from dataclasses import fields

import pytest

from adapter_sim import AdapterSettings, MotorMeaning
from simbase.errors import UsageError
from tests.adapter_fw.builds import load_script
from tests.tools.each_row import each_row


def test_generated_tables_are_up_to_date() -> None:
    tables = load_script("tools/generators/adapter_tables.py")
    stale = [path.name for path, text in tables.tables().items() if path.read_text(encoding="utf-8") != text]
    assert not stale, "run `make generated`"


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


def test_settings_take_the_words_of_a_scenario_file() -> None:
    settings = AdapterSettings(bit_order="comm1_msb", motor_meaning="linear_angular")
    assert settings.motor_meaning is MotorMeaning.LINEAR_ANGULAR
