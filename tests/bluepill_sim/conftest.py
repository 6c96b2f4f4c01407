"""A chip without a CPU, with the ports that peripherals need; boards that run assembled programs."""

import signal
from collections import defaultdict
from collections.abc import Callable, Iterator

import pytest

from bluepill_sim.fabric.clocks import Clocks
from bluepill_sim.fabric.power import Power
from bluepill_sim.stm32f103 import ChipParts, make_parts, make_pins
from tests.bluepill_sim.machine import Assembler, Machine

#: Longer than any test with an assembled program takes on a loaded machine.
WALL_CLOCK_S = 60


class FakeChip:
    """`ChipPorts` with a clock that the test moves, and a record of all that it is told."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.access_pc = 0
        self.clocks = Clocks()
        self.power = Power()
        self.pins = make_pins(self)
        self.irqs: dict[int, bool] = defaultdict(bool)
        self.signals: list[str] = []
        self.warnings: dict[str, str] = {}
        self.resets: list[str] = []
        self.expired: list[tuple[str, int]] = []
        self.stops = 0
        self.clock_changes = 0
        self._parts: ChipParts | None = None
        self._parts = make_parts(self)

    @property
    def parts(self) -> ChipParts:
        assert self._parts is not None
        return self._parts

    @property
    def access_cycle(self) -> int:
        return self.now_ns

    def clock_changed(self) -> None:
        self.clock_changes += 1
        if self._parts is not None:
            self._parts.clock_changed()

    def request_stop(self) -> None:
        self.stops += 1

    def irq_changed(self, irq: int, level: bool) -> bool:
        self.irqs[irq] = level
        return True

    def flash_began(self) -> None:
        pass

    def end_slice(self) -> None:
        self.stops += 1

    def event_due(self, cycle: int) -> None:
        pass

    def reach_registers(self, address: int, size: int, written: int | None) -> int | None:
        part = next((p for p in self.parts.by_name.values() if 0 <= address - p.base < p.place.size), None)
        if part is None:
            return None
        if written is None:
            return part.read(address - part.base, size)
        part.write(address - part.base, size, written)
        return 0

    def code_written(self, address: int, size: int) -> None:
        pass

    def reset_peripheral(self, name: str) -> None:
        self.resets.append(name)
        part = self.parts.by_name.get(name)
        if part is not None:
            part.reset()

    def reset_backup_domain(self) -> None:
        self.parts.reset_backup_domain()

    def watchdog_expired(self, name: str) -> None:
        self.expired.append((name, self.now_ns))

    def signal(self, name: str) -> None:
        self.signals.append(name)

    def warn(self, message: str, *, once: str, pc: int | None = None) -> None:  # noqa: ARG002 - there is no program
        self.warnings.setdefault(once, message)

    # For the tests.

    def advance(self, to_ns: int) -> None:
        """Run to a point in time, stopping at each deadline as the real chip does."""
        while True:
            due_ns = self.parts.next_deadline()
            if due_ns is None or due_ns > to_ns:
                break
            assert due_ns >= self.now_ns
            self.now_ns = due_ns
            self.pins.fabric.run_events(due_ns)
        self.now_ns = to_ns
        self.deliver()

    def deliver(self) -> None:
        self.pins.deliver()
        for part in self.parts.by_name.values():
            part.deliver()

    def write(self, register: str, value: int, size: int = 4, byte: int = 0) -> None:
        """Write "GPIOA.ODR" or, with `byte`, a part of it."""
        name, _, field = register.partition(".")
        part = self.parts.by_name[name]
        offset = next(r.offset for r in part.REGISTERS if r.name == field)
        part.write(offset + byte, size, value)

    def read(self, register: str, size: int = 4, byte: int = 0) -> int:
        name, _, field = register.partition(".")
        part = self.parts.by_name[name]
        offset = next(r.offset for r in part.REGISTERS if r.name == field)
        return part.read(offset + byte, size)

    def run_at_72_mhz(self) -> None:
        """Do what every program does: HSE, PLL times 9, two wait states, PCLK1 halved."""
        self.write("FLASH.ACR", 0x12)
        self.write("RCC.CR", self.read("RCC.CR") | 1 << 16)
        self.advance(self.now_ns + 2_000_000)
        self.write("RCC.CFGR", 1 << 16 | 7 << 18 | 4 << 8)
        self.write("RCC.CR", self.read("RCC.CR") | 1 << 24)
        self.advance(self.now_ns + 200_000)
        self.write("RCC.CFGR", self.read("RCC.CFGR") | 2)


@pytest.fixture
def fake_chip() -> FakeChip:
    return FakeChip()


@pytest.fixture(scope="session")
def make_fake_chip() -> Callable[[], FakeChip]:
    """For hypothesis, which makes many."""
    return FakeChip


@pytest.fixture
def boot(watchdog: None) -> Callable[..., Machine]:
    """Assemble a program and stand at its reset: boot(source, {number: "label"}, origin=, stack=)."""

    def make(source: str, vectors: dict[int, str | int] | None = None, **options: int) -> Machine:
        return Machine(source, vectors or {}, **options)

    return make


@pytest.fixture
def run(boot: Callable[..., Machine]) -> Callable[..., Machine]:
    """Assemble a program, run it for 1 ms of virtual time, and see that it came to its end."""

    def make(source: str, vectors: dict[int, str | int] | None = None, us: float = 1000) -> Machine:
        machine = boot(source, vectors).run(us)
        assert machine.is_done, f"the program stands at {machine.board.where()}: {machine.board.fault}"
        return machine

    return make


@pytest.fixture
def assemble() -> type[Assembler]:
    return Assembler


@pytest.fixture
def watchdog() -> Iterator[None]:
    """Fail a test whose emulated program hangs the host."""

    def bark(_number: int, _frame: object) -> None:
        raise TimeoutError(f"the test took more than {WALL_CLOCK_S} s")

    before = signal.signal(signal.SIGALRM, bark)
    signal.alarm(WALL_CLOCK_S)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)
