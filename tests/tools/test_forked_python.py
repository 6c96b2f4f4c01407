"""A forked Python does what a started one does, and ends as that does."""

import os
import pty
import signal
import socket
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.p2os.client.served_robot import until
from tests.tools.forked_python import ROOT, forked_python
from tests.whole.failing_calls import library

TIMEOUT_S = 30.0
PASSED_ON = ("SIGHUP", "SIGINT", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGTERM", "SIGTSTP", "SIGCONT", "SIGALRM")
#: Whether it was forked: by then the packages are there.
IS_FORKED = "import sys; print('robot_bench.run' in sys.modules)"
SAYS = """
import os, sys, threading, time, atexit
class Left:
    def __del__(self): print("gone", flush=True)
left = Left()
atexit.register(print, "at exit")
threading.Thread(target=lambda: (time.sleep(0.1), print("thread"))).start()
print(__name__, sys.argv, os.getcwd(), os.environ["MARK"], sys.stdin.read(), sys.path[0], sys.stdout.encoding)
print("err", file=sys.stderr)
"""


def ran(program: str, words: Sequence[str], folder: Path, **more: str) -> tuple[int, str, str]:
    """Return exit code and output of a program."""
    done = subprocess.run(
        [program, *words], cwd=folder, env={**os.environ, "MARK": "ä", **more}, input="given", text=True,
        capture_output=True, timeout=TIMEOUT_S, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize(
    "code",
    [
        SAYS,
        "import sys; sys.exit(3)",
        "import sys; sys.exit('no')",
        "import sys; sys.exit()",
        "import os; os._exit(7)",
        "import os; os.kill(os.getpid(), 9)",
        "import os, signal; os.kill(os.getpid(), signal.SIGTERM)",
        "import sys; sys.excepthook = lambda *_: print('told'); raise KeyboardInterrupt",
        "import sys; sys.excepthook = lambda *_: print('told'); 1 / 0",
        "import random; print(len({random.random(), 0.5}))",
        "import signal; print([signal.getsignal(n) for n in (2, 13, 15, 17)])",
    ],
)
@pytest.mark.parametrize("way", ["-c", "-m", "file"])
def test_it_does_what_a_started_one_does(way: str, code: str, tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(code, encoding="utf-8")
    words = {"-c": ["-c", code], "-m": ["-m", "program"], "file": ["program.py"]}[way]
    words += ["-c", "two words", ""]
    assert ran(forked_python(), words, tmp_path) == ran(sys.executable, words, tmp_path)


def test_what_is_imported_is_there_already(tmp_path: Path) -> None:
    assert ran(forked_python(), ["-c", IS_FORKED], tmp_path)[1] == "True\n"


def test_another_worker_of_the_run_has_the_same_server_and_leaves_it(tmp_path: Path) -> None:
    ours = forked_python()
    worker = "from tests.tools.forked_python import forked_python; print(forked_python())"
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID") or str(os.getpid())
    assert ran(sys.executable, ["-c", worker], ROOT, PYTEST_XDIST_TESTRUNUID=run) == (0, f"{ours}\n", "")
    assert ran(ours, ["-c", IS_FORKED], tmp_path)[1] == "True\n"


def test_what_a_killed_run_has_left_is_served_anew(tmp_path: Path) -> None:
    folder = tmp_path / "forked-left"
    folder.mkdir()
    os.mkfifo(folder / "held")
    for name in ("socket", "python"):
        (folder / name).touch()
    program = """
import subprocess
from tests.tools.forked_python import forked_python
print(subprocess.run([forked_python(), "-c", "print('p2os.cli.main' in __import__('sys').modules)"], check=True))
"""
    code, said, err = ran(sys.executable, ["-c", program], ROOT, PYTEST_XDIST_TESTRUNUID="left", TMPDIR=str(tmp_path))
    assert (code, said.splitlines()[0]) == (0, "True"), err
    until(lambda: not folder.exists(), "the end of the server with its last worker")


@pytest.mark.parametrize(
    ("words", "more"),
    [
        (["-c", IS_FORKED], {"PYTHONHASHSEED": "1"}),
        (["-c", IS_FORKED], {"LC_ALL": "C"}),
        (["-X", "dev", "-c", IS_FORKED], {}),
        (["-m", "pytest", "--version"], {}),
    ],
)
def test_what_needs_a_start_of_its_own_is_started(words: list[str], more: dict[str, str], tmp_path: Path) -> None:
    started = ran(forked_python(), words, tmp_path, **more)
    assert started == ran(sys.executable, words, tmp_path, **more)
    assert "True" not in started[1]


def test_what_cannot_be_handed_over_is_started(tmp_path: Path) -> None:
    command = ["sh", "-c", f'{forked_python()} -c "{IS_FORKED}" <&-']
    assert subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=True).stdout == "False\n"


def test_a_module_that_is_not_there_is_reported(tmp_path: Path) -> None:
    code, _, err = ran(forked_python(), ["-m", "no_such_module"], tmp_path)
    assert (code, "No module named no_such_module" in err) == (1, True)


@pytest.mark.parametrize("is_handled", [True, False])
@pytest.mark.parametrize("name", PASSED_ON)
def test_a_signal_is_passed_on(name: str, is_handled: bool) -> None:
    number = signal.Signals[name]
    handler = f"signal.signal({number}, lambda number, _: sys.exit(number))" if is_handled else "None"
    # Many short sleeps: a signal just before one is looked at after it, in any Python.
    sleeps = f"for _ in range({100 if number == signal.SIGCONT else 6000}): time.sleep(0.01)"
    code = f"import signal, sys, time; {handler}; print('there', flush=True)\n{sleeps}"
    with subprocess.Popen([forked_python(), "-c", code], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(number)
        if name in {"SIGTSTP", "SIGCONT"} and not is_handled:  # what stops, and goes on, is in no one's foreground
            process.kill()
            return
        assert process.wait(TIMEOUT_S) == (number if is_handled else -number)


def test_a_client_that_is_killed_takes_its_process_with_it() -> None:
    code = "import os, time; print(os.getpid(), flush=True); time.sleep(60)"
    with subprocess.Popen([forked_python(), "-c", code], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        forked = int(process.stdout.readline())
        assert forked != process.pid
        process.kill()
        assert process.stdout.read() == b"", "nobody holds it any more"


def test_a_client_that_goes_at_once_leaves_the_others_served(tmp_path: Path) -> None:
    address = str(Path(forked_python()).with_name("socket"))
    for data in (b"", b"\0", (100).to_bytes(4, "big") + b"half"):
        with socket.socket(socket.AF_UNIX) as line:
            line.connect(address)
            line.sendall(data)
    assert ran(forked_python(), ["-c", IS_FORKED], tmp_path)[1] == "True\n"


def test_what_a_shell_has_ignored_stays_ignored() -> None:
    code = "import signal; print(*(signal.getsignal(n) == signal.SIG_IGN for n in (1, 2, 15)))"
    command = ["sh", "-c", f"trap '' HUP INT; exec {forked_python()} -c '{code}'"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=True)
    assert done.stdout == "True True False\n"


def test_a_terminal_is_one() -> None:
    near, far = pty.openpty()
    code = "import sys; print(sys.stdin.isatty(), sys.stdout.isatty(), sys.stdout.line_buffering, flush=False)"
    subprocess.run([forked_python(), "-c", code], stdin=far, stdout=far, stderr=far, timeout=TIMEOUT_S, check=True)
    assert os.read(near, 99) == b"True True True\r\n"
    os.close(near)
    os.close(far)


@pytest.mark.parametrize("more", [{}, {"PYTHONHASHSEED": "7"}], ids=["forked", "started"])
def test_a_preloaded_library_is_there_however_the_process_begins(
    more: dict[str, str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    words = [forked_python(library(tmp_path_factory)), "-c", "import ctypes; ctypes.CDLL(None).failing_calls_arm"]
    done = subprocess.run(words, env={**os.environ, **more}, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
