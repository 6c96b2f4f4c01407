"""What a user has said of code: answers, kept in the folder of state, and the configuration.

    $XDG_STATE_HOME/p2os/trusted.jsonl      one answer a line; default ~/.local/state
    $XDG_CONFIG_HOME/p2os/config.toml       trust = ["~/robots/mine.py", "/srv/lab"]; default ~/.config

Invariant: an answer is added at the end; nothing that stands there is written anew.
"""

import json
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path

from simbase.errors import FileError, shown, shown_name
from simbase.files import read_text, writing

ANSWERS = Path("p2os", "trusted.jsonl")
CONFIGURATION = Path("p2os", "config.toml")
#: The key of the configuration: files, and folders with all that is below them.
TRUST = "trust"


def answers() -> frozenset[str]:
    """Return the keys of the code to which the answer was yes; a line that cannot be read is none."""
    try:
        lines = read_text(_place("XDG_STATE_HOME", ".local/state", ANSWERS)).splitlines()
    except FileError:
        return frozenset()
    return frozenset(key for line in lines if (key := _key_of(line)))


def remember(key: str, file: Path) -> None:
    """Keep that the answer was yes.

    Raises:
        FileError: It cannot be written.
    """
    path = _place("XDG_STATE_HOME", ".local/state", ANSWERS)
    line = json.dumps({"key": key, "file": str(file)})
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        path.touch(mode=0o600)
        with path.open("ab+") as there:
            there.seek(max(0, there.tell() - 1))
            is_cut = there.read() not in (b"", b"\n")  # a last line that a full disk or an end of power has cut
            there.write(b"\n" * is_cut + f"{line}\n".encode())


def configured(environment: Mapping[str, str] | None = None) -> tuple[Path, ...]:
    """Return the files and folders that the configuration trusts.

    Raises:
        FileError: It cannot be read, or says something else there.
    """
    path = _place("XDG_CONFIG_HOME", ".config", CONFIGURATION, environment)
    if not path.is_file():
        return ()
    try:
        named = tomllib.loads(read_text(path)).get(TRUST, [])
    except ValueError as error:  # no TOML, or no text
        raise FileError(f"{shown_name(path)}: {error}", hint='trust = ["~/robots/mine.py"]') from error
    found = [Path(one).expanduser() for one in named if isinstance(one, str)] if isinstance(named, list) else []
    if not isinstance(named, list) or len(found) != len(named) or not all(one.is_absolute() for one in found):
        what = f"{shown_name(path)}: {TRUST} = {shown(named)} is no list of whole paths"
        raise FileError(what, hint='trust = ["~/robots/mine.py", "/srv/lab"]')
    return tuple(found)


def _key_of(line: str) -> str:
    try:
        found = json.loads(line)
    except ValueError:
        return ""
    return str(found.get("key", "")) if isinstance(found, dict) else ""


def _place(variable: str, default: str, file: Path, environment: Mapping[str, str] | None = None) -> Path:
    """Return the path of a file in one of the user's folders; a relative one does not count, as XDG says."""
    named = Path((os.environ if environment is None else environment).get(variable, ""))
    return (named if named.is_absolute() else Path.home() / default) / file
