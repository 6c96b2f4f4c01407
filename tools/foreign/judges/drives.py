"""A client that drives a robot of `p2os serve`, and is treated badly.

It starts and drives; a second client comes beside it; it is killed by SIGKILL while the wheels turn. The robot has to
stand by its watchdog (the line hides who comes and goes, as a serial cable does), the next client has to get in, and
the client itself, started again, has to drive again. One that does not move has to open a session and to show what it
is there for.
"""

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from p2os import Robot
from p2os.errors import P2osError
from p2os.transport import TcpUrl, listen_url, parse_url
from tools.foreign.isolation import nothing_left
from tools.foreign.row import RowError, RowPlace
from tools.surveys.measure_stops import Cable

#: How long a client may take to open a session and to set the wheels in motion (player needs 1.4 s, ROS a master).
STARTING_S = 30.0
#: The watchdog, the ramp, and what the status and a busy machine add.
STANDING_S = 6.0
#: Wheels slower than this stand, m/s.
STANDING_MPS = 0.002
#: `serve` says so often how fast the wheels turn.
STATUS = "100ms"
WHEELS = re.compile(r"wheels (-?[\d.]+) (-?[\d.]+) m/s")
#: chosen: a master has to be there before its nodes, seconds.
_BETWEEN_S = 2.0


@dataclass(frozen=True, kw_only=True)
class Drives:
    """Lets a client drive.

    Args:
        program: What has to be there: a file of the cache, or a program on PATH.
        commands: What is started, one behind the other. {host}, {port}, {url} and {line} (a terminal) are the robot's;
            {program} is `program`, {free} a TCP port that is free, {cache} and {scratch} are folders.
        killed: Which of them talks to the robot.
        serve: Options with which it expects the robot.
        moves: Whether it drives by itself; of one that does not, an open session is awaited.
        shows: What it prints when what it is there for works, a regular expression; empty for what prints nothing.
        files: Written into the scratch folder before: name and text.
        flash: What is set in the robot's FLASH parameters, as TOML.
        environment: Variables.
    """

    program: str
    commands: tuple[tuple[str, ...], ...]
    killed: int = 0
    serve: tuple[str, ...] = ()
    moves: bool = True
    shows: str = ""
    files: tuple[tuple[str, str], ...] = ()
    flash: str = ""
    environment: tuple[tuple[str, str], ...] = ()

    @property
    def needs(self) -> tuple[str, ...]:
        """The client."""
        return (self.program,)

    @property
    def has_terminal(self) -> bool:
        """Tell whether it opens a terminal and no TCP port."""
        return any("{line}" in word for words in (*self.commands, *self.files) for word in words)

    def run(self, place: RowPlace) -> str:
        """Return how it went, step by step."""
        served = Served(self, place.scratch)
        try:
            return "; ".join(self._through(served, place))
        finally:
            served.close()

    def _through(self, served: "Served", place: RowPlace) -> Iterator[str]:
        """Take it through everything; each step is reported."""
        never = "never drove" if self.moves else "never opened a session"
        began = time.monotonic()
        with self._started(served, place) as processes:
            client = processes[self.killed]
            _wait(lambda: served.is_used, STARTING_S, never, client)
            yield f"{'drives' if self.moves else 'is in'} after {time.monotonic() - began:.1f} s{served.shown}"
            yield from _second_client(served)
            _wait(lambda: served.is_used, STARTING_S, "stopped for a second client", client)
            at = time.monotonic()
            client.send_signal(signal.SIGKILL)
            for other in processes:  # what feeds it must not start it again
                other.kill()
            if self.moves:
                _wait(lambda: served.stood_at(at + 0.2) is not None, STANDING_S, "did not stand after SIGKILL")
                if not served.has_said("watchdog expired", at):
                    raise RowError("stood, but not by its watchdog")
                yield f"stands {(served.stood_at(at + 0.2) or at) - at:.1f} s after SIGKILL"
        yield f"next client in {_next_client(served):.1f} s"
        if served.is_turning:
            raise RowError("turned again when the next client came")
        _wait(lambda: not served.is_used, STARTING_S, "the next client did not leave")
        began = time.monotonic()
        with self._started(served, place) as processes:
            _wait(lambda: served.is_used, STARTING_S, "did not do so again", processes[self.killed])
            yield f"again after {time.monotonic() - began:.1f} s"

    @contextlib.contextmanager
    def _started(self, served: "Served", place: RowPlace) -> Iterator[list[subprocess.Popen[bytes]]]:
        """Start the client's programs, and kill what is left of them in the end."""
        parsed = parse_url(served.line_url)
        values = {"url": served.line_url, "line": str(place.scratch / "line")}
        values["free"] = str(free_port())
        values["program"] = str(place.path(self.program)) if "/" in self.program else self.program
        if isinstance(parsed, TcpUrl):
            values |= {"host": parsed.host, "port": str(parsed.port)}
        for name, text in self.files:
            (place.scratch / name).write_text(place.filled(text, **values))
        environment = {**os.environ, **{name: place.filled(text, **values) for name, text in self.environment}}
        processes: list[subprocess.Popen[bytes]] = []
        with nothing_left(), (place.scratch / "output").open("wb") as output:
            for words in self.commands:
                processes.append(
                    subprocess.Popen(
                        [place.filled(word, **values) for word in words], stdin=subprocess.DEVNULL, stdout=output,
                        stderr=subprocess.STDOUT, start_new_session=True, cwd=place.scratch, env=environment,
                    )
                )  # fmt: skip
                if len(self.commands) > 1:
                    time.sleep(_BETWEEN_S)
            yield processes


