"""Robots that share one world: their controllers, brought through time together with the scene of their bodies.

Theory of operation
-------------------
The scene steps every body at once, 1 ms at a time. Before a step, what is due with any robot until then
(packets, pings, bytes of its line) happens in the order of the times, at the same time the first robot first;
then every controller gives its set-points, the scene moves all robots, and every controller takes its
wheels' angles. So robots meet, push and sense each other where they are at that step.

A sonar hears another robot's ping that is still under way when it fires (`PingTable`).

Invariant: what happens depends on the order of the robots and on the bytes and their times,
not on how often a caller calls `advance_to`, nor for which robot first.

Not modelled: a ping that another robot sends while a sonar listens already.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from p2os.pioneer.body.contract import RobotBody, RobotScene
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.sonar.cross_talk import PingTable
from simbase.errors import UsageError
from simbase.state import Stateful
from simbase.timing import Nanos, Reached

#: Nothing will ever be due.
NEVER: Nanos = 1 << 62


@dataclass(slots=True)
class WorldMember(Stateful):
    """One robot of a multi-robot world."""

    STATE = ("pioneer",)
    DERIVED = ("due",)

    number: int
    pioneer: Pioneer
    body: RobotBody
    #: Brings the robot to a time: with what its line delivers until then, if it has one.
    advance_to: Callable[[Nanos], object]
    #: Returns when anything is due with it or its line; None when never.
    next_due: Callable[[], Nanos | None]
    #: The same as of the last look; None: look again.
    due: Nanos | None = None

    def _restored(self) -> None:
        self.due = None


class MultiRobotWorld(Stateful):
    """Robots in one world.

    Args:
        robots: Their controllers, the first robot first, at time 0; their bodies are those of the scene, in its order.
        scene: Of their bodies, standing at their places.
        cross_talk: Whether sonar hear the pings of other robots.

    Raises:
        UsageError: The controllers' bodies are not those of the scene.
    """

    STATE = ("scene", "members", "_at", "_pings")

    def __init__(self, robots: Sequence[Pioneer], scene: RobotScene, *, cross_talk: bool = True) -> None:
        if [robot.body for robot in robots] != list(scene.bodies):
            raise UsageError("the robots of one world need the bodies of its scene, in its order")
        self.scene = scene
        self.members: tuple[WorldMember, ...] = tuple(
            WorldMember(index, pioneer, body, pioneer.advance_to, pioneer.next_due)
            for index, (pioneer, body) in enumerate(zip(robots, scene.bodies, strict=True))
        )
        #: All bodies stand at this step.
        self._at: Nanos = 0
        self._pings = PingTable(scene.bodies)
        if cross_talk:
            for index, pioneer in enumerate(robots):
                pioneer.hears = self._pings.ears_of(index)

    @property
    def robots(self) -> tuple[Pioneer, ...]:
        """The robots, the first first."""
        return tuple(member.pioneer for member in self.members)

    @property
    def names(self) -> tuple[str, ...]:
        """What the robots are called among the things of the world."""
        return tuple(member.body.robot_name for member in self.members)

    def scene_at(self, now: Nanos) -> RobotScene:
        """Return the scene, brought to a time, for what changes the world of all robots."""
        self.advance_to(now)
        return self.scene

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
        leaving = [member.body for member in chosen]
        for body in leaving:
            if (other := body.who_stands_at_start(leaving)) is not None:
                raise UsageError(
                    f"{other} stands where {body.robot_name} starts", hint="drive it away, or put all back: reset"
                )
        for member in chosen:
            member.pioneer.start_over(now)

    def enter_world(self, scene: RobotScene, raw_name: bytes, now: Nanos) -> None:
        """Go on in another world, where all robots stand at their places.

        Args:
            scene: Of the same robots in the same order.
            raw_name: The world's, for the robots' clients.
            now: The time to which the robots were brought, nanoseconds.
        """
        self.scene = scene
        self._pings.enter_world(scene.bodies)
        for member, body in zip(self.members, scene.bodies, strict=True):
            member.body = body
            member.pioneer.enter_world(body, raw_name, now)
            self._look(member)

    def next_deadline(self) -> Nanos | None:
        """Return when bytes of any robot will come out; None when never."""
        due = [at for member in self.members if (at := member.pioneer.next_deadline()) is not None]
        return min(due, default=None)

    def advance_to(self, limit: Nanos) -> Reached:
        """Bring every robot to a time."""
        self._run(limit)
        for member in self.members:
            member.due = None  # the caller may give bytes to any
        return Reached(limit)

    def bring(self, number: int, limit: Nanos) -> None:
        """Bring all robots to a time, before bytes are given to one of them.

        Args:
            number: Which, from 0.
            limit: Until when, nanoseconds.
        """
        self._run(limit)
        self.members[number].due = None

    def _run(self, limit: Nanos) -> None:
        for member in self.members:
            if member.due is None:
                self._look(member)
        step_ns = self.scene.dt_ns
        robots = self.robots
        while self._at < limit:
            self._act(self._at)
            wheels = self.scene.step([robot.next_setpoints() for robot in robots])
            self._at += step_ns
            for robot, turned in zip(robots, wheels, strict=True):
                robot.take_step(turned)
        self._act(limit)

    def _act(self, limit: Nanos) -> None:
        """Let happen what is due until a time, in the order of the times."""
        members = self.members
        while (member := min(members, key=_due_of)).due is not None and member.due <= limit:
            member.advance_to(member.due)
            self._look(member)

    @staticmethod
    def _look(member: WorldMember) -> None:
        due = member.next_due()
        member.due = NEVER if due is None else due


def _due_of(member: WorldMember) -> Nanos:
    return NEVER if member.due is None else member.due
