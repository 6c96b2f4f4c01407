"""Goals on how a robot answers to what its sonar see: turns, arcs and ways back that have no reason.

They judge what the robot does at any place by what it can know there, so that a fault shows long before it has led to
a contact. The sides are those of a Pioneer's front ring, sonar 2 to 4 left and 5 to 7 right; `left` and `right` name
others. Ranges are as old as the ring is slow: each sonar of eight is new every 0.4 s.

The measure of a goal is the share that is left of what it allows: 1 at best, so that it hides no other goal's margin
from a search.

Invariant: where no range is known yet, nothing is missed.
"""

import math
from collections.abc import Sequence

from p2os.toml_schema import Table
from robot_bench.events.kinds import MICRO, Event, Pose, Ranges
from robot_bench.scenario.goals.watch import GoalOutcome, Watch, number, seconds
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


def _place(pose: Pose) -> str:
    return f"{seconds(pose.t)}, x {pose.x_m:.2f} m, y {pose.y_m:.2f} m"


def _difference_mps(pose: Pose) -> float:
    """Return by how much the right rim is faster: positive turns left."""
    return (pose.right - pose.left) / MICRO


def _spins(pose: Pose) -> bool:
    return abs(pose.speed_mps) <= DRIVES_MPS and abs(_difference_mps(pose)) >= SPINS_MPS


class _Sides:
    """What stands near on one side only."""

    def __init__(self, table: Table) -> None:
        self._near_mm, self._free_mm = (1000 * number(table, key) for key in ("near_m", "free_m"))
        if self._free_mm < self._near_mm:
            raise UsageError("free_m is below near_m", hint="near_m = 0.5 and free_m = 0.8")
        self._sides = tuple(_numbers(table, key, default) for key, default in (("left", LEFT), ("right", RIGHT)))

    def nearer(self, ranges: Ranges | None) -> int:
        """Return the side on which something is near while the other is free: 1 left, -1 right, 0 neither or both."""
        if ranges is None:
            return 0
        left_mm, right_mm = (
            min((ranges.mm[one - 1] for one in side if one <= len(ranges.mm)), default=math.inf) for side in self._sides
        )
        if left_mm < self._near_mm and right_mm > self._free_mm:
            return 1
        return -1 if right_mm < self._near_mm and left_mm > self._free_mm else 0


def _numbers(table: Table, key: str, default: Sequence[int]) -> Sequence[int]:
    found = table.get(key, default)
    if not isinstance(found, (list, tuple)) or not all(type(one) is int and one > 0 for one in found):
        raise UsageError(f"{key} must be a list of the numbers of sonar, from 1", hint=f"{key} = {list(default)}")
    return [int(one) for one in found]


class TurnsAway(Watch):
    """Turns on the spot go away from what stands on one side only; so many in a row may go towards it."""

    STATE = ("_ranges", "_last", "_side", "_turned_m", "_begun", "_ended", "_row", "_worst", "_worst_at")
    kinds = (Ranges, Pose)

    def __init__(self, table: Table) -> None:
        self._sides = _Sides(table)
        self._most = int(number(table, "row"))
        self._apart_m = number(table, "apart_m", 0.5)
        self._ranges: Ranges | None = None
        self._last: Pose | None = None
        #: Of the turn that goes on: the side that was nearer as it began, how far the rims parted, its first pose.
        self._side, self._turned_m = 0, 0.0
        self._begun: Pose | None = None
        #: Where the last turn ended.
        self._ended: Pose | None = None
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
            ended = self._ended
            is_another = ended is None or math.hypot(pose.x - ended.x, pose.y - ended.y) >= self._apart_m * MICRO
            self._side = self._sides.nearer(self._ranges) if is_another else 0
            return None
        before, self._turned_m = abs(self._turned_m), self._turned_m + _difference_mps(pose) * took_s
        if not self._side or not before < TURN_M <= abs(self._turned_m):
            return None
        self._row = self._row + 1 if self._turned_m * self._side > 0 else 0
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


class _NotLong(Watch):
    """Something that must not last: the longest time from pose to pose is measured."""

    STATE = ("_ranges", "_since", "_longest", "_longest_at")
    kinds = (Ranges, Pose)
    #: What is said of it.
    words = ""

    def __init__(self, table: Table) -> None:
        self._within_s = number(table, "within_s")
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
                was_long, self._longest, self._longest_at = self._is_long, lasted, self._since
                return self.finish(event.t) if self._is_long and not was_long else None
        return None

    @property
    def _is_long(self) -> bool:
        return self._longest > self._within_s * NS_PER_S

    def finish(self, end: Nanos) -> GoalOutcome:
        by = 1 - self._longest / NS_PER_S / self._within_s
        if not self._is_long or self._longest_at is None:
            return GoalOutcome(met=True, robustness=by, unit=ALLOWED)
        says = f"for {self._longest / NS_PER_S:.2f} s from {_place(self._longest_at)}, {self.words}"
        return GoalOutcome(met=False, says=f"{says}; {self._within_s:g} s are allowed", robustness=by, unit=ALLOWED)


class SteersAway(_NotLong):
    """On its way forward the robot bends away from what stands on one side only."""

    words = "it bent towards what stood on one side alone"

    def __init__(self, table: Table) -> None:
        super().__init__(table)
        self._sides = _Sides(table)

    def is_bad(self, pose: Pose) -> bool:
        difference_mps = _difference_mps(pose)
        if pose.speed_mps <= DRIVES_MPS or abs(difference_mps) < BENDS_MPS:
            return False
        return self._sides.nearer(self._ranges) * difference_mps > 0


class NoIdleTurn(_NotLong):
    """The robot does not go on turning on the spot where everything is free."""

    words = "it turned on the spot where everything was free"

    def __init__(self, table: Table) -> None:
        super().__init__(table)
        self._free_mm = 1000 * number(table, "free_m")

    def is_bad(self, pose: Pose) -> bool:
        return _spins(pose) and self._ranges is not None and min(self._ranges.mm, default=0) > self._free_mm


class BacksOnPath(Watch):
    """What goes back stays on ground that it has come over, since it sees nothing behind."""

    STATE = ("_path", "_worst_m", "_worst_at")
    kinds = (Pose,)

    def __init__(self, table: Table) -> None:
        self._most_m = number(table, "off_m")
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
