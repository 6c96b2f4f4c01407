"""Print how much of the speed of its parts the bench keeps: runs with all that a bench has switched on, kinematic body.

Each figure is the median of the ratios of paired runs in this process, by CPU time; a run is that of `p2os run` up to
the end of its trace and the judging of its goals. The chip alone runs the same program without a bench. The programs
are those of tools/bench/firmware. With `--timers` every timer runs all the while, in what is measured and in what it
is compared to. Usage: python tools/bench/shares.py [--quick] [--timers]
"""

import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import bodies
from emulator import SETTLED_NS, build
from timers import start_timers

from bluepill_sim import BluePill
from robot_bench.bench import Bench
from robot_bench.recording.trace import TraceWriter
from robot_bench.scenario.scenario import load_scenario
from simbase.timing import NS_PER_S

IS_QUICK, HAS_TIMERS = "--quick" in sys.argv, "--timers" in sys.argv
RUNS = 1 if IS_QUICK else 5
#: Virtual seconds of a run.
TOGGLE_S, BITBANG_S, PRINT_S, DODGE_S = (2.0, 0.05, 0.5, 5.0) if IS_QUICK else (20.0, 0.5, 5.0, 30.0)
#: It stands still from 16 s on.
ROVER_S = 4.0 if IS_QUICK else 14.0
MODES = ("adapter", "direct")
GOALS = {"kinematic": 0.45, "bullet": 0.8}


def cpu_s(work: Callable[[], object]) -> float:
    """Return the CPU seconds of a piece of work."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def row(name: str, ratios: Sequence[float], goal: str) -> None:
    """Print one line of the table."""
    print(f"{name:<58} {statistics.median(ratios):>8.3f}  goal {goal}; of {len(ratios)}")


def bench(folder: Path, program: Path | None, seconds: float, mode: str, body: str = "kinematic") -> Bench:
    """Return a bench of `dodge`, or of another program in its place, that records into a file."""
    scenario = load_scenario("dodge").with_options(mode=mode, body=body, duration_s=seconds)
    if program is not None:
        scenario = replace(scenario, firmware=program)
    made = Bench(scenario, trace=TraceWriter(folder / "trace.jsonl"))
    if HAS_TIMERS:
        made.run_until(SETTLED_NS)
        start_timers(made.chip)
    return made


def run(made: Bench) -> None:
    """Run a bench to its end."""
    made.run_until(made.scenario.duration_ns)
    made.judge()


def alone_s(program: Path, seconds: float) -> float:
    """Return the CPU seconds of the chip alone."""
    board = BluePill(program)
    board.advance_to(SETTLED_NS)
    if HAS_TIMERS:
        start_timers(board)
    return cpu_s(lambda: board.advance_to(round(seconds * NS_PER_S)))


def toggling(folder: Path) -> None:
    """A pin that no wire is on."""
    busy, asleep = build("toggle", folder), build("toggle", folder, "-DBENCH_ASLEEP")
    for mode in MODES:
        ratios = []
        for _ in range(RUNS):
            parts = alone_s(busy, TOGGLE_S) + cpu_s(lambda: run(bench(folder, asleep, TOGGLE_S, mode)))  # noqa: B023
            ratios.append(parts / cpu_s(lambda: run(bench(folder, busy, TOGGLE_S, mode))))  # noqa: B023 - called at once
        row(f"toggling PB8, {mode}: chip alone and sleeping run / run", ratios, "0.9")


def bitbanging(folder: Path) -> None:
    """A pin that is a motor's wire."""
    program = build("bitbang", folder)
    for mode in MODES:
        ratios, sizes = [], []
        for _ in range(RUNS):
            made = bench(folder, program, BITBANG_S, mode)
            ratios.append(alone_s(program, BITBANG_S) / cpu_s(lambda: run(made)))  # noqa: B023 - called at once
            edges = sum(len(of_net) for of_net in made.record().pins.values())
            sizes.append((folder / "trace.jsonl").stat().st_size / edges)
        row(f"bitbang on a motor's wire, {mode}: chip alone / run", ratios, "0.3")
        row(f"bitbang on a motor's wire, {mode}: bytes an edge", sizes, "4 at most")


def printing(folder: Path) -> None:
    """Every character recorded, while the firmware computes."""
    on, off = build("print", folder), build("print", folder, "-DBENCH_NO_USART")
    ratios = []
    for _ in range(RUNS):
        silent = cpu_s(lambda: run(bench(folder, off, PRINT_S, "adapter")))
        ratios.append(silent / cpu_s(lambda: run(bench(folder, on, PRINT_S, "adapter"))))
    row("USART 115200 by interrupt, recorded: off / on", ratios, "0.9")


def dodging(folder: Path) -> None:
    """The whole chain, as a share of the body alone."""
    bodies.RUNS, bodies.LIVED_S = 1, round(DODGE_S)
    for body, goal in GOALS.items():
        bodies.times_real(body)  # imports
        shares: dict[str, list[float]] = {mode: [] for mode in MODES}
        for _ in range(RUNS):
            alone = bodies.times_real(body)
            for mode in MODES:
                made = bench(folder, None, DODGE_S, mode, body)
                shares[mode].append(DODGE_S / cpu_s(lambda: run(made)) / alone)  # noqa: B023 - called at once
        for mode in MODES:
            row(f"dodge in room, {body}, {mode}: of the body alone", shares[mode], f"{goal}")
        pairs = [a / b for a, b in zip(shares["direct"], shares["adapter"], strict=True)]
        row(f"dodge in room, {body}: direct / adapter", pairs, "1")


def rover(folder: Path) -> None:
    """A robot on its own pins: speed control at 1 kHz by PWM, encoders and ADC, while it drives."""
    factors = []
    for _ in range(RUNS):
        made = Bench(load_scenario("rover").with_options(duration_s=ROVER_S), trace=TraceWriter(folder / "trace.jsonl"))
        factors.append(ROVER_S / cpu_s(lambda: run(made)))  # noqa: B023 - called at once
    row("rover in arena, kinematic: times real time", factors, "5")


def together(folder: Path) -> None:
    """Robots that share a world, against as many of them each in its own."""
    scenario = load_scenario("two-dodge").with_options(body="kinematic", duration_s=DODGE_S)
    count = len(scenario.robots)
    for mode in MODES:
        ratios = []
        for _ in range(RUNS):
            traces = {robot.name: TraceWriter(folder / robot.name) for robot in scenario.robots}
            both = next(iter(Bench.together(scenario.with_options(mode=mode), traces=traces).values()))
            alone = bench(folder, None, DODGE_S, mode)
            ratios.append(count * cpu_s(lambda: run(alone)) / cpu_s(lambda: run(both)))  # noqa: B023 - called at once
        row(f"two-dodge, kinematic, {mode}: each alone / in one world", ratios, "0.5")


def main() -> int:
    """Print the table; 1 without a compiler for it."""
    if shutil.which("arm-none-eabi-gcc") is None:
        print("bench: no arm-none-eabi-gcc (hint: sudo apt-get install gcc-arm-none-eabi)")
        return 1
    if HAS_TIMERS:
        print("with TIM1 to TIM4 running:")
    with tempfile.TemporaryDirectory() as folder:
        for part in (toggling, bitbanging, printing, dodging, rover, together):
            part(Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
