"""Which extra packets a client has asked for: none, one, or one a cycle.

Source: Pioneer 2/3 H8 manual p. 49 and Pioneer 3 manual p. 43: extra packets
follow the standard one, but ARCOS sends GYROpac and JOYSTICKpac just before it;
the standard packet has priority and extra ones are dropped when the line is too
slow. One that was asked for once waits for a cycle with room.
"""

from dataclasses import dataclass
from enum import Enum

from p2os.protocol.packets import (
    ArmInfoPacket,
    ArmPacket,
    BatteryPacket,
    CompassPacket,
    EncoderPacket,
    GripperPacket,
    GyroPacket,
    IoPacket,
    JoystickPacket,
    PlaylistPacket,
    SerauxPacket,
    SiminfoPacket,
    SimLaserPacket,
    SimstatPacket,
)
from p2os.protocol.profiles import Profile


class Extra(Enum):
    """A packet that goes out beside the standard one, in the order in which they go: its packet type."""

    GYRO = GyroPacket.KIND
    JOYSTICK = JoystickPacket.KIND
    IO = IoPacket.KIND
    ENCODER = EncoderPacket.KIND
    GRIPPER = GripperPacket.KIND
    COMPASS = CompassPacket.KIND
    AUX1 = SerauxPacket.KINDS[1]
    AUX2 = SerauxPacket.KINDS[2]
    AUX3 = SerauxPacket.KINDS[3]
    PLAYLIST = PlaylistPacket.KIND
    ARM = ArmPacket.KIND
    ARM_INFO = ArmInfoPacket.KIND
    BATTERY = BatteryPacket.KIND
    SIMSTAT = SimstatPacket.KIND
    SIMINFO = SiminfoPacket.KIND
    LASER = SimLaserPacket.KINDS[0]


#: What ARCOS sends before the standard packet.
FIRST_ON_ARCOS = frozenset({Extra.GYRO, Extra.JOYSTICK})
#: chosen: after so many cycles without room a packet asked for once goes all the same, and the cycle stretches.
LONGEST_WAIT_CYCLES = 5


@dataclass(slots=True)
class Requests:
    """What is asked for."""

    continuous: frozenset[Extra] = frozenset()
    once: frozenset[Extra] = frozenset()
    #: Cycles in which a packet asked for once found no room.
    waited: int = 0
    #: Packets that found no room, since the start.
    dropped: int = 0

    def set(self, extra: Extra, value: int) -> None:
        """Take the argument of a request: 0 stops, 1 asks for one, 2 and more for one a cycle."""
        self.continuous = self.continuous | {extra} if value > 1 else self.continuous - {extra}
        self.once = self.once | {extra} if value == 1 else self.once - {extra}

    def wanted(self, profile: Profile) -> tuple[list[Extra], list[Extra]]:
        """Return what goes before the standard packet and what after it."""
        if not self.continuous and not self.once:
            return [], []
        asked = [extra for extra in Extra if extra in self.continuous or extra in self.once]
        before = [extra for extra in asked if profile is Profile.ARCOS and extra in FIRST_ON_ARCOS]
        return before, [extra for extra in asked if extra not in before]

    def sent(self, extra: Extra) -> None:
        """Note that a packet has gone."""
        self.once -= {extra}
        self.waited = 0

    def no_room(self, extra: Extra) -> None:
        """Note that a packet found no room."""
        if extra in self.once:
            self.waited += 1
        else:
            self.dropped += 1

    def must_go(self, extra: Extra) -> bool:
        """Tell whether a packet has waited long enough."""
        return extra in self.once and self.waited >= LONGEST_WAIT_CYCLES
