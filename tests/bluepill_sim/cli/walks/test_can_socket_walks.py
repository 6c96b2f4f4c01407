"""A board's CAN in a socket that answers as it is drawn: frames, peers, refusals and addresses, as approved."""

import errno
import random
import socket
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from bluepill_sim.cli import can_socket
from bluepill_sim.cli.can_socket import CanSocket, candump_line, from_datagram, join_can, to_datagram
from bluepill_sim.fabric.bus_parts import CanFrame
from bluepill_sim.fabric.can_network import CanNetwork, CanNode
from tests.tools.suite.approved import Trace, judge_of, said, tried


def frame_of(draw: random.Random) -> CanFrame:
    extended, remote = draw.random() < 0.4, draw.random() < 0.2
    identifier = draw.choice((0, 1, 0x7FF)) | (0x1FFF_0000 if extended else 0)
    return CanFrame(
        identifier=identifier,
        is_extended=extended,
        is_remote=remote,
        remote_bytes=3 if remote else 0,
        data=b"" if remote else draw.randbytes(draw.choice((0, 3, 8))),
    )


def datagrams(draw: random.Random) -> Iterator[str]:
    for _ in range(40):
        frame = frame_of(draw)
        data = to_datagram(frame)
        line = candump_line(draw.choice((0, 1_234_567_891, 10**18)), frame, "can0", is_sent=draw.random() < 0.5)
        yield f"{data.hex()} {from_datagram(data) == frame} {line}"
    for word, length, body in (
        (1 << 29, 0, b""),
        (5, 8, b"x"),
        (5, 9, b"x"),
        (0x800, 1, b"x"),
        (1 << 31 | 0x800, 1, b"x"),
        (1 << 30 | 5, 8, b""),
        (1 << 30 | 5, 9, b""),
        (7 << 29, 1, b""),
    ):
        yield tried(from_datagram, struct.pack("=IB3x8s", word, length, body))
    yield tried(from_datagram, bytes(15)) + tried(from_datagram, bytes(17)) + tried(from_datagram, b"")
    for text in (
        "127.0.0.1:5",
        "localhost:65535",
        "localhost:65536",
        "127.9.9.9:1",
        "10.0.0.1:5",
        "1:2:3",
        ":5",
        "127.0.0.1:",
        "127.0.0.1:-1",
        "127.0.0.1:x",
        "::1:5",
    ):
        for is_open in (False, True):
            yield f"{text} {is_open} {tried(can_socket._address, text, f'udp:{text}', is_open=is_open)}"


class FakeSocket:
    """A datagram socket without a network: what comes and what fails is drawn."""

    def __init__(self, draw: random.Random) -> None:
        self.draw, self.coming, self.lines, self.family = (
            draw,
            list[tuple[bytes, object]](),
            list[str](),
            socket.AF_INET,
        )
        self.failing: dict[object, int] = {}

    def setblocking(self, blocks: bool) -> None:
        self.lines.append(f"blocks {blocks}")

    def close(self) -> None:
        self.lines.append("closed")

    def getsockname(self) -> tuple[str, int]:
        return "127.0.0.1", 1234

    def recvfrom(self, size: int) -> tuple[bytes, object]:
        if not self.coming:
            raise BlockingIOError if self.draw.random() < 0.7 else OSError(errno.EBADF, "closed")
        data, peer = self.coming.pop(0)
        return data[:size], peer

    def send(self, data: bytes) -> None:
        self.sendto(data, None)

    def sendto(self, data: bytes, peer: object) -> None:
        if peer in self.failing:
            raise OSError(self.failing[peer], "failed")
        self.lines.append(f"{peer} {data[:6].hex()}")


def sockets(draw: random.Random) -> Iterator[str]:
    for is_shared in (True, True, False):
        made, network, seen = FakeSocket(draw), CanNetwork(), list[str]()
        other = CanNode()
        network.join(other)
        with (
            patch.object(CanSocket, "_open", lambda _self, _where, made=made: made),
            patch.object(can_socket, "MOST_PEERS", 3),
            patch.object(can_socket, "MOST_WAITING", 4),
        ):
            bus = CanSocket("udp:127.0.0.1:0", network, lambda *row, seen=seen: seen.append(said(row)))
            bus._peers = {} if is_shared else None
            for _ in range(70):
                yield _go_on(draw, bus, made, network, other, seen)
            with bus:
                pass
            bus.close()
            yield said([made.lines, bus.describe(), bus.port])
            made.family = socket.AF_UNIX
            yield said(bus.port)


