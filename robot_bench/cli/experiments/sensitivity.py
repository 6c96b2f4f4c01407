"""`p2os sensitivity`: on which parameters a scenario's outcome depends, by many runs of it."""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from p2os.cli.groups import BENCH
from p2os.cli.names import bodies, body_help
from p2os.cli.quantities import option
from p2os.cli.trust import Trusted, said
from robot_bench.cli.names import scenario_names
from robot_bench.cli.progress import RunDisplay
from robot_bench.cli.workers import Jobs, core_count, load_once, run_in_processes
from robot_bench.events.codec import Json
from robot_bench.experiments import require
from robot_bench.scenario.included_files import Setting, as_toml, read_setting
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.sweep import read_seeds
from simbase.errors import P2osError, UsageError
from simbase.timing import NS_PER_S, Nanos
from simbase.units import COUNT, SEED, TIME

if TYPE_CHECKING:  # NumPy is loaded when the verb runs
    from robot_bench.experiments.sensitivity import ParameterEffect, Point, SampleDesign

HELP = """Measure which parameters decide a scenario's outcome.

Each KEY of `p2os run --set` varies from LOW to HIGH: one at a time with the
others in the middle, in Morris' trajectories through all of them, and with
--samples for Sobol's indices. The outcome is every goal's margin, or what
--outcome names.

\b
Examples:
  p2os sensitivity dodge --vary threshold_m=0.4..1.0 --outcome clearance_m
  p2os sensitivity patrol.toml --vary start.x_m=0.5..1.5 --picture s.png
  p2os sensitivity dodge --vary threshold_m=0.4..1 --steps 0 --samples 64
"""
OUTCOMES = "path_m, mean_mps, clearance_m, energy_j, …, or such as 'goal 2 clearance'"


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("sensitivity", help=HELP, rich_help_panel=BENCH)(sensitivity)


def sensitivity(
    scenario: Annotated[
        str,
        typer.Argument(help="A scenario that ships, or a file.", metavar="SCENARIO", autocompletion=scenario_names),
    ],
    vary: Annotated[
        list[str] | None, typer.Option("--vary", help="A parameter and its range.", metavar="KEY=LOW..HIGH")
    ] = None,
    outcome: Annotated[
        list[str] | None, typer.Option("--outcome", help=f"What to look at: {OUTCOMES}.", metavar="NAME")
    ] = None,
    steps: Annotated[int, option(COUNT, "--steps", purpose="Values of each, one at a time.", shown="5")] = 5,
    trajectories: Annotated[
        int, option(COUNT, "--trajectories", purpose="Of Morris' method; 0: none.", shown="10")
    ] = 10,
    samples: Annotated[
        int, option(COUNT, "--samples", purpose="Of Sobol's method, a power of two.", shown="0")
    ] = 0,
    seed: Annotated[int, option(SEED, "--seed", purpose="Of trajectories and samples.", least="0", shown="0")] = 0,
    seeds: Annotated[
        str, typer.Option("--seeds", help="Of each point's runs, whose mean counts: 0-4.", metavar="SEEDS")
    ] = "",
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="Set a key of the scenario.", metavar="KEY=VALUE")
    ] = None,
    body: Annotated[
        str, typer.Option(help=body_help(), metavar="BODY", autocompletion=bodies,
                          show_default=False)
    ] = "",
    duration: Annotated[
        Nanos | None, option(TIME, "--duration", purpose="How much virtual time.", above_zero=True)
    ] = None,
    jobs: Jobs = None,
    trust: Trusted = False,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    picture: Annotated[Path | None, typer.Option("--picture", help="Draw the effects, PNG.", metavar="FILE")] = None,
) -> None:  # fmt: skip
    """Vary a scenario."""
    require("SALib", *(["matplotlib"] if picture else []))
    from robot_bench.experiments.sensitivity import SampleDesign, outcome_names, outcomes_of, read_range

    if not vary:
        raise UsageError("which parameters?", hint="--vary threshold_m=0.4..1.0")
    ranges = tuple(read_range(text) for text in vary)
    if len({one.key for one in ranges}) < len(ranges):
        raise UsageError("a key is varied twice")
    if steps < 2 and trajectories < 1 and samples < 1:
        raise UsageError("nothing is to be run", hint="--steps 5, --trajectories 10 or --samples 64")
    design = SampleDesign(ranges=ranges, steps=steps, trajectories=trajectories, seed=seed, samples=samples)
    fixed = [read_setting(text) for text in setting or []]

    def made(settings: Sequence[Setting], own_seed: int | None) -> Scenario:
        found = load_scenario(scenario, settings=[*fixed, *settings], set_by="--vary", trust=said(trust))
        options: Json = {"body": body or None, "seed": own_seed, "duration_s": duration and duration / NS_PER_S}
        return found.with_options(**{key: value for key, value in options.items() if value is not None})  # type: ignore[arg-type]  # as ScenarioOptions has them

    points = design.points()
    own_seeds: list[int | None] = list(read_seeds(seeds)) if seeds else [None]
    for share in (0.0, 1.0):  # a value that cannot be is told before the first run
        made(design.settings(tuple(one.at(share) for one in ranges)), None)
    runs = [(point, own_seed) for point in points for own_seed in own_seeds]

    def job(number: int, look: Callable[[], None]) -> Json:
        point, own_seed = runs[number]
        return {"outcomes": outcomes_of(made(design.settings(point), own_seed), lambda _now: look())}

    load_once(made((), None))
    found = _run(job, len(runs), jobs or core_count())
    names = outcome_names(found, outcome or [])
    values = _means(runs, found, names)
    effects = {name: sorted(design.effects(values[name].__getitem__), key=lambda one: -one.size) for name in names}
    if picture:
        _draw(scenario, effects, picture)
    if json_output:
        plain = {name: [one.as_plain() for one in rows] for name, rows in effects.items()}
        typer.echo(json.dumps({"scenario": scenario, "runs": len(runs), "effects": plain}, indent=2))
    else:
        sys.stdout.writelines(f"{line}\n" for line in _lines(scenario, design, effects, len(runs)))


