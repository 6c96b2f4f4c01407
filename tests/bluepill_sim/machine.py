"""A small Thumb assembler and a board that runs what it makes: no compiler is needed for these tests.

`test_assembler.py` holds it against arm-none-eabi-as where that is installed.

Programs keep a log: R7 points into SRAM, `log #n` writes a word there. R7 is
not stacked by exceptions, so that handlers and the main program write one log.
"""

import re
import struct
from typing import Any

from bluepill_sim.board import BluePill
from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.subscriptions import EDGE, PinSubscription
from bluepill_sim.program.image import Image, Symbol, SymbolTable

FLASH = 0x0800_0000
CODE = FLASH + 0x130
STACK = 0x2000_5000
LOG = 0x2000_0100
VECTORS = 16 + 43

#: Lets the cycle counter (DWT_CYCCNT, 0xE0001004) run: TRCENA, then CYCCNTENA. Uses r0 and r1.
COUNTER_ON = """
mov32 r0, #0xE000EDFC
mov32 r1, #0x01000000
str r1, [r0, #0]
mov32 r0, #0xE0001000
movs r1, #1
str r1, [r0, #0]
"""

#: Clocks port A and makes PA0 and PA1 push-pull outputs (RM0008, 7.3.7, 9.2.1). Leaves its address in r0, uses r1.
PORT_A_OUT = """
mov32 r0, #0x40021018
movs r1, #4
str r1, [r0, #0]
mov32 r0, #0x40010800
mov32 r1, #0x44444433
str r1, [r0, #0]
"""

_CONDITIONS = {"eq": 0, "ne": 1, "cs": 2, "cc": 3, "mi": 4, "pl": 5, "ge": 10, "lt": 11, "al": 14}
_SPECIAL = {"apsr": 0, "ipsr": 5, "msp": 8, "psp": 9, "primask": 16, "basepri": 17, "faultmask": 19, "control": 20}
_PLAIN = {
    "nop": [0xBF00], "yield": [0xBF10], "wfe": [0xBF20], "wfi": [0xBF30], "sev": [0xBF40], "udf": [0xDE00],
    "cpsie i": [0xB662], "cpsid i": [0xB672], "cpsie f": [0xB661], "cpsid f": [0xB671],
    "isb": [0xF3BF, 0x8F6F], "dsb": [0xF3BF, 0x8F4F], "clrex": [0xF3BF, 0x8F2F],
    "wfi.w": [0xF3AF, 0x8003], "wfe.w": [0xF3AF, 0x8002],
}  # fmt: skip
_MEMORY = {"str": (0x6000, 4), "ldr": (0x6800, 4), "strb": (0x7000, 1), "ldrb": (0x7800, 1),
           "strh": (0x8000, 2), "ldrh": (0x8800, 2)}  # fmt: skip
_INDEXED = {"str": 0x5000, "strh": 0x5200, "strb": 0x5400, "ldr": 0x5800, "ldrh": 0x5A00, "ldrb": 0x5C00}


def reg(text: str) -> int:
    names = {"sp": 13, "lr": 14, "pc": 15}
    return names.get(text.strip(), -1) if text.strip() in names else int(text.strip()[1:])


def reg_list(text: str) -> int:
    mask = 0
    for part in text.strip("{} ").split(","):
        first, _, last = part.strip().partition("-")
        for number in range(reg(first), reg(last or first) + 1):
            mask |= 1 << number
    return mask


