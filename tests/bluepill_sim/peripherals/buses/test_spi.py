"""SPI: words to the nanosecond, flags and how they are cleared, CRC, one-wire modes, NSS, master and slave."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.peripherals.spi import Loopback

CPHA, CPOL, MSTR, SPE, LSBFIRST, SSI, SSM, RXONLY = (1 << n for n in (0, 1, 2, 6, 7, 8, 9, 10))
DFF, CRCNEXT, CRCEN, BIDIOE, BIDIMODE = (1 << n for n in range(11, 16))
RXDMAEN, TXDMAEN, SSOE, ERRIE, RXNEIE, TXEIE = (1 << n for n in (0, 1, 2, 5, 6, 7))
RXNE, TXE, CRCERR, MODF, OVR, BSY = (1 << n for n in (0, 1, 4, 5, 6, 7))
MASTER = MSTR | SPE | SSM | SSI
#: 8 MHz / 2 is 4 MHz: eight bits take 2 us.
WORD_NS = 2000
QUICK = settings(max_examples=60)
Chips = Callable[[], Any]


class Recorder:
    """A part that answers what it was told to, and keeps what it hears."""

    spi_modes = frozenset(range(4))
    max_hz = 36_000_000

    def __init__(self, answers: bytes = b"") -> None:
        self.answers = list(answers)
        self.heard: list[tuple[Any, ...]] = []

    def select(self, at_ns: int) -> None:
        self.heard.append(("select", at_ns))

    def deselect(self, at_ns: int) -> None:
        self.heard.append(("deselect", at_ns))

    def exchange(self, byte: int, at_ns: int) -> int:
        self.heard.append((byte, at_ns))
        return self.answers.pop(0) if self.answers else 0xFF

    @property
    def bytes(self) -> list[int]:
        return [row[0] for row in self.heard if isinstance(row[0], int)]


def set_up(chip: Any, control: int = MASTER, device: Any = None, name: str = "SPI1") -> list[tuple[int, int, int]]:
    """SPI on its pins, on; returns the words that go over the wires."""
    chip.write("GPIOA.CRL", 0xB4B4_4444)  # PA5 SCK, PA7 MOSI alternate, PA6 MISO floating
    chip.write("GPIOB.CRH", 0xB4B4_4444)  # PB13, PB15 and PB14 of SPI2
    words: list[tuple[int, int, int]] = []
    part = chip.parts.by_name[name]
    part.subscribe(lambda rows: words.extend(row[:3] for row in rows))
    if device is not None:
        part.attach(device)
    chip.write(f"{name}.CR1", control)
    return words


def status(chip: Any, name: str = "SPI1") -> int:
    return int(chip.parts.by_name[name].words[2])


def test_who_subscribes_hears_what_goes_over_the_wires_from_then_on(fake_chip: Any) -> None:
    first = set_up(fake_chip)
    fake_chip.write("SPI1.DR", 0x11)
    fake_chip.advance(fake_chip.now_ns + 1_000_000)
    second: list[int] = []
    part = fake_chip.parts.by_name["SPI1"]
    end = part.subscribe(lambda rows: second.extend(row[1] for row in rows))
    fake_chip.write("SPI1.DR", 0x22)
    fake_chip.advance(fake_chip.now_ns + 1_000_000)
    end()
    fake_chip.write("SPI1.DR", 0x33)
    fake_chip.advance(fake_chip.now_ns + 1_000_000)
    part.deliver()
    assert ([row[1] for row in first], second) == ([0x11, 0x22, 0x33], [0x22])


@pytest.mark.parametrize("only_receives", [False, True])
def test_a_slave_drives_miso_while_it_is_selected_and_sends(fake_chip: Any, only_receives: bool) -> None:
    fake_chip.write("GPIOA.CRL", 0x4B44_4444)  # PA6 MISO alternate, PA4 NSS floating
    select, miso = fake_chip.pins["PA4"], fake_chip.pins["PA6"]
    select.drive(1)
    fake_chip.write("SPI1.CR1", SPE | (RXONLY if only_receives else 0))
    assert miso.is_floating
    select.drive(0)
    assert miso.is_floating is only_receives
    fake_chip.write("SPI1.CR1", 0)
    assert miso.is_floating


def test_a_word_is_over_when_its_last_bit_is(fake_chip: Any) -> None:
    part = Recorder(b"\x5a")
    set_up(fake_chip, device=part)
    start_ns = fake_chip.now_ns
    fake_chip.write("SPI1.DR", 0x9F)
    assert status(fake_chip) & (TXE | BSY | RXNE) == TXE | BSY
    fake_chip.advance(start_ns + WORD_NS - 1)
    assert status(fake_chip) & (BSY | RXNE) == BSY
    assert part.heard == []
    fake_chip.advance(start_ns + WORD_NS)
    assert status(fake_chip) & (BSY | RXNE) == RXNE
    assert part.heard == [(0x9F, start_ns + WORD_NS)]
    assert fake_chip.read("SPI1.DR") == 0x5A
    assert not status(fake_chip) & RXNE


@pytest.mark.parametrize("divider", range(8))
@pytest.mark.parametrize("frame", [0, DFF])
def test_br_and_dff_make_the_length_of_a_word(fake_chip: Any, divider: int, frame: int) -> None:
    fake_chip.run_at_72_mhz()
    words = set_up(fake_chip, MASTER | divider << 3 | frame, Loopback(), "SPI2")
    start_ns = fake_chip.now_ns
    for number in range(3):
        fake_chip.write("SPI2.DR", number)
        fake_chip.advance(start_ns + (16 if frame else 8) * (2 << divider) * (number + 1) * 10**9 // 36_000_000)
        fake_chip.read("SPI2.DR")
    ticks = (16 if frame else 8) * (2 << divider)
    assert words[0][0] - start_ns == ticks * 10**9 // 36_000_000
    assert [row[1:] for row in words] == [(n, n) for n in range(3)]


def test_words_follow_without_a_gap_and_never_drift(fake_chip: Any) -> None:
    fake_chip.run_at_72_mhz()
    words = set_up(fake_chip, MASTER | 1 << 3, Loopback())  # 72 MHz / 4: eight bits take 444.4 ns
    start_ns = fake_chip.now_ns
    fake_chip.write("SPI1.DR", 0)
    for number in range(1, 40):
        fake_chip.write("SPI1.DR", number)
        assert not status(fake_chip) & TXE
        fake_chip.advance(start_ns + number * 32 * 10**9 // 72_000_000)
        assert status(fake_chip) & (TXE | BSY | RXNE) == TXE | BSY | RXNE
        assert fake_chip.read("SPI1.DR") == number - 1
    fake_chip.advance(start_ns + 10**6)
    assert [at_ns - start_ns for at_ns, _, _ in words] == [n * 32 * 10**9 // 72_000_000 for n in range(1, 41)]


def test_an_overrun_is_cleared_by_dr_then_sr(fake_chip: Any) -> None:
    set_up(fake_chip, device=Recorder(bytes(range(1, 9))))
    fake_chip.write("SPI1.CR2", ERRIE)
    for _ in range(2):
        fake_chip.write("SPI1.DR", 0)
        fake_chip.advance(fake_chip.now_ns + WORD_NS)
    assert status(fake_chip) & OVR
    assert fake_chip.irqs[35]
    fake_chip.read("SPI1.SR")
    assert status(fake_chip) & OVR, "a read of SR alone is not enough"
    assert fake_chip.read("SPI1.DR") == 1, "the word that came first is kept"
    assert status(fake_chip) & OVR
    assert fake_chip.read("SPI1.SR") & OVR
    assert not status(fake_chip) & OVR
    assert not fake_chip.irqs[35]


@pytest.mark.parametrize("is_software", [True, False])
def test_a_master_whose_nss_is_low_is_switched_off_until_sr_and_cr1(fake_chip: Any, is_software: bool) -> None:
    set_up(fake_chip, MASTER if is_software else 0)
    fake_chip.write("SPI1.CR2", ERRIE)
    if is_software:
        fake_chip.write("SPI1.CR1", MASTER & ~SSI)
    else:
        fake_chip.pins["PA4"].drive(1)
        fake_chip.write("SPI1.CR1", MSTR | SPE)
        assert not status(fake_chip) & MODF
        fake_chip.pins["PA4"].drive(0)
    assert status(fake_chip) & MODF
    assert fake_chip.irqs[35]
    assert fake_chip.read("SPI1.CR1") & (SPE | MSTR) == 0
    fake_chip.write("SPI1.CR1", MASTER)
    assert fake_chip.read("SPI1.CR1") & (SPE | MSTR) == 0, "neither can be set while MODF is"
    assert status(fake_chip) & MODF
    fake_chip.read("SPI1.SR")
    fake_chip.pins["PA4"].drive(1)
    fake_chip.write("SPI1.CR1", MASTER)
    assert not status(fake_chip) & MODF
    assert not fake_chip.irqs[35]
    assert "SPI1:MODE_FAULT" in fake_chip.warnings


def test_ssoe_holds_nss_low_from_spe_to_the_end_of_the_last_word(fake_chip: Any) -> None:
    fake_chip.write("GPIOA.CRL", 0xB4BB_4444)
    fake_chip.write("SPI1.CR2", SSOE)
    assert fake_chip.pins["PA4"].output.level is None
    fake_chip.write("SPI1.CR1", MSTR | SPE)
    assert fake_chip.pins["PA4"].output.level is False
    assert not status(fake_chip) & MODF
    start_ns = fake_chip.now_ns
    fake_chip.write("SPI1.DR", 1)
    fake_chip.write("SPI1.CR1", MSTR)
    fake_chip.advance(start_ns + WORD_NS - 1)
    assert fake_chip.pins["PA4"].output.level is False
    fake_chip.advance(start_ns + WORD_NS)
    assert fake_chip.pins["PA4"].output.level is None
    assert status(fake_chip) & RXNE, "the word under way ends"


def test_interrupts_and_requests_follow_their_flags(fake_chip: Any) -> None:
    set_up(fake_chip, device=Loopback())
    part = fake_chip.parts.by_name["SPI1"]
    fake_chip.write("SPI1.CR2", TXEIE)
    assert fake_chip.irqs[35]
    fake_chip.write("SPI1.CR2", RXNEIE)
    assert not fake_chip.irqs[35]
    fake_chip.write("SPI1.DR", 1)
    fake_chip.advance(fake_chip.now_ns + WORD_NS - 1)
    assert not fake_chip.irqs[35]
    fake_chip.advance(fake_chip.now_ns + 1)
    assert fake_chip.irqs[35]
    fake_chip.read("SPI1.DR")
    assert not fake_chip.irqs[35]
    assert part.OUTPUTS == ("irq", "rx_dma", "tx_dma")


def crc_by_division(words: list[int], polynomial: int, bits: int, *, lsb_first: bool) -> int:
    """The manual's CRC, a bit at a time."""
    crc = 0
    for word in words:
        for n in range(bits):
            bit = word >> (n if lsb_first else bits - 1 - n) & 1
            top = crc >> bits - 1 & 1
            crc = crc << 1 & (1 << bits) - 1
            crc ^= polynomial if bit ^ top else 0
    return crc & (1 << bits) - 1


