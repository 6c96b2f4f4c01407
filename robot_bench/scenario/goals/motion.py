"""Goals on where the robot is and how it moves, by its pose each 50 ms and its contacts."""

import math
from collections.abc import Callable, Mapping
from typing import Annotated

from p2os.errors import ScenarioError
from p2os.toml_record import Record
from p2os.toml_schema import Key
from robot_bench.events.kinds import MICRO, Clearance, Contact, Event, Pose, Ranges
from robot_bench.events.selection import moves
from robot_bench.scenario.goals.watch import (
    From,
    GoalKind,
    GoalOutcome,
    IfAny,
    InTime,
    NoKeys,
    OfEvents,
    SelectorFeed,
    Watch,
    Within,
    given_in_words,
    seconds,
    window_in_words,
)
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos, nanos

NS_PER_MINUTE = 60 * NS_PER_S
#: chosen: so many collisions are named in one line; all stand in the state log.
NAMED_HITS = 3
#: Of a Pioneer's front ring, what looks along its way.
AHEAD = (3, 4, 5, 6)
#: A ring of eight, two to a packet, is new after so long: what it has not heard yet reads as the longest range.
RING_NS: Nanos = 400 * NS_PER_MS
#: Side of the cells that a run's coverage is counted in, micrometres.
CELL_UM = 500_000
_Way = Annotated[float | None, Key(above=0, most=1e6, doc="the way that it may take, or has to")]
_Work = Annotated[float | None, Key(above=0, most=1e9, doc="the work at the rims")]
_Coordinate = Annotated[float | None, Key(least=-10_000, most=10_000, doc="the middle of a circle")]


def _place(pose: Pose) -> str:
    return f"x {pose.x_m:.2f} m, y {pose.y_m:.2f} m"


class NoCollision(Watch):
    """The hull touches nothing."""

    STATE = ("_named", "_count", "_first", "_last")
    kinds = (Contact, Pose)

    def __init__(self) -> None:
        self._named: list[str] = []
        self._count = 0
        #: The first pose that tells of a collision, and the last one: an old trace names none.
        self._first: Pose | None = None
        self._last: Pose | None = None

    def feed(self, event: Event) -> GoalOutcome | None:
        is_first = not self._count and self._first is None
        if isinstance(event, Contact):
            self._count += 1
            if len(self._named) < NAMED_HITS:
                self._named.append(str(event))
        elif isinstance(event, Pose) and event.collisions:
            self._first, self._last = self._first or event, event
        else:
            return None
        return self.finish(event.t) if is_first else None

    def finish(self, end: Nanos) -> GoalOutcome:
        if self._count:
            more = f", and {self._count - NAMED_HITS} more" if self._count > NAMED_HITS else ""
            return GoalOutcome(met=False, says=f"{self._count} collision(s): {'; '.join(self._named)}{more}")
        if self._first is None or self._last is None:
            return GoalOutcome(met=True)
        where = f"the first at {seconds(self._first.t)}, {_place(self._first)}"
        return GoalOutcome(met=False, says=f"{self._last.collisions} collision(s), {where}")


class MinDistanceTable(Record):
    """A way by itself or by the minute."""

    distance_m: _Way = None
    distance_m_a_minute: _Way = None


class MinDistance(Watch):
    """The path is long enough, by itself or by the minute."""

    STATE = ("_driven_um", "_at")
    kinds = (Pose,)

    def __init__(self, table: MinDistanceTable) -> None:
        self._wanted_m, self._a_minute_m = table.distance_m or 0.0, table.distance_m_a_minute or 0.0
        self._driven_um = 0.0
        self._at: tuple[int, int] | None = None

    def feed(self, event: Event) -> GoalOutcome | None:
        if isinstance(event, Pose):
            at = event.x, event.y
            if self._at is not None:
                self._driven_um += math.hypot(at[0] - self._at[0], at[1] - self._at[1])
            self._at = at
            if not self._a_minute_m and self._driven_um >= self._wanted_m * 1e6:
                return GoalOutcome(met=True, says=f"driven by {seconds(event.t)}")
        return None

    def finish(self, end: Nanos) -> GoalOutcome:
        wanted_m, driven_m = self._wanted_m + self._a_minute_m * end / NS_PER_MINUTE, self._driven_um / 1e6
        return GoalOutcome(
            met=driven_m >= wanted_m, says=f"{driven_m:.2f} m were driven, {wanted_m:.2f} m are wanted",
            robustness=driven_m - wanted_m, unit="m",
        )  # fmt: skip


