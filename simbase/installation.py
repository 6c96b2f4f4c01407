"""What is installed of this project, what that needs, and the commands that get what is missing.

The distributions are those that offer a package by an entry point of the group `simbase.packages`: several, or one that
is the whole. They are on no package index, so a command names the packages of an extra themselves, read from the
installed metadata; pyproject.toml is their one place.
"""

import contextlib
import json
import shlex
import shutil
import sys
from collections import Counter
from dataclasses import dataclass
from functools import cache
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from simbase.entry_points import every_installed_point, installed_points

if TYPE_CHECKING:
    from packaging.requirements import Requirement

#: Each entry point is a package at the top, and its value what it may need: a tuple of `Need`.
GROUP = "simbase.packages"


@dataclass(frozen=True, slots=True, kw_only=True)
class Need:
    """Something that a feature needs; a package is of an extra, or, with "", needed by every verb."""

    name: str
    kind: str  # "package", "program", "built" with the distribution, or a "plug-in" of it
    feature: str
    extra: str = ""
    get: str = ""
    points: tuple[str, ...] = ()  # of a plug-in: the groups of entry points to which it belongs
    point: str = ""  # the name of its entry point in the first of them, by which it is known to be there

    @property
    def is_plugged_in(self) -> bool:
        """Whether a plug-in is there."""
        return self.point in installed_points(self.points[0])


_KINDS = ("package", "built", "plug-in", "program")

#: Of this package.
NEEDS = (
    Need(name="typer", kind="package", feature="this command"),
    Need(name="rich", kind="package", feature="tables and progress bars"),
    Need(name="packaging", kind="package", feature="hints like those of this table"),
)


@cache
def installed_distributions() -> tuple[Distribution, ...]:
    """Return every distribution of this project that is installed, by name."""
    found = {point.dist.name: point.dist for point in every_installed_point(GROUP) if point.dist is not None}
    return tuple(found[name] for name in sorted(found))


def installed_needs() -> tuple[Need, ...]:
    """Return what the installed packages may need, each need once: what every verb needs first, programs last."""
    points = sorted(every_installed_point(GROUP), key=lambda point: point.name)
    needs = dict.fromkeys(need for point in points for need in point.load())
    return tuple(sorted(needs, key=lambda need: (_KINDS.index(need.kind), need.kind == "package" and bool(need.extra))))


def way_to_plug_in(group: str) -> str:
    """Return which plug-in of a group of entry points is not there, and the command that gets it; empty: none lacks."""
    lacking = [need for need in installed_needs() if group in need.points and not need.is_plugged_in]
    return f"{lacking[0].name} ({lacking[0].feature}) is not installed: {reinstall_command()}" if lacking else ""


def missing_distributions() -> dict[str, str]:
    """Return the distributions of this project that an extra would bring and that are not there, with the extra."""
    from packaging.requirements import Requirement

    there = {one.name for one in installed_distributions()}
    version = installed_version() if there else ""
    return {
        one.name: extra
        for dist in installed_distributions() for extra in dist.metadata.get_all("Provides-Extra") or ()
        for one in _parsed(Requirement, tuple(dist.requires or ()))
        if f'extra == "{extra}"' in str(one.marker) and str(one.specifier) == f"=={version}" and one.name not in there
    }  # fmt: skip


def doubled_packages() -> dict[str, list[str]]:
    """Return the packages that more than one distribution has installed, by their names: one wrote over another."""
    points = [(point.name, point.dist.name) for point in every_installed_point(GROUP) if point.dist is not None]
    counts = Counter(name for name, _ in set(points))
    return {name: sorted({dist for one, dist in points if one == name}) for name, n in sorted(counts.items()) if n > 1}


@cache
def installed_version() -> str:
    """Return the version of this project that is installed, read from the metadata once.

    Raises:
        PackageNotFoundError: It is not installed.
    """
    for one in installed_distributions():
        return one.version
    raise PackageNotFoundError(GROUP.partition(".")[0])


