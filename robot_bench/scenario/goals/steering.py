"""Goals on how a robot answers to what its sonar see: turns, arcs and ways back that have no reason.

They judge what the robot does at any place by what it can know there, so that a fault shows long before it has led to
a contact. The sides are those of a Pioneer's front ring, sonar 2 to 4 left and 5 to 7 right; `left` and `right` name
others. Ranges are as old as the ring is slow: each sonar of eight is new every 0.4 s.

The measure of a goal is the share that is left of what it allows: 1 at best, so that it hides no other goal's margin
from a search.

Invariant: where no range is known yet, nothing is missed.
"""

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

from p2os.toml_record import Record
from p2os.toml_schema import Key
from robot_bench.events.kinds import MICRO, Event, Pose, Ranges
from robot_bench.scenario.goals.watch import GoalKind, GoalOutcome, InTime, Watch, seconds
from simbase.errors import UsageError
from simbase.timing import NS_PER_S, Nanos

#: Of a Pioneer's front ring, without those straight to the sides: what lies there is passed already.
LEFT, RIGHT = (2, 3, 4), (5, 6, 7)
#: chosen: m/s, as of what moves (`robot moves`), and what a turn on the spot may move on.
DRIVES_MPS = 0.05
#: chosen: m/s between the rims; of a Pioneer's 0.33 m 0.3 and 0.15 rad/s.
SPINS_MPS, BENDS_MPS = 0.1, 0.05
#: chosen: how far the rims part in what counts as a turn, metres: 20° on a Pioneer's axle.
TURN_M = 0.12
#: What a measure is of.
ALLOWED = "of what is allowed"
#: Poses of a path are kept so far apart, m.
PATH_STEP_M = 0.02
_Free = Annotated[float, Key(above=0, most=100, doc="beyond that a side is free")]
_Sonar = Annotated[tuple[int, ...], Key(doc="numbers of the sonar on that side, from 1")]


class SidesTable(Record):
    """What counts as near on one side and as free on the other."""

    near_m: Annotated[float, Key(above=0, most=100, doc="nearer than that something is on a side")]
    free_m: _Free
    left: _Sonar = LEFT
    right: _Sonar = RIGHT

    def __post_init__(self) -> None:
        if self.free_m < self.near_m:
            raise UsageError("free_m is below near_m", hint="near_m = 0.5 and free_m = 0.8")
        for key, side, usual in (("left", self.left, LEFT), ("right", self.right, RIGHT)):
            if not all(type(one) is int and one > 0 for one in side):
                raise UsageError(f"{key} must be a list of the numbers of sonar, from 1", hint=f"{key} = {list(usual)}")


def _place(pose: Pose) -> str:
    return f"{seconds(pose.t)}, x {pose.x_m:.2f} m, y {pose.y_m:.2f} m"


def _difference_mps(pose: Pose) -> float:
    """Return by how much the right rim is faster: positive turns left."""
    return (pose.right - pose.left) / MICRO


def _spins(pose: Pose) -> bool:
    return abs(pose.speed_mps) <= DRIVES_MPS and abs(_difference_mps(pose)) >= SPINS_MPS


def _nearest_mm(ranges: Ranges | None, side: tuple[int, ...]) -> float:
    """Return the least range of the sonar on a side; infinity where none is known."""
    mm = ranges.mm if ranges is not None else ()
    return min((mm[one - 1] for one in side if one <= len(mm)), default=math.inf)


class _Sides:
    """What stands near on one side only."""

    def __init__(self, table: SidesTable) -> None:
        self._near_mm, self._free_mm = 1000 * table.near_m, 1000 * table.free_m
        self._sides = table.left, table.right

    def nearer(self, ranges: Ranges | None) -> int:
        """Return the side on which something is near while the other is free: 1 left, -1 right, 0 neither or both."""
        left_mm, right_mm = (_nearest_mm(ranges, side) for side in self._sides)
        if left_mm < self._near_mm and right_mm > self._free_mm:
            return 1
        return -1 if right_mm < self._near_mm and left_mm > self._free_mm else 0


class TurnsAwayTable(SidesTable):
    """Sides, and how many turns in a row may go the wrong way."""

    row: Annotated[int, Key(least=0, most=1000, doc="so many in a row may not")] = 0
    within_turns: Annotated[
        int, Key(least=0, most=1000, doc="one is in a row with another at most so many turns before it; 0: with any")
    ] = 0
    apart_m: Annotated[float, Key(least=0, most=100, doc="what begins nearer to the last turn belongs to it")] = 0.5


