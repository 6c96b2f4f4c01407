"""What is attacked, row by row: a verb as its users start it, and how its wheels are seen from outside."""

import contextlib
import re
import socket
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tools.hostile.watched import HOST, LIMIT_S, NotedLine, RunningVerb, SteadyClient, free_ports, until

MOTORS = Path(__file__).parents[2] / "robot_bench/firmware/motors.elf"
FLOOD_PEER = Path(__file__).parents[2] / "tests/p2os/ros/flood_peer.py"
#: How a robot that is served says that it is there.
SERVED = "Ctrl-C ends"
WHEELS = re.compile(r"wheels (\S+) (\S+) m/s")


@dataclass(kw_only=True)
class AttackedVerb:
    """A verb that runs, and what of it can be seen."""

    program: RunningVerb
    #: Where a client of good will finds its robot; nothing: it has none, or is a client itself.
    robot: int | None = None
    #: Where the verb's own commands to its robot pass.
    line: NotedLine | None = None
    #: Somebody who has the session.
    client: SteadyClient | None = None
    #: Whether it prints how fast wheels turn.
    prints_wheels: bool = False
    #: What a debugger says first has to be answered on this port.
    debugger: int | None = None
    #: A neighbour that asks for motion by right, as long as it runs.
    asking: RunningVerb | None = None
    #: How it has to end by itself, as a text that it prints; else it runs until it is ended.
    ends: str = ""
    _read: int = field(default=0, init=False)

    def turned(self, since: float) -> list[str]:
        """Return what says that wheels turned since a moment which nobody with a right to it had asked for."""
        found = []
        printed = self.program.printed
        rows, self._read = WHEELS.findall(printed, self._read), len(printed)
        if self.prints_wheels and (turning := [row for row in rows if {*map(float, row)} != {0.0}]):
            found.append(f"wheels at {' '.join(turning[0])} m/s")
        if self.client is not None and self.client.turned(since):
            found.append("the client saw its wheels turn")
        if self.line is not None and self.asking is None and (count := self.line.moving(since)):
            found.append(f"{count} commands to move went to the robot")
        return found


@contextlib.contextmanager
def _program(*words: str, ready: str = SERVED) -> Iterator[RunningVerb]:
    program = RunningVerb(words, ready=ready)
    try:
        yield program
    finally:
        program.end()


@contextlib.contextmanager
def _robot(p2os: str) -> Iterator[NotedLine]:
    """Yield a line to a robot that is served, which nobody attacks."""
    (port,) = free_ports(1)
    with (
        _program(p2os, "serve", "--port", f"tcp:{HOST}:{port}", "--body", "kinematic"),
        contextlib.closing(NotedLine((HOST, port))) as line,
    ):
        yield line


@contextlib.contextmanager
def _held(port: int, *, is_held: bool) -> Iterator[SteadyClient | None]:
    with contextlib.ExitStack() as owned:
        yield owned.enter_context(contextlib.closing(SteadyClient(port))) if is_held else None


@contextlib.contextmanager
def serve(p2os: str, *, is_held: bool) -> Iterator[AttackedVerb]:
    """A robot with an operator's line and an AUX port."""
    port, control, aux = free_ports(3)
    words = ("--control", f"tcp:{HOST}:{control}", "--aux", f"1=tcp:{HOST}:{aux}", "--status", "100ms")
    with (
        _program(p2os, "serve", "--port", f"tcp:{HOST}:{port}", "--body", "kinematic", *words) as program,
        _held(port, is_held=is_held) as client,
    ):
        yield AttackedVerb(program=program, robot=port, client=client, prints_wheels=True)


@contextlib.contextmanager
def fleet(p2os: str, *, is_held: bool) -> Iterator[AttackedVerb]:
    """Three robots in one room; held: each by a client, of whom the first is looked at."""
    port = free_ports(3)[0]
    words = ("--robots", "3", "--body", "kinematic", "--status", "100ms")
    with contextlib.ExitStack() as owned:
        program = owned.enter_context(_program(p2os, "serve", "--port", f"tcp:{HOST}:{port}", *words))
        client, *_ = [owned.enter_context(_held(each, is_held=is_held)) for each in range(port, port + 3)]
        yield AttackedVerb(program=program, robot=port, client=client, prints_wheels=True)


@contextlib.contextmanager
def sniff(p2os: str, *, is_held: bool) -> Iterator[AttackedVerb]:
    """A bridge before a robot."""
    (port,) = free_ports(1)
    with (
        _robot(p2os) as line,
        _program(
            p2os, "sniff", f"tcp:{HOST}:{line.port}", "--listen", f"tcp:{HOST}:{port}", "--quiet", ready=f"{port}"
        ) as program,
        _held(port, is_held=is_held) as client,
    ):
        yield AttackedVerb(program=program, robot=port, line=line, client=client)


