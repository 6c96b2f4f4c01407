"""Which settings, numbers of a robot and wires the firmware refuses, at the bounds of each."""

import ctypes
from collections.abc import Mapping

import pytest

from adapter_sim import AdapterSettings, load_pinout
from p2os.robots.parameters import load_parameters
from robot_bench import adapter as firmware
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.tools.each_row import each_row

HOUR_NS = 3_600 * NS_PER_S
FASTEST = 0xFFFF
#: Of each setting: the least number, why a lower one is refused, the greatest, why a higher one is; None: any.
LOW, CHOICE, BOUND, SHORT = "or more", "a choice", "longer than an hour", "comes round is too short"
MOTOR, PAD, DEAD = "a motor step is larger", "a speed of the pad", "a dead zone"
BOUNDS: Mapping[str, tuple[int, str | None, int, str | None]] = {
    "threshold_um": (-1, LOW, 1 << 60, None),
    **dict.fromkeys(("motor_command", "bit_order", "motor_meaning", "encoder_at_open"), (0, CHOICE, 1, CHOICE)),
    **dict.fromkeys(("step_um_per_s", "angular_step_urad_per_s"), (0, LOW, 10_000_000, MOTOR)),
    **dict.fromkeys(("max_velocity_mm_s", "max_rotation_deg_s"), (-1, LOW, 1 << 60, None)),
    "sample_period_ns": (NS_PER_MS // 10, SHORT, HOUR_NS, BOUND),
    "sample_count": (1, LOW, 31, "must be odd"),
    "pair_spacing_ns": (1 * NS_PER_MS, SHORT, 200 * NS_PER_MS, "refresh_ns is below"),
    "refresh_ns": (25 * NS_PER_MS, "refresh_ns is below", HOUR_NS, BOUND),
    **dict.fromkeys(("pulse_ns", "distance_stale_ns", "stop_repeat_ns"), (10 * NS_PER_MS, SHORT, HOUR_NS, BOUND)),
    **dict.fromkeys(
        ("duty_timeout_ns", "liveness_ns", "first_sip_ns", "retry_ns", "plausibility_ns", "settle_ns", "pad_loss_ns"),
        (1, LOW, HOUR_NS, BOUND),
    ),
    **dict.fromkeys(
        ("connect_after_ns", "disconnect_after_ns", "boot_ns", "encoder_dwell_ns"), (0, LOW, HOUR_NS, BOUND)
    ),
    "plausibility_tolerance_mm_s": (0, LOW, FASTEST, BOUND),
    "plausibility_progress_mm_s": (1, LOW, FASTEST, BOUND),
    "stop_unknown_robot": (0, None, 1, None),
    "stop_repeats": (0, LOW, 0x7FFF_FFFF, None),
    **dict.fromkeys(("pad_velocity_mm_s", "pad_rotation_mrad_s"), (0, LOW, FASTEST, PAD)),
    "pad_trigger_dead": (0, LOW, 1_022, DEAD),
    "pad_stick_dead": (0, LOW, 510, DEAD),
    "baud0": (1, "no line speed", 0x7FFF_FFFF, None),
    **{f"baud{place}": (-1, None, 0x7FFF_FFFF, None) for place in range(1, 8)},
}
ROBOT = firmware.robot_numbers(load_parameters("p2dx"))
WIRES = firmware.wire_numbers(load_pinout())
#: Motor values of any width stand for a speed that a robot has.
STILL = {"step_um_per_s": 0, "angular_step_urad_per_s": 0}

needs_core = pytest.mark.skipif(not firmware.is_available(), reason="the firmware core is not built: no C++17 compiler")


def usual() -> dict[str, int]:
    """Return the settings' defaults as the firmware's numbers."""
    return firmware.setting_numbers(AdapterSettings(), load_parameters("p2dx"))


def fault_of(
    settings: Mapping[str, int] | None = None, robot: Mapping[str, int] | None = None,
    wires: Mapping[str, int] | None = None,
) -> str:  # fmt: skip
    """Return why the firmware refuses these numbers in the place of the usual ones; "" where it takes them."""
    library, fault = firmware._library(), ctypes.c_char_p()
    names = (library.adapter_setting_name, library.adapter_robot_name, library.adapter_wire_name)
    numbers = (usual() | dict(settings or {}), ROBOT | dict(robot or {}), WIRES | dict(wires or {}))
    given = [firmware._numbers(firmware._names(name), values) for name, values in zip(names, numbers, strict=True)]
    handle = library.adapter_new(*given, ctypes.byref(firmware._Callbacks()), 0, ctypes.byref(fault))
    library.adapter_free(handle)
    return (fault.value or b"").decode()


@needs_core
def test_every_setting_has_bounds() -> None:
    assert BOUNDS.keys() == usual().keys()


@needs_core
@each_row("name", BOUNDS)
def test_each_setting_is_held_to_its_bounds(name: str) -> None:
    least, low, most, high = BOUNDS[name]
    assert fault_of({name: least}) == fault_of({name: most}) == ""
    assert low is None or low in fault_of({name: least - 1})
    assert high is None or high in fault_of({name: most + 1})


@needs_core
def test_settings_bound_each_other() -> None:
    for count in range(1, 32):
        assert (fault_of({"sample_count": count}) == "") == bool(count % 2), count
    assert fault_of({"pair_spacing_ns": HOUR_NS, "refresh_ns": HOUR_NS}) == ""
    assert BOUND in fault_of({"pair_spacing_ns": HOUR_NS + 1, "refresh_ns": HOUR_NS + 1})
    assert fault_of({"pair_spacing_ns": NS_PER_MS, "refresh_ns": 10 * NS_PER_MS}) == ""
    assert SHORT in fault_of({"pair_spacing_ns": NS_PER_MS, "refresh_ns": 10 * NS_PER_MS - 1})
    for wires in ({"motor1_width": 4}, {"motor2_width": 4}):
        for name in ("step_um_per_s", "angular_step_urad_per_s"):
            assert fault_of({name: 5_000_000}, wires=wires) == ""
            assert MOTOR in fault_of({name: 5_000_001}, wires=wires)


@needs_core
def test_a_robots_numbers_and_the_wires_have_their_bounds() -> None:
    for name in ROBOT:
        for number, is_refused in ((0, True), (1, False), (10_000_000, False), (10_000_001, True)):
            expected = "out of its range" if is_refused else ""
            if name == "angle_counts_per_turn" and number == 10_000_000:
                expected = "must divide"
            assert (fault_of(robot={name: number}) == "") == (expected == ""), (name, number)
            assert expected in fault_of(robot={name: number})
    for counts, is_sound in ((1_024, True), (1_000, False), (4_096, True), (4_097, False)):
        assert (fault_of(robot={"angle_counts_per_turn": counts}) == "") is is_sound
    for name, least, most, why in (
        ("distances", 0, 16, "more than 16"),
        *((name, 1, 8, "1 to 8 wires") for name in ("motor1_width", "motor2_width", "encoder_width")),
    ):
        assert fault_of(STILL, wires={name: least}) == fault_of(STILL, wires={name: most}) == ""
        assert why in fault_of(wires={name: least - 1})
        assert why in fault_of(wires={name: most + 1})
