"""The channels of a long run, whole: their headers, how many rows, the first and the last, and a sum over all."""

import hashlib
from collections.abc import Iterator

from p2os.view.header import PageHeader
from p2os.view.recording import ChannelTrack, ViewRecording
from robot_bench.events.kinds import (
    Note,
    PinEdge,
)
from robot_bench.view.run_tracks import RunTracks
from robot_bench.wires.edges import Edges
from tests.robot_bench.recording.kept_lines import is_as_kept
from tests.robot_bench.recording.long_run import META, MORE, long_run
from tests.robot_bench.recording.records import S


def lines_of(track: ChannelTrack) -> Iterator[str]:
    yield str(track.header)
    columns = [[round(value, 6) if isinstance(value, float) else value for value in column] for column in track.columns]
    yield f"  {len(track)} rows, {[column[:3] for column in columns]} to {[column[-1:] for column in columns]}"
    yield f"  {hashlib.sha256(repr(columns).encode()).hexdigest()[:16]}"


def test_the_channels_of_a_long_run() -> None:
    lines = []
    for source, is_whole in (("", False), ("mine", True)):
        recording = ViewRecording(PageHeader(title="mine", end_ns=40 * S))
        tracks = RunTracks(recording, META, source, ["other"], is_whole=is_whole)
        tracks.variable("count", "uint8_t").append(3, 7.0)
        edges: dict[str, Edges] = {}
        for event in [*MORE, *long_run(2)]:
            if isinstance(event, PinEdge):
                edges.setdefault(event.wire, Edges()).append(event.t, int(event.level))
            else:
                tracks.take(event)
        tracks.edges(edges)
        branch = tracks.forked("branch", 20 * S) if source else None
        tracks.finish({"goals_met": ["a", "c"], "goals_not_judged": ["d"]})
        if branch is not None:
            branch.take(Note(t=21 * S, who="adapter", what="lost", detail="line"))
            branch.edges({"motor1_comm1": Edges([(21 * S, 1)])})
            branch.finish({})
        lines += [str(recording.header), *(line for track in recording.tracks for line in lines_of(track))]
    bare = RunTracks(ViewRecording(PageHeader(title="bare")), {})
    for event in MORE[2:5]:
        bare.take(event)
    lines += [str(bare.recording.header), *(line for track in bare.recording.tracks for line in lines_of(track))]
    assert is_as_kept(lines, "run_tracks")
