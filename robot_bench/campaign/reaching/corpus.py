"""The corpus: points that reached something new, kept in a file from campaign to campaign.

    {"corpus": 1}
    {"at": {"duration_s": 0.25, "start.x_m": 0.61, …}}

A line has the coordinates of a point by the names of its dimensions, so a space that has become another takes of them
what it still has. A campaign begins with the points of its corpus, and adds those of its own that reached something
new. No line says what was reached: a program that has changed reaches something else, so each is run again.

Invariant: the file is whole at any instant, and what is in it is a point of the unit cube.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from simbase.errors import FileError
from simbase.files import VersionedFormat, read_bytes, write_text

#: What a campaign has begun with, in its folder.
BEGUN = "corpus.jsonl"
CORPUS = VersionedFormat("a corpus")
#: chosen: more points would take most of a campaign to run again.
MOST_KEPT = 256
#: Digits of a coordinate: a thousandth of a range of a kilometre.
_DIGITS = 6
#: Dimension → coordinate, 0 up to 1.
Coordinates = Mapping[str, float]


def read_corpus(path: Path) -> tuple[Coordinates, ...]:
    """Return the points of a corpus, the oldest first; none where there is no file.

    Raises:
        FileError: It is no corpus, or a later p2os wrote it.
    """
    if not path.exists():
        return ()
    found: list[Coordinates] = []
    head, *lines = read_bytes(path).decode("utf-8", "replace").splitlines() or [""]
    for number, line in enumerate([head, *lines], 1):
        try:
            entry = json.loads(line)
            if number == 1:
                CORPUS.version_of(entry["corpus"], path)
                continue
            at = {str(name): _coordinate(value) for name, value in entry["at"].items()}
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise FileError(f"{path}:{number}: no line of a corpus", hint="move the file away") from error
        found.append(at)
    return tuple(found)


def write_corpus(path: Path, points: Sequence[Coordinates]) -> None:
    """Write a corpus.

    Raises:
        FileError: The disk is full.
    """
    lines = [json.dumps({"corpus": CORPUS.newest}), *(json.dumps({"at": dict(at)}, sort_keys=True) for at in points)]
    write_text(path, "".join(f"{line}\n" for line in lines))


def added(held: Sequence[Coordinates], new: Iterable[Coordinates]) -> list[Coordinates]:
    """Return a corpus with points added that reached something new; of too many the oldest go."""
    known = {_key(at): at for at in held}
    for at in new:
        rounded = {name: min(round(value, _DIGITS), 1 - 10**-_DIGITS) for name, value in at.items()}
        known.setdefault(_key(rounded), rounded)
    return list(known.values())[-MOST_KEPT:]


def _coordinate(value: object) -> float:
    if not isinstance(value, (int, float)) or not 0 <= value < 1:
        raise ValueError(value)
    return float(value)


def _key(at: Coordinates) -> tuple[tuple[str, float], ...]:
    return tuple(sorted(at.items()))
