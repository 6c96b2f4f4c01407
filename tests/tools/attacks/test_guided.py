"""Inputs that searches guided by coverage have kept are read as ever; `tools/fuzz/guided.py` searches."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from tools.fuzz import chip, guided, protocol

NAMES = guided.names()
#: Formats of files begin at files that are right, which is more than 256 bytes can be.
KEPT = (*protocol.TARGETS, *chip.TARGETS)
ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("name", KEPT)
def test_what_was_kept_of_a_target_is_read(name: str) -> None:
    if name == "columns":
        pytest.importorskip("numpy")
    target, _ = guided.chosen(name)
    inputs = guided.kept(name)
    assert inputs, "search and keep: python -m tools.fuzz.guided TARGET --keep"
    for data in inputs:
        target(data)


@pytest.mark.parametrize("name", NAMES)
def test_a_search_begins_at_what_is_right(name: str) -> None:
    _, seeds = guided.chosen(name)
    assert guided.begins_with(seeds), "it would have to find a whole file by itself"


def test_every_target_has_a_name_of_its_own() -> None:
    assert len(NAMES) == len({*NAMES})


def test_a_search_begins_at_short_seeds_or_else_the_shortest() -> None:
    short, long, longer = (bytes(guided.LONGEST_SEARCHED + more) for more in (0, 1, 2))
    assert guided.begins_with([b"", short, long]) == [b"", short]
    assert guided.begins_with([longer, long]) == [long]
    assert guided.begins_with([]) == []


@pytest.mark.parametrize("name", chip.TARGETS)
def test_a_target_beside_the_chip_takes_nothing_and_its_seeds(name: str) -> None:
    for data in (b"", *chip.seeds(name)):
        chip.TARGETS[name](data)


def test_what_is_kept_stays_small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert {path.stem for path in guided.CORPUS.iterdir()} == {*KEPT}
    assert sum(path.stat().st_size for path in guided.CORPUS.iterdir()) <= 256 * 1024
    monkeypatch.setattr(guided, "CORPUS", tmp_path / "corpus")
    guided.keep("gdb", [bytes(number) for number in range(guided.LONGEST_KEPT + 10)] * 2)
    assert guided.kept("gdb") == [bytes(number) for number in range(guided.MOST_KEPT)]
    guided.keep("gdb", [b"x" * guided.LONGEST_KEPT, b"y" * (guided.LONGEST_KEPT + 1)])
    assert guided.kept("gdb") == [b"x" * guided.LONGEST_KEPT]


def test_a_target_that_is_none_is_refused() -> None:
    words = [sys.executable, "-m", "tools.fuzz.guided", "nothing"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 2
    assert "no target nothing" in done.stderr


@pytest.mark.soak
@pytest.mark.skipif(importlib.util.find_spec("atheris") is None, reason="atheris is not installed")
@pytest.mark.parametrize("name", NAMES)
def test_two_minutes_of_search_find_nothing(name: str) -> None:
    code, came_to = guided.searched(name, 120)
    assert code == 0, came_to
