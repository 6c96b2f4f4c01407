"""What each use of the project brings: lines, size of wheels, processor time of the imports, size when installed.

    make wheels && python -m tools.packaging.closures

A use is done in a process of its own, and what that has loaded at its end is the closure: modules, and parts in C with
all their sources. What is imported for it is then imported anew in fresh processes, in the same order; their
processor time is told without that of Python's own start, the median of `ROUNDS`, the uses in turn. Wheels are those
in dist/; installed are what they hold and the packages of others that they need, in the size that those have here.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tools.packaging.staging import ROOT, House, houses

ROUNDS = 7
ELF = ROOT / "robot_bench" / "firmware" / "motors.elf"

#: Use → the house that brings it, and a program that does it, with `tmp` as an empty folder.
USES: Mapping[str, tuple[str, str]] = {
    "`Robot`": ("p2os", "from p2os import Robot"),
    "a served Pioneer": (
        "p2os",
        """
from p2os import served_pioneer
with served_pioneer(body="kinematic"):
    pass
""",
    ),
    "the emulator": (
        "bluepill-sim",
        f"""
from bluepill_sim.__main__ import run
assert run(["run", {str(ELF)!r}, "--for", "1ms"]) == 0
""",
    ),
    "a scenario's run": (
        "robot-bench",
        """
from p2os.cli.main import run
assert run(["run", "motors", "--body", "kinematic", "--duration", "50ms", "--out", f"{tmp}/run"]) == 0
""",
    ),
}

#: Around a program: what it has loaded, as JSON in the last line.
LOOK = """
import json, sys
before, parts = set(sys.modules), []
sys.addaudithook(lambda event, words: parts.append(str(words[0])) if event == "ctypes.dlopen" and words[0] else None)
tmp = {tmp!r}
{program}
loaded = [name for name in sys.modules if name not in before and name != "__mp_main__"]
files = [getattr(sys.modules[name], "__file__", None) for name in loaded]
print("\\n" + json.dumps({{"modules": loaded, "files": [file for file in files if file], "parts": parts}}))
"""

#: Imports modules again, and tells the processor time.
IMPORT = """
import contextlib, importlib, json, sys, time
names = json.loads(sys.argv[1])
begun_s = time.process_time()
for name in names:
    with contextlib.suppress(ImportError):
        importlib.import_module(name)
print(time.process_time() - begun_s)
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Closure:
    """What a use has loaded."""

    modules: Sequence[str]  # of anybody, in the order of loading
    python_lines: int  # of the project
    c_lines: int  # of its parts in C and C++


def closure(python: Path, root: Path, program: str) -> Closure:
    """Return what a program loads.

    Args:
        python: That runs it, where the project is installed from `root`.
        root: A checkout.
        program: Python, which may name `tmp`.

    Raises:
        CalledProcessError: The program failed; its words are in `stderr`.
    """
    with tempfile.TemporaryDirectory() as folder:
        done = _run(python, root, LOOK.format(tmp=folder, program=program))
    found = json.loads(done.splitlines()[-1])
    files = {Path(file) for file in found["files"] if Path(file).is_relative_to(root) and "site-packages" not in file}
    parts = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["ext-modules"]
    libraries = [name.replace("\\", "/") for name in found["parts"]]
    in_c = {
        path
        for part in parts if any(f"/{part['name'].replace('.', '/')}." in name for name in libraries)
        for pattern in (*part["sources"], *part.get("depends", ())) for path in root.glob(pattern)
    }  # fmt: skip
    return Closure(modules=found["modules"], python_lines=lines(files), c_lines=lines(in_c))


def lines(files: set[Path]) -> int:
    """Return how many lines files have, with those that are empty or comments."""
    return sum(len(path.read_bytes().splitlines()) for path in files if path.suffix != ".so")


def import_s(python: Path, root: Path, modules: Sequence[str]) -> float:
    """Return the seconds of processor time that the imports of a fresh process take."""
    return float(_run(python, root, IMPORT, json.dumps(modules)))


def _run(python: Path, root: Path, code: str, *words: str) -> str:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    command = [str(python), "-c", code, *words]
    return subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, check=True).stdout


def needed(house: House, known: Mapping[str, House]) -> list[House]:
    """Return a house and all those that it stands on."""
    below = {one.name: one for name in house.houses for one in needed(known[name], known)}
    return [*below.values(), house]


def wheel(house: House, dist: Path) -> Path:
    """Return the wheel of a house.

    Raises:
        FileNotFoundError: There is none.
    """
    found = sorted(dist.glob(f"{house.name.replace('-', '_')}-*.whl"), key=lambda path: path.stat().st_mtime)
    if not found:
        raise FileNotFoundError(f"{dist}: no wheel of {house.name} (hint: make wheels)")
    return found[-1]


def unpacked_bytes(wheels: Iterable[Path]) -> int:
    """Return the size of what wheels hold."""
    return sum(one.file_size for path in wheels for one in zipfile.ZipFile(path).infolist())


def others(requirements: Iterable[str]) -> dict[str, int]:
    """Return the packages that requirements bring, with what those need themselves: the size of each as it is here.

    Compiled bytecode is not counted.

    Raises:
        PackageNotFoundError: One of them is not installed here.
    """
    found: dict[str, int] = {}
    waiting = [*requirements]
    while waiting:
        wanted = Requirement(waiting.pop())
        name = canonicalize_name(wanted.name)
        if name in found or (wanted.marker is not None and not wanted.marker.evaluate({"extra": ""})):
            continue
        here = distribution(wanted.name)
        files = [Path(str(here.locate_file(file))) for file in here.files or () if "__pycache__" not in file.parts]
        found[name] = sum(path.stat().st_size for path in files if path.is_file())
        waiting += here.requires or ()
    return found


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.packaging.closures", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--dist", type=Path, default=ROOT / "dist", help="folder of the wheels (default: dist)")
    options = parser.parse_args()
    known, python = houses(), Path(sys.executable)
    found = {name: closure(python, ROOT, program) for name, (_, program) in USES.items()}
    spent: dict[str, list[float]] = {name: [] for name in found}
    for _ in range(ROUNDS):
        for name, one in found.items():
            spent[name].append(import_s(python, ROOT, one.modules))
    print("| use | `pip install` | Python, lines | C, lines | wheels, kB | imports, s | installed, MB |")
    print("|---|---|---|---|---|---|---|")
    for name, (house, _) in USES.items():
        all_needed = needed(known[house], known)
        wheels = [wheel(each, options.dist) for each in all_needed]
        wheels_kb = sum(path.stat().st_size for path in wheels) / 1e3
        installed = unpacked_bytes(wheels) + sum(others(each for one in all_needed for each in one.requires).values())
        one = found[name]
        print(f"| {name} | `{house}` | {one.python_lines} | {one.c_lines} | {wheels_kb:.0f} "
              f"| {statistics.median(spent[name]):.2f} | {installed / 1e6:.0f} |")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
