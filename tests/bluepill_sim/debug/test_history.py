"""States on the way: near together at first, never too many, and alike for whoever has taken them over."""

from dataclasses import dataclass, field
from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.debug.history import History

MOST = 8


@dataclass
class Board:
    cycle: int = 0
    now_ns: int = 0


@dataclass
class FakeMachine:
    """A machine of which only the time is known; a snapshot is its cycle."""

    board: Board = field(default_factory=Board)
    can_rewind: bool = True

    def snapshot(self) -> object:
        return self.board.cycle

    def run(self, history: History, spans_us: list[int]) -> None:
        for us in spans_us:
            self.board.cycle += us
            self.board.now_ns += 1_000 * us
            history.pass_by()


def cycles(history: History) -> list[int]:
    assert all(point.cycle == point.snapshot == point.at_ns // 1_000 for point in history.latest_first())
    return [point.cycle for point in history.latest_first()][::-1]


SPANS = st.lists(st.sampled_from([1, 999, 1_000, 1_001, 5_000]), max_size=60)


@given(before=SPANS, after=SPANS, back=st.integers(0, 100_000))
@settings(max_examples=40)
def test_a_history_that_was_taken_over_goes_on_as_the_other(before: list[int], after: list[int], back: int) -> None:
    first, second = FakeMachine(), FakeMachine()
    ours, theirs = History(first, MOST), History(second, MOST)
    first.run(ours, before)
    theirs.take(ours)
    second.board = Board(first.board.cycle, first.board.now_ns)
    for machine, history in ((first, ours), (second, theirs)):
        machine.run(history, after)
    found = cycles(ours)
    assert found == cycles(theirs) == sorted(set(found))
    assert found[0] == 0
    assert len(found) <= MOST
    assert [point.cycle for point in ours.before(back)] == [cycle for cycle in found[::-1] if cycle < back]
    theirs.forget_after(back)
    assert cycles(theirs) == [cycle for n, cycle in enumerate(found) if not n or cycle <= back]
    assert cycles(ours) == found, "the two share nothing"


def test_going_back_to_a_state_keeps_it_and_to_just_before_it_does_not() -> None:
    machine = FakeMachine()
    history = History(machine, MOST)
    machine.run(history, [1_000] * 5)
    history.forget_after(3_000)
    assert cycles(history) == [0, 1_000, 2_000, 3_000]
    history.forget_after(2_999)
    assert cycles(history) == [0, 1_000, 2_000]


def test_states_are_twice_as_far_apart_where_they_are_too_many_and_near_again_after_a_new_beginning() -> None:
    machine = FakeMachine()
    history = History(machine, MOST)
    machine.run(history, [1_000] * 100)
    found = cycles(history)
    assert {later - earlier for earlier, later in pairwise(found)} == {16_000}
    history.begin()
    machine.run(history, [1_000] * 3)
    assert cycles(history) == [100_000, 101_000, 102_000, 103_000]


def test_a_machine_that_cannot_go_back_keeps_nothing() -> None:
    machine = FakeMachine(can_rewind=False)
    history = History(machine, MOST)
    machine.run(history, [1_000] * 100)
    assert cycles(history) == []
