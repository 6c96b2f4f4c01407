"""One end of a P2OS line, as a passive state machine: bytes and time in, events and bytes out.

It opens no port and reads no clock; which robot is looked for, and where, is
the client's (`p2os.client.link`).

Theory of operation. Three numbers do double duty: 0, 1 and 2 are SYNC0, SYNC1
and SYNC2 while the two ends synchronise, and PULSE, OPEN and CLOSE once the
session is open. The robot (server) echoes SYNC0 and SYNC1 and answers SYNC2 with
its identity; SYNC0 restarts the handshake at any time before OPEN, a sync out of
order gets no answer, and a sync repeated (because its echo was lost) is answered
again. Once open, SYNC0 *is* a PULSE: a client that finds the robot streaming has
to stop it and CLOSE first.

The tables say which number leads from which state to which. Beside them stands
what is counted in time: the client's timeouts, PULSE and liveness, the server's
watchdog. Both roles share the decoder, the queues and the statistics; what only
one of them does stands in `_ClientSide` and `_ServerSide`.

Safety rules of the client: to a robot that may be open from an earlier session,
and after every loss, the first frames out are STOP and VEL 0, before CLOSE or
SYNC0; any packet after a watchdog stop would revive the robot's last speed.

Source: Pioneer 2/3 H8 manual, pages 42 and 43; Pioneer 3 manual, page 33.

Invariant: no bytes received raise. Any exception other than `LocalProtocolError`
for a call that the state does not allow is a bug here.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

from p2os.errors import LocalProtocolError
from p2os.protocol.commands import Command, CommandNumber, enable, pulse, rvel, stop, vel
from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.events import (
    Closed,
    CommandReceived,
    ConfigReceived,
    ConnectFailed,
    ConnectionLost,
    Event,
    FrameIgnored,
    NoiseReceived,
    Opened,
    PacketReceived,
    SipReceived,
    Synchronised,
    WatchdogExpired,
    WatchdogRevived,
)
from p2os.protocol.frames import Decoder, DecoderStats, Frame
from p2os.protocol.packets import RESET_KINDS, Identity, ServerPacket, packet_frame, read_packet
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SIP_KINDS, StandardSip
from p2os.protocol.times import CYCLE_NS, LIVENESS_NS, PULSE_NS, WATCHDOG_NS
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos, Reached

__all__ = [
    "Closed",
    "CommandReceived",
    "ConfigReceived",
    "ConnectFailed",
    "Connection",
    "ConnectionLost",
    "ConnectionRole",
    "ConnectionSettings",
    "ConnectionState",
    "ConnectionStats",
    "Event",
    "FrameIgnored",
    "NoiseReceived",
    "Opened",
    "PacketReceived",
    "SipReceived",
    "Synchronised",
    "WatchdogExpired",
    "WatchdogRevived",
]

SYNC0, SYNC1, SYNC2 = 0, 1, 2


class ConnectionRole(Enum):
    """Which end of the line a connection is."""

    CLIENT = "client"
    SERVER = "server"


class ConnectionState(Enum):
    """Where a connection stands."""

    #: Nothing is under way; a server waits for SYNC0.
    CLOSED = "closed"
    #: Server: SYNC0 was echoed. Client: SYNC0 is out.
    SYNC0 = "sync0"
    #: Server: SYNC1 was echoed. Client: SYNC1 is out.
    SYNC1 = "sync1"
    #: Client: SYNC2 is out.
    SYNC2 = "sync2"
    #: The identity was sent; OPEN is next.
    SYNCED = "synced"
    #: Packets flow.
    OPEN = "open"
    #: Client: CLOSE was sent to a robot that streams; SYNC0 follows.
    RECOVERING = "recovering"
    #: Client: the session went silent.
    LOST = "lost"
    #: Client: nobody answered.
    FAILED = "failed"


class Reply(Enum):
    """What a server does beside changing its state."""

    #: Send the frame back.
    ECHO = "echo"
    #: Send name, class and subclass.
    IDENTIFY = "identify"
    #: Report to the owner that the session is open.
    OPEN = "open"
    #: Report to the owner that it is closed.
    CLOSE = "close"
    #: Hand the command to the owner.
    COMMAND = "command"


_S = ConnectionState

#: Server: (state, bare number) → (next state, reply). What is not here is ignored and counted.
SERVER_TABLE: Mapping[tuple[ConnectionState, int], tuple[ConnectionState, Reply]] = {
    (_S.CLOSED, SYNC0): (_S.SYNC0, Reply.ECHO),
    (_S.SYNC0, SYNC0): (_S.SYNC0, Reply.ECHO),
    (_S.SYNC1, SYNC0): (_S.SYNC0, Reply.ECHO),
    (_S.SYNCED, SYNC0): (_S.SYNC0, Reply.ECHO),
    (_S.SYNC0, SYNC1): (_S.SYNC1, Reply.ECHO),
    (_S.SYNC1, SYNC1): (_S.SYNC1, Reply.ECHO),
    (_S.SYNC1, SYNC2): (_S.SYNCED, Reply.IDENTIFY),
    (_S.SYNCED, SYNC2): (_S.SYNCED, Reply.IDENTIFY),
    (_S.SYNCED, SYNC1): (_S.OPEN, Reply.OPEN),
    (_S.OPEN, SYNC0): (_S.OPEN, Reply.COMMAND),
    (_S.OPEN, SYNC1): (_S.OPEN, Reply.COMMAND),
    (_S.OPEN, SYNC2): (_S.CLOSED, Reply.CLOSE),
}

#: Server: the same numbers with an argument, as ARIA sends OPEN and CLOSE.
SERVER_ARGUMENT_TABLE: Mapping[tuple[ConnectionState, int], tuple[ConnectionState, Reply]] = {
    (_S.SYNCED, SYNC1): (_S.OPEN, Reply.OPEN),
    (_S.SYNC0, SYNC2): (_S.CLOSED, Reply.CLOSE),
    (_S.SYNC1, SYNC2): (_S.CLOSED, Reply.CLOSE),
    (_S.SYNCED, SYNC2): (_S.CLOSED, Reply.CLOSE),
    (_S.OPEN, SYNC0): (_S.OPEN, Reply.COMMAND),
    (_S.OPEN, SYNC1): (_S.OPEN, Reply.COMMAND),
    (_S.OPEN, SYNC2): (_S.CLOSED, Reply.CLOSE),
}

#: Server that answers syncs in any order before OPEN, as AMRISim does, which follows its client's number.
LENIENT_TABLE: Mapping[tuple[ConnectionState, int], tuple[ConnectionState, Reply]] = {
    **{(state, SYNC0): (_S.SYNC0, Reply.ECHO) for state in (_S.CLOSED, _S.SYNC0, _S.SYNC1, _S.SYNCED)},
    **{(state, SYNC1): (_S.SYNC1, Reply.ECHO) for state in (_S.CLOSED, _S.SYNC0, _S.SYNC1)},
    **{(state, SYNC2): (_S.SYNCED, Reply.IDENTIFY) for state in (_S.CLOSED, _S.SYNC0, _S.SYNC1, _S.SYNCED)},
    (_S.SYNCED, SYNC1): (_S.OPEN, Reply.OPEN),
    (_S.OPEN, SYNC0): (_S.OPEN, Reply.COMMAND),
    (_S.OPEN, SYNC1): (_S.OPEN, Reply.COMMAND),
    (_S.OPEN, SYNC2): (_S.CLOSED, Reply.CLOSE),
}

#: Client: (state, packet type) → next state while synchronising; a late echo of an earlier sync is ignored.
CLIENT_TABLE: Mapping[tuple[ConnectionState, int], ConnectionState] = {
    (_S.SYNC0, SYNC0): _S.SYNC1,
    (_S.SYNC1, SYNC1): _S.SYNC2,
    (_S.SYNC2, SYNC2): _S.SYNCED,
}

#: Client: the sync that is out in each state.
SYNC_OF_STATE: Mapping[ConnectionState, int] = {_S.SYNC0: SYNC0, _S.SYNC1: SYNC1, _S.SYNC2: SYNC2}

#: States in which a session may be begun.
IDLE = (_S.CLOSED, _S.LOST, _S.FAILED)
#: Frames that a robot sends back as they came, while it is not open.
ECHOES = (SYNC0, SYNC1)

Message = Command | ServerPacket | Frame


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionSettings:
    """The client's times, all in nanoseconds, and the firmware family of the robot.

    Raises:
        LocalProtocolError: A time or a count is not positive.
    """

    #: How long the answer to a sync may take; ARIA waits as long.
    sync_timeout_ns: Nanos = NS_PER_S
    #: How often SYNC0 is tried before the client gives up.
    sync_attempts: int = 6
    #: From CLOSE to SYNC0, for a robot that was streaming: two of its cycles.
    close_wait_ns: Nanos = 2 * CYCLE_NS
    #: From the identity to OPEN; ARIA waits one cycle.
    open_delay_ns: Nanos = CYCLE_NS
    #: A PULSE goes out when nothing else did for so long.
    pulse_ns: Nanos = PULSE_NS
    #: From OPEN to the first packet.
    first_packet_ns: Nanos = NS_PER_S
    #: OPEN is sent again when no packet has followed it for so long: one that was lost must not cost the session.
    open_retry_ns: Nanos = 300 * NS_PER_MS
    #: How often OPEN is sent; the time to the first packet bounds it too.
    open_attempts: int = 1
    #: An open session without a sound packet for so long is lost.
    liveness_ns: Nanos = LIVENESS_NS
    profile: Profile = Profile.P2OS
    #: Whether STOP, VEL 0 and RVEL 0 go out before each SYNC0: to a robot that is still open SYNC0 is a PULSE.
    stop_first: bool = False

    def __post_init__(self) -> None:
        for name in ("sync_timeout_ns", "sync_attempts", "close_wait_ns", "open_delay_ns", "pulse_ns",
                     "first_packet_ns", "open_retry_ns", "open_attempts", "liveness_ns"):  # fmt: skip
            if getattr(self, name) <= 0:
                raise LocalProtocolError(f"{name} = {getattr(self, name)} must be positive")


@dataclass(slots=True)
class ConnectionStats:
    """Counters of a connection, since it was made."""

    frames_received: int = 0
    frames_sent: int = 0
    #: Sound frames that the state had no use for.
    frames_ignored: int = 0
    #: Packets of a known type whose content was not sound.
    malformed: int = 0
    watchdog_stops: int = 0
    sync_timeouts: int = 0
    losses: int = 0
    wire: DecoderStats = field(default_factory=DecoderStats)


class Connection(Stateful):
    """One end of a P2OS line.

    Args:
        role: Which end this is.
        identity: Server: what it sends in answer to SYNC2.
        watchdog_ns: Server: how long the robot may move without a sound frame.
        settings: The client's times, and the firmware family for both.
        lenient: Server: answers syncs in any order, as AMRISim does.
    """

    STATE = ("_decoder", "_queues", "_side", "settings")

    def __init__(
        self,
        role: ConnectionRole,
        *,
        identity: Identity | None = None,
        watchdog_ns: Nanos = WATCHDOG_NS,
        settings: ConnectionSettings | None = None,
        lenient: bool = False,
    ) -> None:
        self.role = role
        self.settings = settings or ConnectionSettings()
        self._decoder = Decoder()
        self._queues = _Queues()
        self._side: _ClientSide | _ServerSide
        if role is ConnectionRole.SERVER:
            self._side = _ServerSide(
                self._queues, identity or Identity("", "Pioneer", "p2dx"), watchdog_ns, lenient=lenient
            )
        else:
            self._side = _ClientSide(self._queues, self.settings)

    @property
    def state(self) -> ConnectionState:
        """Where the connection stands."""
        return self._side.state

    @property
    def is_open(self) -> bool:
        """Whether packets flow."""
        return self._side.state is ConnectionState.OPEN

    @property
    def stats(self) -> ConnectionStats:
        """Counters since the beginning; a copy."""
        return replace(self._queues.stats, wire=replace(self._decoder.stats))

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that arrived at `now` nanoseconds; noise is counted and reported, never raised."""
        self.advance_to(now)
        self._decoder.receive(data, now)
        self._drain(now)

    def next_event(self) -> Event | None:
        """Return what happened next, or None."""
        return self._queues.events.popleft() if self._queues.events else None

    def take_output(self) -> list[bytes]:
        """Return what has to go out, one item a frame, in order."""
        output, self._queues.output = self._queues.output, []
        return output

    def send(self, message: Message, now: Nanos) -> None:
        """Send a command (client) or a packet (server) of an open session.

        Raises:
            LocalProtocolError: The session is not open, or a value does not fit its field.
        """
        if not self.is_open:
            raise LocalProtocolError(
                f"cannot send: the connection is {self.state.value}, not open", hint="connect first"
            )
        if isinstance(message, Frame):
            frame = message
        elif isinstance(message, Command):
            frame = message.to_frame()
        else:
            frame = packet_frame(message, self.settings.profile)
        self._queues.put(frame, now)

    def connect(self, now: Nanos) -> None:
        """Client: begin to open a session; a lost or half-open one is stopped and closed first.

        Raises:
            LocalProtocolError: This is the server's end, or a session is open or being opened.
        """
        self._client("connect").connect(now)

    def disconnect(self, now: Nanos) -> None:
        """Client: STOP, VEL 0, ENABLE 0 and CLOSE, in whatever state it is."""
        self._client("disconnect").disconnect(now)

    def set_profile(self, profile: Profile) -> None:
        """Read and write packets in a firmware family's layout from now on."""
        self.settings = replace(self.settings, profile=profile)
        if isinstance(self._side, _ClientSide):
            self._side.set_profile(profile)

    def count_silence(self, silence: Nanos, now: Nanos) -> None:
        """Server: let the watchdog count a time in which nothing came, and which `now` does not contain.

        Raises:
            LocalProtocolError: This is the client's end.
        """
        if not isinstance(self._side, _ServerSide):
            raise LocalProtocolError("only the server's end has a watchdog")
        self._side.count_silence(silence, now)

    def next_deadline(self) -> Nanos | None:
        """Return when a timeout, a PULSE or the watchdog is due."""
        given_up, own = self._decoder.next_deadline(), self._side.next_deadline()
        if given_up is None or own is None:
            return own if given_up is None else given_up
        return min(given_up, own)

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on every deadline up to `limit`, each at its own time."""
        while (due := self.next_deadline()) is not None and due <= limit:
            self._decoder.advance_to(due)
            self._drain(due)
            self._side.advance_to(due)
        return Reached(limit)

    def _client(self, verb: str) -> "_ClientSide":
        if not isinstance(self._side, _ClientSide):
            raise LocalProtocolError(f"a server cannot {verb}: it waits for its client")
        return self._side

    def _drain(self, now: Nanos) -> None:
        """Hand every item that the decoder found to this end's side."""
        while (item := self._decoder.next_item()) is not None:
            if isinstance(item, Frame):
                self._queues.stats.frames_received += 1
                self._side.take(item, now)
            else:
                self._queues.events.append(NoiseReceived(item))


