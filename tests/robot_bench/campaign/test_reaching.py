"""What points reach, what they have to, the corpus that is kept, and the features that a point turns off."""

import json
import random
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.analysis.observation import Observation
from bluepill_sim.board import BluePill
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.static_code import StaticCode
from p2os.errors import ScenarioError
from p2os.toml_record import read
from robot_bench.campaign.campaign_file import Campaign, Span, parse_campaign
from robot_bench.campaign.conduct import PointFinding, PointRow, Run, RunPurpose
from robot_bench.campaign.journal import outcome_of_plain, plain_of
from robot_bench.campaign.margin import margin
from robot_bench.campaign.reaching.corpus import BEGUN, MOST_KEPT, added, read_corpus, write_corpus
from robot_bench.campaign.reaching.reach import ToReachTable
from robot_bench.campaign.reaching.source import reach_of, source_reached
from robot_bench.campaign.search import Guided, PointResult, Problem
from robot_bench.campaign.space import ON, Space
from robot_bench.campaign.trial import Outcome, Trial, TrialVerdict, bench_of, run_trial, trial_of, unpacked
from robot_bench.campaign.whole import begin, resume
from simbase.errors import FileError

SHORT = [("mode", "direct"), ("duration_s", 6.0)]
FILE = """
scenario = "dodge"
search = "coverage"
batch = 4
corpus = "mine.jsonl"
swarm = 0.5
[budget]
runs = 8
[cheap]
duration_s = 4
[vary]
start.heading_deg = { from = 0, to = 350, step = 10 }
start.x_m = { from = 0.0, to = 0.3 }
threshold_m = [0.4]
[[draw]]
kind = "post"
count = 2
[[disturb]]
fault = "sonar-dead {sonar}"
sonar = { from = 1, to = 8 }
at_s = 1.0
[[goal]]
kind = "no_collision"
excused_by = ["sonar-dead"]
"""


@pytest.fixture(scope="module")
def dodge() -> Trial:
    return trial_of("dodge", settings=SHORT)


@pytest.fixture(scope="module")
def ran(dodge: Trial) -> Outcome:
    return run_trial(dodge)


def begun(folder: Path, text: str = FILE) -> Campaign:
    file = folder / "mine.toml"
    file.write_text(text)
    return parse_campaign(text, file)


# What was run ------------------------------------------------------------------------


def test_ways_that_the_core_notes_are_those_that_a_listener_counts(dodge: Trial) -> None:
    counted, noted = ran_both(dodge)
    assert {at: (bool(a), bool(b)) for at, (a, b) in counted.branches().items()} == {
        at: (bool(a), bool(b)) for at, (a, b) in noted.branches().items()
    }
    assert set(counted.instructions()) == set(noted.instructions())
    ways = [way for both in noted.branches().values() for way in both]
    assert 0 < sum(map(bool, ways)) < len(ways)  # both answers are there


@pytest.mark.slow
def test_the_core_in_python_notes_the_same_ways(dodge: Trial, monkeypatch: pytest.MonkeyPatch) -> None:
    native = run_trial(dodge.set(("duration_s", 0.3)))
    monkeypatch.setenv("P2OS_CORE", "python")
    python = run_trial(dodge.set(("duration_s", 0.3)))
    assert python.sha256 == native.sha256
    flash = {way for way in python.ways if 0x0800_0000 <= way < 0x0802_0000}
    assert flash == native.ways


def ran_both(trial: Trial) -> tuple[Coverage, Coverage]:
    """Return what a listener counts in a run, and what the core notes of it by itself."""
    with unpacked(trial.files) as folder:
        bench = bench_of(trial.scenario(folder))
    board = bench.chip
    assert isinstance(board, BluePill)
    counted = Coverage(board.image, read_lines(board.image), StaticCode(board.chip.memory))
    with Observation(board, [counted]):
        bench.run_until(bench.end)
    return counted, Coverage.of_board(board, board.entered_blocks, board.gone_ways)


