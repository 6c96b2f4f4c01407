"""Robot files: what ships loads, what is wrong is named; counters unwrap exactly."""

from importlib.resources import files
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.protocol.odometry import Unwrapper
from p2os.robots.parameters import ParametersError, known_robots, load_parameters
from tests.tools.each_row import each_row

P2DX = files("p2os.robots").joinpath("p2dx.toml").read_text(encoding="utf-8")


@each_row("name", known_robots())
def test_a_shipped_robot_loads(name: str) -> None:
    robot = load_parameters(name.upper())
    assert robot.subclass == name
    assert robot.sonar_fitted <= len(robot.sonar)
    assert robot.motion.max_velocity_mm_s <= robot.max_velocity_mm_s
    assert robot.motion.max_rotation_deg_s <= robot.max_rotation_deg_s
    # A body that stands: the centre of mass between axle and caster, the hull off the floor and on its wheels.
    body = robot.body
    assert body.caster_x_m < (body.hull_front_m - body.hull_rear_m) / 2 < 0
    assert body.ground_clearance_m < body.wheel_diameter_m
    assert body.caster_radius_m * 2 < body.hull_height_m
    assert body.caster_x_m - body.caster_radius_m > -body.hull_rear_m


#: subclass, DistConv, VelConv, RangeConv, DiffConv, radius, width, length, front, rear, MaxVel, MaxRVel, sonar, MOVE,
#: bumpers front/rear, IO packets: ARIA's parameter files, read there.
ARIA = """\
p2dx 0.84 1 0.268 0.0056 250 425 511 210 301 2200 500 16 true -/- false
p2de 0.969 1 0.268 0.0056 250 425 511 210 301 2200 500 16 true -/- false
p2df 0.485 1 0.268 0.006 250 425 511 210 301 2200 500 16 true -/- false
p2ce 0.826 1 0.268 0.0057 250 425 511 210 301 2200 500 16 true -/- false
p2d8 0.485 1 1 0.0056 250 425 511 210 301 2200 500 16 true -/- false
p2d8+ 0.485 1 1 0.0056 250 425 511 210 301 2200 500 16 true -/- false
p2at 1.32 1 0.268 0.0034 500 505 626 313 313 1200 300 16 true -/- false
p2at8 1.32 1 1 0.0034 500 505 626 313 313 1200 300 16 true -/- false
p2at8+ 0.465 1 1 0.0034 500 505 626 313 313 1200 300 16 true -/- false
p2it 1.136 1 0.268 0.0032 500 505 626 313 313 1200 300 16 true -/- false
p2pb 0.424 1 0.268 0.0056 300 425 513 0 0 2200 500 24 true 5/5 false
p2pp 0.485 1 0.268 0.006 300 425 513 0 0 2200 500 24 true 5/5 false
perfpb 0.485 1 1 0.006 340 425 513 0 0 2200 500 32 true 5/5 true
perfpb+ 0.485 1 1 0.006 340 425 511 210 301 2200 500 32 true 5/5 true
peoplebot-sh 1 1 1 0.006 340 425 513 0 0 2200 500 32 true 5/5 true
p3dx 0.485 1 1 0.0056 250 425 511 210 301 2200 500 16 true -/- false
p3dx-sh 1 1 1 0.0056 250 425 511 210 301 2200 500 16 true -/- false
p3at 0.465 1 1 0.0034 500 505 626 313 313 1200 300 16 true -/- false
p3at-sh 1 1 1 0.0034 500 505 626 313 313 1200 300 16 true -/- false
p3atiw-sh 1 1 1 0.0034 500 490 626 313 313 1200 300 16 true -/- false
amigo 0.5083 0.6154 1 0.011 180 279 330 160 170 1000 300 8 true -/- false
amigo-sh 1 1 1 0.011 180 279 330 160 170 1000 300 8 true -/- false
powerbot 0.5813 1 1 0.00373 550 680 911 369 542 2000 360 32 true 7/5 false
powerbot-sh 1 1 1 0.00373 550 680 911 369 542 2000 360 32 true 7/5 false
patrolbot-sh 1 1 1 0.0056 250 425 510 255 255 2200 500 16 true 6/6 true
pioneer-lx 1 1 1 0.0056 348 500 696 348 348 2500 180 4 false 3/3 true
seekur 1 1 1 0.0056 833 1270 1410 705 705 2200 190 0 false 5/3 false
seekurjr 1 1 1 0.0056 600 830 1200 600 600 1200 80 0 false 4/4 false
pion1m 0.05066 2.5332 0.1734 0.00333 220 400 500 0 0 400 100 7 false -/- false
pionat 0.07 2.5332 0.1734 0.00333 330 400 500 0 0 500 100 7 false -/- false
"""


