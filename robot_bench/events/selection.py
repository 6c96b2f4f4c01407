r"""Which events are meant: one line of words, the same in goals, scenario files and `Bench.run_until`.

    pin PB12 high                 a wire comes to a level (high, low, changes); a pin or a name of the pin-out
    usart1 sends dodge: CRUISE    a line that the firmware prints holds these words
    usart1 matches ^left=\d+      a line that it prints matches a regular expression
    usb sends TEXT                likewise of a CDC device; USB and buses have to be recorded (`record`)
    i2c1 writes 0x3c [HEX]        an I2C writes to, or `reads` from, an address; the bytes begin so; or `i2c1 fails`
    spi1 sends 9f 00              bytes with these among them go out of an SPI's master, or `gets` them
    can hears 0x123 [HEX]         a frame is heard, or `sends`; its bytes begin so; or `can fails`
    contact [NAME]                the hull comes to touch something, or this thing
    robot near X Y RADIUS         it comes within so many metres of a place
    robot within X Y X Y          it comes into a rectangle: its least x and y, its greatest
    robot drives 2.5              its way from the beginning has become so many metres
    time 5.0                      so many seconds are over: at the first pose from then on
    robot moves | robot stops     it is faster, or no faster, than 5 mm/s
    sonar 3 below 0.4             a range comes below so many metres
    note adapter driving          a line of a part's state log begins so
    fault [WORDS]                 something is made to go wrong, or the firmware dies
    thing NAME                    a thing is placed, moved or removed
    packet [NAME]                 a packet of the P2OS line has come, or one of this name (PULSE, VEL, SIP …)
    goal met | goal missed        a goal is decided

Invariant: what a selector says of an event depends on the events before it alone; it is saved with the bench.
"""

import math
import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import TypeAlias

from adapter_sim.pinout import load_pinout
from p2os.capture.describe import command_name
from p2os.protocol.frames import Decoder, Frame
from p2os.protocol.packets import packet_name
from robot_bench.events.kinds import (
    CanTransfer,
    Contact,
    Event,
    Fault,
    I2cTransfer,
    Note,
    Packet,
    PinEdge,
    Pose,
    Ranges,
    SpiTransfer,
    Text,
    Verdict,
    WorldChange,
)
from simbase.errors import UsageError, nearest, shown
from simbase.state import Stateful
from simbase.timing import NS_PER_S

#: chosen: a robot that is no faster stands still; half of the slowest motor step would be 31 mm/s.
STILL_MPS = 0.005


#: What is recorded on request only.
BUSES = ("spi1", "spi2", "i2c1", "i2c2", "can", "usb")

#: Name or pin → the wire's name.
Wires: TypeAlias = Mapping[str, str]


class Selector(Stateful):
    """Picks events; `takes` is fed all those of its `kinds`, in order of time."""

    #: What it wants to be fed, and of which wires the edges are wanted.
    kinds: tuple[type, ...] = ()
    wires: tuple[str, ...] | None = None

    def __init__(self, words: str) -> None:
        self.words = words

    def takes(self, event: Event) -> bool:
        """Tell whether this event is meant."""
        raise NotImplementedError


def select(words: str, wires: Wires | None = None) -> Selector:
    """Return what picks the events that a line of words means.

    Args:
        words: The line.
        wires: Names of a robot's own wires, and its pins of the chip; None: those of the pin-out.

    Raises:
        UsageError: There are no such events; the hint says what is nearest, or how it is written.
    """
    name, *rest = words.split(maxsplit=1) or [""]
    row = SELECTORS.get(name)
    if row is None:
        hint = nearest(name, SELECTORS, f"events: {'; '.join(usage for usage, _ in SELECTORS.values())}")
        raise UsageError(f"no events {shown(words)}", hint=hint)
    usage, make = row
    try:
        place = rest[0] if rest else ""
        return make(words, place) if wires is None or make is not _Pin else _Pin(words, place, wires)
    except (ValueError, re.error) as error:
        raise UsageError(f"events {shown(words)} are not understood: {error}", hint=f"such as {usage}") from error


