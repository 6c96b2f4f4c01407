"""What a neighbour does to a socket, row by row; each ends by itself.

A row says whether it speaks P2OS so far that a robot which is free has to obey: it is then tried only where somebody
else has the session.
"""

import contextlib
import itertools
import random
import socket
import ssl
import struct
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from tools.hostile import packets
from tools.hostile.browser import post_from_a_page
from tools.hostile.kernel import OpenSocket

#: Close with a reset in place of an end.
RESET = struct.pack("ii", 1, 0)
#: What somebody obeys at one port or another: a robot, an operator's line, GDB's stub.
OBEYED = packets.DRIVING + b"\nreset\nplace box 1 0 0.3 0.3\n$vKill;1#6e$c#63"


@dataclass(frozen=True)
class Attack:
    """One kind of attack."""

    doc: str
    run: "Callable[[Sequence[OpenSocket], random.Random, float], None]"
    #: Whether it drives a robot that nobody has: only for where somebody has it.
    drives: bool = False
    #: Whether datagrams are meant, and not connections.
    datagrams: bool = False


@contextlib.contextmanager
def _peer(port: int) -> Iterator[socket.socket]:
    """Connect, and be shut out at any moment."""
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 0.5) as connection:
        yield connection
        return
    with socket.socket() as nobody, contextlib.suppress(OSError):  # not connected: to send is an error, as to who left
        yield nobody


def _send(connection: socket.socket, data: bytes) -> bool:
    try:
        connection.sendall(data)
    except OSError:
        return False
    return True


def _post(targets: Sequence[OpenSocket], _draw: random.Random, _lasts_s: float) -> None:
    for each in targets:
        for method in ("POST", "GET", "PUT", "OPTIONS"):
            head = f"{method} / HTTP/1.1\r\nHost: 127.0.0.1:{each.port}\r\nContent-Length: {len(OBEYED)}\r\n\r\n"
            for split in (0, 1, 3, 5, len(head)):
                with _peer(each.port) as connection:
                    _send(connection, head.encode()[:split])
                    if split:
                        time.sleep(0.01)
                    _send(connection, head.encode()[split:] + OBEYED)


def _tls(targets: Sequence[OpenSocket], _draw: random.Random, _lasts_s: float) -> None:
    context = ssl.create_default_context()
    for each in targets:
        with _peer(each.port) as connection, contextlib.suppress(OSError):
            context.wrap_socket(connection, server_hostname="localhost")
        with _peer(each.port) as connection:
            _send(connection, b"\x16\x03\x01\x02\x00" + OBEYED)


def _garbage(targets: Sequence[OpenSocket], draw: random.Random, _lasts_s: float) -> None:
    for each in targets:
        for size in (1, 7, 4096, 1 << 20):
            with _peer(each.port) as connection:
                _send(connection, draw.randbytes(size))
        with _peer(each.port) as connection:  # every header, no packet
            for _ in range(64):
                _send(connection, packets.HEADER + draw.randbytes(1) + draw.randbytes(300))


def _flood(targets: Sequence[OpenSocket], _draw: random.Random, lasts_s: float) -> None:
    """Send what drives as fast as it is taken, over as many connections as are let in."""
    ends = time.monotonic() + lasts_s
    with contextlib.ExitStack() as held:
        while time.monotonic() < ends:
            for each in targets:
                connection = held.enter_context(_peer(each.port))
                while time.monotonic() < ends and _send(
                    connection, packets.DRIVING + packets.command(packets.VEL, 300) * 500
                ):
                    pass
            time.sleep(0.01)


def _half_open(targets: Sequence[OpenSocket], _draw: random.Random, lasts_s: float) -> None:
    """Hold connections that send nothing, or half a packet."""
    ends = time.monotonic() + lasts_s
    with contextlib.ExitStack() as held:
        for number, each in itertools.product(range(64), targets):
            if time.monotonic() > ends:
                return
            connection = held.enter_context(_peer(each.port))
            if number % 2:
                _send(connection, packets.DRIVING[:4])
        time.sleep(max(0.0, ends - time.monotonic()))


def _slow(targets: Sequence[OpenSocket], _draw: random.Random, lasts_s: float) -> None:
    """Send a byte, wait, send the next."""
    for each in targets:
        with _peer(each.port) as connection:
            for at in range(len(packets.HELLO)):
                if not _send(connection, packets.HELLO[at : at + 1]):
                    break
                time.sleep(lasts_s / len(packets.HELLO))


def _closing(data: bytes) -> "Callable[[Sequence[OpenSocket], random.Random, float], None]":
    """Return what goes after each byte: by an end, by a reset."""

    def run(targets: Sequence[OpenSocket], _draw: random.Random, _lasts_s: float) -> None:
        for each in targets:
            for at in range(len(data) + 1):
                with _peer(each.port) as connection:
                    _send(connection, data[:at])
                    if at % 2:
                        with contextlib.suppress(OSError):
                            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)

    return run


def _browser(targets: Sequence[OpenSocket], _draw: random.Random, lasts_s: float) -> None:
    post_from_a_page([each.port for each in targets], OBEYED, lasts_s)


def _datagrams(targets: Sequence[OpenSocket], draw: random.Random, lasts_s: float) -> None:
    ends = time.monotonic() + lasts_s
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while time.monotonic() < ends:
            for each in targets:
                for data in (b"", OBEYED, draw.randbytes(16), draw.randbytes(1400), b"RTPS" + draw.randbytes(200)):
                    with contextlib.suppress(OSError):
                        sender.sendto(data, ("127.0.0.1", each.port))


#: Name → attack.
ATTACKS = {
    "post": Attack("a browser's requests with what drives in the body, split", _post),
    "browser": Attack("a page in Chromium that posts to every port and opens WebSockets", _browser),
    "tls": Attack("a handshake of TLS, and its first bytes before what drives", _tls),
    "garbage": Attack("random bytes, 1 to 1 MiB; headers without packets", _garbage),
    "half-open": Attack("64 connections that send nothing, or half a packet", _half_open),
    "slow": Attack("a handshake byte by byte", _slow),
    "close": Attack("gone after each byte of what opens a session", _closing(packets.SESSION)),
    "close-driving": Attack("gone after each byte of what drives", _closing(packets.DRIVING), drives=True),
    "flood": Attack("commands to drive as fast as they are taken", _flood, drives=True),
    "datagrams": Attack("datagrams of every size as fast as they go", _datagrams, datagrams=True),
}  # fmt: skip
