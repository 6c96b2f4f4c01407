"""How the bench's verbs print and write what came of runs, sweeps, studies and validations."""

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any
from unittest import mock

from bluepill_sim.board import BluePill
from p2os.cli.main import run as p2os
from robot_bench.campaign.variants.mutation.suite import Suite, SuiteRun
from robot_bench.campaign.variants.mutation.trial import Fate, MutantResult
from robot_bench.cli import board, sweep, table
from robot_bench.cli import run as run_verb
from robot_bench.cli.campaigns import mutate, shrink
from robot_bench.cli.experiments import fit, sensitivity, validate
from robot_bench.experiments.fitting.least_squares import Estimate, Fit
from robot_bench.experiments.fitting.umbmark import Correction
from robot_bench.experiments.sensitivity import ParameterEffect, SampleDesign, read_range
from robot_bench.experiments.validation.figures import Figure, FigureTolerance, Missing
from robot_bench.experiments.validation.trials import TrialResult, Variant
from robot_bench.recording.run_folder import used_folder
from robot_bench.recording.summary import INTERRUPTED
from robot_bench.run import RunResult
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from robot_bench.wires.board_test.verdicts import BoardVerdict, VerdictRow
from simbase.errors import FileError
from tests.robot_bench.cli.walks.printed import in_folder, printed, result_of
from tests.tools.suite.approved import judge_of, rounded, said, tried


def tables(draw: Random) -> Iterator[str]:
    """Print results of runs of all kinds."""
    hits = [
        {"what": f"'post {n}'", "t_s": n * 1.5, "x_m": 0.1 * n, "y_m": -0.2 * n, "part": "front" * (n % 2)}
        for n in range(7)
    ]
    robot: dict[str, object] = {"distance_m": 1.0, "min_clearance_m": None, "trace_sha256": "abcdefghijk"}
    cases: list[dict[str, object]] = [
        {},
        {"passed": False, "failures": ["no_collision: it hit 'post 0' at 0.000 s, x 0.00 m, y -0.00 m"], "hits": hits},
        {"passed": False, "failures": ["interrupted (SIGINT)", "other"], "interrupted": True},
        {"hits": hits[:1]},
        {"hits": hits[:5], "notes": ["n1", "n2"], "explained": "because"},
        {"goals_met": list("abcdefghi")},
        {"goals_met": [], "goals_not_judged": list("abcdefg"), "last_blocks": ["a.c:1", "b.c:2"]},
        {"coverage": {"lines_hit": 3, "lines": 4, "branch_ways_hit": 0, "branch_ways": 0}, "usart_lines": 1},
        {"coverage": {"lines_hit": 3, "lines": 4, "branch_ways_hit": 1, "branch_ways": 6}, "usart_lines": 0},
        {
            "robots": {"one": robot, "two": robot | {"min_clearance_m": 0.5, "trace_sha256": None}},
            "mode": "several robots",
        },
        dict.fromkeys(
            (
                "virtual_s",
                "real_time_factor",
                "distance_m",
                "collisions",
                "min_clearance_m",
                "usart_baud",
                "trace_sha256",
            )
        ),
    ]
    for case in cases:
        yield said(case)
        yield from printed(table.print_result, result_of(**case))
        yield from printed(run_verb.end_with, result_of(**case), json_output=draw.random() < 0.5)


