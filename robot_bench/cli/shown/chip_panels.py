"""The chip on a page: where its program is, its core, registers of its peripherals, its board with LED and live pins.

Each is a panel by an entry point of `p2os.view_panels`: what it shows is read while the chip stands between two
instructions, as a debugger reads it.

Invariant: a look changes nothing of the run.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Literal, TypeAlias, cast

from bluepill_sim.analysis.coverage import Coverage
from bluepill_sim.analysis.program_lines import program_lines
from bluepill_sim.board import BluePill
from bluepill_sim.debug.chip_state import (
    CoreRow,
    ProgramPlace,
    clock_rows,
    core_rows,
    exception_rows,
    source_place,
    stack_rows,
)
from bluepill_sim.errors import ImageError
from bluepill_sim.fabric.pins import Pin
from p2os.view.header import (
    PageBlock,
    PageCell,
    PageDrawing,
    PageSection,
    PageSource,
    PageTable,
    PageText,
    PictureShape,
)
from p2os.view.targets import ViewPanel
from robot_bench.events.codec import Json
from robot_bench.view.program_sections import PROGRAM, program_sections, source_block
from simbase.timing import NS_PER_S

_Align: TypeAlias = Literal["start", "middle", "end"]
NVIC, CLOCKS = "NVIC", "clock tree"
#: Of the program: its next line, and what has run of it.
NEXT, RAN = "next line", "what has run"
#: chosen: lines shown on either side of the next one.
LINES_AROUND = 6
#: chosen: so many instructions are counted at a look; 5 ms on a quiet machine.
INSTRUCTIONS_A_LOOK = 8000
#: The pins of the board's two headers, from the USB socket on (BluePill, schematic of its makers); others are supplies.
LEFT = (
    "PB12", "PB13", "PB14", "PB15", "PA8", "PA9", "PA10", "PA11", "PA12", "PA15", "PB3", "PB4",
    "PB5", "PB6", "PB7", "PB8", "PB9", "5V", "GND", "3V3",
)  # fmt: skip
RIGHT = (
    "GND", "GND", "3V3", "NRST", "PB11", "PB10", "PB1", "PB0", "PA7", "PA6", "PA5", "PA4",
    "PA3", "PA2", "PA1", "PA0", "PC15", "PC14", "PC13", "VBAT",
)  # fmt: skip
#: Lengths of the drawing: between two pins, from side to side, of the first pin from above.
_PITCH, _WIDE, _TOP = 20.0, 340.0, 46.0
#: Which way from the pin → how the text beside it on the board, and outside of it, stands.
_ALIGNED: Mapping[int, tuple[_Align, _Align]] = {-1: ("start", "end"), 1: ("end", "start")}
#: chosen: larger values of fields stand in hexadecimal, as manuals have them.
_LARGEST_PLAIN = 9
_HZ_PER_MHZ = 1_000_000


def program_panel(subject: object) -> ViewPanel | None:
    """Return the panel of where the program stands; None where no emulated chip runs."""
    if not isinstance(subject, BluePill):
        return None
    board, running = subject, _RunningProgram(subject)
    return ViewPanel(*PROGRAM, (NEXT, RAN), lambda choice: running.ran() if choice == RAN else _program(board, running))


def registers_panel(subject: object) -> ViewPanel | None:
    """Return the panel of registers: of a peripheral, of the NVIC, and the clock tree; None as above."""
    if not isinstance(subject, BluePill):
        return None
    board, choices = subject, (CLOCKS, NVIC, *subject.chip.parts.by_name)
    return ViewPanel("chip", "Chip", choices, lambda choice: _registers(board, choice))


def board_panel(subject: object) -> ViewPanel | None:
    """Return the panel with the board's picture; None as above."""
    if not isinstance(subject, BluePill):
        return None
    board = subject
    return ViewPanel("board", "Board", (), lambda _choice: _board(board))


class _RunningProgram:
    """What has run of a board's program so far: counted anew where anything new has run since.

    The board knows which blocks it has entered at no cost to the run. Counting takes some 20 ms of a program of 16 KB;
    of larger ones it is done at each second, third, … look only.
    """

    def __init__(self, board: BluePill) -> None:
        self._board = board
        self._known = -1, -1
        self._looks_left = 0
        self._lines: Json = {"files": [], "functions": []}

    @property
    def lines(self) -> Json:
        """As of `program_lines`."""
        if self._looks_left:
            self._looks_left -= 1
            return self._lines
        blocks, ways = self._board.entered_blocks, self._board.gone_ways
        if (len(blocks), len(ways)) != self._known:
            self._known = len(blocks), len(ways)
            with suppress(ImageError):  # the file has been built anew meanwhile
                coverage = Coverage.of_board(self._board, blocks, ways)
                self._lines = program_lines(coverage, Path(self._board.image.name).parent)
            functions = cast("list[list[int]]", self._lines["functions"])
            self._looks_left = sum(row[2] for row in functions) // INSTRUCTIONS_A_LOOK
        return self._lines

    def ran(self) -> list[PageSection]:
        """Return the sections of what has run."""
        return program_sections(self.lines)

    def around(self, place: ProgramPlace) -> PageSource | None:
        """Return the lines around a place, with what has run of them."""
        file = next((one for one in cast("list[Json]", self.lines["files"]) if one["name"] == place.file), None)
        first, last = max(1, place.line - LINES_AROUND), place.line + LINES_AROUND
        return None if file is None else source_block(file, first, last, place.line)


