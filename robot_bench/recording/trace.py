"""The trace of a run: one JSON object a line, in order of time, with a hash.

Line 1 is `meta`, the last one `end`. Between them stand the run's events, as `robot_bench.events.codec`
spells them: integers, levels and bytes, no path, version, host or wall time.

The hash is a chain: 32 zero bytes, then for each line SHA-256 of the hash so far and the
line with its line end. So it is a value that can be saved, and a run goes on from any line. Of the first and
the last line and of verdicts it knows nothing: they tell what was made of a run, not what happened.

A line is the frame: it was written whole where its line end is there. What was flushed is the operating
system's, and is readable after this process was killed; what was being written ends within a line.

Invariant: the same run gives the same bytes, whatever the slices of the loop.
"""

import contextlib
import hashlib
import io
import json
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO

from p2os.errors import RunFailedError
from robot_bench.events.codec import TRACE, Recorded, line_of
from robot_bench.events.kinds import Verdict
from simbase.errors import FileError
from simbase.files import reading, writing
from simbase.state import PartState, Stateful
from simbase.timing import NS_PER_S, Nanos

#: A line's content.
Entry = Mapping[str, object]
#: The hash of no line at all.
EMPTY_HASH = bytes(32)
#: chosen: so many events are kept at the most before their lines are made.
MOST_UNSPELLED = 4096
#: How a line begins that is not hashed; no other begins with its kind.
_UNHASHED = '{"k": "'


def chained(digest: bytes, lines: Iterable[str]) -> bytes:
    """Return the hash after more lines, each with its line end; verdicts, first and last line are passed over."""
    for line in lines:
        if line.startswith(_UNHASHED):
            continue
        digest = hashlib.sha256(digest + line.encode("latin-1")).digest()
    return digest


