"""The pins of the chip: where its parts and the outside world meet.

A pin has one driver inside (GPIO, an alternate function, or the debug port)
and one outside. The pins know levels, not currents; what is electrically wrong
(drivers against each other, shorts, overvoltage, inputs that float) is a
warning, once a pin, with the program's place.

Not modelled: volts, currents through clamp diodes, the total current of the
supply pins, slew rates, and the two clocks of the input synchroniser.

Source: RM0008 sections 9.1 (table 20) and 9.3.5; data sheet DS5319 tables 5 and
6 (pin definitions, absolute maximum ratings).
The levels themselves are worked out in C, a port at a time (`extension/source/fabric/pins.c`).
Invariant: `output` and `level` follow from the other attributes alone.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import Enum
from operator import itemgetter
from typing import Any, Self

from bluepill_sim.fabric.fabric import NO_LEVEL, Fabric, FabricPorts
from bluepill_sim.fabric.signals import UV_PER_V, Signal, put_signal, to_uv
from bluepill_sim.fabric.subscriptions import EDGE, EdgeSink, Of, Wave
from simbase.state import Stateful
from simbase.timing import Nanos


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


#: What a wire can be shorted to, and the level that it then has.
RAILS = {"GND": False, "3V3": True}
#: An input that is not 5 V-tolerant bears VDD + 0.3 V (DS5319 table 6); chosen: what counts as more than that.
MAX_VOLTS = 3.65


#: Alternate functions that drive pins; where two offer a level on one pin, which is unspecified, the first drives.
ALTERNATE_FUNCTIONS = tuple(
    sorted(
        ["CAN_TX", "MCO", "EVENTOUT", "I2C1_SCL", "I2C1_SDA", "I2C2_SCL", "I2C2_SDA", "I2C1_SMBA", "I2C2_SMBA"]
        + [f"SPI{n}_{signal}" for n in (1, 2) for signal in ("MISO", "MOSI", "NSS", "SCK")]
        + [f"TIM{n}_CH{channel}" for n in (1, 2, 3, 4) for channel in (1, 2, 3, 4)]
        + [f"TIM1_CH{channel}N" for channel in (1, 2, 3)]
        + [f"USART{n}_{signal}" for n in (1, 2, 3) for signal in ("TX", "RX", "CK", "RTS")]
    )
)


class Pin:
    """One pin of one port, seen from outside (`drive`, `level`, `output`) and from inside."""

    def __init__(
        self, bank: "PinBank", port: str, number: int, *, is_bonded: bool, is_five_volt_tolerant: bool = False
    ) -> None:
        self._bank = bank
        self._port_index = bank.PORTS.index(port)
        self._struct: Any = bank.fabric.port_structs[self._port_index]
        self._bit = 1 << number
        self.port = port
        self.number = number
        #: Its number among all pins, as rows of subscriptions have it.
        self.index = 16 * self._port_index + number
        self.name = f"P{port}{number}"
        #: Whether the package has a leg for it.
        self.is_bonded = is_bonded
        #: Whether it bears 5 V as an input without a pull (DS5319 table 5, "FT").
        self.is_five_volt_tolerant = is_five_volt_tolerant
        self._channel = _channel_of(self)

    # From outside the chip.

    def drive(self, level: bool | int | None, *, volts: float | None = None, is_weak: bool = False) -> None:
        """Put a level (False, True, or 0, 1) on the wire from outside; None lets go.

        Args:
            level: What the other end drives.
            volts: How high a 1 is; None is 3.3 V. More than the pin bears is warned of.
            is_weak: Whether a resistor does it: stronger than the chip's own pulls of 40 kΩ, weaker than its outputs.

        Raises:
            ValueError: The package has no leg for this pin.
        """
        if not self.is_bonded:
            raise ValueError(f"{self.name} is not bonded out on this package")
        complaint = overvoltage(self, volts) if volts is not None and level else None
        if complaint is not None:
            self._bank.warn(complaint, once=f"{self.name}:volts")
        before = self.driven
        is_driven = level is not None
        self._change(outside=is_driven, outside_high=bool(level), outside_weak=is_driven and is_weak)
        if before is not None and not is_driven:
            for listener in self._bank.release_listeners:
                listener(self)

    def drive_later(self, levels: Iterable[tuple[Nanos, int]], *, is_weak: bool = False) -> None:
        """Put levels on the wire from outside at times to come, without anybody stopping the chip there.

        Args:
            levels: (ns, level), in any order; what is past comes now. What `drive` does meanwhile holds until then.
            is_weak: As for `drive`.

        Raises:
            ValueError: The package has no leg for this pin, or more than 1024 levels of all pins would be to come.
        """
        if not self.is_bonded:
            raise ValueError(f"{self.name} is not bonded out on this package")
        index, drives = self.index, _LATER[is_weak]
        rows = [EDGE.pack(at, index, drives[level], 0, 0, 0) for at, level in sorted(levels, key=itemgetter(0))]
        self._bank.fabric.put_inputs(b"".join(rows))

    def set_volts(self, volts: "float | Signal | None") -> None:
        """Put volts on the wire from outside, for an ADC to sample; None takes them off.

        They stand until they are set again, whatever `drive` does. A digital input reads a constant, as high from
        half of VDDA on, and nothing of a signal.

        Args:
            volts: A constant in volts, above -1000 and below 1000, or a `Signal` from now on; on a pin that leads
                to no ADC a constant alone.

        Raises:
            ValueError: The package has no leg for this pin, or it is nothing that a pin can have.
        """
        constant = None if volts is None or isinstance(volts, Signal) else to_uv(volts)
        channel = self._channel
        if isinstance(volts, Signal) and (channel is None or not self.is_bonded):
            raise ValueError(f"{self.name} leads to no ADC")
        fabric = self._bank.fabric
        level = None if constant is None else 2 * constant >= fabric.analog_struct.vdda_uv
        most = volts.most_v if isinstance(volts, Signal) else volts
        if most is not None and (complaint := overvoltage(self, most)) is not None:
            self._bank.warn(complaint, once=f"{self.name}:volts")
        self.drive(level)
        if channel is not None:
            fabric.inputs_change()
            put_signal(fabric, channel, volts if isinstance(volts, Signal) else constant, self._bank.now_ns)

    @property
    def has_volts(self) -> bool:
        """Whether `set_volts` has put something on the wire."""
        channel = self._channel
        return channel is not None and self._bank.fabric.analog_struct.signals[channel].shape != 0

    @property
    def volts(self) -> float | None:
        """The volts on the wire now; None of a pin that leads to no ADC. What floats has 0 V."""
        channel = self._channel
        return None if channel is None else self._bank.fabric.channel_uv(channel, self._bank.now_ns) / UV_PER_V

    def short(self, rail: str | None) -> None:
        """Tie the wire to a supply rail, as a solder bridge does; None cuts it again.

        Args:
            rail: "GND" or "3V3".

        Raises:
            ValueError: There is no such rail.
        """
        if rail is not None and rail not in RAILS:
            raise ValueError(f"no such rail: {rail!r}; a wire can be shorted to {' or '.join(RAILS)}")
        self._change(rail=rail is not None, rail_high=rail is not None and RAILS[rail])

    @property
    def board_pull(self) -> PinDrive:
        """What the board hangs on the pin: PULL_UP, PULL_DOWN or NONE."""
        return _first(self._has("board_up"), PinDrive.PULL_UP, self._has("board_down"), PinDrive.PULL_DOWN)

    @board_pull.setter
    def board_pull(self, pull: PinDrive) -> None:
        self._change(board_up=pull is PinDrive.PULL_UP, board_down=pull is PinDrive.PULL_DOWN)

    @property
    def driven(self) -> bool | None:
        """What the outside world puts on the wire; None is nothing."""
        return self._has("outside_high") if self._has("outside") else None

    @property
    def output(self) -> PinDrive:
        """What the chip itself puts on the wire."""
        return next((drive for name, drive in _DRIVEN.items() if self._has(name)), PinDrive.NONE)

    @property
    def level(self) -> bool:
        """The logic level on the wire; a floating wire is taken as low."""
        return self._has("level")

    @property
    def input(self) -> bool:
        """What the digital input sees: `level`, or False while the Schmitt trigger is off or the pin is held."""
        return self._has("input")

    @property
    def is_floating(self) -> bool:
        """Whether nobody drives or pulls the wire."""
        return self._has("floating")

    @property
    def is_contended(self) -> bool:
        """Whether chip and outside world drive the wire to different levels."""
        return self._has("fighting") or self._has("shorted")

    @property
    def rail(self) -> str | None:
        """The supply rail that the wire is shorted to."""
        return (
            next(name for name, level in RAILS.items() if level is self._has("rail_high"))
            if self._has("rail")
            else None
        )

    @property
    def function(self) -> str | None:
        """The alternate function that the wire shows, such as "USART1_TX"; None for none."""
        sources = self._struct.sources[self.number]
        source = ALTERNATE_FUNCTIONS[(sources & -sources).bit_length() - 1] if sources else ""
        return source if self.carries(source) else None

    # From inside the chip.

    @property
    def mode(self) -> PinMode:
        """What GPIO has configured, whether or not GPIO has the pin now."""
        mode: int = self._struct.modes[self.number]
        return _MODES[mode]

    @property
    def holder(self) -> str | None:
        """What keeps GPIO off the pin, such as "JTDO"; None for nothing."""
        return self._bank.holders.get(self.name)

    def configure(self, mode: PinMode, output_bit: bool) -> None:
        """Set mode and ODR bit, as GPIO does."""
        self._bank.fabric.configure_pin(self.index, _MODES.index(mode), output_bit)

    def hold(self, owner: str, drive: PinDrive = PinDrive.NONE) -> None:
        """Take the pin from GPIO for a fixed function, such as the debug port."""
        self._bank.holders[self.name] = owner
        self._change(held=True, **{f"hold_{name}": drive is of for name, of in _DRIVEN.items()})

    def release(self) -> None:
        """Give the pin back to GPIO."""
        self._bank.holders.pop(self.name, None)
        self._change(held=False, **{f"hold_{name}": False for name in _DRIVEN})

    def connect(self, source: str, level: bool) -> None:
        """Offer `level` as the alternate function `source`; the latest call of each source counts."""
        self._bank.fabric.offer(self.index, ALTERNATE_FUNCTIONS.index(source), int(level))

    def offer_wave(self, source: str, frequency_hz: int, period: int, high: int, position: int = 0) -> None:
        """Offer a wave as the alternate function `source`, in place of what it offered before.

        Args:
            source: its name.
            frequency_hz: ticks a second: the clock of who makes it.
            period: ticks from one rising edge to the next; it is a constant level unless 0 < `high` < `period`.
            high: ticks at level 1.
            position: ticks since the last rising edge, now.
        """
        number = ALTERNATE_FUNCTIONS.index(source)
        self._bank.fabric.set_wave(self.index, number, frequency_hz, period, high, position)

    @property
    def wave(self) -> Wave | None:
        """The wave that the chip puts on the wire now; None for none."""
        if not self._struct.shown & self._bit:
            return None
        sources = self._struct.sources[self.number]
        wave = self._bank.fabric.wave_structs[(sources & -sources).bit_length() - 1]
        return Wave(wave.ns, wave.at, wave.period, wave.high, wave.hz)

    def disconnect(self, source: str) -> None:
        """Take the alternate function `source` off the pin, level or wave."""
        self._bank.fabric.offer(self.index, ALTERNATE_FUNCTIONS.index(source), NO_LEVEL)

    def hold_low(self, is_held: bool) -> None:
        """Have a part on a bus hold the wire low, or let it go: for the show, whoever else drives it."""
        self._change(bus_low=is_held)

    @property
    def is_watched(self) -> bool:
        """Whether somebody is subscribed to it."""
        return self._bank.fabric.is_watched(self.index)

    def carries(self, source: str) -> bool:
        """Whether the wire shows the alternate function `source`."""
        sources = self._struct.sources[self.number]
        is_first = bool(sources) and ALTERNATE_FUNCTIONS[(sources & -sources).bit_length() - 1] == source
        return is_first and self._has("alternate") and not self._has("held") and self.is_bonded

    def _has(self, name: str) -> bool:
        struct = self._struct if not self._struct.shown & self._bit else self._bank.fabric.look(self._port_index)
        return bool(getattr(struct, name) & self._bit)

    def _change(self, **flags: bool) -> None:
        """Set the pin's bits in masks of its port, and have known which follow; nothing where they are so already."""
        struct, bit, fabric = self._struct, self._bit, self._bank.fabric
        others = [name for name, wanted in flags.items() if bool(getattr(struct, name) & bit) is not wanted]
        if not others:
            return
        if struct.analog & bit:
            fabric.inputs_change()
        for name in others:
            setattr(struct, name, getattr(struct, name) ^ bit)
        fabric.pins_changed(self._port_index)


