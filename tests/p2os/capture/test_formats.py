"""Captures read from and written to every kind of file, and refused in one line."""

import json
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.capture import (
    Capture,
    Chunk,
    Direction,
    capture_of,
    open_argument,
    read_capture,
    read_file,
    write_pcap,
    write_recording,
)
from p2os.capture.formats.hex_text import write_hex
from p2os.capture.formats.pcap import PCAPNG_MAGIC, SNAP_BYTES, record
from p2os.errors import LocalProtocolError
from simbase.errors import FileError
from simbase.timing import NS_PER_S
from tests.p2os.capture.network_files import ETHERNET, block, network_file, segment

TO, FROM = Direction.TO_ROBOT, Direction.FROM_ROBOT
SYNC0 = bytes.fromhex("fafb03000000")
VEL = bytes.fromhex("fafb060b3bc800d33b")
GOLDEN = Path(__file__).resolve().parents[2] / "golden" / "captures"
TALK = capture_of([(0, TO, SYNC0), (5_000_001, FROM, SYNC0), (2 * NS_PER_S, TO, VEL)])

chunks = st.lists(
    st.tuples(st.integers(0, 10**12), st.sampled_from([TO, FROM]), st.binary(min_size=1, max_size=40)), max_size=8
).map(lambda rows: capture_of(sorted(rows, key=lambda row: row[0])))


@given(chunks)
def test_a_recording_is_read_as_it_was_written(capture: Capture) -> None:
    assert read_capture(write_recording(capture).encode()).chunks == capture.chunks


@given(chunks)
def test_a_pcap_is_read_as_it_was_written_with_times_from_its_first_record(capture: Capture) -> None:
    start = capture.chunks[0].at_ns if capture.chunks else 0
    moved = [(chunk.at_ns - start, chunk.direction, chunk.data) for chunk in capture.chunks]
    assert read_capture(write_pcap(capture.chunks, base_ns=1_700_000_000 * NS_PER_S)) == capture_of(moved)


@given(chunks)
def test_hex_text_keeps_bytes_and_directions(capture: Capture) -> None:
    again = read_capture(write_hex(capture).encode())
    assert [(chunk.direction, chunk.data) for chunk in again.chunks] == [
        (chunk.direction, chunk.data) for chunk in capture.chunks
    ]


@pytest.mark.parametrize("length", [SNAP_BYTES - 2, SNAP_BYTES - 1, SNAP_BYTES])
def test_a_pcap_keeps_of_a_chunk_what_its_header_says_and_how_long_it_was(length: int) -> None:
    chunk = Chunk(at_ns=0, direction=Direction.TO_ROBOT, data=bytes(length))
    _, _, kept, wire = struct.unpack("<IIII", (data := record(chunk))[:16])
    assert (kept, wire) == (min(length + 1, SNAP_BYTES), length + 1)
    assert len(data) == 16 + kept


def test_a_note_travels_with_a_recording() -> None:
    noted = Capture(chunks=TALK.chunks, note="kitchen floor")
    assert read_capture(write_recording(noted).encode()).note == "kitchen floor"


@pytest.mark.parametrize("name", ["aria_p2de", "player_p2de"])
def test_captures_of_others_are_read_with_their_seconds(name: str) -> None:
    path = GOLDEN / f"{name}.jsonl"
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    capture = read_file(path)
    assert [chunk.data.hex() for chunk in capture.chunks] == [row["hex"] for row in rows if row["hex"]]
    assert capture.duration_ns == round([row["t"] for row in rows if row["hex"]][-1] * 1e9)
    assert capture.bytes_of(TO).startswith(SYNC0)


def test_the_wire_file_of_a_run_folder_is_read(tmp_path: Path) -> None:
    (tmp_path / "wire.jsonl").write_text('{"dir": "c2r", "hex": "fafb03000000", "t": 19640000}\n\n')
    assert read_file(tmp_path).chunks == (Chunk(at_ns=19_640_000, direction=TO, data=SYNC0),)


