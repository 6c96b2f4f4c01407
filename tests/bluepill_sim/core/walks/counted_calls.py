"""How often C calls Python, and by what for; what a part is asked counts with the part's slot and the question."""

import ctypes
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from bluepill_sim.extension.library import Callbacks
from bluepill_sim.fabric import fabric
from bluepill_sim.native import engine


@contextmanager
def counted_calls(counts: Counter[str]) -> Iterator[None]:
    """Have the callbacks of all boards that are made within this be counted by their names."""
    with (
        patch.object(engine, "Callbacks", _counting(Callbacks, counts)),
        patch.object(fabric, "_Calls", _counting(fabric._Calls, counts)),
    ):
        yield


def _counting(made: type[ctypes.Structure], counts: Counter[str]) -> Callable[..., ctypes.Structure]:
    """Return what makes a table of callbacks of which each call is counted by its name."""

    def counted(name: str, call: Any) -> Any:
        def count(*arguments: object) -> Any:
            counts[f"ask {arguments[0]}/{arguments[1]}" if name == "ask" else name] += 1
            return call(*arguments)

        return type(call)(count)

    names = [field[0] for field in made._fields_]
    return lambda *calls: made(*(counted(name, call) for name, call in zip(names, calls, strict=True)))
