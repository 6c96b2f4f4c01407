"""What stands still with its clock: in Stop mode, and where DBGMCU_CR freezes it while a debugger halts the core."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.low_power import PowerMode
from bluepill_sim.fabric.subscriptions import EDGE, Of
from bluepill_sim.parts import CanFrame, CanNode
from tests.bluepill_sim.peripherals.buses import test_can, test_i2c, test_spi

#: More than 32 bits of ns.
TICK_NS, STOP_NS = 125, 5_000_000_003
CEN, UIF, CC1IF, BIF, BKE, BKP, MOE = 1, 1, 2, 1 << 7, 1 << 12, 1 << 13, 1 << 15
TIMERS = ("TIM1", "TIM2", "TIM3", "TIM4")
UPDATE_IRQ = {"TIM1": 25, "TIM2": 28, "TIM3": 29, "TIM4": 30}
DBGMCU_CR, APB2ENR, APB1ENR = 0xE004_2004, 0x4002_1018, 0x4002_101C
BASE = {"TIM1": 0x4001_2C00, "TIM2": 0x4000_0000, "TIM3": 0x4000_0400, "TIM4": 0x4000_0800}
QUICK = settings(max_examples=25)
Chips = Callable[[], Any]


def store(address: int, value: int) -> str:
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


def stand_still(chip: Any, *names: str, span_ns: int = STOP_NS) -> None:
    """Stop the clocks of some peripherals for a while."""
    parts = [chip.parts.by_name[name] for name in names]
    for part in parts:
        part.clock_stopped()
    chip.advance(chip.now_ns + span_ns)
    for part in parts:
        part.clock_resumed(span_ns)


@pytest.fixture(params=["native", "python"])
def make(request: pytest.FixtureRequest, boot: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("P2OS_CORE", request.param)
    return boot


@pytest.mark.parametrize("name", TIMERS)
@pytest.mark.parametrize("stops_at", [10 * TICK_NS, 11 * TICK_NS - 1, 11 * TICK_NS, 11 * TICK_NS + 1])
def test_an_update_event_comes_as_much_later_as_the_clock_stood(fake_chip: Any, name: str, stops_at: int) -> None:
    """ARR = 9 and one clock of delay: the first overflow is at tick 11, the next ten ticks later."""
    for register, value in (("ARR", 9), ("DIER", 1), ("CR1", CEN)):
        fake_chip.write(f"{name}.{register}", value)
    fake_chip.advance(stops_at)
    irq, had_come = UPDATE_IRQ[name], stops_at >= 11 * TICK_NS
    assert fake_chip.irqs[irq] is had_come
    count = fake_chip.read(f"{name}.CNT")
    stand_still(fake_chip, name, span_ns=400 * TICK_NS)
    assert (fake_chip.read(f"{name}.CNT"), fake_chip.irqs[irq]) == (count, had_come)
    fake_chip.write(f"{name}.SR", 0)
    due_ns = ((21 if had_come else 11) + 400) * TICK_NS
    fake_chip.advance(due_ns - 1)
    assert not fake_chip.irqs[irq]
    fake_chip.advance(due_ns)
    assert fake_chip.irqs[irq]


@QUICK
@given(
    stops_at=st.integers(0, 2_000), spans=st.lists(st.integers(0, 400), min_size=1, max_size=4),
    arr=st.integers(1, 30), psc=st.integers(0, 3), control=st.sampled_from([CEN, CEN | 0x10, CEN | 0x60]),
)  # fmt: skip
def test_a_counter_goes_on_from_where_it_stood(
    make_fake_chip: Chips, stops_at: int, spans: list[int], arr: int, psc: int, control: int
) -> None:
    """Stops of whole ticks: what is read is what a chip reads that stood for none of them."""
    stopped, other = make_fake_chip(), make_fake_chip()
    for chip in (stopped, other):
        for register, value in (("ARR", arr), ("PSC", psc), ("EGR", 1), ("SR", 0), ("CR1", control)):
            chip.write(f"TIM3.{register}", value)
        chip.advance(stops_at)
    for span in spans:
        stand_still(stopped, "TIM3", span_ns=span * TICK_NS)
        for chip in (stopped, other):
            chip.advance(chip.now_ns + 777)
            found = [chip.parts.by_name["TIM3"].look(offset) for offset in (0, 0x10, 0x24)]
            if chip is stopped:
                wanted = found
        assert found == wanted


def test_an_output_holds_its_level_and_its_edges_come_later(fake_chip: Any) -> None:
    """PWM of 3 in 10: high from tick 11 to 14; the clock stands from tick 12 on."""
    fake_chip.write("GPIOA.CRL", 0x4444_444B)
    edges: list[tuple[int, int]] = []
    fake_chip.pins.subscribe_pins(
        ("PA0",), lambda rows: edges.extend((row[0], row[3]) for row in EDGE.iter_unpack(rows)), of=Of.WIRE
    )
    for register, value in (("ARR", 9), ("CCR1", 3), ("CCMR1", 0x60), ("CCER", 1), ("EGR", 1), ("CR1", CEN)):
        fake_chip.write(f"TIM2.{register}", value)
    fake_chip.advance(12 * TICK_NS)
    del edges[:]
    stand_still(fake_chip, "TIM2", span_ns=1000 * TICK_NS)
    assert fake_chip.pins["PA0"].level
    fake_chip.advance((1000 + 35) * TICK_NS)
    ticks = [(1000 + tick) * TICK_NS for tick in (14, 21, 24, 31, 34)]
    assert [(ns, level) for ns, level in edges if ns > 12 * TICK_NS] == [(ns, n % 2) for n, ns in enumerate(ticks)]


@pytest.mark.parametrize(("end", "captures"), [(False, 0), (True, 1)])
def test_an_edge_that_lasts_is_captured_when_the_clock_is_back(fake_chip: Any, end: bool, captures: int) -> None:
    pin, part = fake_chip.pins["PA0"], fake_chip.parts.by_name["TIM2"]
    pin.drive(False)
    for register, value in (("CCMR1", 1), ("CCER", 1), ("CR1", CEN)):
        fake_chip.write(f"TIM2.{register}", value)
    fake_chip.advance(100 * TICK_NS)
    part.clock_stopped()
    fake_chip.advance(150 * TICK_NS)
    pin.drive(True)
    fake_chip.advance(160 * TICK_NS)
    pin.drive(end)
    assert not part.look(0x10) & CC1IF
    fake_chip.advance(200 * TICK_NS)
    part.clock_resumed(100 * TICK_NS)
    assert bool(part.look(0x10) & CC1IF) is bool(captures)
    assert not captures or fake_chip.read("TIM2.CCR1") == 99


def test_the_break_needs_no_clock(fake_chip: Any) -> None:
    """RM0008 14.3.12: it "functions even if the MCU oscillator is off"."""
    fake_chip.write("GPIOA.CRH", 0x4444_444B)
    fake_chip.pins["PB12"].drive(False)
    for register, value in (("CCMR1", 0x50), ("CCER", 1), ("BDTR", MOE | BKE | BKP | 1 << 10)):
        fake_chip.write(f"TIM1.{register}", value)
    fake_chip.advance(TICK_NS * 10)
    assert fake_chip.pins["PA8"].level
    fake_chip.parts.by_name["TIM1"].clock_stopped()
    fake_chip.advance(TICK_NS * 20)
    fake_chip.pins["PB12"].drive(True)
    assert not fake_chip.pins["PA8"].level
    assert (fake_chip.read("TIM1.BDTR") & MOE, fake_chip.read("TIM1.SR") & BIF) == (0, BIF)


@pytest.mark.parametrize("enables", [0, BKE])
@pytest.mark.parametrize("polarity", [0, BKP])
def test_the_clock_security_system_breaks_tim1_where_bke_lets_it(fake_chip: Any, enables: int, polarity: int) -> None:
    """RM0008 7.2.7, 14.3.12; BKP is that of the pin alone. MOE can be set again: the failure is an event."""
    fake_chip.pins["PB12"].drive(not polarity)
    fake_chip.write("RCC.CR", fake_chip.read("RCC.CR") | 1 << 16 | 1 << 19)
    fake_chip.advance(2_000_000)
    fake_chip.write("TIM1.DIER", 0x80)
    fake_chip.write("TIM1.BDTR", MOE | enables | polarity)
    assert fake_chip.read("TIM1.SR") == 0
    fake_chip.parts.rcc.fail_crystal()
    assert bool(fake_chip.read("TIM1.SR") & BIF) is bool(enables)
    assert fake_chip.irqs[24] is bool(enables)
    assert bool(fake_chip.read("TIM1.BDTR") & MOE) is not bool(enables)
    fake_chip.write("TIM1.SR", 0)
    fake_chip.write("TIM1.BDTR", MOE | enables | polarity)
    assert (fake_chip.read("TIM1.SR"), fake_chip.read("TIM1.BDTR") & MOE) == (0, MOE)


def running_timers() -> str:
    program = store(APB1ENR, 0x1000_0007) + store(APB2ENR, 0x805)
    return program + "".join(store(base, CEN) for base in BASE.values())


def counts(machine: Any) -> list[int]:
    return [machine.board.chip.parts.by_name[name].look(0x24) for name in TIMERS]


@pytest.mark.parametrize("frozen", [(), *((name,) for name in TIMERS), TIMERS])
def test_each_timer_stands_at_a_halt_where_its_bit_says_so(make: Any, frozen: tuple[str, ...]) -> None:
    bits = sum(1 << 10 + TIMERS.index(name) for name in frozen)
    machine = make(running_timers() + store(DBGMCU_CR, bits) + "b stop").run(100)
    before = counts(machine)
    with machine.board.chip.halted_core():
        machine.board.run_for("1 ms")
    passed = [(after - count) % 0x10000 for after, count in zip(counts(machine), before, strict=True)]
    assert passed == [0 if name in frozen else 8000 for name in TIMERS]
    machine.run(100)
    assert all(after != count for after, count in zip(counts(machine), before, strict=True))


def test_timers_stand_still_in_stop_and_a_snapshot_there_goes_on_alike(make: Any) -> None:
    machine = make(
        running_timers() + store(0x4001_0408, 1 << 4) + store(0x4001_0400, 1 << 4) + store(0xE000_E100, 1 << 10)
        + store(0xE000_ED10, 4) + "cpsid i\nwfi\nb stop"
    ).run(500)  # fmt: skip
    board = machine.board
    assert board.chip.low_power.mode is PowerMode.STOP
    before = counts(machine)
    machine.run(5000)
    assert counts(machine) == before
    saved = board.snapshot()
    board.pin("PA4").drive(True)
    machine.run(1000)
    after = counts(machine)
    passed = [(late - early) % 0x10000 for late, early in zip(after, before, strict=True)]
    assert len(set(passed)) == 1
    assert 0 < passed[0] < 1000 * 8
    board.restore(saved)
    assert counts(machine) == before
    board.pin("PA4").drive(True)
    machine.run(1000)
    assert counts(machine) == after


def test_a_word_of_the_spi_takes_as_much_longer(fake_chip: Any) -> None:
    part = test_spi.Recorder(b"\x5a")
    test_spi.set_up(fake_chip, device=part)
    fake_chip.write("SPI1.DR", 0x9F)
    fake_chip.advance(fake_chip.now_ns + 500)
    stand_still(fake_chip, "SPI1")
    end_ns = STOP_NS + test_spi.WORD_NS
    fake_chip.advance(end_ns - 1)
    assert part.bytes == []
    fake_chip.advance(end_ns)
    assert part.heard[-1] == (0x9F, end_ns)


def test_a_byte_of_the_i2c_takes_as_much_longer(fake_chip: Any) -> None:
    part = test_i2c.set_up(fake_chip)
    test_i2c.start(fake_chip, 0xA0)
    test_i2c.clear_addr(fake_chip)
    began_ns = fake_chip.now_ns
    fake_chip.write("I2C1.DR", 0x55)
    test_i2c.wait(fake_chip, 40_000)
    stand_still(fake_chip, "I2C1")
    fake_chip.advance(began_ns + test_i2c.DATA_NS + STOP_NS - 1)
    assert 0x55 not in part.words
    fake_chip.advance(began_ns + test_i2c.BYTE_NS + STOP_NS)
    assert part.log[-1] == ("write", 0x55, began_ns + test_i2c.DATA_NS + STOP_NS)


def test_a_slave_in_stop_is_called_when_its_clock_is_back(fake_chip: Any) -> None:
    test_i2c.set_up(fake_chip, test_i2c.ACK)
    fake_chip.write("I2C1.OAR1", 0x30 << 1)
    part = fake_chip.parts.by_name["I2C1"]
    part.clock_stopped()
    fake_chip.advance(STOP_NS - 300_000)
    part.call(0x30, b"\x01")
    fake_chip.advance(STOP_NS)
    part.clock_resumed(STOP_NS)
    test_i2c.wait(fake_chip, test_i2c.BYTE_NS + test_i2c.BIT_NS - 1)
    assert not test_i2c.sr1(fake_chip) & test_i2c.ADDR
    test_i2c.wait(fake_chip, 1)
    assert test_i2c.sr1(fake_chip) & test_i2c.ADDR


@pytest.mark.parametrize("holds_before", [True, False])
def test_a_halt_freezes_the_smbus_timeout_and_no_more_of_the_i2c(fake_chip: Any, holds_before: bool) -> None:
    test_i2c.set_up(fake_chip, test_i2c.SMBUS)
    part, scl = fake_chip.parts.by_name["I2C1"], fake_chip.pins["PB6"]
    if holds_before:
        scl.drive(False)
        test_i2c.wait(fake_chip, 10_000_000)
    part.freeze()
    test_i2c.wait(fake_chip, 20_000_000)
    scl.drive(False)
    test_i2c.wait(fake_chip, STOP_NS)
    assert not test_i2c.sr1(fake_chip) & test_i2c.TIMEOUT
    part.thaw(20_000_000 + STOP_NS)
    left_ns = 15_000_000 if holds_before else 25_000_000
    test_i2c.wait(fake_chip, left_ns - 1)
    assert not test_i2c.sr1(fake_chip) & test_i2c.TIMEOUT
    test_i2c.wait(fake_chip, 1)
    assert test_i2c.sr1(fake_chip) & test_i2c.TIMEOUT


def test_a_byte_goes_on_while_a_halt_freezes_the_timeout(fake_chip: Any) -> None:
    part = test_i2c.set_up(fake_chip)
    test_i2c.start(fake_chip, 0xA0)
    test_i2c.clear_addr(fake_chip)
    fake_chip.write("I2C1.DR", 0x55)
    fake_chip.parts.by_name["I2C1"].freeze()
    test_i2c.wait(fake_chip, test_i2c.BYTE_NS)
    assert part.log[-1][:2] == ("write", 0x55)


def test_frames_of_others_are_lost_in_stop_and_an_own_one_ends_later(fake_chip: Any) -> None:
    node, span_ns = CanNode(), 50_000_000
    test_can.network(fake_chip, node)
    test_can.set_up(fake_chip)
    part = fake_chip.parts.by_name["CAN"]
    began_ns = fake_chip.now_ns
    test_can.send(fake_chip, 0x123, b"\x01")
    frame = CanFrame(identifier=0x123, data=b"\x01")
    fake_chip.advance(began_ns + 30 * test_can.BIT_NS)
    part.clock_stopped()
    fake_chip.advance(began_ns + 10_000_000)
    node.send(CanFrame(identifier=0x55, data=b""))
    fake_chip.advance(began_ns + 30 * test_can.BIT_NS + span_ns)
    assert node.errors > 10, "nobody acknowledges"
    assert not fake_chip.read("CAN.TSR") & test_can.RQCP
    part.clock_resumed(span_ns)
    fake_chip.advance(began_ns + test_can.span_ns(frame) + span_ns - 1)
    assert not fake_chip.read("CAN.TSR") & test_can.RQCP
    fake_chip.advance(began_ns + test_can.span_ns(frame) + span_ns)
    assert fake_chip.read("CAN.TSR") & test_can.RQCP
    fake_chip.advance(fake_chip.now_ns + 1_000_000)
    assert fake_chip.read("CAN.RF0R") & 3 == 1, "the node tries until it is heard"
