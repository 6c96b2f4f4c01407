"""The pins of the chip: where its parts and the outside world meet.

A pin has one driver inside (GPIO, an alternate function, or the debug port)
and one outside. What is not modelled: volts, currents, slew rates, and the
two clocks of the input synchroniser.

Source: RM0008 sections 9.1 and 9.3.5.
Invariant: `output` and `level` follow from the other attributes alone; every
change of `output` is told to `PinBank.on_output` once, with its exact time.
"""

from collections.abc import Callable, Iterator
from enum import Enum
from typing import Protocol, TypeAlias

#: Level of the outside driver, mode, ODR bit, holder (owner, drive), connections, watched.
PinSnapshot: TypeAlias = tuple[
    bool | None, str, bool, tuple[str, str] | None, tuple[tuple[str, bool], ...], bool, str, bool
]


class PinDrive(Enum):
    """What the chip itself puts on a wire."""

    #: Nothing: the chip listens, or has the pin in analog mode.
    NONE = "none"
    #: Strong 0.
    LOW = "low"
    #: Strong 1.
    HIGH = "high"
    #: Weak 1 (about 40 kΩ).
    PULL_UP = "pull-up"
    #: Weak 0 (about 40 kΩ).
    PULL_DOWN = "pull-down"


class PinMode(Enum):
    """What GPIOx_CRL/CRH make of a pin."""

    #: Schmitt trigger off: reads 0.
    ANALOG = "analog"
    FLOATING = "floating input"
    #: Input with the pull that the ODR bit chooses.
    PULLED = "pulled input"
    PUSH_PULL = "output"
    OPEN_DRAIN = "open-drain output"
    ALTERNATE_PUSH_PULL = "alternate function"
    ALTERNATE_OPEN_DRAIN = "open-drain alternate function"


ALTERNATE_MODES = frozenset({PinMode.ALTERNATE_PUSH_PULL, PinMode.ALTERNATE_OPEN_DRAIN})
OPEN_DRAIN_MODES = frozenset({PinMode.OPEN_DRAIN, PinMode.ALTERNATE_OPEN_DRAIN})
INPUT_MODES = frozenset({PinMode.FLOATING, PinMode.PULLED})

_WEAK_LEVELS = {PinDrive.PULL_UP: True, PinDrive.PULL_DOWN: False}
_STRONG_LEVELS = {PinDrive.HIGH: True, PinDrive.LOW: False}


class PinPorts(Protocol):
    """What the pins need of the chip."""

    @property
    def now_ns(self) -> int:
        """The exact time of what is happening now."""
        ...

    def request_stop(self) -> None:
        """End the CPU's slice at the border of the running block."""
        ...


