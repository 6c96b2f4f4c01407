"""SSD1306: the controller of small OLEDs, 128 columns by 64 rows, on I2C or on SPI with D/C#.

Theory of operation. A byte is a command or data: on I2C a control byte says which, on SPI the pin `dc`. Commands and
their arguments are a table. Data goes to the memory where the pointer stands, which then moves on as the addressing
mode says. The picture is what the glass shows: the memory through start line, offset, multiplex ratio and the two
directions.

Modelled: all three addressing modes, 20 to 22, 00 to 1F, B0 to B7, 40 to 7F, A0 and A1 (for data from then on), A4 to
A7, A8, AE, AF, C0, C8, D3, the arguments of all others; the status that I2C reads, whose lower half the data sheet
reserves and drivers tell controllers by; `res`. *Chosen*: the glass is mounted so that A1 and C8 show column 0 and row
0 at the upper left, as modules are.
Not modelled: scrolling (26 to 2F: counted in `ignored`), DA's order of the rows, brightness, the charge pump: it
shines with AF alone.
Source: Solomon Systech SSD1306, data sheet rev. 1.1, sections 8.1 (interfaces), 9 (commands), 10 (descriptions).
Invariant: the pointer always stands within its window, and within the memory.

"""

from collections.abc import Sequence
from typing import ClassVar

from bluepill_sim.parts.attached import Change, Socket, Use
from bluepill_sim.parts.picture import Picture
from simbase.state import Stateful
from simbase.timing import Nanos

COLUMNS, PAGES, LINES = 128, 8, 64
_LIT, _DARK = (210, 235, 255), (0, 0, 0)
#: How many bytes follow a command, where some do.
ARGUMENTS = {
    0x20: 1, 0x21: 2, 0x22: 2, 0x26: 6, 0x27: 6, 0x29: 5, 0x2A: 5, 0x81: 1, 0x8D: 1, 0xA3: 2, 0xA8: 1, 0xD3: 1,
    0xD5: 1, 0xD9: 1, 0xDA: 1, 0xDB: 1,
}  # fmt: skip
#: Known, and without an effect that is modelled; scrolling is counted as ignored.
_SILENT = frozenset({0x81, 0x8D, 0xD5, 0xD9, 0xDA, 0xDB, 0xE3, 0x2E})
_HORIZONTAL, _VERTICAL, _BY_PAGE = range(3)
#: The data sheet allows no multiplex ratio below.
_LEAST_ROWS = 16
_CO, _DC = 0x80, 0x40
#: Of the status byte: the display is off.
_OFF = 0x40
#: Its lower half by the rows of the glass, as OneBitDisplay and Meshtastic know it; 0 and 8 are an SH1106 to them.
_ID = {64: 6, 32: 3}


