"""The Wireshark dissector that ships with the package, and where Wireshark looks for it."""

import os
import shutil
import sys
from importlib.resources import as_file, files
from pathlib import Path

from simbase.files import writing

NAME = "p2os.lua"


def plugin_folder(home: Path | None = None) -> Path:
    """Return the folder of a person's own Wireshark plug-ins (Wireshark user's guide, "Plugin folders")."""
    if sys.platform == "win32":
        return Path(os.environ.get("APPDATA", str(Path.home()))) / "Wireshark" / "plugins"
    return (home or Path.home()) / ".local" / "lib" / "wireshark" / "plugins"


def install(home: Path | None = None) -> Path:
    """Copy the dissector to where Wireshark finds it, and return its path.

    Raises:
        FileError: The folder cannot be written.
    """
    target = plugin_folder(home) / NAME
    with writing(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        with as_file(files("p2os.capture") / NAME) as source:
            shutil.copyfile(source, target)
    return target
