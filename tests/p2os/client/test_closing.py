"""Whatever ends a client, and however often it is interrupted: STOP, VEL 0, ENABLE 0 and CLOSE go out."""

import asyncio
import contextlib
import gc
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any, Self

import pytest

import p2os
from p2os import Robot
from p2os.client import ConnectError, LinkLostError
from p2os.client.aio import Robot as AsyncRobot
from p2os.protocol.commands import vel
from p2os.transport import open_url, virtual_clock
from p2os.transport.ports import Transport
from simbase.interrupts import held_back
from simbase.timing import NS_PER_MS
from tests.p2os.client.served_robot import CLOSING_COMMANDS, QUICK, Recorder, ServedRobot, until
from tests.tools.forked_python import forked_python

OURS = str(Path(p2os.__file__).parent)
#: Waits in place of Python's own, and is no more to be interrupted than those are.
WAITING = virtual_clock.__file__


def was_stopped(recorder: Recorder) -> bool:
    """Tell whether STOP, VEL 0, ENABLE 0 and CLOSE were sent, in this order, after the last speed."""
    sent = recorder.sent
    last_speed = max((place for place, command in enumerate(sent) if command == vel(300)), default=-1)
    left = iter(sent[last_speed + 1 :])
    return all(word in left for word in CLOSING_COMMANDS)


class Interrupter:
    """Raises KeyboardInterrupt at the n-th line that the program's own thread runs in some files."""

    def __init__(self, place: int, files: tuple[str, ...]) -> None:
        self.place, self.files = place, files
        self.lines = 0
        self.at = ""

    def __enter__(self) -> Self:
        sys.settrace(self._trace)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)

    def _trace(self, frame: FrameType, event: str, _: object) -> Any:
        if not frame.f_code.co_filename.startswith(self.files) or frame.f_code.co_filename == WAITING:
            return None
        if event == "line" and frame.f_lineno:  # 0: a probe that counts branches
            self.lines += 1
            if self.lines == self.place:
                self.at = f"{frame.f_code.co_filename}:{frame.f_lineno}"
                raise KeyboardInterrupt
        return self._trace


def interrupt_everywhere(story: Callable[[int], tuple[int, str, Recorder]], served: ServedRobot, step: int = 1) -> int:
    """Run a story with an interrupt at its first line, at its second and so on, until it has no more; count them."""
    gc.collect()
    gc.freeze()  # what other tests have left is not searched after each story
    place = step
    while True:
        lines, at, recorder = story(place)
        gc.collect()
        served.until(lambda recorder=recorder: was_stopped(recorder), f"the last words after an interrupt at {at}")  # type: ignore[misc]
        served.until(lambda: not served.pioneer.state.open)
        if lines < place:
            return place - 1
        place += step


#: For many sessions with a robot of tests, whose commands may come as near as they like.
HASTY = replace(QUICK, open_delay_ns=NS_PER_MS, command_spacing_ns=NS_PER_MS)


@pytest.fixture
def hasty() -> Iterator[ServedRobot]:
    """A robot whose time runs eight times as fast, so that sessions open quickly."""
    robot = ServedRobot(speed=8.0)
    yield robot
    robot.close()


@pytest.mark.slow
def test_a_second_ctrl_c_at_any_line_of_closing_leaves_the_robot_told(hasty: ServedRobot) -> None:
    files = (OURS, threading.__file__)

    def story(place: int) -> tuple[int, str, Recorder]:
        recorder = Recorder()
        interrupter = Interrupter(place, files)
        robot = Robot(hasty.url, settings=HASTY, opener=recorder).connect()
        robot.set_velocity(0.3)
        until(lambda: vel(300) in recorder.sent)
        with contextlib.suppress(KeyboardInterrupt), interrupter:
            robot.close()
        return interrupter.lines, interrupter.at, recorder

    # 20 to 26 of them, by which of the two threads comes first; none at all would prove nothing.
    assert interrupt_everywhere(story, hasty) > 10


