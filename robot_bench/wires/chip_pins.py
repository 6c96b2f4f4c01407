"""Joins the chip's pins to the wires: drives both ways, each with its time stamp.

The chip leads in time, so it is given a level when the part that drives it
has come to that time; it acts from the first block boundary on.

A resistor on the wire is passed to the chip as a level while the chip itself
does not drive hard: the adapter's 20 kΩ win over the chip's own pulls of 40 kΩ.

Invariant: the chip's input follows `level_without(OWNER)` of its net.
"""

from collections.abc import Callable, Mapping
from typing import Protocol

from bluepill_sim.fabric.pins import PinDrive
from robot_bench.wires.nets import Harness, Net, Strength
from simbase.timing import Nanos

#: The name under which the chip drives wires.
OWNER = "bluepill"

#: The chip's own drives: level and strength on the wire.
DRIVES = {
    PinDrive.NONE: (False, Strength.FLOATING),
    PinDrive.LOW: (False, Strength.PUSH_PULL),
    PinDrive.HIGH: (True, Strength.PUSH_PULL),
    PinDrive.PULL_UP: (True, Strength.PULL),
    PinDrive.PULL_DOWN: (False, Strength.PULL),
}


class ChipPin(Protocol):
    """One pin of the chip, from outside."""

    def drive(self, level: bool | None) -> None:
        """Put a level on the wire from outside; None lets go."""
        ...

    def watch(self, on: bool = True) -> None:
        """Choose whether a change of the chip's own drive ends its slice."""
        ...


class ChipWithPins(Protocol):
    """What the wires need of the chip."""

    on_pin: Callable[[str, PinDrive, int], None] | None

    def pin(self, name: str) -> ChipPin:
        """Return a pin by its name, such as "PA4"."""
        ...


class ChipPins:
    """The chip's ends of the wires.

    Args:
        chip: Gets its `on_pin` taken.
        harness: The wires.
        pin_of: Net → pin of the chip.
        on_watched: Called with the time of each edge that the chip makes on a watched net.
    """

    def __init__(
        self,
        chip: ChipWithPins,
        harness: Harness,
        pin_of: Mapping[str, str],
        *,
        on_watched: Callable[[Nanos], None] | None = None,
    ) -> None:
        self._nets: dict[str, Net] = {pin: harness[net] for net, pin in pin_of.items()}
        self._pins: dict[str, ChipPin] = {net: chip.pin(pin) for net, pin in pin_of.items()}
        self._watched: set[str] = set()
        self._on_watched = on_watched
        chip.on_pin = self._chip_drives
        for net in self._nets.values():
            net.watch(self._other_drives)
            self._pass_on(net, 0)

    def watch(self, net: str) -> None:
        """Have each edge that the chip makes on a net end its slice and be reported to `on_watched`."""
        self._watched.add(net)
        self._pins[net].watch(True)

    def _chip_drives(self, pin: str, drive: PinDrive, at: Nanos) -> None:
        net = self._nets.get(pin)
        if net is None:
            return
        level, strength = DRIVES[drive]
        net.drive(OWNER, level, strength, at)
        self._pass_on(net, at)
        if net.name in self._watched and self._on_watched is not None:
            self._on_watched(at)

    def _other_drives(self, net: Net, owner: str, at: Nanos) -> None:
        if owner != OWNER:
            self._pass_on(net, at)

    def _pass_on(self, net: Net, at: Nanos) -> None:
        level, is_hard = net.level_without(OWNER, at)
        if not is_hard and net.drive_of(OWNER, max(at, net.last_edge)).strength is Strength.PUSH_PULL:
            level = None
        self._pins[net.name].drive(level)
