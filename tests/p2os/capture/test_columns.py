"""Columns against objects: row by row, damage by damage, on any stream of bytes."""

import dataclasses
import json
import sys
from itertools import zip_longest
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

np = pytest.importorskip("numpy")

from p2os.capture.columns import Columns, RejectedCounts, decode, find_frames  # noqa: E402
from p2os.capture.columns.arrow import to_arrow  # noqa: E402
from p2os.capture.columns.objects import rows_by_objects  # noqa: E402
from p2os.capture.columns.tables import KINDS as TABLES  # noqa: E402
from p2os.protocol.frames import (  # noqa: E402
    Decoder,
    DecoderStats,
    Frame,
)
from p2os.protocol.packets import (  # noqa: E402
    READERS,
    BatteryPacket,
    EncoderPacket,
    PlaylistPacket,
    ServerPacket,
    SonarReading,
    StandardSip,
    packet_frame,
)
from p2os.protocol.packets.registry import IDENTITY_KIND  # noqa: E402
from p2os.protocol.profiles import Profile  # noqa: E402
from p2os.protocol.sip import SIP_KINDS  # noqa: E402
from simbase.errors import MissingDependencyError  # noqa: E402
from simbase.timing import NS_PER_MS, Nanos  # noqa: E402
from tests.p2os.protocol.drawn_packets import KINDS, SEEDS, Draw, any_packet  # noqa: E402

GOLDEN = Path(__file__).parents[2] / "golden"
GIVE_UP_NS = 250 * NS_PER_MS


def damage_of(stats: DecoderStats) -> RejectedCounts:
    return RejectedCounts(**{field.name: getattr(stats, field.name) for field in dataclasses.fields(RejectedCounts)})


def decoded(chunks: list[tuple[Nanos, bytes]]) -> tuple[list[bytes], DecoderStats]:
    """Return the payloads that the decoder finds in chunks with their times, and its counters."""
    decoder, found = Decoder(), []
    for at_ns, data in chunks:
        decoder.receive(data, at_ns)
    decoder.advance_to(chunks[-1][0] + GIVE_UP_NS if chunks else 0)
    while (item := decoder.next_item()) is not None:
        if isinstance(item, Frame):
            found.append(item.payload)
    return found, decoder.stats


def same(data: bytes, profile: Profile = Profile.P2OS) -> Columns:
    """Decode both ways and compare everything."""
    columns = decode(data, profile)
    for ours, theirs in zip_longest(columns.rows(), rows_by_objects(data, profile)):
        assert ours == theirs
    payloads, stats = decoded([(0, data)])
    assert len(columns) == len(payloads)
    assert columns.kinds.tolist() == [payload[0] for payload in payloads]
    assert columns.damage() == damage_of(stats)
    return columns


def _hit(data: bytes, place: int, how: int) -> bytes:
    place %= len(data)
    if how == 0:
        return data[:place] + data[place + 1 :]
    if how == 1:
        return data[:place]
    return data[:place] + bytes((data[place] ^ 1 << (how - 2),)) + data[place + 1 :]


def frame_of(draw: Draw) -> bytes:
    return packet_frame(any_packet(draw), draw.one_of(*Profile)).to_bytes()


def damaged(draw: Draw) -> bytes:
    return _hit(frame_of(draw), draw.integer(0, 206), draw.integer(0, 9))


def odd(draw: Draw) -> bytes:
    """Return a frame whose inside no layout expects."""
    return Frame(bytes((draw.one_of(*READERS, *SIP_KINDS, 2),)) + draw.data(40)).to_bytes()


def nested(draw: Draw) -> bytes:
    """Return a damaged frame with a frame inside."""
    return _hit(Frame(b"\x2a" + frame_of(draw)[:200]).to_bytes(), -1, draw.integer(2, 9))


