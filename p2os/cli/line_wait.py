"""How the verbs' loops wait: for bytes of a line, or until something is due."""

from p2os.timing import NS_PER_MS, NS_PER_S, Nanos
from p2os.transport import Transport
from p2os.transport.waiting import wait_for_bytes
from p2os.transport.wall_clock import GapWatch

#: chosen: how soon a loop notices that it should end.
LONGEST_WAIT_NS: Nanos = 100 * NS_PER_MS


def wait_for_line(transport: Transport, due: Nanos | None, now: Nanos, gaps: GapWatch | None = None) -> None:
    """Wait until a line has bytes or something is due, at most `LONGEST_WAIT_NS`.

    Args:
        transport: The line.
        due: When something is, on the clock of `now`; None: nothing.
        now: When the work before this wait began.
        gaps: Told when the wait ends at the latest.
    """
    longest_ns = LONGEST_WAIT_NS if due is None else min(max(due - now, 0), LONGEST_WAIT_NS)
    if gaps is not None:
        gaps.expect(now + longest_ns)
    wait_for_bytes(transport, longest_ns / NS_PER_S)
