"""Print how the emulator fares with faults, polling, unoptimised code, restored chips and sleep.

The chip runs alone; times are CPU time, medians of runs in turn with what they are compared to. The programs are those
of tools/bench/firmware. Usage: python tools/bench/loops.py [--quick]
"""

import shutil
import statistics
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from emulator import RUNS, SETTLED_NS, build, rounds_of, row
from shares import cpu_s

from bluepill_sim import BluePill
from simbase.timing import NS_PER_S

IS_QUICK = "--quick" in sys.argv
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


def stretch(board: BluePill, seconds: float) -> float:
    """Return the CPU seconds of the next virtual seconds."""
    return cpu_s(lambda: board.advance_to(board.now_ns + round(seconds * NS_PER_S)))


def in_turn(*measures: Callable[[], float]) -> list[list[float]]:
    """Return several measurements of each."""
    return list(map(list, zip(*([measure() for measure in measures] for _ in range(RUNS)), strict=True)))


def rounds_a_second(program: Path, seconds: float) -> Callable[[], float]:
    """Return what runs a program on and tells its rounds a CPU second."""
    board = settled(program)
    rounds = rounds_of(board)

    def run() -> float:
        before = rounds()
        took = stretch(board, seconds)
        if rounds() == before:
            sys.exit(f"bench: {program.stem} does not run")
        return (rounds() - before) / took

    return run


def faults(folder: Path) -> None:
    """A handled fault against an SVC."""
    calls, handled = in_turn(
        rounds_a_second(build("loop", folder / "svc", "-DBENCH_SVC"), LOOP_S),
        rounds_a_second(build("loop", folder / "udf", "-DBENCH_UDF"), LOOP_S),
    )
    row("an SVC and its return", f"{1e6 / statistics.median(calls):.2f} us", "CPU time of a round")
    share = statistics.median(b / a for a, b in zip(calls, handled, strict=True))
    row("a handled UDF: rounds to those of SVC", f"{share:.2f}", "goal 0.7")


def polling(folder: Path) -> None:
    """Registers that are read or written over and over."""
    for name, option in POLLED.items():
        board = settled(build("loop", folder / option.removeprefix("-D"), option))
        times = [LOOP_S / stretch(board, LOOP_S) for _ in range(RUNS)]
        row(f"polling {name}, 72 MHz", f"{statistics.median(times):.2f} x real", "goal 1")


def unoptimised(folder: Path) -> None:
    """The same source at -O0 and at -O2, and each restored from its snapshot."""
    boards = {level: settled(build("compute", folder / level, f"-{level}")) for level in ("O2", "O0")}
    restored = {}
    for level, board in boards.items():
        board.advance_to(board.now_ns + NS_PER_S // 10)
        restored[level] = BluePill(folder / level / "compute1.elf")
        restored[level].restore(board.snapshot())
        stretch(restored[level], COMPUTE_S / 10)
    everyone = [*boards.values(), *restored.values()]
    fast, slow, again, slow_again = in_turn(*(lambda board=board: stretch(board, COMPUTE_S) for board in everyone))
    mega = [72 * COMPUTE_S / statistics.median(took) for took in (fast, slow)]
    row("compute, Mcycles a CPU second: -O2, -O0", f"{mega[0]:.0f}, {mega[1]:.0f}")
    ratio = statistics.median(a / b for a, b in zip(fast, slow, strict=True))
    row("compute, -O0 to -O2 in Mcycles a CPU second", f"{ratio:.2f}", "goal 0.7")
    for name, own, other in (("-O2", fast, again), ("-O0", slow, slow_again)):
        ratio = statistics.median(a / b for a, b in zip(own, other, strict=True))
        row(f"compute {name}, restored on another board", f"{ratio:.2f}", "of itself; goal 0.9 to 1.1")


def idle(folder: Path) -> None:
    """Sleep between interrupts of 1 kHz."""
    board = settled(build("systick", folder))
    times = [IDLE_S / stretch(board, IDLE_S) for _ in range(RUNS)]
    row("asleep between SysTicks of 1 kHz", f"{statistics.median(times):.0f} x real", "goal 150")


def main() -> int:
    """Print the table; 1 without a compiler for it."""
    if shutil.which("arm-none-eabi-gcc") is None:
        print("bench: no arm-none-eabi-gcc (hint: sudo apt-get install gcc-arm-none-eabi)")
        return 1
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for level in ("svc", "udf", "O2", "O0", *(option.removeprefix("-D") for option in POLLED.values())):
            (folder / level).mkdir()
        for part in (faults, polling, unoptimised, idle):
            part(folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
