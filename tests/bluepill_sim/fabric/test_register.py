"""Registers: what a declaration promises about every bit."""

from array import array
from collections.abc import Callable
from struct import Struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.registers import WORD, BitField, Peripheral, PeripheralMapping, Register, bits, fields_of
from bluepill_sim.peripherals.usart import Usart
from bluepill_sim.stm32f103 import PERIPHERALS

QUICK = settings(max_examples=20)

WORDS = st.integers(0, WORD)
NAMES = [name for _, name in PERIPHERALS]


@st.composite
def declarations(draw: st.DrawFn) -> Register:
    writable = draw(WORDS)
    one = draw(WORDS) & ~writable
    zero = draw(WORDS) & ~writable & ~one
    readable = draw(WORDS)
    return Register(
        name="R",
        offset=0,
        reset=draw(WORDS) & readable,
        readable=readable,
        writable=writable,
        write_one_to_clear=one,
        write_zero_to_clear=zero,
    )


def bit_after(register: Register, bit: int, previous: int, written: int) -> int:
    """The same rules, for one bit, as the manual's list of abbreviations words them."""
    mask = 1 << bit
    before, data = bool(previous & mask), bool(written & mask)
    if not register.readable & mask:
        return 0
    if register.writable & mask:
        return data
    if register.write_one_to_clear & mask:
        return before and not data
    if register.write_zero_to_clear & mask:
        return before and data
    return before


@QUICK
@given(register=declarations(), previous=WORDS, written=WORDS)
def test_each_bit_follows_its_kind(register: Register, previous: int, written: int) -> None:
    previous &= register.readable
    after = register.stored_after(previous, written)
    assert [after >> n & 1 for n in range(32)] == [bit_after(register, n, previous, written) for n in range(32)]


@QUICK
@given(register=declarations(), previous=WORDS, value=WORDS, lanes=st.sampled_from([0xFF, 0xFF00, 0xFFFF_0000, WORD]))
def test_a_write_of_some_lanes_leaves_the_other_lanes_alone(
    register: Register, previous: int, value: int, lanes: int
) -> None:
    previous &= register.readable
    after = register.stored_after(previous, register.widen(previous, value, lanes))
    whole = register.stored_after(previous, value)
    assert after == (whole & lanes) | (previous & ~lanes)


@pytest.mark.parametrize(
    "fields",
    [
        {"offset": 2},
        {"readable": 1 << 32},
        {"write_one_to_clear": 1},
        {"writable": 0, "write_one_to_clear": 1, "write_zero_to_clear": 1},
        {"readable": 0, "reset": 1},
        {"mask": 1, "triggers": 1},
        {"mask": 0, "write_zero_to_clear": 2, "triggers": 2},
        {"mask": 0, "triggers": 1 << 32},
        {"on_read": "_read"},
        {"on_read": "_read", "writable": 0, "write_one_to_clear": 1},
    ],
)
def test_a_declaration_that_contradicts_itself_is_refused(fields: dict[str, int | str]) -> None:
    with pytest.raises(ValueError, match="R"):
        Register(**{"name": "R", "offset": 0, **fields})  # type: ignore[arg-type]  # deliberately wrong


@pytest.mark.parametrize(
    ("given", "readable", "writable"),
    [
        ({}, WORD, WORD),
        ({"mask": 5}, 5, 5),
        ({"mask": 0}, 0, 0),
        ({"mask": 5, "writable": 0}, 5, 0),
        ({"readable": 5}, 5, WORD),
    ],
)
def test_a_mask_is_what_reads_and_what_is_written_unless_told_otherwise(
    given: dict[str, int], readable: int, writable: int
) -> None:
    register = Register(**{"name": "R", "offset": 0, **given})  # type: ignore[arg-type]  # numbers alone
    assert (register.readable, register.writable) == (readable, writable)


@pytest.mark.parametrize(
    ("fields", "reported"),
    [
        ("EN 0 TEN 1", "R: no field: 'EN 0 TEN 1' .hint: fields="),
        ("EN 0,TEN 1", "R: no field"),
        ("EN", "R: no field: 'EN'"),
        ("TSEL 3:5", "R: TSEL 3:5: no bits of a word"),
        ("EN 32", "R: EN 32: no bits of a word"),
        ("EN 31:0, TEN 31", "R: fields EN and TEN have bit 31 both"),
        ("TEN 4:3, EN 3:2", "R: fields TEN and EN have bit 3 both"),
        ("EN 1, EN 0", "R: two fields are called EN"),
    ],
)
def test_what_is_no_list_of_fields_is_refused_by_the_name_of_its_register(fields: str, reported: str) -> None:
    with pytest.raises(ValueError, match=reported):
        Register(name="R", offset=0, fields=fields)


