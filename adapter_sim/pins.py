"""The adapter's pins: what it needs of the far side, when it samples, debounced inputs, outputs.

The bench's nets, a real GPIO bank and the fakes of the tests all fit `AdapterPins`. What
the levels mean for the robot is not decided here; names and weights come from the
pin-out.

Theory of operation
-------------------
One sample is one word: the motor wires from bit 0 on, then p2dx_con, all read at the
same instant, as one read of the ESP32's input register does. rst is not debounced.

Motor wires are debounced by majority: a word is taken when it makes up more than half
of the last samples; while no word does (the BluePill is half-way through writing its
bits), the last one taken stays. With 5 samples 2 ms apart a change is taken at its
third sample: 4 to 6 ms after the edge. A glitch seen by two samples or fewer passes
without effect.

Motor wires that carry duties (`MotorCommand.DUTY`) are taken by the median of the same
samples, wheel by wheel: adapter_sim/duty.py.

p2dx_con is debounced by time: it counts as high once it has been seen high for MORE
than `connect_after_ns` without a break, and as low once it has been seen low for
`disconnect_after_ns`. Both spans run from the first sample that saw the level; a dip
between two samples is not seen.

Once the inputs have settled, sampling may be suspended until an edge comes, where
whoever runs the adapter brings it to each edge: the samples left out would have
changed nothing.

Invariant: sample instants are whole periods apart from each other, suspended or not,
and an output is written only when it changes.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import ClassVar, Protocol, TypeAlias

from adapter_sim.codec import BitOrder, motor_value
from adapter_sim.duty import DutyWire, PeriodicLevel
from adapter_sim.pinout import Pinout, Safe, Value, WireRole
from adapter_sim.settings import AdapterSettings, MotorCommand
from simbase.state import Stateful
from simbase.timing import Nanos

#: Called at each transition: (now in ns, what happened in a word or two, detail).
EventCallback: TypeAlias = Callable[[Nanos, str, str], None]
#: Values of the pin-out that the wheels' commands are, left first.
MOTOR_VALUES = ("motor1", "motor2")
#: Values of the pin-out that the wheels' codes are, left first.
ENCODER_VALUES = ("encoder1", "encoder2")


class AdapterPins(Protocol):
    """The adapter's ends of the wires, by the names of pinout.toml."""

    def read(self, signal: str, at: Nanos) -> bool:
        """Return the level of a wire at the instant `at`, an edge at `at` included."""

    def course(self, signal: str, begin: Nanos, end: Nanos) -> Sequence[tuple[Nanos, bool | PeriodicLevel]]:
        """Return what a wire does from `begin` on until before `end`: when, and the level or wave from then on.

        `begin` lies at most `COURSE_NS` before the present.
        """

    def write(self, signal: str, high: bool | None, now: Nanos) -> None:
        """Drive a wire from `now` on; None releases it to its pull."""


class Inputs(Stateful):
    """Motor values by majority or median, p2dx_con by time, rst as it stands."""

    STATE = ("_motors", "_connect", "_seen")

    def __init__(self, pins: AdapterPins, pinout: Pinout, settings: AdapterSettings) -> None:
        self._pins = pins
        kind = MotorDuties if settings.motor_command is MotorCommand.DUTY else MotorBits
        self._motors: MotorBits | MotorDuties = kind(pins, [pinout.value(name) for name in MOTOR_VALUES], settings)
        self._connect_wire = pinout.with_role(WireRole.CONNECT)[0].name
        self._reset_wire = pinout.with_role(WireRole.RESET)[0].name
        #: Names of rst, and of all wires that are looked at.
        self.reset_wires = frozenset((self._reset_wire,))
        self.wires = self.reset_wires.union(self._motors.wires, (self._connect_wire,))
        self._connect = Debounce(settings.connect_after_ns, settings.disconnect_after_ns)
        self._seen: tuple[object, bool] = (self._motors.at_rest, False)

    @property
    def motors(self) -> tuple[int, int]:
        """Return the signed motor values taken, motor1 first: steps, or duties of `FULL`."""
        return self._motors.values

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
            self._motors.is_settled
            and self._connect.is_settled
            and (self._motors.read(now), self._pins.read(self._connect_wire, now)) == self._seen
            and not self._pins.read(self._reset_wire, now)
        )

    def sample(self, now: Nanos) -> tuple[bool, bool]:
        """Take a sample; tell whether the motor values and whether p2dx_con have changed."""
        motors, connect = self._motors.read(now), self._pins.read(self._connect_wire, now)
        self._seen = motors, connect
        return self._motors.take(motors), self._connect.take(connect, now)

    def reset(self) -> None:
        """Forget all samples."""
        self._seen = self._motors.at_rest, False
        self._motors.reset()
        self._connect.reset()


