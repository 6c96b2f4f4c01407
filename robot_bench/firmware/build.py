"""Build the example programs for the BluePill: `python robot_bench/firmware/build.py [--out DIR]`.

Each program is one C file with `main`, most beside the shared board files; the ELF
keeps its debug information with paths relative to this folder, so that the
same compiler gives the same bytes wherever the folder lies.
Source: gcc-arm-none-eabi of Debian 12 (12.2.rel1) built the committed files.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

HERE = Path(__file__).resolve().parent
COMPILER = "arm-none-eabi-gcc"
#: First line of `arm-none-eabi-gcc --version` for the compiler of the committed ELFs.
COMPILER_VERSION = "arm-none-eabi-gcc (15:12.2.rel1-1) 12.2.1 20221205"
#: With the motors' wires as duty and sign, and as three bits.
DUTY_SOURCES = ("startup.c", "memory.c", "board.c", "pins.c", "motors_duty.c", "tick.c", "uart.c")
BOARD_SOURCES = tuple(source.replace("motors_duty", "motors_bits") for source in DUTY_SOURCES)
#: Program name to its sources.
PROGRAMS = {
    "motors": (*BOARD_SOURCES, "motors.c"),
    "sensors": (*BOARD_SOURCES, "sensors.c"),
    "codes": (*BOARD_SOURCES, "codes.c", "odometer.c"),
    "encoders": (*BOARD_SOURCES, "encoders.c", "odometer.c"),
    "analog": (*BOARD_SOURCES, "analog.c"),
    "dodge": (*BOARD_SOURCES, "dodge.c", "dodge_fsm.c", "odometer.c"),
    "dodge_duty": (*DUTY_SOURCES, "dodge.c", "dodge_fsm.c", "odometer.c"),
    # Its pins are its own: of board.c only the clock is kept.
    "rover": ("startup.c", "memory.c", "board.c", "uart.c", "rover_board.c", "rover.c"),
    "usb_echo": ("startup.c", "memory.c", "board.c", "usb_echo.c"),
    # Brings pins, clock and line of its own.
    "board_test": ("startup.c", "memory.c", "board_test.c"),
}
#: Programs that another package ships; they borrow the start-up code of the examples.
SILICON = HERE.parent.parent / "bluepill_sim" / "analysis" / "silicon"
SILICON_PROGRAMS = ("kit", "pins")
MACHINE_FLAGS = ("-mcpu=cortex-m3", "-mthumb")
COMPILE_FLAGS = (
    *MACHINE_FLAGS,
    "-std=c11",
    "-Og",
    "-g",
    "-gdwarf-4",
    "-gno-record-gcc-switches",
    "-Wall",
    "-Wextra",
    "-Wshadow",
    "-Wconversion",
    "-Wmissing-prototypes",
    "-Werror",
    "-ffreestanding",
    "-ffunction-sections",
    "-fdata-sections",
    "-fno-common",
    "-fno-tree-loop-distribute-patterns",  # memset is not to become a call of itself
)
_INCLUDED = re.compile(rb'^ *# *include *"([^"]+)"', re.MULTILINE)
#: Objects of this process by source, its text and what it includes, and flags; where it lies changes no byte. Programs
#: share most of their sources, and a copy of one with a change all but that.
_OBJECTS: dict[tuple[str, tuple[bytes, ...], tuple[str, ...]], bytes] = {}
LINK_FLAGS = (
    *MACHINE_FLAGS,
    "-nostdlib",
    "-Wl,--gc-sections",
    "-Wl,--build-id=none",
    "-Wl,--fatal-warnings",
    "-Wl,-z,max-page-size=4",
)


def compiler_version() -> str | None:
    """Return the first line of the compiler's `--version`; None where it is not installed."""
    try:
        done = subprocess.run([COMPILER, "--version"], capture_output=True, text=True, check=True)  # noqa: S603
    except FileNotFoundError:
        return None
    return done.stdout.splitlines()[0]


