"""The blocking `Robot` on a real line: its thread, its waiting, and every way out of its block."""

import _thread
import math
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from p2os import Robot
from p2os.client import (
    ConnectError,
    DeadmanStopped,
    LinkLost,
    LinkLostError,
    MotionEnded,
    MotionError,
    Notice,
    RobotState,
    aio,
)
from p2os.client.robot_state import Link
from p2os.client.settings import ClientSettings
from p2os.protocol.commands import Command, CommandNumber, stop, vel
from p2os.protocol.packets import EncoderPacket, IoPacket, RawPacket, SerauxPacket, StandardSip
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import ParametersError
from p2os.transport import HungUpError
from simbase.errors import P2osError, UsageError
from simbase.timing import NS_PER_MS
from tests.p2os.client.served_robot import CLOSING_COMMANDS, QUICK, Recorder, ServedRobot, until


def robot_on(served: ServedRobot, recorder: Recorder | None = None, settings: ClientSettings = QUICK) -> Robot:
    return Robot(served.url, settings=settings, opener=recorder or Recorder(served.open), clock=served.clock)


def test_a_block_opens_a_session_and_ends_it(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)
    with robot_on(fast, recorder) as robot:
        assert robot.identity.subclass == "p2dx"
        assert robot.config is not None
        assert robot.link is Link.OPEN
        assert robot.baud is None
        assert robot.parameters.subclass == "p2dx"
        assert robot.profile is Profile.P2OS
        first = robot.next_state()
        assert robot.next_state().number > first.number
        assert robot.stats.frames_received > 3
        assert robot.limits.forward_mps == pytest.approx(0.75)
    assert recorder.sent[-4:] == CLOSING_COMMANDS
    fast.until(lambda: not fast.pioneer.state.open)
    robot.close()
    with pytest.raises(P2osError, match="this robot was closed"):
        robot.connect()


def test_states_and_events_can_be_iterated_and_listened_to(fast: ServedRobot) -> None:
    with robot_on(fast) as robot:
        received: list[RobotState] = []
        end = robot.on_state(received.append)
        numbers = [state.number for state, _ in zip(robot.states(), range(3), strict=False)]
        assert numbers == sorted(set(numbers))
        assert received
        end()
        end()
        count = len(received)
        robot.next_state()
        robot.next_state()
        assert len(received) <= count + 1
        notices: list[Notice] = []
        robot.on_event(notices.append)
        events = robot.events()

        def drive_when_heard() -> None:
            until(lambda: robot._runner.listeners._queues)
            robot.drive(0.0)

        threading.Thread(target=drive_when_heard, daemon=True).start()
        assert isinstance(next(events), MotionEnded)
        events.close()  # type: ignore[attr-defined]  # a generator
        fast.until(lambda: notices, "the listener's notice")
        waiting = robot.states()
        next(waiting)
        robot.close()
        assert list(waiting) == []
        assert list(robot.events()) == []


def test_a_drive_and_a_turn_arrive(fast: ServedRobot) -> None:
    with robot_on(fast) as robot:
        result = robot.drive(0.1)
        assert result.reached == pytest.approx(0.1, abs=0.016)
        robot.set_pose(1.0, 2.0, math.pi / 2)
        robot.turn_to(math.pi / 2 + 0.2, speed_radps=1.0)
        assert robot.pose.heading_rad == pytest.approx(math.pi / 2 + 0.2, abs=0.04)
        with pytest.raises(MotionError, match=r"not there after 0\.2 s"):
            robot.drive(3.0, timeout_s=0.2)


class Nonsense(Exception):  # noqa: N818  # the error of a program
    """Something that a program raises."""


@pytest.mark.parametrize("error", [Nonsense, KeyboardInterrupt, SystemExit, GeneratorExit])
def test_the_robot_is_stopped_whatever_ends_the_block(served: ServedRobot, error: type[BaseException]) -> None:
    recorder = Recorder()
    with pytest.raises(error), robot_on(served, recorder) as robot:  # noqa: PT012  # the block is what is left
        robot.set_velocity(0.3)
        until(lambda: served.is_moving)
        raise error
    assert recorder.sent[-4:] == CLOSING_COMMANDS
    until(lambda: not served.is_moving and not served.pioneer.state.motors_enabled)


@pytest.mark.parametrize("what", ["drive", "sleep", "connect"])
def test_ctrl_c_ends_any_wait_and_stops_the_robot(served: ServedRobot, what: str) -> None:
    recorder = Recorder()
    settings = ClientSettings(listen_ns=10**12) if what == "connect" else QUICK
    robot = robot_on(served, recorder, settings)
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012  # the whole block is what is interrupted
        threading.Thread(target=_interrupt_when_waiting, args=(robot, served, what)).start()
        with robot:
            robot.set_velocity(0.2)
            robot.drive(5.0) if what == "drive" else robot.sleep(60)
    assert robot.link is Link.CLOSED
    if what != "connect":
        assert recorder.sent[-4:] == CLOSING_COMMANDS
    until(lambda: not served.is_moving and not served.pioneer.state.open)


