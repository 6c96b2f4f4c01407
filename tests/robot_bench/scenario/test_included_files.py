"""Scenario files that extend and include others, keys set beside them, and parameters that are swept."""

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from p2os.errors import ScenarioError
from robot_bench.scenario.included_files import MOST_FILES, as_toml, read_setting
from robot_bench.scenario.loading import load_scenario, read_scenario
from robot_bench.scenario.scenario import Scenario
from robot_bench.scenario.sweep import read_seeds, rows
from simbase.errors import UsageError

BASE = """
firmware = "dodge.elf"
world = "room"
duration_s = 5.0
threshold_m = 0.4
[start]
x_m = 0.5
y_m = 0.0
[[goal]]
kind = "no_collision"
"""
POST = """
[[obstacle]]
at_s = 1.0
name = "{name}"
shape = "cylinder"
radius_m = 0.1
height_m = 0.5
x_m = {x}
y_m = 1.0
"""


def write(folder: Path, **texts: str) -> Path:
    """Write scenario files; return the last."""
    for name, text in texts.items():
        path = folder / f"{name}.toml"
        path.write_text(text, encoding="utf-8")
    return path


def refused(path: Path, *settings: str) -> str:
    with pytest.raises((ScenarioError, UsageError)) as caught:
        read_scenario(path, settings=[read_setting(text) for text in settings])
    return str(caught.value)


def test_what_a_file_says_holds_before_what_it_extends(tmp_path: Path) -> None:
    path = write(tmp_path, base=BASE, mine='extends = "base.toml"\nthreshold_m = 0.6\n[start]\ny_m = 0.25\n')
    found = read_scenario(path)
    assert (found.threshold_m, found.duration_ns, found.world) == (0.6, 5_000_000_000, "room")
    assert found.start is not None
    assert (found.start.x_m, found.start.y_m) == (0.5, 0.25)
    assert [goal.kind for goal in found.goals] == ["no_collision"]


def test_a_list_takes_the_place_of_one_that_is_extended_and_follows_one_that_is_included(tmp_path: Path) -> None:
    goal = '[[goal]]\nkind = "cells"\nleast = 2\n'
    extended = read_scenario(write(tmp_path, base=BASE, mine=f'extends = "base.toml"\n{goal}'))
    included = read_scenario(write(tmp_path, base=BASE, mine=f'include = "base.toml"\n{goal}'))
    assert [one.kind for one in extended.goals] == ["cells"]
    assert [one.kind for one in included.goals] == ["no_collision", "cells"]


def test_a_scenario_that_ships_can_be_extended_and_its_program_found(tmp_path: Path) -> None:
    found = read_scenario(write(tmp_path, mine='extends = "dodge"\nduration_s = 7\n'))
    assert (found.firmware.name, found.duration_ns, len(found.goals)) == (
        "dodge.elf",
        7_000_000_000,
        len(load_scenario("dodge").goals),
    )
    assert found.text.startswith("# dodge.toml:\n")
    assert "# mine.toml:\n" in found.text


