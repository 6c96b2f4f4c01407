"""The trace of a run: one JSON object a line, in order of time, with a hash.

Line 1 is `meta`, the last one `end`; neither is hashed. Between them stand
canonical lines (sorted keys, no spaces) that hold integers, levels and bytes
only: no path, version, host or wall time. `t` is nanoseconds.

    {"k":"pins","v":1,"nets","levels"}   at 0: the wires in the order of the blocks, and the level of each, 0 or 1
    {"k":"pins","n","d"}                 a block of n edges, the first at t: base64 of what wires/edges.py describes
    {"k":"waves","net","hz","ns","rows"} changes of a net's wave, a row each: [t, at, period, high] (`Wave`), or [t]
                                         where it ends; in the blocks the level is 0 during a wave
    {"k":"usart","hex"}                  a line (or 64 bytes) that the chip has printed
    {"k":"wire","dir","hex"}             bytes that have arrived: c2r client to robot, r2c back
    {"k":"obstacle","op","name",…}       something placed, moved or removed; lengths in metres
    {"k":"event","who","what","detail"}  a state log: adapter, pioneer, direct, body, chip, bench
    {"k":"sonar","mm":[…]}               ranges, all sonar, when new
    {"k":"pose","x","y","z","h","p","l","r","la","ra","c"}   µm, µrad, µm/s, collisions; each 50 ms

A block holds what has changed between two poses, or the first or next `MOST_EDGES` of it. It stands
at the time of its first edge; so what came before its last one may follow it. A trace of before
there were blocks has {"k":"pin","net","v"} for each level, first at 0 for every net; it is read too.

The hash is a chain: 32 zero bytes, then for each line SHA-256 of the hash so far and the
line with its line end. So it is a value that can be saved, and a run goes on from any line.

Parts report in any order; the writer sorts by time, then by kind, then
by the order of telling. It writes only what nobody can precede any more.

Invariant: the same run gives the same bytes, whatever the slices of the loop;
what was flushed is readable after the process was killed.
"""

import contextlib
import hashlib
import io
import json
import operator
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO

from p2os.errors import LocalProtocolError, RunFailedError
from simbase.errors import FileError
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos

#: chosen: a line of some 10 kB, all that a cut can cost.
MOST_EDGES = 4096

#: Order of kinds within one instant.
RANKS = {"pins": 0, "waves": 1, "usart": 2, "obstacle": 3, "wire": 4, "event": 5, "sonar": 6, "pose": 7}

_encode = json.JSONEncoder(sort_keys=True, separators=(",", ":"), ensure_ascii=True).encode

#: A line's content.
Entry = Mapping[str, object]


#: The hash of no line at all.
EMPTY_HASH = bytes(32)


def canonical(entry: Entry) -> str:
    """Return the one spelling of an entry, without its line end."""
    return _encode(entry)


def chained(digest: bytes, lines: Iterable[str]) -> bytes:
    """Return the hash after more lines, each with its line end."""
    for line in lines:
        digest = hashlib.sha256(digest + line.encode("latin-1")).digest()
    return digest