@each_row("row", ARIA.splitlines(), ids=lambda row: row.split()[0])
def test_a_model_has_the_numbers_of_arias_file(row: str) -> None:
    name, distance, velocity, ranging, difference, *rest = row.split()
    radius, width, length, front, rear, speed, turn, sonar = map(int, rest[:8])
    robot = load_parameters(name)
    assert (robot.distance_conv_mm, robot.velocity_conv) == (float(distance), float(velocity))
    assert robot.range_conv_mm == float(ranging)
    assert robot.track_mm == pytest.approx(2 / float(difference), abs=0.5)
    assert (robot.radius_mm, robot.width_mm, robot.length_mm) == (radius, width, length)
    assert abs(robot.front_mm - (front or length / 2)) <= 0.5
    assert robot.front_mm + robot.rear_mm == length or front + rear == robot.front_mm + robot.rear_mm
    assert (robot.max_velocity_mm_s, robot.max_rotation_deg_s) == (speed, turn)
    assert len(robot.sonar) == sonar
    assert robot.equipment.has_move is (rest[8] == "true")
    bumpers = "/".join(str(count or "-") for count in (robot.equipment.front_bumpers, robot.equipment.rear_bumpers))
    assert bumpers == rest[9]
    assert robot.equipment.sends_io_packets is (rest[10] == "true")
    assert robot.angle_counts_per_turn == (1024 if name in {"pion1m", "pionat"} else 4096)


def test_all_models_that_aria_has_are_there() -> None:
    arias = {row.split()[0] for row in ARIA.splitlines()}
    assert len(arias) == 30
    assert arias <= set(known_robots())


def test_speeds_in_fractions_stay_exact() -> None:
    amigo = load_parameters("amigo")
    assert (amigo.velocity_nm_s_per_count, amigo.velocity_um_s_per_count) == (615_400, 615)
    assert (load_parameters("pion1m").range_nm_per_count, load_parameters("pion1m").range_um_per_count) == (
        173_400,
        173,
    )


def test_the_conversions_are_those_of_the_manual() -> None:
    robot = load_parameters("p2dx")
    assert robot.distance_conv_mm == 0.84
    assert robot.angle_conv_rad == pytest.approx(0.001534, abs=1e-6)
    assert (robot.velocity_conv, robot.range_conv_mm, robot.vel2_divisor) == (1.0, 0.268, 20)
    assert load_parameters("p3dx").distance_conv_mm == 0.485


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("track_mm = 357", "", r"\[conversion\]: key 'track_mm' is missing"),
        ("track_mm = 357", "track_mm = 0", "is out of range"),
        ("track_mm = 357", "track_mm = true", "is not a whole number"),
        ("track_mm = 357", "track = 357\ntrack_mm = 357", "unknown key 'track'"),
        ("fitted = 8", "fitted = -1", "is out of range"),
        ('firmware = ["P2OS"]', 'firmware = "ARCO"', r"firmware = 'ARCO' is not of P2OS, AROS, ARCOS"),
        ('firmware = ["P2OS"]', "firmware = []", r"firmware = \[\] is not of"),
        ('firmware = ["P2OS"]', "firmware = 3", "firmware = 3 is not a text"),
        ('title = "Pioneer 2-DX"', "title = 3", "is not a line of printable ASCII"),
        ("mass_kg = 9.0", 'mass_kg = "9 kg"', "is not a number"),
        ("[motion]", "[motions]", "unknown key 'motions'"),
        ("[limits]", "[limits", "p2dx"),
        ("front_bumpers = 0", "front_bumpers = -1", r"\[equipment\]: front_bumpers = -1 is out of range"),
        ("has_move = true", "has_move = 1", "is not true or false"),
        ("has_move = true", "has_moves = true", "unknown key 'has_moves'"),
        ("range_um_per_count = 268", 'range_um_per_count = "268"', "is not a number"),
        ("[69, 136, 90], ", "[69, 136], ", "poses = .* is not a list of lists of 3 numbers"),
        ("[69, 136, 90], ", "[69, 136, inf], ", "poses: .* is out of range"),
        ("fitted = 8", "fitted = 17", "only 16 poses"),
        ("range_um_per_count = 268", "range_um_per_count = inf", "out of range"),
        ("mass_kg = 9.0", "mass_kg = nan", "out of range"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = tmp_path / "p2dx.toml"
    assert old in P2DX
    path.write_text(P2DX.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ParametersError, match=said):
        load_parameters(path)


@pytest.mark.parametrize("ending", ["toml", "p"])
def test_a_file_that_cannot_be_read_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str) -> None:
    def refuse(*_: object, **__: object) -> str:
        raise PermissionError(13, "Permission denied")

    path = tmp_path / f"mine.{ending}"
    path.write_text("", encoding="utf-8")
    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(ParametersError, match=r"cannot read .* permission denied"):
        load_parameters(path)