class Served:
    """A robot of its own for one client, its line, and what `serve` says of it."""

    def __init__(self, client: Drives, folder: Path) -> None:
        port = f"pty:{folder / 'line'}" if client.has_terminal else "tcp:127.0.0.1:0"
        words = ["serve", "--port", port, "--body", "kinematic", "--json", "--status", STATUS, *client.serve]
        if client.flash:
            (folder / "flash.toml").write_text(client.flash)
            words += ["--flash", str(folder / "flash.toml")]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "p2os", *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self._moves, self._shows = client.moves, client.shows
        self._output = folder / "output"
        self._is_open = False
        #: (seconds, line) of what it says; (seconds, m/s) of the faster wheel.
        self.said: list[tuple[float, str]] = []
        self.speeds: list[tuple[float, float]] = [(0.0, 0.0)]
        streams = [stream for stream in (self.process.stdout, self.process.stderr) if stream is not None]
        first = streams[0].readline()
        if not first:
            raise RowError(f"p2os serve did not start: {self.process.communicate()[1].strip()}")
        self.url = json.loads(first)["url"]
        for stream in streams:
            threading.Thread(target=self._hear, args=(stream,), daemon=True).start()
        self._held = os.open(folder / "line", os.O_RDWR | os.O_NOCTTY) if client.has_terminal else None
        self.cable = None if client.has_terminal else Cable(self.url)
        self.line_url = self.url if self.cable is None else self.cable.url

    def _hear(self, stream: Iterator[str]) -> None:
        for line in stream:
            now = time.monotonic()
            if (found := WHEELS.search(line)) is not None:
                self.speeds.append((now, max(abs(float(found[1])), abs(float(found[2])))))
                self._is_open = " s: open," in line
            else:
                self.said.append((now, line.strip()))

    def has_said(self, what: str, since: float) -> bool:
        """Tell whether it has reported something."""
        return any(what in line for at, line in self.said if at >= since)

    def stood_at(self, since: float) -> float | None:
        """Return when the wheels first stood after a time; None while they turn."""
        return next((at for at, speed in self.speeds if at >= since and speed <= STANDING_MPS), None)

    @property
    def is_turning(self) -> bool:
        """Tell whether a wheel turned when it was asked last."""
        return self.speeds[-1][1] > 10 * STANDING_MPS

    @property
    def is_used(self) -> bool:
        """Tell whether the client does what is awaited of it."""
        is_used = self.is_turning if self._moves else self._is_open
        return is_used and (not self._shows or bool(self.shown))

    @property
    def shown(self) -> str:
        """What the client has printed that shows that its device answers, with a comma before it."""
        found = re.search(self._shows, self._output.read_text(errors="replace")) if self._shows else None
        return f", {' '.join(found[0].split())!r}" if found else ""

    def close(self) -> None:
        """End it."""
        if self.cable is not None:
            self.cable.close()
        if self._held is not None:
            os.close(self._held)
        self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()


def _second_client(served: Served) -> Iterator[str]:
    """Come beside the client; a TCP client is sent that the robot is busy."""
    parsed = parse_url(served.url)
    if not isinstance(parsed, TcpUrl):
        return
    with socket.create_connection((parsed.host, parsed.port), 5) as line:
        line.settimeout(5)
        answer = line.recv(200)
    if not answer.startswith(b"busy"):
        raise RowError(f"a second client was sent {answer[:40]!r}")
    yield "a second is told busy"


def free_port() -> int:
    """Return a TCP port of this machine that nobody has at the moment."""
    listener = listen_url("tcp:127.0.0.1:0")
    parsed = parse_url(listener.description)
    listener.close()
    return parsed.port if isinstance(parsed, TcpUrl) else 0


def _next_client(served: Served) -> float:
    """Come as the next client, drive nothing, leave; return how soon it was in, seconds."""
    began = time.monotonic()
    try:
        with Robot(served.line_url) as robot:
            if robot.state.is_moving:
                raise RowError("turned when the next client came")
    except P2osError as error:
        raise RowError(f"the next client did not get in: {error}") from error
    return time.monotonic() - began


def _wait(
    until: Callable[[], bool], longest_s: float, what: str, process: subprocess.Popen[bytes] | None = None
) -> None:
    end = time.monotonic() + longest_s
    while not until():
        if process is not None and process.poll() is not None:
            raise RowError(f"{what}: it ended with code {process.returncode}")
        if time.monotonic() > end:
            raise RowError(f"{what} within {longest_s:g} s")
        time.sleep(0.05)
