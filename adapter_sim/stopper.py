"""The stop sequence after a session, said again and again: nobody confirms it.

After a loss it goes out once and then `stop_repeats` times more. A robot that was
closed in peace shows by its silence that it has understood: to such a one the
sequence is repeated only while it is still heard.
"""

from typing import TypeAlias

from adapter_sim.session import Session
from adapter_sim.settings import AdapterSettings
from p2os.timing import NS_PER_MS, Nanos

#: A robot heard from so recently is still streaming: one SIP period.
_ECHO_NS: Nanos = 100 * NS_PER_MS

#: Next repetition, how many are left, whether in peace, when the robot was heard last.
StopperSnapshot: TypeAlias = tuple[Nanos, int, bool, Nanos]


class Stopper:
    """How often the stop sequence is still to be said, and when."""

    def __init__(self, settings: AdapterSettings) -> None:
        self._repeats = settings.stop_repeats
        self._period_ns = settings.stop_repeat_ns
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._at: Nanos = 0
        self._left = 0
        self._in_peace = False
        #: When bytes of the robot came last. A SIP found late, behind a false header, is as old as they are.
        self.heard_at: Nanos = 0

    @property
    def due_at(self) -> Nanos | None:
        """Return when the next repetition is due, None for no more."""
        return self._at if self._left else None

    def hear(self, now: Nanos) -> None:
        """Take note that bytes of the robot came."""
        self.heard_at = now

    def begin(self, session: Session, now: Nanos) -> None:
        """Say the sequence and CLOSE, and plan its repetitions; `end_in_peace` may follow."""
        session.abandon(now)
        self._left = self._repeats
        self._at = now + self._period_ns
        self._in_peace = False

    def end_in_peace(self) -> None:
        """Take note that the session ended on its master's wish."""
        self._in_peace = True

    def cancel(self) -> None:
        """Plan nothing more: a new session begins, and with it a new sequence."""
        self._left = 0

    def repeat(self, session: Session, now: Nanos) -> None:
        """Say it again if it is due."""
        if self._left and now >= self._at:
            self._left -= 1
            self._at = now + self._period_ns
            if not self._in_peace or now - self.heard_at < _ECHO_NS:
                session.abandon(now)

    def snapshot(self) -> StopperSnapshot:
        """Return all of it as plain values."""
        return self._at, self._left, self._in_peace, self.heard_at

    def restore(self, snapshot: StopperSnapshot) -> None:
        """Put back what `snapshot` returned."""
        self._at, self._left, self._in_peace, self.heard_at = snapshot
