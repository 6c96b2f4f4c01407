"""Byte lines over a machine that is acted: which calls it gets, what is returned, and how each failure is worded."""

import asyncio
import errno
import os
import random
import select
import socket
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from ipaddress import IPv4Address
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import pytest
import serial

from p2os.errors import TransportError
from p2os.transport import Loops, listen_url, one_address, open_url, pseudo_terminal, serial_port, sockets, waiting
from p2os.transport.ports import READ_BYTES
from p2os.transport.sockets import BACKLOG_BYTES, LONGEST_REASON, SocketTransport
from p2os.transport.url import SerialUrl, TcpUrl, parse_url
from p2os.transport.virtual_clock import LOOK_S, VirtualClock
from p2os.transport.waiting import LONGEST_CLOSING_NS, ClosingLines, RealWaits, WakeUp, waits_of
from p2os.transport.wall_clock import GAP_NS, GapWatch, wall_clock
from simbase.errors import P2osError
from simbase.listening import WebClientError
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="numbers of options, and words of failures, are Linux's"
)

PARTS = (
    ("", "serial:", "Serial:", "tcp:", "TCP:", "tpc:", "pty:", "ptty:", "loop:", "lop:", "udp:", "http:", "ws:", "x:"),
    ("", "/dev/ttyUSB0", "COM3", "com12x", "robot", "robot.local", "10.0.0.5", "localhost", "[::1]", "[]", "//robot",
     "[::1", "::1", "/run/a b", "-", "é", "10.0.0", "10.0.0.5000"),
    ("", ":", ":0", ":1", ":8101", ":65535", ":65536", ":-1", ":+1", ":1.0", ":٣", ":999999", "?baud=0", "?baud=1",
     "?baud=4000000", "?baud=4000001", "?baud=", "?baud", "?parity=odd", "?"),
)  # fmt: skip
#: errno of what a system says → the same as text, which differs between systems only in its words.
FAILURES = (errno.ENOENT, errno.EACCES, errno.EBUSY, errno.EAGAIN, errno.EADDRINUSE, errno.ECONNREFUSED, errno.EIO)


def failure(number: int) -> OSError:
    return OSError(number, os.strerror(number))


def did(action: Callable[..., object], *arguments: object, **named: object) -> str:
    """Return what an action gives, or how it fails, the errors of a system too."""
    try:
        return tried(action, *arguments, **named)
    except OSError as error:
        return f"{type(error).__name__} {error}"


class ActedSocket(Acted):
    """A connection; what it is sent it takes, unless told otherwise."""

    def __init__(self, calls: list[str], *, family: object = socket.AF_INET, **answers: Sequence[object]) -> None:
        super().__init__(calls, "", **{"send": [len] * 999, **answers})
        self.family = family


def urls(draw: random.Random) -> Iterator[str]:
    everything = [f"{first}{middle}{end}" for first in PARTS[0] for middle in PARTS[1] for end in PARTS[2]]
    for text in [*draw.sample(everything, 700), "COM3", "COM3:8101", "tcp:localhost", "a" * 300]:
        found = tried(parse_url, text)
        yield f"{text} {found} {tried(lambda text=text: str(parse_url(text)))}"
    for other in (Path("/dev/ttyUSB0"), Path("robot"), b"tcp:", 3, None):
        yield tried(parse_url, other)
    for text in ("loop:a", "robot"):
        yield f"{tried(open_url, text)} {tried(listen_url, text)}"


