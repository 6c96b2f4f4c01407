"""What is printed never stands between a client and a robot: readers that do not read, and readers that go."""

import contextlib
import fcntl
import io
import os
import pty
import select
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from p2os.cli import printing
from p2os.cli.printing import MOST_BYTES, QueuedStream, queue_output, restored_output
from p2os.cli.robots.teleop import NEXT_HOLD_NS
from simbase.errors import FileError
from simbase.terminal import drawn
from simbase.timing import NS_PER_S
from tests.p2os.cli.driven import AT_ONCE_S, STOP, TIMEOUT_S, VEL, Driver, RecordingRobot, is_raw, until
from tests.tools.forked_python import forked_p2os


class Pipe:
    """A pipe whose reader reads when the test says so."""

    def __init__(self) -> None:
        self.reader, writer = os.pipe()
        self.below = os.fdopen(writer, "w", encoding="utf-8")

    def read_until(self, end: str) -> str:
        text = ""
        while not text.endswith(end):
            assert select.select([self.reader], [], [], TIMEOUT_S)[0], text[-300:]
            text += os.read(self.reader, 1 << 16).decode()
        return text


@pytest.fixture
def pipe() -> Iterator[Pipe]:
    pipe = Pipe()
    yield pipe
    with contextlib.suppress(OSError):
        os.close(pipe.reader)
    with contextlib.suppress(OSError):
        pipe.below.close()


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(printing, "FLUSH_S", 0.05)


def test_what_is_written_arrives_in_order(pipe: Pipe) -> None:
    stream = QueuedStream(pipe.below, "standard output")
    for number in range(1000):
        print(number, "é", file=stream)
    print("end", file=stream, flush=True)
    assert pipe.read_until("end\n").splitlines()[:-1] == [f"{number} é" for number in range(1000)]
    assert (stream.encoding, stream.fileno(), stream.isatty()) == ("utf-8", pipe.below.fileno(), False)
    with pytest.raises(TypeError):
        stream.write(b"bytes")  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["pipe", "terminal"])
