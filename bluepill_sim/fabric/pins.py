"""The pins of the chip: where its parts and the outside world meet.

A pin has one driver inside (GPIO, an alternate function, or the debug port)
and one outside. The pins know levels, not currents; what is electrically wrong
(drivers against each other, shorts, overvoltage, inputs that float) is a
warning, once a pin, with the program's place.

Not modelled: volts, currents through clamp diodes, the total current of the
supply pins, slew rates, and the two clocks of the input synchroniser.

Source: RM0008 sections 9.1 (table 20) and 9.3.5; data sheet DS5319 tables 5 and
6 (pin definitions, absolute maximum ratings).
Invariant: `output` and `level` follow from the other attributes alone; every
change of `output` is notified to `PinBank.on_output` once, with its exact time.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol, Self

from bluepill_sim.fabric.subscriptions import EDGE, FLOATING, EdgeSink, Of
from simbase.state import Rows, Stateful
from simbase.wire import are_fighting, level_of


class PinDrive(Enum):
    """What the chip itself puts on a wire."""

    #: The level that it makes when nothing stronger drives; None: none.
    level: bool | None
    #: Whether it is stronger than any pull.
    is_strong: bool

    def __new__(cls, label: str, level: bool | None, is_strong: bool) -> Self:
        """Make a member whose value is its label."""
        member = object.__new__(cls)
        member._value_ = label
        member.level, member.is_strong = level, is_strong
        return member

    #: Nothing: the pin is an input, or in analog mode.
    NONE = "none", None, False
    #: Strong 0.
    LOW = "low", False, True
    #: Strong 1.
    HIGH = "high", True, True
    #: Weak 1 (about 40 kΩ).
    PULL_UP = "pull-up", True, False
    #: Weak 0 (about 40 kΩ).
    PULL_DOWN = "pull-down", False, False


class PinMode(Enum):
    """What GPIOx_CRL/CRH make of a pin."""

    #: What the chip drives for a 0 and for a 1: the ODR bit, or the level of the alternate function.
    drives: tuple[PinDrive, PinDrive]

    def __new__(cls, label: str, low: PinDrive, high: PinDrive) -> Self:
        """Make a member whose value is its label."""
        member = object.__new__(cls)
        member._value_ = label
        member.drives = (low, high)
        return member

    #: Schmitt trigger off: reads 0.
    ANALOG = "analog", PinDrive.NONE, PinDrive.NONE
    FLOATING = "floating input", PinDrive.NONE, PinDrive.NONE
    #: Input with the pull that the ODR bit chooses.
    PULLED = "pulled input", PinDrive.PULL_DOWN, PinDrive.PULL_UP
    PUSH_PULL = "output", PinDrive.LOW, PinDrive.HIGH
    OPEN_DRAIN = "open-drain output", PinDrive.LOW, PinDrive.NONE
    ALTERNATE_PUSH_PULL = "alternate function", PinDrive.LOW, PinDrive.HIGH
    ALTERNATE_OPEN_DRAIN = "open-drain alternate function", PinDrive.LOW, PinDrive.NONE


ALTERNATE_MODES = (PinMode.ALTERNATE_PUSH_PULL, PinMode.ALTERNATE_OPEN_DRAIN)
INPUT_MODES = (PinMode.FLOATING, PinMode.PULLED)

#: What a wire can be shorted to, and the level that it then has.
RAILS = {"GND": False, "3V3": True}
#: An input that is not 5 V-tolerant bears VDD + 0.3 V (DS5319 table 6); chosen: what counts as more than that.
MAX_VOLTS = 3.65


class PinPorts(Protocol):
    """What the pins need of the chip."""

    def warn(self, message: str, *, once: str) -> None:
        """Warn once for each key."""
        ...

    @property
    def now_ns(self) -> int:
        """The exact time of what is happening now."""
        ...

    def request_stop(self) -> None:
        """End the CPU's slice at the boundary of the running block."""
        ...


@dataclass(frozen=True, slots=True)
class Holder:
    """What keeps GPIO off a pin."""

    #: Such as "JTDO".
    name: str
    drive: PinDrive


