"""The plots of runs: drawn in every test, painted in those of the report."""

from pathlib import Path

import pytest

try:
    from robot_bench.report import plots
except ModuleNotFoundError:  # no Matplotlib: no plots
    plots = None  # type: ignore[assignment]
PAINTED = Path(__file__).parent / "report"


@pytest.fixture(autouse=True)
def _plots_are_not_painted(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the step in which Matplotlib makes pixels of a figure: 0.3 s of the 0.4 s that a short run takes.

    The tests of the report have it, and runs in processes of their own.
    """
    if plots is not None and PAINTED not in request.path.parents:
        monkeypatch.setattr(plots, "_paint", lambda _figure, path: path.touch())
