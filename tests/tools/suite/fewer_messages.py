"""Leaves out what a worker of xdist need not say of a test that passes: three of six messages for each.

A worker reports that a test begins, its three phases, that it ends, and that it takes the next one: 2 ms of processor
time at both ends, as much as pytest itself takes for a test. Who asks for no more sees the phase `call` alone. What
fails, is skipped or has printed something is reported as ever.
"""

from typing import Any

import pytest

#: xdist's class of what speaks with the controller; its module has no name.
INTERACTOR = "WorkerInteractor"
#: Options that show more: of every phase, or when a test begins.
ASKED_BY = ("xmlpath", "durations", "count_time", "setupshow")


def interactor_of(config: pytest.Config) -> Any:
    """Return what speaks with the controller."""
    return next(each for each in config.pluginmanager.get_plugins() if type(each).__name__ == INTERACTOR)


class FewerMessages:
    """A plugin of a worker, between pytest and xdist's."""

    def __init__(self, config: pytest.Config) -> None:
        self._interactor = interactor_of(config)
        for name in ("pytest_runtest_logreport", "pytest_runtest_logstart"):
            getattr(config.hook, name)._remove_plugin(self._interactor)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Pass on what has something to say."""
        if report.passed:
            report.keywords = {}  # half of the message, which nobody reads there
        if report.when == "call" or not report.passed or report.sections:
            self._interactor.pytest_runtest_logreport(report)


def register(config: pytest.Config) -> None:
    """Say less, unless the command line asks for what would be left out."""
    if config.option.verbose <= 0 and not any(getattr(config.option, name, None) for name in ASKED_BY):
        config.pluginmanager.register(FewerMessages(config))