@pytest.mark.parametrize("step", [pytest.param(97, marks=pytest.mark.slow), pytest.param(1, marks=pytest.mark.soak)])
def test_a_second_ctrl_c_at_any_line_of_an_asyncio_closing_leaves_the_robot_told(hasty: ServedRobot, step: int) -> None:
    assert interrupt_an_asyncio_closing(hasty, step) > 100


@pytest.mark.slow
def test_a_second_ctrl_c_at_a_line_of_an_asyncio_closing_leaves_the_robot_told_in_any_time(fast: ServedRobot) -> None:
    assert interrupt_an_asyncio_closing(fast, 7) > 100


def interrupt_an_asyncio_closing(served: ServedRobot, step: int) -> int:
    loops = served.clock.event_loop if isinstance(served.clock, virtual_clock.VirtualClock) else None

    def story(place: int) -> tuple[int, str, Recorder]:
        recorder = Recorder(served.open)
        interrupter = Interrupter(place, (OURS,))

        async def main() -> None:
            robot = AsyncRobot(served.url, settings=HASTY, opener=recorder, clock=served.clock)
            await robot.connect()
            robot.set_velocity(0.3)
            with interrupter:
                await robot.close()

        with contextlib.suppress(KeyboardInterrupt), asyncio.Runner(loop_factory=loops) as runner:
            runner.run(main())
        return interrupter.lines, interrupter.at, recorder

    return interrupt_everywhere(story, served, step)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # one that hits a destructor is lost
def test_a_burst_of_interrupts_cannot_shorten_the_closing(served: ServedRobot) -> None:
    recorder = Recorder()
    robot = Robot(served.url, settings=QUICK, opener=recorder).connect()
    robot.set_velocity(0.3)
    until(lambda: served.is_moving)
    interrupts: list[str] = []

    def interrupt(_number: int, frame: FrameType | None) -> None:
        while frame is not None and frame.f_code.co_qualname not in {"RobotThread.finish", "unraisable_hook"}:
            frame = frame.f_back
        if frame is not None and frame.f_code.co_qualname == "RobotThread.finish" and len(interrupts) < 30:
            interrupts.append("")
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.0005, 0.0005)
    try:
        with pytest.raises(KeyboardInterrupt):
            robot.close()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert len(interrupts) > 3
    until(lambda: recorder.sent[-4:] == CLOSING_COMMANDS)
    until(lambda: not served.is_moving and not served.pioneer.state.open)


def test_work_is_done_to_its_end_before_an_interrupt_is_raised() -> None:
    seen: list[str] = []

    def work() -> None:
        seen.append("begun")
        if len(seen) < 3:
            raise KeyboardInterrupt
        seen.append("done")

    with pytest.raises(KeyboardInterrupt):
        held_back(work)
    assert seen == ["begun", "begun", "begun", "done"]

    def fail() -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        held_back(fail)


def test_closing_inside_a_callback_says_everything(served: ServedRobot) -> None:
    recorder = Recorder()
    robot = Robot(served.url, settings=QUICK, opener=recorder).connect()
    robot.set_velocity(0.3)
    until(lambda: served.is_moving)
    robot.on_state(lambda _: robot.close())
    until(lambda: recorder.sent[-4:] == CLOSING_COMMANDS)
    until(lambda: not served.is_moving and not served.pioneer.state.open)
    with pytest.raises(LinkLostError):
        robot.set_velocity(0.3)


def test_closing_while_a_callback_blocks_stops_the_robot_at_once(served: ServedRobot) -> None:
    recorder, over = Recorder(), threading.Event()
    robot = Robot(served.url, settings=QUICK, opener=recorder).connect()
    robot.set_velocity(0.3)
    until(lambda: served.is_moving)
    in_callback = threading.Event()
    robot.on_state(lambda _: (in_callback.set(), over.wait(30))[0])  # type: ignore[func-returns-value]
    assert in_callback.wait(30)
    began = time.monotonic()
    threading.Timer(0.6, over.set).start()
    robot.close()
    assert was_stopped(recorder)
    assert time.monotonic() - began < 5
    until(lambda: not served.is_moving and not served.pioneer.state.open)


