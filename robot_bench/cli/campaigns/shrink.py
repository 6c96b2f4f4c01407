"""`p2os shrink`: a failing run made small, and kept as a scenario and a test."""

import json
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.groups import BENCH
from p2os.cli.quantities import option
from p2os.cli.trust import Trusted, said
from p2os.toml_record import tables_of
from robot_bench.campaign.trial import Trial, trial_of
from robot_bench.campaign.variants.shrinking.failure import Failure, FailureMode, failure_of
from robot_bench.campaign.variants.shrinking.kept import Kept, keep, trial_of_run
from robot_bench.campaign.variants.shrinking.shrink import BUDGET, Shrunk, shrink
from robot_bench.cli.names import scenario_names
from robot_bench.cli.progress import RunDisplay, runs_bar
from robot_bench.recording.run_folder import TRACE_NAME, make_next_folder
from robot_bench.scenario.included_files import Setting, read_setting
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, Nanos
from simbase.trust import Trust
from simbase.units import COUNT, SEED

#: What makes a trial cheap.
QUICK: tuple[Setting, ...] = (("mode", "direct"), ("body", "kinematic"))
HELP = """Reduce a failing run to its cause and keep it as a test.

It removes obstacles, events, faults, robots and goals that are met, rounds
numbers and shortens the run. The rest fails in the same way: the same goal, and
on contact the same side of the hull. Another process confirms it.

RUN is a run folder; SCENARIO a name or a TOML file that fails. The new folder
has the scenario, a failing pytest test, a picture, the output of
`p2os explain`, and the run with its report.

Exit code: 0 done, 1 nothing fails or the reduced run was not confirmed, 2 wrong
usage.

\b
Examples:
  p2os shrink runs/patrol-003                      the essential part of that run
  p2os shrink patrol.toml --firmware build/bad.elf --out tests/found-1
  p2os shrink patrol.toml --quick                  search on the plan view first
  pytest tests/found-1 --firmware build/new.elf    does the new version pass?
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("shrink", help=HELP, rich_help_panel=BENCH)(shrink_run)


def shrink_run(
    run: Annotated[
        str, typer.Argument(help="A run folder, or a scenario.", metavar="RUN|SCENARIO", autocompletion=scenario_names)
    ],
    firmware: Annotated[
        Path | None, typer.Option(help="ELF, HEX or BIN in place of the scenario's.", metavar="FILE")
    ] = None,
    mode: Annotated[str | None, typer.Option(help="As of p2os run.", metavar="direct|adapter")] = None,
    body: Annotated[str | None, typer.Option(help="As of p2os run.", metavar="BODY")] = None,
    seed: Annotated[int | None, option(SEED, "--seed", purpose="As of p2os run.", least="0")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", help="A key of the scenario; repeatable.", metavar="KEY=VALUE")
    ] = None,
    goal: Annotated[
        str | None, typer.Option(help="The kind of the goal, where several are missed.", metavar="KIND")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Search with pins straight to a plan view first.")] = False,
    budget: Annotated[
        int, option(COUNT, "--budget", purpose="Most runs.", shown=str(BUDGET), above_zero=True)
    ] = BUDGET,
    out: Annotated[Path | None, typer.Option(help="Folder; default shrunk/NAME-NNN.", metavar="FOLDER")] = None,
    trust: Trusted = False,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Shrink a failing run."""
    options = {"mode": mode, "body": body, "seed": seed}
    settings = [*map(read_setting, set_ or ()), *((key, value) for key, value in options.items() if value is not None)]
    trial = _trial(run, firmware, settings, said(trust))
    if goal is not None:
        trial = _with_goal(trial, goal)
    if out is not None and out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise UsageError(f"{out} is not empty", hint="--out names another folder")
    with RunDisplay(is_shown=False) as display:
        with runs_bar(budget) as advance:

            def judge(candidate: Trial, way: FailureMode | None, until_ns: Nanos | None) -> Failure | None:
                advance()
                return failure_of(candidate, way, until_ns, display.raise_if_interrupted)

            small = shrink(trial, quick=QUICK if quick else (), budget=budget, judge=judge)
        kept = keep(small.trial, small.failure.way, out or make_next_folder(trial.name, Path("shrunk")))
    if json_output:
        typer.echo(json.dumps(as_json(small, kept), sort_keys=True))
    else:
        _print(small, kept)
    if not kept.is_confirmed:
        typer.echo("the run of another process was not the same", err=True)
        raise typer.Exit(1)


def _trial(run: str, firmware: Path | None, settings: list[Setting], trust: Trust) -> Trial:
    """Return the trial of a run folder or a scenario.

    Raises:
        UntrustedError: Code is named, and nobody has said that it may be executed.
        UsageError: A file is gone.
        ScenarioError: There is no such scenario, or it breaks the schema.
    """
    if firmware is not None and not firmware.is_file():
        raise UsageError(f"there is no firmware file {firmware}", hint="give an ELF, HEX or BIN file")
    if (Path(run) / TRACE_NAME).is_file():
        return trial_of_run(Path(run), firmware, trust=trust).set(*settings)
    if Path(run).is_dir():
        raise UsageError(f"{run} is no run folder: it has no {TRACE_NAME}", hint="p2os run makes one")
    return trial_of(run, firmware=firmware, settings=settings, trust=trust)


def _with_goal(trial: Trial, kind: str) -> Trial:
    """Return the trial with the goals of one kind alone.

    Raises:
        UsageError: It has none.
    """
    goals = [goal for goal in tables_of(trial.table, "goal") if goal["kind"] == kind]
    if not goals:
        raise UsageError(f"{trial.name} has no goal {kind!r}", hint="the kinds are those of its [[goal]] tables")
    return trial.with_lists(goal=goals)


def as_json(small: Shrunk, kept: Kept) -> dict[str, object]:
    """Return what came of it as one JSON object."""
    return {
        "failure": str(small.failure.way),
        "says": small.failure.says,
        "at_s": small.failure.at_ns / NS_PER_S,
        "things_before": small.things_before,
        "things_after": small.things_after,
        "trials": small.trials,
        "is_complete": small.is_complete,
        "is_confirmed": kept.is_confirmed,
        "trace_sha256": kept.outcome.sha256,
        "scenario": str(kept.scenario),
        "test": str(kept.test),
    }


def _print(small: Shrunk, kept: Kept) -> None:
    typer.echo(str(small.failure.way))
    typer.echo(f"  {small.failure.says}")
    things = f"{small.things_before} things that stand or happen, {small.things_after} needed"
    typer.echo(f"  {things}; {small.trials} runs{'' if small.is_complete else ', and the budget was spent'}")
    if kept.explained:
        typer.echo("")
        typer.echo(kept.explained)
    typer.echo("")
    trusts = bool(small.trial.trusted)
    typer.echo(f"again     p2os run {kept.scenario}{' --trust' if trusts else ''}")
    typer.echo(f"test      pytest {f'-o p2os_trust={kept.scenario.parent.absolute()} ' if trusts else ''}{kept.test}")
    typer.echo(f"picture   {kept.scenario.parent / 'scene.png'}")
    proof = "the same trace in another process" if kept.is_confirmed else "NOT the same in another process"
    typer.echo(f"proof     {proof}: {kept.outcome.sha256[:16]}")
