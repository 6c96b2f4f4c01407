"""What verbs do with a robot that they hold: its dashboard, ways, page, node of ROS, and output that is not read."""

import contextlib
import errno
import io
import json
import os
import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any, Self
from unittest.mock import patch

from rich.console import Console

from p2os.cli import printing
from p2os.cli.printing import ByteQueue, QueuedStream
from p2os.cli.robots import drive, monitor, robot_page
from p2os.cli.robots.drive import DriveRequest, carry_out, progress
from p2os.cli.robots.page_stop import PageStop
from p2os.cli.robots.ros import NodeLoop
from p2os.client import (
    Connected,
    DeadmanStopped,
    GapStopped,
    GaveUp,
    Limits,
    Link,
    LinkLost,
    LinkLostError,
    MotorsDisabled,
    MotorsDisabledError,
    PacketArrived,
    RobotPose,
    RobotState,
)
from p2os.client.goals import MotionResult
from p2os.protocol.connection import ConnectionStats
from p2os.protocol.packets import SimLaserPacket
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from p2os.ros.robot_node import MotorPower, Refused, ResetOdometry, Speed, StopRequest
from p2os.ros.topics import TOPICS
from p2os.ros.transport import NodeOptions, Received
from p2os.view.live import LiveRecording
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from tests.p2os.cli.robots.test_dashboard import STATE
from tests.tools.suite.approved import Trace, judge_of, rounded, said, tried

TOPIC = TOPICS["cmd_vel"].topic(NodeOptions(), None)
LASER = SimLaserPacket(total=1, first=0, ranges_mm=(5,))


class Terminal(io.StringIO):
    """Standard error or output on a terminal."""

    def isatty(self) -> bool:
        return True


class Held:
    """A robot whose packets are drawn, and which notes what it is told; time passes while one waits for it."""

    def __init__(self, draw: Random) -> None:
        self.draw, self.lines = draw, list[str]()
        self.now: Nanos = 7 * NS_PER_S
        self.state, self.link, self.stats = STATE, Link.OPEN, ConnectionStats()
        self.limits, self.parameters = Limits(0.5, 1.0, 0.3, 0.3, 1.0, 1.0), load_parameters("p2dx")
        self.identity, self.profile = SimpleNamespace(name=draw.choice(("", "Wilma")), subclass="p2dx"), Profile.P2OS
        self.config = draw.choice((None, SimpleNamespace(sipcycle=0), SimpleNamespace(sipcycle=50)))
        self.listeners: dict[str, list[Callable[[Any], None]]] = {"on_event": [], "on_state": []}

    @property
    def pose(self) -> RobotPose:
        return self.state.pose

    def clock(self) -> Nanos:
        return self.now

    def _note(self, name: str, *given: object) -> None:
        self.lines.append(f"{name} {said(given)} at {self.now}")

    def __getattr__(self, name: str) -> Any:
        if name in ("on_event", "on_state"):
            return partial(self._listened, name)
        if name in ("set_velocity", "stop", "send", "enable", "set_pose", "wait_open"):
            return partial(self._note, name)
        raise AttributeError(name)

    def _listened(self, name: str, callback: Callable[[Any], None]) -> Callable[[], None]:
        self.listeners[name].append(callback)
        self._note(name)

        def end() -> None:
            self.listeners[name].remove(callback)
            self._note(f"no {name}")

        return end

    def sleep(self, seconds: float) -> None:
        self._note("sleep", seconds)
        self.now += round(seconds * NS_PER_S)
        self._happens()

    def next_state(self) -> RobotState:
        """Let a packet come, of wheels that hardly move, or move on either side."""
        self.now += 100 * NS_PER_MS
        left, right = (self.draw.choice((0.0, 0.0049, -0.0049, 0.002, 0.005, -0.005, 0.3)) for _ in range(2))
        pose = RobotPose(self.draw.uniform(-1, 1), self.draw.uniform(-1, 1), self.draw.uniform(-3, 3))
        self.state = replace(self.state, at_ns=self.now, left_mps=left, right_mps=right, pose=pose,
                             forward_mps=left, turn_radps=right)  # fmt: skip
        self._note("state", left, right)
        self._happens()
        return self.state

    def states(self, lasts_s: float | None) -> Iterator[RobotState]:
        self._note("states", lasts_s)
        yield from (self.next_state() for _ in range(3))

    def _happens(self) -> None:
        for callback in self.listeners["on_state"]:
            callback(self.state)
        if self.draw.random() < 0.5:
            notice = self.draw.choice((LinkLost("x"), GapStopped(NS_PER_S), MotorsDisabled("y"), GaveUp("z"),
                                       PacketArrived(LASER, self.now)))  # fmt: skip
            for callback in self.listeners["on_event"]:
                callback(notice)

    def drive(self, metres: float, *, speed_mps: float | None) -> MotionResult:
        self._note("drive", metres, speed_mps)
        self.next_state()
        return MotionResult(asked=metres, reached=metres * 0.987654321, took_ns=1_250_000_000)

    def turn(self, radians: float, *, speed_radps: float | None) -> MotionResult:
        self._note("turn", radians, speed_radps)
        self.next_state()
        return MotionResult(asked=radians, reached=-radians, took_ns=50_000_000)


