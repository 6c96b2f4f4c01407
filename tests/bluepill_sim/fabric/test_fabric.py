"""The fabric in C: the queue of events, lines, and pins against a plain model of each."""

import ctypes
import heapq
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from bluepill_sim.fabric.fabric import Fabric
from bluepill_sim.fabric.pins import PinBank, PinDrive, PinMode
from bluepill_sim.fabric.subscriptions import EDGE, Of
from simbase.wire import are_fighting, level_of

QUICK = settings(max_examples=60)


class Chip:
    """What the fabric needs of a chip, and what it has told."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.access_pc = 0x800_0000
        self.irqs: list[tuple[int, bool]] = []
        self.due: list[int] = []
        self.ends = 0
        self.warnings: list[str] = []

    @property
    def access_cycle(self) -> int:
        return self.now_ns

    def irq_changed(self, irq: int, level: bool) -> bool:
        self.irqs.append((irq, level))
        return True

    def end_slice(self) -> None:
        self.ends += 1

    def event_due(self, cycle: int) -> None:
        self.due.append(cycle)

    def signal(self, name: str) -> None:
        raise AssertionError(name)

    def warn(self, message: str, *, once: str) -> None:
        self.warnings.append(f"{once}: {message}")


class Queue(RuleBasedStateMachine):
    """The queue beside a heap: who acts when, in which order."""

    #: The first two are those of the pins.
    SLOTS = range(2, 8)

    def __init__(self) -> None:
        super().__init__()
        self.fabric = Fabric(Chip())
        self.acted: list[tuple[int, int]] = []
        for slot in self.SLOTS:
            assert self.fabric.add_slot(f"part {slot}", self.acting(slot)) == slot
        self.due: dict[int, int] = {}
        self.now = 0

    def acting(self, slot: int) -> Any:
        def act(at_ns: int) -> None:
            assert self.fabric.event_ns == at_ns
            self.acted.append((at_ns, slot))
            self.fabric.schedule(slot, None)

        return act

    @rule(slot=st.sampled_from(SLOTS), after=st.integers(0, 50))
    def schedule(self, slot: int, after: int) -> None:
        self.fabric.schedule(slot, self.now + after)
        self.due[slot] = self.now + after

    @rule(slot=st.sampled_from(SLOTS))
    def take_back(self, slot: int) -> None:
        self.fabric.schedule(slot, None)
        self.due.pop(slot, None)

    @rule(after=st.integers(0, 60))
    def run(self, after: int) -> None:
        self.now += after
        self.acted.clear()
        self.fabric.run_events(self.now)
        heap = [(at, slot) for slot, at in self.due.items() if at <= self.now]
        heapq.heapify(heap)
        assert self.acted == [heapq.heappop(heap) for _ in range(len(heap))]
        self.due = {slot: at for slot, at in self.due.items() if at > self.now}

    @rule(slot=st.sampled_from(SLOTS), early=st.integers(0, 1))
    @precondition(lambda self: self.due)
    def catch_up(self, slot: int, early: int) -> None:
        if slot in self.due:
            at = self.due[slot]
            self.acted.clear()
            self.fabric.catch_up(slot, max(0, at - early))
            is_early = early and at > 0
            assert self.acted == ([] if is_early else [(at, slot)])
            if not is_early:
                del self.due[slot]

    @invariant()
    def the_first_is_known(self) -> None:
        assert self.fabric.next_ns == min(self.due.values(), default=None)
        assert [self.fabric.due(slot) for slot in self.SLOTS] == [self.due.get(slot) for slot in self.SLOTS]
        assert self.fabric.event_ns is None


TestQueue = Queue.TestCase
TestQueue.settings = settings(max_examples=40, stateful_step_count=30)


def test_those_who_schedule_each_other_act_in_order_of_time() -> None:
    fabric, acted = Fabric(Chip()), []

    def first(at_ns: int) -> None:
        acted.append(("first", at_ns))
        fabric.schedule(3, at_ns)
        fabric.schedule(2, at_ns + 10 if at_ns < 30 else None)

    def second(at_ns: int) -> None:
        acted.append(("second", at_ns))
        fabric.schedule(3, None)

    fabric.add_slot("one", first)
    fabric.add_slot("two", second)
    fabric.schedule(2, 10)
    fabric.run_events(100)
    assert acted == [(name, at) for at in (10, 20, 30) for name in ("first", "second")]


PLANS = st.lists(st.lists(st.tuples(st.integers(2, 7), st.integers(0, 2)), max_size=3), min_size=6, max_size=6)


@QUICK
@given(plans=PLANS, begin=st.lists(st.integers(0, 3), min_size=6, max_size=6))
def test_events_of_one_time_act_in_rounds_by_the_numbers_of_their_slots(
    plans: list[list[tuple[int, int]]], begin: list[int]
) -> None:
    """Each slot schedules others as it acts, the first time, also at that very time, before or behind itself."""
    fabric, acted = Fabric(Chip()), list[tuple[int, int]]()
    model, expected = dict[int, int](), list[tuple[int, int]]()

    def follow(slot: int, at_ns: int, log: list[tuple[int, int]]) -> list[tuple[int, int]]:
        log.append((at_ns, slot))
        return (
            [(other, at_ns + after) for other, after in plans[slot - 2]] if sum(s == slot for _, s in log) == 1 else []
        )

    def acting(slot: int) -> Any:
        def act(at_ns: int) -> None:
            fabric.schedule(slot, None)
            for other, at in follow(slot, at_ns, acted):
                fabric.schedule(other, at if other != slot else at + 1)

        return act

    for slot, at in enumerate(begin, 2):
        fabric.add_slot(f"part {slot}", acting(slot))
        fabric.schedule(slot, at)
        model[slot] = at
    while model:
        now = min(model.values())
        for slot in range(2, 8):
            if model.get(slot) == now:
                del model[slot]
                for other, at in follow(slot, now, expected):
                    model[other] = at if other != slot else at + 1
    fabric.run_events(100)
    assert acted == expected


def test_an_event_that_fails_comes_out_and_the_others_stay_due() -> None:
    chip = Chip()
    fabric = Fabric(chip)

    def fail(_at_ns: int) -> None:
        raise LookupError("broken")

    fabric.add_slot("one", fail)
    fabric.schedule(2, 5)
    with pytest.raises(LookupError, match="broken"):
        fabric.run_events(10)
    assert chip.ends == 1
    assert fabric.due(2) is None, "it would fail for ever"


def test_there_are_128_slots_and_the_first_two_are_those_of_the_pins() -> None:
    fabric = Fabric(Chip())
    for number in range(2, 128):
        fabric.add_slot(str(number), lambda _at: None)
    with pytest.raises(ValueError, match="no slot left"):
        fabric.add_slot("one more", lambda _at: None)


def test_a_bus_master_reaches_four_memories_and_no_more() -> None:
    fabric = Fabric(Chip())
    slot = fabric.add_slot("master", lambda _at: None)
    buffers = [ctypes.create_string_buffer(bytes([n, 1, 2, 3]), 4) for n in range(5)]
    for n, buffer in enumerate(buffers):
        fabric.add_memory(0x1000 * n, buffer, is_writable=False)
    assert [fabric.bus_read(slot, 0x1000 * n, 4) for n in range(5)] == [*(0x0302_0100 + n for n in range(4)), None]


def test_who_takes_an_earlier_time_shortens_the_slice() -> None:
    chip = Chip()
    fabric = Fabric(chip)
    slot = fabric.add_slot("one", lambda _at: None)
    for at in (500, 400, 400, 900):
        fabric.schedule(slot, at)
    assert chip.due == [500, 400, 900]


@QUICK
@given(changes=st.lists(st.tuples(st.integers(0, 70), st.booleans()), max_size=30))
def test_a_line_tells_the_core_and_its_subscribers_of_changes_only(changes: list[tuple[int, bool]]) -> None:
    chip = Chip()
    bank = PinBank(chip, frozenset({"PA0"}))
    rows = bytearray()
    bank.subscribe_pins((), rows.extend, lines=range(0, 70, 2))
    levels: dict[int, bool] = {}
    expected = []
    for now, (line, level) in enumerate(changes):
        chip.now_ns = now
        bank.fabric.set_line(line, level)
        if levels.get(line, False) != level:
            expected.append((now, line, level))
        levels[line] = level
    assert chip.irqs == [(line, level) for _, line, level in expected if line < 64]
    bank.deliver()
    seen = [(row[0], row[1] - 80, bool(row[3])) for row in EDGE.iter_unpack(rows)]
    assert seen == [one for one in expected if one[1] < 70 and one[1] % 2 == 0]
    assert [line for line, level in enumerate(bank.fabric.lines) if level] == sorted(n for n, v in levels.items() if v)


# Pins: a port in C beside each pin by itself.

PIN = st.fixed_dictionaries(
    {
        "mode": st.sampled_from(list(PinMode)),
        "odr": st.booleans(),
        "outside": st.sampled_from([None, False, True]),
        "weak": st.booleans(),
        "rail": st.sampled_from([None, None, "GND", "3V3"]),
        "hold": st.sampled_from([None, None, *PinDrive]),
        "sources": st.dictionaries(st.sampled_from(["MCO", "TIM2_CH1", "USART1_TX"]), st.booleans()),
        "board": st.sampled_from([PinDrive.NONE, PinDrive.PULL_UP, PinDrive.PULL_DOWN]),
    }
)


def drive_of(pin: dict[str, Any]) -> PinDrive:
    """What RM0008 table 20 makes of a pin."""
    if pin["hold"] is not None:
        drive: PinDrive = pin["hold"]
        return drive
    if "alternate" in pin["mode"].value:
        return pin["mode"].drives[min(pin["sources"].items())[1]] if pin["sources"] else PinDrive.NONE
    return pin["mode"].drives[pin["odr"]]


def level_on(pin: dict[str, Any], drive: PinDrive) -> tuple[bool, bool]:
    """The level on its wire, and whether two fight over it."""
    if pin["rail"] is not None:
        rail = pin["rail"] == "3V3"
        return rail, drive.is_strong and drive.level is not rail
    hard = [bool(drive.level)] if drive.is_strong else []
    pulls = []
    if pin["outside"] is not None and not pin["weak"]:
        hard.append(pin["outside"])
    elif pin["outside"] is not None:
        pulls = [pin["outside"]]
    elif drive.level is not None:
        pulls = [drive.level]
    elif pin["board"] is not PinDrive.NONE:
        pulls = [bool(pin["board"].level)]
    return bool(level_of(hard, pulls)), are_fighting(hard)


@QUICK
@given(lives=st.lists(st.lists(PIN, min_size=3, max_size=3), min_size=1, max_size=5))
def test_a_port_is_what_each_of_its_pins_is_alone(lives: list[list[dict[str, Any]]]) -> None:
    names = ("PB0", "PB7", "PB15")
    chip = Chip()
    bank = PinBank(chip, frozenset(names))
    rows = bytearray()
    bank.subscribe_pins(names, rows.extend, of=Of.WIRE)
    for life in lives:
        for name, wanted in zip(names, life, strict=True):
            pin = bank[name]
            pin.board_pull = wanted["board"]
            pin.configure(wanted["mode"], output_bit=wanted["odr"])
            for source in ("MCO", "TIM2_CH1", "USART1_TX"):
                if source in wanted["sources"]:
                    pin.connect(source, level=wanted["sources"][source])
                else:
                    pin.disconnect(source)
            if wanted["hold"] is None:
                pin.release()
            else:
                pin.hold("TEST", wanted["hold"])
            pin.short(wanted["rail"])
            pin.drive(wanted["outside"], is_weak=wanted["weak"])
        for name, wanted in zip(names, life, strict=True):
            pin, drive = bank[name], drive_of(wanted)
            level, is_fight = level_on(wanted, drive)
            assert (pin.output, pin.level, pin.is_contended) == (drive, level, is_fight)
            reads = (
                wanted["hold"] in {PinDrive.PULL_UP, PinDrive.PULL_DOWN}
                if wanted["hold"] is not None
                else wanted["mode"] is not PinMode.ANALOG
            )
            assert pin.input is (level and reads)
            is_driven = drive is not PinDrive.NONE or wanted["outside"] is not None or wanted["rail"] is not None
            assert pin.is_floating is (not is_driven and wanted["board"] is PinDrive.NONE)
    bank.deliver()
    last = {row[1]: row[3] for row in EDGE.iter_unpack(rows)}
    for name in names:
        pin = bank[name]
        if pin.index in last:
            assert last[pin.index] == (2 if pin.is_floating else pin.level)
    other = PinBank(Chip(), frozenset(names))
    other.restore(bank.snapshot())
    assert [(pin.output, pin.level, pin.input, pin.holder) for pin in other] == [
        (pin.output, pin.level, pin.input, pin.holder) for pin in bank
    ]


def test_a_subscriber_too_many_is_refused_and_a_closed_one_makes_room() -> None:
    bank = PinBank(Chip(), frozenset({"PA0"}))
    ones = [bank.subscribe_pins(["PA0"], lambda _rows: None) for _ in range(16)]
    with pytest.raises(ValueError, match="too many subscriptions"):
        bank.subscribe_pins(["PA0"], lambda _rows: None)
    ones[3].close()
    bank.subscribe_pins(["PA0"], lambda _rows: None)


def test_a_pin_that_the_chip_has_not_cannot_be_subscribed_to() -> None:
    with pytest.raises(KeyError, match="PF1"):
        PinBank(Chip(), frozenset()).subscribe_pins(["PF1"], lambda _rows: None)


def test_a_kind_that_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match=r"no kind of device is called 'toaster' .hint: build"):
        Fabric(Chip()).add_device(
            "toaster", "toaster", 0, 0, act=lambda _at: None, answer=lambda _what, _value: 0, deliver=lambda: None
        )
