"""What a user gets who has no checkout: the wheel of each house, built from its source distribution.

In `make test` the parts in C and C++ are those that the checkout has built, and wheels are unpacked beside links to the
packages that they require. `make soak` compiles them, and has pip install them from a package index, where one is
reached.
"""

import ast
import email
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.tools.made_once import made_once
from tests.whole.building import (
    LIMIT_S,
    PROJECT,
    ROOT,
    build,
    built,
    clean_environment,
    pip_installed,
    tracked,
    unpacked,
)
from tools.packaging.__main__ import built as built_house
from tools.packaging.release import prepare
from tools.packaging.staging import House, houses, stage
from tools.packaging.targets import TARGETS

HOUSES = houses()
#: What a build makes of the sources, and what only it reads.
MADE, READ_BY_THE_BUILD = (
    (".so", ".left_out"),
    (
        "bluepill_sim/extension/source/",
        "bluepill_sim/cli/browser/source/",
        *(
            f"robot_bench/direct/differential/{name}"
            for name in ("bridge.c", "bridge.h", "drive_train.c", "quadrature.c")
        ),
        "robot_bench/wires/edges.c",
    ),
)
PYTEST = ("-m", "pytest", "-q", "--import-mode=importlib", "-p", "no:cacheprovider")
PARTS = [part["name"] for part in PROJECT["tool"]["setuptools"]["ext-modules"]]


#: Instead of a compiler: sees that what a source includes is there, links what the checkout built, and notes of what.
LOOKING = """#!/bin/sh
case " $* " in *" -shared "*) ;; *) exec {compiler} "$@" -E;; esac
echo "$*" >> "$0.links"
while [ "$1" != -o ]; do shift; done
folder=${{2%/*}}
cp "{root}/${{folder##*/}}/${{2##*/}}" "$2"
"""


def looking(folder: Path, compiler: str) -> str:
    script = folder / f"looking-{compiler}"
    script.write_text(LOOKING.format(compiler=compiler, root=ROOT))
    script.chmod(0o755)
    return str(script)


def wheel_of(name: str, place: Path, *, is_compiled: bool) -> Path:
    """Return the wheel of a house, from its source distribution."""
    stage(HOUSES[name], place / "sources")
    archive = built(build(place / "sources", "sdist", place), place)
    with tarfile.open(archive) as packed:
        packed.extractall(place, filter="data")
    compilers = {} if is_compiled else {"CC": looking(place, "cc"), "CXX": looking(place, "c++")}
    return built(build(place / archive.name.removesuffix(".tar.gz"), "wheel", place, **compilers), place)


def all_wheels(factory: pytest.TempPathFactory, *, is_compiled: bool) -> dict[str, Path]:
    """Return the wheel of each house, made once a run."""
    return {
        name: made_once(
            factory,
            f"wheel-{name}-{is_compiled}",
            lambda place, name=name: wheel_of(name, place, is_compiled=is_compiled),
        )
        for name in HOUSES
    }


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return all_wheels(tmp_path_factory, is_compiled=False)


