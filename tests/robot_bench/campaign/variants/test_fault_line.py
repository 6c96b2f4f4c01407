"""Which source line makes a trial fail: by a version that passes, and by changing the program back."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from bluepill_sim.program.image import load_image
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.mutants import mutants, mutated_file
from bluepill_sim.program.version_difference import LineDifference
from robot_bench.campaign.trial import Trial, trial_of
from robot_bench.campaign.variants.against import Other
from robot_bench.campaign.variants.fault_line import (
    LEAST_PASSING,
    MOST_LINES,
    ChangedBack,
    by_version,
    failing_and_passing,
    place_of,
)
from robot_bench.campaign.whole import points_of
from robot_bench.firmware.build import HERE
from simbase.errors import UsageError

SHORT = [("mode", "direct"), ("duration_s", 5.0)]
GOAL = {"kind": "answers", "any_high": ["DD4", "DD5"], "signal": "mean", "most": 0, "within_s": 0.1}
WALL = {
    "at_s": 0, "name": "wall", "shape": "box", "x_m": 0.9, "y_m": 0.0, "length_m": 0.1, "width_m": 2.0, "height_m": 0.5,
}  # fmt: skip


@pytest.fixture(scope="module")
def good() -> Trial:
    return trial_of("dodge", settings=SHORT).with_lists(obstacle=[WALL], goal=[GOAL])


def changed(good: Trial, after: str) -> tuple[Trial, str]:
    """Return the trial with the first `bne` of `drive_on` as another instruction, and the line that it is of."""
    image = load_image(HERE / "dodge.elf")
    start = image.symbols.address_of("drive_on")
    assert start is not None
    inside = mutants(image, range(start & ~1, start + 200, 2))
    change = next(
        one for one in inside if one.alteration.before.startswith("bne") and one.alteration.after.startswith(after)
    )
    content = mutated_file(good.files["dodge.elf"], change, image)
    return good.with_firmware(content), read_lines(image).place(change.address)


@pytest.fixture(scope="module")
def wrong(good: Trial) -> tuple[Trial, str]:
    """Return the trial with a program that drives on where it should turn."""
    return changed(good, "nop")


@pytest.fixture(scope="module")
def inverted(good: Trial) -> tuple[Trial, str]:
    """Return it with one that a single change undoes."""
    return changed(good, "beq")


@pytest.mark.slow
def test_the_line_by_which_a_version_that_passes_differs(good: Trial, wrong: tuple[Trial, str]) -> None:
    trial, line = wrong
    found = by_version(trial, Other("good.elf", good.files["dodge.elf"]))
    assert (found.line, found.says) == (line, "good.elf passes, and differs there alone")
    assert found.also[0].startswith("answers: the motors had")
    assert found.also[1].startswith("they part at ")
    assert found.text.startswith(f"cause: {line}: good.elf passes")


@pytest.mark.slow
def test_only_a_version_that_passes_tells_of_one_that_fails(good: Trial, wrong: tuple[Trial, str]) -> None:
    trial, _ = wrong
    with pytest.raises(UsageError, match="does not fail here"):
        by_version(good, Other("good.elf", good.files["dodge.elf"]))
    with pytest.raises(UsageError, match=r"bad\.elf does not pass either: answers"):
        by_version(trial, Other("bad.elf", trial.files["dodge.elf"]))


def lines(function: str, ours: list[int], theirs: list[int], file: str = "a.c") -> LineDifference:
    return LineDifference(function, tuple((file, one) for one in ours), tuple((file, one) for one in theirs))


@pytest.mark.parametrize(
    ("found", "place"),
    [
        ([lines("f", [3], [3])], "a.c:3"),
        ([lines("f", [], [7])], "a.c:7"),
        ([lines("f", [3], [3]), lines("f", [9], [9])], "a.c:3, 9"),
        ([lines("f", [3], [3]), lines("f", [5], [5, 6])], "a.c:5-6"),  # one that has no code any more counts
        ([lines("f", [3], [3]), lines("g", [9], [9])], ""),
        ([lines("f", [], [3]), lines("g", [], [9])], ""),
        ([lines("f", [], [3]), lines("f", [], [9])], ""),
        ([lines("f", [], [*range(1, MOST_LINES + 1)])], "a.c:1-4"),
        ([lines("f", [], [*range(1, MOST_LINES + 2)])], ""),
        ([lines("f", [3], [3], "a.h")], ""),
        ([lines("f", [12], [])], "a.c:12"),
        ([], ""),
    ],
)
def test_a_place_is_named_where_it_is_one(found: list[LineDifference], place: str) -> None:
    assert place_of(found) == place


def changed_back(trial: Trial, passing: int, passes: Callable[[Trial], bool]) -> ChangedBack:
    return ChangedBack(trial, [replace(trial, seed=seed) for seed in range(1, passing + 1)], passes)


@pytest.mark.slow
def test_the_one_change_that_undoes_a_fault_names_its_line(good: Trial, inverted: tuple[Trial, str]) -> None:
    trial, line = inverted
    content = good.files["dodge.elf"]
    looked = changed_back(trial, LEAST_PASSING, lambda one: one.files["dodge.elf"] == content)
    assert [*looked.look()] == [*range(1, looked.count + 1)]
    assert looked.result.line == line
    assert len(looked.found) == 1
    assert f"none of {LEAST_PASSING} passing points fail" in looked.result.says
    few = changed_back(trial, LEAST_PASSING - 1, looked.passes)
    [*few.look()]
    assert (few.result.line, few.result.says[:15]) == ("", "2 points pass, ")


@pytest.mark.slow
def test_what_several_lines_mend_or_none_or_there_was_no_time_for_is_unknown(inverted: tuple[Trial, str]) -> None:
    trial, _ = inverted
    several = changed_back(trial, LEAST_PASSING, lambda _: True)
    [*several.look()]
    assert several.result.line == ""
    assert "more than one line" in several.result.says
    none = changed_back(trial, LEAST_PASSING, lambda _: False)
    next(none.look())
    assert "the time was over" in none.result.says
    [*none.look()]
    assert none.result.line == ""


def test_a_change_after_which_a_point_fails_that_passed_is_none(good: Trial, inverted: tuple[Trial, str]) -> None:
    trial, _ = inverted
    content = good.files["dodge.elf"]
    looked = changed_back(trial, LEAST_PASSING, lambda one: one.files["dodge.elf"] == content and one.seed != 3)
    [*looked.look()]
    assert (looked.found, looked.result.line) == ([], "")


@pytest.mark.slow
def test_the_points_of_a_campaign_are_those_of_its_journal(tmp_path: Path) -> None:
    from tests.robot_bench.campaign.test_campaign import Shuffled, begun, carried

    whole = carried(begun(tmp_path), tmp_path / "kept", Shuffled(1))
    rows = points_of(tmp_path / "kept")
    assert [row.cheap.outcome.sha256 for row in rows] == [row.cheap.outcome.sha256 for row in whole.progress.rows]
    failing, passing = failing_and_passing(rows)
    assert failing in [row.cheap.trial for row in whole.failures]
    assert 0 < len(passing) <= 6
    with pytest.raises(UsageError, match="nothing fails"):
        failing_and_passing([row for row in rows if row not in rows])
