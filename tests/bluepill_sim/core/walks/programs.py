"""Programs at random that do what a Cortex-M3 has beside arithmetic, for all cores alike.

A program is a list of pieces: stores to the system registers and to peripherals of every width and by every kind of
instruction, bit-banding, interrupts with all priorities and masks, faults of every kind, sleep, loops that wait, other
stacks, code in SRAM, vectors elsewhere. Each stands in its own 2 KB of flash, and a little, with its own vectors.

R7 is the middle of a scratch area, R11 says where the program goes on behind a fault. All handlers note what they serve
in SRAM, in order: a product sum at `NOTES`.

Source of what a piece relies on: ARMv7-M Architecture Reference Manual B1.5, B3.2; RM0008 3.3, 9.2, 15.4.
"""

import random
import struct
from collections.abc import Callable

from bluepill_sim.program.image import Image, SymbolTable
from tests.bluepill_sim.core.thumb_streams import SCRATCH, Stream
from tests.bluepill_sim.machine import COUNTER_ON, FLASH, STACK, Assembler

#: What a program has of the flash; its code stands behind its vectors.
ROOM, CODE_AT, EXCEPTIONS = 0x880, 0x140, 76
#: SRAM: what handlers note, a copy of the vectors, code, the process stack.
NOTES, VECTORS, CODE, PROCESS_STACK = 0x2000_0100, 0x2000_2000, 0x2000_3000, 0x2000_4000
_PIECES = 15

#: System registers that a program writes, and which bits of a random word.
_SYSTEM = (
    (0xE000E010, 7), (0xE000E014, 0x3FF), (0xE000E018, 0xFF), (0xE000E100, 0xFFFF_FFFF), (0xE000E104, 0x7FF),
    (0xE000E180, 0xFFFF_FFFF), (0xE000E184, 0xFFFF_FFFF), (0xE000E200, 0x0040_0FFF), (0xE000E204, 0x7FF),
    (0xE000E280, 0xFFFF_FFFF), (0xE000E284, 0xFFFF_FFFF), (0xE000E300, 0xFF), (0xE000E400, 0xFFFF_FFFF),
    (0xE000E404, 0xFFFF_FFFF), (0xE000E408, 0xF0F0_F0F0), (0xE000E414, 0xFFFF_FFFF), (0xE000E428, 0xFFFF_FFFF),
    (0xE000E42C, 0xFFFF_FFFF), (0xE000ED04, 0x9E00_0000), (0xE000ED10, 0x12), (0xE000ED14, 0x31B),
    (0xE000ED18, 0xFFFF_FFFF),
    (0xE000ED1C, 0xFFFF_FFFF), (0xE000ED20, 0xFFFF_FFFF), (0xE000ED24, 0x7FFFF), (0xE000ED28, 0xFFFF_FFFF),
    (0xE000ED2C, 0xFFFF_FFFF), (0xE000ED30, 0x1F), (0xE000ED34, 0xFFFF_FFFF), (0xE000ED38, 0xFFFF_FFFF),
    (0xE000E008, 7), (0xE000EDFC, 0x0102_0000), (0xE0001000, 1), (0xE0001004, 0xFFFF_FFFF), (0xE000EF00, 0x1FF),
    (0xE0000004, 0xFFFF_FFFF), (0xE0000E00, 0xFF), (0xE0042004, 0x100), (0xE000EF90, 1), (0xE000E4F0, 1),
)  # fmt: skip
_READ_ALONE = (0xE000ED00, 0xE000ED08, 0xE000ED0C, 0xE000E01C, 0xE000ED90, 0xE0042000, 0xE000E004, 0xE0002000)
#: Registers of peripherals: GPIOA and GPIOC with clocks, GPIOB, SPI2 and I2C1 without, TIM2, TIM3, USART1, AFIO, EXTI,
#: CRC, RCC, DMA1, FLASH, BKP, PWR, and nothing at all.
_PERIPHERALS = (
    *(0x4001_0800 + 4 * n for n in range(7)), 0x4001_1004, 0x4001_100C, 0x4001_1010, 0x4001_0C00, 0x4001_0C0C,
    0x4000_380C, 0x4000_5400, *(0x4000_0000 + offset for offset in (0, 0xC, 0x10, 0x14, 0x24, 0x28, 0x2C, 0x34)),
    0x4000_0424, 0x4000_042C, 0x4001_3800, 0x4001_3808, 0x4001_3810, 0x4001_0008, 0x4001_000C, 0x4001_0400,
    0x4001_0408, 0x4001_0410, 0x4001_0414, 0x4002_3000, 0x4002_3004, 0x4002_1014, 0x4002_0008, 0x4002_0010,
    0x4002_0014, 0x4002_2000, 0x4000_6C04, 0x4000_7000, 0x4000_7C00, 0x4001_5000, 0x4001_8000, 0x4001_37FC,
    0x4002_3FFC, 0x4000_2C00, 0x4001_081C,
)  # fmt: skip
#: What accesses of one block reach: registers that need their time or not, with a clock and without, no register, the
#: system's registers, SRAM, bits of both.
_MIXED = (
    0x4001_0800, 0x4001_1008, 0x4001_0C00, 0x4000_3800, 0x4000_5400, 0x4000_0000, 0x4000_0020, 0x4001_3800, 0x4001_5000,
    0x4001_8000, 0x4002_3000, 0x4002_1014, 0x4001_0408, 0xE000_E010, 0xE000_E100, 0xE000_ED18, 0xE000_1000, SCRATCH,
    0x2200_0000 + 32 * (SCRATCH - 0x2000_0000), 0x4200_0000 + 32 * 0x1_080C, 0x4200_0000 + 32 * 0x1_0C0C,
)  # fmt: skip
#: What faults, or does for some of these bits of CCR and masks: (instructions, whether they leave the registers).
_FAULTS = (
    "udf", ".half 0xF7F0, 0xA000", "mov32 r1, #0x60000000\nldr r0, [r1, #0]",
    "mov32 r1, #0x60000001\nstrb r0, [r1, #0]",
    "mov32 r1, #0x60000000\nstr r0, [r1, #4]\nadds r4, #1\nadds r4, #1", "mov32 r1, #0x60000000\nldmia r1!, {r0, r2}",
    "mov32 r1, #0x20005000\nldr r0, [r1, #0]", "mov32 r1, #0x20004FFE\nldr r0, [r1, #0]",
    "mov32 r1, #0x20004FFD\nstr r0, [r1, #0]",
    "mov32 r1, #0x08000001\nldr r0, [r1, #0]", "mov32 r1, #0x08000000\nstr r0, [r1, #0]",
    "mov32 r1, #0x20000202\nldmia r1!, {r0, r2}",
    "mov32 r1, #0x20000201\nstrd r0, r2, [r1]", "movs r1, #0\nudiv r0, r0, r1", "movs r1, #0\nsdiv r0, r0, r1",
    ".half 0xEE00, 0x0A10", "mov32 r1, #0x20000200\nbx r1", "mov32 r1, #0x40010001\nbx r1",
    "mov32 r1, #0x70000001\nbx r1",
    "mov32 r1, #0xFFFFFFF9\nbx r1",
    *(f"mov32 r1, #{at}\nbx r1" for at in (0x5FFF_FFFF, 0x6000_0001, 0x9FFF_0001, 0xA000_0001,
                                         0x3FFF_FFFF, 0x1FFF_0001)),
    "mov32 r1, #0xE000E001\nbx r1", "bkpt #3", "mov32 r1, #0x20000203\nldrex r0, [r1]",
    "mov32 r1, #0x1FFFFFFC\nldmia r1!, {r0, r2, r3}", "mov32 r1, #0x20004FF8\nldmia.w r1, {r0, r2, r3, r4}",
    "mov32 r1, #0x1FFF0000\nldr r0, [r1, #0]", "mov32 r1, #0xE0050000\nldr r0, [r1, #0]",
    "mov32 r1, #0xE000ED02\nldrh r0, [r1, #0]",
    "mov32 r1, #0x22000001\nldrb r0, [r1, #0]", "mov32 r1, #0x40000002\nldrh r0, [r1, #0]",
    "mov32 r1, #0xA0000000\nstr r0, [r1, #0]\ndsb",
)  # fmt: skip

