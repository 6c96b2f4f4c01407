"""The console: a USART's far end in a file or a pseudo-terminal."""

import io
import os
import select
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from bluepill_sim.__main__ import run
from bluepill_sim.cli import run as run_verb
from bluepill_sim.cli.console import Console, PtyConsole, StreamConsole, connect, open_console
from bluepill_sim.errors import BluePillError
from simbase.errors import FileError
from tests.tools.examples import EXAMPLES


class Port:
    """A USART for a console."""

    def __init__(self) -> None:
        self.received = b""
        self.sinks: list[Callable[[Sequence[tuple[int, int]]], None]] = []

    def subscribe(self, sink: Callable[[Sequence[tuple[int, int]]], None]) -> Callable[[], None]:
        self.sinks.append(sink)
        return lambda: self.sinks.remove(sink)

    def receive(self, data: bytes) -> None:
        self.received += data

    def send(self, data: bytes) -> None:
        assert self.sinks
        for sink in self.sinks:
            sink([(word, 0) for word in data])


def test_a_file_gets_every_character(tmp_path: Path) -> None:
    path = tmp_path / "usart.txt"
    console, port = open_console(str(path)), Port()
    carry = connect(console, port)
    port.send(b"hello\n")
    assert path.read_bytes() == b"hello\n"
    port.send(b"more")
    assert path.read_bytes() == b"hello\n"
    carry()
    assert path.read_bytes() == b"hello\nmore", "a prompt does not wait for its line's end"
    console.close()
    assert path.read_bytes() == b"hello\nmore"
    assert port.received == b""
    assert console.description == str(path)


def test_a_borrowed_stream_stays_open() -> None:
    stream = io.BytesIO()
    console = StreamConsole(stream, "memory", is_owner=False)
    console.write(b"A")
    console.close()
    assert stream.getvalue() == b"A"


def test_standard_output_is_a_dash(capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    console = open_console("-")
    console.write(b"\n")
    console.close()
    assert capfdbinary.readouterr().out == b"\n"


def test_a_file_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"cannot write .*: no such file or directory"):
        open_console(str(tmp_path / "missing" / "usart.txt"))


def test_a_pseudo_terminal_goes_both_ways() -> None:
    console, port = PtyConsole(), Port()
    carry = connect(console, port)
    far = os.open(console.description, os.O_RDWR | os.O_NOCTTY)
    port.send(b"\x00a\n")
    assert b"".join(os.read(far, 1) for _ in range(3)) == b"\x00a\n"
    carry()
    os.write(far, b"hi\r")
    while len(port.received) < 3:  # the kernel hands it over in its own time
        assert select.select([console._master], [], [], 5)[0]
        carry()
    assert port.received == b"hi\r"
    os.close(far)
    console.close()


def test_a_pseudo_terminal_that_nobody_reads_drops(monkeypatch: pytest.MonkeyPatch) -> None:
    console = PtyConsole()

    def refuse(*_arguments: object) -> int:
        raise BlockingIOError

    monkeypatch.setattr(os, "write", refuse)
    console.write(b"\1")
    assert console.dropped == 1
    console.close()


def test_a_pseudo_terminal_is_opened_by_name() -> None:
    console = open_console("pty:")
    assert isinstance(console, PtyConsole)
    console.close()


def test_a_system_without_pseudo_terminals_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "openpty")
    with pytest.raises(BluePillError, match="cannot open a pseudo-terminal"):
        PtyConsole()


@pytest.mark.parametrize(("words", "expected"), [([], b"\\x1b[2J"), (["--raw"], b"\x1b[2J")])
@pytest.mark.parametrize("port", ["--uart", "--usb"])
def test_raw_is_for_the_serial_port_over_usb_too(
    port: str, words: list[str], expected: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfdbinary: pytest.CaptureFixture[bytes],
) -> None:  # fmt: skip
    def send_at_once(console: Console, _port: object) -> Callable[[], None]:
        console.write(b"\x1b[2J")
        return lambda: None

    monkeypatch.setattr(run_verb, "connect", send_at_once)
    ports = {"--uart": str(tmp_path / "uart"), "--usb": str(tmp_path / "usb")} | {port: "-"}
    options = [word for row in ports.items() for word in row]
    assert run(["run", str(EXAMPLES / "usb_echo.elf"), "--for", "1us", *options, *words]) == 0
    assert capfdbinary.readouterr().out.startswith(expected)
