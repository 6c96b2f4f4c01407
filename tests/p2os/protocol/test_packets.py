"""Every server packet two-way: by vector, by property, cut at every byte, and any frame at all."""

import json
from collections.abc import Callable
from dataclasses import MISSING, fields
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.errors import LocalProtocolError, RemoteProtocolError
from p2os.protocol.frames import Frame
from p2os.protocol.packets import (
    PACKET_NAMES,
    READERS,
    ArmInfoPacket,
    ArmJoint,
    ArmPacket,
    BatteryPacket,
    CompassPacket,
    EncoderPacket,
    GripperPacket,
    GripperState,
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
    Sound,
    packet_frame,
    packet_name,
    read_packet,
)
from p2os.protocol.profiles import Profile
from tests.p2os.protocol.drawn_packets import KINDS, SEEDS, Draw
from tests.tools.each_row import each_row

GOLDEN = Path(__file__).parents[2] / "golden"
VECTORS = {vector["name"]: vector for vector in json.loads((GOLDEN / "p2os_vectors.json").read_text(encoding="utf-8"))}


@given(SEEDS)
def test_a_packet_of_each_kind_survives_the_wire(seed: int) -> None:
    draw = Draw(seed)
    for kind in KINDS.values():
        packet = kind(draw)
        frame = packet_frame(packet, Profile.P2OS)
        assert type(packet).from_frame(frame) == packet
        for profile in Profile:
            assert read_packet(frame, profile) == packet


def test_every_packet_that_is_read_has_a_name() -> None:
    assert set(READERS) <= set(PACKET_NAMES)
    assert packet_name(0x90) == "ENCODERpac"
    assert packet_name(0x77) == "packet 0x77"


@pytest.mark.parametrize(
    ("vector", "packet"),
    [
        ("encoderpac", EncoderPacket(left_counts=123456, right_counts=-654321)),
        ("iopac", IoPacket(digital_in=(255, 254, 253, 252), digital_out=(9,), raw_analog=tuple(range(0, 801, 100)))),
        ("serauxpac", SerauxPacket(port=1, data=b"\x90\0\1")),
        ("seraux2pac", SerauxPacket(port=2, data=b"OK\r")),
        ("gyropac", GyroPacket(readings=(GyroReading(raw_rate=512, raw_temperature=60),
                                         GyroReading(raw_rate=530, raw_temperature=61)))),
        ("gripperpac", GripperPacket(gripper_type=2, state=63, grasp_time=10)),
        ("joystickpac", JoystickPacket(button1=1, raw_x=512, raw_y=700, raw_throttle=1023)),
        ("playlistpac_none", PlaylistPacket()),
        ("tcm2pac", CompassPacket(raw_compass=1800, raw_pitch=50, raw_roll=-30, raw_x=2000, raw_y=-1500, raw_z=4000,
                                  raw_temperature=225, h_score=9, v_score=8, raw_m_score=5500)),
        ("sync2_reply_p2dx", Identity("Wilma", "Pioneer", "p2dx")),
    ],
)  # fmt: skip
def test_a_vector_reads_as_what_it_says(vector: str, packet: ServerPacket) -> None:
    frame = Frame.from_bytes(bytes.fromhex(VECTORS[vector]["hex"]))
    assert read_packet(frame, Profile.AROS) == packet
    assert packet_frame(packet, Profile.AROS) == frame


@given(
    st.one_of(st.integers(0, 0xFF), st.sampled_from(sorted(PACKET_NAMES))),
    st.binary(max_size=201),
    st.sampled_from(Profile),
)
def test_nothing_that_a_frame_holds_is_lost(kind: int, data: bytes, profile: Profile) -> None:
    frame = Frame(bytes((kind,)) + data)
    assert packet_frame(read_packet(frame, profile), profile) == frame


#: Packets whose last byte is needed: cut anywhere, they are not sound.
STRICT: list[ServerPacket] = [
    EncoderPacket(left_counts=1, right_counts=2),
    GyroPacket(readings=(GyroReading(raw_rate=512, raw_temperature=60),) * 3),
    IoPacket(digital_in=(1, 2), digital_out=(3,), raw_analog=(4, 5)),
    GripperPacket(),
    JoystickPacket(),
    ArmPacket(),
    ArmInfoPacket(raw_version=b"1.2", joints=(ArmJoint(speed=1, home=2, least=3, centre=4, most=5, ticks_per_90=6),)),
    BatteryPacket(batteries=((1, 2, 3, 4, 5),)),
    SimstatPacket(),
    SiminfoPacket(devices=(SimDevice(raw_name=b"a", raw_type=b"b", number=0, status=1),)),
    SimLaserPacket(ranges_mm=(1, 2)),
    SimLaserPacket(is_extended=True, ranges_mm=(1,), reflectances=(2,), flags_of_readings=(3,)),
    MapChangedPacket(raw_name=b"map"),
    PlaylistPacket(sound=Sound(number=1, toggle=1, raw_name=b"hello".ljust(16, b"\0"), offset=0, length=9)),
]


