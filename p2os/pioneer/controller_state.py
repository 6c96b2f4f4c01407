"""What a controller is doing, for whoever looks, and what is saved of it."""

from dataclasses import dataclass


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
    #: What the robot believes of its pose, since the last SETO.
    x_mm: float
    y_mm: float
    heading_rad: float
    #: Commands that had no effect since the start: not known, or without their number.
    ignored_commands: int
    battery_v: float
    #: How much of the line the last second took, percent; None on a line that takes no time.
    line_load_percent: int | None
    #: Speed of the line now, bit/s.
    baud: int | None
    #: Extra packets and answers that found no room on the line, since the start.
    packets_dropped: int
    #: The words of every fault that lasts.
    broken: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerSnapshot:
    """All that decides a controller's future; `own` is what `Pioneer` itself counts."""

    body: object
    own: tuple[object, ...]
    complaints: tuple[str, ...]
    connection: object
    sender: object
    works: object