def test_an_asyncio_callback_may_have_the_robot_closed(served: ServedRobot) -> None:
    recorder = Recorder()

    async def story() -> None:
        robot = AsyncRobot(served.url, settings=QUICK, opener=recorder)
        await robot.connect()
        robot.set_velocity(0.3)
        tasks: list[asyncio.Task[None]] = []
        robot.on_state(lambda _: tasks.append(asyncio.ensure_future(robot.close())) if not tasks else None)
        while not tasks:  # noqa: ASYNC110  # the robot's next packet
            await asyncio.sleep(0.01)
        await tasks[0]

    asyncio.run(story())
    assert recorder.sent[-4:] == CLOSING_COMMANDS


def test_an_asyncio_robot_that_is_closed_leaves_nothing_in_its_loop(served: ServedRobot) -> None:
    async def story() -> None:
        loop = asyncio.get_running_loop()
        async with AsyncRobot(served.url, settings=QUICK) as robot:
            robot.set_velocity(0.3)
            await robot.sleep(0.05)
            assert len(asyncio.all_tasks()) > 1, "the one that closes it with the loop"
        await asyncio.sleep(0)
        assert asyncio.all_tasks() == {asyncio.current_task()}
        assert [each for each in loop._scheduled if not each.cancelled()] == []  # type: ignore[attr-defined]

    asyncio.run(story())


def test_an_asyncio_robot_that_is_forgotten_is_stopped(served: ServedRobot) -> None:
    recorder = Recorder()

    async def story() -> None:
        robot = AsyncRobot(served.url, settings=QUICK, opener=recorder)
        await robot.connect()
        robot.set_velocity(0.3)
        await asyncio.sleep(0.1)
        del robot
        gc.collect()
        assert recorder.sent[-4:] == CLOSING_COMMANDS

    asyncio.run(story())
    until(lambda: not served.pioneer.state.open)


def test_an_asyncio_robot_whose_loop_has_ended_is_stopped(served: ServedRobot) -> None:
    recorder = Recorder()
    robot = AsyncRobot(served.url, settings=QUICK, opener=recorder)

    async def story() -> None:
        await robot.connect()
        robot.set_velocity(0.3)

    asyncio.run(story())
    assert recorder.sent[-4:] == CLOSING_COMMANDS
    until(lambda: not served.pioneer.state.open)


@pytest.mark.parametrize("is_thrown_away", [False, True], ids=["at-exit", "thrown-away"])
def test_an_asyncio_robot_that_is_waited_for_in_a_loop_that_was_closed_is_stopped(
    served: ServedRobot, *, is_thrown_away: bool
) -> None:
    recorder, robots = Recorder(), []

    async def story() -> None:
        async with AsyncRobot(served.url, settings=QUICK, opener=recorder) as robot:
            robots.append(robot)
            robot.set_velocity(0.3)
            await robot.sleep(60.0)

    loop, program = asyncio.new_event_loop(), story()
    loop.create_task(program)  # the loop keeps those that wait
    while not robots:
        loop.run_until_complete(asyncio.sleep(0.1))
    for task in asyncio.all_tasks(loop):
        task._log_destroy_pending = False  # type: ignore[attr-defined]
    loop.close()
    if is_thrown_away:
        program.close()
    else:
        robots[0]._runner.finish()
    assert recorder.sent[-4:] == CLOSING_COMMANDS
    until(lambda: not served.pioneer.state.open)


def test_an_asyncio_robot_whose_loop_was_closed_without_a_word_is_stopped_with_the_program(
    served: ServedRobot,
) -> None:
    program = f"""
import asyncio
from p2os.client.aio import Robot
robot = Robot({served.url!r})
loop = asyncio.new_event_loop()
loop.run_until_complete(robot.connect())
robot._runner._loop = loop
async def go(): robot.set_velocity(0.3); await asyncio.sleep(0.3)
loop.run_until_complete(go())
"""
    subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, timeout=60)
    until(lambda: not served.pioneer.state.open and not served.is_moving)


