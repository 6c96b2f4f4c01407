"""A virtual robot on real lines: loopback TCP and pseudo-terminals, in real time, with bounded waits."""

import os
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from p2os.errors import TransportError
from p2os.pioneer.serve.host import Host
from p2os.pioneer.serve.robot_time import LONGEST_PAUSE_NS, SETTLE_NS
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.sip import SIP_KINDS
from p2os.transport import HungUpError, Listener, Loops, Transport, listen_url, open_url
from p2os.transport.wall_clock import wall_clock
from simbase.timing import NS_PER_MS

#: chosen: how often a robot of these tests reports, five times as often as others.
CYCLE_NS = 20 * NS_PER_MS
#: A bound on every wait; reached only when something is broken.
PATIENCE_S = 30.0

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are Unix's")


class Served:
    """A host in a thread, and its robot."""

    def __init__(self, robot: Any, url: str) -> None:
        self.robot = robot
        self.events: list[str] = []
        self.listener = listen_url(url)
        self.url = self.listener.description
        self.host = Host(
            robot.pioneer, self.listener, on_event=lambda _now, what, detail: self.events.append(f"{what}: {detail}")
        )
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while not self._end.is_set():
            self.host.turn(0.02)
        self.host.close()

    def wait_for(self, text: str, count: int = 1) -> None:
        end = time.monotonic() + PATIENCE_S
        while sum(text in event for event in self.events) < count:
            assert time.monotonic() < end, f"{text!r} never came: {self.events}"
            time.sleep(0.005)

    def close(self) -> None:
        self._end.set()
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()


class Caller:
    """A client that knows frames and nothing else."""

    def __init__(self, url: str) -> None:
        self.line: Transport = open_url(url)
        self._decoder = Decoder()

    def say(self, number: int, argument: int | None = None) -> None:
        self.line.write(Command(number, argument).to_frame().to_bytes())

    def receive(self, wanted: Callable[[Frame], bool]) -> Frame:
        """Return the next frame that is wanted."""
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            self._decoder.receive(self.line.read(), 0)
            while (item := self._decoder.next_item()) is not None:
                if isinstance(item, Frame) and wanted(item):
                    return item
            time.sleep(0.002)
        pytest.fail("it never came")

    def open(self) -> None:
        for number in (0, 1, 2):
            self.say(number)
            self.receive(lambda frame, number=number: frame.kind == number)
        self.say(C.OPEN)
        self.receive(lambda frame: frame.kind in SIP_KINDS)

    def close(self) -> None:
        self.line.close()


@pytest.fixture(params=["tcp:127.0.0.1:0", "pty:"])
def served(request: pytest.FixtureRequest, make_robot: Callable[..., Any]) -> Iterator[Served]:
    made = Served(make_robot(sip_period_ns=CYCLE_NS), request.param)
    yield made
    made.close()


def test_a_client_opens_drives_and_leaves(served: Served) -> None:
    caller = Caller(served.url)
    caller.open()
    caller.say(C.ENABLE, 1)
    caller.say(C.VEL, 100)
    caller.receive(lambda frame: frame.kind == 0x33)
    caller.say(C.CLOSE)
    caller.close()
    served.wait_for("client gone")
    assert served.robot.reported() == ["synchronised", "opened", "motors", "closed"]


def test_a_client_that_vanishes_stops_the_robot_and_the_next_is_served(served: Served) -> None:
    for round_ in (1, 2, 3):
        caller = Caller(served.url)
        caller.open()
        caller.say(C.ENABLE, 1)
        caller.say(C.VEL, 300)
        caller.receive(lambda frame: frame.kind == 0x33)
        caller.close()
        served.wait_for("client gone", round_)
        state = served.robot.pioneer.state
        assert (state.open, state.left_setpoint_mps) == (False, 0.0)


