"""When the adapter looks at its input pins: every period, or only from an edge on once they have settled.

Invariant: sample instants are whole periods apart from each other, slept through or not.
"""

from p2os.timing import Nanos


class SampleClock:
    """The next sample instant."""

    def __init__(self, period_ns: Nanos) -> None:
        self._period_ns = period_ns
        self.next: Nanos = 0
        #: Whether whoever runs the adapter brings it to every edge of its input wires: then it looks at
        #: settled pins no more until one comes.
        self.waits_for_edges = False
        self.is_asleep = False

    def after(self, now: Nanos) -> None:
        """Let the next sample come a period after `now`."""
        self.next = now + self._period_ns

    def was_quiet(self, now: Nanos) -> None:
        """Note that the sample at `now` changed nothing and that later ones will not either without an edge."""
        self.after(now)
        self.is_asleep = self.waits_for_edges

    def wake(self, now: Nanos) -> None:
        """Go on from the first sample instant at or after `now`; those before would have changed nothing."""
        if self.is_asleep:
            self.is_asleep = False
            self.next += max(0, -((self.next - now) // self._period_ns)) * self._period_ns

    def due(self, other: Nanos) -> Nanos:
        """Return the earlier of the next sample that is taken and another deadline."""
        return other if self.is_asleep else min(self.next, other)
