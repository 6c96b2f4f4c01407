"""The verb serve, in a process of its own and in this one."""

import fcntl
import json
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from p2os.cli import main
from p2os.cli.main import run
from p2os.cli.virtual import serve
from p2os.pioneer.serve import fleet_order
from p2os.pioneer.serve.control_line import Terminal
from p2os.protocol.commands import Command
from p2os.transport import HungUpError
from simbase.command_line.signals import restored_signals
from simbase.errors import MissingDependencyError
from simbase.timing import NS_PER_S
from tests.tools.forked_python import forked_p2os

TIMEOUT_S = 30.0
COMMAND = str(Path(sys.executable).parent / "p2os")
Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _own_signals() -> Iterator[None]:
    """Give the signals back that a verb has taken in this process."""
    with restored_signals():
        yield


class Serving:
    """`p2os serve` as a process of its own, forked or started as the script that users have."""

    def __init__(self, *words: str, body: Sequence[str] = ("--body", "kinematic"), is_forked: bool = True) -> None:
        command = forked_p2os("serve") if is_forked else [COMMAND, "serve"]
        self.process = subprocess.Popen(
            [*command, *body, "--json", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True,
        )  # fmt: skip
        assert self.process.stdout is not None
        assert select.select([self.process.stdout], [], [], TIMEOUT_S)[0], "it never started"
        self.start = json.loads(self.process.stdout.readline())

    def end(self, number: int = signal.SIGINT) -> tuple[int, str]:
        self.process.send_signal(number)
        _, err = self.process.communicate(timeout=TIMEOUT_S)
        return self.process.returncode, err


@pytest.fixture
def serving(tmp_path: Path) -> Iterator[Callable[..., Serving]]:
    started: list[Serving] = []

    def begin(*words: str, **options: Any) -> Serving:
        started.append(Serving(*words, **options))
        return started[-1]

    yield begin
    for each in started:
        if each.process.poll() is None:
            each.process.kill()
            each.process.communicate(timeout=TIMEOUT_S)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_serve_says_where_it_is_serves_and_ends_cleanly(serving: Callable[..., Serving], number: int) -> None:
    served = serving("--port", "tcp:127.0.0.1:0", "--world", "arena", "--seed", "7", "--firmware", "ARCOS")
    assert served.start["world"] == "arena"
    asked = subprocess.run(
        forked_p2os("info", served.start["url"], "--json"),
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=True,
    )
    assert json.loads(asked.stdout)["subclass"] == "p2dx"
    code, err = served.end(number)
    assert code == 130
    assert "client connected: tcp:127.0.0.1:" in err
    assert "opened" in err
    assert "client gone" in err
    assert "Traceback" not in err


def test_serve_on_a_terminal_removes_its_link(serving: Callable[..., Serving], tmp_path: Path) -> None:
    link = tmp_path / "robot"
    served = serving("--port", f"pty:{link}", "--all-sonar")
    assert link.is_symlink()
    asked = subprocess.run(
        forked_p2os("info", f"serial:{link}", "--json"), capture_output=True, text=True, timeout=TIMEOUT_S, check=True
    )
    assert len(json.loads(asked.stdout)["sip"]["sonar_m"]) == 8
    assert served.end()[0] == 130
    assert not link.is_symlink()


def test_serve_costs_next_to_nothing_while_it_waits(serving: Callable[..., Serving]) -> None:
    served = serving("--port", "tcp:127.0.0.1:0", is_forked=False)

    def used_s() -> float:
        of_threads = Path(f"/proc/{served.process.pid}/task").glob("*/schedstat")
        return sum(int(each.read_text().split()[0]) for each in of_threads) / NS_PER_S

    time.sleep(0.2)
    before = used_s()
    time.sleep(0.4)
    assert used_s() - before <= 0.05 * 0.4
    served.end()


def test_serve_refuses_a_port_that_is_taken(serving: Callable[..., Serving], capsys: Capture) -> None:
    served = serving("--port", "tcp:127.0.0.1:0")
    assert run(["serve", "--body", "kinematic", "--port", served.start["url"]]) == 1
    assert "another program listens there" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--body", "jelly"], 2, "p2os: there is no body 'jelly'"),
        (["--world", "nowhere"], 2, "p2os: no world 'nowhere'"),
        (["--world", "nowhere.toml"], 2, "p2os: no world 'nowhere.toml': there is no such file"),
        (["--world", "."], 2, "p2os: no world '.': that is a folder"),
        (["--flash", "none.toml"], 2, "p2os: cannot read none.toml: no such file or directory"),
        (["--errors", "none.toml"], 2, "p2os: cannot read none.toml: no such file or directory"),
        (
            ["--body", "kinematic", "--port", "tcp:127.0.0.1:0", "--control", "COM3"],
            2,
            "p2os: 'COM3' is not a port URL",
        ),
        (["--robot", "r2d2"], 2, "p2os: no robot model 'r2d2'"),
        (["--port", "COM3", "--body", "kinematic"], 2, "p2os: 'COM3' is not a port URL"),
        (["--port", "serial:COM3", "--body", "kinematic"], 1, "p2os: cannot open COM3: no such port"),
        (["--port", "loop:x", "--body", "kinematic"], 2, "p2os: loop:x exists only inside one program"),
        (["--firmware", "PSOS"], 2, "p2os: --firmware '"),
        (["--body", "kinematic", "--at", "here"], 2, "p2os: --at 'here' is no place"),
        (["--body", "kinematic", "--at", "1,nan"], 2, "p2os: --at '1,nan' is no place"),
        (["--body", "kinematic", "--at", "0,0", "--at", "1m,1m"], 2, "p2os: 2 places for 1 robots"),
        (["--body", "kinematic", "--robots", "2", "--aux", "1=pty:"], 2, "p2os: --aux is for one robot"),
        (["--fleet", "no.toml", "--world", "room"], 2, "p2os: --world beside --fleet"),
        (["--fleet", "no.toml"], 2, "p2os: cannot read no.toml"),
        (["--body", "kinematic", "--sync-limit", "10"], 2, "p2os: --sync-limit '10' has no unit"),
        (["--fleet", "no.toml", "--sync-limit", "10s"], 2, "p2os: --sync-limit beside --fleet"),
    ],
)
def test_serve_refuses_what_cannot_be(words: list[str], code: int, message: str, capsys: Capture) -> None:
    assert run(["serve", *words]) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = captured.err.splitlines()
    assert lines[0].startswith(message)
    assert lines[1].startswith("hint: ")


