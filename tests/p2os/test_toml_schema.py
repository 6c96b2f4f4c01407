"""A table of a user's file against its keys: what is let through, and what is said of the rest."""

import pytest

from p2os.errors import ScenarioError, WorldError
from p2os.toml_file import TomlSource, find_places
from p2os.toml_schema import Key, TablePlace, check_table, filled, placed, within
from simbase.errors import FileError, MissingDependencyError, UsageError

WHERE = TablePlace(TomlSource("w.toml", find_places("a = 1\n[[row]]\nb = 2\n")), error=WorldError)
NUMBERS = Key(name="a", kind="numbers", count=2, least=0, most=9)
POINTS = Key(name="a", kind="points", count=2, least=0, most=9)
LINE, ASCII = Key(name="a", kind="line", most=3), Key(name="a", kind="ascii", most=3)


@pytest.mark.parametrize(
    ("key", "good", "bad"),
    [
        (NUMBERS, ([0, 9], [0.5, 1]), ([1], [1, 2, 3], [1, -1], [1, 9.5], [1, True], [1, "2"], 3, [1, float("nan")])),
        (POINTS, ([], [[0, 9]], [[1, 2], [3, 4]]), ([1, 2], [[1]], [[1, 2, 3]], [[1, 2], [10, 0]], 3)),
        (LINE, ("", "abc", "äöü"), ("abcd", "a\n", 3)),
        (ASCII, ("abc",), ("äö", "abcd", "a\t")),
        (Key(name="a", kind="whole", above=0, most=3), (1, 3), (0, 4, 1.0, True)),
        (Key(name="a", kind="flag"), (True, False), (1, "true")),
        (Key(name="a", kind="any"), (1, "x", True, [2]), ()),
        (Key(name="a", kind="tables"), ([], [{}]), ({}, [1])),
        (Key(name="a", kind="text", choices=("x", "y")), ("x",), ("z", 1)),
    ],
    ids=lambda value: value.kind if isinstance(value, Key) else "",
)
def test_a_value_is_of_its_kind_and_range_or_refused_by_its_place(
    key: Key, good: tuple[object, ...], bad: tuple[object, ...]
) -> None:
    for value in good:
        check_table({"a": value}, [key], WHERE)
    for value in bad:
        with pytest.raises(WorldError, match=r"^w\.toml:1: a = "):
            check_table({"a": value}, [key], WHERE)


def test_what_is_left_out_has_its_default_or_is_missed() -> None:
    at = within(WHERE, "row", 0)
    assert filled({"b": 1}, [Key(name="b", kind="whole"), Key(name="c", kind="text", default="x")], at) == {
        "b": 1,
        "c": "x",
    }
    with pytest.raises(WorldError, match=r"^w\.toml:2: \[\[row\]\] 1: key 'c' is missing"):
        filled({"b": 1}, [Key(name="b", kind="whole"), Key(name="c", kind="text", required=True)], at)
    with pytest.raises(WorldError, match=r"^w\.toml:3: \[\[row\]\] 1: unknown key 'b'"):
        filled({"b": 1}, [], at)
    with pytest.raises(ScenarioError, match=r"^here: unknown key 'b'"):
        check_table({"b": 1}, [], "here")


def test_an_error_gets_its_place_but_not_one_of_what_is_not_installed() -> None:
    with (
        pytest.raises(WorldError, match=r"(?m)^w\.toml:3: \[\[row\]\] 1: odd$") as caught,
        placed(within(WHERE, "row", 0), "b"),
    ):
        raise UsageError("odd", hint="even")
    assert caught.value.hint == "even"
    with pytest.raises(MissingDependencyError, match=r"^no reader$"), placed(WHERE):
        raise MissingDependencyError("no reader")
    assert issubclass(WorldError, FileError)