class Outputs(Stateful):
    """Writes levels to the pins, each change once."""

    STATE = ("_shown",)
    DERIVED = ("_counts",)

    def __init__(self, pins: AdapterPins, pinout: Pinout) -> None:
        self._pins = pins
        self._distances = pinout.with_role(WireRole.DISTANCE)
        self._encoders = tuple(
            tuple(pinout.wire(name) for name in pinout.value(value).wires) for value in ENCODER_VALUES
        )
        self._shown: dict[str, bool | None] = {wire.name: None for wire in self._distances}
        self._shown.update((wire.name, None) for wires in self._encoders for wire in wires)
        #: The counts whose codes the encoders' wires show; None: not known.
        self._counts: tuple[int, int] | None = None

    def release(self, now: Nanos) -> None:
        """Let every output follow its pull."""
        self._counts = None
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
        if counts == self._counts:
            return
        self._counts = counts
        for wires, count in zip(self._encoders, counts, strict=True):
            for bit, wire in enumerate(wires):
                self._write(wire.name, bool(count >> bit & 1), now)

    @property
    def levels(self) -> dict[str, bool | None]:
        """Return what each output shows; None is released."""
        return dict(self._shown)

    def _restored(self) -> None:
        self._counts = None

    def _write(self, name: str, level: bool | None, now: Nanos) -> None:
        if self._shown[name] is not level:
            self._shown[name] = level
            self._pins.write(name, level, now)


def released_codes(pinout: Pinout) -> tuple[int, int]:
    """Return the codes that the encoders' wires show while nobody drives them, left first."""
    left, right = (
        sum(pinout.wire(name).idle << bit for bit, name in enumerate(pinout.value(value).wires))
        for value in ENCODER_VALUES
    )
    return left, right


