"""A mutation score of the twins' sameness: `python -m tests.adapter_fw.mutation SIDE [--sample N] [--seed N]`.

One side is changed in one place, and lives (boundaries.py) are lived until the other side differs. The changes come
from well-kept tools: cosmic-ray for the model, universalmutator for the firmware core. A sample is drawn by seed.

Left out before the draw is counted: what does not compile or import, and what the compiler shows to be the same
program. A change that no life notices is listed, unless EQUIVALENT says why no life can. Not changed:
settings and words, whose twins are generated or are texts, and the protocol's model, which is no twin's own.
"""

import argparse
import contextlib
import importlib.util
import random
import signal
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MODEL = tuple(
    f"adapter_sim/{name}.py"
    for name in (
        "adapter",
        "codec",
        "distances",
        "driver",
        "duty",
        "encoders",
        "masters",
        "mixing",
        "pins",
        "receiver",
        "session",
    )
)
FIRMWARE = tuple(
    f"adapter_fw/core/{name}.cpp"
    for name in (
        "adapter/adapter", "adapter/distances", "adapter/driver", "adapter/encoders", "adapter/gamepad",
        "adapter/inputs", "adapter/mixing", "adapter/outputs", "adapter/transitions", "p2os/client", "p2os/decoder",
        "p2os/frame", "p2os/sip",
    )
)  # fmt: skip
SIDES = {"model": MODEL, "firmware": FIRMWARE}
#: Lives until a change counts as unnoticed, and how long one may take: an endless loop is noticed by this.
LIVES, LIFE_LIMIT_S = 120, 20
#: What is asked where no life notices: waves, whole adapters, words.
OWN_TESTS = "tests/adapter_sim"
#: The same on the firmware's side: what no life exercises.
UNITS = (
    *(f"adapter_fw/selftest/units/{name}.cpp" for name in ("main", "console", "parts")),
    "adapter_fw/selftest/robot.cpp",
)
#: Operators of cosmic-ray that change no arithmetic or order: what they break is found by the type check.
LEFT_OUT = ("RemoveDecorator", "ExceptionReplacer", "VariableReplacer", "VariableInserter", "KeywordReplacer")
COMPILE = ("g++", "-std=c++17", "-O1", "-fPIC", "-w", "-fno-exceptions", "-fno-rtti")


@dataclass(frozen=True, slots=True)
class Mutant:
    """One side's file, changed in one place."""

    path: str
    line: int
    before: str
    after: str
    text: str

    @property
    def name(self) -> str:
        """Return where and what the change is."""
        return f"{self.path}:{self.line}: {self.before}  ->  {self.after}"


@cache
def equivalents() -> dict[tuple[str, str, str], str]:
    """Return why a change cannot be noticed, by path, line before and line after."""
    rows = tomllib.loads((Path(__file__).with_name("equivalent_mutants.toml")).read_text(encoding="utf-8"))["mutant"]
    return {(row["path"], row["before"], row["after"]): row["reason"] for row in rows}


def candidates(side: str) -> list[Callable[[], Mutant | None]]:
    """Return every change that the side's tool makes, each to be made when it is drawn.

    Raises:
        ModuleNotFoundError: The tool is not installed: `make mutation-tools`.
    """
    make = {"model": _of_cosmic_ray, "firmware": _of_universalmutator}[side]
    return [change for path in SIDES[side] for change in make(path, (ROOT / path).read_text(encoding="utf-8"))]


def _of_cosmic_ray(path: str, text: str) -> Iterator[Callable[[], Mutant | None]]:
    from cosmic_ray import plugins
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.mutating import mutate_code

    nodes = list(ast_nodes(get_ast(text)))
    for name in sorted(plugins.operator_names()):
        kind = plugins.get_operator(name)
        if kind.arguments() or any(word in name for word in LEFT_OUT):
            continue
        operator = kind()
        for occurrence in range(sum(1 for node in nodes for _ in operator.mutation_positions(node))):
            yield lambda operator=operator, occurrence=occurrence: _mutant(
                path, text, mutate_code(text, operator, occurrence) or text
            )


