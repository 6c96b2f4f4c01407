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
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.help_pages import BENCH
from simbase.installation import install_command, reinstall_command

HELP = """Show what is installed, what is missing and how to get it.

\b
Examples:
  p2os doctor          a table; what is missing comes with the command that gets it
  p2os doctor --json   the same for programs

Ends with exit code 1 when something is missing that every verb needs.
"""

LOWEST_PYTHON = (3, 11)


@dataclass(frozen=True, slots=True, kw_only=True)
class Need:
    """Something that a feature needs; a package is of an extra, or, with "", needed by every verb."""

    name: str
    kind: str
    feature: str
    extra: str = ""
    get: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A need, and what this machine has of it: a version, a path, or None."""

    name: str
    kind: str
    found: str | None
    feature: str
    get: str
    required: bool


NEEDS = (
    Need(name="pyserial", kind="package", feature="serial ports"),
    Need(name="construct", kind="package", feature="the P2OS protocol"),
    Need(name="typer", kind="package", feature="this command"),
    Need(name="rich", kind="package", feature="tables and progress bars"),
    Need(name="packaging", kind="package", feature="hints like those of this table"),
    Need(name="unicorn", kind="package", feature="the emulated BluePill", extra="sim"),
    Need(name="pyelftools", kind="package", feature="ELF programs and their symbols", extra="sim"),
    Need(name="intelhex", kind="package", feature="Intel HEX programs", extra="sim"),
    Need(name="matplotlib", kind="package", feature="plots of a run", extra="sim"),
    Need(name="pybullet", kind="package", feature="--body bullet", extra="bullet"),
    Need(name="mujoco", kind="package", feature="--body mujoco", extra="mujoco"),
    Need(name="numpy", kind="package", feature="--body bullet, --body mujoco", extra="columns"),
    Need(name="pyarrow", kind="package", feature="export to Parquet and Arrow", extra="export"),
    Need(name="mcap", kind="package", feature="export to MCAP", extra="export"),
    Need(name="cyclonedds", kind="package", feature="ros, run --ros by DDS", extra="ros"),
    Need(name="eclipse-zenoh", kind="package", feature="ros, run --ros by zenoh", extra="ros"),
    Need(name="rosbags", kind="package", feature="rosbag2, both ways", extra="ros"),
    Need(name="scipy", kind="package", feature="compare, fit, metrics; campaign", extra="experiments"),
    Need(name="SALib", kind="package", feature="sensitivity", extra="experiments"),
    Need(name="optuna", kind="package", feature="campaign: search by samplers", extra="campaign"),
    Need(name="ribs", kind="package", feature="campaign: quality and diversity", extra="campaign"),
    Need(name="dask", kind="package", feature="campaign --dask", extra="campaign"),
    Need(name="distributed", kind="package", feature="campaign --dask", extra="campaign"),
    Need(name="foxglove-sdk", kind="package", feature="run --foxglove", extra="foxglove"),
    Need(name="pillow", kind="package", feature="worlds from ROS maps: pictures", extra="worlds"),
    Need(name="pyyaml", kind="package", feature="worlds from ROS maps", extra="worlds"),
    Need(name="pygame-ce", kind="package", feature="teleop --pad", extra="pad"),
    Need(name="tshark", kind="program", feature="captures on the command line", get="sudo apt-get install tshark"),
    Need(
        name="bluepill_sim._native", kind="built", feature="the emulated BluePill",
    ),
    Need(
        name="robot_bench._edges", kind="built", feature="wires of a run",
    ),
    Need(
        name="robot_bench._esp32", kind="built", feature="board test --emulated",
    ),
    Need(
        name="robot_bench._adapter_firmware", kind="built", feature="--adapter firmware",
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
        if need.kind == "package":
            get = install_command(need.extra, python=".".join(map(str, python)))
        else:
            get = need.get or way_to_build(need.name, find_program)
        findings.append(
            Finding(
                name=need.name, kind=need.kind, found=finders[need.kind](need.name), feature=need.feature,
                get=get, required=need.kind == "package" and not need.extra,
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
    return "built"


def way_to_build(name: str, find_program: Callable[[str], str | None] = shutil.which) -> str:
    """Return how a part that is compiled with the package is got, and why it was not built when that is known."""
    package, _, part = name.rpartition(".")
    folder = Path(str(files(package)))
    note = folder / f"{part}.left_out"
    if note.is_file():
        reason = note.read_text(encoding="utf-8").strip()
    elif any(folder.glob(f"{part}.*.so")):
        reason = "it was built for another Python"
    else:
        reason = "nothing was built in this folder"
    compiler = "" if find_program("g++") or find_program("c++") else "sudo apt-get install g++ && "
    return f"{compiler}{reinstall_command()} ({reason})"


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
    """Return a line of the table, and of what is missing a second one with the way to get it."""
    state = "ok     " if finding.found is not None else "missing"
    name = finding.name.rpartition(".")[2] if finding.kind == "built" else finding.name
    line = f"{state}  {name:<18}  {finding.feature:<31}  {finding.found or ''}".rstrip()
    return line if finding.found is not None else f"{line}\n         get it: {finding.get}"
