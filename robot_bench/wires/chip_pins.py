"""Joins the chip's pins to the wires: drives both ways, each with its time stamp.

The chip leads in time, so it is given a level when the part that drives it
has come to that time; it acts from the first block boundary on. What the chip
drives comes in bulk, when its slice is over.

A wave (PWM) of the chip is one drive of its net, but where somebody waits for the net's edges. Levels that a part puts
on a wire ahead of the chip's time are handed to the chip with their times, so that it need not stop for each.

A resistor on the wire is passed to the chip as one, so that it yields to the chip's own
outputs: the adapter's 20 kΩ win over the chip's own pulls of 40 kΩ.

Invariant: what is put on the chip's pin follows `level_without(OWNER)` of its net.
"""

from array import array
from collections.abc import Callable, Iterable, Mapping
from heapq import merge
from typing import Protocol, cast

from bluepill_sim.fabric.pins import PinDrive
from bluepill_sim.fabric.subscriptions import EDGE, PinSubscription, PinSubscriptions, read_wave
from p2os.errors import LocalProtocolError
from robot_bench.wires.edges import NO_WIRE, split
from robot_bench.wires.nets import HARD, RELEASED, Harness, Net, Strength, WaveDrive
from robot_bench.wires.waves import edge_times
from simbase.timing import Nanos

#: The name under which the chip drives wires.
OWNER = "bluepill"

#: The chip's own drives, as codes of a net.
CODES = {
    PinDrive.NONE: RELEASED,
    PinDrive.LOW: Strength.PUSH_PULL.codes[0],
    PinDrive.HIGH: Strength.PUSH_PULL.codes[1],
    PinDrive.PULL_UP: Strength.PULL.codes[1],
    PinDrive.PULL_DOWN: Strength.PULL.codes[0],
}
_CODE_OF_DRIVE = bytes(CODES[drive] for drive in PinDrive).ljust(256, b"\0")
#: The codes that drive hard, and the level of each code of these; 256 bytes.
_HARD = bytes(HARD)
_LEVEL_OF_HARD = bytes(HARD.get(code, False) for code in range(256))
PINS_A_PORT = 16
#: Where a row of `EDGE` says whether it is one of a wave.
_KIND = 11


class ChipPin(Protocol):
    """One pin of the chip, from outside."""

    def drive(self, level: bool | None, *, is_weak: bool = False) -> None:
        """Put a level on the wire from outside, by a resistor where `is_weak`; None lets go."""

    def drive_later(self, levels: Iterable[tuple[Nanos, int]], *, is_weak: bool = False) -> None:
        """Put levels on the wire from outside at times to come."""


class ChipWithPins(PinSubscriptions, Protocol):
    """What the wires need of the chip."""

    @property
    def now_ns(self) -> int:
        """The time reached."""

    def pin(self, name: str) -> ChipPin:
        """Return a pin by its name, such as "PA4"."""


