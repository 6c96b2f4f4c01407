"""The houses: what each distribution holds and names, and that each stands with nothing but what is below it."""

import ast
import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable

import pytest

from tests.test_architecture import parsed, texts_of
from tests.test_docs import runnable
from tests.whole.building import PROJECT, ROOT
from tools.packaging.staging import as_toml, houses, pyproject
from tools.packaging.testing import closure, environment

HOUSES = houses()
PACKAGES = {folder: house for house in HOUSES.values() for folder in house.folders}
PYTEST = ("-m", "pytest", "-q", "--import-mode=importlib", "-p", "no:cacheprovider")


def test_every_package_verb_and_extra_of_the_whole_is_of_one_house() -> None:
    assert sorted(PACKAGES) == sorted(folder for house in HOUSES.values() for folder in house.folders)
    written = {name: pyproject(house, PROJECT) for name, house in HOUSES.items()}
    for group, rows in PROJECT["project"]["entry-points"].items():
        held = [name for one in written.values() for name in one["project"]["entry-points"].get(group, {})]
        assert sorted(held) == sorted(rows), group
    parts = [part["name"] for one in written.values() for part in one["tool"]["setuptools"]["ext-modules"]]
    assert sorted(parts) == sorted(part["name"] for part in PROJECT["tool"]["setuptools"]["ext-modules"])
    users = set(re.split(r"[\[\],]", PROJECT["project"]["optional-dependencies"]["all"][0])) - {"p2os", "sim", ""}
    assert users <= {extra for house in HOUSES.values() for extra in house.extras}
    assert {one["project"]["version"] for one in written.values()} == {PROJECT["project"]["version"]}


def test_a_house_requires_those_below_it_in_its_own_version() -> None:
    version = PROJECT["project"]["version"]
    requires = pyproject(HOUSES["robot-bench"], PROJECT)["project"]["dependencies"]
    assert requires[:3] == [f"simbase=={version}", f"p2os=={version}", f"bluepill-sim=={version}"]
    with pytest.raises(KeyError, match="no_such_package"):
        pyproject(type(HOUSES["p2os"])(name="a", description="", folders=(), requires=["no_such_package"]), PROJECT)


@pytest.mark.parametrize("name", HOUSES)
def test_what_is_written_reads_as_what_was_meant(name: str) -> None:
    wanted = pyproject(HOUSES[name], PROJECT)
    assert tomllib.loads(as_toml(wanted)) == wanted


# Nothing is named upwards.


def upper_names(package: str) -> set[str]:
    """Return the packages and distributions that a package does not stand on."""
    below = closure(PACKAGES[package], HOUSES)
    others = {folder for folder in PACKAGES if folder not in below}
    return others | {house.name for house in HOUSES.values() if not set(house.folders) & below}


def upper_verbs(package: str) -> set[str]:
    """Return the verbs of `p2os` that a package does not stand on."""
    below = closure(PACKAGES[package], HOUSES)
    return {
        name for name, module in PROJECT["project"]["entry-points"]["p2os.verbs"].items()
        if module.partition(".")[0] not in below
    }  # fmt: skip


def named_upwards(package: str, texts: Iterable[str]) -> list[str]:
    """Return the texts of a source that name a module, distribution or verb above its package."""
    names, verbs = upper_names(package), upper_verbs(package)
    return [
        text for text in texts
        if not verbs.isdisjoint(re.findall(r"\bp2os ([a-z]+)", text))
        or any(is_module(word) or word in names - set(PACKAGES) for word in re.findall(r"[\w.-]+", text)
               if re.split(r"\.", word)[0] in names)
    ]  # fmt: skip


def texts(source: str) -> list[str]:
    return texts_of(ast.walk(ast.parse(source)))


def is_module(word: str) -> bool:
    """Tell whether a word is the dotted name of a module that is there, or of a part in C."""
    path = ROOT.joinpath(*word.strip(".").split("."))
    return path.is_dir() or path.with_suffix(".py").exists() or path.name.startswith("_")


#: Where a user's answers and configuration lie: in a folder with the name of the project.
NAMES_THE_PROJECT = ("simbase/trust/store.py",)


@pytest.mark.parametrize("package", ["simbase", "p2os", "bluepill_sim"])
def test_no_text_of_a_program_names_a_module_distribution_or_verb_above(package: str) -> None:
    found = {
        path.relative_to(ROOT).as_posix(): names
        for path in (ROOT / package).rglob("*.py")
        if (names := named_upwards(package, parsed(path).texts))
        and path.relative_to(ROOT).as_posix() not in NAMES_THE_PROJECT
    }
    assert found == {}


