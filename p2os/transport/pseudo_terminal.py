"""Pseudo-terminals: a serial port without hardware, for clients that want a device path.

The master end is ours; a client opens the slave's path, or a symbolic link to
it. The system shows when the last client has closed the slave: reads on the
master then fail until somebody opens it again, and that is our `HungUpError`.

Unix only; nothing here is imported, and `termios` and `pty` are not, until a
`pty:` URL is opened.
"""

import contextlib
import errno
import os
from pathlib import Path

from p2os.errors import TransportError
from p2os.transport.ports import READ_BYTES, HungUpError, Transport
from p2os.transport.url import PtyUrl

#: chosen: short against the second that clients wait for an answer, long against the cost of asking.
POLL_S = 0.02


class PtyMaster:
    """Our end of a pseudo-terminal pair, and the path at which clients find theirs."""

    def __init__(self, url: PtyUrl) -> None:
        try:
            import pty
            import tty
        except ImportError as error:
            raise TransportError("this system has no pseudo-terminals", hint="use tcp:127.0.0.1:8101") from error
        self._link = Path(url.path) if url.path else None
        if self._link is not None:
            _remove_left(self._link)  # before the system gives the number of its terminal to this one
        self.descriptor, slave = pty.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self.descriptor, False)
        if self._link is not None:
            self._make_link(self._link)
        self.description = f"pty:{self._link or self.path}"

    def is_open_at_far_side(self) -> bool:
        """Tell whether a client has the slave open."""
        import select

        poll = select.poll()
        poll.register(self.descriptor, 0)
        return not any(event & select.POLLHUP for _, event in poll.poll(0))

    def close(self) -> None:
        """Close the pair and remove the link."""
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1
        if self._link is not None:
            with contextlib.suppress(OSError):  # somebody else has removed it
                self._link.unlink()
            self._link = None

    def _make_link(self, link: Path) -> None:
        try:
            link.symlink_to(self.path)
        except OSError as error:
            os.close(self.descriptor)
            reason = "something is already there" if error.errno == errno.EEXIST else error.strerror
            raise TransportError(f"cannot make the link {link}: {reason}", hint="choose another path") from error


def _remove_left(link: Path) -> None:
    """Remove a link that a program left which was killed: its terminal is gone."""
    with contextlib.suppress(OSError):  # it is reported where the new one is made
        if link.is_symlink() and not link.exists():
            link.unlink()


class PtyTransport:
    """A byte line over the master end."""

    def __init__(self, master: PtyMaster, *, owns: bool) -> None:
        self.description = master.description
        self._master = master
        self._owns = owns

    def read(self) -> bytes:
        """Return what has arrived without waiting."""
        try:
            return os.read(self._master.descriptor, READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:  # EIO: the last client closed the slave
            raise HungUpError(f"{self.description} was closed by its client") from error

    def write(self, data: bytes) -> None:
        """Send `data`; like a serial line without flow control, what no client reads in time is lost."""
        with contextlib.suppress(BlockingIOError):
            while data:
                data = data[os.write(self._master.descriptor, data) :]

    def fileno(self) -> int:
        """Return the master's descriptor."""
        return self._master.descriptor

    def set_baud(self, baud: int) -> None:
        """Do nothing: a pseudo-terminal has no line speed."""

    def close(self) -> None:
        """Close the pair, unless a listener keeps it for the next client."""
        if self._owns:
            self._master.close()


class PtyListener:
    """A pseudo-terminal that clients open one after the other."""

    poll_s: float | None = POLL_S

    def __init__(self, url: PtyUrl) -> None:
        self._master = PtyMaster(url)
        self.description = self._master.description

    def accept(self) -> Transport | None:
        """Return the line if a client has the terminal open."""
        return PtyTransport(self._master, owns=False) if self._master.is_open_at_far_side() else None

    def fileno(self) -> int | None:
        """Return None: the system does not tell when a terminal is opened."""
        return None

    def close(self) -> None:
        """Close the pair and remove its link."""
        self._master.close()


def open_pty(url: PtyUrl) -> Transport:
    """Return a line over a new pseudo-terminal whose path stands in its description."""
    return PtyTransport(PtyMaster(url), owns=True)
