"""What the library tells by `logging`: the loggers `p2os.client`, `p2os.serve` and `p2os.bench`.

Silent until a program asks: `logging.basicConfig(level=logging.INFO)`. Only the I/O layer
and the bench log, never a model; no decision depends on it.
"""

import logging
from collections.abc import Callable

from simbase.timing import NS_PER_S, Nanos

ROOT = "p2os"

#: Takes (nanoseconds, what, detail): a line of a part's state log.
EventCallback = Callable[[Nanos, str, str], None]

#: Events of parts that are no plain news. Whatever is not listed is INFO.
LEVELS = {
    "command": logging.DEBUG,
    **dict.fromkeys(
        (
            "battery low", "bumper stall", "client refused", "collision", "command ignored", "contention",
            "controller down", "implausible", "lag", "lost", "motors stay off", "no connection", "odometry jumped",
            "pad lost", "shutdown", "stall", "warning", "watchdog expired",
        ),
        logging.WARNING,
    ),
}  # fmt: skip


def logger(part: str) -> logging.Logger:
    """Return the logger of a part, `p2os.PART`, which prints nothing unless the program wants it."""
    root = logging.getLogger(ROOT)
    if not root.handlers:
        root.addHandler(logging.NullHandler())
    return root.getChild(part)


def log_event(log: logging.Logger, who: str, at: Nanos, what: str, detail: str) -> None:
    """Log that something happened to `who`, at `at` nanoseconds of its own time."""
    log.log(LEVELS.get(what, logging.INFO), "%s at %.3f s: %s%s%s", who, at / NS_PER_S, what, detail and ": ", detail)


def logged(log: logging.Logger, who: str, listener: EventCallback | None) -> EventCallback:
    """Return a listener that logs an event, then hands it on."""

    def take(at: Nanos, what: str, detail: str) -> None:
        log_event(log, who, at, what, detail)
        if listener is not None:
            listener(at, what, detail)

    return take
