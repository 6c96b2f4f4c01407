"""The plug-ins: nothing outside imports or names one, and a house stands where it is hidden."""

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import pytest

from p2os.cli.needs import NEEDS as TOOLKIT_NEEDS
from p2os.ros.bags import STORAGES
from robot_bench.cli.needs import NEEDS as BENCH_NEEDS
from simbase.installation import Need
from tests.test_architecture import imports, imports_of, module_name, parsed, sources, texts_of
from tests.whole.building import PROJECT, ROOT
from tools.packaging.staging import Plugin, houses, plugins
from tools.packaging.testing import environment

PLUGINS = plugins()
HOUSES = houses()
NEEDS = [need for need in (*TOOLKIT_NEEDS, *BENCH_NEEDS) if need.kind == "plug-in"]
#: The tables in which a plug-in has a row, beside pyproject.toml.
TABLES = {"p2os.cli.needs", "robot_bench.cli.needs"}
#: What the bench may have in Python beside its plug-ins and verbs; the adapter's model is a package of its own.
KERNEL_LINES = 20_000
#: Who says a word of a plug-in that means something else there, and what.
OTHER_MEANINGS = {("p2os.pioneer.export.mjcf", "mujoco"): "the element of MJCF at the top"}


def words_of(texts: Iterable[str]) -> set[str]:
    """Return the words of a source's texts."""
    return {word.strip(".") for text in texts for word in re.findall(r"[\w.]+", text)}


def faults(name: str, words: set[str], imported: set[str]) -> list[str]:
    """Return what a module imports or names of the plug-ins of which it is not."""
    own = next((one for one in PLUGINS.values() if one.holds(name)), None)
    found = []
    for plugin in PLUGINS.values():
        if own is not None and (own is plugin or plugin.name in own.uses):
            continue
        found += [f"{name} imports {target}, of {plugin.name}" for target in sorted(imported) if plugin.holds(target)]
        if name not in TABLES:
            found += [
                f"{name} names {word}, of {plugin.name}" for word in sorted(words)
                if plugin.holds(word) or (word in plugin.words and (name, word) not in OTHER_MEANINGS)
            ]  # fmt: skip
    return found


def test_nothing_outside_a_plugin_imports_or_names_it() -> None:
    read = [(module_name(path), words_of(parsed(path).texts), imports(path)) for path in sources()]
    assert [fault for name, words, imported in read for fault in faults(name, words, imported)] == []


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("p2os.pioneer.body.factory", "from p2os.pioneer.body.bullet import BulletScene"),
        ("p2os.pioneer.body.factory", 'def f(name):\n    return name == "mujoco"'),
        ("p2os.pioneer.body.factory", 'import_module("p2os.pioneer.body.outside.body")'),
        ("p2os.pioneer.world.loader", 'import_module(f"p2os.pioneer.world.formats.{name}")'),
        ("p2os.cli.main", "def f():\n    from p2os.ros import codec"),
        ("robot_bench.run", "from robot_bench.report.explain import explain"),
        ("robot_bench.experiments.drive_files", "from p2os.ros.bags import is_bag"),  # one plug-in another
        ("robot_bench.ros.drive", "from robot_bench.campaign import trial"),
        ("p2os.cli.needs", "from p2os.ros import codec"),
    ],
)
def test_a_planted_import_or_text_is_named(name: str, text: str) -> None:
    nodes = list(ast.walk(ast.parse(text)))
    assert faults(name, words_of(texts_of(nodes)), imports_of(name, nodes)) != []


def test_what_is_of_the_plugin_itself_or_a_docstring_may_name_it() -> None:
    def reported(text: str) -> set[str]:
        return words_of(texts_of(ast.walk(ast.parse(text))))

    assert faults("p2os.pioneer.body.bullet", reported('NAME = "bullet"'), {"p2os.pioneer.body.bullet.engine"}) == []
    assert (
        faults("p2os.pioneer.body.factory", reported('"""Beside p2os.pioneer.body.bullet, or bullet."""'), set()) == []
    )
    assert (
        faults(
            "p2os.pioneer.world.loader", reported('read_world("p2os.pioneer.world")'), {"p2os.pioneer.world.readers"}
        )
        == []
    )


@pytest.mark.parametrize("plugin", PLUGINS.values(), ids=PLUGINS)
def test_the_table_names_what_is_there(plugin: Plugin) -> None:
    modules = {module_name(path) for path in sources()}
    assert set(plugin.modules) <= modules
    points = PROJECT["project"]["entry-points"]
    assert {name for name, module in points["p2os.verbs"].items() if plugin.holds(module)} == set(plugin.verbs)
    offered = {group for group, rows in points.items() if any(plugin.holds(one.split(":")[0]) for one in rows.values())}
    reported = {group for need in needs_of(plugin) for group in need.points}
    assert offered - {"p2os.verbs"} <= reported, "p2os doctor could not tell that it is not there"
    assert all((ROOT / path.partition("::")[0]).exists() for path in plugin.tests)


def needs_of(plugin: Plugin) -> list[Need]:
    """Return the rows of `p2os doctor` that are of a plug-in."""
    points = PROJECT["project"]["entry-points"]
    return [need for need in NEEDS if plugin.holds(points[need.points[0]][need.point].partition(":")[0])]


