"""Nothing that a firmware, a robot or a file says acts on the terminal that shows it."""

import io
import unicodedata
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simbase.terminal import ReadableBytes, ReadableStream, drawn, readable

BIDI = "\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"


@given(st.text())
def test_what_is_readable_holds_nothing_that_acts(text: str) -> None:
    shown = readable(text)
    assert not [
        c for c in shown if c in BIDI or (unicodedata.category(c) in {"Cc", "Zl", "Zp", "Cs"} and c not in "\t\n\r")
    ]
    assert readable(shown) == shown
    kept = [c for c in text if c.isprintable() or c in "\t\n\r"]
    assert kept == [c for c in kept if c in shown]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("plain\tä 漢 🤖\r\n", "plain\tä 漢 🤖\r\n"), ("\x1b[31mred", "\\x1b[31mred"),
        ("\x1b]0;t\x07", "\\x1b]0;t\\x07"),
        ("\x9b2J", "\\x9b2J"), ("a\u202eb", "a\\u202eb"), ("\u2066", "\\u2066"), ("\x08\x7f\0", "\\x08\\x7f\\x00"),
        ("\ud800", "\\ud800"), ("", ""),
    ],
)  # fmt: skip
def test_each_is_written_as_its_escape(text: str, shown: str) -> None:
    assert readable(text) == shown


@given(st.binary(max_size=40), st.lists(st.integers(0, 40)))
def test_bytes_come_out_the_same_however_they_are_cut(data: bytes, cuts: list[int]) -> None:
    whole, cut = ReadableBytes(), ReadableBytes()
    ends = [0, *sorted(min(at, len(data)) for at in cuts), len(data)]
    pieces = b"".join(cut.take(data[begin:end]) for begin, end in pairwise(ends))
    expected = whole.take(data, is_end=True)
    assert pieces + cut.take(b"", is_end=True) == expected
    assert readable(expected.decode("utf-8")) == expected.decode("utf-8")


def test_a_stream_writes_readable_text_and_draws_beside() -> None:
    behind = io.StringIO()
    stream = ReadableStream(behind)
    assert stream.write("\x1b[2J\u202e") == 5
    stream.writelines(["\r\x1b[K+0.3 m/s \x1b[1A"])
    drawn(stream).write("\x1b[32m")  # type: ignore[arg-type]  # it has all that a stream has
    assert behind.getvalue() == "\\x1b[2J\\u202e\r\x1b[K+0.3 m/s \\x1b[1A\x1b[32m"
    assert not stream.isatty()  # type: ignore[operator]  # of the stream behind