def test_a_section_that_is_no_table_is_named(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('subclass = "x"\nrobot_class = "y"\ntitle = "z"\nconversion = 1\n', encoding="utf-8")
    with pytest.raises(ParametersError, match="conversion = 1 is not a table"):
        load_parameters(path)


def test_a_file_of_ones_own_may_be_based_on_a_shipped_one(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('based_on = "p2dx"\nsubclass = "mine"\n[conversion]\ntrack_mm = 360\n', encoding="utf-8")
    assert (load_parameters(path).track_mm, load_parameters(path).vel2_divisor) == (360, 20)
    assert load_parameters(path).firmware == ("P2OS",)
    path.write_text('firmware = ["ARCOS", "AROS", "ARCOS"]\nbased_on = "p3dx"\nsubclass = "mine"\n', encoding="utf-8")
    assert load_parameters(path).firmware == ("ARCOS", "AROS")
    path.write_text('based_on = "p2dx"\n[title]\nx = 1\n', encoding="utf-8")
    with pytest.raises(ParametersError, match=r"title = .* is not a line"):
        load_parameters(path)
    path.write_text("x = " + "[" * 5000, encoding="utf-8")
    with pytest.raises(ParametersError, match="nested too deeply"):
        load_parameters(path)
    path.write_text('based_on = "none"\n', encoding="utf-8")
    with pytest.raises(ParametersError, match="no shipped model"):
        load_parameters(path)


@pytest.mark.parametrize(("name", "hint"), [("p2xd", "p2dx"), ("zzzzzz", "known are amigo, ")])
def test_an_unknown_robot_gets_a_hint(name: str, hint: str) -> None:
    with pytest.raises(ParametersError) as caught:
        load_parameters(name)
    assert hint in str(caught.value.hint)


@pytest.mark.parametrize("modulus", [4096, 32768])
@given(st.data())
def test_any_step_below_half_the_modulus_is_exact(modulus: int, data: st.DataObject) -> None:
    steps = data.draw(st.lists(st.integers(-modulus // 2, modulus // 2 - 1), max_size=30))
    unwrapper, position = Unwrapper(modulus), data.draw(st.integers(0, 65535))
    assert unwrapper.update(position) == 0
    for step in steps:
        position += step
        assert unwrapper.update(position % modulus) == step
    assert unwrapper.total == sum(steps)
    other = Unwrapper(modulus)
    other.restore(unwrapper.snapshot())
    assert other.update(position + 3) == unwrapper.update(position + 3) == 3


def test_after_forgetting_the_next_value_is_a_new_beginning() -> None:
    unwrapper = Unwrapper(32768)
    unwrapper.update(5)
    unwrapper.forget()
    assert unwrapper.update(20000) == 0
