"""The verbs that use a robot: drive, send, scan, monitor and bench, against a served one."""

import contextlib
import json
import math
import os
import re
import select
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from p2os.cli.held_robot import RobotWatch, problem_of
from p2os.cli.links.bench import LinkBenchmark, lines_of, measure
from p2os.cli.links.ports import guess
from p2os.cli.links.scan import _at_first
from p2os.cli.robots.drive import DriveRequest, carry_out
from p2os.cli.robots.send import make_command
from p2os.client import (
    DeadmanStopped,
    GapStopped,
    LinkLost,
    MotionError,
    MotorsDisabled,
    Notice,
    ReconnectPlanned,
    Robot,
)
from p2os.client.goals import MotionResult
from p2os.client.notices import words_of
from p2os.errors import RemoteProtocolError, TransportError
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.serve import served_pioneer
from p2os.protocol.commands import CommandNumber
from p2os.transport import waiting
from p2os.transport.virtual_clock import VirtualClock
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos
from tests.p2os.cli.driven import STOP, TIMEOUT_S, Driver, RecordingRobot, until
from tests.tools.forked_python import forked_p2os

Run = Callable[..., int]
Capture = pytest.CaptureFixture[str]


def test_a_robot_drives_a_way_then_an_angle_and_stands(fast: object, run: Run, capsys: Capture) -> None:
    assert run("drive", fast.url, "--forward", "10cm", "--turn", "-20deg", "--json") == 0
    captured = capsys.readouterr()
    done = json.loads(captured.out)
    assert [step["what"] for step in done["steps"]] == ["drive", "turn"]
    assert done["steps"][0]["asked_m"] == 0.1
    assert done["pose"]["x_m"] == pytest.approx(0.1, abs=0.03)
    assert math.degrees(done["pose"]["heading_rad"]) == pytest.approx(-20, abs=4)
    assert captured.err.startswith("drove 0.")
    assert "motors: on" in fast.text


def test_a_speed_is_held_for_a_time(fast: object, run: Run, capsys: Capture) -> None:
    assert run("drive", fast.url, "--vel", "-100mm/s", "--for", "300ms") == 0
    out = capsys.readouterr().out
    assert out.startswith("at x -0.")
    assert out.endswith("heading 0.0 deg\n")


def test_a_wall_ends_a_held_speed_with_its_reason(clock: VirtualClock, run: Run, capsys: Capture) -> None:
    robot = RecordingRobot(clock)
    try:
        began = time.monotonic()
        assert run("drive", robot.url, "--vel", "-1.5m/s", "--for", "30s") == 1
        captured = capsys.readouterr()
        note = r"note: --vel 1\.50 m/s is above this robot's limit, 0\.75 m/s: it takes that\n"
        assert re.fullmatch(note + r"p2os: hold -1\.50 m/s, 0 deg/s: stalled, after \d+\.\d s\n", captured.err)
        assert captured.out == ""
        assert robot.when_received(STOP, began)
    finally:
        robot.close()


def test_a_robot_that_vanishes_ends_a_held_speed_and_a_wait_at_once(run: Run, capsys: Capture) -> None:
    for words in (("drive", "--vel", "100mm/s", "--for", "1min"), ("send", "VEL", "100", "--wait", "1min")):
        robot = RecordingRobot()
        gone_at: list[float] = []

        def vanish(robot: RecordingRobot = robot, gone_at: list[float] = gone_at) -> None:
            until(lambda: CommandNumber.VEL in robot.numbers, "VEL")
            gone_at.append(time.monotonic())
            robot.close()

        thread = threading.Thread(target=vanish)
        thread.start()
        assert run(words[0], robot.url, *words[1:]) == 1
        assert time.monotonic() - gone_at[0] < TIMEOUT_S
        thread.join(TIMEOUT_S)
        assert "the link was lost" in capsys.readouterr().err


def test_a_way_that_ends_with_the_link_does_not_claim_that_the_robot_was_told(run: Run, capsys: Capture) -> None:
    robot = RecordingRobot()

    def vanish() -> None:
        until(lambda: CommandNumber.MOVE in robot.numbers, "MOVE")
        robot.close()

    thread = threading.Thread(target=vanish)
    thread.start()
    assert run("drive", robot.url, "--forward", "1m") == 1
    thread.join(TIMEOUT_S)
    error = capsys.readouterr().err
    assert "the link was lost" in error
    assert "told" not in error
    assert "hint: its watchdog stops the robot" in error


