"""Workers that are forked from the first: one process collects, and each is a worker like any other."""

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.test_suite import OWN, ROOT
from tests.tools.suite import fewer_messages

SUITE = """
import os, random, time
from pathlib import Path
import pytest

NOTES = Path(__file__).parent / "notes"
def note(text):
    with NOTES.open("a") as file:
        file.write(f"{text}\\n")
note(f"collected {os.getpid()}")
drawn = random.random

@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("own")

@pytest.mark.parametrize("number", range(24))
def test_each(number, folder, worker_id, capfd, request):
    print(f"said by {number}")
    os.write(2, f"written by {number}".encode())
    time.sleep(0.02)  # so that all workers get some
    assert capfd.readouterr() == (f"said by {number}\\n", f"written by {number}")
    assert os.environ["PYTEST_XDIST_WORKER"] == worker_id == request.config.workerinput["workerid"]
    assert folder.parent.name == f"popen-{worker_id}"
    note(f"ran {number} {worker_id} {os.getpid()} {drawn()}")

def test_of_what_is_shown():
    print("shown", "once")
    assert not "a failure"

@pytest.fixture
def ends_badly():
    yield
    raise OSError("at the end")

def test_of_an_end(ends_badly):
    pass

def test_of_a_print():
    print("printed")

def test_of_a_skip():
    pytest.skip("not here")
"""
#: A plug-in, which notes the reports that reach the controller.
REPORTS = """
import os
def pytest_runtest_logreport(report):
    if "PYTEST_XDIST_WORKER" not in os.environ:
        with open("tests/notes", "a") as file:
            file.write(f"report {report.nodeid.rpartition(':')[2]} {report.when} {report.outcome}\\n")
"""
#: A worker that is forked ends at once, and another comes in its place.
CRASH = """
@pytest.mark.parametrize("number", range(24))
def test_end(number, worker_id):
    time.sleep(0.02)
    try:
        os.open(NOTES.with_name("ended"), os.O_CREAT | os.O_EXCL) if worker_id != "gw0" else None
    except FileExistsError:
        return
    if worker_id != "gw0":
        note(f"crash {worker_id} {os.getpid()}")
        os._exit(3)
"""
#: More than the name of a socket may have.
LONG = "long" * 30


def run(folder: Path, suite: str, *options: str) -> tuple[int, str, list[list[str]]]:
    """Return the exit code of a run, what it prints, and what its tests note, in words."""
    for name in OWN:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes((ROOT / name).read_bytes())
    (folder / "tests" / "test_all.py").write_text(suite)
    (folder / "noted_reports.py").write_text(REPORTS)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-p", "noted_reports", *options, "tests"]
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=300)
    notes = (folder / "tests" / "notes").read_text().splitlines()
    return done.returncode, done.stdout + done.stderr, [line.split() for line in notes]


def test_one_process_collects_three_run_under_their_names_and_one_that_crashes_is_replaced(tmp_path: Path) -> None:
    code, said, notes = run(tmp_path, SUITE + CRASH, "-n", "3")
    assert code == 1, said
    assert "2 failed, 49 passed, 1 skipped, 1 error" in said
    assert said.count("shown once") == 1
    assert "said by" not in said
    ran = [note[1:] for note in notes if note[0] == "ran"]
    assert sorted(int(number) for number, *_ in ran) == list(range(24))
    assert len({drawn for *_, drawn in ran}) == 24  # no two draw the same
    (crashed,) = (note[1:] for note in notes if note[0] == "crash")
    assert f"worker '{crashed[0]}' crashed while running" in said
    processes = {(worker, process) for _, worker, process, _ in ran} | {tuple(crashed)}
    names = [worker for worker, _ in processes]
    assert {"gw0", "gw1", "gw2"} <= {*names}
    assert len({*names}) == len(names)
    collected = [note[1] for note in notes if note[0] == "collected"]
    assert len(collected) == 2  # the first, and the one that came instead
    assert collected[0] == next(process for _, worker, process, _ in ran if worker == "gw0")
    reports = [note[1:] for note in notes if note[0] == "report"]
    assert sorted(report for report in reports if report[0].startswith("test_of")) == [
        ["test_of_a_print", "call", "passed"],
        ["test_of_a_print", "teardown", "passed"],
        ["test_of_a_skip", "call", "skipped"],
        ["test_of_an_end", "call", "passed"],
        ["test_of_an_end", "teardown", "failed"],
        ["test_of_what_is_shown", "call", "failed"],
        ["test_of_what_is_shown", "teardown", "passed"],
    ]
    assert {tuple(report[1:]) for report in reports if report[0].startswith("test_each")} == {("call", "passed")}


def test_each_collects_where_the_first_cannot_listen_and_what_cannot_be_collected_is_said_once(tmp_path: Path) -> None:
    code, said, notes = run(tmp_path, f"{SUITE}import none_of_this_name", "-n", "2", "--basetemp", str(tmp_path / LONG))
    assert code == 1, said
    assert said.count("ERROR tests/test_all.py") == 1
    assert [note[0] for note in notes] == ["collected"] * 2


class Hook(list[object]):
    """A hook, as a list of the plug-ins that have one."""

    _remove_plugin = list.remove


@pytest.mark.parametrize(
    ("option", "value"),
    [("verbose", 1), ("xmlpath", "a.xml"), ("durations", 5), ("count_time", "spent.txt"), ("setupshow", True), ("", 0)],
)
def test_all_is_said_where_it_is_asked_for(option: str, value: object) -> None:
    speaker: Any = type("WorkerInteractor", (), {})()
    plugins: list[object] = [object(), speaker]
    hook = SimpleNamespace(pytest_runtest_logreport=Hook(plugins), pytest_runtest_logstart=Hook(plugins))
    manager = SimpleNamespace(get_plugins=lambda: plugins, register=plugins.append)
    config: Any = SimpleNamespace(
        option=SimpleNamespace(**{"verbose": 0, option: value}), pluginmanager=manager, hook=hook
    )
    fewer_messages.register(config)
    assert (speaker in hook.pytest_runtest_logreport) is (speaker in hook.pytest_runtest_logstart) is bool(option)
    assert len(plugins) == (2 if option else 3)
