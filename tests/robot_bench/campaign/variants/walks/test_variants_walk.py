"""Trials made small, compared by versions, mutated and mended, by answers that are made up: each question and word."""

import itertools
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any
from unittest import mock

from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.board import BluePill
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.mutants import mutants
from bluepill_sim.program.static_code import StaticCode
from bluepill_sim.program.version_difference import LineDifference
from p2os.toml_record import number_of, table_of
from robot_bench.campaign.last_moment import LastMoment, last_moment
from robot_bench.campaign.trial import GoalResult, HullContact, Outcome, Trial, TrialVerdict, run_trial, trial_of
from robot_bench.campaign.variants import against, changed_back, diversity, fault_line
from robot_bench.campaign.variants.against import Against, Other, compared
from robot_bench.campaign.variants.mutation import base_run, report, suite
from robot_bench.campaign.variants.mutation.interval import share_interval
from robot_bench.campaign.variants.mutation.trial import Fate, MostCost, MutantResult, try_mutant
from robot_bench.campaign.variants.shrinking import kept
from robot_bench.campaign.variants.shrinking.failure import Failure, FailureMode, failure_of
from robot_bench.campaign.variants.shrinking.reduction import ANGLE_STEPS, STEPS, fewest, rounded, rounder
from robot_bench.campaign.variants.shrinking.shrink import shrink
from robot_bench.campaign.variants.shrinking.things import (
    numbers,
    things,
    with_numbers,
    with_things,
    with_world,
    world_table,
)
from robot_bench.scenario.loading import load_scenario, shipped_file
from simbase.errors import P2osError
from tests.robot_bench.firmware.hurried import hurried
from tests.tools.suite.approved import Trace, judge_of, refusal, said, tried
from tests.tools.suite.declared import declared_of

S = 10**9
HEAD = """
firmware = "{firmware}"
world = "room"
body = "kinematic"
mode = "direct"
duration_s = {duration}
[start]
x_m = 0.512
y_m = 0.247
heading_deg = 11.3
[[obstacle]]
at_s = 0.0
name = "post"
shape = "cylinder"
radius_m = 0.1
height_m = 0.5
x_m = {x_m}
y_m = 0.26
[[obstacle]]
at_s = 0.3
op = "move"
name = "post"
x_m = 0.86
y_m = 0.26
[[hand]]
at_s = 0.1
do = "drive"
forward_mps = 0.5
turn_dps = 0.0
[[goal]]
kind = "no_collision"
[[goal]]
kind = "min_distance"
distance_m = 0.01
[[goal]]
kind = "usart_lacks"
text = "never"
"""


def trial(folder: Path, **changes: object) -> Trial:
    given: dict[str, object] = {"firmware": hurried("dodge", 1), "duration": 1.5, "x_m": 0.9137}
    file = folder / "mine.toml"
    file.write_text(HEAD.format(**given | changes), encoding="utf-8")
    return trial_of(str(file))


def lists(draw: Random) -> Iterator[str]:
    """Make lists short and numbers round."""
    for _ in range(24):
        size = draw.randrange(9)
        needed = {draw.randrange(9) for _ in range(draw.randrange(4))}
        asked: list[str] = []

        def holds(some: Sequence[int], needed: set[int] = needed, asked: list[str] = asked) -> bool:
            asked.append("".join(map(str, some)))
            return needed <= {*some}

        yield said([size, needed, fewest(range(size), holds), asked])
    for value in (0.0, 0.2, -0.2, 0.5, 0.26, 1.04, 1.0, 33.333, -7.5, 0.0004, 359.97, float("inf"), 12.0):
        for steps in (STEPS, ANGLE_STEPS):
            yield said([value, [*rounder(value, steps)], [rounded(min(value, 1e6), step, steps) for step in steps]])


