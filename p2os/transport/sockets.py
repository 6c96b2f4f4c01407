"""TCP lines: connecting, listening, and the byte line over any connected socket.

A web browser is no client: `simbase.listening` refuses it.

Nagle's algorithm is off: a frame must not wait for its answer. Keepalive is on: a peer
that vanishes without notice (power, cable, suspend) is noticed within some 10 s.
"""

import contextlib
import errno
import socket

from p2os.errors import TransportError
from p2os.transport.ports import READ_BYTES, HungUpError, RefusedPeerError, Transport
from p2os.transport.url import TcpUrl
from simbase.files import reason_of
from simbase.listening import GuardedListener, WebClientError, listen_tcp

#: chosen: a robot on the same network answers within milliseconds.
CONNECT_TIMEOUT_S = 3.0
#: chosen: a minute of SIPs; a client that is further behind will never catch up.
BACKLOG_BYTES = 65_536
#: chosen: unread bytes of a peer are discarded at the close up to 256 KB, more than a socket keeps by default.
READS_AT_CLOSE = 64

#: Option of a TCP socket → value, where the system has it.
#: chosen: 4 s of silence and three probes 2 s apart are 10 s, which a network's hiccup does not last;
#: the last one, in ms, is the same for a peer that leaves bytes unconfirmed, to which no probes are sent.
KEEPALIVE = {
    "TCP_KEEPIDLE": 4,
    "TCP_KEEPALIVE": 4,  # macOS' name of the same
    "TCP_KEEPINTVL": 2,
    "TCP_KEEPCNT": 3,
    "TCP_USER_TIMEOUT": 10_000,
}
#: chosen: longer than any reason for a refusal; what begins a connection and is longer is no such line.
LONGEST_REASON = 120

#: A robot that has a client sends a second one the reason and closes; other programs may close without one.
HUNG_UP_HINT = "a robot has one client: is another program connected, or has the robot's side ended?"

_LISTEN_HINTS = {
    errno.EADDRINUSE: "another program listens there; choose another port, or tcp:127.0.0.1:0 for any free one",
    errno.EACCES: "choose a port above 1023",
}


