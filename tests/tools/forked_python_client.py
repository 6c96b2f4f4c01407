"""The program that stands for Python where tests/tools/forked_python.py serves it: `client.py SOCKET WORDS…`.

It hands its words, folder, environment and standard streams over, passes signals on, and ends as the forked process
does. It is started with -I and -S and imports nothing that is not built in: 10 ms of processor time.
"""

import _signal
import _socket
import marshal
import posix
import sys

#: Passed on. SIGKILL cannot be: a client that is gone has its process killed.
PASSED_ON = ("SIGHUP", "SIGINT", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGTERM", "SIGTSTP", "SIGCONT", "SIGALRM")
NUMBERS = [getattr(_signal, name) for name in PASSED_ON]
LENGTH = 4
#: A signal that comes just before a call that waits is looked at after it: no call waits longer.
LOOK_S = 0.1


def received(line: _socket.socket) -> int | None:
    """Return the next number that the server sends, None where it has none to send."""
    data = b""
    while len(data) < LENGTH:
        try:
            more = line.recv(LENGTH - len(data))
        except TimeoutError:
            continue
        if not more:
            return None
        data += more
    return int.from_bytes(data, "big", signed=True)


def handed_over(line: _socket.socket, address: str, words: list[str], ignored: list[int]) -> int | None:
    """Have a process forked and return its number; 0 or None where it has to be started."""
    if line.fileno() < 3:  # in place of a standard stream that is closed
        return None
    message = marshal.dumps((words, posix.getcwdb(), posix.environ, ignored))
    streams = b"".join(stream.to_bytes(4, sys.byteorder) for stream in range(3))
    try:
        line.connect(address)
        line.sendmsg([len(message).to_bytes(LENGTH, "big")], [(_socket.SOL_SOCKET, _socket.SCM_RIGHTS, streams)])
        line.sendall(message)
        line.settimeout(LOOK_S)
        return received(line)
    except OSError:  # nobody serves any more
        return None


class Signals:
    """Those that are passed on: to a process, or kept while there is none."""

    def __init__(self) -> None:
        self.ignored = [number for number in NUMBERS if _signal.getsignal(number) == _signal.SIG_IGN]
        self._process: int | None = None
        self._early: list[int] = []
        for number in NUMBERS:
            if number not in self.ignored:
                _signal.signal(number, self._pass_on)

    def pass_to(self, process: int | None) -> None:
        """Pass them to this process; None or 0: to this one, which does nothing about them."""
        self._process = process
        for number in self._early:
            if process:
                self._pass_on(number, None)
            else:
                die_of(number)

    def _pass_on(self, number: int, _frame: object) -> None:
        if not self._process:
            self._early.append(number)
            return
        try:  # noqa: SIM105 - contextlib would have to be imported
            posix.kill(self._process, number)
        except ProcessLookupError:  # it has ended
            pass


def main(address: str, preloaded: str, words: list[str]) -> int:
    """Have a process forked, or start it, with the library that is to be preloaded; return its exit code."""
    signals = Signals()
    line = _socket.socket(_socket.AF_UNIX, _socket.SOCK_STREAM)
    process = handed_over(line, address, words, signals.ignored)
    signals.pass_to(process)
    if not process:
        more = {b"LD_PRELOAD": preloaded.encode()} if preloaded else {}
        posix.execve(sys.executable, [sys.executable, *words], {**posix.environ, **more})
    code = received(line)
    if code is None:
        return 70
    if code < 0:
        die_of(-code)
    return code


def die_of(number: int) -> None:
    """End as a process that does nothing about a signal."""
    if number in NUMBERS:
        _signal.signal(number, _signal.SIG_DFL)
    posix.kill(posix.getpid(), number)


posix._exit(main(*sys.argv[1:3], sys.argv[3:]))
