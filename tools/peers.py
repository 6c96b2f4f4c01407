"""Drive `p2os serve` with the programs of others, and treat them badly: `python -m tools.peers [--help]`.

    for every peer that is on PATH, or that --peer names:
      start it, let it drive the robot, bring a second client beside it, kill it by SIGKILL while the wheels turn;
      the robot has to stand by its watchdog (the line hides who comes and goes, as a serial cable does),
      the next client has to get in, and the peer itself, started again, has to drive again.

A peer is a row of `PEERS`; what is not there is skipped aloud. Each has a robot of its own, on a free port of this
machine. A row of --peer: NAME=COMMAND, in which {host}, {port}, {url}, {line} (a terminal) and {folder} stand for
what they say; NAME alone is a name of the table. --robot MODEL (or all) lets every peer meet that model.

Exit codes: 0 every peer that is there passed, 1 one did not, 2 wrong usage.
"""

import argparse
import contextlib
import ctypes
import json
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import textwrap
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from p2os import Robot
from p2os.errors import P2osError
from p2os.robots.parameters import known_robots
from p2os.transport import TcpUrl, parse_url
from tools.surveys.measure_stops import Cable

#: How long a peer may take to open a session and to set the wheels in motion (player needs 1.4 s, ROS a master).
STARTING_S = 30.0
#: The watchdog, the ramp, and what the status and a busy machine add.
STANDING_S = 6.0
#: Wheels slower than this stand, m/s.
STANDING_MPS = 0.002
#: `serve` says so often how fast the wheels turn.
STATUS = "100ms"
WHEELS = re.compile(r"wheels (-?[\d.]+) (-?[\d.]+) m/s")

#: Soar's own windows aside, which alone let a brain meet a real robot: its robot, told what a brain would tell it.
SOAR_MOVER = """import time
from soar.robot.pioneer import PioneerRobot
robot = PioneerRobot(serial_ports=["{line}"])
robot.simulated = False
robot.on_load()
robot.on_start()
while True:
    robot.fv = 0.2
    robot.on_step(0.1)
    time.sleep(0.1)
"""
#: player's own configuration; without a pulse its driver is silent between two speeds.
PLAYER = """driver (
  name "p2os" provides ["odometry:::position2d:0"]
  use_tcp 1 tcp_remote_host "{host}" tcp_remote_port {port} pulse 1.0
)
"""
#: Through player's library in C, which stands beside every player; its bindings for Python do not.
PLAYER_MOVER = """import ctypes, time
c = ctypes.CDLL("libplayerc.so")
for create in c.playerc_client_create, c.playerc_position2d_create:
    create.restype = ctypes.c_void_p
client = ctypes.c_void_p(c.playerc_client_create(None, b"127.0.0.1", 6665))
assert c.playerc_client_connect(client) == 0
base = ctypes.c_void_p(c.playerc_position2d_create(client, 0))
assert c.playerc_position2d_subscribe(base, 1) == 0
c.playerc_position2d_enable(base, 1)
while True:
    c.playerc_position2d_set_cmd_vel(base, *map(ctypes.c_double, (0.2, 0.0, 0.0)), 1)
    time.sleep(0.2)
"""


@dataclass(frozen=True, kw_only=True)
class PeerProgram:
    """A program that drives a robot.

    Args:
        name: As users call it.
        needs: Programs that have to be on PATH; the first is the peer itself.
        commands: What is started, one behind the other.
        killed: Which of them talks to the robot.
        serve: Options with which it expects the robot.
        moves: Whether it drives by itself; of one that does not, an open session is awaited.
        shows: What it prints when what it is there for works, a regular expression; empty for what prints nothing.
        files: Written into its folder before: name and text.
        flash: What is set in the robot's FLASH parameters, as TOML.
    """

    name: str
    needs: tuple[str, ...]
    commands: tuple[tuple[str, ...], ...]
    killed: int = 0
    serve: tuple[str, ...] = ()
    moves: bool = True
    shows: str = ""
    files: tuple[tuple[str, str], ...] = ()
    flash: str = ""

    @property
    def has_terminal(self) -> bool:
        """Tell whether it opens a terminal and no TCP port."""
        return any("{line}" in word for words in (*self.commands, *self.files) for word in words)


