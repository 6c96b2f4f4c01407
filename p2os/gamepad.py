"""A game pad as what drives a robot: plain reports in, a connect request and deflections out.

Up connects, Down disconnects, R2 drives forward, L2 backward, the right stick
turns: the mapping of the thesis. The connect request lasts from Up to Down, or until the
pad is lost or the robot is; it has to be given anew then. A button that was down
when the pad went, or when the robot was given to it, must come up before it
means anything.

Not here: pads themselves. Whoever reads one (the adapter's firmware, `p2os
teleop --pad`) brings its reports into this form.
"""

from dataclasses import dataclass

from simbase.state import Stateful
from simbase.timing import NS_PER_MS, Nanos

#: Full deflections: a trigger from 0, the stick from its middle.
TRIGGER_FULL, STICK_FULL = 1023, 511
#: Speeds at full deflection, mm/s and mrad/s (the thesis, listing 5.5; the later repository has 0.5 m/s).
PAD_MM_S, PAD_MRAD_S = 400, 1700
PAD_MPS, PAD_RADPS = PAD_MM_S / 1000, PAD_MRAD_S / 1000
#: chosen: triggers below this of 1023, and sticks nearer to the middle than this of 511, count as at rest.
PAD_DEAD = 40
#: chosen: a pad that was silent so long is lost: with a pair being sent and the STOP, less than 200 ms.
PAD_LOSS_NS: Nanos = 150 * NS_PER_MS


@dataclass(frozen=True, slots=True, kw_only=True)
class PadReport:
    """One report of a pad, of whatever make.

    Args:
        up: The button that connects.
        down: The button that disconnects; it wins over Up.
        forward: R2, 0 to 1023.
        backward: L2, 0 to 1023.
        turn: Right stick, −512 (left) to 511 (right).
    """

    up: bool = False
    down: bool = False
    forward: int = 0
    backward: int = 0
    turn: int = 0


class Gamepad(Stateful):
    """What the newest report asks for."""

    STATE = ("_reported_at", "forward", "turn", "_was_up", "wants_robot")

    def __init__(
        self, *, trigger_dead: int = PAD_DEAD, stick_dead: int = PAD_DEAD, loss_ns: Nanos = PAD_LOSS_NS
    ) -> None:
        """Make a pad that has not reported yet.

        Args:
            trigger_dead: Deflection of a trigger up to which it counts as released, 0 to 1022.
            stick_dead: The same of the stick, 0 to 510.
            loss_ns: Silence after which the pad counts as lost, nanoseconds.
        """
        self._trigger_dead = trigger_dead
        self._stick_dead = stick_dead
        self._loss_ns = loss_ns
        self._reported_at: Nanos | None = None
        #: Deflections after their dead zones: forward of 1023, turn to the left of 511.
        self.forward = 0
        self.turn = 0
        self._was_up = True
        self.wants_robot = False

    @property
    def lost_at(self) -> Nanos | None:
        """Return when the pad counts as lost unless a report comes before; None before its first report."""
        return None if self._reported_at is None else self._reported_at + self._loss_ns

    def take(self, report: PadReport, now: Nanos) -> None:
        """Take a report that came at `now`."""
        self._reported_at = now
        if report.down:
            self.wants_robot = False
        elif report.up and not self._was_up:
            self.wants_robot = True
        self._was_up = report.up
        dead = self._trigger_dead
        self.forward = _outside(report.forward, dead, TRIGGER_FULL) - _outside(report.backward, dead, TRIGGER_FULL)
        self.turn = -_outside(report.turn, self._stick_dead, STICK_FULL)

    def forget_request(self) -> None:
        """Drop the connect request: the session that it asked for has ended."""
        self.wants_robot = False

    def lose(self) -> None:
        """Take note that the pad is lost."""
        self._reported_at = None
        self.wants_robot = False
        self._was_up = True
        self.forward = self.turn = 0


def _outside(value: int, dead: int, full: int) -> int:
    """Return a deflection with its dead zone taken out and the rest stretched to the full range, towards zero."""
    size = abs(value)
    if size <= dead:
        return 0
    stretched = (min(size, full) - dead) * full // (full - dead)
    return stretched if value >= 0 else -stretched