#: Notes the exception in R0, by R1 to R3.
_NOTE = f"""mrs r0, ipsr
mov32 r1, #{NOTES}
ldr r2, [r1, #0]
movs r3, #37
muls r2, r3
adds r2, r2, r0
mov32 r0, #0xE000ED04
ldr r3, [r0, #32]
adds r2, r2, r3
ldr r3, [r0, #0]
adds r2, r2, r3
str r2, [r1, #0]
"""
#: A fault goes on at R11 outside IT blocks, with the bits of its status cleared.
_FAULT = f"""{_NOTE}mov32 r1, #0xE000ED28
ldr r0, [r1, #0]
str r0, [r1, #0]
adds r6, r6, r0
mov32 r3, #4
mov r0, lr
.half 0x4218
bne process
mrs r0, msp
b found
process: mrs r0, psp
found: .half 0xF8C0, 0xB018
ldr r1, [r0, #28]
mov32 r2, #0xF80003FF
.half 0x4011
mov32 r2, #0x01000000
.half 0x4311
str r1, [r0, #28]
bx lr
"""
#: An interrupt: its devices are still, and another exception may be made pending.
_INTERRUPT = f"""{_NOTE}movs r0, #0
mov32 r1, #0x40000000
str r0, [r1, #16]
mov32 r1, #0x40010414
mov32 r2, #0xFFFFF
str r2, [r1, #0]
mov32 r1, #0x4001380C
mov32 r2, #0x2008
str r2, [r1, #0]
"""


