"""Count how many cheap runs each search needs to find three bugs of `dodge` that only some worlds show.

Each bug is a copy of `dodge` with a line changed, in a floor of 10 m with one thing on it; a run is 14 to 24 s of the
plan view with the pins straight to the body. What fails is run in full (bullet, through the adapter) and once more in
another process; counted are the points up to the first that failed in all of these. A walker may come upon a robot
that can do nothing about it, so there a world counts only where the copy fails and `dodge` does not.

Usage: python tools/bench/campaigns/searches.py [--case NAME] [--search NAME] [--repeat N] [--runs N]
[--first SEED] [--all]
Needs arm-none-eabi-gcc; a second of a processor for two or three points. With `--all` a search goes on to its last
point, and how many fail and how different they are is printed.
"""

import argparse
import statistics
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from workers import used_s

from robot_bench.campaign.campaign_file import RunLimits, parse_campaign
from robot_bench.campaign.conduct import Conduct, Workers
from robot_bench.campaign.search import SEARCHES
from robot_bench.campaign.variants.against import Against, Other
from robot_bench.campaign.variants.diversity import FailureSet
from robot_bench.campaign.workers.processes import Processes
from robot_bench.firmware.build import HERE, build_altered

WORLD = """
name = "floor"
extent_m = [-5, -5, 5, 5]
[start]
x_m = 0.0
y_m = 0.0
heading_deg = 0.0
"""
CAMPAIGN = """
scenario = "floor-dodge.toml"
batch = 8
near_misses = 0
free_m = 0.4
[budget]
runs = {runs}
confirmations = {confirmations}
[cheap]
mode = "direct"
body = "kinematic"
[full]
mode = "adapter"
body = "bullet"
[vary]
start.x_m = {{ from = -2.5, to = 2.5 }}
start.y_m = {{ from = -2.5, to = 2.5 }}
start.heading_deg = {{ from = 0, to = 355, step = 5 }}
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A bug that a world shows."""

    #: What stands in the sources, and what takes its place.
    edits: tuple[tuple[str, str], ...]
    duration_s: float
    #: What is drawn, and what has to hold.
    tables: str
    #: Only what `dodge` itself does not fail counts.
    is_compared: bool = False


TOUCHES_NOTHING = """
[[goal]]
kind = "no_collision"
ends_run = "missed"
"""
CASES = {
    "dead end": Case(
        # A turn ends only where +-50 degrees are free too: in a dead end of 0.9 m they never are.
        edits=(("(is_bold ? FRONT : AHEAD)", "((is_bold ? FRONT : AHEAD) | LEFT_50 | RIGHT_50)"),),
        duration_s=24,
        tables="""
[[draw]]
kind = "dead-end"
ahead_m = { from = 0.8, to = 1.6 }
aside_m = { from = -0.3, to = 0.3 }
width_m = { from = 0.7, to = 2.5 }
depth_m = { from = 0.6, to = 1.6 }
[[goal]]
kind = "moves_on"
way_m = 0.5
within_s = 12.0
ends_run = "missed"
""",
    ),
    "thin post": Case(
        # A sensor counts only where one beside it sees too, against noise: what is in the middle of a cone does not.
        edits=((
            "    update_seen(dodge, sensors);",
            "    update_seen(dodge, (uint8_t)(sensors & (sensors << 1 | sensors >> 1)));",
        ),),
        duration_s=16,
        tables="""
[[draw]]
kind = "post"
ahead_m = { from = 0.5, to = 1.6 }
aside_m = { from = -0.8, to = 0.8 }
width_m = { from = 0.04, to = 0.4 }
"""
        + TOUCHES_NOTHING,
    ),
    "walker": Case(
        # Whatever is ahead, it goes back first, whether it has just come from there or not.
        edits=(
            ("dodge->straight_ticks > STRAIGHT_TICKS ? way - dodge->ground_way - BACK_MARGIN_WAY : 0", "BACK_MOST_WAY"),
            ("    return free_way < BACK_MOST_WAY", "    (void)dodge, (void)way;\n    return free_way < BACK_MOST_WAY"),
            ("is_shut(dodge) && free_way_behind", "free_way_behind"),
        ),
        duration_s=14,
        is_compared=True,
        tables="""
[[draw]]
kind = "box"
ahead_m = { from = 0.8, to = 1.6 }
aside_m = { from = -0.2, to = 0.2 }
[[draw]]
kind = "walker"
ahead_m = { from = -2.0, to = -0.4 }
aside_m = { from = -1.0, to = 1.0 }
heading_deg = { from = 120, to = 240 }
width_m = { from = 0.2, to = 0.5 }
way_m = { from = 0.3, to = 2.0 }
speed_mps = { from = 0.1, to = 0.5 }
"""
        + TOUCHES_NOTHING,
    ),
}  # fmt: skip
#: chosen: runs in full that a search may spend until its first failure. A walker that is met cheaply may be missed in
#: full, where the robot is half a second later.
CONFIRMED = 8
CHOSEN = ("random", "cma-es", "quality-diversity")


