"""An SD card on an SPI: high capacity, blocks of 512 bytes.

Theory of operation. A command is six bytes, the first of them 01xxxxxx. Its answer is a queue of bytes that go out
from the second byte on behind it. A data block to read follows in the queue, behind its access time; one to write is
awaited with its token. While the card is busy it sends 0.

Modelled: CMD0, 8, 9, 10, 12, 13, 16, 17, 18, 24, 25, 32, 33, 38, 55, 58, 59, ACMD13, 22, 23, 41, 51; CRC7 and CRC16
(checked where CMD59 asks for it, and always of CMD0 and CMD8), tokens, errors in R1. *Chosen*: 2 ms of initialization
from the first ACMD41 on, 200 µs to a block, 500 µs to write one. Not modelled: cards of standard capacity, write
protection, CMD6, the 74 clocks before the first command, wear.
Source: SD Specifications Part 1, Physical Layer Simplified Specification 6.00, sections 4.3, 4.5, 5 and 7.
Invariant: blocks that nobody wrote are those of the image.

"""

from binascii import crc_hqx
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from itertools import islice
from pathlib import Path
from typing import ClassVar

from simbase.files import read_bytes
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, Nanos

BLOCK_BYTES = 512
#: What the capacity of a CSD of version 2 counts in.
CAPACITY_BYTES = 512 * 1024
#: chosen: what fits comfortably into memory.
MOST_MB = 1024
READY_NS: Nanos = 2 * NS_PER_MS
READ_NS: Nanos = 200_000
WRITE_NS: Nanos = 500_000
#: Of R1.
IDLE, ERASE_RESET, ILLEGAL, CRC_ERROR, ADDRESS_ERROR, PARAMETER_ERROR = 1, 2, 4, 8, 0x20, 0x40
#: Tokens before data: single and multiple read, single write; multiple write; its end; an address beyond the card.
TOKEN, TOKEN_MULTI, TOKEN_STOP, TOKEN_RANGE = 0xFE, 0xFC, 0xFD, 0x08
#: Answers to a block that was written.
ACCEPTED, REFUSED_CRC = 0x05, 0x0B
#: OCR: 2.7 to 3.6 V, powered up, high capacity.
_OCR_VOLTS, _OCR_READY, _OCR_HIGH = 0x00FF8000, 1 << 31, 1 << 30
_COMMAND_BYTES = 6
#: Version 2, SPI's voltages, four bits and one, erased bytes are 0 (SCR, section 5.6).
_SCR = bytes((0x02, 0x25, 0x80, 0x00, 0, 0, 0, 0))
_SD_STATUS = bytes(64)


