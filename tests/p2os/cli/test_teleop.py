"""Driving by keyboard: keys, the deadman, and the whole verb on a pseudo-terminal."""

import os
import pty
import re
import select
import signal
import subprocess
import time
from collections.abc import Callable

import pytest

from p2os.cli.robots.page_stop import PageStop
from p2os.cli.robots.teleop import FIRST_HOLD_NS, KEYS, NEXT_HOLD_NS, QUIT_KEYS, STOP_KEYS, KeyLoop, Teleop, split_keys
from p2os.client import DeadmanStopped, GapStopped, Link, LinkLost, Notice
from p2os.view.run_control import RunCommand
from simbase.timing import NS_PER_MS
from tests.p2os.cli.driven import until
from tests.tools.each_row import each_row
from tests.tools.forked_python import forked_p2os

TIMEOUT_S = 60.0


def teleop() -> Teleop:
    return Teleop(0.3, 0.8)


def test_a_tap_drives_until_the_deadman_and_no_longer() -> None:
    keys = teleop()
    keys.press("up", 0)
    assert keys.speeds == (0.3, 0.0)
    assert keys.next_deadline() == FIRST_HOLD_NS
    keys.advance_to(FIRST_HOLD_NS - 1)
    assert keys.is_driving
    keys.advance_to(FIRST_HOLD_NS)
    assert (keys.is_driving, keys.speeds, keys.next_deadline()) == (False, (0.0, 0.0), None)


def test_a_held_key_drives_on_and_stops_soon_after_it_is_let_go() -> None:
    keys = teleop()
    keys.press("w", 0)
    last = 0
    for last in range(660 * NS_PER_MS, 2000 * NS_PER_MS, 33 * NS_PER_MS):
        keys.press("w", last)
        assert keys.speeds == (0.3, 0.0)
    keys.advance_to(last + NEXT_HOLD_NS - 1)
    assert keys.is_driving
    keys.advance_to(last + NEXT_HOLD_NS)
    assert not keys.is_driving


@each_row("key", KEYS)
def test_each_key_has_its_direction(key: str) -> None:
    keys = teleop()
    keys.press(key, 5)
    forward, turn = KEYS[key]
    assert keys.speeds == (forward * 0.3, turn * 0.8)


@pytest.mark.parametrize("key", [*STOP_KEYS, *QUIT_KEYS])
def test_stopping_and_leaving_stop_at_once(key: str) -> None:
    keys = teleop()
    keys.press("up", 0)
    keys.press(key, 1)
    assert keys.speeds == (0.0, 0.0)
    assert keys.is_over is (key in QUIT_KEYS)


def test_plus_and_minus_change_the_speed_within_limits() -> None:
    keys = teleop()
    for _ in range(100):
        keys.press("-", 0)
    assert keys.share == 0.05
    for _ in range(100):
        keys.press("+", 0)
    assert keys.share == 1.0
    keys.press("up", 0)
    keys.press("-", 1)
    assert keys.speeds[0] == pytest.approx(0.3 / 1.1)
    keys.press("?", 2)
    assert keys.is_driving


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("w", ["w"]), ("\x1b[A\x1b[Dq", ["up", "left", "q"]), ("\x1bOB", ["down"]), ("\x1b", ["escape"]),
        ("\x1b[3~k", ["k"]), ("\x1b[1;5Cx", ["x"]), ("W\x03", ["w", "\x03"]), ("\x1b[", []), ("", []),
    ],
)  # fmt: skip
def test_characters_become_keys(text: str, keys: list[str]) -> None:
    assert split_keys(text) == keys


class Client:
    """A robot's client that keeps what it is told."""

    link = Link.CLOSED

    def __init__(self) -> None:
        self.speeds: list[tuple[float, float]] = []

    def on_event(self, callback: Callable[[Notice], None]) -> None:
        self.tell = callback

    def set_velocity(self, forward_mps: float, turn_radps: float) -> None:
        self.speeds.append((forward_mps, turn_radps))


@pytest.fixture
def paused() -> tuple[Client, KeyLoop, list[list[str]], list[int]]:
    """A client, a loop, the keys of each turn to come, and the clock."""
    client, pressed, now = Client(), [], [0]
    return client, KeyLoop(teleop(), client, read=lambda _ns: pressed.pop(0), clock=lambda: now[0]), pressed, now


def test_a_key_is_not_held_over_a_pause_nor_are_those_that_waited(
    paused: tuple[Client, KeyLoop, list[list[str]], list[int]],
) -> None:
    client, loop, pressed, now = paused
    pressed += [["w"], ["w", "w"], [], ["w"], ["w", "q"]]

    def read(_ns: int) -> list[str]:
        now[0] += {5: 0, 4: 500 * NS_PER_MS}.get(len(pressed), 10 * NS_PER_MS)
        return pressed.pop(0)

    loop._read = read
    for _ in range(4):
        loop.turn()
    assert client.speeds == [(0.3, 0.0), (0.0, 0.0), (0.0, 0.0), (0.3, 0.0)]
    now[0] += 0
    loop._read = lambda _ns: now.__setitem__(0, now[0] + 401 * NS_PER_MS) or pressed.pop(0)  # type: ignore[func-returns-value]
    loop.turn()
    assert loop.keys.is_over


