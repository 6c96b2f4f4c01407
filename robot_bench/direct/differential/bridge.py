"""An H-bridge: which part of a span of time it drives its motor forward, in reverse, brakes it, or lets it go.

Theory of operation. A pin is a level or a wave between its changes. Between two changes of any of a bridge's pins the
parts of the time follow in closed form where one of them has a wave, from whole ticks of the timer that makes it;
where several have (both inputs by PWM), from their edges. So nothing is sampled, and a span is exact to a nanosecond.
With a dead time a pin's rising edges come so much later.

Not modelled: shoot-through, the slope of edges, diodes (a motor that coasts has no current), and a limit of current.
Invariant: the parts are at least 0 and add up to 1.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from bluepill_sim.fabric.subscriptions import Wave
from robot_bench.direct.differential.description import Bridge, BridgeKind, Off
from robot_bench.wires.nets import Net
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos


class Shares(NamedTuple):
    """Parts of a span; what is left of 1 the motor coasts."""

    forward: float
    reverse: float
    brake: float


_FORWARD, _REVERSE, _BRAKE, _OFF = range(4)
#: What a bridge does by the levels of its pins, in the order of `BridgeKind.pins`; what is not here is off.
TRUTH: Mapping[BridgeKind, Mapping[tuple[bool, ...], int]] = {
    BridgeKind.IN1_IN2_PWM: {
        (True, False, True): _FORWARD,
        (False, True, True): _REVERSE,
        (True, True, True): _BRAKE,
        (True, True, False): _BRAKE,
    },
    BridgeKind.PWM_DIR: {(True, True): _FORWARD, (True, False): _REVERSE},
    BridgeKind.TWO_PWM: {(True, False): _FORWARD, (False, True): _REVERSE, (True, True): _BRAKE},
}
#: What a pin does from a time on.
_Piece = tuple[Nanos, bool | Wave]


class HBridge(Stateful):
    """One motor's bridge; `nets` are its pins, in the order of `BridgeKind.pins`."""

    #: What is known follows from the nets.
    DERIVED = ("_known", "_is_steady")

    def __init__(self, nets: Sequence[Net], settings: Bridge) -> None:
        self._nets = tuple(nets)
        self._dead_ns = settings.dead_time_ns
        truth = TRUTH[settings.kind]
        off = _BRAKE if settings.off is Off.BRAKE else _OFF
        self._truth = {levels: off if does == _OFF else does for levels, does in truth.items()}
        self._off = off
        self._known = Shares(0.0, 0.0, 0.0)
        self._is_steady = False
        for net in self._nets:
            net.watch(self._note_drive)

    def shares(self, begin: Nanos, end: Nanos) -> Shares:
        """Return what it does from `begin` until before `end`; the nets must know all of that time."""
        if self._is_steady:
            return self._known
        courses = [_delayed(net.course(begin - self._dead_ns, end), self._dead_ns, begin) for net in self._nets]
        times = [0.0, 0.0, 0.0, 0.0]
        cuts = sorted({at for course in courses for at, _ in course} | {end})
        for first, last in pairwise(cuts):
            now = [next(what for at, what in reversed(course) if at <= first) for course in courses]
            for levels, ns in _times(now, first, last, self._dead_ns).items():
                times[self._truth.get(levels, self._off)] += ns
        span = end - begin
        self._known = Shares(*(ns / span for ns in times[:3]))
        # So it goes on, where nobody drives a pin anew and whole periods fit.
        self._is_steady = len(cuts) == 2 and all(net.last_edge <= begin - self._dead_ns for net in self._nets)
        self._is_steady = self._is_steady and all(
            not isinstance(course[0][1], Wave) or span * course[0][1].ticks_hz % (course[0][1].period * NS_PER_S) == 0
            for course in courses
        )
        return self._known

    def _note_drive(self, _net: Net, _owner: str, _at: Nanos) -> None:
        self._is_steady = False

    def _restored(self) -> None:
        self._is_steady = False


def _delayed(course: Sequence[_Piece], dead_ns: int, begin: Nanos) -> list[_Piece]:
    """Return what acts from `begin` on, where each rising edge comes later."""
    ends = [at for at, _ in course[1:]]
    found: list[_Piece] = []
    for place, (at, what) in enumerate(course):
        is_late = what is True and place > 0 and course[place - 1][1] is False
        from_ns = at + dead_ns if is_late else at
        if place < len(ends) and from_ns >= ends[place]:
            continue
        if from_ns > begin and not found:
            found.append((begin, False))
        if from_ns <= begin:
            found = [(begin, what)]
        else:
            found.append((from_ns, what))
    return found


def _times(now: Sequence[bool | Wave], begin: Nanos, end: Nanos, dead_ns: int) -> dict[tuple[bool, ...], float]:
    """Return for how long, in ns, each combination of the pins' levels is there."""
    places = [place for place, what in enumerate(now) if isinstance(what, Wave)]
    if not places:
        return {tuple(bool(what) for what in now): float(end - begin)}
    if len(places) == 1:
        wave = now[places[0]]
        high_ns = high_time_ns(wave, begin, end, dead_ns) if isinstance(wave, Wave) else 0.0
        low, high = (
            tuple(level if place == places[0] else bool(what) for place, what in enumerate(now))
            for level in (False, True)
        )
        return {high: high_ns, low: (end - begin) - high_ns}
    found: Counter[tuple[bool, ...]] = Counter()
    edges = {at for what in now if isinstance(what, Wave) for at in edge_times(what, begin, end, dead_ns)}
    for first, last in pairwise([begin, *sorted(edges - {begin}), end]):
        found[tuple(_level(what, first, dead_ns) if isinstance(what, Wave) else what for what in now)] += last - first
    return {levels: float(ns) for levels, ns in found.items()}


def high_time_ns(wave: Wave, begin: Nanos, end: Nanos, dead_ns: int = 0) -> float:
    """Return for how long a wave is high between two times, its rising edges so much later.

    By fractions of a tick of 10**-9, in integers; one division at the end.
    """
    period, dead = wave.period * NS_PER_S, min(dead_ns * wave.ticks_hz, wave.high * NS_PER_S)
    high = wave.high * NS_PER_S - dead

    def until(ns: Nanos) -> int:
        whole, part = divmod(wave.at * NS_PER_S + (ns - wave.ns) * wave.ticks_hz - dead, period)
        return whole * high + min(part, high)

    return (until(end) - until(begin)) / wave.ticks_hz


def edge_times(wave: Wave, begin: Nanos, end: Nanos, dead_ns: int = 0) -> Iterator[Nanos]:
    """Yield the times from `begin` until before `end` at which a wave changes, its rising edges so much later."""
    first = wave.at + (begin - dead_ns - wave.ns) * wave.ticks_hz // NS_PER_S
    for turn in range(first // wave.period, (wave.at + (end - wave.ns) * wave.ticks_hz // NS_PER_S) // wave.period + 1):
        for ticks, later in ((turn * wave.period, dead_ns), (turn * wave.period + wave.high, 0)):
            at = wave.ns + (ticks - wave.at) * NS_PER_S // wave.ticks_hz + later
            if begin <= at < end:
                yield at


def _level(wave: Wave, at: Nanos, dead_ns: int) -> bool:
    """Return a wave's level where its rising edges come later: high now, and at every time since `dead_ns` ago."""
    if not wave.level(max(at, wave.ns)):
        return False
    ticks = wave.at + ((at - wave.ns + 1) * wave.ticks_hz - 1) // NS_PER_S
    risen = wave.ns + (ticks // wave.period * wave.period - wave.at) * NS_PER_S // wave.ticks_hz
    return at >= risen + dead_ns