@pytest.fixture(params=["unpacked", pytest.param("by pip", marks=pytest.mark.soak)])
def installed(
    request: pytest.FixtureRequest, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> Callable[..., Path]:
    """Return what makes an environment of houses and packages of others, by their names, and returns its Python."""
    made = all_wheels(tmp_path_factory, is_compiled=request.param == "by pip")
    install = pip_installed if request.param == "by pip" else unpacked
    return lambda *names: install(
        tmp_path / "user", [made[name] for name in names if name in made], [name for name in names if name not in made]
    )


def files_of(wheel: Path) -> set[str]:
    """Return the files that a wheel's RECORD names, without those about the distribution."""
    with zipfile.ZipFile(wheel) as archive:
        record = next(name for name in archive.namelist() if name.endswith(".dist-info/RECORD"))
        names = [line.split(",")[0] for line in archive.read(record).decode().splitlines()]
    return {name for name in names if ".dist-info/" not in name}


def left_out(house: str, wheel: Path) -> list[str]:
    """Return the files of a house's folders that its wheel lacks."""
    held, folders = files_of(wheel), tuple(f"{folder}/" for folder in HOUSES[house].folders)
    return [
        name for name in tracked()
        if name.startswith(folders) and not name.startswith(READ_BY_THE_BUILD) and name not in held
    ]  # fmt: skip


@pytest.mark.slow
def test_no_file_is_in_two_wheels_and_none_is_left_out(wheels: dict[str, Path]) -> None:
    held = [name for wheel in wheels.values() for name in files_of(wheel)]
    assert len(held) == len(set(held))
    assert {name: left_out(name, wheel) for name, wheel in wheels.items() if left_out(name, wheel)} == {}
    assert {name for name in held if name.endswith(MADE)} == {f"{part.replace('.', '/')}.so" for part in PARTS}


@pytest.mark.slow
def test_a_source_distribution_has_every_source_of_its_parts(wheels: dict[str, Path]) -> None:
    found: set[str] = set()
    for wheel in wheels.values():
        (archive,) = wheel.parent.glob("*.tar.gz")
        with tarfile.open(archive) as packed:
            found |= {name.partition("/")[2] for name in packed.getnames()}
    parts = PROJECT["tool"]["setuptools"]["ext-modules"]
    named = {
        pattern: list(ROOT.glob(pattern)) for part in parts for pattern in (*part["sources"], *part.get("depends", ()))
    }
    assert [pattern for pattern, files in named.items() if not files] == []
    assert {path.relative_to(ROOT).as_posix() for files in named.values() for path in files} - found == set()


@pytest.mark.slow
def test_parts_that_are_built_at_the_same_time_share_no_object(wheels: dict[str, Path]) -> None:
    """The ESP32's program is compiled for either revision of the board: with the other's pins it would start, too."""
    linked = [
        {Path(wheel.parent, word) for word in line.split() if word.endswith(".o")}
        for wheel in wheels.values() for noted in wheel.parent.glob("looking-*.links")
        for line in noted.read_text().splitlines()
    ]  # fmt: skip
    assert len(linked) == len(PARTS)
    assert min(map(len, linked)) > 1
    assert len(set().union(*linked)) == sum(map(len, linked))


@pytest.mark.slow
def test_a_wheel_is_for_every_python_and_of_a_platform_only_where_parts_are_in_c(wheels: dict[str, Path]) -> None:
    tags = {name: wheel.stem.split("-", 2)[2] for name, wheel in wheels.items()}
    assert tags["simbase"] == tags["p2os"] == "py3-none-any"
    for name in ("bluepill-sim", "robot-bench"):
        assert tags[name].startswith("py3-none-linux_"), tags


@pytest.mark.slow
def test_a_data_file_that_is_left_out_of_a_wheel_is_named(tmp_path: Path) -> None:
    sources = stage(HOUSES["p2os"], tmp_path / "sources")
    table = sources / "pyproject.toml"
    table.write_text(table.read_text(encoding="utf-8").replace(', "*.lua"', ""), encoding="utf-8")
    wheel = built(build(sources, "wheel", tmp_path), tmp_path)
    assert left_out("p2os", wheel) == ["p2os/capture/p2os.lua"]


#: Tests of the emulator that take little: of images, of code that is not run, of variables.
OF_THE_EMULATOR = ("alterations", "image", "static_code", "variables")


def shortest_tests(place: Path, *names: str) -> Path:
    """Copy tests to where the checkout is not."""
    for name in ("tests/conftest.py", "tests/tools", *names):
        source, target = ROOT / name, place / name
        target.parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if source.is_dir() else shutil.copyfile)(source, target)
    return place


