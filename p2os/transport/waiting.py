"""Waiting for lines, and how they end: every wait for a descriptor in the project is one of these.

`wait_readable` waits for descriptors, `wait_for_bytes` and `wait_for_line` for one line.
`has_hung_up` asks whether the far side has gone, without reading what it has left behind.
`ClosingLines` keeps the lines of peers that were refused until they have read why: to
close a socket whose bytes are unread resets the connection, and the reset overtakes the
reason. Opening and reading lines is the transports' (`p2os.transport.ports`). `waits_of`
gives how the threads of a client or host wait by their clock: really, or on a virtual one.

Invariant: no wait lasts longer than it was asked to.
"""

import contextlib
import select
import socket
import threading
import time
from collections.abc import Iterable
from typing import Protocol, runtime_checkable

from p2os.errors import TransportError
from p2os.transport.ports import READ_BYTES, Transport
from p2os.transport.sockets import SocketTransport
from p2os.transport.wall_clock import Clock, GapWatch
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: how often a line without a descriptor is asked for bytes; a millisecond is a character at 9600 bit/s.
BLIND_POLL_S = 0.001
#: `select` ends waits to the microsecond, but knows no descriptor from here on (FD_SETSIZE); `poll` to the millisecond.
SELECT_LIMIT = 1024
#: chosen: how soon a loop on a line notices that it should end.
LONGEST_WAIT_NS: Nanos = 100 * NS_PER_MS
#: chosen: a peer reads a reason within a round trip, and this is many.
LONGEST_CLOSING_NS: Nanos = 2 * NS_PER_S
#: chosen: of a thousand that come at once so many get the reason; each is a descriptor meanwhile.
MOST_CLOSING = 16
#: chosen: 64 KB of what such a peer still sends are discarded a poll, so that none of them keeps the others waiting.
READS_A_POLL = 16


def wait_readable(descriptors: Iterable[int], longest_s: float) -> set[int]:
    """Return the descriptors that have something to read, hung up included, as soon as there is one.

    Args:
        descriptors: Whom to wait for; without any it just waits.
        longest_s: Seconds after which nothing is an answer too; 0 or less only looks.
    """
    found = list(descriptors)
    if not found:
        time.sleep(max(longest_s, 0.0))
        return set()
    longest_s = max(longest_s, 0.0)
    if max(found) < SELECT_LIMIT or not hasattr(select, "poll"):
        return set(select.select(found, [], [], longest_s)[0])
    poll = select.poll()
    for descriptor in found:
        poll.register(descriptor, select.POLLIN)
    return {descriptor for descriptor, _ in poll.poll(longest_s * 1000)}


class WakeUp:
    """Ends another thread's wait for descriptors: readable from `ring` on until it is cleared; no call of it waits."""

    def __init__(self) -> None:
        self._read, self._write = socket.socketpair()
        self._read.setblocking(False)
        self._write.setblocking(False)

    def fileno(self) -> int:
        """Return the descriptor to wait for."""
        return self._read.fileno()

    def ring(self) -> None:
        """Become readable; nothing where it is closed."""
        with contextlib.suppress(OSError):  # full: it is readable anyway
            self._write.send(b"\0")

    def clear(self) -> None:
        """Be no longer readable; before looking what there is to do."""
        with contextlib.suppress(OSError):  # nothing there; or it stays readable, and is cleared at the next look
            self._read.recv(4096)

    def close(self) -> None:
        """Give the descriptors back."""
        self._read.close()
        self._write.close()


@runtime_checkable
class Waits(Protocol):
    """How the threads of a program wait for lines and for each other."""

    def wait_readable(self, descriptors: Iterable[int], longest_s: float) -> set[int]:
        """Wait for descriptors, as the function of this name."""
        ...

    def wait_for_change(self, changed: threading.Condition, longest_s: float) -> None:
        """Wait under a condition, at most so long; who calls looks again whether it is what was waited for."""
        ...

    def look(self, longest_s: float) -> None:
        """Let others work for so long at most, before this thread looks what they have done; takes no lock."""
        ...

    def add(self, thread: threading.Thread) -> None:
        """Make a thread known that was started."""
        ...


