"""The BluePill: a board with an STM32F103C8 that runs one firmware.

The main class of the package: it loads the image, hands out pins and serial
ports, runs until something is so, and reports faults and warnings. What the
chip does is `chip.py`. The board itself: 8 MHz crystal, 32 kHz crystal, an LED
on PC13 with its resistor to 3.3 V, BOOT0 low, BOOT1 (PB2) pulled low: both are
jumpers.

A condition in words is met at the boundary of the very block that makes it true,
whatever the caller's slices; a condition in Python is looked at in steps.

    pin PA4 high | pin PA4 low | pin PA4 changes     the level on the wire
    usart1 sends TEXT | usb sends TEXT               characters that go out from now on
    usart1 matches REGEX | usb matches REGEX         a line of them that is whole
    asleep | awake | fault                           what the core is doing

Invariant: results do not depend on how the caller cuts time into slices; a wait
leaves the board's watches and listeners as it found them.
"""

import ctypes
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias, cast

from bluepill_sim.chip import Chip
from bluepill_sim.core import GENERAL, BlockRow, Reg
from bluepill_sim.core.faults import FAULT_ROWS, FaultKind, FaultReport, SeenFault
from bluepill_sim.core.halts import ChipReached
from bluepill_sim.core.nvic import HARD_FAULT, exception_name
from bluepill_sim.errors import BluePillError, ImageError, UnmodelledError
from bluepill_sim.fabric.bus_parts import I2cDevice, SpiDevice
from bluepill_sim.fabric.can_network import CanNetwork
from bluepill_sim.fabric.pins import Pin, PinDrive
from bluepill_sim.fabric.registers import RegisterView
from bluepill_sim.fabric.signals import UV_PER_V, to_uv
from bluepill_sim.fabric.subscriptions import EdgeSink, Of, PinSubscription
from bluepill_sim.memory.arrays import Memory
from bluepill_sim.parts.attached import AttachedParts
from bluepill_sim.parts.serial_port import Activity, BoardSerialLine, SerialPort
from bluepill_sim.parts.usb import UsbHost, UsbSerial
from bluepill_sim.peripherals.can import Can
from bluepill_sim.peripherals.i2c import I2c
from bluepill_sim.peripherals.rcc import OUTSIDE, ResetCause
from bluepill_sim.peripherals.spi import Spi
from bluepill_sim.peripherals.usb import Usb
from bluepill_sim.program.image import Image, load_image
from bluepill_sim.program.last_blocks import TITLE, shortened
from bluepill_sim.program.line_table import LineTable, read_lines
from bluepill_sim.program.reset_loop import ResetRow
from bluepill_sim.spans import Span, to_nanos
from bluepill_sim.stm32f103 import FLASH_BASE, SRAM_BASE, SRAM_BYTES
from simbase.state import PartState, Stateful
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos, Reason

#: Tells whether the board is where one wants it.
Predicate = Callable[["BluePill"], bool]
Condition = str | Predicate

#: How often a condition without an event of its own is looked at. chosen: finer than anything a person waits for.
STEP_NS: Nanos = 1 * NS_PER_MS
#: How many of the last characters of a port a message shows.
_SHOWN_CHARACTERS = 60

#: DS5319 table 6, VDDA above VSS; and more than any chip bears.
_MOST_VDDA_V, _MOST_DEGREES = 4.0, 200
_ERASED_WORD = 0xFFFF_FFFF
#: Those of `SeenFault`.
_SEEN_REGISTERS = (*GENERAL[:15], Reg.XPSR)
_HINT = (
    'such as "pin PA4 high", "usart1 sends ready", "usart1 matches ^end", "asleep", "fault", or a function of the board'
)


class WaitError(BluePillError):
    """What was waited for did not come."""

    exit_code = 1


#: All that decides a board's future; it can be pickled.
BoardSnapshot: TypeAlias = PartState


