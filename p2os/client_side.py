"""The client's end: synchronises, opens, keeps the robot's watchdog fed, notices silence."""

from dataclasses import replace
from typing import cast

from p2os.commands import Command, CommandNumber, enable, pulse, rvel, stop, vel
from p2os.config_packet import ConfigPacket
from p2os.connection_parts import ConnectionSettings, Line
from p2os.errors import LocalProtocolError
from p2os.events import (
    Closed,
    ConfigReceived,
    ConnectFailed,
    ConnectionLost,
    FrameIgnored,
    Opened,
    PacketReceived,
    SipReceived,
    Synchronised,
)
from p2os.packets import RESET_KINDS, Identity, read_packet
from p2os.profiles import Profile
from p2os.sip import SIP_KINDS, StandardSip
from p2os.state import CLIENT_TABLE, SYNC0, SYNC1, SYNC2, SYNC_OF_STATE, ConnectionState
from p2os.timing import NS_PER_MS, Nanos
from p2os.wire import Frame

_S = ConnectionState
#: States in which a session may be begun.
IDLE = (_S.CLOSED, _S.LOST, _S.FAILED)
#: Frames that a robot sends back as they came, while it is not open.
ECHOES = (SYNC0, SYNC1)


class ClientSide:
    """What a client does with each frame and at its deadlines."""

    def __init__(self, line: Line, settings: ConnectionSettings) -> None:
        self._line = line
        self._settings = settings
        self.state = _S.CLOSED
        #: When the present state runs out: a sync's answer, OPEN, SYNC0 after CLOSE, or liveness.
        self._due: Nanos | None = None
        self._attempts = 0
        #: When OPEN goes out again, how often it has, and whether a packet has come since.
        self._open_due: Nanos | None = None
        self._opens = 0
        self._has_heard = False

    def connect(self, now: Nanos) -> None:
        """Begin to open a session."""
        if self.state not in IDLE:
            raise LocalProtocolError(f"cannot connect: the connection is {self.state.value}", hint="disconnect first")
        self._attempts = 0
        if self.state is _S.LOST:
            self._stop_and_close(now)
        else:
            self._sync(_S.SYNC0, now)

    def disconnect(self, now: Nanos) -> None:
        """Leave the robot standing and closed."""
        if self.state is not _S.CLOSED:
            self._say(now, stop(), vel(0), enable(False), Command(CommandNumber.CLOSE))
            self._enter(_S.CLOSED, None)
            self._line.events.append(Closed())

    def take(self, frame: Frame, now: Nanos) -> None:
        """Act on a sound frame."""
        if self.state is _S.OPEN:
            self._take_packet(frame, now)
        elif self.state in SYNC_OF_STATE:
            self._take_answer(frame, now)
        else:
            self._line.stats.frames_ignored += 1

    def _take_answer(self, frame: Frame, now: Nanos) -> None:
        """Act on what came while a sync is out."""
        if frame.kind in SIP_KINDS:
            self._stop_and_close(now)
            return
        if frame.kind in RESET_KINDS:
            self._retry(now)
            return
        following = CLIENT_TABLE.get((self.state, frame.kind))
        if following is None or (frame.kind == SYNC2) is not bool(frame.data):
            self._line.stats.frames_ignored += 1
            if frame.kind > SYNC2:
                self._line.events.append(FrameIgnored(frame))
        elif following is _S.SYNCED:
            self._line.events.append(Synchronised(Identity.from_frame(frame)))
            self._enter(_S.SYNCED, now + self._settings.open_delay_ns)
        else:
            self._sync(following, now)

    def _take_packet(self, frame: Frame, now: Nanos) -> None:
        """Act on a packet of the open session."""
        if frame.kind in RESET_KINDS:
            self._lose("the robot's controller was reset", now)
            return
        if frame.kind in ECHOES and not frame.data:
            # What a robot answers before OPEN. Echoes that were late came before the first packet.
            if self._has_heard:
                self._lose("the robot was restarted", now)
            else:
                self._line.stats.frames_ignored += 1
            return
        self._has_heard, self._open_due = True, None
        self._due = now + self._settings.liveness_ns
        packet = read_packet(frame, self._settings.profile)
        if isinstance(packet, StandardSip):
            self._line.events.append(SipReceived(packet))
        elif isinstance(packet, ConfigPacket):
            self._line.events.append(ConfigReceived(packet))
        else:
            self._line.stats.malformed += frame.kind in SIP_KINDS
            self._line.events.append(PacketReceived(packet))

    def next_deadline(self) -> Nanos | None:
        """Return when a timeout or a PULSE is due."""
        if self.state is not _S.OPEN or self._due is None:
            return self._due
        due = min(self._due, self._line.last_sent_ns + self._settings.pulse_ns)
        return due if self._open_due is None else min(due, self._open_due)

    def set_profile(self, profile: Profile) -> None:
        """Read packets in a firmware family's layout from now on."""
        self._settings = replace(self._settings, profile=profile)

    def advance_to(self, now: Nanos) -> None:
        """Act on what is due at `now`."""
        if self._due is not None and now >= self._due:
            self._time_out(now)
        if self.state is _S.OPEN and self._open_due is not None and now >= self._open_due:
            self._open(now)
        if self.state is _S.OPEN and now >= self._line.last_sent_ns + self._settings.pulse_ns:
            self._say(now, pulse())

    def _time_out(self, now: Nanos) -> None:
        if self.state in SYNC_OF_STATE:
            self._line.stats.sync_timeouts += 1
            self._retry(now)
        elif self.state is _S.RECOVERING:
            self._sync(_S.SYNC0, now)
        elif self.state is _S.SYNCED:
            self._enter(_S.OPEN, now + self._settings.first_packet_ns)
            self._opens, self._has_heard = 0, False
            self._open(now)
            self._line.events.append(Opened())
        else:
            silence = self._settings.liveness_ns if self._has_heard else self._settings.first_packet_ns
            after = "" if self._has_heard else " after OPEN"
            self._lose(f"no packet for {silence / NS_PER_MS:g} ms{after}", now)

    def _open(self, now: Nanos) -> None:
        """Send OPEN, and know when to send it again."""
        self._say(now, Command(CommandNumber.OPEN))
        self._opens += 1
        again = self._opens < self._settings.open_attempts
        self._open_due = now + self._settings.open_retry_ns if again else None

    def _retry(self, now: Nanos) -> None:
        """Begin again at SYNC0, or give up."""
        if self._attempts >= self._settings.sync_attempts:
            self._enter(_S.FAILED, None)
            self._line.events.append(ConnectFailed(f"no answer to {self._attempts} SYNC0"))
        else:
            self._sync(_S.SYNC0, now)

    def _sync(self, state: ConnectionState, now: Nanos) -> None:
        """Send the sync of a state and wait for its answer."""
        if state is _S.SYNC0:
            self._attempts += 1
            if self._settings.stop_first:
                self._say(now, stop(), vel(0), rvel(0))
        self._say(now, Command(SYNC_OF_STATE[state]))
        self._enter(state, now + self._settings.sync_timeout_ns)

    def _stop_and_close(self, now: Nanos) -> None:
        """Bring a robot that may be open and moving to a stand, close it, and try again."""
        if self._attempts >= self._settings.sync_attempts:
            self._say(now, stop(), vel(0), Command(CommandNumber.CLOSE))
            self._retry(now)
            return
        self._say(now, stop(), vel(0), Command(CommandNumber.CLOSE))
        self._enter(_S.RECOVERING, now + self._settings.close_wait_ns)

    def _lose(self, reason: str, now: Nanos) -> None:
        self._line.stats.losses += 1
        self._say(now, stop(), vel(0))
        self._enter(_S.LOST, None)
        self._line.events.append(ConnectionLost(reason))

    def _say(self, now: Nanos, *commands: Command) -> None:
        for command in commands:
            self._line.put(command.to_frame(), now)

    def _enter(self, state: ConnectionState, due: Nanos | None) -> None:
        self.state, self._due, self._open_due = state, due, None

    def snapshot(self) -> object:
        """Return all that decides the future."""
        return self.state, self._due, self._attempts, self._open_due, self._opens, self._has_heard, self._settings

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        saved = cast("tuple[ConnectionState, Nanos | None, int, Nanos | None, int, bool, ConnectionSettings]", snapshot)
        self.state, self._due, self._attempts, self._open_due, self._opens, self._has_heard, self._settings = saved
