"""Wires between parts: who drives them, how strongly, and which level results when.

A net keeps, for each owner, the drives that are still of interest, each with
its time stamp. So a part that stands behind the others in time still reads the
level of its own instant. Edges are forgotten when `forget_before` states that
every part has passed them.

Not modelled: voltages, capacitance and edge times. A drive is a level and a
strength; a value in volts would be one more field of `Drive`.

Invariant: `level(at)` depends on the drives stamped at or before `at` only, not
on the order in which different owners reported them.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum

from p2os.errors import LocalProtocolError
from simbase.state import Stateful
from simbase.timing import Nanos
from simbase.wire import are_fighting, level_of


class Strength(Enum):
    """How an owner holds a wire."""

    #: Both levels are driven hard.
    PUSH_PULL = "push-pull"
    #: Low is driven hard, high lets go.
    OPEN_DRAIN = "open drain"
    #: A resistor; yields to anything driven hard.
    PULL = "pull"
    #: Not at all.
    FLOATING = "floating"


@dataclass(frozen=True, slots=True)
class Drive:
    """What one owner does to a wire."""

    level: bool
    strength: Strength


RELEASED = Drive(level=False, strength=Strength.FLOATING)

#: (net, owner of the new drive, ns from which it holds).
Watcher = Callable[["Net", str, Nanos], None]


@dataclass(frozen=True, slots=True)
class Contention:
    """Two owners drove a wire hard against each other."""

    at: Nanos
    net: str
    owners: tuple[str, ...]


class Net(Stateful):
    """One wire.

    Args:
        name: As in pinout.toml.
        idle: The level that is read while nobody holds the wire.
    """

    STATE = (
        "_drives", "_last_level", "last_edge", "_notified_until", "_notified_level", "_notified_contention",
        "_contentions",
    )  # fmt: skip
    #: Who listens is settled when a bench is built.
    DERIVED = ("_watchers",)

    def __init__(self, name: str, *, idle: bool = False) -> None:
        self.name = name
        self.idle = idle
        self._drives: dict[str, list[tuple[Nanos, Drive]]] = {}
        self._watchers: list[Watcher] = []
        #: The time of the last drive known so far, and the level after it.
        self._last_level = idle
        self.last_edge: Nanos = 0
        #: Level and fighting owners at the end of what `edges_until` has returned.
        self._notified_until: Nanos = -1
        self._notified_level = idle
        self._notified_contention: tuple[str, ...] = ()
        self._contentions: list[Contention] = []

    def drive(self, owner: str, level: bool, strength: Strength, now: Nanos) -> None:
        """Hold the wire from `now` on; it replaces what the same owner did before.

        Raises:
            LocalProtocolError: `owner` has already reported something later, or the edges of that instant were told.
        """
        history = self._drives.setdefault(owner, [])
        new = Drive(level, strength) if strength is not Strength.FLOATING else RELEASED
        if history:
            last_at, last = history[-1]
            if now < last_at:
                raise LocalProtocolError(
                    f"{owner} drives {self.name} at {now} ns after having driven it at {last_at} ns"
                )
            if last == new:
                return
        if now <= self._notified_until:
            raise LocalProtocolError(
                f"{owner} drives {self.name} at {now} ns after its edges up to {self._notified_until} ns were told"
            )
        if history and history[-1][0] == now:
            history.pop()
        history.append((now, new))
        self.last_edge = max(self.last_edge, now)
        self._last_level = self._resolve(self.last_edge)
        for watcher in self._watchers:
            watcher(self, owner, now)

    def release(self, owner: str, now: Nanos) -> None:
        """Let the wire go from `now` on."""
        self.drive(owner, False, Strength.FLOATING, now)

    def level(self, at: Nanos) -> bool:
        """Return the level at the instant `at`, an edge at `at` included."""
        return self._last_level if at >= self.last_edge else self._resolve(at)

    def level_without(self, owner: str, at: Nanos) -> tuple[bool | None, bool]:
        """Return what everybody but `owner` puts on the wire, None where nobody holds it, and whether it is hard."""
        others = [_at(history, at) for name, history in self._drives.items() if name != owner]
        return _resolved(others), any(map(_is_hard, others))

    def drive_of(self, owner: str, at: Nanos) -> Drive:
        """Return what `owner` does to the wire at the instant `at`."""
        return _at(self._drives.get(owner, []), at)

    def watch(self, watcher: Watcher) -> None:
        """Call `watcher` at each new drive, whether or not it changes the level, in the order of telling."""
        self._watchers.append(watcher)

    def edges_until(self, limit: Nanos) -> list[tuple[Nanos, bool]]:
        """Return the changes of level at or before `limit` that were not returned before, oldest first."""
        times = {at for history in self._drives.values() for at, _ in history if self._notified_until < at <= limit}
        self._notified_until = max(self._notified_until, limit)
        found, level = [], self._notified_level
        for at in sorted(times):
            now = self._resolve(at)
            if now != level:
                found.append((at, now))
                level = now
            fight = self._fight(at)
            if fight and fight != self._notified_contention:
                self._contentions.append(Contention(at, self.name, fight))
            self._notified_contention = fight
        self._notified_level = level
        return found

    def take_contentions(self) -> list[Contention]:
        """Return the contentions that `edges_until` has come across, and forget them."""
        found, self._contentions = self._contentions, []
        return found

    def forget_before(self, limit: Nanos) -> bool:
        """Drop what no reader at or after `limit` can see; return True where later drives are still remembered."""
        later = False
        for history in self._drives.values():
            del history[: bisect_right(history, limit, lo=1, key=_time_of) - 1]
            later = later or history[-1][0] > limit
        return later

    def _resolve(self, at: Nanos) -> bool:
        level = _resolved([_at(history, at) for history in self._drives.values()])
        return self.idle if level is None else level

    def _fight(self, at: Nanos) -> tuple[str, ...]:
        """Return who drives hard against whom at the instant `at`; empty in peace."""
        hard = {name: _at(history, at) for name, history in self._drives.items() if _is_hard(_at(history, at))}
        return tuple(sorted(hard)) if are_fighting([drive.level for drive in hard.values()]) else ()


class Harness(Stateful):
    """All the wires between the parts, by name."""

    STATE = ("nets",)

    def __init__(self, nets: Iterable[Net]) -> None:
        self.nets: dict[str, Net] = {net.name: net for net in nets}

    def __getitem__(self, name: str) -> Net:
        return self.nets[name]

    def __iter__(self) -> Iterator[Net]:
        return iter(self.nets.values())


class OwnedPins:
    """One owner's ends of the wires: what the adapter calls its pin bank."""

    def __init__(self, harness: Harness, owner: str) -> None:
        self._nets = harness.nets
        self._owner = owner

    def read(self, signal: str, at: Nanos) -> bool:
        """Return the level of a wire at the instant `at`."""
        return self._nets[signal].level(at)

    def write(self, signal: str, high: bool | None, now: Nanos) -> None:
        """Drive a wire hard from `now` on; None releases it to its pull."""
        if high is None:
            self._nets[signal].release(self._owner, now)
        else:
            self._nets[signal].drive(self._owner, high, Strength.PUSH_PULL, now)


def _at(history: list[tuple[Nanos, Drive]], at: Nanos) -> Drive:
    if not history or history[-1][0] <= at:
        return history[-1][1] if history else RELEASED
    place = bisect_right(history, at, key=_time_of)
    return history[place - 1][1] if place else RELEASED


def _time_of(item: tuple[Nanos, Drive]) -> Nanos:
    return item[0]


def _is_hard(drive: Drive) -> bool:
    return drive.strength is Strength.PUSH_PULL or (drive.strength is Strength.OPEN_DRAIN and not drive.level)


def _resolved(drives: list[Drive]) -> bool | None:
    """Return the level that drives make together; None where nobody holds the wire."""
    return level_of(
        [drive.level for drive in drives if _is_hard(drive)],
        [drive.level for drive in drives if drive.strength is Strength.PULL],
    )
