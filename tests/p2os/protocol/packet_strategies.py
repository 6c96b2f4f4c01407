"""What a robot may send: one hypothesis strategy a kind of packet, every field over its whole range."""

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

u8, u16, u32 = st.integers(0, 0xFF), st.integers(0, 0xFFFF), st.integers(0, 2**32 - 1)
s8, s16, s32 = st.integers(-0x80, 0x7F), st.integers(-0x8000, 0x7FFF), st.integers(-(2**31), 2**31 - 1)
rest = st.binary(max_size=4)
text = st.binary(max_size=8).map(lambda raw: raw.replace(b"\0", b"x"))


def several(item: st.SearchStrategy, most: int) -> st.SearchStrategy[tuple]:
    return st.lists(item, max_size=most).map(tuple)


def batteries() -> st.SearchStrategy[BatteryPacket]:
    return u8.map(lambda size: size % 7).flatmap(
        lambda size: st.builds(
            BatteryPacket, batteries=several(st.tuples(*[u8] * size), 6), row_bytes=st.just(size), rest=rest
        )
    )


def extended_lasers() -> st.SearchStrategy[SimLaserPacket]:
    rows = st.lists(st.tuples(u16, u8, u16), max_size=20)
    return rows.flatmap(
        lambda found: st.builds(
            SimLaserPacket, is_extended=st.just(True), total=u16, first=u16, laser=u8, flags=u8, rest=rest,
            ranges_mm=st.just(tuple(row[0] for row in found)), reflectances=st.just(tuple(row[1] for row in found)),
            flags_of_readings=st.just(tuple(row[2] for row in found)),
        )
    )  # fmt: skip


#: One strategy a kind of packet: every field over its whole range.
ANY: dict[str, st.SearchStrategy] = {
    "encoder": st.builds(EncoderPacket, left_counts=s32, right_counts=s32, rest=rest),
    "gyro": st.builds(
        GyroPacket, readings=several(st.builds(GyroReading, raw_rate=u16, raw_temperature=u8), 20), rest=rest
    ),
    "compass": st.builds(
        CompassPacket, raw_compass=u16, raw_pitch=s16, raw_roll=s16, raw_x=s16, raw_y=s16, raw_z=s16,
        raw_temperature=s16, error_bits=u16, h_score=u8, v_score=u8, raw_m_score=u16, raw_size=u8, rest=rest,
    ),
    "compass without size": st.builds(CompassPacket, raw_compass=u16, raw_pitch=s16, raw_size=st.none()),
    "io": st.builds(
        IoPacket, digital_in=several(u8, 6), digital_out=several(u8, 6), raw_analog=several(u16, 12), rest=rest
    ),
    "seraux": st.builds(SerauxPacket, port=st.integers(1, 3), data=st.binary(max_size=201)),
    "gripper": st.builds(GripperPacket, gripper_type=u8, state=u8, grasp_time=u8, rest=rest),
    "joystick": st.builds(
        JoystickPacket, button1=u8, button2=u8, raw_x=u16, raw_y=u16, raw_throttle=u16, rest=rest
    ),
    "playlist": st.builds(
        PlaylistPacket, rest=rest,
        sound=st.builds(Sound, number=u8, toggle=u8, raw_name=st.binary(min_size=16, max_size=16), offset=u32,
                        length=u32),
    ),
    "no sounds": st.just(PlaylistPacket()),
    "arm": st.builds(ArmPacket, status=u8, moving=u8, positions=st.tuples(*[u8] * 6), rest=rest),
    "arm info": st.builds(ArmInfoPacket, raw_version=text, joints=several(st.builds(
        ArmJoint, speed=u8, home=u8, least=u8, centre=u8, most=u8, ticks_per_90=u8), 8), rest=rest),
    "battery": batteries(),
    "reset": st.builds(ResetNotice, kind=st.sampled_from((0xFE, 0xFF)), data=rest),
    "simstat": st.builds(
        SimstatPacket, raw_name=text, raw_version=text, flags=u32, wanted_interval_ms=u16, real_interval_ms=u16,
        last_interval_ms=u16, x_mm=s32, y_mm=s32, z_mm=s32, heading_deg=s32, raw_latitude=s32, raw_longitude=s32,
        altitude_cm=s32, raw_precision=s32, raw_error_x=s32, raw_error_y=s32, raw_error_heading=s32, rest=rest,
    ),
    "siminfo": st.builds(
        SiminfoPacket, raw_name=text, raw_version=text, flags=u32, rest=rest,
        devices=several(st.builds(SimDevice, raw_name=text, raw_type=text, number=u8, status=u32), 4),
    ),
    "laser": st.builds(
        SimLaserPacket, raw_pose=st.tuples(s16, s16, s16), total=u16, first=u16, ranges_mm=several(u16, 60), rest=rest
    ),
    "extended laser": extended_lasers(),
    "map changed": st.builds(MapChangedPacket, by_user=u8, status=s8, raw_name=text, rest=rest),
}  # fmt: skip


def _tail(fields: int) -> st.SearchStrategy[tuple]:
    widths = TAIL[:fields]
    return st.tuples(
        *[
            st.integers(-(2 ** (8 * width - 1)), 2 ** (8 * width - 1) - 1)
            if signed
            else st.integers(0, 2 ** (8 * width) - 1)
            for _, width, signed in widths
        ]
    )


#: Bytes after a SIP are part of its tail where there is room, so only a whole tail has a rest.
SIPS = st.integers(0, len(TAIL)).flatmap(
    lambda fields: st.builds(
        StandardSip, kind=st.integers(0x30, 0x34), raw_x=u16, raw_y=u16, raw_heading=s16, raw_left_velocity=s16,
        raw_right_velocity=s16, raw_battery=u8, stall_left=st.booleans(), stall_right=st.booleans(),
        rear_bumpers=st.integers(0, 127), front_bumpers=st.integers(0, 127), raw_control=s16, raw_flags=u16,
        raw_compass=u8, sonar=several(st.builds(SonarReading, u8, u16), 8), analog_port=u8, gripper_state=u8,
        raw_analog=u8, digital_in=u8, digital_out=u8, tail=_tail(fields),
        rest=rest if fields == len(TAIL) else st.just(b""),
    )
)  # fmt: skip
_latin = text.map(lambda raw: raw.decode("latin-1"))
IDENTITIES = st.builds(Identity, _latin, _latin, _latin)
CONFIGS = st.integers(0, 66).flatmap(
    lambda sent: st.builds(
        ConfigPacket, robot_class=_latin if sent else st.just(""), subclass=_latin if sent > 1 else st.just(""),
        four_motors=u8 if sent > 3 else st.just(0), fields_sent=st.just(sent),
    )
)  # fmt: skip
RAWS = st.builds(RawPacket, st.sampled_from((0x00, 0x01, 0x77, 0x7B, 0x95, 0xD5)), st.binary(max_size=12))
#: Any packet of a session.
PACKETS: st.SearchStrategy[ServerPacket] = st.one_of(SIPS, IDENTITIES, CONFIGS, RAWS, *ANY.values())