def test_the_source_is_told_with_what_there_is(dodge: Trial, ran: Outcome) -> None:
    source = source_reached(dodge, ran.blocks, ran.ways)
    assert source is not None
    assert 0 < source.lines < source.lines_of
    assert 0 < source.ways < source.ways_of
    nothing = source_reached(dodge, (), ())
    assert nothing is not None
    assert (nothing.lines, nothing.lines_of, nothing.ways) == (0, source.lines_of, 0)
    unreached = dict(source.unreached())
    assert "dodge_fsm.c" in unreached  # six seconds reach no BACK_OUT


def test_states_are_lines_without_their_figures_and_what_followed_them() -> None:
    found = run_trial(trial_of("rover", settings=[("duration_s", 1.2)]))
    assert {"rover: ready, # mV", "rover: left # right # mm/s, # mV"} <= found.lines
    assert "rover: ready, # mV → rover: left # right # mm/s, # mV" in found.transitions


# What has to be reached --------------------------------------------------------------


def test_what_is_looked_for_changes_nothing_in_the_run(dodge: Trial, ran: Outcome) -> None:
    tables = [
        ToReachTable(state="CRUISE"),
        ToReachTable(text="dodge: ready"),
        ToReachTable(pin="PB12"),
        ToReachTable(text="no"),
    ]
    looking = replace(dodge, looks_for=tuple(table.words for table in tables))
    found = run_trial(looking)
    assert found.sha256 == ran.sha256
    assert looking.sha256 != dodge.sha256
    assert [reach_of(table, dodge).is_in(found) for table in tables] == [True, True, True, False]
    assert not run_trial(dodge).happened


def test_a_state_is_a_whole_word() -> None:
    words = ToReachTable(state="VEER").words.removeprefix("usart1 matches ")
    assert re.search(words, "CRUISE -> VEER 1")
    assert not re.search(words, "CRUISE -> VEER_LEFT 1")


def test_a_line_is_reached_where_a_block_with_it_was_entered(dodge: Trial, ran: Outcome) -> None:
    source = source_reached(dodge, ran.blocks, ran.ways)
    assert source is not None
    file = next(file for file in source.files if file.name.endswith("dodge_fsm.c"))
    said = {
        line: reach_of(ToReachTable(line=f"dodge_fsm.c:{line}"), dodge).is_in(ran) for line in sorted(file.lines)[::16]
    }  # fmt: skip
    assert said == {line: bool(file.lines[line]) for line in said}
    assert set(said.values()) == {True, False}


@pytest.mark.parametrize(
    ("table", "refusal"),
    [
        ({}, "one of line, state, pin and text"),
        ({"state": "A", "text": "B"}, "one of line, state, pin and text"),
        ({"line": "dodge_fsm.c"}, "no line of a file"),
        ({"line": "dodge_fsm.c:1"}, "gave no code"),
        ({"line": "dogde_fsm.c:90"}, "no code of"),
        ({"pin": "PB12", "level": "up"}, "level"),
    ],
)
def test_what_cannot_be_reached_is_refused(table: dict[str, object], refusal: str, dodge: Trial) -> None:
    with pytest.raises(ScenarioError, match=refusal):
        reach_of(read(ToReachTable, table, "[[reach]]"), dodge)


def test_robots_of_several_programs_have_no_line_to_reach(dodge: Trial, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Trial, "programs", property(lambda _: {"a.elf", "b.elf"}))
    with pytest.raises(ScenarioError, match=r"line 'a\.c:9': robots of several programs have no one line"):
        reach_of(ToReachTable(line="a.c:9"), dodge)
    assert reach_of(ToReachTable(text="ready"), dodge).words
    assert source_reached(dodge, (), ()) is None


# The corpus --------------------------------------------------------------------------

COORDINATES = st.dictionaries(st.text(min_size=1), st.floats(0, 0.999), max_size=4)


