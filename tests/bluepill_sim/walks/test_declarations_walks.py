"""What every module of the package declares, against what was approved, a package a trace.

That is each constant and table; each class with its bases, members, fields and tables; and the defaults of functions.
A function without a name, which a table holds, is shown by what it gives for a few arguments. Prose is left out.
"""

import ast
import importlib
import inspect
import random
import re
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from contextlib import suppress
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from functools import partial
from pathlib import Path
from types import FunctionType

import bluepill_sim
from bluepill_sim.extension.layout import Struct
from tests.tools.suite.approved import Trace, judge_of, said

#: What a function of a table may be asked: an opcode or an address, operands, a name.
_ARGUMENTS: tuple[object, ...] = (
    0, 1, 0x2A5B, 0x4D3E, 0xF3C1_5A2D, 0xEA4F_13B6, (0x1234_5678, 0x21), (0x8000_00FF, 0x103), "PA5", "",
)  # fmt: skip
#: How deep a table is shown, and how many spaces make a text prose.
_DEEPEST, _PROSE = 6, 4
#: What a data class is made with.
_MADE_WITH = ("init", "repr", "eq", "order", "unsafe_hash", "frozen")
_WAYS = ("init", "repr", "compare", "kw_only")


def _shown(value: object, depth: int = _DEEPEST) -> str:  # noqa: C901, PLR0911, PLR0912 - a case a kind
    """Return a value as text that is the same on every machine and in every version of Python."""
    if not depth:
        return "…"
    inside = partial(_shown, depth=depth - 1)
    match value:
        case Enum():
            return f"{type(value).__name__}.{value.name}"
        case str() if value.count(" ") >= _PROSE:
            return "prose"
        case None | bool() | int() | str() | bytes():
            return repr(value)
        case float():
            return said(value)
        case type():
            return value.__name__
        case Path() | Struct():  # what a struct has is in C too, and held to that
            return value.name
        case re.Pattern():
            return f"re {value.pattern!r} {value.flags}"
        case struct.Struct():
            return f"struct {value.format}"
        case Mapping():
            return "{" + ", ".join(f"{inside(key)}: {inside(each)}" for key, each in value.items()) + "}"
        case tuple() | list() | range():
            return f"({', '.join(map(inside, value))})"
        case AbstractSet():
            return "{" + ", ".join(sorted(map(inside, value))) + "}"
        case partial():
            return f"partial {inside(value.func)} {inside(value.args)} {inside(value.keywords)}"
        case staticmethod() | classmethod():
            return inside(value.__func__)
        case FunctionType():
            return _shown_function(value, inside)
    if hasattr(value, "cache_parameters"):
        return f"{value.cache_parameters()['maxsize']} kept of {inside(getattr(value, '__wrapped__', None))}"
    if is_dataclass(value):
        parts = [each.name for each in fields(value) if each.name != "doc"]
        return f"{type(value).__name__}({', '.join(f'{name}={inside(getattr(value, name))}' for name in parts)})"
    return type(value).__name__ if type(value).__module__.startswith(bluepill_sim.__name__) else "other"


def _shown_function(function: FunctionType, inside: Callable[[object], str]) -> str:
    named = {**{f"-{n}": one for n, one in enumerate(function.__defaults__ or ())}, **(function.__kwdefaults__ or {})}
    answers = []
    if function.__name__ == "<lambda>":
        for argument in _ARGUMENTS:
            with suppress(Exception):  # it takes another kind of argument
                answers.append(inside(function(argument)))
    return " ".join((function.__name__, *[f"{name}={inside(one)}" for name, one in named.items()], *answers))


def _shown_class(kind: type, body: Iterable[ast.stmt]) -> Iterator[str]:
    yield f"{kind.__name__}({' '.join(base.__name__ for base in kind.__bases__)})"
    if is_dataclass(kind):
        made = kind.__dataclass_params__  # type: ignore[attr-defined]  # of every data class
        how = [name for name in _MADE_WITH if getattr(made, name)]
        yield f"  made with {' '.join(how)}{' slots' if '__slots__' in vars(kind) else ''}"
        yield from (f"  {_shown_field(each)}" for each in fields(kind))
    else:
        members = kind.__members__ if issubclass(kind, Enum) else {}
        yield from (f"  {name}={_shown(one.value)}" for name, one in members.items())
        others = {name: value for name, value in vars(kind).items() if name not in members}
        yield from (f"  {line}" for line in _declared(others, body))


def _shown_field(each: "Field[object]") -> str:
    default = "" if each.default is MISSING else _shown(each.default)
    made = "" if each.default_factory is MISSING else _shown(each.default_factory)
    return f"{each.name}: {default}{made} {' '.join(name for name in _WAYS if getattr(each, name))}"


def _declared(names: Mapping[str, object], body: Iterable[ast.stmt]) -> Iterator[str]:
    """Yield what the body of a module or of a class declares, in the order in which it does."""
    for row in body:
        if isinstance(row, ast.Assign | ast.AnnAssign):
            targets = row.targets if isinstance(row, ast.Assign) else [row.target]
            found = [one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)]
            yield from (f"{name}: {_shown(names[name])}" for name in found if name in names)
        elif isinstance(row, ast.FunctionDef):
            has_defaults = row.args.defaults or any(row.args.kw_defaults)
            yield from [_shown(names[row.name])] if has_defaults or hasattr(names[row.name], "cache_parameters") else []
        elif isinstance(row, ast.ClassDef) and isinstance(kind := names[row.name], type):
            yield "\n".join(_shown_class(kind, row.body))


def _of_package(modules: Iterable[str], _: random.Random) -> Iterator[str]:
    for name in modules:
        module = importlib.import_module(name)
        yield from (f"{name} {line}" for line in _declared(vars(module), ast.parse(inspect.getsource(module)).body))


def _traces() -> dict[str, Trace]:
    """Return a trace of each package, and one of the modules that stand in none."""
    folder = Path(bluepill_sim.__file__).parent
    found: dict[str, list[str]] = {}
    for file in sorted(folder.rglob("*.py")):
        *packages, stem = file.relative_to(folder.parent).with_suffix("").parts
        if not stem.startswith("__"):
            found.setdefault(packages[min(1, len(packages) - 1)], []).append(".".join((*packages, stem)))
    return {package: partial(_of_package, modules) for package, modules in found.items()}


TRACES = _traces()
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
