"""Waves on pins: a level at a time is arithmetic; edges are made for who wants them, and are the same either way."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.pins import PinBank, PinDrive, PinMode
from bluepill_sim.fabric.subscriptions import EDGE, HIGH, LOW, Of, Wave, read_rows
from simbase.timing import NS_PER_S

QUICK = settings(max_examples=60)
SOURCES = ("TIM2_CH1", "TIM2_CH2")


class Ports:
    """What a bank needs of its chip: a clock that the test moves, a cycle of which is a nanosecond."""

    def __init__(self) -> None:
        self.now_ns = self.stops = 0
        self.warnings: dict[str, str] = {}

    @property
    def access_cycle(self) -> int:
        return self.now_ns

    def event_due(self, cycle: int) -> None:
        pass

    def end_slice(self) -> None:
        self.stops += 1

    def warn(self, message: str, *, once: str) -> None:
        self.warnings.setdefault(once, message)


class Bank:
    """Two pins of alternate functions and one plain one, a clock, and who listens."""

    def __init__(self, base_ns: int = 0) -> None:
        self.ports = Ports()
        self.made: list[tuple[int, int, int]] = []
        self.pins = PinBank(self.ports, frozenset({"PA0", "PA1", "PA2"}))  # type: ignore[arg-type]  # a part of a chip
        self.ports.now_ns = base_ns
        self.pins.fabric.set_time(base_ns, base_ns, NS_PER_S)
        for name in ("PA0", "PA1"):
            self.pins[name].configure(PinMode.ALTERNATE_PUSH_PULL, output_bit=False)
        self.pins["PA2"].configure(PinMode.PUSH_PULL, output_bit=False)

    def run(self, until_ns: int) -> None:
        """Go on to a time, from event to event."""
        fabric = self.pins.fabric
        while (due := fabric.next_ns) is not None and due <= until_ns:
            self.ports.now_ns = max(due, self.ports.now_ns)
            fabric.run_events(self.ports.now_ns)
            self.look()
        self.ports.now_ns = until_ns
        if fabric.has_news:
            self.pins.deliver()

    def look(self) -> None:
        """Note what the pins show, where each edge is made at its time."""
        struct = self.pins.fabric.port_structs[0]
        for pin in (0, 1, 2):
            self.made.append((self.ports.now_ns, pin, 2 if struct.floating >> pin & 1 else struct.level >> pin & 1))

    def listen(self, **options: Any) -> list[tuple[int, int, int]]:
        """Return a list that gets (ns, pin, wire)."""
        rows: list[tuple[int, int, int]] = []

        def take(data: bytes) -> None:
            rows.extend((ns, pin, wire) for ns, pin, _, wire, *_ in EDGE.iter_unpack(data))

        self.pins.subscribe_pins(["PA0", "PA1", "PA2"], take, of=Of.WIRE, **options)
        return rows


def level_of(position: int, ticks: int, period: int, high: int) -> bool:
    return (position + ticks) % period < high


@QUICK
@given(
    st.sampled_from([8_000_000, 72_000_000, 7_999_991, NS_PER_S]), st.integers(2, 70_000), st.integers(1, 69_999),
    st.integers(0, 10**6), st.integers(0, 10**12), st.lists(st.integers(0, 10**10), min_size=1, max_size=5),
)  # fmt: skip
def test_the_level_at_a_time_is_that_of_the_last_tick_begun(
    hz: int, period: int, high: int, position: int, base_ns: int, spans: list[int]
) -> None:
    high = 1 + high % (period - 1)
    bank = Bank(base_ns)
    pin = bank.pins["PA0"]
    pin.offer_wave("TIM2_CH1", hz, period, high, position)
    assert pin.wave is not None
    for ns in spans:
        # The last tick k with floor(k * 10**9 / hz) <= ns.
        tick = ns * hz // NS_PER_S
        while (tick + 1) * NS_PER_S // hz <= ns:
            tick += 1
        bank.ports.now_ns = base_ns + ns
        wanted = level_of(position, tick, period, high)
        assert pin.level is wanted
        assert pin.input is wanted
        assert pin.output is (PinDrive.HIGH if wanted else PinDrive.LOW)
        assert pin.wave.level(base_ns + ns) is wanted


@pytest.mark.parametrize("hz", [72_000_000, 7_000_000, NS_PER_S])
def test_an_edge_is_there_at_its_nanosecond_and_not_one_before(hz: int) -> None:
    period, high = 3600, 900
    bank = Bank()
    bank.pins["PA0"].offer_wave("TIM2_CH1", hz, period, high)
    for edge in range(1, 20):
        tick = edge // 2 * period + edge % 2 * high
        at_ns = tick * NS_PER_S // hz
        for ns, level in ((at_ns - 1, edge % 2 == 1), (at_ns, edge % 2 == 0), (at_ns + 1, edge % 2 == 0)):
            bank.ports.now_ns = ns
            assert bank.pins["PA0"].level is level, (edge, ns)


def test_20_kilohertz_of_72_megahertz_is_exact_for_ever() -> None:
    bank = Bank()
    bank.pins["PA0"].offer_wave("TIM2_CH1", 72_000_000, 3600, 1)
    for turn in (1, 20_000, 20_000 * 3600, 20_000 * 3600 * 24 * 365):
        bank.ports.now_ns = turn * 50_000
        assert bank.pins["PA0"].level
        bank.ports.now_ns -= 1
        assert not bank.pins["PA0"].level


steps = st.lists(
    st.one_of(
        st.tuples(st.just("run"), st.integers(0, 30_000)),
        st.tuples(st.just("wave"), st.integers(0, 1), st.integers(2, 900), st.integers(0, 900), st.integers(0, 900)),
        st.tuples(st.just("level"), st.integers(0, 1), st.integers(0, 2)),
        st.tuples(st.just("plain"), st.booleans()),
        st.tuples(st.just("mode"), st.integers(0, 1), st.booleans()),
        st.tuples(st.just("outside"), st.integers(0, 1), st.sampled_from([None, True, False])),
        st.tuples(st.just("listen"), st.booleans()),
        st.tuples(st.just("save")),
    ),
    max_size=30,
)


def act(bank: Bank, step: tuple[Any, ...]) -> None:
    """Do one step."""
    pins = bank.pins
    match step:
        case ("wave", n, period, high, position):
            pins[f"PA{n}"].offer_wave(SOURCES[n], 7_000_000, period, high, position)
        case ("level", n, level):
            if level == 2:
                pins[f"PA{n}"].disconnect(SOURCES[n])
            else:
                pins[f"PA{n}"].connect(SOURCES[n], bool(level))
        case ("plain", level):
            pins["PA2"].configure(PinMode.PUSH_PULL, output_bit=level)
        case ("mode", n, is_alternate):
            pins[f"PA{n}"].configure(
                PinMode.ALTERNATE_PUSH_PULL if is_alternate else PinMode.FLOATING, output_bit=False
            )
        case ("outside", n, level):
            pins[f"PA{n}"].drive(level, is_weak=True)
        case ("save",):
            pins.restore(pins.snapshot())
            pins.fabric.resume()


def reported(rows: list[tuple[int, int, int]]) -> list[tuple[int, int, int]]:
    """Return rows without what one pin shows only for an instant, in an order that does not depend on the cause."""
    kept: dict[tuple[int, int], int] = {(ns, pin): wire for ns, pin, wire in rows}
    last: dict[int, int] = {}
    changed = []
    for (ns, pin), wire in sorted(kept.items()):
        if last.get(pin) != wire:
            changed.append((ns, pin, wire))
        last[pin] = wire
    return changed


@QUICK
@given(steps)
def test_edges_made_in_bulk_are_those_made_one_by_one(script: list[tuple[Any, ...]]) -> None:
    bulk, single = Bank(), Bank()
    bulk_rows, single_rows = bulk.listen(), single.listen(ends_slice=["PA0", "PA1", "PA2"])
    single.look()
    bulk_rows += single.made
    now = 0
    for step in script:
        if step[0] == "run":
            now += step[1]
            bulk.run(now)
            single.run(now)
        else:
            act(bulk, step)
            act(single, step)
            single.look()
        for name in ("PA0", "PA1"):
            assert bulk.pins[name].level is single.pins[name].level
    bulk.run(now)
    single.run(now)
    assert reported(bulk_rows) == reported(single.made)
    assert single_rows == bulk_rows[3:]
    assert [row[0] for row in bulk_rows] == sorted(row[0] for row in bulk_rows)


@QUICK
@given(steps, st.lists(st.integers(1, 7000), max_size=20))
def test_slices_do_not_show(script: list[tuple[Any, ...]], slices: list[int]) -> None:
    whole, sliced = Bank(), Bank()
    rows, pieces = whole.listen(), sliced.listen()
    now = 0
    for step in script:
        if step[0] == "run":
            for cut in slices:
                if cut < step[1]:
                    sliced.run(max(now + cut, sliced.ports.now_ns))
            now += step[1]
            whole.run(now)
            sliced.run(now)
        else:
            act(whole, step)
            act(sliced, step)
    whole.run(now)
    sliced.run(now)
    assert rows == pieces


@QUICK
@given(steps)
def test_who_takes_waves_knows_every_level(script: list[tuple[Any, ...]]) -> None:
    bank = Bank()
    known: dict[int, tuple[int, Wave | None]] = {0: (2, None), 1: (2, None)}
    both = set()

    def take(data: bytes) -> None:
        for _, pin, _, wire, wave in read_rows(data):
            known[pin] = wire, wave

    bank.pins.subscribe_pins(["PA0", "PA1"], take, of=Of.WIRE, waves=True)
    now = 0
    for step in script:
        if step[0] == "run":
            now += step[1]
            bank.run(now)
        else:
            act(bank, step)
        if bank.pins.fabric.has_news:
            bank.pins.deliver()
        for n in (0, 1):
            pin = bank.pins[f"PA{n}"]
            wire, wave = known[n]
            assert wave == pin.wave
            both.add(wave is None)
            if wave is not None:
                assert wave.level(now) is pin.level
            else:
                assert (wire == HIGH) is pin.level


def test_a_wave_costs_nothing_until_somebody_asks() -> None:
    bank = Bank()
    taken: list[Any] = []
    bank.pins.subscribe_pins(["PA0"], lambda data: taken.extend(read_rows(data)), waves=True)
    bank.pins["PA0"].offer_wave("TIM2_CH1", 72_000_000, 3600, 900)
    bank.run(NS_PER_S)
    assert bank.pins.fabric.next_ns is None
    assert len(taken) == 1
    wave = taken[0][4]
    assert (wave.frequency_hz, wave.duty) == (20_000, 0.25)
    bank.pins["PA0"].connect("TIM2_CH1", False)
    bank.run(NS_PER_S)
    assert taken[1:] == [(NS_PER_S, 0, list(PinDrive).index(PinDrive.LOW), LOW, None)]


def test_a_short_is_warned_of_though_the_wave_is_on_the_other_level_now() -> None:
    bank = Bank()
    bank.pins["PA0"].short("GND")
    bank.pins["PA0"].offer_wave("TIM2_CH1", 72_000_000, 3600, 1, position=10)
    assert list(bank.ports.warnings) == ["PA0:short"]


def test_a_wave_under_a_lower_function_comes_back_in_phase() -> None:
    bank = Bank()
    pin = bank.pins["PA0"]
    pin.offer_wave("TIM2_CH1", NS_PER_S, 100, 30)
    pin.connect("TIM1_CH1", True)
    assert pin.wave is None
    bank.ports.now_ns = 1_050
    assert pin.level
    pin.disconnect("TIM1_CH1")
    assert not pin.level
    bank.ports.now_ns = 1_120
    assert pin.level


def test_rows_do_not_pile_up_while_nobody_takes_them() -> None:
    bank = Bank()
    rows = bank.listen()
    bank.pins["PA0"].offer_wave("TIM2_CH1", 72_000_000, 72, 30)
    bank.run(40_000_000)  # 80 000 edges, 32768 at most before the slice is to end
    assert bank.ports.stops >= 2
    assert len(rows) == 80_001


def test_no_edges_are_made_beyond_an_event_that_may_change_the_wave() -> None:
    bank = Bank()
    rows = bank.listen()
    fabric, pin = bank.pins.fabric, bank.pins["PA0"]
    pin.offer_wave("TIM2_CH1", NS_PER_S, 100, 50)

    def change(_ns: int) -> None:
        fabric.schedule(slot, None)
        pin.connect("TIM2_CH1", False)

    slot = fabric.add_slot("timer", change)
    fabric.schedule(slot, 225)
    bank.ports.now_ns = 500
    assert fabric.has_news  # a slice has ended before the event was acted on
    bank.pins.deliver()
    fabric.run_events(500)
    bank.run(600)
    assert rows == [(0, 0, HIGH), (50, 0, LOW), (100, 0, HIGH), (150, 0, LOW), (200, 0, HIGH), (225, 0, LOW)]
