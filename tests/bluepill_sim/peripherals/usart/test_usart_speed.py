"""USART and a far end of another speed: damage both ways, the measured speed, and what is warned of."""

from typing import Any

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from bluepill_sim.board import BluePill
from bluepill_sim.errors import BluePillError
from bluepill_sim.extension.library import library_path
from bluepill_sim.fabric.line_speed import USUAL_BAUDS, Heard, heard, is_usual
from tests.bluepill_sim.machine import Machine
from tests.bluepill_sim.peripherals.usart.usart_line import CHARACTER_NS, IRQ, ORE, PCE, RXNE, set_up, status

PE, FE, NE, PEIE = 1, 2, 4, 1 << 8
EIE, DMAR = 1 << 0, 1 << 6
TEXT = b"ready 1\nready 2\n"
CORES = ["python", pytest.param("native", marks=pytest.mark.skipif(library_path() is None, reason="not built"))]


@pytest.mark.parametrize(("baud", "usual"), [(9408, True), (9407, False), (9792, True), (9793, False)])
def test_a_usual_speed_is_within_two_percent_of_one(baud: int, usual: bool) -> None:
    assert is_usual(baud) == usual


def sender(brr: int, text: bytes = TEXT) -> str:
    """A program that sets USART1 up at 8 MHz and sends a text, waiting for TXE."""
    start = (
        "mov32 r1, #0x40021018\nmov32 r2, #0x4004\nstr r2, [r1, #0]\n"
        "mov32 r1, #0x40010804\nmov32 r2, #0x444444b4\nstr r2, [r1, #0]\n"
        f"mov32 r1, #0x40013800\nmov32 r2, #{brr}\nstr r2, [r1, #8]\nmov32 r2, #0x200c\nstr r2, [r1, #12]\n"
    )
    sends = "".join(
        f"wait{n}: ldr r2, [r1, #0]\nmovs r3, #128\nmov r4, r2\n.half 0x401c\ncmp r4, #0\nbeq wait{n}\n"
        f"movs r2, #{byte}\nstr r2, [r1, #4]\n"
        for n, byte in enumerate(text)
    )
    return start + sends


def sent(core: str, monkeypatch: Any, brr: int, far_baud: int | None, ms: int = 20) -> tuple[bytes, BluePill]:
    monkeypatch.setenv("P2OS_CORE", core)
    board = Machine(sender(brr), {}).board
    board.usart1.far_baud = far_baud
    board.run_for(ms * 1_000_000)
    return board.usart1.read(), board


@pytest.mark.parametrize("core", CORES)
def test_a_divider_of_another_clock_is_measured_and_warned_of(core: str, monkeypatch: Any, watchdog: None) -> None:
    # BRR 625 is 115200 at 72 MHz; the chip is left at 8 MHz: 12800.
    text, board = sent(core, monkeypatch, 625, None)
    assert text == TEXT
    assert (board.usart1.measured_baud, board.usart1.speeds) == (12800, {12800: len(TEXT)})
    (warning,) = board.warnings
    assert warning.startswith(
        "USART1 is at 12800 bit/s, more than 2 % from every usual speed (nearest: 14400): "
        "PCLK is 8000000 Hz and BRR 625 at start+0x"
    )


@pytest.mark.parametrize("core", CORES)
def test_a_far_end_of_another_speed_hears_damage_and_that_is_said(core: str, monkeypatch: Any, watchdog: None) -> None:
    text, board = sent(core, monkeypatch, 625, 115200)
    assert text
    assert b"ready" not in text
    assert (
        "USART1 is at 12800 bit/s and the far end at 115200: characters arrive damaged at start+0x" in board.warnings[0]
    )
    assert sent(core, monkeypatch, 69, 115200)[0] == TEXT


def test_both_executors_hear_the_same_damage(monkeypatch: Any, watchdog: None) -> None:
    for brr, far in ((625, 115200), (69, 9600), (69, 121000), (69, 130000)):
        runs = [sent(core, monkeypatch, brr, far) for core in ("python", "native" if library_path() else "python")]
        assert runs[0][0] == runs[1][0]
        assert runs[0][1].warnings == runs[1][1].warnings
        assert runs[0][1].usart1.speeds == runs[1][1].usart1.speeds


