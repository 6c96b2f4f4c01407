"""What peripherals expect of the chip around them: the fake of these tests and the real one keep it alike."""

from collections.abc import Callable
from typing import Any

import pytest

from bluepill_sim.fabric.clocks import Clocks
from bluepill_sim.fabric.pins import PinBank

#: Initial SP, reset vector, and there an endless loop (`b .`).
IDLE_PROGRAM = (0x2000_5000).to_bytes(4, "little") + (0x0800_0009).to_bytes(4, "little") + b"\xfe\xe7\xfe\xe7"


class Ports:
    """A chip, and how a test moves and observes it."""

    def __init__(
        self, chip: Any, advance: Callable[[int], object], is_pending: Callable[[int], bool], warnings: Any
    ) -> None:
        self.chip, self.advance, self.is_pending, self.warnings = chip, advance, is_pending, warnings


def make_fake(make_fake_chip: Callable[[], Any]) -> Ports:
    chip = make_fake_chip()
    return Ports(chip, chip.advance, lambda irq: chip.irqs.get(irq, False), lambda: list(chip.warnings))


def make_real(_make_fake_chip: Callable[[], Any]) -> Ports:
    pytest.importorskip("unicorn")
    from bluepill_sim.chip import Chip
    from bluepill_sim.memory.arrays import Memory

    memory, warned = Memory(), dict[str, str]()
    memory.load_flash(0, IDLE_PROGRAM)
    chip = Chip(memory, 0x0800_0000, lambda text, once, _pc: warned.setdefault(once, text), lambda *_fault: None)

    def is_pending(irq: int) -> bool:
        # NVIC_ISPR0 and 1, by the private peripheral bus.
        return bool(chip.system.read(0xE200 + 4 * (irq // 32), 4) >> irq % 32 & 1)

    return Ports(chip, chip.advance_to, is_pending, lambda: list(warned))


@pytest.fixture(params=[make_fake, make_real], ids=["fake", "real"])
def ports(request: pytest.FixtureRequest, make_fake_chip: Callable[[], Any]) -> Ports:
    ports: Ports = request.param(make_fake_chip)
    return ports


def test_pins_and_clocks_are_one_object_each_for_ever(ports: Ports) -> None:
    chip = ports.chip
    pins, clocks = chip.pins, chip.clocks
    assert isinstance(pins, PinBank)
    assert clocks == Clocks()
    ports.advance(1000)
    assert chip.pins is pins
    assert chip.clocks is clocks


def test_time_goes_on_and_never_back(ports: Ports) -> None:
    before = ports.chip.now_ns
    ports.advance(before + 10_000)
    assert before + 10_000 <= ports.chip.now_ns < before + 20_000


def test_a_level_makes_its_interrupt_pending(ports: Ports) -> None:
    assert not ports.is_pending(37)
    ports.chip.parts.by_name["USART1"].set_output("irq", True)
    assert ports.is_pending(37)
    assert not ports.is_pending(36)


def test_a_deadline_that_moves_is_met_to_the_nanosecond(ports: Ports) -> None:
    chip = ports.chip
    wwdg = chip.parts.by_name["WWDG"]
    seen: list[int] = []
    act = wwdg.advance_to

    def advance_to(now_ns: int) -> None:
        seen.append(chip.now_ns)
        act(now_ns)

    chip.pins.fabric._acts[wwdg.slot] = advance_to
    start_ns = chip.now_ns
    wwdg.write(0, 4, 0xFF)
    ports.advance(start_ns + 32_300_000)
    assert seen == [start_ns + (0x7F - 0x40) * 4096 * 125]  # the early warning, of a PCLK1 of 8 MHz


def test_a_changed_clock_is_notified_to_every_peripheral(ports: Ports) -> None:
    chip = ports.chip
    reported: list[str] = []
    for part in chip.parts.by_name.values():
        part.clock_changed = lambda name=part.name: reported.append(name)
    chip.parts.rcc.write(4, 4, 8 << 4)
    assert reported == list(chip.parts.by_name)
    assert chip.clocks.hclk_hz == 4_000_000


def test_a_peripheral_is_reset_by_name_and_strangers_are_ignored(ports: Ports) -> None:
    port = ports.chip.parts.by_name["GPIOA"]
    port.write(0x0C, 4, 5)
    ports.chip.reset_peripheral("GPIOB")
    ports.chip.reset_peripheral("TIM8")
    assert port.read(0x0C, 4) == 5
    ports.chip.reset_peripheral("GPIOA")
    assert port.read(0x0C, 4) == 0


def test_a_warning_is_kept_under_its_key(ports: Ports) -> None:
    ports.chip.warn("first", once="key")
    ports.chip.warn("again", once="key")
    assert ports.warnings() == ["key"]


def test_stops_and_signals_are_accepted_at_any_time(ports: Ports) -> None:
    ports.chip.request_stop()
    ports.chip.end_slice()
    ports.chip.signal("event")
    ports.chip.signal("unknown")
    start_ns = ports.chip.now_ns
    ports.advance(start_ns + 1000)
    ports.advance(start_ns + 1000)
    assert ports.chip.now_ns >= start_ns + 1000
