"""The body of who names none: the best that is installed, decided in one place."""

import json
import signal
import subprocess
from pathlib import Path

import pytest

from p2os.pioneer.body.factory import BEST, body_note, make_body, resolve_body
from p2os.pioneer.world import load_world
from p2os.robots.parameters import load_parameters
from simbase.errors import UsageError
from tests.tools.forked_python import forked_python

#: Runs the command line in a Python in which some packages are not installed; runs have no plots, which cost most.
WITHOUT = """
import importlib.abc, sys

class Missing(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {missing!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Missing())
from robot_bench.report import make
make._plots = lambda: None
from p2os.cli.main import main
main({words!r})
"""
SCENARIO = 'firmware = "motors.elf"\nworld = "room"\nduration_s = 0.2\nmode = "direct"\n'
#: What is missing → the body that is left, and what its note says.
LEFT = [
    (["pybullet"], "mujoco", "body mujoco: the best that is installed (bullet needs pybullet)"),
    (
        ["pybullet", "mujoco"],
        "kinematic",
        "body kinematic: the best that is installed (bullet needs pybullet, mujoco needs mujoco)",
    ),
]


def p2os(missing: list[str], words: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    code = WITHOUT.format(missing=missing, words=words)
    return subprocess.run(
        [forked_python(), "-c", code], cwd=folder, check=False, capture_output=True, text=True, timeout=60
    )


@pytest.mark.parametrize(("missing", "body", "note"), LEFT)
def test_a_scenario_without_a_body_takes_the_best_that_is_left_and_says_so(
    missing: list[str], body: str, note: str, tmp_path: Path
) -> None:
    (tmp_path / "own.toml").write_text(SCENARIO, encoding="utf-8")
    done = p2os(missing, ["run", "own.toml", "--out", "run"], tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"body {body}" in done.stdout.splitlines()[0]
    assert f"note    {note}" in done.stdout
    outcome = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert outcome["body"] == body
    assert note in outcome["notes"]


@pytest.mark.parametrize(("missing", "body", "note"), LEFT)
def test_serve_demo_and_programs_take_the_same_body(missing: list[str], body: str, note: str, tmp_path: Path) -> None:
    demo = p2os(missing, ["demo", "--duration", "0.05s", "--out", "run", "--json"], tmp_path)
    outcome = json.loads(demo.stdout)
    assert (outcome["body"], note in outcome["notes"]) == (body, True)
    code = WITHOUT.format(missing=missing, words=[]).replace("main([])", "") + (
        "from p2os.pioneer.serve import served_pioneer\n"
        "with served_pioneer() as robot: print(robot.body, flush=True)\n"
        "main(['serve', '--port', 'tcp:127.0.0.1:0', '--json'])\n"
    )
    with subprocess.Popen(
        [forked_python(), "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as served:
        assert served.stdout is not None
        first, start = served.stdout.readline(), served.stdout.readline()
        served.send_signal(signal.SIGINT)
        said, errors = served.communicate(timeout=60)
    assert (first, json.loads(start)["body"], said) == (f"{body}\n", body, "")
    assert f"note: {note}" in errors


def test_a_body_that_is_named_and_not_installed_is_refused_with_what_to_do(tmp_path: Path) -> None:
    done = p2os(["pybullet"], ["run", "dodge", "--duration", "0.1s"], tmp_path)
    assert done.returncode == 2
    assert "p2os: the bullet body needs pybullet" in done.stderr
    assert "--body best" in done.stderr


def test_a_named_body_needs_no_note() -> None:
    assert [body_note(name) for name in ("bullet", "mujoco", "kinematic")] == [None] * 3
    assert body_note(BEST) == "body bullet: the best that is installed"
    body = make_body(BEST, load_world("room"), load_parameters("p2dx"))
    assert body.name == resolve_body(BEST) == "bullet"
    with pytest.raises(UsageError, match="3 is no body's name"):
        resolve_body(3)  # type: ignore[arg-type]  # what a program may have got wrong
    with pytest.raises(UsageError, match="no body 'ode'"):
        resolve_body("ode")
