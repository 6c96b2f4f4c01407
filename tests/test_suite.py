"""The tests as a whole: what tests/conftest.py promises of each."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SUITE = """
import sys
import pytest
from hypothesis import given, strategies as st

def test_quick(request):
    assert not request.node.get_closest_marker("no_cover")

@given(st.booleans())
def test_repeating(value):
    assert sys.gettrace() is None

@pytest.mark.slow
def test_long(request):
    assert request.node.get_closest_marker("no_cover")
    assert sys.gettrace() is None

def test_that_ends_the_tracing():
    sys.settrace(None)

@pytest.mark.no_cover
def test_that_ends_its_own_tracing():
    sys.settrace(None)

def test_after_it_is_traced():
    assert sys.gettrace() is not None
"""


@pytest.mark.parametrize("workers", [[], ["-n", "1"]], ids=["one process", "a worker"])
def test_quick_tests_alone_are_traced_and_none_may_end_it(tmp_path: Path, workers: list[str]) -> None:
    for name in ("tests/conftest.py", "pyproject.toml"):
        (tmp_path / Path(name).name).write_bytes((ROOT / name).read_bytes())
    (tmp_path / "test_all.py").write_text(SUITE)
    options = ["-p", "no:cacheprovider", "-vv", "--cov", "--cov-report=", *workers]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, "test_all.py"],
        cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    told = re.findall(r"(?m)^(?:\[gw0\].*(PASSED|FAILED) )?test_all.py::(\w+)(?: (PASSED|FAILED))?", done.stdout)
    assert [(name, before or after) for before, name, after in told if before or after] == [
        ("test_long", "PASSED"),
        ("test_quick", "PASSED"),
        ("test_repeating", "PASSED"),
        ("test_that_ends_the_tracing", "FAILED"),
        ("test_that_ends_its_own_tracing", "PASSED"),
        ("test_after_it_is_traced", "PASSED"),
    ], done.stdout


def test_children_keep_the_modules_that_they_compile(tmp_path: Path) -> None:
    (tmp_path / "compiled.py").write_text("")
    code = "import compiled; from pathlib import Path; assert Path(compiled.__cached__).is_file()"
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, timeout=60)
    assert not sys.dont_write_bytecode