class Pin:
    """One pin of one port, seen from outside (`drive`, `level`, `output`, `watch`) and from inside."""

    def __init__(self, bank: "PinBank", port: str, number: int, *, is_bonded: bool) -> None:
        self._bank = bank
        self.port = port
        self.number = number
        self.name = f"P{port}{number}"
        #: Whether the package has a leg for it.
        self.is_bonded = is_bonded
        #: What the board hangs on the pin: PULL_UP, PULL_DOWN or NONE.
        self.board_pull = PinDrive.NONE
        #: What the chip itself puts on the wire.
        self.output = PinDrive.NONE
        #: The logic level on the wire; a floating wire is taken as low.
        self.level = False
        #: What the digital input sees: `level`, or False while the Schmitt trigger is off or the pin is held.
        self.input = False
        #: Whether a change of `output` ends the CPU's slice.
        self.is_watched = False
        #: Called at every change of `input`, in the order of subscription (GPIO's IDR, EXTI).
        self.listeners: list[Callable[[Pin], None]] = []
        self._outside: bool | None = None
        self._mode = PinMode.FLOATING
        self._output_bit = False
        self._holder: tuple[str, PinDrive] | None = None
        self._sources: dict[str, bool] = {}

    # From outside the chip.

    def drive(self, level: bool | None) -> None:
        """Put a level on the wire from outside; None lets go.

        Raises:
            ValueError: The package has no leg for this pin.
        """
        if not self.is_bonded:
            raise ValueError(f"{self.name} is not bonded out on this package")
        if level is not self._outside:
            self._outside = level
            self._resolve()

    def watch(self, on: bool = True) -> None:
        """Choose whether a change of the chip's own drive ends the CPU's slice."""
        self.is_watched = on

    @property
    def driven(self) -> bool | None:
        """What the outside world puts on the wire; None is nothing."""
        return self._outside

    @property
    def is_floating(self) -> bool:
        """Whether nobody drives or pulls the wire."""
        return self.output is PinDrive.NONE and self._outside is None and self.board_pull is PinDrive.NONE

    @property
    def is_contended(self) -> bool:
        """Whether chip and outside world drive the wire to different levels."""
        own = _STRONG_LEVELS.get(self.output)
        return own is not None and self._outside is not None and own is not self._outside

    # From inside the chip.

    @property
    def mode(self) -> PinMode:
        """What GPIO has configured, whether or not GPIO has the pin now."""
        return self._mode

    @property
    def holder(self) -> str | None:
        """Who keeps GPIO off the pin, such as "JTDO"; None for nobody."""
        return None if self._holder is None else self._holder[0]

    def configure(self, mode: PinMode, output_bit: bool) -> None:
        """Set mode and ODR bit (called by GPIO)."""
        self._mode = mode
        self._output_bit = output_bit
        self._update()

    def set_output_bit(self, output_bit: bool) -> None:
        """Set the ODR bit (called by GPIO)."""
        self._output_bit = output_bit
        self._update()

    def hold(self, owner: str, drive: PinDrive = PinDrive.NONE) -> None:
        """Take the pin from GPIO for a fixed function, such as the debug port."""
        self._holder = (owner, drive)
        self._update()

    def release(self) -> None:
        """Give the pin back to GPIO."""
        self._holder = None
        self._update()

    def connect(self, source: str, level: bool) -> None:
        """Offer `level` as the alternate function `source`; the latest call of each source counts."""
        self._sources[source] = level
        self._update()

    def disconnect(self, source: str) -> None:
        """Take the alternate function `source` off the pin."""
        if self._sources.pop(source, None) is not None:
            self._update()

    def carries(self, source: str) -> bool:
        """Whether the wire shows the alternate function `source`."""
        return (
            self._mode in ALTERNATE_MODES
            and self._holder is None
            and self.is_bonded
            and next(iter(sorted(self._sources)), None) == source
        )

    def is_listening(self) -> bool:
        """Whether an alternate function can receive from this pin: an input that nobody holds."""
        return self._holder is None and self.is_bonded and self._mode in INPUT_MODES | ALTERNATE_MODES

    def snapshot(self) -> PinSnapshot:
        """Return all that decides this pin's future, as plain values."""
        holder = None if self._holder is None else (self._holder[0], self._holder[1].value)
        return (
            self._outside,
            self._mode.value,
            self._output_bit,
            holder,
            tuple(self._sources.items()),
            self.is_watched,
            self.output.value,
            self.level,
        )

    def restore(self, snapshot: PinSnapshot) -> None:
        """Put back what `snapshot` returned; tells nobody."""
        self._outside, mode, self._output_bit, holder, sources, self.is_watched, output, self.level = snapshot
        self._mode = PinMode(mode)
        self._holder = None if holder is None else (holder[0], PinDrive(holder[1]))
        self._sources = dict(sources)
        self.output = PinDrive(output)
        self.input = self._input()

    def _own_drive(self) -> PinDrive:
        """Return what the chip puts on the wire, by RM0008 table 20."""
        if self._holder is not None:
            return self._holder[1]
        mode = self._mode
        if mode in ALTERNATE_MODES:
            # Two functions on one pin are unspecified; chosen: the first by name drives. None active: nothing drives.
            if not self._sources:
                return PinDrive.NONE
            bit = self._sources[min(self._sources)]
        else:
            bit = self._output_bit
        if mode is PinMode.PULLED:
            return PinDrive.PULL_UP if bit else PinDrive.PULL_DOWN
        if mode is PinMode.ANALOG or mode is PinMode.FLOATING:
            return PinDrive.NONE
        if bit:
            return PinDrive.NONE if mode in OPEN_DRAIN_MODES else PinDrive.HIGH
        return PinDrive.LOW

    def _update(self) -> None:
        output = self._own_drive()
        if output is not self.output:
            self.output = output
            self._bank.output_changed(self)
        self._resolve()

    def _resolve(self) -> None:
        """Bring `level` and `input` up to date and tell the listeners of a change of the input."""
        own = _STRONG_LEVELS.get(self.output)
        outside = self._outside
        if own is not None:
            # Chosen: of two strong drivers that differ the low one wins.
            level = own if outside is None else own and outside
        elif outside is not None:
            level = outside
        else:
            # A weak pull of the chip is stronger than the board's (40 kΩ against an LED or 100 kΩ).
            level = _WEAK_LEVELS.get(self.output, _WEAK_LEVELS.get(self.board_pull, False))
        self.level = level
        seen = self._input()
        if seen is not self.input:
            self.input = seen
            for listener in self.listeners:
                listener(self)

    def _input(self) -> bool:
        return self.level and self._mode is not PinMode.ANALOG and self._holder is None


