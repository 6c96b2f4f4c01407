"""Write the tables of PROTOCOL.md from the code's own: commands, packets, numbers, robots.

What stands between `<!-- table: NAME -->` and `<!-- end -->` is generated; a test
holds the committed page to what comes out here.
Usage: python tools/generate_protocol.py
"""

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from construct import Array, Bytes, Construct, FormatField, NullTerminated, Renamed, Struct

from p2os.protocol import sip
from p2os.protocol.commands import MAX_STRING_BYTES, NEGATIVE, POSITIVE, ROWS, STRING, Command, command, vel2
from p2os.protocol.config_packet import (
    AMRISIM_FIELDS,
    AROS_1_6_FIELDS,
    AROS_1_7_FIELDS,
    AROS_1_8_FIELDS,
    FIELDS,
    P2OS_FIELDS,
)
from p2os.protocol.frames import GIVE_UP_NS, HEADER, MAX_COUNT, MAX_PAYLOAD_BYTES, MIN_COUNT, Frame
from p2os.protocol.odometry import POSITION_MODULUS
from p2os.protocol.packets import (
    PACKET_NAMES,
    READERS,
    ArmInfoPacket,
    ArmPacket,
    BatteryPacket,
    CompassPacket,
    EncoderPacket,
    GripperPacket,
    GripperState,
    GyroPacket,
    IoPacket,
    JoystickPacket,
    MapChangedPacket,
    PlaylistPacket,
    SerauxPacket,
    SiminfoPacket,
    SimLaserPacket,
    SimstatPacket,
)
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import known_robots, load_parameters
from simbase.timing import NS_PER_MS

PAGE = Path(__file__).resolve().parent.parent / "PROTOCOL.md"
BLOCK = re.compile(r"(<!-- table: (?P<name>[a-z ]+) -->\n)(?P<body>.*?)(<!-- end -->)", re.DOTALL)

