"""A real GDB at the server, and a rude one."""

import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from bluepill_sim.__main__ import run
from bluepill_sim.board import BluePill
from bluepill_sim.cli.gdb_server import GdbPort, GdbServer
from bluepill_sim.debug.machine import LoneChip
from bluepill_sim.debug.packets import frame
from bluepill_sim.errors import BluePillError
from tests.tools.examples import EXAMPLES

DODGE = str(EXAMPLES / "dodge.elf")
#: A generous bound on a loaded machine.
LIMIT_S = 60


@pytest.fixture
def server() -> Iterator[GdbServer]:
    """Serve a board in the background until somebody kills the program."""
    made = GdbServer(LoneChip(BluePill(DODGE)), 0)
    thread = threading.Thread(target=made.serve, daemon=True)
    thread.start()
    yield made
    with socket.create_connection(("127.0.0.1", made.port), timeout=LIMIT_S) as line:
        line.sendall(frame(b"vKill;1"))
        thread.join(LIMIT_S)
    made.close()
    assert not thread.is_alive()


def talk(line: socket.socket, payload: bytes) -> bytes:
    """Send a packet and return the payload of the answer, once it is whole."""
    line.sendall(frame(payload))
    return listen(line)


def listen(line: socket.socket) -> bytes:
    received = b""
    while len(received.partition(b"#")[2]) < 2:
        received += line.recv(1)
    return received.partition(b"$")[2].partition(b"#")[0]


SCRIPT = """
set pagination off
set confirm off
set tcp connect-timeout 60
target remote :PORT
break pins_motors
continue
backtrace
info registers msp psp primask control xpsr
watch ticks
continue
continue
print ticks
delete
stepi
stepi
reverse-stepi
reverse-stepi
break main
reverse-continue
backtrace
monitor time
info mem
detach
"""


