"""TIM1 to TIM4: registers, one tick before and at what is due, and tables derived by hand from RM0008 14 and 15."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim import stm32f103
from bluepill_sim.fabric.registers import WORD
from bluepill_sim.fabric.subscriptions import EDGE, HIGH, LOW, Of

TICK_NS = 125  # 8 MHz, after a reset
TIMERS = ("TIM1", "TIM2", "TIM3", "TIM4")
IRQ = {"TIM2": 28, "TIM3": 29, "TIM4": 30}
UIF, CC1IF, CC2IF, CC3IF, CC4IF, COMIF, TIF, BIF, CC1OF = 1, 2, 4, 8, 16, 32, 64, 128, 0x200
CEN, UDIS, URS, OPM, DIR, ARPE = 1, 2, 4, 8, 16, 128


class Timer:
    """One timer of a chip without a CPU; time is in ticks since it was made."""

    def __init__(self, chip: Any, name: str) -> None:
        self.chip, self.name = chip, name
        self.rows: list[tuple[int, str, int]] = []

    def __setitem__(self, register: str, value: int) -> None:
        self.chip.write(f"{self.name}.{register}", value)

    def __getitem__(self, register: str) -> int:
        return int(self.chip.read(f"{self.name}.{register}"))

    @property
    def flags(self) -> int:
        """SR, without arming what a read of it arms."""
        part = self.chip.parts.by_name[self.name]
        return int(part.look(0x10))

    def set(self, **registers: int) -> None:
        """Write registers in the order given."""
        for register, value in registers.items():
            self[register.rstrip("_")] = value

    def at(self, tick: int) -> "Timer":
        """Go on to a tick."""
        self.chip.advance(tick * TICK_NS)
        return self

    def output(self, pin: str, *, mode: int = 0xB) -> None:
        """Make an alternate function of a pin."""
        register = f"GPIO{pin[1]}.{'CRH' if int(pin[2:]) > 7 else 'CRL'}"
        at = 4 * (int(pin[2:]) % 8)
        self.chip.write(register, self.chip.read(register) & ~(15 << at) | mode << at)

    def watch(self, *pins: str) -> None:
        """Note edges of pins as (tick, pin, level)."""
        names = {self.chip.pins[pin].index: pin for pin in pins}

        def take(rows: bytes) -> None:
            self.rows += [(ns // TICK_NS, names[pin], wire) for ns, pin, _, wire, *_ in EDGE.iter_unpack(rows)]

        self.chip.pins.subscribe_pins(pins, take, of=Of.WIRE)


@pytest.fixture
def tim1(fake_chip: Any) -> Timer:
    return Timer(fake_chip, "TIM1")


@pytest.fixture
def tim2(fake_chip: Any) -> Timer:
    return Timer(fake_chip, "TIM2")


@pytest.fixture
def tim3(fake_chip: Any) -> Timer:
    return Timer(fake_chip, "TIM3")


# Registers.


@pytest.mark.parametrize("name", TIMERS)
@settings(max_examples=40)
@given(data=st.data())
def test_a_register_keeps_the_bits_that_it_has_and_no_others(
    make_fake_chip: Callable[[], Any], name: str, data: st.DataObject
) -> None:
    part = make_fake_chip().parts.by_name[name]
    plain = [r for r in part.REGISTERS if r.name not in {"SR", "EGR", "DMAR", "BDTR"}]
    register = data.draw(st.sampled_from(plain), label="register")
    word = data.draw(st.integers(0, WORD), label="word")
    part.write(register.offset, 4, word)
    expected = word & register.writable
    if register.name == "CR1" and word & 0x60:
        expected &= ~DIR  # counts up from 0
    if register.name == "CNT":
        expected = word & 0xFFFF
    assert part.read(register.offset, 4) == expected


def test_flags_are_cleared_by_a_zero_alone(tim3: Timer) -> None:
    tim3["EGR"] = 0x5F
    assert tim3["SR"] == 0x5F
    tim3["SR"] = 0xFFFF & ~CC2IF
    assert tim3["SR"] == 0x5F & ~CC2IF
    tim3["SR"] = 0
    assert tim3["SR"] == 0


def test_the_register_of_a_capture_is_read_only_and_its_read_clears_the_flag(tim3: Timer) -> None:
    tim3.set(CCR1=0x55, CCMR1=0x01, CCER=1, CNT=0x77, EGR=2)
    tim3["CCR1"] = 3
    assert tim3.flags == CC1IF
    assert tim3["CCR1"] == 0x77
    assert tim3.flags == 0


def test_a_channel_that_is_on_keeps_its_direction(tim3: Timer) -> None:
    tim3.set(CCER=1, CCMR1=0x0101)
    assert tim3["CCMR1"] == 0x0100
    tim3.set(CCER=0, CCMR1=0x0101)
    assert tim3["CCMR1"] == 0x0101


@pytest.mark.parametrize(
    ("level", "register", "kept"),
    [
        (0, "CR2", 0), (1, "CR2", 0x7F00), (0, "CCER", 0), (1, "CCER", 0), (2, "CCER", 0x2AAA), (3, "CCER", 0x2AAA),
        (2, "CCMR1", 0), (3, "CCMR1", 0x7878), (3, "CCMR2", 0x7878),
        (0, "BDTR", 0x300), (1, "BDTR", 0x73FF), (2, "BDTR", 0x7FFF),
    ],
)  # fmt: skip
def test_lock_keeps_what_its_level_says(tim1: Timer, level: int, register: str, kept: int) -> None:
    """RM0008 14.4.18; LOCK itself is written once."""
    tim1["BDTR"] = level << 8
    before = tim1[register]
    written = {"CR2": 0x7F00, "CCER": 0x3FFF, "BDTR": 0x7FFF}.get(register, 0x7878)
    tim1[register] = written
    assert tim1[register] ^ before == (written ^ before) & ~kept


# The time base.


@pytest.mark.parametrize(("psc", "arr"), [(0, 1), (0, 9), (1, 1), (3, 24), (7, 999)])
def test_the_update_comes_at_its_tick_and_not_before(tim2: Timer, psc: int, arr: int) -> None:
    """Counting begins a clock after CEN (15.3.1); CNT is 0 again after (PSC + 1) * (ARR + 1) more."""
    tim2.set(PSC=psc, ARR=arr, EGR=1, SR=0, DIER=1, CR1=CEN)
    due = 1 + (psc + 1) * (arr + 1)
    tim2.at(due - 1)
    assert (tim2["CNT"], tim2.flags & UIF, tim2.chip.irqs[28]) == (arr, 0, False)
    tim2.at(due)
    assert (tim2["CNT"], tim2.flags & UIF, tim2.chip.irqs[28]) == (0, UIF, True)
    tim2["SR"] = 0
    assert not tim2.chip.irqs[28]
    tim2.at(due + (psc + 1) * (arr + 1) - 1)
    assert not tim2.chip.irqs[28]
    tim2.at(due + (psc + 1) * (arr + 1))
    assert tim2.chip.irqs[28]


@pytest.mark.parametrize("name", TIMERS)
@settings(max_examples=60)
@given(psc=st.integers(0, 0xFFFF), arr=st.integers(1, 0xFFFF), tick=st.integers(1, 1 << 36))
def test_a_counter_is_where_its_time_puts_it(
    make_fake_chip: Callable[[], Any], name: str, psc: int, arr: int, tick: int
) -> None:
    timer = Timer(make_fake_chip(), name)
    timer.set(PSC=psc, ARR=arr, EGR=1, CR1=CEN)
    timer.at(tick)
    assert timer["CNT"] == (tick - 1) // (psc + 1) % (arr + 1)
    assert bool(timer["SR"] & UIF)  # that of UG


def test_a_timer_at_which_nobody_looks_has_no_event(tim1: Timer) -> None:
    tim1.set(ARR=99, CCMR1=0x6868, CCR1=30, CCR2=60, EGR=1, BDTR=0x8000, CCER=0x55, CR1=CEN | ARPE)
    for tick in (1, 2, 500, 100_000):
        tim1.at(tick)
        assert tick == 1 or tim1.chip.parts.by_name["TIM1"].due_ns is None
    assert tim1.flags == UIF | CC1IF | CC2IF | CC3IF | CC4IF


def test_a_flag_that_the_program_looks_for_is_an_event(tim1: Timer) -> None:
    """Then a loop that polls SR can wait for it; the flag stays without another one."""
    tim1.set(ARR=99, CCR1=50, CCR2=50, CCR3=50, CCR4=50, EGR=1, SR=0, CR1=CEN)
    part = tim1.chip.parts.by_name["TIM1"]
    assert tim1.at(10)["SR"] == 0
    assert part.due_ns == 51 * TICK_NS
    tim1.at(51)
    assert part.words[4] == CC1IF | CC2IF | CC3IF | CC4IF
    assert part.due_ns == 101 * TICK_NS
    tim1.at(101)
    assert part.words[4] & UIF
    assert part.due_ns is None


def test_preloads_wait_for_the_update(tim3: Timer) -> None:
    tim3.set(ARR=9, EGR=1, SR=0, CR1=CEN | ARPE)
    tim3.at(5)
    tim3.set(ARR=19, PSC=1)
    tim3.at(11)  # the old period, then 20 counts of two ticks
    assert (tim3["CNT"], tim3.flags & UIF) == (0, UIF)
    tim3["SR"] = 0
    tim3.at(50)
    assert (tim3["CNT"], tim3.flags & UIF) == (19, 0)
    tim3.at(51)
    assert (tim3["CNT"], tim3.flags & UIF) == (0, UIF)


@pytest.mark.parametrize(
    ("control", "limit", "old", "new", "matches"),
    [
        (0, 9, 0, 5, False), (0, 9, 5, 0, True), (0, 9, 0, 0, True), (0, 9, 5, 4, False), (ARPE, 5, 0, 1, False),
        (DIR | ARPE, 5, 9, 5, True), (DIR | ARPE, 5, 9, 3, False), (DIR | ARPE, 5, 3, 5, True),
        (DIR | ARPE, 5, 5, 5, True), (DIR | ARPE, 9, 9, 5, False), (0x60 | ARPE, 5, 9, 5, True),
        (0x60 | ARPE, 5, 9, 3, False), (0x60 | ARPE, 5, 3, 5, True), (DIR | UDIS | ARPE, 5, 9, 5, None),
    ],
)  # fmt: skip
def test_an_update_event_compares_what_it_loads(
    tim3: Timer, control: int, limit: int, old: int, new: int, matches: bool | None
) -> None:
    """In its own tick, in place of what it replaces: a strip of LEDs by DMA at matches needs it."""
    tim3.set(CR1=control & ~UDIS, ARR=9, CCMR1=0x68, CCR1=old, EGR=1, SR=0, CR1_=control | CEN)
    tim3.set(ARR=limit, CCR1=new)
    for tick in range(1, 12):
        tim3["SR"] = 0
        tim3.at(tick)
        if tim3.flags & UIF:
            break
    assert (bool(tim3.flags & CC1IF) if tim3.flags & UIF else None) is matches


def test_without_preload_a_period_is_another_at_once(tim3: Timer) -> None:
    tim3.set(ARR=99, EGR=1, SR=0, CR1=CEN)
    tim3.at(50)
    tim3["ARR"] = 60
    tim3.at(61)
    assert (tim3["CNT"], tim3.flags & UIF) == (60, 0)
    assert (tim3.at(62)["CNT"], tim3.flags & UIF) == (0, UIF)


def test_a_counter_beyond_its_limit_goes_on_to_65535(tim3: Timer) -> None:
    tim3.set(ARR=9, EGR=1, SR=0, CNT=0xFFF0, CR1=CEN)
    assert (tim3.at(16)["CNT"], tim3.flags & UIF) == (0xFFFF, 0)
    assert (tim3.at(17)["CNT"], tim3.flags & UIF) == (0, 0)
    assert (tim3.at(27)["CNT"], tim3.flags & UIF) == (0, UIF)


def test_a_limit_of_0_blocks_the_counter(tim3: Timer) -> None:
    tim3.set(ARR=0, CR1=CEN)
    assert tim3.at(1000)["CNT"] == 0
    tim3["ARR"] = 4
    assert tim3.at(1005)["CNT"] == 4


@pytest.mark.parametrize(
    ("control", "counts", "update_at"),
    [
        (0x00, [0, 1, 2, 3, 4, 0, 1, 2], [5]),
        (DIR, [0, 4, 3, 2, 1, 0, 4, 3], [1, 6]),
        (0x20, [0, 1, 2, 3, 4, 3, 2, 1, 0, 1], [4, 8]),
        (0x60, [0, 1, 2, 3, 4, 3, 2, 1, 0, 1], [4, 8]),
    ],
)
def test_counts_and_updates_follow_the_manuals_diagrams(
    tim2: Timer, control: int, counts: list[int], update_at: list[int]
) -> None:
    """RM0008 15.3.2: an overflow as the counter comes to ARR when centre-aligned, else as it leaves it."""
    tim2.set(ARR=4, CR1=control | CEN)
    for step, count in enumerate(counts):
        tim2.at(1 + step)
        assert tim2["CNT"] == count, step
        assert bool(tim2["SR"] & UIF) is (step in update_at), step
        tim2["SR"] = 0


def test_dir_shows_which_way_a_centred_counter_goes(tim2: Timer) -> None:
    tim2.set(ARR=4, CR1=0x20 | CEN)
    assert [tim2.at(1 + n)["CR1"] & DIR for n in range(10)] == [0, 0, 0, 0, DIR, DIR, DIR, DIR, 0, 0]


def test_the_repetition_counter_divides_updates(tim1: Timer) -> None:
    tim1.set(ARR=9, RCR=2, EGR=1, SR=0, CR1=CEN)
    for tick, is_up in ((11, False), (21, False), (30, False), (31, True)):
        assert bool(tim1.at(tick).flags & UIF) is is_up, tick
    tim1.set(SR=0, DIER=1)
    for tick, is_up in ((51, False), (60, False), (61, True)):
        assert tim1.at(tick).chip.irqs[25] is is_up, tick


def test_many_repetitions_at_once_leave_the_counter_where_it_belongs(tim1: Timer) -> None:
    """A thousand overflows that nobody sees are 333 updates and one overflow of the next three."""
    tim1.set(ARR=9, RCR=2, EGR=1, SR=0, CR1=CEN)
    tim1.at(10_001)["SR"] = 0
    for tick, is_up in ((10_011, False), (10_020, False), (10_021, True)):
        assert bool(tim1.at(tick).flags & UIF) is is_up, tick


def test_centred_repetitions_count_both_ends(tim1: Timer) -> None:
    """Overflows and underflows come every ARR counts: the third is an update."""
    tim1.set(ARR=4, RCR=2, EGR=1, SR=0, DIER=1, CR1=0x60 | CEN)
    for tick, is_up in ((12, False), (13, True)):
        assert tim1.at(tick).chip.irqs[25] is is_up, tick
    tim1["SR"] = 0
    for tick, is_up in ((24, False), (25, True)):
        assert tim1.at(tick).chip.irqs[25] is is_up, tick


@pytest.mark.parametrize(("control", "at"), [(0x00, 10), (DIR, 2), (0x60, 10)])
def test_a_match_at_the_limit_comes_as_the_counter_does(tim3: Timer, control: int, at: int) -> None:
    """CCR = ARR = 9: up, down (from 0 to 9 at the first count) and centre-aligned."""
    tim3.set(ARR=9, CCR1=9, DIER=2, CR1=control | CEN)
    assert not tim3.at(at - 1).chip.irqs[29]
    assert tim3.at(at).chip.irqs[29]


def test_a_centred_counter_comes_down_from_beyond_its_limit(tim3: Timer) -> None:
    """From 4, with ARR = 1: 3, 2, 1, and an underflow at 0."""
    tim3.set(ARR=9, CNT=4, CR1=DIR)
    tim3.set(CR1=0x60 | DIR)
    tim3.set(ARR=1, EGR=0, DIER=1)
    tim3["CR1"] = 0x60 | DIR | CEN
    found = []
    for tick in range(2, 8):
        found.append((tim3.at(tick)["CNT"], tim3.chip.irqs[29]))
        tim3["SR"] = 0
    assert found == [(3, False), (2, False), (1, False), (0, True), (1, True), (0, True)]


def test_udis_and_urs_hold_updates_back(tim3: Timer) -> None:
    tim3.set(ARR=9, CR1=URS | CEN, EGR=1)
    assert tim3.flags == 0
    tim3.at(11)
    assert tim3.flags & UIF
    tim3.set(SR=0, CR1=UDIS | CEN, EGR=1)
    tim3.at(100)
    assert not tim3.flags & UIF


def test_a_single_pulse_ends_with_its_update(tim3: Timer) -> None:
    """RM0008 15.3.10: PWM 2, a delay of CCR1 and a pulse of ARR - CCR1 + 1."""
    tim3.output("PA6")
    tim3.set(ARR=9, CCMR1=0x70, CCR1=4, CCER=1, EGR=1)
    tim3.watch("PA6")
    tim3.set(CR1=OPM | CEN)
    tim3.at(100)
    assert [(tick, level) for tick, _, level in tim3.rows] == [(5, HIGH), (11, LOW)]
    assert tim3["CR1"] == OPM
    assert tim3["CNT"] == 0


def test_a_change_of_the_clock_goes_on_with_the_count(fake_chip: Any) -> None:
    timer = Timer(fake_chip, "TIM2")
    fake_chip.write("FLASH.ACR", 0x12)
    timer.set(PSC=7, ARR=0xFFFF, EGR=1, CR1=CEN)
    fake_chip.advance(1_000_000)
    assert timer["CNT"] == 999
    fake_chip.write("RCC.CFGR", 8 << 4)  # HPRE: HCLK / 2
    fake_chip.advance(2_000_000)
    assert timer["CNT"] == 1499


def test_a_timer_runs_twice_as_fast_as_a_divided_bus(fake_chip: Any) -> None:
    fake_chip.run_at_72_mhz()
    assert fake_chip.parts.by_name["TIM2"].clock_hz() == 72_000_000
    assert fake_chip.clocks.pclk1_hz == 36_000_000


# Outputs.

_PWM = [
    # control, mode, CCR, then the levels of CNT from tick 1 on, ARR = 4.
    (0x00, 0x60, 0, "00000 00000"), (0x00, 0x60, 2, "11000 11000"), (0x00, 0x60, 4, "11110 11110"),
    (0x00, 0x60, 5, "11111 11111"), (0x00, 0x70, 2, "00111 00111"), (0x00, 0x70, 0, "11111 11111"),
    # Down: CNT is 0, then 4, 3, 2, 1, 0.
    (DIR, 0x60, 0, "1 00001 00001"), (DIR, 0x60, 2, "1 00111 00111"), (DIR, 0x60, 4, "1 11111 11111"),
    (DIR, 0x70, 2, "0 11000 11000"),
    # Centre-aligned: 0 1 2 3 4 3 2 1.
    (0x60, 0x60, 0, "00000000 00000000"), (0x60, 0x60, 1, "10000001 10000001"), (0x60, 0x60, 2, "11000011 11000011"),
    (0x60, 0x60, 3, "11100111 11100111"), (0x60, 0x60, 4, "11111111 11111111"), (0x60, 0x70, 3, "00011000 00011000"),
]  # fmt: skip


@pytest.mark.parametrize(("control", "mode", "compare", "levels"), _PWM)
@pytest.mark.parametrize("psc", [0, 2])
def test_pwm_follows_its_table(tim3: Timer, control: int, mode: int, compare: int, levels: str, psc: int) -> None:
    """RM0008 15.3.9; the pin is looked at in the first and the last tick of each count."""
    tim3.output("PA6")
    tim3.set(ARR=4, PSC=psc, CCMR1=mode, CCR1=compare, CCER=1, EGR=1, CR1=control | CEN)
    for step, level in enumerate(levels.replace(" ", "")):
        for tick in (1 + step * (psc + 1), 1 + step * (psc + 1) + psc):
            assert tim3.at(tick).chip.pins["PA6"].level is (level == "1"), (step, tick)


def test_pwm_is_a_wave_with_its_frequency_and_duty(tim3: Timer) -> None:
    tim3.output("PA6")
    tim3.set(ARR=399, CCMR1=0x68, CCR1=100, CCER=1, EGR=1, CR1=CEN | ARPE)
    wave = tim3.at(5).chip.pins["PA6"].wave
    assert (wave.frequency_hz, wave.duty) == (20_000, 0.25)
    tim3["CCR1"] = 200
    tim3.at(401)
    wave = tim3.chip.pins["PA6"].wave
    assert (wave.frequency_hz, wave.duty) == (20_000, 0.5)
    assert tim3.chip.pins["PA6"].function == "TIM3_CH1"


_ON_MATCH = [
    (0x10, [(4, HIGH)]),
    (0x20, []),
    (0x30, [(4, HIGH), (14, LOW), (24, HIGH)]),
    (0x40, []),
    (0x50, [(0, HIGH)]),
]


@pytest.mark.parametrize(("mode", "edges"), _ON_MATCH)
def test_compare_modes_do_what_they_are_called(tim3: Timer, mode: int, edges: list[tuple[int, int]]) -> None:
    """CNT comes to 3 three ticks after counting has begun at tick 1, and every ten ticks then."""
    tim3.output("PA6")
    tim3.set(ARR=9, CCR1=3, CCER=1)
    tim3.watch("PA6")
    tim3.set(CCMR1=mode, CR1=CEN)
    tim3.at(30)
    assert [(tick, level) for tick, _, level in tim3.rows] == edges


@pytest.mark.parametrize("cms", [1, 2, 3])
def test_a_centred_match_is_flagged_in_the_directions_of_cms(tim3: Timer, cms: int) -> None:
    tim3.set(ARR=8, CCR1=3, CCR2=8, CCR3=0, CCR4=9, CR1=cms << 5 | CEN)
    found = []
    for step in range(1, 17):
        tim3.at(1 + step)
        found.append([channel for channel in range(4) if tim3["SR"] & CC1IF << channel])
        tim3["SR"] = 0
    expected: list[list[int]] = [[] for _ in range(16)]
    expected[3 - 1] += [0] if cms & 2 else []
    expected[13 - 1] += [0] if cms & 1 else []
    expected[8 - 1] += [1, 3]  # where it turns round, and beyond it
    expected[16 - 1] += [2]
    assert found == expected


def test_polarity_turns_an_output_round(tim3: Timer) -> None:
    tim3.output("PA6")
    tim3.set(ARR=9, CCMR1=0x60, CCR1=3, CCER=3, EGR=1, CR1=CEN)
    assert [tim3.at(1 + n).chip.pins["PA6"].level for n in (0, 2, 3, 9, 10)] == [False, False, True, True, False]


def test_etrf_clears_an_output_until_the_next_update(tim2: Timer) -> None:
    """OCxCE (RM0008 15.3.11): CH2 on PA1, ETR on PA0."""
    tim2.output("PA1")
    tim2.chip.pins["PA0"].drive(False)
    tim2.set(ARR=9, CCMR1=0xE000, CCR2=8, CCER=0x10, EGR=1, CR1=CEN)
    tim2.watch("PA1")
    tim2.at(3).chip.pins["PA0"].drive(True)
    tim2.at(5).chip.pins["PA0"].drive(False)
    tim2.at(20)
    assert [(tick, level) for tick, _, level in tim2.rows] == [(3, LOW), (11, HIGH), (19, LOW)]


@pytest.mark.parametrize(
    ("name", "remap", "pins"),
    [
        ("TIM1", 0 << 6, "PA8 PA9 PA10 PA11"), ("TIM2", 0 << 8, "PA0 PA1 PA2 PA3"),
        ("TIM2", 1 << 8, "PA15 PB3 PA2 PA3"),
        ("TIM2", 2 << 8, "PA0 PA1 PB10 PB11"), ("TIM2", 3 << 8, "PA15 PB3 PB10 PB11"), ("TIM3", 0, "PA6 PA7 PB0 PB1"),
        ("TIM3", 2 << 10, "PB4 PB5 PB0 PB1"), ("TIM4", 0, "PB6 PB7 PB8 PB9"),
    ],
)  # fmt: skip
def test_outputs_are_on_the_pins_that_afio_gives(fake_chip: Any, name: str, remap: int, pins: str) -> None:
    timer = Timer(fake_chip, name)
    timer.set(ARR=9, CCMR1=0x6060, CCMR2=0x6060, CCR1=2, CCR2=4, CCR3=6, CCR4=8, CCER=0x1111, EGR=1, CR1=CEN)
    if name == "TIM1":
        timer["BDTR"] = 0x8000
    fake_chip.write("AFIO.MAPR", remap | 4 << 24)
    for pin in pins.split():
        timer.output(pin)
    fake_chip.advance(50 * TICK_NS)
    waves = [fake_chip.pins[pin].wave for pin in pins.split()]
    assert [wave.duty for wave in waves] == [0.2, 0.4, 0.6, 0.8]


# TIM1.

_DEAD_TIMES = [(0, 0), (1, 1), (127, 127), (0x80, 128), (0x81, 130), (0xBF, 254), (0xC0, 256), (0xDF, 504), (0xE0, 512),
               (0xFF, 1008)]  # fmt: skip


@pytest.mark.parametrize(("dtg", "ticks"), _DEAD_TIMES)
@pytest.mark.parametrize("ckd", [0, 1, 2])
def test_dead_time_is_that_of_the_manuals_four_ranges(tim1: Timer, dtg: int, ticks: int, ckd: int) -> None:
    """RM0008 14.4.18: both rising edges come so much later, in ticks of tDTS; falling ones do not."""
    tim1.output("PA8")
    tim1.output("PB13")
    ticks <<= ckd
    tim1.set(ARR=19_999, CCMR1=0x60, CCR1=10_000, CCER=5, EGR=1, BDTR=0x8000 | dtg, CR1=ckd << 8 | CEN)
    tim1.at(15_000).watch("PA8", "PB13")
    tim1.at(35_000)
    expected = [
        (20_001, "PB13", LOW),
        (20_001 + ticks, "PA8", HIGH),
        (30_001, "PA8", LOW),
        (30_001 + ticks, "PB13", HIGH),
    ]
    assert sorted(tim1.rows) == sorted(expected)


def test_a_pulse_shorter_than_the_dead_time_does_not_come_out(tim1: Timer) -> None:
    tim1.output("PA8")
    tim1.output("PB13")
    for compare, is_seen in ((20, False), (21, True)):
        tim1.set(ARR=99, CCMR1=0x60, CCR1=compare, CCER=5, EGR=1, BDTR=0x8000 | 20, CR1=CEN)
        start = tim1.chip.now_ns // TICK_NS
        tim1.rows.clear()
        tim1.at(start + 100).watch("PA8")
        tim1.at(start + 300)
        assert bool(tim1.rows) is is_seen


#: RM0008 table 83 with MOE = 1: OSSR, CCxE, CCxNE, then what CH1 and CH1N show while OC1REF is 1; None: nothing.
_CONTROLS = [
    (0, 0, 0, None, None), (0, 0, 1, None, 1), (0, 1, 0, 1, None), (0, 1, 1, 1, 0),
    (1, 0, 0, None, None), (1, 0, 1, 0, 1), (1, 1, 0, 1, 0), (1, 1, 1, 1, 0),
]  # fmt: skip


@pytest.mark.parametrize(("ossr", "one", "other", "level", "complement"), _CONTROLS)
@pytest.mark.parametrize(("inverse", "inverse_n"), [(0, 0), (1, 0), (0, 1), (1, 1)])
def test_outputs_follow_the_table_of_control_bits(
    tim1: Timer,
    ossr: int,
    one: int,
    other: int,
    level: int | None,
    complement: int | None,
    inverse: int,
    inverse_n: int,
) -> None:
    for pin in ("PA8", "PB13"):
        tim1.output(pin)
    enables = one | inverse << 1 | other << 2 | inverse_n << 3
    tim1.set(CCMR1=0x50, CCER=enables, BDTR=0x8000 | ossr << 11)
    for pin, shown, is_inverse in (("PA8", level, inverse), ("PB13", complement, inverse_n)):
        found = tim1.chip.pins[pin]
        assert found.is_floating is (shown is None), pin
        assert shown is None or found.level is bool(shown ^ is_inverse), pin


@pytest.mark.parametrize("channel", [0, 1, 2])
@pytest.mark.parametrize("ossi", [0, 1])
@pytest.mark.parametrize(("ois", "ois_n"), [(0, 0), (1, 0), (0, 1), (1, 1)])
def test_a_break_takes_the_outputs_to_their_idle_states(
    tim1: Timer, ossi: int, ois: int, ois_n: int, channel: int
) -> None:
    """RM0008 14.3.12: inactive at once, OISx after the dead time, and never both active."""
    chip, (one, other) = tim1.chip, (f"PA{8 + channel}", f"PB{13 + channel}")
    idle = (ois << 8 | ois_n << 9) << 2 * channel
    for pin in (one, other):
        tim1.output(pin)
    chip.pins["PB12"].drive(False)
    tim1.set(CR2=idle, CCMR1=0x5050, CCMR2=0x50, CCER=5 << 4 * channel, DIER=0x80, BDTR=0xB000 | ossi << 10 | 16)
    assert (chip.pins[one].level, chip.pins[other].level) == (False, False)  # the dead time of the switching-on
    tim1.at(100)
    assert (chip.pins[one].level, tim1.flags & BIF) == (True, 0)
    chip.pins["PB12"].drive(True)
    assert (tim1["BDTR"] & 0x8000, tim1.flags & BIF, chip.irqs[24]) == (0, BIF, True)
    for tick, is_idle in ((100, False), (115, False), (116, True)):
        tim1.at(tick)
        for pin, wanted in ((one, ois), (other, ois_n)):
            assert chip.pins[pin].is_floating is not ossi, pin
            assert chip.pins[pin].level is bool(ossi and is_idle and wanted and not (ois and ois_n)), (pin, tick)
    tim1["SR"] = 0
    assert tim1.flags & BIF, "the break is still there"
    tim1["BDTR"] = 0xB000
    assert not tim1["BDTR"] & 0x8000
    chip.pins["PB12"].drive(False)
    tim1.set(SR=0, BDTR=0xB000)
    assert (tim1.flags, tim1["BDTR"] & 0x8000, chip.irqs[24]) == (0, 0x8000, False)


def test_aoe_switches_the_outputs_on_with_the_next_update(tim1: Timer) -> None:
    tim1.set(ARR=9, BDTR=0x4000, CR1=CEN, EGR=0x80)
    assert tim1.at(10)["BDTR"] == 0x4000
    assert tim1.at(11)["BDTR"] == 0xC000


def test_preloaded_control_bits_wait_for_a_commutation(tim1: Timer) -> None:
    """CCPC (RM0008 14.3.14), of the channels with two outputs alone."""
    for pin in ("PA8", "PA11"):
        tim1.output(pin)
    tim1.set(BDTR=0x8000, CR2=1, CCMR1=0x50, CCMR2=0x5000, CCER=0x1001, DIER=0x20)
    assert (tim1.chip.pins["PA8"].is_floating, tim1.chip.pins["PA11"].level) == (True, True)
    tim1["EGR"] = 0x20
    assert tim1.chip.pins["PA8"].level
    assert (tim1.flags, tim1.chip.irqs[26]) == (COMIF, True)


# Inputs.


def _feed(timer: Timer, pin: str, edges: list[tuple[int, int]]) -> None:
    for tick, level in edges:
        timer.at(tick).chip.pins[pin].drive(level)


@pytest.mark.parametrize(
    ("polarity", "prescaler", "captured"),
    [(0, 0, [9, 29, 49, 69]), (1, 0, [19, 39, 59, 79]), (0, 1, [29, 69]), (0, 2, [69]), (1, 2, [79]), (0, 3, [])],
)
def test_captures_take_the_count_of_their_edges(
    tim3: Timer, polarity: int, prescaler: int, captured: list[int]
) -> None:
    """Edges up at ticks 10, 30, 50, 70 and down at 20, 40, 60, 80; CNT is 0 at tick 1."""
    tim3.chip.pins["PA6"].drive(False)
    tim3.set(CCMR1=0x01 | prescaler << 2, CCER=1 | polarity << 1, DIER=2, CR1=CEN)
    found = []
    for tick in range(10, 90, 10):
        tim3.at(tick).chip.pins["PA6"].drive(tick % 20 != 0)
        if tim3.chip.irqs[29]:
            found.append(tim3["CCR1"])
            assert not tim3.chip.irqs[29]
    assert found == captured


def test_a_capture_over_an_unread_one_is_reported(tim3: Timer) -> None:
    tim3.chip.pins["PA6"].drive(False)
    tim3.set(CCMR1=0x01, CCER=1, CR1=CEN)
    _feed(tim3, "PA6", [(10, 1), (20, 0)])
    assert tim3.flags & (CC1IF | CC1OF) == CC1IF
    _feed(tim3, "PA6", [(30, 1)])
    assert (tim3.flags & (CC1IF | CC1OF), tim3["CCR1"]) == (CC1IF | CC1OF, 29)
    assert tim3.flags & (CC1IF | CC1OF) == CC1OF
    tim3["SR"] = 0xFFFF & ~CC1OF
    assert not tim3.flags & CC1OF


#: ICxF: samples that agree, and ticks between them with CKD = 0 (RM0008 15.4.7).
_FILTERS = [(0, 1), (2, 1), (4, 1), (8, 1), (6, 2), (8, 2), (6, 4), (8, 4), (6, 8), (8, 8), (5, 16), (6, 16), (8, 16),
            (5, 32), (6, 32), (8, 32)]  # fmt: skip


@pytest.mark.parametrize("mode", range(1, 16))
@pytest.mark.parametrize("ckd", [0, 2])
def test_a_filter_lets_through_what_lasts_for_its_samples(tim3: Timer, mode: int, ckd: int) -> None:
    samples, period = _FILTERS[mode]
    period <<= ckd if mode > 3 else 0
    tim3.chip.pins["PA6"].drive(False)
    tim3.set(CCMR1=0x01 | mode << 4, CCER=1, CR1=ckd << 8 | CEN)
    start = 64 * 128  # a multiple of every period: a level that comes there is sampled one period later
    _feed(tim3, "PA6", [(start, 1), (start + samples * period - 1, 0)])
    tim3.at(start + 10_000)
    assert not tim3.flags & CC1IF, "it was there for one sample too few"
    _feed(tim3, "PA6", [(2 * start + 16384, 1)])
    tim3.at(2 * start + 16384 + samples * period - 1)
    assert not tim3.flags & CC1IF
    tim3.at(2 * start + 16384 + samples * period)
    assert tim3.flags & CC1IF
    assert tim3["CCR1"] == (2 * start + 16384 + samples * period - 1) & 0xFFFF


def test_pwm_input_measures_period_and_pulse(tim3: Timer) -> None:
    """RM0008 15.3.6: CC1 on TI1 rising, CC2 on TI1 falling, reset by TI1FP1: CCR1 is the period, CCR2 the pulse."""
    tim3.chip.pins["PA6"].drive(False)
    tim3.set(CCMR1=0x0201, CCER=0x31, SMCR=0x54, CR1=CEN)
    for n in range(3):
        _feed(tim3, "PA6", [(100 + 80 * n, 1), (130 + 80 * n, 0)])
    assert (tim3["CCR1"], tim3["CCR2"]) == (80, 30)
    assert tim3.flags & TIF


def test_pwm_input_measures_a_wave_of_another_timer(fake_chip: Any) -> None:
    """TIM1_CH2N and TIM3_CH3 meet at PB0."""
    maker, meter = Timer(fake_chip, "TIM1"), Timer(fake_chip, "TIM3")
    fake_chip.write("AFIO.MAPR", 1 << 6)
    maker.output("PB0")
    maker.set(ARR=399, CCMR1=0x6000, CCR2=100, CCER=0x40, EGR=1, BDTR=0x8000, CR1=CEN)
    meter.set(CCMR2=0x0201, CCER=0x3100, CR1=CEN)
    meter.at(2000)
    first = meter["CCR3"], meter["CCR4"]
    meter.at(2400)
    second = meter["CCR3"], meter["CCR4"]
    assert (second[0] - first[0], second[1] - first[1], (second[1] - second[0]) % 400) == (400, 400, 100)


def test_the_xor_of_three_inputs_has_an_edge_at_each_of_theirs(tim3: Timer) -> None:
    for pin in ("PA6", "PA7", "PB0"):
        tim3.chip.pins[pin].drive(False)
    tim3.set(CR2=0x80, SMCR=0x44, CCMR1=0x03, CCER=1, CR1=CEN)  # Hall sensors: TI1F_ED resets, TRC captures
    found = []
    for tick, pin, level in ((11, "PA6", 1), (31, "PB0", 1), (61, "PA7", 1), (71, "PA6", 0)):
        tim3.at(tick).chip.pins[pin].drive(level)
        found.append(tim3["CCR1"])
    assert found == [10, 20, 30, 10]


# The encoder: RM0008 table 87.

#: Mode, the input that has an edge, its edge, the level of the other: 1 up, -1 down, 0 no count.
_DIRECTIONS = {
    # counting on TI1: high level on TI2: rising down, falling up; low level: rising up, falling down.
    (0, 1, 1): -1, (0, 0, 1): 1, (0, 1, 0): 1, (0, 0, 0): -1,
    # counting on TI2: high level on TI1: rising up, falling down; low level: rising down, falling up.
    (1, 1, 1): 1, (1, 0, 1): -1, (1, 1, 0): -1, (1, 0, 0): 1,
}  # fmt: skip
_COUNTED = {1: {1}, 2: {0}, 3: {0, 1}}


@pytest.mark.parametrize("mode", [1, 2, 3])
@pytest.mark.parametrize(("which", "edge", "other"), _DIRECTIONS)
@pytest.mark.parametrize("inverse", [0, 1, 2, 3])
def test_the_encoder_counts_as_the_manuals_table_says(
    tim3: Timer, mode: int, which: int, edge: int, other: int, inverse: int
) -> None:
    pins = ("PA6", "PA7")
    raw = [level ^ (inverse >> n & 1) for n, level in enumerate((edge ^ 1, other) if which == 0 else (other, edge ^ 1))]
    for pin, level in zip(pins, raw, strict=True):
        tim3.chip.pins[pin].drive(level)
    tim3.set(CCMR1=0x0101, CCER=(inverse & 1) << 1 | (inverse >> 1) << 5, SMCR=mode, ARR=99, CNT=50, CR1=CEN)
    tim3.at(10).chip.pins[pins[which]].drive(not raw[which])
    step = _DIRECTIONS[which, edge, other]
    assert tim3["CNT"] == 50 + (step if which in _COUNTED[mode] else 0)
    assert bool(tim3["CR1"] & DIR) is (step < 0)


@pytest.mark.parametrize(("is_forward", "counts"), [(True, [1, 2, 3, 0, 1]), (False, [3, 2, 1, 0, 3])])
def test_an_encoder_wraps_at_its_limit_with_an_update(tim3: Timer, is_forward: bool, counts: list[int]) -> None:
    for pin in ("PA6", "PA7"):
        tim3.chip.pins[pin].drive(False)
    tim3.set(ARR=3, SMCR=3, EGR=1, SR=0, CR1=CEN)
    order = ("PA6", "PA7") if is_forward else ("PA7", "PA6")
    found = []
    for step in range(5):
        tim3.at(10 + step).chip.pins[order[step % 2]].drive(step % 4 < 2)
        found.append(tim3["CNT"])
        wrapped = step == 3 if is_forward else step in {0, 4}
        assert bool(tim3["SR"] & UIF) is wrapped, step
        tim3["SR"] = 0
    assert found == counts


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_an_encoder_does_not_count_edges_of_the_third_input(tim3: Timer, mode: int) -> None:
    for pin in ("PA6", "PA7", "PB0"):
        tim3.chip.pins[pin].drive(False)
    tim3.set(CCMR2=1, CCER=1 << 8, SMCR=mode, ARR=99, CNT=50, CR1=CEN)
    for tick in (10, 12, 14):
        tim3.at(tick).chip.pins["PB0"].drive(tick != 12)
        assert tim3["CNT"] == 50
    assert tim3["CCR3"] == 50, "it captures"


def test_jitter_on_one_input_comes_and_goes(tim3: Timer) -> None:
    for pin in ("PA6", "PA7"):
        tim3.chip.pins[pin].drive(False)
    tim3.set(SMCR=3, CNT=100, CR1=CEN)
    for tick in range(10, 30):
        tim3.at(tick).chip.pins["PA6"].drive(tick % 2 == 0)
        assert tim3["CNT"] == 100 + (tick % 2 == 0)


# Slave modes and chains.


def test_gated_counts_while_the_trigger_is_high(tim3: Timer) -> None:
    tim3.chip.pins["PA6"].drive(False)
    tim3.set(SMCR=0x55, CR1=CEN)
    assert tim3.at(100)["CNT"] == 0
    _feed(tim3, "PA6", [(100, 1), (130, 0)])
    assert (tim3.at(200)["CNT"], tim3.flags & TIF) == (29, TIF)


def test_a_trigger_starts_the_counter(tim3: Timer) -> None:
    tim3.chip.pins["PA7"].drive(False)
    tim3.set(SMCR=0x66, DIER=0x40)
    assert tim3.at(50)["CNT"] == 0
    _feed(tim3, "PA7", [(50, 1)])
    assert (tim3["CR1"], tim3.chip.irqs[29]) == (CEN, True)
    assert tim3.at(61)["CNT"] == 10


def test_an_external_clock_counts_edges_through_the_prescaler(tim3: Timer) -> None:
    tim3.chip.pins["PA7"].drive(False)
    tim3.set(PSC=2, ARR=3, EGR=1, SR=0, SMCR=0x67, CR1=CEN)
    found = []
    for n in range(13):
        _feed(tim3, "PA7", [(10 + 2 * n, 1), (11 + 2 * n, 0)])
        found.append(tim3["CNT"])
    assert found == [0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 0, 0]
    assert tim3.flags & UIF


@pytest.mark.parametrize(("etps", "division"), [(0, 1), (1, 2), (2, 4), (3, 8)])
@pytest.mark.parametrize("etp", [0, 1])
def test_etr_counts_behind_its_polarity_and_prescaler(tim2: Timer, etps: int, division: int, etp: int) -> None:
    tim2.chip.pins["PA0"].drive(etp)
    tim2.set(SMCR=0x4000 | etps << 12 | etp << 15, CR1=CEN)
    for n in range(32):
        _feed(tim2, "PA0", [(10 + 2 * n, 1 - etp), (11 + 2 * n, etp)])
    assert tim2["CNT"] == 32 // division


def test_one_timer_is_the_prescaler_of_another(fake_chip: Any) -> None:
    """RM0008 15.3.15: TRGO of TIM3 with its updates clocks TIM2 by ITR2."""
    slave, master = Timer(fake_chip, "TIM2"), Timer(fake_chip, "TIM3")
    slave.set(SMCR=0x27, CR1=CEN)
    master.set(ARR=9, CR2=0x20, CR1=CEN)
    assert slave.at(100)["CNT"] == 9
    assert slave.at(101)["CNT"] == 10


@pytest.mark.parametrize(
    ("slave", "master", "itr"),
    [
        ("TIM1", "TIM2", 1), ("TIM1", "TIM3", 2), ("TIM1", "TIM4", 3), ("TIM2", "TIM1", 0), ("TIM2", "TIM3", 2),
        ("TIM2", "TIM4", 3), ("TIM3", "TIM1", 0), ("TIM3", "TIM2", 1), ("TIM3", "TIM4", 3), ("TIM4", "TIM1", 0),
        ("TIM4", "TIM2", 1), ("TIM4", "TIM3", 2),
    ],
)  # fmt: skip
def test_internal_triggers_are_those_of_the_manuals_tables(fake_chip: Any, slave: str, master: str, itr: int) -> None:
    """Tables 82 and 86: the slave counts while the master is enabled."""
    one, other = Timer(fake_chip, slave), Timer(fake_chip, master)
    one.set(SMCR=itr << 4 | 5, CR1=CEN)
    other["CR2"] = 0x10
    assert one.at(10)["CNT"] == 0
    other["CR1"] = CEN
    assert one.at(31)["CNT"] == 20
    other["CR1"] = 0
    assert one.at(50)["CNT"] == 20


def test_timers_that_trigger_each_other_come_to_an_end(fake_chip: Any) -> None:
    """TIM2 resets TIM3, whose reset resets TIM2: silicon goes round with its clocks, here it is taken once."""
    one, other = Timer(fake_chip, "TIM2"), Timer(fake_chip, "TIM3")
    one.set(SMCR=0x24, CR1=CEN)
    other.set(SMCR=0x14, CR1=CEN)
    one.at(10)
    one["EGR"] = 1
    assert (one["CNT"], other["CNT"]) == (0, 0)
    assert one.at(20)["CNT"] == 10


# Requests of DMA, and bursts.


@pytest.fixture
def requests(monkeypatch: pytest.MonkeyPatch, make_fake_chip: Callable[[], Any]) -> Callable[..., Any]:
    """A chip on which some outputs of TIM3 lead to a line each, which leads nowhere, and the ticks of their pulses."""

    def make(*outputs: str) -> tuple[Timer, dict[str, list[int]]]:
        modelled = {name for _, name in stm32f103.PERIPHERALS}
        nobody = next(name for name in stm32f103.BASES if name not in modelled)
        wiring = {output: (f"{nobody}.test{n}",) for n, output in enumerate(outputs)}
        kept = {row: ends for row, ends in stm32f103.WIRING.items() if row not in wiring}
        monkeypatch.setattr(stm32f103, "WIRING", kept | wiring)
        chip = make_fake_chip()
        pulses: dict[str, list[int]] = {output: [] for output in outputs}
        numbers = {80 + stm32f103.line_of(output): output for output in outputs}

        def take(rows: bytes) -> None:
            for ns, pin, _, wire, *_ in EDGE.iter_unpack(rows):
                if wire == HIGH:
                    pulses[numbers[pin]].append(ns // TICK_NS)

        chip.pins.subscribe_pins([], take, lines=[stm32f103.line_of(output) for output in outputs])
        return Timer(chip, "TIM3"), pulses

    return make


def test_requests_come_with_updates_and_matches(requests: Callable[..., Any]) -> None:
    timer, pulses = requests("TIM3.up_dma", "TIM3.cc1_dma", "TIM3.cc2_dma")
    timer.set(ARR=9, CCR1=3, CCR2=5, DIER=0x0300, CR1=CEN)
    timer.at(25)
    assert pulses == {"TIM3.up_dma": [11, 21], "TIM3.cc1_dma": [4, 14, 24], "TIM3.cc2_dma": []}
    timer.set(DIER=0x0200, CR2=8)
    timer.at(40)
    assert pulses["TIM3.cc1_dma"] == [4, 14, 24, 31]
    assert pulses["TIM3.up_dma"] == [11, 21]


def test_a_trigger_asks_for_dma(requests: Callable[..., Any]) -> None:
    timer, pulses = requests("TIM3.trig_dma")
    timer.chip.pins["PA6"].drive(False)
    timer.set(SMCR=0x54, DIER=0x4000, CR1=CEN)
    _feed(timer, "PA6", [(10, 1), (12, 0), (20, 1)])
    timer.at(30)
    assert pulses == {"TIM3.trig_dma": [10, 20]}


def test_a_burst_goes_through_its_registers_and_asks_for_each(requests: Callable[..., Any]) -> None:
    """DBA = 13 (CCR1), DBL = 2: three words by DMAR are CCR1 to CCR3 (RM0008 15.4.17)."""
    timer, pulses = requests("TIM3.up_dma")
    timer.set(ARR=9, DCR=2 << 8 | 13, DIER=0x100, CR1=CEN)
    for period in (1, 2):
        timer.at(1 + 10 * period)
        timer.chip.deliver()
        assert len(pulses["TIM3.up_dma"]) == 3 * period - 2
        for n in (1, 2, 3):
            timer["DMAR"] = 100 * period + n
        timer.chip.deliver()
        assert len(pulses["TIM3.up_dma"]) == 3 * period
        assert [timer[f"CCR{n}"] for n in (1, 2, 3, 4)] == [100 * period + 1, 100 * period + 2, 100 * period + 3, 0]
    timer["DCR"] = 1 << 8 | 13
    assert [timer["DMAR"] for _ in range(4)] == [201, 202, 201, 202]


# State.


def test_a_snapshot_goes_on_in_the_same_way(make_fake_chip: Callable[[], Any]) -> None:
    chips = [make_fake_chip(), make_fake_chip()]
    seen = []
    for chip in chips:
        timer = Timer(chip, "TIM1")
        timer.output("PA8")
        timer.set(ARR=99, PSC=1, CCMR1=0x68, CCR1=30, CCER=1, EGR=1, BDTR=0x8000, DIER=1, CR1=CEN | ARPE)
        timer.at(777)
        timer["CCR1"] = 60
    chips[1].parts.restore(chips[0].parts.snapshot())
    for chip in chips:
        timer = Timer(chip, "TIM1")
        timer.watch("PA8")
        timer.at(2_000)
        seen.append((timer.rows, timer["CNT"], timer["SR"], chip.parts.by_name["TIM1"].held))
    assert seen[0] == seen[1]
