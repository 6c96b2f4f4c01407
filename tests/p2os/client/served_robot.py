"""A virtual robot served on a real line in a thread, for tests of the client's I/O layers; every wait is bounded.

In real time, or on a `VirtualClock` that its client has too: then `ServedRobot.until` waits.
"""

import threading
import time
from collections.abc import Callable

from p2os.client.settings import ClientSettings
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.serve.host import Host
from p2os.protocol.commands import Command, CommandNumber, enable, stop, vel
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.times import CYCLE_NS
from p2os.transport import Loops, listen_url, open_url
from p2os.transport.ports import HungUpError, Transport
from p2os.transport.virtual_clock import VirtualClock
from p2os.transport.wall_clock import Clock, wall_clock
from simbase.timing import NS_PER_MS, Nanos
from tests.p2os.client.client_rig import new_pioneer

#: A bound on every wait; reached only when something is broken.
TIMEOUT_S = 30.0
#: chosen: how often a robot in real time reports, five times as often as others, for tests wait for its packets.
QUICK_CYCLE_NS = 20 * NS_PER_MS
#: Robots of tests are never open already.
QUICK = ClientSettings(listen_ns=NS_PER_MS)
#: What a client says last.
CLOSING_COMMANDS = [stop(), vel(0), enable(False), Command(CommandNumber.CLOSE)]


def until(is_so: Callable[[], object], what: str = "it") -> None:
    """Wait until something is so."""
    end = time.monotonic() + TIMEOUT_S
    while not is_so():
        assert time.monotonic() < end, f"{what} never came to be"
        time.sleep(0.002)


class ServedRobot:
    """A host in a thread."""

    def __init__(
        self, url: str = "tcp:127.0.0.1:0", pioneer: Pioneer | None = None, *,
        speed: float = 1.0, clock: Clock = wall_clock,
    ) -> None:  # fmt: skip
        period_ns = CYCLE_NS if isinstance(clock, VirtualClock) else QUICK_CYCLE_NS
        self.pioneer = pioneer or new_pioneer(sip_period_ns=period_ns)
        self.clock = clock
        #: What the robot is to do between two turns of its host: called once, in the host's thread; what one of them
        #: adds, after the next turn.
        self.requests: list[Callable[[Pioneer, Nanos], None]] = []
        self._loops = Loops()
        listener = listen_url(url, loops=self._loops)
        self.url = listener.description
        self.reported: list[str] = []
        self._host = Host(
            self.pioneer, listener, on_event=lambda _now, what, _detail: self.reported.append(what),
            speed=speed, clock=clock,
        )  # fmt: skip
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        if isinstance(clock, VirtualClock):
            clock.add(self._thread)

    def open(self, url: str) -> Transport:
        """Open the line to it, also one inside of this process."""
        return open_url(url, loops=self._loops)

    def _serve(self) -> None:
        try:
            while not self._end.is_set():
                self._host.turn(0.02)
                for request in tuple(self.requests):
                    request(self.pioneer, self._host.now)
                    self.requests.remove(request)
        finally:
            self._host.close()

    @property
    def virtual(self) -> VirtualClock:
        """Its clock, where that is a virtual one."""
        assert isinstance(self.clock, VirtualClock)
        return self.clock

    @property
    def wheels_mps(self) -> tuple[float, float]:
        state = self.pioneer.state
        return state.left_setpoint_mps, state.right_setpoint_mps

    @property
    def is_moving(self) -> bool:
        return self.wheels_mps != (0.0, 0.0)

    def do_in_thread(self, call: Callable[[Pioneer, Nanos], None]) -> None:
        """Have something done to the robot, and wait until it is."""
        self.requests.append(call)
        self.until(lambda: not self.requests)

    def until(self, is_so: Callable[[], object], what: str = "it") -> None:
        """Wait until something is so, on the robot's clock."""
        if isinstance(self.clock, VirtualClock):
            self.clock.until(is_so)
        else:
            until(is_so, what)

    def close(self) -> None:
        self._end.set()
        self.until(lambda: not self._thread.is_alive(), "the end of the host's thread")


class Recorder:
    """Opens lines and keeps what is written to them."""

    def __init__(self, opener: Callable[[str], Transport] = open_url) -> None:
        self._open = opener
        self.lines: list[RecordedLine] = []

    def __call__(self, url: str) -> Transport:
        self.lines.append(RecordedLine(self._open(url)))
        return self.lines[-1]

    @property
    def sent(self) -> list[Command]:
        """All commands, on all lines."""
        decoder = Decoder()
        for line in self.lines:
            decoder.receive(bytes(line.written), 0)
        found = []
        while (item := decoder.next_item()) is not None:
            assert isinstance(item, Frame)
            found.append(Command.from_frame(item))
        return found


class RecordedLine:
    """A transport and what went through it."""

    def __init__(self, inner: Transport) -> None:
        self.inner = inner
        self.description = inner.description
        self.written = bytearray()
        #: Nothing passes any more, and nobody is notified.
        self.is_mute = False
        #: The next read finds that the line has gone.
        self.is_broken = False

    def read(self) -> bytes:
        if self.is_broken:
            raise HungUpError(f"{self.description} vanished")
        data = self.inner.read()
        return b"" if self.is_mute else data

    def write(self, data: bytes) -> None:
        self.written += data
        if not self.is_mute:
            self.inner.write(data)

    def fileno(self) -> int:
        return self.inner.fileno()

    def set_baud(self, baud: int) -> None:
        self.inner.set_baud(baud)

    def close(self) -> None:
        self.inner.close()
