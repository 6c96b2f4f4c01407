"""The clock of a synchronous USART on CK: its pulses, where a bit is taken, to the nanosecond (RM0008 27.3.9)."""

from typing import Any

import pytest

from bluepill_sim.fabric.pins import PinDrive
from tests.bluepill_sim.machine import Machine
from tests.bluepill_sim.peripherals.usart.test_usart_modes import ON, seen
from tests.bluepill_sim.peripherals.usart.usart_line import BRR, CHARACTER_NS, TE, UE, M, set_up

LBCL, CPHA, CPOL, CLKEN = 1 << 8, 1 << 9, 1 << 10, 1 << 11
MODES = [CLKEN | lbcl | cpha | cpol for lbcl in (0, LBCL) for cpha in (0, CPHA) for cpol in (0, CPOL)]
#: PA8 and PA9 as alternate outputs.
PINS = 0x4444_44BB


def half_bits_ns(halves: int) -> int:
    return halves * BRR * 1000 // 16


def clocked(chip: Any, mode: int, control: int = 0) -> list[bytes]:
    """Set USART1 up with a clock; return where the edges of PA8 come to."""
    set_up(chip, control)
    chip.write("GPIOA.CRH", PINS)
    chip.write("USART1.CR2", mode)
    rows: list[bytes] = []
    chip.pins.subscribe_pins(["PA8"], rows.append)
    return rows


def expected(mode: int, bits: int) -> list[tuple[int, bool]]:
    """Return the edges of a character: by RM0008 figures 284 and 285."""
    idle, first = bool(mode & CPOL), 0 if mode & CPHA else 1
    pulses = bits if mode & LBCL else bits - 1
    return [
        (half_bits_ns(2 + 2 * n + first + edge), idle if edge else not idle) for n in range(pulses) for edge in (0, 1)
    ]


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("control", [0, M])
def test_each_data_bit_has_its_pulse(fake_chip: Any, mode: int, control: int) -> None:
    rows = clocked(fake_chip, mode, control)
    assert fake_chip.pins["PA8"].level is bool(mode & CPOL)
    start_ns = fake_chip.now_ns
    fake_chip.write("USART1.DR", 0x35)
    fake_chip.write("USART1.DR", 0xCA)
    frame = 2 * (11 if control else 10)
    fake_chip.advance(start_ns + half_bits_ns(2 * frame))
    bits = 9 if control else 8
    shifted = half_bits_ns(frame)
    once = expected(mode, bits)
    found = [(at_ns - start_ns, level) for at_ns, level in seen(b"".join(rows))]
    assert found[: len(once)] == once
    assert [level for _, level in found[len(once) :]] == [level for _, level in once]
    # Derived, not accumulated: half a nanosecond is dropped anew at each edge.
    assert all(0 <= at - shifted - first <= 1 for (at, _), (first, _) in zip(found[len(once) :], once, strict=True))


@pytest.mark.parametrize("mode", MODES)
def test_the_first_pulse_comes_in_its_nanosecond(fake_chip: Any, mode: int) -> None:
    clocked(fake_chip, mode)
    start_ns, idle = fake_chip.now_ns, bool(mode & CPOL)
    first = half_bits_ns(2 if mode & CPHA else 3)
    fake_chip.write("USART1.DR", 0x35)
    fake_chip.advance(start_ns + first - 1)
    assert fake_chip.pins["PA8"].level is idle
    fake_chip.advance(start_ns + first)
    assert fake_chip.pins["PA8"].level is not idle


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("early", [0, 1])
def test_rx_is_taken_where_the_bit_stands_still(fake_chip: Any, mode: int, early: int) -> None:
    """A pulse on RX that begins with, or a nanosecond behind, the edge of bit 3, and ends likewise at bit 5."""
    clocked(fake_chip, mode)
    rx, start_ns = fake_chip.pins["PA10"], fake_chip.now_ns
    rx.drive(False)
    fake_chip.write("USART1.DR", 0x35)
    for bit, level in ((3, True), (5, False)):
        fake_chip.advance(start_ns + half_bits_ns(2 + 2 * bit + 1) - early)
        rx.drive(level)
    fake_chip.advance(start_ns + CHARACTER_NS)
    assert fake_chip.read("USART1.DR") == (0b0001_1000 if early else 0b0011_0000)


def test_the_last_bit_has_no_pulse_without_lbcl_and_is_taken_as_it_ends(fake_chip: Any) -> None:
    clocked(fake_chip, CLKEN)
    rx, start_ns = fake_chip.pins["PA10"], fake_chip.now_ns
    rx.drive(False)
    fake_chip.write("USART1.DR", 0x35)
    fake_chip.advance(start_ns + half_bits_ns(2 + 2 * 6 + 1))
    rx.drive(True)
    fake_chip.advance(start_ns + CHARACTER_NS)
    assert fake_chip.read("USART1.DR") & 0xFF == 0x80


