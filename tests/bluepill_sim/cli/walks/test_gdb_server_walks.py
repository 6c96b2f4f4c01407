"""Both GDB servers at connections that a test writes down: what they read, send and wait for, as approved.

No socket is opened and no clock is read: a connection gives what it is drawn to, and time passes where one waits.
"""

import random
from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from unittest.mock import patch

from bluepill_sim.cli import gdb_server
from bluepill_sim.cli.gdb_server import GdbPort, GdbServer
from bluepill_sim.core import Watchpoint
from bluepill_sim.debug.machine import HaltReason, LoneChip, StopKind
from bluepill_sim.debug.packets import frame
from simbase.listening import WebClientError
from tests.bluepill_sim.machine import Machine
from tests.tools.suite.acted import Acted
from tests.tools.suite.approved import Trace, judge_of, said, tried

#: Counts, and prints "ok" by semihosting (SYS_WRITE0) each 40 rounds of 250.
PROGRAM = """\
mov32 r6, #0x20000800
mov32 r4, #0x6B6F
str r4, [r6, #0]
loop: movs r5, #40
more: movs r4, #250
turn: subs r4, #1
bne turn
subs r5, #1
bne more
movs r0, #4
mov r1, r6
bkpt #171
b loop
"""
#: What a look at a connection may find, besides bytes: nothing yet, or how reading it fails.
QUIET = None
FAILURES = (
    BlockingIOError(11, "no opening yet"),
    WebClientError("begins with an HTTP request"),
    ConnectionResetError(104, "reset"),
)
Given = bytes | Exception | None


class WrittenTime:
    """Connections, `select` and the clock of a server, all of them written down."""

    def __init__(self, calls: list[str], reading_ns: int = 10_000) -> None:
        self.calls, self.now_ns, self._reading_ns = calls, 10**9, reading_ns

    def select(self, ready: Sequence["WrittenLine"], _: object, __: object, wait_s: float) -> tuple[list[object], ...]:
        """Return what may be read; the time passes where that is nothing."""
        (one,) = ready
        is_ready = one.is_ready()
        self.calls.append(f"{one} {said(wait_s)} s: {is_ready}")
        if not is_ready:
            self.now_ns += round(wait_s * 1e9)
        return ([one] if is_ready else []), [], []

    def monotonic_ns(self) -> int:
        """Return the time; a reading takes some, too."""
        self.now_ns += self._reading_ns
        return self.now_ns


class WrittenLine:
    """A connection, or a listener for some.

    Args:
        calls: Where is noted what is done with it.
        name: Of it there.
        given: What looks at it find, one after the other; connections of a listener.
    """

    port = 3333

    def __init__(self, calls: list[str], name: str, given: Sequence["Given | WrittenLine"]) -> None:
        self._calls, self._name, self.given = calls, name, [*given]
        self.is_broken = False

    def __str__(self) -> str:
        return self._name

    def is_ready(self) -> bool:
        """Return whether something has come; a look passes over what says that nothing has."""
        if not self.given:
            raise ArithmeticError(f"{self} has nothing more to give")
        if self.given[0] is QUIET:
            self.given.pop(0)
            return False
        return True

    def accept(self) -> "tuple[Given | WrittenLine, str]":
        """Return the next connection."""
        return self.given.pop(0), "somebody"

    def recv(self, size: int) -> object:
        """Return the next bytes."""
        given = self.given.pop(0)
        self._calls.append(f"{self} recv {size}")
        if isinstance(given, Exception):
            raise given
        return given

    def sendall(self, data: bytes) -> None:
        """Note what is sent."""
        self._calls.append(f"{self} < {data.decode('latin-1')}")
        if self.is_broken:
            raise BrokenPipeError(32, "broken")

    def setsockopt(self, *words: int) -> None:
        """Note what is set."""
        self._calls.append(f"{self} sets {said([int(word) for word in words])}")

    def close(self) -> None:
        """Note it."""
        self._calls.append(f"{self} closed")


#: What a debugger asks, in its packets.
ASKED = (
    b"?", b"g", b"m20000800,4", b"s", b"c", b"c", b"vCont;c", b"vCont?", b"C05", b"S05", b"vCont;s:1", b"bs", b"Qx",
    b"QStartNoAckMode", b"H1", b"qRcmd,74696d65", b"vMustReplyEmpty",
)  # fmt: skip
#: How it leaves.
LEAVES = (b"D", b"k", b"vKill;1")


def coming_of(draw: random.Random) -> list[Given]:
    """Return what one read, or a cut packet, finds on a connection."""
    packet = frame(draw.choice(ASKED))
    cut = draw.randrange(1, len(packet))
    ways: tuple[list[Given], ...] = (
        [packet], [packet], [packet], [packet[:cut], packet[cut:]], [packet + b"\x03"], [packet, b"\x03"],
        [packet, QUIET, QUIET, QUIET, b"\x03"], [b"+", packet], [b"-"], [b"$g#00"], [packet[:-1] + b"x-"], [QUIET],
        [b"\x03"], [packet + frame(b"s")],
    )  # fmt: skip
    return draw.choice(ways)


