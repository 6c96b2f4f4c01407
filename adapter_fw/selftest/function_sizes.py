"""Flash and stack of each function of the core against limits: `python adapter_fw/selftest/function_sizes.py`.

The core is compiled as for the Xtensa self-test (build.py): `nm` says what a function takes of flash, the compiler what
it takes of the stack (-fstack-usage); constants and variables stand in the table too. A limit is what was measured when
the table was written, and a tenth. Whoever needs more writes the table anew with --write, and says why in the commit.

An LX106 has the ESP32's instruction set without its windowed calls: sizes are a neighbour's, not its own. Stack is each
function's own frame, not that of the calls in it.
"""

import argparse
import importlib.util
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

HERE = Path(__file__).resolve().parent
TABLE = HERE / "function_sizes.txt"
TARGET = "xtensa"
#: Limits are multiples of this, at least a tenth above what was measured.
STEP = 16
#: Letters of `nm` that stand for flash, and for RAM.
#: All lambdas of one function, or table, count as one.
LAMBDA = re.compile(r"\{lambda.*")
FLASH, RAM = frozenset("tTrRwWvV"), frozenset("dDbB")


@dataclass(frozen=True, slots=True)
class Size:
    """What a function, a constant or a variable takes, in bytes."""

    flash: int = 0
    #: Of the stack by a function, of RAM by a variable.
    ram: int = 0

    def __add__(self, other: "Size") -> "Size":
        """Return both together: clones of one function."""
        return Size(self.flash + other.flash, max(self.ram, other.ram))

    @property
    def limit(self) -> "Size":
        """Return the limit that is written for what was measured."""
        return Size(*(-(-size * 11 // (10 * STEP)) * STEP for size in (self.flash, self.ram)))

    def exceeds(self, limit: "Size") -> bool:
        """Tell whether either is beyond its limit."""
        return self.flash > limit.flash or self.ram > limit.ram


def builder() -> ModuleType:
    """Return build.py, which knows the compiler and its flags."""
    if "adapter_fw_build" not in sys.modules:
        spec = importlib.util.spec_from_file_location("adapter_fw_build", HERE.parent / "build.py")
        assert spec is not None and spec.loader is not None  # noqa: PT018, S101 - it stands above this folder
        sys.modules["adapter_fw_build"] = module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    return sys.modules["adapter_fw_build"]


def version() -> str | None:
    """Return the first line of the compiler's `--version`; None where it is not installed."""
    build = builder()
    if not build.is_installed(TARGET):
        return None
    command = [build.TARGETS[TARGET].compiler, "--version"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]


def measure(sources: tuple[Path, ...] | None = None) -> dict[str, Size]:
    """Compile the core, or these sources, and return the size of everything in it by file and name.

    Raises:
        subprocess.CalledProcessError: The compiler refused; its words are on stderr.
    """
    build = builder()
    target = build.TARGETS[TARGET]
    sizes: dict[str, Size] = {}
    with tempfile.TemporaryDirectory() as folder:
        for source in sources or build.CORE:
            output = Path(folder) / f"{source.parent.name}_{source.stem}.o"
            command = [target.compiler, *build.CXX_FLAGS, *target.flags, "-fstack-usage", "-c", str(source)]
            subprocess.run([*command, "-o", str(output)], check=True)
            for name, size in _of_object(target.compiler.removesuffix("g++") + "nm", output).items():
                key = f"{source.parent.name}/{source.stem} {name}"
                sizes[key] = sizes.get(key, Size()) + size
    return sizes


def _of_object(nm: str, output: Path) -> dict[str, Size]:
    frames: dict[tuple[str, int], int] = {}
    for line in output.with_suffix(".su").read_text(encoding="utf-8").splitlines():
        words, size, _ = line.split("\t")
        key = _signature(words.split(":", 3)[3].partition(" [with ")[0])
        frames[key] = max(frames.get(key, 0), int(size))
    done = subprocess.run([nm, "-S", "-C", str(output)], capture_output=True, text=True, check=True)
    sizes: dict[str, Size] = {}
    for line in done.stdout.splitlines():
        row = line.split(maxsplit=3)
        if len(row) == 4 and row[2] in FLASH | RAM:
            name, size = LAMBDA.sub("lambdas", row[3].partition(" [clone")[0]), int(row[1], 16)
            frame = frames.get(_signature(name), 0)
            sizes[name] = sizes.get(name, Size()) + (Size(0, size) if row[2] in RAM else Size(size, frame))
    return sizes


def _signature(words: str) -> tuple[str, int]:
    """Return a function's name and how many parameters it has: compiler and `nm` spell types differently."""
    words = words.replace("{anonymous}", "(anonymous namespace)").replace("(anonymous namespace)", "<unnamed>")
    before, _, parameters = words.partition("(")
    count = 0 if parameters.startswith(")") or not parameters else parameters.count(",") + 1
    return before.split(" ")[-1], count


def read_table() -> tuple[str, dict[str, Size]]:
    """Return the compiler that the committed limits are for, and the limits."""
    first, *lines = TABLE.read_text(encoding="utf-8").splitlines()
    limits = {}
    for line in lines:
        if not line.startswith("#"):
            flash, ram, name = line.split(maxsplit=2)
            limits[name] = Size(int(flash), int(ram))
    return first.removeprefix("# "), limits


def complaints(measured: dict[str, Size], limits: dict[str, Size]) -> list[str]:
    """Return a line for each size beyond its limit, each that has none, and each limit of what is gone."""
    said = []
    for name, size in sorted(measured.items()):
        limit = limits.get(name)
        if limit is None:
            said.append(f"{name}: {size.flash} of flash, {size.ram} of RAM, and no limit")
        elif size.exceeds(limit):
            said.append(f"{name}: {size.flash} of flash, {size.ram} of RAM, limits {limit.flash} and {limit.ram}")
    return [*said, *(f"{name}: a limit of what is not there" for name in sorted(limits.keys() - measured.keys()))]


def main() -> int:
    """Compare, or write the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write the limits anew")
    words = parser.parse_args()
    compiler = version()
    if compiler is None:
        print("function_sizes: the compiler is not installed\nhint: apt-get install gcc-xtensa-lx106", file=sys.stderr)
        return 2
    measured = measure()
    if words.write:
        rows = [f"{size.limit.flash:6} {size.limit.ram:6}  {name}" for name, size in sorted(measured.items())]
        head = [f"# {compiler}", "# limits in bytes: flash, stack frame (of a variable: RAM), file and name"]
        TABLE.write_text("\n".join([*head, *rows, ""]), encoding="utf-8")
    said = complaints(measured, read_table()[1])
    for line in said:
        print(line)
    flash, frames = sum(size.flash for size in measured.values()), max(size.ram for size in measured.values())
    print(
        f"{len(measured)} names, {flash} bytes of flash, largest frame {frames} bytes; {len(said)} beyond their limits"
    )
    return min(len(said), 1)


if __name__ == "__main__":
    sys.exit(main())
