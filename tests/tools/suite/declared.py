"""What the modules of a package declare: figures and tables, defaults of arguments and fields, members of enums.

A walk of the package shows it as text, a line a name, whoever uses it. Left out: what another machine may have
otherwise (paths), and what is no value (functions and classes are shown by their names).
"""

import ast
import importlib
import inspect
import re
import sys
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any

import numpy as np

from tests.tools.suite.approved import Trace, said

#: Of the classes themselves, and what the runtime adds.
_ADDED = re.compile(r"__\w+__|_abc_impl|_is_protocol|_is_runtime_protocol")


def declared_of(*packages: str) -> Trace:
    """Return the trace of what modules declare.

    Args:
        packages: In which they stand, with their full names; packages in them are not gone through.
    """

    def declared(_draw: Random) -> Iterator[str]:
        for package in packages:
            root = importlib.import_module(package)
            yield from _of_module(root)
            names = sorted(file.stem for file in Path(root.__path__[0]).glob("*.py") if file.stem != "__init__")
            for name in names:
                yield from _of_module(importlib.import_module(f"{root.__name__}.{name}"))

    return declared


def _of_module(module: ModuleType) -> Iterator[str]:
    name = module.__name__.rpartition(".")[2]
    for row in ast.parse(inspect.getsource(module)).body:
        targets = row.targets if isinstance(row, ast.Assign) else [row.target] if isinstance(row, ast.AnnAssign) else []
        for one in (one for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)):
            if one.id != "__all__" and hasattr(module, one.id):
                yield f"{name} {one.id} {plain(getattr(module, one.id))}"
        if isinstance(row, ast.FunctionDef | ast.AsyncFunctionDef) and (given := _defaults(getattr(module, row.name))):
            yield f"{name} {row.name}({given})"
        if isinstance(row, ast.ClassDef):
            yield from (f"{name} {row.name} {line}" for line in _of_class(getattr(module, row.name)))


def _of_class(one: type) -> Iterator[str]:
    if issubclass(one, Enum):
        yield said({member.name: plain(member.value) for member in one})
        return
    if is_dataclass(one):
        values = {field.name: field.default_factory if field.default is MISSING else field.default
                  for field in fields(one)}  # fmt: skip
        yield said({key: plain(value) for key, value in values.items() if value is not MISSING})
    for key, value in vars(one).items():
        function = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        if inspect.isfunction(function) and (given := _defaults(function)) and not _ADDED.fullmatch(key):
            yield f"{key}({given})"
        elif isinstance(value, str | bytes | int | float | tuple) and not _ADDED.fullmatch(key):
            yield f"{key} {plain(value)}"


def _defaults(function: object) -> str:
    """Return the defaults of a function's arguments; empty where it has none."""
    try:
        parameters = inspect.signature(function).parameters.values()  # type: ignore[arg-type]  # it may be none
    except (TypeError, ValueError):
        return ""
    return ", ".join(f"{one.name}={plain(one.default)}" for one in parameters if one.default is not one.empty)


def plain(value: Any) -> str:  # noqa: PLR0911 - a table by kind of value
    """Return a value as text, to its last part; of what is no value its name, or that of its class."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, str | bytes | int | float | None):
        return said(value).replace(sys.executable, "PYTHON")
    if is_dataclass(value) and not isinstance(value, type):
        return f"{type(value).__name__}{plain([getattr(value, part.name, None) for part in fields(value)])}"
    if isinstance(value, re.Pattern):
        return f"{value.pattern} {int(value.flags)}"
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{plain(key)}: {plain(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "(" + ", ".join(map(plain, value)) + ")"
    if isinstance(value, AbstractSet):
        return "{" + ", ".join(sorted(map(plain, value))) + "}"
    return str(getattr(value, "__qualname__", type(value).__qualname__))
