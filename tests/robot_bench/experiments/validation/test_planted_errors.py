"""Errors written into copies of C++, Python and C sources: each is told by its experiment and figure."""

import pytest

from robot_bench.experiments.validation.experiments import EXPERIMENTS
from tests.robot_bench.experiments.validation.planted_errors import PLANTED, Planted, changed, figures_that_report

#: One of each language in every run, that whose compiler takes long beside the slow ones; the others in `make soak`.
MARKS = {"motor value without a sign": [pytest.mark.slow], "tick 1 % slow": []}


def test_every_planted_error_is_an_edit_of_its_file_as_it_stands() -> None:
    for row in PLANTED:
        assert row.new in changed(row)
        assert row.experiment in EXPERIMENTS
    assert {row.error for row in PLANTED} >= MARKS.keys()


@pytest.mark.parametrize(
    "planted",
    [pytest.param(row, marks=MARKS.get(row.error, [pytest.mark.soak]), id=row.error) for row in PLANTED],
)
def test_an_error_in_the_sources_is_reported_by_the_right_figure(planted: Planted) -> None:
    assert planted.figure in figures_that_report(planted, [planted.experiment])[planted.experiment]


@pytest.mark.parametrize(
    ("path", "text", "experiment"),
    [
        pytest.param("adapter_sim/distances.py", "import is_near", "sensors-all", marks=pytest.mark.slow, id="Python"),
        pytest.param("robot_bench/firmware/tick.c", "HCLK_HZ", "motors", id="C"),
    ],
)
def test_nothing_planted_is_reported_by_nothing(path: str, text: str, experiment: str) -> None:
    nothing = Planted("none", path, text, text, "", "", ("adapter", "model"))
    assert figures_that_report(nothing, [experiment]) == {experiment: []}