class Pin(Stateful):
    """One pin of one port, seen from outside (`drive`, `level`, `output`, `watch`) and from inside."""

    STATE = (
        "_outside",
        "_is_weak",
        "_mode",
        "_output_bit",
        "_holder",
        "_sources",
        "is_watched",
        "output",
        "level",
        "_rail",
    )
    DERIVED = ("_drives", "_reads", "input")

    def __init__(
        self, bank: "PinBank", port: str, number: int, *, is_bonded: bool, is_five_volt_tolerant: bool = False
    ) -> None:
        self._bank = bank
        self.port = port
        self.number = number
        self.name = f"P{port}{number}"
        #: Whether the package has a leg for it.
        self.is_bonded = is_bonded
        #: Whether it bears 5 V as an input without a pull (DS5319 table 5, "FT").
        self.is_five_volt_tolerant = is_five_volt_tolerant
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
        #: Whether a resistor drives it, which yields to the chip.
        self._is_weak = False
        self._rail: str | None = None
        self._mode = PinMode.FLOATING
        self._output_bit = False
        self._holder: Holder | None = None
        #: The alternate functions that are offered, with their levels.
        self._sources: frozenset[tuple[str, bool]] = frozenset()
        # What follows from the mode, the holder and the sources, kept at hand because pins change often:
        # the drive for an ODR bit of 0 and of 1, and whether the digital input reads the wire.
        self._drives = PinMode.FLOATING.drives
        self._reads = True

    # From outside the chip.

    def drive(self, level: bool | int | None, *, volts: float | None = None, is_weak: bool = False) -> None:
        """Put a level on the wire from outside; None lets go.

        Args:
            level: 0, 1 or None.
            volts: how high a 1 is, where that is known; more than the pin bears is warned of.
            is_weak: whether a resistor does it: stronger than the chip's own pulls of 40 kΩ, weaker than its outputs.

        Raises:
            ValueError: The package has no leg for this pin.
        """
        if not self.is_bonded:
            raise ValueError(f"{self.name} is not bonded out on this package")
        complaint = overvoltage(self, volts) if volts is not None and level else None
        if complaint is not None:
            self._bank.warn(complaint, once=f"{self.name}:volts")
        outside = None if level is None else bool(level)
        if (outside, is_weak) != (self._outside, self._is_weak):
            self._outside, self._is_weak = outside, is_weak
            self._bank.simple_is_known = False
            self._resolve()
            if outside is None:
                for listener in self._bank.release_listeners:
                    listener(self)

    def short(self, rail: str | None) -> None:
        """Tie the wire to a supply rail, as a solder bridge does; None cuts it again.

        Args:
            rail: "GND" or "3V3".

        Raises:
            ValueError: There is no such rail.
        """
        if rail is not None and rail not in RAILS:
            raise ValueError(f"no such rail: {rail!r}; a wire can be shorted to {' or '.join(RAILS)}")
        self._rail = rail
        self._bank.simple_is_known = False
        self._resolve()

    def watch(self, on: bool = True) -> None:
        """Choose whether a change of the chip's own drive ends the CPU's slice."""
        self.is_watched = on
        self._bank.simple_is_known = False

    @property
    def driven(self) -> bool | None:
        """What the outside world puts on the wire; None is nothing."""
        return self._outside

    @property
    def is_floating(self) -> bool:
        """Whether nobody drives or pulls the wire."""
        is_driven = self._outside is not None or self._rail is not None
        return self.output is PinDrive.NONE and not is_driven and self.board_pull is PinDrive.NONE

    @property
    def is_contended(self) -> bool:
        """Whether chip and outside world drive the wire to different levels."""
        outside = (None if self._is_weak else self._outside) if self._rail is None else RAILS[self._rail]
        return self.output.is_strong and outside is not None and are_fighting((outside, self.output.level))

    @property
    def function(self) -> str | None:
        """The alternate function that the wire shows, such as "USART1_TX"; None for none."""
        source, _ = min(self._sources, default=("", False))
        return source if self.carries(source) else None

    # From inside the chip.

    @property
    def mode(self) -> PinMode:
        """What GPIO has configured, whether or not GPIO has the pin now."""
        return self._mode

    @property
    def holder(self) -> str | None:
        """What keeps GPIO off the pin, such as "JTDO"; None for nothing."""
        return None if self._holder is None else self._holder.name

    def configure(self, mode: PinMode, output_bit: bool) -> None:
        """Set mode and ODR bit (called by GPIO)."""
        self._mode = mode
        self._output_bit = output_bit
        self._update()

    def set_output_bit(self, output_bit: bool) -> None:
        """Set the ODR bit (called by GPIO)."""
        self._output_bit = output_bit
        self._put(self._drives[output_bit])

    def hold(self, owner: str, drive: PinDrive = PinDrive.NONE) -> None:
        """Take the pin from GPIO for a fixed function, such as the debug port."""
        self._holder = Holder(owner, drive)
        self._update()

    def release(self) -> None:
        """Give the pin back to GPIO."""
        self._holder = None
        self._update()

    def connect(self, source: str, level: bool) -> None:
        """Offer `level` as the alternate function `source`; the latest call of each source counts."""
        self._sources = frozenset({*self._others(source), (source, level)})
        self._update()

    def disconnect(self, source: str) -> None:
        """Take the alternate function `source` off the pin."""
        others = self._others(source)
        if others != self._sources:
            self._sources = others
            self._update()

    def _others(self, source: str) -> frozenset[tuple[str, bool]]:
        return frozenset(pair for pair in self._sources if pair[0] != source)

    def carries(self, source: str) -> bool:
        """Whether the wire shows the alternate function `source`."""
        return (
            self._mode in ALTERNATE_MODES
            and self._holder is None
            and self.is_bonded
            and bool(self._sources)
            and min(self._sources)[0] == source
        )

    def is_listening(self) -> bool:
        """Whether an alternate function can receive from this pin: an input that nobody holds."""
        is_input = self._mode in INPUT_MODES or self._mode in ALTERNATE_MODES
        return is_input and self._holder is None and self.is_bonded

    def is_simple(self) -> bool:
        """Whether a change of the ODR bit changes nothing but the level on the wire, and has no listener."""
        bank = self._bank
        return (
            self._drives == PinMode.PUSH_PULL.drives
            and self._mode is PinMode.PUSH_PULL
            and self._outside is None
            and self._rail is None
            and not self.is_watched
            and not bank.edge_lines >> self.number & 1
        )

    def _restored(self) -> None:
        self._derive()
        self.input = self.level and self._reads

    def _derive(self) -> None:
        """Work out `_drives` and `_reads`, by RM0008 table 20."""
        self._bank.simple_is_known, mode = False, self._mode
        self._reads = mode is not PinMode.ANALOG and self._holder is None
        if self._holder is not None:
            # The debug port's inputs have their pulls, and GPIO's input reads what stands there.
            self._reads = self._holder.drive in {PinDrive.PULL_UP, PinDrive.PULL_DOWN}
            self._drives = (self._holder.drive,) * 2
        elif mode not in ALTERNATE_MODES:
            self._drives = mode.drives
        elif self._sources:
            # Two functions on one pin are unspecified; chosen: the first by name drives.
            self._drives = (mode.drives[min(self._sources)[1]],) * 2
        else:
            # "Not specified" (RM0008 9.1.9); chosen: nothing drives.
            self._drives = (PinDrive.NONE,) * 2

    def _update(self) -> None:
        self._derive()
        self._put(self._drives[self._output_bit])

    def _put(self, output: PinDrive) -> None:
        """Put a drive on the wire."""
        if output is not self.output:
            self.output = output
            self._bank.output_changed(self)
        self._resolve()

    def _resolve(self) -> None:
        """Bring `level` and `input` up to date; notify the listeners of a change of the input."""
        output, outside = self.output, self._outside
        level: bool
        if self._rail is not None:
            level = RAILS[self._rail]
            if output.is_strong and output.level is not level:
                self._bank.warn(short_circuit(self, self._rail), once=f"{self.name}:short")
        elif outside is None:
            # A weak pull of the chip is stronger than the board's (40 kΩ against an LED or 100 kΩ).
            level = bool(self.board_pull.level if output.level is None else output.level)
        elif output.is_strong and self._is_weak:
            level = bool(output.level)
        elif output.is_strong:
            drivers = outside, bool(output.level)
            level = bool(level_of(drivers))
            if are_fighting(drivers):
                self._bank.warn(contention(self), once=f"{self.name}:contention")
        else:
            level = outside
        self.level = level
        seen = level and self._reads
        if seen is not self.input:
            self.input = seen
            for listener in self.listeners:
                listener(self)
        if self._bank.wire_listeners or self._bank.subscriptions:
            self._bank.wire_changed(self)


