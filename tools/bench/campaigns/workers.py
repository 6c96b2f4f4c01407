"""Measure what runs cost the workers of a campaign: memory, throughput, and what shared beginnings save.

    memory        of the program whose forks run, and of one process that runs all itself, as a worker of Dask does
    throughput    seconds of a processor of runs one after the other in one process, against the same in forks
    beginnings    seconds of a processor of runs that share a beginning, against each from its own

All in seconds of a processor (user and system), which a busy machine changes least; the ratios are of runs of the same
minute.

Usage: python tools/bench/campaigns/workers.py [memory|throughput|beginnings ...] [--runs N] [--body kinematic|bullet]
"""

import argparse
import random
import resource
from collections.abc import Callable, Sequence
from pathlib import Path

from robot_bench.campaign.campaign_file import RunLimits
from robot_bench.campaign.trial import Done, Trial, run_trial, trial_of
from robot_bench.campaign.workers.processes import Processes

MB = 1 << 20
#: Forks at a time.
AT_ONCE = (1, 2, 4)


def memory(runs: int, body: str) -> None:
    """Print the memory after the first run, half of them and all, of forks' parent and of one process."""
    base = trial_of("dodge", settings=[("body", body), ("mode", "direct"), ("duration_s", 1)])
    trials = [base.set(("seed", number)) for number in range(runs)]
    marks = (1, runs // 2, runs)
    for name, run in (("the program beside forks", _forked), ("one process that runs all", _in_turn)):
        told: list[str] = []
        count = 0

        def on_done(_place: int, _done: Done, told: list[str] = told) -> None:
            nonlocal count
            count += 1
            if count in marks:
                told.append(f"{_held_mb():.1f}")

        run(trials, on_done)
        print(f"memory, {name}, after {marks[0]}, {marks[1]} and {marks[2]} runs: {', '.join(told)} MB", flush=True)


def throughput(runs: int, body: str) -> None:
    """Print what runs cost one after the other in a process, and in forks of one, so many at a time."""
    base = trial_of("dodge", settings=[("body", body), ("duration_s", 30)])
    trials = [base.set(("seed", number)) for number in range(runs)]
    run_trial(base)  # loads what all need
    alone = _spent(lambda: _in_turn(trials, lambda *_: None))
    forked = [_spent(lambda count=count: _forked(trials, lambda *_: None, count)) for count in AT_ONCE]  # type: ignore[misc]  # mypy knows no defaults here
    told = ", ".join(f"{spent:.1f} s ({alone / spent:.2f})" for spent in forked)
    print(f"throughput, {body}: {runs} runs of 30 s: {alone:.1f} s in turn; in forks, {AT_ONCE} at a time: {told}")


def beginnings(runs: int, body: str) -> None:
    """Print what runs of 60 s cost in which a sonar fails for 3 s at some time after the first third."""
    source = random.Random(1)
    base = trial_of("dodge", settings=[("body", body), ("duration_s", 60)])
    trials = [
        base.with_lists(fault=[{"at_s": at_s, "fault": f"sonar-stuck {source.randint(1, 8)} 0.4", "for_s": 3.0}])
        for at_s in (round(source.uniform(20, 55), 3) for _ in range(runs))
    ]
    run_trial(base.set(("duration_s", 1)))
    found: list[dict[int, Done]] = [{}, {}]
    alone, shared = (
        _spent(lambda anew=anew, into=into: Processes(2, RunLimits()).run(  # type: ignore[misc]  # as above
            trials, lambda place, done: into.update({place: done}), anew=anew
        ))
        for anew, into in zip((True, False), found, strict=True)
    )  # fmt: skip
    same = all(found[0][place][0] == found[1][place][0] for place in range(runs))
    print(
        f"beginnings, {body}: {runs} runs of 60 s: {alone:.1f} s each anew, {shared:.1f} s shared, "
        f"{100 * (1 - shared / alone):.0f} % saved; outcomes {'the same' if same else 'DIFFER'}"
    )


def _in_turn(trials: Sequence[Trial], on_done: Callable[[int, Done], None]) -> None:
    for place, trial in enumerate(trials):
        on_done(place, (run_trial(trial), 0.0))


def _forked(trials: Sequence[Trial], on_done: Callable[[int, Done], None], at_once: int = 2) -> None:
    Processes(at_once, RunLimits()).run(trials, on_done, anew=True)


def _held_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / MB


def used_s() -> float:
    """Return the CPU seconds of this process and of those that it has ended."""
    both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in both)


def _spent(work: Callable[[], None]) -> float:
    before = used_s()
    work()
    return used_s() - before


#: Name → what measures, and how many runs it takes.
MEASURES = {"memory": (memory, 1000), "throughput": (throughput, 8), "beginnings": (beginnings, 16)}


def main() -> None:
    """Print a line for each measure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("measures", nargs="*", metavar="MEASURE", help=", ".join(MEASURES))
    parser.add_argument("--runs", type=int)
    parser.add_argument("--body", choices=("kinematic", "bullet"), default="kinematic")
    given = parser.parse_args()
    for name in given.measures or MEASURES:
        if name not in MEASURES:
            parser.error(f"there is no measure {name}: {', '.join(MEASURES)}")
        measure, runs = MEASURES[name]
        measure(given.runs or runs, given.body)


if __name__ == "__main__":
    main()