def test_motors_that_go_off_end_a_held_speed(clock: VirtualClock, run: Run, capsys: Capture) -> None:
    robot = RecordingRobot(clock)

    def press(pioneer: Pioneer, now: Nanos) -> None:
        if robot.is_moving:
            pioneer.do("fault stop-button", now)
        else:
            robot.requests.append(press)

    robot.requests.append(press)
    try:
        assert run("drive", robot.url, "--vel", "100mm/s", "--for", "30s") == 1
        assert clock() < 30 * NS_PER_S
    finally:
        robot.close()
    error = capsys.readouterr().err
    assert error.startswith("p2os: hold 0.10 m/s, 0 deg/s: for 1 s the wheels are at 0.00 and 0.00 m/s, commanded 0.10")
    assert "are the motors disabled" in error


@pytest.mark.parametrize(
    ("notice", "moves", "problem"),
    [
        (LinkLost("silence"), False, "the link was lost: silence"),
        (GapStopped(3 * NS_PER_S), False, "this program paused for 3.0 s"),
        (DeadmanStopped(2 * NS_PER_S), True, "this program did nothing for 2.0 s"),
        (DeadmanStopped(2 * NS_PER_S), False, None), (MotorsDisabled("button"), True, "button"),
        (MotorsDisabled("button"), False, None), (ReconnectPlanned(1, 5), True, None),
    ],
)  # fmt: skip
def test_what_ends_a_watched_wait(notice: Notice, moves: bool, problem: str | None) -> None:
    assert problem_of(notice, moves=moves) == problem


def test_a_pause_ends_a_watched_wait_and_stops_the_robot(fast: object) -> None:
    times = iter([0, 450 * NS_PER_MS])
    with Robot(fast.url) as robot:
        robot.set_velocity(0.1)
        with pytest.raises(MotionError, match=r"hold: this program paused for 0\.4 s, after 0\.5 s"):
            RobotWatch(robot, "hold", moves=True, clock=lambda: next(times)).wait(NS_PER_S)
        robot.sleep(0.5)
        assert robot.state.forward_mps == pytest.approx(0, abs=0.02)


def test_a_command_is_sent_and_its_answer_shown(fast: object, run: Run, capsys: Capture) -> None:
    assert run("send", fast.url, "sonar", "0", "--wait", "50ms") == 0
    assert capsys.readouterr().out == "sent SONAR: fa fb 06 1c 3b 00 00 1c 3b\n"
    assert run("send", fast.url, "DHEAD", "-5", "--wait", "50ms", "--json") == 0
    assert json.loads(capsys.readouterr().out)["sent"] == {
        "command": "DHEAD", "number": 13, "hex": "fafb060d1b0500121b",
    }  # fmt: skip


def test_commands_are_listed(run: Run, capsys: Capture) -> None:
    assert run("send", "--list", "joystick") == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines()[0] == " 17  JOYREQUEST  integer of 0 to 2"
    assert run("send", "--list", "--json") == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert rows["VEL"]["unit"] == "mm/s"
    assert set(rows["VEL"]["firmware"]) == {"P2OS", "AROS", "ARCOS"}


@pytest.mark.parametrize(
    ("name", "arguments", "sent"),
    [
        ("vel2", ["10", "-1"], "fafb06201bf600161b"), ("DIGOUT", ["0x09", "0x19"], "fafb061e3b0919"),
        ("PULSE", [], "fafb03000000"), ("say", ["hex:14 3c"], "fafb070f2b02143c"), ("250", ["-7"], None),
        ("TTY2", ["RS", "1"], "fafb092a2b0452532031"), ("199", ["hex:01"], None), ("7", [], "fafb03070007"),
    ],
)  # fmt: skip
def test_commands_are_made_of_what_a_person_types(name: str, arguments: list[str], sent: str | None) -> None:
    made = make_command(name, arguments).to_frame().to_bytes().hex()
    assert sent is None or made.startswith(sent)


