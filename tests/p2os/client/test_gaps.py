"""Gaps in a client's time: the machine slept, or the program was held up. STOP first, then read, then judge."""

import asyncio
import threading
import time
from collections.abc import Callable

import pytest

from p2os import Robot
from p2os.client import GapStopped, Link, LinkLost, LinkLostError, MotionError, Notice, ReconnectPlanned
from p2os.client.aio import Robot as AsyncRobot
from p2os.client.core import RobotCore
from p2os.client.goals import DriveAxis
from p2os.client.line import Line
from p2os.protocol.commands import Command, CommandNumber, stop, vel
from p2os.protocol.frames import Decoder, Frame
from p2os.transport.ports import HungUpError
from p2os.transport.virtual_clock import VirtualClock
from p2os.transport.wall_clock import GAP_NS
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from tests.p2os.client.client_rig import free_pioneer
from tests.p2os.client.served_robot import QUICK, TIMEOUT_S, Recorder, ServedRobot


class SuspendingClock:
    """The clock of a client whose machine sleeps now and then, while its robot's goes on."""

    def __init__(self, clock: VirtualClock) -> None:
        self._clock = clock
        self._slept: Nanos = 0
        self.wait_readable, self.wait_for_change = clock.wait_readable, clock.wait_for_change
        self.look, self.add = clock.look, clock.add

    def __call__(self) -> Nanos:
        return self._clock() + self._slept

    def suspend(self, seconds: float) -> None:
        self._slept += round(seconds * NS_PER_S)


class Bench:
    """A client's line and a virtual robot, in memory and in virtual time."""

    description = "in memory"

    def __init__(self) -> None:
        self.clock_ns: Nanos = 5 * NS_PER_S
        self.pioneer = free_pioneer()
        self.core = RobotCore(QUICK)
        self.sent: list[Command] = []
        self.notices: list[Notice] = []
        self.is_gone = False
        self._decoder = Decoder()
        self._arrived = b""
        self._robot_ns: Nanos = 0
        self.line = Line(self.core, None, lambda: self.clock_ns)
        self.core.connect(self.line.now())
        self.run(2.0)
        assert self.core.link is Link.OPEN

    # A transport ----------------------------------------------------------------------

    def read(self) -> bytes:
        if self.is_gone:
            raise HungUpError("gone")
        data, self._arrived = self._arrived, b""
        return data

    def write(self, data: bytes) -> None:
        self._decoder.receive(data, 0)
        while isinstance(item := self._decoder.next_item(), Frame):
            self.sent.append(Command.from_frame(item))
        self.pioneer.receive(data, self._robot_ns)

    def fileno(self) -> int:
        raise AssertionError

    def set_baud(self, baud: int) -> None: ...

    def close(self) -> None: ...

    # Time -----------------------------------------------------------------------------

    def pass_by(self, span_ns: Nanos, *, robot_lives: bool = True) -> None:
        """Let time pass without the client."""
        self.clock_ns += span_ns
        if robot_lives:
            self._robot_ns += span_ns
            self.pioneer.advance_to(self._robot_ns)
            self._arrived += b"".join(self.pioneer.take_output())

    def turn(self) -> None:
        self.line.turn()
        if self.line.is_wanted:
            self.line.opened(self)
        self.notices += [item for item in self.core.news if not hasattr(item, "sip")]
        self.core.news.clear()

    def run(self, seconds: float) -> None:
        end = self.clock_ns + round(seconds * NS_PER_S)
        while self.clock_ns < end:
            self.turn()
            wait_ns = round(self.line.wait_s() * NS_PER_S)
            self.pass_by(max(1, min(wait_ns, 10 * NS_PER_MS, end - self.clock_ns)))
        self.turn()
        self.core.touch(self.line.now())

    def drive(self) -> None:
        self.core.set_velocity(0.3, 0.0, self.line.now())
        self.run(0.5)
        assert self.wheels[0] > 0
        self.sent.clear()
        self.notices.clear()

    @property
    def wheels(self) -> tuple[float, float]:
        return self.pioneer.state.left_setpoint_mps, self.pioneer.state.right_setpoint_mps

    def late_by(self, gap_ns: Nanos, *, robot_lives: bool = True) -> None:
        """End a wait so long after its deadline."""
        self.turn()
        wait_ns = round(self.line.wait_s() * NS_PER_S)
        self.sent.clear()
        self.pass_by(wait_ns + gap_ns, robot_lives=robot_lives)


