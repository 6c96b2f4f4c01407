"""TOML that is written is read back as it was."""

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.toml_file import TomlPlaces, toml_text

TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
SCALARS = st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | TEXTS
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXTS, inner, max_size=3),
    max_leaves=12,
)


@given(st.dictionaries(TEXTS, VALUES, max_size=4))
def test_a_table_comes_back_equal(table: dict[str, object]) -> None:
    assert tomllib.loads(toml_text(table)) == table


def test_what_toml_has_not_is_refused() -> None:
    with pytest.raises(TypeError, match="TOML has no NoneType"):
        toml_text({"a": [None]})


def test_what_stands_in_an_inline_table_is_at_that_tables_key_in_the_first_of_its_name() -> None:
    places = TomlPlaces({("wall", 0, ""): 3, ("wall", 0, "at"): 4, ("wall", 1, ""): 8, ("wall", 1, "at"): 9})
    assert places.line("wall", 1, "at") == 9
    assert places.line("wall.at", 0, "x_m") == 4
    assert places.line("wall.on", 0, "x_m") == 3
    assert places.line("floor", 0, "x_m") == 1
