"""What messages show of values and names: one line, whatever is in them."""

import traceback

from simbase.errors import LONGEST_LINE, LONGEST_SHOWN, P2osError, UsageError, nearest, one_line, shown, shown_name


def test_a_value_is_shown_as_python_writes_it_and_cut_where_it_is_long() -> None:
    assert shown("a\nb") == r"'a\nb'"
    assert shown("x" * (LONGEST_SHOWN - 2)) == repr("x" * (LONGEST_SHOWN - 2))
    cut = shown("x" * (LONGEST_SHOWN - 1))
    assert len(cut) == LONGEST_SHOWN
    assert cut.endswith("...")


def test_a_number_of_more_digits_than_python_writes_has_words() -> None:
    assert shown(1 << 100_000) == "a huge number"


def test_a_name_is_shown_as_it_is_unless_no_line_can_hold_it() -> None:
    assert shown_name("room.toml") == "room.toml"
    assert "\n" not in shown_name("a\nb")
    assert "\0" not in shown_name("a\0b")


def test_an_error_is_one_line_whatever_a_file_put_into_it() -> None:
    error = P2osError("no thing 'a\nb\x00c'", hint="x" * (LONGEST_LINE + 1))
    assert str(error) == "no thing 'a b\\x00c'"
    assert error.hint is not None
    assert len(error.hint) == LONGEST_LINE
    assert one_line("µ" * LONGEST_LINE) == "µ" * LONGEST_LINE
    assert one_line("a" * LONGEST_LINE + "b").endswith("ab")


def test_the_hint_is_in_pythons_own_traceback_too() -> None:
    reported = "".join(traceback.format_exception_only(UsageError("no wire 'PB99'", hint="did you mean 'PB9'?")))
    assert reported == "simbase.errors.UsageError: no wire 'PB99'\nhint: did you mean 'PB9'?\n"
    assert not hasattr(UsageError("no wire"), "__notes__")


def test_a_word_gets_the_nearest_or_all_that_there_are() -> None:
    assert nearest("DD33", ["DD3", "DD4"]) == "did you mean 'DD3'?"
    assert nearest("nope", ["p2de", "p2dx"]) == "known are p2de, p2dx"