#: Packet → its layout and what its fields mean beyond their names.
PACKETS: Mapping[str, tuple[tuple[int, ...], Construct, Mapping[str, str]]] = {
    "ENCODERpac": ((EncoderPacket.KIND,), EncoderPacket.LAYOUT, {
        "left_counts": "left wheel's encoder since power-on", "right_counts": "right wheel's"}),
    "GYROpac": ((GyroPacket.KIND,), GyroPacket.LAYOUT, {
        "count": "readings that follow, 25 ms apart, oldest first", "raw_rate": "0 to 1023, about 512 at rest, less is "
        "counter-clockwise", "raw_temperature": "uncalibrated"}),
    "TCM2pac": ((CompassPacket.KIND,), CompassPacket.LAYOUT, {
        "raw_size": "23 in the manual, which counts more than follows; not seen on a wire, so a packet of 20 bytes "
        "is read without it", "raw_compass": "0.1°", "raw_pitch": "0.1°", "raw_roll": "0.1°", "raw_x": "0.01 µT",
        "raw_y": "0.01 µT", "raw_z": "0.01 µT", "raw_temperature": "0.1 °C", "error_bits": "bits",
        "h_score": "of a calibration", "v_score": "of a calibration", "raw_m_score": "of a calibration, 0.01"}),
    "IOpac": ((IoPacket.KIND,), IoPacket.LAYOUT, {
        "input_count": "4 on ARCOS", "digital_in": "DIGIN, front bumpers, rear bumpers, infra-red (order not seen on a "
        "wire); bumpers raw, low is pressed", "output_count": "1 on ARCOS", "digital_out": "as in the SIP",
        "analog_count": "9 on ARCOS", "raw_analog": "0 to 1023 for 0 to 5 V; the last is the battery"}),
    "GRIPPERpac": ((GripperPacket.KIND,), GripperPacket.LAYOUT, {
        "gripper_type": "0 none, 1 on the user I/O, 2 on the general I/O", "state": "bits: " + ", ".join(
            f"{bit.value.bit_length() - 1} {(bit.name or '').lower().replace('_', ' ')}" for bit in GripperState),
        "grasp_time": "in the robot's own units"}),
    "JOYSTICKpac": ((JoystickPacket.KIND,), JoystickPacket.LAYOUT, {
        "button1": "1 pressed", "button2": "1 pressed", "raw_x": "0 to 1023, 512 in the middle", "raw_y": "as x",
        "raw_throttle": "0 to 1023"}),
    "PLAYLISTpac": ((PlaylistPacket.KIND,), PlaylistPacket.LAYOUT, {
        "number": "what SOUND plays it by", "toggle": "as the robot says it", "raw_name": "NUL at the end unless all "
        "are used; `~` marks a group", "offset": "in the robot's memory", "length": "bytes"}),
    "ARMpac": ((ArmPacket.KIND,), ArmPacket.LAYOUT, {
        "status": "bit 0 power, bit 1 connected", "moving": "a bit a joint, joint 1 in bit 0",
        "positions": "servo counts of joints 1 to 6"}),
    "ARMINFOpac": ((ArmInfoPacket.KIND,), ArmInfoPacket.LAYOUT, {
        "raw_version": "the arm's firmware", "count": "joints that follow", "speed": "set speed", "home": "position",
        "least": "position", "centre": "position", "most": "position", "ticks_per_90": "counts of 90°"}),
    "BATTERYpac": ((BatteryPacket.KIND,), BatteryPacket.LAYOUT, {
        "count": "batteries", "row_bytes": "bytes of each", "batteries": "flags 1, 2, 3, relative and absolute charge "
        "in percent, where there are five"}),
    "SIMSTAT": ((SimstatPacket.KIND,), SimstatPacket.LAYOUT, {
        "raw_name": "of the simulator", "raw_version": "of it", "flags": "bit 1 the map has a geographic origin, bit 2 "
        "the odometry has errors", "wanted_interval_ms": "ms", "real_interval_ms": "ms",
        "last_interval_ms": "ms", "x_mm": "true position", "y_mm": "true position", "z_mm": "true position",
        "heading_deg": "true heading", "raw_latitude": "1e-7°", "raw_longitude": "1e-7°", "altitude_cm": "cm",
        "raw_precision": "100 times the dilution of precision; 0 a bad fix, −1 none", "raw_error_x": "1e-7",
        "raw_error_y": "1e-7", "raw_error_heading": "1e-7"}),
    "SIMINFO": ((SiminfoPacket.KIND,), SiminfoPacket.LAYOUT, {
        "raw_name": "of the simulator or device", "raw_version": "of it",
        "flags": "bit 0 it has a window, bit 1 it was restarted after a crash", "count": "devices that follow",
        "raw_type": "of the device", "number": "of its type",
        "status": "as the simulator says it"}),
    "SIMLASER": ((SimLaserPacket.KINDS[0],), SimLaserPacket.LAYOUT, {
        "raw_pose": "x, y (mm), heading (°)", "total": "readings of the whole sweep", "first": "number of the first "
        "reading here", "count": "readings that follow", "ranges_mm": "mm"}),
    "SIMLASER2": ((SimLaserPacket.KINDS[1],), SimLaserPacket.EXTENDED_LAYOUT, {
        "total": "readings of the whole sweep", "first": "number of the first reading here",
        "count": "readings that follow", "range_mm": "mm", "reflectance": "0 none", "flags": "reserved; at the end: "
        "bit 0 the robot has moved since", "laser": "which one"}),
    "SIMMAPCHANGED": ((MapChangedPacket.KIND,), MapChangedPacket.LAYOUT, {
        "by_user": "1 a person did it, 0 a client", "status": "negative where it failed", "raw_name": "its file"}),
}  # fmt: skip

