"""Measure how soon a robot stands, whatever happens to who drives it: `python tools/surveys/measure_stops.py [--help]`.

    for every way of driving (verbs of the command line, both clients, the adapter's program)
      and everything that can happen (signals, pauses, a suspend, faults of the line, blocked output):
        drive a virtual robot at the far end of a line that hides who comes and goes, as a serial cable does;
        let it happen; note when STOP reaches the robot, when its wheels stand, and whether anything moves later.

The suspend is that of a laptop's lid: the driving process stands still, robot and line do not, and
CLOCK_MONOTONIC of that process leaves the time out, as Linux' does; a library loaded into it subtracts it.

A row fails if the wheels turn again by themselves, or if no STOP came though the process and the line could carry one.
Exit codes: 0 every row is as it has to be, 1 one is not, 2 wrong usage.
"""

import argparse
import contextlib
import fcntl
import json
import mmap
import os
import pty
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path

from p2os.errors import TransportError
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.serve.host import Host
from p2os.pioneer.world import load_world
from p2os.protocol.commands import Command, CommandNumber
from p2os.protocol.frames import Decoder, Frame
from p2os.robots.parameters import load_parameters
from p2os.transport import Transport, listen_url, open_url
from p2os.transport.waiting import wait_readable

ROOT = Path(__file__).resolve().parents[2]
#: How long a process is stopped or its machine sleeps: the wheels turn on, or the robot's watchdog has stopped them.
PAUSES_S = (1.0, 3.0)
#: How long a line carries nothing: more than the watchdog.
CUT_S = 3.0
#: Everything has to stand by then: the watchdog, the longest ramp, and what closing may take.
LONGEST_S = 9.0
#: How long the wheels are watched after they stand.
AFTERWARDS_S = 2.0
STARTING_S = 30.0
#: Who drives in real time gives up where the machine does not follow, before the first motion too: measured anew.
NEVER_DROVE, GAVE_UP, TRIES = "it never drove", "it gave up by itself", 4
#: Wheels slower than this stand, m/s.
STANDING_MPS = 0.002

#: Loaded into a process: CLOCK_MONOTONIC leaves out the nanoseconds that stand in a shared file.
SHIM = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <semaphore.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>
static long long slept(void) {
  static volatile long long *shared;
  if (!shared) shared = mmap(0, 8, PROT_READ, MAP_SHARED, open(getenv("SLEPT_NS"), O_RDONLY), 0);
  return *shared;
}
static struct timespec later(const struct timespec *at, long long by) {
  long long ns = at->tv_sec * 1000000000LL + at->tv_nsec + by;
  return (struct timespec){ns / 1000000000LL, ns % 1000000000LL};
}
int clock_gettime(clockid_t id, struct timespec *out) {
  static int (*real)(clockid_t, struct timespec *);
  if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
  int result = real(id, out);
  if (id == CLOCK_MONOTONIC || id == CLOCK_MONOTONIC_RAW || id == CLOCK_MONOTONIC_COARSE) *out = later(out, -slept());
  return result;
}
int sem_clockwait(sem_t *semaphore, clockid_t id, const struct timespec *until) {
  static int (*real)(sem_t *, clockid_t, const struct timespec *);
  if (!real) real = (int (*)(sem_t *, clockid_t, const struct timespec *))dlsym(RTLD_NEXT, "sem_clockwait");
  struct timespec at = id == CLOCK_MONOTONIC ? later(until, slept()) : *until;
  return real(semaphore, id, &at);
}
int clock_nanosleep(clockid_t id, int flags, const struct timespec *span, struct timespec *left) {
  static int (*real)(clockid_t, int, const struct timespec *, struct timespec *);
  if (!real) *(void **)&real = dlsym(RTLD_NEXT, "clock_nanosleep");
  struct timespec at = id == CLOCK_MONOTONIC && (flags & TIMER_ABSTIME) ? later(span, slept()) : *span;
  return real(id, flags, &at, left);
}
"""

CLIENT = """
import sys
from p2os import Robot
with Robot(sys.argv[1]) as robot:
    robot.set_velocity(0.3)
    robot.sleep(60)
"""
ASYNC_CLIENT = """
import asyncio, sys
from p2os.client.aio import Robot
async def main():
    async with Robot(sys.argv[1]) as robot:
        robot.set_velocity(0.3)
        await robot.sleep(60)
