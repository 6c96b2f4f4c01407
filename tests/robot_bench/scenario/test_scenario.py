"""Scenario files: what ships is right, and what is wrong is one line that says where."""

from dataclasses import replace
from pathlib import Path

import pytest

from adapter_sim.codec import BitOrder
from adapter_sim.settings import AdapterSettings
from p2os.errors import ScenarioError
from p2os.pioneer.controller.settings import SonarPerSip
from p2os.pioneer.world import load_world
from p2os.toml_record import keys_of
from robot_bench.bench import Bench
from robot_bench.scenario.goals.kinds import every_kind
from robot_bench.scenario.hands.doing import ACTION_TABLES
from robot_bench.scenario.loading import known_scenarios, load_scenario, read_scenario
from robot_bench.scenario.tables import TABLES
from robot_bench.scenario.world_script import Op
from simbase.errors import P2osError, UsageError

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
    assert scenario.goals or name == "free-drive"
    if scenario.own_robot is not None or scenario.robots:  # neither the adapter nor its threshold; or several
        assert scenario.body == "kinematic"
        return
    assert "threshold_m" in scenario.text
    assert scenario.adapter.threshold_um == scenario.threshold_um
    assert scenario.body == "bullet"


def test_the_four_programs_and_a_scenario_without_goals_ship() -> None:
    assert set(known_scenarios()) >= {"free-drive", "motors", "sensors", "encoders", "dodge"}


def test_what_a_scenario_leaves_out_has_its_default(tmp_path: Path) -> None:
    scenario = read_scenario(write(tmp_path, LEAST))
    assert (scenario.mode, scenario.body, scenario.seed, scenario.duration_ns) == ("adapter", "best", 0, 10**10)
    assert scenario.threshold_um == 2_500_000, "half of the robot file's sonar range of 5 m"
    assert scenario.start is None


@pytest.mark.parametrize("name", [key.name for key in TABLES["[adapter]"] if key.name.endswith("_ms")])
def test_a_time_of_the_adapter_is_one_of_its_settings(name: str, tmp_path: Path) -> None:
    scenario = read_scenario(write(tmp_path, f"{LEAST}[adapter]\n{name} = 123\n"))
    changed = replace(AdapterSettings(threshold_um=2_500_000), **{f"{name.removesuffix('_ms')}_ns": 123_000_000})
    assert scenario.adapter == changed


