"""How often C calls Python, by what for, and with which numbers.

What a part is asked counts with the part's slot and the question.
"""

import ctypes
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from bluepill_sim.extension.library import Callbacks
from bluepill_sim.fabric import fabric
from bluepill_sim.native import engine

#: Takes a call, by its name and its arguments, before it is made.
Note = Callable[[str, tuple[Any, ...]], None]


@contextmanager
def counted_calls(counts: Counter[str], note: Note = lambda _name, _arguments: None) -> Iterator[None]:
    """Have the callbacks of all boards that are made within this be counted by their names, and noted."""
    with (
        patch.object(engine, "Callbacks", _counting(Callbacks, counts, note)),
        patch.object(fabric, "_Calls", _counting(fabric._Calls, counts, note)),
    ):
        yield


def _counting(made: type[ctypes.Structure], counts: Counter[str], note: Note) -> Callable[..., ctypes.Structure]:
    """Return what makes a table of callbacks of which each call is counted by its name, and noted."""

    def counted(name: str, call: Any) -> Any:
        def count(*arguments: object) -> Any:
            counts[f"ask {arguments[0]}/{arguments[1]}" if name == "ask" else name] += 1
            note(name, arguments)
            return call(*arguments)

        return type(call)(count)

    names = [field[0] for field in made._fields_]
    return lambda *calls: made(*(counted(name, call) for name, call in zip(names, calls, strict=True)))