def _of_universalmutator(path: str, text: str) -> Iterator[Callable[[], Mutant | None]]:
    from universalmutator.mutator import mutants_regexp

    lines = text.splitlines(keepends=True)
    with contextlib.redirect_stdout(None):
        made = mutants_regexp(lines, ruleFiles=["universal.rules", "c_like.rules", "cpp.rules"], ignorePatterns=['"'])
    for number, line, *_ in made:
        changed = "".join([*lines[: number - 1], line, *lines[number:]])
        yield lambda changed=changed: _mutant(path, text, changed)


def _mutant(path: str, text: str, changed: str) -> Mutant | None:
    old, new = text.splitlines(), changed.splitlines()
    place = next((place for place, (one, other) in enumerate(zip(old, new, strict=False)) if one != other), None)
    # What a dataclass is told about itself is for the type check.
    if place is None or old[place].startswith("@dataclass"):
        return None
    return Mutant(path, place + 1, old[place].strip(), new[place].strip(), changed)


class Judge:
    """Lives with a mutant, in a process of its own.

    Args:
        folder: For what is compiled.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._objects: dict[str, Path] = {}
        self._originals: dict[str, str | None] = {}
        self._changed: str | None = None

    def is_other_program(self, mutant: Mutant) -> bool:
        """Tell whether the change compiles, and to something else than the original; before `is_noticed`."""
        original = (ROOT / mutant.path).read_text(encoding="utf-8")
        if mutant.path.endswith(".py"):
            try:
                return _code(mutant.text) != _code(original)
            except (SyntaxError, ValueError):
                return False
        if mutant.path not in self._originals:
            self._originals[mutant.path] = self._assembled(mutant.path, original)
        self._changed = self._assembled(mutant.path, mutant.text)
        return self._changed is not None and self._changed != self._originals[mutant.path]

    def is_noticed(self, mutant: Mutant) -> bool | None:
        """Tell whether a life notices the change; None where the program does not even start."""
        if mutant.path.endswith(".py"):
            changed = self.folder / "mutant.py"
            changed.write_text(mutant.text, encoding="utf-8")
            words = ["--module", mutant.path.removesuffix(".py").replace("/", "."), "--file", str(changed)]
        else:
            words = ["--library", str(self._library(mutant))]
        command = [sys.executable, "-m", "tests.adapter_fw.mutation", "live", *words]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
        if done.returncode == 0 and not mutant.path.endswith(".py"):
            return self._units_notice(mutant)
        return {0: False, IMPORT_FAILED: None}.get(done.returncode, True)

    def _units_notice(self, mutant: Mutant) -> bool:
        """Tell whether the checks of single parts notice it: codes over a restart, gaps, a client without adapter."""
        program = self.folder / "units"
        sources = [str(path.relative_to(ROOT)) for path in (ROOT / "adapter_fw" / "core").rglob("*.cpp")]
        others = [self._object(path) for path in (*sources, *UNITS) if path != mutant.path]
        subprocess.run(["g++", str(self.folder / "mutant.s"), *map(str, others), "-o", str(program)], check=True)
        try:
            done = subprocess.run([program], capture_output=True, check=False, timeout=LIFE_LIMIT_S)
        except subprocess.TimeoutExpired:
            return True
        return done.returncode != 0

    def _assembled(self, path: str, text: str) -> str | None:
        done = subprocess.run(
            [*COMPILE, "-S", "-x", "c++", "-I", str((ROOT / path).parent), "-", "-o", "-"],
            input=text, capture_output=True, text=True, check=False, cwd=(ROOT / path).parent,
        )  # fmt: skip
        return done.stdout if done.returncode == 0 else None

    def _library(self, mutant: Mutant) -> Path:
        assembled = self.folder / "mutant.s"
        assembled.write_text(self._changed or "", encoding="utf-8")
        library = self.folder / "mutant.so"
        others = [self._object(path) for path in _library_sources() if path != mutant.path]
        subprocess.run(["g++", "-shared", str(assembled), *map(str, others), "-o", str(library)], check=True)
        return library

    def _object(self, path: str) -> Path:
        if path not in self._objects:
            self._objects[path] = self.folder / (path.replace("/", "_") + ".o")
            subprocess.run([*COMPILE, "-c", str(ROOT / path), "-o", str(self._objects[path])], check=True)
        return self._objects[path]


def _library_sources() -> list[str]:
    modules = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]["ext-modules"]
    return next(module["sources"] for module in modules if module["name"] == "robot_bench._adapter_firmware")


def _code(text: str) -> bytes:
    """Return a module's instructions without line numbers and documentation."""
    return repr(_parts(compile(text, "mutant", "exec", optimize=2))).encode()