def test_a_robot_is_found_and_identified(served: object, run: Run, capsys: Capture) -> None:
    assert run("scan", "serial:/dev/ttyUSB99", served.url, "--json") == 0
    captured = capsys.readouterr()
    (found,) = json.loads(captured.out)
    assert (found["url"], found["subclass"], found["title"], found["baud"]) == (
        served.url,
        "p2dx",
        "Pioneer 2-DX",
        None,
    )
    assert "serial:/dev/ttyUSB99: no (cannot open /dev/ttyUSB99: no such port)" in captured.err
    assert run("scan", served.url) == 0
    assert capsys.readouterr().out.startswith(f"{served.url}  Virtual: Pioneer p2dx (Pioneer 2-DX), P2OS")
    assert "motors: on" not in served.text


def test_states_are_printed_where_there_is_no_terminal(fast: object, run: Run, capsys: Capture) -> None:
    assert run("monitor", fast.url, "--for", "150ms", "--json") == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert rows[0]["x_m"] == 0
    assert rows[0]["sonar_m"]
    assert run("monitor", fast.url, "--for", "50ms") == 0
    captured = capsys.readouterr()
    assert captured.out.startswith("x 0.000 m, y 0.000 m, heading 0.0 deg, 0.000 m/s, 0.0 deg/s, 12.6 V, nearest ")
    assert captured.err.endswith(" packets\n")


def test_a_robot_that_goes_away_is_told_and_does_not_hold_the_monitor_beyond_its_time(
    clock: VirtualClock, run: Run, capsys: Capture
) -> None:
    with contextlib.ExitStack() as stack:
        url = stack.enter_context(served_pioneer(body="kinematic", clock=clock))

        def leave() -> None:
            clock.sleep(0.6)
            stack.close()

        with clock.standing():
            leaving = threading.Thread(target=leave)
            leaving.start()
            clock.add(leaving)
        assert run("monitor", url, "--for", "2s", "--json") == 1
        assert clock() < 5 * NS_PER_S
        clock.until(lambda: not leaving.is_alive())
    captured = capsys.readouterr()
    assert json.loads(captured.out.splitlines()[0])["x_m"] == 0
    assert captured.err.startswith("link lost: ")
    assert captured.err.splitlines()[-1].startswith(("p2os: ", "hint: "))


def test_what_happened_is_told_in_words() -> None:
    assert words_of(LinkLost("no packet")) == "link lost: no packet"
    assert words_of(ReconnectPlanned(1, 500_000_000)) == "reconnect planned: try 1 in 0.5 s"
    assert words_of(MotorsDisabled("button")) == "motors disabled: button"


def test_a_link_is_measured(served: object, run: Run, capsys: Capture) -> None:
    assert run("bench", served.url, "--for", "500ms", "--json") == 0
    measured = json.loads(capsys.readouterr().out)
    assert measured["packets"] >= 3
    assert measured["bad_checksums"] == 0
    assert run("bench", served.url, "--for", "200ms") == 0
    captured = capsys.readouterr()
    assert [line.split()[0] for line in captured.out.splitlines()] == ["connect", "period", "round", "losses"]
    assert captured.err.endswith("lost or damaged\n")


def test_a_robot_that_does_not_answer_config_is_measured_without(make_robot: Callable[..., object]) -> None:
    robot = make_robot()
    bench, now = LinkBenchmark(0), 0
    while now < 4 * NS_PER_S:
        now += 10 * NS_PER_MS
        robot.pioneer.advance_to(now)
        data = b"".join(robot.pioneer.take_output())
        data = b"" if data[3:4] == b"\x20" else data
        robot.pioneer.receive(bench.turn(data, now), now)
    measured = bench.result(now)
    assert (measured.round_trip, measured.unanswered) == (None, 3)
    assert (measured.period.median_ms, measured.missed) == (100.0, 0)
    assert "not measured: the robot does not answer CONFIG" in lines_of(measured)[2]
    assert bench.next_deadline() is not None


