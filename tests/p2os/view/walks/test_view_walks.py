"""Pages of recordings that grow: rows as they are thinned, packed and read, what a page is sent, and who may look."""
# ruff: noqa: B023, E402 - what is made in a loop is called in it; what is an extra is asked for before

import asyncio
import gzip
import json
import math
import random
import socket
import zlib
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import pytest

pytest.importorskip("starlette", reason="the extra view is not installed")
uvicorn = pytest.importorskip("uvicorn", reason="the extra view is not installed")

from p2os.capture import Chunk, Direction
from p2os.pioneer.body.contract import BodyState
from p2os.pioneer.world.loader import load_world
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from p2os.protocol.frames import Frame
from p2os.robots.parameters import load_parameters
from p2os.view import detail, page, run_control, targets
from p2os.view.capture_recording import CaptureTracks, open_recording
from p2os.view.channels import BY_NAME, KINDS, CellType, ChannelKind
from p2os.view.frames import (
    FrameFlags,
    LaterText,
    LaterTexts,
    ViewFrame,
    chosen_rows,
    empty_columns,
    frames_in,
    packed_frames,
)
from p2os.view.header import ChannelHeader, PageHeader, PageSection, PageText, PanelState
from p2os.view.live import LiveRecording, StillRecording
from p2os.view.packet_rows import PacketTexts
from p2os.view.recording import ChannelTrack, ViewRecording, _extend_plain
from p2os.view.run_control import COMMANDS, CommandError, RunCommand, RunState, command_of
from p2os.view.served_robots import ServedRobots
from p2os.view.server import app, page_session, serving
from p2os.view.server.access import SUBPROTOCOL, PageAccess
from p2os.view.server.page_session import PageSession, RequestError
from p2os.view.watched_line import WatchedConversation, WatchedLine, WatchedListener
from p2os.view.world_plan import world_of
from tests.tools.suite.acted import Acted, taken
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

CAPTURE = Path(__file__).resolve().parents[3] / "golden" / "captures" / "ros_p2dx.jsonl"
P2DX = load_parameters("p2dx")


def short(data: bytes) -> str:
    return data.hex() if len(data) < 200 else f"{len(data)} bytes {zlib.crc32(data):08x}"


def shown_as(message: object) -> str:
    """Return what a page is sent as text, a frame by its cells."""
    if isinstance(message, str):
        return message
    return framed(ViewFrame.from_bytes(bytes(message)))  # type: ignore[call-overload]


def framed(frame: ViewFrame) -> str:
    head = (frame.channel, frame.kind.name, frame.from_ns, frame.to_ns, frame.of, frame.width, int(frame.flags))
    return said((head, [[*map(said, column)] for column in frame.columns]))


def refused(action: Callable[..., object], *arguments: object) -> str:
    try:
        return said(action(*arguments))
    except (RequestError, CommandError) as error:
        return f"{type(error).__name__}: {error}"


def drawn_cell(draw: random.Random, cells: CellType) -> Any:
    match cells:
        case CellType.F64 | CellType.F32:
            return draw.choice((0.0, 0.5, -2.0, 1e6, math.nan, math.inf, draw.randrange(-50, 50)))
        case CellType.TEXT:
            return draw.choice(("", "a", "é", "ab\0c", "a" * 9))
        case CellType.BYTES:
            return draw.choice((b"", b"\xfa\xfb", b"12345678"))
        case CellType.U8:
            return draw.randrange(4)
        case _:
            return draw.choice((0, 1, 2, 1 << 31))


def drawn_row(draw: random.Random, kind: ChannelKind, width: int) -> list[Any]:
    return [
        [drawn_cell(draw, column.cells) for _ in range(width)] if column.is_wide else drawn_cell(draw, column.cells)
        for column in kind.columns[1:]
    ]


def grown(draw: random.Random, track: ChannelTrack, rows: int) -> None:
    now = track.times[-1] if len(track) else 0
    for _ in range(rows):
        now += draw.choice((0, 1, 1, 5, 40, -3))
        track.append(now, *drawn_row(draw, track.kind, track.header.width))