def shrinking(draw: Random) -> Iterator[str]:
    """Shrink trials by a judge that is made up, with budgets that do and do not suffice."""
    with TemporaryDirectory(prefix="p2os-test-") as name:
        whole = trial(Path(name))
        yield said([things(whole), [(one.path, one.value, one.is_angle) for one in numbers(whole)]])
        own = with_world(whole)
        yield said([[*own.table.items()], things(own)]).replace(name, "HERE")
        yield said([(one.path, one.value, one.is_of_world) for one in numbers(own)])
        some = with_things(own, things(own)[1::2])
        yield said([things(some), with_numbers(some, dict.fromkeys(numbers(some)[::2], 1.5)).table])
        for number in range(7):
            chosen = draw.sample(things(own), 2)
            needed = [(one.list_name, own_table(own, one)) for one in chosen if one.list_name != "mark"]
            is_early, asked = draw.random() < 0.7, list[str]()

            def judge(
                one: Trial, way: FailureMode | None, until: int | None,
                asked: list[str] = asked, needed: Any = needed, is_early: bool = is_early, number: int = number,
            ) -> Failure | None:  # fmt: skip
                there = with_world(one)
                held = [(thing.list_name, own_table(there, thing)) for thing in things(there)]
                keeps = all(any(alike(one, other) for other in held) for one in needed)
                found = keeps and float(str(one.table["duration_s"])) >= 1.2
                if number % 2:  # it has to begin where it does, to some figures
                    found = found and 0.508 <= number_of(table_of(one.table, "start"), "x_m") <= 0.514
                asked.append(f"{len(things(one))}{'+' if found else '-'} {until} {one.table['duration_s']}")
                mode = FailureMode(what="touches nothing", part="front")
                at = round(1.1 * S) + len(held)
                return None if not found or way not in {None, mode} else Failure(
                    way=mode, at_ns=at, is_early=is_early, says="it hit", blocks=frozenset({len(held)}))  # fmt: skip

            quick = (("mode", "direct"), ("body", "kinematic")) if number % 3 == 0 else ()
            try:
                small = shrink(whole, quick=quick, budget=draw.choice((5, 40, 400)), judge=judge)
            except P2osError as error:
                yield refusal(error)
                continue
            yield said([number, needed, small.things_before, small.things_after, small.trials, small.is_complete])
            yield said([small.trial.table, small.failure, asked]).replace(name, "HERE")
        for way in (FailureMode(what="touches nothing", part="front"), FailureMode(what="HardFault", is_fault=True)):
            yield kept.test_text(replace(whole, name='a "b" c'), way)
        for way in (FailureMode(what="x", robot="west", part="rear"), FailureMode(what="y", is_fault=True)):
            yield str(way)
        for world in ("room", "arena", "none.toml"):
            yield tried(lambda world=world: kept._in_world(whole, world).table).replace(name, "HERE")
        for meta in ({"firmware_sha256": "0"}, {}):
            for firmware in (None, Path("x")):
                yield tried(kept._refuse_another, SimpleNamespace(meta={"firmware_sha256": ""} | meta), whole,
                            Path("runs/1"), firmware)  # fmt: skip


def own_table(one: Trial, thing: Any) -> object:
    tables: Any = (world_table(one) if thing.is_of_world else one.table) or {}
    return tables[thing.list_name][thing.number]


def alike(one: Any, other: Any) -> bool:
    """Tell whether two things are of one list and one name, whatever their numbers."""
    return one[0] == other[0] and one[1].get("name", one[1].get("do")) == other[1].get("name", other[1].get("do"))


def outcomes(_draw: Random) -> Iterator[str]:
    """Run short trials: how they fail, until when that was avoidable, and what came of them."""
    with TemporaryDirectory(prefix="p2os-test-") as name:
        for changes in ({"duration": 1.0}, {"x_m": 2.5, "duration": 0.4}):
            one = trial(Path(name), **changes)
            done = run_trial(replace(one, looks_for=frozenset({"contact", "robot moves"})))
            yield said([done.verdict, done.failures, done.virtual_ns, done.distance_m, done.clearance_m, done.hits])
            yield said([done.way_mm, done.died, len(done.blocks), sorted(done.lines), sorted(done.happened)])
            yield said([sorted(done.transitions), len(done.ways), done.goals, done.failing_goals])
            failure = failure_of(one)
            yield said(None if failure is None else [failure.way, failure.at_ns, failure.is_early, failure.says])
            if failure is not None:
                yield said([failure_of(one, failure.way, until) is None for until in (10**8, 10**9)])
                yield said(failure_of(one, FailureMode(what="other")))
            found = last_moment(one)
            yield said(found)
            yield "" if found is None else found.words
    for avoidable, place in ((None, None), (S, (1.234, -0.5, 90.4)), (S, None)):
        yield LastMoment(failure="x", failed_ns=2 * S, avoidable_ns=avoidable, place=place, printed="").words