class TurnsAway(Watch):
    """Turns on the spot go away from what stands on one side only; so many in a row may go towards it."""

    STATE = (
        "_ranges", "_last", "_side", "_turned_m", "_begun", "_ended", "_turns", "_wrong", "_row", "_worst", "_worst_at",
    )  # fmt: skip
    kinds = (Ranges, Pose)

    def __init__(self, table: TurnsAwayTable) -> None:
        self._sides = _Sides(table)
        self._most, self._apart_m, self._within = table.row, table.apart_m, table.within_turns or math.inf
        self._ranges: Ranges | None = None
        self._last: Pose | None = None
        #: Of the turn that goes on: the side that was nearer as it began, how far the rims parted, its first pose.
        self._side, self._turned_m = 0, 0.0
        self._begun: Pose | None = None
        #: Where the last turn ended.
        self._ended: Pose | None = None
        #: How many turns have begun, and the number of the last that went to the wrong side.
        self._turns = self._wrong = 0
        self._row = self._worst = 0
        self._worst_at: Pose | None = None

    def feed(self, event: Event) -> GoalOutcome | None:
        if isinstance(event, Ranges):
            self._ranges = event
        elif isinstance(event, Pose):
            last, self._last = self._last, event
            if _spins(event):
                return self._turn(event, (event.t - last.t) / NS_PER_S if last is not None else 0.0)
            if self._begun is not None and abs(self._turned_m) >= TURN_M:
                self._ended = last
            self._begun = None
        return None

    def _turn(self, pose: Pose, took_s: float) -> GoalOutcome | None:
        if self._begun is None:
            self._begun, self._turned_m = pose, 0.0
            self._turns += 1
            ended = self._ended
            is_another = ended is None or math.hypot(pose.x - ended.x, pose.y - ended.y) >= self._apart_m * MICRO
            self._side = self._sides.nearer(self._ranges) if is_another else 0
            return None
        before, self._turned_m = abs(self._turned_m), self._turned_m + _difference_mps(pose) * took_s
        if not self._side or not before < TURN_M <= abs(self._turned_m):
            return None
        if self._turned_m * self._side > 0:
            self._row = self._row + 1 if self._turns - self._wrong <= self._within else 1
            self._wrong = self._turns
        else:
            self._row = 0
        if self._row > self._worst:
            self._worst, self._worst_at = self._row, self._begun
        return self.finish(pose.t) if self._row == self._most + 1 == self._worst else None

    def finish(self, end: Nanos) -> GoalOutcome:
        by = 1 - self._worst / (self._most + 1)
        if by > 0 or self._worst_at is None:
            return GoalOutcome(met=True, robustness=by, unit=ALLOWED)
        says = (
            f"{self._worst} turn(s) in a row went to the side that was not free, the last at {_place(self._worst_at)}"
        )
        return GoalOutcome(met=False, says=says, robustness=min(by, -1 / (self._most + 1)), unit=ALLOWED)


class TurnsLongTable(Record):
    """Turns that belong together, and what one of them has to be."""

    row: Annotated[int, Key(least=1, most=1000, doc="of so many in a row one is long")]
    way_m: Annotated[float, Key(above=0, most=100, doc="what begins after less way than that belongs to the last one")]
    least_deg: Annotated[float, Key(above=0, most=3600, doc="so far a long one turns")]


class TurnsLong(Watch):
    """Of so many turns on the spot, each soon after another, one is long: it does not swing to and fro in a corner."""

    STATE = ("_last", "_way_um", "_is_soon", "_turned", "_row", "_worst", "_worst_at")
    kinds = (Pose,)

    def __init__(self, table: TurnsLongTable) -> None:
        self._table = table
        self._last: Pose | None = None
        #: Since the last turn; far enough where there was none, or it went back since.
        self._way_um: float = math.inf
        #: Of the turn that goes on: whether it belongs to the one before, and by how much it has turned, radians.
        self._is_soon = False
        self._turned: float | None = None
        self._row = self._worst = 0
        self._worst_at: Pose | None = None

    def feed(self, event: Event) -> GoalOutcome | None:
        if not isinstance(event, Pose):
            return None
        last, self._last = self._last, event
        if last is None:
            return None
        if _spins(event):
            if self._turned is None:
                self._is_soon, self._turned = self._way_um < self._table.way_m * MICRO, 0.0
            self._turned += math.remainder(event.heading_rad - last.heading_rad, math.tau)
            return None
        if self._turned is not None:
            is_short = self._is_soon and abs(self._turned) < math.radians(self._table.least_deg)
            self._row, self._turned, self._way_um = self._row + 1 if is_short else 0, None, 0.0
            if self._row > self._worst:
                self._worst, self._worst_at = self._row, event
                if self._row == self._table.row:
                    return self.finish(event.t)
        self._way_um += math.hypot(event.x - last.x, event.y - last.y) if event.speed_mps >= -DRIVES_MPS else math.inf
        return None

    def finish(self, end: Nanos) -> GoalOutcome:
        by = 1 - self._worst / self._table.row
        if by > 0 or self._worst_at is None:
            return GoalOutcome(met=True, robustness=by, unit=ALLOWED)
        says = f"{self._worst} turns in a row were short, the last at {_place(self._worst_at)}"
        return GoalOutcome(met=False, says=says, robustness=min(by, -1 / self._table.row), unit=ALLOWED)


