"""The one run loop: the chip leads, everything else follows to each deadline.

Theory of operation. The leader (the emulated BluePill) runs to the earliest
deadline of the others. It may stop short at an edge on a watched net, and late
by one basic block. Then every deadline that the leader has passed is acted on,
in order of time: those who are due are brought there, in their fixed order. At
the moment of an edge on a watched net all are. Nets keep their history, so that
a follower at time t reads the levels of t. A follower that needs another one
brought up to date first (the recorder, the body) says so itself.

Followers are never brought to the border of a slice: the slice limit only says
how often the leader gives control back (for pacing, progress and Ctrl-C). So
the result does not depend on it.

Invariant: when `run_until(end)` returns, every deadline before or at the time
reached has been acted on by all, in order of time.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, cast

from p2os.errors import P2osError
from p2os.timing import NS_PER_MS, Nanos, Reached

#: chosen: the pacer's grain; small enough for a live view, large enough to cost nothing.
DEFAULT_SLICE_NS: Nanos = 1 * NS_PER_MS
#: How often followers may wake each other at one and the same instant before it is called a fault.
MOST_ROUNDS = 16
#: Later than any deadline.
NEVER: Nanos = 1 << 62


class Leader(Protocol):
    """What leads: it executes a program and may overrun a limit by one basic block."""

    @property
    def now_ns(self) -> int:
        """The time reached."""
        ...

    def advance_to(self, limit_ns: int) -> "LeaderReached":
        """Run to `limit_ns`, at most a basic block beyond; less far where a watched net changes."""
        ...


class LeaderReached(Protocol):
    """How far a leader came."""

    @property
    def now(self) -> int:
        """The time reached."""
        ...


class Follower(Protocol):
    """A part that is brought to deadlines."""

    def next_deadline(self) -> Nanos | None:
        """Return when this part next wants to act, or None for never."""
        ...

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on everything due up to and including `limit`."""
        ...


class StuckError(P2osError):
    """Parts kept waking each other without time passing; any such case is a bug here."""


class RunLoop:
    """Brings a leader and its followers forward together."""

    def __init__(
        self,
        leader: Leader,
        followers: Sequence[Follower],
        *,
        slice_ns: Nanos = DEFAULT_SLICE_NS,
        on_slice: Callable[[Nanos], None] | None = None,
    ) -> None:
        self.leader = leader
        self.followers = tuple(followers)
        self.slice_ns = slice_ns
        #: Called with the leader's time after each slice; may raise to end the run.
        self.on_slice = on_slice
        #: The last instant that all followers were brought to.
        self.now: Nanos = 0
        self._end: Nanos = 0
        self._edges: list[Nanos] = []
        self._rounds = 0
        self._deadlines: list[Nanos] = []

    def note_edge(self, at: Nanos) -> None:
        """Have the followers brought to `at` as well: a watched net has changed there."""
        if not self._edges or self._edges[-1] != at:
            self._edges.append(at)

    def end_at(self, end: Nanos) -> None:
        """End the present `run_until` earlier; what was brought beyond stays there."""
        self._end = min(self._end, end)

    def run_until(self, end: Nanos) -> None:
        """Run to `end` in nanoseconds, or to what `end_at` says in the meantime.

        A leader that stands still for good lets time pass like any other.

        Raises:
            StuckError: Two parts wake each other for ever.
        """
        self._end = end
        led = self.leader.now_ns
        while True:
            due = self._next_due()
            if due <= led and due <= self._end:
                self._follow(due)
            elif led >= self._end:
                return
            else:
                led = self._lead(led, min(due, self._end))

    def finish(self, end: Nanos) -> None:
        """Bring the followers to `end` itself, so that their state is that of the end of the run."""
        for follower in self.followers:
            follower.advance_to(min(end, max(self.leader.now_ns, self.now)))

    def snapshot(self) -> dict[str, object]:
        """Return the loop's own state; the parts are saved by whoever built them."""
        return {"now": self.now, "edges": tuple(self._edges)}

    def restore(self, snapshot: Mapping[str, object]) -> None:
        """Put back what `snapshot` returned."""
        self.now = cast("int", snapshot["now"])
        self._edges = list(cast("tuple[int, ...]", snapshot["edges"]))

    def _lead(self, now: Nanos, limit: Nanos) -> Nanos:
        """Let the leader run to `limit`, slice by slice; stop at an edge on a watched net. Return its time."""
        leader, slice_ns, on_slice = self.leader, self.slice_ns, self.on_slice
        while now < limit and not self._edges:
            now = leader.advance_to(min(limit, now + slice_ns)).now
            if on_slice is not None:
                on_slice(now)
        return now

    def _next_due(self) -> Nanos:
        """Return the earliest deadline, and note everybody's."""
        due = self._edges[0] if self._edges else NEVER
        noted = self._deadlines = [
            NEVER if at is None else at for at in [part.next_deadline() for part in self.followers]
        ]
        return min(due, *noted) if noted else due

    def _follow(self, due: Nanos) -> None:
        """Bring those who are due to `due`, as noted; at a watched edge everybody."""
        self._rounds = self._rounds + 1 if due <= self.now else 0
        if self._rounds > MOST_ROUNDS:
            late = [type(part).__name__ for part in self.followers if (part.next_deadline() or NEVER) <= due]
            raise StuckError(f"time stands still at {due} ns: {', '.join(late)} stay due")
        self.now = max(self.now, due)
        has_edge = bool(self._edges) and self._edges[0] <= due
        while self._edges and self._edges[0] <= due:
            self._edges.pop(0)
        for follower, deadline in zip(self.followers, self._deadlines, strict=True):
            if has_edge or deadline <= due:
                follower.advance_to(self.now)
