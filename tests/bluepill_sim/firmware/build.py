"""Build the programs of this folder: `python tests/bluepill_sim/firmware/build.py [--out DIR]`.

`--optimise` builds the one without optimisation with `-O2` as well, to compare the two; that one is not committed.
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

from tests.tools.examples import build as examples

HERE = Path(__file__).resolve().parent
#: Taken from the example programs.
BORROWED = ("startup.c", "memory.c", "f103.h", "f103c8.ld")
#: The programs that are committed, and how each is optimised.
PROGRAMS = {"unoptimised": "-O0", "parts": "-Og"}


def build_program(output: Path, optimisation: str | None = None) -> Path:
    """Build the program that the ELF `output` is called after, and return its path."""
    name = output.stem if output.stem in PROGRAMS else "unoptimised"
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch).resolve()
        for source in (HERE / f"{name}.c", *(examples.HERE / name for name in BORROWED)):
            shutil.copy(source, folder)
        examples.build_elf(
            ("startup.c", "memory.c", f"{name}.c"),
            folder=folder,
            linker_script="f103c8.ld",
            output=output.resolve(),
            more_flags=(optimisation or PROGRAMS[name],),
        )
    return output


def main() -> int:
    """Build, and print the size of each file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=HERE, help="folder for the ELFs (default: beside the sources)")
    parser.add_argument("--optimise", action="store_true", help="build optimised.elf too")
    arguments = parser.parse_args()
    built = [build_program(arguments.out / f"{name}.elf") for name in PROGRAMS]
    if arguments.optimise:
        built.append(build_program(arguments.out / "optimised.elf", "-O2"))
    for elf in built:
        print(f"{elf.name}: {elf.stat().st_size} bytes")  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
