"""A long run as its page shows it, kept beside its trace: opened again without reading the trace.

The file is a line of JSON and then the frames of all rows, one a channel (`p2os.view.frames`). The line says of which
trace they were made and by which version, and has the SHA-256 of all behind it. What packets say is left out: it
follows from their bytes, and is made when somebody looks.

Invariant: what is read equals what was kept, or nothing is read; a run without this file is shown alike.
"""

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import simbase
from p2os.json_record import of_json
from p2os.view.frames import ColumnValues, FrameError, LaterText, ViewFrame, frames_in
from p2os.view.header import PageHeader, PageSection
from p2os.view.packet_rows import PacketRows
from p2os.view.recording import ChannelTrack, ViewRecording
from robot_bench.recording.run_folder import KEPT_NAME
from robot_bench.recording.run_record import TRACE_NAME
from robot_bench.recording.variables import VARIABLES_NAME
from simbase.errors import P2osError
from simbase.files import read_bytes, sha256_of

#: Changes when other rows are made of the same trace.
_FORMAT = 1
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
    body = b"".join((header, b"\n", *(frame.to_bytes() for frame in _frames(recording))))
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
        line, _, body = read_bytes(path).partition(b"\n")
        if json.loads(line) != {**_made_of(folder), "sha256": hashlib.sha256(body).hexdigest()}:
            return None
        head, _, rows = body.partition(b"\n")
        header = cast("PageHeader", of_json(PageHeader, json.loads(head)))
        return _recording(header, list(frames_in(rows)))
    except (P2osError, ValueError, KeyError, TypeError, IndexError, RecursionError):  # FrameError is a P2osError
        return None


def _made_of(folder: Path) -> dict[str, object]:
    """Return what has to be alike for rows to be those of a trace."""
    variables = folder / VARIABLES_NAME
    return {
        "kept": _FORMAT, "version": simbase.__version__, "trace": sha256_of(folder / TRACE_NAME),
        "variables": sha256_of(variables) if variables.is_file() else "",
    }  # fmt: skip


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


def _recording(header: PageHeader, frames: Sequence[ViewFrame]) -> ViewRecording:
    made = ViewRecording(replace(header, channels=()))
    models = {robot.name: robot.model for robot in header.robots}
    if [one.channel for one in frames] != [one.id for one in header.channels] != list(range(len(frames))):
        raise FrameError("frames of other channels")
    for channel, frame in zip(header.channels, frames, strict=True):
        track = made.add(channel)
        if track.kind != frame.kind:
            raise FrameError("a frame of another kind")
        if channel.kind == "packets" and channel.source in models:
            track.later = partial(_read_packets, track, frame, models[channel.source])
        else:
            track.take_columns(frame.columns)
    return made


def _read_packets(track: ChannelTrack, frame: ViewFrame, robot: str) -> None:
    """Take rows of packets; what those say that were made later is made later again."""
    rows = PacketRows(robot)
    t, senders, data, names, says, inside, are_bad = cast("Any", frame.columns)
    texts = [
        (said, held) if said or is_bad else rows.texts_again(sender, one, name)
        for sender, one, name, said, held, is_bad in zip(senders, data, names, says, inside, are_bad, strict=True)
    ]
    columns = t, senders, data, names, [one for one, _ in texts], [one for _, one in texts], are_bad
    track.take_columns(cast("tuple[ColumnValues, ...]", columns))
