"""What the adapter saw and drove on each wire, with times: a logic analyser at its pins.

A `Waveforms` stands between an adapter and its pin bank. Inputs show the instants at
which the adapter looked (a glitch between two samples does not show: it was not
seen), outputs the instants at which it drove.
"""

from bisect import bisect_right
from collections.abc import Sequence

from adapter_sim.pins import PinBank
from simbase.errors import UsageError
from simbase.timing import NS_PER_MS, Nanos

#: Each change: from when on, and the level; None is released.
Edges = list[tuple[Nanos, bool | None]]
_PICTURES = {True: "#", False: "_", None: "."}


class Waveforms:
    """A pin bank that remembers."""

    def __init__(self, pins: PinBank) -> None:
        self._pins = pins
        self._edges: dict[str, Edges] = {}

    def read(self, signal: str, at: Nanos) -> bool:
        """Return the level of a wire, and note it."""
        level = self._pins.read(signal, at)
        self._note(signal, at, level)
        return level

    def write(self, signal: str, high: bool | None, now: Nanos) -> None:
        """Drive a wire, and note it."""
        self._note(signal, now, high)
        self._pins.write(signal, high, now)

    @property
    def signals(self) -> tuple[str, ...]:
        """Return the wires that were touched, by name."""
        return tuple(sorted(self._edges))

    def edges(self, signal: str) -> Edges:
        """Return every change of a wire, oldest first; nothing for one that was never touched."""
        return list(self._edges.get(signal, ()))

    def level(self, signal: str, at: Nanos) -> bool | None:
        """Return the level as last seen or driven at `at`; None is released, or not yet known."""
        edges = self._edges.get(signal, [])
        place = bisect_right(edges, at, key=lambda edge: edge[0])
        return edges[place - 1][1] if place else None

    def picture(self, signals: Sequence[str], *, start: Nanos, end: Nanos, step_ns: Nanos = NS_PER_MS) -> str:
        """Return the wires as text, a line each: # high, _ low, . released or unknown.

        Raises:
            UsageError: There is nothing between start and end, or no step.
        """
        if end <= start or step_ns <= 0:
            raise UsageError(f"nothing to draw from {start} to {end} ns in steps of {step_ns} ns")
        width = max(map(len, signals), default=0)
        lines = []
        for signal in signals:
            levels = (self.level(signal, at) for at in range(start, end, step_ns))
            lines.append(f"{signal:<{width}}  {''.join(_PICTURES[level] for level in levels)}\n")
        return "".join(lines)

    def _note(self, signal: str, at: Nanos, level: bool | None) -> None:
        edges = self._edges.setdefault(signal, [])
        if not edges or edges[-1][1] is not level:
            edges.append((at, level))
