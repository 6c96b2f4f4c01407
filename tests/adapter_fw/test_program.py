"""p2os-adapter, the core as a PC program, drives a virtual Pioneer over TCP and over a terminal, in real time."""

import contextlib
import fcntl
import os
import pty
import shutil
import signal
import struct
import subprocess
import termios
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from p2os.pioneer.serve import served_pioneer
from p2os.protocol.commands import Command
from p2os.protocol.commands import CommandNumber as C
from tests.adapter_fw.builds import built
from tests.adapter_fw.program import CONNECT, PATIENCE_S, RESET, Lines, Program, Relay, motors, running


@pytest.fixture(scope="module")
def adapter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("program", tmp_path_factory.mktemp("program"))[0]


class Robot:
    """What a served robot has told so far."""

    def __init__(self) -> None:
        self.reported: list[str] = []

    def happened(self, _now: int, what: str, detail: str) -> None:
        self.reported.append(f"{what}: {detail}")


@pytest.fixture
def robot() -> Robot:
    return Robot()


@pytest.fixture(params=["tcp", "pty"])
def line(request: pytest.FixtureRequest, robot: Robot, tmp_path: Path) -> Iterator[str]:
    url = "tcp:127.0.0.1:0" if request.param == "tcp" else f"pty:{tmp_path / 'robot'}"
    with served_pioneer(url=url, body="kinematic", on_event=robot.happened) as served:
        yield served


@pytest.fixture
def tcp(robot: Robot) -> Iterator[str]:
    with served_pioneer(body="kinematic", on_event=robot.happened) as served:
        yield served


def test_wires_drive_the_robot_and_encoders_come_back(adapter: Path, line: str, robot: Robot) -> None:
    with running(adapter, line) as program:
        program.wires(CONNECT | motors(3, 3))
        program.event("driving")
        assert program.event("command").endswith("command: VEL 188, RVEL 0")
        # One step of an encoder is 65 mm: the first is out after a third of a second.
        program.outputs.wait(lambda text: int(text.split()[1], 16) & 0x3F00 != 0 and int(text.split()[2], 16) != 0)
        program.wires(CONNECT)
        assert program.event("command").endswith("command: VEL 0, RVEL 0")
        program.wires(0)
        program.event("disconnected: p2dx_con is low")
        program.event("idle")
        assert program.end() == 130
    assert any(what.startswith("closed") for what in robot.reported), robot.reported


#: Every signal of the program's table; the real-time ones and those of a crash are not caught.
ENDING = [
    signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP, signal.SIGUSR1, signal.SIGUSR2,
    signal.SIGALRM, signal.SIGVTALRM, signal.SIGPROF, signal.SIGXCPU,
]  # fmt: skip


@pytest.mark.parametrize("number", ENDING)
def test_an_interrupted_program_stops_and_closes_the_robot_first(
    adapter: Path, tcp: str, robot: Robot, number: signal.Signals
) -> None:
    with running(adapter, tcp) as program:
        program.wires(CONNECT | motors(2, 2))
        program.event("command: VEL 125")
        assert program.end(number) == 130
        program.event("shutdown: the program ends")
    assert "closed: by its client" in robot.reported


def test_wires_that_are_pulled_out_end_the_connect_request_and_the_next_ones_see_the_levels(
    adapter: Path, tcp: str
) -> None:
    with running(adapter, tcp) as program:
        program.wires(CONNECT | motors(2, 2))
        program.event("command: VEL 125")
        program.socket.shutdown(2)
        program.event("disconnected: p2dx_con is low")
        again = type(program.socket)(program.socket.family)
        again.connect(str(program.wires_path))
        outputs = Lines(again.makefile("r"))
        assert outputs.wait(lambda text: text.startswith("out 3fff ")).endswith("ff")
        again.sendall(b"nonsense\nin zz\nin 40 40\n" + b"x" * 500 + b"\nin c0\n")
        program.event("reset: rst is high")
        assert outputs.wait(lambda text: text == "out 0 0")
        again.sendall(f"in {CONNECT:x}\n".encode())
        program.event("driving")
        again.close()


