"""What is watched while somebody attacks: a program, a line to a robot, a client's own session, the machine."""

import contextlib
import os
import re
import select
import signal
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Self

from tools.hostile import kernel, packets

#: Nothing is waited for longer.
LIMIT_S = 30.0
HOST = "127.0.0.1"


def until(holds: Callable[[], bool], limit_s: float = LIMIT_S) -> bool:
    """Wait for what has to come, and tell whether it did."""
    ends = time.monotonic() + limit_s
    while not (so := holds()) and time.monotonic() < ends:
        time.sleep(0.005)
    return so


def listening(port: int = 0) -> socket.socket:
    """Return a socket of the judge's own that listens on this machine; nobody's port, if none is named."""
    return socket.create_server((HOST, port))


def free_ports(count: int) -> list[int]:
    """Return ports that nobody has, in a row."""
    while True:
        with contextlib.suppress(OSError), contextlib.ExitStack() as held:
            first = held.enter_context(listening()).getsockname()[1]
            for following in range(first + 1, first + count):
                held.enter_context(listening(following))
            return [*range(first, first + count)]


class RunningVerb:
    """A verb that runs, with what it has printed; ended with all its children."""

    def __init__(self, words: Sequence[str], *, ready: str) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self._output = Path(self._folder.name, "output")
        with self._output.open("wb") as output:
            self.process = subprocess.Popen(
                words, stdin=subprocess.PIPE, stdout=output, stderr=subprocess.STDOUT, start_new_session=True,
                cwd=self._folder.name, env={**os.environ, "COLUMNS": "80", "NO_COLOR": "1"},
            )  # fmt: skip
        until(lambda: re.search(ready, self.printed) is not None or not self.runs)
        if not self.runs or not re.search(ready, self.printed):
            printed = self.printed.strip() or "nothing printed"
            self.end()
            raise RuntimeError(f"{' '.join(words)} did not start: {printed}")

    @property
    def pid(self) -> int:
        """Its process."""
        return self.process.pid

    @property
    def runs(self) -> bool:
        """Whether it has not ended."""
        return self.process.poll() is None

    @property
    def printed(self) -> str:
        """What it has printed, errors too."""
        return self._output.read_text(errors="replace")

    def interrupt(self) -> int | None:
        """Ask it to end, and return how it did: its exit code, or nothing where it does not end."""
        self.process.send_signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            return self.process.wait(LIMIT_S / 3)
        return None

    def end(self) -> None:
        """End it, whatever it does."""
        if self.runs:
            self.interrupt()
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)
        self.process.wait()
        if self.process.stdin is not None:
            self.process.stdin.close()
        self._folder.cleanup()


class RobotProxy:
    """Takes the place of a robot: has each connection carried to one behind, until it is closed."""

    def __init__(self, robot: tuple[str, int]) -> None:
        self._robot = robot
        self._listener = listening()
        self.port = int(self._listener.getsockname()[1])
        self._is_over = threading.Event()
        threading.Thread(target=self._serve, daemon=True).start()

    def close(self) -> None:
        """Let go of both sides."""
        self._is_over.set()
        self._listener.close()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while not self._is_over.is_set():
                client = self._listener.accept()[0]
                with client, contextlib.suppress(OSError), socket.create_connection(self._robot) as robot:
                    self._carry(client, robot)

    def _carry(self, client: socket.socket, robot: socket.socket) -> None:
        """Carry one connection until it ends."""
        raise NotImplementedError


class NotedLine(RobotProxy):
    """A line between a verb and a robot, on which every command is noted with its time (seconds, monotonic)."""

    def __init__(self, robot: tuple[str, int]) -> None:
        self.commands: list[tuple[float, bytes]] = []
        super().__init__(robot)

    def first(self, number: int, after: float) -> float | None:
        """Return when a command first passed after a moment."""
        return next((at for at, each in tuple(self.commands) if each[0] == number and at > after), None)

    def moving(self, after: float = 0.0) -> int:
        """Return how many commands passed since that ask for motion."""
        return sum(at > after and packets.moves(each) for at, each in tuple(self.commands))

    def _carry(self, client: socket.socket, robot: socket.socket) -> None:
        reader, other = packets.OutsidersReader(), {client: robot, robot: client}
        for each in other:
            each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        while not self._is_over.is_set():
            for each in select.select(list(other), [], [], 0.5)[0]:
                data = each.recv(65536)
                if not data:
                    return
                if each is client:
                    now = time.monotonic()
                    self.commands += [(now, payload) for payload in reader.take(data)]
                other[each].sendall(data)


