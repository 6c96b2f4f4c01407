"""Robot files and scenarios of robots on own pins: what is wrong with one is said in a line, with its place."""

import pickle
from pathlib import Path

import pytest

from p2os.errors import ScenarioError
from robot_bench.bench import Bench
from robot_bench.bench.board import pins_of
from robot_bench.direct.differential.analog import DischargingBattery
from robot_bench.direct.differential.robot_file import MOST_EDGES_A_SECOND
from robot_bench.scenario.loading import read_scenario
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.wired_robots import KINDS, known_own_robots
from simbase.errors import UsageError
from tests.robot_bench.direct.robots import ROVER, rover

TEXT = ROVER.read_text(encoding="utf-8")
SCENARIO = 'firmware = "motors.elf"\nworld = "arena"\nrobot = "{robot}"\nbody = "kinematic"\nduration_s = 1.0\n'


def line_of(text: str, what: str) -> int:
    return text[: text.index(what)].count("\n") + 1


def scenario(folder: Path, text: str = TEXT, more: str = "", robot: str = "mine.toml") -> Scenario:
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    path = folder / "run.toml"
    path.write_text(SCENARIO.format(robot=robot) + more, encoding="utf-8")
    return read_scenario(path)


def test_the_shipped_robot_is_known_by_its_name_and_goes_in_mode_direct(tmp_path: Path) -> None:
    assert known_own_robots() == ("rover",)
    found = scenario(tmp_path, robot="rover")
    assert (found.mode, found.robot, found.parameters.track_mm) == ("direct", "rover", 160)
    assert found.own_robot is not None
    assert found.own_robot.robot == rover()
    assert pins_of(found)["left_pwm"] == "PA8"
    assert "battery" not in pins_of(found), "it carries volts"
    assert pickle.loads(pickle.dumps(found)) == found  # noqa: S301 - its own


def test_a_scenario_may_wire_it_otherwise(tmp_path: Path) -> None:
    found = scenario(tmp_path, more='[pins]\nleft_pwm = "PB0"\n')
    assert pins_of(found)["left_pwm"] == "PB0"
    assert pins_of(found)["right_pwm"] == "PA11"


@pytest.mark.parametrize(
    ("old", "new", "at", "complaint"),
    [
        ('kind = "differential"', 'kind = "tank"', 'kind = "tank"', "there is no kind of robot 'tank'"),
        ("track_m = 0.16", "track_m = 16", "track_m", "track_m = 16 is out of range"),
        ("track_m = 0.16", 'track_m = "16 cm"', "track_m", "is not a number"),
        ("mass_kg = 1.4", "mass = 1.4", "mass", "unknown key 'mass'"),
        ("gear_ratio = 34.0\n", "", "[motor]", "key 'gear_ratio' is missing"),
        ('kind = "in1_in2_pwm"', 'kind = "in1_in2"', 'kind = "in1_in2"', "is none of in1_in2_pwm, pwm_dir, two_pwm"),
        ("mass_kg = 1.4", "mass_kg = 0.3", None, None),
        ("wheel_mass_kg = 0.04", "wheel_mass_kg = 0.6", "[body]", "mass_kg = 1.4 is not more than two wheels"),
        ("hull_height_m = 0.10", "hull_height_m = 0.02", "[body]", "hull_height_m is not above ground_clearance_m"),
        ("empty_v = 9.0", "empty_v = 12.7", "[battery]", "empty_v is above full_v"),
        ("empty_v = 9.0", "empty_v = 12.6", None, None),
        ("lines = 12 ", "lines = 12000 ", "[encoder]", "edges a second"),
        ('name = "left"\nx_m', 'name = "front"\nx_m', 'name = "front"\nx_m = 0.08', "is no name of a signal"),
        ('name = "left"\nx_m', 'name = "the left"\nx_m', 'name = "the left"', "is no name of a signal"),
        ("heading_deg = 60", "heading_deg = 60\ncurve = [[0.1, 2.3], [0.1, 0.4]]", "curve", "curve must be points"),
        ("heading_deg = 60", "heading_deg = 60\ncurve = [[0.1, 2.3]]", "curve", "curve must be points"),
        ("heading_deg = 60", "heading_deg = 60\ncurve = [[0.1, 3.31], [0.8, 0.4]]", "curve", "curve must be points"),
        ("heading_deg = 60", "heading_deg = 60\ncurve = [[0.1, 3.3], [0.8, 0.4]]", None, None),
        ('left_pwm = "PA8"', 'left_pwn = "PA8"', "left_pwn", "unknown signal 'left_pwn'"),
        ('left_pwm = "PA8"                # TIM1_CH1\n', "", "[pins]", "the pin of left_pwm is missing"),
        ('left_pwm = "PA8"', 'left_pwm = "PA16"', "left_pwm", "'PA16' is no pin of the BluePill"),
        ('left_pwm = "PA8"', "left_pwm = 8", "left_pwm", "8 is no pin of the BluePill"),
        ('left_pwm = "PA8"', 'left_pwm = "PA11"', "right_pwm", "PA11 is left_pwm already"),
        ('battery = "PA0"', 'battery = "PA8"', "battery = ", "'PA8' cannot measure volts"),
        ("[pins]", "[[pins]]", "[[pins]]", "pins"),
        ("[motor]", "[motor", "[motor", "the file is not TOML"),
    ],
)
def test_a_wrong_line_is_named(tmp_path: Path, old: str, new: str, at: str | None, complaint: str | None) -> None:
    text = TEXT.replace(old, new, 1)
    assert text != TEXT
    if complaint is None or at is None:
        scenario(tmp_path, text)
        return
    with pytest.raises(ScenarioError) as caught:
        scenario(tmp_path, text)
    said = f"{caught.value} {caught.value.hint}"
    assert complaint in said
    assert said.startswith(f"mine.toml:{line_of(text, at)}:"), said


