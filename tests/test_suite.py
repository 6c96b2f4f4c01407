"""The tests as a whole: what tests/conftest.py promises of each."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import settings

from tests.tools.forked_python import PYTEST, forked_python
from tools.check_coverage import merged

ROOT = Path(__file__).parents[1]
#: What a run of tests of its own needs of ours.
OWN = (
    "pyproject.toml",
    "tests/conftest.py",
    "tests/tools/installed.py",
    *(
        f"tests/tools/suite/{name}.py"
        for name in ("fewer_examples", "fewer_messages", "forked_workers", "forked_workers_client")
    ),
)
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
LEFT = """
import os, pytest
def left(name):
    with open(f"{name}.ran", "x") as file:
        file.write(str("PYTEST_XDIST_WORKER" in os.environ))
"""


@pytest.mark.parametrize(
    "workers",
    [pytest.param(["-n", "0"], marks=pytest.mark.soak, id="one process"), pytest.param(["-n", "2"], id="two workers")],
)
@pytest.mark.parametrize(("ways", "missed"), [("[0, 1]", ([], [])), ("[0, 0]", ([4], [(3, 4)]))], ids=["both", "one"])
def test_lines_and_branches_that_no_test_of_any_worker_reaches_are_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers: list[str], ways: str,
    missed: tuple[list[int], list[tuple[int, int]]],
) -> None:  # fmt: skip
    for name in ("tests/tools/counted_lines.py", *OWN):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    (tmp_path / "simbase").mkdir()
    for name, text in (("__init__", ""), ("part", PART), ("unseen", PART)):
        (tmp_path / "simbase" / f"{name}.py").write_text(text)
    (tmp_path / "tests" / "test_all.py").write_text(SUITE.format(ways=ways))
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    options = ["-p", "no:cacheprovider", "--count-lines", "lines", *workers]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    monkeypatch.chdir(tmp_path)
    files = merged(Path("lines"))
    found = files["simbase/part.py"]
    assert (found["missing_lines"], found["missing_branches"]) == missed
    assert files["simbase/unseen.py"]["missing_lines"] == [2, 3, 4, 5]


def test_children_keep_the_modules_that_they_compile(tmp_path: Path) -> None:
    (tmp_path / "compiled.py").write_text("")
    code = "import compiled; from pathlib import Path; assert Path(compiled.__cached__).is_file()"
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, timeout=60)
    assert not sys.dont_write_bytecode


@pytest.mark.parametrize(
    ("options", "ran", "in_workers"),
    [
        (["tests"], ["quick"], True),
        ([], ["quick"], True),
        (["tests", "tests/test_all.py"], ["quick"], True),
        (["tests", "-n", "0"], ["quick"], False),
        (["tests", "-s"], ["quick"], False),
        (["tests", "--pdb"], ["quick"], False),
        (["tests/test_all.py"], ["quick", "slow"], False),
        (["tests/test_all.py::test_slow"], ["slow"], False),
        (["tests/test_all.py", "-n", "1"], ["quick", "slow"], True),
        (["tests", "-m", "slow", "-n", "0"], ["slow"], False),
        (["tests", "-m", "not soak and not hardware", "-n", "0"], ["quick", "slow"], False),
        (["tests/test_all.py", "-m", "soak or hardware"], ["soak", "hardware"], False),
    ],
)
def test_a_run_of_folders_leaves_out_long_tests_and_uses_all_cores(
    tmp_path: Path, options: list[str], ran: list[str], in_workers: bool
) -> None:
    for name in OWN:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    names = ("quick", "slow", "soak", "hardware")
    marks = ("", *(f"@pytest.mark.{name}" for name in names[1:]))
    tests = (f"{mark}\ndef test_{name}(): left('{name}')\n" for name, mark in zip(names, marks, strict=True))
    (tmp_path / "tests" / "test_all.py").write_text(LEFT + "".join(tests))
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    line = [forked_python(), "-c", PYTEST, "-p", "no:cacheprovider", *options]
    done = subprocess.run(line, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    found = {name: path.read_text() for name in names if (path := tmp_path / f"{name}.ran").exists()}
    assert found == {name: str(in_workers) for name in ran}


def test_the_profile_alone_says_that_no_example_has_a_bound_in_time() -> None:
    own = {path for path in (ROOT / "tests").rglob("*.py") if path.name not in {"conftest.py", "test_suite.py"}}
    assert [path.name for path in sorted(own) if "deadline=None" in path.read_text(encoding="utf-8")] == []
    assert settings.default is not None
    assert settings.default.deadline is None
