"""The scripted chip of these tests and the emulated BluePill keep one contract."""

import pickle
from collections.abc import Callable
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

import pytest

from bluepill_sim.board import BluePill
from robot_bench.wires.ports import Chip
from tests.robot_bench.wires.fake_chip import FakeChip, PinDrive

S, MS = 10**9, 10**6
#: The first thing that the motors program does to a wire, within its first millisecond.
FIRST_EDGES = [(40_000, "PB13", PinDrive.LOW), (41_000, "PB12", PinDrive.HIGH)]


def scripted() -> Chip:
    return FakeChip(FIRST_EDGES, [(MS, b"motors: ready\n")])


def emulated() -> Chip:
    return BluePill(Path(str(files("robot_bench.firmware").joinpath("motors.elf"))))


@pytest.fixture(params=[scripted, emulated])
def make(request: pytest.FixtureRequest) -> Callable[[], Chip]:
    return request.param  # type: ignore[no-any-return]


def test_a_limit_is_reached_and_overrun_by_a_block_at_most(make: Callable[[], Chip]) -> None:
    chip = make()
    for limit in (1_000, 33_333, 1_234_567, 20_000_001):
        reached = chip.advance_to(limit)
        assert limit <= reached.now < limit + 20_000
        assert reached.now == chip.now_ns


def test_edges_carry_their_own_time_and_their_pin(make: Callable[[], Chip]) -> None:
    chip, edges = make(), []
    chip.on_pin = lambda pin, drive, at: edges.append((at, pin, drive))
    chip.advance_to(20 * MS)
    assert [at for at, _, _ in edges] == sorted(at for at, _, _ in edges)
    assert {pin for _, pin, drive in edges if drive is PinDrive.HIGH} >= {"PB12"}
    assert all(at <= chip.now_ns for at, _, _ in edges)
    assert chip.activity.last_pin_ns == edges[-1][0]


def test_a_watched_pin_ends_the_slice(make: Callable[[], Chip]) -> None:
    chip, edges = make(), []
    chip.on_pin = lambda pin, drive, at: edges.append(at) if pin == "PB12" and drive is PinDrive.HIGH else None
    chip.pin("PB12").watch(True)
    while not edges:
        reached = chip.advance_to(20 * MS)
    assert edges[0] <= reached.now < edges[0] + 20_000


def test_text_comes_with_the_end_of_each_stop_bit(make: Callable[[], Chip]) -> None:
    chip, sent = make(), []
    chip.usart1.on_transmit = lambda byte, at: sent.append((at, byte))
    chip.advance_to(20 * MS)
    assert bytes(byte for _, byte in sent) == b"motors: ready\n"
    gaps = [after[0] - before[0] for before, after in pairwise(sent)]
    assert all(gap >= 10 * S // 115_200 - 1_000 for gap in gaps), "ten bits at 115 200 baud"


def test_a_restored_chip_goes_on_alike(make: Callable[[], Chip]) -> None:
    ends = []
    first = make()
    first.advance_to(500_000)
    snapshot = pickle.dumps(first.snapshot())
    for chip in (first, make()):
        if chip is not first:
            chip.restore(pickle.loads(snapshot))  # noqa: S301 - our own bytes
        sent: list[tuple[int, int]] = []
        chip.usart1.on_transmit = lambda byte, at, sent=sent: sent.append((at, byte))  # type: ignore[misc]
        chip.advance_to(20 * MS)
        ends.append((chip.now_ns, sent))
    assert ends[0] == ends[1]


def test_what_is_asked_for_at_any_time_is_there(make: Callable[[], Chip]) -> None:
    chip = make()
    assert chip.fault is None
    assert list(chip.warnings) == []
    assert "0x0800" in chip.where()
    chip.pin("PA4").drive(True)
    chip.pin("PA4").drive(None)