class CellsTable(Record):
    """How many cells."""

    least: Annotated[int, Key(least=1, most=1_000_000, doc="so many different ones")]


class Cells(Watch):
    """So many different cells were entered."""

    STATE = ("_entered",)
    kinds = (Pose,)

    def __init__(self, table: CellsTable) -> None:
        self._wanted = table.least
        self._entered: set[tuple[int, int]] = set()

    def feed(self, event: Event) -> GoalOutcome | None:
        if isinstance(event, Pose):
            self._entered.add((event.x // CELL_UM, event.y // CELL_UM))
            if len(self._entered) == self._wanted:
                return GoalOutcome(met=True)
        return None

    def finish(self, end: Nanos) -> GoalOutcome:
        count = len(self._entered)
        return GoalOutcome(
            met=count >= self._wanted, says=f"{count} cells of 0.5 m were entered, {self._wanted} are wanted"
        )


#: How far a place lies inside a region, metres; negative outside.
Inside = Callable[[float, float], float]


class RegionTable(Record):
    """A circle, or a rectangle along the axes."""

    x_m: _Coordinate = None
    y_m: _Coordinate = None
    radius_m: Annotated[float | None, Key(above=0, most=10_000, doc="of a circle")] = None
    area_m: Annotated[tuple[float, ...] | None, Key(doc="`[least x, least y, most x, most y]`")] = None

    def __post_init__(self) -> None:
        circle = sum(one is not None for one in (self.x_m, self.y_m, self.radius_m))
        if self.area_m is not None and (circle or not _is_area(self.area_m)):
            raise ScenarioError("area_m must be [least x, least y, most x, most y], and stand alone")
        if circle not in {0, 3}:
            raise ScenarioError("a circle needs x_m, y_m and radius_m")

    @property
    def circle(self) -> tuple[float, float, float]:
        """Its middle and radius, metres; of a rectangle zeros."""
        return self.x_m or 0.0, self.y_m or 0.0, self.radius_m or 0.0

    @property
    def inside(self) -> Inside:
        """How far a place lies inside."""
        if self.area_m is not None:
            low_x, low_y, high_x, high_y = map(float, self.area_m)
            return lambda x, y: min(x - low_x, high_x - x, y - low_y, high_y - y)
        x_m, y_m, radius_m = self.circle
        return lambda x, y: radius_m - math.hypot(x - x_m, y - y_m)


def _is_area(area: tuple[float, ...]) -> bool:
    is_numbers = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in area)
    return is_numbers and len(area) == 4 and area[0] < area[2] and area[1] < area[3]


class ReachTable(RegionTable):
    """A region, and when."""

    within_s: Within = None


class Reach(Watch):
    """The robot's centre comes into a region, in time."""

    STATE = ("_best_m", "_reached", "_was_late")
    kinds = (Pose,)

    def __init__(self, table: ReachTable) -> None:
        self._inside = table.inside
        self._within = None if table.within_s is None else nanos(table.within_s)
        self._best_m = -math.inf
        self._reached: Nanos | None = None
        self._was_late = False

    def feed(self, event: Event) -> GoalOutcome | None:
        if not isinstance(event, Pose) or self._reached is not None:
            return None
        self._best_m = max(self._best_m, by := self._inside(event.x_m, event.y_m))
        if by < 0:
            return None
        self._reached = event.t
        return None if self._was_late else self.finish(event.t)

    def advance_to(self, limit: Nanos) -> GoalOutcome | None:
        if self._within is None or self._reached is not None or limit < self._within or self._was_late:
            return None
        self._was_late = True
        return self.finish(limit)

    def finish(self, end: Nanos) -> GoalOutcome:
        if self._reached is None:
            return GoalOutcome(
                met=False, says=f"it was not reached by {seconds(end)}, and came to {-self._best_m:.2f} m of it",
                robustness=self._best_m, unit="m",
            )  # fmt: skip
        says = f"it was reached at {seconds(self._reached)}"
        if self._within is None:
            return GoalOutcome(met=True, says=says, robustness=self._best_m, unit="m")
        left_s = (self._within - self._reached) / NS_PER_S
        return GoalOutcome(
            met=left_s >= 0, says=f"{says}, {self._within / NS_PER_S:g} s are allowed", robustness=left_s, unit="s"
        )


class Stay(Watch):
    """The robot's centre stays in a region, or out of it."""

    STATE = ("_worst_m", "_left")
    kinds = (Pose,)

    def __init__(self, table: RegionTable, *, is_inside: bool) -> None:
        inside = table.inside
        self._by: Inside = inside if is_inside else lambda x, y: -inside(x, y)
        self._word = "left" if is_inside else "entered"
        self._worst_m = math.inf
        self._left: Pose | None = None

    def feed(self, event: Event) -> GoalOutcome | None:
        if not isinstance(event, Pose):
            return None
        self._worst_m = min(self._worst_m, by := self._by(event.x_m, event.y_m))
        if by >= 0 or self._left is not None:
            return None
        self._left = event
        return self.finish(event.t)

    def finish(self, end: Nanos) -> GoalOutcome:
        worst_m = self._worst_m if math.isfinite(self._worst_m) else None
        if self._left is None:
            return GoalOutcome(met=True, robustness=worst_m, unit="m")
        says = (
            f"it was {self._word} at {seconds(self._left.t)}, {_place(self._left)}, by {-self._worst_m:.2f} m at most"
        )
        return GoalOutcome(met=False, says=says, robustness=worst_m, unit="m")


class ClearanceTable(Record):
    """A distance to everything."""

    least_m: Annotated[float, Key(above=0, most=100, doc="so far away")]


class LeastClearance(Watch):
    """The hull stays away from everything."""

    STATE = ("_least", "_was_near")
    kinds = (Clearance,)

    def __init__(self, table: ClearanceTable) -> None:
        self._wanted_m = table.least_m
        self._least: Clearance | None = None
        self._was_near = False

    def feed(self, event: Event) -> GoalOutcome | None:
        if isinstance(event, Clearance):
            self._least = event
            if event.um < self._wanted_m * MICRO and not self._was_near:
                self._was_near = True
                return self.finish(event.t)
        return None

    def finish(self, end: Nanos) -> GoalOutcome:
        if self._least is None:
            return GoalOutcome(met=True, says="there was nothing near")
        least_m = self._least.um / MICRO
        says = f"{least_m:.3f} m were left at {seconds(self._least.t)}, {self._wanted_m:g} m are wanted"
        return GoalOutcome(met=least_m >= self._wanted_m, says=says, robustness=least_m - self._wanted_m, unit="m")


class StopWithinTable(OfEvents):
    """An event, and how soon the robot stands after it."""

    after: Annotated[str, Key(doc="the event")]
    within_s: InTime
    way_m: _Way = None
    if_any: IfAny = False


class StopWithin(Watch):
    """After an event the robot stands still in time, and has not gone too far."""

    STATE = ("_events", "_since", "_at", "_way_m", "_worst_s", "_worst_m", "_failure", "_count")

    def __init__(self, table: StopWithinTable) -> None:
        self._words = table.after
        self._events = SelectorFeed(table.selected(table.after))
        self.kinds, self.wires = (*{Pose: None, **dict.fromkeys(self._events.kinds)},), self._events.wires
        self._most_s, self._most_m = table.within_s, table.way_m or math.inf
        self._if_any = table.if_any
        #: When the event came that is waited for now; the last place, and the way since then.
        self._since: Nanos | None = None
        self._at: tuple[float, float] | None = None
        self._way_m = 0.0
        self._worst_s = self._worst_m = 0.0
        self._failure = ""
        self._count = 0

    def feed(self, event: Event) -> GoalOutcome | None:
        outcome = None
        if isinstance(event, Pose):
            at = event.x_m, event.y_m
            if self._since is not None and self._at is not None:
                self._way_m += math.hypot(at[0] - self._at[0], at[1] - self._at[1])
                outcome = self._judge(event.t, is_still=not moves(event))
            self._at = at
        if any(self._events.taken(event)) and self._since is None:
            self._since, self._way_m = event.t, 0.0
            self._count += 1
        return outcome

    def _judge(self, now: Nanos, *, is_still: bool) -> GoalOutcome | None:
        since = self._since or 0
        took_s = (now - since) / NS_PER_S
        self._worst_s, self._worst_m = max(self._worst_s, took_s), max(self._worst_m, self._way_m)
        if is_still:
            self._since = None
        if self._failure or (took_s <= self._most_s and self._way_m <= self._most_m):
            return None
        allowed = f"{self._most_s:g} s" + (f" and {self._most_m:g} m" if math.isfinite(self._most_m) else "")
        self._failure = (
            f"after {self._words!r} at {seconds(since)} it {'stood' if is_still else 'still moved'} after "
            f"{took_s:.3f} s and {self._way_m:.3f} m, {allowed} are allowed"
        )
        return self.finish(now)

    def finish(self, end: Nanos) -> GoalOutcome:
        if not self._count:
            return GoalOutcome(met=self._if_any, says=f"{self._words!r} did not happen")
        return GoalOutcome(
            met=not self._failure,
            says=self._failure or f"at most {self._worst_s:.3f} s and {self._worst_m:.3f} m",
            robustness=self._most_s - self._worst_s, unit="s",
        )  # fmt: skip


class MovesOnTable(Record):
    """How far away from each place, and how soon."""

    way_m: Annotated[float, Key(above=0, most=1e6, doc="so far away")]
    within_s: InTime
    from_s: From = None
    free_m: Annotated[float | None, Key(
        above=0, most=100, doc="its time at a place counts from when all sonar `ahead` were free beyond that"
    )] = None  # fmt: skip
    ahead: Annotated[tuple[int, ...], Key(doc="numbers of the sonar that look ahead, from 1")] = AHEAD


class MovesOn(Watch):
    """The robot gets so far away from each place in time: it neither stands, nor turns on the spot, nor is shut in.

    The place is that of the first pose, then that where it was so far away from the one before. With `free_m` its time
    there begins where it sees free floor, so that one who looks for the way out of a dead end is not hurried.
    """

    STATE = ("_place", "_since", "_free_since", "_least", "_least_at", "_has_missed")

    def __init__(self, table: MovesOnTable) -> None:
        self._way_m = table.way_m
        self._within, self._from = nanos(table.within_s), nanos(table.from_s or 0.0)
        self._free_mm, self._ahead = None if table.free_m is None else 1000 * table.free_m, table.ahead
        self.kinds = (Pose,) if self._free_mm is None else (Pose, Ranges)
        self._place: Pose | None = None
        #: From when the time counts at this place; None: it has seen no free floor there yet.
        self._since: Nanos | None = None
        #: From when all was free ahead; None: something is not.
        self._free_since: Nanos | None = None
        #: The least time that was left when it got away, and when.
        self._least = self._within
        self._least_at: Pose | None = None
        self._has_missed = False

    def feed(self, event: Event) -> GoalOutcome | None:
        if isinstance(event, Ranges) and self._free_mm is not None:
            ahead = [event.mm[one - 1] for one in self._ahead if one <= len(event.mm)]
            is_free = min(ahead, default=0) > self._free_mm
            self._free_since = (event.t if self._free_since is None else self._free_since) if is_free else None
        if not isinstance(event, Pose) or event.t < self._from:
            return None
        if self._place is None:
            self._place = event
        if self._since is None and self._sees_free(event.t):
            self._since = event.t
        left = self._within if self._since is None else self._within - (event.t - self._since)
        if left < self._least:
            self._least, self._least_at = left, self._place
        if math.hypot(event.x - self._place.x, event.y - self._place.y) >= self._way_m * MICRO:
            self._place, self._since = event, event.t if self._sees_free(event.t) else None
        if left >= 0 or self._has_missed:
            return None
        self._has_missed = True
        return self.finish(event.t)

    def _sees_free(self, now: Nanos) -> bool:
        """Tell whether free floor counts as seen: for as long as all sonar take to be new; without `free_m` always."""
        return self._free_mm is None or (self._free_since is not None and now - self._free_since >= RING_NS)

    def finish(self, end: Nanos) -> GoalOutcome:
        stuck, left_s = self._least_at, self._least / NS_PER_S
        if left_s >= 0 or stuck is None:
            return GoalOutcome(met=True, robustness=left_s, unit="s")
        says = f"it did not get {self._way_m:g} m away from {_place(stuck)} where it was at {seconds(stuck.t)}"
        since = "" if self._free_mm is None else f", having seen {self._free_mm / 1000:g} m of free floor"
        says += f" within {self._within / NS_PER_S:g} s{since}"
        return GoalOutcome(met=False, says=says, robustness=left_s, unit="s")


class SmoothTable(Record):
    """An acceleration."""

    most_mps2: Annotated[float, Key(above=0, most=1000, doc="of a rim, m/s²")]


class Smooth(Watch):
    """No rim is accelerated harder than allowed, between two poses."""

    STATE = ("_last", "_worst_mps2", "_worst_at")
    kinds = (Pose,)

    def __init__(self, table: SmoothTable) -> None:
        self._most_mps2 = table.most_mps2
        self._last: Pose | None = None
        self._worst_mps2 = 0.0
        self._worst_at: Nanos = 0

    def feed(self, event: Event) -> GoalOutcome | None:
        if not isinstance(event, Pose):
            return None
        last, self._last = self._last, event
        if last is None or event.t <= last.t:
            return None
        step = max(abs(event.left - last.left), abs(event.right - last.right))
        found_mps2 = step / MICRO / ((event.t - last.t) / NS_PER_S)
        was_smooth = self._worst_mps2 <= self._most_mps2
        if found_mps2 > self._worst_mps2:
            self._worst_mps2, self._worst_at = found_mps2, event.t
        return self.finish(event.t) if was_smooth and found_mps2 > self._most_mps2 else None

    def finish(self, end: Nanos) -> GoalOutcome:
        says = f"{self._worst_mps2:.2f} m/s² at {seconds(self._worst_at)}, {self._most_mps2:g} m/s² are allowed"
        by = self._most_mps2 - self._worst_mps2
        return GoalOutcome(met=by >= 0, says=says, robustness=by, unit="m/s²")


class EnergyTable(Record):
    """Work at the rims, joules."""

    most_j: _Work = None
    most_j_a_metre: _Work = None


class Energy(Watch):
    """The work at the rims stays within so many joules, of the whole run or for each metre of its way."""

    STATE = ("_last", "_driven_m", "_peak_w", "_peak", "_over")
    kinds = (Pose,)

    def __init__(self, table: EnergyTable) -> None:
        self._most_j, self._a_metre_j = table.most_j or math.inf, table.most_j_a_metre or math.inf
        self._last: Pose | None = None
        self._driven_m = 0.0
        #: The greatest mean power between two poses, and the second of them.
        self._peak_w = 0.0
        self._peak: Pose | None = None
        #: The first pose at which the run had taken more than it may.
        self._over: Pose | None = None

    def feed(self, event: Event) -> GoalOutcome | None:
        if not isinstance(event, Pose) or event.work is None:
            return None
        last, self._last = self._last, event
        if last is not None and event.t > last.t:
            self._driven_m += math.hypot(event.x - last.x, event.y - last.y) / MICRO
            found_w = (event.work - (last.work or 0)) / MICRO / ((event.t - last.t) / NS_PER_S)
            if found_w > self._peak_w:
                self._peak_w, self._peak = found_w, event
        if self._over is None and event.work / MICRO > self._most_j:
            self._over = event
            return self.finish(event.t)
        return None

    def finish(self, end: Nanos) -> GoalOutcome:
        if self._last is None or self._last.work is None:
            return GoalOutcome(met=False, says="the run does not tell the work at the rims")
        work_j = self._last.work / MICRO
        # Nothing for no way is within any bound.
        allowed_j = self._a_metre_j * self._driven_m if math.isfinite(self._a_metre_j) else math.inf
        by = min(self._most_j, allowed_j) - work_j
        says = f"{work_j:.3f} J for {self._driven_m:.2f} m"
        if self._driven_m:
            says += f", {work_j / self._driven_m:.3f} J a metre"
        if self._peak is not None:
            says += f", most at {seconds(self._peak.t)}, {_place(self._peak)}: {self._peak_w:.2f} W"
        if self._over is not None:
            says = f"more than {self._most_j:g} J from {seconds(self._over.t)}, {_place(self._over)}, on; {says}"
        elif by < 0:
            says += f"; {self._a_metre_j:g} J a metre are allowed"
        return GoalOutcome(met=by >= 0, says=says, robustness=by, unit="J")


def _region(table: RegionTable) -> str:
    if table.area_m is not None:
        low_x, low_y, high_x, high_y = table.area_m
        return f"x {low_x:g} to {high_x:g} m, y {low_y:g} to {high_y:g} m"
    x_m, y_m, radius_m = table.circle
    return f"the {radius_m:g} m around x {x_m:g} m, y {y_m:g} m"


_ONE_REGION = ("area_m", "radius_m")

KINDS: Mapping[str, GoalKind] = {
    "no_collision": GoalKind(
        NoKeys, lambda _: "touches nothing", lambda _: NoCollision(),
        doc="the hull touches nothing; a failure names what was hit, when, where and with which part",
        needs_world=True,
    ),
    "min_distance": GoalKind(
        MinDistanceTable,
        lambda table: "drives at least " + " and ".join(
            given_in_words(("", table.distance_m, " m"), ("", table.distance_m_a_minute, " m a minute"))
        ),
        MinDistance, doc="the path is at least so long", any_of=("distance_m", "distance_m_a_minute"),
    ),
    "cells": GoalKind(
        CellsTable, lambda table: f"enters at least {table.least} different cells of 0.5 m", Cells,
        doc="so many different cells of 0.5 m were entered",
    ),
    "reach": GoalKind(
        ReachTable, lambda table: f"reaches {_region(table)}{window_in_words(within_s=table.within_s)}", Reach,
        doc="the robot's centre comes into the region, in time", any_of=_ONE_REGION, is_scripted=True,
    ),
    "avoid": GoalKind(
        RegionTable, lambda table: f"stays out of {_region(table)}", lambda table: Stay(table, is_inside=False),
        doc="its centre stays out of the region", any_of=_ONE_REGION,
    ),
    "stay_within": GoalKind(
        RegionTable, lambda table: f"stays within {_region(table)}", lambda table: Stay(table, is_inside=True),
        doc="its centre stays in the region", any_of=_ONE_REGION,
    ),
    "clearance": GoalKind(
        ClearanceTable, lambda table: f"keeps {table.least_m:g} m away from everything", LeastClearance,
        doc="the hull stays so far from everything", needs_world=True,
    ),
    "stop_within": GoalKind(
        StopWithinTable,
        lambda table: f"stands still{window_in_words(table.after, within_s=table.within_s)}"
        + "".join(given_in_words((" and ", table.way_m, " m"))),
        StopWithin, doc="after each such event the robot stands in time, no further on; with `if_any = true` also "
        "where there is none",
    ),
    "moves_on": GoalKind(
        MovesOnTable,
        lambda table: f"gets {table.way_m:g} m away from each place"
        + window_in_words(from_s=table.from_s, within_s=table.within_s)
        + "".join(given_in_words((" of seeing ", table.free_m, " m of free floor"))),
        MovesOn, doc="it gets so far away from each place in time: it neither stands nor turns on the spot nor is shut "
        "in; the next place is where it was so far away; with `free_m` its time there counts from when all sonar "
        "`ahead` have been free beyond that for 0.4 s, so that a way out of a dead end may take longer",
    ),
    "smooth": GoalKind(
        SmoothTable, lambda table: f"accelerates no rim by more than {table.most_mps2:g} m/s²", Smooth,
        doc="no rim changes its speed faster, from pose to pose",
    ),
    "energy": GoalKind(
        EnergyTable,
        lambda table: "takes at most " + " and ".join(
            given_in_words(("", table.most_j, " J"), ("", table.most_j_a_metre, " J a metre"))
        ),
        Energy, doc="the work at the rims, |torque · rate| of both wheels over the run, stays within so many "
        "joules; a failure says where it became more, and where the power was greatest",
        any_of=("most_j", "most_j_a_metre"), needs_world=True,
    ),
}  # fmt: skip