def studies(draw: Random) -> Iterator[str]:
    """Print fits, squares, effects, validations, walks of boards, and small failures."""
    estimates = {
        name: Estimate(name=name, value=0.0123456 * (n + 1), low=0.01 * n, high=0.02 * (n + 1))
        for n, name in enumerate(fit.SHOWN)
    }
    ours = Fit(estimates=estimates, unseen={"track_mm": "it never turns"}, residual=0.001234, count=77)
    found: dict[str, Fit | FileError] = {
        "wheels": ours,
        "ramps": replace(ours, estimates={}),
        "sonar": FileError("none", hint="some"),
        "other": FileError("nothing"),
    }
    yield from map(rounded, fit._lines(found))
    yield said([fit._plain(one) for one in found.values()])
    meta: tuple[dict[str, object], ...] = ({}, {"world": "room"}, {"world": {"name": "arena"}}, {"world": {}})
    for where in meta:
        yield fit._world_of(SimpleNamespace(meta=where))  # type: ignore[arg-type]  # as far as it is looked at
    ways = [
        Correction(e_d=1.01, e_b=0.98, e_max_m=0.0321, largest_m=0.04),
        Correction(e_d=1.0, e_b=1.0, e_max_m=0.001, largest_m=0.0021),
    ]
    squares = SimpleNamespace(
        squares=[SimpleNamespace(name=f"square {n}", is_clockwise=n == 1) for n in range(2)],
        before=ways[0],
        formulas=ways[1],
        least_squares=ways[1],
        errors=lambda _way: [(0.01, -0.02), (-0.3, 0.4)],
        fit=ours,
    )
    yield from fit._umbmark_lines(squares)  # type: ignore[arg-type]  # as above
    effects = [
        ParameterEffect(
            key="a.long.key.that.does.not.fit.into.its.column",
            alone=(1.0, 3.0),
            mu=1.0,
            mu_star=2.0,
            mu_star_conf=0.1,
            sigma=0.5,
            S1=0.1,
            S1_conf=0.01,
            ST=0.2,
            ST_conf=0.02,
        ),
        ParameterEffect(key="b", alone=(), mu=None, mu_star=None, mu_star_conf=None, sigma=None),
    ]
    for samples in (0, 4):
        design = SampleDesign(
            ranges=(read_range("a=0..1"), read_range("b=2..5")), steps=2, trajectories=1, seed=0, samples=samples
        )
        yield from sensitivity._lines("mine", design, {"path_m": effects}, 12)
    points: list[Any] = [((0, 1), 1), ((0, 1), 2), ((1, 1), 1), ((1, 1), 2)]
    yield said(sensitivity._means(points, [{"m": 1.0}, {"m": 2.0}, {"m": 5.0}, {"m": 9.0}], ["m"]))

    def figure(measured: float, bound: float) -> Figure:
        tolerance = FigureTolerance(name="step", value=bound, formula="1 / 2")
        return Figure(
            group="g",
            what=f"speed {measured}",
            expected=1.0,
            measured=measured,
            uncertainty=0.01,
            unit="m/s",
            bound=tolerance,
        )

    missing = Missing(group="g", what="echo", why="none came")
    variants = [Variant("direct", "", "kinematic"), Variant("adapter", "model", "bullet")]
    lists_of: tuple[tuple[tuple[Figure | Missing, ...], ...], ...] = (
        ((figure(1.0, 0.5),),),
        ((figure(1.3, 0.4), figure(1.1, 1.0)), (missing,), ()),
        ((figure(2.0, 0.0),),) * 25,
        ((figure(1.499, 0.5),), (figure(1.4, 0.5),)),
    )
    for lists in lists_of:
        results = [
            TrialResult(experiment=f"e{n % 2}", variant=variants[n % 2], world="room", seed=n, findings=findings)
            for n, findings in enumerate(lists)
        ]
        yield from printed(validate._print, results, Path("v"))
        yield said(validate._plain(results))
    with in_folder():
        yield from printed(validate._write, Path("out"), results, ["a=1"])
        yield said(sorted(path.name for path in Path("out").iterdir()))
        with contextlib.suppress(KeyError), used_folder(None, "validation") as folder:
            raise KeyError(said(folder))
        yield said([folder, folder.exists()])
    yield said(validate.experiments_named("s"))
    for chosen, modes in (((), ()), ((), ("direct",)), ((), ("adapter",)), (("slip", "motors", "slip"), ())):
        yield said([one.name for one in validate._chosen(chosen, modes)])
    rows = [
        VerdictRow(name=f"DD{n}", path="PB1 - 3", verdict=verdict, detail="why" * (n % 2), others=("DD9",))
        for n, verdict in enumerate(BoardVerdict)
    ]
    for few in (rows, rows[:1], [row for row in rows if row.is_fault][:1]):
        for as_json in (False, True):
            yield from printed(board._print, few, as_json=as_json)
    small = SimpleNamespace(
        failure=SimpleNamespace(way="no_collision: front", says="it hit", at_ns=1_500_000_000),
        things_before=9,
        things_after=2,
        trials=33,
        is_complete=True,
        trial=SimpleNamespace(trusted=()),
    )
    kept = SimpleNamespace(
        scenario=Path("/k/s.toml"),
        test=Path("/k/t.py"),
        is_confirmed=True,
        explained="why so",
        outcome=SimpleNamespace(sha256="0123456789abcdefgh"),
    )
    for change in ({}, {"is_confirmed": False, "explained": ""}):
        other = SimpleNamespace(**vars(kept) | change)
        yield said(shrink.as_json(small, other))  # type: ignore[arg-type]  # as above
        yield from printed(shrink._print, small, other)
    small.is_complete, small.trial.trusted = False, ("x",)
    yield from printed(shrink._print, small, kept)
    for score, bounds, least in ((None, None, 5.0), (70.0, (60.0, 80.0), 75.0), (70.0, (60.0, 80.0), 65.0)):
        tried_ = SimpleNamespace(score=score, bounds=bounds, pairs=range(20), possible=90)
        yield mutate._below(tried_, least)  # type: ignore[arg-type]  # as above
    yield said([mutate._drawn(range(30), count, seed) for count in (1, 7, 30) for seed in (0, 5)])  # type: ignore[arg-type]
    yield said(draw.random())


