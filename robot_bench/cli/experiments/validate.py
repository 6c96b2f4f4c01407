"""`p2os validate`: the bench against what it claims, in every variant, as figures with bounds."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from p2os.cli.console import ReadableConsole
from p2os.cli.groups import BENCH
from p2os.cli.keyboard import has_keyboard
from p2os.cli.names import bodies, urls
from robot_bench.cli.progress import RunDisplay
from robot_bench.cli.run import ask, capped, drive_port
from robot_bench.cli.workers import Jobs, core_count, load_once, run_in_processes
from robot_bench.events.codec import Json
from robot_bench.experiments.validation.experiments import EXPERIMENTS, AtPort, Experiment
from robot_bench.experiments.validation.figures import LOOSE_BECAUSE, Figure, loose
from robot_bench.experiments.validation.page import render
from robot_bench.experiments.validation.trials import (
    PortRun,
    TrialResult,
    Variant,
    longest_s,
    port_runs,
    refuse,
    reported,
    run_port,
    run_trials,
    variants,
)
from robot_bench.recording.run_folder import used_folder
from robot_bench.run import RunResult
from robot_bench.scenario.included_files import Setting, read_setting
from robot_bench.scenario.options import MODES
from robot_bench.scenario.sweep import read_seeds
from simbase.command_line.program import EXIT_INTERRUPTED
from simbase.errors import UsageError, nearest
from simbase.files import writing

REPORT, FIGURES = "validation.html", "validation.json"
#: chosen: so many failures are shown one by one.
MOST_SHOWN = 20
HELP = """Validate the bench by experiments: motors, sensors, encoders.

Each EXPERIMENT has a hypothesis and figures with units and bounds; the report
shows each bound's formula. Without names all run: motors, codes, capped,
sensors, sensors-all, only-while-seen, encoders, sparse, slip, silence,
long-drive, dodge. Each runs with pins straight to the body, through the
adapter's model and through its firmware, with every installed body.

--set plants an error for a figure to detect.

Exit code: 0 every figure is within its bound, 1 one is not, 2 wrong usage, 130
interrupted.

\b
Examples:
  p2os validate                               all, some minutes
  p2os validate motors --body kinematic       one experiment, one body
  p2os validate motors --set threshold_m=0.4  a planted error
  p2os validate --port serial:/dev/ttyUSB0    a real Pioneer; asks first
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("validate", help=HELP, rich_help_panel=BENCH)(validate)


def experiments_named(incomplete: str) -> list[str]:
    """Return the experiments' names, for a shell."""
    return [name for name in EXPERIMENTS if name.startswith(incomplete)]


def validate(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Which; all without a name.", metavar="EXPERIMENT", autocompletion=experiments_named),
    ] = None,
    mode: Annotated[
        list[str] | None, typer.Option(help="Only this mode; again for more.", metavar="direct|adapter")
    ] = None,
    body: Annotated[
        list[str] | None,
        typer.Option(help="Only this body; again for more.", metavar="BODY", autocompletion=bodies),
    ] = None,
    seeds: Annotated[str | None, typer.Option(help='Of the drives, such as "0-9".', metavar="SEEDS")] = None,
    world: Annotated[
        list[str] | None, typer.Option(help="Of the drives; again for more.", metavar="WORLD|FILE")
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", help="Run it so, without expecting it.", metavar="KEY=VALUE"),
    ] = None,
    port: Annotated[
        str | None, typer.Option(help="Validate the robot at this URL.", metavar="URL", autocompletion=urls)
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Where the report goes.", metavar="DIR")] = None,
    jobs: Jobs = None,
    json_output: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="With --port: do not ask before the first motion.")] = False,
) -> None:
    """Validate the bench."""
    chosen = _chosen(names or (), mode or ())
    settings = [read_setting(text) for text in set_ or ()]
    for one in mode or ():
        if one not in MODES:
            raise UsageError(f"there is no mode {one!r}", hint=" or ".join(f"--mode {known}" for known in MODES))
    if port is not None and (mode or body or seeds or world or jobs):
        raise UsageError("a robot at a port has its own body and world", hint="leave out --mode, --body and the like")
    if yes and port is None:
        raise UsageError("--yes goes with --port only")
    if port is not None and all(isinstance(one.at_port, str) for one in chosen):
        able = ", ".join(one.name for one in EXPERIMENTS.values() if isinstance(one.at_port, AtPort))
        raise UsageError("a robot at a port can do none of these", hint=f"it can do {able}")
    chosen_variants = variants(mode or (), body or ())
    refuse(chosen, chosen_variants if port is None else [], settings, world or ())
    try:
        with used_folder(out, "validation") as folder:
            if port is None:
                results = _run_all(
                    chosen, chosen_variants, folder, settings, worlds=world or (),
                    seeds=None if seeds is None else read_seeds(seeds), jobs=jobs or core_count(),
                )  # fmt: skip
            else:
                results = _run_at_port(chosen, folder, settings, port, yes=yes)
    except KeyboardInterrupt as stop:
        typer.echo("interrupted: no report was made", err=True)
        raise typer.Exit(EXIT_INTERRUPTED) from stop
    _write(folder, results, set_ or ())
    if json_output:
        typer.echo(json.dumps(_plain(results), sort_keys=True))
    else:
        _print(results, folder)
    if not all(result.passed for result in results):
        raise typer.Exit(1)


