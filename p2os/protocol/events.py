"""What a connection tells its owner: past-tense facts, in the order of the stream."""

from dataclasses import dataclass

from p2os.protocol.commands import Command
from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.frames import BadChecksum, BadCount, Frame, Noise, Stalled
from p2os.protocol.packets import Identity, ServerPacket
from p2os.protocol.sip import StandardSip


@dataclass(frozen=True, slots=True)
class Synchronised:
    """SYNC0, SYNC1 and SYNC2 are done; the robot has said who it is."""

    identity: Identity


@dataclass(frozen=True, slots=True)
class Opened:
    """The session is open: server information packets flow from now on."""


@dataclass(frozen=True, slots=True)
class Closed:
    """The session was ended by one of the two."""


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
    """The client took a packet of another type, or one whose inside is not sound."""

    packet: ServerPacket


@dataclass(frozen=True, slots=True)
class FrameIgnored:
    """The client took a sound frame that answers nothing it has said while synchronising."""

    frame: Frame


@dataclass(frozen=True, slots=True)
class NoiseReceived:
    """Bytes came that are no sound frame."""

    item: Noise | BadChecksum | BadCount | Stalled


@dataclass(frozen=True, slots=True)
class WatchdogExpired:
    """Server: no sound frame came for the watchdog's time; the robot has to stop."""


@dataclass(frozen=True, slots=True)
class WatchdogRevived:
    """Server: the first frame after the watchdog; the last speeds hold again unless it says otherwise."""


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
