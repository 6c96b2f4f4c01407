"""Serves one debugger at a time on a TCP port of this machine.

This is the I/O layer: it owns the socket and the pace; `bluepill_sim.debug` does the rest.
`GdbServer` runs the machine itself; `GdbPort` is looked at by who runs it for others, too.

Invariant: the machine runs only while GDB wants it to; a debugger that disconnects
without detaching leaves it halted.
"""

import select
import socket
import time
from collections.abc import Callable
from typing import Protocol

from bluepill_sim.debug.execution import Execution
from bluepill_sim.debug.gdb_session import GdbSession
from bluepill_sim.debug.machine import DebugTarget, HaltReason, Machine
from bluepill_sim.debug.packets import GdbPacket, PacketMark, PacketReader, frame
from bluepill_sim.errors import BluePillError
from simbase.listening import GuardedListener, WebClientError, listen_tcp
from simbase.timing import NS_PER_S, Nanos

_READ_BYTES = 4096
#: How often a waiting server looks at Ctrl-C of its own terminal.
_POLL_S = 0.5


class GdbServer:
    """Listens on the loopback interface.

    Args:
        machine: what is debugged.
        port: TCP port; 0 takes a free one.
        is_paced: whether virtual time goes no faster than the wall clock.
        on_wait: called twice a second at least while a debugger is waited for; may raise to end the serving.

    Raises:
        BluePillError: the port is taken.
    """

    def __init__(
        self, machine: Machine, port: int, *, is_paced: bool = False, on_wait: Callable[[], None] = lambda: None
    ) -> None:
        self._machine = machine
        self._is_paced = is_paced
        self._on_wait = on_wait
        self._listener = _listen(port)
        self.port: int = self._listener.port
        self._execution = Execution(machine, self._print)
        self._connection: _Connection | None = None
        #: Takes what the program prints by semihosting, when no debugger shows it.
        self.on_print: Callable[[bytes], None] | None = None

    def close(self) -> None:
        """Close the port."""
        self._listener.close()

    def serve(self, *, once: bool = False) -> bool:
        """Serve debuggers until one kills the program, or detaches.

        Args:
            once: return as well when one disconnects without detaching.

        Returns:
            Whether the program is to run on: it was detached from, not killed.
        """
        while True:
            while not select.select([self._listener], [], [], _POLL_S)[0]:
                self._on_wait()
            connection = _Connection(self._listener.accept()[0], self._on_wait)
            self._connection = connection
            try:
                session = self._serve_session(connection)
            finally:
                self._connection = None
                connection.close()
            if connection.was_refused:
                continue
            if session.state.is_over or once:
                self._execution.detach()
                return not session.state.was_killed

    def _serve_session(self, connection: "_Connection") -> GdbSession:
        session = GdbSession(self._execution)
        self._execution.wants_stop = self._make_watch(connection)
        while not session.state.is_over:
            packet = connection.next_packet()
            if packet is None:
                break
            if packet.payload[:1] in _RESUMES or packet.payload.startswith(b"vCont;"):
                self._execution.wants_stop = self._make_watch(connection)
            _answer(connection, session, packet)
        return session

    def _make_watch(self, connection: "_Connection") -> Callable[[], bool]:
        """Return what looks for Ctrl-C and keeps the pace, from this moment on."""
        offset_ns: Nanos = time.monotonic_ns() - self._machine.board.now_ns

        def wants_stop() -> bool:
            ahead_ns = self._machine.board.now_ns + offset_ns - time.monotonic_ns()
            wait_s = ahead_ns / NS_PER_S if self._is_paced and ahead_ns > 0 else 0.0
            return connection.is_interrupted(wait_s)

        return wants_stop

    def _print(self, data: bytes) -> None:
        if self._connection is not None:
            self._connection.send(b"O" + data.hex().encode())
        if self.on_print is not None:
            self.on_print(data)


class SharedTarget(DebugTarget, Protocol):
    """A machine that another one runs; it is told what becomes of the debugger."""

    def attached(self) -> None:
        """Take that a debugger is there: it begins at a halt."""

    def interrupted(self) -> None:
        """Take that the debugger asks for a halt."""

    def left(self, *, was_killed: bool, is_lost: bool) -> None:
        """Take that it is there no more: it has detached, killed the program, or its line is lost."""