def test_stop_on_the_page_stands_until_what_is_held_was_let_go() -> None:
    client, stop, now, keys = Client(), PageStop(), [0], ["w"]
    loop = KeyLoop(teleop(), client, read=lambda _ns: [*keys], clock=lambda: now[0], stop=stop)

    def turn(ms: int) -> tuple[float, float]:
        now[0] += ms * NS_PER_MS
        loop.turn()
        return client.speeds[-1]

    assert turn(50) == (0.3, 0.0)
    assert stop.offer(RunCommand(do="stop"))
    assert turn(50) == (0.0, 0.0)
    assert "press anew" in stop.state.why
    for _ in range(20):  # the key is held: a keyboard repeats it
        assert turn(50) == (0.0, 0.0)
    keys.clear()
    assert turn(FIRST_HOLD_NS // NS_PER_MS - 1) == (0.0, 0.0)
    assert loop.keys.is_stopped
    assert turn(1) == (0.0, 0.0)
    assert not loop.keys.is_stopped
    keys.append("w")
    assert turn(50) == (0.3, 0.0)
    assert stop.state.why == "the terminal drives"


def test_the_page_of_a_terminal_stops_and_does_nothing_else() -> None:
    stop = PageStop()
    assert not stop.take()
    for command in (RunCommand(do="drive", forward_mps=0.1), RunCommand(do="drive"), RunCommand(do="pause")):
        assert stop.offer(command)
        assert "stops it, and nothing else" in stop.state.trouble
    assert not stop.take()
    assert stop.offer(RunCommand(do="stop"))
    assert (stop.take(), stop.take(), stop.state.trouble, stop.state.done) == (True, False, "", 4)


@pytest.mark.parametrize("notice", [GapStopped(NS_PER_MS), DeadmanStopped(NS_PER_MS)])
def test_a_robot_that_its_client_has_stopped_waits_for_the_next_press(
    paused: tuple[Client, KeyLoop, list[list[str]], list[int]], notice: Notice
) -> None:
    client, loop, pressed, _ = paused
    pressed += [["w"], [], []]
    loop.turn()
    client.tell(notice)
    loop.turn()
    client.tell(LinkLost("that ends itself"))
    loop.turn()
    assert client.speeds == [(0.3, 0.0), (0.0, 0.0), (0.0, 0.0)]


class Terminal:
    """`p2os teleop` on a terminal of its own."""

    def __init__(self, url: str, vel: str = "200mm/s") -> None:
        self.keyboard, inside = pty.openpty()
        command = forked_p2os("teleop", url, "--vel", vel)
        self.process = subprocess.Popen(command, stdin=inside, stdout=inside, stderr=inside, start_new_session=True)
        os.close(inside)
        self.seen = self.drawn = ""

    def wait_for(self, words: str) -> None:
        ends = time.monotonic() + TIMEOUT_S
        while words not in self.seen and time.monotonic() < ends:
            if select.select([self.keyboard], [], [], 1.0)[0]:
                try:
                    text = os.read(self.keyboard, 4096).decode("utf-8", "replace")
                    self.seen, self.drawn = self.seen + text, self.drawn + text
                except OSError:  # the program has closed its terminal
                    break
        assert words in self.seen, self.seen[-500:]

    def press(self, keys: str) -> None:
        self.seen = ""
        os.write(self.keyboard, keys.encode())

    def end(self) -> int:
        try:
            return self.process.wait(TIMEOUT_S)
        finally:
            self.process.kill()
            os.close(self.keyboard)


def test_a_person_drives_lets_go_and_leaves(served: object) -> None:
    terminal = Terminal(served.url)
    terminal.wait_for("stand")
    terminal.press("\x1b[A")
    terminal.wait_for("DRIVE +0.20 m/s")
    terminal.wait_for("stand")
    terminal.press("q")
    assert terminal.end() == 0
    until(lambda: "motors: off" in served.text)


def test_ctrl_c_stops_the_robot_first(served: object) -> None:
    terminal = Terminal(served.url)
    terminal.wait_for("stand")
    terminal.press("w")
    terminal.wait_for("DRIVE +0.20 m/s")
    until(lambda: "motors: on" in served.text)  # a packet may step over any one place
    terminal.process.send_signal(signal.SIGINT)
    assert terminal.end() == 130
    until(lambda: "motors: off" in served.text)


def test_a_speed_above_the_robots_own_is_said_and_the_one_it_takes_is_shown(served: object) -> None:
    terminal = Terminal(served.url, vel="9m/s")
    terminal.wait_for("stand")
    said = re.search(r"note: --vel 9\.00 m/s is above this robot's limit, ([0-9.]+) m/s: it takes that", terminal.seen)
    terminal.press("w")
    terminal.wait_for("DRIVE +")
    terminal.press("q")
    assert terminal.end() == 0
    assert said, terminal.seen
    assert f"DRIVE +{said[1]} m/s" in terminal.drawn
