"""The files of a new project, and how they get into a folder.

What ships with the example programs (start-up, linker script, registers) and the scenario `free-drive` is copied
from there; the wires are written from the adapter's pin-out; the rest stands in `template/`.

Invariant: a file that is there is never overwritten, and a project is written whole or not at all.
"""

import contextlib
import os
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path

from adapter_sim.pinout import Pinout, Wire, WireRole, load_pinout
from p2os.robots.motor_step import STEP_UM_PER_S
from simbase.errors import FileError, UsageError, shown, shown_name
from simbase.files import reason_of

FIRMWARE = "build/robot.elf"
SCENARIO = "just-drive.toml"
_SHIPPED_SCENARIO = "free-drive.toml"
#: What a folder may hold already: somebody said `git init` first.
IGNORED = frozenset({".git"})
#: Names that neither make nor a shell needs quotes for.
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*")
#: File of every project → file of `template/`.
_TEMPLATES = {
    "README.md": "README.md", ".gitignore": "gitignore", "pytest.ini": "pytest.ini",
    ".vscode/launch.json": "launch.json", ".github/workflows/robot.yml": "github.yml", ".gitlab-ci.yml": "gitlab.yml",
}  # fmt: skip
#: Files of the example programs, for `board/`.
_SHIPPED = ("startup.c", "memory.c", "f103.h", "f103c8.ld")


@dataclass(frozen=True, slots=True, kw_only=True)
class Build:
    """What builds a project."""

    #: File of the project → file of `template/`.
    templates: Mapping[str, str]
    #: The program that comes of it.
    firmware: str
    #: The commands that build it, and what they need.
    commands: str
    packages: str
    #: Packages of Python beside.
    pip: str = ""
    #: What the README says of it, in place of make's commands, and which words of it are others.
    readme: str = ""
    words: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectKind:
    """What a project's robot is."""

    #: Files of the example programs: file of the project → file of `robot_bench.firmware`, beside `_SHIPPED`.
    shipped: Mapping[str, str]
    templates: Mapping[str, str]
    #: What ships that the scenario is made of.
    scenario: str
    #: What is compiled, beside `startup.c` and `memory.c`.
    sources: tuple[str, ...]
    #: Rows of the README's table on the wires.
    wires: str = ""


