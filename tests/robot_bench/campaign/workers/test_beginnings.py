"""Runs that share a beginning go on from a saved state of it: the same outcome as from the start, for less."""

import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import cast

import pytest

from robot_bench.bench import run_of
from robot_bench.campaign.campaign_file import RunLimits
from robot_bench.campaign.trial import Outcome, Trial, TrialVerdict, bench_of, run_trial, trial_of, unpacked
from robot_bench.campaign.workers.beginnings import (
    EACH_NS,
    LEAST_NS,
    MOST_KEPT,
    Beginnings,
    SavedBeginning,
    Task,
    Work,
    Worked,
)
from robot_bench.campaign.workers.processes import Processes
from simbase.errors import UsageError
from simbase.timing import NS_PER_S

Done = tuple[Outcome, float]


@pytest.fixture(scope="module")
def base() -> Trial:
    return trial_of("dodge", settings=[("body", "kinematic"), ("duration_s", 9)])


def stuck(at_s: float, sonar: int = 4, for_s: float = 1.0) -> dict[str, object]:
    return {"at_s": at_s, "fault": f"sonar-stuck {sonar} 0.3", "for_s": for_s}


def post(at_s: float, **more: object) -> dict[str, object]:
    shape = {"name": "late", "shape": "cylinder", "radius_m": 0.1, "height_m": 0.5}
    return {**shape, "at_s": at_s, "before_sonar": 4, "distance_m": 0.5, **more}


class Counted:
    """Does work in this process, and keeps what it was asked for."""

    def __init__(self) -> None:
        self.works: list[Work] = []

    def __call__(self, works: Sequence[Work], on_worked: Callable[[int, Worked], None]) -> None:
        self.works += works
        for place, work in enumerate(works):
            on_worked(place, (work(lambda: None), 1.0))

    @property
    def tasks(self) -> list[tuple[int, int]]:
        """Of each beginning that was run, where it went on and how far, both in nanoseconds."""
        return [(0 if one.start is None else one.start.at, one.until) for one in self.works if isinstance(one, Task)]

    @property
    def starts(self) -> list[int]:
        """Where each trial began, nanoseconds."""
        given = [one.keywords["start"] for one in self.works if not isinstance(one, Task)]  # type: ignore[attr-defined]  # a partial
        return [0 if start is None else start.at for start in given]


def outcomes(trials: Sequence[Trial], kept: Beginnings, do: Counted, *, anew: bool = False) -> list[Outcome]:
    found: dict[int, Outcome] = {}
    kept.run(trials, lambda place, done: found.update({place: done[0]}), do, anew=anew)
    return [found[place] for place in range(len(trials))]


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["direct", "adapter"])
def test_what_goes_on_from_a_shared_beginning_comes_to_the_same_in_every_part(base: Trial, mode: str) -> None:
    source, base = random.Random(mode), base.set(("mode", mode), ("duration_s", 5.6))
    trials = []
    for number in range(4):
        at_s = round(source.uniform(4.01, 5.5), 3)
        if mode == "direct" or number % 2:
            late = post(at_s, **{"hold_s": 0.7} if number > 1 else {})
            trials.append(base.with_lists(obstacle=[late]))
        else:
            trials.append(base.with_lists(fault=[stuck(1.0), stuck(at_s, 5, 2.0)]))
    do = Counted()
    shared = outcomes(trials, Beginnings(), do)
    assert min(do.starts) > 0
    assert shared == [run_trial(trial) for trial in trials]
    assert len({one.sha256 for one in shared}) == len(trials)


@pytest.mark.slow
def test_processes_share_what_trials_share_and_replays_share_nothing(base: Trial) -> None:
    trials = [base.set(("duration_s", 5)).with_lists(fault=[stuck(at_s)]) for at_s in (4.3, 4.5, 4.7)]
    found: list[dict[int, Done]] = [{}, {}]
    for anew, into in zip((False, True), found, strict=True):
        Processes(2, RunLimits()).run(trials, lambda place, done, into=into: into.update({place: done}), anew=anew)  # type: ignore[misc]
    shared, alone = ([one[place] for place in range(3)] for one in found)
    assert [done[0] for done in shared] == [done[0] for done in alone]


