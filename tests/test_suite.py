"""The tests as a whole: what tests/conftest.py promises of each."""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PART = """
def which(first):
    if first:
        return 1
    return 2
"""
SUITE = """
import pytest
from simbase.part import which

@pytest.mark.parametrize("first", {ways})
def test_way(first):
    assert which(first) == 2 - first
"""


@pytest.mark.parametrize("workers", [[], ["-n", "2"]], ids=["one process", "two workers"])
@pytest.mark.parametrize(("ways", "missed"), [("[0, 1]", ([], [])), ("[0, 0]", ([4], [[3, 4]]))], ids=["both", "one"])
def test_lines_and_branches_that_no_test_of_any_worker_reaches_are_counted(
    tmp_path: Path, workers: list[str], ways: str, missed: tuple[list[int], list[list[int]]]
) -> None:
    for name in ("tests/conftest.py", "pyproject.toml"):
        (tmp_path / Path(name).name).write_bytes((ROOT / name).read_bytes())
    for package in tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["slipcover"]["source"]:
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").touch()
    (tmp_path / "simbase" / "part.py").write_text(PART)
    (tmp_path / "test_all.py").write_text(SUITE.format(ways=ways))
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("SLIPCOVER", "PYTEST"))}
    options = ["--json", "--out", "lines.json", "-m", "pytest", "-p", "no:cacheprovider", *workers, "test_all.py"]
    done = subprocess.run(
        [sys.executable, "-m", "slipcover", *options],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads((tmp_path / "lines.json").read_text())["files"]["simbase/part.py"]
    assert (found["missing_lines"], found["missing_branches"]) == missed


def test_children_keep_the_modules_that_they_compile(tmp_path: Path) -> None:
    (tmp_path / "compiled.py").write_text("")
    code = "import compiled; from pathlib import Path; assert Path(compiled.__cached__).is_file()"
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, timeout=60)
    assert not sys.dont_write_bytecode
