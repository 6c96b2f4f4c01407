"""How fast a robot is to drive as pages say it, and that it stands when nothing is heard of them.

Passive: time is an argument. A page says what is held again and again (`DRIVE_HOLD_NS`).

Invariant: what was held when it was stopped, or when nothing was heard for so long, drives nothing until it was let go.
"""

from p2os.view.run_control import DRIVE_HOLD_NS
from simbase.timing import Nanos

STILL = (0.0, 0.0)


class DriveDeadman:
    """What pages want of a robot, m/s ahead and degrees a second counter-clockwise.

    Args:
        most_mps: It is told no more.
        most_dps: Likewise.
    """

    def __init__(self, most_mps: float, most_dps: float) -> None:
        self._most = most_mps, most_dps
        self._until: Nanos | None = None
        #: Whether what is held means nothing until it was let go.
        self.is_stopped = False
        #: How fast it is to drive now.
        self.speeds = STILL

    @property
    def is_driving(self) -> bool:
        """Whether it is to move."""
        return self.speeds != STILL

    def ask(self, forward_mps: float, turn_dps: float, now: Nanos) -> None:
        """Take what a page says is held; nothing is what lets go."""
        self.advance_to(now)
        if not forward_mps and not turn_dps:
            self.is_stopped = False
            self._stand()
        elif not self.is_stopped:
            most_mps, most_dps = self._most
            self.speeds = _cut(forward_mps, most_mps), _cut(turn_dps, most_dps)
            self._until = now + DRIVE_HOLD_NS

    def stop(self) -> None:
        """Stand, until what is held was let go."""
        self.is_stopped = True
        self._stand()

    def next_deadline(self) -> Nanos | None:
        """Return when it stands if nothing is heard; None: it stands."""
        return self._until

    def advance_to(self, now: Nanos) -> None:
        """Stand where nothing was heard for too long."""
        if self._until is not None and now >= self._until:
            self.stop()

    def _stand(self) -> None:
        self.speeds, self._until = STILL, None


def _cut(value: float, most: float) -> float:
    return max(-most, min(most, value))
