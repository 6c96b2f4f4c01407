"""What a page is sent: what it asks for, and what is new; anything else is refused."""

import contextlib
import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.view.frames import FrameFlags, ViewFrame
from p2os.view.header import ChannelHeader, PageHeader, PanelState
from p2os.view.live import LiveRecording, StillRecording
from p2os.view.recording import ViewRecording
from p2os.view.run_control import COMMANDS, RunCommand, RunState
from p2os.view.server import page_session
from p2os.view.server.page_session import (
    LARGEST_REQUEST_BYTES,
    MOST_AT_ONCE,
    FloodError,
    PageSession,
    RequestError,
)

SECOND = 10**9


def recording(rows: int = 10) -> ViewRecording:
    found = ViewRecording(PageHeader(title="a", end_ns=rows * SECOND))
    samples = found.add(ChannelHeader(name="s", kind="samples"))
    levels = found.add(ChannelHeader(name="l", kind="levels"))
    for n in range(rows):
        samples.append(n * SECOND, float(n))
        levels.append(n * SECOND, n % 2, 1)
    return found


def asked(session: PageSession, now_s: float = 0.0, **wanted: Any) -> tuple[list[ViewFrame], list[dict[str, Any]]]:
    """Return the frames and the texts of an answer."""
    return sent_of(session.receive(json.dumps(wanted), now_s))


def sent_of(messages: Any) -> tuple[list[ViewFrame], list[dict[str, Any]]]:
    found = list(messages)
    return (
        [ViewFrame.from_bytes(one) for one in found if isinstance(one, bytes)],
        [json.loads(one) for one in found if isinstance(one, str)],
    )


def test_a_request_is_answered_with_a_frame_a_channel_and_done() -> None:
    session = PageSession(StillRecording(recording()))
    frames, texts = asked(session, want=[1, 0, 1], from_ns=2 * SECOND, to_ns=4 * SECOND, pixels=100, id=7)
    assert [frame.channel for frame in frames] == [1, 0]
    assert list(frames[1].columns[1]) == [2.0, 3.0, 4.0, 5.0], "and the first behind"
    assert texts == [{"done": 7}]
    frames, _ = asked(session, want=[0], from_ns=2 * SECOND + 1, to_ns=2 * SECOND + 2)
    assert list(frames[0].columns[1]) == [2.0, 3.0], "what is in force, and the next"


def test_the_header_comes_first_and_once() -> None:
    session = PageSession(StillRecording(recording()))
    _, texts = sent_of(session.news())
    assert [channel["name"] for channel in texts[0]["header"]["channels"]] == ["s", "l"]
    assert sent_of(session.news()) == ([], [])


def test_many_rows_are_thinned_to_the_pixels_and_say_so() -> None:
    session = PageSession(StillRecording(recording(10_000)))
    frames, _ = asked(session, want=[0, 1], to_ns=10_000 * SECOND, pixels=50)
    for frame in frames:
        assert frame.flags & FrameFlags.REDUCED
        assert (frame.count <= 4 * 51, frame.of) == (True, 10_000)
    assert sum(frames[1].columns[2]) == 10_000  # type: ignore[arg-type]  # numbers


def test_of_a_recording_that_grows_new_rows_of_what_was_asked_for_follow() -> None:
    grown = recording(2)
    live: LiveRecording[int] = LiveRecording(grown, lambda n: grown.tracks[0].append(n * SECOND, float(n)))
    session = PageSession(live)
    sent_of(session.news())
    live.offer(2, 2 * SECOND)
    assert sent_of(session.news()) == ([], []), "nobody has asked"
    asked(session, want=[0], to_ns=2 * SECOND)
    live.offer(3, 3 * SECOND)
    live.offer(4, 4 * SECOND)
    frames, texts = sent_of(session.news())
    assert [list(frame.columns[0]) for frame in frames] == [[3 * SECOND, 4 * SECOND]]
    assert texts == [{"now_ns": 4 * SECOND}]
    live.end()
    _, texts = sent_of(session.news())
    assert texts[0]["header"]["is_live"] is False