class BluePill(Stateful):
    """An emulated BluePill.

    >>> board = BluePill("firmware.elf")                # doctest: +SKIP
    >>> board.usart1.expect(b"ready", within="5 s")     # doctest: +SKIP
    >>> board.pin("PA4").drive(1)                       # doctest: +SKIP
    >>> board.until("pin PC13 low", timeout="100 ms")   # doctest: +SKIP

    Raises:
        ImageError: the firmware is missing, damaged, or not for this chip.
        MissingDependencyError: unicorn, pyelftools or intelhex is not installed.
    """

    STATE = (
        "chip",
        "fault",
        "activity",
        "_warned",
        "_usarts",
        "_usb_serial",
        "boot0",
        "resets",
        "reset_row",
        "attached",
    )
    #: Who listens.
    DERIVED = ("_warning_sinks",)

    def __init__(self, image: Image | str | Path, *, strict: bool = False) -> None:
        """Load a firmware and stand at its reset.

        Args:
            image: an image, or the path of an ELF, HEX or BIN file.
            strict: whether the first warning ends the run with an `UnmodelledError`.
        """
        self.image = image if isinstance(image, Image) else load_image(image)
        self._strict = strict
        self._warned: dict[str, str] = {}
        #: The BOOT0 jumper; looked at, with BOOT1 (PB2), at each reset: 0x flash, 11 SRAM, 10 ST's boot loader.
        self.boot0 = False
        self._warning_sinks: list[Callable[[str], None]] = []
        #: The first HardFault or lockup; a later one, where the firmware came back from those before. None: none yet.
        self.fault: FaultReport | None = None
        memory = Memory()
        for address, data in self.image.segments:
            memory.load_flash(address - FLASH_BASE, data)
        memory.seal()
        self._chip: Chip | None = None
        self._chip = chip = Chip(memory, self.image.vector_table, self._warn, self._fault)
        self._activity = Activity()
        self._usarts = tuple(SerialPort(chip.parts.usart(n), self._activity, self._wait_for_bytes) for n in (1, 2, 3))
        #: The parts that were attached by name, and the world that they sense.
        self.attached = AttachedParts(lambda text: chip.pins.warn(text, once=text), chip.request_stop)
        usb = cast("Usb", chip.parts.by_name["USB"])
        self._usb = UsbHost(usb, self._run_until)
        self._usb_serial = UsbSerial(self._usb, self._wait_for_bytes, chip.request_stop)
        usb.attach(self._usb)
        #: How often it was reset since power came up, by cause.
        self.resets: Counter[ResetCause] = Counter()
        #: Those of them that come one soon after the other, and whether they have no end.
        self.reset_row = ResetRow()
        chip.on_reset = self._reset_begins
        chip.boot_address = self._boot_address
        chip.pins.is_serial_input = self._is_driven_in_words
        chip.pins["PC13"].board_pull = PinDrive.PULL_UP
        chip.pins["PB2"].board_pull = PinDrive.PULL_DOWN
        chip.pins["PA12"].board_pull = PinDrive.PULL_UP

    def power_up_with(self, sram: bytes) -> None:
        """Have the SRAM hold something else than zeros as power comes up, as that of a chip does; before anything runs.

        Args:
            sram: as many bytes as the SRAM has.

        Raises:
            ValueError: the board has run, or there are more or fewer bytes.
        """
        if self.cycle or len(sram) != SRAM_BYTES:
            raise ValueError(f"SRAM takes {SRAM_BYTES} bytes, before the board runs: {len(sram)} at cycle {self.cycle}")
        ctypes.memmove(self.chip.memory.sram, sram, SRAM_BYTES)

    # Time.

    @property
    def now_ns(self) -> Nanos:
        """The time reached."""
        return self.chip.now_ns

    @property
    def hclk_hz(self) -> int:
        """The core's frequency."""
        return self.chip.clocks.hclk_hz

    @property
    def cycle(self) -> int:
        """Core cycles since power-on."""
        return self.chip.engine.cycle

    def next_deadline(self) -> Nanos | None:
        """Return when a peripheral next acts by itself; None for never. The core may act at any time."""
        deadlines = (self.chip.next_deadline(), self.attached.next_deadline())
        return min((at for at in deadlines if at is not None), default=None)

    def advance_to(self, limit_ns: Nanos) -> ChipReached:
        """Run to the first block boundary at or after a time.

        Returns:
            DEADLINE there; EDGE earlier, at the end of the block that changed a
            watched pin; HALT once the core is locked up, with time at the limit.

        Raises:
            UnmodelledError: in strict mode, something was warned of.
        """
        return self._advance(limit_ns, self.chip.advance_to)

    def step(self, limit_ns: Nanos) -> ChipReached:
        """Run one instruction, as `Chip.step`, and bring the parts along."""
        return self._advance(limit_ns, self.chip.step)

    def run_for(self, span: Span) -> ChipReached:
        """Run for a span of virtual time, such as "10 ms" or nanoseconds, past watched edges; a halt ends it early."""
        end_ns = self.now_ns + to_nanos(span)
        while True:
            reached = self.advance_to(end_ns)
            if reached.reason is not Reason.EDGE:
                return reached

    def until(self, condition: Condition, timeout: Span = "1 s") -> Nanos:
        """Run until a condition holds; return when that was.

        Args:
            condition: "pin PA4 high" (low, changes), "usart1 sends TEXT", "usart1 matches REGEX" (a whole line),
                "asleep", "awake", "fault", each met to the basic block; or a function of the board, looked at each
                millisecond.
            timeout: the longest wait, in virtual time.

        Raises:
            WaitError: the time is over, or the core halted for good.
            BluePillError: the words are not understood.
        """
        return run_until(self, condition, timeout)

    @property
    def supply_v(self) -> float:
        """The supply in volts, which the PVD sees; 2.0 to 3.6.

        Raises:
            ValueError: set to what the chip does not work at.
        """
        return self.chip.power.supply_mv / 1000

    @supply_v.setter
    def supply_v(self, volts: float) -> None:
        self.chip.set_supply(round(1000 * volts))

    @property
    def crystal_works(self) -> bool:
        """Whether the crystal of HSE oscillates; set it to False to have it fail."""
        return self.chip.parts.rcc.crystal_works

    @crystal_works.setter
    def crystal_works(self, works: bool) -> None:
        rcc = self.chip.parts.rcc
        if works is not rcc.crystal_works:
            rcc.repair_crystal() if works else rcc.fail_crystal()

    @property
    def lsi_hz(self) -> int:
        """The frequency of LSI, which differs from part to part: 30 to 60 kHz.

        Raises:
            ValueError: set to one that it does not have.
        """
        return self.chip.clocks.lsi_hz

    @lsi_hz.setter
    def lsi_hz(self, frequency_hz: int) -> None:
        self.chip.parts.rcc.set_lsi(frequency_hz)

    def request_stop(self) -> None:
        """End the running `advance_to` at the boundary of the running block."""
        self.chip.request_stop()

    def reset(self) -> None:
        """Press the reset button: time and the outside of the pins stay as they are."""
        self.chip.reset(ResetCause.PIN)
        self.fault = None

    # What is on the board.

    def pin(self, name: str) -> Pin:
        """Return a pin.

        Args:
            name: such as "PA4".

        Raises:
            KeyError: the chip has no such pin.
        """
        return self.chip.pins[name]

    @property
    def vdda_v(self) -> float:
        """The supply of the ADCs, and their reference, in volts: 3.3, or what was set, above 0 and at most 4."""
        return float(self.chip.fabric.analog_struct.vdda_uv / UV_PER_V)

    @vdda_v.setter
    def vdda_v(self, volts: float) -> None:
        if not 0 < volts <= _MOST_VDDA_V:
            raise ValueError(f"VDDA of {volts} V")
        self.chip.fabric.inputs_change()
        self.chip.fabric.analog_struct.vdda_uv = to_uv(volts)

    @property
    def temperature_c(self) -> float:
        """The temperature of the chip in degrees Celsius: 25, or what was set, from -200 to 200."""
        return float(self.chip.fabric.analog_struct.temperature_mc / 1000)

    @temperature_c.setter
    def temperature_c(self, degrees: float) -> None:
        if not abs(degrees) <= _MOST_DEGREES:
            raise ValueError(f"a chip at {degrees} degrees")
        self.chip.fabric.inputs_change()
        self.chip.fabric.analog_struct.temperature_mc = round(1000 * degrees)

    def subscribe_pins(
        self, pins: Iterable[str], sink: EdgeSink, *, of: Of = Of.DRIVE, ends_slice: Iterable[str] = (),
        waves: bool = False,
    ) -> PinSubscription:  # fmt: skip
        """Have `sink` called with each change of these pins from now on, in bulk: rows of `EDGE`, oldest first.

        Args:
            pins: names, such as "PA4".
            sink: called before `advance_to` returns.
            of: which changes make a row.
            ends_slice: pins whose change ends the chip's slice.
            waves: whether a wave is one row (`read_rows`), and not its edges.

        Raises:
            KeyError: the chip has no such pin.
        """
        return self.chip.pins.subscribe_pins(pins, sink, of=of, ends_slice=ends_slice, waves=waves)

    def subscribe_warnings(self, sink: Callable[[str], None]) -> Callable[[], None]:
        """Have `sink` called with each new warning, at its time; return a function that ends it."""
        self._warning_sinks.append(sink)
        return lambda: self._warning_sinks.remove(sink)

    @contextmanager
    def without_warnings(self) -> Iterator[None]:
        """Tell nobody of warnings while a debugger looks at what the program would be warned of; they are noted."""
        sinks, self._warning_sinks = self._warning_sinks, []
        try:
            yield
        finally:
            self._warning_sinks = sinks

    @property
    def pins(self) -> tuple[Pin, ...]:
        """Every pin that has a leg, in the order of the ports."""
        return tuple(pin for pin in self.chip.pins if pin.is_bonded)

    @property
    def led_is_on(self) -> bool:
        """Whether the green LED shines: it hangs between 3.3 V and PC13, so a strong low lights it."""
        return self.pin("PC13").output is PinDrive.LOW

    @property
    def usart1(self) -> SerialPort:
        """USART1: TX on PA9, RX on PA10."""
        return self._usarts[0]

    @property
    def usart2(self) -> SerialPort:
        """USART2: TX on PA2, RX on PA3."""
        return self._usarts[1]

    @property
    def usart3(self) -> SerialPort:
        """USART3: TX on PB10, RX on PB11."""
        return self._usarts[2]

    @property
    def serial_ports(self) -> Mapping[str, SerialPort]:
        """The USARTs by name: "usart1" to "usart3"."""
        return {port.name.lower(): port for port in self._usarts}

    @property
    def usb(self) -> UsbHost:
        """The host at the USB socket; its cable is plugged in by `plug` or `wait_configured`."""
        return self._usb

    @property
    def usb_serial(self) -> UsbSerial:
        """The serial line of a CDC device at the USB socket."""
        return self._usb_serial

    @property
    def chip(self) -> Chip:
        """The chip itself, for tools."""
        if self._chip is None:
            raise RuntimeError("the chip is still being made")
        return self._chip

    # What the firmware does.

    @property
    def warnings(self) -> list[str]:
        """Every warning so far, oldest first."""
        return list(self._warned.values())

    @property
    def activity(self) -> Activity:
        """When the firmware last did something that shows outside."""
        self._activity.last_pin_ns = max(self._activity.last_pin_ns, self.chip.fabric.last_output_ns)
        slept = self.chip.processor.last_sleep_cycle
        if slept is not None:
            self._activity.last_wfi_ns = self.chip.ns_of(slept)
        return self._activity

    @property
    def has_died(self) -> bool:
        """Whether the firmware is in its HardFault handler or returns to its fault, is locked up, or was reset then.

        Or resets for ever, as `ResetRow` has it; it is held in reset then.
        """
        fault = self.fault
        if self.reset_row.endless_ns is not None:
            return True
        return fault is not None and (
            fault.ended_in_reset
            or self.chip.processor.is_locked_up
            or self._handles_hard_fault()
            or fault.repeats_at(self.now_ns)
        )

    @property
    def died_ns(self) -> Nanos | None:
        """When the firmware died; None: it has not."""
        if not self.has_died or self.fault is None:
            return self.reset_row.endless_ns
        ends = self.reset_row.endless_ns
        return self.fault.at_ns if ends is None else min(ends, self.fault.at_ns)

    @property
    def verdict(self) -> str:
        """What became of the firmware, where that is worth a word: faults and resets; empty where it just ran."""
        parts = []
        if self.reset_row.endless_ns is not None:
            parts.append(f"firmware fault: {self.reset_row}")
        if self.fault is not None:
            what = "firmware fault" if self.has_died else "the firmware came back from a HardFault"
            parts.append(f"{what}: {self.fault}")
        if self.resets:
            causes = ", ".join(f"{cause.name} {count}" for cause, count in self.resets.items())
            times = self.resets.total()
            parts.append(f"{times} reset{'s' if times != 1 else ''} ({causes})")
        return "; ".join(parts)

    def _handles_hard_fault(self) -> bool:
        return bool(self.chip.processor.nvic.active >> HARD_FAULT & 1)

    @property
    def is_asleep(self) -> bool:
        """Whether the core is waiting in WFI or WFE."""
        return self.chip.processor.is_asleep

    @property
    def pc(self) -> int:
        """The address of the next instruction."""
        return self.chip.engine.pc

    def where(self) -> str:
        """Return where the program is: "symbol+0x12 (0x08000123)", and in a handler of which exception."""
        number = self.chip.processor.exception_number
        return self.image.symbols.where(self.pc) + (f", handling {exception_name(number)}" if number else "")

    @property
    def last_rows(self) -> tuple[BlockRow, ...]:
        """What ran last, oldest first: up to the fault, if there was one, else up to now (rows of `BlockRecorder`)."""
        return self.chip.engine.log.rows() if self.fault is None else self.fault.last_rows

    @property
    def entered_blocks(self) -> frozenset[int]:
        """The first address of every basic block that has run since the board was made; it costs the run nothing.

        What was restored over is not forgotten. How often, and which ways of branches, `analysis.coverage` counts.
        """
        return self.chip.engine.entered_blocks

    @property
    def gone_ways(self) -> frozenset[tuple[int, bool]]:
        """As of `entered_blocks`: the ends of blocks in flash, each with whether it went on elsewhere than there.

        Of a conditional branch that stands before the end these are its two ways: fell through, and taken.
        """
        return self.chip.engine.gone_ways

    def last_blocks(self) -> list[str]:
        """Return what ran last as lines for a person: the last 32 blocks and exceptions, with symbol and line.

        A loop is one line with a count; `last_rows` has every turn.
        """
        try:
            table = read_lines(self.image)
        except ImageError:  # the file has been built anew meanwhile, or never had lines
            table = LineTable()
        return shortened(self.last_rows, self.image.symbols, table)

    def register(self, name: str) -> int:
        """Return a register by its name, such as "R0", "SP" or "XPSR"."""
        return self.chip.engine.registers[Reg[name.upper()]]

    def registers(self, peripheral: str) -> dict[str, RegisterView]:
        """Return the registers of a peripheral by name, with their fields, as a read would find them; nothing changes.

        `board.registers("TIM3")["CR1"]["CEN"]` is a field, `print(board.registers("TIM3")["CR1"])` shows them all.

        Raises:
            BluePillError: The emulated chip has no such peripheral.
        """
        parts = self.chip.parts.by_name
        if peripheral not in parts:
            raise BluePillError(f"no peripheral {peripheral!r}", hint=f"there are {', '.join(parts)}")
        return parts[peripheral].view()

    def read_memory(self, address: int, size: int) -> bytes | None:
        """Return bytes of flash or SRAM; None where there is no memory."""
        return self.chip.memory.read(address, size)

    # What hangs on its buses and pins.

    def attach(
        self, part: object, *, on: str | None = None, select: str | None = None, name: str = "", **pins: str
    ) -> None:  # fmt: skip
        """Attach a part, one that ships or one of your own (docs/parts.md).

        >>> board.attach(Ssd1306(), on="I2C1")                     # doctest: +SKIP
        >>> board.attach(HcSr04(), trig="PA8", echo="PB6")         # doctest: +SKIP

        Args:
            part: what it is.
            on: the bus that it hangs on: "SPI1", "I2C1", "USART2", "CAN"; None: pins alone.
            select: of an SPI, the pin that selects it while it is low; None: it always is.
            name: what it is called in `attached.by_name`; empty: its class.
            pins: its own pins by their names, each a pin of the chip.

        Raises:
            PartError: it cannot be attached so.
        """
        self.attached.attach(self, self.chip.pins, part, name, on, select, pins)

    def spi(self, name: str, device: SpiDevice | None = None, *, select: str | None = None) -> Spi:
        """Return an SPI, "SPI1" or "SPI2"; with a device, hang it on the bus first.

        Args:
            name: which.
            device: a part, or `Loopback()` for a wire from MOSI to MISO.
            select: the pin that selects the part while it is low, such as "PA4", with a pull-up; None: it always is.

        Raises:
            BluePillError: the chip has no such SPI or pin.
        """
        part = self.chip.parts.by_name.get(name.upper())
        if not isinstance(part, Spi):
            raise BluePillError(f"no such SPI: {name}", hint="SPI1 or SPI2")
        if device is not None:
            try:
                part.attach(device, select and select.upper())
            except KeyError:
                raise BluePillError(f"no such pin: {select}", hint="PA0 to PA15, PB0 to PB15, PC13 to PC15") from None
        return part

    def i2c(self, name: str, device: I2cDevice | None = None) -> I2c:
        """Return an I2C, "I2C1" or "I2C2"; with a device, hang it on the bus first, which then has pull-ups.

        Raises:
            BluePillError: the chip has no such I2C.
        """
        part = self.chip.parts.by_name.get(name.upper())
        if not isinstance(part, I2c):
            raise BluePillError(f"no such I2C: {name}", hint="I2C1 or I2C2")
        if device is not None:
            part.attach(device)
        return part

    def can(self, network: CanNetwork | None = None) -> Can:
        """Return the CAN; with a network, join it first."""
        part = cast("Can", self.chip.parts.by_name["CAN"])
        if network is not None:
            part.attach(network)
        return part

    def _advance(self, limit_ns: Nanos, go_on: Callable[[Nanos], ChipReached]) -> ChipReached:
        """Bring the chip forward, and every part to its deadlines on the way."""
        attached = self.attached
        if not attached.has_deadlines:
            return go_on(limit_ns)
        while True:
            due_ns = attached.next_deadline()
            reached = go_on(limit_ns if due_ns is None or due_ns > limit_ns else due_ns)
            attached.act(self.now_ns)
            is_on_its_way = reached.reason is Reason.DEADLINE or (
                reached.reason is Reason.HALT and reached.halt is None
            )
            if not is_on_its_way or self.now_ns >= limit_ns:
                return reached

    # Callbacks of the chip.

    def _is_driven_in_words(self, pin: Pin) -> bool:
        """Whether something outside sends on a pin, though not as levels."""
        buses = [part for part in self.chip.parts.by_name.values() if isinstance(part, Spi | Can)]
        return any(port.receives_at(pin.name) for port in self._usarts) or any(bus.sends_at(pin.name) for bus in buses)

    def _reset_begins(self, cause: ResetCause) -> None:
        if self.fault is not None:
            ended = self.has_died
            self.fault = replace(self.fault, ended_in_reset=ended, returns=self.fault.returns if ended else 0)
        self.resets[cause] += 1
        self._count_reset(cause)

    def _count_reset(self, cause: ResetCause) -> None:
        """Hold a program in reset that resets for ever."""
        row, now_ns = self.reset_row, self.chip.now_ns
        if cause in OUTSIDE:
            row.clear()
        elif row.endless_ns is None and row.add(now_ns):
            self.chip.deliver()
            activity = self.activity
            if max(activity.last_pin_ns, activity.last_usart_ns) > row.first_ns:
                row.begin_anew(now_ns)
            else:
                row.endless_ns, self.chip.is_held = now_ns, True

    def _boot_address(self) -> int:
        """Return where the BOOT pins have a reset start (RM0008 3.4, table 9)."""
        if not self.boot0:
            return self.image.vector_table
        if self.pin("PB2").level:
            return SRAM_BASE
        raise UnmodelledError(
            "BOOT0 is set and BOOT1 is not: the chip would start ST's boot loader, which is not modelled",
            hint="clear boot0 for the flash, or drive PB2 high for the SRAM",
        )

    def _run_until(self, holds: Callable[[], bool], within: Span) -> bool:
        """Run until something is so, looked at each millisecond; return whether it is."""
        end_ns = self.now_ns + to_nanos(within)
        while not holds() and self.now_ns < end_ns:
            if self.advance_to(min(end_ns, self.now_ns + STEP_NS)).reason is Reason.HALT:
                break
        return holds()

    def _wait_for_bytes(self, port: BoardSerialLine, pattern: bytes, within: Span) -> None:
        """Run until `pattern` is in what `port` has sent and nobody has taken (`BoardSerialLine.expect`)."""
        end_ns = self.now_ns + to_nanos(within)
        with _stop_at_characters(port):
            while pattern not in port.unread:
                reached = self.advance_to(end_ns)
                if reached.reason is Reason.HALT or (self.now_ns >= end_ns and pattern not in port.unread):
                    last = bytes(port.unread[-_SHOWN_CHARACTERS:])
                    usb = f"{self.usb.describe()}; " if port is self._usb_serial else ""
                    raise _wait_error(
                        self,
                        f"{port.name} did not send {pattern!r} within {to_nanos(within) / NS_PER_S:g} s; "
                        f"it sent {last!r}; {usb}{_state_of(self)}",
                    )

    def _warn(self, message: str, once: str, pc: int) -> None:
        if once in self._warned:
            return
        text = f"{message} at {self.image.symbols.where(pc)}"
        self._warned[once] = text
        if self._strict:
            raise UnmodelledError(text, hint="run without --strict to go on after warnings")
        for sink in self._warning_sinks:
            sink(text)

    def _fault(self, kind: FaultKind, pc: int, address: int | None, is_lockup: bool, seen: SeenFault | None) -> None:
        if kind is FaultKind.MASKED_SVC and not is_lockup:
            # Some systems live on it (NuttX): its HardFault handler serves the call.
            self._warn("SVC while its priority is masked becomes a HardFault", "masked SVC", pc)
            return
        # A lockup in the same moment is that of a HardFault that could not even be entered.
        is_same = self.fault is not None and self.fault.last_ns == self.chip.now_ns
        goes_on = is_lockup and (is_same or self._handles_hard_fault())
        if self.fault is not None and (goes_on or self.fault.ended_in_reset):
            self.fault = replace(self.fault, is_lockup=self.fault.is_lockup or is_lockup)
            return
        seen = seen or self._seen()
        registers = [(register.name, value) for register, value in zip(_SEEN_REGISTERS, seen.registers, strict=True)]
        registers.insert(15, ("PC", pc))
        known = None if self.fault is None or seen.is_other or is_lockup else (self.fault.kind, self.fault.registers)
        if self.fault is not None and known == (kind, tuple(registers)):
            self.fault = self.fault.again(seen)
            return
        self.fault = FaultReport(
            kind=kind,
            exception=FAULT_ROWS[kind].exception,
            pc=pc,
            where=self.image.symbols.where(pc),
            address=address,
            registers=tuple(registers),
            at_ns=seen.at_ns,
            is_lockup=is_lockup,
            vector=self._vector_of(seen, pc),
            last_rows=seen.last_rows,
            returns=seen.returns,
            last_ns=seen.last_ns,
            round_ns=seen.round_ns,
        )

    def _seen(self) -> SeenFault:
        """Return the core as it is."""
        chip, processor = self.chip, self.chip.processor
        number = processor.exception_number
        return SeenFault(
            at_ns=chip.now_ns,
            registers=tuple(chip.engine.registers[register] for register in _SEEN_REGISTERS),
            exception_number=number,
            vector=chip.memory.read_word(processor.vector_table + 4 * number),
            last_rows=chip.engine.log.rows(),
            last_ns=chip.now_ns,
        )

    def _vector_of(self, seen: SeenFault, pc: int) -> str:
        """Return what the vector of the running handler is, where it has just led to `pc`; empty where it has not."""
        number, vector, rows = seen.exception_number, seen.vector, seen.last_rows
        at = self.chip.processor.vector_table + 4 * number
        if not number or vector is None or vector & ~1 != pc or not rows or rows[-1][2] != number:
            return ""
        erased = ": erased flash" if vector == _ERASED_WORD else ""
        return f"the vector of {exception_name(number)} at {at:#010x} is {vector:#010x}{erased}"