def frames(draw: random.Random) -> Iterator[str]:
    """Yield frames of each kind as bytes, and what becomes of frames that are changed in one place."""
    assert [kind.number for kind in KINDS] == [BY_NAME[kind.name].number for kind in KINDS]
    yield said(KINDS)
    for kind in KINDS:
        track = ChannelTrack(ChannelHeader(name="x", kind=kind.name, id=kind.number * 1000, width=3))
        for rows in (0, 1, 5):
            grown(draw, track, rows)
            data = track.frame(-5, 60, 100, flags=draw.choice([*FrameFlags, FrameFlags(0)])).to_bytes()
            yield data.hex()
            yield shown_as(data)
        for _ in range(24):
            place = draw.choice((*range(48), *range(48, len(data))))
            changed = bytearray(data)
            changed[place] = draw.choice((0, 1, 255, data[place] ^ 1))
            yield f"{place} {tried(lambda: shown_as(bytes(changed)))}"
        for cut in (0, 47, 48, len(data) - 8, len(data) - 1):
            yield tried(lambda cut=cut: shown_as(data[:cut]))
        longer = bytearray(data + bytes(8))
        longer[24:28] = len(longer).to_bytes(4, "little")
        yield tried(lambda: shown_as(bytes(longer)))
        both = data + data
        yield tried(lambda: len([*frames_in(both)]))
        yield said(
            [(one.kind_number, one.channel, one.from_ns, one.to_ns, len(one.data)) for one in packed_frames(both)]
        )
        yield tried(lambda: len([*packed_frames(both + data[:40])])) + tried(
            lambda: len([*packed_frames(both + data[:60])])
        )
        yield said([len(column) for column in empty_columns(kind)])
    text = BY_NAME["text"]
    good: dict[str, Any] = {"kind": text, "channel": 1, "from_ns": 0, "to_ns": 1, "of": 1}
    times, sent = array("q", [3]), array("B", [1])
    for columns, more in (
        ((times, sent), {}), ((times, sent, []), {}), ((times, sent, ["a", "b"]), {}), ((times, sent, ["a"]),
        {"of": 0}),
        ((times, sent, ["a"]), {"of": 2**32 - 1}), ((times, sent, ["a"]), {"of": 2**32}), ((times, times, ["a"]), {}),
    ):  # fmt: skip
        yield tried(lambda columns=columns, more=more: ViewFrame(columns=columns, **good | more).to_bytes().hex())
    made = [0]

    def make() -> str:
        made[0] += 1
        return "later"

    later = LaterText(make)
    yield said((made[0], str(later), repr(later), made[0]))
    texts = LaterTexts(9, lambda row: f"r{row}")
    yield said((len(texts), texts[0], texts[-1], texts[2:4], tried(texts.__getitem__, 9)))
    yield said([[*column] for column in chosen_rows((array("q", range(9)), ["a", "b", "c"]), [2, 0], (3, 1))])


def spans(draw: random.Random) -> Iterator[str]:
    """Yield which rows so many pixels show, by each way of choosing them."""
    for _ in range(60):
        times = sorted(draw.choices(range(draw.choice((5, 60, 1000))), k=draw.choice((1, 2, 3, 9, 70, 200))))
        values = array("d", [draw.randrange(-9, 9) for _ in times])
        index = detail.Extremes()
        for end in sorted(draw.choices(range(len(times) + 1), k=2)):
            index.grow(values[:end])
        index.grow(values)
        first = draw.randrange(len(times))
        last, pixels = draw.randrange(first, len(times) + 1), draw.choice((1, 2, 7, 50))
        yield said(([*detail.buckets(times, first, last, pixels)], [*detail.changes(times, first, last, pixels)]))
        yield said(detail.curve(times, [index], first, last, pixels) if first < last else None)
        yield said([*detail.curve_of(times, [values], pixels)])
        most = draw.choice((2, 3, 5, 40))
        yield said(detail.thinned_list(lambda row: int(values[row]) % 3, first, last, most))
        yield said(index.within(first, last) if first < last else None)
        for begins in (times[0] - 1, times[first], times[first] + 1, times[-1] + 1):
            yield said([detail.rows_in(times, begins, begins + span) for span in (0, 1, 30)])
        wide = array("f", [draw.choice((math.nan, 1.0, 2.5, 0.5)) for _ in range(12)])
        yield said([[*detail.nearest(wide, width)] for width in (1, 2, 3)])
    long = array("d", [draw.randrange(1000) for _ in range(3 * detail.RUN**2 + 5)])
    index = detail.Extremes()
    for end in (63, 64, 65, 4095, 4096, 4097, len(long)):
        index.grow(long[:end])
        yield said([index.within(*sorted((draw.randrange(end), end))) for _ in range(4)])
    for _ in range(60):
        first, last = sorted(draw.sample(range(len(long) + 1), 2))
        yield said((first, last, index.within(first, last)))


