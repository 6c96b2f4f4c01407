"""What a connection reports to its owner: past-tense facts, in the order of the stream."""

from dataclasses import dataclass

from p2os.protocol.commands import Command
from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.frames import BadChecksum, BadCount, Frame, Noise, Stalled
from p2os.protocol.packets import Identity, ServerPacket
from p2os.protocol.sip import StandardSip


@dataclass(frozen=True, slots=True)
class Synchronised:
    """SYNC0, SYNC1 and SYNC2 are done; the robot has sent its identity."""

    identity: Identity


@dataclass(frozen=True, slots=True)
class Opened:
    """The session is open: server information packets flow from now on."""


@dataclass(frozen=True, slots=True)
class Closed:
    """The session was closed, by either end."""


@dataclass(frozen=True, slots=True)
class CommandReceived:
    """The server took a command of an open session; PULSE included."""

    command: Command


@dataclass(frozen=True, slots=True)
class SipReceived:
    """The client took a standard SIP."""

    sip: StandardSip


@dataclass(frozen=True, slots=True)
class ConfigReceived:
    """The client took a CONFIGpac."""

    config: ConfigPacket


@dataclass(frozen=True, slots=True)
class PacketReceived:
    """The client took a packet of another type, or one whose content is not sound."""

    packet: ServerPacket


@dataclass(frozen=True, slots=True)
class FrameIgnored:
    """The client took a sound frame that answers nothing it has sent while synchronising."""

    frame: Frame


@dataclass(frozen=True, slots=True)
class NoiseReceived:
    """Bytes were received that are no sound frame."""

    item: Noise | BadChecksum | BadCount | Stalled


@dataclass(frozen=True, slots=True)
class WatchdogExpired:
    """Server: no sound frame came within the watchdog's timeout; the robot has to stop."""


@dataclass(frozen=True, slots=True)
class WatchdogRevived:
    """Server: the first frame after the watchdog; the last speeds apply again unless it sets others."""


@dataclass(frozen=True, slots=True)
class ConnectionLost:
    """Client: the open session is gone; STOP and VEL 0 are the first frames out."""

    reason: str


@dataclass(frozen=True, slots=True)
class ConnectFailed:
    """Client: no session could be opened."""

    reason: str


Event = (
    Synchronised
    | Opened
    | Closed
    | CommandReceived
    | SipReceived
    | ConfigReceived
    | PacketReceived
    | FrameIgnored
    | NoiseReceived
    | WatchdogExpired
    | WatchdogRevived
    | ConnectionLost
    | ConnectFailed
)
