"""Runs experiments in variants of the bench; experiments of one scenario share its run.

Invariant: what is found depends on experiments, variants and settings alone, not on how many run at a time.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

from p2os.pioneer.body.factory import installed_bodies
from robot_bench.bench import Bench
from robot_bench.events.codec import Json
from robot_bench.experiments.validation.experiments import AtPort, Experiment, ExperimentTrial
from robot_bench.experiments.validation.figures import Finding, Missing
from robot_bench.experiments.validation.nominal import Nominal
from robot_bench.experiments.validation.signals import driving_since
from robot_bench.recording.run_record import RunRecord, read_run
from robot_bench.report.make import Files
from robot_bench.run import RunResult, write_run
from robot_bench.scenario.goals.judging import Judgement
from robot_bench.scenario.included_files import Setting
from robot_bench.scenario.scenario import Scenario
from simbase.errors import UsageError
from simbase.timing import NS_PER_S


@dataclass(frozen=True, slots=True, order=True)
class Variant:
    """How the pins reach the robot, and what its body is."""

    mode: str
    #: `model` or `firmware`; of mode direct, which has no adapter, empty.
    core: str
    body: str

    @property
    def name(self) -> str:
        """Such as "adapter (firmware), bullet"."""
        return f"{self.mode}{f' ({self.core})' if self.core else ''}, {self.body}"


#: (job, how many, called with number and result) as `robot_bench.cli.workers.run_in_processes` takes them.
InProcesses = Callable[[Callable[[int, Callable[[], None]], Json], int, Callable[[int, Json], None]], bool]
#: The robot at a port.
PORT = Variant("port", "", "real")


def variants(modes: Sequence[str] = (), bodies: Sequence[str] = ()) -> list[Variant]:
    """Return all variants, or those of some modes and bodies; without names all bodies that are installed."""
    ways = (("direct", ""), ("adapter", "model"), ("adapter", "firmware"))
    return [
        Variant(mode, core, body)
        for body in bodies or installed_bodies()
        for mode, core in ways
        if not modes or mode in modes
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialResult:
    """What one experiment found in one variant, world and seed."""

    experiment: str
    variant: Variant
    world: str
    seed: int
    findings: tuple[Finding, ...]
    trace_sha256: str = ""
    #: The run's folder, where it was kept.
    folder: str = ""

    @property
    def failures(self) -> list[Finding]:
        """What is not within its bound, or was not recorded."""
        return [one for one in self.findings if isinstance(one, Missing) or not one.is_met]

    @property
    def passed(self) -> bool:
        """Whether every figure is within its bound."""
        return bool(self.findings) and not self.failures


@dataclass(frozen=True, slots=True)
class _Run:
    """One run, and the experiments that look at it."""

    experiments: tuple[Experiment, ...]
    variant: Variant
    world: str | None
    seed: int


def refuse(
    experiments: Sequence[Experiment],
    chosen: Sequence[Variant],
    settings: Sequence[Setting],
    worlds: Sequence[str] = (),
) -> None:
    """Refuse what cannot be run, before anything is.

    Raises:
        ScenarioError: A setting or a file cannot be.
        UsageError: There is no such body or world, or an experiment shows nothing in the modes.
    """
    for experiment in experiments:
        if chosen and experiment.modes and not {variant.mode for variant in chosen} & set(experiment.modes):
            hint = " or ".join(f"--mode {mode}" for mode in experiment.modes)
            raise UsageError(f"{experiment.name} shows nothing in mode {chosen[0].mode}", hint=hint)
        scenario = experiment.load(settings)
        for variant in chosen:
            for world in worlds if experiment.worlds else ():
                scenario.with_options(world=world)
            scenario.with_options(mode=variant.mode, body=variant.body)


def run_trials(
    experiments: Sequence[Experiment],
    chosen: Sequence[Variant],
    folder: Path,
    *,
    settings: Sequence[Setting] = (),
    seeds: Sequence[int] | None = None,
    worlds: Sequence[str] = (),
    in_processes: InProcesses,
    on_done: Callable[[int, int], None] = lambda _done, _all: None,
    files: Files = Files.REPORT,
) -> list[TrialResult]:
    """Run experiments in variants; runs that fail are kept as run folders.

    Args:
        experiments: What to claim.
        chosen: In which variants.
        folder: Where runs that fail go.
        settings: Set otherwise in what is run, and not in what is expected of it.
        seeds: In place of each experiment's own.
        worlds: In place of its own, where an experiment runs in several.
        in_processes: Does so many pieces of work, each in a process of its own; False where it was interrupted.
        on_done: Called with (runs done, runs in all).
        files: How much is made of runs that fail.

    Raises:
        KeyboardInterrupt: A signal came.
    """
    runs = list(_runs(experiments, chosen, seeds, worlds))
    found: dict[int, Json] = {}

    def done(number: int, result: Json) -> None:
        found[number] = result
        on_done(len(found), len(runs))

    def job(number: int, look: Callable[[], None]) -> Json:
        return {"results": _do(runs[number], settings, folder, look, files)}

    if not in_processes(job, len(runs), done):
        raise KeyboardInterrupt
    return [result for number, run in enumerate(runs) for result in _results(run, found[number])]


def _runs(
    experiments: Sequence[Experiment], chosen: Sequence[Variant], seeds: Sequence[int] | None, worlds: Sequence[str]
) -> Iterable[_Run]:
    """Return all runs, experiments of one scenario together."""
    groups: dict[object, list[Experiment]] = {}
    for one in experiments:
        groups.setdefault((one.scenario, one.settings, one.worlds, one.seeds, one.modes), []).append(one)
    for group in groups.values():
        for variant in (one for one in chosen if not group[0].modes or one.mode in group[0].modes):
            for world in (worlds or group[0].worlds) if group[0].worlds else (None,):
                for seed in group[0].seeds if seeds is None else seeds:
                    yield _Run(tuple(group), variant, world, seed)


def _in_variant(experiment: Experiment, run: _Run, settings: Sequence[Setting]) -> Scenario:
    variant = run.variant
    return experiment.load(settings).with_options(
        mode=variant.mode, adapter_core=variant.core or None, body=variant.body, world=run.world, seed=run.seed
    )


def _do(
    run: _Run, settings: Sequence[Setting], folder: Path, look: Callable[[], None], files: Files
) -> list[TrialResult]:  # fmt: skip
    """Run once and measure for each experiment; what cannot be run has no findings but that."""
    scenario = _in_variant(run.experiments[0], run, settings)
    bench = Bench.from_scenario(scenario)
    bench.on_slice = lambda _now: look()
    bench.run_until(scenario.duration_ns)
    record, judgement = bench.record(), bench.judge()
    results = []
    for experiment in run.experiments:
        expected = _in_variant(experiment, run, ())
        trial = ExperimentTrial(record=record, nominal=Nominal(expected), scenario=expected, judgement=judgement)
        results.append(_result(experiment, run, tuple(experiment.measure(trial)), bench.trace.sha256))
    failures = [text for result in results for text in told(result)]
    if failures:
        place = folder / "-".join(_word(part) for part in (results[0].experiment, run.variant.name, *_where(run)))
        write_run(bench, place, "; ".join(failures[:3]), files=files)
        results = [replace(result, folder=str(place)) for result in results]
    return results


def _where(run: _Run) -> tuple[str, ...]:
    return (run.world, f"seed{run.seed}") if run.world else ()


def _word(text: str) -> str:
    return "".join(char if char.isalnum() else "-" for char in text).replace("--", "-").strip("-")


def _result(experiment: Experiment, run: _Run, findings: tuple[Finding, ...], sha256: str = "") -> TrialResult:
    return TrialResult(
        experiment=experiment.name, variant=run.variant, world=run.world or "", seed=run.seed, findings=findings,
        trace_sha256=sha256,
    )  # fmt: skip


def _results(run: _Run, found: Json) -> list[TrialResult]:
    """Return what came of a run's process; where it failed, that for each of its experiments."""
    if "results" in found:
        return cast("list[TrialResult]", found["results"])
    why = "; ".join(cast("Sequence[str]", found["failures"]))
    return [_result(one, run, (Missing(group="pins", what="the run", why=why),)) for one in run.experiments]