_CMAKE = "cmake -B build && cmake --build build"
_WITHOUT_MAKE = {"`make test` runs": "`pytest` runs", "`make && p2os run patrol.toml`": "`p2os run patrol.toml`"}
BUILDS: Mapping[str, Build] = {
    "make": Build(
        templates={"Makefile": "Makefile"}, firmware=FIRMWARE, commands="make", packages="gcc-arm-none-eabi make",
    ),
    "cmake": Build(
        templates={"CMakeLists.txt": "CMakeLists.txt", "board/arm.cmake": "arm.cmake"}, firmware=FIRMWARE,
        commands=_CMAKE, packages="gcc-arm-none-eabi cmake make",
        readme=(
            "sudo apt-get install gcc-arm-none-eabi cmake make   # once\n"
            "cmake -B build                       # once\n"
            "cmake --build build                  # builds build/robot.elf\n"
            "cmake --build build --target drive   # drives it on the bench; the last line names the report\n"
            "pytest                               # runs tests/ on the bench (pip install pytest, once)\n"
        ),
        words={**_WITHOUT_MAKE, "`Makefile`": "`CMakeLists.txt`", "SOURCES` in the Makefile": "CMakeLists.txt`"},
    ),
    "platformio": Build(
        templates={"platformio.ini": "platformio.ini"}, firmware=".pio/build/bluepill/firmware.elf",
        commands="pio run", packages="git", pip=" platformio",
        readme=(
            "pip install platformio pytest   # once\n"
            "pio run                         # builds it\n"
            "p2os run just-drive.toml        # drives it on the bench; the last line names the report\n"
            "pytest                          # runs tests/ on the bench\n"
        ),
        words={**_WITHOUT_MAKE, "`Makefile`": "`platformio.ini`", "SOURCES` in the Makefile": "platformio.ini`"},
    ),
}  # fmt: skip
ROBOTS: Mapping[str, ProjectKind] = {
    "p2dx": ProjectKind(
        shipped={}, templates={"main.c": "main.c", "tests/test_robot.py": "test_robot"}, scenario=_SHIPPED_SCENARIO,
        sources=("main.c",),
    ),
    "rover": ProjectKind(
        shipped={
            "main.c": "rover.c",
            **{f"board/{name}": name for name in (
                "rover_board.c", "rover_board.h", "board.c", "board.h", "uart.c", "uart.h", "pins.h", "tick.h",
                "f103_analog.h", "f103_timers.h",
            )},
        },
        templates={"tests/test_robot.py": "test_rover"}, scenario="rover.toml",
        sources=("main.c", "board/rover_board.c", "board/board.c", "board/uart.c"),
    ),
}  # fmt: skip
#: What the README of a Pioneer says, and not that of a robot on its own pins.
_OF_A_PIONEER = re.compile(r"## What every program must do\n.*?(?=\n## )", re.DOTALL)
_SH = re.compile(r"(?<=```sh\n).*?(?=```)", re.DOTALL)
_SOURCES = re.compile(r"^SOURCES := .*$", re.MULTILINE)
_HEADER = """\
/* The wires between BluePill and adapter, written by `p2os new` from the adapter's pin-out.
 *
 * They are the same for every program and every revision of the adapter. Of a value of three bits s3 and comm3 are
 * the most significant; motors are two's complement.
 */
#ifndef WIRES_H
#define WIRES_H

#include "f103.h"

struct wire {
    struct gpio *port;
    unsigned bit;
};
"""
_ROLES = {
    WireRole.DISTANCE: "Inputs: high while something is nearer than the threshold; DD1 looks left, DD8 right.",
    WireRole.ENCODER: "Inputs: the position of a wheel, eight a turn; encoder 1 is the left wheel.",
    WireRole.MOTOR: "Outputs: the speed of a wheel, -4 to +3 in steps of "
    f"{STEP_UM_PER_S / 1000:g} mm/s; motor 1 is the left wheel.",
    WireRole.CONNECT: "Output: high asks the adapter to connect the robot.",
    WireRole.RESET: "Output: high holds the adapter in reset.",
}


def project_files(body: str, *, build: str = "make", robot: str = "p2dx") -> dict[str, str]:
    """Return the text of each file of a project, by its path in the project's folder.

    Args:
        body: The body that its scenario names.
        build: What builds it, of `BUILDS`.
        robot: What its robot is, of `ROBOTS`.
    """
    by, kind = BUILDS[build], ROBOTS[robot]
    sources = (*kind.sources, "board/startup.c", "board/memory.c")
    words = {
        "@SOURCES@": " ".join(sources), "@FILTER@": " ".join(f"+<{name}>" for name in sources), "@ELF@": by.firmware,
        "@BUILD@": by.commands, "@PACKAGES@": by.packages, "@PIP@": by.pip,
    }  # fmt: skip
    templates = {**kind.templates, **by.templates, **_TEMPLATES}
    found = {
        name: text_of_package("robot_bench.cli.project", f"template/{source}") for name, source in templates.items()
    }
    if by.firmware != FIRMWARE:
        words[FIRMWARE] = by.firmware
    found = {name: _filled(text, words) for name, text in found.items()}
    if "Makefile" in found:
        include = " -Iboard" if robot != "p2dx" else ""
        found["Makefile"] = _SOURCES.sub(f"SOURCES := {words['@SOURCES@']}", found["Makefile"]).replace(
            "-std=c11", f"-std=c11{include}", 1
        )
    if by.readme:
        found["README.md"] = _filled(_SH.sub(lambda _: by.readme, found["README.md"], count=1), by.words)
    if robot != "p2dx":
        found["README.md"] = _readme_of(found["README.md"])
    found[SCENARIO] = _scenario(text_of_package("robot_bench.scenarios", kind.scenario), body, by.firmware)
    found |= {f"board/{name}": text_of_package("robot_bench.firmware", name) for name in _SHIPPED}
    found |= {name: text_of_package("robot_bench.firmware", source) for name, source in kind.shipped.items()}
    if robot == "p2dx":
        found["board/wires.h"] = wires_header(load_pinout())
    return found