asyncio.run(main())
"""
#: `p2os run` as on a machine without Matplotlib: to paint its report would keep a processor from the other rows.
RUN = """
import sys
sys.modules["matplotlib"] = None
from p2os.__main__ import main
main()
"""


class ServedRobot:
    """A virtual Pioneer in a thread, and how its wheels turned."""

    def __init__(self) -> None:
        parameters, world = load_parameters("p2dx"), load_world("office")
        body = make_body("kinematic", world, parameters)
        body.reset(world.start, 0)
        self.pioneer = Pioneer(parameters=parameters, body=body)
        listener = listen_url("tcp:127.0.0.1:0")
        self.url = listener.description
        #: (seconds, the faster wheel in m/s), one each time it has changed.
        self.speeds: list[tuple[float, float]] = [(0.0, 0.0)]
        self._body, self._host = body, Host(self.pioneer, listener)
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        try:
            while not self._is_over.is_set():
                self._host.turn(0.01)
                wheels = self._body.state
                speed = round(max(abs(wheels.left_speed_mps), abs(wheels.right_speed_mps)), 4)
                if speed != self.speeds[-1][1]:
                    self.speeds.append((time.monotonic(), speed))
        finally:
            self._host.close()

    @property
    def is_moving(self) -> bool:
        """Whether a wheel turns."""
        return self.speeds[-1][1] > STANDING_MPS

    def stood_at(self, since: float) -> float | None:
        """Return when the wheels first stood after `since`; None while they have not."""
        if self.speeds[-1][0] < since:
            return None
        return next((at for at, speed in self.speeds if at >= since and speed <= STANDING_MPS), None)

    def close(self) -> None:
        """End it."""
        self._is_over.set()
        self._thread.join(10)


class Cable:
    """A line that hides who comes and goes at its client's end, and can be cut; knows what went to the robot."""

    def __init__(self, robot_url: str) -> None:
        self.robot = open_url(robot_url)
        self._listener = listen_url("tcp:127.0.0.1:0")
        self.url = self._listener.description
        self.is_cut = False
        self.closes = threading.Event()
        #: (seconds, command) of every sound frame that reached the robot.
        self.frames: list[tuple[float, Command]] = []
        self._decoder = Decoder()
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def _carry(self) -> None:
        client: Transport | None = None
        while not self._is_over.is_set():
            ends = [self.robot, *([client] if client else [])]
            wait_readable([end.fileno() for end in ends] + [self._listener.fileno() or 0], 0.01)
            client = self._listener.accept() or client
            if client is not None and self.closes.is_set():
                self.closes.clear()
                client.close()
                client = None
            from_robot = self.robot.read()
            try:
                from_client = client.read() if client else b""
            except TransportError:
                client = None
                continue
            if not self.is_cut and from_client:
                self._hear(from_client)
                self.robot.write(from_client)
            if client and not self.is_cut:
                with contextlib.suppress(TransportError):  # to read from it ends with the same
                    client.write(from_robot)

    def _hear(self, data: bytes) -> None:
        self._decoder.receive(data, 0)
        while (item := self._decoder.next_item()) is not None:
            if isinstance(item, Frame):
                self.frames.append((time.monotonic(), Command.from_frame(item)))

    def since(self, at: float) -> list[tuple[float, Command]]:
        """Return the frames from `at` on."""
        return [(when, command) for when, command in self.frames if when >= at]

    def close(self) -> None:
        """End it."""
        self._is_over.set()
        self._thread.join(10)
        self.robot.close()
        self._listener.close()


@dataclass
class DrivingProgram:
    """A process that drives, and what it needs to go on."""

    process: subprocess.Popen[bytes]
    slept: mmap.mmap
    is_held: threading.Event = field(default_factory=threading.Event)
    ends: list[int] = field(default_factory=list)
    #: Processes beside it that belong to it.
    others: list[subprocess.Popen[bytes]] = field(default_factory=list)


@dataclass(frozen=True)
class Way:
    """One way of driving a robot: its command line with the robot's URL in place of {url}."""

    name: str
    words: tuple[str, ...]
    #: It wants a terminal on which a key is held.
    has_keys: bool = False
    #: A client to which {url} is not the robot's, but where this one listens.
    client: tuple[str, ...] = ()
    has_wires: bool = False


