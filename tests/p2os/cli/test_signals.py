"""Whatever signal ends a verb: the robot is told to stop first, and the exit code is 130."""

import re
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from p2os.capture import Direction, capture_of, write_recording
from p2os.cli.main import run
from p2os.protocol.commands import Command, CommandNumber
from simbase.command_line import signals
from simbase.command_line.signals import (
    ENDING_NS,
    FATAL,
    end_on_signals,
    end_on_suspension,
    postponed,
    restored_signals,
)
from simbase.timing import NS_PER_S
from tests.p2os.cli.driven import AT_ONCE_S, CLOSE, COMMAND, STOP, Driver, RecordingRobot, is_raw, until
from tests.tools.forked_python import forked_p2os, forked_python

NUMBERS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1, signal.SIGTSTP]
IDENTITY = bytes.fromhex("fafb18025669727475616c0050696f6e6565720070326478002a13")
PAD = """
import sys
from p2os.cli.robots import teleop
from p2os.cli.main import main
from p2os.gamepad import PadReport

class Pad:
    name = "a pad"
    def __init__(self): self.reports = iter([PadReport(), PadReport(up=True)])
    def __enter__(self): return self
    def __exit__(self, *_): pass
    def report(self): return next(self.reports, PadReport(forward=600))

teleop.SdlPad = Pad
main(["teleop", sys.argv[1], "--pad"])
"""


#: Returns the words that start `p2os`.
Start = Callable[..., list[str]]
Begin = Callable[[str, Path, Start], list[Driver]]
Robots = Callable[[], RecordingRobot]


def started(*words: str) -> list[str]:
    """Return those of a process that is itself stopped, or gets a burst of signals."""
    return [*COMMAND, *words]


@pytest.fixture
def robots() -> Iterator[Robots]:
    """Serve a robot more with each call."""
    served: list[RecordingRobot] = []

    def serve() -> RecordingRobot:
        served.append(RecordingRobot())
        return served[-1]

    yield serve
    for robot in served:
        robot.close()


@pytest.fixture
def robot(robots: Robots) -> RecordingRobot:
    return robots()


@pytest.fixture
def drivers() -> Iterator[list[Driver]]:
    """Those that a test has started; none outlives it."""
    started: list[Driver] = []
    yield started
    for driver in started:
        driver.close()


def recorded_drive(folder: Path) -> str:
    """A recording that drives for a minute."""
    frames = [Command(0), Command(1), Command(2), Command(1), Command(4, 1), Command(11, 200)]
    robot = [Command(0).to_frame().to_bytes(), Command(1).to_frame().to_bytes(), IDENTITY]
    talk = []
    for place, command in enumerate(frames):
        talk.append((place * 1000, Direction.TO_ROBOT, command.to_frame().to_bytes()))
        if place < 3:
            talk.append((place * 1000 + 500, Direction.FROM_ROBOT, robot[place]))
    pulses = [(second * NS_PER_S, Direction.TO_ROBOT, Command(0).to_frame().to_bytes()) for second in range(1, 60)]
    path = folder / "drive.jsonl"
    path.write_text(write_recording(capture_of(talk + pulses)))
    return str(path)


def by_keys(url: str, _folder: Path, start: Start) -> list[Driver]:
    return [Driver(start("teleop", url), on_terminal=True)]


def by_pad(url: str, _folder: Path, _start: Start) -> list[Driver]:
    return [Driver([forked_python(), "-c", PAD, url])]


def by_drive(url: str, _folder: Path, start: Start) -> list[Driver]:
    return [Driver(start("drive", url, "--vel", "100mm/s", "--for", "1min"))]


def by_way(url: str, _folder: Path, start: Start) -> list[Driver]:
    return [Driver(start("drive", url, "--forward", "1m", "--vel", "50mm/s"))]


def by_replay(url: str, folder: Path, start: Start) -> list[Driver]:
    return [Driver(start("replay", recorded_drive(folder), url, "--as", "client"))]


def through_sniff(url: str, _folder: Path, start: Start) -> list[Driver]:
    sniff = Driver(start("sniff", url, "--listen", "tcp:127.0.0.1:0", "--quiet"))
    return [sniff, Driver(forked_p2os("drive", sniff.listens_at(), "--vel", "100mm/s", "--for", "1min"))]


#: Each drives the robot; the first of its processes is the one that is interrupted.
VERBS: list[Begin] = [by_drive, by_way, by_keys, by_pad, by_replay, through_sniff]


# Each row of a verb has a robot of its own, and all of them wait for theirs at the same time.


@pytest.mark.parametrize("begin", VERBS)
def test_each_signal_stops_the_robot_first(begin: Begin, robots: Robots, drivers: list[Driver], tmp_path: Path) -> None:
    rows: list[tuple[signal.Signals, RecordingRobot, Driver]] = []
    for number in NUMBERS:
        robot, folder = robots(), tmp_path / number.name
        folder.mkdir()
        begun = begin(robot.url, folder, forked_p2os)
        drivers += begun
        rows.append((number, robot, begun[0]))
    sent_at: list[float] = []
    for number, robot, driver in rows:
        if begin is by_keys:
            until(lambda: is_raw(driver.keyboard), "a raw terminal")  # noqa: B023  # it is called now
            driver.press("w")
        robot.wait_until_it_drives()
        sent_at.append(time.monotonic())
        driver.process.send_signal(number)
    for (number, robot, driver), at in zip(rows, sent_at, strict=True):
        stopped_at = robot.when_received(STOP, at)
        assert stopped_at - at < AT_ONCE_S, number
        assert robot.when_received(CLOSE, at) >= stopped_at, number
        code, said = driver.end()
        assert code == 130, (number, said)
        assert "Traceback" not in said
        until(lambda: not robot.is_moving, "rest")  # noqa: B023  # it is called now