def run_until(
    board: BluePill, condition: Condition, timeout: Span, advance: Callable[[Nanos], ChipReached] | None = None
) -> Nanos:
    """Run until a condition holds; return when that was.

    Args:
        board: what runs.
        condition: words as in `BluePill.until`, or a function of the board, looked at each millisecond.
        timeout: the longest wait, in virtual time.
        advance: brings the board to a time, or less far; None is the board's own.

    Raises:
        WaitError: the time is over, or the core halted for good; its notes show what ran last.
        BluePillError: the words are not understood.
    """
    advance = advance or board.advance_to
    end_ns = board.now_ns + to_nanos(timeout)
    with _watch(board, condition) as (holds, step_ns):
        while not holds():
            if board.now_ns >= end_ns:
                raise _wait_error(
                    board,
                    f"not seen within {to_nanos(timeout) / NS_PER_S:g} s: {_words_of(condition)}; {_state_of(board)}",
                )
            limit = end_ns if step_ns is None else min(end_ns, board.now_ns + step_ns)
            if advance(limit).reason is Reason.HALT and not holds():
                raise _wait_error(board, f"the core halted before: {_words_of(condition)}; {_state_of(board)}")
        return board.now_ns


@contextmanager
def _watch(board: BluePill, condition: Condition) -> Iterator[tuple[Callable[[], bool], Nanos | None]]:
    """Make the board stop where a condition may have become true; yields (holds, step)."""
    if callable(condition):
        yield (lambda: condition(board)), STEP_NS
        return
    words = condition.split(maxsplit=2)
    match [word.lower() for word in words[:2]]:
        case ["pin", name] if len(words) == 3:
            with _stop_at_pin(board, name.upper(), words[2].lower()) as holds:
                yield holds, None
        case [name, "sends"] if len(words) == 3 and name in _ports(board):
            sent, text = bytearray(), words[2].encode()
            with _stop_at_characters(_ports(board)[name], sent):
                yield (lambda: text in sent), None
        case [name, "matches"] if len(words) == 3 and name in _ports(board):
            sent, wanted = bytearray(), _line_pattern(words[2])
            with _stop_at_characters(_ports(board)[name], sent):
                yield (lambda: _has_line(sent, wanted)), None
        case [state] if state in _STATES:
            yield (lambda: _STATES[state](board)), STEP_NS
        case _:
            raise BluePillError(f"{condition!r} is not understood", hint=_HINT)