@QUICK
@given(st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=6), st.integers(0, 0xFFFF), st.sampled_from([0, DFF]),
       st.sampled_from([0, LSBFIRST]), st.booleans())  # fmt: skip
def test_the_crc_is_that_of_the_words_and_a_wrong_one_is_reported(
    make_fake_chip: Chips, words: list[int], polynomial: int, frame: int, order: int, is_damaged: bool
) -> None:
    chip = make_fake_chip()
    bits = 16 if frame else 8
    polynomial = polynomial & (1 << bits) - 1 | 1  # then no damage is shifted out unseen
    seen = set_up(chip, 0, Loopback())
    chip.write("SPI1.CRCPR", polynomial)
    chip.write("SPI1.CR1", MASTER | CRCEN | frame | order)
    for number, word in enumerate(words):
        chip.write("SPI1.DR", word)
        if number == len(words) - 1:
            chip.write("SPI1.CR1", MASTER | CRCEN | CRCNEXT | frame | order)
            expected = crc_by_division([w & (1 << bits) - 1 for w in words], polynomial, bits, lsb_first=bool(order))
            if is_damaged:
                chip.parts.by_name["SPI1"].words[5] ^= 0x55  # what it would have received so far
        chip.advance(chip.now_ns + bits * 250)
        assert chip.read("SPI1.DR") == word & (1 << bits) - 1
    assert chip.read("SPI1.TXCRCR") == expected
    chip.advance(chip.now_ns + bits * 250)
    assert seen[-1][1] == expected
    assert bool(status(chip) & CRCERR) is is_damaged
    chip.write("SPI1.SR", 0xFFFF & ~CRCERR)
    assert not status(chip) & CRCERR
    assert not chip.read("SPI1.CR1") & CRCNEXT


