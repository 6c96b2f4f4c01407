import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule

from tests.tools.suite.fewer_examples import fewer, try_fewer_examples


class Steps(RuleBasedStateMachine):
    @rule()
    def step(self) -> None:
        pass


class Machine(Steps.TestCase):  # type: ignore[name-defined, misc]  # made by Hypothesis
    settings = settings(max_examples=20, stateful_step_count=7)


@pytest.mark.parametrize(("asked", "tried"), [(1, 1), (5, 5), (6, 5), (12, 5), (15, 6), (100, 40), (2_500, 1_000)])
def test_a_share_is_tried_and_of_few_examples_all(asked: int, tried: int) -> None:
    assert fewer(asked) == tried


@pytest.mark.parametrize("is_long", [False, True])
def test_a_property_tries_a_share_unless_it_is_a_long_run(request: pytest.FixtureRequest, is_long: bool) -> None:
    tried = []

    @settings(max_examples=50)
    @given(st.integers())
    def check(number: int) -> None:
        tried.append(number)

    item = pytest.Function.from_parent(request.node.parent, name="check", callobj=check)
    if is_long:
        item.add_marker("soak")
    try_fewer_examples([item, item])
    check()
    assert len(tried) == (50 if is_long else 20)


def test_a_state_machine_tries_a_share_with_as_many_steps(request: pytest.FixtureRequest) -> None:
    asked = Machine.settings
    try:
        Machine.settings = settings(asked, max_examples=30)
        owner = pytest.Class.from_parent(request.node.getparent(pytest.Module), name="Machine")
        try_fewer_examples([pytest.Function.from_parent(owner, name="runTest", callobj=Machine.runTest)])
        assert (Machine.settings.max_examples, Machine.settings.stateful_step_count) == (12, 7)
    finally:
        Machine.settings = asked
