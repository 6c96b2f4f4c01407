"""Files that a capture is written to while it goes on.

Each chunk is flushed, so that a program that is killed leaves a file that can be read.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import IO, Protocol, Self

from p2os.capture import Chunk
from p2os.capture.formats.pcap import file_header, record
from p2os.capture.formats.recording import chunk_line, header_line
from p2os.capture.listing import FrameCutter
from simbase.errors import FileError
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
        FileError: The file cannot be written, now or later.
    """

    def __init__(self, path: Path, note: str = "") -> None:
        self._path = path
        self._file = _open(path)
        self._write(header_line(note))

    def take(self, chunk: Chunk) -> None:
        """Write a chunk."""
        self._write(chunk_line(chunk))

    def close(self) -> None:
        """End the file."""
        with _naming(self._path):
            self._file.close()

    def _write(self, line: str) -> None:
        with _naming(self._path):
            self._file.write(line.encode("ascii"))
            self._file.flush()


class PcapFile:
    """A pcap file, one record a frame, written as it happens.

    Args:
        path: Where.
        base_ns: When the capture began, in nanoseconds since 1970.

    Raises:
        FileError: The file cannot be written, now or later.
    """

    def __init__(self, path: Path, base_ns: Nanos) -> None:
        self._path = path
        self._file = _open(path)
        self._base_ns = base_ns
        self._cutter = FrameCutter()
        with _naming(path):
            self._file.write(file_header())
            self._file.flush()

    def take(self, chunk: Chunk) -> None:
        """Write the frames that a chunk completes."""
        with _naming(self._path):
            for piece in self._cutter.take(chunk):
                self._file.write(record(piece, self._base_ns))
            self._file.flush()

    def close(self) -> None:
        """Write what is left of broken frames, and end the file."""
        with _naming(self._path):
            if not self._file.closed:
                for piece in self._cutter.finish():
                    self._file.write(record(piece, self._base_ns))
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
            FileError: A file cannot be written.
        """
        with contextlib.ExitStack() as closing:
            for sink in reversed(self._sinks):
                closing.callback(sink.close)

    def take(self, chunk: Chunk) -> None:
        """Hand a chunk to each."""
        for sink in self._sinks:
            sink.take(chunk)


def _open(path: Path) -> IO[bytes]:
    with _naming(path):
        return path.open("wb")


@contextlib.contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Raise what the system refuses as an error that names the file."""
    try:
        yield
    except OSError as error:
        raise FileError(f"cannot write {path}: {(error.strerror or str(error)).lower()}") from error