def test_setting_crcen_clears_both_crcs(fake_chip: Any) -> None:
    set_up(fake_chip, MASTER | CRCEN, Loopback())
    fake_chip.write("SPI1.DR", 0x31)
    fake_chip.advance(fake_chip.now_ns + WORD_NS)
    fake_chip.write("SPI1.CR1", MASTER | CRCEN | CPOL)
    assert fake_chip.read("SPI1.RXCRCR") == fake_chip.read("SPI1.TXCRCR") != 0, "it was set before"
    fake_chip.write("SPI1.CR1", MASTER)
    assert fake_chip.read("SPI1.RXCRCR") != 0
    fake_chip.write("SPI1.CR1", MASTER | CRCEN)
    assert fake_chip.read("SPI1.RXCRCR") == fake_chip.read("SPI1.TXCRCR") == 0


@pytest.mark.parametrize("mode", [RXONLY, BIDIMODE])
def test_reception_clocks_until_spe_is_cleared_and_then_to_the_end_of_the_word(fake_chip: Any, mode: int) -> None:
    part = Recorder(bytes(range(1, 9)))
    set_up(fake_chip, 0, part)
    start_ns = fake_chip.now_ns
    fake_chip.write("SPI1.CR1", MASTER | mode)
    assert bool(status(fake_chip) & BSY) is (mode == RXONLY), "the one-wire mode does not show it"
    for number in range(1, 4):
        fake_chip.advance(start_ns + number * WORD_NS - 1)
        assert not status(fake_chip) & RXNE
        fake_chip.advance(start_ns + number * WORD_NS)
        assert fake_chip.read("SPI1.DR") == number
    fake_chip.write("SPI1.CR1", (MASTER | mode) & ~SPE)
    fake_chip.advance(start_ns + 10 * WORD_NS)
    assert fake_chip.read("SPI1.DR") == 4
    assert part.bytes == [0xFF] * 4


