"""Write the tables of PROTOCOL.md from the code's own: commands, packets, numbers, robots.

What stands between `<!-- table: NAME -->` and `<!-- end -->` is generated; a test
holds the committed page to what comes out here.
Usage: python tools/generators/protocol.py
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
    MEANINGS,
    P2OS_FIELDS,
)
from p2os.protocol.fields import meaning
from p2os.protocol.frames import GIVE_UP_NS, HEADER, MAX_COUNT, MAX_PAYLOAD_BYTES, MIN_COUNT, Frame
from p2os.protocol.odometry import POSITION_MODULUS
from p2os.protocol.packets import PACKET_KINDS, PACKET_NAMES, READERS, SerauxPacket
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import known_robots, load_parameters
from simbase.timing import NS_PER_MS

PAGE = Path(__file__).resolve().parents[2] / "PROTOCOL.md"
BLOCK = re.compile(r"(<!-- table: (?P<name>[a-z ]+) -->\n)(?P<body>.*?)(<!-- end -->)", re.DOTALL)

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


def layout_rows(layout: Struct, place: int = 1, behind: str = "") -> list[tuple[str, ...]]:
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
            inner = [(str(item.name), *type_of(bare(item)), meaning(item)) for item in construct.subcons]
            what = "; ".join(f"`{item}` {size} ({sign}): {means}" for item, size, sign, means in inner)
            rows.append(
                (f"{place}{behind}", f"{times}({' + '.join(size for _, size, *_ in inner)})", f"`{name}`", what)
            )
        else:
            size, sign = type_of(construct)
            rows.append((f"{place}{behind}", f"{times}{size}", f"`{name}`", f"{sign}; {meaning(sub)}"))
        if not number or isinstance(construct, NullTerminated):
            behind += f" + `{name}`"
        else:
            place += number * construct.sizeof()
    return rows


HEAD = ("offset", "bytes", "field", "meaning")


def packets() -> str:
    """Return a section a packet."""
    return "\n".join(
        f"**{row.name}**, type `{row.kind:02X}`\n\n" + table(HEAD, layout_rows(row.layout))
        for row in PACKET_KINDS if row.layout is not None
    )  # fmt: skip


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
        rows.append((number, size, f"`{name}`", "; ".join(filter(None, (sign, MEANINGS[name]))), ENDS.get(number, "")))
    return table(("#", "bytes", "field", "meaning", "ends here"), rows)


def tail() -> str:
    """Return the ARCOS tail of a SIP."""
    rows, place = [], 0
    for name, size, signed in sip.TAIL:
        rows.append(
            (f"+{place}", size, f"`{name}`", f"{'signed' if signed else 'unsigned'}; {sip.TAIL_MEANINGS[name]}")
        )
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
    "sip": lambda: table(HEAD, layout_rows(sip.HEAD)), "tail": tail, "config": config, "packets": packets,
    "families": families, "robots": robots,
}  # fmt: skip


def page(text: str) -> str:
    """Return the page with every table renewed."""
    return BLOCK.sub(lambda block: f"{block[1]}\n{TABLES[block['name']]()}\n{block[4]}", text)


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