#: What stands on the wire though nobody has said it: a stick in its middle, five bytes a battery, no fix.
SAID_BY_NOBODY = {
    JoystickPacket: {3: 2, 5: 2},
    BatteryPacket: {1: 5},
    SimstatPacket: dict.fromkeys(range(40, 44), 0xFF),
}


@each_row("kind", sorted({type(packet) for packet in STRICT}, key=lambda kind: kind.__name__))
def test_a_packet_that_says_nothing_is_zero_on_the_wire(kind: type[ServerPacket]) -> None:
    if any(each.default is MISSING and each.default_factory is MISSING for each in fields(kind)):
        return  # it has to say something
    data = packet_frame(kind(), Profile.P2OS).payload[1:]
    assert {place: byte for place, byte in enumerate(data) if byte} == SAID_BY_NOBODY.get(kind, {})


@each_row("packet", STRICT, ids=lambda packet: type(packet).__name__)
def test_a_packet_cut_anywhere_is_raw(packet: ServerPacket) -> None:
    whole = packet_frame(packet, Profile.P2OS).payload
    for cut in range(1, len(whole)):
        assert read_packet(Frame(whole[:cut]), Profile.P2OS) == RawPacket(whole[0], whole[1:cut])
    assert read_packet(Frame(whole), Profile.P2OS) == packet


def test_a_compass_packet_comes_with_its_size_byte_or_without() -> None:
    whole = CompassPacket(raw_compass=900).to_frame().payload
    assert read_packet(Frame(whole[:1] + whole[2:]), Profile.P2OS) == CompassPacket(raw_compass=900, raw_size=None)
    for cut in range(1, len(whole) - 1):
        assert isinstance(read_packet(Frame(whole[:cut]), Profile.P2OS), RawPacket)


def test_an_identity_without_its_three_strings_is_raw() -> None:
    assert read_packet(Frame(b"\x02Wilma\0Pioneer\0"), Profile.P2OS) == RawPacket(2, b"Wilma\0Pioneer\0")


@each_row(
    "make",
    [
        lambda: EncoderPacket(left_counts=2**31, right_counts=0).to_frame(),
        lambda: GyroPacket(readings=(GyroReading(raw_rate=1, raw_temperature=1),) * 90).to_frame(),
        lambda: ArmPacket(positions=(1,)).to_frame(),
        lambda: ArmInfoPacket(raw_version=b"1\0").to_frame(),
        lambda: BatteryPacket(batteries=((1,),)).to_frame(),
        lambda: SerauxPacket(port=4),
        lambda: SerauxPacket(data=bytes(202)).to_frame(),
        lambda: ResetNotice(kind=1).to_frame(),
        lambda: SimstatPacket(raw_name=b"\0").to_frame(),
        lambda: SiminfoPacket(devices=(SimDevice(raw_name=b"\0", raw_type=b"", number=0, status=0),)).to_frame(),
        lambda: SimLaserPacket(is_extended=True, ranges_mm=(1,)).to_frame(),
        lambda: MapChangedPacket(raw_name=b"a\0").to_frame(),
    ],
)
def test_what_does_not_fit_is_refused(make: Callable[[], object]) -> None:
    with pytest.raises(LocalProtocolError):
        make()


def test_a_reset_notice_is_read_from_its_own_types_only() -> None:
    with pytest.raises(RemoteProtocolError):
        ResetNotice.from_frame(Frame(b"\x32"))


def test_raw_values_have_their_units_beside_them() -> None:
    compass = CompassPacket(raw_compass=1800, raw_pitch=50, raw_roll=-30, raw_x=2000, raw_y=-1500, raw_z=4000,
                            raw_temperature=225)  # fmt: skip
    assert (compass.heading_deg, compass.pitch_deg, compass.roll_deg, compass.temperature_c) == (180, 5, -3, 22.5)
    assert compass.field_ut == (20, -15, 40)
    assert IoPacket(raw_analog=(0, 1023)).analog_v == (0, 5)
    # ARIA: 5 V are 1023 counts, and 2.5 V are 300 deg/s.
    assert GyroReading(raw_rate=1023, raw_temperature=0).rate_deg_s(0, scaler=1) == pytest.approx(-600)
    assert GyroReading(raw_rate=600, raw_temperature=0).rate_deg_s() < 0
    assert GripperPacket(state=0b1000_0001).flags == GripperState.GRIPPER_MOVING | GripperState.PADDLES_NOT_OPEN
    assert PlaylistPacket(sound=Sound(number=1, toggle=1, raw_name=b"hello".ljust(16, b"\0"), offset=0, length=9)).sound
    assert Sound(number=1, toggle=1, raw_name=b"hello".ljust(16, b"\0"), offset=0, length=9).name == "hello"
    assert ArmInfoPacket(raw_version=b"1.2").version == "1.2"
    assert BatteryPacket(batteries=((0, 0, 0, 88, 77),)).relative_charge(0) == 88
    assert BatteryPacket(batteries=((0, 0),), row_bytes=2).relative_charge(0) is None
