"""Leaves out the cases of tests that call a verb which is not there: a plugin of pytest, `-p without_verbs`.

`HIDDEN_VERBS` names the verbs, with commas. A case calls one where a parameter of the test, a text or a list of words,
begins with it.
"""

import os
from collections.abc import Sequence

import pytest

HIDDEN = frozenset(filter(None, os.environ.get("HIDDEN_VERBS", "").split(",")))


def verb_of(given: object) -> str:
    """Return the first word of a parameter that is a text or a list of words, behind `p2os`; of any other none."""
    words = given.split() if isinstance(given, str) else given if isinstance(given, Sequence) else []
    return next((word for word in words if word != "p2os" and isinstance(word, str)), "")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect what calls a hidden verb."""
    cases = [(item, getattr(item, "callspec", None)) for item in items]
    left = [item for item, case in cases if case and any(verb_of(one) in HIDDEN for one in case.params.values())]
    if left:
        config.hook.pytest_deselected(items=left)
        items[:] = [item for item in items if item not in set(left)]
