"""Faults of pins, supply and loop, on the model; what the adapter makes of them is read off wire and pins."""

from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from adapter_sim import Adapter, BrownOut, FaultyPins, Glitch, SlowLoop, StuckPin, Waveforms
from simbase.errors import UsageError
from tests.adapter_sim.conftest import MS, PINOUT, FakePins, Rig

QUIET = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
#: When a rig that boots, connects and settles is surely driving.
DRIVING_AT = 1_400 * MS


def rig_with(*faults: StuckPin | Glitch | BrownOut) -> Rig:
    return Rig(kind=lambda pins, **rest: Adapter(pins=FaultyPins(pins, PINOUT, faults), **rest))


def driving_with(*faults: StuckPin | Glitch | BrownOut, motors: tuple[int, int] = (2, 2)) -> Rig:
    rig = rig_with(*faults)
    rig.connect()
    rig.pins.motors(*motors, rig.now)
    rig.run(DRIVING_AT)
    return rig


def commanded(rig: Rig, since: int) -> list[tuple[str, object]]:
    return [(name, argument) for _, name, argument in rig.sent(since) if name in {"VEL", "RVEL", "STOP", "CLOSE"}]


@settings(max_examples=12, **QUIET)
@given(st.integers(0, 20 * MS), st.integers(1, 4 * MS - 1), st.sampled_from(["motor1_comm1", "motor2_comm3"]))
def test_a_glitch_shorter_than_two_samples_moves_nothing(at: int, span: int, signal: str) -> None:
    rig = driving_with(Glitch(signal=signal, at=DRIVING_AT + at, span_ns=span))
    rig.ms(60)
    assert set(commanded(rig, DRIVING_AT)) <= {("VEL", 125), ("RVEL", 0)}


@settings(max_examples=10, **QUIET)
@given(st.integers(0, 20 * MS), st.integers(1, 10 * MS - 1))
def test_a_glitch_of_p2dx_con_below_ten_milliseconds_keeps_the_robot(at: int, span: int) -> None:
    rig = driving_with(Glitch(signal="p2dx_con", at=DRIVING_AT + at, span_ns=span))
    rig.ms(60)
    assert rig.adapter.state == "driving"


def test_a_glitch_that_lasts_is_no_glitch() -> None:
    rig = driving_with(Glitch(signal="p2dx_con", at=DRIVING_AT, span_ns=13 * MS))
    rig.ms(40)
    assert rig.adapter.state == "closing"


def test_a_stuck_motor_wire_is_a_value_like_any_other_within_its_limits() -> None:
    rig = driving_with(StuckPin(signal="motor1_comm3", high=True, since=DRIVING_AT - 50 * MS))
    rig.ms(100)
    assert rig.adapter.status.motors == (-2, 2), "2 with its sign bit stuck is -2"
    assert ("VEL", 0) in commanded(rig, 0)
    assert all(abs(int(value)) <= 250 for name, value in commanded(rig, 0) if name == "VEL")


def test_a_stuck_p2dx_con_cannot_start_the_robot_after_a_loss() -> None:
    rig = driving_with(StuckPin(signal="p2dx_con", high=True, since=DRIVING_AT))
    rig.robot.sends = False
    rig.ms(400)
    assert rig.adapter.state == "lost"
    rig.robot.sends = True
    rig.pins.set("p2dx_con", False, rig.now)
    rig.ms(100)
    rig.pins.set("p2dx_con", True, rig.now)
    rig.ms(2_000)
    assert rig.adapter.state == "lost", "the fall was never seen"


def test_a_stuck_output_shows_its_level_while_it_sticks_and_the_wanted_one_after() -> None:
    rig = rig_with(StuckPin(signal="DD1", high=False, since=400 * MS, until=900 * MS))
    rig.run(390 * MS)
    assert rig.pins.outputs["DD1"] is True
    rig.run(410 * MS)
    assert rig.pins.outputs["DD1"] is False
    assert rig.pins.outputs["DD2"] is True
    rig.run(910 * MS)
    assert rig.pins.outputs["DD1"] is True


