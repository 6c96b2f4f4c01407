"""Write a run folder's report: `report.html` and the PNG plots."""

from dataclasses import dataclass
from pathlib import Path

from testbench.report.page import render_page
from testbench.report.run_record import read_run


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportFiles:
    """Where the parts of a report were written."""

    page: Path
    #: Empty where Matplotlib is not installed.
    plots: tuple[Path, ...]


def make_report(folder: Path) -> ReportFiles:
    """Make the report of a run from its trace; what is there already is written anew.

    Without Matplotlib (the extra `sim`) the page is written and the plots are left out.

    Raises:
        TraceError: The folder holds no readable trace.
    """
    record = read_run(folder)
    page = folder / "report.html"
    page.write_text(render_page(record), encoding="utf-8")
    try:
        from testbench.report.plots import write_plots
    except ModuleNotFoundError:
        return ReportFiles(page=page, plots=())
    return ReportFiles(page=page, plots=write_plots(record, folder))
