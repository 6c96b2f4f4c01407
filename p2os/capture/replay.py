"""A recorded conversation played again, as its client or as its robot.

Theory of operation. One side's frames go out again at their own times, scaled.
The far side is live and keeps its own time, so the handshake is kept in step
by what has come, not by the clock: as the client, no frame goes out before as
many answers to SYNC0, SYNC1 and SYNC2 have come as had come in the recording;
as the robot, each of those answers waits for its question, and the first
packet of a session for OPEN. Time that was spent waiting moves all that follows.

Invariant: it is passive, time is passed in and bytes are handed out; what goes out
is the recorded side's bytes in their order, none added and none left out.
"""

from collections import Counter
from dataclasses import dataclass

from p2os.capture.chunks import Capture, Chunk, Direction
from p2os.capture.listing import FrameCutter, frame_chunks
from p2os.protocol.command_table import SYNC_NAMES
from p2os.protocol.commands import CommandNumber
from p2os.protocol.packets import IDENTITY_KIND
from simbase.timing import Nanos, Reached


class Replay:
    """Plays one side of a capture.

    Args:
        capture: The conversation.
        role: Whose frames to send.
        speed: 2 is twice as fast, 0.5 half as fast.
    """

    def __init__(self, capture: Capture, role: Direction, *, speed: float = 1.0) -> None:
        self._steps = _steps(capture, role)
        self._role = role
        self._speed = speed
        self._place = 0
        self._came: Counter[int] = Counter()
        self._cutter = FrameCutter()
        self._output: list[bytes] = []
        #: What is added to the scaled times of the recording.
        self._shift: Nanos = 0
        self._waits_since: Nanos | None = None

    @property
    def frames_left(self) -> int:
        """How many frames are still to be sent."""
        return len(self._steps) - self._place

    @property
    def awaited(self) -> str:
        """The name of what the next frame waits for; empty when it waits for its time."""
        if not self.frames_left or self._is_free():
            return ""
        step = self._steps[self._place]
        return "an answer to a SYNC" if step.awaited is None else SYNC_NAMES[step.awaited]

    def start(self, now: Nanos) -> None:
        """Begin: the first frame is due at once, and the others as far from it as in the recording."""
        self._shift = now - (self._scaled(self._steps[0].at_ns) if self._steps else 0)

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes of the far side."""
        for piece in self._cutter.take(Chunk(at_ns=now, direction=self._role.opposite, data=data)):
            if piece.frame is not None:
                self._came[piece.frame.kind] += 1

    @property
    def is_closed(self) -> bool:
        """Whether the far side has said CLOSE: a client that goes after that has left in good order."""
        return self._came[CommandNumber.CLOSE] > 0

    def waited(self, now: Nanos) -> Nanos:
        """Return for how long the next frame has waited for the far side, in nanoseconds."""
        return 0 if self._waits_since is None else now - self._waits_since

    def next_deadline(self) -> Nanos | None:
        """Return when the next frame is due; None when there is none or the far side decides."""
        if not self.frames_left or not self._is_free():
            return None
        return self._due()

    def advance_to(self, now: Nanos) -> Reached:
        """Put out every frame that is due."""
        while self.frames_left and self._due() <= now:
            if not self._is_free():
                self._waits_since = self._due() if self._waits_since is None else self._waits_since
                break
            if self._waits_since is not None:
                self._shift += now - self._due()
                self._waits_since = None
            self._output.append(self._steps[self._place].data)
            self._place += 1
        return Reached(now)

    def take_output(self) -> list[bytes]:
        """Return what has to go out, in order."""
        output, self._output = self._output, []
        return output

    def _due(self) -> Nanos:
        return self._scaled(self._steps[self._place].at_ns) + self._shift

    def _scaled(self, at_ns: Nanos) -> Nanos:
        return round(at_ns / self._speed)

    def _is_free(self) -> bool:
        step = self._steps[self._place]
        if step.awaited is None:
            return sum(self._came[kind] for kind in range(IDENTITY_KIND + 1)) >= step.count
        return self._came[step.awaited] >= step.count


@dataclass(frozen=True, slots=True)
class _Step:
    """Bytes to send at a time of the recording, once so many frames of a number have come."""

    at_ns: Nanos
    data: bytes
    #: Number of the frames that are waited for, None for any of the three syncs.
    awaited: int | None
    count: int


def _steps(capture: Capture, role: Direction) -> list[_Step]:
    """Return one side's frames, each with what it has to wait for."""
    steps: list[_Step] = []
    answers = 0
    asked: Counter[int] = Counter()
    awaits_open = False
    for piece in frame_chunks(capture.chunks):
        frame = piece.frame
        is_sync = frame is not None and frame.kind <= IDENTITY_KIND
        if piece.direction is not role:
            answers += is_sync
            continue
        awaited, count = None, answers
        if role is Direction.FROM_ROBOT:
            awaited, count = CommandNumber.PULSE.value, 0
            if frame is not None and is_sync:
                asked[frame.kind] += 1
                awaited, count = frame.kind, asked[frame.kind]
                awaits_open = frame.kind == IDENTITY_KIND
            elif awaits_open:
                awaits_open = False
                awaited, count = CommandNumber.OPEN.value, asked[CommandNumber.OPEN] + 1
        steps.append(_Step(piece.at_ns, piece.data, awaited, count))
    return steps
