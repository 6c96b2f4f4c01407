"""The pytest plugin as a user meets it: markers, a boot that is shared, failures that say what to look at."""

import os
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from p2os.pioneer.body.factory import BEST, resolve_body
from robot_bench.scenario.sweep import ALIKE
from tests.tools.forked_python import PYTEST, forked_python

pytest_plugins = ("pytester",)

#: The plugin itself is found by its entry point.
PLUGIN = ("-p", "no:cacheprovider", "-p", "no:xdist")
SETTINGS = "[pytest]\nbench_scenario = motors\n"


def run(pytester: pytest.Pytester, text: str, *options: str) -> pytest.RunResult:
    pytester.makeini(SETTINGS)
    pytester.makepyfile(test_mine=text)
    words = (*PLUGIN, "--bench-body", "kinematic", "-v", "--basetemp", str(pytester.path / "temporary"), *options)
    return pytester.run(forked_python(), "-c", PYTEST, *words)


MARKED = """
import pytest
hashes = []

@pytest.mark.worlds("room", "arena")
@pytest.mark.seeds("0-1")
def test_where(bench):
    assert (bench.scenario.body, bench.now) == ("kinematic", 0)
    assert bench.scenario.seed in (0, 1)

@pytest.mark.modes("direct")
@pytest.mark.bodies("kinematic")
def test_direct(bench):
    assert bench.scenario.mode == "direct"

@pytest.mark.booted
@pytest.mark.faults("sonar-dead 1", "line-noise 0.001", at="0.5 s")
def test_faults(bench):
    bench.expect_no("contact", "100 ms")
    assert [fault.words for fault in bench.record().faults] == [bench.scenario.faults[-1].words[6:]]

@pytest.mark.booted
@pytest.mark.parametrize("time", range(3))
def test_nothing_of_one_is_seen_by_the_next(bench, time):
    seen = []
    bench.events.subscribe(seen.append)
    begin = bench.now
    assert bench.record().faults == []
    bench.inject("sonar-dead 1")
    bench.run_until("1 s")
    hashes.append((begin, bench.trace.sha256, len(seen)))
    assert len(set(hashes)) == 1
    bench.checkpoint()
"""


@pytest.mark.slow
def test_markers_say_what_a_test_runs_in_and_one_boot_serves_many(pytester: pytest.Pytester) -> None:
    result = run(pytester, MARKED)
    result.assert_outcomes(passed=10)
    result.stdout.fnmatch_lines([
        "*test_where?room-0? PASSED*", "*test_where?arena-1? PASSED*", "*test_faults?sonar-dead_1? PASSED*",
        "bench: 8 built and booted, 2 tests began where one stood",
    ])  # fmt: skip
    assert not (pytester.path / "bench-runs").exists(), "nothing failed"


FAILED = """
import pytest

@pytest.mark.booted
def test_it_flies(bench):
    bench.drop_link()
    bench.expect_text("take-off", within="300 ms")

@pytest.mark.scenario("motorz")
def test_of_nothing(bench): pass

def test_at_once(bench): bench.expect("robot moves", within=5)

def test_before_anything_has_run(bench): bench.expect("robot movs", within="1 s")

@pytest.mark.booted(within="1 s")
def test_of_no_such_word(bench): pass

@pytest.mark.scenario("motors", duration=3)
def test_of_no_such_option(bench): pass

def test_without_a_bench(): assert 1 == 2
"""


@pytest.mark.slow
def test_a_failure_says_what_was_wanted_what_happened_last_and_where_to_look(pytester: pytest.Pytester) -> None:
    result = run(pytester, FAILED, "--junitxml", "junit.xml", "--bench-body", "best", "--bench-mode", "adapter")
    result.assert_outcomes(failed=4, errors=3)
    result.stdout.fnmatch_lines([
        "E *ExpectationError: 'usart1 sends take-off' did not happen, from 0.700 s to 1.000 s",
        "*last events:*", "*fault inject: link-down*",
        f"*replay:   pytest 'test_mine.py::test_it_flies' --bench-mode adapter --bench-body {resolve_body(BEST)}",
    ])  # fmt: skip
    out = result.stdout.str()
    assert "there is no scenario 'motorz' (hint: did you mean 'motors'?)" in out
    assert "did not happen within 5 ns (a number without a unit is nanoseconds), from 0.000 s to 0.000 s" in out
    assert "a fault of p2os" not in out, "why it failed was looked for where nothing had run yet"
    assert "the marker booted takes no 'within' (hint: booted(event=" in out
    assert "there is no option 'duration' (hint: did you mean 'duration_s'?)" in out
    assert "def expect(" not in out, "the bench's own lines are not shown"
    page = Path(re.findall(r"report:   (\S+)", out)[0])
    assert "did not happen" in page.read_text(encoding="utf-8")
    folders = sorted(folder.name for folder in (pytester.path / "bench-runs").iterdir())
    assert folders == [f"test_mine.py-test_{name}" for name in ("at_once", "before_anything_has_run", "it_flies")]
    if (page.parent / "path.png").exists():
        assert f"picture:  {page.parent / 'path.png'}" in out
    cases = ET.parse(pytester.path / "junit.xml").iter("testcase")  # noqa: S314 - our own file
    reported = {case.get("name"): {item.get("name") for item in case.iter("property")} for case in cases}
    assert {"bench_report", "trace_sha256", "bench_seed"} <= reported["test_it_flies"]
    assert reported["test_without_a_bench"] == set()


