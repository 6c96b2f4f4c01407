"""`p2os explain`: why a run failed, from its trace and a replay of its chip."""

import json
import time
from dataclasses import asdict, replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated

import typer

from bluepill_sim.errors import BluePillError
from p2os.cli.groups import BENCH
from p2os.transport.wall_clock import wall_clock
from robot_bench.campaign.campaign_file import RunLimits
from robot_bench.campaign.journal import NAME as JOURNAL
from robot_bench.campaign.variants.against import Other
from robot_bench.campaign.variants.changed_back import ChangedBack, FailingRun, failing_and_passing, passes
from robot_bench.campaign.variants.fault_line import FaultLine, by_version
from robot_bench.campaign.variants.shrinking.kept import trial_of_run
from robot_bench.campaign.whole import points_of
from robot_bench.campaign.workers.processes import Processes
from robot_bench.cli.progress import RunDisplay, counting_bar
from robot_bench.events.codec import events_of
from robot_bench.recording.run_folder import TRACE_NAME
from robot_bench.recording.run_record import RunRecord, read_run, record_of
from robot_bench.recording.together import robots_in
from robot_bench.report.explain.chain import Explanation, Standing
from robot_bench.report.explain.explain import explain as explain_run
from robot_bench.scenario.goals.judging import judge
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from simbase.errors import FileError, P2osError, UsageError
from simbase.files import lines_of, sha256_of
from simbase.timing import NS_PER_S
from simbase.trust import Trust

HELP = """Trace a run's failure from the sensor to the wheel, with times.

The chip runs again with its recorded pin levels, then with one of them changed,
so each step is recorded or demonstrated. An unknown cause is reported as such.

RUN is a run folder or its trace; each of several robots is explained. A trace
without a verdict is judged by SCENARIO's goals; GOAL selects a failure by part
of its text.

--against a version that passes names the source line by which the two differ.
For a campaign's folder without such a version, each executed instruction is
changed in turn; a line is named where only its changes make the failing points
pass, and no passing one fail.

Exit code: 0 explained, or nothing failed; 1 cause unknown; 2 wrong usage.

\b
Examples:
  p2os explain runs/dodge-001                    what led to the first failure
  p2os explain runs/mine-001 mine.toml latency   one goal of mine.toml
  p2os explain runs/mine-001 --against build/good.elf    compared with another program
  p2os explain campaigns/dodge-001 --against build/good.elf    the line that differs
  p2os explain campaigns/dodge-001 --minutes 30  without a passing version
  p2os explain runs/mine-001 --json              one JSON object
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("explain", help=HELP, rich_help_panel=BENCH)(explain)


def explain(
    run: Annotated[Path, typer.Argument(help="A run folder, or a trace.", metavar="RUN")],
    scenario: Annotated[str | None, typer.Argument(help="Whose goals it is judged by.", metavar="SCENARIO")] = None,
    goal: Annotated[str, typer.Argument(help="A part of the failure's text.", metavar="GOAL")] = "",
    firmware: Annotated[Path | None, typer.Option(help="The program that ran.", metavar="FILE")] = None,
    against: Annotated[
        Path | None, typer.Option(help="A run, or a program, that does what it should.", metavar="RUN")
    ] = None,
    minutes: Annotated[
        float, typer.Option(help="Of a campaign's folder: so long changes are tried.", min=0.1, metavar="MINUTES")
    ] = 10.0,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Explain a run."""
    if (run / JOURNAL).is_file():
        other = None if against is None else Other.read(_reference(against))
        found_line = _line_of_campaign(run, other, minutes)
        typer.echo(json.dumps(asdict(found_line), sort_keys=True) if json_output else found_line.text)
        raise typer.Exit(0 if found_line.line else 1)
    names = robots_in(run)
    if names and (firmware is not None or against is not None):
        option = "--firmware" if firmware is not None else "--against"
        raise UsageError(f"{option} is for one robot", hint=f"p2os explain {run / names[0]} {option} FILE")
    plan = None if scenario is None else load_scenario(scenario, firmware=firmware, trust=Trust(only_reads=True))
    if firmware is not None and not firmware.is_file():
        raise UsageError(f"there is no firmware file {firmware}", hint="give the ELF, HEX or BIN file that ran")
    reference = None if against is None else _reference(against)
    found = {
        name: _explained(run / name if name else run, _plan_of(plan, name), goal, firmware, reference)
        for name in names or [""]
    }
    if reference is not None:
        found = {"": _with_line(found[""], run, firmware, reference)}
    if json_output:
        plain = {name: one.to_plain() for name, one in found.items()}
        typer.echo(json.dumps({"robots": plain} if names else plain[""], sort_keys=True))
    else:
        typer.echo("\n".join((f"{name}\n" if name else "") + one.text() for name, one in found.items()), nl=False)
    if any(one.standing is Standing.UNKNOWN for one in found.values()):
        raise typer.Exit(1)


