"""What experiments measure of runs made by hand, and which runs they ask for, at random."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any
from unittest import mock

from p2os.view.header import PageHeader
from robot_bench.events.kinds import Contact, Note
from robot_bench.experiments.validation import encoders, experiments, page, sensors, trials
from robot_bench.experiments.validation.encoders import (
    count_figures,
    encoder_figures,
    slip_figures,
    sparse_figures,
    wrap_figure,
)
from robot_bench.experiments.validation.experiments import ExperimentTrial
from robot_bench.experiments.validation.figures import (
    Figure,
    FigureTolerance,
    Finding,
    Missing,
    loose,
    shown_value,
    worst,
)
from robot_bench.experiments.validation.motors import motor_figures
from robot_bench.experiments.validation.sensors import only_while_seen_figures, reading_figures, sensor_figures
from robot_bench.experiments.validation.silence import silence_figures
from robot_bench.experiments.validation.trials import TrialResult
from robot_bench.scenario.goals.judging import Judgement
from robot_bench.scenario.scenario import Scenario
from simbase.timing import NS_PER_S
from tests.robot_bench.experiments.validation.test_validation_findings import MODES, MadeRun, nominal_of
from tests.robot_bench.recording.records import pose
from tests.tools.suite.approved import Trace, judge_of, said, tried
from tests.tools.suite.declared import declared_of

FIGURES = (("wire", "packets"), ("pins", "watchdog"), ("motion", "way"), ("pins", "rounding of VEL, at a port"),
           ("motion", "time to stop"), ("wire", "rate"))  # fmt: skip


def measures_of(
    trial: ExperimentTrial, wanted: Sequence[tuple[tuple[int, int], float]], gates: Scenario
) -> Sequence[Callable[[], Sequence[Finding]]]:
    """Return all that can be measured of a run."""
    record, nominal, scenario = trial.record, trial.nominal, trial.scenario
    family = scenario.controller.family_of(scenario.parameters)
    return (
        lambda: motor_figures(record, nominal, wanted), lambda: encoder_figures(record, nominal),
        lambda: count_figures(record), lambda: sparse_figures(record, nominal),
        lambda: slip_figures(record, nominal, "kinematic"), lambda: slip_figures(record, nominal, "bullet"),
        lambda: [wrap_figure(record, family)], lambda: sensor_figures(record, nominal, gates),
        lambda: reading_figures(record, scenario), lambda: only_while_seen_figures(record, nominal),
        lambda: silence_figures(record, nominal), lambda: experiments.drive_figures(trial),
        lambda: experiments._drive_at_port(trial), lambda: experiments._long_drive(trial),
    )  # fmt: skip


def measured(measure: Callable[[], Sequence[Finding]]) -> Iterator[str]:
    try:
        for one in measure():
            yield said(one)
            if isinstance(one, Figure):
                yield said([one.difference, one.share, one.is_met])
    except (ValueError, LookupError, ZeroDivisionError) as error:
        yield type(error).__name__


def validations(draw: Random) -> Iterator[str]:
    """Measure runs made by hand whose speeds, ramps, pins and packets are more or less off, in each mode."""
    for number in range(12):
        mode = MODES[number % 3]
        nominal, scenario = nominal_of(mode)
        legs = [((draw.randrange(-4, 4), draw.randrange(-4, 4)), draw.choice((0.2, 1.0, 2.0))) for _ in range(3)]
        seen = []
        for wire in draw.sample(range(1, 9), 3):
            begin = draw.choice((0.5, 3.2, 3.5, 4.0))
            seen.append((f"DD{wire}", begin, begin + draw.choice((0.01, 0.4, 1.0, 9.0))))
        readings = sorted((draw.uniform(0.5, 5.0), draw.randrange(10), draw.choice((200, 3000))) for _ in range(9))
        fault = draw.choice((None, (1.5, 3.5)))
        record = MadeRun(nominal=nominal, legs=legs, late_s=draw.choice((0.0, 0.06, 0.3)), rest_s=2.0, fault=fault,
                         fast=draw.choice((1.0, 1.01, 1.2)), steep=draw.choice((1.0, 1.3)), seen=seen,
                         readings=readings).record()  # fmt: skip
        record.events[:0] = [
            Note(t=100, who=who, what=what) for who, what in (("body", "driving"), ("adapter", "lost"))
        ] * draw.choice((0, 1))
        record.contacts = [Contact(t=NS_PER_S, what="'box'", x_m=1.0, y_m=0.5, part="")] * draw.choice((0, 2))
        record = draw.choice((record, record, replace(record, events=[]), replace(record, poses=record.poses[:9])))
        gates = nominal_of("adapter", "sensors")[1] if number < 4 else scenario
        wanted = [*legs, (legs[0][0], 0.1)] if draw.random() < 0.3 else legs
        judgement = Judgement(["a"] * draw.randrange(3), ["b: x"] * draw.randrange(2), [])
        trial = ExperimentTrial(record=record, nominal=nominal, scenario=scenario, judgement=judgement)
        for measure in measures_of(trial, wanted, gates):
            yield from measured(measure)


def gates_seen(draw: Random) -> Iterator[str]:
    """Measure when distance pins rise and fall for things that a scenario places: in time, at the bounds, beyond."""
    gates = nominal_of("adapter", "sensors")[1]
    windows = sensors.things_before(gates)
    yield said(windows)
    for number in range(24):
        seen = []
        for wire, spans in windows.items():
            for begin, end in spans if draw.random() < 0.9 else ():
                since = begin + draw.choice((0, 0, 1, 60_000_000, end - begin, -1, end - begin + 1))
                until = end + draw.choice((0, 1, 60_000_000, 400_000_000))
                if until > since:
                    seen.append((f"DD{wire}", since / NS_PER_S, until / NS_PER_S))
        if draw.random() < 0.4:
            seen.append((f"DD{draw.randint(1, 8)}", *draw.choice(((1.0, 2.0), (5.0, 5.5), (36.0, 37.0)))))
        nominal, scenario = nominal_of(MODES[number % 3])
        record = MadeRun(nominal=nominal, legs=[((1, 1), 0.2)], seen=seen, rest_s=0.2).record()
        for found in sensor_figures(record, nominal, gates if number else scenario):
            yield said(found)


def trials_asked(draw: Random) -> Iterator[str]:
    """Choose experiments, variants, worlds and seeds, and say what their runs came to."""
    for name, one in experiments.EXPERIMENTS.items():
        at_port = one.at_port if isinstance(one.at_port, str) else [one.at_port.room, one.at_port.scenario]
        yield said([name, one.hypothesis, one.procedure, one.scenario, one.worlds, one.seeds, one.settings, one.modes,
                    at_port])  # fmt: skip
        for load in (one.load, one.load_at_port):
            yield tried(
                lambda load=load: said([(found := load()).name, found.mode, found.duration_ns, len(found.goals)])
            )
    every = list(experiments.EXPERIMENTS.values())
    for _ in range(12):
        modes = draw.sample(("direct", "adapter", "port"), draw.randrange(3))
        chosen = trials.variants(modes, draw.choice((["kinematic"], ["kinematic", "bullet"])))
        yield said([modes, chosen, [variant.name for variant in chosen]])
        some = draw.sample(every, 3)
        seeds, worlds = draw.choice((None, [], [3, 4])), draw.choice(((), ("room",), ("none",)))
        yield tried(trials.refuse, some, chosen, draw.choice(((), [("threshold_m", 0.5)], [("none", 1)])), worlds)
        runs = list(trials._runs(some, chosen, seeds, worlds))
        for run in runs[:9]:
            yield said(
                [[one.name for one in run.experiments], run.variant.name, run.world, run.seed, trials._where(run)]
            )
        if not runs:
            continue
        bound = FigureTolerance(name="b", value=draw.choice((0.0, 0.5)), formula="f")
        found = tuple(
            Figure(group="pins", what="w", expected=1.0, measured=draw.choice((1.0, 1.5, 2.25)), uncertainty=0.1,
                   unit=draw.choice(("", "s")), bound=bound, at=draw.choice(("", "here")))
            for _ in range(draw.randrange(3))
        ) + (Missing(group="wire", what="m", why="y"),) * draw.randrange(2)  # fmt: skip
        for result in trials._results(runs[0], draw.choice(({"failures": ["a", "b"]}, {"results": [
            trials._result(some[0], runs[0], found, "sha")]}))):  # fmt: skip
            yield said([result, result.passed, result.failures, trials.reported(result)])
        ports = trials.port_runs(some)
        rooms = [([one.name for one in port.experiments], port.room) for port in ports]
        yield said([rooms, trials.longest_s(ports)])
        yield said([trials._word(text) for text in ("a b", "a (b), c", "--", "x1")])
        yield said([shown_value(1234567.0, "s"), shown_value(0.00001234, ""), loose([*found])])
        yield tried(lambda found=found: said(worst([one for one in found if isinstance(one, Figure)])))


def result_of(draw: Random, name: str, variant: trials.Variant, world: str, seed: int) -> trials.TrialResult:
    """Return what an experiment found: figures well within their bounds, at them and beyond, or none at all."""
    found = list[Finding]()
    for group, what in draw.sample(FIGURES, draw.choice((0, 2, 3, 4))):
        if draw.random() < 0.15:
            found.append(Missing(group=group, what=what, why="it was not recorded"))
            continue
        bound = FigureTolerance(name=what, value=draw.choice((0.5, 2.0)), formula=f"{what} / 2")
        found.append(Figure(
            group=group, what=what, expected=draw.choice((0.0, 1.0, -123.456)), unit=draw.choice(("", "s", "mm/s")),
            measured=draw.choice((0.0, 1.0, 1.25, 1.5, -123.2)), uncertainty=draw.choice((0.0, 0.0123)), bound=bound,
            at=draw.choice(("", "DD3 at 2 s")),
        ))  # fmt: skip
    return trials.TrialResult(experiment=name, variant=variant, world=world, seed=seed, findings=tuple(found))


def pages(draw: Random) -> Iterator[str]:
    """Show validations of several experiments, variants, worlds and seeds on a page."""
    names, chosen = draw.sample(sorted(experiments.EXPERIMENTS), 4), trials.variants(bodies=["kinematic", "bullet"])
    seen = list[PageHeader]()
    with mock.patch.object(page, "document", lambda header: seen.append(header) or "the page"):
        for number in range(14):
            some = draw.sample(names, draw.randint(1, 3))
            cells = [(name, variant) for name in some for variant in chosen if draw.random() < 0.6]
            where = [("", 0)] if number % 2 else [("room", 0), ("room", 3), ("arena", 0)]
            results = [result_of(draw, *cell, *place) for cell in cells for place in where if draw.random() < 0.8]
            if number > 10:
                results = [one for one in results if one.passed]
            made = page.render(results, experiments.EXPERIMENTS, command=f"p2os validate {number}",
                               settings=draw.choice(((), ["a=1"], ["a=1", "b=2"])))  # fmt: skip
            header = seen.pop()
            yield said([made, header.title, header.verdict, header.standing, header.lead, header.footer])
            for section in header.sections:
                yield f"{section.title} {section.note} {said(section.blocks)}"


def carried_out(draw: Random) -> Iterator[str]:
    """Carry out validations whose runs are made up: side by side, interrupted, failed, and at a port."""
    every, asked = list(experiments.EXPERIMENTS.values()), list[object]()
    bound = FigureTolerance(name="b", value=0.5, formula="f")

    def do(run: Any, settings: object, folder: Path, look: Callable[[], None], files: object) -> list[TrialResult]:
        look()
        asked.append([[one.name for one in run.experiments], run.variant.name, run.world, run.seed, settings, folder])
        figure = Figure(group="pins", what="w", expected=1.0, measured=1.25, uncertainty=0, unit="", bound=bound)
        return [trials._result(one, run, (figure,), "sha") for one in run.experiments]

    def in_processes(job: Any, count: int, done: Any) -> bool:
        for number in draw.sample(range(count), count):
            done(number, {"failures": ["killed", "again"]} if draw.random() < 0.2 else job(number, lambda: None))
        return draw.random() < 0.8

    with mock.patch.object(trials, "_do", do):
        for _ in range(8):
            counts = list[tuple[int, int]]()
            chosen = trials.variants(draw.choice((("direct",), ("adapter",), ())), ["kinematic"])
            seeds, worlds = draw.choice((None, [1, 2])), draw.choice(((), ("room", "arena")))
            try:
                found: object = trials.run_trials(
                    draw.sample(every, 3), chosen, Path("v"), settings=[("a", 1)], seeds=seeds, worlds=worlds,
                    in_processes=in_processes, on_done=lambda *one, counts=counts: counts.append(one),
                )  # fmt: skip
            except KeyboardInterrupt:
                found = "interrupted"
            yield said([found, counts, asked])
            asked.clear()
    at_port = [one for one in every if isinstance(one.at_port, experiments.AtPort)]
    for number in range(10):
        some = draw.sample(at_port, min(2, len(at_port)))
        runs = trials.port_runs(some)
        nominal, _ = nominal_of("port")
        record = MadeRun(nominal=nominal, legs=[((2, 2), 1.0), ((-1, 1), 1.0)], rest_s=2.0).record()
        longest = max(run.scenario.duration_ns for run in runs)
        record.last_ns = longest - draw.choice((0, NS_PER_S, NS_PER_S + 1, 9 * NS_PER_S))
        if number % 3 == 0:
            record = replace(record, events=[], wire=[])
        outcome = {"goals_met": ["a"], "failures": draw.choice(([], ["b: it stood"]))}
        was_interrupted = number == 9

        def drive(run: trials.PortRun, place: Path, is_cut: bool = was_interrupted, kept: object = outcome) -> Any:
            asked.append([[one.name for one in run.experiments], str(place)])
            return SimpleNamespace(was_interrupted=is_cut, outcome=kept)

        with mock.patch.object(trials, "read_run", lambda _place, record=record: record):
            try:
                results = trials.run_port(runs, drive, Path("at"), settings=[("robot", "p3dx"), ("threshold_m", 0.5)])
            except KeyboardInterrupt:
                yield "interrupted"
                continue
            yield said([asked, *((one.experiment, one.variant, one.folder, one.findings) for one in results)])
            asked.clear()


def half_turns(_draw: Random) -> Iterator[str]:
    """Tell which wheels turn more than half a turn between two samples of their angles, and which way round."""
    turn = round(math.tau * 10**6)
    for left, right in ((0.4, 0.4), (0.6, 0.4), (0.4, -0.6), (-0.6, 0.6), (0.5, -0.5), (1.2, -1.2)):
        for period_s in (0.05, 0.1):
            poses = [pose(50_000_000 * n, la=round(n * left * turn), ra=round(n * right * turn))
                     for n in range(6)]  # fmt: skip
            record: Any = SimpleNamespace(poses=poses)
            nominal: Any = SimpleNamespace(encoder_period_s=period_s)
            for start in (0, 50_000_000, 200_000_001):
                yield said([left, right, period_s, start, sorted(encoders._ambiguous(record, nominal, start))])
    steps = encoders.ENCODER_STEPS
    yield said([encoders._within_turn(part * steps) for part in (0.0, 0.25, 0.49, 0.5, 0.51, 1.0, 3.75, -0.5, -0.75)])


TRACES: dict[str, Trace] = {
    "half turns": half_turns,
    "validations": validations, "trials": trials_asked, "gates": gates_seen, "pages": pages,
    "carried out": carried_out, "declared": declared_of("robot_bench.experiments.validation"),
}  # fmt: skip
test_what_validations_come_to_is_what_was_approved = judge_of(__file__, TRACES)