def _filled(text: str, words: Mapping[str, str]) -> str:
    """Return a text with words in place of others."""
    for word, value in words.items():
        text = text.replace(word, value)
    return text


def _readme_of(text: str) -> str:
    """Return the README of a robot on its own pins, made from a Pioneer's."""
    text = _OF_A_PIONEER.sub("", text)
    text = text.replace("that drives a Pioneer", "that drives a rover of your own")
    return text.replace(
        "| `board/wires.h` | the wires to the adapter, by name |",
        "| `board/rover_board.h` | PWM, encoder timers, ADC and DMA of this rover on its pins |",
    )


def wires_header(pinout: Pinout) -> str:
    """Return a C header that names the BluePill's side of a pin-out."""
    groups = (f"\n/* {text} */\n{''.join(map(_define, pinout.with_role(role)))}" for role, text in _ROLES.items())
    return f"{_HEADER}{''.join(groups)}\n#endif\n"


def write_project(folder: Path, contents: Mapping[str, str]) -> None:
    """Write a project's files into a folder that is new or empty.

    Raises:
        UsageError: The folder is not empty, is no folder, or has a name that make cannot take.
        FileError: It cannot be written; what was written of it is removed again.
    """
    _refuse_names(_new_folders(folder))
    write_files(folder, contents, refuse=_refuse_content)


def write_files(folder: Path, contents: Mapping[str, str], refuse: Callable[[Path], None] = lambda _: None) -> None:
    """Write files into a folder, none of which is there.

    Args:
        folder: Made where it is not there.
        contents: The text of each file, by its path in the folder.
        refuse: Called before anything is written; what it raises is raised.

    Raises:
        FileError: One cannot be written, or is there; what was written is removed again.
    """
    new = _new_folders(folder)
    written: list[Path] = []
    try:
        refuse(folder)
        for path in new:
            path.mkdir()
            written.append(path)
        for path, text in _in_folders(folder, contents, written):
            with path.open("x", encoding="utf-8", newline="\n") as stream:
                written.append(path)
                stream.write(text)
    except BaseException as error:
        for path in reversed(written):
            with contextlib.suppress(OSError):
                path.rmdir() if path.is_dir() else path.unlink()
        if isinstance(error, OSError):
            reason = reason_of(error)
            raise FileError(
                f"cannot write {shown_name(error.filename or folder)}: {reason}", hint="choose another folder"
            ) from error
        raise


def _in_folders(folder: Path, contents: Mapping[str, str], written: list[Path]) -> Iterator[tuple[Path, str]]:
    for name, text in contents.items():
        path = folder / name
        for above in reversed([one for one in path.parents if not one.exists()]):
            above.mkdir()
            written.append(above)
        yield path, text


def _new_folders(folder: Path) -> list[Path]:
    """Return the folder and those above it that are to be made, the uppermost first."""
    return [path for path in reversed([folder, *folder.parents]) if not os.path.lexists(path)]


def _refuse_names(folders: list[Path]) -> None:
    odd = next((path.name for path in folders if not _NAME.fullmatch(path.name)), None)
    if odd is not None:
        raise UsageError(
            f"a folder called {shown(odd)} is not made", hint="make and shells take English letters, digits, _ - and ."
        )


def _refuse_content(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{shown_name(folder)} is a file", hint="name a folder that is new or empty")
    held = {path.name for path in folder.iterdir()} - IGNORED if folder.is_dir() else set()
    if held:
        raise UsageError(
            f"{shown_name(folder)} is not empty (it holds {shown_name(min(held))})",
            hint="name a folder that is new or empty: nothing is overwritten",
        )


def _define(wire: Wire) -> str:
    port, bit = wire.bluepill[1], wire.bluepill[2:]
    return f"#define {wire.name.upper()} {{GPIO{port}, {bit}u}}\n"


def _scenario(text: str, body: str, firmware: str) -> str:
    """Return the shipped scenario with a program and a body of its own."""
    for key, value in (("firmware", firmware), ("body", body)):
        text = re.sub(rf'^{key} = ".*"$', f'{key} = "{value}"', text, count=1, flags=re.MULTILINE)
    return text


def text_of_package(package: str, name: str) -> str:
    """Return the text of a file that is in a package."""
    return files(package).joinpath(name).read_text(encoding="utf-8")
