"""A class of the user's by its name: `./mine.py:Class`, or an entry point of an installed package.

A file is loaded for a `simbase.trust.Code` that was admitted, and for no plain text: a name out of somebody's file
becomes one by `Trust.admit`, and one that the caller gives himself by `own_code`.
What is wrong with it is reported in one line: a file that is not there or cannot be loaded, a name that nothing has,
and which methods of the protocol a class lacks.
Invariant: nothing of a file or a package is loaded before its class is asked for, and of a file only what was admitted.
"""

import hashlib
import importlib.util
import inspect
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, cast

from simbase.entry_points import installed_points
from simbase.errors import P2osError, UsageError, shown, shown_name
from simbase.files import refusal_of
from simbase.trust.code import Code, is_in_file
from simbase.trust.decision import UntrustedError
from simbase.trust.fingerprint import fingerprint_of
from simbase.trust.sources import SourceLoader, read_sources_of

#: What the modules' names of users' files begin with.
OF_USERS = "p2os_part_"
#: The name by which such a module knows what of its folder was admitted.
_ADMITTED = "__admitted__"
_PAGE = "docs/trust.md"


def find_class(
    name: str, *, what: str, group: str, known: Sequence[str], error: Callable[..., P2osError] = UsageError,
    absent: str = "",
) -> Callable[..., Any]:  # fmt: skip
    """Return a class, or what makes such a thing.

    Args:
        name: FILE.py:CLASS as a `Code` that was admitted, or the name of an entry point.
        what: What it is to be, for messages: `part`, `body`.
        group: The entry points' group.
        known: The names that ship, for the hint.
        error: What is raised: (message, hint=…).
        absent: What of the group is not installed and how it is got, for the hint.

    Raises:
        UntrustedError: It is in a file, and was not admitted, or has changed since.
        P2osError: There is none, or it cannot be loaded; of the type that `error` makes.
    """
    if is_in_file(name):
        if not isinstance(name, Code):
            raise UntrustedError(f"the {what} {shown_name(name)} is in a file, and was not admitted", hint=_PAGE)
        return _class_in(name, error)
    points = installed_points(group)
    if name in points:
        try:
            return cast("Callable[..., Any]", points[name].load())
        except Exception as failure:  # of another's package
            raise error(f"the {what} {name} cannot be loaded: {said(failure)}") from failure
    all_known = ", ".join([*known, *(point for point in points if point not in known)])
    lacking = absent and f"; {absent}"
    raise error(f"there is no {what} {shown(name)}", hint=f"known are {all_known}, and FILE.py:CLASS{lacking}")


def refuse_lacking(made: object, protocol: type, name: str, what: str) -> None:
    """Refuse a class that lacks a method of a protocol, or an object that lacks a method or an attribute of it.

    Raises:
        UsageError: It lacks some; the message names them all.
    """
    is_class = isinstance(made, type)
    lacking = [
        f"{member}()" if callable(value) else member
        for member, value in _members(protocol).items()
        if (callable(value) or not is_class) and not _has(made, member, must_call=callable(value))
    ]
    if lacking:
        raise UsageError(f"the {what} {name} lacks {', '.join(lacking)}", hint=f"docs/bench.md lists what a {what} has")


def make(made: Callable[..., Any], name: str, what: str, /, *arguments: object, **named: object) -> Any:
    """Return what a user's class makes of these arguments.

    Raises:
        UsageError: Its constructor raised what is no `P2osError`; a `P2osError` goes on as it is.
    """
    try:
        return made(*arguments, **named)
    except P2osError:
        raise
    except Exception as error:  # whatever a class of the user's raises is one line here
        raise UsageError(f"the {what} {name} cannot be made: {said(error)}") from error


def source_of(made: Callable[..., Any]) -> str:
    """Return the SHA-256 of the file that a class is in; of its name alone, where that cannot be read."""
    try:
        return hashlib.sha256(Path(inspect.getsourcefile(made) or "").read_bytes()).hexdigest()
    except (OSError, TypeError):
        return f"{made.__module__}.{getattr(made, '__qualname__', type(made).__name__)}"


