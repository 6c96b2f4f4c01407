"""Scenario files: what ships is right, and what is wrong is one line that says where."""

from pathlib import Path

import pytest

from adapter_sim.codec import BitOrder
from p2os.errors import P2osError, ScenarioError, UsageError
from p2os.pioneer.controller.settings import SonarPerSip
from robot_bench.scenario.scenario import known_scenarios, load_scenario, read_scenario
from robot_bench.scenario.world_script import Op

LEAST = 'firmware = "dodge"\nworld = "room"\nduration_s = 10\n'


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", known_scenarios())
def test_every_scenario_that_ships_is_right_and_states_its_threshold(name: str) -> None:
    scenario = load_scenario(name)
    assert scenario.name == name
    assert scenario.firmware.is_file()
    assert scenario.goals
    assert "threshold_m" in scenario.text
    assert scenario.adapter.threshold_um == scenario.threshold_um
    assert scenario.body == "bullet"


def test_the_four_programs_ship() -> None:
    assert set(known_scenarios()) >= {"motors", "sensors", "encoders", "dodge"}


def test_what_a_scenario_leaves_out_has_its_default(tmp_path: Path) -> None:
    scenario = read_scenario(write(tmp_path, LEAST))
    assert (scenario.mode, scenario.body, scenario.seed, scenario.duration_ns) == ("adapter", "bullet", 0, 10**10)
    assert scenario.threshold_um == 2_500_000, "half of the robot file's sonar range of 5 m"
    assert scenario.start is None


def test_every_setting_arrives_where_it_belongs(tmp_path: Path) -> None:
    scenario = read_scenario(
        write(
            tmp_path,
            LEAST
            + """
        robot = "p2dx"
        threshold_m = 0.5
        start = { x_m = 1.0, y_m = -1.5, heading_deg = 180 }
        [direct]
        step_mm_s = 50
        ramp_mm_s2 = 0
        sensor_period_ms = 20
        encoder_period_ms = 10
        bit_order = "comm1_msb"
        [adapter]
        step_mm_s = 40.5
        motor_meaning = "linear_angular"
        max_velocity_mm_s = 150
        [controller]
        name = "Rosie"
        sonar_per_sip = "all"
    """,
        )
    )
    assert scenario.direct.step_um_per_s == 50_000
    assert scenario.direct.ramp_um_per_s2 is None
    assert (scenario.direct.sensor_period_ns, scenario.direct.encoder_period_ns) == (20_000_000, 10_000_000)
    assert scenario.direct.bit_order is BitOrder.COMM1_MSB
    assert (scenario.adapter.step_um_per_s, scenario.adapter.max_velocity_mm_s) == (40_500, 150)
    assert scenario.adapter.threshold_um == scenario.threshold_um == 500_000
    assert (scenario.controller.name, scenario.controller.sonar_per_sip) == ("Rosie", SonarPerSip.ALL)
    assert scenario.start is not None
    assert scenario.start.heading_rad == pytest.approx(3.14159265)


def test_a_world_may_change_what_it_must(tmp_path: Path) -> None:
    text = (
        LEAST
        + """
        threshold_m = 0.6
        start = { x_m = -1.0, y_m = 0.0 }
        [in_world.ramp]
        threshold_m = 0.4
        duration_s = 20
        start = { x_m = 0.5, y_m = 0.1 }
    """
    )
    scenario = read_scenario(write(tmp_path, text))
    there = scenario.with_options(world="ramp")
    assert (there.threshold_m, there.adapter.threshold_um, there.duration_ns) == (0.4, 400_000, 20 * 10**9)
    assert there.start is not None
    assert there.start.x_m == 0.5
    elsewhere = scenario.with_options(world="corridor")
    assert elsewhere.start is None
    assert elsewhere.threshold_m == 0.6


def test_a_thing_held_before_a_sonar_is_placed_moved_and_removed(tmp_path: Path) -> None:
    scenario = read_scenario(
        write(
            tmp_path,
            LEAST
            + """
        [[obstacle]]
        at_s = 1.0
        name = "post"
        shape = "cylinder"
        radius_m = 0.02
        height_m = 0.5
        before_sonar = 3
        distance_m = 0.4
        hold_s = 0.15
        [[obstacle]]
        at_s = 0.5
        name = "crate"
        x_m = 1
        y_m = 2
        length_m = 0.3
        width_m = 0.2
        height_m = 0.4
        [[obstacle]]
        at_s = 2
        op = "move"
        name = "crate"
        x_m = 1
        y_m = 1
    """,
        )
    )
    steps = [(change.at / 1e9, change.op, change.name) for change in scenario.changes]
    assert steps == [
        (0.5, Op.PLACE, "crate"), (1.0, Op.PLACE, "post"), (1.05, Op.MOVE, "post"), (1.1, Op.MOVE, "post"),
        (1.15, Op.REMOVE, "post"), (2.0, Op.MOVE, "crate"),
    ]  # fmt: skip