def _line_pattern(text: str) -> re.Pattern[str]:
    try:
        return re.compile(text)
    except re.error as error:
        raise BluePillError(f"{text!r} is no regular expression: {error}", hint=_HINT) from error


def _has_line(sent: bytearray, wanted: re.Pattern[str]) -> bool:
    """Tell whether a line has gone out whole that matches; those that do not are dropped."""
    while (end := sent.find(b"\n")) >= 0:
        if wanted.search(sent[:end].decode("utf-8", "replace").rstrip("\r")):
            return True
        del sent[: end + 1]
    return False


_STATES: dict[str, Predicate] = {
    "asleep": lambda board: board.is_asleep,
    "awake": lambda board: not board.is_asleep,
    "fault": lambda board: board.fault is not None,
}


@contextmanager
def _stop_at_pin(board: BluePill, name: str, what: str) -> Iterator[Callable[[], bool]]:
    try:
        pin = board.pin(name)
    except KeyError:
        raise BluePillError(f"no such pin: {name}", hint="PA0 to PA15, PB0 to PB15, PC13 to PC15") from None
    before = pin.level
    tests: dict[str, Callable[[], bool]] = {
        "high": lambda: pin.level,
        "low": lambda: not pin.level,
        "changes": lambda: pin.level is not before,
    }
    if what not in tests:
        raise BluePillError(f"a pin is high, low, or changes; it cannot be {what!r}", hint=_HINT)
    subscription = board.subscribe_pins([name], lambda _rows: None, of=Of.WIRE, ends_slice=[name])
    try:
        yield tests[what]
    finally:
        subscription.close()


