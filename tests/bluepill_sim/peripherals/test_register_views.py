"""Registers by name with their fields: of every peripheral, without the side effects of a read."""

from typing import Any

import pytest

from bluepill_sim import BluePill
from bluepill_sim.errors import BluePillError
from tests.tools.examples import EXAMPLES
from tools.generators.chip import peripherals

KINDS = list(peripherals())
NAMES = [name for _, name in KINDS]


def test_every_register_that_reads_has_its_fields() -> None:
    found = [f"{name}.{one.name}" for kind, name in KINDS for one in kind.REGISTERS if one.readable and not one.fields]
    assert found == []


@pytest.mark.parametrize("name", NAMES)
def test_a_view_shows_what_a_read_finds_and_changes_nothing(fake_chip: Any, name: str) -> None:
    part = fake_chip.parts.by_name[name]
    before = part.snapshot()
    views = part.view()
    assert part.snapshot() == before
    assert {view.name: view.word for view in views.values()} == {
        register.name: part.read(register.offset, 4) for register in part.REGISTERS
    }


def test_views_leave_a_character_and_a_capture_unread(fake_chip: Any) -> None:
    timer = fake_chip.parts.by_name["TIM3"]
    fake_chip.write("TIM3.CCMR1", 1)
    fake_chip.write("TIM3.CCER", 1)
    fake_chip.write("TIM3.CNT", 0x1234)
    fake_chip.write("TIM3.EGR", 2)
    views = timer.view()
    assert (views["CCR1"]["CCR1"], views["SR"]["CC1IF"]) == (0x1234, 1)
    assert str(views["SR"]) == "0x00000002  CC1IF=0x1"
    assert fake_chip.read("TIM3.SR") == 2
    assert fake_chip.read("TIM3.CCR1") == 0x1234
    assert fake_chip.read("TIM3.SR") == 0


def test_a_channel_that_is_an_input_has_the_fields_of_one(fake_chip: Any) -> None:
    fake_chip.write("TIM1.CCMR2", 0xF1 | 0x68 << 8)
    view = fake_chip.parts.by_name["TIM1"].view()["CCMR2"]
    assert [name for name, _ in view.fields] == [
        "OC4CE", "OC4M", "OC4PE", "OC4FE", "CC4S", "IC3F", "IC3PSC", "CC3S"
    ]  # fmt: skip
    assert (view["OC4M"], view["IC3F"], view["CC3S"]) == (6, 15, 1)


def test_a_running_counter_is_seen_where_it_is(fake_chip: Any) -> None:
    fake_chip.write("TIM2.CR1", 1)
    fake_chip.advance(125 * 101)
    assert fake_chip.parts.by_name["TIM2"].view()["CNT"].word == 100


def test_a_board_names_the_peripherals_that_it_has() -> None:
    board = BluePill(str(EXAMPLES / "motors.elf"))
    assert board.registers("RCC")["CR"]["HSION"] == 1
    with pytest.raises(BluePillError, match="no peripheral 'TIM9'") as caught:
        board.registers("TIM9")
    assert "TIM1" in str(caught.value.hint)
