"""TIM: where an input comes from, its polarity, the tick of each, and what follows from its own outputs."""

from typing import Any

import pytest

from bluepill_sim.fabric.subscriptions import HIGH, LOW
from tests.bluepill_sim.peripherals.tim.test_tim import (
    BIF,
    CC1IF,
    CC1OF,
    CC2IF,
    CEN,
    DIR,
    TICK_NS,
    TIF,
    Timer,
    tim1,
    tim2,
    tim3,
)

__all__ = ["tim1", "tim2", "tim3"]
#: Of TIM3: CH1 to CH4.
PINS = ("PA6", "PA7", "PB0", "PB1")
RESET, GATED, START, CLOCK = 4, 5, 6, 7


def _low(timer: Timer, *pins: str) -> None:
    for pin in pins:
        timer.chip.pins[pin].drive(False)


# Triggers.


@pytest.mark.parametrize("inverse", [0, 1, 2, 3])
@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("mode", [RESET, GATED, START, CLOCK])
def test_a_trigger_of_ti1_or_ti2_has_the_polarity_of_its_own_channel(
    tim3: Timer, mode: int, which: int, inverse: int
) -> None:
    """RM0008 15.4.3, TS: TI1FP1 and TI2FP2."""
    _low(tim3, *PINS)
    is_inverse = bool(inverse >> which & 1)
    tim3.chip.pins[PINS[which]].drive(is_inverse)
    tim3.set(CCER=(inverse & 1) << 1 | (inverse >> 1) << 5, SMCR=(5 + which) << 4 | mode, CNT=100)
    tim3["CR1"] = CEN * (mode != START)
    tim3.at(11).chip.pins[PINS[which ^ 1]].drive(True)
    tim3.at(12).chip.pins[PINS[which ^ 1]].drive(False)
    assert (tim3.flags & TIF, tim3["CNT"]) == (0, 111 if mode == RESET else 100)
    tim3.at(21).chip.pins[PINS[which]].drive(not is_inverse)
    assert (tim3.flags & TIF, tim3["CNT"]) == (TIF, {RESET: 0, CLOCK: 101}.get(mode, 100))
    assert tim3.at(31)["CNT"] == {RESET: 10, GATED: 109, START: 109, CLOCK: 101}[mode]
    tim3["SR"] = 0
    tim3.chip.pins[PINS[which]].drive(is_inverse)
    assert tim3.flags & TIF == (TIF if mode == GATED else 0), "the other edge"


@pytest.mark.parametrize("etp", [0, 1])
def test_a_trigger_of_etr_has_the_polarity_of_etp(tim2: Timer, etp: int) -> None:
    tim2.chip.pins["PA0"].drive(etp)
    tim2.set(SMCR=etp << 15 | 7 << 4 | RESET, CCER=0x22, CR1=CEN)
    tim2.at(20).chip.pins["PA0"].drive(not etp)
    assert (tim2.flags & TIF, tim2["CNT"]) == (TIF, 0)
    tim2["SR"] = 0
    tim2.at(30).chip.pins["PA0"].drive(etp)
    assert (tim2.flags & TIF, tim2["CNT"]) == (0, 10)


@pytest.mark.parametrize("inverse", [0, 1])
def test_ti1f_ed_is_both_edges_of_ti1_and_of_no_other(tim3: Timer, inverse: int) -> None:
    _low(tim3, *PINS)
    tim3.set(CCER=inverse << 1, SMCR=4 << 4 | RESET, CR1=CEN)
    for tick, pin, level in ((10, 0, True), (20, 0, False), (30, 1, True), (40, 2, True), (50, 0, True)):
        tim3.at(tick).chip.pins[PINS[pin]].drive(level)
        assert (tim3.flags & TIF, tim3["CNT"]) == ((TIF, 0) if pin == 0 else (0, tick - 20)), tick
        tim3["SR"] = 0


def test_a_level_that_is_there_when_it_is_chosen_is_no_edge(tim3: Timer) -> None:
    _low(tim3, *PINS)
    tim3.chip.pins["PA7"].drive(True)
    tim3.set(SMCR=6 << 4 | RESET, CR1=CEN)
    assert (tim3.at(11).flags & TIF, tim3["CNT"]) == (0, 10)
    tim3["CCER"] = 2 << 4
    tim3["CCER"] = 0
    assert (tim3.at(21).flags & TIF, tim3["CNT"]) == (0, 20)