def _program(board: BluePill, running: _RunningProgram) -> list[PageSection]:
    place, asleep = source_place(board), ", asleep" if board.is_asleep else ""
    note = f"{board.now_ns / NS_PER_S:.9f} s, {board.cycle} cycles{asleep}"
    listing: PageBlock = PageText(text=board.where(), is_listing=True)
    if place is not None:
        title = f"{place.file}:{place.line} in {place.function}"
        words = f"line {place.line} in {place.function}; its file is not to be had"
        source = running.around(place)
        listing = PageText(title=title, text=words, is_listing=True) if source is None else replace(source, title=title)
    core, stack = ("register", "value", ""), ("address", "word", "")
    return [
        PageSection(title="Next line", note=note, blocks=[listing]),
        PageSection(title="Core", blocks=[_core_table(core, core_rows(board))]),
        PageSection(title="Stack", note="newest first", blocks=[_core_table(stack, stack_rows(board))]),
    ]


def _core_table(head: Sequence[str], rows: Sequence[CoreRow]) -> PageTable:
    return PageTable(head=head, rows=[
        [PageCell(text=row.name), PageCell(text=f"{row.value:#010x}", is_number=True), PageCell(text=row.meaning)]
        for row in rows
    ])  # fmt: skip


def _registers(board: BluePill, choice: str) -> list[PageSection]:
    special: Mapping[str, Callable[[BluePill], PageBlock]] = {NVIC: _exceptions, CLOCKS: _clocks}
    if choice in special:
        return [PageSection(title=choice, blocks=[special[choice](board)])]
    if choice not in board.chip.parts.by_name:
        return []
    rows = [
        [PageCell(text=view.name), PageCell(text=f"{view.address:#010x}", is_number=True),
         PageCell(text=f"{view.word:#010x}", is_number=True),
         PageCell(text="  ".join(_field(*field) for field in view.fields))]
        for view in board.registers(choice).values()
    ]  # fmt: skip
    return [PageSection(title=choice, blocks=[PageTable(head=("register", "address", "reads", "fields"), rows=rows)])]


def _field(name: str, value: int) -> str:
    return f"{name} {value:#x}" if value > _LARGEST_PLAIN else f"{name} {value}"


def _exceptions(board: BluePill) -> PageBlock:
    found = exception_rows(board)
    if not found:
        return PageText(text="Nothing is enabled, pending or active.")
    return PageTable(head=("exception", "number", "enabled", "pending", "active", "priority"), rows=[
        [PageCell(text=row.name), PageCell(text=str(row.number), is_number=True),
         *(PageCell(text="yes" if one else "–") for one in (row.is_enabled, row.is_pending, row.is_active)),
         PageCell(text=str(row.priority), is_number=True)]
        for row in found
    ])  # fmt: skip


def _clocks(board: BluePill) -> PageBlock:
    return PageTable(head=("clock", "from", "frequency"), rows=[
        [PageCell(text=row.name), PageCell(text=row.source), PageCell(text=_frequency(row.hz), is_number=True)]
        for row in clock_rows(board)
    ])  # fmt: skip


def _frequency(hz: int) -> str:
    if not hz:
        return "off"
    return f"{hz / _HZ_PER_MHZ:.6g} MHz" if hz >= _HZ_PER_MHZ else f"{hz / 1000:g} kHz"


def _board(board: BluePill) -> list[PageSection]:
    """Return the picture: what each pin of both headers has, and the LED."""
    pins, middle, high = {pin.name: pin for pin in board.pins}, _WIDE / 2, _TOP + _PITCH * len(LEFT) + 10
    led, role = ("LED on", "lit") if board.led_is_on else ("LED off", "unlit")
    shapes = [
        PictureShape(kind="box", x=middle - 80, y=14, width=160, height=high - 14, role="board"),
        PictureShape(kind="box", x=middle - 22, y=6, width=44, height=26, role="metal", title="USB"),
        PictureShape(kind="box", x=middle - 24, y=high / 2, width=48, height=48, role="chip", title="STM32F103C8"),
        PictureShape(kind="circle", x=middle, y=_TOP + 54, width=9, role=role, title=f"{led} (PC13)"),
        PictureShape(kind="text", x=middle, y=_TOP + 80, text=led, role="on-board", align="middle"),
    ]
    for names, way in ((LEFT, -1), (RIGHT, 1)):
        for place, name in enumerate(names):
            shapes += _header_pin(name, pins.get(name), middle + 70 * way, _TOP + _PITCH * place, way)
    said = ", ".join(f"{name} {_pin(pin)[1].split(',')[0]}" for name, pin in pins.items() if not pin.is_floating)
    drawing = PageDrawing(title="BluePill", alt=f"{led}; {said}", width=_WIDE, height=high + 10, shapes=shapes)
    return [PageSection(title="Board", note=led, blocks=[drawing])]


def _header_pin(name: str, pin: Pin | None, x: float, y: float, way: int) -> list[PictureShape]:
    role, words = ("supply", "") if pin is None else _pin(pin)
    label, (inner, outer) = name if pin is None else name.removeprefix("P"), _ALIGNED[way]
    return [
        PictureShape(kind="circle", x=x, y=y, width=6, role=role, title=f"{name}: {words}" if words else name),
        PictureShape(kind="text", x=x - 11 * way, y=y + 4, text=label, role="on-board", align=inner),
        PictureShape(kind="text", x=x + 18 * way, y=y + 4, text=words.split(",")[0], role=role, align=outer),
    ]


def _pin(pin: Pin) -> tuple[str, str]:
    """Return the role of a pin's colour, and what it has: level or wave first, then its mode and who uses it."""
    use = pin.holder or pin.function or ""
    about = f", {pin.mode.value}{f' ({use})' if use else ''}"
    if pin.wave is not None:
        return "wave", f"{pin.wave.frequency_hz:g} Hz{about}"
    if pin.is_floating:
        return "floating", f"floating{about}"
    return ("high", f"high{about}") if pin.level else ("low", f"low{about}")