def test_a_line_without_a_robot_cannot_be_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    class Silent:
        description = "tcp:nowhere"
        received = b""

        def read(self) -> bytes:
            return b""

        def write(self, data: bytes) -> None:
            self.received += data

        def fileno(self) -> int:
            raise TransportError("cannot be waited for")

    monkeypatch.setattr(waiting, "BLIND_POLL_S", 0)
    times = iter(range(0, 10**12, 50 * NS_PER_MS))
    with pytest.raises(RemoteProtocolError, match="no robot on tcp:nowhere"):
        measure(Silent(), NS_PER_S, clock=lambda: next(times))


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["drive", "tcp:x"], 2, "p2os: nothing to do"),
        (["drive", "tcp:x", "--forward", "500"], 2, "p2os: --forward '500' has no unit: -1000m to 1000m"),
        (["drive", "tcp:x", "--turn", "1m"], 2, "p2os: --turn '1m' has the unit 'm': -36000deg to 36000deg"),
        (["drive", "tcp:x", "--vel", "1m/s"], 2, "p2os: a speed without an end"),
        (["drive", "tcp:x", "--forward", "1m", "--for", "1s"], 2, "p2os: --for goes with speeds only"),
        (["drive", "tcp:x", "--forward", "1m", "--turn-rate", "1deg/s"], 2, "p2os: --turn-rate has nothing to limit"),
        (["drive", "tcp:x", "--forward", "1m", "--vel", "-1m/s"], 2, "p2os: --vel must be positive"),
        (["drive", "tcp:127.0.0.1:1", "--forward", "1m"], 1, "p2os: cannot connect to tcp:127.0.0.1:1"),
        (["drive", "nowhere", "--forward", "1m"], 2, "p2os: 'nowhere' is not a port URL"),
        (["drive", "tcp:x", "--forward", "1m", "--robot", "nobody"], 2, "p2os: "),
        (["send"], 2, "p2os: name the robot's URL and a command"),
        (["send", "tcp:x", "JUMP"], 2, "p2os: no command 'JUMP'"),
        (["send", "tcp:x", "ENABLE", "7"], 2, "p2os: ENABLE: 7 is not what it takes: integer of 0 to 1"),
        (["send", "tcp:x", "VEL", "fast"], 2, "p2os: 'fast' is no whole number"),
        (["send", "tcp:x", "SAY", "hex:1"], 2, "p2os: 'hex:1' is no hex text"),
        (["send", "tcp:x", "300"], 2, "p2os: command 300 does not fit a byte"),
        (["send", "tcp:x", "30", "1", "2"], 2, "p2os: command 30: one argument at most"),
        (["send", "--list", "zebra"], 2, "p2os: no command has 'zebra' in it"),
        (["scan", "tcp:127.0.0.1:1"], 1, "tcp:127.0.0.1:1: no (cannot connect"),
        (["scan", "x", "--baud", "5"], 2, "p2os: --baud '5' is out of range: 300 to 4000000"),
        (["monitor", "tcp:127.0.0.1:1"], 1, "p2os: cannot connect"),
        (["monitor", "tcp:x", "--for", "-1s"], 2, "p2os: --for '-1s' is out of range: more than 0"),
        (["bench", "tcp:127.0.0.1:1"], 1, "p2os: cannot connect"),
        (["teleop", "tcp:x", "--vel", "0m/s"], 2, "p2os: --vel '0m/s' is out of range: more than 0"),
        (["teleop", "tcp:x"], 2, "p2os: there is no keyboard: stdin is not a terminal"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_and_a_hint(words: list[str], code: int, said: str, run: Run, capsys: Capture) -> None:
    assert run(*words) == code
    captured = capsys.readouterr()
    assert captured.err.startswith(said)
    assert "Traceback" not in captured.err
    assert captured.out == ""


def test_arguments_that_are_no_whole_numbers_are_refused() -> None:
    with pytest.raises(UsageError, match="it takes"):
        make_command("VEL", ["1", "2", "3"])


# ports ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("device", "description", "hardware", "words"),
    [
        ("/dev/ttyUSB0", "USB Serial", "USB VID:PID=1A86:7523 LOCATION=1-1", "CH340 adapter"),
        ("/dev/ttyACM0", "STM32", "USB VID:PID=0483:374b", "ST-LINK: a BluePill's debugger, no robot"),
        ("/dev/ttyUSB1", "thing", "USB VID:PID=FFFF:0001", "a USB device that is not known here"),
        ("/dev/ttyS0", "n/a", "n/a", "a port of the machine itself"),
        ("/dev/rfcomm0", "n/a", "n/a", "Bluetooth"),
        ("/dev/ttyUSB2", "FT232R", "USB VID:PID=0403:6001 SER=A1", "FTDI adapter: a robot may be behind it"),
    ],
)
def test_ports_are_guessed_by_what_they_say_they_are(
    device: str, description: str, hardware: str, words: str, tmp_path: object
) -> None:
    port = {"url": f"serial:{device}", "description": description, "hardware": hardware}
    assert guess(port, tmp_path).startswith(words)


