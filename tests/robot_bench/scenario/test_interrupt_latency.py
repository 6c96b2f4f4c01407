"""`interrupt_latency_cycles` of a scenario: a setting in the run's record, drawn by its seed, and replayed."""

import json
from pathlib import Path

import pytest

from robot_bench.campaign.trial import TrialVerdict, run_trial, trial_of
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
from robot_bench.wires.power_up import power_up
from simbase.timing import NS_PER_MS

SETTINGS = (("body", "kinematic"), ("duration_s", 1))


def test_a_latency_makes_another_run_that_comes_again_by_its_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "exact")
    base = trial_of("rover", settings=SETTINGS)
    late = base.set(("interrupt_latency_cycles", 12))
    hashes = [run_trial(one).sha256 for one in (base, late, late, late.set(("seed", 1)))]
    assert hashes[1] == hashes[2]
    assert len(set(hashes)) == 3


def test_the_seed_draws_how_late_each_interrupt_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "exact")
    program = load_scenario("rover").firmware

    def places(seed: int) -> list[int]:
        board, found = power_up(program, latency_cycles=1000, seed=seed), []
        for at in range(1, 2000):
            board.advance_to(at * NS_PER_MS // 200)
            found.append(board.pc)
        return found

    assert places(1) == places(1) != places(2)


def test_the_record_holds_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "exact")
    run_scenario(load_scenario("rover", settings=[*SETTINGS, ("interrupt_latency_cycles", 7)]), tmp_path / "run")
    meta = json.loads((tmp_path / "run" / "trace.jsonl").read_text(encoding="utf-8").splitlines()[0])
    assert meta["interrupt_latency_cycles"] == 7


def test_a_core_that_cannot_is_refused_with_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("P2OS_CORE", "native")
    done = run_trial(trial_of("rover", settings=[*SETTINGS, ("interrupt_latency_cycles", 1)]))
    assert done.verdict is TrialVerdict.ERROR
    assert "P2OS_CORE=exact" in done.failures[0]