def outcome(draw: Random) -> Outcome:
    """Return an outcome of any kind."""
    verdict = draw.choice((TrialVerdict.PASSED, TrialVerdict.FAILED, TrialVerdict.FAILED, TrialVerdict.ERROR))
    goals = tuple(
        GoalResult(kind=kind, wanted=kind, met=draw.choice((True, True, False, None)), says=f"{kind} said",
                   robustness=draw.choice((None, -0.5, 0.0, 0.125, 0.25, 0.5)), unit="m",
                   is_excused=draw.random() < 0.1)
        for kind in ("no_collision", "reach")
    )  # fmt: skip
    hits = (HullContact(t=S, what="'x'", part=draw.choice(("front left", "rear")), x_m=0.0, y_m=0.0),)
    return Outcome(
        verdict=verdict, goals=goals, hits=hits * draw.randrange(2),
        failures=("why",) * (verdict is not TrialVerdict.PASSED),
        sha256=f"{draw.randrange(9)}", virtual_ns=draw.randrange(3) * S,
        died=draw.choice(("", "", "Fault at x", "Fault at y")),
        way_mm=tuple((draw.randrange(-4000, 4000), draw.randrange(-4000, 4000)) for _ in range(draw.randrange(4))),
        blocks=frozenset(draw.sample(range(60), draw.choice((50, 51)))), clearance_m=draw.choice((None, 0.25)),
        lines=frozenset({str(draw.randrange(4))}), ways=frozenset({draw.randrange(4)}),
    )  # fmt: skip


def versions(draw: Random) -> Iterator[str]:
    """Compare outcomes of two versions, and cluster failures."""
    for _ in range(60):
        one, other = outcome(draw), outcome(draw)
        found = compared(one, other, ("a.elf", "b.elf"))
        yield said([found.verdict, found.failures, found.goals, found.sha256[:8], found.died, sorted(found.lines)])
        yield said([sorted(found.ways), len(found.blocks), found.hits, found.way_mm])
    many = [outcome(draw) for _ in range(30)]
    yield said([diversity.clusters(many), diversity._numbers(range(6)), diversity._numbers(range(9))])
    for one in many:
        yield said(sorted(diversity.way_cells(one, (-3.0, -2.0, 3.0, 4.0))))  # type: ignore[type-var]  # pairs
    sets = [frozenset(draw.sample(range(9), draw.randrange(5))) for _ in range(5)]
    yield said([diversity.mean_distance(sets), diversity.mean_distance(sets[:1]), diversity.distance(sets[0], sets[1])])
    with TemporaryDirectory(prefix="p2os-test-") as name:
        mine = trial(Path(name))
        yield said(sorted(map(str, diversity._scene(mine)[1])))
        other = Other("b.elf", b"else")
        other.keep(Path(name))
        yield said([Other.of(Path(name)), Other.of(Path(name, "none")), other.sha256[:9]])
        for found in ([], ["first"], ["first", "second"]):
            with (
                mock.patch.object(against, "differences", return_value=found),
                mock.patch.object(against, "_events", lambda version: version.files[version.firmware_name]),
            ):
                yield said(against.first_apart(mine, other))

        class Backwards:
            """Workers that end in the other order."""

            def run(self, trials: Sequence[Trial], on_done: Any, *, anew: bool = False) -> None:
                for place in reversed(range(len(trials))):
                    on_done(place, (replace(outcome(Random(place)), sha256=f"{place} {anew}"), 1.5 + place))

            def close(self) -> None:
                """Nothing is to be ended."""

        reported: list[object] = []
        Against(Backwards(), other).run(
            [mine] * 3, lambda place, done: reported.append([place, done[0].failures, done[1]]), anew=True
        )
        yield said(reported)
    places = [("a.c", 3), ("a.c", 4), ("a.c", 6), ("a.c", 9), ("b.c", 5), ("x.h", 7)]
    for _ in range(80):
        rows = [
            LineDifference(draw.choice(("f", "f", "g")), tuple(sorted(draw.sample(places, draw.randrange(3)))),
                           tuple(sorted(draw.sample(places, draw.randrange(1, 4)))))
            for _ in range(draw.choice((0, 1, 1, 2)))
        ]  # fmt: skip
        yield said([[(row.function, row.ours, row.theirs) for row in rows], fault_line.place_of(rows)])