def _parts(code: object) -> object:
    if not hasattr(code, "co_code"):
        return (type(code).__name__, code)
    return code.co_code, code.co_names, tuple(_parts(constant) for constant in code.co_consts)


# The process that lives with a mutant.

#: Exit code where the program does not even start.
IMPORT_FAILED = 3


def live(module: str | None, file: str | None, library: str | None) -> int:
    """Live with a changed module or library; 0 if nothing differs."""
    if module is not None:
        _replace_module(module, str(file))
    try:
        from tests.adapter_fw import boundaries
    except Exception:  # noqa: BLE001 - whatever a changed module does while it is imported
        return IMPORT_FAILED
    if library is not None:
        from robot_bench import adapter

        adapter.built = lambda _: library
    # Its default action ends the process, wherever it loops.
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    for seed in range(LIVES):
        signal.alarm(LIFE_LIMIT_S)
        boundaries.Life(seed).live()
    signal.alarm(0)
    if module is None:
        return 0
    return pytest.main(["-q", "-x", "-n", "0", "-m", "not slow and not soak", "-p", "no:cacheprovider", OWN_TESTS])


def _replace_module(name: str, file: str) -> None:
    class Finder:
        @staticmethod
        def find_spec(wanted: str, *_: object) -> ModuleSpec | None:
            return importlib.util.spec_from_file_location(name, file) if wanted == name else None

    sys.meta_path.insert(0, Finder)


@dataclass(slots=True)
class Score:
    """What became of a sample."""

    noticed: int
    #: Unnoticed, with a reason in the list.
    excused: list[Mutant]
    unnoticed: list[Mutant]

    @property
    def share(self) -> float:
        return self.noticed / (self.noticed + len(self.unnoticed))


def score(side: str, sample: int, seed: int) -> Score:
    """Draw a sample and live with each of it."""
    drawn = candidates(side)
    random.Random(seed).shuffle(drawn)
    result = Score(0, [], [])
    with tempfile.TemporaryDirectory() as folder:
        judge, judged = Judge(Path(folder)), 0
        for change in drawn:
            if judged == sample:
                break
            if (mutant := change()) is None or not judge.is_other_program(mutant):
                continue
            excused = (mutant.path, mutant.before, mutant.after) in equivalents()
            if not excused and (noticed := judge.is_noticed(mutant)) is None:
                continue
            judged += 1
            sys.stderr.write(f"\r{judged} of {sample}")
            if not excused and noticed:
                result.noticed += 1
                continue
            (result.excused if excused else result.unnoticed).append(mutant)
            sys.stderr.write(f"\r{judged}: {'excused' if excused else 'NOT NOTICED'} {mutant.name}\n")
    return result


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("side", choices=[*SIDES, "live"])
    parser.add_argument("--sample", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    for name in ("--module", "--file", "--library"):
        parser.add_argument(name, help=argparse.SUPPRESS)
    words = parser.parse_args()
    if words.side == "live":
        return live(words.module, words.file, words.library)
    result = score(words.side, words.sample, words.seed)
    sys.stdout.write(
        f"{words.side}, seed {words.seed}: {result.noticed} noticed, {len(result.unnoticed)} not, "
        f"{len(result.excused)} cannot be: {100 * result.share:.1f} %\n"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
