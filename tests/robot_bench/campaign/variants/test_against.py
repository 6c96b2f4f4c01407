"""Two versions of a firmware in one campaign: what counts as a difference, and that each world is run with both."""

import json
import random
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from bluepill_sim.program.image import load_image
from bluepill_sim.program.mutants import mutants, mutated_file
from p2os.cli import main as cli
from robot_bench.campaign.margin import margin
from robot_bench.campaign.trial import GoalResult, Outcome, Trial, TrialVerdict, trial_of
from robot_bench.campaign.variants.against import FOLDER, MOST_APART, Against, Other, compared, first_apart
from simbase.errors import UsageError
from simbase.timing import NS_PER_S
from tests.robot_bench.firmware.hurried import hurried

Done = tuple[Outcome, float]
NAMES = ("new.elf", "old.elf")
FILE = """
scenario = "mine.toml"
search = "random"
batch = 1
[budget]
runs = 1
confirmations = 1
[cheap]
mode = "direct"
[full]
mode = "direct"
body = "kinematic"
[vary]
threshold_m = [0.6]
"""
SCENARIO = """
extends = "dodge"
body = "kinematic"
duration_s = 3.0
firmware = "dodge.elf"
start = { x_m = 2.5, y_m = 0.0, heading_deg = 0.0 }
[[goal]]
kind = "no_collision"
"""


def test_the_version_that_a_folder_was_begun_against_is_kept_in_it(tmp_path: Path) -> None:
    assert Other.of(tmp_path) is None
    (tmp_path / FOLDER).mkdir()
    assert Other.of(tmp_path) is None
    Other("old.elf", b"other").keep(tmp_path)
    assert Other.of(tmp_path) == Other("old.elf", b"other")


def outcome(by: float, kind: str = "clearance", died: str = "") -> Outcome:
    goal = GoalResult(kind=kind, wanted=kind, met=by >= 0, says="near", robustness=by, unit="m")
    is_bad = by < 0 or bool(died)
    failures = tuple([died] if died else [f"{kind}: near"]) if is_bad else ()
    return Outcome(
        verdict=TrialVerdict.FAILED if is_bad else TrialVerdict.PASSED,
        goals=(goal,),
        failures=failures,
        died=died,
        sha256=f"{by}{kind}{died}",
    )


def bad_firmware() -> bytes:
    """Return `dodge` with a loop over the sensors' wires that ends after the first: it is blind."""
    file = hurried("dodge")
    image = load_image(file)
    start = image.symbols.address_of("read_value")
    assert start is not None
    loop = next(one for one in mutants(image, range(start, start + 0x60, 2))
                if one.alteration.before.startswith("blo") and one.alteration.after == "nop")  # fmt: skip
    return mutated_file(file.read_bytes(), loop, image)


@pytest.mark.parametrize(
    ("one", "other", "differs"),
    [
        (outcome(0.5), outcome(0.5), False),
        (outcome(0.5), outcome(0.25), False),  # a quarter apart, no more
        (outcome(0.5), outcome(0.2499), True),
        (outcome(0.01), outcome(-0.01), True),  # one hits, one does not
        (outcome(-0.1), outcome(-0.1), False),  # both fail alike
        (outcome(-0.1), outcome(-0.1, kind="reach"), True),  # in another goal
        (outcome(0.5), outcome(0.5, died="BusFault"), True),
    ],
)
def test_versions_differ_where_verdicts_or_goals_do_or_margins_part(
    one: Outcome, other: Outcome, differs: bool
) -> None:
    found = compared(one, other, NAMES)
    assert (found.verdict is TrialVerdict.FAILED) is differs
    by = margin(found)
    assert by is not None
    assert (by < 0) is differs, "what a search goes towards"
    assert all(name in found.goals[0].says for name in NAMES)
    back = compared(other, one, NAMES[::-1])
    assert (back.verdict, margin(back)) == (found.verdict, by)


def test_what_is_seen_of_a_difference_is_the_run_that_fails() -> None:
    good, bad = replace(outcome(0.5), way_mm=((0, 0),)), replace(outcome(-0.5), way_mm=((1, 1),))
    assert [compared(*pair, NAMES).way_mm for pair in ((good, bad), (bad, good), (bad, bad))] == [((1, 1),)] * 3
    assert compared(good, good, NAMES).way_mm == ((0, 0),)


