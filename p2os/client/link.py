"""The link to one robot: find it, open a session, notice a loss, look for it again.

What is sent in an open session is the `Mover`'s; when actions leave, the `Outbox`'s.

Theory of operation. `connect` asks for the line. When it is open, one
`Connection` after the other tries the handshake, at each baud rate in turn, first
with short timeouts, then with long ones (`search_plan`). A robot that is still open
from an earlier session takes SYNC0 for a PULSE and goes on at its last speed, so
STOP, VEL 0 and RVEL 0 stand before each SYNC0. The one exception is a line
without a baud rate on which no session has been: it is listened to first, and
where not a byte comes, SYNC0 goes alone. AMRISim (MobileSim's successor) takes
any first frame for a sync, counts on from its number, and never opens; where
STOP had to go first, its echo of STOP betrays it, and the line is opened anew.
After OPEN the first standard packet makes the link open; CONFIG is asked for, and
where the robot offers it the line is made faster. A loss sends STOP and VEL 0,
closes the line, waits, and begins again.

    CLOSED → OPENING → SEARCHING → STARTING → OPEN
                ↑          ↓           ↓        ↓
             WAITING ←─────┴───────────┴────────┘   (FAILED where nothing is tried again)

Invariant: each try ends within `TRY_LIMIT_NS`, open or with a reason.
"""

from collections import deque
from collections.abc import Container, Mapping
from dataclasses import dataclass

from p2os.client.notices import (
    BaudKept,
    BaudRaised,
    ConfigurationKnown,
    Connected,
    GaveUp,
    LinkLost,
    Notice,
    PacketArrived,
    ReconnectPlanned,
)
from p2os.client.outbox import Action, CloseLine, OpenLine, Outbox, Send, SetBaud
from p2os.client.robot_state import Link
from p2os.client.settings import ClientSettings
from p2os.protocol.bauds import BAUDS
from p2os.protocol.commands import Command, CommandNumber, pulse
from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.connection import (
    ConfigReceived,
    ConnectFailed,
    Connection,
    ConnectionLost,
    ConnectionRole,
    ConnectionSettings,
    ConnectionState,
    ConnectionStats,
    FrameIgnored,
    NoiseReceived,
    Opened,
    PacketReceived,
    SipReceived,
    Synchronised,
)
from p2os.protocol.events import Event
from p2os.protocol.packets import Identity
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import StandardSip
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: A try to open a session ends within this, whatever the line does.
TRY_LIMIT_NS: Nanos = 20 * NS_PER_S
#: chosen: CONFIG is asked for so often, so far apart: the answer takes 110 ms at 9600 baud.
CONFIG_ATTEMPTS, CONFIG_EVERY_NS = 3, 300 * NS_PER_MS
#: CONFIGpac autobaud: the robot wants its client to raise the rate (ARIA does so for this value alone).
WANTS_HIGHER_BAUD = 2
#: The same bytes are PULSE once the session is open.
SYNC0_BYTES = pulse().to_frame().to_bytes()
#: chosen: one packet could have been on its way at the old rate; two in a row were not.
PACKETS_THAT_PROVE_A_RATE = 2
#: Tuples, for a state of an enum is found in them by its identity: a set would hash it, in Python.
_AT_REST = (Link.CLOSED, Link.FAILED)
_LOOKED_FOR = (Link.SEARCHING, Link.STARTING)
_WITH_LINE = (*_LOOKED_FOR, Link.OPEN)
#: How far a search came → what its error says, and what to look at.
REASONS: Mapping[str, tuple[str, str]] = {
    "silence": ("no answer{where}", "is the robot on, and the cable in?"),
    "noise": ("only noise{where}", "is this the robot's HOST port? p2os scan tries every port and rate"),
    "answers": ("the robot answers{where}, but its handshake does not come to an end", "is the line bad?"),
    "opened": ("the session was opened, but no standard packet followed", "is the line bad?"),
}


@dataclass(frozen=True, slots=True)
class Try:
    """One stretch of the search: a rate (None: the line has none), how long to wait, how often."""

    baud: int | None
    wait_ns: Nanos
    attempts: int


