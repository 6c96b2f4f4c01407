"""p2os-adapter, the core as a PC program, drives a virtual Pioneer over TCP and over a terminal, in real time."""

import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from p2os.pioneer.served import served_pioneer
from tests.adapter_fw.builds import built
from tests.adapter_fw.program import CONNECT, PATIENCE_S, RESET, Lines, motors, running


@pytest.fixture(scope="module")
def adapter(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("program", tmp_path_factory.mktemp("program"))[0]


class Robot:
    """What a served robot has told so far."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def happened(self, _now: int, what: str, detail: str) -> None:
        self.told.append(f"{what}: {detail}")


@pytest.fixture
def robot() -> Robot:
    return Robot()


@pytest.fixture(params=["tcp", "pty"])
def line(request: pytest.FixtureRequest, robot: Robot, tmp_path: Path) -> Iterator[str]:
    url = "tcp:127.0.0.1:0" if request.param == "tcp" else f"pty:{tmp_path / 'robot'}"
    with served_pioneer(url=url, on_event=robot.happened) as served:
        yield served


@pytest.fixture
def tcp(robot: Robot) -> Iterator[str]:
    with served_pioneer(on_event=robot.happened) as served:
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
    assert any(what.startswith("closed") for what in robot.told), robot.told


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_program_stops_and_closes_the_robot_first(
    adapter: Path, tcp: str, robot: Robot, number: signal.Signals
) -> None:
    with running(adapter, tcp) as program:
        program.wires(CONNECT | motors(2, 2))
        program.event("command: VEL 125")
        assert program.end(number) == 130
        program.event("shutdown: the program ends")
    assert "closed: by its client" in robot.told


def test_wires_that_are_pulled_out_end_the_wish_and_the_next_ones_see_the_levels(adapter: Path, tcp: str) -> None:
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
        ("set pulse_ns -1", "error: a time or a step that must be positive is not"),
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
    assert "closed: by its client" in robot.told


def test_a_robot_that_goes_away_ends_the_program_with_one_line(adapter: Path) -> None:
    with served_pioneer() as url:
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