def shrunk(_draw: Random) -> Iterator[str]:
    """Carry out the verb that shrinks, whose work is only noted: what it asks for, prints and ends with."""
    calls: list[str] = []
    failure = SimpleNamespace(way="no_collision: front", says="it hit", at_ns=1_500_000_000)
    small: Any = SimpleNamespace(
        failure=failure, things_before=9, things_after=2, trials=33, is_complete=True,
        trial=SimpleNamespace(trusted=()),
    )  # fmt: skip

    def shrink_it(trial: Any, *, quick: object, budget: int, judge: Any) -> object:
        calls.append(said([trial.name, trial.seed, quick, budget, judge(trial, "way", 5)]))
        return small

    def failure_of(trial: Any, way: object, until_ns: object, look: Any) -> str:
        calls.append(said([trial.name, way, until_ns, look() is None]))
        return "failed"

    with (
        in_folder() as folder, mock.patch.object(shrink, "shrink", shrink_it),
        mock.patch.object(shrink, "failure_of", failure_of), mock.patch.object(shrink, "keep") as keep,
    ):  # fmt: skip
        for confirmed in (True, False):
            keep.return_value = SimpleNamespace(
                scenario=Path("/k/s.toml"), test=Path("/k/t.py"), is_confirmed=confirmed, explained="why so",
                outcome=SimpleNamespace(sha256="0123456789abcdefgh"),
            )  # fmt: skip
            for words in ("dodge", "dodge --json --out there --quick", "dodge --budget 7 --seed 4 --goal no_collision"):
                yield f"$ shrink {words}"
                yield from (line.replace(str(folder), "HERE") for line in printed(p2os, ["shrink", *words.split()]))
                yield said([calls, keep.call_args.args[1:]])
                calls.clear()


MUTATED = (
    "dodge", "dodge --json --junit r.xml", "dodge --sample 5 --seed 3 --write out -j 2", "dodge --only dodge_fsm.c",
    "dodge --only nothing", "dodge --fail-under 99%", "dodge --sample 5 --fail-under 10%", "dodge motors --only main",
    "dodge tests.py", "tests.py --sample 4", "dodge tests.py --json --sample 3 --seed 1", "dodge --write taken/x",
    "dodge --junit none/r.xml",
)  # fmt: skip


