"""A frame that nobody acknowledges: C repeats its tries, and whatever happens to them, they are those of Python."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.can_network import stuffed_bits
from bluepill_sim.fabric.subscriptions import EDGE, Of
from bluepill_sim.parts import CanFrame, CanNetwork, CanNode
from tests.bluepill_sim.peripherals.buses.test_can import (
    ABRQ,
    BIT_NS,
    ERRI,
    ERRIE,
    INRQ,
    LECIE,
    LOOP,
    NART,
    RESET,
    RQCP,
    SILENT,
    SLEEP,
    TIMING,
    TXFP,
    send,
    set_up,
)  # fmt: skip

Chips = Callable[[], Any]
Step = tuple[Any, ...]
PINS = ("PA11", "PA12", "PB8", "PB9")
FRAME = CanFrame(identifier=0x123, data=b"\x0f\xf0")
#: In bits from its start: when the network decides, the end of a try, and the start of the next by a passive sender.
DECIDED, END = 20, stuffed_bits(FRAME) + 14
PERIOD = END + 3 + 8
#: Sixteen tries leave the error counters where they stay; then some by a passive sender.
PASSIVE_BITS = 16 * (END + 3) + 5 * PERIOD
REGISTERS = ("MCR", "MSR", "TSR", "RF0R", "IER", "ESR", "BTR", "TI0R", "TI1R", "TI2R")
WITH_PIN, WITHOUT_PIN = ("GPIOA.CRH", 0x444B_4444), ("GPIOA.CRH", 0x4443_4444)
SLOWER = ("RCC.CFGR", 4 << 8)
WRITES = st.sampled_from([
    ("CAN.ESR", 0), ("CAN.ESR", 7 << 4), ("CAN.MSR", ERRI), ("CAN.IER", LECIE | ERRIE), ("CAN.IER", 0), ("CAN.BTR", 0),
    ("CAN.TDL0R", 1), ("CAN.TSR", ABRQ), ("CAN.TSR", ABRQ << 8), ("CAN.TSR", RQCP), ("CAN.MCR", 0), ("CAN.MCR", NART),
    ("CAN.MCR", TXFP), ("CAN.MCR", INRQ), ("CAN.MCR", SLEEP), ("CAN.MCR", RESET),
    WITH_PIN, WITHOUT_PIN, ("AFIO.MAPR", 0), ("AFIO.MAPR", 2 << 13), ("RCC.CFGR", 0), SLOWER,
])  # fmt: skip
#: Whole bits, and a nanosecond more or less; most about the phases of a try.
BITS = st.one_of(
    st.integers(0, 5 * PERIOD),
    st.builds(
        lambda tries, bit: tries * PERIOD + bit, st.integers(0, 4), st.sampled_from([0, 1, DECIDED, END, PERIOD - 1])
    ),
)
STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("until"), BITS, st.integers(-1, 1)),
        WRITES.map(lambda row: ("write", *row)),
        st.tuples(st.just("send"), st.integers(0, 2), st.sampled_from([0x100, 0x123, 0x200])),
        st.tuples(st.just("mode"), st.sampled_from([0, LOOP, SILENT])),
        st.tuples(st.just("stop"), st.integers(1, 300)),
        st.tuples(st.sampled_from(["restore", "hear", "leave", "join", "reset"])),
    ),
    max_size=12,
)  # fmt: skip


class Bench:
    """A chip alone that has become passive, and all that is seen of it."""

    def __init__(self, chip: Any, *, repeats: bool) -> None:
        self.chip, self.part = chip, chip.parts.by_name["CAN"]
        if not repeats:
            self.part._repeat = lambda _end: None
        self.rows = bytearray()
        self.frames: list[Any] = []
        self.node = CanNode()
        self.watch()
        chip.write("GPIOB.CRH", 0x4444_44B4)
        set_up(chip)
        self.begin_ns = chip.now_ns
        send(chip, FRAME.identifier, FRAME.data)
        chip.advance(self.begin_ns + PASSIVE_BITS * BIT_NS)

    def do(self, step: Step) -> None:
        getattr(self, step[0])(*step[1:])

    def until(self, bits: int, more: int) -> None:
        whole = -(-(self.chip.now_ns - self.begin_ns) // BIT_NS) * BIT_NS + self.begin_ns
        self.chip.advance(max(whole + bits * BIT_NS + more, self.chip.now_ns))

    def write(self, name: str, value: int) -> None:
        self.chip.write(name, value)

    def send(self, mailbox: int, identifier: int) -> None:
        send(self.chip, identifier, FRAME.data, mailbox)

    def watch(self) -> None:
        self.watching: Any = self.chip.pins.subscribe_pins(PINS, self.rows.extend, of=Of.WIRE)

    def leave(self) -> None:
        if self.watching is not None:
            self.chip.deliver()
            self.watching.close()
        self.watching = None

    def mode(self, mode: int) -> None:
        self.write("CAN.MCR", INRQ)
        self.write("CAN.BTR", TIMING | mode)
        self.write("CAN.MCR", 0)

    def stop(self, bits: int) -> None:
        self.part.clock_stopped()
        self.chip.advance(self.chip.now_ns + bits * BIT_NS)
        self.part.clock_resumed(bits * BIT_NS)

    def restore(self) -> None:
        self.part.restore(self.part.snapshot())

    def hear(self) -> None:
        self.part.subscribe(self.frames.extend)

    def join(self) -> None:
        if self.part.joined is None:
            network = CanNetwork()
            self.part.attach(network)
            network.join(self.node)

    def reset(self) -> None:
        self.part.reset()

    def seen(self) -> tuple[Any, ...]:
        self.chip.deliver()
        words = [self.chip.read(f"CAN.{name}") for name in REGISTERS]
        heard = (tuple(self.frames), tuple(self.node.received), self.part.bit_rate)
        return words, bytes(self.rows), dict(self.chip.irqs), heard


def compare(make: Chips, steps: list[Step]) -> None:
    quick, slow = Bench(make(), repeats=True), Bench(make(), repeats=False)
    assert quick.part._bits.phase, "it repeats"
    for step in (*steps, ("until", 3 * PERIOD, 0)):
        quick.do(step)
        slow.do(step)
        assert quick.seen() == slow.seen(), step


@settings(max_examples=25)
@given(STEPS)
@example([("until", END, 0), ("write", "CAN.TSR", ABRQ)])
def test_tries_are_those_of_python_whatever_happens(make_fake_chip: Chips, steps: list[Step]) -> None:
    compare(make_fake_chip, steps)


@pytest.mark.soak
@settings(max_examples=3_000)
@given(STEPS)
def test_tries_are_those_of_python_whatever_happens_often(make_fake_chip: Chips, steps: list[Step]) -> None:
    compare(make_fake_chip, steps)


@pytest.mark.parametrize("bit", [0, 1, DECIDED, END, PERIOD])
@pytest.mark.parametrize("more", [-1, 0, 1])
@pytest.mark.parametrize(
    "step",
    [("write", "CAN.TSR", ABRQ), ("write", "CAN.MCR", NART), ("send", 1, 0x100), ("write", *WITHOUT_PIN),
     ("write", *SLOWER), ("stop", 50), ("join",), ("hear",), ("restore",), ("reset",)],
)  # fmt: skip
def test_tries_are_those_of_python_about_each_phase(make_fake_chip: Chips, bit: int, more: int, step: Step) -> None:
    compare(make_fake_chip, [("until", bit, more), step, ("until", PERIOD + 1, 0)])


@pytest.mark.parametrize("bit", [0, DECIDED, END])
@pytest.mark.parametrize(("before", "behind"), [(1, 0), (1, 1), (0, 1)])
def test_a_pin_that_is_away_at_a_phase_counts_then(make_fake_chip: Chips, bit: int, before: int, behind: int) -> None:
    away = [("until", PERIOD + bit - before, 0), ("write", *WITHOUT_PIN), ("until", before + behind, 0)]
    compare(make_fake_chip, [*away, ("write", *WITH_PIN)])


@pytest.mark.parametrize("bit", [1, DECIDED, END - 1])
def test_who_looks_sees_the_tries_that_begin_from_then_on(make_fake_chip: Chips, bit: int) -> None:
    bench = Bench(make_fake_chip(), repeats=True)
    bench.until(END, 0)
    bench.leave()
    bench.until(PERIOD - END + bit, 0)
    bench.rows.clear()
    bench.watch()
    bench.until(PERIOD - bit, -1)
    bench.seen()
    assert not bench.rows
    bench.until(1, 0)
    bench.seen()
    assert {row[0] for row in EDGE.iter_unpack(bench.rows)} == {bench.begin_ns + (PASSIVE_BITS + 2 * PERIOD) * BIT_NS}


def test_python_hears_of_no_try_that_changes_nothing(make_fake_chip: Chips) -> None:
    bench = Bench(make_fake_chip(), repeats=True)
    asked: list[int] = []
    acts = bench.chip.pins.fabric._acts
    slot = bench.part.slot
    before = acts[slot]

    def heard(at_ns: int) -> None:
        asked.append(at_ns)
        before(at_ns)

    acts[slot] = heard
    bench.until(100 * PERIOD, 0)
    assert asked == []
    assert len(bench.rows) > 100 * 16 * 20
    bench.write("CAN.ESR", 0)
    bench.until(100 * PERIOD, 0)
    assert 0 < len(asked) <= 9, "three a try, until two have left the same"
