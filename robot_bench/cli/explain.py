"""`p2os explain`: why a run failed, from its trace and a replay of its chip."""

import json
from dataclasses import replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.groups import BENCH
from robot_bench.events.codec import events_of
from robot_bench.recording.run_record import TRACE_NAME, RunRecord, read_run, record_of
from robot_bench.recording.together import robots_in
from robot_bench.report.explain.chain import Explanation, Standing
from robot_bench.report.explain.explain import explain as explain_run
from robot_bench.scenario.goals.judging import judge
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from simbase.errors import FileError, UsageError
from simbase.files import lines_of, sha256_of
from simbase.trust import Trust

HELP = """Say why a run failed: from the sensor to the wheel, with times.

The chip is run again with the levels that its pins had, and once more with one of
them changed: so each step is recorded or shown. Where nothing shows the cause it
says so.

RUN is a run folder or its trace; of several robots each is explained. A trace without a verdict is judged by SCENARIO's
goals; GOAL is a part of the failure's text, where there are several.

Exit code: 0 explained, or nothing failed; 1 the cause is not known; 2 wrong usage.

\b
Examples:
  p2os explain runs/dodge-001                    what led to the first failure
  p2os explain runs/mine-001 mine.toml latency   of the goals of mine.toml that one
  p2os explain runs/mine-001 --against build/good.elf    what another program had done
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
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Explain a run."""
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
    if json_output:
        plain = {name: one.to_plain() for name, one in found.items()}
        typer.echo(json.dumps({"robots": plain} if names else plain[""], sort_keys=True))
    else:
        typer.echo("\n".join((f"{name}\n" if name else "") + one.text() for name, one in found.items()), nl=False)
    if any(one.standing is Standing.UNKNOWN for one in found.values()):
        raise typer.Exit(1)


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