def told(result: TrialResult) -> list[str]:
    """Return a line for each figure that fails."""
    lines = []
    for one in result.failures:
        if isinstance(one, Missing):
            lines.append(f"{result.experiment}: {one.what}: {one.why}")
        else:
            where = f" ({one.at})" if one.at else ""
            lines.append(
                f"{result.experiment}: {one.what}: {one.measured:.5g} {one.unit}".rstrip()
                + f", expected {one.expected:.5g} within {one.bound.value:.3g}{where}"
            )
    return lines


@dataclass(frozen=True, slots=True)
class PortRun:
    """One run at a port, the experiments that look at it, and what a person sees to before it."""

    experiments: tuple[Experiment, ...]
    scenario: Scenario
    room: str


def port_runs(experiments: Sequence[Experiment], settings: Sequence[Setting] = ()) -> list[PortRun]:
    """Return the runs that a robot at a port does; experiments of one scenario share one, others are left out.

    Raises:
        ScenarioError, UsageError: A setting cannot be.
    """
    groups: dict[str, list[Experiment]] = {}
    for one in experiments:
        if isinstance(one.at_port, AtPort):
            groups.setdefault(one.at_port.scenario or one.scenario, []).append(one)
    return [
        PortRun(tuple(group), group[0].load_at_port(settings), cast("AtPort", group[0].at_port).room)
        for group in groups.values()
    ]


