"""What `make steady` repeats."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.tools.suite.steady import ROOT

TESTS = """
from pathlib import Path
import pytest

LINES = Path("lines")

@pytest.fixture
def made(tmp_path):
    tmp_path.joinpath("new").touch(exist_ok=False)
    yield LINES.open("a")
    LINES.open("a").write("down ")

def test_alone(made):
    made.write("up ")
    made.close()
    assert len(LINES.read_text().split()) != 3
"""


@pytest.mark.slow
def test_each_time_a_test_gets_what_it_wants_anew_and_each_failure_is_named(tmp_path: Path) -> None:
    (tmp_path / "test_it.py").write_text(TESTS, encoding="utf-8")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    words = ["-p", "tests.tools.suite.steady", "--times", "3", "-p", "no:cacheprovider", "-q"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *words, "test_it.py"], cwd=tmp_path,
        env={**environment, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (tmp_path / "lines").read_text(encoding="utf-8") == "up down " * 3
    assert "1 failed, 2 passed" in done.stdout, done.stdout + done.stderr
    assert done.stdout.count("FAILED test_it.py::test_alone") == 1
