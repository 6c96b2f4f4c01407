"""Read the ESP32's program with a compiler that is here: `python adapter_fw/check_esp32.py [--idf DIR[@REF] …]`.

Without --idf against stub headers of our own. With it against the headers of a copy of ESP-IDF that you have (a
checkout, or any git directory with the revision behind an @), and with --bluepad32 and --btstack those of the game
pad: each board, with and without a pad; what is deprecated is an error. Also, what the project asks of each copy is
looked for in it: the components that CMakeLists.txt requires and the options that sdkconfig.* sets. What cannot be
read is skipped aloud.

Where LLVM 22 is installed it is compiled and assembled for the ESP32's processor, else only read. This is no build:
nothing is linked. docs/adapter-firmware.md, Builds, says what has been built with ESP-IDF itself.
"""

import argparse
import importlib.util
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
PROJECT = HERE / "esp32"
BOARDS = ("rev_b", "rev_c", "thesis_board", "thesis_table3")
PADS = ("none", "bluepad32")
FLAGS = ("-std=gnu++17", "-Wall", "-Wextra", "-Wshadow", "-Werror", "-fno-exceptions", "-fno-rtti")
STUBS = ("g++", "-fsyntax-only", "-isystem", str(HERE / "stubs" / "esp32"))
#: For the real headers: 32 bits and newlib, as on the ESP32; its inline assembly is read, not assembled.
CROSS = "arm-none-eabi-g++"
#: Where it is there: compiles and assembles for the ESP32's processor, with the same newlib's headers.
CLANG = "clang++-22"

#: Folders of headers that the program's own pull in, below components/; those that a version has not are left out.
HEADERS = (
    "bootloader_support/include", "driver/gpio/include", "driver/uart/include", "driver/include", "driver/*/include",
    "esp_blockdev/include", "esp_common/include", "esp_driver_gpio/include", "esp_driver_mcpwm/include",
    "esp_driver_uart/include",
    "esp_event/include", "esp_hal_*/include", "esp_hal_*/esp32/include", "esp_hw_support/include",
    "esp_hw_support/include/soc", "esp_hw_support/etm/include",
    "esp_hw_support/port/esp32/include", "esp_partition/include", "esp_ringbuf/include", "esp_rom/include",
    "esp_rom/esp32/include", "esp_rom/esp32/include/esp32", "esp_rom/esp32", "esp_system/include",
    "esp_system/port/include", "esp_timer/include", "freertos/FreeRTOS-Kernel/include", "freertos/config/include",
    "freertos/config/include/freertos", "freertos/config/xtensa/include",
    "freertos/FreeRTOS-Kernel/portable/xtensa/include",
    "freertos/FreeRTOS-Kernel/portable/xtensa/include/freertos", "freertos/esp_additions/include",
    "freertos/esp_additions/include/freertos", "freertos/esp_additions/arch/xtensa/include", "hal/esp32/include",
    "hal/include", "hal/platform_port/include", "heap/include", "log/include", "nvs_flash/include", "soc/include",
    "soc/esp32/include", "soc/esp32/register", "spi_flash/include", "xtensa/include", "xtensa/esp32/include",
)  # fmt: skip
#: One header of a C library that must not come with the others of its folder.
LONE_HEADERS = ("newlib/platform_include/esp_newlib.h", "esp_libc/platform_include/esp_newlib.h")
#: What the configuration of an ESP32 comes to, as far as these headers ask.
SDKCONFIG = """#pragma once
#define CONFIG_IDF_TARGET "esp32"
#define CONFIG_IDF_TARGET_ESP32 1
#define CONFIG_IDF_TARGET_ARCH_XTENSA 1
#define CONFIG_LIBC_NEWLIB 1
#define CONFIG_FREERTOS_HZ 1000
#define CONFIG_FREERTOS_MAX_TASK_NAME_LEN 16
#define CONFIG_FREERTOS_NUMBER_OF_CORES 2
#define CONFIG_FREERTOS_TASK_NOTIFICATION_ARRAY_ENTRIES 1
#define CONFIG_LOG_MAXIMUM_LEVEL 2
#define CONFIG_LOG_DEFAULT_LEVEL 2
#define CONFIG_LOG_VERSION 1
#define CONFIG_LOG_TIMESTAMP_SOURCE_RTOS 1
#define CONFIG_BLUEPAD32_MAX_DEVICES 1
#define CONFIG_BLUEPAD32_PLATFORM_CUSTOM 1
"""
#: What CMake does with the component's file, said instead of done.
LIST_COMPONENTS = """
macro(idf_component_register)
  cmake_parse_arguments(ASKED "" "" "SRCS;INCLUDE_DIRS;REQUIRES" ${ARGN})
  message("requires ${ASKED_REQUIRES}")
  return()
endmacro()
include("%s")
"""