@pytest.mark.parametrize(("gap_ns", "stops"), [(GAP_NS - 1, False), (GAP_NS, False), (GAP_NS + 1, True)])
def test_a_wait_that_ends_350_ms_late_is_not_yet_a_gap(gap_ns: Nanos, stops: bool) -> None:
    bench = Bench()
    bench.drive()
    bench.late_by(gap_ns)
    bench.turn()
    assert (bench.sent[0] == stop()) is stops
    assert bench.core.commanded.are_zero is stops
    assert bench.core.link is Link.OPEN


@pytest.mark.parametrize("gap_ms", [400, 1000, 1100, 3000, 60_000])
def test_after_a_gap_in_which_packets_came_the_robot_stands_and_the_link_lives(gap_ms: int) -> None:
    bench = Bench()
    bench.drive()
    bench.late_by(gap_ms * NS_PER_MS)
    bench.turn()
    assert bench.sent[0] == stop()
    assert [type(notice) for notice in bench.notices] == [GapStopped]
    bench.run(3.0)
    assert bench.core.link is Link.OPEN
    assert bench.wheels == (0.0, 0.0)
    assert vel(300) not in bench.sent
    bench.core.set_velocity(0.2, 0.0, bench.line.now())
    bench.run(0.5)
    assert bench.wheels[0] > 0, "asked anew it moves"


@pytest.mark.parametrize("gap_ms", [400, 1100, 60_000])
def test_a_program_that_is_stopped_within_a_read_has_heard_what_that_read_brings(gap_ms: int) -> None:
    bench = Bench()
    bench.drive()
    read = bench.read

    def stopped() -> bytes:
        bench.read = read  # type: ignore[method-assign]  # once
        bench.pass_by(gap_ms * NS_PER_MS)
        return read()

    bench.late_by(0)
    bench.read = stopped  # type: ignore[method-assign]
    bench.turn()
    bench.turn()
    assert bench.sent[0] == stop()
    assert [type(notice) for notice in bench.notices] == [GapStopped]
    bench.run(3.0)
    assert bench.core.link is Link.OPEN
    assert bench.wheels == (0.0, 0.0)


def test_a_gap_in_which_nothing_came_is_silence_and_loses_the_link() -> None:
    bench = Bench()
    bench.drive()
    bench.late_by(1100 * NS_PER_MS, robot_lives=False)
    bench.turn()
    assert bench.sent[0] == stop()
    assert [type(notice) for notice in bench.notices][:2] == [GapStopped, LinkLost]
    assert bench.core.link is Link.WAITING
    with pytest.raises(LinkLostError):
        bench.core.set_velocity(0.3, 0.0, bench.line.now())


def test_a_short_gap_without_a_packet_is_not_a_loss() -> None:
    bench = Bench()
    bench.drive()
    bench.late_by(400 * NS_PER_MS, robot_lives=False)
    bench.turn()
    assert bench.core.link is Link.OPEN
    assert bench.sent[0] == stop()


def test_a_line_that_went_in_a_gap_is_lost_and_nothing_raises() -> None:
    bench = Bench()
    bench.drive()
    bench.late_by(5 * NS_PER_S)
    bench.is_gone = True
    bench.turn()
    assert bench.sent[0] == stop()
    assert isinstance(bench.notices[-1], ReconnectPlanned)
    assert bench.core.link is not Link.OPEN


def test_a_call_after_a_gap_stops_the_robot_before_it_does_anything() -> None:
    bench = Bench()
    bench.drive()
    bench.late_by(2 * NS_PER_S)
    bench.core.set_velocity(0.2, 0.0, bench.line.now())
    bench.turn()
    assert bench.sent[0] == stop()
    assert vel(300) not in bench.sent