def test_one_wire_transmission_receives_nothing(fake_chip: Any) -> None:
    part = Recorder(b"\x01\x02")
    set_up(fake_chip, MASTER | BIDIMODE | BIDIOE, part)
    fake_chip.write("SPI1.DR", 0x77)
    fake_chip.advance(fake_chip.now_ns + WORD_NS)
    assert part.bytes == [0x77]
    assert status(fake_chip) & (RXNE | OVR | BSY) == 0


def test_a_word_written_before_spe_waits_for_it(fake_chip: Any) -> None:
    words = set_up(fake_chip, MASTER & ~SPE, Loopback())
    fake_chip.write("SPI1.DR", 0x42)
    assert not status(fake_chip) & TXE
    fake_chip.advance(fake_chip.now_ns + 10 * WORD_NS)
    assert words == []
    start_ns = fake_chip.now_ns
    fake_chip.write("SPI1.CR1", MASTER)
    fake_chip.advance(start_ns + WORD_NS)
    assert words == [(start_ns + WORD_NS, 0x42, 0x42)]


@QUICK
@given(st.integers(0, 0xFFFF), st.sampled_from([0, LSBFIRST]))
def test_a_part_gets_bytes_in_the_order_of_the_wire(make_fake_chip: Chips, word: int, order: int) -> None:
    chip, part = make_fake_chip(), Recorder(b"\x12\x34")
    set_up(chip, MASTER | DFF | order, part)
    chip.write("SPI1.DR", word)
    chip.advance(chip.now_ns + 2 * WORD_NS)
    turned = int(f"{word:016b}"[::-1], 2) if order else word
    assert part.bytes == [turned >> 8, turned & 0xFF]
    assert chip.read("SPI1.DR") == (int(f"{0x1234:016b}"[::-1], 2) if order else 0x1234)


