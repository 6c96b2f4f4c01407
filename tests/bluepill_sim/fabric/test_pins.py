"""Pins: who drives the wire, what it reads, and who is told when."""

import itertools
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.pins import Pin, PinBank, PinDrive, PinMode
from bluepill_sim.fabric.subscriptions import EDGE, FLOATING, HIGH, LOW, Of

QUICK = settings(max_examples=40)

MODES = list(PinMode)


class Ports:
    """What a bank needs of its chip."""

    now_ns = 0
    stops = 0

    def __init__(self) -> None:
        self.warnings: dict[str, str] = {}

    def end_slice(self) -> None:
        self.stops += 1

    @property
    def access_cycle(self) -> int:
        return self.now_ns

    def warn(self, message: str, *, once: str) -> None:
        self.warnings.setdefault(once, message)


@pytest.fixture
def ports() -> Ports:
    return Ports()


@pytest.fixture
def bank(ports: Ports) -> PinBank:
    return PinBank(ports, frozenset({"PA0", "PA1", "PC13"}))


@pytest.mark.parametrize(
    ("mode", "bit", "drive"),
    [
        (PinMode.ANALOG, True, PinDrive.NONE),
        (PinMode.FLOATING, True, PinDrive.NONE),
        (PinMode.PULLED, True, PinDrive.PULL_UP),
        (PinMode.PULLED, False, PinDrive.PULL_DOWN),
        (PinMode.PUSH_PULL, True, PinDrive.HIGH),
        (PinMode.PUSH_PULL, False, PinDrive.LOW),
        (PinMode.OPEN_DRAIN, True, PinDrive.NONE),
        (PinMode.OPEN_DRAIN, False, PinDrive.LOW),
        (PinMode.ALTERNATE_PUSH_PULL, True, PinDrive.NONE),
        (PinMode.ALTERNATE_OPEN_DRAIN, False, PinDrive.NONE),
    ],
)
def test_mode_and_output_bit_decide_the_drive(bank: PinBank, mode: PinMode, bit: bool, drive: PinDrive) -> None:
    bank["PA0"].configure(mode, output_bit=bit)
    assert bank["PA0"].output is drive


@pytest.mark.parametrize(
    ("own", "outside", "level", "contended"),
    [
        (PinDrive.HIGH, None, True, False),
        (PinDrive.LOW, None, False, False),
        (PinDrive.HIGH, True, True, False),
        (PinDrive.HIGH, False, False, True),
        (PinDrive.LOW, True, False, True),
        (PinDrive.PULL_UP, None, True, False),
        (PinDrive.PULL_UP, False, False, False),
        (PinDrive.PULL_DOWN, None, False, False),
        (PinDrive.PULL_DOWN, True, True, False),
        (PinDrive.NONE, True, True, False),
        (PinDrive.NONE, False, False, False),
        (PinDrive.NONE, None, False, False),
    ],
)
def test_the_level_is_that_of_the_strongest(
    bank: PinBank, own: PinDrive, outside: bool | None, level: bool, contended: bool
) -> None:
    pin = bank["PA0"]
    pin.hold("TEST", own)
    pin.drive(outside)
    assert (pin.level, pin.is_contended, pin.driven) == (level, contended, outside)
    assert pin.is_floating is (own is PinDrive.NONE and outside is None)


def test_what_the_board_hangs_on_a_pin_is_weaker_than_the_chips_pull(bank: PinBank) -> None:
    pin = bank["PC13"]
    pin.board_pull = PinDrive.PULL_UP
    pin.drive(False)
    pin.drive(None)
    assert pin.level
    assert not pin.is_floating
    pin.configure(PinMode.PULLED, output_bit=False)
    assert not pin.level


def test_an_analog_pin_reads_low_whatever_the_wire_does(bank: PinBank) -> None:
    pin = bank["PA0"]
    pin.configure(PinMode.ANALOG, output_bit=False)
    pin.drive(True)
    assert (pin.level, pin.input) == (True, False)
    pin.configure(PinMode.FLOATING, output_bit=False)
    assert pin.input


def test_a_held_pin_ignores_its_configuration_until_released(bank: PinBank) -> None:
    pin = bank["PA0"]
    pin.hold("JTDO")
    pin.configure(PinMode.PUSH_PULL, output_bit=True)
    assert (pin.holder, pin.output, pin.input) == ("JTDO", PinDrive.NONE, False)
    assert pin.mode is PinMode.PUSH_PULL
    pin.release()
    assert (pin.holder, pin.output, pin.input) == (None, PinDrive.HIGH, True)


def test_an_alternate_function_drives_only_in_alternate_mode(bank: PinBank) -> None:
    pin = bank["PA0"]
    pin.connect("TIM2_CH1", level=True)
    assert pin.output is PinDrive.NONE
    assert not pin.carries("TIM2_CH1")
    pin.configure(PinMode.ALTERNATE_PUSH_PULL, output_bit=False)
    assert pin.output is PinDrive.HIGH
    assert pin.carries("TIM2_CH1")
    pin.connect("TIM2_CH1", level=False)
    assert pin.output is PinDrive.LOW
    pin.configure(PinMode.ALTERNATE_OPEN_DRAIN, output_bit=False)
    pin.connect("TIM2_CH1", level=True)
    assert pin.output is PinDrive.NONE
    pin.connect("I2C1_SCL", level=False)
    assert not pin.carries("TIM2_CH1")
    pin.disconnect("I2C1_SCL")
    pin.disconnect("I2C1_SCL")
    assert pin.carries("TIM2_CH1")


