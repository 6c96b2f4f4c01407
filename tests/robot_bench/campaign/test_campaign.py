"""A campaign from its file to its folder, with runs of seconds: the same set whatever happens on the way."""

import contextlib
import gc
import itertools
import json
import os
import random
import signal
from collections.abc import Callable, Sequence
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pytest
import typer

from p2os.errors import ScenarioError
from p2os.toml_record import keys_of
from robot_bench.campaign.campaign_file import (
    DRAW,
    Campaign,
    CampaignTable,
    RunLimits,
    campaign_schema,
    load_campaign,
    parse_campaign,
)
from robot_bench.campaign.conduct import Conduct, PointFinding
from robot_bench.campaign.last_moment import LastMoment
from robot_bench.campaign.reaching.corpus import read_corpus
from robot_bench.campaign.search import SEARCHES, PointResult, Problem
from robot_bench.campaign.suggestion import suggested
from robot_bench.campaign.trial import GoalResult, Outcome, Trial, TrialVerdict, run_trial, trial_of, warm_up
from robot_bench.campaign.whole import MOST_MOMENTS, Whole, begin, carry_out, resume
from robot_bench.campaign.workers import processes
from robot_bench.campaign.workers.processes import Processes
from robot_bench.cli.campaigns.campaign import _facts, tell
from robot_bench.scenario.loading import known_scenarios, load_scenario
from simbase.errors import FileError, UsageError
from tests.p2os.view.pages import ReadPage

#: numba, which ribs compiles its steps by: for 8 s what then runs for some milliseconds.
os.environ["NUMBA_DISABLE_JIT"] = "1"
FILE = """
scenario = "dodge"
search = "random"
batch = 4
[budget]
runs = 12
confirmations = 6
[cheap]
mode = "direct"
duration_s = 4
[full]
mode = "adapter"
duration_s = 4
body = "kinematic"
[vary]
start.heading_deg = { from = 0, to = 350, step = 10 }
threshold_m = [0.4, 0.6]
[[draw]]
kind = "post"
count = { from = 0, to = 2 }
[[goal]]
kind = "no_collision"
"""

Done = tuple[Outcome, float]


def made_up(trial: Trial) -> Outcome:
    """Return an outcome that depends on the trial alone: a quarter of them fails, in both fidelities."""
    number = int(trial.sha256[:8], 16)
    obstacles = len(trial.table.get("obstacle", ()))  # type: ignore[arg-type]  # a list
    failed = obstacles == 2
    goal = GoalResult(
        kind="clearance", wanted="keeps off", met=not failed, says="", robustness=-0.1 if failed else 0.2, unit="m"
    )
    return Outcome(
        verdict=TrialVerdict.FAILED if failed else TrialVerdict.PASSED, goals=(goal,),
        failures=("clearance: ",) * failed,
        virtual_ns=10**9, sha256=f"{number:08x}", way_mm=((0, 0), (number % 1000, 0)),
        blocks=frozenset(range(number % 7)),
    )  # fmt: skip


class Shuffled:
    """Workers that end in any order; after so many runs they are interrupted."""

    def __init__(self, seed: int, until: int = 10**6, judge: Callable[[Trial], Outcome] = made_up) -> None:
        self._random, self._left, self._judge = random.Random(seed), until, judge
        self.count = 0
        #: Of each run whether it was to begin at its very beginning.
        self.anew: list[bool] = []

    def run(self, trials: Sequence[Trial], on_done: Callable[[int, Done], None], *, anew: bool = False) -> None:
        self.anew += [anew] * len(trials)
        places = list(range(len(trials)))
        self._random.shuffle(places)
        for place in places:
            if self.count == self._left:
                raise KeyboardInterrupt
            self.count += 1
            on_done(place, (self._judge(trials[place]), 0.5))

    def close(self) -> None:
        """Nothing is to be ended."""


def begun(folder: Path, text: str = FILE, **overrides: object) -> Campaign:
    file = folder / "mine.toml"
    file.write_text(text)
    return begin(file, folder / "kept", firmware=None, overrides=overrides)


