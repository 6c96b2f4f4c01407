"""What is copied and converted many at a time, against the same one by one."""

from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

np = pytest.importorskip("numpy")

from p2os.capture.cells import Alike, Cell, cell_text, texts_of  # noqa: E402
from p2os.capture.chunks import Direction, Part, capture_of, chunks_of, in_order  # noqa: E402
from p2os.capture.columns.column import ArrayConversion, Column  # noqa: E402
from p2os.capture.columns.gathering import joined  # noqa: E402
from p2os.capture.formats.recording import recorded_parts, write_recording  # noqa: E402
from p2os.capture.formats.recording_bulk import plain_lines  # noqa: E402
from p2os.capture.formats.tcp_streams import TcpStreams  # noqa: E402
from tests.p2os.capture.blocks import parts_of  # noqa: E402

steps = st.sampled_from((0, 1, 9, 90, 900, 10**8, 10**13))
parts = st.lists(
    st.tuples(steps, st.sampled_from(Direction), st.binary(min_size=1, max_size=5)), min_size=1, max_size=6
)


@given(parts, st.booleans(), st.data())
def test_lines_whose_times_have_any_number_of_digits_are_read_at_once(
    found: list[Part], is_crlf: bool, data: st.DataObject
) -> None:
    times = accumulate(step for step, _, _ in found)
    timed = [(at_ns, direction, said) for at_ns, (_, direction, said) in zip(times, found, strict=True)]
    lines = write_recording(capture_of(timed)).split("\n", 1)[1].encode()
    if is_crlf:
        lines = lines.replace(b"\n", b"\r\n")
    block = plain_lines(lines)
    assert block is not None
    assert parts_of(block) == timed
    place = data.draw(st.integers(0, len(lines)))
    hit = lines[:place] + data.draw(st.sampled_from((b"", b"7", b",", b"\n", b'"'))) + lines[place + 1 :]
    read = plain_lines(hit)
    assert read is None or parts_of(read) == list(recorded_parts(hit.decode().splitlines()))


def test_a_time_that_steps_back_within_a_block_of_lines_is_moved_up() -> None:
    line = '{"t": %d, "dir": "r2c", "hex": "fa"}\n'
    block = plain_lines("".join(line % at_ns for at_ns in (5, 7, 6, 8)).encode())
    assert block is not None
    assert [chunk.at_ns for chunk in chunks_of(in_order([block]))] == [5, 7, 7, 8]


@given(st.binary(max_size=60), st.lists(st.tuples(st.integers(0, 60), st.integers(0, 9)), max_size=40))
def test_pieces_that_stand_apart_are_joined(data: bytes, wanted: list[tuple[int, int]]) -> None:
    pieces = [(start, size) for start, size in wanted if start + size <= len(data)]
    starts, sizes = (np.array([piece[which] for piece in pieces], np.int64) for which in (0, 1))
    assert joined(data, starts, sizes) == b"".join(data[start : start + size] for start, size in pieces)


texts = st.text(max_size=4)
KINDS: dict[str, st.SearchStrategy[Cell]] = {
    "b": st.booleans(),
    "i": st.integers(-(2**63), 2**63 - 1),
    "f": st.floats(allow_nan=False),
    "O": texts,
}


@given(st.data(), st.sampled_from(sorted(KINDS)))
def test_a_column_becomes_an_arrow_array_of_the_same_cells(data: st.DataObject, kind: str) -> None:
    pytest.importorskip("pyarrow")
    from p2os.capture.columns.arrow import cells_array, kind_of

    cells: list[Cell] = data.draw(st.lists(st.one_of(st.none(), KINDS[kind]), max_size=20))
    array = cells_array(cells, kind)
    assert array.to_pylist() == cells
    assert array.null_count == cells.count(None)
    array.validate(full=True)
    assert set(cells) <= {None} or kind_of(cells) == kind
    column = Column.of(cells, kind)
    assert list(column) == cells
    for texts in (column.texts(), texts_of(cells)):
        spread = [texts.text] * len(cells) if isinstance(texts, Alike) else texts
        assert spread == [cell_text(cell) for cell in cells]


@given(st.lists(st.tuples(st.integers(0, 5), st.booleans()), min_size=1, max_size=20))
def test_texts_of_a_conversion_become_an_arrow_array(rows: list[tuple[int, bool]]) -> None:
    pytest.importorskip("pyarrow")
    from p2os.capture.columns.arrow import cells_array

    said = ("", "SIP", "SIP", "ä€", "x\0", "a,b").__getitem__
    codes, present = np.array([code for code, _ in rows], np.uint8), np.array([there for _, there in rows], np.bool_)
    wanted = [said(code) if there else None for code, there in rows]
    for mask, cells in ((present, wanted), (None, [said(code) for code, _ in rows])):
        column = ArrayConversion(said, str).column(codes, mask)
        array = cells_array(column, column.kind)
        array.validate(full=True)
        assert array.to_pylist() == list(column) == cells
        assert column.encoded()[0].tolist() == [len((cell or "").encode()) for cell in cells]


@pytest.mark.parametrize(
    ("size", "said"),
    [(33, []), (40, []), (41, [b"n"]), (42, [b"no"]), (44, [b"nope"]), (0, [b"nope"]), (99, [b"nope"])],
)
@pytest.mark.parametrize("words", [4, 5])
def test_a_segment_ends_where_its_packet_does_and_begins_behind_a_whole_header(
    size: int, said: list[bytes], words: int
) -> None:
    tcp = (8101).to_bytes(2, "big") + bytes(10) + bytes([words << 4]) + bytes(7) + b"nope"
    packet = b"\x45\0" + size.to_bytes(2, "big") + bytes(5) + b"\x06" + bytes(2) + b"\x7f\0\0\1" * 2 + tcp
    found = TcpStreams().take(101, packet)
    assert ([] if found is None or not found[1] else [found[1]]) == (said if words == 5 else [])
