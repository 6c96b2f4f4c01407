"""The page as one file: a chip's recording, its C as WebAssembly, and what shows it.

Invariant: the file asks nothing of a server or a network, and nothing of Unicorn is in it.
"""

import base64
import ctypes
import html
import json
import os
import re
from collections.abc import Iterator
from importlib.resources import files
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from bluepill_sim.board import BluePill
from bluepill_sim.cli.browser.image import Recording, recorded
from bluepill_sim.errors import BluePillError
from bluepill_sim.extension.layout import PORT, structure
from bluepill_sim.extension.library import CORE_VARIABLE, FUNCTION_TYPES
from bluepill_sim.fabric.registers import Peripheral
from bluepill_sim.native.state import HALT_KINDS
from bluepill_sim.peripherals.usart import UsartCommand
from bluepill_sim.program.image import ELF_MAGIC, load_image
from bluepill_sim.stm32f103 import BASES, SRAM_BASE, SRAM_BYTES
from simbase.files import read_bytes

#: A program that stands still, for a chip that gets another one later: its stack, its entry, and a branch to itself.
IDLE = (SRAM_BASE + SRAM_BYTES).to_bytes(4, "little") + bytes([9, 0, 0, 8]) + b"\xfe\xe7"
#: What devices in C notify Python of, and which changes nothing on a page.
_HARMLESS = (
    "PLACED", "GIVE_MORE", "JUDGE_SPEED", "CHECK_MODES", "CSS_CLEARED", "HEARS_LINE", "HEARS_PINS", "GATES", "BACKUP",
)  # fmt: skip
#: MAPR but for PD01_REMAP and SWJ_CFG.
_REMAPS = 0x1F_7FFF
_SHOWN = ("level", "floating", "low", "high", "up", "down", "outside", "outside_high", "outside_weak", "bonded", "held",
          "shown", "fighting", "output", "alternate")  # fmt: skip
_BLOCK_BYTES = 0x400
FOOTER = (
    "An emulated STM32F103C8 under the MIT licence, as WebAssembly: interpreter, core, fabric, devices in C, nothing "
    "of Unicorn or of any other emulator. Its documentation (browser.md) says what is on this page and what is not."
)


def chip_data() -> dict[str, Any]:
    """Return what the page makes a chip of: its recording, and the names of what is on it.

    Raises:
        MissingDependencyError: the emulator's library is not built.
    """
    before = os.environ.get(CORE_VARIABLE)
    os.environ[CORE_VARIABLE] = "own"
    try:
        with TemporaryDirectory() as folder, recorded() as recording:
            path = Path(folder) / "idle.bin"
            path.write_bytes(IDLE)
            board = BluePill(path)
            board.chip.engine.use_python(False)  # type: ignore[attr-defined]  # the native core's
    finally:
        if before is None:
            del os.environ[CORE_VARIABLE]
        else:
            os.environ[CORE_VARIABLE] = before
    return {"sizes": recording.sizes, "steps": recording.steps, "wide": _wide(recording)} | _names(board, recording)


def _wide(recording: Recording) -> dict[str, list[int]]:
    """Return which arguments of each function have 64 bits."""
    used = {step[1] for step in recording.steps if step[0] == "call"}
    found = {
        name: [n for n, letter in enumerate(letters[1:]) if letter in "ql"]
        for name, letters in FUNCTION_TYPES.items()
        if name in used
    }
    return {name: places for name, places in found.items() if places}


def _names(board: BluePill, recording: Recording) -> dict[str, Any]:
    parts = board.chip.parts.by_name
    slots = {
        part.slot: {"name": name, "base": part.base, "asks": dict(_questions(part))} for name, part in parts.items()
    }
    registers = {
        part.base + register.offset: f"{name}_{register.name}"
        for name, part in parts.items()
        for register in part.REGISTERS
    }
    sizes = {name: part.place.size for name, part in parts.items()}
    by_base = sorted(BASES.items(), key=itemgetter(1))
    port: Any = structure(PORT)
    devices = {step[3]: step for step in recording.steps if step[:2] == ["call", "fabric_add_device"]}
    ports = next(step for step in recording.steps if step[:2] == ["call", "page_fabric_new"])[2]
    flash = next(step for step in recording.steps if step[:2] == ["call", "interpreter_map"] and step[3] == 0)
    return {
        "slots": slots,
        "registers": registers,
        "bases": [[base, name, sizes.get(name, _BLOCK_BYTES)] for name, base in by_base],
        "halts": [kind.value for kind in HALT_KINDS],
        "harmless": _HARMLESS,
        "port": {name: getattr(port, name).offset for name in _SHOWN},
        "portBytes": ctypes.sizeof(port),
        "ports": _buffer(ports),
        "flash": _buffer(flash[-1]),
        "afio": _buffer(devices[parts["AFIO"].slot][5]),
        "inputs": next(slot for slot, step in devices.items() if bytes.fromhex(step[4][1:]) == b"inputs\0"),
        "hear": int(UsartCommand.HEAR),
        "remaps": _REMAPS,
    }


def _questions(part: Peripheral) -> Iterator[tuple[int, str]]:
    """Yield the numbers and names of what a device in C asks Python."""
    for enum in part.ENUMS:
        if enum.__name__.endswith("Question"):
            yield from ((int(one), one.name) for one in enum)


def _buffer(pointer: str) -> int:
    """Return the number of the buffer that a pointer leads to."""
    return int(pointer[1:].partition("+")[0])


def page_of(firmware: Path | None = None) -> str:
    """Return the page as one HTML document; with a firmware, the ELF file is in it and starts when it is opened.

    Raises:
        BluePillError: the firmware is no ELF file, or the page's part was left out of this installation.
        MissingDependencyError: the emulator's library is not built.
    """
    program = b"" if firmware is None else _elf(firmware)
    name = "" if firmware is None else firmware.name
    places = {
        "title": html.escape(f"{name} in a browser" if name else "BluePill in a browser"),
        "style": _bundled("style.css"),
        "footer": html.escape(FOOTER),
        "data": json.dumps(chip_data(), separators=(",", ":")),
        "wasm": base64.b64encode(wasm()).decode(),
        "name": html.escape(name),
        "program": base64.b64encode(program).decode(),
        "chip": _bundled("chip.js"),
        "screen": _bundled("screen.js"),
    }
    return re.sub(r"\$([a-z]+)", lambda found: places.get(found[1], found[0]), _bundled("page.html"))


def wasm() -> bytes:
    """Return the emulator's C as WebAssembly."""
    return files("bluepill_sim.cli.browser").joinpath("chip.wasm").read_bytes()


def _bundled(name: str) -> str:
    return files("bluepill_sim.cli.browser").joinpath("bundle", name).read_text(encoding="utf-8")


def _elf(path: Path) -> bytes:
    """Return an ELF file that is a program for this chip."""
    load_image(path)
    data = read_bytes(path)
    if not data.startswith(ELF_MAGIC):
        hint = "give the .elf that the .bin or .hex was made of"
        raise BluePillError(f"{path}: the page takes ELF files alone", hint=hint)
    return data
