"""A Python that starts in a hundredth of a second: `forked_python()` is a program that takes what `python` takes.

A process of `python -m p2os …` imports for 0.3 to 0.9 s of processor time before it does anything. Here a server, one
for all workers of a run, has imported the packages, and forks for each command: a client, itself the process that a
test or a shell starts, hands over words, folder, environment and standard streams, passes signals on, and ends with
the same exit code. What is asked for in another way than `-m MODULE`, `-c CODE` or `FILE`, or with settings of Python
that the server was not started with, is started as ever.

The server ends when no worker holds its fifo open any more.

What this cannot show is the start itself, and what a program without some package does: tests of that start
`sys.executable`; as do those that stop a process or look at it, for the client is another one.
"""

import atexit
import contextlib
import fcntl
import gc
import importlib
import importlib.util
import io
import marshal
import os
import select
import selectors
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import NoReturn, TextIO

ROOT = Path(__file__).resolve().parents[2]
CLIENT = Path(__file__).with_name("forked_python_client.py")
LENGTH = 4
#: How long a client may take to say what it wants.
CLIENT_S = 10.0
#: What Python reads when it starts, beside variables that begin with PYTHON.
LOCALE = ("LANG", "LC_ALL", "LC_CTYPE")
#: Each process has its own.
NOT_COMPARED = ("PYTHONPATH",)
#: Words of a command that looks at the shell it was started from.
OF_THE_SHELL = ("--install-completion", "--show-completion")
#: Modules that act on what is imported after them.
IMPORTING = ("pytest",)
#: For `-c`: pytest as it is imported here, its plugins too, with no assertion of theirs rewritten; without that of
#: hypothesis, which imports all of it for 0.1 s to say at the end that it has nothing to say.
PYTEST = 'import pytest, sys; sys.exit(pytest.main(["-p", "no:hypothesispytest", *sys.argv[1:]]))'
#: What commands import at their work, beside the verbs and what those import.
IMPORTED = ("p2os.__main__", "typer._adapters", "p2os.pioneer.body.kinematic")
#: The same of those that do more than p2os does.
IMPORTED_BY_OTHERS = (
    "robot_bench.scenarios", "robot_bench.report.measures", "robot_bench.report.plots",
    "matplotlib.backends.backend_agg", "unicorn", "elftools.elf.elffile", "pytest",
)  # fmt: skip


@cache
def forked_python(preloaded: str = "") -> str:
    """Return the path of the program; the server, which the first worker that asks starts, ends with the last.

    Args:
        preloaded: A library that its processes have before all others (LD_PRELOAD); each has a server of its own.
    """
    folder = _folder(preloaded)
    with _locked(folder):
        try:
            _hold(folder)
        except OSError:  # nobody serves there, or no more: a run of this number was killed
            for left in ("held", "socket"):
                (folder / left).unlink(missing_ok=True)
            _start(folder, preloaded)
            _hold(folder)
    return str(folder / "python")


@cache
def _folder(preloaded: str = "") -> Path:
    """Return the folder of this run's server, whatever a test makes of the environment."""
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID") or os.getpid()
    return Path(tempfile.gettempdir(), f"forked-{run}{preloaded and f'-{zlib.crc32(preloaded.encode()):x}'}")


def _hold(folder: Path) -> None:
    """Keep the server until this process ends, which alone closes what is opened here."""
    os.open(folder / "held", os.O_WRONLY | os.O_NONBLOCK)


def _locked(folder: Path) -> TextIO:
    """Return a file that locks a folder until it is closed; the folder is made if need be, and nobody removes it."""
    while True:
        folder.mkdir(mode=0o700, exist_ok=True)
        with contextlib.suppress(FileNotFoundError):
            lock = (folder / "lock").open("w")
            fcntl.flock(lock, fcntl.LOCK_EX)
            if os.path.samestat(os.fstat(lock.fileno()), (folder / "lock").stat()):
                return lock
            lock.close()  # it was removed, and made anew


