"""Files that a capture is written to while it goes on.

Each chunk is written at once and whole, so that a program that is killed, or a disk that
fills up, leaves a file that can be read.
"""

import contextlib
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from p2os.capture import Chunk
from p2os.capture.formats.pcap import file_header, record
from p2os.capture.formats.recording import chunk_line, header_line
from p2os.capture.listing import FrameCutter
from p2os.errors import RunFailedError
from simbase.files import reason_of, writing
from simbase.timing import Nanos


class Sink(Protocol):
    """Something that takes what goes by."""

    def take(self, chunk: Chunk) -> None:
        """Take a chunk, in order of time."""
        ...

    def close(self) -> None:
        """Write what is left and end; closing twice is harmless."""
        ...


class RecordingFile:
    """A recording of ours, written as it happens.

    Raises:
        FileError: The file cannot be opened.
        RunFailedError: It cannot be written, now or later.
    """

    def __init__(self, path: Path, note: str = "") -> None:
        self._file = _GrowingFile(path)
        self._file.add(header_line(note).encode("ascii"))

    def take(self, chunk: Chunk) -> None:
        """Write a chunk."""
        self._file.add(chunk_line(chunk).encode("ascii"))

    def close(self) -> None:
        """End the file."""
        self._file.close()


class PcapFile:
    """A pcap file, one record a frame, written as it happens.

    Args:
        path: Where.
        base_ns: When the capture began, in nanoseconds since 1970.

    Raises:
        FileError: The file cannot be opened.
        RunFailedError: It cannot be written, now or later.
    """

    def __init__(self, path: Path, base_ns: Nanos) -> None:
        self._file = _GrowingFile(path)
        self._base_ns = base_ns
        self._cutter = FrameCutter()
        self._file.add(file_header())

    def take(self, chunk: Chunk) -> None:
        """Write the frames that a chunk completes."""
        for piece in self._cutter.take(chunk):
            self._file.add(record(piece, self._base_ns))

    def close(self) -> None:
        """Write what is left of broken frames, and end the file."""
        for piece in self._cutter.finish():
            self._file.add(record(piece, self._base_ns))
        self._file.close()


class Sinks:
    """Several sinks as one, closed together."""

    def __init__(self, sinks: list[Sink]) -> None:
        self._sinks = sinks

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close each, whatever becomes of the others.

        Raises:
            RunFailedError: A file cannot be written.
        """
        self._each(lambda sink: sink.close())

    def take(self, chunk: Chunk) -> None:
        """Hand a chunk to each, whatever becomes of the others.

        Raises:
            RunFailedError: A file cannot be written.
        """
        self._each(lambda sink: sink.take(chunk))

    def _each(self, call: Callable[[Sink], None]) -> None:
        with contextlib.ExitStack() as calls:
            for sink in reversed(self._sinks):
                calls.callback(call, sink)


class _GrowingFile:
    """A file to which whole pieces are added: one for which there is no room leaves no part of itself.

    What is added after that, or after the end, is dropped.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        with writing(path):
            self._file = path.open("wb", buffering=0)
        self._size = 0

    def add(self, piece: bytes) -> None:
        if self._file.closed:
            return
        rest = memoryview(piece)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            with contextlib.suppress(OSError):  # a device has no length
                self._file.truncate(self._size)
            with contextlib.suppress(OSError):
                self._file.close()
            raise RunFailedError(_refusal(self._path, error), hint=self._hint()) from error
        self._size += len(piece)

    def close(self) -> None:
        try:
            self._file.close()
        except OSError as error:
            raise RunFailedError(_refusal(self._path, error)) from error

    def _hint(self) -> str | None:
        return f"what it held before is whole: p2os decode {self._path}" if self._size else None


def _refusal(path: Path, error: OSError) -> str:
    return f"cannot write {path}: {reason_of(error)}"
