"""How much processor time each file of tests takes: `pytest --count-time FILE`, a line a file, the most first.

Processor time, for what else the machine does changes it little; that of processes that a test has started and
waited for is in it. What a worker does once for many tests, imports and fixtures, stands where it was done first.
"""

import resource
from collections import Counter
from collections.abc import Generator
from pathlib import Path

import pytest

from tests.tools import forked_python


def spent_s() -> float:
    """Return the processor time so far of this process, of those that it has waited for, and of forked_python's."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used) + forked_python.spent_s()


class TimeCounter:
    """A plugin of pytest; each worker notes the time in its reports, and who collects them writes the file."""

    def __init__(self, path: Path, *, is_worker: bool) -> None:
        self._path, self._is_worker = path, is_worker
        self._since_s = 0.0
        self._spent, self._tests = Counter[str](), Counter[str]()

    def pytest_runtest_logstart(self) -> None:
        """Begin a test."""
        self._since_s = spent_s()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Note what a phase has taken, from the end of the one before."""
        report = yield
        now_s = spent_s()
        report.spent_s = now_s - self._since_s
        self._since_s = now_s
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add up."""
        file = report.nodeid.partition("::")[0]
        self._spent[file] += getattr(report, "spent_s", 0.0)
        self._tests[file] += report.when == "call"

    def pytest_sessionfinish(self) -> None:
        """Write the table."""
        if not self._is_worker:
            rows = [(spent, self._tests[file], file) for file, spent in self._spent.most_common()]
            rows.append((self._spent.total(), self._tests.total(), "all"))
            lines = [f"{spent:8.1f} s {tests:6} tests  {file}\n" for spent, tests, file in rows]
            self._path.write_text("".join(lines), encoding="utf-8")