def test_a_page_that_is_too_slow_is_told_what_it_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page_session, "MOST_NEWS", 5)
    grown = recording(1)
    live: LiveRecording[int] = LiveRecording(grown, lambda n: grown.tracks[0].append(n * SECOND, float(n)))
    session = PageSession(live)
    asked(session, want=[0])
    for count, lost in ((5, None), (6, 6)):
        for n in range(count):
            live.offer(n, n * SECOND)
        frames, texts = sent_of(session.news())
        assert [len(frame.columns[0]) for frame in frames] == ([] if lost else [5])
        assert [text["lost"] for text in texts if "lost" in text] == ([lost] if lost else [])


def test_what_finds_no_room_before_it_is_shown_is_counted_and_said() -> None:
    grown = recording(1)
    live: LiveRecording[int] = LiveRecording(grown, lambda n: grown.tracks[0].append(n, 0.0), most_waiting=3)
    for n in range(5):
        live.offer(n, n)
    live.update()
    assert len(grown.tracks[0]) == 1 + 3
    assert grown.header.left_out == ("2 events: the program was faster than this page",)


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "[]", "null", "3", '"want"', "{}", '{"want": 0}', '{"want": [true]}', '{"want": [0.5]}',
        '{"want": ["0"]}',
        '{"want": [], "to_ns": 1e3}', '{"want": [], "id": null}', '{"want": [], "more": 1}',
        '{"want": [], "to_ns": 9223372036854775808}', '{"want": [], "to_ns": NaN}', "[" * 60_000,
        json.dumps({"want": [0] * 4097}),
    ],
)  # fmt: skip
def test_what_is_no_request_is_refused(text: str) -> None:
    with pytest.raises(RequestError):
        list(PageSession(StillRecording(recording())).receive(text, 0.0))


KEYS = st.sampled_from(["want", "from_ns", "to_ns", "id", "x"])
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner),
)


@given(st.text(max_size=80) | VALUES.map(json.dumps))
def test_whatever_comes_is_answered_or_refused(text: str) -> None:
    source = recording()
    session = PageSession(StillRecording(source))
    with contextlib.suppress(RequestError):
        list(session.receive(text, 0.0))
    assert len(source.tracks[0]) == 10


@pytest.mark.parametrize("channel", [-1, 2, 2**40])
def test_a_channel_that_is_not_there_is_refused_in_words(channel: int) -> None:
    _, texts = asked(PageSession(StillRecording(recording())), want=[0, channel], id=3)
    assert texts == [{"done": 3, "refused": f"there is no channel {channel}"}]


def test_a_stretch_that_ends_before_it_begins_is_refused_in_words() -> None:
    _, texts = asked(PageSession(StillRecording(recording())), want=[0], from_ns=1, to_ns=0, id=3)
    assert texts == [{"done": 3, "refused": "from_ns is behind to_ns"}]


@pytest.mark.parametrize(("pixels", "rows"), [(0, 4), (-5, 4), (1, 4), (10**9, 100)])
def test_pixels_are_taken_as_many_as_a_screen_may_have(pixels: int, rows: int) -> None:
    frames, _ = asked(PageSession(StillRecording(recording(100))), want=[0], to_ns=100 * SECOND, pixels=pixels)
    assert 2 <= frames[0].count <= rows


def test_a_request_that_is_too_long_is_a_flood() -> None:
    text = '{"want": []}'
    session = PageSession(StillRecording(recording()))
    assert list(session.receive(text.ljust(LARGEST_REQUEST_BYTES), 0.0))
    with pytest.raises(FloodError):
        list(session.receive(text.ljust(LARGEST_REQUEST_BYTES + 1), 0.0))


def test_more_requests_than_a_person_makes_are_a_flood() -> None:
    session = PageSession(StillRecording(recording()))
    for _ in range(MOST_AT_ONCE):
        asked(session, 10.0, want=[])
    with pytest.raises(FloodError):
        asked(session, 10.0, want=[])
    patient = PageSession(StillRecording(recording()))
    for n in range(3 * MOST_AT_ONCE):
        asked(patient, n / 50, want=[])