def carried(campaign: Campaign, folder: Path, workers: Shuffled, moment: LastMoment | None = None) -> Whole:
    ticks = itertools.count()
    with pytest.MonkeyPatch.context() as patch:
        # What is made up does not fail when it is run: there is no last moment, and it takes long to find none.
        patch.setattr("robot_bench.campaign.whole.last_moment", lambda *_: moment)
        return carry_out(campaign, folder, workers, clock=lambda: next(ticks))


def set_of(whole: Whole) -> list[tuple[object, ...]]:
    return [
        (row.number, row.finding, row.proposal.point, *((run.stage, run.outcome.sha256) for run in row.runs))
        for row in whole.progress.rows
    ]


#: Loading the library takes a second or more, and ribs compiles itself; of those alike one is enough for each run.
SLOW = {"quality-diversity", "sobol", "coverage"}
OF_SOAK = {"cma-es", "tpe", "latin-hypercube", "grid"}


def test_what_a_call_sets_takes_the_place_of_the_files_key_by_key(tmp_path: Path) -> None:
    campaign = begun(tmp_path, search="sobol", budget={"runs": 16}, vary={"threshold_m": [0.5]})
    assert (campaign.search, campaign.batch) == ("sobol", 4)
    assert (campaign.budget.runs, campaign.budget.confirmations) == (16, 6)
    assert campaign.vary.keys() == {"start.heading_deg", "threshold_m"}
    assert campaign.vary["threshold_m"].choices == (0.5,)


@pytest.mark.parametrize(
    "search",
    [
        pytest.param(name, marks=[pytest.mark.soak] * (name in OF_SOAK) + [pytest.mark.slow] * (name in SLOW))
        for name in sorted(SEARCHES)
    ],
)
def test_every_search_asks_the_same_for_the_same_seed_in_whatever_order_the_runs_end(
    search: str, tmp_path: Path
) -> None:
    sets = []
    for number in (1, 2):
        folder = tmp_path / str(number)
        folder.mkdir()
        whole = carried(begun(folder, search=search), folder / "kept", Shuffled(number))
        sets.append(set_of(whole))
        assert whole.failures
    assert sets[0] == sets[1]
    assert len(sets[0]) in range(8, 13)
    points = [row[2] for row in sets[0]]
    assert all(0 <= at < 1 for point in points for at in point)  # type: ignore[attr-defined]  # a point


@pytest.mark.parametrize(
    "until", [5, pytest.param(0, marks=pytest.mark.slow), pytest.param(14, marks=pytest.mark.soak)]
)
def test_a_campaign_that_was_interrupted_goes_on_to_the_same_set(until: int, tmp_path: Path) -> None:
    for name in ("whole", "cut"):
        (tmp_path / name).mkdir()
    expected = carried(begun(tmp_path / "whole"), tmp_path / "whole/kept", Shuffled(1))
    cut = carried(begun(tmp_path / "cut"), tmp_path / "cut/kept", Shuffled(1, until))
    assert cut.was_interrupted
    workers = Shuffled(3)
    went_on = carried(resume(tmp_path / "cut/kept"), tmp_path / "cut/kept", workers)
    assert set_of(went_on) == set_of(expected)
    assert went_on.progress.resumed == until
    assert workers.count == expected.progress.runs - until


