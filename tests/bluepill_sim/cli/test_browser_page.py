"""The page of `p2os mcu page`: what is in the file, and that its chip runs as the native one does, to the cycle.

What runs in a browser needs Node, Chromium and `make page` once; what builds the WebAssembly, Clang and LLD.
"""

import json
import random
import re
import shutil
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bluepill_sim import BluePill
from bluepill_sim.cli.browser.document import chip_data, page_of, wasm
from bluepill_sim.cli.browser.page import page
from bluepill_sim.errors import BluePillError
from bluepill_sim.extension.library import CORE_VARIABLE
from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.subscriptions import EDGE
from tests.bluepill_sim.machine import Assembler
from tools.generators import browser_chip

FIRMWARE = Path(__file__).resolve().parents[3] / "robot_bench" / "firmware"
TOOLS = Path(__file__).resolve().parents[3] / "tools" / "page"
SCRIPTS = TOOLS / "test" / "browser"
#: The shipped programs that the page accepts: it names nothing of them as missing.
ACCEPTED = ("motors", "encoders", "dodge", "dodge_duty", "sensors", "codes", "analog", "rover", "board_test")
RUN_NS = 600_000_000
MS = 1_000_000


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


def load(address: int) -> str:
    return f"mov32 r1, #{address}\nldr r0, [r1, #0]\n"


#: Opens the backup domain as start-up code does, which is there, and waits until it is open; reads WWDG_CR, which is
#: not there, with its clock; TIM2_CR1 twice, with 2 ms between, without; writes FLASH_KEYR and IWDG_KR; then stores to
#: flash, which ends it.
STRANGE = "".join([
    store(0x4002_101C, 1 << 28 | 1 << 11), store(0x4000_7000, 1 << 8),
    "locked: ldr r0, [r1, #0]\ncmp r0, #0\nbeq locked\n", load(0x4000_2C00), load(0x4000_0000),
    "mov32 r4, #6000\nagain: subs r4, #1\nbne again\n", load(0x4000_0000),
    store(0x4002_2004, 0x4567_0123), store(0x4000_3000, 0xCCCC), store(0x0800_1000, 1), "end: b end",
])  # fmt: skip


#: Makes PendSV pending and sets PA1 and PA0 in one block, whose handler clears PA1: it comes before the first of them.
PENDED = (
    ".half " + ", ".join(["0"] * 24) + "\n.half 0x0041, 0x0800, 0, 0\n"
    "mov32 r3, #0x40010810\nmov32 r2, #0x00020000\nstr r2, [r3, #0]\nbx lr\n"
    "main: " + store(0x4002_1018, 1 << 2) + store(0x4001_0800, 0x2222_2222)
    + "mov32 r4, #0xE000ED04\nmov32 r5, #0x10000000\nmov32 r6, #0x40010810\nmov32 r7, #2\nmov32 r0, #1\n"
    "mov32 r1, #0x00010000\nagain: str r5, [r4, #0]\nstr r7, [r6, #0]\nstr r0, [r6, #0]\nstr r1, [r6, #0]\nb again"
)  # fmt: skip


# What is in the file.


@pytest.mark.slow
def test_the_wasm_is_what_its_sources_make(tmp_path: Path) -> None:
    if (what := browser_chip.missing()) is not None:
        pytest.skip(f"{what}: chip.wasm is not built and compared")
    browser_chip.build(tmp_path / "chip.wasm")
    assert (tmp_path / "chip.wasm").read_bytes() == wasm(), "python -m tools.generators.browser_chip"


def test_the_wasm_asks_the_page_for_two_functions_and_has_nothing_of_unicorn() -> None:
    """Names of what else there is under GPL, and of the functions of Unicorn, would stand among names and messages."""
    binary = wasm()
    assert sorted(imports(binary)) == [("page", "deliver"), ("page", "notice")]
    assert re.search(rb"(?i)unicorn|qemu|uc_[a-z]|gpl|gnu general", binary) is None
    assert len(binary) < 400_000


@pytest.mark.slow
def test_the_same_chip_gives_the_same_page_and_it_asks_for_nothing(tmp_path: Path) -> None:
    first = page_of(FIRMWARE / "motors.elf")
    tmp_path.joinpath("something").write_bytes(bytes(100_000))  # so that memory lies elsewhere
    assert page_of(FIRMWARE / "motors.elf") == first
    outside = re.sub(r'<script type="text/plain".*?</script>', "", first, flags=re.DOTALL)
    assert re.search(r"https?://|src=|href=|url\(|import ", outside) is None
    assert "default-src 'none'" in outside
    assert len(first) < 700_000


