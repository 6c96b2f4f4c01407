"""How the tables of `make bench` are measured and printed: CPU time, medians of several runs, a line a figure."""

import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

IS_QUICK = "--quick" in sys.argv
RUNS = 1 if IS_QUICK else 5
TIMES_REAL = "{:.2f} x real"
CROSS_COMPILER = "arm-none-eabi-gcc"
#: Debian's packages of the programs that are needed.
PACKAGES = {CROSS_COMPILER: "gcc-arm-none-eabi", "gcc": "gcc"}


def cpu_s(work: Callable[[], object], clock: Callable[[], float] = time.process_time) -> float:
    """Return the CPU seconds of a piece of work."""
    begin = clock()
    work()
    return clock() - begin


def several(measure: Callable[..., float], *arguments: object) -> list[float]:
    """Return so many measurements as a median wants."""
    return [measure(*arguments) for _ in range(RUNS)]


def row(name: str, found: float | str | Sequence[float], shown: str = "{:.3f}", note: str = "") -> None:
    """Print one line of a table: a figure or its words, or the median of several."""
    if not isinstance(found, (str, int, float)):
        note += f"{'; ' * bool(note)}of {len(found)}"
        found = statistics.median(found)
    figure = found if isinstance(found, str) else shown.format(found)
    print(f"{name:<60} {figure:>14}  {note}", flush=True)


def print_tables(*parts: Callable[[Path], None], needs: Sequence[str] = ()) -> int:
    """Print parts of a table in turn, with a folder for what they make; return 1 without a program that they need."""
    for program in needs:
        if shutil.which(program) is None:
            print(f"bench: no {program} (hint: sudo apt-get install {PACKAGES[program]})")
            return 1
    with tempfile.TemporaryDirectory() as folder:
        for part in parts:
            part(Path(folder))
    return 0
