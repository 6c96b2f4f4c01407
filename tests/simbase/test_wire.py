"""The rule for contention of a wire."""

import itertools

import pytest

from simbase.wire import are_fighting, level_of


@pytest.mark.parametrize(
    ("hard", "pulls", "level"),
    [
        ((), (), None),
        ((), (True,), True),
        ((), (True, False), False),
        ((True,), (False,), True),
        ((True, False), (True,), False),
        ((True, True), (), True),
    ],
)
def test_low_wins_and_a_pull_yields_in_any_order(
    hard: tuple[bool, ...], pulls: tuple[bool, ...], level: bool | None
) -> None:
    for order in itertools.permutations(hard):
        assert level_of(order, pulls[::-1]) is level
        assert are_fighting(order) is (len(set(hard)) == 2)