def connections(draw: random.Random) -> Iterator[str]:
    calls: list[str] = []
    for family in (socket.AF_INET, socket.AF_INET6, socket.AF_UNIX):
        refuses = [failure(errno.EINVAL), None] * 4
        SocketTransport(ActedSocket(calls, family=family, setsockopt=refuses), "tcp:a:1")  # type: ignore[arg-type]
        yield taken(calls)
    first = [b"busy: you\r\n", b"busy: " + b"x" * (LONGEST_REASON - 8) + b"\r\n", b"x" * (LONGEST_REASON - 1) + b"\r\n",
             b"", b"no end", b"\r\n", b"\xff\r\n", b"\x07\r\n", b"two\r\nlines\r\n", b"x" * LONGEST_REASON,
             b"x" * (LONGEST_REASON + 1), b"x" * (LONGEST_REASON - 2) + b"\r\nmore"]  # fmt: skip
    for begins in first:
        for then in (b"", b"\r\n", b"x\r\n"):
            pieces = [piece for piece in (begins, then) if piece]
            line = SocketTransport(ActedSocket(calls, recv=[*pieces, b""]), "tcp:a:1")  # type: ignore[arg-type]
            calls.clear()
            yield said([did(line.read) for _ in range(len(pieces) + 1)])
            peeked = [*pieces[:1], failure(errno.ECONNRESET), then or failure(errno.EBADF)]
            line = SocketTransport(ActedSocket(calls, recv=peeked), "tcp:a:1")  # type: ignore[arg-type]
            yield said([did(line.read) for _ in range(len(pieces[:1]) + 1)]) + taken(calls)
    for error in (BlockingIOError(), InterruptedError(), WebClientError("begins with an HTTP request"), failure(5)):
        line = SocketTransport(ActedSocket(calls, recv=[error], send=[error]), "tcp:a:1")  # type: ignore[arg-type]
        calls.clear()
        yield f"{did(line.read)} {did(line.write, b'abc')} {taken(calls)}"
    line = SocketTransport(ActedSocket(calls, send=[2, BlockingIOError(), *[BlockingIOError()] * 9]), "t")  # type: ignore[arg-type]
    calls.clear()
    for size in (5, BACKLOG_BYTES - 3 - 2, 1, 1, 1):
        yield f"{size} {did(line.write, bytes(size))} {taken(calls)}"
    line.refuse("never sent")
    yield taken(calls)
    for reason in ("busy", "é", "x" * (LONGEST_REASON - 2), "x" * LONGEST_REASON):
        for answers in ({}, {"send": [BlockingIOError()]}, {"send": [failure(32)]}, {"shutdown": [failure(107)]}):
            line = SocketTransport(ActedSocket(calls, **answers), "t")  # type: ignore[arg-type]
            calls.clear()
            yield f"{did(line.refuse, reason)} {taken(calls)}"
    for waits in ([], [b"x"] * 3, [b"x"] * 99, [failure(9)]):
        line = SocketTransport(ActedSocket(calls, recv=waits, shutdown=[failure(107)]), "t")  # type: ignore[arg-type]
        calls.clear()
        line.set_baud(9600)
        line.close()
        yield f"{len(waits)} {taken(calls)}"


def places(draw: random.Random) -> Iterator[str]:
    """Yield what is asked of a system to reach another program, and to be reached."""
    calls: list[str] = []
    far = TcpUrl(host="robot", port=8101)
    for error in (*map(failure, FAILURES), UnicodeError("label too long"), TimeoutError("timed out"), None):
        answers = [error or ActedSocket(calls)]
        with patch.object(socket, "create_connection", Acted(calls, make=answers).make):
            yield f"{did(lambda: open_url(str(far)).description)} {taken(calls)}"
        listening = Acted(calls, accept=[failure(11), (ActedSocket([]), ("10.0.0.9", 4000))], fileno=[7])
        listening.__dict__["port"] = 4321
        with patch.object(sockets, "listen_tcp", Acted(calls, make=[error or listening]).make):
            yield f"{did(lambda: listen_url('tcp:robot:0').description) if error else ''} {taken(calls)}"
            if error is None:
                place = listen_url("tcp:robot:0")
                came = [place.accept(), place.accept()]
                yield said(
                    (place.description, place.poll_s, place.fileno(), [line and line.description for line in came])
                )
                place.close()
                yield taken(calls)
    loops = Loops()
    for name in ("a", "b", "a"):
        yield did(lambda name=name: loops.listen(name).description)
        yield did(lambda name=name: loops.connect(f"{name}x"))
    place = listen_url("loop:c", loops=loops)
    lines = [open_url("loop:c", loops=loops) for _ in range(3)]
    for number in range(4):
        near = place.accept()
        if near is not None:
            near.write(bytes((number,)))
        yield said((place.poll_s, bool(waiting.wait_readable([place.fileno() or 0], 0)), near and near.description))
    yield said([line.read() for line in lines])
    left = open_url("loop:c", loops=loops)
    bell = place.fileno()
    place.close()
    yield f"{did(left.read)} {place.fileno()} {did(os.fstat, bell)}"
    yield did(open_url, "loop:c", loops=loops)
    yield did(lambda: listen_url("loop:c", loops=loops).description)