def test_a_part_hears_only_words_that_began_while_it_was_selected(fake_chip: Any) -> None:
    part = Recorder()
    set_up(fake_chip)
    fake_chip.parts.by_name["SPI1"].attach(part, "PB0")
    assert fake_chip.pins["PB0"].level, "its select is pulled up"
    fake_chip.write("SPI1.DR", 1)
    fake_chip.advance(fake_chip.now_ns + 1000)
    fake_chip.write("GPIOB.CRL", 0x4444_4443)  # PB0 an output, at 0
    fake_chip.advance(fake_chip.now_ns + 5000)
    fake_chip.write("SPI1.DR", 2)
    fake_chip.advance(fake_chip.now_ns + WORD_NS)
    fake_chip.write("SPI1.DR", 3)
    fake_chip.advance(fake_chip.now_ns + 1000)
    fake_chip.write("GPIOB.BSRR", 1)
    fake_chip.advance(fake_chip.now_ns + 5000)
    assert [row[0] for row in part.heard] == ["select", 2, "deselect"]
    assert all(one[1] < two[1] for one, two in pairwise(part.heard))


def test_of_two_selected_parts_a_zero_wins_and_of_none_the_wire(fake_chip: Any) -> None:
    one, two = Recorder(b"\xf0"), Recorder(b"\x3c")
    set_up(fake_chip, device=one)
    fake_chip.parts.by_name["SPI1"].attach(two)
    fake_chip.write("SPI1.DR", 0)
    fake_chip.advance(fake_chip.now_ns + WORD_NS)
    assert fake_chip.read("SPI1.DR") == 0x30
    set_up(fake_chip, name="SPI2")
    for level in (1, 0):
        fake_chip.pins["PB14"].drive(level)
        fake_chip.write("SPI2.DR", 0x5A)
        fake_chip.advance(fake_chip.now_ns + WORD_NS)
        assert fake_chip.read("SPI2.DR") == 0xFF * level


def test_a_part_of_another_mode_hears_nothing_and_a_slow_one_is_reported(fake_chip: Any) -> None:
    part = Recorder(b"\x01" * 4)
    part.spi_modes, part.max_hz = frozenset({0}), 1_000_000  # type: ignore[misc]
    set_up(fake_chip, MASTER | CPOL, part)
    fake_chip.write("SPI1.DR", 1)
    fake_chip.advance(fake_chip.now_ns + WORD_NS)
    assert (part.bytes, fake_chip.read("SPI1.DR")) == ([], 0xFF)
    fake_chip.write("SPI1.CR1", MASTER)
    fake_chip.write("SPI1.DR", 1)
    fake_chip.advance(fake_chip.now_ns + WORD_NS)
    assert part.bytes == [1]
    assert {"SPI1:mode:Recorder", "SPI1:hz:Recorder"} <= set(fake_chip.warnings)


