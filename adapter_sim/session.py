"""A P2OS session as the adapter needs it: connect, send and receive, and stop the robot first.

Around `p2os.protocol.connection.Connection`, which synchronises and keeps the watchdog
fed. Added here: the stop sequence before each SYNC0 and before each CLOSE, and its
repetitions after a session; SIPs handed on, everything else folded into "opened" and
"ended, because". When to connect and when a session is lost is the adapter's to decide.

Any packet revives the last speed of a robot that its watchdog has stopped, and
the adapter cannot know what a robot was doing before. So STOP, VEL 0 and RVEL 0
stand before every SYNC0, the repeated ones included: a cable that is plugged in
between two tries must not set the robot off. They also go out at boot: whoever
reset the adapter may have done so while the robot drove.

Nobody confirms the stop sequence, so it is repeated: after a loss it goes out once
and then `stop_repeats` times more. A robot that was closed on its master's request
confirms by its silence: there the sequence is repeated only while bytes still come.

Invariant: what `take_output` returns begins, after `abandon`, with STOP.
"""

from dataclasses import dataclass
from typing import TypeAlias

from adapter_sim.settings import AdapterSettings
from p2os.protocol.commands import Command, CommandNumber, rvel, stop, vel
from p2os.protocol.connection import (
    ConnectFailed,
    Connection,
    ConnectionLost,
    ConnectionRole,
    ConnectionSettings,
    ConnectionState,
    ConnectionStats,
    Opened,
    SipReceived,
    Synchronised,
)
from p2os.protocol.sip import StandardSip
from p2os.protocol.times import CYCLE_NS
from simbase.state import Stateful
from simbase.timing import Nanos


@dataclass(frozen=True, slots=True)
class SessionOpened:
    """OPEN was sent to a robot that has identified itself."""

    robot: str


@dataclass(frozen=True, slots=True)
class SessionEnded:
    """The session was lost, or could not be opened."""

    reason: str


SessionEvent: TypeAlias = StandardSip | SessionOpened | SessionEnded

#: Brings a robot to a stand and keeps it there when a later packet revives it.
_STOPS = tuple(command.to_frame().to_bytes() for command in (stop(), vel(0), rvel(0)))
_CLOSE = Command(CommandNumber.CLOSE).to_frame().to_bytes()
#: The same bytes are PULSE once the session is open.
_SYNC0 = Command(CommandNumber.PULSE).to_frame().to_bytes()


class Session(Stateful):
    """One robot's session after another."""

    STATE = ("_connection", "_output", "_robot")

    def __init__(self, settings: AdapterSettings) -> None:
        self._settings = ConnectionSettings(
            pulse_ns=settings.pulse_ns, liveness_ns=settings.liveness_ns, first_packet_ns=settings.first_sip_ns
        )
        self._stops_unknown = settings.stop_unknown_robot
        self._connection = Connection(ConnectionRole.CLIENT, settings=self._settings)
        self._output: list[bytes] = []
        self._robot = ""

    @property
    def stats(self) -> ConnectionStats:
        """Return the counters since the last reset."""
        return self._connection.stats

    def connect(self, now: Nanos) -> None:
        """Begin to open a session."""
        self._connection.connect(now)
        self._collect()

    def send(self, command: Command, now: Nanos) -> None:
        """Send a command of the open session."""
        self._connection.send(command, now)
        self._collect()

    def stop_unknown(self) -> None:
        """Stop a robot of which nothing is known, unless the settings say not to."""
        if self._stops_unknown:
            self._output += _STOPS

    def abandon(self, now: Nanos) -> None:
        """Stop the robot and close it, open or not; what was not taken yet is never sent."""
        self.drop(now)
        self._output = [*_STOPS, _CLOSE]

    def drop(self, now: Nanos) -> None:
        """End the session without sending anything."""
        self._connection.disconnect(now)
        self._connection.take_output()
        while self._connection.next_event() is not None:
            pass
        self._output = []

    def forget(self) -> None:
        """Forget everything, as after a reset."""
        self._connection = Connection(ConnectionRole.CLIENT, settings=self._settings)
        self._output = []

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes of the robot."""
        self._connection.receive(data, now)
        self._collect()

    def take_events(self) -> list[SessionEvent]:
        """Return what happened, in order."""
        events: list[SessionEvent] = []
        while (event := self._connection.next_event()) is not None:
            if isinstance(event, SipReceived):
                events.append(event.sip)
            elif isinstance(event, Synchronised):
                robot = event.identity
                self._robot = " ".join(part for part in (robot.robot_class, robot.subclass, robot.name) if part)
            elif isinstance(event, Opened):
                events.append(SessionOpened(self._robot))
            elif isinstance(event, ConnectionLost | ConnectFailed):
                events.append(SessionEnded(event.reason))
        return events

    def take_output(self) -> list[bytes]:
        """Return the frames to send, one item each, and forget them."""
        output, self._output = self._output, []
        return output

    def next_deadline(self) -> Nanos | None:
        """Return when the connection wants to act."""
        return self._connection.next_deadline()

    def advance_to(self, now: Nanos) -> None:
        """Bring the connection to `now`."""
        self._connection.advance_to(now)
        self._collect()

    def _collect(self) -> None:
        is_open = self._connection.state is ConnectionState.OPEN
        for frame in self._connection.take_output():
            if not is_open and frame == _SYNC0:
                self.stop_unknown()
            self._output.append(frame)


#: A robot whose bytes came so recently is still streaming: one SIP period.
_STREAMING_NS: Nanos = CYCLE_NS


class StopRepeater(Stateful):
    """How often the stop sequence still goes out, and when."""

    STATE = ("_at", "_left", "_is_closed_on_request", "received_at")

    def __init__(self, settings: AdapterSettings) -> None:
        self._repeats = settings.stop_repeats
        self._period_ns = settings.stop_repeat_ns
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._at: Nanos = 0
        self._left = 0
        self._is_closed_on_request = False
        #: When bytes of the robot came last. A SIP found late, behind a false header, is as old as they are.
        self.received_at: Nanos = 0

    @property
    def due_at(self) -> Nanos | None:
        """Return when the next repetition is due, None for no more."""
        return self._at if self._left else None

    def note_bytes(self, now: Nanos) -> None:
        """Take note that bytes of the robot came."""
        self.received_at = now

    def begin(self, session: Session, now: Nanos) -> None:
        """Send the sequence and CLOSE, and plan its repetitions; `end_on_request` may follow."""
        session.abandon(now)
        self._left = self._repeats
        self._at = now + self._period_ns
        self._is_closed_on_request = False

    def end_on_request(self) -> None:
        """Take note that the session ended because its master withdrew the connect request."""
        self._is_closed_on_request = True

    def cancel(self) -> None:
        """Plan nothing more: a new session begins, and with it a new sequence."""
        self._left = 0

    def repeat(self, session: Session, now: Nanos) -> None:
        """Send it again if it is due."""
        if self._left and now >= self._at:
            self._left -= 1
            self._at = now + self._period_ns
            if not self._is_closed_on_request or now - self.received_at < _STREAMING_NS:
                session.abandon(now)