@pytest.mark.parametrize(
    "text",
    [
        "fafb060b3bc800d33b", "FA FB 06 0B 3B C8 00 D3 3B", "0xfa, 0xfb, 0x06, 0x0b, 0x3b, 0xc8, 0x00, 0xd3, 0x3b",
        r"\xfa\xfb\x06\x0b\x3b\xc8\x00\xd3\x3b", "fafb 060b\n3bc8 00d3 3b  # VEL 200", "[fa:fb:06:0b:3b:c8:00:d3:3b]",
        "00000000: fafb 060b 3bc8 00d3 3b                   ....;....",
        "00000000  fa fb 06 0b 3b c8 00 d3  3b                       |....;...;|\n00000009\n",
    ],
)  # fmt: skip
def test_hex_is_read_in_the_spellings_that_tools_print(text: str) -> None:
    assert read_capture(text.encode()).bytes_of(None) == VEL


def test_arrows_tell_the_direction_and_an_option_tells_what_they_do_not() -> None:
    capture = read_capture(b"> fafb03000000\n< fafb03000000\nfafb060b3bc800d33b\n", TO)
    assert [chunk.direction for chunk in capture.chunks] == [TO, FROM, TO]
    assert read_capture(VEL, FROM).chunks[0].direction is FROM
    assert not read_capture(VEL).has_time


def test_an_argument_is_a_file_or_hex(tmp_path: Path) -> None:
    (tmp_path / "dump").write_bytes(VEL)
    assert open_argument([str(tmp_path / "dump")]).whole().bytes_of(None) == VEL
    assert open_argument(["fa", "fb", "03000000"]).whole().bytes_of(None) == SYNC0
    with pytest.raises(FileError, match="no file and no hex"):
        open_argument(["nowhere.jsonl"])
    with pytest.raises(FileError, match="'' is no file and no hex"):
        open_argument([""])


def test_a_byte_order_mark_stands_before_texts_alone() -> None:
    mark = b"\xef\xbb\xbf"
    assert read_capture(mark + write_recording(TALK).encode()).chunks == TALK.chunks
    assert read_capture(mark + SYNC0.hex(" ").encode()).bytes_of(None) == SYNC0
    assert read_capture(mark + SYNC0).bytes_of(None) == mark + SYNC0


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"fafb0", "odd number"), (b"fa zz", "'z' is no hex digit"), (b'{"t": 1', "line 1 is no JSON"),
        (b'{"t": 1}', "dir None is none of"), (b'{"t": -1, "dir": "c2r", "hex": "00"}', "not a time"),
        (b'{"t": "x", "dir": "c2r", "hex": "00"}', "'x' is no number"), (b'{"t":1}\n[]', "dir None"),
        (b'{"t": 1e30, "dir": "c2s", "hex": "00"}', "not a time"), (b'{"t": NaN, "dir": "c2s"}', "not a time"),
        (b'{"t": 0, "dir": "c2r", "hex": "0g"}', "no hex text"), (b'{"dir":"event","t":0}\n[]', "line 2 is no JSON"),
        (b'{"format": "p2os-recording", "version": 9}', "version 9"), (b"\xd4\xc3\xb2\xa1", "ends in its header"),
        (write_pcap(TALK.chunks)[:-1], "cut off at byte"), (write_pcap(TALK.chunks)[:30], "in the middle"),
    ],
)  # fmt: skip
def test_a_broken_file_is_refused_with_its_place(content: bytes, said: str, tmp_path: Path) -> None:
    path = tmp_path / "broken"
    path.write_bytes(content)
    with pytest.raises(FileError, match=said) as caught:
        read_file(path)
    assert str(path) in str(caught.value)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"cannot read .*gone: no such file"):
        read_file(tmp_path / "gone")


def test_time_begins_at_zero_and_never_runs_back() -> None:
    with pytest.raises(LocalProtocolError, match="time begins at 0"):
        Chunk(at_ns=-1, direction=TO, data=b"\0")
    assert [chunk.at_ns for chunk in capture_of([(5, TO, b"a"), (3, TO, b"b")]).chunks] == [5, 5]
    assert TO.opposite is FROM
    assert FROM.opposite is TO


# captures of network traffic ------------------------------------------------------------


CONVERSATION = [
    segment(40000, 8101, 99, flags=2), segment(8101, 40000, 499, flags=0x12), segment(40000, 8101, 100, SYNC0[:2]),
    segment(40000, 8101, 104, SYNC0[4:]), segment(40000, 8101, 102, SYNC0[2:4]), segment(40000, 8101, 100, SYNC0),
    segment(8101, 40000, 500, SYNC0), segment(40000, 8101, 104, SYNC0[4:] + VEL),
]  # fmt: skip


