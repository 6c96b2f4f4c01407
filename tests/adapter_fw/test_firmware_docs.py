"""docs/adapter-firmware.md says what the tables and the code say."""

import re

from adapter_sim.pinout import WireDirection, load_pinout
from tests.adapter_fw.budgets import PAGE
from tests.adapter_fw.builds import ROOT

TEXT = PAGE.read_text(encoding="utf-8")


def test_the_wiring_is_that_of_the_pinout() -> None:
    for wire in load_pinout().wires:
        arrow = "→" if wire.direction is WireDirection.TO_ADAPTER else "←"
        pins = f"{wire.esp32_pin('rev-b')} | {wire.esp32_pin('rev-c')}"
        assert f"| {wire.name} | {wire.bluepill} | {arrow} | {pins} |\n" in TEXT


def test_every_line_of_the_console_is_explained() -> None:
    source = (ROOT / "adapter_fw" / "core" / "app" / "console.cpp").read_text(encoding="utf-8")
    verbs = set(re.findall(r'is\("(\w+)", \d\)', source))
    assert len(verbs) == 14 + 1, verbs
    for verb in verbs:
        assert re.search(rf"^\| .*`{verb}\b.*\|$", TEXT, re.MULTILINE), verb


def test_every_proof_that_is_named_exists() -> None:
    named = re.findall(r"`pytest (tests/\S+)`", TEXT)
    assert named
    assert all((ROOT / path).exists() for path in named)


def test_the_version_in_the_bring_up_is_the_firmwares() -> None:
    header = (ROOT / "adapter_fw" / "core" / "app" / "version.hpp").read_text(encoding="utf-8")
    version = re.search(r'"([\d.]+)"', header)
    assert version is not None
    assert f"P2OS adapter {version[1]}, board rev-b; type help" in TEXT