def test_sck_idles_at_cpol_and_pins_that_are_no_outputs_are_warned_of(fake_chip: Any) -> None:
    set_up(fake_chip, MASTER | CPOL)
    assert fake_chip.pins["PA5"].output.level is True
    fake_chip.write("SPI1.CR1", MASTER)
    assert fake_chip.pins["PA5"].output.level is False
    part = Recorder()
    fake_chip.parts.by_name["SPI1"].attach(part)
    fake_chip.write("GPIOA.CRL", 0x4444_4444)
    fake_chip.write("SPI1.DR", 1)
    fake_chip.advance(fake_chip.now_ns + WORD_NS)
    assert part.bytes == []
    assert "PA5" in fake_chip.warnings["SPI1:NO_SCK"]


def test_the_remap_moves_spi1_to_pb3_to_pb5(fake_chip: Any) -> None:
    set_up(fake_chip, MASTER | CPOL, Loopback())
    fake_chip.write("AFIO.MAPR", 1 | 0b010 << 24)
    fake_chip.write("GPIOB.CRL", 0x44B4_B444)
    assert (fake_chip.pins["PA5"].output.level, fake_chip.pins["PB3"].output.level) == (None, True)
    fake_chip.write("SPI1.DR", 0x99)
    fake_chip.advance(fake_chip.now_ns + WORD_NS)
    assert fake_chip.read("SPI1.DR") == 0x99
    assert "SPI1:NO_SCK" not in fake_chip.warnings


# The chip as a slave.


def test_a_slave_sends_its_buffer_while_a_master_outside_clocks(fake_chip: Any) -> None:
    words = set_up(fake_chip, SPE | SSM)  # SSI = 0: selected
    part = fake_chip.parts.by_name["SPI1"]
    fake_chip.write("SPI1.DR", 0xA1)
    assert not status(fake_chip) & TXE, "nothing goes out before the master clocks"
    start_ns = fake_chip.now_ns
    part.clock_in([0x10, 0x20, 0x30], hz=1_000_000)
    assert status(fake_chip) & (TXE | BSY) == TXE | BSY
    fake_chip.write("SPI1.DR", 0xA2)
    fake_chip.advance(start_ns + 7_999)
    assert not status(fake_chip) & RXNE
    fake_chip.advance(start_ns + 8_000)
    assert fake_chip.read("SPI1.DR") == 0x10
    fake_chip.advance(start_ns + 16_000)
    assert fake_chip.read("SPI1.DR") == 0x20
    fake_chip.advance(start_ns + 24_000)
    assert not status(fake_chip) & BSY
    assert words == [(start_ns + 8_000 * n, 0x10 * n, sent) for n, sent in ((1, 0xA1), (2, 0xA2), (3, 0x20))]


def test_a_slave_that_is_not_selected_hears_nothing(fake_chip: Any) -> None:
    set_up(fake_chip, SPE)
    part = fake_chip.parts.by_name["SPI1"]
    fake_chip.pins["PA4"].drive(1)
    part.clock_in([1], hz=1_000_000)
    fake_chip.advance(fake_chip.now_ns + 8_000)
    assert not status(fake_chip) & RXNE
    fake_chip.pins["PA4"].drive(0)
    part.clock_in([2], hz=1_000_000)
    fake_chip.advance(fake_chip.now_ns + 8_000)
    assert fake_chip.read("SPI1.DR") == 2


def test_i2s_is_reported_to_be_absent(fake_chip: Any) -> None:
    fake_chip.write("SPI1.I2SCFGR", 0)
    assert fake_chip.warnings == {}
    fake_chip.write("SPI1.I2SCFGR", 1 << 11)
    assert fake_chip.read("SPI1.I2SCFGR") == 0
    assert "no I2S" in fake_chip.warnings["SPI1:i2s"]


