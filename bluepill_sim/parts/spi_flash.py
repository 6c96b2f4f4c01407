"""A serial flash of the 25 series: a W25Q16JV, as far as single SPI reaches.

A command begins with a select and ends with the deselect; programming and erasing begin then, and go on while BUSY is
1, when only the status can be read. Programming clears bits, within one page of 256 bytes, where it wraps; an erase
sets all of them. Both need a Write Enable before each.

Modelled: 9F, 90, AB, 4B, 5A (ids), 03, 0B (read), 02 (page program), 20, 52, D8, C7, 60 (erases), 05, 35, 15 (status),
06, 04, B9. Not modelled: writes of the status registers and with them the protection of blocks, dual and quad
transfers, suspend, resets (66, 99): they are counted in `ignored`. Chosen: a cell changes at once when programming or
erasing begins; the unique id.
Source: Winbond W25Q16JV, data sheet, sections 7.1 (status), 8 (instructions) and 9.6 (times, the typical ones); JESD216
for the parameters of 5A, with the words of its series as armink/SFUD (issue 84, W25Q32JV) and Linux's spi-nor list
(W25Q64JV) print them.
Invariant: nothing but the status can be read before what was begun has ended.
"""

from simbase.state import Stateful
from simbase.timing import NS_PER_MS, Nanos

PAGE_BYTES, SECTOR_BYTES, SIZE_BYTES = 256, 4096, 2 * 1024 * 1024
#: Manufacturer, memory type and capacity; the id of 90 and AB (section 8.1.1).
JEDEC_ID, DEVICE_ID = bytes((0xEF, 0x40, 0x15)), 0x14
#: chosen: eight bytes, another number on each part.
UNIQUE_ID = bytes.fromhex("d1629c7803330a55")
#: The header, one table of sixteen words (rev. 1.5) at 0x80, and nothing between: 16 Mbit, 256 bytes to a page, 4, 32
#: and 64 KiB to erase with 20, 52, D8; the whole in 5 s.
SFDP = bytes.fromhex("53464450 050100ff 00050110 800000ff").ljust(0x80, b"\xff") + bytes.fromhex(
    "e520f9ff ffffff00 44eb086b 083b42bb feffffff ffff0000 ffff40eb 0c200f52"
    "10d80000 3602a600 82ea14b3 e9637633 7a757a75 f7bdd55c 19f75dff e930f880"
).ljust(0x80, b"\xff")
#: Of the first status register.
BUSY, WEL = 1, 2
#: How long a page program takes, and what each erase erases and how long: bytes, ns (typical; section 9.6).
PROGRAM_NS: Nanos = 400_000
ERASES: dict[int, tuple[int, Nanos]] = {
    0x20: (SECTOR_BYTES, 45 * NS_PER_MS),
    0x52: (32 * 1024, 120 * NS_PER_MS),
    0xD8: (64 * 1024, 150 * NS_PER_MS),
    0xC7: (SIZE_BYTES, 5000 * NS_PER_MS),
    0x60: (SIZE_BYTES, 5000 * NS_PER_MS),
}
_READ, _FAST_READ, _PROGRAM, _MANUFACTURER, _JEDEC, _UNIQUE, _PARAMETERS = 0x03, 0x0B, 0x02, 0x90, 0x9F, 0x4B, 0x5A
_STATUS = (0x05, 0x35, 0x15)
_WRITE_ENABLE, _WRITE_DISABLE, _POWER_DOWN, _RELEASE = 0x06, 0x04, 0xB9, 0xAB
#: What commands read that nothing changes. Of the status registers as they leave the factory: QE, which an IQ cannot
#: clear, and outputs of a quarter's strength.
_FIXED = {
    _MANUFACTURER: bytes((JEDEC_ID[0], DEVICE_ID)), _RELEASE: bytes((DEVICE_ID,)), _JEDEC: JEDEC_ID,
    _UNIQUE: UNIQUE_ID, _PARAMETERS: SFDP, _STATUS[1]: b"\x02", _STATUS[2]: b"\x60",
}  # fmt: skip
#: The commands whose address says where reading begins.
_FROM_ADDRESS = frozenset({_READ, _FAST_READ, _MANUFACTURER, _PARAMETERS})
#: Bytes of a command before the first that is read, where it reads: command, address, dummies.
_HEAD_BYTES = {
    _READ: 4, _FAST_READ: 5, _MANUFACTURER: 4, _RELEASE: 4, _JEDEC: 1, _UNIQUE: 5, _PARAMETERS: 5,
    **dict.fromkeys(_STATUS, 1),
}  # fmt: skip
_ADDRESSED_BYTES = 4