class TraceWriter(Stateful):
    """Sorts, writes and hashes the entries of a run.

    A snapshot says where the trace stands: of one in memory it has the text, of a file the length. Restoring takes
    back what was written since; the file must still begin with what was in it then.

    Args:
        path: The file; None keeps no file, for tests and searches that want the hash only.
        goes_on: Whether the file is one that an earlier writer has begun; `restore` says how far it counts.

    Raises:
        FileError: The file cannot be written.
    """

    STATE = ("_pending", "_sequence", "_written_until", "_flushed_second", "_hash", "has_meta", "has_end", "written")
    #: The disk's trouble is this process's own.
    DERIVED = ("_failure", "_length")

    def __init__(self, path: Path | None = None, *, goes_on: bool = False) -> None:
        self.path = path
        self._file: IO[str] = io.StringIO()
        self._length = 0
        if path is not None:
            try:
                self._file = path.open("r+" if goes_on else "w", encoding="ascii", newline="\n")
            except OSError as error:
                raise FileError(f"cannot write {path}: {error.strerror}") from error
        self._hash = EMPTY_HASH
        self._pending: list[tuple[Nanos, int, int, str]] = []
        self._sequence = 0
        self._written_until: Nanos = -1
        self._flushed_second = -1
        #: Why nothing can be written any more.
        self._failure: RunFailedError | None = None
        self.has_meta = self.has_end = False

    @property
    def sha256(self) -> str:
        """Return the hash of all hashed lines written so far."""
        return self._hash.hex()

    @property
    def text(self) -> str:
        """Return what was written, where there is no file."""
        return self._file.getvalue() if isinstance(self._file, io.StringIO) else ""

    def meta(self, entry: Entry) -> None:
        """Write the first line and flush it.

        Raises:
            RunFailedError: The disk is full or gone.
        """
        with self._writing() as file:
            self._write(json.dumps({"k": "meta", **entry}) + "\n")
            file.flush()
        self.has_meta = True

    def add(self, kind: str, at: Nanos, entry: Entry) -> None:
        """Take an entry of `kind` stamped `at`.

        Raises:
            LocalProtocolError: Entries of that time were already written.
        """
        if at <= self._written_until:
            raise LocalProtocolError(f"a {kind} entry at {at} ns comes after {self._written_until} ns was written")
        self._sequence += 1
        self._pending.append((at, RANKS[kind], self._sequence, canonical({"k": kind, "t": at, **entry})))

    def write_until(self, limit: Nanos) -> None:
        """Write everything stamped at or before `limit`; flush at each virtual second.

        Raises:
            RunFailedError: The disk is full or gone; so it is from then on.
        """
        with self._writing() as file:
            if self._pending:
                self._pending.sort()
                count = bisect_right(self._pending, limit, key=operator.itemgetter(0))
                lines = [line + "\n" for *_, line in self._pending[:count]]
                self._write("".join(lines))
                self._hash = chained(self._hash, lines)
                del self._pending[:count]
            self._written_until = max(self._written_until, limit)
            second = limit // NS_PER_S
            if second != self._flushed_second:
                self._flushed_second = second
                file.flush()

    @property
    def written_until(self) -> Nanos:
        """Return up to when everything is written; -1 before the first."""
        return self._written_until

    def lines(self) -> Iterator[str]:
        """Yield every line that was reported so far, with its end, in order; also those not yet written.

        Raises:
            RunFailedError: The disk is full or gone.
            FileError: The file cannot be read.
        """
        self.flush()
        if self.path is None:
            yield from io.StringIO(self.text)
        else:
            try:
                with self.path.open(encoding="utf-8", errors="replace") as lines:
                    yield from lines
            except OSError as error:
                raise FileError(f"cannot read {self.path}: {error.strerror}") from error
        for _at, _rank, _order, line in sorted(self._pending):
            yield f"{line}\n"

    def flush(self) -> None:
        """Have all that was written so far in the file, for whoever reads it now.

        Raises:
            RunFailedError: The disk is full or gone.
        """
        with self._writing() as file:
            file.flush()

    def end(self, entry: Entry) -> None:
        """Write the last line and close the file; entries later than what was written are dropped.

        Raises:
            RunFailedError: The disk is full or gone.
        """
        with self._writing() as file:
            self._write(json.dumps({"k": "end", **entry}) + "\n")
            file.flush()
        self.has_end = True
        self.close()

    def close(self) -> None:
        """Close the file without a last line, as for a run that failed."""
        if not isinstance(self._file, io.StringIO):
            with contextlib.suppress(OSError):  # a full disk was reported when it was first met
                self._file.close()

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
        return self._length if self.path is not None else self.text

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
        lines = text.splitlines(keepends=True)[self.has_meta :]
        if len(text) < length or chained(EMPTY_HASH, lines[: len(lines) - self.has_end]) != self._hash:
            raise FileError(
                f"{self.path} is not the trace that this run has begun",
                hint="put the file back as it was, or run the scenario anew",
            )
