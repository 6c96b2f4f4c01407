"""What a robot may send, as a seed gives it: one function a kind of packet, every field over its whole range.

Hypothesis draws the seed alone, which takes a tenth of the time that it takes to draw a packet field by field. A small
seed gives short lists, so that a test that fails shows a small packet.
"""

from collections.abc import Callable, Iterator
from random import Random
from typing import TypeVar

from hypothesis import strategies as st

from p2os.protocol.packets import (
    ArmInfoPacket,
    ArmJoint,
    ArmPacket,
    BatteryPacket,
    CompassPacket,
    ConfigPacket,
    EncoderPacket,
    GripperPacket,
    GyroPacket,
    GyroReading,
    Identity,
    IoPacket,
    JoystickPacket,
    MapChangedPacket,
    PlaylistPacket,
    RawPacket,
    ResetNotice,
    SerauxPacket,
    ServerPacket,
    SimDevice,
    SiminfoPacket,
    SimLaserPacket,
    SimstatPacket,
    SonarReading,
    Sound,
    StandardSip,
)
from p2os.protocol.sip import TAIL

T = TypeVar("T")
#: What Hypothesis draws.
SEEDS = st.integers(0, 2**32 - 1)


def pairs_of_bytes(least: int, most: int) -> Iterator[tuple[int, int]]:
    """Yield pairs in which each value of either byte meets ends, neighbours of 0 and itself on the other side."""
    for value in range(least, most + 1):
        for other in {least, min(max(least, -1), most), 0, 1, most, value}:
            yield value, other
            yield other, value


class Draw:
    """Values, one after the other.

    Args:
        seed: The same gives the same values; lists are no longer than it has bits.
    """

    def __init__(self, seed: int) -> None:
        self._random, self._most = Random(seed), seed.bit_length()

    def integer(self, least: int, most: int) -> int:
        """Return a number of a range; half of the time one of its ends or what of it is nearest to 0."""
        kind = self._random.randrange(6)
        if kind < 3:
            return (least, most, min(max(least, 0), most))[kind]
        return self._random.randint(least, most)

    def one_of(self, *items: T) -> T:
        return items[int(self._random.random() * len(items))]

    def size(self, most: int) -> int:
        return self._random.randint(0, min(most, self._most))

    def several(self, item: Callable[[], T], most: int) -> tuple[T, ...]:
        return tuple([item() for _ in range(self.size(most))])

    def data(self, most: int) -> bytes:
        return self._random.randbytes(self.size(most))

    def bytes_of(self, least: int, most: int) -> bytes:
        """Return so many bytes."""
        return self._random.randbytes(self.integer(least, most))

    def bits(self, size: int) -> int:
        return self.integer(0, (1 << size) - 1)

    def u8(self) -> int:
        return self.bits(8)

    def u16(self) -> int:
        return self.bits(16)

    def u32(self) -> int:
        return self.bits(32)

    def signed(self, size: int) -> int:
        return self.integer(-(1 << size - 1), (1 << size - 1) - 1)

    def s16(self) -> int:
        return self.signed(16)

    def s32(self) -> int:
        return self.signed(32)

    def boolean(self) -> bool:
        return self._random.random() < 0.5

    def rest(self) -> bytes:
        return self.data(4)

    def text(self) -> bytes:
        return self.data(8).replace(b"\0", b"x")

    def latin(self) -> str:
        return self.text().decode("latin-1")


def gyro(draw: Draw) -> GyroPacket:
    readings = draw.several(lambda: GyroReading(raw_rate=draw.u16(), raw_temperature=draw.u8()), 20)
    return GyroPacket(readings=readings, rest=draw.rest())


def compass(draw: Draw) -> CompassPacket:
    return CompassPacket(
        raw_compass=draw.u16(), raw_pitch=draw.s16(), raw_roll=draw.s16(), raw_x=draw.s16(), raw_y=draw.s16(),
        raw_z=draw.s16(), raw_temperature=draw.s16(), error_bits=draw.u16(), h_score=draw.u8(), v_score=draw.u8(),
        raw_m_score=draw.u16(), raw_size=draw.u8(), rest=draw.rest(),
    )  # fmt: skip


def playlist(draw: Draw) -> PlaylistPacket:
    name = draw.data(16).ljust(16, b"\0")
    sound = Sound(number=draw.u8(), toggle=draw.u8(), raw_name=name, offset=draw.u32(), length=draw.u32())
    return PlaylistPacket(sound=sound, rest=draw.rest())


def arm_info(draw: Draw) -> ArmInfoPacket:
    def joint() -> ArmJoint:
        return ArmJoint(
            speed=draw.u8(), home=draw.u8(), least=draw.u8(), centre=draw.u8(), most=draw.u8(), ticks_per_90=draw.u8()
        )

    return ArmInfoPacket(raw_version=draw.text(), joints=draw.several(joint, 8), rest=draw.rest())


def battery(draw: Draw) -> BatteryPacket:
    size = draw.integer(0, 6)
    rows = draw.several(lambda: tuple([draw.u8() for _ in range(size)]), 6)
    return BatteryPacket(batteries=rows, row_bytes=size, rest=draw.rest())


def simstat(draw: Draw) -> SimstatPacket:
    return SimstatPacket(
        raw_name=draw.text(), raw_version=draw.text(), flags=draw.u32(), wanted_interval_ms=draw.u16(),
        real_interval_ms=draw.u16(), last_interval_ms=draw.u16(), x_mm=draw.s32(), y_mm=draw.s32(), z_mm=draw.s32(),
        heading_deg=draw.s32(), raw_latitude=draw.s32(), raw_longitude=draw.s32(), altitude_cm=draw.s32(),
        raw_precision=draw.s32(), raw_error_x=draw.s32(), raw_error_y=draw.s32(), raw_error_heading=draw.s32(),
        rest=draw.rest(),
    )  # fmt: skip


