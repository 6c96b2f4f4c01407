"""What programs have shown when somebody looked at it: checksums of traces, line by line, which tests hold them to.

    python -m tests.tools.suite.approved tests/p2os/…/walks/test_*.py            names the traces that are otherwise
    python -m tests.tools.suite.approved tests/p2os/…/walks/test_*.py --write D  writes every trace into a folder
    python -m tests.tools.suite.approved tests/p2os/…/walks/test_*.py --approve  takes what they show now for right

A file of tests has a table of traces, `TRACES`, and the test `judge_of(__file__, TRACES)`; `approved.json` beside it
keeps the checksums. A change that is meant changes traces too: write them before and behind it, read the difference
(`diff -u`), and approve it together with the change.
"""

import argparse
import ast
import importlib
import inspect
import json
import pkgutil
import random
import re
import sys
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from types import FunctionType, ModuleType

import pytest

from simbase.errors import P2osError

#: Draws what is tried, and returns what is seen, a line of text each.
Trace = Callable[[random.Random], Iterable[str]]
#: Digits of a number that every machine works out alike, and below which it is 0.
DIGITS, LEAST = 6, 1e-9
#: What is shorter of a cause is a word of the input, which may stand in a path too.
SHORTEST = 2
#: Characters of a line that a test shows.
SHOWN = 4000
_FRACTION = re.compile(r"-?\d+\.\d{3,}(?:e[-+]?\d+)?|-?\d+e-\d+")


def said(value: object) -> str:
    """Return a value as text, each number of it with so many digits that all machines agree."""
    if isinstance(value, float):
        return f"{0.0 if abs(value) < LEAST else value:.{DIGITS}g}"
    if is_dataclass(value) and not isinstance(value, type):
        return f"{type(value).__name__}{said([getattr(value, part.name) for part in fields(value)])}"
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{said(key)}: {said(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "(" + ", ".join(map(said, value)) + ")"
    return str(value)


def rounded(text: str) -> str:
    """Return a text of a program with each fraction in it as `said` says it."""
    return _FRACTION.sub(lambda found: said(float(found[0])), text)


def tried(action: Callable[..., object], *arguments: object, **named: object) -> str:
    """Return what an action gives, or by which words it refuses."""
    try:
        return said(action(*arguments, **named))
    except (P2osError, ValueError, LookupError, TypeError, ArithmeticError) as error:
        return refusal(error)


def refusal(error: Exception) -> str:
    """Return the words of an error, without those that another version of Python has for its own."""
    words, cause = f"{type(error).__name__}: {error}", error.__cause__
    if cause is not None and not isinstance(cause, P2osError):
        for part in (str(cause), str(cause).partition(" (at ")[0], str(cause).partition(":")[0]):
            words = words.replace(part, "…") if len(part) > SHORTEST else words
    hint = getattr(error, "hint", None)
    return f"{words} ({hint})" if hint else words


def figures_of(package: str) -> Trace:
    """Return the trace of a package's figures: each number and text that a module of it names, whoever uses it."""

    def figures(_draw: random.Random) -> Iterable[str]:
        root = importlib.import_module(package)
        for found in sorted(pkgutil.iter_modules(root.__path__), key=lambda one: one.name):
            module = importlib.import_module(f"{package}.{found.name}")
            for name in _assigned(inspect.getsource(module)):
                if _is_figure(value := getattr(module, name, None)):
                    yield f"{found.name} {name} {said(value)}"

    return figures


def declared_in(*packages: str) -> Trace:
    """Return the trace of what packages declare: tables, members of enumerations, and the values that calls may omit.

    Left out is what differs between machines: places of files, functions and other objects.
    """

    def declared(_draw: random.Random) -> Iterable[str]:
        for package in packages:
            root = importlib.import_module(package)
            for found in sorted(pkgutil.iter_modules(root.__path__), key=lambda one: one.name):
                if not found.ispkg and found.name != "__main__":
                    yield from _declarations(importlib.import_module(f"{package}.{found.name}"))

    return declared


def _declarations(module: ModuleType) -> Iterable[str]:
    source = inspect.getsource(module)
    empty = _empty(source)
    for name in _assigned(source):
        value = getattr(module, name, None)
        if is_table(value) and not (name in empty and isinstance(value, dict | list | set)):
            yield f"{module.__name__} {name} {said(in_order(value))}"
    for name, value in sorted(vars(module).items()):
        if getattr(value, "__module__", None) != module.__name__:
            continue
        if isinstance(value, type) and issubclass(value, Enum):
            members = [(one.name, in_order(one.value)) for one in value if is_table(one.value)]
            yield f"{module.__name__} {name} {said(members)}"
        owned = vars(value).items() if isinstance(value, type) else [("", value)]
        omitted = [(own, *rows) for own, each in owned if (rows := _omitted(each, module.__name__))]
        if is_table(defaults := getattr(value, "_field_defaults", {})) and defaults:  # of a named tuple
            omitted.append(("", *defaults.items()))
        if omitted:
            yield f"{module.__name__} {name} {said(omitted)}"


def _omitted(call: object, module: str) -> list[tuple[str, object]]:
    """Return the parameters of a function or method that a call may leave out, with what they are then."""
    call = call.__func__ if isinstance(call, classmethod | staticmethod) else call
    if not isinstance(call, FunctionType) or call.__module__ != module:
        return []
    given = {name: one.default for name, one in inspect.signature(call).parameters.items()}
    return [
        (name, in_order(value))
        for name, value in given.items()
        if value is not inspect.Parameter.empty and is_table(value)
    ]


def is_table(value: object) -> bool:
    """Tell whether a value is made of numbers, words and tables alone."""
    if isinstance(value, tuple | list | AbstractSet):
        return all(map(is_table, value))
    if isinstance(value, Mapping):
        return all(map(is_table, value.values())) and all(map(is_table, value))
    if isinstance(value, str):
        return not value.startswith("/") and " at 0x" not in value
    if is_dataclass(value) and not isinstance(value, type):
        return all(is_table(getattr(value, part.name)) for part in fields(value))
    return value is None or isinstance(value, int | float | bytes | Enum)


def in_order(value: object) -> object:
    """Return a table with each set in it as its members in order, for a set has none that stays."""
    if isinstance(value, AbstractSet):
        return sorted(map(said, value))
    if isinstance(value, Mapping):
        return {key: in_order(each) for key, each in value.items()}
    if isinstance(value, Enum):
        return value.name or value.value  # several flags at once have no name
    return [*map(in_order, value)] if isinstance(value, tuple | list) else value


def _assigned(source: str) -> list[str]:
    """Return the names in capitals that a module itself gives values to."""
    rows = [row for row in ast.parse(source).body if isinstance(row, ast.Assign | ast.AnnAssign)]
    targets = [target for row in rows for target in (row.targets if isinstance(row, ast.Assign) else [row.target])]
    names = [one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)]
    return [name for name in names if name.isupper()]


def _empty(source: str) -> set[str]:
    """Return the names to which a module gives what is empty: a cache, which holds what has run before."""
    rows = [row for row in ast.parse(source).body if isinstance(row, ast.AnnAssign | ast.Assign)]
    return {
        target.id
        for row in rows
        for target in (row.targets if isinstance(row, ast.Assign) else [row.target])
        if isinstance(target, ast.Name)
        and (
            (isinstance(row.value, ast.Call) and not row.value.args and not row.value.keywords)
            or (isinstance(row.value, ast.Dict) and not row.value.keys)
            or (isinstance(row.value, ast.List) and not row.value.elts)
        )
    }


def _is_figure(value: object) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_figure, value))
    return isinstance(value, int | float | str | bytes)