def test_a_call_after_a_gap_of_silence_is_refused_at_once() -> None:
    bench = Bench()
    bench.drive()
    bench.late_by(2 * NS_PER_S, robot_lives=False)
    now = bench.line.now()
    with pytest.raises(LinkLostError):
        bench.core.set_velocity(0.2, 0.0, now)


def test_stop_overtakes_what_has_waited_in_a_gap() -> None:
    bench = Bench()
    bench.drive()
    for _ in range(5):
        bench.core.send(Command(CommandNumber.DIGOUT, 0xFF01), bench.line.now())
    bench.late_by(2 * NS_PER_S)
    bench.turn()
    bench.run(0.2)
    assert bench.sent[0] == stop()
    assert Command(CommandNumber.DIGOUT, 0xFF01) in bench.sent


def test_a_machine_that_sleeps_in_the_middle_of_a_turn_sends_nothing_old() -> None:
    bench = Bench()
    bench.drive()
    bench.core.set_velocity(0.4, 0.0, bench.line.now())
    slept: list[Nanos] = []
    advance = bench.core.advance_to

    def sleep_then(limit: Nanos) -> object:
        reached = advance(limit)
        if not slept:
            slept.append(limit)
            bench.pass_by(2 * NS_PER_S)
        return reached

    bench.core.advance_to = sleep_then  # type: ignore[method-assign,assignment]  # between the look and the writing
    bench.turn()
    assert slept
    assert bench.sent == []
    bench.line.wait_s()
    bench.turn()
    assert bench.sent[0] == stop()
    assert vel(400) not in bench.sent


def test_a_gap_ends_a_drive() -> None:
    bench = Bench()
    goal = bench.core.begin_goal(DriveAxis(4.0), None, None, bench.line.now())
    bench.run(0.5)
    assert bench.wheels[0] > 0
    bench.late_by(2 * NS_PER_S)
    bench.turn()
    assert bench.sent[0] == stop()
    assert goal.ended is not None
    assert goal.ended.problem == "the program or its machine paused for 2.0 s"
    bench.run(3.0)
    assert bench.wheels == (0.0, 0.0)


def test_a_gap_of_a_robot_that_stands_is_told_to_nobody() -> None:
    bench = Bench()
    bench.notices.clear()
    bench.late_by(2 * NS_PER_S)
    bench.turn()
    assert bench.sent[0] == stop()
    assert bench.notices == []


def test_a_gap_while_the_robot_is_looked_for_does_not_use_the_search_up() -> None:
    bench = Bench()
    core = RobotCore(QUICK)
    clock = [NS_PER_S]
    line = Line(core, None, lambda: clock[0])
    core.connect(line.now())
    line.turn()
    line.opened(bench)
    line.turn()
    line.wait_s()
    clock[0] += 3600 * NS_PER_S
    line.turn()
    assert core.link is Link.SEARCHING


# Robots that are served, with the injected clock under every wait ------------------------------


@pytest.mark.parametrize("what", ["hold", "drive"])
def test_a_blocking_robot_whose_machine_slept_stops_first_and_never_drives_on(fast: ServedRobot, what: str) -> None:
    clock, recorder, reported = SuspendingClock(fast.virtual), Recorder(fast.open), list[Notice]()
    with Robot(fast.url, settings=QUICK, opener=recorder, clock=clock) as robot:
        robot.on_event(reported.append)
        sent: list[int] = []

        def fall_asleep(_: object) -> None:
            """Let the machine sleep in the thread that turns the line: nothing is written meanwhile."""
            if fast.pioneer.state.left_setpoint_mps > 0.1 and not sent:
                sent.append(len(recorder.sent))
                clock.suspend(5.0)

        robot.on_state(fall_asleep)
        if what == "hold":
            robot.set_velocity(0.3)
            robot.sleep(2.0)
        else:
            with pytest.raises((MotionError, LinkLostError), match="paused for"):
                robot.drive(5.0)
        assert recorder.sent[sent[0]] == stop()
        assert vel(300) not in recorder.sent[sent[0] :]
        fast.until(lambda: not fast.is_moving)
        assert any(isinstance(notice, GapStopped) for notice in reported)


