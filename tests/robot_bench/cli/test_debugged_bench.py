"""A bench under a debugger: halts change nothing, and all parts go back together."""

import socket
import threading
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import pytest

from bluepill_sim.debug.execution import Execution
from bluepill_sim.debug.machine import StopKind
from bluepill_sim.debug.packets import frame
from bluepill_sim.errors import BluePillError
from p2os.cli.main import run
from p2os.errors import RunFailedError
from robot_bench.bench import Bench
from robot_bench.cli.debugging.gdb import debug_bench, debug_port
from robot_bench.cli.debugging.machine import BenchMachine, RemoteMachine, board_of
from robot_bench.run import run_at_port
from robot_bench.scenario.scenario import Scenario
from simbase.timing import NS_PER_S
from tests.robot_bench.firmware.hurried import hurried_scenario

LIMIT_S = 60


def scenario(mode: str = "adapter", duration_s: float = 3.0) -> Scenario:
    """Return that of a program that goes on after half a second; the robot moves from 0.7 s on."""
    return hurried_scenario("dodge", 50, body="kinematic", mode=mode, duration_s=duration_s)


def address(bench: Bench, name: str) -> int:
    found = board_of(bench).image.symbols.address_of(name)
    assert found is not None
    return found


def place(bench: Bench) -> tuple[object, ...]:
    board, state = board_of(bench), bench.parts.body.state
    return board.cycle, board.pc, state.x_m, state.y_m, state.left_speed_mps, bench.trace.sha256


@pytest.mark.parametrize("mode", ["adapter", "direct"])
def test_a_run_that_was_halted_leaves_the_same_trace(mode: str) -> None:
    plain = Bench(scenario(mode, 1.2))
    plain.run_until(plain.end)
    plain.finish()
    bench = Bench(scenario(mode, 1.2))
    execution = Execution(BenchMachine(bench), lambda _: None)
    breakpoints = board_of(bench).chip.engine.breakpoints
    breakpoints.add(address(bench, "pins_motors"))
    halts = 0
    while execution.go_on().kind is StopKind.BREAKPOINT:
        halts += 1
        for _ in range(3 if halts % 20 == 0 else 0):
            assert execution.step().kind in {StopKind.STEP, StopKind.BREAKPOINT}
    assert halts > 50
    bench.finish()
    assert bench.trace.sha256 == plain.trace.sha256
    assert board_of(bench).snapshot() == board_of(plain).snapshot()


def test_the_robot_goes_back_with_the_chip_while_it_moves() -> None:
    bench = Bench(scenario())
    execution = Execution(BenchMachine(bench), lambda _: None)
    bench.run_until(2 * NS_PER_S)
    assert abs(bench.parts.body.state.left_speed_mps) > 0.01
    execution.changed()
    board_of(bench).chip.engine.breakpoints.add(address(bench, "pins_motors"))
    places = []
    for _ in range(20):
        assert execution.go_on().kind is StopKind.BREAKPOINT
        places.append(place(bench))
    assert len({(p[2], p[3]) for p in places}) > 4
    for expected in places[-2:10:-1]:
        assert execution.go_back().kind is StopKind.BREAKPOINT
        assert place(bench) == expected
    assert execution.step_back().kind is StopKind.STEP
    execution.step()
    assert place(bench) == places[11]
    for expected in places[12:]:
        execution.go_on()
        assert place(bench) == expected


def test_going_back_takes_the_trace_back_too(tmp_path: Path) -> None:
    from robot_bench.recording.trace import TraceWriter

    whole = Bench(scenario(duration_s=1.25), trace=TraceWriter(tmp_path / "whole"))
    whole.run_until(whole.end)
    whole.finish()
    bench = Bench(scenario(duration_s=1.25), trace=TraceWriter(tmp_path / "rewound"))
    execution = Execution(BenchMachine(bench), lambda _: None)
    breakpoints = board_of(bench).chip.engine.breakpoints
    breakpoints.add(address(bench, "pins_motors"))
    for _ in range(70):
        execution.go_on()
    for _ in range(12):
        execution.go_back()
    breakpoints.clear()
    assert execution.go_on().kind is StopKind.END
    bench.finish()
    assert bench.trace.sha256 == whole.trace.sha256
    for made in (whole, bench):
        made.trace.close()
    assert (tmp_path / "rewound").read_bytes() == (tmp_path / "whole").read_bytes()