MISUSED = """
import pytest

def test_of_no_such_wire(bench): bench.expect_pin("PB99", "high", within="1 s")

def test_of_no_such_event(bench): bench.expect("robot flies", within="1 s")

@pytest.mark.worlds("rom")
def test_of_no_such_world(bench): pass

@pytest.fixture
def far(bench): bench.run_until("9 parsec")

def test_of_a_fixture(far): pass

def test_of_ones_own_error(bench):
    from simbase.errors import UsageError
    def fails(): raise UsageError("mine", hint="yours")
    fails()
"""


def test_a_misuse_shows_the_tests_own_line_the_error_and_its_hint_and_none_of_our_source(
    pytester: pytest.Pytester,
) -> None:
    result = run(pytester, MISUSED, "--bench-record", "none")
    result.assert_outcomes(failed=3, errors=2)
    reported = result.stdout.str()
    assert "expect_pin(self" not in reported
    assert "robot_bench/" not in reported.partition("short test summary")[0]
    assert "another exception" not in reported
    assert "direct cause" not in reported
    result.stdout.fnmatch_lines([
        "*no world 'rom' (hint: did you mean 'room'?)", '*run_until("9 parsec")', "E *unit ?parsec?*",
        '*expect_pin("PB99"*', "E *no wire 'PB99'", "E *hint: *PB7*",
        '*expect("robot flies"*', "E *robot flies*not understood*", "E *hint: such as robot near*",
        "*def fails()*", "E *mine", "E *hint: yours",
    ])  # fmt: skip
    assert "selection.py" in run(pytester, MISUSED, "--bench-record", "none", "--full-trace").stdout.str()


def test_a_bench_is_there_for_the_next_test_that_wants_the_same_and_for_no_other(tmp_path: Path) -> None:
    from robot_bench.cli.pytest_plugin import _Pool
    from robot_bench.scenario.loading import load_scenario

    shipped, pool = load_scenario("motors"), _Pool()
    firmware = tmp_path / "mine.elf"
    firmware.write_bytes(shipped.firmware.read_bytes())
    wanted = load_scenario("motors", firmware=firmware).with_options(mode="direct", body="kinematic")
    first, beside = pool.take(wanted, None), pool.take(wanted, None)
    assert first is not beside, "another test has the first one still"
    pool.give_back(first)
    assert pool.take(wanted, None) is first
    pool.give_back(first)
    assert pool.take(wanted.with_options(seed=1), None) is not first
    when = firmware.stat().st_mtime_ns
    os.utime(firmware, ns=(when, when + 1))  # built anew, as large as before
    assert pool.take(wanted, None) is not first
    os.utime(firmware, ns=(when, when))
    assert pool.take(wanted, None) is first
    assert (pool.built, pool.reused) == (4, 2)


def test_seeds_are_those_of_the_command_line() -> None:
    from robot_bench.cli.pytest_plugin import _seeds

    assert [_seeds(given) for given in (7, "7", "1, 5-6")] == [[7], [7], [1, 5, 6]]
    for given in (-1, "9-0", "x"):
        with pytest.raises(pytest.fail.Exception, match="names no seeds"):
            _seeds(given)


SEEDED = """
import pytest

@pytest.mark.seeds("0-2")
@pytest.mark.worlds("room", "arena")
def test_alike(bench):
    bench.run_until("20 ms")

@pytest.mark.seeds("0-1")
def test_of_seeds_that_are_looked_at(bench):
    bench.run_until("20 ms")
    bench.inject(f"sonar-dead {bench.scenario.seed + 1}")
    bench.run_until("400 ms")

@pytest.mark.seeds(7)
def test_of_one_seed(bench):
    bench.run_until("20 ms")

@pytest.mark.parametrize("time", ["10 ms", "20 ms"])
def test_of_no_seeds(bench, time):
    bench.run_until(time)
"""


@pytest.mark.slow
@pytest.mark.parametrize("workers", [(), pytest.param(("-p", "xdist", "-n", "2"), marks=pytest.mark.soak)])
def test_tests_whose_seeds_made_no_difference_are_named_once(
    pytester: pytest.Pytester, workers: tuple[str, ...]
) -> None:
    pytester.makeini(SETTINGS)
    pytester.makepyfile(test_mine=SEEDED)
    words = ("-p", "no:cacheprovider", *(workers or ("-p", "no:xdist")), "--bench-body", "kinematic",
             "--junitxml", "told.xml", "--basetemp", str(pytester.path / "temporary"))  # fmt: skip
    result = pytester.run(forked_python(), "-c", PYTEST, *words)
    result.assert_outcomes(passed=11)
    notes = [line for line in result.outlines if line.startswith("note: ")]
    assert notes == [f"note: test_mine.py::test_alike was one run with 3 seeds: {ALIKE}"]
    hashes = re.findall(r'name="trace_sha256" value="(\w+)"', (pytester.path / "told.xml").read_text())
    assert len(hashes) == 11
    assert len({*hashes}) < 11