def test_times_of_the_adapter_that_fit_no_other_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"adapter.*refresh_ns \(24000000\) is below pair_spacing_ns"):
        read_scenario(write(tmp_path, f"{LEAST}[adapter]\nrefresh_ms = 24\n"))
    assert read_scenario(write(tmp_path, f"{LEAST}[adapter]\nrefresh_ms = 25\n")).adapter.refresh_ns == 25_000_000


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
        name = "parcel"
        x_m = 1
        y_m = 2
        length_m = 0.3
        width_m = 0.2
        height_m = 0.4
        [[obstacle]]
        at_s = 2
        op = "move"
        name = "parcel"
        x_m = 1
        y_m = 1
    """,
        )
    )
    steps = [(change.at / 1e9, change.op, change.name) for change in scenario.changes]
    assert steps == [
        (0.5, Op.PLACE, "parcel"), (1.0, Op.PLACE, "post"), (1.05, Op.MOVE, "post"), (1.1, Op.MOVE, "post"),
        (1.15, Op.REMOVE, "post"), (2.0, Op.MOVE, "parcel"),
    ]  # fmt: skip


BOX = '[[obstacle]]\nat_s = 1\nname = "a"\nx_m = 0\ny_m = 0\nlength_m = 1\nwidth_m = 1\nheight_m = 1\n'


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        ("=", "mine.toml:1: Invalid statement", "not TOML"),
        (LEAST + "treshold_m = 1\n", "mine.toml:4: unknown key 'treshold_m'", "threshold_m"),
        (LEAST + "threshold_cm = 60\n", "mine.toml:4: unknown key 'threshold_cm'", "threshold_m"),
        (LEAST + 'threshold_m = "60 cm"\n', 'threshold_m = "60 cm" is not a number of metres', "bare number"),
        (LEAST + "threshold_m = true\n", "threshold_m = true is not a number of metres", None),
        (LEAST + "threshold_m = nan\n", "threshold_m = nan is out of range", "above 0"),
        (LEAST + "seed = 1.5\n", "seed = 1.5 is not a whole number", None),
        (LEAST + "seed = -1\n", "seed = -1 is out of range", "at least 0"),
        (LEAST + 'body = "bulet"\n', "mine.toml:4: body: there is no body 'bulet'", "bullet"),
        ('firmware = "dodge"\nworld = "room"\n', "key 'duration_s' is missing", "seconds above 0"),
        (LEAST.replace("room", "rom"), "world: there is no world 'rom'", "room"),
        (LEAST.replace("room", "my.toml"), "there is no world file", "worlds that ship"),
        (LEAST.replace("dodge", "doge"), "firmware: there is no file 'doge'", "build it first"),
        (LEAST + "[direct]\nramp = 3\n", "[direct]: unknown key 'ramp'", "ramp_mm_s2"),
        (LEAST + "[start]\nx_m = 1\n", "[start]: key 'y_m' is missing", "metres"),
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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOX.replace('"a"', '"crate"'), "mine.toml:4: [[obstacle]] 1: 'crate' at 1 s: world 'room' has a thing"),
        (
            '[[obstacle]]\nat_s = 1\nop = "remove"\nname = "a"\n',
            "mine.toml:4: [[obstacle]] 1: 'a' at 1 s: there is none",
        ),
        (
            BOX.replace("height_m = 1", "height_m = 1e300"),
            "mine.toml:11: [[obstacle]] 1: height_m = 1e+300 is out of range",
        ),
        (
            BOX.replace("x_m = 0\ny_m = 0", "before_sonar = 1\ndistance_m = 1\nhold_s = 1e30"),
            "mine.toml:9: [[obstacle]] 1: hold_s = 1e+30 is out of range",
        ),
        ("start = { x_m = inf, y_m = 0 }\n", "mine.toml:4: [start]: x_m = inf is out of range"),
    ],
)
def test_what_its_world_or_no_world_bears_is_refused_by_file_and_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        read_scenario(write(tmp_path, LEAST + text))
    assert str(caught.value).startswith(message)


def test_a_start_inside_a_thing_is_refused_by_its_name(tmp_path: Path) -> None:
    thing = next(item for item in load_world("room").obstacles if item.name == "crate")
    place = f"x_m = {thing.x_m}\ny_m = {thing.y_m}\n"
    inline = f"start = {{ {place.replace(chr(10), ', ', 1).strip()} }}\n"
    for text, at in (
        (inline, "mine.toml:4: [start]"),
        (f"[start]\n{place}", "mine.toml:4: [start]"),
        (f"[in_world.room]\nthreshold_m = 1\n{inline}", "mine.toml:6: [in_world.room.start]"),
        (f"[in_world.room.start]\n{place}", "mine.toml:4: [in_world.room.start]"),
    ):
        with pytest.raises(ScenarioError) as caught:
            read_scenario(write(tmp_path, LEAST + text))
        where = f"x {thing.x_m:g}, y {thing.y_m:g} in world 'room'"
        assert str(caught.value) == f"{at}: {where} is inside 'crate'"


def test_a_worlds_own_start_inside_a_thing_is_refused_by_the_worlds_file_and_line(tmp_path: Path) -> None:
    (tmp_path / "yard.toml").write_text(
        'name = "yard"\nextent_m = [-3, -3, 3, 3]\n[start]\nx_m = 1\n'
        '[[cylinder]]\nname = "post"\nx_m = 1\ny_m = 0\nradius_m = 0.1\n'
    )
    with pytest.raises(ScenarioError) as caught:
        read_scenario(write(tmp_path, LEAST.replace("room", "yard.toml")))
    assert str(caught.value) == f"{tmp_path / 'yard.toml'}:3: [start]: x 1, y 0 in world 'yard' is inside 'post'"


@pytest.mark.parametrize(("x_m", "is_in"), [(2.999, True), (3.001, False), (-3.001, False)])
def test_a_start_beyond_the_floor_is_refused_with_its_extent(tmp_path: Path, x_m: float, is_in: bool) -> None:
    (tmp_path / "yard.toml").write_text('name = "yard"\nextent_m = [-3, -2, 3, 2]\n')
    path = write(tmp_path, LEAST.replace("room", "yard.toml") + f"[start]\nx_m = {x_m}\ny_m = 0\n")
    if is_in:
        assert read_scenario(path).start is not None
        return
    with pytest.raises(ScenarioError) as caught:
        read_scenario(path)
    assert str(caught.value) == f"mine.toml:4: [start]: x {x_m:g}, y 0 is not in world 'yard'"
    assert caught.value.hint == "x is -3 to 3 m there, and y -2 to 2 m"


POST = 'name = "post"\nshape = "cylinder"\nradius_m = 0.1\nheight_m = 1\nx_m = 2\ny_m = 0\n'


@pytest.mark.parametrize(
    ("table", "what"), [(f"[[obstacle]]\n{POST}", "[[obstacle]] 1"), ('[[fault]]\nfault = "reboot"\n', "[[fault]] 1")]
)
@pytest.mark.parametrize(("at_s", "more", "is_over"), [
    ("9.999", "", False), ("10", "", True), ("10.5", "", True),
    ("10", "[in_world.ramp]\nduration_s = 11\n", False), ("11", "[in_world.ramp]\nduration_s = 11\n", True),
    ("9.999", "[in_world.ramp]\nduration_s = 3\n", False), ("10", "[in_world.ramp]\nthreshold_m = 1\n", True),
])  # fmt: skip
def test_what_would_come_after_the_end_is_refused_by_file_and_line(
    tmp_path: Path, table: str, what: str, at_s: str, more: str, *, is_over: bool
) -> None:
    path = write(tmp_path, f"{LEAST}{table}at_s = {at_s}\n{more}")
    if is_over:
        with pytest.raises(ScenarioError) as caught:
            read_scenario(path)
        assert str(caught.value) == f"mine.toml:4: {what}: at_s = {at_s}: the run is over by then"
        assert caught.value.hint == f"duration_s is {11 if 'duration_s' in more else 10}"
    else:
        read_scenario(path)
    read_scenario(path, settings=[("duration_s", 1.0)])  # a run that is cut short beside the file


def test_what_is_otherwise_in_a_world_that_there_is_not_is_refused_by_file_and_line(tmp_path: Path) -> None:
    for world, says, hint in (
        ("rooom", "there is no world 'rooom'", "did you mean 'room'?"),
        ('"yard.toml"', f"there is no world file {tmp_path / 'yard.toml'}", "worlds that ship: "),
    ):
        with pytest.raises(ScenarioError, match=r"^mine\.toml:4: \[in_world\.") as caught:
            read_scenario(write(tmp_path, f"{LEAST}[in_world.{world}]\nthreshold_m = 1\n"))
        assert says in str(caught.value)
        assert str(caught.value.hint).startswith(hint)


def test_what_is_otherwise_in_a_world_of_a_file_beside_it_is_so(tmp_path: Path) -> None:
    (tmp_path / "yard.toml").write_text('name = "yard"\nextent_m = [-3, -3, 3, 3]\n')
    text = LEAST.replace("room", "yard.toml") + '[in_world."yard.toml"]\nduration_s = 7\n'
    assert read_scenario(write(tmp_path, text)).planned_ns == 7 * 10**9
    away = read_scenario(write(tmp_path, text.replace('world = "yard.toml"', 'world = "room"')))
    assert away.planned_ns == 10 * 10**9
    assert away.with_options(world=str(tmp_path / "yard.toml")).planned_ns == 7 * 10**9


def test_a_start_of_a_world_that_an_option_moves_to_has_its_line_too(tmp_path: Path) -> None:
    text = LEAST + "[in_world.corridor]\nstart = { x_m = 900, y_m = 0 }\n"
    moved = read_scenario(write(tmp_path, text)).with_options(world="corridor", body="kinematic")
    with pytest.raises(ScenarioError, match=r"^mine.toml:5: \[in_world.corridor.start\]: x 900, y 0 is not in world"):
        Bench(moved)


def test_a_program_that_moves_a_scenario_to_another_world_is_told_of_its_names_too(tmp_path: Path) -> None:
    scenario = read_scenario(write(tmp_path, LEAST + BOX.replace('"a"', '"plant"')))
    moved = scenario.with_options(world="corridor", body="kinematic")
    with pytest.raises(ScenarioError, match="world 'corridor' has a thing of that name"):
        Bench(moved)


def test_every_number_of_a_scenario_has_a_range() -> None:
    keys = [key for table in TABLES.values() for key in table]
    keys += [key for kind in every_kind().values() for key in keys_of(kind.table)]
    keys += [key for action in ACTION_TABLES.values() for key in keys_of(action)]
    numbers = [key for key in keys if key.kind in {"number", "whole"}]
    assert len(numbers) > 100
    assert [key.name for key in numbers if key.most is None or (key.least is None and key.above is None)] == []


def test_every_key_says_what_it_is_for() -> None:
    keys = [key for table in TABLES.values() for key in table]
    keys += [key for kind in every_kind().values() for key in keys_of(kind.table)]
    keys += [key for action in ACTION_TABLES.values() for key in keys_of(action)]
    assert [key.name for key in keys if not key.doc] == []
    assert [name for name, kind in every_kind().items() if not kind.doc] == []


def test_a_scenario_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(LEAST, encoding="utf-8-sig")
    assert read_scenario(path).world == "room"


def test_a_scenario_whose_own_program_is_not_built_runs_another(tmp_path: Path) -> None:
    other = tmp_path / "other.elf"
    other.write_bytes(b"")
    path = write(tmp_path, LEAST.replace("dodge", "build/none.elf"))
    with pytest.raises(ScenarioError, match=r"there is no file 'build/none\.elf'") as refused:
        load_scenario(str(path))
    assert "--firmware" in str(refused.value.hint)
    assert load_scenario(str(path), firmware=other).firmware == other


@pytest.mark.parametrize(("from_s", "is_refused"), [(9.999_999_999, False), (10, True), (11, True)])
def test_a_goal_whose_window_begins_when_the_run_is_over_is_refused(
    from_s: float, is_refused: bool, tmp_path: Path
) -> None:
    path = write(tmp_path, f'{LEAST}[[goal]]\nkind = "always"\nsignal = "x_m"\nleast = 0\nfrom_s = {from_s}\n')
    if is_refused:
        with pytest.raises(ScenarioError, match=r"mine.toml:4: \[\[goal\]\] 1: from_s = 1\d: the run is over by then"):
            read_scenario(path)
    else:
        assert len(read_scenario(path).goals) == 1
