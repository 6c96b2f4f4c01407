"""DMA1: against a model in plain Python, and what a program sees of it."""

import ctypes
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.stm32f103 import WIRING
from tests.bluepill_sim.peripherals.dma.model import (
    CIRC,
    DIR,
    EN,
    EXTICR4,
    FLASH,
    HTIE,
    HTIF,
    MEM2MEM,
    MINC,
    PINC,
    SRAM,
    SRAM_BYTES,
    TCIE,
    TCIF,
    TEIE,
    TEIF,
    DmaModel,
)

QUICK = settings(max_examples=200)
#: A cycle of HCLK after a reset.
CYCLE_NS = 125
#: A request of each channel, of a timer: it stands, and leaves its output alone, which a bus sets anew at a remap.
REQUESTS = ("TIM2.cc3", "TIM2.up", "TIM3.up", "TIM4.cc2", "TIM2.cc1", "TIM3.cc1", "TIM2.cc2")
BYTE, HALF, WORD = 0, 1, 2
ADDRESSES = st.one_of(
    st.integers(SRAM, SRAM + 64), st.integers(SRAM, SRAM + 64),
    st.sampled_from([EXTICR4, FLASH + 4, SRAM + SRAM_BYTES - 4, 0, 0xE000_E010, 0x4000_7C00, FLASH + 0xFD]),
)  # fmt: skip
#: Some more often than others, so that much happens to one.
CHANNELS = st.sampled_from([0, 0, 0, 0, 1, 1, 1, 2, 3, 4, 5, 6])
CONTROLS = st.one_of(
    st.integers(0, 0x7FFF), st.integers(0, 0x3FFF).map(lambda control: control | EN),
    st.sampled_from([0, EN | CIRC | MINC, EN | CIRC | MINC | PINC | DIR, EN | MEM2MEM | MINC]),
)  # fmt: skip
STEPS = st.one_of(
    st.tuples(st.just("set up"), CHANNELS, CONTROLS, st.integers(0, 5), ADDRESSES, ADDRESSES),
    st.tuples(st.just("write"), CHANNELS, st.just("CCR"), CONTROLS),
    st.tuples(st.just("line"), CHANNELS, st.booleans()),
    st.tuples(st.just("pulse"), CHANNELS),
    st.tuples(st.just("burst"), CHANNELS, st.integers(2, 8)),
    st.tuples(st.just("wait"), st.integers(0, 40), st.integers(-1, 1)),
    st.tuples(st.just("write"), CHANNELS, st.sampled_from(["CNDTR", "CPAR", "CMAR"]), st.integers(0, 9)),
    st.tuples(st.just("clear"), st.integers(0, (1 << 28) - 1)),
    st.tuples(st.just("again")),
)  # fmt: skip


def connected(chip: Any) -> Any:
    """Give the chip its memories; return the SRAM."""
    sram, flash = (ctypes.c_char * SRAM_BYTES)(), (ctypes.c_char * 0x100)(*bytes(range(0x100)))
    chip.memories = sram, flash
    chip.pins.fabric.add_memory(SRAM, sram, is_writable=True)
    chip.pins.fabric.add_memory(FLASH, flash, is_writable=False)
    return sram


def set_up(chip: Any, n: int, control: int, count: int, peripheral: int, memory: int) -> None:
    """Disable channel `n` (1 to 7), write its registers, and its control last."""
    for name, value in (("CCR", 0), ("CNDTR", count), ("CPAR", peripheral), ("CMAR", memory), ("CCR", control)):
        chip.write(f"DMA1.{name}{n}", value)


def put(sram: Any, address: int, data: bytes) -> None:
    sram[address - SRAM : address - SRAM + len(data)] = data


def request(chip: Any, n: int, level: bool) -> None:
    """Set the request of channel `n` (1 to 7)."""
    name, _, output = REQUESTS[n - 1].partition(".")
    timer = chip.parts.by_name[name]
    chip.pins.fabric.set_output(timer.slot, timer.OUTPUTS.index(f"{output}_dma"), level)


def ask(chip: Any, n: int) -> None:
    """Pulse the request of channel `n`."""
    request(chip, n, True)
    request(chip, n, False)


