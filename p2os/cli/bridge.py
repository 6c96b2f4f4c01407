"""The loop of `p2os sniff`: bytes from a client to a robot and back, and heard on the way.

One client at a time; each gets its own line to the robot. When either side
goes, the other is let go too, and a robot whose session was open is brought to
a stand first. So it is when the bridge itself has paused (the machine slept, the
process was stopped): what a client said before is old news, and never passed on.

Invariant: bytes are passed on before anything is shown or recorded.
"""

import contextlib
from collections.abc import Callable

from p2os.cli.signals import postponed
from p2os.errors import TransportError
from p2os.timing import NS_PER_MS, NS_PER_S, Nanos
from p2os.trace import Chunk, Direction
from p2os.trace.tap import Tap
from p2os.transport.ports import Listener, Transport
from p2os.transport.waiting import BLIND_POLL_S, wait_readable
from p2os.transport.wall_clock import Clock, GapWatch, wall_clock

#: chosen: how soon the loop notices that it should end.
LONGEST_WAIT_S = 0.2
#: From HOSTBAUD to our own change of speed: the command has to leave at the old one. ARIA waits 10 ms.
BAUD_DELAY_NS: Nanos = 20 * NS_PER_MS


class Bridge:
    """Joins the clients of a listener to a robot.

    Args:
        listener: Where clients come.
        robot: The line to the robot for the first client: opened early, so that its absence shows at once.
        open_robot: Opens a line to the robot for each further client.
        on_chunk: Told all that goes by.
        on_event: Told who comes and goes.
        clock: Nanoseconds that never run back.
    """

    def __init__(
        self,
        listener: Listener,
        robot: Transport,
        open_robot: Callable[[], Transport],
        *,
        on_chunk: Callable[[Chunk], None],
        on_event: Callable[[str], None],
        clock: Clock = wall_clock,
    ) -> None:
        self._listener = listener
        self._open_robot = open_robot
        self._on_chunk = on_chunk
        self._on_event = on_event
        self._clock = clock
        self._start = clock()
        self._gaps = GapWatch(self._start)
        self._woke_at = self._start
        self._client: Transport | None = None
        self._robot: Transport | None = None
        self._spare: Transport | None = robot
        self._tap = Tap()
        self._baud_due: Nanos | None = None
        #: How many clients have come and gone.
        self.sessions = 0

    @property
    def now(self) -> Nanos:
        """Nanoseconds since the bridge was made."""
        return self._clock() - self._start

    def run(self, until: Callable[[], bool]) -> None:
        """Join until `until` says so or an exception (Ctrl-C) ends it; then let both go."""
        try:
            while not until():
                self.turn()
        finally:
            with postponed():
                self.close()

    def turn(self) -> None:
        """Wait for bytes or a client, and pass on what came."""
        self._wait()
        self._woke_at = self._clock()
        gap_ns = self._gaps.gap(self._woke_at)
        if gap_ns and self._tap.farewell():
            self._part(f"the bridge paused for {gap_ns / NS_PER_S:.1f} s")
        if self._client is None:
            self._welcome()
            return
        self._pass(Direction.TO_ROBOT, self._client)
        if self._robot is not None:
            self._pass(Direction.FROM_ROBOT, self._robot)
        self._change_baud()

    def close(self) -> None:
        """Let both sides go and stop listening."""
        try:
            self._part("the bridge ends")
        finally:
            if self._spare is not None:
                self._spare.close()
            self._listener.close()

    def _welcome(self) -> None:
        client = self._listener.accept()
        if client is None:
            return
        try:
            self._robot = self._robot_line()
        except TransportError as error:
            client.close()
            self._on_event(f"client refused: {error}")
            return
        self._client, self._tap, self._baud_due = client, Tap(), None
        self._on_event(f"client connected: {client.description}")

    def _robot_line(self) -> Transport:
        """Return the line that was opened early if it still lives, else a new one."""
        spare, self._spare = self._spare, None
        if spare is None:
            return self._open_robot()
        try:
            spare.read()  # what a robot said before there was a client is of no use to it
        except TransportError:
            spare.close()
            return self._open_robot()
        return spare

    def _pass(self, direction: Direction, source: Transport) -> None:
        target = self._robot if direction is Direction.TO_ROBOT else self._client
        try:
            data = source.read()
        except TransportError as error:
            self._part(str(error))
            return
        if not data or target is None:
            return
        chunk, lost = self._tap.hear(direction, data, self.now), ""
        try:
            target.write(data)
        except TransportError as error:
            lost = str(error)
        self._on_chunk(chunk)
        if lost:
            self._part(lost)

    def _change_baud(self) -> None:
        if self._tap.new_baud is None or self._robot is None:
            return
        if self._baud_due is None:
            self._baud_due = self.now + BAUD_DELAY_NS
        elif self.now >= self._baud_due:
            self._on_event(f"robot told to talk at {self._tap.new_baud} bit/s: following")
            self._robot.set_baud(self._tap.new_baud)
            self._tap.new_baud, self._baud_due = None, None

    def _part(self, reason: str) -> None:
        """Stop the robot if its session is open, and let both sides go."""
        if self._client is None:
            return
        client, robot, self._client, self._robot = self._client, self._robot, None, None
        farewell = self._tap.farewell()
        if robot is not None:
            with contextlib.suppress(TransportError):
                robot.write(farewell)
            robot.close()
        client.close()
        self.sessions += 1
        if farewell:
            self._on_chunk(self._tap.hear(Direction.TO_ROBOT, farewell, self.now))
            self._on_event("the session was open: sent STOP, VEL 0 and CLOSE")
        self._on_event(f"client gone: {reason}")

    def _wait(self) -> None:
        descriptors, longest = [], LONGEST_WAIT_S
        if self._client is None:
            listening = self._listener.fileno()
            if listening is None:
                longest = self._listener.poll_s or LONGEST_WAIT_S
            else:
                descriptors.append(listening)
        for transport in (self._client, self._robot):
            if transport is None:
                continue
            try:
                descriptors.append(transport.fileno())
            except TransportError:
                longest = BLIND_POLL_S
        if self._baud_due is not None:
            longest = min(longest, max(self._baud_due - self.now, 0) / NS_PER_S)
        self._gaps.expect(self._woke_at + round(longest * NS_PER_S))
        wait_readable(descriptors, longest)
