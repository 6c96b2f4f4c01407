"""Build the foreign-style program: `python tests/firmware_foreign/build.py [--out DIR]`.

It has its own HAL and `main`; startup code and linker script are those of the
example programs, as every C project for this chip has some.
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

from robot_bench.firmware import build as examples

HERE = Path(__file__).resolve().parent
SOURCES = ("main.c", "hal/hal.c", "hal/hal_cortex.c", "hal/hal_gpio.c", "hal/hal_rcc.c", "hal/hal_uart.c")
#: Taken from the example programs.
BORROWED = ("startup.c", "memory.c", "f103c8.ld")


def build_foreign(output_folder: Path) -> Path:
    """Build `foreign.elf` into `output_folder` and return its path."""
    output = output_folder.resolve() / "foreign.elf"
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch).resolve()
        shutil.copytree(HERE, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("*.elf", "*.py", "__pycache__"))
        for name in BORROWED:
            shutil.copy(examples.HERE / name, folder)
        sources = (*(name for name in BORROWED if name.endswith(".c")), *SOURCES)
        examples.build_elf(sources, folder=folder, linker_script="f103c8.ld", output=output)
    return output


def main() -> int:
    """Build, and print the size of the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=HERE, help="folder for the ELF (default: beside the sources)")
    elf = build_foreign(parser.parse_args().out)
    print(f"{elf.name}: {elf.stat().st_size} bytes")  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