class Run:
    """A run that takes so many commands."""

    def __init__(self, room: int = 99) -> None:
        self.state, self.taken, self._room = RunState(), list[RunCommand](), room
        self.panels = dict[tuple[str, str], PanelState]()

    def look(self, panel: str, choice: str) -> PanelState | None:
        return self.panels.get((panel, choice))

    def offer(self, command: RunCommand) -> bool:
        if len(self.taken) >= self._room:
            return False
        self.taken.append(command)
        return True

    def offered(self, begun: str) -> list[str]:
        return [f"{begun}.speed"]


def controlled(run: Run | None, *, may_control: bool = True) -> PageSession:
    source = StillRecording(recording())
    source.control = run
    return PageSession(source, may_control=may_control)


def test_a_page_is_told_how_the_run_stands_when_that_changes_and_at_first_what_it_may() -> None:
    run = Run()
    session = controlled(run)
    _, texts = sent_of(session.news())
    assert (texts[1]["run"]["head_ns"], texts[1]["may_control"]) == (0, True)
    assert sent_of(session.news()) == ([], [])
    run.state = RunState(head_ns=7, why="paused")
    _, texts = sent_of(session.news())
    assert (texts[0]["run"]["why"], "may_control" in texts[0]) == ("paused", False)


def test_a_command_is_handed_to_the_run_and_rows_are_served_beside() -> None:
    run = Run()
    session = controlled(run)
    assert asked(session, do="step", unit="edge", at_ns=5, words="PB7") == ([], [])
    assert run.taken == [RunCommand(do="step", unit="edge", at_ns=5, words="PB7")]
    assert len(asked(session, want=[0])[0]) == 1


def test_who_may_only_look_on_controls_nothing() -> None:
    run = Run()
    _, texts = asked(controlled(run, may_control=False), do="pause")
    assert (texts, run.taken) == ([{"refused": "this link is for looking on"}], [])
    assert asked(controlled(None), do="pause")[1] == [{"refused": "there is no run to control"}]
    assert asked(controlled(Run(0)), do="pause")[1] == [{"refused": "too many commands wait"}]


def test_what_a_page_drives_stands_when_it_is_gone() -> None:
    run = Run()
    session = controlled(run)
    session.close()
    assert run.taken == [], "it has not driven"
    asked(session, do="drive", forward_mps=-2, turn_dps=360)
    session.close()
    session.close()
    assert run.taken[1:] == [RunCommand(do="drive")]
    asked(session, do="drive", forward_mps=0.1)
    asked(session, do="drive", forward_mps=0)
    session.close()
    assert len(run.taken) == 4, "it stands already"
    watching = controlled(run, may_control=False)
    asked(watching, do="drive", forward_mps=0.1)
    watching.close()
    assert len(run.taken) == 4
    full = Run(1)
    refused = controlled(full)
    asked(refused, do="pause")
    asked(refused, do="drive", forward_mps=0.1)
    refused.close()
    assert full.taken == [RunCommand(do="pause")]


@pytest.mark.parametrize(
    "sent",
    [
        {"do": "format"}, {"do": 1}, {"do": None}, {"do": ["run"]}, {"do": "pause", "at_ns": 1},
        {"do": "go", "at_ns": -1},
        {"do": "go", "at_ns": 1.5}, {"do": "go", "at_ns": 2**62}, {"do": "go", "at_ns": True},
        {"do": "step", "unit": "year"},
        {"do": "speed", "speed": 0.001}, {"do": "speed", "speed": 1001}, {"do": "speed", "speed": "fast"},
        {"do": "speed", "speed": -1}, {"do": "speed", "speed": True}, {"do": "halt_at", "words": "x" * 401},
        {"do": "halt_at", "words": "a\nb"}, {"do": "halt_at", "words": 1}, {"do": "run", "want": [0]},
        {"do": "halt_not_at", "number": "1"}, {"do": "choose", "future": None},
        {"do": "drive", "forward_mps": 2.1}, {"do": "drive", "turn_dps": -361}, {"do": "drive", "turn_dps": "1"},
        {"do": "drive", "at_ns": 1}, {"do": "drive", "forward_mps": True}, {"do": "drive", "forward_mps": float("nan")},
        {"do": "drive", "forward_mps": float("inf")}, {"do": "hand", "words": "a\nb"}, {"do": "hand", "speed": 1},
    ],
)  # fmt: skip
def test_what_is_no_command_ends_the_page(sent: dict[str, Any]) -> None:
    run = Run()
    with pytest.raises(RequestError):
        asked(controlled(run), **sent)
    assert run.taken == []