@dataclass(frozen=True, slots=True)
class SourceCopy:
    """A copy of somebody's repository: a checkout, or a git directory with a revision."""

    words: str

    @property
    def name(self) -> str:
        """Return what a person calls the copy."""
        return self.words if "@" not in self.words else self.words.rpartition("@")[2]

    def unpack(self, target: Path, *folders: str) -> Path:
        """Return a folder with the files of the copy; of a git directory only these folders are unpacked.

        Raises:
            ValueError: There is nothing to read.
        """
        place, _, revision = self.words.partition("@")
        if not revision:
            if not Path(place).is_dir():
                raise ValueError(f"{place} is no folder")
            return Path(place)
        target.mkdir(parents=True)
        command = ["git", "-C", place, "archive", "--format=tar", revision, *folders]
        with tempfile.TemporaryFile() as archive:
            done = subprocess.run(command, stdout=archive, stderr=subprocess.PIPE, check=False)
            if done.returncode != 0:
                raise ValueError(done.stderr.decode(errors="replace").strip().splitlines()[-1])
            archive.seek(0)
            with tarfile.open(fileobj=archive) as files:
                files.extractall(target, filter="data")
        return target


@dataclass(slots=True)
class Copies:
    """Unpacked headers to compile against."""

    name: str
    idf: Path
    bluepad32: Path | None
    btstack: Path | None
    own: Path
    folders: list[Path] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.own.mkdir(parents=True, exist_ok=True)
        components = self.idf / "components"
        chip = (components / "soc/esp32/include/soc/Kconfig.soc_caps.in").read_text(encoding="utf-8")
        able = "".join(f"#define CONFIG_{name} 1\n" for name in re.findall(r"config (\w+)\s+bool\s+default y", chip))
        (self.own / "sdkconfig.h").write_text(SDKCONFIG + able, encoding="utf-8")
        self.folders = [self.own, *(path for pattern in HEADERS for path in sorted(components.glob(pattern)))]
        for lone in LONE_HEADERS:
            if (components / lone).exists():
                shutil.copy(components / lone, self.own)
        if self.bluepad32 is not None and self.btstack is not None:
            port = self.btstack / "port" / "esp32" / "components"
            self.folders += [
                self.bluepad32 / "src" / "components" / "bluepad32" / "include", self.btstack / "src",
                self.btstack / "platform" / "freertos", port / "btstack" / "include",
                port / "btstack_config" / "include",
                *sorted((self.btstack / "3rd-party" / "bluedroid").glob("*/include")),
                self.btstack / "3rd-party" / "yxml",
            ]  # fmt: skip

    @property
    def compiler(self) -> tuple[str, ...]:
        """Return a compiler that finds these headers."""
        idf = (
            "-D__XTENSA__",
            "-DESP_PLATFORM",
            *(word for path in self.folders for word in ("-isystem", str(path))),
        )
        if shutil.which(CLANG) is None:
            return CROSS, "-fsyntax-only", *idf
        asked = subprocess.run(
            [CROSS, "-E", "-v", "-x", "c++", "-"], input="", capture_output=True, text=True, check=True
        )
        listed = asked.stderr.partition("search starts here:\n#include <...>")[2].partition("End of search list")[0]
        newlib = [path for line in listed.split() if "/lib/gcc/" not in (path := str(Path(line).resolve()))]
        builtin = subprocess.run(
            [CLANG, "-print-resource-dir"], capture_output=True, text=True, check=True
        ).stdout.strip()
        own = [word for path in (*newlib, f"{builtin}/include") for word in ("-isystem", path)]
        features = [word for name in esp32_features() for word in ("-Xclang", "-target-feature", "-Xclang", f"+{name}")]
        return CLANG, "--target=xtensa", *features, "-Os", "-ffunction-sections", "-nostdinc", "-c", *idf, *own


def esp32_features() -> tuple[str, ...]:
    """Return what an ESP32's processor has, as build.py says it."""
    spec = importlib.util.spec_from_file_location("adapter_fw_build", HERE / "build.py")
    assert spec is not None and spec.loader is not None  # noqa: PT018, S101 - it stands beside this file
    sys.modules["adapter_fw_build"] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    features: tuple[str, ...] = module.ESP32_FEATURES
    return features


def sources(pad: str) -> list[Path]:
    """Return the program's own sources, with one of the pads."""
    pads = {f"pad_{other}.cpp" for other in PADS if other != pad}
    return [path for path in sorted((PROJECT / "main").glob("*.cpp")) if path.name not in pads]


def complaints(board: str, pad: str, robot: str = "p2dx", compiler: tuple[str, ...] = STUBS) -> str:
    """Return the compiler's words; nothing where all is sound."""
    command = [*compiler, *FLAGS, f'-DADAPTER_ROBOT="{robot}"', "-I", str(HERE / "generated" / board)]
    with tempfile.TemporaryDirectory() as folder:  # for objects, where there are any
        done = subprocess.run(
            [*command, *map(str, sources(pad))], capture_output=True, text=True, check=False, cwd=folder
        )
    return done.stderr


