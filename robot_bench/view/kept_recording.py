"""A long run as its page shows it, kept beside its trace: opened again without reading the trace.

The file is a line of JSON, the header as another one, then frames (`p2os.view.frames`): of all rows, one a channel, and
as many of what a page shows of the whole run at first, which are sent as they stand. The line says of which trace they
were made and by which version, and has the SHA-256 of all behind it. What packets say is left out of all rows: it
follows from their bytes. Rows of a channel are unpacked when somebody looks closer.

Invariant: what is read equals what was kept, or nothing is read; a run without this file is shown alike.
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, cast

import simbase
from p2os.json_record import of_json
from p2os.view.channels import WHOLE_PIXELS
from p2os.view.frames import ColumnValues, FrameError, LaterText, LaterTexts, PackedFrame, ViewFrame, packed_frames
from p2os.view.header import PageHeader, PageSection
from p2os.view.recording import ChannelTrack, ViewRecording
from robot_bench.recording.run_folder import KEPT_NAME, TRACE_NAME, VARIABLES_NAME
from simbase.errors import P2osError
from simbase.files import read_bytes, sha256_of

#: Changes when other rows are made of the same trace.
_FORMAT = 2
#: chosen: a trace of so many bytes is read in half a second.
LEAST_BYTES = 4_000_000


def is_long(folder: Path) -> bool:
    """Tell whether a run's trace is so long that its recording is kept."""
    return (folder / TRACE_NAME).stat().st_size >= LEAST_BYTES


def keep(recording: ViewRecording, folder: Path, sections: Sequence[PageSection] | None = None) -> bool:
    """Keep a run's recording in its folder.

    Args:
        recording: All of it.
        folder: The run's.
        sections: Of its report; None: those of the recording.

    Returns:
        Whether it was kept: a folder that cannot be written stays as it is.
    """
    full = recording.full_header if sections is None else replace(recording.full_header, sections=sections)
    header = json.dumps(full.as_json(), ensure_ascii=False, allow_nan=False).encode()
    body = b"".join((header, b"\n", *(frame.to_bytes() for frame in chain(_frames(recording), _wholes(recording)))))
    line = json.dumps({**_made_of(folder), "sha256": hashlib.sha256(body).hexdigest()})
    try:
        (folder / KEPT_NAME).write_bytes(line.encode() + b"\n" + body)
    except OSError:
        return False
    return True


def kept(folder: Path) -> ViewRecording | None:
    """Return what was kept of a run; None where nothing was, or it is of another trace or version, or damaged."""
    path = folder / KEPT_NAME
    if not path.is_file():
        return None
    try:
        data = read_bytes(path)
        line_end = data.index(b"\n")
        if json.loads(data[:line_end]) != {**_made_of(folder), "sha256": _sha256_behind(data, line_end)}:
            return None
        head_end = data.index(b"\n", line_end + 1)
        header = cast("PageHeader", of_json(PageHeader, json.loads(data[line_end + 1 : head_end])))
        return _recording(header, list(packed_frames(memoryview(data)[head_end + 1 :])))
    except (P2osError, ValueError, KeyError, TypeError, IndexError, RecursionError):  # FrameError is a P2osError
        return None


def _made_of(folder: Path) -> dict[str, object]:
    """Return what has to be alike for rows to be those of a trace."""
    variables = folder / VARIABLES_NAME
    return {
        "kept": _FORMAT, "version": simbase.__version__, "trace": sha256_of(folder / TRACE_NAME),
        "variables": sha256_of(variables) if variables.is_file() else "",
    }  # fmt: skip


def _sha256_behind(data: bytes, line_end: int) -> str:
    return hashlib.sha256(memoryview(data)[line_end + 1 :]).hexdigest()


def _wholes(recording: ViewRecording) -> Iterator[ViewFrame]:
    """Yield what a page asks for when it shows a run at first."""
    start, end = recording.header.start_ns, recording.header.end_ns
    for track in recording.tracks:
        yield track.frame(start, end, WHOLE_PIXELS)


def _frames(recording: ViewRecording) -> Iterator[ViewFrame]:
    end_ns = recording.header.end_ns
    for track in recording.tracks:
        columns = tuple(_plain(values) for values in track.columns)
        width = track.header.width if any(one.is_wide for one in track.kind.columns) else 1
        yield ViewFrame(kind=track.kind, channel=track.header.id, columns=columns, from_ns=0, to_ns=end_ns,
                        of=len(track), width=width)  # fmt: skip


def _plain(values: ColumnValues) -> ColumnValues:
    """Return a column without texts that are made later."""
    if not isinstance(values, list):
        return values
    return ["" if isinstance(one, LaterText) else one for one in cast("list[object]", values)]  # type: ignore[return-value]  # texts or bytes


def _recording(header: PageHeader, frames: Sequence[PackedFrame]) -> ViewRecording:
    made = ViewRecording(replace(header, channels=()))
    models = {robot.name: robot.model for robot in header.robots}
    if [one.id for one in header.channels] != list(range(len(header.channels))):
        raise FrameError("channels of other numbers")
    count = len(header.channels)
    for channel, rows, whole in zip(header.channels, frames[:count], frames[count:], strict=True):
        track = made.add(channel)
        if {(one.channel, one.kind_number) for one in (rows, whole)} != {(channel.id, track.kind.number)}:
            raise FrameError("a frame of another channel")
        track.packed_whole = whole
        model = models.get(channel.source) if channel.kind == "packets" else None
        track.later = partial(_read, track, rows) if model is None else partial(_read_packets, track, rows, model)
    return made


def _read(track: ChannelTrack, packed: PackedFrame) -> None:
    """Take rows."""
    track.take_columns(packed.frame().columns)


def _read_packets(track: ChannelTrack, packed: PackedFrame, robot: str) -> None:
    """Take rows of packets; what those say that were made later is made later again."""
    from p2os.view.packet_rows import PacketTexts  # reads packets: of no run that is looked at from afar

    t, senders, data, names, says, inside, are_bad = cast("Any", packed.frame().columns)
    texts = PacketTexts(robot, senders, data, names, are_bad)

    def said(row: int) -> str:
        return says[row] if says[row] or are_bad[row] else texts.says(row)

    def fields(row: int) -> str:
        return inside[row] if says[row] or are_bad[row] else texts.fields(row)

    later = (LaterTexts(len(t), said), LaterTexts(len(t), fields))
    track.take_columns((t, senders, data, names, *later, are_bad))
