"""Print how much of the speed of its parts the bench keeps: runs with all that a bench has switched on, kinematic body.

Each figure is the median of the ratios of paired runs in this process, by CPU time; a run is that of `p2os run` up to
the end of its trace and the judging of its goals. The chip alone runs the same program without a bench. The programs
are those of tools/bench/firmware. With `--timers` every timer runs all the while, in what is measured and in what it
is compared to. Usage: python tools/bench/shares.py [--quick] [--timers]
"""

import sys
from dataclasses import replace
from pathlib import Path

from bodies import times_real
from emulator import SETTLED_NS, build
from measuring import CROSS_COMPILER, IS_QUICK, RUNS, cpu_s, print_tables, row, several
from timers import start_timers

from bluepill_sim import BluePill
from robot_bench.bench import Bench
from robot_bench.recording.trace import TraceWriter
from robot_bench.scenario.loading import load_scenario
from simbase.timing import NS_PER_S

HAS_TIMERS = "--timers" in sys.argv
#: Virtual seconds of a run.
TOGGLE_S, BITBANG_S, PRINT_S, DODGE_S = (2.0, 0.05, 0.5, 5.0) if IS_QUICK else (20.0, 0.5, 5.0, 30.0)
#: It stands still from 16 s on.
ROVER_S = 4.0 if IS_QUICK else 14.0
MODES = ("adapter", "direct")
GOALS = {"kinematic": 0.45, "bullet": 0.8}


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


def run_s(made: Bench) -> float:
    """Return the CPU seconds of a bench from here to its end."""

    def run() -> None:
        made.run_until(made.scenario.duration_ns)
        made.judge()

    return cpu_s(run)


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

    def share(mode: str) -> float:
        parts = alone_s(busy, TOGGLE_S) + run_s(bench(folder, asleep, TOGGLE_S, mode))
        return parts / run_s(bench(folder, busy, TOGGLE_S, mode))

    for mode in MODES:
        row(f"toggling PB8, {mode}: chip alone and sleeping run / run", several(share, mode), note="goal 0.9")


def bitbanging(folder: Path) -> None:
    """A pin that is a motor's wire."""
    program = build("bitbang", folder)
    for mode in MODES:
        ratios, sizes = [], []
        for _ in range(RUNS):
            made = bench(folder, program, BITBANG_S, mode)
            ratios.append(alone_s(program, BITBANG_S) / run_s(made))
            edges = sum(len(of_net) for of_net in made.record().pins.values())
            sizes.append((folder / "trace.jsonl").stat().st_size / edges)
        row(f"bitbang on a motor's wire, {mode}: chip alone / run", ratios, note="goal 0.3")
        row(f"bitbang on a motor's wire, {mode}: bytes an edge", sizes, note="goal 4 at most")


def printing(folder: Path) -> None:
    """Every character recorded, while the firmware computes."""
    on, off = build("print", folder), build("print", folder, "-DBENCH_NO_USART")

    def share() -> float:
        return run_s(bench(folder, off, PRINT_S, "adapter")) / run_s(bench(folder, on, PRINT_S, "adapter"))

    row("USART 115200 by interrupt, recorded: off / on", several(share), note="goal 0.9")


def dodging(folder: Path) -> None:
    """The whole chain, as a share of the body alone."""
    for body, goal in GOALS.items():
        times_real(body, 1)  # imports
        shares: dict[str, list[float]] = {mode: [] for mode in MODES}
        for _ in range(RUNS):
            alone = times_real(body, round(DODGE_S))
            for mode in MODES:
                made = bench(folder, None, DODGE_S, mode, body)
                shares[mode].append(DODGE_S / run_s(made) / alone)
        for mode in MODES:
            row(f"dodge in room, {body}, {mode}: of the body alone", shares[mode], note=f"goal {goal}")
        pairs = [a / b for a, b in zip(shares["direct"], shares["adapter"], strict=True)]
        row(f"dodge in room, {body}: direct / adapter", pairs, note="goal 1")


def rover(folder: Path) -> None:
    """A robot on its own pins: speed control at 1 kHz by PWM, encoders and ADC, while it drives."""
    scenario = load_scenario("rover").with_options(duration_s=ROVER_S)
    found = several(lambda: ROVER_S / run_s(Bench(scenario, trace=TraceWriter(folder / "trace.jsonl"))))
    row("rover in arena, kinematic: times real time", found, note="goal 5")


def together(folder: Path) -> None:
    """Robots that share a world, against as many of them each in its own."""
    scenario = load_scenario("two-dodge").with_options(body="kinematic", duration_s=DODGE_S)

    def share(mode: str) -> float:
        traces = {robot.name: TraceWriter(folder / robot.name) for robot in scenario.robots}
        both = next(iter(Bench.together(scenario.with_options(mode=mode), traces=traces).values()))
        return len(traces) * run_s(bench(folder, None, DODGE_S, mode)) / run_s(both)

    for mode in MODES:
        row(f"two-dodge, kinematic, {mode}: each alone / in one world", several(share, mode), note="goal 0.5")


if __name__ == "__main__":
    if HAS_TIMERS:
        print("with TIM1 to TIM4 running:")
    sys.exit(print_tables(toggling, bitbanging, printing, dodging, rover, together, needs=(CROSS_COMPILER,)))
