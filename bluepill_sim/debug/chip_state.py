"""What a chip holds at a moment, in the manual's words: core, stack, exceptions, clocks, and the lines of its program.

Registers of peripherals are `BluePill.registers`. Everything is read as a debugger reads it, between two instructions.

Invariant: looking changes nothing, not even a status flag.
"""

from dataclasses import dataclass

from bluepill_sim.board import BluePill
from bluepill_sim.core.nvic import FIRST_IRQ, VECTOR_COUNT, exception_name
from bluepill_sim.debug.inspector import Inspector
from bluepill_sim.debug.target_description import REGISTERS
from bluepill_sim.program.elf_file import stack_top
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.stm32f103 import FLASH_BASE, FLASH_BYTES_FITTED, without_alias

#: chosen: words of the stack that a screen shows beside other things.
MOST_WORDS = 32
_CODE = ("pc", "lr")
#: APSR's flags (ARMv7-M B1.4.2), from bit 31 down.
_FLAGS = "NZCVQ"


@dataclass(frozen=True, slots=True)
class CoreRow:
    """A register of the core, or a word of the stack."""

    #: `r0`, `lr`; of the stack the address.
    name: str
    value: int
    #: What it means: a function and its line, flags; empty: a number.
    meaning: str = ""


@dataclass(frozen=True, slots=True)
class ExceptionRow:
    """An exception that is enabled, pending or active."""

    number: int
    name: str
    is_enabled: bool
    is_pending: bool
    is_active: bool
    priority: int


@dataclass(frozen=True, slots=True)
class ClockRow:
    """A clock: where it comes from and how fast it is, Hz; 0: it stands still."""

    name: str
    source: str
    hz: int


@dataclass(frozen=True, slots=True)
class ProgramPlace:
    """Where a program stands: the line that comes next."""

    file: str
    line: int
    function: str


def core_rows(board: BluePill) -> list[CoreRow]:
    """Return the core's registers, in GDB's order."""
    inspector = Inspector(board)
    return [CoreRow(row.name, value, _meaning(board, row.name, value))
            for row in REGISTERS for value in (inspector.register(row.name),)]  # fmt: skip


def _meaning(board: BluePill, name: str, value: int) -> str:
    if name == "xpsr":
        flags = "".join(flag if value >> 31 - place & 1 else flag.lower() for place, flag in enumerate(_FLAGS))
        return f"{flags}, {exception_name(value & 0x1FF)}"
    return code_place(board, value) if name in _CODE else ""


def code_place(board: BluePill, address: int) -> str:
    """Return the function, and the line where it is known, of an address of code; empty where it is none."""
    address &= ~1
    offset = without_alias(address) - FLASH_BASE
    if not 0 < offset < FLASH_BYTES_FITTED:
        return ""
    function = board.image.symbols.where(address).rpartition(" (")[0]
    line = read_lines(board.image).place(address)
    return f"{function}, {line}" if line and function else function


def stack_rows(board: BluePill) -> list[CoreRow]:
    """Return the words of the stack in use, the newest first, at most `MOST_WORDS`; those that lead back name where."""
    pointer = Inspector(board).register("sp")
    top = stack_top(board.image)
    size = min(max(0, top - pointer), 4 * MOST_WORDS)
    data = (board.read_memory(pointer, size) or b"") if size else b""
    words = (int.from_bytes(data[at : at + 4], "little") for at in range(0, len(data) - 3, 4))
    # A return address has bit 0 set: Thumb.
    return [CoreRow(f"{pointer + 4 * place:#010x}", word, code_place(board, word) if word & 1 else "")
            for place, word in enumerate(words)]  # fmt: skip


def exception_rows(board: BluePill) -> list[ExceptionRow]:
    """Return each exception that is enabled, pending or active; those of the system count as enabled where they act."""
    nvic = board.chip.processor.nvic
    found = []
    for number in range(2, VECTOR_COUNT):
        is_enabled = number >= FIRST_IRQ and bool(nvic.enabled >> number - FIRST_IRQ & 1)
        is_pending, is_active = bool(nvic.pending >> number & 1), bool(nvic.active >> number & 1)
        if is_enabled or is_pending or is_active:
            row = ExceptionRow(number, exception_name(number), is_enabled, is_pending, is_active, nvic.priority(number))
            found.append(row)
    return found


def clock_rows(board: BluePill) -> list[ClockRow]:
    """Return the clock tree from its oscillators on, as RCC has set it up (RM0008 figure 8)."""
    clocks, rcc = board.chip.clocks, board.chip.parts.rcc
    control, setup = (board.registers("RCC")[name] for name in ("CR", "CFGR"))
    hse_hz = rcc.hse_hz or 0 if control["HSERDY"] else 0
    hsi_hz = rcc.native.hsi_hz if control["HSIRDY"] else 0
    pll_from = "HSE" if setup["PLLSRC"] else "HSI / 2"
    if setup["PLLSRC"] and setup["PLLXTPRE"]:
        pll_from = "HSE / 2"
    source = ("HSI", "HSE", "PLLCLK", "nothing")[setup["SWS"]]
    return [
        ClockRow("HSI", "inside, RC", hsi_hz), ClockRow("HSE", "crystal", hse_hz),
        ClockRow("PLLCLK", f"{pll_from} x {min(setup['PLLMUL'] + 2, 16)}",
                 rcc.native.pll_hz if control["PLLRDY"] else 0),
        ClockRow("SYSCLK", source, clocks.sysclk_hz), ClockRow("HCLK", "SYSCLK, AHB", clocks.hclk_hz),
        ClockRow("PCLK1", "HCLK, APB1", clocks.pclk1_hz), ClockRow("PCLK2", "HCLK, APB2", clocks.pclk2_hz),
        ClockRow("TIM2 to TIM4", "PCLK1, doubled where divided", clocks.timer1_hz),
        ClockRow("TIM1", "PCLK2, doubled where divided", clocks.timer2_hz),
        ClockRow("ADCCLK", f"PCLK2 / {clocks.adc_divider}", clocks.pclk2_hz // clocks.adc_divider),
        ClockRow("USBCLK", "PLLCLK", clocks.usb_hz), ClockRow("LSI", "inside, RC; IWDG", clocks.lsi_hz),
        ClockRow("RTCCLK", "as BDCR says", clocks.rtcclk_hz),
    ]  # fmt: skip


def source_place(board: BluePill) -> ProgramPlace | None:
    """Return where the program stands; None where no line is known."""
    row = read_lines(board.image).at(board.pc)
    if row is None:
        return None
    return ProgramPlace(row.file, row.line, board.image.symbols.where(board.pc).partition("+")[0])
