"""The Wireshark dissector that ships with the package, and where Wireshark looks for it.

How frames are read stands in `p2os.lua`; names, numbers and the layout of a SIP come from the protocol's own tables.
"""

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from importlib.resources import files
from pathlib import Path

from construct import Array

from p2os.protocol.command_table import SYNC_NAMES
from p2os.protocol.commands import NEGATIVE, POSITIVE, STRING, CommandNumber
from p2os.protocol.frames import HEADER, MAX_COUNT, MIN_COUNT
from p2os.protocol.odometry import POSITION_MODULUS
from p2os.protocol.packets import IDENTITY_KIND, PACKET_NAMES
from p2os.protocol.sip import HEAD, HEAD_BYTES, READING_BYTES, SIP_KINDS, SONAR_AT, TAIL, TAIL_MEANINGS
from simbase.files import writing

NAME = "p2os.lua"


def script() -> str:
    """Return the dissector, in Lua."""
    text = (files("p2os.capture") / NAME).read_text(encoding="utf-8")
    for table, rows in _tables().items():
        text = text.replace(
            f"local {table} = {{}}", f"local {table} = {{{''.join(f'{chr(10)}    {row},' for row in rows)}\n}}", 1
        )
    return text


def plugin_folder(home: Path | None = None) -> Path:
    """Return the folder of a person's own Wireshark plug-ins (Wireshark user's guide, "Plugin folders")."""
    if sys.platform == "win32":
        return Path(os.environ.get("APPDATA", str(Path.home()))) / "Wireshark" / "plugins"
    return (home or Path.home()) / ".local" / "lib" / "wireshark" / "plugins"


def install(home: Path | None = None) -> Path:
    """Write the dissector to where Wireshark finds it, and return its path.

    Raises:
        FileError: The folder cannot be written.
    """
    target = plugin_folder(home) / NAME
    with writing(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(script(), encoding="utf-8")
    return target


def _tables() -> Mapping[str, Iterable[str]]:
    """Return the rows of each table in Lua."""
    numbers = {
        "header": int.from_bytes(HEADER, "big"), "min_count": MIN_COUNT, "max_count": MAX_COUNT,
        "positive": POSITIVE, "negative": NEGATIVE, "string": STRING, "identity": IDENTITY_KIND,
        "sip_first": SIP_KINDS[0], "sip_last": SIP_KINDS[-1], "sip_bytes": HEAD_BYTES, "sonar_at": SONAR_AT,
        "reading_bytes": READING_BYTES, "positions": POSITION_MODULUS,
    }  # fmt: skip
    return {
        "commands": _named((int(number), number.name) for number in CommandNumber),
        "packets": _named(PACKET_NAMES.items()),
        "bare": _named((number, f"{name} or {CommandNumber(number).name}") for number, name in enumerate(SYNC_NAMES)),
        "argument_types": _named({POSITIVE: "integer", NEGATIVE: "negative integer", STRING: "string"}.items()),
        "wire": (f"{name} = {number:#x}" for name, number in numbers.items()),
        "head": _sip_rows(is_behind=False),
        "behind": _sip_rows(is_behind=True),
        "tail": (
            f'{{ "{name.removeprefix("raw_")}", {size}, {"true" if signed else "false"}, "{_title(name)}" }}'
            for name, size, signed in TAIL
        ),
    }


def _named(rows: Iterable[tuple[int, str]]) -> Iterator[str]:
    return (f'[{number:#04x}] = "{name}"' for number, name in rows)


def _sip_rows(*, is_behind: bool) -> Iterator[str]:
    """Yield the numbers of a SIP before its sonar readings, or those behind them; places are without any reading."""
    place, has_come = 1, False
    for field in HEAD.subcons:
        if isinstance(field.subcon, Array):
            has_come = True
            continue
        size, is_signed = field.sizeof(), field.subcon.fmtstr[-1].islower()
        if has_come is is_behind:
            yield f"{field.name} = {{ place = {place}, bytes = {size}, signed = {'true' if is_signed else 'false'} }}"
        place += size


def _title(name: str) -> str:
    words = name.removeprefix("raw_").replace("_", " ")
    return f"{words[0].upper()}{words[1:]} ({TAIL_MEANINGS[name]})"