def test_who_uses_no_bench_loads_none(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_mine="""
        import sys
        def test_inert(): assert not {"robot_bench.bench", "numpy", "unicorn", "p2os.protocol"} & set(sys.modules)
    """)  # fmt: skip
    result = pytester.runpytest_subprocess(*PLUGIN, "-p", "no:hypothesispytest")
    result.assert_outcomes(passed=1)


CLIENTS = """
import pytest
from p2os import Robot

def test_it_drives(robot, served):
    robot.drive(0.1)
    assert 0.05 < robot.state.pose.x_m < 0.2
    served.reset()

@pytest.mark.pioneer(robot="p3dx-sh", world="arena", url="pty:")
def test_a_serial_line(served):
    assert "pty" in served or "serial" in served
    with Robot(served) as robot:
        assert robot.identity.robot_class == "Pioneer"

@pytest.mark.pioneer(world="nowhere")
def test_of_nothing(robot): pass

@pytest.mark.pioneer(wold="room")
def test_of_a_slip(robot): pass
"""


@pytest.mark.slow
def test_a_test_may_have_a_served_robot_and_a_client_of_it(pytester: pytest.Pytester) -> None:
    result = run(pytester, CLIENTS)
    result.assert_outcomes(passed=2, errors=2)
    result.stdout.fnmatch_lines(["*no world 'nowhere'*", "*unexpected keyword argument 'wold'*"])
    assert "Traceback" not in result.stdout.str()


TRUSTING = """
import pytest

@pytest.mark.scenario("mine.toml")
def test_with_code_of_its_own(bench):
    assert bench.parts.body.is_own
"""


@pytest.mark.parametrize(("setting", "passes"), [("", False), ("mine.py", True), (".", True), ("other", False)])
def test_code_that_a_scenario_names_is_loaded_where_the_ini_file_trusts_it(
    pytester: pytest.Pytester, setting: str, *, passes: bool
) -> None:
    (pytester.path / "mine.toml").write_text(
        'firmware = "motors"\nworld = "room"\nduration_s = 1\nbody = "./mine.py:Own"\n'
    )
    (pytester.path / "mine.py").write_text(
        "from pathlib import Path\nfrom p2os.pioneer.body.kinematic import KinematicScene\n"
        "Path(__file__).with_name('canary').touch()\nclass Own(KinematicScene):\n"
        "    def __init__(self, world, models):\n        super().__init__(world, models)\n"
        "        self.bodies[0].is_own = True\n"
    )
    pytester.makeini(f"[pytest]\np2os_trust = {setting}\n")
    pytester.makepyfile(test_mine=TRUSTING)
    found = pytester.run(forked_python(), "-c", PYTEST, *PLUGIN, "--basetemp", str(pytester.path / "temporary"))
    assert (pytester.path / "canary").exists() == passes
    if passes:
        found.assert_outcomes(passed=1)
    else:
        found.assert_outcomes(errors=1)
        found.stdout.fnmatch_lines(["*mine.toml:4: body: ./mine.py:Own is Python code*p2os_trust = *"])


EVERY_MODEL = """
import pytest
from p2os import VirtualClock
from p2os.client import DeadmanStopped
from p2os.robots.parameters import known_robots

def cell(model, firmware):
    mark = pytest.mark.pioneer(robot=model, firmware=firmware, body="kinematic", clock=VirtualClock())
    return pytest.param(model, marks=mark, id=f"{model}-{firmware}")

@pytest.mark.parametrize("model", [cell(model, firmware) for model in MODELS for firmware in FIRMWARE])
def test_it_drives_and_stops(model, robot, served):
    stops = []
    robot.on_event(lambda notice: isinstance(notice, DeadmanStopped) and stops.append(served.clock()))
    assert robot.identity.subclass == model
    assert robot.drive(0.3).reached == pytest.approx(0.3, abs=0.02)
    robot.set_velocity(0.3)
    called_at = served.clock()
    served.clock.sleep(5.6)
    (stopped_at,) = stops
    assert stopped_at - called_at <= 2.1e9
    assert "wheels 0.000 0.000 m/s" in served.order("status")[0]
    assert robot.state.left_mps == robot.state.right_mps == 0
"""


def every_model(pytester: pytest.Pytester, models: str, firmware: str, cells: int) -> None:
    text = EVERY_MODEL.replace("MODELS", models).replace("FIRMWARE", firmware)
    run(pytester, text).assert_outcomes(passed=cells)


@pytest.mark.slow
def test_the_marker_takes_the_firmware_and_the_clock_of_a_served_robot(pytester: pytest.Pytester) -> None:
    every_model(pytester, '("p3dx-sh", "p2at")', '(None, "P2OS", "AROS")', 6)


@pytest.mark.soak
def test_the_fixtures_drive_and_stop_every_model(pytester: pytest.Pytester) -> None:
    every_model(pytester, "known_robots()", '(None, "P2OS", "AROS", "ARCOS")', 120)