def test_the_console_tells_and_sets(adapter: Path, tcp: str, tmp_path: Path) -> None:
    stored = tmp_path / "settings"
    with running(adapter, tcp, "--settings", str(stored)) as program:
        program.wires(CONNECT | motors(1, 1))
        program.event("command: VEL 63")
        program.type("version", "status", "pins", "log", "get pulse_ns")
        program.answer("P2OS adapter ")
        program.answer("state driving (odometry is taken, motors enabled), master bluepill")
        program.answer("motor1 1  motor2 1  VEL_mm_s 63  RVEL_deg_s 0")
        program.answer("SIPs ")
        program.answer("in:  motor1_comm1.. 100  motor2_comm1.. 100  p2dx_con 1")
        program.answer("out: DD1.. ")
        assert "booted" in program.said.wait(lambda text: "ms " in text)
        program.answer("pulse_ns = 500000000")
        program.type("set pulse_ns 400000000", "get pulse_ns")
        program.answer("ok, in force after restart")
        program.answer("pulse_ns = 400000000")
        assert stored.read_text(encoding="utf-8") == "pulse_ns 400000000\n"
        program.type("restart")
        program.event("shutdown")
        program.event("driving")
        program.type("reset pulse_ns", "get pulse_ns")
        program.answer("pulse_ns = 500000000")
        program.type("stop")
        program.event("shutdown: stopped on the console")
        program.end()


@pytest.mark.parametrize(
    ("typed", "answer"),
    [
        ("set pulse_ns -1", "error: pulse_ns must be 1 or more"),
        ("set sample_count 4294967301", "error: it does not fit"),
        ("set pulse_ns soon", "error: that is no whole number"),
        ("set nothing 1", "error: no such setting; get lists them"),
        ("reset nothing", "error: no such setting; get lists them"),
        ("get nothing", "error: no such setting; get lists them"),
        ("dance", "error: no such command; type help"),
        ("x" * 90, "error: the line is longer than 79 characters"),
    ],
)
def test_the_console_refuses_in_one_line(adapter: Path, tcp: str, typed: str, answer: str) -> None:
    with running(adapter, tcp) as program:
        program.type(typed)
        program.answer(answer)


def test_a_pad_on_the_wires_socket_drives_and_its_silence_stops(adapter: Path, tcp: str, robot: Robot) -> None:
    with running(adapter, tcp) as program:
        program.event("booted")
        program.type("master pad")
        program.event("idle: ready")
        with program.reporting("0 0 0 0 0"):
            program.answer("ok")
        with program.reporting("1 0 1023 0 0"):
            program.event("command: VEL 400, RVEL 0")
        program.event("pad lost: no report of the pad in time")
        program.end()
    assert "closed: by its client" in robot.reported


def test_a_robot_that_goes_away_ends_the_program_with_one_line(adapter: Path) -> None:
    with served_pioneer(body="kinematic") as url:
        keeper = running(adapter, url)
        program = keeper.__enter__()
        program.wires(CONNECT)
        program.event("driving")
    try:
        program.event("p2os-adapter: the line tcp:127.0.0.1:")
        program.event("hint: is the robot on")
        assert program.process.wait(PATIENCE_S) == 1
    finally:
        keeper.__exit__(None, None, None)


def test_stored_settings_with_a_fault_are_left_out_and_said(adapter: Path, tcp: str, tmp_path: Path) -> None:
    stored = tmp_path / "settings"
    stored.write_text("sample_count 4\n", encoding="utf-8")
    with running(adapter, tcp, "--settings", str(stored)) as program:
        program.event("stored settings are left out: sample_count must be odd, 1 to 31")
        program.event("booted")


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ([], 2, "wrong usage\nhint: p2os-adapter --line"),
        (["--line"], 2, "wrong usage"),
        (["--line", "tcp:127.0.0.1:1", "--baud", "9600"], 2, "wrong usage"),
        (["--line", "tcp:127.0.0.1:1", "--robot", "r2d2"], 2, "there is no robot r2d2\nhint: a subclass such as p2dx"),
        (["--line", "tcp:127.0.0.1:1"], 1, "cannot open 127.0.0.1:1: Connection refused\nhint: p2os ports"),
        (["--line", "tcp:nowhere"], 1, "cannot open tcp:nowhere: expected tcp:HOST:PORT"),
        (["--line", "serial:/dev/no-such-port"], 1, "No such file or directory"),
        (["--line", "tcp:127.0.0.1:1", "--wires", "/dev/null"], 2, "/dev/null: Address already in use"),
        (["--line", "tcp:127.0.0.1:1", "--wires", "x" * 200], 2, "at most 107 characters"),
    ],
)
def test_wrong_words_end_in_one_line_and_a_hint(adapter: Path, words: list[str], code: int, said: str) -> None:
    done = subprocess.run([adapter, *words], capture_output=True, text=True, check=False, timeout=PATIENCE_S)
    assert (done.returncode, said in done.stderr) == (code, True), done.stderr
    assert "hint: " in done.stderr


