"""Build the program without optimisation: `python tests/bluepill_sim/firmware/build.py [--out DIR]`.

`--optimise` builds it with `-O2` as well, to compare the two; only the first is committed.
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

from robot_bench.firmware import build as examples

HERE = Path(__file__).resolve().parent
#: Taken from the example programs.
BORROWED = ("startup.c", "memory.c", "f103.h", "f103c8.ld")


def build_program(output: Path, optimisation: str = "-O0") -> Path:
    """Build the program into the ELF `output` and return its path."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch).resolve()
        for source in (HERE / "unoptimised.c", *(examples.HERE / name for name in BORROWED)):
            shutil.copy(source, folder)
        examples.build_elf(
            ("startup.c", "memory.c", "unoptimised.c"),
            folder=folder,
            linker_script="f103c8.ld",
            output=output.resolve(),
            more_flags=(optimisation,),
        )
    return output


def main() -> int:
    """Build, and print the size of each file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=HERE, help="folder for the ELF (default: beside the source)")
    parser.add_argument("--optimise", action="store_true", help="build optimised.elf too")
    arguments = parser.parse_args()
    built = [build_program(arguments.out / "unoptimised.elf")]
    if arguments.optimise:
        built.append(build_program(arguments.out / "optimised.elf", "-O2"))
    for elf in built:
        print(f"{elf.name}: {elf.stat().st_size} bytes")  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
