"""Goals of signal temporal logic by their usual names: always, eventually, never, after, until when, how often.

Signals are those of the pose (each 50 ms), the sonar and the clearance, and how far a named thing is, another robot
for one; events are words of `robot_bench.events.selection`. The robustness of `always` is the least margin of a sample
in its window, that of `eventually` the greatest; after an event, that of the worst occurrence.
"""

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any

from p2os.errors import ScenarioError
from p2os.toml_schema import LONGEST_S, Key
from robot_bench.events.kinds import MICRO, Clearance, Event, Pose, Ranges, WorldChange
from robot_bench.scenario.goals.watch import (
    From,
    GoalKind,
    GoalOutcome,
    IfAny,
    OfEvents,
    SelectorFeed,
    To,
    Watch,
    Within,
    given_in_words,
    seconds,
    window_in_words,
)
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, Nanos, nanos

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
_Bound = Annotated[float | None, Key(least=-1e6, most=1e6, doc="of the signal")]
_Count = Annotated[int | None, Key(least=0, most=1_000_000, doc="how often")]
_Event = Annotated[str, Key(doc="the event")]
_Most = Annotated[float, Key(above=0, most=LONGEST_S, doc="in so many seconds")]


class WindowTable(OfEvents):
    """A window of time, from the beginning or from each occurrence of an event."""

    after: Annotated[str | None, Key(doc="the event from which the window counts")] = None
    from_s: From = None
    to_s: To = None


class OverTimeTable(WindowTable):
    """Bounds of a signal in a window."""

    signal: Annotated[str, Key(choices=tuple(SIGNALS), doc="which")]
    thing: Annotated[str | None, Key(doc="of `apart_m`: to what")] = None
    least: _Bound = None
    most: _Bound = None

    @property
    def margin(self) -> Margin:
        """The margin to `least` and `most`."""
        least, most = (-math.inf if self.least is None else self.least), (math.inf if self.most is None else self.most)
        return lambda value: min(value - least, most - value)


class HoldHeadingTable(WindowTable):
    """A heading in a window."""

    heading_deg: Annotated[float, Key(least=-36_000, most=36_000, doc="the short way round")]
    tolerance_deg: Annotated[float, Key(above=0, most=180, doc="off it at most")]


class HoldSpeedTable(WindowTable):
    """A speed in a window."""

    speed_mps: Annotated[float, Key(least=-100, most=100, doc="forward")]
    tolerance_mps: Annotated[float, Key(above=0, most=100, doc="off it at most")]


class NeverTable(OfEvents):
    """An event that must not happen."""

    event: _Event
    from_s: From = None


class HappensTable(NeverTable):
    """An event, and how often it may happen."""

    least: _Count = None
    most: _Count = None
    within_s: Within = None


class InOrderTable(OfEvents):
    """Events one after the other."""

    events: Annotated[tuple[str, ...], Key(kind="list", doc="in this order")]

    def __post_init__(self) -> None:
        refuse_other_than_texts("events", self.events)


class LatencyTable(OfEvents):
    """An event that follows another one."""

    from_: Annotated[str, Key(doc="an event")]
    to: Annotated[str, Key(doc="the event that follows")]
    most_s: _Most
    least_s: Annotated[float, Key(least=0, most=LONGEST_S, doc="no sooner")] = 0.0
    if_any: IfAny = False


def refuse_other_than_texts(key: str, items: tuple[str, ...]) -> None:
    """Refuse a list that has other than texts in it.

    Raises:
        ScenarioError: It has.
    """
    if not all(isinstance(item, str) for item in items):
        raise ScenarioError(f"{key} must be a list of texts in quotes")


class OverTime(Watch):
    """A signal is in bounds at each sample of a window (`always`), or at one of them (`eventually`).

    With `after`, each occurrence of the event opens a window. Raises a UsageError where `thing` stands without
    `apart_m`, or this without it.
    """

    STATE = ("_events", "_windows", "_worst", "_failure", "_count", "_there")

    def __init__(
        self, table: WindowTable, signal: str, margin: Margin, *, is_always: bool, thing: str | None = None
    ) -> None:
        kind, self._value, self._unit = SIGNALS[signal]
        self._signal = signal
        #: A thing of the world, and where it was reported last.
        self._thing = thing or ""
        self._there: tuple[float, float] | None = None
        if bool(self._thing) is not (signal == APART):
            raise UsageError(f"signal {APART} and thing belong together", hint='thing = "NAME" of a robot or a thing')
        self._margin = margin
        self._is_always = is_always
        self._after = table.after or ""
        self._events = SelectorFeed(*([table.selected(self._after)] if self._after else []))
        self._kind = kind
        kinds = [kind, *([WorldChange] if self._thing else []), *self._events.kinds]
        self.kinds, self.wires = tuple(dict.fromkeys(kinds)), self._events.wires
        self._from, self._to = nanos(table.from_s or 0.0), None if table.to_s is None else nanos(table.to_s)
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
            if (best < 0 and (self._is_always or is_over)) or (is_over and self._was_never_reported(best)):
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

    def _was_never_reported(self, best: float) -> bool:
        """Tell whether the thing that a distance is to was nowhere; of other signals no sample is no failure."""
        return bool(self._thing) and not self._after and not math.isfinite(best)

    def _fail(self, begin: Nanos, best: float, at: Nanos) -> None:
        if self._failure:
            return
        since = f" after {self._after!r} at {seconds(begin)}" if self._after else ""
        how = f"{self._signal} was out of bounds by {-best:.3g} {self._unit}"
        if not math.isfinite(best):
            self._failure = f"{self._signal} was never reported{since}"
        else:
            self._failure = f"{how} at {seconds(at)}{since}" if self._is_always else f"{how} at its best{since}"

    def finish(self, end: Nanos) -> GoalOutcome:
        open_ones = [best for _, best, _ in self._windows]
        by = min([self._worst, *open_ones])
        robustness = by if math.isfinite(by) else None
        if not self._count:
            return GoalOutcome(met=False, says=f"{self._after!r} did not happen")
        for begin, best, at in self._windows:
            if self._was_never_reported(best) or (best < 0 and not self._is_always):
                self._fail(begin, best, at)
        says = self._failure or (f"by {by:.3g} {self._unit} at the least" if robustness is not None else "")
        return GoalOutcome(met=not self._failure, says=says, robustness=robustness, unit=self._unit)


