"""What the bench has to show: run folders, and scenarios as they run (entry points of `p2os.view_sources`)."""

import contextlib
import gc
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

from bluepill_sim.cli.gdb_server import GdbPort
from p2os.view.live import StillRecording
from p2os.view.targets import ViewTarget
from robot_bench.cli.debugging.gdb import say_where
from robot_bench.cli.shown.live_run import LiveRun
from robot_bench.recording.run_folder import make_next_folder
from robot_bench.recording.run_record import TRACE_NAME, read_run
from robot_bench.recording.summary import outcome_of, outcome_of_all
from robot_bench.recording.together import robots_in, scenario_of
from robot_bench.report.page_of_all import report_of_all
from robot_bench.report.run_page import run_report, run_sections
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import known_scenarios, load_scenario
from robot_bench.scenario.scenario import Scenario


def run_target(named: str) -> ViewTarget | None:
    """Return a run folder, of one robot or of several; None where it is none.

    Raises:
        TraceError: Its trace is damaged.
    """
    folder = Path(named)
    if (folder / TRACE_NAME).is_file():
        with _without_collecting():
            record = read_run(folder)
            source = StillRecording(run_report(record, is_measured=False))
        return ViewTarget(source=source, run=lambda: source.show(run_sections(record)))
    if names := robots_in(folder):
        records = {name: read_run(folder / name) for name in names}
        outcome = outcome_of_all(scenario_of(folder), {name: outcome_of(one) for name, one in records.items()})
        return ViewTarget(source=StillRecording(report_of_all(outcome, records)))
    return None


@contextlib.contextmanager
def _without_collecting() -> Iterator[None]:
    """Search for no garbage in a block that makes a million objects and drops none."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


def scenario_target(named: str) -> ViewTarget | None:
    """Return a scenario, run at the pace of the clock into a run folder; None where it is none.

    Code that it names runs only where that was trusted before.

    Raises:
        ScenarioError: Its file cannot be run.
    """
    if named not in known_scenarios() and not named.endswith(".toml"):
        return None
    scenario = load_scenario(named, trust=False)
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
