"""What verbs are made of, with lines, files, pads, browsers and terminals that are none, as approved."""

# ruff: noqa: E501  # rows of tables stand as they are

import base64
import contextlib
import errno
import io
import json
import os
import random
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from p2os.capture import Chunk, Direction, FollowedReading
from p2os.cli.captures import capture_files, headless
from p2os.cli.captures import view as view_verb
from p2os.cli.captures.capture_files import PcapFile, RecordingFile, Sinks
from p2os.cli.captures.headless import HeadlessPage
from p2os.cli.captures.render import _film, _size_of, _write_png, _writer_of
from p2os.cli.captures.sniff import Screen, TapBridge
from p2os.cli.doctor import NeedStatus, examine, line_of
from p2os.cli.main import run
from p2os.cli.robots.driven_page import PageDriver
from p2os.cli.robots.pad_source import SdlPad
from p2os.cli.robots.page_stop import PageStop
from p2os.cli.robots.send import make_command
from p2os.cli.robots.teleop import KeyLoop, Teleop, read_keys, status
from p2os.cli.virtual.serve import EventLines
from p2os.client import DeadmanStopped, Disobeyed, GapStopped, Limits, Link, LinkLost, MotorsDisabled
from p2os.client.notices import LinkLostError
from p2os.errors import RunFailedError, TransportError
from p2os.protocol.commands import Command, CommandNumber, vel
from p2os.protocol.packets import StandardSip, packet_frame
from p2os.protocol.profiles import Profile
from p2os.transport.ports import RefusedPeerError
from p2os.view.run_control import DRIVE_HOLD_NS, RunCommand
from p2os.view.targets import ViewTarget
from simbase.errors import P2osError
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from tests.p2os.cli.robots.test_dashboard import STATE
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

C = CommandNumber
SIP = packet_frame(StandardSip(raw_x=5), Profile.P2OS).to_bytes()


class Line:
    """An end of a line: what comes is drawn, what goes is noted."""

    def __init__(self, name: str, lines: list[str], come: Callable[[], bytes]) -> None:
        self.description, self._lines, self._come, self.is_closed = name, lines, come, False

    def read(self) -> bytes:
        return self._come()

    def write(self, data: bytes) -> None:
        if data == b"lost":
            raise TransportError(f"{self.description} cannot be written")
        self._lines.append(f"{self.description} <- {data.hex()}")

    def fileno(self) -> int:
        raise TransportError("no descriptor")

    def set_baud(self, baud: int) -> None:
        self._lines.append(f"{self.description} at {baud}")

    def close(self) -> None:
        self._lines.append(f"{self.description} closed")


def sniffed(draw: random.Random) -> Iterator[str]:  # noqa: C901 - what may come
    """Stand between clients and robots that come, speak, are lost, refused, and pause."""
    for _ in range(12):
        lines, now = list[str](), [0]

        def come(is_client: bool, draw: random.Random = draw, now: list[int] = now) -> Callable[[], bytes]:
            def read() -> bytes:
                match draw.randrange(16):
                    case 0:
                        raise TransportError("the line was lost")
                    case 1 if is_client:
                        raise RefusedPeerError("that was a browser")
                    case 2:
                        return b"lost"
                    case 3 | 4:
                        return b""
                    case 5:
                        now[0] += 2 * NS_PER_S
                said_now = (
                    Command(draw.choice((0, 1, 2, C.VEL, C.HOSTBAUD)), draw.choice((None, 1, 3, 9)))
                    .to_frame()
                    .to_bytes()
                )
                return said_now if is_client else draw.choice((SIP, b"\xfa\xfb\3\0\0\0", SIP[:9]))

            return read

        def accept(
            lines: list[str] = lines, come: Callable[[bool], Callable[[], bytes]] = come, draw: random.Random = draw
        ) -> Line | None:
            return Line("client", lines, come(True)) if draw.random() < 0.7 else None

        def opened(
            lines: list[str] = lines, come: Callable[[bool], Callable[[], bytes]] = come, draw: random.Random = draw
        ) -> Line:
            if draw.random() < 0.2:
                raise TransportError("no robot there")
            return Line("robot", lines, come(False))

        listener = SimpleNamespace(
            accept=accept,
            fileno=lambda: None,
            poll_s=0.01,
            description="here",
            close=lambda lines=lines: lines.append("closed"),
        )
        with (
            patch("p2os.cli.captures.sniff.wait_readable", lambda *_: None),
            patch("p2os.cli.captures.sniff.time.sleep", lambda _: None),
        ):
            bridge = TapBridge(
                listener, Line("spare", lines, come(False)), opened, on_chunk=lambda chunk, lines=lines: lines.append(said(chunk)),  # type: ignore[arg-type,misc]
                on_event=lines.append, clock=lambda now=now: now[0],  # type: ignore[misc]
            )  # fmt: skip
            for _ in range(40):
                bridge.turn()
                now[0] += draw.choice((5, 10, 30)) * NS_PER_MS
            yield said((bridge.sessions, bridge.now))
            bridge.close()
        yield "\n".join(lines)
    for as_json, quiet in ((False, False), (True, False), (False, True)):
        screen = Screen(FollowedReading(), as_json=as_json, quiet=quiet)
        with contextlib.redirect_stdout(io.StringIO()) as out:
            for at, data in enumerate((SIP, SIP[:-1] + b"\0", b"\xfa\xfb\x20")):
                screen.take(Chunk(at_ns=at * NS_PER_MS, direction=Direction.FROM_ROBOT, data=data))
            screen.close()
        yield said((screen.rows, screen.damaged, out.getvalue()))


