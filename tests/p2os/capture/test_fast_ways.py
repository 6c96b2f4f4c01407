"""The fast ways through a capture against the slow ones, on captures that were cut and damaged."""

import io
import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.capture import ListingRow, Reading, open_capture, open_file, rows_of
from p2os.capture.chunks import Chunk, Direction, Part, capture_of
from p2os.capture.formats.recording import recorded_parts, write_recording
from p2os.capture.formats.recording_bulk import plain_lines
from p2os.cli.captures.reading import chosen_rows, wanted_names
from p2os.protocol.commands import Command, CommandNumber, rvel, vel
from p2os.protocol.frames import Decoder, Frame, checksum, sound_frames
from p2os.protocol.packets import EncoderPacket, ResetNotice, SonarReading, StandardSip, packet_frame
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import load_parameters
from simbase.errors import FileError
from simbase.timing import NS_PER_MS
from tests.p2os.capture.blocks import blocks_of, parts_of

P2DX = Reading(profile=Profile.P2OS, parameters=load_parameters("p2dx"))
SIP = packet_frame(StandardSip(raw_x=5, sonar=(SonarReading(1, 1000),)), Profile.P2OS).to_bytes()
FRAMES = (SIP, packet_frame(EncoderPacket(left_counts=1, right_counts=2), Profile.P2OS).to_bytes(),
          vel(200).to_frame().to_bytes(), rvel(-3).to_frame().to_bytes(), b"\xfa\xfb\x03\x00\x00\x00")  # fmt: skip
STREAM = b"".join(FRAMES)
#: From how many bytes on NumPy looks into a chunk; how many chunks a block holds.
HOW = ((0, 1), (1 << 11, 100))
WANTED = ("vel", "sip", "encoder,sync0,pulse", "damaged")
WAYS = tuple(itertools.product(HOW, WANTED))


def shown(chunks: list[Chunk]) -> list[tuple[object, ...]]:
    return shown_of(rows_of(chunks, P2DX))


def shown_of(rows: Iterable[ListingRow]) -> list[tuple[object, ...]]:
    return [(row.at_ns, row.direction, row.data, row.kind, row.name, row.problem) for row in rows]


def both_ways(chunks: list[Chunk], ways: Iterable[tuple[tuple[int, int], str]] = WAYS) -> None:
    fast = shown(chunks)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Decoder, "take_back", lambda _: None)
        patch.setattr("p2os.capture.listing.next_header", lambda data, _: len(data))
        assert fast == shown(chunks)
        patch.undo()
        for (least, together), listed in ways:
            patch.setattr("p2os.capture.columns.passing.LEAST_BYTES", least)
            names = wanted_names(listed)
            passed = shown_of(chosen_rows(blocks_of(chunks, together), P2DX, names))
            assert passed == [row for row in fast if str(row[4]).lower() in names or ("damaged" in names and row[5])]


def chunks_of(stream: bytes, cuts: tuple[int, ...], wait_ns: int, direction: Direction | None = None) -> list[Chunk]:
    places = sorted({0, *cuts, len(stream)})
    return [Chunk(at_ns=number * wait_ns, direction=direction, data=stream[start:end])
            for number, (start, end) in enumerate(itertools.pairwise(places)) if start < end]  # fmt: skip


#: Around the time after which the rest of a frame is given up.
WAITS_NS = (0, 249 * NS_PER_MS, 250 * NS_PER_MS)


def cut_and_corrupted() -> Iterator[list[Chunk]]:
    """Yield the stream cut at each byte, hit at each byte, and without each byte, with each wait."""
    for place in range(len(STREAM)):
        hit = STREAM[:place] + bytes((STREAM[place] ^ 0x41,)) + STREAM[place + 1 :]
        lost = STREAM[:place] + STREAM[place + 1 :]
        for wait_ns in WAITS_NS:
            yield chunks_of(STREAM, (place,), wait_ns)
            yield chunks_of(hit, (place, place + 3), wait_ns)
            yield chunks_of(lost, (len(SIP), place), wait_ns)


def test_rows_are_the_same_however_a_stream_is_cut_and_corrupted() -> None:
    # Of the ways to pass over rows each capture has one: eight ways, and nine captures of a byte, so that each damage
    # with each wait comes to each way within eight bytes.
    for chunks, way in zip(cut_and_corrupted(), itertools.cycle(WAYS), strict=False):
        both_ways(chunks, [way])


@pytest.mark.soak
def test_rows_are_the_same_in_all_ways_however_a_stream_is_cut_and_corrupted() -> None:
    for chunks in cut_and_corrupted():
        both_ways(chunks)


@pytest.mark.parametrize("first", [b"\xfa\xfb\xc0", SIP])
@pytest.mark.parametrize("wait_ns", [0, 250 * NS_PER_MS])
def test_sound_packets_behind_a_frame_that_waits_are_not_passed_over(first: bytes, wait_ns: int) -> None:
    parts = [first, SIP, SIP, SIP[:9], SIP[9:] + SIP, FRAMES[2], SIP]
    both_ways([Chunk(at_ns=wait_ns * (number > 3), direction=Direction.FROM_ROBOT, data=data)
               for number, data in enumerate(parts)])  # fmt: skip


