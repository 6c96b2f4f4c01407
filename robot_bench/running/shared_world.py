"""Several robots in one world, each with its own chip, wires and run loop, brought through time together.

Theory of operation. Robots meet in the scene alone, which steps all bodies at once. Nobody looks at it, and no
set-point changes but by what a robot's own wires and ramps say, until a part of some robot is due. So every chip runs
to the earliest deadline of its own robot in one go, however far the others have come. Then the earliest of all comes:
the scene makes its steps until there, each with the set-points of its own time, and whoever is due acts; at one
instant the first robot is the first. What a robot does between two boundaries of steps it does with its body at the
later one, as `p2os.pioneer.serve.multi_robot_world` has it. Sonar hear each other's pings, so each is a deadline.

A robot on own pins is due at each step, and moves a step later than alone: its motors' wires are known over a step
when the step is over.

Invariant: what happens depends on the order of the robots alone, not on how often or how far `run_to` is called.
"""

from collections.abc import Sequence
from typing import Protocol

from p2os.pioneer.body.contract import RobotBody, RobotScene, Wheels
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.sonar.cross_talk import PingTable
from robot_bench.running.loop import RunLoop
from simbase.state import Stateful
from simbase.timing import Nanos


class SharedRobot(Protocol):
    """A robot whose body is stepped together with others."""

    def next_setpoints(self) -> tuple[float, float]:
        """Return the rim-speed set-points of the body's next step, m/s."""

    def take_step(self, wheels: Wheels) -> None:
        """Take the wheels' angles after a step that was made with `next_setpoints`."""


class HandOnWheels(Protocol):
    """A hand that may turn the wheels of such a robot; a part of the robot's own state."""

    @property
    def rims(self) -> tuple[float, float] | None:
        """The rim speeds that it wants in place of the set-points, m/s; None: it lets the robot drive."""


class BenchMember(Protocol):
    """The run of one of the robots."""

    @property
    def end(self) -> Nanos:
        """When it would end if this robot were alone."""

    @property
    def loop(self) -> RunLoop:
        """Brings its chip and all its parts forward."""

    def snapshot(self) -> object:
        """Return all that decides its future, but for the scene."""

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned."""


class SharedWorld(Stateful):
    """Robots in one world.

    Args:
        scene: Of all their bodies, standing at their places.
        names: What they are called, in the scene's order.
    """

    STATE = ("scene", "now", "_at", "_pings", "_own")
    #: Who they are is settled when they are built.
    DERIVED = ("members", "_driven", "_in_hand")

    def __init__(self, scene: RobotScene, names: Sequence[str]) -> None:
        self.scene = scene
        self.names = tuple(names)
        scene.name_robots(self.names)
        #: The runs of those that have a chip, by name.
        self.members: dict[str, BenchMember] = {}
        self._own: tuple[BenchMember, ...] = ()
        self._driven: dict[int, SharedRobot] = {}
        self._in_hand: dict[int, HandOnWheels] = {}
        self._pings = PingTable(scene.bodies)
        #: The time until which all has happened, and where the scene stands.
        self.now: Nanos = 0
        self._at: Nanos = 0

    def body_of(self, name: str) -> RobotBody:
        """Return a robot's body."""
        return self.scene.bodies[self.names.index(name)]

    def join(self, name: str, member: BenchMember, driven: SharedRobot, hand: HandOnWheels) -> None:
        """Take the run of a robot, what drives its body, and the hand that may drive it in place of that."""
        number = self.names.index(name)
        self.members[name] = member
        self._own = (*self._own, member)
        self._driven[number], self._in_hand[number] = driven, hand
        if isinstance(driven, Pioneer):
            driven.hears = self._pings.ears_of(number)

    @property
    def end(self) -> Nanos:
        """When the run ends, as far as is known now: with the first of them."""
        return min(member.end for member in self.members.values())

    def run_to(self, wanted: Nanos) -> None:
        """Bring all to a time, or to the end of the run."""
        loops = [member.loop for member in self.members.values()]
        end = min(wanted, self.end)
        for loop in loops:
            loop.begin(end)
        while (at := min((due for loop in loops if (due := loop.lead()) is not None), default=None)) is not None:
            self._bring_scene(at)
            for loop in loops:
                while loop.lead() == at:
                    loop.follow(at)
            end = min(wanted, self.end)
            for loop in loops:
                loop.end_at(end)
        self._bring_scene(end)

    def _bring_scene(self, limit: Nanos) -> None:
        """Step the scene to its first boundary at or after a time that nobody is due before."""
        while self._at < limit:
            self._step()
        self.now = max(self.now, limit)

    def _step(self) -> None:
        setpoints = [(0.0, 0.0)] * len(self.names)
        for number, driven in self._driven.items():
            own = driven.next_setpoints()  # its ramps go on under a hand, too
            by_hand = self._in_hand[number].rims
            setpoints[number] = own if by_hand is None else by_hand
        wheels = self.scene.step(setpoints)
        self._at += self.scene.dt_ns
        for number, driven in self._driven.items():
            driven.take_step(wheels[number])