def build_elf(
    sources: tuple[str, ...], *, folder: Path, linker_script: str, output: Path, more_flags: tuple[str, ...] = ()
) -> None:
    """Compile and link `sources` of `folder` into the ELF `output`; `more_flags` come after those of all programs.

    Raises:
        subprocess.CalledProcessError: The compiler refused; its words are on stderr.
    """
    headers = subprocess.run([COMPILER, "-print-file-name=include"], capture_output=True, text=True, check=True)  # noqa: S603
    prefix_maps = (f"-ffile-prefix-map={folder}=.", f"-ffile-prefix-map={headers.stdout.strip()}=gcc")
    with tempfile.TemporaryDirectory() as scratch:
        objects = []
        for source in sources:
            target = Path(scratch) / source.replace("/", "_").replace(".c", ".o")
            made_of = source, _texts(source, folder), more_flags
            if made_of in _OBJECTS:
                target.write_bytes(_OBJECTS[made_of])
            else:
                _run([COMPILER, *COMPILE_FLAGS, *more_flags, *prefix_maps, "-c", source, "-o", str(target)], folder)
                _OBJECTS[made_of] = target.read_bytes()
            objects.append(str(target))
        _run([COMPILER, *LINK_FLAGS, "-T", linker_script, *objects, "-lgcc", "-o", str(output)], folder)
    output.chmod(0o644)


def build_programs(output_folder: Path) -> list[Path]:
    """Build every example program into `output_folder` and return the ELFs."""
    built = []
    for name, sources in PROGRAMS.items():
        output = output_folder.resolve() / f"{name}.elf"
        build_elf(sources, folder=HERE, linker_script="f103c8.ld", output=output)
        built.append(output)
    return built


def build_altered(program: str, edits: Sequence[tuple[str, str]], output: Path) -> Path:
    """Build an example program with lines of its sources changed, as a fault that searches have to find.

    Args:
        program: Of `PROGRAMS`.
        edits: What stands once in all of its sources, and what takes its place.
        output: The ELF.

    Raises:
        ValueError: A text stands there never, or more than once.
    """
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch).resolve() / "sources"
        shutil.copytree(HERE, folder)
        for right, wrong in edits:
            texts = {name: (folder / name).read_text(encoding="utf-8") for name in PROGRAMS[program]}
            holding = [name for name, text in texts.items() if right in text]
            if sum(text.count(right) for text in texts.values()) != 1:
                raise ValueError(f"{right!r} does not stand once in the sources of {program}")
            (folder / holding[0]).write_text(texts[holding[0]].replace(right, wrong), encoding="utf-8")
        build_elf(PROGRAMS[program], folder=folder, linker_script="f103c8.ld", output=output.resolve())
    return output


def build_silicon(program: str, output: Path) -> Path:
    """Build a program of `SILICON_PROGRAMS` into the ELF `output` and return its path."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch).resolve()
        for source in (
            SILICON / f"{program}.c",
            *(HERE / name for name in ("startup.c", "memory.c", "f103.h", "f103c8.ld")),
        ):
            shutil.copy(source, folder)
        build_elf(
            ("startup.c", "memory.c", f"{program}.c"), folder=folder, linker_script="f103c8.ld", output=output.resolve()
        )  # fmt: skip
    return output


def _texts(source: str, folder: Path) -> tuple[bytes, ...]:
    """Return what a source and the files beside it that it includes say."""
    found, waiting = dict[Path, bytes](), [folder / source]
    while waiting:
        path = waiting.pop()
        if path not in found and path.is_file():
            found[path] = path.read_bytes()
            names = [name.decode() for name in _INCLUDED.findall(found[path])]
            waiting += (place / name for name in names for place in (path.parent, folder))
    return tuple(found.values())


def _run(command: list[str], folder: Path) -> None:
    subprocess.run(command, cwd=folder, check=True)  # noqa: S603


def main() -> int:
    """Build, and print the size of each file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=HERE, help="folder for the ELFs (default: beside the sources)")
    folder = parser.parse_args().out
    version = compiler_version()
    if version is None:
        print(f"build: {COMPILER} is not installed\nhint: apt-get install gcc-arm-none-eabi", file=sys.stderr)  # noqa: T201
        return 2
    if version != COMPILER_VERSION:
        print(f"build: note: {version} gives other bytes than {COMPILER_VERSION}", file=sys.stderr)  # noqa: T201
    beside = SILICON if folder == HERE else folder
    silicon = [build_silicon(program, beside / f"{program}.elf") for program in SILICON_PROGRAMS]
    for elf in (*build_programs(folder), *silicon):
        print(f"{elf.name}: {elf.stat().st_size} bytes")  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