@pytest.mark.parametrize(
    "end",
    [
        (Direction.TO_ROBOT, Command(CommandNumber.CLOSE).to_frame()),
        (Direction.FROM_ROBOT, packet_frame(ResetNotice(kind=0xFE), Profile.P2OS)),
    ],
)
def test_what_ends_a_session_is_not_passed_over(end: tuple[Direction, Frame]) -> None:
    pulse = (Direction.TO_ROBOT, Command(CommandNumber.PULSE).to_frame())
    parts = [(Direction.FROM_ROBOT, Frame.from_bytes(SIP)), pulse, end, pulse]
    chunks = [Chunk(at_ns=0, direction=direction, data=frame.to_bytes()) for direction, frame in parts]
    assert [shown(chunks)[place][4] for place in (1, 3)] == ["PULSE", "SYNC0"]
    both_ways(chunks)


@given(st.lists(st.one_of(st.sampled_from(FRAMES), st.binary(max_size=4), st.just(b"\xfa\xfb\xc0"), st.just(b"\xfa")),
                max_size=8),
       st.lists(st.integers(0, 300), max_size=4), st.sampled_from((0, 100 * NS_PER_MS, 250 * NS_PER_MS)),
       st.sampled_from((None, *Direction)))  # fmt: skip
def test_rows_of_any_stream_are_the_decoders(
    parts: list[bytes], cuts: list[int], wait_ns: int, direction: Direction | None
) -> None:
    stream = b"".join(parts)
    both_ways(chunks_of(stream, tuple(min(cut, len(stream)) for cut in cuts), wait_ns, direction))


def test_sound_frames_end_at_the_first_byte_that_is_none() -> None:
    assert [len(payload) + 5 for payload in sound_frames(STREAM)] == [len(frame) for frame in FRAMES]
    assert list(sound_frames(SIP + b"\0" + SIP)) == [SIP[3:-2]]
    assert list(sound_frames(SIP[:-1])) == []


@given(st.one_of(st.binary(max_size=40), st.integers(0, 256).map(lambda size: b"\xff" * size)))
def test_the_checksum_is_the_sum_of_pairs_and_an_odd_last_byte(data: bytes) -> None:
    pairs = sum(data[place] << 8 | data[place + 1] for place in range(0, len(data) - 1, 2)) & 0xFFFF
    assert checksum(data) == (pairs ^ data[-1] if len(data) % 2 else pairs)


PARTS: list[Part] = [(0, Direction.FROM_ROBOT, SIP), (999_999_999_999_999, Direction.TO_ROBOT, b"\xfa")]
BLOCK = write_recording(capture_of(PARTS)).split("\n", 1)[1].encode()


def test_lines_of_ours_are_read_at_once() -> None:
    block = plain_lines(BLOCK)
    assert block is not None
    assert parts_of(block) == PARTS


def test_a_block_of_lines_damaged_anywhere_is_read_as_line_by_line_or_left_to_that() -> None:
    for place in range(len(BLOCK)):
        for hit in (b"", b"9", b"g", b'"', b" ", b"\n", b"\r", b"\xc3"):
            block = BLOCK[:place] + hit + BLOCK[place + 1 :]
            found = plain_lines(block)
            if found is not None:
                assert parts_of(found) == list(recorded_parts(block.decode().splitlines())), block


def test_a_fault_behind_lines_of_ours_names_its_line() -> None:
    line = write_recording(capture_of([(0, Direction.FROM_ROBOT, SIP)])).split("\n")[1] + "\n"
    source = open_capture(io.BytesIO((line * 3000 + '{"t": 1}\n').encode()))
    with pytest.raises(FileError, match="line 3001: dir None"):
        list(source.chunks)


@pytest.mark.parametrize(
    ("content", "has_one_origin"),
    [
        (SIP, True),  # raw: nobody says who sent it
        (write_recording(capture_of([(0, Direction.FROM_ROBOT, SIP)])).encode(), True),
        (f"< {SIP.hex()}\n{SIP.hex()}\n".encode(), False),  # hex: some lines say it, some do not
    ],
)
def test_a_source_says_whether_its_chunks_have_one_origin(content: bytes, has_one_origin: bool, tmp_path: Path) -> None:
    path = tmp_path / "capture"
    path.write_bytes(content)
    source = open_file(path)
    assert source.has_one_origin is has_one_origin
    origins = {chunk.direction is None for chunk in source.chunks}
    assert len(origins) == 1 or not has_one_origin


@pytest.mark.parametrize("least", [0, 1 << 11])
def test_a_packet_that_is_passed_over_still_opens_the_session(least: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("p2os.capture.columns.passing.LEAST_BYTES", least)
    pulse = b"\xfa\xfb\x03\x00\x00\x00"
    chunks = chunks_of(SIP + SIP + pulse + SIP, (), 0)
    assert [row.name for row in chosen_rows(blocks_of(chunks, 1), P2DX, {"pulse", "sync0"})] == ["PULSE"]
