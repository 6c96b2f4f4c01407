"""`p2os mcu coverage`, `profile` and `trace`, and the verdict of `run`, on real programs."""

import json
import struct
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from bluepill_sim.__main__ import NAME, run
from bluepill_sim.program.image import load_image, parse_image
from bluepill_sim.program.last_blocks import TITLE
from bluepill_sim.program.line_table import read_lines
from tests.tools.examples import EXAMPLES

SENSORS = str(EXAMPLES / "sensors.elf")
#: Stack, start; start: movs r0, #5; subs r0, #1; bne; then a branch to nothing.
DEAD = struct.pack("<2I", 0x2000_5000, 0x0800_0009) + bytes.fromhex("0520 0138 fdd1 4ff0c041 0847")
SPINS = struct.pack("<2I", 0x2000_5000, 0x0800_0009) + bytes.fromhex("0130 0130 fce7")


def test_coverage_tells_lines_branches_and_functions(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    lcov = tmp_path / "a.info"
    words = ["coverage", SENSORS, "--for", "3.7s", "--drive", "PA6=1@3.5s", "--lcov", str(lcov)]
    assert run([*words, "--json"]) == 0
    found = {Path(file["file"]).name: file for file in json.loads(capfd.readouterr().out)}
    assert found["tick.c"]["lines_hit"] == found["tick.c"]["lines"]
    assert 0 < found["sensors.c"]["branches_hit"] <= found["sensors.c"]["branches"]
    assert found["startup.c"]["missed_lines"]  # its default handler does not run
    assert run([*words, "--missed", "--sources", "/src"]) == 0
    out = capfd.readouterr().out
    assert "startup.c: " in out
    assert "branches that went one way only:\nat " in out
    (branch,) = (row for row in found["board.c"]["one_way_branches"] if row["taken"] + row["not_taken"] == 1)
    assert f"board.c:{branch['line']} " in out
    records = lcov.read_text().split("end_of_record\n")[:-1]
    assert len(records) == len(found)
    for record in records:
        lines = record.splitlines()
        assert lines[1].startswith("SF:/src/")
        hits = [int(line.split(",")[1]) for line in lines if line.startswith("DA:")]
        assert f"LF:{len(hits)}" in lines
        assert f"LH:{sum(1 for n in hits if n)}" in lines
        ways = [line.rsplit(",", 1)[1] for line in lines if line.startswith("BRDA:")]
        assert f"BRH:{sum(1 for way in ways if way not in {'0', '-'})}" in lines


def test_coverage_that_is_too_low_is_a_failure(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["coverage", SENSORS, "--for", "1ms", "--fail-under", "100"]) == 1
    assert "are less than 100 %" in capfd.readouterr().err


def test_lines_agree_with_the_symbols_of_their_file() -> None:
    image = load_image(SENSORS)
    table = read_lines(image)
    main = image.symbols.address_of("main")
    assert main is not None
    row = table.at(main)
    assert row is not None
    source = (Path(SENSORS).parent / "sensors.c").read_text().splitlines()
    assert "main" in " ".join(source[row.line - 2 : row.line])
    assert table.place(main) == f"sensors.c:{row.line}"
    assert table.at(0x0800_F000) is None
    assert table.place(0x0800_F000) == ""
    assert all(a.end <= b.address for a, b in zip(table.rows, table.rows[1:], strict=False))


def test_an_image_without_debug_information_has_coverage_by_address(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    image = tmp_path / "bare.bin"
    image.write_bytes(DEAD)
    assert run(["coverage", str(image), "--missed"]) == 1  # it dies
    out = capfd.readouterr().out
    assert out.startswith("no debug information and no symbols: by address (give the ELF, compiled with -Og -g)\n")
    assert "0x08000008 to 0x08000013 ran\n" in out
    assert run(["coverage", str(image), "--lcov", str(tmp_path / "a.info")]) == 2
    assert "no debug information" in capfd.readouterr().err
    assert read_lines(parse_image(DEAD, str(image))).rows == ()


def test_profile_tells_functions_waits_and_stack(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    svg, folded = tmp_path / "a.svg", tmp_path / "a.txt"
    words = ["profile", SENSORS, "--for", "500ms", "--flame", str(svg), "--folded", str(folded)]
    assert run([*words, "--json"]) == 0
    found = json.loads(capfd.readouterr().out)
    assert found["cycles"] == sum(f["cycles"] for f in found["functions"]) + sum(
        int(line.rsplit(" ", 1)[1]) for line in folded.read_text().splitlines() if line.rsplit(" ", 1)[0][-1] == ">"
    )
    functions = {f["name"]: f for f in found["functions"]}
    assert functions["main"]["calls"] == 1
    assert functions["(asleep)"]["cycles"] > 0.9 * found["cycles"]
    exceptions = {e["name"]: e for e in found["exceptions"]}
    assert exceptions["SysTick"]["entries"] == functions["SysTick_Handler"]["calls"] >= 49
    assert exceptions["SysTick"]["least_wait_cycles"] >= 6
    assert 0 < found["stack"]["used_bytes"] < 1000
    assert ET.parse(svg).getroot().tag.endswith("svg")  # noqa: S314 - our own
    assert run(["profile", SENSORS, "--for", "10ms"]) == 0
    out = capfd.readouterr().out
    assert "with callees" in out
    assert "stack: " in out
    assert run(["profile", SENSORS, "--for", "1ms", "--all", "--flame", "/nowhere/a.svg"]) == 2


def test_trace_goes_to_the_screen_a_file_and_a_program(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    words = ["trace", SENSORS, "--for", "500us"]
    assert run(words) == 0
    lines = capfd.readouterr().out.splitlines()
    assert lines[0].split()[1:] == ["Reset_Handler+0x0", "(0x08000134)", "startup.c:27"] or "Reset_Handler" in lines[0]
    out = tmp_path / "trace"
    assert run([*words, "--out", str(out), "--json"]) == 0
    rows = [json.loads(line) for line in out.read_text().splitlines()]
    assert len(rows) == len(lines)
    assert [row["cycle"] for row in rows] == sorted(row["cycle"] for row in rows)
    assert run([*words, "--calls"]) == 0
    calls = capfd.readouterr().out.splitlines()
    assert 5 < len(calls) < len(lines)
    assert run(["trace", SENSORS, "--from", "10ms", "--for", "10ms"]) == 0
    assert "-> SysTick" in capfd.readouterr().out
    assert run([*words, "--out", "/nowhere/trace"]) == 2


def test_a_dead_program_shows_its_last_blocks(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    image = tmp_path / "dead.bin"
    image.write_bytes(DEAD)
    assert run(["run", str(image), "--for", "1ms"]) == 1
    error = capfd.readouterr().err
    assert "fault: " in error
    lines = error.splitlines()
    blocks = lines[lines.index(TITLE) + 1 :]
    # 1 of the start, 4 turns in one line, 1 after them.
    assert [" x " in line for line in blocks[:3]] == [False, True, False]
    assert lines[-1].startswith("fault: "), "the cause stands at the end"


def test_a_program_that_takes_too_long_is_given_up(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    image = tmp_path / "spins.bin"
    image.write_bytes(SPINS)
    assert run(["run", str(image), "--for", "1000s", "--budget", "0.1s"]) == 1
    error = capfd.readouterr().err
    assert "are used up at" in error
    assert "32 x 0x08000008" in error
    assert error.splitlines()[-2].startswith(f"{NAME}: 0.1 s of wall clock are used up")


def test_a_program_that_sleeps_for_good_is_reported(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    image = tmp_path / "sleeps.bin"
    image.write_bytes(bytes.fromhex("00500020 09000008 72b630bffde7"))  # cpsid i; wfi; b back to it
    assert run(["run", str(image), "--for", "1s"]) == 0
    assert "asleep, and nothing on the chip is due to wake it, at 0x0800000c" in capfd.readouterr().err
    assert run(["run", SENSORS, "--for", "10ms"]) == 0
    assert "cycles, asleep at tick_wait_until" in capfd.readouterr().err
