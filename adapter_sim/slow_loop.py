"""An adapter whose program is slow: it looks and acts only every so often.

Theory of operation. The model's own loop takes no time. Here a pass begins each
`pass_ns`; bytes that come in between wait in the UART, pins are read as they stand
when the pass begins, and everything that was due since the last pass happens now:
hardware can only answer for the present.

Invariant: nothing leaves, and no pin changes, between two passes.
"""

from collections.abc import Callable
from typing import Protocol

from adapter_sim.ports import PinBank
from adapter_sim.states import AdapterState, AdapterStatus
from p2os.errors import UsageError
from p2os.timing import Nanos, Reached


class AnyAdapter(Protocol):
    """What a loop runs: the model, or the firmware's core in its place."""

    @property
    def state(self) -> AdapterState:
        """Return what the adapter is doing."""
        ...

    @property
    def status(self) -> AdapterStatus:
        """Return what the adapter knows."""
        ...

    def receive(self, data: bytes, now: Nanos) -> None:
        """Take bytes that the line has delivered at `now`."""
        ...

    def take_output(self) -> list[bytes]:
        """Return the frames to send, and forget them."""
        ...

    def next_deadline(self) -> Nanos | None:
        """Return when it next wants to act."""
        ...

    def advance_to(self, limit: Nanos) -> Reached:
        """Act on everything due up to `limit`."""
        ...


class SlowLoop:
    """A slow program around an adapter.

    Args:
        make: Makes the adapter with the pins that it is given.
        pins: Its ends of the wires.
        pass_ns: From the begin of a pass to the next one.
        now: When power comes.

    Raises:
        UsageError: A pass that takes no time is no slow loop.
    """

    def __init__(self, make: Callable[[PinBank], AnyAdapter], pins: PinBank, pass_ns: Nanos, now: Nanos = 0) -> None:
        if pass_ns <= 0:
            raise UsageError(f"a pass of {pass_ns} ns is no slow loop", hint="use the adapter itself")
        self._pins = _PresentPins(pins, now)
        self.adapter = make(self._pins)
        self._pass_ns = pass_ns
        self._next_pass = now
        self._waiting = bytearray()

    @property
    def state(self) -> AdapterState:
        """Return what the adapter is doing."""
        return self.adapter.state

    @property
    def status(self) -> AdapterStatus:
        """Return what the adapter knows."""
        return self.adapter.status

    def receive(self, data: bytes, now: Nanos) -> None:
        """Let bytes wait for the next pass."""
        self.advance_to(now - 1)
        self._waiting += data

    def take_output(self) -> list[bytes]:
        """Return the frames to send, and forget them."""
        return self.adapter.take_output()

    def next_deadline(self) -> Nanos:
        """Return when the next pass begins."""
        return self._next_pass

    def advance_to(self, limit: Nanos) -> Reached:
        """Do every pass up to and including `limit`."""
        while self._next_pass <= limit:
            now = self._pins.now = self._next_pass
            if self._waiting:
                self.adapter.receive(bytes(self._waiting), now)
                self._waiting.clear()
            self.adapter.advance_to(now)
            self._next_pass = now + self._pass_ns
        return Reached(limit)


class _PresentPins:
    """A pin bank that answers for the present only, whatever instant is meant."""

    def __init__(self, pins: PinBank, now: Nanos) -> None:
        self._pins = pins
        self.now = now

    def read(self, signal: str, at: Nanos) -> bool:  # noqa: ARG002 - what the hardware cannot do
        return self._pins.read(signal, self.now)

    def write(self, signal: str, high: bool | None, now: Nanos) -> None:  # noqa: ARG002
        self._pins.write(signal, high, self.now)