def _chosen(names: Sequence[str], modes: Sequence[str]) -> list[Experiment]:
    """Return the experiments of these names; without names all that show something in the modes."""
    if names:
        return [_experiment(name) for name in dict.fromkeys(names)]
    return [one for one in EXPERIMENTS.values() if not one.modes or not modes or set(one.modes) & set(modes)]


def _experiment(name: str) -> Experiment:
    if name not in EXPERIMENTS:
        raise UsageError(f"there is no experiment {name!r}", hint=nearest(name, tuple(EXPERIMENTS)))
    return EXPERIMENTS[name]


def _run_all(
    chosen: Sequence[Experiment],
    chosen_variants: Sequence[Variant],
    folder: Path,
    settings: Sequence[Setting],
    *,
    worlds: Sequence[str],
    seeds: Sequence[int] | None,
    jobs: int,
) -> list[TrialResult]:
    first = chosen[0].load(settings)
    for body in dict.fromkeys(variant.body for variant in chosen_variants):
        load_once(first.with_options(body=body))
    with RunDisplay(is_shown=False) as display:
        console = ReadableConsole(stderr=True)
        with console.status("validating", spinner="line") as status:

            def done(count: int, whole: int) -> None:
                status.update(f"{count} of {whole} runs")

            def in_processes(
                job: Callable[[int, Callable[[], None]], Json], count: int, on_done: Callable[[int, Json], None]
            ) -> bool:
                return run_in_processes(
                    job, count, at_once=jobs, on_done=on_done, raise_if_interrupted=display.raise_if_interrupted
                )

            return run_trials(
                chosen, chosen_variants, folder, settings=settings, seeds=seeds, worlds=worlds,
                in_processes=in_processes, on_done=done,
            )  # fmt: skip


def _run_at_port(
    chosen: Sequence[Experiment], folder: Path, settings: Sequence[Setting], port: str, *, yes: bool
) -> list[TrialResult]:
    for one in chosen:
        if isinstance(one.at_port, str):
            typer.echo(f"not at a port: {one.name}: {one.at_port}", err=True)
    runs = port_runs(chosen, settings)
    typer.echo(
        f"about {longest_s(runs):.0f} s of driving; {'any key' if has_keyboard() else 'Ctrl-C'} stops the robot",
        err=True,
    )
    agreed: set[str] = set()

    def drive(run: PortRun, place: Path) -> RunResult:
        names = ", ".join(one.name for one in run.experiments)
        typer.echo(f"{names}: {run.scenario.description}\nthe robot needs {run.room}", err=True)
        if not yes and run.room not in agreed:
            ask(capped(run.scenario, None), port)
            agreed.add(run.room)
        return drive_port(run.scenario, place, port, yes=True, max_speed_mps=None)

    return run_port(runs, drive, folder, settings=settings)


def _write(folder: Path, results: Sequence[TrialResult], set_: Sequence[str]) -> None:
    words = " ".join(["p2os validate", *dict.fromkeys(result.experiment for result in results)])
    with writing(folder / REPORT):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / FIGURES).write_text(json.dumps(_plain(results), indent=1, sort_keys=True) + "\n", encoding="utf-8")
        (folder / REPORT).write_text(
            render(results, EXPERIMENTS, command=words, settings=set_), encoding="utf-8"
        )  # fmt: skip


def _plain(results: Sequence[TrialResult]) -> Json:
    return {
        "passed": all(result.passed for result in results),
        "loose_bounds": loose(one for result in results for one in result.findings),
        "results": [
            {
                "experiment": result.experiment, "variant": result.variant.name, "world": result.world,
                "seed": result.seed, "passed": result.passed, "failures": reported(result), "folder": result.folder,
                "trace_sha256": result.trace_sha256,
                "figures": [one.to_plain() for one in result.findings if isinstance(one, Figure)],
            }
            for result in results
        ],
    }  # fmt: skip


def _print(results: Sequence[TrialResult], folder: Path) -> None:
    console = ReadableConsole()
    chosen = list(dict.fromkeys(result.variant for result in results))
    table = Table(box=None, pad_edge=False)
    table.add_column("experiment")
    table.add_column("passed", justify="right")
    table.add_column("nearest to its bound")
    for name in dict.fromkeys(result.experiment for result in results):
        found = [result for result in results if result.experiment == name]
        figures = [one for result in found for one in result.findings if isinstance(one, Figure)]
        near = max(figures, key=lambda figure: figure.share, default=None)
        passed = sum(result.passed for result in found)
        colour = "green" if passed == len(found) else "red"
        shown = "" if near is None else f"{min(near.share, 999):.2f}  {near.what}"
        table.add_row(name, Text(f"{passed} of {len(found)}", colour), shown)
    console.print(table)
    lines = [f"{result.variant.name}: {line}" for result in results for line in reported(result)]
    for line in lines[:MOST_SHOWN]:
        console.print(Text.assemble(("failed", "red"), f"  {line}"), soft_wrap=True)
    if len(lines) > MOST_SHOWN:
        console.print(f"and {len(lines) - MOST_SHOWN} more, in the report")
    unexplained = [name for name in loose(one for r in results for one in r.findings) if name not in LOOSE_BECAUSE]
    if unexplained and not lines:
        console.print(f"note    half of these bounds would do for these runs: {', '.join(unexplained)}", soft_wrap=True)
    verdict = "passed" if not lines else "FAILED"
    console.print(f"{verdict} in {len(chosen)} variants; report: {folder / REPORT}", soft_wrap=True)
