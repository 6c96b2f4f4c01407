"""HC-SR04: an ultrasonic distance sensor with a trigger and an echo.

A pulse of 10 µs on `trig` has it send eight periods of 40 kHz; then `echo` goes high until the sound has come back,
or for 38 ms where it does not. What it does meanwhile on `trig` is ignored.

Modelled: the least length of the trigger, the delay before the echo, the speed of sound by the temperature, its cone,
2 cm to 4 m, 5 V at `echo`. *Chosen*: 450 µs from the end of the trigger to the echo (as modules of the kind take);
what is nearer than 2 cm reads as 2 cm. Not modelled: noise, echoes of an earlier pulse, surfaces that throw no sound
back, the height of things.
Source: HC-SR04 user's manual (Elecfreaks, v1.0), "Electric parameter" and "Timing diagram".
Invariant: an echo is as long as the sound takes to the distance and back, to the nanosecond.

"""

import math
from collections.abc import Sequence
from typing import ClassVar

from bluepill_sim.fabric.pins import overvoltage
from bluepill_sim.parts.attached import Change, Socket, Use
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

TRIGGER_NS: Nanos = 10_000
#: chosen: from the trigger's falling edge to the echo's rising one.
BURST_NS: Nanos = 450_000
NO_ECHO_NS: Nanos = 38 * NS_PER_MS
NEAREST_M, FARTHEST_M = 0.02, 4.0
#: "Measuring angle: 15 degree".
CONE_RAD = math.radians(15)
#: m/s at 0 °C, and more a degree.
_SOUND_MPS, _SOUND_MPS_PER_C = 331.3, 0.606


def echo_ns(distance_m: float, temperature_c: float) -> Nanos:
    """Return how long sound takes to a distance and back."""
    return round(2 * distance_m / (_SOUND_MPS + _SOUND_MPS_PER_C * temperature_c) * NS_PER_S)


class HcSr04(Stateful):
    """An ultrasonic distance sensor."""

    PINS: ClassVar = {"trig": Use.WATCHED, "echo": Use.HELD}
    STATE = ("distance_m", "measured", "_high_since_ns", "_busy_until_ns")
    DERIVED = ("_socket",)

    def __init__(
        self, *, distance_m: float | None = None, temperature_c: float = 20.0, x_m: float = 0.0, y_m: float = 0.0,
        heading_deg: float = 0.0, echo_v: float = 5.0,
    ) -> None:  # fmt: skip
        """Make one.

        Args:
            distance_m: What stands before it; None looks into the world.
            temperature_c: Of the air.
            x_m: Where it sits, forward of the middle of the axle.
            y_m: The same, to the left.
            heading_deg: Where it looks, counter-clockwise from ahead.
            echo_v: The volts of `echo`; 3.3 behind a divider.

        Raises:
            ValueError: A distance below 0, a temperature that is none of air, or no volts.
        """
        if distance_m is not None and not distance_m >= 0:
            raise ValueError(f"a distance of {distance_m} m")
        if not -40 <= temperature_c <= 80 or not 0 < echo_v <= 5.5:
            raise ValueError(f"{temperature_c} degrees and {echo_v} V: -40 to 80, and up to 5.5 V")
        #: What stands before it, metres; None looks into the world.
        self.distance_m = distance_m
        #: How often it has measured.
        self.measured = 0
        self._temperature_c, self._echo_v = temperature_c, echo_v
        self._place = (x_m, y_m, math.radians(heading_deg))
        self._high_since_ns: Nanos | None = None
        self._busy_until_ns: Nanos = 0
        self._socket: Socket | None = None

    def plug(self, socket: Socket) -> None:
        """Take both pins."""
        socket.pin("trig")
        echo = socket.pin("echo")
        if (complaint := overvoltage(echo, self._echo_v)) is not None:
            socket.warn(f"{socket.name}: {complaint}; a divider makes 3.3 V of it: echo_v=3.3")
        echo.drive(0)
        self._socket = socket

    def changed(self, rows: Sequence[Change]) -> None:
        """Measure at the end of each trigger."""
        for ns, _pin, level in rows:
            if level:
                self._high_since_ns = ns
                continue
            since_ns, self._high_since_ns = self._high_since_ns, None
            if since_ns is not None and ns - since_ns >= TRIGGER_NS and ns >= self._busy_until_ns:
                self._measure(ns)

    def words(self) -> str:
        """Return what it has done."""
        return f"{self.measured} measurements"

    def _measure(self, at_ns: Nanos) -> None:
        socket = self._socket
        if socket is None:
            return
        metres = self.distance_m
        if metres is None:
            metres = socket.surroundings.range_m(*self._place, CONE_RAD, FARTHEST_M)
        has_echo = metres < FARTHEST_M
        width_ns = echo_ns(max(metres, NEAREST_M), self._temperature_c) if has_echo else NO_ECHO_NS
        begin_ns = at_ns + BURST_NS
        self._busy_until_ns = begin_ns + width_ns
        self.measured += 1
        socket.pin("echo").drive_later([(begin_ns, 1), (begin_ns + width_ns, 0)])
