"""Print what a bench costs beside its run: its events and goals, copies of it, its boot, and what a long run leaves.

The cost of events and goals is that of CPU time, of pairs of runs that take turns each virtual second, so that both
see the machine as it is: the bench as it is, against one whose recorder keeps the lines and hands them to the trace by
itself, as it did before there was a stream, and that has no goals. Times of copies are CPU time too.
Usage: python tools/bench/costs.py [--quick | --hour]; --hour adds the size of an hour's run and of its report.
"""

import pickle
import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from measuring import IS_QUICK, RUNS, cpu_s, print_tables, row

from robot_bench.bench import Bench
from robot_bench.events.codec import Recorded
from robot_bench.recording.trace import TraceWriter
from robot_bench.run import run_scenario
from robot_bench.scenario.scenario import Scenario, load_scenario
from robot_bench.wires.edges import Edges
from simbase.timing import NS_PER_S, Nanos

RUN_S = 5 if IS_QUICK else 30
COPIES = 3 if IS_QUICK else 15
LONG_S = 3600.0 if "--hour" in sys.argv else 60.0
BODIES = ("kinematic", "bullet")
BOOTED = "usart1 sends dodge: ready"


class SortedLines:
    """The recorder's stream as it was when it had no subscribers: sorted by time, and written."""

    released_until: Nanos = -1

    def __init__(self, write: Callable[[Sequence[Recorded], Nanos], None]) -> None:
        self._write = write
        self._kept: list[tuple[Nanos, int, Recorded]] = []
        self._count = 0

    def publish(self, event: Recorded) -> None:
        """Keep an event."""
        self._count += 1
        self._kept.append((event.t, self._count, event))

    def wants_edges(self, wire: str) -> bool:  # noqa: ARG002 - the stream's
        """Nobody wants any."""
        return False

    def release(self, limit: Nanos, tracks: Mapping[str, tuple[int, Edges]] | None = None) -> None:  # noqa: ARG002 - as above
        """Write what is stamped until then."""
        self._kept.sort(key=lambda item: item[:2])
        ready = [item for item in self._kept if item[0] <= limit]
        del self._kept[: len(ready)]
        self._write([event for *_, event in ready], limit)
        self.released_until = max(self.released_until, limit)


def scenario(body: str, seconds: float = RUN_S) -> Scenario:
    """Return `dodge`."""
    return load_scenario("dodge").with_options(body=body, duration_s=seconds)


def events_and_goals(folder: Path, body: str) -> None:
    """The share of a run that its events and goals take."""
    shares = []
    for _ in range(RUNS):
        wanted = scenario(body)
        whole = Bench(wanted, trace=TraceWriter(folder / "whole"))
        bare = Bench(replace(wanted, goals=(), whens=()), trace=TraceWriter(folder / "bare"))
        bare.recorder.events = SortedLines(bare.trace.take)  # type: ignore[assignment] # what the recorder uses of it
        took = [0.0, 0.0]
        for second in range(1, RUN_S + 1):
            for place, bench in enumerate((whole, bare)):
                took[place] += cpu_s(lambda: bench.loop.run_until(second * NS_PER_S))  # noqa: B023 - called at once
        took[0] += cpu_s(whole.judge)
        shares.append(100 * (took[0] / took[1] - 1))
    row(f"events and goals of dodge, {body}", shares, "{:+.1f} %", "goal 3 % at most")


def booted(wanted: Scenario) -> Bench:
    """Return a bench whose firmware has booted."""
    bench = Bench(wanted)
    bench.expect(BOOTED)
    return bench


def copies(body: str) -> None:
    """What it takes to fork a bench, to pickle it, and to begin anew from a snapshot of its boot."""
    wanted = scenario(body)
    booted(wanted)  # imports
    data = b""
    took: dict[str, list[float]] = {"booted": [], "fork": [], "pickle": [], "unpickle": [], "restarted": []}
    for _ in range(COPIES):
        took["booted"].append(cpu_s(lambda: booted(wanted)))
        bench = booted(wanted)
        snapshot = bench.snapshot()
        bench.run_until("2 s")
        data = pickle.dumps(bench)
        took["fork"].append(cpu_s(bench.fork))
        took["pickle"].append(cpu_s(lambda: pickle.dumps(bench)))  # noqa: B023 - called at once
        took["unpickle"].append(cpu_s(lambda: pickle.loads(data)))  # noqa: B023,S301 - called at once; our own
        took["restarted"].append(cpu_s(lambda: bench.restart(snapshot)))  # noqa: B023 - called at once
    ms = {name: 1e3 * statistics.median(found) for name, found in took.items()}
    for name in ("fork", "pickle", "unpickle"):
        note = f"{len(data) / 1024:.0f} kB, its trace in it" if name == "pickle" else ""
        row(f"dodge after 2 s, {body}: {name}", ms[name], "{:.1f} ms", note)
    row(f"dodge, {body}: built and run until it is booted", ms["booted"], "{:.1f} ms")
    factor = f"{ms['booted'] / ms['restarted']:.1f} times as fast"
    row(f"dodge, {body}: begun anew from a snapshot of that", ms["restarted"], "{:.1f} ms", factor)


def long_run(folder: Path) -> None:
    """The size of a long run and of its report."""
    made = folder / "long"
    took_s = cpu_s(lambda: run_scenario(scenario("kinematic", LONG_S), made))
    for path in sorted(made.iterdir()):
        if path.is_file():
            row(f"{LONG_S:g} s of dodge, kinematic: {path.name}", path.stat().st_size / 1e6, "{:.2f} MB")
    row(f"{LONG_S:g} s of dodge, kinematic: CPU time", took_s, "{:.1f} s", "with trace, waveforms, report")


if __name__ == "__main__":
    print_tables(
        *(lambda folder, body=body: events_and_goals(folder, body) for body in BODIES),  # type: ignore[misc]  # mypy knows no defaults here
        *(lambda _folder, body=body: copies(body) for body in BODIES),  # type: ignore[misc]
        long_run,
    )
