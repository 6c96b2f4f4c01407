"""`p2os doctor`: what is installed, what is missing, what each thing is for and how to get it.

It looks, but imports and starts nothing: a broken package shows when it is used.
"""

import json
import os
import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Annotated

import typer

from p2os.cli.help_pages import BENCH

HELP = """Show what is installed, what is missing and how to get it.

\b
Examples:
  p2os doctor          a table; what is missing comes with the command that gets it
  p2os doctor --json   the same for programs

Ends with exit code 1 when something is missing that every verb needs.
"""

#: PyBullet has no wheels for later versions than 3.11.
LOWEST_PYTHON = (3, 11)
FIRST_PYTHON_WITHOUT_BULLET = (3, 12)


@dataclass(frozen=True, slots=True, kw_only=True)
class Need:
    """Something that a feature needs."""

    name: str
    kind: str
    feature: str
    get: str
    required: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A need, and what this machine has of it: a version, a path, or None."""

    name: str
    kind: str
    found: str | None
    feature: str
    get: str
    required: bool


_COMPILER = "install g++ (sudo apt-get install g++), then the package again"
_BASE, _SIM, _BULLET = "pip install p2os", "pip install 'p2os[sim]'", "pip install 'p2os[bullet]'"
_EXPORT = "pip install 'p2os[export]'"

NEEDS = (
    Need(name="pyserial", kind="package", feature="serial ports", get=_BASE, required=True),
    Need(name="construct", kind="package", feature="the P2OS protocol", get=_BASE, required=True),
    Need(name="typer", kind="package", feature="this command", get=_BASE, required=True),
    Need(name="rich", kind="package", feature="tables and progress bars", get=_BASE, required=True),
    Need(name="unicorn", kind="package", feature="the emulated BluePill", get=_SIM),
    Need(name="pyelftools", kind="package", feature="ELF programs and their symbols", get=_SIM),
    Need(name="intelhex", kind="package", feature="Intel HEX programs", get=_SIM),
    Need(name="matplotlib", kind="package", feature="plots of a run", get=_SIM),
    Need(name="pybullet", kind="package", feature="--body bullet", get=_BULLET),
    Need(name="mujoco", kind="package", feature="--body mujoco", get="pip install 'p2os[mujoco]'"),
    Need(name="numpy", kind="package", feature="--body bullet, --body mujoco", get=_BULLET),
    Need(name="pyarrow", kind="package", feature="export to Parquet and Arrow", get=_EXPORT),
    Need(name="mcap", kind="package", feature="export to MCAP", get=_EXPORT),
    Need(name="tshark", kind="program", feature="captures on the command line", get="sudo apt-get install tshark"),
    Need(
        name="bluepill_sim._native", kind="built", feature="the emulated BluePill at full speed", get=_COMPILER,
    ),
    Need(
        name="robot_bench._adapter_firmware", kind="built", feature="--adapter firmware", get=_COMPILER,
    ),
    Need(
        name="arm-none-eabi-gcc", kind="program", feature="building BluePill programs",
        get="sudo apt-get install gcc-arm-none-eabi",
    ),
    Need(
        name="gdb-multiarch", kind="program", feature="debugging BluePill programs",
        get="sudo apt-get install gdb-multiarch",
    ),
    Need(
        name="sigrok-cli", kind="program", feature="reading pins.sr of a run",
        get="sudo apt-get install sigrok-cli",
    ),
)  # fmt: skip


def examine(
    *,
    find_program: Callable[[str], str | None] = shutil.which,
    python: tuple[int, int] = sys.version_info[:2],
) -> list[Finding]:
    """Return what this machine has of everything that any feature needs."""
    ok = python >= LOWEST_PYTHON
    findings = [
        Finding(
            name="python", kind="program", found=platform.python_version() if ok else None, feature="everything",
            get="install Python 3.11 or newer", required=True,
        )
    ]  # fmt: skip
    finders = {"program": find_program, "package": package_version, "built": built_part}
    for need in NEEDS:
        found = finders[need.kind](need.name)
        get = need.get
        if need.name == "pybullet" and python >= FIRST_PYTHON_WITHOUT_BULLET:
            get = "use Python 3.11: PyBullet has no wheels for later ones"
        findings.append(
            Finding(
                name=need.name, kind=need.kind, found=found, feature=need.feature, get=get, required=need.required
            )
        )  # fmt: skip
    return findings


def built_part(name: str) -> str | None:
    """Return how a part that is compiled with the package stands, or None where it is not there."""
    try:
        if find_spec(name) is None:
            return None
    except ImportError:
        return None
    is_left_out = name.endswith("._native") and os.environ.get("P2OS_CORE") == "python"
    return "built, not used: P2OS_CORE=python" if is_left_out else "built"


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


def line_of(finding: Finding) -> str:
    """Return one line of the table."""
    state = "ok     " if finding.found is not None else "missing"
    known = finding.found if finding.found is not None else f"get it: {finding.get}"
    return f"{state}  {finding.name:<18}  {finding.feature:<31}  {known}"
