"""Lines are counted by probes in code that is kept, and each probe reports once."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.tools.counted_lines import IS_IN_CODE, KEPT, Counter, keep, keep_all

SOURCE = """
def first(values):
    return [value for value in values
            if value > 2]

class Part:
    def which(self, far):
        if far:
            return first([1, 3])
        return None
"""

needs_probes = pytest.mark.skipif(not IS_IN_CODE, reason="the interpreter takes probes out")


@pytest.fixture
def module(tmp_path: Path) -> Path:
    path = tmp_path / "simbase" / "part.py"
    path.parent.mkdir()
    path.write_text(SOURCE)
    return path


def labels(counter: Counter, module: Path) -> set[object]:
    return set(counter.seen().get(str(module), []))


@needs_probes
def test_a_probe_reports_once_and_then_is_jumped_over(module: Path, tmp_path: Path) -> None:
    counter = Counter(tmp_path)
    names: dict[str, object] = {}
    exec(counter.code_of(module), names)  # noqa: S102 - a module of the test's own
    assert labels(counter, module) == {2, 6, 7}
    part = names["Part"]()  # type: ignore[operator]  # the class of the module
    assert part.which(0) is None
    assert labels(counter, module) == {2, 6, 7, 8, 10, (8, 10)}
    assert part.which(1) == [3]
    assert labels(counter, module) == {2, 3, 4, 6, 7, 8, 9, 10, (8, 9), (8, 10)}
    assert (part.which(0), part.which(1)) == (None, [3])
    ((_, newly_seen, _),) = counter._counted
    assert newly_seen == set()


@needs_probes
def test_a_probe_that_was_put_back_reports_again_and_to_the_next_alone(module: Path, tmp_path: Path) -> None:
    counter = Counter(tmp_path)
    names: dict[str, object] = {}
    exec(counter.code_of(module), names)  # noqa: S102 - a module of the test's own
    assert counter.lines_since() == {str(module): [2, 6, 7]}
    for _ in range(2):
        assert names["first"]([1, 3]) == [3]  # type: ignore[operator]  # the function of the module
        counter.take_out_seen()
        assert counter.lines_since() == {str(module): [3, 4]}
    assert counter.lines_since() == {}
    assert labels(counter, module) == {2, 3, 4, 6, 7}


@needs_probes
def test_kept_code_is_that_of_the_source_as_it_is_now(module: Path, tmp_path: Path) -> None:
    kept = keep(module, tmp_path)
    made_at = kept.stat().st_mtime_ns
    assert keep(module, tmp_path) == kept
    assert kept.stat().st_mtime_ns == made_at
    module.write_text(SOURCE.replace("None", "0"))
    other = Counter(tmp_path)
    names: dict[str, object] = {}
    exec(other.code_of(module), names)  # noqa: S102 - a module of the test's own
    assert names["Part"]().which(0) == 0  # type: ignore[operator]  # the class of the module
    assert len([*(tmp_path / KEPT).iterdir()]) == 2


@needs_probes
def test_what_is_of_no_source_any_more_is_dropped(module: Path, tmp_path: Path) -> None:
    old = keep(module, tmp_path)
    module.write_text(SOURCE.replace("None", "0"))
    keep_all(tmp_path)
    assert [*(tmp_path / KEPT).iterdir()] == [keep(module, tmp_path)]
    assert not old.exists()


def test_a_folder_of_tests_that_is_named_counts_in_the_modules_that_its_conftest_imports(tmp_path: Path) -> None:
    root = Path(__file__).parents[2]
    named = (
        "tests/bluepill_sim/core/test_block_log.py::test_a_branch_to_itself_is_kept_once_and_again_after_an_interrupt"
    )
    run = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "--count-lines", str(tmp_path / "seen"), named]
    done = subprocess.run(run, cwd=root, env=os.environ, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout[-2000:]
    (by_test,) = (tmp_path / "seen" / "by_test").glob("*.json")
    reported = json.loads(by_test.read_text(encoding="utf-8"))
    assert {*reported} == {named.partition("::")[0]}
    (seen,) = (tmp_path / "seen").glob("*.json")
    assert str(root / "bluepill_sim" / "chip.py") in json.loads(seen.read_text())