@pytest.mark.parametrize("channel", [0, 1, 2, 3])
@pytest.mark.parametrize("selection", [0, 1, 2, 3, 4, 5])
def test_trc_captures_on_every_channel_that_is_on_by_internal_triggers_and_ti1f_ed_alone(
    fake_chip: Any, channel: int, selection: int
) -> None:
    """RM0008 15.4.7, CCxS = 3: only of a trigger that TS has as an internal one, and of TI1F_ED."""
    timer = Timer(fake_chip, "TIM3")
    master = Timer(fake_chip, {0: "TIM1", 3: "TIM4"}.get(selection, "TIM2"))
    _low(timer, *PINS)
    register = ("CCMR1", "CCMR2")[channel // 2]
    timer[register] = 3 << 8 * (channel % 2)
    timer.set(SMCR=selection << 4, CCER=1 << 4 * channel, CR1=CEN)
    master["CR2"] = 1 << 4
    timer.at(11)
    master["CR1"] = CEN
    timer.chip.pins["PA6"].drive(True)
    is_caught = selection in {0, 1, 3, 4}
    assert timer.flags & 0xFF == (CC1IF << channel if is_caught else 0)
    assert timer[f"CCR{channel + 1}"] == (10 if is_caught else 0)


# Captures.


@pytest.mark.parametrize("channel", [0, 1, 2, 3])
@pytest.mark.parametrize("source", [1, 2])
@pytest.mark.parametrize("inverse", [0, 1])
def test_a_channel_captures_its_own_input_or_its_neighbours_and_no_other(
    tim3: Timer, channel: int, source: int, inverse: int
) -> None:
    """RM0008 15.4.7, CCxS: 1 is the channel's own input, 2 that of the other one of its pair."""
    pin = PINS[channel ^ (source - 1)]
    _low(tim3, *PINS)
    tim3[("CCMR1", "CCMR2")[channel // 2]] = source << 8 * (channel % 2)
    tim3.set(CCER=(1 | inverse << 1) << 4 * channel, CR1=CEN)
    for n, other in enumerate(each for each in PINS if each != pin):
        tim3.at(10 + 2 * n).chip.pins[other].drive(True)
        tim3.at(11 + 2 * n).chip.pins[other].drive(False)
    assert tim3.flags == 0
    tim3.at(31).chip.pins[pin].drive(True)
    assert tim3.flags == (0 if inverse else CC1IF << channel)
    tim3.at(41).chip.pins[pin].drive(False)
    assert tim3.flags == CC1IF << channel
    assert tim3[f"CCR{channel + 1}"] == (40 if inverse else 30)


@pytest.mark.parametrize("channel", [0, 1, 2, 3])
def test_each_channel_has_its_overcapture(tim3: Timer, channel: int) -> None:
    _low(tim3, *PINS)
    tim3[("CCMR1", "CCMR2")[channel // 2]] = 1 << 8 * (channel % 2)
    tim3.set(CCER=1 << 4 * channel, CR1=CEN)
    for tick, level, flags in ((10, 1, CC1IF), (20, 0, CC1IF), (30, 1, CC1IF | CC1OF)):
        tim3.at(tick).chip.pins[PINS[channel]].drive(level)
        assert tim3.flags == flags << channel


@pytest.mark.parametrize("channel", [0, 1, 2, 3])
def test_a_channel_that_is_switched_off_forgets_the_edges_of_its_prescaler(tim3: Timer, channel: int) -> None:
    """RM0008 15.4.7, IC1PSC: the prescaler is reset with CCxE."""
    pin = tim3.chip.pins[PINS[channel]]
    _low(tim3, *PINS)
    tim3[("CCMR1", "CCMR2")[channel // 2]] = (1 | 1 << 2) << 8 * (channel % 2)
    tim3.set(CCER=1 << 4 * channel, CR1=CEN)
    tim3.at(10)
    pin.drive(True)
    pin.drive(False)
    tim3["CCER"] = 0
    tim3["CCER"] = 1 << 4 * channel
    pin.drive(True)
    pin.drive(False)
    assert tim3.flags == 0, "the first of two"
    pin.drive(True)
    assert tim3.flags == CC1IF << channel


# What it hears of its own outputs.


@pytest.mark.parametrize("level", [True, False])
def test_an_edge_of_its_own_output_is_captured_a_tick_later_and_once(tim3: Timer, level: bool) -> None:
    """CH1 is forced to a level, which CH2 captures as TI1 (CC2S = 2)."""
    tim3.output("PA6")
    tim3.set(CCMR1=(4 if level else 5) << 4 | 2 << 8, CCER=0x11 | (0 if level else 2) << 4, CR1=CEN)
    tim3.at(20)["CCMR1"] = (5 if level else 4) << 4 | 2 << 8
    assert tim3.chip.pins["PA6"].level is level
    assert tim3.flags & CC2IF == 0
    tim3.chip.advance(21 * TICK_NS - 1)
    assert tim3.flags & CC2IF == 0
    assert tim3.at(21).flags & CC2IF == CC2IF
    assert tim3["CCR2"] == 20
    assert tim3.at(1000).flags & (CC2IF | CC1OF << 1) == 0


def test_an_output_that_resets_its_own_counter_is_heard_a_tick_later(tim3: Timer) -> None:
    """CH1 is TI1FP1 too: each match forces no edge but the one that the mode makes."""
    tim3.output("PA6")
    tim3.set(SMCR=5 << 4 | RESET, CCMR1=1 << 4, CCR1=10, CCER=1, CR1=CEN)
    tim3.watch("PA6")
    tim3.at(11)
    assert (tim3.rows, tim3.flags & TIF) == ([(11, "PA6", HIGH)], 0)
    assert (tim3.at(12).flags & TIF, tim3["CNT"]) == (TIF, 0)
    assert tim3.at(20)["CNT"] == 8
    assert tim3.rows == [(11, "PA6", HIGH)]


# Break.


@pytest.mark.parametrize("bkp", [0, 1])
@pytest.mark.parametrize("bke", [0, 1])
def test_a_break_comes_with_the_level_of_bkp_where_it_is_enabled(tim1: Timer, bke: int, bkp: int) -> None:
    """RM0008 14.4.18."""
    pin = tim1.chip.pins["PB12"]
    pin.drive(not bkp)
    tim1["BDTR"] = 0x8000 | bkp << 13 | bke << 12
    assert (tim1.flags & BIF, tim1["BDTR"] >> 15) == (0, 1)
    pin.drive(bool(bkp))
    assert (tim1.flags & BIF, tim1["BDTR"] >> 15) == (BIF * bke, 1 - bke)
    tim1["SR"] = 0
    assert tim1.flags & BIF == BIF * bke
    pin.drive(not bkp)
    assert (tim1.flags & BIF, tim1["BDTR"] >> 15) == (BIF * bke, 1 - bke), "it stays until software sets MOE"
    tim1["SR"] = 0
    assert tim1.flags & BIF == 0


def test_a_level_of_break_that_is_there_as_it_is_enabled_breaks_at_once(tim1: Timer) -> None:
    tim1.chip.pins["PB12"].drive(True)
    tim1["BDTR"] = 0x8000
    tim1["BDTR"] = 0xB000
    assert (tim1.flags & BIF, tim1["BDTR"] >> 15) == (BIF, 0)
    tim1["BDTR"] = 0
    tim1["SR"] = 0
    assert tim1.flags & BIF == 0


def test_no_other_timer_has_a_break(tim3: Timer) -> None:
    _low(tim3, *PINS)
    for pin in ("PB12", "PA0", "PA6"):
        tim3.chip.pins[pin].drive(True)
    tim3.chip.parts.by_name["TIM3"].write(0x44, 4, 0xB000)
    tim3["EGR"] = 0xA0
    tim3.at(100)
    assert tim3.flags == 0


# Filters: the sampling clocks of ETF, and what a bounce does to the count of samples.


@pytest.mark.parametrize(
    ("etf", "ckd", "ticks"), [(0, 0, 0), (1, 0, 2), (3, 2, 8), (4, 1, 24), (8, 0, 48), (15, 0, 256)]
)
def test_etf_holds_an_edge_back_for_its_samples(tim2: Timer, etf: int, ckd: int, ticks: int) -> None:
    tim2.chip.pins["PA0"].drive(False)
    tim2.set(SMCR=0x4000 | etf << 8, CR1=ckd << 8 | CEN)
    tim2.at(8192).chip.pins["PA0"].drive(True)
    if ticks:
        assert tim2.at(8192 + ticks - 1)["CNT"] == 0
    assert tim2.at(8192 + ticks)["CNT"] == 1


def test_a_bounce_begins_the_samples_anew(tim3: Timer) -> None:
    """ICxF = 3: eight samples of CK_INT in a row."""
    pin = tim3.chip.pins["PA6"]
    pin.drive(False)
    tim3.set(CCMR1=0x31, CCER=1, CR1=CEN)
    for tick, level in ((100, True), (107, False), (108, True)):
        tim3.at(tick)
        pin.drive(level)
    assert tim3.at(115).flags & CC1IF == 0
    assert tim3.at(116).flags & CC1IF
    tim3["SR"] = 0
    tim3.at(120)
    pin.drive(False)
    assert tim3.at(200).flags & CC1IF == 0
    pin.drive(True)
    assert tim3.at(207).flags & CC1IF == 0
    assert tim3.at(208).flags & CC1IF


@pytest.mark.parametrize("etps", [0, 1, 2, 3])
def test_etr_behind_its_prescaler_triggers_at_every_so_many_edges(tim2: Timer, etps: int) -> None:
    tim2.chip.pins["PA0"].drive(False)
    tim2.set(SMCR=etps << 12 | 7 << 4 | RESET, CR1=CEN)
    found = []
    for n in range(16):
        tim2.at(10 + 2 * n).chip.pins["PA0"].drive(True)
        found += [n] if tim2.flags & TIF else []
        tim2["SR"] = 0
        tim2.at(11 + 2 * n).chip.pins["PA0"].drive(False)
    step = 1 << etps
    assert found == list(range(max(step // 2 - 1, 0), 16, step))


# A new CCRx of a wave that is going on.


@pytest.mark.parametrize("control", [0, DIR, 1 << 5])
@pytest.mark.parametrize("mode", [6, 7])
@pytest.mark.parametrize("polarity", [0, 1])
@pytest.mark.parametrize("psc", [0, 2])
def test_a_new_compare_value_is_in_the_wave_at_once_whether_or_not_its_flag_is_up(
    make_fake_chip: Any, control: int, mode: int, polarity: int, psc: int
) -> None:
    """With the flag up nobody sees a match, and the wave alone is changed; the edges are those of the long way."""
    rows = []
    for is_flag_up in (False, True):
        timer = Timer(make_fake_chip(), "TIM3")
        timer.output("PA6")
        timer.set(ARR=9, PSC=psc, CCMR1=mode << 4, CCR1=3, CCER=1 | polarity << 1, EGR=1, CR1=control | CEN)
        levels = []
        tick = 40
        for compare in (4, 7, 1, 8, 0, 5, 9, 2, 10, 6, 12, 3):
            tick += 37
            timer.at(tick)
            if is_flag_up:
                timer["EGR"] = 2
            else:
                timer["SR"] = 0
            timer["CCR1"] = compare
            for n in range(70):
                level = timer.at(tick + n).chip.pins["PA6"].level
                levels.append(level)
                if control == 0:
                    assert level is ((timer["CNT"] < compare) is (mode == 6)) ^ bool(polarity), (compare, n)
            tick += 70
        rows.append(levels)
    assert rows[0] == rows[1]


def test_the_edges_of_a_wave_that_is_changed_are_those_of_its_new_compare_value(tim3: Timer) -> None:
    tim3.output("PA6")
    tim3.set(ARR=9, CCMR1=6 << 4, CCR1=3, CCER=1, EGR=3, CR1=CEN)
    tim3.watch("PA6")
    tim3.at(22)["CCR1"] = 7
    tim3.at(45)["CCR1"] = 2
    tim3.at(60)
    assert [(tick, level) for tick, _, level in tim3.rows] == [
        *((4, LOW), (11, HIGH), (14, LOW), (21, HIGH), (28, LOW), (31, HIGH), (38, LOW), (41, HIGH), (45, LOW)),
        *((51, HIGH), (53, LOW)),
    ]


# What is listened to, and when.

_TI1, _TI2, _TI3, _TI4, _ETR, _BKIN = 1, 2, 4, 8, 1 << 7, 1 << 8
#: Registers, and the pins from which something follows then.
_LISTENED: list[tuple[dict[str, int], int]] = [
    ({}, 0),
    ({"CCMR1": 0x0101, "CCMR2": 0x0101}, 0),
    ({"CCMR1": 0x0101, "CCER": 0x01}, _TI1),
    ({"CCMR1": 0x0101, "CCER": 0x10}, _TI2),
    ({"CCMR1": 0x0201, "CCER": 0x11}, _TI1),
    ({"CCMR1": 0x0102, "CCER": 0x01}, _TI2),
    ({"CCMR2": 0x0101, "CCER": 0x0100}, _TI3),
    ({"CCMR2": 0x0101, "CCER": 0x1000}, _TI4),
    ({"CCMR2": 0x0202, "CCER": 0x0100}, _TI4),
    ({"CCMR2": 0x0202, "CCER": 0x1000}, _TI3),
    ({"CCMR1": 0x80}, _ETR),
    ({"CCMR2": 0x8000}, _ETR),
    *(({"SMCR": mode}, _TI1 | _TI2) for mode in (1, 2, 3)),
    *(({"SMCR": 0x50 | mode}, _TI1) for mode in (4, 5, 6, 7)),
    *(({"SMCR": 0x60 | mode}, _TI2) for mode in (4, 5, 6, 7)),
    *(({"SMCR": 0x70 | mode}, _ETR) for mode in (4, 5, 6, 7)),
    *(({"SMCR": selection << 4}, 0) for selection in range(8)),
    ({"SMCR": 0x44}, _TI1),
    ({"SMCR": 0x04}, 0),
    ({"SMCR": 0x4000}, _ETR),
    ({"CR2": 0x80}, 0),
    ({"CR2": 0x80, "SMCR": 0x44}, _TI1 | _TI2 | _TI3),
    ({"CR2": 0x80, "SMCR": 0x64}, _TI2),
    ({"BDTR": 0x1000}, _BKIN),
    ({"BDTR": 0xE000}, 0),
]


@pytest.mark.parametrize(("registers", "pins"), _LISTENED)
def test_pins_are_listened_to_where_something_follows_from_them_and_no_others(
    tim1: Timer, registers: dict[str, int], pins: int
) -> None:
    tim1.chip.pins["PB12"].drive(False)
    tim1.set(**registers)
    assert tim1.chip.parts.by_name["TIM1"].native.listening == pins


@pytest.mark.parametrize(("selection", "is_trigger"), [(0, True), (4, False), (5, False), (7, False)])
def test_an_encoder_takes_an_internal_trigger_but_no_edge_of_its_inputs_as_one(
    fake_chip: Any, selection: int, is_trigger: bool
) -> None:
    timer, master = Timer(fake_chip, "TIM3"), Timer(fake_chip, "TIM1")
    _low(timer, *PINS)
    timer.set(SMCR=selection << 4 | 3, CR1=CEN)
    master["CR2"] = 1 << 4
    timer.at(10).chip.pins["PA6"].drive(True)
    master["CR1"] = CEN
    assert (timer.flags & TIF, timer["CNT"]) == (TIF * is_trigger, 1)


def test_an_internal_trigger_that_has_fallen_leaves_the_others_as_they_are(fake_chip: Any) -> None:
    timer, masters = Timer(fake_chip, "TIM3"), [Timer(fake_chip, name) for name in ("TIM1", "TIM2", "TIM4")]
    for selection, master in zip((0, 1, 3), masters, strict=True):
        timer["SMCR"] = selection << 4 | GATED
        master["CR2"] = 1 << 4
        master["CR1"] = CEN
        master["CR1"] = 0
    for selection in (0, 1, 3):
        timer.set(SMCR=selection << 4 | GATED, CNT=7, CR1=CEN)
        timer.at(timer.chip.now_ns // TICK_NS + 20)
        assert timer["CNT"] == 7, selection


@pytest.mark.parametrize("channel", [0, 1, 2, 3])
def test_each_channel_has_its_filter(tim3: Timer, channel: int) -> None:
    """ICxF = 3: eight samples of CK_INT."""
    _low(tim3, *PINS)
    tim3[("CCMR1", "CCMR2")[channel // 2]] = 0x31 << 8 * (channel % 2)
    tim3.set(CCER=1 << 4 * channel, CR1=CEN)
    tim3.at(20).chip.pins[PINS[channel]].drive(True)
    assert tim3.at(27).flags == 0
    assert tim3.at(28).flags == CC1IF << channel


# While its clock stands still.


def test_an_edge_that_came_while_the_clock_stood_is_taken_as_it_goes_on(tim3: Timer) -> None:
    part, pin = tim3.chip.parts.by_name["TIM3"], tim3.chip.pins["PA6"]
    pin.drive(False)
    tim3.set(CCMR1=1, CCER=1, CR1=CEN)
    tim3.at(11)
    part.clock_stopped()
    tim3.at(20)
    pin.drive(True)
    assert tim3.flags == 0
    tim3.at(31)
    part.clock_resumed(20 * TICK_NS)
    assert (tim3.flags, tim3["CCR1"]) == (CC1IF, 10)


def test_an_internal_trigger_that_rose_while_the_clock_stood_is_taken_as_it_goes_on(fake_chip: Any) -> None:
    timer, master = Timer(fake_chip, "TIM3"), Timer(fake_chip, "TIM1")
    timer.set(SMCR=RESET, CR1=CEN)
    master["CR2"] = 1 << 4
    timer.at(11)
    timer.chip.parts.by_name["TIM3"].clock_stopped()
    timer.at(20)
    master["CR1"] = CEN
    assert (timer.flags & TIF, timer["CNT"]) == (0, 10)
    timer.at(31)
    timer.chip.parts.by_name["TIM3"].clock_resumed(20 * TICK_NS)
    assert (timer.flags & TIF, timer["CNT"]) == (TIF, 0)


def test_a_break_comes_even_while_the_clock_stands(tim1: Timer) -> None:
    tim1.chip.pins["PB12"].drive(False)
    tim1["BDTR"] = 0xB000
    tim1.chip.parts.by_name["TIM1"].clock_stopped()
    tim1.chip.pins["PB12"].drive(True)
    assert (tim1.flags & BIF, tim1["BDTR"] >> 15) == (BIF, 0)


@pytest.mark.parametrize("bke", [0, 1])
def test_the_clock_security_system_breaks_where_breaks_are_enabled(tim1: Timer, bke: int) -> None:
    """RM0008 14.3.12: a failure of HSE is a break source beside BKIN."""
    chip = tim1.chip
    chip.pins["PB12"].drive(False)
    tim1["BDTR"] = 0xA000 | bke << 12
    chip.write("RCC.CR", chip.read("RCC.CR") | 1 << 16)
    chip.advance(chip.now_ns + 5_000_000)
    chip.write("RCC.CR", chip.read("RCC.CR") | 1 << 19)
    assert (tim1.flags & BIF, tim1["BDTR"] >> 15) == (0, 1)
    chip.parts.rcc.fail_crystal()
    chip.advance(chip.now_ns + 1_000_000)
    assert (tim1.flags & BIF, tim1["BDTR"] >> 15) == (BIF * bke, 1 - bke)


@pytest.mark.parametrize("enables", [0, 1, 4, 5])
@pytest.mark.parametrize("channel", [0, 1, 2, 3])
def test_idle_states_are_shown_where_either_output_of_a_channel_is_on(tim1: Timer, channel: int, enables: int) -> None:
    """RM0008 table 83, MOE = 0 and OSSI = 1; the fourth channel has one output."""
    enables &= 5 if channel < 3 else 1
    pins = (f"PA{8 + channel}", f"PB{13 + channel}") if channel < 3 else ("PA11",)
    for pin in pins:
        tim1.output(pin)
    tim1.set(CR2=1 << 8 + 2 * channel, CCER=enables << 4 * channel, BDTR=0x400)
    found = [tim1.chip.pins[pin] for pin in pins]
    assert [pin.is_floating for pin in found] == [not enables] * len(pins)
    assert found[0].level is bool(enables)
