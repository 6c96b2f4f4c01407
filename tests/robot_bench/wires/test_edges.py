"""Edges in bulk come out as if each had been looked at by itself."""

from array import array

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.fabric.subscriptions import EDGE
from robot_bench.wires import edges as module
from robot_bench.wires.edges import NO_WIRE, Edges, changes, codes, dumped, pack, sampled, split, unpack

WIRES = 5
WIRE_OF_PIN = bytes(pin if pin < WIRES else NO_WIRE for pin in range(256))
CODES = bytes(range(10, 20)).ljust(256, b"\0")


def time_of(data: bytes) -> int:
    """Return a time: one of each two below 10, where edges meet, the other of 16 bits, up to 24 to the left."""
    return data[1] % 10 if data[2] & 1 else (data[0] << 8 | data[1]) << (data[2] >> 1) % 25


# Drawn as bytes: to draw each number takes longer than all else.
rows = st.lists(
    st.binary(min_size=4, max_size=4).map(lambda data: (time_of(data), data[3] & 7, (data[3] >> 3) % 5)), max_size=30
)
times = st.lists(st.binary(min_size=3, max_size=3).map(time_of), max_size=20).map(sorted)
tracks = st.lists(times, min_size=1, max_size=WIRES).map(lambda all_: [Edges((at, 1) for at in one) for one in all_])


def dense(levels: list[tuple[int, int]]) -> Edges:
    return Edges(sorted(levels, key=lambda row: row[0]))


@given(rows)
def test_rows_are_sorted_by_wire(rows: list[tuple[int, int, int]]) -> None:
    data = b"".join(EDGE.pack(at, pin, drive, 0, 0, 0) for at, pin, drive in rows)
    expected = {}
    for at, pin, drive in rows:
        if pin < WIRES:
            expected.setdefault(pin, []).append((at, CODES[drive]))
    found = split(data, WIRE_OF_PIN, CODES, WIRES)
    assert [(wire, list(zip(times, codes, strict=True))) for wire, times, codes in found] == sorted(expected.items())


@given(st.binary(max_size=20), st.integers(0, 1))
def test_changes_alternate_and_end_each_instant_with_its_last_level(data: bytes, before: int) -> None:
    levels = [(byte % 10, byte >> 7) for byte in data]
    found = changes(dense(levels), before)
    last = dict(dense(levels))
    at_instant, level = [], before
    for at, value in sorted(last.items()):
        if value != level:
            at_instant.append((at, value))
            level = value
    assert found == at_instant


def test_a_block_has_the_bytes_that_its_format_says() -> None:
    tracks = [Edges([(1000, 1), (1100, 0)]), Edges([(1000, 1)])]
    # (0 ns, wire 0), (0 ns, wire 1), (100 ns, wire 0) of two wires: 0, 1, 200 = 72 + 128 * 1; then the rest apart.
    assert list(pack(tracks, 9)) == [(1000, 3, b"\x00\x01\xc8\x01")]
    assert list(pack(tracks, 2)) == [(1000, 2, b"\x00\x01"), (1100, 1, b"\x00")]


@given(tracks=tracks, most=st.integers(1, 9))
def test_a_block_read_back_is_what_was_written(tracks: list[Edges], most: int) -> None:
    found: dict[int, list[int]] = {}
    for first, count, block in pack(tracks, most):
        got = unpack(block, len(tracks), first)
        assert sum(len(of_wire) for _, of_wire in got) == count <= most
        for wire, of_wire in got:
            found.setdefault(wire, []).extend(of_wire)
    assert found == {wire: list(track.times) for wire, track in enumerate(tracks) if track}


@given(st.binary(max_size=40), st.integers(-1, 256), st.integers(-1, 2**63 - 1))
def test_any_bytes_are_read_or_refused(block: bytes, wires: int, first: int) -> None:
    try:
        found = unpack(block, wires, first)
    except ValueError:
        return
    assert sum(len(of_wire) for _, of_wire in found) == sum(byte < 128 for byte in block)
    assert all(0 <= wire < wires and list(of_wire) == sorted(of_wire) for wire, of_wire in found)
    assert all(first <= at for _, of_wire in found for at in of_wire)


