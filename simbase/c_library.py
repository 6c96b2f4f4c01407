"""Libraries in C that ctypes loads: the types of their functions as a table, and callbacks that may raise."""

import ctypes
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from typing import Any, TypeVar

from simbase.errors import MissingDependencyError
from simbase.installation import way_to_build

#: Letters of a signature, the result's first.
_TYPES: Mapping[str, Any] = {
    "v": None, "b": ctypes.c_bool, "c": ctypes.c_uint8, "i": ctypes.c_int32, "u": ctypes.c_uint32, "l": ctypes.c_int64,
    "q": ctypes.c_uint64, "d": ctypes.c_double, "z": ctypes.c_size_t, "p": ctypes.c_void_p, "s": ctypes.c_char_p,
}  # fmt: skip

_Result = TypeVar("_Result")


def built(module: str) -> str | None:
    """Return where a library is that was built as a module beside the sources; None where it was not."""
    spec = find_spec(module)
    return None if spec is None else spec.origin


def loaded(
    path: str | None,
    functions: Mapping[str, str],
    what: str,
    module: str,
    kind: Callable[[str], ctypes.CDLL] = ctypes.CDLL,
) -> Any:
    """Return a library whose functions have types.

    Args:
        path: As of `built`.
        functions: Name → signature: v nothing, b bool, c one byte, i and u 32 bits, l and q 64 bits (signed, unsigned),
            d double, z size, p pointer, s text; the result's letter first.
        what: What it is, for the refusal.
        module: What it was to be built as, likewise.
        kind: `ctypes.PyDLL` keeps the interpreter's lock, for callbacks that come often.

    Raises:
        MissingDependencyError: It was not built.
    """
    if path is None:
        raise MissingDependencyError(f"{what} is not built", hint=way_to_build(module))
    library = kind(path)
    for name, signature in functions.items():
        function = getattr(library, name)
        function.restype = _TYPES[signature[0]]
        function.argtypes = [_TYPES[letter] for letter in signature[1:]]
    return library


def guarded(
    call: Callable[..., _Result], default: _Result, fail: Callable[[BaseException], object]
) -> Callable[..., _Result]:
    """Return a callback for C, which no exception passes: `fail` gets it, and C gets `default`."""

    def callback(*arguments: Any) -> _Result:
        try:
            return call(*arguments)
        except BaseException as error:  # noqa: BLE001 - C stands between here and the caller
            fail(error)
            return default

    return callback