SIP_NOTES = {
    "raw_x": f"counts of DistConvFactor, {POSITION_MODULUS.bit_length() - 1} bits; bit 15 is masked", "raw_y": "as x",
    "raw_heading": "4096 counts a turn, + counter-clockwise", "raw_left_velocity": "VelConvFactor mm/s",
    "raw_right_velocity": "VelConvFactor mm/s", "raw_battery": "0.1 V",
    "left": "bit 0 the left wheel has stalled, bits 1 to 7 the **rear** bumper's segments",
    "right": "bit 0 the right wheel has stalled, bits 1 to 7 the **front** bumper's segments",
    "raw_control": "heading set-point, as the heading", "raw_flags": "P2OS: pulse width of servo 1. AROS, ARCOS: bit 0 "
    "motors enabled, 1 to 4 sonar arrays on, 5 stop button, 6 stall by it, 7 far and 8 near ledge, 9 joystick button, "
    "10 charger has power", "raw_compass": "2° units", "count": "new sonar readings that follow, n",
    "number": "sonar, from 0", "raw_range": "counts of RangeConvFactor",
    "first": "P2OS: analog port. AROS, ARCOS: gripper", "second": "P2OS: gripper. AROS, ARCOS: analog port",
    "raw_analog": "0 to 255 for 0 to 5 V",
    "digital_in": "a bit an input", "digital_out": "a bit an output. **A P2OS or AROS SIP ends here**",
}  # fmt: skip
TAIL_NOTES = {
    "raw_battery_x10": "0.1 V", "charge_state": "−1 unknown, 0 none, 1 bulk, 2 overcharge, 3 float, 4 balance",
    "raw_rotation_velocity": "0.1 °/s", "fault_flags": "bits", "raw_lateral_velocity": "mm/s",
    "raw_temperature": "°C, −127 none", "state_of_charge": "percent", "controller_time_us": "µs (Pioneer LX)",
    "raw_flags3": "more flags (Pioneer LX)",
}  # fmt: skip
CONFIG_NOTES = {
    "robot_class": "`Pioneer`", "subclass": "the model, such as `p2dx`", "serial": "`SIM` in a simulator",
    "four_motors": "1 on an AT with P2OS", "rotveltop": "°/s", "transveltop": "mm/s", "rotacctop": "°/s²",
    "transacctop": "mm/s²", "pwmmax": "500 is full", "name": "of the robot", "sipcycle": "ms",
    "hostbaud": "as HOSTBAUD", "auxbaud": "as HOSTBAUD", "rearsonar": "one byte, unlike the front's",
    "lowbattery": "0.1 V", "revcount": "counts a turn of the robot", "watchdog": "ms", "p2mpacs": "1: another SIP that "
    "nobody has described", "stallcount": "ms", "joyvel": "mm/s", "joyrvel": "°/s",
    "rotvelmax": "°/s", "transvelmax": "mm/s", "rotacc": "°/s²", "rotdecel": "°/s²", "transacc": "mm/s²",
    "transdecel": "mm/s²", "frontbumps": "segments", "rearbumps": "segments", "charger": "1 P3, 2 PowerBot",
    "sonarcycle": "ms", "autobaud": "1: HOSTBAUD works, 2: raise it by itself", "hasgyro": "1: GYROpac, 2: used inside",
    "aux2baud": "as HOSTBAUD", "aux3baud": "as HOSTBAUD", "ticksmm": "counts a mm",
    "shutdownvolts": "0.1 V", "kinematicsdelay": "ms", "latveltop": "mm/s", "latacctop": "mm/s²", "latvelmax": "mm/s",
    "latacc": "mm/s²", "latdecel": "mm/s²", "hightemp": "°C, −128 none", "batterytype": "2: state of charge",
}  # fmt: skip
ENDS = {
    P2OS_FIELDS: "P2OS, AROS before 1.6", AROS_1_6_FIELDS: "AROS 1.6", AROS_1_7_FIELDS: "AROS 1.7",
    AROS_1_8_FIELDS: "AROS 1.8", AMRISIM_FIELDS: "AMRISim", len(FIELDS): "ARCOS",
}  # fmt: skip