#: AriaCoda's examples and tests: those that drive by themselves, and those that open a session and look or wait. Left
#: out are those that open a serial port or TCP port 8101 whatever they are told, and those that end by themselves.
ARIA_DRIVES = (
    "simpleMotionCommands", "wander", "actionExample", "gotoActionExample", "wanderAndLogData", "vel2Test",
    "moveCommandTest",
)  # fmt: skip
ARIA_TALKS = (
    "simpleConnect", "demo", "teleopActionsExample", "actionGroupExample", "robotSyncTaskExample", "motionDebugInfo",
    "dataLoggerExample", "customRangeSensorExample", "auxSerialExample", "gripperExample", "lasers",
    "triangleDriveToActionExample", "encoderTest", "sonarTest", "testMobileSim", "connectionTest2",
    "robotPacketHandlerTest", "logSIPs", "logSIPData", "logRobotJoystick", "simstat", "moveRobotInSim", "laserConnect",
    "lineFinderExample", "sickLogger", "ptzTest",
)  # fmt: skip
#: Those that need to be told to use a device, and what shows that it answers.
ARIA_WORDS = {"lasers": ("-connectLaser",), "laserConnect": ("-connectLaser",), "lineFinderExample": ("-connectLaser",)}
ARIA_SHOWS = {
    "lasers": r"Have 181 'raw' readings",
    "laserConnect": r"connected\. Have 181 'current' readings",
    "lineFinderExample": r"Connected to laser",
    "sickLogger": r"Taking readings from the 361 laser values",
    "ptzTest": r"=> At pan -\d",
    "gripperExample": r"Grip: +\w",
    "logRobotJoystick": r"Got a joystick packet",
}


def _aria(program: str) -> PeerProgram:
    words = (program, "-rh", "{host}", "-rrtp", "{port}", *ARIA_WORDS.get(program, ()))
    return PeerProgram(
        name=f"ARIA {program}", needs=(program,), commands=(words,), serve=("--for", "aria"),
        moves=program in ARIA_DRIVES, shows=ARIA_SHOWS.get(program, ""),
        flash="[flash]\ngripper = 2\n" if "gripper" in program else "",
    )  # fmt: skip


PEERS = (
    PeerProgram(
        name="p2os drive", needs=(sys.executable,),
        commands=((sys.executable, "-m", "p2os", "drive", "{url}", "--vel", "0.2m/s", "--for", "60s"),),
    ),
    *map(_aria, (*ARIA_DRIVES, *ARIA_TALKS)),
    PeerProgram(
        name="ROS 1 p2os", needs=("rosrun", "roscore", "rostopic"), killed=1,
        commands=(
            ("roscore",),
            ("rosrun", "p2os_driver", "p2os_driver", "_port:={line}", "_pulse:=1.0"),
            ("rostopic", "pub", "-r", "5", "/cmd_motor_state", "p2os_msgs/MotorState", "{state: 1}"),
            ("rostopic", "pub", "-r", "5", "/cmd_vel", "geometry_msgs/Twist", "{linear: {x: 0.2}}"),
        ),
    ),
    PeerProgram(
        name="player", needs=("player",), files=(("player.cfg", PLAYER),),
        commands=(("player", "{folder}/player.cfg"), (sys.executable, "-c", PLAYER_MOVER)),
    ),
    PeerProgram(
        name="Soar", needs=("soar",), serve=("--firmware", "ARCOS"), files=(("mover.py", SOAR_MOVER),),
        commands=(("{python}", "{folder}/mover.py"),),
    ),
    PeerProgram(name="p2os-arduino", needs=("p2os-arduino",), commands=(("p2os-arduino", "{line}"),)),
)  # fmt: skip


class Served:
    """A robot of its own for one peer, its line, and what `serve` says of it."""

    def __init__(self, peer: PeerProgram, folder: Path) -> None:
        port = f"pty:{folder / 'line'}" if peer.has_terminal else "tcp:127.0.0.1:0"
        words = ["serve", "--port", port, "--body", "kinematic", "--json", "--status", STATUS, *peer.serve]
        if peer.flash:
            (folder / "flash.toml").write_text(peer.flash)
            words += ["--flash", str(folder / "flash.toml")]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "p2os", *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        self._moves, self._shows = peer.moves, peer.shows
        self._output = folder / "output"
        self._is_open = False
        #: (seconds, line) of what it says; (seconds, m/s) of the faster wheel.
        self.said: list[tuple[float, str]] = []
        self.speeds: list[tuple[float, float]] = [(0.0, 0.0)]
        streams = [stream for stream in (self.process.stdout, self.process.stderr) if stream is not None]
        first = streams[0].readline()
        if not first:
            raise SystemExit(f"peers: p2os serve did not start: {self.process.communicate()[1].strip()}")
        self.url = json.loads(first)["url"]
        for stream in streams:
            threading.Thread(target=self._hear, args=(stream,), daemon=True).start()
        self._held = os.open(folder / "line", os.O_RDWR | os.O_NOCTTY) if peer.has_terminal else None
        self.cable = None if peer.has_terminal else Cable(self.url)
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
        """Tell whether the peer does what is awaited of it."""
        is_used = self.is_turning if self._moves else self._is_open
        return is_used and (not self._shows or self._has_shown)

    @property
    def _has_shown(self) -> bool:
        """Tell whether the peer has printed what shows that its device answers."""
        return re.search(self._shows, self._output.read_text(errors="replace")) is not None

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