def ways(draw: Random) -> Iterator[str]:
    """Carry out each request with a robot, before a terminal and before a file, until its wheels stand."""
    requests = (
        DriveRequest(forward_m=0.5), DriveRequest(turn_rad=-1.0, rate_radps=0.5),
        DriveRequest(forward_m=-0.25, turn_rad=0.75, speed_mps=0.2, rate_radps=0.3),
        DriveRequest(speed_mps=0.2, lasts_ns=120 * NS_PER_MS), DriveRequest(rate_radps=0.6, lasts_ns=NS_PER_S),
    )  # fmt: skip
    for request in requests:
        for err in (Terminal(), io.StringIO()):
            robot: Any = Held(draw)
            watch = SimpleNamespace(wait=lambda lasts_ns, robot=robot: robot.sleep(lasts_ns / NS_PER_S))

            def watched(*given: object, robot: Any = robot, watch: Any = watch, **named: object) -> object:
                robot.lines.append(f"watch {said((given[1:], named))}")
                return watch

            with patch.object(drive, "RobotWatch", watched), contextlib.redirect_stderr(err):
                yield said(carry_out(request, robot))
            yield said(robot.lines) + repr(rounded(err.getvalue()))
    for _ in range(20):
        robot = Held(draw)
        drive._wait_until_it_stands(robot)
        yield said(robot.lines)
    robot = Held(draw)
    with patch.object(robot, "next_state", lambda: replace(STATE, left_mps=1.0)), progress(robot, "x"):
        drive._wait_until_it_stands(robot)


def dashboards(draw: Random) -> Iterator[str]:
    """Show a robot for so long, and print its states."""
    for lasts_ns in (NS_PER_S, 1, 350 * NS_PER_MS):
        robot: Any = Held(draw)
        pictures = list[str]()

        class Live:
            def __init__(self, pictures: list[str] = pictures, **named: Any) -> None:
                self.pictures = pictures
                pictures.append(said({name: value for name, value in named.items() if name != "console"}))

            def __enter__(self) -> Self:
                return self

            def __exit__(self, *_: object) -> None:
                self.pictures.append("over")

            def update(self, picture: Any, *, refresh: bool) -> None:
                with contextlib.redirect_stdout(io.StringIO()) as out:
                    Console(width=100, height=40, file=out, color_system=None).print(picture)
                self.pictures.append(f"{refresh} {out.getvalue()}")

        with (
            patch("rich.live.Live", Live), patch.object(monitor, "wall_clock", robot.clock),
            patch("p2os.cli.console.ReadableConsole", lambda: SimpleNamespace(width=100, height=40)),
        ):  # fmt: skip
            monitor._show(robot, "tcp:x", lasts_ns)
        yield from pictures
        yield said(robot.lines)
        for as_json, lasts in ((True, None), (False, lasts_ns)):
            with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
                monitor._print_states(robot, lasts, as_json=as_json)
            text = out.getvalue()
            yield said([json.loads(line) for line in text.splitlines()] if as_json else rounded(text)) + err.getvalue()
        yield said(robot.lines)