@pytest.mark.slow
def test_the_toolkits_wheel_drives_a_robot_where_nothing_else_is(
    installed: Callable[..., Path], tmp_path: Path
) -> None:
    program = installed("simbase", "p2os", "pytest", "hypothesis")
    code = """
from p2os import Robot, served_pioneer
with served_pioneer(world="room") as url, Robot(url) as robot:
    robot.drive(0.1)
    print(robot.state.pose)
"""
    place = shortest_tests(tmp_path, "tests/p2os/protocol", "tests/golden")
    for words in (
        ["-c", code],
        ["-m", "p2os", "doctor"],
        [*PYTEST, "tests/p2os/protocol/test_frames.py"],
    ):
        done = subprocess.run(
            [program, *words], cwd=place, env=clean_environment(),
            capture_output=True, text=True, timeout=LIMIT_S, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
def test_the_emulators_wheel_runs_a_program_where_nothing_else_is(
    installed: Callable[..., Path], tmp_path: Path
) -> None:
    program = installed("simbase", "bluepill-sim", "pytest", "hypothesis")
    elf = str(ROOT / "robot_bench" / "firmware" / "motors.elf")
    place = shortest_tests(tmp_path, "tests/bluepill_sim", "robot_bench/firmware")
    for words in (
        ["-m", "bluepill_sim", "run", elf, "--for", "10ms"],
        [*PYTEST, *(f"tests/bluepill_sim/program/test_{name}.py" for name in OF_THE_EMULATOR)],
    ):
        done = subprocess.run(
            [program, *words], cwd=place, env=clean_environment(),
            capture_output=True, text=True, timeout=LIMIT_S, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", HOUSES)
def test_the_page_of_a_house_points_to_nothing_that_only_a_checkout_has(wheels: dict[str, Path], name: str) -> None:
    with zipfile.ZipFile(wheels[name]) as archive:
        file = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        page = email.message_from_bytes(archive.read(file)).get_payload()
    assert f"# {name}\n" in page
    assert "](" not in page.replace("](http", ""), "a relative link leads nowhere outside the repository"


@pytest.mark.slow
def test_all_houses_drive_the_demo_in_an_empty_environment(installed: Callable[..., Path], tmp_path: Path) -> None:
    program = installed(*HOUSES).parent / "p2os"

    def said_by(*words: str) -> str:
        done = subprocess.run(
            [program, *words], cwd=tmp_path, env=clean_environment(P2OS_CORE="native"),
            capture_output=True, text=True, timeout=LIMIT_S, check=False,
        )  # fmt: skip
        assert done.returncode in {0, 1}, done.stderr  # 1: a goal that this short a run cannot reach
        return done.stdout

    found = {finding["name"]: finding["found"] for finding in json.loads(said_by("doctor", "--json"))}
    assert [found[part] for part in PARTS] == ["built"] * len(PARTS)
    assert json.loads(said_by("demo", "--duration", "1s", "--json"))["scenario"] == "dodge"
    driven = said_by("run", "motors", "--body", "kinematic", "--adapter", "firmware", "--duration", "1s", "--json")
    assert json.loads(driven)["scenario"] == "motors"


@pytest.fixture
def emulator(tmp_path: Path) -> Path:
    return stage(HOUSES["bluepill-sim"], tmp_path / "bluepill-sim")


@pytest.mark.slow
def test_a_part_that_does_not_compile_fails_the_build(emulator: Path, tmp_path: Path) -> None:
    (emulator / "bluepill_sim/extension/source/core/core.h").unlink()
    done = build(emulator, "wheel", tmp_path / "out")
    assert done.returncode != 0
    assert "bluepill_sim._native does not compile" in done.stderr
    assert "P2OS_NATIVE=0" in done.stderr, "the way round it"


@pytest.mark.slow
def test_a_build_without_a_compiler_fails_and_names_both_ways_on(emulator: Path, tmp_path: Path) -> None:
    done = build(emulator, "wheel", tmp_path / "out", PATH="")
    assert done.returncode != 0
    assert "no C compiler was found, which bluepill_sim._native needs" in done.stderr
    assert "apt-get install g++" in done.stderr
    assert "P2OS_NATIVE=0" in done.stderr


@pytest.mark.slow
def test_a_part_that_is_not_wanted_leaves_its_reason(emulator: Path, tmp_path: Path) -> None:
    folder = emulator / "build" / f"lib.{sysconfig.get_platform()}-{sys.implementation.cache_tag}" / "bluepill_sim"
    folder.mkdir(parents=True)
    for left in ("_native.so", f"_native{sysconfig.get_config_var('EXT_SUFFIX')}"):
        (folder / left).write_text("of an earlier build")
    done = build(emulator, "wheel", tmp_path / "out", PATH="", P2OS_NATIVE="0")
    with zipfile.ZipFile(built(done, tmp_path / "out")) as archive:
        assert not [name for name in archive.namelist() if name.endswith(".so")]
        assert archive.read("bluepill_sim/_native.left_out").decode() == "P2OS_NATIVE=0 was set\n"
    assert "bluepill_sim._native is left out: P2OS_NATIVE=0 was set" in done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("platform", "ending"),
    [pytest.param("macosx_11_0_arm64", "so", marks=pytest.mark.soak), ("win_amd64", "pyd")],
)
def test_a_wheel_for_another_machine_has_its_tag_and_the_ending_of_its_libraries(
    emulator: Path, tmp_path: Path, platform: str, ending: str
) -> None:
    compilers = {"CC": looking(tmp_path, "cc"), "P2OS_WHEEL_PLATFORM": platform}
    script = tmp_path / "looking-cc"  # what is linked has the ending that was asked for
    script.write_text(script.read_text().replace("${2##*/}", "_native.so"))
    made = built(build(emulator, "wheel", tmp_path / "out", **compilers), tmp_path / "out")
    assert made.stem.split("-", 2)[2] == f"py3-none-{platform}"
    assert [name for name in files_of(made) if "_native." in name] == [f"bluepill_sim/_native.{ending}"]


#: Imports every module of a house where Unix's are not there, and says which do not come.
WITHOUT_UNIX = """
import importlib, os, pkgutil, socket, sys
import serial, serial.tools.list_ports  # pyserial has a file for each system, and takes this one's

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {hidden!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

for name in {hidden!r}:
    sys.modules.pop(name, None)
sys.meta_path.insert(0, Hidden())
del os.fork, socket.AF_UNIX
for folder in {folders!r}:
    for module in pkgutil.walk_packages(importlib.import_module(folder).__path__, f"{{folder}}."):
        if not module.name.endswith("__main__") and ".so" not in module.module_finder.find_spec(module.name).origin:
            try:
                importlib.import_module(module.name)
            except ModuleNotFoundError as error:
                if error.name in {hidden!r}:
                    print(module.name)
            except AttributeError:
                print(module.name)
"""
#: Of Python's own library, what Windows has not.
UNIX_ALONE = ["termios", "tty", "pty", "fcntl", "resource", "grp", "pwd", "syslog", "readline"]


@pytest.mark.slow
@pytest.mark.parametrize("house", HOUSES.values(), ids=HOUSES)
def test_a_house_is_offered_where_every_import_of_it_exists(house: House) -> None:
    code = WITHOUT_UNIX.format(hidden=UNIX_ALONE, folders=list(house.folders))
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert bool(done.stdout.split()) == house.needs_unix, done.stdout
    assert [target.tag for target in TARGETS.values() if not house.runs_on(target.is_unix)] == (
        ["win_amd64"] if house.needs_unix else []
    )


def late_imports(path: Path) -> Iterator[str]:
    """Yield the imports of Unix's modules within functions of a file that no `try` stands around."""
    text = path.read_text(encoding="utf-8")
    if not any(name in text for name in UNIX_ALONE):
        return
    tree = ast.parse(text)
    tried = {id(node) for block in ast.walk(tree) if isinstance(block, ast.Try) for node in ast.walk(block)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom) and id(node) not in tried:
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [each.name for each in node.names]
            yield from (f"{path}:{node.lineno}" for name in names if name in UNIX_ALONE)


def test_a_house_for_every_system_answers_for_what_it_imports_late() -> None:
    folders = [folder for house in HOUSES.values() if not house.needs_unix for folder in house.folders]
    assert [found for folder in folders for path in (ROOT / folder).rglob("*.py") for found in late_imports(path)] == []


@pytest.mark.soak
def test_what_is_handed_out_has_a_manual_completions_and_a_bill_and_is_the_same_bytes_twice(tmp_path: Path) -> None:
    outs = [tmp_path / "once", tmp_path / "twice"]
    for number, out in enumerate(outs):
        place = prepare(HOUSES["p2os"], tmp_path / f"sources {number}")
        for path in place.rglob("*"):
            os.utime(path, (1_700_000_000 + 86_400 * number,) * 2)
        done = built_house(place, out, {}, is_wheel_alone=False)
        assert done.returncode == 0, done.stderr
    files = [{path.name: path.read_bytes() for path in out.iterdir()} for out in outs]
    assert len(files[0]) == 2
    assert files[0] == files[1]
    (wheel,) = outs[0].glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        texts = {name: archive.read(name).decode() for name in archive.namelist() if ".data/data/share/" in name}
        (bill,) = (json.loads(archive.read(name)) for name in archive.namelist() if "/sboms/" in name)
    names = {name.partition("/share/")[2] for name in texts}
    verbs = PROJECT["project"]["entry-points"]["p2os.verbs"]
    assert {f"man/man1/p2os-{verb}.1" for verb, module in verbs.items() if module.startswith("p2os.")} <= names
    assert not [name for name in names if "p2os-run" in name], "of a house above"
    assert {"bash-completion/completions/p2os", "zsh/site-functions/_p2os", "man/man1/p2os.1"} <= names
    serve = next(text for name, text in texts.items() if name.endswith("/p2os-serve.1"))
    assert "\n.SH OPTIONS\n" in serve
    assert "\\-\\-robot" in serve
    parts = {part["name"] for part in bill["components"]}
    assert {"pyserial", "simbase", "three", "uplot"} <= parts
    assert bill["metadata"]["component"]["version"] == PROJECT["project"]["version"]
