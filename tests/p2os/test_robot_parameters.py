"""Robot files: what ships loads, what is wrong is named; counters unwrap exactly."""

from importlib.resources import files
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.odometry import Unwrapper
from p2os.parameters import ParametersError, known_robots, load_parameters

P2DX = files("p2os.robots").joinpath("p2dx.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", known_robots())
def test_a_shipped_robot_loads(name: str) -> None:
    robot = load_parameters(name.upper())
    assert robot.subclass == name
    assert robot.sonar_fitted <= len(robot.sonar)
    assert robot.track_mm == 357


def test_the_conversions_are_those_of_the_manual() -> None:
    robot = load_parameters("p2dx")
    assert robot.distance_conv_mm == 0.84
    assert robot.angle_conv_rad == pytest.approx(0.001534, abs=1e-6)
    assert (robot.velocity_conv, robot.range_conv_mm, robot.vel2_divisor) == (1.0, 0.268, 20)
    assert load_parameters("p3dx").distance_conv_mm == 0.485


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("track_mm = 357", "", "conversion.track_mm is missing"),
        ("track_mm = 357", "track_mm = 0", "must be positive"),
        ("track_mm = 357", "track_mm = true", "is no int"),
        ("track_mm = 357", "track = 357\ntrack_mm = 357", "unknown key conversion.track"),
        ("fitted = 8", "fitted = -1", "must be positive"),
        ('title = "Pioneer 2-DX"', "title = 3", "is no str"),
        ("mass_kg = 9.0", 'mass_kg = "9 kg"', "is no float"),
        ("[motion]", "[motions]", "unknown key motions"),
        ("[limits]", "[limits", "p2dx"),
        ("[69, 136, 90], ", "[69, 136], ", "sonar.poses"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    path = tmp_path / "p2dx.toml"
    assert old in P2DX
    path.write_text(P2DX.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ParametersError, match=said):
        load_parameters(path)


def test_a_section_that_is_no_table_is_named(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('subclass = "x"\nrobot_class = "y"\ntitle = "z"\nconversion = 1\n', encoding="utf-8")
    with pytest.raises(ParametersError, match=r"\[conversion\] is missing"):
        load_parameters(path)


def test_a_file_of_ones_own_may_be_based_on_a_shipped_one(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('based_on = "p2dx"\nsubclass = "mine"\n[conversion]\ntrack_mm = 360\n', encoding="utf-8")
    assert (load_parameters(path).track_mm, load_parameters(path).vel2_divisor) == (360, 20)
    path.write_text('based_on = "none"\n', encoding="utf-8")
    with pytest.raises(ParametersError, match="no shipped model"):
        load_parameters(path)


@pytest.mark.parametrize(("name", "hint"), [("p2xd", "p2dx"), ("zzzzzz", "known models")])
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