BOX = '[[obstacle]]\nat_s = 1\nname = "a"\nx_m = 0\ny_m = 0\nlength_m = 1\nwidth_m = 1\nheight_m = 1\n'


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        ("=", "mine.toml: Invalid statement", "no TOML"),
        (LEAST + "treshold_m = 1\n", "mine.toml: unknown key 'treshold_m'", "threshold_m"),
        (LEAST + "threshold_cm = 60\n", "mine.toml: unknown key 'threshold_cm'", "threshold_m"),
        (LEAST + 'threshold_m = "60 cm"\n', 'threshold_m = "60 cm" is not a number of metres', "bare number"),
        (LEAST + "threshold_m = true\n", "threshold_m = True is not a number of metres", None),
        (LEAST + "threshold_m = nan\n", "threshold_m = nan is out of range", "above 0"),
        (LEAST + "seed = 1.5\n", "seed = 1.5 is not a whole number", None),
        (LEAST + "seed = -1\n", "seed = -1 is out of range", "at least 0"),
        (LEAST + 'body = "bulet"\n', 'body = "bulet" is none of kinematic, bullet, mujoco', "bullet"),
        ('firmware = "dodge"\nworld = "room"\n', "key 'duration_s' is missing", "seconds above 0"),
        (LEAST.replace("room", "rom"), "world: there is no world 'rom'", "room"),
        (LEAST.replace("room", "my.toml"), "there is no world file", "worlds that ship"),
        (LEAST.replace("dodge", "doge"), "firmware: there is no file 'doge'", "relative to the scenario"),
        (LEAST + "[direct]\nramp = 3\n", "[direct]: unknown key 'ramp'", "ramp_mm_s2"),
        (LEAST + "[start]\nx_m = 1\n", "[start]: key 'y_m' is missing", "metres"),
        (
            LEAST + "[adapter]\ndisbelief_ns = 1\n",
            "[adapter]: disbelief_ns is called plausibility_ns",
            "AdapterSettings",
        ),
        (LEAST + "[in_world.ramp]\nbody = 1\n", "[in_world.ramp]: unknown key 'body'", "known are"),
        (LEAST + "[[goal]]\nleast = 1\n", "[[goal]] 1: key 'kind' is missing", "a text"),
        (LEAST + '[[goal]]\nkind = "no_colision"\n', "[[goal]] 1: there is no goal 'no_colision'", "no_collision"),
        (LEAST + '[[goal]]\nkind = "cells"\nleast = 0\n', "least = 0 is out of range", "at least 1"),
        (LEAST + "goal = 3\n", "goal = 3 is not an array of tables", None),
        (LEAST + BOX + "before_sonar = 9\n", "before_sonar = 9, the robot has 8", None),
        (LEAST + BOX + "hold_s = 1\n", "hold_s without before_sonar", "held"),
        (LEAST + BOX + "radius_m = 1\n", "a box has no radius_m", "length_m"),
        (LEAST + BOX + BOX, "'a' is placed at 1 s while it is there", None),
        (LEAST + '[[obstacle]]\nat_s = 1\nname = "a"\n', "key 'x_m' is missing", "x_m, y_m"),
        (LEAST + 'robot = "p9"\n', "p9", None),
    ],
)
def test_a_fault_is_one_line_with_file_key_and_hint(tmp_path: Path, text: str, message: str, hint: str | None) -> None:
    with pytest.raises(P2osError) as caught:
        read_scenario(write(tmp_path, text))
    assert caught.value.exit_code == 2
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert hint is None or hint in str(caught.value.hint)


def test_a_scenario_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="there is no scenario 'doge'") as caught:
        load_scenario("doge")
    assert caught.value.hint == "did you mean 'dodge'?"
    with pytest.raises(ScenarioError, match="no scenario file"):
        load_scenario(str(tmp_path / "none.toml"))


def test_a_file_is_loaded_by_its_path(tmp_path: Path) -> None:
    assert load_scenario(str(write(tmp_path, LEAST))).name == "mine"


@pytest.mark.parametrize(
    "options", [{"mode": "dirct"}, {"body": "box"}, {"world": "rom"}, {"duration_s": 0.0}, {"firmware": Path("/none")}]
)
def test_an_option_that_cannot_be_is_wrong_usage(options: dict[str, str]) -> None:
    with pytest.raises(UsageError) as caught:
        load_scenario("dodge").with_options(**options)  # type: ignore[arg-type]
    assert caught.value.hint


def test_options_replace_what_the_scenario_says(tmp_path: Path) -> None:
    firmware = tmp_path / "x.elf"
    firmware.write_bytes(b"")
    scenario = load_scenario("dodge").with_options(
        mode="direct", body="kinematic", world="arena", seed=7, duration_s=2.5, firmware=firmware
    )
    assert (scenario.mode, scenario.body, scenario.world, scenario.seed) == ("direct", "kinematic", "arena", 7)
    assert (scenario.duration_ns, scenario.firmware) == (2_500_000_000, firmware)
