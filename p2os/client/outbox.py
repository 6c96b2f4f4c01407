"""What an I/O layer is to do with the line, in order and no faster than the robot can take it.

AROS loses commands that come nearer than 3 to 5 ms (Pioneer 2/3 H8 manual, page
42), so frames leave one by one; on a line with a speed none before the bits of the
one before are through, so that what waits does so here, where STOP goes first, and
not in the system's buffer. Opening, closing and changing the speed of the
line stand in the same queue, so that a STOP is out before the line closes.
"""

from collections import deque
from collections.abc import Container, Iterable
from dataclasses import dataclass

from p2os.protocol.frames import PREFIX_BYTES
from simbase.timing import NS_PER_S, Nanos

#: Bits of a byte on a serial line: start, eight, stop.
BITS_PER_BYTE = 10
#: chosen: for buffers of the system and of a USB adapter, on top of the bits themselves.
DRAIN_MARGIN_NS: Nanos = 20_000_000


@dataclass(frozen=True, slots=True)
class OpenLine:
    """Open the line and report how it went: `line_opened` or `line_failed`."""


@dataclass(frozen=True, slots=True)
class CloseLine:
    """Let what was sent go out, then close the line."""


@dataclass(frozen=True, slots=True)
class SetBaud:
    """Change the line's speed."""

    baud: int


@dataclass(frozen=True, slots=True)
class Send:
    """Write one frame."""

    data: bytes


Action = OpenLine | CloseLine | SetBaud | Send


class Outbox:
    """Actions that wait for their time."""

    def __init__(self, spacing_ns: Nanos) -> None:
        self._spacing_ns = spacing_ns
        self._queue: deque[Action] = deque()
        self._free_at: Nanos = 0
        self._drained_at: Nanos = 0
        #: Line speed for the time that bytes take; None where there is no such thing.
        self.baud: int | None = None

    @property
    def is_empty(self) -> bool:
        """Whether nothing waits."""
        return not self._queue

    def put(self, *actions: Action) -> None:
        """Queue actions."""
        self._queue.extend(actions)

    def send(self, frames: Iterable[bytes]) -> None:
        """Queue frames."""
        self._queue.extend(Send(frame) for frame in frames)

    def send_first(self, frames: Iterable[bytes], *, is_still: bool = False) -> None:
        """Put frames before all other frames that wait, but behind a change of the line, which they need.

        Args:
            frames: What is sent.
            is_still: Nothing was sent for long: the first may go at once.
        """
        waiting = list(self._queue)
        place = max((at for at, action in enumerate(waiting, 1) if not isinstance(action, Send)), default=0)
        self._queue = deque([*waiting[:place], *map(Send, frames), *waiting[place:]])
        if is_still:
            self._free_at = 0

    def drop_frames(self, numbers: Container[int] | None = None) -> None:
        """Drop frames that were not sent, those of some commands or all: what follows matters more."""
        self._queue = deque(
            action
            for action in self._queue
            if not (isinstance(action, Send) and (numbers is None or action.data[PREFIX_BYTES] in numbers))
        )

    def clear(self) -> None:
        """Drop everything: the line has gone."""
        self._queue.clear()

    def next_deadline(self) -> Nanos | None:
        """Return when the first action may go, or None."""
        if not self._queue:
            return None
        match self._queue[0]:
            case Send():
                return self._free_at
            case SetBaud():
                return self._drained_at
        return 0

    def take(self, now: Nanos) -> Action | None:
        """Return the next action if it is due at `now`."""
        due = self.next_deadline()
        if due is None or due > now:
            return None
        action = self._queue.popleft()
        if isinstance(action, Send):
            bits_ns = len(action.data) * BITS_PER_BYTE * NS_PER_S // self.baud if self.baud else 0
            self._free_at = now + max(self._spacing_ns, bits_ns)
            if self.baud:
                self._drained_at = max(now, self._drained_at) + bits_ns + DRAIN_MARGIN_NS
        elif isinstance(action, SetBaud):
            self.baud = action.baud
            self._drained_at = now
            self._free_at = now + DRAIN_MARGIN_NS // 2
        return action
