"""Programs that call anything of a robot, in one thread by steps; peers that answer oddly; the parts of a client."""

import asyncio
import math
import random
import selectors
import socket
import threading
from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextlib import closing, suppress
from dataclasses import fields, replace
from enum import Enum
from inspect import isawaitable
from logging import Handler, LogRecord, getLogger
from typing import Any
from unittest.mock import patch
from weakref import finalize

from p2os import Robot
from p2os.client import aio, link, notices, robot
from p2os.client.aux_ports import AuxBuffer
from p2os.client.calls import GripperAction, RobotCalls
from p2os.client.core import RobotCore
from p2os.client.line import Line, Listeners
from p2os.client.notices import words_of
from p2os.client.observer import Bumpers, Observer, bumpers_of, limits_of
from p2os.client.outbox import CloseLine, OpenLine, Outbox, Send, SetBaud
from p2os.client.robot_state import RobotPose, RobotState
from p2os.client.settings import ClientSettings
from p2os.errors import TransportError
from p2os.pioneer.controller import Pioneer
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.config_packet import FIELDS, ConfigPacket
from p2os.protocol.frames import Frame
from p2os.protocol.packets import EncoderPacket, GripperPacket, Identity, IoPacket, SerauxPacket
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading, StandardSip
from p2os.robots.parameters import load_parameters
from p2os.transport.ports import HungUpError
from p2os.transport.waiting import wait_readable
from simbase.errors import P2osError
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.p2os.client.client_rig import free_pioneer
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, refusal, said, tried

MS = NS_PER_MS
#: −127 and below: the robot has no thermometer.
CELSIUS = (-128, -127, -126, 40)
NAME = Identity(name="Rob", robot_class="Pioneer", subclass="p2dx")


class Wire:
    """A line to a virtual robot that takes no time, and can fail."""

    description = "wire:"

    def __init__(self, place: "Place") -> None:
        self._place, self.is_open = place, True
        place.opened += 1
        place.wires += 1

    def read(self) -> bytes:
        place = self._place
        with suppress(BlockingIOError):
            place.bells[0].recv(4096)
        place.pioneer.advance_to(place.now)
        data = b"".join(place.pioneer.take_output())
        if place.fails:
            raise HungUpError("the wire is gone")
        return b"" if place.is_cut else data

    def write(self, data: bytes) -> None:
        place = self._place
        if place.fails:
            raise HungUpError("the wire is gone")
        place.sent.append(f"{place.now // MS} {data.hex()}")
        if not place.is_cut:
            place.pioneer.receive(data, place.now)
            place.has_answer = True
            place.ring()

    def fileno(self) -> int:
        if self._place.is_blind:
            raise TransportError("no descriptor")
        return self._place.bells[0].fileno()

    def set_baud(self, baud: int) -> None:
        self._place.sent.append(f"baud {baud}")

    def close(self) -> None:
        if self.is_open:
            self.is_open = False
            self._place.wires -= 1
            self._place.sent.append(f"{self._place.now // MS} closed")
            self._place.pioneer.hang_up(self._place.now)


class Place:
    """A robot, and the clock by whose waits the client's thread takes its turns within the program's."""

    def __init__(self, pioneer: Pioneer) -> None:
        self.pioneer, self.now, self.opened, self.wires = pioneer, 5 * NS_PER_S, 0, 0
        self.fails = self.is_cut = self.is_away = self.has_answer = False
        #: Whether its line has no descriptor, and is asked again and again.
        self.is_blind = True
        self.sent: list[str] = []
        self.runner: Any = None
        #: The first is readable where the line of a robot may be.
        self.bells = socket.socketpair()
        for bell in self.bells:
            bell.setblocking(False)
            finalize(self, bell.close)

    def __call__(self) -> int:
        return self.now

    def due(self) -> int | None:
        """Return when the robot says something that is heard."""
        if self.wires:
            return None if self.is_cut else self.pioneer.next_deadline()
        self.pioneer.advance_to(self.now)
        self.pioneer.take_output()
        return None

    def ring(self) -> None:
        with suppress(BlockingIOError):
            self.bells[1].send(b"x")

    def open(self, _url: str) -> Wire:
        if self.is_away:
            raise TransportError("nobody listens", hint="switch it on")
        return Wire(self)

    def wait_readable(self, _descriptors: Iterable[int], longest_s: float) -> set[int]:
        has_answer, self.has_answer = self.has_answer, False
        if not (has_answer or wait_readable([self.runner._wake_up.fileno()], 0)):
            due, ends = self.due(), self.now + math.ceil(longest_s * NS_PER_S)
            self.now = max(self.now, ends if due is None else min(ends, due))
        return set()

    def wait_for_change(self, _changed: threading.Condition, longest_s: float) -> None:
        ends = self.now + math.ceil(longest_s * NS_PER_S)
        while True:
            self.runner._turn()
            if self.now >= ends or self.runner._line.is_over:
                return
            before = self.now
            self.runner._wait()
            if self.now > before:
                return

    def live(self, duration_ns: int) -> None:
        """Let time pass, as long as the client lives."""
        ends, before = self.now + duration_ns, -1
        while before < self.now < ends:
            before = self.now
            self.wait_for_change(threading.Condition(), (ends - before) / NS_PER_S)

    def look(self, _longest_s: float) -> None:
        self.runner._live()

    def add(self, _thread: object) -> None:
        """Take no note: its work is done here."""

    def taken(self) -> str:
        found, self.sent[:] = said(self.sent), []
        return found