def test_what_both_streams_write_to_one_place_arrives_in_order(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    reader, writer = os.pipe() if kind == "pipe" else pty.openpty()
    below = [os.fdopen(each, "w", encoding="utf-8") for each in (writer, os.dup(writer))]
    for name, stream in zip(("stdout", "stderr"), below, strict=True):
        monkeypatch.setattr(sys, name, stream)
    wanted = ""
    with restored_output():
        queue_output()
        for number in range(300):
            sys.stderr.write(f"{number}: ")
            sys.stderr.write("tried\n")
            sys.stdout.write(f"found {number}\n")
            wanted += f"{number}: tried\nfound {number}\n"
            if number % 7 == 0:
                time.sleep(0)  # another thread's turn
        came = b""
        while len(came.replace(b"\r", b"")) < len(wanted):
            assert select.select([reader], [], [], TIMEOUT_S)[0], came[-300:]
            came += os.read(reader, 1 << 16)
    assert came.decode().replace("\r\n", "\n") == wanted
    for stream in below:
        stream.close()
    os.close(reader)


def test_a_character_that_the_reader_cannot_be_given_is_refused_where_it_is_written() -> None:
    reader, writer = os.pipe()
    with os.fdopen(writer, "w", encoding="ascii") as below:
        stream = QueuedStream(below, "standard output")
        with pytest.raises(UnicodeEncodeError):
            stream.write("90°\n")
        stream.write("90 deg\n")
        stream.queue.end()
        assert os.read(reader, 100) == b"90 deg\n"
    os.close(reader)


@pytest.mark.usefixtures("impatient")
def test_a_reader_that_does_not_read_misses_whole_lines_and_is_told_how_many(pipe: Pipe) -> None:
    stream = QueuedStream(pipe.below, "standard output")
    line = "x" * 999 + "\n"
    most = MOST_BYTES // 1000 + 500
    began = time.monotonic()
    for _ in range(most):
        stream.write(line)
    for piece in ("half a ", "line\n", "\rstatus", "\rstatus", "\n"):
        stream.write(piece)
    stream.note_left_out()
    stream.queue.end()
    assert time.monotonic() - began < TIMEOUT_S
    lines = pipe.read_until("read\n").splitlines(keepends=True)
    written = lines.count(line)
    reported = f"p2os: {most + 3 - written} lines of standard output left out: the reader does not read\n"
    assert lines == [line] * written + [reported]


def test_lines_left_out_of_standard_output_are_reported_on_standard_error(pipe: Pipe) -> None:
    errors = Pipe()
    notes = QueuedStream(errors.below, "standard error")
    stream = QueuedStream(pipe.below, "standard output", notes)
    line = "x" * 4095 + "\n"
    for _ in range(MOST_BYTES // 4096 + 100):
        stream.write(line)
    read = 0
    while read < MOST_BYTES:
        assert select.select([pipe.reader], [], [], TIMEOUT_S)[0]
        read += len(os.read(pipe.reader, 1 << 16))
    until(lambda: stream.queue.waiting < MOST_BYTES // 2, "room")
    stream.write("{}\n")
    pipe.read_until("{}\n")
    reported = errors.read_until("read\n")
    assert reported.startswith("p2os: ")
    assert 50 < int(reported.split()[1]) <= 100


def test_a_reader_that_goes_is_told_of_once(pipe: Pipe) -> None:
    stream = QueuedStream(pipe.below, "standard output")
    os.close(pipe.reader)
    stream.write("to nobody\n")
    until(lambda: stream.queue.error, "the error")
    with pytest.raises(BrokenPipeError, match="nobody reads standard output"):
        stream.write("again\n")
    assert stream.write("and again\n") == 10
    stream.queue.end()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full disk at hand")
def test_a_disk_that_is_full_is_named() -> None:
    with open("/dev/full", "w", encoding="utf-8") as full:  # noqa: PTH123  # a device
        stream = QueuedStream(full, "standard output")
        stream.write("x\n")
        until(lambda: stream.queue.error, "the error")
        with pytest.raises(FileError, match="cannot write to standard output: no space left on device"):
            stream.write("x\n")


def test_the_streams_are_replaced_for_a_while_where_they_could_hold_anybody_up(
    pipe: Pipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    captured = io.StringIO()
    monkeypatch.setattr(sys, "stdout", captured)
    monkeypatch.setattr(sys, "stderr", pipe.below)
    with restored_output():
        queue_output()
        queue_output()
        assert drawn(sys.stdout) is captured
        queued = drawn(sys.stderr)
        assert isinstance(queued, QueuedStream)
        assert queued.below is pipe.below
        sys.stderr.write("told\n")
    assert sys.stderr is pipe.below
    assert pipe.read_until("\n") == "told\n"


# The verbs --------------------------------------------------------------------------------


@pytest.fixture
def robot() -> Iterator[RecordingRobot]:
    robot = RecordingRobot()
    yield robot
    robot.close()


def fill(descriptor: int) -> None:
    """Fill a pipe or a terminal until nothing more fits, as an output that nobody reads."""
    os.set_blocking(descriptor, False)
    for piece in (b"." * 1024, b"."):
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(descriptor, piece)
    os.set_blocking(descriptor, True)


@pytest.mark.slow
def test_sniff_passes_on_what_nobody_wants_to_see(robot: RecordingRobot) -> None:
    reader, writer = os.pipe()
    with contextlib.suppress(AttributeError, OSError):
        fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, 4096)
    fill(writer)
    sniff = Driver(forked_p2os("sniff", robot.url, "--listen", "tcp:127.0.0.1:0"), stdout=writer)
    os.close(writer)
    client = Driver(forked_p2os("drive", sniff.listens_at(), "--vel", "100mm/s", "--for", "1min"))
    try:
        robot.wait_until_it_drives()
        sent = len([number for number in robot.numbers if number == VEL])
        until(lambda: robot.numbers.count(VEL) > sent + 3, "more of the client's frames")
        asked_at = time.monotonic()
        client.process.terminate()
        assert robot.when_received(STOP, asked_at) - asked_at < AT_ONCE_S
        assert client.end()[0] == 130
        sniff.process.terminate()
        assert sniff.process.wait(TIMEOUT_S) == 130, "the flush at the end is bounded"
    finally:
        client.close()
        sniff.close()
        os.close(reader)


def test_sniff_whose_reader_goes_sends_the_closing_frames(robot: RecordingRobot) -> None:
    sniff = Driver(forked_p2os("sniff", robot.url, "--listen", "tcp:127.0.0.1:0"))
    assert sniff.process.stdout is not None
    client = Driver(forked_p2os("drive", sniff.listens_at(), "--vel", "100mm/s", "--for", "1min"))
    try:
        robot.wait_until_it_drives()
        gone_at = time.monotonic()
        sniff.process.stdout.close()
        robot.when_received(STOP, gone_at)
        assert sniff.process.wait(TIMEOUT_S) == 1
        assert client.end()[0] == 1
    finally:
        client.close()
        sniff.close()


def test_a_signal_while_the_last_words_wait_for_a_reader_ends_at_once(robot: RecordingRobot) -> None:
    reader, writer = os.pipe()
    fill(writer)
    process = subprocess.Popen(forked_p2os("info", robot.url), stdout=writer, stderr=writer)
    os.close(writer)
    try:
        began = time.monotonic()
        until(lambda: "client gone" in robot.reported, "the end")
        time.sleep(0.3)
        process.terminate()
        assert process.wait(TIMEOUT_S) == 130
        assert time.monotonic() - began < TIMEOUT_S
    finally:
        process.kill()
        process.wait(TIMEOUT_S)
        os.close(reader)


@pytest.mark.slow
def test_a_key_let_go_stops_the_robot_though_the_terminal_is_held(robot: RecordingRobot) -> None:
    keyboard, inside = pty.openpty()
    fill(inside)
    process = subprocess.Popen(
        forked_p2os("teleop", robot.url), stdin=inside, stdout=inside, stderr=inside, start_new_session=True
    )
    os.close(inside)
    try:
        until(lambda: 1 in robot.numbers, "a session")
        until(lambda: is_raw(keyboard), "a raw terminal")
        os.write(keyboard, b"w")
        robot.wait_until_it_drives()
        for _ in range(5):
            time.sleep(0.05)
            let_go_at = time.monotonic()
            os.write(keyboard, b"w")

        def zero_at() -> float:
            return next(
                (at for at, command in list(robot.received)
                 if at > let_go_at and command.number == VEL and command.integer == 0), 0.0,
            )  # fmt: skip

        until(zero_at, "a speed of zero")
        assert NEXT_HOLD_NS / NS_PER_S <= zero_at() - let_go_at < AT_ONCE_S
        os.write(keyboard, b"q")
        assert process.wait(TIMEOUT_S) == 0
    finally:
        process.kill()
        process.wait(TIMEOUT_S)
        os.close(keyboard)