def test_a_bit_that_reads_is_of_a_field() -> None:
    Register(name="R", offset=0, mask=3, fields="EN 1, TEN 0")
    with pytest.raises(ValueError, match="R: bits 0x5 read, and no field has them"):
        Register(name="R", offset=0, mask=7, fields="EN 1")


@pytest.mark.parametrize("kind", ["writable", "write_one_to_clear", "write_zero_to_clear", "triggers"])
def test_a_bit_that_takes_what_is_written_is_of_a_field(kind: str) -> None:
    bits_of: dict[str, int] = {"readable": 1, "writable": 0, kind: 2}
    with pytest.raises(ValueError, match="R: bits 0x2 take what is written, and no field has them"):
        Register(name="R", offset=0, fields="A 0", **bits_of)  # type: ignore[arg-type]  # masks alone


def test_the_bits_of_a_register_are_those_of_its_fields_in_any_order() -> None:
    one = Register(name="R", offset=0, fields="EN 0, TSEL 5:3, DMAEN 31")
    other = Register(name="R", offset=0, fields="DMAEN 31, EN 0, TSEL 5:3")
    assert one.readable == one.writable == other.readable == 0x8000_0039
    assert [field.name for field in fields_of(one.fields)] == ["DMAEN", "TSEL", "EN"]
    assert fields_of(one.fields) == fields_of(other.fields)


def test_a_field_is_accessed_as_its_bits_are() -> None:
    register = Register(
        name="R", offset=0, mask=0, readable=bits((7, 0)), writable=bits((3, 2), 9), write_one_to_clear=bits(4),
        write_zero_to_clear=bits(5, 8), triggers=bits(10), on_write="_write",
    )  # fmt: skip
    reported = {0: "r", 2: "rw", 4: "rc_w1", 5: "rc_w0", 8: "rc_w0", 9: "w", 10: "w", 11: "reserved"}
    assert {place: register.access(BitField("F", place, place)) for place in reported} == reported
    assert register.access(BitField("F", 5, 3)) == "rc_w0/rc_w1/rw"
    assert Register(name="R", offset=0, readable=0, writable=0, on_read="_read").access(BitField("F", 1, 0)) == "r"


def test_hidden_words_stand_behind_the_last_register() -> None:
    assert Usart.hidden() == {"SEEN": 7, "TDR": 8, "SHIFT": 9, "RDR": 10}
    assert [Usart.latch_of(register) for register in Usart.REGISTERS[:2]] == [7, None]
    assert Peripheral.hidden() == {}


def test_bits_reads_as_the_manual_prints() -> None:
    assert bits(0, (7, 4), 31) == 0x8000_00F1


class Toy(Peripheral):
    """One register of each kind of access."""

    STATE = ("total",)
    REGISTERS = (
        Register(name="PLAIN", offset=0x00, reset=0x1234_5678),
        Register(name="SUM", offset=0x04, readable=0, on_read="_read_sum", on_write="_write_sum"),
    )

    total = 0

    def _read_sum(self) -> int:
        return self.total

    def _write_sum(self, written: int, _previous: int) -> None:
        self.total += written


class ByteToy(Toy):
    """The same behind a bus with byte lanes."""

    HAS_BYTE_LANES = True


def toy(make: type[Toy], chip: Any) -> Toy:
    return make(chip, PeripheralMapping(name="TOY", base=0))


def test_reads_of_any_width_are_slices_of_the_word(fake_chip: Any) -> None:
    part = toy(Toy, fake_chip)
    assert [part.read(n, 1) for n in range(4)] == [0x78, 0x56, 0x34, 0x12]
    assert [part.read(n, 2) for n in (0, 2)] == [0x5678, 0x1234]
    assert part.read(0, 4) == 0x1234_5678


def test_a_narrow_write_is_duplicated_by_the_apb_bridge(fake_chip: Any) -> None:
    part = toy(Toy, fake_chip)
    part.write(1, 1, 0xAB)
    assert part.read(0, 4) == 0xABAB_ABAB
    part.write(2, 2, 0x1234)
    assert part.read(0, 4) == 0x1234_1234
    assert list(fake_chip.warnings) == ["TOY_PLAIN:narrow"]


def test_a_narrow_write_has_byte_lanes_on_the_ahb(fake_chip: Any) -> None:
    part = toy(ByteToy, fake_chip)
    part.write(1, 1, 0xAB)
    assert part.read(0, 4) == 0x1234_AB78
    assert not fake_chip.warnings


def test_hooks_see_the_write_and_answer_the_read(fake_chip: Any) -> None:
    part = toy(Toy, fake_chip)
    part.write(4, 4, 5)
    part.write(4, 4, 7)
    assert part.read(4, 4) == 12
    state = part.snapshot()
    part.write(4, 4, 1)
    part.restore(state)
    assert part.read(4, 4) == 12