def mutated(draw: Random) -> Iterator[str]:
    """Carry out the verb that changes programs, whose runs are made up: what is tried, told, written and ended with."""
    calls: list[str] = []
    firmware = load_scenario("dodge").firmware
    first = BluePill(firmware).pc
    ran = dict.fromkeys(range(first, first + 40, 2), 0)

    def in_processes(job: Any, count: int, *, at_once: int, on_done: Any, raise_if_interrupted: Any) -> bool:
        calls.append(said([count, at_once]))
        for number in range(count):
            on_done(number, job(number, raise_if_interrupted) if draw.random() < 0.9 else {
                "failures": draw.choice((["killed", "x"], [INTERRUPTED], ["ended by SIGXCPU"]))})  # fmt: skip
        return draw.random() < 0.8

    def come_to(mutant: Any, bases: Any, _clock: object, look: Any) -> MutantResult:
        calls.append(said([f"{mutant.address:x}", len(bases), look() is None]))
        return MutantResult(draw.choice([*Fate]), "dodge", "it did", draw.choice((0, 1_500_000_000)))

    def by_tests(suite: Suite, mutant: Any, limit_s: int) -> MutantResult:
        calls.append(said([len(suite.base.addresses), f"{mutant.address:x}", limit_s]))
        return MutantResult(draw.choice([*Fate]), "tests.py", "test_b")

    suites = iter(SuiteRun(**one) for one in (
        {"addresses": {*ran}, "sha256": "ab", "cpu_s": 0.5}, {"failed": "test_a", "sha256": "ab"}, {"sha256": "ab"},
    ) * 9)  # fmt: skip
    with (
        in_folder() as folder, mock.patch.object(mutate, "run_in_processes", in_processes),
        mock.patch.object(mutate, "base_run", return_value=SimpleNamespace(first_ns=ran)),
        mock.patch.object(mutate, "try_mutant", come_to), mock.patch.object(mutate, "load_pytest"),
        mock.patch.object(mutate, "run_suite", side_effect=suites), mock.patch.object(mutate, "core_count", int),
        mock.patch.object(Suite, "try_mutant", by_tests),
    ):  # fmt: skip
        Path("tests.py").write_text("", encoding="utf-8")
        Path("taken").write_text("", encoding="utf-8")
        for words in MUTATED:
            yield f"$ mutate {words}"
            for line in printed(p2os, ["mutate", str(firmware), *words.split()]):
                yield line.replace(str(folder), "HERE").replace(str(firmware.parent), "FIRMWARE")
            yield said(calls)
            calls.clear()
            for made in sorted(path for path in folder.rglob("*") if path.suffix in {".xml", ".elf", ".bin"}):
                yield made.name if made.suffix != ".xml" else made.read_text(encoding="utf-8")
                made.unlink()


ALONE = "dodge --trajectories 0 --vary threshold_m=0.4..0.8"
VARIED = (
    ALONE, f"{ALONE} --steps 3 --json", f"{ALONE} --vary start.x_m=-0.5..0.5 --steps 3 --outcome path_m",
    f"{ALONE} --seeds 0-2 --steps 2 --set start.y_m=0.1", f"{ALONE} --body kinematic --duration 2s --steps 2 -j 3",
    f"{ALONE} --outcome none", f"{ALONE} --steps 2 --picture a.png", "dodge", "dodge --trajectories 0 --steps 1",
)  # fmt: skip


