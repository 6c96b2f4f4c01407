"""What holds for every test: its place in the run, whether its lines are counted, and bytecode for its children."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest


def pytest_configure(config: pytest.Config) -> None:
    """Keep compiled modules where PYTHONDONTWRITEBYTECODE forbids it beside the sources.

    A child that compiles 200 modules of ours takes 1.0 s of processor time to start, and 0.25 s else.
    """
    if sys.dont_write_bytecode:
        sys.dont_write_bytecode = False
        sys.pycache_prefix = str(config.rootpath / ".pytest_cache" / "bytecode")
        os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix
        del os.environ["PYTHONDONTWRITEBYTECODE"]


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """Stop the first of the two measurements that pytest-cov starts in a worker of xdist; it keeps only the second.

    Where a test of `no_cover` pauses the second, the first would go on: all would be traced.
    """
    measuring = getattr(session.config.pluginmanager.getplugin("_cov"), "cov_controller", None)
    if measuring is not None and hasattr(session.config, "workerinput"):
        measuring.pause()


@pytest.hookimpl(trylast=True)  # hypothesis has marked its own by then
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Count no lines in long and repeating tests, and begin with the long ones, then those of the project as a whole.

    The latter wait for processes, some for half a minute: at the end one worker alone would.
    Tracing makes a simulation three times slower, and the hundredth example runs the lines of the first ten.
    """
    for item in items:
        is_core = "protocol" in item.path.parts  # counted whole (tools/check_coverage.py), with all examples
        names = ("slow", "soak") if is_core else ("slow", "soak", "hypothesis")
        if any(item.get_closest_marker(name) for name in names):
            item.add_marker("no_cover")
    items.sort(key=lambda item: (item.get_closest_marker("slow") is None, item.path.parent != Path(__file__).parent))


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Fail a test that ends the tracing: no line of the tests after it would be counted."""
    was_traced = sys.gettrace() is not None
    yield
    if was_traced and sys.gettrace() is None:
        pytest.fail("sys.settrace() ended the counting of coverage (hint: @pytest.mark.no_cover)")
