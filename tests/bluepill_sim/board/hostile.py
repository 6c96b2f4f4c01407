"""Programs that write anything anywhere in the registers of a chip, with a world that does anything to its pins.

A program walks a table of steps in flash: stores and loads of each width, WFI, WFE, SVC, masks, short waits. Each
handler takes the next step too, so that a storm of interrupts goes on through the table; a fault goes on behind what
faulted, and a reset with the step after it. What the world does comes at its times. Everything follows from a seed.
"""

import hashlib
import pickle
import random
import struct
from typing import Any

from bluepill_sim.fabric.signals import Oscillation, Waveform
from bluepill_sim.fabric.subscriptions import EDGE, Of
from bluepill_sim.parts import CanFrame, CanNetwork, CanNode, Eeprom24C02
from bluepill_sim.peripherals.spi import Loopback
from tests.bluepill_sim.machine import CODE, Machine

STEPS = 1024
TABLE, INDEX, BUFFER = 0x0800_2000, 0x2000_0040, 0x2000_2000
US, MS = 1_000, 1_000_000
STORES, LOADS, SIZES = (0, 1, 2), (3, 4, 5), (4, 2, 1)
WAIT_INTERRUPT, WAIT_EVENT, CALL, MASK = 6, 7, 8, 9
#: Each kind of step, in the order of the numbers above. r1: address, r2: value.
_KINDS = (
    "str r2, [r1, #0]", "strh r2, [r1, #0]", "strb r2, [r1, #0]", "ldr r2, [r1, #0]", "ldrh r2, [r1, #0]",
    "ldrb r2, [r1, #0]", "wfi", "wfe", "svc #0", "msr basepri, r2",
)  # fmt: skip
PROGRAM = (
    f"""mov32 r0, #0x40021014
mov32 r1, #0x55
str r1, [r0, #0]
mov32 r1, #0x7E7D
str r1, [r0, #4]
mov32 r1, #0x1AE64807
str r1, [r0, #8]
mov32 r0, #0xE000E010
mov32 r1, #1499
str r1, [r0, #4]
movs r1, #7
str r1, [r0, #0]
loop: bl step
b loop
irq: push {{r4, lr}}
bl step
pop {{r4, pc}}
fault: ldr r1, [sp, #24]
adds r1, #2
str r1, [sp, #24]
bx lr
step: push {{r4-r6, lr}}
mov32 r4, #{INDEX}
ldr r0, [r4, #0]
adds r0, #1
str r0, [r4, #0]
.half 0x0580
.half 0x0C80
mov32 r5, #{TABLE}
adds r5, r5, r0
ldr r6, [r5, #0]
ldr r1, [r5, #4]
ldr r2, [r5, #8]
ldr r3, [r5, #12]
"""
    + "".join(f"cmp r6, #{n}\nbne past{n}\n{text}\npast{n}: " for n, text in enumerate(_KINDS))
    + """cmp r3, #0
beq done
wait: subs r3, #1
bne wait
done: pop {r4-r6, pc}"""
)
VECTORS: dict[int, str | int] = dict.fromkeys(range(2, 16 + 43), "irq") | dict.fromkeys((3, 4, 5, 6), "fault")
#: Registers of the core, with how often each is chosen.
_SYSTEM = (
    *(0xE000_E010 + 4 * n for n in range(4)), *(0xE000_E100 + 0x80 * k + 4 * n for k in range(5) for n in (0, 1)),
    *(0xE000_E400 + 4 * n for n in range(11)), *(0xE000_ED04 + 4 * n for n in range(13) if n not in {1, 2}),
    0xE000_ED0C, 0xE000_EF00, 0xE000_EDF0, 0xE000_EDFC, 0xE004_2000, 0xE004_2004, 0xE000_E008, 0xE000_ED90, 0xE000_ED94,
    *(0xE000_1000 + 4 * n for n in range(24)), *(0xE000_2000 + 4 * n for n in range(10)),
    *(0xE000_0000 + 4 * n for n in range(32)), 0xE000_0E00, 0xE000_0E40, 0xE000_0E80, 0xE000_0FB0,
    0xE004_0004, 0xE004_0010, 0xE004_00F0, 0xE004_0304,
)  # fmt: skip
#: What does more than chance would: memory, flash, registers to be copied, keys.
_PLACES = (
    BUFFER, BUFFER + 3, TABLE, INDEX, 0x4001_244C, 0x4001_3804, 0x4001_300C, 0x4000_5410, 0x4001_0810, 0x0800_0100,
    0x4000_044C, 0x4001_2C4C, 0x0000_1000,
)  # fmt: skip
_KEYS = (0x5555, 0xCCCC, 0xAAAA, 0x4567_0123, 0xCDEF_89AB, 0xC5AC_CE55, 0x05FA_0000, 0x05FA_0300)
#: What buses need before chance can make them work: stores that a story may begin with, and then what sends.
_SET_UP = (
    ((0x4001_0804, 0x444B_4444), (0x4000_6400, 1), (0x4000_641C, 0x0014_0001), (0x4000_6600, 1), (0x4000_660C, 1),
     (0x4000_661C, 1), (0x4000_6600, 0), (0x4000_6400, 0), (0x4000_6584, 2), (0x4000_6580, 0x2460_0001)),
    ((0x4001_0C00, 0xDD44_4444), (0x4000_5404, 8), (0x4000_541C, 40), (0x4000_5400, 1), (0x4000_5400, 0x501)),
    ((0x4000_5C40, 1), (0x4000_5C40, 0), (0x4000_5C44, 0), (0x4000_5C4C, 0x80), (0x4000_5C00, 0x3220)),
    # A synchronous USART: PA8 and PA9, its clock, characters.
    ((0x4001_0804, 0x4444_44BB), (0x4001_3808, 16), (0x4001_3810, 0x0F00), (0x4001_380C, 0x200C), (0x4001_3804, 0x35)),
    # FPB: the first word of the program's table read as another, a word of it that nobody runs as code.
    ((0xE000_2004, BUFFER - 0x2000_0000), (0xE000_2008 + 24, TABLE | 1), (0xE000_2008, 0x0800_3FF1), (0xE000_2000, 3)),
)  # fmt: skip
#: Where nothing is: a store there is an imprecise fault.
_HOLES = (0x2200_0000, 0x4200_0000, 0x6000_0000, 0x1FFF_0000, 0xF000_0000, 0x2000_5000, 0x0800_0100, 0x1FFF_F800)
#: What may stand in the FPB's table: `nop` twice, `movs r2, #0`, `bx lr`.
_WORDS, PPB = (0xBF00_BF00, 0x2200_BF00, 0x4770_BF00, 0x4770_4770), 0xE000_0000
_PINS = [f"P{port}{n}" for port in "AB" for n in range(16)]


