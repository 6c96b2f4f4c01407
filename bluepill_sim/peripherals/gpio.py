"""GPIOA to GPIOE: port configuration, data registers, the lock.

Modelled: all modes of CRL/CRH, pulls by ODR, open drain, atomic set/reset,
the key sequence of LCKR. Not modelled: output speed, the two APB2 clocks of
the input synchroniser. What its registers do, but for the lock, is `extension/source/devices/gpio.c`.

A pin that the program configures as a floating input is checked a little
later: it should be driven by then. What a program never configures floats
unnoticed, as does what it configures by writing the reset value over a whole
register: nothing shows whether that pin was intended (`core/forced_bits.py`).

Source: RM0008 sections 9.1 and 9.2.
Invariant: bit n of IDR reads as `pins[n].input`.
"""

from collections.abc import Iterable
from enum import IntEnum

from bluepill_sim.extension.layout import GPIO
from bluepill_sim.fabric.fabric import OWN_COMMANDS
from bluepill_sim.fabric.pins import Pin, PinMode, floating_inputs
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import (
    NATIVE,
    OWN_ANSWERS,
    Peripheral,
    PeripheralMapping,
    Register,
    bits,
    indices,
    masks,
    numbered,
)

_PORT = bits((15, 0))
#: CNF = 01, MODE = 00 for each pin: floating input.
_CR_RESET = 0x4444_4444

#: From the left.
_DOWN = range(15, -1, -1)
_LCKR = "LCKK 16, " + numbered("LCKn", _DOWN)
(_LCKK,) = masks(_LCKR, "LCKK")


def _modes(numbers: Iterable[int]) -> str:
    """Return the fields of CRL or CRH."""
    return ", ".join(
        f"CNF{n} {4 * (n % 8) + 3}:{4 * (n % 8) + 2}, MODE{n} {4 * (n % 8) + 1}:{4 * (n % 8)}" for n in numbers
    )


class GpioQuestion(IntEnum):
    """What Python is told beside what a listener hears."""

    #: A locked pin was configured.
    LOCKED = OWN_ANSWERS


class GpioCommand(IntEnum):
    """A command of its own."""

    #: Pins are looked at a little later.
    CHECK = OWN_COMMANDS


class Gpio(Peripheral):
    """One general-purpose I/O port; the last letter of its name is the port's."""

    KIND, HOLDS = "gpio", GPIO
    ENUMS = (GpioQuestion, GpioCommand)
    STATE = ("_lock_writes",)
    SOURCE = "RM0008 9.2"
    REGISTERS = (
        Register(name="CRL", offset=0x00, reset=_CR_RESET, on_write=NATIVE, fields=_modes(range(7, -1, -1))),
        Register(name="CRH", offset=0x04, reset=_CR_RESET, on_write=NATIVE, fields=_modes(range(15, 7, -1))),
        Register(name="IDR", offset=0x08, readable=_PORT, writable=0, on_read=NATIVE, fields=numbered("IDRn", _DOWN)),
        Register(name="ODR", offset=0x0C, on_write=NATIVE, fields=numbered("ODRn", _DOWN)),
        Register(
            name="BSRR",
            offset=0x10,
            readable=0,
            on_write=NATIVE,
            fields=f"{numbered('BRn', _DOWN, first=-16)}, {numbered('BSn', _DOWN)}",
        ),
        Register(name="BRR", offset=0x14, readable=0, writable=_PORT, on_write=NATIVE, fields=numbered("BRn", _DOWN)),
        Register(
            name="LCKR",
            offset=0x18,
            readable=_LCKK | _PORT,
            writable=0,
            on_read="_read_lckr",
            on_write="_write_lckr",
            fields=_LCKR,
        ),
    )

    def __init__(self, chip: ChipPorts, place: PeripheralMapping) -> None:
        super().__init__(chip, place)
        self._pins = chip.pins.port(place.name[-1])
        #: The last three writes to LCKR.
        self._lock_writes: tuple[int, ...] = ()
        chip.pins.release_listeners.append(self._released)
        self.native.port, self.native.base = chip.pins.PORTS.index(place.name[-1]), place.base

    def on_reset(self) -> None:
        """Undo the lock."""
        self._lock_writes = ()

    def answer(self, what: int, value: int) -> None:
        """Warn of a locked pin that was configured."""
        del what  # it asks nothing else
        self.chip.warn(f"P{self.name[-1]}{value}: configured while locked: ignored", once=f"{self.name}:lock")

    def _released(self, pin: Pin) -> None:
        """Check again an input that is no longer driven."""
        if pin.port == self.name[-1] and self.native.intended >> pin.number & 1:
            self.command(GpioCommand.CHECK)

    def advance_to(self, now_ns: int) -> None:
        """Warn of the pins that belong to another still, and of the intended inputs that float."""
        if self.due_ns is None or now_ns < self.due_ns:
            return
        self.due_ns = None
        native = self.native
        held = [
            (pin, native.claimed_pc[pin.number])
            for pin in self._of(native.claimed & ~native.reported)
            if pin.holder is not None
        ]
        if held:
            native.reported |= sum(1 << pin.number for pin, _ in held)
            names = [pin.name for pin, _ in held]
            self.chip.warn(_held_pins([pin for pin, _ in held]), once=f"{' '.join(names)}:held", pc=held[0][1])
        native.claimed = 0
        floating = [
            (pin, native.intended_pc[pin.number])
            for pin in self._of(native.intended & ~native.warned)
            if _is_lost(pin) and not self.chip.pins.is_serial_input(pin)
        ]
        if floating:
            native.warned |= sum(1 << pin.number for pin, _ in floating)
            names = [pin.name for pin, _ in floating]
            self.chip.warn(floating_inputs(names), once=f"floating:{' '.join(names)}", pc=floating[0][1])

    def _of(self, mask: int) -> list[Pin]:
        return [pin for pin in self._pins if mask >> pin.number & 1]

    def _write_lckr(self, written: int, _previous: int) -> None:
        if not self.words[LCKR] & _LCKK:
            self.words[LCKR] = written & _PORT
            self._lock_writes = (*self._lock_writes, written & (_LCKK | _PORT))[-3:]

    def _read_lckr(self) -> int:
        """Return LCKR; a read after the three writes reads LCKK as 0 and closes the lock."""
        word = self.words[LCKR]
        pins = word & _PORT
        # The same pins three times, with LCKK = 1, 0, 1 (RM0008 9.2.7).
        if self._lock_writes == (_LCKK | pins, pins, _LCKK | pins) and not word & _LCKK:
            self.native.locked = pins
            self.words[LCKR] |= _LCKK
        return word


def _held_pins(pins: list[Pin]) -> str:
    """Say whose the pins are, in one line."""
    names, holders = (
        ", ".join(dict.fromkeys(map(str, found))) for found in zip(*((p.name, p.holder) for p in pins), strict=True)
    )
    if len(pins) == 1:
        return f"{names} belongs to {holders}: its GPIO configuration has no effect until it is released"
    return f"{names} belong to {holders}: their GPIO configuration has no effect until they are released"


def _is_lost(pin: Pin) -> bool:
    """Tell whether a pin floats as an input of GPIO, on a leg."""
    return pin.is_floating and pin.mode is PinMode.FLOATING and pin.holder is None and pin.is_bonded


(LCKR,) = indices(Gpio.REGISTERS, "LCKR")
