"""What files, firmware and robots say is shown, and acts on no terminal: whichever verb prints it, rich's too."""

import io
import sys
from pathlib import Path

import pytest
from rich.table import Table
from rich.text import Text

from bluepill_sim.cli.console import open_console
from p2os.cli.console import ReadableConsole
from p2os.cli.main import run
from p2os.cli.printing import QueuedStream, queue_output, restored_output
from simbase.terminal import drawn
from tests.bluepill_sim.machine import Machine

SAID = "\x1b[31m[/x][red]\u202eabc\x9b"
SHOWN = "\\x1b[31m[/x][red]\\u202eabc\\x9b"
#: USART1 on PA9, and one byte after the other.
PRINTER = (
    "mov32 r1, #0x40021018\nmov32 r2, #0x4004\nstr r2, [r1, #0]\n"
    "mov32 r1, #0x40010804\nmov32 r2, #0x444444B4\nstr r2, [r1, #0]\n"
    "mov32 r1, #0x40013800\nmov32 r2, #0x45\nstr r2, [r1, #8]\nmov32 r2, #0x2008\nstr r2, [r1, #12]\n"
)
#: 400 turns of the loop take longer than a character.
SEND = "mov32 r2, #{}\nstr r2, [r1, #4]\nmov32 r3, #400\nw{}: subs r3, #1\nbne w{}\n"


def program(said: bytes, folder: Path) -> Path:
    """Write a program that prints bytes."""
    source = PRINTER + "".join(SEND.format(byte, place, place) for place, byte in enumerate(said)) + "end: b end\n"
    ((_, code),) = Machine(source, {}).image.segments
    (folder / "prints.bin").write_bytes(code)
    return folder / "prints.bin"


@pytest.mark.parametrize(
    ("raw", "out"), [(False, b"a\\x1b[31m\xc3\xa4\\xff\t\r\nb"), (True, b"a\x1b[31m\xc3\xa4\xff\t\r\nb")]
)
def test_mcu_run_prints_what_a_firmware_says_and_does_not_obey_it(
    raw: bool, out: bytes, tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    path = program(b"a\x1b[31m\xc3\xa4\xff\t\r\nb", tmp_path)
    assert run(["mcu", "run", str(path), "--for", "5ms", *(["--raw"] if raw else [])]) == 0
    assert capfdbinary.readouterr().out.removesuffix(b"\n") == out


def test_a_file_gets_every_byte(tmp_path: Path) -> None:
    console = open_console(str(tmp_path / "log"))
    console.write(b"\x1b[31m\xff")
    console.close()
    assert (tmp_path / "log").read_bytes() == b"\x1b[31m\xff"


def test_names_in_files_do_not_act(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    world = tmp_path / "w.toml"
    name = SAID.encode("unicode_escape").decode().replace("\\x", "\\u00")
    world.write_text(
        f'[[obstacle]]\nname = "{name}"\nx_m = 1.0\ny_m = 1.0\nlength_m = 1.0\nwidth_m = 1.0\n', encoding="utf-8"
    )
    run(["world", "check", str(world)])
    (tmp_path / "s.toml").write_text(
        f'extends = "motors"\nbody = "kinematic"\nduration_s = 1\n[[goal]]\nkind = "usart_contains"\ntext = "{name}"\n',
        encoding="utf-8",
    )
    run(["run", str(tmp_path / "s.toml"), "--out", str(tmp_path / "o")])
    run(["report", str(tmp_path / "o"), "--json"])
    run(["explain", str(tmp_path / "o")])
    said = capfd.readouterr()
    for text in (said.out, said.err):
        assert "\x1b[31m" not in text
        assert "\u202e" not in text
        assert "\x9b" not in text


def test_rich_draws_its_own_and_neither_markup_nor_escapes_of_others(monkeypatch: pytest.MonkeyPatch) -> None:
    behind = io.StringIO()
    monkeypatch.setattr(sys, "stdout", behind)
    console = ReadableConsole()
    table = Table(box=None)
    table.add_row(SAID, Text(SAID, "red"))
    console.print(table)
    console.print(SAID)
    assert f"{SHOWN}\n" in behind.getvalue()
    assert behind.getvalue().count("\\x1b[31m[/x]") == 3
    assert not set(behind.getvalue()) & set("\x1b\u202e\x9b")


def test_a_queue_before_the_streams_gets_readable_text_too(capfd: pytest.CaptureFixture[str]) -> None:
    with restored_output():
        queue_output()
        assert isinstance(drawn(sys.stderr), QueuedStream)
        sys.stderr.write(f"{SAID}\n")
        sys.stdout.write(f"{SAID}\n")
    said = capfd.readouterr()
    assert said.out == said.err == f"{SHOWN}\n"