def crc7(data: bytes) -> int:
    """Return the CRC of a command, x^7 + x^3 + 1, with its end bit."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x12 if crc & 0x80 else 0)) & 0xFF
    return crc | 1


def crc16(data: bytes) -> int:
    """Return the CRC of a block."""
    return crc_hqx(data, 0)


#: Commands that a card knows before its initialization has ended (section 7.3.1.3).
_WHILE_IDLE = frozenset({8, 55, 58, 59})


class SdCard(Stateful):
    """A card of high capacity."""

    STATE = (
        "written", "reads", "writes", "ignored", "_out", "_command", "_is_idle", "_ready_ns", "_checks_crc", "_is_app",
        "_busy_until_ns", "_block", "_is_multiple", "_taken", "_wants_token", "_due_ns", "_well_written", "_erase",
    )  # fmt: skip

    spi_modes = frozenset({0, 3})
    max_hz = 25_000_000

    def __init__(self, *, image: Path | None = None, size_mb: int = 8, save: bool = False) -> None:
        """Put in a card.

        Args:
            image: A file with its contents; it stays as it is.
            size_mb: How large it is without an image, filled with 0.
            save: Whether `p2os mcu run --parts DIR` writes it as a file.

        Raises:
            ValueError: It is no whole number of half megabytes, or larger than 1 GiB.
            OSError: The image cannot be read.
        """
        self._image = b"" if image is None else read_bytes(image, most=MOST_MB << 20)
        size = len(self._image) or size_mb * 1024 * 1024
        if not 0 < size <= MOST_MB * 1024 * 1024 or size % CAPACITY_BYTES:
            raise ValueError(f"a card of {size} bytes: a multiple of {CAPACITY_BYTES}, up to {MOST_MB} MiB")
        self._blocks, self._saves = size // BLOCK_BYTES, save
        #: What was written, by block.
        self.written: dict[int, bytes] = {}
        #: Blocks that were read and written, and commands that it does not know.
        self.reads = self.writes = self.ignored = 0
        self._out: deque[int] = deque()
        self._command = bytearray()
        self._is_idle = True
        #: When its initialization has ended; None: it has not begun.
        self._ready_ns: Nanos | None = None
        self._checks_crc = self._is_app = False
        self._busy_until_ns: Nanos = 0
        #: The block that is read or written next; None: none.
        self._block: int | None = None
        self._is_multiple = False
        #: What has come of a block to write; None: none is awaited.
        self._taken: bytearray | None = None
        self._wants_token = False
        #: When the next block of a read is there; None: none is read.
        self._due_ns: Nanos | None = None
        self._well_written = 0
        #: First and last block to erase.
        self._erase = (0, 0)

    # The card's contents.

    def block(self, number: int) -> bytes:
        """Return a block's 512 bytes."""
        if number in self.written:
            return self.written[number]
        return self._image[number * BLOCK_BYTES : (number + 1) * BLOCK_BYTES].ljust(BLOCK_BYTES, b"\0")

    def contents(self) -> bytes:
        """Return the whole card."""
        whole = bytearray(self._image.ljust(self._blocks * BLOCK_BYTES, b"\0"))
        for number, block in self.written.items():
            whole[number * BLOCK_BYTES : (number + 1) * BLOCK_BYTES] = block
        return bytes(whole)

    def files(self) -> dict[str, bytes]:
        """Return what it leaves behind: its contents, where it is asked to."""
        return {"img": self.contents()} if self._saves else {}

    def words(self) -> str:
        """Return what it has done."""
        ignored = f", {self.ignored} commands refused" if self.ignored else ""
        return f"{self._blocks // 2048} MiB, {self.reads} blocks read, {self.writes} written{ignored}"

    # SPI.

    def select(self, at_ns: Nanos) -> None:
        """Await a command."""
        self._command.clear()

    def deselect(self, at_ns: Nanos) -> None:
        """Drop an unfinished command; what is busy goes on."""
        self._command.clear()

    def exchange(self, byte: int, at_ns: Nanos) -> int:
        """Take a byte; return what the card sends meanwhile."""
        answer = self._answer(at_ns)
        if self._taken is not None and not self._command and self._takes_data(byte, at_ns):
            return answer
        if self._command or byte & 0xC0 == 0x40:
            self._command.append(byte)
            if len(self._command) == _COMMAND_BYTES:
                command = bytes(self._command)
                self._command.clear()
                self._do(command, at_ns)
        return answer

    def ahead(self, count: int) -> tuple[bytes, int | None]:
        """Return what is left of an answer or a block, while 0xFF is sent."""
        if self._command or self._taken is not None:
            return b"", None
        return bytes(islice(self._out, count)), 0xFF

    def went(self, count: int) -> None:
        """Drop what has gone over."""
        for _ in range(count):
            self._out.popleft()

    def _answer(self, at_ns: Nanos) -> int:
        if self._out:
            return self._out.popleft()
        if at_ns < self._busy_until_ns:
            return 0
        if self._due_ns is not None and at_ns >= self._due_ns:
            self._queue_block(at_ns)
        return 0xFF

    def _queue_block(self, at_ns: Nanos) -> None:
        """Have the next block of a read go out behind this byte."""
        number = self._block
        if number is None or number >= self._blocks:
            self._out.append(TOKEN_RANGE)
            self._due_ns = None
            return
        self._queue_data(self.block(number))
        self.reads += 1
        self._block, self._due_ns = (number + 1, at_ns + READ_NS) if self._is_multiple else (None, None)

    def _queue_data(self, data: bytes) -> None:
        self._out.append(TOKEN)
        self._out.extend(data)
        self._out.extend(crc16(data).to_bytes(2, "big"))

    def _takes_data(self, byte: int, at_ns: Nanos) -> bool:
        """Take a byte of a block to write, if it is one."""
        if self._taken is None:
            return False
        if self._wants_token:
            if byte == (TOKEN_MULTI if self._is_multiple else TOKEN):
                self._wants_token = False
                return True
            if byte == TOKEN_STOP and self._is_multiple:
                self._taken = None
                self._out.append(0xFF)
                self._busy_until_ns = at_ns + WRITE_NS
                return True
            return byte & 0xC0 != 0x40
        self._taken.append(byte)
        if len(self._taken) == BLOCK_BYTES + 2:
            self._end_block(bytes(self._taken), at_ns)
        return True

    def _end_block(self, taken: bytes, at_ns: Nanos) -> None:
        data, crc = taken[:BLOCK_BYTES], int.from_bytes(taken[BLOCK_BYTES:], "big")
        is_bad = self._checks_crc and crc != crc16(data)
        number = self._block if self._block is not None else self._blocks
        is_within = number < self._blocks
        self._out.append(0xE0 | (REFUSED_CRC if is_bad else ACCEPTED if is_within else 0x0D))
        if not is_bad and is_within:
            self.written[number] = data
            self.writes += 1
            self._well_written += 1
            self._block = number + 1
        self._busy_until_ns = at_ns + WRITE_NS
        self._taken, self._wants_token = (bytearray(), True) if self._is_multiple else (None, False)

    # Commands.

    def _do(self, command: bytes, at_ns: Nanos) -> None:
        number, argument = command[0] & 0x3F, int.from_bytes(command[1:5], "big")
        is_app, self._is_app = self._is_app, False
        is_bad = (self._checks_crc or number in {0, 8}) and command[5] != crc7(command[:5])
        self._out.clear()
        if is_bad:
            self._reply(CRC_ERROR)
        elif number == 0:
            self._is_idle, self._ready_ns, self._checks_crc = True, None, False
            self._taken = self._due_ns = None
            self._reply()
        elif is_app and number in self._APP_COMMANDS:
            self._APP_COMMANDS[number](self, argument, at_ns)
        elif number in self._COMMANDS and (not self._is_idle or number in _WHILE_IDLE):
            self._COMMANDS[number](self, argument, at_ns)
        else:
            self.ignored += 1
            self._reply(ILLEGAL)

    def _reply(self, error: int = 0, more: bytes = b"") -> None:
        """Queue R1, one byte later, and what follows it."""
        self._out.append(0xFF)
        self._out.append(error | (IDLE if self._is_idle else 0))
        self._out.extend(more)

    def _send_if_cond(self, argument: int, at_ns: Nanos) -> None:
        self._reply(more=bytes((0, 0, argument >> 8 & 0x0F if argument >> 8 & 0x0F == 1 else 0, argument & 0xFF)))

    def _send_csd(self, argument: int, at_ns: Nanos) -> None:
        size = self._blocks * BLOCK_BYTES // CAPACITY_BYTES - 1
        csd = bytes((0x40, 0x0E, 0, 0x32, 0x5B, 0x59, 0)) + size.to_bytes(3, "big")
        csd += bytes((0x7F, 0x80, 0x0A, 0x40, 0x00))
        self._reply()
        self._queue_data(csd + bytes((crc7(csd),)))

    def _send_cid(self, argument: int, at_ns: Nanos) -> None:
        cid = b"\x00P2" + b"BENCH" + bytes((0x10, 0, 0, 0, 1, 0x01, 0xA1))
        self._reply()
        self._queue_data(cid + bytes((crc7(cid),)))

    def _stop(self, argument: int, at_ns: Nanos) -> None:
        self._due_ns = self._block = None
        self._out.append(0xFF)
        self._reply()
        self._busy_until_ns = at_ns

    def _send_status(self, argument: int, at_ns: Nanos) -> None:
        self._reply(more=b"\0")

    def _set_length(self, argument: int, at_ns: Nanos) -> None:
        self._reply(0 if argument == BLOCK_BYTES else PARAMETER_ERROR)

    def _read(self, argument: int, at_ns: Nanos, *, is_multiple: bool = False) -> None:
        if argument >= self._blocks:
            self._reply(ADDRESS_ERROR)
            return
        self._reply()
        self._block, self._is_multiple, self._due_ns = argument, is_multiple, at_ns + READ_NS

    def _write(self, argument: int, at_ns: Nanos, *, is_multiple: bool = False) -> None:
        if argument >= self._blocks:
            self._reply(ADDRESS_ERROR)
            return
        self._reply()
        self._block, self._is_multiple, self._well_written = argument, is_multiple, 0
        self._taken, self._wants_token = bytearray(), True

    def _erase_from(self, argument: int, at_ns: Nanos) -> None:
        self._erase = (argument, self._erase[1])
        self._reply(0 if argument < self._blocks else ADDRESS_ERROR)

    def _erase_to(self, argument: int, at_ns: Nanos) -> None:
        self._erase = (self._erase[0], argument)
        self._reply(0 if argument < self._blocks else ADDRESS_ERROR)

    def _erase_now(self, argument: int, at_ns: Nanos) -> None:
        first, last = self._erase
        for number in range(first, min(last, self._blocks - 1) + 1):
            self.written[number] = bytes(BLOCK_BYTES)
        self._reply()
        self._busy_until_ns = at_ns + WRITE_NS

    def _next_is_app(self, argument: int, at_ns: Nanos) -> None:
        self._is_app = True
        self._reply()

    def _read_ocr(self, argument: int, at_ns: Nanos) -> None:
        ocr = _OCR_VOLTS | (0 if self._is_idle else _OCR_READY | _OCR_HIGH)
        self._reply(more=ocr.to_bytes(4, "big"))

    def _set_crc(self, argument: int, at_ns: Nanos) -> None:
        self._checks_crc = bool(argument & 1)
        self._reply()

    def _initialize(self, argument: int, at_ns: Nanos) -> None:
        if self._ready_ns is None:
            self._ready_ns = at_ns + READY_NS
        # A host that does not say that it knows high capacity waits for ever (section 7.2.1).
        self._is_idle = self._is_idle and (at_ns < self._ready_ns or not argument >> 30 & 1)
        self._reply()

    def _send_sd_status(self, argument: int, at_ns: Nanos) -> None:
        self._reply(more=b"\0")
        self._queue_data(_SD_STATUS)

    def _send_scr(self, argument: int, at_ns: Nanos) -> None:
        self._reply()
        self._queue_data(_SCR)

    def _count_written(self, argument: int, at_ns: Nanos) -> None:
        self._reply()
        self._queue_data(self._well_written.to_bytes(4, "big"))

    def _acknowledge(self, argument: int, at_ns: Nanos) -> None:
        self._reply()

    #: What a command does, by its number; of applications, behind CMD55.
    _COMMANDS: ClassVar[Mapping[int, Callable[..., None]]] = {
        8: _send_if_cond, 9: _send_csd, 10: _send_cid, 12: _stop, 13: _send_status,
        16: _set_length, 17: _read, 18: partial(_read, is_multiple=True),
        24: _write, 25: partial(_write, is_multiple=True),
        32: _erase_from, 33: _erase_to, 38: _erase_now, 55: _next_is_app,
        58: _read_ocr, 59: _set_crc,
    }  # fmt: skip
    _APP_COMMANDS: ClassVar = {
        13: _send_sd_status, 22: _count_written, 23: _acknowledge, 41: _initialize,
        51: _send_scr,
    }  # fmt: skip
