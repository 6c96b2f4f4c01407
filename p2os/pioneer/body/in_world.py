"""What every body keeps of the world around its robot: the things that can change, and the collisions.

Obstacles stand in a plan by name; what walks follows its path by the count of steps; what has
moved is remembered until somebody takes it. How the robot itself moves is the body's own.

Invariant: a thing that walks is where its path leads at the step to which the body was brought.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

from p2os.errors import WorldError
from p2os.pioneer.body.contacts import ContactCounter
from p2os.pioneer.body.contract import STEP_NS, Hit
from p2os.pioneer.world.model import Obstacle, Walker, World
from p2os.pioneer.world.plan import Plan, StaticPlan
from p2os.pioneer.world.start_places import floor_height
from p2os.robots.parameters import RobotParameters
from simbase.errors import shown
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos

DT_S = STEP_NS / NS_PER_S


class BodyInWorld(Stateful):
    """The part of a body that all of them share."""

    STATE: ClassVar[tuple[str, ...]] = ("_steps", "_plan", "_walking", "_moved_things", "_contacts")
    DERIVED: ClassVar[tuple[str, ...]] = ("_walkers",)

    dt_ns: Nanos = STEP_NS

    def __init__(self, world: World, parameters: RobotParameters) -> None:
        self._world, self._parameters = world, parameters
        self._static = StaticPlan(world, parameters)
        self._begin()

    def _begin(self) -> None:
        """Count from step 0, in the world as it was made."""
        self._steps = 0
        self._plan = Plan((), self._parameters, self._static)
        #: What walks, and the step at which it began.
        self._walking: dict[str, int] = {}
        self._walkers: dict[str, Walker] = {}
        self._moved_things: dict[str, None] = {}
        self._contacts = ContactCounter()
        for item in self._world.obstacles:
            if not item.fixed:
                self._enter(item)

    def _restored(self) -> None:
        walks = {item.name: item.walk for item in self._plan.obstacles}
        self._walkers = {name: Walker(walk) for name in self._walking if (walk := walks[name]) is not None}

    def put_back(self) -> None:
        """Put what was pushed where the world has it."""
        for item in self._plan.pushable(self._world):
            self.move(item.name, item.x_m, item.y_m, item.heading_rad)
            self._moved_things[item.name] = None

    def _place_for(self, x_m: float, y_m: float, heading_rad: float) -> float:
        """Return the height of the floor where the robot can stand.

        Raises:
            WorldError: A thing stands there, or there is no level floor.
        """
        self._tell_plan()
        where, world = f"{x_m:g}, {y_m:g} m", shown(self._world.name)
        if not self._world.contains(x_m, y_m):
            raise WorldError(f"{where} is not in world {world}")
        if self._plan.clearance(x_m, y_m, heading_rad, no_more_than=1.0) == 0.0:
            names = self._plan.touched(x_m, y_m, heading_rad)
            raise WorldError(f"{where} in world {world} is inside {shown(names[0]) if names else 'a low thing'}")
        height_m = floor_height(self._world, x_m, y_m)
        if height_m is None:
            raise WorldError(f"{where} in world {world} is on a slope")
        return height_m

    def place(self, obstacle: Obstacle) -> None:
        """Put an obstacle with a new name into the world; one that walks begins at its first point, now."""
        self._placed(self._enter(obstacle))
        self._changed()

    def move(self, name: str, x_m: float, y_m: float, heading_rad: float) -> None:
        """Put an obstacle somewhere else; one that walks stays there."""
        moved = self._plan.move(name, x_m, y_m, heading_rad)
        self._walking.pop(name, None)
        self._put(moved)
        self._changed()

    def remove(self, name: str) -> None:
        """Take an obstacle out of the world."""
        self._plan.remove(name)
        self._walking.pop(name, None)
        self._removed(name)
        self._changed()

    def take_moved(self) -> list[Obstacle]:
        """Return what has walked or was pushed since this was asked last, where it is now."""
        self._tell_plan()
        if not self._moved_things:
            return []
        moved, self._moved_things = self._moved_things, {}
        return [item for item in self._plan.obstacles if item.name in moved]

    def take_hits(self) -> list[Hit]:
        """Return the collisions since this was asked last."""
        return self._contacts.take_hits()

    def _enter(self, obstacle: Obstacle) -> Obstacle:
        """Put an obstacle into the plan; return it where it stands now."""
        if obstacle.walk is not None:
            walker = Walker(obstacle.walk)
            x, y, heading = walker.pose_at(0.0)
            obstacle = replace(obstacle, x_m=x, y_m=y, heading_rad=heading)
        self._plan.place(obstacle)
        if obstacle.walk is not None:
            self._walking[obstacle.name], self._walkers[obstacle.name] = self._steps, walker
        return obstacle

    def _walked(self) -> Iterator[tuple[str, tuple[float, float, float]]]:
        """Return the name and the pose, by now, of everything that walks."""
        for name, since in self._walking.items():
            yield name, self._walkers[name].pose_at((self._steps - since) * DT_S)

    def _note_hit(self, name: str, x_m: float, y_m: float) -> None:
        """Remember a collision."""
        self._contacts.note(Hit(at_ns=self._steps * STEP_NS, name=name, x_m=x_m, y_m=y_m))

    # What a body that has an engine, or remembers what is around it, does beside --------------

    def _placed(self, item: Obstacle) -> None:
        """Make an obstacle that is in the plan now."""

    def _put(self, item: Obstacle) -> None:
        """Put an obstacle that was made where it stands now."""

    def _removed(self, name: str) -> None:
        """Take out an obstacle that is no longer in the plan."""

    def _changed(self) -> None:
        """Prepare for a plan that is another one now."""

    def _tell_plan(self) -> None:
        """Let the plan know where things are that an engine moves."""