def test_a_command_that_was_sent_is_taken_back_by_each_signal(robots: Robots, drivers: list[Driver]) -> None:
    rows = [(number, robots()) for number in NUMBERS]
    drivers += [Driver(forked_p2os("send", robot.url, "VEL", "200", "--wait", "1min")) for _, robot in rows]
    sent_at: list[float] = []
    for (number, robot), driver in zip(rows, drivers, strict=True):
        robot.when_received(CommandNumber.VEL, 0.0)
        assert [command.integer for _, command in robot.received if command.number == CommandNumber.VEL] == [200]
        sent_at.append(time.monotonic())
        driver.process.send_signal(number)
    for (number, robot), driver, at in zip(rows, drivers, sent_at, strict=True):
        assert driver.end()[0] == 130, number
        assert robot.when_received(STOP, at) <= robot.when_received(CLOSE, at)


def test_many_signals_do_not_cut_the_stopping_short(robot: RecordingRobot, drivers: list[Driver]) -> None:
    drivers.append(Driver(started("drive", robot.url, "--vel", "100mm/s", "--for", "1min")))
    robot.wait_until_it_drives()
    for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT, signal.SIGQUIT) * 5:
        drivers[0].process.send_signal(number)
        time.sleep(0.002)
    assert drivers[0].end()[0] == 130
    robot.until(lambda: robot.numbers[-1] == CLOSE, "CLOSE")
    assert STOP in robot.numbers


@pytest.mark.slow
def test_a_program_that_was_suspended_stops_the_robot_before_anything_else(
    robots: Robots, drivers: list[Driver], tmp_path: Path
) -> None:
    rows: list[tuple[Begin, RecordingRobot, Driver]] = []
    for begin in (by_drive, by_replay, through_sniff):
        robot = robots()
        begun = begin(robot.url, tmp_path, started)
        drivers += begun
        rows.append((begin, robot, begun[0]))
    for _, robot, driver in rows:
        robot.wait_until_it_drives()
        driver.process.send_signal(signal.SIGSTOP)
    time.sleep(0.9)  # longer than a wait of 0.2 s and a gap of 0.35 s
    for begin, robot, driver in rows:
        received = len(robot.received)
        woken_at = time.monotonic()
        driver.process.send_signal(signal.SIGCONT)
        assert robot.when_received(STOP, woken_at) - woken_at < AT_ONCE_S
        robot.when_received(CLOSE, woken_at)
        if begin is not by_drive:  # whose own client stops it
            assert robot.numbers[received:] == [STOP, CommandNumber.VEL, CLOSE]
        paused = r"paused for \d+\.\d"
        if begin is through_sniff:
            driver.hear(paused)
            driver.process.send_signal(signal.SIGINT)
        code, said = driver.end()
        assert code == (130 if begin is through_sniff else 1)
        assert re.search(paused, said)


# The handlers by themselves ---------------------------------------------------------------


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """Our handlers, on a clock that a test sets."""
    time_ns = [0]
    monkeypatch.setattr(signals, "monotonic_ns", lambda: time_ns[0])
    with restored_signals():
        for number in NUMBERS:
            signal.signal(number, signal.SIG_DFL)
        end_on_signals()
        yield time_ns


def test_the_first_signal_interrupts_and_the_next_ones_wait_three_seconds(now: list[int]) -> None:
    with pytest.raises(KeyboardInterrupt, match="SIGTERM"):
        signal.raise_signal(signal.SIGTERM)
    now[0] = ENDING_NS - 1
    signal.raise_signal(signal.SIGINT)
    now[0] = ENDING_NS
    with pytest.raises(KeyboardInterrupt, match="SIGHUP"):
        signal.raise_signal(signal.SIGHUP)


def test_a_signal_waits_for_the_end_of_what_must_not_be_interrupted(now: list[int]) -> None:
    done = []
    with pytest.raises(KeyboardInterrupt, match="SIGUSR2"):  # noqa: PT012  # the block is what is tested
        with postponed(), postponed() as inner:
            signal.raise_signal(signal.SIGUSR2)
            done.append("all of it")
            del inner
        done.append("not this")
    assert done == ["all of it"]


def test_every_signal_of_the_table_is_handled_and_given_back(now: list[int]) -> None:
    handlers = {signal.getsignal(getattr(signal, name)) for name in FATAL if hasattr(signal, name)}
    assert len(handlers) == 1
    assert signal.getsignal(signal.SIGTSTP) is signal.SIG_DFL
    end_on_suspension()
    assert signal.getsignal(signal.SIGTSTP) in handlers
    assert signal.getsignal(signal.SIGTTOU) is signal.SIG_IGN


def test_a_program_that_was_started_with_hang_ups_ignored_keeps_ignoring_them(monkeypatch: pytest.MonkeyPatch) -> None:
    with restored_signals():
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        monkeypatch.delattr(signal, "SIGUSR2")  # as on other systems
        end_on_signals()
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        assert signal.getsignal(signal.SIGINT) is not signal.SIG_IGN, "a shell makes background programs deaf to it"


def test_a_run_of_the_command_line_gives_the_handlers_back() -> None:
    before = [signal.getsignal(number) for number in NUMBERS]
    assert run(["--version"]) == 0
    assert [signal.getsignal(number) for number in NUMBERS] == before
