"""The files of a new project, and how they get into a folder.

What ships with the example programs (start-up, linker script, registers) and the scenario `free-drive` is copied
from there; the wires are written from the adapter's pin-out; the rest stands in `template/`.

Invariant: a file that is there is never overwritten, and a project is written whole or not at all.
"""

import contextlib
import os
import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

from adapter_sim.pinout import Pinout, Wire, WireRole, load_pinout
from simbase.errors import FileError, UsageError, shown, shown_name

FIRMWARE = "build/robot.elf"
SCENARIO = "just-drive.toml"
_SHIPPED_SCENARIO = "free-drive.toml"
#: What a folder may hold already: somebody said `git init` first.
IGNORED = frozenset({".git"})
#: Names that neither make nor a shell needs quotes for.
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*")
#: File of the project → file of `template/`.
_TEMPLATES = {
    "main.c": "main.c", "Makefile": "Makefile", "README.md": "README.md", ".gitignore": "gitignore",
    "tests/test_robot.py": "test_robot", "pytest.ini": "pytest.ini",
}  # fmt: skip
#: Files of the example programs, for `board/`.
_SHIPPED = ("startup.c", "memory.c", "f103.h", "f103c8.ld")
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
    WireRole.MOTOR: "Outputs: the speed of a wheel, -4 to +3 in steps of 62.5 mm/s; motor 1 is the left wheel.",
    WireRole.CONNECT: "Output: high asks the adapter to connect the robot.",
    WireRole.RESET: "Output: high holds the adapter in reset.",
}


def project_files(body: str) -> dict[str, str]:
    """Return the text of each file of a project, by its path in the project's folder.

    Args:
        body: The body that its scenario names.
    """
    found = {name: _text("robot_bench.project", f"template/{source}") for name, source in _TEMPLATES.items()}
    found[SCENARIO] = _scenario(_text("robot_bench.scenarios", _SHIPPED_SCENARIO), body)
    found |= {f"board/{name}": _text("robot_bench.firmware", name) for name in _SHIPPED}
    found["board/wires.h"] = wires_header(load_pinout())
    return found


def wires_header(pinout: Pinout) -> str:
    """Return a C header that names the BluePill's side of a pin-out."""
    groups = (f"\n/* {text} */\n{''.join(map(_define, pinout.with_role(role)))}" for role, text in _ROLES.items())
    return f"{_HEADER}{''.join(groups)}\n#endif\n"


def write_project(folder: Path, contents: dict[str, str]) -> None:
    """Write a project's files into a folder that is new or empty.

    Raises:
        UsageError: The folder is not empty, is no folder, or has a name that make cannot take.
        FileError: It cannot be written; what was written of it is removed again.
    """
    new = _new_folders(folder)
    _refuse_names(new)
    written: list[Path] = []
    try:
        _refuse_content(folder)
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
            reason = (error.strerror or str(error)).lower()
            raise FileError(
                f"cannot write {shown_name(error.filename or folder)}: {reason}", hint="choose another folder"
            ) from error
        raise


def _in_folders(folder: Path, contents: dict[str, str], written: list[Path]) -> Iterator[tuple[Path, str]]:
    for name, text in contents.items():
        path = folder / name
        if not path.parent.exists():
            path.parent.mkdir()
            written.append(path.parent)
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


def _scenario(text: str, body: str) -> str:
    """Return the shipped scenario with a program and a body of its own."""
    for key, value in (("firmware", FIRMWARE), ("body", body)):
        text = re.sub(rf'^{key} = ".*"$', f'{key} = "{value}"', text, count=1, flags=re.MULTILINE)
    return text


def _text(package: str, name: str) -> str:
    return files(package).joinpath(name).read_text(encoding="utf-8")
