"""Parts that are attached to a board: each gets its pins, its bus and the time.

Theory of operation. A part is a class of anybody's with the methods that it needs, and nothing to derive from. What
hangs on SPI, I2C or CAN is called by its bus, at the end of each byte or frame. What listens to pins gets their
changes in bulk when the chip has run; a pin that is `WATCHED` ends the chip's run at the block that changed it, so
that the part can answer at once. A part with deadlines is brought to each of them: the chip runs no further than the
earliest, to the first block boundary at or after it. What a part puts on a pin at a time to come (`drive_later`) is
exact.

Invariant: what a part does depends on its state and on what came to it with its times, not on the slices in which
the board runs.

"""

from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, Protocol

from bluepill_sim.errors import BluePillError
from bluepill_sim.fabric.can_network import CanNetwork
from bluepill_sim.fabric.pins import Pin, PinBank
from bluepill_sim.fabric.subscriptions import EDGE, HIGH, Of
from bluepill_sim.fabric.surroundings import Nowhere, Surroundings
from bluepill_sim.parts.serial_port import SerialPort
from bluepill_sim.peripherals.can import Can
from bluepill_sim.peripherals.i2c import I2c
from bluepill_sim.peripherals.spi import Spi
from simbase.errors import shown
from simbase.state import Stateful
from simbase.timing import Nanos

#: By which method a part knows a bus.
_METHODS: Mapping[str, str] = {"SPI": "exchange", "I2C": "start", "USART": "sent", "CAN": "join"}
#: A change of a pin: ns, the part's name for it, its level then.
Change = tuple[Nanos, str, bool]
#: Takes what a part does that is worth a line: (ns, part, what, detail).
NoteSink = Callable[[Nanos, str, str, str], None]


class PartError(BluePillError):
    """A part cannot be attached as it was asked for."""

    exit_code = 2


class Use(Enum):
    """What a part does with a pin of its own."""

    #: It is notified of changes, in bulk.
    HEARD = "heard"
    #: It is notified of each change at the end of the block that made it.
    WATCHED = "watched"
    #: It drives the pin, or gives it volts, or reads its level when it is asked.
    HELD = "held"


class ChipWithBuses(Protocol):
    """What parts need of the board."""

    @property
    def now_ns(self) -> Nanos:
        """The time reached."""

    @property
    def serial_ports(self) -> Mapping[str, SerialPort]:
        """The USARTs by name."""

    def spi(self, name: str, device: Any = None, *, select: str | None = None) -> Spi:
        """Return an SPI, with a device on it."""

    def i2c(self, name: str, device: Any = None) -> I2c:
        """Return an I2C, with a device on it."""

    def can(self, network: CanNetwork | None = None) -> Can:
        """Return the CAN, on a network."""

    def pin(self, name: str) -> Pin:
        """Return a pin."""


class Socket:
    """What a part gets when it is attached (`plug`): its pins, its bus, the time and the world."""

    def __init__(self, owner: "AttachedParts", board: ChipWithBuses, name: str, pins: Mapping[str, str]) -> None:
        self._owner, self._board, self._pins = owner, board, dict(pins)
        #: What the part is called.
        self.name = name
        #: The serial port that it hangs on; None: on none.
        self.port: SerialPort | None = None
        #: The SPI that it hangs on; None: on none.
        self.spi: Spi | None = None

    @property
    def now_ns(self) -> Nanos:
        """The time of what is happening now."""
        return self._board.now_ns

    @property
    def surroundings(self) -> Surroundings:
        """What can be sensed of the world."""
        return self._owner.surroundings

    def has(self, pin: str) -> bool:
        """Tell whether a pin of the part is connected."""
        return pin in self._pins

    def pin(self, name: str) -> Pin:
        """Return the chip's pin at a pin of the part.

        Raises:
            PartError: It is not connected.
        """
        if name not in self._pins:
            raise PartError(f"the {self.name} needs its pin {name!r}", hint=f"{name}=PA8, or another pin of the chip")
        return self._board.pin(self._pins[name])

    def deadline_changed(self) -> None:
        """Have the chip's run end with the running block: within a bus's call the part has become due earlier."""
        self._owner.end_run()

    def warn(self, message: str) -> None:
        """Warn of something, once."""
        self._owner.warn(message)

    def note(self, at_ns: Nanos, what: str, detail: str = "") -> None:
        """Tell those who record the run of something that a person would want to see."""
        for sink in self._owner.note_sinks:
            sink(at_ns, self.name, what, detail)


