"""A reader who types what a page says: one folder a page, terminals that stay open, robots where the page names one.

- What serves, or waits for a key, goes on beside the commands that follow until the next heading, a line `^C`, or a
  command that serves at the same place. It is then interrupted as by Ctrl-C and has to end with exit code 130.
- A client of a robot that nobody on the page serves gets a virtual one: on the TCP port, or at a pseudo-terminal in
  place of the serial port.
- Ports are replaced by free ones, `/tmp` and `/dev` by folders of the session.
- Each line of output that the page shows has to come; numbers in it may be others, and `…` stands for anything.
- A command whose shown output has a line `p2os: …`, `fault: …`, `FAILED…` or `alike until …` has to fail; any other
  has to end with 0.
"""

import contextlib
import itertools
import os
import pty
import re
import shlex
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
import tomllib
from dataclasses import dataclass, field
from fcntl import ioctl
from importlib.metadata import entry_points
from pathlib import Path
from types import TracebackType
from typing import ClassVar, Self

from tests.documentation.page import ROOT, Block, Page
from tests.tools.forked_python import forked_python

HAS_TOOLKIT = any(point.name == "p2os" for point in entry_points(group="simbase.packages"))
LIMIT_S = 240.0
READY_S = 60.0
ENDING_S = 60.0
PORTS = 24
#: What a program ends with where the machine kept it from real time; and how often it is typed then, at most.
HELD_UP, TRIES = ("the loop lagged", "the program or its machine paused for "), 3
FAILURES = ("p2os: ", "fault: ", "FAILED ", "FAILED;", "depends: ", "alike until ")
NAMED_FILE = re.compile(r"^(?:/\*|//|#)\s*(?P<name>[\w./-]+\.(?:c|h|ld|toml|py|yml|yaml))\b")
TCP = re.compile(r"(?<=tcp:127\.0\.0\.1:)\d+|(?<=--gdb )\d+|(?<=remote :)\d+")
PLACE = re.compile(r"(?:tcp:127\.0\.0\.1:\d+|(?:serial|pty):/[^?'\s]+)")
#: Programs that a reader may lack; where one is not installed its lines are left out, and the test says so.
OPTIONAL = {"arm-none-eabi-gcc", "gdb-multiarch", "tshark", "make", "g++"}
#: What a reader's shell finds first. `make` in the checkout, and tests inside the tests, are looked at, not executed:
#: of the latter that their options are options, and that their files are there.
SHIMS = {
    # Where only the emulator is (tools/packaging/testing.py), the verbs of `p2os mcu` are a program of its own.
    "p2os": 'exec {python} -m p2os "$@"'
    if HAS_TOOLKIT
    else '[ "$1" = mcu ] || exit 127; shift\nexec {python} -m bluepill_sim "$@"',
    "python": 'case "$1 $2" in "-m venv") exit 0;; esac; exec {python} "$@"',
    "python3": 'case "$1 $2" in "-m venv") exit 0;; esac; exec {python} "$@"',
    "pip": 'case "$*" in "install "*) exit 0;; esac; exit 2',  # the network; test_docs.py looks at the extras
    "pytest": 'if [ -e pytest.ini ]; then exec {python} -m pytest -p no:cacheprovider "$@"; fi; cd {root} && '
    'for each; do case $each in tests/*) ls "$each" >&2 || exit 4;; esac; done; '
    'exec {python} -c "import sys, pytest; sys.exit(pytest.main(sys.argv[1:]))" --markers -p no:cacheprovider "$@"',
    "sudo": "exit 0",  # what a machine needs once
    "make": 'if [ -e Makefile ] || [ "$1" = -C ]; then exec {make} "$@"; else exec {make} -n -C {root} "$@"; fi',
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Endless:
    """A verb that ends by Ctrl-C, and what a reader does meanwhile."""

    verb: str
    given: str = ""
    unless: str = "\n"
    serves: bool = False  # others use it, so it stays
    keys: bytes | None = None  # it is typed at: it gets a terminal
    hold_s: float = 0.7  # how long one that serves nobody is left to work
    may_end: bool = False  # once its client has left
    ready: str = ""  # what it prints once it can be used; empty: anything

    def fits(self, words: list[str]) -> bool:
        """Whether the words are this verb with these options."""
        names = self.verb.split()
        return words[: len(names)] == names and self.unless not in words and (not self.given or self.given in words)


ENDLESS = (
    Endless(verb="serve", serves=True, ready="Ctrl-C ends"),
    Endless(verb="sniff", unless="--install-dissector", serves=True),
    Endless(verb="replay", unless="client", serves=True, may_end=True),
    Endless(verb="mcu debug", serves=True, may_end=True),
    Endless(verb="run", given="--gdb", serves=True),
    Endless(verb="p2os-adapter", serves=True),
    Endless(verb="plan_view", serves=True, ready="listening"),
    Endless(verb="run", given="--port", keys=b"y\n", hold_s=4.0),
    Endless(verb="view", ready="page: "),
    Endless(verb="record", unless="--for"),
    Endless(verb="monitor", unless="--for", keys=b""),
    Endless(verb="teleop", keys=b"w"),
)
#: Options that a reader leaves out and whose default would meet other programs of this machine, or take long.
DEFAULTS = (
    ("serve", "--port tcp:127.0.0.1:8101", {"--port", "--fleet"}),
    ("sniff", "--listen tcp:127.0.0.1:8102", {"--listen", "--install-dissector"}),
    ("mcu debug", "--port 3333", {"--port"}),
    ("view", "--no-browser", {"--no-browser"}),
    ("scan", "serial:/dev/ttyUSB0 tcp:127.0.0.1:8101", set[str]()),
    ("bench", "--for 1s", {"--for"}),
    ("python tools/bench/columns.py", "--quick", {"--quick"}),
)
#: Where a verb serves; all other URLs on its line are robots that it is a client of.
SERVING = {"serve": {"--port", "--aux", "--control"}, "sniff": {"--listen"}, "run": set[str](), "replay": {"replay"}}


@dataclass
class Terminal:
    """A program that goes on while the next commands are typed."""

    line: str
    shown: list[str]
    kind: Endless
    process: subprocess.Popen[bytes]
    source: int  # descriptor of what it prints
    places: set[str]
    output: bytearray = field(default_factory=bytearray)

    def __post_init__(self) -> None:
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def text(self) -> str:
        return self.output.decode(errors="replace")

    def wait_until_ready(self) -> None:
        """Wait until it says something, or has ended."""
        deadline = time.monotonic() + READY_S
        while self.process.poll() is None and not (self.output and self.kind.ready in self.text):
            assert time.monotonic() < deadline, f"{self.line}: not ready after {READY_S} s\n{self.text}"
            time.sleep(0.01)

    def is_there(self) -> bool:
        """Whether it goes on, or may have ended."""
        return self.kind.may_end or self.process.poll() is None

    def was_held_up(self) -> bool:
        """Whether it has ended, and says that the machine was too busy."""
        if self.process.poll() is None:
            return False
        self._reader.join()
        return was_held_up(self.process.returncode, self.text)

    def end(self) -> None:
        """Press Ctrl-C where it still runs, and look at what it said and how it ended."""
        if self.kind.may_end:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(1.0)
        running = self.process.poll() is None
        if running:
            os.killpg(self.process.pid, signal.SIGINT)
        try:
            code = self.process.wait(ENDING_S)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{self.line}: Ctrl-C does not end it\n{self.text}") from None
        finally:
            self.kill()
        assert code == (130 if running else 0), f"{self.line}: exit code {code}\n{self.text}"
        check_output(self.line, self.shown, self.text)

    def kill(self) -> None:
        """End it and all that it started, whatever state it is in."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self._reader.join(ENDING_S)

    def _read(self) -> None:
        with contextlib.suppress(OSError):  # a pseudo-terminal's way of saying that nobody writes any more
            while data := os.read(self.source, 65536):
                self.output += data
        os.close(self.source)


class Session:
    """One page's reader; a context manager that leaves nothing behind."""

    def __init__(self) -> None:
        self.missing: list[str] = []  # lines left out because a program is not installed
        self._terminals: list[Terminal] = []
        self._robots = contextlib.ExitStack()
        self._places: set[str] = set()
        self._section = 0
        self._folder = Path(tempfile.mkdtemp(prefix="docs-"))
        self._cwd = self._folder
        self._first_port = take_ports()

    def __enter__(self) -> Self:
        for name in ("tmp", "dev", "home", ".venv/bin"):
            (self._folder / name).mkdir(parents=True)
        bin_ = self._folder / ".venv" / "bin"
        (bin_ / "activate").touch()
        for name, script in SHIMS.items():
            text = script.format(python=python(), root=ROOT, make=shutil.which("make"))
            (bin_ / name).write_text(f"#!/bin/sh\n{text}\n")
            (bin_ / name).chmod(0o755)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        for terminal in self._terminals:
            terminal.kill()
        self._robots.close()
        self._first_port.close()
        shutil.rmtree(self._folder)

    def take(self, block: Block) -> None:
        """Do what a block says, and fail where it does not go as the page says."""
        if block.section != self._section:
            self.end_terminals()
            self._section = block.section
        for kind, text in block.notes:
            if kind == "given":
                file, source = text.split(" = ")
                (self._cwd / file).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / source, self._cwd / file)
        self._taking[block.language](self, block)

    def end_terminals(self) -> None:
        """Press Ctrl-C in every terminal, the last opened first, and let the robots go."""
        try:
            while self._terminals:
                self._close(self._terminals[-1])
        finally:
            self._robots.close()
            self._places.clear()

    def _take_shell(self, block: Block) -> None:
        for line, shown in block.entries:
            if line == "^C":
                self._close(self._terminals[-1])
            else:
                self._type(line, shown)

    def _take_python(self, block: Block) -> None:
        named = NAMED_FILE.match(block.text)
        if named is not None and "/" not in named["name"]:  # one in a folder is of the checkout
            self._keep(block)
        self._finish([python(), "-c", self._placed(block.text)], f"line {block.line}", [])

    def _take_toml(self, block: Block) -> None:
        tomllib.loads(block.text)
        self._keep(block)

    def _take_c(self, block: Block) -> None:
        file = self._keep(block) or self._folder / "tmp" / "block.c"
        file.write_text(block.text, encoding="utf-8")
        is_firmware = '#include "../fabric/fabric.h"' not in block.text  # else a device of the emulator
        compiler = shutil.which("arm-none-eabi-gcc" if is_firmware else "gcc")
        if compiler is None:
            self.missing.append(f"the C block of line {block.line}")
            return
        headers = ROOT / ("robot_bench/firmware" if is_firmware else "bluepill_sim/extension/source/devices")
        flags = ["-mcpu=cortex-m3", "-mthumb"] if is_firmware else []
        flags += ["-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"-I{headers}"]
        self._finish([compiler, *flags, str(file)], f"line {block.line}", [])

    def _keep(self, block: Block) -> Path | None:
        named = NAMED_FILE.match(block.text)
        if named is None:
            return None
        file = self._cwd / named["name"]
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(self._placed(block.text), encoding="utf-8")
        return file

    _taking: ClassVar = {
        "python": _take_python, "toml": _take_toml, "c": _take_c, "console": _take_shell, "sh": _take_shell,
    }  # fmt: skip

    def _type(self, line: str, shown: list[str]) -> None:
        words = shlex.split(line, comments=True)
        program = words[0]
        if program in OPTIONAL and shutil.which(program) is None:
            self.missing.append(line)
            return
        verb = words[1:] if Path(program).name == "p2os" else [Path(program).name, *words[1:]]
        typed = f"{line.partition('  #')[0]} {self._added(verb)}".strip()
        command = in_checkout(self._placed(typed), words)
        kind = next((each for each in ENDLESS if each.fits(verb)), None)
        clients, serving = self._urls(verb, command)
        for url in clients - self._places:
            from p2os.pioneer.serve import served_pioneer  # not where only the emulator is

            self._robots.enter_context(served_pioneer(url=url.replace("serial:", "pty:")))
            self._places.add(url)
        for terminal in [each for each in self._terminals if each.places & serving]:
            self._close(terminal)  # nobody serves twice at one place
        self._places |= serving
        if kind is None:
            marker = self._folder / "tmp" / ".cwd"
            self._finish(["bash", "-c", f"{command}\ncode=$?; pwd > {marker}; exit $code"], line, shown)
            self._cwd = Path(marker.read_text().strip())
            return
        for left in reversed(range(TRIES)):
            terminal = self._open(command, line, shown, kind, serving)
            self._terminals.append(terminal)
            terminal.wait_until_ready()
            if kind.serves:
                assert terminal.is_there(), f"{line}: it has ended\n{terminal.text}"
                return
            time.sleep(kind.hold_s)
            if not left or not terminal.was_held_up():
                break
            self._terminals.remove(terminal)
        self._close(terminal)

    def _close(self, terminal: Terminal) -> None:
        terminal.end()
        self._terminals.remove(terminal)
        self._places -= terminal.places

    def _open(self, command: str, line: str, shown: list[str], kind: Endless, places: set[str]) -> Terminal:
        if kind.keys is None:
            source, far = os.pipe()
        else:
            source, far = pty.openpty()
            ioctl(far, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
            attributes = termios.tcgetattr(far)
            attributes[3] &= ~termios.ECHO  # what is typed is no answer
            termios.tcsetattr(far, termios.TCSANOW, attributes)
        process = subprocess.Popen(
            ["bash", "-c", f"exec {command}"], cwd=self._cwd, env=self._environment(), stdout=far, stderr=far,
            stdin=subprocess.DEVNULL if kind.keys is None else far, start_new_session=True,
        )  # fmt: skip
        os.close(far)
        if kind.keys:
            os.write(source, kind.keys)
        return Terminal(line, shown, kind, process, source, places)

    def _finish(self, command: list[str], line: str, shown: list[str]) -> None:
        for _ in range(TRIES):
            code, text = self._ended(command)
            if not was_held_up(code, text):
                break
        fails = any(each.startswith(FAILURES) for each in shown)
        assert (code != 0) == fails, f"{line}: exit code {code}\n{text}"
        check_output(line, shown, text)

    def _ended(self, command: list[str]) -> tuple[int, str]:
        process = subprocess.Popen(
            command, cwd=self._cwd, env=self._environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip
        try:
            output, _ = process.communicate(timeout=LIMIT_S)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        return process.returncode, output.decode(errors="replace")

    def _environment(self) -> dict[str, str]:
        own = {
            "PATH": f"{self._folder / '.venv/bin'}:{os.environ['PATH']}",
            "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")])),
            "HOME": str(self._folder / "home"), "NO_COLOR": "1", "TERM": "xterm", "COLUMNS": "200",
            "MPLCONFIGDIR": str(Path.home() / ".cache" / "matplotlib"),  # its list of fonts takes seconds to make
        }  # fmt: skip
        return {name: text for name, text in os.environ.items() if not name.startswith("XDG_")} | own

    @staticmethod
    def _added(verb: list[str]) -> str:
        return " ".join(
            text for name, text, present in DEFAULTS
            if verb[: len(name.split())] == name.split()
            and (not present & set(verb) if present else len(verb) == len(name.split()))
        )  # fmt: skip

    def _placed(self, text: str) -> str:
        """Replace ports by free ones, folders of the system by the session's, long times by short ones."""
        text = re.sub(r"(?<![\w.])/(tmp|dev/tty|dev/serial)(?=[/\w])", rf"{self._folder}/\1", text)
        if not re.match(r"(p2os )?mcu\b", text):
            text = re.sub(r"(?<=--for )(\d+min|[3-9]s|\d{2,}s)", "2s", text)
        text = re.sub(r"(?<=mcu debug )(.*--port )(\d+)", lambda found: found[1] + str(self._port(int(found[2]))), text)
        return TCP.sub(lambda found: str(self._port(int(found[0]))), text)

    def _port(self, number: int) -> int:
        """A free port in the place of one that a page names; neighbours stay neighbours."""
        first = self._first_port.getsockname()[1]
        return first + (number - 8099 if 8100 <= number < 8100 + PORTS - 2 else PORTS - 1)

    def _urls(self, verb: list[str], command: str) -> tuple[set[str], set[str]]:
        """URLs on a command line: of robots that it is a client of, and of places where it serves."""
        clients, serving = set[str](), set[str]()
        options = SERVING.get(verb[0], set[str]()) if verb else set[str]()
        words = shlex.split(command, comments=True)
        for before, word in itertools.pairwise(words):
            if url := PLACE.fullmatch(word.partition("?")[0]):
                is_served = before in options or (verb[0] == "replay" and "client" not in verb)
                (serving if is_served else clients).add(url[0])
        if verb == ["scan"]:
            clients = {url for url in clients if url.startswith("serial:")}  # nobody is at the network's place
        if verb and verb[0] == "serve":  # a fleet's ports follow one another
            first = {int(url.rpartition(":")[2]) for url in serving if url.startswith("tcp:")}
            if "--fleet" in verb:
                first = {self._port(8101)}
            serving |= {f"tcp:127.0.0.1:{port + n}" for port in first for n in range(4)}
        return clients, serving


