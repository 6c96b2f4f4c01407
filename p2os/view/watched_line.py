"""A line to a robot that a page watches: each byte of it goes by here, and is handed over as it is.

Invariant: what is read and written is that of the line, in its order; who watches decides nothing.
"""

from collections.abc import Callable

from p2os.capture import Chunk, Direction
from p2os.transport import Listener, Transport
from p2os.view.capture_recording import CaptureTracks
from p2os.view.header import PageHeader
from p2os.view.live import LiveRecording
from p2os.view.recording import ViewRecording
from simbase.timing import Nanos


class WatchedConversation:
    """What goes over lines to one robot, for a page.

    Args:
        title: Of the page.
        robot: Model or file, for units; empty: what the robot says.
        clock: Nanoseconds that never run back; the page's time counts from the first call.
    """

    def __init__(self, title: str, robot: str, clock: Callable[[], Nanos]) -> None:
        self._clock, self._began = clock, clock()
        tracks = CaptureTracks(ViewRecording(PageHeader(title=title)), robot)
        #: What a server shows.
        self.source: LiveRecording[Chunk] = LiveRecording(tracks.recording, tracks.take_chunk)

    def watched(self, line: Transport) -> "WatchedLine":
        """Return a line of which each byte is handed over."""
        return WatchedLine(line, self._take)

    def _take(self, direction: Direction, data: bytes) -> None:
        now = self._clock() - self._began
        self.source.offer(Chunk(at_ns=now, direction=direction, data=data), now)


class WatchedLine:
    """A line of which each byte is handed over.

    Args:
        line: The line.
        on_bytes: Called with what was read or written.
        reads: Which way the bytes go that are read: those of the robot, at its client.
    """

    def __init__(
        self,
        line: Transport,
        on_bytes: Callable[[Direction, bytes], None],
        reads: Direction = Direction.FROM_ROBOT,
    ) -> None:
        self._line, self._on_bytes, self._reads = line, on_bytes, reads
        self.description = line.description

    def read(self) -> bytes:
        """Return what has arrived, as of a `Transport`."""
        data = self._line.read()
        if data:
            self._on_bytes(self._reads, data)
        return data

    def write(self, data: bytes) -> None:
        """Send all of `data`, as of a `Transport`."""
        self._line.write(data)
        if data:
            self._on_bytes(self._reads.opposite, data)

    def fileno(self) -> int:
        """Return its descriptor."""
        return self._line.fileno()

    def set_baud(self, baud: int) -> None:
        """Change its speed."""
        self._line.set_baud(baud)

    def close(self) -> None:
        """Give it back."""
        self._line.close()


class WatchedListener:
    """A place where a robot is served, each byte of whose lines is handed over.

    Args:
        listener: The place.
        on_bytes: As of `WatchedLine`.
    """

    def __init__(self, listener: Listener, on_bytes: Callable[[Direction, bytes], None]) -> None:
        self._listener, self._on_bytes = listener, on_bytes
        self.description, self.poll_s = listener.description, listener.poll_s

    def accept(self) -> Transport | None:
        """Return the line to a client that has come, as of a `Listener`."""
        line = self._listener.accept()
        return None if line is None else WatchedLine(line, self._on_bytes, Direction.TO_ROBOT)

    def fileno(self) -> int | None:
        """Return its descriptor."""
        return self._listener.fileno()

    def close(self) -> None:
        """Stop listening."""
        self._listener.close()
