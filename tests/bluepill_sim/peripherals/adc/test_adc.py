"""ADC1 and ADC2: against a model in plain Python, and what a program sees of them."""

import ctypes
import struct
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.signals import Oscillation, Samples, Waveform
from bluepill_sim.peripherals.adc import INJECTED_TRIGGERS, REGULAR_TRIGGERS
from bluepill_sim.stm32f103 import BASES, line_of
from tests.bluepill_sim.peripherals.adc.model import (
    ADON,
    ALIGN,
    AWD,
    AWDEN,
    AWDIE,
    AWDSGL,
    CAL,
    CONT,
    DISCEN,
    DMA,
    EOC,
    EOCIE,
    EXTTRIG,
    JAUTO,
    JAWDEN,
    JDISCEN,
    JEOC,
    JEOCIE,
    JEXTTRIG,
    JSTRT,
    JSWSTART,
    RSTCAL,
    SCAN,
    STRT,
    SWSTART,
    TSVREFE,
    AdcModel,
)

QUICK = settings(max_examples=150)
#: A cycle of ADCCLK after a reset: 8 MHz divided by 2.
CYCLE_NS = 250
IRQ, DMA_LINE = 18, line_of("ADC1.dma")
SOFTWARE, JSOFTWARE = EXTTRIG | 7 << 17, JEXTTRIG | 7 << 12
PINS = [*(f"PA{n}" for n in range(8)), "PB0", "PB1"]


def source_of(name: str) -> int:
    device, _, output = name.partition("_")
    return line_of(f"{device.upper()}.{output}")


TRIGGERS = {
    False: [source_of(name) for name in REGULAR_TRIGGERS],
    True: [source_of(name) for name in INJECTED_TRIGGERS],
}


def switch_on(chip: Any, number: int = 1, cr2: int = 0, cr1: int = 0) -> None:
    """Make all pins analog, switch an ADC on, and wait until it is stable."""
    chip.write("GPIOA.CRL", 0)
    chip.write("GPIOB.CRL", 0x4444_4400)
    chip.write(f"ADC{number}.CR1", cr1)
    chip.write(f"ADC{number}.CR2", cr2 | ADON)
    chip.advance(chip.now_ns + 1_000)


def start(chip: Any, number: int = 1) -> int:
    """Set SWSTART; return when."""
    chip.write(f"ADC{number}.CR2", chip.read(f"ADC{number}.CR2") | SWSTART | SOFTWARE)
    return int(chip.now_ns)


def code(volts: float) -> int:
    return min(4095, int(volts * 4096 / 3.3 + 0.5))


def pulse(chip: Any, line: int) -> None:
    chip.pins.fabric.set_line(line, True)
    chip.pins.fabric.set_line(line, False)


# Against the model.

CHANNELS = st.sampled_from([0, 0, 1, 2, 3, 9, 10, 15, 16, 17, 18, 31])
SEQUENCES = st.lists(CHANNELS, min_size=6, max_size=6).map(lambda row: sum(one << 5 * n for n, one in enumerate(row)))
FLAGS_1 = (EOCIE, AWDIE, JEOCIE, SCAN, AWDSGL, JAUTO, DISCEN, JDISCEN, JAWDEN, AWDEN)
FLAGS_2 = (CONT, CAL, RSTCAL, DMA, ALIGN, EXTTRIG, JEXTTRIG, SWSTART, JSWSTART, TSVREFE)


def words(flags: tuple[int, ...], most: int) -> st.SearchStrategy[int]:
    return st.sets(st.sampled_from(flags), max_size=most).map(sum)


CR1 = st.tuples(
    words(FLAGS_1, 4), st.sampled_from([SCAN, 0]), st.sampled_from([0, 1, 3]), st.integers(0, 7), st.just(0)
)
DUAL_CR1 = st.tuples(
    words(FLAGS_1, 3), st.sampled_from([SCAN, 0]), st.sampled_from([0, 1]), st.integers(0, 2), st.integers(0, 9)
)
TRIGGERED = st.sampled_from([0, 4, 6, 7, 7])
CR2 = st.tuples(words(FLAGS_2, 4), TRIGGERED, TRIGGERED, st.sampled_from([ADON, ADON, ADON, ADON, 0])).map(
    lambda row: row[0] | row[1] << 17 | row[2] << 12 | row[3]
)
REGISTERS = st.one_of(
    st.tuples(st.just("CR2"), CR2),
    st.tuples(st.just("CR2"), CR2),
    st.tuples(st.just("SMPR1"), st.sampled_from([0, 0o11111111, 0o70000000, 0o12345670])),
    st.tuples(st.just("SMPR2"), st.sampled_from([0, 0o11111111, 0o70000007, 0o1234567012])),
    st.tuples(st.sampled_from(["SQR2", "SQR3"]), SEQUENCES),
    st.tuples(
        st.just("SQR1"), st.tuples(st.integers(0, 15), SEQUENCES).map(lambda row: row[0] << 20 | row[1] & 0xFFFFF)
    ),
    st.tuples(
        st.just("JSQR"), st.tuples(st.integers(0, 3), SEQUENCES).map(lambda row: row[0] << 20 | row[1] & 0xFFFFF)
    ),
    st.tuples(st.sampled_from(["HTR", "LTR"]), st.sampled_from([0, 1000, 2048, 3000, 0xFFF])),
    st.tuples(st.sampled_from(["JOFR1", "JOFR2", "JOFR4"]), st.sampled_from([0, 1, 0xFFF])),
    st.tuples(st.just("SR"), st.integers(0, 31)),
)
STEPS = st.one_of(
    st.tuples(st.just("write"), st.integers(0, 1), REGISTERS),
    st.tuples(st.just("write"), st.just(0), REGISTERS),
    st.tuples(st.just("start"), st.integers(0, 1), st.booleans()),
    st.tuples(st.just("start"), st.just(0), st.booleans()),
    st.tuples(st.just("trigger"), st.booleans(), st.sampled_from([0, 4, 6])),
    st.tuples(st.just("volts"), st.sampled_from([0, 1, 2]), st.sampled_from([0, 0.8, 1.65, 3.3, 3.4, -0.1])),
    st.tuples(st.just("wait"), st.sampled_from([1, 3, 13, 14, 27, 28, 100, 700, 5000]), st.integers(-1, 1)),
    st.tuples(st.just("wait"), st.integers(1, 60), st.integers(-1, 1)),
    st.tuples(st.just("read"), st.integers(0, 1)),
    st.tuples(st.just("again")),
)


