"""An H-bridge: which part of a span of time it drives its motor forward, in reverse, brakes it, or lets it go.

Theory of operation. A pin is a level or a wave between its changes. Between two changes of any of a bridge's pins the
parts of the time follow in closed form where one of them has a wave, from whole ticks of the timer that makes it;
where several have (both inputs by PWM), from their edges. So nothing is sampled, and a span is exact to a nanosecond.
With a dead time a pin's rising edges come so much later.

Not modelled: shoot-through, the slope of edges, diodes (a motor that coasts has no current), and a limit of current.
Invariant: the parts are at least 0 and add up to 1.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from operator import itemgetter
from typing import NamedTuple, cast

from bluepill_sim.fabric.subscriptions import Wave
from robot_bench.direct.differential.description import BridgeDescription, BridgeKind, Off
from robot_bench.wires.nets import Net
from robot_bench.wires.waves import edge_times, high_time_ns
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
    DERIVED = ("_known", "_is_steady", "_now", "_changed")

    def __init__(self, nets: Sequence[Net], settings: BridgeDescription) -> None:
        self._nets = tuple(nets)
        self._dead_ns = settings.dead_time_ns
        truth = TRUTH[settings.kind]
        off = _BRAKE if settings.off is Off.BRAKE else _OFF
        self._truth = {levels: off if does == _OFF else does for levels, does in truth.items()}
        self._off = off
        self._known = Shares(0.0, 0.0, 0.0)
        self._is_steady = False
        #: What each pin does at the end of the last span, and the places of those that may do something else since.
        self._now: list[bool | Wave] = [False] * len(self._nets)
        self._changed: set[int] = set()
        self._restored()
        for place, net in enumerate(self._nets):
            net.watch(partial(self._note_drive, place))

    def shares(self, begin: Nanos, end: Nanos) -> Shares:
        """Return what it does from `begin` until before `end`, where the last span ended; the nets know all of it."""
        if self._is_steady:
            return self._known
        now, changes = self._now, []
        for place in self._changed:
            first, *others = self._course(place, begin, end)
            now[place] = first[1]
            changes += [(at, place, what) for at, what in others]
        times, last = [0.0, 0.0, 0.0, 0.0], begin
        for at, place, what in sorted(changes, key=itemgetter(0, 1)):
            self._add(times, last, at)
            now[place], last = what, at
        self._add(times, last, end)
        span = end - begin
        self._known = Shares(times[0] / span, times[1] / span, times[2] / span)
        # What is known already of the time after the end was not looked at, nor how a dead time goes on.
        alive = end - self._dead_ns
        self._changed = {place for place in self._changed if self._nets[place].last_edge >= alive}
        # So it goes on, where nobody drives a pin anew and whole periods fit.
        self._is_steady = not changes and not self._changed and all(
            what is True or what is False or span * what.ticks_hz % (what.period * NS_PER_S) == 0 for what in now
        )  # fmt: skip
        return self._known

    def _course(self, place: int, begin: Nanos, end: Nanos) -> list[_Piece]:
        course = self._nets[place].course(begin - self._dead_ns, end)
        return _delayed(course, self._dead_ns, begin, end) if self._dead_ns else course

    def _add(self, times: list[float], begin: Nanos, end: Nanos) -> None:
        """Add a span in which no pin changes what it does."""
        if begin == end:
            return
        now, truth = self._now, self._truth
        waves = [place for place, what in enumerate(now) if what is not True and what is not False]
        if not waves:
            times[truth.get(tuple(now), self._off)] += end - begin  # type: ignore[arg-type]  # levels all
        elif len(waves) == 1:
            wave = cast("Wave", now[waves[0]])
            high_ns = high_time_ns(wave, begin, end, self._dead_ns)
            low, high = ((*now[: waves[0]], level, *now[waves[0] + 1 :]) for level in (False, True))
            times[truth.get(high, self._off)] += high_ns  # type: ignore[arg-type]  # as above
            times[truth.get(low, self._off)] += (end - begin) - high_ns  # type: ignore[arg-type]  # as above
        else:
            for levels, ns in _walked(now, begin, end, self._dead_ns).items():
                times[truth.get(levels, self._off)] += ns

    def _note_drive(self, place: int, _net: Net, _owner: str, _at: Nanos) -> None:
        self._is_steady = False
        self._changed.add(place)

    def _restored(self) -> None:
        self._is_steady = False
        self._changed = set(range(len(self._nets)))


def _delayed(course: Sequence[_Piece], dead_ns: int, begin: Nanos, end: Nanos) -> list[_Piece]:
    """Return what acts from `begin` until before `end`, where each rising edge comes later."""
    ends = [at for at, _ in course[1:]]
    found: list[_Piece] = []
    for place, (at, what) in enumerate(course):
        is_late = what is True and place > 0 and course[place - 1][1] is False
        from_ns = at + dead_ns if is_late else at
        if from_ns >= (ends[place] if place < len(ends) else end):
            continue
        if from_ns > begin and not found:
            found.append((begin, False))
        if from_ns <= begin:
            found = [(begin, what)]
        else:
            found.append((from_ns, what))
    return found


def _walked(now: Sequence[bool | Wave], begin: Nanos, end: Nanos, dead_ns: int) -> Counter[tuple[bool, ...]]:
    """Return for how long, in ns, each combination of the pins' levels is there, from edge to edge."""
    found: Counter[tuple[bool, ...]] = Counter()
    edges = {at for what in now if isinstance(what, Wave) for at in edge_times(what, begin, end, dead_ns)}
    for first, last in pairwise([begin, *sorted(edges - {begin}), end]):
        found[tuple(_level(what, first, dead_ns) if isinstance(what, Wave) else what for what in now)] += last - first
    return found


def _level(wave: Wave, at: Nanos, dead_ns: int) -> bool:
    """Return a wave's level where its rising edges come later: high now, and at every time since `dead_ns` ago."""
    if not wave.level(max(at, wave.ns)):
        return False
    ticks = wave.at + ((at - wave.ns + 1) * wave.ticks_hz - 1) // NS_PER_S
    risen = wave.ns + (ticks // wave.period * wave.period - wave.at) * NS_PER_S // wave.ticks_hz
    return at >= risen + dead_ns