def _go_on(
    draw: random.Random, bus: CanSocket, made: FakeSocket, network: CanNetwork, other: CanNode, seen: list[str]
) -> str:
    for _ in range(draw.choice((0, 1, 3))):
        data = draw.choice(
            (
                b"",
                to_datagram(frame_of(draw)),
                to_datagram(frame_of(draw)),
                bytes(5),
                struct.pack("=IB3x8s", 1 << 29, 0, b""),
            )
        )
        made.coming.append((data, draw.choice(("a", "b", "c", "d", "e", ""))))
    if draw.random() < 0.2:
        made.failing = {draw.choice(("a", "b", None)): draw.choice((errno.ECONNREFUSED, errno.ENOENT, errno.ENOBUFS))}
    elif draw.random() < 0.3:
        made.failing = {}
    if draw.random() < 0.5:
        other.send(frame_of(draw), network.now_ns)
    bus.carry()
    network.advance_to(network.now_ns + draw.choice((1, 400_000)))
    counts = [
        bus.sent,
        bus.received,
        bus.refused,
        bus.dropped,
        bus.describe(),
        bus.node.waiting,
        list(bus._peers or ()),
    ]
    line = said([counts, made.lines, seen, len(made.coming)])
    made.lines.clear()
    seen.clear()
    return line


class System:
    """Sockets of a system, which fail as they are set to."""

    def __init__(self, **fails: OSError) -> None:
        self.fails, self.lines = fails, list[str]()

    def __call__(self, *how: object) -> "System":
        self.lines.append(f"socket {[int(one) for one in how]}")  # type: ignore[call-overload]
        return self

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)

        def call(*given: object) -> None:
            self.lines.append(f"{name} {said(given)}")
            error = self.fails.get(name)
            if error is not None and not (name == "bind" and given == ("",)):
                raise error

        return call


def opened(draw: random.Random) -> Iterator[str]:
    in_use, refused, gone = (
        OSError(errno.EADDRINUSE, "in use"),
        ConnectionRefusedError(errno.ECONNREFUSED, "refused"),
        OSError(errno.ENODEV, "no such device"),
    )
    for where in (
        "vcan0",
        "udp:127.0.0.1:5",
        "udp-open:0.0.0.0:5",
        "udp:0.0.0.0:5",
        "unix:no such folder/x",
        "unix:",
        "tcp:1",
        "udp:x",
    ):
        for fails in (
            {},
            {"bind": in_use},
            {"bind": in_use, "connect": refused},
            {"bind": gone},
            {"bind": in_use, "send": gone},
        ):
            system = System(**fails)
            with patch.object(can_socket.socket, "socket", system):
                found = tried(lambda each: describe(CanSocket(each, CanNetwork())), where)
            yield f"{where} {found} {system.lines}"
    with tempfile.TemporaryDirectory() as folder:
        network = CanNetwork()
        board: Any = SimpleNamespace(can=lambda given=None: SimpleNamespace(joined=given or network))
        log = Path(folder) / "log"
        yield said([join_can(board, None, None), tried(join_can, board, None, log)])
        with patch.object(can_socket.socket, "socket", System()):
            (bus,) = join_can(board, "udp:127.0.0.1:9", log)
        bus._heard(CanFrame(identifier=5, data=b"x"), 1_000_000)
        bus._went(CanFrame(identifier=6), 2_000_000)
        bus.close()
        yield log.read_text() + bus.describe()
        lone: Any = SimpleNamespace(can=lambda given=None: SimpleNamespace(joined=given))
        with patch.object(can_socket.socket, "socket", System()):
            yield said([describe(one) for one in join_can(lone, "vcan0", None)])


def describe(bus: CanSocket) -> str:
    text = f"{bus.describe()} {bus._peers}"
    bus.close()
    return text


TRACES: dict[str, Trace] = {"datagrams": datagrams, "sockets": sockets, "opened": opened}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
