"""Fuzzing that is guided by coverage: `python -m tools.fuzz.guided [TARGET …] [--seconds S] [--keep]`.

The targets are those of `protocol.py` and `chip.py`, and every format of `files.py` as bytes. atheris (libFuzzer for
Python, from PyPI, on Python 3.11 only) counts which branches an input reaches and keeps those that reach new ones. A
search begins at the seeds of a target and at what is kept of it in `corpus/`, one input a line in hex, and goes on in
`build/fuzz`; `--keep` keeps the shortest of those that reached something new. Tests read the kept inputs without
atheris. The adapter's C++ is searched by `adapter_fw/fuzz/search.py`.
"""

import argparse
import importlib.util
import random
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from hashlib import sha256
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CORPUS = Path(__file__).with_name("corpus")
WORK = ROOT / "build" / "fuzz"
#: What is looked into.
PACKAGES = ["simbase", "p2os", "bluepill_sim", "adapter_sim", "robot_bench"]
#: chosen: a search looks at longer inputs than are kept; what is kept of a target is read in a second.
LONGEST_SEARCHED, LONGEST_KEPT, MOST_KEPT = 1024, 256, 48
#: A slower input is a finding.
SLOWEST_S = 20


def chosen(name: str) -> tuple[Callable[[bytes], object], list[bytes]]:
    """Return a target and its seeds.

    Raises:
        KeyError: There is none of that name.
    """
    for module in map(
        import_module, ("tools.fuzz.protocol", "tools.fuzz.chip")
    ):  # one by one: it takes seconds, guided
        if name in module.TARGETS:
            return module.TARGETS[name], module.seeds(name)
    from tools.fuzz import files

    form = files.FORMATS[name]
    begun, held = form.seeds(), ExitStack()
    folder = Path(held.enter_context(tempfile.TemporaryDirectory()))
    for file, data in {file: data for one in begun for file, data in one.beside.items()}.items():
        (folder / file).write_bytes(data)

    def use(data: bytes, _held: ExitStack = held) -> None:
        files.run_case(name, begun[0], data, folder, random.Random(0))

    return use, [one.data for one in begun]


def names() -> list[str]:
    """Return all targets."""
    from tools.fuzz import chip, files, protocol

    return [*protocol.TARGETS, *chip.TARGETS, *files.FORMATS]


def begins_with(seeds: list[bytes]) -> list[bytes]:
    """Return those seeds that a search begins with: the short ones, or else the shortest."""
    longest = max([LONGEST_SEARCHED, min(map(len, seeds), default=0)])
    return [each for each in seeds if len(each) <= longest]


def kept(name: str) -> list[bytes]:
    """Return the inputs of a target that were worth keeping."""
    path = CORPUS / f"{name}.hex"
    return [bytes.fromhex(line) for line in path.read_text().splitlines()] if path.exists() else []


def keep(name: str, inputs: list[bytes]) -> None:
    """Keep the shortest of a target's inputs."""
    shortest = sorted({each for each in inputs if len(each) <= LONGEST_KEPT}, key=lambda each: (len(each), each))
    CORPUS.mkdir(exist_ok=True)
    (CORPUS / f"{name}.hex").write_text("".join(f"{each.hex()}\n" for each in shortest[:MOST_KEPT]))


def fill(folder: Path, inputs: list[bytes]) -> None:
    """Write inputs as the files that a search begins with."""
    folder.mkdir(parents=True, exist_ok=True)
    for each in inputs:
        (folder / sha256(each).hexdigest()).write_bytes(each)


def search(name: str, words: list[str]) -> None:
    """Search, in this process: it ends with libFuzzer's exit code."""
    import atheris

    with atheris.instrument_imports(include=PACKAGES, enable_loader_override=False):
        target, _ = chosen(name)
    atheris.Setup([name, *words], target)
    atheris.Fuzz()


def searched(name: str, seconds: int) -> tuple[int, str]:
    """Search in a process of its own; return its exit code, and what it came to in words."""
    _, seeds = chosen(name)
    folder, begun = WORK / name, begins_with([*seeds, *kept(name)])
    fill(folder, begun)
    longest = max(LONGEST_SEARCHED, *map(len, begun))
    limits = (f"-max_len={longest}", f"-timeout={SLOWEST_S}", "-rss_limit_mb=4096", "-print_final_stats=1")
    done = _run(name, f"-max_total_time={seconds}", *limits, f"-artifact_prefix={folder}-", str(folder))
    found = re.findall(r"cov: (\d+) ft: (\d+) corp: (\d+)", done.stderr)
    runs = re.search(r"stat::number_of_executed_units: *(\d+)", done.stderr)
    covered = f"branches {found[-1][0]}, inputs {found[-1][2]}" if found else "nothing covered"
    if done.returncode:
        covered += "\n" + "\n".join(done.stderr.splitlines()[-12:])
    return done.returncode, f"{runs[1] if runs else 0} runs, {covered}"


def _run(name: str, *words: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "tools.fuzz.guided", "--inside", name, *words]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, errors="replace", check=False)


def main() -> int:
    """Search in each target; 1 where one found something, 2 where atheris is missing."""
    if sys.argv[1:2] == ["--inside"]:
        search(sys.argv[2], sys.argv[3:])
        return 0
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"of {', '.join(names())}; all, if none")
    parser.add_argument("--seconds", type=int, default=60, help="how long to search in each")
    parser.add_argument("--keep", action="store_true", help="keep what reached something new in tools/fuzz/corpus")
    words = parser.parse_args()
    if unknown := {*words.targets} - {*names()}:
        parser.error(f"no target {', '.join(sorted(unknown))}")
    if importlib.util.find_spec("atheris") is None:
        print("guided: atheris is not installed\nhint: make mutation-tools, on Python 3.11", file=sys.stderr)
        return 2
    failed = 0
    for name in words.targets or names():
        code, came_to = searched(name, words.seconds)
        failed += bool(code)
        print(f"{name}: {came_to}{f'; FOUND {WORK / name}-*' if code else ''}", flush=True)
        if words.keep and not code:
            keep(name, [path.read_bytes() for path in (WORK / name).iterdir()])
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
