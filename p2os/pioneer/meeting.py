"""Robots that share one world: they see each other with their sonar and stop each other.

Theory of operation
-------------------
Every robot has a body of its own with its own copy of the world; the meeting shows each of
them where the others stand. Time is cut at borders, 10 ms apart. At a border everybody's
place is taken, and who could touch whom before the next border is worked out from circles
around the hulls. A robot that nobody is near lives the 10 ms by itself: whom it hears with
its sonar stands where it stood at the border. Robots that are near to each other live step by
step (1 ms), the first robot first: when it is a robot's turn, those before it have made this
step and those after it have not. So two hulls never come to overlap. Between two steps, what
is due (packets, pings, commands) happens with every one of these bodies at the same time.

A thing that one robot has pushed is moved in the others' copies: after its step for those
that are near, at the border for all. Where several have pushed it at once, the nearest is
believed.

Invariant: what happens depends on the order of the robots and on the bytes and their times,
not on how often anybody calls `advance_to`, nor for which robot first.

Not modelled: a robot that is driven against does not give way, whatever the masses; one that
hears another's ping.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from p2os.errors import UsageError
from p2os.pioneer.body import RobotBody
from p2os.pioneer.company import Company, Presence, Sociable, Stand, free_name, highest_floor
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.scenery import Obstacle, World
from p2os.timing import NS_PER_MS, NS_PER_S, Nanos, Reached

#: chosen: 5 mm at half a metre a second, which is less than what a sonar's own noise is.
SLICE_NS: Nanos = 10 * NS_PER_MS
#: No point of a hull is faster: both rims at the highest ceiling of any model, against each other, m/s.
FASTEST_MPS = 8.0
#: How much nearer two hulls can come within a slice, m.
CLOSING_M = 2 * FASTEST_MPS * SLICE_NS / NS_PER_S

#: chosen: how far apart two robots may be and still be looked at in a sweep, beyond being near, m.
LOOSE_M = 0.4


@dataclass(slots=True)
class Seat:
    """One robot of a meeting."""

    number: int
    pioneer: Pioneer
    body: RobotBody
    presence: Presence
    company: Company
    #: Brings the robot to a time: with what its line delivers until then, if somebody delivers.
    advance_to: Callable[[Nanos], object]
    #: Where it was shown the others last; None where its body looks for them itself.
    shown: dict[str, Stand] | None = None


@dataclass(slots=True)
class _Times:
    #: Up to here everybody lives by what was seen at the border before.
    slice_end: Nanos = SLICE_NS
    #: The bodies of all that are near to somebody stand at this step.
    step_border: Nanos = 0


@dataclass(slots=True)
class _Pushed:
    #: Thing → who has moved it since the last border → where it is to him now.
    reports: dict[str, dict[int, Obstacle]] = field(default_factory=dict)


class Meeting:
    """Robots in one world.

    Args:
        robots: Each with its controller and its body, standing at its place; time 0, the first robot first.
        world: That all of them have a copy of.

    Raises:
        UsageError: A body's step does not fit, or the robots do not begin at time 0.
    """

    def __init__(self, robots: Sequence[tuple[Pioneer, RobotBody]], world: World) -> None:
        rise = highest_floor(world)
        steps = {body.dt_ns for _, body in robots}
        if len(steps) != 1 or SLICE_NS % min(steps):
            raise UsageError("robots of one world need bodies of one step, a part of 10 ms")
        self._step_ns = steps.pop()
        presences = [
            Presence(free_name(number, world), pioneer.parameters, body, rise)
            for number, (pioneer, body) in enumerate(robots, start=1)
        ]
        self.seats: tuple[Seat, ...] = tuple(
            Seat(
                index, pioneer, body, presences[index],
                Company([*presences[:index], *presences[index + 1 :]], pioneer.parameters), pioneer.advance_to,
            )
            for index, (pioneer, body) in enumerate(robots)
        )  # fmt: skip
        #: A robot that pushes a thing is near to whatever stands behind it.
        self._margin_m = CLOSING_M + 2 * max((item.reach_m for item in world.obstacles if item.mass_kg > 0), default=0)
        self._times, self._pushed = _Times(), _Pushed()
        for seat in self.seats:
            if isinstance(seat.body, Sociable):
                seat.body.join(seat.company)
            else:
                seat.shown = {}
                for other in seat.company.others:
                    seat.body.place(other.obstacle(other.live))
                    seat.shown[other.name] = other.live
        #: Those who keep copies of the others in their worlds.
        self._copying = tuple(seat for seat in self.seats if seat.shown is not None)
        #: Where all stood at the last sweep, and how much two of them at least were farther apart than near.
        self._swept: list[Stand] = []
        self._loose_m = 0.0
        self._close: tuple[Seat, ...] = ()
        self._alone: tuple[Seat, ...] = self.seats
        self._part()

    @property
    def robots(self) -> tuple[Pioneer, ...]:
        """The robots, the first first."""
        return tuple(seat.pioneer for seat in self.seats)

    def bodies_at(self, now: Nanos) -> list[RobotBody]:
        """Return every robot's body, all brought to a time, for what changes the world of all of them.

        The robots themselves are not to be moved or removed by it.
        """
        self.advance_to(now)
        return [seat.body for seat in self.seats]

    def next_deadline(self) -> Nanos | None:
        """Return when bytes of any robot will come out; None when never."""
        due = [at for seat in self.seats if (at := seat.pioneer.next_deadline()) is not None]
        return min(due, default=None)

    def advance_to(self, limit: Nanos) -> Reached:
        """Bring every robot to a time."""
        self._pass_borders(limit)
        self._live_close(limit)
        for seat in self._alone:
            seat.advance_to(limit)
        return Reached(limit)

    def bring(self, number: int, limit: Nanos) -> None:
        """Bring one robot to a time, and the others as far as it takes; needed before bytes are given to it.

        Args:
            number: Which, from 0.
            limit: Until when, nanoseconds.
        """
        self._pass_borders(limit)
        seat = self.seats[number]
        if seat.company.is_close:
            self._live_close(limit)
        else:
            seat.advance_to(limit)

    def snapshot(self) -> object:
        """Return all that decides the future, every robot included, as a plain value."""
        return {
            "robots": tuple(seat.pioneer.snapshot() for seat in self.seats),
            "times": (self._times.slice_end, self._times.step_border),
            "stands": tuple((tuple(seat.presence.live), tuple(seat.presence.at_border)) for seat in self.seats),
            "near": tuple(tuple(self._numbers_near(seat)) for seat in self.seats),
            "shown": tuple(
                None if seat.shown is None else tuple((name, tuple(stand)) for name, stand in seat.shown.items())
                for seat in self.seats
            ),
            "pushed": {name: dict(reports) for name, reports in self._pushed.reports.items()},
        }

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned, in this meeting or in a new one of the same robots and world."""
        assert isinstance(snapshot, dict)  # noqa: S101  # our own value
        self._times = _Times(*snapshot["times"])
        self._pushed = _Pushed({name: dict(reports) for name, reports in snapshot["pushed"].items()})
        rows = zip(self.seats, snapshot["robots"], snapshot["stands"], snapshot["near"], snapshot["shown"], strict=True)
        for seat, robot, (live, at_border), near, shown in rows:
            seat.pioneer.restore(robot)
            seat.presence.live, seat.presence.at_border = Stand(*live), Stand(*at_border)
            seat.company.come_near(self.seats[number].presence for number in near)
            seat.shown = None if shown is None else {name: Stand(*stand) for name, stand in shown}
        self._loose_m = 0.0  # sweep at the next border
        self._sort()

    # Within a slice ------------------------------------------------------------------

    def _pass_borders(self, limit: Nanos) -> None:
        """Bring everybody past every border before a time."""
        while (end := self._times.slice_end) < limit:
            self._live_close(end)
            for seat in self._alone:
                seat.advance_to(end)
            self._times.slice_end += SLICE_NS
            self._times.step_border = end
            self._look_around()

    def _live_close(self, limit: Nanos) -> None:
        """Bring those that are near to somebody to a time of this slice, step by step together."""
        close, times = self._close, self._times
        while close and times.step_border < limit:
            start = times.step_border
            for seat in close:  # what is due until all have made the last step
                seat.advance_to(start)
            for seat in close:
                seat.advance_to(start + 1)  # the least time that takes the body to its next step
                seat.presence.look()
                self._take_pushed(seat)
                self._show(seat.presence, seat.presence.live, only_close=True)
            times.step_border = start + self._step_ns
        for seat in close:
            seat.advance_to(limit)

    def _take_pushed(self, seat: Seat) -> None:
        """Note what a robot has pushed; those that live with it step by step see it at once."""
        for item in seat.body.take_moved():
            if item.walk is not None:
                continue
            reports = self._pushed.reports.setdefault(item.name, {})
            if seat.company.is_close:
                for other in self._close:
                    reports.pop(other.number, None)
                    if other is not seat:
                        other.body.move(item.name, item.x_m, item.y_m, item.heading_rad)
            reports[seat.number] = item

    def _show(self, presence: Presence, stand: Stand, *, only_close: bool = False) -> None:
        """Move a robot in the worlds of those that keep a copy of it there."""
        name = presence.name
        for seat in self._copying:
            if only_close and not seat.company.is_close:
                continue
            if seat.shown is not None and seat.presence is not presence and seat.shown[name] != stand:
                presence.move_in(seat.body, stand)
                seat.shown[name] = stand

    # At a border ---------------------------------------------------------------------

    def _look_around(self) -> None:
        """Show everybody where all the others and the pushed things are now."""
        for seat in self._alone:
            seat.presence.look()
            self._take_pushed(seat)
        self._spread_pushed()
        for seat in self.seats:
            seat.presence.at_border = seat.presence.live
            self._show(seat.presence, seat.presence.live)
        self._part()

    def _spread_pushed(self) -> None:
        for name, reports in self._pushed.reports.items():
            believed = min(reports, key=lambda number: (self._distance(number, reports[number]), number))
            item, is_close = reports[believed], self.seats[believed].company.is_close
            for seat in self.seats:
                if seat.number != believed and not (is_close and seat.company.is_close):
                    seat.body.move(name, item.x_m, item.y_m, item.heading_rad)
        self._pushed.reports.clear()

    def _distance(self, number: int, item: Obstacle) -> float:
        stand = self.seats[number].presence.live
        return math.dist((stand.x_m, stand.y_m), (item.x_m, item.y_m))

    def _part(self) -> None:
        """Find who could touch whom before the next border: sweep along x over circles around the hulls."""
        if not self._close and self._is_as_swept():
            return
        near: dict[int, list[int]] = {}
        row = sorted((*seat.presence.live[:2], seat.presence.reach_m, seat.number) for seat in self.seats)
        farthest = max(reach for _, _, reach, _ in row) + self._margin_m + LOOSE_M
        self._loose_m = LOOSE_M
        for place, (x, y, reach, number) in enumerate(row):
            for other in range(place + 1, len(row)):
                other_x, other_y, other_reach, other_number = row[other]
                if other_x - x > reach + farthest:
                    break
                between_m = math.hypot(other_x - x, other_y - y) - reach - other_reach - self._margin_m
                if between_m < 0:
                    near.setdefault(number, []).append(other_number)
                    near.setdefault(other_number, []).append(number)
                self._loose_m = min(self._loose_m, between_m)
        self._swept = [seat.presence.live for seat in self.seats]
        if not near and not self._close:
            return
        for seat in self.seats:
            numbers = sorted(near.get(seat.number, ()))
            seat.company.come_near(self.seats[number].presence for number in numbers)
        self._sort()

    def _is_as_swept(self) -> bool:
        """Tell whether nobody has moved so far since the last sweep that two could be near to each other now."""
        allowed_m = self._loose_m / 2
        return allowed_m > 0 and all(
            math.hypot(seat.presence.live[0] - before[0], seat.presence.live[1] - before[1]) < allowed_m
            for seat, before in zip(self.seats, self._swept, strict=True)
        )

    def _sort(self) -> None:
        self._close = tuple(seat for seat in self.seats if seat.company.is_close)
        self._alone = tuple(seat for seat in self.seats if not seat.company.is_close)

    def _numbers_near(self, seat: Seat) -> list[int]:
        return [other.number for other in self.seats if other.presence in seat.company.close_to]
