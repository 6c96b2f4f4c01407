"""What the modules of packages declare, against what was approved: a trace for the walks of a package.

That is each constant and table; each class with its bases, members, fields and tables; and the defaults of functions.
Left out is what differs between machines and versions of Python: prose, places of files, objects of others; and what a
module keeps of its work, which begins empty.
"""

import ast
import importlib
import inspect
import random
import re
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from contextlib import suppress
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from functools import partial
from itertools import islice
from pathlib import Path
from types import FunctionType, ModuleType

from tests.tools.suite.approved import Trace, said

#: How deep a table is shown, and how many spaces make a text prose.
_DEEPEST, _PROSE = 6, 4
#: What a data class is made with.
_MADE_WITH = ("init", "repr", "eq", "order", "unsafe_hash", "frozen")
_WAYS = ("init", "repr", "compare", "kw_only")
#: Where classes are the project's own.
_OWN = {"simbase", "p2os", "bluepill_sim", "adapter_sim", "robot_bench", "hardware"}


def declared_of(*packages: str, asked: Sequence[object] = ()) -> Trace:
    """Return the trace of what modules declare.

    Args:
        packages: In which they stand, with their full names; packages in them are not gone through.
        asked: A function without a name, which a table holds, is shown by what it gives for each of these.
    """
    return partial(_of_packages, packages, asked)


def _of_packages(packages: Sequence[str], asked: Sequence[object], _: random.Random) -> Iterator[str]:
    for package in packages:
        root = importlib.import_module(package)
        names = sorted(file.stem for file in Path(root.__path__[0]).glob("*.py") if not file.stem.startswith("__"))
        for name in ("", *(f".{one}" for one in names)):
            module = importlib.import_module(f"{package}{name}")
            body = ast.parse(inspect.getsource(module)).body
            yield from (f"{module.__name__} {line}" for line in _Shown(asked).declared(vars(module), body))


class _Shown:
    """Shows values, and asks functions without a name."""

    def __init__(self, asked: Sequence[object]) -> None:
        self._asked = asked

    def declared(self, names: Mapping[str, object], body: Iterable[ast.stmt]) -> Iterator[str]:
        """Yield what the body of a module or of a class declares, in the order in which it does."""
        for row in body:
            if isinstance(row, ast.Assign | ast.AnnAssign):
                targets = row.targets if isinstance(row, ast.Assign) else [row.target]
                found = [one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)]
                yield from (f"{name}: {self.value(_begun(names[name], row.value))}"
                            for name in found if name in names and name != "__all__")  # fmt: skip
            elif isinstance(row, ast.FunctionDef | ast.AsyncFunctionDef) and row.name in names:
                has_defaults = row.args.defaults or any(row.args.kw_defaults)
                if has_defaults or hasattr(names[row.name], "cache_parameters"):
                    yield self.value(names[row.name])
            elif isinstance(row, ast.ClassDef) and isinstance(kind := names.get(row.name), type):
                yield "\n".join(self._kind(kind, row.body))

    def value(self, value: object, depth: int = _DEEPEST) -> str:  # noqa: C901, PLR0911, PLR0912 - a case a kind
        """Return a value as text that is the same on every machine and in every version of Python."""
        if not depth:
            return "…"
        inside = partial(self.value, depth=depth - 1)
        match value:
            case Enum():
                return f"{type(value).__name__}.{value.name}"
            case str() if value.count(" ") >= _PROSE:
                return "prose"
            case str() if value.startswith("/"):
                return "a place"
            case None | bool() | int() | str() | bytes():
                return repr(value)
            case float():
                return said(value)
            case type():
                return value.__name__
            case Path() | ModuleType():
                return "a place"
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
                return self._function(value, inside)
        if hasattr(value, "cache_parameters"):
            return f"{value.cache_parameters()['maxsize']} kept of {inside(getattr(value, '__wrapped__', None))}"
        if is_dataclass(value):
            parts = [each.name for each in fields(value) if each.name != "doc" and hasattr(value, each.name)]
            return f"{type(value).__name__}({', '.join(f'{name}={inside(getattr(value, name))}' for name in parts)})"
        return type(value).__name__ if type(value).__module__.partition(".")[0] in _OWN else "other"

    def _function(self, function: FunctionType, inside: Callable[[object], str]) -> str:
        named = {**{f"-{n}": one for n, one in enumerate(function.__defaults__ or ())},
                 **(function.__kwdefaults__ or {})}  # fmt: skip
        answers = []
        if function.__name__ == "<lambda>":
            for argument in self._asked:
                with suppress(Exception):  # it takes another kind of argument
                    answers.append(inside(function(argument)))
        return " ".join((function.__name__, *[f"{name}={inside(one)}" for name, one in named.items()], *answers))

    def _kind(self, kind: type, body: Iterable[ast.stmt]) -> Iterator[str]:
        yield f"{kind.__name__}({' '.join(base.__name__ for base in kind.__bases__)})"
        if is_dataclass(kind):
            made = kind.__dataclass_params__  # type: ignore[attr-defined]  # of every data class
            how = [name for name in _MADE_WITH if getattr(made, name)]
            yield f"  made with {' '.join(how)}{' slots' if '__slots__' in vars(kind) else ''}"
            yield from (f"  {self._field(each)}" for each in fields(kind))
        members = kind.__members__ if issubclass(kind, Enum) else {}
        yield from (f"  {name}={self.value(one.value)}" for name, one in members.items())
        data = {each.name for each in fields(kind)} if is_dataclass(kind) else {*members}
        others = {name: value for name, value in vars(kind).items() if name not in data}
        yield from (f"  {line}" for line in self.declared(others, body))

    def _field(self, each: "Field[object]") -> str:
        default = "" if each.default is MISSING else self.value(each.default)
        made = "" if each.default_factory is MISSING else self.value(each.default_factory)
        return f"{each.name}: {default}{made} {' '.join(name for name in _WAYS if getattr(each, name))}"


def _begun(value: object, written: ast.expr | None) -> object:
    """Return a table with the rows alone that are written down: some are added to while programs run."""
    if isinstance(written, ast.Call) and not written.args and not written.keywords:
        return () if isinstance(value, dict | list | set) else value
    if isinstance(written, ast.List) and not written.elts:
        return ()
    if isinstance(value, dict) and isinstance(written, ast.Dict) and None not in written.keys:
        return dict(islice(value.items(), len(written.keys)))
    return value
