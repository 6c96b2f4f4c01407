"""The adapter's PC program run for real: its console on pipes, its wires on a socket, every wait bounded."""

import contextlib
import os
import signal
import socket
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from p2os.protocol.commands import Command
from p2os.protocol.frames import Decoder, Frame
from p2os.transport import HungUpError, listen_url, open_url
from p2os.transport.waiting import wait_readable

#: Generous: a loaded machine is no fault of the program.
PATIENCE_S = 60.0
REPORT_S = 0.02
CONNECT = 1 << 6
RESET = 1 << 7


def motors(left: int, right: int) -> int:
    """Return the input word of two motor values."""
    return left & 7 | (right & 7) << 3


class Lines:
    """What a program says, line by line, gathered in the background."""

    def __init__(self, stream: Iterator[str]) -> None:
        self.lines: list[str] = []
        self._news = threading.Condition()
        self._has_ended = False
        self._thread = threading.Thread(target=self._gather, args=(stream,), daemon=True)
        self._thread.start()

    def wait(self, is_wanted: Callable[[str], bool]) -> str:
        """Return the first line that is wanted, waiting for it if need be; it and all before it are forgotten."""
        with self._news:
            self._news.wait_for(lambda: self._has_ended or any(map(is_wanted, self.lines)), PATIENCE_S)
            for place, line in enumerate(self.lines):
                if is_wanted(line):
                    del self.lines[: place + 1]
                    return line
            raise AssertionError(f"not said: {self.lines}")

    def _gather(self, stream: Iterator[str]) -> None:
        with contextlib.suppress(OSError, ValueError):  # it was killed, or closed under this
            for line in stream:
                with self._news:
                    self.lines.append(line.rstrip("\n"))
                    self._news.notify_all()
        with self._news:
            self._has_ended = True
            self._news.notify_all()


class Relay:
    """Stands between the program and a robot, and keeps what the program says."""

    def __init__(self, robot: str) -> None:
        self._listener = listen_url("tcp:127.0.0.1:0")
        self.url = self._listener.description
        #: Each frame as its command, without its argument where it has none.
        self.said: list[Command] = []
        self._robot = robot
        self._over = threading.Event()
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def wait(self, is_so: Callable[[list[Command]], bool]) -> None:
        """Wait until what the program has said so far is so."""
        with self._news:
            assert self._news.wait_for(lambda: is_so(self.said), PATIENCE_S), self.said[-40:]

    def close(self) -> None:
        """Take the line away from both."""
        self._over.set()
        self._thread.join(PATIENCE_S)
        self._listener.close()

    def _carry(self) -> None:
        near = None
        while near is None and not self._over.is_set():
            wait_readable([self._listener.fileno() or 0], REPORT_S)
            near = self._listener.accept()
        if near is None:
            return
        far, decoder = open_url(self._robot), Decoder()
        with contextlib.suppress(HungUpError):
            while not self._over.is_set():
                wait_readable([near.fileno(), far.fileno()], REPORT_S)
                near.write(far.read())
                data = near.read()
                far.write(data)
                decoder.receive(data, 0)
                with self._news:
                    while (item := decoder.next_item()) is not None:
                        assert isinstance(item, Frame)
                        self.said.append(Command.from_frame(item))
                    self._news.notify_all()
        for line in (near, far):
            line.close()


class Program:
    """A running p2os-adapter; `stderr` takes its events elsewhere, to a descriptor."""

    def __init__(
        self, path: Path, folder: Path, line: str, *options: str, stderr: int = subprocess.PIPE, **variables: str
    ) -> None:
        self.wires_path = folder / "wires.sock"
        self.process = subprocess.Popen(
            [path, "--line", line, "--wires", str(self.wires_path), *options],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=stderr, text=True, bufsize=1,
            env=os.environ | variables,
        )  # fmt: skip
        assert self.process.stdout is not None
        self.said, self.events = Lines(self.process.stdout), Lines(self.process.stderr or iter(()))
        self.said.wait(lambda line: line.startswith("P2OS adapter"))
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(str(self.wires_path))
        self.outputs = Lines(self.socket.makefile("r"))

    def wires(self, word: int) -> None:
        """Drive the input wires."""
        self.socket.sendall(f"in {word:x}\n".encode())

    @contextmanager
    def reporting(self, report: str) -> Iterator[None]:
        """Be a pad while the block runs: `up down forward backward turn`, at once and fifty times a second."""
        is_over = threading.Event()

        def report_on() -> None:
            while True:
                self.socket.sendall(f"pad {report}\n".encode())
                if is_over.wait(REPORT_S):
                    return

        thread = threading.Thread(target=report_on)
        thread.start()
        try:
            yield
        finally:
            is_over.set()
            thread.join()

    def type(self, *lines: str) -> None:
        """Type lines on the console."""
        assert self.process.stdin is not None
        self.process.stdin.write("".join(f"{line}\n" for line in lines))
        self.process.stdin.flush()

    def event(self, what: str) -> str:
        """Wait for an event."""
        return self.events.wait(lambda line: what in line)

    def answer(self, start: str) -> str:
        """Wait for a line of the console."""
        return self.said.wait(lambda line: line.startswith(start))

    def end(self, number: signal.Signals = signal.SIGINT) -> int:
        """Interrupt it, and return its exit code."""
        self.process.send_signal(number)
        return self.process.wait(PATIENCE_S)


@contextmanager
def running(path: Path, line: str, *options: str, stderr: int = subprocess.PIPE, **variables: str) -> Iterator[Program]:
    """Run the program while the block runs."""
    with tempfile.TemporaryDirectory() as folder:  # short: a socket's path has at most 107 characters
        program = Program(path, Path(folder), line, *options, stderr=stderr, **variables)
        try:
            yield program
        finally:
            program.process.kill()
            program.process.wait()
            program.socket.close()
            for stream in (program.process.stdin, program.process.stdout, program.process.stderr):
                if stream is not None:
                    stream.close()