class RealWaits:
    """Waits in real time, where threads need not know of each other."""

    def wait_readable(self, descriptors: Iterable[int], longest_s: float) -> set[int]:
        """Wait for descriptors."""
        return wait_readable(descriptors, longest_s)

    def wait_for_change(self, changed: threading.Condition, longest_s: float) -> None:
        """Wait until a condition is notified."""
        changed.wait(longest_s)

    def look(self, longest_s: float) -> None:
        """Sleep."""
        time.sleep(longest_s)

    def add(self, thread: threading.Thread) -> None:
        """Do nothing."""


def waits_of(clock: Clock) -> Waits:
    """Return how threads with this clock wait: its own way where it has one (`VirtualClock`), else in real time."""
    return clock if isinstance(clock, Waits) else RealWaits()


def wait_for_bytes(transport: Transport, longest_s: float) -> None:
    """Wait until a line has something to read; one that cannot be waited for is to be asked often."""
    try:
        wait_readable((transport.fileno(),), longest_s)
    except (TransportError, OSError, ValueError):  # no descriptor, or a line that was closed: its `read` raises
        time.sleep(min(max(longest_s, 0.0), BLIND_POLL_S))


def wait_for_line(transport: Transport, due: Nanos | None, now: Nanos, gaps: GapWatch | None = None) -> None:
    """Wait until a line has bytes or something is due, at most `LONGEST_WAIT_NS`.

    Args:
        transport: The line.
        due: When something is, on the clock of `now`; None: nothing.
        now: When the work before this wait began.
        gaps: Is given the time at which the wait ends at the latest.
    """
    longest_ns = LONGEST_WAIT_NS if due is None else min(max(due - now, 0), LONGEST_WAIT_NS)
    if gaps is not None:
        gaps.expect(now + longest_ns)
    wait_for_bytes(transport, longest_ns / NS_PER_S)


def has_hung_up(descriptor: int) -> bool:
    """Tell whether the other end is closed, though bytes may still wait; False where a system cannot tell."""
    if not hasattr(select, "poll"):
        return False
    closed_for_writing: int = getattr(select, "POLLRDHUP", 0)  # Linux alone shows that of a socket
    poll = select.poll()
    poll.register(descriptor, closed_for_writing)
    gone = select.POLLHUP | select.POLLERR | closed_for_writing
    return any(event & gone for _, event in poll.poll(0))


class ClosingLines:
    """Lines of peers that were refused with a reason, open until the peer has read it.

    Args:
        clock: Nanoseconds; never goes back.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._closing: list[tuple[Transport, Nanos]] = []

    def __len__(self) -> int:
        """Return how many have not left yet."""
        return len(self._closing)

    def add(self, transport: Transport, reason: str) -> None:
        """Send a peer the reason, and close its line once it has left; at once where a line cannot carry a reason."""
        if not isinstance(transport, SocketTransport):
            _close(transport)
            return
        transport.refuse(reason)
        self._closing.append((transport, self._clock() + LONGEST_CLOSING_NS))
        if len(self._closing) > MOST_CLOSING:
            _close(self._closing.pop(0)[0])
        self.poll()

    def poll(self) -> None:
        """Close the lines of peers that have left, or that were given time enough."""
        if self._closing:
            now = self._clock()
            self._closing = [(line, until) for line, until in self._closing if not _is_over(line, is_late=now >= until)]

    def close(self) -> None:
        """Close every line."""
        while self._closing:
            _close(self._closing.pop()[0])


def _is_over(transport: Transport, *, is_late: bool) -> bool:
    with contextlib.suppress(TransportError):
        for _ in range(READS_A_POLL):
            if len(transport.read()) < READ_BYTES:
                break
        if not is_late:
            return False
    _close(transport)
    return True


def _close(transport: Transport) -> None:
    with contextlib.suppress(TransportError):
        transport.close()