class PinBank(Stateful):
    """All pins of the chip, and the switches between them and its peripherals."""

    STATE = ("_rows", "remaps", "exti_ports", "edge_lines")
    DERIVED = ("simple_is_known",)

    PORTS = "ABCDE"

    def __init__(
        self, ports: PinPorts, bonded: frozenset[str], five_volt_tolerant: frozenset[str] = frozenset()
    ) -> None:
        """Make the pins.

        Args:
            ports: The chip.
            bonded: Names of the pins that the package has legs for, such as "PA4".
            five_volt_tolerant: Names of those that bear 5 V.
        """
        self._ports = ports
        #: EXTI lines on which an edge makes a request, as a mask.
        self.edge_lines = 0
        #: Whether no pin has changed in what `Pin.is_simple` looks at, since it was set.
        self.simple_is_known = False
        #: Called with (pin, time in ns) whenever something on a wire may have changed, for tools.
        self.wire_listeners: list[Callable[[Pin, int], None]] = []
        #: Tools that take changes of simple pins in bulk, where the native core keeps them: called to do so.
        self.bulk_listeners: list[Callable[[], None]] = []
        self._pins = {
            port: tuple(self._make(port, n, bonded, five_volt_tolerant) for n in range(16)) for port in self.PORTS
        }
        self._by_name = {pin.name: pin for pins in self._pins.values() for pin in pins}
        self._rows = Rows(self._by_name.values())
        #: Who wants edges in bulk.
        self.subscriptions: list[Subscription] = []
        #: Called with (pin name, drive, time in ns) at every change of the chip's own drive.
        self.on_output: Callable[[str, PinDrive, int], None] | None = None
        #: Whether anything beyond `on_silent_output` subscribes to each output.
        self.is_subscribed: Callable[[], bool] = lambda: self.on_output is not None
        #: Called with the time in ns of the last output of those that were not notified one by one.
        self.on_silent_output: Callable[[int], None] | None = None
        #: Called when AFIO has changed `remaps` or `exti_ports`.
        self.route_listeners: list[Callable[[], None]] = []
        #: AFIO_MAPR by function, such as {"USART1": 1}; a function that is missing is not remapped.
        self.remaps: dict[str, int] = {}
        #: Called with each pin that the outside lets go.
        self.release_listeners: list[Callable[[Pin], None]] = []
        #: Returns which bits of a register's word the running store means, and where it stands.
        self.written_by: Callable[[int], tuple[int, int]] = lambda _address: (0, 0)
        #: Whether a pin gets characters from a serial port, not levels.
        self.is_serial_input: Callable[[Pin], bool] = lambda _pin: False
        #: The port that feeds each EXTI line 0 to 15 (AFIO_EXTICR); the list stays the same for ever.
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

    def _restored(self) -> None:
        self.simple_is_known = False

    def route_changed(self) -> None:
        """Notify the listeners that AFIO has changed `remaps` or `exti_ports`."""
        for listener in self.route_listeners:
            listener()

    def output_changed(self, pin: Pin) -> None:
        """Pass on a change of a pin's own drive (called by the pin)."""
        if self.on_output is not None:
            self.on_output(pin.name, pin.output, self._ports.now_ns)
        if pin.is_watched:
            self._ports.request_stop()
        for subscription in self.subscriptions:
            if subscription.of is Of.DRIVE:
                subscription.put(pin, self._ports)

    def wire_changed(self, pin: Pin) -> None:
        """Notify the tools that a pin's wire may have changed (called by the pin)."""
        now_ns = self._ports.now_ns
        for listener in self.wire_listeners:
            listener(pin, now_ns)
        for subscription in self.subscriptions:
            if subscription.of is Of.WIRE:
                subscription.put(pin, self._ports)

    def subscribe_pins(
        self, pins: Iterable[str], sink: EdgeSink, *, of: Of = Of.DRIVE, ends_slice: Iterable[str] = ()
    ) -> "Subscription":
        """Have `sink` called with each change of these pins from now on.

        Raises:
            KeyError: The chip has no such pin.
        """
        subscription = Subscription(self, [self._by_name[name] for name in pins], sink, of, frozenset(ends_slice))
        self.subscriptions.append(subscription)
        return subscription

    def deliver(self) -> None:
        """Hand every sink what waits for it."""
        for subscription in self.subscriptions:
            subscription.deliver()

    def warn(self, message: str, *, once: str) -> None:
        """Warn of something electrical."""
        self._ports.warn(message, once=once)

    def _make(self, port: str, number: int, bonded: frozenset[str], tolerant: frozenset[str]) -> Pin:
        name = f"P{port}{number}"
        return Pin(self, port, number, is_bonded=name in bonded, is_five_volt_tolerant=name in tolerant)


