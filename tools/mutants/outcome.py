"""A plugin of pytest: writes what a run has found as JSON, where P2OS_MUTANTS_OUTCOME says.

`failed`: the tests that did not pass, in order; `seconds`: how long they kept a processor busy together, collected and
started.
"""

import json
import os
import resource
from pathlib import Path

import pytest

#: The variable that names the file.
OUTCOME_FILE = "P2OS_MUTANTS_OUTCOME"


class OutcomeReport:
    """What one run has found."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._failed: dict[str, None] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a phase of a test."""
        if report.failed:
            self._failed[report.nodeid] = None

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note a file that cannot be collected."""
        if report.failed:
            self._failed[report.nodeid] = None

    def pytest_sessionfinish(self) -> None:
        """Write."""
        used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        seconds = sum(each.ru_utime + each.ru_stime for each in used)
        self._file.write_text(json.dumps({"failed": [*self._failed], "seconds": seconds}), encoding="utf-8")


def reported_by(file: Path) -> tuple[tuple[str, ...], float]:
    """Return what a run has reported: who failed, and seconds; nothing where it was ended."""
    if not file.exists():
        return (), 0.0
    found = json.loads(file.read_text(encoding="utf-8"))
    return tuple(found["failed"]), float(found["seconds"])


def pytest_configure(config: pytest.Config) -> None:
    """Listen, in a run that is to tell."""
    if file := os.environ.get(OUTCOME_FILE):
        config.pluginmanager.register(OutcomeReport(Path(file)))
