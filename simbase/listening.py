"""TCP listeners of protocols that are not HTTP, and connections that no web page can use.

A page may have its browser send a POST with any body to any port of this machine, and whoever listens there is not
asked (Fetch standard, mode "no-cors"). A protocol that passes over what it does not understand would obey the body.
`listen_tcp` makes every listener of ours; a connection that it accepts is closed, and the refusal logged as
`p2os.listening`, once its first bytes are one of `OPENINGS`: nothing of it is ever returned by `recv`.

First bytes that may still become an opening are kept, and returned with the first byte that rules it out, or before
the end of the connection. None of our protocols begins with such a byte (P2OS: 0xFA; GDB: `+` or `$`; an operator's
orders: lower case), so nothing of theirs waits.

Source: RFC 9110 9 and RFC 5789 (methods), RFC 9113 3.4 (`PRI *`), RFC 8446 5.1 (TLSPlaintext: handshake, 0x03, 0x01 or
0x03; 0x02 and 0x04 are of older clients and of drafts).
Invariant: what `recv` has returned, joined, is all that came, or nothing.
"""

import contextlib
import errno
import logging
import socket
import sys

METHODS = ("GET", "HEAD", "POST", "PUT", "DELETE", "CONNECT", "OPTIONS", "TRACE", "PATCH")
#: How a browser begins, or whatever speaks like one → what that is.
OPENINGS = {
    **{f"{method} ".encode(): "an HTTP request" for method in METHODS},
    b"PRI *": "an HTTP/2 preface",
    **{bytes((0x16, 0x03, minor)): "a TLS record" for minor in (1, 2, 3, 4)},
}

LOGGER = "p2os.listening"


class WebClientError(ConnectionAbortedError):
    """A web browser, or what speaks like one, has connected to something else than a web server."""


class FirstBytes:
    """Tells from the first bytes of a connection whether a browser sent them; passive."""

    def __init__(self) -> None:
        self._kept = b""
        self._is_decided = False
        #: How it began, once it is refused.
        self.refused: str | None = None

    @property
    def kept_bytes(self) -> int:
        """How many bytes wait for the next."""
        return len(self._kept)

    def take(self, data: bytes) -> bytes:
        """Return what may be passed on: all that has come, or nothing while that may still become an opening.

        Raises:
            WebClientError: It is one; so says each later call.
        """
        if self._is_decided:
            return data
        self._kept += data
        for opening, what in OPENINGS.items():
            if self._kept.startswith(opening):
                self.refused = f"begins with {what}, {_shown(opening)}"
        if self.refused is None and any(opening.startswith(self._kept) for opening in OPENINGS):
            return b""
        return self.end()

    def end(self) -> bytes:
        """Return what was kept: nothing more will come, or it is decided.

        Raises:
            WebClientError: As of `take`.
        """
        if self.refused is not None:
            self._kept = b""
            raise WebClientError(self.refused)
        self._is_decided, kept, self._kept = True, self._kept, b""
        return kept


class GuardedConnection(socket.socket):
    """What `listen_tcp` accepts: a socket, read by `recv` or `recv_into`."""

    def __init__(self, accepted: socket.socket) -> None:
        timeout = accepted.gettimeout()
        super().__init__(accepted.family, accepted.type, accepted.proto, fileno=accepted.detach())
        self.settimeout(timeout)
        self._first: FirstBytes | None = FirstBytes()
        #: What was passed on and found no room in a short read.
        self._ready = b""

    def recv(self, bufsize: int, flags: int = 0, /) -> bytes:
        """Return what has come, as of a socket.

        Raises:
            WebClientError: A browser sent it; the connection is shut down.
            BlockingIOError: The first bytes are not decided yet; also of a blocking socket, whose owner may wait for
                other things too.
            OSError: As of a socket.
        """
        if self._first is not None:
            if flags:
                raise BlockingIOError(errno.EAGAIN, "the first bytes are not decided yet")
            if self._first.refused is not None:
                raise WebClientError(self._first.refused)
            data = super().recv(max(1, bufsize - self._first.kept_bytes))
            try:
                self._ready = self._first.take(data) if data else self._first.end()
            except WebClientError as error:
                self._refuse(error)
                raise
            if data and not self._ready:
                raise BlockingIOError(errno.EAGAIN, "the first bytes are not decided yet")
            self._first = None
        if self._ready and not flags:
            passed, self._ready = self._ready[:bufsize], self._ready[bufsize:]
            return passed
        return super().recv(bufsize, flags)

    def recv_into(self, buffer: bytearray | memoryview, nbytes: int = 0, flags: int = 0) -> int:  # type: ignore[override]  # of a socket it takes any buffer
        """Put what has come into a buffer, as of a socket."""
        view = memoryview(buffer)
        data = self.recv(nbytes or view.nbytes, flags)
        view[: len(data)] = data
        return len(data)

    def _refuse(self, error: WebClientError) -> None:
        """Log it before the peer can know, and shut the connection down."""
        log = logging.getLogger(LOGGER)
        if not log.handlers:
            log.addHandler(logging.NullHandler())
        log.warning("%s refused: it %s; a web page cannot use this port", self._ends(), error)
        with contextlib.suppress(OSError):  # it has gone already
            self.shutdown(socket.SHUT_RDWR)

    def _ends(self) -> str:
        with contextlib.suppress(OSError):
            return f"connection of {_place(self.getpeername())} to {_place(self.getsockname())}"
        return "connection"


class GuardedListener(socket.socket):
    """A listening TCP socket whose connections are guarded."""

    #: Where it listens, once it does.
    port: int = 0

    def accept(self) -> tuple[GuardedConnection, tuple[str, int]]:
        """Accept a connection, as of a socket."""
        accepted, address = super().accept()
        return GuardedConnection(accepted), address


def listen_tcp(host: str, port: int, backlog: int | None = None) -> GuardedListener:
    """Return a socket that listens on an address of this machine.

    Args:
        host: Name or address.
        port: 0 takes a free one.
        backlog: How many may wait to be accepted; None leaves it to the system.

    Raises:
        OSError: The system refuses.
        OverflowError: There is no such port.
    """
    listening = GuardedListener(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM)
    try:
        if sys.platform != "win32":  # there, the option lets two programs share a port
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((host, port))
        listening.listen() if backlog is None else listening.listen(backlog)
        listening.port = listening.getsockname()[1]
    except BaseException:
        listening.close()
        raise
    return listening


def _place(address: tuple[str, int]) -> str:
    host = f"[{address[0]}]" if ":" in address[0] else address[0]
    return f"{host}:{address[1]}"


def _shown(opening: bytes) -> str:
    return repr(opening.decode()) if opening.isascii() and opening[0] >= 0x20 else opening.hex(" ")
