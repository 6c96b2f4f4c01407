"""What the rest of the project needs of a byte line, and how a line is lost.

A transport moves bytes and keeps no time: reads never block, writes are queued
by the operating system. It knows nothing of frames.
"""

from typing import Protocol

from p2os.errors import TransportError

#: The most bytes that one `read` returns, so that a flood cannot starve its caller.
READ_BYTES = 4096


class HungUpError(TransportError):
    """The far side has gone; nothing more will come."""


class RefusedPeerError(HungUpError):
    """The far side was refused before any byte of it was returned: it never was a peer."""


class Transport(Protocol):
    """An open byte line to one peer."""

    description: str

    def read(self) -> bytes:
        """Return what has arrived, at most 4096 bytes, without waiting; empty when nothing has.

        Raises:
            HungUpError: the far side has gone and all its bytes were read.
            RefusedPeerError: it is none that may speak here; nothing of it was returned.
            TransportError: the line failed.
        """
        ...

    def write(self, data: bytes) -> None:
        """Send all of `data`, in order; bytes that the line cannot take yet are kept and sent first next time.

        Raises:
            HungUpError: the far side has gone.
            TransportError: the line failed, or its reader has fallen too far behind.
        """
        ...

    def fileno(self) -> int:
        """Return the descriptor that `select` finds readable when `read` has something to return or to raise."""
        ...

    def set_baud(self, baud: int) -> None:
        """Change the line's speed in bit/s; no effect where there is no such thing."""
        ...

    def close(self) -> None:
        """Give the line back; a second call changes nothing."""
        ...


class Listener(Protocol):
    """A place where one peer at a time can reach us."""

    #: The URL or path that a client opens.
    description: str
    #: Seconds after which `accept` is worth asking again, or None where `fileno` shows it.
    poll_s: float | None

    def accept(self) -> Transport | None:
        """Return the line to a peer that has come, or None, without waiting."""
        ...

    def fileno(self) -> int | None:
        """Return the descriptor that `select` finds readable when a peer has come; None where only polling shows it."""
        ...

    def close(self) -> None:
        """Stop listening; a second call changes nothing."""
        ...
