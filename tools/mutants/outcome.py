"""A plugin of pytest: writes what a run has found as JSON, where P2OS_MUTANTS_OUTCOME says, and keeps it in its bounds.

`failed`: the tests that did not pass, in order; `files`: how long each file of tests that was run to its end kept a
processor busy. Beside it, in `….now`, the test that runs: a run that is ended says no more.
"""

import json
import os
import resource
import signal
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path

import pytest

#: The variables that name the file, and seconds of a processor: when no other test begins, and what one has.
OUTCOME_FILE, BUDGET_S, TEST_S = "P2OS_MUTANTS_OUTCOME", "P2OS_MUTANTS_BUDGET_S", "P2OS_MUTANTS_TEST_S"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunReport:
    """What a run has found."""

    failed: tuple[str, ...] = ()
    #: By file of tests, seconds of a processor.
    files: dict[str, float]
    #: The test that ran last.
    last: str = ""
    #: Whether tests were left for their time, and none had failed.
    is_stopped: bool = False


class OutcomeReport:
    """What one run has found so far."""

    def __init__(self, file: Path, budget_s: float, test_s: float) -> None:
        self._file, self._budget_s, self._test_s = file, budget_s, test_s
        self._now = os.open(_now_file(file), os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC)
        self._failed: dict[str, None] = {}
        self._began: dict[str, float] = {}  # a file of tests, and when its first began
        self._ended_s, self._is_stopped = 0.0, False

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Run files in the order in which they are named: a project sorts its tests otherwise."""
        places = {name.partition("::")[0]: place for place, name in reversed([*enumerate(config.args)])}
        items.sort(key=lambda item: places.get(item.nodeid.partition("::")[0], len(places)))

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Note a test, and end the process where it does not end."""
        self._began.setdefault(nodeid.partition("::")[0], _spent_s())
        os.pwrite(self._now, f"{nodeid}\n".encode(), 0)
        signal.setitimer(signal.ITIMER_PROF, self._test_s)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a phase of a test."""
        if report.failed:
            self._failed[report.nodeid] = None

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note a file that cannot be collected."""
        if report.failed:
            self._failed[report.nodeid] = None

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(
        self, item: pytest.Item, nextitem: pytest.Item | None
    ) -> Generator[None, object, object]:
        """Begin no other test where the time is over."""
        done = yield
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        if nextitem is not None and _spent_s() > self._budget_s:
            item.session.shouldstop = "the time is over"
            self._is_stopped = True
        return done

    def pytest_sessionfinish(self) -> None:
        """Write."""
        starts = [*self._began.values(), _spent_s()]
        files = {file: starts[place + 1] - starts[place] for place, file in enumerate(self._began)}
        if files and (self._is_stopped or self._failed):
            files.popitem()
        found = {"failed": [*self._failed], "files": files, "is_stopped": self._is_stopped and not self._failed}
        self._file.write_text(json.dumps(found), encoding="utf-8")


def _spent_s() -> float:
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def _now_file(file: Path) -> Path:
    return file.with_suffix(".now")


def clear(file: Path) -> None:
    """Forget what a run before has reported."""
    for each in (file, _now_file(file)):
        each.unlink(missing_ok=True)


def reported_by(file: Path) -> RunReport:
    """Return what a run has reported; of one that was ended, the test that it was at."""
    now = _now_file(file)
    last = now.read_bytes().partition(b"\n")[0].decode() if now.exists() else ""
    if not file.exists():
        return RunReport(files={}, last=last)
    found = json.loads(file.read_text(encoding="utf-8"))
    return RunReport(
        failed=tuple(found["failed"]), files=found["files"], last=last, is_stopped=bool(found["is_stopped"])
    )


def pytest_configure(config: pytest.Config) -> None:
    """Listen, in a run that is to tell."""
    if file := os.environ.get(OUTCOME_FILE):
        report = OutcomeReport(Path(file), float(os.environ[BUDGET_S]), float(os.environ[TEST_S]))
        config.pluginmanager.register(report)
