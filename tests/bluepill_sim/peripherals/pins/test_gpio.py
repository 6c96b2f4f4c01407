"""GPIO: modes, data registers, and the lock."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule, run_state_machine_as_test

from bluepill_sim.fabric.pins import PinDrive, PinMode
from bluepill_sim.fabric.subscriptions import EDGE, HIGH, LOW

QUICK = settings(max_examples=40)

LCKK = 1 << 16
WORDS = st.integers(0, 0xFFFF_FFFF)
HALFWORDS = st.integers(0, 0xFFFF)

#: Without the pins of the debug port, whose pulls show.
PARTLY = 0x1FFF


#: Mode by CNF[1:0] MODE[1:0] (RM0008 table 20); CNF = 11, MODE = 00 is reserved and taken as floating.
INPUTS = (PinMode.ANALOG, PinMode.FLOATING, PinMode.PULLED, PinMode.FLOATING)
OUTPUTS = (PinMode.PUSH_PULL, PinMode.OPEN_DRAIN, PinMode.ALTERNATE_PUSH_PULL, PinMode.ALTERNATE_OPEN_DRAIN)
PIN_MODES = tuple((OUTPUTS if nibble & 3 else INPUTS)[nibble >> 2] for nibble in range(16))


@QUICK
@given(crl=WORDS, crh=WORDS, odr=HALFWORDS)
def test_each_pin_takes_the_mode_of_its_nibble(make_fake_chip: Callable[[], Any], crl: int, crh: int, odr: int) -> None:
    chip = make_fake_chip()
    chip.write("GPIOC.ODR", odr)
    chip.write("GPIOC.CRL", crl)
    chip.write("GPIOC.CRH", crh)
    assert (chip.read("GPIOC.CRL"), chip.read("GPIOC.CRH")) == (crl, crh)
    both = crl | crh << 32
    for pin in chip.pins.port("C"):
        mode = PIN_MODES[both >> 4 * pin.number & 0xF]
        assert pin.mode is mode
        if mode is PinMode.PUSH_PULL:
            assert pin.output is (PinDrive.HIGH if odr >> pin.number & 1 else PinDrive.LOW)


@QUICK
@given(start=HALFWORDS, word=WORDS)
def test_bsrr_sets_and_resets_at_once_and_a_set_wins(make_fake_chip: Callable[[], Any], start: int, word: int) -> None:
    chip = make_fake_chip()
    chip.write("GPIOB.ODR", start)
    chip.write("GPIOB.BSRR", word)
    assert chip.read("GPIOB.ODR") == (start & ~(word >> 16)) | (word & 0xFFFF)
    assert chip.read("GPIOB.BSRR") == 0


@QUICK
@given(start=HALFWORDS, word=WORDS)
def test_brr_resets_by_its_low_half_only(make_fake_chip: Callable[[], Any], start: int, word: int) -> None:
    chip = make_fake_chip()
    chip.write("GPIOB.ODR", start)
    chip.write("GPIOB.BRR", word)
    assert chip.read("GPIOB.ODR") == start & ~word & 0xFFFF


def test_the_input_register_follows_the_wire_and_the_own_output(fake_chip: Any) -> None:
    fake_chip.pins["PA4"].drive(True)
    assert fake_chip.read("GPIOA.IDR") & PARTLY == 1 << 4
    fake_chip.write("GPIOA.CRL", 0x4444_4442)
    fake_chip.write("GPIOA.BSRR", 1)
    assert fake_chip.read("GPIOA.IDR") & PARTLY == 1 << 4 | 1
    fake_chip.pins["PA4"].drive(False)
    fake_chip.write("GPIOA.BRR", 1)
    assert fake_chip.read("GPIOA.IDR") & PARTLY == 0
    fake_chip.write("GPIOA.IDR", 0xFFFF)
    assert fake_chip.read("GPIOA.IDR") & PARTLY == 0


def test_odr_chooses_the_pull_of_an_input(fake_chip: Any) -> None:
    fake_chip.write("GPIOA.CRL", 0x4444_4448)
    assert fake_chip.pins["PA0"].output is PinDrive.PULL_DOWN
    fake_chip.write("GPIOA.ODR", 1)
    assert fake_chip.pins["PA0"].output is PinDrive.PULL_UP
    assert fake_chip.read("GPIOA.IDR") & PARTLY == 1


def test_an_edge_has_the_time_of_the_write(fake_chip: Any) -> None:
    rows = bytearray()
    fake_chip.pins.subscribe_pins(["PB6", "PB7"], rows.extend)
    fake_chip.write("GPIOB.CRL", 0x1444_4444)
    fake_chip.now_ns = 1_234_567
    fake_chip.write("GPIOB.BSRR", 0x00FF_0080)
    fake_chip.deliver()
    low, high, pb7 = 1, 2, 16 + 7
    assert [row[:4] for row in EDGE.iter_unpack(rows)] == [(0, pb7, low, LOW), (1_234_567, pb7, high, HIGH)]


def test_reset_lets_go_of_every_pin(fake_chip: Any) -> None:
    fake_chip.write("GPIOB.CRL", 0x1111_1111)
    fake_chip.write("GPIOB.ODR", 0xFFFF)
    fake_chip.pins["PB6"].drive(True)
    fake_chip.parts.by_name["GPIOB"].reset()
    assert fake_chip.pins["PB7"].output is PinDrive.NONE
    assert fake_chip.read("GPIOB.IDR") == 1 << 6 | 1 << 4  # NJTRST is pulled up


def lock(chip: Any, pins: int) -> tuple[int, int]:
    for word in (LCKK | pins, pins, LCKK | pins):
        chip.write("GPIOA.LCKR", word)
    return chip.read("GPIOA.LCKR"), chip.read("GPIOA.LCKR")


def test_the_lock_sequence_freezes_the_configuration_until_reset(fake_chip: Any) -> None:
    assert lock(fake_chip, 0b10) == (0b10, LCKK | 0b10)
    fake_chip.write("GPIOA.CRL", 0x1111_1111)
    assert fake_chip.read("GPIOA.CRL") == 0x1111_1141
    assert fake_chip.pins["PA1"].mode is PinMode.FLOATING
    assert list(fake_chip.warnings) == ["GPIOA:lock"]
    fake_chip.write("GPIOA.LCKR", 0)
    assert fake_chip.read("GPIOA.LCKR") == LCKK | 0b10
    fake_chip.parts.by_name["GPIOA"].reset()
    fake_chip.write("GPIOA.CRL", 0x1111_1111)
    assert fake_chip.read("GPIOA.CRL") == 0x1111_1111


@pytest.mark.parametrize(
    "writes",
    [
        (LCKK | 1, 1),
        (LCKK | 1, LCKK | 1, LCKK | 1),
        (LCKK | 1, 2, LCKK | 1),
        (LCKK | 1, 1, LCKK | 3),
        (1, 1, LCKK | 1),
        (LCKK | 1, 1, LCKK | 1, LCKK | 1),
    ],
)
def test_a_sequence_with_an_error_does_not_lock(fake_chip: Any, writes: tuple[int, ...]) -> None:
    for word in writes:
        fake_chip.write("GPIOA.LCKR", word)
    fake_chip.read("GPIOA.LCKR")
    assert not fake_chip.read("GPIOA.LCKR") & LCKK


@pytest.mark.parametrize(("before", "pins"), [(1, 1), (2, 1), (3, 0)])
def test_a_reset_forgets_what_was_written_of_the_sequence(fake_chip: Any, before: int, pins: int) -> None:
    writes = [LCKK | pins, pins, LCKK | pins]
    for word in writes[:before]:
        fake_chip.write("GPIOA.LCKR", word)
    fake_chip.parts.by_name["GPIOA"].reset()
    for word in writes[before:]:
        fake_chip.write("GPIOA.LCKR", word)
    fake_chip.read("GPIOA.LCKR")
    assert not fake_chip.read("GPIOA.LCKR") & LCKK


@pytest.mark.parametrize(
    ("nibble", "names", "key"), [(0b0011, ("PB3", "PB4"), "{}:held"), (0b0100, ("PB6", "PB7"), "floating:{}")]
)
def test_each_pin_that_is_held_or_floats_is_named_once_and_alone(
    fake_chip: Any, nibble: int, names: tuple[str, str], key: str
) -> None:
    fake_chip.write("GPIOB.CRL", 0x8884_4888)
    fake_chip.advance(1_000_000_000)
    fake_chip.warnings.clear()
    for chosen in (names[:1], names[1:], names):
        for name in chosen:
            at = 4 * int(name[2:])
            word = fake_chip.read("GPIOB.CRL") & ~(15 << at)
            fake_chip.write("GPIOB.CRL", word | 0b1000 << at)
            fake_chip.write("GPIOB.CRL", word | nibble << at)
        fake_chip.advance(fake_chip.now_ns + 1_000_000_000)
    assert list(fake_chip.warnings) == [key.format(name) for name in names]


class LockMachine(RuleBasedStateMachine):
    """LCKR against the manual's sentence: write 1, write 0, write 1, read, with the same pins."""

    def __init__(self, chip: Any) -> None:
        super().__init__()
        self.chip = chip
        self.writes: list[int] = []
        self.locked: int | None = None

    @rule(key=st.booleans(), pins=st.sampled_from([0, 1, 0x8001]))
    def write(self, key: bool, pins: int) -> None:
        self.chip.write("GPIOA.LCKR", key << 16 | pins)
        self.writes.append(key << 16 | pins)

    @rule()
    def read(self) -> None:
        self.chip.read("GPIOA.LCKR")
        last = self.writes[-3:]
        if self.locked is None and [word >> 16 for word in last] == [1, 0, 1] and len({w & 0xFFFF for w in last}) == 1:
            self.locked = last[0] & 0xFFFF

    @rule()
    def reset(self) -> None:
        self.chip.parts.by_name["GPIOA"].reset()
        self.writes, self.locked = [], None

    @invariant()
    def key_bit_and_freeze_agree_with_the_model(self) -> None:
        part = self.chip.parts.by_name["GPIOA"]
        assert bool(part.words[6] & LCKK) is (self.locked is not None)
        assert part.native.locked == (self.locked or 0)


def test_the_lock_agrees_with_its_sentence_for_any_history(make_fake_chip: Callable[[], Any]) -> None:
    run_state_machine_as_test(lambda: LockMachine(make_fake_chip()), settings=QUICK)