def test_two_that_differ_late_share_a_run_and_one_alone_shares_nothing(base: Trial) -> None:
    do = Counted()
    early, late, other = (base.with_lists(fault=[stuck(at_s)]) for at_s in (5.0, 8.5, 8.5))
    elsewhere = other.set(("threshold_m", 0.3))
    found = outcomes([early, late, elsewhere], Beginnings(), do)
    assert do.tasks == [(0, 8_499_999_999)]
    assert [at // EACH_NS for at in do.starts] == [2, 4, 0]
    assert [one.verdict for one in found] != [TrialVerdict.ERROR] * 3


def test_what_happens_too_soon_is_run_from_the_start(base: Trial) -> None:
    short = base.set(("duration_s", 5))
    for at_s, begins in ((LEAST_NS / NS_PER_S, 0), (LEAST_NS / NS_PER_S + 1e-3, 1)):
        do = Counted()
        outcomes([short.with_lists(fault=[stuck(at_s, sonar)]) for sonar in (1, 8)], Beginnings(), do)
        assert [at > 0 for at in do.starts] == [bool(begins)] * 2


def test_a_beginning_is_kept_for_the_batches_to_come_and_run_on_where_it_ends(base: Trial) -> None:
    kept, do = Beginnings(), Counted()
    outcomes([base.with_lists(fault=[stuck(at_s)]) for at_s in (4.5, 5.0)], kept, do)
    outcomes([base.with_lists(fault=[stuck(at_s)]) for at_s in (4.7, 8.2)], kept, do)
    assert [(begun // EACH_NS, until // EACH_NS) for begun, until in do.tasks] == [(0, 2), (2, 4)]
    outcomes([base.with_lists(fault=[stuck(6.5)])], kept, do)
    assert len(do.tasks) == 2
    assert [at // EACH_NS for at in do.starts] == [2, 2, 2, 4, 3]
    outcomes([base.with_lists(fault=[stuck(6.5)])], kept, do, anew=True)
    assert do.starts[-1] == 0


def test_a_run_that_ends_before_its_own_event_comes_to_the_same(base: Trial) -> None:
    goal = {"kind": "moves_on", "way_m": 5.0, "within_s": 5.0, "ends_run": "missed"}
    trials = [base.with_lists(goal=[goal], fault=[stuck(at_s)]) for at_s in (8.2, 8.6)]
    do = Counted()
    found = outcomes(trials, Beginnings(), do)
    assert [at // EACH_NS for at in do.starts] == [2, 2], "it ended after 5 s"
    assert found[0] == found[1] == run_trial(trials[0])
    assert found[0].virtual_ns < 6 * NS_PER_S


def test_a_beginning_that_cannot_be_is_reported_by_each_trial(base: Trial) -> None:
    nowhere = base.set(("start", {"x_m": 50.0, "y_m": 0.0, "heading_deg": 0.0}))
    found = outcomes([nowhere.with_lists(fault=[stuck(at_s)]) for at_s in (7.0, 8.0)], Beginnings(), Counted())
    assert [one.verdict for one in found] == [TrialVerdict.ERROR] * 2
    assert "start" in found[0].failures[0]


def test_robots_that_share_a_world_share_no_beginning() -> None:
    two = trial_of("two-dodge", settings=[("duration_s", 1), ("body", "kinematic")])
    late = [two.with_lists(obstacle=[post(5.0, before_sonar=number)]) for number in (1, 2)]
    do = Counted()
    outcomes(late, Beginnings(), do)
    assert do.starts == [0, 0]


def test_no_more_beginnings_are_kept_than_some(base: Trial, monkeypatch: pytest.MonkeyPatch) -> None:
    made = SavedBeginning(EACH_NS * 2, b"")
    passed = Outcome(verdict=TrialVerdict.PASSED)
    monkeypatch.setattr(Task, "__call__", lambda *_: [made])
    monkeypatch.setattr("robot_bench.campaign.workers.beginnings.run_trial", lambda *_, **__: passed)
    kept = Beginnings()
    for seed in range(MOST_KEPT + 1):
        outcomes([replace(base, seed=seed).with_lists(fault=[stuck(5.0, sonar)]) for sonar in (1, 2)], kept, Counted())
    assert len(cast("dict[str, object]", kept._kept)) == MOST_KEPT


def test_a_state_of_another_run_is_refused(base: Trial) -> None:
    """Until then something else has happened here, or is about to, or the world is another."""
    with unpacked(base.files) as folder:
        states = {}
        for name, faults in (("early", [stuck(1.0)]), ("none", [])):
            bench = bench_of(base.with_lists(fault=faults).scenario(folder))
            bench.run_until(2 * NS_PER_S)
            states[name] = bench.snapshot(), bench.now
        now = states["none"][1]
        for name, faults in (
            ("early", []), ("none", [stuck(1.0)]), ("early", [stuck(1.0, 5)]),
            ("early", [stuck(1.0), stuck(now / NS_PER_S)]),
        ):  # fmt: skip
            other = bench_of(base.with_lists(fault=faults).scenario(folder))
            with pytest.raises(UsageError, match="until 2 s something else happens here"):
                run_of(other).begin_as(*states[name])
        later = bench_of(base.with_lists(fault=[stuck(1.0), stuck((now + 1) / NS_PER_S)]).scenario(folder))
        run_of(later).begin_as(*states["early"])
        with pytest.raises(UsageError, match="another threshold"):
            run_of(bench_of(base.set(("threshold_m", 0.3)).scenario(folder))).begin_as(*states["none"])


def test_robots_in_one_world_are_not_begun_elsewhere() -> None:
    two = trial_of("two-dodge", settings=[("duration_s", 1), ("body", "kinematic")])
    with unpacked(two.files) as folder:
        bench = bench_of(two.scenario(folder))
        with pytest.raises(UsageError, match="begin at the beginning"):
            run_of(bench).begin_as(bench.snapshot(), 0)
