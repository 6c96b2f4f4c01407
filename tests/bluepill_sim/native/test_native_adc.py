"""The ADC with DMA under the example program: the same on both cores, in any slices, from any snapshot."""

import pickle
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bluepill_sim import BluePill
from bluepill_sim.fabric.signals import Oscillation, Samples, Waveform
from tests.tools.examples import EXAMPLES

ANALOG = str(EXAMPLES / "analog.elf")
STARTED_NS, END_NS = 100_000_000, 140_000_000


def board(core: str) -> BluePill:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("P2OS_CORE", core)
        made = BluePill(ANALOG)
    made.pin("PA0").set_volts(Oscillation(shape=Waveform.SINE, low_v=0, high_v=3.3, period_ns=77_777))
    made.pin("PA5").set_volts(Samples(volts=(0.5, 2.5, 1.0), interval_ns=33_333, is_repeated=True))
    return made


def state(made: BluePill) -> tuple[Any, ...]:
    parts = made.chip.parts.by_name
    return (
        made.cycle, made.pc, made.read_memory(0x2000_0000, 0x400), bytes(made.usart1.unread), made.last_rows,
        [(tuple(parts[name].words[:40]), parts[name].held, parts[name].due_ns) for name in ("ADC1", "DMA1", "USART1")],
    )  # fmt: skip


@pytest.fixture(scope="module")
def started() -> list[tuple[BluePill, Any]]:
    """Boards of each core, and what they were when the first line began to go out."""
    boards = []
    for core in ("native", "python"):
        made = board(core)
        made.advance_to(STARTED_NS)
        boards.append((made, made.snapshot()))
    return boards


@settings(max_examples=5, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(slices=st.lists(st.integers(100, 9_000_000), min_size=2, max_size=8), change_ns=st.integers(STARTED_NS, END_NS))
def test_samples_and_text_are_the_same_however_the_run_is_cut(
    started: list[tuple[BluePill, Any]], slices: list[int], change_ns: int
) -> None:
    seen = []
    for n, (made, saved) in enumerate([*started, started[0]]):
        made.restore(pickle.loads(pickle.dumps(saved)) if n == 2 else saved)  # noqa: S301 - its own
        for span in slices if n == 2 else []:
            made.advance_to(min(made.now_ns + span, change_ns))
        made.advance_to(change_ns)
        made.pin("PA4").set_volts(1.0)
        for span in slices if n == 2 else []:
            made.advance_to(min(made.now_ns + span, END_NS))
        made.advance_to(END_NS)
        seen.append(state(made))
    assert seen[1] == seen[0]
    assert seen[2] == seen[0]
    assert b"analog: supply 3301 mV" in seen[0][3]