class AttachedParts(Stateful):
    """All parts of a board that were attached by name."""

    STATE = ("_unhung",)
    #: The same objects; those on SPI and I2C are in the state of their bus.
    DERIVED = ("by_name", "_timed", "surroundings")

    def __init__(self, warn: Callable[[str], None], end_run: Callable[[], None]) -> None:
        #: Every part by its name.
        self.by_name: dict[str, Any] = {}
        #: Those that no bus of the chip saves.
        self._unhung: list[Any] = []
        self._timed: list[Any] = []
        self.surroundings: Surroundings = Nowhere()
        #: Take notes of parts.
        self.note_sinks: list[NoteSink] = []
        self.warn, self.end_run = warn, end_run

    def attach(
        self, board: ChipWithBuses, bank: PinBank, part: Any, name: str, on: str | None, select: str | None,
        pins: Mapping[str, str],
    ) -> None:  # fmt: skip
        """Attach a part; see `BluePill.attach`.

        Raises:
            PartError: It cannot be attached so.
        """
        uses: Mapping[str, Use] = getattr(part, "PINS", {})
        name = self._free_name(_plain(name or type(part).__name__))
        pins = {key: pin.upper() for key, pin in pins.items()}
        for key, pin in pins.items():
            if key not in uses:
                known = f"it has {', '.join(uses)}" if uses else "it has none of its own"
                raise PartError(f"the {name} has no pin {key!r}", hint=known)
            self._refuse_no_leg(board, pin)
        socket = Socket(self, board, name, pins)
        is_hung = on is not None and self._hang(board, part, name, on.upper(), select, socket)
        if on is None and select is not None:
            raise PartError(f"the {name} is selected on no bus", hint="on=SPI1")
        if on is None:
            self._refuse_unconnected(part, name, uses, pins)
        if hasattr(part, "plug"):
            try:
                part.plug(socket)
            except ValueError as error:
                raise PartError(f"the {name}: {error}") from error
        self._listen(bank, part, {key: (pins[key], use) for key, use in uses.items() if key in pins})
        self.by_name[name] = part
        if not is_hung:
            self._unhung.append(part)
        if hasattr(part, "next_deadline"):
            self._timed.append(part)

    @property
    def has_deadlines(self) -> bool:
        """Whether any part may ever act by itself."""
        return bool(self._timed)

    def next_deadline(self) -> Nanos | None:
        """Return when the next part acts by itself; None for never."""
        return min((at for at in (part.next_deadline() for part in self._timed) if at is not None), default=None)

    def act(self, now_ns: Nanos) -> None:
        """Bring each part to each of its deadlines up to now, in order of time, then in that of their attachment."""
        while True:
            due = [(at, n) for n, part in enumerate(self._timed) if (at := part.next_deadline()) is not None]
            if not due or (first := min(due))[0] > now_ns:
                return
            self._timed[first[1]].advance_to(first[0])
            if self._timed[first[1]].next_deadline() == first[0]:
                raise PartError(f"time stands still at {first[0]} ns: a part stays due", hint="advance_to acts on it")

    def _hang(
        self, board: ChipWithBuses, part: Any, name: str, on: str, select: str | None, socket: Socket
    ) -> bool:  # fmt: skip
        """Hang a part on a bus; return whether the bus saves its state."""
        kind = on.rstrip("0123456789")
        method = _METHODS.get(kind)
        if method is None:
            raise PartError(f"the {name} cannot hang on {on!r}", hint="SPI1, SPI2, I2C1, I2C2, USART1 to 3, or CAN")
        if not hasattr(part, method):
            raise PartError(f"the {name} does not know {kind} (it has no method {method!r})")
        if select is not None and kind != "SPI":
            raise PartError(f"the {name} is selected by a pin on an SPI only, not on {on}")
        if kind == "SPI":
            socket.spi = board.spi(on, part, select=select)
            return True
        if kind == "I2C":
            board.i2c(on, part)
            return True
        if kind == "USART":
            ports = board.serial_ports
            if on.lower() not in ports:
                raise PartError(f"no such port: {on}", hint="USART1, USART2 or USART3")
            socket.port = ports[on.lower()]
            socket.port.subscribe(part.sent, ends_slice=getattr(part, "ANSWERS", False))
            return False
        if board.can().joined is None:
            board.can(CanNetwork())
        part.join(board.can().joined)
        return False

    def _listen(self, bank: PinBank, part: Any, used: Mapping[str, tuple[str, Use]]) -> None:
        heard = {pin: key for key, (pin, use) in used.items() if use is not Use.HELD}
        if not heard:
            return
        name_of = {bank[pin].index: key for pin, key in heard.items()}
        watched = [pin for key, (pin, use) in used.items() if use is Use.WATCHED]

        def take(rows: bytes) -> None:
            part.changed([(ns, name_of[pin], wire == HIGH) for ns, pin, _, wire, _, _ in EDGE.iter_unpack(rows)])

        bank.subscribe_pins(heard, take, of=Of.WIRE, ends_slice=watched)

    @staticmethod
    def _refuse_unconnected(part: Any, name: str, uses: Mapping[str, Use], pins: Mapping[str, str]) -> None:
        """Refuse a part that nothing could reach; of what knows a bus, a pin that it only holds serves that bus."""
        buses = buses_of(part)
        enough = [key for key, use in uses.items() if not buses or use is not Use.HELD]
        if (buses or uses) and not any(key in pins for key in enough):
            ways = [f"on={bus}{'' if bus == 'CAN' else 1}" for bus in buses] + [f"{key}=PA8" for key in enough[:1]]
            raise PartError(f"the {name} is connected to nothing", hint=" or ".join(ways))

    @staticmethod
    def _refuse_no_leg(board: ChipWithBuses, pin: str) -> None:
        try:
            is_bonded = board.pin(pin).is_bonded
        except KeyError:
            is_bonded = False
        if not is_bonded:
            raise PartError(f"the chip has no leg {pin}", hint="PA0 to PA15, PB0 to PB15, PC13 to PC15")

    def _free_name(self, name: str) -> str:
        """Return a name that no other part has: a second oled is oled-2."""
        names = [name, *(f"{name}-{n}" for n in range(2, len(self.by_name) + 3))]
        return next(one for one in names if one not in self.by_name)


def buses_of(part: object) -> list[str]:
    """Return the buses on which a part, or a class of parts, can hang."""
    return [bus for bus, method in _METHODS.items() if hasattr(part, method)]


def _plain(name: str) -> str:
    """Return the name of a part, by which its files are called.

    Raises:
        PartError: It is none that a file can have.
    """
    if not name.isprintable() or {"/", "\\"} & set(name) or name.startswith("."):
        raise PartError(f"{shown(name)} is no name of a part: its files are called so", hint="name=card")
    return name


def words_of(parts: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return what each part that tells something tells, by its name."""
    return [(name, part.words()) for name, part in parts.items() if hasattr(part, "words")]
