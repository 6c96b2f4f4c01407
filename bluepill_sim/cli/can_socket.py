"""A CAN of a board joined to one of this machine: an interface of SocketCAN, or a datagram socket.

This is the I/O layer. A frame is one datagram, `struct can_frame` of SocketCAN in the byte order of this machine:
the identifier with EFF, RTR and ERR on top (4 bytes), the length (1), 3 that are not looked at, 8 of data.

Theory of operation. On the board's network stands a `CanNode`, which acknowledges. What it hears goes out at once;
what has come is sent on the network when `carry` is called, between two runs of the board. Of the programs that name
one UDP port or path, the first has it and passes each frame on to the others; those that come later say so with an
empty datagram.
Source: Linux, Documentation/networking/can.rst, 4.1 (struct can_frame).
Invariant: it never waits; a datagram that is no frame changes nothing but `refused`.
"""

import contextlib
import errno
import ipaddress
import socket
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Self

from bluepill_sim.board import BluePill
from bluepill_sim.errors import BluePillError
from bluepill_sim.fabric.bus_parts import CanFrame
from bluepill_sim.fabric.can_network import CanNetwork, CanNode
from simbase.files import open_to_write_text
from simbase.timing import NS_PER_S, Nanos

_FRAME = struct.Struct("=IB3x8s")
_EXTENDED, _REMOTE, _ERROR = 1 << 31, 1 << 30, 1 << 29
_IDENTIFIER = (1 << 29) - 1
#: chosen: datagrams taken at a call, frames that wait for the network, and others that one program passes frames on to.
_AT_ONCE, MOST_WAITING, MOST_PEERS = 256, 1024, 16
#: One byte more than a frame, so that what is too long is seen to be.
_READ_BYTES = _FRAME.size + 1
_FORMS = "an interface such as vcan0, udp:127.0.0.1:PORT, udp-open:ADDRESS:PORT, or unix:PATH"
_NO_INTERFACE = "ip link add dev vcan0 type vcan && ip link set vcan0 up makes one; or udp:127.0.0.1:PORT"
#: Takes each frame on the network: ns at its end, whether the board's side has sent it, the frame.
FrameSink = Callable[[Nanos, bool, CanFrame], None]


#: What a log calls a bus that is no interface.
_LOGGED_AS = "can0"


class CanSocketError(BluePillError):
    """A bus of this machine cannot be joined."""

    exit_code = 2


def to_datagram(frame: CanFrame) -> bytes:
    """Return a frame as 16 bytes."""
    flags = (_EXTENDED if frame.is_extended else 0) | (_REMOTE if frame.is_remote else 0)
    return _FRAME.pack(frame.identifier | flags, frame.dlc, frame.data)


def from_datagram(data: bytes) -> CanFrame:
    """Return the frame that 16 bytes are.

    Raises:
        ValueError: They are none, or tell of an error.
    """
    if len(data) != _FRAME.size:
        raise ValueError(f"a frame has {_FRAME.size} bytes: {len(data)} came")
    word, length, body = _FRAME.unpack(data)
    is_extended, is_remote = bool(word & _EXTENDED), bool(word & _REMOTE)
    if word & _ERROR or length > len(body):
        raise ValueError(f"no frame of data: identifier {word:#010x}, length {length}")
    return CanFrame(
        identifier=word & _IDENTIFIER,
        data=b"" if is_remote else body[:length],
        is_extended=is_extended,
        is_remote=is_remote,
        remote_bytes=length if is_remote else 0,
    )


def candump_line(at_ns: Nanos, frame: CanFrame, bus: str, *, is_sent: bool) -> str:
    """Return a line as `candump -L` writes it: seconds, bus, identifier and data, T for what the board has sent."""
    identifier = f"{frame.identifier:0{8 if frame.is_extended else 3}X}"
    body = f"R{frame.remote_bytes}" if frame.is_remote else frame.data.hex().upper()
    at = f"{at_ns // NS_PER_S:010d}.{at_ns % NS_PER_S // 1000:06d}"
    return f"({at}) {bus} {identifier}#{body} {'T' if is_sent else 'R'}"