@settings(max_examples=15)
@given(st.lists(COORDINATES, max_size=5), st.lists(COORDINATES, max_size=5))
def test_a_corpus_is_read_as_it_was_written(tmp_path_factory: pytest.TempPathFactory, held, new) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path_factory.mktemp("corpus") / "c.jsonl"
    write_corpus(path, held)
    assert list(read_corpus(path)) == held
    both = added(held, new)
    assert added(both, new) == both  # nothing is held twice


def test_of_too_many_points_the_oldest_go() -> None:
    held = [{"a": number / 1000} for number in range(MOST_KEPT)]
    assert added(held, [{"a": 0.9}]) == [*held[1:], {"a": 0.9}]
    assert added(held[:-1], [{"a": 0.9}]) == [*held[:-1], {"a": 0.9}]


@pytest.mark.parametrize("line", ["", "{}", '{"corpus": 2}', '{"corpus": 1}\n{"at": {"a": 1}}', '{"corpus": 1}\n[1]'])
def test_a_file_that_is_no_corpus_is_refused_with_its_line(line: str, tmp_path: Path) -> None:
    (tmp_path / "c.jsonl").write_text(f"{line}\n")
    with pytest.raises(FileError, match="corpus"):
        read_corpus(tmp_path / "c.jsonl")


def test_a_search_begins_with_its_corpus_and_spends_half_of_its_runs_on_it_at_most() -> None:
    pytest.importorskip("scipy")
    corpus = tuple((number / 16, 0.5) for number in range(8))
    search = Guided(Problem(counts=(0, 0), is_ordered=(True, True), runs=8, batch=4, seed=0, corpus=corpus))
    assert search.ask(4) == list(corpus[-4:])
    assert not set(search.ask(4)) & set(corpus)


