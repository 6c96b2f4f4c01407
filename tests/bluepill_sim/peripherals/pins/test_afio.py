"""AFIO: the debug port's pins, remaps, EXTI routes."""

from typing import Any

import pytest

from bluepill_sim.fabric.pins import PinDrive, PinMode

#: So long after its configuration a wire may still come.
SETTLING_NS = 1_000_000

SWJ_NOJTAG, SWJ_OFF = 0b010 << 24, 0b100 << 24
DEBUG_PINS = ("PA13", "PA14", "PA15", "PB3", "PB4")


def held(chip: Any) -> set[str]:
    return {name for name in DEBUG_PINS if chip.pins[name].holder is not None}


@pytest.mark.parametrize(
    ("swj_cfg", "kept"),
    [
        (0b000, {"PA13", "PA14", "PA15", "PB3", "PB4"}),
        (0b001, {"PA13", "PA14", "PA15", "PB3"}),
        (0b010, {"PA13", "PA14"}),
        (0b100, set()),
    ],
)
def test_swj_cfg_releases_its_pins(fake_chip: Any, swj_cfg: int, kept: set[str]) -> None:
    assert held(fake_chip) == set(DEBUG_PINS)
    fake_chip.write("AFIO.MAPR", swj_cfg << 24)
    assert held(fake_chip) == kept
    assert fake_chip.read("AFIO.MAPR") == 0
    assert fake_chip.warnings == {}
    fake_chip.parts.by_name["AFIO"].reset()
    assert held(fake_chip) == set(DEBUG_PINS)


def test_the_debug_port_pulls_its_pins(fake_chip: Any) -> None:
    drives = [fake_chip.pins[name].output for name in DEBUG_PINS]
    up, down = PinDrive.PULL_UP, PinDrive.PULL_DOWN
    assert drives == [up, down, up, PinDrive.NONE, up]


def test_a_configuration_of_a_debug_pin_waits_for_its_release_and_is_warned_of_once(fake_chip: Any) -> None:
    fake_chip.write("GPIOB.CRL", 0x4444_2444)
    fake_chip.write("GPIOB.BSRR", 8)
    assert fake_chip.pins["PB3"].output is PinDrive.NONE
    fake_chip.advance(fake_chip.now_ns + SETTLING_NS - 1)
    assert fake_chip.warnings == {}
    fake_chip.advance(fake_chip.now_ns + 1)
    assert fake_chip.warnings == {
        "PB3:held": "PB3 belongs to JTDO: its GPIO configuration has no effect until it is released"
    }
    fake_chip.write("AFIO.MAPR", SWJ_NOJTAG)
    assert fake_chip.pins["PB3"].output is PinDrive.HIGH
    assert fake_chip.read("GPIOB.IDR") & 8


def test_debug_pins_configured_together_are_warned_of_in_one_line_and_each_once(fake_chip: Any) -> None:
    """As a board file does it that configures whole ports before it releases JTAG."""
    fake_chip.write("GPIOB.CRL", 0x4448_8444)
    fake_chip.advance(fake_chip.now_ns + SETTLING_NS)
    text = "PB3, PB4 belong to JTDO, NJTRST: their GPIO configuration has no effect until they are released"
    assert fake_chip.warnings == {"PB3 PB4:held": text}
    fake_chip.write("GPIOB.CRL", 0x4442_2444)
    fake_chip.advance(fake_chip.now_ns + SETTLING_NS)
    assert len(fake_chip.warnings) == 1


@pytest.mark.parametrize("nibble", range(16))
def test_every_mode_but_analog_and_floating_input_wants_a_debug_pin(fake_chip: Any, nibble: int) -> None:
    fake_chip.write("GPIOB.CRL", 0x4444_0444 | nibble << 12)
    fake_chip.advance(fake_chip.now_ns + SETTLING_NS)
    assert ("PB3:held" in fake_chip.warnings) is (nibble not in (0x0, 0x4, 0xC))


def test_a_pin_that_is_released_after_its_configuration_is_nothing_to_warn_of(fake_chip: Any) -> None:
    """As stm32duino's pinMode does it; another one configured is no alarm once it is given up."""
    fake_chip.write("GPIOB.CRL", 0x4441_1444)
    fake_chip.write("GPIOB.CRL", 0x4440_1444)
    fake_chip.advance(fake_chip.now_ns + SETTLING_NS - 1)
    fake_chip.write("AFIO.MAPR", 0b001 << 24 | SWJ_NOJTAG)  # meaningless: changes nothing
    fake_chip.write("AFIO.MAPR", SWJ_NOJTAG)
    fake_chip.advance(fake_chip.now_ns + SETTLING_NS)
    assert not [key for key in fake_chip.warnings if key.endswith(":held")]