@contextlib.contextmanager
def ros_zenoh(p2os: str, *, is_held: bool) -> Iterator[AttackedVerb]:
    """A node over zenoh that is its own router; held: a peer floods it with speeds."""
    (port,) = free_ports(1)
    words = ("--transport", "zenoh", "--router", "--interface", f"{HOST}:{port}")
    with _node(p2os, words, f"{HOST}:{port}", 150_000, is_held=is_held) as target:
        yield target


@contextlib.contextmanager
def ros_dds(p2os: str, *, is_held: bool) -> Iterator[AttackedVerb]:
    """A node over DDS; held: a peer floods it with speeds."""
    domain = str(100 + free_ports(1)[0] % 100)
    with _node(p2os, ("--domain", domain), domain, 20_000, is_held=is_held) as target:
        yield target


@contextlib.contextmanager
def _node(p2os: str, words: tuple[str, ...], where: str, rate_hz: int, *, is_held: bool) -> Iterator[AttackedVerb]:
    python = Path(p2os).with_name("python")  # with the transport's packages, as the node
    with contextlib.ExitStack() as owned:
        line = owned.enter_context(_robot(p2os))
        program = owned.enter_context(_program(p2os, "ros", f"tcp:{HOST}:{line.port}", *words))
        asking = None
        if is_held:
            interpreter = str(python) if python.exists() else sys.executable
            asking = owned.enter_context(_program(interpreter, str(FLOOD_PEER), where, str(rate_hz), "60", ready=""))
            until(lambda: line.moving() > 0)
        yield AttackedVerb(program=program, line=line, asking=asking)


@contextlib.contextmanager
def mcu_debug(p2os: str, **_: bool) -> Iterator[AttackedVerb]:
    """A stub of GDB on the chip alone."""
    (port,) = free_ports(1)
    with _program(p2os, "mcu", "debug", str(MOTORS), "--port", str(port), ready=str(port)) as program:
        yield AttackedVerb(program=program, debugger=port)


@contextlib.contextmanager
def run_gdb(p2os: str, **_: bool) -> Iterator[AttackedVerb]:
    """A program that waits for GDB before it drives a robot."""
    (port,) = free_ports(1)
    with _robot(p2os) as line:
        words = ("run", "motors", "--gdb", str(port), "--port", f"tcp:{HOST}:{line.port}", "--yes")
        with _program(p2os, *words, ready="waiting for GDB") as program:
            yield AttackedVerb(program=program, line=line, debugger=port)


@contextlib.contextmanager
def run_foxglove(p2os: str, **_: bool) -> Iterator[AttackedVerb]:
    """A run that is shown live, and has to come to its verdict."""
    (port,) = free_ports(1)
    words = ("run", "motors", "--body", "kinematic", "--foxglove", str(port))
    with _program(p2os, *words, ready=f"{port}") as program:
        yield AttackedVerb(program=program, ends="PASSED")


@contextlib.contextmanager
def mcu_can(p2os: str, **_: bool) -> Iterator[AttackedVerb]:
    """A chip whose CAN is a UDP port."""
    (port,) = free_ports(1)
    words = ("mcu", "run", str(MOTORS), "--can", f"udp:{HOST}:{port}", "--for", "60s")
    with _program(p2os, *words, ready="motors") as program:
        yield AttackedVerb(program=program)


#: Name → how it is started; free, or held by a client of good will.
TARGETS = {
    "serve": serve,
    "fleet": fleet,
    "sniff": sniff,
    "ros-zenoh": ros_zenoh,
    "ros-dds": ros_dds,
    "run-gdb": run_gdb,
    "run-foxglove": run_foxglove,
    "mcu-debug": mcu_debug,
    "mcu-can": mcu_can,
}
#: Of these somebody may have the session (or ask for motion), and is not disturbed.
HELD = ("serve", "fleet", "sniff", "ros-zenoh", "ros-dds")


def answers_gdb(port: int) -> bool:
    """Tell whether a stub of GDB answers its first question."""
    ends = time.monotonic() + LIMIT_S / 3
    while time.monotonic() < ends:
        with contextlib.suppress(OSError), socket.create_connection((HOST, port), 2.0) as debugger:
            debugger.settimeout(2.0)
            debugger.sendall(b"+$qSupported#37")
            if b"PacketSize" in debugger.recv(4096):
                return True
        time.sleep(0.1)
    return False