def serial_ports(draw: random.Random) -> Iterator[str]:
    calls: list[str] = []
    says = {
        "read": [b"abc", failure(5), TypeError("no port")],
        "write": [3, serial.SerialTimeoutException(), failure(5)],
    }
    for error in (*map(failure, FAILURES), serial.SerialException("odd\nsecond line"), ValueError("no baud"), None):
        port = Acted(calls, **says)
        with patch.object(serial, "Serial", Acted(calls, make=[error or port] * 2).make):
            yield f"{did(lambda: open_url('serial:/dev/a?baud=38400').description)} {taken(calls)}"
            yield f"{did(lambda: open_url('pty:/dev/b').description)} {taken(calls)}"
    with patch.object(serial, "Serial", Acted(calls, make=[port]).make):
        line = open_url("serial:/dev/a")
    calls.clear()
    yield said([did(line.read) for _ in range(3)] + [did(line.write, b"xyz") for _ in range(3)]) + taken(calls)
    for descriptor in (0, 5, None):
        port.__dict__["fd"] = descriptor
        yield did(line.fileno)
    line.set_baud(19200)
    line.close()
    yield said(port.__dict__["baudrate"]) + taken(calls)
    with patch.object(serial, "Serial", Acted(calls, make=[port, failure(2), port]).make):
        place = serial_port.SerialListener(SerialUrl(path="/dev/a"))
        yield said((place.description, place.poll_s, place.fileno()))
        for _ in range(3):
            came = place.accept()
            yield f"{came and came.description} {taken(calls)}"
        place.close()
        yield taken(calls)
    with patch.object(serial, "Serial", Acted(calls, make=[port]).make):
        place = serial_port.SerialListener(SerialUrl(path="/dev/a"))
        calls.clear()
        place.close()
        place.close()
        yield taken(calls)
    found = [SimpleNamespace(device=name, description=text, hwid=text) for name, text in (("b", "x"), ("a", None))]
    with patch("serial.tools.list_ports.comports", lambda: found):
        yield said(serial_port.list_serial_ports())


def terminals(draw: random.Random) -> Iterator[str]:
    with TemporaryDirectory() as folder, ExitStack() as left:
        path = Path(folder, "robot")
        for there in ("nothing", "a file", "a link that leads nowhere", "a link"):
            if there == "a file":
                path.write_text("x")
            elif there != "nothing":
                path.symlink_to("/dev/null" if there == "a link" else "/dev/pts/none")
            try:
                place = listen_url(f"pty:{path}")
            except P2osError as error:
                yield f"{there}: {type(error).__name__} {error} {error.hint}".replace(folder, "")
            else:
                left.callback(place.close)
                yield f"{there}: {place.description} {place.poll_s} {place.fileno()} {place.accept()}".replace(
                    folder, ""
                )
                place.close()
                path.write_text("another's")
                place.close()
            yield said((path.is_symlink(), path.exists()))
            path.unlink(missing_ok=True)
        yield did(listen_url, f"pty:{folder}/none/robot").replace(folder, "")
        place = listen_url("pty:")
        name = place.description.removeprefix("pty:")
        for number in range(3):
            client = os.open(name, os.O_RDWR | os.O_NOCTTY)
            line = place.accept()
            assert line is not None
            line.set_baud(9600)
            line.write(b"\x03\r\n\xff" + bytes((number,)))
            os.write(client, b"\x04\n\r\x11" + bytes((number,)))
            waiting.wait_readable([line.fileno()], 30.0)
            yield said((os.read(client, 99), line.read(), line.read(), line.fileno() == place._master.descriptor))  # type: ignore[attr-defined]
            os.close(client)
            yield f"{did(line.read)} {place.accept()}".replace(name, "")
            line.close()
            yield said(place._master.descriptor >= 0)  # type: ignore[attr-defined]
        place.close()
        place.close()
        yield said(place._master.descriptor)  # type: ignore[attr-defined]
        line = open_url("pty:")
        client = os.open(line.description.removeprefix("pty:"), os.O_RDWR | os.O_NOCTTY)
        line.write(bytes(1 << 20))
        yield said(len(os.read(client, 1)))
        os.close(client)
        descriptor = line.fileno()
        line.close()
        yield f"{did(os.fstat, descriptor).split(' ')[0]} {line.fileno()}"
    with patch.dict("sys.modules", {"pty": None}):
        yield did(pseudo_terminal.PtyMaster, parse_url("pty:"))


