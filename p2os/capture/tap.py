"""What somebody between a client and a robot has to know: is a session open, at which line speed.

The tap sends nothing itself: `p2os sniff` and `p2os replay` carry the bytes.

Invariant: the closing frames of a session that is not open are empty, so that a tap
adds nothing to a conversation that ended by itself. Where the tap cannot know (it has
not seen the beginning, or not all of it) a command that only a session has stands for
one: closing frames that were not needed change nothing.
"""

from p2os.capture.chunks import Chunk, Direction
from p2os.capture.listing import FrameCutter, RecordedSession
from p2os.protocol.bauds import BAUDS
from p2os.protocol.commands import Command, CommandNumber, stop, vel
from simbase.timing import Nanos


class Tap:
    """Follows both directions of one conversation."""

    def __init__(self) -> None:
        self._cutter = FrameCutter()
        self._session = RecordedSession()
        #: Whether the client has sent more than syncs since the last CLOSE.
        self._was_commanded = False
        #: The line speed to which the client has just sent the robot, in bit/s; set it back to None when done.
        self.new_baud: int | None = None

    def observe(self, direction: Direction, data: bytes, now: Nanos) -> Chunk:
        """Take bytes that go by at `now` nanoseconds, and return them as a chunk."""
        chunk = Chunk(at_ns=now, direction=direction, data=data)
        for piece in self._cutter.take(chunk):
            frame = piece.frame
            if frame is None:
                continue
            self._session.name_of(frame.payload, direction, now)
            if direction is Direction.TO_ROBOT and frame.kind >= CommandNumber.CLOSE:
                self._was_commanded = frame.kind > CommandNumber.CLOSE
            if direction is Direction.TO_ROBOT and frame.kind == CommandNumber.HOSTBAUD:
                self.new_baud = dict(enumerate(BAUDS)).get(Command.from_frame(frame).integer or 0)
        return chunk

    def closing_frames(self) -> bytes:
        """Return what stops a robot whose client has gone: STOP, VEL 0, CLOSE; empty if it is closed."""
        if not (self._session.is_open or self._was_commanded):
            return b""
        commands = (stop(), vel(0), Command(CommandNumber.CLOSE))
        return b"".join(command.to_frame().to_bytes() for command in commands)
