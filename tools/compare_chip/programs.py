"""The programs that are compared: what a checkout has committed or can build, and generated ones; and their inputs.

Files are taken from the old checkout, so that both run the same bytes; the script of what is put in from outside is
made of a seed and the program's name.
"""

import random
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tools.bench.firmware.build import COMPILER, build
from tools.compare_chip.generator import generate, name_of

MS = 1_000_000
#: Where ELF files are committed.
COMMITTED = ("robot_bench/firmware", "tests/bluepill_sim/firmware", "tests/firmware_foreign")
#: Built where there is a compiler, by pattern: with which options.
BUILT = {
    "tools/bench/firmware/*.c": ("-O2", "-O0"),
    "tests/bluepill_sim/firmware/unoptimised.c": ("-O2",),
}
EXERCISE = "tests/bluepill_sim/firmware/exercise"
EXERCISE_FLAGS = ("-mcpu=cortex-m3", "-mthumb", "-std=c11", "-Og", "-g", "-ffreestanding", "-nostdlib")

#: Pins that the example programs read, and all.
INPUTS = (
    "PA4",
    "PA5",
    "PA6",
    "PA7",
    "PB0",
    "PB1",
    "PB10",
    "PB11",
    "PB3",
    "PB4",
    "PB15",
    "PC13",
    "PC14",
    "PC15",
    "PB12",
    "PA0",
)
PINS = (*(f"P{port}{number}" for port in "AB" for number in range(16)), "PC13", "PC14", "PC15")
#: chosen: from within one block to longer than a slice of the bench; most of the time several things come together.
GAPS_NS = (1, 40, 900, 20_000, 333_333, 2_500_000)


@dataclass(frozen=True, slots=True)
class Program:
    """A program that is there, or is made when it is wanted."""

    name: str
    #: Returns its image; builds it, where it has to be built, into a folder.
    image: Callable[[Path], Path]


def programs_of(checkout: Path) -> list[Program]:
    """Return the programs of a checkout; those that a compiler has to build only where there is one."""
    found = [
        Program(path.stem, lambda _folder, path=path: path)
        for place in COMMITTED
        for path in sorted((checkout / place).glob("*.elf"))
    ]
    if shutil.which(COMPILER) is None:
        return found
    runtime = checkout / "robot_bench" / "firmware"

    def built(source: Path, option: str) -> Program:
        name = f"{source.stem}{option}"
        return Program(name, lambda folder: build(source, folder / f"{name}.elf", option, runtime=runtime))

    for pattern, options in BUILT.items():
        found += [built(source, option) for source in sorted(checkout.glob(pattern)) for option in options]
    return [*found, Program("exercise", lambda folder: _exercise(checkout, folder / "exercise.elf"))]


def generated(seed: int, count: int) -> list[Program]:
    """Return generated programs."""
    return [
        Program(name_of(seed, number), lambda folder, number=number: generate(seed, number, folder))
        for number in range(count)
    ]


def chosen(programs: list[Program], names: list[str] | None) -> list[Program]:
    """Return those of some names, or all.

    Raises:
        LookupError: a name is of none.
    """
    if not names:
        return programs
    by_name = {program.name: program for program in programs}
    unknown = [name for name in names if name not in by_name]
    if unknown:
        raise LookupError(f"no such program: {unknown[0]} (hint: {', '.join(by_name)})")
    return [by_name[name] for name in names]


def _exercise(checkout: Path, output: Path) -> Path:
    """Build what the tests call exercise.elf; it has a start of its own."""
    source = checkout / EXERCISE
    linked = ["-T", f"{source}.ld", f"{source}.c", "-lgcc", "-o", str(output)]
    subprocess.run([COMPILER, *EXERCISE_FLAGS, *linked], check=True)
    return output


def script_of(name: str, seed: int, end_ns: int) -> list[list[Any]]:
    """Return what is put in from outside, in order of time: [ns, kind, arguments …] as `probe.put_in` takes them."""
    dice = random.Random(f"{name} {seed}")
    now_ns, script = 0, []
    while (now_ns := now_ns + dice.choice(GAPS_NS)) < end_ns:
        chance = dice.random()
        if chance < 0.75:
            name = dice.choice(INPUTS if dice.random() < 0.8 else PINS)
            script.append([now_ns, "pin", name, dice.choice((True, True, False, False, None))])
        elif chance < 0.98:
            port = dice.choice(("usart1", "usart1", "usart2", "usart3"))
            script.append([now_ns, "receive", port, dice.randbytes(dice.choice((1, 1, 3, 20))).hex()])
        elif chance < 0.995:
            script.append([now_ns, "far baud", "usart1", dice.choice((None, None, 9600, 115_200))])
        else:
            script.append([now_ns, "reset"])
    return script
