"""`p2os doctor`: what is installed, what is missing, what each thing is for and how to get it.

It looks, but imports and starts nothing: a broken package shows when it is used.
"""

import json
import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Annotated

import typer

from p2os.cli.groups import BENCH
from simbase.installation import (
    doubled_packages,
    install_command,
    installed_needs,
    missing_distributions,
    reinstall_command,
    way_to_build,
)

HELP = """Show what is installed, what is missing and how to get it.

\b
Examples:
  p2os doctor          a table; what is missing comes with the command that gets it
  p2os doctor --json   the same for programs

Ends with exit code 1 when something is missing that every verb needs.
"""

LOWEST_PYTHON = (3, 11)


@dataclass(frozen=True, slots=True, kw_only=True)
class NeedStatus:
    """A need, and what this machine has of it: a version, a path, or None."""

    name: str
    kind: str
    found: str | None
    feature: str
    get: str
    required: bool


def examine(
    *,
    find_program: Callable[[str], str | None] = shutil.which,
    python: tuple[int, int] = sys.version_info[:2],
) -> list[NeedStatus]:
    """Return what this machine has of everything that any feature needs."""
    ok = python >= LOWEST_PYTHON
    findings = [
        NeedStatus(
            name="python", kind="program", found=platform.python_version() if ok else None, feature="everything",
            get="install Python 3.11 or newer", required=True,
        )
    ]  # fmt: skip
    finders = {"program": find_program, "package": package_version, "built": built_part}
    for need in installed_needs():
        if need.kind == "plug-in":
            if not need.is_plugged_in:
                get, feature = reinstall_command(), need.feature
                findings.append(
                    NeedStatus(name=need.name, kind=need.kind, found=None, feature=feature, get=get, required=False)
                )
            continue
        if need.kind == "package":
            get = install_command(need.extra, python=".".join(map(str, python)))
        else:
            get = need.get or way_to_build(need.name)
        findings.append(
            NeedStatus(
                name=need.name, kind=need.kind, found=finders[need.kind](need.name), feature=need.feature,
                get=get, required=need.kind == "package" and not need.extra,
            )
        )  # fmt: skip
    findings += [
        NeedStatus(
            name=name, kind="distribution", found=None, feature=extra, get=install_command(extra), required=False
        )
        for name, extra in missing_distributions().items()
    ]
    findings += [
        NeedStatus(
            name=package, kind="package twice", found=None, feature=f"of {' and '.join(names)}",
            get=f"pip uninstall -y {' '.join(names)}, then install one of them again", required=True,
        )
        for package, names in doubled_packages().items()
    ]  # fmt: skip
    return findings


def built_part(name: str) -> str | None:
    """Return how a part that is compiled with the package stands, or None where it is not there."""
    try:
        if find_spec(name) is None:
            return None
    except ImportError:
        return None
    return "built"


def package_version(name: str) -> str | None:
    """Return the version of an installed package, or None."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("doctor", help=HELP, rich_help_panel=BENCH)(doctor)


def doctor(json_output: Annotated[bool, typer.Option("--json", help="Print a JSON list.")] = False) -> None:
    """Print what is installed and what is missing."""
    findings = examine()
    if json_output:
        typer.echo(json.dumps([asdict(finding) for finding in findings], indent=2))
    else:
        for finding in findings:
            typer.echo(line_of(finding))
    missing = [finding for finding in findings if finding.found is None]
    sys.stderr.write(f"{len(findings) - len(missing)} of {len(findings)} installed, {len(missing)} missing\n")
    if any(finding.required for finding in missing):
        raise typer.Exit(1)


def line_of(finding: NeedStatus) -> str:
    """Return a line of the table, and of what is missing a second one with the way to get it."""
    state = "ok     " if finding.found is not None else "missing"
    name = finding.name.rpartition(".")[2] if finding.kind == "built" else finding.name
    line = f"{state}  {name:<18}  {finding.feature:<31}  {finding.found or ''}".rstrip()
    return line if finding.found is not None else f"{line}\n         get it: {finding.get}"