class Subscription:
    """One subscriber's pins; see `fabric/subscriptions.py`."""

    def __init__(self, bank: PinBank, pins: Iterable[Pin], sink: EdgeSink, of: Of, ends_slice: frozenset[str]) -> None:
        self._bank = bank
        self._sink = sink
        self._rows = bytearray()
        self.of = of
        self.ends_slice = ends_slice
        self._values = {pin.name: self._value(pin) for pin in pins}

    def put(self, pin: Pin, ports: PinPorts) -> None:
        """Note what a pin is now, where that is another than before."""
        before, now = self._values.get(pin.name), self._value(pin)
        if before is None or before == now:
            return
        self._values[pin.name] = now
        drive, wire = _DRIVES.index(pin.output), FLOATING if pin.is_floating else int(pin.level)
        number = 16 * self._bank.PORTS.index(pin.port) + pin.number
        self._rows += EDGE.pack(ports.now_ns, number, drive, wire, 0, 0)
        if pin.name in self.ends_slice:
            ports.request_stop()

    def deliver(self) -> None:
        """Hand the sink what waits for it."""
        if self._rows:
            rows = bytes(self._rows)
            self._rows.clear()
            self._sink(rows)

    def close(self) -> None:
        """Deliver what waits, and get nothing more."""
        self.deliver()
        self._bank.subscriptions.remove(self)

    def _value(self, pin: Pin) -> int:
        if self.of is Of.DRIVE:
            return _DRIVES.index(pin.output)
        return FLOATING if pin.is_floating else int(pin.level)


