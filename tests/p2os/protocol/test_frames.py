"""The wire: every vector, every cut, every flipped bit, any stream of bytes."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.errors import LocalProtocolError
from p2os.protocol.frames import (
    MAX_PAYLOAD_BYTES,
    BadChecksum,
    BadCount,
    Decoder,
    Frame,
    Item,
    Noise,
    Stalled,
    checksum,
)
from simbase.timing import NS_PER_MS

GOLDEN = Path(__file__).parents[2] / "golden"
VECTORS = json.loads((GOLDEN / "p2os_vectors.json").read_text(encoding="utf-8"))
VECTORS = VECTORS["vectors"] if isinstance(VECTORS, dict) else VECTORS
SYNC0 = bytes.fromhex("fafb03000000")
VEL_200 = bytes.fromhex("fafb060b3bc800d33b")
GIVE_UP_NS = 250 * NS_PER_MS

payloads = st.binary(min_size=1, max_size=MAX_PAYLOAD_BYTES)


def items(decoder: Decoder) -> list[Item]:
    found = []
    while (item := decoder.next_item()) is not None:
        found.append(item)
    return found


def frames(data: bytes, *, wait: bool = True) -> list[bytes]:
    decoder = Decoder()
    decoder.receive(data, 0)
    if wait:
        decoder.advance_to(GIVE_UP_NS)
    return [item.to_bytes() for item in items(decoder) if isinstance(item, Frame)]


def test_there_are_as_many_vectors_as_the_reference_says() -> None:
    assert len(VECTORS) == 98
    assert sum(vector["valid"] for vector in VECTORS) == 90


def test_a_vector_is_decoded_or_resynchronised() -> None:
    for vector in VECTORS:
        data = bytes.fromhex(vector["hex"])
        expected = [data] if vector["valid"] else [bytes.fromhex(x) for x in vector["decoded"].get("expect_frames", [])]
        assert frames(data) == expected, vector["name"]


@given(payloads)
def test_a_frame_survives_the_wire(payload: bytes) -> None:
    frame = Frame(payload)
    assert Frame.from_bytes(frame.to_bytes()) == frame
    assert frame.kind == payload[0]
    assert frame.data == payload[1:]
    assert frames(frame.to_bytes(), wait=False) == [frame.to_bytes()]


@pytest.mark.parametrize("size", [0, MAX_PAYLOAD_BYTES + 1])
def test_a_payload_that_no_frame_holds_is_refused(size: int) -> None:
    with pytest.raises(LocalProtocolError):
        Frame(bytes(size))


@pytest.mark.parametrize("data", [b"", SYNC0[:-1], SYNC0 + b"\0", b"\0" + SYNC0[1:], SYNC0[:-1] + b"\1"])
def test_what_is_not_one_whole_frame_is_refused(data: bytes) -> None:
    with pytest.raises(LocalProtocolError):
        Frame.from_bytes(data)


@given(payloads)
def test_the_checksum_is_the_sum_of_pairs(payload: bytes) -> None:
    total = 0
    for place in range(0, len(payload) - 1, 2):
        total += payload[place] << 8 | payload[place + 1]
    expected = total & 0xFFFF
    if len(payload) % 2:
        expected ^= payload[-1]
    assert checksum(payload) == expected


@given(st.lists(payloads, max_size=4), st.data())
def test_any_cutting_of_the_stream_gives_the_same_items(parts: list[bytes], data: st.DataObject) -> None:
    stream = b"".join(Frame(payload).to_bytes() for payload in parts)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    decoder = Decoder()
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        decoder.receive(stream[start:end], 0)
    assert items(decoder) == [Frame(payload) for payload in parts]


def test_one_flipped_bit_costs_one_frame_and_no_other() -> None:
    good = Frame(b"\x1d").to_bytes()
    for bit in range(8 * len(VEL_200)):
        damaged = bytearray(VEL_200)
        damaged[bit // 8] ^= 1 << bit % 8
        assert frames(bytes(damaged) + good * 40)[-40:] == [good] * 40, bit


def test_a_cut_frame_hides_nothing_that_follows() -> None:
    for cut in range(1, len(VEL_200)):
        assert frames(VEL_200[:cut] + SYNC0 * 40)[-40:] == [SYNC0] * 40, cut


@pytest.mark.parametrize("count", [200, 204, 205, 255, 0, 1, 2])
def test_a_false_header_cannot_swallow_a_sync_on_a_quiet_line(count: int) -> None:
    decoder = Decoder()
    decoder.receive(bytes((0xFA, 0xFB, count)) + SYNC0, 0)
    decoder.advance_to(GIVE_UP_NS - 1)
    early = [item for item in items(decoder) if isinstance(item, Frame)]
    decoder.advance_to(GIVE_UP_NS)
    late = [item for item in items(decoder) if isinstance(item, Frame)]
    assert [*early, *late] == [Frame(b"\0")]
    assert bool(late) is (3 <= count <= 204)
    assert decoder.stats.rescued == (1 if late else 0)
    assert decoder.next_deadline() is None


def test_a_payload_is_never_scanned_inside_a_sound_frame() -> None:
    outer = Frame(b"\x2a\x2b\x06" + SYNC0)
    assert frames(outer.to_bytes()) == [outer.to_bytes()]


def test_a_frame_inside_a_damaged_one_is_found_and_counted() -> None:
    outer = bytearray(Frame(b"\x2a\x2b\x06" + SYNC0).to_bytes())
    outer[-1] ^= 1
    decoder = Decoder()
    decoder.receive(bytes(outer), 0)
    assert Frame(b"\0") in items(decoder)
    assert (decoder.stats.bad_checksums, decoder.stats.rescued) == (1, 1)


def test_every_kind_of_damage_is_reported_and_counted() -> None:
    decoder = Decoder()
    decoder.receive(b"\x01\x02" + bytes.fromhex("fafb060b3bc8001234") + bytes.fromhex("fafb00"), 0)
    decoder.receive(bytes.fromhex("fafb06"), 5)
    assert decoder.next_deadline() == 5 + GIVE_UP_NS
    decoder.advance_to(5 + GIVE_UP_NS)
    found = items(decoder)
    assert {type(item) for item in found} == {Noise, BadChecksum, BadCount, Stalled}
    bad = next(item for item in found if isinstance(item, BadChecksum))
    assert (bad.expected, bad.got) == (0xD33B, 0x1234)
    assert decoder.stats.noise_bytes == 2 + 9 + 3 + 3
    stats = decoder.stats
    assert (stats.bad_checksums, stats.bad_counts, stats.stalled) == (1, 1, 1)


@given(st.binary(max_size=600), st.lists(st.integers(0, 600), max_size=5))
def test_no_bytes_raise_or_stay(stream: bytes, cuts: list[int]) -> None:
    decoder, now = Decoder(), 0
    for start, end in zip([0, *sorted(cuts)], [*sorted(cuts), len(stream)], strict=True):
        now += 1000
        decoder.receive(stream[start:end], now)
    decoder.advance_to(now + GIVE_UP_NS)
    held = sum(len(item.to_bytes()) for item in items(decoder) if isinstance(item, Frame))
    assert held + decoder.stats.noise_bytes == len(stream)
    assert decoder.next_deadline() is None


@given(st.binary(max_size=80), st.binary(max_size=80))
def test_a_restored_decoder_goes_on_as_the_first(before: bytes, after: bytes) -> None:
    first, second = Decoder(), Decoder()
    first.receive(before, 3)
    second.restore(first.snapshot())
    for decoder in (first, second):
        decoder.receive(after, 9)
        decoder.advance_to(10 + GIVE_UP_NS)
    assert items(first) == items(second)
    assert first.stats == second.stats


@pytest.mark.parametrize("name", ["aria_p2de.jsonl", "player_p2de.jsonl"])
def test_a_captured_session_decodes_without_a_rejected_byte(name: str) -> None:
    decoders = {"c2s": Decoder(), "s2c": Decoder()}
    for line in (GOLDEN / "captures" / name).read_text(encoding="utf-8").splitlines():
        chunk = json.loads(line)
        if chunk["dir"] in decoders:
            decoders[chunk["dir"]].receive(bytes.fromhex(chunk["hex"]), round(chunk["t"] * 1e9))
    for decoder in decoders.values():
        assert decoder.stats.frames >= 20
        assert (decoder.stats.noise_bytes, decoder.stats.bad_checksums, decoder.stats.bad_counts) == (0, 0, 0)