def around(wanted: float, tolerance: float, *, is_angle: bool = False) -> Margin:
    """Return the margin to a tolerance around a value; angles, in degrees, go the short way."""
    if is_angle:
        return lambda value: tolerance - abs(math.remainder(value - wanted, 360))
    return lambda value: tolerance - abs(value - wanted)


class Happens(Watch):
    """An event happens so often, at least and at most, in a window."""

    STATE = ("_events", "_times", "_is_decided")

    def __init__(self, table: HappensTable) -> None:
        self._words = table.event
        self._events = SelectorFeed(table.selected(table.event))
        self.kinds, self.wires = self._events.kinds, self._events.wires
        self._least = 1 if table.least is None else table.least
        self._most = math.inf if table.most is None else table.most
        self._from, self._to = nanos(table.from_s or 0.0), None if table.within_s is None else nanos(table.within_s)
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

    def __init__(self, table: InOrderTable) -> None:
        self._words = table.events
        self._events = SelectorFeed(*map(table.selected, table.events))
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

    def __init__(self, table: LatencyTable) -> None:
        self._first, self._then = table.from_, table.to
        self._events = SelectorFeed(table.selected(table.from_), table.selected(table.to))
        self.kinds, self.wires = self._events.kinds, self._events.wires
        self._most, self._least = nanos(table.most_s), nanos(table.least_s)
        self._if_any = table.if_any
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
            return GoalOutcome(met=self._if_any, says=f"{what!r} did not happen")
        took, at = self._worst
        says = f"{self._count} times, at most {took / NS_PER_S:.6f} s (at {seconds(at)})"
        return GoalOutcome(met=True, says=says, robustness=(self._most - took) / NS_PER_S, unit="s")


def _window(table: WindowTable) -> str:
    return window_in_words(table.after, from_s=table.from_s, to_s=table.to_s)


def _bounds(table: OverTimeTable) -> str:
    bounds = " and".join(given_in_words((" at least ", table.least, ""), (" at most ", table.most, "")))
    return f"{table.signal}{'' if table.thing is None else f' from {table.thing}'}{bounds}"


def _over_time(table: OverTimeTable, *, is_always: bool) -> Watch:
    return OverTime(table, table.signal, table.margin, is_always=is_always, thing=table.thing)


def never(words: str, table: OfEvents, *, from_s: float | None = None) -> Watch:
    """Return what watches that an event in words does not happen."""
    return Happens(HappensTable(event=words, least=0, most=0, from_s=from_s, wires=table.wires))


KINDS: Mapping[str, GoalKind] = {
    "hold_heading": GoalKind(
        HoldHeadingTable,
        lambda table: f"holds heading {table.heading_deg:g}° to {table.tolerance_deg:g}°{_window(table)}",
        lambda table: OverTime(
            table, "heading_deg", around(table.heading_deg, table.tolerance_deg, is_angle=True), is_always=True
        ),
        doc="its heading stays so, the short way round", is_scripted=True,
    ),
    "hold_speed": GoalKind(
        HoldSpeedTable,
        lambda table: f"holds {table.speed_mps:g} m/s to {table.tolerance_mps:g} m/s{_window(table)}",
        lambda table: OverTime(table, "speed_mps", around(table.speed_mps, table.tolerance_mps), is_always=True),
        doc="its speed stays so", is_scripted=True,
    ),
    "always": GoalKind(
        OverTimeTable, lambda table: f"has always {_bounds(table)}{_window(table)}",
        lambda table: _over_time(table, is_always=True), doc="the signal is in bounds at each sample",
        any_of=("least", "most"),
    ),
    "eventually": GoalKind(
        OverTimeTable, lambda table: f"has at some time {_bounds(table)}{_window(table)}",
        lambda table: _over_time(table, is_always=False), doc="the signal is in bounds at one of them",
        any_of=("least", "most"),
    ),
    "happens": GoalKind(
        HappensTable,
        lambda table: f"{table.event!r} happens"
        + ("" if table.least is None else f" at least {table.least} time(s)")
        + ("" if table.most is None else f" at most {table.most} time(s)")
        + window_in_words(from_s=table.from_s, within_s=table.within_s),
        Happens, doc="the event happens so often in that time: once at least where `least` is not given",
    ),
    "never": GoalKind(
        NeverTable, lambda table: f"{table.event!r} never happens{window_in_words(from_s=table.from_s)}",
        lambda table: never(table.event, table, from_s=table.from_s), doc="it does not happen", holds_anywhere=True,
    ),
    "in_order": GoalKind(
        InOrderTable, lambda table: f"in order {', '.join(map(repr, table.events))}", InOrderOfEvents,
        doc="they happen one after the other", is_scripted=True,
    ),
    "latency": GoalKind(
        LatencyTable, lambda table: f"{table.to!r} follows {table.from_!r} within {table.most_s:g} s", Latency,
        doc="each `from` is followed by a `to` in time; with `if_any = true` also where there is none",
        holds_anywhere=True,
    ),
}  # fmt: skip
