"""Named byte lines inside one process: `loop:NAME`.

A `Loops` is passed to both ends, so that there is no hidden list of lines: two
programs in one process that should not meet hold two of them.
"""

import socket

from p2os.errors import TransportError
from p2os.transport.ports import Transport
from p2os.transport.sockets import SocketTransport


class LoopListener:
    """The listening end of a name."""

    poll_s: float | None = None

    def __init__(self, name: str) -> None:
        self.description = f"loop:{name}"
        self.is_open = True
        self._waiting: list[SocketTransport] = []
        self._bell, self._bell_push = socket.socketpair()
        self._bell.setblocking(False)

    def accept(self) -> Transport | None:
        """Return the line to a peer that has come, or None."""
        if not self._waiting:
            return None
        self._bell.recv(1)
        return self._waiting.pop(0)

    def admit(self) -> Transport:
        """Return the far end of a new line whose near end waits for `accept`."""
        near, far = socket.socketpair()
        self._waiting.append(SocketTransport(near, self.description))
        self._bell_push.send(b"\0")
        return SocketTransport(far, self.description)

    def fileno(self) -> int | None:
        """Return a descriptor that is readable while a peer waits."""
        return self._bell.fileno()

    def close(self) -> None:
        """Stop listening and give back lines that nobody took."""
        self.is_open = False
        for transport in self._waiting:
            transport.close()
        self._waiting.clear()
        self._bell.close()
        self._bell_push.close()


class Loops:
    """The named lines of one program."""

    def __init__(self) -> None:
        self._listeners: dict[str, LoopListener] = {}

    def listen(self, name: str) -> LoopListener:
        """Return the listening end of a name.

        Raises:
            TransportError: the name is taken.
        """
        if self._listening(name):
            raise TransportError(f"cannot listen on loop:{name}: the name is taken", hint="choose another name")
        self._listeners[name] = LoopListener(name)
        return self._listeners[name]

    def connect(self, name: str) -> Transport:
        """Return a line to whoever listens to a name.

        Raises:
            TransportError: nobody listens.
        """
        if not self._listening(name):
            raise TransportError(f"cannot connect to loop:{name}: nobody listens", hint="listen before you connect")
        return self._listeners[name].admit()

    def _listening(self, name: str) -> bool:
        return name in self._listeners and self._listeners[name].is_open
