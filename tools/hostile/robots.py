"""The neighbour is the robot: a verb has connected to somebody who is none, or who goes at any byte.

A real robot is served behind; what it says is passed on as a row of `ROBOTS` does. A verb has to end with one line and
a code of its own; a command to move is followed by STOP wherever the line still carries.
"""

import contextlib
import random
import select
import socket
import struct
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from tools.hostile import packets
from tools.hostile.watched import HOST, LIMIT_S, RobotProxy, RunningVerb, free_ports

#: Verbs that connect to a robot, with what a user types; each would end by itself in a few seconds.
CLIENTS = {
    "info": ("info",),
    "monitor": ("monitor", "--for", "2s", "--json"),
    "drive": ("drive", "--forward", "0.1m"),
    "ros": ("ros", "--domain", "173", "--for", "2s"),
}
#: How a verb may end: done; failed, with a reason.
CODES = (0, 1)
#: Bytes of a robot's answers up to the first information packets.
SESSION_BYTES = 250


@dataclass(frozen=True)
class FalseRobot:
    """How what a robot says is passed on."""

    doc: str
    #: What a chunk becomes.
    chunk: Callable[[bytes, random.Random], bytes] = lambda data, _: data
    #: After how many bytes of a connection the line is cut, by a draw; none: never.
    cut: Callable[[random.Random], int | None] = lambda _: None
    #: How many times each chunk is said.
    times: int = 1
    #: Said at once, in place of a robot.
    instead: bytes | None = None
    #: Whether commands reach the robot's wheels: STOP has to be the last of them.
    carries: bool = True


def _noisy(data: bytes, draw: random.Random) -> bytes:
    """Flip a bit in each tenth byte, on average."""
    return bytes(each ^ (1 << draw.randrange(8)) if draw.random() < 0.1 else each for each in data)


ROBOTS = {
    "silent": FalseRobot("takes the connection and says nothing", lambda _data, _: b""),
    "web-server": FalseRobot("is a web server", instead=b"HTTP/1.1 400 Bad Request\r\n\r\n<html>" + bytes(5000)),
    "tls-server": FalseRobot("is a server of TLS", instead=b"\x15\x03\x03\x00\x02\x02\x46"),
    "random": FalseRobot("says random bytes", lambda data, draw: draw.randbytes(len(data))),
    "noisy": FalseRobot("has one byte in ten wrong", _noisy),
    "repeating": FalseRobot("says each chunk two hundred times", times=200),
    "cut": FalseRobot("goes at a byte of its answers", cut=lambda draw: draw.randrange(SESSION_BYTES), carries=False),
}  # fmt: skip


class HostileRobot(RobotProxy):
    """Passes on what a robot behind says as a row says."""

    def __init__(self, robot: tuple[str, int], passing: FalseRobot, draw: random.Random) -> None:
        self._passing, self._draw = passing, draw
        self.commands: list[bytes] = []
        super().__init__(robot)

    def _carry(self, client: socket.socket, robot: socket.socket) -> None:
        passing, reader, left = self._passing, packets.OutsidersReader(), self._passing.cut(self._draw)
        client.settimeout(LIMIT_S)
        if passing.instead is not None:
            client.sendall(passing.instead)
        while not self._is_over.is_set():
            for each in select.select([client, robot], [], [], 0.2)[0]:
                if not (data := each.recv(65536)):
                    return
                if each is client:
                    self.commands += reader.take(data)
                    if passing.instead is None:
                        robot.sendall(data)
                    continue
                said = passing.chunk(data, self._draw) * passing.times
                if left is not None and len(said) >= left:
                    client.sendall(said[:left])
                    if self._draw.random() < 0.5:
                        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                    return
                left = left if left is None else left - len(said)
                client.sendall(said)


def faults_of(p2os: str, verb: str, name: str, draw: random.Random) -> Iterator[str]:
    """Yield what is wrong with how a verb takes such a robot."""
    (port,), passing = free_ports(1), ROBOTS[name]
    served = RunningVerb((p2os, "serve", "--port", f"tcp:{HOST}:{port}", "--body", "kinematic"), ready="Ctrl-C ends")
    try:
        with contextlib.closing(HostileRobot((HOST, port), passing, draw)) as robot:
            first, *rest = CLIENTS[verb]
            words, began = (p2os, first, f"tcp:{HOST}:{robot.port}", *rest), time.monotonic()
            try:
                done = subprocess.run(words, capture_output=True, text=True, timeout=LIMIT_S, check=False)
            except subprocess.TimeoutExpired:
                yield f"it had not ended after {time.monotonic() - began:.0f} s"
                return
            if done.returncode not in CODES:
                yield f"it ended with {done.returncode}"
            if done.returncode and "p2os: " not in done.stderr:
                yield f"it gave no reason: {done.stderr.strip()[-200:]!r}"
            if "Traceback" in done.stderr or "this is a bug" in done.stderr:
                yield f"it printed {done.stderr.strip()[-200:]!r}"
            moving = [at for at, each in enumerate(robot.commands) if packets.moves(each)]
            if passing.carries and moving and packets.STOP not in {each[0] for each in robot.commands[moving[-1] :]}:
                yield "a command to move was the last, without STOP"
    finally:
        served.end()