def run_port(
    runs: Sequence[PortRun],
    drive: Callable[[PortRun, Path], RunResult],
    folder: Path,
    *,
    settings: Sequence[Setting] = (),
) -> list[TrialResult]:
    """Run what a robot at a port can do, in real time, one after the other.

    Args:
        runs: As `port_runs` returns them.
        drive: Runs one into a folder, with the robot stopped when it returns.
        folder: Each run goes into a folder below it.
        settings: As of `port_runs`; of them the robot alone is expected.

    Raises:
        KeyboardInterrupt: A signal came.
        P2osError: The line cannot be opened, or a folder is not free.
    """
    results: list[TrialResult] = []
    robot = [setting for setting in settings if setting[0] == "robot"]
    for run in runs:
        place = folder / run.experiments[0].name
        ran = drive(run, place)
        if ran.was_interrupted:
            raise KeyboardInterrupt
        record = read_run(place)
        judgement = Judgement(
            cast("list[str]", ran.outcome["goals_met"]), cast("list[str]", ran.outcome["failures"]),
            cast("list[str]", ran.outcome.get("goals_not_judged") or []),
        )  # fmt: skip
        for experiment in run.experiments:
            expected = experiment.load_at_port(robot)
            trial = ExperimentTrial(
                record=record, nominal=Nominal(expected, at_port=True), scenario=expected, judgement=judgement
            )
            found = tuple(experiment.measure_at_port(trial))
            if why := _cut_short(record, run, judgement):
                found = (Missing(group="pins", what="the run", why=why),)
            one = _Run((experiment,), PORT, None, 0)
            results.append(replace(_result(experiment, one, found), folder=str(place)))
    return results


def _cut_short(record: RunRecord, run: PortRun, judgement: Judgement) -> str:
    """Return why a run at a port shows nothing; empty where it does."""
    if record.last_ns < run.scenario.duration_ns - NS_PER_S:
        return judgement.missed[0] if judgement.missed else "it was cut short"
    if driving_since(record) is None:
        return "the robot opened no session, or its odometry never came"
    return ""


def longest_s(runs: Sequence[PortRun]) -> float:
    """Return how long runs at a port take, seconds."""
    return sum(run.scenario.duration_ns for run in runs) / NS_PER_S