def test_the_search_is_told_how_near_they_are_to_a_difference() -> None:
    found = [margin(compared(outcome(0.5), outcome(0.5 - apart), NAMES)) for apart in (0.0, 0.1, 0.2)]
    assert found == [pytest.approx(MOST_APART - apart) for apart in (0.0, 0.1, 0.2)]


def test_without_a_verdict_of_one_there_is_none_of_both() -> None:
    error = Outcome(verdict=TrialVerdict.ERROR, failures=("too long",))
    assert compared(outcome(0.5), error, NAMES).verdict is TrialVerdict.ERROR
    assert compared(error, outcome(0.5), NAMES).failures == ("new.elf: too long",)


@pytest.mark.parametrize("seed", range(5))
def test_each_trial_is_run_with_both_versions_in_whatever_order_they_end(seed: int) -> None:
    class Workers:
        def run(self, trials: Sequence[Trial], on_done: Callable[[int, Done], None], **_: bool) -> None:
            places = list(range(len(trials)))
            random.Random(seed).shuffle(places)
            for place in places:
                is_other = trials[place].files["dodge.elf"] == b"other"
                on_done(place, (outcome(-0.1 if is_other and trials[place].seed == 1 else 0.2), 1.5))

        def close(self) -> None:
            """Nothing is to be ended."""

    trials = [replace(trial_of("dodge"), seed=seed) for seed in range(3)]
    found: dict[int, tuple[Outcome, float]] = {}
    Against(Workers(), Other("old.elf", b"other")).run(trials, lambda place, done: found.update({place: done}))
    verdicts = {place: done[0].verdict for place, done in found.items()}
    assert verdicts == {0: TrialVerdict.PASSED, 1: TrialVerdict.FAILED, 2: TrialVerdict.PASSED}
    assert {done[1] for done in found.values()} == {3.0}


def test_the_other_version_is_kept_in_the_folder_so_that_the_campaign_can_go_on(tmp_path: Path) -> None:
    assert Other.of(tmp_path) is None
    (tmp_path / "old.elf").write_bytes(b"other")
    kept = Other.read(tmp_path / "old.elf")
    kept.keep(tmp_path / "campaign")
    assert Other.of(tmp_path / "campaign") == kept == Other("old.elf", b"other")
    with pytest.raises(UsageError, match="no such file"):
        Other.read(tmp_path / "none.elf")


def test_two_versions_part_where_the_first_of_them_does_something_else() -> None:
    settings = [("mode", "direct"), ("body", "kinematic"), ("duration_s", 1.0)]
    trial = trial_of("dodge", settings=settings, firmware=hurried("dodge"))
    assert first_apart(trial, Other("dodge.elf", trial.files["dodge.elf"])) is None
    near = trial.set(("start", {"x_m": 2.6, "y_m": 0.0, "heading_deg": 0.0}))
    found = first_apart(near, Other("bad.elf", bad_firmware()))
    assert found is not None
    assert found.at < NS_PER_S, "from its start on it does not see the wall"


@pytest.mark.slow
def test_a_campaign_against_a_blind_version_finds_it_and_names_when_they_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    here = EntryPoint("campaign", "robot_bench.cli.campaigns.campaign", cli.GROUP)
    found = [entry for entry in cli.verbs() if entry.name != "campaign"]
    monkeypatch.setattr(cli, "verbs", lambda: [*found, here])
    Path("mine.toml").write_text(SCENARIO, encoding="utf-8")
    Path("c.toml").write_text(FILE, encoding="utf-8")
    Path("bad.elf").write_bytes(bad_firmware())
    Path("dodge.elf").write_bytes(hurried("dodge").read_bytes())
    assert cli.run(["campaign", "c.toml", "--against", "bad.elf", "--out", "there", "--json"]) == 1
    reported = json.loads(capsys.readouterr().out)
    assert reported["parted"]["1"].startswith("they part at 0.")
    assert "bad.elf no_collision" in reported["failures"][0]["failures"][0]
    assert (reported["clusters"], reported["diversity"]) == ([[1]], {"obstacles": None, "ways": None})
    assert [path.name for path in Path("there", FOLDER).iterdir()] == ["bad.elf"]
    assert cli.run(["campaign", "--resume", "there"]) == 1
    assert "they part at 0." in capsys.readouterr().out
    same = ["campaign", "c.toml", "--out", "same", "--against"]
    assert cli.run([*same, "dodge.elf"]) == 0
