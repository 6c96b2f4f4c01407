"""The parts of the core without the core: clock arithmetic, SysTick, NVIC, each against a naive twin."""

import ctypes

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from bluepill_sim.core.nvic import FIRST_IRQ, HARD_FAULT, NMI, THREAD_PRIORITY, Nvic
from bluepill_sim.core.systick import CLKSOURCE, COUNTFLAG, ENABLE, TICKINT, SysTick
from bluepill_sim.extension.layout import SHARED, structure
from bluepill_sim.extension.library import library
from bluepill_sim.fabric.cycle_clock import CycleClock
from bluepill_sim.memory.arrays import Memory

FREQUENCIES = st.sampled_from([8_000_000, 72_000_000, 1_000_000, 56_000_000, 15_625, 36_000_001])


@given(FREQUENCIES, st.integers(0, 10**13), st.lists(st.tuples(FREQUENCIES, st.integers(0, 10**9)), max_size=5))
def test_the_cycle_at_a_time_is_the_first_not_before_it(frequency: int, at: int, changes) -> None:
    clock, cycle = CycleClock(frequency), 0
    for next_frequency, more in changes:
        cycle += more
        before = clock.ns_of(cycle)
        clock.set_frequency(next_frequency, cycle)
        assert clock.ns_of(cycle) == before
    at += clock.ns_of(cycle)
    found = clock.cycle_at(at)
    assert clock.ns_of(found) >= at
    assert found == cycle or clock.ns_of(found - 1) < at
    twin = CycleClock(1)
    twin.restore(clock.snapshot())
    assert twin.cycle_at(at) == found


class SysTickAlone(SysTick):
    """SysTick without a core: its registers by C, as `SystemControl` and the native core have them."""

    def __init__(self, pend) -> None:
        shared = structure(SHARED)()
        library().system_init(ctypes.addressof(shared))
        super().__init__(pend, shared)

    def _read(self, word: int, now: int) -> int:
        self.advance_to(now)
        return library().systick_read(self._at, word, now)

    def _write(self, word: int, value: int, now: int) -> None:
        self.advance_to(now)
        library().systick_write(self._at, word, value, now)

    def read_control(self, now: int) -> int:
        return self._read(0, now)

    def read_reload(self) -> int:
        return library().systick_read(self._at, 1, 0)

    def read_value(self, now: int) -> int:
        return self._read(2, now)

    def write_control(self, value: int, now: int) -> None:
        self._write(0, value, now)

    def write_reload(self, value: int, now: int) -> None:
        self._write(1, value, now)

    def write_value(self, now: int) -> None:
        self._write(2, 0, now)


class NaiveSysTick:
    """One tick at a time, as the manual tells it."""

    def __init__(self) -> None:
        self.control = self.reload = self.value = 0
        self.flag = False
        self.pended = 0
        self.phase = 0

    def cycle(self) -> None:
        if not self.control & ENABLE:
            return
        self.phase += 1
        if self.phase < (1 if self.control & CLKSOURCE else 8):
            return
        self.phase = 0
        if self.value == 0:
            self.value = self.reload
            return
        self.value -= 1
        if self.value == 0:
            self.flag = True
            self.pended += bool(self.control & TICKINT)


class SysTickTwins(RuleBasedStateMachine):
    """Random programs of the timer: the lazy one must equal the naive one."""

    @initialize()
    def start(self) -> None:
        self.now = 0
        self.pended = 0
        self.naive = NaiveSysTick()
        self.lazy = SysTickAlone(self._pend)

    def _pend(self) -> None:
        self.pended += 1

    @rule(cycles=st.integers(1, 60))
    def wait(self, cycles: int) -> None:
        for _ in range(cycles):
            self.naive.cycle()
            self.now += 1
            # The chip stops at every wrap.
            if self.lazy.next_cycle is not None and self.lazy.next_cycle <= self.now:
                self.lazy.advance_to(self.now)

    @rule(interrupts=st.booleans(), enabled=st.booleans())
    def control(self, interrupts: bool, enabled: bool) -> None:
        # The clock source stays: switching it in the middle of a reference tick is nobody's business.
        value = self.naive.control & CLKSOURCE | TICKINT * interrupts | ENABLE * enabled
        if not enabled:
            self.naive.phase = 0
        self.naive.control = value
        self.lazy.write_control(value, self.now)

    @rule(core_clock=st.booleans())
    def stop_and_choose_the_clock(self, core_clock: bool) -> None:
        self.naive.control, self.naive.phase = CLKSOURCE * core_clock, 0
        self.lazy.write_control(self.naive.control, self.now)

    @rule(value=st.integers(0, 30))
    def reload(self, value: int) -> None:
        self.naive.reload = value
        self.lazy.write_reload(value, self.now)

    @rule()
    def clear(self) -> None:
        self.naive.value, self.naive.flag, self.naive.phase = 0, False, 0
        self.lazy.write_value(self.now)

    @rule()
    def read_flag(self) -> None:
        expected = self.naive.control | (COUNTFLAG if self.naive.flag else 0)
        assert self.lazy.read_control(self.now) == expected
        self.naive.flag = False

    @rule()
    def move_to_a_twin(self) -> None:
        snapshot = self.lazy.snapshot()
        self.lazy = SysTickAlone(self._pend)
        self.lazy.restore(snapshot)

    @invariant()
    def they_agree(self) -> None:
        assert self.lazy.read_value(self.now) == self.naive.value
        assert self.lazy.read_reload() == self.naive.reload
        assert self.pended == self.naive.pended


