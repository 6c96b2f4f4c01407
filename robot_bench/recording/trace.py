"""The trace of a run: one JSON object a line, in order of time, with a hash.

Line 1 is `meta`, the last one `end`; neither is hashed. Between them stand
canonical lines (sorted keys, no spaces) that hold integers, levels and bytes
only: no path, version, host or wall time. `t` is nanoseconds.

    {"k":"pin","net","v"}                a level, first at 0 for every net
    {"k":"usart","hex"}                  a line (or 64 bytes) that the chip has printed
    {"k":"wire","dir","hex"}             bytes that have arrived: c2r client to robot, r2c back
    {"k":"obstacle","op","name",…}       something placed, moved or removed; lengths in metres
    {"k":"event","who","what","detail"}  a state log: adapter, pioneer, direct, body, chip, bench
    {"k":"sonar","mm":[…]}               ranges, all sonar, when new
    {"k":"pose","x","y","z","h","p","l","r","la","ra","c"}   µm, µrad, µm/s, collisions; each 50 ms

Parts report in any order; the writer sorts by time, then by kind, then
by the order of telling. It writes only what nobody can precede any more.

Invariant: the same run gives the same bytes, whatever the slices of the loop;
what was flushed is readable after the process was killed.
"""

import contextlib
import hashlib
import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, cast

from p2os.errors import LocalProtocolError, RunFailedError
from simbase.errors import FileError
from simbase.timing import NS_PER_S, Nanos

TRACE_NAME = "trace.jsonl"

#: Order of kinds within one instant.
RANKS = {"pin": 0, "usart": 1, "obstacle": 2, "wire": 3, "event": 4, "sonar": 5, "pose": 6}

#: A line's content.
Entry = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class TraceMark:
    """A place in a trace that is being written."""

    position: int
    digest: "hashlib._Hash"
    flushed_second: int


def canonical(entry: Entry) -> str:
    """Return the one spelling of an entry, without its line end."""
    return json.dumps(entry, sort_keys=True, separators=(",", ":"), ensure_ascii=True)


class TraceWriter:
    """Sorts, writes and hashes the entries of a run.

    Args:
        path: The file; None keeps no file, for tests and searches that want the hash only.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = path
        self._file: IO[str] = io.StringIO()
        if path is not None:
            try:
                self._file = path.open("w", encoding="utf-8", newline="\n")
            except OSError as error:
                raise FileError(f"cannot write {path}: {error.strerror}") from error
        self._hash = hashlib.sha256()
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
        return self._hash.hexdigest()

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
            file.write(json.dumps({"k": "meta", **entry}) + "\n")
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
                count = 0
                for at, _rank, _order, line in self._pending:
                    if at > limit:
                        break
                    data = line + "\n"
                    file.write(data)
                    self._hash.update(data.encode("ascii"))
                    count += 1
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
            file.write(json.dumps({"k": "end", **entry}) + "\n")
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

    def mark(self) -> TraceMark:
        """Return where the trace stands, for `rewind`."""
        return TraceMark(self._file.tell(), self._hash.copy(), self._flushed_second)

    def rewind(self, mark: TraceMark) -> None:
        """Take back everything that was written after `mark`; what was reported is `restore`'s business."""
        self._file.seek(mark.position)
        self._file.truncate()
        self._hash, self._flushed_second = mark.digest.copy(), mark.flushed_second

    def snapshot(self) -> dict[str, object]:
        """Return what is reported and not yet written."""
        return {"pending": tuple(self._pending), "sequence": self._sequence, "written_until": self._written_until}

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned; the file and the hash go on from where this writer stands."""
        state = cast("Mapping[str, object]", snapshot)
        self._pending = list(cast("tuple[tuple[int, int, int, str], ...]", state["pending"]))
        self._sequence = cast("int", state["sequence"])
        self._written_until = cast("int", state["written_until"])
