"""An adapter that waits for edges does what one that samples on does, at the same times."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapter_sim.pins import SampleClock
from tests.adapter_sim.conftest import MS, Rig


def story(steps: list[tuple[str, int, int]], *, suspends: bool) -> list[object]:
    """Run a story of (what, value, tenths of a millisecond); return all that the adapter did."""
    rig = Rig()
    rig.connect()
    rig.adapter.samples.waits_for_edges = suspends
    for what, value, span in steps:
        if what == "motors":
            for bit in range(6):
                rig.pins.set(f"motor{bit // 3 + 1}_comm{bit % 3 + 1}", bool(value >> bit & 1), rig.now)
        elif what != "wait":
            rig.pins.set(what, bool(value & 1), rig.now)
        rig.adapter.advance_to(rig.now)  # brought to the edge
        # Never an edge at a sample instant itself: there, who is asked first decides.
        rig.run(rig.now + span * MS // 10 + 37)
    return [rig.to_robot.log, rig.events, rig.adapter.state, rig.adapter.status, rig.pins.writes]


WIRES = st.sampled_from(["motors", "p2dx_con", "rst", "motor1_comm1", "wait"])
STEPS = st.lists(
    st.tuples(WIRES, st.integers(0, 63), st.integers(0, 2500)),
    max_size=14,
)


@pytest.mark.slow
@given(steps=STEPS)
@settings(max_examples=60)
def test_it_does_the_same_with_sampling_suspended(steps: list[tuple[str, int, int]]) -> None:
    assert story(steps, suspends=True) == story(steps, suspends=False)


def test_bytes_that_come_while_the_wires_are_settled_make_it_sample_no_more() -> None:
    rig = Rig()
    rig.connect()
    rig.adapter.wait_for_edges()
    rig.ms(50)
    assert "p2dx_con" in rig.adapter.wakes_on
    rig.adapter.receive(b"\x00", rig.now)
    assert "p2dx_con" in rig.adapter.wakes_on


def test_a_clock_is_suspended_over_whole_periods() -> None:
    clock = SampleClock(2 * MS)
    assert clock.due(5) == 0, "it begins with a sample"
    clock.after(3 * MS)
    clock.was_quiet(5 * MS)
    assert clock.due(50 * MS) == 7 * MS, "it samples on while nobody promises edges"
    clock.waits_for_edges = True
    clock.was_quiet(7 * MS)
    assert clock.due(50 * MS) == 50 * MS
    clock.resume(13 * MS)
    assert (clock.next, clock.is_suspended) == (13 * MS, False), "an instant that has come is not left out"
    clock.was_quiet(13 * MS)
    clock.resume(13 * MS + 1)
    assert clock.next == 15 * MS
    clock.was_quiet(15 * MS)
    clock.resume(17 * MS + 1)
    assert clock.next == 19 * MS
