"""The pytest plugin: tests of a firmware that drive a bench. Inert until a test asks for the fixture `bench`.

    def test_it_turns_before_a_wall(bench):
        bench.expect("robot moves", within="5 s")
        bench.place("post", shape="cylinder", radius_m=0.1, height_m=0.5, before_sonar=4, distance_m=0.3)
        bench.expect_text("turning", within="1 s")

Markers say what a test runs in (`scenario`, `worlds`, `modes`, `bodies`, `seeds`, `faults`), and `booted` from where
on: what was booted once is kept, and each test that wants the same begins there. Nothing of a test is seen by another.

For programs that talk to a robot there is a served virtual one: the fixture `served` is its URL, `robot` a client.

    def test_it_drives_half_a_metre(robot):
        robot.drive(0.5)

Invariant: a test's run depends on its markers, the options and what it does itself; not on the tests before it, nor
on the worker that it runs in.
"""

import contextlib
import itertools
import re
import shlex
from collections.abc import Generator, Iterator
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from p2os import Robot
    from p2os.pioneer.serve.background_host import ServedPioneer
    from robot_bench.bench import Bench
    from robot_bench.scenario.scenario import Scenario

#: Marker → the option of a scenario that its words are values of.
_AXES = {"worlds": "world", "modes": "mode", "bodies": "body", "seeds": "seed", "faults": "fault"}
#: Marker → the words with a name that it takes; those of `scenario` and `pioneer` are looked at where they go.
_WORDS = {"faults": ("at",), "booted": ("event",)}
_MARKERS = (
    "scenario(name_or_file, **options): what the fixture bench runs; options as of Bench.from_scenario",
    "worlds(*names): run the test in each of these worlds",
    "modes(*modes): run it in each mode, direct or adapter",
    "bodies(*bodies): run it with each body",
    "seeds(*seeds): run it with each seed; a text such as '0-9' is a range",
    "faults(*words, at='0 s'): run it with each of these faults, injected at a time",
    "booted(event='note adapter driving'): begin where this event has happened; it is waited for once for all tests",
    "pioneer(robot='p2dx', firmware, world='room', url, …): what served and robot are; options of p2os.served_pioneer",
)
#: What a test waits for first that is marked `booted`, in mode adapter.
_BOOTED = "note adapter driving"
#: chosen: so long that is waited for.
_BOOT_WITHIN = "20 s"
#: What a test is told whose scenario names code that nobody has said may run.
_TRUST = "read it, then in pytest's ini: p2os_trust = FILE.py, or its folder; docs/trust.md"
#: Packages whose lines say nothing to a user of them.
_OURS = frozenset({"adapter_sim", "bluepill_sim", "p2os", "robot_bench", "simbase"})
_BENCH = pytest.StashKey["Bench"]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options and the settings `bench_scenario` and `p2os_trust`."""
    group = parser.getgroup("bench", "tests of a firmware on the bench (p2os)")
    group.addoption("--firmware", metavar="FILE", help="ELF, HEX or BIN in place of the scenarios'")
    group.addoption("--bench-mode", choices=("adapter", "direct"), help="of tests that do not name modes")
    group.addoption("--bench-body", metavar="BODY", help="of tests that do not name bodies")
    group.addoption(
        "--bench-record", choices=("failures", "all", "none"), default="failures",
        help="of which tests a run folder with its report is written (default: failures)",
    )  # fmt: skip
    group.addoption("--bench-out", metavar="FOLDER", default="bench-runs", help="where to (default: bench-runs)")
    parser.addini("p2os_trust", "files and folders with code that scenarios may name, seen from the ini file", "paths")
    parser.addini("bench_scenario", "scenario of tests that name none: a name, or a file", default="free-drive")


def pytest_configure(config: pytest.Config) -> None:
    """Tell the markers."""
    for line in _MARKERS:
        config.addinivalue_line("markers", line)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test once for each combination of what its markers name."""
    if "bench" not in metafunc.fixturenames:
        return
    axes: list[list[tuple[str, object]]] = []
    for marker, option in _AXES.items():
        mark = _mark(metafunc.definition, marker)
        if mark is not None:
            values = [value for given in mark.args for value in (_seeds(given) if marker == "seeds" else [given])]
            if not values:
                pytest.fail(f"the marker {marker} names nothing", pytrace=False)
            axes.append([(option, value) for value in values])
    if axes:
        rows = [dict(row) for row in itertools.product(*axes)]
        ids = ["-".join(Path(str(value)).name.replace(" ", "_") for value in row.values()) for row in rows]
        metafunc.parametrize("bench", rows, indirect=True, ids=ids)


