"""`p2os new`: what it writes, what it refuses, and that a student gets from it to a robot that drives."""

import json
import os
import re
import shutil
import subprocess
from configparser import ConfigParser
from importlib.metadata import entry_points
from importlib.resources import files
from pathlib import Path

import pytest
import yaml

from adapter_sim.pinout import load_pinout
from p2os.cli.main import run as p2os
from p2os.pioneer.body.factory import BEST, resolve_body
from robot_bench import Bench
from robot_bench.cli.project import files as project
from robot_bench.firmware.build import COMPILER
from robot_bench.scenario.loading import read_scenario
from tests.tools.forked_python import PYTEST, forked_python

NAMES = {
    "main.c", "Makefile", "README.md", ".gitignore", "just-drive.toml", "tests/test_robot.py", "pytest.ini",
    "board/startup.c", "board/memory.c", "board/f103.h", "board/f103c8.ld", "board/wires.h",
    ".vscode/launch.json", ".github/workflows/robot.yml", ".gitlab-ci.yml",
}  # fmt: skip
PATROL = re.compile(r"```toml\n(# patrol\.toml\n.*?)```", re.DOTALL)

needs_compiler = pytest.mark.skipif(
    shutil.which(COMPILER) is None or shutil.which("make") is None, reason="no cross compiler, or no make"
)


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def held(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def make(*words: str, folder: str = "mine") -> "subprocess.CompletedProcess[str]":
    environment = {**os.environ, "LC_ALL": "C", "MAKEFLAGS": ""}
    return subprocess.run(
        ["make", "-C", folder, *words], capture_output=True, text=True, check=False, env=environment, timeout=120
    )


def test_a_project_is_written_and_the_next_command_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["new", "mine"]) == 0
    assert held(Path("mine")) == NAMES
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("mine: 15 files")
    assert said[-1] == "next: cd mine && make run"
    assert max(map(len, said)) <= 80