def judge_of(file: str, traces: Mapping[str, Trace]) -> Callable[..., None]:
    """Return the test of some traces: each shows what it did when it was approved."""

    @pytest.mark.parametrize("name", traces)
    def judged(name: str) -> None:
        lines, right = _lines(name, traces[name]), _approved(Path(file)).get(name, ())
        for number, (line, checksum) in enumerate(zip(lines, right, strict=False)):
            if _checksum(line) != checksum:
                pytest.fail(
                    f"{name}, line {number} is otherwise than approved; now it is\n  {line[:SHOWN]}\n{_hint(file)}"
                )
        assert len(lines) == len(right), _hint(file)

    return judged


def _hint(file: str) -> str:
    return f"(hint: `python -m tests.tools.suite.approved {Path(file).name} --write FOLDER` at both commits, `diff -u`)"


def _lines(name: str, trace: Trace) -> list[str]:
    return [*trace(random.Random(name))]


def _checksum(line: str) -> str:
    return f"{zlib.crc32(line.encode()):08x}"


def _approved(file: Path) -> dict[str, list[str]]:
    kept = file.with_name("approved.json")
    found: dict[str, dict[str, str]] = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    return {name: text.split() for name, text in found.get(file.stem, {}).items()}


def _approve(file: Path, traces: Mapping[str, Sequence[str]]) -> None:
    kept = file.with_name("approved.json")
    found: dict[str, dict[str, str]] = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    found[file.stem] = {name: " ".join(map(_checksum, lines)) for name, lines in traces.items()}
    kept.write_text(json.dumps(dict(sorted(found.items())), indent=1) + "\n", encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare, write or approve; return the exit code: 1 where a trace is otherwise."""
    parser = argparse.ArgumentParser(prog="python -m tests.tools.suite.approved", description=__doc__)
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="files of tests")
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="write the traces there")
    parser.add_argument("--approve", action="store_true", help="take them for right")
    chosen = parser.parse_args(arguments)
    others = []
    for file in chosen.files:
        module = importlib.import_module(".".join(file.with_suffix("").parts))
        traces = {name: _lines(name, trace) for name, trace in module.TRACES.items()}
        before = _approved(file)
        others += [f"{file} {name}" for name, lines in traces.items() if [*map(_checksum, lines)] != before.get(name)]
        if chosen.write:
            chosen.write.mkdir(parents=True, exist_ok=True)
            for name, lines in traces.items():
                (chosen.write / f"{file.stem}.{name}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
        if chosen.approve:
            _approve(file, traces)
    if others and not chosen.approve:
        sys.stdout.write("otherwise than approved:\n" + "".join(f"  {one}\n" for one in others))
    return int(bool(others) and not chosen.approve)


if __name__ == "__main__":
    sys.exit(main())