def test_what_comes_in_at_another_speed_is_damaged_too(fake_chip: Any) -> None:
    set_up(fake_chip)
    usart = fake_chip.parts.usart(1)
    for far_baud, is_whole in ((115200, True), (104000, False), (116000, True), (9600, False)):
        usart.far_baud = far_baud
        usart.receive(b"U")
        fake_chip.advance(fake_chip.now_ns + 200_000)
        assert (bool(status(fake_chip) & RXNE) and fake_chip.read("USART1.DR") == ord("U")) is is_whole, far_baud
        fake_chip.advance(fake_chip.now_ns + 2_000_000)
        while status(fake_chip) & RXNE:
            fake_chip.read("USART1.DR")


@pytest.mark.parametrize("core", CORES)
def test_a_firmware_reads_fe_with_the_character_and_clears_it_by_sr_then_dr(
    core: str, monkeypatch: Any, watchdog: None
) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    # Half our speed: start and eight bits of 0 last 18 of our bits, so that our stop bit, at 9.5 of them, reads 0.
    machine = Machine(
        sender(69, b"") + "wait: ldr r0, [r1, #0]\nmov r4, r0\nmovs r3, #32\n.half 0x401c\ncmp r4, #0\nbeq wait\n"
        "log r0\nldr r0, [r1, #4]\nlog r0\nldr r0, [r1, #0]\nlog r0\n",
        {},
    )
    board = machine.board
    board.run_for(1_000_000)
    board.usart1.far_baud = 57600
    board.usart1.receive(b"\0")
    board.run_for(1_000_000)
    seen, word, after = machine.log
    assert (seen & (FE | NE | RXNE), word, after & (FE | NE | RXNE)) == (FE | RXNE, 0, 0)


def test_flags_rise_with_the_character_that_they_belong_to(fake_chip: Any) -> None:
    set_up(fake_chip)
    usart = fake_chip.parts.usart(1)
    usart.far_baud = 57971  # half of ours
    usart.receive(b"\0")
    end_ns = fake_chip.now_ns + CHARACTER_NS
    fake_chip.advance(end_ns - 1)
    assert not status(fake_chip) & (FE | RXNE)
    fake_chip.advance(end_ns)
    assert status(fake_chip) & (PE | FE | NE | ORE | RXNE) == FE | RXNE


def test_a_character_that_is_lost_to_an_overrun_brings_no_fe(fake_chip: Any) -> None:
    set_up(fake_chip)
    usart = fake_chip.parts.usart(1)
    usart.receive(b"U")
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    usart.far_baud = 57971
    usart.receive(b"\0")
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    assert status(fake_chip) & (FE | ORE | RXNE) == ORE | RXNE


@pytest.mark.parametrize(("enables", "raises"), [(0, False), (EIE, False), (DMAR, False), (EIE | DMAR, True)])
@pytest.mark.parametrize(("baud", "flag"), [(57971, FE), (0, ORE)])
def test_errors_interrupt_by_eie_where_dma_takes_the_characters(
    fake_chip: Any, enables: int, raises: bool, baud: int, flag: int
) -> None:
    set_up(fake_chip)
    fake_chip.write("USART1.CR3", enables)
    usart = fake_chip.parts.usart(1)
    usart.far_baud = baud or None
    for _ in range(1 if baud else 2):
        usart.receive(b"\0")
        fake_chip.advance(fake_chip.now_ns + 2 * CHARACTER_NS)
    assert status(fake_chip) & (FE | ORE) == flag
    assert fake_chip.irqs[IRQ] is raises


@pytest.mark.parametrize("enable", [0, PEIE])
def test_a_parity_that_does_not_fit_raises_pe_and_its_interrupt(fake_chip: Any, enable: int) -> None:
    set_up(fake_chip, PCE | enable)
    usart = fake_chip.parts.usart(1)
    usart.far_baud = 8_000_000 * 9 // (69 * 8)  # an eighth too fast: the parity's sample, 8.5 on, meets the stop bit
    usart.receive(b"\0")
    fake_chip.advance(fake_chip.now_ns + CHARACTER_NS)
    assert status(fake_chip) & (PE | FE | RXNE) == PE | RXNE
    assert fake_chip.irqs[IRQ] is bool(enable)
    fake_chip.read("USART1.SR")
    assert fake_chip.read("USART1.DR") == 0x80
    assert not status(fake_chip) & PE
    assert not fake_chip.irqs[IRQ]