class _NotLong(Watch):
    """Something that must not last: the longest time from pose to pose is measured."""

    STATE: ClassVar[tuple[str, ...]] = ("_ranges", "_since", "_longest", "_longest_at")
    kinds = (Ranges, Pose)
    #: What is said of it.
    words = ""

    def __init__(self, within_s: float) -> None:
        self._within_s = within_s
        self._ranges: Ranges | None = None
        self._since: Pose | None = None
        self._longest: Nanos = 0
        self._longest_at: Pose | None = None

    def is_bad(self, pose: Pose) -> bool:
        """Tell whether it is so at a pose."""
        raise NotImplementedError

    def feed(self, event: Event) -> GoalOutcome | None:
        if isinstance(event, Ranges):
            self._ranges = event
        elif isinstance(event, Pose):
            self._since = (self._since or event) if self.is_bad(event) else None
            if self._since is not None and (lasted := event.t - self._since.t) > self._longest:
                before, self._longest, self._longest_at = self._longest, lasted, self._since
                return self.finish(event.t) if before <= self._within_s * NS_PER_S < lasted else None
        return None

    def finish(self, end: Nanos) -> GoalOutcome:
        by = 1 - self._longest / NS_PER_S / self._within_s
        if self._longest <= self._within_s * NS_PER_S or self._longest_at is None:
            return GoalOutcome(met=True, robustness=by, unit=ALLOWED)
        says = f"for {self._longest / NS_PER_S:.2f} s from {_place(self._longest_at)}, {self.words}"
        return GoalOutcome(met=False, says=f"{says}; {self._within_s:g} s are allowed", robustness=by, unit=ALLOWED)


class SteersAwayTable(SidesTable):
    """Sides, and for how long it may bend the wrong way."""

    within_s: InTime


class NoIdleTurnTable(Record):
    """What is free, for how long it may turn there, and which turns may be long whatever it sees."""

    free_m: _Free
    within_s: InTime
    long_deg: Annotated[float, Key(least=0, most=3600, doc="so far a long turn may go, whatever is free")] = 0.0
    apart_m: Annotated[float, Key(least=0, most=100, doc="what begins nearer to the last turn is soon after it")] = 0.5


class SteersAway(_NotLong):
    """On its way forward the robot bends away from what stands on one side only."""

    words = "it bent towards what stood on one side alone"

    def __init__(self, table: SteersAwayTable) -> None:
        super().__init__(table.within_s)
        self._sides = _Sides(table)

    def is_bad(self, pose: Pose) -> bool:
        difference_mps = _difference_mps(pose)
        if pose.speed_mps <= DRIVES_MPS or abs(difference_mps) < BENDS_MPS:
            return False
        return self._sides.nearer(self._ranges) * difference_mps > 0


class NoIdleTurn(_NotLong):
    """The robot does not go on turning on the spot where everything is free, but for turns that are long on purpose."""

    STATE = ("_last", "_ended", "_goes_back", "_is_long_due", "_turned")
    words = "it turned on the spot where everything was free"

    def __init__(self, table: NoIdleTurnTable) -> None:
        super().__init__(table.within_s)
        self._free_mm, self._apart_um = 1000 * table.free_m, table.apart_m * MICRO
        self._long_rad = math.radians(table.long_deg)
        self._last: Pose | None = None
        self._ended: Pose | None = None  # where the last turn did
        #: Whether it last went back; of the turn that goes on, whether it may be long, and how far it is, radians.
        self._goes_back = self._is_long_due = False
        self._turned: float | None = None

    def is_bad(self, pose: Pose) -> bool:
        last, self._last = self._last, pose
        if not _spins(pose):
            self._ended, self._turned = last if self._turned is not None else self._ended, None
            if abs(pose.speed_mps) > DRIVES_MPS:
                self._goes_back = pose.speed_mps < 0
            return False
        if self._turned is None or last is None:
            self._turned, self._is_long_due = 0.0, self._may_be_long(pose)
        else:
            self._turned += math.remainder(pose.heading_rad - last.heading_rad, math.tau)
        is_judged = not self._is_long_due or abs(self._turned) >= self._long_rad
        return is_judged and self._ranges is not None and min(self._ranges.mm, default=0) > self._free_mm

    def _may_be_long(self, pose: Pose) -> bool:
        """Tell whether a turn that begins here is soon after another, after going back, or between two things."""
        if self._goes_back or ((at := self._ended) and math.hypot(pose.x - at.x, pose.y - at.y) < self._apart_um):
            return True
        return all(_nearest_mm(self._ranges, side) <= self._free_mm for side in (LEFT, RIGHT))