def test_every_change_of_the_own_drive_is_notified_once_with_its_time(bank: PinBank, ports: Ports) -> None:
    rows = bytearray()
    bank.subscribe_pins(["PA1"], rows.extend)
    pin = bank["PA1"]
    pin.configure(PinMode.PUSH_PULL, output_bit=False)
    ports.now_ns = 17
    pin.configure(PinMode.PUSH_PULL, output_bit=True)
    pin.configure(PinMode.PUSH_PULL, output_bit=True)
    pin.drive(True)
    bank.deliver()
    reported = [(at, index, list(PinDrive)[drive]) for at, index, drive, *_ in EDGE.iter_unpack(rows)]
    assert reported == [(0, 1, PinDrive.LOW), (17, 1, PinDrive.HIGH)]


def test_a_subscriber_to_the_wire_sees_what_the_outside_does(bank: PinBank, ports: Ports) -> None:
    rows = bytearray()
    subscription = bank.subscribe_pins(["PA0", "PA1"], rows.extend, of=Of.WIRE)
    bank["PA0"].drive(False)
    ports.now_ns = 5
    bank["PA0"].drive(True)
    bank["PA1"].configure(PinMode.PULLED, output_bit=True)
    bank["PA0"].drive(None)
    subscription.close()
    bank["PA0"].drive(True)
    bank.deliver()
    seen = [(at, index, wire) for at, index, _, wire, *_ in EDGE.iter_unpack(rows)]
    assert seen == [(0, 0, LOW), (5, 0, HIGH), (5, 1, HIGH), (5, 0, FLOATING)]


def test_a_resistor_yields_to_the_chips_output_and_wins_over_its_pull(bank: PinBank, ports: Ports) -> None:
    pin = bank["PA0"]
    pin.drive(True, is_weak=True)
    assert pin.level
    pin.configure(PinMode.PULLED, output_bit=False)
    assert pin.level
    pin.configure(PinMode.PUSH_PULL, output_bit=False)
    assert not pin.level
    assert not pin.is_contended
    pin.drive(True)
    assert pin.is_contended


def test_an_edge_that_ends_slices_asks_for_a_stop(bank: PinBank, ports: Ports) -> None:
    pin = bank["PA1"]
    subscription = bank.subscribe_pins(["PA1"], lambda _rows: None, ends_slice=["PA1"])
    pin.configure(PinMode.PUSH_PULL, output_bit=True)
    assert (ports.stops, bank.fabric.take_stop(), bank.fabric.take_stop()) == (1, True, False)
    pin.drive(False)
    assert ports.stops == 1
    subscription.ends_slice = frozenset()
    pin.configure(PinMode.PUSH_PULL, output_bit=False)
    assert ports.stops == 1
    subscription.ends_slice = frozenset({"PA1"})
    pin.configure(PinMode.PUSH_PULL, output_bit=True)
    assert ports.stops == 2


def test_a_pin_without_a_leg_cannot_be_driven(bank: PinBank) -> None:
    with pytest.raises(ValueError, match="PA5 is not bonded out"):
        bank["PA5"].drive(True)
    bank["PA5"].connect("MCO", level=True)
    bank["PA5"].configure(PinMode.ALTERNATE_PUSH_PULL, output_bit=True)
    assert not bank["PA5"].carries("MCO")
    with pytest.raises(KeyError):
        bank["PF0"]


def test_the_bank_goes_port_by_port(bank: PinBank) -> None:
    pins = list(bank)
    assert [pin.name for pin in (pins[0], pins[16], pins[-1])] == ["PA0", "PB0", "PE15"]
    assert bank.port("C")[13] is bank["PC13"]


ACTIONS = st.lists(
    st.one_of(
        st.tuples(st.just("drive"), st.sampled_from([True, False, None])),
        st.tuples(st.just("configure"), st.sampled_from(MODES)),
        st.tuples(st.just("bit"), st.booleans()),
        st.tuples(st.just("hold"), st.sampled_from(list(PinDrive))),
        st.tuples(st.just("release"), st.none()),
        st.tuples(st.just("connect"), st.booleans()),
        st.tuples(st.just("disconnect"), st.none()),
    ),
    max_size=20,
)


def act(pin: Pin, what: str, value: Any) -> None:
    methods: dict[str, Callable[[], None]] = {
        "drive": lambda: pin.drive(value),
        "configure": lambda: pin.configure(value, output_bit=True),
        "bit": lambda: pin.configure(pin.mode, output_bit=value),
        "hold": lambda: pin.hold("X", value),
        "release": pin.release,
        "connect": lambda: pin.connect("MCO", level=value),
        "disconnect": lambda: pin.disconnect("MCO"),
    }
    methods[what]()


@QUICK
@given(actions=ACTIONS)
def test_output_and_level_follow_from_the_state_alone(actions: Any) -> None:
    bank = PinBank(Ports(), frozenset({"PA0"}))
    rows = bytearray()
    bank.subscribe_pins(["PA0"], rows.extend)
    pin = bank["PA0"]
    for what, value in actions:
        act(pin, what, value)
    other = PinBank(Ports(), frozenset({"PA0"}))
    other.restore(bank.snapshot())
    copy = other["PA0"]
    assert (copy.output, copy.level, copy.input) == (pin.output, pin.level, pin.input)
    other.fabric.pins_changed(0)
    assert (copy.output, copy.level, copy.input) == (pin.output, pin.level, pin.input)
    bank.deliver()
    reported = [list(PinDrive)[row[2]] for row in EDGE.iter_unpack(rows)]
    assert all(a is not b for a, b in itertools.pairwise(reported))
    assert (reported[-1] if reported else PinDrive.NONE) is pin.output
