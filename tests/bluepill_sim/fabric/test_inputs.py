"""Levels from outside that are to come: each at its time, whoever runs the chip in which slices."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.board import BluePill
from bluepill_sim.extension.layout import LATER_INPUTS
from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.subscriptions import EDGE, Of
from tests.bluepill_sim.fabric.test_waves import Bank
from tests.tools.examples import EXAMPLES

QUICK = settings(max_examples=50)


@QUICK
@given(
    st.lists(st.tuples(st.integers(0, 200), st.integers(0, 2), st.booleans()), max_size=30),
    st.lists(st.integers(0, 220), max_size=6),
)
def test_each_level_comes_at_its_time_and_those_of_one_time_in_the_order_of_telling(
    levels: list[tuple[int, int, bool]], looks: list[int]
) -> None:
    bank = Bank()
    for pin in range(3):
        bank.pins[f"PA{pin}"].drive(0)
        bank.pins[f"PA{pin}"].drive_later([(at, level) for at, number, level in levels if number == pin])
    for now in sorted(looks):
        bank.run(now)
        for pin in range(3):
            passed = [(at, place, level) for place, (at, number, level) in enumerate(levels)
                      if number == pin and at <= now]  # fmt: skip
            assert bank.pins[f"PA{pin}"].driven is (max(passed)[2] if passed else False), (pin, now)


def test_a_level_of_the_past_comes_now_and_not_before_others_of_the_past() -> None:
    bank = Bank()
    bank.run(100)
    bank.pins["PA2"].drive_later([(50, True), (40, False), (101, False)])
    bank.run(100)
    assert bank.pins["PA2"].driven is True
    bank.run(101)
    assert bank.pins["PA2"].driven is False


@pytest.mark.parametrize("is_weak", [False, True])
def test_a_resistor_later_is_a_resistor(is_weak: bool) -> None:
    bank = Bank()
    pin = bank.pins["PA2"]  # an output that is low
    pin.drive_later([(10, True)], is_weak=is_weak)
    bank.run(9)
    assert (pin.driven, pin.is_contended) == (None, False)
    bank.run(10)
    assert (pin.driven, pin.is_contended) == (True, not is_weak)
    assert pin.output is PinDrive.LOW


def test_no_more_are_taken_than_there_is_room_for_and_then_none() -> None:
    bank = Bank()
    pin = bank.pins["PA0"]
    pin.drive_later([(10, True)] * (LATER_INPUTS - 1))
    with pytest.raises(ValueError, match="too many"):
        pin.drive_later([(5, False), (6, False)])
    bank.run(9)
    assert pin.driven is None, "none of the two was taken"
    pin.drive_later([(9, True)])
    bank.run(10)
    pin.drive_later([(20, True)] * LATER_INPUTS)


def test_a_pin_without_a_leg_is_refused() -> None:
    with pytest.raises(ValueError, match="PE0 is not bonded"):
        Bank().pins["PE0"].drive_later([(1, True)])


def test_a_restored_board_has_them_to_come_and_an_older_snapshot_has_not() -> None:
    def boot() -> tuple[BluePill, list[tuple[int, int]]]:
        board, rows = BluePill(Path(str(EXAMPLES.joinpath("motors.elf")))), []
        board.pin("PA0").drive(0)
        board.subscribe_pins(
            ["PA0"], lambda data: rows.extend((at, wire) for at, _, _, wire, *_ in EDGE.iter_unpack(data)), of=Of.WIRE
        )
        return board, rows

    board, rows = boot()
    board.run_for("1 ms")
    before = board.snapshot()
    board.pin("PA0").drive_later([(1_500_000, True), (1_700_001, False)])
    state = board.snapshot()
    board.run_for("1 ms")
    assert rows[-2:] == [(1_500_000, 1), (1_700_001, 0)]
    other, its_rows = boot()
    other.restore(state)
    its_rows.clear()
    for _ in range(10):
        other.run_for("100 us")
    assert its_rows == [(1_500_000, 1), (1_700_001, 0)]
    other.restore(state)
    other.restore(before)
    its_rows.clear()
    other.run_for("1 ms")
    assert its_rows == []
