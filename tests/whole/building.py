"""Distributions built as pip does, and installed in environments that hold nothing else."""

import os
import shutil
import subprocess
import sys
import tomllib
import venv
import zipfile
from collections.abc import Iterable, Sequence
from importlib.metadata import Distribution, distribution, distributions
from importlib.util import cache_from_source
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CONSTRAINTS = ROOT / "constraints.txt"
LIMIT_S = 300

BUILD = "import sys; from setuptools import build_meta; print(getattr(build_meta, sys.argv[1])(sys.argv[2]))"


def tracked() -> list[str]:
    """Return every file of the project, those included that are not committed yet."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout.splitlines()
    if not listed:
        pytest.skip("no git checkout: nothing tells which files are the project's")
    return [name for name in listed if (ROOT / name).is_file() and not (ROOT / name).is_symlink()]


def unpacked(folder: Path, wheels: Iterable[Path], others: Sequence[str] = ()) -> Path:
    """Return the Python of a new environment with wheels and what they require, and no more.

    The wheels are unpacked as an installer does it; packages of others are those of this environment, by links.
    """
    venv.create(folder, symlinks=True)
    (place,) = folder.glob("lib/python3*/site-packages")
    for wheel in wheels:
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(place)
            compile_as_here(place, [name for name in archive.namelist() if name.endswith(".py")])
    own = {canonicalize_name(one.name): one for one in distributions(path=[str(place)])}
    for one in required([*own, *others], own):
        for name in {path.parts[0] for path in one.files or () if path.parts[0] not in {"..", "__pycache__"}}:
            (place / name).symlink_to(Path(str(one.locate_file(name))))
    for point in (point for one in own.values() for point in one.entry_points.select(group="console_scripts")):
        script = folder / "bin" / point.name
        script.write_text(f"#!{folder}/bin/python\nimport sys\nfrom {point.module} import {point.attr}\n"
                          f"sys.exit({point.attr}())\n")  # fmt: skip
        script.chmod(0o755)
    return folder / "bin" / "python"


def compile_as_here(place: Path, modules: Iterable[str]) -> None:
    """Give modules the bytecode that the checkout keeps of the same text: to compile 200 takes a second."""
    for name in modules:
        ours, theirs = ROOT / name, place / name
        kept = Path(cache_from_source(str(ours)))
        if ours.is_file() and kept.is_file() and ours.read_bytes() == theirs.read_bytes():
            shutil.copystat(ours, theirs)  # by its time Python tells whether bytecode is of this text
            target = Path(cache_from_source(str(theirs)))
            target.parent.mkdir(exist_ok=True)
            shutil.copyfile(kept, target)


def required(names: Iterable[str], own: dict[str, Distribution]) -> list[Distribution]:
    """Return what distributions require, whatever of it is not among the own: of this environment."""
    found: dict[str, Distribution] = {}
    left = list(names)
    while left:
        name = canonicalize_name(left.pop())
        if name not in found:
            found[name] = own[name] if name in own else distribution(name)
            lines = [Requirement(line) for line in found[name].requires or ()]
            left += [line.name for line in lines if line.marker is None or line.marker.evaluate({"extra": ""})]
    return [one for name, one in found.items() if name not in own]


def pip_installed(folder: Path, wheels: Iterable[Path], others: Sequence[str] = ()) -> Path:
    """Return the Python of a new environment, as pip makes it with a package index."""
    venv.create(folder)
    command = [sys.executable, "-m", "pip", "--python", folder / "bin" / "python", "install"]
    done = subprocess.run(
        [*command, "--quiet", "--disable-pip-version-check", "-c", CONSTRAINTS, *wheels, *others],
        cwd=folder, env=clean_environment(), capture_output=True, text=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip
    if "No matching distribution found" in done.stderr or "connection" in done.stderr.lower():
        pytest.skip(f"no package index is reached: {done.stderr.splitlines()[-1]}")
    assert done.returncode == 0, done.stderr
    return folder / "bin" / "python"


def clean_environment(**more: str) -> dict[str, str]:
    """Return the environment without what would bring the checkout back or choose a core."""
    left_out = ("PYTHONPATH", "P2OS_CORE", "P2OS_NATIVE")
    return {name: value for name, value in os.environ.items() if name not in left_out} | more


def build(sources: Path, kind: str, out: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a step of the build as pip does, in a folder of sources."""
    out.mkdir(exist_ok=True)
    return subprocess.run(
        [sys.executable, "-c", BUILD, f"build_{kind}", out],
        cwd=sources, env=clean_environment(**environment), capture_output=True, text=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip


def built(done: subprocess.CompletedProcess[str], out: Path) -> Path:
    """Return the file that a build has made."""
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return out / done.stdout.splitlines()[-1]
