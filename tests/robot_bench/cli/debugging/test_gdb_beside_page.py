"""GDB and the page at one run: one halt, which either sees and either holds."""

import re
import select
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bluepill_sim.cli.gdb_server import GdbPort
from bluepill_sim.debug.gdb_session import GdbSession
from bluepill_sim.debug.packets import frame
from bluepill_sim.debug.target_description import REGISTERS
from p2os.errors import RunFailedError
from p2os.view.run_control import RunCommand, RunState
from robot_bench.bench import Bench
from robot_bench.cli.debugging.gdb_beside import GdbBeside
from robot_bench.cli.debugging.session import GDB_STANDS, RunSession
from robot_bench.cli.shown.live_run import LiveRun
from robot_bench.run import run_scenario
from simbase.timing import NS_PER_MS, NS_PER_S
from tests.robot_bench.running.test_run_control import Controlled, Listener, hash_at_end, scenario

LIMIT_S = 60
PC = [row.name for row in REGISTERS].index("pc")


class Port:
    """GDB's end of the line, without one: what it says goes in, what it is answered comes out."""

    port = 3333

    def __init__(self) -> None:
        self.said: list[bytes] = []
        self.answers: list[bytes] = []
        self._session: GdbSession | None = None

    def serve(self, target: GdbBeside, _wait_s: float) -> None:
        said, self.said = self.said, []
        for packet in said:
            if self._session is None:
                self._session = GdbSession(target)
                target.attached()
            if packet == b"\x03":
                target.interrupted()
            elif packet == b"lost":
                self._session = None
                target.left(was_killed=False, is_lost=True)
            elif (answer := self._session.answer(packet)) is not None:
                self.answers.append(answer)
            if self._session is not None and (state := self._session.state).is_over:
                self._session = None
                target.left(was_killed=state.was_killed, is_lost=False)

    def stopped(self, stop: object, words: str) -> None:
        assert self._session is not None
        if words:
            self.answers.append(words.encode())
        self.answers.append(self._session.stopped(stop))  # type: ignore[arg-type]  # it is one


class Both(Controlled):
    """A session with a page and GDB at it."""

    def __init__(self, folder: Path) -> None:
        self.clock_ns = 0
        self.session = RunSession(Bench(scenario()), Listener(), folder, 0.0, "waiting for GDB")
        self.port = Port()
        self.beside = GdbBeside(self.session, self.port)  # type: ignore[arg-type]  # as much of one as is needed

    def gdb(self, *packets: bytes) -> list[bytes]:
        """Say something as GDB; return what it is answered until the run stands."""
        self.port.said += packets
        self.port.answers.clear()
        self.beside.serve(0.0)
        for _ in range(100_000):
            if not self.session.is_running:
                break
            self.session.go_on(0)
        self.beside.serve(0.0)
        return list(self.port.answers)

    def page(self, do: str, **about: object) -> RunState:
        self.port.answers.clear()
        state = self.do(do, **about)
        self.beside.serve(0.0)
        return state

    @property
    def pc(self) -> int:
        return self.session.chosen.machine.board.pc

    def gdbs_pc(self) -> int:
        return int.from_bytes(bytes.fromhex(self.gdb(b"p%x" % PC)[0].decode()), "little")

    def address(self, name: str) -> int:
        found = self.session.chosen.machine.board.image.symbols.address_of(name)
        assert found is not None
        return found


@pytest.fixture
def both(tmp_path: Path) -> Both:
    return Both(tmp_path)


def test_it_waits_for_gdb_and_stands_at_its_breakpoint_for_the_page(both: Both, alone: str) -> None:
    assert (both.session.is_running, both.session.state().why) == (False, "waiting for GDB")
    where = both.address("pins_motors")
    assert both.gdb(b"?", b"Z0,%x,2" % where, b"c") == [b"T05thread:1;", b"OK", b"T05thread:1;"]
    state = both.session.state()
    assert (state.is_running, state.why, both.pc, both.gdbs_pc()) == (False, "GDB: breakpoint", where, where)
    assert "pins_motors" in state.place
    before = state.head_ns
    assert both.gdb(b"c") == [b"T05thread:1;"]
    assert both.session.state().head_ns > before
    assert both.gdb(b"s") == [b"T05thread:1;"]
    assert both.pc != where
    assert both.gdb(b"D") == [b"OK"], "detached: it goes on to its end, past what GDB halted at"
    assert both.session.state().why == "the end of the run"
    assert hash_at_end(both) == alone


@pytest.fixture(scope="module")
def alone() -> str:
    bench = Bench(scenario())
    bench.run_until(bench.end)
    bench.finish()
    return bench.trace.sha256