class SocketTransport:
    """A byte line over a connected stream socket."""

    def __init__(self, connection: socket.socket, description: str) -> None:
        self.description = description
        self._socket = connection
        self._unsent = b""
        #: The first bytes that came, as long as they may be all that the far side sends.
        self._first = b""
        connection.setblocking(False)
        if connection.family != getattr(socket, "AF_UNIX", None):
            options = [(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1), (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)]
            known = {name: value for name, value in KEEPALIVE.items() if hasattr(socket, name)}
            options += [(socket.IPPROTO_TCP, getattr(socket, name), value) for name, value in known.items()]
            for option in options:
                with contextlib.suppress(OSError):  # the line carries without it, or its first read says why not
                    connection.setsockopt(*option)

    def read(self) -> bytes:
        """Return what has arrived without waiting."""
        try:
            data = self._socket.recv(READ_BYTES)
        except (BlockingIOError, InterruptedError):
            return b""
        except WebClientError as error:
            raise RefusedPeerError(f"{self.description} was refused: it {error}") from error
        except OSError as error:
            raise self._lost(error) from error
        if not data:
            raise HungUpError(f"{self.description} closed the connection{self._reason()}", hint=HUNG_UP_HINT)
        if len(self._first) <= LONGEST_REASON:
            self._first += data[: LONGEST_REASON + 1]
        return data

    def write(self, data: bytes) -> None:
        """Send all of `data`, keeping for later what the socket does not take."""
        self._unsent += data
        try:
            while self._unsent:
                self._unsent = self._unsent[self._socket.send(self._unsent) :]
        except (BlockingIOError, InterruptedError):
            if len(self._unsent) > BACKLOG_BYTES:
                raise TransportError(f"{self.description} has stopped reading") from None
        except OSError as error:
            raise self._lost(error) from error

    def fileno(self) -> int:
        """Return the socket's descriptor."""
        return self._socket.fileno()

    def set_baud(self, baud: int) -> None:
        """Do nothing: a socket has no line speed."""

    def refuse(self, reason: str) -> None:
        """Send the peer in one line why it is refused, and that nothing more will come.

        The peer's error shows the line if nothing else was said. Closing at once could lose it: `ClosingLines` waits.

        Args:
            reason: A few words; what is not ASCII is lost.
        """
        with contextlib.suppress(OSError):  # it has left already
            with contextlib.suppress(BlockingIOError):  # it does not read
                if not self._unsent:
                    self._socket.send(reason.encode("ascii", "replace")[: LONGEST_REASON - 2] + b"\r\n")
            self._socket.shutdown(socket.SHUT_WR)

    def close(self) -> None:
        """Close the socket; what it took before still arrives.

        To close one whose bytes are unread resets the connection, and a peer that meets the reset before it has read
        may drop what it was sent: a STOP.
        """
        with contextlib.suppress(OSError):  # the peer has gone; what waits is read all the same
            self._socket.shutdown(socket.SHUT_WR)
        with contextlib.suppress(OSError):  # nothing more waits
            for _ in range(READS_AT_CLOSE):
                if not self._socket.recv(READ_BYTES):
                    break
        self._socket.close()

    def _lost(self, error: OSError) -> HungUpError:
        waits = b""
        with contextlib.suppress(OSError):  # a reason may still wait; what waits can be read yet
            waits = self._socket.recv(LONGEST_REASON + 1, socket.MSG_PEEK)
        return HungUpError(f"{self.description} was lost: {reason_of(error)}{self._reason(waits)}", hint=HUNG_UP_HINT)

    def _reason(self, waits: bytes = b"") -> str:
        """Return what the far side sent if that was a line of text and nothing else, as the end of a message."""
        text = (self._first + waits).decode("ascii", "replace")
        line = text.removesuffix("\r\n")
        is_line = line not in {"", text} and len(text) <= LONGEST_REASON and line.isprintable() and "\ufffd" not in line
        return f": {line}" if is_line else ""


class TcpListener:
    """A listening TCP port that serves one client at a time."""

    poll_s: float | None = None

    def __init__(self, url: TcpUrl) -> None:
        self._socket = _listening_socket(url)
        self.description = str(TcpUrl(host=url.host, port=self._socket.port))

    def accept(self) -> Transport | None:
        """Return the line to a client that has come, or None."""
        try:
            connection, address = self._socket.accept()
        except OSError:  # none waiting, or it has gone again: both are no client
            return None
        return SocketTransport(connection, str(TcpUrl(host=address[0], port=address[1])))

    def fileno(self) -> int | None:
        """Return the listening descriptor."""
        return self._socket.fileno()

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()


def connect_tcp(url: TcpUrl) -> Transport:
    """Return a line to a listening TCP port.

    Raises:
        TransportError: nobody answers there.
    """
    try:
        connection = socket.create_connection((url.host, url.port), timeout=CONNECT_TIMEOUT_S)
    except UnicodeError as error:  # IDNA: an empty or too long part
        raise TransportError(f"cannot connect to {url}: {url.host!r} is no host name", hint="tcp:HOST:8101") from error
    except OSError as error:
        raise TransportError(
            f"cannot connect to {url}: {reason_of(error)}", hint=f"is a robot served there? (p2os serve --port {url})"
        ) from error
    return SocketTransport(connection, str(url))


def _listening_socket(url: TcpUrl) -> GuardedListener:
    try:
        listening = listen_tcp(url.host, url.port)
    except OSError as error:
        hint = _LISTEN_HINTS.get(error.errno or 0, "listen on this machine: tcp:127.0.0.1:8101")
        raise TransportError(f"cannot listen on {url}: {reason_of(error)}", hint=hint) from error
    listening.setblocking(False)
    return listening