class SteadyClient:
    """Client 0: has a session, keeps it, and looks at what its robot's wheels do."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection((HOST, port), LIMIT_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._is_over = threading.Event()
        self.motions: list[tuple[float, packets.WheelReport]] = []
        self.is_lost = False
        self._thread = threading.Thread(target=self._keep, daemon=True)
        self._thread.start()
        if not until(lambda: len(self.motions) > 1 or self.is_lost, LIMIT_S / 3) or self.is_lost:
            self.close()
            raise RuntimeError("a client of good will gets no session")

    def say(self, number: int, argument: int | None = None) -> float:
        """Send a command, and return when that was."""
        now = time.monotonic()
        self._socket.sendall(packets.command(number, argument))
        return now

    def longest_gap_s(self, since: float) -> float:
        """Return the longest time without an information packet since a moment."""
        times = [since, *(at for at, _ in tuple(self.motions) if at > since), time.monotonic()]
        return max(after - before for before, after in pairwise(times))

    def turned(self, since: float) -> bool:
        """Tell whether a wheel turned, or odometry changed, since a moment."""
        seen = [motion for at, motion in tuple(self.motions) if at > since]
        return any(each.turns for each in seen) or len({(each.x, each.y, each.heading) for each in seen}) > 1

    def close(self) -> None:
        """End the session."""
        with contextlib.suppress(OSError):
            self.say(packets.CLOSE)
        self._is_over.set()
        self._thread.join()
        self._socket.close()

    def _keep(self) -> None:
        try:
            self._open()
            reader, pulsed = packets.OutsidersReader(), 0.0
            while not self._is_over.is_set():
                if time.monotonic() - pulsed > 0.3:
                    pulsed = self.say(packets.PULSE)
                if not select.select([self._socket], [], [], 0.05)[0]:
                    continue
                data = self._socket.recv(65536)
                if not data:
                    raise ConnectionResetError
                now = time.monotonic()
                self.motions += [(now, found) for each in reader.take(data) if (found := packets.motion_of(each))]
        except OSError:
            self.is_lost = not self._is_over.is_set()

    def _open(self) -> None:
        reader, ends = packets.OutsidersReader(), time.monotonic() + LIMIT_S / 3
        for number in packets.SYNC:
            is_answered = False
            while not is_answered:
                self.say(number)
                if select.select([self._socket], [], [], 0.5)[0]:
                    data = self._socket.recv(65536)
                    if not data:
                        raise ConnectionResetError
                    is_answered = any(each[0] == number for each in reader.take(data))
                if time.monotonic() > ends:
                    raise TimeoutError
        for words in ((packets.OPEN,), (packets.ENABLE, 1)):
            self.say(*words)


class BackgroundWatch:
    """Looks again and again, in a thread of its own, as long as its block lasts."""

    #: Between two looks.
    EVERY_S = 0.0

    def __init__(self) -> None:
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        while True:
            self._look()
            if self._is_over.wait(self.EVERY_S):
                return

    def _look(self) -> None:
        raise NotImplementedError


class Lateness(BackgroundWatch):
    """How late a thread of this machine wakes at most, meanwhile: what nobody can be blamed for."""

    def __init__(self) -> None:
        super().__init__()
        self.worst_s = 0.0

    def _look(self) -> None:
        slept = time.monotonic()
        time.sleep(0.001)
        self.worst_s = max(self.worst_s, time.monotonic() - slept - 0.001)


class KernelWatch(BackgroundWatch):
    """Which sockets of a program other machines reach at any moment, and the most memory it has, meanwhile."""

    EVERY_S = 0.2

    def __init__(self, pid: int) -> None:
        super().__init__()
        self._pid = pid
        self.reached: set[str] = set()
        self._before_kb = self._most_kb = kernel.memory_kb(pid)

    @property
    def grown_kb(self) -> int:
        """How much more memory it had than at first, kB."""
        return self._most_kb - self._before_kb

    def _look(self) -> None:
        with contextlib.suppress(OSError):
            self.reached.update(map(str, kernel.off_loopback(self._pid)))
            self._most_kb = max(self._most_kb, kernel.memory_kb(self._pid))
