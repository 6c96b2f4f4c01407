"""What is installed as the tests take it: what this checkout declares, and no plug-in of anybody else.

Who tries a package of their own in the environment of a checkout would else be told that a goal has no test here; and
who adds a line to pyproject.toml, that all is well, though nothing finds what it names before the next installation.
"""

import json
import tomllib
from collections.abc import Iterator
from configparser import ConfigParser
from importlib.metadata import Distribution, distributions
from pathlib import Path
from urllib.parse import unquote, urlsplit

#: The groups of entry points that a user's package may offer begin so; one of this project offers the group behind it.
OURS, MARK = ("p2os.", "robot_bench."), "simbase.packages"


def stale_points(root: Path) -> list[str]:
    """Return by name the entry points of which the editable install of a checkout knows other than its pyproject.toml.

    None where it is not installed so, or there is no such file.
    """
    if not (root / "pyproject.toml").exists():
        return []
    with (root / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    declared = {
        (group, name, value)
        for group, points in project.get("entry-points", {}).items()
        for name, value in points.items()
    }
    for distribution in distributions(name=project["name"]):
        if _editable_folder(distribution) == root:
            known = {one for one in _points(distribution) if one[0] not in {"console_scripts", "gui_scripts"}}
            return sorted({f"{name} ({group})" for group, name, _ in declared ^ known})
    return []


def _points(distribution: Distribution) -> set[tuple[str, str, str]]:
    """Return group, name and value of all that stands in its metadata, also of what a run of one house hides."""
    parser = ConfigParser(delimiters=("=",), interpolation=None)
    parser.optionxform = str  # type: ignore[assignment,method-assign]  # names keep their case
    parser.read_string(distribution.read_text("entry_points.txt") or "")
    return {(group, name, value) for group in parser.sections() for name, value in parser[group].items()}


def _editable_folder(distribution: Distribution) -> Path | None:
    said = json.loads(distribution.read_text("direct_url.json") or "{}")
    is_editable = said.get("dir_info", {}).get("editable", False)
    return Path(unquote(urlsplit(said["url"]).path)).resolve() if is_editable else None


def plug_ins_of_others() -> frozenset[tuple[str, str]]:
    """Return name and folder of each installed distribution that extends this project and is not of it."""
    found = set()
    for distribution in distributions():
        groups = {group for group, _, _ in _points(distribution)}
        if any(group.startswith(OURS) for group in groups) and MARK not in groups:
            found.add((distribution.name, str(distribution.locate_file(""))))
    return frozenset(found)


def hide(hidden: frozenset[tuple[str, str]]) -> None:
    """Have nothing of these distributions found by this process."""
    from simbase import entry_points

    find = entry_points.distributions

    def others() -> Iterator[Distribution]:
        return (one for one in find() if (one.name, str(one.locate_file(""))) not in hidden)

    entry_points.distributions = others  # type: ignore[assignment]  # it takes no arguments there