def test_what_a_client_sent_before_it_reset_the_connection_is_read_though_a_packet_is_due(
    make_robot: Callable[..., Any],
) -> None:
    robot, now, listener = make_robot(), [0], listen_url("tcp:127.0.0.1:0")
    host = Host(robot.pioneer, listener, clock=lambda: now[0])
    received, receive = bytearray(), robot.pioneer.receive
    robot.pioneer.receive = lambda data, at: (received.extend(data), receive(data, at))
    with socket.create_connection(("127.0.0.1", int(listener.description.rpartition(":")[2]))) as client:
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for number in (0, 1, 2, C.OPEN):
            client.sendall(Command(number).to_frame().to_bytes())
            for _ in range(3):
                host.turn(0.01)
                now[0] += 20 * NS_PER_MS
        stop = Command(C.STOP).to_frame().to_bytes()
        client.sendall(stop)
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    now[0] += 110 * NS_PER_MS
    for _ in range(3):
        host.turn(0.01)
    assert received.endswith(stop)
    assert host.client is None
    host.close()


def test_packets_come_no_faster_than_the_clock_goes(served: Served) -> None:
    begun_ns = wall_clock()
    caller = Caller(served.url)
    caller.open()
    for _ in range(15):  # many, for the handshake is counted, too
        caller.receive(lambda frame: frame.kind in SIP_KINDS)
    assert wall_clock() - begun_ns >= 15 * CYCLE_NS  # a loaded machine lags; the bound above is PATIENCE_S
    caller.close()


@pytest.mark.parametrize("name", ["aria", "player"])
def test_a_captured_client_is_served(served: Served, name: str, request: pytest.FixtureRequest) -> None:
    """The captured bytes, sixty times faster than they were recorded."""
    caller = Caller(served.url)
    for number in (0, 1, 2):  # the handshake waits for its answers
        caller.say(number)
        caller.receive(lambda frame, number=number: frame.kind == number)
    last = 0.0
    for at, data in request.getfixturevalue(name)[3:-1]:
        time.sleep((at - last) / 60 if last else 0)
        last = at
        caller.line.write(data)
    caller.receive(lambda frame: frame.kind == 0x33)
    caller.close()
    served.wait_for("client gone")
    assert "opened" in served.robot.reported()