def mutation(draw: Random) -> Iterator[str]:
    """Report mutants whose fates are drawn, all of them and a sample."""
    firmware = shipped_file("dodge").parent.parent / "firmware" / "dodge.elf"
    board = BluePill(firmware)
    lines = read_lines(board.image)
    coverage = Coverage(board.image, lines, StaticCode(board.chip.memory))
    addresses = [row.address for row in lines.rows if row.file.endswith("dodge_fsm.c")]
    every = mutants(board.image, addresses)
    for count, possible in ((len(every), len(every)), (20, 90), (3, 3), (0, 5)):
        tried_ = every[:count]
        fates = [None if draw.random() < 0.05 else MutantResult(
            draw.choice((*Fate, Fate.SURVIVED, Fate.MISSED)), draw.choice(("mine", "other")),
            draw.choice(("no_collision: it hit", "reach: never", "")), draw.randrange(3) * S)
            for _ in tried_]  # fmt: skip
        if count == 3:
            fates = [MutantResult(Fate.SAME)] * 3
        found = report.Mutation(
            firmware=firmware, scenarios=["mine", "other"], instructions=99, possible=possible,
            seed=7 if count < possible else None, tried=tried_, found=fates, coverage=coverage, lines=lines,
        )  # fmt: skip
        yield from report.report_lines(found)
        yield said([found.score, found.bounds, found.is_sample, len(found.survivors)])
        plain = report.as_json(found)
        yield said({key: value for key, value in plain.items() if key != "mutants"})
        yield from map(said, plain["mutants"][:12])  # type: ignore[index]  # a list
        with TemporaryDirectory(prefix="p2os-test-") as name:
            report.write_junit(found, Path(name, "x.xml"))
            yield from Path(name, "x.xml").read_text(encoding="utf-8").replace("><", ">\n<").splitlines()[:30]
    for hits, sample, whole in ((0, 1, 1), (0, 3, 9), (3, 3, 9), (5, 9, 100), (50, 100, 100), (9, 10, 10**6)):
        yield said([share_interval(hits, sample, whole), share_interval(hits, sample, whole, confidence=0.5)])
    base: Any = SimpleNamespace(cost_ns=1000, ran_ns=500)
    yield said([MostCost().of(base, ran) for ran in (0, 500, 501, 5000)])
    result = MutantResult(Fate.MISSED, "mine", "why", 1_500_000_000)
    yield said([result.to_plain(), MutantResult.from_plain(result.to_plain()) == result, result.is_noticed])
    with mock.patch.object(changed_back, "image_of", return_value=board.image):
        for failing, passing, right in (
            (2, 9, {3}),
            (1, 9, {3}),
            (9, 9, set()),
            (9, 9, {3, 40}),
            (9, 0, {5}),
            (9, 9, {5}),
        ):
            one = SimpleNamespace(files={"x": b""}, firmware_name="x", with_firmware=lambda changed: changed)
            ran = addresses[:30]
            looked = changed_back.ChangedBack([one] * failing, [one] * passing, ran, lambda _: False, lambda _: True)
            chosen = [looked.changes[place] for place in right if place < looked.count]
            with mock.patch.object(changed_back, "mutated_file", return_value=b""):
                looked.first = lambda change, chosen=chosen: change in chosen  # type: ignore[misc]
                for number in looked.look():
                    if number == 60 and failing == 2:
                        break
            yield said([looked.tried, looked.count, looked.result])
            yield looked.result.text


