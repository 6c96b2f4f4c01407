"""Which source line makes a trial fail: by a version that passes, and by changing the program back."""

import pytest

from bluepill_sim.program.image import load_image
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.mutants import mutants, mutated_file
from bluepill_sim.program.version_difference import LineDifference
from robot_bench.campaign.trial import Trial, trial_of
from robot_bench.campaign.variants.against import Other
from robot_bench.campaign.variants.fault_line import MOST_LINES, by_version, place_of
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


def with_changed_branch(good: Trial, after: str) -> tuple[Trial, str]:
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
    return with_changed_branch(good, "nop")


@pytest.mark.slow
def test_the_line_by_which_a_version_that_passes_differs(good: Trial, wrong: tuple[Trial, str]) -> None:
    trial, line = wrong
    hopeless = trial.with_lists(goal=[GOAL, {"kind": "min_distance", "distance_m": 100.0}])  # for the good one too
    found = by_version([hopeless, trial], Other("good.elf", good.files["dodge.elf"]))
    assert (found.line, found.says) == (line, "good.elf passes, and differs there alone")
    assert found.also[0].startswith("answers: the motors had")
    assert found.also[1].startswith("they part at ")
    assert found.text.startswith(f"cause: {line}: good.elf passes")


@pytest.mark.slow
def test_only_a_version_that_passes_tells_of_one_that_fails(good: Trial, wrong: tuple[Trial, str]) -> None:
    trial, _ = wrong
    with pytest.raises(UsageError, match="does not fail here"):
        by_version([good], Other("good.elf", good.files["dodge.elf"]))
    with pytest.raises(UsageError, match=r"bad\.elf does not pass either: answers"):
        by_version([trial, trial], Other("bad.elf", trial.files["dodge.elf"]))


def lines(function: str, ours: list[int], theirs: list[int], file: str = "a.c", **known: bool) -> LineDifference:
    at, there = (tuple((file, one) for one in side) for side in (ours, theirs))
    return LineDifference(function, at, there, **known)


def computed(*theirs: int) -> LineDifference:
    """Return lines of `f` that only compute and have no code in our version."""
    return lines("f", [], [*theirs], missing_acts=False)


@pytest.mark.parametrize(
    ("found", "place"),
    [
        ([lines("f", [3], [3])], "a.c:3"),
        ([lines("f", [], [7])], "a.c:7"),
        ([lines("f", [3], [3]), lines("f", [5], [5])], "a.c:3, 5"),
        ([lines("f", [3], [3]), lines("f", [6], [6])], ""),
        ([lines("f", [3], [3]), lines("f", [5], [5, 6])], "a.c:5-6"),  # one that has no code any more counts
        ([lines("f", [3], [3]), lines("g", [9], [9])], ""),
        ([lines("f", [], [3]), lines("g", [], [9])], ""),
        ([lines("f", [], [3]), lines("f", [], [9])], ""),
        ([lines("f", [], [*range(1, MOST_LINES + 1)])], "a.c:1-4"),
        ([lines("f", [], [*range(1, MOST_LINES + 2)])], ""),
        ([computed(3)], "a.c:3"),
        ([computed(3), lines("f", [5], [5])], ""),  # what took its result may have changed
        ([computed(3), lines("f", [9], [9], is_edge=True)], "a.c:3"),
        ([computed(3), lines("g", [9], [9])], "a.c:3"),
        ([lines("f", [], [3]), lines("f", [5], [5])], "a.c:3"),
        ([lines("f", [3], [3], "a.h")], ""),
        ([lines("f", [12], [])], "a.c:12"),
        ([], ""),
    ],
)
def test_a_place_is_named_where_it_is_one(found: list[LineDifference], place: str) -> None:
    assert place_of(found) == place
