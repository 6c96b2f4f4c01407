"""The loop brings everybody to every deadline, in order, whatever its slices."""

import pytest

from robot_bench.running.loop import RunLoop, StuckError
from robot_bench.wires.chip_pins import ChipPins
from robot_bench.wires.nets import Harness, Net
from simbase.timing import Reached
from tests.robot_bench.wires.fake_chip import FakeChip, PinDrive


class Ticker:
    """A follower with a fixed period that notes when it was brought where."""

    def __init__(self, name: str, period: int, log: list[tuple[str, int]]) -> None:
        self.name, self.period, self.log = name, period, log
        self.next: int | None = period

    def next_deadline(self) -> int | None:
        return self.next

    def advance_to(self, limit: int) -> Reached:
        self.log.append((self.name, limit))
        while self.next is not None and self.next <= limit:
            self.next += self.period
        return Reached(limit)


@pytest.mark.parametrize("slice_ns", [1, 7, 1_000, 10**9])
def test_deadlines_are_acted_on_in_order_whatever_the_slice(slice_ns: int) -> None:
    log: list[tuple[str, int]] = []
    loop = RunLoop(FakeChip(block_ns=7), [Ticker("a", 30, log), Ticker("b", 20, log)], slice_ns=slice_ns)
    loop.run_until(65)
    assert log == [("b", 20), ("a", 30), ("b", 40), ("a", 60), ("b", 60)]


def test_an_edge_on_a_watched_net_brings_all_to_its_own_time() -> None:
    log: list[tuple[str, int]] = []
    chip = FakeChip([(1_234, "PB13", PinDrive.HIGH)], block_ns=100)
    loop = RunLoop(chip, [Ticker("a", 5_000, log)], slice_ns=10_000)
    pins = ChipPins(chip, Harness([Net("rst")]), {"rst": "PB13"}, on_watched=loop.note_edge)
    pins.watch(frozenset({"rst"}), 0)
    loop.run_until(6_000)
    assert log == [("a", 1_234), ("a", 5_000)]


def test_a_leader_that_stands_still_lets_time_pass() -> None:
    log: list[tuple[str, int]] = []
    RunLoop(FakeChip(halts_at=450), [Ticker("a", 300, log)]).run_until(1_000)
    assert log == [("a", 300), ("a", 600), ("a", 900)]


@pytest.mark.parametrize("slice_ns", [10, 100, 1_000])
def test_a_run_can_be_ended_earlier_than_it_was_to_end(slice_ns: int) -> None:
    log: list[tuple[str, int]] = []
    loop = RunLoop(FakeChip(block_ns=10), [Ticker("a", 300, log)], slice_ns=slice_ns)
    loop.on_slice = lambda _now: loop.end_at(650)
    loop.run_until(10_000)
    assert log == [("a", 300), ("a", 600)]


def test_the_end_itself_is_brought_to_all_by_finish() -> None:
    log: list[tuple[str, int]] = []
    loop = RunLoop(FakeChip(block_ns=7), [Ticker("a", 40, log)])
    loop.run_until(100)
    loop.finish(100)
    assert log == [("a", 40), ("a", 80), ("a", 100)]


def test_two_parts_that_wake_each_other_for_ever_are_named() -> None:
    class Stubborn(Ticker):
        def advance_to(self, limit: int) -> Reached:
            return Reached(limit)

    with pytest.raises(StuckError, match="Stubborn stay due"):
        RunLoop(FakeChip(), [Stubborn("s", 10, [])]).run_until(100)


def test_slices_are_reported_and_may_end_the_run() -> None:
    reported: list[int] = []

    def listen(now: int) -> None:
        reported.append(now)
        if now >= 3_000:
            raise KeyboardInterrupt

    loop = RunLoop(FakeChip(block_ns=10), [], slice_ns=1_000, on_slice=listen)
    with pytest.raises(KeyboardInterrupt):
        loop.run_until(10_000)
    assert reported == [1_000, 2_000, 3_000]


def test_a_restored_loop_goes_on_alike() -> None:
    first = RunLoop(FakeChip(block_ns=10), [])
    first.run_until(500)
    first.note_edge(510)
    second = RunLoop(FakeChip(block_ns=10), [])
    second.restore(first.snapshot())
    assert second.snapshot() == first.snapshot()


def test_the_leader_does_not_stop_for_those_who_only_observe_and_they_come_to_each_deadline() -> None:
    log: list[tuple[str, int]] = []
    slices: list[int] = []
    loop = RunLoop(FakeChip(block_ns=1), [Ticker("a", 50, log)], observers=[Ticker("o", 20, log)])
    loop.on_slice = slices.append
    loop.run_until(110)
    assert slices == [50, 100, 110]
    assert log == [("o", 20), ("o", 40), ("a", 50), ("o", 60), ("o", 80), ("a", 100), ("o", 100)]
