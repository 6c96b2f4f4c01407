"""The ESP32's program and the Arduino library, as far as a PC can tell: syntax, tables, projects, what runs here."""

import argparse
import configparser
import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from adapter_sim.pinout import faults_of, load_pinout
from tests.adapter_fw.builds import BUILD, ROOT, load_script

CHECK = load_script("adapter_fw/check_esp32.py")
FIRMWARE = ROOT / "adapter_fw"

needs_compiler = pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed: apt-get install g++")


def project() -> configparser.ConfigParser:
    parser = configparser.ConfigParser()
    parser.read(FIRMWARE / "esp32" / "platformio.ini", encoding="utf-8")
    return parser


@needs_compiler
@pytest.mark.parametrize("pad", CHECK.PADS)
@pytest.mark.parametrize("board", ["rev_b", "rev_c"])
def test_the_esp32_program_fits_its_headers(board: str, pad: str) -> None:
    assert not CHECK.complaints(board, pad)


def test_headers_that_are_not_there_are_skipped_aloud(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    words = argparse.Namespace(bluepad32=None, btstack=None)
    assert CHECK.check_copy(words, CHECK.SourceCopy(f"{tmp_path}/idf"), tmp_path) == 0
    assert "skipped" in capsys.readouterr().out


@pytest.mark.soak
@pytest.mark.skipif("P2OS_ESP_IDF" not in os.environ, reason="P2OS_ESP_IDF names no copy of ESP-IDF (DIR or DIR@REF)")
def test_the_esp32_program_fits_the_headers_of_esp_idf(tmp_path: Path) -> None:
    words = argparse.Namespace(bluepad32=os.environ.get("P2OS_BLUEPAD32"), btstack=os.environ.get("P2OS_BTSTACK"))
    assert CHECK.check_copy(words, CHECK.SourceCopy(os.environ["P2OS_ESP_IDF"]), tmp_path) == 0


def test_plain_esp_idf_finds_the_sources_and_the_drivers_of_its_version(tmp_path: Path) -> None:
    if shutil.which("cmake") is None:
        pytest.skip("cmake is not installed: apt-get install cmake")
    assert (FIRMWARE / "esp32" / "main" / "CMakeLists.txt").exists()
    assert CHECK.components(tmp_path, tmp_path)[0] == "driver"
    (tmp_path / "components" / "esp_driver_uart").mkdir(parents=True)
    assert CHECK.components(tmp_path, tmp_path)[:3] == ["esp_driver_gpio", "esp_driver_mcpwm", "esp_driver_uart"]


def test_the_library_names_only_boards_with_a_cpp_library() -> None:
    text = (FIRMWARE / "library" / "library.properties").read_text(encoding="utf-8")
    named = re.search(r"^architectures=(.*)$", text, re.MULTILINE)
    assert named is not None
    assert not {"*", "avr", "megaavr"} & set(named[1].split(","))


@needs_compiler
@pytest.mark.parametrize("revision", ["thesis-table3", "thesis-board"])
def test_a_board_that_cannot_work_is_refused_with_every_reason(revision: str) -> None:
    words = CHECK.complaints(revision.replace("-", "_"), "none")
    for fault in faults_of(load_pinout(), revision):
        assert fault in words


@needs_compiler
def test_a_robot_that_nobody_knows_does_not_compile() -> None:
    assert "dereferencing a null pointer" in CHECK.complaints("rev_b", "none", robot="r2d2")


def test_every_environment_of_the_project_names_a_board_and_a_pad_that_exist() -> None:
    parser = project()
    environments = [name for name in parser.sections() if name.startswith("env:")]
    for name in environments:
        board, pad = re.fullmatch(
            r"-DADAPTER_BOARD=(\w+) -DADAPTER_PAD=(\w+)", parser[name]["board_build.cmake_extra_args"]
        ).groups()
        assert (FIRMWARE / "generated" / board / "pins.hpp").exists()
        assert (FIRMWARE / "esp32" / "main" / f"pad_{pad}.cpp").exists()
    assert parser["platformio"]["default_envs"] == "rev-b"
    assert "env:thesis-table3" in environments


def test_the_project_compiles_every_source_of_the_esp32() -> None:
    listed = (FIRMWARE / "esp32" / "main" / "CMakeLists.txt").read_text(encoding="utf-8")
    for path in CHECK.sources("none"):
        assert path.name in listed or path.name.startswith("pad_")


def test_no_address_of_a_pad_and_no_password_stands_in_the_code() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in (FIRMWARE / "esp32").rglob("*.[ch]pp"))
    assert not re.search(r"(?:[0-9A-Fa-f]{2}:){5}[0-9A-Fa-f]{2}", text)


@needs_compiler
def test_the_packed_library_is_whole_and_its_sketch_fits(tmp_path: Path) -> None:
    library = load_script("adapter_fw/pack_library.py").pack(tmp_path)
    files = [*(library / "src").rglob("*.cpp"), library / "examples" / "Drive" / "Drive.ino"]
    done = subprocess.run(
        ["g++", "-x", "c++", "-std=gnu++17", "-Wall", "-Wextra", "-Wshadow", "-Werror", "-fsyntax-only",
         "-isystem", FIRMWARE / "stubs" / "arduino", "-I", library / "src", *files],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_the_librarys_two_descriptions_agree_with_each_other_and_the_firmware() -> None:
    described = json.loads((FIRMWARE / "library" / "library.json").read_text(encoding="utf-8"))
    lines = (FIRMWARE / "library" / "library.properties").read_text(encoding="utf-8").splitlines()
    properties = dict(line.split("=", 1) for line in lines)
    assert (described["name"], described["version"]) == (properties["name"], properties["version"])
    header = (FIRMWARE / "core" / "app" / "version.hpp").read_text(encoding="utf-8")
    assert f'"{described["version"]}"' in header
    for example in described["examples"]:
        for name in example["files"]:
            assert (FIRMWARE / "library" / example["base"] / name).exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cortex-m", "xtensa"])
def test_the_library_compiles_for_a_microcontroller(name: str, tmp_path: Path) -> None:
    target = BUILD.TARGETS[name]
    if not BUILD.is_installed(name):
        pytest.skip(f"{target.compiler} is not installed: apt-get install {target.package}")
    library = load_script("adapter_fw/pack_library.py").pack(tmp_path)
    source, include = library / "src" / "P2OSClient.cpp", ["-I", library / "src"]
    command = [target.compiler, "-std=gnu++17", *target.flags, *include, "-isystem", FIRMWARE / "stubs" / "arduino"]
    subprocess.run([*command, "-c", source, "-o", tmp_path / "client.o"], check=True, timeout=120)