def tracks(draw: random.Random) -> Iterator[str]:
    """Yield channels of every kind as they grow, are copied, changed and asked for."""
    for kind in KINDS:
        recording = ViewRecording(PageHeader(title="t", start_ns=0, end_ns=4000))
        track = recording.add(ChannelHeader(name="x", kind=kind.name, source="a", width=2, of=9))
        yield said((track.header, len(track), said([*map(list, track.columns)])))
        for rows in (3, 30, 300):
            grown(draw, track, rows)
            for pixels, listed in ((1, 4), (7, 20), (400, 500)):
                begins = draw.randrange(-5, track.times[-1])
                yield framed(track.frame(begins, begins + draw.choice((0, 50, 4000)), pixels, listed=listed))
            yield framed(track.tail(len(track) - 2, len(track)))
        copied = recording.copied(track, "b", track.times[9], 3)
        yield said((copied.header, len(copied), copied.generation)) + framed(copied.tail(0, len(copied)))
        yield said(
            (recording.shared(track.header).header.id, recording.shared(replace(track.header, name="y")).header.id)
        )
        if not any(column.is_wide for column in kind.columns):
            other = ChannelTrack(track.header)
            grown(draw, other, 3)
            track.replace_rows(2, 5, other.columns)
            yield said((track.generation, len(track))) + framed(track.frame(-9, 9999, 3, listed=9))
        fresh = ChannelTrack(track.header)
        fresh.take_columns(track.rows(0, 4))
        grown(draw, fresh, 2)
        yield framed(fresh.tail(0, len(fresh))) + said(fresh.column(kind.columns[-1].name))
        called: list[str] = []
        fresh.later = partial(called.append, "filled")
        yield said((len(fresh), len(fresh), called))
        whole = track.frame(0, 4000, 2400)
        (packed,) = packed_frames(whole.to_bytes())
        track.packed_whole = packed
        for asked in ((0, 4000, 2400), (1, 4000, 2400), (0, 3999, 2400), (0, 4000, 2399)):
            found = track.packed(*asked)
            yield said((isinstance(found, memoryview), zlib.crc32(found)))
        recording.dropped.add("b")
        yield said([one.id for one in recording.full_header.channels])
        yield said([framed(one)[:300] for one in recording.frames(20, 30)])
    levels = ChannelTrack(ChannelHeader(name="x", kind="levels"))
    levels.extend_levels([1, 2, 9], [0, 1, 0])
    yield said([tried(levels.append, 9, *cells) for cells in ((), (1,), (1, 1), (1, 1, 1))])
    plain = array("d")
    for values in ([math.nan, 2.0, math.nan], [3.0, 4.0], [math.nan, 5.0], [math.nan], [math.inf, -math.inf]):
        _extend_plain(plain, array("d", values))
        yield said([*plain])
    yield framed(levels.tail(0, 3))


class Control:
    """A run that is controlled, of which every call is noted."""

    def __init__(self, draw: random.Random) -> None:
        self.draw, self.calls = draw, list[str]()
        self.state, self.panel = RunState(), PanelState(name="p", choice="c", at_ns=1)

    def offer(self, command: RunCommand) -> bool:
        self.calls.append(said(command))
        return self.draw.random() < 0.8

    def offered(self, begun: str) -> Sequence[str]:
        return [begun + "x", begun + "y"]

    def look(self, panel: str, choice: str) -> PanelState | None:
        self.calls.append(f"look({panel}, {choice})")
        return self.panel if self.draw.random() < 0.7 else None


