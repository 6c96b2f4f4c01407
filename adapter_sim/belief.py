"""Whether the robot does what it is told.

P2OS acknowledges nothing. The only witness is the pair of wheel speeds in each
SIP: a robot that obeys is near its command, or comes nearer, or says that it
is stalled. Each SIP that shows one of the three renews the belief; when none has
done so for `disbelief_ns`, the robot is not believed any more.

"Comes nearer" means that the larger error of the two wheels fell by
`progress_mm_s` below the least seen under this command. The larger one of the
two always shrinks while v and ω ramp towards their set-points together; the
smaller one need not. The least error can fall only so often, so a robot that
merely jitters is not believed for long.
"""

from typing import TypeAlias

from p2os.timing import NS_PER_S, Nanos

#: Wheels of the command, wheels measured, least error, time of the last belief.
BeliefSnapshot: TypeAlias = tuple[tuple[int, int], tuple[int, int], int, Nanos]


class Belief:
    """Compares the commanded wheel speeds with those of the SIPs, all in mm/s."""

    def __init__(self, *, patience_ns: Nanos, tolerance_mm_s: int, progress_mm_s: int) -> None:
        self._patience_ns = patience_ns
        self._tolerance_mm_s = tolerance_mm_s
        self._progress_mm_s = progress_mm_s
        self.command = (0, 0)
        self.measured = (0, 0)
        self._least_error = 0
        self._renewed: Nanos = 0

    def begin(self, now: Nanos) -> None:
        """Trust the robot anew."""
        self.command = (0, 0)
        self.measured = (0, 0)
        self._least_error = 0
        self._renewed = now

    def expect(self, left_mm_s: int, right_mm_s: int) -> None:
        """Take a command that is being sent.

        A new one measures progress from where the wheels are now; it buys no
        time, or a firmware that changes its mind often would hide a deaf robot.
        """
        if (left_mm_s, right_mm_s) != self.command:
            self.command = (left_mm_s, right_mm_s)
            self._least_error = self._error()

    def take(self, left_mm_s: int, right_mm_s: int, *, stalled: bool, now: Nanos) -> None:
        """Take the wheel speeds and stall flags of a SIP."""
        was_near = self._error() <= self._tolerance_mm_s
        self.measured = (left_mm_s, right_mm_s)
        error = self._error()
        if error <= self._tolerance_mm_s or stalled or error <= self._least_error - self._progress_mm_s:
            self._least_error = error
            self._renewed = now
        elif was_near:
            # It has left its command by itself: its way back is measured from here.
            self._least_error = error

    @property
    def ends_at(self) -> Nanos:
        """Return when the patience runs out unless a SIP renews it."""
        return self._renewed + self._patience_ns

    def describe(self) -> str:
        """Return what is not believed, for people."""
        return (
            f"wheels at {self.measured[0]} and {self.measured[1]} mm/s for {self._patience_ns / NS_PER_S:.1f} s, "
            f"commanded {self.command[0]} and {self.command[1]}, and no stall flag"
        )

    def snapshot(self) -> BeliefSnapshot:
        """Return all of it as plain values."""
        return self.command, self.measured, self._least_error, self._renewed

    def restore(self, snapshot: BeliefSnapshot) -> None:
        """Put back what `snapshot` returned."""
        self.command, self.measured, self._least_error, self._renewed = snapshot

    def _error(self) -> int:
        return max(abs(self.command[0] - self.measured[0]), abs(self.command[1] - self.measured[1]))