@pytest.mark.slow
def test_the_verb_writes_a_page_and_refuses_what_is_no_elf(tmp_path: Path) -> None:
    out = tmp_path / "mine.html"
    page(FIRMWARE / "motors.elf", out)
    assert 'data-name="motors.elf"' in out.read_text(encoding="utf-8")
    program = tmp_path / "a.bin"
    program.write_bytes(struct.pack("<II", 0x2000_5000, 0x0800_0009) + b"\xfe\xe7")
    with pytest.raises(BluePillError, match="ELF files alone"):
        page_of(program)
    with pytest.raises(BluePillError):
        page_of(tmp_path / "nowhere.elf")


@pytest.mark.slow
def test_a_recording_leaves_the_library_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CORE_VARIABLE, "native")
    before = chip_data()
    board = BluePill(FIRMWARE / "motors.elf")
    board.run_for("10 ms")
    assert chip_data() == before
    assert board.chip.engine.cycle > 0


def imports(binary: bytes) -> Iterator[tuple[str, str]]:
    """Yield module and name of each import of a WebAssembly binary (WebAssembly 1.0, 5.5.5)."""
    at = 8

    def number() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = binary[at]
            at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value

    def text() -> str:
        nonlocal at
        size = number()
        at += size
        return binary[at - size : at].decode()

    while at < len(binary):
        section, size = number(), number()
        end = at + size
        if section == 2:
            for _ in range(number()):
                pair = text(), text()
                assert binary[at] == 0, "an import that is no function"
                at += 1
                number()
                yield pair
        at = end


# In Chromium.


def elf_of(code: bytes, entry: int = 0x0800_0009) -> bytes:
    """Return an ELF whose one segment has vectors and code."""
    data = struct.pack("<II", 0x2000_5000, entry) + code
    head = b"\x7fELF\x01\x01\x01" + bytes(9)
    head += struct.pack("<HHIIIIIHHHHHH", 2, 40, 1, entry, 52, 0, 0, 52, 32, 1, 40, 0, 0)
    return head + struct.pack("<8I", 1, 84, 0x0800_0000, 0x0800_0000, len(data), len(data), 5, 4) + data


def pended(folder: Path) -> Path:
    """Return the program whose exception comes before an access in the midst of a block."""
    made, path = Assembler(PENDED, 0x0800_0008), folder / "pended.elf"
    path.write_bytes(elf_of(made.code, made.labels["main"] | 1))
    return path


def inputs_of(name: str) -> list[tuple[int, int, int]]:
    """Return levels that the outside puts on pins that a program leaves to it: (ns, pin, level)."""
    board = BluePill(FIRMWARE / f"{name}.elf")
    board.run_for("20 ms")
    free = [
        pin.index
        for pin in board.chip.pins
        if pin.is_bonded and pin.output is not PinDrive.LOW and pin.output is not PinDrive.HIGH and pin.holder is None
        and pin.mode.value != "analog" and pin.name not in {"PA9", "PA10"}
    ]  # fmt: skip
    rng = random.Random(name)
    return sorted((rng.randrange(25 * MS, RUN_NS), rng.choice(free), rng.randrange(2)) for _ in range(60))


