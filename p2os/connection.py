"""One end of a P2OS line, as a passive state machine: bytes and time in, events and bytes out.

Theory of operation and the tables stand in `p2os.state`. This module adds
what is counted in time: the client's timeouts, PULSE and liveness, the server's
watchdog. Both roles share the decoder, the queues and the statistics; what only
one of them does stands in `ClientSide` and `ServerSide`.

Safety rules of the client: to a robot that may be open from an earlier session,
and after every loss, the first frames out are STOP and VEL 0, before CLOSE or
SYNC0; any packet after a watchdog stop would revive the robot's last speed.

Any exception other than `LocalProtocolError` for a call that the state does not
allow is a bug here; no bytes received raise.
"""

from collections import deque
from dataclasses import dataclass, replace
from typing import cast

from p2os.client_side import ClientSide
from p2os.commands import Command
from p2os.connection_parts import ConnectionSettings, ConnectionStats, Line
from p2os.errors import LocalProtocolError
from p2os.events import (
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
from p2os.packets import Identity, ServerPacket, packet_frame
from p2os.profiles import Profile
from p2os.server_side import ServerSide
from p2os.state import ConnectionState, Role
from p2os.timing import NS_PER_S, Nanos, Reached
from p2os.wire import Decoder, Frame

__all__ = [
    "Closed",
    "CommandReceived",
    "ConfigReceived",
    "ConnectFailed",
    "Connection",
    "ConnectionLost",
    "ConnectionSettings",
    "ConnectionState",
    "ConnectionStats",
    "Event",
    "FrameIgnored",
    "NoiseReceived",
    "Opened",
    "PacketReceived",
    "Role",
    "SipReceived",
    "Synchronised",
    "WatchdogExpired",
    "WatchdogRevived",
]

Message = Command | ServerPacket | Frame
WATCHDOG_NS: Nanos = 2 * NS_PER_S


@dataclass(frozen=True, slots=True, kw_only=True)
class _Snapshot:
    decoder: object
    side: object
    events: tuple[Event, ...]
    output: tuple[bytes, ...]
    stats: ConnectionStats
    last_sent_ns: Nanos


class Connection:
    """One end of a P2OS line.

    Args:
        role: Which end this is.
        identity: Server: what it says in answer to SYNC2.
        watchdog_ns: Server: how long it stays open for motion without a sound frame.
        settings: The client's times, and the firmware family for both.
        lenient: Server: answers syncs in any order, as AMRISim does.
    """

    def __init__(
        self,
        role: Role,
        *,
        identity: Identity | None = None,
        watchdog_ns: Nanos = WATCHDOG_NS,
        settings: ConnectionSettings | None = None,
        lenient: bool = False,
    ) -> None:
        self.role = role
        self.settings = settings or ConnectionSettings()
        self._decoder = Decoder()
        self._line = Line()
        self._side: ClientSide | ServerSide
        if role is Role.SERVER:
            self._side = ServerSide(
                self._line, identity or Identity("", "Pioneer", "p2dx"), watchdog_ns, lenient=lenient
            )
        else:
            self._side = ClientSide(self._line, self.settings)

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
        return replace(self._line.stats, wire=replace(self._decoder.stats))

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that arrived at `now` nanoseconds; noise is counted and told, never raised."""
        self.advance_to(now)
        self._decoder.receive(data, now)
        self._drain(now)

    def next_event(self) -> Event | None:
        """Return what happened next, or None."""
        return self._line.events.popleft() if self._line.events else None

    def take_output(self) -> list[bytes]:
        """Return what has to go out, one item a frame, in order."""
        output, self._line.output = self._line.output, []
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
        self._line.put(frame, now)

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
        if isinstance(self._side, ClientSide):
            self._side.set_profile(profile)

    def count_silence(self, silence: Nanos, now: Nanos) -> None:
        """Server: let the watchdog count a time in which nothing came, and which `now` does not contain.

        Raises:
            LocalProtocolError: This is the client's end.
        """
        if not isinstance(self._side, ServerSide):
            raise LocalProtocolError("only the server's end has a watchdog")
        self._side.count_silence(silence, now)

    def next_deadline(self) -> Nanos | None:
        """Return when a timeout, a PULSE or the watchdog is due."""
        due = [at for at in (self._decoder.next_deadline(), self._side.next_deadline()) if at is not None]
        return min(due) if due else None

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on every deadline up to `limit`, each at its own time."""
        while (due := self.next_deadline()) is not None and due <= limit:
            self._decoder.advance_to(due)
            self._drain(due)
            self._side.advance_to(due)
        return Reached(limit)

    def snapshot(self) -> object:
        """Return all that decides the future."""
        line = self._line
        return _Snapshot(
            decoder=self._decoder.snapshot(),
            side=self._side.snapshot(),
            events=tuple(line.events),
            output=tuple(line.output),
            stats=replace(line.stats),
            last_sent_ns=line.last_sent_ns,
        )

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        saved = cast("_Snapshot", snapshot)
        self._decoder.restore(saved.decoder)
        self._side.restore(saved.side)
        self._line.events = deque(saved.events)
        self._line.output = list(saved.output)
        self._line.stats = replace(saved.stats)
        self._line.last_sent_ns = saved.last_sent_ns

    def _client(self, verb: str) -> ClientSide:
        if not isinstance(self._side, ClientSide):
            raise LocalProtocolError(f"a server cannot {verb}: it waits for its client")
        return self._side

    def _drain(self, now: Nanos) -> None:
        """Hand every item that the decoder found to the side whose turn it is."""
        while (item := self._decoder.next_item()) is not None:
            if isinstance(item, Frame):
                self._line.stats.frames_received += 1
                self._side.take(item, now)
            else:
                self._line.events.append(NoiseReceived(item))
