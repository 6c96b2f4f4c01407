"""The adapter's states and when it leaves them.

Theory of operation
-------------------
The adapter is a client of the robot, driven by pins. It samples its inputs at
fixed instants (`sample_period_ns` apart, counted from the end of its boot), and
its state moves only there, at its own deadlines, and when bytes arrive:

    RESET       rst is high: outputs released to their pulls, nothing runs
    BOOTING     rst fell (or power came): released still, for `boot_ns`
    IDLE        outputs safe, waits for its master's wish: p2dx_con, or the pad's Up
    CONNECTING  the P2OS connection is being made; outputs safe
    SETTLING    OPEN: SETO and SONAR 1 sent, waits for odometry zero; distances live
    DRIVING     ENABLE 1 sent; motor values become VEL and RVEL; all live
    CLOSING     the wish ended: STOP, VEL 0, RVEL 0, CLOSE sent; lasts `stop_repeat_ns`
    LOST        no SIP, no belief, no pad, a shutdown: the same four sent; waits for the wish to end

    from         rst high  boot over  wish given     wish ended    opened    odometry 0      ended or not
                                                                             or settle_ns    believed
    RESET        ·         ·          ·              ·             ·         ·               ·
    BOOTING      RESET     IDLE       ·              ·             ·         ·               ·
    IDLE         RESET     ·          CONNECTING     ·             ·         ·               ·
    CONNECTING   RESET     ·          ·              CLOSING       SETTLING  ·               tries again
    SETTLING     RESET     ·          ·              CLOSING       ·         DRIVING         LOST
    DRIVING      RESET     ·          ·              CLOSING       ·         ·               LOST
    CLOSING      RESET     ·          ·              ·             ·         ·               ·
    LOST         RESET     ·          ·              ·             IDLE      ·               ·

RESET leaves to BOOTING when rst is low, CLOSING to IDLE when its time is over.
From LOST the way to motion leads over a new wish (p2dx_con low and high again, or
Up), whatever the robot does meanwhile. A change of masters leads to LOST too.

Any packet revives the last speed of a robot that its watchdog has stopped. So
the first frames after a loss are STOP, VEL 0, RVEL 0, and the same three stand
before every SYNC0 and go out after a boot: the adapter cannot know what the
robot was doing before.

Invariant: of the outputs, only SETTLING and DRIVING show what the robot reports.
"""

from dataclasses import dataclass
from enum import StrEnum

from adapter_sim.mixing import Speeds
from p2os.timing import Nanos


class AdapterState(StrEnum):
    """What the adapter is doing; see the theory of operation."""

    RESET = "reset"
    BOOTING = "booting"
    IDLE = "idle"
    CONNECTING = "connecting"
    SETTLING = "settling"
    DRIVING = "driving"
    CLOSING = "closing"
    LOST = "lost"


#: States in which the robot's session is open.
OPEN_STATES = frozenset({AdapterState.SETTLING, AdapterState.DRIVING})
#: States in which bytes are listened to and inputs are sampled.
AWAKE_STATES = frozenset(AdapterState) - {AdapterState.RESET, AdapterState.BOOTING}
#: States in which the stop sequence is repeated.
STOPPING_STATES = frozenset({AdapterState.CLOSING, AdapterState.LOST, AdapterState.IDLE})


@dataclass(frozen=True, slots=True, kw_only=True)
class AdapterStatus:
    """What the adapter knows at this moment, for people and tests."""

    state: AdapterState
    #: Why the state is what it is.
    reason: str
    #: Motor values taken, motor1 first.
    motors: tuple[int, int]
    #: Speeds of the last pair sent.
    speeds: Speeds
    #: Level of each distance wire, wire 1 first.
    distances: tuple[bool, ...]
    #: Last range of each sonar in µm, None where unknown.
    ranges_um: tuple[int | None, ...]
    #: Encoder steps since OPEN, (left, right), and those on the pins.
    counts: tuple[int, int]
    counts_shown: tuple[int, int]
    #: SIPs taken and odometry jumps since the boot.
    sips: int
    odometry_jumps: int


#: Later than any deadline.
NEVER: Nanos = 1 << 62


@dataclass(slots=True, kw_only=True)
class Agenda:
    """What the adapter has set out to do, and when; a reset wipes it."""

    #: End of the boot.
    boot_at: Nanos = NEVER
    #: Next try to connect, or end of CLOSING.
    retry_at: Nanos = NEVER
    #: The session is lost unless a SIP comes before.
    sip_deadline: Nanos = NEVER
    #: From here on the odometry is taken as it is.
    settle_at: Nanos = NEVER
    #: SONAR 1 is said again unless a reading comes before.
    sonar_at: Nanos = NEVER
    #: Stall flags of the last SIP.
    stalled: tuple[bool, bool] = (False, False)
    #: SIPs taken.
    sips: int = 0