def test_a_console_that_ends_leaves_the_adapter_running(adapter: Path, tcp: str) -> None:
    with running(adapter, tcp) as program:
        assert program.process.stdin is not None
        program.process.stdin.close()
        program.wires(CONNECT)
        program.event("driving")
        program.wires(CONNECT | RESET)
        program.event("reset: rst is high")
        assert program.end() == 130


def test_a_program_that_was_made_deaf_to_hang_ups_stays_so(adapter: Path, tcp: str) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # what nohup does; a child inherits it
    try:
        with running(adapter, tcp) as program:
            program.wires(CONNECT)
            program.event("driving")
            program.process.send_signal(signal.SIGHUP)
            program.wires(CONNECT | motors(2, 2))
            program.event("command: VEL 125")
            assert program.end() == 130
    finally:
        signal.signal(signal.SIGHUP, before)


# Pauses ----------------------------------------------------------------------------------

STOPS = [C.STOP, C.VEL, C.RVEL, C.CLOSE]
#: A gap begins at 350 ms.
PAUSE_S = 0.6


@pytest.fixture
def relay(robot: Robot) -> Iterator[Relay]:
    with served_pioneer(body="kinematic", on_event=robot.happened) as served:
        made = Relay(served)
        yield made
        made.close()


def drive(program: Program, relay: Relay) -> None:
    program.wires(CONNECT | motors(2, 2))
    relay.wait(lambda said: said.count(Command(C.VEL, 125)) > 3)


def check_stood_until_a_new_connect_request(program: Program, relay: Relay, before: int) -> None:
    """Look at what the program has said since a pause, while p2dx_con and the motors' wires stood as before."""
    relay.wait(lambda said: len(said) >= before + 4)
    assert [command.number for command in relay.said[before : before + 4]] == STOPS
    assert [command.argument for command in relay.said[before + 1 : before + 3]] == [0, 0]
    assert "the program paused" in program.event("lost")
    time.sleep(PAUSE_S)
    assert {command.number for command in relay.said[before:]} == set(STOPS)
    program.wires(motors(2, 2))
    program.event("idle")
    again = len(relay.said)
    program.wires(CONNECT | motors(2, 2))
    relay.wait(lambda said: Command(C.VEL, 125) in said[again:])


def test_a_stopped_program_says_stop_first_when_it_goes_on(adapter: Path, relay: Relay) -> None:
    with running(adapter, relay.url) as program:
        drive(program, relay)
        program.process.send_signal(signal.SIGSTOP)
        time.sleep(PAUSE_S)
        before = len(relay.said)
        program.process.send_signal(signal.SIGCONT)
        check_stood_until_a_new_connect_request(program, relay, before)


def test_a_stopped_program_that_is_ended_says_stop_first_too(adapter: Path, relay: Relay, robot: Robot) -> None:
    with running(adapter, relay.url) as program:
        drive(program, relay)
        program.process.send_signal(signal.SIGSTOP)
        time.sleep(PAUSE_S)
        before = len(relay.said)
        program.process.send_signal(signal.SIGTERM)
        program.process.send_signal(signal.SIGCONT)
        assert program.process.wait(PATIENCE_S) == 130
        relay.wait(lambda said: len(said) >= before + 4)
        assert [command.number for command in relay.said[before : before + 4]] == STOPS
    assert "closed: by its client" in robot.reported


