"""Build the adapter's core for other machines: `python adapter_fw/build.py [TARGET …] [--out DIR]`.

    host       the self-test, with sanitizers
    program    p2os-adapter: the adapter as a PC program on any line (host/)
    units      checks of the core's single parts, with sanitizers
    esp32-…    the ESP32's whole program with simulated hardware under it, as a shared library (esp32_sim/):
               boards rev_b and rev_c, rev_b with a game pad
    library    the Arduino library against a robot of a few lines, with sanitizers (library/)
    replay     the fuzzing target with its corpus' reader, with sanitizers (fuzz/)
    cortex-m   the self-test on an STM32F103
    bluepill   the adapter itself on an STM32F103, its USART as the P2OS line (bluepill/)
    xtensa     the self-test on an ESP8266's core
    esp32-core the same for an ESP32's memory, without its system: code in IRAM, what is read in bytes in DRAM
    esp32-windows  the same for the ESP32's processor: its instructions and windowed calls, by LLVM; to be linked and
               measured, not to be run: it has no handler for the exception of MOVSP

Prints how much flash and RAM the core alone takes. ESP-IDF builds the image of an ESP32
(docs/adapter-firmware.md, Builds).
"""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

HERE = Path(__file__).resolve().parent
BLUEPILL = HERE.parent / "robot_bench" / "firmware"
SELFTEST = HERE / "selftest"
#: Objects by what they were made of; deleting the folder costs a minute.
OBJECTS = HERE / "build" / "objects"
CORE = tuple(sorted((HERE / "core").rglob("*.cpp")))
TRIAL = (SELFTEST / "selftest.cpp", SELFTEST / "robot.cpp", SELFTEST / "report.cpp")

#: Everywhere: no exceptions, no run-time types, no guards, nothing of a C++ library.
CXX_FLAGS = (
    "-std=c++17", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror", "-fno-exceptions", "-fno-rtti",
    "-fno-threadsafe-statics", "-ffunction-sections", "-fdata-sections",
)  # fmt: skip
SANITIZERS = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
CORTEX_M = ("-mcpu=cortex-m3", "-mthumb")


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """A machine to build for, and what is built beside the core."""

    output: str
    compiler: str
    package: str
    flags: tuple[str, ...]
    #: For the sources beside the core only, whose objects other targets share.
    own_flags: tuple[str, ...] = ()
    sources: tuple[Path, ...]
    link: tuple[str, ...] = ()
    after: tuple[str, ...] = ()
    #: Whether the size of the core is printed.
    is_small: bool = False
    #: A linker of its own; "": the compiler links.
    linker: str = ""
    #: An assembler for what the compiler writes, with its literals in a section of their own.
    assembler: tuple[str, ...] = ()
    size_tool: str = ""

    @property
    def tools(self) -> tuple[str, ...]:
        """Return the programs that it is built with."""
        return tuple(filter(None, (self.compiler, self.linker, *self.assembler[:1])))


def _on_host(output: str, *sources: Path, include: tuple[Path, ...] = ()) -> Target:
    folders = tuple(word for folder in include for word in ("-isystem", str(folder)))
    return Target(
        output=output, compiler="g++", package="g++", flags=SANITIZERS, own_flags=folders, sources=sources,
        link=SANITIZERS,
    )  # fmt: skip


def _on_simulated_esp32(board: str, pad: str) -> Target:
    """Return the program of esp32/ for this machine: no sanitizer, for another program loads it."""
    flags = ("-O1", "-g", "-fPIC")
    headers = (
        "-I",
        str(HERE / "esp32_sim"),
        "-isystem",
        str(HERE / "stubs" / "esp32"),
        "-I",
        str(HERE / "generated" / board),
    )
    program = (path for path in sorted((HERE / "esp32" / "main").glob("*.cpp")) if not path.stem.startswith("pad_"))
    return Target(
        output=f"esp32-{board}-{pad}.so", compiler="g++", package="g++", flags=flags,
        # The ESP32's size_t has the 32 bits that its drivers take.
        own_flags=(*headers, "-Wno-conversion", '-DADAPTER_ROBOT="p2dx"'),
        sources=(*program, HERE / "esp32" / "main" / f"pad_{pad}.cpp", *sorted((HERE / "esp32_sim").glob("*.cpp"))),
        link=("-shared", "-Wl,-z,relro,-z,now"),
    )  # fmt: skip


def _on_cortex_m(output: str, *sources: Path) -> Target:
    return Target(
        output=output,
        compiler="arm-none-eabi-g++",
        package="gcc-arm-none-eabi libstdc++-arm-none-eabi-newlib",
        flags=(*CORTEX_M, "-Os", "-g", "-ffreestanding"),
        sources=(*sources, SELFTEST / "bare_memory.cpp", BLUEPILL / "startup.c"),
        link=(*CORTEX_M, "-nostdlib", "-Wl,--gc-sections", "-T", str(BLUEPILL / "f103c8.ld")),
        after=("-lgcc",),
        is_small=True,
    )


