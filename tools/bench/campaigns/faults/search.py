"""Search for the drawn faults with the campaign files that `p2os campaign new` writes, each to its first failure.

    python tools/bench/campaigns/faults/search.py FOLDER [NAME...] [--runs 600] [--seed 0] [--minutes 10]

FOLDER has the programs (`draw.py --build FOLDER`); beside each a folder of its campaign is made, which a later call
goes on with. A line is printed for each: after how many points it was found, in full and again in another process with
the same hash, and by which goal. `sound` beside the programs' names runs the programs themselves: what fails is a false
alarm. One worker; under `nice` it hinders nobody.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from p2os.transport.wall_clock import wall_clock
from robot_bench.campaign.campaign_file import Budget, Campaign, parse_campaign
from robot_bench.campaign.conduct import Conduct, PointFinding
from robot_bench.campaign.suggestion import suggested
from robot_bench.campaign.workers.processes import Processes
from robot_bench.scenario.loading import load_scenario

#: chosen: in place of the file's 16, so that nothing is run beyond the first failure.
BATCH = 1


def campaign_of(name: str, folder: Path, runs: int, seed: int) -> Campaign:
    """Return the campaign for a program, `dodge-03` or `dodge-sound`."""
    scenario = load_scenario(name.partition("-")[0])
    file = folder / f"{name}-campaign.toml"
    text = suggested(scenario, scenario.name, str(file), {"runs": runs, "seed": seed})
    program = folder / f"{name}.elf"
    found = parse_campaign(text, file, firmware=program if program.is_file() else None)
    return replace(found, batch=BATCH, near_misses=0, budget=Budget(runs=runs, confirmations=40))


def search(name: str, folder: Path, runs: int, seed: int, minutes: float) -> str:
    """Search until something is proven to fail; return what came of it in a line."""
    campaign = campaign_of(name, folder, runs, seed)
    kept = folder / f"{name}-seed{seed}"
    kept.mkdir(exist_ok=True)
    workers = Processes(1, campaign.limits, lambda: None)
    conduct = Conduct(campaign, kept, workers, clock=wall_clock)
    until = wall_clock() + round(minutes * 60e9)
    try:
        for _ in conduct.batches():
            done = conduct.progress
            if done.failures:
                row = done.failures[0]
                why = row.failing.outcome.failures[0] if row.failing is not None else ""
                row.failing and row.failing.trial.write(kept / "failure")
                return f"{name}: found at point {row.number}, {row.finding.value}: {why}"
            if wall_clock() > until:
                break
        done = conduct.progress
        excused = sum(row.finding is PointFinding.EXCUSED for row in done.rows)
        return f"{name}: not found in {len(done.rows)} points ({excused} excused, {done.cpu_s:.0f} s of a processor)"
    finally:
        conduct.close()
        workers.close()


def main() -> int:
    """Search for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--runs", type=int, default=600)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=10.0)
    asked = parser.parse_args()
    names = asked.names or sorted(path.stem for path in asked.folder.glob("*-[0-9][0-9].elf"))
    for name in names:
        print(search(name, asked.folder, asked.runs, asked.seed, asked.minutes), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
