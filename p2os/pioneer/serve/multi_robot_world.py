"""Robots that share one world: they sense each other with their sonar and stop each other.

Theory of operation
-------------------
Every robot has a body of its own with its own copy of the world; the multi-robot world shows each of
them where the others stand. Time is cut at boundaries, 10 ms apart. At a boundary every
robot's place is taken, and who could touch whom before the next boundary is worked out from circles
around the hulls. A robot that is near no other runs the 10 ms by itself: what its sonar
measures stands where it stood at the boundary. Robots that are near to each other run step by
step (1 ms), the first robot first: when it is a robot's turn, those before it have made this
step and those after it have not. So two hulls never come to overlap. Between two steps, what
is due (packets, pings, commands) happens with every one of these bodies at the same time.

A thing that one robot has pushed is moved in the others' copies: after its step for those
that are near, at the boundary for all. Where several have pushed it at once, the nearest
one's report counts.

Invariant: what happens depends on the order of the robots and on the bytes and their times,
not on how often a caller calls `advance_to`, nor for which robot first.

Not modelled: a robot that is driven against does not give way, whatever the masses; one that
receives another's ping.
"""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from itertools import product

from p2os.pioneer.body.contract import FASTEST_MPS, RobotBody
from p2os.pioneer.body.other_robots import (
    OtherRobot,
    OtherRobots,
    SeesOtherRobots,
    StandingPose,
    free_name,
    highest_floor,
)
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.world.model import Obstacle, World
from simbase.errors import UsageError
from simbase.state import Stateful
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos, Reached

#: chosen: 5 mm at half a metre a second, which is less than what a sonar's own noise is.
SLICE_NS: Nanos = 10 * NS_PER_MS
#: How much nearer two hulls can come within a slice, m.
CLOSING_M = 2 * FASTEST_MPS * SLICE_NS / NS_PER_S

#: chosen: how far apart two robots may be and still be looked at in a sweep, beyond being near, m.
SPARE_M = 0.4


@dataclass(slots=True)
class Member(Stateful):
    """One robot of a multi-robot world."""

    STATE = ("pioneer", "as_other", "near", "shown")

    number: int
    pioneer: Pioneer
    body: RobotBody
    as_other: OtherRobot
    other_robots: OtherRobots
    #: Brings the robot to a time: with what its line delivers until then, if it has one.
    advance_to: Callable[[Nanos], object]
    #: Where it stood at first.
    start: StandingPose
    #: The numbers of those that it could touch before the next boundary.
    near: tuple[int, ...] = ()
    #: Where it was shown the others last; None where its body looks for them itself.
    shown: dict[str, StandingPose] | None = None