class Answering:
    """Takes the place of `pytest.main`: looks at a test with a bench and one without, and ends with a code."""

    def __init__(self, code: int, failing: Sequence[str], board: Any) -> None:
        self.words: list[str] = []
        self.content = b""
        self._code, self._failing, self._board = code, failing, board

    def __call__(self, words: Sequence[str], plugins: Sequence[Any]) -> int:
        sys.stdout.write("nobody reads this")
        self.words, bench = [*words], SimpleNamespace(
            trace=SimpleNamespace(sha256="abc"), robots={"": SimpleNamespace(chip=self._board),
                                                         "port": SimpleNamespace(chip=3)})  # fmt: skip
        firmware = Path(next(word for word in words if "firmware" in word).partition("=")[2])
        self.content = firmware.read_bytes()[:12] if firmware.exists() else b""
        for item in (SimpleNamespace(funcargs={"bench": bench}), SimpleNamespace(funcargs={}), SimpleNamespace()):
            plugins[0].pytest_runtest_teardown(item)
        for name in ("a/test_a.py::one", *self._failing, "a/test_b.py::last"):
            plugins[0].pytest_runtest_logreport(SimpleNamespace(failed=name in self._failing, nodeid=name))
        return self._code


def suites(_draw: Random) -> Iterator[str]:
    """Try mutants by tests whose ends are made up: what pytest is asked, by which limits, and what that comes to."""
    firmware = shipped_file("dodge").parent.parent / "firmware" / "dodge.elf"
    board, limits = BluePill(firmware), list[object]()
    board.run_for(20_000)
    for code, failing in ((0, ()), (1, ()), (1, ("a/b/test_c.py::two", "a/test_d.py::three")), (2, ()), (5, ())):
        main = Answering(code, failing, board)
        with mock.patch("pytest.main", main):
            found = suite.run_suite([Path("tests"), Path("more.py")], Path("a.elf"))
            yield said([main.words, found.to_plain(), suite.SuiteRun.from_plain(found.to_plain()) == found])
            for data, other in ((firmware.read_bytes(), "abc"), (b"plain" * 9000, found.sha256)):
                judge = suite.Suite(paths=(Path("t"),), base=suite.SuiteRun(sha256=other), data=data, image=board.image)
                with (
                    mock.patch.object(suite.resource, "setrlimit", lambda *given: limits.append(given[1])),
                    mock.patch.object(suite, "mutated_file", lambda data, mutant, _image: data[:4] + mutant),
                ):
                    yield said([judge.try_mutant(b"mutant", 7), limits])
                yield said(
                    [main.content, *(re.sub(r"=.*/p2os-mutant-[^/]*", "=HERE", word) for word in main.words[-2:])]
                )
                limits.clear()


