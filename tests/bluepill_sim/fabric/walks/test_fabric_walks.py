"""Queue, lines, pins, waves, volts and rows of subscribers, driven at random, against traces that were approved.

Each step of an episode is a line: what was done, what came out, and all that stands in the struct of each port then.
Half way another bank goes on from what the first one has saved, which no line may show.
"""

import ctypes
import random
import tempfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

from bluepill_sim.analysis.edge_log import EdgeLog
from bluepill_sim.fabric.fabric import OWN_COMMANDS
from bluepill_sim.fabric.pins import ALTERNATE_FUNCTIONS, PinBank, PinDrive, PinMode
from bluepill_sim.fabric.registers import LISTENER
from bluepill_sim.fabric.signals import Oscillation, Samples, Waveform
from bluepill_sim.fabric.subscriptions import EDGE, Of, read_rows
from simbase.timing import NS_PER_S
from tests.tools.suite.approved import judge_of

EPISODES, STEPS = 48, 60
#: Pins at both ends of the first and the last port, of which two lead to no ADC and one has no leg.
NAMES = ("PA0", "PA1", "PA7", "PB1", "PB15", "PE0", "PE15")
_BONDED = frozenset(NAMES) - {"PE0"}
#: Functions by their numbers: the first, two that a pin takes in turn, the last.
SOURCES = (0, 9, 10, len(ALTERNATE_FUNCTIONS) - 1)
CLOCKS_HZ = (8_000_000, 72_000_000, 7_999_991, NS_PER_S)
SPANS_NS = (0, 1, 13, 125, 999, 25_000, 60_000, 1_000_000)
#: Of a wave: the clock that counts it, and ticks of a period; a step has few edges.
WAVES = ((8_000_000, 400), (72_000_000, 3600), (7_999_991, 72_000), (NS_PER_S, 50_001), (40_000, 2), (90_000, 3))
#: An interrupt's line, the last of those, the first behind them, and two in other words of their mask.
LINES = (0, 42, 43, 64, 191)
_MEMORY = 0x2000_0000
#: At the bounds of the peripherals.
_REGISTERS = (0x4000_0000, 0x4002_3FFC, 0x3FFF_FFFC, 0x4002_4000)


