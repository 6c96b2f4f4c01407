"""What parts on the board sense of the bench's world: the robot's body, as it stood at its last step.

The body is brought to each of its steps while there are such parts, so that what a part is told at a time is the same
whatever else is looked at. Acceleration is the change of speed over a step: a physical body that touches something
shakes.

Not modelled: roll, which no body tells; the vertical acceleration on the way onto a ramp.
Invariant: between two steps of the body every answer of `motion` is the same.
"""

import math
from collections.abc import Callable

from bluepill_sim.fabric.surroundings import GRAVITY_MPS2, BoardMotion
from p2os.pioneer.body.contract import BodyState, RobotBody
from p2os.pioneer.sonar.ring import Cone
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos, Reached

#: chosen: so many rays across a sensor's cone, one of them in its middle.
RAYS = 7


class WorldSenses(Stateful):
    """A follower of the bench's loop that parts ask.

    Args:
        body: Whose world it is.
        bring_to: Brings the body to a time.
    """

    STATE = ("_steps", "_motion", "_before")

    def __init__(self, body: RobotBody, bring_to: Callable[[Nanos], None]) -> None:
        self._body, self._bring_to = body, bring_to
        self._steps = 0
        self._before = body.state
        self._motion = motion_of(self._before, self._before, body.dt_ns)

    def next_deadline(self) -> Nanos:
        """Return the end of the body's next step."""
        return (self._steps + 1) * self._body.dt_ns

    def advance_to(self, limit: Nanos) -> Reached:
        """Look at the body at the end of each step that has ended."""
        while (due := self.next_deadline()) <= limit:
            self._bring_to(due)
            state = self._body.state
            self._motion = motion_of(self._before, state, self._body.dt_ns)
            self._before = state
            self._steps += 1
        return Reached(limit)

    def motion(self) -> BoardMotion:
        """Return how the robot moved in the body's last step."""
        return self._motion

    def range_m(self, x_m: float, y_m: float, heading_rad: float, cone_rad: float, longest_m: float) -> float:
        """Return how far away the nearest thing is that one of some rays of a cone meets."""
        headings = tuple(heading_rad + cone_rad * (n / (RAYS - 1) - 0.5) for n in range(RAYS))
        rays = Cone(x_m, y_m, headings, tuple((math.cos(one), math.sin(one)) for one in headings))
        return min(self._body.scan(rays, longest_m))


def motion_of(before: BodyState, state: BodyState, dt_ns: Nanos) -> BoardMotion:
    """Return how a body moves that was in one state before a step and is in another after it."""
    dt_s = dt_ns / NS_PER_S
    faster = (state.forward_mps - before.forward_mps) / dt_s
    nodding = (state.pitch_rad - before.pitch_rad) / dt_s
    return BoardMotion(
        x_m=state.x_m,
        y_m=state.y_m,
        z_m=state.z_m,
        heading_rad=state.heading_rad,
        pitch_rad=state.pitch_rad,
        forward_mps=state.forward_mps,
        # About y, which points left, nose up is negative.
        rates_radps=(0.0, -nodding, state.turn_radps),
        force_mps2=(
            faster + GRAVITY_MPS2 * math.sin(state.pitch_rad),
            state.forward_mps * state.turn_radps,
            GRAVITY_MPS2 * math.cos(state.pitch_rad),
        ),
    )
