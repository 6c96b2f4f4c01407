"""What a user gets who has no checkout: the source distribution, the wheel that is built from it, and NOTICE.

The slow tests take the build's own tools from a package index and say so where none is reached.
"""

import email
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from importlib.metadata import Distribution, distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.tools.made_once import made_once

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PACKAGES = ("simbase", "p2os", "bluepill_sim", "adapter_sim", "robot_bench")
PARTS = ("bluepill_sim._native", "robot_bench._edges", "robot_bench._adapter_firmware", "robot_bench._esp32")
LIMIT_S = 300

#: What of the checkout only the checkout needs.
OF_THE_CHECKOUT = (".ci/", ".gitignore")

#: What of the packages is compiled into the wheel and need not lie in it.
COMPILED = ("bluepill_sim/extension/source/", "robot_bench/wires/edges.c")

CONSTRAINTS = ROOT / "constraints.txt"

BUILD = "import sys; from setuptools import build_meta; print(getattr(build_meta, sys.argv[1])(sys.argv[2]))"


def tracked() -> list[str]:
    """Return every file of the project, those included that are not committed yet."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout.splitlines()
    if not listed:
        pytest.skip("no git checkout: nothing tells which files are the project's")
    return [name for name in listed if (ROOT / name).is_file() and not (ROOT / name).is_symlink()]


def python_of(folder: Path, *requirements: str) -> Path:
    """Return the Python of a new environment that holds nothing but what is named."""
    venv.create(folder)
    command = [sys.executable, "-m", "pip", "--python", folder / "bin" / "python", "install"]
    # Compiled is what a test imports, and no more: half of the time otherwise.
    options = ["--quiet", "--disable-pip-version-check", "--no-compile"]
    done = subprocess.run(
        [*command, *options, "-c", CONSTRAINTS, *requirements],
        cwd=folder, env=clean_environment(), capture_output=True, text=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip
    if "No matching distribution found" in done.stderr or "connection" in done.stderr.lower():
        pytest.skip(f"no package index is reached: {done.stderr.splitlines()[-1]}")
    assert done.returncode == 0, done.stderr
    return folder / "bin" / "python"


def clean_environment(**more: str) -> dict[str, str]:
    """Return the environment without what would bring the checkout back or choose a core."""
    left_out = ("PYTHONPATH", "P2OS_CORE", "P2OS_NATIVE")
    return {name: value for name, value in os.environ.items() if name not in left_out} | more


def build(builder: Path, sources: Path, kind: str, out: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a step of the build as pip does, in a folder of sources."""
    out.mkdir(exist_ok=True)
    return subprocess.run(
        [builder, "-c", BUILD, f"build_{kind}", out],
        cwd=sources, env=clean_environment(**environment), capture_output=True, text=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip


def unoptimized(folder: Path, compiler: str) -> str:
    """Return a compiler that takes half the time; how well the parts run is looked at in the checkout's."""
    script = folder / compiler
    script.write_text(f'#!/bin/sh\nexec {compiler} "$@" -O0\n')
    script.chmod(0o755)
    return str(script)


def built(done: subprocess.CompletedProcess[str], out: Path) -> Path:
    """Return the file that a build has made."""
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return out / done.stdout.splitlines()[-1]


def normal(name: str) -> str:
    """Return a package's name as indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def licences() -> dict[str, tuple[str, set[str]]]:
    """Return the tables of NOTICE: a package's licence, and the extras or the package that bring it."""
    rows = [re.split(r" {2,}", line) for line in (ROOT / "NOTICE").read_text(encoding="utf-8").splitlines()]
    return {normal(row[0]): (row[1], set(row[2].split(", "))) for row in rows if len(row) == 3 and row[0] != "package"}


def required() -> dict[str, set[str]]:
    """Return what pyproject.toml requires, with the extras that name it."""
    lists = {"every use": PROJECT["project"]["dependencies"], "build": PROJECT["build-system"]["requires"]}
    lists |= {name: lines for name, lines in PROJECT["project"]["optional-dependencies"].items() if name != "all"}
    found: dict[str, set[str]] = {}
    for extra, lines in lists.items():
        for line in lines:
            found.setdefault(normal(Requirement(line).name), set()).add(extra)
    return found


def test_notice_names_every_package_that_an_extra_brings() -> None:
    named = {name: extras for name, (_, extras) in licences().items()}
    assert {name: extras for name, extras in named.items() if name in required()} == required()
    pinned = {normal(line.split("==")[0]) for line in CONSTRAINTS.read_text(encoding="utf-8").splitlines()[1:]}
    assert named.keys() == pinned | required().keys()
    assert {next(iter(named[name])) for name in named.keys() - required().keys()} <= required().keys()


def test_notice_names_what_those_packages_bring_in_their_turn() -> None:
    brought = {normal(requirement.name)
               for one in distributions() if normal(one.name) in licences()
               for requirement in map(Requirement, one.requires or ())
               if not requirement.marker or requirement.marker.evaluate({"extra": ""})}  # fmt: skip
    assert sorted(brought - licences().keys()) == []


def test_notice_says_what_a_package_says_of_its_licence() -> None:
    told = {normal(one.name): told_licence(one) for one in distributions()}
    assert "bsd" in told.pop("unicorn", "bsd"), "its metadata tells of the binding; the engine is GPL-2.0"
    named = {name: words(licence) for name, (licence, _) in licences().items() if told.get(name)}
    assert [(name, told[name]) for name, every in named.items() if not all(word in told[name] for word in every)] == []


def told_licence(package: Distribution) -> str:
    """Return what a package's metadata says of its licence, in small letters; "" where it says nothing."""
    classes = [line for line in package.metadata.get_all("Classifier") or () if line.startswith("License")]
    fields = [package.metadata.get(field, "")[:300] for field in ("License-Expression", "License")]
    return " ".join([*fields, *classes]).strip().lower()


def words(licence: str) -> list[str]:
    """Return the words of a licence in NOTICE that metadata has too, however it writes the version."""
    return [re.sub(r"-[\d.]+(-clause)?$", "", word) for word in licence.lower().split(" or ")]


@pytest.fixture(scope="module")
def builder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def make(place: Path) -> Path:
        return python_of(place, *PROJECT["build-system"]["requires"])

    return made_once(tmp_path_factory, "builder", make)


@pytest.fixture(scope="module")
def sdist(builder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    def make(place: Path) -> Path:
        for name in tracked():
            (place / "clone" / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, place / "clone" / name)
        return built(build(builder, place / "clone", "sdist", place), place)

    return made_once(tmp_path_factory, "sdist", make)


@pytest.fixture
def unpacked(sdist: Path, tmp_path: Path) -> Path:
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    return tmp_path / sdist.name.removesuffix(".tar.gz")


@pytest.fixture(scope="module")
def wheel(builder: Path, sdist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    def make(place: Path) -> Path:
        with tarfile.open(sdist) as archive:
            archive.extractall(place, filter="data")
        compilers = {"CC": unoptimized(place, "cc"), "CXX": unoptimized(place, "c++")}
        return built(build(builder, place / sdist.name.removesuffix(".tar.gz"), "wheel", place, **compilers), place)

    return made_once(tmp_path_factory, "wheel", make)


@pytest.mark.slow
def test_the_source_distribution_holds_every_file_of_the_project(sdist: Path) -> None:
    with tarfile.open(sdist) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    assert [name for name in tracked() if name not in held and not name.startswith(OF_THE_CHECKOUT)] == []


@pytest.mark.slow
def test_a_wheel_from_the_source_distribution_holds_the_data_and_both_compiled_parts(wheel: Path) -> None:
    held = zipfile.ZipFile(wheel).namelist()
    wanted = [name for name in tracked() if name.startswith(PACKAGES) and not name.startswith(COMPILED)]
    assert [name for name in wanted if name not in held] == []
    for part in PARTS:
        assert any(name.startswith(f"{part.replace('.', '/')}.") and name.endswith(".so") for name in held), part
    assert [name for name in held if not name.startswith((*PACKAGES, "p2os-"))] == []


@pytest.mark.slow
def test_the_page_of_the_package_points_to_nothing_that_only_a_checkout_has(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        page = email.message_from_bytes(archive.read(name)).get_payload()
    assert "# p2os" in page
    assert "](" not in page.replace("](http", ""), "a relative link leads nowhere outside the repository"
    assert "source distribution" in page


@pytest.mark.slow
def test_the_wheel_drives_the_demo_in_an_empty_environment(wheel: Path, tmp_path: Path) -> None:
    program = python_of(tmp_path / "user", f"{wheel}[sim]").parent / "p2os"

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


@pytest.mark.slow
def test_a_part_that_does_not_compile_fails_the_build(builder: Path, unpacked: Path, tmp_path: Path) -> None:
    (unpacked / "bluepill_sim/extension/source/core/core.h").unlink()
    done = build(builder, unpacked, "wheel", tmp_path / "out")
    assert done.returncode != 0
    assert "bluepill_sim._native does not compile" in done.stderr
    assert "P2OS_NATIVE=0" in done.stderr, "the way round it"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("environment", "reason"),
    [({"PATH": ""}, "no C compiler was found"), ({"P2OS_NATIVE": "0"}, "P2OS_NATIVE=0 was set")],
    ids=["no compiler", "not wanted"],
)
def test_a_part_that_is_left_out_leaves_its_reason(
    builder: Path, unpacked: Path, tmp_path: Path, environment: dict[str, str], reason: str
) -> None:
    folder = unpacked / "build" / f"lib.{sysconfig.get_platform()}-{sys.implementation.cache_tag}" / "bluepill_sim"
    folder.mkdir(parents=True)
    (folder / f"_native{sysconfig.get_config_var('EXT_SUFFIX')}").write_text("of an earlier build")
    done = build(builder, unpacked, "wheel", tmp_path / "out", **environment)
    with zipfile.ZipFile(built(done, tmp_path / "out")) as archive:
        assert not [name for name in archive.namelist() if name.endswith(".so")]
        assert archive.read("bluepill_sim/_native.left_out").decode().startswith(reason[:9])
    assert f"bluepill_sim._native is left out: {reason}" in done.stdout + done.stderr
