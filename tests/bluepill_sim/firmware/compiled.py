"""The programs of this folder, compiled."""

import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
COMPILER = "arm-none-eabi-gcc"
FLAGS = ("-mcpu=cortex-m3", "-mthumb", "-std=c11", "-g", "-Wall", "-Wextra", "-Werror", "-ffreestanding", "-nostdlib")


def compiled(name: str, folder: Path, level: str, *options: str) -> Path:
    """Return the ELF of a program, such as "timers", at a level of optimisation, such as "-Og", with more options."""
    path = folder / f"{name}.elf"
    link = ("-Wl,--build-id=none", "-T", str(HERE / "exercise.ld"), str(HERE / f"{name}.c"), "-lgcc", "-o", str(path))
    subprocess.run([COMPILER, *FLAGS, level, *options, *link], check=True)
    return path