@pytest.mark.parametrize("span", [1, 300 * MS])
def test_a_brown_out_lets_the_pins_go_and_the_boot_stops_the_robot_first(span: int) -> None:
    rig = driving_with(BrownOut(at=DRIVING_AT, span_ns=span))
    rig.ms(3)
    assert rig.adapter.state == "reset"
    assert set(rig.pins.outputs.values()) == {None}
    rig.run(DRIVING_AT + span + 330 * MS)
    assert commanded(rig, DRIVING_AT)[:3] == [("STOP", None), ("VEL", 0), ("RVEL", 0)]
    assert rig.sent(DRIVING_AT)[0][0] >= DRIVING_AT + 300 * MS


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (StuckPin(signal="DD9", high=True), "there is no wire 'DD9'"),
        (Glitch(signal="DD1", at=0, span_ns=1), "DD1 is an output"),
    ],
)
def test_a_fault_that_cannot_be_is_refused(fault: StuckPin | Glitch, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        FaultyPins(FakePins(), PINOUT, [fault])


# A slow loop.


def slow(pass_ms: float) -> Rig:
    def make(pins: FakePins, now: int, **rest: object) -> SlowLoop:
        return SlowLoop(lambda present: Adapter(pins=present, now=now, **rest), pins, round(pass_ms * MS), now)

    return Rig(kind=make)


@pytest.mark.parametrize("pass_ms", [1, 7.5, 30, 90])
def test_a_slow_loop_still_drives_and_stops_a_pass_later_at_most(pass_ms: float) -> None:
    rig = slow(pass_ms)
    rig.ms(320)
    rig.pins.set("p2dx_con", True, rig.now)
    rig.pins.motors(2, 2, rig.now)
    rig.ms(1_700)
    assert rig.adapter.state == "driving", rig.events
    assert rig.robot.forward == 125
    silent_at = rig.now
    rig.robot.sends = False
    rig.ms(600)
    stopped_at = next(at for at, name, _ in rig.sent(silent_at) if name == "STOP")
    assert stopped_at - silent_at <= 350 * MS + 2 * pass_ms * MS
    assert rig.robot.forward == 0


def test_a_slow_loop_acts_at_its_passes_only() -> None:
    rig = slow(30)
    rig.ms(320)
    rig.pins.set("p2dx_con", True, rig.now)
    rig.ms(1_000)
    times = {at for at, _, _ in rig.sent()} | {at for at, _, _ in rig.pins.writes}
    assert times
    assert all(at % (30 * MS) == 0 for at in times)


def test_a_loop_of_no_time_is_refused() -> None:
    with pytest.raises(UsageError, match="no slow loop"):
        SlowLoop(lambda pins: Adapter(pins=pins, pinout=PINOUT, parameters=None), FakePins(), 0)


# Waveforms.


@pytest.fixture
def scope() -> tuple[Rig, Callable[[], Waveforms]]:
    made: list[Waveforms] = []

    def make(pins: FakePins, **rest: object) -> Adapter:
        made.append(Waveforms(pins))
        return Adapter(pins=made[0], **rest)

    rig = Rig(kind=make)
    return rig, lambda: made[0]


def test_waveforms_show_what_was_seen_and_driven(scope: tuple[Rig, Callable[[], Waveforms]]) -> None:
    rig, waveforms = scope
    rig.run(320 * MS)
    rig.pins.set("p2dx_con", True, 321 * MS)
    rig.pins.set("motor1_comm1", True, 323 * MS)
    rig.pins.set("motor1_comm1", False, 323 * MS + 500_000)
    rig.run(340 * MS)
    seen = waveforms()
    assert seen.edges("p2dx_con") == [(300 * MS, False), (322 * MS, True)], "seen at the next sample"
    assert seen.edges("motor1_comm1") == [(300 * MS, False)], "shorter than the sampling: never seen"
    assert seen.edges("DD1") == [(300 * MS, True)]
    assert seen.level("DD1", 299 * MS) is None
    assert seen.edges("nothing") == []
    assert "encoder2_s3" in seen.signals
    picture = seen.picture(["p2dx_con", "DD1"], start=298 * MS, end=326 * MS, step_ns=2 * MS)
    assert picture == "p2dx_con  .___________##\nDD1       .#############\n"


def test_a_picture_of_nothing_is_refused(scope: tuple[Rig, Callable[[], Waveforms]]) -> None:
    with pytest.raises(UsageError, match="nothing to draw"):
        scope[1]().picture(["DD1"], start=5, end=5)