@pytest.mark.parametrize("core", CORES)
@pytest.mark.parametrize(
    ("reads", "is_cleared"), [("ldr r0, [r1, #0]\nldr r0, [r1, #4]\n", True), ("ldr r0, [r1, #4]\n", False)]
)
def test_an_interrupt_of_pe_lasts_until_sr_and_dr_are_read(
    core: str, reads: str, is_cleared: bool, monkeypatch: Any, watchdog: None
) -> None:
    monkeypatch.setenv("P2OS_CORE", core)
    machine = Machine(
        sender(69, b"")
        + "mov32 r2, #0x250c\nstr r2, [r1, #12]\nmov32 r3, #0xe000e104\nmovs r2, #32\nstr r2, [r3, #0]\n"
        f"spin: b spin\nhandler: adds r6, #1\n{reads}bx lr\n",
        {16 + IRQ: "handler"},
    )
    usart = machine.board.usart1
    machine.board.run_for(1_000_000)
    usart.far_baud = 8_000_000 * 9 // (69 * 8)
    usart.receive(b"\0")
    machine.board.run_for(1_000_000)
    entries = machine.board.register("R6")
    assert entries == 1 if is_cleared else entries > 100


#: What a receiver bears with fractions of 0 in BRR, in 1/100 %: noise an error, noise no matter (RM0008 27.3.5).
TOLERATED = {8: (375, 438), 9: (341, 397)}


@example(words=[0, 0], bits=8, off=-438)
@example(words=[0, 0], bits=8, off=438)
@given(
    words=st.lists(st.integers(0, 511), min_size=1, max_size=4),
    bits=st.sampled_from([8, 9]),
    off=st.integers(-438, 438),
)
def test_what_the_manual_tolerates_is_heard_whole(words: list[int], bits: int, off: int) -> None:
    words = [word & (1 << bits) - 1 for word in words]
    clean, whole = TOLERATED[bits]
    assume(abs(off) <= whole)
    found = list(heard(words, bits, 10_000 + off, 10_000))
    assert [(one.word, one.has_framing_error) for one in found] == [(word, False) for word in words]
    if abs(off) <= clean:
        assert not any(one.has_noise for one in found)


@given(
    words=st.lists(st.integers(0, 511), max_size=3),
    numerator=st.integers(1, 1000),
    denominator=st.integers(1, 1000),
    stop=st.integers(1, 4),
)
def test_whatever_is_heard_is_words(words: list[int], numerator: int, denominator: int, stop: int) -> None:
    found = list(heard(words, 9, numerator, denominator, stop))
    assert len(found) <= 6 * len(words)
    assert all(0 <= one.word < 512 for one in found)
    if stop == 1:
        assert not any(one.has_framing_error for one in found)


# Each by hand: a sample n of our bit m stands 16 m + n sixteenths of our bit behind the edge.
@pytest.mark.parametrize(
    ("words", "ratio", "expected"),
    [
        # Half our speed, 0x00: 18 of our bits are 0, then 1 till the end.
        ([0x00], (1, 2), [Heard(0, has_framing_error=True)]),
        # Half our speed, 0xFF: two bits of 0, which are our start bit and bit 0.
        ([0xFF], (1, 2), [Heard(0xFE)]),
        # Twice our speed: our sample 8 is the start bit's last, 9 and 10 are 1.
        ([0xFF, 0xFF], (2, 1), []),
        # Three times our speed: start and bit 0 are our start bit.
        ([0xFE], (3, 1), [Heard(0xFF)]),
        # A ninth too fast: our bits 6 and 7 meet its bit 7 and stop bit, our stop bit the next start bit, where no edge
        # follows before the end.
        ([0x80, 0x00], (10, 9), [Heard(0xC0, has_framing_error=True)]),
        # Our bit is 0.947 of its: samples 8 and 9 of our stop bit, at 8.94 and 8.997, read bit 7, sample 10 reads 1.
        ([0x00], (1520, 1605), [Heard(0, has_framing_error=True, has_noise=True)]),
    ],
)
def test_characters_worked_out_by_hand(words: list[int], ratio: tuple[int, int], expected: list[Heard]) -> None:
    assert list(heard(words, 8, *ratio)) == expected


def test_the_usual_speeds_reach_two_percent() -> None:
    for usual in USUAL_BAUDS:
        assert is_usual(usual)
        assert is_usual(usual * 102 // 100)
    assert not is_usual(12800)
    assert not is_usual(1)


def test_a_speed_that_cannot_be_is_refused() -> None:
    board = Machine("nop", {}).board
    for baud in (0, -1, 5_000_000):
        with pytest.raises(BluePillError, match="cannot be"):
            board.usart1.far_baud = baud
