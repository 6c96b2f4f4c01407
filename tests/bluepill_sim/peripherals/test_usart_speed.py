"""USART and a far end of another speed: damage both ways, the measured speed, and what is warned of."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bluepill_sim.board import BluePill
from bluepill_sim.errors import BluePillError
from bluepill_sim.fabric.line_speed import USUAL_BAUDS, heard, is_usual
from bluepill_sim.native.library import library_path
from tests.bluepill_sim.machine import Machine
from tests.bluepill_sim.peripherals.usart_line import RXNE, set_up, status

TEXT = b"ready 1\nready 2\n"
CORES = ["python", pytest.param("native", marks=pytest.mark.skipif(library_path() is None, reason="not built"))]


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
    board.usart1.on_transmit = None
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
        assert runs[0][1].snapshot().sent_at == runs[1][1].snapshot().sent_at


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


@given(word=st.integers(0, 255), percent=st.integers(95, 105))
def test_a_character_bears_five_percent(word: int, percent: int) -> None:
    # The stop bit's middle, 9.5 bits on, stays in its bit within 9/9.5 and 10/9.5 of the speed.
    assert list(heard(word, 8, 100, percent)) == [word]


@given(word=st.integers(0, 511), numerator=st.integers(1, 1000), denominator=st.integers(1, 1000))
def test_whatever_is_heard_is_words(word: int, numerator: int, denominator: int) -> None:
    found = list(heard(word, 9, numerator, denominator))
    assert len(found) <= 6
    assert all(0 <= one < 512 for one in found)


def test_a_line_at_another_speed_by_a_tenth_loses_its_last_bit() -> None:
    assert list(heard(0x80, 8, 10, 9)) != [0x80]


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