def test_only_what_acted_is_varied(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("scipy")
    monkeypatch.setattr(Guided, "NEW_EVERY", 10**6)
    search = Guided(Problem(counts=(0,) * 6, is_ordered=(True,) * 6, runs=64, batch=1, seed=1))
    first = search.ask(1)[0]
    search.tell([PointResult(margin=1.0, reached=frozenset({1}), acting=frozenset({2, 4}))])
    varied = search.ask(40)
    assert {at for point in varied for at in range(6) if point[at] != first[at]} == {2, 4}


@pytest.mark.parametrize(("is_excused", "least", "most"), [(False, 0.5, 1.0), (True, 0.02, 0.07)])
def test_what_is_excused_is_varied_only_while_it_is_little(is_excused: bool, least: float, most: float) -> None:
    pytest.importorskip("scipy")
    search = Guided(Problem(counts=(0, 0), is_ordered=(True, True), runs=240, batch=16, seed=1))
    asked = excused = 0
    for _ in range(15):
        points = search.ask(16)
        # As a thing that is drawn in few of the points: it reaches something new each time, and stays in variations.
        answers = [
            PointResult(
                margin=1.0, reached=frozenset({point if point[0] > 0.97 else 0}), acting=frozenset({1}),
                is_excused=is_excused and point[0] > 0.97,
            )
            for point in points
        ]  # fmt: skip
        search.tell(answers)
        asked, excused = asked + 16, excused + sum(point[0] > 0.97 for point in points)
    assert least <= excused / asked <= most


def test_a_campaign_goes_on_with_the_corpus_that_it_was_begun_with(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(FILE)
    write_corpus(tmp_path / "mine.jsonl", [{"start.x_m": 0.25}])
    begin(tmp_path / "mine.toml", tmp_path / "kept", firmware=None, overrides={})
    write_corpus(tmp_path / "mine.jsonl", [{"start.x_m": 0.75}])  # another campaign has added to it
    campaign = resume(tmp_path / "kept")
    assert campaign.corpus == ({"start.x_m": 0.25},)
    assert campaign.corpus_file is not None
    assert campaign.corpus_file.resolve() == (tmp_path / "mine.jsonl").resolve()
    assert (tmp_path / "kept" / BEGUN).is_file()
    space = Space(campaign)
    point = space.point({"start.x_m": 0.25, "no such dimension": 0.9})
    assert space.coordinates(point)["start.x_m"] == 0.25


# Swarm -------------------------------------------------------------------------------


def test_each_feature_is_turned_off_in_half_of_the_points_and_tables_go_together(tmp_path: Path) -> None:
    space, source = Space(begun(tmp_path)), random.Random(1)
    on: Counter[str] = Counter()
    for _ in range(200):
        found = space.proposal(tuple(source.random() for _ in space.dimensions))
        keys = [key for key, _ in found.settings]
        assert ("start.x_m" in keys) is ("start.heading_deg" in keys)
        on.update({"start": "start.x_m" in keys, "threshold": "threshold_m" in keys})
        on.update({"post": bool(found.obstacles), "fault": bool(found.faults)})
        assert found.disturbed_by == ({"sonar-dead"} if found.faults else set())
    assert all(70 < on[name] < 130 for name in ("start", "threshold", "post", "fault")), on


def test_at_its_share_a_feature_is_on_and_just_below_it_is_off(tmp_path: Path) -> None:
    space = Space(begun(tmp_path))
    for at, is_on in ((0.5, True), (0.5 - 1e-9, False)):
        point = tuple(at if one.name == f"post{ON}" else spread(n) for n, one in enumerate(space.dimensions))
        assert bool(space.proposal(point).obstacles) is is_on


def spread(number: int) -> float:
    """Return coordinates of which no two are near each other, above a half."""
    return 0.5 + number * 0.618 % 0.5


def test_without_a_swarm_everything_is_on_and_no_dimension_is_added(tmp_path: Path) -> None:
    space = Space(begun(tmp_path, FILE.replace("swarm = 0.5\n", "")))
    assert not [one.name for one in space.dimensions if one.name.endswith(ON)]
    found = space.proposal(tuple(map(spread, range(len(space.dimensions)))))
    assert len(found.obstacles) == 2
    assert len(found.faults) == 1


@pytest.mark.parametrize(("at", "value"), [(0.0, 2.0), (0.25, 2.4615), (0.5, 3.2), (0.75, 4.5714), (1.0, 8.0)])
def test_a_long_tail_is_the_inverse_of_its_distribution(at: float, value: float) -> None:
    """A bounded Pareto of exponent 1: below a value lies (1 - low / value) / (1 - low / high) of it."""
    assert Span(2.0, 8.0, is_long_tailed=True).value(at) == value


def test_a_long_tail_is_as_rare_as_it_is_long() -> None:
    span = Span(60, 900, 1, is_whole=True, is_long_tailed=True)
    drawn = sorted(int(str(span.value((number + 0.5) / 1000))) for number in range(1000))
    assert drawn[0] == 60
    assert 850 < drawn[-1] <= 900
    assert 100 < drawn[500] < 125
    assert sum(value > 300 for value in drawn) == pytest.approx(143, abs=3)


@pytest.mark.parametrize(
    ("right", "wrong", "refusal"),
    [
        ("to = 0.3 }", 'to = 0.3, tail = "long" }', "begin above 0"),
        (
            'excused_by = ["sonar-dead"]',
            'excused_by = ["sonar-ded"]',
            "there is no .* 'sonar-ded'",
        ),
        ("swarm = 0.5", 'swarm = 0.5\nkeeps = ["answer"]', "the scenario has no goal 'answer'"),
        ("swarm = 0.5", "swarm = 1.0", "swarm"),
        ("[budget]", '[[reach]]\nline = "dodge_fsm.c:1"\n[budget]', "gave no code"),
    ],
)
def test_what_is_wrong_in_a_file_is_refused(right: str, wrong: str, refusal: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=refusal):
        begun(tmp_path, FILE.replace(right, wrong))


# Excused -----------------------------------------------------------------------------


def test_a_goal_that_does_not_judge_is_told_apart() -> None:
    crash = [
        {"at_s": 0, "name": "post", "shape": "cylinder", "radius_m": 0.05, "height_m": 0.5, "x_m": 0.33, "y_m": 0.0}
    ]
    goals = [{"kind": "min_distance", "distance_m": 50.0, "excused_by": ["a post"]}]
    trial = trial_of("dodge", settings=SHORT).with_lists(obstacle=crash, goal=goals)
    judged, excused = (run_trial(replace(trial, disturbed_by=frozenset({name}))) for name in ("a wall", "a post"))
    assert judged.verdict is TrialVerdict.FAILED
    assert excused.verdict is TrialVerdict.PASSED
    assert not excused.failures
    assert [goal.kind for goal in excused.excused_goals] == ["min_distance"]
    assert excused.sha256 == judged.sha256
    assert (margin(judged) or 0.0) < 0 < (margin(excused) or 0.0)
    assert outcome_of_plain(json.loads(json.dumps(plain_of(excused)))) == excused
    assert row_of(excused).finding is PointFinding.EXCUSED
    assert row_of(judged).finding is PointFinding.UNCONFIRMED


def test_the_scenario_of_a_failure_says_which_goals_do_not_judge_it(dodge: Trial, tmp_path: Path) -> None:
    goals = [
        {"kind": "min_distance", "distance_m": 50.0, "excused_by": ["a post"]},
        {"kind": "usart_lacks", "text": "dodge", "excused_by": ["a wall"]},
    ]
    trial = replace(dodge.with_lists(goal=goals), disturbed_by=frozenset({"a post"}))
    path = trial.write(tmp_path / "kept")
    again = trial_of(str(path))
    found = run_trial(again)
    assert found == run_trial(trial)
    assert [goal.kind for goal in found.excused_goals] == ["min_distance"]
    bench = bench_of(again.scenario(tmp_path / "kept"))
    bench.run_until(bench.end)
    judged = bench.judge()
    assert [one.partition(":")[0] for one in judged.missed] == ["usart_lacks"]
    assert "excused, " in judged.not_judged[0]


def test_a_goal_may_be_excused_by_what_is_drawn_and_of_the_scenarios_own_some_are_kept(tmp_path: Path) -> None:
    text = FILE.replace("swarm = 0.5", 'keeps = ["answers"]').replace('["sonar-dead"]', '["post"]')
    campaign = begun(tmp_path, text)
    own = trial_of("dodge").table["goal"]
    kept = [{**goal, "ends_run": "missed"} for goal in own if goal["kind"] == "answers"]  # type: ignore[attr-defined]  # a list of tables
    assert campaign.trial.table["goal"] == [*kept, {"kind": "no_collision", "excused_by": ["post"]}]
    space = Space(campaign)
    found = space.proposal(tuple(map(spread, range(len(space.dimensions)))))
    assert found.disturbed_by == {"post"}
    assert found.trial(campaign.trial, ()).disturbed_by == {"post"}


def row_of(outcome: Outcome) -> PointRow:
    """Return a row of a point whose cheap run came to an outcome."""
    trial = Trial(name="x", table={}, files={})
    return PointRow(1, None, Run(RunPurpose.CHEAP, trial, outcome, 0.0))  # type: ignore[arg-type]  # nobody looks


def test_an_outcome_of_an_earlier_version_is_read(ran: Outcome) -> None:
    plain = plain_of(ran)
    older = {key: value for key, value in plain.items() if key not in {"ways", "transitions", "happened"}}
    older["goals"] = [row[:-1] for row in plain["goals"]]  # type: ignore[attr-defined]  # a list
    found = outcome_of_plain(older)
    assert found == replace(ran, ways=frozenset(), transitions=frozenset(), happened=frozenset())
