"""The timers in C against a model that ticks, on sequences of writes, reads, edges and times that hypothesis makes."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.subscriptions import EDGE, Of
from bluepill_sim.stm32f103 import line_of
from tests.bluepill_sim.peripherals.tim.tim_model import FLOATING, Model

TICK_NS = 125  # 8 MHz, after a reset
#: CH1 to CH4, CH1N to CH3N, ETR, BKIN without remap.
PINS = {
    "TIM1": ("PA8", "PA9", "PA10", "PA11", "PB13", "PB14", "PB15", "PA12", "PB12"),
    "TIM3": ("PA6", "PA7", "PB0", "PB1", "PD2"),
}
IRQS = {"TIM1": (24, 25, 26, 27), "TIM3": (29,)}
READ = (
    "CR1",
    "CR2",
    "SMCR",
    "DIER",
    "SR",
    "CCMR1",
    "CCMR2",
    "CCER",
    "CNT",
    "PSC",
    "ARR",
    "CCR1",
    "CCR2",
    "CCR3",
    "CCR4",
)
FIRST_LINE_ROW = 80


class Pair:
    """A timer of a chip without a CPU, and its model, which see the same."""

    def __init__(self, chip: Any, name: str, outputs: int) -> None:
        self.chip, self.name = chip, name
        self.part = chip.parts.by_name[name]
        self.offsets = {register.name: register.offset for register in self.part.REGISTERS}
        self.model = Model(is_advanced=name == "TIM1")
        self.pins = PINS[name]
        self.made: dict[tuple[int, int], int] = {}
        self.trgo: list[tuple[int, int]] = []
        chip.write("AFIO.MAPR", 4 << 24)
        for number, pin in enumerate(self.pins[:7] if name == "TIM1" else self.pins[:4]):
            self.configure(pin, is_output=bool(outputs >> number & 1))
        self.driven = [n for n in range(len(self.pins)) if n >= (7 if name == "TIM1" else 4) or not outputs >> n & 1]
        for number in self.driven:
            if chip.pins[self.pins[number]].is_bonded:
                chip.pins[self.pins[number]].drive(False)
        self.line = line_of(f"{name}.trgo")
        chip.pins.subscribe_pins(self.pins[: 7 if name == "TIM1" else 4], self.take, of=Of.WIRE, lines=[self.line])
        self.numbers = {chip.pins[pin].index: n for n, pin in enumerate(self.pins)}
        self.outputs = [n for n in range(7 if name == "TIM1" else 4) if outputs >> n & 1]
        self.shown = [FLOATING] * 7
        self.expected: dict[tuple[int, int], int] = {}
        chip.deliver()
        self.made.clear()

    def configure(self, pin: str, *, is_output: bool) -> None:
        """Make an alternate function of 50 MHz of a pin, or a floating input."""
        number = int(pin[2:])
        register = f"GPIO{pin[1]}.{'CRH' if number > 7 else 'CRL'}"
        at = 4 * (number % 8)
        self.chip.write(register, self.chip.read(register) & ~(15 << at) | (0xB if is_output else 4) << at)

    def take(self, rows: bytes) -> None:
        for ns, pin, _drive, wire, *_ in EDGE.iter_unpack(rows):
            if pin == FIRST_LINE_ROW + self.line:
                self.trgo.append((ns // TICK_NS, wire))
            elif self.numbers[pin] in self.outputs:
                self.made[ns, self.numbers[pin]] = wire

    def look(self) -> None:
        """Note what the model's outputs show."""
        for n in self.outputs:
            level = self.model.outputs()[n]
            key = self.model.now * TICK_NS, n
            if level != self.shown[n]:
                self.expected[key] = level
                self.shown[n] = level
            elif key in self.expected:
                self.expected[key] = level

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            self.model.tick()
            self.look()
            if self.model.now % 7 == 0:  # flags that rise without an event are seen somewhere in between
                self.chip.advance(self.model.now * TICK_NS)
                self.check()
        self.chip.advance(self.model.now * TICK_NS)
        self.check()

    def write(self, name: str, value: int) -> None:
        self.model.write(name, value)
        self.look()
        if name in self.offsets:
            self.part.write(self.offsets[name], 4, value)
        self.check()

    def read(self, name: str) -> None:
        wanted = self.model.read(name)
        if name in self.offsets:
            found = self.part.read(self.offsets[name], 4)
            assert found == wanted, f"{name} is {found:#x} and has to be {wanted:#x}"

    def drive(self, number: int, level: bool) -> None:
        pin = self.chip.pins[self.pins[number]]
        if number in self.driven and pin.is_bonded:
            which = number if self.name == "TIM1" or number < 4 else 7
            pin.drive(level)
            self.model.set_pin(which, level)
            self.look()
        self.check()

    def check(self) -> None:
        """See that they agree on what can be seen without a side effect."""
        self.chip.deliver()
        for name in ("SR", "CNT", "CR1"):
            found = self.part.look(self.offsets[name])
            wanted = self.model.r["SR"] if name == "SR" else self.model.read(name)
            assert found == wanted, f"{name} is {found:#x} and has to be {wanted:#x} at tick {self.model.now}"
        assert [self.chip.irqs[irq] for irq in IRQS[self.name]] == self.model.interrupts()
        made, expected = _changes(self.made), _changes(self.expected)
        assert made == expected, (made[-4:], expected[-4:], self.model.now * TICK_NS)
        wanted_trgo = [
            row for at, what in self.model.trgo for row in ([(at, 1), (at, 0)] if what == 2 else [(at, what)])
        ]
        assert _net(self.trgo) == _net(wanted_trgo), (self.trgo[-6:], wanted_trgo[-6:])


