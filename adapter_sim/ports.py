"""What the adapter needs of the far side: a bank of named pins.

The bench's nets, a real GPIO bank and the fakes of the tests all fit this shape.
"""

from collections.abc import Callable
from typing import Protocol, TypeAlias

from p2os.timing import Nanos

#: Told of each transition: (now in ns, what happened in a word or two, detail).
EventCallback: TypeAlias = Callable[[Nanos, str, str], None]


class PinBank(Protocol):
    """The adapter's ends of the wires, by the names of pinout.toml."""

    def read(self, signal: str, at: Nanos) -> bool:
        """Return the level of a wire at the instant `at`, an edge at `at` included."""
        ...

    def write(self, signal: str, high: bool | None, now: Nanos) -> None:
        """Drive a wire from `now` on; None releases it to its pull."""
        ...