class CanSocket:
    """The far end of a board's CAN, in a socket of this machine.

    A program of its own has a board's CAN on a network, and calls `carry` between the runs of the board:

        network = CanNetwork()
        board.can(network)
        with CanSocket("udp:127.0.0.1:29536", network) as bus:
            while board.now_ns < end_ns:
                bus.carry()
                board.run_for(1_000_000)

    Frames come in at the time that the board has reached; it is the caller who keeps that to the clock.
    """

    def __init__(self, where: str, network: CanNetwork, on_frame: FrameSink | None = None) -> None:
        """Open it, and put its node on the network.

        Args:
            where: an interface of SocketCAN; "udp:HOST:PORT" on a loopback address, "udp-open:HOST:PORT" on any;
                or "unix:PATH".
            network: The board's.
            on_frame: Called with each frame that has gone over.

        Raises:
            CanSocketError: It cannot be opened.
        """
        self.where = where
        #: Frames from the board, and to it; datagrams that are no frame; frames that found no room.
        self.sent = self.received = self.refused = self.dropped = 0
        self._on_frame = on_frame
        #: The other programs, the one that was heard last at the end; None: the socket is connected.
        self._peers: dict[object, None] | None = None
        #: What is closed with it.
        self.on_close = contextlib.ExitStack()
        self._socket = self._open(where)
        self.on_close.callback(self._socket.close)
        self._socket.setblocking(False)
        self.node = CanNode(self._heard)
        self.node.on_sent = self._went
        network.join(self.node)

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(self, *_error: object) -> None:
        """Close."""
        self.close()

    @property
    def port(self) -> int:
        """The UDP port that it has; 0: none."""
        return int(self._socket.getsockname()[1]) if self._socket.family == socket.AF_INET else 0

    def carry(self) -> None:
        """Send what has come since the last call on the board's network, from now on, without waiting."""
        self.node.received.clear()
        for _ in range(_AT_ONCE):
            try:
                data, peer = self._socket.recvfrom(_READ_BYTES)
            except BlockingIOError:
                return
            except OSError:  # closed, or whom it is connected to has gone
                return
            self._take(data, peer)

    def close(self) -> None:
        """Leave: the board's frames are acknowledged on, but go nowhere; a second time changes nothing."""
        self._peers = None
        self.node.on_frame = self.node.on_sent = None
        self.on_close.close()

    def describe(self) -> str:
        """Return what has gone over, for people."""
        counts = ((self.refused, "datagrams refused"), (self.dropped, "dropped"))
        lost = [f"{count} {what}" for count, what in counts if count]
        return ", ".join([f"{self.where}: {self.sent} frames out, {self.received} in", *lost])

    # Datagrams.

    def _take(self, data: bytes, peer: object) -> None:
        try:
            frame = from_datagram(data) if data else None
        except ValueError:
            self.refused += 1
            return
        self._note(peer)
        if frame is None:
            return
        if self.node.waiting >= MOST_WAITING:
            self.dropped += 1
            return
        self._send(data, besides=peer)
        self.node.send(frame)

    def _note(self, peer: object) -> None:
        """Keep whom to send to; who has been silent longest makes room."""
        if self._peers is None or not peer:
            return
        self._peers.pop(peer, None)
        if len(self._peers) >= MOST_PEERS:
            del self._peers[next(iter(self._peers))]
        self._peers[peer] = None

    def _send(self, data: bytes, besides: object = None) -> bool:
        """Send to all but one; return whether it has gone. Who is connected has one other, and passes nothing on."""
        if self._peers is None:
            return besides is not None or self._send_to(None, data)
        gone = [self._send_to(peer, data) for peer in list(self._peers) if peer != besides]
        return all(gone)

    def _send_to(self, peer: object, data: bytes) -> bool:
        try:
            if peer is None:
                self._socket.send(data)
            else:
                self._socket.sendto(data, peer)  # type: ignore[call-overload]  # an address as recvfrom gave it
        except OSError as error:
            if self._peers is not None and error.errno in (errno.ECONNREFUSED, errno.ENOENT):
                self._peers.pop(peer, None)
                return True
            return False
        return True

    # The node.

    def _heard(self, frame: CanFrame, at_ns: Nanos) -> None:
        if self._send(to_datagram(frame)):
            self.sent += 1
        else:
            self.dropped += 1
        if self._on_frame is not None:
            self._on_frame(at_ns, True, frame)

    def _went(self, frame: CanFrame, at_ns: Nanos) -> None:
        self.received += 1
        if self._on_frame is not None:
            self._on_frame(at_ns, False, frame)

    # Opening.

    def _open(self, where: str) -> socket.socket:
        kind, colon, rest = where.partition(":")
        try:
            if not colon:
                return self._open_interface(where)
            if kind == "unix" and rest:
                return self._open_datagrams(socket.AF_UNIX, rest)
            if kind in ("udp", "udp-open"):
                return self._open_datagrams(socket.AF_INET, _address(rest, where, is_open=kind == "udp-open"))
        except OSError as error:
            raise CanSocketError(f"cannot join {where}: {error.strerror or error}", hint=_FORMS) from error
        raise CanSocketError(f"no such bus: {where!r}", hint=_FORMS)

    @staticmethod
    def _open_interface(name: str) -> socket.socket:
        if not hasattr(socket, "AF_CAN"):
            raise CanSocketError(f"cannot join {name}: this system has no SocketCAN", hint="udp:127.0.0.1:PORT")
        made: socket.socket | None = None
        try:
            made = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
            made.bind((name,))
        except OSError as error:
            if made is not None:
                made.close()
            raise CanSocketError(
                f"cannot join the CAN interface {name!r}: {error.strerror or error}", hint=_NO_INTERFACE
            ) from error
        return made

    def _open_datagrams(self, family: socket.AddressFamily, address: str | tuple[str, int]) -> socket.socket:
        """Have the address, or join who has it."""
        made = socket.socket(family, socket.SOCK_DGRAM)
        try:
            try:
                made.bind(address)
            except OSError as error:
                if error.errno != errno.EADDRINUSE:
                    raise
                if isinstance(address, str):
                    made.bind("")  # a name of its own, so that there is an answer
                self._join(made, address)
            else:
                self._peers = {}
                if isinstance(address, str):
                    self.on_close.callback(Path(address).unlink, missing_ok=True)
        except (OSError, CanSocketError):
            made.close()
            raise
        return made

    @staticmethod
    def _join(made: socket.socket, address: str | tuple[str, int]) -> None:
        try:
            made.connect(address)
            made.send(b"")
        except ConnectionRefusedError as error:
            if isinstance(address, str):
                shown, hint = address, f"rm {address}, which an ended program has left"
            else:
                shown, hint = f"{address[0]}:{address[1]}", "try again, or take another port"
            raise CanSocketError(f"cannot join {shown}: nobody has it any more", hint=hint) from error