def _interrupt_when_waiting(robot: Robot, served: ServedRobot, what: str) -> None:
    if what == "connect":
        until(lambda: robot._runner.core.link is Link.SEARCHING)
    else:
        until(lambda: served.is_moving)  # by 0.2 m/s that it was asked for, just before the wait began
        time.sleep(0.1)
    _thread.interrupt_main()


def test_a_program_that_forgets_the_robot_leaves_it_standing(served: ServedRobot) -> None:
    robot = robot_on(served).connect()
    robot.set_velocity(0.3)
    until(lambda: served.is_moving)
    del robot
    until(lambda: not served.is_moving and not served.pioneer.state.open)


def test_an_error_in_a_callback_stops_the_robot_and_reaches_the_program(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)
    with robot_on(fast, recorder) as robot:
        robot.set_velocity(0.3)
        fast.until(lambda: fast.is_moving)
        robot.on_state(lambda _: 1 // 0)  # type: ignore[arg-type,return-value]
        with pytest.raises(P2osError, match=r"the client's thread failed: .*division"):
            robot.sleep(60)
        assert stop() in recorder.sent
        fast.until(lambda: not fast.is_moving)
        with pytest.raises(P2osError, match="thread failed"):
            robot.set_velocity(0.3)
    with pytest.raises(P2osError, match="thread failed"), robot_on(fast) as robot:  # noqa: PT012  # its end raises
        robot.on_state(lambda _: 1 // 0)  # type: ignore[arg-type,return-value]
        fast.until(lambda: robot._runner._failure is not None)


def test_a_program_that_hangs_is_stopped_by_the_deadman(served: ServedRobot) -> None:
    settings = ClientSettings(listen_ns=NS_PER_MS, deadman_ns=300 * NS_PER_MS)
    with robot_on(served, settings=settings) as robot:
        received: list[Notice] = []
        robot.on_event(received.append)
        robot.set_velocity(0.3)
        until(lambda: served.is_moving)
        until(lambda: not served.is_moving)
        assert [type(notice) for notice in received] == [DeadmanStopped]


@pytest.mark.parametrize("deadman_ms", [1000, 2000])
def test_the_deadman_waits_as_long_as_it_was_told_and_not_for_a_program_that_sleeps(
    fast: ServedRobot, deadman_ms: int
) -> None:
    settings = ClientSettings(listen_ns=NS_PER_MS, deadman_ns=deadman_ms * NS_PER_MS)
    recorder = Recorder(fast.open)
    with robot_on(fast, recorder, settings) as robot:
        received: list[Notice] = []
        robot.on_event(received.append)
        asked_ns = fast.clock()
        robot.set_velocity(0.3)
        fast.virtual.sleep(deadman_ms / 1000 - 0.001)
        assert received == []
        assert stop() not in recorder.sent
        fast.virtual.sleep(0.002)
        assert [type(notice) for notice in received] == [DeadmanStopped]
        assert recorder.sent[-1] == stop()
        fast.until(lambda: not fast.is_moving)
        assert fast.clock() - asked_ns < (deadman_ms + 2000) * NS_PER_MS
        robot.set_velocity(0.2)
        robot.sleep(deadman_ms / 1000 + 1.5)
        assert fast.wheels_mps == (0.2, 0.2), "a program that waits in sleep() is known to live"
        assert [type(notice) for notice in received] == [DeadmanStopped]


def test_no_line_is_an_error_with_a_hint() -> None:
    with (
        pytest.raises(ConnectError, match="cannot open /dev/ttyNOWHERE: no such port") as caught,
        Robot("serial:/dev/ttyNOWHERE"),
    ):
        pass
    assert caught.value.hint
    with pytest.raises(ParametersError):
        Robot("tcp:127.0.0.1:1", model="nobody")
    with pytest.raises(UsageError):
        Robot("nonsense:")


@pytest.mark.parametrize("robot", [Robot, aio.Robot])
def test_what_is_no_text_names_no_robot(robot: Callable[[Any], object]) -> None:
    for wrong, hint in ((3, "use serial:"), (None, "use serial:"), (Path("/dev/ttyUSB0"), "'serial:/dev/ttyUSB0'?")):
        with pytest.raises(UsageError, match="is no text with a port URL") as caught:
            robot(wrong)
        assert hint in str(caught.value.hint)


def test_before_the_first_packet_nothing_is_known(fast: ServedRobot) -> None:
    robot = robot_on(fast)
    with pytest.raises(LinkLostError, match="has not sent a packet yet"):
        _ = robot.state
    with pytest.raises(LinkLostError, match="has not sent its identity yet"):
        _ = robot.identity
    with pytest.raises(LinkLostError, match="no robot is connected"):
        robot.set_velocity(0.1)
    assert robot.config is None
    robot.close()


def test_a_loss_ends_a_drive_and_the_robot_is_there_again(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)
    with robot_on(fast, recorder) as robot:
        robot.on_state(lambda _: setattr(recorder.lines[0], "is_broken", fast.is_moving))
        with pytest.raises(LinkLostError, match="the link was lost"):
            robot.drive(5.0)
        with pytest.raises(LinkLostError, match="no packet comes"):
            robot.next_state(timeout_s=0.0)
        robot.wait_open(timeout_s=30)
        assert recorder.lines[1].written.startswith(stop().to_frame().to_bytes() + vel(0).to_frame().to_bytes())
        with pytest.raises(LinkLostError, match="the link was lost and is back"):
            robot.set_velocity(0.3)
        assert not fast.is_moving
        robot.set_velocity(0.3)
        fast.until(lambda: fast.is_moving)


@pytest.mark.parametrize("call", ["read", "write"])
def test_a_call_that_fails_once_on_a_line_that_carries_stops_the_robot(fast: ServedRobot, call: str) -> None:
    recorder = Recorder(fast.open)
    with robot_on(fast, recorder, ClientSettings(listen_ns=NS_PER_MS, reconnect=False)) as robot:
        robot.set_velocity(0.3)
        fast.until(lambda: fast.is_moving)
        line = recorder.lines[0]

        def fail(*_: bytes) -> bytes:
            delattr(line, call)
            raise HungUpError("connection timed out")

        setattr(line, call, fail)
        with pytest.raises(LinkLostError):
            _next_states(robot)
        assert recorder.sent[-4:] == CLOSING_COMMANDS
        fast.until(lambda: not fast.is_moving)


def test_a_half_open_peer_is_noticed_by_its_silence(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)
    with robot_on(fast, recorder) as robot:
        notices = robot.events()
        recorder.lines[0].is_mute = True
        lost = next(notice for notice in notices if isinstance(notice, LinkLost))
        assert lost.reason == "no packet for 1000 ms"
        robot.wait_open(timeout_s=30)
        assert len(recorder.lines) == 2


def test_without_reconnect_waiting_for_the_session_ends(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)
    settings = ClientSettings(listen_ns=NS_PER_MS, reconnect=False)
    with robot_on(fast, recorder, settings) as robot:
        recorder.lines[0].is_broken = True
        with pytest.raises(LinkLostError):
            _next_states(robot)
        with pytest.raises(LinkLostError):
            robot.wait_open()


def _next_states(robot: Robot) -> None:
    while True:
        robot.next_state()


def test_packets_are_fetched_by_their_type(fast: ServedRobot) -> None:
    with robot_on(fast) as robot:
        assert robot.newest(RawPacket) is None
        with pytest.raises(UsageError, match="nothing asks for a StandardSip"):
            robot.fetch(StandardSip)
        assert robot.fetch(EncoderPacket, timeout_s=30).right_counts == 0
        assert robot.newest(EncoderPacket) is not None


def test_a_request_that_nothing_answers_says_so(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)
    with robot_on(fast, recorder) as robot:
        recorder.lines[0].is_mute = True
        with pytest.raises(P2osError, match=r"no IoPacket within 0\.1 s"):
            robot.fetch(IoPacket, timeout_s=0.1)


def test_the_robots_own_serial_port_is_a_file(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)
    with robot_on(fast, recorder) as robot, robot.aux() as port:
        assert port.readable()
        assert port.writable()
        assert port.write(b"x" * 200) == 200
        fast.until(lambda: [c.number for c in recorder.sent].count(CommandNumber.TTY2) == 2)
        fast.do_in_thread(lambda pioneer, now: pioneer._connection.send(SerauxPacket(data=b"hello "), now))
        threading.Timer(
            0.1,
            fast.do_in_thread,
            (lambda pioneer, now: pioneer._connection.send(SerauxPacket(data=b"world"), now),),
        ).start()
        port.timeout_s = None
        assert port.read(8) == b"hello wo"
        assert Command(CommandNumber.GETAUX, 8) in recorder.sent or Command(CommandNumber.GETAUX, 2) in recorder.sent
        buffer = bytearray(2)
        assert port.readinto(memoryview(buffer)) == 2
        assert buffer == b"rl"
        assert port.read() == b"d"
        port.timeout_s = 0.05
        port.flush_input()
        fast.until(lambda: Command(CommandNumber.GETAUX, 0) in recorder.sent)
    with pytest.raises(UsageError, match="no AUX port 4"):
        robot.aux(4)