class _Queues(Stateful):
    """The queues between a connection's side and its owner."""

    STATE = ("events", "output", "stats", "last_sent_ns")

    def __init__(self) -> None:
        self.events: deque[Event] = deque()
        self.output: list[bytes] = []
        self.stats = ConnectionStats()
        self.last_sent_ns: Nanos = 0

    def put(self, frame: Frame, now: Nanos) -> None:
        """Queue a frame for the wire."""
        self.output.append(frame.to_bytes())
        self.stats.frames_sent += 1
        self.last_sent_ns = now


class _ClientSide(Stateful):
    """What a client does with each frame and at its deadlines."""

    STATE = ("state", "_due", "_attempts", "_open_due", "_opens", "_has_received", "_settings")

    def __init__(self, queues: _Queues, settings: ConnectionSettings) -> None:
        self._queues = queues
        self._settings = settings
        self.state = _S.CLOSED
        #: When the present state runs out: a sync's answer, OPEN, SYNC0 after CLOSE, or liveness.
        self._due: Nanos | None = None
        self._attempts = 0
        #: When OPEN goes out again, how often it has, and whether a packet has come since.
        self._open_due: Nanos | None = None
        self._opens = 0
        self._has_received = False

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
        """Stop the robot and close its session."""
        if self.state is not _S.CLOSED:
            self._send(now, stop(), vel(0), enable(False), Command(CommandNumber.CLOSE))
            self._enter(_S.CLOSED, None)
            self._queues.events.append(Closed())

    def take(self, frame: Frame, now: Nanos) -> None:
        """Act on a sound frame."""
        if self.state is _S.OPEN:
            self._take_packet(frame, now)
        elif self.state in SYNC_OF_STATE:
            self._take_answer(frame, now)
        else:
            self._queues.stats.frames_ignored += 1

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
            self._queues.stats.frames_ignored += 1
            if frame.kind > SYNC2:
                self._queues.events.append(FrameIgnored(frame))
        elif following is _S.SYNCED:
            self._queues.events.append(Synchronised(Identity.from_frame(frame)))
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
            if self._has_received:
                self._lose("the robot was restarted", now)
            else:
                self._queues.stats.frames_ignored += 1
            return
        self._has_received, self._open_due = True, None
        self._due = now + self._settings.liveness_ns
        packet = read_packet(frame, self._settings.profile)
        if isinstance(packet, StandardSip):
            self._queues.events.append(SipReceived(packet))
        elif isinstance(packet, ConfigPacket):
            self._queues.events.append(ConfigReceived(packet))
        else:
            self._queues.stats.malformed += frame.kind in SIP_KINDS
            self._queues.events.append(PacketReceived(packet))

    def next_deadline(self) -> Nanos | None:
        """Return when a timeout or a PULSE is due."""
        if self.state is not _S.OPEN or self._due is None:
            return self._due
        due = min(self._due, self._queues.last_sent_ns + self._settings.pulse_ns)
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
        if self.state is _S.OPEN and now >= self._queues.last_sent_ns + self._settings.pulse_ns:
            self._send(now, pulse())

    def _time_out(self, now: Nanos) -> None:
        if self.state in SYNC_OF_STATE:
            self._queues.stats.sync_timeouts += 1
            self._retry(now)
        elif self.state is _S.RECOVERING:
            self._sync(_S.SYNC0, now)
        elif self.state is _S.SYNCED:
            self._enter(_S.OPEN, now + self._settings.first_packet_ns)
            self._opens, self._has_received = 0, False
            self._open(now)
            self._queues.events.append(Opened())
        else:
            silence = self._settings.liveness_ns if self._has_received else self._settings.first_packet_ns
            after = "" if self._has_received else " after OPEN"
            self._lose(f"no packet for {silence / NS_PER_MS:g} ms{after}", now)

    def _open(self, now: Nanos) -> None:
        """Send OPEN, and know when to send it again."""
        self._send(now, Command(CommandNumber.OPEN))
        self._opens += 1
        again = self._opens < self._settings.open_attempts
        self._open_due = now + self._settings.open_retry_ns if again else None

    def _retry(self, now: Nanos) -> None:
        """Begin again at SYNC0, or give up."""
        if self._attempts >= self._settings.sync_attempts:
            self._enter(_S.FAILED, None)
            self._queues.events.append(ConnectFailed(f"no answer to {self._attempts} SYNC0"))
        else:
            self._sync(_S.SYNC0, now)

    def _sync(self, state: ConnectionState, now: Nanos) -> None:
        """Send the sync of a state and wait for its answer."""
        if state is _S.SYNC0:
            self._attempts += 1
            if self._settings.stop_first:
                self._send(now, stop(), vel(0), rvel(0))
        self._send(now, Command(SYNC_OF_STATE[state]))
        self._enter(state, now + self._settings.sync_timeout_ns)

    def _stop_and_close(self, now: Nanos) -> None:
        """Stop a robot that may be open and moving, close its session, and try again."""
        self._send(now, stop(), vel(0), Command(CommandNumber.CLOSE))
        if self._attempts >= self._settings.sync_attempts:
            self._retry(now)
        else:
            self._enter(_S.RECOVERING, now + self._settings.close_wait_ns)

    def _lose(self, reason: str, now: Nanos) -> None:
        self._queues.stats.losses += 1
        self._send(now, stop(), vel(0))
        self._enter(_S.LOST, None)
        self._queues.events.append(ConnectionLost(reason))

    def _send(self, now: Nanos, *commands: Command) -> None:
        for command in commands:
            self._queues.put(command.to_frame(), now)

    def _enter(self, state: ConnectionState, due: Nanos | None) -> None:
        self.state, self._due, self._open_due = state, due, None


