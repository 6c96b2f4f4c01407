"""The Wireshark dissector that ships with the package, and where Wireshark looks for it.

How frames are read stands in `p2os.lua`; what commands and packets are called comes from the protocol's own tables.
"""

import os
import sys
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path

from p2os.protocol.commands import CommandNumber
from p2os.protocol.packets import PACKET_NAMES
from simbase.files import writing

NAME = "p2os.lua"


def script() -> str:
    """Return the dissector, in Lua."""
    text = (files("p2os.capture") / NAME).read_text(encoding="utf-8")
    names = {
        "commands": ((int(number), number.name) for number in CommandNumber),
        "packets": PACKET_NAMES.items(),
    }
    for table, rows in names.items():
        text = text.replace(f"local {table} = {{}}", f"local {table} = {{{_lua_rows(rows)}\n}}", 1)
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


def _lua_rows(rows: Iterable[tuple[int, str]]) -> str:
    return "".join(f'\n    [{number:#04x}] = "{name}",' for number, name in rows)