CLIENTS = {
    "blocking": """
from p2os import Robot
with Robot({url!r}) as r:
    r.set_velocity(0.3); print(1, flush=True); r.sleep(60)
""",
    "asyncio": """
import asyncio
from p2os.client.aio import Robot
async def main():
    async with Robot({url!r}) as r:
        r.set_velocity(0.3); print(1, flush=True); await r.sleep(60)
asyncio.run(main())
""",
}


SIGNALS = (signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1, signal.SIGALRM)


@pytest.mark.skipif(os.name != "posix", reason="signals are Unix's")
@pytest.mark.parametrize("client", CLIENTS)
def test_a_signal_that_would_kill_a_program_stops_its_robot_first(client: str) -> None:
    with contextlib.ExitStack() as left:
        rows: list[tuple[signal.Signals, ServedRobot, subprocess.Popen[bytes]]] = []
        for number in SIGNALS:  # each has a robot, and all wait for theirs at the same time
            robot = ServedRobot()
            left.callback(robot.close)
            words = [forked_python(), "-c", CLIENTS[client].format(url=robot.url)]
            program = left.enter_context(subprocess.Popen(words, stdout=subprocess.PIPE))
            left.callback(program.kill)
            rows.append((number, robot, program))
        for number, robot, program in rows:
            assert program.stdout is not None
            assert program.stdout.read(1)
            until(lambda: robot.is_moving)  # noqa: B023  # it is called now
            program.send_signal(number)
            program.send_signal(number)
        for number, robot, program in rows:
            assert program.wait(60) == 128 + number, number
            until(lambda: not robot.is_moving and not robot.pioneer.state.motors_enabled)  # noqa: B023


@pytest.mark.skipif(os.name != "posix", reason="signals are Unix's")
def test_signals_that_a_program_handles_or_ignores_stay_so(served: ServedRobot) -> None:
    caught: list[int] = []
    before = {number: signal.getsignal(number) for number in (signal.SIGUSR1, signal.SIGHUP, signal.SIGTERM)}
    signal.signal(signal.SIGUSR1, lambda number, _: caught.append(number))
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    try:
        with Robot(served.url, settings=QUICK):
            os.kill(os.getpid(), signal.SIGUSR1)
            os.kill(os.getpid(), signal.SIGHUP)
            assert signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert caught == [signal.SIGUSR1]


@pytest.mark.parametrize("error", [UnicodeError("label empty or too long"), ZeroDivisionError("x"), OSError("y")])
def test_an_opener_that_raises_anything_ends_the_wait_with_a_reason(error: Exception) -> None:
    def opener(_: str) -> Transport:
        raise error

    with pytest.raises(ConnectError, match=str(error)):
        Robot("tcp:127.0.0.1:1", opener=opener).connect()
    with pytest.raises(ConnectError, match=str(error)):
        asyncio.run(AsyncRobot("tcp:127.0.0.1:1", opener=opener).connect())


def test_a_host_name_that_cannot_be_one_is_refused_in_one_line() -> None:
    with pytest.raises(ConnectError, match=r"cannot connect to tcp:a\.\.b:8101"):
        Robot("tcp:a..b:8101").connect()


@pytest.mark.skipif(os.name != "posix", reason="descriptors are Unix's")
def test_a_robot_connects_above_1024_descriptors(served: ServedRobot) -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    if before[1] < 1300:
        pytest.skip("this machine allows no more than 1300 descriptors")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(1300, before[0]), before[1]))
    spare = [os.open(os.devnull, os.O_RDONLY) for _ in range(1100)]
    try:
        with Robot(served.url, settings=QUICK, opener=open_url) as robot:
            robot.next_state()
    finally:
        for descriptor in spare:
            os.close(descriptor)
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