def _changes(rows: dict[tuple[int, int], int]) -> list[tuple[int, int, int]]:
    """Return (pin, ns, level) of what is another level than before, the last of each time."""
    last: dict[int, int] = {}
    found = []
    for (ns, pin), level in sorted(rows.items()):
        if last.get(pin, FLOATING) != level:
            found.append((pin, ns, level))
            last[pin] = level
    return found


def _net(rows: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return pulses and levels, one row a time and kind."""
    return sorted(set(rows))


small = st.integers(0, 14)
CCMR_BYTES = st.sampled_from([0x00, 0x10, 0x20, 0x30, 0x40, 0x50, 0x60, 0x68, 0x70, 0x78, 0x38, 0x18, 0xE8])
INPUT_BYTES = st.sampled_from([0x01, 0x02, 0x03, 0x05, 0x09, 0x0D, 0x11, 0x21, 0x42, 0x51])


def ccmr(bytes_of: Any) -> Any:
    return st.tuples(bytes_of, bytes_of).map(lambda pair: pair[0] | pair[1] << 8)


OUTPUT_WRITES = st.one_of(
    st.tuples(st.just("CR1"), st.integers(0, 0xFF)),
    st.tuples(st.just("CR1"), st.sampled_from([0x01, 0x11, 0x21, 0x41, 0x61, 0x81, 0xE1, 0x09, 0x05])),
    st.tuples(st.just("CCER"), st.integers(0, 0x3FFF)),
    st.tuples(st.just("CCER"), st.sampled_from([0x1111, 0x0555, 0x3555, 0x0DDD])),
    st.tuples(st.sampled_from(["CCMR1", "CCMR2"]), ccmr(CCMR_BYTES)),
    st.tuples(st.sampled_from(["CCR1", "CCR2", "CCR3", "CCR4", "CNT", "ARR"]), small),
    st.tuples(st.just("ARR"), st.integers(1, 8)),
    st.tuples(st.just("PSC"), st.integers(0, 3)),
    st.tuples(st.just("RCR"), st.integers(0, 3)),
    st.tuples(st.just("EGR"), st.integers(0, 0xFF)),
    st.tuples(st.just("EGR"), st.just(1)),
    st.tuples(st.just("SR"), st.sampled_from([0, 0xFFFE, 0xFFFD, 0xFFFF, 0x1E5E])),
    st.tuples(st.just("DIER"), st.integers(0, 0xFF)),
    st.tuples(st.just("CR2"), st.sampled_from([*range(0, 0x80, 0x10), 0x5500, 0x7F00, 0x01, 0x2A00])),
    st.tuples(st.just("CNT"), st.sampled_from([0, 0xFFFB, 0xFFFF])),
    st.tuples(st.just("BDTR"), st.sampled_from([0x8000, 0x8002, 0x8403, 0x8C00, 0x4000, 0x0400, 0x8085, 0xC0E0])),
    st.tuples(st.just("BDTR"), st.sampled_from([0x8D02, 0x8E00, 0x8303])),
)  # fmt: skip
INPUT_WRITES = st.one_of(
    st.tuples(st.sampled_from(["CCMR1", "CCMR2"]), ccmr(INPUT_BYTES)),
    st.tuples(st.just("SMCR"), st.integers(0, 7).flatmap(lambda sms: st.integers(4, 7).map(lambda ts: ts << 4 | sms))),
    st.tuples(st.just("SMCR"), st.sampled_from([0x54, 0x57, 0x55, 0x56, 3, 2, 1])),
    st.tuples(st.just("SMCR"), st.sampled_from([0x4000, 0x5000, 0xC000, 0x4100, 0x77, 0x7074])),
    st.tuples(st.just("CCER"), st.integers(0, 0xFFF).map(lambda bits: bits & 0x3333)),
    st.tuples(st.just("CR2"), st.sampled_from([0x80, 0, 5, 0x10])),
    st.tuples(st.just("CR1"), st.sampled_from([0x01, 0x101, 0x201, 0x11, 0x61])),
    st.tuples(st.just("BDTR"), st.sampled_from([0x9000, 0xB400, 0xF403, 0x8000, 0xD402])),
)  # fmt: skip
RUNS = st.tuples(st.just("run"), st.integers(1, 40))
READS = st.tuples(st.just("read"), st.sampled_from(READ))
EDGES = st.tuples(st.just("pin"), st.integers(0, 8), st.booleans())
ABOUT_OUTPUTS = st.lists(st.one_of(OUTPUT_WRITES, RUNS, READS), max_size=25)
ABOUT_INPUTS = st.lists(st.one_of(OUTPUT_WRITES, INPUT_WRITES, RUNS, EDGES, EDGES, READS), max_size=40)


#: What a program begins with: a short period, compare values around it, and everything on.
START = st.fixed_dictionaries({
    "PSC": st.sampled_from([0, 0, 1, 2]), "ARR": st.integers(1, 8), "RCR": st.sampled_from([0, 0, 1, 2]),
    "CCR1": st.integers(0, 9), "CCR2": st.integers(0, 9), "CCR3": st.integers(0, 9), "CCR4": st.integers(0, 9),
    "CCMR1": ccmr(CCMR_BYTES), "CCMR2": ccmr(CCMR_BYTES), "CCER": st.sampled_from([0x1111, 0x1555, 0x1DF7, 0]),
    "BDTR": st.sampled_from([0x8000, 0x8002, 0x8C01, 0x4400]), "EGR": st.sampled_from([1, 1, 0]),
    "SR": st.just(0), "CR1": st.sampled_from([0x01, 0x11, 0x21, 0x41, 0x61, 0x81, 0x09, 0xE1]),
}).map(lambda registers: list(registers.items()))  # fmt: skip


def play(pair: Pair, steps: list[tuple[Any, ...]]) -> None:
    for what, *more in steps:
        if what == "run":
            pair.run(*more)
        elif what == "read":
            pair.read(*more)
        elif what == "pin":
            if more[0] < len(pair.pins):
                pair.drive(*more)
        else:
            pair.write(what, *more)
    pair.run(60)


@pytest.mark.parametrize(
    "start",
    [
        {"EGR": 1, "ARR": 1, "CCMR1": 0xE800, "CCR2": 1, "CCER": 0x1555, "BDTR": 0x8002, "SR": 0, "CR1": 0x11},
        {"ARR": 1, "CCMR1": 0x3000, "CCER": 0x1555, "BDTR": 0x8002, "EGR": 1, "SR": 0, "CR1": 1},
    ],
    ids=["an edge in the tick that makes the wave", "no edge of its own yet"],
)
def test_the_dead_time_of_a_wave_s_first_edge_agrees(fake_chip: Any, start: dict[str, int]) -> None:
    play(Pair(fake_chip, "TIM1", 0x7F), [*start.items(), ("run", 30)])


def test_the_dead_time_of_a_reference_that_a_write_turns_back_agrees(fake_chip: Any) -> None:
    start = {"ARR": 2, "CCR1": 1, "CCR2": 1, "CCMR1": 0x6000, "BDTR": 0x8002, "EGR": 1, "CR1": 0x11, "CCER": 0x1111}
    # At the 30th tick the count is 1: active counting down, and not any more counting up.
    play(Pair(fake_chip, "TIM1", 0x7F), [*start.items(), ("run", 30), ("CR1", 1), ("CCER", 0x555), ("run", 30)])


#: What comes in the tick in which a counter starts again, whose prescaler stood within a count.
IN_THE_TICK_OF_A_START = {"an update event": [("EGR", 1)], "a stop and a start": [("CR1", 0), ("CR1", 1)]}


@pytest.mark.parametrize("then", IN_THE_TICK_OF_A_START.values(), ids=IN_THE_TICK_OF_A_START)
@pytest.mark.parametrize("ticks", [30, 31, 32])
def test_a_prescaler_that_starts_again_agrees(fake_chip: Any, ticks: int, then: list[tuple[str, int]]) -> None:
    start = [("PSC", 2), ("ARR", 1), ("EGR", 1), ("CR1", 1), ("run", ticks)]
    play(Pair(fake_chip, "TIM1", 0x7F), [*start, ("CR1", 0), ("run", 2), ("CR1", 1), *then])


@pytest.mark.parametrize("name", ["TIM1", "TIM3"])
@settings(max_examples=60)
@given(start=START, steps=ABOUT_OUTPUTS)
def test_outputs_agree_with_a_model_that_ticks(
    make_fake_chip: Callable[[], Any], name: str, start: list[tuple[Any, ...]], steps: list[tuple[Any, ...]]
) -> None:
    play(Pair(make_fake_chip(), name, 0x7F), [*start, ("run", 30), *steps])


@pytest.mark.parametrize("name", ["TIM1", "TIM3"])
@settings(max_examples=60)
@given(start=START, steps=ABOUT_INPUTS)
def test_inputs_agree_with_a_model_that_ticks(
    make_fake_chip: Callable[[], Any], name: str, start: list[tuple[Any, ...]], steps: list[tuple[Any, ...]]
) -> None:
    # Not CH3: XORed with CH1 and CH2 (TI1S), an output there would be an input too, which the model does not know.
    play(Pair(make_fake_chip(), name, 0x78 if name == "TIM1" else 0x08), [*start, *steps])