def bus_of(words: str) -> str:
    """Return the bus whose events a line of words means; empty where it means others: then they are there always."""
    first = (words.split(maxsplit=1) or [""])[0]
    return first if first in BUSES else ""


@cache
def _wires() -> Mapping[str, str]:
    wires = load_pinout().wires
    return {wire.bluepill: wire.name for wire in wires} | {wire.name: wire.name for wire in wires}


def wire_named(name: str, wires: Wires | None = None) -> str:
    """Return the name of a wire, by itself or by the BluePill's pin; `wires` as of `select`.

    Raises:
        UsageError: There is no such wire.
    """
    wires = _wires() if wires is None else wires
    if name not in wires:
        raise UsageError(f"there is no wire {shown(name)}", hint=nearest(name, wires))
    return wires[name]


class _Pin(Selector):
    kinds = (PinEdge,)

    def __init__(self, words: str, rest: str, wires: Wires | None = None) -> None:
        super().__init__(words)
        name, level = rest.split() if len(rest.split()) == 2 else ("", "")
        if level not in {"high", "low", "changes"}:
            raise ValueError("a pin, and high, low or changes")
        self._wire = wire_named(name, wires)
        self.wires = (self._wire,)
        self._wanted = {"high": True, "low": False}.get(level)

    def takes(self, event: Event) -> bool:
        if not isinstance(event, PinEdge) or event.wire != self._wire:
            return False
        if event.t == 0 and self._wanted is None:
            return False  # the level that a wire begins with is no change
        return self._wanted is None or event.level is self._wanted


class Lines(Stateful):
    """Joins the pieces of one port's text to lines."""

    STATE = ("_line",)

    def __init__(self, port: str = "usart1") -> None:
        self._port = port
        self._line = b""

    def take(self, text: Text) -> str | None:
        """Return the line so far, without its end; None for another port's."""
        if text.port != self._port:
            return None
        whole = self._line + text.data
        self._line = b"" if whole.endswith(b"\n") else whole
        return whole.decode("utf-8", "replace").rstrip("\r\n")