def pages(draw: Random) -> Iterator[str]:
    """Open a robot's line for a page, or not, stop it from there, watch it, and drive it."""
    lines = list[str]()
    robot: Any = Held(draw)

    def line(url: str) -> Any:
        lines.append(f"open {url}")
        return SimpleNamespace(description=url, read=lambda: b"\xfa", write=lambda data: lines.append(data.hex()))

    @contextlib.contextmanager
    def shown(source: Any, *, is_opened: bool) -> Iterator[None]:
        lines.append(f"shown {is_opened} {said(source.recording.header.hands)} {type(source.control).__name__}")
        yield
        lines.append("shown no more")

    @contextlib.contextmanager
    def held(made: Any, *, moves: bool = False) -> Iterator[Any]:
        lines.append(f"held {said(made)} {moves}")
        yield robot

    def made(url: str, *, opener: Callable[[str], Any], **named: object) -> object:
        opener(url).write(b"\x01")
        return url, named

    def slept(seconds: float) -> None:
        lines.append(f"sleep {seconds}")
        if len(lines) % 3 == 0:
            raise KeyboardInterrupt

    def driven(client: object) -> None:
        lines.append(f"driven {client is robot}")

    def driver(*most: float) -> object:
        lines.append(f"driver {said(most)}")
        return SimpleNamespace(drive=driven)

    robot.sleep = slept
    with (
        patch.object(robot_page, "open_url", line), patch.object(robot_page, "shown", shown),
        patch.object(robot_page, "held", held), patch.object(robot_page, "Robot", made),
        patch.object(robot_page, "PageDriver", driver), patch.object(robot_page, "wall_clock", robot.clock),
        patch.object(LiveRecording, "end", lambda _: lines.append("ended")),
    ):  # fmt: skip
        for is_viewed, is_opened, stop in ((False, True, None), (True, True, None), (True, False, PageStop())):
            with robot_page.opened_for("tcp:a", "p2dx", is_viewed=is_viewed, is_opened=is_opened, stop=stop) as opener:
                opener("tcp:b").write(b"\x02")
            yield said(lines)
            lines.clear()
        target = robot_page.watched_target("tcp:c")
        yield tried(ended_by_interrupt, target.run) + said(lines)
        lines.clear()
        assert target.driven is not None
        hands = target.driven(0.25, 90.0)
        assert hands.run is not None
        with contextlib.redirect_stderr(io.StringIO()) as err:
            yield tried(hands.run) + said((lines, err.getvalue()))
        source: Any = hands.source
        yield said((source.recording.header.title, source.recording.header.hands, type(source.control).__name__))
        lines.clear()
        with contextlib.redirect_stderr(io.StringIO()) as err:
            run = target.driven(0.75, 45.0).run
            assert run is not None
            yield tried(run) + said((lines, err.getvalue()))


def ended_by_interrupt(run: Callable[[], None]) -> str:
    try:
        run()
    except KeyboardInterrupt:
        return "interrupted"
    return "ended"


class Queue:
    """A queue of bytes that nobody takes, unless the test does."""

    def __init__(self, descriptor: int, name: str) -> None:
        self.changed, self.error = threading.Condition(), None
        self.waiting, self.data = 0, list[bytes]()
        self.name = f"{name} at {'its own' if descriptor > 2 else descriptor}"

    def append(self, data: bytes) -> None:
        self.waiting += len(data)
        self.data.append(data)


