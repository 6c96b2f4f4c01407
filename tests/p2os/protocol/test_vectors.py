"""Every value that the golden vectors state, field by field; the bytes themselves are tried in `test_messages`."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from p2os.protocol.commands import NEGATIVE, POSITIVE, STRING, Command, command_row
from p2os.protocol.config_packet import FIELDS, ConfigPacket
from p2os.protocol.frames import Frame
from p2os.protocol.packets import (
    CompassPacket,
    EncoderPacket,
    GripperPacket,
    GyroPacket,
    Identity,
    IoPacket,
    JoystickPacket,
    PlaylistPacket,
    SerauxPacket,
    ServerPacket,
    StandardSip,
    read_packet,
)
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import POSITION_MASK, TAIL
from p2os.protocol.units import battery_v, range_m
from p2os.robots.parameters import load_parameters
from tests.tools.each_row import each_row

VECTORS = [
    vector
    for vector in json.loads((Path(__file__).parents[2] / "golden" / "p2os_vectors.json").read_text(encoding="utf-8"))
    if vector["valid"]
]
#: What says nothing of the frame's inside.
PROSE = {"direction", "length", "note", "command_name"}
ARGUMENT_TYPES = {None: None, "int": POSITIVE, "nint": NEGATIVE, "str": STRING}
P2DX = load_parameters("p2dx")
VEL2_DIVISOR = P2DX.vel2_divisor


def sip_values(sip: StandardSip) -> dict[str, Any]:
    tail = b"".join(
        value.to_bytes(size, "little", signed=signed)
        for value, (_, size, signed) in zip(sip.tail, TAIL, strict=False)
    )  # fmt: skip
    return {
        "type": sip.kind, "moving": sip.moving, "x_raw": sip.raw_x, "y_raw": sip.raw_y, "th_raw": sip.raw_heading,
        "x_15bit": sip.raw_x & POSITION_MASK, "y_15bit": sip.raw_y & POSITION_MASK, "lvel": sip.raw_left_velocity,
        "rvel": sip.raw_right_velocity, "battery_V": battery_v(sip.raw_battery), "control_raw": sip.raw_control,
        "stall_word": sip.rear_bumpers << 1 | sip.stall_left | (sip.front_bumpers << 1 | sip.stall_right) << 8,
        "stall_left": sip.stall_left, "stall_right": sip.stall_right, "rear_bumpers": sip.rear_bumpers,
        "front_bumpers": sip.front_bumpers, "flags": sip.raw_flags, "compass_raw": sip.raw_compass,
        "sonar": [[reading.number, reading.raw_range] for reading in sip.sonar],
        "sonar_mm": [[one.number, round(range_m(one.raw_range, P2DX) * 1000)] for one in sip.sonar],
        "timer": sip.analog_port | sip.gripper_state << 8, "anport": sip.analog_port, "grip_state": sip.gripper_state,
        "analog": sip.raw_analog, "digin": sip.digital_in, "digout": sip.digital_out, "ext_hex": tail.hex(),
    }  # fmt: skip


#: Packet → its values by the vectors' names.
VALUES: dict[type, Callable[[Any], dict[str, Any]]] = {
    StandardSip: sip_values,
    Identity: lambda packet: {"name": packet.name, "robot_class": packet.robot_class, "subclass": packet.subclass},
    ConfigPacket: lambda packet: {name: getattr(packet, name) for name, _ in FIELDS},
    EncoderPacket: lambda packet: {"left": packet.left_counts, "right": packet.right_counts},
    IoPacket: lambda packet: {
        "digin": list(packet.digital_in), "digout": list(packet.digital_out), "analog": list(packet.raw_analog)},
    SerauxPacket: lambda packet: {"data": packet.data.hex()},
    GyroPacket: lambda packet: {"readings": [[found.raw_rate, found.raw_temperature] for found in packet.readings]},
    GripperPacket: lambda packet: {
        "gripper_type": packet.gripper_type, "state": packet.state, "grasp_time": packet.grasp_time},
    JoystickPacket: lambda packet: {
        "button1": packet.button1, "button2": packet.button2, "x": packet.raw_x, "y": packet.raw_y,
        "throttle": packet.raw_throttle},
    PlaylistPacket: lambda _: {},
    CompassPacket: lambda packet: {
        "n": packet.raw_size, "compass_deg": packet.heading_deg, "pitch": packet.pitch_deg, "roll": packet.roll_deg},
}  # fmt: skip


@each_row("vector", [v for v in VECTORS if "type" in v["decoded"]], ids=lambda vector: vector["name"])
def test_a_packet_says_all_that_its_vector_states(vector: dict) -> None:
    stated = {name: value for name, value in vector["decoded"].items() if name not in PROSE}
    frame = Frame.from_bytes(bytes.fromhex(vector["hex"]))
    packet: ServerPacket = read_packet(frame, Profile.P2OS)
    values = {"type": frame.kind, **VALUES[type(packet)](packet)}
    assert {name: values[name] for name in stated} == stated


@each_row("vector", [v for v in VECTORS if "arg_type" in v["decoded"]], ids=lambda vector: vector["name"])
def test_a_command_says_all_that_its_vector_states(vector: dict) -> None:
    stated = vector["decoded"]
    frame = Frame.from_bytes(bytes.fromhex(vector["hex"]))
    command, argument = Command.from_frame(frame), stated["arg"]
    assert command.number == stated["command"]
    assert (frame.data[0] if frame.data else None) == ARGUMENT_TYPES[stated["arg_type"]]
    if isinstance(argument, dict) and "port" in argument:
        width, port = command.two_bytes
        assert argument == {"port": port, "width": width}
    elif isinstance(argument, dict):
        right, left = (raw * VEL2_DIVISOR for raw in command.signed_bytes)
        assert argument == {"right_mm_s": right, "left_mm_s": left}
    elif isinstance(argument, str):
        assert command.argument in {argument.encode("latin-1"), bytes.fromhex(argument) if argument.isalnum() else b""}
    elif isinstance(argument, list):
        # The manual's example of DIGOUT takes 1B for "absolute"; we read it as the sign that ARIA means by it.
        whole = Command(command.number, abs(command.integer or 0))
        assert bytes(argument) in {command.argument, bytes(whole.two_bytes)}
    else:
        assert command.argument == argument


@each_row("vector", [v for v in VECTORS if "command_name" in v["decoded"]], ids=lambda vector: vector["name"])
def test_a_command_has_the_number_that_its_vector_names(vector: dict) -> None:
    stated = vector["decoded"]
    for name in stated["command_name"].split("/"):
        assert command_row(name).number == stated["command"]