class LinkSupervisor:
    """One robot's sessions, one after the other."""

    def __init__(self, settings: ClientSettings) -> None:
        self._settings = settings
        self.outbox = Outbox(settings.command_spacing_ns)
        self.link = Link.CLOSED
        self.identity: Identity | None = None
        self.config: ConfigPacket | None = None
        #: Line speed now; None without one.
        self.baud: int | None = None
        #: Standard packets, each with the family in whose layout it was read, and notices; oldest first.
        self.news: deque[tuple[StandardSip, Profile] | Notice] = deque()
        self._line_baud: int | None = None
        #: Rates at which the robot was received last, and at which its handshake was found.
        self._good_baud: int | None = None
        self._found_baud: int | None = None
        #: Whether a session has ever been opened: a robot may be left open and moving.
        self._has_opened = False
        #: Whether STOP, VEL 0 and RVEL 0 stand before each SYNC0 on this line.
        self._stops_first = True
        #: Whether the peer took STOP for a sync in this try.
        self._echoes_stop = False
        #: Until when a line that is new is listened to.
        self._listen_due: Nanos | None = None
        self._connection = self._new_connection(settings.slow_sync_ns, 1)
        self._plan: deque[Try] = deque()
        self._due: Nanos | None = None
        self._tries = 0
        self._was_open = False
        self._began_at: Nanos = 0
        self._config_due: Nanos | None = None
        self._config_asked = 0
        self._raise: _Raise | None = None
        self._raise_refused = False
        #: How far the present try has come: a key of `REASONS`.
        self._came_to = "silence"

    @property
    def is_ready(self) -> bool:
        """Whether packets flow and the configuration has come, or was asked for without an answer."""
        return self.link is Link.OPEN and (self.config is not None or self._config_due is None)

    @property
    def stats(self) -> ConnectionStats:
        """Counters of the present connection."""
        return self._connection.stats

    # What the owner asks ----------------------------------------------------------------

    def connect(self) -> None:
        """Begin to open a session; no effect while one is open or under way."""
        if self.link in _AT_REST:
            self._tries = 0
            self._was_open = False
            self._open_line()

    def close(self, now: Nanos) -> None:
        """Stop the robot, close its session and the line, whatever is under way."""
        if self.link in _AT_REST:
            self.link = Link.CLOSED
            return
        self.outbox.clear()
        self._good_baud = self._found_baud  # CLOSE takes the robot back to its own rate
        has_line = self.link in _WITH_LINE
        if has_line:
            self._connection.disconnect(now)
            self.outbox.send(self._connection.take_output())
        if has_line or self.link is Link.OPENING:
            self.outbox.put(CloseLine())
        self._enter(Link.CLOSED, None)

    def send(self, command: Command, now: Nanos) -> None:
        """Send a command of the open session; without one it has nowhere to go."""
        if self._connection.is_open:
            self._connection.send(command, now)
            self.outbox.send(self._connection.take_output())

    def send_first(self, command: Command, now: Nanos, *, is_still: bool = False) -> None:
        """Send a command of the open session before all that waits; `is_still`: at once, nothing was sent for long."""
        if self._connection.is_open:
            self._connection.send(command, now)
            self.outbox.send_first(self._connection.take_output(), is_still=is_still)

    def drop(self, numbers: Container[int]) -> None:
        """Drop commands that have not left: something overtakes them."""
        self.outbox.drop_frames(numbers)

    @property
    def profile(self) -> Profile:
        """The firmware family whose layout packets are read in."""
        return self._connection.settings.profile

    def set_profile(self, profile: Profile) -> None:
        """Read packets in a firmware family's layout."""
        self._connection.set_profile(profile)

    # What the line reports --------------------------------------------------------------

    def line_opened(self, now: Nanos, baud: int | None) -> None:
        """Take a line that is open; `baud` is its speed, None where there is no such thing."""
        if self.link is not Link.OPENING:
            return
        self._line_baud = self.baud = self.outbox.baud = baud
        self._plan = deque(self._search(baud))
        self._enter(Link.SEARCHING, now + TRY_LIMIT_NS)
        self._came_to = "silence"
        is_new = baud is None and not self._has_opened
        self._stops_first = not (is_new or self._echoes_stop)
        if is_new and not self._echoes_stop:
            self._connection = self._new_connection(self._settings.quick_sync_ns, 1)
            self._listen_due = now + self._settings.listen_ns
        else:
            self._next_try(now)

    def _search(self, baud: int | None) -> tuple[Try, ...]:
        """Return where the robot is looked for on a line that was opened at a rate."""
        good = self._good_baud if baud is not None else None
        rates = (self._found_baud, baud, *self._settings.bauds)  # a robot that reboots is back at the first
        bauds = tuple(rate for rate in rates if rate is not None)
        return search_plan(baud if good is None else good, bauds, self._settings, is_known=good is not None)

    def line_failed(self, reason: str, hint: str | None, now: Nanos) -> None:
        """Note that the line cannot be opened."""
        if self.link is Link.OPENING:
            self._give_up_try(reason, hint, now)

    def line_lost(self, reason: str, now: Nanos) -> None:
        """Note that the line has gone, with all that was to be sent on it."""
        if self.link is Link.OPEN:
            self.news.append(LinkLost(reason))
            self._wait_or_fail(reason, None, now)
        elif self.link in _LOOKED_FOR:
            self._wait_or_fail(reason, None, now)
        self.outbox.clear()

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes of the robot."""
        if self.link in _WITH_LINE:
            self._connection.receive(data, now)
            self._collect(now)
        if self._listen_due is not None:
            self._stops_first = True
            self._next_try(now)

    def take_action(self, now: Nanos) -> Action | None:
        """Return what the I/O layer is to do next with the line, if it is due."""
        action = self.outbox.take(now)
        if isinstance(action, SetBaud):
            self.baud = action.baud
            if self._raise is not None and self._raise.switched_at is None:
                self._raise.switched_at = now
        elif isinstance(action, Send) and action.data == SYNC0_BYTES:
            self._began_at = now
        return action

    # Time -------------------------------------------------------------------------------

    def next_deadline(self) -> Nanos | None:
        """Return when this wants to act; actions that wait have the outbox's own time."""
        due = [self._due]
        if self.link in _WITH_LINE:
            due += [self._connection.next_deadline(), self._config_due, self._raise_due(), self._listen_due]
        return min((at for at in due if at is not None), default=None)

    def advance_to(self, now: Nanos) -> None:
        """Act on what is due at `now`."""
        if self.link in _WITH_LINE:
            self._connection.advance_to(now)
            self._collect(now)
        if self._due is not None and now >= self._due:
            if self.link is Link.WAITING:
                self._open_line()
            elif self.link in _LOOKED_FOR:
                self._give_up_try(*self._why(), now)
        if self._listen_due is not None and now >= self._listen_due:
            self._next_try(now)
        if self.link is Link.OPEN:
            if self._config_due is not None and now >= self._config_due:
                self._ask_configuration(now)
            if (raise_due := self._raise_due()) is not None and now >= raise_due:
                self._fall_back(now)

    # Finding the robot ------------------------------------------------------------------

    def _open_line(self) -> None:
        self._tries += 1
        self._echoes_stop = False
        self._enter(Link.OPENING, None)
        self.outbox.clear()
        self.outbox.put(OpenLine())

    def _next_try(self, now: Nanos) -> None:
        """Go on with the search, or give this try up."""
        self._listen_due = None
        if not self._plan:
            self._give_up_try(*self._why(), now)
            return
        step = self._plan.popleft()
        if step.baud is not None and step.baud != self.baud:
            self.outbox.put(SetBaud(step.baud))
        self._connection = self._new_connection(step.wait_ns, step.attempts)
        self.link = Link.SEARCHING
        self._connection.connect(now)
        self._collect(now)

    def _new_connection(self, wait_ns: Nanos, attempts: int) -> Connection:
        settings = self._settings
        return Connection(
            ConnectionRole.CLIENT,
            settings=ConnectionSettings(
                sync_timeout_ns=wait_ns,
                sync_attempts=attempts,
                open_delay_ns=settings.open_delay_ns,
                first_packet_ns=settings.first_packet_ns,
                open_attempts=3,
                liveness_ns=settings.liveness_ns,
                profile=settings.profile or Profile.P2OS,
                stop_first=self._stops_first,
            ),
        )

    def _collect(self, now: Nanos) -> None:
        """Hand on the connection's events and output."""
        connection = self._connection
        while (event := connection.next_event()) is not None:
            self._take(event, now)
            if connection is not self._connection:
                return
        self.outbox.send(connection.take_output())

    def _take(self, event: Event, now: Nanos) -> None:
        match event:
            case NoiseReceived() if self._came_to == "silence":
                self._came_to = "noise"
            case FrameIgnored() if event.frame.kind == CommandNumber.STOP and self.baud is None:
                self._begin_without_stops()
            case Synchronised():
                self.identity = event.identity
                self._came_to = "answers"
            case Opened():
                self._came_to = "opened"
                self._has_opened = self._stops_first = True
                self.link = Link.STARTING
            case SipReceived():
                self._take_sip(event.sip, now)
            case ConfigReceived():
                self._take_configuration(event.config, now)
            case PacketReceived():
                self.news.append(PacketArrived(event.packet, now))
            case ConnectFailed() | ConnectionLost():
                self._take_end(event, now)
            case _:
                pass

    def _take_end(self, event: ConnectFailed | ConnectionLost, now: Nanos) -> None:
        """Act on a handshake or a session that is over; what it still has to send goes out."""
        is_loss = self.link is Link.OPEN
        if is_loss:
            self.outbox.drop_frames()
        elif self._connection.stats.frames_received and self._came_to != "opened":
            self._came_to = "answers"
        self.outbox.send(self._connection.take_output())
        if is_loss:
            self._lose(event.reason, now)
        else:
            self._next_try(now)

    def _take_sip(self, sip: StandardSip, now: Nanos) -> None:
        if self.link is Link.STARTING and self.identity is not None:
            self._enter(Link.OPEN, None)
            self._tries, self._was_open = 0, True
            self._good_baud = self._found_baud = self.baud
            self.config, self._config_asked, self._config_due = None, 0, now
            self.news.append(Connected(self.identity, self.baud, now - self._began_at))
        if self._raise is not None and self._raise.switched_at is not None:
            self._raise.packets += 1
            if self._raise.packets >= PACKETS_THAT_PROVE_A_RATE:
                self._good_baud = self._raise.new
                self._raise = None
                self.news.append(BaudRaised(self._good_baud))
        self.news.append((sip, self.profile))

    def _begin_without_stops(self) -> None:
        """Open the line anew to a peer that took STOP for a sync: it was waiting for one, so it was not open."""
        if self._echoes_stop:
            return
        self._echoes_stop = True
        self._connection = self._new_connection(self._settings.quick_sync_ns, 1)  # the old one sends no more
        self.outbox.drop_frames({CommandNumber.PULSE})  # VEL 0 and RVEL 0 still go
        self.outbox.put(CloseLine(), OpenLine())
        self._enter(Link.OPENING, None)

    # Losing it --------------------------------------------------------------------------

    def _lose(self, reason: str, now: Nanos) -> None:
        """End an open session: STOP and VEL 0 are queued already, where there is a line."""
        self.news.append(LinkLost(reason))
        self.outbox.put(CloseLine())
        self._wait_or_fail(reason, None, now)

    def _give_up_try(self, reason: str, hint: str | None, now: Nanos) -> None:
        """End a try that did not come to an open session."""
        if self.link is not Link.OPENING:
            if self._connection.state not in {ConnectionState.CLOSED, ConnectionState.FAILED}:
                self._connection.disconnect(now)
                self.outbox.drop_frames()
            self.outbox.send(self._connection.take_output())
            self.outbox.put(CloseLine())
        self._wait_or_fail(reason, hint, now)

    def _wait_or_fail(self, reason: str, hint: str | None, now: Nanos) -> None:
        if not (self._was_open and self._settings.reconnect):
            self._enter(Link.FAILED, None)
            self.news.append(GaveUp(reason, hint))
            return
        wait = min(self._settings.backoff_ns << min(self._tries, 16), self._settings.longest_backoff_ns)
        self._enter(Link.WAITING, now + wait)
        self.news.append(ReconnectPlanned(self._tries + 1, wait))

    def _why(self) -> tuple[str, str]:
        """Return how far a try came, and what to look at."""
        return why_not_found(self._came_to, self._line_baud, self._settings.bauds)

    # An open session --------------------------------------------------------------------

    def _ask_configuration(self, now: Nanos) -> None:
        if self._config_asked >= CONFIG_ATTEMPTS:
            self._config_due = None
            return
        self._config_asked += 1
        self._config_due = now + CONFIG_EVERY_NS
        self.send(Command(CommandNumber.CONFIG, 1), now)  # ARIA sends the 1; bare is as good by the manual

    def _take_configuration(self, config: ConfigPacket, now: Nanos) -> None:
        self._config_due = None
        if self.config is not None:
            return
        self.config = config
        self.news.append(ConfigurationKnown(config))
        wanted = self._settings.raise_baud
        if (config.autobaud == WANTS_HIGHER_BAUD and wanted is not None and self.baud is not None
                and wanted > self.baud and not self._raise_refused):  # fmt: skip
            self._raise = _Raise(old=self.baud, new=wanted)
            self.send(Command(CommandNumber.HOSTBAUD, BAUDS.index(wanted)), now)
            self.outbox.put(SetBaud(wanted))
            self.send(pulse(), now)

    def _raise_due(self) -> Nanos | None:
        if self._raise is None or self._raise.switched_at is None:
            return None
        return self._raise.switched_at + self._settings.raise_window_ns

    def _fall_back(self, now: Nanos) -> None:
        """Go back to the rate at which the robot was received."""
        if self._raise is None:
            return
        self.news.append(BaudKept(self._raise.old, self._raise.new))
        self.outbox.drop_frames()
        self.outbox.put(SetBaud(self._raise.old))
        self.send(pulse(), now)
        self._raise, self._raise_refused = None, True

    def _enter(self, link: Link, due: Nanos | None) -> None:
        self.link, self._due = link, due
        if link is not Link.OPEN:
            self._config_due, self._raise, self._listen_due = None, None, None