@pytest.mark.parametrize(
    ("package", "text"),
    [
        ("p2os", 'NEED = "bluepill_sim._native"'),
        ("p2os", "import_module('robot_bench.run')"),
        ("p2os", 'hint = f"pip install {x} robot-bench"'),
        ("bluepill_sim", 'hint = "see p2os.client"'),
        ("p2os", 'EPILOG = "p2os run dodge --world arena"'),
        ("bluepill_sim", 'hint = "p2os doctor"'),
        ("simbase", 'def f():\n    """What it is."""\n    return "bluepill-sim"'),
    ],
)
def test_a_text_that_names_what_is_above_is_seen(package: str, text: str) -> None:
    assert len(named_upwards(package, texts(text))) == 1


def test_what_is_below_beside_or_no_module_may_be_named() -> None:
    assert named_upwards("robot_bench", texts('"p2os.cli.main"')) == []
    assert named_upwards("bluepill_sim", texts('"p2os.parts"')) == [], "a group of entry points"
    assert named_upwards("p2os", texts('"""Beside robot_bench.run."""')) == [], "a docstring"


# A house where nothing else is, by hiding the rest.


def python(house: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python where only a house's closure is there."""
    return subprocess.run(
        [sys.executable, *words], cwd=ROOT, env=environment(HOUSES[house], HOUSES),
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip


def test_the_toolkit_alone_lists_its_verbs_and_tells_the_rest_as_not_installed() -> None:
    listed = python("p2os", "-m", "p2os", "--help")
    assert listed.returncode == 0
    assert re.search(r"(?m)^  serve ", listed.stdout)
    shown = set(re.findall(r"(?m)^  ([a-z]+) ", listed.stdout))
    assert not shown & {"run", "mcu"}
    assert set(re.findall(r"\bp2os ([a-z]+)", listed.stdout)) <= shown, "the examples are of what is there"
    reported = python("p2os", "-m", "p2os", "doctor", "--json")
    assert reported.returncode == 0, reported.stderr
    names = {row["name"] for row in json.loads(reported.stdout)}
    assert {"pyserial", "packaging"} <= names
    assert not names & {"unicorn", "bluepill_sim._native", "robot_bench._edges"}


def test_the_emulator_alone_runs_a_program_and_a_wrong_word_is_a_line() -> None:
    program = str(ROOT / "robot_bench" / "firmware" / "motors.elf")
    ran = python("bluepill-sim", "-m", "bluepill_sim", "run", program, "--for", "1ms")
    assert ran.returncode == 0, ran.stderr
    assert "0.001" in ran.stderr
    wrong = python("bluepill-sim", "-m", "bluepill_sim", "run", "no_such.elf")
    assert wrong.returncode == 2
    assert wrong.stderr.startswith("python -m bluepill_sim: cannot read no_such.elf")
    assert "p2os" not in python("bluepill-sim", "-m", "bluepill_sim", "run", "--help").stdout


def test_the_emulator_alone_has_the_verbs_of_the_toolkits_mcu() -> None:
    pages = [
        python("bluepill-sim", "-m", "bluepill_sim", "--help").stdout,
        python("robot-bench", "-m", "p2os", "mcu", "--help").stdout,
    ]
    alone, together = (set(re.findall(r"(?m)^  ([a-z]+)  ", page)) for page in pages)
    assert alone == together >= {"run", "debug", "pins"}
    assert "p2os" not in pages[0]


def test_what_is_hidden_is_not_there() -> None:
    for house, module in (("simbase", "p2os"), ("p2os", "bluepill_sim.board"), ("bluepill-sim", "p2os.robots")):
        done = python(house, "-c", f"import {module}")
        assert f"No module named '{module.split('.')[0]}" in done.stderr


def test_each_page_of_a_house_has_examples_to_run() -> None:
    pages = {page for house in houses(with_tests_alone=True).values() for page in house.pages}
    assert sorted(pages - {str(page) for page in runnable(0)}) == []


@pytest.mark.soak
@pytest.mark.parametrize("house", HOUSES)
def test_the_tests_of_a_house_pass_where_nothing_else_is(house: str) -> None:
    words = [sys.executable, "-m", "tools.packaging.testing", house, "-m", "not soak and not hardware"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=1800, check=False)
    assert done.returncode == 0, done.stdout[-4000:]