@pytest.mark.slow
def test_a_line_of_the_journal_that_was_cut_is_done_again(tmp_path: Path) -> None:
    expected = set_of(carried(begun(tmp_path), tmp_path / "kept", Shuffled(1)))
    journal = tmp_path / "kept/journal.jsonl"
    whole = journal.read_bytes()
    lines = whole.count(b"\n")
    for length in (len(whole) // 2, len(whole) - 1):
        journal.write_bytes(whole[:length])
        workers = Shuffled(2)
        assert set_of(carried(resume(tmp_path / "kept"), tmp_path / "kept", workers)) == expected
        assert workers.count == lines - whole[:length].count(b"\n")
        assert journal.read_bytes().count(b"\n") == lines


@pytest.mark.slow
def test_forged_and_older_lines_of_the_journal_are_done_again_and_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    expected = carried(begun(tmp_path), tmp_path / "kept", Shuffled(1))
    journal = tmp_path / "kept/journal.jsonl"
    lines = journal.read_bytes().splitlines()
    lines[1] = lines[1].replace(b'"passed"', b'"failed"') if b'"passed"' in lines[1] else lines[1][:9] + lines[1][11:]
    lines[3] = b"not a line \xff"
    lines[4] = lines[4].partition(b',"sum":')[0] + b"}"
    journal.write_bytes(b"\n".join(lines) + b"\n")
    workers = Shuffled(2)
    went_on = carried(resume(tmp_path / "kept"), tmp_path / "kept", workers)
    assert set_of(went_on) == set_of(expected)
    assert workers.count == 3
    assert went_on.progress.left_out.keys() == {2, 4, 5}
    assert went_on.as_json()["journal_left_out"] == {
        "2": "damaged or changed: its checksum does not hold", "4": "damaged",
        "5": "no checksum, as an earlier p2os wrote it",
    }  # fmt: skip
    with contextlib.suppress(typer.Exit):
        tell(went_on, None, json_output=False)
    assert f"{journal}: line 4: damaged; left out, what it told was run again" in capsys.readouterr().err
    assert "line 5: no checksum" in (tmp_path / "kept/report.html").read_text(encoding="utf-8")


def test_a_failure_whose_replay_has_another_hash_is_not_reported(tmp_path: Path) -> None:
    seen: dict[str, int] = {}

    def fickle(trial: Trial) -> Outcome:
        found, key = made_up(trial), trial.sha256
        seen[key] = seen.get(key, 0) + 1
        return found if seen[key] == 1 else Outcome(verdict=TrialVerdict.FAILED, sha256="another")

    whole = carried(begun(tmp_path), tmp_path / "kept", Shuffled(1, judge=fickle))
    assert whole.failures == []
    assert whole.counts[PointFinding.NOT_REPEATED] > 0
    assert not (tmp_path / "kept/failures").exists()


def test_what_the_cheap_run_alone_sees_is_no_failure(tmp_path: Path) -> None:
    def optimist(trial: Trial) -> Outcome:
        return Outcome(verdict=TrialVerdict.PASSED, sha256="1") if trial.table["mode"] == "adapter" else made_up(trial)

    whole = carried(begun(tmp_path), tmp_path / "kept", Shuffled(1, judge=optimist))
    assert whole.failures == []
    assert whole.counts[PointFinding.CHEAP_ONLY] > 0


def test_confirmations_end_with_their_budget(tmp_path: Path) -> None:
    whole = carried(begun(tmp_path, budget={"confirmations": 1}), tmp_path / "kept", Shuffled(1))
    assert sum(row.full is not None for row in whole.progress.rows) == 1
    assert whole.counts[PointFinding.UNCONFIRMED] > 0


def test_no_near_miss_takes_the_confirmation_that_a_failure_needs(tmp_path: Path) -> None:
    wanted = {"near_misses": 2, "budget": {"runs": 24, "confirmations": 24}}
    (tmp_path / "free").mkdir()
    free = carried(begun(tmp_path / "free", **wanted), tmp_path / "free/kept", Shuffled(1))
    failed = [row.number for row in free.progress.rows if row.cheap.outcome.verdict is TrialVerdict.FAILED]
    near = [row.number for row in free.progress.rows if row.full is not None and row.number not in failed]
    assert (len(failed) > 3, len(near)) == (True, 12), "two of each of six batches"
    for more in (-1, 0, 1):
        folder = tmp_path / str(more)
        folder.mkdir()
        campaign = begun(folder, **{**wanted, "budget": {"runs": 24, "confirmations": len(failed) + more}})
        whole = carried(campaign, folder / "kept", Shuffled(1))
        assert whole.counts[PointFinding.CONFIRMED] == len(failed) + min(more, 0)
        assert whole.counts.get(PointFinding.UNCONFIRMED, 0) == (more < 0)
        in_full = [row.number for row in whole.progress.rows if row.full is not None and row.number not in failed]
        assert in_full == near[: max(more, 0)], "the nearest, and of those alike the first"


def test_a_near_miss_that_fails_in_full_is_a_failure_wherever_it_is_told(tmp_path: Path) -> None:
    def pessimist(trial: Trial) -> Outcome:
        found = made_up(trial)
        by = int(found.sha256, 16) % 1000 / 1000
        if trial.table["mode"] == "direct":
            goal = GoalResult(kind="clearance", wanted="", met=True, says="", robustness=by, unit="m")
            return Outcome(verdict=TrialVerdict.PASSED, goals=(goal,), sha256=found.sha256)
        return Outcome(verdict=TrialVerdict.FAILED, failures=("clearance: ",), sha256=found.sha256)

    whole = carried(begun(tmp_path, budget={"confirmations": 2}), tmp_path / "kept", Shuffled(1, judge=pessimist))
    rows = whole.progress.rows
    nearest = [min(rows[at : at + 4], key=lambda row: row.cheap.margin or 0.0) for at in (0, 4, 8)]
    expected = sorted(row.number for row in sorted(nearest, key=lambda row: row.cheap.margin or 0.0)[:2])
    assert [row.number for row in whole.failures] == expected
    assert all((whole.results.failure_folder(row) / "dodge.toml").is_file() for row in whole.failures)
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(tmp_path / "kept/results").to_pylist()
    assert {entry["number"] for entry in table if entry["finding"] == "full only"} == set(expected)
    assert len(table) == sum(len(row.runs) for row in rows)
    assert [entry["number"] for entry in table] == sorted(entry["number"] for entry in table)


def test_points_that_were_one_run_are_said_to_be(tmp_path: Path) -> None:
    def alike(_: Trial) -> Outcome:
        return Outcome(verdict=TrialVerdict.PASSED, sha256="1")

    whole = carried(begun(tmp_path), tmp_path / "kept", Shuffled(1, judge=alike))
    assert "note    12 points made 1 different run: in the others nothing varied that acts" in [*_facts(whole, None)]
    assert whole.as_json()["different_runs"] == 1


def test_rates_are_of_different_runs_at_drawn_points_and_have_an_interval(tmp_path: Path) -> None:
    whole = carried(begun(tmp_path), tmp_path / "kept", Shuffled(1))
    rows = whole.progress.rows
    assert all(row.is_drawn for row in rows)
    failing = len({row.cheap.outcome.sha256 for row in whole.failures})
    rate = whole.rates["fail"]
    assert (rate.count, rate.of) == (failing, whole.different_runs)
    assert 0 < rate.bounds[0] < failing / whole.different_runs < rate.bounds[1] < 1
    page = (tmp_path / "kept/report.html").read_text(encoding="utf-8")
    assert f"{failing} of {whole.different_runs}: " in page
    whole.progress.rows += rows  # the same runs again
    assert whole.rates["fail"] == rate
    whole.progress.rows[:] = [replace(row, is_drawn=False) for row in rows]
    assert whole.rates == {}


@pytest.mark.parametrize(
    ("search", "drawn"),
    [("random", 16), ("sobol", 16), ("latin-hypercube", 16), ("grid", 0), ("tpe", 0), ("coverage", 7)],
)  # fmt: skip
def test_points_that_go_where_others_led_are_no_sample(search: str, drawn: int) -> None:
    if search == "tpe":
        pytest.importorskip("optuna")
    pytest.importorskip("scipy")
    found = SEARCHES[search](Problem(counts=(0, 0), is_ordered=(True, True), runs=16, batch=4, seed=1))
    points = []
    for _ in range(4):
        points += (asked := found.ask(4))
        found.tell([PointResult(margin=1.0, reached=frozenset({point})) for point in asked])
    assert sum(map(found.is_drawn, points)) == drawn


def test_each_failure_is_a_folder_that_runs_again_with_its_hash(tmp_path: Path) -> None:
    workers = Shuffled(1)
    whole = carried(begun(tmp_path), tmp_path / "kept", workers)
    assert sum(workers.anew) == len(whole.failures), "only what proves shares nothing"
    row = whole.failures[0]
    file = whole.results.failure_folder(row) / "dodge.toml"
    assert whole.results.replay(row) == f"p2os run {file}"
    assert row.failing is not None
    assert trial_of(str(file)).sha256 == row.failing.trial.sha256


def test_the_data_set_has_a_row_a_run_and_the_page_names_every_failure(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    whole = carried(begun(tmp_path), tmp_path / "kept", Shuffled(1))
    table = parquet.read_table(tmp_path / "kept/results").to_pylist()
    assert len(table) == sum(len(row.runs) for row in whole.progress.rows)
    failed = {entry["number"] for entry in table if entry["finding"] in {"confirmed", "full only"}}
    assert failed == {row.number for row in whole.failures}
    assert {entry["stage"] for entry in table} == {"cheap", "full", "replay"}
    assert all(entry["vary.threshold_m"] in {0.4, 0.6} for entry in table)
    page = ReadPage((tmp_path / "kept/report.html").read_text(encoding="utf-8"))
    plans = page.section("Failures")["blocks"]
    assert {plan["title"] for plan in plans} == {f"point {number}" for number in failed}
    assert all(plan["world"]["things"] and plan["ways"][0]["x"] for plan in plans)
    titles = [section["title"] for section in page.header["sections"]]
    assert titles[:3] == ["What came of it", "Failures", "What it cost"]
    assert page.header["why"].startswith(f"point {whole.failures[0].number}: ")
    (over, *_) = page.section("Margins over what varied")["blocks"]
    assert sum(len(curve["x"]) for curve in over["curves"]) == len(whole.progress.rows)


def test_until_when_failures_were_avoidable_is_reported_by_summary_and_page(tmp_path: Path) -> None:
    moment = LastMoment(failure="x", failed_ns=2 * 10**9, avoidable_ns=10**9, place=(1.0, 2.0, 30.0), printed="")
    whole = carried(begun(tmp_path), tmp_path / "kept", Shuffled(1), moment)
    failures = json.loads((tmp_path / "kept/summary.json").read_text())["failures"]
    assert {failure["avoidable"] for failure in failures[:MOST_MOMENTS]} == {moment.words}
    page = ReadPage((tmp_path / "kept/report.html").read_text(encoding="utf-8"))
    plans = [plan for plan in page.section("Failures")["blocks"] if "until 1.00 s, at x 1.00 m" in plan["text"]]
    assert len(plans) == len(whole.moments) > 0
    assert all(plan["places"] == [[1.0, 2.0, "last moment"]] for plan in plans)


WRONG = {
    'search = "random"': ('search = "genetic"', "genetic"),
    "threshold_m = [0.4, 0.6]": ("treshold_m = [0.4, 0.6]", "did you mean 'threshold_m'?"),
    'kind = "post"': ('kind = "pots"', "did you mean 'post'?"),
    "[[draw]]": ("[[drow]]", "did you mean 'draw'?"),
    "count = { from = 0, to = 2 }": ("count = { from = 2, to = 0 }", "to is below from"),
    "runs = 12": ("runs = 0", "at least 1"),
    'kind = "no_collision"': ('kind = "no_colision"', "did you mean 'no_collision'?"),
    'scenario = "dodge"': ('scenario = "doge"', "did you mean 'dodge'?"),
    'body = "kinematic"': ('bodies = "kinematic"', "bodies"),
}


@pytest.mark.parametrize("right", WRONG)
def test_what_is_wrong_in_a_file_is_reported_with_a_hint(right: str, tmp_path: Path) -> None:
    wrong, words = WRONG[right]
    file = tmp_path / "mine.toml"
    file.write_text(FILE.replace(right, wrong, 1))
    with pytest.raises(ScenarioError) as caught:
        load_campaign(file)
    assert words in f"{caught.value} ({caught.value.hint})"
    assert "mine.toml" in str(caught.value)


def test_the_schema_has_every_key_that_the_loader_takes() -> None:
    schema = campaign_schema()
    properties: dict[str, Any] = schema["properties"]  # type: ignore[assignment]  # an object
    assert set(properties) == {key.name for key in keys_of(CampaignTable)}
    assert set(properties["draw"]["items"]["properties"]) == {key.name for key in DRAW}
    assert schema["required"] == ["scenario"]
    json.dumps(schema)


@pytest.mark.parametrize("name", known_scenarios())
def test_what_new_writes_for_each_scenario_can_be_begun(name: str, tmp_path: Path) -> None:
    """A program that carries out a list keeps its goals and its start; one that roams meets things."""
    campaign = parse_campaign(suggested(load_scenario(name), name, "mine.toml"), tmp_path / "mine.toml")
    is_list = name in {"encoders", "motors", "rover", "sensors"}
    kinds = [goal["kind"] for goal in campaign.trial.table["goal"]]  # type: ignore[attr-defined]  # a list of tables
    drawn = [one.name for one in campaign.draws]
    assert drawn == ["in the way"] if name == "rover" else bool(drawn) is not is_list
    assert ("moves_on" in kinds) is not is_list
    assert {"crystal_ppm", "sram"} <= set(campaign.vary)
    assert ("duration_s" in campaign.vary) is not is_list
    # Faults act on a Pioneer's controller; a world that is another one for each seed has its start elsewhere.
    assert bool(campaign.disturbances) is (name in {"dodge", "dodge-duty", "free-drive"})
    assert ("seed" in campaign.vary) is (name not in {"two-dodge", "rover"})
    assert ("charge" in campaign.vary) is (name == "rover")
    assert ("answers" in kinds) is (name == "dodge"), "of its own goals those that hold in any world"
    assert (campaign.search, campaign.swarm) == ("coverage", 0.5)


def test_a_folder_that_is_taken_and_one_that_is_none_are_refused(tmp_path: Path) -> None:
    begun(tmp_path)
    with pytest.raises(UsageError, match="is not empty"):
        begun(tmp_path)
    with pytest.raises(FileError, match="is no campaign's folder"):
        resume(tmp_path)


def test_a_grid_takes_every_step_of_what_has_steps_and_as_many_as_may_be_of_the_rest() -> None:
    problem = Problem(counts=(3, 0), is_ordered=(True, True), runs=13, batch=4, seed=0)
    points = SEARCHES["grid"](problem).ask(100)
    assert len(points) == len(set(points)) == 12
    assert {point[0] for point in points} == {0.5 / 3, 1.5 / 3, 2.5 / 3}


@pytest.mark.slow
@pytest.mark.parametrize("search", ["cma-es", "tpe"])
def test_a_search_that_learns_comes_nearer_than_chance(search: str) -> None:
    problem = Problem(counts=(0,) * 5, is_ordered=(True,) * 5, runs=160, batch=16, seed=3)

    def least(name: str) -> float:
        asked, found = SEARCHES[name](problem), []
        for _ in range(10):
            margins = [sum((at - 0.8) ** 2 for at in point) for point in asked.ask(16)]
            asked.tell([PointResult(margin=one) for one in margins])
            found += margins
        return min(found)

    assert least(search) < least("random") / 2


def test_coverage_varies_what_reached_something_new(monkeypatch: pytest.MonkeyPatch) -> None:
    # What it begins with; to load what spreads that evenly takes a second.
    monkeypatch.setattr("robot_bench.campaign.search.sobol", SEARCHES["random"])
    problem = Problem(counts=(0,) * 8, is_ordered=(True,) * 8, runs=400, batch=8, seed=1)

    def reached(name: str) -> int:
        asked, seen = SEARCHES[name](problem), set[object]()
        for _ in range(40):
            points = asked.ask(8)
            steps = [
                frozenset(range(sum(at > 0.8 for at in itertools.takewhile(lambda x: x > 0.8, p)))) for p in points
            ]
            asked.tell([PointResult(margin=1.0, reached=frozenset(step)) for step in steps])
            seen |= frozenset().union(*steps)
        return len(seen)

    assert reached("coverage") > reached("random")


# Processes of this machine.


@pytest.fixture(scope="module")
def trials() -> list[Trial]:
    base = trial_of("dodge", settings=[("body", "kinematic"), ("mode", "direct"), ("duration_s", 1)])
    return [base.set(("start.x_m", at / 10), ("start.y_m", 0.0)) for at in range(3)]


def outcomes(workers: Processes, trials: Sequence[Trial]) -> dict[int, Outcome]:
    found: dict[int, Outcome] = {}
    workers.run(trials, lambda place, done: found.update({place: done[0]}))
    return found


def test_a_process_comes_to_what_this_one_comes_to(trials: list[Trial], monkeypatch: pytest.MonkeyPatch) -> None:
    warmed: list[Trial] = []
    monkeypatch.setattr(processes, "warm_up", lambda trial: (warmed.append(trial), warm_up(trial)))
    workers, frozen = Processes(2, RunLimits()), gc.get_freeze_count()
    found = outcomes(workers, trials)
    still = gc.get_freeze_count()  # a few of them have ended: what is kept is let go as anything else is
    assert still > 0.9 * frozen > 0, "what this process keeps out of the search for garbage stays out"
    other = trials[0].set(("mode", "adapter"))
    outcomes(workers, [trials[0], other])
    assert warmed == [trials[0], other], "what is loaded is not loaded again"
    assert [found[place].sha256 for place in range(3)] == [run_trial(trial).sha256 for trial in trials]


def test_a_process_that_was_killed_is_begun_again(trials: list[Trial], tmp_path: Path, monkeypatch) -> None:  # type: ignore[no-untyped-def]
    from robot_bench.campaign.workers import beginnings

    def dies_once(trial: Trial, look: Callable[[], None], start: object) -> Outcome:
        mark = tmp_path / trial.sha256
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return run_trial(trial, look)

    monkeypatch.setattr(beginnings, "run_trial", dies_once)
    found = outcomes(Processes(2, RunLimits()), trials)
    assert [found[place].verdict for place in range(3)] == [run_trial(trial).verdict for trial in trials]
    assert len(list(tmp_path.iterdir())) == 3


def test_a_process_does_some_trials_and_none_after_one_that_it_broke_at(trials: list[Trial], monkeypatch) -> None:  # type: ignore[no-untyped-def]
    from robot_bench.campaign.workers import beginnings

    def where(trial: Trial, look: Callable[[], None], start: object) -> Outcome:
        if trial.seed == 3:
            raise KeyError(trial.seed)
        return Outcome(verdict=TrialVerdict.PASSED, sha256=str(os.getpid()))

    monkeypatch.setattr(beginnings, "run_trial", where)
    monkeypatch.setattr(processes, "MOST_WORKS", 2)
    found = outcomes(Processes(1, RunLimits()), [trials[0].set(("seed", seed)) for seed in range(6)])
    pids = [found[place].sha256 for place in range(6)]
    assert pids[0] == pids[1] != pids[2]
    assert pids[4] == pids[5] not in pids[:4]
    assert found[3].failures == ("this is a bug: KeyError: 3",)


@pytest.mark.parametrize("while_it_waits", [True, False])
def test_a_process_that_is_killed_between_two_trials_loses_none(
    while_it_waits: bool, trials: list[Trial], monkeypatch: pytest.MonkeyPatch
) -> None:
    from robot_bench.campaign.workers import beginnings

    def where(trial: Trial, look: Callable[[], None], start: object) -> Outcome:
        return Outcome(verdict=TrialVerdict.PASSED, sha256=f"{trial.seed} {os.getpid()}")

    def killed(pipe: Connection, _parent: int) -> int | None:
        place: int | None = None if while_it_waits else pipe.recv()
        os.kill(os.getpid(), signal.SIGKILL)
        return place

    monkeypatch.setattr(beginnings, "run_trial", where)
    monkeypatch.setattr(processes, "_next_place", killed)
    found = outcomes(Processes(1, RunLimits()), [trials[0].set(("seed", seed)) for seed in range(3)])
    assert [found[place].sha256.split()[0] for place in range(3)] == ["0", "1", "2"]


@pytest.mark.slow
def test_a_run_that_takes_too_much_is_an_error_that_names_the_limit(trials: list[Trial], monkeypatch) -> None:  # type: ignore[no-untyped-def]
    from robot_bench.campaign.workers import beginnings

    def greedy(trial: Trial, look: Callable[[], None], start: object) -> Outcome:
        return Outcome(verdict=TrialVerdict.PASSED, sha256=str(len(bytearray(4 * 10**9))))

    def endless(trial: Trial, look: Callable[[], None], start: object) -> Outcome:
        while True:
            pass

    for job, words in (
        (greedy, "it was refused memory; it may take 64 MB"),
        (endless, "it took more than 1 s of a processor"),
    ):
        monkeypatch.setattr(beginnings, "run_trial", job)
        found = outcomes(Processes(1, RunLimits(cpu_s=1, memory_mb=64)), trials[:1])
        assert (found[0].verdict, found[0].failures) == (TrialVerdict.ERROR, (words,))


def test_conduct_ends_after_the_batch_in_which_its_virtual_hours_are_spent(tmp_path: Path) -> None:
    campaign = begun(tmp_path, budget={"virtual_hours": 3 / 3600})
    conduct = Conduct(campaign, tmp_path / "kept", Shuffled(1), clock=lambda: 0)
    assert len(conduct.run().rows) == 4


def test_minutes_that_are_over_leave_one_batch_of_near_misses(tmp_path: Path) -> None:
    campaign = begun(tmp_path, near_misses=4, budget={"minutes": 1.0, "runs": 16, "confirmations": 16})
    ticks = iter([0, 1, 2, 60 * 10**9, 60 * 10**9 + 1])
    conduct = Conduct(campaign, tmp_path / "kept", Shuffled(1), clock=lambda: next(ticks))
    rows = conduct.run().rows
    assert len(rows) == 12
    failed = sum(row.cheap.outcome.verdict is TrialVerdict.FAILED for row in rows)
    assert sum(row.full is not None for row in rows) == failed + 4 < 12


@pytest.mark.parametrize("is_reached", [True, False])
def test_what_has_to_be_reached_and_was_not_is_a_failure_of_the_campaign(
    is_reached: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def judge(trial: Trial) -> Outcome:
        happened = frozenset(trial.looks_for) if is_reached else frozenset()
        return replace(made_up(trial.with_lists(obstacle=[])), happened=happened)

    campaign = begun(tmp_path, FILE + '[[reach]]\nstate = "BACK_OUT"\n')
    whole = carried(campaign, tmp_path / "kept", Shuffled(1, judge=judge))
    assert whole.progress.reached == {"state BACK_OUT": list(range(1, 13)) if is_reached else []}
    page = (tmp_path / "kept" / "report.html").read_text()
    assert ("point 1 first, 12 of 12 points" in page) is is_reached
    assert "lines of source with code" in page
    if is_reached:
        tell(whole, None, json_output=False)
        return
    with pytest.raises(typer.Exit) as ended:
        tell(whole, None, json_output=False)
    assert ended.value.exit_code == 1
    assert "state BACK_OUT: no point has reached it" in capsys.readouterr().out


def test_what_reached_something_new_is_added_to_the_corpus(tmp_path: Path) -> None:
    campaign = begun(tmp_path, 'corpus = "mine.jsonl"\n' + FILE)
    whole = carried(campaign, tmp_path / "kept", Shuffled(1))
    new = [whole.space.coordinates(row.proposal.point) for row in whole.progress.rows if row.new]
    assert 0 < len(new) < len(whole.progress.rows)
    kept = read_corpus(tmp_path / "mine.jsonl")
    assert [list(map(float, at.values())) for at in kept] == [
        [pytest.approx(at[name], abs=1e-6) for name in sorted(at)] for at in new
    ]
