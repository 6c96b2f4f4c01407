"""Which tests read a real clock is found in their code, and in what they call."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.tools.suite import real_clock
from tests.tools.suite.real_clock import ROOT

HELPER = """
import time
def waits(): time.sleep(1)
class Peer:
    def ends(self): return time.monotonic()
def pure(): pass
"""
TESTS = """
import time as clock
from time import monotonic
import pytest
from tests.helper import waits, pure, Peer as Other

def until(): return waits()
def loop(): return loop() or pure()
@pytest.fixture
def peer(): return Other()
def test_by_itself(): assert monotonic()
def test_by_another_name(): clock.sleep(0)
def test_by_a_helper_of_a_helper(): until()
def test_by_a_class(): Other()
def test_by_a_fixture(peer): pass
def test_by_a_folders_fixture(served): pass
def test_in_a_method_of_what_it_calls(): assert [until for _ in range(3)]
def test_without(): pure()
def test_that_goes_round(): loop()
def test_of_another_time(): timeless = 1; assert timeless
"""


def test_a_test_that_reads_a_clock_by_whatever_way_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(real_clock, "ROOT", tmp_path)
    folder = tmp_path / "tests"
    folder.mkdir()
    (folder / "helper.py").write_text(HELPER)
    (folder / "conftest.py").write_text("from tests.helper import Peer\ndef served(): return Peer()\n")
    (folder / "test_all.py").write_text(TESTS)
    named = [line[4 : line.index("(")] for line in TESTS.splitlines() if line.startswith("def test")]
    found = [name for name in named if real_clock.reads_clock(folder / "test_all.py", name)]
    assert named[len(found) :] == ["test_without", "test_that_goes_round", "test_of_another_time"]
    assert found == named[: len(found)]
    assert [name for name in reversed(named) if real_clock.reads_clock(folder / "test_all.py", name)] == found[::-1]


def names_of(*words: str) -> set[str]:
    """Return the tests of a file that pytest would run."""
    path = ROOT / "tests/p2os/cli/test_printing.py"
    command = [sys.executable, "-m", "pytest", "--collect-only", "-n", "0", "-p", "no:cacheprovider", path]
    done = subprocess.run([*command, *words], cwd=ROOT, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    return {line for line in done.stdout.splitlines() if "::" in line}


def test_a_run_may_take_them_alone_or_leave_them_out() -> None:
    alone, others = (
        names_of("-m", "real_clock"),
        names_of("-m", "not real_clock"),
    )
    assert alone
    assert others
    assert not alone & others
