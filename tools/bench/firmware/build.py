"""Builds a program of this folder, on the runtime of the example programs; needs arm-none-eabi-gcc."""

import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
RUNTIME = HERE.parents[2] / "robot_bench" / "firmware"
COMPILER = "arm-none-eabi-gcc"
FLAGS = ("-mcpu=cortex-m3", "-mthumb", "-O2", "-ffreestanding", "-nostdlib", "-ffunction-sections", "-Wl,--gc-sections")


def build(source: Path, output: Path, *options: str, runtime: Path = RUNTIME) -> Path:
    """Build a program of one file into an ELF, and return its path; `options` come after `FLAGS`.

    Raises:
        subprocess.CalledProcessError: the compiler refused; its words are on stderr.
        FileNotFoundError: there is no compiler.
    """
    sources = [source, *(runtime / name for name in ("startup.c", "memory.c", "board.c"))]  # of board.c the clock
    linked = [f"-I{runtime}", f"-T{runtime / 'f103c8.ld'}", *map(str, sources), "-lgcc", "-o", str(output)]
    subprocess.run([COMPILER, *FLAGS, *options, *linked], check=True)
    return output