class StillThread:
    """A thread that does nothing by itself."""

    def __init__(self, target: Callable[[], None], name: str, *, daemon: bool) -> None:
        self.named = (target.__name__, name, daemon)

    def start(self) -> None:
        """Nothing: whoever waits does its work."""


def whats(draw: random.Random, it: Robot, place: Place) -> list[Callable[[], object]]:
    """Return what a program may do with a robot."""
    gripper, aux = it.gripper, it.aux(draw.choice((1, 2, 3)))
    odd = draw.choice((0, 1, -1, 20, 255, 256))
    speed, length_s = draw.choice((None, 0.1, 0.3)), draw.choice((0.0, 0.5, 5.1, 5.11, -0.1))
    kind: Any = draw.choice((IoPacket, EncoderPacket, ConfigPacket, Command))
    return [
        lambda: it.set_velocity(draw.choice((0.2, -0.1, 9.0, math.nan)), draw.choice((0.0, 0.5))),
        lambda: it.drive(draw.choice((0.2, -0.1, 0.0, math.inf)), speed_mps=speed, timeout_s=draw.choice((None, 0.5,
        0.0))),
        lambda: it.turn(draw.choice((0.5, -1.0, 0.001)), speed_radps=speed, timeout_s=draw.choice((None, 0.5))),
        lambda: it.turn_to(draw.choice((3.0, -3.0, 6.5)), timeout_s=8.0), it.stop, it.emergency_stop, it.disable,
        lambda: it.enable(draw.random() < 0.5), lambda: it.sleep(draw.choice((0.0, 0.3, 2.5))),
        lambda: it.set_limits(forward_mps=0.3, turn_radps=1.0, accel_mps2=0.4, decel_mps2=0.5, turn_accel_radps2=2.0,
                              turn_decel_radps2=1.5),
        lambda: it.set_limits(forward_mps=draw.choice((0.0, -1.0, math.inf, 1e-9, 99.0))),
        lambda: it.set_pose(draw.choice((1.0, "x")), 2.0, 0.5),  # type: ignore[arg-type]  # a slip
        lambda: it.send(draw.choice((C.PULSE, 300, 28)), draw.choice((None, 1, b"ab"))),
        lambda: it.send(Command(C.SONAR, 0)),
        lambda: it.set_sonar(draw.random() < 0.5), lambda: it.set_sonar_order(draw.choice(((), (0, 3), (255,),
        (254,)))),
        lambda: it.set_digital(odd, 5), lambda: it.set_digital(5, odd), lambda: it.select_analog(odd), it.request_io,
        lambda: it.request_io(always=True), it.request_encoders, lambda: it.request_encoders(always=True), gripper.open,
        gripper.close, gripper.stop, gripper.lift_up, gripper.lift_down, gripper.store, gripper.deploy, gripper.request,
        lambda: gripper.request(always=True), lambda: gripper.set_pressure(odd), lambda: gripper.carry(odd),
        lambda: it.say([(length_s, draw.choice((0, 127, 255, 256, -1)))] * draw.choice((0, 1))),
        lambda: it.say([(0.1, 60)] * draw.choice((20, 21))), lambda: it.play_sound(odd), lambda: it.set_buzzer(odd > 0),
        lambda: it.next_state(draw.choice((0.05, 2.0))).number, lambda: it.fetch(kind),
        lambda: it.fetch(GripperPacket, 0.3),
        lambda: it.wait_open(draw.choice((0.0, 3.0))),
        lambda: [state.number for state in it.states(0.35)], lambda: it.newest(IoPacket),
        lambda: aux.write(b"x" * odd if odd > 0 else b""),
        lambda: place.pioneer.receive_aux(1, b"from aux", place.now), lambda: aux.read(draw.choice((0, 3, -1))),
        aux.flush_input,
        lambda: aux.readinto(memoryview(bytearray(2))), lambda: (aux.readable(), aux.writable(), aux.timeout_s),
        lambda: (it.link, it.baud, it.stats, it.limits, it.profile, it.parameters.subclass, it.config is None),
        lambda: (it.identity, it.pose, it.state.number), lambda: setattr(place, "is_cut", draw.random() < 0.5),
        lambda: setattr(place, "fails", draw.random() < 0.5), lambda: setattr(place, "is_away", draw.random() < 0.5),
        lambda: place.pioneer.do(draw.choice(("fault wheel-blocked left", "clear wheel-blocked", "fault stop-button",
                                              "clear stop-button", "fault reboot")), place.now),
        lambda: setattr(place, "now", place.now + draw.choice((300, 900, 3000)) * MS), lambda: it.connect() is it,
    ]  # fmt: skip