TestSysTickTwins = SysTickTwins.TestCase


def test_systick_counts_from_reload_to_zero_in_reload_plus_one_ticks() -> None:
    pended = []
    timer = SysTickAlone(lambda: pended.append(1))
    timer.write_reload(99, 0)
    timer.write_value(0)
    timer.write_control(7, 0)
    assert timer.next_cycle == 100
    assert timer.read_value(99) == 1
    assert pended == []
    assert timer.read_value(100) == 0
    assert pended == [1]
    assert timer.read_value(101) == 99
    timer.advance_to(1000)  # late: the exception is pending only once for many wraps
    assert timer.next_cycle == 1100


_PRIORITIES = st.lists(st.integers(0, 255), min_size=43, max_size=43)


@given(st.sets(st.integers(0, 42), max_size=8), _PRIORITIES, st.integers(0, 7))
def test_the_first_pending_exception_is_the_one_of_the_best_priority(irqs, priorities, grouping) -> None:
    nvic = Nvic()
    nvic.priority_grouping = grouping
    nvic.enabled = (1 << 43) - 1
    for irq, value in enumerate(priorities):
        nvic.priorities[FIRST_IRQ + irq] = value & 0xF0
    for irq in irqs:
        nvic.set_level(irq, True)
    expected = min(((priorities[irq] & 0xF0, irq) for irq in irqs), default=None)
    assert nvic.first_pending() == (None if expected is None else FIRST_IRQ + expected[1])
    if expected is not None:
        number = FIRST_IRQ + expected[1]
        nvic.activate(number)
        group = expected[0] & ~((2 << grouping) - 1)
        assert nvic.active_priority() == group
        assert not nvic.can_preempt(number, nvic.active_priority())


def test_fixed_priorities_come_before_all_that_can_be_set() -> None:
    nvic = Nvic()
    nvic.enabled = 1
    for number in (FIRST_IRQ, HARD_FAULT, NMI):
        nvic.pend(number)
    order = []
    while (number := nvic.first_pending()) is not None:
        order.append(number)
        nvic.pending &= ~(1 << number)
    assert order == [NMI, HARD_FAULT, FIRST_IRQ]
    assert nvic.active_priority() == THREAD_PRIORITY


def test_a_line_is_latched_and_comes_again_while_it_stays_high() -> None:
    nvic = Nvic()
    nvic.enabled = 1 << 5
    nvic.set_level(5, True)
    nvic.set_level(5, False)
    assert nvic.first_pending() == FIRST_IRQ + 5, "latched"
    nvic.activate(FIRST_IRQ + 5)
    nvic.set_level(5, True)
    assert nvic.first_pending() == FIRST_IRQ + 5, "a new edge while active"
    nvic.pending = 0
    nvic.deactivate(FIRST_IRQ + 5)
    assert nvic.first_pending() == FIRST_IRQ + 5, "still high when the handler returns"
    nvic.set_level(5, False)
    nvic.pending = 0
    assert nvic.first_pending() is None
    twin = Nvic()
    twin.restore(nvic.snapshot())
    assert twin.snapshot() == nvic.snapshot()


@pytest.mark.parametrize(
    ("address", "data"), [(0x0800_0000, b"1234"), (0x2000_4FFE, b"1234"), (0x1FFF_FFFC, b"1234"), (0x4000_0000, b"1")]
)
def test_only_the_sram_takes_writes(address: int, data: bytes) -> None:
    assert not Memory().write(address, data)


def test_memory_reads_what_was_written_and_nothing_beyond() -> None:
    memory = Memory()
    assert memory.write(0x2000_4FFC, b"abcd")
    assert memory.read(0x2000_4FFC, 4) == b"abcd"
    assert memory.read(0x2000_4FFC, 5) is None
    assert memory.read_word(0x0801_FFFC) == 0xFFFF_FFFF
    assert memory.read_word(0x0802_0000) is None


def test_a_fork_of_a_run_that_failed_in_an_exception_return_makes_that_return(boot) -> None:
    one, other = boot("nop").board.chip.engine, boot("nop").board.chip.engine
    one.has_branched_to_return = True
    other.restore(one.snapshot())
    assert other.has_branched_to_return
