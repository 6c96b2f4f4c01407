"""I2C: conditions and bytes to the nanosecond, flags and the sequences that clear them, master and slave, errors."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.parts import Eeprom24C02
from bluepill_sim.peripherals.i2c import I2cStep, I2cSymbol

PE, SMBUS, SMBTYPE, ENPEC, ENGC, NOSTRETCH, START, STOP, ACK, POS, PEC, ALERT, SWRST = (
    1 << n for n in (0, 1, 3, 5, 6, 7, 8, 9, 10, 11, 12, 13, 15)
)
ITERREN, ITEVTEN, ITBUFEN, DMAEN, LAST = (1 << n for n in (8, 9, 10, 11, 12))
SB, ADDR, BTF, ADD10, STOPF, RXNE, TXE, BERR, ARLO, AF, OVR, PECERR, TIMEOUT, SMBALERT = (
    1 << n for n in (0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 14, 15)
)
MSL, BUSY, TRA, GENCALL, DUALF = (1 << n for n in (0, 1, 2, 4, 7))
#: 8 MHz and CCR = 40: 100 kHz; a byte has nine bits, the last of which acknowledges.
BIT_NS, DATA_NS, BYTE_NS = 10_000, 80_000, 90_000
QUICK = settings(max_examples=40)
Chips = Callable[[], Any]


class Echo:
    """A part that acknowledges one address and as many bytes as it is told, and sends 1, 2, 3 and so on."""

    def __init__(self, address: int = 0x50, room: int = 1000) -> None:
        self.address, self.room = address, room
        self.log: list[tuple[Any, ...]] = []
        self.next = 1

    def start(self, address: int, is_read: bool, at_ns: int) -> bool:
        self.log.append(("start", address, is_read, at_ns))
        return address == self.address

    def write(self, byte: int, at_ns: int) -> bool:
        self.log.append(("write", byte, at_ns))
        self.room -= 1
        return self.room >= 0

    def read(self, at_ns: int) -> int:
        self.log.append(("read", at_ns))
        self.next += 1
        return self.next - 1

    def stop(self, at_ns: int) -> None:
        self.log.append(("stop", at_ns))

    @property
    def words(self) -> list[Any]:
        return [row[1] if row[0] == "write" else row[0] for row in self.log]


def set_up(chip: Any, control: int = 0, device: Any = None, ccr: int = 40) -> Any:
    """I2C1 on PB6 and PB7, on; returns what hangs on it."""
    chip.write("GPIOB.CRL", 0xDD44_4444)
    part = Echo() if device is None else device
    chip.parts.by_name["I2C1"].attach(part)
    chip.write("I2C1.CR2", 8)
    chip.write("I2C1.CCR", ccr)
    chip.write("I2C1.CR1", PE | control)
    return part


def sr1(chip: Any) -> int:
    return int(chip.parts.by_name["I2C1"].words[5])


def sr2(chip: Any) -> int:
    return int(chip.parts.by_name["I2C1"].words[6])


def control(chip: Any, **bits: int) -> None:
    """Set and clear bits of CR1."""
    chip.write("I2C1.CR1", (chip.read("I2C1.CR1") | bits.get("on", 0)) & ~bits.get("off", 0))


def wait(chip: Any, span_ns: int) -> None:
    chip.advance(chip.now_ns + span_ns)


def start(chip: Any, address_byte: int) -> None:
    """START and address, up to where ADDR or AF is set."""
    control(chip, on=START)
    wait(chip, BIT_NS)
    assert chip.read("I2C1.SR1") & SB
    chip.write("I2C1.DR", address_byte)
    wait(chip, BYTE_NS)


def clear_addr(chip: Any) -> int:
    chip.read("I2C1.SR1")
    return int(chip.read("I2C1.SR2"))


def test_a_start_and_an_address_take_their_bits(fake_chip: Any) -> None:
    part = set_up(fake_chip)
    start_ns = fake_chip.now_ns
    control(fake_chip, on=START)
    fake_chip.advance(start_ns + BIT_NS - 1)
    assert (sr1(fake_chip), sr2(fake_chip)) == (0, 0)
    fake_chip.advance(start_ns + BIT_NS)
    assert (sr1(fake_chip), sr2(fake_chip) & 7) == (SB, MSL | BUSY)
    assert not fake_chip.read("I2C1.CR1") & START
    wait(fake_chip, 12_345)  # SCL is held low meanwhile
    fake_chip.read("I2C1.SR1")
    fake_chip.write("I2C1.DR", 0xA0)
    written_ns = fake_chip.now_ns
    assert not sr1(fake_chip) & SB
    fake_chip.advance(written_ns + DATA_NS - 1)
    assert part.log == []
    fake_chip.advance(written_ns + BYTE_NS - 1)
    assert sr1(fake_chip) == 0
    fake_chip.advance(written_ns + BYTE_NS)
    assert (sr1(fake_chip), sr2(fake_chip) & 7) == (ADDR | TXE, MSL | BUSY | TRA)
    assert part.log == [("start", 0x50, False, written_ns + DATA_NS)]


@pytest.mark.parametrize(("ccr", "ticks"), [(40, 80), (4, 8), (1 << 15 | 10, 30), (3 << 14 | 2, 50), (0xFFF, 8190)])
def test_ccr_fs_and_duty_make_a_bit(fake_chip: Any, ccr: int, ticks: int) -> None:
    set_up(fake_chip, ccr=ccr)
    start_ns = fake_chip.now_ns
    control(fake_chip, on=START)
    fake_chip.advance(start_ns + ticks * 125 - 1)
    assert not sr1(fake_chip) & SB
    fake_chip.advance(start_ns + ticks * 125)
    assert sr1(fake_chip) & SB


def test_an_address_needs_sr1_to_be_read_with_sb(fake_chip: Any) -> None:
    set_up(fake_chip)
    control(fake_chip, on=START)
    wait(fake_chip, BIT_NS)
    fake_chip.write("I2C1.DR", 0xA0)
    assert sr1(fake_chip) & SB
    assert "I2C1:sb" in fake_chip.warnings
    fake_chip.read("I2C1.SR1")
    fake_chip.write("I2C1.DR", 0xA0)
    assert not sr1(fake_chip) & SB


def test_addr_needs_both_status_registers_in_order(fake_chip: Any) -> None:
    set_up(fake_chip)
    start(fake_chip, 0xA0)
    fake_chip.read("I2C1.SR2")
    assert sr1(fake_chip) & ADDR, "SR1 was not read since"
    fake_chip.read("I2C1.SR1")
    assert sr1(fake_chip) & ADDR
    fake_chip.read("I2C1.SR2")
    assert sr1(fake_chip) == TXE


def test_nobody_at_an_address_is_an_acknowledge_failure_that_zero_clears(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.write("I2C1.CR2", 8 | ITERREN)
    start(fake_chip, 0xA2)
    assert sr1(fake_chip) == AF
    assert fake_chip.irqs[32]
    fake_chip.write("I2C1.SR1", 0xFFFF & ~AF)
    assert sr1(fake_chip) == 0
    assert not fake_chip.irqs[32]
    control(fake_chip, on=STOP)
    wait(fake_chip, BIT_NS - 1)
    assert sr2(fake_chip) & MSL
    wait(fake_chip, 1)
    assert sr2(fake_chip) & 7 == 0
    assert not fake_chip.read("I2C1.CR1") & STOP


def test_bytes_are_sent_without_a_gap_and_btf_holds_the_clock(fake_chip: Any) -> None:
    part = set_up(fake_chip)
    start(fake_chip, 0xA0)
    clear_addr(fake_chip)
    wait(fake_chip, 5_000)
    assert sr1(fake_chip) == TXE, "nothing was sent yet: no BTF"
    begun_ns = fake_chip.now_ns
    fake_chip.write("I2C1.DR", 0x11)
    assert sr1(fake_chip) & TXE, "the shift register was free"
    fake_chip.write("I2C1.DR", 0x22)
    assert not sr1(fake_chip) & TXE
    fake_chip.advance(begun_ns + BYTE_NS - 1)
    assert not sr1(fake_chip) & TXE
    fake_chip.advance(begun_ns + BYTE_NS)
    assert sr1(fake_chip) == TXE
    fake_chip.advance(begun_ns + 2 * BYTE_NS - 1)
    assert sr1(fake_chip) == TXE
    fake_chip.advance(begun_ns + 2 * BYTE_NS)
    assert sr1(fake_chip) == TXE | BTF
    wait(fake_chip, 10**6)
    fake_chip.write("I2C1.DR", 0x33)
    assert sr1(fake_chip) == TXE
    wait(fake_chip, BYTE_NS)
    assert [row for row in part.log if row[0] == "write"][:2] == [
        ("write", 0x11, begun_ns + DATA_NS), ("write", 0x22, begun_ns + BYTE_NS + DATA_NS),
    ]  # fmt: skip
    control(fake_chip, on=STOP)
    wait(fake_chip, BIT_NS)
    assert part.words == ["start", 0x11, 0x22, 0x33, "stop"]
    assert sr1(fake_chip) & (TXE | BTF) == 0


def test_a_byte_that_is_refused_ends_the_sending(fake_chip: Any) -> None:
    set_up(fake_chip, device=Echo(room=1))
    start(fake_chip, 0xA0)
    clear_addr(fake_chip)
    fake_chip.write("I2C1.DR", 1)
    fake_chip.write("I2C1.DR", 2)
    wait(fake_chip, 2 * BYTE_NS)
    assert sr1(fake_chip) == AF


@pytest.mark.parametrize("is_ack_first", [True, False])
def test_two_bytes_are_received_by_pos_ack_btf_stop(fake_chip: Any, is_ack_first: bool) -> None:
    """RM0008 26.3.3; the libraries differ in whether ACK falls before or after ADDR is cleared."""
    part = set_up(fake_chip, ACK)
    control(fake_chip, on=POS)
    start(fake_chip, 0xA1)
    if is_ack_first:
        control(fake_chip, off=ACK)
    clear_addr(fake_chip)
    if not is_ack_first:
        control(fake_chip, off=ACK)
    wait(fake_chip, BYTE_NS)
    assert sr1(fake_chip) == RXNE
    wait(fake_chip, BYTE_NS)
    assert sr1(fake_chip) == RXNE | BTF
    wait(fake_chip, 10**6)
    assert part.words == ["start", "read", "read"], "SCL is held"
    control(fake_chip, on=STOP)
    assert [fake_chip.read("I2C1.DR"), fake_chip.read("I2C1.DR")] == [1, 2]
    wait(fake_chip, BIT_NS)
    assert part.words == ["start", "read", "read", "stop"]
    assert (sr1(fake_chip), sr2(fake_chip) & 7) == (0, 0)


@QUICK
@given(st.integers(1, 9))
def test_so_many_bytes_are_received_as_the_manual_says(make_fake_chip: Chips, count: int) -> None:
    """RM0008 26.3.3, a byte at a time: ACK and STOP behind the last but one."""
    chip = make_fake_chip()
    part = set_up(chip, ACK)
    start(chip, 0xA1)
    if count == 1:
        control(chip, off=ACK)
    clear_addr(chip)
    if count == 1:
        control(chip, on=STOP)
    got = []
    for number in range(count):
        wait(chip, BYTE_NS)
        assert chip.read("I2C1.SR1") & RXNE
        if number == count - 2:
            control(chip, off=ACK, on=STOP)
        got.append(chip.read("I2C1.DR"))
    wait(chip, BIT_NS)
    assert got == list(range(1, count + 1))
    assert part.words == ["start", *["read"] * count, "stop"]


def test_reception_waits_for_room_and_goes_on_when_dr_is_read(fake_chip: Any) -> None:
    part = set_up(fake_chip, ACK)
    start(fake_chip, 0xA1)
    clear_addr(fake_chip)
    wait(fake_chip, 10 * BYTE_NS)
    assert part.words == ["start", "read", "read"]
    assert fake_chip.read("I2C1.SR1") == RXNE | BTF
    read_ns = fake_chip.now_ns
    assert fake_chip.read("I2C1.DR") == 1
    assert part.log[3:] == [("read", read_ns)]
    assert sr1(fake_chip) == RXNE
    fake_chip.advance(read_ns + BYTE_NS - 1)
    assert sr1(fake_chip) == RXNE
    fake_chip.advance(read_ns + BYTE_NS)
    assert sr1(fake_chip) == RXNE | BTF


def test_a_repeated_start_turns_the_bus_round(fake_chip: Any) -> None:
    part = set_up(fake_chip, ACK)
    start(fake_chip, 0xA0)
    clear_addr(fake_chip)
    fake_chip.write("I2C1.DR", 7)
    wait(fake_chip, BYTE_NS)
    start(fake_chip, 0xA1)
    assert (sr1(fake_chip) & ADDR, sr2(fake_chip) & 7) == (ADDR, MSL | BUSY)
    assert part.words == ["start", 7, "start"]


@pytest.mark.parametrize(("condition", "after"), [(START, SB), (STOP, 0)])
def test_a_condition_asked_for_while_the_last_byte_goes_out_leaves_btf_until_it_has_ended(
    fake_chip: Any, condition: int, after: int
) -> None:
    set_up(fake_chip)
    start(fake_chip, 0xA0)
    clear_addr(fake_chip)
    begun_ns = fake_chip.now_ns
    fake_chip.write("I2C1.DR", 7)
    control(fake_chip, on=condition)
    seen = []
    for at_ns in (BYTE_NS - 1, BYTE_NS, BYTE_NS + BIT_NS - 1, BYTE_NS + BIT_NS):
        fake_chip.advance(begun_ns + at_ns)
        seen.append(sr1(fake_chip))
    assert seen == [TXE, TXE | BTF, TXE | BTF, after]


def test_a_stop_with_a_byte_still_in_dr_sets_no_btf(fake_chip: Any) -> None:
    set_up(fake_chip)
    start(fake_chip, 0xA0)
    clear_addr(fake_chip)
    begun_ns = fake_chip.now_ns
    fake_chip.write("I2C1.DR", 7)
    fake_chip.write("I2C1.DR", 8)
    control(fake_chip, on=STOP)
    fake_chip.advance(begun_ns + BYTE_NS)
    assert not sr1(fake_chip) & BTF


def test_a_ten_bit_address_is_two_bytes_and_a_header_to_read(fake_chip: Any) -> None:
    part = set_up(fake_chip, ACK, Echo(0x2A5))
    start(fake_chip, 0xF4)
    assert sr1(fake_chip) == ADD10
    fake_chip.read("I2C1.SR1")
    fake_chip.write("I2C1.DR", 0xA5)
    wait(fake_chip, BYTE_NS)
    assert (sr1(fake_chip), sr2(fake_chip) & TRA) == (ADDR | TXE, TRA)
    clear_addr(fake_chip)
    start(fake_chip, 0xF5)
    assert (sr1(fake_chip), sr2(fake_chip) & TRA) == (ADDR, 0)
    assert [row[:3] for row in part.log] == [("start", 0x2A5, False), ("start", 0x2A5, True)]


def test_interrupts_are_enabled_in_two_steps(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.write("I2C1.CR2", 8 | ITEVTEN)
    start(fake_chip, 0xA0)
    assert fake_chip.irqs[31]
    clear_addr(fake_chip)
    assert not fake_chip.irqs[31], "TXE needs ITBUFEN too"
    fake_chip.write("I2C1.CR2", 8 | ITEVTEN | ITBUFEN)
    assert fake_chip.irqs[31]
    fake_chip.write("I2C1.CR2", 8 | ITBUFEN)
    assert not fake_chip.irqs[31]


def pec_of(data: bytes) -> int:
    """SMBus's CRC-8 by division."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1) ^ 0x107 if crc & 0x80 else crc << 1
    return crc


