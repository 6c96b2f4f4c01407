"""Wires between parts: who drives them, how strongly, and which level results when.

A net keeps, for each owner, the drives that are still of interest, each with
its time stamp, as arrays: a chip may change a wire millions of times a second. So
a part that stands behind the others in time still reads the level of its own
instant. Edges are forgotten when `forget_before` states that every part has passed them.

A drive may be a wave (PWM): one row from when on the wire goes up and down by itself. Who asks gets the level at a
time, the wave at a time, or what the wire did in a span (`course`); edges are not made. In what `edges_until`
returns a wave is a low level; `take_waves` has the rows.

Not modelled: voltages, capacitance and edge times. A drive is a level and a
strength; a value in volts would be one more field of `Drive`.

Invariant: `level(at)` depends on the drives stamped at or before `at` only, not
on the order in which different owners reported them.
"""

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from typing import Self

from adapter_sim.duty import COURSE_NS
from bluepill_sim.fabric.subscriptions import Wave
from p2os.errors import LocalProtocolError
from robot_bench.wires.edges import Edges, changes
from simbase.state import Stateful
from simbase.timing import Nanos
from simbase.wire import are_fighting, level_of


class Strength(Enum):
    """How an owner holds a wire."""

    #: The codes of a low and a high level so held.
    codes: tuple[int, int]

    def __new__(cls, label: str, *codes: int) -> Self:
        """Make a member whose value is its label."""
        member = object.__new__(cls)
        member._value_ = label
        member.codes = (codes[0], codes[1])
        return member

    #: Both levels are driven hard.
    PUSH_PULL = "push-pull", 1, 2
    #: Low is driven hard, high lets go.
    OPEN_DRAIN = "open drain", 3, 4
    #: A resistor; yields to anything driven hard.
    PULL = "pull", 5, 6
    #: Not at all.
    FLOATING = "floating", 0, 0


#: The code of letting go, and how many codes there are: what one owner does to a wire.
RELEASED, CODES = 0, 7
#: The code of a wave: what its owner does follows from the time.
WAVING = 7
#: The levels of codes that drive hard, and of those that pull.
HARD = {1: False, 2: True, 3: False}
PULLS = {5: False, 6: True}

#: (net, owner of the new drives, ns from which the first of them holds).
Watcher = Callable[["Net", str, Nanos], None]


@dataclass(frozen=True, slots=True)
class WaveDrive:
    """A wave, and the codes of its low and its high phase."""

    wave: Wave
    codes: tuple[int, int]