@pytest.mark.parametrize(
    ("more", "robot", "complaint"),
    [
        ('mode = "adapter"\n', "rover", "run.toml:6: the robot 'rover' hangs on the chip's own pins"),
        ("[direct]\nstep_mm_s = 1\n", "rover", "run.toml:6: [direct]: this is for a Pioneer"),
        ("[[fault]]\n", "rover", "run.toml:6: [[fault]] 1: this is for a Pioneer"),
        ('[pins]\nleft_pwm = "PB0"\n', "p2dx", "run.toml:6: [pins]: the robot 'p2dx' has the wires of the pin-out"),
        ('[pins]\nleft_pwm = "PA11"\n', "rover", "run.toml:6: [pins]: PA11 is left_pwm already"),
        ('[pins]\nleft_pvm = "PA1"\n', "rover", "run.toml:7: [pins]: unknown signal 'left_pvm'"),
        ("charge = 0.5\n", "p2dx", "run.toml:6: charge is for robots on own pins"),
        ("", "rovr", "run.toml:3: no robot model 'rovr'"),
    ],
)
def test_a_scenario_that_does_not_fit_its_robot_is_refused(
    tmp_path: Path, more: str, robot: str, complaint: str
) -> None:
    with pytest.raises(ScenarioError) as caught:
        scenario(tmp_path, more=more, robot=robot)
    assert str(caught.value).startswith(complaint)


def test_the_adapter_is_refused_on_the_command_line_too(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="hangs on the chip's own pins"):
        scenario(tmp_path).with_options(mode="adapter")


def test_an_encoder_may_be_as_fast_as_the_bench_and_no_faster(tmp_path: Path) -> None:
    # Without load 12.6 V / 0.0124 V s/rad / 2 pi turns of the motor a second, four edges a line.
    most = MOST_EDGES_A_SECOND / (12.6 / 0.0124 / 6.283185307 * 4)
    scenario(tmp_path, TEXT.replace("lines = 12 ", f"lines = {most * 0.9999} "))
    with pytest.raises(ScenarioError, match="without load would make"):
        scenario(tmp_path, TEXT.replace("lines = 12 ", f"lines = {most * 1.0001} "))


def test_a_bench_of_another_robot_or_wiring_is_refused(tmp_path: Path) -> None:
    snapshot = Bench(scenario(tmp_path)).snapshot()
    Bench(scenario(tmp_path)).restore(snapshot)
    for text, more in ((TEXT.replace("mass_kg = 1.4", "mass_kg = 1.5"), ""), (TEXT, '[pins]\nleft_pwm = "PB0"\n')):
        with pytest.raises(UsageError, match=r"another (own_robot|parameters)"):
            Bench(scenario(tmp_path, text, more)).restore(snapshot)


def test_a_battery_begins_with_the_charge_that_the_file_or_the_scenario_says(tmp_path: Path) -> None:
    def volts(text: str, more: str = "") -> float:
        robot = scenario(tmp_path, text, more).own_robot
        assert robot is not None
        return DischargingBattery(robot.robot.battery).source_v  # type: ignore[attr-defined]  # it is a differential one

    half = TEXT.replace("[battery]", "[battery]\ncharge = 0.5")
    assert (volts(TEXT), volts(half), volts(half, "charge = 1.0\n")) == pytest.approx((12.6, 10.8, 12.6))
    assert volts(TEXT, "charge = 0.0\n") == 0.0


def test_the_page_has_the_keys_of_every_kind() -> None:
    page = (Path(__file__).parents[3] / "docs" / "own-robot.md").read_text(encoding="utf-8")
    assert set(KINDS) == {"differential"}
    assert "<!-- table: own robot -->" in page