def outputs(draw: Random) -> Iterator[str]:
    """Write to streams whose readers take some, none, and go; count what is left out."""
    ends = os.pipe()
    with (
        os.fdopen(ends[0], "rb"), os.fdopen(os.dup(ends[1]), "w", encoding="ascii", errors="replace") as below,
        os.fdopen(ends[1], "w", encoding="utf-8") as other, Path(os.devnull).open("w", encoding="utf-8") as elsewhere,
        patch.object(printing, "ByteQueue", Queue), patch.object(printing, "MOST_BYTES", 40),
    ):  # fmt: skip
        for code in (errno.EPIPE, errno.EIO, errno.ENOSPC):
            notes: Any = QueuedStream(other, "errors")
            for stream in (QueuedStream(below, "one", notes), QueuedStream(elsewhere, "two", notes), notes):
                queue: Any = stream.queue
                yield said((queue.name, queue is notes.queue, stream.encoding, stream.errors, stream.writable()))
                for _ in range(60):
                    text = draw.choice(("a\n", "long lines of text\n", "part", "\rover", "\x1b[K", "b\nc\n", "", "é"))
                    count = stream.write(text)
                    if draw.random() < 0.3:
                        queue.waiting = max(0, queue.waiting - draw.choice((3, 20, 21, 60)))
                    yield said((count, queue.waiting, queue.data, stream._left_out, notes.queue.data))
                    queue.data.clear()
                stream.note_left_out()
                yield said((queue.data, notes.queue.data))
                queue.error = OSError(code, "gone")
                yield said([tried_write(stream, "x") for _ in range(2)])
                queue.error = None
        yield tried(notes.write, b"x")
        yield said([printing._has_descriptor(one) for one in (None, io.StringIO(), below)])


def tried_write(stream: QueuedStream, text: str) -> str:
    try:
        return said(stream.write(text))
    except OSError as error:
        return f"{type(error).__name__} {error}"
    except Exception as error:  # noqa: BLE001 - it is shown
        return f"{type(error).__name__} {error}"


def queues(draw: Random) -> Iterator[str]:
    """Hand bytes on to descriptors that take some, take none for a while, and refuse."""
    for case in ("takes", "some", "busy", "gone", "slow"):
        now, lines = [NS_PER_S], list[str]()

        def write(_: int, data: bytes, case: str = case, lines: list[str] = lines) -> int:
            lines.append(f"write {len(data)}")
            if case == "busy" and len(lines) % 3 == 1:
                raise BlockingIOError
            if case == "gone" and len(lines) > 2:
                raise OSError(errno.EPIPE, "gone")
            return len(data) if case == "takes" else min(len(data), draw.choice((1, 7, 1 << 15)))

        with patch("threading.Thread") as thread:
            queue = ByteQueue(4711, "x")
        yield said((thread.call_args.kwargs["name"], thread.call_args.kwargs["daemon"]))
        for _ in range(12):
            queue.append(bytes(draw.choice((0, 1, 9, 1 << 15, 1 << 16))))
        yield said((queue.waiting, len(queue._queue)))

        def waited(seconds: float, now: list[int] = now, queue: ByteQueue = queue, lines: list[str] = lines) -> None:
            lines.append(f"wait {said(seconds)}")
            now[0] += round(seconds * NS_PER_S * draw.choice((0.3, 0.6, 1.0)))
            if draw.random() < 0.6:
                queue._written += 1

        with patch.object(printing, "wall_clock", lambda now=now: now[0]), patch.object(queue.changed, "wait", waited):
            queue.end()
        yield said((now, lines, queue._is_over))
        lines.clear()
        with (
            patch.object(os, "write", write),
            patch("select.select", lambda *what, lines=lines: lines.append(said(what))),
        ):
            queue._hand_on()
        yield said((queue.waiting, queue._written, len(queue._queue), said(queue.error), lines))
        queue.append(b"late")
        yield said((queue.waiting, len(queue._queue)))


class Reply:
    """What a call is answered by."""

    def __init__(self, lines: list[str]) -> None:
        self._lines = lines

    def __call__(self, answer: object) -> None:
        self._lines.append(f"reply {said(answer)}")

    def __str__(self) -> str:
        return "a call"