class Full(io.RawIOBase):
    """A file that takes so many bytes, and a few at a time."""

    def __init__(self, room: int) -> None:
        super().__init__()
        self.room, self.kept = room, bytearray()

    def write(self, data: memoryview) -> int:  # type: ignore[override]
        if len(self.kept) + 7 > self.room:
            raise OSError(errno.ENOSPC, "No space left on device")
        self.kept += data[:7]
        return len(data[:7])

    def truncate(self, size: int | None = None) -> int:
        del self.kept[size:]
        return size or 0


def files(draw: random.Random) -> Iterator[str]:
    """Write files of captures that find room, and do not."""
    chunks = [
        Chunk(at_ns=at * NS_PER_MS, direction=draw.choice((*Direction, None)), data=data)
        for at, data in enumerate((SIP, SIP[:5], SIP[5:], b"\xfa", vel(9).to_frame().to_bytes()))
    ]
    with tempfile.TemporaryDirectory() as made:
        for name, make in (
            ("r", lambda path: RecordingFile(path, "n")),
            ("p", lambda path: PcapFile(path, 1_700_000_000 * NS_PER_S + 5)),
        ):
            for room in (0, 50, 100, 200, 10_000):
                path, full = Path(made, f"{name}{room}"), Full(room)
                with patch.object(Path, "open", lambda *_, full=full, **__: full):
                    try:
                        file = make(path)
                        for chunk in chunks:
                            file.take(chunk)
                        file.close()
                        file.close()
                    except RunFailedError as error:
                        yield f"{error} ({error.hint})".replace(made, "…")
                    yield said((bytes(full.kept), full.closed))
            yield tried(lambda make=make: make(Path(made, "none", "x"))).replace(made, "…")
    heard: list[str] = []

    def failing(name: str, is_sound: bool) -> SimpleNamespace:
        def take(chunk: object) -> None:
            heard.append(f"{name} took")
            if not is_sound:
                raise RunFailedError(f"{name} is full")

        return SimpleNamespace(take=take, close=lambda: heard.append(f"{name} closed"))

    for sound in ((True, True), (False, True), (True, False), (False, False)):
        sinks = Sinks([failing(f"{number}", one) for number, one in enumerate(sound)])  # type: ignore[misc]
        yield tried(sinks.take, chunks[0])
        with sinks:
            heard.append("within")
        yield said(heard)
        heard.clear()
    yield said([name for name in vars(capture_files) if name[0].isupper()])