@pytest.mark.parametrize(("timer", "is_reported"), [("16\n", True), ("1\n", False), ("soon", False)])
def test_a_slow_latency_timer_is_reported(timer: str, is_reported: bool, tmp_path: object) -> None:
    (tmp_path / "ttyUSB0").mkdir()
    (tmp_path / "ttyUSB0" / "latency_timer").write_text(timer)
    port = {"url": "serial:/dev/ttyUSB0", "description": "FT232R", "hardware": "USB VID:PID=0403:6001"}
    assert ("latency timer of 16 ms" in guess(port, tmp_path)) is is_reported


def test_time_counts_from_the_first_packet(fast: object, run: Run, capsys: Capture) -> None:
    assert run("monitor", fast.url, "--for", "250ms", "--json") == 0
    times = [json.loads(line)["t"] for line in capsys.readouterr().out.splitlines()]
    assert times[0] == 0
    assert 0 < times[-1] < 2


def test_a_speed_above_the_robots_own_is_said(fast: object, run: Run, capsys: Capture) -> None:
    words = ("--vel", "9m/s", "--turn-rate", "2000deg/s", "--for", "50ms")
    assert run("drive", fast.url, *words) == 0
    err = capsys.readouterr().err
    assert "note: --vel 9.00 m/s is above this robot's limit, " in err
    assert "note: --turn-rate 2000 deg/s is above this robot's limit, " in err
    assert "\x1b[K" not in err, "no live line where there is no terminal"


def test_a_robot_on_its_way_shows_where_it_is_and_an_interruption_says_that_it_stopped() -> None:
    """So slowly that it is far from its end, and from a wall, when a busy machine comes to look."""
    with contextlib.closing(RecordingRobot()) as robot:
        driver = Driver(forked_p2os("drive", robot.url, "--forward", "3m", "--vel", "50mm/s"), on_terminal=True)
        robot.wait_until_it_drives()
        shown = seen_until(driver, "m/s")
        driver.process.send_signal(signal.SIGINT)
        shown += seen_until(driver, "let go")
        assert driver.end()[0] == 130
        robot.until(lambda: STOP in robot.numbers, "STOP")
    assert "driving 3.000 m: 0." in shown
    assert "\nthe robot was stopped and let go" in shown.replace("\r", "")
    assert "interrupted" not in shown.partition("let go")[0], "the last line says it"


def seen_until(driver: Driver, words: str) -> str:
    """Return what a verb wrote on its terminal, up to some words."""
    seen, ends = "", time.monotonic() + TIMEOUT_S
    while words not in seen and time.monotonic() < ends:
        if select.select([driver.keyboard], [], [], 1.0)[0]:
            try:
                seen += os.read(driver.keyboard, 4096).decode("utf-8", "replace")
            except OSError:  # it has ended, and its terminal with it
                break
    return seen


class AskedRobot:
    """A robot that does at once what it is asked, and keeps it."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, float, float | None]] = []

    def drive(self, way_m: float, *, speed_mps: float | None) -> MotionResult:
        self.asked.append(("drive", way_m, speed_mps))
        return MotionResult(way_m, way_m, 0)

    def turn(self, angle_rad: float, *, speed_radps: float | None) -> MotionResult:
        self.asked.append(("turn", angle_rad, speed_radps))
        return MotionResult(angle_rad, angle_rad, 0)


@pytest.mark.parametrize("speeds", [(None, None), (0.2, None), (None, 0.5), (0.2, 0.5)])
def test_each_way_has_its_own_speed(speeds: tuple[float | None, float | None]) -> None:
    robot = AskedRobot()
    carry_out(DriveRequest(forward_m=1.0, turn_rad=-2.0, speed_mps=speeds[0], rate_radps=speeds[1]), robot)
    assert robot.asked == [("drive", 1.0, speeds[0]), ("turn", -2.0, speeds[1])]


@pytest.mark.parametrize(
    ("url", "asked"),
    [
        ("serial:/dev/ttyUSB0", "serial:/dev/ttyUSB0?baud=38400"),
        ("serial:/dev/ttyUSB0?baud=9600", "serial:/dev/ttyUSB0?baud=9600"),
        ("tcp:127.0.0.1:8101", "tcp:127.0.0.1:8101"),
    ],
)
def test_a_serial_line_is_asked_at_the_first_speed_unless_its_url_names_one(url: str, asked: str) -> None:
    assert _at_first(url, (38400, 9600)) == asked
