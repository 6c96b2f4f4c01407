"""A net's level is that of the drives stamped up to an instant, whoever tells of them first."""

import pickle
from itertools import permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.errors import LocalProtocolError
from robot_bench.wires.nets import Contention, Harness, Net, OwnedPins, Strength

PP, OD, PULL, FLOATING = Strength.PUSH_PULL, Strength.OPEN_DRAIN, Strength.PULL, Strength.FLOATING


@pytest.mark.parametrize(
    ("drives", "level"),
    [
        ([], None),
        ([(True, FLOATING)], None),
        ([(True, PULL)], True),
        ([(True, PULL), (False, PULL)], False),
        ([(True, PULL), (False, PP)], False),
        ([(False, PULL), (True, PP)], True),
        ([(False, OD), (True, PULL)], False),
        ([(True, OD), (True, PULL)], True),
        ([(True, OD)], None),
        ([(True, OD), (False, OD), (True, PULL)], False),
        ([(True, PP), (False, PP)], False),
    ],
)
@pytest.mark.parametrize("idle", [False, True])
def test_the_stronger_drive_wins_and_a_fight_reads_low(
    drives: list[tuple[bool, Strength]], level: bool | None, idle: bool
) -> None:
    net = Net("wire", idle=idle)
    for number, (high, strength) in enumerate(drives):
        net.drive(f"owner {number}", high, strength, 10)
    assert net.level(9) is idle
    assert net.level(10) is (idle if level is None else level)


def test_a_reader_behind_sees_the_level_of_its_own_time() -> None:
    net = Net("wire")
    for at, high in ((100, True), (200, False), (300, True)):
        net.drive("chip", high, PP, at)
    assert [net.level(at) for at in (99, 100, 199, 200, 299, 300)] == [False, True, True, False, False, True]


@given(
    st.lists(st.tuples(st.integers(0, 50), st.booleans(), st.sampled_from(list(Strength))), max_size=5),
    st.lists(st.tuples(st.integers(0, 50), st.booleans(), st.sampled_from(list(Strength))), max_size=5),
)
def test_the_order_in_which_owners_tell_changes_nothing(
    first: list[tuple[int, bool, Strength]], second: list[tuple[int, bool, Strength]]
) -> None:
    first, second = sorted(first, key=lambda d: d[0]), sorted(second, key=lambda d: d[0])
    interleaved = sorted([("a", *d) for d in first] + [("b", *d) for d in second], key=lambda d: d[1])
    nets = []
    for order in ([("a", *d) for d in first] + [("b", *d) for d in second], interleaved):
        net = Net("wire")
        for owner, at, high, strength in order:
            net.drive(owner, high, strength, at)
        nets.append(net)
    assert [nets[0].level(at) for at in range(52)] == [nets[1].level(at) for at in range(52)]
    assert nets[0].edges_until(60) == nets[1].edges_until(60)
    assert nets[0].take_contentions() == nets[1].take_contentions()


@given(st.lists(st.tuples(st.integers(0, 99), st.booleans()), max_size=9), st.lists(st.integers(0, 99), max_size=4))
def test_edges_told_in_pieces_are_the_edges_told_at_once(drives: list[tuple[int, bool]], cuts: list[int]) -> None:
    whole, pieces = Net("wire"), Net("wire")
    for at, high in sorted(drives, key=lambda d: d[0]):
        whole.drive("chip", high, PP, at)
        pieces.drive("chip", high, PP, at)
    found = []
    for cut in [*sorted(cuts), 100]:
        found += pieces.edges_until(cut)
        pieces.forget_before(cut)
    assert found == whole.edges_until(100)


def test_forgetting_keeps_what_a_reader_at_the_limit_sees() -> None:
    net = Net("wire")
    for at, high in ((10, True), (20, False), (30, True)):
        net.drive("chip", high, PP, at)
    assert net.forget_before(25) is True
    assert net.level(25) is False
    assert net.level(30) is True
    assert net.forget_before(30) is False


def test_a_fight_is_noted_once_with_both_owners_and_its_time() -> None:
    net = Net("DD1")
    net.drive("adapter", True, PP, 5)
    net.drive("bluepill", False, PP, 9)
    net.drive("bluepill", False, OD, 12)
    net.release("bluepill", 20)
    net.drive("bluepill", False, PP, 30)
    assert net.level(9) is False
    net.edges_until(100)
    owners = ("adapter", "bluepill")
    assert net.take_contentions() == [Contention(9, "DD1", owners), Contention(30, "DD1", owners)]
    assert net.take_contentions() == []


def test_an_owner_cannot_change_its_past() -> None:
    net = Net("wire")
    net.drive("chip", True, PP, 10)
    with pytest.raises(LocalProtocolError, match="9 ns after having driven it at 10 ns"):
        net.drive("chip", False, PP, 9)


def test_a_watcher_hears_of_each_new_drive_once() -> None:
    net, heard = Net("wire"), []
    net.watch(lambda of, owner, at: heard.append((of.name, owner, at)))
    net.drive("a", True, PP, 1)
    net.drive("a", True, PP, 2)
    net.drive("b", False, PULL, 3)
    net.release("a", 4)
    assert heard == [("wire", "a", 1), ("wire", "b", 3), ("wire", "a", 4)]


def test_what_the_others_do_is_distinguished_from_ones_own() -> None:
    net = Net("wire")
    net.drive("board", False, PULL, 0)
    net.drive("chip", True, PP, 1)
    assert net.level_without("chip", 1) == (False, False)
    assert net.level_without("board", 1) == (True, True)


def test_a_restored_harness_goes_on_alike() -> None:
    def make() -> Harness:
        return Harness([Net("a"), Net("b", idle=True)])

    first, second = make(), make()
    pins = OwnedPins(first, "adapter")
    pins.write("a", True, 10)
    pins.write("b", False, 20)
    first["a"].edges_until(15)
    second.restore(pickle.loads(pickle.dumps(first.snapshot())))  # noqa: S301 - our own bytes
    for harness in (first, second):
        again = OwnedPins(harness, "adapter")
        again.write("a", None, 30)
        again.write("b", None, 31)
    for name in ("a", "b"):
        assert second[name].edges_until(99) == first[name].edges_until(99)
        assert OwnedPins(second, "adapter").read(name, 25) == OwnedPins(first, "adapter").read(name, 25)
    assert [net.name for net in second] == ["a", "b"]


def test_drives_of_one_instant_count_as_the_last_of_them() -> None:
    for order in permutations([True, False]):
        net = Net("wire")
        for high in order:
            net.drive("chip", high, PP, 5)
        assert net.level(5) is order[-1]
