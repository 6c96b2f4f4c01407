"""Build the adapter's core for other machines: `python adapter_fw/build.py [host|cortex-m|xtensa] [--out DIR]`.

Each target is the self-test with the whole core in it. Prints how much flash and
RAM the core alone takes. The ESP32 itself cannot be built here: its compiler is
not in Debian; the Xtensa target has the ESP8266's core, which shares the
instruction set but not the windowed calls.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
BLUEPILL = HERE.parent / "testbench" / "firmware"
SELFTEST = HERE / "selftest"
CORE = tuple(sorted((HERE / "core").rglob("*.cpp")))
COMMON = (*CORE, SELFTEST / "selftest.cpp", SELFTEST / "robot.cpp", SELFTEST / "report.cpp")

#: Everywhere: no exceptions, no run-time types, no guards, nothing of a C++ library.
CXX_FLAGS = (
    "-std=c++17", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror", "-fno-exceptions", "-fno-rtti",
    "-fno-threadsafe-statics", "-ffunction-sections", "-fdata-sections",
)  # fmt: skip
SANITIZERS = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """A machine to build for."""

    compiler: str
    package: str
    flags: tuple[str, ...]
    sources: tuple[Path, ...]
    link: tuple[str, ...] = ()
    after: tuple[str, ...] = ()


TARGETS = {
    "host": Target(
        compiler="g++", package="g++", flags=SANITIZERS, sources=(SELFTEST / "host.cpp",), link=SANITIZERS
    ),
    "cortex-m": Target(
        compiler="arm-none-eabi-g++",
        package="gcc-arm-none-eabi libstdc++-arm-none-eabi-newlib",
        flags=("-mcpu=cortex-m3", "-mthumb", "-Os", "-g", "-ffreestanding"),
        sources=(SELFTEST / "cortex_m.cpp", SELFTEST / "bare_memory.cpp", BLUEPILL / "startup.c"),
        link=("-mcpu=cortex-m3", "-mthumb", "-nostdlib", "-Wl,--gc-sections", "-T", str(BLUEPILL / "f103c8.ld")),
        after=("-lgcc",),
    ),
    "xtensa": Target(
        compiler="xtensa-lx106-elf-g++",
        package="gcc-xtensa-lx106",
        flags=("-Os", "-g", "-ffreestanding", "-mlongcalls", "-mtext-section-literals",
               "-isystem", str(SELFTEST / "xtensa" / "include")),
        sources=(SELFTEST / "xtensa" / "main.cpp", SELFTEST / "bare_memory.cpp", SELFTEST / "xtensa" / "start.S",
                 SELFTEST / "xtensa" / "arithmetic.c"),
        link=("-nostdlib", "-Wl,--gc-sections", "-T", str(SELFTEST / "xtensa" / "sim.ld")),
        after=("-lgcc",),
    ),
}  # fmt: skip


def is_installed(name: str) -> bool:
    """Tell whether a target's compiler is there."""
    return shutil.which(TARGETS[name].compiler) is not None


def build(name: str, output: Path, extra: Iterable[str] = ()) -> dict[str, int]:
    """Build a target's self-test; return the flash and RAM of the core alone, in bytes.

    Raises:
        subprocess.CalledProcessError: The compiler refused; its words are on stderr.
    """
    target = TARGETS[name]
    with tempfile.TemporaryDirectory() as scratch:
        objects = {source: _compile(target, source, Path(scratch)) for source in (*COMMON, *target.sources)}
        _run([target.compiler, *target.link, *extra, *map(str, objects.values()), *target.after, "-o", str(output)])
        return _size(target, [objects[source] for source in CORE])


def _compile(target: Target, source: Path, folder: Path) -> Path:
    result = folder / f"{source.parent.name}_{source.stem}.o"
    is_cxx = source.suffix == ".cpp"
    compiler = target.compiler if is_cxx else target.compiler.replace("g++", "gcc")
    flags = CXX_FLAGS if is_cxx else ("-Wall",)
    _run([compiler, *flags, *target.flags, "-c", str(source), "-o", str(result)])
    return result


def _size(target: Target, objects: list[Path]) -> dict[str, int]:
    """Return the sums of `size`: code and constants are flash, variables are RAM."""
    tool = target.compiler.removesuffix("g++") + "size"
    done = subprocess.run([tool, *map(str, objects)], capture_output=True, text=True, check=True)
    rows = [[int(word) for word in line.split()[:3]] for line in done.stdout.splitlines()[1:]]
    return {"flash": sum(row[0] + row[1] for row in rows), "ram": sum(row[1] + row[2] for row in rows)}


def _run(command: list[str]) -> None:
    subprocess.run(command, check=True)


def main() -> int:
    """Build what is asked for, and say its size."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("targets", nargs="*", help=f"of {', '.join(TARGETS)}; default: all that can be built here")
    parser.add_argument("--out", type=Path, default=HERE / "build", help="folder for the programs")
    words = parser.parse_args()
    unknown = [name for name in words.targets if name not in TARGETS]
    if unknown:
        print(f"build: there is no target {unknown[0]!r}\nhint: one of {', '.join(TARGETS)}", file=sys.stderr)
        return 2
    words.out.mkdir(parents=True, exist_ok=True)
    for name in words.targets or TARGETS:
        if not is_installed(name):
            print(f"{name}: {TARGETS[name].compiler} is not installed (apt-get install {TARGETS[name].package})")
            continue
        size = build(name, words.out / f"selftest-{name}.elf")
        words_of_size = f"core {size['flash']} bytes of flash, {size['ram']} bytes of RAM beside the adapter itself"
        print(f"{name}: {'with sanitizers' if name == 'host' else words_of_size}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