def test_gdb_debugs_forwards_and_backwards(server: GdbServer, tmp_path: Path) -> None:
    gdb = shutil.which("gdb-multiarch")
    if gdb is None:
        pytest.skip("gdb-multiarch is not installed: the protocol's own tests still run")
    script = tmp_path / "script.gdb"
    script.write_text(SCRIPT.replace("PORT", str(server.port)).replace("detach", "disconnect"))
    done = subprocess.run(
        [gdb, "-q", "-nx", "-batch", "-x", str(script), DODGE],
        capture_output=True, text=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip
    out = done.stdout
    assert done.returncode == 0, done.stderr
    assert "Breakpoint 1, pins_motors" in out
    assert "in pins_start () at pins.c" in out
    assert "msp            0x20004f" in out
    assert "Hardware watchpoint 2: ticks" in out
    assert "New value = 1" in out
    assert "Breakpoint 3, main ()" in out
    assert "8 MHz" in done.stderr  # what monitor says
    assert "flash blocksize 0x400" in out


def test_a_line_that_breaks_off_leaves_the_program_standing(server: GdbServer) -> None:
    with socket.create_connection(("127.0.0.1", server.port), timeout=LIMIT_S) as line:
        assert talk(line, b"?") == b"T05thread:1;"
        line.sendall(frame(b"c"))
    with socket.create_connection(("127.0.0.1", server.port), timeout=LIMIT_S) as line:
        assert talk(line, b"?") == b"T05thread:1;"


def test_ctrl_c_and_damaged_packets(server: GdbServer) -> None:
    with socket.create_connection(("127.0.0.1", server.port), timeout=LIMIT_S) as line:
        line.sendall(frame(b"c") + b"\x03")
        assert listen(line) == b"T02thread:1;"
        line.sendall(b"$g#00")
        assert line.recv(1) == b"-"
        assert talk(line, b"QStartNoAckMode") == b"OK"
        line.sendall(b"$\xff\xfe#zz-")  # asks for the last answer once more
        assert listen(line) == b"OK"
        assert talk(line, b"no such packet") == b""


def test_a_port_that_is_taken_is_one_line(server: GdbServer, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(BluePillError, match="cannot listen on port"):
        GdbServer(LoneChip(BluePill(DODGE)), server.port)
    assert run(["debug", DODGE, "--port", str(server.port)]) == 2
    assert "hint: another port" in capfd.readouterr().err


def test_the_command_serves_once(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[bytes] = []

    def meet(port: int) -> None:
        with socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S) as line:
            done.append(talk(line, b"s"))

    class Reported(GdbServer):
        def serve(self, *, once: bool = False) -> bool:
            threading.Thread(target=meet, args=(self.port,), daemon=True).start()
            return super().serve(once=once)

    monkeypatch.setattr("bluepill_sim.cli.debug.GdbServer", Reported)
    assert run(["debug", DODGE, "--port", "0", "--once"]) == 0
    assert done == [b"T05thread:1;"]
    assert "waiting for GDB on port" in capfd.readouterr().err


class Shared:
    """A machine that another one runs, as far as a port needs it."""

    read_only = ""

    def __init__(self) -> None:
        self.notified: list[str] = []

    def attached(self) -> None:
        self.notified.append("attached")

    def interrupted(self) -> None:
        self.notified.append("interrupted")

    def left(self, *, was_killed: bool, is_lost: bool) -> None:
        self.notified.append(f"killed {was_killed}, lost {is_lost}")


@pytest.mark.parametrize(
    ("sent", "notified"),
    [
        (b"\x03", ["attached", "interrupted"]),
        (b"\x03" + frame(b"?"), ["attached"]),  # it came too late for what it was meant for
        (frame(b"?") + b"\x03", ["attached", "interrupted"]),
        (frame(b"D"), ["attached", "killed False, lost False"]),
        (frame(b"k"), ["attached", "killed True, lost False"]),
        (b"", ["attached", "killed False, lost True"]),
    ],
)  # fmt: skip
def test_a_shared_machine_is_notified_of_each_debugger_and_the_next_one_may_come(
    sent: bytes, notified: list[str]
) -> None:
    port, target = GdbPort(0), Shared()
    try:
        for count in (1, 2):
            with socket.create_connection(("127.0.0.1", port.port), timeout=LIMIT_S) as line:
                line.sendall(frame(b"QStartNoAckMode"))
                port.serve(target, LIMIT_S)
                assert listen(line) == b"OK"
                if sent:
                    line.sendall(sent)
                else:
                    line.shutdown(socket.SHUT_WR)
                port.serve(target, LIMIT_S)
                if "killed" in notified[-1]:
                    while line.recv(64):
                        pass  # the answer, and the end: its line is closed at once
            if "killed" not in notified[-1]:
                port.serve(target, LIMIT_S)
                assert target.notified.pop() == "killed False, lost True"
            assert target.notified == notified * count
    finally:
        port.close()


@pytest.mark.parametrize(("leaves", "runs_on"), [(b"D", True), (b"vKill;1", False)])
def test_a_program_that_was_detached_from_runs_past_what_it_was_halted_at(leaves: bytes, runs_on: bool) -> None:
    board = BluePill(DODGE)
    server, found = GdbServer(LoneChip(board), 0), list[bool]()
    thread = threading.Thread(target=lambda: found.append(server.serve()), daemon=True)
    thread.start()
    try:
        with socket.create_connection(("127.0.0.1", server.port), timeout=LIMIT_S) as line:
            start = board.pc
            assert talk(line, b"s") == b"T05thread:1;"
            for address in (start, board.pc, board.pc + 2, board.pc + 4):
                assert talk(line, b"Z0,%x,2" % address) == b"OK"
            line.sendall(frame(leaves))
            thread.join(LIMIT_S)
    finally:
        server.close()
    assert found == [runs_on]
    before = board.now_ns
    assert board.advance_to(before + 1_000_000).now >= before + 1_000_000