DAMAGED = [
    (b"\x81", 0),  # cut within a number
    (b"\xff" * 9 + b"\x01", 0),  # a number of ten bytes
    (b"\x05", 2**63 - 1),  # a time beyond 64 bits
]


@pytest.mark.parametrize(("block", "first"), DAMAGED)
def test_a_damaged_block_is_refused(block: bytes, first: int) -> None:
    with pytest.raises(ValueError, match="damaged"):
        unpack(block, 1, first)


@pytest.mark.parametrize(("wires", "first"), [(0, 0), (NO_WIRE, 0), (1, -1)])
def test_a_block_of_no_wires_or_before_time_0_is_refused(wires: int, first: int) -> None:
    with pytest.raises(ValueError, match="no such block"):
        unpack(b"\0", wires, first)


def test_edges_are_a_sequence_of_times_and_levels() -> None:
    some = Edges([(1, 1), (5, 0), (9, 1)])
    assert some == [(1, 1), (5, 0), (9, 1)]
    assert (some[-1], some[1:], len(some)) == ((9, 1), Edges([(5, 0), (9, 1)]), 3)
    with pytest.raises(OverflowError):
        some.append(2**63, 1)
    assert list(some) == [(1, 1), (5, 0), (9, 1)]
    some.extend(array("q", [10]), b"\0")
    assert some[3] == (10, 0)


def one_level_an_instant(data: bytes) -> Edges:
    """Return an edge for each byte, at most one at a time up to 40."""
    return dense(list({byte % 41: byte >> 7 for byte in data}.items()))


levels = st.lists(st.binary(max_size=15).map(one_level_an_instant), min_size=1, max_size=8)


@given(levels)
def test_a_code_is_what_its_wires_are_after_each_instant(tracks: list[Edges]) -> None:
    found, now = dict(codes(tracks)), 0
    for at in range(41):
        now = found.get(at, now)
        if any(track and track.times[0] <= at for track in tracks):
            held = [[level for t, level in track if t <= at] for track in tracks]
            assert now == sum((level[-1] if level else 0) << bit for bit, level in enumerate(held))


@given(tracks=levels, piece=st.integers(40, 200))
def test_a_dump_has_each_instant_once_and_its_levels_in_the_order_of_wires(tracks: list[Edges], piece: int) -> None:
    identifiers = ["!", "a", "zz", "b", "c", "d", "e", "f"][: len(tracks)]
    expected, now = "", -1
    for at, wire, level in sorted((at, wire, level) for wire, track in enumerate(tracks) for at, level in track):
        expected += ("" if at == now else f"#{at}\n") + f"{level}{identifiers[wire]}\n"
        now = at
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_PIECE", piece)
        assert "".join(dumped(tracks, identifiers)) == expected


@given(
    tracks=levels, wires=st.integers(1, 17), rate_hz=st.sampled_from([10**9, 10**8]), count=st.integers(1, 60),
    piece=st.integers(3, 9),
)  # fmt: skip
def test_a_sample_is_what_each_wire_is_then(
    tracks: list[Edges], wires: int, rate_hz: int, count: int, piece: int
) -> None:
    tracks = (tracks * wires)[:wires]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_PIECE", piece)
        found = b"".join(sampled(tracks, rate_hz, count))
    unit = max(1, -(-len(tracks) // 8))
    assert len(found) == count * unit
    for number in range(count):
        held = [[level for t, level in track if t * rate_hz <= number * 10**9] for track in tracks]
        sample = int.from_bytes(found[number * unit : (number + 1) * unit], "little")
        assert sample == sum((level[-1] if level else 0) << bit for bit, level in enumerate(held))
