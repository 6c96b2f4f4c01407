"""A web page posts what moves a robot to every port that anything of ours listens on: nothing of it is acted on.

Each row of `LISTENERS` serves one as its users do, over TCP of this machine, and tells what a client has changed there.
Requests come split at every byte of their beginning; they carry what would turn the wheels, or put a driving robot
back. Bodies in C++ and Python are programs of their own: `test_outside_bodies.py`.
"""

import contextlib
import logging
import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import pytest

from bluepill_sim.board import BluePill
from bluepill_sim.cli.gdb_server import GdbServer
from bluepill_sim.debug.machine import LoneChip
from bluepill_sim.debug.packets import frame
from p2os.cli.captures.sniff import TapBridge
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.serve.aux_endpoint import AuxEndpoint
from p2os.pioneer.serve.control_line import ControlLine
from p2os.pioneer.serve.host import Host
from p2os.pioneer.world import load_world
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.robots.parameters import load_parameters
from p2os.transport import Loops, listen_url
from simbase.listening import LOGGER, OPENINGS
from simbase.timing import NS_PER_MS

LIMIT_S = 30.0
#: A bound on the wait for a close that has been done already; reached only when something is broken.
CLOSED_S = 5.0


def said(number: int, argument: int | None = None) -> bytes:
    return Command(number, argument).to_frame().to_bytes()


FORWARD = said(0) + said(1) + said(2) + said(C.OPEN) + said(C.ENABLE, 1) + said(C.VEL, 300)
#: What somebody obeys at one port or another.
BODY = FORWARD + b"\nreset\nplace box 1 0 0.3 0.3\n" + frame(b"vKill;1")
HEADER = b" HTTP/1.1\r\nHost: 127.0.0.1:8101\r\nContent-Type: text/plain\r\n\r\n"


def request_of(opening: bytes) -> bytes:
    """Return a whole request that begins so."""
    return opening + b"/" + HEADER + BODY


@dataclass(kw_only=True)
class Listening:
    """One that listens."""

    port: int
    #: What a client can change: how far wheels have turned, sessions, bytes that came.
    state: Callable[[], object]
    #: Does what is due, where no thread of its own does.
    turn: Callable[[], object] = lambda: None
    #: What a client of its begins with, and gets an answer to; empty: there is none.
    hello: bytes = b""


class Wheels:
    """A served robot on a body, in virtual time: a turn is 100 ms."""

    def __init__(self, listener: Any) -> None:
        parameters, world = load_parameters("p2dx"), load_world("room")
        self.body = make_body("kinematic", world, parameters, start=world.start)
        self.pioneer = Pioneer(parameters=parameters, body=self.body)
        self.now = 0
        self.host = Host(self.pioneer, listener, clock=lambda: self.now)

    def turn(self) -> None:
        self.now += 100 * NS_PER_MS
        self.host.turn(0)

    def state(self) -> object:
        state = self.pioneer.state
        return state.open, state.left_setpoint_mps, self.body.state.left_angle_rad if not state.open else None


def port_of(listener: Any) -> int:
    return int(listener.description.rpartition(":")[2])


@contextlib.contextmanager
def serving() -> Iterator[Listening]:
    listener = listen_url("tcp:127.0.0.1:0")
    wheels = Wheels(listener)
    with contextlib.closing(wheels.host):
        yield Listening(port=port_of(listener), turn=wheels.turn, state=wheels.state, hello=said(0))


@contextlib.contextmanager
def sniffing() -> Iterator[Listening]:
    """A bridge before a served robot."""
    loops, listener = Loops(), listen_url("tcp:127.0.0.1:0")
    wheels = Wheels(loops.listen("robot"))
    bridge = TapBridge(
        listener, loops.connect("robot"), lambda: loops.connect("robot"), on_chunk=lambda _: None,
        on_event=lambda _: None, clock=lambda: wheels.now,
    )  # fmt: skip
    bridge._wait = lambda: None

    def turn() -> None:
        bridge.turn()
        wheels.turn()

    with contextlib.closing(wheels.host), contextlib.closing(bridge):
        yield Listening(
            port=port_of(listener), turn=turn, state=lambda: (wheels.state(), bridge.sessions), hello=said(0)
        )