class PinBank(Stateful):
    """All pins of the chip, and the switches between them and its peripherals."""

    STATE = ("fabric", "holders", "remaps", "exti_ports")
    #: Who listens.
    DERIVED = ("_subscriptions",)

    PORTS = "ABCDE"

    def __init__(
        self, ports: FabricPorts, bonded: frozenset[str], five_volt_tolerant: frozenset[str] = frozenset()
    ) -> None:
        """Make the pins.

        Args:
            ports: The chip.
            bonded: Names of the pins that the package has legs for, such as "PA4".
            five_volt_tolerant: Names of those that bear 5 V.
        """
        self._ports = ports
        #: Queue, lines and devices, which stand at the pins.
        self.fabric = Fabric(ports)
        self.fabric.electrical = self._warn_of
        #: What keeps GPIO off a pin, by the pin's name.
        self.holders: dict[str, str] = {}
        self._pins = {
            port: tuple(self._make(port, n, bonded, five_volt_tolerant) for n in range(16)) for port in self.PORTS
        }
        self._by_name = {pin.name: pin for pins in self._pins.values() for pin in pins}
        floating = _MODES.index(PinMode.FLOATING)
        for port, pins in enumerate(self._pins.values()):
            struct = self.fabric.port_structs[port]
            struct.modes[:] = [floating] * len(pins)
            struct.bonded = sum(1 << pin.number for pin in pins if pin.is_bonded)
            self.fabric.pins_changed(port)
        self._subscriptions: list[Subscription] = []
        #: Called when AFIO has changed `remaps` or `exti_ports`.
        self.route_listeners: list[Callable[[], None]] = []
        #: AFIO_MAPR by function, such as {"USART1": 1}; a function that is missing is not remapped.
        self.remaps: dict[str, int] = {}
        #: Called with each pin that the outside lets go.
        self.release_listeners: list[Callable[[Pin], None]] = []
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

    def route_changed(self) -> None:
        """Notify the listeners that AFIO has changed `remaps` or `exti_ports`."""
        for listener in self.route_listeners:
            listener()

    def subscribe_pins(
        self, pins: Iterable[str], sink: EdgeSink, *, of: Of = Of.DRIVE, ends_slice: Iterable[str] = (),
        lines: Iterable[int] = (), waves: bool = False,
    ) -> "Subscription":  # fmt: skip
        """Have `sink` called with each change of these pins, and of lines by their numbers, from now on.

        With `waves` it gets waves as they are (`read_rows`), else their edges.

        Raises:
            KeyError: The chip has no such pin.
        """
        subscription = Subscription(self, tuple(pins), sink, of, frozenset(ends_slice), lines, waves=waves)
        self._subscriptions.append(subscription)
        return subscription

    def deliver(self) -> None:
        """Hand every sink what waits for it."""
        for subscription in self._subscriptions:
            subscription.deliver()

    def masks(self, names: Iterable[str]) -> list[int]:
        """Return pins as masks, one a port.

        Raises:
            KeyError: The chip has no such pin.
        """
        masks = [0] * len(self.PORTS)
        for name in names:
            masks[self.PORTS.index(self[name].port)] |= 1 << self[name].number
        return masks

    @property
    def now_ns(self) -> int:
        """The time of what is happening now."""
        return self._ports.now_ns

    def warn(self, message: str, *, once: str) -> None:
        """Warn of something electrical."""
        self._ports.warn(message, once=once)

    def _end(self, subscription: "Subscription") -> None:
        self._subscriptions.remove(subscription)

    def _warn_of(self, index: int, what: int) -> None:
        pin = self._pins[self.PORTS[index // 16]][index % 16]
        if what:
            self.warn(short_circuit(pin), once=f"{pin.name}:short")
        else:
            self.warn(contention(pin), once=f"{pin.name}:contention")

    def _make(self, port: str, number: int, bonded: frozenset[str], tolerant: frozenset[str]) -> Pin:
        name = f"P{port}{number}"
        return Pin(self, port, number, is_bonded=name in bonded, is_five_volt_tolerant=name in tolerant)


class Subscription:
    """One subscriber's pins; see `fabric/subscriptions.py`."""

    def __init__(
        self, bank: PinBank, pins: tuple[str, ...], sink: EdgeSink, of: Of, ends_slice: frozenset[str],
        lines: Iterable[int], *, waves: bool,
    ) -> None:  # fmt: skip
        self._bank, self._sink = bank, sink
        masks, none = bank.masks(pins), bank.masks(())
        self._ends_slice = ends_slice
        drive, wire = (masks, none) if of is Of.DRIVE else (none, masks)
        self._number = bank.fabric.subscribe(drive, wire, bank.masks(ends_slice), lines, waves=waves)

    @property
    def ends_slice(self) -> frozenset[str]:
        """Names of the pins whose edges end the chip's slice; set it whenever the chip does not run."""
        return self._ends_slice

    @ends_slice.setter
    def ends_slice(self, names: frozenset[str]) -> None:
        if names != self._ends_slice:
            self._ends_slice = names
            self._bank.fabric.stop_at(self._number, self._bank.masks(names))

    def deliver(self) -> None:
        """Hand the sink what waits for it."""
        rows = self._bank.fabric.take_rows(self._number)
        if rows:
            self._sink(rows)

    def close(self) -> None:
        """Deliver what waits, and get nothing more."""
        self.deliver()
        self._bank._end(self)  # noqa: SLF001 - its own bank
        self._bank.fabric.unsubscribe(self._number)


def _channel_of(pin: Pin) -> int | None:
    """Return the ADC channel that a pin leads to: PA0 to PA7, PB0 and PB1 are 0 to 9 (DS5319 table 5)."""
    first, count = {"A": (0, 8), "B": (8, 2)}.get(pin.port, (0, 0))
    return first + pin.number if pin.number < count else None


#: The masks of a port that say what the chip drives.
_DRIVEN = {"low": PinDrive.LOW, "high": PinDrive.HIGH, "up": PinDrive.PULL_UP, "down": PinDrive.PULL_DOWN}
_MODES = tuple(PinMode)
#: Hard and by a resistor, the indices of a low and a high level in `PinDrive`.
_LATER = tuple(
    [list(PinDrive).index(drive) for drive in pair]
    for pair in ((PinDrive.LOW, PinDrive.HIGH), (PinDrive.PULL_DOWN, PinDrive.PULL_UP))
)


def _first(one: bool, then: PinDrive, other: bool, otherwise: PinDrive) -> PinDrive:
    return then if one else otherwise if other else PinDrive.NONE


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


def short_circuit(pin: "Pin") -> str:
    """Return the warning of an output that drives against a supply rail."""
    return f"{pin.name}: output {pin.output.value} is shorted to {pin.rail}"