def _start(folder: Path, preloaded: str) -> None:
    program, held = folder / "python", folder / "held"
    os.mkfifo(held)
    read_end = os.open(held, os.O_RDONLY | os.O_NONBLOCK)
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(folder / "socket"))
    listener.listen(100)  # who comes while the server still imports waits
    _servers.append(subprocess.Popen(
        [sys.executable, "-m", "tests.tools.forked_python", str(listener.fileno()), str(folder)], cwd=ROOT,
        env=_environment(preloaded), stdin=read_end, pass_fds=[listener.fileno()], start_new_session=True,
    ))  # fmt: skip
    listener.close()
    os.close(read_end)
    program.write_text(
        f'#!/bin/sh\nexec "{sys.executable}" -I -S "{CLIENT}" "{folder / "socket"}" "{preloaded}" "$@"\n'
    )
    program.chmod(0o755)


def forked_p2os(*words: str) -> list[str]:
    """Return the words that start `p2os` so, with what follows it."""
    return [forked_python(), "-m", "p2os", *words]


def spent_s() -> float:
    """Return the seconds of processor time of what was forked for this worker, and of the server if it started that."""
    spent = 0.0
    for folder in _folder().parent.glob(f"{_folder().name}*"):
        with contextlib.suppress(OSError):
            spent += float(_spent_file(folder, os.environ).read_text(encoding="ascii"))
    return spent


def _spent_file(folder: Path, environment: Mapping[str, str]) -> Path:
    return folder / f"spent-{environment.get('PYTEST_XDIST_WORKER', '')}"


#: Held, for a process that is forgotten while it runs warns of that.
_servers: list[subprocess.Popen[bytes]] = []


def _environment(preloaded: str) -> dict[str, str]:
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    return {**os.environ, "PYTHONPATH": path} | ({"LD_PRELOAD": preloaded} if preloaded else {})


# The server -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Command:
    """What a client wants to have run."""

    words: list[str]
    folder: bytes
    environment: dict[str, str]
    ignored: list[int]
    streams: list[int]

    @classmethod
    def received(cls, line: socket.socket) -> "Command":
        """Read one from a client that has just come.

        Raises:
            OSError: It has gone already.
        """
        head, streams, _, _ = socket.recv_fds(line, LENGTH, 3)
        message, length = b"", int.from_bytes(head, "big")
        while len(message) < length or not length:
            more = line.recv(length - len(message))
            if not more:
                raise ConnectionResetError
            message += more
        words, folder, environment, ignored = marshal.loads(message)  # noqa: S302 - of our own client
        decoded = {os.fsdecode(name): os.fsdecode(value) for name, value in environment.items()}
        return cls(words, folder, decoded, ignored, list(streams))

    @property
    def can_be_forked(self) -> bool:
        """Whether a fork of this process does what Python would."""
        words = self.words
        is_known = len(words) > 1 if words[:1] in (["-m"], ["-c"]) else bool(words) and words[0][:1] not in {"-", ""}
        is_to_import = words[:1] == ["-m"] and words[1] in IMPORTING
        is_of_the_shell = not set(OF_THE_SHELL).isdisjoint(words)
        return is_known and not (is_to_import or is_of_the_shell) and settings(self.environment) == settings(os.environ)


def settings(environment: Mapping[str, str]) -> dict[str, str]:
    """Return what of an environment Python reads when it starts."""
    return {
        name: value for name, value in environment.items()
        if (name.startswith("PYTHON") or name in LOCALE) and name not in NOT_COMPARED
    }  # fmt: skip