@dataclass
class PeerRow:
    """What a peer did, for the table; an empty word is not reached."""

    peer: str
    drives: str = ""
    beside: str = ""
    stands: str = ""
    next_client: str = ""
    again: str = ""
    problem: str = ""

    @property
    def is_skipped(self) -> bool:
        """Tell whether the peer is not there."""
        return self.problem.startswith("skipped")


class PeerError(Exception):
    """A step did not come out; the message is the row's."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the peers and print the table; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tools.peers", description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument(
        "--peer", action="append", default=[], metavar="NAME[=COMMAND]",
        help='only these: a name of the table, or "p2os-arduino=/home/me/drive {line}"; again for more',
    )  # fmt: skip
    parser.add_argument(
        "--robot", action="append", default=[], metavar="MODEL", help="against this model, or all; again for more",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print a JSON object a peer")
    chosen = parser.parse_args(arguments)
    peers = [_named(text, parser.error) for text in chosen.peer] or list(PEERS)
    models = list(known_robots()) if "all" in chosen.robot else chosen.robot
    if strange := set(models) - set(known_robots()):
        parser.error(f"no robot {strange.pop()!r}; there are: all, {', '.join(known_robots())}")
    if models:
        peers = [
            replace(peer, name=f"{peer.name}, {model}", serve=(*peer.serve, "--robot", model))
            for peer in peers for model in models
        ]  # fmt: skip
    rows = []
    for peer in peers:
        rows.append(row := measured(peer))
        if chosen.json:
            print(json.dumps(asdict(row)), flush=True)
        else:
            print(f"{row.peer}: {row.problem or 'passed'}", file=sys.stderr, flush=True)
    if not chosen.json:
        # A table of what ran; what is not there by name alone.
        print(table([row for row in rows if not row.is_skipped]))
        if missing := [row.peer for row in rows if row.is_skipped]:
            print(textwrap.fill(f"not on PATH: {', '.join(missing)}", 80))
    return int(any(row.problem and not row.is_skipped for row in rows))


def _named(text: str, refuse: Callable[[str], object]) -> PeerProgram:
    """Return the peer that an option names."""
    name, equals, command = text.partition("=")
    known = next((peer for peer in PEERS if peer.name == name), None)
    if equals:
        words = tuple(shlex.split(command))
        if not words:
            refuse(f"--peer {text}: no command")
        return PeerProgram(name=name, needs=words[:1], commands=(words,), serve=known.serve if known else ())
    if known is None:
        refuse(f"no peer {name!r}; there are: {', '.join(peer.name for peer in PEERS)}; or NAME=COMMAND")
        raise AssertionError
    return known


def table(rows: Sequence[PeerRow]) -> str:
    """Return the rows as a table of 80 columns."""
    head = ("peer", "drives", "2nd client", "stands", "next", "again", "result")
    lines = [head] + [
        (row.peer, row.drives, row.beside, row.stands, row.next_client, row.again, row.problem or "passed")
        for row in rows
    ]
    widths = [max(len(line[column]) for line in lines) for column in range(len(head) - 1)]
    return "\n".join(
        "  ".join([*(cell.ljust(width) for cell, width in zip(line, widths, strict=False)), line[-1]]) for line in lines
    )


def measured(peer: PeerProgram) -> PeerRow:
    """Take one peer through everything; return its row."""
    row = PeerRow(peer.name)
    missing = [program for program in peer.needs if shutil.which(program) is None]
    if missing:
        row.problem = f"skipped: no {', '.join(missing)}"
        return row
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        served = Served(peer, folder)
        try:
            _through(peer, served, folder, row)
        except PeerError as failure:
            row.problem = str(failure)
        finally:
            served.close()
    return row


def _through(peer: PeerProgram, served: Served, folder: Path, row: PeerRow) -> None:
    never = "never drove" if peer.moves else "never opened a session"
    started = time.monotonic()
    with _started(peer, served, folder) as processes:
        _wait(lambda: served.is_used, STARTING_S, never, processes[peer.killed])
        row.drives = f"{time.monotonic() - started:.1f} s"
        row.beside = _second_client(served)
        _wait(lambda: served.is_used, STARTING_S, "stopped for a second client", processes[peer.killed])
        at = time.monotonic()
        processes[peer.killed].send_signal(signal.SIGKILL)
        for other in processes:  # what feeds it must not start it again
            other.kill()
        if peer.moves:
            _wait(lambda: served.stood_at(at + 0.2) is not None, STANDING_S, "did not stand after SIGKILL")
            if not served.has_said("watchdog expired", at):
                raise PeerError("stood, but not by its watchdog")
            row.stands = f"{(served.stood_at(at + 0.2) or at) - at:.1f} s"
    row.next_client = _next_client(served)
    if served.is_turning:
        raise PeerError("turned again when the next client came")
    _wait(lambda: not served.is_used, STARTING_S, "the next client did not leave")
    started = time.monotonic()
    with _started(peer, served, folder) as processes:
        _wait(lambda: served.is_used, STARTING_S, "did not do so again", processes[peer.killed])
        row.again = f"{time.monotonic() - started:.1f} s"


@contextlib.contextmanager
def _started(peer: PeerProgram, served: Served, folder: Path) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Start a peer's programs, and kill what is left of them in the end."""
    parsed = parse_url(served.line_url)
    values = {"url": served.line_url, "folder": str(folder), "line": str(folder / "line")}
    # Of a peer in Python, the interpreter that stands beside it.
    values["python"] = str(Path(shutil.which(peer.needs[0]) or "").resolve().with_name("python"))
    if isinstance(parsed, TcpUrl):
        values |= {"host": parsed.host, "port": str(parsed.port)}

    def filled(text: str) -> str:
        return re.sub(r"\{(\w+)\}", lambda found: values.get(found[1], found[0]), text)

    for name, text in peer.files:
        (folder / name).write_text(filled(text))
    processes: list[subprocess.Popen[bytes]] = []
    before = _children(os.getpid())
    _adopt(is_on=True)
    try:
        with (folder / "output").open("wb") as output:
            for words in peer.commands:
                processes.append(
                    subprocess.Popen(
                        [filled(word) for word in words], stdin=subprocess.DEVNULL, stdout=output,
                        stderr=subprocess.STDOUT, start_new_session=True, cwd=folder,
                    )
                )  # fmt: skip
                if len(peer.commands) > 1:
                    time.sleep(2.0)  # a master has to be there before its nodes
        yield processes
    finally:
        for process in processes:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)  # also what it has started; the session is its own
            process.wait(10)
        # A daemon has a session of its own (rosmaster, rosout): it has come to us as its starter ended.
        while left := _children(os.getpid()) - before:
            for pid in left:
                _kill_with_children(pid)
        _adopt(is_on=False)


