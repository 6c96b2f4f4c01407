"""A test of many rows tells every row that fails, and none that does not."""

from collections.abc import Callable

import pytest

from tests.tools.each_row import each_row


def test_every_row_that_fails_is_named_and_the_others_are_tried() -> None:
    tried = list[int]()

    @each_row("number", range(5), ids=lambda number: f"no. {number}")
    def is_two_or_three(number: int) -> None:
        tried.append(number)
        if number == 4:
            with pytest.raises(ValueError, match="nothing"):
                int("4")
        assert number in {2, 3, 4}

    with pytest.raises(BaseExceptionGroup, match="3 of 5 rows failed") as caught:
        is_two_or_three()
    assert tried == [0, 1, 2, 3, 4]
    assert [error.__notes__ for error in caught.value.exceptions] == [["row no. 0"], ["row no. 1"], ["row no. 4"]]


def test_a_row_of_several_values_and_a_fixture_come_by_name(tmp_path: object) -> None:
    seen = list[object]()

    @each_row(("one", "other"), [(1, 2), (3, 4)])
    def add(tmp_path: object, one: int, other: int) -> None:
        seen.append((tmp_path, one + other))

    add(tmp_path=tmp_path)
    assert seen == [(tmp_path, 3), (tmp_path, 7)]


@each_row("text", ["a", "b"])
def test_pytest_gives_the_fixtures_that_are_left(capsys: pytest.CaptureFixture[str], text: str) -> None:
    print(text)  # noqa: T201
    assert capsys.readouterr().out == f"{text}\n"


def test_an_interruption_and_a_skip_end_all_rows() -> None:
    @each_row("error", [KeyboardInterrupt, lambda: pytest.skip.Exception("missing")])
    def end(error: Callable[[], BaseException]) -> None:
        raise error()

    with pytest.raises(KeyboardInterrupt):
        end()


def test_a_table_without_rows_is_refused() -> None:
    with pytest.raises(AssertionError, match="tests nothing"):
        each_row("row", [])
