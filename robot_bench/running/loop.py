"""The one run loop: the chip leads, everything else follows to each deadline.

Theory of operation. The leader (the emulated BluePill) runs to the earliest
deadline of the others, but for those who only observe. It may stop short at an edge on a watched net, and late
by one basic block. Then every deadline that the leader has passed is acted on,
in order of time: those who are due are brought there, in their fixed order. At
the moment of an edge on a watched net all are. Nets keep their history, so that
a follower at time t reads the levels of t. A follower that needs another one
brought up to date first (the recorder, the body) brings it there itself.

Where nobody wants control back earlier (for pacing, progress and Ctrl-C), the leader runs
to the deadline in one go; else in slices. Followers are never brought to the boundary of a
slice. So the result does not depend on it.

A debugger may halt the leader, even inside a basic block. Then `run_until`
comes back at once; nobody is brought anywhere before the leader stands at a
boundary again, so that a run with halts is the same as one without.

Invariant: when `run_until(end)` returns without a halt, every deadline before or at the time
reached has been acted on by all, in order of time.
"""

from bisect import insort
from collections.abc import Callable, Sequence
from typing import Protocol

from simbase.errors import P2osError
from simbase.state import Stateful
from simbase.timing import Nanos, Reached

#: How often followers may make each other due at one and the same instant before it is called a fault.
MOST_ROUNDS = 16
#: Later than any deadline.
NEVER: Nanos = 1 << 62


class Leader(Protocol):
    """What leads: it executes a program and may overrun a limit by one basic block."""

    @property
    def now_ns(self) -> int:
        """The time reached."""

    def advance_to(self, limit_ns: int) -> Reached:
        """Run to `limit_ns`, at most a basic block beyond; less far where a watched net changes."""


class Follower(Protocol):
    """A part that is brought to deadlines."""

    def next_deadline(self) -> Nanos | None:
        """Return when this part next wants to act, or None for never."""

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on everything due up to and including `limit`."""


class StuckError(P2osError):
    """Parts kept making each other due without time passing; any such case is a bug here."""


class RunLoop(Stateful):
    """Brings a leader and its followers forward together.

    Args:
        leader: Leads.
        followers: Follow, in this order where several are due.
        observers: Follow after them, and change nothing: the leader does not stop for their deadlines, they are
            brought there when it has stopped for another reason.
        slice_ns: As of the attribute.
        on_slice: As of the attribute.
        choose_watched: Called with `now` whenever followers have acted: chooses which nets are watched, and notes
            their edges after that time that are known already.
    """

    STATE = ("now", "_edges", "_is_inside_block", "_rounds")
    #: Each `run_until` sets them anew.
    DERIVED = ("_end", "_wanted_end", "_advance", "_deadlines", "_is_halted", "led", "_due", "_limit")

    def __init__(
        self,
        leader: Leader,
        followers: Sequence[Follower],
        *,
        observers: Sequence[Follower] = (),
        slice_ns: Nanos = NEVER,
        on_slice: Callable[[Nanos], None] | None = None,
        choose_watched: Callable[[Nanos], None] | None = None,
    ) -> None:
        self.leader = leader
        self.followers = (*followers, *observers)
        self._asks = tuple(part.next_deadline for part in self.followers)
        self._count = len(followers)
        #: The longest that the leader runs without giving control back; whoever wants it may set it at any time.
        self.slice_ns = slice_ns
        self._choose_watched = choose_watched or (lambda _now: None)
        #: Called with the leader's time after each slice; may raise to end the run.
        self.on_slice = on_slice
        #: The last instant that all followers were brought to.
        self.now: Nanos = 0
        self._end: Nanos = 0
        self._wanted_end: Nanos = 0
        #: Where the leader stands between two of its slices, which is asked for more often than it moves.
        self.led: Nanos = leader.now_ns
        #: When somebody is due next.
        self._due: Nanos = 0
        self._edges: list[Nanos] = []
        self._rounds = 0
        self._advance: Callable[[int], Reached] = leader.advance_to
        self._deadlines: list[Nanos] = []
        self._limit: Nanos = NEVER
        #: Whether the leader has halted in this run, and whether it stands inside a block.
        self._is_halted = False
        self._is_inside_block = False

    def note_edge(self, at: Nanos) -> None:
        """Have the followers brought to `at` as well: a watched net has changed there."""
        if at not in self._edges:
            insort(self._edges, at)

    def note_halt(self, *, is_inside_block: bool) -> None:
        """Have `run_until` come back: the leader has halted for a debugger."""
        self._is_halted, self._is_inside_block = True, is_inside_block

    def end_at(self, end: Nanos) -> None:
        """End the present `run_until` earlier, or not earlier after all; what was brought beyond stays there."""
        self._end = min(self._wanted_end, end)

    def run_until(self, end: Nanos, advance: Callable[[int], Reached] | None = None) -> None:
        """Run to `end` in nanoseconds, to what `end_at` sets in the meantime, or to a halt.

        A leader that stands still for good lets time pass like any other.

        Args:
            end: When to come back.
            advance: Brings the leader forward in place of its `advance_to`; a debugger's step.

        Raises:
            StuckError: Two parts make each other due without end.
        """
        self.begin(end, advance)
        while (due := self.lead()) is not None:
            self.follow(due)

    def begin(self, end: Nanos, advance: Callable[[int], Reached] | None = None) -> None:
        """Begin to run to `end`, as `run_until` does, in steps of the caller's: `lead` and `follow` in turn."""
        self._end = self._wanted_end = end
        self._advance = advance or self.leader.advance_to
        self._is_halted = False
        self.led = self.leader.now_ns
        if self._is_inside_block:
            self._is_inside_block = False
            self.led = self._advance(end).now
        self._choose_watched(self.now)
        self._due = self._next_due()

    def lead(self) -> Nanos | None:
        """Let the leader run until followers are due; return when, or None at the end and at a halt."""
        while not self._is_halted:
            if self._due <= self.led and self._due <= self._end:
                return self._due
            if self.led >= self._end:
                return None
            self.led = self._lead(self.led, min(self._end, self._limit))
            if self._edges:
                self._due = min(self._due, self._edges[0])
        return None

    def follow(self, due: Nanos) -> None:
        """Bring those who are due to `due`, which `lead` has returned."""
        self._follow(due)
        self._choose_watched(self.now)
        self._due = self._next_due()

    def finish(self, end: Nanos) -> None:
        """Bring the followers to `end` itself, so that their state is that of the end of the run."""
        for follower in self.followers:
            follower.advance_to(min(end, max(self.leader.now_ns, self.now)))

    def _lead(self, now: Nanos, limit: Nanos) -> Nanos:
        """Let the leader run to `limit`, slice by slice; stop at an edge on a watched net. Return its time."""
        advance, on_slice = self._advance, self.on_slice
        while now < limit and not self._edges and not self._is_halted:
            now = advance(min(limit, now + self.slice_ns)).now
            if on_slice is not None:
                on_slice(now)
        return now

    def _restored(self) -> None:
        self.led = self.leader.now_ns

    def _next_due(self) -> Nanos:
        """Return the earliest deadline, and note those of all, and the earliest of those that the leader stops for."""
        noted = self._deadlines = [NEVER if (at := ask()) is None else at for ask in self._asks]
        self._limit = min(noted[: self._count], default=NEVER)
        due = min(noted, default=NEVER)
        return min(due, self._edges[0]) if self._edges else due

    def _follow(self, due: Nanos) -> None:
        """Bring those who are due to `due`, as noted; at a watched edge all."""
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