class Server:
    """Forks a process for each client, and tells it how that has ended."""

    def __init__(self, listener: socket.socket, folder: Path) -> None:
        self._listener, self._folder = listener, folder
        #: By process: the line to its client, and where its time is kept.
        self._running: dict[int, tuple[socket.socket, Path]] = {}
        self._spent_s: dict[Path, float] = {}
        self._own_spent = _spent_file(folder, os.environ)
        self._has_all = False
        self._ended, self._wakes = socket.socketpair()
        self._selector = selectors.DefaultSelector()
        for each in (self._listener, self._ended, self._wakes):
            each.setblocking(False)

    def serve(self) -> Command | None:
        """Serve until standard input ends, which is None; return in a forked process with what that has to do."""
        signal.set_wakeup_fd(self._wakes.fileno(), warn_on_full_buffer=False)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        for each in (self._listener, self._ended, sys.stdin):
            self._selector.register(each, selectors.EVENT_READ)
        self._spend(self._own_spent, time.process_time())
        while True:
            for key, _ in self._selector.select():
                if key.fileobj is self._listener:
                    command = self._fork()
                    if command is not None:
                        return command
                elif key.fileobj is self._ended:
                    self._tell_ended()
                elif key.fileobj is sys.stdin:
                    if self._is_left():
                        return None
                elif key.data in self._running:  # its client has gone
                    self._selector.unregister(key.fileobj)
                    kill(key.data)

    def _is_left(self) -> bool:
        """End what was forked and remove the folder, unless another worker has come."""
        with _locked(self._folder):
            if not select.select([sys.stdin], [], [], 0)[0]:
                return False
            for process in self._running:
                kill(process)
            shutil.rmtree(self._folder)
            return True

    def _spend(self, file: Path, spent_s: float) -> None:
        self._spent_s[file] = self._spent_s.get(file, 0.0) + spent_s
        new = file.with_suffix(".new")  # a file that is read is whole
        new.write_text(f"{self._spent_s[file]}", encoding="ascii")
        new.replace(file)

    def _fork(self) -> Command | None:
        """Fork for the client that has come; return in the forked process with what it has to do."""
        line, _ = self._listener.accept()
        line.settimeout(CLIENT_S)
        try:
            command = Command.received(line)
        except OSError:
            line.close()
            return None
        process = 0
        if command.can_be_forked:
            if not self._has_all and not is_of_p2os(command):
                begun_s = time.process_time()
                import_verbs(IMPORTED_BY_OTHERS)
                self._spend(self._own_spent, time.process_time() - begun_s)
                self._has_all = True
            process = os.fork()
            if not process:
                self._forget(line)
                return command
        for stream in command.streams:
            os.close(stream)
        with contextlib.suppress(OSError):  # it has gone: that is noticed below
            line.sendall(process.to_bytes(LENGTH, "big"))
        if process:
            self._running[process] = line, _spent_file(self._folder, command.environment)
            self._selector.register(line, selectors.EVENT_READ, process)
        else:  # it starts Python itself
            line.close()
        return None

    def _forget(self, line: socket.socket) -> None:
        """Leave what is the server's, in a forked process."""
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        self._selector.close()
        others = (other for other, _ in self._running.values())
        for each in (line, self._listener, self._ended, self._wakes, *others):
            each.close()

    def _tell_ended(self) -> None:
        """Tell the clients of processes that have ended."""
        self._ended.recv(1000)
        with contextlib.suppress(ChildProcessError):
            while True:
                process, status, used = os.wait4(-1, os.WNOHANG)
                if not process:
                    break
                line, file = self._running.pop(process)
                self._spend(file, used.ru_utime + used.ru_stime)
                with contextlib.suppress(KeyError):  # where it has gone
                    self._selector.unregister(line)
                with contextlib.suppress(OSError):
                    line.sendall(os.waitstatus_to_exitcode(status).to_bytes(LENGTH, "big", signed=True))
                line.close()


