"""The adapter's input pins, sampled together.

One sample is one word: the motor wires from bit 0 on, then p2dx_con. All wires
are read at the same instant, as one read of the ESP32's input register does.
"""

from typing import TypeAlias

from adapter_sim.codec import motor_value
from adapter_sim.pinout import Pinout, Role
from adapter_sim.ports import PinBank
from adapter_sim.sampler import Debounce, DebounceSnapshot, Majority, MajoritySnapshot
from adapter_sim.settings import AdapterSettings
from p2os.timing import Nanos

InputSnapshot: TypeAlias = tuple[int, MajoritySnapshot, DebounceSnapshot]


class Inputs:
    """Motor values by majority, p2dx_con by time, rst as it stands."""

    def __init__(self, pins: PinBank, pinout: Pinout, settings: AdapterSettings) -> None:
        self._pins = pins
        self._bit_order = settings.bit_order
        self._motors = tuple(pinout.value(name) for name in ("motor1", "motor2"))
        names = [name for value in self._motors for name in value.wires]
        names.append(pinout.with_role(Role.CONNECT)[0].name)
        self._wires = tuple((name, 1 << bit) for bit, name in enumerate(names))
        self._connect_weight = 1 << (len(names) - 1)
        self._reset_wire = pinout.with_role(Role.RESET)[0].name
        self._majority = Majority(settings.sample_count)
        self._connect = Debounce(settings.connect_after_ns, settings.disconnect_after_ns)
        self._word = 0

    @property
    def motors(self) -> tuple[int, int]:
        """Return the signed motor values taken, motor1 first."""
        word, values = self._majority.word, []
        for value in self._motors:
            values.append(motor_value(word & ((1 << value.width) - 1), value.width, self._bit_order))
            word >>= value.width
        return values[0], values[1]

    @property
    def wires(self) -> tuple[str, ...]:
        """Return the names of all wires that are looked at."""
        return (*(name for name, _ in self._wires), self._reset_wire)

    @property
    def wants_robot(self) -> bool:
        """Tell whether p2dx_con counts as high."""
        return self._connect.level

    def is_reset(self, now: Nanos) -> bool:
        """Tell whether rst is high."""
        return self._pins.read(self._reset_wire, now)

    def is_quiet(self, now: Nanos) -> bool:
        """Tell whether a sample at `now` would change nothing: the fast path of most instants."""
        return (
            self._majority.is_settled
            and self._connect.is_settled
            and self._read(now) == self._word
            and not self._pins.read(self._reset_wire, now)
        )

    def sample(self, now: Nanos) -> tuple[bool, bool]:
        """Take a sample; tell whether the motor values and whether p2dx_con have changed."""
        word = self._word = self._read(now)
        motors_changed = self._majority.take(word & (self._connect_weight - 1))
        return motors_changed, self._connect.take(bool(word & self._connect_weight), now)

    def reset(self) -> None:
        """Forget all samples."""
        self._word = 0
        self._majority.reset()
        self._connect.reset()

    def snapshot(self) -> InputSnapshot:
        """Return all of it as plain values."""
        return self._word, self._majority.snapshot(), self._connect.snapshot()

    def restore(self, snapshot: InputSnapshot) -> None:
        """Put back what `snapshot` returned."""
        self._word, majority, connect = snapshot
        self._majority.restore(majority)
        self._connect.restore(connect)

    def _read(self, now: Nanos) -> int:
        read, word = self._pins.read, 0
        for name, weight in self._wires:
            if read(name, now):
                word |= weight
        return word
