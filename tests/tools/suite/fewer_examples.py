"""Has properties try a share of their examples, where these are the same in each run.

What a property asks for is what `make soak` draws. Examples that stay the same find a break in the first run after it,
or never; and most breaks are found by the first few. Of the mutants that a property was the first to notice, eleven
were tried with this share: all were noticed.
"""

from collections.abc import Iterable

import pytest
from hypothesis import is_hypothesis_test, settings

#: Of the examples that are asked for, and what is tried at the least, if that many are asked for.
SHARE, FEWEST = 0.4, 5


def try_fewer_examples(items: Iterable[pytest.Item]) -> None:
    """Have properties and state machines try fewer examples, but those of long runs (`soak`)."""
    owners: dict[object, str] = {}
    for item in items:
        if isinstance(item, pytest.Function) and item.get_closest_marker("soak") is None:
            test = getattr(item.obj, "__func__", item.obj)
            if isinstance(getattr(item.cls, "settings", None), settings):
                owners[item.cls] = "settings"  # a state machine's
            elif is_hypothesis_test(test):
                owners[test] = "_hypothesis_internal_use_settings"
    for owner, name in owners.items():
        asked: settings = getattr(owner, name)
        setattr(owner, name, settings(asked, max_examples=fewer(asked.max_examples)))


def fewer(asked: int) -> int:
    """Return how many examples are tried where so many are asked for."""
    return min(asked, max(FEWEST, round(asked * SHARE)))