def _line_of_campaign(folder: Path, other: Other | None, minutes: float) -> FaultLine:
    """Return the source line that makes a point of a campaign fail, or that it is not known."""
    failing, passing = failing_and_passing(points_of(folder, trust=False))
    if other is not None:
        return by_version(failing, other)
    until = wall_clock() + round(minutes * 60 * NS_PER_S)
    with RunDisplay(is_shown=False) as display:
        workers = Processes(1, RunLimits(), display.raise_if_interrupted)
        try:
            first = FailingRun(failing[0], time.process_time_ns, display.raise_if_interrupted)
            changed = ChangedBack(failing, passing, first.ran, first, lambda trial: passes(trial, workers))
            with counting_bar("changes", changed.count) as tell_bar:
                for tried in changed.look():
                    tell_bar(tried, f"{len(changed.found)} make it pass")
                    if wall_clock() >= until:
                        break
        finally:
            workers.close()
    return changed.result


def _with_line(found: Explanation, run: Path, firmware: Path | None, reference: Path) -> Explanation:
    """Return an explanation with the source line by which a version that passes differs, where that is known."""
    if found.standing is Standing.NOTHING or not run.is_dir():
        return found
    try:
        line = by_version([trial_of_run(run, firmware, trust=False)], Other.read(reference))
    except (P2osError, BluePillError) as error:
        return replace(found, limits=(*found.limits, f"the line by which {reference.name} differs: {error}"))
    if not line.line:
        return replace(found, limits=(*found.limits, line.says))
    if found.standing is Standing.CAUSE:
        return replace(found, also=(*found.also, f"{line.line}: {line.says}"))
    return replace(found, standing=Standing.CAUSE, summary=f"{line.line}: {line.says}")


def _plan_of(plan: Scenario | None, robot: str) -> Scenario | None:
    """Return the scenario of one of several robots, as its file has it."""
    if plan is None or not robot:
        return plan
    return next((own for own in plan.programmed if own.name == robot), plan)


def _explained(
    run: Path, plan: Scenario | None, goal: str, firmware: Path | None, reference: Path | None
) -> Explanation:
    path = run / TRACE_NAME if run.is_dir() else run
    record = read_record(path)
    if plan is not None:
        record = judged(record, path, plan)
    return explain_run(record, firmware or program_of(record, plan), failure=goal, reference=reference)


def read_record(path: Path) -> RunRecord:
    """Return what a trace holds.

    Raises:
        TraceError: It cannot be read as one.
        FileError: There is no such file, or it is no trace.
    """
    if path.name == TRACE_NAME:
        return read_run(path.parent)
    hint = "give a run folder, or a trace"
    record = record_of(lines_of(path, hint=hint), str(path))
    if not record.meta and not record.last_ns:
        raise FileError(f"{path} is no trace", hint=hint)
    return record


def judged(record: RunRecord, path: Path, scenario: Scenario) -> RunRecord:
    """Return a run as a scenario's goals judge it."""
    events = events_of(lines_of(path), str(path))
    found = judge(events, scenario.goals, end_ns=record.last_ns, planned_ns=scenario.planned_ns)
    reported = {"failures": found.missed, "goals_met": found.met, "goals_not_judged": found.not_judged}
    return replace(record, end={**record.end, **reported})


def program_of(record: RunRecord, scenario: Scenario | None = None) -> Path | None:
    """Return the file of the program that ran: where the trace says, or one that ships; None where it is gone."""
    name = str(record.meta.get("firmware", ""))
    beside = [] if scenario is None else [scenario.firmware]
    with as_file(files("robot_bench.firmware").joinpath(name or "none.elf")) as shipped:
        candidates = [Path(str(record.meta.get("firmware_path") or name)), *beside, Path(str(shipped))]
    wanted = record.meta.get("firmware_sha256")
    for candidate in candidates:
        if candidate.is_file() and sha256_of(candidate) == wanted:
            return candidate
    return None


def _reference(against: Path) -> Path:
    """Return the program of a run, or the program itself.

    Raises:
        UsageError: The run's program is gone.
    """
    if not against.is_dir():
        return against
    found = program_of(read_run(against))
    if found is None:
        raise UsageError(f"the program of {against} is not here any more", hint="--against FILE.elf")
    return found