def drawn_request(draw: random.Random, channels: int) -> str:
    want = [draw.randrange(-1 if draw.random() < 0.1 else 0, channels + int(draw.random() < 0.1)) for _ in range(2)]
    begins = draw.choice((-5, 0, 30, 300))
    several: list[Any] = [
        {"want": want, "from_ns": begins, "to_ns": begins + draw.choice((-1, 0, 200)), "pixels": draw.choice((0, 1,
        30, 9999)),
         "id": draw.randrange(9)}, {"want": want}, {"want": want, "to_ns": 2**63 - 1}, {"want": want, "to_ns": 2**63},
        {"want": want, "from_ns": -(2**63)}, {"want": want, "from_ns": -(2**63) - 1}, {"want": want, "to_ns": True},
        {"want": want, "more": 1}, {"to_ns": 1}, {"want": "0"}, {"want": [0.5]}, {"want": [0] * 4096},
        {"want": [0] * 4097},
        {"looks": [["p", "c"], ["q", ""], ["p", "c"]]}, {"looks": [["p", "c"]] * 6}, {"looks": [["p", "c"]] * 7},
        {"looks": [["p"]]}, {"looks": "p"}, {"looks": [["p", 1]]}, {"looks": [["p", "a" * 400]]}, {"looks": [["p",
        "a" * 401]]},
        {"looks": [], "more": 1}, {"looks": []}, {"offer": "ab"}, {"offer": "a" * 400}, {"offer": "a" * 401},
        {"offer": 1},
        {"offer": "a", "more": 1}, {"do": "pause"}, {"do": "drive", "forward_mps": 0.5}, {"do": "drive"},
        {"do": "dance"},
        {"do": "drive", "turn_dps": -20}, {"do": "run", "at_ns": -1}, [], 3, None, "x" * 65_534, "x" * 65_535,
    ]  # fmt: skip
    return draw.choice(("{", "é", *map(json.dumps, several))) if draw.random() < 0.5 else json.dumps(several[0])


def sessions(draw: random.Random) -> Iterator[str]:  # noqa: C901, PLR0912 - a table of acts
    """Yield what pages are sent of a recording that grows, whatever they ask."""
    for is_live, control, may_control in (
        (True, Control(draw), True),
        (True, Control(draw), False),
        (False, None, False),
    ):
        recording = ViewRecording(PageHeader(title="a", end_ns=10, is_live=is_live))
        for kind in ("samples", "levels", "text"):
            recording.add(ChannelHeader(name=kind, kind=kind))

        def add(many: int) -> None:
            for track in recording.tracks:
                grown(draw, track, many)

        live: Any = LiveRecording(recording, add, most_waiting=3) if is_live else StillRecording(recording)
        live.control = control
        sessions = [PageSession(live, may_control=may_control) for _ in range(2)]
        now_s, now = 0.0, 0
        with patch.object(page_session, "MOST_NEWS", 20):
            for number in range(70):
                now_s += draw.choice((0.0, 0.02, 1.0))
                now += draw.randrange(40)
                if is_live:
                    match draw.randrange(9):
                        case 0 | 1 | 2 | 3:
                            live.offer(draw.choice((1, 8, 20, 21)), now, is_kept=draw.random() < 0.2)
                        case 4:
                            live.advance_to(now)
                        case 5:
                            live.report(
                                PageHeader(title="r", verdict=f"v{number}", standing="passed", lead="l", why="w")
                            )
                        case 6 if number > 60:
                            live.end(PageHeader(title="e", verdict="over"))
                        case 7:
                            recording.tracks[0].replace_rows(0, 0, ChannelTrack(recording.tracks[0].header).columns)
                        case 8 if draw.random() < 0.3:
                            recording.add(ChannelHeader(name=f"n{number}", kind="samples"))
                elif draw.random() < 0.1:
                    live.show([PageSection(title=f"s{number}", blocks=[PageText(text="t")])])
                if control is not None and draw.random() < 0.2:
                    control.state = RunState(head_ns=now)
                    control.panel = replace(control.panel, at_ns=number)
                session = draw.choice(sessions)
                text = drawn_request(draw, len(recording.tracks))
                yield f"{text[:120]} {refused(lambda: [*map(shown_as, session.receive(text, now_s))])}"
                yield said([*map(shown_as, session.news())])
                yield said(control and (control.calls, session._is_driving, session._lost))
                if control is not None:
                    control.calls.clear()
        for session in sessions:
            session.close()
        yield said(control and control.calls)
        flood = PageSession(live)
        yield said([refused(lambda: [*map(shown_as, flood.receive('{"want":[]}', 5.0))]) for _ in range(102)])
        yield said(
            [
                refused(lambda at=at: [*map(shown_as, flood.receive('{"want":[]}', at))])
                for at in (5.02, 5.03, 5.05, 7.0)
            ]
        )