class ActedLine(SocketTransport):
    """A line of which all that is done is noted; it ends when it has given what it has."""

    def __init__(self, calls: list[str], name: str, reads: Sequence[object]) -> None:
        self.description, self._acted = name, Acted(calls, **{f"{name}.read": reads})
        self._name = name

    def read(self) -> bytes:
        return getattr(self._acted, f"{self._name}.read")() or b""

    def refuse(self, reason: str) -> None:
        getattr(self._acted, f"{self._name}.refuse")(reason)

    def close(self) -> None:
        getattr(self._acted, f"{self._name}.close")()


def waits(draw: random.Random) -> Iterator[str]:
    calls: list[str] = []
    ready: list[object] = [([3], [], []), ([], [], []), ([3, 5], [], [])]
    polled = Acted(calls, poll=[[(2000, 1)]] * 9)
    with ExitStack() as acting:
        acting.enter_context(patch.object(select, "select", Acted(calls, select=ready).select))
        acting.enter_context(patch.object(select, "poll", lambda: polled))
        acting.enter_context(patch.object(time, "sleep", Acted(calls).sleep))
        for descriptors in ((3,), (3, 1023), [3, 5]):
            yield f"{sorted(waiting.wait_readable(descriptors, 0.25))} {taken(calls)}"
        for longest_s in (0.5, 0, -1.0):
            yield f"{waiting.wait_readable((), longest_s)} {waiting.wait_readable([1024, 3], longest_s)} {taken(calls)}"
    numbers: list[object] = [4] * 5
    line = Acted(calls, fileno=numbers + [TransportError("none")] * 2 + [failure(9)])
    acted = Acted(calls, readable=[set()] * 5 + [ValueError("closed")] * 9)
    gaps = Acted(calls)
    with patch.object(waiting, "wait_readable", acted.readable), patch.object(time, "sleep", Acted(calls).sleep):
        for due in (None, 90 * NS_PER_MS, 110 * NS_PER_MS, 111 * NS_PER_MS, 9 * NS_PER_MS, 12 * NS_PER_MS, 10, None):
            waiting.wait_for_line(line, due, 10 * NS_PER_MS, gaps)  # type: ignore[arg-type]
            yield f"{due} {taken(calls)}"
        waiting.wait_for_line(line, None, 10)  # type: ignore[arg-type]
        waiting.wait_for_bytes(line, -1.0)  # type: ignore[arg-type]
        really = RealWaits()
        really.look(0.25)
        yield taken(calls) + did(really.wait_readable, (1,), 0.5) + taken(calls)
        really.wait_for_change(Acted(calls), 0.75)  # type: ignore[arg-type]
        yield taken(calls)
    clock = VirtualClock()
    yield said((waits_of(clock) is clock, type(waits_of(wall_clock)).__name__))
    near, far = socket.socketpair()
    with near, far:
        yield said(waiting.has_hung_up(near.fileno()))
        far.send(b"x")
        far.shutdown(socket.SHUT_WR)
        yield said((waiting.has_hung_up(near.fileno()), waiting.has_hung_up(far.fileno())))
    bell = WakeUp()
    for _ in range(3):
        bell.ring()
        yield said(len(waiting.wait_readable([bell.fileno()], 0)))
        bell.clear()
        yield said(len(waiting.wait_readable([bell.fileno()], 0)))
        for _ in range(5000):
            bell.ring()
        bell.clear()
    bell.close()
    bell.ring()
    bell.clear()
    yield said(bell.fileno())