def test_a_file_that_an_included_file_names_stands_beside_that_one(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    (other / "my.bin").write_bytes(b"x")
    write(other, base=BASE.replace("dodge.elf", "my.bin"))
    found = read_scenario(write(tmp_path, mine='extends = "other/base.toml"\n'))
    assert found.firmware.samefile(other / "my.bin")


@pytest.mark.parametrize(
    ("wrong", "at"),
    [
        (("base", "x_m = 0.5", 'x_m = "a"'), "base.toml:7: [start]: x_m"),
        (("posts", "x_m = 2.0", "x_m = true"), "posts.toml:8: [[obstacle]] 1: x_m"),
        (("more", "radius_m = 0.1", "radius_m = -1"), "more.toml:6: [[obstacle]] 2: radius_m"),
        (("more", "radius_m = 0.1", ""), "more.toml:2: [[obstacle]] 2"),
        (("mine", "least = 2", "least = 0"), "mine.toml:5: [[goal]] 1: least"),
        (("mine", "least = 2", "most = 2"), "mine.toml:5: [[goal]] 1: unknown key 'most'"),
        (("posts", 'name = "p"', 'name = "q"'), "more.toml:2: [[obstacle]] 2: 'q' is placed at 1 s while it is there"),
        (
            ("base", "threshold_m = 0.4", "version = 9"),
            "base.toml:5: a scenario of version 9, and this program reads up to 1",
        ),
        (("mine", '"base.toml"', '"basis.toml"'), "mine.toml:1: extends: there is no file 'basis.toml' beside it"),
        (("posts", "[[obstacle]]", "[[obstacle"), "posts.toml:2: "),
        (("mine", '["posts.toml", "more.toml"]', "[3]"), "mine.toml:2: include = [3] is not a text in quotes, or"),
    ],
)
def test_an_error_names_the_file_and_the_line_where_it_stands(
    wrong: tuple[str, str, str], at: str, tmp_path: Path
) -> None:
    texts = {
        "base": BASE, "posts": POST.format(name="p", x="2.0"), "more": POST.format(name="q", x="-1.0"),
        "mine": 'extends = "base.toml"\ninclude = ["posts.toml", "more.toml"]\n[[goal]]\nkind = "cells"\nleast = 2\n',
    }  # fmt: skip
    assert len(read_scenario(write(tmp_path, **texts)).changes) == 2
    name, old, new = wrong
    assert old in texts[name]
    texts[name] = texts[name].replace(old, new, 1)
    assert refused(write(tmp_path, **texts)).startswith(at)


def test_files_that_include_each_other_are_refused_in_one_line(tmp_path: Path) -> None:
    path = write(tmp_path, b=f'include = "a.toml"\n{BASE}', a='extends = "b.toml"\n')
    assert refused(path) == "b.toml:1: include: a.toml includes b.toml includes a.toml"
    assert refused(write(tmp_path, c='include = ["c.toml"]\n')) == "c.toml:1: include: c.toml includes c.toml"


def test_files_that_include_each_other_twice_each_are_too_many(tmp_path: Path) -> None:
    for number in range(20):
        (tmp_path / f"f{number}.toml").write_text(f'include = ["f{number + 1}.toml", "f{number + 1}.toml"]\n')
    (tmp_path / "f20.toml").write_text(BASE)
    assert refused(tmp_path / "f0.toml") == f"f0.toml includes more than {MOST_FILES} files"


def test_a_key_is_set_after_all_files_and_an_error_names_the_option(tmp_path: Path) -> None:
    path = write(tmp_path, base=BASE + POST.format(name="p", x="2.0"), mine='extends = "base.toml"\n')
    found = read_scenario(path, settings=[("start.x_m", 1.5), ("obstacle.p.x_m", -2.0), ("seed", 4)])
    assert found.start is not None
    assert (found.start.x_m, found.changes[0].x_m, found.seed) == (1.5, -2.0, 4)
    assert found.text.endswith("# --set seed=4")
    assert refused(path, "obstacle.1.radius_m=-1").startswith(
        "--set obstacle.1.radius_m: [[obstacle]] 1: radius_m = -1"
    )
    assert refused(path, "start.x_m=far").startswith('--set start.x_m: [start]: x_m = "far" is not a number')
    assert refused(path, "obstacle.2.x_m=1") == "--set obstacle.2.x_m: there is no '2' in this list"
    assert refused(path, "threshold_m.x=1") == "--set threshold_m.x: 'threshold_m' is no table with keys"


@pytest.mark.parametrize("setting", ["extends=gone", "include=x", 'include=["base.toml"]', "extends.x=1"])
def test_files_cannot_be_named_beside_the_file_that_names_them(setting: str, tmp_path: Path) -> None:
    path = write(tmp_path, base=BASE, mine='extends = "base.toml"\n')
    key = setting.partition("=")[0]
    assert refused(path, setting) == f"--set {key}: files are named in the scenario's own file"


TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\x7f"), max_size=9)
NUMBERS = st.one_of(st.booleans(), st.integers(), st.floats(allow_nan=False, allow_infinity=False))
VALUES = st.recursive(
    st.one_of(NUMBERS, TEXTS),
    lambda inside: st.one_of(st.lists(inside, max_size=3), st.dictionaries(TEXTS, inside, max_size=2)),
    max_leaves=5,
)


@given(VALUES)
@example(["spi1"])
@example({"x_m": 1, "names": ["a"]})
@example(" 1")
def test_a_value_that_is_typed_again_is_the_same(value: object) -> None:
    _, again = read_setting(f"key={as_toml(value)}")
    assert again == value
    assert type(again) is type(value)


def swept(tmp_path: Path, table: str) -> Scenario:
    return read_scenario(write(tmp_path, mine=f"{BASE}[sweep]\n{table}\n"))


def test_each_value_of_a_parameter_goes_with_each_of_the_others(tmp_path: Path) -> None:
    found = swept(tmp_path, "threshold_m = [0.4, 0.6]\nstart.heading_deg = { from = 0, to = 90, step = 45 }")
    assert list(rows(found.axes)) == [
        (("threshold_m", threshold), ("start.heading_deg", heading))
        for threshold in (0.4, 0.6) for heading in (0, 45, 90)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("words", "values"),
    [
        ("{ from = 0.1, to = 0.5, step = 0.1 }", (0.1, 0.2, 0.3, 0.4, 0.5)),
        ("{ from = 0, to = 1, step = 0.4 }", (0.0, 0.4, 0.8)),
        ("{ from = 2, to = 2, step = 1 }", (2,)),
        ("{ from = -3, to = 3, step = 3 }", (-3, 0, 3)),
    ],
)
def test_a_range_has_both_ends_and_its_values_as_one_writes_them(
    words: str, values: tuple[float, ...], tmp_path: Path
) -> None:
    (axis,) = swept(tmp_path, f"start.x_m = {words}").axes
    assert axis.values == values


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("x = []", "mine.toml:12: [sweep]: x = [] is no list of values"),
        ("x = 3", "mine.toml:12: [sweep]: x = 3 is no list of values"),
        ("x = { from = 1, to = 0, step = 1 }", "mine.toml:12: [sweep]: x: to is below from"),
        ("x = { from = 1, to = 2, step = 0 }", "mine.toml:12: [sweep]: x: step = 0 is out of range"),
        ("x = { from = 1, to = 2 }", "mine.toml:12: [sweep]: x: key 'step' is missing"),
        ("x = { from = 0, to = 1e9, step = 1 }", "mine.toml:12: [sweep]: x: more than 100000 values"),
        ("x = { from = 0, to = inf, step = 1 }", "mine.toml:12: [sweep]: x: a range has ends"),
        ("x = [{ y = 1 }]", "mine.toml:12: [sweep]: x: a table cannot be swept"),
    ],
)
def test_what_is_no_sweep_is_refused_with_its_line(words: str, said: str, tmp_path: Path) -> None:
    assert said in refused(write(tmp_path, mine=f"{BASE}[sweep]\n{words}\n"))


def test_a_parameter_that_is_set_is_not_swept(tmp_path: Path) -> None:
    path = write(tmp_path, mine=f"{BASE}[sweep]\nseed = [1, 2]\nthreshold_m = [0.4, 0.6]\n")
    assert [axis.key for axis in read_scenario(path, settings=[("seed", 7)]).axes] == ["threshold_m"]


def test_seeds_are_a_range_or_a_list_each_once_in_their_order() -> None:
    assert read_seeds("0-3") == (0, 1, 2, 3)
    assert read_seeds("7, 1-2,2") == (7, 1, 2)
    assert len(read_seeds("0-99999")) == 100_000
    for wrong in ("", "a", "3-1", "1-", "-1", "1,,2", f"{2**63}", "0-100000"):
        with pytest.raises(UsageError):
            read_seeds(wrong)


def test_a_scenario_that_has_none_of_this_has_no_rows_to_sweep() -> None:
    found = load_scenario("dodge")
    assert (found.seeds, found.axes, list(rows(found.axes))) == ((), (), [()])