def test_the_inputs_of_the_debug_port_read_as_pulled_and_its_output_not_until_released(fake_chip: Any) -> None:
    assert fake_chip.read("GPIOA.IDR") == 1 << 13 | 1 << 15  # JTMS and JTDI pulled up, JTCK down (RM0008 31.4.4)
    assert fake_chip.read("GPIOB.IDR") == 1 << 4
    fake_chip.pins["PB4"].drive(False)
    fake_chip.pins["PB3"].drive(True)
    assert fake_chip.read("GPIOB.IDR") == 0
    fake_chip.write("AFIO.MAPR", SWJ_NOJTAG)
    assert fake_chip.read("GPIOB.IDR") == 1 << 3


def test_a_read_modify_write_gives_the_pins_back_and_is_warned_of(fake_chip: Any) -> None:
    fake_chip.write("AFIO.MAPR", SWJ_NOJTAG)
    fake_chip.write("AFIO.MAPR", fake_chip.read("AFIO.MAPR") | 1 << 2)
    assert held(fake_chip) == set(DEBUG_PINS)
    assert "PA15, PB3, PB4" in fake_chip.warnings["AFIO:swj-back"]


def test_a_meaningless_swj_cfg_changes_nothing(fake_chip: Any) -> None:
    fake_chip.write("AFIO.MAPR", SWJ_OFF)
    fake_chip.write("AFIO.MAPR", 0b111 << 24)
    assert held(fake_chip) == set()
    assert fake_chip.warnings == {}  # ST's own __HAL_AFIO_REMAP_… writes it
    fake_chip.write("AFIO.MAPR", 0b011 << 24)
    assert held(fake_chip) == set()
    assert list(fake_chip.warnings) == ["AFIO:swj"]


def test_the_crystal_pins_are_gpio_only_when_remapped(fake_chip: Any) -> None:
    assert fake_chip.pins["PD0"].holder == "OSC_IN"
    fake_chip.write("AFIO.MAPR", 1 << 15)
    assert (fake_chip.pins["PD0"].holder, fake_chip.pins["PD1"].holder) == (None, None)


def test_remaps_are_published_by_name(fake_chip: Any) -> None:
    fake_chip.write("AFIO.MAPR", 1 << 2 | 3 << 6 | 2 << 10 | 1 << 12)
    remaps = fake_chip.pins.remaps
    assert {name for name, value in remaps.items() if value} == {"USART1", "TIM1", "TIM3", "TIM4"}
    assert (remaps["TIM1"], remaps["TIM3"]) == (3, 2)


@pytest.mark.parametrize("line", range(16))
def test_each_exti_line_takes_its_port(fake_chip: Any, line: int) -> None:
    fake_chip.write(f"AFIO.EXTICR{line // 4 + 1}", 2 << 4 * (line % 4))
    assert fake_chip.pins.exti_ports == ["C" if n == line else "A" for n in range(16)]


def test_a_port_that_this_chip_lacks_is_warned_of(fake_chip: Any) -> None:
    fake_chip.write("AFIO.EXTICR1", 6)
    assert fake_chip.pins.exti_ports[0] == "A"
    assert list(fake_chip.warnings) == ["AFIO:exticr"]


def test_the_event_output_is_warned_of(fake_chip: Any) -> None:
    fake_chip.write("AFIO.EVCR", 0x35)
    assert fake_chip.warnings == {}
    fake_chip.write("AFIO.EVCR", 0x80)
    assert list(fake_chip.warnings) == ["AFIO:evcr"]


def test_reset_keeps_gpio_modes_for_gpio(fake_chip: Any) -> None:
    fake_chip.write("AFIO.MAPR", SWJ_OFF)
    fake_chip.write("GPIOA.CRH", 0x1444_4444)
    assert fake_chip.pins["PA15"].output is PinDrive.LOW
    fake_chip.parts.by_name["AFIO"].reset()
    assert fake_chip.pins["PA15"].output is PinDrive.PULL_UP
    assert fake_chip.pins["PA15"].mode is PinMode.PUSH_PULL
