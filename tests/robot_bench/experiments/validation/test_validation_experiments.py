"""The experiments of `p2os validate`: the bench passes them, and each planted error is told by the right figure."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from adapter_sim.codec import is_near
from adapter_sim.distances import Distances
from adapter_sim.encoders import CodeWalk
from adapter_sim.pins import SampleClock
from p2os.cli.main import run as p2os
from robot_bench.events.codec import Json
from robot_bench.experiments.validation.experiments import CODES, EXPERIMENTS, MOTORS
from robot_bench.experiments.validation.figures import LOOSE_BECAUSE, Figure, loose
from robot_bench.experiments.validation.trials import TrialResult, Variant, reported, run_trials, variants
from robot_bench.report.make import Files
from robot_bench.scenario.included_files import Setting
from tests.p2os.view.pages import ReadPage

DIRECT, ADAPTER = Variant("direct", "", "kinematic"), Variant("adapter", "model", "kinematic")
FIRMWARE = Variant("adapter", "firmware", "kinematic")
PHYSICAL = Variant("direct", "", "bullet")
#: Those that take many seconds, and those of a minute and a half, which show all pairs of codes.
SLOW, LONG = {"dodge", "long-drive", "sparse"}, ["codes", "encoders", "capped"]
#: Bounds that figures come near to in the latter alone.
NEAR_WITH_ALL_PAIRS = {"hold time", "slope of a ramp", "rim speed"}


def here(job: Callable[[int, Callable[[], None]], Json], count: int, on_done: Callable[[int, Json], None]) -> bool:
    """Do all pieces in this process."""
    for number in range(count):
        on_done(number, job(number, lambda: None))
    return True


def results_of(
    names: Sequence[str], chosen: Sequence[Variant], folder: Path, settings: Sequence[Setting] = ()
) -> list[TrialResult]:
    return run_trials(
        [EXPERIMENTS[name] for name in names], chosen, folder, settings=settings, in_processes=here, files=Files.SUMMARY
    )


@pytest.fixture(scope="module")
def passing(tmp_path_factory: pytest.TempPathFactory) -> list[TrialResult]:
    names = [name for name in EXPERIMENTS if name not in SLOW and name not in LONG]
    return results_of(names, [DIRECT, ADAPTER], tmp_path_factory.mktemp("validation"))


@pytest.fixture(scope="module")
def passing_long(passing: list[TrialResult], tmp_path_factory: pytest.TempPathFactory) -> list[TrialResult]:
    return [*passing, *results_of(LONG, [DIRECT, ADAPTER], tmp_path_factory.mktemp("long"))]


def all_hold(found: list[TrialResult], names: set[str]) -> None:
    """See that experiments have passed in both modes, or in the one that they have."""
    assert [line for result in found for line in reported(result)] == []
    ways = {(name, mode) for name in names for mode in EXPERIMENTS[name].modes or ("direct", "adapter")}
    assert sorted((result.experiment, result.variant.mode) for result in found) == sorted(ways)
    assert all(result.passed and not result.folder for result in found)


def test_short_experiments_hold_pins_straight_to_the_body_and_through_the_adapter(passing: list[TrialResult]) -> None:
    all_hold(passing, EXPERIMENTS.keys() - SLOW - {*LONG})
    assert [name for name, one in EXPERIMENTS.items() if one.modes] == ["capped", "silence"]
    found = loose(finding for result in passing for finding in result.findings)
    assert set(found) <= set(LOOSE_BECAUSE) | NEAR_WITH_ALL_PAIRS


@pytest.mark.soak
def test_experiments_with_all_pairs_of_codes_hold_and_each_bound_would_be_broken_at_half_its_size_or_says_why_not(
    passing_long: list[TrialResult],
) -> None:
    all_hold(passing_long, EXPERIMENTS.keys() - SLOW)
    found = loose(finding for result in passing_long for finding in result.findings)
    assert set(found) <= set(LOOSE_BECAUSE)
    assert not found.keys() & {"rim speed", "delay to a distance pin", "encoder while it turns", "rounding of VEL"}
    figures = [one for result in passing_long for one in result.findings if isinstance(one, Figure)]
    rim = next(one for one in figures if one.what == "steady rim speed" and one.count > 100)
    assert rim.count == 2 * len(CODES)


@pytest.mark.parametrize(("names", "variant"), [(LONG[:2], DIRECT), (LONG[:2], ADAPTER), (LONG[2:], ADAPTER)])
def test_the_first_pairs_of_codes_show_nothing_wrong_but_that_they_are_not_all(
    names: list[str], variant: Variant, tmp_path: Path
) -> None:
    found = results_of(names, [variant], tmp_path, [("duration_s", 12.0)])
    not_all = {"pairs of codes in their order", "encoder1: codes reached, forward and backward"}
    assert {failure.what for result in found for failure in result.failures} <= not_all
    assert all(len(result.findings) > len(result.failures) == 1 for result in found)


def test_figures_have_units_formulas_and_counts(passing: list[TrialResult]) -> None:
    figures = [one for result in passing for one in result.findings if isinstance(one, Figure)]
    assert {figure.group for figure in figures} == {"pins", "wire", "motion"}
    assert all(figure.bound.formula and figure.uncertainty >= 0 for figure in figures)
    rims = [one for one in figures if one.what == "steady rim speed"]
    assert [(rim.unit, rim.count) for rim in rims] == [("mm/s", 2 * len(MOTORS))] * 2


def test_the_adapters_firmware_is_measured_as_its_model_is(passing: list[TrialResult], tmp_path: Path) -> None:
    twin = results_of(["sensors-all"], [FIRMWARE], tmp_path)[0]
    model = next(one for one in passing if one.experiment == "sensors-all" and one.variant == ADAPTER)
    assert twin.passed
    assert twin.findings == model.findings


#: Experiment, variant, what is set otherwise, and the figure that has to tell.
PLANTED = [
    ("motors", ADAPTER, ("adapter.step_mm_s", 63.5), "VEL for a pair of codes"),
    ("motors", ADAPTER, ("adapter.bit_order", "comm1_msb"), "VEL for a pair of codes"),
    ("motors", ADAPTER, ("adapter.motor_meaning", "linear_angular"), "RVEL for a pair of codes"),
    ("motors", ADAPTER, ("adapter.max_velocity_mm_s", 249), "VEL for a pair of codes"),
    ("motors", DIRECT, ("direct.step_mm_s", 62.6), "steady rim speed"),
    ("motors", DIRECT, ("direct.ramp_mm_s2", 299.0), "ramp, both wheels alike"),
    ("motors", DIRECT, ("direct.bit_order", "comm1_msb"), "steady rim speed"),
    ("motors", DIRECT, ("firmware", "sensors.elf"), "pairs of codes in their order"),
    ("sensors-all", ADAPTER, ("threshold_m", 0.4), "things seen by their own sensor, and by no other"),
    ("sensors-all", DIRECT, ("direct.sensor_period_ms", 160), "thing appears to the distance pin"),
    ("only-while-seen", DIRECT, ("firmware", "motors.elf"), "rim speed while nothing is seen"),
    ("encoders", DIRECT, ("direct.encoder_period_ms", 40), "encoder code against the wheel's angle"),
    ("encoders", ADAPTER, ("controller.errors", "realistic"), "encoder code against the wheel's angle"),
    ("slip", PHYSICAL, ("robot", "p2dx"), "directions in which the wheels slip"),
    ("slip", DIRECT, ("direct.encoder_period_ms", 40), "encoder code against the wheel's angle"),
]


#: How much of an experiment suffices, seconds: with nothing planted it shows nothing wrong either, but for `encoders`,
#: which has not come to every code by then.
SHORT_S = {"encoders": 20.0, "motors": 13.0, "sensors-all": 10.0, "only-while-seen": 8.0, "slip": 13.0}


@pytest.mark.parametrize(
    ("name", "variant", "setting", "what"), PLANTED, ids=[f"{row[0]}-{row[2][0]}-{row[2][1]}" for row in PLANTED]
)
def test_a_planted_error_is_reported_by_the_right_figure(
    name: str, variant: Variant, setting: Setting, what: str, tmp_path: Path
) -> None:
    short = [("duration_s", SHORT_S[name])] if name in SHORT_S else []
    (result,) = results_of([name], [variant], tmp_path, [setting, *short])
    assert what in {failure.what for failure in result.failures}
    assert (Path(result.folder) / "trace.jsonl").is_file()


def far_third(pins: Distances) -> tuple[bool, ...]:
    ranges = enumerate(pins.ranges_um)
    return tuple(um is None or is_near(um, pins.threshold_um + 50_000 * (n == 2)) for n, um in ranges)


def slow_clock(period_ns: int, *, may_suspend: bool) -> SampleClock:
    return SampleClock(period_ns * 3 // 2, may_suspend=may_suspend)


#: Experiment, what is replaced by what, and the figure that has to tell.
PLANTED_PARTS = [
    ("sensors-all", "adapter_sim.distances.Distances.levels", property(far_third),
     "things seen by their own sensor, and by no other"),
    ("motors", "adapter_sim.adapter.SampleClock", slow_clock, "the same, where the line is free"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "part", "wrong", "what"), PLANTED_PARTS, ids=["threshold", "sampler"])
def test_a_part_of_the_adapter_that_is_a_little_off_is_reported(
    name: str, part: str, wrong: object, what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(part, wrong)
    (result,) = results_of([name], [ADAPTER], tmp_path)
    assert what in {failure.what for failure in result.failures}


@pytest.mark.soak
def test_more_than_half_a_turn_between_two_samples_is_followed_and_jumps_of_the_codes_are_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = results_of(["sparse"], [DIRECT, ADAPTER], tmp_path)
    assert [line for result in found for line in reported(result)] == []
    assert loose(one for result in found for one in result.findings) == {}
    late = results_of(["sparse"], [DIRECT], tmp_path, [("direct.encoder_period_ms", 300)])
    assert "encoder code against the wheel's angle" in {failure.what for failure in late[0].failures}

    def jump(walk: CodeWalk, target: int, now: int) -> None:
        walk.shown = target if walk.due_at(target, now) == now else walk.shown

    monkeypatch.setattr(CodeWalk, "step", jump)
    (jumping,) = results_of(["sparse"], [ADAPTER], tmp_path)
    assert "count of the program at the end, against the wheel" in {failure.what for failure in jumping.failures}


@pytest.mark.slow
@pytest.mark.parametrize("names", [["motors"], pytest.param(["sensors-all", "slip"], marks=pytest.mark.soak)])
def test_the_physical_body_holds_too(names: list[str], tmp_path: Path) -> None:
    found = results_of(names, [Variant("adapter", "firmware", "bullet")], tmp_path)
    assert [line for result in found for line in reported(result)] == []


@pytest.mark.soak
def test_every_experiment_holds_in_every_variant(tmp_path: Path) -> None:
    found = results_of(list(EXPERIMENTS), variants(), tmp_path)
    assert [line for result in found for line in reported(result)] == []


def test_the_command_passes_and_writes_page_and_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert p2os(["validate", "motors", "--body", "kinematic", "-j", "2", "--out", "v"]) == 0
    out = capsys.readouterr().out
    assert "motors      3 of 3" in out
    assert out.splitlines()[-1] == "passed in 3 variants; report: v/validation.html"
    page = Path("v/validation.html").read_text(encoding="utf-8")
    rows = ReadPage(page).section("motors")["blocks"][1]["rows"]
    bounds = [row[-1]["text"] for row in rows]
    # Rim speeds and angles, of the model and the firmware.
    assert sum("0.5 mm/s (VEL is whole mm/s)" in bound for bound in bounds) == 4
    assert any(row[1]["text"] == "adapter (firmware), kinematic" for row in rows)
    figures = json.loads(Path("v/validation.json").read_text(encoding="utf-8"))
    assert figures["passed"]
    assert len(figures["results"]) == 3
    assert not (Path("v") / "motors-direct-kinematic").exists()


def test_a_planted_error_fails_the_command_and_leaves_its_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["validate", "motors", "--body", "kinematic", "--mode", "direct", "--set", "direct.step_mm_s=60"]
    assert p2os([*words, "--json", "--out", "v"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["results"][0]["failures"] == [
        f"motors: {what}: -240 mm/s, expected -250 within 0.001 (left of (-4, -4))"
        for what in ("steady rim speed", "the same by the wheels' angles")
    ]
    assert Path("v/motors-direct-kinematic/report.html").is_file()
    assert "direct.step_mm_s=60, which is not expected" in Path("v/validation.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["code"], "there is no experiment 'code'\nhint: did you mean 'codes'?"),
        (["codes", "--mode", "x"], "there is no mode 'x'"),
        (["codes", "--body", "x"], "there is no body 'x'"),
        (["codes", "--set", "a.b=3"], "unknown key 'a'"),
        (["dodge", "--world", "nowhere"], "nowhere"),
        (["codes", "--yes"], "--yes goes with --port only"),
        (["capped", "--mode", "direct"], "capped shows nothing in mode direct\nhint: --mode adapter"),
        (["slip", "--port", "tcp:127.0.0.1:1"], "a robot at a port can do none of these"),
        (["codes", "--port", "tcp:127.0.0.1:1", "--body", "bullet"], "its own body and world"),
    ],
)
def test_what_cannot_be_validated_is_refused_in_a_line_and_nothing_is_made(
    words: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert p2os(["validate", *words]) == 2
    assert says in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
