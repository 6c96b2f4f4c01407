"""DMA1 as RM0008 chapter 13 and docs/peripherals.md have it, in plain Python: what the device in C is held against."""

from dataclasses import dataclass, field

NS_PER_S = 1_000_000_000
EN, TCIE, HTIE, TEIE, DIR, CIRC, PINC, MINC = (1 << n for n in range(8))
MEM2MEM = 1 << 14
TCIF, HTIF, TEIF = 2, 4, 8
SRAM, SRAM_BYTES, FLASH, FLASH_BYTES = 0x2000_0000, 0x800, 0x0800_0000, 0x100
#: AFIO_EXTICR4: reads what was written, keeps 16 bits, and nothing but zeros stands behind it.
EXTICR4, AFIO_END = 0x4001_0014, 0x4001_0400


@dataclass
class Channel:
    """One channel, as a programmer sees it, and its internal registers."""

    control: int = 0
    count: int = 0
    peripheral: int = 0
    memory: int = 0
    reload: int = 0
    at_peripheral: int = 0
    at_memory: int = 0
    is_pending: bool = False
    line: bool = False


@dataclass
class DmaModel:
    """All seven; `now_ns` is moved by `advance`."""

    hclk_hz: int
    apb1_cycles: int
    apb2_cycles: int
    now_ns: int = 0
    flags: int = 0
    exticr4: int = 0
    sram: bytearray = field(default_factory=lambda: bytearray(SRAM_BYTES))
    flash: bytes = bytes(range(FLASH_BYTES))
    channels: list[Channel] = field(default_factory=lambda: [Channel() for _ in range(7)])
    running: int | None = None
    base_ns: int = 0
    cycles: int = 0

    def irqs(self) -> list[bool]:
        return [bool(self.flags >> 4 * n & channel.control & 0xE) for n, channel in enumerate(self.channels)]

    @property
    def due_ns(self) -> int | None:
        return None if self.running is None else self.base_ns + self.cycles * NS_PER_S // self.hclk_hz

    def write(self, n: int, name: str, value: int) -> None:
        channel = self.channels[n]
        if name == "CCR":
            if value & EN and not channel.control & EN:
                channel.at_peripheral, channel.at_memory = channel.peripheral, channel.memory
            channel.control = value
            if not value & EN:
                channel.is_pending = False
                if self.running == n:
                    self.running = None
            self._start()
        elif not channel.control & EN:
            if name == "CNDTR":
                channel.count = channel.reload = value
            elif name == "CPAR":
                channel.peripheral = value
            else:
                channel.memory = value

    def clear(self, value: int) -> None:
        for n in range(7):
            cleared = value >> 4 * n & 0xF
            self.flags &= ~((0xE if cleared & 1 else cleared) << 4 * n)

    @property
    def isr(self) -> int:
        return sum((self.flags >> 4 * n & 0xE | bool(self.flags >> 4 * n & 0xE)) << 4 * n for n in range(7))

    def set_line(self, n: int, level: bool) -> None:
        channel = self.channels[n]
        has_risen = level and not channel.line
        channel.line = level
        if has_risen and channel.control & EN:
            channel.is_pending = True
            self._start()

    def advance(self, to_ns: int) -> None:
        while self.due_ns is not None and self.due_ns <= to_ns:
            n = self.running
            assert n is not None
            self._transfer(n)
            self._choose()
        self.now_ns = to_ns

    def _start(self) -> None:
        if self.running is None:
            self.base_ns, self.cycles = self.now_ns, 0
            self._choose()

    def _choose(self) -> None:
        asking = [
            (-(channel.control >> 12 & 3), n)
            for n, channel in enumerate(self.channels)
            if channel.control & EN and channel.count
            and (channel.line or channel.is_pending or channel.control & MEM2MEM)
        ]  # fmt: skip
        self.running = min(asking)[1] if asking else None
        if self.running is not None:
            channel = self.channels[self.running]
            channel.is_pending = False
            self.cycles += 1 + self._cycles(channel.at_peripheral) + self._cycles(channel.at_memory)

    def _cycles(self, address: int) -> int:
        if 0x4000_0000 <= address < 0x4001_0000:
            return self.apb1_cycles
        return self.apb2_cycles if 0x4001_0000 <= address < 0x4001_8000 else 2

    def _transfer(self, n: int) -> None:
        channel = self.channels[n]
        widths = [min(1 << (channel.control >> at & 3), 4) for at in (8, 10)]
        sides = [(channel.at_peripheral, widths[0]), (channel.at_memory, widths[1])]
        (source, read_width), (target, write_width) = reversed(sides) if channel.control & DIR else sides
        word = self._read(source & -read_width, read_width)
        if word is None or not self._write(target & -write_width, write_width, word & (1 << 8 * write_width) - 1):
            channel.control &= ~EN
            channel.is_pending = False
            self.flags |= TEIF << 4 * n
            return
        channel.count -= 1
        channel.at_peripheral += widths[0] * bool(channel.control & PINC)
        channel.at_memory += widths[1] * bool(channel.control & MINC)
        if channel.count == channel.reload // 2:
            self.flags |= HTIF << 4 * n
        if not channel.count:
            self.flags |= TCIF << 4 * n
            if channel.control & CIRC and not channel.control & MEM2MEM:
                channel.count = channel.reload
                channel.at_peripheral, channel.at_memory = channel.peripheral, channel.memory

    def _read(self, address: int, width: int) -> int | None:
        for base, data in ((SRAM, self.sram), (FLASH, self.flash)):
            if base <= address < base + len(data):
                return int.from_bytes(data[address - base : address - base + width], "little")
        if EXTICR4 <= address < AFIO_END:
            return (self.exticr4 if address < EXTICR4 + 4 else 0) >> 8 * (address & 3) & (1 << 8 * width) - 1
        return None

    def _write(self, address: int, width: int, word: int) -> bool:
        if SRAM <= address < SRAM + SRAM_BYTES:
            self.sram[address - SRAM : address - SRAM + width] = word.to_bytes(width, "little")
            return True
        if EXTICR4 <= address < AFIO_END:
            if address < EXTICR4 + 4:  # the APB bridge duplicates what is narrower
                self.exticr4 = word * {1: 0x0101_0101, 2: 0x0001_0001, 4: 1}[width] & 0xFFFF
            return True
        return False