def _seeds(given: object) -> list[int]:
    """Return the seeds of a number, or of a text such as those of `p2os run --seeds`."""
    from robot_bench.scenario.sweep import read_seeds
    from simbase.errors import UsageError

    try:
        return list(read_seeds(str(given)))
    except UsageError as error:
        raise _refused(error, "the marker seeds: ") from None


def _refused(error: Exception, where: str = "") -> BaseException:
    """Return the failure of a test that cannot begin: one line, with the hint of the error that says why."""
    hint = getattr(error, "hint", None)
    return pytest.fail.Exception(f"{where}{error}{f' (hint: {hint})' if hint else ''}", pytrace=False)


def _mark(node: pytest.Item, name: str) -> pytest.Mark | None:
    """Return a marker of a test; one with a word that it does not take fails the test."""
    mark = node.get_closest_marker(name)
    for word in mark.kwargs if mark is not None else ():
        if word not in _WORDS.get(name, ()):
            line = next(line for line in _MARKERS if line.startswith(name))
            pytest.fail(f"the marker {name} takes no {word!r} (hint: {line})", pytrace=False)
    return mark


class _Pool:
    """Benches that were built and booted once in this process, each with the state that tests begin with."""

    def __init__(self) -> None:
        #: Benches that no test has now, by what they are of.
        self._kept: dict[str, tuple[Bench, object]] = {}
        #: Benches that a test has, with what they are of and where they began.
        self._lent: dict[int, tuple[str, object]] = {}
        #: How many were built, and how many tests were given one that was there.
        self.built = self.reused = 0

    def take(self, scenario: "Scenario", booted: str | None) -> "Bench":
        """Return a bench at its beginning, or where it is booted; nobody but the caller has it.

        Raises:
            ExpectationError: It does not boot.
        """
        from robot_bench.bench import Bench

        stat = scenario.firmware.stat()
        key = repr((scenario, booted, stat.st_mtime_ns, stat.st_size))
        kept = self._kept.pop(key, None)
        if kept is not None:
            self.reused += 1
            bench, begin = kept
            bench.restart(begin)
            self._lent[id(bench)] = key, begin
            return bench
        self.built += 1
        bench = Bench.from_scenario(scenario)
        if booted is not None:
            bench.expect(booted, within=_BOOT_WITHIN)
        self._lent[id(bench)] = key, bench.snapshot()
        return bench

    def give_back(self, bench: "Bench") -> None:
        """Keep a bench for the next test that wants the same."""
        key, begin = self._lent.pop(id(bench))
        self._kept[key] = bench, begin


_POOL = pytest.StashKey[_Pool]()


@pytest.fixture
def bench(request: pytest.FixtureRequest) -> "Iterator[Bench]":
    """A firmware on an emulated BluePill, its robot and its world, in virtual time: a `robot_bench.Bench`."""
    from simbase.errors import P2osError

    item: pytest.Item = request.node
    mark = _mark(item, "booted")
    booted = None if mark is None else str((*mark.args, *mark.kwargs.values(), _BOOTED)[0])
    pool = item.config.stash.setdefault(_POOL, _Pool())
    try:
        made = pool.take(_scenario_of(item, getattr(request, "param", {})), booted)
    except P2osError as error:
        raise _refused(error) from None
    item.stash[_BENCH] = made
    yield made
    pool.give_back(made)


