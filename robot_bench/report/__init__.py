"""Reports made from a run folder, and from nothing else."""

from robot_bench.report.make import ReportFiles, make_report, make_scene

__all__ = ["ReportFiles", "make_report", "make_scene"]
