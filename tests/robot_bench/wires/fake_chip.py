"""A chip without a processor: a script of pin changes and printed text, with times."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from types import SimpleNamespace

from bluepill_sim.fabric.pins import PinBank, PinDrive
from bluepill_sim.fabric.subscriptions import EDGE, EdgeSink, Of
from simbase.timing import NS_PER_S, Reached, Reason
from tests.bluepill_sim.fabric.test_waves import Ports


@dataclass(frozen=True)
class FakeFault:
    at_ns: int

    def __str__(self) -> str:
        return f"HardFault: no such instruction at main+0x4 (0x08000104), t = {self.at_ns / 1e9:.6f} s"


class FakePin:
    def __init__(self, chip: "FakeChip", name: str) -> None:
        self._chip = chip
        self.name = name
        self.outside: bool | None = None
        self.is_weak = False

    def drive(self, level: bool | None, *, is_weak: bool = False) -> None:
        if (level, is_weak) != (self.outside, self.is_weak):
            self.outside, self.is_weak = level, is_weak
            self._chip.inputs.append((self._chip.now_ns, self.name, level))

    def drive_later(self, levels: Iterable[tuple[int, bool]], *, is_weak: bool = False) -> None:
        for _, level in levels:  # its blocks are long
            self.drive(bool(level), is_weak=is_weak)


class FakeSubscription:
    def __init__(self, pins: Iterable[str], sink: EdgeSink, ends_slice: Iterable[str]) -> None:
        self.pins, self.sink, self.ends_slice = frozenset(pins), sink, frozenset(ends_slice)
        self.rows = bytearray()

    def deliver(self) -> None:
        rows = bytes(self.rows)
        self.rows.clear()
        if rows:
            self.sink(rows)

    def close(self) -> None:
        self.deliver()
        self.pins = frozenset()


class FakeUsart:
    def __init__(self) -> None:
        self.far_baud: int | None = None
        self.measured_baud: int | None = None
        self.sinks: list[Callable[[Sequence[tuple[int, int]]], None]] = []
        self.sent: list[tuple[int, int]] = []

    def subscribe(self, sink: Callable[[Sequence[tuple[int, int]]], None]) -> Callable[[], None]:
        self.sinks.append(sink)
        return lambda: self.sinks.remove(sink)

    def deliver(self) -> None:
        sent, self.sent = self.sent, []
        for sink in self.sinks if sent else ():
            sink(sent)


class FakeChip:
    """Leads like the real one: it overruns every limit to its next block boundary, `block_ns` apart."""

    def __init__(
        self,
        pins: Sequence[tuple[int, str, PinDrive]] = (),
        text: Sequence[tuple[int, bytes]] = (),
        *,
        block_ns: int = 700,
        halts_at: int | None = None,
    ) -> None:
        self.now_ns = 0
        self.inputs: list[tuple[int, str, bool | None]] = []
        self.warning_sinks: list[Callable[[str], None]] = []
        self.usart1 = FakeUsart()
        self.subscriptions: list[FakeSubscription] = []
        self.warnings: list[str] = []
        self.fault: FakeFault | None = None
        #: When the firmware comes back from its fault; None for never.
        self.recovers_at: int | None = None
        self.activity = SimpleNamespace(last_pin_ns=0, last_usart_ns=0, last_wfi_ns=0)
        self._pins: dict[str, FakePin] = {}
        bytes_out = [(at + 87_000 * n, byte) for at, line in text for n, byte in enumerate(line)]
        self._script: list[tuple[int, str, object]] = sorted(
            [(at, pin, drive) for at, pin, drive in pins] + [(at, "", byte) for at, byte in bytes_out],
            key=lambda item: item[0],
        )
        self._done = 0
        self._block_ns = block_ns
        self._halts_at = halts_at

    @property
    def has_died(self) -> bool:
        return self.fault is not None and not (self.recovers_at is not None and self.now_ns >= self.recovers_at)

    @property
    def died_ns(self) -> int | None:
        return self.fault.at_ns if self.fault is not None and self.has_died else None

    @property
    def verdict(self) -> str:
        return "" if self.fault is None else f"firmware fault: {self.fault}"

    def pin(self, name: str) -> FakePin:
        return self._pins.setdefault(name, FakePin(self, name))

    def subscribe_pins(
        self, pins: Iterable[str], sink: EdgeSink, *, of: Of = Of.DRIVE, ends_slice: Iterable[str] = (),
        waves: bool = False,  # noqa: ARG002 - it makes none
    ) -> FakeSubscription:  # fmt: skip
        assert of is Of.DRIVE
        self.subscriptions.append(FakeSubscription(pins, sink, ends_slice))
        return self.subscriptions[-1]

    def last_blocks(self) -> list[str]:
        return [] if self.fault is None else ["          12  main+0x4 (0x08000104)"]

    def where(self) -> str:
        return "main+0x4 (0x08000104)"

    def subscribe_warnings(self, sink: Callable[[str], None]) -> Callable[[], None]:
        self.warning_sinks.append(sink)
        return lambda: self.warning_sinks.remove(sink)

    def advance_to(self, limit: int) -> Reached:
        try:
            return self._advance(limit)
        finally:
            for sender in (*self.subscriptions, self.usart1):
                sender.deliver()

    def _advance(self, limit: int) -> Reached:
        while self.now_ns < limit:
            boundary = (limit + self._block_ns - 1) // self._block_ns * self._block_ns
            if self._done < len(self._script) and self._script[self._done][0] <= boundary:
                at, name, what = self._script[self._done]
                self._done += 1
                self.now_ns = max(self.now_ns, at)
                if self._tell(at, name, what):
                    self.now_ns = (at + self._block_ns - 1) // self._block_ns * self._block_ns
                    return Reached(self.now_ns, Reason.EDGE)
                continue
            if self._halts_at is not None and boundary >= self._halts_at:
                self.fault = FakeFault(self._halts_at)
                self.now_ns = limit
                if not self.has_died:
                    self._halts_at = None
                    return Reached(self.now_ns, Reason.DEADLINE)
                return Reached(self.now_ns, Reason.HALT)
            self.now_ns = boundary
        return Reached(self.now_ns, Reason.DEADLINE)

    def _tell(self, at: int, name: str, what: object) -> bool:
        if not name:
            assert isinstance(what, int)
            self.activity.last_usart_ns = at
            self.usart1.sent.append((what, at))
            return False
        assert isinstance(what, PinDrive)
        self.activity.last_pin_ns = at
        number, drive = 16 * (ord(name[1]) - ord("A")) + int(name[2:]), list(PinDrive).index(what)
        subscribed = [item for item in self.subscriptions if name in item.pins]
        for item in subscribed:
            item.rows += EDGE.pack(at, number, drive, int(bool(what.level)), 0, 0)
        return any(name in item.ends_slice for item in subscribed)

    def snapshot(self) -> object:
        return (self.now_ns, self._done, tuple((name, pin.outside, pin.is_weak) for name, pin in self._pins.items()))

    def restore(self, snapshot: object) -> None:
        self.now_ns, self._done, pins = snapshot  # type: ignore[misc]
        for name, outside, is_weak in pins:
            self.pin(name).outside, self.pin(name).is_weak = outside, is_weak


class PortsChip(Ports):
    """A bank of pins with a clock of nanoseconds, as the wires see a chip."""

    def __init__(self, *names: str) -> None:
        super().__init__()
        self.pins = PinBank(self, frozenset(names))  # type: ignore[arg-type]  # a part of a chip
        self.pins.fabric.set_time(0, 0, NS_PER_S)
        self.pin = self.pins.__getitem__
        self.subscribe_pins = self.pins.subscribe_pins

    def run(self, until_ns: int) -> None:
        while (due := self.pins.fabric.next_ns) is not None and due <= until_ns:
            self.now_ns = max(due, self.now_ns)
            self.pins.fabric.run_events(self.now_ns)
        self.now_ns = until_ns
        self.pins.deliver()