def same(chip: Any, model: DmaModel) -> None:
    """Compare everything that a program, the NVIC and the queue see."""
    assert chip.read("DMA1.ISR") == model.isr
    for n, channel in enumerate(model.channels, 1):
        seen = [chip.read(f"DMA1.{name}{n}") for name in ("CCR", "CNDTR", "CPAR", "CMAR")]
        assert seen == [channel.control, channel.count, channel.peripheral, channel.memory]
        assert chip.irqs[10 + n] == model.irqs()[n - 1]
    assert chip.parts.by_name["DMA1"].due_ns == model.due_ns
    assert bytes(chip.memories[0]) == bytes(model.sram)
    assert chip.read("AFIO.EXTICR4") == model.exticr4


def apply(chip: Any, model: DmaModel, name: str, *values: Any) -> None:
    """Do one step with both."""
    if name == "set up":
        n, control, *others = values
        for register, value in zip(("CCR", "CNDTR", "CPAR", "CMAR", "CCR"), (0, *others, control), strict=True):
            apply(chip, model, "write", n, register, value)
    elif name == "write":
        chip.write(f"DMA1.{values[1]}{values[0] + 1}", values[2])
        model.write(*values)
    elif name == "clear":
        chip.write("DMA1.IFCR", values[0])
        model.clear(values[0])
    elif name == "wait":
        at_ns = chip.now_ns + max(0, values[0] * 1_000_000_000 // model.hclk_hz + values[1])
        chip.advance(at_ns)
        model.advance(at_ns)
    elif name == "burst":
        for _ in range(values[1]):
            apply(chip, model, "pulse", values[0])
            apply(chip, model, "wait", 20, 0)
    elif name == "again":
        chip.parts.restore(chip.parts.snapshot())
    else:
        for level in [True, False] if name == "pulse" else [values[1]]:
            request(chip, values[0] + 1, level)
            model.set_line(values[0], level)


@QUICK
@given(steps=st.lists(STEPS, max_size=40), is_fast=st.booleans())
def test_whatever_is_set_up_and_asked_goes_as_in_the_model(
    make_fake_chip: Callable[[], Any], steps: list[tuple[Any, ...]], is_fast: bool
) -> None:
    chip = make_fake_chip()
    sram = connected(chip)
    if is_fast:
        chip.run_at_72_mhz()
    model = DmaModel(chip.clocks.hclk_hz, 5 if is_fast else 3, 3, now_ns=chip.now_ns)
    model.sram[:] = bytes((73 * n + 11 + n // 256) & 0xFF for n in range(SRAM_BYTES))
    put(sram, SRAM, bytes(model.sram))
    for step in steps:
        apply(chip, model, *step)
        same(chip, model)


#: RM0008 table 79: what is written for a word of the source, by the widths.
TABLE_79 = {
    (BYTE, BYTE): "B0", (BYTE, HALF): "B000", (BYTE, WORD): "B0000000",
    (HALF, BYTE): "B0", (HALF, HALF): "B0B1", (HALF, WORD): "B0B10000",
    (WORD, BYTE): "B0", (WORD, HALF): "B0B1", (WORD, WORD): "B0B1B2B3",
}  # fmt: skip


@pytest.mark.parametrize("widths", TABLE_79)
@pytest.mark.parametrize("to_memory", [True, False])
def test_widths_pack_and_truncate_as_the_manual_tabulates(
    fake_chip: Any, widths: tuple[int, int], to_memory: bool
) -> None:
    sram = connected(fake_chip)
    source, target = widths
    put(sram, SRAM, bytes(range(0xB0, 0xC0)))
    sizes = source << 8 | target << 10 if to_memory else target << 8 | source << 10
    places = (SRAM, SRAM + 0x100) if to_memory else (SRAM + 0x100, SRAM)
    set_up(fake_chip, 1, sizes | PINC | MINC | MEM2MEM | EN | (0 if to_memory else DIR), 4, *places)
    fake_chip.advance(4 * 5 * CYCLE_NS)
    row = bytes.fromhex(TABLE_79[widths])
    step = 1 << source
    expected = b"".join(bytes(byte and byte + n * step for byte in row) for n in range(4))
    assert bytes(sram)[0x100 : 0x100 + len(expected)] == expected
    assert fake_chip.read("DMA1.CNDTR1") == 0


@pytest.mark.parametrize(
    ("peripheral", "cycles"), [(SRAM, 1 + 2 + 2), (EXTICR4, 1 + 2 + 3), (0x4001_8000, 1 + 2 + 2), (0x4000_FFFC, 6)]
)
def test_a_transfer_ends_in_its_cycle_and_not_before(fake_chip: Any, peripheral: int, cycles: int) -> None:
    connected(fake_chip)
    set_up(fake_chip, 3, EN | TCIE | TEIE, 1, peripheral, SRAM + 0x40)
    fake_chip.advance(1_000)
    ask(fake_chip, 3)
    fake_chip.advance(1_000 + cycles * CYCLE_NS - 1)
    assert (fake_chip.read("DMA1.CNDTR3"), fake_chip.irqs[13]) == (1, False)
    fake_chip.advance(1_000 + cycles * CYCLE_NS)
    assert fake_chip.irqs[13]


def test_at_72_mhz_an_access_of_apb1_takes_five_cycles(fake_chip: Any) -> None:
    connected(fake_chip)
    fake_chip.run_at_72_mhz()
    start_ns = fake_chip.now_ns
    set_up(fake_chip, 1, EN | MEM2MEM, 1, 0x4000_3000, SRAM)
    assert fake_chip.parts.by_name["DMA1"].due_ns == start_ns + 8 * 1_000 // 72


def test_a_request_while_the_channel_is_off_is_lost_and_a_level_is_not(fake_chip: Any) -> None:
    connected(fake_chip)
    ask(fake_chip, 2)
    set_up(fake_chip, 2, EN, 4, SRAM, SRAM + 0x40)
    fake_chip.advance(10_000)
    assert fake_chip.read("DMA1.CNDTR2") == 4
    fake_chip.write("DMA1.CCR2", 0)
    request(fake_chip, 2, True)
    fake_chip.write("DMA1.CCR2", EN)
    fake_chip.advance(10_000 + 2 * 5 * CYCLE_NS)
    assert fake_chip.read("DMA1.CNDTR2") == 2
    request(fake_chip, 2, False)  # one is under way
    fake_chip.advance(30_000)
    assert fake_chip.read("DMA1.CNDTR2") == 1


def test_a_request_that_waits_is_forgotten_when_its_channel_is_disabled(fake_chip: Any) -> None:
    connected(fake_chip)
    for n in (1, 2):
        set_up(fake_chip, n, EN, 4, SRAM, SRAM + 0x40)
        ask(fake_chip, n)
    for control in (0, EN):
        fake_chip.write("DMA1.CCR2", control)
    fake_chip.advance(10_000)
    assert (fake_chip.read("DMA1.CNDTR1"), fake_chip.read("DMA1.CNDTR2")) == (3, 4)


def test_two_pulses_during_one_transfer_are_one_request(fake_chip: Any) -> None:
    connected(fake_chip)
    set_up(fake_chip, 2, EN, 4, SRAM, SRAM + 0x40)
    for _ in range(3):
        ask(fake_chip, 2)
    fake_chip.advance(10_000)
    assert fake_chip.read("DMA1.CNDTR2") == 2


def test_the_higher_priority_goes_first_and_then_the_lower_number(fake_chip: Any) -> None:
    connected(fake_chip)
    levels = {1: 0, 2: 2, 3: 1, 4: 2, 5: 3, 6: 0, 7: 3}
    for n, level in levels.items():
        set_up(fake_chip, n, EN | level << 12, 1, SRAM, SRAM + 0x40)
    for n in levels:
        ask(fake_chip, n)
    order, seen = [], 0
    for k in range(1, 8):
        fake_chip.advance(k * 5 * CYCLE_NS)
        fresh = fake_chip.read("DMA1.ISR") & ~seen
        seen |= fresh
        order += [n for n in levels if fresh >> 4 * (n - 1) & TCIF]
    assert order == [1, 5, 7, 2, 4, 3, 6]  # the first was under way when the others came


@pytest.mark.parametrize("count", [1, 2, 5, 8])
def test_half_and_complete_come_at_their_transfers_and_a_circle_begins_anew(fake_chip: Any, count: int) -> None:
    connected(fake_chip)
    set_up(fake_chip, 7, EN | CIRC | MINC | HTIE | TCIE, count, SRAM, SRAM + 0x40)
    for turn in range(2):
        for left in range(count - 1, -1, -1):
            ask(fake_chip, 7)
            fake_chip.advance(fake_chip.now_ns + 1_000)
            expected = (HTIF if left == count // 2 else 0) | (0 if left else TCIF)
            assert fake_chip.read("DMA1.ISR") >> 24 == expected | bool(expected), (turn, left)
            assert fake_chip.irqs[17] is bool(expected)
            assert fake_chip.read("DMA1.CNDTR7") == (left or count)
            fake_chip.write("DMA1.IFCR", 1 << 24)
            assert not fake_chip.irqs[17]


def test_a_channel_that_is_done_serves_nothing_until_its_count_is_written_anew(fake_chip: Any) -> None:
    connected(fake_chip)
    set_up(fake_chip, 1, EN, 1, SRAM, SRAM + 0x40)
    for _ in range(3):
        ask(fake_chip, 1)
        fake_chip.advance(fake_chip.now_ns + 1_000)
    assert (fake_chip.read("DMA1.CNDTR1"), fake_chip.read("DMA1.CCR1")) == (0, EN)
    fake_chip.write("DMA1.CNDTR1", 3)
    assert fake_chip.read("DMA1.CNDTR1") == 0
    assert "written while the channel is enabled" in fake_chip.warnings["DMA1:0:0"]
    set_up(fake_chip, 1, EN, 3, SRAM, SRAM + 0x40)
    ask(fake_chip, 1)
    fake_chip.advance(fake_chip.now_ns + 1_000)
    assert fake_chip.read("DMA1.CNDTR1") == 2


@pytest.mark.parametrize(("peripheral", "control"), [(0x4000_7C00, 0), (0, 0), (FLASH, DIR), (0xE000_E010, DIR)])
def test_an_error_of_the_bus_disables_the_channel_and_no_other(fake_chip: Any, peripheral: int, control: int) -> None:
    connected(fake_chip)
    for n in (3, 4):
        set_up(fake_chip, n, EN | TEIE | MINC | control, 2, peripheral if n == 3 else SRAM, SRAM + 0x40)
        ask(fake_chip, n)
    fake_chip.advance(10_000)
    assert fake_chip.read("DMA1.ISR") == (TEIF | 1) << 8 | (HTIF | 1) << 12
    assert fake_chip.irqs[13]
    assert not fake_chip.read("DMA1.CCR3") & EN
    assert fake_chip.read("DMA1.CCR4") & EN
    assert (fake_chip.read("DMA1.CNDTR3"), fake_chip.read("DMA1.CNDTR4")) == (2, 1)


def test_the_request_map_is_that_of_table_78() -> None:
    ends = {name: end[0] for name, end in WIRING.items() if str(end[0]).startswith("DMA1.")}
    by_channel = {n: {name for name, end in ends.items() if end == f"DMA1.ch{n}"} for n in range(1, 8)}
    assert [len(names) for names in by_channel.values()] == [3, 5, 5, 7, 6, 5, 5]
    assert {name: end[-1] for name, end in ends.items() if name.startswith("USART")} == {
        "USART1.tx_dma": "4", "USART1.rx_dma": "5", "USART2.tx_dma": "7", "USART2.rx_dma": "6",
        "USART3.tx_dma": "2", "USART3.rx_dma": "3",
    }  # fmt: skip
    assert by_channel[4] >= {"TIM1.cc4_dma", "TIM1.trig_dma", "TIM1.com_dma", "TIM4.cc2_dma", "I2C2.tx_dma"}
    assert by_channel[1] == {"ADC1.dma", "TIM2.cc3_dma", "TIM4.cc1_dma"}


def test_a_channel_may_disable_itself_and_others_by_what_it_writes(fake_chip: Any) -> None:
    sram = connected(fake_chip)
    own, other = 0x4002_0008, 0x4002_001C
    put(sram, SRAM, bytes(8))
    for to in (own, other):
        set_up(fake_chip, 2, EN | MEM2MEM, 100, SRAM, SRAM + 0x40)
        set_up(fake_chip, 1, EN | MEM2MEM | DIR | WORD << 8 | WORD << 10 | 3 << 12, 4, to, SRAM)
        fake_chip.advance(fake_chip.now_ns + 20_000)
        n = 1 if to == own else 2
        assert fake_chip.read(f"DMA1.CCR{n}") == 0
        assert fake_chip.read(f"DMA1.CCR{3 - n}") & EN
        assert fake_chip.read("DMA1.CNDTR1") == (4 if n == 1 else 0)


def test_a_change_of_the_clock_counts_from_the_next_transfer_on(fake_chip: Any) -> None:
    connected(fake_chip)
    dma = fake_chip.parts.by_name["DMA1"]
    set_up(fake_chip, 1, EN | MEM2MEM, 10, SRAM, SRAM + 0x40)
    fake_chip.advance(CYCLE_NS)
    fake_chip.write("RCC.CFGR", 8 << 4)  # HCLK 4 MHz
    assert dma.due_ns == 5 * CYCLE_NS
    fake_chip.advance(5 * CYCLE_NS)
    assert dma.due_ns == 5 * CYCLE_NS + 5 * 2 * CYCLE_NS


def test_in_stop_mode_a_transfer_stands_still(fake_chip: Any) -> None:
    connected(fake_chip)
    dma = fake_chip.parts.by_name["DMA1"]
    set_up(fake_chip, 1, EN | MEM2MEM, 2, SRAM, SRAM + 0x40)
    fake_chip.advance(2 * CYCLE_NS)
    dma.clock_stopped()
    fake_chip.advance(5_000_000_002 * CYCLE_NS)
    assert fake_chip.read("DMA1.CNDTR1") == 2
    dma.clock_resumed(5_000_000_000 * CYCLE_NS)
    fake_chip.advance(5_000_000_005 * CYCLE_NS - 1)
    assert fake_chip.read("DMA1.CNDTR1") == 2
    fake_chip.advance(5_000_000_005 * CYCLE_NS)
    assert fake_chip.read("DMA1.CNDTR1") == 1


# With USARTs.

UE, TE, RE, DMAR, DMAT, EIE = 1 << 13, 8, 4, 1 << 6, 1 << 7, 1
#: 57 600 bit/s at 8 MHz.
BRR = 139
CHARACTER_NS = 10 * BRR * CYCLE_NS
#: TX and RX channel, control register and mode of the TX pin, and clock gate.
PORTS = {1: (4, 5, "GPIOA.CRH", 4), 2: (7, 6, "GPIOA.CRL", 8), 3: (2, 3, "GPIOB.CRH", 8)}


@pytest.mark.parametrize("number", PORTS)
def test_a_text_goes_out_and_comes_in_by_dma_without_a_gap(fake_chip: Any, number: int) -> None:
    sram = connected(fake_chip)
    tx, rx, register, at = PORTS[number]
    fake_chip.write(register, 0x4444_4444 & ~(0xF << at) | 0xB << at)
    usart, name = fake_chip.parts.usart(number), f"USART{number}"
    sent: list[tuple[int, int]] = []
    usart.sinks.append(sent.extend)
    fake_chip.write(f"{name}.BRR", BRR)
    fake_chip.write(f"{name}.CR1", UE | TE | RE)
    fake_chip.advance(2 * CHARACTER_NS)
    put(sram, SRAM, b"hello, robot")
    data = usart.base + 4
    set_up(fake_chip, tx, EN | DIR | MINC | TCIE, 12, data, SRAM)
    set_up(fake_chip, rx, EN | MINC | TCIE, 5, data, SRAM + 0x40)
    start_ns = fake_chip.now_ns
    fake_chip.write(f"{name}.CR3", DMAR | DMAT)
    usart.receive(b"world")
    fake_chip.advance(start_ns + 13 * CHARACTER_NS)
    assert bytes(word for word, _ in sent) == b"hello, robot"
    first_ns = start_ns + (1 + 2 + fake_chip.parts.by_name["DMA1"].native.apb2_cycles) * CYCLE_NS
    assert [ns for _, ns in sent] == [first_ns + n * CHARACTER_NS for n in range(1, 13)]
    assert bytes(sram)[0x40:0x45] == b"world"
    assert fake_chip.irqs[10 + tx]
    assert fake_chip.irqs[10 + rx]
    assert not fake_chip.read(f"{name}.SR") & 1 << 5
    assert fake_chip.warnings == {}


def test_a_receiver_that_is_not_served_overruns_and_eie_says_so(fake_chip: Any) -> None:
    connected(fake_chip)
    fake_chip.write("USART1.BRR", BRR)
    fake_chip.write("USART1.CR1", UE | RE)
    fake_chip.write("USART1.CR3", DMAR | EIE)
    fake_chip.parts.usart(1).receive(b"ab")
    fake_chip.advance(2 * CHARACTER_NS - 1)
    assert not fake_chip.irqs[37]
    fake_chip.advance(2 * CHARACTER_NS)
    assert fake_chip.irqs[37]
    fake_chip.write("USART1.CR3", EIE)
    assert not fake_chip.irqs[37]