def ros_nodes(draw: Random) -> Iterator[str]:  # noqa: C901 - what may be asked for
    """Move messages between a robot and a network, with a node that asks for anything at any time."""
    for _ in range(6):
        robot: Any = Held(draw)
        lines = robot.lines

        def noted(name: str, lines: list[str] = lines) -> Callable[..., None]:
            return lambda *given: lines.append(f"{name} {said(given)}")

        def asked(name: str, robot: Any = robot, lines: list[str] = lines) -> Callable[..., Any]:
            def ask(*given: object) -> Any:
                lines.append(f"{name} {said(given)}")
                kinds = (
                    Speed(0.1, 0.2),
                    StopRequest(),
                    MotorPower(True),
                    ResetOdometry(),
                    Refused("no"),
                    Refused("yes"),
                )
                return draw.choice(kinds) if name == "call" else draw.sample(kinds, draw.choice((0, 0, 1, 2)))

            return ask

        def refusing(*given: object, lines: list[str] = lines) -> None:
            lines.append(f"set_velocity {said(given)}")
            if draw.random() < 0.4:
                raise draw.choice((LinkLostError("lost"), MotorsDisabledError("off")))

        def take(wait_s: float, robot: Any = robot, lines: list[str] = lines) -> list[object]:
            lines.append(f"take {said(wait_s)}")
            robot.now += draw.choice((0, 20, 90, 400, 1000)) * NS_PER_MS
            reply = draw.choice((None, Reply(lines)))
            return [Received(TOPIC, {"n": n}, reply) for n in range(draw.choice((0, 1, 2)))]

        robot.set_velocity = refusing
        node: Any = SimpleNamespace(
            commands=("cmd",), services=("srv",), announced=lambda: ["odom"], first=lambda at: [("tf", at)],
            at_connection=lambda: [(1, 2), (3, None)], stopped=noted("stopped"), forget_place=noted("forget"),
            take_commands=asked("commands"), advance_to=asked("advance"), take_call=asked("call"),
            next_deadline=lambda robot=robot: draw.choice((None, robot.now + 5 * NS_PER_MS, robot.now - 1)),
            take_state=lambda _, at: [("state", at)], take_packet=lambda _, at: [("packet", at)],
            tell_health=lambda *given, **named: ("health", said((given[0] is None, given[1:], named))),
        )  # fmt: skip
        network: Any = SimpleNamespace(
            subscribe=noted("subscribe"), serve=noted("serve"), announce=noted("announce"), publish=noted("publish"),
            wake=noted("wake"), take=take, damaged=3,
        )  # fmt: skip
        loop, turns = NodeLoop(robot, network, node), deque(range(14))

        def is_over(robot: Any = robot, turns: deque[int] = turns) -> bool:
            for _ in range(draw.choice((0, 1, 17, 120))):
                for callback in robot.listeners["on_state"]:
                    callback(replace(STATE, at_ns=robot.now))
            for notice in (
                Connected(robot.identity, None, 9),
                LinkLost("x"),
                GaveUp("y"),
                DeadmanStopped(9),
                GapStopped(9),
            ):
                if draw.random() < 0.1:
                    for callback in robot.listeners["on_event"]:
                        callback(notice)
            return not turns or turns.popleft() < 0

        with (
            patch("p2os.cli.robots.ros.wall_clock", robot.clock), contextlib.redirect_stderr(io.StringIO()) as err,
            patch("time.time_ns", lambda robot=robot: 1_700_000_000 * NS_PER_S + robot.now),
        ):  # fmt: skip
            loop.run(is_over)
        yield "\n".join(lines)
        yield said((loop.counts, err.getvalue()))


TRACES: dict[str, Trace] = {
    each.__name__: each for each in (ways, dashboards, pages, outputs, queues, ros_nodes)
}  # fmt: skip
test_what_is_done_with_a_robot_is_what_was_approved = judge_of(__file__, TRACES)
