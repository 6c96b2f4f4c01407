"""`p2os new --from`: each layout of a project is found, the bench is put beside it, and nothing of it is changed."""

import os
import re
import shutil
import subprocess
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

import pytest

from p2os.cli.main import run as p2os
from robot_bench.cli.project.existing import LAYOUTS, find_project, layout_of, preset_programs
from robot_bench.cli.project.files import project_files, write_project
from robot_bench.firmware.build import COMPILER
from robot_bench.scenario.loading import load_scenario
from tests.tools.forked_python import PYTEST, forked_python

ELF = files("robot_bench.firmware").joinpath("motors.elf").read_bytes()
#: What each layout looks like: its files, where its program is, its sources, and what ties the bench into its build.
PROJECTS: Mapping[str, tuple[tuple[str, ...], str, str, str]] = {
    "PlatformIO": (("platformio.ini", "src/main.cpp"), ".pio/build/bluepill/firmware.elf", "src", "bench/pio_bench.py"),
    "Rust": (("Cargo.toml", "src/main.rs"), "target/thumbv7m-none-eabi/debug/blinky", "src", ".cargo/config.toml"),
    "Zephyr": (("CMakeLists.txt", "prj.conf", "src/main.c"), "build/zephyr/zephyr.elf", "src", "bench/bench.cmake"),
    "STM32CubeIDE": ((".cproject", "blinky.ioc", "Core/Src/main.c"), "Debug/blinky.elf", "Core/Src", ""),
    "Arduino": (("blinky.ino",), "build/STMicroelectronics.stm32.GenF1/blinky.ino.elf", ".", ""),
    "CMake": (("CMakeLists.txt", "src/main.c"), "build/blinky.elf", "src", "bench/bench.cmake"),
    "STM32CubeMX": (("blinky.ioc", "Makefile", "Core/Src/main.c"), "build/blinky.elf", "Core/Src", ""),
    "make": (("Makefile", "main.c"), "build/blinky.elf", ".", ""),
}
ALWAYS = {"bench/bench.toml", "bench/test_bench.py", ".vscode/tasks.json", ".vscode/launch.json"}
EACH = pytest.mark.parametrize("layout", PROJECTS)


def project(folder: Path, layout: str) -> Path:
    """Make a project that was built."""
    names, program, *_ = PROJECTS[layout]
    for name in (*names, program):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"of {layout}", encoding="utf-8")
    (folder / program).write_bytes(ELF)
    return folder


