"""The table of foreign programs and what runs it: rows are well formed, what is missing is said, nothing is left."""

import json
import os
import re
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from p2os.robots.parameters import known_robots
from tools.foreign.__main__ import main
from tools.foreign.cache import default_cache
from tools.foreign.isolation import LeftError, isolated
from tools.foreign.page import PAGE, record, recorded, written
from tools.foreign.row import ProgramKind, Result, Row, RowError, RowPlace, RowStatus, Source
from tools.foreign.rows.table import ROWS
from tools.foreign.running import run

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and terminals are Unix's")
SOURCE = Source(folder="theirs", url="https://example.org/theirs", commit="0123456789" * 4)


@dataclass(frozen=True)
class Says:
    """A judge that does as it is told."""

    does: Callable[[RowPlace], str]
    needs: tuple[str, ...] = ()

    def run(self, place: RowPlace) -> str:
        return self.does(place)


def row(
    does: Callable[[RowPlace], str], *needs: str, name: str = "theirs", limit_s: float = 20.0, tried: str = ""
) -> Row:
    return Row(
        name=name, kind=ProgramKind.FIRMWARE, source=SOURCE,
        program="theirs", said="something", judge=Says(does, needs),
        limit_s=limit_s, tried=tried,
    )  # fmt: skip


def fails(_place: RowPlace) -> str:
    raise RowError("it said 41")


# The table.


def test_names_are_those_of_no_other_row() -> None:
    names = [one.name for one in ROWS]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[\w-]+", name) for name in names)
    assert not {kind.value for kind in ProgramKind} & set(names)


def test_a_row_has_a_public_source_with_its_commit_or_version() -> None:
    for one in ROWS:
        source = one.source
        if source.url:
            assert source.url.startswith("https://"), one.name
            assert re.fullmatch(r"[0-9a-f]{40}|\d+(\.\d+)+", source.commit), one.name
        assert one.program, one.name
        assert one.said, one.name


def test_a_row_needs_something_that_is_not_in_this_repository() -> None:
    for one in ROWS:
        assert one.all_needs, one.name
        assert all(not need.startswith(("..", "~")) for need in one.all_needs), one.name


def test_there_are_fifteen_rows_of_firmware_and_twelve_of_clients() -> None:
    kinds = [one.kind for one in ROWS]
    assert kinds.count(ProgramKind.FIRMWARE) >= 15
    assert kinds.count(ProgramKind.CLIENT) >= 12


def test_the_page_has_the_table_as_it_was_run_last() -> None:
    assert written(PAGE.read_text(), ROWS, recorded()) == PAGE.read_text(), "make generated"


# A row.


def test_a_row_passes_by_what_came_back(tmp_path: Path) -> None:
    result = run(row(lambda _: "42"), tmp_path, tmp_path / "log")
    assert (result.status, result.text) == (RowStatus.PASSED, "42")


def test_a_wrong_answer_fails_the_row_with_what_was_said(tmp_path: Path) -> None:
    result = run(row(fails), tmp_path, tmp_path / "log")
    assert (result.status, result.text) == (RowStatus.FAILED, "it said 41")