def test_the_kernel_of_the_bench_stays_small() -> None:
    kernel = [
        path for path in sources()
        if (name := module_name(path)).startswith("robot_bench") and not name.startswith("robot_bench.cli")
        and not any(one.holds(name) for one in PLUGINS.values())
    ]  # fmt: skip
    assert sum(len(path.read_bytes().splitlines()) for path in kernel) < KERNEL_LINES


def test_the_storages_of_a_bag_are_those_that_it_can_be_written_in() -> None:
    assert PROJECT["project"]["entry-points"]["robot_bench.bags"].keys() == STORAGES.keys()


# A house where a plug-in is hidden.

#: Plug-in → words of a command that ask for it, a file that they name, and what the error says.
ASKED = [
    ("physics", "run motors --body bullet", "", "there is no body 'bullet'", "physics (--body"),
    ("physics", "run motors --body tcp:127.0.0.1:9", "", "there is no body 'tcp:127.0.0.1:9'", "physics (--body"),
    ("worlds", "world check place.sdf", "place.sdf", "no reader for .sdf", "world files (worlds"),
    ("view", "run motors --view --no-browser", "", "--view is not there", "page (view, --view)"),
    ("ros", "run motors --ros", "", "--ros is not there", "ROS bench (run --ros"),
    ("foxglove", "run motors --foxglove", "", "--foxglove is not there", "Foxglove (run --foxglove"),
    ("ros", "report run --events b --ros2 mcap", "run/trace.jsonl", "there is no storage 'mcap'", "ROS bench (run"),
    ("ros", "compare bag bag", "bag/metadata.yaml", "bag holds no trace.jsonl", "ROS bench (run"),
]
#: What is looked at without each plug-in.
WORDS = ("--help", "doctor --json", "run motors --body kinematic --duration 50ms --out out")
#: Runs commands, one after the other in one process, and says how each ended and what it said.
RUN = """
import contextlib, io, json, sys
from p2os.cli.main import run
done = {}
for words in sys.argv[1:]:
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = run(words.split())
    done[words] = code, out.getvalue(), err.getvalue()
print(json.dumps(done))
"""


@dataclass(frozen=True)
class Done:
    """How a command ended, and what it said."""

    code: int
    out: str
    err: str


def python(
    plugin: Plugin, *words: str, house: str = "robot-bench", cwd: Path = ROOT
) -> subprocess.CompletedProcess[str]:
    """Run Python where the bench and all below it is there, without a plug-in."""
    return subprocess.run(
        [sys.executable, *words], cwd=cwd, env=environment(HOUSES[house], HOUSES, [plugin]),
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module", params=PLUGINS.values(), ids=PLUGINS)
def without(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Plugin, dict[str, Done]]:
    """Return a plug-in, and what is said where it is not there."""
    plugin, place = request.param, tmp_path_factory.mktemp("without")
    asked = [row for row in ASKED if row[0] == plugin.name]
    for name in filter(None, (row[2] for row in asked)):
        (place / name).parent.mkdir(exist_ok=True)
        (place / name).write_text("", encoding="utf-8")
    ran = python(plugin, "-c", RUN, *WORDS, *(row[1] for row in asked), cwd=place)
    assert ran.returncode == 0, ran.stderr
    return plugin, {words: Done(*reported) for words, reported in json.loads(ran.stdout).items()}


@pytest.mark.slow
def test_a_house_works_without_a_plugin_and_tells_that_it_is_not_there(without: tuple[Plugin, dict[str, Done]]) -> None:
    plugin, done = without
    listed, reported, ran = (done[words] for words in WORDS)
    assert [one.code for one in (listed, reported, ran)] == [0, 0, 0], ran.err
    assert "missing: needs" not in listed.out
    shown = set(re.findall(r"(?m)^  ([a-z]+) ", listed.out))
    assert {"run", "serve", "doctor"} <= shown
    assert not shown & set(plugin.verbs)
    rows = {row["name"]: row for row in json.loads(reported.out) if row["kind"] == "plug-in"}
    assert rows.keys() == {need.name for need in needs_of(plugin)} != set()
    assert all(row["found"] is None and "pip install" in row["get"] for row in rows.values())


@pytest.mark.slow
def test_who_asks_for_a_plugin_that_is_not_there_is_told_what_to_do(without: tuple[Plugin, dict[str, Done]]) -> None:
    plugin, done = without
    for name, words, _, says, hint in ASKED:
        if name == plugin.name:
            assert done[words].code == 2, done[words].err
            assert done[words].err.startswith("p2os: ")
            assert says in done[words].err
            assert hint in done[words].err
            assert "pip install" in done[words].err
            assert "Traceback" not in done[words].err


@pytest.mark.slow
def test_tests_run_without_a_plugin() -> None:
    words = ("-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", "tests/p2os/pioneer/world/test_world_files.py")
    tested = python(PLUGINS["physics"], *words)
    assert tested.returncode == 0, tested.stdout


@pytest.mark.soak
@pytest.mark.parametrize("plugin", PLUGINS.values(), ids=PLUGINS)
def test_the_tests_of_its_house_pass_without_a_plugin(plugin: Plugin) -> None:
    words = [sys.executable, "-m", "tools.packaging.testing", plugin.house, "--without", plugin.name]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=1800, check=False)
    assert done.returncode == 0, done.stdout[-4000:]
