"""The channels of a long run, whole: their headers, how many rows, the first and the last, and a sum over all."""

import hashlib
from collections.abc import Iterator
from pathlib import Path

from p2os.protocol.commands import pulse, vel
from p2os.view.header import PageHeader
from p2os.view.recording import ChannelTrack, ViewRecording
from robot_bench.events.kinds import (
    CanTransfer,
    Event,
    Fault,
    I2cTransfer,
    Note,
    Packet,
    PinEdge,
    SpiTransfer,
    Verdict,
    WorldChange,
)
from robot_bench.view.run_tracks import RunTracks
from robot_bench.wires.edges import Edges
from tests.robot_bench.kept_lines import is_as_kept
from tests.robot_bench.long_run import long_run
from tests.robot_bench.recording.records import S

META: dict[str, object] = {
    "threshold_m": 0.6, "step_mps": 0.0625, "pins": {"led": "PC13", "PA9": "PA9"},
    "robot": {"name": "p2dx", "front_m": 0.2, "rear_m": 0.3, "width_m": 0.4, "sonar": [[0.1, 0.05, 0.3]] * 8,
              "sonar_cone_rad": 0.5, "sonar_range_m": 5.0},
    "world": {"name": "room", "extent": [-3, -3, 3, 3], "obstacles": [
        {"name": "post", "shape": "cylinder", "kind": "obstacle", "x": 1, "y": 1, "radius": 0.2}]},
}  # fmt: skip
MORE: list[Event] = [
    WorldChange(t=0, op="place", name="other", fields={"x": 9.0, "y": 9.0, "length": 1.0, "width": 1.0}),
    WorldChange(t=5, op="remove", name="nothing"),
    WorldChange(t=6, op="place", name="box", fields={"x": 1.0, "y": 2.0, "heading": 0.5, "length": 1.0, "width": 0.5}),
    WorldChange(t=7, op="place", name="box", fields={"x": 1.0, "y": 2.0, "length": 2.0, "width": 0.5}),
    WorldChange(t=8, op="move", name="box", fields={"x": 1.5, "y": 2.0}),
    WorldChange(t=9, op="remove", name="post"),
    Fault(t=10, op="inject", words="stop-button"),
    Note(t=11, who="adapter", what="connected", detail="p2dx"), Note(t=12, who="adapter", what="driving"),
    Verdict(t=13, goal="a", met=True, says="by 1 m", robustness=1.0, unit="m"),
    Verdict(t=14, goal="b", met=False, says=""),
    Packet(t=15, direction="c2r", data=vel(100).to_frame().to_bytes()[:4]),
    Packet(t=16, direction="c2r", data=vel(100).to_frame().to_bytes()[4:] + pulse().to_frame().to_bytes()[:3]),
    SpiTransfer(t=18, bus="spi1", begun=17, ended=18, from_master=b"\x01" * 20, from_slave=b"\x02"),
    I2cTransfer(t=19, bus="i2c1", begun=18, address=0x3C, is_read=False, data=b"\x10", answered=True, acknowledged=0,
                end="stop"),
    CanTransfer(t=20, bus="can", begun=19, identifier=1, is_extended=True, is_remote=False, dlc=1, data=b"\x01",
                is_own=True, error="damaged"),
]  # fmt: skip


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
    assert is_as_kept(lines, Path(__file__).with_name("run_tracks.txt"))