def native_run(path: Path, inputs: list[tuple[int, int, int]], ns: int) -> dict[str, Any]:
    """Return the edges, cycles and characters of a program on the native core with the interpreter of our own."""
    board, rows = BluePill(path), bytearray()
    pins = list(board.chip.pins)
    board.subscribe_pins([pin.name for pin in pins], rows.extend)
    board.chip.fabric.put_inputs(b"".join(EDGE.pack(at, pin, 2 if level else 1, 0, 0, 0) for at, pin, level in inputs))
    board.chip.advance_to(ns)
    return {
        "ns": str(board.now_ns),
        "cycle": str(board.chip.engine.cycle),
        "edges": [list(row[:4]) for row in EDGE.iter_unpack(bytes(rows))],
        "text": board.usart1.read().decode("latin-1"),
    }


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Return what came of the page in the browser: opened once, looked at by all tests here."""
    node, chromium = shutil.which("node"), shutil.which("chromium") or shutil.which("chromium-browser")
    if node is None or chromium is None:
        pytest.skip("node or chromium is not installed: the page is not run in a browser")
    if not (TOOLS / "node_modules" / "playwright-core").is_dir():
        pytest.skip("tools/page/node_modules is not there: the page is not run in a browser (hint: make page)")
    folder = tmp_path_factory.mktemp("page")
    document, asked = folder / "page.html", folder / "asked.json"
    document.write_text(page_of(), encoding="utf-8")
    strange = folder / "strange.elf"
    strange.write_bytes(elf_of(Assembler(STRANGE, 0x0800_0008).code))
    programs = [{"name": name, "file": str(FIRMWARE / f"{name}.elf"), "ns": RUN_NS, "inputs": inputs_of(name)}
                for name in ACCEPTED]  # fmt: skip
    programs.append({"name": "pended", "file": str(pended(folder)), "ns": MS, "inputs": []})
    programs.append({"name": "strange", "file": str(strange), "ns": 10 * MS, "inputs": []})
    programs.append({"name": "usb_echo", "file": str(FIRMWARE / "usb_echo.elf"), "ns": 10 * MS, "inputs": []})
    asked.write_text(json.dumps({"programs": programs}), encoding="utf-8")
    done = subprocess.run([node, str(SCRIPTS / "chip.mjs"), chromium, document.as_uri(), str(asked)],
                          capture_output=True, text=True, timeout=170, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", ACCEPTED)
def test_a_shipped_program_makes_the_edges_and_takes_the_cycles_of_the_native_core(
    seen: dict[str, Any], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    inputs = inputs_of(name)
    monkeypatch.setenv(CORE_VARIABLE, "own")
    native, there = native_run(FIRMWARE / f"{name}.elf", inputs, RUN_NS), seen["runs"][name]
    assert len(native["edges"]) > 60
    assert there["edges"] == native["edges"]
    assert (there["cycle"], there["ns"]) == (native["cycle"], native["ns"])
    assert there["text"].get("USART1", "") == native["text"]
    assert (there["named"], there["stopped"]) == ([], "")


@pytest.mark.slow
def test_an_exception_that_a_block_raises_comes_before_its_next_access(
    seen: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CORE_VARIABLE, "own")
    native, there = native_run(pended(tmp_path), [], MS), seen["runs"]["pended"]
    assert len(native["edges"]) > 100
    assert (there["edges"], there["cycle"], there["named"]) == (native["edges"], native["cycle"], [])


@pytest.mark.slow
def test_what_is_not_there_is_named_with_its_register(seen: dict[str, Any]) -> None:
    usb, strange = seen["runs"]["usb_echo"], seen["runs"]["strange"]
    assert usb["stopped"] == ""
    assert any("USB_" in text for text in usb["named"])
    named = "\n".join(strange["named"])
    assert "(WWDG_CR) is read: this page does not have it" in named
    assert "(TIM2_CR1) is read, and the peripheral has no clock" in named
    assert "is written to 0x40022004 (FLASH_KEYR): this page does not have it" in named
    assert "is written to 0x40003000 (IWDG_KR)" in named
    assert "PWR" not in named
    assert "is stored to 0x08001000" in strange["stopped"]


@pytest.mark.slow
def test_a_person_opens_a_program_pauses_drives_a_pin_and_types(seen: dict[str, Any]) -> None:
    assert 0 < seen["firstPaintMs"] < 20_000  # it does paint; how soon, a busy machine decides
    assert (seen["errors"], seen["requests"], seen["complaints"]) == ([], [], [])
    assert (seen["wide 1400"], seen["wide 420"]) == (0, 0)
    assert seen["before"] == "no program yet"
    assert seen["refused"] == "not.elf: this is no ELF file"
    assert "motors: ready" in seen["console"]
    assert "× real time" in seen["speed"]
    assert (seen["paused"], seen["again"]) == ("motors.elf is paused", "motors.elf runs")
    assert [text.partition(": ")[2] for text in seen["pins"]] == [
        "floating", "high, driven 1 from outside", "low, driven 0 from outside", "floating",
    ]  # fmt: skip
    assert seen["restarted"] is True
    assert seen["typed"] == ""
