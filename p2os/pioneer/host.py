"""A virtual Pioneer on a real line, in real time: what `p2os serve` runs.

This is the skin around `Pioneer`: it reads the clock, waits on descriptors and
moves bytes; every decision is the controller's. It serves one client at a time.
A second one is let in and closed at once, since a robot has one host. A client
that vanishes stops the robot at once and frees it for the next.

Virtual time is the clock's time less what was left out: the robot does not live
while nobody is connected and it stands still, nor through a pause of the machine
longer than `LONGEST_PAUSE_NS`, which is reported. So waiting costs no processor
time and a long wait no burst of steps.
"""

import contextlib
import select
import time
from collections.abc import Callable

from p2os.errors import TransportError
from p2os.pioneer.controller import Pioneer
from p2os.timing import NS_PER_MS, NS_PER_S, Nanos
from p2os.transport.ports import Listener, Transport

#: (robot's time in ns, what happened in a word or two, detail).
HostEvent = Callable[[Nanos, str, str], None]

#: chosen: three SIP cycles; a machine that lags more is reported rather than chased.
LONGEST_PAUSE_NS: Nanos = 300 * NS_PER_MS
#: chosen: well below the pause, and often enough for a robot that is connected but not open.
AWAKE_WAIT_S = 0.1
#: chosen: how soon `run` notices that it should end.
ASLEEP_WAIT_S = 0.5
#: chosen: how long the body lives on after its client has left, to come to rest.
SETTLE_NS: Nanos = 1 * NS_PER_S
#: chosen: how often a line without a descriptor is asked for bytes; one millisecond is a character at 9600 bit/s.
BLIND_POLL_S = 0.001


class Host:
    """Serves one virtual robot on one listener."""

    def __init__(
        self,
        pioneer: Pioneer,
        listener: Listener,
        *,
        on_event: HostEvent | None = None,
        clock: Callable[[], Nanos] = time.monotonic_ns,
    ) -> None:
        self.pioneer = pioneer
        self.listener = listener
        self._on_event = on_event
        self._clock = clock
        self._client: Transport | None = None
        self._now: Nanos = 0
        self._clock_read: Nanos = clock()
        self._settled_at: Nanos = 0

    @property
    def now(self) -> Nanos:
        """Return the robot's time, in nanoseconds."""
        return self._now

    @property
    def client(self) -> str | None:
        """Return who is connected, or None."""
        return None if self._client is None else self._client.description

    def run(self, *, until: Callable[[], bool] = lambda: False) -> None:
        """Serve until `until` says so or an exception (Ctrl-C) ends it; then let the client go.

        `until` is asked after every round: at least twice a second.
        """
        try:
            while not until():
                self.turn(ASLEEP_WAIT_S)
        finally:
            self.close()

    def turn(self, longest_wait_s: float) -> None:
        """Do what is due, then wait for the next deadline, bytes or client, at most so long."""
        self._read_clock()
        self._live()
        self._wait(longest_wait_s)
        self._read_clock()
        self._welcome()
        self._listen_to_client()

    def close(self) -> None:
        """Stop the robot, let the client go and give the port back."""
        self._drop_client("the host ends")
        self.listener.close()

    def _live(self) -> None:
        if self._is_asleep():
            return
        self.pioneer.advance_to(self._now)
        self._speak()

    def _speak(self) -> None:
        frames = self.pioneer.take_output()
        if self._client is None or not frames:
            return
        try:
            self._client.write(b"".join(frames))
        except TransportError as error:
            self._drop_client(str(error))

    def _wait(self, longest_s: float) -> None:
        """Sleep until something can be done."""
        waits = [longest_s]
        if not self._is_asleep():
            waits.append(AWAKE_WAIT_S)
            deadline = self.pioneer.next_deadline()
            if deadline is not None:
                waits.append(max(deadline - self._now, 0) / NS_PER_S)
        descriptors = []
        if (listening := self.listener.fileno()) is not None:
            descriptors.append(listening)
        if self._client is None:
            waits.append(longest_s if self.listener.poll_s is None else self.listener.poll_s)
        else:
            try:
                descriptors.append(self._client.fileno())
            except TransportError:
                waits.append(BLIND_POLL_S)
        if descriptors:
            select.select(descriptors, [], [], min(waits))
        else:
            time.sleep(min(waits))

    def _welcome(self) -> None:
        """Take a client that has come, or send it away when there is one."""
        if self._client is not None and self.listener.fileno() is None:
            return
        transport = self.listener.accept()
        if transport is None:
            return
        while self._listen_to_client():  # a client that has just left makes room for this one
            pass
        if self._client is not None:
            self._tell("client refused", f"{transport.description}: {self._client.description} is connected")
            transport.close()
            return
        self._client = transport
        self._tell("client connected", transport.description)

    def _listen_to_client(self) -> bool:
        """Take what the client says; return whether it said something."""
        if self._client is None:
            return False
        try:
            data = self._client.read()
        except TransportError as error:
            self._drop_client(str(error))
            return False
        if data:
            self.pioneer.receive(data, self._now)
            self._speak()
        return bool(data)

    def _drop_client(self, reason: str) -> None:
        if self._client is None:
            return
        client, self._client = self._client, None
        self.pioneer.hang_up(self._now)
        self.pioneer.take_output()
        with contextlib.suppress(TransportError):
            client.close()
        self._settled_at = self._now + SETTLE_NS
        self._tell("client gone", reason)

    def _is_asleep(self) -> bool:
        return self._client is None and self._now >= self._settled_at

    def _read_clock(self) -> None:
        """Bring the robot's time up to the clock's, leaving out what the robot need not live."""
        read = self._clock()
        passed, self._clock_read = read - self._clock_read, read
        if self._is_asleep():
            return
        if passed > LONGEST_PAUSE_NS:
            self._tell("lag", f"the machine paused for {passed / NS_PER_S:.1f} s; the robot's time leaves it out")
            return
        self._now += passed

    def _tell(self, what: str, detail: str) -> None:
        if self._on_event is not None:
            self._on_event(self._now, what, detail)
