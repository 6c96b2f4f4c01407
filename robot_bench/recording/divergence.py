"""Where two runs of one scenario part: the first difference of each signal, in order of time.

A signal is what one can look at by itself: a wire, a port's text, a bus, the packets of one direction, the pose, a
part's state log. Runs are compared event by event; verdicts, which follow from the rest, are left out.

Invariant: two runs with the same trace hash do not differ, and others do unless they differ in what no event tells.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import zip_longest

from robot_bench.events.kinds import (
    CanTransfer,
    Event,
    I2cTransfer,
    Note,
    Packet,
    PinEdge,
    SpiTransfer,
    Text,
    Verdict,
    Wave,
)
from simbase.timing import Nanos


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """The first one of a signal: what each run tells there, None where it tells nothing more; `at` is the earlier."""

    signal: str
    at: Nanos
    one: Event | None
    other: Event | None


def signal_of(event: Event) -> str:
    """Return the name of the signal that an event belongs to."""
    if isinstance(event, PinEdge | Wave):
        return event.wire
    if isinstance(event, Text):
        return f"{event.port} text"
    if isinstance(event, SpiTransfer | I2cTransfer | CanTransfer):
        return event.bus
    if isinstance(event, Packet):
        return f"packets {event.direction}"
    if isinstance(event, Note):
        return f"log of {event.who}"
    return type(event).__name__.lower()


def differences(one: Iterable[Event], other: Iterable[Event]) -> list[Difference]:
    """Return the first difference of each signal that has one, the earliest first."""
    ours, theirs = _by_signal(one), _by_signal(other)
    found = []
    for signal in {**ours, **theirs}:
        for a, b in zip_longest(ours.get(signal, ()), theirs.get(signal, ())):
            if a != b:
                at = min(event.t for event in (a, b) if event is not None)
                found.append(Difference(signal=signal, at=at, one=a, other=b))
                break
    return sorted(found, key=lambda difference: (difference.at, difference.signal))


def _by_signal(events: Iterable[Event]) -> dict[str, list[Event]]:
    found: dict[str, list[Event]] = {}
    for event in events:
        if not isinstance(event, Verdict):
            found.setdefault(signal_of(event), []).append(event)
    return found
