"""Repeat the tests that read a real clock while the machine is busy: `python -m tests.tools.suite.steady [PATH …]`.

    make steady                      twenty times, at a load of 8
    make steady STEADY="--times 3 tests/p2os/client"

One run collects once and goes through all tests so many times, one round after the other; workers and processes that
never wait make the load, which is printed as it was measured. Prints at the end what has failed, why and how often;
exit code 1 where a test has. None is left out for it.
"""

import argparse
import subprocess
import sys
import threading
from collections import Counter
from contextlib import ExitStack
from copy import copy
from itertools import groupby
from pathlib import Path
from random import Random
from statistics import mean
from typing import Self

import pytest

ROOT = Path(__file__).resolve().parents[3]
#: Ends with who has started it, however that ends.
BUSY = "import os; parent = os.getppid()\nwhile os.getppid() == parent: pass"
#: Of the processes that make the load so many run tests. These wait, too, but what they start does not: one more than
#: the rest would be is busy.
WORKERS = 7
#: How often the load is looked at.
LOOK_S = 1.0
#: How much is shown of a failure.
MOST_TEXT = 3000
#: What the runs below are told by.
OPTION = "--times"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that main() gives."""
    parser.addoption(OPTION, type=int, default=1, help="how often each test runs")


def pytest_configure(config: pytest.Config) -> None:
    """Listen, but in no worker."""
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Failures(config.getoption(OPTION)))


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Have all tests run again and again, by files in an order of each round: what runs side by side is not always so.

    pytest takes down what a test has made where another object follows it.
    """
    files = [list(tests) for _, tests in groupby(items, lambda item: item.path)]
    items.clear()
    for number in range(config.getoption(OPTION)):
        Random(number).shuffle(files)
        items += [_twin(item) for tests in files for item in tests]


def _twin(item: pytest.Item) -> pytest.Item:
    made = copy(item)
    if isinstance(made, pytest.Function):
        made._initrequest()
    return made


class Failures:
    """A plugin of the process that hears of all tests: says at once what has failed, and at the end how often."""

    def __init__(self, times: int) -> None:
        self._times = times
        self._failed = Counter[str]()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count it."""
        if report.failed:
            self._failed[report.nodeid] += 1
            sys.stdout.write(f"\n{report.nodeid}\n{report.longreprtext[-MOST_TEXT:]}\n")

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Show the table."""
        for name, count in self._failed.most_common():
            terminalreporter.write_line(f"{name}: failed {count} of {self._times}")


def main() -> int:
    """Run them so often; the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("paths", nargs="*", default=["tests"])
    parser.add_argument(OPTION, type=int, default=20)
    parser.add_argument("--load", type=int, default=8, help="how many processes want a processor")
    words = parser.parse_args()
    workers = min(WORKERS, words.load)
    command = [
        *(sys.executable, "-m", "pytest", "-p", "tests.tools.suite.steady", OPTION, str(words.times)),
        *("-n", str(workers), "-m", "real_clock and not soak and not hardware", *words.paths),
    ]
    with ExitStack() as held:
        for _ in range(words.load - workers + 1):
            busy = held.enter_context(subprocess.Popen([sys.executable, "-c", BUSY]))
            held.callback(busy.kill)
        load = held.enter_context(Load())
        code = subprocess.run(command, cwd=ROOT, check=False).returncode
    sys.stdout.write(f"load {load.mean:.1f}\n")
    return code


class Load:
    """How many processes ran or waited for a processor, while this is entered."""

    def __init__(self) -> None:
        self._found = [0]
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    @property
    def mean(self) -> float:
        """The mean of what was found."""
        return mean(self._found[1:] or self._found)

    def _look(self) -> None:
        while not self._ended.wait(LOOK_S):
            running = Path("/proc/loadavg").read_text(encoding="ascii").split()[3].partition("/")[0]
            self._found.append(int(running) - 1)  # this one


if __name__ == "__main__":
    sys.exit(main())