class _Usart(Selector):
    STATE = ("_lines", "_was_taken")
    kinds = (Text,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        verb, _, wanted = rest.partition(" ")
        if verb not in {"sends", "matches"} or not wanted:
            raise ValueError("sends TEXT, or matches REGEX")
        self._found: Callable[[str], object] = (
            re.compile(wanted).search if verb == "matches" else lambda line: wanted in line
        )
        self._lines = Lines(words.split(maxsplit=1)[0])
        self._was_taken = False

    def takes(self, event: Event) -> bool:
        line = self._lines.take(event) if isinstance(event, Text) else None
        if line is None or not isinstance(event, Text):
            return False
        was_taken = self._was_taken
        found = bool(self._found(line))
        # A long line comes in pieces, and is meant once.
        self._was_taken = (was_taken or found) and not event.data.endswith(b"\n")
        return found and not was_taken


class _I2c(Selector):
    kinds = (I2cTransfer,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        self._bus = words.split(maxsplit=1)[0]
        self._verb, self._address, self._data = _transfer(rest, {"writes": 10, "reads": 10, "fails": 0})

    def takes(self, event: Event) -> bool:
        if not isinstance(event, I2cTransfer) or event.bus != self._bus:
            return False
        if self._verb == "fails":
            is_refused = not event.is_read and event.acknowledged < len(event.data)
            return not event.answered or is_refused or event.end in {"lost", "cut"}
        is_meant = event.address == self._address and event.is_read is (self._verb == "reads")
        return is_meant and event.answered and event.data.startswith(self._data)


class _Spi(Selector):
    kinds = (SpiTransfer,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        self._bus = words.split(maxsplit=1)[0]
        self._verb, _, data = rest.partition(" ")
        self._data = _hex(data)
        if self._verb not in {"sends", "gets"} or not self._data:
            raise ValueError("sends HEX, or gets HEX")

    def takes(self, event: Event) -> bool:
        if not isinstance(event, SpiTransfer) or event.bus != self._bus:
            return False
        return self._data in (event.from_master if self._verb == "sends" else event.from_slave)


class _Can(Selector):
    kinds = (CanTransfer,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        self._verb, self._identifier, self._data = _transfer(rest, {"sends": 29, "hears": 29, "fails": 0})

    def takes(self, event: Event) -> bool:
        if not isinstance(event, CanTransfer):
            return False
        if self._verb == "fails":
            return bool(event.error)
        is_meant = event.identifier == self._identifier and event.is_own is (self._verb == "sends")
        return is_meant and not event.error and event.data.startswith(self._data)


def _transfer(rest: str, verbs: Mapping[str, int]) -> tuple[str, int, bytes]:
    """Return a verb of `verbs`, the number behind it, which has so many bits (0: none), and the bytes behind that."""
    verb, *given = rest.split() or [""]
    bits = verbs.get(verb)
    number = int(given[0], 0) if given and bits else 0
    if bits is None or bool(bits) is not bool(given) or not 0 <= number < 1 << bits:
        raise ValueError(", ".join(f"{one} NUMBER [HEX]" if bits else one for one, bits in verbs.items()))
    return verb, number, _hex(" ".join(given[1:]))


def _hex(text: str) -> bytes:
    try:
        return bytes.fromhex(text)
    except ValueError:
        raise ValueError(f"{shown(text)} is no bytes in hex") from None


def _finite(text: str) -> float:
    if not math.isfinite(value := float(text)):
        raise ValueError(f"{text} is no number of metres")
    return value


def _above_zero(text: str) -> float:
    if (value := _finite(text)) <= 0:
        raise ValueError(f"{text} m are never come to: above 0")
    return value


class _Contact(Selector):
    kinds = (Contact,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        self._name = rest

    def takes(self, event: Event) -> bool:
        return isinstance(event, Contact) and (not self._name or event.what.strip("'") == self._name)


class _Robot(Selector):
    STATE = ("_was", "_last", "_way_m")
    kinds = (Pose,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        verb, *numbers = rest.split() or [""]
        self._last: tuple[float, float] | None = None
        self._way_m = 0.0
        self._is: Callable[[Pose], bool]
        if verb == "near" and len(numbers) == 3:
            x_m, y_m, radius_m = *map(_finite, numbers[:2]), _above_zero(numbers[2])
            self._is = lambda pose: math.hypot(pose.x_m - x_m, pose.y_m - y_m) <= radius_m
        elif verb == "within" and len(numbers) == 4:
            low_x, low_y, high_x, high_y = map(_finite, numbers)
            if low_x > high_x or low_y > high_y:
                raise ValueError("least x and y, then the greatest")
            self._is = lambda pose: low_x <= pose.x_m <= high_x and low_y <= pose.y_m <= high_y
        elif verb == "drives" and len(numbers) == 1:
            wanted_m = _above_zero(numbers[0])
            self._is = lambda _: self._way_m >= wanted_m
        elif verb in {"moves", "stops"} and not numbers:
            self._is = lambda pose: moves(pose) is (verb == "moves")
        else:
            raise ValueError("near X Y RADIUS, within X Y X Y, drives METRES, moves, or stops")
        # Standing still at the beginning is no stop.
        self._was = verb == "stops"

    def takes(self, event: Event) -> bool:
        if not isinstance(event, Pose):
            return False
        last, self._last = self._last, (event.x_m, event.y_m)
        self._way_m += math.dist(last, self._last) if last is not None else 0.0
        was, self._was = self._was, self._is(event)
        return self._was and not was


class _Time(Selector):
    STATE = ("_is_over",)
    kinds = (Pose,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        seconds = float(rest)
        if not 0 <= seconds < 1e9:
            raise ValueError("seconds from the beginning")
        self._at = round(seconds * NS_PER_S)
        self._is_over = False

    def takes(self, event: Event) -> bool:
        was, self._is_over = self._is_over, event.t >= self._at
        return self._is_over and not was


def moves(pose: Pose) -> bool:
    """Tell whether a wheel is faster than a robot at rest."""
    return max(abs(pose.left), abs(pose.right)) > STILL_MPS * 1e6


class _Sonar(Selector):
    STATE = ("_was",)
    kinds = (Ranges,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        number, verb, metres = rest.split() if len(rest.split()) == 3 else ("", "", "")
        if verb != "below" or not number.isdecimal() or int(number) == 0:
            raise ValueError("a sonar from 1 on, below, and metres")
        self._number, self._mm = int(number) - 1, _above_zero(metres) * 1000
        self._was = False

    def takes(self, event: Event) -> bool:
        if not isinstance(event, Ranges) or self._number >= len(event.mm):
            return False
        was, self._was = self._was, event.mm[self._number] < self._mm
        return self._was and not was


class _Note(Selector):
    kinds = (Note,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        self._who, _, self._what = rest.partition(" ")
        if not self._who:
            raise ValueError("who notes it, and what")

    def takes(self, event: Event) -> bool:
        return (
            isinstance(event, Note) and event.who == self._who and f"{event.what} {event.detail}".startswith(self._what)
        )


class _Fault(Selector):
    kinds = (Fault,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        self._begin = rest

    def takes(self, event: Event) -> bool:
        return isinstance(event, Fault) and event.op != "clear" and event.words.startswith(self._begin)


class _Thing(Selector):
    kinds = (WorldChange,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        if not rest:
            raise ValueError("the name of a thing")
        self._name = rest

    def takes(self, event: Event) -> bool:
        return isinstance(event, WorldChange) and event.name == self._name


class _Packet(Selector):
    STATE = ("_decoders",)
    kinds = (Packet,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        self._name = rest.upper()
        self._decoders = [Decoder(), Decoder()]

    def takes(self, event: Event) -> bool:
        if not isinstance(event, Packet):
            return False
        is_command, found = event.direction == "c2r", False
        decoder = self._decoders[is_command]
        decoder.receive(event.data, event.t)
        while (item := decoder.next_item()) is not None:
            if isinstance(item, Frame):
                name = command_name(item.kind) if is_command else packet_name(item.kind)
                found = found or not self._name or self._name in name.upper().split()
        return found


class _Goal(Selector):
    kinds = (Verdict,)

    def __init__(self, words: str, rest: str) -> None:
        super().__init__(words)
        if rest not in {"met", "missed"}:
            raise ValueError("met, or missed")
        self._is_met = rest == "met"

    def takes(self, event: Event) -> bool:
        return isinstance(event, Verdict) and event.met is self._is_met


#: First word → how it is written, and what picks the events.
SELECTORS: Mapping[str, tuple[str, Callable[[str, str], Selector]]] = {
    "pin": ("pin PB12 high", _Pin),
    "usart1": ("usart1 sends TEXT", _Usart),
    "usart2": ("usart2 sends TEXT", _Usart),
    "usart3": ("usart3 sends TEXT", _Usart),
    "usb": ("usb sends TEXT", _Usart),
    "i2c1": ("i2c1 writes 0x3c", _I2c),
    "i2c2": ("i2c2 writes 0x3c", _I2c),
    "spi1": ("spi1 sends 9f 00", _Spi),
    "spi2": ("spi2 sends 9f 00", _Spi),
    "can": ("can hears 0x123", _Can),
    "contact": ("contact [NAME]", _Contact),
    "robot": ("robot near X Y RADIUS", _Robot),
    "time": ("time 5.0", _Time),
    "sonar": ("sonar 3 below 0.4", _Sonar),
    "note": ("note adapter driving", _Note),
    "fault": ("fault [WORDS]", _Fault),
    "thing": ("thing NAME", _Thing),
    "packet": ("packet PULSE", _Packet),
    "goal": ("goal missed", _Goal),
}
