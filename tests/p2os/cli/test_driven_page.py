"""A robot at a port that a page drives: speeds are limited, and it stops at once when a page is not there any more."""

import contextlib
import math
import re
import signal
import subprocess
import time
from collections.abc import Callable

import pytest

from p2os.cli.main import run as p2os
from p2os.cli.robots.command_queue import MOST_COMMANDS
from p2os.cli.robots.driven_page import TURN_NS, PageDriver
from p2os.client import Link
from p2os.client.notices import DeadmanStopped, LinkLostError, Notice
from p2os.view.run_control import DRIVE_HOLD_NS, RunCommand
from simbase.timing import NS_PER_S
from tests.p2os.cli.driven import AT_ONCE_S, COMMAND, STOP, VEL, RecordingRobot

DRIVE = RunCommand(do="drive", forward_mps=0.2, turn_dps=30.0)
LET_GO, HALT = RunCommand(do="drive"), RunCommand(do="stop")


class Client:
    """What the robot was told."""

    link = Link.OPEN

    def __init__(self) -> None:
        self.commanded: list[object] = []
        self.tell: Callable[[Notice], None] = lambda _notice: None
        self.is_lost = False

    def set_velocity(self, forward_mps: float, turn_radps: float) -> None:
        if self.is_lost:
            raise LinkLostError("the link was lost")
        self.commanded.append((forward_mps, round(math.degrees(turn_radps), 6)))

    def stop(self) -> None:
        self.commanded.append("stop")

    def on_event(self, callback: Callable[[Notice], None]) -> None:
        self.tell = callback


class Driven:
    """A driver with a clock of its own."""

    def __init__(self) -> None:
        self.now = 0
        self.driver, self.client = PageDriver(0.3, 45.0, clock=lambda: self.now), Client()
        self.client.on_event(self.driver._notices.put)

    def turn(self, *commands: RunCommand, after_ns: int = 0) -> list[object]:
        self.client.commanded.clear()
        self.now += after_ns
        for command in commands:
            assert self.driver.offer(command)
        for _ in commands or [None]:
            self.driver.turn(self.client, 0)
        return list(self.client.commanded)


def test_it_drives_while_a_page_says_so_and_stops_when_it_is_let_go() -> None:
    driven = Driven()
    assert driven.turn() == []
    assert driven.turn(DRIVE) == [(0.2, 30.0)]
    assert driven.driver.state.why == "driving +0.20 m/s, +30 deg/s"
    assert driven.turn(after_ns=TURN_NS) == [(0.2, 30.0)]
    assert driven.turn(LET_GO) == ["stop"]
    assert driven.turn() == []
    assert driven.turn(RunCommand(do="drive", forward_mps=2.0)) == [(0.3, 0.0)], "no faster than it may"


def test_it_stops_when_nothing_is_heard_of_a_page_and_what_is_held_still_means_nothing() -> None:
    driven = Driven()
    driven.turn(DRIVE)
    assert driven.turn(after_ns=DRIVE_HOLD_NS) == ["stop"]
    assert driven.turn(DRIVE) == []
    assert "press anew" in driven.driver.state.why
    assert driven.turn(LET_GO, DRIVE) == [(0.2, 30.0)]


@pytest.mark.parametrize(("waited", "then"), [(LET_GO, [(0.2, 30.0)]), (DRIVE, []), (HALT, [])])
def test_of_what_waited_while_the_machine_slept_only_what_stops_counts(
    waited: RunCommand, then: list[object], monkeypatch: pytest.MonkeyPatch
) -> None:
    driven = Driven()
    driven.turn(DRIVE)
    commands = driven.driver._commands

    def taken_after_a_sleep(_wait_s: float) -> RunCommand | None:
        driven.now += 3600 * NS_PER_S
        return commands._stops.popleft() if commands._stops else commands._others.popleft()

    with monkeypatch.context() as asleep:
        asleep.setattr(commands, "take", taken_after_a_sleep)
        assert driven.turn(waited) == ["stop"]
    assert driven.turn(DRIVE) == then


def test_stop_stops_whoever_drives_and_finds_room_whatever_waits() -> None:
    driven = Driven()
    driven.turn(DRIVE)
    assert driven.turn(HALT) == ["stop"]
    assert driven.turn(HALT) == ["stop"]
    assert driven.turn(DRIVE) == []
    for _ in range(MOST_COMMANDS):
        assert driven.driver.offer(DRIVE)
    assert not driven.driver.offer(DRIVE)
    assert driven.driver.offer(HALT)
    assert driven.driver.offer(LET_GO)


def test_a_lost_link_a_clients_own_stop_and_another_command_drive_nothing() -> None:
    driven = Driven()
    driven.turn(DRIVE)
    driven.client.tell(DeadmanStopped(1.0))  # type: ignore[arg-type]  # how long does not matter
    assert driven.turn() == ["stop"]
    assert driven.turn(DRIVE) == []
    driven.turn(LET_GO)
    driven.client.is_lost = True
    assert driven.turn(DRIVE) == []
    assert "lost" in driven.driver.state.trouble
    driven.client.is_lost = False
    assert driven.turn(DRIVE) == []
    assert driven.turn(RunCommand(do="hand", words="remove crate")) == []
    assert "knows no 'hand'" in driven.driver.state.trouble


@pytest.mark.parametrize(
    ("words", "says"),
    [(["dodge", "--drive"], "robot at a port"), (["tcp:127.0.0.1:9", "--vel", "0.2m/s"], "--vel goes with --drive"),
     (["tcp:127.0.0.1:9", "--turn-rate", "9deg/s"], "--turn-rate goes with")],
)  # fmt: skip
def test_what_goes_with_driving_only_is_said(words: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["view", *words, "--no-browser"]) == 2
    said = capsys.readouterr().err
    assert says in said
    assert said.startswith("p2os: ")


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["page", "stop", "signal"])
def test_a_page_that_is_closed_a_stop_and_a_signal_stop_the_robot(ending: str) -> None:
    websockets = pytest.importorskip("websockets.sync.client")
    pytest.importorskip("uvicorn")

    words = ["--drive", "--vel", "150mm/s", "--no-browser"]
    with (
        contextlib.closing(RecordingRobot()) as robot,
        subprocess.Popen([*COMMAND, "view", robot.url, *words], stderr=subprocess.PIPE, text=True) as running,
        contextlib.ExitStack() as stack,
    ):
        assert running.stderr is not None
        stack.callback(running.kill)
        port, token = re.match(r"page: http://127\.0\.0\.1:(\d+)/#(\S+)", running.stderr.readline()).groups()  # type: ignore[union-attr]  # it is that
        with websockets.connect(
            f"ws://127.0.0.1:{port}/stream", subprotocols=["p2os.view.1", token.replace("=", ".")], proxy=None
        ) as page:
            robot.until(lambda: robot.numbers, "a session")
            page.send('{"do": "drive", "forward_mps": 2.0}')
            robot.when_received(VEL, 0.0)
            begun = time.monotonic()
            if ending == "stop":
                page.send('{"do": "stop"}')
            elif ending == "signal":
                running.send_signal(signal.SIGINT)
            else:
                page.close()
            assert robot.when_received(STOP, begun) - begun < AT_ONCE_S
        running.send_signal(signal.SIGINT)
        running.communicate(timeout=20)
    speeds = [command.argument for _, command in robot.received if int(command.number) == VEL]
    assert {abs(one) for one in speeds if isinstance(one, int)} <= {0, 150}
    assert 150 in speeds
