"""A scenario that runs while it is shown, into a run folder; with GDB beside the page where that is asked for."""

import contextlib
from dataclasses import replace
from functools import partial

from bluepill_sim.cli.gdb_server import GdbPort
from p2os.view.targets import ViewTarget
from robot_bench.cli.debugging.gdb import say_where
from robot_bench.cli.shown.live_run import LiveRun
from robot_bench.recording.run_folder import make_next_folder
from robot_bench.recording.run_record import read_run
from robot_bench.report.run_page import run_report
from robot_bench.run import run_scenario
from robot_bench.scenario.scenario import Scenario


def live_target(scenario: Scenario) -> ViewTarget:
    """Return a scenario as `p2os view` runs it, at the pace of the clock."""
    return replace(_live_target(scenario), debugged=partial(_debugged, scenario))


def _debugged(scenario: Scenario, port: int) -> ViewTarget:
    opened = GdbPort(port)
    say_where(opened.port, scenario)
    return _live_target(scenario, opened)


def _live_target(scenario: Scenario, gdb: GdbPort | None = None) -> ViewTarget:
    live = LiveRun(scenario, gdb=gdb)
    live.stays = True

    def run() -> None:
        with contextlib.closing(gdb) if gdb is not None else contextlib.nullcontext():
            done = run_scenario(scenario, make_next_folder(scenario.name), drive=live.drive)
            if done.was_interrupted:
                raise KeyboardInterrupt
            live.source.report(run_report(read_run(done.folder)).header)
            live.stay()

    return ViewTarget(source=live.source, run=run)