class _ServerSide(Stateful):
    """What a server does with each frame and at its one deadline.

    The watchdog runs from OPEN. It expires once, and the first sound frame after
    that is reported before the command that the frame carries.
    """

    STATE = ("state", "_last_frame_ns", "_expired")

    def __init__(self, queues: _Queues, identity: Identity, watchdog_ns: Nanos, *, lenient: bool = False) -> None:
        self._queues = queues
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
                self._queues.events.append(WatchdogRevived())
        if frame.kind > SYNC2:
            self._command(frame)
            return
        table = SERVER_ARGUMENT_TABLE if frame.data else self._bare_table
        self.state, reply = table.get((self.state, frame.kind), (self.state, None))
        self._reply(reply, frame, now)

    def _command(self, frame: Frame) -> None:
        if self.state is ConnectionState.OPEN:
            self._queues.events.append(CommandReceived(Command.from_frame(frame)))
        else:
            self._queues.stats.frames_ignored += 1

    def _reply(self, reply: Reply | None, frame: Frame, now: Nanos) -> None:
        match reply:
            case Reply.ECHO:
                self._queues.put(frame, now)
            case Reply.IDENTIFY:
                self._queues.put(self._identity.to_frame(), now)
                self._queues.events.append(Synchronised(self._identity))
            case Reply.OPEN:
                self._last_frame_ns, self._expired = now, False
                self._queues.events.append(Opened())
            case Reply.CLOSE:
                self._queues.events.append(Closed())
            case Reply.COMMAND:
                self._command(frame)
            case _:
                self._queues.stats.frames_ignored += 1

    def next_deadline(self) -> Nanos | None:
        """Return when the watchdog expires."""
        if self.state is not ConnectionState.OPEN or self._expired:
            return None
        return self._last_frame_ns + self._watchdog_ns

    def advance_to(self, now: Nanos) -> None:
        """Let the watchdog expire if it is due."""
        due = self.next_deadline()
        if due is not None and now >= due:
            self._expired = True
            self._queues.stats.watchdog_stops += 1
            self._queues.events.append(WatchdogExpired())

    def count_silence(self, silence: Nanos, now: Nanos) -> None:
        """Let the watchdog count a time in which nothing came, and which `now` does not contain."""
        self._last_frame_ns = max(self._last_frame_ns - silence, now - self._watchdog_ns)