def test_a_change_of_the_clock_stretches_what_is_left_of_a_word(fake_chip: Any) -> None:
    words = set_up(fake_chip, device=Loopback())
    start_ns = fake_chip.now_ns
    fake_chip.write("SPI1.DR", 1)
    fake_chip.advance(start_ns + WORD_NS // 2)
    fake_chip.write("RCC.CFGR", 4 << 11)  # PCLK2 halved
    fake_chip.advance(start_ns + 10 * WORD_NS)
    assert words[0][0] == start_ns + WORD_NS // 2 + WORD_NS


STEP = st.one_of(
    st.tuples(st.just("DR"), st.integers(0, 0xFFFF)),
    st.tuples(st.just("read"), st.just(0)),
    st.tuples(st.just("wait"), st.integers(1, 3 * WORD_NS)),
)


@QUICK
@given(st.lists(STEP, max_size=30), st.sampled_from([0, DFF]))
def test_generated_transfers_are_those_of_a_plain_model(
    make_fake_chip: Chips, steps: list[tuple[str, int]], frame: int
) -> None:
    """The model: a buffer, a word under way with its end, a received word; no ticks, no run."""
    chip = make_fake_chip()
    words = set_up(chip, MASTER | frame, Loopback())
    span, mask = (2 * WORD_NS, 0xFFFF) if frame else (WORD_NS, 0xFF)
    buffer: int | None = None
    going: tuple[int, int] | None = None
    received, flags, over, log = 0, TXE, False, []
    now = chip.now_ns
    for what, value in steps:
        if what == "DR":
            chip.write("SPI1.DR", value)
            if going is None:
                going = (value & mask, now + span)
            else:
                buffer = value & mask
        elif what == "read":
            assert chip.read("SPI1.DR") == received
            flags &= ~RXNE
        else:
            end = now + value
            while going is not None and going[1] <= end:
                word, at_ns = going
                log.append((at_ns, word, word))
                over = over or bool(flags & RXNE)
                received = received if flags & RXNE else word
                flags |= RXNE
                going = None if buffer is None else (buffer, at_ns + span)
                buffer = None
            chip.advance(end)
            now = end
        expected = flags & RXNE | (0 if buffer is not None else TXE) | (BSY if going else 0) | (OVR if over else 0)
        assert status(chip) == expected
    chip.deliver()
    assert words == log


@QUICK
@given(st.lists(st.tuples(st.sampled_from(["CR1", "CR2", "SR", "DR", "CRCPR", "I2SCFGR"]), st.integers(0, 0xFFFF),
                          st.integers(0, 9000)), max_size=25))  # fmt: skip
def test_whatever_is_written_registers_keep_their_contract(
    make_fake_chip: Chips, writes: list[tuple[str, int, int]]
) -> None:
    chip = make_fake_chip()
    set_up(chip, 0, Loopback())
    for name, value, wait in writes:
        chip.write(f"SPI1.{name}", value)
        if name == "CR2":
            assert chip.read("SPI1.CR2") == value & 0xE7
        if name == "CRCPR":
            assert chip.read("SPI1.CRCPR") == value
        chip.advance(chip.now_ns + wait)
        found, control, enabled = status(chip), chip.read("SPI1.CR1"), chip.read("SPI1.CR2")
        assert found & 0x0C == 0
        assert not (found & MODF and control & (SPE | MSTR))
        raised = (found & RXNE and enabled & RXNEIE) or (found & TXE and enabled & TXEIE)
        assert chip.irqs[35] is bool(raised or (found & (CRCERR | MODF | OVR) and enabled & ERRIE))


@QUICK
@given(st.integers(0, 2 * WORD_NS), st.integers(0, 255), st.integers(0, 255))
def test_a_snapshot_within_a_word_goes_on_alike(make_fake_chip: Chips, at: int, one: int, two: int) -> None:
    chip = make_fake_chip()
    words = set_up(chip, device=Loopback())
    chip.write("SPI1.DR", one)
    chip.write("SPI1.DR", two)
    chip.advance(chip.now_ns + at)
    part, start_ns = chip.parts.by_name["SPI1"], chip.now_ns
    saved = part.snapshot()
    ends = []
    for _ in range(2):
        words.clear()
        chip.advance(start_ns + 3 * WORD_NS)
        ends.append((tuple(words), part.snapshot(), chip.read("SPI1.DR")))
        chip.now_ns = start_ns
        part.restore(saved)
    assert ends[0] == ends[1]