def commands(draw: random.Random) -> Iterator[str]:
    numbers = (0, 1, -1, 2**62 - 1, 2**62, True, 1.5, "1", None)
    values: dict[str, Sequence[Any]] = {
        "at_ns": numbers, "number": numbers, "words": ("", "a" * 400, "a" * 401, "a\nb", 1), "future": ("", "f", 1),
        "robot": ("", "r", None), "speed": (0, 0.01, 0.0099, 1000, 1000.1, -1, True, "1"),
        "forward_mps": (2.0, -2.0, 2.01, -2.01, 0, True, "1"), "turn_dps": (360, -360, 360.1, -360.1, False),
        "unit": ("instruction", "line", "edge", "packet", "event", "millisecond", "hour", 1),
    }  # fmt: skip
    for do in (*COMMANDS, "dance", 1):
        yield refused(command_of, {"do": do})
        for key, several in values.items():
            for value in several:
                yield refused(command_of, {"do": do, key: value})
    yield refused(command_of, {}) + said(run_control.DRIVE_HOLD_NS)


def access(draw: random.Random) -> Iterator[str]:
    allowed = PageAccess(token="a" * 8, watch_token="b" * 8, names=frozenset({"lab-pc"}))
    hosts = ("127.0.0.1", "127.0.0.1:80", "[::1]:80", "::1", "localhost", "LocalHost:1", "lab-pc", "Lab-PC:9", "evil",
    "",
             "evil:80", "127.0.0.1:x", "127.0.0.1:99999", "a@127.0.0.1", "127.0.0.1/x", "127.0.0.1?x", "127.0.0.1#x",
             "[::1",
             "127.0.0.1.evil")  # fmt: skip
    for host in hosts:
        for name in (b"host", b"Host"):
            for origins in ((), (f"http://{host}",), (f"HTTP://{host}".upper(),), ("http://evil",), (f"https://{host}",),
                            (f"http://{host}", "null")):  # fmt: skip
                header = [(name, host.encode()), *((b"Origin", each.encode()) for each in origins)]
                yield said((host, origins, allowed.refusal(header)))
    yield said([allowed.refusal(header) for header in ([], [(b"host", b"localhost")] * 2, [(b"hosts", b"localhost")])])
    for given in ((), ("token.aaaaaaaa",), ("token.bbbbbbbb",), ("token.", "x"), ("token.aaaaaaaa", "token.aaaaaaaa"),
                  ("aaaaaaaa",), ("x", "token.bbbbbbbb"), ("token.é",)):  # fmt: skip
        yield said((given, allowed.role(given), replace(allowed, watch_token="").role(given)))