class Said(Handler):
    """Keeps what is logged."""

    def __init__(self) -> None:
        super().__init__(0)
        self.lines: list[str] = []

    def emit(self, record: LogRecord) -> None:
        self.lines.append(f"{record.levelname} {record.getMessage()}")


def program(draw: random.Random, place: Place, acts: int, **options: Any) -> Iterator[str]:
    """Yield what a robot answers, what it is sent, and what is logged, whatever a program does."""
    log, heard, kept = getLogger("p2os.client"), list[str](), Said()
    log.addHandler(kept)
    level = log.level
    log.setLevel(1)
    try:
        with patch.object(threading, "Thread", StillThread), patch.object(robot, "exit_on_signals", lambda: None):
            it = Robot("tcp:robot", opener=place.open, clock=place, **options)
            place.runner = it._runner
            ends = [
                it.on_event(lambda notice: heard.append(words_of(notice))),
                it.on_state(lambda s: heard.append(f"{s.number}")),
            ]
            yield said([tried(lambda name=name: getattr(it, name)) for name in ("state", "identity", "link", "limits")])
            with closing(it):
                yield tried(lambda: it.connect() is it) + place.taken() + said(place.runner._thread.named)
                for number in range(acts):
                    if number == acts * 2 // 3:
                        for end in ends:
                            end()
                    if number % 6 == 5:
                        place.fails = place.is_cut = place.is_away = False
                        yield tried(lambda: it.connect() is it)
                    what = draw.choice(whats(draw, it, place))
                    yield tried(what)
                    place.live(draw.choice((0, 10, 30, 250)) * MS)
                    yield said((place.now // MS, place.opened, heard, kept.lines)) + place.taken()
                    heard.clear()
                    kept.lines.clear()
            yield place.taken() + said((it.link, kept.lines, it._runner._has_ended))
            it.close()
            yield tried(it.connect) + place.taken()
    finally:
        log.removeHandler(kept)
        log.setLevel(level)


def usual(draw: random.Random) -> Iterator[str]:
    place = Place(free_pioneer())
    place.is_blind = False
    yield from program(draw, place, 130)


def careful(draw: random.Random) -> Iterator[str]:
    place = Place(free_pioneer("p3dx-sh", profile=Profile.ARCOS))
    place.is_blind = False
    yield from program(draw, place, 70, auto_enable=False, reconnect=False, deadman_s=None, model="p3dx-sh")


def blind(draw: random.Random) -> Iterator[str]:
    yield from program(draw, Place(free_pioneer()), 9)


def bare(draw: random.Random) -> Iterator[str]:
    chosen = ClientSettings(plausibility_ns=300 * MS, deadman_ns=700 * MS, command_spacing_ns=20 * MS)
    place = Place(free_pioneer("p2at8", profile=Profile.AROS))
    place.is_blind = False
    yield from program(draw, place, 90, settings=chosen, model=load_parameters("p2at8"))


class StepSelector(selectors.DefaultSelector):
    """Waits for an event loop's descriptors by the clock of a place."""

    def __init__(self, place: Place) -> None:
        super().__init__()
        self._place = place

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready, place = super().select(0), self._place
        if ready or timeout is None or timeout <= 0:
            return ready
        due, ends = place.due(), place.now + math.ceil(timeout * NS_PER_S)
        if due is not None and due < ends:
            place.ring()
            ends = due
        place.now = max(place.now, ends)
        return super().select(0)


class StepLoop(asyncio.SelectorEventLoop):
    """An event loop by the clock of a place; executors work at once."""

    def __init__(self, place: Place) -> None:
        self._place = place
        super().__init__(StepSelector(place))

    def time(self) -> float:
        return self._place.now / NS_PER_S

    def run_in_executor(self, _executor: object, func: Callable[..., Any], *args: Any) -> asyncio.Future[Any]:  # type: ignore[override]  # as typeshed has it
        future: asyncio.Future[Any] = self.create_future()
        try:
            future.set_result(func(*args))
        except Exception as error:  # noqa: BLE001 - whatever it is
            future.set_exception(error)
        return future


def awaits(draw: random.Random, it: aio.Robot, place: Place) -> list[Callable[[], Awaitable[object] | None]]:
    """Return what a program of asyncio may do with a robot."""
    aux, kind = it.aux(draw.choice((1, 2))), draw.choice((IoPacket, EncoderPacket, GripperPacket))

    async def some_states() -> list[int]:
        return [state.number async for state in it.states(0.35)]

    async def some_events() -> list[str]:
        it.request_io()
        found: list[str] = []
        with suppress(TimeoutError):
            async with asyncio.timeout(0.6):
                async for notice in it.events():
                    found.append(words_of(notice))  # noqa: PERF401 - what came before the end counts
        return found

    async def given_up() -> str:
        task = asyncio.ensure_future(it.drive(1.0))
        await asyncio.sleep(0.3)
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
        return "given up"

    async def number() -> int:
        return (await it.next_state(draw.choice((0.05, 2.0)))).number

    return [
        lambda: it.drive(draw.choice((0.2, -0.1)), speed_mps=draw.choice((None, 0.2)), timeout_s=draw.choice((None,
        0.4))),
        lambda: it.turn(draw.choice((0.5, -1.0))), lambda: it.turn_to(draw.choice((3.0, -3.0)), timeout_s=9.0), number,
        lambda: it.sleep(draw.choice((0.0, 0.3, 2.5))), lambda: it.fetch(kind, 0.5),
        lambda: it.wait_open(draw.choice((0.1, 3.0))),
        some_states, some_events, given_up, lambda: aux.write(b"abc"), lambda: aux.read(draw.choice((0, 3, -1))),
        aux.flush_input,
        lambda: place.pioneer.receive_aux(1, b"from aux", place.now), lambda: it.set_velocity(0.2, draw.choice((0.0,
        0.5))),
        it.stop, lambda: setattr(place, "is_cut", draw.random() < 0.5), lambda: setattr(place, "fails",
        draw.random() < 0.5),
        lambda: setattr(place, "is_away", draw.random() < 0.5), lambda: setattr(place, "now", place.now + 900 * MS),
        aux.close,
    ]  # fmt: skip


def awaited(draw: random.Random) -> Iterator[str]:
    """Yield what a robot of asyncio answers and is sent, whatever a program awaits."""
    place, heard, found = Place(free_pioneer()), list[str](), list[str]()
    place.is_blind = False

    async def program() -> None:
        it = aio.Robot("tcp:robot", opener=place.open, clock=place)
        it.on_event(lambda notice: heard.append(words_of(notice)))
        async with it:
            found.append(said((it.link, it.state.number)) + place.taken())
            for number in range(110):
                if number % 6 == 5:
                    place.fails = place.is_cut = place.is_away = False
                    await it.connect()
                what = draw.choice(awaits(draw, it, place))
                try:
                    answer: object = what()
                    answer = await answer if isawaitable(answer) else answer
                    found.append(said(answer))
                except (P2osError, ValueError) as error:
                    found.append(refusal(error))
                await asyncio.sleep(draw.choice((0.0, 0.02, 0.2)))
                found.append(said((place.now // MS, place.opened, heard, it.link)) + place.taken())
                heard.clear()
        found.append(said((it.link, it._runner._is_finished)) + place.taken())
        await it.close()
        it._runner.finish()

    with (
        patch.object(aio, "exit_on_signals", lambda: None),
        asyncio.Runner(loop_factory=lambda: StepLoop(place)) as runner,
    ):
        runner.run(program())
    yield from found
    place = Place(free_pioneer())
    place.is_away = True

    async def refused() -> str:
        it = aio.Robot("tcp:robot", opener=place.open, clock=place)
        try:
            await it.connect()
        except P2osError as error:
            return refusal(error) + tried(it.set_velocity, 0.1)
        return ""

    with (
        patch.object(aio, "exit_on_signals", lambda: None),
        asyncio.Runner(loop_factory=lambda: StepLoop(place)) as runner,
    ):
        yield runner.run(refused()) + place.taken()


def inside(part: object) -> str:
    """Return what a part keeps for itself: numbers, texts and words."""
    kept = {name: value for name, value in vars(part).items() if isinstance(value, int | float | str | Enum | None)}
    return said(kept)


def peers(draw: random.Random) -> Iterator[str]:  # noqa: C901, PLR0912 - a table of answers
    """Yield how a client looks for a robot among peers that answer in part, and how it raises a line's speed."""
    sips = (
        StandardSip(raw_battery=120), StandardSip(gripper_state=2), StandardSip(analog_port=3),
        StandardSip(raw_battery=120, tail=(900, 80, 21)),
    )  # fmt: skip
    for number in range(32):
        sip, name = sips[number // 2 % 4], Identity("Rob", "Pioneer", ("p2dx", "p3dx-sh", "p2at8")[number % 3])
        way = ["silent", "noise", "echo", "named", "opened", "sips", "sips", "raised", "raised", "mute"][number % 10]
        baud = 9600 if way == "raised" else draw.choice((None, 9600, 38400))
        chosen = ClientSettings(
            raise_baud=draw.choice((None, 38400, 57600)), reconnect=draw.random() < 0.7, bauds=(9600, 19200)
        )
        core, now = RobotCore(chosen), 0
        config = ConfigPacket(
            subclass="p2dx", autobaud=draw.choice((0, 2, 2)), transvelmax=900, fields_sent=len(FIELDS)
        )
        line_baud, is_named, is_open = baud, False, False
        yield inside(core._supervisor) + inside(core) + inside(core._mover)
        core.connect(0)
        yield said((number, way, baud, chosen.raise_baud, chosen.reconnect, config.autobaud))
        for _ in range(60):
            while (action := core.take_action(now)) is not None:
                answer: list[bytes] = []
                match action:
                    case OpenLine() if number == 13:
                        core.line_failed("cannot open", None if draw.random() < 0.5 else "hint", now)
                    case OpenLine():
                        line_baud = baud
                        core.line_opened(now, baud)
                    case SetBaud():
                        line_baud = action.baud
                    case Send():
                        command = Command.from_frame(Frame.from_bytes(action.data))
                        answer = answered("open" if is_open else way, command, config, name, gives=way == "raised")
                        # SYNC1 and SYNC2 have the numbers of OPEN and CLOSE.
                        if command.number == C.OPEN:
                            is_open = is_named and way in {"sips", "raised"}
                        elif command.number == C.CLOSE:
                            is_named, is_open = not is_open, False
                yield f"{now // MS} {said(action)}"
                for data in answer:
                    core.receive(data, now)
            if is_open and (way == "sips" or line_baud in {baud, 38400}):
                core.receive(sip.to_frame(Profile.P2OS).to_bytes(), now)
            core.advance_to(now)
            news = [f"state {item.number}" if isinstance(item, RobotState) else words_of(item) for item in core.news]
            core.news.clear()
            yield said(
                (now // MS, core.link, core.baud, core.is_ready, core.next_deadline(), core.is_quiet, news, core.stats)
            )
            yield inside(core._supervisor) + said((core._supervisor.profile, core.profile, core.limits))
            if draw.random() < 0.03:
                core.line_lost("it vanished", now)
            due = core.next_deadline()
            if due is None and core.is_quiet:
                break
            now = max(now + MS, min(now + 100 * MS, due if due is not None else now + 100 * MS))
        core.close(now)
        yield said((core.link, core.take_action(now), core.is_ready))


def answered(way: str, command: Command, config: ConfigPacket, name: Identity, *, gives: bool) -> list[bytes]:
    """Return what a peer sends back for a command."""
    kind = command.number
    if way == "silent":
        return []
    if way == "noise":
        return [b"\x55\xaa"]
    if way == "echo":
        return [command.to_frame().to_bytes()]
    found: list[bytes] = []
    if kind in {0, 1} and way != "open":
        found.append(Frame(bytes((kind,))).to_bytes())
    if kind == 2 and way not in {"mute", "open"}:
        found.append(name.to_frame().to_bytes())
    if kind == C.CONFIG and gives:
        found.append(config.to_frame().to_bytes())
    return found


def parts(draw: random.Random) -> Iterator[str]:  # noqa: C901, PLR0912 - a table after the other
    """Yield settings at their bounds, notices in words, places of a search, limits, and what waits to be sent."""
    yield said(ClientSettings())
    for field in fields(ClientSettings):
        for value in (-1, 0, 1, None):
            if value is not None or field.name in {"deadman_ns", "raise_baud", "profile"}:
                yield tried(lambda name=field.name, value=value: getattr(ClientSettings(**{name: value}), name))
    config = ConfigPacket(subclass="p2dx", transvelmax=500, rotvelmax=90, transacc=300, frontbumps=5, rearbumps=3)
    values: dict[str, Any] = {
        "identity": NAME, "baud": 9600, "took_ns": 1_260_000_000, "config": config, "reason": "a reason", "attempt": 3,
        "wait_ns": 2 * NS_PER_S, "hint": "a hint", "text": "a text", "silent_ns": NS_PER_S, "gap_ns": 3 * NS_PER_S // 2,
        "what": "drive 1 m", "asked": 1.0, "reached": 0.5, "problem": "it stalled", "tried": 38400, "subclass": "p9",
        "used": "p2dx", "packet": SerauxPacket(port=1, data=b"x"), "at_ns": 7,
    }  # fmt: skip
    kinds = notices._DETAILS.keys() | {notices.PacketArrived, notices.ConfigurationKnown}
    for kind in sorted(kinds, key=lambda kind: kind.__name__):
        names = [field.name for field in fields(kind)]
        each = {name: values[name] for name in names}
        yield said(
            sorted(words_of(kind(**each | more)) for more in ({}, {"baud": None} if kind is notices.Connected else {}))
        )
    yield words_of(notices.MotionEnded("turn 1", 1.0, 1.0, 5))
    for baud in (None, 9600, 57600):
        for is_known in (False, True):
            yield said(link.search_plan(baud, (9600, 38400, 9600), ClientSettings(), is_known=is_known))
        for came_to in link.REASONS:
            yield said(link.why_not_found(came_to, baud, (9600, 38400)))
    for model in ("p2dx", "p3at-sh"):
        for one in (None, config, ConfigPacket(subclass=model, transvelmax=30_000, rotvelmax=9000)):
            yield said((limits_of(load_parameters(model), one), bumpers_of(one)))
    for sent in (0, 20, 40, 60, 80):
        one = ConfigPacket.from_frame(Frame(config.to_frame().payload[: 40 + sent])) if sent else config
        yield said((one.fields_sent, bumpers_of(one)))
    box, now = Outbox(5 * MS), 0
    for _ in range(90):
        frames = [
            Command(draw.choice((C.PULSE, C.VEL, C.STOP)), None).to_frame().to_bytes() for _ in range(draw.randrange(3))
        ]
        match draw.randrange(9):
            case 0 | 1 | 2:
                box.send(frames)
            case 3:
                box.send_first(frames, is_still=draw.random() < 0.5)
            case 4:
                box.put(draw.choice((OpenLine(), CloseLine(), SetBaud(draw.choice((9600, 38400))))))
            case 5 if draw.random() < 0.4:
                box.drop_frames(draw.choice((None, {C.VEL})))
            case 6 if draw.random() < 0.2:
                box.clear()
            case 7 if draw.random() < 0.3:
                box.baud = draw.choice((None, 9600))
        now += draw.choice((0, 1, 4, 5, 20)) * MS
        yield said((now, box.next_deadline(), box.take(now), box.next_deadline(), box.is_empty, box.baud))


def aux_bytes(draw: random.Random) -> Iterator[str]:  # noqa: C901 - a table of acts
    for port in (0, 1, 2, 3, 4):
        yield tried(lambda port=port: AuxBuffer(port).numbers)
    buffer = AuxBuffer(2)
    for size in (0, 1, 189, 190, 191, 380):
        yield said([(one.number, len(one.argument)) for one in buffer.writing(bytes(size))])  # type: ignore[arg-type]  # bytes
    for _ in range(60):
        match draw.randrange(5):
            case 0:
                yield said(buffer.asking(draw.choice((0, 1, 5, 199, 200, 201)), again=draw.random() < 0.3))
            case 1:
                arrived = notices.PacketArrived(SerauxPacket(port=draw.choice((1, 2)), data=draw.randbytes(3)), 1)
                buffer.notice(draw.choice((arrived, arrived, notices.LinkLost("x"))))
            case 2:
                yield buffer.read(draw.choice((0, 1, 4))).hex()
            case 3 if draw.random() < 0.3:
                yield said(buffer.flushing())
        yield said((len(buffer), buffer._asked))
    for timeout_s in (None, 0.0, 0.5, 1.0, 2.25):
        asked: list[Command] = []
        buffer = AuxBuffer(1)
        waiting, steps = buffer.filling(5, timeout_s, asked.append), list[str]()
        try:
            is_so, longest_s = next(waiting)
            for came in (b"", b"ab", b"", b"cd", b"", b"", b"e"):
                if came:
                    buffer.take(came)
                steps.append(said((is_so(None), longest_s, asked)))  # type: ignore[arg-type]  # it looks at no core
                is_so, longest_s = waiting.send(bool(came))
        except StopIteration:
            steps.append("over")
        yield said(steps)


def observed(draw: random.Random) -> Iterator[str]:
    """Yield what is known of robots by packets that they send."""
    for model, profile in (("p2dx", None), ("p3dx-sh", None), ("p2at8", Profile.AROS), ("p3at-sh", Profile.ARCOS)):
        it, now = Observer(load_parameters(model), profile), 0
        it.bumpers = Bumpers(draw.choice((0, 5)), draw.choice((0, 7)))
        limits = limits_of(it.parameters, None)
        for _ in range(40):
            now += draw.choice((100, 100, 900, 30_000)) * MS
            match draw.randrange(14):
                case 0:
                    it.place(RobotPose(1.0, -2.0, draw.choice((0.0, 4.0))))
                case 1:
                    it.firmware.take_motors_asked(draw.random() < 0.7)
                case 2 if draw.random() < 0.5:
                    it.firmware.take_servo_set()
                case 3 if draw.random() < 0.4:
                    it.new_session(load_parameters(model))
                case 4:
                    body = ConfigPacket(subclass=model).to_frame().payload
                    it.firmware.take_config(
                        draw.choice((None, ConfigPacket.from_frame(Frame(body[: draw.choice((50, 70, 90, 300))]))))
                    )
            packet = StandardSip(
                raw_x=draw.randrange(1 << 15), raw_y=draw.randrange(1 << 15), raw_heading=draw.randrange(4096),
                kind=draw.choice((0x32, 0x33)),
                raw_left_velocity=draw.randrange(-300, 300), raw_right_velocity=draw.randrange(-300, 300),
                raw_battery=draw.randrange(256),
                stall_left=draw.random() < 0.3, stall_right=draw.random() < 0.3, rear_bumpers=draw.randrange(128),
                front_bumpers=draw.randrange(128), raw_flags=draw.choice((0, 1, 0x20, 0x21)),
                raw_compass=draw.choice((0, 1, 90, 179, 255)),
                analog_port=draw.choice((0, 1, 5, 9)), gripper_state=draw.choice((0, 0, 2, 6)),
                raw_analog=draw.randrange(256),
                digital_in=draw.randrange(256), digital_out=draw.randrange(256),
                tail=draw.choice(((), (), (900, 80, 21), *((120, 1, -5, 3, 9, celsius, 80) for celsius in CELSIUS))),
                sonar=tuple(SonarReading(draw.randrange(40), draw.choice((0, 500,
                9000))) for _ in range(draw.randrange(3))),
            )  # fmt: skip
            it.firmware.take(packet)
            yield tried(it.take, packet, now)
            yield said((it.firmware.profile, it.firmware.tells_motors, it.wheels_mps, it.doubtful_gap_ns(limits)))
            yield inside(it.firmware) + inside(it._pose)
            assert it.state is not None
            yield said((it.state.nearest(), it.state.nearest(0.0, 1.0), it.state.is_stalled))


def gaps(draw: random.Random) -> Iterator[str]:
    """Yield which time between two packets is doubtful, right before it and at it, by either limit alone."""
    for model in ("p2dx", "p3at-sh"):
        parameters = load_parameters(model)
        half_span_m = (1 << 14) * parameters.distance_conv_mm / 1000
        for forward, turn, longest_s in ((0.5, 0.001, half_span_m / 0.5), (0.001, 2.0, math.pi / 2)):
            for by in (-1000, 0, 1000):
                it = Observer(parameters)
                yield inside(it._pose) + inside(it)
                limits = replace(limits_of(parameters, None), forward_mps=forward, turn_radps=turn)
                for at in (7, 7 + math.ceil(longest_s * NS_PER_S) + by):
                    it.take(StandardSip(), at)
                    yield said((at, it.doubtful_gap_ns(limits)))


class Carried:
    """Carries calls out at once, on a core that notes what it is sent."""

    def __init__(self, *_: object) -> None:
        self.calls: list[str] = []
        self.listeners = Listeners()

    def run(self, call: Callable[[Any, int], Any]) -> Any:
        return call(Acted(self.calls, "core"), 5)

    def finish(self) -> None:
        """Nothing."""


class Asked(RobotCalls):
    """A robot whose calls are noted."""

    _runner_type = Carried


def bounds(draw: random.Random) -> Iterator[str]:  # noqa: C901 - a table after the other
    """Yield what each call sends at the ends of what it takes, and what it refuses beyond them."""
    it = Asked("tcp:robot")
    gripper, calls, octets = it.gripper, it._runner.calls, (-1, 0, 1, 0x7F, 0x80, 0xFF, 0x100)  # type: ignore[attr-defined]

    def shown(action: Callable[..., object], *arguments: object, **named: object) -> str:
        return tried(action, *arguments, **named) + taken(calls)

    for mask in octets:
        yield said([shown(it.set_digital, mask, states) for states in octets])
    for length_s in (-0.01, 0.0, 0.009, 0.011, 0.02, 5.1, 5.11):
        yield said([shown(it.say, [(length_s, tone)]) for tone in (-1, 0, 1, 255, 256)])
    yield said([shown(it.say, [(0.1, 60)] * count) for count in (0, 1, 2, 20, 21)])
    yield said([shown(it.set_sonar_order, order) for order in ((), (-1,), (0, 5), (253, 254), (255,), (3, 256))])
    names = ("forward_mps", "turn_radps", "accel_mps2", "decel_mps2", "turn_accel_radps2", "turn_decel_radps2")
    for name in names:
        limits = (None, -1.0, 0.0, 1e-9, 0.25, 1.0, 30.0, math.inf, math.nan, "1", True)
        yield said([shown(it.set_limits, **{name: limit}) for limit in limits])
    yield shown(it.set_limits, **dict.fromkeys(names, 0.5))
    for call in (it.set_sonar, it.set_buzzer, it.enable):
        yield said([shown(call, on) for on in (True, False)])
    yield said([shown(it.enable), shown(it.set_sonar), shown(it.disable), shown(it.stop), shown(it.emergency_stop)])
    for each in (it.request_io, it.request_encoders, gripper.request):
        yield said([shown(each), shown(each, always=True), shown(each, always=False)])
    for act in (gripper.open, gripper.close, gripper.stop, gripper.lift_up, gripper.lift_down, gripper.store):
        yield shown(act)
    yield shown(gripper.deploy)
    for number in octets:
        for ask in (gripper.carry, gripper.set_pressure, it.play_sound, it.select_analog):
            yield shown(ask, number)
    yield said([shown(gripper.act, action) for action in GripperAction])
    pose: tuple[Any, ...]
    for pose in ((), (1.0,), (1.0, -2.0, 0.5), ("x",), (1.0, None), (1.0, 2.0, "y")):
        yield shown(it.set_pose, *pose) + shown(it.set_velocity, *pose[:2])
    for argument in (None, 7, b"ab"):
        yield shown(it.send, 11, argument) + shown(it.send, Command(28, argument))
    for deadman_s in (None, 0.5, 1.25):
        options: tuple[dict[str, Any], ...] = (
            {},
            {"auto_enable": False},
            {"reconnect": False},
            {"settings": ClientSettings(auto_enable=False)},
        )
        yield said([Asked("tcp:r", deadman_s=deadman_s, **option)._core.settings for option in options])
    yield said([Asked("serial:/dev/x", model=model)._core.parameters.subclass for model in (None, "p3at-sh")])


def lines(draw: random.Random) -> Iterator[str]:
    """Yield the waits of a line whose owner comes back late, and how it is given back."""
    for _ in range(6):
        place = Place(free_pioneer())
        core = RobotCore(ClientSettings())
        line = Line(core, None, place)
        core.connect(line.now())
        for number in range(45):
            line.turn()
            if line.is_wanted:
                if draw.random() < 0.2:
                    line.failed(draw.choice((OSError("odd"), TransportError("gone", hint="plug it in"))))
                else:
                    line.opened(Wire(place))
            if number == 20:
                yield tried(core.set_velocity, 0.2, 0.0, line.now())
            if draw.random() < 0.05:
                place.fails = not place.fails
            line.log(line.take_news())
            wait_s = line.wait_s()
            yield (
                said((place.now // MS, core.link, wait_s, line.is_over, line.is_wanted, line.transport is None))
                + place.taken()
            )
            place.now += round(wait_s * NS_PER_S) + draw.choice(
                (0, 0, 0, 1, 200 * MS, 350 * MS + 1, 351 * MS, 1500 * MS)
            )
            place.now += draw.choice((0, 30 * MS))
            yield said(
                [
                    next(line.waits(lambda _: draw.random() < 0.2, timeout_s), None)
                    for timeout_s in (None, 0.0, 0.1, 9.0)
                ]
            )
        line.finish()
        line.finish()
        yield said((core.link, line.is_over, line.transport is None)) + place.taken()


TRACES: dict[str, Trace] = {
    each.__name__: each
    for each in (usual, careful, blind, bare, awaited, peers, parts, aux_bytes, observed, gaps, bounds, lines)
}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