def _run(job: Callable[[int, Callable[[], None]], Json], count: int, at_once: int) -> list[dict[str, float]]:
    """Return the outcomes of all runs, in their order.

    Raises:
        P2osError: A run did not come to its end.
        KeyboardInterrupt: A signal has come.
    """
    found: list[Json] = [{} for _ in range(count)]

    def keep(number: int, one: Json) -> None:
        found[number] = one

    with RunDisplay(is_shown=False) as display:
        is_whole = run_in_processes(
            job, count, at_once=at_once, on_done=keep, raise_if_interrupted=display.raise_if_interrupted
        )
    if not is_whole:
        raise KeyboardInterrupt
    outcomes: list[dict[str, float]] = []
    for one in found:
        if "outcomes" not in one:
            failures = one.get("failures")
            raise P2osError(f"a run failed: {failures[0] if isinstance(failures, list) and failures else 'no outcome'}")
        outcomes.append(one["outcomes"])  # type: ignore[arg-type]  # as the job has sent it
    return outcomes


def _means(
    runs: "Sequence[tuple[Point, int | None]]", found: Sequence[dict[str, float]], names: Sequence[str]
) -> "dict[str, dict[Point, float]]":
    """Return of each outcome its mean over the seeds, at each point."""
    sums: dict[str, dict[Point, list[float]]] = {name: {} for name in names}
    for (point, _), one in zip(runs, found, strict=True):
        for name in names:
            sums[name].setdefault(point, []).append(one[name])
    return {name: {point: sum(row) / len(row) for point, row in of.items()} for name, of in sums.items()}


def _draw(scenario: str, effects: "dict[str, list[ParameterEffect]]", picture: Path) -> None:
    from robot_bench.experiments.pictures import effects_figure, write_png

    write_png(effects_figure(f"{scenario}: effect over each whole range", effects), picture)


def _lines(
    scenario: str, design: "SampleDesign", effects: "dict[str, list[ParameterEffect]]", runs: int
) -> Iterator[str]:
    """Yield what a person reads."""
    yield f"{scenario}: {runs} runs, {len(design.ranges)} parameters"
    for name, rows in effects.items():
        yield ""
        yield f"{name:34}{'alone':>10}{'mu*':>10}{'+-':>9}{'sigma':>10}"
        for one in rows:
            yield _row(one.key, one.spread, one.mu_star, one.mu_star_conf, one.sigma)
        if design.samples:
            yield f"{'  of its variance':34}{'S1':>10}{'+-':>10}{'ST':>9}{'+-':>10}"
            for one in rows:
                yield _row(one.key, one.S1, one.S1_conf, one.ST, one.ST_conf)
    yield ""
    for varied in design.ranges:
        yield f"{varied.key} from {as_toml(varied.low)} to {as_toml(varied.high)}"
    yield "alone: greatest difference, the others in the middle; mu*: mean size over all"
    yield "trajectories with half of its 95 % interval; sigma: where it depends on others"
    if design.samples:
        yield "S1: share of the variance by itself; ST: with all that it does with others"


def _row(key: str, *figures: float | None) -> str:
    cells = [f"{'' if value is None else f'{value:.3g}':>{width}}" for value, width in
             zip(figures, (10, 10, 9, 10), strict=True)]  # fmt: skip
    return f"  {key[:31]:32}{''.join(cells)}".rstrip()