def going(both: Both) -> None:
    """Have GDB come and continue, and the run go on for a slice."""
    both.port.said += [b"?", b"c"]
    both.beside.serve(0.0)
    both.session.go_on(0)
    assert both.session.is_running


def test_a_pause_on_the_page_stops_gdb_where_the_page_stands_and_time_stands_for_both(both: Both) -> None:
    going(both)
    assert both.page("pause").why == "paused"
    assert both.port.answers == [b"page: paused", b"T02thread:1;"]
    assert both.gdbs_pc() == both.pc
    head = both.session.state().head_ns
    # The page lets go: GDB still holds.
    state = both.page("run")
    assert (state.is_running, state.why, both.session.state().head_ns) == (False, "GDB holds it: continue there", head)
    # The page holds again, and GDB lets go: it waits.
    both.page("pause")
    assert both.gdb(b"c") == []
    assert (both.session.is_running, both.session.state().head_ns) == (False, head)
    assert both.session.state().why == "GDB waits until it goes on here"
    assert both.page("run").is_running
    both.session.go_on(0)
    assert both.session.state().head_ns >= head
    # Ctrl-C.
    assert both.gdb(b"\x03") == [b"T02thread:1;"]
    assert both.session.state().why == "GDB: interrupt"
    assert both.gdbs_pc() == both.pc


def test_a_place_to_halt_at_of_the_page_stops_gdb_there(both: Both) -> None:
    both.page("halt_at", words="note adapter driving")
    words, reply = both.gdb(b"?", b"c")[1:]
    state = both.session.state()
    assert (words, reply) == (f"page: {state.why}".encode(), b"T05thread:1;")
    assert state.why.startswith("note adapter driving")
    assert (state.halts[0].count, both.gdbs_pc()) == (1, both.pc)
    # Both hold it now.
    assert both.gdb(b"c") == []
    both.page("pause")
    assert not both.session.is_running


def test_gdb_steps_and_goes_back_once_the_page_lets_it(both: Both, alone: str) -> None:
    where = both.address("pins_motors")
    both.gdb(b"Z0,%x,2" % where, b"c")
    first = both.session.state().head_ns
    both.gdb(b"c")
    second = both.session.state().head_ns
    assert both.gdb(b"bc") == [b"T05thread:1;"]
    assert (both.session.state().head_ns, both.pc) == (first, where)
    assert both.gdb(b"bs") == [b"T05thread:1;"]
    assert both.session.state().head_ns < first
    both.gdb(b"s")
    assert (both.session.state().head_ns, both.pc) == (first, where)
    both.page("pause")
    assert both.gdb(b"c") == []
    assert both.session.state().head_ns == first
    both.page("run")
    assert both.gdb() == [b"T05thread:1;"]
    assert both.session.state().head_ns == second
    assert both.gdb(b"z0,%x,2" % where, b"D") == [b"OK", b"OK"]
    assert hash_at_end(both) == alone


@pytest.mark.parametrize(
    "command",
    [{"do": "back", "unit": "instruction"}, {"do": "step"}, {"do": "go", "at_ns": NS_PER_MS}, {"do": "fork"},
     {"do": "run", "at_ns": NS_PER_MS}, {"do": "hand", "words": "pin PB12 low"}, {"do": "halt_at", "words": "contact"},
     {"do": "choose", "future": "run"}, {"do": "compare", "future": "run"}, {"do": "drop", "future": "fork 1"}],
    ids=lambda command: command["do"],
)  # fmt: skip
def test_what_would_move_the_run_under_gdb_is_refused_in_a_sentence(command: dict[str, object], both: Both) -> None:
    both.gdb(b"Z0,%x,2" % both.address("pins_motors"), b"c")
    before = both.session.state().head_ns, both.pc
    state = both.page(**command)  # type: ignore[arg-type]  # as a page has it
    assert GDB_STANDS in state.trouble
    assert (both.session.state().head_ns, both.pc, both.port.answers) == (*before, [])
    assert both.page("halt_at", words="line dodge.c:43").trouble == "", "what moves nothing is done"