def test_a_second_tcp_client_is_refused_aloud(make_robot: Callable[..., Any]) -> None:
    served = Served(make_robot(), "tcp:127.0.0.1:0")
    first = Caller(served.url)
    first.open()
    port = int(served.url.rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as second:
        second.sendall(bytes(100))  # to close while these wait would reset the connection: the words would be lost
        heard = b"".join(iter(lambda: second.recv(100), b""))
    assert re.fullmatch(rb"busy: 127\.0\.0\.1:\d+ has been connected for \d+ s\r\n", heard)
    served.wait_for("client refused")
    first.receive(lambda frame: frame.kind in SIP_KINDS)
    first.close()
    served.close()


def test_our_own_client_reports_why_it_was_refused(make_robot: Callable[..., Any]) -> None:
    served = Served(make_robot(), "tcp:127.0.0.1:0")
    first = Caller(served.url)
    first.open()
    with pytest.raises(HungUpError, match=r"closed the connection: busy: 127\.0\.0\.1:\d+ has been connected for 0 s"):
        Caller(served.url).receive(lambda _frame: False)
    first.close()
    served.close()


def test_a_client_that_only_closes_its_writing_side_leaves_a_robot_that_stands(make_robot: Callable[..., Any]) -> None:
    """Half-closed (shutdown): it could still receive, but could not stop the robot any more."""
    served = Served(make_robot(), "tcp:127.0.0.1:0")
    with socket.create_connection(("127.0.0.1", int(served.url.rpartition(":")[2])), timeout=PATIENCE_S) as client:
        for number, argument in ((0, None), (1, None), (2, None), (C.OPEN, None), (C.ENABLE, 1), (C.VEL, 300)):
            client.sendall(Command(number, argument).to_frame().to_bytes())
        end = time.monotonic() + PATIENCE_S
        while not served.robot.pioneer.state.motors_enabled:
            assert time.monotonic() < end
            time.sleep(0.002)
        client.shutdown(socket.SHUT_WR)
        served.wait_for("client gone")
        assert not served.robot.pioneer.state.motors_enabled
        Caller(served.url).open()
    served.close()


def test_a_host_that_ends_lets_its_client_go(make_robot: Callable[..., Any]) -> None:
    served = Served(make_robot(), "tcp:127.0.0.1:0")
    caller = Caller(served.url)
    caller.open()
    served.close()
    with pytest.raises(HungUpError):
        caller.receive(lambda _frame: False)
    with pytest.raises(TransportError):
        open_url(served.url)
    assert served.events[-1] == "client gone: the host ends"


# Rounds one by one, with a clock that the test holds --------------------------------------


class Clock:
    """A clock that stands until it is set."""

    now = 0

    def __call__(self) -> int:
        return self.now


class DeadLine:
    """A line that fails in the way that it is set to."""

    description = "dead"
    failing = ""

    def read(self) -> bytes:
        if self.failing == "read":
            raise TransportError("the line failed")
        return b""

    def write(self, _data: bytes) -> None:
        if self.failing == "write":
            raise TransportError("the line takes nothing")

    def fileno(self) -> int:
        raise TransportError("no descriptor")

    def close(self) -> None:
        raise TransportError("already gone")


class OneLine:
    """A listener without descriptor whose client is always there."""

    description, poll_s = "one", 0.001

    def __init__(self, line: Transport) -> None:
        self.line: Transport | None = line

    def accept(self) -> Transport | None:
        line, self.line = self.line, None
        return line

    def fileno(self) -> int | None:
        return None

    def close(self) -> None:
        pass


def make_host(robot: Any, listener: Listener) -> tuple[Host, Clock, list[str]]:
    clock, events = Clock(), []
    host = Host(
        robot.pioneer, listener, clock=clock, on_event=lambda _now, what, detail: events.append(f"{what}: {detail}")
    )
    return host, clock, events


def test_a_robot_without_client_does_not_run_and_costs_nothing(robot: Any) -> None:
    host, clock, _ = make_host(robot, listen_url("tcp:127.0.0.1:0"))
    for _ in range(5):
        clock.now += 3600 * 1000 * NS_PER_MS
        host.turn(0)
    assert host.now == 0
    assert robot.body.steps == 0
    assert host.client is None
    host.close()


def test_a_robot_comes_to_rest_after_its_client_has_left(robot: Any) -> None:
    loops = Loops()
    host, clock, events = make_host(robot, loops.listen("robot"))
    client = open_url("loop:robot", loops=loops)
    host.turn(0)
    assert host.client == "loop:robot"
    client.close()
    host.turn(0)
    assert events == ["client connected: loop:robot", "client gone: loop:robot closed the connection"]
    for _ in range(20):
        clock.now += 100 * NS_PER_MS
        host.turn(0)
    assert host.now == SETTLE_NS, "and then its time stands still"
    host.close()


def test_a_pause_of_the_machine_is_reported_and_left_out(robot: Any) -> None:
    loops = Loops()
    host, clock, events = make_host(robot, loops.listen("robot"))
    client = open_url("loop:robot", loops=loops)
    host.turn(0)
    clock.now += LONGEST_PAUSE_NS
    host.turn(0)
    assert host.now == LONGEST_PAUSE_NS
    clock.now += LONGEST_PAUSE_NS + 1
    host.turn(0)
    assert host.now == LONGEST_PAUSE_NS
    assert events[-1].startswith("lag: the machine paused for 0.3 s")
    client.close()
    host.close()


@pytest.mark.parametrize("failing", ["read", "write"])
def test_a_line_that_fails_frees_the_robot(robot: Any, failing: str) -> None:
    line = DeadLine()
    host, clock, events = make_host(robot, OneLine(line))  # type: ignore[arg-type]
    host.turn(0)
    robot.open()
    line.failing = failing
    for _ in range(3):
        clock.now += 100 * NS_PER_MS
        host.turn(0)
    assert events[-1].startswith("client gone: the line")
    assert not robot.pioneer.state.open
    assert host.client is None
    host.turn(0)  # nobody comes any more; the listener is asked all the same
    host.close()