def _on_xtensa(start: str, layout: str) -> Target:
    folder = SELFTEST / "xtensa"
    return Target(
        output=f"selftest-{layout.removesuffix('.ld')}.elf",
        compiler="xtensa-lx106-elf-g++",
        package="gcc-xtensa-lx106",
        flags=("-Os", "-g", "-ffreestanding", "-mlongcalls", "-mtext-section-literals",
               "-isystem", str(folder / "include")),
        sources=(*TRIAL, folder / "main.cpp", SELFTEST / "bare_memory.cpp", folder / start, folder / "arithmetic.c"),
        link=("-nostdlib", "-Wl,--gc-sections", "-T", str(folder / layout)),
        after=("-lgcc",),
        is_small=True,
    )  # fmt: skip


#: What an ESP32 has, by LLVM's names; its front end does not know the processor itself.
ESP32_FEATURES = (
    "density", "windowed", "bool", "loop", "sext", "nsa", "clamps", "minmax", "mul32", "mul32high", "mul16", "div32",
    "mac16", "s32c1i", "threadptr", "fp",
)  # fmt: skip
#: LLVM 22 finds no instruction for a constant that its combiner has made in these; without that they are larger.
UNCOMBINED = frozenset({"encoders.cpp"})


def _on_esp32_with_windows() -> Target:
    folder = SELFTEST / "xtensa"
    features = tuple(word for name in ESP32_FEATURES for word in ("-Xclang", "-target-feature", "-Xclang", f"+{name}"))
    return Target(
        output="selftest-esp32-windows.elf",
        compiler="clang++-22",
        package="clang-22 llvm-22 binutils-xtensa-lx106",
        flags=("--target=xtensa", *features, "-Os", "-ffreestanding", "-nostdlibinc", "-isystem",
               str(folder / "include")),
        sources=(*TRIAL, folder / "main.cpp", SELFTEST / "bare_memory.cpp", folder / "esp32_windows.S",
                 folder / "arithmetic.c"),
        linker="xtensa-lx106-elf-ld",
        link=("--no-relax", "--gc-sections", "-z", "noexecstack", "-T", str(folder / "esp32.ld")),
        is_small=True,
        assembler=("llvm-mc-22", "-arch=xtensa", "-mcpu=esp32", "-filetype=obj"),
        size_tool="xtensa-lx106-elf-size",
    )  # fmt: skip


TARGETS = {
    "host": _on_host("selftest-host", *TRIAL, SELFTEST / "host.cpp"),
    "program": _on_host("p2os-adapter", *sorted((HERE / "host").glob("*.cpp"))),
    "esp32-rev_b": _on_simulated_esp32("rev_b", "none"),
    "esp32-rev_b-pad": _on_simulated_esp32("rev_b", "bluepad32"),
    "esp32-rev_c": _on_simulated_esp32("rev_c", "none"),
    "units": _on_host("units", *sorted((SELFTEST / "units").glob("*.cpp")), SELFTEST / "robot.cpp"),
    "library": _on_host(
        "library", SELFTEST / "library.cpp", SELFTEST / "robot.cpp", HERE / "library" / "src" / "P2OSClient.cpp",
        include=(HERE / "core", HERE / "library" / "src", HERE / "stubs" / "arduino"),
    ),
    "replay": _on_host("replay", *sorted((HERE / "fuzz").glob("*.cpp")), SELFTEST / "robot.cpp"),
    "cortex-m": _on_cortex_m("selftest-cortex-m.elf", *TRIAL, SELFTEST / "cortex_m.cpp"),
    "bluepill": _on_cortex_m("adapter-bluepill.elf", *sorted((HERE / "bluepill").glob("*.cpp"))),
    "xtensa": _on_xtensa("start.S", "sim.ld"),
    "esp32-core": _on_xtensa("esp32.S", "esp32.ld"),
    "esp32-windows": _on_esp32_with_windows(),
}  # fmt: skip


def is_installed(name: str) -> bool:
    """Tell whether a target's compiler and what else it needs is there."""
    return all(shutil.which(tool) is not None for tool in TARGETS[name].tools)


def build(name: str, output: Path) -> dict[str, int]:
    """Build a target; return the flash and RAM of the core alone, in bytes.

    Raises:
        subprocess.CalledProcessError: The compiler refused; its words are on stderr.
    """
    target = TARGETS[name]
    objects = {source: _compile(target, source) for source in (*CORE, *target.sources)}
    linker = target.linker or target.compiler
    with _replacing(output) as beside:  # who starts it meanwhile gets the last one
        _run([linker, *target.link, *map(str, objects.values()), *target.after, "-o", str(beside)])
    return _size(target, [objects[source] for source in CORE])