def test_while_gdb_waits_the_page_goes_where_it_will_and_gdb_finds_registers_as_they_are_then(both: Both) -> None:
    where = both.address("pins_motors")
    both.gdb(b"Z0,%x,2" % where, b"c", b"c")
    both.page("pause")
    both.gdb(b"c")
    assert both.page("back", unit="instruction").trouble == ""
    assert both.page("go", at_ns=NS_PER_S // 2).head_ns == NS_PER_S // 2
    assert both.page("fork", words="pin PB12 low").future == "fork 1"
    assert both.port.answers == []
    both.page("run")
    assert both.gdb() == [b"T05thread:1;"], "its breakpoint is in the fork, too"
    assert both.session.state().future == "fork 1"
    assert both.gdbs_pc() == both.pc == where


def test_gdb_writes_nothing_beside_a_page(both: Both) -> None:
    for packet in (b"P0=00000000", b"M20000000,1:00", b"X20000000,1:a", b"G00", b"vFlashDone", b"c8000000"):
        assert both.gdb(packet)[0].startswith(b"E.beside a page")
    for words in ("reset", "wait 1ms", "restore", "pin PA4 1"):
        said = bytes.fromhex(both.gdb(b"qRcmd," + words.encode().hex().encode())[0].decode())
        assert said.startswith(b"beside a page"), words
    assert b"PA4" in bytes.fromhex(both.gdb(b"qRcmd," + b"pin PA4".hex().encode())[0].decode())
    assert both.session.state().head_ns == 0


def test_a_lost_line_leaves_the_run_standing_until_the_page_lets_it_go_and_a_kill_ends_it(both: Both) -> None:
    both.gdb(b"Z0,%x,2" % both.address("pins_motors"), b"c")
    both.gdb(b"lost")
    assert (both.session.is_running, both.session.state().why) == (False, "GDB has gone without detaching")
    both.page("run")
    assert both.until_it_stands().why == "the end of the run", "what it halted at has gone with it"
    assert both.gdb(b"?", b"c") == [b"T05thread:1;", b"W00"]
    with pytest.raises(RunFailedError, match="killed by the debugger"):
        both.gdb(b"vKill;1")


SCRIPT = """
set pagination off
set confirm off
set tcp connect-timeout 60
target remote :PORT
break pins_motors
continue
stepi
reverse-stepi
print $pc == (unsigned)&pins_motors
delete
continue
info registers pc
detach
"""


@pytest.fixture
def opened() -> Iterator[GdbPort]:
    port = GdbPort(0)
    yield port
    port.close()


@pytest.mark.slow
def test_a_real_gdb_is_stopped_by_a_pause_on_the_page(opened: GdbPort, alone: str, tmp_path: Path) -> None:
    gdb = shutil.which("gdb-multiarch")
    if gdb is None:
        pytest.skip("gdb-multiarch is not installed: the tests above still run")
    wanted = scenario()
    live = LiveRun(wanted, speed=1.0, gdb=opened)
    script = tmp_path / "script.gdb"
    script.write_text(SCRIPT.replace("PORT", str(opened.port)))
    said: list[str] = []

    def debug() -> None:
        with subprocess.Popen([gdb, "-q", "-nx", "-batch", "-x", str(script), str(wanted.firmware)],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as running:  # fmt: skip
            assert running.stdout is not None
            for line in running.stdout:
                said.append(line)
                if line.startswith("$1 = "):  # the last `continue` follows
                    while not live.state.is_running:
                        time.sleep(0.01)
                    live.offer(RunCommand(do="pause"))
                if line.startswith("pc "):
                    live.offer(RunCommand(do="speed", speed=0.0))
                    live.offer(RunCommand(do="run"))

    thread = threading.Thread(target=debug, daemon=True)
    thread.start()
    folder = run_scenario(wanted, tmp_path / "run", drive=live.drive).folder
    thread.join(LIMIT_S)
    out = "".join(said)
    assert "Breakpoint 1, pins_motors" in out
    assert "$1 = 1" in out
    assert "page: paused" in out, out
    assert "SIGINT" in out
    assert re.search(r"(?m)^pc +0x", out)
    assert alone in (folder / "trace.jsonl").read_text()


def test_a_web_page_is_no_debugger_and_a_line_that_breaks_off_is_seen(opened: GdbPort, both: Both) -> None:
    beside = GdbBeside(both.session, opened)

    def until(is_done: Callable[[], bool]) -> None:
        for _ in range(1000):
            beside.serve(0.01)
            if is_done():
                return
        raise AssertionError("it does not come to that")

    with socket.create_connection(("127.0.0.1", opened.port), timeout=LIMIT_S) as line:
        line.sendall(b"GET / HTTP/1.1\r\nOrigin: http://elsewhere\r\n\r\n")
        until(lambda: bool(select.select([line], [], [], 0)[0]))  # it is hung up on
    assert not both.session.holds.is_attached
    with socket.create_connection(("127.0.0.1", opened.port), timeout=LIMIT_S) as line:
        line.sendall(frame(b"?"))
        until(lambda: both.session.holds.is_shown_to_gdb)
        assert line.recv(100).partition(b"$")[2].startswith(b"T05")
    until(lambda: not both.session.holds.is_attached)
    assert both.session.state().why == "GDB has gone without detaching"