def package_version(package: str) -> str:
    """Return the version of the distribution that a package of this project is from.

    Raises:
        PackageNotFoundError: None that is installed has it.
    """
    for point in every_installed_point(GROUP):
        if point.name == package and point.dist is not None:
            return point.dist.version
    raise PackageNotFoundError(package)


def install_command(extra: str = "", *, python: str = "") -> str:
    """Return the command that installs the packages of an extra, or why this Python cannot have them.

    Args:
        extra: An extra of pyproject.toml; empty for what every verb needs.
        python: Asked for this version, such as "3.13"; empty for the running one.
    """
    try:
        from packaging.requirements import Requirement
    except ModuleNotFoundError:
        return f"{_pip_install()} packaging"
    there = installed_distributions()
    if not there:
        checkout = str(Path(__file__).resolve().parents[1])
        return f"{_pip_install()} -e {shlex.quote(f'{checkout}[{extra}]' if extra else checkout)}"
    if all(extra not in (dist.metadata.get_all("Provides-Extra") or ()) for dist in there):
        extra = ""  # these distributions need it always
    found = [one for dist in there for one in _parsed(Requirement, tuple(dist.requires or ()))]
    condition = f'extra == "{extra}"'
    named = {one.name: one for one in found if (condition in str(one.marker) if extra else one.marker is None)}
    environment = {"extra": extra} | ({"python_version": python} if python else {})
    for one in named.values():
        if one.marker and not one.marker.evaluate(environment):
            return f"{one.name} needs {str(one.marker).removesuffix(f' and {condition}')}"
    ours = {dist.name for dist in there}
    return f"{_pip_install()} {' '.join(name for name in named if name not in ours)}"


@cache
def _parsed(kind: "type[Requirement]", lines: tuple[str, ...]) -> "list[Requirement]":
    """Return requirements, parsed once: who lists all needs asks for each."""
    return list(map(kind, lines))


def reinstall_command(package: str = "") -> str:
    """Return the command that builds a distribution again from where it came; `FOLDER_OF_…` where that is not known.

    Args:
        package: A package at the top that it has; empty for the first.
    """
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    names = [point.dist.name for point in every_installed_point(GROUP) if point.dist and point.name == package]
    name = (names or [one.name for one in installed_distributions()] or [GROUP.partition(".")[0]])[0]
    origin = json.loads(_origin(name) or "{}")
    if "dir_info" in origin:
        source = shlex.quote(url2pathname(urlsplit(origin["url"]).path))
        source = f"-e {source}" if origin["dir_info"].get("editable") else source
    else:
        source = f"FOLDER_OF_{name.replace('-', '_').upper()}"
    return f"{_pip_install()} --force-reinstall --no-deps {source}"


def way_to_build(name: str, compiler: str | None = None) -> str:
    """Return how a part that is compiled with its package is got, and why it was not built where that is known.

    Args:
        name: Its dotted name.
        compiler: The program that compiles it; None looks for one.
    """
    package, _, part = name.rpartition(".")
    note = Path(str(files(package))) / f"{part}.left_out"
    reason = note.read_text(encoding="utf-8").strip() if note.is_file() else "nothing was built in this folder"
    has_compiler = compiler if compiler is not None else shutil.which("g++") or shutil.which("c++")
    return f"{'' if has_compiler else 'sudo apt-get install g++ && '}{reinstall_command(package)} ({reason})"


def _origin(name: str) -> str | None:
    """Return what pip noted of the source that it installed."""
    try:
        return distribution(name).read_text("direct_url.json")
    except PackageNotFoundError:
        return None


def _pip_install() -> str:
    """Return `pip install`, with the path of its Python where the shell's `pip` is another's."""
    python = Path(sys.executable)
    found = shutil.which("pip")
    if found is not None and Path(found).parent == python.parent:
        return "pip install"
    with contextlib.suppress(ValueError, OSError):  # elsewhere, or the current folder is gone
        python = python.relative_to(Path.cwd())
    return f"{shlex.quote(str(python))} -m pip install"
