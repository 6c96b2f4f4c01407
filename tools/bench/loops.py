"""Print how the emulator fares with faults, polling, unoptimised code, restored chips and sleep.

The chip runs alone; times are CPU time, medians of runs in turn with what they are compared to. The programs are those
of tools/bench/firmware. Usage: python tools/bench/loops.py [--quick]
"""

import statistics
import sys
from collections.abc import Callable
from pathlib import Path

from emulator import SETTLED_NS, build, factor, rate, rounds_of, stretch
from measuring import CROSS_COMPILER, IS_QUICK, RUNS, TIMES_REAL, print_tables, row, several

from bluepill_sim import BluePill
from simbase.timing import NS_PER_S

#: Virtual seconds of a run.
LOOP_S, IDLE_S, COMPUTE_S = (0.05, 5.0, 0.2) if IS_QUICK else (0.5, 60.0, 2.0)
#: What is polled: words for a person, and how loop.c is built for it.
POLLED = {
    "SysTick's COUNTFLAG": "-DBENCH_COUNTFLAG",
    "a register that is not modelled": "-DBENCH_UNMODELLED",
    "BSRR of a pin that is an input": "-DBENCH_BSRR",
}


def settled(program: Path) -> BluePill:
    """Return a board past the start of its program."""
    board = BluePill(program)
    board.advance_to(2 * SETTLED_NS)
    return board


def in_turn(*measures: Callable[[], float]) -> list[list[float]]:
    """Return several measurements of each."""
    return list(map(list, zip(*([measure() for measure in measures] for _ in range(RUNS)), strict=True)))


def ratios(ones: list[float], others: list[float]) -> list[float]:
    """Return the ratios of measurements that were made in turn."""
    return [one / other for one, other in zip(ones, others, strict=True)]


def rounds_a_second(program: Path, seconds: float) -> Callable[[], float]:
    """Return what runs a program on and tells its rounds a CPU second."""
    board = settled(program)
    rounds = rounds_of(board)

    return lambda: rate(rounds, lambda: stretch(board, seconds)) or sys.exit(f"bench: {program.stem} does not run")


def faults(folder: Path) -> None:
    """A handled fault against an SVC."""
    calls, handled = in_turn(
        rounds_a_second(build("loop", folder, "-DBENCH_SVC"), LOOP_S),
        rounds_a_second(build("loop", folder, "-DBENCH_UDF"), LOOP_S),
    )
    row("an SVC and its return", [1e6 / rounds for rounds in calls], "{:.2f} us", "CPU time of a round")
    row("a handled UDF: rounds to those of SVC", ratios(handled, calls), "{:.2f}", "goal 0.7")


def polling(folder: Path) -> None:
    """Registers that are read or written over and over."""
    for name, option in POLLED.items():
        board = settled(build("loop", folder, option))
        row(f"polling {name}, 72 MHz", several(factor, board, LOOP_S), TIMES_REAL, "goal 1")


def unoptimised(folder: Path) -> None:
    """The same source at -O0 and at -O2, and each restored from its snapshot."""
    boards, restored = [], []
    for level in ("-O2", "-O0"):
        program = build("compute", folder, level)
        boards.append(settled(program))
        boards[-1].advance_to(boards[-1].now_ns + NS_PER_S // 10)
        restored.append(BluePill(program))
        restored[-1].restore(boards[-1].snapshot())
        stretch(restored[-1], COMPUTE_S / 10)
    everyone = [*boards, *restored]
    fast, slow, again, slow_again = in_turn(*(lambda board=board: stretch(board, COMPUTE_S) for board in everyone))
    mega = [72 * COMPUTE_S / statistics.median(took) for took in (fast, slow)]
    row("compute, Mcycles a CPU second: -O2, -O0", f"{mega[0]:.0f}, {mega[1]:.0f}")
    row("compute, -O0 to -O2 in Mcycles a CPU second", ratios(fast, slow), "{:.2f}", "goal 0.7")
    for name, own, other in (("-O2", fast, again), ("-O0", slow, slow_again)):
        row(f"compute {name}, restored on another board", ratios(own, other), "{:.2f}", "of itself; goal 0.9 to 1.1")


def idle(folder: Path) -> None:
    """Sleep between interrupts of 1 kHz."""
    board = settled(build("systick", folder))
    row("asleep between SysTicks of 1 kHz", several(factor, board, IDLE_S), "{:.0f} x real", "goal 150")


if __name__ == "__main__":
    sys.exit(print_tables(faults, polling, unoptimised, idle, needs=(CROSS_COMPILER,)))
