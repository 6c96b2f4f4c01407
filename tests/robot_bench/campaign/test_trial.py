"""One run as a value: what travels with it, and that it comes to the same wherever it is carried out."""

import pickle
import subprocess
from pathlib import Path

import pytest

from p2os.pioneer.body.engine import Engine
from robot_bench.campaign.trial import Outcome, Trial, TrialVerdict, bench_of, run_trial, trial_of, unpacked
from robot_bench.events.kinds import Note, Text
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
from simbase.errors import UsageError
from tests.robot_bench.firmware.hurried import hurried
from tests.tools.forked_python import forked_python

SHORT = (("body", "kinematic"), ("mode", "direct"), ("duration_s", 1.5))
WORLD = """
name = "yard"
extent_m = [-2, -2, 2, 2]
[start]
x_m = 0.0
y_m = 0.0
heading_deg = 0.0
[[box]]
name = "block"
x_m = 0.9
y_m = 0.0
length_m = 0.4
width_m = 0.4
"""


@pytest.fixture(scope="module")
def trial() -> Trial:
    return trial_of("dodge", settings=SHORT, firmware=hurried("dodge"))


@pytest.fixture(scope="module")
def outcome(trial: Trial) -> Outcome:
    return run_trial(trial)


def scenario_in(folder: Path) -> Path:
    (folder / "yard.toml").write_text(WORLD)
    path = folder / "mine.toml"
    path.write_text('extends = "dodge"\nworld = "yard.toml"\nbody = "kinematic"\nmode = "direct"\nduration_s = 2.0\n')
    return path


def test_a_trial_written_out_is_a_scenario_whose_run_has_the_same_hash(
    trial: Trial, outcome: Outcome, tmp_path: Path
) -> None:
    path = trial.write(tmp_path / "kept")
    result = run_scenario(load_scenario(str(path)), tmp_path / "run", is_kept=lambda _: False)
    assert result.outcome["trace_sha256"] == outcome.sha256


@pytest.mark.parametrize(("lacking", "body"), [("", "bullet"), ("bullet", "mujoco"), ("bullet mujoco", "kinematic")])
def test_a_trial_names_its_body_so_that_it_never_gets_another_one_elsewhere(
    lacking: str, body: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Engine, "missing", lambda engine: [engine.name] if engine.name in lacking.split() else [])
    path = scenario_in(tmp_path)
    path.write_text(path.read_text().replace('"kinematic"', '"best"'))
    trial = trial_of(str(path))
    assert trial.table["body"] == trial_of("dodge").set(("body", "best")).table["body"] == body
    assert load_scenario(str(trial.write(tmp_path / "kept"))).body == body
    assert trial.set(("body", "mujoco")).table["body"] == "mujoco"


def test_a_trial_needs_nothing_of_the_disk_that_it_was_made_on(tmp_path: Path) -> None:
    trial = trial_of(str(scenario_in(tmp_path)))
    here = run_trial(trial).sha256
    for file in tmp_path.iterdir():
        file.unlink()
    code = (
        "import pickle, sys; from robot_bench.campaign.trial import run_trial;"
        "print(run_trial(pickle.load(sys.stdin.buffer)).sha256)"
    )
    there = subprocess.run(
        [forked_python(), "-c", code], input=pickle.dumps(trial), capture_output=True, check=True, timeout=60, cwd="/"
    )
    assert there.stdout.decode().strip() == here


def test_what_is_set_changes_the_run_and_leaves_the_trial_that_it_was_set_on(trial: Trial, outcome: Outcome) -> None:
    post = {"at_s": 0, "name": "post", "shape": "cylinder", "radius_m": 0.1, "height_m": 0.5, "x_m": 0.8, "y_m": 0.0}
    other = run_trial(trial.with_lists(obstacle=[post]))
    assert other.sha256 != outcome.sha256
    assert run_trial(trial).sha256 == outcome.sha256
    assert trial.set(("start.x_m", 0.5), ("start.y_m", 0.0)).table != trial.table
    assert trial.set(("seed", 7)).seed == 7


def test_a_hash_of_a_trial_tells_every_part_of_it(trial: Trial) -> None:
    changed = [
        trial.set(("seed", 1)), trial.set(("threshold_m", 0.5)), trial.with_firmware(b"x"),
        trial.with_lists(goal=[]),
    ]  # fmt: skip
    assert len({trial.sha256, *(one.sha256 for one in changed)}) == 5
    assert pickle.loads(pickle.dumps(trial)).sha256 == trial.sha256  # noqa: S301 - our own