class SpiFlash(Stateful):
    """2 MiB of flash behind an SPI."""

    STATE = (
        "memory",
        "ignored",
        "_head",
        "_count",
        "_page",
        "_is_answering",
        "_busy_until_ns",
        "_is_enabled",
        "_is_down",
    )

    spi_modes = frozenset({0, 3})
    max_hz = 50_000_000

    def __init__(self, contents: bytes = b"") -> None:
        """Make one, erased behind its contents.

        Raises:
            ValueError: They are more than it holds.
        """
        if len(contents) > SIZE_BYTES:
            raise ValueError(f"{len(contents)} bytes do not fit into a flash of {SIZE_BYTES}")
        #: What it holds.
        self.memory = bytearray(contents.ljust(SIZE_BYTES, b"\xff"))
        #: Commands that it does not know, or that came while it was busy or asleep.
        self.ignored = 0
        #: The command so far: its first bytes, how many there were, and what is to be programmed of the page.
        self._head = bytearray()
        self._count = 0
        self._page = bytearray()
        #: Whether it takes the present command.
        self._is_answering = False
        self._busy_until_ns: Nanos = 0
        self._is_enabled = self._is_down = False

    def select(self, at_ns: Nanos) -> None:
        """Begin a command."""
        self._head.clear()
        self._count = 0
        self._is_answering = False

    def deselect(self, at_ns: Nanos) -> None:
        """End the command: what it writes begins."""
        if self._is_answering:
            self._end(self._head[0], at_ns)
        self._is_answering = False

    def exchange(self, byte: int, at_ns: Nanos) -> int:
        """Take the next byte of the command; return what the part sends meanwhile."""
        position = self._count
        self._count += 1
        if position == 0:
            self._is_answering = self._takes(byte, at_ns)
            self.ignored += not self._is_answering
        if not self._is_answering:
            return 0xFF
        if position <= _ADDRESSED_BYTES:
            self._head.append(byte)
        command = self._head[0]
        first = _HEAD_BYTES.get(command)
        if first is not None and position >= first:
            return self._read(command, position - first, at_ns)
        if command == _PROGRAM and position >= _ADDRESSED_BYTES:
            if position == _ADDRESSED_BYTES:
                self._page[:] = b"\xff" * PAGE_BYTES
            self._page[(self._address + position - _ADDRESSED_BYTES) % PAGE_BYTES] = byte
        return 0xFF

    def ahead(self, count: int) -> tuple[bytes, int | None]:
        """Return what a read sends next, whatever it is sent."""
        if not self._is_answering or self._head[0] not in {_READ, _FAST_READ}:
            return b"", None
        number = self._count - _HEAD_BYTES[self._head[0]]
        if number < 0:
            return b"", None
        first = (self._address + number) % SIZE_BYTES
        return bytes(self.memory[first : first + count]), None

    def went(self, count: int) -> None:
        """Go on behind what has gone over."""
        self._count += count

    @property
    def _address(self) -> int:
        return int.from_bytes(self._head[1:4], "big") % SIZE_BYTES

    def _takes(self, command: int, at_ns: Nanos) -> bool:
        if self._is_down:
            return command == _RELEASE
        if at_ns < self._busy_until_ns:
            return command in _STATUS
        return (
            command in _HEAD_BYTES
            or command in ERASES
            or command in {_PROGRAM, _WRITE_ENABLE, _WRITE_DISABLE, _POWER_DOWN}
        )

    def _read(self, command: int, number: int, at_ns: Nanos) -> int:
        """Return byte `number` of what a command reads."""
        if command == _STATUS[0]:
            is_busy = at_ns < self._busy_until_ns
            return (BUSY if is_busy else 0) | (WEL if is_busy or self._is_enabled else 0)
        contents = _FIXED.get(command, self.memory)
        return contents[((self._address if command in _FROM_ADDRESS else 0) + number) % len(contents)]

    def _end(self, command: int, at_ns: Nanos) -> None:
        if command in {_WRITE_ENABLE, _WRITE_DISABLE}:
            self._is_enabled = command == _WRITE_ENABLE
        elif command in {_POWER_DOWN, _RELEASE}:
            self._is_down = command == _POWER_DOWN
        elif command == _PROGRAM and self._is_enabled and self._count > _ADDRESSED_BYTES:
            start = self._address // PAGE_BYTES * PAGE_BYTES
            here = self.memory[start : start + PAGE_BYTES]
            self.memory[start : start + PAGE_BYTES] = bytes(a & b for a, b in zip(here, self._page, strict=True))
            self._begin(PROGRAM_NS, at_ns)
        elif command in ERASES and self._is_enabled:
            size, span_ns = ERASES[command]
            is_whole = size == SIZE_BYTES
            if self._count == (1 if is_whole else _ADDRESSED_BYTES):
                start = 0 if is_whole else self._address // size * size
                self.memory[start : start + size] = b"\xff" * size
                self._begin(span_ns, at_ns)

    def _begin(self, span_ns: Nanos, at_ns: Nanos) -> None:
        self._busy_until_ns = at_ns + span_ns
        self._is_enabled = False
