"""The client's core joined to a byte line: what both skins do each time they wake.

No clock is read and nothing is waited for here.
"""

from p2os.client.core import RobotCore
from p2os.client.outbox import CloseLine, OpenLine, Send, SetBaud
from p2os.client.snapshots import Link
from p2os.errors import P2osError, TransportError
from p2os.timing import Nanos
from p2os.transport.ports import Transport

#: chosen: more reads a turn than any line fills between two wakes; a flood must not starve the clock.
MOST_READS = 16


class Line:
    """Moves bytes between a `RobotCore` and the transport that its skin opens.

    Args:
        core: The client.
        baud: Speed at which a serial line is opened; None for other lines.
    """

    def __init__(self, core: RobotCore, baud: int | None) -> None:
        self.core = core
        self._baud = baud
        self._transport: Transport | None = None
        self._turned_at: Nanos = 0
        #: The skin is to open the line and to call `opened` or `failed`.
        self.is_wanted = False

    @property
    def transport(self) -> Transport | None:
        """The open line, or None."""
        return self._transport

    @property
    def is_over(self) -> bool:
        """Whether the client is closed and everything has gone out."""
        return self.core.link is Link.CLOSED and self.core.is_quiet and self._transport is None and not self.is_wanted

    def opened(self, transport: Transport, now: Nanos) -> None:
        """Take the line that was wanted; it is closed where it is not wanted any more."""
        self.is_wanted = False
        if self.core.link is not Link.OPENING:
            transport.close()
            return
        self._transport = transport
        self.core.line_opened(now, self._baud)

    def failed(self, error: P2osError, now: Nanos) -> None:
        """Take the news that the line cannot be opened."""
        self.is_wanted = False
        self.core.line_failed(str(error), error.hint, now)

    def turn(self, now: Nanos) -> None:
        """Read, act on time, write: all that is to be done at `now`."""
        self._read(now)
        self.core.advance_to(now)
        self.write(now)
        self._turned_at = now

    def write(self, now: Nanos) -> None:
        """Carry out the actions that are due."""
        while (action := self.core.take_action(now)) is not None:
            match action:
                case OpenLine():
                    self.is_wanted = True
                case CloseLine():
                    self._close()
                case SetBaud() if self._transport is not None:
                    self._transport.set_baud(action.baud)
                case Send() if self._transport is not None:
                    try:
                        self._transport.write(action.data)
                    except TransportError as error:
                        self._lose(error, now)
                case _:
                    pass  # the line has gone meanwhile

    def next_wake(self) -> Nanos | None:
        """Return when `turn` is due without bytes."""
        return self.core.next_deadline()

    def close(self) -> None:
        """Give the line back without a word."""
        self._close()

    def _read(self, now: Nanos) -> None:
        for _ in range(MOST_READS):
            if self._transport is None:
                return
            try:
                data = self._transport.read()
            except TransportError as error:
                self._lose(error, now)
                return
            if not data:
                return
            self.core.receive(data, self._arrival(now))

    def _arrival(self, now: Nanos) -> Nanos:
        """Return when bytes that waited in the system arrived: before any time-out that they would have prevented.

        A program that was held up for a second must not take its own pause for the robot's silence.
        """
        due = self.core.next_deadline()
        if due is None or due > now:
            return now
        return max(self._turned_at, due - 1)

    def _lose(self, error: TransportError, now: Nanos) -> None:
        self._close()
        self.core.line_lost(str(error), now)

    def _close(self) -> None:
        if self._transport is not None:
            self._transport.close()
            self._transport = None
