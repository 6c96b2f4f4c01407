"""The bench's verbs: their options, what they refuse, what they hand on, and how they print what came of it."""

import contextlib
import io
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
from shutil import rmtree
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any
from unittest import mock

import typer

from p2os.cli.main import make_app
from p2os.cli.main import run as p2os
from robot_bench.cli import board, names, sweep, table
from robot_bench.cli import run as run_verb
from robot_bench.cli.campaigns import mutate, shrink
from robot_bench.cli.experiments import fit, sensitivity, validate
from robot_bench.cli.needs import NEEDS
from robot_bench.cli.project import existing
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
from simbase.errors import FileError, P2osError
from tests.tools.suite.approved import judge_of, rounded, said, tried
from tests.tools.suite.declared import declared_of


@contextlib.contextmanager
def in_folder() -> Iterator[Path]:
    """Stand in an empty folder, at a terminal of 80 columns that is none."""
    before = Path.cwd()
    with TemporaryDirectory(prefix="p2os-test-") as name, mock.patch.dict(os.environ, {"COLUMNS": "80"}):
        os.chdir(name)
        try:
            yield Path(name)
        finally:
            os.chdir(before)


def printed(action: Any, *arguments: object, **named: object) -> Iterator[str]:
    """Yield what something prints, and how it ends."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            ended = action(*arguments, **named)
        except typer.Exit as error:
            ended = f"exit {error.exit_code}"
        except P2osError as error:
            ended = f"{error} ({error.hint})"
    yield from (rounded(line) for line in out.getvalue().splitlines())
    yield from (f"! {rounded(line)}" for line in err.getvalue().splitlines())
    yield f"= {ended}"


def verbs(command: Any, path: str = "p2os") -> Iterator[tuple[str, Any]]:
    callback = getattr(command, "callback", None)
    if getattr(callback, "__module__", "").startswith("robot_bench"):
        yield path, command
    for name, below in getattr(command, "commands", {}).items():
        yield from verbs(below, f"{path} {name}")


def options(_draw: Random) -> Iterator[str]:
    """Go through every option of every verb: its names, default and type."""
    for path, command in verbs(typer.main.get_command(make_app())):
        for one in command.params:
            about = vars(one) | {f"type {key}": value for key, value in vars(getattr(one, "type", command)).items()}
            simple = {
                key: value
                for key, value in about.items()
                if isinstance(value, str | int | float | bool) or key.endswith("opts")
            }
            yield f"{path} {said(dict(sorted(simple.items())))}"
    yield from map(said, NEEDS)


#: Command lines that end before anything is run.
REFUSED = """\
run
run nothing
run dodge --fail-under 80%
run dodge --coverage --port x
run dodge --profile --gdb 1
run dodge --coverage --gdb 0
run dodge --port x --mode direct
run dodge --port x --body kinematic
run dodge --port x --world room
run dodge --port x --seed 3
run dodge --port x --realtime 2
run dodge --yes
run dodge --max-speed 1m/s
run dodge --watch-variable a --port x
run two-dodge --watch-variable a
run dodge --ros dds --port x
run dodge --ros dds --gdb 1
run dodge --ros dds --coverage
run dodge --ros dds --inputs x
run dodge --inputs x --port y
run dodge --inputs x --gdb 1
run dodge --inputs x --profile
run dodge --foxglove-origin https://a
run dodge --foxglove 1 --port x
run dodge --foxglove 1 --gdb 1
run dodge --foxglove 1 --ros dds
run dodge --foxglove 1 --inputs x
run two-dodge --foxglove 1
run dodge --view --port x
run dodge --view --ros dds
run dodge --view --inputs x
run dodge --view --foxglove 1
run dodge --jobs 2
run dodge --junit x
run dodge --watch-variable nothing
run dodge --seeds 0-1 --ros dds
run dodge --seeds 0-1 --inputs x
run dodge --seeds 0-1 --foxglove 1
run dodge --seeds 0-1 --view
run dodge --seeds 0-1 --gdb 1
run dodge --seeds 0-1 --realtime 2
run dodge --seeds 0-1 --watch-variable a
run dodge --seeds 0-1 --coverage
run dodge --seeds 0-1 --profile
run dodge --seeds 0-1 --seed 1
run dodge --seeds 0-1 --port x
run dodge --seeds 0-1 --keep some
run dodge --seeds 0-1 --junit /nowhere/x.xml
run dodge --seeds 5-1
run dodge --set a
run dodge --set threshold_m=-1
run dodge --mode both
run dodge --adapter none
run dodge --record spi9
campaign
campaign a b
campaign x --search none
campaign new
campaign new dodge -j 2
campaign new dodge --json
campaign new dodge --dask local
campaign new dodge --scheduler x
campaign new dodge --against x
campaign new dodge --resume x
campaign x --dask other
campaign x --dask local --scheduler y
campaign comment
campaign comment nowhere
campaign --resume x y
campaign --resume x --runs 3
campaign --resume x --firmware y
campaign --resume x --against y
campaign --resume x --out y
campaign --resume nowhere
campaign nowhere.toml
campaign new dodge --runs 30 --seed 4 --search random
campaign new dodge
campaign new dodge --out b.toml
mutate x dodge
mutate dodge.elf nowhere
shrink nowhere
shrink .
shrink dodge --firmware nowhere.elf
shrink dodge --goal none
shrink dodge --out taken
shrink dodge --out taken/x.toml
check
check nowhere
check dodge rover motors
check dodge --firmware x
diff a b
report nowhere
report nowhere --ros2 mcap
report nowhere --events x.jsonl
board test
board test --emulated --adapter x
board test --fault open:DD3
board test --revision rev-z
board test --emulated --fault gone:DD3
board test --emulated --revision rev-a
validate nothing
validate motors --mode both
validate --port x --mode direct
validate --port x --body kinematic
validate --port x --seeds 0-1
validate --port x --world room
validate --port x -j 2
validate --yes
validate motors --body none
fit
fit nowhere
fit x --truth a --truth b
fit taken --out taken/x
fit --example taken
fit --umbmark nowhere
sensitivity dodge
sensitivity dodge --vary a
sensitivity dodge --vary seed=0..1 --vary seed=0..2
sensitivity dodge --vary threshold_m=0.4..1 --steps 1 --trajectories 0
sensitivity dodge --vary threshold_m=-1..1
sensitivity dodge --vary threshold_m=0.4..99999
sensitivity dodge --vary threshold_m=0.4..1 --samples 3
compare
compare a b
compare a b --at noon
compare a b --align all
metrics nowhere
explain nowhere
new
new a --from b
new a --build ninja
new a --robot car
new --from b
new --from taken
new --from taken --robot rover
new taken
new --from . --build false
""".splitlines()


def refusals(_draw: Random) -> Iterator[str]:
    """Give verbs what cannot be."""
    loaded: dict[str, Scenario] = {}

    def load(*arguments: object, **named: object) -> Scenario:
        """Return a scenario, of each way to ask for it once: what is refused here is so whoever has loaded it."""
        key = repr((arguments, named))
        if key not in loaded:
            loaded[key] = load_scenario(*arguments, **named)  # type: ignore[arg-type]  # as they come
        return loaded[key]

    with in_folder() as folder, mock.patch.object(run_verb, "load_scenario", load):
        (folder / "taken").mkdir()
        (folder / "taken" / "x.toml").write_text("x", encoding="utf-8")
        for line in REFUSED:
            yield f"$ {line}"
            yield from (line.replace(str(folder), "HERE") for line in printed(p2os, line.split()))
            for made in sorted(path for path in folder.glob("*") if path.name != "taken"):
                yield f"{made.name}: {said(sorted(path.name for path in made.rglob('*')))}"
                if made.is_file():
                    yield made.read_text(encoding="utf-8").partition("\n\n")[0]
                    made.unlink()
                else:
                    rmtree(made)


def scenario_words(one: object) -> object:
    if isinstance(one, list):
        return [[scenario_words(row.scenario), row.settings, row.replay] for row in one]
    if not isinstance(one, Scenario):
        return Path(one).name if isinstance(one, Path) and one.is_absolute() else one
    adapter = one.adapter
    return [
        one.name,
        one.mode,
        one.body == "kinematic",
        one.seed,
        one.world,
        one.duration_ns,
        one.usart_baud,
        one.record,
        one.adapter_core,
        one.firmware.name,
        adapter.max_velocity_mm_s,
        adapter.max_rotation_deg_s,
    ]


OUTCOME: dict[str, object] = {
    "scenario": "mine",
    "world": "room",
    "mode": "adapter",
    "body": "kinematic",
    "seed": 3,
    "virtual_s": 12.34,
    "passed": True,
    "real_time_factor": 7.77,
    "distance_m": 1.234,
    "collisions": 2,
    "min_clearance_m": 0.1234,
    "usart_baud": 9600,
    "usart_lines": 2,
    "usart_last": "bye",
    "coverage": None,
    "trace_sha256": "0123456789abcdef0123",
    "last_blocks": None,
    "notes": [],
    "hits": [],
    "failures": [],
    "goals_met": ["a", "b"],
    "goals_not_judged": [],
    "explained": None,
}


def result_of(**changes: object) -> RunResult:
    outcome: Any = OUTCOME | changes
    stopped = bool(changes.get("interrupted"))
    return RunResult(folder=Path("runs/1"), outcome=outcome, report=Path("runs/1/report.html"), was_interrupted=stopped)


def handed_on(_draw: Random) -> Iterator[str]:
    """Run runs whose work is only noted: which scenario, where to, how fast, with what beside."""
    reported: list[str] = []

    def noted(name: str) -> Any:
        def note(*arguments: object, **named: object) -> RunResult:
            plain = {
                key: value if isinstance(value, int | float | str | bool | tuple | list | None) else type(value)
                for key, value in named.items()
            }
            reported.append(
                f"{name} {said([scenario_words(one) for one in arguments])} {said(plain)}".split(" object at ")[0]
            )
            return result_of()

        return note

    @contextlib.contextmanager
    def page(*_: object, **named: object) -> Iterator[object]:
        reported.append(f"page {said({key: value for key, value in named.items() if key != 'display'})}")
        yield None

    works = {
        name: mock.patch.object(run_verb, name, noted(name))
        for name in ("run_scenario", "run_many", "drive_port", "run_viewed_fleet")
    }
    with in_folder(), contextlib.ExitStack() as stack:
        for work in works.values():
            stack.enter_context(work)
        stack.enter_context(mock.patch.object(run_verb, "viewed", page))
        stack.enter_context(mock.patch("robot_bench.cli.demo.run_scenario", noted("demo")))
        stack.enter_context(mock.patch.object(run_verb, "core_count", return_value=3))
        for line in (
            "run dodge",
            "run dodge --realtime",
            "run dodge --realtime 2.5 --json",
            "run dodge --view",
            "run dodge --force",
            "run dodge --view --realtime 4 --watch-variable ticks --no-browser",
            "run two-dodge --view --realtime 2",
            "run two-dodge",
            "run dodge --mode direct --body kinematic --seed 9 --duration 2s --out there",
            "run dodge --usart-baud 9600 --record spi1,can --adapter firmware --world arena --coverage --profile",
            "run dodge --coverage --fail-under 80",
            "run dodge --watch-variable ticks",
            "run dodge --seeds 0-2",
            "run dodge --seeds 0-2 -j 2 --keep all --junit r.xml --json --force",
            "run dodge --set threshold_m=0.4",
            "run dodge --port serial:/dev/x --yes --max-speed 0.2m/s",
            "run dodge --port x --gdb 3333 --mode adapter",
            "demo",
            "demo --duration 20s --out there --force --json",
        ):
            reported.clear()
            ended = [*printed(p2os, line.split())]
            yield f"$ {line}: {reported} {ended}"
    dodge = load_scenario("dodge")
    for one in (dodge, replace(dodge, adapter=replace(dodge.adapter, max_velocity_mm_s=150, max_rotation_deg_s=20))):
        for speed in (None, 0.1234):
            yield said(scenario_words(run_verb.capped(one, speed)))
    for seeds, seed, port in ((None, None, None), ("0", None, "x"), (None, 1, None), (None, None, "x")):
        for about in (dodge, replace(dodge, seeds=(1, 2)), load_scenario("two-dodge")):
            yield said(run_verb.is_sweep(about, seeds=seeds, seed=seed, port=port))


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


def projects(draw: Random) -> Iterator[str]:
    """Look at folders of projects of every kind."""
    elf = b"\x7fELF"
    for layout in existing.LAYOUTS:
        yield said(layout).partition(", <function")[0]
    with in_folder() as folder:
        yield tried(existing.layout_of, folder / "none").replace(str(folder), "HERE")
        yield tried(existing.layout_of, folder).replace(str(folder), "HERE")
        for number, layout in enumerate(existing.LAYOUTS):
            place = folder / f"p{number}"
            for sign in layout.signs[:1]:
                file = place / sign.replace("*", "x")
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text("{}", encoding="utf-8")
            yield existing.layout_of(place).name
            yield tried(existing.find_project, place, layout).replace(str(folder), "HERE")
            for time, pattern in enumerate(layout.programs):
                program = place / pattern.replace("*", "made")
                program.parent.mkdir(parents=True, exist_ok=True)
                program.write_bytes(elf if time or number else b"none")
                os.utime(program, ns=(10 * time + 10,) * 2)
                other = program.with_name("firmware.elf" if number == 0 else "other.elf")
                other.write_bytes(elf)
                os.utime(other, ns=(10 * time + draw.choice((9, 10, 11)),) * 2)
            for source in layout.sources[-1:]:
                (place / source).mkdir(parents=True)
            with mock.patch.object(existing, "load_image"):
                found = existing.find_project(place, layout, draw.choice(("", 'say "hi" \\')))
            yield said(replace(found, folder=Path("P"))).partition(", ProjectLayout")[0]
            yield said([found.program, [*found.others], found.sources, found.build, found.name])
            for name, text in existing.files_beside(found, "kinematic").items():
                reported = [line for line in text.splitlines() if "made" in line or "kinematic" in line]
                yield f"{name} {len(text)} {reported}"
        (folder / "CMakePresets.json").write_text(
            '{"configurePresets": [{"binaryDir": "${sourceDir}/out/${presetName}/", "name": "a"}, {"binaryDir": "/x"},'
            ' {"binaryDir": "../y"}, {"binaryDir": "$env{HOME}/z"}, {"binaryDir": "o/${presetName}"},'
            ' {"name": "none"}]}',
            encoding="utf-8",
        )
        (folder / "CMakeUserPresets.json").write_text("[1]", encoding="utf-8")
        yield said(existing.preset_programs(folder))
    yield said(
        [
            existing._twice(at)
            for at in (0, 1, 5_000_000, 5_000_001, 499_999_999, 500_000_000, 500_000_001, 700_000_000, 3_333_333_333)
        ]
    )
    wires = {
        name: SimpleNamespace(times=[0, at, at + 9], levels=[0, level, 1 - level])
        for name, at, level in (
            ("p2dx_con", 700, 1),
            ("motor1_comm1", 900_000_000, 0),
            ("motor1_comm2", 5, 1),
            ("motor2_comm1", 5, 0),
            ("DD1", 1, 1),
        )
    }
    wires["motor2_comm3"] = SimpleNamespace(times=[0], levels=[0])
    for lines in ([], [(3, "  "), (7_000_000, "hello 'you'"), (9, "no")]):
        record = SimpleNamespace(pins=wires, usart_lines=lambda lines=lines: lines)
        yield from existing._tests_of(SimpleNamespace(record=lambda record=record: record))  # type: ignore[arg-type]


def completions(_draw: Random) -> Iterator[str]:
    """Complete names as a shell asks for them."""
    for begun in ("", "d", "two", "x"):
        yield said(names.scenario_names(begun))
    for params, words in (
        ({}, []),
        ({"scenario": "dodge"}, []),
        ({}, ["two-dodge"]),
        ({"scenario": "none"}, []),
        ({"scenario": "rover"}, []),
    ):
        context: Any = SimpleNamespace(params=params, args=words)
        for begun in ("", "start.", "mode=", "goal.1."):
            yield said(names.setting_keys(context, begun))
        yield said(names.variable_names(context, "t"))


TRACES = {
    "options": options,
    "refusals": refusals,
    "handed_on": handed_on,
    "tables": tables,
    "studies": studies,
    "sweeps": sweeps,
    "validations": validations,
    "projects": projects,
    "completions": completions,
    "declared": declared_of(
        "robot_bench.cli", "robot_bench.cli.experiments", "robot_bench.cli.campaigns", "robot_bench.cli.project"
    ),
}

test_what_verbs_have_and_show_is_what_was_approved = judge_of(__file__, TRACES)
