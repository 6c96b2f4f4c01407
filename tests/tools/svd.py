"""ST's description of the STM32F103 in CMSIS-SVD, where somebody has it: nothing of it is in this repository.

Read from the file that `STM32F103_SVD` names, or from the package pyocd, which has it among its data.
"""

import os
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree as ET
from zipfile import ZipFile

FILE = "STM32F103xx.svd"
HINT = f"no {FILE}: `pip install --no-deps pyocd`, or name the file in STM32F103_SVD"


@dataclass(frozen=True)
class SvdRegister:
    """A register as ST describes it."""

    address: int
    reset: int
    #: "read-only", "write-only", "read-write" or "", where its fields differ.
    access: str
    #: High and low bit by name.
    fields: dict[str, tuple[int, int]]


def svd_registers() -> dict[str, dict[str, SvdRegister]] | None:
    """Return the registers of each peripheral by name; None: nobody has the file."""
    text = _text()
    if text is None:
        return None
    found: dict[str, dict[str, SvdRegister]] = {}
    models: dict[str, list[ET.Element]] = {}
    for peripheral in ET.fromstring(text).iter("peripheral"):  # noqa: S314 - a file that the reader chose
        base = _number(peripheral, "baseAddress")
        model = peripheral.get("derivedFrom")
        registers = models[model] if model else list(peripheral.iter("register"))
        models[_text_of(peripheral, "name")] = registers
        found[_text_of(peripheral, "name")] = {_text_of(one, "name"): _register(one, base) for one in registers}
    return found


def _register(one: ET.Element, base: int) -> SvdRegister:
    fields = {}
    for field in one.iter("field"):
        low = _number(field, "bitOffset")
        fields[_text_of(field, "name")] = (low + _number(field, "bitWidth") - 1, low)
    access = (one.findtext("access") or "").strip()
    return SvdRegister(base + _number(one, "addressOffset"), _number(one, "resetValue"), access, fields)


def _number(element: ET.Element, name: str) -> int:
    text = _text_of(element, name)
    return int(text, 16 if text.lower().startswith("0x") else 10)


def _text_of(element: ET.Element, name: str) -> str:
    return (element.findtext(name) or "0").strip()


def _text() -> bytes | None:
    if path := os.environ.get("STM32F103_SVD"):
        return Path(path).read_bytes()
    spec = find_spec("pyocd")
    for folder in spec.submodule_search_locations or () if spec else ():
        archive = Path(folder, "debug", "svd", "svd_data.zip")
        if archive.exists():
            with ZipFile(archive) as zipped:
                return zipped.read(FILE)
    return None