def lines_of(draw: random.Random, calls: list[str], count: int) -> list[Given | WrittenLine]:
    """Return connections of debuggers that leave in each way, and what is drawn between them."""
    found: list[Given | WrittenLine] = []
    for number in range(count):
        given: list[Given] = []
        for _ in range(draw.randrange(1, 9)):
            given += coming_of(draw)
        ends: list[Given] = [b"\x03", b"\x03", frame(draw.choice(LEAVES))]
        ways: tuple[list[Given], ...] = ([b""], [FAILURES[1]], [FAILURES[2]], [FAILURES[0], b""], ends, ends)
        given += draw.choice(ways)
        if draw.random() < 0.15:  # a browser shows itself by its first bytes
            given = [FAILURES[1]]
        made = WrittenLine(calls, f"line {number}", [*given, b"", b""])
        made.is_broken = draw.random() < 0.1
        found += [QUIET] * draw.randrange(2) + [made]
    return found


def served(draw: random.Random) -> Iterator[str]:
    """Serve debuggers one after the other at a machine that only they run."""
    for turn in range(13):
        calls: list[str] = []
        written, board = WrittenTime(calls, 3_000_000 if turn % 4 == 2 else 10_000), Machine(PROGRAM, {}).deafen().board
        listener = WrittenLine(calls, "port", lines_of(draw, calls, 4))
        with (
            patch.object(gdb_server, "select", written),
            patch.object(gdb_server, "time", written),
            patch.object(gdb_server, "listen_tcp", Acted(calls, listen_tcp=[listener]).listen_tcp),
        ):
            is_paced, once = turn % 2 == 0, turn % 3 == 0
            server = GdbServer(LoneChip(board), 0, is_paced=is_paced, on_wait=Acted(calls).waits)
            if turn % 4:
                server.on_print = Acted(calls).prints
            found = tried(server.serve, once=once)
            breakpoints = board.chip.engine.breakpoints, board.chip.processor.halts_on_bkpt
            server.close()
        yield said([server.port, is_paced, once, found, len(listener.given), board.now_ns, written.now_ns, breakpoints])
        yield from _pieces(calls)


class Shared:
    """A machine that another one runs: what is asked for is noted, and answered at once by what is drawn."""

    read_only = ""

    def __init__(self, calls: list[str], draw: random.Random) -> None:
        self.machine, self._calls, self._draw = LoneChip(Machine(PROGRAM, {}).deafen().board), calls, draw

    def _later(self, name: str) -> HaltReason | None:
        self._calls.append(name)
        return HaltReason(StopKind.STEP) if self._draw.random() < 0.2 else None

    def go_on(self) -> HaltReason | None:
        """Note it."""
        return self._later("go on")

    def step(self) -> HaltReason | None:
        """Note it."""
        return self._later("step")

    def step_back(self) -> HaltReason | None:
        """Note it."""
        return self._later("step back")

    def go_back(self) -> HaltReason | None:
        """Note it."""
        return self._later("go back")

    def set_point(self, point: int | Watchpoint, *, is_set: bool) -> None:
        """Note it."""
        self._calls.append(f"point {said(point)} {is_set}")

    def changed(self) -> None:
        """Note it."""
        self._calls.append("changed")

    def attached(self) -> None:
        """Note it."""
        self._calls.append("attached")

    def interrupted(self) -> None:
        """Note it."""
        self._calls.append("interrupted")

    def left(self, *, was_killed: bool, is_lost: bool) -> None:
        """Note it."""
        self._calls.append(f"left {was_killed} {is_lost}")


def shared(draw: random.Random) -> Iterator[str]:
    """Look at the port of a machine that another one runs, and answer when it stands."""
    for _ in range(12):
        calls: list[str] = []
        written, target = WrittenTime(calls), Shared(calls, draw)
        listener = WrittenLine(calls, "port", [*lines_of(draw, calls, 3), *[QUIET] * 60])
        with (
            patch.object(gdb_server, "select", written),
            patch.object(gdb_server, "listen_tcp", Acted(calls, listen_tcp=[listener]).listen_tcp),
        ):
            port = GdbPort(5)
            for _ in range(34):
                if draw.random() < 0.85:
                    found = tried(port.serve, target, draw.choice((0.0, 0.25, 2.0)))
                else:
                    stop = HaltReason(draw.choice([*StopKind]), 0x2000_0800, 3)
                    found = tried(port.stopped, stop, draw.choice(("", "paused")))
                calls.append(f"= {found}")
            port.close()
        yield said([port.port, len(listener.given), written.now_ns])
        yield from _pieces(calls)


def _pieces(calls: list[str]) -> Iterator[str]:
    for begin in range(0, len(calls), 20):
        yield "\n".join(calls[begin : begin + 20])


def opened(_: random.Random) -> Iterator[str]:
    """Ask for ports that are to be had, and for others."""
    listener = SimpleNamespace(port=1)
    for given in (listener, OSError(98, "in use"), OverflowError("port must be 0-65535")):
        calls: list[str] = []
        system = Acted(calls, listen_tcp=[given, given])
        with patch.object(gdb_server, "listen_tcp", system.listen_tcp):
            yield tried(lambda: GdbPort(9).port)
            yield tried(lambda: GdbServer(LoneChip(Machine("nop", {}).board), 65536).port)
        yield said(calls)


TRACES: dict[str, Trace] = {"served": served, "shared": shared, "opened": opened}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
