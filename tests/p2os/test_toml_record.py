"""A record declares a table once: what is read is typed, what is wrong is told with its line, and others can ask."""

from collections.abc import Mapping
from dataclasses import field
from enum import Enum
from typing import Annotated, Literal

import pytest
from hypothesis import given as each
from hypothesis import strategies as st

from p2os.errors import ScenarioError
from p2os.toml_file import TomlSource, read_toml
from p2os.toml_record import Record, given, keys_of, number_of, read, read_part, sections, table_of, tables_of
from p2os.toml_schema import Key, Table, TablePlace
from simbase.errors import UsageError


class Colour(Enum):
    RED = "red"


class Inner(Record):
    x_m: Annotated[float, Key(least=-1, most=1, doc="its place")]
    note: str = "no key"


class Middle(Record):
    inner: Annotated[Inner | None, Key()] = None


class Outer(Record):
    from_: Annotated[int, Key(least=0, most=9)]
    share: Annotated[float | None, Key(above=0, most=1)] = None
    volts: Annotated[int | float, Key(kind="number", least=0, most=25)] = 12
    colour: Annotated[Colour, Key()] = Colour.RED
    side: Annotated[Literal["left", "right"], Key()] = "left"
    names: Annotated[tuple[str, ...], Key()] = ()
    path_m: Annotated[tuple[tuple[float, float], ...], Key(kind="points", count=2, least=0, most=5)] = ()
    inner: Annotated[Inner | None, Key()] = None
    deep: Annotated[Middle, Key()] = field(default_factory=Middle)
    by_name: Annotated[Mapping[str, Inner], Key()] = field(default_factory=dict)
    rows: Annotated[tuple[Table, ...], Key(record=Inner)] = ()

    def __post_init__(self) -> None:
        if self.from_ == 7:
            raise UsageError("seven is taken", hint="eight is free")


def of(text: str) -> Outer:
    table, places = read_toml(text, "w.toml", "a file", ScenarioError)
    return read(Outer, table, TablePlace(TomlSource("w.toml", places)))


def test_values_are_of_the_types_that_are_declared() -> None:
    text = 'from = 3\nshare = 1\nvolts = 11\ncolour = "red"\nside = "right"\nnames = "a"\npath_m = [[1, 2]]\n'
    found = of(f"{text}inner = {{ x_m = 1 }}\n[by_name.a]\nx_m = -1\n[[rows]]\nx_m = 0\n")
    assert found == Outer(
        from_=3, share=1.0, volts=11, side="right", names=("a",), path_m=((1, 2),), inner=Inner(x_m=1.0),
        by_name={"a": Inner(x_m=-1.0)}, rows=({"x_m": 0},),
    )  # fmt: skip
    assert [type(one) for one in (found.share, found.volts, found.inner and found.inner.x_m)] == [float, int, float]
    assert of("from = 0") == Outer(from_=0), "what is left out has its default"
    assert [name for name, _ in given(of("from = 1"))] == [
        key.name for key in keys_of(Outer) if key.default is not None or key.required
    ]


@pytest.mark.parametrize(
    ("text", "says", "hint"),
    [
        ("", "w.toml:1: key 'from' is missing", "a whole number, at least 0, at most 9"),
        ("\nfrom = 10", "w.toml:2: from = 10 is out of range", "it is a whole number, at least 0, at most 9"),
        ("from = 1\nfrom_ = 1", "w.toml:2: unknown key 'from_'", "did you mean 'from'?"),
        ("from = 1\nnote = 1", "w.toml:2: unknown key 'note'", "known are by_name, colour, deep"),
        ("from = 1\nshare = 0", "w.toml:2: share = 0 is out of range", "it is a number above 0, at most 1"),
        ('from = 1\ncolour = "rad"', 'w.toml:2: colour = "rad" is none of red', "did you mean 'red'?"),
        ('from = 1\nside = "up"', 'w.toml:2: side = "up" is none of left, right', None),
        ("from = 1\n[inner]\nx_m = 2", "w.toml:3: [inner]: x_m = 2 is out of range", "at least -1, at most 1"),
        ("from = 1\n[deep.inner]\n\nx_m = 2", "w.toml:4: [deep.inner]: x_m = 2 is out of range", None),
        ("from = 1\n[by_name.a]\n\nx_m = 2", "w.toml:4: [by_name.a]: x_m = 2 is out of range", None),
        ("from = 1\n[by_name]\na = 2", "w.toml:3: [by_name]: a = 2 is not a table", None),
        ("from = 7", "w.toml:1: seven is taken", "eight is free"),
    ],
)
def test_what_is_wrong_is_told_with_its_line_and_a_hint(text: str, says: str, hint: str | None) -> None:
    with pytest.raises(ScenarioError) as refused:
        of(text)
    assert str(refused.value) == says
    assert hint is None or hint in str(refused.value.hint)


def test_a_key_is_what_its_field_says() -> None:
    keys = {key.name: key for key in keys_of(Outer)}
    kinds = {name: key.kind for name, key in keys.items()}
    assert kinds == {
        "from": "whole", "share": "number", "volts": "number", "colour": "text", "side": "text", "names": "texts",
        "path_m": "points", "inner": "table", "deep": "table", "by_name": "table", "rows": "tables",
    }  # fmt: skip
    assert [name for name, key in keys.items() if key.required] == ["from"]
    assert (keys["volts"].default, keys["colour"].choices, keys["side"].choices) == (12, ("red",), ("left", "right"))
    assert [key.doc for key in keys_of(Inner)] == ["its place"], "a field without a Key is none of the file's"
    assert dict(sections(Outer)) == {
        "": keys_of(Outer), "[inner]": keys_of(Inner), "[deep]": keys_of(Middle), "[deep.inner]": keys_of(Inner),
        "[by_name.NAME]": keys_of(Inner), "[[rows]]": keys_of(Inner),
    }  # fmt: skip


@each(st.floats(allow_nan=True), st.integers(-3, 12))
def test_a_record_that_exists_is_in_its_ranges(share: float, begin: int) -> None:
    try:
        found = read(Outer, {"from": begin, "share": share}, "here")
    except ScenarioError:
        assert not (0 < share <= 1 and 0 <= begin <= 9) or begin == 7
    else:
        assert found == Outer(from_=begin, share=share)


def test_a_part_of_a_table_is_read_and_the_rest_is_left() -> None:
    assert read_part(Inner, {"x_m": 1, "other": 2}, "here") == (Inner(x_m=1.0), {"other": 2})


def test_tables_as_they_were_read_are_had_by_their_kind() -> None:
    table: Table = {"a": {"b": 1}, "c": [{"d": 2}, 3], "e": 4, "f": "x"}
    assert (table_of(table, "a"), table_of(table, "e"), table_of(table, "z")) == ({"b": 1}, {}, {})
    assert (tables_of(table, "c"), tables_of(table, "a"), tables_of(table, "z")) == ([{"d": 2}], [], [])
    assert (number_of(table, "e"), number_of(table, "f"), number_of(table, "z", 5.0)) == (4, 0.0, 5.0)