def python() -> str:
    """Return the Python of a reader; a server's fork where there are verbs that it imports."""
    return forked_python() if HAS_TOOLKIT else sys.executable


def run_blocks(page: Page, pace: int) -> list[str]:
    """Do what the blocks of a page say that are of this pace or below; return what a program is missing for."""
    with Session() as session:
        for block in page.blocks:
            if block.is_run and block.pace <= pace:
                session.take(block)
        session.end_terminals()
    return session.missing


def in_checkout(line: str, words: list[str]) -> str:
    """Lead paths of the repository to it: a reader stands in the checkout, the test does not write there."""
    if "pytest" in words[0]:
        return line
    for word in words:
        top, slash, _ = word.partition("/")
        if slash and re.fullmatch(r"\w+", top) and top != "build" and (ROOT / top).is_dir():
            line = line.replace(word, str(ROOT / word))
    return line


def was_held_up(code: int, text: str) -> bool:
    """Tell whether a program that has ended says that the machine was too busy."""
    return code != 0 and any(words in text for words in HELD_UP)


def check_output(line: str, shown: list[str], text: str) -> None:
    """Look for every line that a page shows, whatever its numbers."""
    for each in shown:
        pattern = re.escape(general(each)).replace("…", ".*")
        assert re.search(pattern, general(text)), f"{line}: the page shows\n{each}\nbut what came is\n{text}"


def general(text: str) -> str:
    """Text without what differs from run to run: numbers, spaces, where the folders are."""
    text = re.sub(r"\S*/(docs-\w+/)?(?=dev/|tmp/)", "/", text)
    return re.sub(r"[ \t]+", " ", re.sub(r"-?\d+(?:\.\d+)?", "#", text))


def take_ports() -> socket.socket:
    """Return a listener at the first of a row of `PORTS` ports; who holds it has the row.

    The rows lie below those ports that a system gives who asks for any: nobody else comes to one in the meantime.
    """
    for first in range(20_000, 30_000, PORTS):
        with contextlib.suppress(OSError), contextlib.ExitStack() as stack:
            holder = stack.enter_context(socket.create_server(("127.0.0.1", first)))
            for port in range(first + 1, first + PORTS):
                socket.create_server(("127.0.0.1", port)).close()
            stack.pop_all()
            return holder
    raise AssertionError("no row of free ports")
