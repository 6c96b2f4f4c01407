"""What the bench has to show: run folders, and scenarios as they run (entry points of `p2os.view_sources`).

What runs and reads is imported where it is needed: a long run that was kept opens without the bench.
"""

import contextlib
import gc
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from p2os.view.live import StillRecording
from p2os.view.targets import ViewTarget
from robot_bench.recording.run_folder import TRACE_NAME
from robot_bench.view.kept_recording import is_long, keep, kept

if TYPE_CHECKING:
    from robot_bench.scenario.scenario import Scenario


def run_target(named: str) -> ViewTarget | None:
    """Return a run folder, of one robot or of several; None where it is none.

    Raises:
        TraceError: Its trace is damaged.
    """
    folder = Path(named)
    if (folder / TRACE_NAME).is_file():
        with _without_collecting():
            found = kept(folder)
            if found is None:
                return _read_target(folder)
        return ViewTarget(source=StillRecording(found), run=_get_ready)
    return _target_of_all(folder)


def _get_ready() -> None:
    """Load what a closer look at packets needs, while the browser still opens the page."""
    import_module("p2os.view.packet_rows")


def _read_target(folder: Path) -> ViewTarget:
    """Return a run out of its trace; its figures are shown when they are there, and all of it is kept."""
    from robot_bench.recording.run_record import read_run
    from robot_bench.report.run_page import run_report, run_sections

    record = read_run(folder)
    source = StillRecording(run_report(record, is_measured=False))

    def finish() -> None:
        sections = run_sections(record)
        source.show(sections)
        if is_long(folder):  # of rows of its own: the server fills those that are shown when somebody looks
            keep(run_report(record, is_measured=False), folder, sections)

    return ViewTarget(source=source, run=finish)


def _target_of_all(folder: Path) -> ViewTarget | None:
    from robot_bench.recording.together import robots_in, scenario_of

    if not (names := robots_in(folder)):
        return None
    from robot_bench.recording.run_record import read_run
    from robot_bench.recording.summary import outcome_of, outcome_of_all
    from robot_bench.report.page_of_all import report_of_all

    records = {name: read_run(folder / name) for name in names}
    outcome = outcome_of_all(scenario_of(folder), {name: outcome_of(one) for name, one in records.items()})
    return ViewTarget(source=StillRecording(report_of_all(outcome, records)))


def _fleet_target(scenario: "Scenario") -> ViewTarget:
    """Return a scenario with several robots, run at the pace of the clock; then its run folder."""
    from robot_bench.cli.shown.live_fleet import LiveFleet
    from robot_bench.recording.run_folder import make_next_folder
    from robot_bench.run import run_together

    live = LiveFleet(scenario)

    def run() -> None:
        done = run_together(scenario, make_next_folder(scenario.name), drive=live.drive)
        if done.was_interrupted:
            raise KeyboardInterrupt
        if (found := _target_of_all(done.folder)) is not None:
            live.source.end(found.source.recording.header)

    return ViewTarget(source=live.source, run=run)


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
    from robot_bench.scenario.loading import known_scenarios, load_scenario

    if named not in known_scenarios() and not named.endswith(".toml"):
        return None
    from robot_bench.cli.shown.live_target import live_target

    scenario = load_scenario(named, trust=False)
    return _fleet_target(scenario) if scenario.robots else live_target(scenario)
