"""The adapter's output pins: distances and encoder codes, released or driven.

Only changes are written.
"""

from adapter_sim.pinout import Pinout, Role, Safe
from adapter_sim.ports import PinBank
from p2os.timing import Nanos

#: The values of both wheels, left first.
ENCODER_VALUES = ("encoder1", "encoder2")


class Outputs:
    """Writes levels to the pins, each change once."""

    def __init__(self, pins: PinBank, pinout: Pinout) -> None:
        self._pins = pins
        self._distances = pinout.with_role(Role.DISTANCE)
        self._encoders = tuple(
            tuple(pinout.wire(name) for name in pinout.value(value).wires) for value in ENCODER_VALUES
        )
        self._shown: dict[str, bool | None] = {wire.name: None for wire in self._distances}
        self._shown.update((wire.name, None) for wires in self._encoders for wire in wires)

    def release(self, now: Nanos) -> None:
        """Let every output follow its pull."""
        for name in self._shown:
            self._write(name, None, now)

    def show_safe(self, now: Nanos) -> None:
        """Drive the safe level of pinout.toml; wires that hold stay as they are."""
        for wire in self._distances:
            if wire.safe is not Safe.HOLD:
                self._write(wire.name, wire.safe is Safe.HIGH, now)

    def show_distances(self, levels: tuple[bool, ...], now: Nanos) -> None:
        """Drive the distance wires, wire 1 first."""
        for wire, level in zip(self._distances, levels, strict=True):
            self._write(wire.name, level, now)

    def show_encoders(self, counts: tuple[int, int], now: Nanos) -> None:
        """Drive both encoders' codes, left first."""
        for wires, count in zip(self._encoders, counts, strict=True):
            for bit, wire in enumerate(wires):
                self._write(wire.name, bool(count >> bit & 1), now)

    @property
    def levels(self) -> dict[str, bool | None]:
        """Return what each output shows; None is released."""
        return dict(self._shown)

    def snapshot(self) -> tuple[tuple[str, bool | None], ...]:
        """Return all of it as plain values."""
        return tuple(self._shown.items())

    def restore(self, snapshot: tuple[tuple[str, bool | None], ...]) -> None:
        """Put back what `snapshot` returned; nothing is written, the wires have their own."""
        self._shown = dict(snapshot)

    def _write(self, name: str, level: bool | None, now: Nanos) -> None:
        if self._shown[name] is not level:
            self._shown[name] = level
            self._pins.write(name, level, now)