class ChipPins:
    """The chip's ends of the wires.

    Args:
        chip: Its pins on the wires are subscribed to.
        harness: The wires.
        pin_of: Net → pin of the chip.
        on_watched: Called with the time of each edge that the chip makes on a watched net, in order of time.
        now: Returns where the chip stands, ns; None asks the chip itself.
    """

    def __init__(
        self,
        chip: ChipWithPins,
        harness: Harness,
        pin_of: Mapping[str, str],
        *,
        on_watched: Callable[[Nanos], None] | None = None,
        now: Callable[[], Nanos] | None = None,
    ) -> None:
        self._chip = chip
        self._now = now or (lambda: chip.now_ns)
        self._pin_of = dict(pin_of)
        self._nets = tuple(harness[net] for net in pin_of)
        places = {number_of(pin): place for place, pin in enumerate(pin_of.values())}
        self._wire_of_pin = bytes(places.get(number, NO_WIRE) for number in range(256))
        self._pins: dict[str, ChipPin] = {net: chip.pin(pin) for net, pin in pin_of.items()}
        self._watched: frozenset[str] = frozenset()
        self._on_watched = on_watched
        self._subscriptions: tuple[PinSubscription, ...] = ()
        self._subscribe()
        for net in self._nets:
            net.watch(self._other_drives)
            self._pass_on(net, 0)

    def watch(self, nets: frozenset[str], now: Nanos) -> None:
        """Have each edge after `now` that the chip makes on these nets, and no other, end its slice and reported."""
        if nets is self._watched:  # called often; whoever watches has one set for each state
            return
        added, self._watched = [net for net in self._nets if net.name in nets - self._watched], nets
        self._subscribe()
        # The chip stands up to a block ahead of those who have just begun to wait for edges.
        self._report([self._unfolded(net, now) for net in added])

    def chip_restored(self) -> None:
        """Go on from what the chip drives now: it has been put back to another state."""
        self._subscribe()

    def _subscribe(self) -> None:
        """Subscribe to the edges of the watched wires, and to the waves of the others."""
        for one in self._subscriptions:
            one.close()
        watched = [pin for net, pin in self._pin_of.items() if net in self._watched]
        others = [pin for net, pin in self._pin_of.items() if net not in self._watched]
        self._subscriptions = (
            self._chip.subscribe_pins(others, self._chip_drives, waves=True),
            self._chip.subscribe_pins(watched, self._edges, ends_slice=watched),
        )

    def _unfolded(self, net: Net, after: Nanos) -> "array[int]":
        """Return when the chip has driven a net after a time; of a wave its edges, of which it goes on from now."""
        times, now = net.times_after(OWNER, after), self._chip.now_ns
        drive = net.drive_at(OWNER, now)
        if drive is not None:
            begin = max(after, times[-1]) if times else after
            times += array("q", edge_times(drive.wave, begin + 1, now + 1))
            net.drive_in_turn(OWNER, array("q", (now,)), bytes((drive.codes[drive.wave.level(now)],)))
        return times

    def _chip_drives(self, rows: bytes) -> None:
        # Up to the first row of a wave all rows are edges, and so on behind what follows it.
        while kinds := rows[_KIND :: EDGE.size].lstrip(b"\0"):
            first = len(rows) - len(kinds) * EDGE.size
            self._edges(rows[:first])
            at, pin, drives, *_ = EDGE.unpack_from(rows, first)
            wave, behind = read_wave(rows, first + EDGE.size)
            codes = (_CODE_OF_DRIVE[drives & 15], _CODE_OF_DRIVE[drives >> 4])
            self._nets[self._wire_of_pin[pin]].wave_from(OWNER, WaveDrive(wave, codes), at)
            rows = rows[behind:]
        self._edges(rows)

    def _edges(self, rows: bytes) -> None:
        if not rows:
            return
        watched = []
        for place, times, codes in split(rows, self._wire_of_pin, _CODE_OF_DRIVE, len(self._nets)):
            net = self._nets[place]
            net.drive_in_turn(OWNER, times, codes)
            if net.name in self._watched:
                watched.append(times)
        self._report(watched)

    def _report(self, edges: "list[array[int]]") -> None:
        if self._on_watched is not None:
            for at in merge(*edges):
                self._on_watched(at)

    def _other_drives(self, net: Net, owner: str, at: Nanos) -> None:
        if owner == OWNER:
            return
        times, codes = net.drives_from(owner, at)
        if len(times) == 1 and at <= self._now():
            self._pass_on(net, at)
            return
        if net.is_alone(owner, OWNER) and not codes.strip(_HARD):
            self._pins[net.name].drive_later(zip(times, codes.translate(_LEVEL_OF_HARD), strict=True))
            return
        levels = net.levels_without(OWNER, times)
        if any(level is None for level, _ in levels):
            raise LocalProtocolError(f"{owner} lets {net.name} go ahead of the chip")
        pin = self._pins[net.name]
        for strength in {is_hard for _, is_hard in levels}:
            rows = [(when, level) for when, (level, is_hard) in zip(times, levels, strict=True) if is_hard is strength]
            pin.drive_later(cast("list[tuple[Nanos, int]]", rows), is_weak=not strength)

    def _pass_on(self, net: Net, at: Nanos) -> None:
        level, is_hard = net.level_without(OWNER, at)
        self._pins[net.name].drive(level, is_weak=level is not None and not is_hard)


def number_of(pin: str) -> int:
    """Return a pin's number in the chip's rows: 16 times its port, and the number in it."""
    return PINS_A_PORT * (ord(pin[1]) - ord("A")) + int(pin[2:])