def table(head: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table of Markdown."""
    titles = list(head)
    lines = [titles, ["---"] * len(titles), *rows]
    return "".join("| " + " | ".join(str(cell) for cell in line) + " |\n" for line in lines)


def bare(construct: Construct) -> Construct:
    """Return what stands behind a name."""
    return bare(construct.subcon) if isinstance(construct, Renamed) else construct


def type_of(construct: Construct) -> tuple[str, str]:
    """Return a field's size and type, in words."""
    if isinstance(construct, FormatField):
        sign = "signed" if construct.fmtstr[-1].islower() else "unsigned"
        return str(construct.sizeof()), sign
    if isinstance(construct, NullTerminated):
        return "text, NUL", "text"
    if isinstance(construct, Bytes):
        return str(construct.sizeof()), "bytes"
    raise TypeError(f"no words for {construct}")


def layout_rows(layout: Struct, notes: Mapping[str, str], place: int = 1, behind: str = "") -> list[tuple[str, ...]]:
    """Return the rows of a layout: offset from the type byte, size, name, meaning; every field has a meaning."""
    rows = []
    for sub in layout.subcons:
        construct, times, name, number = bare(sub), "", str(sub.name), 1
        while isinstance(construct, Array):
            # A count is a number, or the path of a field before.
            number = construct.count if isinstance(construct.count, int) else 0
            count = number or f"`{re.findall(r'[a-z_]+', str(construct.count))[-1]}`"
            times, construct = f"{times}{count} × ", bare(construct.subcon)
        if isinstance(construct, Struct):
            inner = [(str(item.name), *type_of(bare(item))) for item in construct.subcons]
            what = "; ".join(f"`{item}` {size} ({sign}): {notes[item]}" for item, size, sign in inner)
            rows.append((f"{place}{behind}", f"{times}({' + '.join(size for _, size, _ in inner)})", f"`{name}`", what))
        else:
            size, sign = type_of(construct)
            rows.append((f"{place}{behind}", f"{times}{size}", f"`{name}`", f"{sign}; {notes[name]}"))
        if not number or isinstance(construct, NullTerminated):
            behind += f" + `{name}`"
        else:
            place += number * construct.sizeof()
    return rows


HEAD = ("offset", "bytes", "field", "meaning")


def packets() -> str:
    """Return a section a packet."""
    parts = []
    for name, (kinds, layout, notes) in PACKETS.items():
        kind = ", ".join(f"`{kind:02X}`" for kind in kinds)
        parts.append(f"**{name}**, type {kind}\n\n" + table(HEAD, layout_rows(layout, notes)))
    return "\n".join(parts)


def packet_types() -> str:
    """Return every type that has a name."""
    found: dict[str, list[int]] = {}
    for kind, name in PACKET_NAMES.items():
        found.setdefault(name, []).append(kind)
    read = {*READERS, *sip.SIP_KINDS, 0x00, 0x01, 0x02}
    rows = []
    for name, kinds in found.items():
        shown = ", ".join(f"`{kind:02X}`" for kind in kinds)
        rows.append((shown, name, "every field" if set(kinds) <= read else "raw: nobody has published its layout"))
    return table(("type", "name", "read here"), rows)


def commands() -> str:
    """Return every client command."""
    rows = []
    for row in ROWS:
        versions = (row.version(profile) for profile in Profile)
        rows.append((int(row.number), row.name, row.takes, *versions, row.meaning))
    return table(("#", "name", "takes", *(profile.value for profile in Profile), "meaning"), rows)


def config() -> str:
    """Return the fields of a CONFIGpac and where each firmware stops."""
    rows = []
    for number, (name, kind) in enumerate(FIELDS, 1):
        size, sign = type_of(bare(kind))
        rows.append(
            (number, size, f"`{name}`", "; ".join(filter(None, (sign, CONFIG_NOTES.get(name)))), ENDS.get(number, ""))
        )
    return table(("#", "bytes", "field", "meaning", "ends here"), rows)


def tail() -> str:
    """Return the ARCOS tail of a SIP."""
    rows, place = [], 0
    for name, size, signed in sip.TAIL:
        rows.append((f"+{place}", size, f"`{name}`", f"{'signed' if signed else 'unsigned'}; {TAIL_NOTES[name]}"))
        place += size
    return table(HEAD, rows)


def numbers() -> str:
    """Return the numbers of the wire."""
    rows = [
        ("header", f"`{HEADER.hex(' ').upper()}`"),
        ("smallest count", MIN_COUNT),
        ("largest count", f"{MAX_COUNT}: {MAX_COUNT + 3} bytes in all, {MAX_PAYLOAD_BYTES} of payload"),
        ("longest string of a command", f"{MAX_STRING_BYTES} bytes"),
        ("argument types", f"`{POSITIVE:02X}` integer, `{NEGATIVE:02X}` negative integer, `{STRING:02X}` string"),
        ("silence after which a frame is given up", f"{GIVE_UP_NS // NS_PER_MS} ms"),
        ("positions", f"modulo {POSITION_MODULUS} ({POSITION_MODULUS.bit_length() - 1} bits)"),
        ("positions as player and ROS read them", "modulo 4096"),
        ("packet types of a standard SIP", ", ".join(f"`{kind:02X}`" for kind in sip.SIP_KINDS)),
        ("of these", f"`{sip.STANDING:02X}` standing, `{sip.MOVING:02X}` moving"),
        ("packet types of AUX bytes", ", ".join(f"`{kind:02X}`" for kind in SerauxPacket.KINDS.values())),
    ]  # fmt: skip
    return table(("what", "value"), rows)


def examples() -> str:
    """Return some frames."""
    shown: list[tuple[str, Frame]] = [
        ("SYNC0, PULSE", Command(0).to_frame()), ("SYNC1, OPEN", Command(1).to_frame()),
        ("SYNC2, CLOSE", Command(2).to_frame()), ("ENABLE 1", command("ENABLE", 1).to_frame()),
        ("VEL 200", command("VEL", 200).to_frame()), ("VEL −200", command("VEL", -200).to_frame()),
        ("VEL2, both wheels 10", vel2(10, 10).to_frame()), ("VEL2, left −10, right 10", vel2(-10, 10).to_frame()),
        ("STOP", command("STOP").to_frame()), ('TTY2 "RS" CR', command("TTY2", b"RS\r").to_frame()),
    ]  # fmt: skip
    return table(("what", "bytes"), ((name, f"`{frame.to_bytes().hex(' ').upper()}`") for name, frame in shown))


def families() -> str:
    """Return how the families differ."""
    rows = [
        ("SIP, word 16", *("flags" if profile.has_flags else "pulse width of servo 1" for profile in Profile)),
        ("SIP, behind the sonar",
         *("gripper, analog port" if profile.has_gripper_first else "analog port, gripper" for profile in Profile)),
        ("SIP, behind the digital outputs", "nothing", "nothing", "the tail"),
        ("commands with a version in its manual",
         *(sum(row.is_known_to(profile) is True for row in ROWS) for profile in Profile)),
    ]  # fmt: skip
    return table(("", *(profile.value for profile in Profile)), rows)


def robots() -> str:
    """Return every model's conversions."""
    rows = []
    for name in known_robots():
        robot = load_parameters(name)
        rows.append((
            f"`{name}`", robot.title, f"{robot.distance_conv_mm:g}", robot.angle_counts_per_turn,
            f"{robot.velocity_conv:g}", f"{robot.range_conv_mm:g}", robot.vel2_divisor_mm_s, robot.track_mm,
            len(robot.sonar), robot.max_velocity_mm_s, robot.max_rotation_deg_s,
        ))  # fmt: skip
    head = ("subclass", "model", "mm a count", "counts a turn", "mm/s a count", "mm a sonar count", "VEL2, mm/s",
            "track, mm", "sonar", "most, mm/s", "most, °/s")  # fmt: skip
    return table(head, rows)


TABLES: Mapping[str, Callable[[], str]] = {
    "numbers": numbers, "examples": examples, "commands": commands, "packet types": packet_types,
    "sip": lambda: table(HEAD, layout_rows(sip.HEAD, SIP_NOTES)), "tail": tail, "config": config, "packets": packets,
    "families": families, "robots": robots,
}  # fmt: skip


def page(text: str) -> str:
    """Return the page with every table renewed."""
    return BLOCK.sub(lambda block: f"{block[1]}\n{TABLES[block['name']]()}\n{block[4]}", text)


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
