"""Standard output and standard error that never wait for their reader.

A terminal held with Ctrl-S, a pager that does not read, a pipe that is full: an
ordinary `write` waits for all of them, and a program that holds a robot must
not. `queue_output` puts a queue before the two, with a thread that empties it: one
where both lead to the same place, as in a terminal or after `2>&1`, so that what is
written arrives in order. What does not fit is left out, by whole lines, and counted
in a note once the reader reads again. A reader that has gone raises BrokenPipeError,
once; what is written after that goes nowhere.

Verbs that only print results keep the ordinary streams: `p2os decode | less` is
to wait, and to lose nothing.

Invariant: `write` never blocks, and no text waits in the streams below.
"""

import contextlib
import errno
import io
import os
import select
import sys
import threading
from collections import deque
from collections.abc import Iterator
from typing import TextIO, cast

from p2os.transport.wall_clock import wall_clock
from simbase.errors import FileError
from simbase.files import reason_of
from simbase.terminal import drawn, readable_output, readable_stream
from simbase.timing import NS_PER_S

#: chosen: some ten thousand lines; minutes of a robot's packets.
MOST_BYTES = 1 << 20
#: chosen: a reader that takes nothing for so long at the end is not waited for.
FLUSH_S = 1.0
#: What a write of the system is given at once: as much as a pipe holds.
_CHUNK_BYTES = 1 << 16
#: EIO: a terminal that has hung up.
_GONE = frozenset({errno.EPIPE, errno.EIO})
#: A write that begins so begins a line, or draws over one.
_LINE_BEGINNINGS = ("\r", "\x1b")


class ByteQueue:
    """Bytes on their way to a descriptor, which a thread of its own hands on.

    Args:
        descriptor: Where they go.
        name: Of the thread.
    """

    def __init__(self, descriptor: int, name: str) -> None:
        self.changed = threading.Condition()
        #: Bytes that are not written yet.
        self.waiting = 0
        #: What the system said when it refused to write; nothing is written after it.
        self.error: OSError | None = None
        self._descriptor = descriptor
        self._queue: deque[bytes] = deque()
        self._written = 0
        self._is_over = False
        threading.Thread(target=self._hand_on, name=f"p2os-{name}", daemon=True).start()

    def append(self, data: bytes) -> None:
        """Queue bytes; nothing where nothing can be written any more."""
        with self.changed:
            if self.error is None:
                self._queue.append(data)
                self.waiting += len(data)
                self.changed.notify_all()

    def end(self) -> None:
        """Wait until all is written, at most `FLUSH_S` without any progress; then end the thread."""
        with self.changed:
            written, since = self._written, wall_clock()
            while self.waiting and self.error is None:
                left_s = FLUSH_S - (wall_clock() - since) / NS_PER_S
                if left_s <= 0:
                    break
                self.changed.wait(left_s)
                if self._written != written:
                    written, since = self._written, wall_clock()
            self._is_over = True
            self.changed.notify_all()

    def _hand_on(self) -> None:
        while True:
            with self.changed:
                while not self._queue and not self._is_over:
                    self.changed.wait()
                if not self._queue:
                    return
                data = bytearray()
                while self._queue and len(data) < _CHUNK_BYTES:
                    data += self._queue.popleft()
            try:
                self._write_all(bytes(data))
            except OSError as error:
                with self.changed:
                    self.error = error
                    self._queue.clear()
                    self.waiting = 0
                    self.changed.notify_all()
                return

    def _write_all(self, data: bytes) -> None:
        while data:
            try:
                count = os.write(self._descriptor, data)
            except BlockingIOError:  # somebody else has made the terminal so
                select.select([], [self._descriptor], [])
                continue
            data = data[count:]
            with self.changed:
                self._written += count
                self.waiting -= count
                self.changed.notify_all()


