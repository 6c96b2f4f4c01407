"""Faults planted in `dodge` that its own goals hardly notice: the campaign that `new` writes finds them."""

import shutil
import time
from dataclasses import replace
from pathlib import Path

import pytest

from robot_bench.campaign.campaign_file import Budget, RunLimits, parse_campaign
from robot_bench.campaign.conduct import Conduct
from robot_bench.campaign.suggestion import suggested
from robot_bench.campaign.workers.processes import Processes
from robot_bench.firmware import build
from robot_bench.scenario.scenario import load_scenario

#: What is wrong → what stands in dodge_fsm.c, and what takes its place.
FAULTS = {
    "missing reset: ground stays straight after a turn": (
        "if (dodge->state != DODGE_CRUISE) {\n        dodge->straight_ticks = 0;",
        "if (dodge->state != DODGE_CRUISE) {",
    ),
    "sign: turns go to the heavier side": (
        "left > right ? -1 : right > left ? +1 :", "left > right ? +1 : right > left ? -1 :",
    ),
    "limit: every turn counts as one soon after another": ("#define SOON_WAY 12 ", "#define SOON_WAY 1200 "),
    "margin: the wide arc where something is close": ("inner = is_close ? 1 : 2;", "inner = is_close ? 2 : 2;"),
    "blind spot: the sensor at 30 degrees right": (
        "uint8_t sensors)\n{\n", "uint8_t sensors)\n{\n    sensors = (uint8_t)(sensors & ~RIGHT_30);\n",
    ),
}  # fmt: skip
#: More than any of them takes.
RUNS = 80


def failures(firmware: Path | None, folder: Path) -> int:
    """Return how many points of the first batch of the suggested campaign that has some fail, in the cheap runs."""
    text = suggested(load_scenario("dodge"), "dodge", "mine.toml")
    campaign = parse_campaign(text, folder / "mine.toml", firmware=firmware)
    campaign = replace(campaign, budget=Budget(runs=RUNS, confirmations=0))
    conduct = Conduct(campaign, folder, Processes(2, RunLimits()), clock=time.monotonic_ns)
    failed = (sum((row.cheap.margin or 0.0) < 0 for row in rows) for rows in conduct.batches())
    return next(filter(None, failed), 0)


@pytest.mark.soak
@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_found(fault: str, tmp_path: Path) -> None:
    if shutil.which(build.COMPILER) is None:
        pytest.skip(f"no {build.COMPILER}")
    firmware = build.build_altered("dodge", [FAULTS[fault]], tmp_path / "dodge.elf")
    assert failures(firmware, tmp_path) > 0


@pytest.mark.soak
def test_the_program_that_ships_is_not_called_faulty(tmp_path: Path) -> None:
    assert failures(None, tmp_path) == 0