class TraceWriter(Stateful):
    """Writes and hashes the events of a run.

    A snapshot says where the trace stands: of one in memory it has the text, of a file the length. Restoring takes
    back what was written since; the file must still begin with what was in it then.

    Args:
        path: The file; None keeps no file, for tests and searches that want the hash only.
        goes_on: Whether the file is one that an earlier writer has begun; `restore` says how far it counts.

    Raises:
        FileError: The file cannot be written.
    """

    STATE = ("_flushed_second", "_hash", "has_meta", "has_end", "written")
    #: The disk's trouble is this process's own; what is not spelled yet is so before the state is asked for.
    DERIVED = ("_failure", "_length", "_unspelled")

    def __init__(self, path: Path | None = None, *, goes_on: bool = False) -> None:
        self.path = path
        self._file: IO[str] = io.StringIO()
        self._length = 0
        #: Events taken whose lines were not made yet: many in one go cost less than a few at a time.
        self._unspelled: list[Recorded] = []
        if path is not None:
            with writing(path):
                self._file = path.open("r+" if goes_on else "w", encoding="ascii", newline="\n")
        self._hash = EMPTY_HASH
        self._flushed_second = -1
        #: Why nothing can be written any more.
        self._failure: RunFailedError | None = None
        self.has_meta = self.has_end = False

    @property
    def sha256(self) -> str:
        """Return the hash of all hashed lines written so far."""
        self._spell()
        return self._hash.hex()

    @property
    def text(self) -> str:
        """Return what was written, where there is no file."""
        self._spell()
        return self._file.getvalue() if isinstance(self._file, io.StringIO) else ""

    def meta(self, entry: Entry) -> None:
        """Write the first line and flush it.

        Raises:
            RunFailedError: The disk is full or gone.
        """
        self._spell()
        with self._writing() as file:
            self._write(json.dumps({"k": "meta", "trace": TRACE.newest, **entry}) + "\n")
            file.flush()
        self.has_meta = True

    def take(self, events: Sequence[Recorded], limit: Nanos) -> None:
        """Take the events up to and including `limit`; write and flush at each virtual second.

        Raises:
            RunFailedError: The disk is full or gone; so it is from then on.
        """
        if self._failure is not None:
            raise self._failure
        self._unspelled += events
        second = limit // NS_PER_S
        if second != self._flushed_second:
            self._flushed_second = second
            self.flush()
        elif len(self._unspelled) >= MOST_UNSPELLED:
            self._spell()

    def _spell(self) -> None:
        """Write and hash the lines of what was taken."""
        if self._unspelled:
            lines, self._unspelled = [_spelled(event) for event in self._unspelled], []
            with self._writing():
                self._write("".join(lines))
            self._hash = chained(self._hash, lines)

    def copy(self, lines: Iterable[str]) -> None:
        """Write the lines of another trace, its first and last one left out.

        Raises:
            RunFailedError: The disk is full or gone.
        """
        kept = [line for line in lines if not line.startswith((_UNHASHED + "meta", _UNHASHED + "end"))]
        self._spell()
        with self._writing():
            self._write("".join(kept))
            self._hash = chained(self._hash, kept)

    @property
    def length(self) -> int:
        """How many characters were written: where the next line begins."""
        self._spell()
        return self._length

    def lines(self, begin: int = 0) -> Iterator[str]:
        """Yield every line that was written so far, with its end; only those from a place (`length`) on.

        Raises:
            RunFailedError: The disk is full or gone.
            FileError: The file cannot be read.
        """
        self.flush()
        if self.path is None:
            self._file.seek(begin)
            yield from io.StringIO(self._file.read())
            return
        with reading(self.path), self.path.open(encoding="utf-8", errors="replace") as lines:
            lines.seek(begin)
            yield from lines

    def copy_to(self, path: Path) -> int:
        """Write all that was written so far to a file, for a writer that goes on there; return its length.

        Raises:
            RunFailedError: The disk is full or gone.
            FileError: The one cannot be read, or the other not written.
        """
        self.flush()
        with writing(path):
            if self.path is None:
                path.write_text(self.text, encoding="ascii", newline="\n")
            else:
                shutil.copyfile(self.path, path)
        return self.length

    def flush(self) -> None:
        """Have all that was written so far in the file, for whoever reads it now.

        Raises:
            RunFailedError: The disk is full or gone.
        """
        self._spell()
        with self._writing() as file:
            file.flush()

    def end(self, entry: Entry) -> None:
        """Write the last line and close the file.

        Raises:
            RunFailedError: The disk is full or gone.
        """
        self._spell()
        with self._writing() as file:
            self._write(json.dumps({"k": "end", **entry}) + "\n")
            file.flush()
        self.has_end = True
        self.close()

    def close(self) -> None:
        """Close the file without a last line, as for a run that failed."""
        if not isinstance(self._file, io.StringIO):
            with contextlib.suppress(RunFailedError):
                self._spell()
            with contextlib.suppress(OSError):  # a full disk was reported when it was first met
                self._file.close()

    def snapshot(self) -> PartState:
        """Return where the trace stands."""
        self._spell()
        return super().snapshot()

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned; see `written`."""
        self._spell()
        super().restore(snapshot)

    @contextlib.contextmanager
    def _writing(self) -> Iterator[IO[str]]:
        """Lend the file; what was flushed is the operating system's, which keeps it when this process is killed.

        Raises:
            RunFailedError: The disk is full or gone. A line may be cut then, and nothing may follow it.
        """
        if self._failure is not None:
            raise self._failure
        try:
            yield self._file
        except OSError as error:
            self._failure = RunFailedError(
                f"cannot write {self.path}: {error.strerror}", hint="p2os report on its folder shows what was written"
            )
            raise self._failure from error

    def _write(self, text: str) -> None:
        self._file.write(text)
        self._length += len(text)

    @property
    def written(self) -> str | int:
        """What was written: the text where it is in memory, its length in bytes where it is in a file."""
        return self.length if self.path is not None else self.text

    @written.setter
    def written(self, written: str | int) -> None:
        """Take back what was written since.

        Raises:
            FileError: The file does not begin with what the hash is of.
        """
        length = written if isinstance(written, int) else 0
        if length:
            self._refuse_another_file(length)
        self._file.seek(length)
        self._file.truncate()
        self._length = length
        if isinstance(written, str):
            self._write(written)

    def _refuse_another_file(self, length: int) -> None:
        if self.path is None:
            raise FileError("the trace that this run has begun is in a file, and this writer has none")
        self.flush()
        text = self.path.read_bytes()[:length].decode("latin-1")
        if len(text) < length or chained(EMPTY_HASH, text.splitlines(keepends=True)) != self._hash:
            raise FileError(
                f"{self.path} is not the trace that this run has begun",
                hint="put the file back as it was, or run the scenario anew",
            )


def _spelled(event: Recorded) -> str:
    """Return the line of an event, with its end; an unhashed one begins with its kind."""
    line = line_of(event)
    return json.dumps({"k": "verdict", **json.loads(line)}) + "\n" if isinstance(event, Verdict) else line + "\n"
