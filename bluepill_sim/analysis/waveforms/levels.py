"""Levels of signals over time, wherever they come from: a run, or a logic analyser.

Times are floats in nanoseconds: an analyser's sample need not be a whole number of them.

Invariant: the edges of a signal are in order of time, and each differs from the one before unless the level between
them was unknown.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from bluepill_sim.errors import BluePillError

#: A level that a file does not tell: x, or z of a pin that floats.
UNKNOWN = 2
#: (ns, level from then on, 0 or 1).
LevelEdge = tuple[float, int]


class CaptureError(BluePillError):
    """A file of waveforms that is none, is damaged, or cannot be laid beside a run."""

    exit_code = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """Levels of one signal."""

    #: Level at the start.
    first: int
    #: Changes from one known level to the other.
    edges: Sequence[LevelEdge]
    #: From when to when, in ns, the level is not known.
    unknown: Sequence[tuple[float, float]] = ()

    def is_unknown(self, ns: float, slack_ns: float) -> bool:
        """Return whether the level is not known within `slack_ns` of a time."""
        return any(begin - slack_ns <= ns <= end + slack_ns for begin, end in self.unknown)


@dataclass(frozen=True, slots=True, kw_only=True)
class Waveforms:
    """Signals by name over one stretch of time."""

    #: Of the file, for messages.
    name: str
    signals: Mapping[str, Signal]
    start_ns: float
    end_ns: float
    #: An edge at t was somewhere in (t - sample_ns, t].
    sample_ns: float
    #: Who says how long a sample is.
    rate_from: str = "the file"


def signal_of(changes: Iterable[tuple[float, int]], end_ns: float) -> Signal:
    """Return a signal by its levels in order of time, `UNKNOWN` among them; the first is that at the start.

    Of several levels at one instant the last counts.
    """
    first, level, since = UNKNOWN, UNKNOWN, None
    edges: list[LevelEdge] = []
    unknown: list[tuple[float, float]] = []
    for at, to in _last_of_each_instant(changes):
        if since is None:
            first, level, since = to, to, at
            continue
        if to == level:
            continue
        if level == UNKNOWN:
            unknown.append((since, at))
        elif to != UNKNOWN:
            edges.append((at, to))
        level, since = to, at
    if level == UNKNOWN:
        unknown.append((since or 0.0, end_ns))
    return Signal(first=first & 1, edges=edges, unknown=unknown)


def _last_of_each_instant(changes: Iterable[tuple[float, int]]) -> Iterable[tuple[float, int]]:
    held: tuple[float, int] | None = None
    for change in changes:
        if held is not None and change[0] > held[0]:
            yield held
        held = change
    if held is not None:
        yield held
