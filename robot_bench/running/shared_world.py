"""Several robots in one world, each with its own chip, wires and run loop, brought through time together.

Theory of operation. The scene steps all bodies at once. It stands at the boundary T of a step when every loop has run
to T, with all that is due until then; then each robot gives its set-points, the scene moves all of them to the next
boundary, and the loops run on to that. So robots meet, push and sense each other where they are at that step. What a
robot does between two boundaries it does with its body at the later one, as `p2os.pioneer.serve.multi_robot_world` has
it. Sonar hear each other's pings: where one may fire between two boundaries, all loops stop at that instant, and the
first robot is the first.

A robot on own pins moves a step later than alone: its motors' wires are known over a step when the step is over.

Invariant: what happens depends on the order of the robots alone, not on how often or how far `run_to` is called.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

from p2os.pioneer.body.contract import RobotBody, RobotScene, WheelAngles
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.sonar.cross_talk import PingTable
from simbase.state import Stateful
from simbase.timing import Nanos


class Driven(Protocol):
    """A robot whose body is stepped together with others."""

    def next_setpoints(self) -> tuple[float, float]:
        """Return the rim-speed set-points of the body's next step, m/s."""
        ...

    def take_step(self, wheels: WheelAngles) -> None:
        """Take the wheels' angles after a step that was made with `next_setpoints`."""
        ...


class Member(Protocol):
    """A bench with one of the robots."""

    @property
    def own_end(self) -> Nanos:
        """When its run ends."""
        ...

    def run_own_loop(self, end: Nanos) -> None:
        """Run its chip and all parts to a time, and no further than the scene stands."""
        ...

    def own_snapshot(self) -> object:
        """Return all that decides its future, but for the scene."""
        ...

    def restore_own(self, snapshot: object) -> None:
        """Put back what `own_snapshot` returned."""
        ...


class _Own:
    """A bench as a part of its world."""

    def __init__(self, member: Member) -> None:
        self._member = member

    def snapshot(self) -> object:
        """Return the bench's state without that of the scene."""
        return self._member.own_snapshot()

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""
        self._member.restore_own(snapshot)


class SharedWorld(Stateful):
    """Robots in one world.

    Args:
        scene: Of all their bodies, standing at their places.
        names: What they are called, in the scene's order.
    """

    STATE = ("scene", "now", "_at", "_pings", "_own")
    #: Who they are is settled when they are built.
    DERIVED = ("members", "on_step", "_driven", "_pioneers")

    def __init__(self, scene: RobotScene, names: Sequence[str]) -> None:
        self.scene = scene
        self.names = tuple(names)
        scene.name_robots(self.names)
        #: The benches of those that have a chip, by name.
        self.members: dict[str, Member] = {}
        self._own: tuple[_Own, ...] = ()
        self._driven: dict[int, Driven] = {}
        self._pioneers: list[Pioneer] = []
        self._pings = PingTable(scene.bodies)
        #: Called before each step of the scene with the time reached; may raise to end the run.
        self.on_step: Callable[[Nanos], None] | None = None
        #: The time that all loops have run to, and where the scene stands.
        self.now: Nanos = 0
        self._at: Nanos = 0

    def body_of(self, name: str) -> RobotBody:
        """Return a robot's body."""
        return self.scene.bodies[self.names.index(name)]

    def join(self, name: str, member: Member, driven: Driven) -> None:
        """Take the bench of a robot, and what drives its body."""
        number = self.names.index(name)
        self.members[name] = member
        self._own = (*self._own, _Own(member))
        self._driven[number] = driven
        if isinstance(driven, Pioneer):
            driven.hears = self._pings.ears_of(number)
            self._pioneers.append(driven)

    @property
    def end(self) -> Nanos:
        """When the run ends, as far as is known now: with the first of them."""
        return min(member.own_end for member in self.members.values())

    def run_to(self, wanted: Nanos) -> None:
        """Bring all to a time, or to the end of the run."""
        while True:
            end = min(wanted, self.end)
            self._run_loops(min(self._at, end))
            if end <= self._at:
                return
            if self.on_step is not None:
                self.on_step(self.now)
            self._step()

    def _run_loops(self, limit: Nanos) -> None:
        """Run all loops to a time, together at each instant at which a sonar may fire."""
        stop: Nanos = -1
        while stop < limit:
            dues = (pioneer.next_due() for pioneer in self._pioneers)
            stop = min((limit, *(due for due in dues if due is not None and due > self.now)))
            for member in self.members.values():
                member.run_own_loop(stop)
            self.now = max(self.now, stop)

    def _step(self) -> None:
        still = (0.0, 0.0)
        setpoints = [
            self._driven[number].next_setpoints() if number in self._driven else still
            for number in range(len(self.names))
        ]
        wheels = self.scene.step(setpoints)
        self._at += self.scene.dt_ns
        for number, driven in self._driven.items():
            driven.take_step(wheels[number])
