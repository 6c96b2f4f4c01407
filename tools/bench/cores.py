"""Print how fast the cores of `P2OS_CORE` are to the default one, on programs of tools/bench/firmware.

Each figure is of rounds the program makes in a CPU second, the cores in turn in one process, and the median of the
pairs. Usage: python tools/bench/cores.py [--quick] [CORE ...]; without a name it is `own`.
"""

import statistics
import sys
from collections.abc import Callable
from pathlib import Path

from emulator import board, build, rate, rounds_of
from measuring import CROSS_COMPILER, IS_QUICK, print_tables, row

#: What computes, and what is for the pins; virtual seconds of a turn.
PROGRAMS = {"compute": 1.0, "mix": 1.0, "crc": 1.0, "gpio": 0.3, "bitbang": 0.3, "usart": 1.0, "systick": 20.0}
PAIRS = 3 if IS_QUICK else 7


def compared(name: str, core: str, folder: Path) -> list[float]:
    """Return the rounds of a core to those of the default one, pair by pair."""
    program = build(name, folder)
    turns: list[Callable[[], float]] = []
    for each in ("native", core):
        made = board(program, each)
        counted = rounds_of(made) if made.image.symbols.address_of("bench_rounds") else lambda made=made: made.now_ns
        span_ns = round(PROGRAMS[name] * 1e9)
        turns.append(
            lambda made=made, counted=counted, span=span_ns: rate(counted, lambda: made.advance_to(made.now_ns + span))
        )
    pairs = [[turn() for turn in turns] for _ in range(PAIRS + 1)]
    return [ours / default for default, ours in pairs[1:]]  # the first warms up


def ratios(folder: Path) -> None:
    """Each program on each core that is asked for."""
    cores = [word for word in sys.argv[1:] if not word.startswith("-")] or ["own"]
    for core in cores:
        for name in PROGRAMS:
            found = compared(name, core, folder)
            note = f"{min(found):.2f} to {max(found):.2f}, of {len(found)} pairs"
            row(f"{name}, {core} to native", statistics.median(found), "{:.2f}", note)


if __name__ == "__main__":
    sys.exit(print_tables(ratios, needs=(CROSS_COMPILER,)))