def search_plan(
    baud: int | None, bauds: tuple[int, ...], settings: ClientSettings, *, is_known: bool = False
) -> tuple[Try, ...]:
    """Return the tries, likeliest first: quick ones at every rate, then slow ones.

    Args:
        baud: The likeliest rate; None where the line has none.
        bauds: All rates, in the order in which they are tried; repeats are left out.
        settings: How long a try takes.
        is_known: The robot was open at `baud` before: it is tried again between all others.
    """
    if baud is None:
        return Try(None, settings.quick_sync_ns, 3), Try(None, settings.slow_sync_ns, 5)
    others = dict.fromkeys(rate for rate in bauds if rate != baud)
    rates = tuple(rate for other in others for rate in ((other, baud) if is_known else (other,)))
    quick = (Try(baud, settings.quick_sync_ns, 2), *(Try(rate, settings.quick_sync_ns, 1) for rate in rates))
    return (*quick, *(Try(rate, settings.slow_sync_ns, 1) for rate in (baud, *rates)))


def why_not_found(came_to: str, line_baud: int | None, bauds: tuple[int, ...]) -> tuple[str, str]:
    """Return why a search failed, and a hint.

    Args:
        came_to: How far it came, a key of `REASONS`.
        line_baud: The rate at which the line was opened; None where it has none.
        bauds: The rates that were tried beside it.
    """
    rates = dict.fromkeys((line_baud, *bauds)) if line_baud is not None else {}
    where = f" at {', '.join(map(str, rates))} baud" if rates else ""
    reason, hint = REASONS[came_to]
    return reason.format(where=where), hint


@dataclass(slots=True)
class _Raise:
    """A change of line speed under way."""

    old: int
    new: int
    switched_at: Nanos | None = None
    packets: int = 0
