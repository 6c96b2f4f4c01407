"""Distributions built and installed as pip does, with the build's own tools from a package index."""

import os
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

import pytest

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


def python_of(folder: Path, *requirements: str) -> Path:
    """Return the Python of a new environment that holds nothing but what is named."""
    venv.create(folder)
    command = [sys.executable, "-m", "pip", "--python", folder / "bin" / "python", "install"]
    # Compiled is what a test imports, and no more: half of the time otherwise.
    options = ["--quiet", "--disable-pip-version-check", "--no-compile"]
    done = subprocess.run(
        [*command, *options, "-c", CONSTRAINTS, *requirements],
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


def build(builder: Path, sources: Path, kind: str, out: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a step of the build as pip does, in a folder of sources."""
    out.mkdir(exist_ok=True)
    return subprocess.run(
        [builder, "-c", BUILD, f"build_{kind}", out],
        cwd=sources, env=clean_environment(**environment), capture_output=True, text=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip


def built(done: subprocess.CompletedProcess[str], out: Path) -> Path:
    """Return the file that a build has made."""
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return out / done.stdout.splitlines()[-1]
