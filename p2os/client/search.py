"""Where a robot is looked for, in which order, and what a search that fails has to say."""

from collections.abc import Mapping
from dataclasses import dataclass

from p2os.client.settings import ClientSettings
from p2os.timing import Nanos


@dataclass(frozen=True, slots=True)
class Try:
    """One stretch of the search: a rate (None: the line has none), how long to wait, how often."""

    baud: int | None
    wait_ns: Nanos
    attempts: int


def search_plan(
    baud: int | None, bauds: tuple[int, ...], settings: ClientSettings, *, is_known: bool = False
) -> tuple[Try, ...]:
    """Return the tries, likeliest first: quick ones at every rate, then patient ones.

    Args:
        baud: The likeliest rate; None where the line has none.
        bauds: All rates, in the order in which they are tried; repeats do no harm.
        settings: How long a try takes.
        is_known: The robot was open at `baud` before: it is tried again between all others.
    """
    if baud is None:
        return Try(None, settings.quick_sync_ns, 3), Try(None, settings.patient_sync_ns, 5)
    others = dict.fromkeys(rate for rate in bauds if rate != baud)
    rates = tuple(rate for other in others for rate in ((other, baud) if is_known else (other,)))
    quick = (Try(baud, settings.quick_sync_ns, 2), *(Try(rate, settings.quick_sync_ns, 1) for rate in rates))
    return (*quick, *(Try(rate, settings.patient_sync_ns, 1) for rate in (baud, *rates)))


#: How far a search came → what it says, and what to look at.
REASONS: Mapping[str, tuple[str, str]] = {
    "silence": ("no answer{where}", "is the robot on, and the cable in?"),
    "noise": ("only noise{where}", "is this the robot's HOST port? p2os scan tries every port and rate"),
    "answers": ("the robot answers{where}, but its handshake does not come to an end", "is the line bad?"),
    "opened": ("the session was opened, but no standard packet followed", "is the line bad?"),
}


def why_not_found(came_to: str, line_baud: int | None, bauds: tuple[int, ...]) -> tuple[str, str]:
    """Return why a search failed, and a hint.

    Args:
        came_to: How far it came, a key of `REASONS`.
        line_baud: The rate at which the line was opened; None where it has none.
        bauds: The rates that were tried beside it.
    """
    rates = dict.fromkeys((line_baud, *bauds)) if line_baud is not None else {}
    where = f" at {', '.join(map(str, rates))} baud" if rates else ""
    reason, hint = REASONS[came_to]
    return reason.format(where=where), hint
