"""What programs have shown when somebody looked at it: checksums of traces, line by line, which tests hold them to.

    python -m tests.tools.suite.approved tests/p2os/…/walks/test_*.py            names the traces that are otherwise
    python -m tests.tools.suite.approved tests/p2os/…/walks/test_*.py --write D  writes every trace into a folder
    python -m tests.tools.suite.approved tests/p2os/…/walks/test_*.py --approve  takes what they show now for right

A file of tests has a table of traces, `TRACES`, and the test `judge_of(__file__, TRACES)`; `approved.json` beside it
keeps the checksums. A change that is meant changes traces too: write them before and behind it, read the difference
(`diff -u`), and approve it together with the change.
"""

import argparse
import importlib
import json
import random
import re
import sys
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path

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


def judge_alike(file: str, names: Iterable[str]) -> Callable[[], None]:
    """Return the test that some traces of a file are approved as the same."""

    def judged() -> None:
        approved = _approved(Path(file))
        assert len({tuple(approved[name]) for name in names}) == 1

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
