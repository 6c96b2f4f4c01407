"""The page's types in TypeScript are those of the Python."""

from tools.generators.page_types import TARGET, text


def test_the_committed_types_are_those_of_the_declarations() -> None:
    assert TARGET.read_text(encoding="utf-8") == text(), "make generated"
