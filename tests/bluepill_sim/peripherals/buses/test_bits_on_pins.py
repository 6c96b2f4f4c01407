"""Single bits on the pins of SPI while somebody looks: decoded from the edges, they are the words that went over."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.subscriptions import EDGE, HIGH
from tests.bluepill_sim.peripherals.buses.test_spi import (
    BIDIMODE,
    BIDIOE,
    BSY,
    CPHA,
    CPOL,
    DFF,
    LSBFIRST,
    MASTER,
    MSTR,
    RXNE,
    RXONLY,
    SPE,
    TXE,
    Recorder,
    set_up,
    status,
)

#: PCLK2 of the fake chip.
CLOCK_HZ = 8_000_000
Edge = tuple[int, str, bool]


class Pins:
    """What somebody sees who looks at pins."""

    def __init__(self, chip: Any, *names: str) -> None:
        self._names = {chip.pins[name].index: name for name in names}
        self._rows: list[bytes] = []
        self.subscription = chip.pins.subscribe_pins(names, self._rows.append)

    @property
    def edges(self) -> list[Edge]:
        return [(row[0], self._names[row[1]], row[3] == HIGH) for row in EDGE.iter_unpack(b"".join(self._rows))]


def sampled(edges: list[Edge], control: int) -> list[tuple[int, int]]:
    """Return (ns, MOSI) at each edge of SCK at which a slave samples: up in modes 0 and 3."""
    rises = bool(control & CPOL) == bool(control & CPHA)
    data, bits = 0, []
    for at_ns, pin, level in edges:
        if pin == "PA7":
            data = int(level)
        elif level is rises:
            bits.append((at_ns, data))
    return bits


def half_ns(divider: int, halves: int) -> int:
    """Half a bit is 2 ** divider ticks of PCLK."""
    return halves * (1 << divider) * 10**9 // CLOCK_HZ


def send(chip: Any, words: list[int], end_ns: int) -> None:
    for word in words:
        while not status(chip) & TXE:
            chip.advance(chip.now_ns + 125)
        chip.write("SPI1.DR", word)
    chip.advance(end_ns)


@settings(max_examples=60)
@given(
    st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=3),
    st.sampled_from([0, CPHA, CPOL, CPOL | CPHA]),
    st.sampled_from([0, DFF]),
    st.sampled_from([0, LSBFIRST]),
    st.integers(0, 3),
)
def test_the_bits_on_sck_and_mosi_are_the_words(
    make_fake_chip: Any, words: list[int], mode: int, frame: int, order: int, divider: int
) -> None:
    chip = make_fake_chip()
    control, length = MASTER | mode | frame | order | divider << 3, 16 if frame else 8
    gone = set_up(chip, control)
    pins, start_ns = Pins(chip, "PA5", "PA7"), chip.now_ns
    idle = chip.pins["PA5"].level
    assert idle is bool(mode & CPOL)
    end_ns = start_ns + half_ns(divider, 2 * length * len(words))
    send(chip, words, end_ns)
    bits = sampled(pins.edges, control)
    expected = [word >> (n if order else length - 1 - n) & 1 for word in words for n in range(length)]
    assert [bit for _, bit in bits] == expected
    assert [at_ns - start_ns for at_ns, _ in bits] == [half_ns(divider, 2 * n + 1) for n in range(len(bits))]
    clock = [at_ns - start_ns for at_ns, pin, _ in pins.edges if pin == "PA5"]
    first = 0 if mode & CPHA else 1
    assert clock == [half_ns(divider, first + n) for n in range(2 * len(bits))]
    assert chip.pins["PA5"].level is idle
    assert [row[0] for row in gone] == [start_ns + half_ns(divider, 2 * length * (n + 1)) for n in range(len(words))]
    assert not status(chip) & BSY


@pytest.mark.parametrize("mode", [0, CPHA, CPOL, CPOL | CPHA])
@pytest.mark.parametrize("extra", [0, BIDIMODE | BIDIOE, BIDIMODE, RXONLY])
def test_what_a_word_does_is_the_same_whether_or_not_somebody_looks(make_fake_chip: Any, mode: int, extra: int) -> None:
    seen = []
    for looks in (False, True):
        chip = make_fake_chip()
        pins = Pins(chip, "PA5", "PA7") if looks else None
        part = Recorder(b"\x5a\xa5\x3c")
        gone = set_up(chip, 0, part)
        start_ns = chip.now_ns
        chip.write("SPI1.CR1", MASTER | mode | extra)
        chip.write("SPI1.DR", 0xC3)
        chip.advance(start_ns + 5_000)
        chip.write("SPI1.CR1", (MASTER | mode | extra) & ~SPE)
        chip.advance(start_ns + 20_000)
        state = (status(chip), chip.read("SPI1.DR"), gone, part.heard, chip.pins["PA5"].output, chip.pins["PA7"].output)
        seen.append((state, list(chip.warnings) if hasattr(chip, "warnings") else None))
        if pins is not None:
            clock = [level for _, pin, level in pins.edges if pin == "PA5"]
            assert len(clock) >= 16
            assert extra in (0, BIDIMODE | BIDIOE) or not any(pin == "PA7" and level for _, pin, level in pins.edges)
    assert seen[0] == seen[1]


def test_bits_of_spi_cost_nothing_while_nobody_looks(fake_chip: Any) -> None:
    set_up(fake_chip)
    start_ns = fake_chip.now_ns
    fake_chip.write("SPI1.DR", 0x55)
    assert fake_chip.parts.by_name["SPI1"].native.half == 0
    fake_chip.advance(start_ns + 1_999)
    assert (fake_chip.pins["PA5"].level, fake_chip.pins["PA7"].level) == (False, False)


def test_who_stops_looking_sees_no_bit_of_the_next_word(fake_chip: Any) -> None:
    set_up(fake_chip, MASTER | CPHA)
    pins, start_ns = Pins(fake_chip, "PA5"), fake_chip.now_ns
    fake_chip.write("SPI1.DR", 0xFF)
    fake_chip.write("SPI1.DR", 0xFF)
    fake_chip.advance(start_ns + 100)
    pins.subscription.close()
    fake_chip.advance(start_ns + 1_999)
    assert fake_chip.parts.by_name["SPI1"].native.half == 16
    fake_chip.advance(start_ns + 2_000)
    assert fake_chip.parts.by_name["SPI1"].native.half == 0
    assert (fake_chip.pins["PA5"].level, fake_chip.pins["PA7"].level) == (False, False)
    fake_chip.advance(start_ns + 4_000)
    assert not status(fake_chip) & BSY


@pytest.mark.parametrize("change", [0, MSTR])
def test_a_master_that_stops_being_one_in_a_word_lets_go_of_its_pins(fake_chip: Any, change: int) -> None:
    set_up(fake_chip)
    Pins(fake_chip, "PA5", "PA7")
    start_ns = fake_chip.now_ns
    fake_chip.write("SPI1.DR", 0xFF)
    fake_chip.advance(start_ns + 300)
    fake_chip.write("SPI1.CR1", MASTER & ~change)
    assert fake_chip.pins["PA7"].level is not bool(change)
    fake_chip.advance(start_ns + 2_000)
    assert bool(status(fake_chip) & RXNE)
