"""The table of `tools/peers.py`: our own client's row, a peer that is not there, and one that fails."""

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from p2os.robots.parameters import known_robots
from tests.tools.forked_python import forked_python
from tools import peers
from tools.peers import PEERS, PeerProgram, main

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and terminals are Unix's")


@pytest.fixture
def _forked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fork what the table starts by Python's own name."""
    ours, forked = sys.executable, forked_python()

    def of_forked(peer: PeerProgram) -> PeerProgram:
        commands = [[forked if word == ours else word for word in words] for words in peer.commands]
        return replace(peer, commands=tuple(map(tuple, commands)))

    monkeypatch.setattr(peers, "PEERS", tuple(map(of_forked, PEERS)))
    monkeypatch.setattr(sys, "executable", forked)


@pytest.mark.slow
@pytest.mark.usefixtures("_forked")
def test_our_own_client_drives_is_killed_and_drives_again(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--json", "--peer", "p2os drive"]) == 0
    (row,) = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert row["problem"] == ""
    assert row["beside"] == "told busy"
    assert 2.0 < float(row["stands"].split()[0]) < 5.0  # the watchdog, and 0.2 m/s at 0.3 m/s2
    assert row["again"].endswith(" s")


def test_a_peer_that_is_not_there_is_skipped_aloud(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--peer", "mine=/no/such/program {host}"]) == 0
    reported = capsys.readouterr()
    assert "mine: skipped: no /no/such/program" in reported.err
    assert reported.out.splitlines()[-1] == "not on PATH: mine"
    assert [peer.name for peer in PEERS if not peer.commands] == []


@pytest.mark.slow
@pytest.mark.usefixtures("_forked")
def test_a_peer_that_never_drives_fails(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--peer", f"idle={sys.executable} -c pass"]) == 1
    assert "never drove: it ended with code 0" in capsys.readouterr().out


#: As roscore does with rosmaster and rosout: another session, and whoever started it is gone.
DAEMON = """import os, sys
if os.fork():
    os._exit(0)
os.setsid()
if os.fork():
    os._exit(0)
import pathlib, time
pathlib.Path("daemon").write_text(str(os.getpid()))
time.sleep(60)
"""


def test_nothing_that_a_peer_has_started_is_left(tmp_path: Path) -> None:
    beside = subprocess.Popen(["sleep", "60"])
    try:
        peer = PeerProgram(name="daemon", needs=(), commands=((sys.executable, "-c", DAEMON),))
        served = cast("peers.Served", SimpleNamespace(line_url="tcp:127.0.0.1:1"))
        with peers._started(replace(peer, needs=("sleep",)), served, tmp_path):
            file, end = tmp_path / "daemon", time.monotonic() + 10
            while not (file.is_file() and file.read_text()) and time.monotonic() < end:
                time.sleep(0.01)
            pid = int(file.read_text())
            assert Path(f"/proc/{pid}").exists()
        assert not Path(f"/proc/{pid}").exists()
        assert beside.poll() is None
    finally:
        beside.kill()
        beside.wait()


@pytest.mark.parametrize("name", ["nobody", "empty="])
def test_a_name_that_means_nothing_is_wrong_usage(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--peer", name])
    assert ended.value.code == 2
    assert name.split("=", maxsplit=1)[0] in capsys.readouterr().err


def test_every_row_talks_to_the_robot_over_one_line() -> None:
    for peer in PEERS:
        words = [word for command in peer.commands for word in command] + [text for _, text in peer.files]
        assert any("{line}" in word or "{url}" in word or "{port}" in word for word in words), peer.name
        assert 0 <= peer.killed < len(peer.commands)


def test_a_robot_that_nobody_knows_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--robot", "r2d2"])
    assert ended.value.code == 2
    assert "no robot 'r2d2'" in capsys.readouterr().err


def test_each_peer_meets_each_robot_that_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--peer", "mine=/no/such/program {host}", "--robot", "all"]) == 0
    reported = capsys.readouterr().out.split("not on PATH:")[1]
    assert all(f"mine, {model}" in " ".join(reported.split()) for model in known_robots())