class SampleClock(Stateful):
    """The next sample instant.

    Args:
        period_ns: Between two samples.
        may_suspend: Whether settled inputs stay as they are until one of them has an edge.
    """

    STATE = ("next", "is_suspended")

    def __init__(self, period_ns: Nanos, *, may_suspend: bool = True) -> None:
        self._period_ns = period_ns
        self._may_suspend = may_suspend
        self.next: Nanos = 0
        #: Whether whoever runs the adapter brings it to every edge of the wires in `Adapter.wakes_on`: then settled
        #: pins are not sampled again until one comes.
        self.waits_for_edges = False
        self.is_suspended = False

    def after(self, now: Nanos) -> None:
        """Let the next sample come a period after `now`."""
        self.next = now + self._period_ns

    def was_quiet(self, now: Nanos) -> None:
        """Note that the sample at `now` changed nothing, and that later ones will not either without an edge."""
        self.after(now)
        self.suspend()

    def suspend(self) -> None:
        """Take no sample until the next edge, where somebody waits for edges: none would change anything."""
        self.is_suspended = self.waits_for_edges and self._may_suspend

    def resume(self, now: Nanos) -> None:
        """Go on from the first sample instant at or after `now`; those before would have changed nothing."""
        if self.is_suspended:
            self.is_suspended = False
            self.next += max(0, -((self.next - now) // self._period_ns)) * self._period_ns

    def due(self, other: Nanos) -> Nanos:
        """Return the earlier of the next sample that is taken and another deadline."""
        return other if self.is_suspended else min(self.next, other)


class SlidingWindow(Stateful):
    """The last readings, each some numbers, with what is taken of them, which a kind of window says."""

    STATE: ClassVar[tuple[str, ...]] = ("_window", "_same", "taken")

    def __init__(self, count: int, width: int = 1) -> None:
        self._count = count
        self.at_rest = self.taken = (0,) * width
        self._window = [self.at_rest] * count
        self._same = count

    @property
    def is_settled(self) -> bool:
        """Tell whether the window holds nothing but the reading taken."""
        return self._same >= self._count

    def take(self, reading: tuple[int, ...]) -> bool:
        """Add a sample; tell whether the reading taken has changed."""
        window = self._window
        self._same = self._same + 1 if reading == window[-1] else 1
        del window[0]
        window.append(reading)
        before, self.taken = self.taken, self._choose(window)
        return self.taken != before

    def reset(self) -> None:
        """Forget all samples, as if all numbers had always been 0."""
        self._window = [self.at_rest] * self._count
        self._same = self._count
        self.taken = self.at_rest

    def _choose(self, window: list[tuple[int, ...]]) -> tuple[int, ...]:
        """Return what is taken of a window whose last reading is new."""
        raise NotImplementedError


class Majority(SlidingWindow):
    """A sliding window with the reading that holds its majority."""

    def _choose(self, window: list[tuple[int, ...]]) -> tuple[int, ...]:
        # Only the newest reading can have gained a majority that it had not before.
        return window[-1] if 2 * window.count(window[-1]) > self._count else self.taken


class Median(SlidingWindow):
    """A sliding window with the median of each number of its readings."""

    def _choose(self, window: list[tuple[int, ...]]) -> tuple[int, ...]:
        return tuple(sorted(column)[self._count // 2] for column in zip(*window, strict=True))


class MotorBits(Majority):
    """The motor values in two's complement, one word of all wires."""

    def __init__(self, pins: AdapterPins, motors: Sequence[Value], settings: AdapterSettings) -> None:
        super().__init__(settings.sample_count)
        self._pins = pins
        self._bit_order: BitOrder = settings.bit_order
        self._widths = tuple(motor.width for motor in motors)
        #: Names of the wires that are looked at.
        self.wires = tuple(name for motor in motors for name in motor.wires)
        self._weights = tuple((name, 1 << bit) for bit, name in enumerate(self.wires))

    @property
    def values(self) -> tuple[int, int]:
        """Return the values taken."""
        word, values = self.taken[0], []
        for width in self._widths:
            values.append(motor_value(word & ((1 << width) - 1), width, self._bit_order))
            word >>= width
        return values[0], values[1]

    def read(self, now: Nanos) -> tuple[int, ...]:
        """Return what the wires show, as one word."""
        read, word = self._pins.read, 0
        for name, weight in self._weights:
            if read(name, now):
                word |= weight
        return (word,)


class MotorDuties(Median):
    """The motor values as signed duties; of each the first wire is measured, and the last is high for backward."""

    STATE = ("_duties",)

    def __init__(self, pins: AdapterPins, motors: Sequence[Value], settings: AdapterSettings) -> None:
        super().__init__(settings.sample_count, len(motors))
        self._pins = pins
        self._duties = duty_wires(pins, motors, settings)
        self._signs = tuple(motor.wires[-1] for motor in motors)
        #: Names of the wires that are looked at.
        self.wires = tuple(name for motor in motors for name in (motor.wires[0], motor.wires[-1]))

    @property
    def values(self) -> tuple[int, int]:
        """Return the values taken, of `FULL`."""
        left, right = self.taken
        return left, right

    def read(self, now: Nanos) -> tuple[int, ...]:
        """Return what the wires show."""
        read, duties = self._pins.read, [wire.duty(now) for wire in self._duties]
        return tuple(-duty if read(sign, now) else duty for duty, sign in zip(duties, self._signs, strict=True))


def duty_wires(pins: AdapterPins, motors: Sequence[Value], settings: AdapterSettings) -> tuple[DutyWire, ...]:
    """Return what measures the magnitude of each motor value."""
    return tuple(
        DutyWire(partial(pins.course, motor.wires[0]), timeout_ns=settings.duty_timeout_ns) for motor in motors
    )


class Debounce(Stateful):
    """A level that must last before it counts.

    Args:
        high_after_ns: High counts once seen for MORE than this.
        low_after_ns: Low counts once seen for this long.
    """

    STATE = ("level", "_raw", "_since")

    def __init__(self, high_after_ns: Nanos, low_after_ns: Nanos) -> None:
        self._high_after_ns = high_after_ns
        self._low_after_ns = low_after_ns
        self.level = False
        self._raw = False
        self._since: Nanos = 0

    @property
    def is_settled(self) -> bool:
        """Tell whether the level seen is the level that counts."""
        return self._raw == self.level

    def take(self, raw: bool, now: Nanos) -> bool:
        """Add a sample; tell whether the level that counts has changed."""
        if raw != self._raw:
            self._raw = raw
            self._since = now
        if raw == self.level:
            return False
        lasted = now - self._since
        if raw and lasted <= self._high_after_ns:
            return False
        if not raw and lasted < self._low_after_ns:
            return False
        self.level = raw
        return True

    def reset(self) -> None:
        """Count as low, whatever was seen."""
        self.level = False
        self._raw = False