class Pair:
    """The chip's ADCs and the model's, side by side."""

    def __init__(self, chip: Any, divider: int) -> None:
        self.chip = chip
        chip.write("RCC.CFGR", chip.read("RCC.CFGR") | (divider // 2 - 1) << 14)
        for number in (1, 2):
            switch_on(chip, number)
        chip.pins["PA0"].set_volts(Oscillation(shape=Waveform.SINE, low_v=0, high_v=3.3, period_ns=77_777))
        chip.pins["PA3"].set_volts(Samples(volts=(0.5, 2.5, 1.0), interval_ns=33_333, is_repeated=True))
        self.model = AdcModel(chip.clocks.pclk2_hz, divider, chip.pins.fabric.channel_uv, chip.now_ns)
        for unit in self.model.units:
            unit.words["CR2"] = ADON

    def do(self, name: str, *values: Any) -> None:
        chip, model = self.chip, self.model
        if name == "write":
            n, (register, value) = values
            chip.write(f"ADC{n + 1}.{register}", value)
            model.write(n, register, value)
        elif name == "start":
            n, is_injected = values
            bits = JSOFTWARE | JSWSTART if is_injected else SOFTWARE | SWSTART
            self.do("write", n, ("CR2", model.units[n]["CR2"] | ADON | bits))
        elif name == "trigger":
            is_injected, source = values
            model.trigger(source, is_injected=is_injected)
            pulse(chip, TRIGGERS[is_injected][source])
        elif name == "volts":
            chip.pins[PINS[values[0]]].set_volts(values[1])
        elif name == "wait":
            to_ns = chip.now_ns + values[0] * 1_000_000_000 * model.divider // chip.clocks.pclk2_hz + values[1]
            chip.advance(to_ns)
            model.advance(to_ns)
        elif name == "read":
            assert chip.read(f"ADC{values[0] + 1}.DR") == model.read_dr(values[0])
        else:
            chip.parts.restore(chip.parts.snapshot())

    def compare(self) -> None:
        for n, unit in enumerate(self.model.units, 1):
            assert (n, self.chip.read(f"ADC{n}.SR")) == (n, unit.sr)
            assert self.chip.read(f"ADC{n}.CR2") == unit["CR2"]
            assert [self.chip.read(f"ADC{n}.JDR{k}") for k in (1, 2, 3, 4)] == unit.jdr
        assert self.chip.irqs[IRQ] == self.model.irq
        assert bool(self.chip.pins.fabric.lines[DMA_LINE]) == self.model.units[0].is_requesting


@QUICK
@given(
    first=st.one_of(CR1, DUAL_CR1),
    steps=st.lists(STEPS, max_size=40),
    divider=st.sampled_from([2, 4, 8]),
    is_looked_at=st.booleans(),
)
def test_whatever_is_set_up_and_triggered_goes_as_in_the_model(
    make_fake_chip: Callable[[], Any], first: tuple[int, ...], steps: list[tuple[Any, ...]], divider: int,
    is_looked_at: bool,
) -> None:  # fmt: skip
    pair = Pair(make_fake_chip(), divider)
    flags, scan, channel, parts, dual = first
    for n, more in ((1, 0), (0, dual << 16)):
        pair.do("write", n, ("CR1", flags | scan | channel | parts << 13 | more))
        pair.do("write", n, ("SQR1", 2 << 20))
        pair.do("write", n, ("SQR3", 0 | 3 << 5 | 1 << 10))
        pair.do("write", n, ("JSQR", 1 << 20 | 1 << 15 | 3 << 10))
    for step in steps:
        pair.do(*step)
        if is_looked_at:
            pair.compare()
    pair.do("wait", 1, 0)
    pair.compare()
    for n in (0, 1):
        pair.do("read", n)
    pair.compare()


# What the manual says, one thing a test.


@pytest.mark.parametrize("smp", range(8))
def test_a_conversion_takes_its_sampling_time_and_twelve_and_a_half_cycles(fake_chip: Any, smp: int) -> None:
    switch_on(fake_chip)
    fake_chip.write("ADC1.SMPR2", smp)
    fake_chip.pins["PA0"].set_volts(1.65)
    end_ns = start(fake_chip) + (14, 20, 26, 41, 54, 68, 84, 252)[smp] * CYCLE_NS
    fake_chip.advance(end_ns - 1)
    assert fake_chip.read("ADC1.SR") == STRT
    fake_chip.advance(end_ns)
    assert fake_chip.read("ADC1.SR") == STRT | EOC
    assert fake_chip.read("ADC1.DR") == 2048
    assert fake_chip.read("ADC1.SR") == STRT


@pytest.mark.parametrize(("late_ns", "expected"), [(-1, 3.0), (0, 1.0), (1, 1.0)])
def test_volts_count_at_the_instant_of_sampling(fake_chip: Any, late_ns: int, expected: float) -> None:
    switch_on(fake_chip)
    fake_chip.pins["PA0"].set_volts(1.0)
    sample_ns = start(fake_chip) + 375
    fake_chip.advance(sample_ns + late_ns)
    fake_chip.pins["PA0"].set_volts(3.0)
    fake_chip.advance(sample_ns + 13 * CYCLE_NS)
    assert fake_chip.read("ADC1.DR") == code(expected)


def test_thresholds_of_the_converter_lie_half_way_between_two_codes(fake_chip: Any) -> None:
    switch_on(fake_chip)
    for uv, expected in ((402, 0), (403, 1), (1_650_000 - 403, 2047), (1_650_000 - 402, 2048), (3_298_791, 4094),
                         (3_298_792, 4095), (3_300_000, 4095), (5_000_000, 4095), (-1, 0)):  # fmt: skip
        fake_chip.pins["PA0"].set_volts(uv / 1e6)
        start(fake_chip)
        fake_chip.advance(fake_chip.now_ns + 14 * CYCLE_NS)
        assert (uv, fake_chip.read("ADC1.DR")) == (uv, expected)


def test_a_pin_without_volts_has_its_logic_level(fake_chip: Any) -> None:
    switch_on(fake_chip)
    pin = fake_chip.pins["PA0"]
    for level, expected in ((None, 0), (True, 4095), (False, 0)):
        pin.drive(level)
        start(fake_chip)
        fake_chip.advance(fake_chip.now_ns + 14 * CYCLE_NS)
        assert fake_chip.read("ADC1.DR") == expected
    assert fake_chip.warnings == {}


def test_no_conversion_begins_before_the_adc_is_stable(fake_chip: Any) -> None:
    fake_chip.write("GPIOA.CRL", 0)
    fake_chip.write("ADC1.CR2", ADON)
    start(fake_chip)
    fake_chip.advance(1_000 + 14 * CYCLE_NS - 1)
    assert not fake_chip.read("ADC1.SR") & EOC
    fake_chip.advance(1_000 + 14 * CYCLE_NS)
    assert fake_chip.read("ADC1.SR") & EOC


def test_adon_written_again_starts_unless_another_bit_changes(fake_chip: Any) -> None:
    switch_on(fake_chip)
    fake_chip.write("ADC1.CR2", ADON | ALIGN)
    assert fake_chip.read("ADC1.SR") == 0
    fake_chip.write("ADC1.CR2", ADON | ALIGN)
    assert fake_chip.read("ADC1.SR") == STRT


@pytest.mark.parametrize(("cr2", "starts"), [(SOFTWARE, True), (EXTTRIG | 6 << 17, False), (7 << 17, False)])
def test_swstart_needs_its_trigger_selected_and_enabled(fake_chip: Any, cr2: int, starts: bool) -> None:
    switch_on(fake_chip, cr2=cr2)
    fake_chip.write("ADC1.CR2", ADON | cr2 | SWSTART)
    assert bool(fake_chip.read("ADC1.SR") & STRT) is starts
    assert not fake_chip.read("ADC1.CR2") & SWSTART


@pytest.mark.parametrize(("bit", "cycles"), [(CAL, 83), (RSTCAL, 4)])
def test_a_calibration_falls_in_its_time_and_holds_conversions_back(fake_chip: Any, bit: int, cycles: int) -> None:
    switch_on(fake_chip)
    begin_ns = fake_chip.now_ns
    fake_chip.write("ADC1.CR2", ADON | bit)
    fake_chip.write("ADC1.CR2", ADON)
    start(fake_chip)
    fake_chip.advance(begin_ns + cycles * CYCLE_NS - 1)
    assert fake_chip.read("ADC1.CR2") & bit
    fake_chip.advance(begin_ns + cycles * CYCLE_NS)
    assert not fake_chip.read("ADC1.CR2") & bit
    fake_chip.advance(begin_ns + (cycles + 14) * CYCLE_NS - 1)
    assert not fake_chip.read("ADC1.SR") & EOC
    fake_chip.advance(begin_ns + (cycles + 14) * CYCLE_NS)
    assert fake_chip.read("ADC1.SR") & EOC


@pytest.mark.parametrize("is_injected", [False, True])
@pytest.mark.parametrize("number", [1, 2])
def test_each_trigger_starts_its_group_by_its_number_and_no_other(
    make_fake_chip: Callable[[], Any], number: int, is_injected: bool
) -> None:
    enable, at, flag = (JEXTTRIG, 12, JSTRT) if is_injected else (EXTTRIG, 17, STRT)
    for selected in range(8):
        chip = make_fake_chip()
        switch_on(chip, number, enable | selected << at)
        for group in (False, True):
            for n, line in enumerate(TRIGGERS[group]):
                pulse(chip, line)
                is_mine = group is is_injected and n == selected
                assert chip.read(f"ADC{number}.SR") == (flag if is_mine else 0), (selected, group, n)
                chip.write(f"ADC{number}.CR2", 0)
                chip.write(f"ADC{number}.CR2", enable | selected << at | ADON)
                chip.write(f"ADC{number}.SR", 0)
                chip.advance(chip.now_ns + 1_000)


@pytest.mark.parametrize(
    ("line", "bit", "cr2", "flag"), [(11, 18, EXTTRIG | 6 << 17, STRT), (15, 17, JEXTTRIG | 6 << 12, JSTRT)]
)
def test_an_event_of_exti_triggers_unless_afio_gives_its_place_away(
    fake_chip: Any, line: int, bit: int, cr2: int, flag: int
) -> None:
    switch_on(fake_chip, cr2=cr2)
    fake_chip.write("AFIO.MAPR", 2 << 24)
    fake_chip.write("EXTI.RTSR", 1 << line)
    pin = fake_chip.pins[f"PA{line}"]
    for emr, remap, expected in ((0, 0, 0), (1 << line, 1 << bit, 0), (1 << line, 0, flag)):
        fake_chip.write("EXTI.EMR", emr)
        fake_chip.write("AFIO.MAPR", 2 << 24 | remap)
        pin.drive(False)
        pin.drive(True)
        assert fake_chip.read("ADC1.SR") == expected


def test_a_scan_converts_its_sequence_and_eoc_comes_with_the_last(fake_chip: Any) -> None:
    switch_on(fake_chip, cr2=DMA, cr1=SCAN)
    for n in (0, 5, 9):
        fake_chip.pins[PINS[n]].set_volts(0.1 + 0.2 * n)
    fake_chip.write("ADC1.SQR1", 2 << 20)
    fake_chip.write("ADC1.SQR3", 9 | 0 << 5 | 5 << 10)
    begin_ns = start(fake_chip)
    for k, n in enumerate((9, 0, 5), 1):
        fake_chip.advance(begin_ns + k * 14 * CYCLE_NS)
        assert bool(fake_chip.read("ADC1.SR") & EOC) is (k == 3)
        assert fake_chip.pins.fabric.lines[DMA_LINE]
        assert fake_chip.read("ADC1.DR") == code(0.1 + 0.2 * n)
        assert not fake_chip.pins.fabric.lines[DMA_LINE]


def test_parts_of_a_sequence_follow_their_triggers_without_rollover(fake_chip: Any) -> None:
    # RM0008 11.3.10: n = 3 of eight channels; the third trigger converts two.
    switch_on(fake_chip, cr1=SCAN | DISCEN | 2 << 13)
    fake_chip.write("ADC1.SQR1", 7 << 20)
    dones = []
    for _ in range(4):
        start(fake_chip)
        count = 0
        while fake_chip.parts.by_name["ADC1"].due_ns is not None:
            fake_chip.advance(fake_chip.parts.by_name["ADC1"].due_ns)
            count += 1
            assert fake_chip.read("ADC1.SR") & EOC
            fake_chip.read("ADC1.DR")
        dones.append(count)
    assert dones == [3, 3, 2, 3]


def test_a_sequence_that_becomes_shorter_between_its_parts_begins_anew(fake_chip: Any) -> None:
    switch_on(fake_chip, cr1=SCAN | DISCEN | 1 << 13)
    fake_chip.write("ADC1.SQR3", 3 | 4 << 5 | 5 << 10 | 6 << 15)
    fake_chip.write("ADC1.SQR1", 3 << 20)
    part, converted = fake_chip.parts.by_name["ADC1"], []
    for pin, volts in (("PA3", 1.0), ("PA4", 2.0)):
        fake_chip.pins[pin].set_volts(volts)
    for length in (4, 2):
        fake_chip.write("ADC1.SQR1", length - 1 << 20)
        start(fake_chip)
        while part.due_ns is not None:
            fake_chip.advance(part.due_ns)
            converted.append(fake_chip.read("ADC1.DR"))
    assert converted == [code(1.0), code(2.0)] * 2


def test_in_parts_each_trigger_converts_one_injected_channel(fake_chip: Any) -> None:
    # RM0008 11.3.10: the third trigger ends the group of three, the fourth converts the first channel.
    switch_on(fake_chip, cr2=JSOFTWARE, cr1=SCAN | JDISCEN)
    fake_chip.write("ADC1.JSQR", 2 << 20 | 1 << 5 | 2 << 10 | 3 << 15)
    for n in (1, 2, 3):
        fake_chip.pins[f"PA{n}"].set_volts(n / 2)
    seen = []
    for turn in range(4):
        fake_chip.pins["PA1"].set_volts(0.5 if turn < 3 else 3.0)
        fake_chip.write("ADC1.CR2", ADON | JSOFTWARE | JSWSTART)
        fake_chip.advance(fake_chip.now_ns + 100 * CYCLE_NS)
        seen.append([fake_chip.read(f"ADC1.JDR{n}") for n in (1, 2, 3)])
        assert bool(fake_chip.read("ADC1.SR") & JEOC) is (turn == 2)
        fake_chip.write("ADC1.SR", 0)
    first, second, third = (code(n / 2) for n in (1, 2, 3))
    assert seen == [[first, 0, 0], [first, second, 0], [first, second, third], [code(3.0), second, third]]


def test_injected_data_lose_their_offset_and_keep_their_sign(fake_chip: Any) -> None:
    switch_on(fake_chip, cr2=JSOFTWARE, cr1=SCAN)
    fake_chip.pins["PA2"].set_volts(1.65)
    fake_chip.write("ADC1.JSQR", 1 << 20 | 2 << 15 | 2 << 10)
    fake_chip.write("ADC1.JOFR1", 2049)
    fake_chip.write("ADC1.JOFR2", 8)
    for align, expected in ((0, (0xFFFF, 2040)), (ALIGN, (0xFFF8, 2040 << 3))):
        fake_chip.write("ADC1.CR2", ADON | JSOFTWARE | align | JSWSTART)
        fake_chip.advance(fake_chip.now_ns + 28 * CYCLE_NS - 1)
        assert not fake_chip.read("ADC1.SR") & (JEOC | EOC)
        fake_chip.advance(fake_chip.now_ns + 1)
        assert fake_chip.read("ADC1.SR") == JEOC | EOC | JSTRT
        assert (fake_chip.read("ADC1.JDR1"), fake_chip.read("ADC1.JDR2")) == expected
        fake_chip.write("ADC1.SR", 0)


def test_an_injected_group_interrupts_a_regular_one_which_is_made_anew(fake_chip: Any) -> None:
    switch_on(fake_chip, cr2=JSOFTWARE | SOFTWARE)
    begin_ns = start(fake_chip)
    fake_chip.advance(begin_ns + 13 * CYCLE_NS)
    fake_chip.write("ADC1.CR2", ADON | SOFTWARE | JSOFTWARE | JSWSTART)
    for cycles, flags in ((27, STRT | JSTRT), (28, 0)):
        fake_chip.advance(begin_ns + (cycles - 1) * CYCLE_NS)
        assert cycles == 28 or fake_chip.read("ADC1.SR") == flags
    assert fake_chip.read("ADC1.SR") == STRT | JSTRT | JEOC | EOC
    fake_chip.write("ADC1.SR", 0)
    fake_chip.advance(begin_ns + 41 * CYCLE_NS - 1)
    assert fake_chip.read("ADC1.SR") & EOC == 0
    fake_chip.advance(begin_ns + 41 * CYCLE_NS)
    assert fake_chip.read("ADC1.SR") & (EOC | JEOC) == EOC


@pytest.mark.parametrize(("divider", "delay"), [(2, 2), (4, 1), (8, 1)])
def test_an_automatic_group_follows_behind_the_delay_of_the_prescaler(fake_chip: Any, divider: int, delay: int) -> None:
    fake_chip.write("RCC.CFGR", (divider // 2 - 1) << 14)
    switch_on(fake_chip, cr1=JAUTO)
    cycle_ns = 125 * divider
    end_ns = start(fake_chip) + (14 + delay + 14) * cycle_ns
    fake_chip.advance(end_ns - 1)
    assert not fake_chip.read("ADC1.SR") & JEOC
    fake_chip.advance(end_ns)
    assert fake_chip.read("ADC1.SR") & JEOC


def test_a_second_regular_trigger_leaves_an_interrupted_sequence_where_it_was(fake_chip: Any) -> None:
    switch_on(fake_chip, cr2=JSOFTWARE | SOFTWARE, cr1=SCAN)
    fake_chip.write("ADC1.SQR1", 2 << 20)
    begin_ns = start(fake_chip)
    fake_chip.advance(begin_ns + 20 * CYCLE_NS)  # in the second conversion
    fake_chip.write("ADC1.CR2", ADON | SOFTWARE | JSOFTWARE | JSWSTART)
    fake_chip.advance(begin_ns + 30 * CYCLE_NS)
    start(fake_chip)
    fake_chip.advance(begin_ns + 34 * CYCLE_NS)
    assert fake_chip.read("ADC1.SR") & JEOC
    fake_chip.write("ADC1.SR", 0)
    fake_chip.advance(begin_ns + 62 * CYCLE_NS - 1)
    assert not fake_chip.read("ADC1.SR") & EOC
    fake_chip.advance(begin_ns + 62 * CYCLE_NS)
    assert fake_chip.read("ADC1.SR") & EOC


def test_a_regular_trigger_during_the_automatic_group_starts_behind_it(fake_chip: Any) -> None:
    switch_on(fake_chip, cr1=JAUTO)
    begin_ns = start(fake_chip)
    fake_chip.advance(begin_ns + 20 * CYCLE_NS)
    start(fake_chip)
    fake_chip.advance(begin_ns + 30 * CYCLE_NS)
    fake_chip.write("ADC1.SR", 0)
    fake_chip.advance(begin_ns + (30 + 2 + 14) * CYCLE_NS - 1)
    assert not fake_chip.read("ADC1.SR") & EOC
    fake_chip.advance(begin_ns + (30 + 2 + 14) * CYCLE_NS)
    assert fake_chip.read("ADC1.SR") & (EOC | JEOC) == EOC


@pytest.mark.parametrize("is_injected", [False, True])
@pytest.mark.parametrize(
    ("low", "high", "expected"), [(2048, 2048, False), (2049, 4095, True), (0, 2047, True), (2047, 2049, False)]
)
def test_the_watchdog_looks_below_and_above_its_thresholds(
    fake_chip: Any, is_injected: bool, low: int, high: int, expected: bool
) -> None:
    for guard, watched in (
        (AWDEN, not is_injected), (JAWDEN, is_injected), (AWDEN | JAWDEN, True),
        (AWDEN | JAWDEN | AWDSGL | 1, True), (AWDEN | JAWDEN | AWDSGL | 2, False),
        (AWDEN | JAWDEN | AWDSGL | 17, False), (0, False),
    ):  # fmt: skip
        switch_on(fake_chip, cr2=JSOFTWARE, cr1=guard | AWDIE)
        fake_chip.pins["PA1"].set_volts(1.65)
        for register, word in (("LTR", low), ("HTR", high), ("SQR3", 1), ("JSQR", 1 << 15), ("SR", 0)):
            fake_chip.write(f"ADC1.{register}", word)
        if is_injected:
            fake_chip.write("ADC1.CR2", ADON | JSOFTWARE | JSWSTART)
        else:
            start(fake_chip)
        fake_chip.advance(fake_chip.now_ns + 14 * CYCLE_NS)
        assert bool(fake_chip.read("ADC1.SR") & AWD) is (expected and watched)
        assert fake_chip.irqs[IRQ] is (expected and watched)
        fake_chip.write("ADC1.CR2", 0)


@pytest.mark.parametrize(("flag", "enable"), [(EOC, EOCIE), (JEOC, JEOCIE)])
@pytest.mark.parametrize("number", [1, 2])
def test_both_adcs_share_their_interrupt(fake_chip: Any, number: int, flag: int, enable: int) -> None:
    switch_on(fake_chip, number, JSOFTWARE, enable)
    fake_chip.write(f"ADC{number}.CR2", ADON | JSOFTWARE | (JSWSTART if flag == JEOC else 0))
    start(fake_chip, number)
    fake_chip.advance(fake_chip.now_ns + 28 * CYCLE_NS)
    assert fake_chip.irqs[IRQ]
    fake_chip.write(f"ADC{number}.SR", 0x1F & ~flag)
    assert not fake_chip.irqs[IRQ]


def test_internal_channels_need_tsvrefe_and_are_adc1s(fake_chip: Any) -> None:
    for number, cr2, channel, expected in (
        (1, TSVREFE, 16, code(1.43 - 0.0043 * 15)), (1, TSVREFE, 17, code(1.2)), (1, 0, 17, 0), (2, 0, 17, 0),
    ):  # fmt: skip
        fake_chip.pins.fabric.analog_struct.temperature_mc = 40_000
        switch_on(fake_chip, number, cr2)
        fake_chip.write(f"ADC{number}.SQR3", channel)
        start(fake_chip, number)
        fake_chip.advance(fake_chip.now_ns + 14 * CYCLE_NS)
        assert fake_chip.read(f"ADC{number}.DR") == expected
        fake_chip.write(f"ADC{number}.CR2", 0)
    assert sorted(fake_chip.warnings) == ["ADC1:NOT_ENABLED:17", "ADC2:NO_PIN:17"]


def test_what_is_wrong_is_warned_of_once_by_name(fake_chip: Any) -> None:
    fake_chip.run_at_72_mhz()
    for _ in range(2):
        fake_chip.write("ADC1.CR2", ADON)
        fake_chip.write("ADC1.CR2", ADON)
        fake_chip.advance(fake_chip.now_ns + 5_000)
    assert list(fake_chip.warnings.values()) == [
        "ADC1: ADCCLK is 36 MHz, above 14 MHz: RCC_CFGR ADCPRE divides PCLK2 by 2",
        "ADC1: PA0 is converted (channel 0) and is no analog input (floating input)",
    ]


def test_continuous_conversions_that_nobody_sees_have_no_events(fake_chip: Any) -> None:
    switch_on(fake_chip, cr2=CONT)
    adc = fake_chip.parts.by_name["ADC1"]
    fake_chip.pins["PA0"].set_volts(Oscillation(shape=Waveform.SAWTOOTH, low_v=0, high_v=3.3, period_ns=10_000_000))
    begin_ns = start(fake_chip)
    assert adc.due_ns == begin_ns + 14 * CYCLE_NS
    fake_chip.advance(begin_ns + 14 * CYCLE_NS)
    assert adc.due_ns is None
    for at_ns in (begin_ns + 5_000_000, begin_ns + 1_009_000_000):
        fake_chip.advance(at_ns)
        last_ns = begin_ns + (at_ns - begin_ns) // (14 * CYCLE_NS) * 14 * CYCLE_NS - 3_125
        assert fake_chip.read("ADC1.DR") == code(fake_chip.pins.fabric.channel_uv(0, last_ns) / 1e6)
        assert adc.due_ns == last_ns + 3_125 + 14 * CYCLE_NS  # EOC is to be seen again
        fake_chip.advance(adc.due_ns)
        assert adc.due_ns is None


@pytest.mark.parametrize(
    ("register", "word", "flags", "expected"),
    [
        ("SR", 0, 0, 1.0),
        ("SQR3", 1, STRT | EOC, 1.0),
        ("CR2", ADON | CONT | ALIGN, STRT | EOC, 1.0),
        ("SMPR2", 7, 18, 1.0),
    ],
)
def test_what_is_written_changes_nothing_that_was_converted_unseen(
    fake_chip: Any, register: str, word: int, flags: int, expected: float
) -> None:
    switch_on(fake_chip, cr2=CONT)
    fake_chip.pins["PA0"].set_volts(2.0)
    fake_chip.pins["PA1"].set_volts(3.0)
    begin_ns = start(fake_chip)
    fake_chip.advance(begin_ns + 14 * CYCLE_NS)
    fake_chip.pins["PA0"].set_volts(1.0)
    fake_chip.advance(begin_ns + 100 * 14 * CYCLE_NS + 1)
    fake_chip.write(f"ADC1.{register}", word)
    assert fake_chip.read("ADC1.SR") == flags
    assert fake_chip.read("ADC1.DR") == code(expected)


@settings(max_examples=40)
@given(waits=st.lists(st.tuples(st.integers(1, 3_000), st.booleans()), min_size=1, max_size=5), watches=st.booleans())
def test_what_nobody_saw_is_as_if_each_conversion_had_been_made(
    make_fake_chip: Callable[[], Any], waits: list[tuple[int, bool]], watches: bool
) -> None:
    pair = Pair(make_fake_chip(), 4)
    for register, word in (
        ("CR1", SCAN | JAUTO | (AWDEN if watches else 0)), ("HTR", 2000), ("SQR1", 2 << 20), ("SQR3", 3 << 5),
        ("JSQR", 1 << 20 | 3 << 10), ("CR2", ADON | CONT), ("CR2", ADON | CONT),
    ):  # fmt: skip
        pair.do("write", 0, (register, word))
    pair.do("wait", 14 * 60, 0)
    adc = pair.chip.parts.by_name["ADC1"]
    for wait, is_read in waits:
        assert watches or adc.due_ns is None
        pair.do("wait", wait, 0)
        pair.do("volts", 1, wait % 4)  # of no channel that is converted
        pair.compare()
        if is_read:
            pair.do("read", 0)
            pair.do("wait", 14 * 6, 0)


def test_in_stop_mode_a_conversion_stands_still_and_keeps_what_it_sampled(fake_chip: Any) -> None:
    switch_on(fake_chip)
    fake_chip.pins["PA0"].set_volts(1.0)
    adc, begin_ns = fake_chip.parts.by_name["ADC1"], start(fake_chip)
    fake_chip.advance(begin_ns + 2 * CYCLE_NS)  # behind the sample, at 1.5
    adc.clock_stopped()
    fake_chip.pins["PA0"].set_volts(3.0)
    fake_chip.advance(begin_ns + 5_000_000_002 * CYCLE_NS)
    adc.clock_resumed(5_000_000_000 * CYCLE_NS)
    end_ns = begin_ns + 5_000_000_014 * CYCLE_NS
    fake_chip.advance(end_ns - 1)
    assert fake_chip.read("ADC1.SR") == STRT
    fake_chip.advance(end_ns)
    assert fake_chip.read("ADC1.SR") == STRT | EOC
    assert fake_chip.read("ADC1.DR") == code(1.0)


# Dual modes: which ADC converts when, by the ends of conversions in cycles of ADCCLK.


def ends(chip: Any, cr1: int, action: Callable[[], None], cycles: int, flag: int = EOC) -> dict[int, list[int]]:
    """Return when each ADC ends conversions, after an action."""
    begin_ns = chip.now_ns
    chip.write("ADC1.CR1", cr1)
    action()
    seen: dict[int, list[int]] = {1: [], 2: []}
    for cycle in range(1, cycles):
        chip.advance(begin_ns + cycle * CYCLE_NS)
        for n in (1, 2):
            if chip.read(f"ADC{n}.SR") & flag:
                seen[n].append(cycle)
                chip.write(f"ADC{n}.SR", 0x1F & ~(EOC | JEOC))
    return seen


@pytest.mark.parametrize(
    ("mode", "cr2", "expected"),
    [
        (6, 0, {1: [14], 2: [14]}),
        (1, 0, {1: [14], 2: [14]}),
        (7, 0, {1: [21], 2: [14]}),
        (7, CONT, {1: [21, 35, 49], 2: [14, 28, 42, 56]}),
        (8, 0, {1: [28, 56], 2: [14, 42]}),
        (0, 0, {1: [14], 2: []}),
        (5, 0, {1: [14], 2: []}),
    ],
)
def test_regular_groups_of_dual_modes_begin_in_their_cycles(
    fake_chip: Any, mode: int, cr2: int, expected: dict[int, list[int]]
) -> None:
    for number in (1, 2):
        switch_on(fake_chip, number, cr2)
    assert ends(fake_chip, mode << 16, lambda: start(fake_chip) and None, 60) == expected


@pytest.mark.parametrize(
    ("mode", "expected"),
    [(5, {1: [14], 2: [14]}), (1, {1: [14], 2: [14]}), (9, {1: [14], 2: []}), (6, {1: [14], 2: []})],
)
def test_injected_groups_of_dual_modes_begin_in_their_cycles(
    fake_chip: Any, mode: int, expected: dict[int, list[int]]
) -> None:
    for number in (1, 2):
        switch_on(fake_chip, number, JSOFTWARE)

    def inject() -> None:
        fake_chip.write("ADC1.CR2", ADON | JSOFTWARE | JSWSTART)

    assert ends(fake_chip, mode << 16, inject, 40, JEOC) == expected
    if mode == 9:  # and the next trigger is ADC2's; a mode that is written anew begins with ADC1
        assert ends(fake_chip, mode << 16, inject, 40, JEOC) == {1: [], 2: [14]}
        assert ends(fake_chip, mode << 16, inject, 40, JEOC) == {1: [14], 2: []}
        fake_chip.write("ADC1.CR1", 0)
        assert ends(fake_chip, mode << 16, inject, 40, JEOC) == {1: [14], 2: []}


def test_in_a_dual_mode_dr_holds_both_and_the_slave_follows_no_trigger(fake_chip: Any) -> None:
    for number in (1, 2):
        switch_on(fake_chip, number, EXTTRIG | 4 << 17)
        fake_chip.write(f"ADC{number}.SQR3", number)
    fake_chip.pins["PA1"].set_volts(1.0)
    fake_chip.pins["PA2"].set_volts(2.0)
    fake_chip.write("ADC1.CR1", 6 << 16)
    pulse(fake_chip, TRIGGERS[False][4])
    fake_chip.advance(fake_chip.now_ns + 14 * CYCLE_NS)
    assert fake_chip.read("ADC1.DR") == code(1.0) | code(2.0) << 16
    fake_chip.write("ADC1.CR2", 0)
    fake_chip.read("ADC2.DR")
    pulse(fake_chip, TRIGGERS[False][4])
    fake_chip.advance(fake_chip.now_ns + 14 * CYCLE_NS)
    assert not fake_chip.read("ADC2.SR") & EOC


# With DMA.

SRAM = 0x2000_0000


def receive(chip: Any, count: int, width: int) -> Any:
    """Have channel 1 take what ADC1 converts into words of 1 << `width` bytes, round and round; return the memory."""
    sram = (ctypes.c_char * 0x400)()
    chip.pins.fabric.add_memory(SRAM, sram, is_writable=True)
    words = (
        ("CNDTR1", count),
        ("CPAR1", BASES["ADC1"] + 0x4C),
        ("CMAR1", SRAM),
        ("CCR1", 0xA1 | width << 8 | width << 10),
    )
    for register, word in words:
        chip.write(f"DMA1.{register}", word)
    return sram


@pytest.mark.parametrize("cr2", [CONT, CONT | ALIGN])
def test_circular_dma_takes_every_conversion_at_the_limit(fake_chip: Any, cr2: int) -> None:
    fake_chip.run_at_72_mhz()
    fake_chip.write("RCC.CFGR", fake_chip.read("RCC.CFGR") | 2 << 14)
    switch_on(fake_chip, cr2=cr2 | DMA)
    fake_chip.pins["PA0"].set_volts(Oscillation(shape=Waveform.SAWTOOTH, low_v=0, high_v=3.3, period_ns=100_000))
    sram = receive(fake_chip, 32, 1)
    begin_ns = start(fake_chip)
    fake_chip.advance(begin_ns + 40 * 14 * 1_000_000_000 // 12_000_000 + 100)
    taken = struct.unpack("<32H", bytes(sram)[:64])
    for n in range(8, 40):
        sample_ns = begin_ns + (14 * n * 6 + 9) * 1_000_000_000 // 72_000_000
        expected = code(fake_chip.pins.fabric.channel_uv(0, sample_ns) / 1e6)
        assert taken[n % 32] == (expected << 4 if cr2 & ALIGN else expected)
    assert fake_chip.read("DMA1.CNDTR1") == 24
    assert fake_chip.warnings == {}


@pytest.mark.parametrize(("mode", "delay"), [(6, 0), (7, 7)])
def test_in_dual_modes_dma_takes_words_of_both(fake_chip: Any, mode: int, delay: int) -> None:
    for number in (2, 1):
        switch_on(fake_chip, number, CONT | (DMA if number == 1 else 0))
        fake_chip.write(f"ADC{number}.SQR3", number)
    fake_chip.write("ADC1.CR1", mode << 16)
    fake_chip.pins["PA1"].set_volts(1.0)
    fake_chip.pins["PA2"].set_volts(Oscillation(shape=Waveform.SAWTOOTH, low_v=0, high_v=3.3, period_ns=100_000))
    sram = receive(fake_chip, 16, 2)
    begin_ns = start(fake_chip)
    fake_chip.advance(begin_ns + (delay + 10 * 14) * CYCLE_NS + 1_000)
    for n, word in enumerate(struct.unpack("<10I", bytes(sram)[:40])):
        assert word & 0xFFFF == code(1.0)
        sample_ns = begin_ns + 14 * n * CYCLE_NS + 375
        assert word >> 16 == code(fake_chip.pins.fabric.channel_uv(2, sample_ns) / 1e6)
    assert fake_chip.read("DMA1.CNDTR1") == 6