#: Takes the place of the C library's: the clock that counts suspend runs ahead by what a file says.
SHIFTED_CLOCK = """
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
static volatile long* ahead_s;
int clock_gettime(clockid_t which, struct timespec* time) {
  if (ahead_s == NULL) {
    const int file = open(getenv("AHEAD"), O_RDONLY);
    ahead_s = mmap(NULL, sizeof *ahead_s, PROT_READ, MAP_SHARED, file, 0);
    close(file);
  }
  const int result = (int)syscall(SYS_clock_gettime, which, time);
  time->tv_sec += which == CLOCK_BOOTTIME ? *ahead_s : 0;
  return result;
}
"""


def test_a_program_that_slept_with_its_machine_says_stop_first(adapter: Path, relay: Relay, tmp_path: Path) -> None:
    """A suspend is a leap of CLOCK_BOOTTIME that CLOCK_MONOTONIC does not show."""
    if not hasattr(time, "CLOCK_BOOTTIME") or shutil.which("gcc") is None:
        pytest.skip("needs Linux and gcc")
    source, library, ahead = tmp_path / "shift.c", tmp_path / "shift.so", tmp_path / "ahead"
    source.write_text(SHIFTED_CLOCK, encoding="utf-8")
    subprocess.run(["gcc", "-shared", "-fPIC", "-o", library, source], check=True, timeout=PATIENCE_S)
    ahead.write_bytes(struct.pack("l", 0))
    variables = {"LD_PRELOAD": str(library), "AHEAD": str(ahead), "ASAN_OPTIONS": "verify_asan_link_order=0"}
    with running(adapter, relay.url, **variables) as program:
        drive(program, relay)
        with ahead.open("r+b", buffering=0) as file:
            file.write(struct.pack("l", 8 * 3600))
        relay.wait(lambda said: Command(C.STOP) in said[-8:])
        stopped = len(relay.said) - 1 - relay.said[::-1].index(Command(C.STOP))
        check_stood_until_a_new_connect_request(program, relay, stopped)


# Standard error that nobody reads --------------------------------------------------------


def take_nothing(descriptor: int) -> None:
    """Fill a pipe or a terminal that nobody reads up to its last byte."""
    os.set_blocking(descriptor, False)
    for size in (100, 1):
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(descriptor, b"x" * size)
    os.set_blocking(descriptor, True)


@pytest.fixture(params=["pipe", "terminal", "held terminal"])
def unread(request: pytest.FixtureRequest) -> Iterator[int]:
    """A standard error that takes nothing."""
    reader, writer = os.pipe() if request.param == "pipe" else pty.openpty()
    if request.param == "held terminal":
        termios.tcflow(writer, termios.TCOOFF)  # Ctrl-S
    else:
        take_nothing(writer)
    yield writer
    if request.param != "pipe":
        termios.tcflow(writer, termios.TCOON)
    for descriptor in (reader, writer):
        os.close(descriptor)


def test_nobody_who_reads_the_events_keeps_no_command_from_the_robot(
    adapter: Path, relay: Relay, robot: Robot, unread: int
) -> None:
    with running(adapter, relay.url, stderr=unread) as program:
        for _ in range(3):  # each tells half a dozen events
            drive(program, relay)
            program.wires(CONNECT)
            relay.wait(lambda said: said[-1] == Command(C.RVEL, 0) and said[-2] == Command(C.VEL, 0))
            relay.said.clear()
        drive(program, relay)
        assert fcntl.fcntl(unread, fcntl.F_GETFL) & os.O_NONBLOCK == 0, "others have it open too"
        assert program.end() == 130
        relay.wait(lambda said: [command.number for command in said[-4:]] == STOPS)
    assert "closed: by its client" in robot.reported


def test_lines_that_nobody_read_are_counted(adapter: Path, tcp: str) -> None:
    reader, writer = os.pipe()
    take_nothing(writer)
    with running(adapter, tcp, stderr=writer) as program:
        for _ in range(1_000):  # 2,000 lines of some 20 bytes, of which 16 KB wait
            program.type("master pad", "master bluepill")
            program.answer("ok")
            program.answer("ok")
        os.close(writer)
        heard = os.fdopen(reader)
        events = Lines(heard)
        note = events.wait(lambda line: line.endswith(" lines were left out)"))
        assert int(note[1:].split()[0]) > 500  # a machine that is busy adds lines of its own
        program.type("master pad")
        events.wait(lambda line: "master: pad" in line)
        program.end()
    heard.close()
