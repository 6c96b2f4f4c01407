"""Which lines of a program have run, on the page of a run that was measured."""

from pathlib import Path

import pytest

from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.analysis.program_lines import NO_CODE, NOT_YET, program_lines
from bluepill_sim.board import BluePill
from p2os.view.header import PageSource, PageTable
from robot_bench.bench import Bench
from robot_bench.events.codec import Json
from robot_bench.recording.run_record import read_run
from robot_bench.report.run_page import run_report
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
from robot_bench.view.program_sections import program_sections

SCENARIO = load_scenario("motors").with_options(body="kinematic", mode="direct", duration_s=0.4)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_scenario(SCENARIO, tmp_path_factory.mktemp("measured") / "run", coverage=True).folder


def known(program: Json) -> Json:
    """Return what has run without when."""
    files = [{**file, "ran_ns": [min(at, 0) for at in file["ran_ns"]]} for file in program["files"]]  # type: ignore[attr-defined]  # JSON
    return {"files": files, "functions": [row[:5] for row in program["functions"]]}  # type: ignore[attr-defined]  # JSON


def test_a_run_that_was_measured_shows_when_each_line_ran_first(measured: Path) -> None:
    record = read_run(measured)
    recording = run_report(record)
    (panel,) = recording.header.panels
    shares, sources = panel.sections
    assert panel.name == "program"
    assert "lines have run" in shares.note
    table = shares.blocks[0]
    assert isinstance(table, PageTable)
    main = next(row for row in table.rows if row[0].text == "main")
    assert main[0].at_ns is not None
    assert 0 < main[0].at_ns < record.last_ns
    times = [at for block in sources.blocks if isinstance(block, PageSource) for at in block.ran_ns]
    assert {NOT_YET, NO_CODE} < set(times)
    assert max(times) <= record.last_ns
    assert len({at for at in times if at > 0}) > 10


def test_what_a_board_knows_of_itself_is_what_the_recorder_counts(measured: Path) -> None:
    bench = Bench(SCENARIO)
    bench.run_until(SCENARIO.duration_ns)
    assert isinstance(bench.chip, BluePill)
    coverage = Coverage.of_board(bench.chip, bench.chip.entered_blocks, bench.chip.gone_ways)
    record = read_run(measured)
    assert known(program_lines(coverage, SCENARIO.firmware.parent)) == known(record.end["program"])  # type: ignore[arg-type]  # JSON


def test_a_program_without_lines_has_functions_and_one_without_names_neither() -> None:
    functions = [["main", 3, 4, 1, 2, 7], ["idle", 0, 4, 0, 0, NOT_YET]]
    (only,) = program_sections({"files": [], "functions": functions})
    assert only.note == "3 of 8 instructions have run (38 %); 1 of 2 ways of branches were gone"
    table = only.blocks[0]
    assert isinstance(table, PageTable)
    assert [[cell.text for cell in row] for row in table.rows] == [
        ["main", "75 %", "3 of 4", "1 of 2"], ["idle", "0 %", "0 of 4", "–"],
    ]  # fmt: skip
    (none,) = program_sections({"files": [], "functions": []})
    assert none.blocks == []
    (lost, nowhere) = program_sections({"files": [{"name": "a.c", "lines": [], "ran_ns": [0, -1], "one_way": []},
                                                  {"name": "b.c", "lines": ["x"], "ran_ns": [0], "one_way": []}],
                                        "functions": []})  # fmt: skip
    assert lost.note.startswith("2 of 3 lines have run (67 %)")
    assert len(nowhere.blocks) == 1, "the text of a.c is not to be had"