def _adopt(*, is_on: bool) -> None:
    """Become the parent of what those started whom we started, once these end; prctl(2), PR_SET_CHILD_SUBREAPER."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(36, int(is_on), 0, 0, 0)


def _children(pid: int) -> set[int]:
    """Return the processes that a process has as its children now."""
    found = set[int]()
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            found |= {int(word) for word in (task / "children").read_text().split()}
    return found


def _kill_with_children(pid: int) -> None:
    """Kill a child of ours; those of its own come to us, or are killed with it."""
    for child in _children(pid):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(child, signal.SIGKILL)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.kill(pid, signal.SIGKILL)
    with contextlib.suppress(ChildProcessError):
        os.waitpid(pid, 0)


def _second_client(served: Served) -> str:
    """Come beside the peer; return what became of it: a TCP client is told that the robot is busy."""
    parsed = parse_url(served.url)
    if not isinstance(parsed, TcpUrl):
        return "-"
    with socket.create_connection((parsed.host, parsed.port), 5) as line:
        line.settimeout(5)
        answer = line.recv(200)
    if not answer.startswith(b"busy"):
        raise PeerError(f"a second client was told {answer[:40]!r}")
    return "told busy"


def _next_client(served: Served) -> str:
    """Come as the next client, drive nothing, leave; return how soon it was in."""
    started = time.monotonic()
    try:
        with Robot(served.line_url) as robot:
            if robot.state.is_moving:
                raise PeerError("turned when the next client came")
    except P2osError as error:
        raise PeerError(f"the next client did not get in: {error}") from error
    return f"{time.monotonic() - started:.1f} s"


def _wait(
    until: Callable[[], bool], longest_s: float, what: str, process: subprocess.Popen[bytes] | None = None
) -> None:
    end = time.monotonic() + longest_s
    while not until():
        if process is not None and process.poll() is not None:
            raise PeerError(f"{what}: it ended with code {process.returncode}")
        if time.monotonic() > end:
            raise PeerError(f"{what} within {longest_s:g} s")
        time.sleep(0.05)


if __name__ == "__main__":
    sys.exit(main())
