"""How a client behaves: its times, its timeouts, and what it does by itself."""

from dataclasses import dataclass

from p2os.protocol.bauds import BAUDS, BAUDS_TEXT
from p2os.protocol.profiles import Profile
from p2os.protocol.times import WATCHDOG_NS
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: A program that holds a speed and makes no call for so long loses it; as long as the robot itself waits.
DEADMAN_S = WATCHDOG_NS / NS_PER_S
#: Where a robot is looked for, the likeliest first.
SEARCHED_BAUDS = tuple(BAUDS[code] for code in (0, 2, 4, 1, 3))


@dataclass(frozen=True, slots=True, kw_only=True)
class ClientSettings:
    """The settings of a `Robot`; every time in nanoseconds.

    Raises:
        UsageError: A value is out of its range.
    """

    #: Firmware family; None: by the robot's packets.
    profile: Profile | None = None
    #: Motors are switched on by the first motion of a session; False: only by `enable()`.
    auto_enable: bool = True
    #: After a loss the robot is looked for again; nothing moves until asked.
    reconnect: bool = True
    #: A speed is taken back when the program has made no call for so long; None: never.
    deadman_ns: Nanos | None = WATCHDOG_NS
    #: A session without a sound packet for so long is lost; half of the robot's own watchdog.
    liveness_ns: Nanos = WATCHDOG_NS // 2
    #: The present speed goes out again after so long, for P2OS acknowledges nothing: 200 ms less what frames queue for.
    refresh_ns: Nanos = 180 * NS_PER_MS
    #: chosen: two frames of a speed take 19 ms at 9600 baud; nearer ones would queue up.
    speed_spacing_ns: Nanos = 40 * NS_PER_MS
    #: AROS loses commands that come nearer than 3 to 5 ms (Pioneer 2/3 H8 manual, page 42).
    command_spacing_ns: Nanos = 5 * NS_PER_MS
    #: A robot that neither approaches its command nor reports a stall for so long is reported as `Disobeyed`.
    plausibility_ns: Nanos = 1 * NS_PER_S
    #: How long a new TCP line is listened to for a robot that is open already: two and a half cycles.
    listen_ns: Nanos = 250 * NS_PER_MS
    #: First round of the search, one try a rate: robots answer within 110 ms (measured on a simulator).
    quick_sync_ns: Nanos = 400 * NS_PER_MS
    #: Second round, for slow lines; ARIA waits as long.
    slow_sync_ns: Nanos = 1 * NS_PER_S
    #: From the identity to OPEN: the manual's spacing of commands.
    open_delay_ns: Nanos = 5 * NS_PER_MS
    #: From the first OPEN to the first packet; OPEN is repeated meanwhile.
    first_packet_ns: Nanos = 1 * NS_PER_S
    #: Baud rates to look for the robot at, after the one that the line was opened with.
    bauds: tuple[int, ...] = SEARCHED_BAUDS
    #: Rate to which a serial line is raised when the robot offers it (CONFIGpac autobaud 2); None: never.
    raise_baud: int | None = BAUDS[2]
    #: From HOSTBAUD to the first packet at the new rate, before falling back.
    raise_window_ns: Nanos = 500 * NS_PER_MS
    #: First wait before looking for a lost robot again; doubled after each failure.
    backoff_ns: Nanos = 250 * NS_PER_MS
    longest_backoff_ns: Nanos = 5 * NS_PER_S

    def __post_init__(self) -> None:
        for name in ("liveness_ns", "refresh_ns", "speed_spacing_ns", "command_spacing_ns", "plausibility_ns",
                     "listen_ns", "quick_sync_ns", "slow_sync_ns", "open_delay_ns", "first_packet_ns",
                     "raise_window_ns", "backoff_ns", "longest_backoff_ns"):  # fmt: skip
            if getattr(self, name) <= 0:
                raise UsageError(f"{name} = {getattr(self, name)} must be positive")
        if self.deadman_ns is not None and self.deadman_ns <= 0:
            raise UsageError(f"deadman_ns = {self.deadman_ns} must be positive, or None")
        if self.raise_baud is not None and self.raise_baud not in BAUDS:
            raise UsageError(f"raise_baud = {self.raise_baud} is no rate of HOSTBAUD", hint=f"one of {BAUDS_TEXT}")