class Gdb:
    """A debugger's end of the line, in the background: sends packets, keeps the answers."""

    answers: ClassVar[list[bytes]] = []

    def __init__(self, port: int, packets: list[bytes]) -> None:
        self.answers.clear()
        self.thread = threading.Thread(target=self._talk, args=(port, packets), daemon=True)
        self.thread.start()

    def _talk(self, port: int, packets: list[bytes]) -> None:
        with socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S) as line:
            for packet in packets:
                line.sendall(frame(packet))
                received = b""
                while len(received.partition(b"#")[2]) < 2:
                    byte = line.recv(1)
                    if not byte:  # the server has gone
                        return
                    received += byte
                self.answers.append(received.partition(b"$")[2].partition(b"#")[0])


@pytest.fixture
def gdb(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """Let a debugger call on every server that waits, with the packets that the test puts here."""
    from bluepill_sim.cli.gdb_server import GdbServer

    packets: list[bytes] = []

    class Called(GdbServer):
        def serve(self, *, once: bool = False) -> bool:
            debugger = Gdb(self.port, packets)
            is_over = super().serve(once=once)
            debugger.thread.join(LIMIT_S)
            return is_over

    monkeypatch.setattr("robot_bench.cli.debugging.gdb.GdbServer", Called)
    return packets


@pytest.mark.slow
def test_p2os_run_waits_for_gdb_and_goes_on_when_it_detaches(
    gdb: list[bytes], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    where = address(Bench(scenario()), "SysTick_Handler")
    gdb += [b"Z0,%x,2" % where, b"c", b"c", b"bc", b"D"]
    words = ["run", "dodge", "--body", "kinematic", "--duration", "1s", "--out", str(tmp_path / "run")]
    assert run([*words, "--gdb", "0"]) in {0, 1}
    assert Gdb.answers == [b"OK", b"T05thread:1;", b"T05thread:1;", b"T05thread:1;", b"OK"]
    assert "waiting for GDB on port" in capfd.readouterr().err
    trace = (tmp_path / "run" / "trace.jsonl").read_text().splitlines()
    assert run(["run", "dodge", "--body", "kinematic", "--duration", "1s", "--out", str(tmp_path / "plain")]) in {0, 1}
    assert trace[1:-1] == (tmp_path / "plain" / "trace.jsonl").read_text().splitlines()[1:-1]


def test_a_killed_run_has_failed(gdb: list[bytes]) -> None:
    gdb += [b"s", b"vKill;1"]
    with pytest.raises(RunFailedError, match="killed by the debugger"):
        debug_bench(0, is_paced=False, on_wait=lambda: None)(bench := Bench(scenario()))
    judged = bench.judge()
    assert (judged.met, judged.missed) == ([], []), "what was open at the kill is open"
    assert any(goal.startswith("touches nothing: not judged before 120 s") for goal in judged.not_judged)


def test_a_signal_ends_the_waiting_for_a_debugger() -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt("SIGTERM")

    with pytest.raises(KeyboardInterrupt, match="SIGTERM"):
        debug_bench(0, is_paced=False, on_wait=interrupt)(Bench(scenario()))


class Line:
    """A transport at which nobody answers."""

    def __init__(self) -> None:
        self.sent = bytearray()
        self.is_closed = False

    def read(self) -> bytes:
        return b""

    def write(self, data: bytes) -> None:
        self.sent += data

    def fileno(self) -> int:
        return -1

    def close(self) -> None:
        self.is_closed = True


def test_a_real_robot_is_stopped_by_the_first_halt(gdb: list[bytes], tmp_path: Path) -> None:
    where = address(Bench(scenario()), "pins_motors")
    gdb += [b"Z0,%x,2" % where, b"c", b"bc", b"c", b"D"]
    line = Line()
    wanted = replace(scenario("adapter", 2.0), changes=())
    run_at_port(wanted, tmp_path / "run", line, drive=debug_port(0, on_wait=lambda: None))  # type: ignore[arg-type]
    # The run is over with the halt: nothing goes back, and going on ends it.
    assert Gdb.answers == [b"OK", b"T05thread:1;", b"E01", b"W00", b"OK"]
    assert line.is_closed
    assert bytes([0xFA, 0xFB, 3, 2]) in line.sent  # CLOSE


def test_only_an_emulated_chip_is_debugged() -> None:
    from tests.robot_bench.wires.fake_chip import FakeChip

    bench = Bench(scenario(), chip=FakeChip())
    with pytest.raises(BluePillError, match="only an emulated"):
        board_of(bench)
    assert RemoteMachine.can_rewind is False