@contextlib.contextmanager
def controlling() -> Iterator[Listening]:
    """A robot that drives for its client: an order of an operator would put it back."""
    loops, listener = Loops(), listen_url("tcp:127.0.0.1:0")
    wheels = Wheels(loops.listen("robot"))
    line, client = ControlLine(listener), loops.connect("robot")
    client.write(FORWARD)

    def turn() -> None:
        client.read()
        client.write(said(C.PULSE))
        wheels.turn()
        line.serve([wheels.host])

    for _ in range(15):
        turn()
    assert wheels.state() == (True, pytest.approx(0.3), None)
    with contextlib.closing(wheels.host), contextlib.closing(line):
        yield Listening(port=port_of(listener), turn=turn, state=wheels.state, hello=b"status\n")


@contextlib.contextmanager
def device() -> Iterator[Listening]:
    listener, got = listen_url("tcp:127.0.0.1:0"), bytearray()
    wheels = Wheels(Loops().listen("robot"))
    wheels.pioneer.receive_aux = lambda _port, data, _now: got.extend(data)
    endpoint = AuxEndpoint(1, listener)
    with contextlib.closing(wheels.host), contextlib.closing(endpoint):
        yield Listening(
            port=port_of(listener), turn=lambda: endpoint.move_bytes(wheels.pioneer, 0), state=lambda: bytes(got)
        )


@contextlib.contextmanager
def debugging() -> Iterator[Listening]:
    """A program under GDB that ends with the first debugger: a page is none."""
    board = BluePill(str(files("robot_bench.firmware") / "dodge.elf"))
    server = GdbServer(LoneChip(board), 0)
    thread = threading.Thread(target=lambda: server.serve(once=True), daemon=True)
    thread.start()
    yield Listening(port=server.port, state=lambda: (board.now_ns, thread.is_alive()), hello=frame(b"?"))
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", server.port), timeout=1) as last:
        last.sendall(frame(b"vKill;1"))
    thread.join(LIMIT_S)
    server.close()
    assert not thread.is_alive()


LISTENERS = {
    "serve": serving, "sniff --listen": sniffing, "serve --control": controlling, "serve --aux": device,
    "mcu debug, run --gdb": debugging,
}  # fmt: skip


@pytest.fixture(params=LISTENERS)
def listening(request: pytest.FixtureRequest) -> Iterator[Listening]:
    with LISTENERS[request.param]() as made:
        yield made


def is_refused(listening: Listening, pieces: list[bytes]) -> bool:
    """Send pieces, each a segment; tell whether the connection is closed then."""
    with socket.create_connection(("127.0.0.1", listening.port), timeout=LIMIT_S) as page:
        page.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        listening.turn()
        with contextlib.suppress(ConnectionError):  # it may be closed before the last piece
            for piece in pieces:
                page.sendall(piece)
                listening.turn()
        page.settimeout(CLOSED_S)
        try:
            return page.recv(1) == b""
        except ConnectionError:
            return True
        except TimeoutError:
            return False


def test_nothing_of_a_request_is_acted_on(listening: Listening, caplog: pytest.LogCaptureFixture) -> None:
    before, requests = listening.state(), 0
    with caplog.at_level(logging.WARNING, LOGGER):
        for opening in OPENINGS:
            request = request_of(opening)
            for place in range(1, len(opening) + 2):
                assert is_refused(listening, [request[:place], request[place:]]), (opening, place)
                assert listening.state() == before, (opening, place)
                requests += 1
        post = request_of(b"POST ")
        assert is_refused(listening, [post[at : at + 1] for at in range(len(post))])
        for _ in range(20):
            listening.turn()
    assert listening.state() == before
    assert [record.name for record in caplog.records if "refused: it begins" in record.getMessage()] == [LOGGER] * (
        requests + 1
    )


def test_a_client_whose_first_byte_comes_alone_is_answered(listening: Listening) -> None:
    if not listening.hello:
        pytest.skip("nothing is answered there")
    with socket.create_connection(("127.0.0.1", listening.port), timeout=LIMIT_S) as client:
        client.sendall(listening.hello[:1])
        listening.turn()
        client.sendall(listening.hello[1:])
        for _ in range(10):
            listening.turn()
        assert client.recv(1) != b""