def pages(draw: random.Random) -> Iterator[str]:  # noqa: C901, PLR0915 - one conversation after the other
    """Yield what an application answers to browsers and to others."""
    recording = ViewRecording(PageHeader(title="a", end_ns=9))
    grown(draw, recording.add(ChannelHeader(name="s", kind="samples")), 4)
    application = app.ViewApp(StillRecording(recording), PageAccess(token="a" * 8, watch_token="b" * 8))

    async def asked(kind: str, path: str, incoming: Sequence[dict[str, Any]], **more: Any) -> list[str]:
        sent: list[str] = []
        waiting = [*incoming]

        async def receive() -> dict[str, Any]:
            while not waiting:
                await asyncio.Event().wait()
            found = dict(waiting.pop(0))
            behind = found.pop("behind", 0)
            while len(sent) < behind:  # noqa: ASYNC110 - what is awaited is the application's
                await asyncio.sleep(0)
            if (event := found.pop("event", None)) is not None:
                await event.wait()
            return found

        async def send(message: Any) -> None:
            shown = {key: value for key, value in message.items() if key != "bytes"}
            if message.get("bytes"):
                shown["frame"] = shown_as(message["bytes"])
            sent.append(
                said({key: short(value) if isinstance(value, bytes) else value for key, value in shown.items()})
            )

        scope = {"type": kind, "path": path, "headers": [(b"host", b"127.0.0.1:80")], "method": "GET",
        "query_string": b"",
                 "raw_path": path.encode(), "root_path": "", "scheme": "http", "http_version": "1.1",
                 **more}  # fmt: skip
        await application(scope, receive, send)
        return sent

    connect = {"type": "websocket.connect"}
    gone = {"type": "websocket.disconnect", "code": 1001}
    want = {"type": "websocket.receive", "text": '{"want":[0],"to_ns":9}'}
    good = {"subprotocols": [SUBPROTOCOL, "token.aaaaaaaa"]}

    async def all_asked() -> list[list[str]]:
        found: list[list[str]] = []
        with ExitStack() as acting:
            acting.enter_context(patch.object(app, "bundled", lambda name: f"the {name}"))
            acting.enter_context(patch.object(app, "filled", said))
            acting.enter_context(patch.object(app, "NEWS_S", 0.001))
            acting.enter_context(patch.object(app, "MOST_PAGES", 1))
            for path in ("/", "/bundle/page.js", "/bundle/page.css", "/bundle/scene.js", "/bundle/index.html", "/none"):
                found += [await asked("http", path, [{"type": "http.request"}])]
            evil = {"headers": [(b"host", b"evil")]}
            found.append(await asked("http", "/", [{"type": "http.request"}], **evil))
            found.append(await asked("websocket", "/stream", [connect], **evil))
            for protocols in ((), (SUBPROTOCOL,), ("token.aaaaaaaa",), (SUBPROTOCOL, "token.x")):
                found += [await asked("websocket", "/stream", [connect], subprotocols=protocols)]
            found.append(
                await asked("websocket", "/stream", [connect, dict(want, behind=2), dict(gone, behind=4)], **good)
            )
            found.append(
                await asked("websocket", "/stream", [connect, {"type": "websocket.receive", "text": "{"}], **good)
            )
            found.append(
                await asked("websocket", "/stream", [connect, {"type": "websocket.receive", "bytes": b"x"}], **good)
            )
            flood = {"type": "websocket.receive", "text": "x" * 70_000}
            found.append(await asked("websocket", "/stream", [connect, flood], **good))
            may_go = asyncio.Event()
            first = asyncio.create_task(asked("websocket", "/stream", [connect, dict(gone, event=may_go)], **good))
            while not application._pages:  # noqa: ASYNC110 - what is awaited is the application's
                await asyncio.sleep(0)
            found.append(await asked("websocket", "/stream", [connect], **good))
            found.append([str(application._pages)])
            may_go.set()
            await first
            found.append([str(application._pages)])
        return found

    for answers in asyncio.run(all_asked()):
        yield said(answers)


def servers(draw: random.Random) -> Iterator[str]:
    """Yield how a server binds and is set up, and what it says where it cannot."""
    calls: list[str] = []
    bound = Acted(calls, "socket", getsockname=[("127.0.0.1", 4321)] * 9)
    failing = Acted(calls, "socket", bind=[OSError(98, "Address already in use")] * 9)

    class Config:
        def __init__(self, _shown: object, **named: object) -> None:
            calls.append(said(named))

    def looked_up(*given: object, **named: object) -> list[Any]:
        calls.append(said((given, named)))
        return [(2, 1, 6, "", given[:2])]

    for control in (None, Control(draw)):
        source: Any = StillRecording(ViewRecording(PageHeader(title="a")))
        source.control = control
        for host, port in (("127.0.0.1", 0), ("::1", 80), ("Lab-PC", 80)):
            accesses: list[PageAccess] = []
            with ExitStack() as acting:
                acting.enter_context(patch.object(socket, "getaddrinfo", looked_up))
                acting.enter_context(patch.object(socket, "socket", Acted(calls, "", make=[bound, failing]).make))
                acting.enter_context(patch.object(uvicorn, "Config", Config))
                acting.enter_context(patch.object(uvicorn, "Server", lambda _: Acted(calls, "server")))
                tokens = iter(("t1", "t2"))
                acting.enter_context(patch.object(serving, "new_token", lambda tokens=tokens: next(tokens)))
                acting.enter_context(patch.object(serving, "ViewApp", lambda _, given, to=accesses: to.append(given)))
                server = serving.ViewServer(source, host, port)
                yield said((server.url, server.watch_url, server.port, accesses)) + taken(calls)
                yield tried(serving.ViewServer, source, host, port) + taken(calls)
                server.start()
                server.wait()
                server.close()
                yield said((server._server.should_exit, server._thread.daemon, server._thread.name)) + taken(calls)
    with patch.object(socket, "getaddrinfo", Acted(calls, "", ask=[socket.gaierror(-2, "Name not known")]).ask):
        yield tried(serving.ViewServer, source, "no.where", 1)
    with patch.object(socket, "getaddrinfo", Acted(calls, "", ask=[OSError("odd")]).ask):
        yield tried(serving.ViewServer, source, "no.where", 1)