def kill(process: int) -> None:
    """Kill a forked process with all that it has started in its session."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process, signal.SIGKILL)


# A forked process -------------------------------------------------------------------------


def become(command: Command, path: list[str]) -> NoReturn:
    """Do what a command wants, as `python` itself would.

    Args:
        command: Of a client.
        path: Where modules lie beside what the command's PYTHONPATH and first word say.
    """
    os.setsid()
    for place, stream in enumerate(command.streams):
        os.dup2(stream, place)
        os.close(stream)
    os.chdir(command.folder)
    os.environ.clear()
    os.environ.update(command.environment)
    for number in command.ignored:
        signal.signal(number, signal.SIG_IGN)
    for place, name in enumerate(("stdin", "stdout", "stderr")):
        made = stream_like(getattr(sys, name), place)
        setattr(sys, name, made)
        setattr(sys, f"__{name}__", made)
    given = [each for each in command.environment.get("PYTHONPATH", "").split(os.pathsep) if each]
    sys.path[:] = ["", *given, *path]
    end(command.words)


def end(words: Sequence[str]) -> NoReturn:
    """Run a program and end the process as Python does, but for the modules of the packages.

    To take those apart, one by one, is 0.08 s: all the memory that the server has made is written to.
    """
    code, is_interrupted = 0, False
    try:
        run(words)
    except SystemExit as error:
        if isinstance(error.code, int):
            code = error.code
        elif error.code is not None:
            sys.stderr.write(f"{error.code}\n")
            code = 1
    except BaseException as error:  # noqa: BLE001 - Python tells any
        sys.excepthook(type(error), error, error.__traceback__)
        code, is_interrupted = 1, isinstance(error, KeyboardInterrupt)
    threading._shutdown()  # type: ignore[attr-defined]  # waits for threads
    atexit._run_exitfuncs()
    sys.modules["__main__"].__dict__.clear()
    gc.collect()
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            code = 120
    if is_interrupted:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGINT)
    os._exit(code & 0xFF)


def stream_like(own: TextIO, descriptor: int) -> io.TextIOWrapper:
    """Return a standard stream with a descriptor, as Python makes it."""
    assert isinstance(own, io.TextIOWrapper)
    is_unbuffered = own.write_through
    buffering = 0 if is_unbuffered and descriptor else -1  # what is read is buffered in any case
    binary = open(descriptor, "wb" if descriptor else "rb", buffering=buffering, closefd=False)  # noqa: SIM115
    return io.TextIOWrapper(
        binary, encoding=own.encoding, errors=own.errors, newline="\n" if descriptor else None,
        line_buffering=descriptor == 2 or binary.isatty(), write_through=is_unbuffered,
    )  # fmt: skip


def run(words: Sequence[str]) -> None:
    """Run `-m MODULE`, `-c CODE` or `FILE` as the main module."""
    main = sys.modules["__main__"] = ModuleType("__main__")
    main.__dict__["__builtins__"] = __builtins__
    first = words[0]
    if first == "-c":
        sys.argv = ["-c", *words[2:]]
        code = compile(words[1], "<string>", "exec")
    elif first == "-m":
        sys.path[0] = str(Path.cwd())
        spec = importlib.util.find_spec(words[1])
        if spec is not None and spec.submodule_search_locations is not None:
            spec = importlib.util.find_spec(f"{words[1]}.__main__")
        if spec is None or spec.origin is None:
            sys.exit(f"{sys.executable}: No module named {words[1]}")
        main.__spec__, main.__file__, main.__loader__, main.__package__ = spec, spec.origin, spec.loader, spec.parent
        sys.argv = [spec.origin, *words[2:]]
        code = spec.loader.get_code(spec.name)  # type: ignore[union-attr]  # a module that runs has a loader with code
    else:
        sys.path[0] = str(Path(first).resolve().parent)
        sys.argv = list(words)
        main.__file__ = first
        code = compile(Path(first).read_bytes(), first, "exec")
    exec(code, main.__dict__)  # noqa: S102


def is_of_p2os(command: Command) -> bool:
    """Tell whether a command has nothing of the packages above p2os, as far as its words and its file show."""
    from p2os.cli.main import verbs  # not in who starts the server

    words = command.words
    if words[:2] == ["-m", "p2os"]:
        return any(entry.name in words[2:3] and entry.module.startswith("p2os.") for entry in verbs())
    if words[0] == "-c":
        return "robot_bench" not in words[1] and words[1] != PYTEST  # whose tests import nearly all
    with contextlib.suppress(OSError):
        return b"robot_bench" not in Path(os.fsdecode(command.folder), words[0]).read_bytes()
    return False


def import_verbs(beside: Sequence[str], of: str = "") -> None:
    """Import the verbs whose modules begin so, and before them what they import at their work."""
    from p2os.cli.main import verbs

    gc.disable()
    for name in (*beside, *(entry.module for entry in verbs() if entry.module.startswith(of))):
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    gc.freeze()
    gc.enable()


if __name__ == "__main__":
    with socket.socket(fileno=int(sys.argv[1])) as listening:
        base = sys.path[1 + len(os.environ["PYTHONPATH"].split(os.pathsep)) :]
        import_verbs(IMPORTED, "p2os.")
        wanted = Server(listening, Path(sys.argv[2])).serve()
    if wanted is not None:
        become(wanted, base)