def test_speeds_at_their_bounds_are_taken() -> None:
    run = Run()
    session = controlled(run)
    for speed in (0, 0.01, 1000):
        asked(session, do="speed", speed=speed)
    assert [one.speed for one in run.taken] == [0, 0.01, 1000]


_ANY = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.lists(st.integers())


@given(st.dictionaries(st.sampled_from(["do", "at_ns", "unit", "speed", "words", "number", "turn_dps", "x"]), _ANY))
def test_anything_at_all_is_a_command_or_refused(sent: dict[str, Any]) -> None:
    run = Run()
    with contextlib.suppress(RequestError):
        asked(controlled(run), **{"do": "run", **sent})
    assert all(COMMANDS[one.do] is not None for one in run.taken)


def test_names_are_offered_for_what_is_typed_and_to_who_looks_on_too() -> None:
    session = controlled(Run(), may_control=False)
    assert sent_of(session.receive('{"offer": "mot"}', 0.0))[1] == [{"offered": ["mot.speed"]}]
    assert sent_of(controlled(None).receive('{"offer": "mot"}', 0.0))[1] == [{"offered": []}]
    for text in ('{"offer": 1}', '{"offer": "x", "id": 1}', json.dumps({"offer": "x" * 401})):
        with pytest.raises(RequestError, match="offer is a text"):
            list(session.receive(text, 0.0))


def test_a_channel_whose_rows_were_made_anew_is_sent_whole_and_then_goes_on() -> None:
    shown = recording(rows=4)
    shown.header = replace(shown.header, is_live=True)
    session = PageSession(StillRecording(shown))
    asked(session, want=[0], to_ns=2**62)
    track = next(one for one in shown.tracks if one.header.id == 0)
    track.replace_rows(1, 2, track.rows(1, 2))
    (frame,), _ = sent_of(session.news())
    assert (frame.flags & FrameFlags.REPLACES, frame.count, frame.to_ns) == (FrameFlags.REPLACES, 4, 2**62)
    assert sent_of(session.news())[0] == []


def test_a_panel_that_is_looked_at_is_sent_when_it_shows_something_else() -> None:
    run = Run()
    session = controlled(run, may_control=False)
    list(session.news())
    assert list(session.receive('{"looks": [["chip", "USART1"], ["board", ""]]}', 0.0)) == []
    assert sent_of(session.news())[1] == []
    run.panels["chip", "USART1"] = PanelState(name="chip", choice="USART1", at_ns=5)
    assert sent_of(session.news())[1] == [{"panel": {"name": "chip", "choice": "USART1", "at_ns": 5, "sections": []}}]
    assert sent_of(session.news())[1] == []
    list(session.receive('{"looks": []}', 0.0))
    run.panels["chip", "USART1"] = PanelState(name="chip", choice="USART1", at_ns=6)
    assert sent_of(session.news())[1] == []


@given(
    st.recursive(
        st.none() | st.integers() | st.text(max_size=3), lambda inner: st.lists(inner, max_size=8), max_leaves=12
    )
)
def test_anything_at_all_is_looked_at_or_refused(looks: object) -> None:
    session = controlled(Run())
    with contextlib.suppress(RequestError):
        list(session.receive(json.dumps({"looks": looks}), 0.0))
        list(session.news())
    for more in ({"looks": [], "id": 1}, {"looks": [["x", "y"]] * 7}, {"looks": [["x", "y" * 401]]}):
        with pytest.raises(RequestError, match="looks are"):
            list(session.receive(json.dumps(more), 0.0))
