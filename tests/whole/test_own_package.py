"""docs/plug-ins.md: the package of a user, as the page prints it, beside what is installed."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.documentation.page import ROOT, Page


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the package, as pip leaves it: its module, and metadata of what its pyproject.toml declares."""
    folder = tmp_path_factory.mktemp("own")
    for block in Page(ROOT / "docs" / "plug-ins.md").blocks:
        name = block.text.partition("\n")[0].removeprefix("# ")
        if name.endswith((".py", ".toml")):
            target = folder / "site" / name if name.endswith(".py") else folder / name
            target.parent.mkdir(exist_ok=True)
            target.write_text(block.text, encoding="utf-8")
    project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    info = folder / "site" / "my_things-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 1.0\n")
    rows = [
        row
        for group, points in project["entry-points"].items()
        for row in (f"[{group}]", *(f"{name} = {value}" for name, value in points.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(rows))
    return folder


def p2os(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run the command line there."""
    return subprocess.run(
        [sys.executable, "-P", "-m", "p2os", *words], cwd=folder, capture_output=True, text=True, check=False,
        timeout=60, env={**os.environ, "PYTHONPATH": str(folder / "site"), "COLUMNS": "80"},
    )  # fmt: skip


def test_the_verb_is_there_in_its_group(folder: Path) -> None:
    assert p2os(folder, "hello", "--name", "rover").stdout == "hello, rover\n"
    pages = p2os(folder, "--help").stdout
    assert "Others:" not in pages
    robots = pages.partition("Robots:")[2].partition(":\n")[0]
    assert re.search(r"(?m)^  hello +Say hello to a robot$", robots)


@pytest.mark.slow
def test_the_goal_judges_a_run_with_the_body(folder: Path) -> None:
    assert p2os(folder, "check", "mine.toml").stdout == "ok     mine.toml: 1 s of motors.elf in room, 1 goals\n"
    done = p2os(folder, "run", "mine.toml", "--out", "run")
    assert (done.returncode, "met     stays east of x -0.5 m" in done.stdout) == (0, True), done.stdout + done.stderr
    assert '"tiring"' in (folder / "run" / "summary.json").read_text(encoding="utf-8")
    text = (folder / "mine.toml").read_text(encoding="utf-8")
    (folder / "far.toml").write_text(text.replace("x_m = -0.5", "x_m = 90"))
    done = p2os(folder, "run", "far.toml", "--out", "far")
    assert (done.returncode, "x was " in done.stdout) == (1, True), done.stdout + done.stderr
    (folder / "wrong.toml").write_text(text.replace("x_m", "y_m"))
    assert p2os(folder, "check", "wrong.toml").stdout.startswith("wrong  wrong.toml:")