def conversations(draw: random.Random) -> Iterator[str]:
    """Yield the channels of what goes over lines, recorded and watched."""
    found = open_recording(CAPTURE)
    yield said(found.full_header)
    for track in found.tracks:
        yield framed(track.frame(0, found.header.end_ns, 40, listed=40))
    packets = next(track for track in found.tracks if track.kind.name == "packets")
    columns = {column.name: values for column, values in zip(packets.kind.columns, packets.columns, strict=True)}
    again = PacketTexts("", *(columns[name] for name in ("to_robot", "data", "name", "is_bad")))  # type: ignore[arg-type]
    for row in range(len(packets)):
        says, fields = str(columns["says"][row]), str(columns["fields"][row])
        yield said((says, fields, again.says(row) == says or columns["is_bad"][row], again.fields(row) == fields))
    for robot, source, has_odometry in (("", "", True), ("p3dx-sh", "robot 1", False)):
        rows = CaptureTracks(ViewRecording(PageHeader(title="t")), robot, source, has_odometry=has_odometry)
        rows.take(drawn_chunks(draw))
        yield said(rows.recording.full_header)
        for track in rows.recording.tracks:
            yield framed(track.frame(0, 10**12, 999))
    with TemporaryDirectory() as folder, patch.object(targets, "installed_points", lambda _: {}):
        for name, text in (
            ("a.toml", "x"),
            ("b.jsonl", CAPTURE.read_text(encoding="utf-8")),
            ("c.jsonl", ""),
            ("d.bin", "no"),
        ):
            path = Path(folder, name)
            path.write_text(text, encoding="utf-8")
            yield tried(shown_target, path).replace(folder, "")
        yield (
            said(targets.capture_target(f"{folder}/none"))
            + tried(targets.target_of, "x")
            + tried(targets.served, None, "h", 1)
        )


def shown_target(path: Path) -> int | None:
    target = targets.capture_target(str(path))
    return None if target is None else len(target.source.recording.tracks)


def drawn_chunks(draw: random.Random) -> Iterator[Chunk]:
    """Yield bytes of both sides: packets with all that a robot may say, commands, and damage."""
    now = 0
    ended = bytes(3)
    for number in range(90):
        now += draw.choice((0, 10**6, 10**8))
        sip = bytes([draw.choice((0x32, 0x33)), *draw.randbytes(6), *draw.choice((b"\0\0\0\0", b"\x64\0\x9c\xff")),
                     draw.randrange(90, 130), *draw.choice(((0, 0), (1, 1), (3, 2), (0, 1))), 0, 0,
                     *draw.randbytes(2), draw.randrange(180), 2, 0, *draw.choice((b"\x10\x27", b"\xf4\x01")),
                     draw.randrange(9), *draw.randbytes(2), 1, *draw.randbytes(3), *ended])  # fmt: skip
        to_robot = draw.random() < 0.3
        command = Command(draw.choice((C.OPEN, C.ENABLE, C.VEL, C.CLOSE, C.E_STOP, C.PULSE)), draw.choice((None, 1)))
        data = command.to_frame().to_bytes() if to_robot else Frame(sip).to_bytes()
        if number == 3:
            data = Frame(b"\2Name\0Pioneer\0p2dx\0").to_bytes()
        if number == 50:
            data = Frame(b"\2Name\0Pioneer\0p3at\0").to_bytes()
        if draw.random() < 0.1:
            data = data[:-1] + bytes((data[-1] ^ 1,)) + b"\0\1"
        yield Chunk(at_ns=now, direction=Direction.TO_ROBOT if to_robot else Direction.FROM_ROBOT, data=data)
    yield Chunk(at_ns=now + 1, direction=Direction.TO_ROBOT, data=Command(C.VEL, 300).to_frame().to_bytes()[:-2])


