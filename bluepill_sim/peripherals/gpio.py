"""GPIOA to GPIOE: port configuration, data registers, the lock.

Modelled: all modes of CRL/CRH, pulls by ODR, open drain, atomic set/reset,
the key sequence of LCKR. Not modelled: output speed, the two APB2 clocks of
the input synchroniser. What reading IDR and writing ODR, BSRR or BRR does is `extension/source/devices/gpio.c`.

A pin that the program configures as a floating input is checked a little
later: it should be driven by then. What a program never configures floats
unnoticed, as does what it configures by writing the reset value over a whole
register: nothing shows whether that pin was intended.

Source: RM0008 sections 9.1 and 9.2.
Invariant: bit n of IDR reads as `pins[n].input`.
"""

from collections.abc import Iterable

from bluepill_sim.extension.layout import GPIO
from bluepill_sim.fabric.pins import Pin, PinMode, floating_inputs
from bluepill_sim.fabric.ports import ChipPorts
from bluepill_sim.fabric.registers import NATIVE, Peripheral, Place, Register, bits, numbered

CRL, CRH, IDR, ODR, BSRR, BRR, LCKR = range(7)

_PORT = bits((15, 0))
_LCKK = 1 << 16
#: CNF = 01, MODE = 00 for each pin: floating input.
_CR_RESET = 0x4444_4444
#: CNF[1:0] MODE[1:0] of a pin after reset.
_FLOATING_NIBBLE = 0x4

#: chosen: how long after its configuration a wire may still come, and SWJ_CFG release a pin.
SETTLING_NS = 1_000_000

_INPUT_MODES = (PinMode.ANALOG, PinMode.FLOATING, PinMode.PULLED, PinMode.FLOATING)
_OUTPUT_MODES = (PinMode.PUSH_PULL, PinMode.OPEN_DRAIN, PinMode.ALTERNATE_PUSH_PULL, PinMode.ALTERNATE_OPEN_DRAIN)
#: Mode by CNF[1:0] MODE[1:0] (RM0008 table 20); CNF = 11, MODE = 00 is reserved and taken as floating.
PIN_MODES = tuple((_OUTPUT_MODES if nibble & 3 else _INPUT_MODES)[nibble >> 2] for nibble in range(16))
#: Modes that want nothing of a pin; a system that saves power makes every pin analog.
_IDLE_MODES = (PinMode.ANALOG, PinMode.FLOATING)


#: From the left.
_DOWN = range(15, -1, -1)


def _modes(numbers: Iterable[int]) -> str:
    """Return the fields of CRL or CRH."""
    return ", ".join(
        f"CNF{n} {4 * (n % 8) + 3}:{4 * (n % 8) + 2}, MODE{n} {4 * (n % 8) + 1}:{4 * (n % 8)}" for n in numbers
    )


