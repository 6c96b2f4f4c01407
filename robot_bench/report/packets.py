"""P2OS bytes of a recording as a person reads them: name and meaning of each frame."""

from dataclasses import fields

from p2os.protocol.command_table import SYNC_NAMES
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.packets import Identity, RawPacket, packet_name, read_packet
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import StandardSip
from robot_bench.events.kinds import Packet

#: The numbers that mean something else until the session is open.
SYNCS = {number: (sync, f"{sync} / {CommandNumber(number).name}") for number, sync in enumerate(SYNC_NAMES)}


def describe(chunk: Packet) -> list[tuple[str, str]]:
    """Return (name, meaning) of each frame in a chunk, and of what is no frame.

    A recording holds whole frames a chunk; what a fault has cut is shown as noise.
    """
    decoder = Decoder()
    decoder.receive(chunk.data, 0)
    decoder.advance_to(decoder.next_deadline() or 0)
    found = []
    while (item := decoder.next_item()) is not None:
        if not isinstance(item, Frame):
            found.append((type(item).__name__, ""))
        elif chunk.direction == "c2r":
            found.append(_command(item))
        else:
            found.append(_packet(item))
    return found


def _command(frame: Frame) -> tuple[str, str]:
    command = Command.from_frame(frame)
    if command.number in SYNCS and not frame.data:
        return SYNCS[command.number][1], ""
    argument = command.argument
    return command.name, repr(argument) if isinstance(argument, bytes) else "" if argument is None else str(argument)


def _packet(frame: Frame) -> tuple[str, str]:
    if frame.kind in SYNCS and not frame.data:
        return SYNCS[frame.kind][0], "echo"
    packet = Identity.from_frame(frame) if frame.kind == 2 else read_packet(frame, Profile.P2OS)
    match packet:
        case Identity():
            return "identity", f"{packet.name!r} {packet.robot_class} {packet.subclass}"
        case StandardSip():
            stalls = " stall" * (packet.stall_left or packet.stall_right)
            echoes = " ".join(f"{echo.number}:{echo.raw_range}" for echo in packet.sonar)
            place = f"x {packet.raw_x} y {packet.raw_y} th {packet.raw_heading}"
            speeds = f"{packet.raw_left_velocity}/{packet.raw_right_velocity} mm/s"
            return packet_name(frame.kind), f"{place}, {speeds}{stalls}, sonar {echoes}"
        case ConfigPacket():
            return packet_name(frame.kind), f"{packet.subclass}, watchdog {packet.watchdog} ms"
        case RawPacket():
            return packet_name(packet.kind), f"{len(packet.data)} bytes"
        case _:
            values = ((part.name, getattr(packet, part.name)) for part in fields(packet))
            return type(packet).__name__, ", ".join(f"{name} {value}" for name, value in values if value != b"")