def conduct(
    case: Case, firmware: Path, search: str, seed: int, *, runs: int, confirmations: int, folder: Path
) -> Conduct:
    """Return the campaign of a case, about to begin."""
    (folder / "floor.toml").write_text(WORLD, encoding="utf-8")
    scenario = f'extends = "dodge"\nworld = "floor.toml"\nduration_s = {case.duration_s}\n'
    (folder / "floor-dodge.toml").write_text(scenario, encoding="utf-8")
    text = f'search = "{search}"\nseed = {seed}\n{CAMPAIGN.format(runs=runs, confirmations=confirmations)}{case.tables}'
    campaign = parse_campaign(text, folder / "case.toml", firmware=firmware)
    workers: Workers = Processes(1, RunLimits())
    if case.is_compared:
        workers = Against(workers, Other("dodge.elf", (HERE / "dodge.elf").read_bytes()))
    return Conduct(campaign, folder, workers, clock=time.monotonic_ns)


def tried(case: Case, firmware: Path, search: str, seed: int, runs: int, *, to_the_end: bool) -> tuple[int | None, str]:
    """Return at which point a search found its first failure, None where it did not, and what is said of the rest."""
    with tempfile.TemporaryDirectory() as scratch:
        confirmations = runs if to_the_end else CONFIRMED
        work = conduct(case, firmware, search, seed, runs=runs, confirmations=confirmations, folder=Path(scratch))
        for _ in work.batches():
            if work.progress.failures and not to_the_end:
                break
        work.close()
        found, rows = work.progress.failures, work.progress.rows
        cheap = sum((row.cheap.margin or 0.0) < 0 for row in rows)
        said = f"{len(rows)} points, {cheap} failed cheaply, {len(found)} in full too"
        if to_the_end:
            said += "".join(f"; {what} {how}" for what, how in FailureSet.of(rows).words().items())
        return (found[0].number if found else None), said


def main() -> None:
    """Print a row for each case and search."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("--case", choices=list(CASES), action="append")
    parser.add_argument("--search", choices=list(SEARCHES), action="append")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--all", action="store_true")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name in given.case or CASES:
            firmware = build_altered("dodge", CASES[name].edits, Path(folder) / "copy.elf")
            for search in given.search or CHOSEN:
                tell(name, firmware, search, given)


def tell(name: str, firmware: Path, search: str, given: argparse.Namespace) -> None:
    """Print what a search came to with each seed, and a row of a table."""
    began = used_s()
    found = []
    for seed in range(given.first, given.first + given.repeat):
        number, said = tried(CASES[name], firmware, search, seed, given.runs, to_the_end=given.all)
        found.append(number)
        print(f"  {name}, {search}, seed {seed}: {number or 'none'}; {said}", flush=True)
    median = statistics.median_low(given.runs + 1 if one is None else one for one in found)
    words = ", ".join("none" if one is None else str(one) for one in found)
    middle = f"more than {given.runs}" if median > given.runs else str(median)
    print(f"| {name} | {search} | {words} | {middle} | {used_s() - began:.0f} |", flush=True)


if __name__ == "__main__":
    main()
