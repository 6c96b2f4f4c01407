"""Commands and packets: two-way for every row, tolerant of what clients really send."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.errors import LocalProtocolError, RemoteProtocolError
from p2os.protocol import commands
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.config_packet import FIELDS, P2OS_FIELDS, ConfigPacket
from p2os.protocol.frames import Frame
from p2os.protocol.packets import Identity, RawPacket, packet_frame, read_packet
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import TAIL, SonarReading, StandardSip
from tests.p2os.protocol.drawn_packets import SEEDS, Draw, pairs_of_bytes, sip
from tests.tools.each_row import each_row

GOLDEN = Path(__file__).parents[2] / "golden"
VECTORS = json.loads((GOLDEN / "p2os_vectors.json").read_text(encoding="utf-8"))
VECTORS = VECTORS["vectors"] if isinstance(VECTORS, dict) else VECTORS
VALID = [vector for vector in VECTORS if vector["valid"]]
TO_ROBOT = [vector for vector in VALID if vector["decoded"]["direction"].startswith("client")]
FROM_ROBOT = [vector for vector in VALID if vector["decoded"]["direction"].startswith("robot")]
#: Frames that real clients send and that we read but never write.
ONLY_READ = {"seto_player_truncated", "tty2_RS_cr_aria_comStr"}

arguments = st.one_of(st.none(), st.integers(-0xFFFF, 0xFFFF), st.binary(max_size=199))


@each_row("vector", TO_ROBOT, ids=lambda vector: vector["name"])
def test_a_command_vector_reads_and_writes(vector: dict) -> None:
    frame = Frame.from_bytes(bytes.fromhex(vector["hex"]))
    command, said = Command.from_frame(frame), vector["decoded"]
    assert command.number == said["command"]
    if isinstance(said.get("arg"), int):
        assert (
            command.integer == said["arg"] or command.two_bytes[0] | command.two_bytes[1] << 8 == said["arg"] & 0xFFFF
        )
    if vector["name"] not in ONLY_READ:
        assert command.to_frame() == frame


@each_row("vector", FROM_ROBOT, ids=lambda vector: vector["name"])
def test_a_packet_vector_reads_and_writes(vector: dict) -> None:
    frame, said = Frame.from_bytes(bytes.fromhex(vector["hex"])), vector["decoded"]
    packet = Identity.from_frame(frame) if frame.kind == 2 else read_packet(frame, Profile.P2OS)
    assert packet_frame(packet, Profile.P2OS) == frame
    if isinstance(packet, StandardSip):
        assert (packet.raw_x, packet.raw_heading, packet.moving) == (said["x_raw"], said["th_raw"], said["moving"])
        assert packet.raw_battery == round(said["battery_V"] * 10)
        assert [[s.number, s.raw_range] for s in packet.sonar] == said["sonar"]
        assert (packet.digital_in, packet.digital_out) == (said["digin"], said["digout"])
    elif isinstance(packet, ConfigPacket):
        shared = {name: said[name] for name, _ in FIELDS if name in said}
        assert {name: getattr(packet, name) for name in shared} == shared
        assert packet.fields_sent == P2OS_FIELDS


def test_the_arcos_tail_reads_by_name() -> None:
    vector = next(vector for vector in VALID if vector["name"] == "sip_arcos_ext")
    sip = StandardSip.from_frame(Frame.from_bytes(bytes.fromhex(vector["hex"])), Profile.ARCOS)
    assert sip.tail_field("raw_battery_x10") == 126
    assert sip.tail_field("raw_rotation_velocity") == -150
    assert sip.tail_field("raw_temperature") == -127
    assert sip.tail_field("controller_time_us") is None


@given(st.integers(0, 255), arguments)
def test_a_command_survives_the_wire(number: int, argument: int | bytes | None) -> None:
    command = Command(number, argument)
    assert Command.from_frame(command.to_frame()) == command
    assert command.name


@given(st.integers(0, 255), st.binary(max_size=201))
def test_any_frame_reads_as_some_command(number: int, data: bytes) -> None:
    command = Command.from_frame(Frame(bytes((number,)) + data))
    assert command.number == number
    command.to_frame()


@pytest.mark.parametrize(("number", "argument"), [(256, None), (-1, None), (11, 0x10000), (42, bytes(200))])
def test_a_command_that_does_not_fit_is_refused(number: int, argument: int | bytes | None) -> None:
    with pytest.raises(LocalProtocolError):
        Command(number, argument)


def test_vel2_survives_the_sign_trap() -> None:
    for left, right in pairs_of_bytes(-128, 127):
        command = Command.from_frame(commands.vel2(left, right).to_frame())
        assert command.signed_bytes == (right, left)
        as_player_sends_it = Command(CommandNumber.VEL2, (left & 0xFF) << 8 | right & 0xFF)
        assert as_player_sends_it.signed_bytes == (right, left)


def test_two_bytes_travel_as_a_negative_integer_when_the_high_bit_is_set() -> None:
    digout = Command.from_frame(Frame.from_bytes(bytes.fromhex("fafb061e1bab00c91b")))
    assert digout.two_bytes == (0x55, 0xFF)


def test_what_has_no_integer_has_no_two_bytes() -> None:
    with pytest.raises(LocalProtocolError):
        _ = commands.stop().two_bytes
    with pytest.raises(LocalProtocolError):
        commands.vel2(128, 0)
    assert Command(CommandNumber.TTY2, b"x").integer is None


def test_the_small_constructors_say_what_they_mean() -> None:
    assert [c.to_frame().payload.hex() for c in (
        commands.pulse(), commands.enable(True), commands.stop(), commands.vel(-200), commands.rvel(10),
        commands.sonar(False), commands.set_origin(),
    )] == ["00", "043b0100", "1d", "0b1bc800", "153b0a00", "1c3b0000", "07"]  # fmt: skip


@given(SEEDS)
def test_a_sip_survives_the_wire(seed: int) -> None:
    whole = sip(Draw(seed), most_readings=32)
    for profile in Profile:
        assert StandardSip.from_frame(whole.to_frame(profile), profile) == whole


@given(SEEDS)
def test_a_tail_of_any_length_survives(seed: int) -> None:
    for fields in range(len(TAIL) + 1):
        whole = sip(Draw(seed), fields=fields, most_readings=32)
        assert StandardSip.from_frame(whole.to_frame(Profile.ARCOS), Profile.ARCOS) == whole


def test_gripper_and_analog_port_change_places_with_the_firmware() -> None:
    sip = StandardSip(analog_port=5, gripper_state=9)
    assert sip.to_frame(Profile.P2OS).payload[20:22] == b"\x05\x09"
    assert sip.to_frame(Profile.AROS).payload[20:22] == b"\x09\x05"
    assert [profile.has_flags for profile in Profile] == [False, True, True]
    assert StandardSip(raw_flags=1).motors_enabled


@pytest.mark.parametrize("change", [{"raw_x": 65536}, {"raw_heading": 40000}, {"tail": (70000,)}])
def test_a_sip_that_does_not_fit_is_refused(change: dict) -> None:
    with pytest.raises(LocalProtocolError):
        StandardSip(**change).to_frame(Profile.P2OS)


def test_a_sip_cut_anywhere_is_raw_and_never_lost() -> None:
    whole = StandardSip(sonar=(SonarReading(1, 2),)).to_frame(Profile.P2OS).payload
    for cut in range(1, len(whole)):
        assert read_packet(Frame(whole[:cut]), Profile.P2OS) == RawPacket(0x32, whole[1:cut])
        with pytest.raises(RemoteProtocolError):
            StandardSip.from_frame(Frame(whole[:cut]), Profile.P2OS)


texts = st.text(st.characters(min_codepoint=1, max_codepoint=255), max_size=10)


@given(texts, texts, texts)
def test_an_identity_survives_the_wire(name: str, robot_class: str, subclass: str) -> None:
    identity = Identity(name, robot_class, subclass)
    assert Identity.from_frame(identity.to_frame()) == identity


def test_an_identity_with_missing_strings_has_empty_ones() -> None:
    assert Identity.from_frame(Frame(b"\x02Wilma")) == Identity("Wilma", "", "")


@given(texts, st.integers(0, 255), st.integers(0, 0xFFFF), st.integers(-0x8000, 0x7FFF), st.integers(0, 2**32 - 1))
def test_a_config_survives_the_wire(text: str, byte: int, word: int, signed: int, flags: int) -> None:
    packet = ConfigPacket(
        subclass=text, firmware_version=text, sipcycle=byte, watchdog=word, driftfactor=signed, configflags=flags,
        gyrofw=signed, fields_sent=len(FIELDS),
    )  # fmt: skip
    assert ConfigPacket.from_frame(packet.to_frame()) == packet


def test_a_config_cut_anywhere_has_the_fields_that_were_sent() -> None:
    packet = ConfigPacket(subclass="p2dx", watchdog=2000, transki=4)
    whole = packet.to_frame().payload
    for cut in range(1, len(whole)):
        part = ConfigPacket.from_frame(Frame(whole[:cut]))
        assert part.fields_sent < P2OS_FIELDS
    assert ConfigPacket.from_frame(Frame(whole)) == packet


@pytest.mark.parametrize("change", [{"watchdog": 65536}, {"name": "€"}, {"name": "x" * 300}])
def test_a_config_that_does_not_fit_is_refused(change: dict) -> None:
    with pytest.raises(LocalProtocolError):
        ConfigPacket(**change).to_frame()


@given(st.integers(3, 255), st.binary(max_size=100))
def test_an_unknown_packet_comes_through_raw(kind: int, data: bytes) -> None:
    packet = read_packet(Frame(bytes((kind,)) + data), Profile.P2OS)
    assert packet_frame(RawPacket(kind, data), Profile.P2OS) == Frame(bytes((kind,)) + data)
    assert packet is not None
