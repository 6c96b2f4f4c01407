"""Volts on pins as functions of time: what the outside of a chip gives its ADCs.

A signal is worked out in C at the instant of sampling (`extension/source/fabric/analog.c`), in integers of
microvolts and nanoseconds; here it is described in volts.
Invariant: what a signal is at a time depends on its description and its start alone.
"""

import math
from array import array
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, TypeAlias

from simbase.timing import Nanos

if TYPE_CHECKING:
    from bluepill_sim.fabric.fabric import Fabric

UV_PER_V = 1_000_000
#: What 31 bits of microvolts hold, so that a span of them has 32.
_MOST_V = 1000
#: Numbers of shapes in analog.c that are no `Waveform`.
_CONSTANT, _SAMPLES, _HELD = 1, 6, 7


class Waveform(Enum):
    """What an oscillation does in a period; it begins in the middle (sine) or at its low end."""

    SINE = 2
    #: Up in the first half of the period, down in the second.
    TRIANGLE = 3
    #: Up through the whole period.
    SAWTOOTH = 4
    #: High first, for `high_ns`.
    SQUARE = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Oscillation:
    """Volts that go up and down for ever."""

    shape: Waveform
    low_v: float
    high_v: float
    #: At least 1.
    period_ns: Nanos
    #: Where in its period it begins, less than that.
    phase_ns: Nanos = 0
    #: Of a square wave; None is half of the period.
    high_ns: Nanos | None = None

    def __post_init__(self) -> None:
        """Refuse what is no oscillation.

        Raises:
            ValueError: Times or volts are out of their ranges.
        """
        if self.period_ns < 1 or not 0 <= self.phase_ns < self.period_ns:
            raise ValueError(f"no oscillation of {self.period_ns} ns that begins at {self.phase_ns} ns")
        if self.high_ns is not None and not 0 <= self.high_ns <= self.period_ns:
            raise ValueError(f"high for {self.high_ns} ns of {self.period_ns} ns")
        to_uv(self.low_v)
        to_uv(self.high_v)

    @property
    def most_v(self) -> float:
        """The highest volts."""
        return max(self.low_v, self.high_v)


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """Volts that were recorded, at a fixed rate; between two of them they lie on a line."""

    #: At least one.
    volts: tuple[float, ...]
    #: From one to the next, at least 1.
    interval_ns: Nanos
    #: Whether the first follows the last, else the last one stays.
    is_repeated: bool = False
    #: Whether each one stays until the next.
    is_held: bool = False

    def __post_init__(self) -> None:
        """Refuse what is no signal.

        Raises:
            ValueError: There is no sample, no interval, or volts are out of their range.
        """
        if not self.volts or self.interval_ns < 1:
            raise ValueError(f"{len(self.volts)} samples every {self.interval_ns} ns are no signal")
        for one in self.volts:
            to_uv(one)

    @property
    def most_v(self) -> float:
        """The highest volts."""
        return max(self.volts)


Signal: TypeAlias = Oscillation | Samples


def to_uv(volts: float) -> int:
    """Return volts as a whole number of microvolts.

    Raises:
        ValueError: They are no number, or 1000 V or more either way.
    """
    if not math.isfinite(volts) or abs(volts) >= _MOST_V:
        raise ValueError(f"{volts} V on a pin")
    return round(volts * UV_PER_V)


def put_signal(fabric: "Fabric", channel: int, signal: Signal | int | None, now_ns: Nanos) -> None:
    """Have the pin of an ADC channel show a signal from now on, a constant in microvolts, or its logic level (None)."""
    struct = fabric.analog_struct.signals[channel]
    fabric.set_samples(channel, b"")
    struct.start_ns, struct.phase_ns, struct.is_repeated, struct.shape = now_ns, 0, 1, 0
    if isinstance(signal, int):
        struct.low_uv, struct.shape = signal, _CONSTANT
    elif isinstance(signal, Samples):
        fabric.set_samples(channel, array("i", map(to_uv, signal.volts)).tobytes())
        struct.count, struct.interval_ns = len(signal.volts), signal.interval_ns
        struct.period_ns = signal.interval_ns * len(signal.volts)
        struct.is_repeated, struct.shape = signal.is_repeated, _HELD if signal.is_held else _SAMPLES
    elif signal is not None:
        struct.low_uv, struct.high_uv = to_uv(signal.low_v), to_uv(signal.high_v)
        struct.period_ns, struct.phase_ns = signal.period_ns, signal.phase_ns
        struct.interval_ns = signal.period_ns // 2 if signal.high_ns is None else signal.high_ns
        struct.shape = signal.shape.value
