"""A capture as a recording: every packet of it, and what the robot says of itself."""

import json
from pathlib import Path

import pytest

from p2os.capture import Chunk, Direction, capture_of, read_file, write_pcap
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.frames import Frame
from p2os.protocol.sip import HEAD_BYTES, POSITION_MASK
from p2os.robots.parameters import load_parameters
from p2os.view.capture_recording import CaptureTracks, open_recording
from p2os.view.header import PageHeader
from p2os.view.recording import ViewRecording
from p2os.view.targets import capture_target, target_of
from simbase.errors import FileError, UsageError

CAPTURES = Path(__file__).resolve().parents[2] / "golden" / "captures"


@pytest.mark.parametrize("path", sorted(CAPTURES.glob("*.jsonl")), ids=lambda path: path.stem)
def test_each_byte_of_a_recorded_robot_stands_in_one_packet(path: Path) -> None:
    found, capture = open_recording(path), read_file(path)
    packets = next(track for track in found.tracks if track.kind.name == "packets")
    names = [column.name for column in packets.kind.columns]
    rows = [dict(zip(names, row, strict=True)) for row in zip(*packets.columns, strict=True)]
    for to_robot, direction in ((1, Direction.TO_ROBOT), (0, Direction.FROM_ROBOT)):
        assert b"".join(row["data"] for row in rows if row["to_robot"] == to_robot) == capture.bytes_of(direction)
    for row in rows[:200]:
        spans = json.loads(str(row["fields"]))
        assert b"".join(row["data"][first:last] for first, last, _, _ in spans) == row["data"]
    assert found.header.end_ns == capture.duration_ns
    has_sip = any(row["name"].startswith("SIP") for row in rows)
    assert ("pose" in {track.kind.name for track in found.tracks}) is has_sip


def test_the_way_goes_on_where_the_counter_of_a_position_wraps() -> None:
    parameters, rows = load_parameters("p2dx"), CaptureTracks(ViewRecording(PageHeader(title="x")), "p2dx")
    raws = (POSITION_MASK, 0, 12000, 24000, POSITION_MASK, 9000)
    payloads = [bytes([0x32]) + raw.to_bytes(2, "little") + bytes(HEAD_BYTES - 3) for raw in raws]
    rows.take(
        Chunk(at_ns=n, direction=Direction.FROM_ROBOT, data=Frame(payload).to_bytes())
        for n, payload in enumerate(payloads)
    )
    pose = next(track for track in rows.recording.tracks if track.kind.name == "pose")
    counts = [round(x_m * 1e9 / parameters.distance_nm_per_count) for x_m in pose.column("x_m")]  # type: ignore[operator]  # floats
    assert counts == [-1, 0, 12000, 24000, POSITION_MASK, POSITION_MASK + 1 + 9000]


def test_a_damaged_frame_is_an_event_and_a_packet_that_says_so(tmp_path: Path) -> None:
    whole = Command(CommandNumber.VEL, 300).to_frame().to_bytes()
    damaged = bytes([*whole[:-1], whole[-1] ^ 1])
    chunks = capture_of([(0, Direction.TO_ROBOT, whole), (5, Direction.TO_ROBOT, damaged)])
    (tmp_path / "x.pcap").write_bytes(write_pcap(chunks))
    found = open_recording(tmp_path / "x.pcap")
    packets = next(track for track in found.tracks if track.kind.name == "packets")
    assert list(packets.column("is_bad")) == [0, 1]
    assert packets.column("name") == ["VEL", "bad checksum"]
    events = next(track for track in found.tracks if track.kind.name == "events")
    assert events.column("what") == ["bad checksum"]


def test_a_capture_is_a_target_and_other_files_are_refused_in_words(tmp_path: Path) -> None:
    path = CAPTURES / "aria_p2de.jsonl"
    assert target_of(str(path)).run is None
    assert capture_target(str(tmp_path)) is None
    assert capture_target(str(tmp_path / "none")) is None
    (tmp_path / "empty.hex").write_text("", encoding="utf-8")
    with pytest.raises(FileError):
        capture_target(str(tmp_path / "empty.hex"))
    with pytest.raises(UsageError, match="nothing that can be shown"):
        target_of(str(tmp_path / "none"))
