"""Errors written into copies of C++, Python and C sources: each is told by its experiment and figure."""

import pytest

from robot_bench.experiments.validation.experiments import EXPERIMENTS
from tests.robot_bench.experiments.validation.planted_errors import PLANTED, Planted, changed, told_of

#: One of each language in every run; the others in `make soak`.
CHEAP = {"motor value without a sign", "ranges 2 % long", "tick 1 % slow"}


def test_every_planted_error_is_an_edit_of_its_file_as_it_stands() -> None:
    for row in PLANTED:
        assert row.new in changed(row)
        assert row.experiment in EXPERIMENTS
    assert {row.error for row in PLANTED} >= CHEAP


@pytest.mark.parametrize(
    "planted",
    [pytest.param(row, marks=() if row.error in CHEAP else pytest.mark.soak, id=row.error) for row in PLANTED],
)
def test_an_error_in_the_sources_is_told_by_the_right_figure(planted: Planted) -> None:
    assert planted.figure in told_of(planted, [planted.experiment])[planted.experiment]


def test_nothing_planted_is_told_by_nothing() -> None:
    nothing = Planted(
        "none", "adapter_sim/distances.py", "import is_near", "import is_near", "", "", ("adapter", "model")
    )
    assert told_of(nothing, ["sensors-all", "motors"]) == {"sensors-all": [], "motors": []}
