"""From a failure of a campaign to the commit that brought it: `git bisect run` with the script in its folder."""

import os
import shlex
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from bluepill_sim.program.image import load_image
from bluepill_sim.program.mutants import mutants, mutated_file
from robot_bench.campaign.results import BISECT
from robot_bench.campaign.whole import begin, carry_out
from robot_bench.campaign.workers.processes import Processes
from robot_bench.firmware.build import HERE
from tests.tools.forked_python import forked_p2os

FILE = """
scenario = "walled.toml"
search = "random"
batch = 2
near_misses = 0
[budget]
runs = 2
[cheap]
mode = "direct"
duration_s = 5.0
[full]
mode = "direct"
body = "kinematic"
duration_s = 5.0
[vary]
seed = { from = 0, to = 9 }
[[goal]]
kind = "answers"
any_high = ["DD4", "DD5"]
signal = "mean"
most = 0
within_s = 0.1
"""
SCENARIO = """
extends = "dodge"
firmware = "last.elf"
[[obstacle]]
at_s = 0
name = "wall"
shape = "box"
x_m = 0.9
y_m = 0.0
length_m = 0.1
width_m = 2.0
height_m = 0.5
[[goal]]
kind = "no_collision"
"""
#: Which commit is bad first; the one that does not build.
BAD, BROKEN, COMMITS = 4, 2, 7
pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="no git")


def firmware(number: int) -> bytes:
    """Return the program of a commit: each prints another text; from `BAD` on it does not turn for what is ahead."""
    content = (HERE / "dodge.elf").read_bytes()
    image = load_image(HERE / "dodge.elf")
    start = image.symbols.address_of("drive_on")
    assert start is not None
    if number >= BAD:
        inside = mutants(image, range(start & ~1, start + 200, 2))
        change = next(
            one for one in inside if one.alteration.before.startswith("bne") and one.alteration.after == "nop"
        )
        content = mutated_file(content, change, image)
    return content.replace(b"dodge: ready", f"dodge: rea{number}y".encode())


def git(repository: Path, *words: str, path: str = "") -> str:
    who = {f"GIT_{role}_{key}": "a" for role in ("AUTHOR", "COMMITTER") for key in ("NAME", "EMAIL")}
    alone = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull, "LC_ALL": "C"}
    environment = {**os.environ, **who, **alone, "PATH": f"{path}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(
        ["git", *words], cwd=repository, env=environment, capture_output=True, text=True, check=True
    )  # fmt: skip
    return done.stdout


@pytest.fixture
def failures(tmp_path: Path) -> Path:
    """Return the failures of a campaign with the program of the last commit."""
    (tmp_path / "mine.toml").write_text(FILE)
    (tmp_path / "walled.toml").write_text(SCENARIO)
    (tmp_path / "last.elf").write_bytes(firmware(COMMITS))
    campaign = begin(tmp_path / "mine.toml", tmp_path / "found", firmware=tmp_path / "last.elf", overrides={})
    workers = Processes(1, campaign.limits)
    try:
        carry_out(campaign, tmp_path / "found", workers, clock=time.monotonic_ns)
    finally:
        workers.close()
    return tmp_path / "found" / "failures"


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """Return a repository of seven commits, whose build copies a file; one has an error in its source."""
    folder = tmp_path / "repository"
    folder.mkdir()
    git(folder, "init", "-q")
    for number in range(1, COMMITS + 1):
        (folder / "robot.source").write_bytes(firmware(number))
        (folder / "build.sh").write_text(
            f"mkdir -p build && cp robot.source build/robot.elf && exit {number == BROKEN:d}"
        )
        git(folder, "add", ".")
        git(folder, "commit", "-q", "-m", f"Version {number}")
        git(folder, "tag", f"v{number}")
    return folder


@pytest.mark.soak
def test_a_failure_finds_the_commit_that_brought_it(failures: Path, repository: Path, tmp_path: Path) -> None:
    assert sorted(path.name for path in failures.iterdir()) == ["0001", "0002"]
    command = tmp_path / "bin" / "p2os"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec {shlex.join(forked_p2os())} "$@"\n')
    command.chmod(0o755)
    git(repository, "bisect", "start", "v7", "v1")
    judge = ["sh", str(failures / "0001" / "bisect.sh"), "build/robot.elf", "sh", "build.sh"]
    said = git(repository, "bisect", "run", *judge, path=str(command.parent))
    assert f"{git(repository, 'rev-parse', f'v{BAD}').strip()} is the first bad commit" in said
    log = git(repository, "bisect", "log")
    assert "# skip: " not in log or "Version 2" in log
    assert "# bad: " in log


@pytest.mark.parametrize(
    ("found", "code"), [(0, 0), (1, 1), (2, 125), (125, 125), (127, 130), (130, 130)]
)  # fmt: skip
def test_what_a_run_ends_with_is_what_git_is_told(found: int, code: int, tmp_path: Path) -> None:
    (tmp_path / "it is.sh").write_text(BISECT.substitute(scenario="'my robot.toml'", trust=" --trust"))
    command = tmp_path / "p2os"
    command.write_text(f'#!/bin/sh\necho "$@" >{tmp_path}/asked\nexit {found}\n')
    command.chmod(0o755)
    environment = {**os.environ, "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}

    def judged(*words: str) -> int:
        words = ("sh", str(tmp_path / "it is.sh"), *words)
        return subprocess.run(words, cwd=tmp_path, env=environment, check=False).returncode

    (tmp_path / "robot.elf").touch()
    assert judged("robot.elf", "true") == judged("robot.elf") == code
    asked = (tmp_path / "asked").read_text()
    assert asked.startswith(f"run {tmp_path}/my robot.toml --firmware robot.elf --out ")
    assert asked.endswith("/run --trust\n")
    assert judged("robot.elf", "false") == judged("none.elf", "true") == 125