class Ssd1306(Stateful):
    """An OLED of 128 by 64 or 128 by 32."""

    PINS: ClassVar = {"dc": Use.HELD, "res": Use.WATCHED}
    STATE = (
        "memory", "is_on", "ignored", "_is_inverse", "_is_all_on", "_mode", "_columns", "_pages", "_column", "_page",
        "_start_line", "_offset", "_rows", "_is_mirrored", "_is_upward", "_pending", "_control", "_is_reset",
    )  # fmt: skip
    DERIVED = ("_socket",)

    spi_modes = frozenset({0, 3})
    max_hz = 10_000_000

    def __init__(self, *, address: int = 0x3C, height: int = 64) -> None:
        """Make one whose memory is dark.

        Args:
            address: On I2C, 0x3C or 0x3D.
            height: Rows of the glass, 64 or 32.

        Raises:
            ValueError: There is no such one.
        """
        if address not in {0x3C, 0x3D} or height not in {32, 64}:
            raise ValueError(f"no SSD1306 at {address:#04x} with {height} rows: 0x3C or 0x3D, 32 or 64")
        self._address, self._height = address, height
        #: A byte a column of eight rows, the lowest bit on top: page after page.
        self.memory = bytearray(COLUMNS * PAGES)
        #: Commands that it does not know, or that are not modelled.
        self.ignored = 0
        self._socket: Socket | None = None
        self._is_reset = False
        self._reset()

    def _reset(self) -> None:
        self.is_on = self._is_inverse = self._is_all_on = self._is_mirrored = self._is_upward = False
        self._mode, self._columns, self._pages = _BY_PAGE, (0, COLUMNS - 1), (0, PAGES - 1)
        self._column = self._page = self._start_line = self._offset = 0
        self._rows = LINES
        #: A command whose arguments are not complete.
        self._pending = bytearray()
        #: Of I2C: the last control byte, while what follows belongs to it; None: a control byte is next.
        self._control: int | None = None

    def plug(self, socket: Socket) -> None:
        """Keep the pins.

        Raises:
            ValueError: It hangs on an SPI without `dc`.
        """
        if socket.spi is not None and not socket.has("dc"):
            raise ValueError("on an SPI it needs dc=PIN, which tells commands from data")
        if socket.has("dc") and socket.spi is None:
            raise ValueError("dc is for an SPI")
        self._socket = socket

    def changed(self, rows: Sequence[Change]) -> None:
        """Follow the reset pin."""
        for _ns, _pin, level in rows:
            self._is_reset = not level
            if self._is_reset:
                self._reset()

    # I2C.

    def start(self, address: int, is_read: bool, at_ns: Nanos) -> bool:
        """Acknowledge its address; a control byte is next."""
        self._control = None
        return address == self._address and not self._is_reset

    def write(self, byte: int, at_ns: Nanos) -> bool:
        """Take a control byte, or what follows it."""
        if self._control is None:
            self._control = byte
            return True
        self._take(byte, is_data=bool(self._control & _DC))
        if self._control & _CO:  # one byte each
            self._control = None
        return True

    def read(self, at_ns: Nanos) -> int:
        """Return the status."""
        return _ID[self._height] | (0 if self.is_on else _OFF)

    def stop(self, at_ns: Nanos) -> None:
        """End what a control byte began."""
        self._control = None

    # SPI.

    def select(self, at_ns: Nanos) -> None:
        """Nothing changes: a command goes on where it was left."""

    def deselect(self, at_ns: Nanos) -> None:
        """Nothing changes."""

    def exchange(self, byte: int, at_ns: Nanos) -> int:
        """Take a byte as what D/C# says at its last bit; nothing comes back."""
        if self._socket is not None and not self._is_reset:
            self._take(byte, is_data=self._socket.pin("dc").level)
        return 0xFF

    # What it shows.

    def picture(self) -> Picture:
        """Return what the glass shows."""
        return Picture(tuple(tuple(_LIT if lit else _DARK for lit in row) for row in self.dots()))

    def dots(self) -> list[list[bool]]:
        """Return which dots shine, row by row from the top."""
        rows = []
        for y in range(self._height):
            common = self._height - 1 - y
            place = self._rows - 1 - common if self._is_upward else common
            if not self.is_on or not 0 <= place < self._rows:
                rows.append([False] * COLUMNS)
                continue
            line = (place + self._offset + self._start_line) % LINES
            page, bit = line // 8 * COLUMNS, line % 8
            segments = self.memory[page : page + COLUMNS]
            rows.append([self._is_all_on or bool(byte >> bit & 1) is not self._is_inverse for byte in segments[::-1]])
        return rows

    def words(self) -> str:
        """Return whether it is on and how many dots shine."""
        lit = sum(map(sum, self.dots()))
        ignored = f", {self.ignored} commands ignored" if self.ignored else ""
        return f"{COLUMNS}x{self._height}, {'on' if self.is_on else 'off'}, {lit} dots lit{ignored}"

    # Commands and data.

    def _take(self, byte: int, *, is_data: bool) -> None:
        if is_data:
            self._put(byte)
            return
        self._pending.append(byte)
        command = self._pending[0]
        if len(self._pending) > ARGUMENTS.get(command, 0):
            arguments = self._pending[1:]
            self._pending.clear()
            self._do(command, *arguments)

    def _put(self, byte: int) -> None:
        segment = COLUMNS - 1 - self._column if self._is_mirrored else self._column
        self.memory[self._page * COLUMNS + segment] = byte
        first, last = self._columns if self._mode != _BY_PAGE else (0, COLUMNS - 1)
        if self._mode == _VERTICAL:
            self._page, wraps = _next(self._page, *self._pages)
            if wraps:
                self._column, _ = _next(self._column, first, last)
        else:
            self._column, wraps = _next(self._column, first, last)
            if wraps and self._mode == _HORIZONTAL:
                self._page, _ = _next(self._page, *self._pages)

    def _do(self, command: int, *arguments: int) -> None:
        for first, last, act in self._COMMANDS:
            if first <= command <= last:
                act(self, command, *arguments)
                return
        self.ignored += command not in _SILENT

    def _half_column(self, command: int) -> None:
        low = command < 0x10
        column = self._column & 0xF0 | command & 0x0F if low else self._column & 0x0F | (command & 0x0F) << 4
        self._column = column % COLUMNS

    def _set_mode(self, _command: int, mode: int) -> None:
        self._mode = min(mode & 3, _BY_PAGE)

    def _set_columns(self, _command: int, first: int, last: int) -> None:
        self._columns = first % COLUMNS, last % COLUMNS
        self._column = self._columns[0]

    def _set_pages(self, _command: int, first: int, last: int) -> None:
        self._pages = first % PAGES, last % PAGES
        self._page = self._pages[0]

    def _set_page(self, command: int) -> None:
        self._page = command & 7

    def _set_start(self, command: int) -> None:
        self._start_line = command & 0x3F

    def _set_offset(self, _command: int, rows: int) -> None:
        self._offset = rows & 0x3F

    def _set_rows(self, _command: int, last: int) -> None:
        self._rows = max(last & 0x3F, _LEAST_ROWS - 1) + 1

    def _set_segments(self, command: int) -> None:
        self._is_mirrored = bool(command & 1)

    def _set_commons(self, command: int) -> None:
        self._is_upward = bool(command & 8)

    def _set_all_on(self, command: int) -> None:
        self._is_all_on = bool(command & 1)

    def _set_inverse(self, command: int) -> None:
        self._is_inverse = bool(command & 1)

    def _set_on(self, command: int) -> None:
        self.is_on = bool(command & 1)

    #: First and last command, and what it does.
    _COMMANDS: ClassVar = (
        (0x00, 0x1F, _half_column),
        (0x20, 0x20, _set_mode),
        (0x21, 0x21, _set_columns),
        (0x22, 0x22, _set_pages),
        (0x40, 0x7F, _set_start),
        (0xA0, 0xA1, _set_segments),
        (0xA4, 0xA5, _set_all_on),
        (0xA6, 0xA7, _set_inverse),
        (0xA8, 0xA8, _set_rows),
        (0xAE, 0xAF, _set_on),
        (0xB0, 0xB7, _set_page),
        (0xC0, 0xCF, _set_commons),
        (0xD3, 0xD3, _set_offset),
    )


def _next(at: int, first: int, last: int) -> tuple[int, bool]:
    """Return the place behind `at` in a window, and whether it was the last."""
    return (first, True) if at == last else (at + 1, False)