class Story:
    """What one seed makes of a chip; `names` are the peripherals that are written to, None for all and the core."""

    def __init__(self, seed: int, most_ms: int = 12, names: tuple[str, ...] | None = None) -> None:
        self.seed, self.names = seed, names
        rng = random.Random(seed)
        self.wants_core = names is None
        self._registers = self._found(rng)
        begun = [(STORES[0], BUFFER, 0, 0)]  # the program begins with the second
        begun += [(STORES[0], *row, 400) for one in _SET_UP if self.wants_core and rng.random() < 0.5 for row in one]
        self._rows = [*begun, *(self._row(rng) for _ in range(STEPS - len(begun)))]
        self.end_ns = rng.randrange(1, most_ms) * MS
        self._world = sorted((rng.randrange(20 * US, self.end_ns), rng.getrandbits(64)) for _ in range(40))
        self.watched = [*rng.sample(_PINS, 3), *(["PA8"] if rng.random() < 0.3 else [])]

    def _found(self, rng: random.Random) -> list[int]:
        parts = Machine("nop", {}).board.chip.parts.by_name
        names = list(parts) if self.names is None else list(self.names)
        chosen = names if self.names is not None else rng.sample(names, rng.randrange(2, len(names)))
        found = []
        for name in chosen:
            part = parts[name]
            found += [
                [part.base + register.offset for register in part.REGISTERS] + [part.base + rng.randrange(0, 0x80, 4)]
            ]
        self._groups = found
        return [address for group in found for address in group]

    def _value(self, rng: random.Random) -> int:
        kind = rng.random()
        if kind < 0.35:
            return sum(1 << rng.randrange(rng.choice((8, 16, 32))) for _ in range(rng.randrange(1, 5))) & 0xFFFF_FFFF
        if kind < 0.6:
            return rng.randrange(64)
        if kind < 0.75:
            return rng.getrandbits(32)
        if kind < 0.85:
            return rng.choice(_PLACES)
        if kind < 0.87:
            return rng.choice(_KEYS)
        return rng.choice((0, 0xFFFF_FFFF, 0xFFFF, rng.getrandbits(16), 0xBBBB_BBBB, 0x1111))

    def _row(self, rng: random.Random) -> tuple[int, int, int, int]:
        wait, kind = rng.choice((0, 0, 0, 0, 1, 5, 40, rng.randrange(400))), rng.random()
        if kind < 0.015:
            return rng.choice((WAIT_INTERRUPT, WAIT_EVENT)), 0, 0, wait
        if kind < 0.03:
            return rng.choice((CALL, MASK)), 0, rng.choice((0, rng.getrandbits(8))), wait
        if self.wants_core and kind < 0.2:
            address, value = rng.choice(_SYSTEM), self._value(rng)
            if address == 0xE000_ED10 and rng.random() < 0.9:
                value &= ~4  # else most stories would end in Stop
            if 0xE000_E180 <= address < 0xE000_E200 or address == 0xE000_E010:
                value &= rng.getrandbits(32)
        elif self.wants_core and kind < 0.205:
            address, value = rng.choice(_HOLES), 1
        elif self.wants_core and kind < 0.215:  # comparators for words of the program, and what they lead to
            address = rng.choice((*(0xE000_2008 + 4 * n for n in range(8)), *(BUFFER + 4 * n for n in range(8))))
            value = (
                rng.choice((CODE, TABLE, CODE + 4 * rng.randrange(90))) | 1 if address >= PPB else rng.choice(_WORDS)
            )
        else:
            address, value = rng.choice(rng.choice(self._groups)), self._value(rng)
        if 0x4002_1014 <= address < 0x4002_1020 and rng.random() < 0.9:
            value = 0xFFFF_FFFF  # clocks mostly stay
        n = rng.choice((0, 0, 0, 1, 2))
        address += rng.randrange(0, 4, SIZES[n])
        return rng.choice((STORES, STORES, STORES, LOADS))[n], address, value, wait

    def machine(self) -> Machine:
        """Return a chip with its program, at its reset."""
        rows = b"".join(struct.pack("<4I", *row) for row in self._rows).ljust(16 * STEPS, b"\xff")
        made = Machine(PROGRAM, VECTORS)
        made.board.chip.memory.load_flash(TABLE - 0x0800_0000, rows)
        made.board.chip._drop_flash()
        return made

    def act(self, board: Any, what: int) -> None:
        """Do one thing of the world."""
        rng = random.Random(what)
        kind = rng.randrange(12)
        if kind < 5:
            board.pin(rng.choice(_PINS)).drive(rng.choice((True, False, None)))
        elif kind == 5:
            rng.choice((board.usart1, board.usart2, board.usart3)).receive(rng.randbytes(rng.randrange(1, 5)))
        elif kind == 6:
            volts: Any = rng.choice(
                (1.1, Oscillation(shape=Waveform.SINE, low_v=0.1, high_v=3.0, period_ns=rng.randrange(1000, MS)))
            )
            board.pin(f"PA{rng.randrange(8)}").set_volts(volts)
        elif kind == 7:
            board.chip.parts.by_name[f"I2C{rng.randrange(1, 3)}"].call(
                rng.randrange(128), rng.randbytes(2), rng.randrange(3)
            )
        elif kind == 8:
            board.chip.parts.by_name[f"SPI{rng.randrange(1, 3)}"].clock_in([rng.randrange(256)], 1_000_000)
        elif kind == 9:
            board.crystal_works = rng.random() < 0.8
        elif kind == 10:
            board.supply_v = rng.choice((2.0, 2.5, 3.3))
        else:
            board.temperature_c = rng.randrange(-40, 85)

    def play(self, cuts: int = 0, forks: int = 0) -> str:
        """Return a hash of all that can be seen on the way and in the end.

        Args:
            cuts: a seed of the slices in which it goes on; 0: from one thing of the world to the next.
            forks: of the times at which it goes on from a snapshot, on another board; 0: never.
        """
        heard: list[tuple[Any, ...]] = []
        board, seen = self._listened(self.machine(), heard), hashlib.sha256()
        cutter, forker = random.Random(cuts), random.Random(forks)
        edges: list[tuple[Any, ...]] = []
        pins = board.subscribe_pins(self.watched, lambda rows: edges.extend(EDGE.iter_unpack(rows)), of=Of.WIRE)
        for at, what in [*self._world, (self.end_ns, -1)]:
            while cuts and board.now_ns < at:
                board.advance_to(min(at, board.now_ns + cutter.choice((1, 125, 999, 20_000, 300_000))))
            board.advance_to(at)
            if forks and forker.random() < 0.1:
                kept = pickle.dumps(board.snapshot())
                pins.close()
                board = self._listened(self.machine(), heard)
                board.restore(pickle.loads(kept))  # noqa: S301 - our own bytes
                pins = board.subscribe_pins(self.watched, lambda rows: edges.extend(EDGE.iter_unpack(rows)), of=Of.WIRE)
            if what >= 0:
                self.act(board, what)
        heard.sort(key=lambda row: row[0])  # buses hand on in bulk, one after the other
        seen.update(repr((board.cycle, board.pc, edges, heard, board.snapshot())).encode())
        return seen.hexdigest()

    @staticmethod
    def _listened(machine: Machine, heard: list[tuple[Any, ...]]) -> Any:
        """Return a board with parts on its buses, and have what goes over each written down."""
        board = machine.deafen().board
        for name in ("SPI1", "SPI2", "I2C1", "I2C2", "CAN"):
            part = board.chip.parts.by_name[name]
            part.subscribe(lambda rows, name=name: heard.extend((name, repr(row)) for row in rows))
        board.usb_serial.subscribe(lambda rows: heard.extend(("USB", *row) for row in rows))
        board.usb.plug()
        for name in ("I2C1", "I2C2"):
            board.i2c(name, Eeprom24C02())
        board.spi("SPI1", Loopback())
        network = CanNetwork()
        board.can(network)
        node = CanNode()
        network.join(node)
        for n in range(3):
            node.send(CanFrame(identifier=0x100 + n, data=bytes([n])), (n + 1) * 300 * US)
        return board
