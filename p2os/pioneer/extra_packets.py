"""What the extra packets say: one small function a packet, and the table of them."""

from collections.abc import Callable, Mapping

from p2os.packets import (
    ArmInfoPacket,
    ArmPacket,
    BatteryPacket,
    EncoderPacket,
    PlaylistPacket,
    ServerPacket,
)
from p2os.pioneer.flash import Flash
from p2os.pioneer.requests import Extra
from p2os.pioneer.works import Works
from p2os.timing import Nanos

#: What one packet is made from: the parts, the FLASH, pressed bumper segments (front, rear), the time.
Maker = Callable[[Works, Flash, tuple[int, int], Nanos], ServerPacket]


def encoder_packet(works: Works, flash: Flash) -> EncoderPacket:
    """Return both encoders' counts since the start, in TICKSMM of the FLASH."""
    ticks = works.kept.get("ticksmm", flash.number("ticksmm"))
    return EncoderPacket(
        left_counts=_signed32(round(works.reckoning.left_mm * ticks)),
        right_counts=_signed32(round(works.reckoning.right_mm * ticks)),
    )


def battery_packet(works: Works) -> BatteryPacket:
    """Return one battery's row: no flags, its charge twice."""
    charge = works.rack.battery.state_of_charge
    return BatteryPacket(batteries=((0, 0, 0, charge, charge),))


MAKERS: Mapping[Extra, Maker] = {
    Extra.GYRO: lambda works, _flash, _bumps, _now: works.rack.gyro.take_packet(),
    Extra.JOYSTICK: lambda works, _flash, _bumps, _now: works.rack.joystick.packet(),
    Extra.IO: lambda works, _flash, bumps, now: works.rack.pins.packet(
        digital_in=works.rack.digital_in(now), front=bumps[0], rear=bumps[1], decivolts=works.rack.battery.decivolts
    ),
    Extra.ENCODER: lambda works, flash, _bumps, _now: encoder_packet(works, flash),
    Extra.GRIPPER: lambda works, _flash, _bumps, now: works.rack.gripper.packet(now),
    Extra.COMPASS: lambda works, _flash, _bumps, _now: works.rack.compass.packet(),
    Extra.AUX1: lambda works, _flash, _bumps, _now: works.rack.aux[0].take_answer(),
    Extra.AUX2: lambda works, _flash, _bumps, _now: works.rack.aux[1].take_answer(),
    Extra.AUX3: lambda works, _flash, _bumps, _now: works.rack.aux[2].take_answer(),
    Extra.PLAYLIST: lambda _works, _flash, _bumps, _now: PlaylistPacket(),
    Extra.ARM: lambda _works, _flash, _bumps, _now: ArmPacket(),
    Extra.ARM_INFO: lambda _works, _flash, _bumps, _now: ArmInfoPacket(),
    Extra.BATTERY: lambda works, _flash, _bumps, _now: battery_packet(works),
}


def _signed32(value: int) -> int:
    return (value + (1 << 31)) % (1 << 32) - (1 << 31)