def varied(draw: Random) -> Iterator[str]:
    """Carry out the verb that varies scenarios, whose runs are made up: which are asked for, and what they come to."""
    calls: list[str] = []
    dodge = load_scenario("dodge")

    def load(name: str, *, settings: Any, **named: Any) -> Scenario:
        calls.append(said([name, settings, named["set_by"]]))
        return replace(dodge, name=str(dict(settings).get("threshold_m", 0.6)))  # by which a run is known

    def outcomes(scenario: Scenario, look: Any) -> dict[str, float]:
        look(5)
        calls.append(said([scenario.name, scenario.seed, scenario.body == "kinematic", scenario.duration_ns]))
        return {"path_m": 2 * float(scenario.name) + 0.01 * scenario.seed, "goal 1: 1 m": 1 - float(scenario.name) ** 2}

    def in_processes(job: Any, count: int, *, at_once: int, on_done: Any, raise_if_interrupted: Any) -> bool:
        calls.append(said([count, at_once]))
        for number in reversed(range(count)):
            on_done(number, job(number, raise_if_interrupted))
        return draw.random() < 0.9

    with (
        in_folder(), mock.patch.object(sensitivity, "load_scenario", load),
        mock.patch("robot_bench.experiments.sensitivity.outcomes_of", outcomes),
        mock.patch.object(sensitivity, "run_in_processes", in_processes), mock.patch.object(sensitivity, "require"),
        mock.patch.object(sensitivity, "core_count", int), mock.patch.object(sensitivity, "load_once"),
        mock.patch.object(sensitivity, "_draw", lambda *given: calls.append(said(given))),
    ):  # fmt: skip
        for words in VARIED:
            yield f"$ sensitivity {words}"
            yield from printed(p2os, ["sensitivity", *words.split()])
            yield said(calls)
            calls.clear()


SETTINGS: tuple[tuple[tuple[str, object], ...], ...] = (
    (),
    (("threshold_m", 0.4), ("start.x_m", 1)),
    (("threshold_m", 0.6), ("start.x_m", 1)),
    (("a.x_m", "it's"), ("b.x_m", [1, 2])),
)