P2OS = (sys.executable, "-m", "p2os")
DRIVE = (*P2OS, "drive")
WAYS = (
    Way("Robot", (sys.executable, "-c", CLIENT, "{url}")),
    Way("asyncio Robot", (sys.executable, "-c", ASYNC_CLIENT, "{url}")),
    Way("drive --vel", (*DRIVE, "{url}", "--vel", "0.3m/s", "--for", "60s")),
    Way("drive --forward", (*DRIVE, "{url}", "--forward", "6m", "--vel", "0.3m/s")),
    Way("teleop", (*P2OS, "teleop", "{url}"), has_keys=True),
    Way("replay", (*P2OS, "replay", "{recording}", "{url}", "--as", "client", "--yes")),
    Way("sniff", (*P2OS, "sniff", "{url}", "--listen", "{listen}"),
        client=(*DRIVE, "{listen}", "--vel", "0.3m/s", "--for", "60s")),
    Way("run --port", (sys.executable, "-c", RUN, "run", "motors", "--port", "{url}", "--yes", "--duration", "60s",
                       "--out", "{folder}")),
    Way("p2os-adapter", ("{adapter}", "--line", "{url}", "--wires", "{wires}"), has_wires=True),
)  # fmt: skip


def paused(span_s: float, *, by_suspend: bool) -> Callable[[DrivingProgram, Cable], float]:
    """Return what stops the process for so long, or lets its machine sleep; counted from when it goes on."""

    def pause(driver: DrivingProgram, _: Cable) -> float:
        driver.process.send_signal(signal.SIGSTOP)
        time.sleep(span_s)
        if by_suspend:
            driver.slept[:8] = struct.pack("q", round(span_s * 1e9))
        at = time.monotonic()  # before it goes on: it may say STOP before this process runs again
        driver.process.send_signal(signal.SIGCONT)
        return at

    return pause


def twice(driver: DrivingProgram, _: Cable) -> float:
    """Ctrl-C by somebody who is in a hurry."""
    at = time.monotonic()
    for _round in range(20):
        with contextlib.suppress(ProcessLookupError):
            driver.process.send_signal(signal.SIGINT)
        time.sleep(0.002)
    return at


def cut(_: DrivingProgram, cable: Cable) -> float:
    """Nothing passes for the pause, and nobody is told; counted from when it carries again."""
    cable.is_cut = True
    time.sleep(CUT_S)
    at = time.monotonic()
    cable.is_cut = False
    return at


def closed(_: DrivingProgram, cable: Cable) -> float:
    """The client's end is closed under it."""
    at = time.monotonic()
    cable.closes.set()
    return at


def released(driver: DrivingProgram, _: Cable) -> float:
    """The key is let go, or with no keys: nothing."""
    at = time.monotonic()
    driver.is_held.clear()
    return at


def sent(number: signal.Signals) -> Callable[[DrivingProgram, Cable], float]:
    """Return what sends a signal."""

    def send(driver: DrivingProgram, _: Cable) -> float:
        at = time.monotonic()
        driver.process.send_signal(number)
        return at

    return send


@dataclass(frozen=True)
class Happening:
    """Something that can happen: does it, and returns from when on STOP is counted."""

    name: str
    do: Callable[[DrivingProgram, Cable], float]
    #: The process can say nothing, the line carries nothing and the robot's watchdog stops it, or zero speeds do.
    without_stop: bool = False
    #: The wheels may stand before it is over; STOP has to be the first frame afterwards, if any comes.
    is_pause: bool = False
    has_blocked_output: bool = False
    #: Who holds a key lets it go with it: the next repetition would be asking anew.
    lets_key_go: bool = False
    only: tuple[str, ...] = ()
    #: Ways to which it does not apply: Ctrl-Z suspends a program of one's own, which SIGSTOP stands for.
    but_not: tuple[str, ...] = ()


SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGUSR1")
HAPPENINGS = (
    *(Happening(name, sent(signal.Signals[name])) for name in SIGNALS),
    Happening("SIGTSTP", sent(signal.SIGTSTP), but_not=("Robot", "asyncio Robot")),
    Happening("SIGINT x 20", twice),
    Happening("SIGKILL", sent(signal.SIGKILL), without_stop=True),
    *(
        Happening(f"{name} {span_s:g} s", paused(span_s, by_suspend=name == "suspend"), is_pause=True, lets_key_go=True)
        for name in ("SIGSTOP", "suspend")
        for span_s in PAUSES_S
    ),
    Happening("line cut 3 s", cut, is_pause=True, lets_key_go=True),
    Happening("line closed", closed, without_stop=True, lets_key_go=True),
    Happening("output blocked, SIGINT", sent(signal.SIGINT), has_blocked_output=True),
    Happening("output blocked, key let go", released, has_blocked_output=True, without_stop=True, only=("teleop",)),
    Happening("key let go", released, without_stop=True, only=("teleop",)),
)


@dataclass
class StopRow:
    """What came of it; milliseconds from the event, or from the end of a pause."""

    way: str
    event: str
    stop_ms: int | None = None
    stands_ms: int | None = None
    exit_code: int | None = None
    first: str = ""
    moves_again: bool = False
    problem: str = ""


def measure(way: Way, event: Happening, tools: "Tools") -> StopRow:
    """Drive, let it happen, and look; where a busy machine ended the driver before the event, anew."""
    for _ in range(TRIES):
        row = measure_once(way, event, tools)
        if not row.problem.startswith(GAVE_UP):
            break
    return row


def measure_once(way: Way, event: Happening, tools: "Tools") -> StopRow:
    """Drive, let it happen, and look."""
    row = StopRow(way.name, event.name)
    robot = ServedRobot()
    cable = Cable(robot.url)
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        stack.callback(robot.close)
        stack.callback(cable.close)
        driver = start(way, cable.url, Path(folder), tools, blocked=event.has_blocked_output, stack=stack)
        until(lambda: drives(robot) or has_given_up(cable, driver), STARTING_S)
        if not drives(robot):
            problem = GAVE_UP if has_given_up(cable, driver) else NEVER_DROVE
            row.exit_code = driver.process.poll()
            row.problem = f"{problem} (exit code {row.exit_code})"
            return row
        time.sleep(0.7)
        if event.lets_key_go:
            driver.is_held.clear()
        began, gave_up = time.monotonic(), has_given_up(cable, driver)
        at = event.do(driver, cable)
        until(lambda: not robot.is_moving and bool(stops(cable, at) or driver.process.poll() is not None), LONGEST_S)
        until(lambda: not robot.is_moving, LONGEST_S)
        stood = robot.stood_at(began)
        time.sleep(AFTERWARDS_S)
        row.exit_code = driver.process.poll()
        row.moves_again = stood is None or robot.is_moving or any(
            speed > STANDING_MPS for when, speed in robot.speeds if when > stood
        )  # fmt: skip
        row.stands_ms = None if stood is None else round((stood - at) * 1000)
        if found := stops(cable, at):
            row.stop_ms = round((found[0] - at) * 1000)
        after = cable.since(at)
        row.first = after[0][1].name if after else ""
        if gave_up and not robot.is_moving:
            row.problem = f"{GAVE_UP} (exit code {row.exit_code})"
            return row
    row.problem = fault(row, event)
    return row


def drives(robot: ServedRobot) -> bool:
    """Tell whether the robot drives as fast as every way lets it."""
    return robot.speeds[-1][1] > 0.15


def has_given_up(cable: Cable, driver: DrivingProgram) -> bool:
    """Tell whether the driver has ended, or has sent STOP after a speed: every way drives by VEL."""
    commands = [command for _, command in cable.since(0.0)]
    speeds = [n for n, command in enumerate(commands) if command.number == CommandNumber.VEL and command.integer]
    is_stopped = any(command.number == CommandNumber.STOP for command in commands[min(speeds, default=len(commands)) :])
    return is_stopped or driver.process.poll() is not None


def stops(cable: Cable, at: float) -> list[float]:
    """Return when STOP reached the robot."""
    return [when for when, command in cable.since(at) if command.number == CommandNumber.STOP]


