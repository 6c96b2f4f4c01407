"""Real lines that go away and come back under a `Robot`, and the line's own small print."""

import contextlib
import os
import socket
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from p2os import Robot
from p2os.client import ConnectError, LinkLost, LinkLostError, Notice, ReconnectPlanned
from p2os.client.core import RobotCore
from p2os.client.line import Line
from p2os.client.robot_state import Link
from p2os.client.settings import ClientSettings
from p2os.errors import TransportError
from p2os.protocol.commands import enable, rvel, stop, vel
from p2os.transport.ports import Transport
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.client.client_rig import Rig, new_pioneer
from tests.p2os.client.served_robot import QUICK, Recorder, ServedRobot, until

STOPS = b"".join(command.to_frame().to_bytes() for command in (stop(), vel(0), rvel(0)))


@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are Unix's")
def test_a_serial_cable_is_pulled_and_put_back(tmp_path: Path) -> None:
    port = tmp_path / "ttyROBOT"
    served = ServedRobot(f"pty:{port}")
    recorder, received = Recorder(), list[Notice]()
    settings = replace(QUICK, backoff_ns=50 * NS_PER_MS)
    try:
        with Robot(f"serial:{port}", settings=settings, opener=recorder) as robot:
            robot.on_event(received.append)
            robot.set_velocity(0.3)
            until(lambda: served.is_moving)
            served.close()
            until(lambda: any(isinstance(notice, LinkLost) for notice in received), "the loss")
            lost = next(notice for notice in received if isinstance(notice, LinkLost))
            assert "vanished" in lost.reason
            with pytest.raises(LinkLostError, match="no robot is connected"):
                robot.set_velocity(0.3)
            until(lambda: sum(isinstance(notice, ReconnectPlanned) for notice in received) >= 2, "another try")
            served = ServedRobot(f"pty:{port}")
            robot.wait_open(timeout_s=30)
            assert recorder.lines[-1].written.startswith(STOPS)
            robot.sleep(0.3)
            assert not served.is_moving
            robot.set_velocity(0.3)  # the program was told by the call before
            until(lambda: served.is_moving)
        until(lambda: not served.is_moving)
        assert enable(False) in recorder.sent
    finally:
        served.close()


@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are Unix's")
def test_a_robot_at_a_terminal_is_opened_by_its_pty_url_too(tmp_path: Path) -> None:
    served = ServedRobot(f"pty:{tmp_path / 'robot'}")
    try:
        with Robot(f"pty:{tmp_path / 'robot'}", settings=QUICK) as robot:
            assert robot.identity.subclass == "p2dx"
    finally:
        served.close()


def test_a_port_that_accepts_and_says_nothing_is_no_robot() -> None:
    listening = socket.create_server(("127.0.0.1", 0))
    settings = ClientSettings(listen_ns=NS_PER_MS, quick_sync_ns=20 * NS_PER_MS, slow_sync_ns=20 * NS_PER_MS)
    try:
        with (
            pytest.raises(ConnectError, match="no answer") as caught,
            Robot(f"tcp:127.0.0.1:{listening.getsockname()[1]}", settings=settings),
        ):
            pass
        assert caught.value.hint == "is the robot on, and the cable in?"
    finally:
        listening.close()


def test_a_web_server_is_only_noise() -> None:
    listening = socket.create_server(("127.0.0.1", 0))

    def greet() -> None:
        caller, _ = listening.accept()
        with caller, contextlib.suppress(OSError):
            caller.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
            while caller.recv(100):
                caller.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")

    thread = threading.Thread(target=greet, daemon=True)
    thread.start()
    settings = ClientSettings(quick_sync_ns=20 * NS_PER_MS, slow_sync_ns=20 * NS_PER_MS)
    try:
        with (
            pytest.raises(ConnectError, match="only noise"),
            Robot(f"tcp:127.0.0.1:{listening.getsockname()[1]}", settings=settings),
        ):
            pass
    finally:
        listening.close()


class BrokenLine:
    """A line whose writes fail."""

    description = "a broken line"

    def __init__(self) -> None:
        self.is_closed = False
        self.bauds: list[int] = []

    def read(self) -> bytes:
        return b""

    def write(self, data: bytes) -> None:
        raise TransportError(f"{len(data)} bytes too many")

    def fileno(self) -> int:
        raise TransportError("it has none")

    def set_baud(self, baud: int) -> None:
        self.bauds.append(baud)

    def close(self) -> None:
        self.is_closed = True


def test_a_line_that_takes_no_bytes_is_lost_and_given_back() -> None:
    core, injected = RobotCore(ClientSettings()), BrokenLine()
    line = Line(core, 9600, lambda: 0)
    core.connect(0)
    line.turn()
    assert line.is_wanted
    transport: Transport = injected
    line.opened(transport)
    line.turn()
    assert injected.is_closed
    assert core.link is Link.FAILED
    assert core.problem is not None
    assert "bytes too many" in core.problem.reason


def test_a_wait_has_parts_and_ends_with_its_time() -> None:
    now_ns = 5_000 * NS_PER_MS
    line = Line(RobotCore(ClientSettings()), None, lambda: now_ns)
    waited = []
    for wait_s in line.waits(lambda _: False, 0.6):
        waited.append(round(wait_s, 3))
        now_ns += round(wait_s * NS_PER_S)
    assert waited == [0.25, 0.25, 0.1]
    assert next(line.waits(lambda _: False, None)) == 0.25
    assert list(line.waits(lambda _: False, 0.0)) == []
    assert list(line.waits(lambda _: True, None)) == []


def test_a_line_that_comes_too_late_is_given_back() -> None:
    core, late = RobotCore(ClientSettings()), BrokenLine()
    line = Line(core, None, lambda: 0)
    core.connect(0)
    line.turn()
    core.close(1)
    line.opened(late)
    line.turn()
    assert late.is_closed
    assert line.is_over


def test_a_line_without_a_descriptor_is_asked_for_bytes() -> None:
    served = ServedRobot()

    class Blind(Recorder):
        def __call__(self, url: str) -> Transport:
            line = super().__call__(url)
            line.fileno = BrokenLine().fileno  # type: ignore[method-assign]  # as serial ports of other systems
            return line

    try:
        with Robot(served.url, settings=QUICK, opener=Blind()) as robot:
            assert robot.next_state().number > 0
    finally:
        served.close()


def test_the_rig_is_the_same_robot_as_the_served_one() -> None:
    rig, served = Rig().connect(), ServedRobot(pioneer=new_pioneer())
    try:
        with Robot(served.url, settings=QUICK) as robot:
            assert robot.identity == rig.core.identity
            assert robot.limits == rig.core.limits
            assert robot.config == rig.core.config
    finally:
        served.close()


def test_a_line_whose_last_write_fails_in_any_way_is_given_back_and_closed() -> None:
    class Odd(BrokenLine):
        def write(self, data: bytes) -> None:
            raise OSError(f"{len(data)} bytes too many, and not an error of ours")

    core, odd = RobotCore(ClientSettings()), Odd()
    line = Line(core, None, lambda: 0)
    core.connect(0)
    line.turn()
    line.opened(odd)
    line.finish()
    assert odd.is_closed
    assert core.link is Link.CLOSED
