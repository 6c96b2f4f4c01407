"""A walk: a peripheral driven at random from reset, and a trace of all that can be seen of it, step by step.

Theory of operation. A walk has episodes. Each begins on a board out of reset, whose core sleeps, sets the peripheral up
in a mode, each in turn, and goes some steps at random: what the mode expects (a word, a START, a call from outside),
registers at random, time. What a step did is a line: what was done and read, which registers are otherwise than before,
and what a device in C holds beside them; edges and words that came out, lines inside the chip, waves that are offered,
when a part acts next, warnings, resets, what C called Python for and how often. In the middle of each episode the board
is saved and another one goes on from there, which no line may show.

Every other episode has somebody who looks at the pins: models that talk in words make their edges only then. In every
third a program makes the accesses, which comes to each in the middle of a block: models see such a one at its time only
where they say that it matters; then the line has its cycle.

Invariant: an episode follows from its name alone, on every version of Python.
"""

import ctypes
import random
import re
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, TypeVar

from bluepill_sim import BluePill
from bluepill_sim.core.unicorn_core import Reg
from bluepill_sim.fabric.fabric import OWN_COMMANDS
from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.registers import OWN_ANSWERS, WORD, Register, fields_of
from bluepill_sim.fabric.subscriptions import EDGE, Of, read_rows
from bluepill_sim.parts import CanNetwork, CanNode
from bluepill_sim.peripherals.spi import Loopback
from simbase.state import Stateful
from tests.bluepill_sim.core.walks.counted_calls import counted_calls
from tests.bluepill_sim.machine import Machine

#: SRAM that DMA reads and writes: the last bytes of it are in the trace, as a checksum.
BUFFER, BUFFER_BYTES = 0x2000_1000, 0x100
#: More edges or words than these in a step are counted and summed up.
_SHOWN = 6
#: How often a register is written in which way, of 100: one field, anything, all ones, all zeros.
_FIELD, _ANYTHING, _ONES = 70, 82, 92
#: Of 100 writes so many are of a halfword or a byte.
_NARROW = 8
#: Registers that are packets' memory: one of them is as good as all.
_MEMORY = "PMA_"

#: What a part on an SPI wants to be sent.
_EXPECTED = 0xFF
#: The frequencies in a trace.
_CLOCKS = ("hclk_hz", "pclk1_hz", "pclk2_hz", "timer1_hz", "timer2_hz", "usb_hz", "adc_divider", "rtcclk_hz")
#: What C calls Python for by what other episodes had it keep: blocks, and parts that hear pins, and act then.
_OF_OTHERS = ("unknown_block", "event", f"/{OWN_ANSWERS - 1}")
#: What no device knows.
_NO_COMMAND = OWN_COMMANDS + 99
#: Words of a part that has no memory of packets.
_USUAL_WORDS = 0x100
#: How each drive of a pin is written.
_LETTERS = dict(zip(PinDrive, "ZHLudxyzw", strict=False))

#: HCLK out of reset.
_SLOW_HZ = 8_000_000

#: Where the program stands that makes accesses: it survives what becomes of the flash memory.
_PROGRAM, _HALFWORD_AT = 0x2000_0800, 2
#: `wait` R0 rounds, make one access, and sleep: ldr R2, str, strh, strb R2 at R1, each with its way to `sleep`.
_WAIT = (0x3801, 0xD1FD, 0x46C0, 0x46C0)
_SLEEP = (0xBF30, 0xE7FD)
_ACCESSES = {"load": 0x680A, 4: 0x600A, 2: 0x800A, 1: 0x700A}
#: Where in that program it was warned: of an access that needs no time, where its block begins, or one before it.
_PLACE = re.compile(r" at 0x200008[0-9a-f]{2}\b")
#: Most rounds, and how long a program has: some accesses never end.
_MOST_ROUNDS, _PROGRAM_NS, _STEP_NS = 24, 40_000, 2_500

#: RCC's offsets of AHBENR, APB2ENR and APB1ENR, and what has every clock on.
_CLOCKS_ON = ((0x14, 0x55), (0x18, 0x7FFD), (0x1C, 0x1AE6_4807))

_Item = TypeVar("_Item")


