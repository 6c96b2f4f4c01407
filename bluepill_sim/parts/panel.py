"""What a person sees and touches: a push button that bounces, a row of LEDs, a potentiometer.

A button stands between its pin and one rail, a resistor of 10 kΩ between it and the other. *Chosen*: how often a
contact bounces: two to six times within its time, from a seed. Not modelled: currents and the brightness of LEDs; a
potentiometer's resistance.
Invariant: a button that is pressed twice with the same seed at the same times makes the same edges.

"""

import random
from collections.abc import Sequence
from typing import ClassVar

from bluepill_sim.fabric.signals import Oscillation, Waveform
from bluepill_sim.parts.attached import Change, Socket, Use
from bluepill_sim.parts.picture import Colour, Picture
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

#: chosen: edges of one bounce of a contact come in pairs, so many of them.
_LEAST_BOUNCES, _MOST_BOUNCES = 2, 6
MOST_LEDS = 8
_LIT, _DARK, _BETWEEN = (255, 60, 40), (60, 20, 16), (0, 0, 0)


class Button(Stateful):
    """A push button on one pin, `out`."""

    PINS: ClassVar = {"out": Use.HELD}
    STATE = ("presses", "_random", "_planned", "_free_ns")
    DERIVED = ("_socket",)

    def __init__(
        self, *, presses_s: tuple[float, ...] = (), held_s: float = 0.1, bounce_ms: float = 3.0,
        is_active_low: bool = True, seed: int = 0,
    ) -> None:  # fmt: skip
        """Make one.

        Args:
            presses_s: When somebody presses it.
            held_s: For how long each time.
            bounce_ms: How long a contact bounces; 0: it does not.
            is_active_low: Whether it pulls its pin low when it is pressed, else high.
            seed: Of its bounces.

        Raises:
            ValueError: A time is below 0, or a press begins before the one before it has ended.
        """
        self._held_ns, self._bounce_ns = round(held_s * NS_PER_S), round(bounce_ms * NS_PER_MS)
        self._is_active_low, self._random = is_active_low, random.Random(seed)
        if min(self._held_ns, self._bounce_ns) < 0 or self._held_ns < self._bounce_ns or not held_s > 0:
            raise ValueError(
                f"held for {held_s:g} s with {bounce_ms:g} ms of bounces: it is held longer than it bounces"
            )
        #: When it was and will be pressed.
        self.presses: list[Nanos] = []
        #: How many of them have begun.
        self._planned = 0
        self._free_ns: Nanos = 0
        self._socket: Socket | None = None
        for at_s in sorted(presses_s):
            self.press(round(at_s * NS_PER_S))

    def plug(self, socket: Socket) -> None:
        """Put the resistor on the pin."""
        socket.pin("out").drive(int(self._is_active_low), is_weak=True)
        self._socket = socket

    def press(self, at_ns: Nanos) -> None:
        """Press it at a time that is not before the end of the last press.

        Raises:
            ValueError: It is before it.
        """
        if at_ns < self._free_ns:
            raise ValueError(f"a press at {at_ns / NS_PER_S:g} s begins before {self._free_ns / NS_PER_S:g} s")
        self.presses.append(at_ns)
        self._free_ns = at_ns + self._held_ns + self._bounce_ns

    def next_deadline(self) -> Nanos | None:
        """Return when the next press begins."""
        return self.presses[self._planned] if self._planned < len(self.presses) else None

    def advance_to(self, now_ns: Nanos) -> None:
        """Make the edges of the press that is due."""
        at_ns = self.presses[self._planned]
        self._planned += 1
        if self._socket is None:
            return
        self._socket.note(now_ns, "pressed", f"for {self._held_ns / NS_PER_MS:g} ms")
        closed = [*self._bounces(at_ns, begins=True), *self._bounces(at_ns + self._held_ns, begins=False)]
        pin, active = self._socket.pin("out"), int(not self._is_active_low)
        pin.drive_later([(ns, active) for ns, is_closed in closed if is_closed])
        pin.drive_later([(ns, 1 - active) for ns, is_closed in closed if not is_closed], is_weak=True)

    def words(self) -> str:
        """Return how often it was pressed."""
        return f"pressed {self._planned} times"

    def _bounces(self, at_ns: Nanos, *, begins: bool) -> list[tuple[Nanos, bool]]:
        """Return when the contact closes and opens from a time on, until it stays as it is to be."""
        edges = [(at_ns, begins)]
        if self._bounce_ns:
            count = 2 * self._random.randint(_LEAST_BOUNCES, _MOST_BOUNCES)
            times = sorted(self._random.sample(range(1, self._bounce_ns + 1), min(count, self._bounce_ns // 2 * 2)))
            edges += [(at_ns + ns, begins is bool(n % 2)) for n, ns in enumerate(times)]
        return edges


class LedPanel(Stateful):
    """Up to eight LEDs, `led0` to `led7`, each between a pin and a rail."""

    PINS: ClassVar = {f"led{n}": Use.HEARD for n in range(MOST_LEDS)}
    STATE = ("_lit_since_ns", "_lit_ns", "changes")
    DERIVED = ("_socket",)

    def __init__(self, *, is_active_low: bool = False) -> None:
        """Make one whose LEDs shine while their pins are high, or low."""
        self._is_active_low = is_active_low
        #: Since when each LED shines, and how long it has shone before, ns.
        self._lit_since_ns: dict[str, Nanos] = {}
        self._lit_ns: dict[str, Nanos] = {}
        #: How often any of them has changed.
        self.changes = 0
        self._socket: Socket | None = None

    def plug(self, socket: Socket) -> None:
        """Look at the pins."""
        self._socket = socket
        for name in self.PINS:
            if socket.has(name):
                self._lit_ns[name] = 0

    def changed(self, rows: Sequence[Change]) -> None:
        """Switch LEDs."""
        for ns, name, level in rows:
            is_lit = level is not self._is_active_low
            if is_lit and name not in self._lit_since_ns:
                self._lit_since_ns[name] = ns
            elif not is_lit and name in self._lit_since_ns:
                self._lit_ns[name] += ns - self._lit_since_ns.pop(name)
            self.changes += 1

    def is_lit(self, name: str) -> bool:
        """Tell whether an LED shines now, such as "led0"."""
        return name in self._lit_since_ns

    def lit_ns(self, name: str) -> Nanos:
        """Return how long an LED has shone so far."""
        now_ns = self._socket.now_ns if self._socket is not None else 0
        return self._lit_ns[name] + (now_ns - self._lit_since_ns[name] if name in self._lit_since_ns else 0)

    def words(self) -> str:
        """Return which LEDs shine."""
        lit = ", ".join(name for name in self._lit_ns if self.is_lit(name))
        return f"{lit or 'no LED'} lit after {self.changes} changes"

    def picture(self) -> Picture:
        """Return the row of LEDs, each three dots wide."""
        row: list[Colour] = []
        for name in self._lit_ns:
            row += [_LIT if self.is_lit(name) else _DARK] * 3 + [_BETWEEN]
        return Picture((tuple(row[:-1]),) * 3)


class Potentiometer(Stateful):
    """A divider whose `wiper` is on a pin of the ADC."""

    PINS: ClassVar = {"wiper": Use.HELD}
    STATE = ("_position",)
    DERIVED = ("_socket",)

    def __init__(self, *, position: float = 0.5, sweep_s: float = 0.0, from_v: float = 0.0, to_v: float = 3.3) -> None:
        """Make one.

        Args:
            position: 0 at one end, 1 at the other.
            sweep_s: It is turned from one end to the other and back in so long, for ever; 0: it stands still.
            from_v: The volts at its end 0.
            to_v: The volts at its end 1.

        Raises:
            ValueError: A position beyond its ends, or a time below 0.
        """
        if not 0 <= position <= 1 or not sweep_s >= 0:
            raise ValueError(f"a position of {position} and {sweep_s} s: 0 to 1, and 0 or more")
        self._ends_v, self._sweep_ns = (from_v, to_v), round(sweep_s * NS_PER_S)
        self._position = position
        self._socket: Socket | None = None

    @property
    def position(self) -> float:
        """Where the wiper stands, 0 to 1; not while it sweeps.

        Raises:
            ValueError: Set beyond its ends.
        """
        return self._position

    @position.setter
    def position(self, position: float) -> None:
        if not 0 <= position <= 1:
            raise ValueError(f"a position of {position}: 0 to 1")
        self._position = position
        self._put()

    def plug(self, socket: Socket) -> None:
        """Put the volts on the pin."""
        self._socket = socket
        self._put()

    def words(self) -> str:
        """Return where it stands."""
        return "sweeps" if self._sweep_ns else f"at {100 * self._position:.0f} %"

    def _put(self) -> None:
        low, high = self._ends_v
        if self._socket is None:
            return
        pin = self._socket.pin("wiper")
        if self._sweep_ns:
            pin.set_volts(Oscillation(shape=Waveform.TRIANGLE, low_v=low, high_v=high, period_ns=self._sweep_ns))
        else:
            pin.set_volts(low + (high - low) * self._position)
