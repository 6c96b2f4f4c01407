"""The stream of a run's events: parts publish, subscribers get them in order of time.

Parts report in any order; so events wait until nobody can precede them, and `release` hands them on,
sorted by time, then by kind, then by the order of telling. Edges come in bulk: they become events one by
one only on wires that somebody has subscribed to. Where nobody has, nothing is spent on them.

Invariants: what a subscriber gets depends neither on when `release` is called nor on who else subscribes; what waits
is in order.
"""

from bisect import bisect_right, insort
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import itemgetter
from typing import Any, TypeAlias

from p2os.errors import LocalProtocolError
from robot_bench.events.codec import RANKS, Levels, Recorded
from robot_bench.events.kinds import KINDS, PinEdge
from robot_bench.wires.edges import Edges
from simbase.state import Stateful
from simbase.timing import Nanos

Sink: TypeAlias = Callable[[Any], None]
#: Time, rank, order of telling, event.
_Item: TypeAlias = tuple[Nanos, int, int, Recorded]
_TIME = itemgetter(0)
_EDGE_RANK = RANKS[PinEdge]


class EventStream(Stateful):
    """Sorts what parts publish, and hands it on."""

    STATE = ("_pending", "_sequence", "released_until")
    #: Who listens is settled by whoever builds the bench; a batch lives within `release`.
    DERIVED = ("_sinks", "_wires", "_batch", "_place", "_at_limit", "_recorders")

    def __init__(self) -> None:
        self._pending: list[_Item] = []
        self._sequence = 0
        #: Up to when all events were handed on; -1 before the first.
        self.released_until: Nanos = -1
        self._sinks: dict[type, list[Sink]] = {}
        #: Sinks of edges, by wire; None has those of every wire.
        self._wires: dict[str | None, list[Sink]] = {}
        self._recorders: list[Callable[[Sequence[Recorded], Nanos], None]] = []
        self._at_limit: list[Callable[[Nanos], None]] = []
        self._batch: list[_Item] | None = None
        self._place = 0

    def subscribe(self, sink: Sink, *kinds: type, wires: Iterable[str] | None = None) -> Callable[[], None]:
        """Have `sink` called with each event of these kinds; return a function that ends it.

        Args:
            sink: Called in order of time; it may publish, at the time of the event or later.
            kinds: Kinds of events; none means all.
            wires: Of which wires edges are wanted; None means of all.
        """
        lists = [self._sinks.setdefault(kind, []) for kind in kinds or KINDS if kind is not PinEdge]
        if not kinds or PinEdge in kinds:
            lists += [self._wires.setdefault(wire, []) for wire in ([None] if wires is None else wires)]
        for sinks in lists:
            sinks.append(sink)

        def end() -> None:
            for sinks in lists:
                if sink in sinks:
                    sinks.remove(sink)

        return end

    def record(self, recorder: Callable[[Sequence[Recorded], Nanos], None]) -> None:
        """Have `recorder` called after each release with all of it, edges in blocks, and its limit."""
        self._recorders.append(recorder)

    def listeners(self) -> object:
        """Return who listens now, for `drop_later`."""
        copies = [{key: [*sinks] for key, sinks in table.items()} for table in (self._sinks, self._wires)]
        return copies, [*self._at_limit], [*self._recorders]

    def drop_later(self, listeners: Any) -> None:
        """Have nobody listen but those who did when `listeners` was asked."""
        (sinks, wires), at_limit, recorders = listeners
        self._sinks = {key: [*kept] for key, kept in sinks.items()}
        self._wires = {key: [*kept] for key, kept in wires.items()}
        self._at_limit, self._recorders = [*at_limit], [*recorders]

    def at_limit(self, listener: Callable[[Nanos], None]) -> Callable[[], None]:
        """Have `listener` called when all events up to a time were handed on; return a function that ends it."""
        self._at_limit.append(listener)
        return lambda: self._at_limit.remove(listener) if listener in self._at_limit else None

    def publish(self, event: Recorded) -> None:
        """Take an event.

        Raises:
            LocalProtocolError: Events of that time were already handed on.
        """
        if event.t <= self.released_until:
            raise LocalProtocolError(
                f"a {type(event).__name__} at {event.t} ns comes after {self.released_until} ns was handed on"
            )
        self._sequence += 1
        item = event.t, RANKS[type(event)], self._sequence, event
        if self._batch is None:
            self._keep(item)
        else:
            insort(self._batch, item, lo=self._place)  # behind what was handed on

    def _keep(self, item: _Item) -> None:
        """Put an event among those that wait: mostly behind them, but a part may be far ahead of the others."""
        pending = self._pending
        if not pending or pending[-1] < item:
            pending.append(item)
        else:
            insort(pending, item)

    def wants_edges(self, wire: str) -> bool:
        """Whether somebody wants the edges of a wire as events."""
        return bool(self._wires.get(wire) or self._wires.get(None))

    def release(self, limit: Nanos, tracks: Mapping[str, tuple[int, Edges]] | None = None) -> None:
        """Hand on everything stamped at or before `limit`, of which nobody will tell any more.

        Args:
            limit: Up to when.
            tracks: Wires of which `wants_edges` says that they are wanted → their place in the blocks, and their
                edges up to then that were not handed on before.
        """
        pending = self._pending
        count = bisect_right(pending, limit, key=_TIME)
        batch = self._batch = pending[:count]
        self._place = 0
        del pending[:count]
        for wire, (place, track) in (tracks or {}).items():
            batch += [(t, _EDGE_RANK, place, PinEdge(t=t, wire=wire, level=bool(level))) for t, level in track]
        if tracks:
            batch.sort()
        try:
            self._hand_on(batch, limit)
            for listener in [*self._at_limit]:
                listener(limit)
            self._hand_on(batch, limit)
        finally:
            self._batch = None
            self.released_until = max(self.released_until, limit)
            count = bisect_right(batch, limit, key=_TIME)
            for item in batch[count:]:
                self._keep(item)
            recorded = [event for _, rank, _, event in batch[:count] if rank != _EDGE_RANK]
            for recorder in self._recorders:
                recorder(recorded, limit)

    def _hand_on(self, batch: list[_Item], limit: Nanos) -> None:
        """Call the sinks of the rest of a batch, what they publish meanwhile included."""
        sinks = self._sinks
        while self._place < len(batch) and batch[self._place][0] <= limit:
            event = batch[self._place][3]
            self._place += 1
            if isinstance(event, PinEdge):
                self._hand_on_edge(event)
            elif isinstance(event, Levels):
                for net, level in zip(event.nets, event.levels, strict=True):
                    self._hand_on_edge(PinEdge(t=event.t, wire=net, level=level == "1"))
            else:
                for sink in (*sinks.get(type(event), ()),):
                    sink(event)

    def _hand_on_edge(self, edge: PinEdge) -> None:
        for sink in (*self._wires.get(edge.wire, ()), *self._wires.get(None, ())):
            sink(edge)

    def pending(self) -> list[Recorded]:
        """Return what was published and not handed on yet, in order."""
        return [event for *_, event in self._pending]