def _address(text: str, where: str, *, is_open: bool) -> tuple[str, int]:
    """Return host and port.

    Raises:
        CanSocketError: They are not understood, or reach beyond this machine though they may not.
    """
    host, _, port = text.rpartition(":")
    host = "127.0.0.1" if host == "localhost" else host
    with contextlib.suppress(ValueError):
        if not ipaddress.IPv4Address(host).is_loopback and not is_open:
            raise CanSocketError(
                f"{where} reaches beyond this machine", hint=f"udp-open:{text} if anybody may send frames"
            )
        if port.isdecimal() and int(port) < 1 << 16:
            return host, int(port)
    raise CanSocketError(f"{where!r} is no address", hint=_FORMS)


def join_can(board: BluePill, where: str | None, log: Path | None) -> list[CanSocket]:
    """Join a board's CAN, and the parts on it, to a bus of this machine, with a log; without `where` to none.

    Raises:
        CanSocketError: It cannot be joined.
        FileError: The log cannot be written.
    """
    if where is None:
        if log is not None:
            raise CanSocketError("--can-log without --can logs nothing", hint="--can vcan0, or udp:127.0.0.1:PORT")
        return []
    network = board.can().joined
    if network is None:
        network = CanNetwork()
        board.can(network)
    file = None if log is None else open_to_write_text(log)
    name = _LOGGED_AS if ":" in where else where

    def keep(at_ns: Nanos, is_sent: bool, frame: CanFrame) -> None:
        if file is not None:
            file.write(candump_line(at_ns, frame, name, is_sent=is_sent) + "\n")

    made = CanSocket(where, network, keep)
    if file is not None:
        made.on_close.callback(file.close)
    return [made]