def test_a_judge_that_breaks_fails_its_row(tmp_path: Path) -> None:
    result = run(row(lambda _: str(1 // 0)), tmp_path, tmp_path / "log")
    assert (result.status, result.text.split(":")[0]) == (RowStatus.FAILED, "ZeroDivisionError")
    assert "Traceback" in (tmp_path / "log/theirs.txt").read_text()


def test_what_is_not_there_is_said_with_what_was_tried(tmp_path: Path) -> None:
    one = row(fails, "theirs/image.elf", "no-such-program", tried="its build needs the network")
    result = run(one, tmp_path, tmp_path / "log")
    assert result.status is RowStatus.MISSING
    assert result.text == "no theirs/image.elf, no-such-program; its build needs the network"


@pytest.mark.parametrize(("ends", "said"), [("exit 3", "build ended with 3: cc: no such file"), ("exit 0", "")])
def test_the_users_build_is_run_where_something_is_missing(tmp_path: Path, ends: str, said: str) -> None:
    script = tmp_path / "theirs/build"
    script.parent.mkdir()
    script.write_text(f"#!/bin/sh\necho ran >> runs\necho 'cc: no such file'\n{ends}\n")
    script.chmod(0o755)
    result = run(row(fails, "theirs/image.elf"), tmp_path, tmp_path / "log")
    assert result.text == "; ".join(["no theirs/image.elf", *([said] if said else [])])
    assert (tmp_path / "theirs/runs").read_text() == "ran\n"
    (tmp_path / "theirs/image.elf").write_text("")
    assert run(row(lambda _: "42", "theirs/image.elf"), tmp_path, tmp_path / "log").status is RowStatus.PASSED
    assert (tmp_path / "theirs/runs").read_text() == "ran\n"


def test_another_commit_than_the_rows_is_noted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "getloadavg", lambda: (0.0, 0.0, 0.0))
    note = tmp_path / "theirs/COMMIT"
    note.parent.mkdir()
    for commit, notes in ((SOURCE.commit, ()), (SOURCE.commit[:12], ()), ("f" * 40, ("of commit ffffffffffff",))):
        note.write_text(f"{commit}\n")
        assert run(row(lambda _: "42"), tmp_path, tmp_path / "log").notes == notes


# What it leaves.


def test_a_row_that_does_not_end_is_ended_with_all_that_it_started(tmp_path: Path) -> None:
    def never(_place: RowPlace) -> str:
        if not os.fork():
            os.setsid()
            (tmp_path / "pid").write_text(str(os.getpid()))
            time.sleep(60)
        time.sleep(60)
        return ""

    began = time.monotonic()
    result = run(row(never, limit_s=0.3), tmp_path, tmp_path / "log")
    assert (result.status, result.text) == (RowStatus.FAILED, "not done within 0.3 s")
    assert time.monotonic() - began < 10
    assert not Path(f"/proc/{(tmp_path / 'pid').read_text()}").exists()


def test_what_a_row_started_does_not_outlive_its_end(tmp_path: Path) -> None:
    def starts(_place: RowPlace) -> str:
        child = os.fork()
        if not child:
            os.setsid()
            time.sleep(60)
        return str(child)

    result = run(row(starts), tmp_path, tmp_path / "log")
    assert result.status is RowStatus.PASSED
    assert not Path(f"/proc/{result.text}").exists()


def test_a_row_whose_process_dies_fails(tmp_path: Path) -> None:
    with pytest.raises(LeftError, match="its process died"):
        isolated(lambda: str(os._exit(0)), 10.0, tmp_path / "log")


# The command.


def test_the_exit_code_tells_of_a_row_that_fails_and_not_of_one_that_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good, bad = row(lambda _: "42", name="good"), row(fails, name="bad")
    missing = row(fails, "theirs/image.elf", name="gone")
    assert main(["--cache", str(tmp_path)], [good, missing]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "1 passed, 0 failed, 1 missing"
    assert main(["--cache", str(tmp_path), "good,bad"], [good, missing, bad]) == 1
    shown = capsys.readouterr().out
    assert "it said 41" in shown
    assert shown.splitlines()[-1] == "1 passed, 1 failed, 0 missing"
    assert max(map(len, shown.splitlines())) <= 80


def test_results_are_noted_beside_those_of_other_rows(tmp_path: Path) -> None:
    file = tmp_path / "results.json"
    record([Result("a", RowStatus.PASSED, "1", 1.0), Result("b", RowStatus.PASSED, "2", 1.0)], file)
    record([Result("b", RowStatus.FAILED, "3", 1.0)], file)
    assert [(one.name, one.text, one.before) for one in recorded(file)] == [("a", "1", ""), ("b", "3", "passed in 1 s")]
    json.loads(file.read_text())


def test_the_page_says_how_a_row_ended_and_what_was_found() -> None:
    one = replace(row(fails), found="a register")
    page = "x\n<!-- table: foreign firmware -->\nold\n<!-- end -->\ny\n"
    made = written(page, [one], [Result("theirs", RowStatus.PASSED, "a | b", 3.2)])
    assert "| 3 s. Found: a register |" in made
    late = Result("theirs", RowStatus.FAILED, "a | b", 3.2, ("on a busy machine",), before="passed in 2 s")
    assert "| failed in 3 s: a \\| b, busy. Found: a register |" in written(page, [one], [late])
    assert "old" not in made
    assert (made[:2], made[-2:]) == ("x\n", "y\n")
    assert "| not run" in written(page, [row(fails)], [])


@pytest.mark.parametrize("words", [["nobody"], ["--client", "empty="], ["--client", "mine"], ["--robot", "r2d2"]])
def test_a_name_that_means_nothing_is_wrong_usage(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words, [row(fails)])
    assert ended.value.code == 2
    assert words[-1].split("=")[0] in capsys.readouterr().err


def test_a_client_of_the_users_meets_each_robot_that_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--cache", str(tmp_path), "--client", "mine=/no/such/program {host}", "--robot", "all"]
    assert main(words, [row(fails)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert all(f"mine-{model}: no /no/such/program" in shown for model in known_robots())


def test_the_cache_is_outside_the_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/elsewhere")
    assert default_cache() == Path("/elsewhere/p2os-foreign")


@pytest.mark.parametrize(("load", "is_said"), [(2.0, False), (2.1, True)])
def test_a_row_says_that_the_machine_had_no_processor_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, load: float, is_said: bool
) -> None:
    monkeypatch.setattr(os, "getloadavg", lambda: (load, 0.0, 0.0))
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    found = run(row(lambda _: "4 answers"), tmp_path, tmp_path / "log")
    notes = ("on a busy machine: 2.1 processes ready for 2 processors",) if is_said else ()
    assert (found.status, found.notes) == (RowStatus.PASSED, notes)