class Ports:
    """What a bank needs of its chip: a clock that the walk moves, and a note of all that it is told."""

    def __init__(self) -> None:
        self.now_ns = self.access_pc = self.base_ns = self.base_cycle = 0
        self.hz = NS_PER_S
        self.heard: list[str] = []

    @property
    def access_cycle(self) -> int:
        """The first cycle that begins now, or later."""
        return self.base_cycle + -(-(self.now_ns - self.base_ns) * self.hz // NS_PER_S)

    def irq_changed(self, irq: int, level: bool) -> bool:
        """Note a level; every other line is enabled."""
        self.heard.append(f"irq {irq}={level:d}")
        return irq % 2 == 0

    def event_due(self, cycle: int) -> None:
        """Note it."""
        self.heard.append(f"due {cycle}")

    def end_slice(self) -> None:
        """Note it."""
        self.heard.append("end")

    def signal(self, name: str) -> None:
        """Note it."""
        self.heard.append(name)

    def warn(self, message: str, *, once: str, pc: int | None = None) -> None:
        """Note it."""
        self.heard.append(f"{once}: {message}{pc or ''}")

    def code_written(self, address: int, size: int) -> None:
        """Note it."""
        self.heard.append(f"code {address:x}/{size}")

    def reach_registers(self, address: int, size: int, written: int | None) -> int | None:
        """Answer all but one of four words."""
        self.heard.append(f"bus {address:x}/{size} {written}")
        return None if address & 12 == 12 else address >> 2 & 0xFF


class Walked:
    """A bank, parts in Python in its queue, a bus master among them, and a memory."""

    def __init__(self) -> None:
        self.ports = Ports()
        self.pins = PinBank(self.ports, _BONDED, frozenset({"PB15"}))  # type: ignore[arg-type]  # a part of a chip
        self.fabric = fabric = self.pins.fabric
        self.slots = [fabric.add_slot(f"part {n}", self._acting(n)) for n in range(4)]
        fabric.put_output(self.slots[0], 0, LINES[0])
        fabric.put_output(self.slots[1], 1, LINES[0])
        fabric.put_output(self.slots[1], 0, LINES[3])
        self.words = (ctypes.c_uint32 * 8)()
        self.listeners = [self._listener(n) for n in range(2)]
        for slot, wired in zip(self.listeners, (LINES, LINES[2:4]), strict=True):
            for number, line in enumerate(wired):
                fabric.wire(line, slot, number)
        self.memory = ctypes.create_string_buffer(64)
        self.constants = ctypes.create_string_buffer(bytes(range(32)), 32)
        fabric.add_memory(_MEMORY - 32, self.constants, is_writable=False)
        fabric.add_memory(_MEMORY, self.memory, is_writable=True)
        self.closing: list[Callable[[], None]] = []
        self.rows = bytearray()
        self.take_frequency(CLOCKS_HZ[0])

    def _acting(self, number: int) -> Callable[[int], None]:
        def act(at_ns: int) -> None:
            self.ports.heard.append(f"part {number}@{at_ns}")
            self.fabric.schedule(self.slots[number], at_ns + 5_000 if at_ns % 3 == 0 else None)
            if number and at_ns % 2:  # it has the one before it act at the same time, or never
                self.fabric.schedule(self.slots[number - 1], at_ns if at_ns % 5 else None)

        return act

    def _listener(self, number: int) -> int:
        """Return the slot of a device that hears lines and pins."""

        def heard(what: int, value: int) -> None:
            self.ports.heard.append(f"listener {number} {what} {value:x}")

        state = ctypes.addressof(self.words) + 16 * number
        slot = self.fabric.add_device(
            f"listener {number}", LISTENER, state, state, act=self._acting(0), answer=heard, deliver=lambda: None
        )
        self.fabric.set_initial(slot, (ctypes.c_uint32 * 4)(1, 17 + number, 3, 0xFFFF_FFFF), is_whole=True)
        return slot

    def take_frequency(self, hz: int) -> None:
        """Have the clock be another from now on."""
        ports = self.ports
        ports.base_cycle, ports.base_ns, ports.hz = ports.access_cycle, ports.now_ns, hz
        self.fabric.set_time(ports.base_ns, ports.base_cycle, hz)

    def take(self, data: bytes) -> None:
        """Note edges."""
        self.rows += data
        self.ports.heard += ["/".join(map(str, row[:5])) for row in EDGE.iter_unpack(data)]

    def take_waves(self, data: bytes) -> None:
        """Note edges and waves."""
        self.ports.heard += [f"{row}" for row in read_rows(data)] + [f"{zlib.crc32(data):x}"]

    def save(self) -> object:
        """Return all that decides the future."""
        times = [self.fabric.due(slot) for slot in self.slots]
        ports = self.ports
        return self.pins.snapshot(), times, ports.now_ns, ports.base_ns, ports.base_cycle, ports.hz

    def go_on_from(self, saved: object) -> None:
        """Be what was saved."""
        assert isinstance(saved, tuple)
        snapshot, times, *clock = saved
        ports = self.ports
        ports.now_ns, ports.base_ns, ports.base_cycle, ports.hz = clock
        self.fabric.set_time(ports.base_ns, ports.base_cycle, ports.hz)
        self.pins.restore(snapshot)
        for slot, at_ns in zip(self.slots, times, strict=True):
            self.fabric.schedule(slot, at_ns)
        self.fabric.resume()


class Walker:
    """One episode."""

    def __init__(self, episode: int) -> None:
        self._dice = random.Random(f"fabric {episode}")
        self.now = Walked()
        self._heard: list[tuple[int, int, int]] = []
        self.kinds: tuple[Callable[[], str], ...] = (
            self.configure, self.configure, self.offer, self.offer, self.wave, self.wave, self.wave, self.drive,
            self.drive, self.drive_later, self.hold, self.tie, self.volts, self.schedule, self.schedule, self.catch_up,
            self.run,
            self.run, self.run, self.run, self.subscribe, self.subscribe, self.close, self.line, self.line, self.line,
            self.bus, self.frequency, self.listen, self.listen, self.reset,
        )  # fmt: skip

    def go(self) -> Iterator[str]:
        """Yield a line for each step."""
        for step in range(STEPS):
            if step == STEPS // 2:
                while self.now.closing:
                    self.now.closing.pop()()
                other = Walked()
                for slot, port, pins in self._heard:
                    other.fabric.command(slot, OWN_COMMANDS, port, pins)
                other.memory.raw, other.rows = self.now.memory.raw, self.now.rows
                other.go_on_from(self.now.save())
                other.ports.heard = []
                self.now = other
            done = self._dice.choice(self.kinds)()
            yield f"{done} {self.shown()}"
        self.now.pins.deliver()
        yield f"{self.now.ports.heard}"

    def shown(self) -> str:
        """Return what was heard, and all that stands in the fabric."""
        bank, fabric, ports = self.now.pins, self.now.fabric, self.now.ports
        heard, ports.heard = ports.heard, []
        structs = " ".join(f"{zlib.crc32(bytes(fabric.look(port))):x}" for port in (0, 1, 4))
        pins = " ".join(
            f"{pin.output.value}/{pin.level:d}{pin.input:d}{pin.is_floating:d}{pin.is_contended:d}{pin.is_watched:d}"
            f"{pin.driven}{pin.rail}{pin.function}{pin.wave}{pin.volts}"
            for pin in (bank[name] for name in NAMES)
        )
        due = [fabric.due(slot) for slot in range(9)]
        lines = zlib.crc32(fabric.lines)
        ends = f"{fabric.next_ns} {fabric.last_output_ns} {fabric.take_stop():d}{fabric.has_news:d}"
        return f"{heard} {structs} {pins} {due} {lines:x} {zlib.crc32(self.now.memory.raw):x} {ends}"

    # What is done.

    def _name(self) -> str:
        return self._dice.choice(NAMES)

    def configure(self) -> str:
        """Give a pin a mode."""
        name, mode, bit = self._name(), self._dice.choice(list(PinMode)), self._dice.random() < 0.5
        self.now.pins[name].configure(mode, bit)
        return f"{name} {mode.value} {bit}"

    def offer(self) -> str:
        """Offer a level, or take it back."""
        name, source = self._name(), ALTERNATE_FUNCTIONS[self._dice.choice(SOURCES)]
        level = self._dice.choice((True, False, None))
        pin = self.now.pins[name]
        if level is None:
            pin.disconnect(source)
        else:
            pin.connect(source, level)
        return f"{name} {source} {level}"

    def wave(self) -> str:
        """Offer a wave on a pin that takes functions."""
        name, source = self._name(), ALTERNATE_FUNCTIONS[self._dice.choice(SOURCES)]
        hz, period = self._dice.choice(WAVES)
        high = self._dice.choice((0, 1, period // 2, period - 1, period, period + 1))
        position = self._dice.randrange(2 * period)
        pin = self.now.pins[name]
        if self._dice.random() < 0.7:
            pin.configure(self._dice.choice((PinMode.ALTERNATE_PUSH_PULL, PinMode.ALTERNATE_OPEN_DRAIN)), False)
        pin.offer_wave(source, hz, period, high, position)
        return f"{name} {source} {hz} {period} {high} {position}"

    def drive(self) -> str:
        """Put a level on a wire from outside."""
        name, level = self._name(), self._dice.choice((True, False, None))
        is_weak, volts = self._dice.random() < 0.4, self._dice.choice((None, None, 5.0, 3.3))
        try:
            self.now.pins[name].drive(level, volts=volts, is_weak=is_weak)
        except ValueError as error:
            return str(error)
        return f"{name} {level} {volts} {is_weak}"

    def drive_later(self) -> str:
        """Put levels on wires later."""
        name, now_ns = self._name(), self.now.ports.now_ns
        levels = [
            (max(0, now_ns + self._dice.choice((-5, 0, 1, 800, 30_000))), n % 2) for n in range(self._dice.randrange(4))
        ]
        is_weak = self._dice.random() < 0.4
        try:
            self.now.pins[name].drive_later(levels, is_weak=is_weak)
        except ValueError as error:
            return str(error)
        return f"{name} {levels} {is_weak}"

    def hold(self) -> str:
        """Have a fixed function keep a pin, or a bus hold it low."""
        name, drive = self._name(), self._dice.choice([*PinDrive, None, None])
        pin = self.now.pins[name]
        if self._dice.random() < 0.3:
            pin.hold_low(drive is not None)
        elif drive is None:
            pin.release()
        else:
            pin.hold("JTDO", drive)
        return f"{name} held {drive} {pin.holder}"

    def tie(self) -> str:
        """Short a pin, or pull it by a resistor of the board."""
        name, rail = self._name(), self._dice.choice((None, None, "GND", "3V3"))
        if self._dice.random() < 0.5:
            self.now.pins[name].short(rail)
            return f"{name} at {rail}"
        pull = self._dice.choice((PinDrive.NONE, PinDrive.PULL_UP, PinDrive.PULL_DOWN))
        self.now.pins[name].board_pull = pull
        return f"{name} {pull}"

    def volts(self) -> str:
        """Put volts on a pin."""
        dice, name = self._dice, self._name()
        period_ns = dice.choice((1, 2, 1_000, 999_983))
        chosen = dice.choice(
            (
                None, 1.65, 1.649999, -0.5, 4.2,
                *(
                    Oscillation(shape=shape, low_v=-0.25, high_v=dice.choice((3.1, 999.5)),
                                period_ns=period_ns, phase_ns=period_ns // 3,
                                high_ns=dice.choice((None, 0, period_ns // 4)))
                    for shape in Waveform
                ),
                *(
                    Samples(volts=(0.5, 3.0, 1.25), interval_ns=period_ns, is_repeated=dice.random() < 0.5,
                            is_held=dice.random() < 0.5)
                    for _ in range(3)
                ),
            )
        )  # fmt: skip
        try:
            self.now.pins[name].set_volts(chosen)
        except ValueError as error:
            return str(error)
        at = [self.now.ports.now_ns + k for k in (0, 1, 249, 250, 333, 500, 750, 1_000, 1_501, 7_777_777, 10**10)]
        found = [self.now.fabric.channel_uv(channel, ns) for channel in (0, 1, 7, 9) for ns in at]
        return f"{name} {chosen} {zlib.crc32(str(found).encode()):x} {found[:12]}"

    def schedule(self) -> str:
        """Have a part act later, or not."""
        slot = self._dice.choice(self.now.slots)
        after = self._dice.choice((None, 0, 1, 125, 999, 12_000, 3 * NS_PER_S, 10**19))
        at_ns = None if after is None else self.now.ports.now_ns + after
        self.now.fabric.schedule(slot, at_ns)
        return f"part {slot} at {at_ns}"

    def catch_up(self) -> str:
        """Have one part come to a time."""
        slot, after = self._dice.choice(self.now.slots), self._dice.choice((0, 1, 999))
        self.now.fabric.catch_up(slot, self.now.ports.now_ns + after)
        return f"part {slot} up to {after}"

    def run(self) -> str:
        """Let time pass, from event to event."""
        ports, fabric = self.now.ports, self.now.fabric
        end_ns = ports.now_ns + self._dice.choice(SPANS_NS)
        for _ in range(200):
            due = fabric.next_ns
            if due is None or due > end_ns:
                break
            ports.now_ns = max(due, ports.now_ns)
            fabric.run_events(ports.now_ns)
        ports.now_ns = end_ns
        if self._dice.random() < 0.7:
            self.now.pins.deliver()
        return f"at {end_ns}"

    def subscribe(self) -> str:
        """Subscribe to pins and lines."""
        dice = self._dice
        names = dice.sample(NAMES, dice.randrange(1, 5))
        of, waves, ends = dice.choice(list(Of)), dice.random() < 0.4, names[: dice.choice((0, 0, 1, 2))]
        lines = dice.sample(LINES, dice.randrange(3))
        take = self.now.take_waves if waves else self.now.take
        try:
            one = self.now.pins.subscribe_pins(names, take, of=of, ends_slice=ends, lines=lines, waves=waves)
        except ValueError as error:
            return str(error)
        self.now.closing.append(one.close)
        if dice.random() < 0.2:
            one.ends_slice = frozenset(names)
        return f"{names} {of} {waves} {ends} {lines}"

    def close(self) -> str:
        """End a subscription."""
        if self.now.closing:
            self.now.closing.pop(self._dice.randrange(len(self.now.closing)))()
        return "close"

    def line(self) -> str:
        """Set a line, or an output on one."""
        number, level = self._dice.choice(LINES), self._dice.random() < 0.5
        if self._dice.random() < 0.5:
            self.now.fabric.set_line(number, level)
            return f"line {number} {level}"
        slot, output = self._dice.choice(self.now.slots), self._dice.randrange(2)
        self.now.fabric.set_output(slot, output, level)
        return f"output {slot}.{output} {level}"

    def listen(self) -> str:
        """Have a device listen to other pins."""
        slot, port = self._dice.choice(self.now.listeners), self._dice.choice((0, 1, 4))
        pins = self._dice.choice((0, 1, 0x83, 0x8002, 0xFFFF))
        self.now.fabric.command(slot, OWN_COMMANDS, port, pins)
        self._heard.append((slot, port, pins))
        return f"listener {slot} hears {port}/{pins:x}"

    def reset(self) -> str:
        """Reset a device."""
        slot = self._dice.choice(self.now.listeners)
        self.now.words[:] = [self._dice.getrandbits(32) for _ in range(8)]
        self.now.fabric.schedule(slot, self.now.ports.now_ns + 77)
        self.now.fabric.reset_device(slot)
        return f"reset {slot} {list(self.now.words)}"

    def bus(self) -> str:
        """Read and write as a bus master."""
        dice, fabric, slot = self._dice, self.now.fabric, self.now.slots[0]
        address = dice.choice((*(_MEMORY + n for n in (-32, 0, 60, 64)), *_REGISTERS, 0))
        address, size = address + dice.randrange(5), dice.choice((1, 2, 4))
        if dice.random() < 0.5:
            return f"{address:x}/{size} {fabric.bus_read(slot, address, size)} {fabric.master}"
        word = dice.getrandbits(32)
        return f"{address:x}/{size}={word:x} {fabric.bus_write(slot, address, size, word)}"

    def frequency(self) -> str:
        """Change the clock."""
        hz = self._dice.choice(CLOCKS_HZ)
        self.now.take_frequency(hz)
        return f"{hz} Hz"


def _episodes(_: random.Random) -> Iterator[str]:
    for episode in range(EPISODES):
        yield "\n".join([f"episode {episode}", *Walker(episode).go()])


def _dumps(_: random.Random) -> Iterator[str]:
    """Yield what becomes of edges that come in any order: rows in order, and a value change dump."""
    dice = random.Random("edges")
    signals = [n % 5 for n in range(256)]
    log = EdgeLog(signals, [2] * 5)
    for _turn in range(40):
        log.take(
            b"".join(EDGE.pack(dice.randrange(60), dice.randrange(80), 0, dice.randrange(3), 0, 0) for _ in range(3))
        )
        log.put(dice.randrange(60), dice.choice((5, 6, 250)), dice.choice((0, 1, 5, 0x8000_0000, 0xFFFF_FFFF)))
    yield f"{list(log.rows())} {sorted(log.used())}"
    with tempfile.TemporaryDirectory() as folder:
        for start_ns, end_ns in ((0, 100), (30, 59), (59, 10**19)):
            path = Path(folder) / f"{start_ns}.vcd"
            path.write_bytes(b"head\n")
            log.write(str(path).encode(), [chr(33 + n % 90) * (1 + n // 90) for n in range(256)], 5, (start_ns, end_ns))
            yield path.read_text(encoding="utf-8")


TRACES = {"fabric": _episodes, "edges": _dumps}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
