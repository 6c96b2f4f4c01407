"""How p2os was installed, and the commands that get what is missing from it.

p2os is on no package index, so a command names the packages of an extra themselves. They are read from the
installed metadata; pyproject.toml is their one place.
"""

import contextlib
import json
import shlex
import shutil
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution, requires, version
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from packaging.requirements import Requirement

_DISTRIBUTION = "p2os"


@cache
def installed_version() -> str:
    """Return the version of p2os, read from the installed metadata once.

    Raises:
        PackageNotFoundError: It is not installed.
    """
    return version(_DISTRIBUTION)


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
    try:
        found = _parsed(Requirement, tuple(requires(_DISTRIBUTION) or ()))
    except PackageNotFoundError:
        checkout = str(Path(__file__).resolve().parents[1])
        return f"{_pip_install()} -e {shlex.quote(f'{checkout}[{extra}]' if extra else checkout)}"
    condition = f'extra == "{extra}"'
    named = [one for one in found if (condition in str(one.marker) if extra else one.marker is None)]
    environment = {"extra": extra} | ({"python_version": python} if python else {})
    for one in named:
        if one.marker and not one.marker.evaluate(environment):
            return f"{one.name} needs {str(one.marker).removesuffix(f' and {condition}')}"
    return f"{_pip_install()} {' '.join(one.name for one in named)}"


@cache
def _parsed(kind: "type[Requirement]", lines: tuple[str, ...]) -> "list[Requirement]":
    """Return requirements, parsed once: `p2os doctor` asks for each of its packages."""
    return list(map(kind, lines))


def reinstall_command() -> str:
    """Return the command that builds p2os again from where it came; `FOLDER_OF_P2OS` where that is not known."""
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    origin = json.loads(_origin() or "{}")
    if "dir_info" in origin:
        source = shlex.quote(url2pathname(urlsplit(origin["url"]).path))
        source = f"-e {source}" if origin["dir_info"].get("editable") else source
    else:
        source = "FOLDER_OF_P2OS"
    return f"{_pip_install()} --force-reinstall --no-deps {source}"


def _origin() -> str | None:
    """Return what pip noted of the source that it installed."""
    try:
        return distribution(_DISTRIBUTION).read_text("direct_url.json")
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