def loaded(point: EntryPoint) -> object:
    """Return what an entry point names.

    Raises:
        ModuleNotFoundError: A module that it needs is not installed; what brings it, the caller knows.
        P2osError: It cannot be had; the message names the package that offers it.
    """
    try:
        return point.load()
    except (ModuleNotFoundError, P2osError):
        raise
    except Exception as error:  # of another's package
        raise broken(point, error) from error


def broken(point: EntryPoint, error: Exception) -> P2osError:
    """Return the error that names the package whose entry point fails."""
    package = point.dist.name if point.dist is not None else point.module
    return P2osError(
        f"{point.name} ({point.group}) of the package {package} cannot be loaded: {said(error)}",
        hint=f"pip uninstall {package} does without it; --trace shows where it fails",
    )


def said(error: Exception) -> str:
    """Return an exception of the user's code as words: with its type, but for a `ValueError`."""
    return str(error) if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"


def unforeseen(error: BaseException) -> str:
    """Return an unforeseen exception as words: where in a file of the user it arose, or that it is a bug.

    What the system refuses is neither: the words are those of `refusal_of`. Nor is a want of memory: they are the
    error's own, as NumPy's, or that there was not enough.
    """
    if (refused := refusal_of(error)) is not None:
        return refused
    if isinstance(error, MemoryError):
        return str(error) or "there is not enough memory"
    place, step = "", error.__traceback__
    while step is not None:
        if str(step.tb_frame.f_globals.get("__name__", "")).startswith(OF_USERS):
            place = f"{step.tb_frame.f_code.co_filename}:{step.tb_lineno}"
        step = step.tb_next
    return f"{place or 'this is a bug'}: {type(error).__name__}: {error}"


def _members(protocol: type) -> dict[str, object]:
    """Return the public members of a protocol and what stands there: a function, a property, or None."""
    found: dict[str, object] = {}
    for base in protocol.__mro__:
        names = {**dict.fromkeys(inspect.get_annotations(base)), **vars(base)}
        found = {name: value for name, value in names.items() if not name.startswith("_")} | found
    return found


def _has(made: object, member: str, *, must_call: bool) -> bool:
    if isinstance(made, type) or must_call:
        return callable(getattr(made, member, None))
    return hasattr(made, member)


def _refuse_unadmitted(code: Code) -> None:
    """Refuse a file that may not be executed, or whose folder has changed since it was admitted."""
    if code.admitted is None:
        raise UntrustedError(f"{code.where}: {shown_name(code.named)} may not be executed", hint=_PAGE)
    found = fingerprint_of(code.file.parent)
    if found != code.admitted:
        changed = sorted(dict(found.files.items() ^ code.admitted.files.items()))
        what = f"{shown_name(code)}: {shown_name(changed[0])} in its folder has changed since it was admitted"
        raise UntrustedError(what, hint="load it anew")


def _class_in(code: Code, error: Callable[..., P2osError]) -> Callable[..., Any]:
    """Return a class of a Python file, which is loaded once, and anew where another content of it is admitted."""
    path, name = code.file, code.kind
    key = OF_USERS + path.stem
    module = sys.modules.get(key)
    if module is None or Path(module.__file__ or "") != path or getattr(module, _ADMITTED, None) != code.admitted:
        if not code.is_there:
            raise error(
                f"there is no file {shown_name(code.named.rpartition(':')[0])}",
                hint="FILE.py:CLASS names a class in a Python file",
            )
        _refuse_unadmitted(code)
        read_sources_of(path.parent)
        loader = SourceLoader(key, str(path))
        spec = importlib.util.spec_from_file_location(key, path, loader=loader)
        if spec is None:
            raise error(f"{path} is no Python file")
        module = importlib.util.module_from_spec(spec)
        setattr(module, _ADMITTED, code.admitted)
        sys.modules[key] = module
        try:
            loader.exec_module(module)
        except BaseException as failure:
            del sys.modules[key]
            if not isinstance(failure, Exception):
                raise
            raise error(f"{path}: {said(failure)}") from failure
    made = getattr(module, name, None)
    if not isinstance(made, type):
        classes = [
            key
            for key, value in vars(module).items()
            if isinstance(value, type) and value.__module__ == module.__name__
        ]
        raise error(f"{path} has no class {shown(name)}", hint=f"it has {', '.join(classes) or 'none'}")
    return made
