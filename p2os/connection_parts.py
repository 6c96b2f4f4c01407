"""What both ends of a connection share: settings, statistics, and the line's queues."""

from collections import deque
from dataclasses import dataclass, field

from p2os.errors import LocalProtocolError
from p2os.events import Event
from p2os.profiles import Profile
from p2os.timing import NS_PER_MS, NS_PER_S, Nanos
from p2os.wire import DecoderStats, Frame


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
    close_wait_ns: Nanos = 200 * NS_PER_MS
    #: From the identity to OPEN; ARIA waits one cycle.
    open_delay_ns: Nanos = 100 * NS_PER_MS
    #: A PULSE goes out when nothing else did for so long; the robot's watchdog bites after 2 s.
    pulse_ns: Nanos = 500 * NS_PER_MS
    #: From OPEN to the first packet.
    first_packet_ns: Nanos = NS_PER_S
    #: OPEN is sent again when no packet has followed it for so long: one that was lost must not cost the session.
    open_retry_ns: Nanos = 300 * NS_PER_MS
    #: How often OPEN is sent; the time to the first packet bounds it too.
    open_attempts: int = 1
    #: An open session without a sound packet for so long is lost: three cycles and a frame.
    liveness_ns: Nanos = 350 * NS_PER_MS
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
    #: Packets of a known type whose inside was not sound.
    malformed: int = 0
    watchdog_stops: int = 0
    sync_timeouts: int = 0
    losses: int = 0
    wire: DecoderStats = field(default_factory=DecoderStats)


class Line:
    """The queues between a connection's side and its owner."""

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
