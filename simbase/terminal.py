"""Text of others on a terminal: of a firmware, a robot, a file, none of whose characters may act on it.

A terminal obeys escape sequences, and shows text in another order than it stands in where bidirectional controls ask
for that. `readable` writes such characters as Python does, a backslash with their number; printable text in any script,
line feed, carriage return and tab stay. The command line puts a `ReadableStream` before standard output and standard
error, so that nothing has to be remembered where something is printed; who draws (rich) writes to what is behind it.

Invariant: what `readable` returns holds no control character but tab, line feed and carriage return, and none that
turns text around.
"""

import codecs
import contextlib
import re
import sys
from collections.abc import Iterator
from typing import TextIO, cast

#: C0 but for \\t \\n \\r, DEL, C1, line and paragraph separators, the bidirectional controls, halves of surrogates.
_ACTING = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)
#: How a line that is drawn over begins, as the verbs that move a robot do.
_ERASED = "\r\x1b[K"


def readable(text: str) -> str:
    """Return a text without what acts on a terminal: each such character as its escape."""
    return text if text.isprintable() else _ACTING.sub(lambda found: ascii(found[0])[1:-1], text)


class ReadableBytes:
    """Makes a stream of bytes, as a firmware sends them, readable text; a character may come in pieces."""

    def __init__(self) -> None:
        self._decoder = codecs.getincrementaldecoder("utf-8")("backslashreplace")

    def take(self, data: bytes, *, is_end: bool = False) -> bytes:
        """Return what can be shown of the bytes so far, in UTF-8; bytes that are no text as their numbers."""
        return readable(self._decoder.decode(data, final=is_end)).encode("utf-8")


class ReadableStream:
    """A text stream that writes to another one what `readable` makes of it; all else is that stream's.

    Args:
        drawn: The stream behind it, to which who draws may write.
    """

    def __init__(self, drawn: TextIO) -> None:
        self.drawn = drawn

    def write(self, text: str) -> int:
        """Write a text; one that begins by erasing its line may."""
        if isinstance(text, str) and text.startswith(_ERASED):
            self.drawn.write(_ERASED + readable(text.removeprefix(_ERASED)))
        else:
            self.drawn.write(readable(text) if isinstance(text, str) else text)
        return len(text)

    def writelines(self, lines: list[str]) -> None:
        """Write each."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> object:
        return getattr(self.drawn, name)


def drawn(stream: TextIO) -> TextIO:
    """Return the stream to which who draws writes."""
    return stream.drawn if isinstance(stream, ReadableStream) else stream


def readable_stream(stream: TextIO) -> TextIO:
    """Return a stream that writes readable text to this one; it has all that a text stream has."""
    return cast("TextIO", ReadableStream(drawn(stream)))


@contextlib.contextmanager
def readable_output() -> Iterator[None]:
    """Let what is written to standard output and standard error in the block be readable, whoever it is of."""
    stdout, stderr = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = readable_stream(stdout), readable_stream(stderr)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = stdout, stderr