_DRIVES = tuple(PinDrive)


def overvoltage(pin: "Pin", volts: float) -> str | None:
    """Return what is wrong with a voltage on a pin; None when the pin tolerates it."""
    if volts <= MAX_VOLTS:
        return None
    if not pin.is_five_volt_tolerant:
        reason = "it bears 3.6 V at most"
    elif pin.output.is_strong:
        reason = "it bears 5 V only as an input"
    elif pin.output.level is not None:
        reason = "it bears 5 V only without its pull"
    else:
        return None
    return f"{volts:g} V on {pin.name}: {reason}"


def contention(pin: "Pin") -> str:
    """Return the warning of two drivers against each other."""
    outside = "high" if pin.driven else "low"
    return f"{pin.name}: two drivers fight: the chip drives it {pin.output.value}, the other end {outside}"


def floating_inputs(names: Sequence[str]) -> str:
    """Return the warning of inputs that are not driven."""
    one = len(names) == 1
    what, they = ("floating input", "it reads") if one else ("floating inputs", "they read")
    return f"{', '.join(names)}: {what} that nobody drives: {they} 0 here and anything on a board; configured"


def short_circuit(pin: "Pin", rail: str) -> str:
    """Return the warning of an output that drives against a supply rail."""
    return f"{pin.name}: output {pin.output.value} is shorted to {rail}"
