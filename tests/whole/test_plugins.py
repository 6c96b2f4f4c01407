"""The plug-ins: nothing outside imports or names one, and a house stands where it is hidden."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from p2os.cli.needs import NEEDS as TOOLKIT_NEEDS
from p2os.ros.bags import STORAGES
from robot_bench.cli.needs import NEEDS as BENCH_NEEDS
from simbase.installation import Need
from tests.test_architecture import imports, module_name, sources
from tests.whole.building import PROJECT, ROOT
from tools.packaging.staging import Plugin, houses, plugins
from tools.packaging.testing import environment

PLUGINS = plugins()
HOUSES = houses()
NEEDS = [need for need in (*TOOLKIT_NEEDS, *BENCH_NEEDS) if need.kind == "plug-in"]
#: The tables in which a plug-in has a row, beside pyproject.toml.
TABLES = {"p2os.cli.needs", "robot_bench.cli.needs"}
#: Who says a word of a plug-in that means something else there, and what.
OTHER_MEANINGS = {("p2os.pioneer.export.mjcf", "mujoco"): "the element of MJCF at the top"}


def strings(text: str) -> set[str]:
    """Return the words of a source's texts; docstrings, and an `f"…"`'s names, are not among them."""
    tree = ast.parse(text)
    reported = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body
        and isinstance(node.body[0], ast.Expr)
    }  # fmt: skip
    texts = [
        node.value for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in reported
    ]  # fmt: skip
    return {word.strip(".") for text in texts for word in re.findall(r"[\w.]+", text)}


def faults(name: str, text: str, imported: set[str]) -> list[str]:
    """Return what a module imports or names of the plug-ins of which it is not."""
    own = next((one for one in PLUGINS.values() if one.holds(name)), None)
    found = []
    for plugin in PLUGINS.values():
        if own is not None and (own is plugin or plugin.name in own.uses):
            continue
        found += [f"{name} imports {target}, of {plugin.name}" for target in sorted(imported) if plugin.holds(target)]
        if name not in TABLES:
            found += [
                f"{name} names {word}, of {plugin.name}" for word in sorted(strings(text))
                if plugin.holds(word) or (word in plugin.words and (name, word) not in OTHER_MEANINGS)
            ]  # fmt: skip
    return found


def test_nothing_outside_a_plugin_imports_or_names_it() -> None:
    read = [(module_name(path), path.read_text(encoding="utf-8"), imports(path)) for path in sources()]
    assert [fault for name, text, imported in read for fault in faults(name, text, imported)] == []


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
    tree = ast.walk(ast.parse(text))
    imported = {node.module for node in tree if isinstance(node, ast.ImportFrom)}
    imported |= {f"{node.module}.{alias.name}" for node in ast.walk(ast.parse(text))
                 if isinstance(node, ast.ImportFrom) for alias in node.names}  # fmt: skip
    assert faults(name, text, {target for target in imported if target}) != []


def test_what_is_of_the_plugin_itself_or_a_docstring_may_name_it() -> None:
    assert faults("p2os.pioneer.body.bullet", 'NAME = "bullet"', {"p2os.pioneer.body.bullet.engine"}) == []
    assert faults("p2os.pioneer.body.factory", '"""Beside p2os.pioneer.body.bullet, or bullet."""', set()) == []
    assert faults("p2os.pioneer.world.loader", 'read_world("p2os.pioneer.world")', {"p2os.pioneer.world.readers"}) == []


@pytest.mark.parametrize("plugin", PLUGINS.values(), ids=PLUGINS)
def test_the_table_names_what_is_there(plugin: Plugin) -> None:
    modules = {module_name(path) for path in sources()}
    assert set(plugin.modules) <= modules
    points = PROJECT["project"]["entry-points"]
    assert {name for name, module in points["p2os.verbs"].items() if plugin.holds(module)} == set(plugin.verbs)
    offered = {group for group, rows in points.items() if any(plugin.holds(one.split(":")[0]) for one in rows.values())}
    reported = {group for need in needs_of(plugin) for group in need.points}
    assert offered - {"p2os.verbs"} <= reported, "p2os doctor could not tell that it is not there"
    assert all((ROOT / path.partition("::")[0]).exists() for path in (plugin.quick, *plugin.tests))


def needs_of(plugin: Plugin) -> list[Need]:
    """Return the rows of `p2os doctor` that are of a plug-in."""
    points = PROJECT["project"]["entry-points"]
    return [need for need in NEEDS if plugin.holds(points[need.points[0]][need.point].partition(":")[0])]


def test_the_storages_of_a_bag_are_those_that_it_can_be_written_in() -> None:
    assert PROJECT["project"]["entry-points"]["robot_bench.bags"].keys() == STORAGES.keys()


# A house where a plug-in is hidden.


def python(
    plugin: Plugin, *words: str, house: str = "robot-bench", cwd: Path = ROOT
) -> subprocess.CompletedProcess[str]:
    """Run Python where the bench and all below it is there, without a plug-in."""
    return subprocess.run(
        [sys.executable, *words], cwd=cwd, env=environment(HOUSES["robot-bench"], HOUSES, [plugin]),
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("plugin", PLUGINS.values(), ids=PLUGINS)
def test_a_house_works_without_a_plugin_and_tells_that_it_is_not_there(plugin: Plugin, tmp_path: Path) -> None:
    listed = python(plugin, "-m", "p2os", "--help")
    assert listed.returncode == 0, listed.stderr
    assert "missing: needs" not in listed.stdout
    shown = set(re.findall(r"(?m)^  ([a-z]+) ", listed.stdout))
    assert {"run", "serve", "doctor"} <= shown
    assert not shown & set(plugin.verbs)
    reported = python(plugin, "-m", "p2os", "doctor", "--json")
    assert reported.returncode == 0, reported.stderr
    rows = {row["name"]: row for row in json.loads(reported.stdout) if row["kind"] == "plug-in"}
    assert rows.keys() == {need.name for need in needs_of(plugin)} != set()
    assert all(row["found"] is None and "pip install" in row["get"] for row in rows.values())
    ran = python(plugin, "-m", "p2os", "run", "motors", "--body", "kinematic", "--duration", "50ms",
                 "--out", str(tmp_path / "run"))  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    tested = python(plugin, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", plugin.quick)
    assert tested.returncode == 0, tested.stdout


#: Plug-in → words of a command that ask for it, a file that they name, and what the error says.
ASKED = [
    ("physics", "run motors --body bullet", "", "there is no body 'bullet'", "physics (--body"),
    ("physics", "run motors --body tcp:127.0.0.1:9", "", "there is no body 'tcp:127.0.0.1:9'", "physics (--body"),
    ("worlds", "world check {file}", "place.sdf", "no reader for .sdf", "world files (worlds"),
    ("ros", "run motors --ros", "", "--ros is not there", "ROS bench (run --ros"),
    ("ros", "report {file} --events b --ros2 mcap", "run/trace.jsonl", "there is no storage 'mcap'", "ROS bench (run"),
]


@pytest.mark.parametrize(("name", "words", "file", "says", "hint"), ASKED)
def test_who_asks_for_a_plugin_that_is_not_there_is_told_what_to_do(
    name: str, words: str, file: str, says: str, hint: str, tmp_path: Path
) -> None:
    place = tmp_path / file
    place.parent.mkdir(exist_ok=True)
    if file:
        place.write_text("", encoding="utf-8")
    typed = words.format(file=place.parent if place.name == "trace.jsonl" else place).split()
    done = python(PLUGINS[name], "-m", "p2os", *typed, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("p2os: ")
    assert says in done.stderr
    assert hint in done.stderr
    assert "pip install" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.soak
@pytest.mark.parametrize("plugin", PLUGINS.values(), ids=PLUGINS)
def test_the_tests_of_its_house_pass_without_a_plugin(plugin: Plugin) -> None:
    words = [sys.executable, "-m", "tools.packaging.testing", plugin.house, "--without", plugin.name]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=1800, check=False)
    assert done.returncode == 0, done.stdout[-4000:]