def fault_lines(draw: Random) -> Iterator[str]:
    """Name the line by which versions differ, and choose trials of campaigns, whose runs are made up."""
    with TemporaryDirectory(prefix="p2os-test-") as name:
        mine = trial(Path(name))
    good = Other("good.elf", b"else")
    one_line = LineDifference("f", (("a.c", 3),), (("a.c", 3),))
    lacking = LineDifference("g", (("a.c", 7), ("a.c", 9)), ())
    far = LineDifference("h", (), (("b.c", 40), ("b.c", 44)))
    for number in range(24):
        ours = draw.choice((TrialVerdict.FAILED, TrialVerdict.FAILED, TrialVerdict.FAILED, TrialVerdict.PASSED))
        theirs = [draw.choice((TrialVerdict.PASSED, TrialVerdict.FAILED, TrialVerdict.ERROR)) for _ in range(2)]
        rows = draw.choice(([], [one_line], [replace(one_line, is_number=True)], [one_line, far], [lacking, far],
                            [replace(one_line, is_number=True), one_line]))  # fmt: skip
        apart = draw.choice((None, "parted"))
        asked: list[str] = []

        def ran(given: Trial, theirs: Any = theirs, ours: Any = ours, asked: list[str] = asked) -> Outcome:
            is_good = given.files[given.firmware_name] == b"else"
            asked.append(f"{given.seed}{'+' if is_good else '-'}")
            failures = () if theirs[given.seed] is TrialVerdict.ERROR and is_good else ("it hit", "more")
            return Outcome(verdict=theirs[given.seed] if is_good else ours, failures=failures)

        with (
            mock.patch.object(fault_line, "run_trial", ran),
            mock.patch.object(fault_line, "first_apart", return_value=apart),
            mock.patch.object(fault_line, "line_differences", return_value=rows),
            mock.patch.object(fault_line, "reported", "they part: {}".format),
            mock.patch.object(fault_line, "image_of", lambda given: given.files[given.firmware_name]),
        ):  # fmt: skip
            trials = [replace(mine, seed=seed) for seed in range(2)]
            found = tried(fault_line.by_version, trials, good)
            yield said([number, ours, theirs, apart, len(rows), found, asked])
        yield from fault_line.FaultLine(
            line="a.c:3" * (number % 2), says="word " * 40, also=("x", "y " * 90)
        ).text.split("\n")
    goals = [{"kind": "reach"}, {"kind": "no_collision", "excused_by": ["post"]}, {"kind": "x", "excused_by": ["wall"]}]
    for by in ((), ("post",), ("post", "wall")):
        given = replace(mine.with_lists(goal=goals), disturbed_by=frozenset(by))
        yield said(changed_back._ends_when_missed(given).table["goal"])
    for verdict in TrialVerdict:
        workers: Any = SimpleNamespace(run=lambda trials, on_done, verdict=verdict: [
            on_done(place, (Outcome(verdict=verdict), 1.0)) for place, _ in enumerate(trials)])  # fmt: skip
        yield said([verdict, changed_back.passes(mine, workers)])
    for count in (0, 3, 90):
        rows_of: list[Any] = [
            SimpleNamespace(cheap=SimpleNamespace(trial=replace(mine, seed=number), outcome=outcome(draw)))
            for number in range(count)
        ]
        yield tried(
            lambda rows_of=rows_of: [[one.seed for one in part] for part in changed_back.failing_and_passing(rows_of)]
        )


def tries(draw: Random) -> Iterator[str]:
    """Run a program, then with one instruction changed at a time: what each does to what scenarios notice."""
    with TemporaryDirectory(prefix="p2os-test-") as name:
        clock, looks = itertools.count(0, 1000), list[int]()
        one = trial(Path(name), duration=0.4)
        calm = one.with_lists(obstacle=[])
        plans = [each.scenario(Path(name)) for each in (one.with_lists(goal=[]), one, calm)]
        for plan in (plans[0], replace(plans[1], robots=load_scenario("two-dodge").robots), plans[1]):
            yield tried(base_run.base_run, plan, lambda: next(clock), lambda: looks.append(1)).partition("BaseRun")[0]
        base = base_run.base_run(plans[2], lambda: next(clock), lambda: looks.append(1))
        yield said([len(looks), base.bench.now, base.ran_ns, base.cost_ns, len(base.first_ns), sorted(base.states)])
        unsound = base_run.base_run(plans[1], lambda: next(clock), lambda: None, is_sound=False)
        yield said([unsound.bench.now, unsound.ran_ns, len(unsound.states), unsound.trace_sha256 == base.trace_sha256])
        every = mutants(base.board.image, sorted(base.first_ns))
        for number, one_change in enumerate([*draw.sample(every, 9), replace(every[0], address=3)]):
            for most in (MostCost(), MostCost(2, 0))[: 1 + (number < 2)]:
                found = try_mutant(one_change, [base], lambda: next(clock), lambda: looks.append(1), most)
                yield said(
                    [f"{one_change.address:x}", one_change.alteration.before, one_change.alteration.after, found]
                )


TRACES: dict[str, Trace] = {
    "lists": lists, "versions": versions, "mutation": mutation, "shrinking": shrinking, "outcomes": outcomes,
    "suites": suites, "fault lines": fault_lines, "tries": tries,
    "declared": declared_of(*(f"robot_bench.campaign.{one}" for one in (
        "variants", "variants.mutation", "variants.shrinking"))),
}  # fmt: skip
test_what_comes_of_variants_is_what_was_approved = judge_of(__file__, TRACES)