class BacksOnPathTable(Record):
    """How far off its way."""

    off_m: Annotated[float, Key(above=0, most=100, doc="so near to the way that it has come")]


class BacksOnPath(Watch):
    """What goes back stays on ground that it has come over, since it sees nothing behind."""

    STATE = ("_path", "_worst_m", "_worst_at")
    kinds = (Pose,)

    def __init__(self, table: BacksOnPathTable) -> None:
        self._most_m = table.off_m
        #: Places before the robot last began to go back, micrometres.
        self._path: list[tuple[int, int]] = []
        self._worst_m = 0.0
        self._worst_at: Pose | None = None

    def feed(self, event: Event) -> GoalOutcome | None:
        if not isinstance(event, Pose):
            return None
        if event.speed_mps >= -DRIVES_MPS or not self._path:
            if not self._path or math.dist(self._path[-1], (event.x, event.y)) >= PATH_STEP_M * MICRO:
                self._path.append((event.x, event.y))
            return None
        off_m = min(math.hypot(x - event.x, y - event.y) for x, y in self._path) / MICRO
        was_off = self._worst_m > self._most_m
        if off_m > self._worst_m:
            self._worst_m, self._worst_at = off_m, event
        return self.finish(event.t) if self._worst_m > self._most_m and not was_off else None

    def finish(self, end: Nanos) -> GoalOutcome:
        by = 1 - self._worst_m / self._most_m
        if by >= 0 or self._worst_at is None:
            return GoalOutcome(met=True, robustness=by, unit=ALLOWED)
        says = f"it went back {self._worst_m:.2f} m off the way that it had come at {_place(self._worst_at)}"
        return GoalOutcome(met=False, says=f"{says}, {self._most_m:g} m are allowed", robustness=by, unit=ALLOWED)


KINDS: Mapping[str, GoalKind] = {
    "turns_away": GoalKind(
        TurnsAwayTable,
        lambda table: f"turns on the spot away from what stands on one side, but for {table.row} in a row"
        + (f" within {table.within_turns} turns" if table.within_turns else ""),
        TurnsAway, doc="a turn on the spot that begins with something nearer than `near_m` on one side and the other "
        "free beyond `free_m` goes to the free one",
    ),
    "turns_long": GoalKind(
        TurnsLongTable,
        lambda table: f"of {table.row} turns on the spot with less than {table.way_m:g} m between them turns "
        f"{table.least_deg:g} degrees once",
        TurnsLong, doc="of `row` turns on the spot, each begun after less than `way_m` forward, one is long: it does "
        "not swing to and fro in a corner", holds_anywhere=True,
    ),
    "steers_away": GoalKind(
        SteersAwayTable,
        lambda table: f"bends towards what stands on one side for no longer than {table.within_s:g} s",
        SteersAway, doc="driving forward it does not bend towards the side that is not free, as above, for longer",
    ),
    "no_idle_turn": GoalKind(
        NoIdleTurnTable,
        lambda table: f"turns on the spot for no longer than {table.within_s:g} s where {table.free_m:g} m are free"
        + (f", long turns beyond {table.long_deg:g} degrees" if table.long_deg else ""),
        NoIdleTurn, doc="it does not go on turning on the spot for longer than that where every sonar is free; a turn "
        "that begins nearer than `apart_m` to the last, after going back, or with something on both sides is judged "
        "once it has turned `long_deg`",
    ),
    "backs_on_path": GoalKind(
        BacksOnPathTable, lambda table: f"goes back only within {table.off_m:g} m of the way that it came",
        BacksOnPath, doc="going back it stays so near to the way that it has come",
    ),
}  # fmt: skip
