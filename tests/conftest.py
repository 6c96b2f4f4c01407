"""What holds for every test: its place in the run, no bound on an example's time, and what a process keeps."""

import gc
import os
import random
import sys
from copy import copy
from pathlib import Path

import pytest

from tests.tools.installed import hide, plug_ins_of_others, stale_points

#: What a run leaves out that names no marks (`-m`): of whole folders, and of files or tests that it names.
OF_FOLDERS = "not slow and not soak and not hardware"
OF_FILES = "not soak and not hardware"


def pytest_addoption(parser: pytest.Parser, pluginmanager: pytest.PytestPluginManager) -> None:
    """Add the options of tests/tools/counted_lines.py and tests/tools/suite/spent_time.py, and begin to count lines.

    That comes first of all: the conftest.py of a folder that the command line names is imported next, and what it
    imports of the packages would else be there twice.
    """
    parser.addoption("--count-lines", metavar="FOLDER", help="where to write which lines of the packages ran")
    parser.addoption("--count-time", metavar="FILE", help="where to write how long each file keeps a processor busy")
    config = pluginmanager.get_plugin("pytestconfig")
    assert isinstance(config, pytest.Config)
    given = parser.parse_known_args(config.invocation_params.args, copy(config.option))
    if given.count_lines is not None:
        from tests.tools.counted_lines import LineCounter

        is_worker = "PYTEST_XDIST_WORKER" in os.environ
        pluginmanager.register(LineCounter(config.rootpath, config.rootpath / given.count_lines, is_worker=is_worker))


@pytest.hookimpl(tryfirst=True)  # xdist looks at what is set here
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Use all cores for a run of folders that says nothing of workers, each of which takes over tests of slower ones.

    Not within another run, nor where somebody looks at single tests. One worker more than cores, for tests wait; slow
    tests come first, and in rows one worker would get most of them.
    """
    option = config.option
    if "PYTEST_XDIST_WORKER" in os.environ or not config.pluginmanager.has_plugin("xdist"):
        return
    is_looked_at = option.usepdb or option.collectonly or option.capture == "no"
    if option.numprocesses is None and not is_looked_at and not _names_files(config):
        option.numprocesses = len(os.sched_getaffinity(0)) + 1
    if option.numprocesses and option.dist == "no":
        option.dist = "worksteal"


def _names_files(config: pytest.Config) -> bool:
    return all(argument.partition("::")[0].endswith(".py") for argument in config.args)


@pytest.hookimpl(tryfirst=True)  # Hypothesis loads the profile that a command line names
def pytest_configure(config: pytest.Config) -> None:
    """Leave long tests out of folders, keep compiled modules beside the sources, and bound no example's time.

    Modules are kept even where PYTHONDONTWRITEBYTECODE is set: a child that compiles 200 modules of ours takes 1.0 s
    of processor time to start, and 0.25 s else; and Python looks in one place only: where they are kept in a folder of
    their own, 3,500 modules of installed packages and its own are compiled anew, too. How long an example takes
    depends on what else the machine does.

    `pytest FOLDER` is what one runs again and again beside the work: without the tests that take seconds each, which
    `make test` runs, with all others.

    An install older than pyproject.toml is refused, and plug-ins of others are hidden.

    Examples are the same in each run, so that a commit that passes does so again; `make soak` draws others, and more.
    """
    stale = stale_points(config.rootpath)
    if stale:
        raise pytest.UsageError(f"pyproject.toml and what is installed differ in {', '.join(stale)}: run `make setup`")
    if hidden := plug_ins_of_others():
        hide(hidden)
    if not config.option.markexpr:
        config.option.markexpr = OF_FILES if _names_files(config) else OF_FOLDERS
    gc.disable()  # until all is collected: what imports make stays, and looking through it again and again takes long
    if sys.dont_write_bytecode:
        sys.dont_write_bytecode = False
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    path = config.getoption("--count-time")
    if path is not None:
        from tests.tools.suite.spent_time import TimeCounter

        config.pluginmanager.register(TimeCounter(config.rootpath / path, is_worker=hasattr(config, "workerinput")))
    if config.pluginmanager.has_plugin("xdist"):
        register_workers(config)
    # Here, since pytest rewrites its modules: after it is known where they are kept.
    from hypothesis import HealthCheck, Phase, settings
    from hypothesis.internal import entropy

    # Taken for NumPy's generator, which Hypothesis would seed and put back with each example, a quarter of the time of
    # a short one: ruff keeps everybody from drawing of it (NPY002).
    entropy.NP_RANDOM = random.Random()

    settings.register_profile("drawn", deadline=None, suppress_health_check=[HealthCheck.too_slow])
    settings.register_profile("repeated", settings.get_profile("drawn"), derandomize=True, database=None)
    settings.register_profile(  # for tools/mutants: that a test fails is enough
        "unshrunk", settings.get_profile("repeated"), phases=[Phase.explicit, Phase.generate]
    )
    settings.load_profile("repeated")


def register_workers(config: pytest.Config) -> None:
    """Have all workers of xdist forked from the first of them when it has collected, and say no more than is asked."""
    from tests.tools.suite import fewer_messages
    from tests.tools.suite.forked_workers import FIRST, Controller, FirstWorker

    workerinput = getattr(config, "workerinput", None)
    if workerinput is None:
        config.pluginmanager.register(Controller())
        return
    fewer_messages.register(config)
    if workerinput["workerid"] == FIRST:
        config.pluginmanager.register(FirstWorker(config))


def pytest_collection_finish() -> None:
    """Leave what all tests share out of the search for garbage, and search more seldom.

    Some tests search after each of hundreds of steps; and Python's own 700 objects between two searches are few for
    tests that build a chip each: 20,000 save 7 % of the time of a run. What imports have left, 30,000 small objects,
    is left out with the rest: to find it takes each worker 0.25 s.
    """
    gc.freeze()
    gc.enable()
    gc.set_threshold(20_000, 10, 10)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin with the long ones, then those of the project as a whole; in an order that is that of all workers.

    The latter wait for processes, some for half a minute: at the end one worker alone would. Tests that read a clock
    get their mark where a run asks for it: to find them takes 4 s.
    """
    if config.getoption("--hypothesis-profile", None) != "drawn":
        from tests.tools.suite.fewer_examples import try_fewer_examples

        try_fewer_examples(items)
    if "real_clock" in config.option.markexpr:
        from tests.tools.suite.real_clock import reads_clock

        for item in items:
            if isinstance(item, pytest.Function) and reads_clock(item.path, item.originalname):
                item.add_marker("real_clock")

    def place(item: pytest.Item) -> tuple[bool, bool, Path]:
        return item.get_closest_marker("slow") is None, item.path.parent != Path(__file__).parent, item.path

    items.sort(key=place)