def test_serve_puts_a_fleet_into_one_world(tmp_path: Path, serving: Callable[..., Serving]) -> None:
    (tmp_path / "two.toml").write_text(
        'body = "kinematic"\n[[robot]]\nport = "tcp:127.0.0.1:0"\nat = [-1, 0.3]\n'
        '[[robot]]\naux = ["1=tcp:127.0.0.1:0"]\nat = [1, 0.3, 180]\n'
    )
    served = serving("--fleet", str(tmp_path / "two.toml"), body=())
    assert served.start["at"] == [-1.0, 0.3, 0.0]
    scan = subprocess.run(
        forked_p2os("monitor", served.start["url"], "--for", "300ms"), capture_output=True, text=True,
        timeout=TIMEOUT_S, check=False,
    )  # fmt: skip
    assert scan.returncode == 0
    code, err = served.end()
    assert code == 130
    assert "robot 1  client connected" in err
    assert "Traceback" not in err


def test_serve_lets_a_silent_client_go_at_its_limit(serving: Callable[..., Serving]) -> None:
    served = serving("--port", "tcp:127.0.0.1:0", "--sync-limit", "300ms")
    with socket.create_connection(("127.0.0.1", int(served.start["url"].rpartition(":")[2])), TIMEOUT_S) as silent:
        received = b"".join(iter(lambda: silent.recv(100), b""))
    assert received.endswith(b" had no open session for 0.3 s\r\n")
    code, err = served.end()
    assert code == 130
    assert "had no open session for 0.3 s" in err


@pytest.mark.skipif(not hasattr(fcntl, "F_SETPIPE_SZ"), reason="Linux alone has pipes of a chosen size")
def test_nobody_who_reads_its_lines_keeps_no_client_from_the_robot(serving: Callable[..., Serving]) -> None:
    """A terminal held with Ctrl-S, or a full pipe: the lines are lost, not the robot."""
    served = serving("--port", "tcp:127.0.0.1:0", "--speed", "20")
    assert served.process.stderr is not None
    fcntl.fcntl(served.process.stderr, fcntl.F_SETPIPE_SZ, 4096)
    address = "127.0.0.1", int(served.start["url"].rpartition(":")[2])
    with socket.create_connection(address, timeout=TIMEOUT_S) as client:
        for _ in range(500):  # each round tells "synchronised": some 12 KB, three times what the pipe holds
            for number in (0, 1, 2):
                client.sendall(Command(number).to_frame().to_bytes())
                assert client.recv(200)
    # That it ends, and stops its robot first, is the mechanism's to show as well.
    assert served.end()[0] == 130


def test_a_terminal_that_is_gone_is_left_and_keeps_nothing_from_stopping(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*_: object) -> None:
        raise OSError(5, "Input/output error")

    terminal = Terminal()
    monkeypatch.setattr(terminal, "is_ours", lambda: True)
    monkeypatch.setattr("select.select", lambda *_: ([0], [], []))
    monkeypatch.setattr("os.read", gone)
    with pytest.raises(HungUpError, match="the terminal is gone: Input/output error"):
        terminal.read()
    monkeypatch.setattr(sys, "stderr", SimpleNamespace(write=gone, flush=gone))
    with pytest.raises(HungUpError, match="the terminal is gone"):
        terminal.write(b"robot 1: status\n")
    serve._write("told to nobody\n")


def test_serve_without_pybullet_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    def missing(*_: object, **_named: object) -> None:
        raise MissingDependencyError("the bullet body needs pybullet", hint="go and get it")

    monkeypatch.setattr(fleet_order, "make_scene", missing)
    assert run(["serve"]) == 2
    assert capsys.readouterr().err == "p2os: the bullet body needs pybullet\nhint: go and get it\n"


def test_a_served_robot_tells_its_host_in_the_same_process(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    class Ending:
        def __init__(self, hosts: Any, **_: object) -> None:
            self.pioneer = hosts[0].pioneer

        def run(self, **_: object) -> None:
            self.pioneer.on_event(1_500_000_000, "opened", "")
            self.pioneer.on_event(1_600_000_000, "motors", "on")
            signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr(serve, "Fleet", Ending)
    assert main.run(["serve", "--body", "kinematic", "--port", "tcp:127.0.0.1:0"]) == 130
    captured = capsys.readouterr()
    assert "p2dx in room, kinematic body; Ctrl-C ends" in captured.out
    assert "     1.500 s  opened\n     1.600 s  motors: on\n" in captured.err