class ProgramWriter:
    """Writes one program."""

    def __init__(self, dice: random.Random, *, makes_accesses: bool = False) -> None:
        self._dice = dice
        self._stream = Stream(dice)
        self._labels = 0
        self._kinds: tuple[Callable[[], str], ...] = (
            self.arithmetic, self.system, self.system, self.system_read, self.peripheral, self.peripheral, self.several,
            self.conditional, self.ambiguous, self.bits, self.bits, self.unaligned, self.supervisor_call, self.request,
            self.request, self.masks, self.fault, self.fault, self.sleep, self.delay, self.wait, self.exclusive,
            self.process_stack, self.unprivileged, self.sram_code, self.other_vectors, self.odd_stack, self.tick,
            self.timer, self.calls, self.many_reads, self.priorities, self.returns, self.pin_modes,
            self.flash_write, self.narrow,
        )  # fmt: skip
        if makes_accesses:
            self._kinds = (
                *(self.mixed,) * 8, self.several, self.conditional, self.ambiguous,
                self.bits, self.narrow, self.many_reads, self.flash_write, self.tick, self.timer, self.unprivileged,
            )  # fmt: skip

    def written(self, *, has_all_faults: bool = False) -> str:
        """Return the whole program: set up, pieces or each fault once, handlers."""
        pieces = (
            "".join(map(self._guarded, (f"{each}\n" for each in _FAULTS)))
            if has_all_faults
            else "".join(self._guarded(self._dice.choice(self._kinds)()) for _ in range(_PIECES))
        )
        pieces += self._guarded(self._dice.choice((str, str, self.bad_stack))())
        other = self._dice.choice((str, self.request, self.masks, self.system, self.bits, self.peripheral))()
        return (
            f"start: mov32 r7, #{SCRATCH + 0x140}\n"
            "mov32 r1, #0x40021014\nmovs r0, #0x55\nstr r0, [r1, #0]\n"
            "mov32 r0, #0x4015\nstr r0, [r1, #4]\nmovs r0, #3\nstr r0, [r1, #8]\n"
            f"{self.system()}{self.priorities()}{pieces}stop: b stop\n"
            f"fault: {_FAULT}svc_handler: {_NOTE}movs r0, #0\nmsr control, r0\nbx lr\n"
            f"irq: {_INTERRUPT}{other}bx lr\nsystick: {_NOTE}mov32 r1, #{NOTES + 8}\nldr r2, [r1, #0]\nadds r2, #1\n"
            f"str r2, [r1, #0]\nbx lr\npendsv: push {{r4, lr}}\n{_NOTE}{self.peripheral()}pop {{r4, pc}}\n"
            "room: nop\n"
        )  # fmt: skip

    def _label(self) -> str:
        self._labels += 1
        return f"l{self._labels}"

    def _guarded(self, piece: str) -> str:
        """Have a fault in a piece go on behind it."""
        end = self._label()
        return f"mov32 r11, #{end}\n{piece}{end}: nop\n"

    def _halves(self, halves: list[int]) -> str:
        return f".half {', '.join(map(str, halves))}\n" if halves else ""

    def _word(self) -> int:
        return self._dice.choice((self._dice.getrandbits(32), 1 << self._dice.randrange(32), 0, 0xFFFF_FFFF))

    # Pieces.

    def arithmetic(self) -> str:
        """Write what `thumb_streams` makes."""
        kinds = self._stream.single if self._dice.randrange(3) else self._stream.several
        return "".join(self._halves(self._dice.choice(kinds)()) for _ in range(self._dice.randrange(2, 7)))

    def system(self) -> str:
        """Store to system registers."""
        lines = ""
        for _ in range(self._dice.randrange(1, 4)):
            address, bits = self._dice.choice(_SYSTEM)
            name, step = self._dice.choice((("str", 0), ("str", 0), ("str", 0), ("strh", 2), ("strb", 1)))
            address += step * self._dice.randrange(4 // (step or 4))
            lines += f"mov32 r1, #{address}\nmov32 r0, #{self._word() & bits}\n{name} r0, [r1, #0]\n"
            lines += f"mov32 r1, #{address & ~3}\nldr r2, [r1, #0]\nadds r5, r5, r2\n"
        return lines

    def system_read(self) -> str:
        """Load from system registers, of all widths."""
        address = self._dice.choice((*_READ_ALONE, *(row[0] for row in _SYSTEM)))
        return (
            f"mov32 r1, #{address}\nldr r0, [r1, #0]\nadds r4, r4, r0\nldrh r0, [r1, #2]\nadds r5, r5, r0\n"
            f"ldrb r0, [r1, #{self._dice.randrange(4)}]\nadds r6, r6, r0\n"
        )

    def peripheral(self) -> str:
        """Access peripherals, of all widths."""
        lines = ""
        for _ in range(self._dice.randrange(1, 4)):
            name, offset = self._dice.choice(
                (("str", 0), ("str", 4), ("strh", 0), ("strh", 2), ("strb", 0), ("strb", 1), ("strb", 3), ("ldr", 0),
                 ("ldr", 4), ("ldrh", 0), ("ldrh", 2), ("ldrb", 0), ("ldrb", 1))
            )  # fmt: skip
            lines += f"mov32 r1, #{self._dice.choice(_PERIPHERALS)}\n"
            if name.startswith("str"):
                lines += f"mov32 r0, #{self._word()}\n"
            lines += f"{name} r0, [r1, #{offset}]\nadds r4, r4, r0\n"
        return lines

    def several(self) -> str:
        """Access several registers by one instruction."""
        lines = f"mov32 r1, #{self._dice.choice(_PERIPHERALS)}\n"
        for _ in range(self._dice.randrange(1, 4)):
            lines += self._dice.choice(
                ("ldmia r1!, {r0, r2, r3}\n", "stmia r1!, {r0, r2}\n", "ldrd r0, r2, [r1]\n", "strd r0, r2, [r1, #4]\n",
                 "ldmia.w r1, {r2, r4, r6}\n", ".half 0xE911, 0x0015\n", ".half 0xE901, 0x0011\n", "ldr r5, [r1, #8]\n",
                 "ldr r0, [r1, r5]\n", "movs r2, #4\nstr r2, [r1, r2]\n", ".half 0xF851, 0x2B04\n",
                 ".half 0xF841, 0x2D04\n",
                 ".half 0xF851, 0x0022\n")
            )  # fmt: skip
        return lines

    def conditional(self) -> str:
        """Access peripherals in an IT block."""
        inside = (0x680A, 0x600A, 0x684B, 0x604B, 0x3401, 0x784A, 0x800A, 0x3104, 0x3501)
        mask = self._dice.randrange(1, 16)
        count = 5 - (mask & -mask).bit_length()
        halves = [0xBF00 | self._dice.randrange(14) << 4 | mask, *(self._dice.choice(inside) for _ in range(count))]
        return (
            f"mov32 r1, #{self._dice.choice(_PERIPHERALS)}\ncmp r4, #{self._dice.randrange(2)}\n"
            f"{self._halves(halves)}adds r5, r5, r2\n"
        )

    def mixed(self) -> str:
        """Make several accesses in a row, through three registers; and again, when what is warned of once is known."""
        first, other = self._dice.sample(_MIXED, 2)
        bases, label = enumerate((first, other, first + self._dice.choice((0, 4, 8))), 1), self._label()
        lines = f"movs r0, #{self._dice.randrange(2, 5)}\nmov r12, r0\n{label}: "
        lines += "".join(f"mov32 r{n}, #{base}\n" for n, base in bases)
        for _ in range(self._dice.randrange(4, 9)):
            name = self._dice.choice(
                ("ldr r0", "ldr r6", "ldrh r0", "ldrb r6", "str r4", "str r5", "str r7", "strh r4", "strb r5")
            )
            lines += f"{name}, [r{self._dice.randrange(1, 4)}, #{self._dice.choice((0, 4, 4, 8))}]\n"
        return f"{lines}adds r4, r4, r0\nadds r5, r5, r6\nmov r0, r12\nsubs r0, #1\nmov r12, r0\nbne {label}\n"

    def ambiguous(self) -> str:
        """Have two accesses of a block that look alike, with another base between."""
        address = self._dice.choice(_PERIPHERALS)
        return self._dice.choice(
            (
                (
                    f"mov32 r1, #{address}\nmov32 r3, #{SCRATCH}\nstr r1, [r3, #0]\nldr r3, [r3, #0]\n"
                    "ldr r3, [r3, #0]\n"
                    "adds r4, r4, r3\n"
                ),
                (
                    f"mov32 r1, #{address}\nldr r0, [r1, #0]\nadds r1, #4\nldr r2, [r1, #0]\nsubs r1, #4\n"
                    "ldr r3, [r1, #0]\n"
                    "adds r5, r5, r0\nadds r6, r6, r3\n"
                ),
                (
                    f"mov32 r1, #{address}\nstr r1, [r1, #0]\nmov r1, r1\nstr r4, [r1, #0]\nmov r1, r7\n"
                    "str r5, [r1, #0]\n"
                ),
                f"mov32 r1, #{address}\nldmia r1!, {{r0, r2, r3}}\nsubs r1, #12\nldmia r1!, {{r0, r2, r5}}\n",
                f"mov32 r1, #{address + 2}\nldrh r0, [r1, #0]\nadds r1, #0\nldrh r2, [r1, #0]\n",
            )
        )

    def bits(self) -> str:
        """Access single bits by their aliases."""
        places = (
            *(0x2200_0000 + 32 * at for at in (SCRATCH - 0x2000_0000 + self._dice.randrange(64), 0x4FFF, 0x5000)),
            *(0x4200_0000 + 32 * (each - 0x4000_0000) for each in _PERIPHERALS[:24]),
        )
        place = self._dice.choice((places[0], self._dice.choice(places)))
        lines = f"mov32 r1, #{place + 4 * self._dice.randrange(32)}\nmov32 r0, #{self._word()}\n"
        for _ in range(self._dice.randrange(1, 4)):
            name = self._dice.choice(("str", "ldr", "strb", "ldrb", "strh", "ldrh"))
            target = "r0" if name[0] == "s" else "r2"
            lines += f"{name} {target}, [r1, #{4 * self._dice.randrange(3)}]\nadds r4, r4, r2\n"
        return lines

    def unaligned(self) -> str:
        """Access words and halfwords at odd addresses."""
        base = self._dice.choice((SCRATCH, SCRATCH, 0x2000_4FFC, 0x0800_0000, 0x1FFF_F7E0))
        lines = f"mov32 r1, #{base + self._dice.randrange(1, 4)}\n"
        for _ in range(self._dice.randrange(1, 3)):
            name = self._dice.choice(("ldr r0", "str r4", "ldrh r0", "strh r5"))
            lines += f"{name}, [r1, #{4 * self._dice.randrange(2)}]\n"
        return f"{lines}adds r4, r4, r0\n"

    def supervisor_call(self) -> str:
        """Call the supervisor, in an IT block at times."""
        number = self._dice.randrange(256)
        return self._dice.choice(
            (f"svc #{number}\n", f"movs r0, #0\ncmp r0, #0\nitte eq\n.half {0xDF00 | number}, 0x3401, 0x3501\n")
        )

    def request(self) -> str:
        """Make exceptions pending by software."""
        address, word = self._dice.choice(
            ((0xE000EF00, self._dice.randrange(44)), (0xE000ED04, 1 << 28), (0xE000ED04, 1 << 26),
             (0xE000ED04, 1 << 31), (0xE000ED04, 3 << 27), (0xE000E200, 1 << self._dice.randrange(32)),
             (0x40010410, 1 << self._dice.randrange(20)),
             (0xE000E280, 0xFFFF_FFFF))
        )  # fmt: skip
        again = "str r2, [r1, #0]\nadds r4, #1\n" * self._dice.randrange(3)
        return f"mov32 r1, #{address}\nmov32 r2, #{word}\nstr r2, [r1, #0]\n{again}"

    def priorities(self) -> str:
        """Enable interrupts, and give priorities and their groups."""
        lines = f"mov32 r1, #0xE000E100\nmov32 r0, #{self._word() | 0x10000040}\nstr r0, [r1, #0]\nstr r0, [r1, #4]\n"
        for address in (0xE000E400, 0xE000E404, 0xE000E41C, 0xE000ED18, 0xE000ED1C, 0xE000ED20):
            lines += f"mov32 r1, #{address}\nmov32 r0, #{self._dice.getrandbits(32)}\nstr r0, [r1, #0]\n"
        lines += f"mov32 r1, #0xE000ED24\nmov32 r0, #{self._dice.randrange(8) << 16}\nstr r0, [r1, #0]\n"
        return (
            f"{lines}mov32 r1, #0xE000ED0C\nmov32 r0, #{0x05FA0000 | self._dice.randrange(8) << 8}\nstr r0, [r1, #0]\n"
        )

    def masks(self) -> str:
        """Set masks, run something, and mostly clear them."""
        begin = self._dice.choice(
            ("cpsid i\n", "cpsid f\n", f"movs r0, #{self._dice.randrange(256)}\nmsr basepri, r0\n",
             f"movs r0, #{self._dice.randrange(256)}\n.half 0xF380, 0x8812\n", "movs r0, #1\nmsr primask, r0\n",
             "movs r0, #1\nmsr faultmask, r0\n")
        )  # fmt: skip
        within = self._dice.choice(
            (self.request, self.request, self.system, self.arithmetic, self.tick, self.sleep, self.fault)
        )()
        reads = "".join(
            f"mrs r0, {name}\nadds r4, r4, r0\n" for name in ("primask", "basepri", "faultmask", "control", "msp")
        )
        end = "cpsie i\ncpsie f\nmovs r0, #0\nmsr basepri, r0\n" if self._dice.randrange(6) else ""
        return begin + within + reads + end

    def fault(self) -> str:
        """Do what is a fault."""
        return f"{self._dice.choice(_FAULTS)}\nadds r4, #1\n"

    def sleep(self) -> str:
        """Wait for an interrupt or an event."""
        word = self._dice.choice(
            ("wfi", "wfe", "sev\nwfe", "wfi.w", "wfe.w", "sev\nwfe.w\nwfe", "yield", "isb", "dsb\nwfi")
        )
        if not self._dice.randrange(3):  # what is pending is an event, which no mask keeps off (SEVONPEND)
            event = "mov32 r1, #0xE000ED10\nmovs r0, #16\nstr r0, [r1, #0]\ncpsid i\n"
            return f"{event}{self.tick()}wfe\nwfe\nadds r4, #1\ncpsie i\n"
        return f"{self.tick()}{word}\nadds r4, #1\n"

    def delay(self) -> str:
        """Count down."""
        label = self._label()
        lines = self._dice.choice(("", "nop\n", "mov r2, r0\n", "ldr r2, [r7, #0]\n"))
        return f"mov32 r0, #{self._dice.choice((1, 3, 20, 90, 250))}\n{label}: {lines}subs r0, #1\nbne {label}\n"

    def wait(self) -> str:
        """Poll: a word that SysTick's handler counts, a timer, SysTick's flag, the cycle counter, a pin."""
        label = self._label()
        tick = f"cpsie i\nmovs r0, #0\nmsr basepri, r0\n{self.tick()}"
        timer = (
            f"mov32 r1, #0x40000000\nmovs r0, #{self._dice.randrange(5)}\nstr r0, [r1, #40]\nmovs r0, #60\n"
            "str r0, [r1, #44]\nmovs r0, #1\nstr r0, [r1, #20]\nstr r0, [r1, #0]\n"
        )
        return self._dice.choice(
            (
                f"{tick}mov32 r1, #{NOTES}\nldr r2, [r1, #8]\n{label}: ldr r0, [r1, #8]\n.half 0x4290\nbeq {label}\n",
                (
                    f"{tick}mov32 r1, #{NOTES}\nldr r2, [r1, #8]\n{label}: nop\nb {label}b\n"
                    f"{label}b: ldr r0, [r1, #8]\n.half 0x4290\n"
                    f"beq {label}\n"
                ),
                (
                    f"{timer}{label}: ldr r0, [r1, #36]\ncmp r0, #{self._dice.randrange(1, 60)}\nbcc {label}\n"
                    "adds r4, r4, r0\n"
                ),
                f"{timer}{label}: ldr r0, [r1, #16]\n.half 0x0840\nbcc {label}\nadds r4, r4, r0\n",
                f"{tick}mov32 r1, #0xE000E010\n{label}: ldr r0, [r1, #0]\n.half 0x0C40\nbcc {label}\n",
                (
                    f"{tick}mov32 r1, #0xE000E010\n{label}: ldr r0, [r1, #8]\n"
                    f"cmp r0, #{self._dice.randrange(20, 90)}\nbcs {label}\n"
                ),
                (
                    f"{COUNTER_ON}ldr r2, [r0, r1]\nmov32 r1, #0xE0001000\nldr r2, [r1, #4]\nadds r2, #200\n"
                    f"{label}: ldr r0, [r1, #4]\n"
                    f".half 0x4290\nbcc {label}\nadds r4, r4, r0\n"
                ),
                f"mov32 r1, #0x40010808\n{label}: ldr r0, [r1, #0]\n.half 0x0840\nbcc {label}\n",
                f"mov32 r1, #0x40010808\n{label}: ldr r0, [r1, #0]\nmovs r2, #1\n.half 0x4210\nbne {label}\n",
            )
        )

    def pin_modes(self) -> str:
        """Give pins modes, some of which they have already, by code in flash and in SRAM."""
        pin = self._dice.randrange(7)
        bits, mode = 0xF << 4 * pin, self._dice.choice((3, 4, 8, 0)) << 4 * pin
        change = (
            f"mov32 r3, #{bits}\nmov32 r5, #{mode}\nldr r2, [r1, #0]\n.half 0x439A\n.half 0x432A\nstr r2, [r1, #0]\n"
        )
        at, again = CODE + 0x100, self._label()
        return (
            f"mov32 r1, #0x40010800\nmov32 r0, #{self._dice.randrange(2, 5)}\n"
            f"{again}: {change}subs r0, #1\nbne {again}\n"
            f"{change}str r5, [r7, #0]\nldr r2, [r1, #0]\n.half 0x439A\n"
            "ldr r6, [r7, #0]\n"
            f".half 0x4332\nstr r2, [r1, #0]\nmov32 r0, #{at}\nmov32 r6, #0x439A680A\nstr r6, [r0, #0]\n"
            "mov32 r6, #0x600A432A\nstr r6, [r0, #4]\nmov32 r6, #0xBF004770\nstr r6, [r0, #8]\nadds r0, #1\n"
            "blx r0\n"
        )

    def flash_write(self) -> str:
        """Program halfwords behind the program or elsewhere, with waiting and without; some twice, or locked."""
        lines = (
            "mov32 r1, #0x40022000\nmov32 r0, #0x45670123\nstr r0, [r1, #4]\nmov32 r0, #0xCDEF89AB\nstr r0, [r1, #4]\n"
        )
        lines += f"movs r0, #{self._dice.choice((1, 1, 1, 0))}\nstr r0, [r1, #16]\n"
        for _ in range(self._dice.randrange(1, 3)):
            name, wait = self._dice.choice(("strh", "strh", "str", "strb")), self._label()
            place = self._dice.choice((FLASH + 0x1FF10, "room"))
            lines += (
                f"mov32 r3, #{place}\nadds r3, #{2 + 2 * self._dice.randrange(4)}\n"
                f"movs r0, #{self._dice.randrange(256)}\n{name} r0, [r3, #0]\n"
            )
            if self._dice.randrange(3):
                lines += f"{wait}: ldr r0, [r1, #12]\n.half 0x0840\nbcs {wait}\n"
        return f"{lines}ldr r0, [r3, #0]\nadds r4, r4, r0\nmovs r0, #0x80\nstr r0, [r1, #16]\n"

    def narrow(self) -> str:
        """Store bytes and halfwords in a system register that takes all bits."""
        address, begin, other = (
            self._dice.choice((0xE000ED34, 0xE000ED38, 0xE0042004)),
            *self._dice.sample((0, 0xFFFF_FFFF), 2),
        )
        name, offset = self._dice.choice((("strb", 0), ("strb", 1), ("strb", 2), ("strb", 3), ("strh", 0), ("strh", 2)))
        return (
            f"mov32 r1, #{address}\nmov32 r0, #{begin}\nstr r0, [r1, #0]\nmov32 r0, #{other}\n"
            f"{name} r0, [r1, #{offset}]\n"
            f"ldr r0, [r1, #0]\nadds r4, r4, r0\nldrh r0, [r1, #2]\nadds r4, r4, r0\nldrb r0, [r1, #{offset}]\n"
            "adds r5, r5, r0\n"
        )

    def many_reads(self) -> str:
        """Read one register many times in a row."""
        return (
            f"mov32 r1, #{self._dice.choice(_PERIPHERALS)}\n"
            + "ldr r0, [r1, #0]\n" * self._dice.randrange(9, 15)
            + "adds r4, r4, r0\n"
        )

    def exclusive(self) -> str:
        """Reserve a word, maybe lose it to an exception, and store."""
        between = self._dice.choice(("", "svc #1\n", "clrex\n", self.request(), "str r4, [r1, #0]\n"))
        return (
            f"mov32 r1, #{SCRATCH}\nldrex r0, [r1]\nadds r0, #1\n{between}mov32 r1, #{SCRATCH}\n"
            "strex r2, r0, [r1]\nadds r4, r4, r2\n"
        )

    def process_stack(self) -> str:
        """Go on for a while on the process stack."""
        inside = self._guarded(
            self._dice.choice((self.supervisor_call, self.request, self.fault, self.arithmetic, self.tick))()
        )
        return (
            f"mov32 r0, #{PROCESS_STACK + self._dice.randrange(64)}\nmsr psp, r0\nmovs r0, #2\n"
            f"msr control, r0\nisb\n{inside}"
            f"push {{r0, r4}}\npop {{r0, r4}}\nmrs r0, psp\nadds r4, r4, r0\nmovs r0, #0\nmsr control, r0\n"
            "isb\n"
        )

    def unprivileged(self) -> str:
        """Do something without privilege, and come back by SVC."""
        inside = self._guarded(
            self._dice.choice(
                (self.system, self.system_read, self.peripheral, self.masks, self.request, self.bits, self.sleep,
                 self.user_request)
            )()
        )  # fmt: skip
        control, back = self._dice.choice((1, 1, 3)), self._guarded("svc #7\n")
        settings = f"mov32 r1, #0xE000ED14\nmov32 r0, #{self._dice.choice((0x202, 0x200))}\nstr r0, [r1, #0]\n"
        return (
            f"{settings}cpsie i\ncpsie f\nmov32 r0, #{PROCESS_STACK}\nmsr psp, r0\nmovs r0, #0\nmsr basepri, r0\n"
            f"movs r0, #{control}\nmsr control, r0\nisb\n{inside}{back}movs r0, #0\nmsr control, r0\n"
        )

    def user_request(self) -> str:
        """Make an interrupt pending by its number, as a thread without privilege may where USERSETMPEND is set."""
        return f"mov32 r1, #0xE000EF00\nmovs r2, #{self._dice.randrange(44)}\nstr r2, [r1, #0]\nldr r0, [r1, #0]\n"

    def sram_code(self) -> str:
        """Call code in SRAM, change it, and call it again."""
        lines = ""
        at = CODE + 4 * self._dice.randrange(32)
        for _ in range(self._dice.randrange(1, 4)):
            first = self._dice.choice((0x3401, 0x3502, 0x4064, 0x680A, 0x600A, 0xBF00, 0xDF01))
            lines += f"mov32 r1, #{at}\nmov32 r0, #{0x4770 << 16 | first}\nstr r0, [r1, #0]\nadds r1, #1\nblx r1\n"
        loop = (
            f"mov32 r1, #{at}\nmov32 r0, #0x3A013401\nstr r0, [r1, #0]\nmov32 r0, #0x4770D1FC\nstr r0, [r1, #4]\n"
            "movs r2, #9\n"
        )
        return lines + (f"{loop}adds r1, #1\nblx r1\n" if self._dice.randrange(2) else "")

    def other_vectors(self) -> str:
        """Copy the vectors to SRAM, and have them found there; or find those in flash by its other address."""
        label = self._label()
        copy = (
            f"mov32 r1, #0xE000ED08\nldr r0, [r1, #0]\nmov32 r2, #{VECTORS}\nmovs r3, #{EXCEPTIONS}\n"
            f"{label}: ldmia r0!, {{r5}}\nstmia r2!, {{r5}}\nsubs r3, #1\nbne {label}\n"
        )
        to = self._dice.choice((f"mov32 r0, #{VECTORS}\n", "ldr r0, [r1, #0]\nmov32 r2, #0x07FFFFFF\n.half 0x4010\n"))
        return (
            f"{copy}{to}str r0, [r1, #0]\nsvc #9\n"
            if self._dice.randrange(3)
            else f"mov32 r1, #0xE000ED08\n{to}svc #2\n"
        )

    def odd_stack(self) -> str:
        """Take an exception on a stack that is no multiple of 8."""
        align = f"mov32 r1, #0xE000ED14\nmov32 r0, #{self._dice.choice((0, 0x200, 0x218))}\nstr r0, [r1, #0]\n"
        return f"{align}.half 0xB081\n{self._dice.choice(('svc #3', self.request(), 'nop'))}\nnop\n.half 0xB001\n"

    def bad_stack(self) -> str:
        """Take an exception where its frame cannot be stacked: the last that a program does."""
        place = self._dice.choice((0x2000_0010, 0x2000_5014, 0x6000_0000, 0x0800_0100))
        stack = self._dice.choice(("msr msp, r0\n", "msr psp, r0\nmovs r0, #2\nmsr control, r0\nisb\n"))
        trigger = self._dice.choice(
            (
                "svc #1\n",
                "udf\n",
                "mov32 r2, #0x80000000\nstr r2, [r1, #0]\n",
                "mov32 r2, #0x10000000\nstr r2, [r1, #0]\n",
            )
        )
        return f"mov32 r1, #0xE000ED04\nmov32 r0, #{place}\n{stack}{trigger}nop\nnop\n"

    def tick(self) -> str:
        """Start SysTick, with or without its interrupt."""
        return (
            f"mov32 r1, #0xE000E010\nmov32 r0, #{self._dice.choice((60, 99, 150, 333))}\nstr r0, [r1, #4]\n"
            "str r0, [r1, #8]\n"
            f"movs r0, #{self._dice.choice((7, 7, 7, 5, 3))}\nstr r0, [r1, #0]\n"
        )

    def timer(self) -> str:
        """Start TIM2 with its interrupt, or have USART1 send with its own."""
        return self._dice.choice(
            (
                (
                    f"mov32 r1, #0x40000000\nmov32 r0, #{self._dice.randrange(70, 250)}\nstr r0, [r1, #44]\n"
                    "movs r0, #1\n"
                    "str r0, [r1, #12]\nstr r0, [r1, #0]\n"
                ),
                (  # once and soon: before the core looks at the time for any other reason
                    f"mov32 r1, #0x40000000\nmov32 r0, #{self._dice.randrange(2, 60)}\nstr r0, [r1, #44]\n"
                    "mov32 r2, #0xE000E100\nmov32 r0, #0x10000000\nstr r0, [r2, #0]\ncpsie i\n"
                    "movs r0, #0\nmsr basepri, r0\nstr r0, [r1, #36]\nmovs r0, #1\nstr r0, [r1, #12]\n"
                    f"movs r0, #9\nstr r0, [r1, #0]\n{self.arithmetic()}{self.delay()}"
                ),
                (
                    "mov32 r1, #0x40013800\nmovs r0, #69\nstr r0, [r1, #8]\nmov32 r0, #0x2088\nstr r0, [r1, #12]\n"
                    "str r0, [r1, #4]\n"
                    "mov32 r1, #0xE000E104\nmovs r0, #32\nstr r0, [r1, #0]\n"
                ),
            )
        )

    def calls(self) -> str:
        """Call and return by every instruction that can."""
        one, two, end = self._label(), self._label(), self._label()
        back = self._dice.choice(("pop {r4, pc}", "pop {r4}\npop {r0}\nbx r0", "pop {r4}\n.half 0xF85D, 0xFB04"))
        return (
            f"bl {one}\nmov32 r2, #{two}+1\nblx r2\nb {end}\n{one}: push {{r4, lr}}\nadds r4, #1\n{back}\n"
            f"{two}: adds r5, #1\nbx lr\n{end}: nop\n"
        )

    def returns(self) -> str:
        """Divide, multiply, and compare on the way into an exception that takes them apart."""
        return f"{self.tick()}.half 0xFBA4, 0x2305\n" + "udiv r0, r4, r5\nmla r2, r4, r5, r6\n" * 6


def assembled(programs: int, seed: str, *, makes_accesses: bool = False) -> tuple[Image, list[tuple[int, int]]]:
    """Return an image with programs, and of each where its vectors are and where it ends.

    Args:
        programs: How many.
        seed: Names what is drawn.
        makes_accesses: Whether all that they do is accesses, and not all that a program may do.
    """
    data, places = bytearray(), []
    for number in range(programs):
        base = FLASH + ROOM * number
        writer = ProgramWriter(random.Random(f"{seed} {number}"), makes_accesses=makes_accesses)
        made = Assembler(writer.written(has_all_faults=number == 0 and not makes_accesses), base + CODE_AT)
        label = made.labels
        table = [STACK, label["start"] | 1] + [label["irq"] | 1] * (EXCEPTIONS - 2)
        for exception, name in (
            (3, "fault"),
            (4, "fault"),
            (5, "fault"),
            (6, "fault"),
            (11, "svc_handler"),
            (14, "pendsv"),
            (15, "systick"),
        ):
            table[exception] = label[name] | 1
        program = struct.pack(f"<{EXCEPTIONS}I", *table).ljust(CODE_AT, b"\xff") + made.code
        if len(program) > ROOM:
            raise ValueError(f"program {number} has {len(program)} bytes")
        data += program.ljust(ROOM, b"\xff")
        places.append((base, label["stop"]))
    return Image("programs", ((FLASH, bytes(data)),), SymbolTable(())), places