def _compile(target: Target, source: Path) -> Path:
    """Compile a source unless the same has been compiled before."""
    is_cxx = source.suffix == ".cpp"
    compiler = target.compiler if is_cxx else target.compiler.replace("clang++", "clang").replace("g++", "gcc")
    flags = (*(CXX_FLAGS if is_cxx else ("-Wall",)), *target.flags, *(() if source in CORE else target.own_flags))
    if target.assembler and source.name in UNCOMBINED:
        flags = (*flags, "-mllvm", "--combiner-disabled")
    command = [compiler, *flags, "-S" if target.assembler else "-c", str(source)]
    words = [word.replace(f"{HERE}", "") for word in command]  # a copy of the checkout makes the same
    made_of = hashlib.sha256("\0".join([_version(compiler), _headers(), *words]).encode() + source.read_bytes())
    result = OBJECTS / f"{source.stem}-{made_of.hexdigest()[:24]}.o"
    if not result.exists():
        OBJECTS.mkdir(parents=True, exist_ok=True)
        with _replacing(result) as beside:
            if not target.assembler:
                _run([*command, "-o", str(beside)])
            elif source.suffix == ".S":
                _run([*target.assembler, str(source), "-o", str(beside)])
            else:
                _compile_and_assemble(target, command, beside)
    return result


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """Lend a file that takes the place of another when it is whole."""
    beside = path.with_name(f"{path.name}.{os.getpid()}")
    yield beside
    beside.replace(path)


def _compile_and_assemble(target: Target, command: list[str], output: Path) -> None:
    """Compile to text, put the literals into a section of their own, and assemble it.

    LLVM's own assembler leaves those of a function unaligned at the end of the function before.
    """
    text = subprocess.run([*command, "-o", "-"], stdout=subprocess.PIPE, text=True, check=True).stdout
    text = text.replace("\t.literal_position", '\t.section .literal,"ax",@progbits\n\t.p2align 2')
    text = re.sub(r"^\t\.literal ([^,]+), (.+)$", r"\1:\n\t.4byte \2", text, flags=re.MULTILINE)
    subprocess.run([*target.assembler, "-o", str(output), "-"], input=text, text=True, check=True)


@cache
def _version(compiler: str) -> str:
    return subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True).stdout


@cache
def _headers() -> str:
    """Return what all headers together hash to: any of them may be included by any source."""
    headers = sorted(path for path in HERE.rglob("*") if path.suffix in {".hpp", ".h"} or path.parent.name == "include")
    return hashlib.sha256(b"".join(path.read_bytes() for path in headers)).hexdigest()


def _size(target: Target, objects: list[Path]) -> dict[str, int]:
    """Return the sums of `size`: code and constants are flash, variables are RAM."""
    tool = target.size_tool or target.compiler.removesuffix("g++") + "size"
    done = subprocess.run([tool, *map(str, objects)], capture_output=True, text=True, check=True)
    rows = [[int(word) for word in line.split()[:3]] for line in done.stdout.splitlines()[1:]]
    return {"flash": sum(row[0] + row[1] for row in rows), "ram": sum(row[1] + row[2] for row in rows)}


def _run(command: list[str]) -> None:
    subprocess.run(command, check=True)


def main() -> int:
    """Build what is asked for, and print its size."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )  # fmt: skip
    parser.add_argument("targets", nargs="*", help=f"of {', '.join(TARGETS)}; default: all that can be built here")
    parser.add_argument("--out", type=Path, default=HERE / "build", help="folder for the programs")
    words = parser.parse_args()
    unknown = [name for name in words.targets if name not in TARGETS]
    if unknown:
        print(f"build: there is no target {unknown[0]!r}\nhint: one of {', '.join(TARGETS)}", file=sys.stderr)
        return 2
    words.out.mkdir(parents=True, exist_ok=True)
    for name in words.targets or TARGETS:
        target = TARGETS[name]
        if not is_installed(name):
            missing = next(tool for tool in target.tools if shutil.which(tool) is None)
            print(f"{name}: {missing} is not installed (apt-get install {target.package})")
            continue
        try:
            size = build(name, words.out / target.output)
        except subprocess.CalledProcessError:
            print(f"build: {name}: the compiler's words stand above", file=sys.stderr)
            return 1
        said = f", core {size['flash']} bytes of flash, {size['ram']} bytes of RAM beside the adapter itself"
        if not target.is_small:
            said = ", with sanitizers" if "-fsanitize=address,undefined" in target.flags else ""
        print(f"{name}: {words.out / target.output}{said}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
