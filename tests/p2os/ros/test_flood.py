"""A node under a flood of speeds: real processes on loopback; when STOP leaves is read off the line to the robot."""

import contextlib
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from p2os.pioneer.serve import served_pioneer
from p2os.protocol.commands import CommandNumber
from tests.p2os.client.served_robot import until
from tests.tools.forked_python import forked_python
from tools.hostile.watched import Lateness, NotedLine

PEER = Path(__file__).with_name("flood_peer.py")
DEADMAN_S = 0.5
#: What the node may take beyond the signal, or beyond its deadman, beside what this machine is late by itself.
MOST_S = 0.05
#: A message each 7 microseconds; the other transport's peer cannot send so fast.
RATES_HZ = {"zenoh": 150_000, "dds": 20_000}
#: The machine is shared: the best of so many counts; a backlog is there each time.
TRIES = 3
#: Nothing outlives it.
LONGEST_S = 30.0


MODULES = {"zenoh": "zenoh", "dds": "cyclonedds"}


def transports(first: str) -> pytest.MarkDecorator:
    """Try one transport in `make test`, and each in `make soak`."""
    rows = [pytest.param(name, marks=[] if name == first else pytest.mark.soak) for name in MODULES]
    return pytest.mark.parametrize("transport", rows)


@pytest.fixture(autouse=True)
def installed(transport: str) -> None:
    pytest.importorskip(MODULES[transport], reason="the extra ros is not installed")


@contextlib.contextmanager
def flooded(
    transport: str, domain: int
) -> Iterator[tuple[NotedLine, "subprocess.Popen[str]", "subprocess.Popen[str]"]]:
    """Serve a robot to a node that is flooded, and yield what passes on its line, the node and the flood."""
    verb = "EntryPoint('ros', 'p2os.cli.robots.ros', 'p2os.verbs')"
    with (
        socket.create_server(("127.0.0.1", 0)) as free,
        served_pioneer(world="room", body="kinematic") as url,
        contextlib.ExitStack() as held,
    ):
        _, host, port = str(url).split(":")
        seen = held.enter_context(contextlib.closing(NotedLine((host, int(port)))))
        where = f"127.0.0.1:{free.getsockname()[1]}" if transport == "zenoh" else f"{domain}"
        free.close()
        words = ["ros", f"tcp:127.0.0.1:{seen.port}", "--transport", transport, "--for", "30s"]
        words += ["--router", "--interface", where] if transport == "zenoh" else ["--domain", where]
        code = (
            "from importlib.metadata import EntryPoint; from p2os.cli import main; "
            f"main.verbs = lambda: [{verb}]; main.main({words!r})"
        )
        with subprocess.Popen([forked_python(), "-c", code], stdout=subprocess.PIPE, text=True) as node:
            assert node.stdout is not None
            assert "Ctrl-C ends" in node.stdout.readline()
            peer_words = [sys.executable, str(PEER), where, f"{RATES_HZ[transport]}", f"{LONGEST_S}"]
            with subprocess.Popen(peer_words, stdout=subprocess.PIPE, text=True) as peer:
                try:
                    until(lambda: seen.first(CommandNumber.VEL, 0.0), "a speed")
                    yield seen, node, peer
                finally:
                    peer.kill()
                    node.kill()


def stopped_after(seen: NotedLine, act: Callable[[], None]) -> tuple[float, float]:
    """Do something; return after how long STOP left, and how late this machine was meanwhile; seconds."""
    with Lateness() as lateness:
        began = time.monotonic()
        act()
        until(lambda: seen.first(CommandNumber.STOP, began), "STOP")
        at = seen.first(CommandNumber.STOP, began)
    assert at is not None
    return at - began, lateness.worst_s


@pytest.mark.slow
@transports("dds")
def test_the_deadman_of_a_flood_that_ends_stops_the_robot_as_soon_as_that_of_any_other(
    transport: str, domain: int
) -> None:
    with flooded(transport, domain) as (seen, _, peer):
        rows = []
        for _ in range(TRIES):
            driven = time.monotonic()
            peer.send_signal(signal.SIGCONT)
            until(lambda: time.monotonic() > driven + 1.0 and seen.first(CommandNumber.VEL, driven), "a speed")  # noqa: B023
            rows.append(stopped_after(seen, lambda: peer.send_signal(signal.SIGSTOP)))
            if rows[-1][0] <= DEADMAN_S + MOST_S + rows[-1][1]:
                return
    pytest.fail(f"STOP left after, and the machine was late by: {rows}")


@pytest.mark.slow
@transports("zenoh")
def test_a_signal_stops_the_robot_at_once_in_a_flood(transport: str, domain: int) -> None:
    rows = []
    for _ in range(TRIES):
        with flooded(transport, domain) as (seen, node, _):
            begun = time.monotonic() + 1.0
            until(lambda: time.monotonic() > begun)  # noqa: B023
            rows.append(stopped_after(seen, lambda: node.send_signal(signal.SIGTERM)))
            assert node.wait(timeout=5) == 130
        if rows[-1][0] <= MOST_S + rows[-1][1]:
            return
    pytest.fail(f"STOP left after, and the machine was late by: {rows}")
