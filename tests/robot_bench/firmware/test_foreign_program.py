"""A program that knows nothing of the bench, in the layered HAL manner, drives the robot unchanged."""

from pathlib import Path

import pytest

from bluepill_sim.board import BluePill
from bluepill_sim.fabric.subscriptions import EDGE
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario

FOREIGN = Path(__file__).parents[2] / "firmware_foreign"
MS = 1_000_000


@pytest.mark.parametrize("mode", ["direct", "adapter"])
def test_it_drives_turns_and_stops(mode: str, tmp_path: Path) -> None:
    scenario = load_scenario(str(FOREIGN / "foreign.toml")).with_options(mode=mode)
    result = run_scenario(scenario, tmp_path)
    assert result.outcome["failures"] == []
    assert result.passed


def test_its_clocks_and_delays_come_out_right() -> None:
    changes: dict[str, list[int]] = {"PB5": [], "PB6": []}
    chip = BluePill(FOREIGN / "foreign.elf")
    for pin, edges in changes.items():
        chip.subscribe_pins([pin], lambda rows, edges=edges: edges.extend(at for at, *_ in EDGE.iter_unpack(rows)))  # type: ignore[misc]  # bound at once
    chip.advance_to(30 * MS)
    assert chip.hclk_hz == 72_000_000
    while chip.now_ns < 7_000 * MS:
        chip.advance_to(7_000 * MS)
    assert chip.fault is None
    assert chip.warnings == []
    forward, stopped = changes["PB6"][1:]
    turned = changes["PB5"][1]
    # HAL_Delay waits a tick more than asked; a line of 17 characters takes 1.5 ms.
    assert 3_000 * MS <= forward < 3_010 * MS
    assert 2_000 * MS <= turned - forward < 2_005 * MS
    assert 1_500 * MS <= stopped - turned < 1_505 * MS
