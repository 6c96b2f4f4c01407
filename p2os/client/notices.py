"""What a client reports to its program beside the states: errors that it raises, and notices of what happened.

Errors are one class for each thing that a program may want to catch; all are
`P2osError`: one line for a person, and a hint. Notices are past-tense facts, in order.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from p2os.errors import LocalProtocolError, TransportError
from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.packets import Identity, ServerPacket
from simbase.timing import NS_PER_S, Nanos


class ConnectError(TransportError):
    """No session could be opened; the message says how far it came."""


class LinkLostError(TransportError):
    """The session is gone, or was gone since the last motion call; STOP was sent."""


class NoAnswerError(TransportError):
    """The robot did not answer a request in time; it may not have what was asked for."""


class MotorsDisabledError(LocalProtocolError):
    """The motors are off, and this client does not switch them on by itself."""


class MotionError(LocalProtocolError):
    """`drive` or `turn` did not arrive: it stalled, was too slow, or something else took its place."""


@dataclass(frozen=True, slots=True)
class Connected:
    """A session is open and its first packet is here."""

    identity: Identity
    #: Line speed; None on TCP.
    baud: int | None
    #: From the first SYNC0 of the successful try to the first standard packet.
    took_ns: Nanos


@dataclass(frozen=True, slots=True)
class ConfigurationKnown:
    """The robot's CONFIGpac came: limits are the robot's own from now on."""

    config: ConfigPacket


@dataclass(frozen=True, slots=True)
class LinkLost:
    """The session is gone; STOP and VEL 0 were the last frames out and will be the first."""

    reason: str


@dataclass(frozen=True, slots=True)
class ReconnectPlanned:
    """The robot will be looked for again."""

    attempt: int
    wait_ns: Nanos


@dataclass(frozen=True, slots=True)
class GaveUp:
    """No session could be opened."""

    reason: str
    hint: str | None = None


@dataclass(frozen=True, slots=True)
class Disobeyed:
    """For a second the wheels neither came near what was commanded nor did the robot report a stall."""

    text: str


@dataclass(frozen=True, slots=True)
class MotorsDisabled:
    """The motors went off without a command; speeds and goals are dropped."""

    reason: str


@dataclass(frozen=True, slots=True)
class DeadmanStopped:
    """The program made no call for so long while the robot was to move; it was stopped."""

    silent_ns: Nanos


@dataclass(frozen=True, slots=True)
class GapStopped:
    """The program or its machine paused for so long while the robot was to move; STOP was sent."""

    gap_ns: Nanos


@dataclass(frozen=True, slots=True)
class MotionEnded:
    """A `drive` or `turn` is over.

    Args:
        what: Such as "drive 0.500 m".
        reached: Metres or radians, as the odometry has it.
        problem: None when it arrived, else why not.
    """

    what: str
    asked: float
    reached: float
    took_ns: Nanos
    problem: str | None = None


@dataclass(frozen=True, slots=True)
class BaudRaised:
    """The line runs at another speed from now on."""

    baud: int


@dataclass(frozen=True, slots=True)
class BaudKept:
    """No packet came at the higher speed; the line is back at the old one."""

    baud: int
    tried: int


@dataclass(frozen=True, slots=True)
class RobotUnknown:
    """No parameters are known for this model; those of `used` are taken. Pass `model=` to choose."""

    subclass: str
    used: str


@dataclass(frozen=True, slots=True)
class OdometryDoubtful:
    """Packets came so far apart that the robot could have gone half of a counter's span, or turned half round.

    The pose took the shortest step that fits, and may be wrong by whole spans.
    """

    gap_ns: Nanos


@dataclass(frozen=True, slots=True)
class PacketArrived:
    """A packet that is no standard SIP, and when it came by the client's clock."""

    packet: ServerPacket
    at_ns: Nanos


Notice = (
    Connected
    | ConfigurationKnown
    | LinkLost
    | ReconnectPlanned
    | GaveUp
    | Disobeyed
    | MotorsDisabled
    | DeadmanStopped
    | GapStopped
    | MotionEnded
    | BaudRaised
    | BaudKept
    | RobotUnknown
    | OdometryDoubtful
    | PacketArrived
)

#: What there is to say of a notice beside its name.
_DETAILS: Mapping[type, Callable[[Any], str]] = {
    Connected: lambda it: (
        f"{it.identity.name or 'a robot'} ({it.identity.subclass}){'' if it.baud is None else f' at {it.baud} bit/s'}, "
        f"after {it.took_ns / NS_PER_S:.1f} s"
    ),
    LinkLost: lambda it: it.reason,
    ReconnectPlanned: lambda it: f"try {it.attempt} in {it.wait_ns / NS_PER_S:.1f} s",
    GaveUp: lambda it: it.reason,
    Disobeyed: lambda it: it.text,
    MotorsDisabled: lambda it: it.reason,
    DeadmanStopped: lambda it: f"the program made no call for {it.silent_ns / NS_PER_S:.1f} s",
    GapStopped: lambda it: f"the program paused for {it.gap_ns / NS_PER_S:.1f} s",
    MotionEnded: lambda it: f"{it.what}{f': {it.problem}' if it.problem else ''}",
    BaudRaised: lambda it: f"{it.baud} bit/s",
    BaudKept: lambda it: f"{it.baud} bit/s; no packet came at {it.tried}",
    RobotUnknown: lambda it: f"{it.subclass!r}, taken for a {it.used}",
    OdometryDoubtful: lambda it: f"no packet for {it.gap_ns / NS_PER_S:.1f} s",
}


def words_of(notice: Notice) -> str:
    """Return a notice in words, for a person."""
    name = "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in type(notice).__name__).strip()
    detail = _DETAILS.get(type(notice), lambda _: "")(notice)
    return f"{name}: {detail}" if detail else name