@pytest.mark.parametrize(
    ("register", "value", "level"),
    [("CR1", UE, True), ("CR1", 0, None), ("CR2", CLKEN, False), ("CR2", 0, None), ("BRR", 100, True)],
)
def test_a_character_that_is_cut_off_leaves_the_clock_idle(
    fake_chip: Any, register: str, value: int, level: bool | None
) -> None:
    """In the middle of its first pulse; what USART lets go floats."""
    rows = clocked(fake_chip, CLKEN | CPOL)
    start_ns = fake_chip.now_ns
    fake_chip.write("USART1.DR", 0x35)
    fake_chip.advance(start_ns + half_bits_ns(3))
    if register == "CR2":
        fake_chip.write("USART1.CR1", ON & ~TE)
    fake_chip.write(f"USART1.{register}", value)
    fake_chip.advance(start_ns + CHARACTER_NS)
    pin = fake_chip.pins["PA8"]
    assert pin.output is (PinDrive.NONE if level is None else PinDrive.HIGH if level else PinDrive.LOW)
    assert len(seen(b"".join(rows))) <= 3


def test_the_clock_costs_nothing_while_nobody_looks(fake_chip: Any) -> None:
    set_up(fake_chip)
    fake_chip.write("GPIOA.CRH", PINS)
    fake_chip.write("USART1.CR2", CLKEN | LBCL)
    fake_chip.write("USART1.DR", 0x55)
    assert fake_chip.parts.usart(1).native.ck_edges == 0
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    assert not fake_chip.pins["PA8"].level


def test_idle_characters_and_breaks_have_no_clock(fake_chip: Any) -> None:
    rows = clocked(fake_chip, CLKEN | LBCL)
    fake_chip.write("USART1.CR1", UE)
    fake_chip.write("USART1.CR1", ON)
    fake_chip.advance(fake_chip.now_ns + 2 * CHARACTER_NS)
    fake_chip.write("USART1.CR1", ON | 1)
    fake_chip.advance(fake_chip.now_ns + 2 * CHARACTER_NS)
    assert [level for _, level in seen(b"".join(rows))] in ([], [False], [False, False])


PROGRAM = """
mov32 r0, #0x40021018
mov32 r1, #0x00004005
str r1, [r0, #0]
mov32 r0, #0x40010804
mov32 r1, #0x444444BB
str r1, [r0, #0]
mov32 r6, #0x40013800
movs r1, #80
str r1, [r6, #8]
mov32 r1, #0x0B00
str r1, [r6, #16]
mov32 r1, #0x200C
str r1, [r6, #12]
wait: ldr r0, [r6, #0]
cmp r0, #0xC0
bne wait
movs r4, #3
more: movs r1, #0x5A
str r1, [r6, #4]
sent: ldr r0, [r6, #0]
adds r0, #64
ldr r2, [r6, #0]
mov32 r3, #0x20
cmp r2, #0xE0
bne sent
ldr r0, [r6, #4]
log r0
subs r4, #1
bne more
b stop
"""


def test_a_run_is_the_same_on_both_cores_in_slices_and_from_a_snapshot() -> None:
    """A shift register on TX and CK reads what was sent; RX is given by the clock of the test."""
    found = []
    for core, slice_us, cut_us in [
        ("native", None, None),
        ("python", None, None),
        ("native", 3, None),
        ("native", None, 77),
    ]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("P2OS_CORE", core)
            machine = Machine(PROGRAM, {})
            machine.board.pin("PA10").drive_later([(160_000 + 20_000 * n, n % 3 != 0) for n in range(1, 30)])
            if cut_us is not None:
                machine.run(cut_us)
                snapshot, edges = machine.board.snapshot(), list(machine.edges)
                machine = Machine(PROGRAM, {})
                machine.board.restore(snapshot)
                machine.edges[:0] = edges
            machine.run(600 - (cut_us or 0), slice_us)
            found.append((machine.log, machine.edges, machine.board.now_ns))
    assert len(found[0][0]) == 3
    assert len({tuple(log) for log, _, _ in found}) == 1
    assert all(other[:2] == found[0][:2] for other in found[1:])
    assert shifted_in(found[0][1]) == [0x5A] * 3


def shifted_in(edges: list[tuple[str, str, int]]) -> list[int]:
    """Return the bytes that a shift register takes from PA9 at each falling edge of PA8, the lowest bit first."""
    level, bits = {"PA8": "none", "PA9": "none"}, []
    for pin, drive, _ in edges:
        if (pin, level.get(pin), drive) == ("PA8", "high", "low"):
            bits.append(level["PA9"] == "high")
        level[pin] = drive
    return [sum(bit << n for n, bit in enumerate(bits[at : at + 8])) for at in range(0, len(bits), 8)]
