"""Variables that a run records: beside the trace, which knows nothing of them, and as plots of the run's page."""

import json
import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from p2os.cli.main import run as p2os
from robot_bench.bench.recorded_variables import variables_of
from robot_bench.cli.shown.targets import run_target
from robot_bench.events.codec import TraceError
from robot_bench.recording.run_folder import VARIABLES_NAME
from robot_bench.recording.run_record import read_run
from robot_bench.recording.variables import MOST_ROWS, VariableWriter, read_variables
from robot_bench.report.make import Files
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario

SCENARIO = load_scenario("dodge").with_options(body="kinematic", duration_s=0.6)
NAMES = ("ticks", "main::odometer.left.steps")


def test_a_run_that_records_variables_leaves_the_same_trace_and_shows_them(tmp_path: Path) -> None:
    plain = run_scenario(SCENARIO, tmp_path / "plain", files=Files.SUMMARY).folder
    watched = run_scenario(SCENARIO, tmp_path / "watched", files=Files.SUMMARY, variables=NAMES).folder
    again = run_scenario(SCENARIO, tmp_path / "again", files=Files.SUMMARY, variables=NAMES, speed=1000.0).folder
    assert len({str(read_run(folder).end["trace_sha256"]) for folder in (plain, watched, again)}) == 1
    assert read_run(plain).variables == []
    # The rows do not depend on how long the slices were.
    rows = [(folder / VARIABLES_NAME).read_bytes() for folder in (watched, again)]
    assert rows[0] == rows[1]
    ticks, steps = read_run(watched).variables
    assert (ticks.name, ticks.type_name, steps.name) == ("ticks", "uint32_t", NAMES[1])
    assert ticks.values == [float(number) for number in range(len(ticks.values))]
    assert 50 < len(ticks.values) < 70
    target = run_target(str(watched))
    assert target is not None
    shown = {track.header.name: track for track in target.source.recording.tracks}
    assert list(shown["ticks"].times) == ticks.times
    header = shown["ticks"].header
    assert (header.kind, header.unit, header.is_stepped) == ("samples", "", True)
    assert header.doc.startswith("uint32_t")


def test_a_name_that_is_none_is_said_before_anything_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["run", "dodge", "--watch-variable", "tick", "--out", str(tmp_path / "run")]) == 2
    assert "did you mean 'ticks'" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
    assert p2os(["run", "dodge", "--watch-variable", "ticks", "--port", "loop:"]) == 2
    assert "--watch-variable cannot stand beside --port" in capsys.readouterr().err


def test_rows_that_are_known_are_written_once_and_long_ones_in_lines(tmp_path: Path) -> None:
    with VariableWriter(tmp_path, variables_of(SCENARIO.firmware, ["ticks", "head"])) as writer:
        for at in range(2 * MOST_ROWS):
            writer.take(at, False, [("ticks", at / 2)])
        writer.take(3, True, [("ticks", 9.0), ("head", math.nan)])
        writer.take(4, False, [("head", math.inf)])
    assert len((tmp_path / VARIABLES_NAME).read_text().splitlines()) == 4
    ticks, head = read_variables(tmp_path)
    assert (ticks.times, ticks.values[-1]) == (list(range(2 * MOST_ROWS)), MOST_ROWS - 0.5)
    assert head.times == [3, 4]
    assert all(map(math.isnan, head.values))
    # A run that was cut has what stands in whole lines.
    whole = (tmp_path / VARIABLES_NAME).read_bytes()
    (tmp_path / VARIABLES_NAME).write_bytes(whole[: whole.rindex(b"\n", 0, -1) + 5])
    assert [len(one.times) for one in read_variables(tmp_path)] == [2 * MOST_ROWS, 0]


@pytest.mark.parametrize("line", [
    '{"n":1,"t":[1],"v":[1]}', '{"n":-1,"t":[1],"v":[1]}', '{"n":0,"t":[1],"v":[1,2]}', '{"n":0,"t":[2,2],"v":[1,2]}',
    '{"n":0,"t":[-1],"v":[1]}', '{"n":0,"t":[1.5],"v":[1]}', '{"n":0,"t":[1],"v":["x"]}', '{"n":0}',
    '{"n":true,"t":[],"v":[]}',
])  # fmt: skip
def test_a_damaged_line_is_named(tmp_path: Path, line: str) -> None:
    head = '{"v":1,"variables":[{"name":"x","type":"int"}]}'
    (tmp_path / VARIABLES_NAME).write_text(f"{head}\n{line}\n")
    with pytest.raises(TraceError, match=r"variables\.jsonl:2: a damaged line"):
        read_variables(tmp_path)
    (tmp_path / VARIABLES_NAME).write_text('{"v":2,"variables":[]}\n')
    with pytest.raises(TraceError, match="later version"):
        read_variables(tmp_path)


ANY = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("ntv"), inner), max_leaves=8,
)  # fmt: skip


@settings(max_examples=30)
@given(ANY)
def test_any_line_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, entry: object) -> None:
    folder = tmp_path_factory.getbasetemp()
    head = '{"v":1,"variables":[{"name":"x","type":"int"}]}'
    (folder / VARIABLES_NAME).write_text(f"{head}\n{json.dumps(entry)}\n")
    try:
        found = read_variables(folder)
    except TraceError:
        return
    assert [one.name for one in found] == ["x"]
