"""Workflows call what a person calls: their make targets and verbs exist, versions are named, linters accept them."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from robot_bench.cli.project import files as project
from robot_bench.firmware.build import COMPILER
from tests.documentation.command_lines import command_line, faults
from tests.tools.forked_python import PYTEST, forked_python

yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).resolve().parents[3]
GITHUB, GITLAB = ROOT / ".github", ROOT / ".gitlab" / "bench.yml"
WORKFLOWS = sorted((GITHUB / "workflows").glob("*.yml"))
ACTIONS = sorted((GITHUB / "actions").glob("*/action.yml"))
BENCH = GITHUB / "actions" / "bench" / "action.yml"
#: What each workflow of the issue is, and where it is.
WANTED = {
    "make lint": "tests", "make type": "tests", "make unit": "tests", "make test HOUSE": "tests", "make site": "wheels",
    "make wheels": "wheels", "make board-check": "board", "make soak": "nightly", "make foreign": "nightly",
    "make bench-history": "bench",
}  # fmt: skip
PINNED = re.compile(r"actions/[a-z-]+@v\d+|\./\.github/actions/[a-z]+")
TARGETS = set(re.findall(r"^([a-z][a-z-]*):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))


def steps(path: Path) -> Iterator[Mapping[str, object]]:
    """Yield every step of a workflow or of an action."""
    found = yaml.safe_load(path.read_text(encoding="utf-8"))
    for job in found.get("jobs", {"": found.get("runs")}).values():
        yield from job["steps"]


def shell_lines(path: Path) -> list[str]:
    return [str(step["run"]) for step in steps(path) if "run" in step]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_runs_nothing_but_make_with_targets_that_exist(path: Path) -> None:
    lines = shell_lines(path)
    assert lines
    for line in lines:
        make, target, *words = line.split()
        assert make == "make"
        assert target in TARGETS, line
        assert all(re.match(r"(FOR|HOUSE|PYTHON)=", word) or "matrix." in word or word == '}}"' for word in words), line


def test_each_part_of_the_ceremony_has_a_job() -> None:
    lines = {path.stem: shell_lines(path) for path in WORKFLOWS}
    assert {
        call: where for call, where in WANTED.items() if any(line.startswith(call) for line in lines[where])
    } == WANTED


def test_each_python_that_the_project_is_for_is_tried() -> None:
    jobs = yaml.safe_load((GITHUB / "workflows" / "tests.yml").read_text(encoding="utf-8"))["jobs"]
    pythons = jobs["tests"]["strategy"]["matrix"]["python"]
    least = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["requires-python"]
    assert pythons == ["3.11", "3.12", "3.13", "3.14"]
    assert least == f">={pythons[0]}"
    houses = tomllib.loads((ROOT / "tools/packaging/houses.toml").read_text(encoding="utf-8"))
    published = [name for name, house in houses.items() if name != "plugins" and house.get("is_published", True)]
    assert jobs["houses"]["strategy"]["matrix"]["house"] == published


@pytest.mark.parametrize("path", [*WORKFLOWS, *ACTIONS], ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_what_is_used_of_others_has_a_version_and_nothing_is_secret(path: Path) -> None:
    for step in steps(path):
        assert "uses" not in step or PINNED.fullmatch(str(step["uses"])), step
        assert str(step.get("uses", "./"))[:2] != "./" or "run" in step or (ROOT / str(step["uses"])).is_dir(), step
        # An expression within a shell's line would be pasted into it unquoted.
        assert "inputs." not in str(step.get("run", "")), step
    text = path.read_text(encoding="utf-8")
    assert "secrets." not in text
    assert "://" not in text


@pytest.mark.parametrize("path", [BENCH, GITLAB], ids=["github", "gitlab"])
def test_what_users_take_calls_verbs_and_options_that_exist(path: Path) -> None:
    words = re.findall(r"p2os (?:run|campaign)[^;&|\n]*", path.read_text(encoding="utf-8"))
    assert len(words) >= 2
    assert [fault for line in words for fault in faults(re.sub(r'"\$\w+"', "X", line), command_line())] == []


def test_a_new_issue_asks_for_doctor_and_a_line_that_shows_it_again() -> None:
    body = yaml.safe_load((GITHUB / "ISSUE_TEMPLATE" / "bug.yml").read_text(encoding="utf-8"))["body"]
    needed = {item["id"] for item in body if item.get("validations", {}).get("required")}
    assert {"doctor", "replay"} <= needed
    assert "p2os doctor" in (GITHUB / "pull_request_template.md").read_text(encoding="utf-8")


def test_the_editors_container_is_built_of_files_that_are_there() -> None:
    folder = ROOT / ".devcontainer"
    text = (folder / "devcontainer.json").read_text(encoding="utf-8")
    found = json.loads(re.sub(r"^\s*//.*$", "", text, flags=re.MULTILINE))
    assert (folder / found["build"]["dockerfile"]).is_file()
    assert found["postCreateCommand"].split()[1] in TARGETS
    assert all(
        "ntried" in (folder / name).read_text(encoding="utf-8") for name in ("devcontainer.json", "Containerfile")
    )


def linted(schema: str, *paths: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "check_jsonschema", "--builtin-schema", schema, *map(str, paths)],
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_a_linter_of_workflows_accepts_each_file(tmp_path: Path) -> None:
    pytest.importorskip("check_jsonschema", reason="check-jsonschema is not installed: workflows are not linted")
    for name, text in project.project_files("kinematic").items():
        if name.endswith(".yml"):
            (tmp_path / Path(name).name).write_text(text, encoding="utf-8")
    linted("vendor.github-workflows", *WORKFLOWS, tmp_path / "robot.yml")
    linted("custom.github-workflows-require-timeout", *WORKFLOWS)
    linted("vendor.github-actions", *ACTIONS)
    linted("vendor.gitlab-ci", GITLAB, tmp_path / ".gitlab-ci.yml")
    linted("vendor.github-issue-forms", *(GITHUB / "ISSUE_TEMPLATE" / f"{name}.yml" for name in ("bug", "wish")))
    linted("vendor.citation-file-format", ROOT / "CITATION.cff")


CAMPAIGN = """
scenario = "just-drive.toml"
search = "sobol"
corpus = "states.jsonl"
[budget]
runs = 2
confirmations = 1
[cheap]
body = "kinematic"
mode = "direct"
duration_s = 0.2
[full]
body = "kinematic"
duration_s = 0.2
[vary]
start.heading_deg = { from = -30, to = 30 }
"""


@pytest.mark.skipif(shutil.which(COMPILER) is None, reason="no cross compiler")
@pytest.mark.soak
@pytest.mark.parametrize("path", [BENCH, GITLAB], ids=["github", "gitlab"])
def test_the_shell_lines_of_what_users_take_pass_on_a_new_project(path: Path, tmp_path: Path) -> None:
    mine, shims = tmp_path / "mine", tmp_path / "bin"
    project.write_project(mine, project.project_files("kinematic"))
    (mine / "campaign.toml").write_text(CAMPAIGN, encoding="utf-8")
    python = forked_python()
    shims.mkdir()
    for name, text in {
        "sudo": "exit 0", "apt-get": "exit 0", "pip": "exit 0", "gh": "exit 1",
        "pytest": f'exec {python} -c {shlex.quote(PYTEST)} -k says "$@" -n 0', "p2os": f'exec {python} -m p2os "$@"',
    }.items():  # fmt: skip
        (shims / name).write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
        (shims / name).chmod(0o755)
    environment = {**os.environ, "PATH": f"{shims}:{os.environ['PATH']}", "GITHUB_ACTION_PATH": str(BENCH.parent)}
    found = yaml.safe_load(path.read_text(encoding="utf-8"))
    if path == BENCH:
        given = {name: str(row["default"]) for name, row in found["inputs"].items()}
        environment |= {name.upper(): value for name, value in given.items()}
        environment |= {"SCENARIO": "just-drive.toml", "CAMPAIGN": "campaign.toml"}
        lines = [line for line in shell_lines(path) if "comment" not in line]
    else:
        for job in (".p2os", ".p2os-bench", ".p2os-campaign"):
            environment |= found[job]["variables"]
        lines = [*found[".p2os"]["before_script"], *found[".p2os-bench"]["script"], *found[".p2os-campaign"]["script"]]
    assert len(lines) >= 5
    for line in [*lines, "p2os campaign comment found --out comment/comment.md"]:
        done = subprocess.run(
            ["bash", "-c", line], cwd=mine, env=environment, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == 0, (line, done.stdout, done.stderr)
    assert {"results.xml", "found", "comment", "states.jsonl"} <= {item.name for item in mine.iterdir()}