def swept(draw: Random, count: int) -> sweep.SweepResult:
    """Return what came of runs of a scenario, that differ in their seeds and in parameters."""
    dodge = load_scenario("dodge")
    keys = draw.choice((SETTINGS[:1], SETTINGS[1:3], SETTINGS[3:]))
    rows, outcomes = list[sweep.SweepRow](), list[dict[str, object]]()
    hashes = draw.choice((("a0" * 32,), ("a0" * 32, "b1" * 32), ("a0" * 32, None)))
    for number in range(count):
        settings = keys[number * len(keys) // count]
        made: Any = sweep.SweepRow(
            replace(dodge, seed=number), settings, sweep.command("dodge", ["--mode", "direct"], settings, number)
        )
        rows.append(made)
        failures = draw.choice((
            [], [], [], ["not run"], [f"{INTERRUPTED} (SIGINT)"], ["no_collision: it hit", "second\x00 \ufffe"],
            ["not run because of it"],
        ))  # fmt: skip
        outcomes.append(
            {
                "passed": not failures,
                "failures": failures,
                "body": draw.choice(("kinematic", "bullet", None)),
                "virtual_s": draw.choice((None, 12.3456)),
                "distance_m": draw.choice((None, 0, 1.23456)),
                "min_clearance_m": draw.choice((None, 0.12345)),
                "trace_sha256": draw.choice(hashes),
                "wall_s": draw.choice((None, 0.5)),
                "folder": draw.choice((None, "runs/1")),
            }
        )
    return sweep.SweepResult(rows, outcomes, draw.random() < 0.3, Path("runs"))


def sweeps(draw: Random) -> Iterator[str]:
    """Print sweeps of few runs and of many, as a table, as JSON and for CI; and carry some out."""
    with in_folder():
        for count in (1, 2, 4, 7, 20, 40, 41, 60):
            done = swept(draw, count)
            yield from printed(sweep.print_sweep, done)
            yield said(sweep.as_json(done))
            sweep.write_junit(done, Path("r.xml"))
            yield Path("r.xml").read_text(encoding="utf-8")
            yield said([sweep._places(done.rows), [sweep.word_of(found) for found in done.outcomes]])
            yield said([sweep.KEPT[kept](passed) for kept in sweep.KEPT for passed in (True, False)])
        yield tried(sweep.refuse_junit, Path("none", "r.xml"))
        yield tried(lambda: sweep._places([done.rows[0], done.rows[0]]))
        reported: list[object] = []

        def run(scenario: Scenario, folder: Path, **named: Any) -> RunResult:
            named["on_progress"](None)
            reported.append([scenario.seed, folder, named["force"], [named["is_kept"](one) for one in (True, False)]])
            folder.mkdir(parents=True, exist_ok=scenario.seed % 2 == 0)
            return replace(result_of(passed=scenario.seed % 3 > 0, extra=1), folder=folder)

        def in_processes(job: Any, count: int, **named: Any) -> bool:
            reported.append([count, named["at_once"]])
            for number in range(count - 1):
                named["on_done"](number, job(number, lambda: reported.append("look")))
            return draw.random() < 0.5

        with (
            mock.patch.object(sweep, "run_scenario", run),
            mock.patch.object(sweep, "run_in_processes", in_processes),
            mock.patch.object(sweep, "load_once", lambda scenario: reported.append(scenario.name)),
        ):
            for number, kept in enumerate(sweep.KEPT):
                rows = swept(draw, 5).rows
                named = {"jobs": 2, "kept": kept, "raise_if_interrupted": print, "force": number == 1}
                found: list[sweep.SweepResult] = []
                place = None if number == 2 else Path(f"s{number}")
                yield from printed(lambda r=rows, p=place, n=named, f=found: f.append(sweep.run_sweep(r, p, **n)))
                yield said([reported, [(one.folder, one.was_interrupted, one.outcomes) for one in found]])
                reported.clear()


def validations(_draw: Random) -> Iterator[str]:
    """Hand on what is to be validated: in variants of the bench, and at a port, where a person is asked once a room."""
    reported: list[object] = []
    some = [validate.EXPERIMENTS[name] for name in ("motors", "slip", "encoders", "sensors", "sensors-all")]

    def port(runs: Any, drive: Any, folder: Path, *, settings: object) -> list[TrialResult]:
        reported.append([[[one.name for one in run.experiments] for run in runs], folder, settings])
        for run in [*runs, *runs[:1]]:
            drive(run, folder / "run")
        return []

    def trials(chosen: Any, variants: Any, folder: Path, **named: Any) -> list[TrialResult]:
        named["on_done"](1, 2)
        named["in_processes"](print, 3, print)
        plain = {key: value for key, value in named.items() if key not in {"on_done", "in_processes"}}
        reported.append([[one.name for one in chosen], variants, folder, plain])
        return []

    def processes(_job: object, count: int, *, at_once: int, **_: object) -> bool:
        reported.append([count, at_once])
        return True

    def driven(scenario: Scenario, *words: object, **named: object) -> None:
        reported.append(["drive", scenario.name, words, named])

    with (
        mock.patch.object(validate, "run_port", port), mock.patch.object(validate, "run_trials", trials),
        mock.patch.object(validate, "run_in_processes", processes), mock.patch.object(validate, "drive_port", driven),
        mock.patch.object(validate, "load_once", lambda one: reported.append(["load", one.name, one.body])),
        mock.patch.object(validate, "ask", lambda one, where: reported.append(["ask", one.name, where])),
    ):  # fmt: skip
        for keys, yes in ((True, False), (False, True)):
            with mock.patch.object(validate, "has_keyboard", lambda has=keys: has):
                yield from printed(validate._run_at_port, some, Path("v"), [("threshold_m", 0.5)], "tcp:x", yes=yes)
            yield said(reported)
            reported.clear()
        chosen = [Variant("direct", "", body) for body in ("kinematic", "bullet", "kinematic")]
        settings = [("threshold_m", 0.5)]
        yield from printed(validate._run_all, some, chosen, Path("v"), settings, worlds=["room"], seeds=[1], jobs=2)
        yield said(reported)


TRACES = {
    "tables": tables,
    "studies": studies,
    "shrunk": shrunk,
    "mutated": mutated,
    "varied": varied,
    "sweeps": sweeps,
    "validations": validations,
}
test_what_verbs_make_of_results_is_what_was_approved = judge_of(__file__, TRACES)