def closing_lines(draw: random.Random) -> Iterator[str]:
    """Yield what happens to lines of refused peers that read, talk on or stay."""
    calls: list[str] = []
    now = [0]
    lines = ClosingLines(lambda: now[0])
    gone = TransportError("gone")
    whole = bytes(READ_BYTES)
    kinds: tuple[Sequence[object], ...] = (
        [gone],
        [b"abc", b"", gone],
        [whole] * 3 + [gone],
        [whole] * 15 + [b""],
        [whole] * 16 + [gone],
        [],
        [whole] * 99,
    )
    for number in range(60):
        name = f"l{number}"
        lines.add(ActedLine(calls, name, draw.choice(kinds)), f"busy {number}")
        yield f"{len(lines)} {taken(calls)}"
        now[0] += draw.choice((0, 0, 50, 300, LONGEST_CLOSING_NS // NS_PER_MS - 1, 1)) * NS_PER_MS
        if draw.random() < 0.4:
            lines.poll()
            yield f"{now[0]} {len(lines)} {taken(calls)}"
    lines.add(Acted(calls), "no socket")  # type: ignore[arg-type]
    yield f"{len(lines)} {taken(calls)}"
    lines.close()
    yield f"{len(lines)} {taken(calls)}"
    for late in (-1, 0, 1):
        lines.add(ActedLine(calls, "edge", []), "busy")
        now[0] += LONGEST_CLOSING_NS + late
        lines.poll()
        yield f"{late} {len(lines)} {taken(calls)}"
        lines.close()
    calls.clear()
    for number in range(18):
        lines.add(ActedLine(calls, f"{number}", []), "busy")
    yield f"{len(lines)} {taken(calls)}"


def times(draw: random.Random) -> Iterator[str]:
    watch, now = GapWatch(5), 5
    for late in (0, 1, -1, GAP_NS - 1, GAP_NS, GAP_NS + 1, 3 * GAP_NS, -GAP_NS):
        watch.expect(now + 100)
        now += 100 + late
        yield said((late, watch.gap(now), watch.gap(now), watch.gap(now + GAP_NS + 1)))
    clock = VirtualClock()
    for _ in range(12):
        clock.sleep(draw.choice((0.0, -1.0, 1e-12, 1e-9, 0.1, 1.7)))
        yield said(clock())
    for within_s in (0.0, LOOK_S, 2 * LOOK_S + 1e-9, 1.0):
        looks: list[int] = []
        yield did(clock.until, lambda looks=looks: looks.append(clock()), within_s) + said((len(looks), clock()))
        clock.until(lambda: clock() % 7 < 2)
        yield said(clock())
    clock.look(0.001)
    yield said(clock())
    near, far = socket.socketpair()
    with near, far:
        yield said((len(clock.wait_readable((near.fileno(),), 0.5)), clock()))
        far.send(b"x")
        for longest_s in (None, 0.5, 0.0, -1.0):
            yield said((clock.wait_readable((near.fileno(),), longest_s) == {near.fileno()}, clock()))

    async def program() -> list[float]:
        loop, seen = asyncio.get_running_loop(), []
        for delay_s in (0.25, 0.0, 1.5):
            await asyncio.sleep(delay_s)
            seen.append(loop.time())
        seen.append(await loop.run_in_executor(None, loop.time))
        with suppress(TimeoutError):
            await asyncio.wait_for(loop.create_future(), 2.0)
        return [*seen, loop.time()]

    with asyncio.Runner(loop_factory=clock.event_loop) as runner:
        yield said((runner.run(program()), clock()))
    clock.sleep(NS_PER_S / 1e9)
    yield said(clock())


def addresses(draw: random.Random) -> Iterator[str]:
    calls: list[str] = []
    for address in ("127.0.0.1", "10.1.2.3", "224.0.0.1", "0.0.0.1", "255.255.255.255"):
        rows = one_address.filter_of(IPv4Address(address))
        yield said(rows)
        options: list[tuple[Any, ...]] = []
        line: Any = SimpleNamespace(setsockopt=lambda *given, options=options: options.append(given))
        one_address.hold(line, IPv4Address(address))
        (level, name, program), last = options
        yield said((level, name, len(program), program[:2].hex(), last))
    others = [IPv4Address("10.0.0.1"), IPv4Address("10.0.0.2")]
    for address in ("127.0.0.1", "eth0", "", "::1"):
        yield said((one_address._own(address, others), one_address._own(address, [])))
    yield taken(calls)
    lines = {
        kind: socket.socket(*kind)
        for kind in ((socket.AF_INET, socket.SOCK_DGRAM), (socket.AF_INET, socket.SOCK_STREAM))
    }
    lines[socket.AF_UNIX, socket.SOCK_DGRAM] = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    for kind, line in lines.items():
        found = one_address._udp_socket(line.fileno())
        yield said((kind, found is not None))
        if found is not None:
            yield said(found.fileno() != line.fileno())
            found.close()
        yield said(line.fileno() in one_address._sockets().values())
        line.close()


TRACES: dict[str, Trace] = {
    each.__name__: each
    for each in (urls, connections, places, serial_ports, terminals, waits, closing_lines, times, addresses)
}
TRACES["declared"] = declared_of("p2os.transport")
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
