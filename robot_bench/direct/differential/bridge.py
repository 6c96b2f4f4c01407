"""An H-bridge: which part of a span of time it drives its motor forward, in reverse, brakes it, or lets it go.

Theory of operation. A pin is a level or a wave between its changes. Between two changes of any of a bridge's pins the
parts of the time follow in closed form where one of them has a wave, from whole ticks of the timer that makes it;
where several have (both inputs by PWM), from their edges. So nothing is sampled, and a span is exact to a nanosecond.
With a dead time a pin's rising edges come so much later.

Not modelled: shoot-through, the slope of edges, diodes (a motor that coasts has no current), and a limit of current.
Invariant: the parts are at least 0 and add up to 1.
"""

import ctypes
from collections.abc import Mapping, Sequence
from functools import partial
from struct import Struct
from typing import NamedTuple

from bluepill_sim.fabric.subscriptions import Wave
from robot_bench.direct.differential.description import BridgeDescription, BridgeKind, Off
from robot_bench.direct.differential.native import COMBINATIONS, BridgeStruct, functions
from robot_bench.wires.nets import Net
from simbase.state import Stateful
from simbase.timing import Nanos


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
#: A change, as bridge.h has it.
_CHANGE = Struct("=7q").pack
#: What a pin does from a time on.
_Piece = tuple[Nanos, bool | Wave]


class HBridge(Stateful):
    """One motor's bridge; `nets` are its pins, in the order of `BridgeKind.pins`."""

    #: What is known follows from the nets.
    DERIVED = ("_is_steady", "_changed")

    def __init__(self, nets: Sequence[Net], settings: BridgeDescription) -> None:
        self._nets = tuple(nets)
        self._dead_ns = settings.dead_time_ns
        off = _BRAKE if settings.off is Off.BRAKE else _OFF
        does = [off] * COMBINATIONS
        for levels, action in TRUTH[settings.kind].items():
            does[sum(level << place for place, level in enumerate(levels))] = action
        self._struct = BridgeStruct(len(self._nets), self._dead_ns, tuple(does))
        self._struct_at, self._pass = ctypes.addressof(self._struct), functions().bridge_pass
        #: Where C finds its shares.
        self.address = self._struct_at + BridgeStruct.shares.offset
        self._is_steady = False
        #: The places of pins that may do something else since the last span.
        self._changed: set[int] = set()
        self._restored()
        for place, net in enumerate(self._nets):
            net.watch(partial(self._note_drive, place))

    def shares(self, begin: Nanos, end: Nanos) -> Shares:
        """Return what it does from `begin` until before `end`, where the last span ended; the nets know all of it."""
        self.take(begin, end)
        return self.known

    @property
    def known(self) -> Shares:
        """The shares of the last span."""
        return Shares(*self._struct.shares)

    def take(self, begin: Nanos, end: Nanos) -> None:
        """Work out what `shares` returns, where C reads it."""
        if self._is_steady:
            return
        changes: list[tuple[int, ...]] = []
        for place in self._changed:
            changes += [
                (at, place, 0, 0, 0, what, 0) if what is True or what is False
                else (at, place, what.ns, what.at, what.period, what.high, what.ticks_hz)
                for at, what in self._course(place, begin, end)
            ]  # fmt: skip
        changes.sort()
        is_whole = self._pass(self._struct_at, b"".join([_CHANGE(*one) for one in changes]), len(changes), begin, end)
        has_changed = len(changes) > len(self._changed)
        # What is known already of the time after the end was not looked at, nor how a dead time goes on.
        alive = end - self._dead_ns
        self._changed = {place for place in self._changed if self._nets[place].last_edge >= alive}
        # So it goes on, where nobody drives a pin anew and whole periods fit.
        self._is_steady = bool(is_whole) and not has_changed and not self._changed

    def _course(self, place: int, begin: Nanos, end: Nanos) -> list[_Piece]:
        course = self._nets[place].course(begin - self._dead_ns, end)
        return _delayed(course, self._dead_ns, begin, end) if self._dead_ns else course

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
