"""Where a recorded session stands, to tell SYNC0 from PULSE and client from robot.

Numbers 0, 1 and 2 mean SYNC0, SYNC1, SYNC2 before a session is open and PULSE,
OPEN, CLOSE in it: the same bytes. A listener who has not heard the beginning
knows only once a robot's packet goes by.
"""

from enum import Enum

from p2os.commands import NEGATIVE, POSITIVE, STRING, CommandNumber
from p2os.packets import IDENTITY_KIND, RESET_KINDS
from p2os.sip import HEAD_BYTES, READING_BYTES, SIP_KINDS
from p2os.timing import NS_PER_MS, Nanos
from p2os.trace.capture import Direction
from p2os.wire import Frame

SYNC_NAMES = ("SYNC0", "SYNC1", "SYNC2")
COMMAND_NAMES = ("PULSE", "OPEN", "CLOSE")
#: chosen: packets that were on their way when CLOSE was sent; three cycles.
IN_FLIGHT_NS: Nanos = 300 * NS_PER_MS


class _State(Enum):
    CLOSED = "closed"
    #: The robot has said who it is; the next number 1 is OPEN.
    SYNCED = "synced"
    OPEN = "open"


class Session:
    """Follows one conversation."""

    def __init__(self) -> None:
        self._state = _State.CLOSED
        self._closed_at: Nanos | None = None

    @property
    def is_open(self) -> bool:
        """Whether a session is open, as far as was heard."""
        return self._state is _State.OPEN

    def name_of(self, frame: Frame, direction: Direction | None, now: Nanos) -> str:
        """Take a frame; return its name if it is one of the six, else an empty string."""
        if direction is Direction.FROM_ROBOT:
            return self._hear_robot(frame, now)
        if frame.kind > CommandNumber.CLOSE:
            return ""
        if self._state is _State.SYNCED and frame.kind == CommandNumber.OPEN:
            self._state = _State.OPEN
        is_command = self._state is _State.OPEN or (bool(frame.data) and frame.kind != CommandNumber.PULSE)
        if not is_command:
            return SYNC_NAMES[frame.kind]
        if frame.kind == CommandNumber.CLOSE:
            self._state, self._closed_at = _State.CLOSED, now
        return COMMAND_NAMES[frame.kind]

    def _hear_robot(self, frame: Frame, now: Nanos) -> str:
        if frame.kind == IDENTITY_KIND and frame.data:
            self._state = _State.SYNCED
        elif frame.kind in RESET_KINDS:
            self._state = _State.CLOSED
        elif frame.kind > IDENTITY_KIND and (self._closed_at is None or now > self._closed_at + IN_FLIGHT_NS):
            self._state, self._closed_at = _State.OPEN, None
        elif frame.kind <= IDENTITY_KIND and not frame.data:
            self._state = _State.CLOSED
            return SYNC_NAMES[frame.kind]
        return ""


def guess_direction(frame: Frame) -> Direction | None:
    """Return who is likely to have sent a frame, by its shape; None where both would send the same bytes."""
    data = frame.data
    if frame.kind <= IDENTITY_KIND and not data:
        return None
    if frame.kind == IDENTITY_KIND and data.count(b"\0") >= 3 and data[-1:] == b"\0":
        return Direction.FROM_ROBOT
    if frame.kind in SIP_KINDS and len(frame.payload) >= HEAD_BYTES:
        readings = frame.payload[19]
        if len(frame.payload) >= HEAD_BYTES + READING_BYTES * readings:
            return Direction.FROM_ROBOT
    if _is_argument(data):
        return Direction.TO_ROBOT
    return Direction.FROM_ROBOT


def _is_argument(data: bytes) -> bool:
    """Tell whether a command's argument may look so: none, an integer, a string, or SETO's lone type byte."""
    if not data or data in (bytes((POSITIVE,)), bytes((NEGATIVE,))):
        return True
    if data[0] in {POSITIVE, NEGATIVE}:
        return len(data) == 3
    return data[0] == STRING and len(data) >= 2 and len(data) - 2 - data[1] in {0, 1}
