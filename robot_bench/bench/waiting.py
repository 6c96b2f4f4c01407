"""Waits for an event of a bench, from the one on that was waited for last.

A bench stands up to 50 ms after the event that it has waited for. What happens next may be reported by then already,
and is in the trace; so each step notes where the trace stood before it, and a next wait reads on from there.

Invariant: what is found depends on the times of the events alone, not on where the bench stands.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TypeAlias

from robot_bench.events.codec import Blocks, events_of
from robot_bench.events.kinds import Event
from robot_bench.events.selection import Selector
from robot_bench.events.stream import EventStream
from robot_bench.recording.recorder import SAMPLE_NS
from robot_bench.recording.trace import TraceWriter
from robot_bench.wires.nets import Harness, Net
from simbase.timing import Nanos

#: Runs until something is so or to a time, and calls its third argument before each step.
StepUntil = Callable[[Callable[[], bool], Nanos, Callable[[], None]], bool]


class EventWait:
    """Waits for the events of one bench.

    Args:
        events: What happens.
        trace: Where it is written.
        harness: The wires.
    """

    def __init__(self, events: EventStream, trace: TraceWriter, harness: Harness) -> None:
        self._events, self._trace, self._nets = events, trace, tuple(harness)
        #: What was waited for last, and when the bench stood still after it.
        self._last: tuple[Nanos, Event | None] = (-1, None)
        #: Where in the trace the events of the last step are, and the wires' levels there; None: from its beginning.
        self._mark: TraceMark = None

    def forget(self) -> None:
        """Have the next event counted from when it is asked for: something was done, or time was set back."""
        self._last, self._mark = (-1, None), None

    def since(self, now: Nanos) -> Nanos:
        """Return from when on the next event counts: from the last one, where nothing was done since."""
        at, event = self._last
        return event.t if event is not None and at == now else now

    def wait(self, selector: Selector, limit: Nanos, now: Callable[[], Nanos], step_until: StepUntil) -> Event | None:
        """Run until an event happens that counts and is not later than `limit`; return it, or None."""
        since, last, found = self.since(now()), self._last[1], list[Event]()

        def take(event: Event) -> None:
            if selector.takes(event) and since <= event.t <= limit and (event.t > since or event != last):
                found.append(event)

        if since < now():
            for event in self._reported_since_mark():
                if type(event) in selector.kinds:
                    take(event)
        end = self._events.subscribe(take, *selector.kinds, wires=selector.wires)
        try:
            # What happened until the limit is reported at the pose after it.
            step_until(lambda: bool(found), -(-limit // SAMPLE_NS) * SAMPLE_NS, self._mark_here)
        finally:
            end()
        self._last = (now(), found[0]) if found else (-1, None)
        return found[0] if found else None

    def _mark_here(self) -> None:
        """Note where the trace stands: what is reported from now on begins there."""
        self._mark = mark_of(self._events, self._trace, self._nets)

    def _reported_since_mark(self) -> Iterable[Event]:
        """Return the events of the last step."""
        return events_since(self._mark, self._trace)


#: Where a trace stands, and the wires' levels there; None: at its beginning.
TraceMark: TypeAlias = tuple[int, Blocks] | None


def mark_of(events: EventStream, trace: TraceWriter, nets: Iterable[Net]) -> TraceMark:
    """Return where a trace stands: what is reported from now on begins there."""
    nets, at = tuple(nets), events.released_until
    if at < 0:
        return None
    levels = bytearray(not net.wave(at) and net.level(at) for net in nets)
    return trace.length, Blocks(tuple(net.name for net in nets), levels)


def events_since(mark: TraceMark, trace: TraceWriter) -> Iterable[Event]:
    """Return what a trace tells from a place on."""
    if mark is None:
        return events_of(trace.lines())
    length, blocks = mark
    return events_of(trace.lines(length), begun=replace(blocks, levels=bytearray(blocks.levels)))