def test_an_address_without_a_register_reads_0_ignores_writes_and_is_warned_of(fake_chip: Any) -> None:
    part = toy(Toy, fake_chip)
    part.write(0x10, 4, 1)
    assert part.read(0x10, 4) == 0
    assert part.read(0x3FC, 4) == 0
    assert list(fake_chip.warnings) == ["TOY+0x10", "TOY+0x3fc"]


def test_a_peripheral_without_deadlines_does_nothing_by_itself(fake_chip: Any) -> None:
    part = toy(Toy, fake_chip)
    before = part.snapshot()
    part.advance_to(10**12)
    part.clock_changed()
    assert part.due_ns is None
    assert part.snapshot() == before


# Every modelled register file.

#: Register, width and byte, a word of `KEYS` or how far the value is shifted right, the value, and how long it waits. A
#: hypothesis strategy for each of them costs more than the accesses.
ACCESS = Struct("<BBBIH")
ACCESSES = st.integers(0, 24).flatmap(
    lambda count: st.binary(min_size=count * ACCESS.size, max_size=count * ACCESS.size)
)
#: What unlocks, and what is a frequent setting.
KEYS = (0x4567_0123, 0xCDEF_89AB, 0x1_0000, 0x200C, 0x271)


def access_at_random(chip: Any, name: str, accesses: bytes) -> None:
    part = chip.parts.by_name[name]
    for number, lane, what, value, wait in ACCESS.iter_unpack(accesses):
        register = part.REGISTERS[number % len(part.REGISTERS)]
        size, byte = 1 << lane % 3, lane // 3 % 4
        word = KEYS[what % 5] if what % 2 else value >> what % 32
        part.write(register.offset + byte // size * size, size, word & ((1 << 8 * size) - 1))
        chip.advance(chip.now_ns + (wait * 46 >> 3 * (what >> 5)))  # up to 3 ms
        part.read(register.offset, 4)


def same_state(one: Any, other: Any) -> bool:
    return (one.parts.snapshot(), one.pins.snapshot(), one.clocks.snapshot()) == (
        other.parts.snapshot(), other.pins.snapshot(), other.clocks.snapshot()
    )  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
@QUICK
@given(accesses=ACCESSES)
def test_no_write_leaves_a_bit_that_does_not_read_and_reset_brings_back_every_reset_value(
    make_fake_chip: Callable[[], Any], name: str, accesses: Any
) -> None:
    chip = make_fake_chip()
    access_at_random(chip, name, accesses)
    part = chip.parts.by_name[name]
    for register in part.REGISTERS:
        stored = part.words[register.offset // 4]
        assert stored & ~register.readable == 0, register.name
        if register.on_read is None:
            assert part.read(register.offset, 4) == stored
            assert sum(part.read(register.offset + n, 1) << 8 * n for n in range(4)) == stored
    part.reset()
    assert part.due_ns is None
    for register in part.REGISTERS:
        if register.name != "IDR" and not register.name.startswith("PMA_"):  # USB's memory keeps what it has
            assert part.words[register.offset // 4] == register.reset, register.name


@pytest.mark.parametrize("name", NAMES)
def test_a_plain_register_stores_exactly_its_mask(fake_chip: Any, name: str) -> None:
    part = fake_chip.parts.by_name[name]
    plain = [register for register in part.REGISTERS if register.on_write is None]

    @QUICK
    @given(value=WORDS)
    def stores(value: int) -> None:
        for register in plain:
            before = part.read(register.offset, 4)
            part.write(register.offset, 4, value)
            assert part.read(register.offset, 4) == register.stored_after(before, value), register.name

    stores()


@pytest.mark.parametrize("name", NAMES)
def test_a_restored_peripheral_goes_on_identically(make_fake_chip: Callable[[], Any], name: str) -> None:
    """The other chip is in each example in the state that the one before has left it in."""
    other = make_fake_chip()

    @QUICK
    @given(before=ACCESSES, after=ACCESSES)
    def goes_on(before: Any, after: Any) -> None:
        chip = make_fake_chip()
        access_at_random(chip, name, before)
        other.now_ns = chip.now_ns
        other.clocks.restore(chip.clocks.snapshot())
        other.pins.restore(chip.pins.snapshot())
        other.parts.restore(chip.parts.snapshot())
        assert other.parts.snapshot() == chip.parts.snapshot()
        access_at_random(chip, name, after)
        access_at_random(other, name, after)
        assert same_state(other, chip)

    goes_on()


def test_words_stay_one_object_for_whoever_reads_them_natively(fake_chip: Any) -> None:
    part = fake_chip.parts.by_name["GPIOA"]
    words = part.words
    state = part.snapshot()
    part.reset()
    part.restore(state)
    assert part.words is words
    assert isinstance(words, array)
    assert words.itemsize == 4
