"""Single bits on SCL and SDA while somebody looks: decoded from the levels alone, they are what went over the bus."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.subscriptions import EDGE, HIGH, Of
from bluepill_sim.peripherals.i2c import I2cStep, I2cSymbol
from tests.bluepill_sim.peripherals.buses.test_i2c import (
    ACK,
    ADDR,
    AF,
    BIT_NS,
    BTF,
    PE,
    RXNE,
    START,
    STOP,
    Echo,
    clear_addr,
    control,
    set_up,
    sr1,
    wait,
)

QUICK = settings(max_examples=40)
#: "S", "P", or a byte and whether it was acknowledged.
Heard = list[str | tuple[int, bool]]


class Lines:
    """Who looks at both lines, and writes down their levels."""

    def __init__(self, chip: Any, names: tuple[str, str] = ("PB6", "PB7"), of: Of = Of.WIRE) -> None:
        self._is_scl = {chip.pins[names[0]].index: True, chip.pins[names[1]].index: False}
        self._rows: list[bytes] = []
        self.subscription = chip.pins.subscribe_pins(names, self._rows.append, of=of)

    @property
    def edges(self) -> list[tuple[int, bool, bool]]:
        """Time, whether it is SCL, whether it is high."""
        rows = EDGE.iter_unpack(b"".join(self._rows))
        return [(ns, self._is_scl[pin], wire == HIGH) for ns, pin, _, wire, _, _ in rows]


def decoded(edges: list[tuple[int, bool, bool]]) -> Heard:
    """UM10204 3.1.1 to 3.1.6: data are stable while SCL is high; a change of SDA then is a START or a STOP."""
    scl = sda = True
    heard: Heard = []
    bits: list[bool] = []
    is_going_on = False
    for _, is_scl, level in edges:
        if is_scl:
            if level and not scl and is_going_on:
                bits.append(sda)
                if len(bits) == 9:
                    byte = sum(bit << 7 - n for n, bit in enumerate(bits[:8]))
                    heard.append((byte, not bits[8]))
                    bits = []
            scl = level
        else:
            if scl and level is not sda:
                assert len(bits) <= 1, "a condition in the midst of a byte"
                heard.append("P" if level else "S")
                is_going_on, bits = not level, []
            sda = level
    assert not bits
    return heard


def as_reported(symbols: list[I2cSymbol]) -> Heard:
    return [
        "S" if row.step is I2cStep.START else "P" if row.step is I2cStep.STOP else (row.byte, row.is_acknowledged)
        for row in symbols
    ]


def transfer(chip: Any, address_byte: int, data: bytes, pause_ns: int) -> Heard:
    """Write bytes to an address, or read as many, as a program does; return what that is on the bus, up to its STOP."""
    control(chip, on=START | ACK)
    wait(chip, BIT_NS + pause_ns)
    chip.read("I2C1.SR1")
    chip.write("I2C1.DR", address_byte)
    wait(chip, 9 * BIT_NS + pause_ns)
    if sr1(chip) & AF:
        chip.write("I2C1.SR1", 0)
        return ["S", (address_byte, False)]
    heard: Heard = ["S", (address_byte, True)]
    is_read = address_byte & 1
    if is_read and len(data) == 1:
        control(chip, off=ACK)
    assert sr1(chip) & ADDR
    clear_addr(chip)
    for n, byte in enumerate(data):
        if is_read:
            wait(chip, 9 * BIT_NS + pause_ns)
            assert sr1(chip) & RXNE
            is_last, is_before = n + 1 == len(data), n + 2 == len(data)
            if is_before:
                control(chip, off=ACK)
            if is_last:
                control(chip, on=STOP)
            got = chip.read("I2C1.DR")
            heard.append((got, not is_last))
        else:
            chip.write("I2C1.DR", byte)
            wait(chip, 9 * BIT_NS + pause_ns)
            is_refused = bool(sr1(chip) & AF)
            heard.append((byte, not is_refused))
            if is_refused:
                chip.write("I2C1.SR1", 0)
                break
            assert sr1(chip) & BTF
    return heard


@QUICK
@given(
    st.lists(
        st.tuples(st.sampled_from([0xA0, 0xA1, 0x42]), st.binary(min_size=1, max_size=4), st.booleans()),
        min_size=1, max_size=4,
    ),
    st.integers(0, 6), st.sampled_from([0, 12_345]), st.sampled_from([40, 1 << 15 | 26, 3 << 14 | 3]),
)  # fmt: skip
def test_the_bits_on_scl_and_sda_are_the_conditions_bytes_and_acknowledges(
    make_fake_chip: Any, transfers: list[tuple[int, bytes, bool]], room: int, pause_ns: int, ccr: int
) -> None:
    ends = []
    for looks in (True, False):
        chip = make_fake_chip()
        reported: list[I2cSymbol] = []
        chip.parts.by_name["I2C1"].subscribe(reported.extend)
        part = set_up(chip, device=Echo(room=room), ccr=ccr)
        lines = Lines(chip) if looks else None
        expected: Heard = []
        for n, (address_byte, data, stops) in enumerate(transfers):
            # One that reads has a byte in the shift register before the program has taken the one before.
            expected += transfer(chip, address_byte, data[: 1 if address_byte & 1 else 4], pause_ns)
            is_stopped = bool(address_byte & 1) and expected[-1] != (address_byte, False)
            if (stops or n + 1 == len(transfers)) and not is_stopped:
                control(chip, on=STOP)
            if stops or is_stopped or n + 1 == len(transfers):
                expected.append("P")
                wait(chip, BIT_NS)
        chip.deliver() if hasattr(chip, "deliver") else None
        if lines is not None:
            assert {(one.byte, one.is_acknowledged) for one in reported if one.step is I2cStep.START} <= {(0, False)}
            assert decoded(lines.edges) == expected
            lines.subscription.close()
        assert as_reported(reported) == expected
        ends.append((part.log, reported, chip.now_ns, chip.pins["PB6"].level, chip.pins["PB7"].level))
    assert ends[0] == ends[1]
    assert ends[0][3:] == (True, True)


@pytest.mark.parametrize(("ccr", "low_ns", "high_ns"), [
    (40, 5_000, 5_000), (1 << 15 | 4, 1_000, 500), (3 << 14 | 2, 4_000, 2_250),
])  # fmt: skip
def test_scl_is_low_and_high_as_ccr_says_and_low_while_the_program_is_awaited(
    fake_chip: Any, ccr: int, low_ns: int, high_ns: int
) -> None:
    set_up(fake_chip, ccr=ccr)
    lines, bit_ns = Lines(fake_chip), low_ns + high_ns
    control(fake_chip, on=START)
    start_ns = fake_chip.now_ns
    wait(fake_chip, bit_ns + 777)
    assert [(ns - start_ns, *rest) for ns, *rest in lines.edges] == [(bit_ns // 2, False, False), (bit_ns, True, False)]
    fake_chip.read("I2C1.SR1")
    fake_chip.write("I2C1.DR", 0xA0)
    written_ns = fake_chip.now_ns
    wait(fake_chip, 9 * bit_ns + 5_000)
    clock = [(ns - written_ns, level) for ns, is_scl, level in lines.edges[2:] if is_scl]
    assert clock == [(n * bit_ns + at_ns, at_ns == low_ns) for n in range(9) for at_ns in (low_ns, bit_ns)]
    assert fake_chip.pins["PB6"].level is False  # ADDR holds it
    assert sr1(fake_chip) & ADDR


calls = st.tuples(st.sampled_from([0x30, 0x31]), st.binary(max_size=3), st.integers(0, 3))


@QUICK
@given(calls.filter(lambda call: bool(call[1]) or bool(call[2])))
def test_a_master_outside_is_seen_on_the_lines_too(make_fake_chip: Any, call: tuple[int, bytes, int]) -> None:
    address, written, count = call
    chip = make_fake_chip()
    chip.write("GPIOB.CRL", 0xDD44_4444)
    part = chip.parts.by_name["I2C1"]
    reported: list[I2cSymbol] = []
    part.subscribe(reported.extend)
    chip.write("I2C1.CR2", 8)
    chip.write("I2C1.OAR1", 0x30 << 1)
    chip.write("I2C1.CR1", PE | ACK)
    part._pull_up()  # as a bus has
    lines, drives = Lines(chip), Lines(chip, of=Of.DRIVE)
    part.call(address, written, count)
    for n in range(60):
        wait(chip, 33_333)
        status = chip.read("I2C1.SR1")
        if status & ADDR:
            chip.read("I2C1.SR2")
        elif status & RXNE:
            chip.read("I2C1.DR")
        elif status & 1 << 7:
            chip.write("I2C1.DR", 0x80 | n)
    chip.deliver() if hasattr(chip, "deliver") else None
    heard = decoded(lines.edges)
    assert heard == as_reported(reported)
    assert (heard[0], heard[-1]) == ("S", "P")
    answer = part.answered[0]
    assert sum(isinstance(one, tuple) and one[1] for one in heard) >= answer.acknowledged
    assert (answer.acknowledged > 0) is (address == 0x30)
    reads = [one[0] for one in heard[-1 - count : -1] if isinstance(one, tuple)] if address == 0x30 else []
    assert bytes(reads) == answer.read
    # The chip itself drives SDA for its acknowledges and its bytes, and SCL while it is awaited.
    assert any(not is_scl for _, is_scl, _ in drives.edges) is (address == 0x30)


@pytest.mark.parametrize("own", [1 << 15 | 0x2A5, 1 << 15 | 0x1DA])
def test_both_bytes_of_a_ten_bit_address_are_acknowledged_on_the_lines_where_they_are_its_own(
    make_fake_chip: Any, own: int
) -> None:
    for flipped in (0, *(1 << n for n in range(10))):
        chip = make_fake_chip()
        chip.write("GPIOB.CRL", 0xDD44_4444)
        part = chip.parts.by_name["I2C1"]
        reported: list[I2cSymbol] = []
        part.subscribe(reported.extend)
        chip.write("I2C1.CR2", 8)
        chip.write("I2C1.OAR1", own)
        chip.write("I2C1.CR1", PE | ACK)
        part._pull_up()  # as a bus has
        lines = Lines(chip)
        address = own & 0x3FF ^ flipped
        part.call(address, b"\x81")
        for _ in range(12):
            wait(chip, 33_333)
            if sr1(chip) & ADDR:
                clear_addr(chip)
            elif sr1(chip) & RXNE:
                chip.read("I2C1.DR")
        heard, is_header_own = decoded(lines.edges), flipped < 1 << 8
        assert heard == as_reported(reported)
        assert heard[:2] == ["S", (0xF0 | address >> 7 & 6, is_header_own)]
        if is_header_own:
            assert heard[2] == (address & 0xFF, flipped == 0), flipped
        if flipped == 0:
            assert heard[3:] == [(0x81, True), "P"]


def test_bits_of_an_i2c_cost_nothing_while_nobody_looks_and_end_with_who_looks(fake_chip: Any) -> None:
    set_up(fake_chip)
    native = fake_chip.parts.by_name["I2C1"].native
    control(fake_chip, on=START)
    assert native.show == 0
    wait(fake_chip, BIT_NS)
    lines = Lines(fake_chip)
    fake_chip.read("I2C1.SR1")
    fake_chip.write("I2C1.DR", 0xA0)
    assert native.show == 2
    wait(fake_chip, 20_000)
    lines.subscription.close()
    wait(fake_chip, 70_000)
    clear_addr(fake_chip)
    fake_chip.write("I2C1.DR", 0)
    assert native.show == 0
    assert (fake_chip.pins["PB6"].level, fake_chip.pins["PB7"].level) == (True, True)


@pytest.mark.parametrize("at_ns", range(1_000, 90_000, 7_500))
def test_who_really_holds_a_line_is_felt_whether_or_not_bits_are_shown(make_fake_chip: Any, at_ns: int) -> None:
    found = []
    for looks in (False, True):
        chip = make_fake_chip()
        part = set_up(chip)
        lines = Lines(chip) if looks else None
        control(chip, on=START)
        wait(chip, BIT_NS)
        chip.read("I2C1.SR1")
        chip.write("I2C1.DR", 0xA0)
        begun_ns = chip.now_ns
        chip.advance(begun_ns + at_ns)
        chip.pins["PB6"].drive(False)
        chip.advance(begun_ns + 123_000)
        assert not sr1(chip) & ADDR
        chip.pins["PB6"].drive(None)
        chip.advance(begun_ns + 123_000)
        assert sr1(chip) & ADDR
        chip.write("I2C1.CR1", 0)
        found.append((part.log, sr1(chip), chip.pins["PB6"].level, chip.pins["PB7"].level))
        del lines
    assert found[0] == found[1]
    assert found[0][2:] == (True, True)


def test_an_i2c_that_is_reset_in_the_midst_of_a_byte_lets_go_of_both_lines(fake_chip: Any) -> None:
    set_up(fake_chip)
    lines = Lines(fake_chip)
    control(fake_chip, on=START)
    wait(fake_chip, BIT_NS)
    fake_chip.read("I2C1.SR1")
    fake_chip.write("I2C1.DR", 0x00)
    wait(fake_chip, 22_000)
    assert (fake_chip.pins["PB6"].level, fake_chip.pins["PB7"].level) == (False, False)
    fake_chip.write("I2C1.CR1", 1 << 15)
    assert (fake_chip.pins["PB6"].level, fake_chip.pins["PB7"].level) == (True, True)
    wait(fake_chip, 1)
    assert [level for _, _, level in lines.edges[-2:]] == [True, True]
