"""The serial line over USB: from Python, as a pseudo-terminal, from the command line."""

import os
import tty
from collections.abc import Callable
from pathlib import Path

import pytest

from bluepill_sim import BluePill
from bluepill_sim.__main__ import run
from bluepill_sim.board import WaitError
from bluepill_sim.cli.console import PtyConsole, connect, open_console
from bluepill_sim.errors import BluePillError
from tests.tools.examples import EXAMPLES

Boards = Callable[[], BluePill]
ECHO = str(EXAMPLES / "usb_echo.elf")


def test_what_is_sent_before_the_device_is_there_waits_for_it(boards: Boards) -> None:
    board = boards()
    board.usb_serial.receive(b"early")
    board.usb.plug()
    assert board.usb_serial.expect(b"EARLY") == b"EARLY"


def test_what_is_sent_to_a_device_that_goes_is_lost(boards: Boards) -> None:
    board = boards()
    board.usb_serial.receive(b"early")
    board.usb.plug()
    board.usb.unplug()
    board.usb.wait_configured()
    with pytest.raises(WaitError, match=r"USB did not send b'EARLY' within 0.05 s; it sent b''; 1209:0001"):
        board.usb_serial.expect(b"EARLY", within="50 ms")
    with pytest.raises(BluePillError, match="empty pattern"):
        board.usb_serial.expect(b"")


def test_what_is_not_sent_is_reported_with_the_state_at_the_end_of_the_wait(boards: Boards) -> None:
    board = boards()
    board.usb.plug()
    with pytest.raises(WaitError, match="it sent b''; 1209:0001"):
        board.usb_serial.expect(b"never", within="500 ms")


def test_a_condition_waits_for_the_packet_in_which_it_comes(boards: Boards) -> None:
    board = boards()
    rows: list[tuple[int, int]] = []
    board.usb_serial.subscribe(rows.extend)
    board.usb.wait_configured()
    board.usb_serial.receive(b"go")
    met_ns = board.until("usb sends GO")
    assert bytes(byte for byte, _ in rows) == b"GO"
    assert 0 <= met_ns - rows[-1][1] < 1_000, "at the block in which its last bit has gone"


def test_the_lines_settings_reach_the_device(boards: Boards) -> None:
    board = boards()
    board.usb.wait_configured()
    coding = (9600).to_bytes(4, "little") + bytes((2, 1, 7))
    board.usb.set_line(coding)
    board.run_for("10 ms")
    assert board.usb.transfer(0xA1, 0x21, length=7) == coding


def test_the_line_is_a_pseudo_terminal_here(boards: Boards) -> None:
    board, console = boards(), PtyConsole()
    carry = connect(console, board.usb_serial)
    board.usb.wait_configured()
    user = os.open(console.description, os.O_RDWR | os.O_NOCTTY)
    try:
        tty.setraw(user)
        os.write(user, b"typed here\n")
        carry()
        board.run_for("5 ms")
        assert os.read(user, 100) == b"TYPED HERE\n"
    finally:
        os.close(user)
        console.close()


def test_pty_needs_no_colon() -> None:
    console = open_console("pty")
    assert isinstance(console, PtyConsole)
    console.close()


def test_the_command_line_plugs_it_in_and_tells_what_it_found(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(["run", ECHO, "--usb", str(tmp_path / "log"), "--for", "300ms"]) == 0
    captured = capfd.readouterr().err
    assert f"USB is plugged in; its serial port goes to {tmp_path / 'log'}\n" in captured
    assert captured.endswith("usb: 1209:0001 p2os, echo, configured, 0 bytes from it, 0 to it\n")
