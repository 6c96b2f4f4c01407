"""What every model stands on: the contract for time, declared state, interrupts, and the root of the errors.

It knows nothing of chips, robots or protocols, and imports the standard library only.
"""

from typing import TYPE_CHECKING

from simbase.lazy import lazily

if TYPE_CHECKING:
    from simbase.errors import FileError, MissingDependencyError, P2osError, UsageError
    from simbase.state import Stateful
    from simbase.timing import NS_PER_MS, NS_PER_S, NS_PER_US, Nanos, Reached, Reason, Timed

    __version__: str

__all__ = [
    "NS_PER_MS",
    "NS_PER_S",
    "NS_PER_US",
    "FileError",
    "MissingDependencyError",
    "Nanos",
    "P2osError",
    "Reached",
    "Reason",
    "Stateful",
    "Timed",
    "UsageError",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "simbase.errors": ("FileError", "MissingDependencyError", "P2osError", "UsageError"),
            "simbase.state": ("Stateful",),
            "simbase.timing": ("NS_PER_MS", "NS_PER_S", "NS_PER_US", "Nanos", "Reached", "Reason", "Timed"),
        },
    )