def watched(draw: random.Random) -> Iterator[str]:
    """Yield what lines and robots hand over to a page that watches them."""
    calls: list[str] = []
    line = Acted(calls, "line", read=[b"abc", b"", b"d"], fileno=[7])
    line.__dict__["description"] = "tcp:a:1"
    now = [1000]
    conversation = WatchedConversation("t", "p2dx", lambda: now[0])
    seen = conversation.watched(line)  # type: ignore[arg-type]
    now[0] += 50
    yield said((seen.description, [seen.read() for _ in range(3)], seen.fileno()))
    seen.write(Command(C.VEL, 300).to_frame().to_bytes())
    seen.write(b"")
    seen.set_baud(9600)
    seen.close()
    conversation.source.update()
    yield taken(calls) + said(conversation.source.recording.full_header)
    yield said([framed(track.frame(0, 999, 99)) for track in conversation.source.recording.tracks])
    listener = Acted(calls, "listener", accept=[None, line], fileno=[8])
    listener.__dict__ |= {"description": "tcp:b:2", "poll_s": 0.5}
    heard: list[str] = []
    place = WatchedListener(listener, lambda direction, data: heard.append(f"{direction.name} {data.hex()}"))  # type: ignore[arg-type]
    yield said((place.description, place.poll_s, place.accept(), place.fileno()))
    line._answers["read"] = [b"x"]
    came = place.accept()
    assert isinstance(came, WatchedLine)
    came.read()
    came.write(b"y")
    place.close()
    yield said(heard) + taken(calls)
    for count in (1, 2):
        world = load_world("room")
        served = ServedRobots("t", world, [P2DX] * count)
        for number in range(count):
            state = BodyState(
                x_m=1.0, y_m=2.0, heading_rad=0.5, z_m=0.1, pitch_rad=0.2, left_speed_mps=0.3, right_speed_mps=0.4
            )
            served.sample(number, state, 5)
            served.bytes_of(number, Direction.TO_ROBOT, Command(C.OPEN).to_frame().to_bytes(), 6)
            served.event(number, 7, "what", "detail")
        served.source.update()
        yield said(served.source.recording.full_header)
        yield said([framed(track.frame(0, 999, 99)) for track in served.source.recording.tracks])
    for plan in ({}, {"name": "w", "extent": (0, 1, 2, 3), "obstacles": [
        {"name": "a", "x": 1, "y": 2}, {"name": "b", "x": 1, "y": 2, "shape": "cylinder", "kind": "post", "heading": 1,
         "height": 2, "length": 3, "width": 4, "radius": 5}]}):  # fmt: skip
        yield said(world_of(plan))


def documents(draw: random.Random) -> Iterator[str]:
    """Yield pages as one file, without what is in the bundle."""
    parts = {page.PAGE: "".join(f"[<!--{name}-->]" for name in ("csp", "title", "style", "data", "script"))}
    with (
        patch.object(page, "bundled", lambda name: parts.get(name, f"the {name}")),
        patch.object(gzip, "compress", lambda data, mtime: data if mtime == 0 else b""),
    ):
        for title, verdict, has_world, rows in (("a < b", "", False, 0), ("</script>\u2028\u2029", "failed", True, 3)):
            world = world_of({}) if has_world else None
            header = PageHeader(title=title, verdict=verdict, end_ns=9999, world=world, left_out=("before",))
            recording = ViewRecording(header)
            for name, kind in (("s", "samples"), ("t", "text"), ("u", "text")) if rows else ():
                grown(draw, recording.add(ChannelHeader(name=name, kind=kind)), rows)
            made = page.page_of(recording, all_is_in="the folder")
            yield made.partition('id="frames"')[0]
            yield said((zlib.crc32(made.encode()), page.header_in(made) == replace(recording.full_header)))
            yield said(page.header_in(made))
            yield page.document(header)
        yield page.filled({"title": "<!--data-->", "data": "d"})
    for text in (
        "",
        "x",
        '<script type="application/json" id="header">{',
        '<script type="application/json" id="header">{</script>',
    ):
        yield tried(page.header_in, text).partition(":")[0]
    channels = [ChannelHeader(name=name, kind="text", id=number) for number, name in enumerate("abc")]
    for counts in ((1, 1, 1), (1, 2, 1), (2, 2, 1), (3, 3, 3)):
        several = [
            ViewFrame(kind=BY_NAME["text"], channel=number, columns=(array("q", [1]), array("B", [1]), ["x"]),
            from_ns=0,
                      to_ns=1, of=of)
            for number, of in enumerate(counts)
        ]  # fmt: skip
        for where in ("", "the folder"):
            yield said([*page.left_out(PageHeader(title="t", channels=channels), several, where)])


TRACES: dict[str, Trace] = {
    each.__name__: each
    for each in (
        frames, spans, tracks, sessions, commands, access, pages, servers, conversations, watched, documents,
    )
}  # fmt: skip
TRACES["declared"] = declared_of("p2os.view", "p2os.view.server")
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