class PinBank:
    """All pins of the chip, and the switches between them and its peripherals."""

    PORTS = "ABCDE"

    def __init__(self, ports: PinPorts, bonded: frozenset[str]) -> None:
        """Make the pins.

        Args:
            ports: The chip.
            bonded: Names of the pins that the package has legs for, such as "PA4".
        """
        self._ports = ports
        self._pins = {
            port: tuple(Pin(self, port, n, is_bonded=f"P{port}{n}" in bonded) for n in range(16)) for port in self.PORTS
        }
        self._by_name = {pin.name: pin for pins in self._pins.values() for pin in pins}
        #: Called with (pin name, drive, time in ns) at every change of the chip's own drive.
        self.on_output: Callable[[str, PinDrive, int], None] | None = None
        #: Called when AFIO has changed `remaps` or `exti_ports`.
        self.route_listeners: list[Callable[[], None]] = []
        #: AFIO_MAPR by function, such as {"USART1": 1}; a function that is missing is not remapped.
        self.remaps: dict[str, int] = {}
        #: The port that feeds each EXTI line 0 to 15 (AFIO_EXTICR).
        self.exti_ports: list[str] = ["A"] * 16

    def __getitem__(self, name: str) -> Pin:
        """Return the pin `name`, such as "PC13".

        Raises:
            KeyError: The chip has no such pin.
        """
        return self._by_name[name]

    def __iter__(self) -> Iterator[Pin]:
        """Iterate over the pins in the order of the ports."""
        return iter(self._by_name.values())

    def port(self, letter: str) -> tuple[Pin, ...]:
        """Return the 16 pins of a port, bonded or not."""
        return self._pins[letter]

    def route_changed(self) -> None:
        """Tell the listeners that AFIO has changed `remaps` or `exti_ports`."""
        for listener in self.route_listeners:
            listener()

    def output_changed(self, pin: Pin) -> None:
        """Pass on a change of a pin's own drive (called by the pin)."""
        if self.on_output is not None:
            self.on_output(pin.name, pin.output, self._ports.now_ns)
        if pin.is_watched:
            self._ports.request_stop()

    def snapshot(self) -> tuple[tuple[PinSnapshot, ...], tuple[tuple[str, int], ...], tuple[str, ...]]:
        """Return all that decides the pins' future, as plain values."""
        return tuple(p.snapshot() for p in self), tuple(self.remaps.items()), tuple(self.exti_ports)

    def restore(self, snapshot: tuple[tuple[PinSnapshot, ...], tuple[tuple[str, int], ...], tuple[str, ...]]) -> None:
        """Put back what `snapshot` returned; tells nobody."""
        pins, remaps, exti_ports = snapshot
        for pin, state in zip(self, pins, strict=True):
            pin.restore(state)
        self.remaps = dict(remaps)
        self.exti_ports = list(exti_ports)