class Client:
    """A client of a robot that notes what it is told."""

    def __init__(self, draw: random.Random, lines: list[str]) -> None:
        self.draw, self.lines = draw, lines
        self.link, self.state = Link.OPEN, STATE
        self.callback: Callable[[object], None] = lambda _: None
        self.limits = Limits(0.5, 1.0, 0.3, 0.3, 1.0, 1.0)

    def set_velocity(self, forward_mps: float, turn_radps: float) -> None:
        self.lines.append(said(("speeds", forward_mps, turn_radps)))
        if self.draw.random() < 0.06:
            raise LinkLostError("the link was lost")

    def stop(self) -> None:
        self.lines.append("stop")

    def on_event(self, callback: Callable[[object], None]) -> None:
        self.callback = callback

    def happens(self) -> None:
        if self.draw.random() < 0.1:
            self.callback(
                self.draw.choice((GapStopped(9), DeadmanStopped(9), LinkLost("x"), MotorsDisabled("y"), Disobeyed("z")))
            )


def pages(draw: random.Random) -> Iterator[str]:
    """Drive by pages that say what is held, late, wrong and not at all."""
    for _ in range(10):
        lines, now = list[str](), [0]
        client = Client(draw, lines)
        driver = PageDriver(0.5, 60.0, clock=lambda now=now: now[0])  # type: ignore[misc]
        client.on_event(driver._notices.put)  # type: ignore[arg-type]
        for _ in range(30):
            command = draw.choice(
                (
                    None,
                    RunCommand(do="stop"),
                    RunCommand(do="say"),
                    *(
                        RunCommand(do="drive", forward_mps=speed, turn_dps=turn)
                        for speed, turn in ((0.3, 0.0), (0.9, -99.0), (0.0, 0.0))
                    ),
                )
            )  # type: ignore[arg-type]
            if command is not None:
                driver.offer(command)
            client.happens()
            client.link = draw.choice((Link.OPEN, Link.OPEN, Link.OPEN, Link.WAITING))
            late_ns, take = draw.choice((0, 50, 50, 300, 3000)) * NS_PER_MS, driver._commands.take

            def taken(
                _wait_s: float,
                now: list[int] = now,
                late_ns: int = late_ns,
                take: Callable[[], RunCommand | None] = take,
            ) -> RunCommand | None:
                now[0] += late_ns
                return take()

            with patch.object(driver._commands, "take", taken):
                driver.turn(client)  # type: ignore[arg-type]
            lines.append(said((now[0], driver.state)))
            now[0] += draw.choice((0, 0, DRIVE_HOLD_NS))
        yield "\n".join(lines)


VIEWS = (
    "x", "x --no-browser", "x --drive", "x --drive --vel 150mm/s --turn-rate 20deg/s", "x --drive --vel 9m/s",
    "x --drive --turn-rate 999deg/s", "x --vel 1m/s", "x --turn-rate 1deg/s", "x --gdb", "x --gdb 0", "x --gdb 3333",
    "x --drive --gdb 1", "x --port 8000 --host 0.0.0.0", "x --port 65536",
)  # fmt: skip


def viewed(draw: random.Random) -> Iterator[str]:
    """View what runs, can be driven or debugged, or does neither, with each option."""
    calls: list[str] = []

    def noted(name: str, answer: object = None) -> Callable[..., Any]:
        def note(*given: object, **named: object) -> Any:
            calls.append(f"{name} {said((given, named))}")
            return answer

        return note

    @contextlib.contextmanager
    def shown(source: object, **named: object) -> Iterator[object]:
        calls.append(f"shown {source} {said(named)}")
        yield SimpleNamespace(wait=noted("waits"))

    ready: Any = ViewTarget(source="ready", run=noted("runs"))  # type: ignore[arg-type]  # a source
    for found in (
        ViewTarget(source="still"), ready, ViewTarget(source="robot", driven=noted("driven", ready)),  # type: ignore[arg-type]
        ViewTarget(source="program", debugged=noted("debugged", ready)),  # type: ignore[arg-type]
    ):  # fmt: skip
        for words in VIEWS:
            out, err = io.StringIO(), io.StringIO()
            with (
                patch.object(view_verb, "target_of", return_value=found), patch.object(view_verb, "shown", shown),
                patch.dict(os.environ, COLUMNS="80"), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err),
            ):  # fmt: skip
                code = run(["view", *words.split()])
            yield f"{found.source} {words}: {code} {calls} {out.getvalue()}{err.getvalue()}"
            calls.clear()


