"""Whether the robot does what it is told: the wheel speeds of its packets are the only witness.

A robot that obeys is near its command, or comes nearer, or says that it is
stalled; each packet that shows one of the three renews the belief. "Nearer"
means that the larger error of the two wheels fell below the least seen under
this command by more than jitter, so that a robot that merely trembles is not
believed for long.
"""

from p2os.timing import NS_PER_S, Nanos

#: chosen: 1 deg/s is 3 mm/s at the rim of a 2-DX, speeds are whole mm/s, and motors hunt.
TOLERANCE_MPS = 0.04
#: chosen: beside it, for large robots at speed.
TOLERANCE_SHARE = 0.15
#: chosen: less than a tenth of what the gentlest acceleration makes between two packets.
PROGRESS_MPS = 0.002


class Obedience:
    """Compares what was commanded with what the wheels do, in m/s of each wheel."""

    def __init__(self, patience_ns: Nanos) -> None:
        self._patience_ns = patience_ns
        self._command: tuple[float, float] | None = None
        self._least_error = 0.0
        self._believed_at: Nanos = 0
        self._has_told = False
        self._was_near = False

    def expect(self, wheels: tuple[float, float] | None, measured: tuple[float, float], now: Nanos) -> None:
        """Take what the wheels are to do from now on; None: nothing is expected of them.

        A new command measures progress from where the wheels are, and buys no time.
        """
        if wheels == self._command:
            return
        if wheels is None or self._command is None:
            self._believed_at, self._has_told = now, False
        self._command = wheels
        if wheels is not None:
            self._least_error = self._error(measured)

    def take(self, measured: tuple[float, float], *, stalled: bool, now: Nanos) -> str | None:
        """Take the wheel speeds of a packet; return what is not believed, once, or None."""
        if self._command is None:
            return None
        error = self._error(measured)
        near = error <= TOLERANCE_MPS + TOLERANCE_SHARE * max(map(abs, self._command))
        if near or stalled or error <= self._least_error - PROGRESS_MPS:
            self._least_error, self._believed_at, self._has_told = error, now, False
            self._was_near = near
            return None
        if self._was_near:
            self._was_near, self._least_error = False, error  # it has left by itself: its way back counts from here
        if self._has_told or now - self._believed_at < self._patience_ns:
            return None
        self._has_told = True
        return (
            f"for {self._patience_ns / NS_PER_S:g} s the wheels are at {measured[0]:.2f} and {measured[1]:.2f} m/s, "
            f"commanded {self._command[0]:.2f} and {self._command[1]:.2f}, and no stall flag"
        )

    def _error(self, measured: tuple[float, float]) -> float:
        command = self._command or measured
        return max(abs(command[0] - measured[0]), abs(command[1] - measured[1]))
