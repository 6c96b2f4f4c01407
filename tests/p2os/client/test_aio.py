"""The asyncio `Robot` on a real line: the same calls, cancellation, and every way out of its block."""

import asyncio
import math
from collections.abc import Coroutine
from typing import Any

import pytest

from p2os.client import ClientSettings, ConnectError, Link, LinkLostError, MotionEnded, MotionError, Notice, RobotState
from p2os.client.aio import Robot
from p2os.protocol.commands import Command, CommandNumber, stop, vel
from p2os.protocol.packets import EncoderPacket, IoPacket, SerauxPacket
from simbase.errors import P2osError
from simbase.timing import NS_PER_MS
from tests.p2os.client.served_robot import CLOSING_COMMANDS, QUICK, TIMEOUT_S, Recorder, ServedRobot, until


def robot_on(served: ServedRobot, recorder: Recorder | None = None, settings: ClientSettings = QUICK) -> Robot:
    return Robot(served.url, settings=settings, opener=recorder or Recorder(served.open), clock=served.clock)


def run(story: Coroutine[Any, Any, None], fast: ServedRobot | None = None) -> None:
    """Run a test's story, bounded, on the clock of a robot where it has a virtual one."""

    async def bounded() -> None:
        await asyncio.wait_for(story, TIMEOUT_S)

    with asyncio.Runner(loop_factory=None if fast is None else fast.virtual.event_loop) as runner:
        runner.run(bounded())


async def next_states(robot: Robot) -> None:
    while True:
        await robot.next_state()


async def moving(served: ServedRobot) -> None:
    while not served.is_moving:  # noqa: ASYNC110  # it moves in another thread
        await asyncio.sleep(0.005)


def test_a_block_opens_a_session_moves_and_ends_it(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)

    async def story() -> None:
        async with robot_on(fast, recorder) as robot:
            assert robot.identity.subclass == "p2dx"
            first = await robot.next_state()
            assert (await robot.next_state()).number > first.number
            assert (await robot.drive(0.05)).reached == pytest.approx(0.05, abs=0.016)
            robot.set_pose(0.0, 0.0, 1.0)
            await robot.turn_to(1.15)
            assert robot.pose.heading_rad == pytest.approx(1.15, abs=0.04)
            with pytest.raises(MotionError, match=r"not there after 0\.1 s"):
                await robot.turn(3.0, timeout_s=0.1)
        await robot.close()
        assert robot.link is Link.CLOSED

    run(story(), fast)
    assert recorder.sent[-4:] == CLOSING_COMMANDS
    fast.until(lambda: not fast.pioneer.state.open)


def test_states_and_events_come_by_iteration_and_by_callback(fast: ServedRobot) -> None:
    async def story() -> None:
        received: list[RobotState] = []
        notices: list[Notice] = []
        async with robot_on(fast) as robot:
            end_states, end_events = robot.on_state(received.append), robot.on_event(notices.append)
            numbers = []
            async for state in robot.states():
                numbers.append(state.number)
                if len(numbers) == 3:
                    break
            assert numbers == sorted(set(numbers))
            events = robot.events()
            waiting = asyncio.ensure_future(anext(events))
            await asyncio.sleep(0)
            await robot.drive(0.0)
            assert isinstance(await waiting, MotionEnded)
            await events.aclose()  # type: ignore[attr-defined]  # a generator
            assert received
            assert notices
            for end in (end_states, end_events, end_states):
                end()
            states = robot.states()
            await anext(states)
            await robot.close()
            assert [state async for state in states] == []
            assert [event async for event in robot.events()] == []

    run(story(), fast)


@pytest.mark.parametrize("error", [ZeroDivisionError, KeyboardInterrupt, SystemExit])
def test_the_robot_is_stopped_whatever_ends_the_block(served: ServedRobot, error: type[BaseException]) -> None:
    recorder = Recorder()

    async def story() -> None:
        async with robot_on(served, recorder) as robot:
            robot.set_velocity(0.3)
            await moving(served)
            raise error

    with pytest.raises(error):
        asyncio.run(story())
    assert recorder.sent[-4:] == CLOSING_COMMANDS
    until(lambda: not served.is_moving and not served.pioneer.state.motors_enabled)


def test_a_task_that_is_cancelled_in_a_drive_stops_the_robot_and_the_block_goes_on(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)

    async def story() -> None:
        async with robot_on(fast, recorder) as robot:
            driving = asyncio.ensure_future(robot.drive(5.0))
            await moving(fast)
            driving.cancel()
            with pytest.raises(asyncio.CancelledError):
                await driving
            while fast.is_moving:  # it stops in another thread
                await robot.sleep(0.01)
            assert stop() in recorder.sent
            assert robot.link is Link.OPEN

    run(story(), fast)


def test_a_cancellation_that_comes_together_with_a_packet_is_not_lost(fast: ServedRobot) -> None:
    async def story() -> None:
        async with robot_on(fast) as robot:
            driving = asyncio.ensure_future(robot.drive(5.0))
            await robot.next_state()
            loop = asyncio.get_running_loop()
            robot.on_state(lambda _: loop.call_soon(driving.cancel))  # type: ignore[arg-type,return-value]  # as it wakes
            with pytest.raises(asyncio.CancelledError):
                await driving
            assert robot.link is Link.OPEN

    run(story(), fast)