@dataclass(frozen=True, slots=True, kw_only=True)
class RegisterWalk:
    """One peripheral's walk."""

    name: str
    #: The parts whose registers are written at random and traced, the first most often.
    parts: tuple[str, ...]
    #: Sets up a mode.
    begin: Callable[["RegisterWalker"], None]
    #: What the mode expects, each as often as it stands here.
    moves: tuple[Callable[["RegisterWalker"], None], ...]
    #: Time that passes between steps, ns.
    spans_ns: tuple[int, ...]
    #: Parts that are traced besides.
    beside: tuple[str, ...] = ()
    #: Words of AFIO_MAPR that move its pins.
    remaps: tuple[int, ...] = ()
    #: Whether nobody else is on its CAN.
    is_alone: bool = False
    #: Of 100 steps so many write or read a register at random.
    at_random: int = 25
    episodes: int = 24
    steps: int = 24


class CountingSpiDevice(Stateful):
    """A part on an SPI that counts, and says ahead what it sends next: for any byte, or for 0xFF alone."""

    STATE = ("sum", "is_exact")
    spi_modes = frozenset({0, 3})
    max_hz = 12_000_000

    def __init__(self) -> None:
        self.sum, self.is_exact = 0, False

    def select(self, at_ns: int) -> None:
        """Begin from the time."""
        self.sum, self.is_exact = at_ns & 0xFF, bool(at_ns // 125 & 1)

    def deselect(self, at_ns: int) -> None:
        """Begin from the time."""
        self.sum = at_ns >> 8 & 0xFF

    def exchange(self, byte: int, at_ns: int) -> int:
        """Count, by more where it is sent what it does not expect."""
        is_other = self.is_exact and byte != _EXPECTED
        self.sum = self.sum + (3 * byte + at_ns if is_other else 1) & 0xFF
        return self.sum

    def ahead(self, count: int) -> tuple[bytes, int | None]:
        """Return what comes next."""
        data = bytes(self.sum + n & 0xFF for n in range(1, 1 + min(count, self.sum % 7)))
        return data, _EXPECTED if self.is_exact else None

    def went(self, count: int) -> None:
        """Count."""
        self.sum = self.sum + count & 0xFF


class CountingI2cDevice(Stateful):
    """A part on an I2C with an address of 7 bits and one of 10, which refuses each fifth byte."""

    STATE = ("sum",)
    _ADDRESSES = (0x50, 0x2A5)

    def __init__(self) -> None:
        self.sum = 0

    def start(self, address: int, is_read: bool, at_ns: int) -> bool:
        """Count it."""
        self.sum = self.sum + is_read + at_ns & 0xFF
        return address in self._ADDRESSES

    def write(self, byte: int, at_ns: int) -> bool:
        """Add."""
        self.sum = self.sum + byte + at_ns & 0xFF
        return bool(self.sum % 5)

    def read(self, at_ns: int) -> int:
        """Count."""
        self.sum = self.sum + 7 + at_ns & 0xFF
        return self.sum

    def stop(self, at_ns: int) -> None:
        """Count."""
        self.sum = self.sum + 1 + at_ns & 0xFF


def _answer(word: int, at_ns: int) -> int:
    return 3 * word + at_ns & 0x1FF


class CountingUsbHost(Stateful):
    """The other end of a USB cable: counts what it is told, and acts 0.7 ms behind each fourth change."""

    STATE = ("sum", "next_ns")

    def __init__(self) -> None:
        self.sum = 0
        self.next_ns: int | None = None

    def advance_to(self, now_ns: int) -> None:
        """Count."""
        self.sum, self.next_ns = self.sum + 1, None
        del now_ns

    def device_changed(self, now_ns: int) -> None:
        """Count, and act soon."""
        self.sum += 0x100
        self.next_ns = now_ns + 700_000 if self.sum & 0x300 == 0 else self.next_ns

    def wake(self, now_ns: int) -> None:
        """Count."""
        self.sum += 0x10_0000 + now_ns


class WalkedBoard:
    """A board whose core sleeps, with something at each of its buses; and what was heard of it."""

    def __init__(self, *, is_alone: bool) -> None:
        self.calls = Counter[str]()
        with counted_calls(self.calls):
            self.board = Machine("sleep: wfi\nb sleep", {}).deafen().board
        self.network, self.node = CanNetwork(), CanNode()
        self.network.join(self.node)
        if not is_alone:
            self.board.can(self.network)
        self.board.spi("SPI1", CountingSpiDevice(), select="PB0")
        self.board.spi("SPI2", Loopback())
        for name in ("I2C1", "I2C2"):
            self.board.i2c(name, CountingI2cDevice())
        for register, word in _CLOCKS_ON:
            self.board.chip.parts.rcc.write(register, 4, word)
        self.heard: list[str] = []
        self._names = {pin.index: pin.name for pin in self.board.pins}
        self._closing: list[Callable[[], None]] = []
        self.host = CountingUsbHost()
        parts: dict[str, Any] = {**self.board.chip.parts.by_name}
        parts["USB"].attach(self.host)
        parts["USART2"].exchange = _answer
        self.entries: dict[object, int] = {}
        code: list[int] = []
        for access, instruction in _ACCESSES.items():
            self.entries[access] = _PROGRAM + _HALFWORD_AT * len(code)
            code += (*_WAIT, instruction, *_SLEEP)
        self.board.chip.memory.write(_PROGRAM, struct.pack(f"<{len(code)}H", *code))
        self._reset = self.saved()

    def saved(self) -> tuple[object, ...]:
        """Return all that decides the future."""
        return self.board.snapshot(), self.network.snapshot()

    def go_on_from(self, saved: tuple[Any, ...]) -> None:
        """Be what was saved."""
        self.board.restore(saved[0])
        self.network.restore(saved[1])

    def begin(self, watched: int) -> None:
        """Come out of reset, with nobody who listens but one at the serial ports.

        Args:
            watched: 1: somebody looks at pins and buses; 2: at pins, and takes waves as they are; else nobody does.
        """
        for close in self._closing:
            close()
        self.go_on_from(self._reset)
        board, parts = self.board, self.board.chip.parts.by_name
        self._closing = []
        for port in board.serial_ports.values():
            port.far_baud = None
        self.node.is_silent = False
        if watched in {1, 2}:
            names, take = [pin.name for pin in board.pins], (self._take_edges, self._take_waves)[watched - 1]
            self._closing.append(board.subscribe_pins(names, take, of=Of.WIRE, waves=watched > 1).close)
        if watched == 1:
            for name in ("SPI1", "SPI2", "I2C1", "I2C2"):
                self._closing.append(parts[name].subscribe(self._take_rows(name)))  # type: ignore[attr-defined]  # buses
        for name, port in board.serial_ports.items():
            self._closing.append(port.subscribe(self._take_rows(name)))
        self.heard.clear()
        self.calls.clear()

    def _take_edges(self, rows: bytes) -> None:
        self.heard += [
            f"{self._names[pin]}:{drive}/{wire}@{ns}" for ns, pin, drive, wire, _, _ in EDGE.iter_unpack(rows)
        ]

    def _take_waves(self, rows: bytes) -> None:
        self.heard += [
            f"{self._names[pin]}:{drive}/{wire}@{ns}{f' {wave}' if wave else ''}"
            for ns, pin, drive, wire, wave in read_rows(rows)
        ]

    def _take_rows(self, name: str) -> Callable[[Sequence[Any]], None]:
        return lambda rows: self.heard.extend(f"{name}:{'/'.join(map(str, map(_plain, row)))}" for row in rows)


def _plain(value: object) -> object:
    return value if not hasattr(value, "value") else value.value


@cache
def boards(*, is_alone: bool) -> tuple[WalkedBoard, WalkedBoard]:
    """Return the board on which episodes begin, and the one on which they go on."""
    return WalkedBoard(is_alone=is_alone), WalkedBoard(is_alone=is_alone)


@cache
def _gaps(kind: Any) -> int:
    """Return a struct's bytes as a number, all ones where a field of it stands."""
    if not hasattr(kind, "_fields_"):
        inner: Any = getattr(kind, "_type_", None)
        count = int(getattr(kind, "_length_", 1))
        if not hasattr(inner, "_fields_"):
            return int((1 << 8 * ctypes.sizeof(kind)) - 1)
        return sum(_gaps(inner) << 8 * ctypes.sizeof(inner) * n for n in range(count))
    return sum(_gaps(field[1]) << 8 * getattr(kind, field[0]).offset for field in kind._fields_)


def _without_gaps(struct_held: Any) -> int:
    """Return a checksum of a struct; between its fields a compiler writes what it likes."""
    kind: Any = type(struct_held)
    held, meant = bytes(struct_held), _gaps(kind)
    if meant.bit_count() == 8 * len(held):  # there are none
        return zlib.crc32(held)
    return zlib.crc32((int.from_bytes(held, "little") & meant).to_bytes(len(held), "little"))


@cache
def _looked_at(kind: Any, name: str) -> tuple[tuple[tuple[str, int, bool], ...], tuple[tuple[str, int, bool], ...]]:
    """Return the name of each register of a part, its place, and whether it has to be asked; and those that have to."""
    found = tuple(
        (f"{name}.{one.name}", one.offset // 4, one.on_read is not None)
        for one in kind.REGISTERS if not one.name.startswith(_MEMORY)
    )  # fmt: skip
    return found, tuple(one for one in found if one[2])


class RegisterWalker:
    """One episode of a walk, under way."""

    def __init__(self, walk: RegisterWalk, episode: int) -> None:
        self.walk, self.episode = walk, episode
        self._random = random.Random(f"{walk.name} {episode}")
        self._now, self._other = boards(is_alone=walk.is_alone)
        self._by_program = episode % 3 == 2
        for each in (self._now, self._other):
            each.begin(episode % 4)
        self.lines: list[str] = []
        self._done: list[str] = []
        self._seen: dict[str, object] = {}
        self._raw: dict[str, bytes] = {}
        self._ports, self._wires, self._drives = b"", "", ""

    # What decides, from the random numbers: `random` alone is the same on every version of Python.

    def number(self, below: int) -> int:
        """Return 0 up to and without a bound."""
        return int(self._random.random() * below)

    def pick(self, items: Sequence[_Item]) -> _Item:
        """Return one of some."""
        return items[self.number(len(items))]

    def turn_of(self, items: Sequence[_Item], every: int = 1) -> _Item:
        """Return one of some: each in its turn, by the episode."""
        return items[self.episode // every % len(items)]

    def some(self, *bits: int) -> int:
        """Return a word with some of these bits."""
        return sum(bit for bit in bits if self.number(2))

    # What is done.

    @property
    def board(self) -> BluePill:
        """The board."""
        return self._now.board

    @property
    def node(self) -> CanNode:
        """The other node on its CAN."""
        return self._now.node

    @property
    def network(self) -> CanNetwork:
        """Its CAN."""
        return self._now.network

    @property
    def host(self) -> CountingUsbHost:
        """What stands at the other end of its USB cable."""
        return self._now.host

    def part(self, name: str) -> Any:
        """Return a peripheral."""
        return self.board.chip.parts.by_name[name]

    def note(self, text: str) -> None:
        """Write down what is done."""
        self._done.append(text)

    def write(self, name: str, value: int, size: int = 4, byte: int = 0) -> None:
        """Write a register, "I2C1.CR1", or bytes of it."""
        part, register = self._found(name)
        self.note(f"{name}{f'+{byte}' if byte else ''}={value:#x}{'' if size == 4 else f':{size}'}")
        if not self._by_program or self._accessed(size, part.base + register.offset + byte, value) is None:
            part.write(register.offset + byte, size, value)

    def read(self, name: str) -> int:
        """Read a register, with all that a read causes."""
        part, register = self._found(name)
        found = self._accessed("load", part.base + register.offset) if self._by_program else None
        value = int(part.read(register.offset, 4) if found is None else found)
        self.note(f"{name}?{value:#x}")
        return value

    def _accessed(self, access: object, address: int, value: int = 0) -> int | None:
        """Have a program make an access; return what R2 is then; nothing where the core does not sleep before it."""
        board = self.board
        engine: Any = board.chip.engine
        end_ns, shared = board.now_ns + _PROGRAM_NS, engine.shared
        if not board.is_asleep:
            return None
        shared.access_cycle = 0
        for register, word in ((Reg.R0, 1 + self.number(_MOST_ROUNDS)), (Reg.R1, address), (Reg.R2, value)):
            engine.registers[register] = word
        engine.jump(self._now.entries[access] | 1)
        board.chip.processor.wake()
        while not board.is_asleep and board.now_ns < end_ns:
            board.advance_to(min(board.now_ns + _STEP_NS, end_ns))
        if shared.access_cycle:  # the core has worked it out, since the part needs it
            self.note(f"in cycle {shared.access_cycle}")
        return int(engine.registers[Reg.R2])

    def attempt(self, act: Callable[[], object]) -> None:
        """Do what may be refused, and note how."""
        try:
            act()
        except ValueError as refusal:
            self.note(str(refusal))

    def look(self, name: str) -> int:
        """Return what stands in a register, and cause nothing."""
        part, register = self._found(name)
        return int(part.words[register.offset // 4])

    def turn(self, name: str, *, on: int = 0, off: int = 0) -> None:
        """Set and clear bits of a register."""
        self.write(name, self.look(name) & ~off | on)

    def run(self, ns: int) -> None:
        """Let time pass."""
        self.note(f"+{ns}")
        self.board.advance_to(self.board.now_ns + ns)

    def drive(self, pin: str, level: bool | None) -> None:
        """Hold a pin from outside, or let it go."""
        self.note(f"{pin}:{level}")
        self.board.pin(pin).drive(level)

    def put(self, data: bytes) -> None:
        """Fill what DMA reads."""
        self.board.chip.memory.write(BUFFER, data)

    def poke(self) -> None:
        """Write a register at random."""
        name = self.walk.parts[0] if self.number(10) < 7 else self.pick(self.walk.parts)
        part = self.part(name)
        registers = [one for one in part.REGISTERS if not one.name.startswith(_MEMORY)]
        register = self.pick(registers)
        word, kind = self._random.getrandbits(32), self.number(100)
        stored = int(part.words[register.offset // 4])
        if kind < _FIELD:
            field = self.pick(fields_of(register.fields) or fields_of("W 31:0"))
            mask = (1 << field.high - field.low + 1) - 1 << field.low
            word = stored & ~mask | word & mask
        elif kind >= _ANYTHING:
            word = WORD if kind < _ONES else 0
        size = self.pick((1, 2)) if self.number(100) < _NARROW else 4
        byte = 0 if size == 4 else size * self.number(4 // size)
        self.write(f"{name}.{register.name}", word & (1 << 8 * size) - 1, size, byte)

    def peek(self) -> None:
        """Read a register at random."""
        name = self.pick(self.walk.parts)
        register = self.pick([one for one in self.part(name).REGISTERS if not one.name.startswith(_MEMORY)])
        self.read(f"{name}.{register.name}")

    def freeze(self) -> None:
        """Have a debugger halt the core for a while, with the part's clock, or have that clock stand still."""
        part = self.part(self.walk.parts[0])
        span_ns = self.pick(self.walk.spans_ns)
        self.note(f"frozen {span_ns}")
        stop, go_on = self.pick(((part.freeze, part.thaw), (part.clock_stopped, part.clock_resumed)))
        stop()
        self.board.advance_to(self.board.now_ns + span_ns)
        if not self.number(4):
            self.reset()
        go_on(span_ns)

    def change_clocks(self) -> None:
        """Divide the buses' clocks otherwise."""
        self.write("RCC.CFGR", self.look("RCC.CFGR") & ~0x3FF0 | self.pick((0, 0x400, 0x2000, 0x80, 0x6580, 0x500)))

    def hurry(self) -> None:
        """Have the PLL make 72 MHz of the crystal."""
        self.write("FLASH.ACR", 0x12)
        self.turn("RCC.CR", on=1 << 16)
        self.run(2_000_000)
        self.write("RCC.CFGR", 1 << 16 | 7 << 18 | 4 << 8)
        self.turn("RCC.CR", on=1 << 24)
        self.run(200_000)
        self.turn("RCC.CFGR", on=2)

    def remap(self) -> None:
        """Move a peripheral to other pins."""
        self.write("AFIO.MAPR", 2 << 24 | self.pick((0, *self.walk.remaps)))

    def reset(self) -> None:
        """Reset the part alone."""
        self.note("reset")
        self.part(self.walk.parts[0]).reset()

    # The episode.

    def go(self) -> list[str]:
        """Go the whole way; return a line for each step."""
        if self.episode:
            self._step(self._begin)
            middle = self.number(self.walk.steps)
            for n in range(self.walk.steps):
                if n == middle:
                    self._change_boards()
                self._step(self._move)
        else:
            self._sweep()
        return self.lines

    def _begin(self) -> None:
        """Free the debugger's pins, and set up a mode."""
        self.write("AFIO.MAPR", 2 << 24)
        if not self.number(6):
            self._share_pins()
        if self.episode % 9 == 7 and self.board.hclk_hz == _SLOW_HZ:
            self.hurry()
        self.walk.begin(self)

    def _share_pins(self) -> None:
        """Have timers offer their outputs to pins that others have too."""
        self.write("TIM1.BDTR", 0x8000)
        for name in ("TIM1", "TIM2", "TIM3", "TIM4"):
            self.write(f"{name}.CCER", self.pick((0x1111, 0x5555, 0x0010)))

    def _sweep(self) -> None:
        """Write ones and zeros into every register, and look."""
        for name in self.walk.parts:
            for register in self.part(name).REGISTERS:
                if not register.name.startswith(_MEMORY):
                    for word in (WORD, 0, 0xAAAA_AAAA, 0x5555_5555):
                        self._step(partial(self.write, f"{name}.{register.name}", word))
            self._step(self.reset)
            self._step(partial(self._ask, self.part(name)))

    def _ask(self, part: Any) -> None:
        """Give each command that its device in C knows, and note what it answers."""
        named = [one for kind in part.ENUMS if kind.__name__.endswith("Command") for one in kind]
        for command in [*(named or [OWN_COMMANDS]), _NO_COMMAND] if part.KIND else []:
            self.note(f"command {command:d}: {part.command(command, 1, 1)}")

    def _move(self) -> None:
        kind = self.number(100)
        if kind < self.walk.at_random:
            (self.peek if kind % 5 == 0 else self.poke)()
        elif 91 <= kind < 94:
            self.remap()
        elif 94 <= kind < 97:
            self.change_clocks()
        elif 97 <= kind < 99:
            self.freeze()
        elif kind == 99:
            self.reset()
            self._begin()
        else:
            self.pick(self.walk.moves)(self)
        if self.number(4):
            self.run(self.pick(self.walk.spans_ns))

    def _change_boards(self) -> None:
        """Have the other board go on from here."""
        self._other.go_on_from(self._now.saved())
        self._now, self._other = self._other, self._now
        self._now.calls.clear()

    def _step(self, act: Callable[[], None]) -> None:
        self._done.clear()
        act()
        self.board.chip.deliver()
        counts = sorted(self._now.calls.items())
        calls = " ".join(f"{name} {count}" for name, count in counts if not name.endswith(_OF_OTHERS))
        now = dict(self._all())
        changed = [
            f"{name} {value:#x}" if isinstance(value, int) else f"{name} {value}"
            for name, value in now.items() if self._seen.get(name) != value
        ]  # fmt: skip
        self._seen |= now
        heard = self._now.heard
        if len(heard) > _SHOWN:
            heard[_SHOWN:] = [f"and {len(heard) - _SHOWN} more: {zlib.crc32(' '.join(heard).encode()):08x}"]
        self.lines.append(f"{' '.join(self._done)} | {', '.join(changed)} | {' '.join(heard)} | {calls}".rstrip(" |"))
        heard.clear()
        self._now.calls.clear()

    def _all(self) -> Iterator[tuple[str, object]]:
        """Go through all that can be seen now; of parts that hold what they held, what only they can say."""
        board = self.board
        for name in (*self.walk.parts, *self.walk.beside):
            part: Any = board.chip.parts.by_name[name]
            words = part.words
            raw = words.tobytes()
            is_same, self._raw[name] = raw == self._raw.get(name), raw
            for key, place, is_asked in _looked_at(type(part), name)[is_same]:
                yield key, part.look(4 * place) if is_asked else words[place]
            if len(words) > _USUAL_WORDS and not is_same:
                yield f"{name} memory", zlib.crc32(memoryview(words)[_USUAL_WORDS:])
            yield f"{name} acts", part.due_ns
            if part.native is not None:
                yield f"{name} holds", f"{_without_gaps(part.native):08x}"
        lines = board.chip.pins.fabric.lines
        yield "lines", " ".join(str(n) for n, level in enumerate(lines) if level)
        yield "pending", board.chip.processor.nvic.pending
        ports = board.chip.pins.fabric.ports
        if ports != self._ports:
            self._ports = ports
            self._wires = "".join("01"[pin.level] for pin in board.pins)
            self._drives = "".join(_LETTERS[pin.output] for pin in board.pins)
        yield "wires", self._wires
        yield "drives", self._drives
        yield "waves", f"{_without_gaps(board.chip.pins.fabric.wave_structs):08x}"
        yield "routes", " ".join(f"{name} {route}" for name, route in board.chip.pins.remaps.items() if route)
        yield "memory", zlib.crc32(board.read_memory(BUFFER, BUFFER_BYTES) or b"")
        yield "warnings", _PLACE.sub("", " / ".join(board.warnings))
        yield "resets", " ".join(f"{cause.name} {count}" for cause, count in board.resets.items())
        clocks = board.chip.clocks
        yield "clocks", " ".join(str(getattr(clocks, name)) for name in _CLOCKS)

    def _found(self, name: str) -> tuple[Any, Register]:
        base, _, register = name.partition(".")
        part = self.part(base)
        return part, next(one for one in part.REGISTERS if one.name == register)
