"""The robot's end: answers the handshake and keeps the watchdog."""

from collections.abc import Mapping
from typing import cast

from p2os.commands import Command
from p2os.connection_parts import Line
from p2os.events import Closed, CommandReceived, Opened, Synchronised, WatchdogExpired, WatchdogRevived
from p2os.packets import Identity
from p2os.state import LENIENT_TABLE, SERVER_ARGUMENT_TABLE, SERVER_TABLE, SYNC2, ConnectionState, Reply
from p2os.timing import Nanos
from p2os.wire import Frame


class ServerSide:
    """What a server does with each frame and at its one deadline.

    The watchdog runs from OPEN. It fires once, and the first sound frame after
    it is told before the command that the frame carries.
    """

    def __init__(self, line: Line, identity: Identity, watchdog_ns: Nanos, *, lenient: bool = False) -> None:
        self._line = line
        self._identity = identity
        self._watchdog_ns = watchdog_ns
        self._bare_table = LENIENT_TABLE if lenient else SERVER_TABLE
        self.state = ConnectionState.CLOSED
        self._last_frame_ns: Nanos = 0
        self._expired = False

    def take(self, frame: Frame, now: Nanos) -> None:
        """Act on a sound frame."""
        if self.state is ConnectionState.OPEN:
            self._last_frame_ns = now
            if self._expired:
                self._expired = False
                self._line.events.append(WatchdogRevived())
        if frame.kind > SYNC2:
            self._command(frame)
            return
        table: Mapping[tuple[ConnectionState, int], tuple[ConnectionState, Reply]] = (
            SERVER_ARGUMENT_TABLE if frame.data else self._bare_table
        )
        self.state, reply = table.get((self.state, frame.kind), (self.state, None))
        self._reply(reply, frame, now)

    def _command(self, frame: Frame) -> None:
        if self.state is ConnectionState.OPEN:
            self._line.events.append(CommandReceived(Command.from_frame(frame)))
        else:
            self._line.stats.frames_ignored += 1

    def _reply(self, reply: Reply | None, frame: Frame, now: Nanos) -> None:
        match reply:
            case Reply.ECHO:
                self._line.put(frame, now)
            case Reply.IDENTIFY:
                self._line.put(self._identity.to_frame(), now)
                self._line.events.append(Synchronised(self._identity))
            case Reply.OPEN:
                self._last_frame_ns, self._expired = now, False
                self._line.events.append(Opened())
            case Reply.CLOSE:
                self._line.events.append(Closed())
            case Reply.COMMAND:
                self._command(frame)
            case _:
                self._line.stats.frames_ignored += 1

    def next_deadline(self) -> Nanos | None:
        """Return when the watchdog bites."""
        if self.state is not ConnectionState.OPEN or self._expired:
            return None
        return self._last_frame_ns + self._watchdog_ns

    def advance_to(self, now: Nanos) -> None:
        """Let the watchdog bite if it is due."""
        due = self.next_deadline()
        if due is not None and now >= due:
            self._expired = True
            self._line.stats.watchdog_stops += 1
            self._line.events.append(WatchdogExpired())

    def count_silence(self, silence: Nanos, now: Nanos) -> None:
        """Let the watchdog count a time in which nothing came, and which `now` does not contain."""
        self._last_frame_ns = max(self._last_frame_ns - silence, now - self._watchdog_ns)

    def snapshot(self) -> object:
        """Return all that decides the future."""
        return self.state, self._last_frame_ns, self._expired

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        self.state, self._last_frame_ns, self._expired = cast("tuple[ConnectionState, Nanos, bool]", snapshot)