@pytest.mark.parametrize("before", [(), (".git",)], ids=["empty", "after git init"])
def test_the_folder_one_is_in_will_do_when_it_is_empty(
    before: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    for name in before:
        Path(name).mkdir()
    assert p2os(["new", "."]) == 0
    assert held(Path()) == NAMES
    assert capsys.readouterr().out.splitlines()[-1] == "next: make run"


def test_what_ships_is_copied_as_it_is_and_the_wires_are_those_of_the_pinout() -> None:
    contents = project.project_files("kinematic")
    for name in ("startup.c", "memory.c", "f103.h", "f103c8.ld"):
        assert contents[f"board/{name}"] == files("robot_bench.firmware").joinpath(name).read_text(encoding="utf-8")
    wires = re.findall(r"^#define (\w+) \{GPIO([A-C]), (\d+)u\}$", contents["board/wires.h"], re.MULTILINE)
    assert {name: f"P{port}{bit}" for name, port, bit in wires} == {
        wire.name.upper(): wire.bluepill for wire in load_pinout().wires
    }


def test_the_scenario_names_its_own_program_and_a_body_and_wants_nothing() -> None:
    project.write_project(Path("mine"), project.project_files("kinematic"))
    Path("mine/build").mkdir()
    Path("mine/build/robot.elf").write_bytes(b"not looked at yet")
    scenario = read_scenario(Path("mine/just-drive.toml"))
    assert (scenario.firmware, scenario.body, scenario.goals) == (Path("mine/build/robot.elf"), "kinematic", ())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["full"], "full is not empty (it holds theirs.c)\nhint: name a folder that is new or empty"),
        (["."], ". is not empty (it holds"),
        (["file"], "file is a file\nhint: name a folder"),
        (["file/below"], "cannot write file/below: not a directory\n"),
        (["two words"], "a folder called 'two words' is not made\nhint: make and shells take"),
        (["a\nb"], "a folder called 'a\\nb' is not made\n"),
        (["--", "-x"], "a folder called '-x' is not made\n"),
        (["a" * 300], "file name too long\n"),
        (["/proc/mine"], "cannot write /proc/mine: no such file or directory\n"),
        ([], "one folder is needed\nhint: p2os new my-robot, or p2os new --from a-project-of-yours\n"),
    ],
)
def test_what_cannot_be_is_one_line_and_a_hint_and_leaves_all_as_it_was(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("full").mkdir()
    Path("full/theirs.c").write_text("mine", encoding="utf-8")
    Path("file").touch()
    assert p2os(["new", *words]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 2)
    assert said in err
    assert held(Path()) == {"full/theirs.c", "file"}
    assert Path("full/theirs.c").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("written", range(17))
def test_a_disk_that_fills_up_leaves_nothing_behind(written: int, monkeypatch: pytest.MonkeyPatch) -> None:
    contents = project.project_files("kinematic")
    left = [written]
    real_open = Path.open

    def fail_at_last(path: Path, *arguments: object, **options: object) -> object:
        left[0] -= 1
        if left[0] < 0:
            raise OSError(28, "No space left on device", str(path))
        return real_open(path, *arguments, **options)  # type: ignore[arg-type,call-overload] # passed on as they come

    monkeypatch.setattr(Path, "open", fail_at_last)
    if written >= len(contents):
        project.write_project(Path("above/mine"), contents)
        return
    with pytest.raises(project.FileError, match="no space left on device"):
        project.write_project(Path("above/mine"), contents)
    assert list(Path().iterdir()) == []


def test_a_missing_compiler_is_reported_with_its_package(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("robot_bench.cli.project.new.COMPILER", "no-such-compiler")
    assert p2os(["new", "mine"]) == 0
    assert capsys.readouterr().err == (
        "no-such-compiler is not installed: sudo apt-get install gcc-arm-none-eabi make\n"
    )


@pytest.mark.skipif(shutil.which("make") is None, reason="no make")
def test_make_without_the_compiler_is_one_line_with_its_package() -> None:
    assert p2os(["new", "mine"]) == 0
    done = make("CC=no-such-compiler")
    assert done.returncode == 2
    assert done.stderr == (
        "Makefile:23: *** no-such-compiler is not installed (hint: sudo apt-get install gcc-arm-none-eabi).  Stop.\n"
    )


def test_a_scenario_in_this_folder_is_named_where_its_suffix_was_forgotten(capsys: pytest.CaptureFixture[str]) -> None:
    project.write_project(Path("mine"), project.project_files("kinematic"))
    os.chdir("mine")
    assert p2os(["run", "just-drive"]) == 2
    assert "hint: the file here is just-drive.toml" in capsys.readouterr().err
    assert p2os(["run", "just-drive.toml"]) == 2
    assert "hint: build it first" in capsys.readouterr().err


@needs_compiler
def test_the_project_builds_without_a_warning_and_again_only_when_something_changed() -> None:
    project.write_project(Path("mine"), project.project_files("kinematic"))
    done = make("WARN=-Wall -Wextra -Wshadow -Wconversion -Werror")
    assert (done.returncode, done.stderr) == (0, "")
    assert "Nothing to be done" in make().stdout
    with Path("mine/board/wires.h").open("a", encoding="utf-8") as stream:
        stream.write("#error noticed\n")
    assert "noticed" in make().stderr


@needs_compiler
@pytest.mark.slow
def test_a_student_gets_from_nothing_to_a_robot_that_drives() -> None:
    assert p2os(["new", "mine"]) == 0
    body = resolve_body(BEST)
    scenario = Path("mine/just-drive.toml")
    text = scenario.read_text(encoding="utf-8")
    assert "duration_s = 60.0" in text
    # A metre before a wall: it turns to the right after 5 s and to the left after 10.
    near = "duration_s = 12.0\nstart = { x_m = 2.0, y_m = 0.0, heading_deg = 0.0 }"
    scenario.write_text(text.replace("duration_s = 60.0", near), encoding="utf-8")
    done = make("run", f"P2OS={forked()} -m p2os")
    assert done.returncode == 0, done.stderr
    assert "\nended well, no goals were set; report: runs/just-drive-001/report.html\n" in done.stdout
    folder = Path("mine/runs/just-drive-001")
    outcome = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert (outcome["body"], outcome["passed"], outcome["collisions"]) == (body, True, 0)
    assert outcome["distance_m"] > 0.7
    printed = (folder / "usart.txt").read_text(encoding="utf-8").splitlines()
    assert outcome["usart_lines"] == len(printed)
    assert outcome["usart_last"] == printed[-1]
    assert set(printed) == {"waiting for the robot", "forward", "turning left", "turning right"}


def forked() -> str:
    """Return a Python that is forked, whose locale is not that of `make` above."""
    return f"env -u LC_ALL {forked_python()}"


def forked_pytest() -> str:
    """Return the words, of a shell or of make, that start pytest in a process that has it imported."""
    return f"{forked()} -c '{PYTEST}' -p no:cacheprovider"


@needs_compiler
def test_make_test_takes_the_pytest_beside_p2os_and_not_the_first_on_the_path(tmp_path: Path) -> None:
    """An environment's p2os on the path, where another pytest comes first; by a link too, as pipx makes one."""
    project.write_project(Path("mine"), project.project_files("kinematic"))
    for folder, name, word in (("own", "p2os", ""), ("own", "pytest", "ours"), ("other", "pytest", "another's")):
        path = tmp_path / folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"#!/bin/sh\necho {word!r}\n", encoding="utf-8")
        path.chmod(0o755)
    (tmp_path / "links").mkdir()
    (tmp_path / "links" / "p2os").symlink_to(tmp_path / "own" / "p2os")
    for first in ("other", "links"):
        path = f"PATH={tmp_path / 'other'}:{tmp_path / ('own' if first == 'other' else first)}:{os.environ['PATH']}"
        done = subprocess.run(
            ["env", path, "make", "-s", "-C", "mine", "test"], capture_output=True, text=True, timeout=60, check=True
        )
        assert done.stdout.splitlines()[-1] == "ours"
    (tmp_path / "own" / "pytest").unlink()
    path = f"PATH={tmp_path / 'other'}:{tmp_path / 'own'}:{os.environ['PATH']}"
    done = subprocess.run(
        ["env", path, "make", "-C", "mine", "test"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert "hint: pip install pytest, where p2os is" in done.stderr


def notices(*slips: tuple[str, str, str]) -> None:
    """Hold the tests of a project to what they notice: each is what is right, what is wrong, and the failing test."""
    main = Path("mine/main.c")
    text = main.read_text(encoding="utf-8")
    for right, wrong, noticed in slips:
        assert right in text
        main.write_text(text.replace(right, wrong), encoding="utf-8")
        words = f"PYTEST={forked_pytest()} -q --tb no --bench-record none -k {noticed.partition('[')[0]}"
        failed = make("test", words, "-s")
        assert failed.returncode != 0
        assert f"FAILED tests/test_robot.py::{noticed}" in failed.stdout, failed.stdout


@needs_compiler
@pytest.mark.slow
def test_the_tests_of_a_new_project_pass_and_notice_what_was_broken() -> None:
    project.write_project(Path("mine"), project.project_files("kinematic"))
    tests = Path("mine/tests/test_robot.py")
    written = tests.read_text(encoding="utf-8")
    assert written.count('during="30 s"') == 1
    tests.write_text(written.replace('during="30 s"', 'during="8 s"'), encoding="utf-8")  # below they are as written
    done = make("test", f"PYTEST={forked_pytest()} -q")
    assert "12 passed" in done.stdout, done.stdout
    notices(
        ("sleep_ticks(1))", "sleep_ticks(7))", "test_the_motors_answer_a_sensor_within_20_ms"),
    )


@needs_compiler
@pytest.mark.soak
def test_the_tests_of_a_new_project_pass_as_they_are_written() -> None:
    project.write_project(Path("mine"), project.project_files("kinematic"))
    done = make("test", f"PYTEST={forked_pytest()} -q")
    assert "12 passed" in done.stdout, done.stdout
    notices(
        ("(1u << 2 | 1u << 3)", "(1u << 1 | 1u << 2)", "test_it_turns_away_from_what_a_sonar_sees[4-right]"),
        ("sleep_ticks(3u *", "sleep_ticks(2u *", "test_it_stands_until_three_seconds"),
        ("? &turn_right", "? &turn_left", "test_it_turns_away_from_what_a_sonar_sees"),
    )


@needs_compiler
@pytest.mark.slow
def test_the_scenario_with_goals_that_the_readme_shows_is_met() -> None:
    project.write_project(Path("mine"), project.project_files("kinematic"))
    assert make().returncode == 0
    shown = PATROL.search(Path("mine/README.md").read_text(encoding="utf-8"))
    assert shown is not None
    assert "duration_s = 60.0" in shown[1]
    Path("mine/patrol.toml").write_text(shown[1].replace("60.0", "25.0"), encoding="utf-8")  # they are met by then
    assert p2os(["run", "mine/patrol.toml", "--out", "patrol"]) == 0


@needs_compiler
@pytest.mark.slow
def test_a_program_from_elsewhere_drives_without_being_judged(capsys: pytest.CaptureFixture[str]) -> None:
    project.write_project(Path("mine"), project.project_files("kinematic"))
    assert make().returncode == 0
    words = ["run", "free-drive", "--firmware", "mine/build/robot.elf", "--body", "kinematic", "--duration", "4s"]
    assert p2os(words) == 0
    assert "ended well, no goals were set" in capsys.readouterr().out


@pytest.mark.parametrize(("options", "said"), [
    (["--build", "ninja"], "there is no --build 'ninja'\nhint: --build make or --build cmake or --build platformio"),
    (["--robot", "tank"], "there is no --robot 'tank'\nhint: --robot p2dx or --robot rover"),
])  # fmt: skip
def test_what_builds_it_and_its_robot_are_of_those_that_there_are(
    options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert p2os(["new", "mine", *options]) == 2
    assert said in capsys.readouterr().err
    assert not Path("mine").exists()


@pytest.mark.parametrize("build", ["make", "cmake", "platformio"])
@pytest.mark.parametrize("robot", ["p2dx", "rover"])
def test_each_file_names_the_program_that_the_build_makes_and_all_of_its_sources(build: str, robot: str) -> None:
    contents = project.project_files("kinematic", build=build, robot=robot)
    firmware = project.BUILDS[build].firmware
    assert f'firmware = "{firmware}"' in contents["just-drive.toml"]
    assert f"--firmware {firmware} " in contents["pytest.ini"]
    assert contents[".vscode/launch.json"].count(firmware) == 2
    built = contents[{"make": "Makefile", "cmake": "CMakeLists.txt", "platformio": "platformio.ini"}[build]]
    sources = {name for name in contents if name.endswith(".c")}
    assert {name for name in sources if name in built} == sources
    assert not [name for name, text in contents.items() if re.search(r"@[A-Z]+@", text)]
    held_back = {"make": "cmake", "cmake": "make test", "platformio": "make"}[build]
    assert held_back not in contents["README.md"]


def test_the_tests_find_the_plug_in_whichever_distribution_brought_it() -> None:
    written = ConfigParser()
    written.read_string(project.project_files("kinematic")["pytest.ini"])
    settings = dict(written["pytest"])
    named = re.findall(r"-p (\S+)", settings["addopts"])
    assert named
    assert {
        point.name for point in entry_points(group="pytest11") if point.module == "robot_bench.cli.pytest_plugin"
    } == set(named)
    assert (
        "required_plugins" not in settings
    )  # pytest reads names of distributions there: p2os, or robot-bench from wheels


def test_the_debuggers_file_is_json_with_comments() -> None:
    text = project.project_files("kinematic")[".vscode/launch.json"]
    found = json.loads(re.sub(r"^\s*//.*$", "", text, flags=re.MULTILINE))
    assert [one["type"] for one in found["configurations"]] == ["cortex-debug", "cppdbg"]
    assert {one.get("gdbTarget") or one["miDebuggerServerAddress"] for one in found["configurations"]} == {
        "localhost:3333"
    }


@needs_compiler
@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake")
def test_cmake_builds_a_program_that_does_what_that_of_make_does() -> None:
    hashes = []
    for build in ("make", "cmake"):
        project.write_project(Path(build), project.project_files("kinematic", build=build))
        assert "TOOLCHAIN" not in project.BUILDS[build].commands, "the plain words of CMake do"
        subprocess.run(project.BUILDS[build].commands, shell=True, cwd=build, check=True, timeout=120)  # noqa: S602
        bench = Bench.from_scenario(f"{build}/just-drive.toml", duration_s=3.2)
        bench.run_until("3.2 s")
        bench.finish()
        hashes.append(bench.text)
    assert hashes[0] == hashes[1]
    assert "forward" in hashes[0]


@needs_compiler
@pytest.mark.soak
@pytest.mark.parametrize(
    ("name", "robot"),
    [(".github/workflows/robot.yml", "p2dx"), (".gitlab-ci.yml", "rover")],
)
def test_the_shell_lines_of_a_ci_file_pass_on_a_project_as_it_is_written(name: str, robot: str) -> None:
    project.write_project(Path("mine"), project.project_files("kinematic", robot=robot))
    found = yaml.safe_load(Path("mine", name).read_text(encoding="utf-8"))
    if "jobs" in found:
        lines = [step["run"] for step in found["jobs"]["bench"]["steps"] if "run" in step]
    else:
        lines = [*found["bench"]["before_script"], *found["bench"]["script"]]
    assert len(lines) == 5
    # What a machine needs once, and the network, are left out; quick tests stand for all, and one worker that pytest
    # starts for those of one robot stands for all of both.
    workers = "-n 1" if robot == "p2dx" else "-n 0"
    shims = {
        "sudo": "exit 0", "apt-get": "exit 0", "pip": "exit 0",
        "pytest": f'exec {forked_pytest()} -k "says or ready or asks" "$@" {workers}',
        "p2os": f'exec {forked()} -m p2os "$@" --duration 1s',
    }  # fmt: skip
    Path("bin").mkdir()
    for shim, text in shims.items():
        Path("bin", shim).write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
        Path("bin", shim).chmod(0o755)
    environment = {**os.environ, "PATH": f"{Path('bin').absolute()}:{os.environ['PATH']}", "P2OS": "p2os"}
    for line in lines:
        done = subprocess.run(  # noqa: S602  # it is a shell's line
            line, shell=True, cwd="mine", env=environment, capture_output=True, text=True, timeout=300, check=False
        )
        # The rover has a second, too little for its goals: open is not missed.
        assert done.returncode == 0, (line, done.stdout, done.stderr)
    assert Path("mine/results.xml").is_file()
    assert Path("mine/drive/coverage.html").is_file()


@needs_compiler
@pytest.mark.soak
def test_the_rovers_tests_pass_and_notice_what_was_broken() -> None:
    project.write_project(Path("mine"), project.project_files("kinematic", robot="rover"))
    pytest_here = f"PYTEST={forked_pytest()} -q"
    done = make("test", f"{pytest_here} -k 'not comes_back'")
    assert "4 passed" in done.stdout, done.stdout
    main = Path("mine/main.c")
    text = main.read_text(encoding="utf-8")
    assert "#define NEAR_MV 1300u" in text
    main.write_text(text.replace("#define NEAR_MV 1300u", "#define NEAR_MV 3300u"), encoding="utf-8")
    failed = make("test", f"{pytest_here} --tb no --bench-record none -k stops_before", "-s")
    assert "FAILED tests/test_robot.py::test_it_stops_before_what_its_front_sensor_sees" in failed.stdout
