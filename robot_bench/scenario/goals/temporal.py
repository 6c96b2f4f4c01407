"""Goals of signal temporal logic by their usual names: always, eventually, never, after, until when, how often.

Signals are those of the pose (each 50 ms), the sonar and the clearance, and how far a named thing is, another robot
for one; events are words of `robot_bench.events.selection`. The robustness of `always` is the least margin of a sample
in its window, that of `eventually` the greatest; after an event, that of the worst occurrence.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, cast

from p2os.toml_schema import Table
from robot_bench.events.kinds import MICRO, Clearance, Event, Pose, Ranges, WorldChange
from robot_bench.scenario.goals.watch import GoalOutcome, SelectorFeed, Watch, nanos, number, seconds, selected
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, Nanos

#: Signal → what tells it, its value there, its unit.
SIGNALS: Mapping[str, tuple[type, Callable[[Any], float], str]] = {
    "x_m": (Pose, lambda pose: pose.x_m, "m"),
    "y_m": (Pose, lambda pose: pose.y_m, "m"),
    "heading_deg": (Pose, lambda pose: math.degrees(pose.heading_rad), "deg"),
    "speed_mps": (Pose, lambda pose: pose.speed_mps, "m/s"),
    "left_mps": (Pose, lambda pose: pose.left / MICRO, "m/s"),
    "right_mps": (Pose, lambda pose: pose.right / MICRO, "m/s"),
    "sonar_m": (Ranges, lambda ranges: min(ranges.mm) / 1000, "m"),
    "clearance_m": (Clearance, lambda clearance: clearance.um / MICRO, "m"),
    "apart_m": (Pose, lambda _: math.nan, "m"),  # `OverTime` knows where the thing is
}
#: The signal that is to a thing.
APART = "apart_m"
#: Of a value, metres, degrees or m/s within bounds; negative beyond them.
Margin = Callable[[float], float]


class OverTime(Watch):
    """A signal is in bounds at each sample of a window (`always`), or at one of them (`eventually`).

    With `after`, each occurrence of the event opens a window. Raises a UsageError where `thing` stands without
    `apart_m`, or this without it.
    """

    STATE = ("_events", "_windows", "_worst", "_failure", "_count", "_there")

    def __init__(self, table: Table, signal: str, margin: Margin, *, is_always: bool) -> None:
        kind, self._value, self._unit = SIGNALS[signal]
        self._signal = signal
        #: A thing of the world, and where it was told to be last.
        self._thing = str(table.get("thing", ""))
        self._there: tuple[float, float] | None = None
        if bool(self._thing) is not (signal == APART):
            raise UsageError(f"signal {APART} and thing belong together", hint='thing = "NAME" of a robot or a thing')
        self._margin = margin
        self._is_always = is_always
        self._after = str(table["after"]) if "after" in table else ""
        self._events = SelectorFeed(*([selected(table, self._after)] if self._after else []))
        self._kind = kind
        kinds = [kind, *([WorldChange] if self._thing else []), *self._events.kinds]
        self.kinds, self.wires = tuple(dict.fromkeys(kinds)), self._events.wires
        self._from, self._to = nanos(table, "from_s"), nanos(table, "to_s") if "to_s" in table else None
        #: Where windows begin, and the best margin in each so far; of `always` the worst.
        self._windows: list[tuple[Nanos, float, Nanos]] = [] if self._after else [(0, self._nothing, 0)]
        self._worst = math.inf
        self._failure = ""
        self._count = 0 if self._after else 1

    @property
    def _nothing(self) -> float:
        return math.inf if self._is_always else -math.inf

    def feed(self, event: Event) -> GoalOutcome | None:
        if isinstance(event, WorldChange) and event.name == self._thing:
            place = event.fields.get("x"), event.fields.get("y")
            self._there = place if event.op != "remove" else None  # type: ignore[assignment] # numbers: the codec says so
        elif type(event) is self._kind and not self._thing:
            self._sample(event.t, self._margin(self._value(event)))
        elif isinstance(event, Pose) and self._there is not None:
            self._sample(event.t, self._margin(math.dist((event.x_m, event.y_m), self._there)))
        if self._after and any(self._events.taken(event)):
            self._windows.append((event.t, self._nothing, event.t))
            self._count += 1
        return self._decide(event.t)

    def advance_to(self, limit: Nanos) -> GoalOutcome | None:
        # All samples up to `limit` were fed: a window that ends there is over.
        return self._decide(limit + 1)

    def _sample(self, t: Nanos, by: float) -> None:
        pick = min if self._is_always else max
        for place, (begin, best, at) in enumerate(self._windows):
            if begin + self._from <= t and (self._to is None or t <= begin + self._to) and pick(by, best) != best:
                self._windows[place] = begin, by, t
            else:
                self._windows[place] = begin, best, at

    def _decide(self, now: Nanos) -> GoalOutcome | None:
        """Close the windows that were over before `now`; return what is decided by that."""
        was_decided, had_windows = bool(self._failure), bool(self._windows)
        kept = []
        for begin, best, at in self._windows:
            is_over = self._to is not None and now > begin + self._to
            if (best < 0 and (self._is_always or is_over)) or (is_over and self._was_never_told(best)):
                self._fail(begin, best, at)
            if is_over:
                self._worst = min(self._worst, best)
            else:
                kept.append((begin, best, at))
        self._windows = kept
        if self._failure:
            return None if was_decided else self.finish(now)
        if self._after:
            return None
        is_met = not kept and had_windows if self._is_always else any(best >= 0 for _, best, _ in kept)
        return self.finish(now) if is_met else None

    def _was_never_told(self, best: float) -> bool:
        """Tell whether the thing that a distance is to was nowhere; of other signals no sample is no failure."""
        return bool(self._thing) and not self._after and not math.isfinite(best)

    def _fail(self, begin: Nanos, best: float, at: Nanos) -> None:
        if self._failure:
            return
        since = f" after {self._after!r} at {seconds(begin)}" if self._after else ""
        how = f"{self._signal} was out of bounds by {-best:.3g} {self._unit}"
        if not math.isfinite(best):
            self._failure = f"{self._signal} was never told{since}"
        else:
            self._failure = f"{how} at {seconds(at)}{since}" if self._is_always else f"{how} at its best{since}"

    def finish(self, end: Nanos) -> GoalOutcome:
        open_ones = [best for _, best, _ in self._windows]
        by = min([self._worst, *open_ones])
        robustness = by if math.isfinite(by) else None
        if not self._count:
            return GoalOutcome(met=False, says=f"{self._after!r} did not happen")
        for begin, best, at in self._windows:
            if self._was_never_told(best) or (best < 0 and not self._is_always):
                self._fail(begin, best, at)
        says = self._failure or (f"by {by:.3g} {self._unit} at the least" if robustness is not None else "")
        return GoalOutcome(met=not self._failure, says=says, robustness=robustness, unit=self._unit)


def bounds(table: Table) -> Margin:
    """Return the margin to `least` and `most`."""
    least, most = number(table, "least", -math.inf), number(table, "most", math.inf)
    return lambda value: min(value - least, most - value)


def around(wanted: float, tolerance: float, *, is_angle: bool = False) -> Margin:
    """Return the margin to a tolerance around a value; angles, in degrees, go the short way."""
    if is_angle:
        return lambda value: tolerance - abs(math.remainder(value - wanted, 360))
    return lambda value: tolerance - abs(value - wanted)


class Happens(Watch):
    """An event happens so often, at least and at most, in a window."""

    STATE = ("_events", "_times", "_is_decided")

    def __init__(self, table: Table, *, least: int = 1, most: float = math.inf) -> None:
        self._words = str(table["event"])
        self._events = SelectorFeed(selected(table, self._words))
        self.kinds, self.wires = self._events.kinds, self._events.wires
        self._least, self._most = number(table, "least", least), number(table, "most", most)
        self._from, self._to = nanos(table, "from_s"), nanos(table, "within_s") if "within_s" in table else None
        if self._least > self._most:
            raise UsageError(f"least is {self._least:g} where it is not given", hint='kind = "never", or least = 0')
        self._times: list[Nanos] = []
        self._is_decided = False

    def feed(self, event: Event) -> GoalOutcome | None:
        if any(self._events.taken(event)) and self._from <= event.t and (self._to is None or event.t <= self._to):
            self._times.append(event.t)
            count = len(self._times)
            if not self._is_decided and (count > self._most or (count == self._least and math.isinf(self._most))):
                self._is_decided = True
                return self.finish(event.t)
        return None

    def advance_to(self, limit: Nanos) -> GoalOutcome | None:
        if self._to is None or limit < self._to or self._is_decided:
            return None
        self._is_decided = True
        return self.finish(limit)

    def finish(self, end: Nanos) -> GoalOutcome:
        count, least = len(self._times), int(self._least)
        when = f", first at {seconds(self._times[0])}" if self._times else ""
        if count > self._most:
            allowed = f", {self._most:g} at most" if self._most else ""
            return GoalOutcome(met=False, says=f"{self._words!r} happened {count} time(s){when}{allowed}")
        if count < least:
            by = f" by {self._to / NS_PER_S:g} s" if self._to is not None else ""
            return GoalOutcome(met=False, says=f"{self._words!r} happened {count} time(s){by}{when}, {least} at least")
        left = None if self._to is None or not least else (self._to - self._times[least - 1]) / NS_PER_S
        return GoalOutcome(met=True, says=f"{count} time(s){when}", robustness=left, unit="s")


class InOrderOfEvents(Watch):
    """Events happen in this order, anything in between."""

    STATE = ("_events", "_place", "_last")

    def __init__(self, table: Table) -> None:
        self._words = [str(words) for words in cast("list[object]", table["events"])]
        self._events = SelectorFeed(*(selected(table, words) for words in self._words))
        self.kinds, self.wires = self._events.kinds, self._events.wires
        self._place = 0
        self._last: Nanos = 0

    def feed(self, event: Event) -> GoalOutcome | None:
        taken = self._events.taken(event)
        if self._place == len(taken) or not taken[self._place]:
            return None
        self._place += 1
        self._last = event.t
        return self.finish(event.t) if self._place == len(taken) else None

    def finish(self, end: Nanos) -> GoalOutcome:
        if self._place == len(self._words):
            return GoalOutcome(met=True, says=f"the last at {seconds(self._last)}")
        before = f" after {self._words[self._place - 1]!r} at {seconds(self._last)}" if self._place else ""
        return GoalOutcome(met=False, says=f"{self._words[self._place]!r} did not happen{before}")


class Latency(Watch):
    """Each event of one sort is followed in time by one of another."""

    STATE = ("_events", "_since", "_worst", "_count", "_failure")

    def __init__(self, table: Table) -> None:
        self._first, self._then = str(table["from"]), str(table["to"])
        self._events = SelectorFeed(selected(table, self._first), selected(table, self._then))
        self.kinds, self.wires = self._events.kinds, self._events.wires
        self._most, self._least = nanos(table, "most_s"), nanos(table, "least_s")
        #: The first event that was not answered yet.
        self._since: Nanos | None = None
        self._worst: tuple[Nanos, Nanos] = (0, 0)
        self._count = 0
        self._failure = ""

    def feed(self, event: Event) -> GoalOutcome | None:
        first, then = self._events.taken(event)
        outcome = self._late(event.t - 1)
        if then and self._since is not None:
            took, since = event.t - self._since, self._since
            self._worst = max(self._worst, (took, since))
            self._count += 1
            self._since = None
            if not self._failure and not self._least <= took <= self._most:
                self._failure = (
                    f"{self._then!r} came {took / NS_PER_S:.6f} s after {self._first!r} at {seconds(since)}, "
                    f"{self._allowed}"
                )
                outcome = self.finish(event.t)
        if first and self._since is None:
            self._since = event.t
        return outcome

    def advance_to(self, limit: Nanos) -> GoalOutcome | None:
        return self._late(limit)

    @property
    def _allowed(self) -> str:
        least = f"{self._least / NS_PER_S:g} to " if self._least else ""
        return f"{least}{self._most / NS_PER_S:g} s are allowed"

    def _late(self, now: Nanos) -> GoalOutcome | None:
        """Give up where all events up to `now` were fed and the last instant allowed is among them."""
        if self._failure or self._since is None or now < self._since + self._most:
            return None
        self._failure = f"{self._then!r} did not follow {self._first!r} at {seconds(self._since)}, {self._allowed}"
        return self.finish(now)

    def finish(self, end: Nanos) -> GoalOutcome:
        self._late(end)
        if self._failure:
            by = (self._most - self._worst[0]) / NS_PER_S if self._worst[0] > self._most else None
            return GoalOutcome(met=False, says=self._failure, robustness=by, unit="s")
        if not self._count:
            what = self._first if self._since is None else self._then
            return GoalOutcome(met=False, says=f"{what!r} did not happen")
        took, at = self._worst
        says = f"{self._count} times, at most {took / NS_PER_S:.6f} s (at {seconds(at)})"
        return GoalOutcome(met=True, says=says, robustness=(self._most - took) / NS_PER_S, unit="s")
