"""The history of figures: a row of `make bench` is read as it is printed, and a commit has its figures once."""

import contextlib
import io

import pytest

from tools import bench_history
from tools.bench.measuring import row
from tools.bench_history import BenchRun, figures_of, page


def test_a_row_is_read_as_the_benchmarks_print_it() -> None:
    with contextlib.redirect_stdout(out := io.StringIO()):
        row("SIPs decoded, every field", [3.0, 1.0, 2.0], "{:.0f} a second", "a robot sends 10 a second")
        row("computes without pause", 11.25, "{:.2f} x real")
        row("a name " + "x" * 52, "0.5")
    out.write("with TIM1 to TIM4 running:\n")
    assert figures_of(out.getvalue()) == {
        "SIPs decoded, every field": "2 a second", "computes without pause": "11.25 x real",
        "a name " + "x" * 52: "0.5",
    }  # fmt: skip


def test_the_page_has_the_newest_first_and_says_nothing_where_a_figure_was_not_taken() -> None:
    figures = [{"a": str(n)} | ({"b|c": "x"} if n == 9 else {}) for n in range(10)]
    runs = [BenchRun(commit=f"c{n}", date="2026-11-27T01:00:00Z", figures=found) for n, found in enumerate(figures)]
    lines = page(runs).splitlines()
    assert lines[2].startswith("| figure | c9 2026-11-27 | c8 ")
    assert lines[2].count("|") == bench_history.COLUMNS + 2
    assert lines[4] == "| a | 9 | 8 | 7 | 6 | 5 | 4 | 3 | 2 |"
    assert lines[5] == "| b\\|c | x |" + "  |" * 7


def test_a_commit_is_kept_once(tmp_path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.argv", ["history", str(tmp_path)])
    for figure in ("1.0", "2.0"):
        (tmp_path / "latest.txt").write_text(f"{'a figure':<60} {figure:>14}  \n", encoding="utf-8")
        assert bench_history.main() == 0
    (run,) = bench_history.read_history(tmp_path / "history.jsonl")
    assert run.figures == {"a figure": "2.0"}
    (tmp_path / "latest.txt").write_text("nothing\n", encoding="utf-8")
    assert bench_history.main() == 2
    assert "has no figures" in capsys.readouterr().err
