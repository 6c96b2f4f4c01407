"""One page that looks at a recording: what it asks for, and what it is sent; passive.

A page asks for rows of channels within a time (`Wanted`), and gets a frame for each and `done`. Of a recording that
grows it is then told the new rows of these channels, as they come. There is no queue: what is new is what lies between
the row that was sent last and the last one, so that a page that is slow is sent more at once; of more than
`MOST_NEWS` rows it is told that they are lost to it, and asks anew.

A page whose link may control sends commands, too; they are handed to the run and answered by its state.

Invariant: a request is answered, or refused in words; nothing that a page sends changes the recording.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields, replace
from typing import cast

from p2os.view.channels import WHOLE_PIXELS
from p2os.view.frames import FrameFlags
from p2os.view.header import Answered, PageHeader, PanelState, Wanted
from p2os.view.live import ShownSource
from p2os.view.recording import ViewRecording
from p2os.view.run_control import MOST_LETTERS, CommandError, RunCommand, RunState, command_of
from simbase.timing import Nanos

#: chosen: a page's request has less than a kilobyte.
LARGEST_REQUEST_BYTES = 65_536
MOST_CHANNELS, MOST_PIXELS = 4096, 8192
#: chosen: more panels than a screen has room for.
MOST_PANELS = 6
#: The end of rows that go on, as the page has it.
OPEN_END_NS = 2**62
#: chosen: new rows of a channel that are sent at once.
MOST_NEWS = 20_000
#: chosen: a page asks some ten times a second while one drags; so many in a row, and so many a second.
MOST_AT_ONCE, A_SECOND = 100, 50.0
_LEAST_NS, _MOST_NS = -(2**63), 2**63 - 1


class RequestError(Exception):
    """What a page sends is no request; it is not served any more."""


class FloodError(RequestError):
    """A page asks more often, or for more, than any does that a person uses."""


class PageSession:
    """What one page was sent.

    Args:
        source: What it looks at.
        may_control: Whether its link lets it control a run, too.
    """

    def __init__(self, source: ShownSource, *, may_control: bool = False) -> None:
        self._source, self._may_control = source, may_control
        self._state: RunState | None = None
        #: Channel → the row behind the last that was sent.
        self._sent: dict[int, int] = {}
        #: Channel → how often its rows had been made anew by then.
        self._generations: dict[int, int] = {}
        #: What was said last; of channels, how many.
        self._header: PageHeader | None = None
        self._channels = 0
        self._lost = 0
        #: Whether it drives the robot, as far as it has said.
        self._is_driving = False
        #: The panels that are looked at, each with what of it, and what it showed last.
        self._looks: dict[tuple[str, str], PanelState | None] = {}
        self._room, self._asked_at = float(MOST_AT_ONCE), 0.0

    @property
    def _recording(self) -> ViewRecording:
        return self._source.recording

    def news(self) -> Iterator[str | bytes | memoryview]:
        """Yield what has changed since the last call: the header, new rows, the time; at the first call the header."""
        control = self._source.control
        # As it stood before: the rows that it is about are there then.
        state = None if control is None else control.state
        self._source.update()
        yield from self._changed_header()
        lost = 0
        for channel, row in self._sent.items():
            track = self._recording.tracks[channel]
            end = len(track)
            if track.generation != self._generations.get(channel, 0):
                self._generations[channel] = track.generation
                yield track.frame(0, OPEN_END_NS, WHOLE_PIXELS, flags=FrameFlags.REPLACES).to_bytes()
            elif end - row > MOST_NEWS:
                lost += end - row
            elif end > row:
                yield track.tail(row, end).to_bytes()
            self._sent[channel] = end
        if lost:
            self._lost += lost
            yield _said(lost=self._lost)
        for look, last in self._looks.items():
            panel = None if control is None else control.look(*look)
            if panel is not last and panel is not None:
                self._looks[look] = panel
                yield _said(panel=panel)
        if state is not self._state:
            is_first, self._state = self._state is None, state
            yield _said(run=state, may_control=self._may_control if is_first else None)

    def _changed_header(self) -> Iterator[str]:
        header, channels = self._recording.header, len(self._recording.tracks)
        old, self._header = self._header, header
        had, self._channels = self._channels, channels
        if old is None or channels != had or replace(old, end_ns=header.end_ns) != header:
            yield _said(header=self._recording.full_header)
        elif header.end_ns != old.end_ns:
            yield _said(now_ns=header.end_ns)

    def close(self) -> None:
        """Take that the page is gone: what it drove stands."""
        control = self._source.control
        if self._is_driving and control is not None:
            self._is_driving = False
            control.offer(RunCommand(do="drive"))

    def receive(self, text: str, now_s: float) -> Iterator[str | bytes | memoryview]:
        """Yield the answer to a request.

        Args:
            text: As it came.
            now_s: Of any clock that goes on; requests are counted by it.

        Raises:
            RequestError: It is none, or one of too many.
        """
        self._count(now_s)
        found = _json_of(text)
        if "looks" in found:
            self._look(found)
            return
        if "offer" in found:
            yield self._offered(found)
            return
        if "do" in found:
            yield from self._command(found)
            return
        wanted = _wanted_of(found)
        if wanted.from_ns > wanted.to_ns:
            yield _said(refused="from_ns is behind to_ns", done=wanted.id)
            return
        unknown = [channel for channel in wanted.want if not 0 <= channel < len(self._recording.tracks)]
        if unknown:
            yield _said(refused=f"there is no channel {unknown[0]}", done=wanted.id)
            return
        for channel in dict.fromkeys(wanted.want):
            track = self._recording.tracks[channel]
            yield track.packed(wanted.from_ns, wanted.to_ns, wanted.pixels)
            if self._recording.header.is_live:
                self._sent[channel], self._generations[channel] = len(track), track.generation
        yield _said(done=wanted.id)

    def _command(self, found: Mapping[str, object]) -> Iterator[str]:
        try:
            command = command_of(found)
        except CommandError as error:
            raise RequestError(str(error)) from error
        control = self._source.control
        if control is None:
            yield _said(refused="there is no run to control")
        elif not self._may_control:
            yield _said(refused="this link is for looking on")
        elif not control.offer(command):
            yield _said(refused="too many commands wait")
        elif command.do == "drive":
            self._is_driving = bool(command.forward_mps or command.turn_dps)

    def _look(self, found: Mapping[str, object]) -> None:
        """Take which panels are looked at from now on, each with what of it."""
        looks = found["looks"]
        if len(found) != 1 or not isinstance(looks, list) or len(looks) > MOST_PANELS or not all(map(_is_look, looks)):
            raise RequestError(f"looks are at most {MOST_PANELS} pairs of a panel's name and a choice, and alone")
        self._looks = dict.fromkeys([(str(panel), str(choice)) for panel, choice in looks])

    def _offered(self, found: Mapping[str, object]) -> str:
        """Answer what a name of a variable may be that begins so."""
        begun = found["offer"]
        if len(found) != 1 or not isinstance(begun, str) or len(begun) > MOST_LETTERS:
            raise RequestError(f"offer is a text of at most {MOST_LETTERS} letters, and alone")
        control = self._source.control
        return _said(offered=() if control is None else control.offered(begun))

    def _count(self, now_s: float) -> None:
        self._room = min(MOST_AT_ONCE, self._room + (now_s - self._asked_at) * A_SECOND) - 1.0
        self._asked_at = now_s
        if self._room < 0:
            raise FloodError(f"more than {A_SECOND:.0f} requests a second")


def _said(
    *,
    header: PageHeader | None = None,
    done: int | None = None,
    lost: int | None = None,
    now_ns: Nanos | None = None,
    refused: str | None = None,
    run: RunState | None = None,
    may_control: bool | None = None,
    offered: Sequence[str] | None = None,
    panel: PanelState | None = None,
) -> str:
    """Return an answer as JSON, without what it does not say."""
    answer = asdict(Answered(
        header=header, done=done, lost=lost, now_ns=now_ns, refused=refused, run=run, may_control=may_control,
        offered=offered, panel=panel,
    ))  # fmt: skip
    said = {key: value for key, value in answer.items() if value is not None}
    return json.dumps(said, ensure_ascii=False, separators=(",", ":"), allow_nan=False)


def _is_look(found: object) -> bool:
    return (
        isinstance(found, list)
        and len(found) == 2
        and all(isinstance(one, str) and len(one) <= MOST_LETTERS for one in found)
    )


_KEYS = frozenset(field.name for field in fields(Wanted))


def _json_of(text: str) -> dict[str, object]:
    """Return what a page has sent.

    Raises:
        RequestError: It is no object.
    """
    if len(text.encode("utf-8", "replace")) > LARGEST_REQUEST_BYTES:
        raise FloodError(f"a request of more than {LARGEST_REQUEST_BYTES} bytes")
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RequestError("a request that is no JSON") from error
    if not isinstance(found, dict):
        raise RequestError("a request is a JSON object")
    return found


def _wanted_of(found: dict[str, object]) -> Wanted:
    """Return a request for rows.

    Raises:
        RequestError: It is none.
    """
    if not found.keys() <= _KEYS or "want" not in found:
        raise RequestError(f"a request has {', '.join(sorted(_KEYS))}")
    want = found["want"]
    if not isinstance(want, list) or len(want) > MOST_CHANNELS or not all(type(one) is int for one in want):
        raise RequestError(f"want is a list of at most {MOST_CHANNELS} numbers of channels")
    numbers = {key: value for key, value in found.items() if key != "want"}
    if not all(type(value) is int and _LEAST_NS <= value <= _MOST_NS for value in numbers.values()):
        raise RequestError("a time, pixels and id are whole numbers of 64 bits")
    wanted = Wanted(want=tuple(want), **cast("dict[str, int]", numbers))
    return replace(wanted, pixels=max(1, min(MOST_PIXELS, wanted.pixels)))
