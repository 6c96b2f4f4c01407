"""What somebody between a client and a robot has to know: is a session open, at which speed.

Invariant: the farewell of a session that is not open is empty, so that a tap
adds nothing to a conversation that ended by itself. Where the tap cannot know
(it has not heard the beginning, or not all of it) a command that only a session
has stands for one: a farewell too many harms nobody.
"""

from p2os.commands import Command, CommandNumber, stop, vel
from p2os.timing import Nanos
from p2os.trace.capture import Chunk, Direction
from p2os.trace.listing import FrameCutter
from p2os.trace.session import Session
from p2os.wire import Frame
from p2os.wire.frame import CHECKSUM_BYTES, HEADER, MIN_COUNT, PREFIX_BYTES

#: Argument of HOSTBAUD → bit/s (Pioneer 3 manual, client commands).
HOST_BAUDS = {0: 9600, 1: 19200, 2: 38400, 3: 57600, 4: 115200}


class Tap:
    """Hears both directions of one conversation."""

    def __init__(self) -> None:
        self._cutter = FrameCutter()
        self._session = Session()
        #: Whether the client has sent more than syncs since the last CLOSE.
        self._was_commanded = False
        #: The speed to which the client has just told the robot to go, in bit/s; set it back to None when done.
        self.new_baud: int | None = None

    def hear(self, direction: Direction, data: bytes, now: Nanos) -> Chunk:
        """Take bytes that go by at `now` nanoseconds, and return them as a chunk."""
        chunk = Chunk(at_ns=now, direction=direction, data=data)
        for piece in self._cutter.take(chunk):
            frame = frame_of(piece)
            if frame is None:
                continue
            self._session.name_of(frame, direction, now)
            if direction is Direction.TO_ROBOT and frame.kind >= CommandNumber.CLOSE:
                self._was_commanded = frame.kind > CommandNumber.CLOSE
            if direction is Direction.TO_ROBOT and frame.kind == CommandNumber.HOSTBAUD:
                self.new_baud = HOST_BAUDS.get(Command.from_frame(frame).integer or 0)
        return chunk

    def farewell(self) -> bytes:
        """Return what brings a robot whose client has gone to a stand: STOP, VEL 0, CLOSE; empty if it is closed."""
        if not (self._session.is_open or self._was_commanded):
            return b""
        commands = (stop(), vel(0), Command(CommandNumber.CLOSE))
        return b"".join(command.to_frame().to_bytes() for command in commands)


def frame_of(piece: Chunk) -> Frame | None:
    """Return the frame that a piece cut by `FrameCutter` is, or None for noise."""
    data = piece.data
    if data[:2] != HEADER or len(data) < PREFIX_BYTES + MIN_COUNT or len(data) != data[2] + PREFIX_BYTES:
        return None
    frame = Frame(data[PREFIX_BYTES:-CHECKSUM_BYTES])
    return frame if frame.to_bytes() == data else None
