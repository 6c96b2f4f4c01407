"""Edges in bulk come out as if each had been looked at by itself, in C as in Python."""

from array import array
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.fabric.subscriptions import EDGE
from robot_bench.wires import edges as module
from robot_bench.wires.edges import (
    NO_WIRE,
    Edges,
    changes,
    changes_in_python,
    codes,
    codes_in_python,
    dumped,
    dumped_in_python,
    pack,
    pack_in_python,
    sampled,
    sampled_in_python,
    split,
    split_in_python,
    unpack,
    unpack_in_python,
)

native = pytest.mark.skipif(module._library() is None, reason="robot_bench._edges is not built")

Reader = Callable[[bytes, int, int], list[tuple[int, "array[int]"]]]
WIRES = 5
WIRE_OF_PIN = bytes(pin if pin < WIRES else NO_WIRE for pin in range(256))
CODES = bytes(range(10, 20)).ljust(256, b"\0")
rows = st.lists(st.tuples(st.integers(0, 2**40), st.integers(0, 7), st.integers(0, 4)), max_size=30)
times = st.lists(st.integers(0, 2**40) | st.integers(0, 9), max_size=20).map(sorted)
tracks = st.lists(times, min_size=1, max_size=WIRES).map(lambda all_: [Edges((at, 1) for at in one) for one in all_])


def dense(levels: list[tuple[int, int]]) -> Edges:
    return Edges(sorted(levels, key=lambda row: row[0]))


@native
@given(rows)
def test_rows_are_sorted_by_wire_in_both_languages(rows: list[tuple[int, int, int]]) -> None:
    data = b"".join(EDGE.pack(at, pin, drive, 0, 0, 0) for at, pin, drive in rows)
    found = split(data, WIRE_OF_PIN, CODES, WIRES)
    assert found == split_in_python(data, WIRE_OF_PIN, CODES)
    assert [wire for wire, *_ in found] == sorted({pin for _, pin, _ in rows if pin < WIRES})


@native
@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 1)), max_size=20), st.integers(0, 1))
def test_changes_are_the_same_in_both_languages(levels: list[tuple[int, int]], before: int) -> None:
    assert changes(dense(levels), before) == changes_in_python(dense(levels), before)


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 1)), max_size=20), st.integers(0, 1))
def test_changes_alternate_and_end_each_instant_with_its_last_level(levels: list[tuple[int, int]], before: int) -> None:
    found = changes(dense(levels), before)
    last = dict(dense(levels))
    at_instant, level = [], before
    for at, value in sorted(last.items()):
        if value != level:
            at_instant.append((at, value))
            level = value
    assert found == at_instant


@native
@given(tracks, st.integers(1, 9))
def test_blocks_are_the_same_in_both_languages(tracks: list[Edges], most: int) -> None:
    assert list(pack(tracks, most)) == list(pack_in_python(tracks, most))


@pytest.mark.parametrize("reader", [pytest.param(unpack, marks=native), unpack_in_python])
@given(tracks=tracks, most=st.integers(1, 9))
def test_a_block_read_back_is_what_was_written(reader: Reader, tracks: list[Edges], most: int) -> None:
    found: dict[int, list[int]] = {}
    for first, count, block in pack(tracks, most):
        got = reader(block, len(tracks), first)
        assert sum(len(of_wire) for _, of_wire in got) == count <= most
        for wire, of_wire in got:
            found.setdefault(wire, []).extend(of_wire)
    assert found == {wire: list(track.times) for wire, track in enumerate(tracks) if track}


def outcome(reader: Reader, block: bytes, wires: int, first: int) -> object:
    try:
        return reader(block, wires, first)
    except ValueError:
        return "damaged"


@native
@given(st.binary(max_size=40), st.integers(-1, 256), st.integers(-1, 2**63 - 1))
def test_any_bytes_are_read_or_refused_alike(block: bytes, wires: int, first: int) -> None:
    assert outcome(unpack, block, wires, first) == outcome(
        lambda *of: unpack_in_python(*of) if 0 < wires < NO_WIRE and first >= 0 else "damaged", block, wires, first
    )


DAMAGED = [
    (b"\x81", 0),  # cut within a number
    (b"\xff" * 9 + b"\x01", 0),  # a number of ten bytes
    (b"\x05", 2**63 - 1),  # a time beyond 64 bits
]


@pytest.mark.parametrize("reader", [pytest.param(unpack, marks=native), unpack_in_python])
@pytest.mark.parametrize(("block", "first"), DAMAGED)
def test_a_damaged_block_is_refused(reader: Reader, block: bytes, first: int) -> None:
    assert outcome(reader, block, 1, first) == "damaged"


def test_edges_are_a_sequence_of_times_and_levels() -> None:
    some = Edges([(1, 1), (5, 0), (9, 1)])
    assert some == [(1, 1), (5, 0), (9, 1)]
    assert (some[-1], some[1:], len(some)) == ((9, 1), Edges([(5, 0), (9, 1)]), 3)
    with pytest.raises(OverflowError):
        some.append(2**63, 1)
    assert list(some) == [(1, 1), (5, 0), (9, 1)]
    some.extend(array("q", [10]), b"\0")
    assert some[3] == (10, 0)


one_level_an_instant = st.dictionaries(st.integers(0, 40), st.integers(0, 1), max_size=15)
levels = st.lists(one_level_an_instant.map(lambda levels: dense(list(levels.items()))), min_size=1, max_size=8)


@native
@given(levels)
def test_codes_are_the_same_in_both_languages(tracks: list[Edges]) -> None:
    assert codes(tracks) == codes_in_python(tracks)


@given(levels)
def test_a_code_is_what_its_wires_are_after_each_instant(tracks: list[Edges]) -> None:
    found, now = dict(codes(tracks)), 0
    for at in range(41):
        now = found.get(at, now)
        if any(track and track.times[0] <= at for track in tracks):
            held = [[level for t, level in track if t <= at] for track in tracks]
            assert now == sum((level[-1] if level else 0) << bit for bit, level in enumerate(held))


@native
@given(tracks=levels, piece=st.integers(40, 200))
def test_a_dump_is_the_same_in_both_languages(tracks: list[Edges], piece: int) -> None:
    identifiers = ["!", "a", "zz", "b", "c", "d", "e", "f"][: len(tracks)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_PIECE", piece)
        assert "".join(dumped(tracks, identifiers)) == "".join(dumped_in_python(tracks, identifiers))


@native
@given(
    tracks=levels, wires=st.integers(1, 17), rate_hz=st.sampled_from([10**9, 10**8]), count=st.integers(1, 60),
    piece=st.integers(3, 9),
)  # fmt: skip
def test_samples_are_the_same_in_both_languages(
    tracks: list[Edges], wires: int, rate_hz: int, count: int, piece: int
) -> None:
    tracks = (tracks * wires)[:wires]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_PIECE", piece)
        found = b"".join(sampled(tracks, rate_hz, count))
    assert found == b"".join(sampled_in_python(tracks, rate_hz, count))
    unit = max(1, -(-len(tracks) // 8))
    assert len(found) == count * unit
    for number in range(count):
        held = [[level for t, level in track if t * rate_hz <= number * 10**9] for track in tracks]
        sample = int.from_bytes(found[number * unit : (number + 1) * unit], "little")
        assert sample == sum((level[-1] if level else 0) << bit for bit, level in enumerate(held))
