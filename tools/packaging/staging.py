"""A house of the whole, staged: its folders, its own pyproject.toml and page, ready for any builder of Python packages.

The root's pyproject.toml is the whole and stays the one place of versions, requirements, entry points, data files and
parts in C; `houses.toml` says what of it a house has. A house's pyproject.toml is written from both: one that reached
upwards from a folder of its own would make a source distribution without its sources.
"""

import json
import re
import shutil
import subprocess
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
HOUSES = Path(__file__).with_name("houses.toml")

#: The table of `HOUSES` that is no house.
PLUGINS = "plugins"

#: What every house carries beside its folders.
SHARED = ("LICENSE", "NOTICE", "setup.py")

#: A requirement's name, before its extras, versions and markers.
_NAME = re.compile(r"[A-Za-z0-9._-]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class House:
    """A distribution, as `houses.toml` describes it."""

    name: str
    description: str
    folders: Sequence[str]  # of code, which it alone has
    houses: Sequence[str] = ()  # below it
    requires: Sequence[str] = ()  # packages of others, by name
    extras: Sequence[str] = ()
    brings: Mapping[str, str] = field(default_factory=dict)  # extra → the house above that it installs
    sources: Sequence[str] = ()  # folders that only a build needs
    tests: Sequence[str] = ()  # folders of its tests
    pages: Sequence[str] = ()  # its own pages
    is_published: bool = True
    needs_unix: bool = False  # a verb of it imports what other systems have not

    def runs_on(self, is_unix: bool) -> bool:
        """Tell whether every import that its verbs make exists on a platform."""
        return is_unix or not self.needs_unix

    def holds(self, module: str) -> bool:
        """Tell whether a module, or a pattern of files, is of this house."""
        return re.split(r"[./]", module, maxsplit=1)[0] in self.folders


@dataclass(frozen=True, slots=True, kw_only=True)
class Plugin:
    """What only some need of a house and entry points find, as `houses.toml` describes it."""

    name: str
    house: str  # the last that has some of it
    modules: Sequence[str]  # with all that is below them
    words: Sequence[str] = ()  # that nothing outside says
    verbs: Sequence[str] = ()
    uses: Sequence[str] = ()  # plug-ins that it may import
    tests: Sequence[str] = ()  # of it, in the house's folders of tests
    marks: Sequence[str] = ()  # of its tests in files of others

    def holds(self, module: str) -> bool:
        """Tell whether a module is of this plug-in."""
        return any(module == name or module.startswith(f"{name}.") for name in self.modules)


def plugins() -> dict[str, Plugin]:
    """Return the plug-ins by name."""
    return {name: Plugin(name=name, **table) for name, table in _read(HOUSES)[PLUGINS].items()}


def houses(*, with_tests_alone: bool = False) -> dict[str, House]:
    """Return the houses by name, each after those that it stands on.

    Args:
        with_tests_alone: Also what has tests of its own and is in no distribution.
    """
    found = {name: House(name=name, **table) for name, table in _read(HOUSES).items() if name != PLUGINS}
    return {name: house for name, house in found.items() if house.is_published or with_tests_alone}


def pyproject(house: House, whole: Mapping[str, Any]) -> dict[str, Any]:
    """Return the pyproject.toml of a house.

    Args:
        house: The house.
        whole: The root's.

    Raises:
        KeyError: `houses.toml` names a package or an extra that the whole does not have.
    """
    project, setuptools = whole["project"], whole["tool"]["setuptools"]
    ranges = requirements(whole)
    version = project["version"]
    extras = {name: project["optional-dependencies"][name] for name in house.extras}
    extras |= {extra: [f"{above}=={version}"] for extra, above in house.brings.items()}
    points = {
        group: {name: module for name, module in rows.items() if house.holds(module)}
        for group, rows in {"console_scripts": project["scripts"], **project["entry-points"]}.items()
    }
    scripts = points.pop("console_scripts")
    return {
        "build-system": whole["build-system"],
        "project": {
            **{key: project[key] for key in ("version", "dynamic", "requires-python", "license", "license-files")},
            "name": house.name,
            "description": house.description,
            "dependencies": [*(f"{below}=={version}" for below in house.houses), *(ranges[n] for n in house.requires)],
            **({"optional-dependencies": extras} if extras else {}),
            **({"scripts": scripts} if scripts else {}),
            "entry-points": {group: rows for group, rows in points.items() if rows},
        },
        "tool": {
            "setuptools": {
                "include-package-data": False,
                "packages": {"find": {"include": [f"{folder}*" for folder in house.folders]}},
                "package-data": {
                    name: files
                    for name, files in setuptools["package-data"].items()
                    if name == "*" or house.holds(name)
                },
                "ext-modules": [part for part in setuptools["ext-modules"] if house.holds(part["name"])],
            }
        },
    }


def whole_project() -> dict[str, Any]:
    """Return the root's pyproject.toml."""
    return _read(ROOT / "pyproject.toml")


def requirements(whole: Mapping[str, Any]) -> dict[str, str]:
    """Return every requirement of the whole, by the name of its package; the first that names it."""
    project = whole["project"]
    found: dict[str, str] = {}
    for line in [
        *project["dependencies"],
        *(one for rows in project["optional-dependencies"].values() for one in rows),
    ]:
        name = _NAME.match(line)
        if name is not None:
            found.setdefault(name[0], line)
    return found


def stage(house: House, place: Path) -> Path:
    """Write a house into an empty folder and return that folder.

    Raises:
        FileExistsError: The folder is there already.
    """
    place.mkdir(parents=True)
    for name in _files((*house.folders, *house.sources)):
        target = place / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, target)
    for name in SHARED:
        shutil.copy2(ROOT / name, place / name)
    shutil.copy2(Path(__file__).with_name(f"{house.name}.md"), place / "README.md")
    (place / "MANIFEST.in").write_text(
        "".join(f"graft {folder}\n" for folder in (*house.folders, *house.sources))
        + "global-exclude __pycache__/* *.py[co] *.so *.o *.left_out\n",
        encoding="utf-8",
    )
    (place / "pyproject.toml").write_text(as_toml(pyproject(house, whole_project())), encoding="utf-8")
    return place


def as_toml(table: Mapping[str, Any]) -> str:
    """Return a table as TOML: texts, booleans, lists of texts, tables and lists of tables."""
    return "\n".join(_lines(table, ()))


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    plain = {key: value for key, value in table.items() if not _is_table(value)}
    if path and (plain or not table):
        yield f"\n[{'.'.join(map(_key, path))}]"
    for key, value in plain.items():
        yield f"{_key(key)} = {json.dumps(value, ensure_ascii=False)}"
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _lines(value, (*path, key))
        elif _is_table(value):
            for row in value:
                yield f"\n[[{'.'.join(map(_key, (*path, key)))}]]"
                yield from (f"{_key(name)} = {json.dumps(each, ensure_ascii=False)}" for name, each in row.items())


def _is_table(value: object) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and any(isinstance(one, dict) for one in value))


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name)


def _files(folders: Sequence[str]) -> list[str]:
    """Return the files of folders that belong to the project: git's, those included that are not committed yet."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *folders]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout.splitlines()
    if not listed:  # no checkout: an unpacked source distribution
        listed = [path.relative_to(ROOT).as_posix() for name in folders for path in (ROOT / name).rglob("*")]
    return [name for name in listed if (ROOT / name).is_file() and "__pycache__" not in name]


def _read(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))