def headers(draw: Draw) -> bytes:
    """Return bytes that look like headers."""
    return bytes(draw.several(lambda: draw.one_of(0xFA, 0xFB, 3, 4, 6, 200, 204, 205, 255, 0), 9))


def stream_of(seed: int) -> bytes:
    draw = Draw(seed)
    kinds = frame_of, frame_of, damaged, odd, nested, headers, lambda draw: draw.data(9)
    return b"".join(draw.several(lambda: draw.one_of(*kinds)(draw), 8))


streams = SEEDS.map(stream_of)


@given(streams, st.sampled_from(Profile))
def test_any_stream_gives_the_rows_of_the_objects(data: bytes, profile: Profile) -> None:
    same(data, profile)


@given(SEEDS)
@settings(max_examples=15)
def test_each_kind_gives_the_rows_of_its_objects(seed: int) -> None:
    draw = Draw(seed)
    for kind in KINDS.values():
        packets = [kind(draw) for _ in range(draw.integer(1, 3))]
        columns = same(b"".join(packet_frame(packet, Profile.P2OS).to_bytes() for packet in packets))
        assert "raw" not in columns.tables


@given(streams, st.integers(1, 40))
def test_the_size_of_a_block_changes_nothing(data: bytes, block: int) -> None:
    array = np.frombuffer(data, np.uint8)
    whole, parts = find_frames(array), find_frames(array, block=block)
    assert [found.tolist() for found in parts] == [found.tolist() for found in whole]


@given(streams, st.lists(st.tuples(st.integers(0, 200), st.booleans()), max_size=6))
def test_a_pause_gives_up_what_it_cuts(data: bytes, cuts: list[tuple[int, bool]]) -> None:
    places = sorted({(place % (len(data) + 1), quiet) for place, quiet in cuts})
    chunks, pauses, now, last = [], [], 0, 0
    for place, quiet in places:
        chunks.append((now, data[last:place]))
        now, last = now + (GIVE_UP_NS if quiet else 1), place
        pauses += [place] if quiet else []
    chunks.append((now, data[last:]))
    # A chunk without bytes does not end a pause.
    chunks = [chunk for chunk in chunks if chunk[1]] or [(0, b"")]
    columns = decode(data, Profile.P2OS, pauses=np.array(sorted(set(pauses)), np.int64))
    payloads, stats = decoded(chunks)
    found = [bytes(data[a:b]) for a, b in zip(columns.starts.tolist(), columns.ends.tolist(), strict=True)]
    assert found == payloads
    assert columns.damage() == damage_of(stats)


def test_of_frames_within_frames_only_the_outermost_counts() -> None:
    inner = Frame(b"\x77").to_bytes()
    middle = Frame(b"\x77" + inner + b"ab").to_bytes()
    outer = Frame(b"\x77" + middle + b"cd").to_bytes()
    assert len(same(outer + inner)) == 2
    assert len(same(outer[:-1] + inner)) == 2
    assert same(outer[:-1] + b"\0" + inner).damage().rescued == 1


def test_every_packet_that_is_read_has_a_table() -> None:
    assert {kind for kinds in TABLES.values() for kind in kinds} == {*READERS, *SIP_KINDS, IDENTITY_KIND}


def test_nothing_decodes_to_nothing() -> None:
    for data in (b"", b"\xfa", b"\xfa\xfb", b"\xfa\xfb\x03", bytes(600)):
        columns = same(data)
        assert (len(columns), columns.tables, columns.damage().noise_bytes) == (0, {}, len(data))


def test_a_packet_without_its_inside_is_read_as_its_object_is() -> None:
    for kind in (*READERS, *SIP_KINDS, IDENTITY_KIND):
        same(Frame(bytes((kind,))).to_bytes())