@pytest.fixture
def served(request: pytest.FixtureRequest, tmp_path: Path) -> "Iterator[ServedPioneer]":
    """A virtual robot that is served in real time, for this test alone: its URL, and orders to it."""
    from p2os.pioneer.serve import served_pioneer
    from simbase.errors import P2osError

    mark = request.node.get_closest_marker("pioneer")
    wanted: dict[str, Any] = {"body": request.config.getoption("--bench-body") or "best"}
    wanted |= {} if mark is None else mark.kwargs
    if wanted.get("url") == "pty:":
        wanted["url"] = f"pty:{tmp_path / 'robot'}"
    with contextlib.ExitStack() as stack:
        try:
            made = stack.enter_context(served_pioneer(**wanted))
        except (P2osError, TypeError) as error:  # a type error: a word of the marker that it does not take
            raise _refused(error) from None
        yield made


@pytest.fixture
def robot(served: "ServedPioneer") -> "Iterator[Robot]":
    """A client that is connected to a virtual robot: a `p2os.Robot`."""
    from p2os import Robot

    with Robot(served, clock=served.clock) as made:
        yield made


def _scenario_of(item: pytest.Item, chosen: dict[str, Any]) -> "Scenario":
    from bluepill_sim.spans import to_nanos
    from robot_bench.scenario.fault_script import load_faults
    from robot_bench.scenario.loading import load_scenario
    from simbase.timing import NS_PER_S
    from simbase.trust import Trust

    config, mark = item.config, item.get_closest_marker("scenario")
    named = str(mark.args[0]) if mark is not None else str(config.getini("bench_scenario"))
    options: dict[str, Any] = {"mode": config.getoption("--bench-mode"), "body": config.getoption("--bench-body")}
    options |= {"firmware": config.getoption("--firmware")} | (dict(mark.kwargs) if mark is not None else {}) | chosen
    fault = options.pop("fault", None)
    beside = [folder / named for folder in (item.path.parent, config.rootpath) if (folder / named).is_file()]
    firmware = options["firmware"]
    found = load_scenario(
        str(beside[0]) if beside else named, firmware=None if firmware is None else Path(firmware),
        trust=Trust(paths=tuple(config.getini("p2os_trust") or ()), hint=_TRUST),
    ).with_options(**options)  # fmt: skip
    if fault is None:
        return found
    faults = item.get_closest_marker("faults")
    at = to_nanos(faults.kwargs.get("at", "0 s") if faults is not None else 0)
    table = {"at_s": at / NS_PER_S, "fault": fault}
    return replace(found, faults=(*found.faults, *load_faults([table], found.parameters, "faults")))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, Any, Any]:
    """End an error of ours in a fixture at the fixture's own line."""
    with _ends_at_the_tests_line(item):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, Any, Any]:
    """End an error of ours in a test at the test's own line."""
    with _ends_at_the_tests_line(item):
        return (yield)


@contextlib.contextmanager
def _ends_at_the_tests_line(item: pytest.Item) -> Iterator[None]:
    """Show of an error that we raise for a person the line that called us, not ours; all of it with --full-trace."""
    try:
        yield
    except Exception as error:
        from simbase.errors import P2osError

        if isinstance(error, P2osError) and not item.config.getoption("fulltrace"):
            _cut_at_our_lines(error.__traceback__)
            error.__cause__, error.__suppress_context__ = None, True
        raise


def _cut_at_our_lines(traceback: TracebackType | None) -> None:
    """Cut a traceback that ends in our packages where it comes to them from elsewhere for the first time."""
    last_of_others: TracebackType | None = None
    entered: TracebackType | None = None
    is_ours = True  # it begins with this plugin
    while traceback is not None:
        was_ours, is_ours = is_ours, str(traceback.tb_frame.f_globals.get("__name__")).partition(".")[0] in _OURS
        if not is_ours:
            last_of_others = traceback
        elif not was_ours and entered is None:
            entered = last_of_others
        traceback = traceback.tb_next
    if is_ours and entered is not None:
        entered.tb_next = None


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    """Tell of a test's run what a person needs who looks into it: last events, report, picture, how to replay it."""
    report: Any = yield
    used = item.stash.get(_BENCH, None)
    wanted = item.config.getoption("--bench-record")
    if call.when == "call" and used is not None:
        item.user_properties += [("bench_seed", used.scenario.seed), ("trace_sha256", used.trace.sha256)]
        report.bench_run = _run_of(item, used)
        said = call.excinfo is not None and hasattr(call.excinfo.value, "last_events")
        if report.failed and not said:
            lines = [f"at {used.now / 1e9:.3f} s of {used.scenario.name}; the last events:", *used.last_events(12)]
            report.sections.append(("bench", "\n".join(lines)))
        if wanted == "all" or (wanted == "failures" and report.failed):
            _record(item, used, report, str(call.excinfo.value) if call.excinfo is not None and report.failed else "")
    return report