def keys(draw: random.Random) -> Iterator[str]:
    """Drive by keys that are held, while the program pauses, the link is lost and the page says STOP."""
    for _ in range(8):
        lines, now = list[str](), [0]
        client, stop = Client(draw, lines), PageStop()

        def read(_longest_ns: Nanos, now: list[int] = now, draw: random.Random = draw) -> list[str]:
            now[0] += draw.choice((10, 50, 50, 50, 400, 4000)) * NS_PER_MS
            return draw.choices(
                ("w", "w", "a", "up", "+", "-", " ", "z", "q"),
                (8, 8, 2, 3, 1, 1, 1, 1, 0.2),
                k=draw.choice((0, 1, 1, 2)),
            )

        loop = KeyLoop(Teleop(0.3, 0.8), client, read=read, clock=lambda now=now: now[0], stop=stop)  # type: ignore[arg-type,misc]
        for _ in range(30):
            client.happens()
            client.link = draw.choice((Link.OPEN, Link.OPEN, Link.OPEN, Link.SEARCHING))
            client.state = replace(STATE, stall_left=draw.random() < 0.2, stall_right=False)
            if draw.random() < 0.05:
                stop.offer(RunCommand(do="stop"))
            with contextlib.redirect_stderr(io.StringIO()) as err:
                loop.turn()
            lines.append(said((err.getvalue(), loop.keys.is_over, stop.state)))
        yield "\n".join(lines)
        yield said([status(loop.keys, client), len(status(loop.keys, client))])  # type: ignore[arg-type]
    for typed, later in ((b"w", b""), (b"\x1b", b"[A"), (b"\x1b", b""), (b"", b""), (b"w\xffq", b"")):
        parts = [typed, later]
        for is_there in (True, False):
            with patch("p2os.cli.robots.teleop.wait_readable", lambda _on, wait_s, is_there=is_there, later=later: is_there and (wait_s > 0.1 or bool(later))), \
                 patch("p2os.cli.robots.teleop.os.read", lambda *_, parts=[*parts]: parts.pop(0)), patch.object(sys, "stdin", SimpleNamespace(fileno=lambda: 0)):  # fmt: skip
                yield said(read_keys(500 * NS_PER_MS))


def sdl(
    names: Sequence[str], known: Sequence[bool], values: Sequence[int], is_there: bool, calls: list[str]
) -> dict[str, SimpleNamespace]:
    """Return pygame, as far as a pad needs it."""
    pad = SimpleNamespace(
        name="Pad",
        attached=lambda: is_there,
        get_button=lambda number: values[number],
        get_axis=lambda number: values[number],
    )
    controller = SimpleNamespace(
        init=lambda: calls.append("controller"),
        is_controller=lambda number: known[number],
        Controller=lambda number: (calls.append(f"takes {number}"), pad)[1],
    )
    joystick = SimpleNamespace(
        init=lambda: calls.append("joystick"),
        quit=lambda: calls.append("joystick quits"),
        get_count=lambda: len(names),
        Joystick=lambda number: SimpleNamespace(get_name=lambda: names[number]),
    )
    display = SimpleNamespace(init=lambda: calls.append("display"), quit=lambda: calls.append("display quits"))
    game = SimpleNamespace(
        display=display, joystick=joystick, event=SimpleNamespace(pump=lambda: calls.append("pump")), CONTROLLER_BUTTON_DPAD_UP=0, CONTROLLER_BUTTON_DPAD_DOWN=1,
        CONTROLLER_AXIS_TRIGGERRIGHT=2, CONTROLLER_AXIS_TRIGGERLEFT=3, CONTROLLER_AXIS_RIGHTX=4,
    )  # fmt: skip
    return {"pygame": game, "pygame._sdl2": SimpleNamespace(controller=controller)}


def pads(draw: random.Random) -> Iterator[str]:
    for names, known in (
        ((), ()),
        (("Odd",), (False,)),
        (("Odd", "Even"), (False, False)),
        (("Odd", "Even"), (False, True)),
        (("A", "B"), (True, True)),
    ):
        for values in ((0, 0, 0, 0, 0), (1, 0, 32767, -5, -32768), (0, 1, 16384, 32767, 32767), (1, 1, 31, 33, 16383)):
            for is_there in (True, False):
                calls: list[str] = []
                with patch.dict(sys.modules, sdl(names, known, values, is_there, calls)), patch.dict(os.environ):  # type: ignore[arg-type]
                    os.environ.pop("SDL_VIDEODRIVER", None)
                    yield tried(used_pad)
                    yield said((calls, os.environ.get("SDL_VIDEODRIVER"), os.environ.get("PYGAME_HIDE_SUPPORT_PROMPT")))