class QueuedStream(io.TextIOBase):
    """A text stream in the place of another one, whose descriptor a queue hands on to.

    Args:
        below: The stream in whose place this stands; it is flushed first.
        name: What it is called in messages.
        notes: Where the number of lines left out is noted; None: here. Where it leads to the same place, what is
            written to the two arrives in order.
    """

    def __init__(self, below: TextIO, name: str, notes: "QueuedStream | None" = None) -> None:
        below.flush()
        self.below = below
        self._encoding, self._errors = below.encoding, below.errors or "strict"
        self._name = name
        self._notes = notes
        shares = notes is not None and os.path.sameopenfile(below.fileno(), notes.fileno())
        #: What is written and not left out goes through it.
        self.queue: ByteQueue = notes.queue if notes is not None and shares else ByteQueue(below.fileno(), name)
        self._has_raised = False
        self._is_at_start = True
        self._is_leaving_out = False
        self._left_out = 0

    # What makes it a text stream --------------------------------------------------------------

    @property
    def encoding(self) -> str:  # type: ignore[override]  # a property there as well
        """The encoding of the stream below."""
        return self._encoding

    @property
    def errors(self) -> str:  # type: ignore[override]  # a property there as well
        """What the stream below does with characters that it cannot encode."""
        return self._errors

    def fileno(self) -> int:
        """Return the descriptor."""
        return self.below.fileno()

    def isatty(self) -> bool:
        """Tell whether a terminal is behind it."""
        return self.below.isatty()

    def writable(self) -> bool:
        """Return True."""
        return True

    def flush(self) -> None:
        """Do nothing: all is on its way, and nobody waits."""

    def write(self, text: str) -> int:
        """Queue a text, or leave it out where the queue is full.

        Raises:
            BrokenPipeError: The reader has gone; raised once.
            FileError: The system refuses to write, as a full disk does; raised once.
            TypeError: This is no text.
            UnicodeEncodeError: The encoding has no such character.
        """
        if not isinstance(text, str):
            raise TypeError(f"a text stream takes str, not {type(text).__name__}")
        data = text.encode(self._encoding, self._errors)
        begins = self._is_at_start or text.startswith(_LINE_BEGINNINGS)
        with self.queue.changed:
            if self.queue.error is not None:
                self._raise_once(self.queue.error)
                return len(text)
            if begins:
                self._begin_line()
            if self._is_leaving_out:
                self._left_out += begins + text[:-1].count("\n")
            else:
                self.queue.append(data)
            self._is_at_start = text.endswith("\n")
        return len(text)

    # What it leaves out -----------------------------------------------------------------------

    def note_left_out(self) -> None:
        """Note how many lines were left out since the last note, where there are any."""
        left_out, self._left_out = self._left_out, 0
        if left_out:
            note = f"p2os: {left_out} lines of {self._name} left out: the reader does not read\n"
            stream = self._notes or self
            stream.queue.append(note.encode(stream.encoding, "replace"))

    def _begin_line(self) -> None:
        """Decide whether the line that begins now is left out."""
        # A reader that takes one line in a while gets many at once, and one note of those in between.
        most = MOST_BYTES // 2 if self._is_leaving_out else MOST_BYTES
        self._is_leaving_out = self.queue.waiting >= most
        if not self._is_leaving_out:
            self.note_left_out()

    def _raise_once(self, error: OSError) -> None:
        if self._has_raised:
            return
        self._has_raised = True
        if error.errno in _GONE:
            raise BrokenPipeError(errno.EPIPE, f"nobody reads {self._name}") from error
        raise FileError(f"cannot write to {self._name}: {reason_of(error)}") from error


def queue_output() -> None:
    """Put a queue before standard output and standard error, one where they lead to the same place; once is enough.

    Streams without a descriptor (a test's) hold nobody up and stay as they are.
    """
    stdout: TextIO = drawn(sys.stdout)
    stderr: TextIO = drawn(sys.stderr)
    if not isinstance(stderr, QueuedStream) and _has_descriptor(stderr):
        stderr = cast("TextIO", QueuedStream(stderr, "standard error"))
        sys.stderr = stderr if sys.stderr is drawn(sys.stderr) else readable_stream(stderr)
    notes = stderr if isinstance(stderr, QueuedStream) else None
    if not isinstance(stdout, QueuedStream) and _has_descriptor(stdout):
        stdout = cast("TextIO", QueuedStream(stdout, "standard output", notes))
        sys.stdout = stdout if sys.stdout is drawn(sys.stdout) else readable_stream(stdout)


@contextlib.contextmanager
def restored_output() -> Iterator[None]:
    """Put the streams back that were there before, at the end of the block, and wait a moment for their readers.

    In the block what is written is readable, whoever it is of.
    """
    queued: list[QueuedStream] = []
    try:
        with readable_output():
            try:
                yield
            finally:
                queued += [one for stream in (sys.stdout, sys.stderr) if isinstance(one := drawn(stream), QueuedStream)]
    finally:
        for stream in queued:
            stream.note_left_out()
        for queue in dict.fromkeys(stream.queue for stream in queued):
            queue.end()


def _has_descriptor(stream: TextIO | None) -> bool:
    try:
        return stream is not None and stream.fileno() >= 0
    except (OSError, ValueError):  # io.UnsupportedOperation is both
        return False