def held(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_every_layout_is_tried_here() -> None:
    assert [layout.name for layout in LAYOUTS] == list(PROJECTS)


@EACH
def test_program_and_sources_of_each_layout_are_found(layout: str, tmp_path: Path) -> None:
    _, program, sources, tie = PROJECTS[layout]
    found = find_project(project(tmp_path, layout), layout_of(tmp_path))
    assert (found.layout.name, found.program.as_posix(), found.sources.as_posix()) == (layout, program, sources)
    assert list(found.layout.ties) == ([tie] if tie else [])
    assert found.build == found.layout.build.format(made=Path(program).parent)


def test_what_is_written_beside_runs_and_no_file_of_the_project_is_changed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = held(project(tmp_path / "blinky", "PlatformIO"))
    monkeypatch.chdir(tmp_path)
    assert p2os(["new", "--from", "blinky"]) == 0
    after = held(tmp_path / "blinky")
    assert {name: after[name] for name in before} == before
    assert after.keys() - before.keys() == ALWAYS | {"bench/pio_bench.py"}
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "blinky (PlatformIO): program .pio/build/bluepill/firmware.elf, sources src"
    assert said[2:] == [
        "add     platformio.ini, under [env:…]: extra_scripts = bench/pio_bench.py",
        "next    cd blinky && pytest bench",
        "or      cd blinky && pio run -t bench",
    ]
    scenario = load_scenario("blinky/bench/bench.toml")
    assert scenario.firmware.resolve() == (tmp_path / "blinky/.pio/build/bluepill/firmware.elf").resolve()
    tests = (tmp_path / "blinky/bench/test_bench.py").read_text(encoding="utf-8")
    assert "bench.expect_text('motors: ready', within=\"10 ms\")" in tests
    assert 'bench.expect_pin("p2dx_con", "high", within="10 ms")' in tests
    assert "@" not in re.sub(r"@pytest", "", tests)
    compile(tests, "test_bench.py", "exec")
    assert '"command": "pio run"' in (tmp_path / "blinky/.vscode/tasks.json").read_text(encoding="utf-8")


def test_what_is_there_is_left_and_said_and_a_second_time_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project(tmp_path, "Rust")
    (tmp_path / ".cargo").mkdir()
    (tmp_path / ".cargo/config.toml").write_text("[build]\n", encoding="utf-8")
    assert p2os(["new", "--from", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "left    .cargo/config.toml: there already" in said
    assert "add     .cargo/config.toml, under [target.thumbv7m-none-eabi]: runner =" in said
    assert (tmp_path / ".cargo/config.toml").read_text(encoding="utf-8") == "[build]\n"
    before = held(tmp_path)
    assert p2os(["new", "--from", str(tmp_path)]) == 2
    assert "bench/bench.toml is there already" in capsys.readouterr().err
    assert held(tmp_path) == before


def test_a_runner_of_cargo_that_is_written_needs_nothing_more(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert p2os(["new", "--from", str(project(tmp_path, "Rust"))]) == 0
    assert "add " not in capsys.readouterr().out
    assert 'runner = "p2os run bench/bench.toml --firmware"' in (tmp_path / ".cargo/config.toml").read_text()


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["--from", "nowhere"], 2, "there is no folder nowhere"),
        (["--from", "empty"], 2, "empty is laid out in no known way"),
        (["--from", "raw"], 2, "raw (make) has no program (looked for build/*.elf, *.elf, */*.elf)"),
        (["--from", "raw", "--build", "exit 3"], 1, "the build has failed: exit 3 (exit code 3)"),
        (["--from", "raw", "--build", "true"], 2, "raw (make) has no program"),
        (["--from", "pc"], 2, "firmware.elf"),
        ([], 2, "one folder is needed"),
        (["mine", "--from", "raw"], 2, "one folder is needed"),
        (["--from", "raw", "--robot", "rover"], 2, "--robot is for a new project"),
    ],
)
def test_what_cannot_be_is_one_line_and_nothing_is_written(
    words: list[str], code: int, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    (tmp_path / "empty").mkdir()
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw/Makefile").write_text("", encoding="utf-8")
    (project(tmp_path / "pc", "PlatformIO") / ".pio/build/bluepill/firmware.elf").write_bytes(ELF[:100])
    monkeypatch.chdir(tmp_path)
    before = held(tmp_path)
    assert p2os(["new", *words]) == code
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) <= 2
    assert held(tmp_path) == before


def test_of_several_programs_the_newest_is_taken_and_the_others_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project(tmp_path, "PlatformIO")
    other = tmp_path / ".pio/build/other/firmware.elf"
    other.parent.mkdir()
    other.write_bytes(ELF)
    for path, at in ((other, 1000), (tmp_path / ".pio/build/bluepill/firmware.elf", 1001)):
        os.utime(path, (at, at))
    assert p2os(["new", "--from", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "program .pio/build/bluepill/firmware.elf" in said
    assert "older   .pio/build/other/firmware.elf" in said


def test_the_folders_of_cmakes_presets_are_looked_in(tmp_path: Path) -> None:
    presets = (
        '{"configurePresets": [{"name": "debug", "binaryDir": "${sourceDir}/out/${presetName}"},'
        ' {"name": "odd", "binaryDir": "${sourceDir}/$env{PLACE}/x"}, {"name": "far", "binaryDir": "/opt/far"},'
        ' {"name": "up", "binaryDir": "${sourceDir}/../up"}, {"name": "inherits"}]}'
    )
    (tmp_path / "CMakePresets.json").write_text(presets, encoding="utf-8")
    assert preset_programs(tmp_path) == ["out/debug/*.elf", "out/debug/*/*.elf", "*/x/*.elf", "*/x/*/*.elf"]
    for odd in ("{", "[]", '{"configurePresets": 3}', '{"configurePresets": [1]}'):
        (tmp_path / "CMakePresets.json").write_text(odd, encoding="utf-8")
        assert preset_programs(tmp_path) == []


@pytest.mark.soak
@pytest.mark.skipif(not all(map(shutil.which, (COMPILER, "cmake", "make"))), reason="no cross compiler or no CMake")
def test_a_project_of_cmake_has_targets_that_run_the_bench(tmp_path: Path) -> None:
    shims, mine = tmp_path / "bin", tmp_path / "blinky"
    shims.mkdir()
    write_project(mine, project_files("kinematic", build="cmake"))
    python = forked_python()
    for name, words in {"p2os": "-m p2os", "pytest": f"-c '{PYTEST}' -p no:cacheprovider"}.items():
        (shims / name).write_text(f'#!/bin/sh\nexec {python} {words} "$@"\n', encoding="utf-8")
        (shims / name).chmod(0o755)
    environment = {**os.environ, "PATH": f"{shims}:{os.environ['PATH']}"}
    assert p2os(["new", "--from", str(mine), "--build", "cmake -B build && cmake --build build"]) == 0
    with (mine / "CMakeLists.txt").open("a", encoding="utf-8") as stream:
        stream.write("include(bench/bench.cmake)\nbench_program(robot)\n")
    for target, said in (("bench", "report.html"), ("bench-tests", " passed")):
        done = subprocess.run(  # noqa: S602  # as the page says it
            f"cmake -B build && cmake --build build --target {target}",
            shell=True, cwd=mine, env=environment, capture_output=True, text=True, check=False, timeout=120,
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        assert said in done.stdout
