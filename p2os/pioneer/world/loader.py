"""Load a world: one that ships, a world file, or a file of another program.

Worlds that ship and our own files are TOML (`file`); all else is read by
`readers`.
"""

from functools import lru_cache
from importlib.resources import files
from pathlib import Path

from p2os.errors import WorldError
from p2os.pioneer.world.file import parse_world
from p2os.pioneer.world.model import World
from p2os.pioneer.world.readers import read_world, readers
from p2os.pioneer.world.text_file import read_text
from p2os.toml_file import is_file, is_folder
from simbase.errors import nearest, shown


def known_worlds() -> tuple[str, ...]:
    """Return the names of the worlds that ship with the package."""
    entries = files("p2os.pioneer.world.worlds").iterdir()
    return tuple(sorted(path.name.removesuffix(".toml") for path in entries if path.name.endswith(".toml")))


def world_suffixes() -> tuple[str, ...]:
    """Return the endings of the files that are read as worlds, `.toml` first."""
    return (".toml", *readers())


def load_world(name_or_path: str | Path, seed: int = 0) -> World:
    """Return a shipped world by its name, or one from a file.

    Args:
        name_or_path: A name (`p2os world list`), or a file whose ending `world_suffixes` names.
        seed: For a world that is made from one.

    Raises:
        WorldError: The world is unknown, or its file is missing or broken.
        MissingDependencyError: The file's reader is not installed.
    """
    name = str(name_or_path)
    if name in known_worlds():
        return _shipped(name, seed)
    path = Path(name)
    if not is_file(path):
        if path.suffix.lower() in world_suffixes():
            raise WorldError(f"no world {shown(name)}: there is no such file", hint="p2os world list names what ships")
        if is_folder(path):
            raise WorldError(f"no world {shown(name)}: that is a folder", hint="name a file in it")
        raise WorldError(
            f"no world {shown(name)}",
            hint=nearest(name, known_worlds(), f"shipped worlds: {', '.join(known_worlds())}"),
        )
    if path.suffix.lower() != ".toml":
        return read_world(path)
    return parse_world(read_text(path), name, seed, path.parent)


#: Of so many a process keeps what it has read: each that ships, or one of them for as many seeds.
_KEPT = 64


@lru_cache(maxsize=_KEPT)
def _shipped(name: str, seed: int) -> World:
    """Return a world that ships with the package, read once: a campaign asks for it in each of its runs."""
    text = files("p2os.pioneer.world.worlds").joinpath(f"{name}.toml").read_text(encoding="utf-8")
    return parse_world(text, f"{name}.toml", seed)