@pytest.mark.parametrize("times", [1, 2], ids=["once", "again while it closes"])
def test_a_program_that_is_cancelled_stops_the_robot_and_says_close(served: ServedRobot, times: int) -> None:
    recorder = Recorder()

    async def program() -> None:
        async with robot_on(served, recorder) as robot:
            robot.set_velocity(0.3)
            await robot.sleep(3600)

    async def story() -> None:
        task = asyncio.ensure_future(program())
        await moving(served)
        for _ in range(times):
            task.cancel()
            await asyncio.sleep(0)
        with pytest.raises(asyncio.CancelledError):
            await task

    run(story())
    assert recorder.sent[-4:] == CLOSING_COMMANDS
    until(lambda: not served.is_moving)


def test_an_error_in_a_callback_stops_the_robot_and_reaches_the_program(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)

    async def story() -> None:
        async with robot_on(fast, recorder) as robot:
            robot.set_velocity(0.3)
            await moving(fast)
            robot.on_state(lambda _: 1 // 0)  # type: ignore[arg-type,return-value]
            with pytest.raises(P2osError, match=r"the client failed: .*division"):
                await robot.sleep(60)
            with pytest.raises(P2osError, match="the client failed"):
                robot.set_velocity(0.3)

    run(story(), fast)
    assert recorder.sent[-4:] == CLOSING_COMMANDS
    fast.until(lambda: not fast.is_moving)


def test_no_line_and_no_robot_are_errors_with_hints() -> None:
    async def story() -> None:
        with pytest.raises(ConnectError, match="no such port") as caught:
            async with Robot("serial:/dev/ttyNOWHERE"):
                pass
        assert caught.value.hint

    run(story())


def test_a_loss_ends_a_drive_and_the_robot_is_there_again(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)

    async def story() -> None:
        async with robot_on(fast, recorder) as robot:
            asyncio.get_running_loop().call_later(0.5, lambda: setattr(recorder.lines[0], "is_mute", True))
            with pytest.raises(LinkLostError, match="the link was lost"):
                await robot.drive(5.0)
            with pytest.raises(LinkLostError):
                await robot.next_state(timeout_s=0.0)
            await robot.wait_open()
            assert recorder.lines[1].written.startswith(stop().to_frame().to_bytes() + vel(0).to_frame().to_bytes())
            with pytest.raises(LinkLostError, match="the link was lost and is back"):
                robot.set_velocity(0.3)
            assert not fast.is_moving

    run(story(), fast)


def test_without_reconnect_waiting_for_the_session_ends(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)

    async def story() -> None:
        async with robot_on(fast, recorder, ClientSettings(listen_ns=NS_PER_MS, reconnect=False)) as robot:
            recorder.lines[0].is_mute = True
            with pytest.raises(LinkLostError):
                await next_states(robot)
            with pytest.raises(LinkLostError):
                await robot.wait_open()

    run(story(), fast)


def test_packets_are_fetched_and_the_robots_own_port_is_a_file(fast: ServedRobot) -> None:
    recorder = Recorder(fast.open)

    async def story() -> None:
        async with robot_on(fast, recorder) as robot:
            asking = asyncio.ensure_future(robot.fetch(EncoderPacket, timeout_s=TIMEOUT_S))
            await asyncio.sleep(0.01)
            fast.do_in_thread(
                lambda pioneer, now: pioneer._connection.send(EncoderPacket(left_counts=1, right_counts=2), now)
            )
            assert isinstance(await asking, EncoderPacket)
            port = robot.aux()
            assert await port.write(b"x" * 200) == 200
            fast.do_in_thread(lambda pioneer, now: pioneer._connection.send(SerauxPacket(data=b"hello world"), now))
            port.timeout_s = None
            assert await port.read(8) == b"hello wo"
            assert await port.read(3) == b"rld"
            assert await port.read() == b""
            port.timeout_s = 0.05
            await port.flush_input()
            recorder.lines[0].is_mute = True
            assert await port.read(4) == b""
            port.close()
            with pytest.raises(P2osError, match=r"no IoPacket within 0\.1 s"):
                await robot.fetch(IoPacket, timeout_s=0.1)
        assert [command.number for command in recorder.sent].count(CommandNumber.TTY2) == 2
        assert Command(CommandNumber.GETAUX, 0) in recorder.sent

    run(story(), fast)


def test_a_robot_that_is_closed_while_its_line_is_being_opened_gives_the_line_back(served: ServedRobot) -> None:
    recorder = Recorder()

    async def story() -> None:
        task = asyncio.ensure_future(robot_on(served, recorder).connect())
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    run(story())
    until(lambda: all(line.inner.fileno() < 0 for line in recorder.lines))
    assert math.isclose(sum(map(len, (line.written for line in recorder.lines))), 0)


@pytest.mark.parametrize("lasts_s", [0.35, 0.0])
def test_states_that_last_a_time_come_so_long_and_end(fast: ServedRobot, lasts_s: float) -> None:
    async def story() -> None:
        async with robot_on(fast) as robot:
            assert robot.url == fast.url
            numbers = [state.number async for state in robot.states(lasts_s=lasts_s)]
            assert (1 <= len(numbers) <= 5) if lasts_s else numbers == []
            assert numbers == sorted(set(numbers))

    run(story(), fast)
