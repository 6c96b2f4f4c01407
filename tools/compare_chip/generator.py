"""Random programs that use everything which the chip's core and fabric have, assembled by the tests' own assembler.

    start → set-up → ROUND times: some of the program's steps, in a fixed random order → `stop: b stop`

A step is a function that clobbers any register but R7 and SP; R7 is the middle of the scratch area of `thumb_streams`,
whose random computing is one of the steps. Exceptions are served by handlers that acknowledge, act and return; a fault
goes on behind the instruction. What is read goes into a checksum in SRAM, so that nothing read is lost.

Every wait ends: it counts its rounds, or waits for what the program has just made certain. A program that is reset by
its own watchdogs starts them no more at its third start, and whatever happens comes to `stop`.

Invariant: a program follows from its seed and number alone.
"""

import random
import struct
from collections.abc import Callable
from pathlib import Path

from tests.bluepill_sim.core.thumb_streams import SCRATCH, Stream
from tests.bluepill_sim.machine import CODE, COUNTER_ON, FLASH, STACK, VECTORS, Assembler

PORTS = {"A": 0x4001_0800, "B": 0x4001_0C00, "C": 0x4001_1000}
USARTS = {1: 0x4001_3800, 2: 0x4000_4400, 3: 0x4000_4800}
CRL, CRH, IDR, ODR, BSRR, BRR, LCKR = range(0, 28, 4)
SR, DR, BAUD, CR1, CR2, CR3 = range(0, 24, 4)
RCC_CR, RCC_CFGR, APB2RSTR, APB2ENR, APB1ENR = 0x4002_1000, 0x4002_1004, 0x4002_100C, 0x4002_1018, 0x4002_101C
AFIO, EXTI, IWDG, WWDG = 0x4001_0000, 0x4001_0400, 0x4000_3000, 0x4000_2C00
FLASH_ACR, FLASH_KEYR, FLASH_SR, FLASH_CR = 0x4002_2000, 0x4002_2004, 0x4002_200C, 0x4002_2010
STK_CTRL, STK_LOAD, STK_VAL, CYCCNT = 0xE000_E010, 0xE000_E014, 0xE000_E018, 0xE000_1004
ISER, ICER, ISPR, ICPR, IPR = 0xE000_E100, 0xE000_E180, 0xE000_E200, 0xE000_E280, 0xE000_E400
ICSR, AIRCR, SCR, SHPR2, SHPR3, SHCSR = 0xE000_ED04, 0xE000_ED0C, 0xE000_ED10, 0xE000_ED1C, 0xE000_ED20, 0xE000_ED24
#: Words of the program, and where it puts code.
CHECKSUM, STARTS, ROUND, TICKS, TO_SEND, SRAM_CODE = (0x2000_1000 + 4 * n for n in range(6))
LAST_PAGE = FLASH + 0xFC00
#: CNF and MODE of a pin: inputs, outputs, alternate functions.
PIN_MODES = (0x4, 0x4, 0x8, 0x8, 0x0, 0x1, 0x2, 0x3, 0x3, 0x6, 0x7, 0xB, 0xE)
#: Exceptions with a handler of their own, by number; all others note that they came.
HANDLERS = {
    3: "fault", 4: "fault", 5: "fault", 6: "fault", 11: "svc", 14: "pendsv", 15: "tick", 16: "wwdg",
    **{16 + irq: "exti" for irq in (6, 7, 8, 9, 10, 23, 40)},
    **{16 + 36 + n: f"usart{n}" for n in USARTS},
}  # fmt: skip


def shift(register: int, bit: int) -> str:
    """Return LSLS that brings a bit of a low register to its sign."""
    return f".half {31 - bit << 6 | register << 3 | register}"


def store(address: int, value: int, width: str = "") -> str:
    """Return a store of a constant; uses R1 and R2."""
    return f"mov32 r1, #{address}\nmov32 r2, #{value & 0xFFFF_FFFF}\nstr{width} r2, [r1, #0]"


def note(address: int, width: str = "") -> str:
    """Return a load whose result goes into the checksum; uses R0 to R3."""
    return f"mov32 r1, #{address}\nldr{width} r0, [r1, #0]\nbl note"


