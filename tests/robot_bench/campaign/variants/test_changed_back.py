"""Which source line makes trials fail, by changing the program back."""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from bluepill_sim.program.mutants import Mutant, mutants, mutated_file
from robot_bench.campaign.trial import Trial
from robot_bench.campaign.variants.changed_back import (
    LEAST,
    LEAST_FAILING,
    MOST_PASSING,
    ChangedBack,
    FailingRun,
    failing_and_passing,
)
from robot_bench.campaign.variants.fault_line import image_of
from robot_bench.campaign.whole import points_of
from simbase.errors import UsageError
from tests.robot_bench.campaign.variants.test_fault_line import SHORT, good, with_changed_branch

__all__ = ["SHORT", "good"]


@pytest.fixture(scope="module")
def inverted(good: Trial) -> tuple[Trial, str]:
    """Return the trial with a program that a single change mends, and the line of that."""
    return with_changed_branch(good, "beq")


@pytest.fixture(scope="module")
def run(inverted: tuple[Trial, str]) -> FailingRun:
    return FailingRun(inverted[0], time.process_time_ns, lambda: None)


def is_mended(good: Trial) -> Callable[[Trial], bool]:
    return lambda one: one.files["dodge.elf"] == good.files["dodge.elf"]


def changed_back(
    trial: Trial, ran: tuple[int, ...], passes: Callable[[Trial], bool], *, failing: int = LEAST_FAILING,
    passing: int = LEAST - LEAST_FAILING,
) -> ChangedBack:  # fmt: skip
    """Return the search in instructions, whose trials are all but one made up."""
    trials = [replace(trial, seed=seed) for seed in range(failing + passing)]
    content, image = trial.files["dodge.elf"], image_of(trial)

    def first(change: Mutant) -> bool:
        return passes(trial.with_firmware(mutated_file(content, change, image)))

    return ChangedBack(trials[:failing], trials[failing:], ran, first, passes)


@pytest.fixture(scope="module")
def near(inverted: tuple[Trial, str], good: Trial) -> tuple[int, ...]:
    """Return some instructions that ran, the changed one among them."""
    start = image_of(good).symbols.address_of("drive_on")
    assert start is not None
    return tuple(range(start & ~1, (start & ~1) + 60, 2))


def test_the_one_change_that_undoes_a_fault_names_its_line(
    good: Trial, inverted: tuple[Trial, str], near: tuple[int, ...]
) -> None:  # fmt: skip
    trial, line = inverted
    looked = changed_back(trial, near, is_mended(good))
    assert [*looked.look()] == [*range(1, looked.count + 1)]
    assert looked.result.line == line
    assert len(looked.found) == 1
    assert f"{LEAST_FAILING} failing points pass and none of {LEAST - LEAST_FAILING} passing" in looked.result.says


@pytest.mark.parametrize(
    ("failing", "passing", "is_enough"),
    [(LEAST_FAILING, LEAST - LEAST_FAILING, True), (LEAST, 0, True), (LEAST_FAILING, LEAST - LEAST_FAILING - 1, False),
     (LEAST_FAILING - 1, LEAST, False)],
)  # fmt: skip
def test_too_few_points_judge_no_change(
    failing: int, passing: int, is_enough: bool, inverted: tuple[Trial, str], good: Trial, near: tuple[int, ...]
) -> None:  # fmt: skip
    looked = changed_back(inverted[0], near, is_mended(good), failing=failing, passing=passing)
    assert bool([*looked.look()]) is is_enough
    assert ("too few to judge" in looked.result.says) is not is_enough


def test_what_several_lines_mend_or_none_or_there_was_no_time_for_is_unknown(
    inverted: tuple[Trial, str], near: tuple[int, ...]
) -> None:
    trial, _ = inverted
    several = changed_back(trial, near, lambda _: True)
    [*several.look()]
    assert several.result.line == ""
    assert "more than one line" in several.result.says
    assert several.tried < several.count  # it is known from there on
    none = changed_back(trial, near, lambda _: False)
    next(none.look())
    assert "the time was over" in none.result.says
    [*none.look()]
    assert none.result.line == ""
    assert "none makes it pass" in none.result.says


@pytest.mark.parametrize("seed", range(1, LEAST))
def test_a_change_after_which_another_point_fails_is_none(
    seed: int, good: Trial, inverted: tuple[Trial, str], near: tuple[int, ...]
) -> None:  # fmt: skip
    mended = is_mended(good)
    looked = changed_back(inverted[0], near, lambda one: mended(one) and one.seed != seed)
    [*looked.look()]
    assert (looked.found, looked.result.line) == ([], "")


@pytest.mark.slow
def test_of_the_first_failing_trial_a_run_tells_which_changes_make_it_pass(
    run: FailingRun, good: Trial, inverted: tuple[Trial, str]
) -> None:  # fmt: skip
    trial, _ = inverted
    content, image = trial.files["dodge.elf"], image_of(trial)
    changes = mutants(image, run.ran)
    undoes = next(one for one in changes if mutated_file(content, one, image) == good.files["dodge.elf"])
    at = changes.index(undoes)
    found = {one.address: run(one) for one in changes[at - 3 : at + 1]}
    assert found.pop(undoes.address)
    assert not any(found.values())
    assert run(undoes)  # no run has left anything behind


@pytest.mark.slow
def test_the_points_of_a_campaign_are_those_of_its_journal(tmp_path: Path) -> None:
    from tests.robot_bench.campaign.test_campaign import Shuffled, begun, carried

    whole = carried(begun(tmp_path), tmp_path / "kept", Shuffled(1))
    rows = points_of(tmp_path / "kept")
    assert [row.cheap.outcome.sha256 for row in rows] == [row.cheap.outcome.sha256 for row in whole.progress.rows]
    failing, passing = failing_and_passing(rows)
    assert failing[0] in [row.cheap.trial for row in whole.failures]
    assert 0 < len(passing) <= MOST_PASSING
    times = [row.cheap.outcome.virtual_ns for row in rows if row.cheap.trial in failing]
    assert min(times) == next(row.cheap.outcome.virtual_ns for row in rows if row.cheap.trial == failing[0])
    twice, _ = failing_and_passing([*rows, *rows])
    assert twice == failing  # the same run counts once
    with pytest.raises(UsageError, match="nothing fails"):
        failing_and_passing([row for row in rows if row not in rows])
