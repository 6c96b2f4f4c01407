"""Fault injection around an adapter, for tests: its pins, its supply, the speed of its loop.

Both wrappers serve the model and the firmware's core alike, and the adapter knows
nothing of them. `FaultyPins` stands between an adapter and its pin bank and changes
what is read and what arrives at the far side. `SlowLoop` stands around an adapter
whose program is slow: a pass begins each `pass_ns`; bytes that come in between wait in
the UART, pins are read as they stand when the pass begins, and everything that was due
since the last pass happens now, for hardware can only answer for the present.

Not here: faults of the serial line (the bench's own), noise in volts.

Invariant: without faults everything passes as it is; around a slow loop nothing
leaves, and no pin changes, between two passes.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from adapter_sim.adapter import AdapterState, AdapterStatus
from adapter_sim.pinout import Direction, Pinout, WireRole
from adapter_sim.pins import PinBank
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, Nanos, Reached

#: The detector resets the chip however short the dip; a reset is looked for every sample, so this long it lasts here.
LEAST_BROWN_OUT_NS: Nanos = 4 * NS_PER_MS


@dataclass(frozen=True, slots=True, kw_only=True)
class StuckPin:
    """A wire that stands at one level: a short, a cold joint, a dead driver.

    `until` None is for good. A stuck output takes effect at the adapter's next sample.
    """

    signal: str
    high: bool
    since: Nanos = 0
    until: Nanos | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Glitch:
    """An input that reads inverted for a while: crosstalk, a bouncing plug."""

    signal: str
    at: Nanos
    span_ns: Nanos


@dataclass(frozen=True, slots=True, kw_only=True)
class BrownOut:
    """A supply that dips: the ESP32 is held in reset, and boots anew after it."""

    at: Nanos
    span_ns: Nanos = LEAST_BROWN_OUT_NS


Fault: TypeAlias = StuckPin | Glitch | BrownOut


class FaultyPins:
    """A pin bank with faults.

    Args:
        pins: The bank as it is.
        pinout: Names and directions of the wires.
        faults: What goes wrong, and when.

    Raises:
        UsageError: A fault names no wire, or a glitch an output.
    """

    def __init__(self, pins: PinBank, pinout: Pinout, faults: Iterable[Fault]) -> None:
        self._pins = pins
        self._reset = pinout.with_role(WireRole.RESET)[0].name
        self._glitches: dict[str, list[tuple[Nanos, Nanos]]] = {}
        self._brown_outs: list[tuple[Nanos, Nanos]] = []
        self._stuck: dict[str, list[StuckPin]] = {}
        #: What the adapter last wanted of each stuck output, and what the wire was given.
        self._wanted: dict[str, bool | None] = {}
        self._given: dict[str, bool | None] = {}
        outputs = {wire.name for wire in pinout.wires if wire.direction is Direction.TO_BLUEPILL}
        names = {wire.name for wire in pinout.wires}
        for fault in faults:
            self._add(fault, names, outputs)
        self._stuck_outputs = sorted(outputs & set(self._stuck))
        self._wanted = dict.fromkeys(self._stuck_outputs)
        self._given = dict.fromkeys(self._stuck_outputs)

    def read(self, signal: str, at: Nanos) -> bool:
        """Return the level of a wire as the adapter's pin sees it."""
        for name in self._stuck_outputs:
            self._settle(name, at)
        level = self._pins.read(signal, at)
        for start, end in self._glitches.get(signal, ()):
            if start <= at < end:
                level = not level
        forced = self._forced(signal, at)
        level = level if forced is None else forced
        return level or (signal == self._reset and any(start <= at < end for start, end in self._brown_outs))

    def write(self, signal: str, high: bool | None, now: Nanos) -> None:
        """Drive a wire, as far as its faults let it."""
        if signal not in self._wanted:
            self._pins.write(signal, high, now)
            return
        self._wanted[signal] = high
        self._settle(signal, now)

    def _add(self, fault: Fault, names: set[str], outputs: set[str]) -> None:
        if isinstance(fault, BrownOut):
            end = fault.at + max(fault.span_ns, LEAST_BROWN_OUT_NS)
            self._brown_outs.append((fault.at, end))
            return
        if fault.signal not in names:
            raise UsageError(f"there is no wire {fault.signal!r}", hint="the wires stand in pinout.toml")
        if isinstance(fault, StuckPin):
            self._stuck.setdefault(fault.signal, []).append(fault)
        elif fault.signal in outputs:
            raise UsageError(f"{fault.signal} is an output: a glitch on it is the far side's", hint="use StuckPin")
        else:
            self._glitches.setdefault(fault.signal, []).append((fault.at, fault.at + fault.span_ns))

    def _forced(self, signal: str, at: Nanos) -> bool | None:
        for fault in self._stuck.get(signal, ()):
            if fault.since <= at and (fault.until is None or at < fault.until):
                return fault.high
        return None

    def _settle(self, name: str, now: Nanos) -> None:
        """Give a stuck output what it has at this instant."""
        forced = self._forced(name, now)
        level = self._wanted[name] if forced is None else forced
        if level is not self._given[name]:
            self._given[name] = level
            self._pins.write(name, level, now)


class LoopedAdapter(Protocol):
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

    def __init__(self, make: Callable[[PinBank], LoopedAdapter], pins: PinBank, pass_ns: Nanos, now: Nanos = 0) -> None:
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
