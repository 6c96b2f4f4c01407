"""Frames: each is read as it was packed, and nothing else is one."""

import struct
from array import array
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.view.channels import BY_NAME, KINDS, CellType, ChannelKind
from p2os.view.frames import HEAD, FrameError, FrameFlags, ViewFrame, empty_columns, frames_in

I64 = st.integers(-(2**63), 2**63 - 1)
CELLS: dict[CellType, st.SearchStrategy[Any]] = {
    CellType.I64: I64,
    CellType.F64: st.floats(allow_nan=False),
    CellType.F32: st.floats(width=32, allow_nan=False),
    CellType.U32: st.integers(0, 2**32 - 1),
    CellType.U8: st.integers(0, 255),
    CellType.TEXT: st.text(st.characters(codec="utf-8"), max_size=6),
    CellType.BYTES: st.binary(max_size=6),
}


@st.composite
def frames(draw: st.DrawFn) -> ViewFrame:
    kind: ChannelKind = draw(st.sampled_from(KINDS))
    count = draw(st.integers(0, 5))
    width = draw(st.integers(0, 3)) if any(column.is_wide for column in kind.columns) else 1
    columns = empty_columns(kind)
    for column, values in zip(kind.columns, columns, strict=True):
        cells = count * (width if column.is_wide else 1)
        values.extend(draw(st.lists(CELLS[column.cells], min_size=cells, max_size=cells)))
    flags = FrameFlags(draw(st.integers(0, 3)))
    of = draw(st.integers(count, 2**32 - 1))
    return ViewFrame(kind=kind, channel=draw(st.integers(0, 2**32 - 1)), columns=tuple(columns), from_ns=draw(I64),
                     to_ns=draw(I64), of=of, width=width, flags=flags)  # fmt: skip


@given(frames())
def test_a_frame_is_read_as_it_was_packed(frame: ViewFrame) -> None:
    assert ViewFrame.from_bytes(frame.to_bytes()) == frame


@settings(max_examples=30)
@given(frames())
def test_a_frame_that_is_cut_at_any_byte_or_longer_is_refused(frame: ViewFrame) -> None:
    data = frame.to_bytes()
    for end in range(len(data)):
        with pytest.raises(FrameError):
            ViewFrame.from_bytes(data[:end])
    for more in (b"\0", bytes(8)):
        with pytest.raises(FrameError):
            ViewFrame.from_bytes(data + more)


@settings(max_examples=60)
@given(frames(), st.data())
def test_what_is_accepted_with_a_byte_changed_is_spelled_alike(frame: ViewFrame, data: st.DataObject) -> None:
    packed = bytearray(frame.to_bytes())
    place = data.draw(st.integers(0, len(packed) - 1))
    packed[place] ^= data.draw(st.integers(1, 255))
    try:
        found = ViewFrame.from_bytes(bytes(packed))
    except FrameError:
        return
    assert found.to_bytes() == packed


@given(st.binary(max_size=200))
def test_anything_else_is_refused_in_one_way(data: bytes) -> None:
    for one in (data, b"P2VF\1" + data):
        with pytest.raises(FrameError):
            ViewFrame.from_bytes(one)


@given(st.lists(frames(), max_size=4))
def test_frames_that_stand_one_behind_the_other_are_found(several: list[ViewFrame]) -> None:
    assert list(frames_in(b"".join(frame.to_bytes() for frame in several))) == several


def test_every_column_lies_at_a_multiple_of_eight_bytes() -> None:
    texts = ["a", "bc", "a"]
    frame = ViewFrame(
        kind=BY_NAME["text"], channel=7, columns=(array("q", [1, 2, 3]), array("B", [0, 1, 0]), texts), from_ns=0,
        to_ns=9, of=3,
    )  # fmt: skip
    data = frame.to_bytes()
    assert HEAD.size == 48
    assert struct.unpack_from("<3q", data, 48) == (1, 2, 3)
    assert data[72:80] == b"\0\1\0" + bytes(5)
    assert struct.unpack_from("<II3I", data, 80) == (2, 3, 0, 1, 0)  # two distinct texts of three bytes, and whose
    assert struct.unpack_from("<2I", data, 104) == (1, 3)
    assert data[112:] == b"abc" + bytes(5)
    assert len(data) % 8 == 0


def texts(distinct: int, rows: list[int], ends: list[int], blob: bytes, behind: bytes = b"") -> bytes:
    """Return a frame of lines of text with these parts of its last column, its size as it is."""

    def filled(data: bytes) -> bytes:
        return data + bytes(-len(data) % 8)

    count = len(rows)
    column = struct.pack("<II", distinct, len(blob)) + filled(struct.pack(f"<{count}I", *rows))
    column += filled(struct.pack(f"<{len(ends)}I", *ends)) + filled(blob)
    body = filled(struct.pack(f"<{count}q", *range(count))) + filled(bytes(count)) + column + behind
    size = HEAD.size + len(body)
    return HEAD.pack(b"P2VF", 1, BY_NAME["text"].number, 0, 0, 0, count, 1, count, size, 0, 0, count) + body


def test_texts_are_spelled_in_one_way() -> None:
    assert ViewFrame.from_bytes(texts(2, [0, 1, 0], [1, 3], b"abc")).columns[2] == ["a", "bc", "a"]
    for wrong in (
        texts(2, [0, 1, 0], [1, 3], b"abc", behind=bytes(8)),  # more behind
        texts(2, [0, 0, 0], [1, 3], b"abc"),  # a text of no row
        texts(2, [1, 0, 1], [1, 3], b"abc"),  # not in the order of their rows
        texts(2, [0, 1, 0], [1, 2], b"aa"),  # one that stands twice
        texts(2, [0, 2, 0], [1, 3], b"abc"),  # a row whose text is not there
        texts(2, [0, 1, 0], [3, 1], b"abc"),  # one that ends before it begins
        texts(2, [0, 1, 0], [1, 2], b"abc"),  # bytes of no text
        texts(1, [0, 0, 0], [1], b"\xff"),  # no UTF-8
    ):
        with pytest.raises(FrameError):
            ViewFrame.from_bytes(wrong)


def test_a_text_that_has_no_bytes_is_packed_all_the_same() -> None:
    frame = ViewFrame(
        kind=BY_NAME["text"], channel=0, columns=(array("q", [0, 0]), array("B", [0, 0]), ["\ud800", "?"]), from_ns=0,
        to_ns=0, of=2,
    )  # fmt: skip
    assert ViewFrame.from_bytes(frame.to_bytes()).columns[2] == ["?", "?"]


def test_columns_that_do_not_fit_one_another_make_no_frame() -> None:
    kind = BY_NAME["samples"]
    for columns in ((array("q", [1]),), (array("q", [1]), array("d")), (array("q", [1]), array("f", [1.0]))):
        with pytest.raises(FrameError):
            ViewFrame(kind=kind, channel=0, columns=columns, from_ns=0, to_ns=0, of=1).to_bytes()
    with pytest.raises(FrameError, match="1 rows of 0"):
        ViewFrame(kind=kind, channel=0, columns=(array("q", [1]), array("d", [1.0])), from_ns=0, to_ns=0, of=0)


def test_numbers_of_kinds_are_told_apart() -> None:
    assert len({kind.number for kind in KINDS}) == len({kind.name for kind in KINDS}) == len(KINDS)