def _ports(board: BluePill) -> dict[str, BoardSerialLine]:
    """Return what sends characters, by its name in a condition."""
    return {**board.serial_ports, "usb": board.usb_serial}


@contextmanager
def _stop_at_characters(port: BoardSerialLine, sent: bytearray | None = None) -> Iterator[None]:
    """End the board's slice after each character that a port sends; collect them in `sent`."""

    def take(rows: Sequence[tuple[int, Nanos]]) -> None:
        if sent is not None:
            sent.extend(word & 0xFF for word, _ in rows)

    close = port.subscribe(take, ends_slice=True)
    try:
        yield
    finally:
        close()


def _words_of(condition: Condition) -> str:
    return condition if isinstance(condition, str) else getattr(condition, "__name__", "the condition")


def _wait_error(board: BluePill, message: str) -> WaitError:
    """Return the error of a wait that failed; its note, the last blocks, shows in pytest and tracebacks only."""
    error = WaitError(message)
    lines = board.last_blocks()
    if lines:
        error.add_note("\n".join([TITLE, *lines]))
    return error


def _state_of(board: BluePill) -> str:
    if board.fault is not None:
        return f"{board.fault}"
    doing = "asleep at" if board.is_asleep else "at"
    return f"t = {board.now_ns / NS_PER_S:.6f} s, {doing} {board.where()}"
