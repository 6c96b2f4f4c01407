"""The robot's own firmware, as a passive state machine above a body.

Bytes of a client go in, bytes of the robot come out, and the body is stepped in
between: handshake, motion commands, odometry, sonar, watchdog.

Invariant: at time t the body stands at its first step border at or after t, so
the result does not depend on how often anybody calls `advance_to`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from p2os.timing import NS_PER_MS, NS_PER_S, Nanos, Reached

if TYPE_CHECKING:
    from p2os.parameters import RobotParameters
    from p2os.pioneer.body import RobotBody

#: (now in ns, what happened in a word or two, detail).
EventCallback = Callable[[Nanos, str, str], None]


class SonarPerSip(Enum):
    """How many sonar readings a standard packet carries."""

    #: Two new readings a cycle in ring order, as a Pioneer 2 sends them.
    TWO = "two"
    #: Every fitted sonar in every packet.
    ALL = "all"


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerSettings:
    """What the real robot keeps in FLASH."""

    name: str = "Virtual"
    sip_period_ns: Nanos = 100 * NS_PER_MS
    watchdog_ns: Nanos = 2 * NS_PER_S
    sonar_per_sip: SonarPerSip = SonarPerSip.TWO
    battery_v: float = 12.6
    profile: str = "P2OS"


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerState:
    """What the controller is doing, as plain values."""

    open: bool
    motors_enabled: bool
    watchdog_expired: bool
    sonar_on: bool
    #: Rim-speed set-points of this moment, after the ramps, in m/s.
    left_setpoint_mps: float
    right_setpoint_mps: float
    #: Commands that were not understood, and so ignored, since the start.
    unknown_commands: int


class Pioneer:
    """A P2OS robot: its controller and its body."""

    def __init__(
        self,
        *,
        parameters: "RobotParameters",
        body: "RobotBody",
        settings: ControllerSettings | None = None,
        on_event: EventCallback | None = None,
    ) -> None:
        self.parameters = parameters
        self.body = body
        self.settings = settings or ControllerSettings()
        self.on_event = on_event

    @property
    def state(self) -> ControllerState:
        """Return what the controller is doing now."""
        raise NotImplementedError

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that the line has delivered at `now`."""
        raise NotImplementedError

    def hang_up(self, now: Nanos) -> None:
        """Stop at once and close, as when the host sees its client vanish."""
        raise NotImplementedError

    def take_output(self) -> list[bytes]:
        """Return the frames to send, one item each, oldest first, and forget them."""
        raise NotImplementedError

    def next_deadline(self) -> Nanos | None:
        """Return when bytes will come out or the watchdog will bite."""
        raise NotImplementedError

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on everything due up to and including `limit`, and step the body."""
        raise NotImplementedError

    def snapshot(self) -> dict[str, object]:
        """Return all that decides the future, body included."""
        raise NotImplementedError

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        raise NotImplementedError