def check_boards(compiler: tuple[str, ...] = STUBS, pads: tuple[str, ...] = PADS) -> int:
    """Check every board with every pad; the thesis's boards must be refused. Returns how many were not as expected."""
    failed = 0
    for board in BOARDS:
        for pad in pads:
            words = complaints(board, pad, compiler=compiler)
            is_expected = bool(words) is board.startswith("thesis")
            verdict = "refused" if words else "sound"
            print(f"  {board}, pad {pad}: {verdict}{'' if is_expected else '  <- not expected'}")
            if not is_expected:
                sys.stderr.write(words)
                failed += 1
    return failed


def components(idf: Path, folder: Path) -> list[str] | None:
    """Return the components that the program requires of a copy of ESP-IDF; None where there is no CMake."""
    if shutil.which("cmake") is None:
        return None
    script = folder / "components.cmake"
    script.write_text(LIST_COMPONENTS % (PROJECT / "main" / "CMakeLists.txt"), encoding="utf-8")
    command = ["cmake", "-E", "env", f"IDF_PATH={idf}", "cmake", "-P", str(script)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return re.findall(r"requires (.*)", done.stderr)[0].split(";")


def options(file: str) -> list[str]:
    """Return the names that a file of settings sets."""
    return re.findall(r"^CONFIG_(\w+)=", (PROJECT / file).read_text(encoding="utf-8"), re.MULTILINE)


def known_options(folders: list[Path]) -> set[str]:
    """Return the names that the menus of some folders define."""
    texts = (
        path.read_text(encoding="utf-8") for folder in folders for path in folder.rglob("Kconfig*") if path.is_file()
    )
    return {name for text in texts for name in re.findall(r"^\s*(?:menu)?config\s+(\w+)", text, re.MULTILINE)}


def check_project(copies: Copies) -> int:
    """Look for all that the project asks for; return how much is missing."""
    asked = components(copies.idf, copies.own)
    if asked is None:
        print("  components: skipped, cmake is not installed (apt-get install cmake)")
        asked = []
    missing = [f"component {name}" for name in asked if not (copies.idf / "components" / name).is_dir()]
    known = known_options([copies.idf / "components", copies.idf])
    missing += [f"option {name}" for name in options("sdkconfig.defaults") if name not in known]
    if copies.bluepad32 is not None and copies.btstack is not None:
        known |= known_options([copies.bluepad32 / "src", copies.btstack / "port" / "esp32"])
        missing += [f"option {name}" for name in options("sdkconfig.pad") if name not in known]
    print(f"  required: {', '.join(asked)}; {'missing: ' + ', '.join(missing) if missing else 'all there'}")
    return len(missing)


def check_copy(words: argparse.Namespace, idf: SourceCopy, folder: Path) -> int:
    """Check against one copy of ESP-IDF; return how much is wrong."""
    if shutil.which(CROSS) is None:
        print(
            f"{idf.name}: skipped, {CROSS} is not installed (apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi)"
        )
        return 0
    try:
        pad = [
            SourceCopy(text).unpack(folder / name, *parts) if text else None
            for name, text, parts in (
                ("bluepad32", words.bluepad32, ("src/components",)),
                ("btstack", words.btstack, ("src", "platform/freertos", "port/esp32", "3rd-party")),
            )
        ]
        copies = Copies(idf.name, idf.unpack(folder / "idf", "components", "Kconfig"), *pad, folder / "own")
    except ValueError as error:
        print(f"{idf.name}: skipped, {error}")
        return 0
    how = "compiled for the ESP32" if shutil.which(CLANG) is not None else "read"
    print(f"{idf.name}, headers of its own, {how}:")
    pads = PADS if all(pad) else ("none",)
    if len(pads) == 1:
        print("  pad bluepad32: skipped, needs --bluepad32 and --btstack")
    return check_project(copies) + check_boards(copies.compiler, pads)


def main() -> int:
    """Check against the stubs, or against the copies that are named."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )  # fmt: skip
    parser.add_argument(
        "--idf", metavar="DIR[@REF]", action="append", default=[], help="a copy of ESP-IDF; again for more"
    )
    parser.add_argument("--bluepad32", metavar="DIR[@REF]", help="a copy of Bluepad32")
    parser.add_argument("--btstack", metavar="DIR[@REF]", help="a copy of BTstack")
    words = parser.parse_args()
    if not words.idf:
        print("stub headers:")
        return min(check_boards(), 1)
    failed = 0
    for idf in map(SourceCopy, words.idf):
        with tempfile.TemporaryDirectory() as folder:
            failed += check_copy(words, idf, Path(folder))
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
