"""Reports made from a run folder, and from nothing else."""

from testbench.report.make import ReportFiles, make_report

__all__ = ["ReportFiles", "make_report"]