def siminfo(draw: Draw) -> SiminfoPacket:
    def device() -> SimDevice:
        return SimDevice(raw_name=draw.text(), raw_type=draw.text(), number=draw.u8(), status=draw.u32())

    return SiminfoPacket(
        raw_name=draw.text(), raw_version=draw.text(), flags=draw.u32(), devices=draw.several(device, 4),
        rest=draw.rest(),
    )  # fmt: skip


def laser(draw: Draw) -> SimLaserPacket:
    return SimLaserPacket(
        raw_pose=(draw.s16(), draw.s16(), draw.s16()), total=draw.u16(), first=draw.u16(),
        ranges_mm=draw.several(draw.u16, 60), rest=draw.rest(),
    )  # fmt: skip


def extended_laser(draw: Draw) -> SimLaserPacket:
    rows = range(draw.size(20))
    return SimLaserPacket(
        is_extended=True, total=draw.u16(), first=draw.u16(), laser=draw.u8(), flags=draw.u8(), rest=draw.rest(),
        ranges_mm=tuple([draw.u16() for _ in rows]), reflectances=tuple([draw.u8() for _ in rows]),
        flags_of_readings=tuple([draw.u16() for _ in rows]),
    )  # fmt: skip


#: A function a kind of packet that names a type: every field over its whole range.
KINDS: dict[str, Callable[[Draw], ServerPacket]] = {
    "encoder": lambda draw: EncoderPacket(left_counts=draw.s32(), right_counts=draw.s32(), rest=draw.rest()),
    "gyro": gyro,
    "compass": compass,
    "compass without size": lambda draw: CompassPacket(raw_compass=draw.u16(), raw_pitch=draw.s16(), raw_size=None),
    "io": lambda draw: IoPacket(
        digital_in=draw.several(draw.u8, 6), digital_out=draw.several(draw.u8, 6),
        raw_analog=draw.several(draw.u16, 12), rest=draw.rest(),
    ),
    "seraux": lambda draw: SerauxPacket(port=draw.integer(1, 3), data=draw.data(201)),
    "gripper": lambda draw: GripperPacket(
        gripper_type=draw.u8(), state=draw.u8(), grasp_time=draw.u8(), rest=draw.rest()
    ),
    "joystick": lambda draw: JoystickPacket(
        button1=draw.u8(), button2=draw.u8(), raw_x=draw.u16(), raw_y=draw.u16(), raw_throttle=draw.u16(),
        rest=draw.rest(),
    ),
    "playlist": playlist,
    "no sounds": lambda _: PlaylistPacket(),
    "arm": lambda draw: ArmPacket(
        status=draw.u8(), moving=draw.u8(), positions=tuple([draw.u8() for _ in range(6)]), rest=draw.rest()
    ),
    "arm info": arm_info,
    "battery": battery,
    "reset": lambda draw: ResetNotice(kind=draw.one_of(0xFE, 0xFF), data=draw.rest()),
    "simstat": simstat,
    "siminfo": siminfo,
    "laser": laser,
    "extended laser": extended_laser,
    "map changed": lambda draw: MapChangedPacket(
        by_user=draw.u8(), status=draw.signed(8), raw_name=draw.text(), rest=draw.rest()
    ),
}  # fmt: skip


def sip(draw: Draw, *, fields: int = 0, most_readings: int = 8) -> StandardSip:
    """Return a SIP; bytes behind it are part of its tail where there is room, so only a whole tail has a rest."""
    tail = [draw.signed(8 * size) if signed else draw.bits(8 * size) for _, size, signed in TAIL[:fields]]
    return StandardSip(
        kind=draw.integer(0x30, 0x34), raw_x=draw.u16(), raw_y=draw.u16(), raw_heading=draw.s16(),
        raw_left_velocity=draw.s16(), raw_right_velocity=draw.s16(), raw_battery=draw.u8(),
        stall_left=draw.boolean(), stall_right=draw.boolean(), rear_bumpers=draw.bits(7), front_bumpers=draw.bits(7),
        raw_control=draw.s16(), raw_flags=draw.u16(), raw_compass=draw.u8(),
        sonar=draw.several(lambda: SonarReading(draw.u8(), draw.u16()), most_readings), analog_port=draw.u8(),
        gripper_state=draw.u8(), raw_analog=draw.u8(), digital_in=draw.u8(), digital_out=draw.u8(), tail=tuple(tail),
        rest=draw.rest() if fields == len(TAIL) else b"",
    )  # fmt: skip


def any_sip(draw: Draw) -> StandardSip:
    """Return a SIP with a tail of any length."""
    return sip(draw, fields=draw.integer(0, len(TAIL)))


def config(draw: Draw) -> ConfigPacket:
    sent = draw.integer(0, 66)
    return ConfigPacket(
        robot_class=draw.latin() if sent else "", subclass=draw.latin() if sent > 1 else "",
        four_motors=draw.u8() if sent > 3 else 0, fields_sent=sent,
    )  # fmt: skip


def identity(draw: Draw) -> Identity:
    return Identity(draw.latin(), draw.latin(), draw.latin())


def raw(draw: Draw) -> RawPacket:
    return RawPacket(draw.one_of(0x00, 0x01, 0x77, 0x7B, 0x95, 0xD5), draw.data(12))


#: All kinds, those without a type of their own among them.
ALL: tuple[Callable[[Draw], ServerPacket], ...] = (any_sip, identity, config, raw, *KINDS.values())


def any_packet(draw: Draw) -> ServerPacket:
    """Return any packet of a session."""
    return draw.one_of(*ALL)(draw)
