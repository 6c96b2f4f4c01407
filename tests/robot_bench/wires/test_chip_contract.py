"""The scripted chip of these tests and the emulated BluePill keep one contract."""

import pickle
from collections.abc import Callable
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

import pytest

from bluepill_sim.board import BluePill
from bluepill_sim.fabric.subscriptions import EDGE
from robot_bench.wires.ports import LeadingChip
from simbase.timing import Reason
from tests.robot_bench.wires.fake_chip import FakeChip, PinDrive

S, MS = 10**9, 10**6
#: Longer than a basic block takes at 8 MHz.
BLOCK_NS = 10_000
#: The first thing that the motors program does to a wire, within its first millisecond.
FIRST_EDGES = [(40_000, "PB13", PinDrive.LOW), (41_000, "PB12", PinDrive.HIGH)]


def edges_of(rows: bytes) -> list[tuple[int, str, PinDrive]]:
    found = []
    for at, number, drive, _wire, *_ in EDGE.iter_unpack(rows):
        found.append((at, f"P{'ABCDE'[number // 16]}{number % 16}", list(PinDrive)[drive]))
    return found


def scripted() -> LeadingChip:
    return FakeChip(FIRST_EDGES, [(MS, b"motors: ready\n")])


def emulated() -> LeadingChip:
    return BluePill(Path(str(files("robot_bench.firmware").joinpath("motors.elf"))))


@pytest.fixture(params=[scripted, emulated])
def make(request: pytest.FixtureRequest) -> Callable[[], LeadingChip]:
    return request.param  # type: ignore[no-any-return]


def test_a_limit_is_reached_and_overrun_by_a_block_at_most(make: Callable[[], LeadingChip]) -> None:
    chip = make()
    for limit in (1_000, 33_333, 1_234_567, 20_000_001):
        reached = chip.advance_to(limit)
        assert limit <= reached.now < limit + 20_000
        assert reached.now == chip.now_ns


def test_edges_carry_their_own_time_and_their_pin(make: Callable[[], LeadingChip]) -> None:
    chip, edges = make(), []
    some: list[tuple[int, str, PinDrive]] = []
    chip.subscribe_pins([f"P{port}{n}" for port in "AB" for n in range(16)], lambda rows: edges.extend(edges_of(rows)))
    chip.subscribe_pins(["PB12"], lambda rows: some.extend(edges_of(rows)))
    chip.advance_to(20 * MS)
    assert some == [edge for edge in edges if edge[1] == "PB12"], "no others were asked for"
    assert [at for at, _, _ in edges] == sorted(at for at, _, _ in edges)
    assert {pin for _, pin, drive in edges if drive is PinDrive.HIGH} >= {"PB12"}
    assert all(at <= chip.now_ns for at, _, _ in edges)
    assert edges[-1][0] - BLOCK_NS < chip.activity.last_pin_ns <= edges[-1][0], "the boundary before it"


def test_a_watched_pin_ends_the_slice(make: Callable[[], LeadingChip]) -> None:
    chip, edges = make(), []
    subscription = chip.subscribe_pins(["PB12"], lambda rows: edges.extend(edges_of(rows)), ends_slice=["PB12"])
    while not edges:
        reached = chip.advance_to(20 * MS)
    assert reached.reason is Reason.EDGE
    assert edges[0][0] <= reached.now < edges[0][0] + 20_000
    subscription.ends_slice = frozenset()
    while reached.now < 20 * MS:
        reached = chip.advance_to(20 * MS)
        assert reached.reason is Reason.DEADLINE


def test_edges_and_characters_come_before_advance_to_returns_and_end_when_told_to(
    make: Callable[[], LeadingChip],
) -> None:
    chip, edges, sent = make(), [], []
    subscription = chip.subscribe_pins(["PB12"], lambda rows: edges.extend(edges_of(rows)))
    end = chip.usart1.subscribe(sent.extend)
    while not sent:
        before, seen = chip.now_ns, len(edges)
        chip.advance_to(before + 5_000)
        assert all(before <= at <= chip.now_ns for at, *_ in edges[seen:])
    subscription.close()
    end()
    chip.advance_to(20 * MS)
    assert edges
    assert len(sent) == 1


def test_text_comes_with_the_end_of_each_stop_bit(make: Callable[[], LeadingChip]) -> None:
    chip, sent = make(), []
    chip.usart1.subscribe(lambda rows: sent.extend((at, word) for word, at in rows))
    chip.advance_to(20 * MS)
    assert bytes(byte for _, byte in sent) == b"motors: ready\n"
    gaps = [after[0] - before[0] for before, after in pairwise(sent)]
    assert all(gap >= 10 * S // 115_200 - 1_000 for gap in gaps), "ten bits at 115 200 baud"


def test_a_restored_chip_goes_on_alike(make: Callable[[], LeadingChip]) -> None:
    ends = []
    first = make()
    first.advance_to(500_000)
    snapshot = pickle.dumps(first.snapshot())
    for chip in (first, make()):
        if chip is not first:
            chip.restore(pickle.loads(snapshot))  # noqa: S301 - our own bytes
        sent: list[tuple[int, int]] = []
        chip.usart1.subscribe(sent.extend)
        chip.advance_to(20 * MS)
        ends.append((chip.now_ns, sent))
    assert ends[0] == ends[1]


def test_what_is_asked_for_at_any_time_is_there(make: Callable[[], LeadingChip]) -> None:
    chip = make()
    assert chip.fault is None
    assert list(chip.warnings) == []
    assert "0x0800" in chip.where()
    chip.pin("PA4").drive(True)
    chip.pin("PA4").drive(True, is_weak=True)
    chip.pin("PA4").drive(None)