def used_pad() -> object:
    with SdlPad() as pad:
        return pad.name, pad.report()


def browsers(draw: random.Random) -> Iterator[str]:
    """Ask a browser at the end of a pipe, which answers, errs, is silent, and tells other things first."""
    for answers in (
        [{"result": {"targetId": "t"}}, {"result": {"sessionId": "s"}}, {"result": {}}, {"result": {}}, {"result": {}}, {"result": {"result": {"value": 5}}}, {"result": {"data": base64.b64encode(b"png").decode()}}],
        [{"result": {"targetId": "t"}}, {"result": {"sessionId": "s"}}, {"error": "no such"}], [{"error": "none"}], [{"result": {"targetId": "t"}}],
        [{"result": {"targetId": "t"}}, {"result": {"sessionId": "s"}}, {"result": {}}, {"result": {}}, {"result": {}}, {"result": {"exceptionDetails": {"text": "bad" * 99}}}],
    ):  # fmt: skip
        theirs, commands = os.pipe()
        ours, replies = os.pipe()
        for number, answer in enumerate(answers, 1):
            os.write(
                replies,
                json.dumps({"method": "event"}).encode()
                + b"\0"
                + json.dumps({"id": number, **answer}).encode()
                + b"\0",
            )
        os.close(replies)
        try:
            page = HeadlessPage(commands, ours)
            page.open("file:///x", 640, 480, is_dark=draw.random() < 0.5)
            yield said((page.evaluate("1 + 4"), page.picture()))
        except P2osError as error:
            yield f"{error} ({error.hint})"
        yield os.read(theirs, 1 << 16).decode().replace("\0", "\n")
        for descriptor in (theirs, commands, ours):
            os.close(descriptor)
    asked: list[object] = []
    page = HeadlessPage.__new__(HeadlessPage)
    with (
        patch.object(page, "evaluate", lambda words: (asked.append(words), len(asked) > 2)[1]),
        patch.object(headless.time, "sleep", lambda _: None),
    ):
        page.wait_for("x")
    with (
        patch.object(page, "evaluate", lambda _: False),
        patch.object(headless, "PATIENCE_S", 0.0),
        patch.object(headless.time, "sleep", lambda _: None),
    ):
        yield tried(page.wait_for, "y")
    yield said(asked)
    for start, end, speed, fps in (
        (0, 0, 1.0, 10.0),
        (5, 4, 1.0, 10.0),
        (0, NS_PER_S, 1.0, 10.0),
        (7, NS_PER_S, 2.0, 3.0),
        (0, 150 * NS_PER_S, 1.0, 10.0),
        (0, 1499 * NS_PER_S // 10, 1.0, 10.0),
    ):
        yield tried(
            lambda args=(start, end, speed, fps): (
                len(_film(*args).times),
                _film(*args).times[-1],
                _film(*args).pace_hz,
            )
        )
    for text in ("1400x900", "200X4000", "199x200", "4001x900", "1x2x3", "axb", "300x", ""):
        yield tried(_size_of, text)
    for name in ("a.png", "a.svg", "a.PNG", "a.jpg", "a"):
        yield tried(lambda name=name: _writer_of(Path(name)) is _write_png)


def lists(draw: random.Random) -> Iterator[str]:
    """List ports, what is installed, and what happened to a served robot."""
    found = [
        {"url": "serial:/dev/ttyUSB0", "description": "FT232R", "hardware": "USB VID:PID=0403:6001"},
        {"url": "serial:/dev/ttyS10", "description": "n/a", "hardware": "n/a"},
    ]
    for ports in ([], found[:1], found):
        for words in (["ports"], ["ports", "--json"]):
            with (
                patch("p2os.cli.links.ports.list_serial_ports", lambda ports=ports: ports),
                contextlib.redirect_stdout(io.StringIO()) as out,
                contextlib.redirect_stderr(io.StringIO()) as err,
            ):
                code = run(words)
            yield f"{code}\n{out.getvalue()}\n{err.getvalue()}"
    needs = [SimpleNamespace(kind=kind, name=f"{kind} one", extra=extra, feature="it", get=get, is_plugged_in=number % 2 == 0) for number, (kind, extra, get) in enumerate(
        [("program", "", "apt"), ("package", "", ""), ("package", "view", ""), ("built", "", ""), ("plug-in", "", ""), ("plug-in", "", "")])]  # fmt: skip
    for missing, doubled in (({}, {}), ({"robot-bench": "bench"}, {"p2os": ["p2os", "robot-bench"]})):
        with patch("p2os.cli.doctor.installed_needs", lambda: needs), patch("p2os.cli.doctor.missing_distributions", lambda missing=missing: missing), \
             patch("p2os.cli.doctor.doubled_packages", lambda doubled=doubled: doubled), patch("p2os.cli.doctor.package_version", lambda name: "1.2" if "one" in name else None), \
             patch("p2os.cli.doctor.platform.python_version", lambda: "3.11.0"), patch("p2os.cli.doctor.reinstall_command", lambda: "again"), \
             patch("p2os.cli.doctor.install_command", lambda extra, python="": f"get {extra} {python}"), patch("p2os.cli.doctor.way_to_build", lambda name: f"build {name}"):  # fmt: skip
            for python in ((3, 10), (3, 11), (3, 12)):
                rows = examine(find_program=lambda name: None if python == (3, 12) else f"/bin/{name}", python=python)  # noqa: B023 - called at once
                yield said(rows)
                yield "\n".join(map(line_of, rows))
            for words in (["doctor"], ["doctor", "--json"]):
                with (
                    contextlib.redirect_stdout(io.StringIO()) as out,
                    contextlib.redirect_stderr(io.StringIO()) as err,
                    patch("p2os.cli.doctor.examine", lambda rows=rows: rows[1:]),
                ):
                    code = run(words)
                yield f"{code}\n{out.getvalue()}\n{err.getvalue()}"
    yield line_of(NeedStatus(name="a.b", kind="built", found="built", feature="f", get="g", required=False))
    for who in ("", "robot 2  "):
        lines = list[str]()
        events = EventLines(lines.append, who)
        for number in range(260):
            events.write_event(
                number * NS_PER_S // 90 if number % 50 else 999 * NS_PER_S, "what", "detail" if number % 3 else ""
            )
        yield "\n".join(lines)
    for name, words in (
        ("255", []),
        ("256", []),
        ("5", ["1", "2"]),
        ("5", ["hex:01ff"]),
        ("5", ["hex:0"]),
        ("5", ["x"]),
        ("SAY", ["a", "b"]),
        ("SAY", ["hex:zz"]),
        ("DIGOUT", ["1", "0x10"]),
        ("DIGOUT", ["1"]),
        ("DIGOUT", ["1", "2", "3"]),
    ):
        yield tried(make_command, name, words)
    for words in (["--version"], [], ["nothing"], ["drive"], ["send"], ["send", "x"], ["drive", "x", "--forward", "1m", "--turn-rate", "1deg/s"], ["drive", "x", "--forward", "1m", "--vel", "-1m/s"],
                  ["drive", "x", "--turn", "1deg", "--vel", "1m/s"], ["view", "x", "--vel", "1m/s"], ["view", "x", "--turn-rate", "1deg/s"], ["ros", "urdf"], ["ros", "x", "p2dx"], ["ros", "x", "--force"]):  # fmt: skip
        with (
            contextlib.redirect_stdout(io.StringIO()) as out,
            contextlib.redirect_stderr(io.StringIO()) as err,
            patch.dict(os.environ, COLUMNS="80"),
        ):
            code = run(words)
        yield said((words, code, err.getvalue(), bool(out.getvalue())))


TRACES: dict[str, Trace] = {
    each.__name__: each for each in (sniffed, files, pages, viewed, keys, pads, browsers, lists)
}
TRACES["declared"] = declared_of(
    "p2os.cli", "p2os.cli.captures", "p2os.cli.links", "p2os.cli.robots", "p2os.cli.virtual"
)
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