@QUICK
@given(st.binary(min_size=1, max_size=5))
def test_the_pec_is_that_of_address_and_bytes_and_is_sent_last(make_fake_chip: Chips, data: bytes) -> None:
    chip = make_fake_chip()
    part = set_up(chip, ENPEC)
    start(chip, 0xA0)
    clear_addr(chip)
    for number, byte in enumerate(data):
        chip.write("I2C1.DR", byte)
        if number == len(data) - 1:
            control(chip, on=PEC)
        wait(chip, BYTE_NS)
    expected = pec_of(b"\xa0" + data)
    wait(chip, BYTE_NS)
    assert part.words == ["start", *data, expected]
    assert not chip.read("I2C1.CR1") & PEC
    assert sr2(chip) >> 8 == 0, "the PEC of a message with its PEC is 0"


@pytest.mark.parametrize("is_right", [True, False])
def test_a_received_pec_is_compared(fake_chip: Any, is_right: bool) -> None:
    part = set_up(fake_chip, ENPEC | ACK)
    start(fake_chip, 0xA1)
    clear_addr(fake_chip)
    part.next = pec_of(b"\xa1\x01") ^ (not is_right)
    wait(fake_chip, BYTE_NS)
    assert fake_chip.read("I2C1.DR") == 1
    control(fake_chip, on=PEC)
    wait(fake_chip, BYTE_NS)
    assert bool(sr1(fake_chip) & PECERR) is not is_right
    wait(fake_chip, 3 * BYTE_NS)
    assert part.words.count("read") == 2, "it is the last byte"