class MultiRobotWorld(Stateful):
    """Robots in one world.

    Args:
        robots: Each with its controller and its body, standing at its place; time 0, the first robot first.
        world: That all of them have a copy of.

    Raises:
        UsageError: A body's step does not fit, or the robots do not begin at time 0.
    """

    STATE = ("members", "_slice_end", "_step_boundary", "_reports")
    DERIVED = ("_swept", "_spare_m", "_close", "_alone")

    def __init__(self, robots: Sequence[tuple[Pioneer, RobotBody]], world: World) -> None:
        rise = highest_floor(world)
        steps = {body.dt_ns for _, body in robots}
        if len(steps) != 1 or SLICE_NS % min(steps):
            raise UsageError("robots of one world need bodies of one step, a part of 10 ms")
        self._step_ns = steps.pop()
        as_others = [
            OtherRobot(free_name(number, world), pioneer.parameters, body, rise)
            for number, (pioneer, body) in enumerate(robots, start=1)
        ]
        self.members: tuple[Member, ...] = tuple(
            Member(
                index, pioneer, body, as_others[index],
                OtherRobots([*as_others[:index], *as_others[index + 1 :]], pioneer.parameters), pioneer.advance_to,
                as_others[index].current,
            )
            for index, (pioneer, body) in enumerate(robots)
        )  # fmt: skip
        #: A robot that pushes a thing is near to whatever stands behind it.
        self._margin_m = CLOSING_M + 2 * max((item.reach_m for item in world.obstacles if item.mass_kg > 0), default=0)
        #: Up to here every robot runs by what was seen at the boundary before.
        self._slice_end: Nanos = SLICE_NS
        #: The bodies of all that are near to another stand at this step.
        self._step_boundary: Nanos = 0
        #: Thing → who has moved it since the last boundary → where it is to him now.
        self._reports: dict[str, dict[int, Obstacle]] = {}
        for member in self.members:
            if isinstance(member.body, SeesOtherRobots):
                member.body.join(member.other_robots)
            else:
                member.shown = {}
                for other in member.other_robots.others:
                    member.body.place(other.obstacle(other.current))
                    member.shown[other.name] = other.current
        #: Those who keep copies of the others in their worlds.
        self._copying = tuple(member for member in self.members if member.shown is not None)
        #: Where all stood at the last sweep, and how much two of them at least were farther apart than near.
        self._swept: list[StandingPose] = []
        self._spare_m = 0.0
        self._close: tuple[Member, ...] = ()
        self._alone: tuple[Member, ...] = self.members
        self._find_close()

    def _restored(self) -> None:
        self._spare_m = 0.0  # sweep at the next boundary
        self._regroup()

    @property
    def robots(self) -> tuple[Pioneer, ...]:
        """The robots, the first first."""
        return tuple(member.pioneer for member in self.members)

    def bodies_at(self, now: Nanos) -> list[RobotBody]:
        """Return every robot's body, all brought to a time, for what changes the world of all of them.

        The robots themselves are not to be moved or removed by it.
        """
        self.advance_to(now)
        return [member.body for member in self.members]

    def start_over(self, numbers: Collection[int], now: Nanos) -> None:
        """Put some robots back at their starts (`Pioneer.start_over`), and what was pushed for all of them.

        Args:
            numbers: Which, from 0.
            now: When, nanoseconds.

        Raises:
            UsageError: Another robot stands where one of them starts; nothing has changed then.
        """
        self.advance_to(now)
        chosen = [self.members[number] for number in sorted(set(numbers))]
        for member, other in product(chosen, self.members):
            start = member.as_other.footprint(member.start)
            if other not in chosen and start.overlaps(other.as_other.footprint(other.as_other.look()).polygon):
                raise UsageError(
                    f"{other.as_other.name} stands where {member.as_other.name} starts",
                    hint="drive it away, or put all back: reset",
                )
        for member in chosen:
            member.pioneer.start_over(now)
            member.as_other.at_boundary = member.as_other.look()
            self._take_pushed(member)
        for member in chosen:
            self._show(member.as_other, member.as_other.current)
        self._spread_pushed()
        self._spare_m = 0.0  # sweep anew
        self._find_close()

    def next_deadline(self) -> Nanos | None:
        """Return when bytes of any robot will come out; None when never."""
        due = [at for member in self.members if (at := member.pioneer.next_deadline()) is not None]
        return min(due, default=None)

    def advance_to(self, limit: Nanos) -> Reached:
        """Bring every robot to a time."""
        self._pass_boundaries(limit)
        self._step_close(limit)
        for member in self._alone:
            member.advance_to(limit)
        return Reached(limit)

    def bring(self, number: int, limit: Nanos) -> None:
        """Bring one robot to a time, and the others as far as it takes; needed before bytes are given to it.

        Args:
            number: Which, from 0.
            limit: Until when, nanoseconds.
        """
        self._pass_boundaries(limit)
        member = self.members[number]
        if member.other_robots.is_close:
            self._step_close(limit)
        else:
            member.advance_to(limit)

    # Within a slice ------------------------------------------------------------------

    def _pass_boundaries(self, limit: Nanos) -> None:
        """Bring every robot past every boundary before a time."""
        while (end := self._slice_end) < limit:
            self._step_close(end)
            for member in self._alone:
                member.advance_to(end)
            self._slice_end += SLICE_NS
            self._step_boundary = end
            self._exchange_poses()

    def _step_close(self, limit: Nanos) -> None:
        """Bring those that are near to another to a time of this slice, step by step together."""
        close = self._close
        while close and self._step_boundary < limit:
            start = self._step_boundary
            for member in close:  # what is due until all have made the last step
                member.advance_to(start)
            for member in close:
                member.advance_to(start + 1)  # the least time that takes the body to its next step
                member.as_other.look()
                self._take_pushed(member)
                self._show(member.as_other, member.as_other.current, only_close=True)
            self._step_boundary = start + self._step_ns
        for member in close:
            member.advance_to(limit)

    def _take_pushed(self, member: Member) -> None:
        """Note what a robot has pushed; those that run with it step by step see it at once."""
        for item in member.body.take_moved():
            if item.walk is not None:
                continue
            reports = self._reports.setdefault(item.name, {})
            if member.other_robots.is_close:
                for other in self._close:
                    reports.pop(other.number, None)
                    if other is not member:
                        other.body.move(item.name, item.x_m, item.y_m, item.heading_rad)
            reports[member.number] = item

    def _show(self, as_other: OtherRobot, standing_pose: StandingPose, *, only_close: bool = False) -> None:
        """Move a robot in the worlds of those that keep a copy of it there."""
        name = as_other.name
        for member in self._copying:
            if only_close and not member.other_robots.is_close:
                continue
            if member.shown is not None and member.as_other is not as_other and member.shown[name] != standing_pose:
                as_other.move_in(member.body, standing_pose)
                member.shown[name] = standing_pose

    # At a boundary ---------------------------------------------------------------------

    def _exchange_poses(self) -> None:
        """Show every robot where all the others and the pushed things are now."""
        for member in self._alone:
            member.as_other.look()
            self._take_pushed(member)
        self._spread_pushed()
        for member in self.members:
            member.as_other.at_boundary = member.as_other.current
            self._show(member.as_other, member.as_other.current)
        self._find_close()

    def _spread_pushed(self) -> None:
        for name, reports in self._reports.items():
            chosen = min(reports, key=lambda number: (self._distance(number, reports[number]), number))
            item, is_close = reports[chosen], self.members[chosen].other_robots.is_close
            for member in self.members:
                if member.number != chosen and not (is_close and member.other_robots.is_close):
                    member.body.move(name, item.x_m, item.y_m, item.heading_rad)
        self._reports.clear()

    def _distance(self, number: int, item: Obstacle) -> float:
        standing_pose = self.members[number].as_other.current
        return math.dist((standing_pose.x_m, standing_pose.y_m), (item.x_m, item.y_m))

    def _find_close(self) -> None:
        """Find who could touch whom before the next boundary: sweep along x over circles around the hulls."""
        if not self._close and self._is_sweep_valid():
            return
        near: dict[int, list[int]] = {}
        row = sorted((*member.as_other.current[:2], member.as_other.reach_m, member.number) for member in self.members)
        farthest = max(reach for _, _, reach, _ in row) + self._margin_m + SPARE_M
        self._spare_m = SPARE_M
        for place, (x, y, reach, number) in enumerate(row):
            for other in range(place + 1, len(row)):
                other_x, other_y, other_reach, other_number = row[other]
                if other_x - x > reach + farthest:
                    break
                between_m = math.hypot(other_x - x, other_y - y) - reach - other_reach - self._margin_m
                if between_m < 0:
                    near.setdefault(number, []).append(other_number)
                    near.setdefault(other_number, []).append(number)
                self._spare_m = min(self._spare_m, between_m)
        self._swept = [member.as_other.current for member in self.members]
        if not near and not self._close:
            return
        for member in self.members:
            member.near = tuple(sorted(near.get(member.number, ())))
        self._regroup()

    def _is_sweep_valid(self) -> bool:
        """Tell whether no robot has moved so far since the last sweep that two could be near to each other now."""
        allowed_m = self._spare_m / 2
        return allowed_m > 0 and all(
            math.hypot(member.as_other.current[0] - before[0], member.as_other.current[1] - before[1]) < allowed_m
            for member, before in zip(self.members, self._swept, strict=True)
        )

    def _regroup(self) -> None:
        for member in self.members:
            member.other_robots.come_near(self.members[number].as_other for number in member.near)
        self._close = tuple(member for member in self.members if member.other_robots.is_close)
        self._alone = tuple(member for member in self.members if not member.other_robots.is_close)
