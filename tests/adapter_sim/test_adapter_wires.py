"""Wires that fail: glitches, a wire that stands, a supply that dips; what comes of it is read off wire and pins."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.adapter_sim.conftest import MS, Rig

QUIET = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
#: When a rig that boots, connects and settles is surely driving.
DRIVING_AT = 1_400 * MS


def driving() -> Rig:
    rig = Rig()
    rig.connect()
    rig.pins.motors(2, 2, rig.now)
    rig.run(DRIVING_AT)
    return rig


def glitch(rig: Rig, signal: str, at: int, span: int) -> None:
    level = rig.pins.read(signal, at)
    rig.pins.set(signal, not level, at)
    rig.pins.set(signal, level, at + span)


def commanded(rig: Rig, since: int) -> list[tuple[str, object]]:
    return [(name, argument) for _, name, argument in rig.sent(since) if name in {"VEL", "RVEL", "STOP", "CLOSE"}]


@settings(max_examples=12, **QUIET)
@given(st.integers(0, 20 * MS), st.integers(1, 4 * MS - 1), st.sampled_from(["motor1_comm1", "motor2_comm3"]))
def test_a_glitch_shorter_than_two_samples_moves_nothing(at: int, span: int, signal: str) -> None:
    rig = driving()
    glitch(rig, signal, DRIVING_AT + at, span)
    rig.ms(60)
    assert set(commanded(rig, DRIVING_AT)) <= {("VEL", 125), ("RVEL", 0)}


@settings(max_examples=10, **QUIET)
@given(st.integers(0, 20 * MS), st.integers(1, 10 * MS - 1))
def test_a_glitch_of_p2dx_con_below_ten_milliseconds_keeps_the_robot(at: int, span: int) -> None:
    rig = driving()
    glitch(rig, "p2dx_con", DRIVING_AT + at, span)
    rig.ms(60)
    assert rig.adapter.state == "driving"


def test_a_stuck_sign_bit_is_a_value_like_any_other_within_its_limits() -> None:
    rig = driving()
    rig.pins.set("motor1_comm3", True, rig.now)
    rig.ms(100)
    assert rig.adapter.status.motors == (-2, 2), "2 with its sign bit stuck is -2"
    assert ("VEL", 0) in commanded(rig, 0)
    assert all(abs(int(value)) <= 250 for name, value in commanded(rig, 0) if name == "VEL")


@pytest.mark.parametrize("span", [4 * MS, 300 * MS])
def test_a_brown_out_lets_the_pins_go_and_the_boot_stops_the_robot_first(span: int) -> None:
    rig = driving()
    glitch(rig, "rst", DRIVING_AT, span)
    rig.ms(3)
    assert rig.adapter.state == "reset"
    assert set(rig.pins.outputs.values()) == {None}
    rig.run(DRIVING_AT + span + 330 * MS)
    assert commanded(rig, DRIVING_AT)[:3] == [("STOP", None), ("VEL", 0), ("RVEL", 0)]
    assert rig.sent(DRIVING_AT)[0][0] >= DRIVING_AT + 300 * MS
