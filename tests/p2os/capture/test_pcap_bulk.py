"""Records of capture files read many at a time, against the same read one by one."""

import struct
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("numpy")

from p2os.capture.chunks import Chunk, Direction, blocks_of, chunks_of, in_order
from p2os.capture.formats.conversations import Conversations
from p2os.capture.formats.pcap import pcap_blocks, write_pcap
from p2os.capture.formats.pcap_records import PCAPNG_MAGIC, Records, read_records
from p2os.capture.formats.tcp_streams import MOST_WAITING
from simbase.errors import FileError
from tests.p2os.capture.network_files import ETHERNET, block, network_file, segment
from tests.p2os.protocol.drawn_packets import SEEDS, Draw
from tests.tools.each_row import each_row

CLIENT, OTHER, ROBOT = 40000, 41000, 8101
LINKS = {1: ETHERNET, 0: bytes(4), 101: b"", 113: bytes(14) + b"\x08\0", 276: b"\x08\0" + bytes(18)}


def both_ways(data: bytes, size: int = 1 << 20) -> list[tuple[int, str | None, bytes]]:
    """Read a file cut into blocks, in bulk with runs of any length, and without."""
    blocks = [data[place : place + size] for place in range(0, len(data), size)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("p2os.capture.formats.pcap.LEAST_RECORDS", 1)
        patch.setattr("p2os.capture.formats.pcap_bulk.LEAST_RECORDS", 1)
        # Fewer of those that wait are taken one by one, so that what follows is seen to go on in bulk.
        patch.setattr("p2os.capture.formats.pcap_bulk.MOST_WAITING", 2)
        ours = outcome(blocks)
        patch.setattr("p2os.capture.formats.pcap_bulk.in_bulk", one_by_one)
        assert outcome(blocks) == ours
    return ours[0]


def one_by_one(records: Records, said: Conversations) -> Iterator[object]:
    return blocks_of(said.parts(records))


def outcome(blocks: list[bytes]) -> tuple[list[tuple[int, str | None, bytes]], str]:
    """Return what is said, bytes of one moment and direction joined, and the error."""
    found: list[tuple[int, str | None, bytes]] = []
    try:
        found.extend(
            (chunk.at_ns, chunk.direction and chunk.direction.value, chunk.data)
            for chunk in chunks_of(in_order(pcap_blocks(blocks)))
        )
    except FileError as error:
        return found, str(error)
    return found, ""


def packets(draw: Draw) -> list[bytes]:
    """Draw two conversations whose segments are at times repeated, lost or late, among packets of others."""
    following: dict[tuple[int, int], int] = {}
    found = []
    for _ in range(draw.size(24)):
        way = draw.one_of((CLIENT, ROBOT), (ROBOT, CLIENT), (OTHER, ROBOT), (9, 10))
        what, data = draw.one_of(*"dddddddasrxlgc"), draw.data(5)
        at = following.setdefault(way, draw.one_of(0, 0xFFFFFFF8))
        if what == "s":
            found.append(segment(*way, at, flags=2))
            at += 1
        elif what in "xg":
            found.append({"x": b"\x45" + bytes(30), "g": segment(*way, at, data)[:9] + b"\x11" + bytes(30)}[what])
        else:
            whole = segment(*way, at - (2 if what == "r" else 0), b"" if what == "a" else data)
            # A capture program may keep only the beginning of a packet.
            found.append(whole[:-1] if what == "c" else whole)
            at += 0 if what in "ra" else len(data) + (3 if what == "l" else 0)
        following[way] = at & 0xFFFFFFFF
    return found


@given(SEEDS)
@settings(max_examples=200)
def test_segments_read_together_say_what_each_says(seed: int) -> None:
    draw = Draw(seed)
    link = draw.one_of(*LINKS)
    both_ways(network_file(packets(draw), link, LINKS[link], order=draw.one_of("<", ">")), draw.one_of(90, 1 << 20))


@pytest.mark.parametrize("words", range(16))
def test_a_header_of_tcp_that_is_too_short_or_too_long_says_nothing_in_a_run(words: int) -> None:
    for v6 in (False, True):
        found = [segment(ROBOT, CLIENT, 7 * number, b"1234567", v6=v6) for number in range(6)]
        place = 40 + 12 if v6 else 20 + 12
        found[2] = found[2][:place] + bytes([words << 4]) + found[2][place + 1 :]
        said = both_ways(network_file(found, 101, b""))
        # What follows those that are missing waits for them, and they never come.
        heard = {5: b"1234567" * 6, 6: b"1234567" * 2 + b"567"}.get(words, b"1234567" * 2)
        assert b"".join(data for _, _, data in said) == heard


@pytest.mark.parametrize("cut", [0, 1])
def test_what_waited_for_a_late_segment_is_said_behind_it(cut: int) -> None:
    found = [segment(ROBOT, CLIENT, place, data) for place, data in ((0, b"a"), (4, b"e"), (3, b"d"), (2, b"c"))]
    found.append(segment(ROBOT, CLIENT, 1, b"bXY")[: 43 - 3 * cut])
    said = both_ways(network_file(found, 101, b""))
    assert b"".join(data for _, _, data in said) == (b"a" if cut else b"abXYe")


def test_a_long_conversation_is_read_without_a_look_at_each(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [segment(ROBOT, CLIENT, 7 * number, b"1234567") for number in range(999)]
    found[200:200] = [segment(ROBOT, CLIENT, 7 * 199, b"1234567")]
    looked_at: list[int] = []
    parts = Conversations.parts

    def counted(self: Conversations, records: Records, first: int = 0, last: int | None = None) -> Iterator[object]:
        looked_at.append((len(records.starts) if last is None else last) - first)
        return parts(self, records, first, last)

    monkeypatch.setattr(Conversations, "parts", counted)
    chunks = list(chunks_of(pcap_blocks([network_file(found, 1, ETHERNET)])))
    assert b"".join(chunk.data for chunk in chunks) == b"1234567" * 999
    # Those behind the first of a direction and behind a repeated one, and what is left of the run.
    assert sum(looked_at) < 3 * MOST_WAITING


chunks_of_ours = st.lists(st.builds(Chunk, at_ns=st.integers(0, 1 << 50), direction=st.sampled_from(Direction),
                                    data=st.binary(max_size=4)), min_size=1, max_size=9)  # fmt: skip


@given(chunks_of_ours, st.sampled_from((1, 40, 1 << 20)))
@settings(max_examples=50)
def test_records_of_ours_say_the_same(chunks: list[Chunk], size: int) -> None:
    data = write_pcap(chunks, base_ns=1_700_000_000 * 10**9)
    both_ways(data, size)
    both_ways(data[:-1], size)
    both_ways(data[:-1] + b"\2", size)


@each_row("ticks", [b"\x06", b"\x09", b"\x07", b"\x0a", b"\x8a", b"\x80"])
@each_row("late", [0, 1 << 20, 1 << 31])
def test_enhanced_packets_have_the_time_of_their_interface(ticks: bytes, late: int) -> None:
    section = block(PCAPNG_MAGIC, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1), "<")
    option = struct.pack("<HH", 9, 1) + ticks + bytes(3) + bytes(4)
    interface = block(1, struct.pack("<HHI", 147, 0, 0) + option, "<")

    def packet(high: int, low: int, data: bytes, size: int | None = None) -> bytes:
        return block(6, struct.pack("<IIIII", 0, high, low, len(data) if size is None else size, 9) + data, "<")

    rows = [packet(5 + late, 10 * number, b"\0abc"[: number % 3 + 1]) for number in range(9)]
    both_ways(section + interface + packet(5, 0, b"\1z") + b"".join(rows))
    both_ways(section + interface + b"".join(rows) + packet(5, 90, b"\0abc", 99) + interface + rows[0])


def test_a_file_cut_anywhere_ends_with_the_same_words() -> None:
    data = network_file([segment(ROBOT, CLIENT, 3 * number, b"abc") for number in range(3)], 1, ETHERNET)
    for end in range(len(data)):
        both_ways(data[:end], 50)


def test_records_are_found_however_a_file_is_cut() -> None:
    data = network_file([segment(ROBOT, CLIENT, 3 * number, b"abc") for number in range(5)], 101, b"")
    whole = [piece for records in read_records([data]) for piece in records.packets(0, len(records.starts))]
    for size in range(1, len(data)):
        blocks = [data[place : place + size] for place in range(0, len(data), size)]
        assert [p for records in read_records(blocks) for p in records.packets(0, len(records.starts))] == whole


def test_an_interface_whose_last_option_is_cut_counts_microseconds() -> None:
    section = block(PCAPNG_MAGIC, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1), "<")
    interface = block(1, struct.pack("<HHIHH", 147, 0, 0, 9, 1), "<")
    rows = [block(6, struct.pack("<IIIII", 0, 0, at, 2, 2) + b"\1a", "<") for at in (5, 7)]
    assert [at_ns for at_ns, _, _ in both_ways(section + interface + b"".join(rows))] == [0, 2000]
