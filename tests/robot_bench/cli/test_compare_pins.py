"""`p2os compare-pins`: runs and captures as files, what is said, pictures and exit codes."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from p2os.cli.main import run as p2os
from robot_bench.cli import compare_pins as verb
from robot_bench.events.kinds import Wave
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.waveforms import waveforms_of
from robot_bench.wires.edges import Edges
from tests.bluepill_sim.analysis.waveforms.captures import Analyser, random_run, seen, with_edges
from tests.robot_bench.recording.records import record

RUN = random_run(5, edges=60)


def vcd(path: Path, waveforms: object) -> Path:
    """Write waveforms as a simulator does."""
    lines = ["$timescale 1 ps $end"]
    names = list(waveforms.signals)  # type: ignore[attr-defined]
    lines += [f"$var wire 1 {chr(40 + n)} {name} $end" for n, name in enumerate(names)]
    lines += ["$enddefinitions $end", f"#{round(1000 * waveforms.start_ns)}"]  # type: ignore[attr-defined]
    signals = [waveforms.signals[name] for name in names]  # type: ignore[attr-defined]
    lines += [f"{signal.first}{chr(40 + n)}" for n, signal in enumerate(signals)]
    rows = sorted((round(1000 * at), level, n) for n, signal in enumerate(signals) for at, level in signal.edges)
    lines += [f"#{at} {level}{chr(40 + n)}" for at, level, n in rows]
    path.write_text("\n".join([*lines, f"#{round(1000 * waveforms.end_ns)}\n"]))  # type: ignore[attr-defined]
    return path


def csv(path: Path, waveforms: object) -> Path:
    """Write waveforms as Saleae's Logic 2 does, channels by number."""
    signals = list(waveforms.signals.values())  # type: ignore[attr-defined]
    rows = sorted((at, n, level) for n, signal in enumerate(signals) for at, level in signal.edges)
    levels = [signal.first for signal in signals]
    lines = ["Time [s]," + ",".join(f"Channel {n}" for n in range(len(signals)))]
    for at, n, level in [(waveforms.start_ns, 0, levels[0]), *rows]:  # type: ignore[attr-defined]
        levels[n] = level
        lines.append(f"{at / 1e9:.9f}," + ",".join(map(str, levels)))
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def model(tmp_path: Path) -> str:
    return str(vcd(tmp_path / "model.vcd", RUN))


WIRES = [word for n in range(4) for word in ("--wire", f"Channel {n}=PA{n}")]


