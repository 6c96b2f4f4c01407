"""USART1, and the serial port of a USB device, to the outside: standard output, a file, or a pseudo-terminal.

And the files that what comes out of the ITM is written to (`--itm`, `--swo`).

This is the I/O layer: it is the one file here that opens things. The chip runs in
virtual time and the console in none: what the chip sends is written as it
comes out, what a person types is given to the chip when `poll` is called.

Invariant: a console never makes the emulator wait; what cannot be written at
once to a pseudo-terminal that is not read is dropped and counted.
"""

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import BinaryIO, Protocol

from bluepill_sim.board import BluePill
from bluepill_sim.debug.itm import PacketWriter, StimulusWriter, TextWriter
from bluepill_sim.errors import BluePillError
from simbase.files import open_to_write, open_to_write_text
from simbase.terminal import ReadableBytes

#: Most bytes taken from a pseudo-terminal at one poll. Chosen: more than anybody types.
_READ_BYTES = 4096
#: How a new pseudo-terminal is asked for.
PTY = frozenset({"pty:", "pty"})


class ConsolePort(Protocol):
    """What a console needs of a USART, or of a serial port over USB."""

    def subscribe(self, sink: Callable[[Sequence[tuple[int, int]]], None]) -> Callable[[], None]:
        """Have `sink` called with rows (word, ns) that go out from now on."""

    def receive(self, data: bytes) -> None:
        """Take characters from outside."""


class Console(Protocol):
    """The far end of a serial line."""

    @property
    def description(self) -> str:
        """Where it goes, for people."""

    def write(self, data: bytes) -> None:
        """Take characters that the chip has sent."""

    def poll(self) -> bytes:
        """Return what has come from the far end since the last call, without waiting."""

    def close(self) -> None:
        """Let go of whatever it has opened."""


class StreamConsole:
    """Writes to a binary stream; nothing ever comes back."""

    def __init__(
        self, stream: BinaryIO, description: str, *, is_owner: bool = True, readable: ReadableBytes | None = None
    ) -> None:
        """Make it.

        Args:
            stream: Where the characters go; flushed at each line end, and whenever the far end is looked at.
            description: Where that is, for people.
            is_owner: Whether `close` closes the stream.
            readable: Makes the characters text that does not act on a terminal; None: they go as they come.
        """
        self.description = description
        self._stream = stream
        self._is_owner = is_owner
        self._readable = readable
        self._is_flushed = True

    def write(self, data: bytes) -> None:
        """Write characters."""
        self._stream.write(data if self._readable is None else self._readable.take(data))
        self._is_flushed = False
        if b"\n" in data:
            self._flush()

    def poll(self) -> bytes:
        """Return nothing: a stream is one-way. What was written is seen from now on: a prompt ends in no line."""
        if not self._is_flushed:
            self._flush()
        return b""

    def _flush(self) -> None:
        self._stream.flush()
        self._is_flushed = True

    def close(self) -> None:
        """Flush, and close the stream if it is ours."""
        if self._readable is not None:
            self._stream.write(self._readable.take(b"", is_end=True))
        self._flush()
        if self._is_owner:
            self._stream.close()


class PtyConsole:
    """A pseudo-terminal that any terminal program can open (not on Windows)."""

    def __init__(self) -> None:
        """Open one.

        Raises:
            BluePillError: This system has no pseudo-terminals, or none is left.
        """
        try:
            import tty

            self._master, self._slave = os.openpty()
        except (ImportError, AttributeError, OSError) as error:
            raise BluePillError(
                f"cannot open a pseudo-terminal: {error}", hint="give a file name, or - for standard output"
            ) from error
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.description = os.ttyname(self._slave)
        #: Characters that were not read in time.
        self.dropped = 0

    def write(self, data: bytes) -> None:
        """Write characters, or drop what the far end does not read."""
        try:
            written = os.write(self._master, data)
        except BlockingIOError:
            written = 0
        self.dropped += len(data) - written

    def poll(self) -> bytes:
        """Return what has been typed."""
        try:
            return os.read(self._master, _READ_BYTES)
        except BlockingIOError:
            return b""

    def close(self) -> None:
        """Close both ends."""
        os.close(self._master)
        os.close(self._slave)


def open_console(where: str, *, raw: bool = False) -> Console:
    """Return the console that a name asks for.

    Args:
        where: "-" for standard output, "pty:" or "pty" for a new pseudo-terminal, else a file to write.
        raw: Whether standard output gets every byte as it is; files and pseudo-terminals do anyway.

    Raises:
        BluePillError: It cannot be opened.
    """
    if where == "-":
        readable = None if raw else ReadableBytes()
        return StreamConsole(sys.stdout.buffer, "standard output", is_owner=False, readable=readable)
    if where in PTY:
        return PtyConsole()
    return StreamConsole(open_to_write(Path(where)), where)


def connect(console: Console, port: ConsolePort) -> Callable[[], None]:
    """Connect a console to a port, and return the function that carries what was typed to the chip."""
    port.subscribe(lambda rows: console.write(bytes(word & 0xFF for word, _ in rows)))

    def carry() -> None:
        data = console.poll()
        if data:
            port.receive(data)

    return carry


def open_traces(board: BluePill, text: Path | None, packets: Path | None) -> list[StimulusWriter]:
    """Open the files that are wanted and connect them; with any of them the trace is on from the start.

    Raises:
        FileError: One cannot be written.
    """
    writers: list[StimulusWriter] = []
    if text is not None:
        writers.append(TextWriter(open_to_write_text(text)))
    if packets is not None:
        writers.append(PacketWriter(open_to_write(packets)))
    if writers:
        board.chip.system.enable_trace()
        board.chip.system.stimulus_sinks += [writer.write for writer in writers]
    return writers
