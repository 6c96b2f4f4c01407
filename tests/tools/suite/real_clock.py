"""Which tests read a real clock: those whose own code, or helpers of tests that it calls, name a function that does.

`pytest -m real_clock` runs them, `-m "not real_clock"` all others, and `make steady` repeats them on a machine that is
busy. Nobody marks by hand, so nobody forgets to: `tests/conftest.py` asks here for the mark when a run names it.

Names are followed through the modules of tests: functions, classes with their methods, fixtures of the module and of
the folders' conftest.py. That a program of ours reads a clock says nothing: what a test waits for is what it may miss.
"""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
#: What reads a clock, or waits by one.
CLOCKS = {
    "time.monotonic", "time.monotonic_ns", "time.perf_counter", "time.perf_counter_ns", "time.time", "time.time_ns",
    "time.sleep", "asyncio.sleep", "asyncio.wait_for", "asyncio.timeout", "p2os.transport.wall_clock.wall_clock",
}  # fmt: skip

Definition = tuple[Path, str]
_without_clock: set[Definition] = set()


def reads_clock(path: Path, name: str) -> bool:
    """Tell whether a function of a file of tests reads a clock.

    Args:
        path: The file.
        name: The function's name, or a class's.
    """
    waiting, seen = [(path, name)], {(path, name)}
    while waiting:
        for used in _used(*waiting.pop()):
            if used in CLOCKS:
                return True
            if isinstance(used, tuple) and used not in seen and used not in _without_clock:
                seen.add(used)
                waiting.append(used)
    _without_clock.update(seen)
    return False


@cache
def _used(path: Path, name: str) -> frozenset[Definition | str]:
    """Return the definitions in files of tests that one uses, and all else that it uses by its full name."""
    uses = _module(path)[1].get(name, (name,))  # what is not defined here is imported, or of a folder
    return frozenset(_resolved(path, use) for use in uses)


def _resolved(path: Path, use: str) -> Definition | str:
    first, _, rest = use.partition(".")
    origins, definitions = _module(path)
    if first in definitions:
        return path, first
    if first not in origins:
        return _fixture(path, first)
    target = f"{origins[first]}.{rest}" if rest else origins[first]
    module, _, name = target.rpartition(".")
    file = ROOT.joinpath(*module.split(".")).with_suffix(".py") if target.startswith("tests.") else None
    return (file, name) if file is not None and file.exists() else target


def _fixture(path: Path, name: str) -> Definition | str:
    """Return the fixture of a folder that a name may be."""
    for folder in path.parents:
        conftest = folder / "conftest.py"
        if conftest != path and conftest.exists() and name in _module(conftest)[1]:
            return conftest, name
        if folder == ROOT:
            break
    return name


@cache
def _module(path: Path) -> tuple[dict[str, str], dict[str, frozenset[str]]]:
    """Return where a module's names come from, and which names each of its definitions uses, arguments too."""
    tree = ast.parse(path.read_bytes())
    origins: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for each in node.names:
                name = each.name if each.asname else each.name.partition(".")[0]
                origins[each.asname or name] = name
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            origins |= {each.asname or each.name: f"{node.module}.{each.name}" for each in node.names}
    definitions = {
        node.name: frozenset(_uses(node))
        for node in tree.body if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
    }  # fmt: skip
    return origins, definitions


def _uses(node: ast.AST) -> Iterator[str]:
    for each in ast.walk(node):
        if isinstance(each, ast.Attribute) and isinstance(each.value, ast.Name):
            yield f"{each.value.id}.{each.attr}"
        elif isinstance(each, ast.Name):
            yield each.id
        elif isinstance(each, ast.arg):
            yield each.arg