def fault(row: StopRow, event: Happening) -> str:
    """Return what is wrong with a row, or nothing."""
    if row.stands_ms is None:
        return "it never stands"
    if row.moves_again:
        return "it moves again"
    if event.is_pause and row.first not in {"", "STOP"}:
        return f"{row.first} is the first frame after the pause"
    if row.stop_ms is None and not event.without_stop and not (event.is_pause and not row.first):
        return "no STOP"
    return ""


def until(is_so: Callable[[], bool], seconds: float) -> bool:
    """Wait until something is so; tell whether it came to be."""
    ends = time.monotonic() + seconds
    while not is_so():
        if time.monotonic() > ends:
            return False
        time.sleep(0.005)
    return True


@dataclass(frozen=True)
class Tools:
    """What is built once for all rows."""

    shim: Path
    adapter: Path | None


def start(
    way: Way, url: str, folder: Path, tools: Tools, *, blocked: bool, stack: contextlib.ExitStack
) -> DrivingProgram:
    """Start a way of driving; `stack` ends it."""
    slept_path = folder / "slept"
    slept_path.write_bytes(bytes(mmap.PAGESIZE))
    slept_file = stack.enter_context(slept_path.open("r+b"))
    slept = mmap.mmap(slept_file.fileno(), mmap.PAGESIZE)
    listen = f"tcp:127.0.0.1:{free_port()}"
    words = {
        "{listen}": listen, "{url}": url, "{folder}": str(folder / "run"), "{wires}": str(folder / "wires"),
        "{adapter}": str(tools.adapter), "{recording}": str(folder / "talk.jsonl"),
    }  # fmt: skip
    (folder / "talk.jsonl").write_text(recording(), encoding="utf-8")

    def filled(parts: tuple[str, ...]) -> list[str]:
        return [words.get(part, part) for part in parts]

    environment = os.environ | {
        "LD_PRELOAD": str(tools.shim),
        "SLEPT_NS": str(slept_path),
        "ASAN_OPTIONS": "verify_asan_link_order=0",
        "PYTHONPATH": str(ROOT),
    }
    output: int = full_pipe(stack) if blocked else subprocess.DEVNULL
    keys = -1
    if way.has_keys:
        keys, terminal = pty.openpty()
        stack.callback(os.close, keys)
        fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    process = subprocess.Popen(
        filled(way.words), cwd=folder, env=environment, start_new_session=True,
        stdin=terminal if way.has_keys else subprocess.PIPE,
        stdout=output, stderr=terminal if way.has_keys else output,
    )  # fmt: skip
    driver = DrivingProgram(process, slept)
    stack.callback(end, driver)
    driver.is_held.set()
    if way.has_keys:
        os.close(terminal)
        begin(hold_key, keys, driver, blocked, stack=stack)
    if way.has_wires:
        begin(drive_wires, folder / "wires", stack=stack)
    if way.client:
        until(lambda: answers(listen), STARTING_S)
        driver.others.append(
            subprocess.Popen(filled(way.client), env=os.environ | {"PYTHONPATH": str(ROOT)},
                             stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        )  # fmt: skip
    return driver


def end(driver: DrivingProgram) -> None:
    """End what was started."""
    driver.is_held.clear()
    for process in (*driver.others, driver.process):
        process.kill()
        process.wait()


def begin(work: Callable[..., None], *arguments: object, stack: contextlib.ExitStack) -> None:
    """Work in the background until the row is over."""
    is_over = threading.Event()
    thread = threading.Thread(target=work, args=(*arguments, is_over), daemon=True)
    thread.start()
    stack.callback(thread.join, 5)
    stack.callback(is_over.set)


def hold_key(keys: int, driver: DrivingProgram, is_blocked: bool, is_over: threading.Event) -> None:
    """Hold `w` as a keyboard does, and read what the terminal shows unless it is held with Ctrl-S."""
    os.set_blocking(keys, False)
    while not is_over.wait(0.03):
        with contextlib.suppress(OSError):
            if driver.is_held.is_set():
                os.write(keys, b"w")
            if not is_blocked:
                os.read(keys, 65536)


def drive_wires(path: Path, is_over: threading.Event) -> None:
    """Be the BluePill of `p2os-adapter`: connect, and both motors ahead."""
    if not until(path.exists, STARTING_S):
        return
    with socket.socket(socket.AF_UNIX) as wires:
        wires.connect(str(path))
        wires.setblocking(False)
        ahead = 3 | 3 << 3 | 1 << 6
        with contextlib.suppress(OSError):
            wires.sendall(b"in 0\n")
        while not is_over.wait(0.1):
            with contextlib.suppress(OSError):
                wires.sendall(f"in {ahead:x}\n".encode())
            with contextlib.suppress(OSError):
                wires.recv(65536)


def full_pipe(stack: contextlib.ExitStack) -> int:
    """Return the end of a pipe that takes nothing more, and that nobody reads."""
    reading, writing = os.pipe()
    stack.callback(os.close, reading)
    stack.callback(os.close, writing)
    os.set_blocking(writing, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(writing, b"." * 4096)
    os.set_blocking(writing, True)
    return writing


def free_port() -> int:
    """Return a port that was free just now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def answers(url: str) -> bool:
    """Tell whether somebody listens, by the system's table: a connection would be the one client."""
    port = int(url.rpartition(":")[2])
    return f":{port:04X} 00000000:0000 0A" in Path("/proc/net/tcp").read_text(encoding="ascii")


def recording() -> str:
    """Return what a client said that drove for a minute."""
    numbers = CommandNumber
    said = [(0.0, Command(numbers.PULSE)), (0.1, Command(numbers.OPEN)), (0.2, Command(numbers.CLOSE)),
            (0.3, Command(numbers.OPEN)), (0.4, Command(numbers.ENABLE, 1))]  # fmt: skip
    said += [(0.5 + 0.2 * step, Command(numbers.VEL, 300)) for step in range(300)]
    return "".join(
        json.dumps({"t": at, "dir": "c2s", "hex": command.to_frame().to_bytes().hex()}) + "\n" for at, command in said
    )


@contextlib.contextmanager
def built(ways: tuple[Way, ...]) -> Iterator[Tools]:
    """Build the shim, and the adapter's program where a row wants it."""
    with tempfile.TemporaryDirectory() as folder:
        source, shim, adapter = Path(folder, "slept.c"), Path(folder, "slept.so"), None
        source.write_text(SHIM, encoding="utf-8")
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", str(shim), str(source), "-ldl"], check=True)
        if any(way.has_wires for way in ways):
            subprocess.run(
                [sys.executable, "adapter_fw/build.py", "program", "--out", folder],
                check=True, cwd=ROOT, stdout=subprocess.DEVNULL,
            )  # fmt: skip
            adapter = next(Path(folder).glob("p2os-adapter*"))
        yield Tools(shim, adapter)


def main() -> int:
    """Measure the rows that are asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--way", action="append", choices=[way.name for way in WAYS], help="one of the ways; all")
    parser.add_argument("--event", action="append", choices=[event.name for event in HAPPENINGS], help="likewise")
    parser.add_argument("--jobs", type=int, default=3, help="rows at a time")
    parser.add_argument("--json", action="store_true", help="print one JSON object a row")
    options = parser.parse_args()
    ways = tuple(way for way in WAYS if not options.way or way.name in options.way)
    wanted = [
        (way, event) for way in ways for event in HAPPENINGS
        if (not options.event or event.name in options.event) and (not event.only or way.name in event.only)
        and way.name not in event.but_not
    ]  # fmt: skip
    is_bad = False
    if not options.json:
        print("| way | event | STOP after | wheels stand after | exit | moves again |\n|---|---|---|---|---|---|")
    with built(ways) as tools, ThreadPoolExecutor(options.jobs) as pool:
        for row in pool.map(lambda pair: measure(pair[0], pair[1], tools), wanted):
            is_bad |= bool(row.problem)
            print(json.dumps(asdict(row)) if options.json else line_of(row), flush=True)
    return int(is_bad)


def line_of(row: StopRow) -> str:
    """Return a row of the table."""

    def ms(value: int | None) -> str:
        return "-" if value is None else f"{value} ms"

    again = "YES" if row.moves_again else "no"
    note = f" **{row.problem}**" if row.problem else ""
    exit_code = "-" if row.exit_code is None else row.exit_code
    return f"| {row.way} | {row.event} | {ms(row.stop_ms)} | {ms(row.stands_ms)} | {exit_code} | {again}{note} |"


if __name__ == "__main__":
    sys.exit(main())