class Generator:
    """Makes one program."""

    def __init__(self, seed: int, number: int) -> None:
        self.dice = random.Random(f"{seed} {number}")
        self._stream = Stream(self.dice)
        self._labels = 0
        #: Steps that may stand where interrupts are masked.
        self.short: tuple[Callable[[], str], ...] = (
            self.put, self.put, self.toggle, self.read_pins, self.narrow, self.bit_band, self.pins, self.exti,
            self.software_interrupt, self.nvic, self.counter, self.compute, self.compute, self.delay, self.send,
            self.receive, self.speed, self.code_in_sram, self.pend, self.unmodelled, self.feed,
        )  # fmt: skip
        self.steps: tuple[Callable[[], str], ...] = (
            *self.short, self.masked, self.masked, self.priority, self.sleep, self.sleep, self.event, self.tick,
            self.tick, self.count_flag, self.wait_for_tick, self.call, self.undefined, self.bus_error,
            self.send_by_interrupt, self.send_by_interrupt, self.clock, self.clock, self.gate, self.flash,
            self.iwdg, self.wwdg,
        )  # fmt: skip

    def source(self) -> str:
        """Return the program."""
        dice = self.dice
        # Each program computes, with IT blocks and all; the rest is left to chance.
        kinds = [self.compute, self.compute, self.compute, *dice.choices(self.steps, k=dice.randrange(12, 30))]
        steps = [(f"step{number}", kind()) for number, kind in enumerate(dice.sample(kinds, len(kinds)))]
        # Each round takes some of them, by bits of the round's number: no two rounds are alike.
        calls = "\n".join(f"bl {name}" if dice.random() < 0.7 else self.sometimes(name) for name, _ in steps)
        functions = "\n".join(f"{name}: push {{lr}}\n{text}\npop {{pc}}" for name, text in steps)
        return (
            f"mov32 r7, #{SCRATCH + 0x100}\n{COUNTER_ON}{self.set_up()}\n{store(ROUND, 0)}\n"
            f"round: {calls}\nmov32 r1, #{ROUND}\nldr r0, [r1, #0]\nadds r0, #1\nstr r0, [r1, #0]\n"
            f"cmp r0, #{dice.randrange(8, 60)}\nbeq stop\nb round\nstop: b stop\n{functions}\n{self.handlers()}\n"
            f"note: mov32 r1, #{CHECKSUM}\nldr r2, [r1, #0]\nmovs r3, #33\nmuls r2, r3\nadds r2, r2, r0\n"
            "str r2, [r1, #0]\nbx lr\n"
        )

    def label(self) -> str:
        """Return a label that no other has."""
        self._labels += 1
        return f"l{self._labels}"

    def word(self) -> int:
        """Return a random word, often with few bits."""
        dice = self.dice
        return dice.getrandbits(32) if dice.random() < 0.6 else 1 << dice.randrange(32) | 1 << dice.randrange(32)

    def port(self) -> int:
        """Return the base of a port."""
        return self.dice.choice(tuple(PORTS.values()))

    def sometimes(self, name: str) -> str:
        """Return a call in rounds whose number has a bit."""
        over = self.label()
        bit = shift(0, self.dice.randrange(4))
        return f"mov32 r1, #{ROUND}\nldr r0, [r1, #0]\n{bit}\nbpl {over}\nbl {name}\n{over}: nop"

    # The start.

    def set_up(self) -> str:
        """Return what runs after each reset."""
        dice = self.dice
        lines = [
            # A chip that kept CONTROL over a reset would run into faults from here on, and show nothing else.
            "movs r0, #0\nmsr control, r0\nisb",
            f"mov32 r1, #{STARTS}\nldr r0, [r1, #0]\nadds r0, #1\nstr r0, [r1, #0]",
            store(APB2ENR, 0x401D), store(APB1ENR, 1 << 11 | 3 << 17), *([self.clock()] if dice.random() < 0.7 else []),
            *(self.pins() for _ in range(4)),
            # TX pins alternate functions, RX pins inputs, whatever came before.
            store(PORTS["A"] + CRH, 0x8444_44B4 | 0x400),
            *([store(AFIO + 4, dice.choice((0x0200_0000, 0x0100_0000, 0x0200_0004)))] if dice.random() < 0.4 else []),
            *(store(AFIO + 8 + 4 * n, dice.choice((0, 0x1111, 0x0101, self.mask16() & 0x1111))) for n in range(4)),
            store(EXTI + 8, self.mask16()), store(EXTI + 12, self.mask16()), store(EXTI, self.mask16()),
            *([store(EXTI + 4, self.mask16())] if dice.random() < 0.3 else []),
            *(store(IPR + 4 * n, dice.getrandbits(32) & 0xF0F0_F0F0) for n in (1, 2, 5, 9, 10)),
            store(SHPR2, dice.getrandbits(32) & 0xF000_0000), store(SHPR3, dice.getrandbits(32) & 0xF0F0_0000),
            store(ISER, 1 << 0 | 0x7C0 | 1 << 23), store(ISER + 4, 0x1E0),
            *([store(SHCSR, 7 << 16)] if dice.random() < 0.5 else []),
        ]  # fmt: skip
        for base in USARTS.values():
            lines += [
                store(base + BAUD, dice.choice((16, 19, 69, 139, 833))),
                store(base + CR2, dice.choice((0, 0, 0, 1 << 12, 2 << 12, 3 << 12))),
                store(base + CR3, dice.choice((0, 0, 0, 1, 8))),
                store(
                    base + CR1, 0x200C | dice.choice((0, 0, 0x20, 0x20, 0x20, 0x120, 0x420, 0x1020, 0x1620, 0x60, 0x30))
                ),
            ]
        if dice.random() < 0.4:  # the thread gets a stack of its own
            lines += ["mov32 r0, #0x20003000\nmsr psp, r0\nmovs r0, #2\nmsr control, r0\nisb"]
        return "\n".join([*lines, self.tick()])

    def mask16(self) -> int:
        """Return 16 random bits."""
        return self.dice.getrandbits(16)

    # Pins.

    def put(self) -> str:
        """Write ODR, BSRR or BRR."""
        return "\n".join(
            store(self.port() + self.dice.choice((ODR, BSRR, BSRR, BRR)), self.word())
            for _ in range(self.dice.randrange(1, 6))
        )

    def toggle(self) -> str:
        """Toggle pins in a loop, by BSRR or ODR."""
        dice, again, bits = self.dice, self.label(), self.mask16()
        port, count = self.port(), dice.randrange(1, 60)
        if dice.random() < 0.5:
            return (
                f"mov32 r4, #{port}\nmov32 r5, #{bits}\nmov32 r6, #{bits << 16 & 0xFFFF_FFFF}\nmovs r3, #{count}\n"
                f"{again}: str r5, [r4, #{BSRR}]\n{'nop' * (dice.random() < 0.5)}\nstr r6, [r4, #{BSRR}]\n"
                f"subs r3, #1\nbne {again}"
            )
        return (
            f"mov32 r4, #{port}\nmov32 r5, #{bits}\nmovs r3, #{count}\n{again}: ldr r0, [r4, #{ODR}]\n"
            f".half 0x4068\nstr r0, [r4, #{ODR}]\nsubs r3, #1\nbne {again}"  # EORS R0, R5
        )

    def read_pins(self) -> str:
        """Read what pins and port registers hold."""
        return "\n".join(
            note(self.port() + self.dice.choice((IDR, IDR, IDR, ODR, CRL, CRH, LCKR)))
            for _ in range(self.dice.randrange(1, 4))
        )

    def narrow(self) -> str:
        """Access a byte or half of a port's register."""
        dice = self.dice
        width, step = dice.choice((("b", 1), ("h", 2)))
        address = self.port() + dice.choice((ODR, BSRR, BRR, CRL, IDR)) + step * dice.randrange(4 // step)
        return note(address, width) if dice.random() < 0.5 else store(address, dice.getrandbits(16), width)

    def bit_band(self) -> str:
        """Access a bit of ODR, IDR or SRAM through its alias."""
        dice = self.dice
        if dice.random() < 0.3:
            alias = 0x2200_0000 + (SCRATCH - 0x2000_0000) * 32 + 4 * dice.randrange(512)
        else:
            alias = (
                0x4200_0000 + (self.port() + dice.choice((ODR, ODR, IDR)) - 0x4000_0000) * 32 + 4 * dice.randrange(16)
            )
        return f"{store(alias, dice.randrange(2))}\n{note(alias)}"

    def pins(self) -> str:
        """Configure eight pins, or lock some."""
        dice, port = self.dice, self.port()
        modes = sum(dice.choice(PIN_MODES) << 4 * n for n in range(8))
        if dice.random() < 0.06:
            bits = 1 << dice.randrange(16)
            key = (bits | 1 << 16, bits, bits | 1 << 16)
            return "\n".join([*(store(port + LCKR, word) for word in key), note(port + LCKR), note(port + LCKR)])
        return store(port + dice.choice((CRL, CRH)), modes)

    # Interrupts and exceptions.

    def exti(self) -> str:
        """Change what EXTI looks at, or ask it."""
        register = self.dice.choice((0, 4, 8, 12, 20, 20))
        if register == 20:
            return f"{note(EXTI + 20)}\n{store(EXTI + 20, self.mask16())}"
        return store(EXTI + register, self.mask16())

    def software_interrupt(self) -> str:
        """Raise lines of EXTI by software."""
        return f"{store(EXTI + 16, self.mask16())}\n{note(EXTI + 20)}\n{note(EXTI + 16)}"

    def nvic(self) -> str:
        """Pend, clear, prioritise or read interrupts."""
        dice = self.dice
        chance = dice.random()
        if chance < 0.3:
            return store(dice.choice((ISPR, ICPR)) + 4 * dice.randrange(2), self.word() & 0x01FF_FFFF)
        if chance < 0.5:
            return store(IPR + 4 * dice.randrange(11), dice.getrandbits(32))
        if chance < 0.6:
            return store(AIRCR, 0x05FA << 16 | dice.randrange(8) << 8)
        return note(dice.choice((ISER, ISPR, ISPR + 4, ICSR, IPR + 4, 0xE000_E300)))

    def pend(self) -> str:
        """Pend PendSV or SysTick."""
        return store(ICSR, self.dice.choice((1 << 28, 1 << 28, 1 << 26, 1 << 27, 1 << 25)))

    def masked(self) -> str:
        """Do things with interrupts masked."""
        letter = self.dice.choice("iif")
        inside = "\n".join(self.dice.choice(self.short)() for _ in range(self.dice.randrange(1, 4)))
        asleep = f"{self.ticking(7)}\nwfi" if letter == "i" and self.dice.random() < 0.3 else "nop"
        return f"cpsid {letter}\n{inside}\n{asleep}\ncpsie {letter}"

    def priority(self) -> str:
        """Do things with interrupts of low priority masked."""
        inside = "\n".join(self.dice.choice(self.short)() for _ in range(self.dice.randrange(1, 4)))
        level = self.dice.randrange(1, 16) << 4
        return f"movs r0, #{level}\nmsr basepri, r0\n{inside}\nmovs r0, #0\nmsr basepri, r0"

    def call(self) -> str:
        """Call the supervisor in a loop."""
        again, count, number = self.label(), self.dice.randrange(1, 30), self.dice.randrange(256)
        return f"movs r4, #{count}\n{again}: svc #{number}\nsubs r4, #1\nbne {again}"

    def undefined(self) -> str:
        """Run into undefined instructions."""
        again = self.label()
        return f"movs r4, #{self.dice.randrange(1, 8)}\n{again}: udf\nsubs r4, #1\nbne {again}"

    def bus_error(self) -> str:
        """Read or write where nothing is; a write's fault may come behind it, and the handler then skips the NOP."""
        nothing, access = self.dice.choice((0x3000_0000, 0x6000_0000)), self.dice.choice(("ldr", "str"))
        return f"mov32 r1, #{nothing}\n{access} r0, [r1, #4]\nnop"

    # Time.

    def tick(self) -> str:
        """Set SysTick going, or off; it interrupts or does not."""
        dice = self.dice
        control = dice.choice((7, 7, 7, 5, 3, 1, 0))
        # A handler that takes longer than the period would be all that runs.
        reload = dice.choice(
            (999, 1999, 7999, 30_011, dice.randrange(900, 60_000)) if control & 2 else (0, 1, 99, 7999)
        )
        parts = [store(STK_LOAD, reload), store(STK_VAL, 0), store(STK_CTRL, control)]
        return "\n".join(parts if control & 2 or dice.random() < 0.7 else parts[1:])

    def ticking(self, control: int) -> str:
        """Return a SysTick that certainly goes."""
        reload = self.dice.choice((999, 1999, 7999, 20_000))
        return f"{store(STK_LOAD, reload)}\n{store(STK_VAL, 0)}\n{store(STK_CTRL, control)}"

    def count_flag(self) -> str:
        """Poll COUNTFLAG, as delays of ST's libraries do."""
        again, once = self.label(), self.label()
        return (
            f"{self.ticking(5)}\nmovs r4, #{self.dice.randrange(1, 5)}\nmov32 r0, #{STK_CTRL}\n{once}: nop\n"
            f"{again}: ldr r1, [r0, #0]\n{shift(1, 16)}\nbpl {again}\nsubs r4, #1\nbne {once}"
        )

    def wait_for_tick(self) -> str:
        """Wait until the handler of SysTick has counted."""
        again = self.label()
        return (
            f"{self.ticking(7)}\nmov32 r5, #{TICKS}\nldr r4, [r5, #0]\nb {again}\n"
            f"{again}: ldr r3, [r5, #0]\n.half 0x42A3\nbeq {again}"  # CMP R3, R4
        )

    def sleep(self) -> str:
        """Sleep until an interrupt, some times."""
        again = self.label()
        return f"{self.ticking(7)}\nmovs r4, #{self.dice.randrange(1, 6)}\n{again}: wfi\nsubs r4, #1\nbne {again}"

    def event(self) -> str:
        """Sleep until an event."""
        first = self.dice.choice(("sev", "nop", store(SCR, 1 << 4), store(SCR, 0)))
        return f"{self.ticking(7)}\n{first}\nwfe\n{'wfe' if self.dice.random() < 0.5 else 'nop'}"

    def counter(self) -> str:
        """Read the cycle counter or SysTick's value."""
        return note(self.dice.choice((CYCCNT, CYCCNT, STK_VAL, STK_CTRL)))

    def delay(self) -> str:
        """Loop for a while."""
        again, outer = self.label(), self.label()
        return (
            f"movs r5, #{self.dice.randrange(1, 12)}\n{outer}: movs r4, #{self.dice.randrange(1, 256)}\n"
            f"{again}: subs r4, #1\nbne {again}\nsubs r5, #1\nbne {outer}"
        )

    # USARTs.

    def send(self) -> str:
        """Send characters, polling TXE or TC."""
        dice, again, more, over = self.dice, self.label(), self.label(), self.label()
        base = dice.choice((USARTS[1], *USARTS.values()))
        return (
            f"mov32 r4, #{base}\nmovs r5, #{dice.randrange(1, 4)}\n{more}: mov32 r6, #3000\n"
            f"{again}: ldr r1, [r4, #{SR}]\n{shift(1, dice.choice((7, 7, 6)))}\nbmi {over}\nsubs r6, #1\nbne {again}\n"
            f"{over}: str r5, [r4, #{DR}]\nsubs r5, #1\nbne {more}"
        )

    def receive(self) -> str:
        """Look for a character."""
        base = self.dice.choice(tuple(USARTS.values()))
        return f"{note(base + SR)}\n{note(base + DR) if self.dice.random() < 0.6 else 'nop'}"

    def send_by_interrupt(self) -> str:
        """Have the handler send some characters."""
        base = self.dice.choice((USARTS[1], *USARTS.values()))
        count, enables = self.dice.randrange(1, 12), self.dice.choice((0x80, 0xA0, 0xA0))
        return f"{store(TO_SEND, count)}\n{store(base + CR1, 0x200C | enables)}"

    def speed(self) -> str:
        """Change a line's settings, also in the middle of a character."""
        dice = self.dice
        base = dice.choice(tuple(USARTS.values()))
        chance = dice.random()
        if chance < 0.5:
            return store(base + BAUD, dice.choice((16, 17, 69, 160, 833)))
        if chance < 0.7:
            return store(base + CR2, dice.choice((0, 1 << 12, 2 << 12, 3 << 12)))
        return store(base + CR1, 0x200C | dice.choice((0, 1, 0x20, 0x40, 0x120, 0x1000, 0x1400, 0x60, 0x10)))

    # The rest.

    def compute(self) -> str:
        """Run random instructions."""
        dice, stream = self.dice, self._stream
        made: list[int] = []
        for _ in range(dice.randrange(4, 24)):
            kinds = stream.single if dice.random() < 0.7 else stream.several
            made += stream.loop() if dice.random() < 0.08 else dice.choice(kinds)()
        return "\n".join(f".half {', '.join(map(str, made[at : at + 12]))}" for at in range(0, len(made), 12))

    def code_in_sram(self) -> str:
        """Write code to SRAM and run it; the next time it is other code."""
        adds = 0x3000 | self.dice.randrange(256)
        at = SRAM_CODE + 16
        return f"{store(at, 0x4770 << 16 | adds)}\nmov32 r6, #{at | 1}\nmov r0, r7\nblx r6\nbl note"

    def unmodelled(self) -> str:
        """Poll what no peripheral answers."""
        again, address = self.label(), self.dice.choice((0x4000_7400, 0x4001_2024, 0x4001_8000))
        return (
            f"mov32 r1, #{address}\nmovs r4, #{self.dice.randrange(1, 20)}\n"
            f"{again}: ldr r0, [r1, #0]\nsubs r4, #1\nbne {again}\nstr r0, [r1, #4]"
        )

    def clock(self) -> str:
        """Change the system clock, its prescalers or its source."""
        dice, lines = self.dice, []
        prescalers = dice.choice((0, 0x400, 0x500, 0x2400, 0x80, 0x90, 0x1C00, 0x2D00))
        source = dice.choice(("hsi", "hse", "pll", "pll", "prescalers"))
        lines.append(store(FLASH_ACR, dice.choice((0x12, 0x12, 0x02))))
        if source == "hse":
            lines += [
                store(RCC_CR, 0x1_0081),
                self.wait(RCC_CR, 17),
                store(RCC_CFGR, prescalers | 1),
                self.wait(RCC_CFGR, 2),
            ]
        elif source == "pll":
            # The PLL is set while it is off, and off only while nothing runs on it; by HSE or HSI / 2.
            by_hse = dice.random() < 0.5
            setting = prescalers | dice.randrange(2, 8) << 18 | 0x400 | (1 << 16 if by_hse else 0)
            lines += [
                store(RCC_CFGR, prescalers), "nop\nnop\nnop", store(RCC_CR, 0x1_0081 if by_hse else 0x81),
                *([self.wait(RCC_CR, 17)] if by_hse else []), store(RCC_CFGR, setting),
                store(RCC_CR, 0x101_0081 if by_hse else 0x100_0081), self.wait(RCC_CR, 25),
                store(RCC_CFGR, setting | 2), self.wait(RCC_CFGR, 3),
            ]  # fmt: skip
        elif source == "hsi":
            lines += [store(RCC_CFGR, prescalers)]
        else:
            changed = dice.choice((0x400, 0x80, 0x2000))
            change = f"ldr r2, [r1, #0]\nmov32 r3, #{changed}\n.half 0x405A\nstr r2, [r1, #0]"  # EORS R2, R3
            lines.append(f"mov32 r1, #{RCC_CFGR}\n{change}")
        return "\n".join([*lines, note(RCC_CFGR), note(RCC_CR)])

    def wait(self, address: int, bit: int) -> str:
        """Return a wait for a bit that may never come."""
        again, over = self.label(), self.label()
        return (
            f"mov32 r1, #{address}\nmov32 r3, #9000\n{again}: ldr r2, [r1, #0]\n{shift(2, bit)}\nbmi {over}\n"
            f"subs r3, #1\nbne {again}\n{over}: nop"
        )

    def gate(self) -> str:
        """Take the clock of port B, or reset port C, and look."""
        if self.dice.random() < 0.5:
            look = note(PORTS["B"] + ODR)
            inside = store(PORTS["B"] + ODR, self.word())
            return "\n".join([store(APB2ENR, 0x4015), inside, look, store(APB2ENR, 0x401D), look])
        return f"{store(APB2RSTR, 1 << 4)}\n{store(APB2RSTR, 0)}\n{note(PORTS['C'] + CRH)}"

    def flash(self) -> str:
        """Program a halfword, seldom erase a page."""
        if self.dice.random() < 0.7:
            return note(LAST_PAGE)
        at = LAST_PAGE + 2 * self.dice.randrange(64)
        keys = f"{store(FLASH_KEYR, 0x4567_0123)}\n{store(FLASH_KEYR, 0xCDEF_89AB)}"
        if self.dice.random() < 0.2:
            what = f"{store(FLASH_CR, 2)}\n{store(FLASH_CR + 4, LAST_PAGE)}\n{store(FLASH_CR, 0x42)}"
        else:
            what = f"{store(FLASH_CR, 1)}\n{store(at, self.mask16(), 'h')}"
        after = [self.wait(FLASH_SR, 5), note(FLASH_SR), store(FLASH_SR, 0x34), store(FLASH_CR, 0x80), note(at & ~3)]
        return "\n".join([keys, what, *after])

    def unless_often_reset(self, text: str) -> str:
        """Return what is done in the first two starts only."""
        over = self.label()
        return f"mov32 r1, #{STARTS}\nldr r0, [r1, #0]\ncmp r0, #3\nbge {over}\n{text}\n{over}: nop"

    def iwdg(self) -> str:
        """Start the independent watchdog, seldom; else feed it."""
        if self.dice.random() < 0.6:
            return self.feed()
        settings = [store(IWDG + 4, self.dice.randrange(3)), store(IWDG + 8, self.dice.randrange(40, 0x1000))]
        return self.unless_often_reset("\n".join([store(IWDG, 0x5555), *settings, store(IWDG, 0xCCCC)]))

    def feed(self) -> str:
        """Feed the independent watchdog."""
        return store(IWDG, 0xAAAA)

    def wwdg(self) -> str:
        """Start the window watchdog, seldom; else feed it."""
        value = self.dice.randrange(0x50, 0x80)
        if self.dice.random() < 0.7:
            return f"{note(WWDG)}\n{store(WWDG, value)}"
        setting = 0x7F | self.dice.choice((0x180, 0x380))
        return self.unless_often_reset(f"{store(WWDG + 4, setting)}\n{store(WWDG, 0x80 | value)}")

    def handlers(self) -> str:
        """Return the handlers; what they do beside what they must is random."""
        count = f"mov32 r1, #{TICKS}\nldr r2, [r1, #0]\nadds r2, #1\nstr r2, [r1, #0]"
        made = [
            # Behind the instruction: all that fault here have 16 bits.
            "fault: mov r0, lr\n.half 0x0740\nmrs r0, msp\nbpl own\nmrs r0, psp",
            "own: ldr r1, [r0, #24]\nadds r1, #2\nstr r1, [r0, #24]\nbx lr",
            f"tick: push {{lr}}\n{count}\n{self.act()}\npop {{pc}}",
            f"svc: push {{lr}}\n{self.act()}\npop {{pc}}",
            f"pendsv: push {{lr}}\n{note(CYCCNT)}\n{self.set_and_reset()}\npop {{pc}}",
            f"exti: push {{lr}}\n{note(EXTI + 20)}\n{store(EXTI + 20, 0x7FFFF)}\n{self.act()}\npop {{pc}}",
            f"wwdg: push {{lr}}\n{store(WWDG + 8, 0)}\n{self.dice.choice((store(WWDG, 0x7F), 'nop'))}\npop {{pc}}",
            "other: push {lr}\nmrs r0, ipsr\nbl note\npop {pc}",
        ]
        made += [self.usart_handler(number, base) for number, base in USARTS.items()]
        return "\n".join(made)

    def usart_handler(self, number: int, base: int) -> str:
        """Return a handler that takes what came and sends what is to be sent, until it is told to stop."""
        off, back = f"off{number}", f"back{number}"
        return (
            f"usart{number}: push {{lr}}\n{note(base + SR)}\n{note(base + DR)}\n{store(base + SR, 0x3FF & ~0x60)}\n"
            f"mov32 r1, #{TO_SEND}\nldr r0, [r1, #0]\nsubs r0, #1\nbmi {off}\nstr r0, [r1, #0]\n"
            f"mov32 r1, #{base}\nadds r0, #65\nstr r0, [r1, #{DR}]\nb {back}\n"
            f"{off}: {store(base + CR1, 0x202C)}\n{back}: {self.act()}\npop {{pc}}"
        )

    def act(self) -> str:
        """Return something short for a handler, by R0 to R3 alone."""
        return self.dice.choice(
            (self.put, self.set_and_reset, self.read_pins, self.counter, self.feed, self.pend_in_handler, lambda: "nop")
        )()

    def set_and_reset(self) -> str:
        """Write BSRR with both halves: setting goes before resetting."""
        return store(self.port() + BSRR, self.mask16() << 16 | self.mask16())

    def pend_in_handler(self) -> str:
        """Pend PendSV."""
        return store(ICSR, 1 << 28)


class CheckedAssembler(Assembler):
    """The tests' assembler, that refuses a branch which does not reach."""

    def branch(self, name: str, args: list[str]) -> list[int] | None:
        """Encode a branch.

        Raises:
            ValueError: its target is too far away.
        """
        made = super().branch(name, args)
        if made is None or len(made) != 1 or name in {"bx", "blx"} or args[-1] not in self.labels:
            return made
        reach = 2048 if name == "b" else 126 if name.startswith("cb") else 256
        delta = self.value(args[-1]) - self.address - 4
        if not -reach <= delta < reach:
            raise ValueError(f"{name} {args[-1]} does not reach: {delta} bytes")
        return made


def generate(seed: int, number: int, folder: Path) -> Path:
    """Write a program as a plain image, its source (.s) and its labels (.sym) beside it; return the image."""
    text = f"start: nop\n{Generator(seed, number).source()}\n"
    assembled = CheckedAssembler(text, CODE)
    labels = assembled.labels
    vectors = [STACK, labels["start"] | 1, *(labels[HANDLERS.get(n, "other")] | 1 for n in range(2, VECTORS))]
    path = folder / f"{name_of(seed, number)}.bin"
    path.write_bytes(struct.pack(f"<{VECTORS}I", *vectors).ljust(CODE - FLASH, b"\xff") + assembled.code)
    path.with_suffix(".s").write_text(text, encoding="utf-8")
    rows = sorted((address, label) for label, address in labels.items())
    path.with_suffix(".sym").write_text("".join(f"{address} {label}\n" for address, label in rows), encoding="utf-8")
    return path


def labels_at(image: Path, addresses: list[str]) -> dict[str, str]:
    """Return addresses as "label+0x2 (0x08000132)"; empty where the image is no generated one."""
    path = image.with_suffix(".sym")
    if not path.exists():
        return {}
    rows = [(int(row.split()[0]), row.split()[1]) for row in path.read_text(encoding="utf-8").splitlines()]
    found = {}
    for address in addresses:
        at = int(address, 0)
        base, label = max((row for row in rows if row[0] <= at), default=(at, "?"))
        found[address] = f"{label}+{at - base:#x} ({address})"
    return found


def name_of(seed: int, number: int) -> str:
    """Return a program's name."""
    return f"generated-{seed}-{number}"