def test_numbers_come_as_arrays_and_texts_as_bytes() -> None:
    packets: list[ServerPacket] = [
        StandardSip(raw_x=7, sonar=(SonarReading(1, 2000), SonarReading(5, 3000))),
        EncoderPacket(left_counts=-3, right_counts=4, rest=b"new"),
        StandardSip(raw_x=9, raw_heading=-1, tail=(126,)),
    ]
    data = b"".join(packet_frame(packet, Profile.AROS).to_bytes() for packet in packets)
    columns = decode(np.frombuffer(data, np.uint8), Profile.AROS)
    sip, encoder = columns.tables["sip"], columns.tables["encoder"]
    assert sip["raw_x"].tolist() == [7, 9]
    assert sip["tail_count"].tolist() == [0, 1]
    assert sip["raw_battery_x10"].tolist() == [0, 126]
    assert sip.ragged["sonar"].rows.tolist() == [0, 0]
    assert sip.ragged["sonar"].columns["raw_range"].tolist() == [2000, 3000]
    assert encoder.bytes_of("rest") == [b"new"]
    structured = sip.structured()
    assert structured["packet"].tolist() == [0, 2]
    assert structured["raw_heading"].tolist() == [0, -1]


@given(streams)
def test_arrow_tables_hold_the_same_rows(data: bytes) -> None:
    pytest.importorskip("pyarrow")
    for table in decode(data, Profile.P2OS).tables.values():
        for packet, found in zip(table.packets.tolist(), to_arrow(table).to_pylist(), strict=True):
            row = table.row(table.packets.tolist().index(packet))
            listed = {name: list(value) if isinstance(value, tuple) else value for name, value in row.items()}
            assert found == {"packet": packet, **listed}


def test_arrow_tables_without_pyarrow_say_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingDependencyError, match="pyarrow"):
        to_arrow(decode(packet_frame(StandardSip(), Profile.P2OS).to_bytes(), Profile.P2OS).tables["sip"])


@pytest.mark.parametrize("name", ["encoder", "sip"])
def test_a_column_that_is_not_there_is_a_key_error(name: str) -> None:
    data = b"".join(packet_frame(packet, Profile.P2OS).to_bytes()
                    for packet in (StandardSip(), EncoderPacket(left_counts=1, right_counts=1)))  # fmt: skip
    table = decode(data, Profile.P2OS).tables[name]
    with pytest.raises(KeyError):
        table["no such"]
    with pytest.raises(KeyError):
        table.bytes_of("no such")


@pytest.mark.parametrize(
    "packet",
    [
        PlaylistPacket(),
        BatteryPacket(batteries=((),) * 3, row_bytes=0),
        BatteryPacket(batteries=((1, 2), (3, 4)), row_bytes=2),
    ],
)
def test_packets_that_hold_nothing_or_rows_keep_their_shape(packet: ServerPacket) -> None:
    same(packet_frame(packet, Profile.P2OS).to_bytes() * 2)


def test_a_vector_gives_the_rows_of_the_objects() -> None:
    for vector in json.loads((GOLDEN / "p2os_vectors.json").read_text(encoding="utf-8")):
        for profile in Profile:
            same(bytes.fromhex(vector["hex"]), profile)


@pytest.mark.parametrize("name", ["aria_p2de.jsonl", "player_p2de.jsonl"])
def test_a_captured_session_damaged_anywhere_gives_the_rows_of_the_objects(name: str) -> None:
    chunks = [json.loads(line) for line in (GOLDEN / "captures" / name).read_text(encoding="utf-8").splitlines()]
    stream = b"".join(bytes.fromhex(chunk["hex"]) for chunk in chunks if chunk["dir"] == "s2c")
    assert len(same(stream)) > 20
    for place in range(0, min(len(stream), 6000), 7):
        data = stream[:place] + bytes((stream[place] ^ 0x10,)) + stream[place + 1 :]
        near = data[max(0, place - 300) : place + 300]
        starts, ends = find_frames(np.frombuffer(near, np.uint8))
        assert [near[a:b] for a, b in zip(starts.tolist(), ends.tolist(), strict=True)] == decoded([(0, near)])[0]