def test_an_asyncio_robot_whose_machine_slept_stops_first_and_never_drives_on(fast: ServedRobot) -> None:
    clock, recorder, reported = SuspendingClock(fast.virtual), Recorder(fast.open), list[Notice]()

    async def story() -> None:
        async with AsyncRobot(fast.url, settings=QUICK, opener=recorder, clock=clock) as robot:
            robot.on_event(reported.append)
            robot.set_velocity(0.3)
            while not fast.is_moving:  # noqa: ASYNC110  # it moves in another thread
                await asyncio.sleep(0.005)
            sent = len(recorder.sent)
            clock.suspend(5.0)
            await asyncio.sleep(0.5)
            assert recorder.sent[sent] == stop()
            assert vel(300) not in recorder.sent[sent:]
            while fast.is_moving:  # noqa: ASYNC110  # it stops in another thread
                await asyncio.sleep(0.005)

    with asyncio.Runner(loop_factory=fast.virtual.event_loop) as runner:
        runner.run(story())
    assert isinstance(reported[0], GapStopped)


async def soon(is_so: Callable[[], object]) -> None:
    """Let the loop work until something is so, some of which another thread does."""
    async with asyncio.timeout(TIMEOUT_S):
        while not is_so():  # noqa: ASYNC110
            await asyncio.sleep(0.005)


async def block_the_loop(robot: ServedRobot, block: Callable[[float], None], pause_s: float) -> None:
    """Drive a robot by a program that does nothing for its loop for so long."""
    recorder, reported = Recorder(robot.open), list[Notice]()
    async with AsyncRobot(robot.url, settings=QUICK, opener=recorder, clock=robot.clock) as client:
        client.on_event(reported.append)
        client.set_velocity(0.1)
        await soon(lambda: robot.is_moving)
        sent = len(recorder.sent)
        block(pause_s)
        await soon(lambda: reported)
        assert client.link is Link.OPEN
        assert recorder.sent[sent] == stop()
        robot.until(lambda: not robot.is_moving)
    assert [type(notice) for notice in reported] == [GapStopped]


def test_an_asyncio_program_that_blocks_its_loop_keeps_a_sound_link_and_stops(served: ServedRobot) -> None:
    asyncio.run(block_the_loop(served, time.sleep, 0.7))


@pytest.mark.parametrize("pause_s", [0.7, 1.2, 2.5, 20.0])
def test_however_long_an_asyncio_program_blocks_its_loop_the_link_is_sound(fast: ServedRobot, pause_s: float) -> None:
    with asyncio.Runner(loop_factory=fast.virtual.event_loop) as runner:
        runner.run(block_the_loop(fast, fast.virtual.sleep, pause_s))


def block_a_callback(robot: ServedRobot, block: Callable[[float], None], pause_s: float) -> None:
    """Drive a robot by a program whose callback takes so long."""
    reported, blocked = list[Notice](), threading.Event()

    def block_once(_: object) -> None:
        if not blocked.is_set():
            blocked.set()
            block(pause_s)

    with Robot(robot.url, settings=QUICK, opener=Recorder(robot.open), clock=robot.clock) as client:
        client.on_event(reported.append)
        client.set_velocity(0.1)
        robot.until(lambda: robot.is_moving)
        client.on_state(block_once)
        robot.until(lambda: any(isinstance(notice, GapStopped) for notice in reported))
        assert client.link is Link.OPEN
        robot.until(lambda: not robot.is_moving)


def test_a_callback_that_blocks_keeps_a_sound_link_and_stops(served: ServedRobot) -> None:
    block_a_callback(served, time.sleep, 0.7)


@pytest.mark.parametrize("pause_s", [0.7, 1.3, 20.0])
def test_however_long_a_callback_blocks_the_link_is_sound(fast: ServedRobot, pause_s: float) -> None:
    block_a_callback(fast, fast.virtual.sleep, pause_s)
