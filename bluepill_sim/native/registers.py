"""The declared registers, handed to the native core: those that only store need no Python.

    reads plain    the register has no `on_read`; what is read may be latched
    writes plain   it has no `on_write`
    GPIO           BSRR, BRR and ODR, while nothing but IDR follows from a pin's level
    USART          DR, while characters follow each other and the interrupt lines have no listeners

An access goes to Python when its page has no clock, when a peripheral is due
before the block ends, and for everything else.

Invariant: a pin is marked as simple only after Python has set it up as one, and
loses the mark with each change of what made it so.
"""

import ctypes
from collections.abc import Callable, Iterable, Sized
from typing import TYPE_CHECKING

from bluepill_sim.fabric.pins import PinBank
from bluepill_sim.fabric.registers import Peripheral
from bluepill_sim.native.library import library
from bluepill_sim.native.streams import DIRTY, NativePorts, SharedStreams
from bluepill_sim.peripherals.gpio import Gpio
from bluepill_sim.peripherals.rcc import Rcc
from bluepill_sim.peripherals.usart import Usart
from bluepill_sim.stm32f103 import CLOCK_GATES, PERIPHERAL_BASE

if TYPE_CHECKING:
    from bluepill_sim.native.engine import NativeEngine

#: Bits of a register's behaviour (`enum behaviour`); the word that latches stands above them, 0 for none.
_READS_PLAIN, _WRITES_PLAIN, _USART_DATA, _LATCH_SHIFT = 1, 2, 4, 4
_PAGE_SHIFT = 10


class _Port(ctypes.Structure):
    """`struct port`."""

    _fields_ = (("simple", ctypes.c_uint32), ("changed", ctypes.c_uint32))


class SharedPorts:
    """The GPIO ports whose plain outputs C switches, and what C has to know of listeners."""

    def __init__(
        self,
        engine: "NativeEngine",
        bank: PinBank,
        irq_listeners: Sized,
        streams: SharedStreams,
        ns_of: Callable[[int], int],
    ) -> None:
        self._engine = engine
        self._ns_of = ns_of
        self._was_subscribed = True
        self._is_recording = False
        self._irq_listeners = irq_listeners
        self.streams = streams
        self._listener_count = 0
        self._bank = bank
        self._ports: list[tuple[Gpio, _Port]] = []

    def add(self, gpio: Gpio, port: _Port) -> None:
        """Share a port."""
        self._ports.append((gpio, port))

    def take_over(self) -> None:
        """Bring pins and USARTs in line with what C has done, before they are read."""
        shared = self._engine.shared
        dirty, shared.dirty = shared.dirty, 0
        if dirty & ~DIRTY:
            self._take_pins_over()
        if dirty & DIRTY:
            self.streams.take_back()

    def _take_pins_over(self) -> None:
        bank = self._bank
        for take in bank.bulk_listeners:
            take()
        library().core_drop_pins(self._engine.state)
        on_output, bank.on_output = bank.on_output, None
        wire_listeners, bank.wire_listeners = bank.wire_listeners, []
        for gpio, port in self._ports:
            changed, port.changed = port.changed, 0
            if changed:
                gpio.repeat_outputs(changed)
        bank.on_output, bank.wire_listeners = on_output, wire_listeners
        if bank.on_silent_output is not None:
            bank.on_silent_output(self._ns_of(self._engine.shared.last_pin_cycle))

    def mark(self) -> None:
        """Mark for C, before a run, which pins are simple and whether there are listeners."""
        bank = self._bank
        if len(self._irq_listeners) != self._listener_count:
            self._listener_count = len(self._irq_listeners)
            self._engine.shared.has_irq_listeners = self._listener_count != 0
        is_recording = bool(bank.bulk_listeners)
        if is_recording is not self._is_recording:
            self._is_recording = is_recording
            if not library().core_record_pins(self._engine.state, is_recording):
                raise MemoryError("no memory for a record of pins")
        is_subscribed = (
            bank.is_subscribed() or bool(bank.subscriptions) or len(bank.wire_listeners) > len(bank.bulk_listeners)
        )
        if bank.simple_is_known and is_subscribed is self._was_subscribed:
            return
        bank.simple_is_known, self._was_subscribed = True, is_subscribed
        for gpio, port in self._ports:
            port.simple = 0 if is_subscribed else gpio.simple_outputs()


def share_registers(chip: NativePorts, parts: Iterable[Peripheral], rcc: Rcc) -> SharedStreams | None:
    """Hand the registers of a chip to its engine, if it is a native one; return what it has of its USARTs."""
    from bluepill_sim.native.engine import NativeEngine

    engine = chip.engine
    if not isinstance(engine, NativeEngine):
        return None
    parts = tuple(parts)
    streams = SharedStreams(chip, engine, [part for part in parts if isinstance(part, Usart)])
    ports = SharedPorts(engine, chip.pins, chip.irq_listeners, streams, chip.ns_of)
    state, calls = engine.state, library()
    calls.core_set_paged_region(state, engine.region_at(PERIPHERAL_BASE))
    for part in parts:
        count = len(part.REGISTERS) and max(register.offset for register in part.REGISTERS) // 4 + 1
        behaviour = (ctypes.c_uint8 * count)()
        masks = (ctypes.c_uint32 * (4 * count))()
        for register in part.REGISTERS:
            index = register.offset // 4
            behaviour[index] = _READS_PLAIN * (register.on_read is None) | _WRITES_PLAIN * (register.on_write is None)
            if isinstance(part, Usart) and register.name == "DR":
                behaviour[index] |= _USART_DATA
            if register.latched_in is not None:
                behaviour[index] |= register.latched_in // 4 << _LATCH_SHIFT
            masks[4 * index : 4 * index + 4] = list(part.masks_of(index))
        number = -1
        if isinstance(part, Gpio):
            number = ord(part.name[-1]) - ord("A")
            ports.add(part, _Port.from_address(calls.core_port(state, number)))
        gate = CLOCK_GATES.get(part.name)
        at, mask = rcc.gate_address(part.name) if gate is not None else (None, 0)
        words, _ = part.words.buffer_info()
        engine.keep(behaviour, masks)
        page = part.base - PERIPHERAL_BASE >> _PAGE_SHIFT
        calls.core_set_page(state, page, words, count, at, mask, behaviour, masks, number, (*part.place.irqs, 0)[0])
    engine.before_access = ports.take_over
    engine.before_run = ports.mark
    return streams
