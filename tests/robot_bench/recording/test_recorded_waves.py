"""Waves in the trace, and what is made of them: VCD, summary, report."""

import json
from io import StringIO
from pathlib import Path

import pytest
import vcd.reader

from bluepill_sim.fabric.subscriptions import Wave
from robot_bench.recording.recorder import Recorder
from robot_bench.recording.run_record import RunRecord, TraceError, record_of
from robot_bench.recording.signals import levels_and_duties
from robot_bench.recording.summary import figures
from robot_bench.recording.trace import TraceWriter
from robot_bench.recording.waveforms import write_vcd
from robot_bench.wires.nets import Harness, Net, Strength, WaveDrive

PP = Strength.PUSH_PULL
SLOW, FAST = (Wave(ns=0, at=0, period=3600, high=high, ticks_hz=72_000_000) for high in (900, 1800))
OTHER = Wave(ns=10, at=5, period=1000, high=1, ticks_hz=8_000_000)
MS = 1_000_000


def recorded() -> RunRecord:
    """A net that is high, waves from 10 ms on, changes its wave twice, and is high again from 120 ms on."""
    trace, harness = TraceWriter(), Harness([Net("pwm"), Net("plain")])
    recorder = Recorder(trace, harness, body=None)
    net = harness["pwm"]
    recorder.start()
    net.drive("chip", True, PP, 0)
    net.wave_from("chip", WaveDrive(SLOW, PP.codes), 10 * MS)
    harness["plain"].drive("chip", True, PP, 20 * MS)
    net.wave_from("chip", WaveDrive(FAST, PP.codes), 30 * MS)
    recorder.advance_to(50 * MS)
    net.wave_from("chip", WaveDrive(OTHER, PP.codes), 60 * MS)
    recorder.advance_to(100 * MS)
    net.drive("chip", True, PP, 120 * MS)
    recorder.finish(150 * MS)
    return record_of(trace.lines())


def test_a_wave_is_a_row_a_change_and_the_edges_have_it_as_low() -> None:
    record = recorded()
    found = [(at // MS, wave and (wave.period, wave.high, wave.ticks_hz)) for at, wave in record.waves["pwm"]]
    shapes = [(wave.period, wave.high, wave.ticks_hz) for wave in (SLOW, FAST, OTHER)]
    assert found == [(10, shapes[0]), (30, shapes[1]), (60, shapes[2]), (120, None)]
    for at, wave in record.waves["pwm"][:3]:
        there = next(one for one in (SLOW, FAST, OTHER) if one.high == wave.high)
        # So many ticks ago it rose: high since then, if that is less than it stays high.
        assert (wave.at < wave.high) is there.level(at)
    assert record.pins["pwm"] == [(0, 1), (10 * MS, 0), (120 * MS, 1)]
    assert record.pins["plain"] == [(0, 0), (20 * MS, 1)]


def test_the_report_draws_the_duty_as_a_part_of_the_level() -> None:
    duties = levels_and_duties(recorded(), "pwm")
    assert duties == [(0, 1), (10 * MS, 0.25), (30 * MS, 0.5), (60 * MS, 0.001), (120 * MS, 1)]


def test_the_summary_has_frequency_and_duty() -> None:
    assert dict(figures(recorded()))["PWM on pwm"] == "8000 to 20000 Hz, duty 0.1 to 50.0 %"


def test_the_vcd_has_x_during_a_wave_and_duty_and_frequency_as_numbers(tmp_path: Path) -> None:
    write_vcd(recorded(), tmp_path / "pins.vcd")
    names: dict[str, str] = {}
    rows = []
    now = 0
    for token in vcd.reader.tokenize((tmp_path / "pins.vcd").open("rb")):
        if token.kind is vcd.reader.TokenKind.VAR:
            names[token.data.id_code] = token.data.reference
        elif token.kind is vcd.reader.TokenKind.CHANGE_TIME:
            now = token.data // MS
        elif token.kind in {vcd.reader.TokenKind.CHANGE_SCALAR, vcd.reader.TokenKind.CHANGE_REAL}:
            rows.append((now, names[token.data.id_code], token.data.value))
    assert [(at, value) for at, name, value in rows if name == "pwm_hz"] == [
        (10, 20_000), (30, 20_000), (60, 8_000), (120, 0)
    ]  # fmt: skip
    assert [value for _, name, value in rows if name == "pwm_duty_percent"] == [25, 50, 0.1, 100]
    last = {at: value for at, name, value in rows if name == "pwm"}
    assert last == {0: "1", 10: "x", 30: "x", 60: "x", 120: "1"}
    assert [(at, value) for at, name, value in rows if name == "plain"] == [(0, "0"), (20, "1")]


@pytest.mark.parametrize("row", [(0, 10, 10), (0, 10, 0), (10, 10, 5), (-1, 10, 5), (0, -10, 5), (1 << 70, 10, 5)])
def test_a_row_that_is_no_wave_is_a_damaged_line(row: tuple[int, int, int]) -> None:
    shape = dict(zip(("at", "period", "high"), row, strict=True))
    line = json.dumps({"k": "wave", "t": 5, "net": "pwm", "hz": 1000, **shape}) + "\n"
    with pytest.raises(TraceError, match="the trace:2: a damaged line"):
        record_of(StringIO('{"k":"meta"}\n' + line))
