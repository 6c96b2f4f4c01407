"""A table of quick rows that is one test: `each_row` in place of `pytest.mark.parametrize`.

A test costs pytest some 3 ms before it does anything, and a worker's report of it as much again: of rows that take less
than that, thousands make half of a run. Here all rows are tried, and each that fails is told, by its name, with where
it failed. What it is not for: rows that take long, need fixtures of their own or are to be run one at a time.
"""

import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import pytest

Row = TypeVar("Row")


def each_row(
    name: str | Sequence[str], rows: Iterable[Row], ids: Callable[[Row], object] = repr
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that runs a test once with each row.

    Args:
        name: Of the argument that is the row; several, where each row has a value for each.
        rows: What the test is tried with.
        ids: What a row is called where it fails.
    """
    table = tuple(rows)
    names = (name,) if isinstance(name, str) else tuple(name)
    assert table, "a table without rows tests nothing"

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def run(**fixtures: object) -> None:
            failed = list[BaseException]()
            for row in table:
                values = (row,) if isinstance(name, str) else row
                try:
                    test(**fixtures, **dict(zip(names, values, strict=True)))  # type: ignore[call-overload]
                except (Exception, pytest.fail.Exception) as error:  # noqa: BLE001 - told below, with the others
                    error.add_note(f"row {ids(row)}")
                    failed.append(error)
            if failed:
                raise BaseExceptionGroup(f"{len(failed)} of {len(table)} rows failed", failed)

        own = inspect.signature(test)
        others = [parameter for each, parameter in own.parameters.items() if each not in names]
        run.__signature__ = own.replace(parameters=others)  # type: ignore[attr-defined]  # what pytest looks at
        return run

    return decorate
