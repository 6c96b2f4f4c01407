"""Pins as VCD and as a sigrok session: read back by other programs where those are there."""

import io
import shutil
import subprocess
import zipfile
from collections import Counter
from pathlib import Path

import pytest

from bluepill_sim.analysis.waveforms.vcd_writer import identifier
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.waveforms import nets_in_order, write_sigrok, write_vcd
from robot_bench.wires.edges import Edges
from tests.robot_bench.recording.records import motor_pins, record

MS = 1_000_000


def a_run() -> RunRecord:
    pins = motor_pins((0, 0, 0), (0.003, 3, 1), (0.004, -4, 0)) | {
        "DD1": Edges([(0, 0), (1_500_001, 1)]),
        "rst": Edges([(0, 0)]),
    }
    return record(pins=pins, last_ns=5 * MS)


def test_a_vcd_holds_every_edge_to_the_nanosecond(tmp_path: Path) -> None:
    path = tmp_path / "pins.vcd"
    run = a_run()
    write_vcd(run, path)
    from vcd.reader import TokenKind, tokenize

    names, edges, now = {}, [], 0
    for token in tokenize(io.BytesIO(path.read_bytes())):
        if token.kind is TokenKind.VAR:
            names[token.var.id_code] = token.var.reference
        elif token.kind is TokenKind.CHANGE_TIME:
            now = token.data
        elif token.kind is TokenKind.CHANGE_SCALAR:
            edges.append((now, names[token.scalar_change.id_code], int(token.scalar_change.value)))
    order = nets_in_order(run)
    wanted = sorted((at, index, level) for index, name in enumerate(order) for at, level in run.pins[name])
    assert edges == [(at, order[index], level) for at, index, level in wanted]
    assert now == 5 * MS


def test_a_session_shows_the_level_of_each_sample(tmp_path: Path) -> None:
    path = tmp_path / "pins.sr"
    run = a_run()
    write_sigrok(run, path)
    with zipfile.ZipFile(path) as archive:
        assert archive.read("version") == b"2"
        assert b"samplerate=1 MHz" in archive.read("metadata")
        samples = archive.read("logic-1-1")
    assert len(samples) == 5_001, "5 ms at 1 MHz, the end included; 8 nets fit a byte"
    names = nets_in_order(run)
    for index, name in enumerate(names):
        for number in (0, 1_499, 1_500, 1_501, 1_502, 3_000, 4_000, 5_000):
            level = [v for at, v in run.pins[name] if at <= number * 1_000][-1]
            assert samples[number] >> index & 1 == level, (name, number)


def test_the_same_run_gives_the_same_bytes(tmp_path: Path) -> None:
    for write in (write_sigrok, write_vcd):
        write(a_run(), tmp_path / "a")
        write(a_run(), tmp_path / "b")
        assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_long_run_is_sampled_less_often(tmp_path: Path) -> None:
    run = a_run()
    run.last_ns = 120 * 10**9
    write_sigrok(run, tmp_path / "pins.sr")
    with zipfile.ZipFile(tmp_path / "pins.sr") as archive:
        assert b"samplerate=100 kHz" in archive.read("metadata")
        assert archive.getinfo("logic-1-1").file_size == 12_000_001


def test_a_run_without_pins_still_has_its_files(tmp_path: Path) -> None:
    write_vcd(record(), tmp_path / "pins.vcd")
    write_sigrok(record(), tmp_path / "pins.sr")
    assert (tmp_path / "pins.vcd").read_text().startswith("$version")


def test_codes_of_variables_are_short_and_different() -> None:
    codes = [identifier(index) for index in range(10_000)]
    assert len(set(codes)) == len(codes)
    assert max(map(len, codes)) == 3


@pytest.mark.skipif(shutil.which("sigrok-cli") is None, reason="sigrok-cli is not installed")
def test_sigrok_reads_both_files(tmp_path: Path) -> None:
    run = a_run()
    write_sigrok(run, tmp_path / "pins.sr")
    write_vcd(run, tmp_path / "pins.vcd")
    shown = subprocess.run(
        ["sigrok-cli", "-i", str(tmp_path / "pins.sr"), "--show"],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    assert "motor1_comm1" in shown.stdout
    for source in (["-i", "pins.sr"], ["-i", "pins.vcd", "-I", "vcd:downsample=1000"]):  # of its nanoseconds
        command = ["sigrok-cli", *source, "-O", "csv", "--channels", "DD1"]
        out = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60, cwd=tmp_path).stdout
        counts = Counter(out.splitlines())  # a line a microsecond
        assert sum(count for line, count in counts.items() if line.strip() == "1") in range(3_498, 3_502)