@dataclass(slots=True)
class CodeHistory:
    """What one owner has done to a wire: times in ns, and the code from each on."""

    times: "array[int]" = field(default_factory=lambda: array("q"))
    codes: bytearray = field(default_factory=bytearray)
    #: The waves of the times with the code `WAVING`.
    waves: dict[Nanos, WaveDrive] = field(default_factory=dict)

    def at(self, at: Nanos) -> int:
        """Return the code at an instant; of a wave that of its phase."""
        place = bisect_right(self.times, at) - 1
        if place < 0:
            return RELEASED
        code = self.codes[place]
        if code == WAVING:
            drive = self.waves[self.times[place]]
            return drive.codes[drive.wave.level(at)]
        return code

    def codes_at(self, at: Nanos) -> tuple[int, ...]:
        """Return the code at an instant; of a wave those of both phases."""
        drive = self.wave_at(at)
        return (self.at(at),) if drive is None else drive.codes

    def between(self, after: Nanos, before: Nanos) -> "array[int]":
        """Return the times later than `after` and earlier than `before`."""
        return self.times[bisect_right(self.times, after) : bisect_left(self.times, before)]

    def wave_at(self, at: Nanos) -> WaveDrive | None:
        """Return the wave at an instant; None for none."""
        place = bisect_right(self.times, at) - 1
        return self.waves[self.times[place]] if place >= 0 and self.codes[place] == WAVING else None


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
        "_drives", "last_edge", "_notified_until", "_notified_level", "_notified_contention",
        "_contentions", "_notified_wave", "_waves", "_may_wave", "_kept_ns",
    )  # fmt: skip
    #: Who listens is settled when a bench is built.
    DERIVED = ("_watchers", "_last_level")

    def __init__(self, name: str, *, idle: bool = False) -> None:
        self.name = name
        self.idle = idle
        self._drives: dict[str, CodeHistory] = {}
        self._watchers: list[Watcher] = []
        #: The time of the last drive known so far, and the level after it; None: not worked out.
        self._last_level: bool | None = idle
        self.last_edge: Nanos = 0
        #: Level and fighting owners at the end of what `edges_until` has returned.
        self._notified_until: Nanos = -1
        self._notified_level = idle
        self._notified_contention: tuple[str, ...] = ()
        self._contentions: list[Contention] = []
        #: The wave at the end of what `edges_until` has returned, the changes that it came across, and whether an
        #: owner has a wave that is still of interest.
        self._notified_wave: Wave | None = None
        self._waves: list[tuple[Nanos, Wave | None]] = []
        self._may_wave = False
        #: For how long drives are kept after every part has passed them: `COURSE_NS` once somebody reads courses.
        self._kept_ns: Nanos = 0

    def drive(self, owner: str, level: bool, strength: Strength, now: Nanos) -> None:
        """Hold the wire from `now` on; it replaces what the same owner did before.

        Raises:
            LocalProtocolError: `owner` has already reported something later, or that instant's edges were reported.
        """
        code = strength.codes[level]
        history = self._drives.get(owner)
        if history is not None and history.codes[-1] == code and now >= history.times[-1]:
            return
        self.drive_in_turn(owner, array("q", (now,)), bytes((code,)))

    def drive_in_turn(self, owner: str, times: "array[int]", codes: bytes) -> None:
        """Take drives of one owner, oldest first: at each of these times one by its code (`Strength.codes`).

        Raises:
            LocalProtocolError: As of `drive`.
        """
        history = self._history(owner, times[0])
        history.times += times
        history.codes += codes
        self._driven(owner, times[0], times[-1])

    def wave_from(self, owner: str, drive: WaveDrive, now: Nanos) -> None:
        """Take a wave of one owner; it holds from `now` on, in place of what the same owner did before.

        Raises:
            LocalProtocolError: As of `drive`.
        """
        history = self._drives.get(owner)
        is_same = history is not None and history.codes[-1] == WAVING and history.waves[history.times[-1]] == drive
        if history is not None and is_same and now >= history.times[-1]:
            return
        history = self._history(owner, now)
        history.times.append(now)
        history.codes.append(WAVING)
        history.waves[now] = drive
        self._may_wave = True
        self._driven(owner, now, now)

    def release(self, owner: str, now: Nanos) -> None:
        """Let the wire go from `now` on."""
        self.drive(owner, False, Strength.FLOATING, now)

    def level(self, at: Nanos) -> bool:
        """Return the level at the instant `at`, an edge at `at` included."""
        return self._resolve(at) if at < self.last_edge or self._may_wave else self._level_at_last()

    def wave(self, at: Nanos) -> Wave | None:
        """Return the wave that is on the wire at the instant `at`; None where it has a level."""
        found = self._may_wave and self._shown(at)
        return None if isinstance(found, bool) else found

    def course(self, begin: Nanos, end: Nanos) -> list[tuple[Nanos, bool | Wave]]:
        """Return what the wire does from `begin` on until before `end`: when, and the level or wave.

        From the first call on `begin` may lie `COURSE_NS` before the present.
        """
        self._kept_ns = COURSE_NS
        if self.last_edge <= begin:
            return [(begin, self._shown(begin) if self._may_wave else self._level_at_last())]
        late = [history for history in self._drives.values() if history.times[-1] > begin]
        if len(late) == 1:  # whose times are in order
            return [(at, self._shown(at)) for at in (begin, *dict.fromkeys(late[0].between(begin, end)))]
        cuts = {at for history in late for at in history.between(begin, end)}
        return [(at, self._shown(at)) for at in (begin, *sorted(cuts))]

    def level_without(self, owner: str, at: Nanos) -> tuple[bool | None, bool]:
        """Return what everybody but `owner` puts on the wire, None where nobody holds it, and whether it is hard."""
        return _held(tuple([history.at(at) for name, history in self._drives.items() if name != owner]))

    def drives_from(self, owner: str, begin: Nanos) -> "tuple[array[int], bytearray]":
        """Return the drives of `owner` from `begin` on: when, and their codes."""
        history = self._drives[owner]
        place = bisect_left(history.times, begin)
        return history.times[place:], history.codes[place:]

    def is_alone(self, owner: str, other: str) -> bool:
        """Tell whether nobody but these two has driven the wire."""
        return len(self._drives) <= 1 + (other in self._drives) and owner in self._drives

    def levels_without(self, owner: str, times: Sequence[Nanos]) -> list[tuple[bool | None, bool]]:
        """Return what `level_without` has at some instants."""
        others = [history for name, history in self._drives.items() if name != owner]
        if len(others) == 1:
            at = others[0].at
            return [_held((at(when),)) for when in times]
        return [_held(tuple([history.at(when) for history in others])) for when in times]

    def drive_at(self, owner: str, at: Nanos) -> WaveDrive | None:
        """Return the wave that `owner` puts on the wire at the instant `at`; None for none."""
        return self._drives.get(owner, CodeHistory()).wave_at(at)

    def times_after(self, owner: str, after: Nanos) -> "array[int]":
        """Return when `owner` has driven the wire after `after`."""
        history = self._drives.get(owner, CodeHistory())
        return history.times[bisect_right(history.times, after) :]

    def watch(self, watcher: Watcher) -> None:
        """Call `watcher` at new drives of an owner, whether or not they change the level, in the order of telling."""
        self._watchers.append(watcher)

    def edges_until(self, limit: Nanos) -> Edges:
        """Return the changes of level at or before `limit` that were not returned before, oldest first."""
        before, self._notified_until = self._notified_until, max(self._notified_until, limit)
        levels = self._levels_and_waves(before, limit) if self._may_wave else self._levels(before, limit)
        found = changes(levels, self._notified_level)
        if found:
            self._notified_level = bool(found.levels[-1])
        return found

    def take_contentions(self) -> list[Contention]:
        """Return the contentions that `edges_until` has come across, and forget them."""
        found, self._contentions = self._contentions, []
        return found

    def take_waves(self) -> list[tuple[Nanos, Wave | None]]:
        """Return the changes of waves that `edges_until` has come across, None for the end of one, and forget them."""
        found, self._waves = self._waves, []
        return found

    def forget_before(self, limit: Nanos) -> bool:
        """Drop what no reader at or after `limit` can see; return True where later drives are still remembered."""
        later = False
        for history in self._drives.values():
            passed = bisect_right(history.times, limit - self._kept_ns, lo=1) - 1
            del history.times[:passed], history.codes[:passed]
            if history.waves:
                for at in history.waves.keys() - set(history.times):
                    del history.waves[at]
            later = later or history.times[-1] > limit
        self._may_wave = self._may_wave and any(history.waves for history in self._drives.values())
        return later

    def _levels(self, after: Nanos, limit: Nanos) -> Edges:
        """Return the level from each drive after `after` and up to `limit` on, and note who fights."""
        # Those of the owner with the most drives in one go, between the drives of the others.
        spans = {
            owner: (bisect_right(history.times, after), bisect_right(history.times, limit))
            for owner, history in self._drives.items()
        }
        found = Edges()
        if not any(first < last for first, last in spans.values()):
            return found
        busiest = max(spans, key=lambda owner: spans[owner][1] - spans[owner][0])
        own, others = self._drives[busiest], [item for owner, item in self._drives.items() if owner != busiest]
        cuts = {at for owner, (first, last) in spans.items() if owner != busiest
                for at in self._drives[owner].times[first:last]}  # fmt: skip
        for cut in [*sorted(cuts), limit + 1]:
            codes = tuple(history.at(after) for history in others)
            first, last = bisect_right(own.times, after), bisect_left(own.times, cut)
            times, mine = own.times[first:last], own.codes[first:last]
            found.extend(times, mine.translate(_levels_with(codes, self.idle)))
            if self._notified_contention or any(code in HARD for code in codes):
                for at in times:
                    self._note_fight(at)
            if cut <= limit:
                found.append(cut, self._resolve(cut))
                self._note_fight(cut)
            after = cut
        return found

    def _levels_and_waves(self, after: Nanos, limit: Nanos) -> Edges:
        """Do as `_levels` where owners have waves, which are low levels here, and note how the wave changes."""
        found = Edges()
        may_fight = sum(any(code in HARD or code == WAVING for code in one.codes) for one in self._drives.values()) > 1
        for at in sorted({at for history in self._drives.values() for at in history.between(after, limit + 1)}):
            shown = self._shown(at)
            wave = None if isinstance(shown, bool) else shown
            found.append(at, shown is True)
            if wave != self._notified_wave:
                self._notified_wave = wave
                self._waves.append((at, wave))
            if may_fight or self._notified_contention:
                self._note_fight(at)
        return found

    def _shown(self, at: Nanos) -> bool | Wave:
        """Return the level at an instant, or the wave."""
        drive, codes = None, []
        for history in self._drives.values():
            times = history.times
            place = len(times) - 1 if times[-1] <= at else bisect_right(times, at) - 1
            code = history.codes[place] if place >= 0 else RELEASED
            if code == WAVING:
                drive = history.waves[times[place]]
            else:
                codes.append(code)
        if drive is None:
            level = _resolved(tuple(codes))
            return self.idle if level is None else level
        low, high = _phases((*codes, *drive.codes), self.idle)
        return low if low == high else drive.wave

    def _history(self, owner: str, now: Nanos) -> CodeHistory:
        """Return an owner's history, which goes on at `now`."""
        history = self._drives.get(owner)
        if history is not None and now < history.times[-1]:
            raise LocalProtocolError(
                f"{owner} drives {self.name} at {now} ns after having driven it at {history.times[-1]} ns"
            )
        if now <= self._notified_until:
            raise LocalProtocolError(
                f"{owner} drives {self.name} at {now} ns after its edges up to {self._notified_until} ns were reported"
            )
        if history is None:
            history = self._drives[owner] = CodeHistory()
        return history

    def _driven(self, owner: str, first: Nanos, last: Nanos) -> None:
        """Work out what follows from new drives, and tell whoever watches."""
        self.last_edge = max(self.last_edge, last)
        self._last_level = None
        for watcher in self._watchers:
            watcher(self, owner, first)

    def _level_at_last(self) -> bool:
        """Return the level after the last drive, where no wave is there."""
        if self._last_level is None:
            self._last_level = self._resolve(self.last_edge)
        return self._last_level

    def _restored(self) -> None:
        self._last_level = None

    def _resolve(self, at: Nanos) -> bool:
        level = _resolved(tuple([history.at(at) for history in self._drives.values()]))
        return self.idle if level is None else level

    def _note_fight(self, at: Nanos) -> None:
        """Note who drives hard against whom at the instant `at`, where that is new; a wave fights by either phase."""
        hard = [(owner, HARD[code]) for owner, history in self._drives.items() for code in history.codes_at(at)
                if code in HARD]  # fmt: skip
        owners = tuple(sorted({owner for owner, _ in hard}))
        fight = owners if len(owners) > 1 and are_fighting([level for _, level in hard]) else ()
        if fight and fight != self._notified_contention:
            self._contentions.append(Contention(at, self.name, fight))
        self._notified_contention = fight