class GdbPort:
    """Listens on the loopback interface for a debugger of a machine that another one runs.

    Args:
        port: TCP port; 0 takes a free one.

    Raises:
        BluePillError: the port is taken.
    """

    def __init__(self, port: int) -> None:
        self._listener = _listen(port)
        self.port: int = self._listener.port
        self._connection: _Connection | None = None
        self._session: GdbSession | None = None

    def close(self) -> None:
        """Close the port, and the debugger's line."""
        self._listener.close()
        if self._connection is not None:
            self._connection.close()

    def serve(self, target: SharedTarget, wait_s: float) -> None:
        """Do what a debugger has asked for; wait at most so many seconds for it."""
        if self._connection is None:
            if not select.select([self._listener], [], [], wait_s)[0]:
                return
            self._connection, wait_s = _Connection(self._listener.accept()[0], lambda: None), 0.0
        connection = self._connection
        is_interrupted = connection.is_interrupted(wait_s)
        for packet in connection.take():
            if self._session is None:
                self._session = GdbSession(target)
                target.attached()
            _answer(connection, self._session, packet)
            if (state := self._session.state).is_over:
                self._leave()
                target.left(was_killed=state.was_killed, is_lost=False)
                return
        if is_interrupted and connection.is_lost:
            had_session = self._session is not None
            self._leave()
            if had_session:
                target.left(was_killed=False, is_lost=True)
        elif is_interrupted:
            connection.forget_interrupt()
            target.interrupted()

    def stopped(self, stop: HaltReason, words: str) -> None:
        """Answer what went on, now that the machine stands; a line for the person is printed first."""
        if self._connection is not None and self._session is not None:
            if words:
                self._connection.send(b"O" + f"{words}\n".encode().hex().encode())
            self._connection.send(self._session.stopped(stop))

    def _leave(self) -> None:
        if self._connection is not None:
            self._connection.close()
        self._connection = self._session = None


def _listen(port: int) -> GuardedListener:
    try:
        return listen_tcp("127.0.0.1", port, backlog=1)
    except (OSError, OverflowError) as error:
        raise BluePillError(f"cannot listen on port {port}: {error}", hint="another port, or 0 for any") from error


def _answer(connection: "_Connection", session: GdbSession, packet: GdbPacket) -> None:
    answer = session.answer(packet.payload)
    if answer is not None and packet.payload != b"k":
        connection.send(answer)
    connection.has_acks = not session.state.has_no_acks


_RESUMES = {b"c", b"s", b"C", b"S"}


class _Connection:
    """The connection of one debugger."""

    def __init__(self, line: socket.socket, on_wait: Callable[[], None]) -> None:
        self._line = line
        self._on_wait = on_wait
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._reader = PacketReader()
        self._packets: list[GdbPacket] = []
        self._is_interrupted = False
        self.is_lost = False
        #: Whether it never was a debugger's.
        self.was_refused = False
        self._last = b""
        self.has_acks = True

    def close(self) -> None:
        self._line.close()

    def next_packet(self) -> GdbPacket | None:
        """Wait for a packet; None once the other end is gone."""
        while not self._packets:
            if self.is_lost:
                return None
            self._on_wait()
            self._receive(_POLL_S)
        return self._packets.pop(0)

    def take(self) -> list[GdbPacket]:
        """Return the packets that have come."""
        taken, self._packets = self._packets, []
        return taken

    def forget_interrupt(self) -> None:
        """Take a Ctrl-C as done."""
        self._is_interrupted = False

    def is_interrupted(self, wait_s: float) -> bool:
        """Look, at most so long, for a Ctrl-C; a lost line is one as well."""
        self._receive(wait_s)
        return self._is_interrupted or self.is_lost

    def send(self, payload: bytes) -> None:
        """Send a packet."""
        self._last = frame(payload)
        self._write(self._last)

    def _write(self, data: bytes) -> None:
        try:
            self._line.sendall(data)
        except OSError:
            self.is_lost = True

    def _receive(self, wait_s: float) -> None:
        try:
            if not select.select([self._line], [], [], wait_s)[0]:
                return
            data = self._line.recv(_READ_BYTES)
        except BlockingIOError:
            return
        except WebClientError:
            data, self.was_refused = b"", True
        except OSError:
            data = b""
        if not data:
            self.is_lost = True
        for event in self._reader.receive(data):
            self._take(event)

    def _take(self, event: GdbPacket | PacketMark) -> None:
        if isinstance(event, GdbPacket):
            if self.has_acks:
                self._write(b"+")
            self._packets.append(event)
            self._is_interrupted = False  # a Ctrl-C is for what was asked for before it
        elif event is PacketMark.INTERRUPT:
            self._is_interrupted = True
        elif event is PacketMark.DAMAGED and self.has_acks:
            self._write(b"-")
        elif event is PacketMark.NAK:
            self._write(self._last)
