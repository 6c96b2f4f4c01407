"""`p2os mcu run`, `info` and `pins`, as a person meets them."""

import json
import re
import zipfile
from pathlib import Path

import pytest

from bluepill_sim.__main__ import NAME, run
from bluepill_sim.extension import library
from tests.tools.examples import EXAMPLES

SENSORS = str(EXAMPLES / "sensors.elf")
ANALOG = str(EXAMPLES / "analog.elf")
DODGE = str(EXAMPLES / "dodge.elf")


def test_run_prints_what_the_firmware_sends(capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    assert run(["run", SENSORS, "--for", "3.7s", "--drive", "PA6=1@3.5s"]) == 0
    captured = capfdbinary.readouterr()
    assert captured.out == b"sensors: ready\nsensor 3 on\n"
    assert b"3.700000 s of virtual time" in captured.err


def test_run_puts_volts_on_pins_and_takes_them_off(capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    volts = ["PA0=1.65V", "PA4=2V", "PA4=z@120ms", "PA5=1.5v", "PA5=1@120ms", "PA6=-0.2V"]
    options = [word for one in volts for word in ("--drive", one)]
    assert run(["run", ANALOG, "--for", "230ms", *options]) == 0
    first, second = capfdbinary.readouterr().out.decode().splitlines()
    assert "PA0 1651 mV, PA4 2000 mV, PA5 1501 mV, PA6 0 mV" in first
    assert "PA0 1651 mV, PA4 0 mV, PA5 3300 mV, PA6 0 mV" in second


def test_run_writes_to_a_file_and_ends_at_an_event(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "log"
    assert run(["run", SENSORS, "--uart", str(log), "--until", "usart1 sends ready"]) == 0
    assert log.read_bytes() == b"sensors: ready"
    assert "0.00" in capfd.readouterr().err


def test_run_in_real_time_serves_a_pseudo_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["run", SENSORS, "--uart", "pty:", "--for", "20ms"]) == 0
    assert "USART1 is at /dev/" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["run", "nothing.elf"], "no such file"),
        (["run", SENSORS, "--for", "10"], "'10' has no unit"),
        (["run", SENSORS, "--drive", "PA6"], "is not understood"),
        (["run", SENSORS, "--drive", "PA6=V"], "is not understood"),
        (["run", SENSORS, "--drive", "PA6=1000V"], "is not understood"),
        (["run", SENSORS, "--drive", "PE6=1V"], "no leg PE6"),
        (["run", SENSORS, "--drive", "PE6=1"], "no leg PE6"),
        (["run", SENSORS, "--drive", "XY=1"], "no leg XY"),
        (["run", SENSORS, "--until", "tea"], "is not understood"),
        (["run", SENSORS, "--uart", "/nowhere/log"], "cannot write"),
        (["run", SENSORS, "--itm", "/nowhere/log"], "cannot write"),
        (["run", SENSORS, "--swo", "/nowhere/log"], "cannot write"),
        (["pins", SENSORS, "--for", "1ms", "--vcd", "/nowhere/a.vcd"], "cannot write"),
        (["pins", SENSORS, "--for", "1ms", "--sr", "/nowhere/a.sr"], "cannot write"),
        (["info", "/dev/null"], "empty"),
    ],
)
def test_a_mistake_is_one_line_and_a_hint(words: list[str], message: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert run([*words]) == 2
    error = capfd.readouterr().err.splitlines()
    assert message in error[-2]
    assert error[-1].startswith("hint: ")


def test_an_event_that_does_not_come_is_a_failure(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["run", SENSORS, "--for", "5ms", "--until", "pin PA4 high"]) == 1
    assert "not seen within 0.005 s" in capfd.readouterr().err


def test_info_tells_sizes_vectors_and_stack(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["info", DODGE, "--json"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["stack_top"] == 0x2000_5000
    assert found["flash_bytes"] == sum(s["bytes"] for s in found["sections"] if s["name"] != ".bss")
    assert {"SysTick_Handler", "USART1_IRQHandler"} <= {v["handler"] for v in found["vectors"]}
    assert found["warnings"] == []
    assert run(["info", DODGE]) == 0
    assert "nothing unmodelled was touched in 0.5 s" in capfd.readouterr().out


def test_info_of_an_image_without_sections(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    image = tmp_path / "bare.bin"
    image.write_bytes(bytes.fromhex("00500020 09000008 fee7"))
    assert run(["info", str(image), "--for", "1ms"]) == 0
    assert "10 of 65536 bytes" in capfd.readouterr().out


def test_pins_shows_modes_levels_and_edges(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    vcd, sr = tmp_path / "a.vcd", tmp_path / "a.sr"
    words = ["pins", SENSORS, "--for", "10ms", "--vcd", str(vcd), "--sr", str(sr), "--drive", "PA6=1@5ms"]
    assert run([*words, "--json"]) == 0
    rows = {row["pin"]: row for row in json.loads(capfd.readouterr().out)["pins"]}
    assert rows["PB12"]["mode"] == "output"
    assert rows["PA6"]["outside"] == "high"
    assert rows["PA6"]["last_edge_s"] == pytest.approx(0.005, abs=1e-5)
    assert rows["PA9"]["function"] == "USART1_TX"
    assert rows["PA13"]["function"] == "JTMS/SWDIO"
    assert run([*words, "--all"]) == 0
    assert len(capfd.readouterr().out.splitlines()) == 38


def decoded_words(session: Path) -> bytes:
    """Decode `usart1.tx` of a sigrok session as 115200 8N1, by its samples alone."""
    with zipfile.ZipFile(session) as archive:
        metadata = archive.read("metadata").decode()
        samples = archive.read("logic-1-1")
    lines = dict(line.split("=") for line in metadata.splitlines() if "=" in line)
    probe = next(int(key[5:]) - 1 for key, value in lines.items() if value == "usart1.tx")
    unit, rate = int(lines["unitsize"]), {"20 MHz": 20_000_000, "1 MHz": 1_000_000}[lines["samplerate"]]
    levels = bytes(samples[n + probe // 8] >> probe % 8 & 1 for n in range(0, len(samples), unit))
    bit, at, found = rate / 115_200, 0, bytearray()
    while (at := levels.find(0, at)) >= 0:
        word = sum(levels[int(at + bit * (n + 1.5))] << n for n in range(8))
        found.append(word)
        at = int(at + bit * 9.5)
    return bytes(found)


def test_a_session_shows_the_bits_of_the_usart(tmp_path: Path) -> None:
    session = tmp_path / "a.sr"
    assert run(["pins", SENSORS, "--for", "10ms", "--sr", str(session)]) == 0
    assert decoded_words(session) == b"sensors: ready\n"


def test_a_dump_holds_every_edge_and_every_word(tmp_path: Path) -> None:
    from vcd.reader import TokenKind, tokenize

    path = tmp_path / "a.vcd"
    assert run(["pins", SENSORS, "--for", "10ms", "--vcd", str(path)]) == 0
    names, words, highest = {}, bytearray(), 0
    with path.open("rb") as file:
        for token in tokenize(file):
            if token.kind is TokenKind.VAR:
                names[token.var.id_code] = token.var.reference
            elif token.kind is TokenKind.CHANGE_TIME:
                highest = token.data
            elif token.kind is TokenKind.CHANGE_VECTOR and isinstance(token.vector_change.value, int):
                words.append(token.vector_change.value)
    assert bytes(words) == b"sensors: ready\n"
    assert {"PB12", "irq.USART1", "usart1.tx"} <= set(names.values())
    assert 10_000_000 <= highest < 10_100_000


def test_without_its_library_the_emulator_says_so_in_a_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    library.library.cache_clear()
    monkeypatch.setattr(library, "library_path", lambda: None)
    try:
        assert run(["run", str(EXAMPLES / "motors.elf"), "--for", "1ms"]) == 2
    finally:
        library.library.cache_clear()
    said, hint = capsys.readouterr().err.splitlines()
    assert said == f"{NAME}: the emulator's library is not built"
    assert re.search(r"pip install --force-reinstall --no-deps .* \(nothing was built in this folder\)", hint)