class Gpio(Peripheral):
    """One general-purpose I/O port; the last letter of its name is the port's."""

    KIND, HOLDS = "gpio", GPIO
    STATE = ("_lock_writes", "_locked", "_intended", "_claimed", "_warned", "_told")
    REGISTERS = (
        Register(name="CRL", offset=0x00, reset=_CR_RESET, on_write="_write_crl", fields=_modes(range(7, -1, -1))),
        Register(name="CRH", offset=0x04, reset=_CR_RESET, on_write="_write_crh", fields=_modes(range(15, 7, -1))),
        Register(name="IDR", offset=0x08, readable=_PORT, writable=0, on_read=NATIVE, fields=numbered("IDRn", _DOWN)),
        Register(
            name="ODR", offset=0x0C, readable=_PORT, writable=_PORT, on_write=NATIVE, fields=numbered("ODRn", _DOWN)
        ),
        Register(name="BSRR", offset=0x10, readable=0, on_write=NATIVE),
        Register(name="BRR", offset=0x14, readable=0, writable=_PORT, on_write=NATIVE),
        Register(
            name="LCKR",
            offset=0x18,
            readable=_LCKK | _PORT,
            writable=0,
            on_read="_read_lckr",
            on_write="_write_lckr",
            fields="LCKK 16, " + numbered("LCKn", _DOWN),
        ),
    )

    def __init__(self, chip: ChipPorts, place: Place) -> None:
        super().__init__(chip, place)
        self._pins = chip.pins.port(place.name[-1])
        #: The last three writes to LCKR.
        self._lock_writes: tuple[int, ...] = ()
        #: Pins whose configuration is frozen until reset.
        self._locked = 0
        #: Pins that the program has made floating inputs on purpose, and where: (number, address of the store).
        self._intended: tuple[tuple[int, int], ...] = ()
        #: Pins that the program has configured while they belong to another, and where.
        self._claimed: tuple[tuple[int, int], ...] = ()
        #: Pins that were warned of as floating.
        self._warned = 0
        #: Pins that were warned of as another's.
        self._told = 0
        chip.pins.release_listeners.append(self._released)
        self.native.port = chip.pins.PORTS.index(place.name[-1])

    def on_reset(self) -> None:
        """Make every pin a floating input and undo the lock."""
        self._lock_writes = ()
        self._locked = 0
        self._intended = self._claimed = ()
        for pin in self._pins:
            pin.configure(PinMode.FLOATING, output_bit=False)

    def _write_crl(self, _written: int, previous: int) -> None:
        self._configure(CRL, 0, previous)

    def _write_crh(self, _written: int, previous: int) -> None:
        self._configure(CRH, 8, previous)

    def _configure(self, register: int, first: int, previous: int) -> None:
        """Bring the eight pins from `first` on into the modes that `register` now asks for."""
        changed = self.words[register] ^ previous
        forced, pc = self.chip.pins.written_by(self.base + 4 * register)
        for position in range(8):
            nibble_mask = 0xF << (4 * position)
            number = first + position
            nibble = self.words[register] >> (4 * position) & 0xF
            if (changed | forced) & nibble_mask:
                self._note_intent(number, pc, is_floating=nibble == _FLOATING_NIBBLE)
            if not changed & nibble_mask:
                continue
            if self._locked >> number & 1:
                self.words[register] ^= changed & nibble_mask
                self.chip.warn(f"P{self.name[-1]}{number}: configured while locked: ignored", once=f"{self.name}:lock")
                continue
            pin = self._pins[number]
            self._claimed = tuple(pair for pair in self._claimed if pair[0] != number)
            if pin.holder is not None and PIN_MODES[nibble] not in _IDLE_MODES:
                self._claimed = (*self._claimed, (number, pc))
                self._check_later()
            pin.configure(PIN_MODES[nibble], bool(self.words[ODR] >> number & 1))

    def _note_intent(self, number: int, pc: int, *, is_floating: bool) -> None:
        """Note whether a pin is intended as a floating input."""
        others = tuple(pair for pair in self._intended if pair[0] != number)
        if is_floating and not self._locked >> number & 1:
            self._intended = (*others, (number, pc))
            self._check_later()
        else:
            self._intended = others

    def _released(self, pin: Pin) -> None:
        """Check again an input that is no longer driven."""
        if pin.port == self.name[-1] and any(number == pin.number for number, _ in self._intended):
            self._check_later()

    def _check_later(self) -> None:
        self.due_ns = self.chip.now_ns + SETTLING_NS

    def advance_to(self, now_ns: int) -> None:
        """Warn of the pins that belong to another still, and of the intended inputs that float."""
        if self.due_ns is None or now_ns < self.due_ns:
            return
        self.due_ns = None
        held = [(self._pins[n], pc) for n, pc in sorted(self._claimed) if not self._told >> n & 1]
        held = [(pin, pc) for pin, pc in held if pin.holder is not None]
        if held:
            self._told |= sum(1 << pin.number for pin, _ in held)
            names = [pin.name for pin, _ in held]
            self.chip.warn(_held_pins([pin for pin, _ in held]), once=f"{' '.join(names)}:held", pc=held[0][1])
        self._claimed = ()
        floating = [(self._pins[n], pc) for n, pc in sorted(self._intended) if not self._warned >> n & 1]
        floating = [(p, pc) for p, pc in floating if _is_lost(p) and not self.chip.pins.is_serial_input(p)]
        if floating:
            self._warned |= sum(1 << pin.number for pin, _ in floating)
            names = [pin.name for pin, _ in floating]
            self.chip.warn(floating_inputs(names), once=f"floating:{' '.join(names)}", pc=floating[0][1])

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
            self._locked = pins
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