def _run_of(item: pytest.Item, used: "Bench") -> tuple[str, str, int, str]:
    """Return the test without what is parametrised, what of it is but for the seed, the seed, and the trace's hash."""
    spec = getattr(item, "callspec", None)
    row = dict(spec.params.get("bench") or {}) if spec is not None else {}
    row.pop("seed", None)
    others = {name: place for name, place in spec.indices.items() if name != "bench"} if spec is not None else {}
    return item.nodeid.partition("[")[0], repr((row, sorted(others.items()))), used.scenario.seed, used.trace.sha256


def _record(item: pytest.Item, used: "Bench", report: Any, failure: str) -> None:
    """Write the run folder of a test, and tell where it is."""
    from p2os.pioneer.body.factory import BEST, resolve_body
    from robot_bench.report.make import Files
    from robot_bench.run import why_failed, write_run
    from simbase.errors import P2osError

    name = re.sub(r"[^\w.-]+", "_", item.nodeid.replace("::", "-")).strip("_")
    folder = item.config.rootpath / str(item.config.getoption("--bench-out")) / name
    said, why = failure.partition("\n")[0], ""
    try:
        if said:
            try:
                why = why_failed(used, [said])
            except P2osError:
                pass
            except Exception as error:  # noqa: BLE001 - a fault of ours must not end the session of the user's tests
                report.sections.append(("bench: why", f"not found, a fault of p2os: {type(error).__name__}: {error}"))
        page = write_run(used, folder, said, explained=why, files=Files.PLOTS)
    except (P2osError, OSError) as error:  # a test's own outcome counts
        report.sections.append(("bench: no report", str(error)))
        return
    item.user_properties.append(("bench_report", str(page)))
    given = {name: item.config.getoption(name) for name in ("--firmware", "--bench-mode", "--bench-body")}
    if used.scenario.body == BEST:  # elsewhere it may be another one
        given["--bench-body"] = resolve_body(BEST)
    options = "".join(f" {name} {shlex.quote(str(value))}" for name, value in given.items() if value)
    picture = folder / "path.png"
    if why:
        report.sections.append(("bench: why", why))
    lines = [f"report:   {page}", *([f"picture:  {picture}"] if picture.is_file() else [])]
    report.sections.append(
        ("bench: look, and replay", "\n".join([*lines, f"replay:   pytest '{item.nodeid}'{options}"]))
    )


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Say whose seeds made no difference; with -v how many benches were built, and how many tests began with one."""
    _tell_seeds_alike(terminalreporter)
    pool = config.stash.get(_POOL, None)
    if pool is not None and config.getoption("verbose") > 0:
        terminalreporter.write_line(f"bench: {pool.built} built and booted, {pool.reused} tests began where one stood")


def _tell_seeds_alike(terminalreporter: Any) -> None:
    """Say of which tests the runs with several seeds were one run each; what ran in other processes counts too."""
    runs: dict[tuple[str, str], dict[int, str]] = {}
    for report in itertools.chain.from_iterable(terminalreporter.stats.values()):
        if getattr(report, "bench_run", None) is not None:
            test, rest, seed, sha256 = report.bench_run
            runs.setdefault((test, rest), {})[seed] = sha256
    if not runs:
        return
    from robot_bench.scenario.sweep import ALIKE, are_alike

    alike: dict[str, int] = {}
    for (test, _), hashes in runs.items():
        if are_alike(hashes.values()):
            alike[test] = max(len(hashes), alike.get(test, 0))
    for test, count in alike.items():
        terminalreporter.write_line(f"note: {test} was one run with {count} seeds: {ALIKE}", yellow=True)