class Assembler:
    """Two passes over the lines: the first learns the labels, the second encodes."""

    def __init__(self, source: str, origin: int) -> None:
        self.labels: dict[str, int] = {}
        self.lines = [line.split(";")[0].strip() for line in source.splitlines()]
        for _ in range(2):
            self.address = origin
            halves: list[int] = []
            for line in self.lines:
                text = line
                while match := re.match(r"(\w+):\s*", text):
                    self.labels[match[1]] = self.address
                    text = text[match.end() :]
                if text:
                    made = self.encode(text)
                    halves += made
                    self.address += 2 * len(made)
        self.code = struct.pack(f"<{len(halves)}H", *halves)

    def value(self, text: str) -> int:
        text = text.strip().lstrip("#")
        name, plus, offset = text.partition("+")
        if re.fullmatch(r"[A-Za-z_]\w*", name.strip()):
            return self.labels.get(name.strip(), self.address) + (int(offset, 0) if plus else 0)
        return int(text, 0)

    def encode(self, text: str) -> list[int]:
        if text in _PLAIN:
            return _PLAIN[text]
        name, _, rest = text.partition(" ")
        args = [part.strip() for part in re.split(r",\s*(?![^{\[]*[}\]])", rest.strip())] if rest.strip() else []
        return self.instruction(name, args)

    def instruction(self, name: str, args: list[str]) -> list[int]:
        for attempt in (self.pseudo, self.data, self.memory, self.multiple, self.branch, self.system):
            made = attempt(name, args)
            if made is not None:
                return made
        raise ValueError(f"the test assembler does not know {name} {args}")

    def pseudo(self, name: str, args: list[str]) -> list[int] | None:
        if name == ".half":
            return [self.value(arg) for arg in args]
        if name == ".word":
            return [half for arg in args for half in (self.value(arg) & 0xFFFF, self.value(arg) >> 16)]
        if name == "mov32":
            value, rd = self.value(args[1]), reg(args[0])
            return [*move(0xF240, rd, value & 0xFFFF), *move(0xF2C0, rd, value >> 16)]
        if name == "log":  # movs r0, #n ; str r0, [r7] ; adds r7, #4
            value = [] if args[0] == "r0" else [0x2000 | self.value(args[0])]
            return [*value, 0x6038, 0x3704]
        return None

    def data(self, name: str, args: list[str]) -> list[int] | None:  # noqa: PLR0911 - one return an encoding
        if name in {"movs", "cmp", "adds", "subs"} and args[-1].startswith("#") and len(args) == 2:
            base = {"movs": 0x2000, "cmp": 0x2800, "adds": 0x3000, "subs": 0x3800}[name]
            return [base | reg(args[0]) << 8 | self.value(args[1])]
        if name in {"adds", "subs"}:
            return [{"adds": 0x1800, "subs": 0x1A00}[name] | reg(args[2]) << 6 | reg(args[1]) << 3 | reg(args[0])]
        if name == "mov":
            rd, rm = reg(args[0]), reg(args[1])
            return [0x4600 | (rd >> 3) << 7 | rm << 3 | rd & 7]
        if name == "muls":
            return [0x4340 | reg(args[1]) << 3 | reg(args[0])]
        if name in {"udiv", "sdiv"}:
            return [{"udiv": 0xFBB0, "sdiv": 0xFB90}[name] | reg(args[1]), 0xF0F0 | reg(args[0]) << 8 | reg(args[2])]
        if name == "mla":
            return [0xFB00 | reg(args[1]), reg(args[3]) << 12 | reg(args[0]) << 8 | reg(args[2])]
        return None

    def memory(self, name: str, args: list[str]) -> list[int] | None:  # noqa: PLR0911 - one return an encoding
        if name in {"ldrd", "strd"}:
            rn, imm = self.place(args[2])
            return [{"ldrd": 0xE9D0, "strd": 0xE9C0}[name] | rn, reg(args[0]) << 12 | reg(args[1]) << 8 | imm // 4]
        if name == "ldrex":
            return [0xE850 | self.place(args[1])[0], reg(args[0]) << 12 | 0xF00]
        if name == "strex":
            return [0xE840 | self.place(args[2])[0], reg(args[1]) << 12 | reg(args[0]) << 8]
        if name not in _MEMORY or args[0] == "pc":
            return None
        parts = args[1].strip("[] ").split(",")
        if len(parts) == 2 and parts[1].strip().startswith("r"):
            return [_INDEXED[name] | reg(parts[1]) << 6 | reg(parts[0]) << 3 | reg(args[0])]
        base, size = _MEMORY[name]
        rn, imm = self.place(args[1])
        if rn == 13:
            return [(0x9800 if name == "ldr" else 0x9000) | reg(args[0]) << 8 | imm // 4]
        return [base | imm // size << 6 | rn << 3 | reg(args[0])]

    def place(self, text: str) -> tuple[int, int]:
        parts = text.strip("[] ").split(",")
        return reg(parts[0]), self.value(parts[1]) if len(parts) > 1 else 0

    def multiple(self, name: str, args: list[str]) -> list[int] | None:
        if name in {"push", "pop"}:
            mask = reg_list(args[0])
            extra = mask >> 14 & 1 if name == "push" else mask >> 15 & 1
            return [(0xB400 if name == "push" else 0xBC00) | extra << 8 | mask & 0xFF]
        if name in {"ldmia", "stmia"}:
            return [{"ldmia": 0xC800, "stmia": 0xC000}[name] | reg(args[0].strip("!")) << 8 | reg_list(args[1])]
        if name == "ldmia.w":
            return [0xE890 | reg(args[0]), reg_list(args[1])]
        return None

    def branch(self, name: str, args: list[str]) -> list[int] | None:
        if name in {"bx", "blx"}:
            return [(0x4700 if name == "bx" else 0x4780) | reg(args[0]) << 3]
        if name == "bl":
            delta = self.value(args[0]) - self.address - 4
            return [0xF000 | delta >> 12 & 0x7FF, 0xF800 | delta >> 1 & 0x7FF]
        if name in {"cbz", "cbnz"}:
            delta = self.value(args[1]) - self.address - 4
            offset = (delta >> 6 & 1) << 9 | (delta >> 1 & 31) << 3
            return [(0xB100 if name == "cbz" else 0xB900) | offset | reg(args[0])]
        if name == "b":
            return [0xE000 | (self.value(args[0]) - self.address - 4) >> 1 & 0x7FF]
        if name[0] == "b" and name[1:] in _CONDITIONS:
            return [0xD000 | _CONDITIONS[name[1:]] << 8 | (self.value(args[0]) - self.address - 4) >> 1 & 0xFF]
        return None

    def system(self, name: str, args: list[str]) -> list[int] | None:
        if name in {"svc", "bkpt"}:
            return [{"svc": 0xDF00, "bkpt": 0xBE00}[name] | self.value(args[0])]
        if name == "mrs":
            return [0xF3EF, 0x8000 | reg(args[0]) << 8 | _SPECIAL[args[1]]]
        if name == "msr":
            special = 0x800 | _SPECIAL[args[0]] if args[0] != "apsr" else 0x800
            return [0xF380 | reg(args[1]), 0x8000 | special]
        if re.fullmatch(r"i[te]{1,4}", name) and args:
            first = _CONDITIONS[args[0]]
            bits = [(first if letter == "t" else ~first) & 1 for letter in name[2:]]
            mask = 1 << (3 - len(bits))
            for index, bit in enumerate(bits):
                mask |= bit << (3 - index)
            return [0xBF00 | first << 4 | mask]
        return None


def move(base: int, rd: int, value: int) -> list[int]:
    """MOVW or MOVT."""
    return [base | value >> 12 & 15 | (value >> 11 & 1) << 10, (value >> 8 & 7) << 12 | rd << 8 | value & 0xFF]


def listen(board: BluePill, edges: list[Any], **options: Any) -> PinSubscription:
    """Subscribe to what a board's pins drive: (name, drive, ns) come into `edges` when the board has run."""
    names = {pin.index: pin.name for pin in board.chip.pins}
    drives = [drive.value for drive in PinDrive]

    def take(rows: bytes) -> None:
        edges.extend((names[row[1]], drives[row[2]], row[0]) for row in EDGE.iter_unpack(rows))

    return board.subscribe_pins([pin.name for pin in board.pins], take, **options)


class Machine:
    """A board with an assembled program."""

    def __init__(self, source: str, vectors: dict[int, str | int], origin: int = FLASH, stack: int = STACK) -> None:
        text = f"start: mov32 r7, #{LOG}\n{source}\nstop: b stop\ndefault: b default\n"
        self.assembled = Assembler(text, origin + CODE - FLASH)
        table = [stack, self.label("start") | 1] + [self.label("default") | 1] * (VECTORS - 2)
        for number, target in vectors.items():
            table[number] = target if isinstance(target, int) else self.label(target) | 1
        data = struct.pack(f"<{VECTORS}I", *table).ljust(CODE - FLASH, b"\xff") + self.assembled.code
        symbols = sorted(self.assembled.labels.items(), key=lambda item: item[1])
        self.image = Image("test", ((origin, data),), SymbolTable(tuple(Symbol(n, a) for n, a in symbols)))
        self.board = BluePill(self.image)
        self.edges: list[tuple[str, str, int]] = []
        self.sent = bytearray()
        self._pins = listen(self.board, self.edges)
        self._words = self.board.usart1.subscribe(lambda rows: self.sent.extend(word & 0xFF for word, _ in rows))

    def deafen(self) -> "Machine":
        """Listen no more."""
        self._pins.close()
        self._words()
        return self

    def label(self, name: str) -> int:
        return self.assembled.labels[name]

    def run(self, us: float = 1000, slice_us: float | None = None) -> "Machine":
        """Run for so many microseconds of virtual time, in slices."""
        end = self.board.now_ns + int(us * 1000)
        while self.board.now_ns < end:
            limit = end if slice_us is None else min(end, self.board.now_ns + int(slice_us * 1000))
            self.board.advance_to(limit)
        return self

    @property
    def log(self) -> list[int]:
        """The words logged so far."""
        end = self.board.register("R7")
        data = self.board.read_memory(LOG, end - LOG) or b""
        return [word for (word,) in struct.iter_unpack("<I", data)]

    @property
    def is_done(self) -> bool:
        """Whether the program has come to its end."""
        return self.board.pc == self.label("stop")