# Errors and the bus outside.


def test_lost_arbitration_makes_it_a_slave_and_the_bus_is_free_a_byte_later(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.parts.by_name["I2C1"].lose_arbitration()
    start(fake_chip, 0xA0)
    assert (sr1(fake_chip), sr2(fake_chip) & 7) == (ARLO, BUSY)
    control(fake_chip, on=START)
    wait(fake_chip, BYTE_NS - 1)
    assert sr2(fake_chip) & BUSY
    wait(fake_chip, 1)
    assert not sr2(fake_chip) & BUSY
    wait(fake_chip, BIT_NS)
    assert sr1(fake_chip) & SB, "the START that waited comes"
    fake_chip.write("I2C1.SR1", 0xFFFF & ~ARLO)
    assert not sr1(fake_chip) & ARLO


def test_sda_pulled_low_from_outside_loses_the_arbitration(fake_chip: Any) -> None:
    set_up(fake_chip)
    control(fake_chip, on=START)
    wait(fake_chip, BIT_NS)
    fake_chip.read("I2C1.SR1")
    fake_chip.write("I2C1.DR", 0xA0)
    fake_chip.pins["PB7"].drive(0)
    wait(fake_chip, BYTE_NS)
    assert sr1(fake_chip) == ARLO


def test_a_bus_error_is_reported_and_cleared_by_zero(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.write("I2C1.CR2", 8 | ITERREN)
    fake_chip.parts.by_name["I2C1"].disturb()
    assert sr1(fake_chip) == BERR
    assert fake_chip.irqs[32]
    fake_chip.write("I2C1.SR1", 0xFFFF & ~BERR)
    assert not fake_chip.irqs[32]


def test_scl_held_from_outside_stretches_the_byte(fake_chip: Any) -> None:
    set_up(fake_chip)
    control(fake_chip, on=START)
    wait(fake_chip, BIT_NS)
    fake_chip.read("I2C1.SR1")
    fake_chip.write("I2C1.DR", 0xA0)
    wait(fake_chip, BYTE_NS // 2)
    fake_chip.pins["PB6"].drive(0)
    wait(fake_chip, BYTE_NS)
    assert sr1(fake_chip) == 0
    fake_chip.pins["PB6"].drive(None)
    wait(fake_chip, 0)
    assert sr1(fake_chip) == ADDR | TXE


def test_scl_held_for_25_ms_is_an_smbus_timeout(fake_chip: Any) -> None:
    set_up(fake_chip, SMBUS)
    start(fake_chip, 0xA0)
    fake_chip.pins["PB6"].drive(0)
    wait(fake_chip, 24_999_999)
    assert not sr1(fake_chip) & TIMEOUT
    wait(fake_chip, 1)
    assert sr1(fake_chip) & TIMEOUT
    assert not sr2(fake_chip) & MSL


def test_busy_sticks_after_a_disturbance_without_a_stop_until_swrst(fake_chip: Any) -> None:
    """What the errata sheet describes: a driver has to reset the peripheral, or to make a STOP by hand."""
    set_up(fake_chip)
    fake_chip.pins["PB6"].drive(0)
    assert sr2(fake_chip) & BUSY
    fake_chip.pins["PB6"].drive(None)
    assert sr2(fake_chip) & BUSY
    control(fake_chip, on=START)
    wait(fake_chip, 10**7)
    assert not sr1(fake_chip) & SB, "a START waits for ever"
    fake_chip.write("I2C1.CR1", SWRST)
    fake_chip.write("I2C1.CR1", 0)
    assert (sr2(fake_chip), fake_chip.read("I2C1.CCR"), fake_chip.read("I2C1.TRISE")) == (0, 0, 2)
    fake_chip.write("I2C1.CCR", 40)
    fake_chip.write("I2C1.CR1", PE | START)
    wait(fake_chip, BIT_NS)
    assert sr1(fake_chip) & SB


@pytest.mark.parametrize("flag", [1 << n for n in (0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 14, 15)])
@pytest.mark.parametrize("enabled", [0, ITERREN, ITEVTEN, ITBUFEN, ITEVTEN | ITBUFEN])
def test_each_flag_has_its_vector_and_its_enable(fake_chip: Any, flag: int, enabled: int) -> None:
    """RM0008 26.4, table of the interrupt requests."""
    set_up(fake_chip)
    fake_chip.parts.by_name["I2C1"].words[5] = flag
    fake_chip.write("I2C1.CR2", 8 | enabled)
    is_error, is_buffer = flag >= BERR, flag in {RXNE, TXE}
    is_event = not is_error and enabled & ITEVTEN and (not is_buffer or enabled & ITBUFEN)
    assert (fake_chip.irqs[31], fake_chip.irqs[32]) == (bool(is_event), bool(is_error and enabled & ITERREN))


@pytest.mark.parametrize(("address", "flags"), [(0xA0, MSL | BUSY | TRA), (0xA1, MSL | BUSY)])
def test_sr2_of_a_master_says_its_direction_and_nothing_else(fake_chip: Any, address: int, flags: int) -> None:
    set_up(fake_chip, ACK)
    start(fake_chip, address)
    assert sr2(fake_chip) == flags
    assert clear_addr(fake_chip) == flags
    if flags & TRA:
        start(fake_chip, 0xA1)
        assert sr2(fake_chip) == MSL | BUSY, "a repeated START turns it round"


@pytest.mark.parametrize("pin", ["PB6", "PB7"])
def test_a_line_that_is_low_as_pe_is_set_makes_the_bus_busy_and_pe_alone_does_not_free_it(
    fake_chip: Any, pin: str
) -> None:
    set_up(fake_chip)
    control(fake_chip, off=PE)
    fake_chip.pins[pin].drive(0)
    assert sr2(fake_chip) == 0, "nobody listens"
    control(fake_chip, on=PE)
    assert sr2(fake_chip) == BUSY
    control(fake_chip, off=PE)
    assert sr2(fake_chip) == BUSY
    fake_chip.write("I2C1.CR1", SWRST)
    assert sr2(fake_chip) == 0


@pytest.mark.parametrize("read_bytes", [0, 1])
def test_txe_comes_with_addr_to_a_slave_that_is_read_and_to_no_other(fake_chip: Any, read_bytes: int) -> None:
    part = slave(fake_chip)
    part.call(0x30, b"" if read_bytes else b"\x01", read_bytes)
    wait(fake_chip, 2 * BYTE_NS)
    assert (sr1(fake_chip), sr2(fake_chip)) == ((ADDR | TXE, BUSY | TRA) if read_bytes else (ADDR, BUSY))


def test_a_transfer_that_is_cut_off_ends_for_the_part_and_silence_is_none(fake_chip: Any) -> None:
    part = set_up(fake_chip)
    control(fake_chip, off=PE)
    assert part.log == [], "nothing was under way"
    control(fake_chip, on=PE)
    start(fake_chip, 0xA0)
    clear_addr(fake_chip)
    fake_chip.write("I2C1.DR", 7)
    wait(fake_chip, BIT_NS)
    control(fake_chip, off=PE)
    assert part.words == ["start", "stop"]


def test_a_stop_condition_of_others_frees_the_bus(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.pins["PB7"].drive(0)
    assert sr2(fake_chip) & BUSY
    control(fake_chip, on=START)
    wait(fake_chip, 10**6)
    assert not sr1(fake_chip) & SB
    fake_chip.pins["PB7"].drive(None)
    assert not sr2(fake_chip) & BUSY
    wait(fake_chip, BIT_NS)
    assert sr1(fake_chip) & SB


def test_smba_low_is_an_alert_of_a_host_and_alert_pulls_it(fake_chip: Any) -> None:
    fake_chip.write("GPIOB.CRL", 0x4484_4444)
    fake_chip.pins["PB5"].drive(1)
    set_up(fake_chip, SMBUS | SMBTYPE)
    fake_chip.pins["PB5"].drive(0)
    assert sr1(fake_chip) == SMBALERT
    fake_chip.pins["PB5"].drive(None)
    fake_chip.write("GPIOB.CRL", 0xDDD4_4444)
    control(fake_chip, on=ALERT)
    assert fake_chip.pins["PB5"].output.level is False


def test_pins_that_are_not_on_the_bus_are_warned_of(fake_chip: Any) -> None:
    part = set_up(fake_chip)
    fake_chip.write("GPIOB.CRL", 0x4444_4444)
    start(fake_chip, 0xA0)
    assert sr1(fake_chip) == AF
    assert part.log == []
    assert "PB6" in fake_chip.warnings["I2C1:pins"]


def test_the_remap_moves_it_to_pb8_and_pb9(fake_chip: Any) -> None:
    part = set_up(fake_chip)
    fake_chip.write("AFIO.MAPR", 2)
    fake_chip.write("GPIOB.CRH", 0x4444_44DD)
    start(fake_chip, 0xA0)
    assert part.words == ["start"]
    assert fake_chip.pins["PB8"].level


# The chip as a slave.


def slave(chip: Any, control_bits: int = 0, own: int = 0x30 << 1, dual: int = 0) -> Any:
    set_up(chip)
    chip.write("I2C1.OAR1", own)
    chip.write("I2C1.OAR2", dual)
    chip.write("I2C1.CR1", PE | ACK | control_bits)
    return chip.parts.by_name["I2C1"]


def test_txe_comes_with_a_transmitters_addr_and_a_byte_written_before_it_is_cleared_counts(fake_chip: Any) -> None:
    """ST's libraries wait for both at once: events 0x70082 (master) and 0x60082 (slave)."""
    part = set_up(fake_chip)
    start(fake_chip, 0xA0)
    assert (sr2(fake_chip) << 16 | sr1(fake_chip)) == 0x70082
    fake_chip.write("I2C1.DR", 0x17)
    assert sr1(fake_chip) == ADDR
    clear_addr(fake_chip)
    wait(fake_chip, BYTE_NS)
    assert part.words[1:] == [0x17]
    start(fake_chip, 0xA1)
    assert (sr2(fake_chip) << 16 | sr1(fake_chip)) == 0x30002, "a receiver has nothing to send"


def test_txe_comes_with_the_addr_of_a_slave_that_is_read(fake_chip: Any) -> None:
    slave(fake_chip).call(0x30, read_bytes=1)
    wait(fake_chip, 10 * BIT_NS)
    assert (sr2(fake_chip) << 16 | sr1(fake_chip)) == 0x60082


def test_a_slave_receives_what_is_written_and_stopf_ends_it(fake_chip: Any) -> None:
    part = slave(fake_chip)
    begun_ns = fake_chip.now_ns
    part.call(0x30, b"\x0a\x0b", hz=100_000)
    fake_chip.advance(begun_ns + 10 * BIT_NS - 1)
    assert not sr1(fake_chip) & ADDR
    fake_chip.advance(begun_ns + 10 * BIT_NS)
    assert (sr1(fake_chip), sr2(fake_chip) & 7) == (ADDR, BUSY)
    wait(fake_chip, 10**6)
    assert sr1(fake_chip) == ADDR, "SCL is held"
    clear_addr(fake_chip)
    wait(fake_chip, BYTE_NS)
    assert sr1(fake_chip) == RXNE
    wait(fake_chip, BYTE_NS)
    assert sr1(fake_chip) == RXNE | BTF
    assert (fake_chip.read("I2C1.DR"), fake_chip.read("I2C1.DR")) == (0x0A, 0x0B)
    wait(fake_chip, BIT_NS)
    assert (sr1(fake_chip), sr2(fake_chip) & BUSY) == (STOPF, 0)
    fake_chip.write("I2C1.CR1", PE | ACK)
    assert sr1(fake_chip) == STOPF, "SR1 was not read"
    fake_chip.read("I2C1.SR1")
    fake_chip.write("I2C1.CR1", PE | ACK)
    assert sr1(fake_chip) == 0
    assert part.answered[0].acknowledged == 3


def test_each_master_outside_has_its_own_clock(fake_chip: Any) -> None:
    part = slave(fake_chip)
    fake_chip.write("I2C1.CR1", PE)  # no address of its own is acknowledged: nobody stretches
    begun_ns, symbols = fake_chip.now_ns, []
    part.subscribe(symbols.extend)
    for hz in (100_000, 400_000, 50_000):
        part.call(0x30, b"\1", hz=hz)
    wait(fake_chip, 10**6)
    part.deliver()
    starts = [symbol.ended_ns - begun_ns for symbol in symbols if symbol.step is I2cStep.START]
    stops = [symbol.ended_ns - begun_ns for symbol in symbols if symbol.step is I2cStep.STOP]
    # START and address are ten bits, STOP is one.
    assert stops == [110_000, 110_000 + 27_500, 110_000 + 27_500 + 220_000]
    assert starts == [100_000, 110_000 + 25_000, 110_000 + 27_500 + 200_000]
    assert [call.hz for call in part.answered] == [100_000, 400_000, 50_000]


@pytest.mark.parametrize("is_heard", [True, False])
def test_who_hears_a_bus_is_no_part_of_its_snapshot(fake_chip: Any, is_heard: bool) -> None:
    """Who came after it hears on when it is put back, and who has left does not keep the chip telling."""
    set_up(fake_chip, device=Eeprom24C02())
    part, heard = fake_chip.parts.by_name["I2C1"], list[I2cSymbol]()
    end = None if is_heard else part.subscribe(heard.extend)
    saved = part.snapshot()
    if end is None:
        part.subscribe(heard.extend)
    else:
        end()
    part.restore(saved)
    start(fake_chip, 0xA0)
    assert bool(part.native.wants_words) is is_heard
    part.deliver()
    assert [symbol.step for symbol in heard] == [I2cStep.START, I2cStep.BYTE] * is_heard


def test_a_slave_sends_and_the_last_byte_is_refused(fake_chip: Any) -> None:
    part = slave(fake_chip)
    part.call(0x30, read_bytes=2)
    wait(fake_chip, 10 * BIT_NS)
    assert sr2(fake_chip) & TRA
    clear_addr(fake_chip)
    assert sr1(fake_chip) == TXE
    wait(fake_chip, 10**6)
    fake_chip.write("I2C1.DR", 0x71)
    assert sr1(fake_chip) == TXE
    wait(fake_chip, 2 * BYTE_NS)
    assert sr1(fake_chip) == TXE | BTF, "the master waits for the second byte"
    fake_chip.write("I2C1.DR", 0x72)
    wait(fake_chip, BYTE_NS)
    assert sr1(fake_chip) == AF
    wait(fake_chip, BIT_NS)
    assert sr1(fake_chip) == AF, "no STOPF behind a byte that was refused"
    assert part.answered[0].read == b"\x71\x72"


@pytest.mark.parametrize(
    ("address", "bits", "own", "dual", "flags"),
    [
        (0x30, 0, 0x60, 0, 0),
        (0x31, 0, 0x60, 0x63, DUALF),
        (0, ENGC, 0x60, 0, GENCALL),
        (0x2A5, 0, 1 << 15 | 0x2A5, 0, 0),
    ],
)
def test_every_address_of_its_own_is_reported(
    fake_chip: Any, address: int, bits: int, own: int, dual: int, flags: int
) -> None:
    part = slave(fake_chip, bits, own, dual)
    part.call(address, b"\x01")
    wait(fake_chip, 2 * BYTE_NS + BIT_NS)
    assert sr1(fake_chip) == ADDR
    assert sr2(fake_chip) & (GENCALL | DUALF) == flags
    clear_addr(fake_chip)
    wait(fake_chip, BYTE_NS)
    assert fake_chip.read("I2C1.DR") == 1
    wait(fake_chip, BIT_NS)
    assert sr2(fake_chip) & (GENCALL | DUALF) == 0


@pytest.mark.parametrize(("address", "dual"), [(0x31, 0x62), (0x32, 0x63), (0, 0), (0x2A5, 0)])
def test_other_addresses_are_not(fake_chip: Any, address: int, dual: int) -> None:
    part = slave(fake_chip, 0, 0x60, dual)
    part.call(address, b"\x01")
    wait(fake_chip, 3 * BYTE_NS)
    assert sr1(fake_chip) == 0
    assert part.answered[0].acknowledged == 0
    part.call(0x30, b"\x01")
    fake_chip.write("I2C1.CR1", PE)
    wait(fake_chip, 3 * BYTE_NS)
    assert part.answered[1].acknowledged == 0, "ACK is 0"


#: OAR1, OAR2 and an address that is one of these.
_OWN = [(0x30 << 1, 0, 0x30), (0x55 << 1, 0, 0x55), (0x30 << 1, 0x2A << 1 | 1, 0x2A), (1 << 15 | 0x2A5, 0, 0x2A5),
        (1 << 15 | 0x1DA, 0, 0x1DA)]  # fmt: skip


@pytest.mark.parametrize(("own", "dual", "address"), _OWN)
def test_each_bit_of_an_own_address_is_compared(make_fake_chip: Chips, own: int, dual: int, address: int) -> None:
    """RM0008 26.6.3 and 26.6.4; a 10-bit one answers its header too, which is two of the bits."""
    width = 10 if own >> 15 else 7
    for bit in (None, *range(width)):
        chip = make_fake_chip()
        part = slave(chip, 0, own, dual)
        called = address if bit is None else address ^ 1 << bit
        part.call(called, b"\x01")
        wait(chip, 3 * BYTE_NS)
        assert bool(sr1(chip) & ADDR) is (bit is None), bit
        if bit is not None:
            assert part.answered[0].acknowledged == (1 if width == 10 and bit < 8 else 0), bit


def test_without_stretching_a_late_slave_overruns(fake_chip: Any) -> None:
    part = slave(fake_chip, NOSTRETCH)
    part.call(0x30, b"\x01\x02\x03")
    wait(fake_chip, 10 * BIT_NS)
    clear_addr(fake_chip)
    wait(fake_chip, BYTE_NS)
    assert sr1(fake_chip) == RXNE
    wait(fake_chip, BYTE_NS)
    assert sr1(fake_chip) == RXNE | OVR
    assert fake_chip.read("I2C1.DR") == 1
    wait(fake_chip, BYTE_NS)
    assert fake_chip.read("I2C1.DR") == 3


def test_a_master_outside_waits_until_the_bus_is_free(fake_chip: Any) -> None:
    part = slave(fake_chip)
    start(fake_chip, 0xA0)
    clear_addr(fake_chip)
    part.call(0x30, b"\x01")
    wait(fake_chip, BYTE_NS)
    assert part.answered == ()
    control(fake_chip, on=STOP)
    wait(fake_chip, BIT_NS + 10 * BIT_NS)
    assert sr1(fake_chip) & ADDR


# All of it.

WRITES = st.lists(
    st.tuples(
        st.sampled_from(["CR1", "CR2", "OAR1", "OAR2", "DR", "SR1", "CCR", "TRISE", "read SR1", "read SR2", "read DR"]),
        st.integers(0, 0xFFFF),
        st.integers(0, 200_000),
    ),
    max_size=30,
)


@QUICK
@given(WRITES)
def test_whatever_is_written_flags_and_interrupts_agree(
    make_fake_chip: Chips, writes: list[tuple[str, int, int]]
) -> None:
    chip = make_fake_chip()
    set_up(chip, START)
    for name, value, span in writes:
        if name.startswith("read"):
            chip.read(f"I2C1.{name[5:]}")
        else:
            chip.write(f"I2C1.{name}", value)
        if name == "OAR1" and not chip.read("I2C1.CR1") & SWRST:
            assert chip.read("I2C1.OAR1") == value & 0xC3FF
        wait(chip, span)
        one, two, how = sr1(chip), sr2(chip), chip.read("I2C1.CR2")
        events = one & (SB | ADDR | BTF | ADD10 | STOPF) or (one & (TXE | RXNE) and how & ITBUFEN)
        errors = one & (BERR | ARLO | AF | OVR | PECERR | TIMEOUT | SMBALERT)
        assert (chip.irqs[31], chip.irqs[32]) == (bool(how & ITEVTEN and events), bool(how & ITERREN and errors))
        assert not two & MSL or two & BUSY
        assert one & ~0xDFDF == 0
        assert not chip.read("I2C1.CR1") & SWRST or (one, two) == (0, 0)


@QUICK
@given(st.integers(0, 4 * BYTE_NS), st.binary(min_size=3, max_size=3))
def test_a_snapshot_within_a_transfer_goes_on_alike(make_fake_chip: Chips, at: int, data: bytes) -> None:
    chip = make_fake_chip()
    memory = Eeprom24C02()
    set_up(chip, device=memory)
    start(chip, 0xA0)
    clear_addr(chip)
    part = chip.parts.by_name["I2C1"]

    def go_on(steps: range) -> tuple[Any, ...]:
        begun = chip.now_ns
        for step in steps:
            if sr1(chip) & TXE:
                chip.write("I2C1.DR", data[step])
            wait(chip, BYTE_NS)
        control(chip, on=STOP)
        wait(chip, 2 * BYTE_NS)
        end = bytes(memory.memory), part.snapshot(), chip.now_ns - begun
        chip.now_ns = begun
        return end

    chip.write("I2C1.DR", 0x10)
    wait(chip, at)
    saved = part.snapshot()
    first = go_on(range(3))
    part.restore(saved)
    assert go_on(range(3)) == first
    assert data[-1] in first[0]


@pytest.mark.parametrize("span_ns", [1, (1 << 31) + 5, (1 << 32) + 7, 5 << 32])
def test_a_byte_goes_on_after_its_clock_has_stood_for_any_span(fake_chip: Any, span_ns: int) -> None:
    set_up(fake_chip)
    control(fake_chip, on=START)
    wait(fake_chip, BIT_NS // 2)
    part = fake_chip.parts.by_name["I2C1"]
    part.clock_stopped()
    wait(fake_chip, span_ns)
    part.clock_resumed(span_ns)
    wait(fake_chip, BIT_NS // 2 - 1)
    assert sr1(fake_chip) == 0
    wait(fake_chip, 1)
    assert sr1(fake_chip) == SB


def test_a_call_while_the_chip_is_master_leaves_its_transfer_alone(fake_chip: Any) -> None:
    part = set_up(fake_chip, ACK)
    fake_chip.write("I2C1.OAR1", 0x30 << 1)
    start(fake_chip, 0xA0)
    clear_addr(fake_chip)
    fake_chip.write("I2C1.DR", 7)
    wait(fake_chip, BIT_NS)
    fake_chip.parts.by_name["I2C1"].call(0x30, b"\x01")
    wait(fake_chip, BYTE_NS)
    assert (sr1(fake_chip), sr2(fake_chip)) == (TXE | BTF, MSL | BUSY | TRA)
    control(fake_chip, on=STOP)
    wait(fake_chip, BIT_NS)
    assert part.words == ["start", 7, "stop"]
    wait(fake_chip, BIT_NS + BYTE_NS)
    assert sr1(fake_chip) == ADDR