class Harness(Stateful):
    """All the wires between the parts, by name."""

    STATE = ("nets",)

    def __init__(self, nets: Iterable[Net]) -> None:
        self.nets: dict[str, Net] = {net.name: net for net in nets}

    def __getitem__(self, name: str) -> Net:
        return self.nets[name]

    def __iter__(self) -> Iterator[Net]:
        return iter(self.nets.values())


class Unconnected:
    """The end of a wire that is cut: what drives it drives nothing."""

    def drive(self, owner: str, level: bool, strength: Strength, now: Nanos) -> None:
        """Do nothing."""


class OwnedPins:
    """One owner's ends of the wires: what the adapter calls its pin bank.

    Args:
        harness: The wires.
        owner: Under whose name they are driven.
        cut: Wires whose ends here are cut: what is written to them drives nothing.
    """

    def __init__(self, harness: Harness, owner: str, cut: Collection[str] = ()) -> None:
        self._nets = harness.nets
        self._owner = owner
        self._cut = frozenset(cut)

    def read(self, signal: str, at: Nanos) -> bool:
        """Return the level of a wire at the instant `at`."""
        return self._nets[signal].level(at)

    def course(self, signal: str, begin: Nanos, end: Nanos) -> list[tuple[Nanos, bool | Wave]]:
        """Return what a wire does from `begin` on until before `end`: when, and the level or wave from then on."""
        return self._nets[signal].course(begin, end)

    def write(self, signal: str, high: bool | None, now: Nanos) -> None:
        """Drive a wire hard from `now` on; None releases it to its pull."""
        if signal in self._cut:
            return
        if high is None:
            self._nets[signal].release(self._owner, now)
        else:
            self._nets[signal].drive(self._owner, high, Strength.PUSH_PULL, now)


@cache
def _levels_with(others: tuple[int, ...], idle: bool) -> bytes:
    """Return the level that each code of one owner makes, where the others do this; 256 bytes."""
    levels = [_resolved((*others, code)) for code in range(CODES)]
    return bytes([idle if level is None else level for level in levels]).ljust(256, b"\0")


@cache
def _held(codes: tuple[int, ...]) -> tuple[bool | None, bool]:
    """Return the level that drives make together, and whether one of them is hard."""
    return _resolved(codes), any(code in HARD for code in codes)


@cache
def _phases(codes: tuple[int, ...], idle: bool) -> tuple[bool, bool]:
    """Return the levels in the low and the high phase of a wave, whose codes are the last two, among other drives."""
    *others, low, high = codes
    found = _resolved((*others, low)), _resolved((*others, high))
    return idle if found[0] is None else found[0], idle if found[1] is None else found[1]


@cache
def _resolved(codes: tuple[int, ...]) -> bool | None:
    """Return the level that drives make together; None where nobody holds the wire."""
    return level_of(
        [HARD[code] for code in codes if code in HARD],
        [PULLS[code] for code in codes if code in PULLS],
    )