def test_a_csv_of_the_same_run_is_explained(model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = csv(tmp_path / "board.csv", seen(RUN, Analyser(offset_ns=3e6, ppm=40.0)))
    assert p2os(["compare-pins", model, str(path), *WIRES]) == 0
    said = capsys.readouterr().out
    assert "a sample is 41.67 ns (the times)" in said
    assert "offset   the capture begins at " in said
    assert "+40." in said or "+39." in said
    assert said.splitlines()[-1] == "every edge is explained: 240"
    assert all(len(line) <= 80 for line in said.splitlines())


def test_the_first_edge_is_named_and_drawn(model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capture = seen(RUN, Analyser(offset_ns=-3e6))
    edges = list(capture.signals["PA2"].edges)
    longest = max(range(len(edges) - 1), key=lambda n: edges[n + 1][0] - edges[n][0])
    at, level = edges[longest][0] + 5_000, edges[longest][1]
    edges[longest + 1 : longest + 1] = [(at, level ^ 1), (at + 500, level)]
    path = vcd(tmp_path / "board.vcd", with_edges(capture, {"PA2": edges}))
    pictures = [tmp_path / "first.svg", tmp_path / "first.png"]
    for picture in pictures:
        assert p2os(["compare-pins", model, str(path), "--rate", "24MHz", "--picture", str(picture)]) == 1
    said = capsys.readouterr().out
    assert "2 edges are not explained; the first:" in said
    assert f"PA2 PA2 {'falls' if level else 'rises'} in the capture, and not in the run" in said
    assert "an added pulse of 500 ns" in said
    assert f"the run is {'high' if level else 'low'} there; its nearest edge" in said
    assert pictures[1].read_bytes().startswith(b"\x89PNG")
    drawn = pictures[0].read_text()
    assert ">PA2<" in drawn
    assert "only in the capture" in drawn


def test_json_has_the_same(model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capture = seen(RUN, Analyser(offset_ns=-3e6))
    other = with_edges(capture, {"PA0": capture.signals["PA1"].edges, "PA1": capture.signals["PA0"].edges})
    path = vcd(tmp_path / "board.vcd", other)
    assert p2os(["compare-pins", model, str(path), "--rate", "24MHz", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert {(wire["channel"], wire["shows"]) for wire in found["miswired"]} == {("PA0", "PA1"), ("PA1", "PA0")}
    assert found["channels"]["PA2"] == {"pin": "PA2", "explained": 60, "added": 0, "missing": 0, "late_ns": None}
    assert abs(found["clock_ppm"]) < 3
    assert found["first"]["channel"] in {"PA0", "PA1"}


@pytest.mark.parametrize(("more", "words"), [
    (["--wire", "D0"], "is no CHANNEL=PIN"), (["--wire", "PA0=PA0", "--wire", "PA0=PA1"], "names channel PA0 twice"),
    (["--wire", "D7=PA0"], "has no channel D7"), (["--wire", "PA0=PC9"], "has no pin PC9"),
    (["--rate", "fast"], "no number of samples"), (["--picture", "a.gif"], "a picture ends in .png or .svg"),
])  # fmt: skip
def test_wrong_use_is_one_line(model: str, capsys: pytest.CaptureFixture[str], more: list[str], words: str) -> None:
    assert p2os(["compare-pins", model, model, *more]) == 2
    assert words in capsys.readouterr().err


def test_a_file_that_is_none_is_one_line(model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "x").write_text("nothing")
    for files in ((model, str(tmp_path / "x")), (model, str(tmp_path / "none")), (str(tmp_path), model)):
        assert p2os(["compare-pins", *files]) == 2
    assert capsys.readouterr().err.count("p2os: ") == 3


def test_pins_of_a_run_folder_have_the_boards_names_and_their_waves_edges() -> None:
    pins = {"motor1_comm1": Edges([(0, 1), (5_000, 0)]), "mine": Edges([(0, 0), (1_000, 0)])}
    run = record(pins=pins, last_ns=10_000)
    run.waves["mine"] = [
        (1_000, Wave(t=1_000, wire="mine", at=72, period=144, high=36, ticks_hz=72_000_000)),
        (6_200, None),
    ]
    assert isinstance(run, RunRecord)
    found = waveforms_of(run, "x")
    assert list(found.signals) == ["PB7", "mine"]
    assert found.signals["PB7"].edges == [(5_000, 0)]
    # Up every 2 us, half a microsecond long; it last went up a microsecond before.
    edges = [(2_000, 1), (2_500, 0), (4_000, 1), (4_500, 0), (6_000, 1), (6_200, 0)]
    assert [(round(at), level) for at, level in found.signals["mine"].edges] == edges


def test_names_of_the_adapters_wires_are_pins() -> None:
    assert verb._declared(["D0=motor1_comm1", "a=b=PA3"], {"motor1_comm1": "PB7"}) == {"D0": "PB7", "a=b": "PA3"}


def test_nets_are_the_pins_that_they_are_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    nets = {"motor1_comm1": RUN.signals["PA0"], "motor2_comm1": RUN.signals["PA1"], "mine": RUN.signals["PA2"]}
    pins = {net: Edges([(0, signal.first), *((round(at), to) for at, to in signal.edges)])
            for net, signal in nets.items()}  # fmt: skip
    run = record(pins=pins, last_ns=round(RUN.end_ns))
    monkeypatch.setattr("robot_bench.recording.run_record.read_run", lambda _: run)
    path = str(vcd(tmp_path / "board.vcd", replace(seen(RUN, Analyser(ppm=7.0)), signals=nets)))
    assert p2os(["compare-pins", str(tmp_path), path]) == 0
    said = capsys.readouterr().out
    assert "motor1_comm1 PB7: 60 edges explained" in said
    assert "motor2_comm1 PA1: 60 edges explained" in said
    assert p2os(["compare-pins", str(tmp_path), path, "--wire", "mine=mine", "--json"]) == 0