def test_a_goal_that_the_run_was_too_short_for_is_no_failure(tmp_path: Path) -> None:
    path = scenario_in(tmp_path)
    path.write_text(path.read_text().replace("duration_s = 2.0\n", "") + '[[goal]]\nkind = "cells"\nleast = 30\n')
    missed = run_trial(trial_of(str(path), settings=[("duration_s", 1)]))
    assert (missed.verdict, [goal.met for goal in missed.goals]) == (TrialVerdict.FAILED, [False])


def test_a_world_that_refuses_the_start_is_an_error_that_says_so(trial: Trial) -> None:
    found = run_trial(trial.set(("start.x_m", 50.0), ("start.y_m", 0.0)))
    assert (found.verdict, found.sha256) == (TrialVerdict.ERROR, "")
    assert "start" in found.failures[0]


def test_what_looks_can_end_a_run(trial: Trial) -> None:
    def look() -> None:
        raise UsageError("that is enough")

    assert run_trial(trial, look).failures == ("that is enough",)


def test_an_outcome_tells_which_blocks_ran_and_what_was_printed(outcome: Outcome) -> None:
    assert len(outcome.blocks) > 50
    assert min(outcome.blocks) >= 0x0800_0000
    assert "dodge: CRUISE" in outcome.lines
    assert outcome.way_mm[0] == (0, 0)
    assert len(outcome.way_mm) == 4


def test_several_robots_bring_a_program_each() -> None:
    trial = trial_of("two-dodge", settings=[("duration_s", 1), ("body", "kinematic")])
    found = run_trial(trial)
    assert list(trial.files) == ["dodge.elf"]
    assert {goal.robot for goal in found.goals} == {"east", "west"}
    assert run_trial(trial).sha256 == found.sha256


def test_what_sram_holds_at_power_on_is_the_seeds_and_a_program_that_sets_its_variables_does_not_care(
    trial: Trial, outcome: Outcome, tmp_path: Path
) -> None:
    held = []
    for seed in (1, 1, 2):
        scenario = trial.set(("sram", "random"), ("seed", seed)).scenario(trial.write(tmp_path).parent)
        held.append(bytes(bench_of(scenario).chip.chip.memory.sram))  # type: ignore[attr-defined]  # a BluePill
    assert held[0] == held[1] != held[2]
    assert set(bench_of(trial.scenario(tmp_path)).chip.chip.memory.sram.raw) == {0}  # type: ignore[attr-defined]  # as above
    assert run_trial(trial.set(("sram", "random"))).sha256 == outcome.sha256


@pytest.mark.parametrize("ppm", [-1000, 1000])
def test_a_crystal_that_is_too_fast_brings_forward_what_a_program_times(ppm: int, trial: Trial) -> None:
    longer = trial_of("dodge", settings=[*SHORT, ("duration_s", 3.1)])
    took = []
    for one in (longer, longer.set(("crystal_ppm", ppm))):
        times: list[int] = []
        with unpacked(one.files) as folder:
            bench = bench_of(one.scenario(folder))
            bench.events.subscribe(lambda event, times=times: times.append(event.t), Text)
            notes: list[str] = []
            bench.events.subscribe(lambda event, notes=notes: notes.append(str(event)), Note)
            bench.run_until(bench.end)
            bench.finish()
        assert run_trial(one).sha256 == bench.trace.sha256
        assert not any("SYSCLK" in note for note in notes), "72.07 MHz is no forbidden clock"
        took.append(times[1] - times[0])  # from the reset's greeting to the link, 3 s that it waits for by SysTick
    assert took[1] / took[0] == pytest.approx(1 - ppm / 10**6, abs=2e-6)


def test_a_firmware_that_is_not_there_is_refused_in_a_line() -> None:
    with pytest.raises(UsageError, match=r"there is no firmware file nowhere\.elf"):
        trial_of("motors", firmware=Path("nowhere.elf"))


@pytest.mark.parametrize("core", ["model", "firmware"])
@pytest.mark.parametrize(("stale_ms", "verdict"), [(397, TrialVerdict.FAILED), (500, TrialVerdict.PASSED)])
def test_a_distance_that_is_stale_before_the_ring_is_round_holds_the_robot(
    core: str, stale_ms: int, verdict: TrialVerdict
) -> None:
    settings = [("body", "kinematic"), ("duration_s", 4), ("adapter", {"core": core, "distance_stale_ms": stale_ms})]
    goal = {"kind": "moves_on", "way_m": 0.3, "within_s": 3.5}
    trial = trial_of("dodge", settings=settings, firmware=hurried("dodge"))
    assert run_trial(trial.with_lists(goal=[goal])).verdict is verdict