@pytest.mark.parametrize(
    ("link", "before", "order"),
    [(1, ETHERNET, "<"), (1, ETHERNET, ">"), (0, bytes(4), "<"), (101, b"", "<"), (113, bytes(14) + b"\x08\0", "<"),
     (276, b"\x08\0" + bytes(18), "<")],
)  # fmt: skip
def test_tcp_is_put_together_whatever_the_link(link: int, before: bytes, order: str) -> None:
    capture = read_capture(network_file(CONVERSATION, link, before, order=order))
    assert capture.bytes_of(TO) == SYNC0 + VEL
    assert capture.bytes_of(FROM) == SYNC0
    assert capture.chunks[0].at_ns == 2 * 500 * 1000


def test_a_conversation_seen_from_its_middle_is_sorted_by_port() -> None:
    wrapped = [segment(8101, 40000, 0xFFFFFFFE, SYNC0), segment(8101, 40000, 4, VEL, v6=False)]
    assert read_capture(network_file(wrapped, 101, b"")).bytes_of(FROM) == SYNC0 + VEL
    six = [segment(5000, 4000, 1, VEL, v6=True)]
    assert read_capture(network_file(six, 1, bytes(12) + b"\x86\xdd")).bytes_of(TO) == VEL


def test_a_segment_that_was_never_captured_is_given_up() -> None:
    lost = [segment(1, 8101, 0, b"a"), *(segment(1, 8101, 2 + place, b"b") for place in range(70))]
    assert read_capture(network_file(lost, 101, b"")).bytes_of(TO) == b"a" + b"b" * 70


def test_what_is_no_tcp_is_left_out() -> None:
    others = [b"", b"\x00", segment(1, 2, 3, b"x")[:25], b"\x45" + bytes(30), bytes(40), b"\x60" + bytes(10)]
    assert read_capture(network_file(others, 101, b"")).chunks == ()
    assert read_capture(network_file([b"ARP"], 1, bytes(12) + b"\x08\x06")).chunks == ()
    with pytest.raises(FileError, match="link type 105 is not read here"):
        read_capture(network_file([b"beacon"], 105, b""))
    with pytest.raises(FileError, match="gives no direction"):
        read_capture(network_file([b"\x07data"], 147, b""))


@pytest.mark.parametrize("order", ["<", ">"])
def test_pcapng_is_read_with_the_resolution_that_it_declares(order: str) -> None:
    section = block(PCAPNG_MAGIC, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1), order)
    option = struct.pack(order + "HH", 2, 3) + b"lo\0\0" + struct.pack(order + "HH", 9, 1) + b"\x09\0\0\0" + bytes(4)
    nanoseconds = block(1, struct.pack(order + "HHI", 147, 0, 0) + option, order)
    microseconds = block(1, struct.pack(order + "HHI", 147, 0, 0) + bytes(4), order)

    def packet(interface: int, at: int, data: bytes) -> bytes:
        return block(
            6, struct.pack(order + "IIIII", interface, at >> 32, at & 0xFFFFFFFF, len(data), len(data)) + data, order
        )

    simple = block(3, struct.pack(order + "I", 7) + b"\1" + SYNC0, order)
    data = (
        section
        + nanoseconds
        + microseconds
        + packet(0, 5_000_000_000, b"\0" + SYNC0)
        + packet(1, 5_000_007, b"\0" + VEL)
    )
    capture = read_capture(data + simple)
    assert capture == capture_of([(0, TO, SYNC0), (7_000, TO, VEL), (7_000, FROM, SYNC0)])
    for cut in (len(data) - 1, len(section) + 3):
        with pytest.raises(FileError, match="cut off"):
            read_capture(data[:cut])
    # A section declares its own interfaces: those of the one before are gone (section 4.1 of the draft).
    again = section + microseconds + packet(0, 5_000_008, b"\0" + VEL)
    assert read_capture(data + again) == capture_of([(0, TO, SYNC0), (7_000, TO, VEL), (8_000, TO, VEL)])
    for late in (section + packet(0, 0, b"\0"), again + packet(1, 5_000_009, b"\0" + VEL)):
        with pytest.raises(FileError, match="never declared"):
            read_capture(data + late)
    with pytest.raises(FileError, match="never declared"):
        read_capture(section + packet(0, 0, b"\0"))
